//! The kinds of values that keys have.

use std::collections::BTreeMap;
use std::marker::PhantomData;
use std::ops::Bound::{self, Excluded, Included, Unbounded};

use serde_json::{Map, Value as Json, json};

use super::table::{Describe, Given, Kind, Table, TableKeys};
use super::{reference, schema};
use crate::source::Spanned;
use crate::source::suggest::{list, nearest, quoted};
use crate::source::tree::Value;

/// A number within bounds.
#[derive(Clone, Copy)]
pub(crate) struct Number {
    least: Bound<f64>,
    most: Bound<f64>,
    can_be_infinite: bool,
    nouns: [&'static str; 2],
}

impl Number {
    pub const ANY: Self = Self::within(Unbounded, Unbounded);
    pub const POSITIVE: Self = Self::within(Excluded(0.0), Unbounded);
    pub const NOT_NEGATIVE: Self = Self::within(Included(0.0), Unbounded);
    /// From 0 to 1.
    pub const SHARE: Self = Self {
        nouns: ["a part of the whole", "parts of the whole"],
        ..Self::within(Included(0.0), Included(1.0))
    };

    pub const fn within(least: Bound<f64>, most: Bound<f64>) -> Self {
        Self { least, most, can_be_infinite: false, nouns: ["a number", "numbers"] }
    }

    /// Lets infinity be right.
    pub const fn or_infinite(self) -> Self {
        Self { can_be_infinite: true, ..self }
    }

    fn bounds(&self, unit: Option<&str>) -> String {
        let unit = unit.map_or(String::new(), |unit| format!(" of {unit}"));
        let bounds = match (self.least, self.most) {
            (Included(least), Included(most)) => format!(", from {least} to {most}"),
            (least, most) => {
                let least = match least {
                    Included(least) => Some(format!("{least} or more")),
                    Excluded(least) => Some(format!("greater than {least}")),
                    Unbounded => None,
                };
                let most = match most {
                    Included(most) => Some(format!("at most {most}")),
                    Excluded(most) => Some(format!("less than {most}")),
                    Unbounded => None,
                };
                let both: Vec<String> = least.into_iter().chain(most).collect();
                if both.is_empty() { String::new() } else { format!(", {}", both.join(" and ")) }
            }
        };
        let infinity = if self.can_be_infinite { ", or `inf`" } else { "" };
        format!("{unit}{bounds}{infinity}")
    }

    fn allows(&self, value: f64) -> bool {
        let is_above = match self.least {
            Included(least) => value >= least,
            Excluded(least) => value > least,
            Unbounded => true,
        };
        let is_below = match self.most {
            Included(most) => value <= most,
            Excluded(most) => value < most,
            Unbounded => true,
        };
        is_above && is_below && !value.is_nan() && (value.is_finite() || self.can_be_infinite)
    }
}

impl Describe for Number {
    fn expected(&self, unit: Option<&str>) -> String {
        format!("{}{}", self.nouns[0], self.bounds(unit))
    }

    fn expected_many(&self, unit: Option<&str>) -> String {
        format!("{}{}", self.nouns[1], self.bounds(unit))
    }

    fn schema(&self, _: bool) -> Map<String, Json> {
        let mut schema = object(json!({ "type": "number" }));
        match self.least {
            Included(least) => schema.insert("minimum".into(), plain(least)),
            Excluded(least) => schema.insert("exclusiveMinimum".into(), plain(least)),
            Unbounded => None,
        };
        match self.most {
            Included(most) => schema.insert("maximum".into(), plain(most)),
            Excluded(most) => schema.insert("exclusiveMaximum".into(), plain(most)),
            Unbounded => None,
        };
        schema
    }
}

impl Kind for Number {
    type Value<'a> = f64;

