//! Cameras besides the pinhole, each against its closed form.

use std::io::Cursor;
use std::sync::Arc;

use beamcast::error::Error;
use beamcast::frame::{BODY_FROM_OPTICAL, Pose};
use beamcast::motion::{Blending, Clock, Link, Motion, Track, Trajectory};
use beamcast::output::{Channels, Format, SensorFrame};
use beamcast::physics::phasor::{Phasor, range_m};
use beamcast::scan::{Frame, Progress, scan};
use beamcast::scene::{Corners, Material, Scene, SceneBuilder, SourceInstance};
use beamcast::sensor::facts::SensorFacts;
use beamcast::sensor::{
    Camera, Capture, DepthSensing, Measurement, Orthographic, Pattern, RowOrder, Sensor, Shutter,
    TimeOfFlight,
};
use beamcast::trace::Tracer;
use beamcast::truth::surface_colors;
use glam::{DAffine3, DVec3};

use crate::plates::{Plate, lambert, optics, scene, wall};
use crate::shapes::{cuboid, placed, quad, seen_from};

use super::depth_cameras::time_of_flight;

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
    let (sensor, tracer) = (parallel(), Tracer::build(&scene));
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

/// A camera of one pixel, as narrow as a ray, that gathers light for a while about each tenth of a second.
fn exposed(mhz: f64, exposure_s: f64) -> Sensor {
    let sensing = TimeOfFlight { electrons_at_1_m: 1e16, samples: 2, exposure_s, ..time_of_flight(&[mhz]) };
    let camera = Camera::new((1, 1), (1e6, 1e6), (0.5, 0.5), Some(10.0)).unwrap();
    let measurement =
        Measurement { depth: Some(DepthSensing::TimeOfFlight(sensing)), ..Measurement::default() };
    Sensor { measurement, ..Sensor::new(Pattern::Camera(camera)) }
}

/// The second frame, which is exposed about 0.1 s, of a sensor on a body.
fn second_frame(scene: &Scene, sensor: &Sensor, trajectory: &Trajectory) -> Frame {
    let capture = Capture::new(sensor, Pose::IDENTITY, trajectory, 1, 7);
    let scene = scene.during(capture.window(), None);
    scan(&scene, &Tracer::build(&scene), &capture, &Progress::default()).unwrap()
}

/// The range of light that comes back from surfaces at these distances for equal parts of the time.
fn mean_of_paths(distances_m: &[f64], mhz: f64) -> f64 {
    let of = |&m: &f64| Phasor::of_path(1.0 / (m * m), 2.0 * m, mhz * 1e6);
    let sum = distances_m.iter().map(of).reduce(|a, b| a + b).unwrap();
    range_m(sum.phase(), mhz * 1e6)
}

/// A plate that stands before a wall for half of the exposure flies between the two, as a pixel on an edge does.
#[test]
fn what_jumps_during_an_exposure_adds_up_as_light() {
    let plate =
        quad([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[y, z]| DVec3::new(1.0, y, z)));
    let wall = quad([[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]].map(|[y, z]| DVec3::new(2.0, y, z)));
    // The plate is there until 0.1 s, the middle of the exposure.
    let track = Track::new(vec![0.0, 0.1], vec![true, false], Blending::Step).unwrap();
    let shown = beamcast::motion::Channel { track: Arc::new(track), clock: Clock::once(1.0) };
    let motion = Some(Arc::new(Motion { links: vec![Link::Visible(shown)] }));
    let instances = vec![
        SourceInstance { mesh: 0, motion, ..SourceInstance::default() },
        SourceInstance { mesh: 1, ..SourceInstance::default() },
    ];
    let builder = SceneBuilder {
        meshes: vec![plate, wall],
        instances,
        materials: vec![Material::default()],
        files: vec![],
        groups: vec![],
    };
    let scene = optics(builder.build().unwrap(), &[lambert(0.5)]);
    // The table of two phasors of depth_cameras.rs, which was computed on its own: half of each at 20 and at 60 MHz.
    for (mhz, expected) in [(20.0, 1.1884), (60.0, 1.0723)] {
        let frame = second_frame(&scene, &exposed(mhz, 0.02), &Trajectory::Fixed(Pose::IDENTITY));
        let range_m = frame.get(0, 0).unwrap().range_m;
        // Half of the table's last digit, and the noise of 10¹⁵ electrons, 10⁻⁷ m.
        assert!((range_m - expected).abs() < 5.1e-5, "{mhz} MHz: {range_m}");
        assert!((range_m - mean_of_paths(&[1.0, 2.0], mhz)).abs() < 1e-6);
        // All at once, the plate is gone.
        let moment = second_frame(&scene, &exposed(mhz, 0.0), &Trajectory::Fixed(Pose::IDENTITY));
        assert!((moment.get(0, 0).unwrap().range_m - 2.0).abs() < 1e-6);
    }
}

