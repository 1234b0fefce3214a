//! Patterns of real sensors against the vendors' own formulas, ray tables, modes, and the built-in sensors against their
//! data sheets.

use std::path::Path;

use beamcast::angle::Angle;
use beamcast::config::{self, presets};
use beamcast::error::Error;
use beamcast::frame::Pose;
use beamcast::scene::gltf;
use beamcast::sensor::facts::SensorFacts;
use beamcast::sensor::{Capture, Sensor, azimuth_elevation};
use beamcast::source::Severity;
use beamcast::trace::Tracer;
use glam::DVec3;

use crate::shapes::seen_from;

/// A sensor from its file's text.
fn sensor(text: &str) -> Sensor {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sensor.toml");
    std::fs::write(&path, text).unwrap();
    match config::load_sensor(&path) {
        Ok(file) => file.sensor,
        Err(error) => panic!("{error}"),
    }
}

/// The messages about a sensor file that lies beside `table.csv`.
fn told(text: &str, csv: &str) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sensor.toml");
    std::fs::write(&path, text).unwrap();
    std::fs::write(folder.path().join("table.csv"), csv).unwrap();
    let found = match config::load_sensor(&path) {
        Ok(file) => file.warnings,
        Err(Error::Config(found)) => found,
        Err(other) => panic!("{other}"),
    };
    let one = |d: &beamcast::source::Diagnostic| {
        let (line, column) = d.line_column();
        let file = d.path.file_name().unwrap().to_string_lossy();
        format!("{file}:{line}:{column}: {} | {} | {}", d.message, d.label, d.help.as_deref().unwrap_or(""))
    };
    found.iter().map(one).collect()
}

/// The lookup table of ouster-sdk, written out: n is the distance from the axis to the beam's origin, and r is the range
/// that a unit reports. The points are in the frame of the lidar, which lidar_to_sensor rotates by half a turn and lifts.
#[test]
fn ouster_points_are_those_of_its_lookup_table() {
    let (n, lift, columns) = (0.015806, 0.03618, 1024);
    let (altitude, azimuth) = ([20.0_f64, 1.5, -21.0], [4.2_f64, -1.4, 1.3]);
    let sensor = sensor(&format!(
        "[rotating]\nelevations_deg = {altitude:?}\nazimuth_offsets_deg = [-4.2, 1.4, -1.3]\ncolumns = {columns}\n\
         rate_hz = 10\nbeam_origins_m = [{n}, 0.0, {lift}]\nrange_offset_m = {n}\n[range]\nmin_m = 0.3\n"
    ));
    for row in 0..3 {
        for column in [0, 1, 300, 512, 1023] {
            for r in [0.3, 7.25, 100.0] {
                let encoder = std::f64::consts::TAU * (1.0 - column as f64 / columns as f64);
                let (around, up) = (-azimuth[row].to_radians(), altitude[row].to_radians());
                let (cos_up, sin_up) = (libm::cos(up), libm::sin(up));
                let x = (r - n) * libm::cos(encoder + around) * cos_up + n * libm::cos(encoder);
                let y = (r - n) * libm::sin(encoder + around) * cos_up + n * libm::sin(encoder);
                let expected = DVec3::new(-x, -y, (r - n) * sin_up + lift);
                let point = Capture::at_origin(&sensor).pulse(row, column).unwrap().point(r);
                assert!(point.abs_diff_eq(expected, 1e-9), "row {row}, column {column}: {point} {expected}");
            }
        }
    }
}

