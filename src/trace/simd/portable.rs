//! The portable implementation, in arrays. It runs on every machine and is the reference for the others.

use std::array::from_fn;

use glam::DVec3;

use super::{F32Lanes, F32x8, F32x16, F64x8, Mask8, SimdTask, TwoF32x8, U32x8};
use crate::trace::exact::Real;

/// Runs a task on [`PortableF32x8`]. It is a function of its own, as the tasks of the other implementations are, because it takes
/// much of the stack.
#[inline(never)]
pub(in crate::trace) fn run_portably<T: SimdTask>(task: T) -> T::Output {
    task.run::<PortableF32x8>()
}

/// Eight f32 in an array.
#[derive(Clone, Copy)]
pub(in crate::trace) struct PortableF32x8([f32; 8]);

impl PortableF32x8 {
    #[inline(always)]
    fn with(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        Self(from_fn(|k| f(self.0[k], other.0[k])))
    }

    #[inline(always)]
    fn with_bits(self, other: Self, f: impl Fn(u32, u32) -> u32) -> Self {
        self.with(other, |a, b| f32::from_bits(f(a.to_bits(), b.to_bits())))
    }
}

impl F32Lanes for PortableF32x8 {
    #[inline(always)]
    fn splat(x: f32) -> Self {
        Self([x; 8])
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
    fn mul_sub(self, factor: Self, term: Self) -> Self {
        Self(from_fn(|k| self.0[k] * factor.0[k] - term.0[k]))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.with(other, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.with(other, |a, b| if a > b { a } else { b })
    }
}

impl F32x8 for PortableF32x8 {
    type Mask8 = PortableMask8;
    type U32x8 = PortableU32x8;
    type F64x8 = PortableF64x8;
    type F32x16 = TwoF32x8<Self>;

    fn run<T: SimdTask>(task: T) -> T::Output {
        run_portably(task)
    }

    #[inline(always)]
    fn load(x: &[f32; 8]) -> Self {
        Self(*x)
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; 8]) {
        *to = self.0;
    }

    #[inline(always)]
    fn and(self, other: Self) -> Self {
        self.with_bits(other, |a, b| a & b)
    }

    #[inline(always)]
    fn xor(self, other: Self) -> Self {
        self.with_bits(other, |a, b| a ^ b)
    }

    #[inline(always)]
    fn ge(self, other: Self) -> PortableMask8 {
        PortableMask8(from_fn(|k| if self.0[k] >= other.0[k] { u32::MAX } else { 0 }))
    }

    #[inline(always)]
    fn gt(self, other: Self) -> PortableMask8 {
        PortableMask8(from_fn(|k| if self.0[k] > other.0[k] { u32::MAX } else { 0 }))
    }

    #[inline(always)]
    fn select(mask: PortableMask8, yes: Self, no: Self) -> Self {
        Self(from_fn(|k| if mask.0[k] != 0 { yes.0[k] } else { no.0[k] }))
    }

    #[inline(always)]
    fn lookup(first: TwoF32x8<Self>, more: Option<Self>, from: [PortableU32x8; 3]) -> [Self; 3] {
        let (low, high) = first.halves();
        let eights = [low, high, more.unwrap_or(low)];
        from.map(|from| Self(from.0.map(|k| eights[k as usize / 8 % 3].0[k as usize % 8])))
    }

    #[inline(always)]
    fn permute(self, from: PortableU32x8) -> Self {
        Self(from.0.map(|k| self.0[k as usize & 7]))
    }

    #[inline(always)]
    fn compress(self, mask: PortableMask8) -> Self {
        let mut first = self;
        let mut count = 0;
        for k in 0..8 {
            first.0[count] = self.0[k];
            count += usize::from(mask.0[k] != 0);
        }
        first
    }

    #[inline(always)]
    fn compress_by_bits(self, bits: u32) -> Self {
        self.compress(PortableMask8::from_bits(bits))
    }

    #[inline(always)]
    fn expand(self, mask: PortableMask8, others: Self) -> Self {
        let mut expanded = others;
        let mut count = 0;
        for k in 0..8 {
            if mask.0[k] != 0 {
                expanded.0[k] = self.0[count];
                count += 1;
            }
        }
        expanded
    }

    #[inline(always)]
    fn prefetch(_: *const u32) {}

    #[inline(always)]
    fn reduce_min(self) -> f32 {
        self.0.into_iter().fold(f32::INFINITY, |a, b| if a < b { a } else { b })
    }

    #[inline(always)]
    fn reduce_max(self) -> f32 {
        self.0.into_iter().fold(f32::NEG_INFINITY, |a, b| if a > b { a } else { b })
    }

    #[inline(always)]
    fn reduce_min_4(rows: [Self; 4]) -> [f32; 4] {
        rows.map(Self::reduce_min)
    }

    #[inline(always)]
    fn transposed(rows: [Self; 8]) -> [Self; 8] {
        from_fn(|column| Self(from_fn(|row| rows[row].0[column])))
    }

    #[inline(always)]
    fn reduce_min_8(rows: [Self; 8]) -> Self {
        Self(rows.map(Self::reduce_min))
    }
}

/// A mask of all ones or all zeros in each lane.
#[derive(Clone, Copy)]
pub(in crate::trace) struct PortableMask8([u32; 8]);

impl Mask8 for PortableMask8 {
    #[inline(always)]
    fn from_bits(bits: u32) -> Self {
        Self(from_fn(|k| if bits >> k & 1 != 0 { u32::MAX } else { 0 }))
    }

