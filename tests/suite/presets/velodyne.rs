//! Velodyne: the formula of the ROS driver and of velodyne_decoder for a laser of a turning head.

use beamcast::config;
use glam::DVec3;

use super::{Errors, Head, Shot, TruePulse, Truth, rows_of_channels, sin_cos_deg, table};

/// Tables have angles to 0.001°, which the preset has to hold exactly, and heights to a micrometre.
const ALLOWED: Errors = Errors { angle_deg: 1e-9, time_ns: 1e-3, place_mm: 2e-3 };

pub fn truths() -> Vec<Truth> {
    let angles = "velodyne_decoder calib_db.cpp";
    let unit = "the unit's own angles; whole columns a turn";
    let heights: [(&str, &str, &str); 6] = [
        ("velodyne/vlp-16", angles, unit),
        ("velodyne/vlp-16-hi-res", angles, unit),
        ("velodyne/hdl-32e", angles, unit),
        ("velodyne/vlp-32a", angles, "firing times, range; the unit's own angles"),
        ("velodyne/vlp-32c", angles, unit),
        ("velodyne/puck-128", "velodyne_decoder calib_db.cpp; manual 8.1", unit),
    ];
    let mut truths: Vec<Truth> =
        heights.map(|(preset, source, nominal)| truth(preset, source, nominal, &with_height)).into();
    for preset in ["velodyne/hdl-64e-s2", "velodyne/hdl-64e-s3"] {
        let nominal = "one unit's angles and offsets; whole columns a turn";
        truths.push(truth(preset, "velodyne_decoder calib_db.cpp; manual", nominal, &with_offsets));
    }
    truths
}

/// A row of a table.
type Row<'a> = &'a dyn Fn(&str) -> f64;
/// A laser's formula: from its row, and the head's azimuth in degrees, clockwise, to the point at a range.
type Formula = dyn Fn(Row, f64) -> Box<dyn Fn(f64) -> DVec3>;

fn truth(preset: &'static str, source: &'static str, nominal: &'static str, formula: &Formula) -> Truth {
    let sensor = config::load_preset(preset).unwrap().sensor;
    let (head, rows) = (Head::of(&sensor), rows_of_channels(&sensor));
    let table = table(preset);
    let elevations = &table["elevation_deg"];
    assert_eq!(rows.len(), elevations.len(), "{preset}");
    let mut shots = Vec::new();
    for laser in 0..rows.len() {
        // The driver numbers rings from the lowest laser.
        let ring = elevations.iter().filter(|e| **e < elevations[laser]).count();
        let value = |name: &str| table[name][laser];
        for column in head.some_columns() {
            let time_s = head.time_s(column) + value("fires_us") * 1e-6;
            let point = formula(&value, head.clockwise_deg(time_s));
            let pulse = Some(TruePulse { time_s: Some(time_s), ring: Some(ring), point });
            shots.push(Shot { row: rows[laser], column, pulse });
        }
    }
    Truth { preset, source, nominal, allowed: ALLOWED, shots }
}

/// x = r·cos ε·cos β, y = −r·cos ε·sin β, z = height + r·sin ε, with β = azimuth − rot_correction.
fn with_height(row: Row, azimuth_deg: f64) -> Box<dyn Fn(f64) -> DVec3> {
    let (sin_el, cos_el) = sin_cos_deg(row("elevation_deg"));
    let (sin, cos) = sin_cos_deg(azimuth_deg - row("rot_correction_deg"));
    let height = row("height_mm") / 1e3;
    Box::new(move |r| DVec3::new(r * cos_el * cos, -r * cos_el * sin, height + r * sin_el))
}

/// The driver's formula with both offsets of a laser (velodyne_pointcloud, `unpack`).
fn with_offsets(row: Row, azimuth_deg: f64) -> Box<dyn Fn(f64) -> DVec3> {
    let (sin_el, cos_el) = sin_cos_deg(row("elevation_deg"));
    let (sin, cos) = sin_cos_deg(azimuth_deg - row("rot_correction_deg"));
    let (v, h) = (row("vert_offset_m"), row("horiz_offset_m"));
    Box::new(move |r| {
        let level = r * cos_el - v * sin_el;
        DVec3::new(level * cos + h * sin, -level * sin + h * cos, r * sin_el + v * cos_el)
    })
}