/// The formula of rs_driver: x = r·cos ε·cos α + R·cos β and so on, with the head's clockwise angle β, which grows with the
/// channel's time. Velodyne's driver interpolates the azimuth of a laser by its time in the same way.
#[test]
fn the_head_turns_on_between_the_beams_of_a_column() {
    let (radius, rate, columns) = (0.041422, 10.0, 1800);
    let (elevation, offset, time) = ([-10.0_f64, 2.0], [0.5_f64, -0.25], [0.0, 46.08e-6]);
    let sensor = sensor(&format!(
        "[rotating]\nelevations_deg = {elevation:?}\nazimuth_offsets_deg = [-0.5, 0.25]\nbeam_times_us = [0, 46.08]\n\
         turns_while_firing = true\nbeam_origins_m = [[{radius}, 0, 0], [{radius}, 0, 0.01]]\ncolumns = {columns}\n\
         rate_hz = {rate}\nsector_deg = {{ from = 0, to = -360 }}\n"
    ));
    for (row, beam) in [(0, 1), (1, 0)] {
        for column in [0, 17, 900, 1799] {
            let head = std::f64::consts::TAU * (column as f64 / columns as f64 + rate * time[beam]);
            let (up, aim, r) = (elevation[beam].to_radians(), head + offset[beam].to_radians(), 12.5);
            let expected = DVec3::new(
                r * libm::cos(up) * libm::cos(aim) + radius * libm::cos(head),
                -r * libm::cos(up) * libm::sin(aim) - radius * libm::sin(head),
                r * libm::sin(up) + 0.01 * beam as f64,
            );
            let pulse = Capture::at_origin(&sensor).pulse(row, column).unwrap();
            assert!(pulse.point(r).abs_diff_eq(expected, 1e-9), "beam {beam}, column {column}");
            let at = column as f64 / columns as f64 / rate + time[beam];
            assert!((pulse.time_s - at).abs() < 1e-12);
        }
    }
}

#[test]
fn destaggering_moves_rows_to_their_azimuths() {
    let text = |layout: &str| {
        format!(
            "[rotating]\nelevations_deg = [2, 1, 0]\nazimuth_offsets_deg = [-4.2, 0.1, 4.2]\ncolumns = 1024\n\
             rate_hz = 10\n{layout}\n"
        )
    };
    let fired = sensor(&text("layout = \"staggered\""));
    let moved = sensor(&text("layout = \"destaggered\""));
    let given = sensor(&text("layout = \"destaggered\"\npixel_shift_by_row = [24, 12, 0]"));
    for column in 0..1024 {
        let pulse = |s: &Sensor, row, column: usize| Capture::at_origin(s).pulse(row, column % 1024).unwrap();
        // 4.2° clockwise are 11.9 columns to the right.
        for (row, shift) in [(0, 12), (1, 0), (2, 1024 - 12)] {
            assert_eq!(pulse(&moved, row, column + shift), pulse(&fired, row, column));
        }
        for (row, shift) in [(0, 24), (1, 12), (2, 0)] {
            assert_eq!(pulse(&given, row, column + shift), pulse(&fired, row, column));
        }
        let azimuth = |row| azimuth_elevation(pulse(&moved, row, column).direction).0.degrees();
        let apart = (azimuth(0) - azimuth(2)).abs();
        assert!(apart.min(360.0 - apart) <= 360.0 / 1024.0, "column {column}: {apart}");
    }
}