    fn read(&self, given: Given<'_>) -> Option<f64> {
        let value = match given.node.value {
            Value::Integer(value) => Some(value as f64),
            Value::Float(value) => Some(value),
            _ => None,
        };
        if let Some(value) = value.filter(|value| self.allows(*value)) {
            return Some(value);
        }
        let mut expected = self.expected(given.unit());
        if value.is_some_and(|value| !value.is_finite()) && !self.can_be_infinite {
            expected = expected.replacen("a ", "a finite ", 1);
        }
        given.wrong(&expected, None)
    }
}

/// A bound as JSON: whole numbers without a point.
fn plain(bound: f64) -> Json {
    let whole = bound as i64;
    if whole as f64 == bound { whole.into() } else { bound.into() }
}

/// A whole number within bounds, both included.
#[derive(Clone, Copy)]
pub(crate) struct Integer<T> {
    least: u64,
    most: u64,
    gives: PhantomData<fn() -> T>,
}

impl<T> Integer<T> {
    pub const fn within(least: u64, most: u64) -> Self {
        Self { least, most, gives: PhantomData }
    }
}

impl<T> Describe for Integer<T> {
    fn expected(&self, _: Option<&str>) -> String {
        format!("a whole number from {} to {}", self.least, self.most)
    }

    fn schema(&self, _: bool) -> Map<String, Json> {
        object(json!({ "type": "integer", "minimum": self.least, "maximum": self.most }))
    }
}

impl<T: TryFrom<u64>> Kind for Integer<T> {
    type Value<'a> = T;

    fn read(&self, given: Given<'_>) -> Option<T> {
        let value = match given.node.value {
            Value::Integer(value) => u64::try_from(value).ok(),
            _ => None,
        };
        let value = value.filter(|value| (self.least..=self.most).contains(value));
        let value = value.and_then(|value| T::try_from(value).ok());
        value.or_else(|| given.wrong(&self.expected(None), None))
    }
}

/// `true` or `false`.
#[derive(Clone, Copy)]
pub(crate) struct Flag;

impl Describe for Flag {
    fn expected(&self, _: Option<&str>) -> String {
        "`true` or `false`".to_owned()
    }

    fn schema(&self, _: bool) -> Map<String, Json> {
        object(json!({ "type": "boolean" }))
    }
}

impl Kind for Flag {
    type Value<'a> = bool;

    fn read(&self, given: Given<'_>) -> Option<bool> {
        match given.node.value {
            Value::Boolean(value) => Some(value),
            _ => given.wrong(&self.expected(None), None),
        }
    }
}

/// A string that is not empty.
#[derive(Clone, Copy)]
pub(crate) struct Text;

impl Describe for Text {
    fn expected(&self, _: Option<&str>) -> String {
        "a string, in quotes".to_owned()
    }

    fn documented(&self, _: Option<&str>) -> String {
        "a string".to_owned()
    }

    fn schema(&self, _: bool) -> Map<String, Json> {
        object(json!({ "type": "string", "minLength": 1 }))
    }
}

impl Kind for Text {
    type Value<'a> = &'a str;

    fn read<'a>(&self, given: Given<'a>) -> Option<&'a str> {
        match &given.node.value {
            Value::String(text) if text.is_empty() => given.wrong("some text", None),
            Value::String(text) => Some(text),
            _ => given.wrong(&self.expected(None), None),
        }
    }
}

/// A string that can name a folder on any system.
#[derive(Clone, Copy)]
pub(crate) struct FolderName;

impl Describe for FolderName {
    fn expected(&self, _: Option<&str>) -> String {
        "letters, digits, `-`, `_` and inner `.`".to_owned()
    }

    fn documented(&self, _: Option<&str>) -> String {
        format!("a string of {}, at most {} characters", self.expected(None), Self::LONGEST)
    }

    fn schema(&self, _: bool) -> Map<String, Json> {
        object(json!({ "type": "string", "pattern": "^[A-Za-z0-9_-]([A-Za-z0-9._-]{0,62}[A-Za-z0-9_-])?$" }))
    }
}

impl FolderName {
    const LONGEST: usize = 64;
}

impl Kind for FolderName {
    type Value<'a> = &'a str;

    fn read<'a>(&self, given: Given<'a>) -> Option<&'a str> {
        let name = Text.read(given)?;
        let refuse = |message: String, label: &str| {
            given.reading.report.error(given.node.span, message, label, None);
            None
        };
        let is_allowed = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
        if !name.chars().all(is_allowed) || name.starts_with('.') || name.ends_with('.') {
            let label = format!("expected {}", self.expected(None));
            return refuse(format!("{} can't name a sensor's output folder", quoted(name)), &label);
        }
        if name.len() > Self::LONGEST {
            let label = format!("expected at most {}", Self::LONGEST);
            return refuse(format!("a sensor's name has {} characters", name.len()), &label);
        }
        let lower = name.to_lowercase();
        let device = lower.split('.').next().unwrap_or("");
        let numbered = device.strip_prefix("com").or(device.strip_prefix("lpt"));
        if matches!(device, "con" | "prn" | "aux" | "nul")
            || numbered.is_some_and(|n| n.len() == 1 && n.bytes().all(|b| b.is_ascii_digit()))
        {
            let message = format!("{} can't name a sensor's output folder", quoted(name));
            return refuse(message, "Windows keeps this name for a device");
        }
        Some(name)
    }
}

