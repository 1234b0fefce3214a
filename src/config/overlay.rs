//! Layers of a configuration: a preset, the file over it, and what `--set` says over both.

use super::keys::job::{JOB, SENSOR, SENSORS};
use super::parse;
use super::table::{Grammar, Reading};
use crate::source::suggest::nearest;
use crate::source::tree::{Entries, Entry, Node, Value};
use crate::source::words::{list, quoted};
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

/// The pair with its indices as TOML has them, in as many bytes: `position_m[2]=1`, which is how reports write an element,
/// becomes `position_m.2 =1`.
pub(super) fn with_dots(pair: &str) -> String {
    let Some((key, value)) = split_pair(pair) else { return pair.to_owned() };
    format!("{}={value}", dotted(key))
}

/// The same of a key alone.
pub(super) fn dotted(key: &str) -> String {
    let (mut dotted, mut rest) = (String::new(), key);
    while let Some((before, after)) = rest.split_once('[') {
        let Some((index, behind)) = after.split_once(']') else { break };
        if before.contains(['"', '\''])
            || index.is_empty()
            || !index.bytes().all(|b| b.is_ascii_alphanumeric())
        {
            break;
        }
        dotted += before;
        dotted += ".";
        dotted += index;
        dotted += " ";
        rest = behind;
    }
    dotted + rest
}

/// Moves keys of a sensor that stand where the job's own keys do, as reports about a lone sensor write them, into that
/// sensor's table. Of several sensors, an error says how to name one.
pub(super) fn address_lone_sensor(report: &Report, job: &Entries, over: &mut Entries) {
    let is_of_sensor =
        |key: &str| !JOB.names().any(|known| known == key) && SENSOR.names().any(|known| known == key);
    let Some(key) = over.keys().find(|key| is_of_sensor(key)).cloned() else { return };
    let sensors = match job.get(SENSORS.name()).map(|entry| &entry.node.value) {
        Some(Value::Array(sensors)) => sensors.as_slice(),
        _ => return,
    };
    let Some(entry) = over.get(&key) else { return };
    let (at, span) = (entry.key, entry.node.span);
    match sensors {
        [_] => {
            let Some(entry) = over.remove(&key) else { return };
            let table = |name: &str, entry| Entry {
                key: at,
                node: Node { span, value: Value::Table(Entries::from([(name.to_owned(), entry)])) },
            };
            let addressed = table("0", table(&key, entry));
            over.insert(SENSORS.name().to_owned(), addressed);
        }
        several => {
            let first = several.iter().find_map(name_of).unwrap_or("0");
            let message = format!("{} is a key of a sensor, and the job has {}", quoted(&key), several.len());
            let help = format!("name one: `{}.{}.{}`", SENSORS.name(), first, key);
            report.error(at, message, "of which sensor?", Some(help));
            over.remove(&key);
        }
    }
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

/// Whether the keys of a table address the elements of an array, so that the table does not replace the array. A table without
/// keys addresses none, and so is reported as a table where an array belongs.
fn is_addressed(elements: &[Node], over: &Entries) -> bool {
    let has_tables = || elements.iter().any(|e| matches!(e.value, Value::Table(_)));
    !over.is_empty() && (has_tables() || over.keys().all(|key| key.parse::<usize>().is_ok()))
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

/// The element of an array that a key addresses.
pub(super) fn element<'a>(elements: &'a [Node], key: &str) -> Option<&'a Node> {
    elements.get(index_of(elements, key)?)
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
