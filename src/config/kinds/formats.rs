//! The list of a job's formats: names, or tables with options.

use std::sync::LazyLock;

use serde_json::{Map, Value as Json, json};

use super::super::table::{AnyKey, Describe, Given, Key, Kind, Table, TableKeys, key, table};
use super::super::{reference, schema};
use super::number::{Flag, Number};
use super::object::object;
use super::text::{Choice, Text, either};
use crate::output::{FORMATS, Format, OptionSpec, OptionValue, OptionValues};
use crate::source::Spanned;
use crate::source::suggest::nearest;
use crate::source::tree::Value;
use crate::source::words::quoted;

/// A list of formats, each at most once, at least one.
#[derive(Clone, Copy)]
pub(crate) struct Formats;

/// The names of the registry's formats.
static NAMES: [(&str, Format); FORMATS.len()] = {
    let mut all = [("", Format::of(FORMATS[0])); FORMATS.len()];
    let mut index = 0;
    while index < FORMATS.len() {
        all[index] = (FORMATS[index].name, Format::of(FORMATS[index]));
        index += 1;
    }
    all
};

/// The key of a format's table that names the format.
const FORMAT: &str = "format";

/// The table of a format, with a key for each option.
struct FormatTable {
    format: Format,
    keys: &'static TableKeys,
    name: &'static Key<Choice<Format>>,
    options: Vec<(&'static OptionSpec, &'static Key<OneOption>)>,
}

/// The tables of all formats. They are made of the formats' own declarations, once, and live as long as the program.
static TABLES: LazyLock<Vec<FormatTable>> = LazyLock::new(|| NAMES.iter().map(FormatTable::of).collect());

impl FormatTable {
    fn of(named: &'static (&'static str, Format)) -> Self {
        let format = named.1;
        let example = format!("`format = \"{}\"`", format.name()).leak();
        let name = key(FORMAT, Choice(std::slice::from_ref(named)), "The format.").required(example);
        let name: &'static Key<Choice<Format>> = Box::leak(Box::new(name));
        let mut keys: Vec<&'static dyn AnyKey> = vec![name];
        let mut options = Vec::new();
        for option in format.spec.options {
            let kind = OneOption(option.values);
            let key = key(option.name, kind, option.about);
            let key = match kind.default() {
                Some(default) => key.or(default.leak()),
                None => key,
            };
            let key: &'static Key<OneOption> = Box::leak(Box::new(key));
            keys.push(key);
            options.push((option, key));
        }
        let title = format!("the format {}", format.name()).leak();
        Self { format, keys: Box::leak(Box::new(table(title, keys.leak()))), name, options }
    }

    /// The format with the options that a table gives.
    fn read(&self, given: Given<'_>, t: &Table<'_>) -> Format {
        let _ = t.read(self.name); // it led here
        let mut format = self.format;
        for (option, key) in &self.options {
            if let Some(value) = t.read(key) {
                format = format.with(option, value.value);
            }
        }
        if let Err(problem) = format.check_options() {
            given.reading.report.error(t.span, format!("{}: {problem}", self.keys.title), "", None);
        }
        format
    }
}

impl Formats {
    fn names() -> Choice<Format> {
        Choice(&NAMES)
    }

    fn read_one(given: Given<'_>) -> Option<Spanned<Format>> {
        let span = given.node.span;
        let Value::Table(entries) = &given.node.value else {
            return Some(Spanned { value: Self::names().read(given)?, span });
        };
        let Some(name) = entries.get(FORMAT) else {
            let help = Some("add `format = \"exr\"`, or another format".to_owned());
            given.reading.report.error(span, "a format has no `format`", "needs `format`", help);
            return None;
        };
        let name = Given { key: FORMAT, node: &name.node, is_element: false, ..given };
        let format = Self::names().read(name)?;
        let of_format = TABLES.iter().find(|table| table.format == format)?;
        let t = Table::new(given.reading, of_format.keys, entries, span);
        Some(Spanned { value: of_format.read(given, &t), span })
    }
}

impl Describe for Formats {
    fn expected(&self, _: Option<&str>) -> String {
        format!(
            "a list of {}, or of tables such as {{ format = \"depth16\", scale = 5000 }}",
            Self::names().expected(None)
        )
    }

    fn documented(&self, _: Option<&str>) -> String {
        let tables: Vec<_> = self.tables().into_iter().map(reference::link).collect();
        format!(
            "a list of {}, or of tables with a format's options: {}",
            Self::names().documented(None),
            tables.join(", ")
        )
    }

