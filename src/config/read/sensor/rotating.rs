//! `[rotating]`.

use glam::DVec3;

use super::super::super::keys::sensor::rotating as keys;
use super::super::super::kinds::{List, Number, OneOrMany};
use super::super::super::plausibility;
use super::super::super::table::{AnyKey, Key, Table};
use super::limit::check_rays;
use crate::angle::Angle;
use crate::sensor::{Beam, Phase, Rotating, RotatingError};
use crate::source::words::counted;
use crate::source::{Doubt, Report, Span, Spanned};

/// Numbers, each with its span.
type Numbers = Spanned<Vec<Spanned<f64>>>;

pub(super) fn pattern(t: &Table<'_>) -> Option<Rotating> {
    let report = t.report();
    let elevations = t.read(&keys::ELEVATIONS);
    if let Some(elevations) = &elevations {
        warn_of_radians(report, elevations);
    }
    let beams = elevations.as_ref().map(|e| e.value.len());
    let offsets = per_beam(t, &keys::AZIMUTH_OFFSETS, beams);
    let times = per_beam(t, &keys::BEAM_TIMES, beams);
    let cycle = cycle(t, beams);
    let origins = origins(t, beams);
    let range_offset = t.value(&keys::RANGE_OFFSET);
    let is_from_origin = t.value(&keys::RANGE_FROM);
    if let Some(doubt) = plausibility::offset_in_head(keys::RANGE_OFFSET.name(), range_offset) {
        report.doubt(t.span_of(&keys::RANGE_OFFSET), doubt);
    }
    let turns = t.value(&keys::TURNS_WHILE_FIRING);
    let is_destaggered = t.value(&keys::LAYOUT);
    let columns = t.read(&keys::COLUMNS);
    let shifts = shifts(t, beams, columns, is_destaggered);
    let sector = sector(t);
    let rate = t.read(&keys::RATE);

    if let Some(offsets) = &offsets
        && let Some(far) = offsets.value.iter().find(|o| o.value.abs() > 360.0)
    {
        let message = format!("an azimuth offset of {} degrees is more than a turn", far.value);
        report.doubt(
            far.span,
            Doubt::new("azimuth-offset-unit", keys::AZIMUTH_OFFSETS.name(), message).label("in degrees?"),
        );
    }
    if let (Some(beams), Some(columns)) = (beams, columns) {
        check_rays(report, beams as u64, columns.value, columns.span)?;
    }

    if is_from_origin && range_offset != 0.0 {
        let message = "ranges count from the sensor's origin, or begin before the beam's, but not both";
        let help = "leave out `range_offset_m`, or `range_from`";
        report.error(t.span_of(&keys::RANGE_OFFSET), message, "one too many", Some(help.into()));
        return None;
    }

    // Up to here, each key is checked by itself. From here on, all of them are needed.
    let (elevations, columns, sector, rate) = (elevations?, columns?, sector?, rate?);
    let (cycle, origins, shifts) = (cycle?, origins?, shifts?);
    let at = |list: &Option<Numbers>, beam: usize| {
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
    let made = Rotating::new(list, columns.value as usize, sector.value, rate.value)
        .and_then(|pattern| if origins.is_empty() { Ok(pattern) } else { pattern.with_origins(&origins) })
        .and_then(|pattern| pattern.with_range_offset(range_offset))
        .map(|pattern| if is_from_origin { pattern.with_ranges_from_origin() } else { pattern })
        .map(|pattern| if turns { pattern.turning_while_firing() } else { pattern })
        .and_then(|pattern| if cycle.is_empty() { Ok(pattern) } else { pattern.with_cycle(&cycle) })
        .and_then(|pattern| match (is_destaggered, shifts.is_empty()) {
            (false, _) => Ok(pattern),
            (true, true) => pattern.destaggered(),
            (true, false) => pattern.with_shifts(&shifts),
        });
    match made {
        Ok(pattern) => {
            if let Some(times) = &times {
                warn_of_late_beams(report, times, &pattern);
            }
            for phase in t.read(&keys::CYCLE).into_iter().flat_map(|cycle| cycle.value) {
                if let Some(times) = phase.read(&keys::PHASE_TIMES) {
                    warn_of_late_beams(report, &times, &pattern);
                }
            }
            warn_of_aliases(report, &elevations, &pattern);
            Some(pattern)
        }
        Err(error) => {
            let span = match error {
                RotatingError::NoColumns => columns.span,
                RotatingError::Sector => sector.span,
                RotatingError::Rate => rate.span,
                RotatingError::Beam(index) => elevations.value[index].span,
                RotatingError::NotFullTurn => t.span_of(&keys::LAYOUT),
                RotatingError::RangeOffset => t.span_of(&keys::RANGE_OFFSET),
                _ => elevations.span,
            };
            report.error(span, error.to_string(), "", None);
            None
        }
    }
}

/// Eight beams and more within ±1.6 are a quarter turn each way in radians, and hardly a sensor in degrees.
fn warn_of_radians(report: &Report, list: &Numbers) {
    let (low, high) = list
        .value
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), e| (l.min(e.value), h.max(e.value)));
    if list.value.len() >= 8 && high - low > 0.1 && low.abs().max(high.abs()) <= 1.6 {
        let message = format!("all {} elevations lie between {low} and {high} degrees", list.value.len());
        let help = "if they are radians, multiply each by 57.2958";
        let doubt = Doubt::new("elevations-in-radians", keys::ELEVATIONS.name(), message);
        report.doubt(list.span, doubt.label("are these radians?").help(help));
    }
}

