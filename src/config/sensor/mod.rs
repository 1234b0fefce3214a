//! A sensor file's tables → [`Sensor`].

mod camera;
mod rotating;
mod scanner;

use super::rays::RayFiles;
use super::section::{self, Section, Shape};
use crate::sensor::{Pattern, RangeLimits, RingOrder, Sensor};
use crate::source::{Report, Span, Spanned};

/// Most rows and most columns of a range image.
const MAX_SIDE: u64 = 1_000_000;

/// Most rays of a frame: pixels have 32-bit numbers.
const MAX_RAYS: u64 = 1 << 32;

/// What reads a pattern's table.
type Read = fn(&Report, &Section<'_>, &RayFiles) -> Option<Pattern>;

/// The tables that a sensor may have one of.
const PATTERNS: &[(&str, &Shape, Read)] = &[
    ("rotating", &section::ROTATING, |r, s, _| rotating::pattern(r, s).map(Pattern::Rotating)),
    ("raster", &section::RASTER, |r, s, _| scanner::raster(r, s).map(Pattern::Raster)),
    ("mirror", &section::MIRROR, |r, s, _| scanner::mirror(r, s).map(Pattern::Mirror)),
    ("risley", &section::RISLEY, |r, s, _| scanner::risley(r, s).map(Pattern::Risley)),
    ("rays", &section::RAYS, |r, s, files| scanner::rays(r, s, files).map(Pattern::Rays)),
    ("pinhole", &section::PINHOLE, |r, s, _| camera::pinhole(r, s).map(Pattern::Camera)),
    ("fisheye", &section::FISHEYE, |r, s, _| camera::fisheye(r, s).map(Pattern::Camera)),
    ("equirectangular", &section::EQUIRECTANGULAR, |r, s, _| {
        camera::equirectangular(r, s).map(Pattern::Raster)
    }),
];

/// The names of the tables that a sensor may have one of.
pub(super) fn pattern_names() -> impl Iterator<Item = &'static str> {
    PATTERNS.iter().map(|(name, ..)| *name)
}

/// The sensor of a table with a pattern, `range` and `ring`. `None` if the report has errors about it. `is_pattern_lost`
/// says that there would be a pattern, had its file not been reported as unreadable.
pub(super) fn sensor(
    report: &Report,
    table: &Section<'_>,
    files: &RayFiles,
    is_pattern_lost: bool,
) -> Option<Sensor> {
    let range = range(report, table);
    let ring = table.choice(
        "ring",
        &[("row", RingOrder::Row), ("bottom_up", RingOrder::BottomUp), ("file", RingOrder::File)],
    );
    let given: Vec<_> = PATTERNS.iter().filter(|(name, ..)| table.get(name).is_some()).collect();
    let sections: Vec<_> = given.iter().map(|(name, shape, _)| table.section(name, shape)).collect();
    if let [(a, ..), (b, ..), ..] = given.as_slice() {
        let [first, second] = [a, b].map(|key| table.get(key).map_or(table.span, |node| node.span));
        report.error(
            report.later(first, second),
            format!("a sensor has one pattern, and this has both `[{a}]` and `[{b}]`"),
            "one too many",
            Some("keep one of the two; a second sensor is a `[[sensor]]` of its own".into()),
        );
    }
    if given.is_empty() && !is_pattern_lost {
        let help = "add `[rotating]`, `[pinhole]` or another pattern or, in a job, a `preset` that has one";
        report.error(table.span, "the sensor has no pattern", "needs one", Some(help.into()));
    }
    let patterns: Vec<_> = given
        .iter()
        .zip(&sections)
        .map(|((_, _, read), section)| section.as_ref().and_then(|s| read(report, s, files)))
        .collect();
    let [Some(pattern)] = <[Option<Pattern>; 1]>::try_from(patterns).ok()? else { return None };
    check_range_offset(report, table, &pattern, range)?;
    warn_of_ambiguity(report, table, &pattern, range);
    Some(Sensor { pattern, range, ring: ring.unwrap_or_default() })
}

/// Warns of a sensor that sees farther than light goes and comes back from one pulse to the beam's next.
fn warn_of_ambiguity(report: &Report, table: &Section<'_>, pattern: &Pattern, range: RangeLimits) {
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
        let span = table.get("range").map_or(table.span, |node| node.span);
        let message = format!(
            "the sensor sees {} m far, and a beam pulses every {:.3} µs: the unambiguous range is {unambiguous:.1} m",
            range.max_m,
            period_s * 1e6
        );
        report.warning(span, message, "farther than light comes back from in time", None);
    }
}

