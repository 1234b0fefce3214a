//! `[raster]`, `[mirror]`, `[risley]` and `[rays]`.

use glam::DVec3;

use super::super::super::keys::sensor::{BEAMS, FRAME_RATE, NEEDED_FRAME_RATE, PULSE_RATE};
use super::super::super::keys::sensor::{mirror, raster, rays, risley};
use super::super::super::table::Table;
use super::super::sensor_files::SensorFiles;
use super::limit::check_rays;
use crate::angle::Angle;
use crate::sensor::{
    Axis, Mirror, MirrorError, Order, Prism, Raster, RayTable, RayTableError, Ripple, Risley, RisleyError,
    TurningMirror, direction,
};
use crate::source::{Doubt, Spanned};

pub(super) fn raster(t: &Table<'_>) -> Option<Raster> {
    let azimuths = t.read(&raster::AZIMUTHS);
    let elevations = t.read(&raster::ELEVATIONS);
    let order = t.value(&raster::ORDER);
    let (rate, pulse_rate) = (t.read(&FRAME_RATE), t.read(&raster::PULSE_RATE));
    if order != Order::Flash && !t.has(&raster::PULSE_RATE) {
        let example = "`rate_hz = 10.0`, the frames a second, or `pulse_rate_hz`, the pulses a second";
        t.need(&FRAME_RATE, example);
    }
    let (azimuths, elevations) = (azimuths?, elevations?);
    let (rows, columns) = (elevations.value.len(), azimuths.value.len());
    check_rays(t.report(), rows as u64, columns as u64, azimuths.span)?;
    let degrees =
        |list: &[Spanned<f64>]| list.iter().map(|angle| Angle::deg(angle.value)).collect::<Vec<_>>();
    let pulse_rate_hz = match (pulse_rate, rate) {
        (Some(pulses), _) => pulses.value,
        (None, Some(rate)) => rate.value * (rows * columns) as f64,
        (None, None) if order == Order::Flash => f64::INFINITY,
        (None, None) => return None, // reported above
    };
    let (azimuths, elevations) = (degrees(&azimuths.value), degrees(&elevations.value));
    Raster::new(&azimuths, &elevations, order, pulse_rate_hz, rate.map(|rate| rate.value))
        .map_err(|error| t.report().error(t.span, error.to_string(), "", None))
        .ok()
}

pub(super) fn mirror(t: &Table<'_>) -> Option<Mirror> {
    let axes = [&mirror::AZIMUTH, &mirror::ELEVATION].map(|key| axis(&t.read(key)?.value));
    let beams = beams(t);
    let (pulse_rate, rate) = (t.read(&PULSE_RATE), t.read(&NEEDED_FRAME_RATE));
    let ([azimuth, elevation], beams) = (axes, beams?);
    let (azimuth, elevation, pulse_rate, rate) = (azimuth?, elevation?, pulse_rate?, rate?);
    Mirror::new((azimuth, elevation), beams, pulse_rate.value, rate.value)
        .map_err(|error| {
            let span = match error {
                MirrorError::Rate => t.report().later(pulse_rate.span, rate.span),
                MirrorError::Beam(_) if t.has(&BEAMS) => t.span_of(&BEAMS),
                MirrorError::Beam(_) => t.span_of(&mirror::ELEVATION),
                _ => t.span,
            };
            t.report().error(span, error.to_string(), "", None);
        })
        .ok()
}

/// The motion of an angle of a mirror.
fn axis(t: &Table<'_>) -> Option<Axis> {
    let motion = t.read(&mirror::MOTION);
    let (rate, from, to) = (t.read(&mirror::RATE), t.read(&mirror::FROM), t.read(&mirror::TO));
    let phase = Angle::deg(t.value(&mirror::PHASE));
    Some(Axis {
        motion: motion?.value,
        rate_hz: rate?.value,
        from: Angle::deg(from?.value),
        to: Angle::deg(to?.value),
        phase,
    })
}

