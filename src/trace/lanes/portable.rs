//! Eight f32 in an array: for every machine, and what others are compared with.

use std::array::from_fn;

use super::{Doubles, Lanes};
use crate::trace::exact::Real;

#[derive(Clone, Copy)]
pub(in crate::trace) struct Portable([f32; 8]);

#[inline(always)]
fn mask(yes: bool) -> f32 {
    f32::from_bits(if yes { u32::MAX } else { 0 })
}

impl Portable {
    #[inline(always)]
    fn with(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Self(from_fn(|k| f(self.0[k], other.0[k])))
    }

    #[inline(always)]
    fn with_bits(self, other: Self, f: impl Fn(u32, u32) -> u32) -> Self {
        self.with(other, |a, b| f32::from_bits(f(a.to_bits(), b.to_bits())))
    }
}

impl Lanes for Portable {
    type Doubles = PortableDoubles;

    #[inline(always)]
    fn splat(x: f32) -> Self {
        Self([x; 8])
    }

    #[inline(always)]
    fn load(x: &[f32; 8]) -> Self {
        Self(*x)
    }

    #[inline(always)]
    fn load_bits(x: &[u32; 8]) -> Self {
        Self(x.map(f32::from_bits))
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; 8]) {
        *to = self.0;
    }

    #[inline(always)]
    fn store_bits(self, to: &mut [u32; 8]) {
        *to = self.0.map(f32::to_bits);
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.with(other, |a, b| a + b)
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.with(other, |a, b| a - b)
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.with(other, |a, b| a * b)
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.with(other, |a, b| a / b)
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        Self(from_fn(|k| self.0[k] * factor.0[k] + term.0[k]))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.with(other, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.with(other, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn and(self, other: Self) -> Self {
        self.with_bits(other, |a, b| a & b)
    }

    #[inline(always)]
    fn or(self, other: Self) -> Self {
        self.with_bits(other, |a, b| a | b)
    }

    #[inline(always)]
    fn xor(self, other: Self) -> Self {
        self.with_bits(other, |a, b| a ^ b)
    }

    #[inline(always)]
    fn ge(self, other: Self) -> Self {
        self.with(other, |a, b| mask(a >= b))
    }

    #[inline(always)]
    fn select(mask: Self, yes: Self, no: Self) -> Self {
        Self(from_fn(|k| if mask.0[k].to_bits() >> 31 != 0 { yes.0[k] } else { no.0[k] }))
    }

    #[inline(always)]
    fn bits(self) -> u32 {
        (0..8).fold(0, |bits, k| bits | (self.0[k].to_bits() >> 31) << k)
    }

    #[inline(always)]
    fn mask(bits: u32) -> Self {
        Self(from_fn(|k| mask(bits >> k & 1 != 0)))
    }

    #[inline(always)]
    fn largest(self) -> f32 {
        self.0.into_iter().fold(f32::NEG_INFINITY, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn gather(low: Self, high: Self, indices: u64) -> Self {
        let bytes = indices.to_le_bytes();
        Self(from_fn(|k| {
            let index = bytes[k] as usize & 15;
            if index < 8 { low.0[index] } else { high.0[index - 8] }
        }))
    }

    #[inline(always)]
    fn gather_above_15(below: Self, high: Self, indices: u64) -> Self {
        let bytes = indices.to_le_bytes();
        Self(from_fn(|k| if bytes[k] < 16 { below.0[k] } else { high.0[bytes[k] as usize & 7] }))
    }

    #[inline(always)]
    fn prefetch<T>(_: &T) {}
}

/// Four f64 in an array.
#[derive(Clone, Copy)]
pub(in crate::trace) struct PortableDoubles([f64; 4]);

impl PortableDoubles {
    #[inline(always)]
    fn with(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        Self(from_fn(|k| f(self.0[k], other.0[k])))
    }
}

impl Doubles for PortableDoubles {
    #[inline(always)]
    fn load(x: &[f64; 4]) -> Self {
        Self(*x)
    }

    #[inline(always)]
    fn store(self, to: &mut [f64; 4]) {
        *to = self.0;
    }

    #[inline(always)]
    fn from_f32(x: [f32; 4]) -> Self {
        Self(x.map(f64::from))
    }

    #[inline(always)]
    fn to_f32(self) -> [f32; 4] {
        self.0.map(|x| x as f32)
    }
}

impl Real for PortableDoubles {
    #[inline(always)]
    fn splat(x: f64) -> Self {
        Self([x; 4])
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.with(other, Real::add)
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.with(other, Real::sub)
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.with(other, Real::mul)
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.with(other, Real::div)
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.with(other, Real::min)
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.with(other, Real::max)
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(f64::sqrt))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.map(f64::abs))
    }

    #[inline(always)]
    fn le(self, other: Self) -> u32 {
        (0..4).fold(0, |bits, k| bits | u32::from(self.0[k] <= other.0[k]) << k)
    }
}
