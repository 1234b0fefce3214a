//! Beams through rotating wedge prisms (Risley prisms), for LiDARs whose pattern does not repeat.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::DVec3;

use super::Pulse;
use crate::angle::Angle;

/// Beams that go along +x through a row of wedge prisms. Each prism rotates about x.
///
/// Refraction is exact: Snell's law in three dimensions at both faces of each prism, as in A. Li, X. Liu and W. Sun,
/// "Forward and inverse solutions for three-element Risley prism beam scanners", Opt. Express 25, 7677, 2017. The prisms
/// only change the direction of a beam. The model neglects that the beam leaves a few millimetres off the axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Risley {
    prisms: Vec<Prism>,
    beams: Vec<DVec3>,
    columns: usize,
    pulse_rate_hz: f64,
    rate_hz: f64,
}

/// A wedge prism.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prism {
    /// The rotation rate in turns a second about +x. It is positive from +y toward +z.
    pub rate_hz: f64,
    /// The angle between the faces of the prism, within ±90°.
    pub wedge: Angle,
    /// The refractive index relative to air, 1 or more.
    pub index: f64,
    /// The rotation at time 0. At phase 0 the normal of the tilted face leans toward +y.
    pub phase: Angle,
    /// The face that is tilted. The other face is perpendicular to x.
    pub tilted: Tilted,
}

/// The face of a wedge prism that is not perpendicular to the axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Tilted {
    /// The face through which the beam enters.
    #[default]
    Entry,
    /// The face through which the beam leaves.
    Exit,
}

/// The reason why a prism scanner is impossible.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RisleyError {
    /// There are no prisms.
    #[error("a prism scanner needs at least one prism")]
    NoPrisms,
    /// A prism has a number that is not finite, a wedge of a right angle or more, or an index below 1. Prisms count from 0.
    #[error(
        "prism {0}: wedges must lie within ±90 degrees, indices must be 1 or more, and all numbers must be finite"
    )]
    Prism(usize),
    /// There are no beams.
    #[error("a prism scanner needs at least one beam")]
    NoBeams,
    /// A beam does not go forward. Beams count from 0.
    #[error("beam {0} must point forward, into the prisms")]
    Beam(usize),
    /// A rate is not a positive number, or a frame has less than one pulse.
    #[error("rates must be positive, with at least one pulse a frame")]
    Rate,
}

impl Risley {
    /// A scanner whose `beams` (directions of any length before the first prism) fire together, `pulse_rate_hz` times a
    /// second, in frames of 1/`rate_hz` seconds.
    ///
    /// # Errors
    /// A [`RisleyError`] that names the first wrong argument.
    pub fn new(
        prisms: Vec<Prism>,
        beams: &[DVec3],
        pulse_rate_hz: f64,
        rate_hz: f64,
    ) -> Result<Self, RisleyError> {
        if prisms.is_empty() {
            return Err(RisleyError::NoPrisms);
        }
        let is_prism = |p: &Prism| {
            p.rate_hz.is_finite()
                && p.phase.radians().is_finite()
                && p.wedge.radians().abs() < FRAC_PI_2
                && (p.index >= 1.0 && p.index.is_finite())
        };
        if let Some(bad) = prisms.iter().position(|p| !is_prism(p)) {
            return Err(RisleyError::Prism(bad));
        }
        if beams.is_empty() {
            return Err(RisleyError::NoBeams);
        }
        if let Some(bad) = beams.iter().position(|b| !(b.is_finite() && b.x > 0.0)) {
            return Err(RisleyError::Beam(bad));
        }
        let columns = super::pulses_a_frame(pulse_rate_hz, rate_hz).ok_or(RisleyError::Rate)?;
        let beams = beams.iter().map(|b| b.normalize()).collect();
        Ok(Self { prisms, beams, columns, pulse_rate_hz, rate_hz })
    }

