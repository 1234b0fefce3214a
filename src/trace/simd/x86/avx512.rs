//! The implementation for AVX-512, which has masks of one bit a lane, permutations of two registers, and registers of 512 bits for
//! sixteen f32 or eight f64.

use std::arch::x86_64::*;

use glam::DVec3;

use super::shared::{f32x8_arithmetic, f32x8_methods, u32x8_methods};
use crate::trace::exact::Real;
use crate::trace::simd::{F32Lanes, F32x8, F32x16, F64x8, Mask8, SimdTask, U32x8};

/// Eight f32 in a register. It is made only by code that `run_with_avx512` calls.
#[derive(Clone, Copy)]
pub(in crate::trace) struct Avx512F32x8(__m256);

impl F32Lanes for Avx512F32x8 {
    f32x8_arithmetic!();
}

impl F32x8 for Avx512F32x8 {
    type Mask8 = Avx512Mask8;
    type U32x8 = Avx512U32x8;
    type F64x8 = Avx512F64x8;
    type F32x16 = Avx512F32x16;

    fn run<T: SimdTask>(task: T) -> T::Output {
        super::run_with_avx512(task)
    }

    f32x8_methods!();

    #[inline(always)]
    fn ge(self, other: Self) -> Avx512Mask8 {
        // SAFETY: AVX-512, see `x86`.
        Avx512Mask8(unsafe { _mm256_cmp_ps_mask::<_CMP_GE_OQ>(self.0, other.0) })
    }

    #[inline(always)]
    fn gt(self, other: Self) -> Avx512Mask8 {
        // SAFETY: AVX-512, see `x86`.
        Avx512Mask8(unsafe { _mm256_cmp_ps_mask::<_CMP_GT_OQ>(self.0, other.0) })
    }

    #[inline(always)]
    fn select(mask: Avx512Mask8, yes: Self, no: Self) -> Self {
        // SAFETY: AVX-512, see `x86`.
        Self(unsafe { _mm256_mask_blend_ps(mask.0, no.0, yes.0) })
    }

    #[inline(always)]
    fn lookup(first: Avx512F32x16, more: Option<Self>, from: [Avx512U32x8; 3]) -> [Self; 3] {
        let [a, b, c] = from;
        let first = first.0;
        // SAFETY: AVX-512, see `x86`.
        unsafe {
            let (a, b, c) =
                (_mm512_castsi256_si512(a.0), _mm512_castsi256_si512(b.0), _mm512_castsi256_si512(c.0));
            let [a, b, c] = if let Some(more) = more {
                let more = _mm512_castps256_ps512(more.0);
                [
                    _mm512_permutex2var_ps(first, a, more),
                    _mm512_permutex2var_ps(first, b, more),
                    _mm512_permutex2var_ps(first, c, more),
                ]
            } else {
                [
                    _mm512_permutexvar_ps(a, first),
                    _mm512_permutexvar_ps(b, first),
                    _mm512_permutexvar_ps(c, first),
                ]
            };
            [
                Self(_mm512_castps512_ps256(a)),
                Self(_mm512_castps512_ps256(b)),
                Self(_mm512_castps512_ps256(c)),
            ]
        }
    }

    #[inline(always)]
    fn compress(self, mask: Avx512Mask8) -> Self {
        // SAFETY: AVX-512, see `x86`.
        Self(unsafe { _mm256_maskz_compress_ps(mask.0, self.0) })
    }

    #[inline(always)]
    fn compress_by_bits(self, bits: u32) -> Self {
        self.compress(Avx512Mask8::from_bits(bits))
    }

    #[inline(always)]
    fn expand(self, mask: Avx512Mask8, others: Self) -> Self {
        // SAFETY: AVX-512, see `x86`.
        Self(unsafe { _mm256_mask_expand_ps(others.0, mask.0, self.0) })
    }
}

/// A mask of one bit a lane.
#[derive(Clone, Copy)]
pub(in crate::trace) struct Avx512Mask8(__mmask8);

impl Mask8 for Avx512Mask8 {
    #[inline(always)]
    fn from_bits(bits: u32) -> Self {
        Self(bits as __mmask8)
    }

    #[inline(always)]
    fn bits(self) -> u32 {
        u32::from(self.0)
    }

