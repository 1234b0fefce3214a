//! Whole scans against closed forms: planes, a box, a wedge and a sphere, seen by a rotating LiDAR and a pinhole camera.

use beamcast::angle::Angle;
use beamcast::frame::Pose;
use beamcast::motion::Trajectory;
use beamcast::output::{CloudFrame, SensorFrame};
use beamcast::rng::Rng;
use beamcast::scan::{Cause, Frame, Progress, scan};
use beamcast::scene::Scene;
use beamcast::sensor::{
    Beam, Camera, Capture, Limited, Pattern, Pulse, RangeLimits, RayTable, RingOrder, Rotating, Sensor,
    direction,
};
use beamcast::trace::{BruteForce, Tracer};
use glam::{DAffine3, DVec3};

use crate::shapes::{alone, cuboid, mesh, placed, quad, seen_from, soup, sphere};

fn lidar(limits: RangeLimits) -> Sensor {
    let beam = |i: i32| Beam {
        elevation: Angle::deg(f64::from(i) * 2.0 - 31.0),
        azimuth_offset: Angle::deg(f64::from(i % 4) * 0.7),
        time_s: 0.0,
        file_index: 0,
    };
    let turn = (Angle::deg(180.0), Angle::deg(-180.0));
    let pattern = Rotating::new((0..32).map(beam).collect(), 360, turn, 10.0).unwrap();
    Sensor {
        pattern: Pattern::Rotating(pattern),
        range: limits,
        ring: RingOrder::Row,
        measurement: Default::default(),
    }
}

fn camera(limits: RangeLimits) -> Sensor {
    let pattern = Camera::new((160, 120), (97.0, 98.0), (80.3, 58.9), None).unwrap();
    Sensor {
        pattern: Pattern::Camera(pattern),
        range: limits,
        ring: RingOrder::Row,
        measurement: Default::default(),
    }
}

const NO_LIMITS: RangeLimits = RangeLimits { min_m: 0.0, max_m: f64::INFINITY, of: Limited::Range };

fn see(scene: &Scene, sensor: &Sensor, pose: &Pose) -> Frame {
    seen_from(scene, &Tracer::build(scene), sensor, pose)
}

/// Calls `check` with each ray's world direction and its range, if it returned.
fn each_ray(frame: &Frame, sensor: &Sensor, pose: &Pose, mut check: impl FnMut(DVec3, Option<f64>)) {
    let capture = Capture::at_origin(sensor);
    for row in 0..frame.rows() {
        for column in 0..frame.columns() {
            let direction = pose.direction(capture.pulse(row, column).unwrap().direction);
            check(direction, frame.get(row, column).map(|r| r.range_m));
        }
    }
}

/// Half an ulp of f32 at `x`, which is the greatest error from rounding a coordinate of that size.
fn half_ulp(x: f64) -> f64 {
    f64::from((x.abs() as f32).next_up() - x.abs() as f32) / 2.0
}

/// Two unit vectors that span the plane with this normal.
fn across(normal: DVec3) -> (DVec3, DVec3) {
    let u = normal.any_orthonormal_vector();
    (u, normal.cross(u))
}

/// A square target with this normal and half a side of `half`, at `distance` from the sensor along `towards`.
struct Target {
    middle: DVec3,
    normal: DVec3,
    half: f64,
}