#[test]
fn a_table_of_rays_is_read_and_its_mistakes_are_told_by_line_and_column() {
    let text = "[rays]\nfile = \"table.csv\"\nrate_hz = 10\n";
    assert_eq!(
        told(text, "azimuth_deg, elevation_deg, time_us\n# a comment\n\n90, 0, 1.5\r\n0,-30,2\n"),
        [""; 0]
    );
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("sensor.toml"), text).unwrap();
    let csv = "\u{feff}x,y,z,time_s,origin_x_m,origin_y_m,origin_z_m\n0,2,0,0.5,1,2,3\n1,0,0,0.25,0,0,0\n";
    std::fs::write(folder.path().join("table.csv"), csv).unwrap();
    let file = config::load_sensor(&folder.path().join("sensor.toml")).unwrap();
    let pattern = &file.sensor.pattern;
    assert_eq!((pattern.rows(), pattern.columns(), pattern.last_pulse_s()), (1, 2, 0.5));
    let pulse = Capture::at_origin(&file.sensor).pulse(0, 0).unwrap();
    assert_eq!((pulse.origin, pulse.direction, pulse.time_s), (DVec3::new(1.0, 2.0, 3.0), DVec3::Y, 0.5));

    for (csv, expected) in [
        ("", "table.csv:1:1: the table of rays is empty | expected a header | "),
        ("x,y,z\n", "table.csv:1:1: the table has no rays | expected a ray a line after this | "),
        (
            "azimuth_deg,elevation\n0,0\n",
            "table.csv:1:13: unknown column `elevation` |  | did you mean `elevation_deg`?",
        ),
        (
            "azimuth_deg,time_s\n0,0\n",
            "table.csv:1:1: a table of rays has one direction a line | expected the columns `azimuth_deg` and \
             `elevation_deg`, or `x`, `y` and `z` | ",
        ),
        (
            "azimuth_deg,elevation_deg\n0,0\n1, far\n",
            "table.csv:3:4: `elevation_deg` is `far` | expected a finite number | ",
        ),
        (
            "azimuth_deg,elevation_deg\n0,95\n",
            "table.csv:2:3: `elevation_deg` is 95 | expected -90 (straight down) to 90 (straight up) | ",
        ),
        ("x,y,z\n0,0,0\n", "table.csv:2:1: `x`, `y` and `z` are no direction | expected a length | "),
        ("x,y,z\n1,0\n", "table.csv:2:1: the line has 2 values | `z` is missing | "),
        ("x,y,z\n1,0,0,7\n", "table.csv:2:7: the line has more than 3 values | one too many | "),
    ] {
        assert_eq!(told(text, csv).first().map(String::as_str), Some(expected), "{csv:?}");
    }
    let many = format!("x,y,z\n{}", "1,0,?\n".repeat(1000));
    assert_eq!(told(text, &many).len(), 10);
    let missing = told("[rays]\nfile = \"tabel.csv\"\n", "x,y,z\n1,0,0\n");
    assert_eq!(
        missing,
        ["sensor.toml:2:8: the table of rays `tabel.csv` can't be used | there is no such file | \
          did you mean `table.csv`?"]
    );
}

#[test]
fn mistakes_in_patterns_are_told() {
    for (text, expected) in [
        (
            "[risley]\nprisms = [{ rate_hz = 1, wedge_deg = 95, index = 1.5 }]\npulse_rate_hz = 10\nrate_hz = 1\n",
            "sensor.toml:2:11: prism 0: wedges must lie within ±90 degrees, indices must be 1 or more, and all numbers must be finite |  | ",
        ),
        (
            "[pinhole]\nwidth_px = 4\nheight_px = 4\nfx_px = 2\ndistortion = [0.1, 0.2]\n",
            "sensor.toml:5:14: `distortion` has 2 numbers | expected 4 or 5 or 8: k1, k2, p1, p2, then k3, then k4, k5, \
             k6 | ",
        ),
        (
            "[rotating]\nelevations_deg = [1, 0]\ncolumns = 9\nrate_hz = 1\nbeam_origins_m = [[0, 0, 0]]\n",
            "sensor.toml:5:18: `beam_origins_m` has 1 value for 2 elevations | expected 2: one a beam | ",
        ),
        (
            "[rotating]\nelevations_deg = [1]\ncolumns = 9\nrate_hz = 1\nrange_offset_m = 0.1\n",
            "sensor.toml:1:1: the least range is 0 m, and ranges begin 0.1 m before the beam | expected a `min_m` of at \
             least `range_offset_m` | ",
        ),
        (
            "[rotating]\nelevations_deg = [1]\ncolumns = 9\nrate_hz = 1\nbeam_origins_m = [0.03, 0.04, 0.0]\n\
             range_from = \"origin\"\n[range]\nmin_m = 0.04\n",
            "sensor.toml:7:1: the least range is 0.04 m, and a beam leaves 0.050000 m from the sensor's origin | expected a \
             `min_m` of at least that | ",
        ),
        (
            "[rotating]\nelevations_deg = [1]\ncolumns = 9\nrate_hz = 1\nrange_offset_m = 0.1\nrange_from = \"origin\"\n",
            "sensor.toml:5:18: ranges count from the sensor's origin, or begin before the beam's, but not both | one too many \
             | leave out `range_offset_m`, or `range_from`",
        ),
        (
            "[rotating]\nelevations_deg = [1]\ncolumns = 9\nrate_hz = 1\nlayout = \"destaggered\"\n\
             sector_deg = { from = 10, to = -10 }\n",
            "sensor.toml:5:10: only a full turn can be destaggered, because its columns wrap around |  | ",
        ),
        (
            "[equirectangular]\nwidth_px = 4\nheight_px = 4\nvfov_deg = 190\n",
            "sensor.toml:4:12: `vfov_deg` is 190 | expected a number of degrees, greater than 0 and at most 180 | ",
        ),
        (
            "[mirror]\nazimuth = { motion = \"cosine\", rate_hz = 1, from_deg = 1, to_deg = 0 }\n\
             elevation = { motion = \"sine\", rate_hz = 1, from_deg = 1, to_deg = 0 }\npulse_rate_hz = 9\nrate_hz = 1\n",
            "sensor.toml:2:22: `motion` is the string \"cosine\" | expected \"sine\", \"triangle\" or \"sawtooth\" | \
             did you mean \"sine\"?",
        ),
    ] {
        assert_eq!(told(text, "").first().map(String::as_str), Some(expected), "{text}");
    }
}

