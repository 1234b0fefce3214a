//! What is true of a sequence beside the ranges: poses, clouds without the sensor's motion, boxes, velocities and flow, each
//! against its closed form.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;
use std::sync::Arc;

use beamcast::angle::Angle;
use beamcast::frame::Pose;
use beamcast::motion::{Link, Motion, Trajectory, Velocity};
use beamcast::output::{Channels, CloudFrame, CloudTime, Format, Image, SensorFrame, pose_row};
use beamcast::scan::{self, Frame, Progress, scan};
use beamcast::scene::{Deformer, Material, Object, Scene, SceneBuilder, SourceInstance, SourceMesh};
use beamcast::sensor::{Beam, Camera, Capture, Pattern, RangeLimits, RingOrder, Rotating, Sensor};
use beamcast::trace::Tracer;
use beamcast::truth::{Choice, Targets, boxes, surface_motions};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use serde_json::Value;

use crate::shapes::{alone, cuboid, quad};

/// A LiDAR of 8 beams and 90 columns at 10 Hz, which sees 100 m far.
fn lidar() -> Sensor {
    let beam = |i: i32| Beam {
        elevation: Angle::deg(f64::from(i) * 3.0 - 10.0),
        azimuth_offset: Angle::deg(f64::from(i % 3) * 0.4),
        time_s: f64::from(i) * 1e-5,
        file_index: 0,
    };
    let turn = (Angle::deg(180.0), Angle::deg(-180.0));
    let pattern = Rotating::new((0..8).map(beam).collect(), 90, turn, 10.0).unwrap();
    Sensor {
        pattern: Pattern::Rotating(pattern),
        range: RangeLimits { max_m: 100.0, ..RangeLimits::default() },
        ring: RingOrder::Row,
        measurement: Default::default(),
    }
}

/// A body that drives at 15 m/s and turns at half a radian a second.
fn turning() -> Trajectory {
    let start =
        Pose::from_rpy(DVec3::new(1.5, -2.25, 0.5), Angle::deg(2.0), Angle::deg(-1.0), Angle::deg(30.0));
    Trajectory::Twist {
        start,
        linear_m_s: DVec3::new(15.0, 0.0, 0.0),
        angular_rad_s: DVec3::new(0.0, 0.0, 0.5),
    }
}

fn mount() -> Pose {
    Pose::from_rpy(DVec3::new(0.5, 0.25, 1.75), Angle::deg(0.5), Angle::deg(3.0), Angle::deg(-40.0))
}

/// The positions of a PLY's points, whose fields have 4 bytes each, and its header.
fn positions(ply: &[u8]) -> (Vec<DVec3>, String) {
    let end = ply.windows(11).position(|window| window == b"end_header\n").unwrap() + 11;
    let header = String::from_utf8(ply[..end].to_vec()).unwrap();
    let fields = header.lines().filter(|line| line.starts_with("property ")).count();
    let point = |bytes: &[u8]| {
        let number = |i: usize| f32::from_le_bytes(bytes[4 * i..4 * i + 4].try_into().unwrap());
        DVec3::new(number(0).into(), number(1).into(), number(2).into())
    };
    (ply[end..].chunks(4 * fields).map(point).collect(), header)
}

/// The pose in a PLY's header.
fn world_from_points(header: &str) -> Pose {
    let pose = header.lines().find_map(|line| line.strip_prefix("comment world_from_points = ")).unwrap();
    let table: toml::Table = format!("pose = {pose}").parse().unwrap();
    let numbers = |key: &str| -> Vec<f64> {
        table["pose"][key].as_array().unwrap().iter().map(|v| v.as_float().unwrap()).collect()
    };
    let quaternion = numbers("quaternion_xyzw").try_into().unwrap();
    Pose::from_quaternion(DVec3::from_slice(&numbers("position_m")), quaternion).unwrap()
}

