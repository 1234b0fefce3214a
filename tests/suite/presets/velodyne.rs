//! Velodyne: the formula of the ROS driver and of velodyne_decoder for a laser of a turning head.

use glam::DVec3;

use super::{Beams, Errors, Place, Row, Truth, sin_cos_deg};

/// Tables have angles to 0.001°, which the preset has to hold exactly, and heights to a micrometre.
const ALLOWED: Errors = Errors { angle_deg: 1e-9, time_ns: 1e-3, place_mm: 2e-3 };

const SOURCE: &str = "velodyne_decoder calib_db.cpp; manual";

pub fn truths() -> Vec<Truth> {
    let unit = "the unit's own angles, columns";
    let one = "one unit's angles and offsets, columns";
    vec![
        truth("velodyne/vlp-16", unit, &with_height),
        truth("velodyne/vlp-16-hi-res", unit, &with_height),
        truth("velodyne/hdl-32e", unit, &with_height),
        truth("velodyne/vlp-32a", "firing times, range; the unit's own angles, columns", &with_height),
        truth("velodyne/vlp-32c", unit, &with_height),
        truth("velodyne/puck-128", unit, &with_height),
        truth("velodyne/hdl-64e-s2", one, &with_offsets),
        truth("velodyne/hdl-64e-s3", one, &with_offsets),
    ]
}

fn truth(preset: &'static str, nominal: &'static str, formula: &dyn Fn(Row, f64) -> Place) -> Truth {
    // The driver numbers rings from the lowest laser.
    let beams = Beams { preset, mode: None, elevations: "elevation_deg", ring_of: &|below, _| below };
    beams.truth(SOURCE, nominal, ALLOWED, formula)
}

/// x = r·cos ε·cos β, y = −r·cos ε·sin β, z = height + r·sin ε, with β = azimuth − rot_correction.
fn with_height(row: Row, azimuth_deg: f64) -> Place {
    let (sin_el, cos_el) = sin_cos_deg(row("elevation_deg"));
    let (sin, cos) = sin_cos_deg(azimuth_deg - row("rot_correction_deg"));
    let height = row("height_mm") / 1e3;
    Box::new(move |r| DVec3::new(r * cos_el * cos, -r * cos_el * sin, height + r * sin_el))
}

/// The driver's formula with both offsets of a laser (velodyne_pointcloud, `unpack`).
fn with_offsets(row: Row, azimuth_deg: f64) -> Place {
    let (sin_el, cos_el) = sin_cos_deg(row("elevation_deg"));
    let (sin, cos) = sin_cos_deg(azimuth_deg - row("rot_correction_deg"));
    let (v, h) = (row("vert_offset_m"), row("horiz_offset_m"));
    Box::new(move |r| {
        let level = r * cos_el - v * sin_el;
        DVec3::new(level * cos + h * sin, -level * sin + h * cos, r * sin_el + v * cos_el)
    })
}
