//! Eight f32 in a register, for processors with AVX2 and FMA.
//!
//! The only module with `unsafe`. Each block calls an intrinsic that needs AVX2 or FMA and nothing else (loads and stores
//! take references to whole arrays, unaligned). That the processor has them is the condition under which an [`Avx2`] may be
//! made at all: [`with_avx2`] is the only way into code that makes one, and it asks [`has_avx2`].
#![allow(unsafe_code)]

use std::arch::x86_64::*;

use super::{Doubles, Lanes, Work};
use crate::trace::exact::Real;

/// Eight f32 in a register. Only to be made inside of [`with_avx2`].
#[derive(Clone, Copy)]
pub(in crate::trace) struct Avx2(__m256);

/// Whether this processor has AVX2 and FMA.
#[inline]
pub(in crate::trace) fn has_avx2() -> bool {
    is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")
}

/// Runs `work` on [`Avx2`], compiled for AVX2 and FMA.
///
/// # Panics
/// If the processor lacks them.
#[inline]
pub(in crate::trace) fn with_avx2<W: Work>(work: W) -> W::Output {
    #[target_feature(enable = "avx2,fma")]
    fn enabled<W: Work>(work: W) -> W::Output {
        work.run::<Avx2>()
    }
    assert!(has_avx2());
    // SAFETY: the processor has just said that it has both features.
    unsafe { enabled(work) }
}

impl Lanes for Avx2 {
    type Doubles = Avx2Doubles;

    #[inline(always)]
    fn splat(x: f32) -> Self {
        // SAFETY: AVX, see the module.
        Self(unsafe { _mm256_set1_ps(x) })
    }

    #[inline(always)]
    fn load(x: &[f32; 8]) -> Self {
        // SAFETY: AVX, see the module; the reference covers the 32 bytes read.
        Self(unsafe { _mm256_loadu_ps(x.as_ptr()) })
    }