    #[inline(always)]
    fn bits(self) -> u32 {
        (0..8).fold(0, |bits, k| bits | (self.0[k] & 1) << k)
    }

    #[inline(always)]
    fn and(self, other: Self) -> Self {
        Self(from_fn(|k| self.0[k] & other.0[k]))
    }

    #[inline(always)]
    fn or(self, other: Self) -> Self {
        Self(from_fn(|k| self.0[k] | other.0[k]))
    }
}

/// Eight u32 in an array.
#[derive(Clone, Copy)]
pub(in crate::trace) struct PortableU32x8([u32; 8]);

impl U32x8 for PortableU32x8 {
    type F32x8 = PortableF32x8;

    #[inline(always)]
    fn splat(x: u32) -> Self {
        Self([x; 8])
    }

    #[inline(always)]
    fn load(x: &[u32; 8]) -> Self {
        Self(*x)
    }

    #[inline(always)]
    fn store(self, to: &mut [u32; 8]) {
        *to = self.0;
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(from_fn(|k| self.0[k].wrapping_add(other.0[k])))
    }

    #[inline(always)]
    fn and(self, other: Self) -> Self {
        Self(from_fn(|k| self.0[k] & other.0[k]))
    }

    #[inline(always)]
    fn or(self, other: Self) -> Self {
        Self(from_fn(|k| self.0[k] | other.0[k]))
    }

    #[inline(always)]
    fn xor(self, other: Self) -> Self {
        Self(from_fn(|k| self.0[k] ^ other.0[k]))
    }

    #[inline(always)]
    fn test(self, other: Self) -> PortableMask8 {
        PortableMask8(from_fn(|k| if self.0[k] & other.0[k] != 0 { u32::MAX } else { 0 }))
    }

    #[inline(always)]
    fn bit_index(self) -> Self {
        Self(self.0.map(u32::trailing_zeros))
    }

    #[inline(always)]
    fn from_bytes(bytes: u64) -> Self {
        Self(bytes.to_le_bytes().map(u32::from))
    }

    #[inline(always)]
    fn shift_left(self, by: Self) -> Self {
        Self(from_fn(|k| self.0[k] << (by.0[k] & 31)))
    }

    #[inline(always)]
    fn shift_right(self, by: Self) -> Self {
        Self(from_fn(|k| self.0[k] >> (by.0[k] & 31)))
    }

    #[inline(always)]
    fn gather(words: &[u32], at: Self) -> Self {
        Self(at.0.map(|at| words[at as usize]))
    }

    #[inline(always)]
    fn bitcast(self) -> PortableF32x8 {
        PortableF32x8(self.0.map(f32::from_bits))
    }

    #[inline(always)]
    fn bitcast_from(x: PortableF32x8) -> Self {
        Self(x.0.map(f32::to_bits))
    }
}

/// Eight f64 in an array.
#[derive(Clone, Copy)]
pub(in crate::trace) struct PortableF64x8([f64; 8]);

impl PortableF64x8 {
    #[inline(always)]
    fn with(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        Self(from_fn(|k| f(self.0[k], other.0[k])))
    }
}

impl F64x8 for PortableF64x8 {
    type F32x8 = PortableF32x8;

    #[inline(always)]
    fn load(x: &[f64; 8]) -> Self {
        Self(*x)
    }

    #[inline(always)]
    fn load_xyz(points: &[DVec3; 8]) -> [Self; 3] {
        [Self(points.map(|p| p.x)), Self(points.map(|p| p.y)), Self(points.map(|p| p.z))]
    }

    #[inline(always)]
    fn store(self, to: &mut [f64; 8]) {
        *to = self.0;
    }

    #[inline(always)]
    fn from_f32(x: PortableF32x8) -> Self {
        Self(x.0.map(f64::from))
    }

    #[inline(always)]
    fn to_f32(self) -> PortableF32x8 {
        PortableF32x8(self.0.map(|x| x as f32))
    }
}

impl Real for PortableF64x8 {
    #[inline(always)]
    fn splat(x: f64) -> Self {
        Self([x; 8])
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
        (0..8).fold(0, |bits, k| bits | u32::from(self.0[k] <= other.0[k]) << k)
    }
}
