//! How far a scan is.

use std::sync::atomic::{AtomicBool, AtomicU64};

/// The progress of a scan, which another thread can read, and the means to stop it.
#[derive(Debug, Default)]
pub struct Progress {
    /// The number of pulses that were cast since the progress was created: one a pixel that has one.
    pub rays_done: AtomicU64,
    /// The number of samples that were cast for them: all rays, with those of footprints and those that mirrors, panes and holes
    /// make. Of an ideal sensor each pulse is one sample, which is not counted here.
    pub samples_done: AtomicU64,
    /// A flag that stops scanning within a few milliseconds once it is set.
    pub cancelled: AtomicBool,
}
