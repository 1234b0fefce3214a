//! The calibration of the ROS driver for Velodyne sensors: YAML with a table a laser, angles in radians, lengths in metres.
//!
//! The driver makes points of distances r (velodyne_pointcloud, `unpack`), with the head's azimuth a, clockwise seen from
//! above from forward, and of each laser rot_correction δ, vert_correction φ, vert_offset_correction v and
//! horiz_offset_correction h:
//!
//! ```text
//! s = r·cos φ − v·sin φ
//! x = s·cos(a − δ) + h·sin(a − δ)
//! y = −s·sin(a − δ) + h·cos(a − δ)
//! z = r·sin φ + v·cos φ
//! ```
//!
//! A laser's azimuth here is δ − a. Seen along it, it starts v·sin φ behind the axis, h to the left, and v·cos φ up; turned by
//! δ, that is its origin in the head's frame.

use super::document::{self, Fields, Value};
use super::file_name;
use super::lidar::Lidar;
use super::report::Report;
use super::writer::Toml;

/// Most lasers of a file.
const MOST_LASERS: u32 = 4096;

/// Corrections of measured ranges and intensities, which simulated ones don't need.
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

pub(super) fn write(report: &Report, toml: &mut Toml) -> Option<()> {
    let document = document::parse(report)?;
    let top = Fields::new(report, "", &document)?;
    let node = top.need("lasers", "the list of the lasers, each a table")?;
    let Value::List(elements) = &node.value else {
        let message = format!("`lasers` is {}", document::describe(&node.value));
        return report.error(node.span.clone(), message, "expected a list of tables", None);
    };
    let mut left_out: Vec<&str> = Vec::new();
    let mut lasers = Vec::new();
    for (index, element) in elements.iter().enumerate() {
        let Some(fields) = Fields::new(report, format!("lasers[{index}]"), element) else { continue };
        let is_used =
            |key: &&str| fields.get(key).is_some_and(|_| fields.number(key).is_some_and(|x| x != 0.0));
        for key in OF_MEASUREMENTS.into_iter().filter(is_used) {
            if !left_out.contains(&key) {
                left_out.push(key);
            }
        }
        lasers.extend(laser(&fields));
    }
    if report.has_errors() {
        return None;
    }
    if lasers.is_empty() {
        return report.error(node.span.clone(), "`lasers` is empty", "expected a table a laser", None);
    }
    if let Some(expected) = top.integer("num_lasers", 0, MOST_LASERS)
        && expected as usize != lasers.len()
    {
        let span = top.get("num_lasers").map_or(0..0, |n| n.span.clone());
        let message = format!("`num_lasers` is {expected}, and {} are listed", lasers.len());
        return report.error(span, message, format!("expected {}", lasers.len()), None);
    }
    lasers.sort_by_key(|laser| laser.id);
    if let Some(at) = lasers.iter().enumerate().position(|(index, laser)| laser.id as usize != index) {
        let message = format!("the lasers are not numbered from 0 to {}", lasers.len() - 1);
        let label = format!("number {at} is missing, or there twice");
        return report.error(node.span.start..node.span.start, message, label, None);
    }

    toml.comment(&format!("A Velodyne LiDAR with {} lasers: {}.", lasers.len(), file_name(report.name())));
    toml.comment("\nUsed: laser_id (the order below), and of each laser vert_correction and rot_correction (radians in the file).");
    let is_offset = lasers.iter().any(|l| (l.vertical_offset, l.horizontal_offset) != (0.0, 0.0));
    if is_offset {
        toml.comment(
            "Also vert_offset_correction and horiz_offset_correction: where each laser starts, in the turning head's frame.",
        );
    }
    if !left_out.is_empty() {
        toml.comment(&format!(
            "Left out: {}, which correct what the unit measures; simulated ranges need none.",
            left_out.join(", ")
        ));
    }
    toml.comment(
        "Not in the file, and to be checked: the model and its firing times (none), columns and rate (the usual ones), range \
         limits (none).",
    );
    toml.line("\n# A cloud's ring counts lasers from the lowest, as Velodyne's drivers do.");
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
    let id = fields.integer("laser_id", 0, MOST_LASERS - 1);
    let angle = |key: &str, most: f64| {
        let value = fields.number(key)?;
        if value.abs() > most {
            let span = fields.get(key).map_or(0..0, |node| node.span.clone());
            let message = format!("`{}` is {value}", fields.path(key));
            return fields.report().error(
                span,
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

/// Where a laser starts in the head's frame.
fn origin(laser: &Laser) -> [f64; 3] {
    let (sin, cos) = libm::sincos(laser.vertical);
    let (sin_turn, cos_turn) = libm::sincos(laser.rotation);
    let (forward, left) = (-laser.vertical_offset * sin, laser.horizontal_offset);
    [forward * cos_turn - left * sin_turn, forward * sin_turn + left * cos_turn, laser.vertical_offset * cos]
}

/// Degrees that were degrees before a file had them in radians: to 12 decimals, a thousandth of what matters.
fn tidy(degrees: f64) -> f64 {
    (degrees * 1e12).round() / 1e12
}
