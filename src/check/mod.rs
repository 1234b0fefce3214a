//! Regression of sensor configurations: frames against what they were, and against what they should be.
//!
//! ```text
//! compare      two images, channel by channel: how many pixels differ, by how much, where
//! outcome      what came of a check, as plain data that reports are written from
//! ```

pub mod compare;
mod outcome;

pub use outcome::{Change, ExpectationOutcome, Outcome, SensorOutcome, Verdict};
