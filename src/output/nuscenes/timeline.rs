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
        let mut nearest: Vec<Option<(usize, i64)>> = vec![None; sensors.len() * timeline.samples.len()];
        for (index, (sensor, start)) in starts.iter().enumerate() {
            let sample = timeline.nearest(start);
            let away_ns = nanoseconds_between(&timeline.samples[sample], start);
            let best = &mut nearest[sensor * timeline.samples.len() + sample];
            if best.is_none_or(|(_, of_best_ns)| away_ns < of_best_ns) {
                *best = Some((index, away_ns));
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
        let away_ns = |index: usize| nanoseconds_between(&self.samples[index], frame);
        let near = match after {
            0 => 0,
            after if after == self.samples.len() || away_ns(after - 1) <= away_ns(after) => after - 1,
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

/// The time between the starts of two frames. Times that are as far apart in decimals are not quite so in binary, and of these the
/// earlier is to count as of equal ones.
fn nanoseconds_between(one: &Sample, other: &Sample) -> i64 {
    ((one.start_s - other.start_s).abs() * 1e9).round() as i64
}

#[cfg(test)]
mod tests {
    use super::super::super::format::Note;
    use super::super::note::tests::note;
    use super::*;

    fn timeline(frames: &[(&str, u64, f64)]) -> Timeline {
        let notes = |&(sensor, frame, start_s): &(&str, u64, f64)| Note {
            text: note(sensor, frame, start_s).text(),
            files: Vec::new(),
        };
        Timeline::of(&|| Ok(Box::new(frames.iter().map(notes)))).unwrap()
    }

    fn placed(timeline: &Timeline, sensor: usize) -> Vec<(u64, usize, bool)> {
        let of_sensor = timeline.frames.iter().filter(|placed| placed.sensor == sensor);
        of_sensor.map(|placed| (placed.frame, placed.sample, placed.is_key)).collect()
    }

    /// A LiDAR of 10 Hz and a camera of 25 Hz: at 0.1 s two frames of the camera, at 0.08 and 0.12 s, are as near.
    #[test]
    fn the_slowest_sensor_makes_samples_and_the_nearest_frames_of_others_are_key_frames() {
        let mut frames = vec![("top", 0, 0.0), ("top", 1, 0.1), ("top", 2, 0.2)];
        frames.extend((0..6).map(|frame| ("front", frame, frame as f64 * 0.04)));
        frames.sort_by(|a, b| a.2.total_cmp(&b.2));
        let timeline = timeline(&frames);
        assert_eq!(placed(&timeline, 0), [(0, 0, true), (1, 1, true), (2, 2, true)]);
        // 0.04 s is nearer to 0, and not a key frame: it belongs to the sample after it.
        let expected =
            [(0, 0, true), (1, 1, false), (2, 1, true), (3, 2, false), (4, 2, false), (5, 2, true)];
        assert_eq!(placed(&timeline, 1), expected);
        assert_eq!(timeline.neighbours(0), [None, Some(1)]);
        let last = frames.len() - 1;
        assert_eq!(timeline.neighbours(last)[1], None);
    }

    /// The frames of sensors without a rate all start at 0, and those of one number belong together.
    #[test]
    fn frames_at_the_same_time_belong_together_by_their_numbers() {
        let frames =
            [("a", 3, 0.0), ("a", 4, 0.0), ("a", 5, 0.0), ("b", 3, 0.0), ("b", 4, 0.0), ("b", 5, 0.0)];
        let timeline = timeline(&frames);
        for sensor in 0..2 {
            assert_eq!(placed(&timeline, sensor), [(3, 0, true), (4, 1, true), (5, 2, true)]);
        }
        assert_eq!(self::timeline(&[]).samples.len(), 0);
    }

    /// A frame after the last sample belongs to that.
    #[test]
    fn every_frame_has_a_sample_and_a_sample_has_one_key_frame_of_a_sensor() {
        let frames =
            [("slow", 0, 0.5), ("fast", 0, 0.0), ("fast", 1, 0.4), ("fast", 2, 0.7), ("fast", 3, 0.9)];
        let mut in_order = frames;
        in_order.sort_by(|a: &(_, _, f64), b| a.2.total_cmp(&b.2));
        let timeline = timeline(&in_order);
        assert_eq!(placed(&timeline, 0), [(0, 0, false), (1, 0, true), (2, 0, false), (3, 0, false)]);
        assert_eq!(placed(&timeline, 1), [(0, 0, true)]);
    }
}
