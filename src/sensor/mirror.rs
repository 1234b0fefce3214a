//! Beams on mirrors that move about two axes: Lissajous figures, and other motions with one rate for each axis.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::DVec3;

use super::{Pulse, direction};
use crate::angle::Angle;

/// Beams whose azimuth and elevation each move with their own period. Angles are those of the beam, twice those of the
/// mirror.
#[derive(Clone, Debug, PartialEq)]
pub struct Mirror {
    azimuth: Axis,
    elevation: Axis,
    beams: Vec<(Angle, Angle)>,
    columns: usize,
    pulse_rate_hz: f64,
    rate_hz: f64,
}

/// The motion of one angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// The shape of a period.
    pub motion: Motion,
    /// Periods a second, 0 or more.
    pub rate_hz: f64,
    /// The angle at one end of the motion.
    pub from: Angle,
    /// The angle at the other end.
    pub to: Angle,
    /// The part of its period that the motion has gone at time 0. 360° are a whole period.
    pub phase: Angle,
}

/// The shape of a period, which begins at `from`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// There and back as a cosine, like a resonant mirror.
    Sine,
    /// There and back at a constant speed.
    Triangle,
    /// There at a constant speed, and back in no time. From 180° to −180° this is a rotating head.
    Sawtooth,
}

/// The reason why a moving mirror is impossible.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MirrorError {
    /// An axis has a number that is not finite, or a negative rate.
    #[error("the angles and the rate of an axis must be finite, and its rate must be 0 or more")]
    Axis,
    /// An angle of a beam is not finite, or its elevation is beyond straight up or down at an end of the motion. Beams
    /// count from 0.
    #[error("beam {0}: elevations must stay within ±90 degrees, and angles must be finite")]
    Beam(usize),
    /// There are no beams.
    #[error("a mirror needs at least one beam")]
    NoBeams,
    /// A rate is not a positive number, or a frame has less than one pulse.
    #[error("rates must be positive, with at least one pulse a frame")]
    Rate,
}

impl Axis {
    /// The angle at a time in seconds.
    fn at(&self, time_s: f64) -> Angle {
        let periods = self.rate_hz * time_s + self.phase.radians() / TAU;
        let part = periods - periods.floor();
        let way = match self.motion {
            Motion::Sine => 0.5 - 0.5 * libm::cos(TAU * part),
            Motion::Triangle => 1.0 - (1.0 - 2.0 * part).abs(),
            Motion::Sawtooth => part,
        };
        self.from + Angle::rad((self.to - self.from).radians() * way)
    }

    fn is_fine(&self) -> bool {
        let angles = [self.from, self.to, self.phase];
        angles.iter().all(|a| a.radians().is_finite()) && self.rate_hz.is_finite() && self.rate_hz >= 0.0
    }
}

impl Mirror {
    /// A mirror whose `beams` (azimuths and elevations that are added to those of the mirror) fire together,
    /// `pulse_rate_hz` times a second, in frames of 1/`rate_hz` seconds.
    ///
    /// # Errors
    /// A [`MirrorError`] that names the first wrong argument.
    pub fn new(
        (azimuth, elevation): (Axis, Axis),
        beams: Vec<(Angle, Angle)>,
        pulse_rate_hz: f64,
        rate_hz: f64,
    ) -> Result<Self, MirrorError> {
        if !(azimuth.is_fine() && elevation.is_fine()) {
            return Err(MirrorError::Axis);
        }
        if beams.is_empty() {
            return Err(MirrorError::NoBeams);
        }
        let is_fine = |&(az, el): &(Angle, Angle)| {
            let ends = [elevation.from + el, elevation.to + el];
            az.radians().is_finite() && ends.iter().all(|e| e.radians().abs() <= FRAC_PI_2 * (1.0 + 1e-15))
        };
        if let Some(bad) = beams.iter().position(|beam| !is_fine(beam)) {
            return Err(MirrorError::Beam(bad));
        }
        let columns = super::pulses_a_frame(pulse_rate_hz, rate_hz).ok_or(MirrorError::Rate)?;
        Ok(Self { azimuth, elevation, beams, columns, pulse_rate_hz, rate_hz })
    }

