//! Rays from a table, for any pattern that was measured.

use std::sync::Arc;

use super::Pulse;

/// Rays in the order of the table.
///
/// Every frame has all rays of the table, unless the table has a pulse rate and frames a second: then a frame has the pulses
/// of its time, the next one goes on where it ended, and after its last ray the table begins again.
#[derive(Clone, Debug, PartialEq)]
pub struct RayTable {
    pulses: Arc<[Pulse]>,
    lines: usize,
    rate_hz: Option<f64>,
    pulse_rate_hz: Option<f64>,
    last_pulse_s: f64,
}

/// The reason why a table of rays is impossible.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RayTableError {
    /// There are no rays.
    #[error("a table needs at least one ray")]
    Empty,
    /// A ray has a number that is not finite, a direction of length zero, or a time before the frame's start. Rays count
    /// from 0.
    #[error(
        "ray {0}: numbers must be finite, the direction must have a length, and the time must be 0 or more"
    )]
    Ray(usize),
    /// The rate is not a positive number.
    #[error("the rate must be positive")]
    Rate,
    /// The pulse rate is not a positive number, or a frame has less than one pulse or too many.
    #[error("the pulse rate must be positive, with at least one pulse a frame")]
    PulseRate,
    /// The rays are no whole number of pulses of all lines.
    #[error("the number of rays must be a multiple of the number of lines")]
    Lines,
}

impl RayTable {
    /// A table of pulses. Their directions are normalised here.
    ///
    /// # Errors
    /// A [`RayTableError`] that names the first wrong ray, or the rate.
    pub fn new(mut pulses: Vec<Pulse>, rate_hz: Option<f64>) -> Result<Self, RayTableError> {
        if pulses.is_empty() {
            return Err(RayTableError::Empty);
        }
        let mut last_pulse_s = 0.0_f64;
        for (index, pulse) in pulses.iter_mut().enumerate() {
            let direction = pulse.direction.try_normalize();
            let fine = pulse.origin.is_finite() && pulse.time_s.is_finite() && pulse.time_s >= 0.0;
            pulse.direction = direction.filter(|_| fine).ok_or(RayTableError::Ray(index))?;
            last_pulse_s = last_pulse_s.max(pulse.time_s);
        }
        Self { pulses: pulses.into(), lines: 1, rate_hz: None, pulse_rate_hz: None, last_pulse_s }
            .with_rate(rate_hz)
    }

    /// The same rays at another rate. The rays are shared, not copied.
    ///
    /// # Errors
    /// [`RayTableError::Rate`] if the rate is not a positive number.
    pub fn with_rate(self, rate_hz: Option<f64>) -> Result<Self, RayTableError> {
        match rate_hz {
            Some(rate) if !(rate > 0.0 && rate.is_finite()) => Err(RayTableError::Rate),
            _ => Ok(Self { rate_hz, ..self }),
        }
    }

    /// The same rays as those of `lines` beams that fire together: the first `lines` rays of the table are the first pulse of
    /// each beam, and so on. Each beam is a row.
    ///
    /// # Errors
    /// [`RayTableError::Lines`] if the rays are no multiple of the lines.
    pub fn with_lines(self, lines: usize) -> Result<Self, RayTableError> {
        match lines {
            0 => Err(RayTableError::Lines),
            lines if !self.pulses.len().is_multiple_of(lines) => Err(RayTableError::Lines),
            lines => Ok(Self { lines, ..self }),
        }
    }

    /// The same rays, of which each beam fires `pulse_rate_hz` a second, whatever times the table has. Call it after
    /// [`Self::with_rate`] and [`Self::with_lines`].
    ///
    /// # Errors
    /// [`RayTableError::PulseRate`] if the rate is not a positive number, or does not give a frame a number of pulses.
    pub fn with_pulse_rate(mut self, pulse_rate_hz: f64) -> Result<Self, RayTableError> {
        let is_rate = pulse_rate_hz > 0.0 && pulse_rate_hz.is_finite();
        let frame = self.rate_hz.map(|rate| super::pulses_a_frame(pulse_rate_hz, rate));
        if !is_rate || frame == Some(None) {
            return Err(RayTableError::PulseRate);
        }
        self.pulse_rate_hz = Some(pulse_rate_hz);
        self.last_pulse_s = (self.columns() - 1) as f64 / pulse_rate_hz;
        Ok(self)
    }

    /// The number of rays of the table.
    #[expect(clippy::len_without_is_empty, reason = "there is at least one")]
    pub fn len(&self) -> usize {
        self.pulses.len()
    }

