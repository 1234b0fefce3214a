//! [`Diagnostic`]s for people: each with the line that it is about, marked, and with a suggestion.

use std::ops::Range;

use annotate_snippets::{AnnotationKind, Group, Level, Origin, Renderer, Snippet};

use crate::source::words::{printable, printable_char};
use crate::source::{Diagnostic, Severity};

/// The largest number of lines of a marked text that are shown. A longer text is marked on its first line only.
const MOST_LINES: usize = 40;

/// The largest part of a line that is shown, in characters, and the part of it before the mark.
const WIDEST_LINE: usize = 160;
const LEAD: usize = 40;

/// All diagnostics, one after the other, and their number. The text ends with a line feed. It has no character that a
/// terminal acts on, except those of the colours if `color` is set.
pub fn render(diagnostics: &[Diagnostic], color: bool) -> String {
    let renderer = if color { Renderer::styled() } else { Renderer::plain() };
    let mut text = String::new();
    for diagnostic in diagnostics {
        text += &renderer.render(&[group(diagnostic)]);
        text += "\n\n";
    }
    let count = |severity, noun| {
        let n = diagnostics.iter().filter(|d| d.severity == severity).count();
        (n > 0).then(|| format!("{n} {noun}{}", if n == 1 { "" } else { "s" }))
    };
    let counts =
        [count(Severity::Error, "error"), count(Severity::Warning, "warning"), count(Severity::Note, "note")];
    let counts: Vec<String> = counts.into_iter().flatten().collect();
    if !counts.is_empty() {
        text += &counts.join(", ");
        text.push('\n');
    }
    text
}

fn group(diagnostic: &Diagnostic) -> Group<'_> {
    let level = match diagnostic.severity {
        Severity::Error => Level::ERROR,
        Severity::Warning => Level::WARNING,
        Severity::Note => Level::NOTE,
    };
    let path = printable(&diagnostic.path.to_string_lossy());
    let (line, column) = diagnostic.line_column();
    let title = level.primary_title(printable(&diagnostic.message));
    let is_located = !diagnostic.source.is_empty();
    let mut group = if is_located {
        let excerpt = Excerpt::new(&diagnostic.source, &diagnostic.span);
        let label = Some(printable(&diagnostic.label)).filter(|label| !label.is_empty());
        let mark = AnnotationKind::Primary.span(excerpt.marked).label(label);
        let snippet = Snippet::source(excerpt.shown).line_start(line).annotation(mark);
        if excerpt.is_cut {
            // The renderer would count the column from the cut.
            title.element(Origin::path(path).line(line).char_column(column)).element(snippet)
        } else {
            title.element(snippet.path(path))
        }
    } else {
        title.element(Origin::path(path))
    };
    if let Some(help) = &diagnostic.help {
        group = group.element(Level::HELP.message(printable(help)));
    }
    group
}

/// The lines that a span is on, and the span in them. Long lines are cut, and characters that a terminal acts on are
/// replaced.
struct Excerpt {
    shown: String,
    marked: Range<usize>,
    /// Whether the first line lacks its beginning.
    is_cut: bool,
}

impl Excerpt {
    fn new(source: &str, span: &Range<usize>) -> Self {
        let start = source.floor_char_boundary(span.start);
        let end = source.floor_char_boundary(span.end.max(start));
        let line_start = source[..start].rfind('\n').map_or(0, |at| at + 1);
        let is_long = source[start..end].bytes().filter(|b| *b == b'\n').nth(MOST_LINES).is_some();
        let end = if is_long { start + source[start..end].find('\n').unwrap_or(0) } else { end };
        let line_end = source[end..].find('\n').map_or(source.len(), |at| end + at);

        let mut shown = String::new();
        let mut marked = 0..0;
        // Moves each end of the mark behind the last character that is shown at or before that end of the span.
        let mut track = |position: usize, shown: &str| {
            if position <= start {
                marked.start = shown.len();
            }
            if position <= end {
                marked.end = shown.len();
            }
        };
        let lead = source[line_start..start].chars().count();
        let is_cut = lead > WIDEST_LINE - LEAD;
        let mut line_at = line_start;
        for line in source[line_start..line_end].split('\n') {
            let skipped = if line_at == line_start && is_cut { lead - LEAD } else { 0 };
            if skipped > 0 {
                shown.push('…');
            }
            let mut characters = line.trim_end_matches('\r').char_indices().skip(skipped);
            for (offset, c) in characters.by_ref().take(WIDEST_LINE) {
                track(line_at + offset, &shown);
                shown.push(if c == '\t' { c } else { printable_char(c) });
                track(line_at + offset + c.len_utf8(), &shown);
            }
            if characters.next().is_some() {
                shown.push('…');
            }
            shown.push('\n');
            line_at += line.len() + 1;
            track(line_at, &shown);
        }
        shown.pop();
        Self { shown, marked, is_cut }
    }
}