/// Scans a target and compares each ray with two planes: with the plane through the stored (f32) vertices of the hit
/// triangle, to 1e-9 m, and with the ideal plane, to the error that rounding the vertices may cause.
fn check_target(target: &Target, sensor: &Sensor, pose: &Pose) -> usize {
    let (u, v) = across(target.normal);
    // The corners are in f64 around a local origin, so that the only rounding to f32 is that of the scene's coordinates.
    let local = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
    let shape = quad(local.map(|(a, b)| DVec3::new(a, b, 0.0)));
    let axes = glam::DMat3::from_cols(u * target.half, v * target.half, target.normal * target.half);
    let scene = placed(vec![shape], vec![(0, DAffine3::from_mat3_translation(axes, target.middle))]);
    let stored: Vec<DVec3> = scene.geometry.meshes[0]
        .positions
        .iter()
        .map(|p| DVec3::new(p[0].into(), p[1].into(), p[2].into()))
        .collect();
    let largest = stored.iter().map(|p| p.abs().max_element()).fold(0.0, f64::max);
    // World coordinates themselves are f64. Near 10⁶ m a pose or a corner is accurate to 1.2e-10 m.
    let world =
        4.0 * f64::EPSILON * (pose.translation.abs().max_element() + target.middle.abs().max_element());
    let vertex_error = 3_f64.sqrt() * half_ulp(largest) + world;
    let frame = see(&scene, sensor, pose);
    let mut hits = 0;
    let capture = Capture::at_origin(sensor);
    for row in 0..frame.rows() {
        for column in 0..frame.columns() {
            let d = pose.direction(capture.pulse(row, column).unwrap().direction);
            let found = frame.get(row, column);
            // The closed form is computed relative to the target's middle.
            let from = pose.translation - target.middle;
            let cos = target.normal.dot(d);
            let t = -target.normal.dot(from) / cos;
            let p = from + d * t;
            let (x, y) = (u.dot(p) / target.half, v.dot(p) / target.half);
            // The bound is the distance in metres along the ray by which the point may be off, from the vertices and from
            // f64.
            let bound = vertex_error / cos.abs() + 1e-9;
            let margin = bound / target.half;
            let distance_from_rim = 1.0 - x.abs().max(y.abs());
            let inside = distance_from_rim > 0.0 && t > 0.0;
            if distance_from_rim.abs() > margin || t < 0.0 {
                assert_eq!(
                    found.is_some(),
                    inside,
                    "row {row}, column {column}: closed form ({x}, {y}) at {t}"
                );
            }
            if let Some(found) = found {
                hits += 1;
                assert!(
                    (found.range_m - t).abs() <= bound,
                    "row {row}, column {column}: {} m, closed form {t} m, allowed {bound:e}",
                    found.range_m
                );
                let [a, b, c] =
                    scene.geometry.meshes[0].triangles[found.triangle as usize].map(|v| stored[v as usize]);
                let n = (b - a).cross(c - a).normalize();
                let origin = pose.translation - scene.geometry.centre;
                let through_stored = n.dot(a - origin) / n.dot(d);
                // The reference itself loses a few ulps of its operands, over the cosine.
                assert!(
                    (found.range_m - through_stored).abs() <= 1e-9,
                    "row {row}, column {column}: {} m, stored plane {through_stored} m",
                    found.range_m
                );
            }
        }
    }
    hits
}

#[test]
fn planes_at_every_distance_tilt_and_place() {
    let mut hits = 0;
    let places = [DVec3::ZERO, DVec3::new(1e6, -1e6, 250.0), DVec3::new(0.0, 1e6, 0.0)];
    for sensor in [lidar(NO_LIMITS), camera(NO_LIMITS)] {
        for place in places {
            let pose = Pose::from_rpy(place, Angle::deg(1.5), Angle::deg(-2.0), Angle::deg(33.0));
            let ahead = pose.direction(DVec3::X);
            for distance in [0.5, 3.0, 20.0, 75.0, 200.0] {
                // The targets face the sensor, are tilted, or are vertical walls that are parallel to no axis.
                for (tilt, about) in
                    [(0.0, DVec3::Z), (35.0, DVec3::Y), (60.0, DVec3::Z), (80.0, DVec3::new(1.0, 2.0, 3.0))]
                {
                    let (sin, cos) = Angle::deg(tilt).sin_cos();
                    let (u, _) = across(ahead);
                    let normal = (-ahead * cos + u * sin).normalize();
                    let turned = (normal + about * 1e-3).normalize();
                    let target =
                        Target { middle: place + ahead * distance, normal: turned, half: distance * 0.8 };
                    hits += check_target(&target, &sensor, &pose);
                }
                // The ground is level below the sensor, out to 200 m.
                let level = Pose { translation: place + DVec3::Z * distance.min(20.0), ..Pose::IDENTITY };
                let ground = Target { middle: place, normal: DVec3::Z, half: 200.0 };
                hits += check_target(&ground, &sensor, &level);
            }
        }
    }
    assert!(hits > 200_000, "{hits}");
}

