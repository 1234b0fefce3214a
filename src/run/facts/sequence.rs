//! What follows from a job's sequence, without casting any of it.

use std::collections::BTreeMap;

use serde::Serialize;

use super::SensorSizes;
use crate::config::Job;

/// The facts about a sequence.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SequenceFacts {
    /// The number of frames of each sensor, by its name.
    pub frames: BTreeMap<String, u64>,
    /// The time at which the first frame starts, in seconds.
    pub start_s: f64,
    /// The time from then until the last pulse of the last frame, in seconds.
    pub duration_s: f64,
    /// The rays of all frames.
    pub rays: u64,
    /// The size of all files before compression: an upper limit of what they take.
    pub output_bytes: u64,
    /// How the body moves. `None` if it stands still.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub way: Option<WayFacts>,
}

/// How a body moves while a sequence lasts, from its poses at evenly spaced times.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WayFacts {
    /// The length of the way, in metres: that of the straight lines between the poses.
    pub length_m: f64,
    /// The least and the largest mean speed between two poses that follow each other, in metres a second.
    pub speed_m_s: [f64; 2],
}

/// Most poses that are looked at.
const MOST_POSES: u64 = 10_000;

impl SequenceFacts {
    /// The facts about a job's sequence. `None` if each sensor has one frame.
    pub fn of(job: &Job, sensors: &[SensorSizes]) -> Option<Self> {
        let counts: Vec<u64> = job.sensors.iter().map(|s| job.sequence.frames_of(&s.sensor)).collect();
        if counts.iter().all(|count| *count <= 1) {
            return None;
        }
        let start_s =
            (0..counts.len()).map(|sensor| job.capture(sensor, 0).start_s).fold(f64::INFINITY, f64::min);
        let end = |sensor: usize| {
            let last = job.capture(sensor, counts[sensor].saturating_sub(1));
            last.start_s + last.sensor.pattern.last_pulse_s()
        };
        let duration_s = (0..counts.len()).map(end).fold(start_s, f64::max) - start_s;
        let of_all = |a_frame: &dyn Fn(&SensorSizes) -> u64| {
            let of_sensor = sensors.iter().zip(&counts).map(|(s, count)| a_frame(s).saturating_mul(*count));
            of_sensor.fold(0, u64::saturating_add)
        };
        let bytes = |sensor: &SensorSizes| {
            sensor.output_bytes.values().filter_map(serde_json::Value::as_u64).fold(0, u64::saturating_add)
        };
        Some(Self {
            frames: job.sensors.iter().map(|s| s.name.clone()).zip(counts.iter().copied()).collect(),
            start_s,
            duration_s,
            rays: of_all(&|sensor| sensor.facts.rays_per_frame as u64),
            output_bytes: of_all(&bytes),
            way: way(job, start_s, duration_s, counts.iter().copied().max().unwrap_or(0)),
        })
    }
}

/// The way of a job's body. Between the starts of frames there are some poses more, for a body that turns sharply.
fn way(job: &Job, start_s: f64, duration_s: f64, frames: u64) -> Option<WayFacts> {
    if job.trajectory.fixed_pose().is_some() || duration_s <= 0.0 {
        return None;
    }
    let steps = frames.saturating_mul(4).clamp(16, MOST_POSES);
    let step_s = duration_s / steps as f64;
    let place = |step: u64| job.trajectory.pose_at(start_s + step as f64 * step_s).translation;
    let lengths = (0..steps).map(|step| place(step).distance(place(step + 1)));
    let (mut length_m, mut speed_m_s) = (0.0, [f64::INFINITY, 0.0_f64]);
    for length in lengths {
        length_m += length;
        speed_m_s = [speed_m_s[0].min(length / step_s), speed_m_s[1].max(length / step_s)];
    }
    Some(WayFacts { length_m, speed_m_s })
}
