//! The outcome of a check as plain data, from which reports are written.

use std::fmt;

use super::compare::ChannelDifference;
use crate::output::Image;
use crate::source::{Diagnostic, Place};

/// The outcome of checking one job.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// The path of the job's file as the user wrote it.
    pub job: String,
    /// The overall result.
    pub verdict: Verdict,
    /// Sentences about the job as a whole: the reason why it could not be run or compared, and the command that corrects
    /// it.
    pub problems: Vec<Failure>,
    /// Warnings about the job and its scene: the job was run, and is probably not what was meant.
    pub warnings: Vec<Diagnostic>,
    /// The changes since the baseline was accepted, whether or not they led to a difference.
    pub changes: Vec<Change>,
    /// One outcome for each frame that was compared, by number and then in the job's order of sensors; of sensors that report several
    /// returns of a pulse, one for each number of return. It is empty if the job could not be run, or if there is no baseline.
    pub sensors: Vec<SensorOutcome>,
    /// One outcome for each `[[expect]]`, in the job's order.
    pub expectations: Vec<ExpectationOutcome>,
}

/// A sentence about what is wrong, and where it is written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Failure {
    /// The sentence.
    pub sentence: String,
    /// The place in the user's files that the sentence is about. `None` if it is about the job as a whole.
    pub place: Option<Place>,
}

impl From<String> for Failure {
    /// A failure of the job as a whole.
    fn from(sentence: String) -> Self {
        Self { sentence, place: None }
    }
}

/// The result of a check.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Verdict {
    /// Nothing differs beyond its tolerance, and every expectation is met.
    #[default]
    Passed,
    /// The run is the new baseline, and every expectation is met.
    Accepted,
    /// A frame differs, a baseline is missing, or an expectation is not met.
    Failed,
    /// The job could not be run, because its files are wrong.
    Broken,
}

/// The result of comparing a sensor's frame with its baseline.
#[derive(Clone, Debug, Default)]
pub struct SensorOutcome {
    /// The sensor's name.
    pub name: String,
    /// The number of the frame. `None` if each sensor of the job has one frame.
    pub frame: Option<u64>,
    /// The number of the return of each pixel that was compared, from 0.
    pub number: usize,
    /// The table of the sensor in the job.
    pub written_at: Option<Place>,
    /// The differences, where and why. It is empty if no channel differs beyond its tolerance.
    pub differences: Vec<Difference>,
    /// The channels that were compared. Channels that the baseline keeps only as hashes have no statistics.
    pub channels: Vec<ChannelDifference>,
    /// Rows of the run's image.
    pub rows: usize,
    /// Columns of the run's image.
    pub columns: usize,
    /// The pixels that the baseline keeps: some of the channels, rounded to [`ChannelDifference::resolution`]. They are
    /// present if a channel differs from the baseline at all and the images have the same size.
    pub baseline: Option<Image>,
}

/// A difference of a sensor's frame from its baseline.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Difference {
    /// The sentence that says what differs, where and why.
    pub sentence: String,
    /// The channel that shows it best. `None` if the sentence is about all channels.
    pub channel: Option<String>,
    /// The row and the column of the pixel that differs most.
    pub pixel: Option<[usize; 2]>,
}

/// The evidence for the finding of an expectation.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Sight {
    /// The frame of a sensor.
    Frame {
        /// The sensor's name.
        sensor: String,
        /// The frame's number.
        frame: u64,
        /// The channel that shows it best. `None` for the main one.
        channel: Option<&'static str>,
        /// The row and the column of the pixel that decides.
        pixel: Option<[usize; 2]>,
    },
    /// The map of the ground that the rig sees.
    Ground,
}

/// A change since the baseline was accepted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Change {
    /// The sensor that the change concerns. `None` if every sensor depends on it.
    pub sensor: Option<String>,
    /// The key, beam or file that changed: `range.max_m`, `beam (row 17) elevation`, `../scenes/street.glb`. If the text
    /// says all by itself, there is neither an old nor a new value.
    pub what: String,
    /// The value before the change. `None` if there was none.
    pub old: Option<String>,
    /// The value after the change. `None` if there is none.
    pub new: Option<String>,
}

impl Change {
    /// The key, beam or file with the sensor that it concerns: `sensor roof: range.max_m`.
    pub fn subject(&self) -> String {
        match &self.sensor {
            Some(sensor) => format!("sensor {sensor}: {}", self.what),
            None => self.what.clone(),
        }
    }

    /// The change without its sensor: `range.max_m 150.0 → 120.0`.
    pub fn words(&self) -> String {
        let Self { what, old, new, .. } = self;
        if old.is_none() && new.is_none() {
            return what.clone();
        }
        let shown = |value: &Option<String>| value.clone().unwrap_or_else(|| "unset".to_owned());
        format!("{what} {} → {}", shown(old), shown(new))
    }
}

impl fmt::Display for Change {
    /// Writes the change with its sensor: `sensor roof: range.max_m 150.0 → 120.0`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.sensor {
            Some(sensor) => write!(f, "sensor {sensor}: {}", self.words()),
            None => f.write_str(&self.words()),
        }
    }
}

/// The outcome of an `[[expect]]`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ExpectationOutcome {
    /// The expectation's name in the job.
    pub name: String,
    /// Whether the expectation is met.
    pub met: bool,
    /// The expectation in words: `at least 50 points on "crate_3"`.
    pub expected: String,
    /// The finding: `31 points`.
    pub found: String,
    /// The sensor, pixel, place or direction that decides. It is empty if there is none.
    pub place: String,
    /// The evidence for the finding, such as the frame of the sensor that decides.
    pub sights: Vec<Sight>,
    /// In how many frames it is met.
    pub counts: FrameCounts,
    /// The table of the expectation in the job.
    pub written_at: Option<Place>,
}

/// In how many frames an expectation is met.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameCounts {
    /// The frames that it looks at.
    pub looked_at: u64,
    /// The frames in which it is met.
    pub met: u64,
    /// The time from the start of the first frame that it looks at to the start of the first frame in which it is met, in
    /// seconds.
    pub first_met_s: Option<f64>,
    /// The changes from a frame in which it is met to the next in which it is not, and back.
    pub changes: u64,
}

impl SensorOutcome {
    /// The frame in words, as `title` has it.
    pub fn title(&self) -> String {
        title(&self.name, self.frame, self.number)
    }
}

/// A sensor's frame in words: `sensor roof`, or `sensor roof, frame 50` in a sequence. Where not the first return of each pixel is meant,
/// its number, counted from 0, is behind it: `sensor roof, return 1`.
pub fn title(sensor: &str, frame: Option<u64>, number: usize) -> String {
    let frame = frame.map_or(String::new(), |frame| format!(", frame {frame}"));
    let number = if number > 0 { format!(", return {number}") } else { String::new() };
    format!("sensor {sensor}{frame}{number}")
}
