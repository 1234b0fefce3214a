//! When pulses are sent: rolling shutters, triggers, and the frames of a sequence.

use std::path::Path;

use beamcast::angle::Angle;
use beamcast::config::{self, Job};
use beamcast::frame::Pose;
use beamcast::motion::Trajectory;
use beamcast::scan::{Progress, scan};
use beamcast::sensor::{Camera, Capture, KannalaBrandt, Lens, Pattern, Raster, RowOrder, Sensor, Shutter};
use beamcast::trace::Tracer;
use glam::DVec3;

use crate::shapes::{alone, quad};

/// A wall at the depth Z has a vertical edge at y = `EDGE_M`, and ends there to the left.
const DEPTH_M: f64 = 8.0;
const EDGE_M: f64 = 0.3;
/// The wall's other edges are so far away.
const SIDE_M: f64 = 20.0;

/// The speed of a camera that passes the wall, to the left along y.
const SPEED_M_S: f64 = 20.0;

/// The columns, row by row, in which a camera of a passing vehicle sees the wall.
fn columns_of_wall(sensor: &Sensor, is_frozen: bool) -> Vec<Vec<bool>> {
    let wall = [(-SIDE_M, -SIDE_M), (EDGE_M, -SIDE_M), (EDGE_M, SIDE_M), (-SIDE_M, SIDE_M)];
    let scene = alone(quad(wall.map(|(y, z)| DVec3::new(DEPTH_M, y, z))));
    let trajectory = Trajectory::Twist {
        start: Pose::IDENTITY,
        linear_m_s: DVec3::new(0.0, SPEED_M_S, 0.0),
        angular_rad_s: DVec3::ZERO,
    };
    let capture = Capture::new(sensor, Pose::IDENTITY, &trajectory, 0, 0).in_sequence(0.0, is_frozen);
    let frame = scan(&scene, &Tracer::build(&scene), &capture, &Progress::default()).unwrap();
    let row = |row| (0..frame.columns()).map(|column| frame.get(row, column).is_some()).collect();
    (0..frame.rows()).map(row).collect()
}

fn pinhole() -> Camera {
    Camera::new((160, 120), (97.0, 98.0), (80.3, 58.9), Some(30.0)).unwrap()
}

fn sensor(camera: Camera) -> Sensor {
    Sensor::new(Pattern::Camera(camera))
}

/// A row r that is exposed at r·τ sees the edge at y − v·r·τ from the camera, which is column cx − f·(y − v·r·τ)/Z: the edge
/// leans by f·v·τ/Z pixels a row. The middle of a pixel lies to the right of the edge, or it does not. Vertices are stored as f32
/// about the scene's centre, here up to 20 m from it, so the edge is off by at most 2⁻²⁰ m, which is f·2⁻²⁰/Z = 1.2e-5 pixels:
/// no pixel's middle may be nearer to it than that.
#[test]
fn the_edge_of_a_wall_leans_behind_a_rolling_shutter() {
    let (row_time_s, (width, height)) = (150e-6, (160, 120));
    for order in [RowOrder::TopDown, RowOrder::BottomUp] {
        let shutter = Shutter::rolling(row_time_s, order).unwrap();
        let seen = columns_of_wall(&sensor(pinhole().with_shutter(shutter)), false);
        let ((f, _), (cx, _)) = (pinhole().focal_px(), pinhole().principal_px());
        let edge_px = |row: usize| {
            let rows_before = if order == RowOrder::TopDown { row } else { height - 1 - row };
            cx - f * (EDGE_M - SPEED_M_S * rows_before as f64 * row_time_s) / DEPTH_M
        };
        for (row, seen) in seen.iter().enumerate() {
            let edge = edge_px(row);
            for (column, &is_seen) in seen.iter().enumerate() {
                let middle = column as f64 + 0.5;
                assert!((middle - edge).abs() > 1.2e-5, "choose other numbers: row {row}, column {column}");
                assert_eq!(is_seen, middle > edge, "{order:?}, row {row}, column {column}, edge at {edge}");
            }
        }
        // Over the whole image the edge moves by f·v·τ/Z pixels a row, and so by 4.3 pixels.
        let lean = (edge_px(height - 1) - edge_px(0)).abs();
        assert!((lean - 97.0 * SPEED_M_S * row_time_s / DEPTH_M * 119.0).abs() < 1e-9 && lean > 4.0);
        let first_seen = |row: usize| seen[row].iter().position(|&is_seen| is_seen).unwrap();
        assert_eq!(first_seen(0).abs_diff(first_seen(height - 1)), 4);
        assert_eq!(seen[0].len(), width);
        // In a frozen frame nothing moves, and behind a global shutter no row is later than another.
        let frozen = columns_of_wall(&sensor(pinhole().with_shutter(shutter)), true);
        assert_eq!(frozen, columns_of_wall(&sensor(pinhole()), false));
        assert!(frozen.iter().all(|row| *row == frozen[0]) && frozen != seen);
    }
}

