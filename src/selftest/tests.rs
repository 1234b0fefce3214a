//! The self-test has to pass what is right, and must not pass what is wrong.

use std::sync::Arc;
use std::sync::atomic::Ordering;

use super::*;
use crate::scan::{Cause, Return};
use crate::sensor::{Beam, Camera, Limited, Phase, RingOrder, Rotating};
use crate::trace::Tracer;

fn beams(elevations_deg: &[f64]) -> Vec<Beam> {
    let beam = |(i, &e): (usize, &f64)| Beam {
        elevation: Angle::deg(e),
        azimuth_offset: Angle::deg(i as f64 * 0.7 - 1.0),
        time_s: i as f64 * 2e-6,
        file_index: 0,
    };
    elevations_deg.iter().enumerate().map(beam).collect()
}

fn lidar_of(beams: Vec<Beam>) -> Sensor {
    let turn = (Angle::deg(180.0), Angle::deg(-180.0));
    let pattern = Rotating::new(beams, 180, turn, 10.0).unwrap();
    let range = RangeLimits { min_m: 0.5, max_m: 100.0, ..RangeLimits::default() };
    Sensor {
        pattern: Pattern::Rotating(pattern),
        range,
        ring: RingOrder::Row,
        measurement: Default::default(),
    }
}

fn lidar() -> Sensor {
    lidar_of(beams(&[90.0, 20.0, 10.0, 3.0, 1.0, 0.0, -1.0, -3.0, -10.0, -20.0]))
}

/// A LiDAR whose light leaves beside the axis, from which its ranges are counted, with beams that fire in turns and before
/// their column.
fn beside_its_axis() -> Sensor {
    let mut beams = beams(&[85.0, 20.0, 3.0, 0.0, -1.0, -10.0, -20.0]);
    beams[2].time_s = -50e-6;
    let turn = (Angle::deg(180.0), Angle::deg(-180.0));
    let origins = vec![DVec3::new(0.04356, 0.012, 0.004); beams.len()];
    let phases = [Phase { times_s: None, silent: vec![1, 4] }, Phase::default()];
    let pattern = Rotating::new(beams, 180, turn, 10.0).unwrap().turning_while_firing();
    let pattern = pattern.with_origins(&origins).unwrap().with_cycle(&phases).unwrap();
    let range = RangeLimits { min_m: 0.5, max_m: 100.0, ..RangeLimits::default() };
    Sensor {
        pattern: Pattern::Rotating(pattern.with_ranges_from_origin()),
        range,
        ring: RingOrder::Row,
        measurement: Default::default(),
    }
}

fn camera() -> Sensor {
    let pattern = Camera::new((64, 48), (40.0, 41.0), (31.3, 24.9), Some(30.0)).unwrap();
    let range = RangeLimits::default();
    Sensor { pattern: Pattern::Camera(pattern), range, ring: RingOrder::Row, measurement: Default::default() }
}

fn somewhere() -> Pose {
    Pose::from_rpy(DVec3::new(12.5, -7.25, 1.8), Angle::deg(3.0), Angle::deg(-5.0), Angle::deg(40.0))
}

fn test(sensor: &Sensor, pose: &Pose) -> SelftestReport {
    selftest(sensor, pose, None, &Progress::default()).unwrap().unwrap()
}

#[test]
fn a_head_whose_light_leaves_beside_its_axis_passes() {
    let sensor = beside_its_axis();
    let silent = Capture::at_origin(&sensor).blind_pixels(usize::MAX);
    for pose in [Pose::IDENTITY, somewhere()] {
        let report = test(&sensor, &pose);
        assert!(report.passed(), "{report:#?}");
        for s in &report.shapes {
            assert!(s.misses >= silent && s.facet_error.max_m <= 1e-9, "{s:?}");
        }
        assert!(report.shapes.iter().map(|s| s.hits).sum::<usize>() > 1000);
    }
}

