//! YAML and JSON as one tree whose every value knows where it was written. JSON is YAML but for tabs, and OpenCV's dialect
//! is but for its first line.

use std::ops::Range;

use saphyr_parser::{Event, Parser, ScalarStyle};

use super::report::Report;

/// Deepest nesting that is read: no calibration file comes near.
const MOST_DEPTH: usize = 32;

/// Most values that are read, for the memory that they take.
const MOST_NODES: usize = 1 << 20;

#[derive(Debug)]
pub(super) struct Node {
    pub span: Range<usize>,
    pub value: Value,
}

/// A table's key, and where it was written.
type Key = (String, Range<usize>);

#[derive(Debug)]
pub(super) enum Value {
    /// A number, a word, nothing: what it is, is for who reads it to say.
    Plain(String),
    /// Between quotes.
    Quoted(String),
    List(Vec<Node>),
    Table(Vec<(Key, Node)>),
}

/// Reads the report's text. `None` if it's neither YAML nor JSON; the report says why.
pub(super) fn parse(report: &Report) -> Option<Node> {
    let text = readable(report.text());
    // The parser counts characters.
    let bytes: Option<Vec<usize>> =
        (!text.is_ascii()).then(|| text.char_indices().map(|(at, _)| at).chain([text.len()]).collect());
    let byte = |character: usize| match &bytes {
        Some(bytes) => bytes.get(character).copied().unwrap_or(text.len()),
        None => character.min(text.len()),
    };
    let fault = |span: Range<usize>, message: String| report.error(span, message, "", None);

    let mut parser = Parser::new_from_str(&text);
    // Lists and tables that are open, each with its start and, of a table, the key that waits for its value.
    let mut open: Vec<(Node, Option<Key>)> = Vec::new();
    let mut nodes = 0;
    loop {
        let (event, span) = match parser.next_event() {
            None => return fault(text.len()..text.len(), "the file is empty".into()),
            Some(Err(error)) => {
                let at = byte(error.marker().index());
                return fault(at..at, format!("this is not valid YAML or JSON: {}", error.info()));
            }
            Some(Ok((event, span))) => (event, byte(span.start.index())..byte(span.end.index())),
        };
        nodes += 1;
        if nodes > MOST_NODES {
            return fault(span, format!("the file has more than {MOST_NODES} values"));
        }
        let done = match event {
            Event::Alias(_) => return fault(span, "an alias, which no calibration file has".into()),
            Event::Scalar(value, ScalarStyle::Plain, ..) => {
                Node { span, value: Value::Plain(value.into_owned()) }
            }
            Event::Scalar(value, ..) => Node { span, value: Value::Quoted(value.into_owned()) },
            Event::SequenceStart(..) | Event::MappingStart(..) => {
                if open.len() == MOST_DEPTH {
                    return fault(span, format!("values nest deeper than {MOST_DEPTH}"));
                }
                let is_list = matches!(event, Event::SequenceStart(..));
                let value = if is_list { Value::List(Vec::new()) } else { Value::Table(Vec::new()) };
                open.push((Node { span, value }, None));
                continue;
            }
            Event::SequenceEnd | Event::MappingEnd => match open.pop() {
                Some((node, _)) => Node { span: node.span.start..span.end.max(node.span.end), ..node },
                None => continue,
            },
            Event::StreamEnd => return fault(0..0, "the file is empty".into()),
            _ => continue,
        };
        let Some((parent, key)) = open.last_mut() else { return Some(done) };
        match &mut parent.value {
            Value::List(elements) => elements.push(done),
            Value::Table(entries) => match key.take() {
                Some(key) => entries.push((key, done)),
                None => match done.value {
                    Value::Plain(name) | Value::Quoted(name) => *key = Some((name, done.span)),
                    _ => return fault(done.span, "a key that is a list or a table".into()),
                },
            },
            Value::Plain(_) | Value::Quoted(_) => {}
        }
    }
}

/// The text with spaces, as many bytes, in place of what YAML's grammar has no room for: OpenCV's `%YAML:1.0`, the tabs that
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

/// A table that is being read: every problem is recorded, and reading goes on.
pub(super) struct Fields<'a> {
    report: &'a Report,
    /// What the table is called in messages, such as `beam_intrinsics`; empty for the file as a whole.
    name: String,
    span: Range<usize>,
    entries: &'a [(Key, Node)],
}

