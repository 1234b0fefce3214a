//! Axis-aligned bounding boxes in f64.

use glam::DVec3;

/// An axis-aligned box, by its lowest and highest corner.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bounds {
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

    /// Whether the box holds nothing.
    pub fn is_empty(&self) -> bool {
        self.low.x > self.high.x
    }

    /// Whether a point lies in the box or on its sides.
    pub fn contains(&self, p: DVec3) -> bool {
        self.low.cmple(p).all() && p.cmple(self.high).all()
    }

    /// The corners of the box.
    pub fn corners(self) -> impl Iterator<Item = DVec3> {
        (0..8).map(move |corner| {
            let side = |axis: usize| if corner >> axis & 1 == 0 { self.low[axis] } else { self.high[axis] };
            DVec3::new(side(0), side(1), side(2))
        })
    }

    /// Half of the largest side.
    pub fn half_extent(&self) -> f64 {
        ((self.high - self.low) / 2.0).max_element()
    }

    /// The middle of the box, rounded to a multiple of `grid`, if that is a number greater than 0.
    pub fn middle(&self, grid: f64) -> DVec3 {
        let middle = self.low / 2.0 + self.high / 2.0;
        if grid > 0.0 && grid.is_finite() { (middle / grid).round() * grid } else { middle }
    }

    /// The largest |coordinate| of the box.
    pub fn largest(&self) -> f64 {
        self.low.abs().max(self.high.abs()).max_element()
    }
}