#[test]
fn right_sensors_pass_wherever_they_stand() {
    let far = Pose { translation: DVec3::new(1e6, -2e5, 3e5), ..somewhere() };
    for sensor in [lidar(), camera()] {
        for pose in [Pose::IDENTITY, somewhere(), far] {
            let report = test(&sensor, &pose);
            assert!(report.passed(), "{report:#?}");
            assert_eq!(report.shapes.len() as u64, CASTS);
            for s in &report.shapes {
                assert!(s.hits + s.misses > 100 * s.edges, "most rays are decided: {s:?}");
                assert!(s.allowance_used <= 1.0 && s.facet_error.max_m <= 1e-9, "{s:?}");
            }
            // All but the sphere: its facets' sagitta is not the sensor's fault.
            let flat = report.shapes.iter().filter(|s| s.shape != "ball");
            let worst = flat.map(|s| s.ideal_error.max_m).fold(0.0, f64::max);
            assert!(worst > 0.0 && worst < 1e-2, "{worst}");
            let of =
                |name: &str| report.shapes.iter().filter(|s| s.shape.starts_with(name)).collect::<Vec<_>>();
            for name in ["plate", "box", "wedge", "ball"] {
                assert!(
                    of(name).iter().all(|s| s.misses > 0) && of(name).iter().any(|s| s.hits > 10),
                    "{name}"
                );
            }
            // From inside, only the limits let anything miss.
            assert!(of("room")[2].misses == 0 && of("room")[2].hits > 1000);
        }
    }
}

#[test]
fn limits_are_part_of_the_closed_form() {
    let report = test(&lidar(), &Pose::IDENTITY);
    let [near, _, far] = [0, 1, 2].map(|i| &report.shapes[i * SHAPES]);
    // Walls at 0.95 of the least range are seen only obliquely; those at 0.9 of the largest, only straight on.
    assert!(near.misses > 100 && near.hits > 100, "{near:?}");
    assert!(far.misses > 100 && far.hits > 100, "{far:?}");
}

/// Limits of depth and ranges that begin before the beam are limits like others: at the shapes near, at middle range and far,
/// and the frame that ignores them fails.
#[test]
fn limits_of_depth_and_range_offsets_have_closed_forms() {
    let limits = RangeLimits { min_m: 0.5, max_m: 20.0, of: Limited::Depth };
    let by_depth = Sensor { range: limits, ..camera() };
    let Pattern::Rotating(head) = lidar().pattern else { unreachable!() };
    let origins = vec![DVec3::new(0.2, 0.0, 0.05); head.beams().len()];
    let head = head.with_origins(&origins).unwrap().with_range_offset(0.3).unwrap();
    let from_axis = Sensor { pattern: Pattern::Rotating(head), ..lidar() };
    for sensor in [&by_depth, &from_axis] {
        let report = test(sensor, &somewhere());
        assert!(report.passed(), "{report:#?}");
        let near = &report.shapes[..SHAPES];
        assert!(near.iter().any(|s| s.misses > 100), "something is too near: {near:?}");
    }
    // A camera that takes its limits along the ray sees less of what is far.
    let along_ray = Sensor { range: RangeLimits { of: Limited::Range, ..limits }, ..camera() };
    let target = &targets(&by_depth, distances(&limits)[2])[0];
    let stage = Stage::new(target, &Pose::IDENTITY).unwrap();
    let frame = seen(&stage.scene, &Capture::at_origin(&along_ray));
    assert!(judge(target, &stage, &Capture::at_origin(&by_depth), &frame).wrong > 100);
}

/// A miss has the right cause, or it is wrong.
#[test]
fn a_wrong_cause_is_caught() {
    let sensor = lidar();
    for (which, cause) in [(0, Cause::TooNear), (2, Cause::OutOfRange)] {
        let target = &targets(&sensor, distances(&sensor.range)[which])[0];
        let stage = Stage::new(target, &Pose::IDENTITY).unwrap();
        let capture = Capture::at_origin(&sensor);
        let right = seen(&stage.scene, &capture);
        assert!(right.pixels_of(cause) > 100, "{cause:?}");
        let returns: Vec<_> = right.first_returns().collect();
        let told = |&of: &Cause| if of == cause { Cause::Nothing } else { of };
        let pixels = right.causes().iter().map(told).zip(returns.iter().map(Option::as_slice));
        let wrong = Frame::from_pixels(right.rows(), right.columns(), pixels);
        assert_eq!(judge(target, &stage, &capture, &right).wrong, 0);
        assert_eq!(judge(target, &stage, &capture, &wrong).wrong, right.pixels_of(cause));
    }
}

