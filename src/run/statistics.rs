//! A frame in short.

use crate::scan::Frame;

/// The number of a frame's rays and returns, and their ranges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Statistics {
    /// Pixels that have a ray.
    pub rays: usize,
    /// Pixels that have no ray, because the model of the lens or of the prisms ends before them.
    pub blind: usize,
    /// Returns.
    pub hits: usize,
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
        Self { rays: frame.pixels() - blind, blind, hits, range_m }
    }
}
