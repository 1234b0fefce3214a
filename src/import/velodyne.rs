//! The calibration of the ROS driver for Velodyne sensors: YAML with one table a laser, angles in radians, lengths in metres.
//!
//! The driver (velodyne_pointcloud, `unpack`) computes a point from the distance r, the head's azimuth a, counted clockwise
//! from forward, seen from above, and of each laser rot_correction δ, vert_correction φ, vert_offset_correction v and
//! horiz_offset_correction h:
//!
//! ```text
//! s = r·cos φ − v·sin φ
//! x = s·cos(a − δ) + h·sin(a − δ)
//! y = −s·sin(a − δ) + h·cos(a − δ)
//! z = r·sin φ + v·cos φ
//! ```
//!
//! A laser's azimuth in the sensor frame is δ − a. Seen along that azimuth, the laser starts v·sin φ behind the axis, h to
//! its left and v·cos φ above the sensor's origin; turned by δ, that is the laser's origin in the head's frame.

use super::fields::Fields;
use super::file::File;
use super::lidar::{Lidar, MOST_BEAMS};
use super::writer::Toml;
use crate::source::Span;
use crate::source::tree::Value;

/// Corrections of measured ranges and intensities. Simulated measurements need none.
const OF_MEASUREMENTS: [&str; 7] = [
    "dist_correction",
    "dist_correction_x",
    "dist_correction_y",
    "focal_distance",
    "focal_slope",
    "min_intensity",
    "max_intensity",
];

struct Laser {
    id: u32,
    vertical: f64,
    rotation: f64,
    vertical_offset: f64,
    horizontal_offset: f64,
}

pub(super) fn write(file: File<'_>, toml: &mut Toml) -> Option<()> {
    let document = file.document()?;
    let top = Fields::new(file, "", &document)?;
    let node = top.need("lasers", "the list of the lasers, each a table")?;
    let Value::Array(elements) = &node.value else {
        let message = format!("`lasers` is {}", node.value.describe());
        return file.fail(node.span, message, "expected a list of tables", None);
    };
    let mut left_out: Vec<&str> = Vec::new();
    let mut lasers = Vec::new();
    for (index, element) in elements.iter().enumerate() {
        let Some(fields) = Fields::new(file, format!("lasers[{index}]"), element) else { continue };
        let is_used =
            |key: &&str| fields.get(key).is_some_and(|_| fields.number(key).is_some_and(|x| x != 0.0));
        for key in OF_MEASUREMENTS.into_iter().filter(is_used) {
            if !left_out.contains(&key) {
                left_out.push(key);
            }
        }
        lasers.extend(laser(&fields));
    }
    if file.has_errors() {
        return None;
    }
    if lasers.is_empty() {
        return file.fail(node.span, "`lasers` is empty", "expected one table a laser", None);
    }
    if let Some(expected) = top.integer("num_lasers", 0, MOST_BEAMS)
        && expected as usize != lasers.len()
    {
        let span = top.span("num_lasers");
        let message = format!("`num_lasers` is {expected}, and {} are listed", lasers.len());
        return file.fail(span, message, format!("expected {}", lasers.len()), None);
    }
    lasers.sort_by_key(|laser| laser.id);
    if let Some(at) = lasers.iter().enumerate().position(|(index, laser)| laser.id as usize != index) {
        let message = format!("the lasers are not numbered from 0 to {}", lasers.len() - 1);
        let label = format!("number {at} is missing, or there twice");
        return file.fail(Span { end: node.span.start, ..node.span }, message, label, None);
    }

    toml.comment(&format!("A Velodyne LiDAR with {} lasers: {}.", lasers.len(), file.short_name()));
    toml.comment(
        "\nUsed: laser_id (the order below), vert_correction and rot_correction (radians in the file) of each laser.",
    );
    let is_offset = lasers.iter().any(|l| (l.vertical_offset, l.horizontal_offset) != (0.0, 0.0));
    if is_offset {
        toml.comment(
            "Also used: vert_offset_correction and horiz_offset_correction, which give the origin of each laser in the frame of \
             the turning head.",
        );
    }
    if !left_out.is_empty() {
        toml.comment(&format!(
            "Left out: {}, which correct the measurements of the unit; simulated ranges need no correction.",
            left_out.join(", ")
        ));
    }
    toml.comment(
        "Not in the file, and to be checked: firing times, which depend on the model (none are set), columns and rate (the \
         usual values), range limits (none are set).",
    );
    toml.line("\n# The ring of a cloud counts lasers from the lowest, as in Velodyne's drivers.");
    let degrees = |f: fn(&Laser) -> f64| lasers.iter().map(|l| tidy(f(l).to_degrees())).collect();
    let lidar = Lidar {
        origins_m: is_offset.then(|| lasers.iter().map(origin).collect()),
        ..Lidar::usual(degrees(|l| l.vertical), degrees(|l| l.rotation))
    };
    lidar.write("bottom_up", toml);
    Some(())
}

fn laser(fields: &Fields<'_>) -> Option<Laser> {
    fields.need("laser_id", "the laser's number, from 0");
    fields.need("vert_correction", "the laser's elevation in radians");
    fields.need("rot_correction", "the laser's azimuth correction in radians");
    let id = fields.integer("laser_id", 0, MOST_BEAMS - 1);
    let angle = |key: &str, most: f64| {
        let value = fields.number(key)?;
        if value.abs() > most {
            let message = format!("`{}` is {value}", fields.path(key));
            return fields.file().fail(
                fields.span(key),
                message,
                format!("expected radians, -{most:.4} to {most:.4}"),
                None,
            );
        }
        Some(value)
    };
    let vertical = angle("vert_correction", std::f64::consts::FRAC_PI_2);
    let rotation = angle("rot_correction", std::f64::consts::TAU);
    let offset = |key: &str| if fields.get(key).is_some() { fields.number(key) } else { Some(0.0) };
    let (vertical_offset, horizontal_offset) =
        (offset("vert_offset_correction"), offset("horiz_offset_correction"));
    Some(Laser {
        id: id?,
        vertical: vertical?,
        rotation: rotation?,
        vertical_offset: vertical_offset?,
        horizontal_offset: horizontal_offset?,
    })
}

/// The origin of a laser in the head's frame, in metres.
fn origin(laser: &Laser) -> [f64; 3] {
    let (sin, cos) = libm::sincos(laser.vertical);
    let (sin_turn, cos_turn) = libm::sincos(laser.rotation);
    let (forward, left) = (-laser.vertical_offset * sin, laser.horizontal_offset);
    [forward * cos_turn - left * sin_turn, forward * sin_turn + left * cos_turn, laser.vertical_offset * cos]
}

/// Rounds degrees to 12 decimals. Vendors measure in degrees and write radians, so this restores the vendor's decimals; the
/// rounding is a thousandth of what matters.
fn tidy(degrees: f64) -> f64 {
    (degrees * 1e12).round() / 1e12
}
