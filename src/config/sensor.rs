//! A sensor file's tables → [`Sensor`].

use super::section::{self, At, Section, count};
use super::text::{Place, Report};
use super::tree::Value;
use crate::angle::Angle;
use crate::sensor::{
    Beam, Pattern, Pinhole, PinholeError, RangeLimits, RingOrder, Rotating, RotatingError, Sensor,
};

/// Most rows and most columns of a range image.
const MAX_SIDE: u64 = 1_000_000;

/// Most rays of a frame: pixels have 32-bit numbers.
const MAX_RAYS: u64 = 1 << 32;

/// The sensor of a table with `rotating` or `pinhole`, `range` and `ring`. `None` if the report has errors about it.
/// `is_pattern_lost` says that there would be a pattern, had its file not been reported as unreadable.
pub(super) fn sensor(report: &Report, table: &Section<'_>, is_pattern_lost: bool) -> Option<Sensor> {
    let range = range(report, table);
    let ring = table.choice(
        "ring",
        &[("row", RingOrder::Row), ("bottom_up", RingOrder::BottomUp), ("file", RingOrder::File)],
    );
    let rotating = table.section("rotating", &section::ROTATING);
    let pinhole = table.section("pinhole", &section::PINHOLE);
    if let (Some(a), Some(b)) = (&rotating, &pinhole) {
        report.error(
            report.later(a.place, b.place),
            "a sensor has one pattern, and this has both `[rotating]` and `[pinhole]`",
            "one too many",
            Some("keep one of the two; a second sensor is a `[[sensor]]` of its own".into()),
        );
    }
    if table.get("rotating").is_none() && table.get("pinhole").is_none() && !is_pattern_lost {
        let help = "add `[rotating]`, `[pinhole]` or, in a job, a `preset` that has one of them";
        report.error(table.place, "the sensor has no pattern", "needs one", Some(help.into()));
    }
    let rotating = rotating.map(|s| rotating_pattern(report, &s));
    let pinhole = pinhole.map(|s| pinhole_pattern(report, &s));
    let pattern = match (rotating, pinhole) {
        (Some(Some(p)), None) => Pattern::Rotating(p),
        (None, Some(Some(p))) => Pattern::Pinhole(p),
        _ => return None,
    };
    Some(Sensor { pattern, range, ring: ring.unwrap_or_default() })
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
            report.error(min.place, message, "expected metres, 0 or more", None);
        }
    }
    if let Some(max) = max {
        limits.max_m = max.value;
    }
    if let (Some(min), Some(max)) = (min, max)
        && min.value >= max.value
    {
        let message = format!("nothing lies between `min_m` = {} and `max_m` = {}", min.value, max.value);
        report.error(
            report.later(max.place, min.place),
            message,
            "`max_m` must be greater than `min_m`",
            None,
        );
    }
    limits
}