    fn schema(&self, is_partial: bool) -> Map<String, Json> {
        let name = Self::names().schema(is_partial);
        let tables = TABLES.iter().map(|table| schema::table(table.keys, is_partial));
        let any: Vec<_> = std::iter::once(name).chain(tables).collect();
        object(json!({ "type": "array", "items": { "anyOf": any }, "minItems": 1, "uniqueItems": true }))
    }

    /// The tables of the formats that have options.
    fn tables(&self) -> Vec<&'static TableKeys> {
        TABLES.iter().filter(|table| !table.options.is_empty()).map(|table| table.keys).collect()
    }
}

impl Kind for Formats {
    type Value<'a> = Vec<Spanned<Format>>;

    fn read(&self, given: Given<'_>) -> Option<Vec<Spanned<Format>>> {
        let Value::Array(elements) = &given.node.value else {
            return given.wrong(&self.expected(None), None);
        };
        if elements.is_empty() {
            return given.wrong(&format!("at least one of {}", Self::names().expected(None)), None);
        }
        let mut found: Vec<Spanned<Format>> = Vec::new();
        for element in elements {
            let Some(format) = Self::read_one(given.element(element)) else { continue };
            if found.iter().any(|known| known.value == format.value) {
                let message = format!("{} lists \"{}\" twice", quoted(given.key), format.value.name());
                given.reading.report.error(element.span, message, "listed before", None);
            }
            found.push(format);
        }
        Some(found)
    }
}

/// The value of an option of a format.
#[derive(Clone, Copy)]
struct OneOption(OptionValues);

impl OneOption {
    /// The value of an option that is left out, in TOML. `None` if that is an empty text, which no job gives.
    fn default(self) -> Option<String> {
        match (self.0, self.0.default_value()) {
            (OptionValues::Flag { default }, _) => Some(default.to_string()),
            (_, OptionValue::Number(number)) => Some(number.to_string()),
            (_, OptionValue::Text(text)) => (!text.is_empty()).then(|| format!("{text:?}")),
        }
    }

    fn number(least: f64, most: f64) -> Number {
        Number::within(std::ops::Bound::Included(least), std::ops::Bound::Included(most))
    }
}

impl Describe for OneOption {
    fn expected(&self, unit: Option<&str>) -> String {
        match self.0 {
            OptionValues::Number { least, most, .. } => Self::number(least, most).expected(unit),
            OptionValues::OneOf { numbers, .. } => either(numbers.iter().map(u32::to_string)),
            OptionValues::Flag { .. } => Flag.expected(unit),
            OptionValues::Word { words, .. } => either(words.iter().map(|word| format!("\"{word}\""))),
            OptionValues::Text { .. } => Text.expected(unit),
        }
    }

    fn schema(&self, is_partial: bool) -> Map<String, Json> {
        match self.0 {
            OptionValues::Number { least, most, .. } => Self::number(least, most).schema(is_partial),
            OptionValues::OneOf { numbers, .. } => object(json!({ "type": "integer", "enum": numbers })),
            OptionValues::Flag { .. } => Flag.schema(is_partial),
            OptionValues::Word { words, .. } => object(json!({ "type": "string", "enum": words })),
            OptionValues::Text { .. } => Text.schema(is_partial),
        }
    }
}

impl Kind for OneOption {
    type Value<'a> = OptionValue;

    fn read(&self, given: Given<'_>) -> Option<OptionValue> {
        match self.0 {
            OptionValues::Number { least, most, .. } => Self::number(least, most).read(given).map(Into::into),
            OptionValues::OneOf { numbers, .. } => match given.node.value {
                Value::Integer(value) if numbers.iter().any(|number| i128::from(*number) == value) => {
                    Some((value as f64).into())
                }
                _ => given.wrong(&self.expected(None), None),
            },
            OptionValues::Flag { .. } => Flag.read(given).map(|is_set| f64::from(u8::from(is_set)).into()),
            OptionValues::Word { words, .. } => match &given.node.value {
                Value::String(text) if words.contains(&text.as_str()) => Some(OptionValue::text(text)),
                Value::String(text) => {
                    let help = nearest(text, words.iter().copied());
                    given.wrong(&self.expected(None), help.map(|word| format!("did you mean \"{word}\"?")))
                }
                _ => given.wrong(&self.expected(None), None),
            },
            OptionValues::Text { .. } => Text.read(given).map(OptionValue::text),
        }
    }
}
