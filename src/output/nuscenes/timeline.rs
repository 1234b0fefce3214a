//! The samples of a scene, and the frames that belong to each.

use super::super::format::{EncodeError, Notes};
use super::note::Noted;

/// The samples of a scene and its frames. It takes some 40 bytes for each.
#[derive(Debug, Default)]
pub(super) struct Timeline {
    /// The scene's name.
    pub scene: String,
    /// The samples, in order: the frames of the sensor that has the fewest, and of several such sensors of the first.
    pub samples: Vec<Sample>,
    /// All frames, in the order of the notes.
    pub frames: Vec<Placed>,
}

/// A sample: what the sensors see at about the same time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    /// The number of the frame that it is taken from.
    pub frame: u64,
    pub start_s: f64,
    pub time_us: i64,
}

/// A frame in a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Placed {
    /// The sensor, in the order in which they appear.
    pub sensor: usize,
    pub frame: u64,
    /// The sample that the frame belongs to. Between two samples, a frame that is none of their key frames belongs to the later:
    /// the kit interpolates from the earlier to that.
    pub sample: usize,
    pub is_key: bool,
}

impl Timeline {
    pub fn of(notes: &Notes) -> Result<Self, EncodeError> {
        let (mut sensors, mut scene): (Vec<String>, _) = (Vec::new(), String::new());
        let mut starts: Vec<(usize, Sample)> = Vec::new();
        for note in notes()? {
            let note = Noted::read(note)?;
            let known = sensors.iter().position(|name| *name == note.sensor);
            let sensor = known.unwrap_or_else(|| {
                sensors.push(note.sensor);
                sensors.len() - 1
            });
            let Noted { frame, start_s, time_us, .. } = note;
            starts.push((sensor, Sample { frame, start_s, time_us }));
            scene = note.scene;
        }
        let count = |sensor: usize| starts.iter().filter(|(of, _)| *of == sensor).count();
        let Some(leader) = (0..sensors.len()).min_by_key(|sensor| count(*sensor)) else {
            return Ok(Self::default());
        };
        let of_leader = |(sensor, start): &(usize, Sample)| (*sensor == leader).then_some(*start);
        let samples: Vec<Sample> = starts.iter().filter_map(of_leader).collect();
        let mut timeline = Self { scene, samples, frames: Vec::with_capacity(starts.len()) };
        // For each sensor and sample the frame that is nearest, by its index and its distance.
        let mut nearest: Vec<Option<(usize, f64)>> = vec![None; sensors.len() * timeline.samples.len()];
        for (index, (sensor, start)) in starts.iter().enumerate() {
            let sample = timeline.nearest(start);
            let away_s = (timeline.samples[sample].start_s - start.start_s).abs();
            let best = &mut nearest[sensor * timeline.samples.len() + sample];
            if best.is_none_or(|(_, of_best_s)| away_s < of_best_s) {
                *best = Some((index, away_s));
            }
        }
        for (sensor, start) in &starts {
            let later = timeline.samples.partition_point(|sample| sample.start_s < start.start_s);
            let sample = later.min(timeline.samples.len() - 1);
            timeline.frames.push(Placed { sensor: *sensor, frame: start.frame, sample, is_key: false });
        }
        let count = timeline.samples.len();
        for (place, best) in nearest.iter().enumerate() {
            if let Some((index, _)) = best {
                let frame = &mut timeline.frames[*index];
                (frame.sample, frame.is_key) = (place % count, true);
            }
        }
        Ok(timeline)
    }

    /// The sample that is nearest to a frame in time, of two that are as near the earlier. Of samples at the same time, as
    /// sensors without a rate have them, the one of the frame's number.
    fn nearest(&self, frame: &Sample) -> usize {
        let after = self.samples.partition_point(|sample| sample.start_s <= frame.start_s);
        let away_s = |index: usize| (self.samples[index].start_s - frame.start_s).abs();
        let near = match after {
            0 => 0,
            after if after == self.samples.len() || away_s(after - 1) <= away_s(after) => after - 1,
            after => after,
        };
        let start_s = self.samples[near].start_s;
        let from = self.samples.partition_point(|sample| sample.start_s < start_s);
        let to = self.samples.partition_point(|sample| sample.start_s <= start_s);
        let of_number = self.samples[from..to].partition_point(|sample| sample.frame < frame.frame);
        (from + of_number).min(to - 1)
    }

    /// The frames before and after one of the same sensor, by their numbers.
    pub fn neighbours(&self, index: usize) -> [Option<u64>; 2] {
        let of_sensor = |other: &&Placed| other.sensor == self.frames[index].sensor;
        let before = self.frames[..index].iter().rev().find(of_sensor);
        let after = self.frames[index + 1..].iter().find(of_sensor);
        [before, after].map(|found| found.map(|other| other.frame))
    }
}
