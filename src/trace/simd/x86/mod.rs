//! The implementations for x86-64: one for AVX2 with FMA, and one for AVX-512.
//!
//! This is the only module with `unsafe`. Beside [`pages`], each block calls intrinsics that need the features of its implementation and nothing
//! else: loads and stores take references to whole arrays, unaligned, and gathers check their indices. A vector may be made only
//! on a processor that has these features. [`run_with_avx2`] and [`run_with_avx512`] are the only ways into code that makes one, and
//! they check [`has_avx2`] and [`has_avx512`].
#![allow(unsafe_code)]

mod avx2;
mod avx512;
#[cfg(target_os = "linux")]
mod pages;
mod shared;

pub(in crate::trace) use avx2::Avx2F32x8;
pub(in crate::trace) use avx512::Avx512F32x8;
#[cfg(target_os = "linux")]
pub(in crate::trace) use pages::prefer_huge_pages;

use super::SimdTask;

// `load_xyz` reads eight points as twenty-four numbers in a row, which must not have gaps.
const _: () = assert!(size_of::<[glam::DVec3; 8]>() == 24 * size_of::<f64>());

/// Whether this processor has AVX2 and FMA, and the bit counting instructions that come with them.
#[inline]
pub(in crate::trace) fn has_avx2() -> bool {
    is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("fma")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("bmi2")
        && is_x86_feature_detected!("lzcnt")
        && is_x86_feature_detected!("popcnt")
}

/// Whether this processor has the features that [`Avx512F32x8`] needs, as all with AVX-512 since 2017 have.
#[inline]
pub(in crate::trace) fn has_avx512() -> bool {
    has_avx2()
        && is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512bw")
}

/// Runs a task on [`Avx2F32x8`], compiled for AVX2 and FMA.
///
/// # Panics
/// If the processor lacks a feature.
#[inline]
pub(in crate::trace) fn run_with_avx2<T: SimdTask>(task: T) -> T::Output {
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt")]
    #[inline(never)]
    fn enabled<T: SimdTask>(task: T) -> T::Output {
        task.run::<Avx2F32x8>()
    }
    assert!(has_avx2());
    // SAFETY: the processor has all of the features, as has just been checked.
    unsafe { enabled(task) }
}

/// Runs a task on [`Avx512F32x8`], compiled for AVX-512.
///
/// # Panics
/// If the processor lacks a feature.
#[inline]
pub(in crate::trace) fn run_with_avx512<T: SimdTask>(task: T) -> T::Output {
    #[target_feature(enable = "avx2,fma,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512dq,avx512bw")]
    #[inline(never)]
    fn enabled<T: SimdTask>(task: T) -> T::Output {
        task.run::<Avx512F32x8>()
    }
    assert!(has_avx512());
    // SAFETY: the processor has all of the features, as has just been checked.
    unsafe { enabled(task) }
}