/// A wall that is scanned while the sensor drives and turns is a plane in every cloud whose motion is compensated, in the pose that
/// its header has; in a raw cloud it is bent.
#[test]
fn a_wall_is_a_plane_where_the_sensors_motion_is_compensated() {
    // The wall's corners are exact in f32.
    let wall = [(-256.0, -16.0), (256.0, -16.0), (256.0, 16.0), (-256.0, 16.0)];
    let scene = alone(quad(wall.map(|(x, z)| DVec3::new(x, 10.0, z))));
    let (sensor, trajectory) = (lidar(), turning());
    let capture = Capture::new(&sensor, mount(), &trajectory, 3, 0);
    let frame = scan(&scene, &Tracer::build(&scene), &capture, &Progress::default()).unwrap();
    let returns = frame.return_count();
    assert!(returns > 100, "{returns}");
    let raw = SensorFrame::new(capture, &frame, "top");
    // Each coordinate is rounded to f32 once, by at most half an ulp of 128 m, and the pose in the header to the last digit of f64.
    let tolerance = 3_f64.sqrt() * f64::from(f32::EPSILON) * 64.0 / 2.0 + 1e-12;
    for cloud_frame in [CloudFrame::Sensor, CloudFrame::Body] {
        for (cloud_time, moment_s) in
            [(CloudTime::Start, 0.0), (CloudTime::Middle, 0.05), (CloudTime::End, 0.1)]
        {
            let seen = SensorFrame { cloud_frame, cloud_time, ..raw };
            let (points, header) = positions(&Format::PLY.encode(&seen).unwrap());
            let pose = world_from_points(&header);
            let expected = trajectory.pose_at(0.3 + moment_s);
            let expected = if cloud_frame == CloudFrame::Body { expected } else { expected * mount() };
            assert!(pose.translation.abs_diff_eq(expected.translation, 1e-12), "{cloud_time:?}");
            let whose = if cloud_frame == CloudFrame::Body { "body" } else { "sensor" };
            let said = format!("comment cloud_time: {}, the {whose}'s motion", cloud_time.name());
            assert!(header.contains(&said), "{header}");
            assert_eq!(points.len(), returns);
            for point in points {
                let off = pose.point(point).y - 10.0;
                assert!(off.abs() <= tolerance, "{cloud_frame:?} {cloud_time:?}: {off:e} m off");
            }
            let pcd = Format::named("pcd").unwrap().encode(&seen).unwrap();
            let said = format!("# cloud_time: {},", cloud_time.name());
            assert!(pcd.windows(said.len()).any(|window| window == said.as_bytes()));
        }
        let (points, header) = positions(&Format::PLY.encode(&SensorFrame { cloud_frame, ..raw }).unwrap());
        let pose = world_from_points(&header);
        let farthest = points.iter().map(|point| (pose.point(*point).y - 10.0).abs()).fold(0.0, f64::max);
        assert!(farthest > 0.1 && !header.contains("cloud_time"), "{farthest}");
    }
    // In the world each point is at its own time, whatever is asked.
    let world = |cloud_time| {
        let seen = SensorFrame { cloud_frame: CloudFrame::World, cloud_time, ..raw };
        Format::PLY.encode(&seen).unwrap()
    };
    assert!(world(CloudTime::Raw) == world(CloudTime::End));
    assert!(positions(&world(CloudTime::Raw)).0.iter().all(|p| (p.y - 10.0).abs() <= tolerance));
}

/// Nothing is to be compensated where the sensor stands still during the frame, so the bytes are those of the raw cloud.
#[test]
fn a_sensor_that_stands_still_has_the_same_cloud_at_all_times() {
    let corners = [(-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)];
    let scene = alone(quad(corners.map(|(y, z)| DVec3::new(7.0, y, z))));
    let (sensor, fixed, moving) = (lidar(), Trajectory::Fixed(mount()), turning());
    for capture in [
        Capture::new(&sensor, mount(), &fixed, 2, 0),
        Capture::new(&sensor, mount(), &moving, 0, 0).in_sequence(0.0, true),
    ] {
        let frame = scan(&scene, &Tracer::build(&scene), &capture, &Progress::default()).unwrap();
        assert!(frame.return_count() > 10);
        let raw = SensorFrame::new(capture, &frame, "top");
        for (_, cloud_time) in CloudTime::NAMED {
            let seen = SensorFrame { cloud_time, ..raw };
            assert!(Format::PLY.encode(&seen).unwrap() == Format::PLY.encode(&raw).unwrap());
        }
    }
}

/// The numbers of a row of CSV, from the field `first` on.
fn numbers(row: &str, first: usize) -> Vec<f64> {
    row.split(',').skip(first).map(|field| field.parse().unwrap()).collect()
}

fn as_numbers(pose: &Pose) -> Vec<f64> {
    pose.translation.to_array().into_iter().chain(DQuat::from_mat3(&pose.rotation).to_array()).collect()
}

/// Every digit of a pose is written: reading the text gives the same bits.
#[test]
fn poses_are_read_back_bit_for_bit() {
    let (sensor, trajectory) = (lidar(), turning());
    let frame = Frame::default();
    for number in [0, 1, 7, 123_456] {
        let capture = Capture::new(&sensor, mount(), &trajectory, number, 0).in_sequence(0.125, false);
        let row = pose_row(&SensorFrame::new(capture, &frame, "top"));
        assert!(row.starts_with(&format!("{number},top,")), "{row}");
        let start_s = 0.125 + number as f64 / 10.0;
        let body = trajectory.pose_at(start_s);
        let sensor = capture.world_from_sensor(0.0);
        let expected = [vec![start_s], as_numbers(&sensor), as_numbers(&body)].concat();
        assert_eq!(numbers(&row, 2), expected);
        assert_eq!(row.split(',').count(), beamcast::output::POSES.1.split(',').count());
        // The quaternion is the rotation's own.
        let [x, y, z, w]: [f64; 4] = numbers(&row, 6)[..4].try_into().unwrap();
        let rotation = DMat3::from_quat(DQuat::from_xyzw(x, y, z, w));
        let off = rotation - sensor.rotation;
        assert!(off.to_cols_array().iter().all(|e| e.abs() < 1e-15), "{off:?}");
    }
}

