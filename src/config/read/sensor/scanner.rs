//! `[raster]`, `[mirror]`, `[risley]` and `[rays]`.

use glam::DVec3;

use super::super::super::keys::sensor::{BEAMS, FRAME_RATE, NEEDED_FRAME_RATE, PULSE_RATE};
use super::super::super::keys::sensor::{mirror, raster, rays, risley};
use super::super::super::table::Table;
use super::super::rays::RayFiles;
use super::limit::check_rays;
use crate::angle::Angle;
use crate::sensor::{
    Axis, Mirror, MirrorError, Order, Prism, Raster, RayTable, RayTableError, Risley, RisleyError, direction,
};
use crate::source::Spanned;

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
    let (prisms, list, beams, pulse_rate, rate) = (prisms?, list?, beams?, pulse_rate?, rate?);
    let beams: Vec<DVec3> = beams.into_iter().map(|(az, el)| direction(az, el)).collect();
    Risley::new(list, &beams, pulse_rate.value, rate.value)
        .map_err(|error| {
            let span = match error {
                RisleyError::Prism(index) => prisms.value[index].span,
                RisleyError::NoPrisms => prisms.span,
                RisleyError::Rate => t.report().later(pulse_rate.span, rate.span),
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
    Some(Prism { rate_hz: rate?.value, wedge: Angle::deg(wedge?.value), index: index?.value, phase, tilted })
}

/// Azimuth and elevation of each beam; straight ahead if they are left out.
fn beams(t: &Table<'_>) -> Option<Vec<(Angle, Angle)>> {
    if !t.has(&BEAMS) {
        return Some(vec![Default::default()]);
    }
    let beams = t.read(&BEAMS)?;
    Some(beams.value.iter().map(|beam| (Angle::deg(beam.value[0]), Angle::deg(beam.value[1]))).collect())
}

pub(super) fn rays(t: &Table<'_>, files: &RayFiles) -> Option<RayTable> {
    let (file, rate) = (t.read(&rays::FILE), t.read(&FRAME_RATE));
    // The errors of the file were reported when it was read.
    let table = files.table(t.report(), file?)?;
    table
        .with_rate(rate.map(|rate| rate.value))
        .map_err(|error: RayTableError| t.report().error(t.span, error.to_string(), "", None))
        .ok()
}
