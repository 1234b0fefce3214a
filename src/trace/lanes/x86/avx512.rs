//! With AVX-512: masks of a bit a lane, permutations of two registers, and 512 bits for what comes in sixteens or is f64.

use std::arch::x86_64::*;

use glam::DVec3;

use super::{eight_floats, eight_words};
use crate::trace::exact::Real;
use crate::trace::lanes::{Doubles, Lanes, Mask, Pair, Words};

/// Eight f32 in a register. Only to be made inside of [`with_avx512`](super::with_avx512).
#[derive(Clone, Copy)]
pub(in crate::trace) struct Avx512(__m256);

impl Lanes for Avx512 {
    type Mask = Avx512Mask;
    type Words = Avx512Words;
    type Doubles = Avx512Doubles;
    type Pair = Avx512Pair;

    eight_floats!();

    #[inline(always)]
    fn ge(self, other: Self) -> Avx512Mask {
        // SAFETY: AVX-512, see the module.
        Avx512Mask(unsafe { _mm256_cmp_ps_mask::<_CMP_GE_OQ>(self.0, other.0) })
    }

    #[inline(always)]
    fn gt(self, other: Self) -> Avx512Mask {
        // SAFETY: AVX-512, see the module.
        Avx512Mask(unsafe { _mm256_cmp_ps_mask::<_CMP_GT_OQ>(self.0, other.0) })
    }

    #[inline(always)]
    fn select(mask: Avx512Mask, yes: Self, no: Self) -> Self {
        // SAFETY: AVX-512, see the module.
        Self(unsafe { _mm256_mask_blend_ps(mask.0, no.0, yes.0) })
    }

