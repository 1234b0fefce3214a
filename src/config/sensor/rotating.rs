//! `[rotating]`.

use glam::DVec3;

use super::super::section::{self, Section, count};
use super::super::tree::Value;
use super::{MAX_SIDE, check_rays, elevations};
use crate::angle::Angle;
use crate::sensor::{Beam, Rotating, RotatingError};
use crate::source::{Report, Span, Spanned};

pub(super) fn pattern(report: &Report, s: &Section<'_>) -> Option<Rotating> {
    s.need(
        "elevations_deg",
        "`elevations_deg = { from = 15.0, to = -15.0, count = 16 }`, or a list, one a beam",
    );
    s.need("columns", "`columns = 1800`, the firings in the sector");
    s.need("rate_hz", "`rate_hz = 10.0`, the turns a second");

    let elevations = elevations(report, s);
    if let Some(elevations) = &elevations {
        warn_of_radians(report, elevations);
    }
    let beams = elevations.as_ref().map(|e| e.value.len());
    let offsets = per_beam(report, s, "azimuth_offsets_deg", beams);
    let times = per_beam(report, s, "beam_times_us", beams);
    let origins = origins(report, s, beams);
    let range_offset = s.number("range_offset_m");
    let turns = s.boolean("turns_while_firing").unwrap_or(false);
    let layout = s.choice("layout", &[("staggered", false), ("destaggered", true)]).unwrap_or(false);
    let columns = s.integer("columns", 1, MAX_SIDE);
    let shifts = shifts(report, s, beams, columns, layout);
    let sector = sector(report, s);
    let rate = s.positive("rate_hz", false);

    if let Some(offsets) = &offsets
        && let Some(far) = offsets.value.iter().find(|o| o.value.abs() > 360.0)
    {
        let message = format!("an azimuth offset of {} degrees is more than a turn", far.value);
        report.warning(far.span, message, "in degrees?", None);
    }
    if let Some(times) = &times
        && let Some(early) = times.value.iter().find(|t| t.value < 0.0)
    {
        let message = format!("`beam_times_us` has {}", early.value);
        let label = "expected microseconds after the column's own time, 0 or more";
        report.error(early.span, message, label, None);
    }
    if let (Some(beams), Some(columns)) = (beams, columns) {
        check_rays(report, beams as u64, columns.value, columns.span)?;
    }

    // All that can be said about single keys has been said; what follows needs them all.
    let (elevations, columns, sector, rate) = (elevations?, columns?, sector?, rate?);
    let (origins, shifts) = (origins?, shifts?);
    let at = |list: &Option<Spanned<Vec<Spanned<f64>>>>, beam: usize| {
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
    let made = Rotating::new(list, columns.value as usize, (sector.value.0, sector.value.1), rate.value)
        .and_then(|pattern| if origins.is_empty() { Ok(pattern) } else { pattern.with_origins(&origins) })
        .and_then(|pattern| pattern.with_range_offset(range_offset.map_or(0.0, |at| at.value)))
        .map(|pattern| if turns { pattern.turning_while_firing() } else { pattern })
        .and_then(|pattern| match (layout, shifts.is_empty()) {
            (false, _) => Ok(pattern),
            (true, true) => pattern.destaggered(),
            (true, false) => pattern.with_shifts(&shifts),
        });
    match made {
        Ok(pattern) => {
            if let Some(times) = &times {
                warn_of_late_beams(report, times, &pattern);
            }
            warn_of_aliases(report, &elevations, &pattern);
            Some(pattern)
        }
        Err(error) => {
            let of = |key| s.get(key).map_or(s.span, |node| node.span);
            let span = match error {
                RotatingError::NoColumns => columns.span,
                RotatingError::Sector => sector.span,
                RotatingError::Rate => rate.span,
                RotatingError::Beam(index) => elevations.value[index].span,
                RotatingError::NotFullTurn => of("layout"),
                RotatingError::RangeOffset => of("range_offset_m"),
                _ => elevations.span,
            };
            report.error(span, error.to_string(), "", None);
            None
        }
    }
}

/// Eight beams and more within ±1.6 are a quarter turn each way in radians, and hardly a sensor in degrees.
fn warn_of_radians(report: &Report, list: &Spanned<Vec<Spanned<f64>>>) {
    let (low, high) = list
        .value
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), e| (l.min(e.value), h.max(e.value)));
    if list.value.len() >= 8 && high - low > 0.1 && low.abs().max(high.abs()) <= 1.6 {
        let message = format!("all {} elevations lie between {low} and {high} degrees", list.value.len());
        let help = "if they are radians, multiply each by 57.2958";
        report.warning(list.span, message, "are these radians?", Some(help.into()));
    }
}

/// Where the beams leave the head: `[x, y, z]` for all of them, or a list of such, one a beam. Empty if it's left out.
fn origins(report: &Report, s: &Section<'_>, beams: Option<usize>) -> Option<Vec<DVec3>> {
    let (key, names) = ("beam_origins_m", "x, y, z in the head's frame");
    let Some(node) = s.get(key) else { return Some(Vec::new()) };
    let is_one = matches!(&node.value, Value::Array(list)
        if list.first().is_some_and(|first| !matches!(first.value, Value::Array(_))));
    if is_one {
        let one = s.vector::<3>(key, names)?;
        return Some(vec![DVec3::from_array(one.value); beams?]);
    }
    let list = s.vectors::<3>(key, names)?;
    check_count(report, s, key, (list.value.len(), list.span), beams?)?;
    Some(list.value.iter().map(|at| DVec3::from_array(at.value)).collect())
}

