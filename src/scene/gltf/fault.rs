//! What is wrong with an element of a glTF file, before the file's path is known.

use std::fmt;

/// An error about one element.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Fault {
    /// From the outside in, such as `mesh 3 "wall", primitive 0, accessor 7`. Empty for the file as a whole.
    pub element: String,
    /// What is wrong.
    pub problem: String,
    /// What would be right.
    pub help: Option<String>,
}

impl Fault {
    pub fn new(element: impl Into<String>, problem: impl Into<String>) -> Self {
        Self { element: element.into(), problem: problem.into(), help: None }
    }

    /// Adds what would be right.
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// Says that the element belongs to `outer`.
    pub fn within(mut self, outer: impl fmt::Display) -> Self {
        self.element =
            if self.element.is_empty() { outer.to_string() } else { format!("{outer}, {}", self.element) };
        self
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

/// A text from the file, safe to show: control and direction-changing characters escaped, cut when long.
pub(super) fn quoted(text: &str) -> String {
    const LONGEST: usize = 80;
    match text.char_indices().nth(LONGEST) {
        None => format!("{text:?}"),
        Some((end, _)) => format!("{:?}…", &text[..end]),
    }
}

/// `1 node`, `2 nodes`.
pub(super) fn counted(count: u64, noun: &str) -> String {
    format!("{count} {noun}{}", if count == 1 { "" } else { "s" })
}

/// An element that does not exist, where the file has `count` of its kind.
pub(super) fn missing(kind: &str, index: u32, count: usize) -> Fault {
    let problem = match count {
        0 => "it does not exist: the file has none".to_owned(),
        _ => format!("it does not exist: the last one is {}", count - 1),
    };
    Fault::new(format!("{kind} {index}"), problem)
}
