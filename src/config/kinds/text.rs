//! Strings: any text, names, and choices of a few words.

use serde_json::{Map, Value as Json, json};

use super::super::table::{Describe, Given, Kind};
use super::object::object;
use crate::source::suggest::nearest;
use crate::source::tree::Value;
use crate::source::words::quoted;

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
pub(super) fn either(words: impl Iterator<Item = String>) -> String {
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
