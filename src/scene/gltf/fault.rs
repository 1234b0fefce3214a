//! Errors about the elements of a glTF file, before the file's path is known.

use std::fmt;
use std::io;
use std::path::PathBuf;

use crate::source::Unreadable;

/// An error about one element.
#[derive(Debug)]
pub(super) struct Fault {
    /// The file, if it is another than the scene's.
    pub file: Option<PathBuf>,
    /// The element, from the outside in, such as `mesh 3 "wall", primitive 0, accessor 7`. Empty for the file as a whole.
    pub element: String,
    /// The problem.
    pub problem: String,
    /// A sentence about the value that would be right.
    pub help: Option<String>,
    /// The error of the operating system that is behind it.
    pub source: Option<io::Error>,
}

impl Fault {
    pub fn new(element: impl Into<String>, problem: impl Into<String>) -> Self {
        Self { file: None, element: element.into(), problem: problem.into(), help: None, source: None }
    }

    /// Adds what would be right.
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// Adds that the problem is with the file `name`.
    pub fn of_file(mut self, name: &str) -> Self {
        self.problem = format!("the file {name}: {}", self.problem);
        self
    }

    /// Adds that the element belongs to `outer`.
    pub fn within(mut self, outer: impl fmt::Display) -> Self {
        self.element =
            if self.element.is_empty() { outer.to_string() } else { format!("{outer}, {}", self.element) };
        self
    }
}

impl From<Unreadable> for Fault {
    fn from(error: Unreadable) -> Self {
        let fault = Self::new("", error.to_string());
        match error {
            Unreadable::Io(error) => Self { source: Some(error), ..fault },
            _ => fault,
        }
    }
}

#[cfg(test)]
impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.element.is_empty() {
            write!(f, "{}: ", self.element)?;
        }
        f.write_str(&self.problem)?;
        if let Some(help) = &self.help {
            write!(f, " ({help})")?;
        }
        Ok(())
    }
}

/// Quotes a text from the file so that it is safe to show: control and direction-changing characters are escaped, and a long
/// text is cut.
pub(super) fn quoted(text: &str) -> String {
    const LONGEST: usize = 80;
    match text.char_indices().nth(LONGEST) {
        None => format!("{text:?}"),
        Some((end, _)) => format!("{:?}…", &text[..end]),
    }
}

/// The error that an element does not exist; the file has `count` of its kind.
pub(super) fn missing(kind: &str, index: u32, count: usize) -> Fault {
    let problem = match count {
        0 => "it does not exist: the file has none".to_owned(),
        _ => format!("it does not exist: the last one is {}", count - 1),
    };
    Fault::new(format!("{kind} {index}"), problem)
}