/// A range that begins before the beam's origin must not end there: the beam is not cast inside the sensor.
fn check_range_offset(
    report: &Report,
    table: &Section<'_>,
    pattern: &Pattern,
    range: RangeLimits,
) -> Option<()> {
    let Pattern::Rotating(rotating) = pattern else { return Some(()) };
    let offset = rotating.range_offset_m();
    if offset == 0.0 || range.min_m >= offset {
        return Some(());
    }
    let span = table.get("range").or(table.get("rotating")).map_or(table.span, |node| node.span);
    let message =
        format!("the least range is {} m, and ranges begin {offset} m before the beam", range.min_m);
    let label = "expected a `min_m` of at least `range_offset_m`";
    report.error(span, message, label, None);
    None
}

fn range(report: &Report, table: &Section<'_>) -> RangeLimits {
    let mut limits = RangeLimits::default();
    let Some(s) = table.section("range", &section::RANGE) else {
        return limits;
    };
    let min = s.number("min_m");
    let max = s.positive("max_m", true);
    if let Some(min) = min {
        limits.min_m = min.value;
        if min.value < 0.0 {
            let message = format!("`min_m` is {}", min.value);
            report.error(min.span, message, "expected metres, 0 or more", None);
        }
    }
    if let Some(max) = max {
        limits.max_m = max.value;
    }
    if let (Some(min), Some(max)) = (min, max)
        && min.value >= max.value
    {
        let message = format!("nothing lies between `min_m` = {} and `max_m` = {}", min.value, max.value);
        report.error(report.later(max.span, min.span), message, "`max_m` must be greater than `min_m`", None);
    }
    limits
}

/// `count` angles in degrees, evenly spaced from `from` to `to`, both included, or a list; each where it was written.
fn angles(report: &Report, s: &Section<'_>, key: &'static str) -> Option<Spanned<Vec<Spanned<f64>>>> {
    let list = match &s.get(key)?.value {
        super::tree::Value::Table(_) => spaced(report, &s.section(key, &section::SPACED)?)?,
        _ => s.numbers(key)?,
    };
    if list.value.is_empty() {
        let label =
            if key == "elevations_deg" { "expected at least one beam" } else { "expected at least one" };
        report.error(list.span, format!("`{key}` is an empty list"), label, None);
        return None;
    }
    if list.value.len() as u64 > MAX_SIDE {
        let message = format!("`{key}` lists {} angles", list.value.len());
        report.error(list.span, message, format!("expected at most {MAX_SIDE}"), None);
        return None;
    }
    Some(list)
}

fn spaced(report: &Report, s: &Section<'_>) -> Option<Spanned<Vec<Spanned<f64>>>> {
    s.need("from", "`from = 15.0`, the first angle in degrees");
    s.need("to", "`to = -15.0`, the last angle in degrees");
    s.need("count", "`count = 16`, the number of angles");
    let (from, to, count) = (s.number("from"), s.number("to"), s.integer("count", 1, MAX_SIDE));
    let (from, to, count) = (from?, to?, count?);
    if count.value == 1 && from.value != to.value {
        let message = format!("one beam can't reach from {} to {} degrees", from.value, to.value);
        report.error(count.span, message, "expected 2 or more, or `from` the same as `to`", None);
        return None;
    }
    let steps = (count.value - 1).max(1) as f64;
    let span = |i| if i == 0 { from.span } else { to.span };
    let value = (0..count.value)
        .map(|i| Spanned { value: from.value + (to.value - from.value) * i as f64 / steps, span: span(i) })
        .collect();
    Some(Spanned { value, span: s.span })
}

/// The elevations in degrees, from a list or from `{ from, to, count }`.
fn elevations(report: &Report, s: &Section<'_>) -> Option<Spanned<Vec<Spanned<f64>>>> {
    let list = angles(report, s, "elevations_deg")?;
    let mut told = Vec::new();
    for steep in list.value.iter().filter(|e| e.value.abs() > 90.0) {
        // Of a range of angles, every one between is at the same place as its end.
        if !told.contains(&steep.span) {
            told.push(steep.span);
            let message = format!("no beam has an elevation of {} degrees", steep.value);
            report.error(steep.span, message, "expected -90 (straight down) to 90 (straight up)", None);
        }
    }
    told.is_empty().then_some(list)
}

/// Refuses more rays than pixels can be numbered; `span` is the columns'.
fn check_rays(report: &Report, rows: u64, columns: u64, span: Span) -> Option<()> {
    if rows.checked_mul(columns).is_some_and(|rays| rays <= MAX_RAYS) {
        return Some(());
    }
    let message = format!("{rows} rows of {columns} columns are more than {MAX_RAYS} rays a frame");
    report.error(span, message, "expected fewer", None);
    None
}