/// One of a few words, each with the value that it stands for.
pub(crate) struct Choice<T: 'static>(pub &'static [(&'static str, T)]);

impl<T> Clone for Choice<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Choice<T> {}

impl<T> Choice<T> {
    fn words(&self) -> impl Iterator<Item = &'static str> {
        self.0.iter().map(|(word, _)| *word)
    }
}

impl<T: Sync> Describe for Choice<T> {
    fn expected(&self, _: Option<&str>) -> String {
        either(self.words().map(|word| format!("\"{word}\"")))
    }

    fn documented(&self, _: Option<&str>) -> String {
        either(self.words().map(|word| format!("`\"{word}\"`")))
    }

    fn schema(&self, _: bool) -> Map<String, Json> {
        object(json!({ "type": "string", "enum": self.words().collect::<Vec<_>>() }))
    }
}

impl<T: Copy + Sync> Kind for Choice<T> {
    type Value<'a> = T;

    fn read(&self, given: Given<'_>) -> Option<T> {
        let Value::String(text) = &given.node.value else {
            return given.wrong(&self.expected(None), None);
        };
        let found = self.0.iter().find(|(word, _)| word == text).map(|(_, value)| *value);
        found.or_else(|| {
            let help = nearest(text, self.words()).map(|word| format!("did you mean \"{word}\"?"));
            given.wrong(&self.expected(None), help)
        })
    }
}

/// `a, b or c`.
fn either(words: impl Iterator<Item = String>) -> String {
    let words: Vec<String> = words.collect();
    match words.split_last() {
        Some((last, before)) if !before.is_empty() => format!("{} or {last}", before.join(", ")),
        _ => words.concat(),
    }
}

/// A list of some of a few words, each at most once, at least one.
pub(crate) struct Choices<T: 'static>(pub Choice<T>);

impl<T> Clone for Choices<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for Choices<T> {}

impl<T: Sync> Describe for Choices<T> {
    fn expected(&self, _: Option<&str>) -> String {
        format!("a list of {}", self.0.expected(None))
    }

    fn documented(&self, _: Option<&str>) -> String {
        format!("a list of {}", self.0.documented(None))
    }

    fn schema(&self, is_partial: bool) -> Map<String, Json> {
        object(
            json!({ "type": "array", "items": self.0.schema(is_partial), "minItems": 1, "uniqueItems": true }),
        )
    }
}

impl<T: Copy + Sync> Kind for Choices<T> {
    type Value<'a> = Vec<T>;

    fn read(&self, given: Given<'_>) -> Option<Vec<T>> {
        let Value::Array(elements) = &given.node.value else {
            return given.wrong(&self.expected(None), None);
        };
        if elements.is_empty() {
            return given.wrong(&format!("at least one of {}", self.0.expected(None)), None);
        }
        let mut found = Vec::new();
        let mut seen = Vec::new();
        for element in elements {
            let Some(value) = self.0.read(given.element(element)) else { continue };
            if let Value::String(word) = &element.value {
                if seen.contains(&word) {
                    let message = format!("{} lists {} twice", quoted(given.key), element.value.describe());
                    given.reading.report.error(element.span, message, "listed before", None);
                }
                seen.push(word);
            }
            found.push(value);
        }
        Some(found)
    }
}

/// A list of values of one kind.
#[derive(Clone, Copy)]
pub(crate) struct List<K> {
    pub of: K,
    /// How many elements there must be at least: 0 or 1.
    pub least: usize,
}

impl<K: Describe> Describe for List<K> {
    fn expected(&self, unit: Option<&str>) -> String {
        format!("a list of {}", self.of.expected_many(unit))
    }

    fn expected_many(&self, unit: Option<&str>) -> String {
        format!("lists of {}", self.of.expected_many(unit))
    }

    fn schema(&self, is_partial: bool) -> Map<String, Json> {
        let mut schema = object(json!({ "type": "array", "items": self.of.schema(is_partial) }));
        if self.least > 0 {
            schema.insert("minItems".into(), self.least.into());
        }
        schema
    }
}

impl<K: Kind> Kind for List<K> {
    type Value<'a> = Vec<Spanned<K::Value<'a>>>;

    fn read<'a>(&self, given: Given<'a>) -> Option<Self::Value<'a>> {
        let Value::Array(elements) = &given.node.value else {
            return given.wrong(&self.expected(given.unit()), None);
        };
        if elements.len() < self.least {
            return given.wrong("at least one", None);
        }
        // The report has all wrong elements, not only the first.
        let read =
            |element| Some(Spanned { value: self.of.read(given.element(element))?, span: element.span });
        let all: Vec<Option<_>> = elements.iter().map(read).collect();
        all.into_iter().collect()
    }
}