    #[inline(always)]
    fn pick(first: Avx512Pair, more: Option<Self>, from: [Avx512Words; 3]) -> [Self; 3] {
        let [a, b, c] = from;
        let first = first.0;
        // SAFETY: AVX-512, see the module.
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
    fn compress(self, mask: Avx512Mask) -> Self {
        // SAFETY: AVX-512, see the module.
        Self(unsafe { _mm256_maskz_compress_ps(mask.0, self.0) })
    }

    #[inline(always)]
    fn compress_bits(self, bits: u32) -> Self {
        self.compress(Avx512Mask::of_bits(bits))
    }

    #[inline(always)]
    fn expand(self, mask: Avx512Mask, others: Self) -> Self {
        // SAFETY: AVX-512, see the module.
        Self(unsafe { _mm256_mask_expand_ps(others.0, mask.0, self.0) })
    }
}

/// A bit a lane.
#[derive(Clone, Copy)]
pub(in crate::trace) struct Avx512Mask(__mmask8);

impl Mask for Avx512Mask {
    #[inline(always)]
    fn of_bits(bits: u32) -> Self {
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
pub(in crate::trace) struct Avx512Pair(__m512);

impl Pair for Avx512Pair {
    type Half = Avx512;

    #[inline(always)]
    fn load(x: &[f32; 16]) -> Self {
        // SAFETY: AVX-512, see the module; the reference covers the 64 bytes read.
        Self(unsafe { _mm512_loadu_ps(x.as_ptr()) })
    }

    #[inline(always)]
    fn store(self, to: &mut [f32; 16]) {
        // SAFETY: AVX-512, see the module; the reference covers the 64 bytes written.
        unsafe { _mm512_storeu_ps(to.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn of(low: Avx512, high: Avx512) -> Self {
        // SAFETY: AVX-512, see the module.
        Self(unsafe { _mm512_insertf32x8::<1>(_mm512_castps256_ps512(low.0), high.0) })
    }

    #[inline(always)]
    fn splat(x: f32) -> Self {
        // SAFETY: AVX-512, see the module.
        Self(unsafe { _mm512_set1_ps(x) })
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        // SAFETY: AVX-512, see the module.
        Self(unsafe { _mm512_sub_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn two_of(eight: Avx512, first: usize) -> Self {
        // SAFETY: AVX-512, see the module.
        Self(unsafe {
            let halves = _mm512_setr_epi32(0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1);
            let from = _mm512_add_epi32(halves, _mm512_set1_epi32(first as i32));
            _mm512_permutexvar_ps(from, _mm512_castps256_ps512(eight.0))
        })
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        // SAFETY: AVX-512, see the module.
        Self(unsafe { _mm512_mul_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn mul_add(self, factor: Self, term: Self) -> Self {
        // SAFETY: AVX-512, see the module.
        Self(unsafe { _mm512_fmadd_ps(self.0, factor.0, term.0) })
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // SAFETY: AVX-512, see the module.
        Self(unsafe { _mm512_min_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: AVX-512, see the module.
        Self(unsafe { _mm512_max_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: AVX-512, see the module.
        Self(unsafe { _mm512_abs_ps(self.0) })
    }

    #[inline(always)]
    fn ge(self, other: Self) -> u32 {
        // SAFETY: AVX-512, see the module.
        u32::from(unsafe { _mm512_cmp_ps_mask::<_CMP_GE_OQ>(self.0, other.0) })
    }

    #[inline(always)]
    fn all_ge([p, q]: [Self; 2], [r, s]: [Self; 2]) -> Avx512Mask {
        // SAFETY: AVX-512, see the module.
        let sixteen = unsafe {
            _mm512_mask_cmp_ps_mask::<_CMP_GE_OQ>(_mm512_cmp_ps_mask::<_CMP_GE_OQ>(p.0, r.0), q.0, s.0)
        };
        Avx512Mask((sixteen & sixteen >> 8) as __mmask8)
    }

    #[inline(always)]
    fn halves(self) -> (Avx512, Avx512) {
        // SAFETY: AVX-512, see the module.
        unsafe { (Avx512(_mm512_castps512_ps256(self.0)), Avx512(_mm512_extractf32x8_ps::<1>(self.0))) }
    }

    #[inline(always)]
    fn select(bits: u32, yes: Self, no: Self) -> Self {
        // SAFETY: AVX-512, see the module.
        Self(unsafe { _mm512_mask_blend_ps(bits as __mmask16, no.0, yes.0) })
    }

    #[inline(always)]
    fn store_some(self, bits: u32, to: &mut [f32; 16]) {
        // SAFETY: AVX-512, see the module; the reference covers the 64 bytes written.
        unsafe {
            _mm512_storeu_ps(to.as_mut_ptr(), _mm512_maskz_compress_ps(bits as __mmask16, self.0));
        }
    }

    #[inline(always)]
    fn load_some(self, bits: u32, from: &[f32; 16]) -> Self {
        // SAFETY: AVX-512, see the module; the reference covers the 64 bytes read.
        Self(unsafe { _mm512_mask_expand_ps(self.0, bits as __mmask16, _mm512_loadu_ps(from.as_ptr())) })
    }

    #[inline(always)]
    fn load_some_words(self, bits: u32, from: &[u32; 16]) -> Self {
        // SAFETY: AVX-512, see the module; the reference covers the 64 bytes read.
        Self(unsafe {
            _mm512_mask_expand_ps(self.0, bits as __mmask16, _mm512_loadu_ps(from.as_ptr().cast()))
        })
    }

    #[inline(always)]
    fn load_words(x: &[u32; 16]) -> Self {
        // SAFETY: AVX-512, see the module; the reference covers the 64 bytes read.
        Self(unsafe { _mm512_loadu_ps(x.as_ptr().cast()) })
    }

    #[inline(always)]
    fn store_words(self, to: &mut [u32; 16]) {
        // SAFETY: AVX-512, see the module; the reference covers the 64 bytes written.
        unsafe { _mm512_storeu_ps(to.as_mut_ptr().cast(), self.0) }
    }
}

/// Eight u32 in a register.
#[derive(Clone, Copy)]
pub(in crate::trace) struct Avx512Words(__m256i);

impl Words for Avx512Words {
    type Floats = Avx512;

    eight_words!();

    #[inline(always)]
    fn common(self, other: Self) -> Avx512Mask {
        // SAFETY: AVX-512, see the module.
        Avx512Mask(unsafe { _mm256_test_epi32_mask(self.0, other.0) })
    }

    #[inline(always)]
    fn as_floats(self) -> Avx512 {
        // SAFETY: AVX, see the module.
        Avx512(unsafe { _mm256_castsi256_ps(self.0) })
    }

    #[inline(always)]
    fn of_floats(x: Avx512) -> Self {
        // SAFETY: AVX, see the module.
        Self(unsafe { _mm256_castps_si256(x.0) })
    }
}

/// Eight f64 in a register.
#[derive(Clone, Copy)]
pub(in crate::trace) struct Avx512Doubles(__m512d);

impl Doubles for Avx512Doubles {
    type Floats = Avx512;

    #[inline(always)]
    fn load(x: &[f64; 8]) -> Self {
        // SAFETY: AVX-512, see the module; the reference covers the 64 bytes read.
        Self(unsafe { _mm512_loadu_pd(x.as_ptr()) })
    }

    #[inline(always)]
    fn load_xyz(points: &[DVec3; 8]) -> [Self; 3] {
        let start = points.as_ptr().cast::<f64>();
        // SAFETY: AVX-512, see the module; a DVec3 is three f64, and the reference covers the 192 bytes read.
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
        // SAFETY: AVX-512, see the module; the reference covers the 64 bytes written.
        unsafe { _mm512_storeu_pd(to.as_mut_ptr(), self.0) }
    }

    #[inline(always)]
    fn from_floats(x: Avx512) -> Self {
        // SAFETY: AVX-512, see the module.
        Self(unsafe { _mm512_cvtps_pd(x.0) })
    }

    #[inline(always)]
    fn to_floats(self) -> Avx512 {
        // SAFETY: AVX-512, see the module.
        Avx512(unsafe { _mm512_cvtpd_ps(self.0) })
    }
}

impl Real for Avx512Doubles {
    #[inline(always)]
    fn splat(x: f64) -> Self {
        // SAFETY: AVX-512, see the module.
        Self(unsafe { _mm512_set1_pd(x) })
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        // SAFETY: AVX-512, see the module.
        Self(unsafe { _mm512_add_pd(self.0, other.0) })
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        // SAFETY: AVX-512, see the module.
        Self(unsafe { _mm512_sub_pd(self.0, other.0) })
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        // SAFETY: AVX-512, see the module.
        Self(unsafe { _mm512_mul_pd(self.0, other.0) })
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        // SAFETY: AVX-512, see the module.
        Self(unsafe { _mm512_div_pd(self.0, other.0) })
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // SAFETY: AVX-512, see the module.
        Self(unsafe { _mm512_min_pd(self.0, other.0) })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: AVX-512, see the module.
        Self(unsafe { _mm512_max_pd(self.0, other.0) })
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: AVX-512, see the module.
        Self(unsafe { _mm512_sqrt_pd(self.0) })
    }

    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: AVX-512, see the module.
        Self(unsafe { _mm512_abs_pd(self.0) })
    }

    #[inline(always)]
    fn le(self, other: Self) -> u32 {
        // SAFETY: AVX-512, see the module.
        u32::from(unsafe { _mm512_cmp_pd_mask::<_CMP_LE_OQ>(self.0, other.0) })
    }
}
