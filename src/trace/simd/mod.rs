//! SIMD vectors for eight rays, boxes or triangles at a time. The traits have three implementations: a portable one, one for AVX2
//! with FMA, and one for AVX-512.
//!
//! In f32 the implementations may differ in the last bit, because a fused multiplication and addition rounds once. No f32 number
//! reaches a result: f32 only makes decisions, and those that are close are made again, exactly (see `packet`). In f64 all
//! implementations have the operations of IEEE 754 and give the same bits.

mod portable;
#[cfg(target_arch = "x86_64")]
mod x86;

use glam::DVec3;

use super::exact::Real;

#[cfg(test)]
pub(super) use portable::PortableF32x8;
pub(super) use portable::run_portably;
#[cfg(all(target_arch = "x86_64", target_os = "linux"))]
pub(super) use x86::prefer_huge_pages;
#[cfg(target_arch = "x86_64")]
pub(super) use x86::{has_avx2, has_avx512, run_with_avx2, run_with_avx512};

/// Asks for huge pages where that can be asked.
#[cfg(not(all(target_arch = "x86_64", target_os = "linux")))]
pub(super) fn prefer_huge_pages<T>(_: &mut Vec<T>) {}

/// The arithmetic of several f32, eight or sixteen, side by side.
pub(super) trait F32Lanes: Copy {
    fn splat(x: f32) -> Self;
    fn add(self, other: Self) -> Self;
    fn sub(self, other: Self) -> Self;
    fn mul(self, other: Self) -> Self;
    fn div(self, other: Self) -> Self;
    /// self · factor + term, rounded once or twice.
    fn mul_add(self, factor: Self, term: Self) -> Self;
    /// self · factor − term, rounded once or twice.
    fn mul_sub(self, factor: Self, term: Self) -> Self;
    /// The lesser of each pair of lanes, or either if one is NaN.
    fn min(self, other: Self) -> Self;
    /// The larger of each pair of lanes, or either if one is NaN.
    fn max(self, other: Self) -> Self;
}

/// Eight f32.
pub(super) trait F32x8: F32Lanes {
    /// A mask with one boolean a lane.
    type Mask8: Mask8;
    /// The vector of u32 of the same implementation.
    type U32x8: U32x8<F32x8 = Self>;
    /// The vector of f64 of the same implementation.
    type F64x8: F64x8<F32x8 = Self>;
    /// The vector of sixteen f32 of the same implementation.
    type F32x16: F32x16<Half = Self>;
    /// Runs a task on this implementation as a function of its own, for code that is to stay out of the caller's.
    fn run<T: SimdTask>(task: T) -> T::Output;
    fn load(x: &[f32; 8]) -> Self;
    fn store(self, to: &mut [f32; 8]);
    /// Bitwise and.
    fn and(self, other: Self) -> Self;
    /// Bitwise exclusive or.
    fn xor(self, other: Self) -> Self;
    /// self ≥ other, which is false for NaN.
    fn ge(self, other: Self) -> Self::Mask8;
    /// self > other, which is false for NaN.
    fn gt(self, other: Self) -> Self::Mask8;
    /// The lanes of `yes` where the mask is true, and of `no` elsewhere.
    fn select(mask: Self::Mask8, yes: Self, no: Self) -> Self;
    /// Looks up three vectors of indices in a table of sixteen values, or of twenty-four if there are `more`: result[k] is
    /// table[from[k]]. Indices outside of the table give an unspecified value.
    fn lookup(first: Self::F32x16, more: Option<Self>, from: [Self::U32x8; 3]) -> [Self; 3];
    /// Permutes the lanes: result[k] = self[from[k] mod 8].
    fn permute(self, from: Self::U32x8) -> Self;
    /// Moves the lanes where the mask is true to the front, in their order. The other lanes are unspecified.
    fn compress(self, mask: Self::Mask8) -> Self;
    /// [`F32x8::compress`], with the mask as the low eight bits of `bits`.
    fn compress_by_bits(self, bits: u32) -> Self;
    /// Moves the first lanes, in their order, to the lanes where the mask is true. The other lanes are those of `others`.
    fn expand(self, mask: Self::Mask8, others: Self) -> Self;
    /// Prefetches a cache line, if the implementation can. Nothing is read, so any address is allowed.
    fn prefetch(address: *const u32);
    /// The least of the lanes.
    fn reduce_min(self) -> f32;
    /// The largest of the lanes.
    fn reduce_max(self) -> f32;
    /// The least lane of each of four vectors.
    fn reduce_min_4(rows: [Self; 4]) -> [f32; 4];
    /// The least lane of each of eight vectors.
    fn reduce_min_8(rows: [Self; 8]) -> Self;
    /// The columns of eight rows: result[k][i] is rows[i][k].
    fn transposed(rows: [Self; 8]) -> [Self; 8];