fn seen(scene: &Scene, capture: &Capture) -> Frame {
    scan(scene, &Tracer::build(scene), capture, &Progress::default()).unwrap()
}

/// A frame of the size of another, with other returns.
fn frame_of(frame: &Frame, returns: &[Option<Return>]) -> Frame {
    let cause = |(one, &was): (&Option<Return>, &Cause)| match (one, was) {
        (Some(_), _) => Cause::Surface,
        (None, Cause::Surface) => Cause::Nothing,
        (None, was) => was,
    };
    let causes = returns.iter().zip(frame.causes()).map(cause);
    let pixels = causes.zip(returns.iter().map(Option::as_slice));
    Frame::from_pixels(frame.rows(), frame.columns(), pixels)
}

/// The level room and the box at middle range, with what is seen of them changed before it is judged.
fn judged(sensor: &Sensor, change: impl Fn(&mut Scene, &mut [Option<Return>])) -> Vec<ShapeResult> {
    let pose = somewhere();
    let targets = targets(sensor, distances(&sensor.range)[1]);
    let chosen = targets.iter().filter(|t| ["room, level", "box"].contains(&t.name));
    let judge_one = |target| {
        let mut stage = Stage::new(target, &pose).unwrap();
        let ideal = stage.scene.clone();
        change(&mut stage.scene, &mut []);
        let trajectory = Trajectory::Fixed(pose);
        let capture = Capture::new(sensor, Pose::IDENTITY, &trajectory, 0, 0);
        let seen = seen(&stage.scene, &capture);
        let mut returns: Vec<_> = seen.first_returns().collect();
        change(&mut Scene::default(), &mut returns);
        stage.scene = ideal;
        judge(target, &stage, &capture, &frame_of(&seen, &returns))
    };
    chosen.map(judge_one).collect()
}

#[test]
fn a_wrong_frame_or_scene_is_caught() {
    type Change = fn(&mut Scene, &mut [Option<Return>]);
    let changes: [(&str, Change); 5] = [
        ("a range off by 10 nm", |_, returns| {
            returns.iter_mut().flatten().take(1).for_each(|r| r.range_m += 1e-8);
        }),
        ("a NaN", |_, returns| returns.iter_mut().flatten().take(1).for_each(|r| r.range_m = f64::NAN)),
        ("a return lost", |_, returns| {
            if let Some(hit) = returns.iter_mut().find(|r| r.is_some()) {
                *hit = None;
            }
        }),
        ("a scene moved by 0.1 mm", |s, _| {
            let moved = !s.geometry.meshes.is_empty();
            Arc::make_mut(&mut s.geometry).centre.x += if moved { 1e-4 } else { 0.0 };
        }),
        ("a triangle lost", |s, _| {
            if let Some(mesh) = Arc::make_mut(&mut s.geometry).meshes.first_mut() {
                mesh.triangles[11] = mesh.triangles[10];
            }
        }),
    ];
    for sensor in [lidar(), camera()] {
        assert!(judged(&sensor, |_, _| ()).iter().all(|r| r.wrong == 0));
        for (what, change) in changes {
            let results = judged(&sensor, change);
            assert!(results.iter().any(|r| r.wrong > 0), "{what}: {results:#?}");
            let wrong = results.iter().find_map(|r| r.first_wrong).unwrap();
            assert!(wrong.found_m.is_some() || wrong.expected_m.is_some(), "{what}: {wrong:?}");
        }
    }
}

#[test]
fn a_beam_that_is_not_where_the_table_says_is_caught() {
    let table = lidar();
    let report = |other: &Sensor| {
        let target = &targets(&table, 7.0)[0];
        let stage = Stage::new(target, &Pose::IDENTITY).unwrap();
        let frame = seen(&stage.scene, &Capture::at_origin(other));
        judge(target, &stage, &Capture::at_origin(&table), &frame)
    };
    assert_eq!(report(&table).wrong, 0);
    let mut moved = beams(&[90.0, 20.0, 10.0, 3.0, 1.0, 0.0, -1.0, -3.0, -10.0, -20.0]);
    moved[3].elevation = Angle::deg(3.0001);
    let result = report(&lidar_of(moved));
    assert!(result.wrong > 100 && result.first_wrong.unwrap().row == 3, "{result:?}");
}

