//! Beams through rotating wedge prisms (Risley prisms), for LiDARs whose pattern does not repeat.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::DVec3;

use super::Pulse;
use crate::angle::Angle;

/// Beams that go along an axis through a row of wedge prisms. Each prism rotates about the axis, which is +x of the sensor, or
/// +z if a turning mirror behind the prisms sends the beams to the side.
///
/// The *axis frame* is where beams and prisms are described: X along the axis, and Y and Z across it. It is the sensor frame
/// if there is no mirror. With a mirror, (X, Y, Z) are the sensor's (z, x, y).
///
/// Refraction is exact: Snell's law in three dimensions at both faces of each prism, as in A. Li, X. Liu and W. Sun,
/// "Forward and inverse solutions for three-element Risley prism beam scanners", Opt. Express 25, 7677, 2017. The prisms
/// only change the direction of a beam. The model neglects that the beam leaves a few millimetres off the axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Risley {
    prisms: Vec<Prism>,
    mirror: Option<TurningMirror>,
    beams: Vec<DVec3>,
    columns: usize,
    pulse_rate_hz: f64,
    rate_hz: f64,
}

/// A wedge prism.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prism {
    /// The rotation rate in turns a second about the axis. It is positive from Y toward Z.
    pub rate_hz: f64,
    /// The angle between the faces of the prism, within ±90°.
    pub wedge: Angle,
    /// The refractive index relative to air, 1 or more.
    pub index: f64,
    /// The rotation at time 0. At phase 0 the normal of the tilted face leans toward +Y.
    pub phase: Angle,
    /// The face that is tilted. The other face is perpendicular to the axis.
    pub tilted: Tilted,
    /// How the rotation speeds up and slows down.
    pub ripple: Ripple,
}

/// A rotation's departure from a constant speed: amplitude·sin(2π·rate·t + phase) is added to its angle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Ripple {
    /// Periods a second.
    pub rate_hz: f64,
    /// The largest departure. 0 is a constant speed.
    pub amplitude: Angle,
    /// The phase at time 0.
    pub phase: Angle,
}

/// A mirror behind the prisms that turns about their axis and sends the beams to the side.
///
/// It is the oblique face within a block of glass. Beams enter the block through a face across the axis, are reflected, and
/// leave through a face along the axis on the side that the mirror looks to. A block of index 1 is a mirror in air.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TurningMirror {
    /// The rotation rate in turns a second about the axis. It is positive from Y toward Z.
    pub rate_hz: f64,
    /// The angle between the axis and the mirror's normal, between 0° and 90°. At 45° a beam along the axis leaves at a right
    /// angle to it; a larger angle turns the beam less.
    pub tilt: Angle,
    /// The refractive index of the block relative to air, 1 or more.
    pub index: f64,
    /// The side to which the mirror looks at time 0, counted from Y toward Z.
    pub phase: Angle,
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
    /// The mirror has a number that is not finite, a tilt that is not between 0° and 90°, or an index below 1.
    #[error(
        "a mirror must tilt by more than 0 and less than 90 degrees, its index must be 1 or more, and all numbers must be \
         finite"
    )]
    Mirror,
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
    /// A scanner whose `beams` (directions of any length before the first prism, in the axis frame) fire together, `pulse_rate_hz` times a
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
            let ripple = [p.ripple.rate_hz, p.ripple.amplitude.radians(), p.ripple.phase.radians()];
            p.rate_hz.is_finite()
                && p.phase.radians().is_finite()
                && ripple.iter().all(|number| number.is_finite())
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
        Ok(Self { prisms, mirror: None, beams, columns, pulse_rate_hz, rate_hz })
    }

    /// The same scanner with a turning mirror behind the prisms. Its axis is then the sensor's z.
    ///
    /// # Errors
    /// [`RisleyError::Mirror`] if the mirror is impossible.
    pub fn with_mirror(mut self, mirror: TurningMirror) -> Result<Self, RisleyError> {
        let tilt = mirror.tilt.radians();
        let is_fine = mirror.rate_hz.is_finite()
            && mirror.phase.radians().is_finite()
            && (tilt > 0.0 && tilt < FRAC_PI_2)
            && (mirror.index >= 1.0 && mirror.index.is_finite());
        if !is_fine {
            return Err(RisleyError::Mirror);
        }
        self.mirror = Some(mirror);
        Ok(self)
    }

    /// The unit directions of the beams before the first prism, in the axis frame. Each is a row.
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
        let at_s = start_s + time_s;
        let beam = self.prisms.iter().try_fold(self.beams[row], |beam, prism| prism.refract(beam, at_s))?;
        let direction = match &self.mirror {
            None => beam,
            Some(mirror) => {
                let beam = mirror.reflect(beam, at_s)?;
                DVec3::new(beam.y, beam.z, beam.x)
            }
        };
        Some(Pulse::new(DVec3::ZERO, direction.normalize(), time_s))
    }
}

