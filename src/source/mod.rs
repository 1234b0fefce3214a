//! Texts that users write: where a value stands in them, the problems found in them, and suggestions of what was meant.
//!
//! ```text
//! report       the texts that were read, and every problem found in them
//! diagnostic   one problem, with the place to point at
//! suggest      the nearest of the words, or of the files of a folder
//! ```

mod diagnostic;
mod report;
pub(crate) mod suggest;

use std::fmt;
use std::path::Path;

pub use diagnostic::{Diagnostic, Severity};
pub(crate) use report::{Layer, Report};

/// A range of bytes in one of the texts of a [`Report`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Span {
    /// The number of the text, as [`Report::add`] gave it.
    pub source: u32,
    /// The first byte; texts are shorter than 4 GB.
    pub start: u32,
    /// The byte after the last one.
    pub end: u32,
}

impl Span {
    /// The bytes `range` of a text.
    pub fn new(source: u32, range: std::ops::Range<usize>) -> Self {
        Self { source, start: range.start as u32, end: range.end as u32 }
    }
}

/// A value, and where it was written.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spanned<T> {
    pub value: T,
    pub span: Span,
}

/// Why a file gives no text.
#[derive(Debug)]
pub(crate) enum Unreadable {
    Missing,
    NotAFile(&'static str),
    /// Its bytes, and how many are read at most.
    TooLarge(u64, u64),
    /// It was read, and what is wrong with it is in the report.
    Reported,
    Io(std::io::Error),
}

impl fmt::Display for Unreadable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing => f.write_str("there is no such file"),
            Self::NotAFile(kind) => write!(f, "this is {kind}, not a file"),
            Self::TooLarge(bytes, limit) => {
                write!(f, "the file has {bytes} bytes, more than the {limit} that are read of such a file")
            }
            Self::Reported => f.write_str("the file has errors"),
            Self::Io(error) => write!(f, "the file can't be read: {error}"),
        }
    }
}

/// A path as the user wrote it or, if that says where on this machine the file is, its name alone.
pub(crate) fn portable(as_written: &str) -> String {
    let path = Path::new(as_written);
    match path.file_name() {
        Some(name) if path.has_root() => name.to_string_lossy().into_owned(),
        _ => as_written.to_owned(),
    }
}