#[cfg(test)]
mod tests {
    use std::path::PathBuf;

    use super::*;

    fn diagnostic(source: &str, span: Range<usize>) -> Diagnostic {
        Diagnostic {
            severity: Severity::Error,
            code: "",
            key: String::new(),
            message: "`max_m` is the string \"far\"".into(),
            path: PathBuf::from("jobs/a.toml"),
            source: source.into(),
            span,
            label: "expected a number of metres".into(),
            help: Some("such as `max_m = 50.0`".into()),
        }
    }

    #[test]
    fn the_marked_line_is_shown() {
        let text = render(&[diagnostic("[range]\nmax_m = \"far\"\n", 16..21)], false);
        let expected = "\
error: `max_m` is the string \"far\"
 --> jobs/a.toml:2:9
  |
2 | max_m = \"far\"
  |         ^^^^^ expected a number of metres
  |
  = help: such as `max_m = 50.0`

1 error
";
        assert_eq!(text, expected);
    }

    #[test]
    fn errors_and_warnings_are_counted() {
        let warning = Diagnostic { severity: Severity::Warning, ..diagnostic("a = 1", 0..1) };
        let all = [diagnostic("a = 1", 4..5), warning, diagnostic("", 0..0)];
        let text = render(&all, false);
        assert!(text.ends_with("\n2 errors, 1 warning\n"), "{text}");
        assert!(text.contains("warning: `max_m`"), "{text}");
        assert_eq!(render(&[], false), "");
    }

    #[test]
    fn nothing_reaches_the_terminal_raw() {
        let hostile = "a = \"\u{1b}[2J\u{9b}31m\u{202e}\u{7}\r\u{200b}\"\r\n";
        let mut d = diagnostic(hostile, 4..hostile.len());
        d.message = hostile.into();
        d.label = hostile.into();
        d.help = Some(hostile.into());
        d.path = PathBuf::from("\u{1b}]0;title\u{7}.toml");
        let text = render(&[d], false);
        assert!(text.chars().all(|c| printable_char(c) == c || c == '\n'), "{text:?}");
    }

    #[test]
    fn colours_only_when_asked() {
        let d = [diagnostic("[range]\nmax_m = \"far\"\n", 16..21)];
        assert!(!render(&d, false).contains('\u{1b}'));
        assert!(render(&d, true).contains("\u{1b}["));
    }

    #[test]
    fn long_lines_are_cut_around_the_mark() {
        let source = format!("a = [{}\"far\"{}]", "1, ".repeat(100_000), ", 2".repeat(100_000));
        let at = source.find('"').unwrap();
        let text = render(&[diagnostic(&source, at..at + 5)], false);
        assert!(text.len() < 1000, "{} bytes", text.len());
        assert!(text.contains(&format!("jobs/a.toml:1:{}\n", at + 1)), "{text}");
        let lines: Vec<&str> = text.lines().collect();
        let marked = lines.iter().position(|line| line.contains("^^^^^")).unwrap();
        let column = |line: &str, what| line.find(what).map(|at| line[..at].chars().count());
        assert_eq!(column(lines[marked], "^^^^^"), column(lines[marked - 1], "\"far\""), "{text}");
    }

    #[test]
    fn any_span_of_any_text_is_shown() {
        let source = "é = [\r\n\t1,\r\n 日本]\n\n";
        for start in 0..=source.len() + 2 {
            for end in 0..=source.len() + 2 {
                assert!(render(&[diagnostic(source, start..end)], false).ends_with("1 error\n"));
            }
        }
        let many = "\n".repeat(100_000);
        assert!(render(&[diagnostic(&many, 5..90_000)], false).len() < 1000);
    }
}
