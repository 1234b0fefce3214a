//! The kind of a file, by its content: the one place that recognises files.
//!
//! ```text
//! kind    what files are, in words, and what mends them
//! binary  signatures: the first bytes of containers, images, meshes and clouds
//! json    the outermost keys of JSON, and what they tell
//! text    other texts: meshes, XML, YAML, TOML, tables
//! ```
//!
//! The name of a file says nothing here. What is recognised is only named and, where a program mends it, so is the program:
//! readers decide by their own rules whether they can read a file, and ask here when they cannot.

mod binary;
mod json;
mod kind;
mod text;

pub use kind::{FileKind, Unit, Wanted};

/// How much of a file's beginning is enough to recognise it, apart from JSON, whose keys may come in any order.
pub(crate) const HEAD_BYTES: usize = 64 << 10;

impl FileKind {
    /// Recognises a file of `length` bytes by its beginning, or by its whole content.
    pub fn of(head: &[u8], length: u64) -> Self {
        if head.is_empty() {
            return if length == 0 { Self::Empty } else { Self::Unknown };
        }
        if let Some(kind) = binary::kind_of(head, length) {
            return kind;
        }
        match text::readable(head) {
            Some("") if head.len() as u64 == length && !head.contains(&0) => Self::Empty,
            Some("") => Self::Unknown,
            Some(text) if text.starts_with('{') => json::kind_of(text),
            Some(text) => text::kind_of(text),
            None => Self::Unknown,
        }
    }

    /// Whether a file with this beginning can only be told by more of it.
    pub(crate) fn needs_more(head: &[u8], length: u64) -> bool {
        let is_cut = (head.len() as u64) < length;
        is_cut && text::readable(head).is_some_and(|text| text.starts_with('{'))
    }
}

#[cfg(test)]
mod tests;
