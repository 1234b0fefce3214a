//! Rays from a table, for any pattern that was measured.

use std::sync::Arc;

use super::Pulse;

/// Rays in the order of the table. Every frame has the same rays.
#[derive(Clone, Debug, PartialEq)]
pub struct RayTable {
    pulses: Arc<[Pulse]>,
    rate_hz: Option<f64>,
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
        Self { pulses: pulses.into(), rate_hz: None, last_pulse_s }.with_rate(rate_hz)
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

    /// The number of rays.
    #[expect(clippy::len_without_is_empty, reason = "there is at least one")]
    pub fn len(&self) -> usize {
        self.pulses.len()
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

    /// The pulse with this index.
    #[inline]
    pub(super) fn pulse(&self, index: usize) -> Pulse {
        self.pulses[index]
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
        assert_eq!(table.pulse(0), pulse(DVec3::Y, 0.5));
        let new = |list| RayTable::new(list, None).unwrap_err();
        assert_eq!(new(vec![]), RayTableError::Empty);
        assert_eq!(new(vec![pulse(DVec3::X, 0.0), pulse(DVec3::ZERO, 0.0)]), RayTableError::Ray(1));
        assert_eq!(new(vec![pulse(DVec3::X, -1.0)]), RayTableError::Ray(0));
        assert_eq!(new(vec![pulse(DVec3::NAN, 0.0)]), RayTableError::Ray(0));
    }
}
