//! Cameras besides the pinhole, each against its closed form.

use beamcast::frame::{BODY_FROM_OPTICAL, Pose};
use beamcast::sensor::facts::SensorFacts;
use beamcast::sensor::{Capture, Orthographic, Pattern, RowOrder, Sensor, Shutter};
use beamcast::trace::Tracer;
use glam::{DAffine3, DVec3};

use crate::shapes::{cuboid, placed, quad, seen_from};

/// A camera of parallel rays with pixels of 25 cm.
fn parallel() -> Sensor {
    Sensor::new(Pattern::Orthographic(Orthographic::new((16, 8), (4.0, 2.0), Some(10.0)).unwrap()))
}

/// A surface at every distance has as many pixels, depth is range, and points are where their pixels are.
#[test]
fn parallel_rays_show_a_surface_as_large_at_every_distance() {
    let slanted = quad([[1.0, -10.0], [1.0, 10.0], [-1.0, 10.0], [-1.0, -10.0]].map(|[up, left]| {
        // The plane x = 20 + y/2.
        DVec3::new(20.0 + left / 2.0, left, 30.0 * up)
    }));
    // Two boxes, 1 m wide and half a metre high, whose near faces are 3 m and 12 m away.
    let near = cuboid([3.0, 0.5, -0.25], [4.0, 1.5, 0.25]);
    let far = cuboid([12.0, -1.5, -0.25], [13.0, -0.5, 0.25]);
    let at = |mesh| (mesh, DAffine3::IDENTITY);
    let scene = placed(vec![slanted, near, far], vec![at(0), at(1), at(2)]);
    let (sensor, tracer) = (parallel(), Tracer::new(&scene));
    let capture = Capture::at_origin(&sensor);
    let frame = seen_from(&scene, &tracer, &sensor, &Pose::IDENTITY);
    let mut seen = [0; 3];
    for (row, column) in (0..8).flat_map(|row| (0..16).map(move |column| (row, column))) {
        let hit = frame.get(row, column).unwrap();
        let (y, z) = (2.0 - (column as f64 + 0.5) * 0.25, 1.0 - (row as f64 + 0.5) * 0.25);
        let expected = match hit.instance {
            0 => 20.0 + y / 2.0,
            1 => 3.0,
            _ => 12.0,
        };
        seen[hit.instance as usize] += 1;
        // All corners are exact in 32 bits, and a hit of so flat a depth is good to some 10 ulps of 30 m.
        assert!((hit.range_m - expected).abs() < 1e-13, "({row}, {column}): {} {expected}", hit.range_m);
        assert_eq!(capture.depth_over_range(row, column), Some(1.0));
        let point = capture.pulse(row, column).unwrap().point(hit.range_m);
        assert_eq!((point.y, point.z), (y, z));
        let place = sensor.pattern.project(BODY_FROM_OPTICAL.inverse().direction(point));
        assert_eq!(place, Some((column as f64 + 0.5, row as f64 + 0.5)));
    }
    // 4 by 2 pixels each.
    assert_eq!(seen, [16 * 8 - 16, 8, 8]);
    let facts = SensorFacts::of(&sensor);
    assert_eq!((facts.kind, facts.horizontal_fov_deg, facts.azimuth_step_deg), ("camera", 0.0, None));
    assert_eq!((facts.image_m, facts.pixel_m), (Some([4.0, 2.0]), Some([0.25; 2])));
}

/// The rows of a camera of parallel rays are exposed as any camera's, and limits of depth are those of its range.
#[test]
fn a_camera_of_parallel_rays_has_a_shutter_and_limits_of_depth() {
    let text = "[orthographic]\nwidth_px = 16\nheight_px = 8\nwidth_m = 4\nrow_time_us = 10\nrow_order = \"bottom_up\"\n\
                [range]\nmin_m = 1\nmax_m = 9\nof = \"depth\"\n";
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sensor.toml");
    std::fs::write(&path, text).unwrap();
    let sensor = beamcast::config::load_sensor(&path).unwrap().sensor;
    let Pattern::Orthographic(camera) = &sensor.pattern else { panic!("{:?}", sensor.pattern) };
    assert_eq!(camera.size_m(), (4.0, 2.0), "pixels are square");
    assert_eq!(camera.shutter(), &Shutter::rolling(1e-5, RowOrder::BottomUp).unwrap());
    let capture = Capture::at_origin(&sensor);
    assert_eq!((capture.time_s(7, 3), capture.time_s(5, 0)), (Some(0.0), Some(2e-5)));
    let pulse = capture.pulse(0, 15).unwrap();
    let place = |range_m| sensor.range.place_of(&pulse, range_m).is_eq();
    assert!(place(1.0) && place(9.0) && !place(0.999) && !place(9.001));
}