fn rotating_pattern(report: &Report, s: &Section<'_>) -> Option<Rotating> {
    s.need(
        "elevations_deg",
        "`elevations_deg = { from = 15.0, to = -15.0, count = 16 }`, or a list, one a beam",
    );
    s.need("columns", "`columns = 1800`, the firings in the sector");
    s.need("rate_hz", "`rate_hz = 10.0`, the turns a second");

    let elevations = elevations(report, s);
    let beams = elevations.as_ref().map(|e| e.value.len());
    let offsets = per_beam(report, s, "azimuth_offsets_deg", beams);
    let times = per_beam(report, s, "beam_times_us", beams);
    let columns = s.integer("columns", 1, MAX_SIDE);
    let sector = sector(report, s);
    let rate = s.positive("rate_hz", false);

    if let Some(offsets) = &offsets
        && let Some(far) = offsets.value.iter().find(|o| o.value.abs() > 360.0)
    {
        let message = format!("an azimuth offset of {} degrees is more than a turn", far.value);
        report.warning(far.place, message, "in degrees?", None);
    }
    if let Some(times) = &times
        && let Some(early) = times.value.iter().find(|t| t.value < 0.0)
    {
        let message = format!("`beam_times_us` has {}", early.value);
        let label = "expected microseconds after the column's own time, 0 or more";
        report.error(early.place, message, label, None);
    }
    if let (Some(beams), Some(columns)) = (beams, columns) {
        check_rays(report, beams as u64, columns.value, columns.place)?;
    }

    // All that can be said about single keys has been said; what follows needs them all.
    let (elevations, columns, sector, rate) = (elevations?, columns?, sector?, rate?);
    let at = |list: &Option<At<Vec<At<f64>>>>, beam: usize| {
        list.as_ref().and_then(|list| list.value.get(beam)).map_or(0.0, |at| at.value)
    };
    let list: Vec<Beam> = (0..elevations.value.len())
        .map(|index| Beam {
            elevation: Angle::deg(elevations.value[index].value),
            azimuth_offset: Angle::deg(at(&offsets, index)),
            time_s: at(&times, index) * 1e-6,
            file_index: index,
        })
        .collect();
    warn_of_twins(report, &elevations, &list);
    match Rotating::new(list, columns.value as usize, (sector.value.0, sector.value.1), rate.value) {
        Ok(pattern) => {
            if let Some(times) = &times {
                warn_of_late_beams(report, times, &pattern);
            }
            Some(pattern)
        }
        Err(error) => {
            let place = match error {
                RotatingError::NoColumns => columns.place,
                RotatingError::Sector => sector.place,
                RotatingError::Rate => rate.place,
                RotatingError::Beam(index) => elevations.value[index].place,
                _ => elevations.place,
            };
            report.error(place, error.to_string(), "", None);
            None
        }
    }
}

/// The elevations in degrees, each where it was written, from a list or from `{ from, to, count }`.
fn elevations(report: &Report, s: &Section<'_>) -> Option<At<Vec<At<f64>>>> {
    let key = "elevations_deg";
    let list = match &s.get(key)?.value {
        Value::Table(_) => spaced(report, &s.section(key, &section::ELEVATIONS)?)?,
        _ => s.numbers(key)?,
    };
    if list.value.is_empty() {
        report.error(list.place, format!("`{key}` is an empty list"), "expected at least one beam", None);
        return None;
    }
    if list.value.len() as u64 > MAX_SIDE {
        let message = format!("`{key}` lists {} beams", list.value.len());
        report.error(list.place, message, format!("expected at most {MAX_SIDE}"), None);
        return None;
    }
    let steep: Vec<_> = list.value.iter().filter(|e| !is_elevation(report, e)).collect();
    if !steep.is_empty() {
        return None;
    }
    // Eight beams and more within ±1.6 are a quarter turn each way in radians, and hardly a sensor in degrees.
    let (low, high) = list
        .value
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), e| (l.min(e.value), h.max(e.value)));
    if list.value.len() >= 8 && high - low > 0.1 && low.abs().max(high.abs()) <= 1.6 {
        let message = format!("all {} elevations lie between {low} and {high} degrees", list.value.len());
        let help = "if they are radians, multiply each by 57.2958";
        report.warning(list.place, message, "are these radians?", Some(help.into()));
    }
    Some(list)
}

fn is_elevation(report: &Report, at: &At<f64>) -> bool {
    let fine = at.value.abs() <= 90.0;
    if !fine {
        let message = format!("no beam has an elevation of {} degrees", at.value);
        report.error(at.place, message, "expected -90 (straight down) to 90 (straight up)", None);
    }
    fine
}

