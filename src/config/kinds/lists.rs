//! Lists of values of one kind.

use serde_json::{Map, Value as Json, json};

use super::super::table::{Describe, Given, Kind};
use super::number::Number;
use super::object::object;
use crate::source::Spanned;
use crate::source::tree::{Node, Value};

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

/// A list of numbers, texts and flags, at least one.
#[derive(Clone, Copy)]
pub(crate) struct Scalars;

impl Describe for Scalars {
    fn expected(&self, _: Option<&str>) -> String {
        "a list of numbers, strings or flags".to_owned()
    }

    fn schema(&self, _: bool) -> Map<String, Json> {
        let one = json!({ "type": ["number", "string", "boolean"] });
        object(json!({ "type": "array", "items": one, "minItems": 1 }))
    }
}

impl Kind for Scalars {
    type Value<'a> = &'a [Node];

    fn read<'a>(&self, given: Given<'a>) -> Option<&'a [Node]> {
        let Value::Array(elements) = &given.node.value else {
            return given.wrong(&self.expected(None), None);
        };
        let is_scalar = |node: &&Node| {
            matches!(node.value, Value::String(_) | Value::Integer(_) | Value::Float(_) | Value::Boolean(_))
        };
        if let Some(other) = elements.iter().find(|element| !is_scalar(element)) {
            return given.element(other).wrong("a number, a string or a flag", None);
        }
        match elements.as_slice() {
            [] => given.wrong("at least one", None),
            elements => Some(elements),
        }
    }
}

/// A 4 × 4 matrix as four lists, each a row.
#[derive(Clone, Copy)]
pub(crate) struct Matrix;

impl Matrix {
    const ROW: Vector<4> = Vector("a row of the matrix");
}

impl Describe for Matrix {
    fn expected(&self, _: Option<&str>) -> String {
        "a list of 4 rows, each a list of 4 numbers".to_owned()
    }

    fn schema(&self, is_partial: bool) -> Map<String, Json> {
        let row = Self::ROW.schema(is_partial);
        object(json!({ "type": "array", "items": row, "minItems": 4, "maxItems": 4 }))
    }
}

impl Kind for Matrix {
    type Value<'a> = [[f64; 4]; 4];

    fn read(&self, given: Given<'_>) -> Option<[[f64; 4]; 4]> {
        let Value::Array(rows) = &given.node.value else {
            return given.wrong(&self.expected(None), None);
        };
        if rows.len() != 4 {
            let help =
                (rows.len() == 3).then(|| "the fourth row of a pose is [0.0, 0.0, 0.0, 1.0]".to_owned());
            return given.wrong(&self.expected(None), help);
        }
        let all: Vec<Option<[f64; 4]>> = rows.iter().map(|row| Self::ROW.read(given.element(row))).collect();
        <[[f64; 4]; 4]>::try_from(all.into_iter().collect::<Option<Vec<_>>>()?).ok()
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
