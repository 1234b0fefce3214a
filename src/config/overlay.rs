//! Layers of a configuration: a preset, the file over it, and what `--set` says over both.

use super::parse;
use super::table::{Grammar, Reading};
use crate::source::suggest::{list, nearest, quoted};
use crate::source::tree::{Entries, Node, Value};
use crate::source::{Report, Span};

/// Reads a `--set`: `a.b.c = value` as TOML would have it, or with a string that lacks its quotes.
pub(super) fn parse_override(report: &Report, source: u32) -> Option<Entries> {
    let pair = report.text(source);
    let whole = Span::new(source, 0..pair.len());
    let Some((key, value)) = split_pair(pair) else {
        let help = "such as `seed=3` or `sensor.0.range.max_m=50`";
        report.error(whole, format!("{} has no `=`", quoted(pair)), "expected key=value", Some(help.into()));
        return None;
    };
    let Some(mut entries) = parse::nest(key, source) else {
        report.error(
            Span::new(source, 0..key.len()),
            format!("{} is not a key", quoted(key.trim())),
            "expected names with dots between",
            Some("put quotes around a name with other characters than letters, digits, `-` and `_`".into()),
        );
        return None;
    };
    if parse::is_value(value) || value.trim_start().starts_with(['[', '{', '"', '\'']) {
        return parse::parse(report, source);
    }
    // A dotted key nests one table a segment; the string goes into the innermost.
    let mut innermost = entries.values_mut().next();
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
    Some(entries)
}

/// Splits a pair at its first `=` outside quotes.
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

/// Lays a table over another. A table in both is merged key by key; every other value replaces the one below, and a key
/// removes those that it replaces. In an array, keys that are whole numbers are indices, and tables with a `name` go by
/// that, too.
pub(super) fn lay_over(reading: Reading<'_>, base: &mut Entries, over: Entries) {
    for (key, entry) in over {
        remove_replaced(reading.grammar, base, &key);
        match base.get_mut(&key) {
            None => {
                base.insert(key, entry);
            }
            Some(below) => {
                below.key = entry.key;
                lay_node_over(reading, &key, &mut below.node, entry.node);
            }
        }
    }
}

fn remove_replaced(grammar: &Grammar, base: &mut Entries, key: &str) {
    let replaced = grammar.replaced_by(key);
    base.retain(|name, _| !replaced.contains(&name.as_str()));
}

fn lay_node_over(reading: Reading<'_>, name: &str, base: &mut Node, over: Node) {
    match (&mut base.value, over.value) {
        (Value::Table(base), Value::Table(over)) => lay_over(reading, base, over),
        (Value::Array(elements), Value::Table(over)) if is_addressed(elements, &over) => {
            for (key, entry) in over {
                match index_of(elements, &key) {
                    Some(index) => lay_node_over(reading, &key, &mut elements[index], entry.node),
                    None => {
                        let (label, help) = addresses(name, elements, &key);
                        let message = format!("there is no {name} {}", quoted(&key));
                        reading.report.error(entry.key, message, label, Some(help));
                    }
                }
            }
        }
        (_, value) => *base = Node { span: over.span, value },
    }
}

/// Whether the keys of a table address the elements of an array, so that the table does not replace the array.
fn is_addressed(elements: &[Node], over: &Entries) -> bool {
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