/// `count` elevations, evenly spaced from `from` to `to`, both included.
fn spaced(report: &Report, s: &Section<'_>) -> Option<At<Vec<At<f64>>>> {
    s.need("from", "`from = 15.0`, the first beam's elevation in degrees");
    s.need("to", "`to = -15.0`, the last beam's elevation in degrees");
    s.need("count", "`count = 16`, the number of beams");
    let (from, to, count) = (s.number("from"), s.number("to"), s.integer("count", 1, MAX_SIDE));
    let (from, to, count) = (from?, to?, count?);
    if !is_elevation(report, &from) | !is_elevation(report, &to) {
        return None;
    }
    if count.value == 1 && from.value != to.value {
        let message = format!("one beam can't reach from {} to {} degrees", from.value, to.value);
        report.error(count.place, message, "expected 2 or more, or `from` the same as `to`", None);
        return None;
    }
    let steps = (count.value - 1).max(1) as f64;
    let value = (0..count.value)
        .map(|i| At { value: from.value + (to.value - from.value) * i as f64 / steps, place: s.place })
        .collect();
    Some(At { value, place: s.place })
}

/// A list with one number a beam.
fn per_beam(
    report: &Report,
    s: &Section<'_>,
    key: &'static str,
    beams: Option<usize>,
) -> Option<At<Vec<At<f64>>>> {
    let list = s.numbers(key)?;
    let beams = beams?;
    if list.value.len() != beams {
        let message =
            format!("`{key}` has {} for {}", count(list.value.len(), "value"), count(beams, "elevation"));
        let elevations = s.get("elevations_deg").map_or(list.place, |e| e.place);
        if report.later(list.place, elevations) == list.place {
            report.error(list.place, message, format!("expected {beams}: one a beam"), None);
        } else {
            let help = format!("`{key}` stays as it was given before: give one that fits here too");
            report.error(elevations, message, count(beams, "elevation"), Some(help));
        }
        return None;
    }
    Some(list)
}

/// The azimuths of the sector's start and end; the default is a full turn, clockwise from behind.
fn sector(report: &Report, s: &Section<'_>) -> Option<At<(Angle, Angle)>> {
    if s.get("sector_deg").is_none() {
        return Some(At { value: (Angle::deg(180.0), Angle::deg(-180.0)), place: s.place });
    }
    let s = s.section("sector_deg", &section::SECTOR)?;
    s.need("from", "`from = 180.0`, the azimuth of the first column in degrees");
    s.need("to", "`to = -180.0`, the azimuth where the sector ends in degrees");
    let (from, to) = (s.number("from"), s.number("to"));
    let (from, to) = (from?, to?);
    let turn = (to.value - from.value).abs();
    if !(turn > 0.0 && turn <= 360.0) {
        let message = format!("the sector from {} to {} turns by {turn} degrees", from.value, to.value);
        let label = "expected a turn of more than 0 and at most 360 degrees";
        report.error(report.later(to.place, from.place), message, label, None);
        return None;
    }
    Some(At { value: (Angle::deg(from.value), Angle::deg(to.value)), place: s.place })
}

fn warn_of_twins(report: &Report, elevations: &At<Vec<At<f64>>>, beams: &[Beam]) {
    let mut order: Vec<usize> = (0..beams.len()).collect();
    let key = |i: usize| (beams[i].elevation.radians(), beams[i].azimuth_offset.radians());
    order.sort_by(|&a, &b| {
        let ((ea, oa), (eb, ob)) = (key(a), key(b));
        ea.total_cmp(&eb).then(oa.total_cmp(&ob))
    });
    let twins: Vec<&[usize]> = order.windows(2).filter(|pair| key(pair[0]) == key(pair[1])).collect();
    if let Some(first) = twins.iter().min_by_key(|pair| pair[1]) {
        let message = format!("beams {} and {} (counted from 0) point the same way", first[0], first[1]);
        let label = match twins.len() {
            1 => String::new(),
            n => format!("and {} more such pairs", n - 1),
        };
        report.warning(elevations.value[first[1]].place, message, label, None);
    }
}

