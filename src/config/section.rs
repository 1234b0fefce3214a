//! Typed reading of a table: every problem is recorded, and reading goes on.

use super::tree::{Node, Table, Value};
use crate::source::suggest::{list, nearest, quoted};
use crate::source::{Report, Span, Spanned};

/// The tables of jobs and sensor files: what they are called in messages, and their keys.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct Shape {
    pub title: &'static str,
    pub keys: &'static [&'static str],
}

macro_rules! shapes {
    ($($name:ident = $title:literal [$($key:literal),* $(,)?];)*) => {
        $(pub(super) const $name: Shape = Shape { title: $title, keys: &[$($key),*] };)*
        pub(super) const SHAPES: &[Shape] = &[$($name),*];
    };
}
shapes! {
    JOB = "a job" ["scene", "scene_name", "up", "seed", "labels", "sensor", "trajectory", "trace", "output",
        "check", "expect"];
    SENSOR = "`[[sensor]]`" ["name", "preset", "mode", "pose", "rotating", "raster", "mirror", "risley", "rays", "pinhole",
        "fisheye", "equirectangular", "range", "ring"];
    SENSOR_FILE = "a sensor file" ["rotating", "raster", "mirror", "risley", "rays", "pinhole", "fisheye",
        "equirectangular", "range", "ring", "modes"];
    MODE = "a mode" ["rotating", "raster", "mirror", "risley", "rays", "pinhole", "fisheye", "equirectangular", "range"];
    ROTATING = "`[rotating]`" ["elevations_deg", "azimuth_offsets_deg", "beam_times_us", "beam_origins_m",
        "range_offset_m", "turns_while_firing", "layout", "pixel_shift_by_row", "columns", "sector_deg", "rate_hz"];
    RASTER = "`[raster]`" ["azimuths_deg", "elevations_deg", "order", "pulse_rate_hz", "rate_hz"];
    MIRROR = "`[mirror]`" ["azimuth", "elevation", "beams_deg", "pulse_rate_hz", "rate_hz"];
    AXIS = "an axis of `[mirror]`" ["motion", "rate_hz", "from_deg", "to_deg", "phase_deg"];
    RISLEY = "`[risley]`" ["prisms", "beams_deg", "pulse_rate_hz", "rate_hz"];
    PRISM = "a prism" ["rate_hz", "wedge_deg", "index", "phase_deg", "tilted"];
    RAYS = "`[rays]`" ["file", "rate_hz"];
    PINHOLE = "`[pinhole]`" ["width_px", "height_px", "hfov_deg", "vfov_deg", "fx_px", "fy_px", "cx_px", "cy_px",
        "distortion", "rate_hz"];
    FISHEYE = "`[fisheye]`" ["width_px", "height_px", "hfov_deg", "fx_px", "fy_px", "cx_px", "cy_px", "distortion",
        "rate_hz"];
    EQUIRECTANGULAR = "`[equirectangular]`" ["width_px", "height_px", "hfov_deg", "vfov_deg", "rate_hz"];
    RANGE = "`[range]`" ["min_m", "max_m"];
    TRAJECTORY = "`[trajectory]`" ["pose"];
    TRACE = "`[trace]`" ["kernel"];
    OUTPUT = "`[output]`" ["dir", "formats", "frame"];
    POSE = "`pose`" ["position_m", "rpy_deg", "quaternion_xyzw"];
    SPACED = "a range of angles" ["from", "to", "count"];
    SECTOR = "`sector_deg`" ["from", "to"];
    CHECK = "`[check]`" ["channels", "tolerance"];
    TOLERANCE = "a tolerance" ["absolute", "relative", "pixels"];
    EXPECT = "`[[expect]]`"
        ["name", "sensor", "points", "plane", "resolution", "coverage", "blind_zone", "returns", "unobstructed",
         "points_per_s", "speed"];
    EXPECT_POINTS = "`points`" ["object", "label", "at_least", "at_most", "min_range_m", "max_range_m"];
    EXPECT_PLANE = "`plane`" ["object", "label", "normal", "offset_m", "max_error_m"];
    EXPECT_RESOLUTION = "`resolution`" ["object", "label", "max_horizontal_deg", "max_vertical_deg"];
    EXPECT_COVERAGE = "`coverage`"
        ["object", "label", "x_m", "y_m", "cell_m", "at_least", "ground_z_m", "ground_tolerance_m"];
    EXPECT_BLIND_ZONE = "`blind_zone`"
        ["object", "label", "at_most_m", "sector_deg", "ground_z_m", "ground_tolerance_m"];
    EXPECT_RETURNS = "`returns`" ["at_least", "at_most"];
    EXPECT_UNOBSTRUCTED = "`unobstructed`" ["object", "label", "at_most"];
    EXPECT_POINTS_PER_S = "`points_per_s`" ["at_least", "at_most"];
    EXPECT_SPEED = "`speed`" ["at_least_rays_per_s"];
}

