//! Regression tests of sensor configurations: frames are compared with accepted frames and with expectations.
//!
//! ```text
//! compare      two images, channel by channel: how many pixels differ, by how much, and where
//! pixels       compact storage of a channel's pixels
//! baseline     the result of an accepted job: hashes, and some of the pixels
//! changes      the changes since then: keys of the job, beams, the scene, the tool
//! judge        judgement of a frame against its baseline; phrasing puts it into words
//! expect       expectations of what a rig should see, and their evaluation
//! cloud        comparison of clouds of any layout, by the Chamfer distance
//! vehicle      the vehicle that carries the rig, as far as the scene has it
//! pictures     pictures of the ground that is covered, and of differences
//! outcome      the outcome of a check as plain data; report and junit write it for people, CI servers and scripts
//! ```

mod baseline;
mod changes;
pub mod cloud;
pub mod compare;
pub mod expect;
mod judge;
pub mod junit;
mod outcome;
pub(crate) mod phrasing;
mod pictures;
mod pixels;
pub mod report;
mod vehicle;

pub use baseline::{
    Baseline, BaselineError, MAX_PIXEL_BYTES, SceneRecord, SensorRecord, Snapshot, StoredPixels,
};
pub use changes::Changes;
pub use compare::Tolerance;
pub use judge::{Settings, confusion_words, judge};
pub use outcome::{
    Change, Difference, ExpectationOutcome, Failure, FrameCounts, Outcome, SensorOutcome, Sight, Verdict,
};
pub use pictures::{GroundMap, axis, colours, difference_picture, difference_scale};
pub use vehicle::Vehicle;