/// Tests beams that graze a plane at about 89.9° of incidence.
#[test]
fn grazing_planes() {
    let elevations = [-0.05, -0.1, -0.11, -0.2, -0.5, -1.0];
    let beams = elevations.map(|e| Beam {
        elevation: Angle::deg(e),
        azimuth_offset: Angle::default(),
        time_s: 0.0,
        file_index: 0,
    });
    let turn = (Angle::deg(180.0), Angle::deg(-180.0));
    let pattern = Rotating::new(beams.to_vec(), 720, turn, 10.0).unwrap();
    let sensor = Sensor {
        pattern: Pattern::Rotating(pattern),
        range: NO_LIMITS,
        ring: RingOrder::Row,
        measurement: Default::default(),
    };
    let mut hits = 0;
    for place in [DVec3::ZERO, DVec3::new(1e6, 2e5, -3e5)] {
        for height in [0.05, 0.2, 0.349] {
            let pose = Pose { translation: place + DVec3::Z * height, ..Pose::IDENTITY };
            hits += check_target(&Target { middle: place, normal: DVec3::Z, half: 200.0 }, &sensor, &pose);
        }
    }
    assert!(hits > 10_000, "{hits}");
}

/// The depths at which a line enters and leaves a convex solid, if it does (M. Cyrus and J. Beck, 1978). The solid is given
/// by its planes: points p with n·p ≤ h for each (n, h).
fn clip(planes: &[(DVec3, f64)], origin: DVec3, d: DVec3) -> Option<(f64, f64)> {
    let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
    for &(n, h) in planes {
        let (along, above) = (n.dot(d), h - n.dot(origin));
        if along < 0.0 {
            enter = enter.max(above / along);
        } else if along > 0.0 {
            leave = leave.min(above / along);
        } else if above < 0.0 {
            return None;
        }
    }
    (enter <= leave).then_some((enter, leave))
}

/// The planes of a box.
fn slabs(low: DVec3, high: DVec3) -> Vec<(DVec3, f64)> {
    [DVec3::X, DVec3::Y, DVec3::Z].into_iter().flat_map(|n| [(n, n.dot(high)), (-n, -n.dot(low))]).collect()
}

#[test]
fn a_box_from_inside() {
    let (low, high) = ([-4.0, -3.5, -1.25], [6.0, 3.0, 2.0]);
    let scene = alone(cuboid(low, high));
    let planes = slabs(low.map(f64::from).into(), high.map(f64::from).into());
    for sensor in [lidar(NO_LIMITS), camera(NO_LIMITS)] {
        for position in [DVec3::ZERO, DVec3::new(5.9, -3.4, 1.9), DVec3::new(0.1, 0.2, -1.2)] {
            let pose = Pose::from_rpy(position, Angle::deg(3.0), Angle::deg(10.0), Angle::deg(-77.0));
            let frame = see(&scene, &sensor, &pose);
            each_ray(&frame, &sensor, &pose, |d, found| {
                let (_, leave) = clip(&planes, position, d).expect("from inside, every ray leaves");
                let found = found.expect("from inside, every ray hits");
                assert!((found - leave).abs() <= 1e-12 * leave.max(1.0), "{found} m, closed form {leave} m");
            });
        }
    }
}