/// A camera that comes nearer sees the wall at the distances of its own exposure, and where nothing moves an exposure changes no bit.
#[test]
fn a_camera_that_moves_gathers_the_light_of_its_whole_exposure() {
    let scene = optics(scene(&[wall(3.0, 0.5)]), &[lambert(0.5)]);
    let (speed_m_s, exposure_s) = (10.0, 0.04);
    let trajectory = Trajectory::Twist {
        start: Pose::IDENTITY,
        linear_m_s: DVec3::X * speed_m_s,
        angular_rad_s: DVec3::ZERO,
    };
    for mhz in [20.0, 60.0] {
        let frame = second_frame(&scene, &exposed(mhz, exposure_s), &trajectory);
        // After 0.1 s it is 2 m from the wall. Four sub-rays see it in the middles of the quarters of 40 cm.
        let expected = mean_of_paths(&[2.15, 2.05, 1.95, 1.85], mhz);
        let range_m = frame.get(0, 0).unwrap().range_m;
        assert!((range_m - expected).abs() < 1e-6, "{mhz} MHz: {range_m} {expected}");
    }
    let still = Trajectory::Fixed(Pose::IDENTITY);
    let ranges = [0.0, exposure_s].map(|exposure_s| {
        let mut sensor = exposed(20.0, exposure_s);
        let Some(DepthSensing::TimeOfFlight(sensing)) = &mut sensor.measurement.depth else { panic!() };
        // Few electrons have noise.
        sensing.electrons_at_1_m = 1e4;
        second_frame(&scene, &sensor, &still).get(0, 0).unwrap().range_m
    });
    assert_eq!(ranges[0].to_bits(), ranges[1].to_bits());
    assert!((ranges[0] - 3.0).abs() > 1e-4, "the noise is there");
}

/// A depth camera of 64 by 48 pixels and a focal length of 60, with a colour camera of the same kind at a place of its body frame.
fn with_colour_camera(position_m: [f64; 3]) -> Sensor {
    let camera = "width_px = 64\nheight_px = 48\nfx_px = 60\n";
    let text = format!("[pinhole]\n{camera}[pinhole.registered]\n{camera}position_m = {position_m:?}\n");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sensor.toml");
    std::fs::write(&path, text).unwrap();
    beamcast::config::load_sensor(&path).unwrap().sensor
}

/// The rows of millimetres of a depth image that is registered to the colour camera.
fn registered_mm(scene: &Scene, sensor: &Sensor) -> Vec<Vec<u16>> {
    let frame = seen_from(scene, &Tracer::build(scene), sensor, &Pose::IDENTITY);
    let seen = SensorFrame::new(Capture::at_origin(sensor), &frame, "depth");
    let file = Format::named("registered").unwrap().encode(&seen).unwrap();
    let mut decoder = png::Decoder::new(Cursor::new(file));
    decoder.set_transformations(png::Transformations::IDENTITY);
    let mut reader = decoder.read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut bytes).unwrap();
    let width = reader.info().width as usize;
    let numbers: Vec<u16> = bytes.chunks(2).map(|b| u16::from_be_bytes([b[0], b[1]])).collect();
    numbers.chunks(width).map(<[u16]>::to_vec).collect()
}

/// Columns of one depth after the other: how many, and their millimetres.
fn columns(runs: &[(usize, u16)]) -> Vec<u16> {
    runs.iter().flat_map(|&(count, mm)| vec![mm; count]).collect()
}