/// By how many columns each row of the image is moved, one a beam. Empty if it's left out.
fn shifts(
    report: &Report,
    s: &Section<'_>,
    beams: Option<usize>,
    columns: Option<Spanned<u64>>,
    is_destaggered: bool,
) -> Option<Vec<usize>> {
    let key = "pixel_shift_by_row";
    if s.get(key).is_none() {
        return Some(Vec::new());
    }
    let list = s.numbers(key)?;
    check_count(report, s, key, (list.value.len(), list.span), beams?)?;
    let most = columns?.value as f64;
    let is_shift = |x: f64| x.fract() == 0.0 && x.abs() <= most;
    if let Some(bad) = list.value.iter().find(|at| !is_shift(at.value)) {
        let message = format!("`{key}` has {}", bad.value);
        report.error(bad.span, message, format!("expected a whole number of columns, at most {most}"), None);
        return None;
    }
    if !is_destaggered {
        let help = "`layout = \"destaggered\"` moves them";
        report.warning(list.span, format!("`{key}` moves nothing"), "rows stay as fired", Some(help.into()));
    }
    Some(list.value.iter().map(|at| at.value.rem_euclid(most) as usize).collect())
}

/// A list with one number a beam.
fn per_beam(
    report: &Report,
    s: &Section<'_>,
    key: &'static str,
    beams: Option<usize>,
) -> Option<Spanned<Vec<Spanned<f64>>>> {
    let list = s.numbers(key)?;
    check_count(report, s, key, (list.value.len(), list.span), beams?)?;
    Some(list)
}

/// Refuses a list that doesn't have one value a beam.
fn check_count(
    report: &Report,
    s: &Section<'_>,
    key: &str,
    (values, span): (usize, Span),
    beams: usize,
) -> Option<()> {
    if values == beams {
        return Some(());
    }
    let message = format!("`{key}` has {} for {}", count(values, "value"), count(beams, "elevation"));
    let elevations = s.get("elevations_deg").map_or(span, |e| e.span);
    if report.later(span, elevations) == span {
        report.error(span, message, format!("expected {beams}: one a beam"), None);
    } else {
        let help = format!("`{key}` stays as it was given before: give one that fits here too");
        report.error(elevations, message, count(beams, "elevation"), Some(help));
    }
    None
}

/// The azimuths of the sector's start and end; the default is a full turn, clockwise from behind.
fn sector(report: &Report, s: &Section<'_>) -> Option<Spanned<(Angle, Angle)>> {
    if s.get("sector_deg").is_none() {
        return Some(Spanned { value: (Angle::deg(180.0), Angle::deg(-180.0)), span: s.span });
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
        report.error(report.later(to.span, from.span), message, label, None);
        return None;
    }
    Some(Spanned { value: (Angle::deg(from.value), Angle::deg(to.value)), span: s.span })
}

fn warn_of_twins(report: &Report, elevations: &Spanned<Vec<Spanned<f64>>>, beams: &[Beam]) {
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
        report.warning(elevations.value[first[1]].span, message, label, None);
    }
}

/// Warns of beams of one elevation whose azimuths are a whole number of columns apart: round a full turn they see the same
/// points, one after the other.
fn warn_of_aliases(report: &Report, elevations: &Spanned<Vec<Spanned<f64>>>, pattern: &Rotating) {
    if !pattern.is_full_turn() {
        return;
    }
    let step = pattern.azimuth_step().radians();
    let columns_apart = |a: &Beam, b: &Beam| (a.azimuth_offset - b.azimuth_offset).radians() / step;
    // Beams of the same elevation are neighbours: rows are sorted by it.
    let alias = pattern.beams().windows(2).find(|pair| {
        let apart = columns_apart(&pair[0], &pair[1]);
        let is_whole = apart.abs() > 0.5 && (apart - apart.round()).abs() < 1e-6;
        pair[0].elevation == pair[1].elevation && is_whole
    });
    if let Some([a, b]) = alias {
        let columns = columns_apart(a, b).round().abs();
        let message = format!(
            "beams {} and {} (counted from 0) have one elevation and azimuths {columns} columns apart",
            a.file_index, b.file_index
        );
        let help = "another number of columns, or offsets between the columns, would see other points";
        let span = elevations.value[b.file_index].span;
        report.warning(span, message, "round the turn they see the same points", Some(help.into()));
    }
}

fn warn_of_late_beams(report: &Report, times: &Spanned<Vec<Spanned<f64>>>, pattern: &Rotating) {
    let period_us = pattern.column_s() * 1e6;
    let late = times.value.iter().find(|t| t.value > period_us);
    if let Some(late) = late.filter(|_| period_us > 0.0) {
        let message = format!(
            "a beam fires {} µs after its column, the next column after {period_us:.3} µs",
            late.value
        );
        let help = "beam times are microseconds from the column's own time, not from the frame's start";
        report.warning(late.span, message, "later than the next column", Some(help.into()));
    }
}
