//! Tables, lists of tables, and tables whose keys are names.

use std::collections::BTreeMap;

use serde_json::{Map, Value as Json, json};

use super::super::table::{Describe, Given, Kind, Table, TableKeys};
use super::super::{reference, schema};
use super::number::Number;
use super::object::object;
use crate::source::Spanned;
use crate::source::suggest::nearest;
use crate::source::tree::{Entries, Value};
use crate::source::words::{list, quoted};

/// A table.
#[derive(Clone, Copy)]
pub(crate) struct Nested(pub &'static TableKeys);

impl Describe for Nested {
    fn expected(&self, _: Option<&str>) -> String {
        format!("a table of {}", list(self.0.names(), "and"))
    }

    fn documented(&self, _: Option<&str>) -> String {
        format!("a table: {}", reference::link(self.0))
    }

    fn schema(&self, is_partial: bool) -> Map<String, Json> {
        schema::table(self.0, is_partial)
    }

    fn header(&self, path: &str) -> Option<String> {
        Some(format!("[{path}]"))
    }

    fn tables(&self) -> Vec<&'static TableKeys> {
        vec![self.0]
    }
}

impl Kind for Nested {
    type Value<'a> = Table<'a>;

    fn read<'a>(&self, given: Given<'a>) -> Option<Table<'a>> {
        match &given.node.value {
            Value::Table(entries) => Some(Table::new(given.reading, self.0, entries, given.node.span)),
            _ => given.wrong(&self.expected(None), None),
        }
    }
}

/// A list of tables.
#[derive(Clone, Copy)]
pub(crate) struct Tables {
    of: &'static TableKeys,
    least: usize,
    most: Option<usize>,
    /// For tables with headers of their own: what one of them is about.
    noun: Option<&'static str>,
}

impl Tables {
    /// Tables in braces.
    pub const fn in_braces(of: &'static TableKeys, least: usize) -> Self {
        Self { of, least, most: None, noun: None }
    }

    /// Tables with headers; `noun` is what one of them is about.
    pub const fn with_headers(of: &'static TableKeys, noun: &'static str, least: usize) -> Self {
        Self { of, least, most: None, noun: Some(noun) }
    }

    pub const fn at_most(self, most: usize) -> Self {
        Self { most: Some(most), ..self }
    }

    fn help(&self, key: &str) -> Option<String> {
        self.noun.map(|noun| format!("write `[[{key}]]`, with two brackets, before each {noun}'s keys"))
    }
}

impl Describe for Tables {
    fn expected(&self, _: Option<&str>) -> String {
        match self.noun {
            Some(_) => "a list of tables".to_owned(),
            None => format!("a list of tables of {}", list(self.of.names(), "and")),
        }
    }

    fn documented(&self, _: Option<&str>) -> String {
        format!("a list of tables: {}", reference::link(self.of))
    }

    fn schema(&self, _: bool) -> Map<String, Json> {
        // A preset's list is replaced as a whole, so that each of its tables is complete.
        let mut schema = object(
            json!({ "type": "array", "items": schema::table(self.of, false), "minItems": self.least }),
        );
        if let Some(most) = self.most {
            schema.insert("maxItems".into(), most.into());
        }
        schema
    }

    fn header(&self, path: &str) -> Option<String> {
        self.noun.map(|_| format!("[[{path}]]"))
    }

    fn tables(&self) -> Vec<&'static TableKeys> {
        vec![self.of]
    }
}

impl Kind for Tables {
    type Value<'a> = Vec<Table<'a>>;

    /// The tables of the list. An element that is no table is reported and left out.
    fn read<'a>(&self, given: Given<'a>) -> Option<Vec<Table<'a>>> {
        let Value::Array(elements) = &given.node.value else {
            return given.wrong(&self.expected(None), self.help(given.key));
        };
        if elements.len() < self.least {
            return given.wrong("at least one", self.help(given.key));
        }
        if let Some(most) = self.most
            && let Some(first) = elements.get(most)
        {
            let message = format!("{} has {} tables", quoted(given.key), elements.len());
            given.reading.report.error(first.span, message, format!("expected at most {most}"), None);
            return None;
        }
        let table = |element| {
            let given = given.element(element);
            match &element.value {
                Value::Table(entries) => Some(Table::new(given.reading, self.of, entries, element.span)),
                _ => given.wrong("a table", self.help(given.key)),
            }
        };
        Some(elements.iter().filter_map(table).collect())
    }
}