/// A LiDAR has a pose for each column, at the time of the column's first pulse, and a camera one for each row.
#[test]
fn a_frame_has_a_pose_for_each_column() {
    let (sensor, trajectory) = (lidar(), turning());
    let frame = Frame::default();
    let poses = Format::named("poses").unwrap();
    let capture = Capture::new(&sensor, mount(), &trajectory, 5, 0);
    let text = String::from_utf8(poses.encode(&SensorFrame::new(capture, &frame, "top")).unwrap()).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!((lines.len(), lines[0]), (91, "line,t_s,x_m,y_m,z_m,qx,qy,qz,qw"));
    for (column, line) in lines[1..].iter().enumerate() {
        // All columns of a turn of 90 take a ninetieth of a tenth of a second, and the lowest beam fires first.
        let time_s = capture.time_s(7, column).unwrap();
        assert!((time_s - column as f64 / 900.0).abs() < 1e-15, "{time_s}");
        let expected = as_numbers(&capture.world_from_sensor(time_s));
        assert_eq!(numbers(line, 0), [vec![column as f64, capture.cast_at_s(time_s)], expected].concat());
    }
    let camera = Camera::from_hfov((6, 4), Angle::deg(60.0), Some(20.0)).unwrap();
    let camera = Sensor::new(Pattern::Camera(camera));
    let capture = Capture::new(&camera, mount(), &trajectory, 2, 0);
    let text = String::from_utf8(poses.encode(&SensorFrame::new(capture, &frame, "front")).unwrap()).unwrap();
    assert_eq!(text.lines().count(), 1 + 4);
    assert_eq!(numbers(text.lines().nth(3).unwrap(), 1)[0], 0.1);
}

/// An object of a scene: a mesh, where it is, and its motion if it moves.
struct Thing {
    mesh: SourceMesh,
    motion: Option<Motion>,
    label: Option<u32>,
}

/// Objects named `0`, `1` and so on. What moves has a mesh and a motion of its own.
fn scene_of(things: Vec<Thing>) -> Scene {
    let mut builder = SceneBuilder { materials: vec![Material::default()], ..SceneBuilder::default() };
    for (mesh, thing) in things.into_iter().enumerate() {
        let object = Object { name: mesh.to_string(), file_label: thing.label, ..Object::default() };
        builder.meshes.push(thing.mesh);
        let world_from_mesh = thing.motion.as_ref().map_or(DAffine3::IDENTITY, |motion| motion.map_at(0.0));
        let motion = thing.motion.map(Arc::new);
        builder.instances.push(SourceInstance {
            mesh,
            world_from_mesh,
            object,
            motion,
            ..SourceInstance::default()
        });
    }
    builder.build().unwrap()
}

fn rigid(trajectory: Trajectory) -> Option<Motion> {
    Some(Motion { links: vec![Link::Rigid(trajectory)] })
}

fn cast(scene: &Scene, capture: &Capture) -> Frame {
    let scene = scene.during(capture.window(), None);
    scan(&scene, &Tracer::build(&scene), capture, &Progress::default()).unwrap()
}

/// The returns of each track were it alone.
fn alone_by_track(scene: &Scene, targets: &Targets, capture: &Capture) -> BTreeMap<u32, u64> {
    let only = scene.only(|object| targets.track_of(object).is_some()).during(capture.window(), None);
    let track_of = |object| targets.track_of(object);
    scan::alone(&only, &Tracer::build(&only), capture, &track_of, &Progress::default()).unwrap()
}

