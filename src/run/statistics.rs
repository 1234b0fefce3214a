//! A frame in short.

use crate::scan::{Cause, Frame};

/// The number of a frame's rays and returns, and their ranges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Statistics {
    /// Pixels that have a ray.
    pub rays: usize,
    /// Pixels that have no ray, because the model of the lens or of the prisms ends before them.
    pub blind: usize,
    /// Returns.
    pub hits: usize,
    /// Pixels whose beam is blocked nearer than the sensor's least range.
    pub too_near: usize,
    /// Pixels whose beam first meets a surface beyond the sensor's largest range.
    pub out_of_range: usize,
    /// Pixels whose beam meets nothing at any distance.
    pub nothing: usize,
    /// The least, the mean and the largest range in metres, if there are returns.
    pub range_m: Option<[f64; 3]>,
}

impl Statistics {
    /// Sums up a frame.
    pub fn of(frame: &Frame) -> Self {
        let ranges = frame.iter().map(|(_, hit)| hit.range_m);
        let (mut hits, mut low, mut sum, mut high) = (0, f64::INFINITY, 0.0, 0.0_f64);
        for range in ranges {
            (hits, low, sum, high) = (hits + 1, low.min(range), sum + range, high.max(range));
        }
        let range_m = (hits > 0).then(|| [low, sum / hits as f64, high]);
        let blind = frame.blind_pixels();
        let [too_near, out_of_range, nothing] =
            [Cause::TooNear, Cause::OutOfRange, Cause::Nothing].map(|cause| frame.pixels_of(cause));
        Self { rays: frame.pixels() - blind, blind, hits, too_near, out_of_range, nothing, range_m }
    }
}
