//! `[raster]`, `[mirror]`, `[risley]` and `[rays]`.

use glam::DVec3;

use super::super::rays::RayFiles;
use super::super::section::{self, Section};
use super::{angles, check_rays, elevations};
use crate::angle::Angle;
use crate::sensor::{
    Axis, Mirror, MirrorError, Motion, Order, Prism, Raster, RayTable, RayTableError, Risley, RisleyError,
    Tilted, direction,
};
use crate::source::{Report, Spanned};

pub(super) fn raster(report: &Report, s: &Section<'_>) -> Option<Raster> {
    s.need("azimuths_deg", "`azimuths_deg = { from = 60.0, to = -60.0, count = 600 }`, or a list");
    s.need("elevations_deg", "`elevations_deg = { from = 12.5, to = -12.5, count = 126 }`, or a list");
    let azimuths = angles(report, s, "azimuths_deg");
    let elevations = elevations(report, s);
    let orders = [("lines", Order::Lines), ("back_and_forth", Order::BackAndForth), ("flash", Order::Flash)];
    let order = s.choice("order", &orders);
    let (rate, pulse_rate) = (s.positive("rate_hz", false), s.positive("pulse_rate_hz", false));
    if order != Some(Order::Flash) && s.get("pulse_rate_hz").is_none() {
        s.need("rate_hz", "`rate_hz = 10.0`, the frames a second, or `pulse_rate_hz`, the pulses a second");
    }
    let (azimuths, elevations) = (azimuths?, elevations?);
    check_rays(report, elevations.value.len() as u64, azimuths.value.len() as u64, azimuths.span)?;
    let degrees = |list: &Spanned<Vec<Spanned<f64>>>| {
        list.value.iter().map(|at| Angle::deg(at.value)).collect::<Vec<_>>()
    };
    let order = order.unwrap_or(Order::Lines);
    let rays = (azimuths.value.len() * elevations.value.len()) as f64;
    let pulse_rate_hz = match (pulse_rate, rate) {
        (Some(pulses), _) => pulses.value,
        (None, Some(rate)) => rate.value * rays,
        (None, None) if order == Order::Flash => f64::INFINITY,
        (None, None) => return None, // reported above
    };
    Raster::new(&degrees(&azimuths), &degrees(&elevations), order, pulse_rate_hz, rate.map(|r| r.value))
        .map_err(|error| report.error(s.span, error.to_string(), "", None))
        .ok()
}

pub(super) fn mirror(report: &Report, s: &Section<'_>) -> Option<Mirror> {
    s.need("azimuth", "`azimuth = { motion = \"sine\", rate_hz = 1000.0, from_deg = 30.0, to_deg = -30.0 }`");
    s.need(
        "elevation",
        "`elevation = { motion = \"triangle\", rate_hz = 10.0, from_deg = 12.0, to_deg = -12.0 }`",
    );
    let axes = ["azimuth", "elevation"].map(|key| axis(&s.section(key, &section::AXIS)?));
    let beams = beams(s);
    let (pulse_rate, rate) = rates(s);
    let ([azimuth, elevation], beams) = (axes, beams?);
    let (azimuth, elevation, pulse_rate, rate) = (azimuth?, elevation?, pulse_rate?, rate?);
    Mirror::new((azimuth, elevation), beams, pulse_rate.value, rate.value)
        .map_err(|error| {
            let span = match error {
                MirrorError::Rate => report.later(pulse_rate.span, rate.span),
                MirrorError::Beam(_) => {
                    s.get("beams_deg").or(s.get("elevation")).map_or(s.span, |node| node.span)
                }
                _ => s.span,
            };
            report.error(span, error.to_string(), "", None);
        })
        .ok()
}

/// How an angle of a mirror moves.
fn axis(s: &Section<'_>) -> Option<Axis> {
    s.need("motion", "`motion = \"sine\"`, or \"triangle\" or \"sawtooth\"");
    s.need("rate_hz", "`rate_hz = 100.0`, the periods a second");
    s.need("from_deg", "`from_deg = 30.0`, where a period begins");
    s.need("to_deg", "`to_deg = -30.0`, the other end of the motion");
    let motions = [("sine", Motion::Sine), ("triangle", Motion::Triangle), ("sawtooth", Motion::Sawtooth)];
    let motion = s.choice("motion", &motions);
    let (rate, from, to) = (s.positive("rate_hz", false), s.number("from_deg"), s.number("to_deg"));
    let phase = s.number("phase_deg").map_or(0.0, |at| at.value);
    Some(Axis {
        motion: motion?,
        rate_hz: rate?.value,
        from: Angle::deg(from?.value),
        to: Angle::deg(to?.value),
        phase: Angle::deg(phase),
    })
}