/// A car that crosses at 12 m/s while it turns: its box is that of its mesh, at the mean time of its own hits, and its velocities are
/// those of the screw motion.
#[test]
fn a_crossing_box_is_where_it_was_hit_and_as_large_and_as_fast_as_it_is() {
    let start =
        Pose::from_rpy(DVec3::new(9.0, -6.0, 0.25), Angle::default(), Angle::default(), Angle::deg(70.0));
    let (linear, angular) = (DVec3::new(12.0, 0.0, 0.5), DVec3::new(0.0, 0.0, 0.4));
    let drive = Trajectory::Twist { start, linear_m_s: linear, angular_rad_s: angular };
    // The mesh is not centred on the car's origin, and 0.7 is no number of 32 bits.
    let (low, high) = ([-1.0, -0.7, 0.0], [3.25, 1.1, 1.5]);
    let car = Thing { mesh: cuboid(low, high), motion: rigid(drive.clone()), label: Some(4) };
    let ground = [(-64.0, -64.0), (64.0, -64.0), (64.0, 64.0), (-64.0, 64.0)];
    let ground = Thing { mesh: quad(ground.map(|(x, y)| DVec3::new(x, y, -1.0))), motion: None, label: None };
    let scene = scene_of(vec![ground, car]);
    let (sensor, trajectory) = (lidar(), turning());
    let targets = Targets::of(&scene, Choice::Tracked);
    for number in [0, 2, 4] {
        let capture = Capture::new(&sensor, mount(), &trajectory, number, 0);
        let frame = cast(&scene, &capture);
        let found = boxes(&scene, &targets, &capture, &frame, &alone_by_track(&scene, &targets, &capture));
        let [found] = &found[..] else { panic!("{number}: {} boxes", found.len()) };
        let times: Vec<f64> = frame
            .iter()
            .filter(|(_, one)| one.instance == 1)
            .map(|(pixel, _)| capture.time_s(pixel / frame.columns(), pixel % frame.columns()).unwrap())
            .collect();
        assert!(times.len() > 3, "{number}: {} points", times.len());
        let time_s = number as f64 / 10.0 + times.iter().sum::<f64>() / times.len() as f64;
        assert!((found.time_s - time_s).abs() < 1e-14, "{number}");
        assert_eq!((found.points, found.target.track, found.target.label), (times.len() as u64, 1, 4));
        assert_eq!(found.target.name, "1");

        let pose = drive.pose_at(time_s);
        let [low, high] = [low, high].map(|corner| DVec3::from_array(corner.map(f64::from)));
        let size = high - low;
        assert!(((found.oriented.size_m - size) / size).abs().max_element() < 1e-12, "{:?}", found.oriented);
        let centre = pose.point((low + high) / 2.0);
        assert!(found.oriented.world_from_box.translation.abs_diff_eq(centre, 1e-12));
        let off = found.oriented.world_from_box.rotation - pose.rotation;
        assert!(off.to_cols_array().iter().all(|e| e.abs() < 1e-14));
        // v + ω × r, all along the world's axes.
        let spin = pose.direction(angular);
        let velocity = pose.direction(linear) + spin.cross(centre - pose.translation);
        assert!(found.velocity.linear_m_s.abs_diff_eq(velocity, 1e-12), "{:?}", found.velocity);
        assert!(found.velocity.angular_rad_s.abs_diff_eq(spin, 1e-14));
        assert_eq!(found.world_from_sensor, capture.world_from_sensor(time_s - number as f64 / 10.0));
        assert!(found.shown.is_none() && found.projected_px.is_none());
    }
}

