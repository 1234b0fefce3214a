//! The bytes of a stream, and what can be wrong with them.

use std::borrow::Cow;

/// An error in a stream.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(in super::super) struct StreamError(Cow<'static, str>);

impl From<&'static str> for StreamError {
    fn from(problem: &'static str) -> Self {
        Self(problem.into())
    }
}

impl From<String> for StreamError {
    fn from(problem: String) -> Self {
        Self(problem.into())
    }
}

pub(super) const CUT_SHORT: &str = "the stream is cut short";
pub(super) const TOO_LONG: &str = "bytes are left over";

/// Splits `count` bytes off the front of `rest`.
pub(super) fn take<'a>(rest: &mut &'a [u8], count: usize) -> Result<&'a [u8], &'static str> {
    let (taken, left) = rest.split_at_checked(count).ok_or(CUT_SHORT)?;
    *rest = left;
    Ok(taken)
}

pub(super) fn take_byte(rest: &mut &[u8]) -> Result<u8, &'static str> {
    Ok(take(rest, 1)?[0])
}

/// Drops the header byte and splits a tail of `tail` bytes off the end.
pub(super) fn split_tail(stream: &[u8], tail: usize) -> Result<(&[u8], &[u8]), &'static str> {
    let middle = stream.len().checked_sub(tail).filter(|&middle| middle >= 1).ok_or(CUT_SHORT)?;
    Ok((&stream[1..middle], &stream[middle..]))
}