/// The units that a key's last part may name.
const UNITS: &[(&str, &str)] = &[
    ("m", "metres"),
    ("deg", "degrees"),
    ("s", "seconds"),
    ("us", "microseconds"),
    ("hz", "hertz"),
    ("px", "pixels"),
];

/// Endings that people give keys for units that the keys don't have.
const FOREIGN_UNITS: &[&str] = &[
    "mm", "cm", "km", "meter", "meters", "metre", "metres", "ft", "rad", "mrad", "degree", "degrees",
    "radians", "ns", "ms", "sec", "seconds", "khz", "mhz", "rpm", "fps", "pixel", "pixels",
];

/// A table that is being read. Making it reports the keys that it shouldn't have.
pub(super) struct Section<'a> {
    report: &'a Report,
    shape: &'static Shape,
    table: &'a Table,
    /// The table's header, or its braces.
    pub span: Span,
    /// Keys that were probably meant by unknown ones, which were reported already.
    meant: Vec<&'static str>,
}

impl<'a> Section<'a> {
    pub fn new(report: &'a Report, shape: &'static Shape, table: &'a Table, span: Span) -> Self {
        let mut meant = Vec::new();
        for (key, entry) in table.iter().filter(|(key, _)| !shape.keys.contains(&key.as_str())).take(100) {
            let help = match meant_key(key, shape) {
                Some(known) => {
                    meant.push(known);
                    let unit = unit(known).filter(|_| unit_and_stem(key).0 != unit_and_stem(known).0);
                    match unit {
                        Some(unit) => format!("did you mean `{known}`, in {unit}?"),
                        None => format!("did you mean `{known}`?"),
                    }
                }
                None => match home(key) {
                    Some(title) => format!("`{key}` belongs in {title}"),
                    None => {
                        format!("the keys of {} are {}", shape.title, list(shape.keys.iter().copied(), "and"))
                    }
                },
            };
            let message = format!("unknown key {} in {}", quoted(key), shape.title);
            report.error(entry.key, message, "", Some(help));
        }
        Self { report, shape, table, span, meant }
    }

