//! RoboSense's angles: CSV with one channel a line, without a header: its vertical angle in degrees, then its horizontal angle,
//! then its ring. Files of older units have the vertical angle alone; the driver (rs_driver, `loadFromFile`) takes a missing
//! horizontal angle for 0. The driver numbers rings from the lowest channel, so the third column says nothing new.
//!
//! In the vendor's driver, x = r·cos ε·cos(a + h), y = −r·cos ε·sin(a + h), z = r·sin ε, where the rotor's azimuth a is
//! counted clockwise, seen from above, from the x axis, which is forward: horizontal angles change their sign. The distance
//! between the rotor's axis and the lens is a constant of the model, and is not in the file.

use super::file::File;
use super::lidar::{Lidar, MOST_BEAMS};
use super::writer::Toml;
use crate::source::words::counted;

pub(super) fn write(file: File<'_>, toml: &mut Toml) -> Option<()> {
    let (mut elevations, mut offsets) = (Vec::new(), Vec::new());
    for (index, row) in file.rows().enumerate() {
        if index >= MOST_BEAMS as usize {
            let message = format!("the file has more than {MOST_BEAMS} lines");
            return file.fail(row.span, message, "expected one a channel: no unit has so many", None);
        }
        let (vertical, horizontal) = match &row.cells[..] {
            [vertical] => (vertical, None),
            [vertical, horizontal] | [vertical, horizontal, _] => (vertical, Some(horizontal)),
            cells => {
                let message = format!("the line has {}", counted(cells.len(), "field"));
                let label = "expected 1 to 3: vertical angle, horizontal angle, ring";
                file.fail::<()>(row.span, message, label, None);
                continue;
            }
        };
        let span = vertical.span;
        if let Some(vertical) = vertical.number(file.report, "vertical angle") {
            if vertical.abs() > 90.0 {
                let message = format!("the vertical angle is {vertical} degrees");
                file.fail::<()>(span, message, "expected -90 to 90", None);
            }
            elevations.push(vertical);
        }
        let horizontal = match horizontal.filter(|cell| !cell.text.is_empty()) {
            None => Some(0.0),
            Some(cell) => cell.number(file.report, "horizontal angle").filter(|angle| {
                let is_angle = angle.abs() <= 360.0;
                if !is_angle {
                    let message = format!("the horizontal angle is {angle} degrees");
                    file.fail::<()>(cell.span, message, "expected -360 to 360", None);
                }
                is_angle
            }),
        };
        offsets.extend(horizontal.map(|h| -h));
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
    toml.line("\n# The ring of a cloud counts channels from the lowest, as in RoboSense's driver.");
    Lidar::usual(elevations, offsets).write("bottom_up", toml);
    Some(())
}