    #[inline(always)]
    fn and(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    #[inline(always)]
    fn or(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

/// Sixteen f32 in a register.
#[derive(Clone, Copy)]
pub(in crate::trace) struct Avx512F32x16(__m512);

impl F32Lanes for Avx512F32x16 {
    #[inline(always)]
    fn splat(x: f32) -> Self {
        // SAFETY: AVX-512, see `x86`.
        Self(unsafe { _mm512_set1_ps(x) })
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        // SAFETY: AVX-512, see `x86`.
        Self(unsafe { _mm512_add_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        // SAFETY: AVX-512, see `x86`.
        Self(unsafe { _mm512_sub_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        // SAFETY: AVX-512, see `x86`.
        Self(unsafe { _mm512_mul_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        // SAFETY: AVX-512, see `x86`.
        Self(unsafe { _mm512_div_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        // SAFETY: AVX-512, see `x86`.
        Self(unsafe { _mm512_fmadd_ps(self.0, factor.0, term.0) })
    }

    #[inline(always)]
    fn mul_sub(self, factor: Self, term: Self) -> Self {
        // SAFETY: AVX-512, see `x86`.
        Self(unsafe { _mm512_fmsub_ps(self.0, factor.0, term.0) })
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // SAFETY: AVX-512, see `x86`.
        Self(unsafe { _mm512_min_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: AVX-512, see `x86`.
        Self(unsafe { _mm512_max_ps(self.0, other.0) })
    }
}

impl F32x16 for Avx512F32x16 {
    type Half = Avx512F32x8;

    #[inline(always)]
    fn load(x: &[f32; 16]) -> Self {
        // SAFETY: AVX-512, see `x86`; the reference covers the 64 bytes read.
        Self(unsafe { _mm512_loadu_ps(x.as_ptr()) })
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; 16]) {
        // SAFETY: AVX-512, see `x86`; the reference covers the 64 bytes written.
        unsafe { _mm512_storeu_ps(to.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn from_halves(low: Avx512F32x8, high: Avx512F32x8) -> Self {
        // SAFETY: AVX-512, see `x86`.
        Self(unsafe { _mm512_insertf32x8::<1>(_mm512_castps256_ps512(low.0), high.0) })
    }

    #[inline(always)]
    fn broadcast_two(eight: Avx512F32x8, first: usize) -> Self {
        // SAFETY: AVX-512, see `x86`.
        Self(unsafe {
            let halves = _mm512_setr_epi32(0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1);
            let from = _mm512_add_epi32(halves, _mm512_set1_epi32(first as i32));
            _mm512_permutexvar_ps(from, _mm512_castps256_ps512(eight.0))
        })
    }

    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: AVX-512, see `x86`.
        Self(unsafe { _mm512_abs_ps(self.0) })
    }

    #[inline(always)]
    fn ge(self, other: Self) -> u32 {
        // SAFETY: AVX-512, see `x86`.
        u32::from(unsafe { _mm512_cmp_ps_mask::<_CMP_GE_OQ>(self.0, other.0) })
    }

    #[inline(always)]
    fn gt(self, other: Self) -> u32 {
        // SAFETY: AVX-512, see `x86`.
        u32::from(unsafe { _mm512_cmp_ps_mask::<_CMP_GT_OQ>(self.0, other.0) })
    }

    #[inline(always)]
    fn all_ge([p, q]: [Self; 2], [r, s]: [Self; 2]) -> Avx512Mask8 {
        // SAFETY: AVX-512, see `x86`.
        let sixteen = unsafe {
            _mm512_mask_cmp_ps_mask::<_CMP_GE_OQ>(_mm512_cmp_ps_mask::<_CMP_GE_OQ>(p.0, r.0), q.0, s.0)
        };
        Avx512Mask8((sixteen & sixteen >> 8) as __mmask8)
    }

    #[inline(always)]
    fn halves(self) -> (Avx512F32x8, Avx512F32x8) {
        // SAFETY: AVX-512, see `x86`.
        unsafe {
            (Avx512F32x8(_mm512_castps512_ps256(self.0)), Avx512F32x8(_mm512_extractf32x8_ps::<1>(self.0)))
        }
    }

    #[inline(always)]
    fn select(bits: u32, yes: Self, no: Self) -> Self {
        // SAFETY: AVX-512, see `x86`.
        Self(unsafe { _mm512_mask_blend_ps(bits as __mmask16, no.0, yes.0) })
    }

    #[inline(always)]
    fn compress_store(self, bits: u32, to: &mut [f32; 16]) {
        // SAFETY: AVX-512, see `x86`; the reference covers the 64 bytes written.
        unsafe {
            _mm512_storeu_ps(to.as_mut_ptr(), _mm512_maskz_compress_ps(bits as __mmask16, self.0));
        }
    }

    #[inline(always)]
    fn expand_load(self, bits: u32, from: &[f32; 16]) -> Self {
        // SAFETY: AVX-512, see `x86`; the reference covers the 64 bytes read.
        Self(unsafe { _mm512_mask_expand_ps(self.0, bits as __mmask16, _mm512_loadu_ps(from.as_ptr())) })
    }

    #[inline(always)]
    fn expand_load_u32(self, bits: u32, from: &[u32; 16]) -> Self {
        // SAFETY: AVX-512, see `x86`; the reference covers the 64 bytes read.
        Self(unsafe {
            _mm512_mask_expand_ps(self.0, bits as __mmask16, _mm512_loadu_ps(from.as_ptr().cast()))
        })
    }

    #[inline(always)]
    fn load_u32(x: &[u32; 16]) -> Self {
        // SAFETY: AVX-512, see `x86`; the reference covers the 64 bytes read.
        Self(unsafe { _mm512_loadu_ps(x.as_ptr().cast()) })
    }

    #[inline(always)]
    fn store_u32(self, to: &mut [u32; 16]) {
        // SAFETY: AVX-512, see `x86`; the reference covers the 64 bytes written.
        unsafe { _mm512_storeu_ps(to.as_mut_ptr().cast(), self.0) }
    }
}

/// Eight u32 in a register.
#[derive(Clone, Copy)]
pub(in crate::trace) struct Avx512U32x8(__m256i);

impl U32x8 for Avx512U32x8 {
    type F32x8 = Avx512F32x8;

    u32x8_methods!();

    #[inline(always)]
    fn test(self, other: Self) -> Avx512Mask8 {
        // SAFETY: AVX-512, see `x86`.
        Avx512Mask8(unsafe { _mm256_test_epi32_mask(self.0, other.0) })
    }

    #[inline(always)]
    fn bitcast(self) -> Avx512F32x8 {
        // SAFETY: AVX, see `x86`.
        Avx512F32x8(unsafe { _mm256_castsi256_ps(self.0) })
    }

    #[inline(always)]
    fn bitcast_from(x: Avx512F32x8) -> Self {
        // SAFETY: AVX, see `x86`.
        Self(unsafe { _mm256_castps_si256(x.0) })
    }
}

/// Eight f64 in a register.
#[derive(Clone, Copy)]
pub(in crate::trace) struct Avx512F64x8(__m512d);

impl F64x8 for Avx512F64x8 {
    type F32x8 = Avx512F32x8;

    #[inline(always)]
    fn load(x: &[f64; 8]) -> Self {
        // SAFETY: AVX-512, see `x86`; the reference covers the 64 bytes read.
        Self(unsafe { _mm512_loadu_pd(x.as_ptr()) })
    }

    #[inline(always)]
    fn load_xyz(points: &[DVec3; 8]) -> [Self; 3] {
        let start = points.as_ptr().cast::<f64>();
        // SAFETY: AVX-512, see `x86`; a DVec3 is three f64, and the reference covers the 192 bytes read.
        unsafe {
            let a = _mm512_loadu_pd(start); // x y z x y z x y
            let b = _mm512_loadu_pd(start.add(8)); // z x y z x y z x
            let c = _mm512_loadu_pd(start.add(16)); // y z x y z x y z
            let x = _mm512_permutex2var_pd(a, _mm512_setr_epi64(0, 3, 6, 9, 12, 15, 0, 0), b);
            let y = _mm512_permutex2var_pd(a, _mm512_setr_epi64(1, 4, 7, 10, 13, 0, 0, 0), b);
            let z = _mm512_permutex2var_pd(a, _mm512_setr_epi64(2, 5, 8, 11, 14, 0, 0, 0), b);
            [
                Self(_mm512_permutex2var_pd(x, _mm512_setr_epi64(0, 1, 2, 3, 4, 5, 10, 13), c)),
                Self(_mm512_permutex2var_pd(y, _mm512_setr_epi64(0, 1, 2, 3, 4, 8, 11, 14), c)),
                Self(_mm512_permutex2var_pd(z, _mm512_setr_epi64(0, 1, 2, 3, 4, 9, 12, 15), c)),
            ]
        }
    }

    #[inline(always)]
    fn store(self, to: &mut [f64; 8]) {
        // SAFETY: AVX-512, see `x86`; the reference covers the 64 bytes written.
        unsafe { _mm512_storeu_pd(to.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn from_f32(x: Avx512F32x8) -> Self {
        // SAFETY: AVX-512, see `x86`.
        Self(unsafe { _mm512_cvtps_pd(x.0) })
    }

    #[inline(always)]
    fn to_f32(self) -> Avx512F32x8 {
        // SAFETY: AVX-512, see `x86`.
        Avx512F32x8(unsafe { _mm512_cvtpd_ps(self.0) })
    }
}

impl Real for Avx512F64x8 {
    #[inline(always)]
    fn splat(x: f64) -> Self {
        // SAFETY: AVX-512, see `x86`.
        Self(unsafe { _mm512_set1_pd(x) })
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        // SAFETY: AVX-512, see `x86`.
        Self(unsafe { _mm512_add_pd(self.0, other.0) })
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        // SAFETY: AVX-512, see `x86`.
        Self(unsafe { _mm512_sub_pd(self.0, other.0) })
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        // SAFETY: AVX-512, see `x86`.
        Self(unsafe { _mm512_mul_pd(self.0, other.0) })
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        // SAFETY: AVX-512, see `x86`.
        Self(unsafe { _mm512_div_pd(self.0, other.0) })
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // SAFETY: AVX-512, see `x86`.
        Self(unsafe { _mm512_min_pd(self.0, other.0) })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: AVX-512, see `x86`.
        Self(unsafe { _mm512_max_pd(self.0, other.0) })
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: AVX-512, see `x86`.
        Self(unsafe { _mm512_sqrt_pd(self.0) })
    }

    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: AVX-512, see `x86`.
        Self(unsafe { _mm512_abs_pd(self.0) })
    }

    #[inline(always)]
    fn le(self, other: Self) -> u32 {
        // SAFETY: AVX-512, see `x86`.
        u32::from(unsafe { _mm512_cmp_pd_mask::<_CMP_LE_OQ>(self.0, other.0) })
    }
}