    /// The number of beams. Each is a row.
    pub fn rows(&self) -> usize {
        self.lines
    }

    /// The number of pulses of a beam in a frame.
    pub fn columns(&self) -> usize {
        let whole = self.pulses.len() / self.lines;
        match (self.pulse_rate_hz, self.rate_hz) {
            (Some(pulses), Some(rate)) => super::pulses_a_frame(pulses, rate).unwrap_or(whole),
            _ => whole,
        }
    }

    /// Whether two tables share their rays in memory. Equal rays are not enough.
    pub fn shares_rays_with(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.pulses, &other.pulses)
    }

    /// Frames a second, if given.
    pub fn rate_hz(&self) -> Option<f64> {
        self.rate_hz
    }

    /// The largest time of a ray, in seconds from the frame's start.
    pub fn last_pulse_s(&self) -> f64 {
        self.last_pulse_s
    }

    /// Pulse number `column` of beam `row` in the frame that starts at `start_s` seconds.
    #[inline]
    pub(super) fn pulse(&self, row: usize, column: usize, start_s: f64) -> Pulse {
        let Some(pulse_rate_hz) = self.pulse_rate_hz else {
            return self.pulses[column * self.lines + row];
        };
        // The pulses before this frame, without whole passes through the table. Frames start a whole number of pulses apart
        // up to rounding.
        let passed = ((start_s * pulse_rate_hz).round() as u64 + column as u64) * self.lines as u64;
        let index = passed % self.pulses.len() as u64 + row as u64;
        Pulse { time_s: column as f64 / pulse_rate_hz, ..self.pulses[index as usize] }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn directions_are_normalised_and_bad_rays_are_refused() {
        let pulse = |direction, time_s| Pulse::new(DVec3::X, direction, time_s);
        let table =
            RayTable::new(vec![pulse(DVec3::Y * 3.0, 0.5), pulse(DVec3::X, 0.25)], Some(2.0)).unwrap();
        assert_eq!((table.len(), table.last_pulse_s(), table.rate_hz()), (2, 0.5, Some(2.0)));
        assert_eq!(table.pulse(0, 0, 0.0), pulse(DVec3::Y, 0.5));
        let new = |list| RayTable::new(list, None).unwrap_err();
        assert_eq!(new(vec![]), RayTableError::Empty);
        assert_eq!(new(vec![pulse(DVec3::X, 0.0), pulse(DVec3::ZERO, 0.0)]), RayTableError::Ray(1));
        assert_eq!(new(vec![pulse(DVec3::X, -1.0)]), RayTableError::Ray(0));
        assert_eq!(new(vec![pulse(DVec3::NAN, 0.0)]), RayTableError::Ray(0));
    }

    /// Six rays of two lines at 20 pulses a second and ten frames a second: two pulses a frame, so that the second frame ends
    /// after the table has begun again.
    #[test]
    fn frames_go_on_through_a_table_with_a_pulse_rate() {
        let rays = (0..6).map(|i| Pulse::new(DVec3::ZERO, DVec3::new(1.0, f64::from(i), 0.0), 100.0));
        let table = RayTable::new(rays.collect(), Some(10.0)).unwrap().with_lines(2).unwrap();
        assert_eq!((table.rows(), table.columns()), (2, 3));
        let table = table.with_pulse_rate(20.0).unwrap();
        assert_eq!((table.rows(), table.columns(), table.last_pulse_s()), (2, 2, 0.05));
        let number = |row, column, start_s| {
            let pulse = table.pulse(row, column, start_s);
            assert_eq!(pulse.time_s, column as f64 / 20.0);
            (pulse.direction.y / pulse.direction.x).round() as i32
        };
        let frame = |start_s| {
            [number(0, 0, start_s), number(1, 0, start_s), number(0, 1, start_s), number(1, 1, start_s)]
        };
        assert_eq!([frame(0.0), frame(0.1), frame(0.2)], [[0, 1, 2, 3], [4, 5, 0, 1], [2, 3, 4, 5]]);
        // The product of a large start and the rate is no index by itself.
        assert_eq!(frame(1e9 * 0.3), frame(0.0));
        assert_eq!(table.clone().with_lines(4), Err(RayTableError::Lines));
        assert_eq!(table.clone().with_lines(0), Err(RayTableError::Lines));
        for wrong in [0.0, -1.0, f64::NAN, 1e-3] {
            assert_eq!(table.clone().with_pulse_rate(wrong), Err(RayTableError::PulseRate), "{wrong}");
        }
    }
}