    /// −self.
    #[inline(always)]
    fn neg(self) -> Self {
        self.xor(Self::splat(-0.0))
    }

    /// The sign bits alone.
    #[inline(always)]
    fn sign_bits(self) -> Self {
        self.and(Self::splat(-0.0))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        self.xor(self.sign_bits())
    }
}

/// Eight booleans, one a lane.
pub(super) trait Mask8: Copy {
    /// The mask that is true in the lanes whose bit is set among the low eight of `bits`.
    fn from_bits(bits: u32) -> Self;
    /// The mask as one bit a lane.
    fn bits(self) -> u32;
    fn and(self, other: Self) -> Self;
    fn or(self, other: Self) -> Self;
}

/// Sixteen f32, in a low and a high half of eight.
pub(super) trait F32x16: F32Lanes {
    type Half: F32x8;
    fn load(x: &[f32; 16]) -> Self;
    fn store(self, to: &mut [f32; 16]);
    fn from_halves(low: Self::Half, high: Self::Half) -> Self;
    /// Broadcasts lane `first`, which is even, to the low half and the next lane to the high half.
    fn broadcast_two(eight: Self::Half, first: usize) -> Self;
    fn abs(self) -> Self;
    /// self ≥ other as one bit a lane, which is 0 for NaN.
    fn ge(self, other: Self) -> u32;
    /// self > other as one bit a lane, which is 0 for NaN.
    fn gt(self, other: Self) -> u32;
    /// The lanes k in which both of `these` are ≥ `those` in both halves (lanes k and k + 8). False for NaN.
    fn all_ge(these: [Self; 2], those: [Self; 2]) -> <Self::Half as F32x8>::Mask8;
    fn halves(self) -> (Self::Half, Self::Half);
    /// The lanes of `yes` whose bit is set, and of `no` elsewhere.
    fn select(bits: u32, yes: Self, no: Self) -> Self;
    /// Stores the lanes whose bit is set next to each other, in their order. The rest of `to` is unspecified.
    fn compress_store(self, bits: u32, to: &mut [f32; 16]);
    /// Loads the first elements of `from`, in their order, to the lanes whose bit is set. The other lanes keep their values.
    fn expand_load(self, bits: u32, from: &[f32; 16]) -> Self;
    /// [`F32x16::expand_load`] of the bits of f32 numbers.
    fn expand_load_u32(self, bits: u32, from: &[u32; 16]) -> Self;
    /// Loads f32 numbers that are given as their bits.
    fn load_u32(x: &[u32; 16]) -> Self;
    /// Stores the bits of the f32 numbers.
    fn store_u32(self, to: &mut [u32; 16]);
}

/// Sixteen f32 as two vectors of eight, for implementations without wider ones.
#[derive(Clone, Copy)]
pub(super) struct TwoF32x8<S>(S, S);

impl<S: F32x8> F32Lanes for TwoF32x8<S> {
    #[inline(always)]
    fn splat(x: f32) -> Self {
        Self(S::splat(x), S::splat(x))
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self(self.0.add(other.0), self.1.add(other.1))
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self(self.0.sub(other.0), self.1.sub(other.1))
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self(self.0.mul(other.0), self.1.mul(other.1))
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        Self(self.0.div(other.0), self.1.div(other.1))
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        Self(self.0.mul_add(factor.0, term.0), self.1.mul_add(factor.1, term.1))
    }

