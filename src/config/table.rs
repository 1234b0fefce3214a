//! Keys, the tables that they stand in, and the reading of a table by them.
//!
//! A [`Key`] is declared once, in `keys/`. Its kind determines which values are right, the Rust type that reading gives, and
//! how messages, the JSON Schema, the reference page and `beamcast init` describe it.

use std::collections::BTreeMap;

use serde_json::{Map, Value as Json};

use super::foreign::{self, Foreign};
use super::parse;
use crate::source::suggest::nearest;
use crate::source::tree::{Entries, Node};
use crate::source::words::{list, quoted};
use crate::source::{Report, Span, Spanned};

/// The values that a key may have.
pub(crate) trait Kind: Describe {
    /// The type that reading gives.
    type Value<'a>;

    /// Checks a value and converts it. Reports what is wrong with it and gives `None`.
    fn read<'a>(&self, given: Given<'a>) -> Option<Self::Value<'a>>;
}

/// A kind in words, for people and for editors.
pub(crate) trait Describe: Sync {
    /// The right values, as messages say it after "expected": `a number of metres, greater than 0`.
    fn expected(&self, unit: Option<&str>) -> String;

    /// The right values in the plural, as a list of them says it.
    fn expected_many(&self, unit: Option<&str>) -> String {
        format!("values, each {}", self.expected(unit))
    }

    /// The right values, as the reference page says it.
    fn documented(&self, unit: Option<&str>) -> String {
        self.expected(unit)
    }

    /// The JSON Schema of the right values. Of a table that is partial, some required keys may come from a preset.
    fn schema(&self, is_partial: bool) -> Map<String, Json>;

    /// The header of a table that is the value of the key at `path`.
    fn header(&self, _path: &str) -> Option<String> {
        None
    }

    /// The tables that a value may consist of.
    fn tables(&self) -> Vec<&'static TableKeys> {
        Vec::new()
    }
}

/// The declaration of a key.
pub(crate) struct Key<K> {
    facts: Facts,
    pub kind: K,
}

/// The declaration of a key apart from its kind.
#[derive(Clone, Copy)]
pub(crate) struct Facts {
    /// The name. A unit at its end, such as `_m`, is the unit of its numbers.
    pub name: &'static str,
    /// The meaning of the value, in sentences.
    pub about: &'static str,
    /// The value that stands for a key that is left out, in TOML.
    pub default: Option<&'static str>,
    /// Of a key that must be there: what the error about its absence suggests to add.
    pub required: Option<&'static str>,
    /// Keys that say the same in another way. Given in a later layer, this key removes those of the layers before.
    pub replaces: &'static [&'static str],
    /// What `beamcast init` writes.
    pub starter: Option<Starter>,
}

/// A key's value in the job that `beamcast init` writes, in TOML.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Starter {
    /// The key is written with this value.
    Written(&'static str),
    /// The key is written as a comment, with this value.
    Suggested(&'static str),
}

impl Starter {
    /// The value.
    #[cfg(test)]
    pub fn value(self) -> &'static str {
        match self {
            Self::Written(value) | Self::Suggested(value) => value,
        }
    }
}

/// Declares a key.
pub(crate) const fn key<K: Copy>(name: &'static str, kind: K, about: &'static str) -> Key<K> {
    Key { facts: Facts { name, about, default: None, required: None, replaces: &[], starter: None }, kind }
}

impl<K: Copy> Key<K> {
    /// The value of a key that is left out, in TOML.
    pub const fn or(mut self, default: &'static str) -> Self {
        self.facts.default = Some(default);
        self
    }

    /// Makes the key one that must be there; `example` is what an error suggests to add.
    pub const fn required(mut self, example: &'static str) -> Self {
        self.facts.required = Some(example);
        self
    }