impl Prism {
    /// The direction of a beam behind the prism.
    fn refract(&self, beam: DVec3, time_s: f64) -> Option<DVec3> {
        let turned = turned(self.rate_hz, time_s) + self.phase + self.ripple.at(time_s);
        let ((sin_wedge, cos_wedge), (sin, cos)) = (self.wedge.sin_cos(), turned.sin_cos());
        let tilted = DVec3::new(cos_wedge, sin_wedge * cos, sin_wedge * sin);
        let (entry, exit) = match self.tilted {
            Tilted::Entry => (tilted, DVec3::X),
            Tilted::Exit => (DVec3::X, tilted),
        };
        refract(refract(beam, entry, 1.0 / self.index)?, exit, self.index)
    }
}

impl Ripple {
    /// The angle that is added to the rotation.
    fn at(&self, time_s: f64) -> Angle {
        if self.amplitude.radians() == 0.0 {
            return Angle::default();
        }
        let (sin, _) = (turned(self.rate_hz, time_s) + self.phase).sin_cos();
        Angle::rad(self.amplitude.radians() * sin)
    }
}

impl TurningMirror {
    /// The direction of a beam behind the mirror, in the axis frame.
    fn reflect(&self, beam: DVec3, time_s: f64) -> Option<DVec3> {
        let (sin, cos) = (turned(self.rate_hz, time_s) + self.phase).sin_cos();
        let (sin_tilt, cos_tilt) = self.tilt.sin_cos();
        let normal = DVec3::new(cos_tilt, -sin_tilt * cos, -sin_tilt * sin);
        let beam = refract(beam, DVec3::X, 1.0 / self.index)?;
        let reflected = beam - normal * (2.0 * beam.dot(normal));
        refract(reflected, DVec3::new(0.0, cos, sin), self.index)
    }
}

/// The angle that a rotation at `rate_hz` turns a second has after `time_s` seconds. Whole turns are removed first, because
/// the sine of a large angle would lose digits.
fn turned(rate_hz: f64, time_s: f64) -> Angle {
    let turns = rate_hz * time_s;
    Angle::rad((turns - turns.floor()) * TAU)
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
        let (phase, ripple) = (Angle::default(), Ripple::default());
        Prism { rate_hz, wedge: Angle::deg(wedge_deg), index: 1.5, phase, tilted, ripple }
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

    /// A block whose mirror stands at 45° + ε turns a beam along the axis to 2ε above the side in the glass, which the exit
    /// face magnifies by Snell's law. The mirror's phase is the azimuth of the beam, and it turns with the mirror.
    #[test]
    fn a_turning_mirror_sends_the_axis_to_its_side() {
        let still = |tilt, index, phase, rate_hz| {
            let mirror = TurningMirror { rate_hz, tilt: Angle::deg(tilt), index, phase: Angle::deg(phase) };
            let idle = prism(1.0, 0.0, Tilted::Exit);
            Risley::new(vec![idle], &[DVec3::X], 1e3, 10.0).unwrap().with_mirror(mirror)
        };
        for (tilt, index, phase) in
            [(45.0, 1.0, 0.0), (50.0, 1.0, 30.0), (50.0, 1.5, -100.0), (41.0, 1.9, 170.0)]
        {
            let pattern = still(tilt, index, phase, 0.0).unwrap();
            let (azimuth, elevation) = azimuth_elevation(pattern.pulse(0, 0, 0.0).unwrap().direction);
            let expected = libm::asin(index * libm::sin(2.0 * (tilt - 45.0_f64).to_radians()));
            assert!((azimuth.degrees() - phase).abs() < 1e-12, "{azimuth:?}");
            assert!((elevation.radians() - expected).abs() < 1e-14, "{elevation:?} {expected}");
        }
        // Two columns are 2 ms apart, in which a rate of 25 Hz turns by 18°: from x toward y.
        let turning = still(45.0, 1.0, 10.0, 25.0).unwrap();
        let (azimuth, _) = azimuth_elevation(turning.pulse(0, 2, 0.0).unwrap().direction);
        assert!((azimuth.degrees() - 28.0).abs() < 1e-12, "{azimuth:?}");
        for (tilt, index, phase) in
            [(0.0, 1.5, 0.0), (90.0, 1.5, 0.0), (50.0, 0.9, 0.0), (50.0, 1.5, f64::NAN)]
        {
            assert_eq!(still(tilt, index, phase, 1.0), Err(RisleyError::Mirror));
        }
    }

    #[test]
    fn a_ripple_adds_a_sine_to_the_rotation() {
        let (amplitude, phase) = (Angle::deg(20.0), Angle::deg(30.0));
        let rippled =
            Prism { ripple: Ripple { rate_hz: 4.0, amplitude, phase }, ..prism(10.0, 15.0, Tilted::Exit) };
        for time_s in [0.0, 0.01, 0.333] {
            let added = 20.0 * libm::sin(TAU * 4.0 * time_s + phase.radians());
            let turned = Prism { phase: Angle::deg(added), ..prism(10.0, 15.0, Tilted::Exit) };
            let (a, b) = (off_axis(&[rippled], time_s), off_axis(&[turned], time_s));
            assert!(a.abs_diff_eq(b, 1e-14), "{time_s}");
        }
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
