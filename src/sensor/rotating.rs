//! Multi-beam LiDARs with a turning head.

use glam::DVec3;

use super::Pulse;
use crate::angle::Angle;

/// A head with beams at fixed elevations that fires once a column while it turns.
#[derive(Clone, Debug, PartialEq)]
pub struct Rotating {
    /// Highest first.
    beams: Vec<Beam>,
    columns: usize,
    from: Angle,
    to: Angle,
    rate_hz: f64,
    /// Sine and cosine of each column's azimuth, without a beam's own offset: a pulse then costs no sine.
    turns: Vec<(f64, f64)>,
    /// Sine and cosine of each beam's elevation and azimuth offset.
    aims: Vec<[(f64, f64); 2]>,
}

/// One laser of a rotating LiDAR.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Beam {
    /// From the sensor's xy plane, up positive.
    pub elevation: Angle,
    /// Added to the column's azimuth.
    pub azimuth_offset: Angle,
    /// Seconds after the column's own time.
    pub time_s: f64,
    /// Its place in the sensor file's beam table, from 0.
    pub file_index: usize,
}

/// Why a rotating pattern can't be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RotatingError {
    /// No beams.
    #[error("a rotating sensor needs at least one beam")]
    NoBeams,
    /// No columns.
    #[error("a rotating sensor needs at least one column")]
    NoColumns,
    /// The sector turns by nothing, or by more than once round.
    #[error("a sector must turn by more than 0 and at most 360 degrees")]
    Sector,
    /// The rate is not a positive number.
    #[error("the rate must be positive")]
    Rate,
    /// A beam's angle or time is not finite, or its elevation is past straight up or down.
    #[error("beam {0}: elevations lie within ±90 degrees, angles and times are finite")]
    Beam(usize),
}

impl Rotating {
    /// A pattern of `beams` (in the sensor file's order; rows are sorted here, highest first, ties in file order) and
    /// `columns` firings from azimuth `from` to azimuth `to`, `rate_hz` turns a second.
    ///
    /// A full turn has no repeated last column; the last column of a smaller sector is at `to`.
    pub fn new(
        mut beams: Vec<Beam>,
        columns: usize,
        (from, to): (Angle, Angle),
        rate_hz: f64,
    ) -> Result<Self, RotatingError> {
        if beams.is_empty() {
            return Err(RotatingError::NoBeams);
        }
        if columns == 0 {
            return Err(RotatingError::NoColumns);
        }
        let turn = (to - from).radians().abs();
        // A few ulps of room: 180 − (−180) degrees is 2π only up to rounding.
        if !(from.radians().is_finite() && turn > 0.0 && turn <= std::f64::consts::TAU * (1.0 + 1e-12)) {
            return Err(RotatingError::Sector);
        }
        if !(rate_hz.is_finite() && rate_hz > 0.0) {
            return Err(RotatingError::Rate);
        }
        if let Some(bad) = beams.iter().position(|b| {
            let finite = b.azimuth_offset.radians().is_finite() && b.time_s.is_finite();
            !(finite && b.elevation.radians().abs() <= std::f64::consts::FRAC_PI_2)
        }) {
            return Err(RotatingError::Beam(bad));
        }
        for (index, beam) in beams.iter_mut().enumerate() {
            beam.file_index = index;
        }
        beams.sort_by(|a, b| b.elevation.radians().total_cmp(&a.elevation.radians()));
        let aims = beams.iter().map(|b| [b.elevation.sin_cos(), b.azimuth_offset.sin_cos()]).collect();
        let mut pattern = Self { beams, columns, from, to, rate_hz, turns: Vec::new(), aims };
        pattern.turns = (0..columns).map(|column| pattern.azimuth(column).sin_cos()).collect();
        Ok(pattern)
    }

    /// The beams, highest first: one a row of the image.
    pub fn beams(&self) -> &[Beam] {
        &self.beams
    }

    /// Firings in the sector.
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Turns a second.
    pub fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// Azimuths of the sector's start and end.
    pub fn sector(&self) -> (Angle, Angle) {
        (self.from, self.to)
    }

    /// Whether the sector is a full turn.
    pub fn is_full_turn(&self) -> bool {
        (self.to - self.from).radians().abs() > std::f64::consts::TAU * (1.0 - 1e-12)
    }

    /// The angle from one column to the next, negative when the head turns clockwise seen from above. 0 for one column.
    pub fn azimuth_step(&self) -> Angle {
        let steps = if self.is_full_turn() { self.columns } else { self.columns - 1 };
        Angle::rad(if steps == 0 { 0.0 } else { (self.to - self.from).radians() / steps as f64 })
    }

    /// The azimuth of a column, before a beam's own offset.
    pub fn azimuth(&self, column: usize) -> Angle {
        self.from + Angle::rad(self.azimuth_step().radians() * column as f64)
    }

