//! Pulses × scene → returns. The one room that knows both; threads (rayon) live here.

use std::sync::atomic::{AtomicBool, AtomicU64};

use glam::Vec3;

/// What a sensor saw in one turn or one image.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Rows of the range image.
    pub rows: usize,
    /// Columns of the range image.
    pub columns: usize,
    /// Row by row; `None` where nothing came back. `rows × columns` long.
    pub returns: Vec<Option<Return>>,
}

/// What came back from one pulse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Return {
    /// Metres along the ray.
    pub range: f64,
    /// Unit geometric normal of the surface in the sensor's body frame, towards the sensor.
    pub normal: Vec3,
    /// ρ·cos θ: reflectivity times the cosine of incidence, 0 to 1.
    pub intensity: f32,
    /// Index into [`crate::scene::Scene::instances`].
    pub instance: u32,
    /// Semantic label.
    pub label: u32,
    /// Triangle id.
    pub triangle: u32,
}

impl Frame {
    /// What came back at a pixel of the range image.
    pub fn get(&self, row: usize, column: usize) -> Option<&Return> {
        self.returns[row * self.columns + column].as_ref()
    }
}

/// How far a scan has come, to be read from another thread, and the way to stop it.
#[derive(Debug, Default)]
pub struct Progress {
    /// Rays cast since it was made.
    pub rays_done: AtomicU64,
    /// Set it, and scanning stops within a few milliseconds.
    pub cancelled: AtomicBool,
}