impl<'a> Fields<'a> {
    pub fn new(report: &'a Report, name: impl Into<String>, node: &'a Node) -> Option<Self> {
        let name = name.into();
        match &node.value {
            Value::Table(entries) => {
                // The file as a whole is marked by its first line.
                let span = if name.is_empty() { node.span.start..node.span.start } else { node.span.clone() };
                Some(Self { report, name, span, entries })
            }
            _ => {
                let what = if name.is_empty() { "the file".to_owned() } else { format!("`{name}`") };
                let message = format!("{what} is {}", describe(&node.value));
                report.error(node.span.clone(), message, "expected a table", None)
            }
        }
    }

    /// What a key is called in messages.
    pub fn path(&self, key: &str) -> String {
        if self.name.is_empty() { key.to_owned() } else { format!("{}.{key}", self.name) }
    }

    /// The last value that a key is given, as most readers of JSON have it.
    pub fn get(&self, key: &str) -> Option<&'a Node> {
        self.entries.iter().rev().find(|((name, _), _)| name == key).map(|(_, node)| node)
    }

    /// A value that must be there; `meaning` says what it is.
    pub fn need(&self, key: &str, meaning: &str) -> Option<&'a Node> {
        self.get(key).or_else(|| {
            let place = if self.name.is_empty() { "the file".to_owned() } else { format!("`{}`", self.name) };
            let message = format!("{place} has no `{key}`");
            self.report.error(self.span.clone(), message, "", format!("`{key}` is {meaning}"))
        })
    }

    /// A table inside, if it's there.
    pub fn table(&self, key: &str) -> Option<Fields<'a>> {
        Fields::new(self.report, self.path(key), self.get(key)?)
    }

    /// A finite number, if it's there.
    pub fn number(&self, key: &str) -> Option<f64> {
        number(self.report, &self.path(key), self.get(key)?)
    }

    /// A whole number from `least` to `most`, if it's there.
    pub fn integer(&self, key: &str, least: u32, most: u32) -> Option<u32> {
        let node = self.get(key)?;
        let value = match &node.value {
            Value::Plain(text) => text.parse().ok().filter(|n| (least..=most).contains(n)),
            _ => None,
        };
        value.or_else(|| {
            let message = format!("`{}` is {}", self.path(key), describe(&node.value));
            let label = format!("expected a whole number from {least} to {most}");
            self.report.error(node.span.clone(), message, label, None)
        })
    }

    /// A text, if it's there and not empty.
    pub fn text(&self, key: &str) -> Option<&'a str> {
        match &self.get(key)?.value {
            Value::Plain(text) | Value::Quoted(text) if !text.is_empty() => Some(text),
            _ => None,
        }
    }

    /// A list of finite numbers, if it's there, and where it was written.
    pub fn numbers(&self, key: &str) -> Option<(Vec<f64>, Range<usize>)> {
        let node = self.get(key)?;
        let name = self.path(key);
        let Value::List(elements) = &node.value else {
            let message = format!("`{name}` is {}", describe(&node.value));
            return self.report.error(node.span.clone(), message, "expected a list of numbers", None);
        };
        let all: Vec<_> = elements
            .iter()
            .enumerate()
            .map(|(i, e)| number(self.report, &format!("{name}[{i}]"), e))
            .collect();
        Some((all.into_iter().collect::<Option<_>>()?, node.span.clone()))
    }

    pub fn report(&self) -> &'a Report {
        self.report
    }
}

/// A finite number; `name` is what it's called in messages.
fn number(report: &Report, name: &str, node: &Node) -> Option<f64> {
    let value = match &node.value {
        Value::Plain(text) => text.parse::<f64>().ok().filter(|value| value.is_finite()),
        _ => None,
    };
    value.or_else(|| {
        let message = format!("`{name}` is {}", describe(&node.value));
        report.error(node.span.clone(), message, "expected a number", None)
    })
}

/// A value as a message tells it.
pub(super) fn describe(value: &Value) -> String {
    match value {
        Value::Plain(text) if text.is_empty() => "nothing".to_owned(),
        Value::Plain(text) => short(text),
        Value::Quoted(text) => format!("the text \"{}\"", short(text)),
        Value::List(elements) => format!("a list of {}", elements.len()),
        Value::Table(_) => "a table".to_owned(),
    }
}

/// The beginning of a text.
fn short(text: &str) -> String {
    let mut characters = text.chars();
    let mut short: String = characters.by_ref().take(40).collect();
    if characters.next().is_some() {
        short.push('…');
    }
    short
}
