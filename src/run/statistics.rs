//! Frames in short.

use serde::{Deserialize, Serialize};

use crate::scan::{Cause, Frame};

/// The number of the rays and returns of frames, and their ranges.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Statistics {
    /// Frames.
    pub frames: u64,
    /// Pixels that have a ray.
    pub rays: usize,
    /// Pixels that have no ray, because the model of the lens or of the prisms ends before them.
    #[serde(rename = "pixels_without_ray")]
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
        Self {
            frames: 1,
            rays: frame.pixels() - blind,
            blind,
            hits,
            too_near,
            out_of_range,
            nothing,
            range_m,
        }
    }

    /// Adds those of another frame.
    pub fn add(&mut self, other: &Self) {
        self.range_m = match (self.range_m, other.range_m) {
            (Some([low, mean, high]), Some([other_low, other_mean, other_high])) => {
                let all = (self.hits + other.hits) as f64;
                let share = other.hits as f64 / all;
                Some([low.min(other_low), mean + share * (other_mean - mean), high.max(other_high)])
            }
            (own, other) => own.or(other),
        };
        self.frames += other.frames;
        self.rays += other.rays;
        self.blind += other.blind;
        self.hits += other.hits;
        self.too_near += other.too_near;
        self.out_of_range += other.out_of_range;
        self.nothing += other.nothing;
    }
}
