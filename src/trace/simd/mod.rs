//! Eight rays, boxes or triangles at a time: one trait, a portable form, and one each for AVX2 with FMA and for AVX-512.
//!
//! In f32 they may differ in the last bit (a fused multiplication and addition rounds once): nothing that is computed with
//! them reaches a result, only decisions that are taken again, exactly, whenever they are close (see `packet`). In f64 they
//! have the operations of IEEE 754 and the same bits.

mod portable;
#[cfg(target_arch = "x86_64")]
mod x86;

use glam::DVec3;

use super::exact::Real;

pub(super) use portable::PortableF32x8;
#[cfg(target_arch = "x86_64")]
pub(super) use x86::{has_avx2, has_avx512, run_with_avx2, run_with_avx512};

/// Eight f32.
pub(super) trait F32x8: Copy {
    /// Eight times true or false.
    type Mask8: Mask8;
    /// The u32 that go with them.
    type U32x8: U32x8<F32x8 = Self>;
    /// The f64 that go with them.
    type F64x8: F64x8<F32x8 = Self>;
    /// Sixteen.
    type F32x16: F32x16<Half = Self>;
    fn splat(x: f32) -> Self;
    fn load(x: &[f32; 8]) -> Self;
    fn store(self, to: &mut [f32; 8]);
    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    fn div(self, other: Self) -> Self;
    /// self · factor + term, rounded once or twice.
    fn mul_add(self, factor: Self, term: Self) -> Self;
    /// self · factor − term, rounded once or twice.
    fn mul_sub(self, factor: Self, term: Self) -> Self;
    /// The lesser; either if one is NaN.
    fn min(self, other: Self) -> Self;
    /// The larger; either if one is NaN.
    fn max(self, other: Self) -> Self;
    /// Of the bits.
    fn and(self, other: Self) -> Self;
    /// Of the bits.
    fn xor(self, other: Self) -> Self;
    /// self ≥ other; false for NaN.
    fn ge(self, other: Self) -> Self::Mask8;
    /// self > other; false for NaN.
    fn gt(self, other: Self) -> Self::Mask8;
    /// Lanes of `yes` where the mask is true, else of `no`.
    fn select(mask: Self::Mask8, yes: Self, no: Self) -> Self;
    /// Lane k is number `from`'s k of the sixteen `first` and, if there are `more`, those after them; anything where there is
    /// none of that number.
    fn lookup(first: Self::F32x16, more: Option<Self>, from: [Self::U32x8; 3]) -> [Self; 3];
    /// Lane k is lane number `from`'s k, of which only the low three bits count.
    fn permute(self, from: Self::U32x8) -> Self;
    /// The lanes where the mask is true, in their order, first; anything after them.
    fn compress(self, mask: Self::Mask8) -> Self;
    /// The lanes whose bit is set in the low eight of `bits`, in their order, first; anything after them.
    fn compress_by_bits(self, bits: u32) -> Self;
    /// The first lanes, in their order, in those where the mask is true; elsewhere `others`.
    fn expand(self, mask: Self::Mask8, others: Self) -> Self;
    /// Asks for a cache line, if the machine has a way to ask. Nothing is read, so the address may be any.
    fn prefetch(address: *const u32);
    /// The least lane.
    fn reduce_min(self) -> f32;
    /// The largest lane.
    fn reduce_max(self) -> f32;
    /// Element k is the least of the lanes of number k.
    fn reduce_min_4(rows: [Self; 4]) -> [f32; 4];
    /// Lane k is the least of the lanes of number k.
    fn reduce_min_8(rows: [Self; 8]) -> Self;

    /// −self.
    #[inline(always)]
    fn neg(self) -> Self {
        self.xor(Self::splat(-0.0))
    }

    /// Only the sign bits.
    #[inline(always)]
    fn sign_bits(self) -> Self {
        self.and(Self::splat(-0.0))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        self.xor(self.sign_bits())
    }
}

