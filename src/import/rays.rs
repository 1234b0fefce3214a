//! A table of rays, which `[rays]` reads as it is: the import writes the sensor file that names it.

use super::file::File;
use super::writer::Toml;
use crate::config::keys::sensor::{RAYS, rays};

/// Whether a header in lower case has the columns of a ray's direction.
pub(super) fn is_header(header: &[String]) -> bool {
    let has = |names: &[&str]| names.iter().all(|name| header.iter().any(|column| column == name));
    has(&["azimuth_deg", "elevation_deg"]) || has(&["x", "y", "z"])
}

pub(super) fn write(file: File<'_>, toml: &mut Toml) -> Option<()> {
    let mut lines = file.rows().filter(|row| !row.is_comment());
    let header = lines.next();
    if !header.as_ref().is_some_and(|header| is_header(&header.lowercase())) {
        let span = header.map_or(file.whole(), |header| header.span);
        let label = "expected azimuth_deg and elevation_deg, or x, y and z, among the columns";
        return file.fail(span, "this is no table of rays", label, None);
    }
    let count = lines.count();
    if count == 0 {
        return file.fail(file.whole(), "the table has no rays", "", None);
    }
    toml.comment(&format!("{count} rays, in the order of {}.", file.short_name()));
    toml.comment("\nNot in the file, and to be checked: rate (none), range limits (none).");
    toml.table(RAYS.name());
    toml.text(rays::FILE.name(), file.name);
    Some(())
}