/// A list of exactly `N` numbers, with their names.
#[derive(Clone, Copy)]
pub(crate) struct Vector<const N: usize>(pub &'static str);

impl<const N: usize> Describe for Vector<N> {
    fn expected(&self, unit: Option<&str>) -> String {
        format!("a list of {N} {}: {}", Number::ANY.expected_many(unit), self.0)
    }

    fn expected_many(&self, unit: Option<&str>) -> String {
        format!("lists of {N} {}: {}", Number::ANY.expected_many(unit), self.0)
    }

    fn schema(&self, is_partial: bool) -> Map<String, Json> {
        let number = Number::ANY.schema(is_partial);
        object(json!({ "type": "array", "items": number, "minItems": N, "maxItems": N }))
    }
}

impl<const N: usize> Kind for Vector<N> {
    type Value<'a> = [f64; N];

    fn read(&self, given: Given<'_>) -> Option<[f64; N]> {
        let Value::Array(elements) = &given.node.value else {
            return given.wrong(&self.expected(given.unit()), None);
        };
        if elements.len() != N {
            return given.wrong(&self.expected(given.unit()), None);
        }
        let all: Vec<Option<f64>> = elements.iter().map(|e| Number::ANY.read(given.element(e))).collect();
        <[f64; N]>::try_from(all.into_iter().collect::<Option<Vec<f64>>>()?).ok()
    }
}

/// One list, or a list of such lists.
#[derive(Clone, Copy)]
pub(crate) struct OneOrEach<K>(pub K);

/// A value of the kind [`OneOrEach`].
#[derive(Debug)]
pub(crate) enum OneOrMany<V> {
    /// One for all.
    One(V),
    /// A list of them.
    Many(Vec<Spanned<V>>),
}

impl<K: Describe + Copy> OneOrEach<K> {
    fn many(&self) -> List<K> {
        List { of: self.0, least: 1 }
    }
}

impl<K: Describe + Copy> Describe for OneOrEach<K> {
    fn expected(&self, unit: Option<&str>) -> String {
        format!("{}, or a list of such lists", self.0.expected(unit))
    }

    fn schema(&self, is_partial: bool) -> Map<String, Json> {
        object(json!({ "anyOf": [self.0.schema(is_partial), self.many().schema(is_partial)] }))
    }
}

impl<K: Kind + Copy> Kind for OneOrEach<K> {
    type Value<'a> = OneOrMany<K::Value<'a>>;

    fn read<'a>(&self, given: Given<'a>) -> Option<Self::Value<'a>> {
        match &given.node.value {
            Value::Array(elements) if elements.iter().any(|e| matches!(e.value, Value::Array(_))) => {
                self.many().read(given).map(OneOrMany::Many)
            }
            Value::Array(_) => self.0.read(given).map(OneOrMany::One),
            _ => given.wrong(&self.expected(given.unit()), None),
        }
    }
}

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
            if let Some(value) = self.of.read(Given { key: name, node, ..given }) {
                found.insert(name.as_str(), Spanned { value, span: node.span });
            }
        }
        Some(found)
    }
}

fn object(value: Json) -> Map<String, Json> {
    match value {
        Json::Object(map) => map,
        _ => Map::new(),
    }
}