/// Every point of a surface has the velocity of its motion, and its flow ends where the motion takes it at the frame's end: v·Δt of a
/// translation, and an arc about the axis of a rotation. The ground, over which the sensor itself moves, has none.
#[test]
fn flow_ends_where_the_motion_takes_the_point() {
    let at = |x: f64, y: f64| Pose { translation: DVec3::new(x, y, 0.0), ..Pose::IDENTITY };
    let (speed, spin) = (DVec3::new(3.0, -4.0, 0.5), DVec3::new(0.0, 0.0, 2.0));
    let still = DVec3::ZERO;
    let slides = Trajectory::Twist { start: at(8.0, 4.0), linear_m_s: speed, angular_rad_s: still };
    let turns = Trajectory::Twist { start: at(9.0, -5.0), linear_m_s: still, angular_rad_s: spin };
    let thing = |trajectory: Option<&Trajectory>, mesh| Thing {
        mesh,
        motion: trajectory.and_then(|trajectory| rigid(trajectory.clone())),
        label: None,
    };
    let ground = [(-64.0, -64.0), (64.0, -64.0), (64.0, 64.0), (-64.0, 64.0)];
    let ground = thing(None, quad(ground.map(|(x, y)| DVec3::new(x, y, -1.0))));
    let block = || cuboid([-2.0, -1.0, -1.0], [2.0, 1.0, 2.0]);
    let scene = scene_of(vec![ground, thing(Some(&slides), block()), thing(Some(&turns), block())]);
    let (sensor, trajectory) = (lidar(), turning());
    let capture = Capture::new(&sensor, mount(), &trajectory, 1, 0);
    let arranged = scene.during(capture.window(), None);
    let frame = scan(&arranged, &Tracer::build(&arranged), &capture, &Progress::default()).unwrap();
    let motions = surface_motions(&arranged, &capture, &frame);
    let mut counts = [0; 3];
    for pixel in 0..frame.pixels() {
        let Some(slot) = frame.slot(pixel, 0) else { continue };
        let (row, column) = (pixel / frame.columns(), pixel % frame.columns());
        let pulse = capture.pulse(row, column).unwrap();
        let one = frame.returns().get(slot);
        let point = capture.world_from_sensor(pulse.time_s).point(pulse.point(one.range_m));
        let left_s = 0.1 - pulse.time_s;
        let (velocity, flow) = match one.instance {
            0 => (DVec3::ZERO, DVec3::ZERO),
            1 => (speed, speed * left_s),
            _ => {
                let arm = point - DVec3::new(9.0, -5.0, 0.0);
                let (sin, cos) = libm::sincos(spin.z * left_s);
                let turned = DVec3::new(cos * arm.x - sin * arm.y, sin * arm.x + cos * arm.y, arm.z);
                (spin.cross(arm), turned - arm)
            }
        };
        let found = motions[slot];
        // Carrying a point of some metres to the mesh and back costs a few 2⁻⁵³ of its coordinates.
        assert!(found.velocity_m_s.abs_diff_eq(velocity, 1e-12), "{found:?} {velocity}");
        assert!(found.flow_m.abs_diff_eq(flow, 1e-12), "{found:?} {flow}");
        counts[one.instance as usize] += 1;
    }
    assert!(counts.iter().all(|count| *count > 5), "{counts:?}");

    // Channels have them along the sensor's axes at the pulse's time, and clouds along their own.
    let named = ["flow.X", "flow.Y", "flow.Z", "velocity.X", "velocity.Y", "velocity.Z", "id.track"];
    let targets = Targets::of(&scene, Choice::Tracked);
    let seen = SensorFrame {
        motions: &motions,
        targets: Some(&targets),
        ..SensorFrame::new(capture, &frame, "top")
    };
    let image = Image::with_channels(&seen, 0, Channels::named(named).iter());
    assert_eq!(image.channels.len(), named.len());
    let cloud = SensorFrame { cloud_frame: CloudFrame::World, ..seen };
    let ply = Format::named("ply").unwrap();
    let motion = ply.spec.options.iter().find(|option| option.name == "motion").unwrap();
    let ply = ply.with(motion, 1.0).encode(&cloud).unwrap();
    let end = ply.windows(11).position(|window| window == b"end_header\n").unwrap() + 11;
    let header = String::from_utf8_lossy(&ply[..end]).into_owned();
    let fields: Vec<&str> = header.lines().filter_map(|line| line.strip_prefix("property ")).collect();
    assert_eq!(fields[10..13], ["int track", "float velocity_x", "float velocity_y"]);
    let mut points = ply[end..].chunks(4 * fields.len());
    for pixel in 0..frame.pixels() {
        let Some(slot) = frame.slot(pixel, 0) else { continue };
        let (row, column) = (pixel / frame.columns(), pixel % frame.columns());
        let sensor_from_world =
            capture.world_from_sensor(capture.time_s(row, column).unwrap()).rotation.transpose();
        let channel = |name: &str| f64::from(image.f32(name).unwrap()[pixel]);
        let [flow, velocity] = ["flow", "velocity"].map(|of| {
            DVec3::new(channel(&format!("{of}.X")), channel(&format!("{of}.Y")), channel(&format!("{of}.Z")))
        });
        assert!(flow.abs_diff_eq(sensor_from_world * motions[slot].flow_m, 1e-6));
        assert!(velocity.abs_diff_eq(sensor_from_world * motions[slot].velocity_m_s, 1e-6));
        let track = frame.returns().instance[slot]; // the ground has none, and the others follow each other
        assert_eq!(image.u32("id.track").unwrap()[pixel], track);
        let point = points.next().unwrap();
        let float = |i: usize| f64::from(f32::from_le_bytes(point[4 * i..4 * i + 4].try_into().unwrap()));
        assert_eq!(point[40..44], track.to_le_bytes());
        assert!(DVec3::new(float(11), float(12), float(13)).abs_diff_eq(motions[slot].velocity_m_s, 1e-6));
        assert!(DVec3::new(float(14), float(15), float(16)).abs_diff_eq(motions[slot].flow_m, 1e-6));
    }
}

/// The occlusion of a box is the share of its pixels that it would have alone and that something else takes, counted by casting a
/// scene of the box alone; and one that is hidden entirely has a box, too.
#[test]
fn occlusion_is_the_counted_share() {
    let passes = Trajectory::Twist {
        start: Pose { translation: DVec3::new(12.0, -2.5, 0.0), ..Pose::IDENTITY },
        linear_m_s: DVec3::new(0.0, 5.0, 0.0),
        angular_rad_s: DVec3::ZERO,
    };
    let behind = Trajectory::Fixed(Pose { translation: DVec3::new(16.0, 0.0, 0.0), ..Pose::IDENTITY });
    let block = || cuboid([-1.0, -1.0, -1.0], [1.0, 1.0, 1.0]);
    let near = || Thing { mesh: block(), motion: rigid(passes.clone()), label: None };
    let hidden = || Thing {
        mesh: cuboid([-0.5, -0.5, -0.5], [0.5, 0.5, 0.5]),
        motion: rigid(behind.clone()),
        label: None,
    };
    // A screen that hides the left half of the near block's way, and all of what stands behind.
    let screen = [(-1.0, -8.0), (4.0, -8.0), (4.0, 8.0), (-1.0, 8.0)];
    let screen =
        || Thing { mesh: quad(screen.map(|(y, z)| DVec3::new(6.0, y, z))), motion: None, label: None };
    let camera = Camera::from_hfov((80, 60), Angle::deg(70.0), Some(10.0)).unwrap();
    let camera = Sensor::new(Pattern::Camera(camera));
    let fixed = Trajectory::Fixed(Pose::IDENTITY);
    let mut partly = 0;
    for sensor in [&lidar(), &camera] {
        for number in 0..4 {
            let capture = Capture::new(sensor, Pose::IDENTITY, &fixed, number, 0);
            let scene = scene_of(vec![screen(), near(), hidden()]);
            let frame = cast(&scene, &capture);
            let targets = Targets::of(&scene, Choice::Tracked);
            let alone = alone_by_track(&scene, &targets, &capture);
            let found = boxes(&scene, &targets, &capture, &frame, &alone);
            for (object, thing) in [(1, near()), (2, hidden())] {
                let of_object = frame.iter().filter(|(_, one)| one.instance == object).count() as u64;
                let of_thing = cast(&scene_of(vec![thing]), &capture).return_count() as u64;
                assert_eq!(
                    alone.get(&object).copied().unwrap_or(0),
                    of_thing,
                    "frame {number}, object {object}"
                );
                let found = found.iter().find(|found| found.target.track == object);
                assert_eq!(found.is_some(), of_thing > 0);
                let Some(found) = found else { continue };
                assert_eq!((found.pixels, found.pixels_alone), (of_object, of_thing));
                assert_eq!(found.occlusion(), 1.0 - of_object as f64 / of_thing as f64);
                partly += usize::from(found.occlusion() > 0.1 && found.occlusion() < 0.9);
                if of_object == 0 {
                    let middle_s = number as f64 / 10.0 + 0.5 * 0.1;
                    assert_eq!((found.occlusion(), found.time_s), (1.0, middle_s));
                }
            }
        }
    }
    assert!(partly >= 4, "{partly}");
}

