//! The texts that a configuration comes from, and the problems found in them.

use std::cell::RefCell;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::{Diagnostic, Doubt, Place, Severity, Span, Unreadable, read_file};

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

#[derive(Clone, Debug)]
struct Source {
    path: PathBuf,
    text: Arc<str>,
    layer: Layer,
    /// Whether messages may show parts of the text.
    is_shown: bool,
}

/// Every text that was read and every problem found in them.
#[derive(Debug, Default)]
pub(crate) struct Report {
    sources: Vec<Source>,
    found: RefCell<Vec<(Span, Diagnostic)>>,
}

/// The texts of a report, without the problems found in them, for reading them anew.
#[derive(Clone, Debug)]
pub(crate) struct Texts(Vec<Source>);

impl Texts {
    /// A report of these texts in which nothing was found yet.
    pub fn report(&self) -> Report {
        Report { sources: self.0.clone(), found: RefCell::default() }
    }

    /// The length of all texts in bytes.
    pub fn bytes(&self) -> usize {
        self.0.iter().map(|source| source.text.len()).sum()
    }
}

/// The largest text that is read. A parsed one takes about a hundred times its size in memory.
pub(crate) const MAX_TEXT_BYTES: u64 = 4 << 20;

/// Most problems that are kept. No one reads more, and a hostile file must not make more work than that.
const MAX_PROBLEMS: usize = 200;

impl Report {
    /// Reads a file as a text, as [`read_file`] does, and gives the text's number.
    pub fn open(&mut self, path: &Path, layer: Layer) -> Result<u32, Unreadable> {
        self.open_up_to(path, layer, MAX_TEXT_BYTES)
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
        let is_shown = layer != Layer::Preset || self.is_nearby(path);
        match String::from_utf8(bytes) {
            Ok(text) => Ok(self.add_source(path, text, layer, is_shown)),
            Err(error) => {
                let at = error.utf8_error().valid_up_to();
                let byte = error.as_bytes()[at];
                let text = String::from_utf8_lossy(error.as_bytes()).into_owned();
                let source = self.add_source(path, text, layer, is_shown);
                let span = Span::new(source, at..at + char::REPLACEMENT_CHARACTER.len_utf8());
                let message = format!("the file is not UTF-8 text: byte 0x{byte:02x} here");
                self.error(span, message, "not UTF-8", Some("save the file as UTF-8".to_owned()));
                Err(Unreadable::Reported)
            }
        }
    }

    /// Adds a text under a name that stands for its file, and gives the text's number.
    pub fn add(&mut self, path: impl AsRef<Path>, text: String, layer: Layer) -> u32 {
        self.add_source(path.as_ref(), text, layer, true)
    }

    fn add_source(&mut self, path: &Path, text: String, layer: Layer, is_shown: bool) -> u32 {
        self.sources.push(Source { path: path.to_path_buf(), text: text.into(), layer, is_shown });
        (self.sources.len() - 1) as u32
    }

    /// Whether messages may show parts of a text. A job can name any file of the machine as its sensor file or table of rays,
    /// and whoever wrote the job may be one who sees the messages and not the files.
    pub fn is_shown(&self, source: u32) -> bool {
        self.sources[source as usize].is_shown
    }

    /// Whether a file, wherever links lead, lies under the folder of the first file or under the current folder.
    fn is_nearby(&self, path: &Path) -> bool {
        let own = self.sources.first().and_then(|first| first.path.parent());
        let folders = own.into_iter().chain([Path::new(".")]);
        let whole = |folder: &Path| {
            fs::canonicalize(if folder.as_os_str().is_empty() { Path::new(".") } else { folder }).ok()
        };
        let Ok(real) = fs::canonicalize(path) else { return false };
        // Everything lies under the root.
        folders.filter_map(whole).any(|folder| folder.parent().is_some() && real.starts_with(folder))
    }

    /// The texts, without those that are longer than any that values stand in: tables of rays.
    pub fn texts(&self) -> Texts {
        let kept = |source: &Source| match source.text.len() as u64 {
            0..=MAX_TEXT_BYTES => source.clone(),
            _ => Source { text: "".into(), ..source.clone() },
        };
        Texts(self.sources.iter().map(kept).collect())
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

    /// Records a warning about a value that is probably not what was meant.
    pub fn doubt(&self, span: Span, doubt: Doubt) {
        self.add_found(span, doubt.at(&self.place_in_text(span)));
    }

    /// A place for what is said about it later: of a text that is not shown, its file.
    pub fn place(&self, span: Span) -> Place {
        let place = self.place_in_text(span);
        match self.sources[span.source as usize].is_shown {
            true => place,
            false => Place { path: place.path, ..Place::default() },
        }
    }

    fn place_in_text(&self, span: Span) -> Place {
        let Source { path, text, .. } = &self.sources[span.source as usize];
        Place { path: path.clone(), source: Arc::clone(text), span: span.start as usize..span.end as usize }
    }

    fn record(&self, severity: Severity, span: Span, message: String, label: String, help: Option<String>) {
        let doubt = Doubt { code: "", key: String::new(), message, label, help };
        self.add_found(span, Diagnostic { severity, ..doubt.at(&self.place_in_text(span)) });
    }

    fn add_found(&self, span: Span, mut diagnostic: Diagnostic) {
        let mut found = self.found.borrow_mut();
        if let Some((_, rest)) = found.get_mut(MAX_PROBLEMS) {
            rest.severity = rest.severity.max(diagnostic.severity);
            return;
        }
        if !self.sources[span.source as usize].is_shown {
            let (line, column) = diagnostic.line_column();
            diagnostic.message = format!(
                "line {line}, column {column} is wrong; the text is not shown, because the file is not under the job's folder"
            );
            (diagnostic.source, diagnostic.span, diagnostic.label) = ("".into(), 0..0, String::new());
            diagnostic.help = Some("the file's own messages are shown when it is beside the job".to_owned());
        }
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
