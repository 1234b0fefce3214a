//! TOML, YAML and JSON as trees in which every value has the span where it was written.

use std::collections::BTreeMap;

use super::Span;
use super::words::{counted, quoted};

/// A value and where it was written. A table with a header is at its header.
#[derive(Clone, Debug)]
pub(crate) struct Node {
    pub span: Span,
    pub value: Value,
}

#[derive(Clone, Debug)]
pub(crate) enum Value {
    /// JSON's `null`, or a key of YAML that is given no value. TOML has none.
    Null,
    String(String),
    Integer(i128),
    Float(f64),
    Boolean(bool),
    /// TOML's dates and times, as they are written.
    Datetime(String),
    Array(Vec<Node>),
    Table(Entries),
}

/// The keys of a table. Of a key that is given twice, which TOML refuses, the last value counts, as in most readers of JSON.
pub(crate) type Entries = BTreeMap<String, Entry>;

/// A value of a table, and where its key was written.
#[derive(Clone, Debug)]
pub(crate) struct Entry {
    pub key: Span,
    pub node: Node,
}

impl Value {
    /// The value as messages tell it.
    pub fn describe(&self) -> String {
        match self {
            Self::Null => "nothing".to_owned(),
            Self::String(text) if text.is_empty() => "an empty string".to_owned(),
            Self::String(text) => format!("the string \"{}\"", quoted(text).trim_matches('`')),
            Self::Integer(i) => i.to_string(),
            Self::Float(f) => f.to_string(),
            Self::Boolean(b) => b.to_string(),
            Self::Datetime(d) => format!("the date or time {d}"),
            Self::Array(a) if a.is_empty() => "an empty list".to_owned(),
            Self::Array(a) => format!("a list of {}", counted(a.len(), "value")),
            Self::Table(_) => "a table".to_owned(),
        }
    }
}
