//! RoboSense's angles: CSV of vertical and horizontal angle in degrees, a channel a line, without a head.
//!
//! Vendor's driver: x = r·cos ε·cos(a + h), y = −r·cos ε·sin(a + h), z = r·sin ε, with the rotor's azimuth a clockwise seen
//! from above from the x axis, which is forward: horizontal angles change their sign. The distance between the rotor's axis
//! and the lens is a constant of the model, and not in the file.

use super::file_name;
use super::lidar::Lidar;
use super::report::Report;
use super::table::rows;
use super::writer::Toml;

pub(super) fn write(report: &Report, toml: &mut Toml) -> Option<()> {
    let (mut elevations, mut offsets) = (Vec::new(), Vec::new());
    for row in rows(report.text()) {
        let [vertical, horizontal] = &row.cells[..] else {
            let message = format!("a line of {} fields", row.cells.len());
            report.error::<()>(row.span, message, "expected 2: vertical angle, horizontal angle", None);
            continue;
        };
        let span = vertical.span.clone();
        if let Some(vertical) = vertical.number(report, "vertical angle") {
            if vertical.abs() > 90.0 {
                let message = format!("a vertical angle of {vertical} degrees");
                report.error::<()>(span, message, "expected -90 to 90", None);
            }
            elevations.push(vertical);
        }
        offsets.extend(horizontal.number(report, "horizontal angle").map(|h| -h));
    }
    if elevations.is_empty() && !report.has_errors() {
        return report.error(0..0, "the file lists no channel", "", None);
    }
    if report.has_errors() {
        return None;
    }
    toml.comment(&format!(
        "A RoboSense LiDAR with {} channels: {}.",
        elevations.len(),
        file_name(report.name())
    ));
    toml.comment(
        "\nUsed: vertical and horizontal angle of each channel. RoboSense counts azimuths clockwise: the horizontal angles \
         have the other sign below.",
    );
    toml.comment(
        "Not in the file, and to be checked: firing times and the lens's distance from the axis (none), columns and rate \
         (the usual ones), range limits (none).",
    );
    toml.line("\n# A cloud's ring counts channels, from 0.");
    Lidar::usual(elevations, offsets).write("file", toml);
    Some(())
}
