//! What came of a check, as plain data: what reports are written from.

use std::fmt;

use super::compare::ChannelDifference;
use crate::output::Image;

/// What came of checking one job.
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// The job's file as the user named it.
    pub job: String,
    /// All in all.
    pub verdict: Verdict,
    /// Sentences about the job as a whole: why it could not be run or compared, and the command that mends it.
    pub problems: Vec<String>,
    /// What changed since the baseline was accepted, whether or not a difference followed from it.
    pub changes: Vec<Change>,
    /// One a sensor, in the job's order. Empty if the job could not be run, or has nothing to be compared with.
    pub sensors: Vec<SensorOutcome>,
    /// One an `[[expect]]`, in the job's order.
    pub expectations: Vec<ExpectationOutcome>,
}

/// The result of a check.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Verdict {
    /// Nothing differs beyond its tolerance, and every expectation is met.
    #[default]
    Passed,
    /// What was found is the baseline from now on; every expectation is met.
    Accepted,
    /// Something differs, is missing, or is not as expected.
    Failed,
    /// The job could not be run: its files are wrong.
    Broken,
}

/// A sensor's frame against its baseline.
#[derive(Clone, Debug, Default)]
pub struct SensorOutcome {
    /// The sensor's name.
    pub name: String,
    /// Sentences on what differs, where and why; empty if nothing does beyond its tolerance.
    pub differences: Vec<String>,
    /// The channels that were compared. Those that a baseline keeps as hashes only have no statistics.
    pub channels: Vec<ChannelDifference>,
    /// Rows of the run's image.
    pub rows: usize,
    /// Columns of the run's image.
    pub columns: usize,
    /// What the baseline keeps of its pixels: a part of the channels, rounded to [`ChannelDifference::resolution`]. Present
    /// if a channel differs from the baseline at all and the images have the same size.
    pub baseline: Option<Image>,
}

/// Something that is not as it was when the baseline was accepted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Change {
    /// The sensor that it is about; `None` if every sensor depends on it.
    pub sensor: Option<String>,
    /// The key, beam or file that changed: `range.max_m`, `beam (row 17) elevation`, `../scenes/street.glb`. If it says all
    /// by itself, there is neither an old nor a new value.
    pub what: String,
    /// The value before; `None` if there was none.
    pub old: Option<String>,
    /// The value now; `None` if there is none.
    pub new: Option<String>,
}

impl Change {
    /// The key, beam or file with the sensor that it is about: `sensor roof: range.max_m`.
    pub fn subject(&self) -> String {
        match &self.sensor {
            Some(sensor) => format!("sensor {sensor}: {}", self.what),
            None => self.what.clone(),
        }
    }

    /// The change without the sensor that it is about: `range.max_m 150.0 → 120.0`.
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
    /// `sensor roof: range.max_m 150.0 → 120.0`
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.sensor {
            Some(sensor) => write!(f, "sensor {sensor}: {}", self.words()),
            None => f.write_str(&self.words()),
        }
    }
}

/// What came of an `[[expect]]`.
#[derive(Clone, Debug, PartialEq)]
pub struct ExpectationOutcome {
    /// Its name in the job.
    pub name: String,
    /// Whether it is met.
    pub met: bool,
    /// What should be, in words: `at least 50 points on "crate_3"`.
    pub expected: String,
    /// What was found: `31 points`.
    pub found: String,
    /// Where: the sensor, pixel, place or direction that decides. Empty where there is none.
    pub place: String,
}