/// A box whose middle plane is the side of a camera's field of view lies half outside of it, and its bounds and its mask are those of its
/// pixels.
#[test]
fn a_box_at_the_images_edge_is_half_outside() {
    let camera = Camera::from_hfov((80, 60), Angle::deg(90.0), Some(10.0)).unwrap();
    let sensor = Sensor::new(Pattern::Camera(camera));
    let fixed = Trajectory::Fixed(Pose::IDENTITY);
    let capture = Capture::new(&sensor, Pose::IDENTITY, &fixed, 0, 0);
    let placed = |x: f64, y: f64, yaw: f64| {
        let pose = Pose::from_rpy(DVec3::new(x, y, 0.0), Angle::default(), Angle::default(), Angle::deg(yaw));
        Thing {
            mesh: cuboid([-1.0, -0.75, -0.5], [1.0, 0.75, 0.5]),
            motion: rigid(Trajectory::Fixed(pose)),
            label: None,
        }
    };
    let scene = scene_of(vec![placed(7.0, 7.0, 45.0), placed(9.0, -1.0, 20.0), placed(-5.0, 0.0, 0.0)]);
    let frame = cast(&scene, &capture);
    let targets = Targets::of(&scene, Choice::Tracked);
    let found = boxes(&scene, &targets, &capture, &frame, &alone_by_track(&scene, &targets, &capture));
    // What stands behind the camera gives no return, and has no line.
    assert_eq!(found.iter().map(|found| found.target.track).collect::<Vec<_>>(), [1, 2]);
    assert!((found[0].truncation - 0.5).abs() < 1e-12, "{}", found[0].truncation);
    assert_eq!(found[1].truncation, 0.0);
    for found in &found {
        let shown = found.shown.as_ref().unwrap();
        let pixels: Vec<bool> = (0..80)
            .flat_map(|column| (0..60).map(move |row| (row, column)))
            .map(|(row, column)| {
                frame.get(row, column).is_some_and(|one| one.instance + 1 == found.target.track)
            })
            .collect();
        let runs = shown.runs.iter().enumerate();
        let again: Vec<bool> =
            runs.flat_map(|(index, run)| std::iter::repeat_n(index % 2 == 1, *run as usize)).collect();
        assert!(again == pixels && pixels.contains(&true));
        let among = |pick: fn(usize) -> usize| {
            let picked = (0..pixels.len()).filter(|&i| pixels[i]).map(pick);
            [picked.clone().min().unwrap() as f64, picked.max().unwrap() as f64 + 1.0]
        };
        let ([left, right], [top, bottom]) = (among(|i| i / 60), among(|i| i % 60));
        assert_eq!(shown.bounds_px, Some([left, top, right, bottom]));
        // The projection has all pixels' centres in it, and reaches less than a pixel beyond them where nothing is cut off.
        let [l, t, r, b] = found.projected_px.unwrap();
        assert!(l <= left + 0.5 && t <= top + 0.5 && r >= right - 0.5 && b >= bottom - 0.5, "{found:?}");
        assert!(l >= left - 1.5 && t >= top - 1.5 && r <= right + 1.5 && b <= bottom + 1.5, "{found:?}");
    }
    assert_eq!(found[0].projected_px.unwrap()[0], 0.0, "cut off at the left edge");
}