/// Eight times true or false.
pub(super) trait Mask8: Copy {
    /// True in the lanes whose bit is set in the low eight of `bits`.
    fn from_bits(bits: u32) -> Self;
    /// One bit a lane.
    fn bits(self) -> u32;
    fn and(self, other: Self) -> Self;
    fn or(self, other: Self) -> Self;
}

/// Sixteen f32: a low and a high half.
pub(super) trait F32x16: Copy {
    type Half: F32x8;
    fn load(x: &[f32; 16]) -> Self;
    fn store(self, to: &mut [f32; 16]);
    fn from_halves(low: Self::Half, high: Self::Half) -> Self;
    fn splat(x: f32) -> Self;
    fn sub(self, other: Self) -> Self;
    /// Lane `first` (which is even) in all of the low half, the next in all of the high one.
    fn broadcast_two(eight: Self::Half, first: usize) -> Self;
    fn mul(self, other: Self) -> Self;
    /// self · factor + term, rounded once or twice.
    fn mul_add(self, factor: Self, term: Self) -> Self;
    /// The lesser; either if one is NaN.
    fn min(self, other: Self) -> Self;
    /// The larger; either if one is NaN.
    fn max(self, other: Self) -> Self;
    fn abs(self) -> Self;
    /// self ≥ other, a bit a lane; false for NaN.
    fn ge(self, other: Self) -> u32;
    /// Where each of `these` ≥ that of `those`, in both halves; false for NaN.
    fn all_ge(these: [Self; 2], those: [Self; 2]) -> <Self::Half as F32x8>::Mask8;
    fn halves(self) -> (Self::Half, Self::Half);
    /// Lanes of `yes` whose bit is set, else of `no`.
    fn select(bits: u32, yes: Self, no: Self) -> Self;
    /// Writes the lanes whose bit is set first, in their order; anything after them.
    fn compress_store(self, bits: u32, to: &mut [f32; 16]);
    /// The first of `from`, in their order, in the lanes whose bit is set; elsewhere self.
    fn expand_load(self, bits: u32, from: &[f32; 16]) -> Self;
    /// The same, of f32 with these bits.
    fn expand_load_u32(self, bits: u32, from: &[u32; 16]) -> Self;
    /// f32 of these bits.
    fn load_u32(x: &[u32; 16]) -> Self;
    /// The bits of f32.
    fn store_u32(self, to: &mut [u32; 16]);
}

/// Sixteen f32 as two times eight.
#[derive(Clone, Copy)]
pub(super) struct TwoF32x8<S>(S, S);

impl<S: F32x8> F32x16 for TwoF32x8<S> {
    type Half = S;

