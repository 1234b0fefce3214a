//! A sensor file's tables → [`Sensor`].

mod camera;
mod depth;
mod limit;
mod measurement;
mod rotating;
mod scanner;

use super::super::keys::sensor::{self as keys, range};
use super::super::kinds::Nested;
use super::super::plausibility;
use super::super::table::{Key, Table};
use super::sensor_files::SensorFiles;
use crate::sensor::{Capture, Limited, Pattern, RangeLimits, Ranging, Sensor};
use crate::source::words::number;
use crate::source::{Doubt, Span};

use measurement::check_rows;
pub(super) use measurement::measurement;

/// The reader of a pattern's table.
type Read = fn(&Table<'_>, &SensorFiles) -> Option<Pattern>;

/// The tables that a sensor may have one of, each with its reader.
const PATTERNS: &[(&Key<Nested>, Read)] = &[
    (&keys::ROTATING, |t, _| rotating::pattern(t).map(Pattern::Rotating)),
    (&keys::RASTER, |t, _| scanner::raster(t).map(Pattern::Raster)),
    (&keys::MIRROR, |t, _| scanner::mirror(t).map(Pattern::Mirror)),
    (&keys::RISLEY, |t, _| scanner::risley(t).map(Pattern::Risley)),
    (&keys::RAYS, |t, files| scanner::rays(t, files).map(Pattern::Rays)),
    (&keys::PINHOLE, |t, _| camera::pinhole(t).map(Pattern::Camera)),
    (&keys::FISHEYE, |t, _| camera::fisheye(t).map(Pattern::Camera)),
    (&keys::EQUIRECTANGULAR, |t, _| camera::equirectangular(t).map(Pattern::Raster)),
    (&keys::ORTHOGRAPHIC, |t, _| camera::orthographic(t).map(Pattern::Orthographic)),
];

/// Whether a key of a sensor is a pattern's.
pub(in super::super) fn is_pattern(key: &str) -> bool {
    PATTERNS.iter().any(|(pattern, _)| pattern.name() == key)
}

/// The sensor of a table with a pattern, `range`, `ring` and the tables by which it measures. `None` if the report has errors about it. `is_pattern_lost`
/// says that there would be a pattern, had its file not been reported as unreadable.
pub(super) fn sensor(t: &Table<'_>, files: &SensorFiles, is_pattern_lost: bool) -> Option<Sensor> {
    let report = t.report();
    let range = range(t);
    let ring = t.value(&keys::RING);
    let measurement = measurement(t, files, range, max_at(t));
    let given: Vec<_> = PATTERNS.iter().filter(|(key, _)| t.has(*key)).collect();
    if let [(a, _), (b, _), ..] = given.as_slice() {
        report.error(
            report.later(t.span_of(*a), t.span_of(*b)),
            format!("a sensor has one pattern, and this has both `[{}]` and `[{}]`", a.name(), b.name()),
            "one too many",
            Some("keep one of the two; a second sensor is a `[[sensor]]` of its own".into()),
        );
    }
    if given.is_empty() && !is_pattern_lost {
        let help = "add `[rotating]`, `[pinhole]` or another pattern or, in a job, a `preset` that has one";
        report.error(t.span, "the sensor has no pattern", "needs one", Some(help.into()));
    }
    let read = |(key, read): &&(&Key<Nested>, Read)| read(&t.read(key)?.value, files);
    let patterns: Vec<_> = given.iter().map(read).collect();
    let [Some(pattern)] = <[Option<Pattern>; 1]>::try_from(patterns).ok()? else { return None };
    check_limits(t, &pattern, range)?;
    depth::check(t, &pattern, &measurement)?;
    check_least_range(t, &pattern, range)?;
    warn_of_ambiguity(t, &pattern, range);
    check_rows(t, pattern.rows());
    let sensor = Sensor { pattern, range, ring, measurement };
    if let Some(problem) = Capture::at_origin(&sensor).problem_of_numbers() {
        let key = given.first().map_or(t.span, |(key, _)| t.span_of(*key));
        report.error(key, problem.to_string(), "a number here is too large or too small", None);
        return None;
    }
    Some(sensor)
}

/// Warns of a sensor that sees farther than light goes and comes back from one pulse to the beam's next.
fn warn_of_ambiguity(t: &Table<'_>, pattern: &Pattern, range: RangeLimits) {
    const SPEED_OF_LIGHT_M_S: f64 = 299_792_458.0;
    let period_s = match pattern {
        Pattern::Rotating(p) => p.column_s(),
        Pattern::Mirror(_) | Pattern::Risley(_) if pattern.columns() > 1 => {
            pattern.last_pulse_s() / (pattern.columns() - 1) as f64
        }
        _ => return,
    };
    let unambiguous = SPEED_OF_LIGHT_M_S * period_s / 2.0;
    if period_s > 0.0 && range.max_m.is_finite() && range.max_m > unambiguous {
        let message = format!(
            "the sensor sees {} m far, and a beam pulses every {:.3} µs: the unambiguous range is {unambiguous:.1} m",
            number(range.max_m),
            period_s * 1e6
        );
        let label = "farther than light comes back from in time";
        let doubt = Doubt::new("ambiguous-range", keys::RANGE.name(), message).label(label);
        t.report().doubt(t.span_of(&keys::RANGE), doubt);
    }
}

/// Refuses limits of depth where there is none: only a camera has an optical axis.
fn check_limits(t: &Table<'_>, pattern: &Pattern, range: RangeLimits) -> Option<()> {
    if range.of == Limited::Range || pattern.is_camera() {
        return Some(());
    }
    let (message, help) = match pattern.name() {
        "raster" if t.has(&keys::EQUIRECTANGULAR) => (
            "a spherical image has no depth that could be limited: it has no one optical axis".to_owned(),
            "leave `of` out: the limits apply to the range along the ray",
        ),
        name => (
            format!("`[{name}]` has no depth that could be limited: a LiDAR measures along its beams"),
            "leave `of` out: the limits apply to the range along the beam; \"depth\" is for cameras: `[pinhole]`, `[fisheye]` and `[orthographic]`",
        ),
    };
    let span = t.read(&keys::RANGE).map_or(t.span, |range| range.value.span_of(&range::OF));
    t.report().error(span, message, "expected \"range\"", Some(help.into()));
    None
}

/// A sensor reports no range that ends before its beam's origin, so none can be asked of it.
fn check_least_range(t: &Table<'_>, pattern: &Pattern, range: RangeLimits) -> Option<()> {
    let Pattern::Rotating(rotating) = pattern else { return Some(()) };
    let least = rotating.least_range_m();
    if least == 0.0 || range.min_m >= least {
        return Some(());
    }
    let span = if t.has(&keys::RANGE) { t.span_of(&keys::RANGE) } else { t.span_of(&keys::ROTATING) };
    let min_m = range.min_m;
    let (message, label) = match rotating.ranging() {
        Ranging::Along(_) => (
            format!("the least range is {min_m} m, and ranges begin {least} m before the beam"),
            "expected a `min_m` of at least `range_offset_m`".to_owned(),
        ),
        Ranging::FromOrigin => (
            format!("the least range is {min_m} m, and a beam leaves {least:.6} m from the sensor's origin"),
            "expected a `min_m` of at least that".to_owned(),
        ),
    };
    t.report().error(span, message, label, None);
    None
}

/// Where the largest range of a sensor's table is written, or the table if there is none.
pub(super) fn max_at(sensor: &Table<'_>) -> Span {
    sensor.read(&keys::RANGE).map_or(sensor.span, |range| range.value.span_of(&range::MAX))
}

/// The limits of range of a sensor's table.
pub(super) fn range(sensor: &Table<'_>) -> RangeLimits {
    let mut limits = RangeLimits::default();
    let Some(t) = sensor.read(&keys::RANGE).map(|range| range.value) else { return limits };
    let (min, max) = (t.read_or_default(&range::MIN), t.read(&range::MAX));
    if let Some(min) = min {
        limits.min_m = min.value;
        if let Some(doubt) = plausibility::least_range(range::MIN.name(), min.value) {
            t.report().doubt(min.span, doubt);
        }
    }
    if let Some(max) = max {
        limits.max_m = max.value;
    }
    // Data sheets of depth cameras state their limits of Z. A fisheye may see where there is no depth.
    let usual = if sensor.has(&keys::PINHOLE) { Limited::Depth } else { Limited::Range };
    limits.of = t.read(&range::OF).map_or(usual, |of| of.value);
    if let (Some(min), Some(max)) = (min, max)
        && min.value >= max.value
    {
        let message = format!("nothing lies between `min_m` = {} and `max_m` = {}", min.value, max.value);
        let span = t.report().later(max.span, t.span_of(&range::MIN));
        t.report().error(span, message, "`max_m` must be greater than `min_m`", None);
    }
    limits
}
