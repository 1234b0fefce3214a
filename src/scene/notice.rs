//! What a scene's user should know about how it was read.

use std::fmt;

use serde::Serialize;

use crate::source::Severity;

/// Something about a scene that its user should know, though the scene can be used.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Notice {
    /// [`Severity::Warning`] if the scene is perhaps not what was meant, [`Severity::Note`] if it is, and a part of its file
    /// is of no use here.
    pub severity: Severity,
    /// The element, from the outside in, such as `node 3 "wall", mesh 2`. Empty for the file as a whole.
    pub place: String,
    /// One sentence without a full stop.
    pub message: String,
    /// A sentence about what would be right.
    pub help: Option<String>,
}

impl Notice {
    /// A warning.
    pub fn warning(place: impl Into<String>, message: impl Into<String>) -> Self {
        Self { severity: Severity::Warning, place: place.into(), message: message.into(), help: None }
    }

    /// A note.
    pub fn note(place: impl Into<String>, message: impl Into<String>) -> Self {
        Self { severity: Severity::Note, ..Self::warning(place, message) }
    }

    /// Adds what would be right.
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}

impl fmt::Display for Notice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.place.is_empty() {
            write!(f, "{}: ", self.place)?;
        }
        f.write_str(&self.message)?;
        if let Some(help) = &self.help {
            write!(f, " ({help})")?;
        }
        Ok(())
    }
}