#[test]
fn the_geometry_of_a_wrong_image_is_caught() {
    // Rows, columns and times are judged by a table that the points were not made with.
    let sensor = lidar();
    let frame = |sensor: &Sensor| {
        let stage = Stage::new(&targets(sensor, 7.0)[0], &Pose::IDENTITY).unwrap();
        seen(&stage.scene, &Capture::at_origin(sensor))
    };
    let all_passed = |checks: &[Check]| checks.iter().all(Check::passed);
    assert!(all_passed(&geometry(&sensor, &frame(&sensor))));
    assert!(all_passed(&geometry(&camera(), &frame(&camera()))));
    let right = frame(&sensor);
    let mut bad: Vec<_> = right.first_returns().collect();
    bad[7].as_mut().unwrap().range_m = f64::NAN;
    assert!(!all_passed(&geometry(&sensor, &frame_of(&right, &bad))));

    // A cloud that is made with another table than the image.
    let mut other = beams(&[90.0, 20.0, 10.0, 3.0, 1.0, 0.0, -1.0, -3.0, -10.0, -20.0]);
    (other[4].elevation, other[5].azimuth_offset) = (Angle::deg(1.000_000_1), Angle::deg(0.0));
    let other = lidar_of(other);
    let seen = frame(&sensor);
    let point = |row, column, range| Capture::at_origin(&other).pulse(row, column).map(|p| p.point(range));
    let checks = angles(&Capture::at_origin(&sensor), &seen, &point);
    let failed: Vec<_> = checks.iter().filter(|c| !c.passed()).map(|c| (c.name, c.at.0)).collect();
    assert_eq!(
        failed,
        [("direction of the points", 5), ("elevation of the rows", 4), ("azimuth of the columns", 5)]
    );
    let camera = camera();
    let capture = Capture::at_origin(&camera);
    let mirrored = |row, column: usize, range| capture.pulse(row, 63 - column).map(|p| p.point(range));
    let checks = angles(&capture, &frame(&camera), &mirrored);
    assert!(checks.iter().any(|c| c.name == "pixels of the points" && !c.passed()));
}

#[test]
fn times_that_go_back_or_take_too_long_are_caught() {
    let passed = |time: &dyn Fn(usize, usize) -> f64| {
        times((2, 10), Some(10.0), &|row, column| Some(time(row, column)))
            .iter()
            .map(Check::passed)
            .collect::<Vec<_>>()
    };
    let step = |column: usize| column as f64 * 0.01;
    assert_eq!(passed(&|row, column| step(column) + row as f64), [true, true]);
    assert_eq!(passed(&|_, column| step(column) - if column == 7 { 0.011 } else { 0.0 }), [false, true]);
    assert_eq!(passed(&|row, column| step(column) * (row + 1) as f64), [true, false]);
    // An image that starts between firings.
    assert_eq!(passed(&|_, column| step((column + 7) % 10)), [true, true]);
    assert_eq!(passed(&|_, column| step((column + 7) % 5)), [false, true]);
    assert_eq!(passed(&|_, column| if column == 3 { f64::NAN } else { 0.0 }), [false, false]);
}

#[test]
fn a_published_method_is_not_good_enough() {
    let method = crate::trace::methods::METHODS.first().unwrap();
    let report = selftest(&lidar(), &Pose::IDENTITY, Some(method), &Progress::default()).unwrap().unwrap();
    assert!(!report.passed(), "f32 ranges are off by micrometres");
}

#[test]
fn it_can_be_stopped() {
    let progress = Progress::default();
    progress.cancelled.store(true, Ordering::Relaxed);
    assert_eq!(selftest(&lidar(), &Pose::IDENTITY, None, &progress).unwrap(), None);
}