/// A surface at the depth Z moves by f·b/Z pixels from the image of one camera to that of another a baseline b beside it, so a gap of
/// f·b·(1/near − 1/far) opens on one side of a near surface, and on the other it hides as much.
#[test]
fn registered_depth_has_holes_where_the_depth_camera_does_not_see() {
    // The left half of the image is a plate at 1 m, the right half a wall at 2 m.
    let plate = Plate(DVec3::new(1.0, 5.0, 0.0), DVec3::Y * 5.0, DVec3::Z * 5.0, 0.5);
    let halves = scene(&[wall(2.0, 0.5), plate]);
    // f·b is 6 m px: 6 pixels at 1 m and 3 at 2 m. A camera to the right sees all farther left.
    let right = columns(&[(26, 1000), (3, 0), (32, 2000), (3, 0)]);
    let left = columns(&[(6, 0), (32, 1000), (26, 2000)]);
    let own = columns(&[(32, 1000), (32, 2000)]);
    for (left_m, expected) in [(-0.1, right), (0.1, left), (0.0, own)] {
        let rows = registered_mm(&halves, &with_colour_camera([0.0, left_m, 0.0]));
        assert_eq!(rows.len(), 48);
        assert!(rows.iter().all(|row| *row == expected), "{left_m}: {:?}", rows[0]);
    }
    // Above, the same happens along the columns: the wall moves down by 3 pixels.
    let rows = registered_mm(&scene(&[wall(2.0, 0.5)]), &with_colour_camera([0.0, 0.0, 0.1]));
    let of_column: Vec<u16> = rows.iter().map(|row| row[10]).collect();
    assert_eq!(of_column, columns(&[(3, 0), (45, 2000)]));
}

/// A wall at 70 m is farther than 65.535 m, and a plate at 1 m hides the left half of it.
#[test]
fn registered_depth_tells_how_many_depths_it_lost() {
    let plate = Plate(DVec3::new(1.0, 5.0, 0.0), DVec3::Y * 5.0, DVec3::Z * 5.0, 0.5);
    let far = Plate(DVec3::new(70.0, 0.0, 0.0), DVec3::Y * 70.0, DVec3::Z * 70.0, 0.5);
    let (scene, sensor) = (scene(&[far, plate]), with_colour_camera([0.0; 3]));
    let frame = seen_from(&scene, &Tracer::build(&scene), &sensor, &Pose::IDENTITY);
    let seen = SensorFrame::new(Capture::at_origin(&sensor), &frame, "depth");
    let (_, lost) = Format::named("registered").unwrap().encode_counted(0, &seen).unwrap();
    assert_eq!(lost, 32 * 48);
}

/// Depth is that of the colour camera, and the pixels of a camera that is nearer have no gaps between them, nor have those of a slope.
#[test]
fn registered_depth_is_that_of_the_colour_camera_and_has_no_gaps() {
    let rows = registered_mm(&scene(&[wall(2.0, 0.5)]), &with_colour_camera([0.5, 0.0, 0.0]));
    assert!(rows.iter().flatten().all(|mm| *mm == 1500));
    // A wall that runs away to the right: x = 2 − y.
    let slope = Plate(DVec3::new(2.0, 0.0, 0.0), DVec3::new(-9.0, 9.0, 0.0), DVec3::Z * 9.0, 0.5);
    let rows = registered_mm(&scene(&[slope]), &with_colour_camera([0.0, -0.1, 0.0]));
    let depth_m = |column: f64| {
        // Z·(1 + (32 − u)/60) = 2 + 0.1, as the camera is at y = −0.1.
        2.1 / (1.0 + (32.0 - column) / 60.0)
    };
    for row in &rows {
        // The right edge of the depth image is 2/(1 − 32/60) m away, where it moves by 1.4 pixels.
        for (column, mm) in row.iter().enumerate().take(62) {
            // The depth is of a pixel of the depth camera that touches this one, so of a place less than a pixel beside it, and rounded.
            let [near, far] = [-1.0, 1.0].map(|off| depth_m(column as f64 + 0.5 + off) * 1e3);
            let mm = f64::from(*mm);
            assert!((near - 0.5..=far + 0.5).contains(&mm), "column {column}: {mm}, not {near} to {far}");
        }
    }
}

/// A sensor without a colour camera has nothing to be registered to, which is told before casting.
#[test]
fn depth_is_registered_only_to_a_colour_camera_that_is_there() {
    let format = Format::named("registered").unwrap();
    let problem = format.check(&parallel()).unwrap_err().to_string();
    assert!(problem.contains("no colour camera"), "{problem}");
    assert!(format.check(&with_colour_camera([0.0; 3])).is_ok());
    let text = "[pinhole]\nwidth_px = 4\nheight_px = 3\nhfov_deg = 60\n[pinhole.registered]\nwidth_px = 4\nhfov_deg = 60\n";
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("sensor.toml");
    std::fs::write(&path, text).unwrap();
    let Err(Error::Config(found)) = beamcast::config::load_sensor(&path) else { panic!() };
    assert!(found[0].message.contains("`[registered]` has no `height_px`"), "{}", found[0].message);
}

