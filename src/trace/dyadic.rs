//! Exact arithmetic: numbers m·2^e with m of any size, as which every finite f32 and f64 can be written.

use std::ops::{Add, Mul, Neg, Sub};

use num_bigint::{BigInt, Sign};

/// The number m·2^e.
#[derive(Clone, Debug)]
pub(super) struct Dyadic {
    m: BigInt,
    e: i64,
}

impl Dyadic {
    /// A finite number.
    pub fn of(x: f64) -> Self {
        debug_assert!(x.is_finite());
        let (fraction, exponent) = libm::frexp(x);
        Self { m: BigInt::from(libm::ldexp(fraction, 53) as i64), e: i64::from(exponent) - 53 }
    }

    #[cfg(test)]
    pub fn abs(self) -> Self {
        if self.m.sign() == Sign::Minus { -self } else { self }
    }

    /// −1, 0 or 1.
    pub fn sign(&self) -> i8 {
        match self.m.sign() {
            Sign::Minus => -1,
            Sign::NoSign => 0,
            Sign::Plus => 1,
        }
    }

    /// The number rounded to f64, to within a few units of its last place.
    #[cfg(test)]
    pub fn to_f64(&self) -> f64 {
        let extra = (self.m.bits() as i64 - 62).max(0);
        let leading = i64::try_from(&self.m >> extra).expect("62 bits and a sign");
        libm::ldexp(leading as f64, (self.e + extra).clamp(-5000, 5000) as i32)
    }
}

impl Add for Dyadic {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        let e = self.e.min(other.e);
        Self { m: (self.m << (self.e - e)) + (other.m << (other.e - e)), e }
    }
}

impl Neg for Dyadic {
    type Output = Self;

    fn neg(self) -> Self {
        Self { m: -self.m, e: self.e }
    }
}

impl Sub for Dyadic {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Mul for Dyadic {
    type Output = Self;

    fn mul(self, other: Self) -> Self {
        Self { m: self.m * other.m, e: self.e + other.e }
    }
}

/// The determinant of three rows.
pub(super) fn determinant(a: &[Dyadic; 3], b: &[Dyadic; 3], c: &[Dyadic; 3]) -> Dyadic {
    dot(a, &cross(b, c))
}

pub(super) fn dot(a: &[Dyadic; 3], b: &[Dyadic; 3]) -> Dyadic {
    let term = |k: usize| a[k].clone() * b[k].clone();
    term(0) + term(1) + term(2)
}

pub(super) fn cross(a: &[Dyadic; 3], b: &[Dyadic; 3]) -> [Dyadic; 3] {
    let minor = |j: usize, k: usize| a[j].clone() * b[k].clone() - a[k].clone() * b[j].clone();
    [minor(1, 2), minor(2, 0), minor(0, 1)]
}

#[cfg(test)]
pub(super) fn difference(a: &[Dyadic; 3], b: &[Dyadic; 3]) -> [Dyadic; 3] {
    [0, 1, 2].map(|k| a[k].clone() - b[k].clone())
}