#[test]
fn a_box_and_a_wedge_from_outside() {
    // The wedge is a door stop whose slope rises from x = 2 to x = 5.
    let wedge = mesh(
        vec![
            [2.0, -1.5, -1.0],
            [5.0, -1.5, -1.0],
            [5.0, -1.5, 0.5],
            [2.0, 1.5, -1.0],
            [5.0, 1.5, -1.0],
            [5.0, 1.5, 0.5],
        ],
        vec![[0, 1, 2], [3, 5, 4], [0, 4, 1], [0, 3, 4], [1, 4, 5], [1, 5, 2], [0, 2, 5], [0, 5, 3]],
    );
    let slope = DVec3::new(-1.5, 0.0, 3.0).normalize();
    let wedge_planes = vec![
        (slope, slope.dot(DVec3::new(2.0, 0.0, -1.0))),
        (DVec3::X, 5.0),
        (DVec3::NEG_Z, 1.0),
        (DVec3::Y, 1.5),
        (DVec3::NEG_Y, 1.5),
    ];
    let (low, high) = ([1.5, 1.0, -0.75], [3.0, 2.5, 0.5]);
    let cases = [
        (alone(wedge), wedge_planes),
        (alone(cuboid(low, high)), slabs(low.map(f64::from).into(), high.map(f64::from).into())),
    ];
    for (scene, planes) in &cases {
        for sensor in [lidar(NO_LIMITS), camera(NO_LIMITS)] {
            let pose =
                Pose::from_rpy(DVec3::new(0.1, 0.2, 0.3), Angle::deg(1.0), Angle::deg(5.0), Angle::deg(9.0));
            let frame = see(scene, &sensor, &pose);
            let (mut hits, mut rim) = (0, 0);
            each_ray(&frame, &sensor, &pose, |d, found| {
                let closed = clip(planes, pose.translation, d).filter(|&(_, leave)| leave > 0.0);
                // If a ray barely touches an edge, f64 rounding in the closed form decides whether it hits.
                let touch = closed.is_some_and(|(enter, leave)| leave - enter < 1e-12);
                rim += usize::from(touch);
                if !touch {
                    assert_eq!(found.is_some(), closed.is_some(), "{d}");
                }
                if let (Some(found), Some((enter, _))) = (found, closed) {
                    hits += 1;
                    assert!(
                        (found - enter).abs() <= 1e-12 * enter.max(1.0),
                        "{found} m, closed form {enter} m"
                    );
                }
            });
            assert!(hits > 100 && rim == 0, "{hits} hits, {rim} touching");
        }
    }
}

/// Two walls that a sensor at the origin looks at squarely: 18 m wide at x = 2, and 100 m wide at x = 6.
fn two_walls() -> Scene {
    let mut walls =
        quad([[2.0, -9.0, -9.0], [2.0, 9.0, -9.0], [2.0, 9.0, 9.0], [2.0, -9.0, 9.0]].map(DVec3::from));
    walls.positions.extend([[6.0, -50.0, -50.0], [6.0, 50.0, -50.0], [6.0, 50.0, 50.0], [6.0, -50.0, 50.0]]);
    walls.parts[0].triangles.extend([[4, 5, 6], [4, 6, 7]]);
    alone(walls)
}

/// A wall nearer than the least range blocks the beam, and hides the wall behind it. The limits are ranges along the ray or
/// depths: the formula is that of the walls' planes, and of the rays' angles.
#[test]
fn what_is_too_near_blocks_and_what_is_too_far_is_not_seen() {
    let scene = two_walls();
    let along = RangeLimits { min_m: 2.1, max_m: 2.3, of: Limited::Range };
    let limits = [
        (along, [1000, 1000, 1000]),
        (RangeLimits { max_m: 5.9, ..along }, [1000, 1000, 0]),
        (RangeLimits { of: Limited::Depth, ..along }, [0, 19200, 0]),
        (RangeLimits { min_m: 2.0 - 1e-9, max_m: 2.0 + 1e-9, of: Limited::Depth }, [19200, 0, 0]),
        (RangeLimits { min_m: 0.5, max_m: 1.9, of: Limited::Depth }, [0, 0, 19200]),
        (RangeLimits { min_m: 6.5, max_m: 7.0, of: Limited::Depth }, [0, 19200, 0]),
    ];
    for (limits, least) in limits {
        let sensor = camera(limits);
        let frame = see(&scene, &sensor, &Pose::IDENTITY);
        let (mut seen, mut near, mut far) = (0, 0, 0);
        let mut causes = frame.causes().iter();
        each_ray(&frame, &sensor, &Pose::IDENTITY, |d, found| {
            // The nearer wall fills the image.
            let range_m = 2.0 / d.x;
            let limited_m = if limits.of == Limited::Depth { range_m * d.x } else { range_m };
            let expected = match () {
                () if limited_m < limits.min_m => Cause::TooNear,
                () if limited_m > limits.max_m => Cause::OutOfRange,
                () => Cause::Surface,
            };
            assert_eq!((found.is_some(), causes.next()), (expected == Cause::Surface, Some(&expected)));
            assert!(found.is_none_or(|found| (found - range_m).abs() < 1e-13));
            *(match expected {
                Cause::Surface => &mut seen,
                Cause::TooNear => &mut near,
                _ => &mut far,
            }) += 1;
        });
        let counts = [seen, near, far];
        assert!(counts.iter().zip(least).all(|(count, least)| *count >= least), "{limits:?}: {counts:?}");
    }
}