/// The colours of a frame's returns, pixel by pixel, and the file of the format `color`.
fn colors(scene: &Scene, sensor: &Sensor, trajectory: &Trajectory) -> (Vec<[f32; 3]>, Vec<u8>) {
    let capture = Capture::new(sensor, Pose::IDENTITY, trajectory, 1, 7);
    let scene = scene.during(capture.window(), None);
    let frame = scan(&scene, &Tracer::build(&scene), &capture, &Progress::default()).unwrap();
    let colors = surface_colors(&scene, &capture, &frame);
    let seen = SensorFrame { colors: &colors, ..SensorFrame::new(capture, &frame, "camera") };
    let file = Format::named("color").unwrap().encode(&seen).unwrap();
    let mut reader = png::Decoder::new(Cursor::new(file)).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut bytes).unwrap();
    let of_pixel = |pixel| frame.slot(pixel, 0).map_or([0.0; 3], |slot| colors[slot]);
    ((0..frame.pixels()).map(of_pixel).collect(), bytes)
}

/// A colour is the base colour with texture and vertex colour at the very point, times the cosine of incidence, also of what moves.
#[test]
fn colors_are_those_of_the_surface_in_the_light_of_a_lamp_at_the_sensor() {
    // A card that leans by 60°: as the camera looks along x, its normal is half along it. Its vertex colours go from black on the left
    // to white on the right, across 4 m.
    let slope = 3.0_f64.sqrt();
    let card = [[2.0, -1.0], [-2.0, -1.0], [-2.0, 1.0], [2.0, 1.0]]
        .map(|[left, up]| DVec3::new(9.0 + slope * up, left, up));
    let mut mesh = quad(card);
    let shade = [0.0, 1.0, 1.0, 0.0].map(|grey| [grey, grey, grey, 1.0]);
    mesh.parts[0].corners = Corners::new(0, true);
    for corner in [0, 1, 2, 0, 2, 3] {
        mesh.parts[0].corners.push(&[], shade[corner]);
    }
    let base = [0.8, 0.4, 0.2];
    let material = Material { base_color: [0.8, 0.4, 0.2, 1.0], ..Material::default() };
    // It goes to the left with 5 m/s, so at 0.1 s it is half a metre farther left.
    let going =
        Trajectory::Twist { start: Pose::IDENTITY, linear_m_s: DVec3::Y * 5.0, angular_rad_s: DVec3::ZERO };
    let still = Trajectory::Fixed(Pose::IDENTITY);
    for (link, moved_m) in [(Link::Rigid(going), 0.5), (Link::Fixed(DAffine3::IDENTITY), 0.0)] {
        let builder = SceneBuilder {
            meshes: vec![mesh.clone()],
            instances: vec![SourceInstance {
                motion: Some(Arc::new(Motion { links: vec![link] })),
                ..SourceInstance::default()
            }],
            materials: vec![material.clone()],
            files: vec![],
            groups: vec![],
        };
        let (found, file) = colors(&builder.build().unwrap(), &parallel(), &still);
        for (pixel, color) in found.iter().enumerate() {
            let left = 2.0 - ((pixel % 16) as f64 + 0.5) * 0.25 - moved_m;
            let is_seen = left.abs() < 2.0;
            let share = if is_seen { (2.0 - left) / 4.0 } else { 0.0 };
            for (channel, base) in base.iter().enumerate() {
                let expected = base * share * 0.5;
                let one = f64::from(color[channel]);
                // Colours, corners and normals are rounded to 32 bits: some 10⁻⁷ each. Black and white are exact.
                assert!((one - expected).abs() < 2e-5, "pixel {pixel}: {color:?}, not {expected}");
                let linear = f64::from(color[channel]);
                let srgb = if linear <= 0.003_130_8 {
                    12.92 * linear
                } else {
                    1.055 * libm::pow(linear, 1.0 / 2.4) - 0.055
                };
                assert_eq!(f64::from(file[3 * pixel + channel]), (255.0 * srgb).round());
            }
        }
    }
    let usual = Format::named("npz").unwrap();
    assert!(Format::named("color").unwrap().tells_colors() && !usual.tells_colors(), "off unless asked for");
    assert!(usual.with_channels(Channels::named(["color.R"])).tells_colors());
}
