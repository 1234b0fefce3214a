//! The error of bytes that are no recorded frame.

use std::fmt;

/// The reason why bytes are no recorded frame.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct ReadError(String);

impl ReadError {
    /// An error with this text.
    pub fn new(problem: impl fmt::Display) -> Self {
        Self(problem.to_string())
    }

    /// Refuses numbers that take more than the memory that may be taken, both in bytes.
    pub(super) fn check_memory(needed: u64, memory: u64) -> Result<(), Self> {
        if needed <= memory {
            return Ok(());
        }
        Err(Self::new(format!("it takes {needed} bytes of memory, more than the {memory} that there are")))
    }
}
