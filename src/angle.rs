//! Plane angles. A constructor names the unit, and the value is kept in radians.

use std::ops::{Add, Neg, Sub};

/// A plane angle, made from degrees or radians and kept in radians.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub struct Angle(f64);

impl Angle {
    /// An angle of `degrees`.
    pub fn deg(degrees: f64) -> Self {
        Self(degrees * (std::f64::consts::PI / 180.0))
    }

    /// An angle of `radians`.
    pub fn rad(radians: f64) -> Self {
        Self(radians)
    }

    /// The angle in radians.
    pub fn radians(self) -> f64 {
        self.0
    }

    /// The angle in degrees.
    pub fn degrees(self) -> f64 {
        self.0 * (180.0 / std::f64::consts::PI)
    }

    /// The sine and the cosine of the angle. They come from libm, so that every platform gives the same bits.
    pub fn sin_cos(self) -> (f64, f64) {
        libm::sincos(self.0)
    }
}

impl Add for Angle {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }
}

impl Sub for Angle {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self(self.0 - other.0)
    }
}

impl Neg for Angle {
    type Output = Self;
    fn neg(self) -> Self {
        Self(-self.0)
    }
}
