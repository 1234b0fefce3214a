//! The frames of a rig's sensors that belong together: one frame of each sensor at about the same time.

use std::ops::Range;

use super::plan::Item;
use crate::config::Job;

/// The steps of a sequence, which are the frames of the slowest sensor. To each of them belongs the frame of every other sensor
/// that starts nearest to it, as the rates say. A job with one frame of each sensor has one step.
#[derive(Clone, Debug)]
pub struct Steps {
    sensors: Vec<Paced>,
    count: u64,
}

/// A sensor of a rig, as its pace compares with the slowest one's.
#[derive(Clone, Copy, Debug)]
struct Paced {
    frames: u64,
    /// Frames for each frame of the slowest sensor, at least 1.
    a_step: f64,
}

impl Paced {
    /// The frame that belongs to a step.
    fn frame(self, step: u64) -> u64 {
        (step as f64 * self.a_step).round() as u64
    }
}

impl Steps {
    /// The steps of a job's sequence.
    pub fn of(job: &Job) -> Self {
        let paces: Vec<(u64, f64)> = job
            .sensors
            .iter()
            .map(|mounted| {
                let rate = mounted.sensor.pattern.rate_hz();
                (job.sequence.frames_of(&mounted.sensor), rate.unwrap_or(f64::INFINITY))
            })
            .collect();
        Self::paced(&paces)
    }

    /// The steps of sensors that each have so many frames at a rate.
    fn paced(paces: &[(u64, f64)]) -> Self {
        let slowest = paces.iter().map(|(_, rate)| *rate).fold(f64::INFINITY, f64::min);
        // A sensor without a rate has one frame.
        let a_step = |rate: f64| if rate.is_finite() { rate / slowest } else { 1.0 };
        let sensors: Vec<Paced> =
            paces.iter().map(|&(frames, rate)| Paced { frames, a_step: a_step(rate) }).collect();
        // Of the steps that a sensor's frames would fill, the last is the one whose frame it still has.
        let steps = |sensor: &Paced| {
            let about = (sensor.frames as f64 / sensor.a_step) as u64;
            (about.saturating_sub(1)..=about + 1).find(|&step| sensor.frame(step) >= sensor.frames)
        };
        let count = sensors.iter().filter_map(steps).max().unwrap_or(0);
        Self { sensors, count }
    }

    /// The number of steps.
    pub fn count(&self) -> u64 {
        self.count
    }

    /// Whether a sensor has more than one frame.
    pub fn is_sequence(&self) -> bool {
        self.sensors.iter().any(|sensor| sensor.frames > 1)
    }

    /// Whether a sensor has frames that belong to no step.
    pub fn has_frames_between(&self) -> bool {
        self.sensors.iter().any(|sensor| sensor.a_step > 1.0 && sensor.frames > 1)
    }

    /// The number of frames of a sensor.
    pub fn frames_of(&self, sensor: usize) -> u64 {
        self.sensors[sensor].frames
    }

    /// The frame of each sensor that belongs to a step, of those that have one then.
    pub fn items(&self, step: u64) -> impl Iterator<Item = Item> + '_ {
        let frame = move |(sensor, paced): (usize, &Paced)| {
            Some(item(sensor, paced.frame(step))).filter(|item| item.frame < paced.frames)
        };
        self.sensors.iter().enumerate().filter_map(frame)
    }

    /// The frames of a sensor between that of a step and that of the next, which belong to no step.
    pub fn between(&self, step: u64, sensor: usize) -> Range<u64> {
        let paced = self.sensors[sensor];
        let next = if step + 1 < self.count { paced.frame(step + 1) } else { paced.frames };
        paced.frame(step).saturating_add(1)..next.min(paced.frames)
    }
}

/// A frame that is cast and not written.
pub(super) fn item(sensor: usize, frame: u64) -> Item {
    Item { sensor, frame, outputs: Vec::new() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frames(steps: &Steps, step: u64) -> Vec<(usize, u64)> {
        steps.items(step).map(|item| (item.sensor, item.frame)).collect()
    }

    #[test]
    fn sensors_of_one_rate_go_together() {
        let steps = Steps::paced(&[(3, 10.0), (3, 10.0)]);
        assert_eq!((steps.count(), steps.is_sequence()), (3, true));
        assert_eq!(frames(&steps, 2), [(0, 2), (1, 2)]);
        assert!((0..3).all(|step| steps.between(step, 0).is_empty()));
        assert!(!Steps::paced(&[(1, f64::INFINITY), (1, 10.0)]).is_sequence());
    }

    /// Every frame of every sensor belongs to a step or lies between two, and none does twice.
    #[test]
    fn a_fast_sensor_has_frames_between_the_steps_of_a_slow_one() {
        for paces in [
            [(10, 10.0), (30, 30.0)],
            [(10, 10.0), (29, 30.0)],
            [(7, 10.0), (17, 24.0)],
            [(20, 10.0), (20, 29.97)],
            [(1, 0.5), (40, 20.0)],
        ] {
            let steps = Steps::paced(&paces);
            assert_eq!(steps.count(), paces[0].0, "{paces:?}");
            for (sensor, (all, _)) in paces.iter().enumerate() {
                let mut seen = Vec::new();
                for step in 0..steps.count() {
                    seen.extend(
                        steps.items(step).filter(|item| item.sensor == sensor).map(|item| item.frame),
                    );
                    seen.extend(steps.between(step, sensor));
                }
                assert!(seen.iter().copied().eq(0..*all), "{paces:?}, sensor {sensor}: {seen:?}");
            }
        }
        let steps = Steps::paced(&[(10, 10.0), (30, 30.0)]);
        assert_eq!((frames(&steps, 4), steps.between(4, 1)), (vec![(0, 4), (1, 12)], 13..15));
        // With as many frames at three times the rate, the fast sensor is at its end when the slow one goes on.
        let uneven = Steps::paced(&[(6, 10.0), (6, 30.0)]);
        assert_eq!((frames(&uneven, 1), frames(&uneven, 2)), (vec![(0, 1), (1, 3)], vec![(0, 2)]));
    }
}
