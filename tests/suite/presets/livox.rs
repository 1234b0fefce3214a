//! Livox: points of the pattern tables that it publishes for simulation.

use beamcast::config;
use beamcast::sensor::{Capture, azimuth_elevation};
use glam::DVec3;

use super::{Errors, Shot, TruePulse, Truth, lines_of, sin_cos_deg};

/// The presets, with what their tables' rounding allows in degrees, and with the pulse rate of a beam where the table's times
/// are seconds.
const TABLES: [(&str, f64, Option<f64>); 6] = [
    ("livox/avia", 1e-4, None),
    ("livox/horizon", 1e-4, None),
    // The table has two decimals of azimuth: half of the last digit, and as much of the fit.
    ("livox/mid-360", 0.011, None),
    ("livox/mid-40", 1e-4, Some(1e5)),
    ("livox/mid-70", 1e-4, Some(1e5)),
    ("livox/tele-15", 1e-4, None),
];

/// The columns that the tables have of each shot.
const COLUMNS: [&str; 4] = ["pulse", "line", "azimuth_deg", "elevation_deg"];

pub fn truths() -> Vec<Truth> {
    TABLES
        .iter()
        .map(|(preset, angle_deg, pulse_rate_hz)| first_frame(preset, *angle_deg, *pulse_rate_hz))
        .collect()
}

fn direction(azimuth_deg: f64, elevation_deg: f64) -> DVec3 {
    let ((sin_az, cos_az), (sin_el, cos_el)) = (sin_cos_deg(azimuth_deg), sin_cos_deg(elevation_deg));
    DVec3::new(cos_el * cos_az, cos_el * sin_az, sin_el)
}

/// The points of the table in the preset's first frame.
fn first_frame(preset: &'static str, angle_deg: f64, pulse_rate_hz: Option<f64>) -> Truth {
    let columns = config::load_preset(preset).unwrap().sensor.pattern.columns();
    let shots = lines_of(preset, COLUMNS)
        .filter(|[pulse, ..]| (*pulse as usize) < columns)
        .map(|[pulse, line, azimuth_deg, elevation_deg]| {
            let line = line as usize;
            let towards = direction(azimuth_deg, elevation_deg);
            let point: super::Place = Box::new(move |range| towards * range);
            let time_s = pulse_rate_hz.map(|rate| pulse / rate);
            Shot {
                row: line,
                column: pulse as usize,
                pulse: Some(TruePulse { time_s, ring: Some(line), point }),
            }
        })
        .collect();
    let allowed = Errors { angle_deg, time_ns: 1e-3, place_mm: 2e3 * angle_deg.to_radians() };
    let nominal = "phases at the start, range";
    Truth { preset, mode: None, source: "livox_laser_simulation scan_mode/*.csv", nominal, allowed, shots }
}

/// Four seconds after the first pulse, the frames still go on where those before ended.
#[test]
fn later_frames_go_on_through_livoxs_tables() {
    for (preset, allowed_deg, _) in TABLES {
        let sensor = config::load_preset(preset).unwrap().sensor;
        let columns = sensor.pattern.columns();
        let mut last = 0;
        for [pulse, line, azimuth_deg, elevation_deg] in lines_of(preset, COLUMNS) {
            let (pulse, line) = (pulse as usize, line as usize);
            let capture = Capture::at_origin(&sensor).with_frame((pulse / columns) as u64);
            let found = capture.pulse(line, pulse % columns).unwrap().direction;
            let right = direction(azimuth_deg, elevation_deg);
            let off = libm::atan2(right.cross(found).length(), right.dot(found)).to_degrees();
            assert!(off <= allowed_deg, "{preset}, pulse {pulse}, line {line}: {off} degrees from {right}");
            last = last.max(pulse / columns);
        }
        assert!(last >= 39, "{preset}: the table ends in frame {last}");
    }
}

/// The Mid-360's lines as other sources describe them: four rings, 50,000 pulses a second each, and lines that rise and fall within
/// a turn of the mirror.
#[test]
fn the_mid_360_has_four_lines_that_rise_and_fall() {
    let sensor = config::load_preset("livox/mid-360").unwrap().sensor;
    let capture = Capture::at_origin(&sensor);
    assert_eq!((capture.rows(), capture.columns(), sensor.pattern.rate_hz()), (4, 5000, Some(10.0)));
    let elevation = |line: usize, column: usize| {
        azimuth_elevation(capture.pulse(line, column).unwrap().direction).1.degrees()
    };
    // Half a turn of the mirror, 137 pulses, turns the order of the lines round.
    let order = |column: usize| elevation(0, column) > elevation(3, column);
    assert!(order(0) && !order(137) && order(274));
    let spread = |column: usize| (elevation(0, column) - elevation(3, column)).abs();
    assert!((spread(0) - 8.31).abs() < 0.05, "{}", spread(0));
}