    /// Has the key remove others when a later layer gives it.
    pub const fn replaces(mut self, others: &'static [&'static str]) -> Self {
        self.facts.replaces = others;
        self
    }

    /// Has `beamcast init` write the key.
    pub const fn starts_as(mut self, value: &'static str) -> Self {
        self.facts.starter = Some(Starter::Written(value));
        self
    }

    /// Has `beamcast init` write the key as a comment.
    pub const fn suggested_as(mut self, value: &'static str) -> Self {
        self.facts.starter = Some(Starter::Suggested(value));
        self
    }
}

impl<K> Key<K> {
    pub const fn name(&self) -> &'static str {
        self.facts.name
    }
}

/// A key whose kind does not matter.
pub(crate) trait AnyKey: Sync {
    fn facts(&self) -> &Facts;
    fn kind(&self) -> &dyn Describe;

    fn name(&self) -> &'static str {
        self.facts().name
    }

    /// Whether a value is right.
    #[cfg(test)]
    fn allows(&self, reading: Reading<'_>, node: &Node) -> bool;
}

impl<K: Kind> AnyKey for Key<K> {
    #[cfg(test)]
    fn allows(&self, reading: Reading<'_>, node: &Node) -> bool {
        self.kind.read(Given { reading, key: self.name(), node, is_element: false }).is_some()
    }

    fn facts(&self) -> &Facts {
        &self.facts
    }

    fn kind(&self) -> &dyn Describe {
        &self.kind
    }
}

/// The keys of a table.
pub(crate) struct TableKeys {
    /// The table's name in messages.
    pub title: &'static str,
    pub keys: &'static [&'static dyn AnyKey],
    /// Keys of which exactly one must be there, in up to two groups; a group that does not exist is empty.
    pub one_of: [&'static [&'static dyn AnyKey]; 2],
    /// A key that can stand for one of those.
    pub unless: Option<&'static dyn AnyKey>,
    /// Whether a preset may give a part of this table, so that the other part alone is not wrong in an editor.
    pub is_partial: bool,
}

/// Declares a table.
pub(crate) const fn table(title: &'static str, keys: &'static [&'static dyn AnyKey]) -> TableKeys {
    TableKeys { title, keys, one_of: [&[], &[]], unless: None, is_partial: false }
}

impl TableKeys {
    pub const fn partial(mut self) -> Self {
        self.is_partial = true;
        self
    }

    pub const fn one_of(mut self, keys: &'static [&'static dyn AnyKey]) -> Self {
        self.one_of[0] = keys;
        self
    }

    /// A second group, of which exactly one must be there, too.
    pub const fn and_one_of(mut self, keys: &'static [&'static dyn AnyKey]) -> Self {
        self.one_of[1] = keys;
        self
    }

    /// The groups of keys of which exactly one must be there.
    pub fn groups(&self) -> impl Iterator<Item = &'static [&'static dyn AnyKey]> {
        self.one_of.into_iter().filter(|group| !group.is_empty())
    }

    pub const fn unless(mut self, key: &'static dyn AnyKey) -> Self {
        self.unless = Some(key);
        self
    }

    pub fn names(&self) -> impl Iterator<Item = &'static str> + Clone {
        self.keys.iter().map(|key| key.name())
    }

    /// The names of the keys that must be there.
    pub fn required(&self) -> impl Iterator<Item = &'static str> {
        self.keys.iter().filter(|key| key.facts().required.is_some()).map(|key| key.name())
    }

    fn declares(&self, key: &Facts) -> bool {
        self.keys.iter().any(|known| std::ptr::eq(known.facts(), key))
    }
}

/// All tables of some kinds of files.
pub(crate) struct Grammar {
    /// The documents and every table in them, each once, a table before the tables in it.
    pub tables: Vec<&'static TableKeys>,
    /// The defaults of all keys, by their text.
    defaults: BTreeMap<&'static str, Node>,
}

