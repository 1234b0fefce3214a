//! A table of YAML or JSON that is being read: keys that are not asked for are ignored, as vendors add them at will.

use super::file::File;
use crate::source::tree::{Entries, Node, Value};
use crate::source::{Span, Spanned};

/// A table that is being read. Every problem is recorded, and reading goes on.
pub(super) struct Fields<'a> {
    file: File<'a>,
    /// The table's name in messages, such as `beam_intrinsics`; empty for the file as a whole.
    name: String,
    span: Span,
    entries: &'a Entries,
}

impl<'a> Fields<'a> {
    pub fn new(file: File<'a>, name: impl Into<String>, node: &'a Node) -> Option<Self> {
        let name = name.into();
        match &node.value {
            Value::Table(entries) => {
                // The file as a whole is marked by its first line.
                let end = if name.is_empty() { node.span.start } else { node.span.end };
                Some(Self { file, name, span: Span { end, ..node.span }, entries })
            }
            value => {
                let subject = if name.is_empty() { "the file".to_owned() } else { format!("`{name}`") };
                let message = format!("{subject} is {}", value.describe());
                file.fail(node.span, message, "expected a table", None)
            }
        }
    }

    /// The name of a key in messages.
    pub fn path(&self, key: &str) -> String {
        if self.name.is_empty() { key.to_owned() } else { format!("{}.{key}", self.name) }
    }

    pub fn get(&self, key: &str) -> Option<&'a Node> {
        self.entries.get(key).map(|entry| &entry.node)
    }

    /// The span of a key's value, or of the table if the key is not there.
    pub fn span(&self, key: &str) -> Span {
        self.get(key).map_or(self.span, |node| node.span)
    }

    /// A value that must be there; `meaning` completes the sentence "`key` is …".
    pub fn need(&self, key: &str, meaning: &str) -> Option<&'a Node> {
        self.get(key).or_else(|| {
            let place = if self.name.is_empty() { "the file".to_owned() } else { format!("`{}`", self.name) };
            let message = format!("{place} has no `{key}`");
            self.file.fail(self.span, message, "", format!("`{key}` is {meaning}"))
        })
    }

    /// A table inside, if it is there.
    pub fn table(&self, key: &str) -> Option<Fields<'a>> {
        Fields::new(self.file, self.path(key), self.get(key)?)
    }

    /// A finite number, if it is there.
    pub fn number(&self, key: &str) -> Option<f64> {
        self.finite(&self.path(key), self.get(key)?)
    }

    /// A whole number from `least` to `most`, if it is there.
    pub fn integer(&self, key: &str, least: u32, most: u32) -> Option<u32> {
        let node = self.get(key)?;
        let value = match node.value {
            Value::Integer(value) => u32::try_from(value).ok().filter(|n| (least..=most).contains(n)),
            _ => None,
        };
        value.or_else(|| {
            let message = format!("`{}` is {}", self.path(key), node.value.describe());
            let label = format!("expected a whole number from {least} to {most}");
            self.file.fail(node.span, message, label, None)
        })
    }

    /// A text, if it is there and not empty. A number without quotes is the text that it is written as.
    pub fn text(&self, key: &str) -> Option<&'a str> {
        let node = self.get(key)?;
        let text = match &node.value {
            Value::String(text) => text,
            Value::Integer(_) | Value::Float(_) | Value::Boolean(_) => self.file.text(node.span).trim(),
            _ => "",
        };
        (!text.is_empty()).then_some(text)
    }

    /// A list of finite numbers, if it is there.
    pub fn numbers(&self, key: &str) -> Option<Spanned<Vec<f64>>> {
        let node = self.get(key)?;
        let name = self.path(key);
        let Value::Array(elements) = &node.value else {
            let message = format!("`{name}` is {}", node.value.describe());
            return self.file.fail(node.span, message, "expected a list of numbers", None);
        };
        // Collected in two steps, so that every element that is no number is reported.
        let all: Vec<_> =
            elements.iter().enumerate().map(|(i, e)| self.finite(&format!("{name}[{i}]"), e)).collect();
        Some(Spanned { value: all.into_iter().collect::<Option<_>>()?, span: node.span })
    }

    /// The keys of the table, in alphabetical order.
    pub fn keys(&self) -> impl Iterator<Item = &'a str> + use<'a> {
        self.entries.keys().map(String::as_str)
    }

    /// A list of lists of finite numbers, one list after the other, if it is there.
    pub fn numbers_of_rows(&self, key: &str) -> Option<Spanned<Vec<f64>>> {
        let node = self.get(key)?;
        let name = self.path(key);
        let Value::Array(rows) = &node.value else { return self.numbers(key) };
        let mut all = Vec::new();
        for (row, inner) in rows.iter().enumerate() {
            let Value::Array(elements) = &inner.value else {
                let message = format!("`{name}[{row}]` is {}", inner.value.describe());
                return self.file.fail(inner.span, message, "expected a list of numbers", None);
            };
            for (column, element) in elements.iter().enumerate() {
                all.push(self.finite(&format!("{name}[{row}][{column}]"), element)?);
            }
        }
        Some(Spanned { value: all, span: node.span })
    }

    /// A finite number; `name` is its name in messages.
    fn finite(&self, name: &str, node: &Node) -> Option<f64> {
        let value = match node.value {
            Value::Integer(value) => Some(value as f64),
            Value::Float(value) => Some(value),
            _ => None,
        };
        value.filter(|value| value.is_finite()).or_else(|| {
            let message = format!("`{name}` is {}", node.value.describe());
            self.file.fail(node.span, message, "expected a number", None)
        })
    }

    pub fn file(&self) -> File<'a> {
        self.file
    }
}