/// What stands still has an upright box of the least footprint, if it is asked for; and what moves keeps its track.
#[test]
fn still_objects_have_boxes_if_they_are_asked_for() {
    let yaw =
        Pose::from_rpy(DVec3::new(9.0, 1.0, 0.0), Angle::default(), Angle::default(), Angle::deg(120.0));
    let mut shelf = cuboid([-2.0, -0.5, -1.0], [2.0, 0.5, 1.0]);
    for position in &mut shelf.positions {
        *position = yaw.point(DVec3::from_array(position.map(f64::from))).as_vec3().to_array();
    }
    let wall = [(-9.0, -9.0), (9.0, -9.0), (9.0, 9.0), (-9.0, 9.0)];
    let wall = quad(wall.map(|(y, z)| DVec3::new(20.0, y, z)));
    let cart = Trajectory::Fixed(Pose { translation: DVec3::new(6.0, -4.0, 0.0), ..Pose::IDENTITY });
    let scene = scene_of(vec![
        Thing { mesh: wall, motion: None, label: None },
        Thing { mesh: shelf, motion: None, label: Some(7) },
        Thing { mesh: cuboid([-0.5; 3], [0.5; 3]), motion: rigid(cart), label: None },
    ]);
    let tracks = |choice| {
        let targets = Targets::of(&scene, choice);
        targets.iter().map(|target| (target.track, target.name.clone())).collect::<Vec<_>>()
    };
    let named = |names: &[&str]| {
        (1..).zip(names.iter().map(|name| (*name).to_owned())).collect::<Vec<(u32, String)>>()
    };
    assert_eq!(tracks(Choice::Tracked), named(&["2"]));
    assert_eq!(tracks(Choice::Labelled), named(&["2", "1"]));
    assert_eq!(tracks(Choice::All), named(&["2", "0", "1"]));
    let targets = Targets::of(&scene, Choice::Labelled);
    let (found, velocity) = targets.iter().nth(1).unwrap().at(&scene, 3.0).unwrap();
    // The corners are rounded to f32 about the scene's centre, by at most half an ulp of 16 m.
    assert!(found.size_m.abs_diff_eq(DVec3::new(4.0, 1.0, 2.0), 4e-6), "{found:?}");
    assert!(found.world_from_box.translation.abs_diff_eq(yaw.translation, 2e-6));
    // 120° is 60° the other way round.
    let x = found.world_from_box.rotation.x_axis;
    assert!((libm::atan2(x.y, x.x).to_degrees() + 60.0).abs() < 1e-3 && velocity == Velocity::default());
}

/// A run writes the tables that its job asks for, the manifest lists them, and docs/ground-truth.md has every key of theirs and no other.
#[test]
fn tables_are_written_and_their_page_has_every_key() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folder = tempfile::tempdir().unwrap();
    let job = format!(
        "scene = '{}'\n\
         [labels]\npillar = 77\n\
         [sequence]\nstart_s = 0.25\n\
         [[sensor]]\nname = \"top\"\npose = {{ position_m = [0.0, 0.0, 1.2] }}\n\
         [sensor.rotating]\nelevations_deg = [2.0, -10.0]\ncolumns = 180\nrate_hz = 10.0\n\
         [[sensor]]\nname = \"front\"\npose = {{ position_m = [0.0, 0.0, 1.2] }}\n\
         [sensor.pinhole]\nwidth_px = 64\nheight_px = 48\nhfov_deg = 120.0\n\
         [truth]\nboxes = \"all\"\nmasks = true\nvisible = true\n\
         [output]\ndir = \"out\"\nformats = [\"poses\", {{ format = \"ply\", motion = true }}]\n",
        root.join("scenes/room.glb").display()
    );
    fs::write(folder.path().join("job.toml"), job).unwrap();
    let run = |args: &[&str]| {
        let output = super::cli::program().args(args).current_dir(folder.path()).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    };
    run(&["scan", "job.toml"]);
    let read = |name: &str| fs::read_to_string(folder.path().join("out").join(name)).unwrap();
    let manifest: Value = serde_json::from_str(&read("manifest.json")).unwrap();
    let listed: BTreeSet<&str> =
        manifest["outputs"].as_array().unwrap().iter().map(|file| file["path"].as_str().unwrap()).collect();
    for name in ["poses.csv", "boxes.jsonl", "visible.jsonl", "top/000000.poses.csv", "front/000000.ply"] {
        assert!(listed.contains(name), "{name} is not among {listed:?}");
    }
    let poses: Vec<String> = read("poses.csv").lines().map(str::to_owned).collect();
    assert_eq!(
        poses[1..].iter().map(|row| row.split(',').nth(1).unwrap()).collect::<Vec<_>>(),
        ["top", "front"]
    );
    assert!(poses[1].starts_with("0,top,0.25,0.0,0.0,1.2,"), "{}", poses[1]);

    let parsed = |name: &str| -> Vec<Value> {
        read(name).lines().map(|line| serde_json::from_str(line).unwrap()).collect()
    };
    let (boxes, visible) = (parsed("boxes.jsonl"), parsed("visible.jsonl"));
    let pillar = boxes.iter().find(|one| one["label"] == 77 && one["sensor"] == "top").unwrap();
    assert!(pillar["points"].as_u64() > Some(0) && pillar["height_m"].as_f64() > Some(0.5), "{pillar}");
    // What is seen and what has a box agree about the points.
    for frame in &visible {
        let points = |rows: &mut dyn Iterator<Item = &Value>| -> u64 {
            rows.map(|row| row["points"].as_u64().unwrap()).sum()
        };
        let of_boxes = points(&mut boxes.iter().filter(|one| one["sensor"] == frame["sensor"]));
        let of_objects = points(&mut frame["objects"].as_array().unwrap().iter());
        assert!(of_boxes == of_objects && of_boxes > 0, "{frame}");
    }

    let page = fs::read_to_string(root.join("docs/ground-truth.md")).unwrap();
    for (heading, rows) in [("Boxes", &boxes), ("What is seen", &visible)] {
        let section = page.split("\n## ").find(|section| section.starts_with(heading)).unwrap();
        let told: BTreeSet<String> = section
            .lines()
            .filter_map(|line| line.strip_prefix("| `")?.split_once('`').map(|(key, _)| key.to_owned()))
            .collect();
        let mut found = BTreeSet::new();
        rows.iter().for_each(|row| super::json::add_keys(row, "", &mut found));
        // Bounds are null where there are none.
        let found: BTreeSet<String> =
            found.into_iter().filter(|key| !["bounds_px", "projected_px"].contains(&key.as_str())).collect();
        assert_eq!(told, found, "{heading}");
    }

    // What changes nothing is told.
    for (pair, told) in [
        ("sequence={ motion = \"frozen\", cloud_time = \"end\" }", "nothing moves during a frozen frame"),
        ("output.frame=world", "points in the world are at their own time"),
        ("truth.boxes=none", "no boxes are asked for"),
    ] {
        let set = ["--set", "sequence.cloud_time=middle", "--set", pair];
        let args = [&["scan", "job.toml", "--overwrite", "--dry-run"], &set[..]].concat();
        let output = super::cli::program().args(args).current_dir(folder.path()).output().unwrap();
        let text = String::from_utf8_lossy(&output.stdout) + String::from_utf8_lossy(&output.stderr);
        assert!(text.contains(told), "{pair}: {text}");
    }

    // Without asking there are none of them, and those of the earlier run are removed.
    let off = ["truth.poses=false", "truth.boxes=none", "truth.visible=false", "output.formats=[\"poses\"]"];
    let off: Vec<&str> = off.into_iter().flat_map(|pair| ["--set", pair]).collect();
    run(&[&["scan", "job.toml", "--overwrite"], &off[..]].concat());
    assert!(
        ["poses.csv", "boxes.jsonl", "visible.jsonl"].iter().all(|name| !folder
            .path()
            .join("out")
            .join(name)
            .exists())
    );
}

