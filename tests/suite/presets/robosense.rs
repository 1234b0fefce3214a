//! RoboSense: the formula of rs_driver for a channel of a turning head.

use glam::DVec3;

use super::{Beams, Errors, Truth, sin_cos_deg};

/// Tables have angles to a hundredth of a degree or finer, which the preset has to hold exactly.
const ALLOWED: Errors = Errors { angle_deg: 1e-9, time_ns: 1e-3, place_mm: 1e-6 };

/// The preset, its source, what is nominal, and the distances of the lens from the axis and above the origin in metres.
type Model = (&'static str, &'static str, &'static str, f64, f64);

const MODELS: [Model; 5] = [
    ("robosense/rs16", "rs_driver; data sheet", "elevations to 0.04°, columns", 0.03825, 0.0),
    (
        "robosense/rs32",
        "ros_rslidar rs_lidar_32/angle.csv; rs_driver",
        "one unit's angles, columns",
        0.03997,
        0.0,
    ),
    (
        "robosense/helios",
        "nebula Helios5515.csv, RobosenseHelios.csv; rs_driver",
        "one unit's azimuths, columns",
        0.03498,
        0.0,
    ),
    (
        "robosense/bpearl",
        "nebula RobosenseBpearl.csv; rs_driver",
        "one unit's angles, columns",
        0.01473,
        0.09427,
    ),
    (
        "robosense/ruby-plus",
        "nebula RobosenseRubyPlus.csv; rs_driver",
        "one unit's angles, columns",
        0.02892,
        0.0,
    ),
];

/// x = r·cos ε·cos(a + h) + RX·cos a, y = −r·cos ε·sin(a + h) − RX·sin a, z = r·sin ε + RZ. The azimuth a is that of the head
/// when the channel fires.
pub fn truths() -> Vec<Truth> {
    let truth = |(preset, source, nominal, rx, rz): Model| {
        let beams = Beams { preset, mode: None, elevations: "vertical_deg", ring_of: &|below, _| below };
        beams.truth(source, nominal, ALLOWED, &|row, azimuth_deg| {
            let (sin_el, cos_el) = sin_cos_deg(row("vertical_deg"));
            let (sin, cos) = sin_cos_deg(azimuth_deg + row("horizontal_deg"));
            let (sin_head, cos_head) = sin_cos_deg(azimuth_deg);
            Box::new(move |r| {
                let level = r * cos_el;
                DVec3::new(level * cos + rx * cos_head, -level * sin - rx * sin_head, r * sin_el + rz)
            })
        })
    };
    MODELS.map(truth).into()
}
