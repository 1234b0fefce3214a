//! A job's `[[expect]]` tables → [`Expectation`]s.

use std::collections::BTreeSet;

use glam::DVec3;

use super::super::keys::expect as keys;
use super::super::keys::job::EXPECTATIONS;
use super::super::kinds::{Nested, Number};
use super::super::table::{Key, Table};
use crate::angle::Angle;
use crate::check::expect::{Bounds, Demand, Expectation, Expected, Ground, Target, Zone};
use crate::source::suggest::nearest;
use crate::source::words::{list, quoted};
use crate::source::{Span, Spanned};

/// Most cells of a zone, and of all zones of a job.
const MAX_CELLS: f64 = 1e7;
const MAX_CELLS_OF_ALL: f64 = 1e8;

/// The job's `[[expect]]`, in their order, with where each stands; `sensors` are the names of the job's sensors, each with the
/// number of its frames.
pub(super) fn expectations(job: &Table<'_>, sensors: &[(String, u64)]) -> (Vec<Expectation>, Vec<Span>) {
    let Some(tables) = job.read(&EXPECTATIONS) else { return Default::default() };
    let report = job.report();
    let (mut found, mut places) = (Vec::new(), Vec::new());
    let mut taken: BTreeSet<&str> = BTreeSet::new();
    let mut cells = 0.0;
    for t in &tables.value {
        let name = t.read(&keys::NAME);
        if let Some(name) = name.filter(|name| !taken.insert(name.value)) {
            let message = format!("two expectations are called {}", quoted(name.value));
            report.error(name.span, message, "expected another name", None);
        }
        let sensor = t.read(&keys::SENSOR);
        if let Some(Spanned { value, span }) = sensor
            && !sensors.iter().any(|(known, _)| known == value)
            && !sensors.is_empty()
        {
            let names = sensors.iter().map(|(name, _)| name.as_str());
            let help = match nearest(value, names.clone()) {
                Some(near) => format!("did you mean {}?", quoted(near)),
                None => format!("the job's sensors are {}", list(names, "and")),
            };
            report.error(span, format!("there is no sensor {}", quoted(value)), "", Some(help));
        }
        let demand = demand(t, frames_looked_at(sensor.map(|sensor| sensor.value), sensors));
        let what = expected(t);
        if let Some(Expected::Coverage { zone, .. }) = &what {
            cells += cells_of(zone);
            if cells > MAX_CELLS_OF_ALL {
                let message =
                    format!("the zones of the job have more than {MAX_CELLS_OF_ALL:e} cells in all");
                report.error(t.span, message, "too many from here on", None);
                break;
            }
        }
        if let (Some(name), Some(what)) = (name, what) {
            let sensor = sensor.map(|sensor| sensor.value.to_owned());
            found.push(Expectation { name: name.value.to_owned(), sensor, demand, what });
            let subject = SUBJECTS.iter().find(|(key, _)| t.has(*key));
            places.push(subject.map_or(t.span, |(key, _)| t.span_of(*key)));
        }
    }
    (found, places)
}

/// The number of frames that an expectation about a sensor can look at, or one about all sensors together: those of the sensor
/// that has the fewest. `None` if there is no such sensor.
fn frames_looked_at(sensor: Option<&str>, sensors: &[(String, u64)]) -> Option<u64> {
    let meant = sensors.iter().filter(|(name, _)| sensor.is_none_or(|sensor| name == sensor));
    meant.map(|(_, frames)| *frames).min()
}

/// The frames in which an expectation must be met, of so many.
fn demand(t: &Table<'_>, all: Option<u64>) -> Demand {
    let report = t.report();
    let frames = t.read(&keys::FRAMES);
    let from = frames.as_ref().and_then(|frames| frames.value.read(&keys::frames::FROM));
    let to = frames.as_ref().and_then(|frames| frames.value.read(&keys::frames::TO));
    let min_frames = t.read(&keys::MIN_FRAMES);
    let last = all.map(|all| all.saturating_sub(1));
    for given in [&from, &to].into_iter().flatten() {
        if let Some(last) = last.filter(|last| given.value > *last) {
            let message = format!("there is no frame {}", given.value);
            report.error(given.span, message, format!("expected a frame from 0 to {last}"), None);
        }
    }
    let (first, end) = (from.as_ref().map_or(0, |at| at.value), to.as_ref().map(|at| at.value));
    if let (Some(from), Some(end)) = (&from, end)
        && from.value > end
    {
        let message = format!("no frame lies between {} and {end}", from.value);
        report.error(from.span, message, "expected the lesser first", None);
    }
    let looked_at = end.or(last).map(|end| end.saturating_sub(first) + 1);
    if let (Some(least), Some(looked_at)) = (&min_frames, looked_at)
        && least.value > looked_at
    {
        let message = format!("`min_frames` is {}, and the expectation looks at {looked_at}", least.value);
        report.error(least.span, message, format!("expected at most {looked_at}"), None);
    }
    let demand = Demand {
        from: first,
        to: end,
        min_frames: min_frames.map(|at| at.value),
        seen_by_s: t.read(&keys::SEEN_BY).map(|at| at.value),
        max_flicker: t.read(&keys::MAX_FLICKER).map(|at| at.value),
    };
    if t.has(&keys::SPEED) && demand != Demand::default() {
        let message = "`speed` is that of the whole run, and looks at no frames";
        report.error(t.span_of(&keys::SPEED), message, "", None);
    }
    demand
}

