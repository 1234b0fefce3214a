//! Limits that the keys of several tables share.

/// Most frames of a sensor.
pub(crate) const MAX_FRAMES: u64 = 100_000_000;
