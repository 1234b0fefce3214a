//! A table of rays, which `[rays]` reads as it is: the import writes the sensor file that names it.

use super::file::File;
use super::writer::Toml;
use crate::config::keys::sensor::{RAYS, rays};

/// Whether a header in lower case has the columns of a ray's direction.
pub(super) fn is_header(header: &[String]) -> bool {
    has(header, &["azimuth_deg", "elevation_deg"])
        || has(header, &["azimuth_deg", "zenith_deg"])
        || has(header, &["x", "y", "z"])
        || is_of_livox(header)
}

/// Whether a header in lower case is that of Livox's pattern tables.
fn is_of_livox(header: &[String]) -> bool {
    has(header, &["azimuth/deg", "zenith/deg"])
}

fn has(header: &[String], names: &[&str]) -> bool {
    names.iter().all(|name| header.iter().any(|column| column == name))
}

pub(super) fn write(file: File<'_>, toml: &mut Toml) -> Option<()> {
    let mut lines = file.rows().filter(|row| !row.is_comment());
    let header = lines.next();
    if !header.as_ref().is_some_and(|header| is_header(&header.lowercase())) {
        let span = header.map_or(file.whole(), |header| header.span);
        let label = "expected azimuth_deg and elevation_deg, or x, y and z, among the columns";
        return file.fail(span, "this is no table of rays", label, None);
    }
    let is_of_livox = header.as_ref().is_some_and(|header| is_of_livox(&header.lowercase()));
    let count = lines.count();
    if count == 0 {
        return file.fail(file.whole(), "the table has no rays", "", None);
    }
    toml.comment(&format!("{count} rays, in the order of {}.", file.short_name()));
    if is_of_livox {
        toml.comment(
            "\nA pattern table of Livox's: elevations are 90 degrees less the zenith. Its Time/s is in seconds in some tables and \
             counts the rays in others, which then all go out at once. The table does not say how many lines fire together, nor \
             how often: for a Mid-360 these are lines = 4, pulse_rate_hz = 50000.0. With rate_hz, a frame has the pulses of its \
             time, and the next one goes on in the table.",
        );
    }
    toml.comment("\nNot in the file, and to be checked: rate (none), range limits (none).");
    toml.table(RAYS.name());
    toml.text(rays::FILE.name(), file.name);
    if is_of_livox {
        toml.line("# lines = 4");
        toml.line("# pulse_rate_hz = 50000.0");
        toml.line("# rate_hz = 10.0");
    }
    Some(())
}