/// Of what lies on a beam's way the first surface alone decides, also if only a farther one is within the limits. A miss is
/// told apart from a surface that is too far.
#[test]
fn each_miss_has_its_cause() {
    let scene = two_walls();
    let sensor = lidar(RangeLimits { min_m: 3.0, max_m: 50.0, of: Limited::Range });
    let frame = see(&scene, &sensor, &Pose::IDENTITY);
    let capture = Capture::at_origin(&sensor);
    let mut counts = [0; 4];
    for (pixel, &cause) in frame.causes().iter().enumerate() {
        let d = capture.pulse(pixel / 360, pixel % 360).unwrap().direction;
        let at = |x: f64, half: f64| (d.x > 0.0).then(|| x / d.x).filter(|t| (d * t).y.abs() < half);
        let expected = match at(2.0, 9.0).or(at(6.0, 50.0)) {
            None => Cause::Nothing,
            Some(t) if t < 3.0 => Cause::TooNear,
            Some(t) if t > 50.0 => Cause::OutOfRange,
            Some(_) => Cause::Surface,
        };
        assert_eq!(cause, expected, "{d}");
        counts[[Cause::Nothing, Cause::TooNear, Cause::OutOfRange, Cause::Surface]
            .iter()
            .position(|known| *known == expected)
            .unwrap()] += 1;
        let blocker = frame.blocker(pixel).map(|hit| hit.range_m);
        assert_eq!(blocker.is_some(), expected == Cause::TooNear);
        assert!(blocker.is_none_or(|range_m| (range_m - 2.0 / d.x).abs() < 1e-13));
    }
    assert!(counts.iter().all(|count| *count > 10), "{counts:?}");
}

/// Limits decide after the nearest hit is found, so a frame with limits is that of brute force, bit for bit: its returns, the
/// surfaces that block beams, and the causes.
#[test]
fn frames_with_limits_are_those_of_brute_force() {
    let mut random = Rng::new(11);
    let scene = alone(soup(&mut random, 300, 1.0));
    let limits = RangeLimits { min_m: 0.3, max_m: 0.6, of: Limited::Range };
    let Pattern::Rotating(head) = lidar(limits).pattern else { unreachable!() };
    let origins = vec![DVec3::new(0.1, 0.0, 0.05); head.beams().len()];
    let head = head.with_origins(&origins).unwrap().with_range_offset(0.15).unwrap();
    let from_axis = Sensor { pattern: Pattern::Rotating(head), ..lidar(limits) };
    let by_depth = camera(RangeLimits { of: Limited::Depth, ..limits });
    for sensor in [lidar(limits), from_axis, by_depth] {
        let pose = Pose::from_rpy(DVec3::splat(0.05), Angle::deg(10.0), Angle::deg(20.0), Angle::deg(30.0));
        let frame = see(&scene, &sensor, &pose);
        assert_eq!(frame, seen_from(&scene, &BruteForce(&scene), &sensor, &pose));
        for cause in [Cause::Surface, Cause::TooNear, Cause::OutOfRange] {
            assert!(frame.pixels_of(cause) > 100, "{cause:?}: {}", frame.pixels_of(cause));
        }
    }
}

