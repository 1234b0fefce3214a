//! One problem in a text that the user wrote.

use std::fmt;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::ser::SerializeStruct as _;
use serde::{Serialize, Serializer};

/// One problem in a text that the user wrote, with the place to point at.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// How bad it is: an error stops the run.
    pub severity: Severity,
    /// The name of the rule that a warning comes from, such as `rpy-in-radians`. Empty if it has none.
    pub code: &'static str,
    /// The key that is meant, as messages write it, such as `fx_px`. Empty if there is none.
    pub key: String,
    /// The fault in one sentence, with the key and the value.
    pub message: String,
    /// The file as the user named it, or what stands for one (`--set`).
    pub path: PathBuf,
    /// That file's whole text, shared by all that is said about it. Empty when it could not be read.
    pub source: Arc<str>,
    /// The bytes of `source` that are meant; empty for the file as a whole.
    pub span: Range<usize>,
    /// A short note under the marked text, such as `expected a number of metres`.
    pub label: String,
    /// A sentence about the value that would be right.
    pub help: Option<String>,
}

/// A place in a text that the user wrote, for what is said about it later.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Place {
    /// The file as the user named it, or what stands for one.
    pub path: PathBuf,
    /// That file's whole text.
    pub source: Arc<str>,
    /// The bytes of the text that are meant.
    pub span: Range<usize>,
}

/// A value that is valid and probably not what was meant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Doubt {
    /// The name of the rule, such as `rpy-in-radians`.
    pub code: &'static str,
    /// The key that is meant, as messages write it.
    pub key: String,
    /// The oddity, in one sentence, with the key and the value.
    pub message: String,
    /// A short note under the marked text.
    pub label: String,
    /// The likely intention, in a sentence.
    pub help: Option<String>,
}

impl Doubt {
    /// A doubt about a key, without a note and a help.
    pub fn new(code: &'static str, key: impl Into<String>, message: impl Into<String>) -> Self {
        Self { code, key: key.into(), message: message.into(), label: String::new(), help: None }
    }

    /// Adds a short note under the marked text.
    #[must_use]
    pub fn label(self, label: impl Into<String>) -> Self {
        Self { label: label.into(), ..self }
    }

    /// Adds what was probably meant.
    #[must_use]
    pub fn help(self, help: impl Into<String>) -> Self {
        Self { help: Some(help.into()), ..self }
    }

    /// The warning about a place.
    pub fn at(self, place: &Place) -> Diagnostic {
        let Self { code, key, message, label, help } = self;
        let Place { path, source, span } = place.clone();
        Diagnostic { severity: Severity::Warning, code, key, message, path, source, span, label, help }
    }
}

/// How bad a [`Diagnostic`] is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Severity {
    /// The run goes on as it should; a part of the input is of no use to it.
    Note,
    /// The run goes on, its result is probably not what was meant.
    Warning,
    /// Nothing can be run.
    Error,
}

impl Place {
    /// The line and the column in characters, both from 1. `None` for the file as a whole.
    pub fn line_column(&self) -> Option<(usize, usize)> {
        (!self.source.is_empty()).then(|| line_column(&self.source, self.span.start))
    }
}

/// The line and the column (in characters) of a byte of a text, both from 1.
fn line_column(text: &str, byte: usize) -> (usize, usize) {
    let before = &text[..text.floor_char_boundary(byte)];
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().unwrap_or("").chars().count() + 1;
    (line, column)
}

impl Diagnostic {
    /// An error about a file as a whole, whose text is not shown.
    pub(crate) fn about_file(path: &Path, message: String, help: Option<String>) -> Self {
        Self {
            severity: Severity::Error,
            code: "",
            key: String::new(),
            message,
            path: path.to_path_buf(),
            source: "".into(),
            span: 0..0,
            label: String::new(),
            help,
        }
    }

    /// Line and column (in characters) of the span's start, both from 1.
    pub fn line_column(&self) -> (usize, usize) {
        line_column(&self.source, self.span.start)
    }

    /// The place that is meant.
    pub fn place(&self) -> Place {
        Place { path: self.path.clone(), source: Arc::clone(&self.source), span: self.span.clone() }
    }

    /// The fault and what would be right, without the place.
    pub fn sentence(&self) -> String {
        match &self.help {
            Some(help) => format!("{} ({help})", self.message),
            None => self.message.clone(),
        }
    }
}

impl Serialize for Diagnostic {
    /// The problem and its place, without the text that it is in.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let (line, column) = self.line_column();
        let mut object = serializer.serialize_struct("Diagnostic", 9)?;
        let given = |text: &str| (!text.is_empty()).then(|| text.to_owned());
        object.serialize_field("severity", &self.severity)?;
        object.serialize_field("code", &given(self.code))?;
        object.serialize_field("key", &given(&self.key))?;
        object.serialize_field("path", &self.path.to_string_lossy())?;
        object.serialize_field("line", &line)?;
        object.serialize_field("column", &column)?;
        object.serialize_field("message", &self.message)?;
        object.serialize_field("label", &self.label)?;
        object.serialize_field("help", &self.help)?;
        object.end()
    }
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:", self.path.display())?;
        if !self.source.is_empty() {
            let (line, column) = self.line_column();
            write!(f, "{line}:{column}:")?;
        }
        write!(f, " {}", self.sentence())
    }
}
