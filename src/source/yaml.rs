//! YAML and JSON → [`Node`]. JSON is YAML except for tabs, and OpenCV's dialect of YAML is except for its first line.

use std::ops::Range;

use saphyr_parser::{Event, Parser, ScalarStyle};

use super::tree::{Entries, Entry, Node, Value};
use super::{Report, Span};

/// Deepest nesting that is read: no calibration file comes near.
const MAX_DEPTH: usize = 32;

/// Most values that are read, for the memory that they take.
const MAX_NODES: usize = 1 << 20;

/// A list or a table whose end has not come yet.
struct Open {
    node: Node,
    /// The key of a table that waits for its value.
    key: Option<(String, Span)>,
}

/// Reads a text as YAML or JSON. `None` if it is neither; the report says why.
pub(crate) fn parse(report: &Report, source: u32) -> Option<Node> {
    let text = readable(report.text(source));
    // The parser counts characters.
    let bytes: Option<Vec<usize>> =
        (!text.is_ascii()).then(|| text.char_indices().map(|(at, _)| at).chain([text.len()]).collect());
    let byte = |character: usize| match &bytes {
        Some(bytes) => bytes.get(character).copied().unwrap_or(text.len()),
        None => character.min(text.len()),
    };
    let fail = |range: Range<usize>, message: &str| report.fail(Span::new(source, range), message, "", None);

    let mut parser = Parser::new_from_str(&text);
    let mut open: Vec<Open> = Vec::new();
    let mut nodes = 0;
    loop {
        let (event, range) = match parser.next_event() {
            None => return fail(text.len()..text.len(), "the file is empty"),
            Some(Err(error)) => {
                let at = byte(error.marker().index());
                return fail(at..at, &format!("this is not valid YAML or JSON: {}", error.info()));
            }
            Some(Ok((event, span))) => (event, byte(span.start.index())..byte(span.end.index())),
        };
        nodes += 1;
        if nodes > MAX_NODES {
            return fail(range, &format!("the file has more than {MAX_NODES} values"));
        }
        let span = Span::new(source, range.clone());
        let done = match event {
            Event::Alias(_) => return fail(range, "this is an alias, which no calibration file has"),
            Event::Scalar(text, ScalarStyle::Plain, ..) => Node { span, value: plain(text.into_owned()) },
            Event::Scalar(text, ..) => Node { span, value: Value::String(text.into_owned()) },
            Event::SequenceStart(..) | Event::MappingStart(..) => {
                if open.len() == MAX_DEPTH {
                    return fail(range, &format!("values nest deeper than {MAX_DEPTH}"));
                }
                let is_list = matches!(event, Event::SequenceStart(..));
                let value = if is_list { Value::Array(Vec::new()) } else { Value::Table(Entries::new()) };
                open.push(Open { node: Node { span, value }, key: None });
                continue;
            }
            Event::SequenceEnd | Event::MappingEnd => match open.pop() {
                Some(Open { node, .. }) => {
                    Node { span: Span { end: span.end.max(node.span.end), ..node.span }, ..node }
                }
                None => continue,
            },
            Event::StreamEnd => return fail(0..0, "the file is empty"),
            _ => continue,
        };
        let Some(parent) = open.last_mut() else { return Some(done) };
        match (&mut parent.node.value, parent.key.take()) {
            (Value::Array(elements), _) => elements.push(done),
            (Value::Table(entries), Some((name, key))) => {
                entries.insert(name, Entry { key, node: done });
            }
            (Value::Table(_), None) => match done.value {
                Value::Array(_) | Value::Table(_) => return fail(range, "this key is a list or a table"),
                Value::String(name) => parent.key = Some((name, done.span)),
                // A key is a name, even if it looks like a number.
                _ => parent.key = Some((text[range].trim().to_owned(), done.span)),
            },
            _ => {}
        }
    }
}

/// A scalar without quotes: nothing, a number, true or false, or else a string.
fn plain(text: String) -> Value {
    match &text[..] {
        "" | "~" | "null" | "Null" | "NULL" => return Value::Null,
        "true" | "True" | "TRUE" => return Value::Boolean(true),
        "false" | "False" | "FALSE" => return Value::Boolean(false),
        _ => {}
    }
    // Rust reads the words inf and nan as numbers too; in YAML they are strings.
    let is_number = text.ends_with(|c: char| c.is_ascii_digit() || c == '.');
    match (text.parse(), text.parse()) {
        (Ok(integer), _) if is_number => Value::Integer(integer),
        (_, Ok(float)) if is_number => Value::Float(float),
        _ => Value::String(text),
    }
}

/// The text with spaces, as many bytes, in place of what YAML's grammar does not allow: OpenCV's `%YAML:1.0`, the tabs that
/// indent JSON, a byte order mark.
fn readable(text: &str) -> String {
    let mut text = text.replace('\t', " ");
    if text.starts_with('\u{feff}') {
        text.replace_range(..'\u{feff}'.len_utf8(), "   ");
    }
    if text.starts_with("%YAML:") {
        let end = text.find('\n').unwrap_or(text.len());
        let blank: String = text[..end].bytes().map(|_| ' ').collect();
        text.replace_range(..end, &blank);
    }
    text
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::super::Layer;
    use super::*;

    fn value(text: &str) -> Value {
        let mut report = Report::default();
        let source = report.add(Path::new("file"), text.to_owned(), Layer::Main);
        parse(&report, source).unwrap().value
    }

    #[test]
    fn scalars_have_their_kinds() {
        for (text, described) in [
            ("12", "12"),
            ("-0.5", "-0.5"),
            ("5.", "5"),
            ("1e3", "1000"),
            ("true", "true"),
            ("null", "nothing"),
            ("inf", "the string \"inf\""),
            ("OS-1-16", "the string \"OS-1-16\""),
            ("\"12\"", "the string \"12\""),
            ("[1, 2]", "a list of 2 values"),
            ("{a: 1}", "a table"),
        ] {
            assert_eq!(value(text).describe(), described);
        }
    }

    #[test]
    fn the_last_value_of_a_key_counts_and_keys_are_names() {
        let Value::Table(entries) = value("{\"a\": 1, \"a\": 2, 7: 3}") else { panic!("a table") };
        assert_eq!(entries["a"].node.value.describe(), "2");
        assert_eq!(entries["7"].node.value.describe(), "3");
    }
}
