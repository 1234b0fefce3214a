//! The texts that a configuration comes from, and the problems found in them.

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::{Diagnostic, Severity, Span, Unreadable, read_file};

/// Where a text stands in the order of precedence: the last layer that gives a key decides its value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Layer {
    /// A sensor file that a job names.
    Preset,
    /// The file that the user named.
    Main,
    /// A `--set`.
    Override,
}

#[derive(Debug)]
struct Source {
    path: PathBuf,
    text: Arc<str>,
    layer: Layer,
}

/// Every text that was read and every problem found in them.
#[derive(Debug, Default)]
pub(crate) struct Report {
    sources: Vec<Source>,
    found: RefCell<Vec<(Span, Diagnostic)>>,
}

/// The largest file that is read. A parsed file takes about a hundred times its size in memory.
const MAX_FILE_BYTES: u64 = 4 << 20;

/// Most problems that are kept. No one reads more, and a hostile file must not make more work than that.
const MAX_PROBLEMS: usize = 200;

impl Report {
    /// Reads a file as a text, as [`read_file`] does, and gives the text's number.
    pub fn open(&mut self, path: &Path, layer: Layer) -> Result<u32, Unreadable> {
        self.open_up_to(path, layer, MAX_FILE_BYTES)
    }

    /// The folder that paths in a text are relative to: that of its file or, for an override from the command line, that of
    /// the first file.
    pub fn folder(&self, span: Span) -> &Path {
        let source = match self.sources[span.source as usize].layer {
            Layer::Override => 0,
            _ => span.source as usize,
        };
        self.sources[source].path.parent().unwrap_or(Path::new(""))
    }

    /// The same for a file of at most `limit` bytes.
    pub fn open_up_to(&mut self, path: &Path, layer: Layer, limit: u64) -> Result<u32, Unreadable> {
        let bytes = read_file(path, limit)?;
        match String::from_utf8(bytes) {
            Ok(text) => Ok(self.add(path, text, layer)),
            Err(error) => {
                let at = error.utf8_error().valid_up_to();
                let byte = error.as_bytes()[at];
                let text = String::from_utf8_lossy(error.as_bytes()).into_owned();
                let source = self.add(path, text, layer);
                let span = Span::new(source, at..at + char::REPLACEMENT_CHARACTER.len_utf8());
                let message = format!("the file is not UTF-8 text: byte 0x{byte:02x} here");
                self.error(span, message, "not UTF-8", Some("save the file as UTF-8".to_owned()));
                Err(Unreadable::Reported)
            }
        }
    }

    /// Adds a text under a name that stands for its file, and gives the text's number.
    pub fn add(&mut self, path: impl AsRef<Path>, text: String, layer: Layer) -> u32 {
        self.sources.push(Source { path: path.as_ref().to_path_buf(), text: text.into(), layer });
        (self.sources.len() - 1) as u32
    }

    /// The whole text of a number.
    pub fn text(&self, source: u32) -> &str {
        &self.sources[source as usize].text
    }

    /// Of two spans that contradict each other, the one to point at: the one whose layer comes last.
    pub fn later(&self, a: Span, b: Span) -> Span {
        let layer = |p: Span| self.sources[p.source as usize].layer;
        if layer(b) > layer(a) { b } else { a }
    }

    /// Records an error.
    pub fn error(
        &self,
        span: Span,
        message: impl Into<String>,
        label: impl Into<String>,
        help: Option<String>,
    ) {
        self.record(Severity::Error, span, message.into(), label.into(), help);
    }

    /// Records an error. Gives `None`, for the value that can't be had.
    pub fn fail<T>(
        &self,
        span: Span,
        message: impl Into<String>,
        label: impl Into<String>,
        help: Option<String>,
    ) -> Option<T> {
        self.error(span, message, label, help);
        None
    }

    /// Records a warning.
    pub fn warning(
        &self,
        span: Span,
        message: impl Into<String>,
        label: impl Into<String>,
        help: Option<String>,
    ) {
        self.record(Severity::Warning, span, message.into(), label.into(), help);
    }

    fn record(&self, severity: Severity, span: Span, message: String, label: String, help: Option<String>) {
        let mut found = self.found.borrow_mut();
        if let Some((_, rest)) = found.get_mut(MAX_PROBLEMS) {
            rest.severity = rest.severity.max(severity);
            return;
        }
        let source = &self.sources[span.source as usize];
        let mut diagnostic = Diagnostic {
            severity,
            message,
            path: source.path.clone(),
            source: Arc::clone(&source.text),
            span: span.start as usize..span.end as usize,
            label,
            help,
        };
        if found.len() == MAX_PROBLEMS {
            diagnostic.message = format!("more than {MAX_PROBLEMS} problems: the rest is not shown");
            diagnostic.label = "first of the rest".to_owned();
            diagnostic.help = None;
        }
        // Two sensors that share a file find the same problems in it.
        if !found.iter().any(|(p, d)| *p == span && d.message == diagnostic.message) {
            found.push((span, diagnostic));
        }
    }

    /// Whether anything stops the run.
    pub fn has_errors(&self) -> bool {
        self.found.borrow().iter().any(|(_, d)| d.severity == Severity::Error)
    }

    /// Everything found, text by text in the order they were read, from top to bottom.
    pub fn into_diagnostics(self) -> Vec<Diagnostic> {
        let mut found = self.found.into_inner();
        found.sort_by_key(|(span, _)| (span.source, span.start));
        found.into_iter().map(|(_, diagnostic)| diagnostic).collect()
    }
}
