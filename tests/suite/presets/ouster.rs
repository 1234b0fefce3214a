//! Ouster: the lookup table of the ouster-sdk, over the angles of units' metadata.

use beamcast::config;
use glam::DVec3;

use super::{Errors, Head, Shot, TruePulse, Truth, lines_of, sin_cos_deg};

/// Angles are held as printed, and the rest follows by the same formula up to rounding.
const ALLOWED: Errors = Errors { angle_deg: 1e-9, time_ns: 1e-3, place_mm: 1e-6 };

pub fn truths() -> Vec<Truth> {
    let unit = "one unit's angles, range";
    vec![
        truth("ouster/os0-128", "tests/pcaps/OS-0-128-U1_v2.3.0_1024x10.json", unit),
        truth("ouster/os0-128-rev7", "tests/pcaps/OS-0-128_v3.0.1_1024x10.json", unit),
        truth("ouster/os0-32", "tests/pcaps/OS-0-32-U1_v2.2.0_1024x10.json", unit),
        truth("ouster/os0-64", "tests/assets/1_14_6cccd_os-882002000138-64U02.json", unit),
        truth("ouster/os1-128", "tests/metadata/2_2_os-992119000444-128.json", unit),
        truth("ouster/os1-128-rev7", "tests/metadata/3_0_1_os-122246000293.json", unit),
        truth("ouster/os1-16-gen1", "tests/metadata/1_14_beta_os1-991937000062-16A0_legacy.json", unit),
        truth("ouster/os1-32", "tests/metadata/2_0_rc2_os-992011000121-32U0_legacy.json", unit),
        truth("ouster/os1-64", "tests/metadata/ouster-studio-reduced-config-v1.json", unit),
        truth("ouster/os1-64-gen1", "tests/metadata/1_12_os1-991913000010-64.json", unit),
        truth("ouster/os2-128", "tests/pcaps/OS-2-128-U1_v2.3.0_1024x10.json", unit),
        truth("ouster/os2-32", "tests/pcaps/OS-2-32-U0_v2.0.0_1024x10.json", unit),
        truth(
            "ouster/os2-64",
            "every second beam of tests/pcaps/OS-2-128-U1_v2.3.0_1024x10.json",
            "all angles: no unit of the model is published; range",
        ),
    ]
}

/// x = (r − n)·cos(θe + θa)·cos φ + n·cos θe and so on, with θe = 2π(1 − column/W), θa = −azimuth, φ = altitude; then half a
/// turn about z and the height of lidar_to_sensor_transform.
fn truth(preset: &'static str, source: &'static str, nominal: &'static str) -> Truth {
    let sensor = config::load_preset(preset).unwrap().sensor;
    let head = Head::of(&sensor);
    let mut shots = Vec::new();
    let beams = lines_of(preset, ["altitude_deg", "azimuth_deg", "origin_mm", "height_mm"]);
    for (row, [altitude, azimuth, n, height]) in beams.enumerate() {
        let (n, height) = (n / 1e3, height / 1e3);
        for column in head.some_columns() {
            let encoder_deg = 360.0 * (1.0 - column as f64 / head.columns as f64);
            let (sin_el, cos_el) = sin_cos_deg(altitude);
            let (sin, cos) = sin_cos_deg(encoder_deg - azimuth);
            let (sin_encoder, cos_encoder) = sin_cos_deg(encoder_deg);
            let point: super::Place = Box::new(move |r| {
                let lidar = DVec3::new(
                    (r - n) * cos * cos_el + n * cos_encoder,
                    (r - n) * sin * cos_el + n * sin_encoder,
                    (r - n) * sin_el,
                );
                DVec3::new(-lidar.x, -lidar.y, lidar.z + height)
            });
            let time_s = Some(head.time_s(column));
            shots.push(Shot { row, column, pulse: Some(TruePulse { time_s, ring: Some(row), point }) });
        }
    }
    Truth { preset, mode: None, source, nominal, allowed: ALLOWED, shots }
}

/// The modes that the units have, among them the one of firmware 3.
#[test]
fn every_ouster_has_the_modes_of_its_series() {
    for truth in truths() {
        let text = beamcast::config::presets::text(truth.preset).unwrap();
        for (mode, columns, rate) in [
            ("512x10", 512, "10.0"),
            ("512x20", 512, "20.0"),
            ("1024x20", 1024, "20.0"),
            ("2048x10", 2048, "10.0"),
            ("4096x5", 4096, "5.0"),
        ] {
            let lines = format!("[modes.{mode}]\nrotating = {{ columns = {columns}, rate_hz = {rate} }}\n");
            assert!(text.contains(&lines), "{}: {mode}", truth.preset);
        }
    }
}
