//! A job's `[check]` and `[[expect]]`.

use std::collections::BTreeMap;

use glam::DVec3;

use super::section::{self, Section};
use super::tree::{Node, Value};
use crate::angle::Angle;
use crate::check::expect::{Bounds, Expectation, Expected, Ground, Target, Zone};
use crate::check::{Settings, Tolerance};
use crate::output::CHANNEL_NAMES;
use crate::source::suggest::{list, nearest, quoted};
use crate::source::{Report, Spanned};

/// Most cells of a zone.
const MAX_CELLS: f64 = 1e7;

/// The job's `[check]`: `None` if it has none.
pub(super) fn settings(report: &Report, top: &Section<'_>) -> Option<Settings> {
    let s = top.section("check", &section::CHECK)?;
    let channels = s.choices("channels", &CHANNEL_NAMES.map(|name| (name, name)));
    let channels = channels.map(|list| list.into_iter().map(str::to_owned).collect());
    let mut tolerances = BTreeMap::new();
    match s.get("tolerance").map(|node| (node, &node.value)) {
        Some((_, Value::Table(table))) => {
            for (name, entry) in table {
                if !CHANNEL_NAMES.contains(&name.as_str()) {
                    let help = match nearest(name, CHANNEL_NAMES) {
                        Some(near) => format!("did you mean {}?", quoted(near)),
                        None => format!("the channels are {}", list(CHANNEL_NAMES, "and")),
                    };
                    let message = format!("there is no channel {}", quoted(name));
                    report.error(entry.key, message, "", Some(help));
                } else if let Some(tolerance) = tolerance(report, name, &entry.node) {
                    tolerances.insert(name.clone(), tolerance);
                }
            }
        }
        Some((node, value)) => {
            let message = format!("`tolerance` is {}", section::describe(value));
            let help = "such as `[check.tolerance]`, then `range = 0.001`".to_owned();
            report.error(node.span, message, "expected a table of channels", Some(help));
        }
        None => {}
    }
    Some(Settings { channels, tolerances })
}

/// A channel's tolerance: a number, or a table.
fn tolerance(report: &Report, name: &str, node: &Node) -> Option<Tolerance> {
    let not_negative = |at: Option<Spanned<f64>>| match at {
        Some(Spanned { value, span }) if value < 0.0 => {
            report.error(span, format!("a tolerance of {value}"), "expected 0 or more", None);
            0.0
        }
        at => at.map_or(0.0, |at| at.value),
    };
    match &node.value {
        Value::Table(table) => {
            let s = Section::new(report, &section::TOLERANCE, table, node.span);
            Some(Tolerance {
                absolute: not_negative(s.number("absolute")),
                relative: not_negative(s.number("relative")),
                pixels: s.share("pixels").map_or(0.0, |at| at.value),
            })
        }
        Value::Integer(_) | Value::Float(_) => {
            let absolute = not_negative(section::finite(report, name, node));
            Some(Tolerance { absolute, ..Tolerance::default() })
        }
        value => {
            let message = format!("the tolerance of {} is {}", quoted(name), section::describe(value));
            let label = "expected a number, or a table of `absolute`, `relative` and `pixels`";
            report.error(node.span, message, label, None);
            None
        }
    }
}

/// The job's `[[expect]]`, in their order; `sensors` are the names of its sensors.
pub(super) fn expectations(report: &Report, top: &Section<'_>, sensors: &[String]) -> Vec<Expectation> {
    let help = || Some("write `[[expect]]`, with two brackets, before each expectation's keys".to_owned());
    let nodes = match top.get("expect") {
        None => return Vec::new(),
        Some(Node { value: Value::Array(nodes), .. }) => nodes,
        Some(node) => {
            let message = format!("`expect` is {}", section::describe(&node.value));
            report.error(node.span, message, "expected a list of tables", help());
            return Vec::new();
        }
    };
    let mut found = Vec::new();
    let mut taken: Vec<&str> = Vec::new();
    for node in nodes {
        let Value::Table(table) = &node.value else {
            let message = format!("an expectation is {}", section::describe(&node.value));
            report.error(node.span, message, "expected a table", help());
            continue;
        };
        let s = Section::new(report, &section::EXPECT, table, node.span);
        s.need("name", "`name = \"the pedestrian is seen\"`, which reports call it by");
        let name = s.text("name");
        if let Some(name) = name {
            if taken.contains(&name.value) {
                let message = format!("two expectations are called {}", quoted(name.value));
                report.error(name.span, message, "expected another name", None);
            }
            taken.push(name.value);
        }
        let sensor = s.text("sensor");
        if let Some(Spanned { value, span }) = sensor
            && !sensors.iter().any(|known| known == value)
            && !sensors.is_empty()
        {
            let names = sensors.iter().map(String::as_str);
            let help = match nearest(value, names.clone()) {
                Some(near) => format!("did you mean {}?", quoted(near)),
                None => format!("the job's sensors are {}", list(names, "and")),
            };
            report.error(span, format!("there is no sensor {}", quoted(value)), "", Some(help));
        }
        let what = expected(report, &s);
        if let (Some(name), Some(what)) = (name, what) {
            let sensor = sensor.map(|at| at.value.to_owned());
            found.push(Expectation { name: name.value.to_owned(), sensor, what });
        }
    }
    found
}

