//! RoboSense's angles: CSV with the vertical and the horizontal angle of one channel a line, in degrees, without a header.
//!
//! In the vendor's driver, x = r·cos ε·cos(a + h), y = −r·cos ε·sin(a + h), z = r·sin ε, where the rotor's azimuth a is
//! counted clockwise, seen from above, from the x axis, which is forward: horizontal angles change their sign. The distance
//! between the rotor's axis and the lens is a constant of the model, and is not in the file.

use super::file::File;
use super::lidar::Lidar;
use super::writer::Toml;
use crate::source::tree::count;

pub(super) fn write(file: File<'_>, toml: &mut Toml) -> Option<()> {
    let (mut elevations, mut offsets) = (Vec::new(), Vec::new());
    for row in file.rows() {
        let [vertical, horizontal] = &row.cells[..] else {
            let message = format!("the line has {}", count(row.cells.len(), "field"));
            file.fail::<()>(row.span, message, "expected 2: vertical angle, horizontal angle", None);
            continue;
        };
        let span = vertical.span;
        if let Some(vertical) = vertical.number(file.report, "vertical angle") {
            if vertical.abs() > 90.0 {
                let message = format!("the vertical angle is {vertical} degrees");
                file.fail::<()>(span, message, "expected -90 to 90", None);
            }
            elevations.push(vertical);
        }
        offsets.extend(horizontal.number(file.report, "horizontal angle").map(|h| -h));
    }
    if elevations.is_empty() && !file.has_errors() {
        return file.fail(file.whole(), "the file lists no channel", "", None);
    }
    if file.has_errors() {
        return None;
    }
    toml.comment(&format!("A RoboSense LiDAR with {} channels: {}.", elevations.len(), file.short_name()));
    toml.comment(
        "\nUsed: the vertical and the horizontal angle of each channel. RoboSense counts azimuths clockwise, so the \
         horizontal angles have the opposite sign below.",
    );
    toml.comment(
        "Not in the file, and to be checked: firing times and the distance between lens and axis (none are set), columns \
         and rate (the usual values), range limits (none are set).",
    );
    toml.line("\n# The ring of a cloud counts channels from 0, in the order of the file.");
    Lidar::usual(elevations, offsets).write("file", toml);
    Some(())
}