/// Hesai's units report the distance of a point from the centre of the head, though the light leaves beside it. The point is
/// where the ray meets the wall; the range is its distance from the sensor, and the limits are of that range.
#[test]
fn a_range_from_the_sensors_origin_is_that_of_the_point_on_the_wall() {
    let centre = DVec3::new(0.2, 0.1, -0.05);
    let beams = [-20.0, 0.0, 20.0].map(|elevation| Beam {
        elevation: Angle::deg(elevation),
        azimuth_offset: Angle::deg(elevation / 10.0),
        time_s: elevation * 1e-6,
        file_index: 0,
    });
    let turn = (Angle::deg(180.0), Angle::deg(-180.0));
    let pattern = Rotating::new(beams.to_vec(), 360, turn, 10.0).unwrap().turning_while_firing();
    let pattern = pattern.with_origins(&[centre; 3]).unwrap().with_ranges_from_origin();
    let limits = RangeLimits { min_m: 2.1, max_m: 5.0, of: Limited::Range };
    let sensor = Sensor {
        pattern: Pattern::Rotating(pattern),
        range: limits,
        ring: RingOrder::Row,
        measurement: Default::default(),
    };
    let wall = [(-1e3, -1e3), (1e3, -1e3), (1e3, 1e3), (-1e3, 1e3)].map(|(y, z)| DVec3::new(2.0, y, z));
    let scene = alone(quad(wall));
    let frame = see(&scene, &sensor, &Pose::IDENTITY);
    let capture = Capture::at_origin(&sensor);
    let mut counts = [0; 3];
    for (pixel, &cause) in frame.causes().iter().enumerate() {
        let pulse = capture.pulse(pixel / 360, pixel % 360).unwrap();
        if pulse.direction.x < 0.01 {
            continue;
        }
        // The wall is at x = 2.
        let hit = pulse.origin + pulse.direction * ((2.0 - pulse.origin.x) / pulse.direction.x);
        let range = hit.length();
        let (expected, count) = match range {
            near if near < limits.min_m => (Cause::TooNear, 0),
            far if far > limits.max_m => (Cause::OutOfRange, 1),
            _ => (Cause::Surface, 2),
        };
        assert_eq!(cause, expected, "{hit}");
        counts[count] += 1;
        if let Some(found) = frame.get(pixel / 360, pixel % 360) {
            assert!((found.range_m - range).abs() < 1e-14 * range, "{} {range}", found.range_m);
            assert!(pulse.point(found.range_m).abs_diff_eq(hit, 1e-14 * range));
        }
    }
    assert!(counts.iter().all(|count| *count > 40), "{counts:?}");
}

