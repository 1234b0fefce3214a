//! TOML as a tree whose every value knows where it was written, so that trees of several files can be laid over each
//! other and errors still point into the right one.

use std::collections::BTreeMap;

use toml::de::{DeTable, DeValue};

use crate::source::suggest::{list, nearest, quoted};
use crate::source::{Report, Span};

/// A value and where it was written. A table with a header is at its header.
#[derive(Clone, Debug)]
pub(super) struct Node {
    pub span: Span,
    pub value: Value,
}

#[derive(Clone, Debug)]
pub(super) enum Value {
    String(String),
    Integer(i128),
    Float(f64),
    Boolean(bool),
    Datetime(String),
    Array(Vec<Node>),
    Table(Table),
}

pub(super) type Table = BTreeMap<String, Entry>;

/// A value of a table, and where its key was written.
#[derive(Clone, Debug)]
pub(super) struct Entry {
    pub key: Span,
    pub node: Node,
}

/// How many syntax errors of a text are told: most of them follow from the first.
const MAX_SYNTAX_ERRORS: usize = 10;

/// Keys that say the same thing in another way: laying one over the others removes those.
const ALTERNATIVES: &[(&str, &[&str])] = &[
    ("hfov_deg", &["fx_px", "fy_px", "cx_px", "cy_px"]),
    ("fx_px", &["hfov_deg", "vfov_deg"]),
    ("rpy_deg", &["quaternion_xyzw"]),
    ("quaternion_xyzw", &["rpy_deg"]),
];

/// Reads a text as TOML. `None` if it isn't; the report says why.
pub(super) fn parse(report: &Report, source: u32) -> Option<Table> {
    let (table, mut errors) = DeTable::parse_recoverable(report.text(source));
    if errors.is_empty() {
        return Some(table_from(table.into_inner(), source));
    }
    errors.sort_by_key(|e| e.span().map_or(0, |span| span.start));
    let mut lines = Vec::new();
    let text = report.text(source);
    for error in errors {
        let bytes = error.span().unwrap_or(0..0);
        // What follows on the same line is the parser finding its way again.
        let line = text[..text.floor_char_boundary(bytes.start)].rfind('\n');
        if lines.len() == MAX_SYNTAX_ERRORS || lines.contains(&line) {
            continue;
        }
        lines.push(line);
        let span = Span::new(source, bytes.clone());
        let help = unquoted_text(text, bytes.start);
        let (problem, expected) = match &help {
            Some(_) => ("a text without quotes", ""),
            None => error.message().split_once(", expected ").unwrap_or((error.message(), "")),
        };
        let label = if expected.is_empty() { String::new() } else { format!("expected {expected}") };
        report.error(span, format!("this is not valid TOML: {problem}"), label, help);
    }
    None
}

/// If the line at `at` gives a key a text without quotes: what would be right. The parser takes such a text for whatever
/// its first character suggests.
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

fn table_from(table: DeTable<'_>, source: u32) -> Table {
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
        // What is too long for 128 bits is no count of anything; as a float it's still told as it was written.
        DeValue::Integer(i) => i128::from_str_radix(i.as_str(), i.radix())
            .map_or_else(|_| Value::Float(i.as_str().parse().unwrap_or(f64::INFINITY)), Value::Integer),
        DeValue::Float(f) => Value::Float(f.as_str().parse().unwrap_or(f64::NAN)),
        DeValue::Boolean(b) => Value::Boolean(b),
        DeValue::Datetime(d) => Value::Datetime(d.to_string()),
        DeValue::Array(a) => Value::Array(a.into_iter().map(|v| node_from(v, source)).collect()),
        DeValue::Table(t) => Value::Table(table_from(t, source)),
    };
    Node { span, value }
}

/// Reads a `--set`: `a.b.c = value` as TOML would have it, or with a string that lacks its quotes.
pub(super) fn parse_override(report: &Report, source: u32) -> Option<Table> {
    let pair = report.text(source);
    let whole = Span::new(source, 0..pair.len());
    let Some((key, value)) = split_pair(pair) else {
        let help = "such as `seed=3` or `sensor.0.range.max_m=50`";
        report.error(whole, format!("{} has no `=`", quoted(pair)), "expected key=value", Some(help.into()));
        return None;
    };
    let nested = format!("{key}=0");
    let Some(nested) = DeTable::parse(&nested).ok().filter(|table| table.get_ref().len() == 1) else {
        report.error(
            Span::new(source, 0..key.len()),
            format!("{} is not a key", quoted(key.trim())),
            "expected names with dots between",
            Some("put quotes around a name with other characters than letters, digits, `-` and `_`".into()),
        );
        return None;
    };
    if DeValue::parse(value.trim()).is_ok() || value.trim_start().starts_with(['[', '{', '"', '\'']) {
        return parse(report, source);
    }
    // A dotted key nests one table a segment; the string goes into the innermost.
    let mut table = table_from(nested.into_inner(), source);
    let mut innermost = table.values_mut().next();
    while let Some(entry) = innermost {
        innermost = match &mut entry.node.value {
            Value::Table(deeper) => deeper.values_mut().next(),
            leaf => {
                *leaf = Value::String(value.trim().to_owned());
                entry.node.span = Span::new(source, pair.len() - value.len()..pair.len());
                None
            }
        };
    }
    Some(table)
}