fn warn_of_late_beams(report: &Report, times: &At<Vec<At<f64>>>, pattern: &Rotating) {
    let period_us = pattern.azimuth_step().radians().abs() / std::f64::consts::TAU / pattern.rate_hz() * 1e6;
    let late = times.value.iter().find(|t| t.value > period_us);
    if let Some(late) = late.filter(|_| period_us > 0.0) {
        let message = format!(
            "a beam fires {} µs after its column, the next column after {period_us:.3} µs",
            late.value
        );
        let help = "beam times are microseconds from the column's own time, not from the frame's start";
        report.warning(late.place, message, "later than the next column", Some(help.into()));
    }
}

fn pinhole_pattern(report: &Report, s: &Section<'_>) -> Option<Pinhole> {
    s.need("width_px", "`width_px = 640`");
    s.need("height_px", "`height_px = 480`");
    let width = s.integer("width_px", 1, MAX_SIDE);
    let height = s.integer("height_px", 1, MAX_SIDE);
    let rate = s.positive("rate_hz", false);
    let hfov = s.number("hfov_deg");
    let fx = s.positive("fx_px", false);
    let fy = s.positive("fy_px", false);
    let (cx, cy) = (s.number("cx_px"), s.number("cy_px"));

    let intrinsic = ["fx_px", "fy_px", "cx_px", "cy_px"].into_iter().find(|key| s.get(key).is_some());
    match (s.get("hfov_deg"), intrinsic) {
        (Some(hfov), Some(key)) => {
            let place = s.get(key).map_or(hfov.place, |node| report.later(hfov.place, node.place));
            let message = format!("`[pinhole]` has both `hfov_deg` and `{key}`");
            let help = "give the field of view or the intrinsics: each follows from the other";
            report.error(place, message, "one too many", Some(help.into()));
            return None;
        }
        (None, Some(_)) => s.need("fx_px", "`fx_px`, the horizontal focal length in pixels"),
        (None, None) => {
            s.need(
                "hfov_deg",
                "`hfov_deg = 87.0`, the horizontal field of view, or the intrinsics from `fx_px` on",
            );
        }
        (Some(_), None) => {}
    }
    let (width, height) = (width?, height?);
    check_rays(report, height.value, width.value, width.place)?;
    let size = (width.value as usize, height.value as usize);
    // A rate that is there and wrong has been reported; the camera is made without, for what else there is to say.
    let rate_hz = rate.map(|r| r.value);
    let made = match hfov {
        Some(hfov) => Pinhole::from_hfov(size, Angle::deg(hfov.value), rate_hz),
        None => {
            let (fx, whole) = (fx?, (width.value as f64, height.value as f64));
            let or = |given: Option<At<f64>>, default: f64| given.map_or(default, |at| at.value);
            let centre = (or(cx, whole.0 / 2.0), or(cy, whole.1 / 2.0));
            Pinhole::new(size, (fx.value, or(fy, fx.value)), centre, rate_hz)
        }
    };
    made.map_err(|error| {
        let of = |at: Option<At<f64>>| at.map(|at| at.place);
        let place = match error {
            PinholeError::NoPixels => Some(width.place),
            PinholeError::FieldOfView => of(hfov),
            PinholeError::FocalLength => of(fx).or(of(hfov)),
            PinholeError::PrincipalPoint => of(cx).or(of(cy)),
            PinholeError::Rate => of(rate),
        };
        let label = match (error, hfov) {
            (PinholeError::FieldOfView, Some(hfov)) => format!("{} degrees", hfov.value),
            _ => String::new(),
        };
        report.error(place.unwrap_or(s.place), error.to_string(), label, None);
    })
    .ok()
}

/// Refuses more rays than pixels can be numbered; `place` is the columns'.
fn check_rays(report: &Report, rows: u64, columns: u64, place: Place) -> Option<()> {
    if rows.checked_mul(columns).is_some_and(|rays| rays <= MAX_RAYS) {
        return Some(());
    }
    let message = format!("{rows} rows of {columns} columns are more than {MAX_RAYS} rays a frame");
    report.error(place, message, "expected fewer", None);
    None
}