    #[inline(always)]
    fn load_bits(x: &[u32; 8]) -> Self {
        // SAFETY: as above; every bit pattern is an f32.
        Self(unsafe { _mm256_loadu_ps(x.as_ptr().cast()) })
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; 8]) {
        // SAFETY: AVX, see the module; the reference covers the 32 bytes written.
        unsafe { _mm256_storeu_ps(to.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn store_bits(self, to: &mut [u32; 8]) {
        // SAFETY: as above; every bit pattern is a u32.
        unsafe { _mm256_storeu_ps(to.as_mut_ptr().cast(), self.0) }
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        // SAFETY: AVX, see the module.
        Self(unsafe { _mm256_add_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        // SAFETY: AVX, see the module.
        Self(unsafe { _mm256_sub_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        // SAFETY: AVX, see the module.
        Self(unsafe { _mm256_mul_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        // SAFETY: AVX, see the module.
        Self(unsafe { _mm256_div_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        // SAFETY: FMA, see the module.
        Self(unsafe { _mm256_fmadd_ps(self.0, factor.0, term.0) })
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // SAFETY: AVX, see the module.
        Self(unsafe { _mm256_min_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: AVX, see the module.
        Self(unsafe { _mm256_max_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn and(self, other: Self) -> Self {
        // SAFETY: AVX, see the module.
        Self(unsafe { _mm256_and_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn or(self, other: Self) -> Self {
        // SAFETY: AVX, see the module.
        Self(unsafe { _mm256_or_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn xor(self, other: Self) -> Self {
        // SAFETY: AVX, see the module.
        Self(unsafe { _mm256_xor_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn ge(self, other: Self) -> Self {
        // SAFETY: AVX, see the module.
        Self(unsafe { _mm256_cmp_ps::<_CMP_GE_OQ>(self.0, other.0) })
    }

    #[inline(always)]
    fn select(mask: Self, yes: Self, no: Self) -> Self {
        // SAFETY: AVX, see the module.
        Self(unsafe { _mm256_blendv_ps(no.0, yes.0, mask.0) })
    }

    #[inline(always)]
    fn bits(self) -> u32 {
        // SAFETY: AVX, see the module.
        (unsafe { _mm256_movemask_ps(self.0) }) as u32
    }

    #[inline(always)]
    fn mask(bits: u32) -> Self {
        // SAFETY: AVX2, see the module.
        Self(unsafe {
            let of_lane = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let set = _mm256_and_si256(_mm256_set1_epi32(bits as i32), of_lane);
            _mm256_castsi256_ps(_mm256_cmpeq_epi32(set, of_lane))
        })
    }

    #[inline(always)]
    fn largest(self) -> f32 {
        // SAFETY: AVX, see the module.
        unsafe {
            let four = _mm_max_ps(_mm256_castps256_ps128(self.0), _mm256_extractf128_ps::<1>(self.0));
            let two = _mm_max_ps(four, _mm_movehl_ps(four, four));
            _mm_cvtss_f32(_mm_max_ss(two, _mm_movehdup_ps(two)))
        }
    }

    #[inline(always)]
    fn gather(low: Self, high: Self, indices: u64) -> Self {
        // SAFETY: AVX2, see the module.
        Self(unsafe {
            let lanes = _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(indices as i64));
            let is_high = _mm256_castsi256_ps(_mm256_slli_epi32::<28>(lanes));
            let from_low = _mm256_permutevar8x32_ps(low.0, lanes);
            let from_high = _mm256_permutevar8x32_ps(high.0, lanes);
            _mm256_blendv_ps(from_low, from_high, is_high)
        })
    }

    #[inline(always)]
    fn gather_above_15(below: Self, high: Self, indices: u64) -> Self {
        // SAFETY: AVX2, see the module.
        Self(unsafe {
            let lanes = _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(indices as i64));
            let is_above = _mm256_castsi256_ps(_mm256_slli_epi32::<27>(lanes));
            _mm256_blendv_ps(below.0, _mm256_permutevar8x32_ps(high.0, lanes), is_above)
        })
    }

    #[inline(always)]
    fn prefetch<T>(place: &T) {
        let start = std::ptr::from_ref(place).cast::<i8>();
        for line in (0..size_of::<T>()).step_by(64) {
            // SAFETY: a hint that reads nothing; the address is inside of `place`.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(start.add(line)) }
        }
    }
}

/// Four f64 in a register. Only to be made inside of [`with_avx2`].
#[derive(Clone, Copy)]
pub(in crate::trace) struct Avx2Doubles(__m256d);

impl Doubles for Avx2Doubles {
    #[inline(always)]
    fn load(x: &[f64; 4]) -> Self {
        // SAFETY: AVX, see the module; the reference covers the 32 bytes read.
        Self(unsafe { _mm256_loadu_pd(x.as_ptr()) })
    }

    #[inline(always)]
    fn store(self, to: &mut [f64; 4]) {
        // SAFETY: AVX, see the module; the reference covers the 32 bytes written.
        unsafe { _mm256_storeu_pd(to.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn from_f32(x: [f32; 4]) -> Self {
        // SAFETY: AVX, see the module; the array has the 16 bytes read.
        Self(unsafe { _mm256_cvtps_pd(_mm_loadu_ps(x.as_ptr())) })
    }

    #[inline(always)]
    fn to_f32(self) -> [f32; 4] {
        let mut to = [0.0; 4];
        // SAFETY: AVX, see the module; the array takes the 16 bytes written.
        unsafe { _mm_storeu_ps(to.as_mut_ptr(), _mm256_cvtpd_ps(self.0)) };
        to
    }
}

impl Real for Avx2Doubles {
    #[inline(always)]
    fn splat(x: f64) -> Self {
        // SAFETY: AVX, see the module.
        Self(unsafe { _mm256_set1_pd(x) })
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        // SAFETY: AVX, see the module.
        Self(unsafe { _mm256_add_pd(self.0, other.0) })
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        // SAFETY: AVX, see the module.
        Self(unsafe { _mm256_sub_pd(self.0, other.0) })
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        // SAFETY: AVX, see the module.
        Self(unsafe { _mm256_mul_pd(self.0, other.0) })
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        // SAFETY: AVX, see the module.
        Self(unsafe { _mm256_div_pd(self.0, other.0) })
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // SAFETY: AVX, see the module.
        Self(unsafe { _mm256_min_pd(self.0, other.0) })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: AVX, see the module.
        Self(unsafe { _mm256_max_pd(self.0, other.0) })
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: AVX, see the module.
        Self(unsafe { _mm256_sqrt_pd(self.0) })
    }

    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: AVX, see the module.
        Self(unsafe { _mm256_andnot_pd(_mm256_set1_pd(-0.0), self.0) })
    }

    #[inline(always)]
    fn le(self, other: Self) -> u32 {
        // SAFETY: AVX, see the module.
        (unsafe { _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LE_OQ>(self.0, other.0)) }) as u32
    }
}