/// The reader of a subject's table.
type Read = fn(&Table<'_>) -> Option<Expected>;

/// The tables that an expectation has one of, each with its reader.
const SUBJECTS: &[(&Key<Nested>, Read)] = &[
    (&keys::POINTS, points),
    (&keys::PLANE, plane),
    (&keys::RESOLUTION, resolution),
    (&keys::COVERAGE, coverage),
    (&keys::BLIND_ZONE, blind_zone),
    (&keys::RETURNS, |t| bounds(t, &keys::returns::AT_LEAST, &keys::returns::AT_MOST).map(Expected::Returns)),
    (&keys::UNOBSTRUCTED, unobstructed),
    (&keys::POINTS_PER_S, |t| {
        bounds(t, &keys::points_per_s::AT_LEAST, &keys::points_per_s::AT_MOST).map(Expected::PointsPerSecond)
    }),
    (&keys::DETECTION, |t| {
        let share = bounds(t, &keys::detection::AT_LEAST, &keys::detection::AT_MOST);
        Some(Expected::Detection { target: target(t), share: share? })
    }),
    (&keys::FALSE_ALARMS, |t| {
        Some(Expected::FalseAlarms { at_most: t.read(&keys::false_alarms::AT_MOST)?.value })
    }),
    (&keys::CAUSE_SHARE, |t| {
        let cause = t.read(&keys::cause_share::CAUSE);
        let share = bounds(t, &keys::cause_share::AT_LEAST, &keys::cause_share::AT_MOST);
        Some(Expected::CauseShare { cause: cause?.value, share: share? })
    }),
    (&keys::SPEED, |t| Some(Expected::Speed { at_least: t.read(&keys::speed::AT_LEAST)?.value })),
];

/// The one thing that an `[[expect]]` is about.
fn expected(t: &Table<'_>) -> Option<Expected> {
    let given: Vec<_> = SUBJECTS.iter().filter(|(key, _)| t.has(*key)).collect();
    match given.as_slice() {
        [(key, read)] => read(&t.read(key)?.value),
        [] => {
            let help = "such as `points = { object = \"crate_3\", at_least = 50 }`";
            let names = SUBJECTS.iter().map(|(key, _)| key.name());
            let label = format!("needs one of {}", list(names, "or"));
            t.report().error(t.span, "the expectation expects nothing", label, Some(help.into()));
            None
        }
        [_, (second, _), ..] => {
            let message = "an expectation is about one thing, and this is about more";
            let help = "write an `[[expect]]` of its own for it".to_owned();
            let label = format!("`{}` is one too many", second.name());
            t.report().error(t.span_of(*second), message, label, Some(help));
            None
        }
    }
}

fn points(t: &Table<'_>) -> Option<Expected> {
    use keys::points::{AT_LEAST, AT_MOST, MAX_RANGE, MIN_RANGE};
    let range_m = Bounds {
        at_least: t.read(&MIN_RANGE).map(|at| at.value),
        at_most: t.read(&MAX_RANGE).map(|at| at.value),
    };
    let count = bounds(t, &AT_LEAST, &AT_MOST);
    Some(Expected::Points { target: target(t), count: count?, range_m })
}

fn plane(t: &Table<'_>) -> Option<Expected> {
    use keys::plane::{MAX_ERROR, NORMAL, OFFSET};
    let (normal, offset, max_error) = (t.read(&NORMAL), t.read(&OFFSET), t.read(&MAX_ERROR));
    let normal = normal.and_then(|n| {
        let unit = DVec3::from_array(n.value).try_normalize();
        if unit.is_none() {
            t.report().error(n.span, "a plane's normal has no length", "expected a direction", None);
        }
        unit
    });
    let target = target(t);
    Some(Expected::Plane { target, normal: normal?, offset_m: offset?.value, max_error_m: max_error?.value })
}

fn resolution(t: &Table<'_>) -> Option<Expected> {
    use keys::resolution::{MAX_HORIZONTAL, MAX_VERTICAL};
    let angle = |key| t.read(key).map(|at: Spanned<f64>| Angle::deg(at.value));
    let (horizontal, vertical) = (angle(&MAX_HORIZONTAL), angle(&MAX_VERTICAL));
    if !t.has(&MAX_HORIZONTAL) {
        t.need(&MAX_VERTICAL, "`max_horizontal_deg = 0.2` or `max_vertical_deg = 0.4`, or both");
    }
    Some(Expected::Resolution { target: target(t), horizontal, vertical })
}

fn coverage(t: &Table<'_>) -> Option<Expected> {
    use keys::coverage::{AT_LEAST, CELL, X, Y};
    let side = |key| {
        let side: Spanned<[f64; 2]> = t.read(key)?;
        if side.value[0] >= side.value[1] {
            let message = format!("nothing lies between {} and {}", side.value[0], side.value[1]);
            t.report().error(side.span, message, "expected the lesser first", None);
            return None;
        }
        Some(side.value)
    };
    let (x_m, y_m, cell) = (side(&X), side(&Y), t.read(&CELL));
    let at_least = t.read(&AT_LEAST);
    let ground = ground(t);
    let (x_m, y_m, cell) = (x_m?, y_m?, cell?);
    let zone = Zone { ground, x_m, y_m, cell_m: cell.value };
    let cells = cells_of(&zone);
    if cells.is_nan() || cells > MAX_CELLS {
        let message = format!("a zone of {cells:e} cells");
        t.report().error(cell.span, message, format!("expected at most {MAX_CELLS:e}"), None);
        return None;
    }
    Some(Expected::Coverage { zone, at_least: at_least?.value })
}

fn cells_of(zone: &Zone) -> f64 {
    let cells = |[low, high]: [f64; 2]| ((high - low) / zone.cell_m).ceil();
    cells(zone.x_m) * cells(zone.y_m)
}

fn blind_zone(t: &Table<'_>) -> Option<Expected> {
    use keys::blind_zone::{AT_MOST, SECTOR};
    let at_most = t.read(&AT_MOST);
    let sector_deg =
        if t.has(&SECTOR) { t.read(&SECTOR).and_then(|s| sector(&s.value)) } else { Some((-180, 180)) };
    let ground = ground(t);
    Some(Expected::BlindZone { ground, at_most_m: at_most?.value, sector_deg: sector_deg? })
}

fn unobstructed(t: &Table<'_>) -> Option<Expected> {
    let at_most = t.value(&keys::unobstructed::AT_MOST);
    let body = target(t);
    if body == Target::default() {
        t.need(&keys::OBJECT, "`object = \"ego*\"`, the vehicle's own body");
    }
    Some(Expected::Unobstructed { body, at_most })
}

/// An object, a label, both or anything.
fn target(t: &Table<'_>) -> Target {
    Target {
        object: t.read(&keys::OBJECT).map(|at| at.value.to_owned()),
        label: t.read(&keys::LABEL).map(|at| at.value),
    }
}

fn ground(t: &Table<'_>) -> Ground {
    Ground { z_m: t.value(&keys::GROUND_Z), tolerance_m: t.value(&keys::GROUND_TOLERANCE), target: target(t) }
}

/// A least and a most, of which at least one must be there.
fn bounds(t: &Table<'_>, least: &Key<Number>, most: &Key<Number>) -> Option<Bounds> {
    let (at_least, at_most) = (t.read(least), t.read(most));
    if !t.has(most) {
        t.need(least, &format!("`{}` or `{}`, or both", least.name(), most.name()));
    }
    if let (Some(least), Some(most)) = (at_least, at_most)
        && least.value > most.value
    {
        let message = format!("nothing is at least {} and at most {}", least.value, most.value);
        t.report().error(t.report().later(most.span, least.span), message, "", None);
        return None;
    }
    let bounds = Bounds { at_least: at_least.map(|at| at.value), at_most: at_most.map(|at| at.value) };
    (bounds != Bounds::default()).then_some(bounds)
}

/// A sector of whole degrees, counterclockwise.
fn sector(t: &Table<'_>) -> Option<(i32, i32)> {
    use keys::blind_zone::{FROM, TO};
    let (from, to) = (t.read(&FROM), t.read(&TO));
    let (from, to) = (from?.value, to?.value);
    if !(from < to && to - from <= 360.0 && from.abs() <= 360.0) {
        let message = format!("the sector from {from} to {to} degrees");
        let label = "expected `from` less than `to`, and a turn at most";
        t.report().error(t.span, message, label, None);
        return None;
    }
    Some((from.floor() as i32, to.ceil() as i32))
}
