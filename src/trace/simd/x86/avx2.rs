//! The implementation for AVX2 with FMA.

use std::arch::x86_64::*;

use glam::DVec3;

use super::shared::{f32x8_arithmetic, f32x8_methods, u32x8_methods};
use crate::trace::exact::Real;
use crate::trace::simd::{F32Lanes, F32x8, F32x16, F64x8, Mask8, SimdTask, TwoF32x8, U32x8};

/// Eight f32 in a register. It is made only by code that `run_with_avx2` calls.
#[derive(Clone, Copy)]
pub(in crate::trace) struct Avx2F32x8(__m256);

impl F32Lanes for Avx2F32x8 {
    f32x8_arithmetic!();
}

impl F32x8 for Avx2F32x8 {
    type Mask8 = Avx2Mask8;
    type U32x8 = Avx2U32x8;
    type F64x8 = Avx2F64x8;
    type F32x16 = TwoF32x8<Self>;

    fn run<T: SimdTask>(task: T) -> T::Output {
        super::run_with_avx2(task)
    }

    f32x8_methods!();

    #[inline(always)]
    fn ge(self, other: Self) -> Avx2Mask8 {
        // SAFETY: AVX, see `x86`.
        Avx2Mask8(unsafe { _mm256_cmp_ps::<_CMP_GE_OQ>(self.0, other.0) })
    }

    #[inline(always)]
    fn gt(self, other: Self) -> Avx2Mask8 {
        // SAFETY: AVX, see `x86`.
        Avx2Mask8(unsafe { _mm256_cmp_ps::<_CMP_GT_OQ>(self.0, other.0) })
    }

    #[inline(always)]
    fn select(mask: Avx2Mask8, yes: Self, no: Self) -> Self {
        // SAFETY: AVX, see `x86`.
        Self(unsafe { _mm256_blendv_ps(no.0, yes.0, mask.0) })
    }

    #[inline(always)]
    fn lookup(first: TwoF32x8<Self>, more: Option<Self>, from: [Avx2U32x8; 3]) -> [Self; 3] {
        let (low, middle) = first.halves();
        // SAFETY: AVX2, see `x86`.
        unsafe {
            let mut picked = [low; 3];
            for k in 0..3 {
                let lanes = from[k].0;
                let is_middle = _mm256_castsi256_ps(_mm256_slli_epi32::<28>(lanes));
                let from_low = _mm256_permutevar8x32_ps(low.0, lanes);
                let from_middle = _mm256_permutevar8x32_ps(middle.0, lanes);
                picked[k] = Self(_mm256_blendv_ps(from_low, from_middle, is_middle));
            }
            if let Some(high) = more {
                for k in 0..3 {
                    let lanes = from[k].0;
                    let is_high = _mm256_castsi256_ps(_mm256_slli_epi32::<27>(lanes));
                    let from_high = _mm256_permutevar8x32_ps(high.0, lanes);
                    picked[k] = Self(_mm256_blendv_ps(picked[k].0, from_high, is_high));
                }
            }
            picked
        }
    }

    #[inline(always)]
    fn compress(self, mask: Avx2Mask8) -> Self {
        self.compress_by_bits(mask.bits())
    }

    #[inline(always)]
    fn compress_by_bits(self, bits: u32) -> Self {
        let order = ORDERS[bits as usize & 255].compressed;
        // SAFETY: AVX2, see `x86`.
        Self(unsafe {
            _mm256_permutevar8x32_ps(self.0, _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(order as i64)))
        })
    }

    #[inline(always)]
    fn expand(self, mask: Avx2Mask8, others: Self) -> Self {
        let order = ORDERS[mask.bits() as usize & 255].expanded;
        // SAFETY: AVX2, see `x86`.
        Self(unsafe {
            let lanes = _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(order as i64));
            _mm256_blendv_ps(others.0, _mm256_permutevar8x32_ps(self.0, lanes), mask.0)
        })
    }
}