    #[inline(always)]
    fn mul_sub(self, factor: Self, term: Self) -> Self {
        Self(self.0.mul_sub(factor.0, term.0), self.1.mul_sub(factor.1, term.1))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        Self(self.0.min(other.0), self.1.min(other.1))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        Self(self.0.max(other.0), self.1.max(other.1))
    }
}

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
    fn broadcast_two(eight: S, first: usize) -> Self {
        let (low, high) = (S::U32x8::splat(first as u32), S::U32x8::splat(first as u32 + 1));
        Self(eight.permute(low), eight.permute(high))
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
    fn gt(self, other: Self) -> u32 {
        self.0.gt(other.0).bits() | self.1.gt(other.1).bits() << 8
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

/// The masks of the low and the high half.
#[inline(always)]
fn half_masks<S: F32x8>(bits: u32) -> (S::Mask8, S::Mask8) {
    (S::Mask8::from_bits(bits & 0xff), S::Mask8::from_bits(bits >> 8 & 0xff))
}

/// The number of bits of the low half that are set.
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
    /// The lanes where both have a bit in common.
    fn test(self, other: Self) -> <Self::F32x8 as F32x8>::Mask8;
    /// The index of the bit that is set in a lane. Lanes with no bit or several give an unspecified value.
    fn bit_index(self) -> Self;
    /// Widens eight bytes, the lowest first.
    fn from_bytes(bytes: u64) -> Self;
    /// Shifts left by fewer than 32 bits.
    fn shift_left(self, by: Self) -> Self;
    /// Shifts right by fewer than 32 bits.
    fn shift_right(self, by: Self) -> Self;
    /// Gathers words: result[k] = words[at[k]].
    ///
    /// # Panics
    /// If an index is not below the slice's length and 2³¹.
    fn gather(words: &[u32], at: Self) -> Self;
    /// The f32 numbers that have these bits.
    fn bitcast(self) -> Self::F32x8;
    /// The bits of f32 numbers.
    fn bitcast_from(x: Self::F32x8) -> Self;
}

/// Eight f64. The operations are those of IEEE 754, so all implementations give the same bits.
pub(super) trait F64x8: Real {
    type F32x8: F32x8;
    fn load(x: &[f64; 8]) -> Self;
    /// Loads the x, y and z of eight points.
    fn load_xyz(points: &[DVec3; 8]) -> [Self; 3];
    fn store(self, to: &mut [f64; 8]);
    /// Widens f32 numbers, which is exact.
    fn from_f32(x: Self::F32x8) -> Self;
    /// Narrows to f32, rounded to nearest.
    fn to_f32(self) -> Self::F32x8;
}

/// A task that runs with any implementation. `run` must be `#[inline(always)]`, and so must everything that it calls in a loop:
/// code is compiled for the features of a processor only where it is inlined into a function that enables them. (This excludes
/// closures over vectors, which the compiler inlines as it sees fit.)
pub(super) trait SimdTask {
    type Output;
    fn run<S: F32x8>(self) -> Self::Output;
}

/// Vectors of three coordinates, one in each lane.
#[derive(Clone, Copy)]
pub(super) struct Vec3Lanes<L>(pub L, pub L, pub L);

impl<L: F32Lanes> Vec3Lanes<L> {
    #[inline(always)]
    pub fn splat(x: [f32; 3]) -> Self {
        Self(L::splat(x[0]), L::splat(x[1]), L::splat(x[2]))
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

    /// The dot product self · (u, v, 1).
    #[inline(always)]
    pub fn dot_ray(self, [u, v]: [L; 2]) -> L {
        u.mul_add(self.0, v.mul_add(self.1, self.2))
    }

    /// The sum self · other + term.
    #[inline(always)]
    pub fn dot_onto(self, other: Self, term: L) -> L {
        self.0.mul_add(other.0, self.1.mul_add(other.1, self.2.mul_add(other.2, term)))
    }

    /// volume − s·self, for s = (su, sv, 0).
    #[inline(always)]
    pub fn less_offset(self, [su, sv]: [L; 2], volume: L) -> L {
        volume.sub(su.mul_add(self.0, sv.mul(self.1)))
    }
}

impl<S: F32x8> Vec3Lanes<S> {
    /// Negates the lanes where `signs` has the sign bit.
    #[inline(always)]
    pub fn flip_signs(self, signs: S) -> Self {
        Self(self.0.xor(signs), self.1.xor(signs), self.2.xor(signs))
    }

    /// Permutes the lanes as [`F32x8::permute`] does.
    #[inline(always)]
    pub fn permute(self, from: S::U32x8) -> Self {
        Self(self.0.permute(from), self.1.permute(from), self.2.permute(from))
    }

    /// Each coordinate in both halves of a vector of sixteen.
    #[inline(always)]
    pub fn in_both_halves(self) -> Vec3Lanes<S::F32x16> {
        Vec3Lanes(
            S::F32x16::from_halves(self.0, self.0),
            S::F32x16::from_halves(self.1, self.1),
            S::F32x16::from_halves(self.2, self.2),
        )
    }
}

/// a·b − c·d.
#[inline(always)]
fn minor<L: F32Lanes>(a: L, b: L, c: L, d: L) -> L {
    a.mul_sub(b, c.mul(d))
}
