//! Imported calibrations against the formulas of the vendors' tools, written out independently from their documentation.
//! The pulses of an imported sensor must give the same points.

mod cameras;
mod heads;
mod lidars;

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use beamcast::config::load_sensor;
use beamcast::import::{Format, Source, import};
use beamcast::sensor::{Capture, Pattern, Pulse, Rotating, Sensor};
use beamcast::source::Diagnostic;
use glam::DVec3;
use proptest::prelude::*;
use serde_json::Value;

/// A small calibration file of the project. All of them are made up.
fn own(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/import").join(name);
    std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// Files of real units, if they are available. They are not part of the project.
fn corpus(folder: &str) -> Option<Vec<(String, String)>> {
    let Some(corpus) = std::env::var_os("BEAMCAST_CORPUS").map(PathBuf::from) else {
        println!("skipped: BEAMCAST_CORPUS not set");
        return None;
    };
    let files = std::fs::read_dir(corpus.join("sensors").join(folder)).expect("the corpus has sensors");
    let mut files: Vec<_> = files
        .map(|entry| {
            let path = entry.unwrap().path();
            let text = std::fs::read_to_string(&path).unwrap();
            (path.file_name().unwrap().to_string_lossy().into_owned(), text)
        })
        .collect();
    files.sort();
    assert!(!files.is_empty());
    Some(files)
}

fn toml(text: &str, firetimes: Option<&str>) -> Result<String, Vec<Diagnostic>> {
    let format = Format::of(text).expect("the format is recognised");
    import(format, Source { name: "unit", text }, firetimes.map(|text| Source { name: "times", text }))
}

/// Reads a sensor file that an import wrote. Reading must give no message.
fn sensor(toml: &str) -> Sensor {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sensor.toml");
    std::fs::write(&path, toml).unwrap();
    let file = load_sensor(&path).unwrap_or_else(|e| panic!("{e}\n{toml}"));
    assert!(file.warnings.is_empty(), "{:?}\n{toml}", file.warnings);
    file.sensor
}

fn imported(text: &str) -> Sensor {
    sensor(&toml(text, None).unwrap_or_else(|e| panic!("{e:#?}")))
}

fn rotating(sensor: &Sensor) -> &Rotating {
    match &sensor.pattern {
        Pattern::Rotating(pattern) => pattern,
        other => panic!("{other:?}"),
    }
}

/// The time of a pulse after its column's own time, in seconds.
fn after_column_s(pattern: &Rotating, pulse: &Pulse, column: usize) -> f64 {
    pulse.time_s - column as f64 * pattern.column_s()
}

/// Compares every beam of `columns` columns, at two ranges, with a vendor's formula for the point of a channel, an azimuth
/// of the head in the sensor's own frame, and a range.
fn check_points(sensor: &Sensor, vendor: impl Fn(usize, f64, f64) -> DVec3) {
    let pattern = rotating(sensor);
    let columns = pattern.columns();
    for row in 0..pattern.beams().len() {
        let channel = pattern.beams()[row].file_index;
        for column in (0..columns).step_by(columns / 7 + 1).chain([columns - 1]) {
            // A beam may be silent in a column.
            let Some(pulse) = Capture::at_origin(sensor).pulse(row, column) else { continue };
            for range in [0.75, 80.0] {
                let ours = pulse.point(range);
                // The head turns clockwise until a channel fires.
                let turned =
                    std::f64::consts::TAU * pattern.rate_hz() * after_column_s(pattern, &pulse, column);
                let head = pattern.azimuth(column).radians() - turned;
                let theirs = vendor(channel, head, range);
                assert!(
                    ours.distance(theirs) < 1e-9,
                    "channel {channel}, column {column}, {range} m: {ours}, not {theirs}"
                );
            }
        }
    }
}

fn floats(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

/// The lookup table of ouster-sdk, in metres. `encoder` is θe.
fn ouster_point(json: &Value, beam: usize, encoder: f64, r: f64) -> DVec3 {
    let in_table = |table: &str, key: &str| json.get(table).unwrap_or(json).get(key).cloned();
    let altitudes = floats(&in_table("beam_intrinsics", "beam_altitude_angles").unwrap());
    let azimuths = floats(&in_table("beam_intrinsics", "beam_azimuth_angles").unwrap());
    let used: Vec<(f64, f64)> = altitudes.into_iter().zip(azimuths).filter(|b| *b != (0.0, 0.0)).collect();
    let (phi, theta_a) = (used[beam].0.to_radians(), -used[beam].1.to_radians());
    let (nx, nz) = match in_table("beam_intrinsics", "beam_to_lidar_transform") {
        Some(m) => (floats(&m)[3], floats(&m)[11]),
        None => {
            let mm = in_table("beam_intrinsics", "lidar_origin_to_beam_origin_mm").and_then(|n| n.as_f64());
            (mm.unwrap_or(15.806), 0.0) // the files without this value are those of OS-1
        }
    };
    let n = if nz == 0.0 { nx } else { libm::hypot(nx, nz) };
    let (r, theta) = (r * 1e3, encoder + theta_a);
    let lidar = [
        (r - n) * libm::cos(theta) * libm::cos(phi) + nx * libm::cos(encoder),
        (r - n) * libm::sin(theta) * libm::cos(phi) + nx * libm::sin(encoder),
        (r - n) * libm::sin(phi) + nz,
        1.0,
    ];
    let m = floats(&in_table("lidar_intrinsics", "lidar_to_sensor_transform").unwrap());
    let row = |i: usize| (0..4).map(|j| m[4 * i + j] * lidar[j]).sum::<f64>() / 1e3;
    DVec3::new(row(0), row(1), row(2))
}

fn check_ouster(text: &str) {
    let json: Value = serde_json::from_str(text).unwrap();
    // In both transforms of real units the encoder's zero points backward.
    check_points(&imported(text), |beam, azimuth, r| {
        ouster_point(&json, beam, azimuth - std::f64::consts::PI, r)
    });
}

#[test]
fn ouster_metadata_gives_the_points_of_the_sdk() {
    for name in ["ouster_flat.json", "ouster_nested.json"] {
        check_ouster(&own(name));
    }
    let flat = imported(&own("ouster_flat.json"));
    let pattern = rotating(&flat);
    assert_eq!((pattern.beams().len(), pattern.columns(), pattern.rate_hz()), (4, 512, 20.0));
    // Column 0 is at the encoder's zero, which points backward. The next column is one step clockwise.
    assert!((pattern.azimuth(1).degrees() - (180.0 - 360.0 / 512.0)).abs() < 1e-12);
}

#[test]
fn a_window_of_columns_may_go_round() {
    let nested = imported(&own("ouster_nested.json"));
    let pattern = rotating(&nested);
    assert_eq!(pattern.columns(), 124, "1000 to 1023 and 0 to 99");
    let azimuth = |column: f64| 180.0 - 360.0 * column / 1024.0;
    assert!((pattern.azimuth(0).degrees() - azimuth(1000.0)).abs() < 1e-9);
    assert!((pattern.azimuth(123).degrees() - azimuth(1024.0 + 99.0)).abs() < 1e-9);
}

#[test]
fn metadata_of_real_ousters() {
    for (name, text) in corpus("ouster").into_iter().flatten() {
        println!("{name}");
        check_ouster(&text);
    }
}

#[test]
fn malformed_metadata_is_refused_with_its_place() {
    for (name, text) in corpus("ouster_malformed").into_iter().flatten() {
        let found = toml(&text, None);
        let expected = match name.as_str() {
            "complete_but_all_zeros_legacy.json" => "every beam's angles are 0",
            "incomplete_data_format_legacy.json" => "`data_format` has no `columns_per_frame`",
            "incorrect_nbeam_angles_legacy_113.json" => "there are 63 altitudes and 64 azimuths",
            // The missing part, calibration_status, has no influence on the geometry.
            "incomplete_no_calref_nonlegacy.json" => {
                check_ouster(&text);
                continue;
            }
            _ => panic!("{name} is new"),
        };
        let found = found.unwrap_err();
        assert_eq!(found[0].message, expected, "{name}");
        assert!(found[0].line_column().0 > 1, "{name}: {:?}", found[0].span);
    }
}

struct Laser {
    vertical: f64,
    rotation: f64,
    vertical_offset: f64,
    horizontal_offset: f64,
}

/// The formula of the driver's `unpack`, with the azimuth `a` clockwise, in ROS's axes.
fn velodyne_point(laser: &Laser, a: f64, r: f64) -> DVec3 {
    let (sin_vertical, cos_vertical) = libm::sincos(laser.vertical);
    let (sin, cos) = libm::sincos(a - laser.rotation);
    let in_plane = r * cos_vertical - laser.vertical_offset * sin_vertical;
    let x = in_plane * sin - laser.horizontal_offset * cos;
    let y = in_plane * cos + laser.horizontal_offset * sin;
    DVec3::new(y, -x, r * sin_vertical + laser.vertical_offset * cos_vertical)
}

/// Each value of a key in a driver's YAML, in the file's order.
fn values(text: &str, key: &str) -> Vec<f64> {
    let key = format!("{key}:");
    let after = |at: usize| text[at + key.len()..].trim_start();
    let number = |text: &str| {
        let end = text.find(|c: char| !matches!(c, '0'..='9' | '.' | '-' | '+' | 'e')).unwrap_or(text.len());
        text[..end].parse().unwrap()
    };
    let is_whole = |at: &usize| {
        *at == 0 || !text.as_bytes()[at - 1].is_ascii_alphanumeric() && text.as_bytes()[at - 1] != b'_'
    };
    text.match_indices(&key).map(|(at, _)| at).filter(is_whole).map(|at| number(after(at))).collect()
}

#[test]
fn velodyne_calibrations_give_the_points_of_the_driver() {
    let laser = |vertical, rotation, vertical_offset, horizontal_offset| Laser {
        vertical,
        rotation,
        vertical_offset,
        horizontal_offset,
    };
    let lasers = [
        laser(-0.26, 0.07, 0.2, -0.026),
        laser(-0.03, 0.12, 0.19, 0.026),
        laser(0.19, -0.05, 0.21, 0.026),
        laser(0.0, 0.0, 0.0, 0.0),
    ];
    let text = own("velodyne.yaml");
    check_points(&imported(&text), |id, azimuth, r| velodyne_point(&lasers[id], -azimuth, r));
    let toml = toml(&text, None).unwrap();
    assert!(toml.contains("# Left out: dist_correction, focal_slope, which"), "{toml}");
}

#[test]
fn calibrations_of_real_velodynes() {
    for (name, text) in corpus("velodyne").into_iter().flatten() {
        println!("{name}");
        let [ids, vertical, rotation, vertical_offset, horizontal_offset] = [
            "laser_id",
            "vert_correction",
            "rot_correction",
            "vert_offset_correction",
            "horiz_offset_correction",
        ]
        .map(|key| values(&text, key));
        let at = |list: &[f64], index: usize| list.get(index).copied().unwrap_or(0.0);
        check_points(&imported(&text), |id, azimuth, r| {
            let index = ids.iter().position(|x| *x == id as f64).unwrap();
            let laser = Laser {
                vertical: vertical[index],
                rotation: rotation[index],
                vertical_offset: at(&vertical_offset, index),
                horizontal_offset: at(&horizontal_offset, index),
            };
            velodyne_point(&laser, -azimuth, r)
        });
    }
}

/// The pixel to which OpenCV's `projectPoints` and `fisheye::projectPoints` project a direction of the optical frame, in
/// OpenCV's pixel coordinates.
fn opencv_pixel(d: DVec3, [fx, fy, cx, cy]: [f64; 4], coefficients: &[f64], is_fisheye: bool) -> [f64; 2] {
    let k = |index: usize| coefficients.get(index).copied().unwrap_or(0.0);
    let (x, y) = (d.x / d.z, d.y / d.z);
    let r2 = x * x + y * y;
    let (x, y) = if is_fisheye {
        let r = r2.sqrt();
        let t = libm::atan(r);
        let t2 = t * t;
        let drawn = t * (1.0 + t2 * (k(0) + t2 * (k(1) + t2 * (k(2) + t2 * k(3)))));
        (x * drawn / r, y * drawn / r)
    } else {
        let radial = (1.0 + k(0) * r2 + k(1) * r2 * r2 + k(4) * r2 * r2 * r2)
            / (1.0 + k(5) * r2 + k(6) * r2 * r2 + k(7) * r2 * r2 * r2);
        let (p1, p2) = (k(2), k(3));
        (
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        )
    };
    [fx * x + cx, fy * y + cy]
}

#[test]
fn cameras_see_pixels_where_opencv_draws_them() {
    for (name, size, matrix, coefficients, is_fisheye) in [
        (
            "camera_info.yaml",
            (480, 640),
            [525.25, 524.75, 319.5, 241.125],
            &[0.0405, -0.1182, 0.0011, -0.0007, 0.0651][..],
            false,
        ),
        (
            "opencv.yaml",
            (240, 320),
            [261.5, 262.25, 160.0, 118.5],
            &[0.15, -0.2, 1e-3, -5e-4, 0.03, 0.04, -0.01, 2e-3],
            false,
        ),
        ("opencv_fisheye.yaml", (240, 320), [150.0, 150.5, 159.5, 119.5], &[-0.012, 4e-3, -1e-3, 2e-4], true),
    ] {
        let sensor = imported(&own(name));
        let pattern = &sensor.pattern;
        assert_eq!((pattern.rows(), pattern.columns()), size, "{name}");
        for row in (0..size.0).step_by(17) {
            for column in (0..size.1).step_by(19) {
                // The direction is in the camera's body frame: x forward, y left, z up.
                let d = Capture::at_origin(&sensor)
                    .pulse(row, column)
                    .expect("the lens draws every pixel")
                    .direction;
                let drawn = opencv_pixel(DVec3::new(-d.y, -d.z, d.x), matrix, coefficients, is_fisheye);
                for (drawn, pixel) in drawn.into_iter().zip([column as f64, row as f64]) {
                    assert!((drawn - pixel).abs() < 1e-7, "{name}: ({column}, {row}) is drawn at {drawn:?}");
                }
            }
        }
    }
}

#[test]
fn a_printed_message_of_ros_is_a_camera_too() {
    let message = "header:\n  frame_id: camera\nheight: 4\nwidth: 6\ndistortion_model: plumb_bob\n\
                   d: [0.0, 0.0, 0.0, 0.0, 0.0]\nk: [5.0, 0.0, 2.5, 0.0, 5.0, 1.5, 0.0, 0.0, 1.0]\n";
    let toml = toml(message, None).unwrap();
    assert!(
        toml.contains("[pinhole]") && toml.contains("cx_px = 3.0\n") && !toml.contains("distortion ="),
        "{toml}"
    );
    assert_eq!(Capture::at_origin(&sensor(&toml)).pulse(1, 2).unwrap().direction.y.signum(), 1.0);
}

#[test]
fn a_table_of_rays_is_named_by_a_sensor_file() {
    let folder = tempfile::tempdir().unwrap();
    let text = own("rays.csv");
    std::fs::write(folder.path().join("rays.csv"), &text).unwrap();
    let toml = import(Format::Rays, Source { name: "rays.csv", text: &text }, None).unwrap();
    let path = folder.path().join("sensor.toml");
    std::fs::write(&path, &toml).unwrap();
    let sensor = load_sensor(&path).unwrap_or_else(|e| panic!("{e}\n{toml}")).sensor;
    assert_eq!(sensor.pattern.rays(), 3);
    let (azimuth, elevation) = (1.5_f64.to_radians(), -2.25_f64.to_radians());
    let expected = DVec3::new(
        libm::cos(elevation) * libm::cos(azimuth),
        libm::cos(elevation) * libm::sin(azimuth),
        libm::sin(elevation),
    );
    let pulse = Capture::at_origin(&sensor).pulse(0, 1).unwrap();
    assert!(pulse.direction.distance(expected) < 1e-9 && (pulse.time_s - 10e-6).abs() < 1e-12);
}

#[test]
fn firing_times_must_name_the_channels() {
    let found = toml(&own("hesai_angles.csv"), Some("Channel,fire time(us)\n1,2.0\n2,far\n")).unwrap_err();
    assert_eq!((found[0].message.as_str(), found[0].line_column()), ("`fire time` is `far`", (3, 3)));
    let found = toml(&own("hesai_angles.csv"), Some("Channel,fire time(us)\n1,2.0\n2,3.0\n")).unwrap_err();
    assert_eq!(found[0].message, "the file has no firing time of channel 3, 4");
    assert_eq!(found[0].path, Path::new("times"));
    let found = toml(&own("robosense.csv"), Some("Channel,fire time(us)\n1,2.0\n")).unwrap_err();
    assert_eq!(found[0].message, "`times` does not go with RoboSense angles");
}

#[test]
fn mistakes_are_told_where_they_are() {
    let flat = own("ouster_flat.json");
    let velodyne = own("velodyne.yaml");
    let camera = own("camera_info.yaml");
    let of = |text: &str, from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        text.replacen(from, to, 1)
    };
    for (text, message, label, line) in [
        (
            of(&flat, "512x20", "fast"),
            "`lidar_mode` is the string \"fast\"",
            "expected columns and rate, such as \"1024x10\"",
            5,
        ),
        (
            of(&flat, "16.611", "\"high\""),
            "`beam_altitude_angles[0]` is the string \"high\"",
            "expected a number",
            6,
        ),
        (of(&flat, "16.611", "166.11"), "a beam has an altitude of 166.11 degrees", "expected -90 to 90", 6),
        (
            of(&flat, "[-1, 0, 0, 0,", "[-1, 0, 0,"),
            "`lidar_to_sensor_transform` has 15 numbers",
            "expected 16: four rows of four",
            8,
        ),
        (
            of(&flat, "[-1, 0, 0, 0,", "[-1, 0, 0, 5,"),
            "the lidar is tilted, or off its sensor's axis",
            "expected a turn about z, and an offset along z",
            8,
        ),
        (
            of(&flat, "\"beam_azimuth_angles\"", "\"azimuths\""),
            "the file has no `beam_azimuth_angles`",
            "",
            1,
        ),
        (of(&flat, "OS-1-4", "XY"), "the file has no `lidar_origin_to_beam_origin_mm`", "", 1),
        (of(&velodyne, "-0.26", "-15.0"), "`lasers[1].vert_correction` is -15", "", 7),
        (
            of(&velodyne, "num_lasers: 4", "num_lasers: 16"),
            "`num_lasers` is 16, and 4 are listed",
            "expected 4",
            2,
        ),
        (
            of(&velodyne, "laser_id: 3", "laser_id: 2"),
            "the lasers are not numbered from 0 to 3",
            "number 3 is missing, or there twice",
            5,
        ),
        (of(&velodyne, "rot_correction: 0.0,", ""), "`lasers[3]` has no `rot_correction`", "", 15),
        (
            of(&camera, "plumb_bob", "mei"),
            "the distortion model is unknown",
            "expected plumb_bob, rational_polynomial or equidistant",
            8,
        ),
        (
            of(&camera, ", 0.0651", ", 0.0651, 0.1"),
            "the file has 6 distortion coefficients",
            "expected 4, 5 or 8: k1 k2 p1 p2 k3 k4 k5 k6",
            12,
        ),
        (
            of(&camera, "[525.25, 0.,", "[525.25, 0.5,"),
            "`camera_matrix` is no matrix of a pinhole camera",
            "expected fx 0 cx, 0 fy cy, 0 0 1: pixels without skew",
            7,
        ),
        (
            of(&camera, "640", "640.5"),
            "`image_width` is 640.5",
            "expected a whole number from 1 to 1000000",
            1,
        ),
        (of(&own("hesai_angles.csv"), "7.25", "up"), "`Elevation` is `up`", "expected a number", 3),
        (
            of(&own("robosense.csv"), "2.5,-0.25", "2.5,-0.25,1,7"),
            "the line has 4 fields",
            "expected 1 to 3: vertical angle, horizontal angle, ring",
            2,
        ),
        ("{\"beam_intrinsics\": [1, 2".to_owned(), "", "", 1),
    ] {
        let found = toml(&text, None).unwrap_err();
        let all: Vec<_> = found.iter().map(|d| (d.line_column().0, &d.message)).collect();
        let told = found.iter().find(|d| d.message.contains(message)).unwrap_or_else(|| panic!("{all:?}"));
        assert_eq!(told.line_column().0, line, "{all:?}");
        assert!(told.label.contains(label), "{}", told.label);
    }
}

#[test]
fn all_mistakes_are_told_at_once() {
    let text = own("ouster_flat.json").replace("512x20", "").replace("16.611", "x").replace("36.18", "up");
    assert_eq!(toml(&text, None).unwrap_err().len(), 3);
}

/// Imports a text as every format. Any result must be a valid sensor file.
fn try_all(text: &str) {
    let start = Instant::now();
    let _ = Format::of(text);
    for format in Format::ALL {
        for firetimes in [None, Some(Source { name: "times", text })] {
            match import(format, Source { name: "unit", text }, firetimes) {
                Ok(made) => drop(made.parse::<toml::Table>().unwrap_or_else(|e| panic!("{e}\n{made}"))),
                Err(found) => assert!(found.iter().any(|d| !d.message.is_empty())),
            }
        }
    }
    assert!(start.elapsed() < Duration::from_secs(20), "{:?}", start.elapsed());
}

const OWN: [&str; 14] = [
    "ouster_flat.json",
    "ouster_nested.json",
    "velodyne.yaml",
    "hesai_angles.csv",
    "hesai_firetimes.csv",
    "hesai_states.csv",
    "hesai_modes.csv",
    "hesai_loops.csv",
    "robosense.csv",
    "camera_info.yaml",
    "opencv.yaml",
    "opencv_fisheye.yaml",
    "rays.csv",
    "ouster_flat.json",
];

#[test]
fn hostile_texts_are_refused_in_time() {
    let many = 100_000;
    for piece in [
        "[", "{", "{\"a\":", "- ", "? ", "a: ", "- - ? ", "&a *a ", "!!x ", "\"", "'", "|\n", "#", ",", "1,",
        "---\n",
    ] {
        try_all(&piece.repeat(many));
    }
    try_all(&format!(
        "lasers:\n{}",
        "- {laser_id: 0, vert_correction: 0, rot_correction: 0}\n".repeat(many / 10)
    ));
    try_all(&format!("{{\"beam_altitude_angles\": [{}1]}}", "1,".repeat(many)));
    try_all(&format!("a: &a [{}]\n", "*a,".repeat(many)));
    try_all(&format!("Channel,Elevation,Azimuth\n{}", "1,1,1\n".repeat(many)));
    try_all("");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    #[test]
    fn no_bytes_make_a_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        try_all(&String::from_utf8_lossy(&bytes));
    }

    #[test]
    fn no_punctuation_makes_a_panic(text in "[-\\[\\]{}:,?&*!|>'\"%@`#a0-9 .\\n\\t\\r\u{feff}é~+e]{0,200}") {
        try_all(&text);
    }

    #[test]
    fn no_change_of_a_file_makes_a_panic(
        file in 0..OWN.len(),
        at in 0.0..1.0_f64,
        length in 0..40_usize,
        with in "[-\\[\\]{}:,\"0-9.ex \\n\u{e9}]{0,6}",
    ) {
        let text = own(OWN[file]);
        let start = text.floor_char_boundary((at * text.len() as f64) as usize);
        let end = text.ceil_char_boundary((start + length).min(text.len()));
        try_all(&format!("{}{with}{}", &text[..start], &text[end..]));
    }
}