/// The permutations that compress and expand a set of lanes: the source of each lane, one byte each.
#[derive(Clone, Copy)]
struct Order {
    compressed: u64,
    expanded: u64,
}

/// The permutations for each set of lanes.
static ORDERS: [Order; 256] = {
    let mut table = [Order { compressed: 0, expanded: 0 }; 256];
    let mut set = 0;
    while set < 256 {
        let (mut count, mut lane) = (0, 0);
        while lane < 8 {
            if set >> lane & 1 != 0 {
                table[set].compressed |= (lane as u64) << (8 * count);
                table[set].expanded |= (count as u64) << (8 * lane);
                count += 1;
            }
            lane += 1;
        }
        set += 1;
    }
    table
};

/// A mask of all ones or all zeros in each lane.
#[derive(Clone, Copy)]
pub(in crate::trace) struct Avx2Mask8(__m256);

impl Mask8 for Avx2Mask8 {
    #[inline(always)]
    fn from_bits(bits: u32) -> Self {
        // SAFETY: AVX2, see `x86`.
        Self(unsafe {
            let of_lane = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
            let set = _mm256_and_si256(_mm256_set1_epi32(bits as i32), of_lane);
            _mm256_castsi256_ps(_mm256_cmpeq_epi32(set, of_lane))
        })
    }

    #[inline(always)]
    fn bits(self) -> u32 {
        // SAFETY: AVX, see `x86`.
        (unsafe { _mm256_movemask_ps(self.0) }) as u32
    }

