//! The words of messages: the user's own texts, quoted and without what a terminal or a CI server would act on; lists and counts.

use std::fmt::Display;

/// The user's own text in a message: between backticks, cut to a readable length, and with the codes of characters that a
/// terminal acts on.
pub(crate) fn quoted(text: &str) -> String {
    const LONGEST: usize = 80;
    let mut shown = String::from("`");
    for (count, c) in text.chars().enumerate() {
        if count == LONGEST {
            shown.push('…');
            break;
        }
        if is_unprintable(c) { shown.extend(c.escape_default()) } else { shown.push(c) }
    }
    shown.push('`');
    shown
}

/// Whether a terminal acts on a character rather than showing it: control characters, and Unicode's invisible ones that
/// reorder text.
fn is_unprintable(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{61c}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}')
        || matches!(c, '\u{feff}' | '\u{fff9}'..='\u{fffb}' | '\u{fffe}' | '\u{ffff}')
}

/// The character as it may be shown: `\u{fffd}` for each one that a terminal acts on.
pub(crate) fn printable_char(c: char) -> char {
    if is_unprintable(c) { char::REPLACEMENT_CHARACTER } else { c }
}

/// The text with as many characters, of which a terminal acts on none.
pub(crate) fn printable(text: &str) -> String {
    text.chars().map(printable_char).collect()
}

/// Lines of text with the codes of characters that a terminal acts on, such as `\u{1b}`, and without commands to CI servers.
/// Line feeds are kept, so names in the lines must have gone through [`on_one_line`].
pub(crate) fn escaped(text: &str) -> String {
    let lines: Vec<String> = text.split('\n').map(on_one_line).collect();
    lines.join("\n")
}

/// A name or a sentence as [`escaped`] shows it, and its line feeds as `\n`: what comes after one would begin a line.
pub(crate) fn on_one_line(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        if is_unprintable(c) { shown.extend(c.escape_default()) } else { shown.push(c) }
    }
    without_commands(&shown)
}

/// Lines of text without commands that CI servers look for in logs. GitHub's are lines that begin with `::`, after any
/// blanks, and `##[` anywhere; Azure's are `##vso[` anywhere.
pub(crate) fn without_commands(text: &str) -> String {
    let lines: Vec<String> = text
        .split('\n')
        .map(|line| {
            let words = line.trim_start();
            let blanks = &line[..line.len() - words.len()];
            let words = words.strip_prefix("::").map_or(words.to_owned(), |rest| format!("\\u{{3a}}:{rest}"));
            format!("{blanks}{}", without_brackets(&words, "\\u{23}"))
        })
        .collect();
    lines.join("\n")
}

/// The text with `code` in place of the second `#` of each `##[` and `##vso[`.
fn without_brackets(text: &str, code: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(at) = rest.find("##") {
        let after = &rest[at + 2..];
        let is_command =
            after.starts_with('[') || after.get(..4).is_some_and(|word| word.eq_ignore_ascii_case("vso["));
        shown.push_str(&rest[..=at]);
        if is_command {
            shown.push_str(code);
            rest = after;
        } else {
            rest = &rest[at + 1..];
        }
    }
    shown + rest
}

/// JSON that says the same, without a character that a terminal acts on and without commands to CI servers. No line of JSON
/// begins with `::`. The escapes are TOML's, too.
pub(crate) fn harmless_json(json: &str) -> String {
    let mut shown = String::with_capacity(json.len());
    for c in json.chars() {
        // All of them have four digits; those below U+0020 are escaped in JSON anyway.
        if is_unprintable(c) && c != '\n' {
            shown += &format!("\\u{:04x}", u32::from(c));
        } else {
            shown.push(c);
        }
    }
    without_brackets(&shown, "\\u0023")
}

/// `a`, `b` and `c`, each quoted.
pub(crate) fn list<'a>(words: impl IntoIterator<Item = &'a str>, conjunction: &str) -> String {
    let words: Vec<String> = words.into_iter().map(quoted).collect();
    if words.is_empty() { "nothing".to_owned() } else { joined(&words, conjunction) }
}

/// The words as they stand: a, b and c.
pub(crate) fn joined(words: &[String], conjunction: &str) -> String {
    match words.split_last() {
        None => String::new(),
        Some((only, [])) => only.clone(),
        Some((last, before)) => format!("{} {conjunction} {last}", before.join(", ")),
    }
}

/// A number in a message: without an exponent, unless it has more zeros than anyone would count.
pub(crate) fn number(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 || !size.is_finite() || (1e-9..1e12).contains(&size) {
        format!("{value}")
    } else {
        format!("{value:e}")
    }
}

/// A count with its noun: `1 return`, `3 returns`.
pub(crate) fn counted<N: Display + PartialEq + From<u8>>(count: N, noun: &str) -> String {
    let s = if count == N::from(1) { "" } else { "s" };
    format!("{count} {noun}{s}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_any_size_are_short() {
        let shown: Vec<_> = [0.0, 0.3, 36.5, -2e6, 1e-300, 64e-300, 1e300].map(number).into();
        assert_eq!(shown, ["0", "0.3", "36.5", "-2000000", "1e-300", "6.4e-299", "1e300"]);
    }

    #[test]
    fn user_text_is_harmless_in_a_message() {
        assert_eq!(quoted("wall é"), "`wall é`");
        assert_eq!(quoted("\u{1b}[31m\u{202e}"), "`\\u{1b}[31m\\u{202e}`");
        assert_eq!(quoted(&"x".repeat(1000)).chars().count(), 83);
    }

    #[test]
    fn no_text_takes_over_a_terminal() {
        let name = "wall\x1b[2J\r\u{202e}gnp.exe\u{9b}1m\nsecond — ünïcode";
        assert_eq!(escaped(name), "wall\\u{1b}[2J\\r\\u{202e}gnp.exe\\u{9b}1m\nsecond — ünïcode");
        assert_eq!(printable("a\x1b[2J\té"), "a\u{fffd}[2J\u{fffd}é");
    }

    /// The case github-command-injection, at its root.
    #[test]
    fn no_text_commands_a_ci_server() {
        assert_eq!(on_one_line("a\n::add-mask::e"), "a\\n::add-mask::e");
        assert_eq!(escaped("a\n \t::error::b"), "a\n \\t::error::b");
        assert_eq!(escaped("a\n \u{2003}::error::b\n::c"), "a\n \u{2003}\\u{3a}:error::b\n\\u{3a}:c");
        assert_eq!(on_one_line("::error::b: c"), "\\u{3a}:error::b: c");
        assert_eq!(
            escaped("x ##[group]y ##VSO[task] ###[z # ##"),
            "x #\\u{23}[group]y #\\u{23}VSO[task] ##\\u{23}[z # ##"
        );
        let value = serde_json::json!({ "::a\n##[b": "\u{9b}\u{202e}##vso[\u{7f}é" });
        let shown = harmless_json(&format!("{value:#}"));
        assert_eq!(serde_json::from_str::<serde_json::Value>(&shown).unwrap(), value);
        assert!(
            shown.chars().all(|c| printable_char(c) == c || c == '\n') && !shown.contains("##"),
            "{shown}"
        );
    }

    #[test]
    fn lists_read_as_english() {
        assert_eq!(list([], "and"), "nothing");
        assert_eq!(list(["a"], "and"), "`a`");
        assert_eq!(list(["a", "b", "c"], "or"), "`a`, `b` or `c`");
        assert_eq!([0_u64, 1, 2].map(|n| counted(n, "node")), ["0 nodes", "1 node", "2 nodes"]);
    }
}