    /// The unit directions of the beams before the first prism. Each is a row.
    pub fn beams(&self) -> &[DVec3] {
        &self.beams
    }

    /// The number of pulses of a beam in a frame.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Frames a second.
    pub fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// The time of the last pulse, in seconds from the first pulse.
    pub fn last_pulse_s(&self) -> f64 {
        (self.columns - 1) as f64 / self.pulse_rate_hz
    }

    /// Pulse number `column` of beam `row` in the frame that starts at `start_s` seconds. `None` if a prism reflects the
    /// beam inward completely.
    pub(super) fn pulse(&self, row: usize, column: usize, start_s: f64) -> Option<Pulse> {
        let time_s = column as f64 / self.pulse_rate_hz;
        let direction = self
            .prisms
            .iter()
            .try_fold(self.beams[row], |beam, prism| prism.refract(beam, start_s + time_s))?;
        Some(Pulse::new(DVec3::ZERO, direction.normalize(), time_s))
    }
}

impl Prism {
    /// The direction of a beam behind the prism.
    fn refract(&self, beam: DVec3, time_s: f64) -> Option<DVec3> {
        // Whole turns are removed first, because the sine of a large angle would lose digits.
        let turns = self.rate_hz * time_s;
        let turned = Angle::rad((turns - turns.floor()) * TAU) + self.phase;
        let ((sin_wedge, cos_wedge), (sin, cos)) = (self.wedge.sin_cos(), turned.sin_cos());
        let tilted = DVec3::new(cos_wedge, sin_wedge * cos, sin_wedge * sin);
        let (entry, exit) = match self.tilted {
            Tilted::Entry => (tilted, DVec3::X),
            Tilted::Exit => (DVec3::X, tilted),
        };
        refract(refract(beam, entry, 1.0 / self.index)?, exit, self.index)
    }
}

