//! CSV as tables of rays, calibration files and poses have it: no quotes, one record a line. Some have blanks for commas.

use super::words::quoted;
use super::{Report, Span};

/// A field without the blanks around it, and where it was written.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Cell<'a> {
    pub text: &'a str,
    pub span: Span,
}

impl Cell<'_> {
    /// A finite number. `column` is the field's name in messages.
    pub fn number(&self, report: &Report, column: &str) -> Option<f64> {
        let value = self.text.parse::<f64>().ok().filter(|value| value.is_finite());
        value.or_else(|| report.fail(self.span, self.describe(column), "expected a number", None))
    }

    /// A whole number from `least` to `most`.
    pub fn integer(&self, report: &Report, column: &str, least: u32, most: u32) -> Option<u32> {
        let value = self.text.parse().ok().filter(|value| (least..=most).contains(value));
        let label = || format!("expected a whole number from {least} to {most}");
        value.or_else(|| report.fail(self.span, self.describe(column), label(), None))
    }

    fn describe(&self, column: &str) -> String {
        match self.text {
            "" => format!("`{column}` is empty"),
            text => format!("`{column}` is {}", quoted(text)),
        }
    }
}

/// A line that is not blank.
#[derive(Clone, Debug)]
pub(crate) struct Row<'a> {
    /// At least one.
    pub cells: Vec<Cell<'a>>,
    pub span: Span,
}

impl Row<'_> {
    /// The fields in lower case, as headers are compared.
    pub fn lowercase(&self) -> Vec<String> {
        self.cells.iter().map(|cell| cell.text.to_lowercase()).collect()
    }

    /// Whether the line is a comment for people.
    pub fn is_comment(&self) -> bool {
        self.cells[0].text.starts_with('#')
    }

    /// Whether the line has commas only, as spreadsheets write lines without content.
    pub fn is_empty(&self) -> bool {
        self.cells.iter().all(|cell| cell.text.is_empty())
    }
}

/// The lines of the text number `source` that are not blank.
pub(crate) fn rows(text: &str, source: u32) -> impl Iterator<Item = Row<'_>> {
    let mut at = if text.starts_with('\u{feff}') { '\u{feff}'.len_utf8() } else { 0 };
    text[at..].split('\n').filter_map(move |line| {
        let start = at;
        at += line.len() + 1;
        let line = line.trim_end();
        (!line.is_empty()).then(|| Row {
            cells: cells(line, source, start),
            span: Span::new(source, start..start + line.len()),
        })
    })
}

/// The lines of the text number `source` that are not blank, with blanks between their fields.
pub(crate) fn words(text: &str, source: u32) -> impl Iterator<Item = Row<'_>> {
    rows(text, source).map(move |row| {
        let start = row.span.start as usize;
        let line = &text[start..row.span.end as usize];
        let cell = |word: &str| {
            let from = start + (word.as_ptr() as usize - line.as_ptr() as usize);
            Span::new(source, from..from + word.len())
        };
        let cells = line.split_ascii_whitespace().map(|word| Cell { text: word, span: cell(word) });
        Row { cells: cells.collect(), span: row.span }
    })
}

fn cells(line: &str, source: u32, start: usize) -> Vec<Cell<'_>> {
    let mut at = start;
    line.split(',')
        .map(|field| {
            let text = field.trim();
            let from = at + (field.len() - field.trim_start().len());
            at += field.len() + 1;
            Cell { text, span: Span::new(source, from..from + text.len()) }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_know_where_they_stand() {
        let text = "\u{feff}# note\r\n\r\n a ,b\n,\nlast";
        let rows: Vec<Row<'_>> = rows(text, 0).collect();
        let shown: Vec<Vec<&str>> =
            rows.iter().map(|row| row.cells.iter().map(|cell| cell.text).collect()).collect();
        assert_eq!(shown, [vec!["# note"], vec!["a", "b"], vec!["", ""], vec!["last"]]);
        for cell in rows.iter().flat_map(|row| &row.cells) {
            assert_eq!(&text[cell.span.start as usize..cell.span.end as usize], cell.text);
        }
        assert!(rows[0].is_comment() && rows[2].is_empty() && !rows[3].is_empty());
    }
}