/// What an `[[expect]]` expects: exactly one of its tables.
fn expected(report: &Report, s: &Section<'_>) -> Option<Expected> {
    const KINDS: [&str; 9] = [
        "points",
        "plane",
        "resolution",
        "coverage",
        "blind_zone",
        "returns",
        "unobstructed",
        "points_per_s",
        "speed",
    ];
    let given: Vec<(&str, &Node)> = KINDS.iter().filter_map(|key| Some((*key, s.get(key)?))).collect();
    let kind = match given.as_slice() {
        [(kind, _)] => *kind,
        [] => {
            let help = "such as `points = { object = \"crate_3\", at_least = 50 }`";
            let label = format!("needs one of {}", list(KINDS, "or"));
            report.error(s.span, "the expectation expects nothing", label, Some(help.into()));
            return None;
        }
        [_, (kind, node), ..] => {
            let message = "an expectation is about one thing, and this is about more";
            let help = "write an `[[expect]]` of its own for it".to_owned();
            report.error(node.span, message, format!("`{kind}` is one too many"), Some(help));
            return None;
        }
    };
    match kind {
        "points" => {
            let s = s.section(kind, &section::EXPECT_POINTS)?;
            let range_m = Bounds {
                at_least: s.number("min_range_m").map(|at| at.value),
                at_most: s.positive("max_range_m", false).map(|at| at.value),
            };
            Some(Expected::Points { target: target(&s), count: bounds(report, &s)?, range_m })
        }
        "plane" => {
            let s = s.section(kind, &section::EXPECT_PLANE)?;
            s.need("normal", "`normal = [0.0, 0.0, 1.0]`, in the world");
            s.need(
                "offset_m",
                "`offset_m = 0.0`, the plane's distance from the world's origin along `normal`",
            );
            s.need("max_error_m", "`max_error_m = 0.001`");
            let (normal, offset) = (s.vector::<3>("normal", "x, y, z"), s.number("offset_m"));
            let max_error = s.positive("max_error_m", false);
            let normal = normal.and_then(|n| {
                let unit = DVec3::from_array(n.value).try_normalize();
                if unit.is_none() {
                    report.error(n.span, "a plane's normal has no length", "expected a direction", None);
                }
                unit
            });
            let target = target(&s);
            Some(Expected::Plane {
                target,
                normal: normal?,
                offset_m: offset?.value,
                max_error_m: max_error?.value,
            })
        }
        "resolution" => {
            let s = s.section(kind, &section::EXPECT_RESOLUTION)?;
            let angle = |key| s.positive(key, false).map(|at| Angle::deg(at.value));
            let (horizontal, vertical) = (angle("max_horizontal_deg"), angle("max_vertical_deg"));
            if s.get("max_horizontal_deg").is_none() {
                s.need("max_vertical_deg", "`max_horizontal_deg = 0.2` or `max_vertical_deg = 0.4`, or both");
            }
            Some(Expected::Resolution { target: target(&s), horizontal, vertical })
        }
        "coverage" => {
            let s = s.section(kind, &section::EXPECT_COVERAGE)?;
            s.need("x_m", "`x_m = [-10.0, 10.0]`, from and to, in the body's frame");
            s.need("y_m", "`y_m = [-10.0, 10.0]`, from and to, in the body's frame");
            s.need("cell_m", "`cell_m = 0.5`, the side of a cell");
            s.need("at_least", "`at_least = 0.9`, the part of the cells");
            let side = |key| {
                let side = s.vector::<2>(key, "from, to")?;
                if side.value[0] >= side.value[1] {
                    let message = format!("nothing lies between {} and {}", side.value[0], side.value[1]);
                    report.error(side.span, message, "expected the lesser first", None);
                    return None;
                }
                Some(side.value)
            };
            let (x_m, y_m, cell) = (side("x_m"), side("y_m"), s.positive("cell_m", false));
            let at_least = s.share("at_least");
            let ground = ground(&s);
            let (x_m, y_m, cell) = (x_m?, y_m?, cell?);
            let cells = ((x_m[1] - x_m[0]) / cell.value).ceil() * ((y_m[1] - y_m[0]) / cell.value).ceil();
            if cells.is_nan() || cells > MAX_CELLS {
                let message = format!("a zone of {cells:e} cells");
                report.error(cell.span, message, format!("expected at most {MAX_CELLS:e}"), None);
                return None;
            }
            let zone = Zone { ground, x_m, y_m, cell_m: cell.value };
            Some(Expected::Coverage { zone, at_least: at_least?.value })
        }
        "blind_zone" => {
            let s = s.section(kind, &section::EXPECT_BLIND_ZONE)?;
            s.need("at_most_m", "`at_most_m = 5.0`, the distance from the body's origin");
            let at_most = s.positive("at_most_m", false);
            let sector_deg = match s.get("sector_deg") {
                None => Some((-180, 180)),
                Some(_) => sector(report, &s),
            };
            let ground = ground(&s);
            Some(Expected::BlindZone { ground, at_most_m: at_most?.value, sector_deg: sector_deg? })
        }
        "returns" => {
            let s = s.section(kind, &section::EXPECT_RETURNS)?;
            let (at_least, at_most) = (s.share("at_least"), s.share("at_most"));
            limits(report, &s, at_least, at_most).map(Expected::Returns)
        }
        "unobstructed" => {
            let s = s.section(kind, &section::EXPECT_UNOBSTRUCTED)?;
            let at_most = s.share("at_most").map_or(0.0, |at| at.value);
            let body = target(&s);
            if body == Target::default() {
                s.need("object", "`object = \"ego*\"`, the vehicle's own body");
            }
            Some(Expected::Unobstructed { body, at_most })
        }
        "points_per_s" => {
            let s = s.section(kind, &section::EXPECT_POINTS_PER_S)?;
            bounds(report, &s).map(Expected::PointsPerSecond)
        }
        _ => {
            let s = s.section(kind, &section::EXPECT_SPEED)?;
            s.need("at_least_rays_per_s", "`at_least_rays_per_s = 1e6`");
            Some(Expected::Speed { at_least: s.positive("at_least_rays_per_s", false)?.value })
        }
    }
}

