//! Whole numbers of which each stands for something: one of a few, or in place of a word.

use serde_json::{Map, Value as Json, json};

use super::super::table::{Describe, Given, Kind};
use super::number::Integer;
use super::object::object;
use super::text::{Choice, either};
use crate::source::tree::Value;

/// One of a few whole numbers, each with the value that it stands for.
pub(crate) struct NumberChoice<T: 'static>(pub &'static [(usize, T)]);

impl<T> Clone for NumberChoice<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for NumberChoice<T> {}

impl<T: Sync> Describe for NumberChoice<T> {
    fn expected(&self, _: Option<&str>) -> String {
        either(self.0.iter().map(|(number, _)| number.to_string()))
    }

    fn schema(&self, _: bool) -> Map<String, Json> {
        let numbers: Vec<usize> = self.0.iter().map(|(number, _)| *number).collect();
        object(json!({ "type": "integer", "enum": numbers }))
    }
}

impl<T: Copy + Sync> Kind for NumberChoice<T> {
    type Value<'a> = T;

    fn read(&self, given: Given<'_>) -> Option<T> {
        let number = match given.node.value {
            Value::Integer(value) => usize::try_from(value).ok(),
            _ => None,
        };
        let found = number.and_then(|number| self.0.iter().find(|(known, _)| *known == number));
        found.map(|(_, value)| *value).or_else(|| given.wrong(&self.expected(None), None))
    }
}

/// One of a few words, or a number that counts something.
pub(crate) struct WordOrCount<T: 'static> {
    pub words: Choice<T>,
    pub counts: Integer<u32>,
    /// The value that a number stands for.
    pub of: fn(u32) -> T,
}

impl<T> Clone for WordOrCount<T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for WordOrCount<T> {}

impl<T: Sync> Describe for WordOrCount<T> {
    fn expected(&self, _: Option<&str>) -> String {
        format!("{}, or {}", self.words.expected(None), self.counts.expected(None))
    }

    fn documented(&self, _: Option<&str>) -> String {
        format!("{}, or {}", self.words.documented(None), self.counts.documented(None))
    }

    fn schema(&self, is_partial: bool) -> Map<String, Json> {
        object(json!({ "anyOf": [self.words.schema(is_partial), self.counts.schema(is_partial)] }))
    }
}

impl<T: Copy + Sync> Kind for WordOrCount<T> {
    type Value<'a> = T;

    fn read(&self, given: Given<'_>) -> Option<T> {
        match &given.node.value {
            Value::String(_) => self.words.read(given),
            Value::Integer(_) | Value::Float(_) => self.counts.read(given).map(self.of),
            _ => given.wrong(&self.expected(None), None),
        }
    }
}
