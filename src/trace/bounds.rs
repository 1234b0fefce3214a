//! Axis-aligned bounding boxes in f64.

use glam::DVec3;

/// An axis-aligned box, by its lowest and highest corner.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub low: DVec3,
    pub high: DVec3,
}

impl Bounds {
    /// The box of no points: low is +∞ and high −∞.
    pub const EMPTY: Self = Self { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY };

    /// The smallest box around this one and a point.
    pub fn with(self, p: DVec3) -> Self {
        Self { low: self.low.min(p), high: self.high.max(p) }
    }

    /// The smallest box around both.
    pub fn union(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    /// The largest |coordinate| of the box.
    pub fn largest(&self) -> f64 {
        self.low.abs().max(self.high.abs()).max_element()
    }
}