impl Grammar {
    /// Finds all tables of the documents and parses all defaults.
    ///
    /// # Panics
    /// If the default of a key is not TOML.
    pub fn new(documents: &[&'static TableKeys]) -> Self {
        let mut tables: Vec<&'static TableKeys> = Vec::new();
        let mut waiting: Vec<_> = documents.iter().rev().copied().collect();
        while let Some(table) = waiting.pop() {
            if !tables.iter().any(|known| std::ptr::eq(*known, table)) {
                tables.push(table);
                let inner: Vec<_> = table.keys.iter().flat_map(|key| key.kind().tables()).collect();
                waiting.extend(inner.into_iter().rev());
            }
        }
        let facts = || tables.iter().flat_map(|table| table.keys).map(|key| key.facts());
        let defaults = facts()
            .filter_map(|facts| facts.default)
            .map(|text| (text, parse::constant(text).unwrap_or_else(|| panic!("{text} is not TOML"))))
            .collect();
        Self { tables, defaults }
    }

    /// The default of a key, if it has one.
    pub fn default_of<K>(&self, key: &Key<K>) -> Option<&Node> {
        self.defaults.get(key.facts.default?)
    }

    /// The names of the keys that a key removes when it is laid over them.
    pub fn replaced_by(&self, name: &str) -> &'static [&'static str] {
        let facts = self.tables.iter().flat_map(|table| table.keys).map(|key| key.facts());
        let mut of_name = facts.filter(|facts| facts.name == name).map(|facts| facts.replaces);
        of_name.find(|replaced| !replaced.is_empty()).unwrap_or_default()
    }

    /// The title of the first table that has a key of this name.
    fn home(&self, name: &str) -> Option<&'static str> {
        self.tables.iter().find(|table| table.names().any(|known| known == name)).map(|table| table.title)
    }

    /// The key of a table that an unknown one was probably meant to be: the same with another unit or none, or nearly so,
    /// unless it is right somewhere else.
    fn meant_key(&self, name: &str, keys: &TableKeys) -> Option<&'static str> {
        let lower = name.to_lowercase();
        let (_, stem) = unit_and_stem(&lower);
        let with_stem = |stem: &str| keys.names().find(|known| unit_and_stem(known).1 == stem);
        if let Some(known) = with_stem(stem) {
            return Some(known);
        }
        if self.home(name).is_some() {
            return None;
        }
        nearest(name, keys.names())
            .or_else(|| with_stem(nearest(stem, keys.names().map(|known| unit_and_stem(known).1))?))
    }
}

/// The state that all tables of a configuration are read with.
#[derive(Clone, Copy)]
pub(crate) struct Reading<'a> {
    pub report: &'a Report,
    pub grammar: &'a Grammar,
}

/// A value that a kind is to read.
#[derive(Clone, Copy)]
pub(crate) struct Given<'a> {
    pub reading: Reading<'a>,
    /// The name of the value's key.
    pub key: &'a str,
    pub node: &'a Node,
    /// Whether the value is an element of the key's list.
    pub is_element: bool,
}

impl<'a> Given<'a> {
    /// The unit of the key's numbers.
    pub fn unit(&self) -> Option<&'static str> {
        unit(self.key)
    }

    /// An element of this list.
    pub fn element(&self, node: &'a Node) -> Self {
        Self { node, is_element: true, ..*self }
    }

    /// Reports that this value is wrong; gives `None`.
    pub fn wrong<T>(&self, expected: &str, help: Option<String>) -> Option<T> {
        let verb = if self.is_element { "has" } else { "is" };
        let message = format!("{} {verb} {}", quoted(self.key), self.node.value.describe());
        self.reading.report.error(self.node.span, message, format!("expected {expected}"), help);
        None
    }
}

/// A table that is being read.
pub(crate) struct Table<'a> {
    reading: Reading<'a>,
    keys: &'static TableKeys,
    entries: &'a Entries,
    /// The table's header, or its braces.
    pub span: Span,
    /// Keys that unknown ones were probably meant to be; the report has those.
    meant: Vec<&'static str>,
}