/// An object, a label, both or anything.
fn target(s: &Section<'_>) -> Target {
    Target {
        object: s.text("object").map(|at| at.value.to_owned()),
        label: s.integer("label", 0, u64::from(u32::MAX)).and_then(|at| u32::try_from(at.value).ok()),
    }
}

fn ground(s: &Section<'_>) -> Ground {
    let default = Ground::default();
    Ground {
        z_m: s.number("ground_z_m").map_or(default.z_m, |at| at.value),
        tolerance_m: s.positive("ground_tolerance_m", false).map_or(default.tolerance_m, |at| at.value),
        target: target(s),
    }
}

/// `at_least` and `at_most`, numbers of 0 and more; one of them at least.
fn bounds(report: &Report, s: &Section<'_>) -> Option<Bounds> {
    let number = |key| {
        let at = s.number(key)?;
        if at.value < 0.0 {
            report.error(at.span, format!("`{key}` is {}", at.value), "expected 0 or more", None);
        }
        Some(at)
    };
    let (at_least, at_most) = (number("at_least"), number("at_most"));
    limits(report, s, at_least, at_most)
}

fn limits(
    report: &Report,
    s: &Section<'_>,
    at_least: Option<Spanned<f64>>,
    at_most: Option<Spanned<f64>>,
) -> Option<Bounds> {
    if s.get("at_most").is_none() {
        s.need("at_least", "`at_least` or `at_most`, or both");
    }
    if let (Some(least), Some(most)) = (at_least, at_most)
        && least.value > most.value
    {
        let message = format!("nothing is at least {} and at most {}", least.value, most.value);
        report.error(report.later(most.span, least.span), message, "", None);
        return None;
    }
    let bounds = Bounds { at_least: at_least.map(|at| at.value), at_most: at_most.map(|at| at.value) };
    (bounds != Bounds::default()).then_some(bounds)
}

/// Whole degrees, counter-clockwise.
fn sector(report: &Report, s: &Section<'_>) -> Option<(i32, i32)> {
    let span = s.get("sector_deg")?.span;
    let s = s.section("sector_deg", &section::SECTOR)?;
    s.need("from", "`from = -60.0`, an azimuth in degrees");
    s.need("to", "`to = 60.0`, an azimuth in degrees, counter-clockwise from `from`");
    let (from, to) = (s.number("from")?.value, s.number("to")?.value);
    if !(from < to && to - from <= 360.0 && from.abs() <= 360.0) {
        let message = format!("the sector from {from} to {to} degrees");
        let label = "expected `from` less than `to`, and a turn at most";
        report.error(span, message, label, None);
        return None;
    }
    Some((from.floor() as i32, to.ceil() as i32))
}