/// A mesh that bends is cast with the shape of the middle of its slice, and its points move on from there with their triangles.
#[test]
fn points_of_a_mesh_that_bends_keep_to_their_triangles() {
    // A wall 6 m ahead, whose upper edge leans forward by 0.5 m a second.
    let shape = |time_s: f64| {
        let lean = (0.5 * time_s) as f32;
        vec![[6.0, -4.0, -2.0], [6.0, 4.0, -2.0], [6.0 + lean, 4.0, 2.0], [6.0 + lean, -4.0, 2.0]]
    };
    let mesh = SourceMesh { positions: shape(0.0), ..quad([DVec3::ZERO, DVec3::X, DVec3::ONE, DVec3::Y]) };
    let deformer = Some(Arc::new(Deformer::new(move |time_s| Some(shape(time_s)))));
    let instance = SourceInstance { deformer, ..SourceInstance::default() };
    let materials = vec![Material::default()];
    let builder =
        SceneBuilder { meshes: vec![mesh], instances: vec![instance], materials, ..SceneBuilder::default() };
    let (sensor, fixed) = (lidar(), Trajectory::Fixed(Pose::IDENTITY));
    let capture = Capture::new(&sensor, Pose::IDENTITY, &fixed, 2, 0);
    let scene = builder.build().unwrap().during(capture.window(), None);
    let frame = scan(&scene, &Tracer::build(&scene), &capture, &Progress::default()).unwrap();
    let motions = surface_motions(&scene, &capture, &frame);
    assert!(frame.return_count() > 20, "{}", frame.return_count());
    let window = capture.window();
    let left_s = 0.3 - (window.from_s + window.to_s) / 2.0;
    for pixel in 0..frame.pixels() {
        let Some(slot) = frame.slot(pixel, 0) else { continue };
        let pulse = capture.pulse(pixel / 90, pixel % 90).unwrap();
        let height = pulse.point(frame.returns().range_m[slot]).z;
        // The lean grows from 0 at the lower edge to all of it at the upper one, 4 m above.
        let velocity = DVec3::X * 0.5 * (height + 2.0) / 4.0;
        let found = motions[slot];
        // A corner's x is rounded to f32, by at most 2.4e-7 m; over the millisecond of the measurement that is 4.8e-4 m/s.
        assert!(found.velocity_m_s.abs_diff_eq(velocity, 5e-4), "{found:?} {velocity}");
        assert!(found.flow_m.abs_diff_eq(velocity * left_s, 1e-6), "{found:?}");
    }
}