pub(super) fn risley(report: &Report, s: &Section<'_>) -> Option<Risley> {
    s.need("prisms", "`prisms = [{ rate_hz = -121.6, wedge_deg = 18.7, index = 1.51 }]`, in the beam's way");
    let prisms = s.sections("prisms", &section::PRISM);
    let prisms = prisms.map(|list| Spanned {
        span: list.span,
        value: list.value.iter().map(|p| (p.span, prism(p))).collect::<Vec<_>>(),
    });
    let beams = beams(s);
    let (pulse_rate, rate) = rates(s);
    let prisms = prisms?;
    let places: Vec<_> = prisms.value.iter().map(|(span, _)| *span).collect();
    let list: Option<Vec<Prism>> = prisms.value.into_iter().map(|(_, prism)| prism).collect();
    let (list, beams, pulse_rate, rate) = (list?, beams?, pulse_rate?, rate?);
    let beams: Vec<DVec3> = beams.into_iter().map(|(az, el)| direction(az, el)).collect();
    Risley::new(list, &beams, pulse_rate.value, rate.value)
        .map_err(|error| {
            let span = match error {
                RisleyError::Prism(index) => places[index],
                RisleyError::NoPrisms => prisms.span,
                RisleyError::Rate => report.later(pulse_rate.span, rate.span),
                _ => s.get("beams_deg").map_or(s.span, |node| node.span),
            };
            report.error(span, error.to_string(), "", None);
        })
        .ok()
}

fn prism(s: &Section<'_>) -> Option<Prism> {
    s.need("rate_hz", "`rate_hz = 121.6`, turns a second, negative the other way round");
    s.need("wedge_deg", "`wedge_deg = 18.7`, the angle between the faces");
    s.need("index", "`index = 1.51`, the refractive index");
    let (rate, wedge, index) = (s.number("rate_hz"), s.number("wedge_deg"), s.number("index"));
    let phase = s.number("phase_deg").map_or(0.0, |at| at.value);
    let tilted = s.choice("tilted", &[("entry", Tilted::Entry), ("exit", Tilted::Exit)]);
    Some(Prism {
        rate_hz: rate?.value,
        wedge: Angle::deg(wedge?.value),
        index: index?.value,
        phase: Angle::deg(phase),
        tilted: tilted.unwrap_or_default(),
    })
}

/// `beams_deg`, azimuth and elevation of each beam; straight ahead if it's left out.
fn beams(s: &Section<'_>) -> Option<Vec<(Angle, Angle)>> {
    if s.get("beams_deg").is_none() {
        return Some(vec![Default::default()]);
    }
    let beams = s.vectors::<2>("beams_deg", "azimuth, elevation")?;
    Some(beams.value.iter().map(|at| (Angle::deg(at.value[0]), Angle::deg(at.value[1]))).collect())
}

/// `pulse_rate_hz` and `rate_hz`.
fn rates(s: &Section<'_>) -> (Option<Spanned<f64>>, Option<Spanned<f64>>) {
    s.need("pulse_rate_hz", "`pulse_rate_hz = 100000.0`, the pulses of each beam a second");
    s.need("rate_hz", "`rate_hz = 10.0`, the frames a second");
    (s.positive("pulse_rate_hz", false), s.positive("rate_hz", false))
}

pub(super) fn rays(report: &Report, s: &Section<'_>, files: &RayFiles) -> Option<RayTable> {
    s.need("file", "`file = \"rays.csv\"`");
    let (file, rate) = (s.text("file"), s.positive("rate_hz", false));
    // What is wrong with the file was reported as it was read.
    let pulses = files.pulses(file?)?;
    RayTable::new(pulses, rate.map(|r| r.value))
        .map_err(|error| match error {
            RayTableError::Ray(_) | RayTableError::Empty => {}
            _ => report.error(s.span, error.to_string(), "", None),
        })
        .ok()
}
