//! Regression of sensor configurations: frames against what they were, and against what they should be.
//!
//! ```text
//! compare      two images, channel by channel: how many pixels differ, by how much, where
//! pixels       a channel in few bytes
//! baseline     what a job gave when it was accepted: hashes, and some of the pixels
//! changes      what changed since: keys of the job, beams, the scene, the tool
//! judge        a frame against its baseline, in words (phrasing)
//! expect       what a rig should see, and whether it does
//! cloud        clouds of any layout, by Chamfer's distance
//! pictures     pictures of ground that is covered and of differences
//! outcome      what came of a check, as plain data; report and junit write it for people, CI servers and scripts
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

pub use baseline::{
    Baseline, BaselineError, MAX_PIXEL_BYTES, SceneRecord, SensorRecord, Snapshot, StoredPixels,
};
pub use changes::Changes;
pub use compare::Tolerance;
pub use judge::{Settings, judge};
pub use outcome::{Change, ExpectationOutcome, Outcome, SensorOutcome, Verdict};
pub use pictures::{Picture, coverage_map, heat_map};