/// The origins of the beams in the head's frame, one a beam. Empty if they are left out.
fn origins(t: &Table<'_>, beams: Option<usize>) -> Option<Vec<DVec3>> {
    if !t.has(&keys::BEAM_ORIGINS) {
        return Some(Vec::new());
    }
    let given = t.read(&keys::BEAM_ORIGINS)?;
    let all: Vec<[f64; 3]> = match &given.value {
        OneOrMany::One(origin) => vec![*origin],
        OneOrMany::Many(list) => list.iter().map(|origin| origin.value).collect(),
    };
    let all = all.into_iter().map(DVec3::from_array);
    if let Some(doubt) = plausibility::beam_origins(keys::BEAM_ORIGINS.name(), all) {
        t.report().doubt(given.span, doubt);
    }
    match given.value {
        OneOrMany::One(origin) => Some(vec![DVec3::from_array(origin); beams?]),
        OneOrMany::Many(list) => {
            check_count(t, &keys::BEAM_ORIGINS, (list.len(), given.span), beams?)?;
            Some(list.iter().map(|origin| DVec3::from_array(origin.value)).collect())
        }
    }
}

/// The columns of the cycle. Empty if it is left out.
fn cycle(t: &Table<'_>, beams: Option<usize>) -> Option<Vec<Phase>> {
    if !t.has(&keys::CYCLE) {
        return Some(Vec::new());
    }
    let columns = t.read(&keys::CYCLE)?;
    let phases: Vec<Option<Phase>> = columns.value.iter().map(|column| phase(column, beams)).collect();
    phases.into_iter().collect()
}

/// A column of the cycle.
fn phase(t: &Table<'_>, beams: Option<usize>) -> Option<Phase> {
    let times_s = if t.has(&keys::PHASE_TIMES) {
        let times = t.read(&keys::PHASE_TIMES)?;
        let (beams, found) = (beams?, times.value.len());
        if found != beams {
            let message = format!(
                "`beam_times_us` has {} for {}",
                counted(found, "value"),
                counted(beams, "elevation")
            );
            t.report().error(times.span, message, format!("expected {beams}: one a beam"), None);
            return None;
        }
        Some(times.value.iter().map(|time| time.value * 1e-6).collect())
    } else {
        None
    };
    let mut silent = Vec::new();
    if t.has(&keys::SILENT_BEAMS) {
        let (list, beams) = (t.read(&keys::SILENT_BEAMS)?, beams?);
        if let Some(bad) = list.value.iter().find(|beam| beam.value >= beams) {
            let message = format!("there is no beam {}: {} count from 0", bad.value, counted(beams, "beam"));
            t.report().error(bad.span, message, format!("expected at most {}", beams - 1), None);
            return None;
        }
        silent = list.value.iter().map(|beam| beam.value).collect();
    }
    Some(Phase { times_s, silent })
}