/// A number, or a table that says more.
#[derive(Clone, Copy)]
pub(crate) struct NumberOrTable(pub Number, pub &'static TableKeys);

/// A value of the kind [`NumberOrTable`].
pub(crate) enum NumberOr<'a> {
    Number(f64),
    Table(Table<'a>),
}

impl Describe for NumberOrTable {
    fn expected(&self, unit: Option<&str>) -> String {
        format!("{}, or {}", self.0.expected(unit), Nested(self.1).expected(unit))
    }

    fn documented(&self, unit: Option<&str>) -> String {
        format!("{}, or {}", self.0.documented(unit), Nested(self.1).documented(unit))
    }

    fn schema(&self, is_partial: bool) -> Map<String, Json> {
        object(json!({ "anyOf": [self.0.schema(is_partial), Nested(self.1).schema(is_partial)] }))
    }

    fn tables(&self) -> Vec<&'static TableKeys> {
        vec![self.1]
    }
}

impl Kind for NumberOrTable {
    type Value<'a> = NumberOr<'a>;

    fn read<'a>(&self, given: Given<'a>) -> Option<NumberOr<'a>> {
        match &given.node.value {
            Value::Table(_) => Nested(self.1).read(given).map(NumberOr::Table),
            Value::Integer(_) | Value::Float(_) => self.0.read(given).map(NumberOr::Number),
            _ => given.wrong(&self.expected(given.unit()), None),
        }
    }
}

/// A table whose keys are names, and whose values are all of one kind.
#[derive(Clone, Copy)]
pub(crate) struct ByName<K> {
    pub of: K,
    pub names: Names,
    /// The beginning of a right one, for the help of errors.
    pub example: &'static str,
}

/// The keys of a table of the kind [`ByName`].
#[derive(Clone, Copy)]
pub(crate) enum Names {
    /// Any names of these things.
    Any(&'static str),
    /// Some of these words; the first text says what one names.
    Of(&'static str, &'static [&'static str]),
}

impl<K: Describe> ByName<K> {
    fn things(&self) -> String {
        match self.names {
            Names::Any(things) => format!("names of {things}"),
            Names::Of(thing, _) => format!("{thing}s"),
        }
    }
}

impl<K: Describe> Describe for ByName<K> {
    fn expected(&self, _: Option<&str>) -> String {
        format!("a table of {}", self.things())
    }

    fn documented(&self, unit: Option<&str>) -> String {
        format!("a table of {}, each with {}", self.things(), self.of.documented(unit))
    }

    fn schema(&self, is_partial: bool) -> Map<String, Json> {
        let one = self.of.schema(is_partial);
        object(match self.names {
            Names::Any(_) => json!({ "type": "object", "additionalProperties": one }),
            Names::Of(_, words) => {
                let all: Map<_, _> =
                    words.iter().map(|word| ((*word).to_owned(), one.clone().into())).collect();
                json!({ "type": "object", "properties": all, "additionalProperties": false })
            }
        })
    }

    fn tables(&self) -> Vec<&'static TableKeys> {
        self.of.tables()
    }
}

impl<K: Kind> Kind for ByName<K> {
    type Value<'a> = BTreeMap<&'a str, Spanned<K::Value<'a>>>;

    /// The values by their names. One that is wrong is reported and left out.
    fn read<'a>(&self, given: Given<'a>) -> Option<Self::Value<'a>> {
        let Value::Table(entries) = &given.node.value else {
            return given.wrong(&self.expected(None), Some(format!("such as {}", self.example)));
        };
        let mut found = BTreeMap::new();
        for (name, entry) in entries {
            if let Names::Of(thing, words) = self.names
                && !words.contains(&name.as_str())
            {
                let help = match nearest(name, words.iter().copied()) {
                    Some(near) => format!("did you mean {}?", quoted(near)),
                    None => format!("the {thing}s are {}", list(words.iter().copied(), "and")),
                };
                let message = format!("there is no {thing} {}", quoted(name));
                given.reading.report.error(entry.key, message, "", Some(help));
                continue;
            }
            let node = &entry.node;
            if let Value::Table(inner) = &node.value
                && self.of.tables().is_empty()
                && let Some(key) = dotted(name, inner)
            {
                let message = format!("{} is taken for a table, because of the dot", quoted(name));
                let help = Some(format!("put the name in quotes: {key}"));
                given.reading.report.error(entry.key, message, "", help);
                continue;
            }
            if let Some(value) = self.of.read(Given { key: name, node, ..given }) {
                found.insert(name.as_str(), Spanned { value, span: node.span });
            }
        }
        Some(found)
    }
}

/// A key with dots as it has to be written to be one name, with its value: `"Cube.001" = 3` for `Cube.001 = 3`.
fn dotted(key: &str, entries: &Entries) -> Option<String> {
    let mut name = key.to_owned();
    let mut inner = entries;
    loop {
        let (key, entry) = inner.first_key_value().filter(|_| inner.len() == 1)?;
        name = format!("{name}.{key}");
        match &entry.node.value {
            Value::Table(deeper) => inner = deeper,
            Value::Integer(value) => {
                return Some(format!("\"{}\" = {value}", quoted(&name).trim_matches('`')));
            }
            _ => return None,
        }
    }
}
