//! The two constants that all error bounds of f32 arithmetic are made of.

/// The unit roundoff u of f32: the rounded result of an operation differs from the exact one by at most u times itself.
pub(super) const U: f32 = f32::EPSILON / 2.0;

/// The absolute term of every bound, for results that underflow.
///
/// A subnormal result is off by at most 2⁻¹⁵⁰ < 10⁻⁴⁵. A bound adds up a few dozen of these, each multiplied by at most a few
/// times the largest |coordinate| M: less than 10⁻⁴³·(M + 1). That is below 10⁻³⁶ while M < 10⁶, and for a larger M it is far
/// below the bound's relative term, which is at least u²·M².
pub(super) const TINY: f32 = 1e-36;