    #[inline(always)]
    fn load(x: &[f32; 16]) -> Self {
        Self(S::load(x[..8].try_into().unwrap()), S::load(x[8..].try_into().unwrap()))
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; 16]) {
        self.0.store((&mut to[..8]).try_into().unwrap());
        self.1.store((&mut to[8..]).try_into().unwrap());
    }

    #[inline(always)]
    fn from_halves(low: S, high: S) -> Self {
        Self(low, high)
    }

    #[inline(always)]
    fn splat(x: f32) -> Self {
        Self(S::splat(x), S::splat(x))
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(self.0.sub(other.0), self.1.sub(other.1))
    }

    #[inline(always)]
    fn broadcast_two(eight: S, first: usize) -> Self {
        let (low, high) = (S::U32x8::splat(first as u32), S::U32x8::splat(first as u32 + 1));
        Self(eight.permute(low), eight.permute(high))
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(self.0.mul(other.0), self.1.mul(other.1))
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        Self(self.0.mul_add(factor.0, term.0), self.1.mul_add(factor.1, term.1))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(self.0.min(other.0), self.1.min(other.1))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(self.0.max(other.0), self.1.max(other.1))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        Self(self.0.abs(), self.1.abs())
    }

    #[inline(always)]
    fn ge(self, other: Self) -> u32 {
        self.0.ge(other.0).bits() | self.1.ge(other.1).bits() << 8
    }

    #[inline(always)]
    fn all_ge([p, q]: [Self; 2], [r, s]: [Self; 2]) -> S::Mask8 {
        p.0.ge(r.0).and(p.1.ge(r.1)).and(q.0.ge(s.0).and(q.1.ge(s.1)))
    }

    #[inline(always)]
    fn halves(self) -> (S, S) {
        (self.0, self.1)
    }

    #[inline(always)]
    fn select(bits: u32, yes: Self, no: Self) -> Self {
        let (low, high) = half_masks::<S>(bits);
        Self(S::select(low, yes.0, no.0), S::select(high, yes.1, no.1))
    }

    #[inline(always)]
    fn compress_store(self, bits: u32, to: &mut [f32; 16]) {
        let (low, high) = half_masks::<S>(bits);
        let count = low_half_count(bits);
        self.0.compress(low).store((&mut to[..8]).try_into().unwrap());
        self.1.compress(high).store((&mut to[count..count + 8]).try_into().unwrap());
    }

    #[inline(always)]
    fn expand_load(self, bits: u32, from: &[f32; 16]) -> Self {
        let (low, high) = half_masks::<S>(bits);
        let count = low_half_count(bits);
        let (a, b) =
            (S::load(from[..8].try_into().unwrap()), S::load(from[count..count + 8].try_into().unwrap()));
        Self(a.expand(low, self.0), b.expand(high, self.1))
    }

    #[inline(always)]
    fn expand_load_u32(self, bits: u32, from: &[u32; 16]) -> Self {
        let (low, high) = half_masks::<S>(bits);
        let count = low_half_count(bits);
        let a = S::U32x8::load(from[..8].try_into().unwrap()).bitcast();
        let b = S::U32x8::load(from[count..count + 8].try_into().unwrap()).bitcast();
        Self(a.expand(low, self.0), b.expand(high, self.1))
    }

    #[inline(always)]
    fn load_u32(x: &[u32; 16]) -> Self {
        let (low, high) = (x[..8].try_into().unwrap(), x[8..].try_into().unwrap());
        Self(S::U32x8::load(low).bitcast(), S::U32x8::load(high).bitcast())
    }

    #[inline(always)]
    fn store_u32(self, to: &mut [u32; 16]) {
        S::U32x8::bitcast_from(self.0).store((&mut to[..8]).try_into().unwrap());
        S::U32x8::bitcast_from(self.1).store((&mut to[8..]).try_into().unwrap());
    }
}

/// The masks of both halves.
#[inline(always)]
fn half_masks<S: F32x8>(bits: u32) -> (S::Mask8, S::Mask8) {
    (S::Mask8::from_bits(bits & 0xff), S::Mask8::from_bits(bits >> 8 & 0xff))
}

/// How many bits of the low half are set.
#[inline(always)]
fn low_half_count(bits: u32) -> usize {
    (bits & 0xff).count_ones() as usize
}

/// Eight u32.
pub(super) trait U32x8: Copy {
    type F32x8: F32x8;
    fn splat(x: u32) -> Self;
    fn load(x: &[u32; 8]) -> Self;
    fn store(self, to: &mut [u32; 8]);
    fn add(self, other: Self) -> Self;
    fn and(self, other: Self) -> Self;
    fn or(self, other: Self) -> Self;
    fn xor(self, other: Self) -> Self;
    /// Where they have a bit in common.
    fn test(self, other: Self) -> <Self::F32x8 as F32x8>::Mask8;
    /// Which bit it is, of numbers with one bit; anything for others.
    fn bit_index(self) -> Self;
    /// A byte each, the lowest first.
    fn from_bytes(bytes: u64) -> Self;
    /// By fewer than 32 bits.
    fn shift_left(self, by: Self) -> Self;
    /// By fewer than 32 bits.
    fn shift_right(self, by: Self) -> Self;
    /// `words[at]`.
    ///
    /// # Panics
    /// If an index is not below the slice's length and 2³¹.
    fn gather(words: &[u32], at: Self) -> Self;
    /// f32 of these bits.
    fn bitcast(self) -> Self::F32x8;
    /// The bits of f32.
    fn bitcast_from(x: Self::F32x8) -> Self;
}