#[test]
fn common_pitfalls_are_warned_of() {
    let rotating =
        "[rotating]\nelevations_deg = [1, 1]\nazimuth_offsets_deg = [0, 2]\ncolumns = 360\nrate_hz = 10\n";
    assert_eq!(
        told(rotating, ""),
        [
            "sensor.toml:2:22: beams 0 and 1 (counted from 0) have one elevation and azimuths 2 columns apart | round the turn \
          they see the same points | another number of columns, or offsets between the columns, would see other points"
        ]
    );
    assert_eq!(told(&rotating.replace("[0, 2]", "[0, 2.5]"), ""), [""; 0]);
    let early = "[rotating]\nelevations_deg = [1, 2]\ncolumns = 360\nrate_hz = 10\nbeam_times_us = [-300, 0]\n\
                 cycle = [{ beam_times_us = [0, 301] }]\n";
    assert_eq!(
        told(early, ""),
        [
            "sensor.toml:5:18: a beam fires 300 µs before its column, the column before by 277.778 µs | earlier than the \
             column before | beam times are microseconds from the column's own time, not from the frame's start",
            "sensor.toml:6:32: a beam fires 301 µs after its column, the next column after 277.778 µs | later than the next \
             column | beam times are microseconds from the column's own time, not from the frame's start",
        ]
    );
    let prisms = "[risley]\nprisms = [{ rate_hz = 1, wedge_deg = 9, index = 1.5 }]\npulse_rate_hz = 1e6\nrate_hz = 10\n\
                  [range]\nmax_m = 200\n";
    assert_eq!(
        told(prisms, ""),
        [
            "sensor.toml:5:1: the sensor sees 200 m far, and a beam pulses every 1.000 µs: the unambiguous range is 149.9 m | \
          farther than light comes back from in time | "
        ]
    );
}

/// Tests a lens that folds within the image: pixels beyond the fold are counted as misses and have no ray.
#[test]
fn pixels_past_a_lenss_fold_have_no_ray() {
    let camera = sensor(
        "[pinhole]\nwidth_px = 101\nheight_px = 101\nfx_px = 50\ndistortion = [-0.3, 0.0, 0.0, 0.0]\n[range]\nmax_m = 9\n",
    );
    // r·(1 − 0.3·r²) has its largest value, 0.7027, at r = 1/√0.9: 35.1 pixels.
    let capture = Capture::at_origin(&camera);
    for (row, column) in (0..101).flat_map(|row| (0..101).map(move |column| (row, column))) {
        let off = libm::hypot(row as f64 - 50.0, column as f64 - 50.0) / 50.0;
        let edge = 2.0 / 3.0 / 0.9_f64.sqrt();
        assert_eq!(capture.pulse(row, column).is_some(), off <= edge, "({row}, {column})");
    }
    let blind = capture.blind_pixels(usize::MAX);
    assert!((6000..6600).contains(&blind), "{blind}");
}