impl<'a> Table<'a> {
    /// Takes up a table. Reports the keys that it must not have and those that it lacks.
    pub fn new(reading: Reading<'a>, keys: &'static TableKeys, entries: &'a Entries, span: Span) -> Self {
        let mut table = Self { reading, keys, entries, span, meant: Vec::new() };
        table.report_unknown();
        for key in keys.keys {
            if let Some(example) = key.facts().required {
                table.need(*key, example);
            }
        }
        table
    }

    fn report_unknown(&mut self) {
        /// The report keeps fewer problems than two such tables could have.
        const MOST: usize = 100;
        let (grammar, title) = (self.reading.grammar, self.keys.title);
        let is_unknown = |name: &str| !self.keys.names().any(|known| known == name);
        for (name, entry) in self.entries.iter().filter(|(name, _)| is_unknown(name)).take(MOST) {
            let foreign = foreign::answer(title, name, |known| self.keys.names().any(|name| name == known));
            let help = match (foreign, grammar.meant_key(name, self.keys)) {
                (Some(Foreign::Means(known, "")), _) => {
                    self.meant.push(known);
                    format!("did you mean `{known}`?")
                }
                (Some(Foreign::Means(known, how)), _) => {
                    self.meant.push(known);
                    format!("did you mean `{known}`, {how}?")
                }
                (Some(Foreign::Answer(sentence)), _) => sentence.to_owned(),
                (None, Some(known)) => {
                    self.meant.push(known);
                    let unit = unit(known).filter(|_| unit_and_stem(name).0 != unit_and_stem(known).0);
                    match unit {
                        Some(unit) => format!("did you mean `{known}`, in {unit}?"),
                        None => format!("did you mean `{known}`?"),
                    }
                }
                (None, None) => match grammar.home(name) {
                    Some(home) => format!("`{name}` belongs in {home}"),
                    None => format!("the keys of {title} are {}", list(self.keys.names(), "and")),
                },
            };
            let message = format!("unknown key {} in {title}", quoted(name));
            self.report().error(entry.key, message, "", Some(help));
        }
    }

    pub fn report(&self) -> &'a Report {
        self.reading.report
    }

    /// The state that the table is read with.
    pub fn reading(&self) -> Reading<'a> {
        self.reading
    }

    /// The table's name in messages.
    pub fn title(&self) -> &'static str {
        self.keys.title
    }

    /// The value of a key. `None` if the key is left out, or if its value is wrong, which is then reported.
    pub fn read<K: Kind>(&self, key: &Key<K>) -> Option<Spanned<K::Value<'a>>> {
        let node = self.node(key)?;
        let given = Given { reading: self.reading, key: key.name(), node, is_element: false };
        Some(Spanned { value: key.kind.read(given)?, span: node.span })
    }

    /// The value of a key, or its default if it is left out. `None` if the value is wrong, which is then reported.
    ///
    /// # Panics
    /// If the key has no default, or if that is wrong.
    pub fn read_or_default<K: Kind>(&self, key: &Key<K>) -> Option<Spanned<K::Value<'a>>> {
        if self.has(key) { self.read(key) } else { Some(self.default_of(key)) }
    }

    /// The value of a key, or its default if it is left out or wrong. A wrong value is reported; the default serves to find
    /// what else is wrong.
    ///
    /// # Panics
    /// If the key has no default, or if that is wrong.
    pub fn value<K: Kind>(&self, key: &Key<K>) -> K::Value<'a> {
        self.read(key).unwrap_or_else(|| self.default_of(key)).value
    }

    fn default_of<K: Kind>(&self, key: &Key<K>) -> Spanned<K::Value<'a>> {
        let node = self.reading.grammar.default_of(key);
        let node = node.unwrap_or_else(|| panic!("{} has no default", key.name()));
        let given = Given { reading: self.reading, key: key.name(), node, is_element: false };
        let value = key.kind.read(given).unwrap_or_else(|| panic!("the default of {} is wrong", key.name()));
        Spanned { value, span: self.span }
    }

    /// Whether the table has no keys at all.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// Whether a key is there, right or wrong.
    pub fn has(&self, key: &dyn AnyKey) -> bool {
        self.node(key).is_some()
    }

    /// Where the value of a key stands, or the table if the key is left out.
    pub fn span_of(&self, key: &dyn AnyKey) -> Span {
        self.node(key).map_or(self.span, |node| node.span)
    }

    fn node(&self, key: &dyn AnyKey) -> Option<&'a Node> {
        debug_assert!(self.keys.declares(key.facts()), "{} has no key {}", self.keys.title, key.name());
        #[cfg(test)]
        asked::note(self.keys.title, key.name());
        self.entries.get(key.name()).map(|entry| &entry.node)
    }

    /// Reports a key that is not there and must be; `example` is what would be right.
    pub fn need(&self, key: &dyn AnyKey, example: &str) {
        let name = key.name();
        if !self.entries.contains_key(name) && !self.meant.contains(&name) {
            let message = format!("{} has no `{name}`", self.keys.title);
            self.report().error(
                self.span,
                message,
                format!("needs `{name}`"),
                Some(format!("add {example}")),
            );
        }
    }
}