    /// What the table is called in messages.
    pub fn title(&self) -> &'static str {
        self.shape.title
    }

    /// The value of a key as it stands.
    pub fn get(&self, key: &str) -> Option<&'a Node> {
        debug_assert!(
            self.shape.keys.contains(&key),
            "{key} is missing from the shape of {}",
            self.shape.title
        );
        self.table.get(key).map(|entry| &entry.node)
    }

    /// Reports a key that isn't there and must be; `example` is what would be right.
    pub fn need(&self, key: &'static str, example: &str) {
        if self.get(key).is_none() && !self.meant.contains(&key) {
            let message = format!("{} has no `{key}`", self.shape.title);
            self.report.error(self.span, message, format!("needs `{key}`"), Some(format!("add {example}")));
        }
    }

    /// Reports a value of the wrong kind.
    fn expected<T>(&self, key: &str, node: &Node, expected: &str) -> Option<T> {
        self.report.error(
            node.span,
            format!("`{key}` is {}", describe(&node.value)),
            format!("expected {expected}"),
            None,
        );
        None
    }

    pub fn text(&self, key: &str) -> Option<Spanned<&'a str>> {
        let node = self.get(key)?;
        match &node.value {
            Value::String(text) if text.is_empty() => self.expected(key, node, "some text"),
            Value::String(text) => Some(Spanned { value: text, span: node.span }),
            _ => self.expected(key, node, "a string, in quotes"),
        }
    }

    /// One of a few words.
    pub fn choice<T: Copy>(&self, key: &str, choices: &[(&'static str, T)]) -> Option<T> {
        self.chosen(key, self.get(key)?, choices)
    }

    fn chosen<T: Copy>(&self, key: &str, node: &Node, choices: &[(&'static str, T)]) -> Option<T> {
        let words = || choices.iter().map(|(word, _)| *word);
        let Value::String(text) = &node.value else {
            return self.expected(key, node, &either(words()));
        };
        let found = choices.iter().find(|(word, _)| word == text).map(|(_, value)| *value);
        if found.is_none() {
            let help = nearest(text, words()).map(|word| format!("did you mean \"{word}\"?"));
            let message = format!("`{key}` is {}", describe(&node.value));
            self.report.error(node.span, message, format!("expected {}", either(words())), help);
        }
        found
    }

    /// A list of a few words, each at most once, at least one.
    pub fn choices<T: Copy>(&self, key: &str, choices: &[(&'static str, T)]) -> Option<Vec<T>> {
        let node = self.get(key)?;
        let words = either(choices.iter().map(|(word, _)| *word));
        let Value::Array(elements) = &node.value else {
            return self.expected(key, node, &format!("a list of {words}"));
        };
        if elements.is_empty() {
            return self.expected(key, node, &format!("at least one of {words}"));
        }
        let mut found = Vec::new();
        let mut seen = Vec::new();
        for element in elements {
            if let Some(value) = self.chosen(key, element, choices) {
                if let Value::String(word) = &element.value {
                    if seen.contains(&word) {
                        let message = format!("`{key}` lists {} twice", describe(&element.value));
                        self.report.error(element.span, message, "listed before", None);
                    }
                    seen.push(word);
                }
                found.push(value);
            }
        }
        Some(found)
    }

    /// A whole number from `least` to `most`.
    pub fn integer(&self, key: &str, least: u64, most: u64) -> Option<Spanned<u64>> {
        integer(self.report, key, self.get(key)?, least, most)
    }

    /// A finite number.
    pub fn number(&self, key: &str) -> Option<Spanned<f64>> {
        self.finite(key, self.get(key)?)
    }

    /// A number greater than 0; `inf` is one if `infinite_too`.
    pub fn positive(&self, key: &str, infinite_too: bool) -> Option<Spanned<f64>> {
        let node = self.get(key)?;
        let of_unit = unit(key).map_or(String::new(), |unit| format!(" of {unit}"));
        match to_f64(&node.value) {
            Some(value) if value > 0.0 && (value.is_finite() || infinite_too) => {
                Some(Spanned { value, span: node.span })
            }
            Some(_) => self.expected(key, node, &format!("a number{of_unit}, greater than 0")),
            None => self.finite(key, node),
        }
    }

    /// A part of a whole, from 0 to 1.
    pub fn share(&self, key: &str) -> Option<Spanned<f64>> {
        let number = self.number(key)?;
        if (0.0..=1.0).contains(&number.value) {
            return Some(number);
        }
        self.expected(key, self.get(key)?, "a part of the whole, from 0 to 1")
    }

    fn finite(&self, key: &str, node: &Node) -> Option<Spanned<f64>> {
        finite(self.report, key, node)
    }

    /// A list of finite numbers.
    pub fn numbers(&self, key: &str) -> Option<Spanned<Vec<Spanned<f64>>>> {
        let node = self.get(key)?;
        let Value::Array(elements) = &node.value else {
            let unit = unit(key).map_or(String::new(), |unit| format!(" of {unit}"));
            return self.expected(key, node, &format!("a list of numbers{unit}"));
        };
        // All of them are looked at, so that all that is wrong with them is told.
        let numbers: Vec<_> = elements.iter().map(|element| self.finite(key, element)).collect();
        Some(Spanned { value: numbers.into_iter().collect::<Option<_>>()?, span: node.span })
    }

    /// A list of exactly `N` finite numbers, which are called `names`.
    pub fn vector<const N: usize>(&self, key: &str, names: &str) -> Option<Spanned<[f64; N]>> {
        let numbers = self.numbers(key)?;
        let values: Vec<f64> = numbers.value.iter().map(|n| n.value).collect();
        match <[f64; N]>::try_from(values) {
            Ok(value) => Some(Spanned { value, span: numbers.span }),
            Err(values) => {
                let message = format!("`{key}` has {}", count(values.len(), "number"));
                self.report.error(numbers.span, message, format!("expected {N}: {names}"), None);
                None
            }
        }
    }

    /// `true` or `false`.
    pub fn boolean(&self, key: &str) -> Option<bool> {
        let node = self.get(key)?;
        match node.value {
            Value::Boolean(value) => Some(value),
            _ => self.expected(key, node, "`true` or `false`"),
        }
    }

    /// A list of lists of exactly `N` finite numbers, which are called `names`.
    pub fn vectors<const N: usize>(&self, key: &str, names: &str) -> Option<Spanned<Vec<Spanned<[f64; N]>>>> {
        let node = self.get(key)?;
        let expected = format!("a list of lists of {N} numbers: {names}");
        let Value::Array(elements) = &node.value else { return self.expected(key, node, &expected) };
        let vectors: Vec<_> = elements
            .iter()
            .map(|element| {
                let Value::Array(numbers) = &element.value else {
                    return self.expected(key, element, &format!("a list of {N} numbers: {names}"));
                };
                let values: Option<Vec<f64>> =
                    numbers.iter().map(|n| self.finite(key, n).map(|at| at.value)).collect();
                match <[f64; N]>::try_from(values?) {
                    Ok(value) => Some(Spanned { value, span: element.span }),
                    Err(_) => self.expected(key, element, &format!("{N} numbers: {names}")),
                }
            })
            .collect();
        Some(Spanned { value: vectors.into_iter().collect::<Option<_>>()?, span: node.span })
    }

    /// A list of tables.
    pub fn sections(&self, key: &str, shape: &'static Shape) -> Option<Spanned<Vec<Section<'a>>>> {
        let node = self.get(key)?;
        let expected = || format!("a list of tables of {}", list(shape.keys.iter().copied(), "and"));
        let Value::Array(elements) = &node.value else { return self.expected(key, node, &expected()) };
        let tables: Vec<_> = elements
            .iter()
            .map(|element| match &element.value {
                Value::Table(table) => Some(Section::new(self.report, shape, table, element.span)),
                _ => self.expected(key, element, &expected()),
            })
            .collect();
        Some(Spanned { value: tables.into_iter().collect::<Option<_>>()?, span: node.span })
    }

    /// A table.
    pub fn section(&self, key: &str, shape: &'static Shape) -> Option<Section<'a>> {
        let node = self.get(key)?;
        match &node.value {
            Value::Table(table) => Some(Section::new(self.report, shape, table, node.span)),
            _ => self.expected(key, node, &format!("a table of {}", list(shape.keys.iter().copied(), "and"))),
        }
    }
}

/// A finite number.
pub(super) fn finite(report: &Report, key: &str, node: &Node) -> Option<Spanned<f64>> {
    let kind = if to_f64(&node.value).is_some() { "a finite number" } else { "a number" };
    let expected = match unit(key) {
        Some(unit) => format!("{kind} of {unit}"),
        None => kind.to_owned(),
    };
    match to_f64(&node.value) {
        Some(value) if value.is_finite() => Some(Spanned { value, span: node.span }),
        _ => {
            let message = format!("`{key}` is {}", describe(&node.value));
            report.error(node.span, message, format!("expected {expected}"), None);
            None
        }
    }
}

/// A whole number from `least` to `most`.
pub(super) fn integer(
    report: &Report,
    key: &str,
    node: &Node,
    least: u64,
    most: u64,
) -> Option<Spanned<u64>> {
    let value = match node.value {
        Value::Integer(i) => u64::try_from(i).ok().filter(|i| (least..=most).contains(i)),
        _ => None,
    };
    if value.is_none() {
        report.error(
            node.span,
            format!("{} is {}", quoted(key), describe(&node.value)),
            format!("expected a whole number from {least} to {most}"),
            None,
        );
    }
    value.map(|value| Spanned { value, span: node.span })
}

/// A number, whole or not.
fn to_f64(value: &Value) -> Option<f64> {
    match value {
        Value::Integer(i) => Some(*i as f64),
        Value::Float(f) => Some(*f),
        _ => None,
    }
}

/// `3 numbers`, `1 number`.
pub(super) fn count(n: usize, noun: &str) -> String {
    format!("{n} {noun}{}", if n == 1 { "" } else { "s" })
}

fn either(words: impl Iterator<Item = &'static str>) -> String {
    let words: Vec<String> = words.map(|word| format!("\"{word}\"")).collect();
    match words.split_last() {
        Some((last, before)) if !before.is_empty() => format!("{} or {last}", before.join(", ")),
        _ => words.concat(),
    }
}

/// A value as a message tells it.
pub(super) fn describe(value: &Value) -> String {
    match value {
        Value::String(text) if text.is_empty() => "an empty string".to_owned(),
        Value::String(text) => format!("the string \"{}\"", quoted(text).trim_matches('`')),
        Value::Integer(i) => i.to_string(),
        Value::Float(f) => f.to_string(),
        Value::Boolean(b) => b.to_string(),
        Value::Datetime(d) => format!("the date or time {d}"),
        Value::Array(a) if a.is_empty() => "an empty list".to_owned(),
        Value::Array(a) => format!("a list of {}", count(a.len(), "value")),
        Value::Table(_) => "a table".to_owned(),
    }
}

/// What a key's numbers count.
fn unit(key: &str) -> Option<&'static str> {
    let suffix = key.rsplit_once('_')?.1;
    UNITS.iter().find(|(s, _)| *s == suffix).map(|(_, unit)| *unit)
}

/// A key's last part if that is a unit, and what stands before it.
fn unit_and_stem(key: &str) -> (Option<&str>, &str) {
    match key.rsplit_once('_') {
        Some((stem, suffix))
            if UNITS.iter().any(|(s, _)| *s == suffix) || FOREIGN_UNITS.contains(&suffix) =>
        {
            (Some(suffix), stem)
        }
        _ => (None, key),
    }
}

/// The key of a table that an unknown one was probably meant to be: the same with another unit or none, or nearly so,
/// unless it is right somewhere else.
fn meant_key(key: &str, shape: &Shape) -> Option<&'static str> {
    let lower = key.to_lowercase();
    let (_, stem) = unit_and_stem(&lower);
    let with_stem = |stem: &str| shape.keys.iter().copied().find(|known| unit_and_stem(known).1 == stem);
    if let Some(known) = with_stem(stem) {
        return Some(known);
    }
    if home(key).is_some() {
        return None;
    }
    nearest(key, shape.keys.iter().copied())
        .or_else(|| with_stem(nearest(stem, shape.keys.iter().map(|known| unit_and_stem(known).1))?))
}

/// The table that a key belongs in.
fn home(key: &str) -> Option<&'static str> {
    SHAPES.iter().find(|shape| shape.keys.contains(&key)).map(|shape| shape.title)
}