/// Beams that fire in turns: their other pixels send no pulse, and times before a column's own are in every output.
#[test]
fn beams_that_fire_in_turns_leave_pixels_without_a_pulse() {
    let text = "[rotating]\nelevations_deg = [1, 0, -1]\nbeam_times_us = [-40, -20, 0]\nturns_while_firing = true\n\
                columns = 9\nrate_hz = 10\ncycle = [{ silent_beams = [2] }, { beam_times_us = [-30, -20, -10] }]\n";
    let sensor = sensor(text);
    let capture = Capture::at_origin(&sensor);
    let fires = |row, column| capture.pulse(row, column).is_some();
    assert!((0..9).all(|column| fires(0, column) && fires(2, column) == (column % 2 == 1)));
    assert_eq!(capture.blind_pixels(usize::MAX), 5);
    let facts = SensorFacts::of(&sensor);
    assert_eq!((facts.blind_pixels, facts.points_per_second), (5, Some(220.0)));
    assert!((facts.frame_s - (8.0 / 90.0 + 20e-6)).abs() < 1e-12);
    let time_us = |row, column| capture.time_s(row, column).map(|time| (time * 1e6).round());
    assert_eq!((time_us(0, 0), time_us(2, 0), time_us(2, 1)), (Some(-40.0), None, Some(11_101.0)));

    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/room.glb");
    let scene = gltf::load(&path, "room.glb", &gltf::Options::default()).unwrap().scene;
    let pose = Pose { translation: DVec3::new(0.5, 0.5, 1.0), ..Pose::IDENTITY };
    let frame = seen_from(&scene, &Tracer::build(&scene), &sensor, &pose);
    assert_eq!(frame.blind_pixels(), 5);
    assert_eq!(frame.causes()[2 * 9], beamcast::scan::Cause::NoPulse);
    assert_ne!(frame.causes()[2 * 9 + 1], beamcast::scan::Cause::NoPulse);
}

pub fn preset(name: &str) -> config::SensorFile {
    config::load_preset(name).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn the_built_in_sensors_are_the_files_and_each_says_where_it_is_from() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/sensors");
    let mut files = Vec::new();
    for folder in std::fs::read_dir(&root).unwrap().map(|e| e.unwrap().path()).filter(|p| p.is_dir()) {
        for file in std::fs::read_dir(&folder).unwrap().map(|e| e.unwrap().path()) {
            let name = file.strip_prefix(&root).unwrap().with_extension("");
            files.push(name.to_string_lossy().replace('\\', "/"));
        }
    }
    files.sort();
    let names: Vec<&str> = presets::BUILT_IN.iter().map(|(name, _)| *name).collect();
    assert_eq!(names, files);
    for name in names {
        let text = presets::text(name).unwrap();
        assert!(
            text.starts_with("#:schema ../../schema/sensor.json\n# ")
                && text.lines().any(|line| line.is_empty()),
            "{name} has no header"
        );
        let warnings = preset(name).warnings;
        assert!(warnings.iter().all(|w| w.severity == Severity::Warning), "{name}: {warnings:?}");
        assert_eq!(warnings, [], "{name}");
    }
}