    #[inline(always)]
    fn and(self, other: Self) -> Self {
        // SAFETY: AVX, see `x86`.
        Self(unsafe { _mm256_and_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn or(self, other: Self) -> Self {
        // SAFETY: AVX, see `x86`.
        Self(unsafe { _mm256_or_ps(self.0, other.0) })
    }
}

/// Eight u32 in a register.
#[derive(Clone, Copy)]
pub(in crate::trace) struct Avx2U32x8(__m256i);

impl U32x8 for Avx2U32x8 {
    type F32x8 = Avx2F32x8;

    u32x8_methods!();

    #[inline(always)]
    fn test(self, other: Self) -> Avx2Mask8 {
        // SAFETY: AVX2, see `x86`.
        Avx2Mask8(unsafe {
            let none = _mm256_cmpeq_epi32(_mm256_and_si256(self.0, other.0), _mm256_setzero_si256());
            _mm256_castsi256_ps(_mm256_xor_si256(none, _mm256_set1_epi32(-1)))
        })
    }

    #[inline(always)]
    fn bitcast(self) -> Avx2F32x8 {
        // SAFETY: AVX, see `x86`.
        Avx2F32x8(unsafe { _mm256_castsi256_ps(self.0) })
    }

    #[inline(always)]
    fn bitcast_from(x: Avx2F32x8) -> Self {
        // SAFETY: AVX, see `x86`.
        Self(unsafe { _mm256_castps_si256(x.0) })
    }
}

/// Eight f64 in two registers.
#[derive(Clone, Copy)]
pub(in crate::trace) struct Avx2F64x8(__m256d, __m256d);

impl F64x8 for Avx2F64x8 {
    type F32x8 = Avx2F32x8;

    #[inline(always)]
    fn load(x: &[f64; 8]) -> Self {
        // SAFETY: AVX, see `x86`; the reference covers the 64 bytes read.
        unsafe { Self(_mm256_loadu_pd(x.as_ptr()), _mm256_loadu_pd(x.as_ptr().add(4))) }
    }

    #[inline(always)]
    fn load_xyz(points: &[DVec3; 8]) -> [Self; 3] {
        let start = points.as_ptr().cast::<f64>();
        // SAFETY: AVX2, see `x86`; a DVec3 is three f64, and the reference covers the 192 bytes read.
        unsafe {
            let mut halves = [[_mm256_setzero_pd(); 3]; 2];
            for (k, half) in halves.iter_mut().enumerate() {
                let start = start.add(12 * k);
                let a = _mm256_loadu_pd(start); // x y z x
                let b = _mm256_loadu_pd(start.add(4)); // y z x y
                let c = _mm256_loadu_pd(start.add(8)); // z x y z
                let xy = _mm256_blend_pd::<0b1100>(a, b);
                let zx = _mm256_permute2f128_pd::<0x21>(a, c);
                let yz = _mm256_blend_pd::<0b1100>(b, c);
                *half = [
                    _mm256_shuffle_pd::<0b1010>(xy, zx),
                    _mm256_shuffle_pd::<0b0101>(xy, yz),
                    _mm256_shuffle_pd::<0b1010>(zx, yz),
                ];
            }
            let [[x, y, z], [x2, y2, z2]] = halves;
            [Self(x, x2), Self(y, y2), Self(z, z2)]
        }
    }

    #[inline(always)]
    fn store(self, to: &mut [f64; 8]) {
        // SAFETY: AVX, see `x86`; the reference covers the 64 bytes written.
        unsafe {
            _mm256_storeu_pd(to.as_mut_ptr(), self.0);
            _mm256_storeu_pd(to.as_mut_ptr().add(4), self.1);
        }
    }

    #[inline(always)]
    fn from_f32(x: Avx2F32x8) -> Self {
        // SAFETY: AVX, see `x86`.
        unsafe {
            Self(
                _mm256_cvtps_pd(_mm256_castps256_ps128(x.0)),
                _mm256_cvtps_pd(_mm256_extractf128_ps::<1>(x.0)),
            )
        }
    }

    #[inline(always)]
    fn to_f32(self) -> Avx2F32x8 {
        // SAFETY: AVX, see `x86`.
        Avx2F32x8(unsafe { _mm256_set_m128(_mm256_cvtpd_ps(self.1), _mm256_cvtpd_ps(self.0)) })
    }
}

impl Real for Avx2F64x8 {
    #[inline(always)]
    fn splat(x: f64) -> Self {
        // SAFETY: AVX, see `x86`.
        unsafe { Self(_mm256_set1_pd(x), _mm256_set1_pd(x)) }
    }

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        // SAFETY: AVX, see `x86`.
        unsafe { Self(_mm256_add_pd(self.0, other.0), _mm256_add_pd(self.1, other.1)) }
    }

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        // SAFETY: AVX, see `x86`.
        unsafe { Self(_mm256_sub_pd(self.0, other.0), _mm256_sub_pd(self.1, other.1)) }
    }

    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        // SAFETY: AVX, see `x86`.
        unsafe { Self(_mm256_mul_pd(self.0, other.0), _mm256_mul_pd(self.1, other.1)) }
    }

    #[inline(always)]
    fn div(self, other: Self) -> Self {
        // SAFETY: AVX, see `x86`.
        unsafe { Self(_mm256_div_pd(self.0, other.0), _mm256_div_pd(self.1, other.1)) }
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // SAFETY: AVX, see `x86`.
        unsafe { Self(_mm256_min_pd(self.0, other.0), _mm256_min_pd(self.1, other.1)) }
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: AVX, see `x86`.
        unsafe { Self(_mm256_max_pd(self.0, other.0), _mm256_max_pd(self.1, other.1)) }
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: AVX, see `x86`.
        unsafe { Self(_mm256_sqrt_pd(self.0), _mm256_sqrt_pd(self.1)) }
    }

    #[inline(always)]
    fn abs(self) -> Self {
        // SAFETY: AVX, see `x86`.
        unsafe {
            let sign = _mm256_set1_pd(-0.0);
            Self(_mm256_andnot_pd(sign, self.0), _mm256_andnot_pd(sign, self.1))
        }
    }

    #[inline(always)]
    fn le(self, other: Self) -> u32 {
        // SAFETY: AVX, see `x86`.
        unsafe {
            let low = _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LE_OQ>(self.0, other.0));
            let high = _mm256_movemask_pd(_mm256_cmp_pd::<_CMP_LE_OQ>(self.1, other.1));
            (low | high << 4) as u32
        }
    }
}
