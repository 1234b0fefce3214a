//! The times of a frame.

/// The times of a frame, in seconds on the clock of trajectories and scenes. Both ends belong to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// The first time.
    pub from_s: f64,
    /// The last time.
    pub to_s: f64,
}

impl Window {
    /// Whether a time lies in the window; false for NaN.
    #[inline]
    pub fn contains(&self, time_s: f64) -> bool {
        self.from_s <= time_s && time_s <= self.to_s
    }

    /// The number of equal slices of the window of which none is longer than `longest_s`: 1 without a limit.
    pub fn slices(&self, longest_s: Option<f64>) -> usize {
        let slices = longest_s.map_or(1.0, |longest_s| ((self.to_s - self.from_s) / longest_s).ceil());
        (slices as usize).max(1)
    }

    /// A time at which a slice of several equal ones ends and the next one begins: the window's own ends for 0 and for all of them.
    pub fn end_of_slice(&self, slice: usize, slices: usize) -> f64 {
        if slice == slices {
            return self.to_s;
        }
        self.from_s + (self.to_s - self.from_s) * (slice as f64 / slices as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slices_are_equal_and_no_longer_than_asked() {
        let window = Window { from_s: -0.1, to_s: 0.7 };
        assert_eq!(
            [None, Some(1.0), Some(0.8), Some(0.4), Some(0.3)].map(|s| window.slices(s)),
            [1, 1, 1, 2, 3]
        );
        assert_eq!((window.end_of_slice(0, 3), window.end_of_slice(3, 3)), (-0.1, 0.7));
        assert!((window.end_of_slice(1, 2) - 0.3).abs() < 1e-15);
        let moment = Window { from_s: 2.0, to_s: 2.0 };
        assert_eq!(
            (moment.slices(Some(0.1)), moment.contains(2.0), moment.contains(f64::NAN)),
            (1, true, false)
        );
    }
}
