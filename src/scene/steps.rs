//! Powers of two, and rounding to multiples of them, by which the regions of a scene agree (see [`regions`](super::regions)).

use glam::DVec3;

/// The binary digits of an f64.
const F64_DIGITS: i32 = 53;

/// The step of ray origins for regions with centres no farther than `reach` from the scene's.
pub(super) fn origin_step(reach: f64) -> f64 {
    if reach == 0.0 { 0.0 } else { power_of_two(exponent_above(reach) - F64_DIGITS + 1) }
}

/// The origin of a ray, rounded such that regions agree on it, given their [`origin_step`].
pub(super) fn rounded_origin(p: DVec3, step: f64) -> DVec3 {
    let round = |x: f64| {
        let is_inside = x.abs() <= step * (1_u64 << (F64_DIGITS - 1)) as f64;
        let step = if is_inside { step } else { origin_step(x.abs()) };
        (x / step).round_ties_even() * step
    };
    DVec3::new(round(p.x), round(p.y), round(p.z))
}

/// The exponent e of the least power of two that is at least `x`: 2ᵉ ≥ x. Very small numbers, and 0, have that of 2⁻⁵⁰⁰.
pub(super) fn exponent_above(x: f64) -> i32 {
    let (fraction, exponent) = libm::frexp(x.max(1e-150));
    if fraction == 0.5 { exponent - 1 } else { exponent }
}

pub(super) fn power_of_two(exponent: i32) -> f64 {
    libm::ldexp(1.0, exponent)
}