/// Eight f64, whose operations are those of IEEE 754: the same bits from every kind.
pub(super) trait F64x8: Real {
    type F32x8: F32x8;
    fn load(x: &[f64; 8]) -> Self;
    /// x, y and z of points.
    fn load_xyz(points: &[DVec3; 8]) -> [Self; 3];
    fn store(self, to: &mut [f64; 8]);
    /// The same numbers.
    fn from_f32(x: Self::F32x8) -> Self;
    /// Rounded to nearest.
    fn to_f32(self) -> Self::F32x8;
}

/// Something to be done with any kind of lanes. `run` must be `#[inline(always)]`, and so must all that it calls in a loop:
/// code is compiled for a processor's features only where it is inlined into a function that has them. (So no closures over
/// lanes: the compiler inlines these as it sees fit.)
pub(super) trait SimdTask {
    type Output;
    fn run<S: F32x8>(self) -> Self::Output;
}

/// Three coordinates, eight of each.
#[derive(Clone, Copy)]
pub(super) struct Vec3x8<S>(pub S, pub S, pub S);

impl<S: F32x8> Vec3x8<S> {
    #[inline(always)]
    pub fn splat(x: [f32; 3]) -> Self {
        Self(S::splat(x[0]), S::splat(x[1]), S::splat(x[2]))
    }

    #[inline(always)]
    pub fn add(self, other: Self) -> Self {
        Self(self.0.add(other.0), self.1.add(other.1), self.2.add(other.2))
    }

    #[inline(always)]
    pub fn sub(self, other: Self) -> Self {
        Self(self.0.sub(other.0), self.1.sub(other.1), self.2.sub(other.2))
    }

    #[inline(always)]
    pub fn cross(self, q: Self) -> Self {
        Self(
            minor(self.1, q.2, self.2, q.1),
            minor(self.2, q.0, self.0, q.2),
            minor(self.0, q.1, self.1, q.0),
        )
    }

    /// self · (u, v, 1).
    #[inline(always)]
    pub fn dot_ray(self, u: S, v: S) -> S {
        u.mul_add(self.0, v.mul_add(self.1, self.2))
    }

    /// volume − s·self, for the s whose 2·(g × s) is `moment`: (s_u, s_v) = (m_v, −m_u)/2.
    #[inline(always)]
    pub fn less_offset(self, moment: Self, volume: S) -> S {
        let (half_u, half_v) = (self.0.mul(S::splat(0.5)), self.1.mul(S::splat(-0.5)));
        let shift = moment.1.mul_add(half_u, moment.0.mul(half_v));
        volume.sub(shift)
    }

    /// Turns over the coordinates of lanes where `signs` has the sign bit.
    #[inline(always)]
    pub fn flip_signs(self, signs: S) -> Self {
        Self(self.0.xor(signs), self.1.xor(signs), self.2.xor(signs))
    }

    /// Each coordinate in both halves.
    #[inline(always)]
    pub fn in_both_halves(self) -> [S::F32x16; 3] {
        [
            S::F32x16::from_halves(self.0, self.0),
            S::F32x16::from_halves(self.1, self.1),
            S::F32x16::from_halves(self.2, self.2),
        ]
    }
}

/// a·b − c·d.
#[inline(always)]
fn minor<S: F32x8>(a: S, b: S, c: S, d: S) -> S {
    a.mul_sub(b, c.mul(d))
}
