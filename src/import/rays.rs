//! A ray a line: a table that `[rays]` reads as it is. What is written is the sensor file that names it.

use super::file_name;
use super::report::Report;
use super::table::rows;
use super::writer::Toml;

/// Whether a head names a ray's direction.
pub(super) fn is_head(head: &[String]) -> bool {
    let has = |names: &[&str]| names.iter().all(|name| head.iter().any(|column| column == name));
    has(&["azimuth_deg", "elevation_deg"]) || has(&["x", "y", "z"])
}

pub(super) fn write(report: &Report, toml: &mut Toml) -> Option<()> {
    let mut lines = rows(report.text()).filter(|row| !row.cells[0].text.starts_with('#'));
    let head = lines.next();
    let names: Vec<String> =
        head.iter().flat_map(|row| &row.cells).map(|cell| cell.text.to_lowercase()).collect();
    if !is_head(&names) {
        let span = head.map_or(0..0, |row| row.span);
        let label = "expected azimuth_deg and elevation_deg, or x, y and z, among the columns";
        return report.error(span, "this is no table of rays", label, None);
    }
    let count = lines.count();
    if count == 0 {
        return report.error(0..0, "the table has no rays", "", None);
    }
    toml.comment(&format!("{count} rays, in the order of {}.", file_name(report.name())));
    toml.comment("\nNot in the file, and to be checked: rate (none), range limits (none).");
    toml.table("rays");
    toml.text("file", report.name());
    Some(())
}
