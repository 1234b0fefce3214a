//! The limit of a frame's rays.

use crate::source::{Report, Span};

/// Most rays of a frame: pixels have 32-bit numbers.
const MAX_RAYS: u64 = 1 << 32;

/// Refuses more rays than pixels can be numbered. `span` is where the columns are written.
pub(super) fn check_rays(report: &Report, rows: u64, columns: u64, span: Span) -> Option<()> {
    if rows.checked_mul(columns).is_some_and(|rays| rays <= MAX_RAYS) {
        return Some(());
    }
    let message = format!("{rows} rows of {columns} columns are more than {MAX_RAYS} rays a frame");
    report.error(span, message, "expected fewer", None);
    None
}
