//! The texts that a configuration comes from, and the problems found in them.

use std::cell::RefCell;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::{Diagnostic, Severity, Span, Unreadable};

/// Where a text stands in the order of precedence: what is said later wins.
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

/// The largest file that is read. A parsed file takes about a hundred times its size.
const MAX_FILE_BYTES: u64 = 4 << 20;

/// How many problems are kept: no one reads more, and a hostile file must not make more work than that.
const MAX_PROBLEMS: usize = 200;

impl Report {
    /// Reads a file. Never waits for a pipe or a device.
    pub fn open(&mut self, path: &Path, layer: Layer) -> Result<u32, Unreadable> {
        self.open_up_to(path, layer, MAX_FILE_BYTES)
    }

    /// The folder that paths in a text are relative to: its file's or, for what was said on the command line, the first
    /// file's.
    pub fn folder(&self, span: Span) -> &Path {
        let source = match self.sources[span.source as usize].layer {
            Layer::Override => 0,
            _ => span.source as usize,
        };
        self.sources[source].path.parent().unwrap_or(Path::new(""))
    }

    /// Reads a file of at most `limit` bytes. Never waits for a pipe or a device.
    pub fn open_up_to(&mut self, path: &Path, layer: Layer, limit: u64) -> Result<u32, Unreadable> {
        let kind = match std::fs::metadata(path) {
            Err(e)
                if matches!(e.kind(), std::io::ErrorKind::NotFound | std::io::ErrorKind::NotADirectory) =>
            {
                return Err(Unreadable::Missing);
            }
            Err(e) => return Err(Unreadable::Io(e)),
            Ok(kind) => kind,
        };
        if kind.is_dir() {
            return Err(Unreadable::NotAFile("a folder"));
        } else if !kind.is_file() {
            return Err(Unreadable::NotAFile("a pipe or a device"));
        } else if kind.len() > limit {
            return Err(Unreadable::TooLarge(kind.len(), limit));
        }
        let mut bytes = Vec::new();
        let read = std::fs::File::open(path).and_then(|f| f.take(limit + 1).read_to_end(&mut bytes));
        match read {
            Err(e) => return Err(Unreadable::Io(e)),
            Ok(length) if length as u64 > limit => {
                return Err(Unreadable::TooLarge(length as u64, limit));
            }
            Ok(_) => {}
        }
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

    /// Takes in a text that isn't a file's.
    pub fn add(&mut self, path: &Path, text: String, layer: Layer) -> u32 {
        self.sources.push(Source { path: path.to_path_buf(), text: text.into(), layer });
        (self.sources.len() - 1) as u32
    }

    /// A whole text.
    pub fn text(&self, source: u32) -> &str {
        &self.sources[source as usize].text
    }

    /// Of two places that contradict each other, the one to point at: what the user said last.
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
        // Two sensors that share a file have the same to say about it.
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
