//! The methods that take the same instructions with AVX2 and with AVX-512, as macros for the bodies of both implementations.

/// The methods of `F32Lanes` for a tuple struct of one `__m256`.
macro_rules! f32x8_arithmetic {
    () => {
        #[inline(always)]
        fn splat(x: f32) -> Self {
            // SAFETY: AVX, see `x86`.
            Self(unsafe { _mm256_set1_ps(x) })
        }

        #[inline(always)]
        fn add(self, other: Self) -> Self {
            // SAFETY: AVX, see `x86`.
            Self(unsafe { _mm256_add_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn sub(self, other: Self) -> Self {
            // SAFETY: AVX, see `x86`.
            Self(unsafe { _mm256_sub_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn mul(self, other: Self) -> Self {
            // SAFETY: AVX, see `x86`.
            Self(unsafe { _mm256_mul_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn div(self, other: Self) -> Self {
            // SAFETY: AVX, see `x86`.
            Self(unsafe { _mm256_div_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn mul_add(self, factor: Self, term: Self) -> Self {
            // SAFETY: FMA, see `x86`.
            Self(unsafe { _mm256_fmadd_ps(self.0, factor.0, term.0) })
        }

        #[inline(always)]
        fn mul_sub(self, factor: Self, term: Self) -> Self {
            // SAFETY: FMA, see `x86`.
            Self(unsafe { _mm256_fmsub_ps(self.0, factor.0, term.0) })
        }

        #[inline(always)]
        fn min(self, other: Self) -> Self {
            // SAFETY: AVX, see `x86`.
            Self(unsafe { _mm256_min_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn max(self, other: Self) -> Self {
            // SAFETY: AVX, see `x86`.
            Self(unsafe { _mm256_max_ps(self.0, other.0) })
        }
    };
}

/// The methods of `F32x8` for a tuple struct of one `__m256`.
macro_rules! f32x8_methods {
    () => {
        #[inline(always)]
        fn load(x: &[f32; 8]) -> Self {
            // SAFETY: AVX, see `x86`; the reference covers the 32 bytes read.
            Self(unsafe { _mm256_loadu_ps(x.as_ptr()) })
        }

        #[inline(always)]
        fn store(self, to: &mut [f32; 8]) {
            // SAFETY: AVX, see `x86`; the reference covers the 32 bytes written.
            unsafe { _mm256_storeu_ps(to.as_mut_ptr(), self.0) }
        }

        #[inline(always)]
        fn and(self, other: Self) -> Self {
            // SAFETY: AVX, see `x86`.
            Self(unsafe { _mm256_and_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn xor(self, other: Self) -> Self {
            // SAFETY: AVX, see `x86`.
            Self(unsafe { _mm256_xor_ps(self.0, other.0) })
        }

        #[inline(always)]
        fn permute(self, from: Self::U32x8) -> Self {
            // SAFETY: AVX2, see `x86`.
            Self(unsafe { _mm256_permutevar8x32_ps(self.0, from.0) })
        }

        #[inline(always)]
        fn reduce_min(self) -> f32 {
            // SAFETY: AVX, see `x86`.
            unsafe {
                let four = _mm_min_ps(_mm256_castps256_ps128(self.0), _mm256_extractf128_ps::<1>(self.0));
                let two = _mm_min_ps(four, _mm_movehl_ps(four, four));
                _mm_cvtss_f32(_mm_min_ss(two, _mm_movehdup_ps(two)))
            }
        }

        #[inline(always)]
        fn reduce_max(self) -> f32 {
            // SAFETY: AVX, see `x86`.
            unsafe {
                let four = _mm_max_ps(_mm256_castps256_ps128(self.0), _mm256_extractf128_ps::<1>(self.0));
                let two = _mm_max_ps(four, _mm_movehl_ps(four, four));
                _mm_cvtss_f32(_mm_max_ss(two, _mm_movehdup_ps(two)))
            }
        }

        #[inline(always)]
        fn reduce_min_4([a, b, c, d]: [Self; 4]) -> [f32; 4] {
            let mut to = [0.0; 8];
            // SAFETY: AVX, see `x86`; the array takes the 32 bytes written.
            unsafe {
                let ab = _mm256_min_ps(
                    _mm256_permute2f128_ps::<0x20>(a.0, b.0),
                    _mm256_permute2f128_ps::<0x31>(a.0, b.0),
                );
                let cd = _mm256_min_ps(
                    _mm256_permute2f128_ps::<0x20>(c.0, d.0),
                    _mm256_permute2f128_ps::<0x31>(c.0, d.0),
                );
                // a a c c | b b d d
                let two = _mm256_min_ps(
                    _mm256_shuffle_ps::<0b01_00_01_00>(ab, cd),
                    _mm256_shuffle_ps::<0b11_10_11_10>(ab, cd),
                );
                let one = _mm256_min_ps(two, _mm256_movehdup_ps(two));
                _mm256_storeu_ps(to.as_mut_ptr(), one);
            }
            [to[0], to[4], to[2], to[6]]
        }

        #[inline(always)]
        fn transposed(rows: [Self; 8]) -> [Self; 8] {
            // SAFETY: AVX, see `x86`.
            unsafe {
                let [a, b, c, d, e, f, g, h] = rows;
                // Pairs of rows, of which each half has two columns: 0 and 1 with 4 and 5, then 2 and 3 with 6 and 7.
                let ab = [_mm256_unpacklo_ps(a.0, b.0), _mm256_unpackhi_ps(a.0, b.0)];
                let cd = [_mm256_unpacklo_ps(c.0, d.0), _mm256_unpackhi_ps(c.0, d.0)];
                let ef = [_mm256_unpacklo_ps(e.0, f.0), _mm256_unpackhi_ps(e.0, f.0)];
                let gh = [_mm256_unpacklo_ps(g.0, h.0), _mm256_unpackhi_ps(g.0, h.0)];
                // Four rows, of which each half has one column: 0 with 4, 1 with 5, 2 with 6, 3 with 7.
                let ad = [
                    _mm256_shuffle_ps::<0b01_00_01_00>(ab[0], cd[0]),
                    _mm256_shuffle_ps::<0b11_10_11_10>(ab[0], cd[0]),
                    _mm256_shuffle_ps::<0b01_00_01_00>(ab[1], cd[1]),
                    _mm256_shuffle_ps::<0b11_10_11_10>(ab[1], cd[1]),
                ];
                let eh = [
                    _mm256_shuffle_ps::<0b01_00_01_00>(ef[0], gh[0]),
                    _mm256_shuffle_ps::<0b11_10_11_10>(ef[0], gh[0]),
                    _mm256_shuffle_ps::<0b01_00_01_00>(ef[1], gh[1]),
                    _mm256_shuffle_ps::<0b11_10_11_10>(ef[1], gh[1]),
                ];
                [
                    Self(_mm256_permute2f128_ps::<0x20>(ad[0], eh[0])),
                    Self(_mm256_permute2f128_ps::<0x20>(ad[1], eh[1])),
                    Self(_mm256_permute2f128_ps::<0x20>(ad[2], eh[2])),
                    Self(_mm256_permute2f128_ps::<0x20>(ad[3], eh[3])),
                    Self(_mm256_permute2f128_ps::<0x31>(ad[0], eh[0])),
                    Self(_mm256_permute2f128_ps::<0x31>(ad[1], eh[1])),
                    Self(_mm256_permute2f128_ps::<0x31>(ad[2], eh[2])),
                    Self(_mm256_permute2f128_ps::<0x31>(ad[3], eh[3])),
                ]
            }
        }

        #[inline(always)]
        fn reduce_min_8(rows: [Self; 8]) -> Self {
            // SAFETY: AVX, see `x86`.
            Self(unsafe {
                {
                    let [a, b, c, d, e, f, g, h] = rows;
                    let ae = _mm256_min_ps(
                        _mm256_permute2f128_ps::<0x20>(a.0, e.0),
                        _mm256_permute2f128_ps::<0x31>(a.0, e.0),
                    );
                    let bf = _mm256_min_ps(
                        _mm256_permute2f128_ps::<0x20>(b.0, f.0),
                        _mm256_permute2f128_ps::<0x31>(b.0, f.0),
                    );
                    let cg = _mm256_min_ps(
                        _mm256_permute2f128_ps::<0x20>(c.0, g.0),
                        _mm256_permute2f128_ps::<0x31>(c.0, g.0),
                    );
                    let dh = _mm256_min_ps(
                        _mm256_permute2f128_ps::<0x20>(d.0, h.0),
                        _mm256_permute2f128_ps::<0x31>(d.0, h.0),
                    );
                    // a a b b | e e f f
                    let abef = _mm256_min_ps(
                        _mm256_shuffle_ps::<0b01_00_01_00>(ae, bf),
                        _mm256_shuffle_ps::<0b11_10_11_10>(ae, bf),
                    );
                    let cdgh = _mm256_min_ps(
                        _mm256_shuffle_ps::<0b01_00_01_00>(cg, dh),
                        _mm256_shuffle_ps::<0b11_10_11_10>(cg, dh),
                    );
                    _mm256_min_ps(
                        _mm256_shuffle_ps::<0b10_00_10_00>(abef, cdgh),
                        _mm256_shuffle_ps::<0b11_01_11_01>(abef, cdgh),
                    )
                }
            })
        }

        #[inline(always)]
        fn prefetch(address: *const u32) {
            // SAFETY: a hint that reads nothing, whatever the address.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(address.cast()) }
        }
    };
}

/// The methods of `U32x8` for a tuple struct of one `__m256i`.
macro_rules! u32x8_methods {
    () => {
        #[inline(always)]
        fn splat(x: u32) -> Self {
            // SAFETY: AVX, see `x86`.
            Self(unsafe { _mm256_set1_epi32(x as i32) })
        }

        #[inline(always)]
        fn load(x: &[u32; 8]) -> Self {
            // SAFETY: AVX, see `x86`; the reference covers the 32 bytes read.
            Self(unsafe { _mm256_loadu_si256(x.as_ptr().cast()) })
        }

        #[inline(always)]
        fn store(self, to: &mut [u32; 8]) {
            // SAFETY: AVX, see `x86`; the reference covers the 32 bytes written.
            unsafe { _mm256_storeu_si256(to.as_mut_ptr().cast(), self.0) }
        }

        #[inline(always)]
        fn add(self, other: Self) -> Self {
            // SAFETY: AVX2, see `x86`.
            Self(unsafe { _mm256_add_epi32(self.0, other.0) })
        }

        #[inline(always)]
        fn and(self, other: Self) -> Self {
            // SAFETY: AVX2, see `x86`.
            Self(unsafe { _mm256_and_si256(self.0, other.0) })
        }

        #[inline(always)]
        fn or(self, other: Self) -> Self {
            // SAFETY: AVX2, see `x86`.
            Self(unsafe { _mm256_or_si256(self.0, other.0) })
        }

        #[inline(always)]
        fn xor(self, other: Self) -> Self {
            // SAFETY: AVX2, see `x86`.
            Self(unsafe { _mm256_xor_si256(self.0, other.0) })
        }

        #[inline(always)]
        fn bit_index(self) -> Self {
            // SAFETY: AVX2, see `x86`. (The exponent of f32 has a bias of 127.)
            Self(unsafe {
                let exponent = _mm256_srli_epi32::<23>(_mm256_castps_si256(_mm256_cvtepi32_ps(self.0)));
                _mm256_sub_epi32(exponent, _mm256_set1_epi32(127))
            })
        }

        #[inline(always)]
        fn from_bytes(bytes: u64) -> Self {
            // SAFETY: AVX2, see `x86`.
            Self(unsafe { _mm256_cvtepu8_epi32(_mm_cvtsi64_si128(bytes as i64)) })
        }

        #[inline(always)]
        fn shift_left(self, by: Self) -> Self {
            // SAFETY: AVX2, see `x86`.
            Self(unsafe { _mm256_sllv_epi32(self.0, by.0) })
        }

        #[inline(always)]
        fn shift_right(self, by: Self) -> Self {
            // SAFETY: AVX2, see `x86`.
            Self(unsafe { _mm256_srlv_epi32(self.0, by.0) })
        }

        #[inline(always)]
        fn gather(words: &[u32], at: Self) -> Self {
            // SAFETY: AVX2, see `x86`; every index is below the slice's length and 2³¹, as is checked first.
            Self(unsafe {
                let last = _mm256_set1_epi32((words.len().clamp(1, 1 << 31) - 1) as i32);
                let within = _mm256_cmpeq_epi32(_mm256_min_epu32(at.0, last), at.0);
                assert!(_mm256_movemask_epi8(within) == -1 && !words.is_empty());
                _mm256_i32gather_epi32::<4>(words.as_ptr().cast(), at.0)
            })
        }
    };
}

pub(super) use {f32x8_arithmetic, f32x8_methods, u32x8_methods};
