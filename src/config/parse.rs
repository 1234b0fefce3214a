//! TOML → trees of values with spans, so that trees of several files can be laid over each other and errors still point into
//! the right file; and trees → JSON.

use toml::de::{DeTable, DeValue};

use crate::source::tree::{Entries, Entry, Node, Value};
use crate::source::words::quoted;
use crate::source::{Report, Span};

/// Most syntax errors of a text that are reported: most of them follow from the first.
const MAX_SYNTAX_ERRORS: usize = 10;

/// The longest text in which the parser looks for more than the first error. It keeps all that it finds, and a hostile text
/// has one in every line.
const LONGEST_TEXT_WITH_ALL_ERRORS: usize = 64 << 10;

/// Reads a text as TOML. `None` if it isn't; the report says why.
pub(crate) fn parse(report: &Report, source: u32) -> Option<Entries> {
    let first = match DeTable::parse(report.text(source)) {
        Ok(table) => return Some(entries_from(table.into_inner(), source)),
        Err(first) => first,
    };
    let mut errors = match report.text(source) {
        text if text.len() <= LONGEST_TEXT_WITH_ALL_ERRORS => DeTable::parse_recoverable(text).1,
        _ => vec![first],
    };
    errors.sort_by_key(|e| e.span().map_or(0, |span| span.start));
    let mut lines = Vec::new();
    let text = report.text(source);
    for error in errors {
        let range = error.span().unwrap_or(0..0);
        // Further errors of a line come from the parser finding its way again.
        let line = text[..text.floor_char_boundary(range.start)].rfind('\n');
        if lines.len() == MAX_SYNTAX_ERRORS || lines.contains(&line) {
            continue;
        }
        lines.push(line);
        let unquoted = unquoted_text(text, range.start);
        let is_unquoted = unquoted.is_some();
        let help = unquoted.or_else(|| windows_path(text, range.start));
        let (problem, expected) = match is_unquoted {
            true => ("a text without quotes", ""),
            false => error.message().split_once(", expected ").unwrap_or((error.message(), "")),
        };
        let label = if expected.is_empty() { String::new() } else { format!("expected {expected}") };
        report.error(Span::new(source, range), format!("this is not valid TOML: {problem}"), label, help);
    }
    None
}

/// If the line at `at` gives a key a text without quotes, the line as it would be right. The parser takes such a text for
/// the kind of value that its first character suggests, and says nothing of quotes.
fn unquoted_text(text: &str, at: usize) -> Option<String> {
    let at = text.floor_char_boundary(at);
    let start = text[..at].rfind('\n').map_or(0, |at| at + 1);
    let line = text[start..].lines().next()?;
    let (key, value) = line.split_once('=')?;
    let value = value.split('#').next()?.trim();
    let is_text = value.starts_with(|c: char| c.is_alphabetic() || matches!(c, '/' | '~' | '\\'))
        || value.starts_with("./")
        || value.starts_with("../");
    let is_keyword = matches!(value, "true" | "false" | "inf" | "nan");
    (is_text && !is_keyword).then(|| {
        let value = quoted(value);
        format!("write {} = \"{}\"", quoted(key.trim()).trim_matches('`'), value.trim_matches('`'))
    })
}

/// If the line at `at` has a path of Windows in double quotes, where a backslash begins a code, how to write it.
fn windows_path(text: &str, at: usize) -> Option<String> {
    let at = text.floor_char_boundary(at);
    let start = text[..at].rfind('\n').map_or(0, |at| at + 1);
    let line = text[start..].lines().next()?;
    let (_, value) = line.split_once('"')?;
    let has_drive = value.as_bytes().get(1) == Some(&b':') && value.as_bytes().get(2) == Some(&b'\\');
    (has_drive || value.starts_with("\\\\")).then(|| {
        "a backslash in double quotes begins a code: write the path with /, or in single quotes".to_owned()
    })
}

fn entries_from(table: DeTable<'_>, source: u32) -> Entries {
    table
        .into_iter()
        .map(|(key, value)| {
            let span = Span::new(source, key.span());
            (key.into_inner().into_owned(), Entry { key: span, node: node_from(value, source) })
        })
        .collect()
}

/// The parser limits how deep values nest, so this ends.
fn node_from(value: toml::Spanned<DeValue<'_>>, source: u32) -> Node {
    let span = Span::new(source, value.span());
    let value = match value.into_inner() {
        DeValue::String(s) => Value::String(s.into_owned()),
        // No count has more than 128 bits. As a float, the number is still told as it was written.
        DeValue::Integer(i) => i128::from_str_radix(i.as_str(), i.radix())
            .map_or_else(|_| Value::Float(i.as_str().parse().unwrap_or(f64::INFINITY)), Value::Integer),
        DeValue::Float(f) => Value::Float(f.as_str().parse().unwrap_or(f64::NAN)),
        DeValue::Boolean(b) => Value::Boolean(b),
        DeValue::Datetime(d) => Value::Datetime(d.to_string()),
        DeValue::Array(a) => Value::Array(a.into_iter().map(|v| node_from(v, source)).collect()),
        DeValue::Table(t) => Value::Table(entries_from(t, source)),
    };
    Node { span, value }
}

/// A key with dots as the tables that it nests, with a number as the innermost value. `None` if it is no key.
pub(crate) fn nest(key: &str, source: u32) -> Option<Entries> {
    let text = format!("{key}=0");
    let table = DeTable::parse(&text).ok().filter(|table| table.get_ref().len() == 1)?;
    Some(entries_from(table.into_inner(), source))
}

/// Whether a text is a value of TOML.
pub(crate) fn is_value(text: &str) -> bool {
    DeValue::parse(text.trim()).is_ok()
}

/// A value of TOML that stands in no text that a user wrote. `None` if it is none.
pub(crate) fn constant(text: &str) -> Option<Node> {
    Some(node_from(DeValue::parse(text).ok()?, 0))
}

/// The tree as JSON: keys in alphabetical order, and numbers that JSON lacks (`inf`) as strings.
pub(crate) fn to_json(table: &Entries) -> serde_json::Value {
    serde_json::Value::Object(table.iter().map(|(k, entry)| (k.clone(), node_to_json(&entry.node))).collect())
}

pub(crate) fn node_to_json(node: &Node) -> serde_json::Value {
    match &node.value {
        Value::Null => serde_json::Value::Null,
        Value::String(s) | Value::Datetime(s) => s.as_str().into(),
        Value::Integer(i) => match (u64::try_from(*i), i64::try_from(*i)) {
            (Ok(i), _) => i.into(),
            (_, Ok(i)) => i.into(),
            _ => i.to_string().into(),
        },
        Value::Float(f) if f.is_finite() => (*f).into(),
        Value::Float(f) => f.to_string().into(),
        Value::Boolean(b) => (*b).into(),
        Value::Array(a) => a.iter().map(node_to_json).collect(),
        Value::Table(t) => to_json(t),
    }
}