/// A pair at its first `=` outside quotes.
fn split_pair(pair: &str) -> Option<(&str, &str)> {
    let mut quote = None;
    for (at, c) in pair.char_indices() {
        match quote {
            None if c == '=' => return Some((&pair[..at], &pair[at + 1..])),
            None if c == '"' || c == '\'' => quote = Some(c),
            Some(q) if c == q => quote = None,
            _ => {}
        }
    }
    None
}

/// Lays a table over another: a table in both is merged key by key, everything else replaces what was there. In an
/// array, keys that are whole numbers are indices, and tables with a `name` go by that too.
pub(super) fn lay_over(report: &Report, base: &mut Table, over: Table) {
    for (key, entry) in over {
        for (_, others) in ALTERNATIVES.iter().filter(|(k, _)| *k == key) {
            base.retain(|k, _| !others.contains(&k.as_str()));
        }
        match base.get_mut(&key) {
            None => {
                base.insert(key, entry);
            }
            Some(below) => {
                below.key = entry.key;
                lay_node_over(report, &key, &mut below.node, entry.node);
            }
        }
    }
}

fn lay_node_over(report: &Report, name: &str, base: &mut Node, over: Node) {
    match (&mut base.value, over.value) {
        (Value::Table(base), Value::Table(over)) => lay_over(report, base, over),
        (Value::Array(elements), Value::Table(over)) if is_addressed(elements, &over) => {
            for (key, entry) in over {
                match index_of(elements, &key) {
                    Some(index) => lay_node_over(report, &key, &mut elements[index], entry.node),
                    None => {
                        let (label, help) = addresses(name, elements, &key);
                        let message = format!("there is no {name} {}", quoted(&key));
                        report.error(entry.key, message, label, Some(help));
                    }
                }
            }
        }
        (_, value) => *base = Node { span: over.span, value },
    }
}

/// Whether the keys of a table address the elements of an array, rather than being what shall replace it.
fn is_addressed(elements: &[Node], over: &Table) -> bool {
    elements.iter().any(|e| matches!(e.value, Value::Table(_)))
        || over.keys().all(|key| key.parse::<usize>().is_ok())
}

fn name_of(element: &Node) -> Option<&str> {
    match &element.value {
        Value::Table(table) => match &table.get("name")?.node.value {
            Value::String(name) => Some(name),
            _ => None,
        },
        _ => None,
    }
}

fn index_of(elements: &[Node], key: &str) -> Option<usize> {
    let named = elements.iter().position(|e| name_of(e) == Some(key));
    named.or_else(|| key.parse().ok().filter(|index| *index < elements.len()))
}

/// A label and a help that say how the elements of an array are addressed.
fn addresses(name: &str, elements: &[Node], key: &str) -> (String, String) {
    let label = match elements.len() {
        0 => "there are none".to_owned(),
        1 => "the only one is number 0".to_owned(),
        n => format!("they are numbered 0 to {}", n - 1),
    };
    let names: Vec<&str> = elements.iter().take(20).filter_map(name_of).collect();
    let help = if let Some(near) = nearest(key, names.iter().copied()) {
        format!("did you mean {}?", quoted(near))
    } else if names.is_empty() {
        format!("address an element by its number, such as `{name}.0`")
    } else {
        format!("they are called {}", list(names, "and"))
    };
    (label, help)
}

/// The tree as JSON: keys in alphabetical order, and numbers that JSON lacks (`inf`) as strings.
pub(super) fn to_json(table: &Table) -> serde_json::Value {
    serde_json::Value::Object(table.iter().map(|(k, entry)| (k.clone(), node_to_json(&entry.node))).collect())
}

fn node_to_json(node: &Node) -> serde_json::Value {
    match &node.value {
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
