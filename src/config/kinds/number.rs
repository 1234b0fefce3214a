//! Numbers and flags.

use std::marker::PhantomData;
use std::ops::Bound::{self, Excluded, Included, Unbounded};

use serde_json::{Map, Value as Json, json};

use super::super::table::{Describe, Given, Kind};
use super::object::object;
use crate::source::tree::Value;
use crate::source::words::quoted;

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
        value.or_else(|| {
            let whole = match given.node.value {
                Value::Float(value) if value.fract() == 0.0 && (0.0..1e15).contains(&value) => {
                    Some(value as u64)
                }
                _ => None,
            };
            let whole = whole.filter(|value| (self.least..=self.most).contains(value));
            match whole {
                // TOML tells 1800.0 from 1800.
                Some(whole) => {
                    let message = format!("{} is {whole}.0, a number with a fraction", quoted(given.key));
                    let label = format!("expected {}", self.expected(None));
                    given.reading.report.fail(given.node.span, message, label, Some(format!("write {whole}")))
                }
                None => given.wrong(&self.expected(None), None),
            }
        })
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