/// Snell's law. `ratio` is the refractive index before the face over the index behind it, and `normal` is the face's unit
/// normal along the direction of travel. `None` for total reflection, or for a beam that runs along the face or comes from
/// behind it.
fn refract(beam: DVec3, normal: DVec3, ratio: f64) -> Option<DVec3> {
    let cos_in = beam.dot(normal);
    let cos_out_squared = 1.0 - ratio * ratio * (1.0 - cos_in * cos_in);
    (cos_in > 0.0 && cos_out_squared > 0.0)
        .then(|| beam * ratio + normal * (cos_out_squared.sqrt() - ratio * cos_in))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::azimuth_elevation;

    fn prism(rate_hz: f64, wedge_deg: f64, tilted: Tilted) -> Prism {
        Prism { rate_hz, wedge: Angle::deg(wedge_deg), index: 1.5, phase: Angle::default(), tilted }
    }

    fn off_axis(prisms: &[Prism], time_s: f64) -> DVec3 {
        prisms.iter().fold(DVec3::X, |beam, prism| prism.refract(beam, time_s).unwrap())
    }

    /// Checks one prism against the closed form in the plane of the wedge, with angles from the axis. A tilted exit
    /// deviates the beam by asin(n·sin α) − α. A tilted entry turns the beam by α − asin(sin α/n), which the flat exit
    /// magnifies by Snell's law.
    #[test]
    fn one_prism_is_snells_law_in_a_plane() {
        for wedge in [1.0_f64, 10.0, 30.0] {
            let alpha = wedge.to_radians();
            let exit = libm::asin(1.5 * libm::sin(alpha)) - alpha;
            let entry = libm::asin(1.5 * libm::sin(alpha - libm::asin(libm::sin(alpha) / 1.5)));
            for (tilted, expected, sign) in [(Tilted::Exit, exit, -1.0), (Tilted::Entry, entry, 1.0)] {
                let d = off_axis(&[prism(0.0, wedge, tilted)], 0.0);
                // An entry face that leans toward +y turns the beam toward its normal, which is toward +y. Such an exit
                // turns it away.
                let (azimuth, elevation) = azimuth_elevation(d);
                assert!(
                    (azimuth.radians() - sign * expected).abs() < 1e-14,
                    "{wedge} {tilted:?} {azimuth:?}"
                );
                assert!(elevation.radians().abs() < 1e-15);
                assert!((d.length() - 1.0).abs() < 1e-15);
            }
        }
    }

    /// Thin prisms deviate by (n − 1)·α each, and the deviations add as vectors that turn: a hypotrochoid.
    #[test]
    fn thin_prisms_draw_the_sum_of_two_circles() {
        let wedge = 0.01;
        let prisms = [prism(30.0, wedge, Tilted::Entry), prism(-20.0, 2.0 * wedge, Tilted::Entry)];
        for step in 0..50 {
            let time = f64::from(step) * 1.3e-3;
            let d = off_axis(&prisms, time);
            let circle = |rate: f64, size: f64| {
                let deviation = 0.5 * size.to_radians();
                let (sin, cos) = libm::sincos(TAU * rate * time);
                (deviation * cos, deviation * sin)
            };
            let ((a, b), (c, e)) = (circle(30.0, wedge), circle(-20.0, 2.0 * wedge));
            assert!((d.y - (a + c)).abs() < 1e-10 && (d.z - (b + e)).abs() < 1e-10, "{step}");
        }
    }

    #[test]
    fn opposed_equal_prisms_undo_each_other() {
        // The tilted faces are parallel. With air between them the prisms are the two halves of a plane-parallel plate.
        let (first, second) = (prism(7.0, 20.0, Tilted::Exit), prism(7.0, 20.0, Tilted::Entry));
        for step in 0..20 {
            let d = off_axis(&[first, second], f64::from(step) * 0.01);
            assert!(d.abs_diff_eq(DVec3::X, 1e-14), "{d}");
        }
    }

    #[test]
    fn frames_follow_each_other_and_do_not_repeat() {
        let prisms = vec![prism(-121.5657, 18.7481, Tilted::Entry), prism(77.7430, 17.9634, Tilted::Entry)];
        let p = Risley::new(prisms, &[DVec3::X], 1e5, 10.0).unwrap();
        assert_eq!((p.columns(), p.beams().len()), (10_000, 1));
        let at = |column, start| p.pulse(0, column, start).unwrap();
        assert!(at(9_999, 0.0).direction.abs_diff_eq(at(0, 0.09999).direction, 1e-12));
        assert!((at(0, 0.0).direction - at(0, 0.1).direction).length() > 1e-2);
        assert_eq!(at(9_999, 0.3).time_s, 9_999.0 / 1e5);
    }

    #[test]
    fn total_reflection_is_no_pulse() {
        let p = Risley::new(vec![prism(1.0, 50.0, Tilted::Exit)], &[DVec3::X], 10.0, 1.0).unwrap();
        assert_eq!(p.pulse(0, 3, 0.0), None);
    }

    #[test]
    fn impossible_parameters_are_refused() {
        let good = prism(1.0, 10.0, Tilted::Entry);
        let new = |prisms: &[Prism], beams: &[DVec3], rate| {
            Risley::new(prisms.to_vec(), beams, rate, 10.0).unwrap_err()
        };
        assert_eq!(new(&[], &[DVec3::X], 1e3), RisleyError::NoPrisms);
        assert_eq!(new(&[good, Prism { index: 0.9, ..good }], &[DVec3::X], 1e3), RisleyError::Prism(1));
        assert_eq!(new(&[good], &[], 1e3), RisleyError::NoBeams);
        assert_eq!(new(&[good], &[DVec3::X, DVec3::NEG_X], 1e3), RisleyError::Beam(1));
        assert_eq!(new(&[good], &[DVec3::X], 0.0), RisleyError::Rate);
        assert_eq!(new(&[good], &[DVec3::X], f64::NAN), RisleyError::Rate);
    }
}
