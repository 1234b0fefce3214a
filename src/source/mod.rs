//! Texts that users write: files are read here, values get the spans where they were written, and problems are reported at
//! their place with a suggestion of what was meant.
//!
//! ```text
//! read         the one way to read a file
//! memory       the memory of the machine, which bounds what is read
//! file_kind    what a file is, by its content, and what to do with it
//! report       the texts that were read, and every problem found in them
//! diagnostic   one problem, with the place to point at
//! suggest      the nearest of the words, or of the files of a folder
//! words        the user's own words in messages; lists and counts
//! tree         values with their spans; yaml (and JSON) makes them of a text
//! csv          fields with their spans
//! ```

pub(crate) mod csv;
mod diagnostic;
mod file_kind;
pub(crate) mod memory;
mod read;
mod report;
pub(crate) mod suggest;
pub(crate) mod tree;
pub(crate) mod words;
pub(crate) mod yaml;

use std::path::Path;

pub use diagnostic::{Diagnostic, Doubt, Place, Severity};
pub use file_kind::{FileKind, Unit, Wanted};
pub(crate) use read::{Unreadable, is_config, read_file, recognise};
pub(crate) use report::{Layer, MAX_TEXT_BYTES, Report, Texts};

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

/// A path as the user wrote it or, if that says where on this machine the file is, its name alone.
pub(crate) fn portable(as_written: &str) -> String {
    let path = Path::new(as_written);
    match path.file_name() {
        Some(name) if path.has_root() => name.to_string_lossy().into_owned(),
        _ => as_written.to_owned(),
    }
}