/// A range that counts from the axis of the head begins before the beam's origin. What lies between the two is inside the head,
/// where no light passes: it blocks nothing. What lies between the origin and the least range does.
#[test]
fn nothing_blocks_a_beam_before_its_own_origin() {
    let (offset, min_m) = (0.1, 0.5);
    let beam =
        Beam { elevation: Angle::default(), azimuth_offset: Angle::default(), time_s: 0.0, file_index: 0 };
    let turn = (Angle::deg(180.0), Angle::deg(-180.0));
    let pattern = Rotating::new(vec![beam], 4, turn, 10.0).unwrap();
    let pattern = pattern.with_origins(&[DVec3::new(offset, 0.0, 0.0)]).unwrap();
    let pattern = Pattern::Rotating(pattern.with_range_offset(offset).unwrap());
    let limits = RangeLimits { min_m, ..RangeLimits::default() };
    let sensor = Sensor { pattern, range: limits, ring: RingOrder::Row, measurement: Default::default() };
    // A plate at x, square to the beam ahead (column 2), and a wall at 5 m. The scene is rounded to multiples of 2⁻²².
    let cause = |x: f64| {
        let square =
            |x: f64| [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].map(|(y, z)| DVec3::new(x, y, z));
        let mut shape = quad(square(5.0));
        shape.positions.extend(square(x).map(|p| p.as_vec3().to_array()));
        shape.parts[0].triangles.extend([[4, 5, 6], [4, 6, 7]]);
        let frame = see(&alone(shape), &sensor, &Pose::IDENTITY);
        (frame.causes()[2], frame.get(0, 2).map(|hit| (hit.range_m * 1e6).round() / 1e6))
    };
    // At the axis, and between the axis and the window: the beam begins at 0.1 m.
    assert_eq!(cause(0.0), (Cause::Surface, Some(5.0)));
    assert_eq!(cause(0.099), (Cause::Surface, Some(5.0)));
    assert_eq!(cause(0.101), (Cause::TooNear, None));
    assert_eq!(cause(0.499), (Cause::TooNear, None));
    // The limit is one of the range as the sensor reports it, from the axis.
    assert_eq!(cause(0.501), (Cause::Surface, Some(0.501)));
}

/// Compares a sphere with its own facets (by Möller and Trumbore's test in f64, over all of them) and with the ideal ball.
#[test]
fn a_tessellated_sphere() {
    let radius = 2.0;
    let levels = 4;
    let centre = DVec3::new(5.0, 0.5, -0.25);
    let scene = alone(sphere(radius, centre, levels));
    let mesh = &scene.geometry.meshes[0];
    let facets: Vec<[DVec3; 3]> = mesh
        .triangles
        .iter()
        .map(|t| {
            t.map(|v| {
                let p = mesh.positions[v as usize];
                DVec3::new(p[0].into(), p[1].into(), p[2].into()) + scene.geometry.centre
            })
        })
        .collect();
    // A facet whose largest edge is e lies within e²/(8r) of the sphere along that edge, and within e²/(6r) in its
    // interior.
    let edge = facets
        .iter()
        .flat_map(|[a, b, c]| [a.distance(*b), b.distance(*c), c.distance(*a)])
        .fold(0.0, f64::max);
    let sagitta = edge * edge / (6.0 * radius) * 1.01;
    for sensor in [lidar(NO_LIMITS), camera(NO_LIMITS)] {
        let frame = see(&scene, &sensor, &Pose::IDENTITY);
        let mut hits = 0;
        each_ray(&frame, &sensor, &Pose::IDENTITY, |d, found| {
            let nearest = facets
                .iter()
                .filter_map(|[a, b, c]| {
                    let (e1, e2) = (*b - *a, *c - *a);
                    let p = d.cross(e2);
                    let det = e1.dot(p);
                    let (s, q) = (-*a, (-*a).cross(e1));
                    let (u, v) = (s.dot(p) / det, d.dot(q) / det);
                    (u >= -1e-12 && v >= -1e-12 && u + v <= 1.0 + 1e-12).then(|| e2.dot(q) / det)
                })
                .filter(|t| *t > 0.0)
                .min_by(f64::total_cmp);
            assert_eq!(found.is_some(), nearest.is_some(), "{d}");
            let Some(found) = found else { return };
            hits += 1;
            let t = nearest.unwrap();
            // Near the rim, facets are seen edge-on and t is less certain by this factor: 10⁻¹² over the cosine.
            let cos = ((d * t - centre) / radius).dot(d).abs().max(1e-3);
            assert!((found - t).abs() <= 1e-12 / cos * t, "{found} m, facets {t} m");
            let outside = (d * found - centre).length() - radius;
            assert!((-sagitta..=1e-6).contains(&outside), "{outside} m off the ball");
        });
        assert!(hits > 200, "{hits}");
    }
}