/// The number of columns that each row of the image is moved by, one a beam. Empty if they are left out.
fn shifts(
    t: &Table<'_>,
    beams: Option<usize>,
    columns: Option<Spanned<u64>>,
    is_destaggered: bool,
) -> Option<Vec<usize>> {
    let key = &keys::PIXEL_SHIFTS;
    if !t.has(key) {
        return Some(Vec::new());
    }
    let list = per_beam(t, key, beams)?;
    let most = columns?.value as f64;
    let is_shift = |x: f64| x.fract() == 0.0 && x.abs() <= most;
    if let Some(bad) = list.value.iter().find(|at| !is_shift(at.value)) {
        let message = format!("`{}` has {}", key.name(), bad.value);
        let label = format!("expected a whole number of columns, at most {most}");
        t.report().error(bad.span, message, label, None);
        return None;
    }
    // A file that says `staggered` keeps the numbers for a job that wants the other layout.
    if !is_destaggered && !t.has(&keys::LAYOUT) {
        let help = "`layout = \"destaggered\"` moves them";
        let message = format!("`{}` moves nothing", key.name());
        let doubt = Doubt::new("shifts-without-layout", keys::PIXEL_SHIFTS.name(), message);
        t.report().doubt(list.span, doubt.label("rows stay as fired").help(help));
    }
    Some(list.value.iter().map(|at| at.value.rem_euclid(most) as usize).collect())
}

/// A list with one number a beam.
fn per_beam(t: &Table<'_>, key: &Key<List<Number>>, beams: Option<usize>) -> Option<Numbers> {
    let list = t.read(key)?;
    check_count(t, key, (list.value.len(), list.span), beams?)?;
    Some(list)
}

/// Refuses a list that doesn't have one value a beam.
fn check_count(t: &Table<'_>, key: &dyn AnyKey, (values, span): (usize, Span), beams: usize) -> Option<()> {
    if values == beams {
        return Some(());
    }
    let name = key.name();
    let message = format!("`{name}` has {} for {}", counted(values, "value"), counted(beams, "elevation"));
    let elevations = t.span_of(&keys::ELEVATIONS);
    if t.report().later(span, elevations) == span {
        t.report().error(span, message, format!("expected {beams}: one a beam"), None);
    } else {
        let help = format!("`{name}` stays as it was given before: give one that fits here too");
        t.report().error(elevations, message, counted(beams, "elevation"), Some(help));
    }
    None
}

/// The azimuths of the sector's start and end.
fn sector(t: &Table<'_>) -> Option<Spanned<(Angle, Angle)>> {
    let Spanned { value: sector, span } = t.read_or_default(&keys::SECTOR)?;
    let (from, to) = (sector.read(&keys::FROM), sector.read(&keys::TO));
    let (from, to) = (from?, to?);
    if let Some(doubt) = plausibility::sector(keys::SECTOR.name(), (from.value, to.value)) {
        t.report().doubt(span, doubt);
    }
    let turn = (to.value - from.value).abs();
    if !(turn > 0.0 && turn <= 360.0) {
        let message = format!("the sector from {} to {} turns by {turn} degrees", from.value, to.value);
        let label = "expected a turn of more than 0 and at most 360 degrees";
        t.report().error(t.report().later(to.span, from.span), message, label, None);
        return None;
    }
    Some(Spanned { value: (Angle::deg(from.value), Angle::deg(to.value)), span })
}

fn warn_of_twins(report: &Report, elevations: &Numbers, beams: &[Beam]) {
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
        let doubt = Doubt::new("twin-beams", keys::ELEVATIONS.name(), message).label(label);
        report.doubt(elevations.value[first[1]].span, doubt);
    }
}

/// Warns of beams of one elevation whose azimuths are a whole number of columns apart: round a full turn they see the same
/// points, one after the other.
fn warn_of_aliases(report: &Report, elevations: &Numbers, pattern: &Rotating) {
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
        let doubt = Doubt::new("aliased-beams", keys::ELEVATIONS.name(), message);
        report.doubt(span, doubt.label("round the turn they see the same points").help(help));
    }
}

/// Warns of beams that fire in the time of another column. Times that are all early or all late by the same amount shift every
/// column alike, so that the beams' times from each other count.
fn warn_of_late_beams(report: &Report, times: &Numbers, pattern: &Rotating) {
    let period_us = pattern.column_s() * 1e6;
    let values = times.value.iter().map(|time| time.value);
    let (first, last) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(f, l), t| (f.min(t), l.max(t)));
    if period_us == 0.0 || last - first <= period_us {
        return;
    }
    let Some(far) = times.value.iter().find(|time| time.value.abs() == last.max(-first)) else { return };
    let (message, label) = if far.value > 0.0 {
        let late = far.value;
        (
            format!("a beam fires {late} µs after its column, the next column after {period_us:.3} µs"),
            "later than the next column",
        )
    } else {
        let early = -far.value;
        (
            format!("a beam fires {early} µs before its column, the column before by {period_us:.3} µs"),
            "earlier than the column before",
        )
    };
    let help = "beam times are microseconds from the column's own time, not from the frame's start";
    report.doubt(far.span, Doubt::new("late-beam", keys::BEAM_TIMES.name(), message).label(label).help(help));
}
