//! Lists of angles, written out or evenly spaced.

use std::ops::Bound::Included;

use serde_json::{Map, Value as Json, json};

use super::super::kinds::{Integer, List, Nested, Number};
use super::super::table::{Describe, Given, Key, Kind, Table, TableKeys, key, table};
use crate::source::Spanned;
use crate::source::tree::Value;

/// Most rows and most columns of a range image, and so most angles of a list.
pub(super) const MAX_SIDE: u64 = 1_000_000;

pub(super) static SPACED: TableKeys = table("a range of angles", &[&FROM, &TO, &COUNT]);
static FROM: Key<Number> = key("from", Number::ANY, "The first angle in degrees.")
    .required("`from = 15.0`, the first angle in degrees");
static TO: Key<Number> =
    key("to", Number::ANY, "The last angle in degrees.").required("`to = -15.0`, the last angle in degrees");
static COUNT: Key<Integer<u64>> =
    key("count", Integer::within(1, MAX_SIDE), "The number of angles, both ends included.")
        .required("`count = 16`, the number of angles");

/// Angles in degrees: a list, or `{ from, to, count }`.
#[derive(Clone, Copy)]
pub(crate) struct Angles {
    /// Whether they are elevations, which end straight up and straight down.
    are_elevations: bool,
}

impl Angles {
    pub const ANY: Self = Self { are_elevations: false };
    pub const ELEVATIONS: Self = Self { are_elevations: true };

    /// The kind of one angle that is written out.
    fn one(self) -> Number {
        if self.are_elevations { Number::within(Included(-90.0), Included(90.0)) } else { Number::ANY }
    }
}

impl Describe for Angles {
    fn expected(&self, unit: Option<&str>) -> String {
        format!("a list of {}, or {}", self.one().expected_many(unit), Nested(&SPACED).expected(unit))
    }

    fn documented(&self, unit: Option<&str>) -> String {
        format!("a list of {}, or {}", self.one().expected_many(unit), Nested(&SPACED).documented(unit))
    }

    fn schema(&self, is_partial: bool) -> Map<String, Json> {
        let list = List { of: self.one(), least: 1 }.schema(is_partial);
        let all = json!([list, Nested(&SPACED).schema(is_partial)]);
        Map::from_iter([("anyOf".to_owned(), all)])
    }

    fn tables(&self) -> Vec<&'static TableKeys> {
        vec![&SPACED]
    }
}

impl Kind for Angles {
    type Value<'a> = Vec<Spanned<f64>>;

    fn read(&self, given: Given<'_>) -> Option<Vec<Spanned<f64>>> {
        let report = given.reading.report;
        let angles = match &given.node.value {
            Value::Table(_) => spaced(&Nested(&SPACED).read(given)?)?,
            Value::Array(_) => List { of: Number::ANY, least: 1 }.read(given)?,
            _ => return given.wrong(&self.expected(given.unit()), None),
        };
        if angles.len() as u64 > MAX_SIDE {
            let message = format!("`{}` lists {} angles", given.key, angles.len());
            report.error(given.node.span, message, format!("expected at most {MAX_SIDE}"), None);
            return None;
        }
        if !self.are_elevations {
            return Some(angles);
        }
        let mut told = Vec::new();
        for steep in angles.iter().filter(|angle| angle.value.abs() > 90.0) {
            // Evenly spaced angles share the spans of their ends.
            if !told.contains(&steep.span) {
                told.push(steep.span);
                let message = format!("no beam has an elevation of {} degrees", steep.value);
                report.error(steep.span, message, "expected -90 (straight down) to 90 (straight up)", None);
            }
        }
        told.is_empty().then_some(angles)
    }
}

/// The angles of `{ from, to, count }`. Each has the span of one of the ends.
fn spaced(t: &Table<'_>) -> Option<Vec<Spanned<f64>>> {
    let (from, to, count) = (t.read(&FROM), t.read(&TO), t.read(&COUNT));
    let (from, to, count) = (from?, to?, count?);
    if count.value == 1 && from.value != to.value {
        let message = format!("one beam can't reach from {} to {} degrees", from.value, to.value);
        t.report().error(count.span, message, "expected 2 or more, or `from` the same as `to`", None);
        return None;
    }
    let steps = (count.value - 1).max(1) as f64;
    let angle = |i| Spanned {
        value: from.value + (to.value - from.value) * i as f64 / steps,
        span: if i == 0 { from.span } else { to.span },
    };
    Some((0..count.value).map(angle).collect())
}