    /// The pulse of beam `row` (highest first) in firing `column`.
    ///
    /// d = (cos ε · cos α, cos ε · sin α, sin ε) with elevation ε and azimuth α; its time is the part of the turn since
    /// the sector's start, over the rate, and the beam's own. The sine and cosine of α, column and offset together, are those
    /// of a sum of angles; all of it is good to a few 10⁻¹⁶.
    pub fn pulse(&self, row: usize, column: usize) -> Pulse {
        let beam = &self.beams[row];
        let [(sin_el, cos_el), (sin_offset, cos_offset)] = self.aims[row];
        let (sin_turn, cos_turn) = self.turns[column];
        let sin_az = sin_turn * cos_offset + cos_turn * sin_offset;
        let cos_az = cos_turn * cos_offset - sin_turn * sin_offset;
        let turned = (self.azimuth_step().radians() * column as f64).abs() / std::f64::consts::TAU;
        Pulse {
            direction: DVec3::new(cos_el * cos_az, cos_el * sin_az, sin_el),
            time_s: turned / self.rate_hz + beam.time_s,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn beam(elevation: f64) -> Beam {
        Beam {
            elevation: Angle::deg(elevation),
            azimuth_offset: Angle::default(),
            time_s: 0.0,
            file_index: 0,
        }
    }

    fn full_turn() -> (Angle, Angle) {
        (Angle::deg(180.0), Angle::deg(-180.0))
    }

    #[test]
    fn rows_go_from_the_top_and_remember_the_file() {
        let p = Rotating::new(vec![beam(-5.0), beam(15.0), beam(1.0)], 4, full_turn(), 10.0).unwrap();
        let files: Vec<_> = p.beams().iter().map(|b| b.file_index).collect();
        assert_eq!(files, [1, 2, 0]);
        assert!(p.pulse(0, 0).direction.z > p.pulse(2, 0).direction.z);
    }

    #[test]
    fn a_full_turn_starts_behind_turns_clockwise_and_looks_forward_in_the_middle() {
        let p = Rotating::new(vec![beam(0.0)], 4, full_turn(), 10.0).unwrap();
        let near = |c: usize, d: DVec3| assert!(p.pulse(0, c).direction.abs_diff_eq(d, 1e-15), "column {c}");
        near(0, DVec3::NEG_X);
        near(1, DVec3::Y); // 90°: to the left, as the head comes clockwise from behind
        near(2, DVec3::X);
        near(3, DVec3::NEG_Y);
        assert!((p.pulse(0, 3).time_s - 0.075).abs() < 1e-15);
    }

    #[test]
    fn a_sector_ends_on_its_last_column() {
        let sector = (Angle::deg(-30.0), Angle::deg(30.0));
        let p = Rotating::new(vec![beam(0.0)], 7, sector, 5.0).unwrap();
        assert!((p.azimuth(6).degrees() - 30.0).abs() < 1e-12);
        assert!((p.azimuth_step().degrees() - 10.0).abs() < 1e-12);
        // A sixth of a turn at 5 Hz.
        assert!((p.pulse(0, 6).time_s - 1.0 / 30.0).abs() < 1e-15);
        assert_eq!(Rotating::new(vec![beam(0.0)], 1, sector, 5.0).unwrap().azimuth(0), sector.0);
    }

    #[test]
    fn offsets_and_beam_times_are_added() {
        let mut b = beam(10.0);
        b.azimuth_offset = Angle::deg(3.0);
        b.time_s = 2e-6;
        let p = Rotating::new(vec![b], 360, full_turn(), 10.0).unwrap();
        let pulse = p.pulse(0, 100);
        let (sin, cos) = (libm::sin(83.0_f64.to_radians()), libm::cos(83.0_f64.to_radians()));
        let c = libm::cos(10.0_f64.to_radians());
        assert!(
            pulse
                .direction
                .abs_diff_eq(DVec3::new(c * cos, c * sin, libm::sin(10.0_f64.to_radians())), 1e-14)
        );
        assert!((pulse.time_s - (100.0 / 3600.0 + 2e-6)).abs() < 1e-15);
        assert!((pulse.direction.length() - 1.0).abs() < 1e-15);
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let new = |b, c, s, r| Rotating::new(b, c, s, r).unwrap_err();
        assert_eq!(new(vec![], 1, full_turn(), 1.0), RotatingError::NoBeams);
        assert_eq!(new(vec![beam(0.0)], 0, full_turn(), 1.0), RotatingError::NoColumns);
        let over = (Angle::deg(0.0), Angle::deg(361.0));
        assert_eq!(new(vec![beam(0.0)], 1, over, 1.0), RotatingError::Sector);
        assert_eq!(new(vec![beam(0.0)], 1, (over.0, over.0), 1.0), RotatingError::Sector);
        assert_eq!(new(vec![beam(0.0)], 1, full_turn(), f64::NAN), RotatingError::Rate);
        assert_eq!(new(vec![beam(0.0), beam(91.0)], 1, full_turn(), 1.0), RotatingError::Beam(1));
    }
}