/// Frames have the same bytes for any number of threads.
#[test]
fn frames_do_not_depend_on_threads() {
    let mut random = Rng::new(5);
    let places = (0..100).map(|_| (0, DAffine3::from_translation(random.point() * 4.0))).collect();
    let scene = placed(vec![sphere(0.8, DVec3::ZERO, 3)], places);
    let tracer = Tracer::build(&scene);
    for sensor in [lidar(NO_LIMITS), camera(NO_LIMITS)] {
        let frames = [1, 2, 3, 16].map(|threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| seen_from(&scene, &tracer, &sensor, &Pose::IDENTITY))
        });
        let ranges = |f: &Frame| {
            f.first_returns().map(|r| r.map(|r| (r.range_m.to_bits(), r.triangle))).collect::<Vec<_>>()
        };
        assert!(frames[0].return_count() > 1000);
        for frame in &frames[1..] {
            assert_eq!(ranges(frame), ranges(&frames[0]));
            assert_eq!(frame, &frames[0]);
        }
    }
}

/// A sensor that moves and turns while it scans casts each pulse from its pose at that time: at 15 m/s along its own x and
/// 0.5 rad/s, beside the plane y = 10. The body moves on a circle of radius v/ω = 30 m. A straight line instead would be
/// wrong by 9, 42 and 45 mm.
#[test]
fn each_pulse_of_a_moving_sensor_is_cast_from_its_own_pose() {
    let (speed, rate) = (15.0, 0.5);
    let wall = [(-1e3, -1e3), (1e3, -1e3), (1e3, 1e3), (-1e3, 1e3)].map(|(x, z)| DVec3::new(x, 10.0, z));
    let scene = alone(quad(wall));
    let rays = [(0.05, 90.0_f64), (0.1, 60.0), (0.1, 120.0)];
    let pulse = |(time_s, azimuth): (f64, f64)| {
        Pulse::new(DVec3::ZERO, direction(Angle::deg(azimuth), Angle::default()), time_s)
    };
    let pattern = Pattern::Rays(RayTable::new(rays.map(pulse).to_vec(), Some(10.0)).unwrap());
    let sensor = Sensor { pattern, range: NO_LIMITS, ring: RingOrder::Row, measurement: Default::default() };
    let trajectory = Trajectory::Twist {
        start: Pose::IDENTITY,
        linear_m_s: DVec3::new(speed, 0.0, 0.0),
        angular_rad_s: DVec3::new(0.0, 0.0, rate),
    };
    for number in [0, 3] {
        let capture = Capture::new(&sensor, Pose::IDENTITY, &trajectory, number, 0);
        let frame = scan(&scene, &Tracer::build(&scene), &capture, &Progress::default()).unwrap();
        let seen = SensorFrame { cloud_frame: CloudFrame::World, ..SensorFrame::new(capture, &frame, "") };
        for (column, (time_s, azimuth)) in rays.into_iter().enumerate() {
            let time = number as f64 / 10.0 + time_s;
            let (yaw, radius) = (rate * time, speed / rate);
            let (x, y) = (radius * libm::sin(yaw), radius * (1.0 - libm::cos(yaw)));
            let heading = azimuth.to_radians() + yaw;
            let range_m = (10.0 - y) / libm::sin(heading);
            let found = frame.get(0, column).unwrap();
            assert!(
                (found.range_m - range_m).abs() < 1e-9,
                "{number}, {column}: {} {range_m}",
                found.range_m
            );
            let point = seen.point(0, column, found.range_m).unwrap();
            let expected = DVec3::new(x + range_m * libm::cos(heading), 10.0, 0.0);
            assert!(point.abs_diff_eq(expected, 1e-9), "{point} {expected}");
            // The wall's normal is expressed in the sensor's frame at that time.
            let normal = DVec3::new(-libm::sin(yaw), -libm::cos(yaw), 0.0).as_vec3();
            assert!(glam::Vec3::from(found.normal).abs_diff_eq(normal, 1e-7));
        }
        if number == 0 {
            let ranges = [9.993748372, 11.194675745, 11.860784744];
            assert!(frame.iter().zip(ranges).all(|((_, one), range_m)| (one.range_m - range_m).abs() < 1e-9));
        }
    }
}
