//! A vendor's file, and what is wrong with it.

use std::cell::RefCell;
use std::ops::Range;
use std::sync::Arc;

use crate::source::{Diagnostic, Severity};

/// How many problems are kept: no one reads more.
const MOST_PROBLEMS: usize = 50;

/// A file's name and text, and the problems found so far.
#[derive(Debug)]
pub(super) struct Report {
    name: String,
    text: Arc<str>,
    found: RefCell<Vec<Diagnostic>>,
}

impl Report {
    pub fn new(name: &str, text: &str) -> Self {
        Self { name: name.to_owned(), text: text.into(), found: RefCell::default() }
    }

    /// The file's name as the user gave it.
    pub fn name(&self) -> &str {
        &self.name
    }

    pub fn text(&self) -> &str {
        &self.text
    }

    /// Records a problem. Gives `None`, for the value that can't be had.
    pub fn error<T>(
        &self,
        span: Range<usize>,
        message: impl Into<String>,
        label: impl Into<String>,
        help: impl Into<Option<String>>,
    ) -> Option<T> {
        let mut found = self.found.borrow_mut();
        if found.len() < MOST_PROBLEMS {
            let start = self.text.floor_char_boundary(span.start);
            let end = self.text.floor_char_boundary(span.end).max(start);
            found.push(Diagnostic {
                severity: Severity::Error,
                message: message.into(),
                path: self.name.as_str().into(),
                source: self.text.clone(),
                span: start..end,
                label: label.into(),
                help: help.into(),
            });
        }
        None
    }

    pub fn has_errors(&self) -> bool {
        !self.found.borrow().is_empty()
    }

    /// Everything found, in the order of the text.
    pub fn into_diagnostics(self) -> Vec<Diagnostic> {
        let mut found = self.found.into_inner();
        found.sort_by_key(|d| d.span.start);
        found
    }
}
