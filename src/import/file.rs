//! A vendor's file, whose problems are reported.

use std::ops::Range;

use crate::source::csv::{Row, rows};
use crate::source::tree::Node;
use crate::source::{Report, Span, yaml};

/// A file that is imported: one of the texts of a report.
#[derive(Clone, Copy, Debug)]
pub(super) struct File<'a> {
    pub report: &'a Report,
    /// The number of its text in the report.
    pub source: u32,
    /// The file's name as the user gave it.
    pub name: &'a str,
}

impl<'a> File<'a> {
    /// The name's last part, for a comment: the names of the user's folders are nobody else's business.
    pub fn short_name(&self) -> &'a str {
        self.name.rsplit(['/', '\\']).next().unwrap_or(self.name)
    }

    /// The file as YAML or JSON. `None` if it is neither; the report says why.
    pub fn document(&self) -> Option<Node> {
        yaml::parse(self.report, self.source)
    }

    /// The file as CSV: the lines that have any content.
    pub fn rows(&self) -> impl Iterator<Item = Row<'a>> {
        rows(self.report.text(self.source), self.source).filter(|row| !row.is_empty())
    }

    /// The text of a span.
    pub fn text(&self, span: Span) -> &'a str {
        self.report.text(self.source).get(span.start as usize..span.end as usize).unwrap_or_default()
    }

    /// A range of bytes of the file.
    pub fn span(&self, range: Range<usize>) -> Span {
        Span::new(self.source, range)
    }

    /// The span that stands for the file as a whole: its beginning.
    pub fn whole(&self) -> Span {
        self.span(0..0)
    }

    /// Records a problem. Gives `None`, for the value that can't be had.
    pub fn fail<T>(
        &self,
        span: Span,
        message: impl Into<String>,
        label: impl Into<String>,
        help: impl Into<Option<String>>,
    ) -> Option<T> {
        self.report.fail(span, message, label, help.into())
    }

    /// Whether any file of this import has problems.
    pub fn has_errors(&self) -> bool {
        self.report.has_errors()
    }
}