/// The name, the number of rows and columns, the extents of azimuth and elevation in degrees, and the points a second, from
/// the data sheets, which round them. (A Velodyne firing cycle gives 1808 columns where the sheet says 1800. The unit on
/// which os0-128 is based spans 92 degrees where the sheet says 90.)
#[rustfmt::skip]
const DATA_SHEETS: &[(&str, usize, usize, f64, f64, f64)] = &[
    ("velodyne/vlp-16", 16, 1808, 360.0, 30.0, 300e3),
    ("velodyne/vlp-16-hi-res", 16, 1808, 360.0, 20.0, 300e3),
    ("velodyne/hdl-32e", 32, 2170, 360.0, 41.33, 695e3),
    ("velodyne/hdl-64e-s2", 64, 2083, 360.0, 26.8, 1.333e6), ("velodyne/hdl-64e-s3", 64, 1736, 360.0, 26.8, 1.1e6),
    ("velodyne/vlp-32a", 32, 1808, 360.0, 28.6, 600e3), ("velodyne/vlp-32c", 32, 1808, 360.0, 40.0, 600e3),
    ("velodyne/puck-128", 128, 1876, 360.0, 40.0, 2.4e6),
    ("ouster/os0-32", 32, 1024, 360.0, 90.0, 327_680.0), ("ouster/os0-64", 64, 1024, 360.0, 91.0, 655_360.0),
    ("ouster/os0-128", 128, 1024, 360.0, 92.0, 1_310_720.0), ("ouster/os1-32", 32, 1024, 360.0, 42.4, 327_680.0),
    ("ouster/os1-64", 64, 1024, 360.0, 42.4, 655_360.0), ("ouster/os1-128", 128, 1024, 360.0, 42.4, 1_310_720.0),
    ("ouster/os2-32", 32, 1024, 360.0, 22.5, 327_680.0), ("ouster/os2-64", 64, 1024, 360.0, 22.5, 655_360.0),
    ("ouster/os2-128", 128, 1024, 360.0, 22.5, 1_310_720.0), ("ouster/os0-128-rev7", 128, 1024, 360.0, 90.0, 1_310_720.0),
    ("ouster/os1-128-rev7", 128, 1024, 360.0, 42.4, 1_310_720.0), ("ouster/os1-16-gen1", 16, 1024, 360.0, 33.2, 163_840.0),
    ("ouster/os1-64-gen1", 64, 1024, 360.0, 33.2, 655_360.0),
    ("hesai/jt128", 128, 900, 360.0, 93.8, 1.152e6), ("hesai/jt16", 16, 600, 360.0, 40.0, 96e3),
    ("hesai/ot128", 128, 1800, 360.0, 40.0, 2_304_000.0), ("hesai/pandar40p", 40, 1800, 360.0, 40.0, 720e3),
    ("hesai/qt128", 128, 900, 360.0, 105.2, 864e3), ("hesai/xt-16", 16, 2000, 360.0, 30.0, 320e3),
    ("hesai/xt-32", 32, 2000, 360.0, 31.0, 640e3), ("hesai/xt32m2x", 32, 2000, 360.0, 40.3, 640e3),
    ("hesai/qt64", 64, 600, 360.0, 104.2, 384e3),
    ("hesai/pandar64", 64, 1800, 360.0, 40.0, 1_152_000.0),
    ("hesai/pandar128", 128, 1800, 360.0, 40.0, 2_304_000.0),
    ("robosense/rs16", 16, 1800, 360.0, 30.0, 288e3),
    ("robosense/rs32", 32, 1800, 360.0, 40.0, 576e3),
    ("robosense/helios", 32, 1800, 360.0, 70.0, 576e3), ("robosense/bpearl", 32, 1800, 360.0, 87.2, 576e3),
    ("robosense/ruby-plus", 128, 1800, 360.0, 40.0, 2.304e6),
    ("livox/mid-40", 1, 10_000, 38.4, 38.4, 100e3),
    ("livox/mid-70", 1, 10_000, 70.4, 70.4, 100e3),
    ("livox/avia", 6, 4000, 70.4, 77.2, 240e3),
    ("livox/mid-360", 4, 5000, 360.0, 59.0, 200e3),
    ("livox/horizon", 6, 4000, 81.7, 28.2, 240e3), ("livox/tele-15", 6, 4000, 14.5, 16.2, 240e3),
    ("hokuyo/utm-30lx", 1, 1081, 270.0, 0.0, 43_240.0), ("sick/lms5xx", 1, 381, 190.0, 0.0, 19_050.0),
    ("riegl/vz-400", 1, 732_000, 360.0, 100.0, 122e3), ("riegl/vux-1uav", 1, 2521, 330.0, 0.0, 500e3),
    ("riegl/vq-780i", 1, 66_600, 60.0, 0.0, 666e3), ("leica/als50", 1, 8300, 75.0, 0.0, 83e3),
    ("kinect/v1", 480, 640, 57.0, 43.0, 480.0 * 640.0 * 30.0),
    ("kinect/v2", 424, 512, 70.6, 60.0, 424.0 * 512.0 * 30.0),
    ("realsense/d415", 720, 1280, 65.0, 40.0, 720.0 * 1280.0 * 30.0),
    ("realsense/d435", 480, 848, 87.0, 58.0, 480.0 * 848.0 * 30.0),
    ("realsense/d455", 720, 1280, 87.0, 58.0, 720.0 * 1280.0 * 30.0),
    ("luxonis/oak-d", 800, 1280, 71.9, 48.8, 800.0 * 1280.0 * 30.0),
    // The sheet's 110 degrees across are the lens's, and 102.4 those of square pixels with the sheet's 70 degrees.
    ("stereolabs/zed-2", 720, 1280, 102.4, 70.0, 720.0 * 1280.0 * 60.0),
    ("azure/kinect", 576, 640, 75.0, 65.0, 576.0 * 640.0 * 30.0),
    ("ideal/camera", 480, 640, 90.0, 73.74, 0.0),
];

