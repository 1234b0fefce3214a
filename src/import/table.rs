//! CSV as calibration files have it: no quotes, one record a line.

use std::ops::Range;

use super::report::Report;

/// A field, and where it was written.
#[derive(Clone, Debug)]
pub(super) struct Cell<'a> {
    pub text: &'a str,
    pub span: Range<usize>,
}

impl Cell<'_> {
    /// A finite number. `column` is what the field is called in messages.
    pub fn number(&self, report: &Report, column: &str) -> Option<f64> {
        let value = self.text.parse::<f64>().ok().filter(|value| value.is_finite());
        value.or_else(|| report.error(self.span.clone(), self.describe(column), "expected a number", None))
    }

    /// A whole number from `least` to `most`.
    pub fn integer(&self, report: &Report, column: &str, least: u32, most: u32) -> Option<u32> {
        let value = self.text.parse().ok().filter(|value| (least..=most).contains(value));
        let label = || format!("expected a whole number from {least} to {most}");
        value.or_else(|| report.error(self.span.clone(), self.describe(column), label(), None))
    }

    fn describe(&self, column: &str) -> String {
        let text: String = self.text.chars().take(40).collect();
        if text.is_empty() { format!("`{column}` is empty") } else { format!("`{column}` is {text}") }
    }
}

/// A line that isn't empty.
#[derive(Clone, Debug)]
pub(super) struct Row<'a> {
    pub cells: Vec<Cell<'a>>,
    pub span: Range<usize>,
}

/// The lines that have anything but commas.
pub(super) fn rows(text: &str) -> impl Iterator<Item = Row<'_>> {
    let mut at = if text.starts_with('\u{feff}') { '\u{feff}'.len_utf8() } else { 0 };
    text[at..].split('\n').filter_map(move |line| {
        let start = at;
        at += line.len() + 1;
        let line = line.strip_suffix('\r').unwrap_or(line);
        let has_content = line.chars().any(|c| c != ',' && !c.is_whitespace());
        has_content.then(|| Row { cells: cells(line, start), span: start..start + line.len() })
    })
}

fn cells(line: &str, start: usize) -> Vec<Cell<'_>> {
    let mut at = start;
    let cell = |field| {
        let text = str::trim(field);
        let from = at + (field.len() - field.trim_start().len());
        at += field.len() + 1;
        Cell { text, span: from..from + text.len() }
    };
    line.split(',').map(cell).collect()
}