/// The units that a key's last part may name.
const UNITS: &[(&str, &str)] = &[
    ("m", "metres"),
    ("deg", "degrees"),
    ("s", "seconds"),
    ("us", "microseconds"),
    ("ns", "nanoseconds"),
    ("hz", "hertz"),
    ("px", "pixels"),
    ("mrad", "milliradians"),
    ("nm", "nanometres"),
    ("klx", "kilolux"),
];

/// Endings that people give keys for units that the keys don't have.
const FOREIGN_UNITS: &[&str] = &[
    "mm", "cm", "km", "meter", "meters", "metre", "metres", "ft", "rad", "degree", "degrees", "radians",
    "ms", "sec", "seconds", "khz", "mhz", "rpm", "fps", "pixel", "pixels",
];

/// The unit of a key's numbers, by the key's last part.
pub(super) fn unit(name: &str) -> Option<&'static str> {
    let (stem, suffix) = name.rsplit_once('_')?;
    if let ("s", Some((_, per_second))) = (suffix, stem.rsplit_once('_')) {
        match per_second {
            "m" => return Some("metres a second"),
            "deg" => return Some("degrees a second"),
            _ => {}
        }
    }
    // A rate such as `points_per_s` does not count seconds.
    UNITS.iter().find(|(s, _)| *s == suffix && !stem.ends_with("_per")).map(|(_, unit)| *unit)
}

/// A key's last part if that is a unit, and the part before it.
fn unit_and_stem(name: &str) -> (Option<&str>, &str) {
    match name.rsplit_once('_') {
        Some((stem, suffix))
            if UNITS.iter().any(|(s, _)| *s == suffix) || FOREIGN_UNITS.contains(&suffix) =>
        {
            (Some(suffix), stem)
        }
        _ => (None, name),
    }
}

/// Records which keys of which tables the readers asked for.
#[cfg(test)]
pub(super) mod asked {
    use std::cell::RefCell;
    use std::collections::BTreeSet;

    thread_local! {
        static ASKED: RefCell<BTreeSet<(&'static str, &'static str)>> = const { RefCell::new(BTreeSet::new()) };
    }

    pub fn note(table: &'static str, key: &'static str) {
        ASKED.with_borrow_mut(|asked| asked.insert((table, key)));
    }

    /// All that this thread asked for since the last call, as (title of the table, name of the key).
    pub fn take() -> BTreeSet<(&'static str, &'static str)> {
        ASKED.take()
    }
}