pub(super) fn risley(t: &Table<'_>) -> Option<Risley> {
    let prisms = t.read(&risley::PRISMS);
    let list: Option<Vec<Prism>> = prisms
        .as_ref()
        .and_then(|prisms| prisms.value.iter().map(prism).collect::<Vec<_>>().into_iter().collect());
    let beams = beams(t);
    let (pulse_rate, rate) = (t.read(&PULSE_RATE), t.read(&NEEDED_FRAME_RATE));
    let mirror = t.has(&risley::MIRROR).then(|| turning_mirror(&t.read(&risley::MIRROR)?.value));
    let (prisms, list, beams, pulse_rate, rate) = (prisms?, list?, beams?, pulse_rate?, rate?);
    let mirror = mirror.map_or(Some(None), |mirror| mirror.map(Some))?;
    let beams: Vec<DVec3> = beams.into_iter().map(|(az, el)| direction(az, el)).collect();
    Risley::new(list, &beams, pulse_rate.value, rate.value)
        .and_then(|pattern| match mirror {
            Some(mirror) => pattern.with_mirror(mirror),
            None => Ok(pattern),
        })
        .map_err(|error| {
            let span = match error {
                RisleyError::Prism(index) => prisms.value[index].span,
                RisleyError::NoPrisms => prisms.span,
                RisleyError::Rate => t.report().later(pulse_rate.span, rate.span),
                RisleyError::Mirror => t.span_of(&risley::MIRROR),
                _ => t.span_of(&BEAMS),
            };
            t.report().error(span, error.to_string(), "", None);
        })
        .ok()
}

fn prism(t: &Table<'_>) -> Option<Prism> {
    let (rate, wedge, index) = (t.read(&risley::RATE), t.read(&risley::WEDGE), t.read(&risley::INDEX));
    let phase = Angle::deg(t.value(&risley::PHASE));
    let tilted = t.read(&risley::TILTED).map(|tilted| tilted.value).unwrap_or_default();
    let ripple = match t.has(&risley::RIPPLE) {
        true => ripple(&t.read(&risley::RIPPLE)?.value)?,
        false => Ripple::default(),
    };
    let (rate, wedge, index) = (rate?.value, wedge?.value, index?.value);
    Some(Prism { rate_hz: rate, wedge: Angle::deg(wedge), index, phase, tilted, ripple })
}

fn ripple(t: &Table<'_>) -> Option<Ripple> {
    let (rate, amplitude) = (t.read(&risley::RIPPLE_RATE), t.read(&risley::AMPLITUDE));
    let phase = Angle::deg(t.value(&risley::RIPPLE_PHASE));
    Some(Ripple { rate_hz: rate?.value, amplitude: Angle::deg(amplitude?.value), phase })
}

fn turning_mirror(t: &Table<'_>) -> Option<TurningMirror> {
    let (rate, tilt) = (t.read(&risley::MIRROR_RATE), t.read(&risley::TILT));
    let index = t.value(&risley::MIRROR_INDEX);
    let phase = Angle::deg(t.value(&risley::MIRROR_PHASE));
    Some(TurningMirror { rate_hz: rate?.value, tilt: Angle::deg(tilt?.value), index, phase })
}

/// Azimuth and elevation of each beam; straight ahead if they are left out.
fn beams(t: &Table<'_>) -> Option<Vec<(Angle, Angle)>> {
    if !t.has(&BEAMS) {
        return Some(vec![Default::default()]);
    }
    let beams = t.read(&BEAMS)?;
    Some(beams.value.iter().map(|beam| (Angle::deg(beam.value[0]), Angle::deg(beam.value[1]))).collect())
}

pub(super) fn rays(t: &Table<'_>, files: &SensorFiles) -> Option<RayTable> {
    let (file, rate) = (t.read(&rays::FILE), t.read(&FRAME_RATE));
    let (lines, pulse_rate) = (t.read_or_default(&rays::LINES), t.read(&rays::PULSE_RATE));
    // The errors of the file were reported when it was read.
    let (table, counted) = files.rays.table(t.report(), file?)?;
    if let Some(span) = counted.filter(|_| !t.has(&rays::PULSE_RATE)) {
        let help = "`pulse_rate_hz`, the pulses of each beam a second, gives them times; without it all go out at once";
        let message = "this column counts the rays, and is no time";
        t.report().doubt(span, Doubt::new("counted-times", rays::FILE.name(), message).help(help));
    }
    let lines = lines?;
    if let Some(pulse_rate) = &pulse_rate {
        let frame = rate.as_ref().map_or(0.0, |rate| (pulse_rate.value / rate.value).round());
        check_rays(t.report(), lines.value, frame.min(1e12) as u64, pulse_rate.span)?;
    }
    let made = table
        .with_rate(rate.map(|rate| rate.value))
        .and_then(|table| table.with_lines(lines.value as usize))
        .and_then(|table| match &pulse_rate {
            Some(rate) => table.with_pulse_rate(rate.value),
            None => Ok(table),
        });
    made.map_err(|error: RayTableError| {
        let span = match error {
            RayTableError::Lines => lines.span,
            RayTableError::PulseRate => t.span_of(&rays::PULSE_RATE),
            _ => t.span,
        };
        t.report().error(span, error.to_string(), "", None);
    })
    .ok()
}