    /// The azimuths and elevations that the beams add to those of the mirror. Each is a row.
    pub fn beams(&self) -> &[(Angle, Angle)] {
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

    /// Pulse number `column` of beam `row` in the frame that starts at `start_s` seconds.
    pub(super) fn pulse(&self, row: usize, column: usize, start_s: f64) -> Pulse {
        let time_s = column as f64 / self.pulse_rate_hz;
        let (azimuth, elevation) = self.beams[row];
        let at = |axis: &Axis| axis.at(start_s + time_s);
        let direction = direction(at(&self.azimuth) + azimuth, at(&self.elevation) + elevation);
        Pulse::new(DVec3::ZERO, direction, time_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::azimuth_elevation;

    fn axis(motion: Motion, rate_hz: f64, from: f64, to: f64) -> Axis {
        Axis { motion, rate_hz, from: Angle::deg(from), to: Angle::deg(to), phase: Angle::default() }
    }

    #[test]
    fn motions_begin_at_their_first_end() {
        let at = |motion, part: f64| axis(motion, 1.0, 10.0, -10.0).at(part).degrees();
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
        for (part, sine, triangle, sawtooth) in
            [(0.0, 10.0, 10.0, 10.0), (0.25, 0.0, 0.0, 5.0), (0.5, -10.0, -10.0, 0.0), (0.75, 0.0, 0.0, -5.0)]
        {
            near(at(Motion::Sine, part), sine);
            near(at(Motion::Triangle, part), triangle);
            near(at(Motion::Sawtooth, part + 3.0), sawtooth);
        }
        let mut late = axis(Motion::Sawtooth, 1.0, 0.0, 360.0);
        late.phase = Angle::deg(90.0);
        near(late.at(0.5).degrees(), 270.0);
    }

    /// Two sines of one rate, a quarter of a period apart, draw an ellipse.
    #[test]
    fn a_lissajous_figure_of_equal_rates_is_an_ellipse() {
        let mut azimuth = axis(Motion::Sine, 50.0, 20.0, -20.0);
        azimuth.phase = Angle::deg(90.0);
        let elevation = axis(Motion::Sine, 50.0, 10.0, -10.0);
        let p = Mirror::new(
            (azimuth, elevation),
            vec![Default::default(), (Angle::deg(1.0), Angle::deg(2.0))],
            1e4,
            10.0,
        )
        .unwrap();
        assert_eq!((p.columns(), p.last_pulse_s()), (1000, 0.0999));
        for column in 0..1000 {
            let (az, el) = azimuth_elevation(p.pulse(0, column, 0.4).direction);
            let (x, y) = (az.degrees() / 20.0, el.degrees() / 10.0);
            assert!((x * x + y * y - 1.0).abs() < 1e-12);
            let (az2, el2) = azimuth_elevation(p.pulse(1, column, 0.4).direction);
            let apart = ((az2 - az).degrees() - 1.0, (el2 - el).degrees() - 2.0);
            assert!(apart.0.abs() < 1e-12 && apart.1.abs() < 1e-12);
        }
    }

    #[test]
    fn impossible_parameters_are_refused() {
        let good = axis(Motion::Sine, 1.0, 20.0, -20.0);
        let new = |elevation, beams: &[f64], rate| {
            let beams = beams.iter().map(|&e| (Angle::default(), Angle::deg(e))).collect();
            Mirror::new((good, elevation), beams, rate, 10.0).unwrap_err()
        };
        assert_eq!(new(axis(Motion::Sine, -1.0, 0.0, 0.0), &[0.0], 1e3), MirrorError::Axis);
        assert_eq!(new(good, &[], 1e3), MirrorError::NoBeams);
        assert_eq!(new(good, &[0.0, 80.0], 1e3), MirrorError::Beam(1));
        assert_eq!(new(good, &[0.0], 1.0), MirrorError::Rate);
    }
}