/// Behind any lens, and in a spherical image, a ray of direction d that leaves at y = v·t meets the wall's plane at
/// y = v·t + Z·d.y/d.x, if it goes forward.
#[test]
fn rows_of_fisheyes_and_spherical_images_have_their_own_times() {
    let shutter = Shutter::rolling(400e-6, RowOrder::BottomUp).unwrap();
    let fisheye = Lens::KannalaBrandt(KannalaBrandt::new([0.01, 0.0, 0.0, 0.0]).unwrap());
    let camera = Camera::new((64, 48), (30.0, 30.0), (31.7, 24.1), Some(10.0)).unwrap().with_lens(fisheye);
    let whole = (Angle::deg(360.0), Angle::deg(180.0));
    let sphere = Raster::equirectangular((90, 45), whole, Some(10.0)).unwrap();
    let rolling =
        [Pattern::Camera(camera.with_shutter(shutter)), Pattern::Raster(sphere.with_shutter(shutter))];
    for pattern in rolling {
        let sensor = Sensor::new(pattern);
        let capture = Capture::at_origin(&sensor);
        let (rows, columns) = (capture.rows(), capture.columns());
        let seen = columns_of_wall(&sensor, false);
        let (mut hits, mut moved) = (0, 0);
        for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
            let time_s = (rows - 1 - row) as f64 * 400e-6;
            let pulse = capture.pulse(row, column);
            let expected_time = pulse.is_some().then_some(time_s);
            assert_eq!(
                (pulse.map(|p| p.time_s), capture.time_s(row, column)),
                (expected_time, expected_time)
            );
            let Some(d) = pulse.map(|pulse| pulse.direction).filter(|d| d.x > 0.05) else {
                assert!(!seen[row][column] || pulse.is_some_and(|p| p.direction.x > 0.0));
                continue;
            };
            let y_at = |time_s: f64| SPEED_M_S * time_s + DEPTH_M * d.y / d.x;
            let is_near_the_rim = (y_at(time_s) - EDGE_M).abs() < 2e-6
                || y_at(time_s) < 1.0 - SIDE_M
                || (DEPTH_M * d.z / d.x).abs() > SIDE_M - 1.0;
            if !is_near_the_rim {
                assert_eq!(seen[row][column], y_at(time_s) < EDGE_M, "row {row}, column {column}");
                hits += usize::from(seen[row][column]);
                moved += usize::from((y_at(0.0) < EDGE_M) != seen[row][column]);
            }
        }
        assert!(hits > 100 && moved > 5, "{hits} {moved}");
        assert_eq!(sensor.pattern.last_pulse_s(), (rows - 1) as f64 * 400e-6);
    }
}

/// A job of two cameras and a LiDAR, with what is given added to the first camera's tables.
fn job(of_sensor: &str, of_camera: &str, overrides: &[&str]) -> Job {
    let folder = tempfile::tempdir().unwrap();
    let room = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/room.glb");
    let text = format!(
        "scene = {room:?}\n[sequence]\nframes = 3\nstart_s = 2.0\n[trajectory]\npose = {{}}\n\
         [[sensor]]\nname = \"left\"\n{of_sensor}\n\
         [sensor.pinhole]\nwidth_px = 4\nheight_px = 3\nhfov_deg = 60.0\nrate_hz = 20.0\n{of_camera}\n\
         [[sensor]]\nname = \"right\"\npinhole = {{ width_px = 4, height_px = 3, hfov_deg = 60.0, rate_hz = 20.0 }}\n\
         [[sensor]]\nname = \"top\"\npreset = \"livox/mid-40\"\n[output]\ndir = \"out\"\n"
    );
    let path = folder.path().join("job.toml");
    std::fs::write(&path, text).unwrap();
    let overrides: Vec<String> = overrides.iter().map(|pair| (*pair).to_owned()).collect();
    config::load_job(&path, &overrides).unwrap_or_else(|error| panic!("{error}"))
}

#[test]
fn sensors_of_a_rig_are_triggered_apart_and_have_rates_of_their_own() {
    let job = job(
        "trigger_s = 0.025",
        "row_time_us = 30.0\nrow_order = \"bottom_up\"",
        &["sensor.right.pinhole.rate_hz=50"],
    );
    assert!(job.warnings.is_empty(), "{:?}", job.warnings);
    for frame in [0, 1, 7] {
        let starts = [0, 1, 2].map(|sensor| job.capture(sensor, frame).start_s);
        let k = frame as f64;
        assert_eq!(starts, [2.0 + 0.025 + k / 20.0, 2.0 + k / 50.0, 2.0 + k / 10.0]);
    }
    let rolling = job.capture(0, 1);
    assert_eq!([0, 1, 2].map(|row| rolling.time_s(row, 3).unwrap()), [6e-5, 3e-5, 0.0]);
    assert_eq!(rolling.cast_at_s(6e-5), rolling.start_s + 6e-5);
    assert_eq!(job.capture(1, 1).time_s(2, 3), Some(0.0));
    // Frames of a pattern that does not repeat go on where the last one ended, whenever the sequence and its sensor start.
    let livox = |frame, column| job.capture(2, frame).pulse(0, column).unwrap().direction;
    let columns = job.capture(2, 0).columns();
    let step = |a: DVec3, b: DVec3| (a - b).length();
    for frame in [0, 1] {
        let [before, last] = [columns - 2, columns - 1].map(|column| livox(frame, column));
        let [first, second] = [0, 1].map(|column| livox(frame + 1, column));
        let expected = (step(before, last) + step(first, second)) / 2.0;
        assert!((step(last, first) - expected).abs() < 0.05 * expected, "frame {frame}");
        assert!(step(livox(frame, 0), first) > 20.0 * expected);
    }
}

#[test]
fn a_shutter_that_is_slower_than_its_frames_is_doubted() {
    let codes = |of_camera: &str| -> Vec<&str> {
        let job = job("", of_camera, &[]);
        job.warnings.iter().map(|warning| warning.code).collect()
    };
    // Three rows in 50 ms.
    assert_eq!(codes("row_time_us = 16666.0"), [""; 0]);
    assert_eq!(codes("row_time_us = 16667.0"), ["row-time"]);
    assert_eq!(codes("row_order = \"bottom_up\""), ["row-order"]);
    assert_eq!(codes("row_order = \"bottom_up\"\nrow_time_us = 5"), [""; 0]);
}