/// The extents of azimuth and elevation in degrees over so many frames. Those of a camera are taken along its middle row
/// and column, from edge to edge. A full turn is an azimuth without a gap of more than two degrees.
fn extents(sensor: &Sensor, frames: u64) -> (f64, f64) {
    let pattern = &sensor.pattern;
    let mut pulses = Vec::new();
    let (rows, columns) = (pattern.rows(), pattern.columns());
    for frame in 0..frames {
        let capture = Capture::at_origin(sensor).with_frame(frame);
        for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
            if pattern.is_camera() && row != rows / 2 && column != columns / 2 {
                continue;
            }
            let Some(pulse) = capture.pulse(row, column) else { continue };
            let (azimuth, elevation) = azimuth_elevation(pulse.direction);
            let keep = |is_there: bool, angle: f64| if is_there { angle } else { 0.0 };
            let is_camera = pattern.is_camera();
            pulses.push([
                keep(!is_camera || row == rows / 2, azimuth.degrees()),
                keep(!is_camera || column == columns / 2, elevation.degrees()),
            ]);
        }
    }
    let extent = |axis: usize| {
        let angles = pulses.iter().map(|p| p[axis]);
        angles.clone().fold(f64::MIN, f64::max) - angles.fold(f64::MAX, f64::min)
    };
    (extent(0), extent(1))
}

#[test]
fn each_built_in_sensor_has_its_data_sheets_figures_and_sees_the_street() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/street.glb");
    let options = gltf::Options::default();
    let scene = gltf::load(&path, "street.glb", &options).unwrap().scene;
    let tracer = Tracer::build(&scene);
    let at = DVec3::new(0.0, 0.0, 1.8);
    let level = Pose { translation: at, ..Pose::IDENTITY };
    // The range of a camera is a few metres, so it looks down at the road.
    let down = Pose::from_rpy(at, Angle::default(), Angle::deg(40.0), Angle::default());
    assert_eq!(DATA_SHEETS.len(), presets::BUILT_IN.len());
    for &(name, rows, columns, wide, high, points) in DATA_SHEETS {
        let sensor = preset(name).sensor;
        let pattern = &sensor.pattern;
        assert_eq!((pattern.rows(), pattern.columns()), (rows, columns), "{name}");
        let (azimuth, elevation) =
            extents(&sensor, if pattern.is_image() || rows == 1 && columns > 20_000 { 1 } else { 10 });
        assert!((azimuth - wide).abs() < 0.7, "{name}: {azimuth} degrees wide, {wide} on the sheet");
        assert!((elevation - high).abs() < 1.6, "{name}: {elevation} degrees high, {high} on the sheet");
        let pulses = pattern.rays() - Capture::at_origin(&sensor).blind_pixels(usize::MAX);
        let rate = pattern.rate_hz().unwrap_or(0.0) * pulses as f64;
        assert!(
            (rate - points).abs() <= 0.04 * points,
            "{name}: {rate} points a second, {points} on the sheet"
        );
        // A surveyor's scanner sees from farther than the street is long, or takes very many pulses for a frame.
        if sensor.range.min_m >= 100.0
            || pattern.rays() > 100_000 && !pattern.is_camera() && !pattern.is_image()
        {
            continue;
        }
        let pose = if pattern.is_camera() { &down } else { &level };
        let frame = seen_from(&scene, &tracer, &sensor, pose);
        let hits = frame.return_count();
        assert!(hits * 20 > pattern.rays(), "{name}: {hits} of {}", pattern.rays());
        let capture = Capture::at_origin(&sensor);
        for (pixel, hit) in frame.iter() {
            let (row, column) = (pixel / frame.columns(), pixel % frame.columns());
            let pulse = capture.pulse(row, column).unwrap();
            assert!(sensor.range.place_of(&pulse, hit.range_m).is_eq());
        }
    }
}

