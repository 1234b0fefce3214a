//! Frames in short.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::scan::{Cause, Frame};

/// The number of the rays and returns of frames, and their ranges.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Statistics {
    /// Frames.
    pub frames: u64,
    /// Pixels that have a ray.
    pub rays: usize,
    /// Pixels that have no ray, because the model of the lens or of the prisms ends before them.
    #[serde(rename = "pixels_without_ray")]
    pub blind: usize,
    /// Pixels that have a return, or several.
    pub hits: usize,
    /// Pixels whose beam is blocked nearer than the sensor's least range.
    pub too_near: usize,
    /// Pixels whose beam first meets a surface beyond the sensor's largest range.
    pub out_of_range: usize,
    /// Pixels whose beam meets nothing at any distance.
    pub nothing: usize,
    /// The least, the mean and the largest range in metres, if there are returns.
    pub range_m: Option<[f64; 3]>,
    /// The returns of sensors that are not ideal, by the names of their causes. Ideal sensors have one return a pixel, from a surface.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub causes: BTreeMap<String, u64>,
    /// The pixels of sensors that are not ideal which have a ray and no return, by the names of the causes.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub without_return: BTreeMap<String, u64>,
}

impl Statistics {
    /// Sums up a frame.
    pub fn of(frame: &Frame) -> Self {
        let ranges_m = &frame.returns().range_m;
        let (mut returns, mut low, mut sum, mut high) = (0, f64::INFINITY, 0.0, 0.0_f64);
        frame.each_slot(|slot| {
            let range_m = ranges_m[slot];
            (returns, low, sum, high) = (returns + 1, low.min(range_m), sum + range_m, high.max(range_m));
        });
        let range_m = (returns > 0).then(|| [low, sum / returns as f64, high]);
        let blind = frame.blind_pixels();
        let [too_near, out_of_range, nothing] =
            [Cause::TooNear, Cause::OutOfRange, Cause::Nothing].map(|cause| frame.pixels_of(cause));
        let mut statistics = Self {
            frames: 1,
            rays: frame.pixels() - blind,
            blind,
            hits: frame.hits(),
            too_near,
            out_of_range,
            nothing,
            range_m,
            ..Self::default()
        };
        if frame.is_measured() {
            statistics.count_causes(frame);
        }
        statistics
    }

    fn count_causes(&mut self, frame: &Frame) {
        let add = |counts: &mut BTreeMap<String, u64>, cause: Cause| match counts.get_mut(cause.name()) {
            Some(count) => *count += 1,
            None => {
                counts.insert(cause.name().to_owned(), 1);
            }
        };
        for (pixel, cause) in frame.causes().iter().enumerate() {
            let returns = frame.slots(pixel).len();
            if returns == 0 && *cause != Cause::NoPulse {
                add(&mut self.without_return, *cause);
            }
            let of_returns = (0..returns).filter_map(|number| frame.cause(pixel, number));
            of_returns.for_each(|cause| add(&mut self.causes, cause));
        }
    }

    /// The number of returns.
    pub fn returns(&self) -> u64 {
        if self.causes.is_empty() { self.hits as u64 } else { self.causes.values().sum() }
    }

    /// Whether the sensor is not ideal, so that returns and pixels without one have causes.
    pub fn is_measured(&self) -> bool {
        !self.causes.is_empty() || !self.without_return.is_empty()
    }

    /// Adds those of another frame.
    pub fn add(&mut self, other: &Self) {
        self.range_m = match (self.range_m, other.range_m) {
            (Some([low, mean, high]), Some([other_low, other_mean, other_high])) => {
                let all = (self.returns() + other.returns()) as f64;
                let share = other.returns() as f64 / all;
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
        for (own, others) in
            [(&mut self.causes, &other.causes), (&mut self.without_return, &other.without_return)]
        {
            others.iter().for_each(|(cause, count)| *own.entry(cause.clone()).or_default() += count);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scan::Return;

    fn at(range_m: f64) -> Return {
        Return { range_m, ..Return::default() }
    }

    /// Two frames of 3 and of 1 return: the mean range counts returns, and the hits pixels.
    #[test]
    fn means_count_returns_and_hits_count_pixels() {
        let two: [(Cause, &[Return]); 3] =
            [(Cause::Surface, &[at(1.0), at(3.0)]), (Cause::Surface, &[at(5.0)]), (Cause::Nothing, &[])];
        let statistics = Statistics::of(&Frame::from_pixels(1, 3, two));
        assert_eq!((statistics.rays, statistics.hits, statistics.nothing), (3, 2, 1));
        assert_eq!(statistics.range_m, Some([1.0, 3.0, 5.0]));
        assert!(!statistics.is_measured());

        let counts = |all: &[(&str, u64)]| all.iter().map(|(name, n)| ((*name).to_owned(), *n)).collect();
        let mut sum = Statistics {
            hits: 1,
            range_m: Some([2.0, 2.0, 2.0]),
            causes: counts(&[("surface", 1), ("rain", 2)]),
            ..Statistics::default()
        };
        sum.add(&Statistics {
            hits: 1,
            range_m: Some([6.0, 6.0, 6.0]),
            causes: counts(&[("surface", 1)]),
            without_return: counts(&[("dropped", 4)]),
            ..Statistics::default()
        });
        assert_eq!((sum.hits, sum.returns(), sum.range_m), (2, 4, Some([2.0, 3.0, 6.0])));
        assert_eq!(sum.causes, counts(&[("surface", 2), ("rain", 2)]));
        assert!(sum.is_measured());
    }
}