/// Checks the extents of Livox's published pattern tables, and that the field between them is filled: within 90 % of it,
/// fewer of the cells of one degree have a point after one frame, and nearly all have one after ten.
#[test]
fn livox_patterns_fill_their_field_of_view() {
    for (name, wide, high) in [
        ("livox/mid-40", 19.17, 19.17),
        ("livox/mid-70", 35.22, 35.22),
        ("livox/avia", 35.31, 38.59),
        ("livox/mid-360", 180.0, 29.68),
    ] {
        let sensor = preset(name).sensor;
        let pattern = &sensor.pattern;
        let (azimuth, elevation) = extents(&sensor, 10);
        assert!((azimuth / 2.0 - wide).abs() < 0.1, "{name}: ±{} wide", azimuth / 2.0);
        assert!((elevation / 2.0 - high).abs() < 0.2, "{name}: ±{} high", elevation / 2.0);
        let middle = if name == "livox/mid-360" { 22.5 } else { 0.0 };
        let mut cells = std::collections::BTreeMap::new();
        for a in -(wide as i64)..=wide as i64 {
            for e in -(high as i64)..=high as i64 {
                let off = libm::hypot(if wide > 90.0 { 0.0 } else { a as f64 / wide }, e as f64 / high);
                if off < 0.9 {
                    cells.insert((a, e), false);
                }
            }
        }
        let mut filled = Vec::new();
        for frame in 0..10 {
            let capture = Capture::at_origin(&sensor).with_frame(frame);
            for index in 0..pattern.rays() {
                let (row, column) = (index / pattern.columns(), index % pattern.columns());
                let d = capture.pulse(row, column).unwrap().direction;
                let (azimuth, elevation) = azimuth_elevation(d);
                let cell = (azimuth.degrees().round() as i64, (elevation.degrees() - middle).round() as i64);
                cells.entry(cell).and_modify(|full| *full = true);
            }
            filled.push(cells.values().filter(|full| **full).count() as f64 / cells.len() as f64);
        }
        assert!(filled[9] > 0.97 && filled[0] < filled[9], "{name}: {filled:?}");
    }
}

#[test]
fn a_job_takes_a_built_in_sensor_in_one_of_its_modes() {
    let load = |sensor: &str| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("job.toml");
        std::fs::write(&path, format!("scene = 'a.glb'\noutput.dir = 'o'\n[[sensor]]\n{sensor}\n")).unwrap();
        config::load_job(&path, &[])
    };
    let job = load("preset = 'ouster/os1-128'\nmode = '2048x10'\n[sensor.range]\nmax_m = 50").unwrap();
    assert_eq!(job.sensors[0].sensor.pattern.columns(), 2048);
    assert_eq!(job.sensors[0].sensor.range.max_m, 50.0);
    let text = presets::text("ouster/os1-128").unwrap();
    let file = &job.inputs[1];
    let hash = blake3::hash(text.as_bytes()).to_hex().to_string();
    assert_eq!((file.name.as_str(), file.bytes, &file.blake3), ("ouster/os1-128", text.len() as u64, &hash));
    let message = |sensor: &str| match load(sensor) {
        Err(Error::Config(found)) => {
            format!("{} | {}", found[0].message, found[0].help.as_deref().unwrap_or(""))
        }
        other => panic!("{other:?}"),
    };
    assert_eq!(
        message("preset = 'ouster/os1-129'"),
        "there is no built-in sensor `ouster/os1-129` | did you mean `ouster/os1-128`?"
    );
    assert_eq!(
        message("preset = 'vlp16'"),
        "there is no built-in sensor `vlp16` | did you mean `velodyne/vlp-16`?"
    );
    assert_eq!(
        message("preset = 'ouster/os1-128'\nmode = '2048x100'"),
        "the sensor has no mode `2048x100` | did you mean `2048x10`?"
    );
    assert_eq!(
        message("preset = 'ideal/camera'\nmode = 'fast'"),
        "the sensor has no mode `fast` | this sensor has no modes: leave it out"
    );
    // A table without keys addresses no element of a list, and so is no list.
    for key in ["beam_times_us", "cycle"] {
        let found = message(&format!("preset = 'hesai/pandar128'\n[sensor.rotating]\n{key} = {{}}"));
        assert!(found.starts_with(&format!("`{key}` is a table")), "{found}");
    }
}
