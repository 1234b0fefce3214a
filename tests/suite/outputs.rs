//! Output files hold the frame: every format is read back by other code than the code that wrote it.

use std::collections::{BTreeMap, HashMap};
use std::io::Cursor;
use std::path::Path;

use beamcast::angle::Angle;
use beamcast::config::load_job;
use beamcast::frame::{BODY_FROM_OPTICAL, Pose};
use beamcast::motion::Trajectory;
use beamcast::output::{
    ChannelSpec, CloudFrame, EncodeError, Format, FormatSpec, Image, Kind, Names, SensorFrame, Sensors,
    Stream, Values,
};
use beamcast::run::record::Line;
use beamcast::run::{Holding, Journal, Output, Plan, Selection, Session, Start, load_scene};
use beamcast::scan::{Cause, Frame, Progress, Return};
use beamcast::scene::Object;
use beamcast::sensor::{Beam, Camera, Capture, Pattern, RangeLimits, RingOrder, Rotating, Sensor};
use exr::meta::attribute::AttributeValue;
use exr::prelude::{FlatSamples, ReadChannels, ReadLayers, Text};
use glam::{DVec3, Vec3};

fn sensor(pattern: Pattern) -> Sensor {
    Sensor {
        pattern,
        range: RangeLimits::default(),
        ring: RingOrder::BottomUp,
        measurement: Default::default(),
    }
}

fn lidar(beams: usize, columns: usize) -> Sensor {
    let beam = |i: usize| Beam {
        elevation: Angle::deg(15.0 - 30.0 * i as f64 / (beams - 1) as f64),
        azimuth_offset: Angle::default(),
        time_s: 2.304e-6 * i as f64,
        file_index: 0,
    };
    let turn = (Angle::deg(180.0), Angle::deg(-180.0));
    sensor(Pattern::Rotating(Rotating::new((0..beams).map(beam).collect(), columns, turn, 10.0).unwrap()))
}

fn camera(width: usize, height: usize) -> Sensor {
    sensor(Pattern::Camera(Camera::from_hfov((width, height), Angle::deg(80.0), None).unwrap()))
}

/// The closed form of the frame that `sensor` sees 2 m above the ground, up to 30 m away. The ground's normal is `up` in
/// the sensor's frame.
fn ground(sensor: &Sensor, up: DVec3) -> Frame {
    let capture = Capture::at_origin(sensor);
    let (rows, columns) = (capture.rows(), capture.columns());
    let hit = |i: usize| {
        let down = -capture.pulse(i / columns, i % columns).unwrap().direction.dot(up);
        let range_m = 2.0 / down;
        (down > 0.0 && range_m < 30.0).then(|| Return {
            range_m,
            normal: up.as_vec3().to_array(),
            intensity: (0.5 * down) as f32,
            instance: 3,
            label: 17,
            triangle: i as u32,
        })
    };
    frame_of(rows, columns, &(0..rows * columns).map(hit).collect::<Vec<_>>())
}

/// A frame of at most one return a pixel.
fn frame_of(rows: usize, columns: usize, returns: &[Option<Return>]) -> Frame {
    let cause = |one: &Option<Return>| if one.is_some() { Cause::Surface } else { Cause::Nothing };
    Frame::from_pixels(rows, columns, returns.iter().map(|one| (cause(one), one.as_slice())))
}

static BODY: Trajectory =
    Trajectory::Fixed(Pose { translation: DVec3::new(10.0, 20.0, 30.0), ..Pose::IDENTITY });

fn capture<'a>(sensor: &'a Sensor, frame: &'a Frame) -> SensorFrame<'a> {
    let turned =
        Pose::from_rpy(DVec3::new(0.5, -0.25, 1.75), Angle::deg(3.0), Angle::deg(-20.0), Angle::deg(110.0));
    let capture = Capture::new(sensor, turned, &BODY, 0, 0);
    SensorFrame::new(capture, frame, "top")
}

struct Exr {
    size: (usize, usize),
    channels: HashMap<String, FlatSamples>,
    attributes: HashMap<Text, AttributeValue>,
}

impl Exr {
    fn read(bytes: &[u8]) -> Self {
        let image = exr::prelude::read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .first_valid_layer()
            .all_attributes()
            .from_buffered(Cursor::new(bytes))
            .unwrap();
        let layer = image.layer_data;
        let channels = layer.channel_data.list.into_iter().map(|c| (c.name.to_string(), c.sample_data));
        Self {
            size: (layer.size.x(), layer.size.y()),
            channels: channels.collect(),
            attributes: layer.attributes.other,
        }
    }

    fn floats(&self, name: &str) -> &[f32] {
        let FlatSamples::F32(values) = &self.channels[name] else { panic!("{name} is not 32-bit float") };
        values
    }

    fn ids(&self, name: &str) -> &[u32] {
        let FlatSamples::U32(values) = &self.channels[name] else { panic!("{name} is not 32-bit integer") };
        values
    }

    fn names(&self) -> Vec<&str> {
        let mut names: Vec<_> = self.channels.keys().map(String::as_str).collect();
        names.sort_unstable();
        names
    }

    fn text(&self, name: &str) -> String {
        match &self.attributes[&Text::from(name)] {
            AttributeValue::Text(text) => text.to_string(),
            other => panic!("{name} is {other:?}"),
        }
    }
}

#[test]
fn a_lidars_exr_has_every_channel_of_every_return() {
    let sensor = lidar(16, 360);
    let frame = ground(&sensor, DVec3::Z);
    let exr = Exr::read(&Format::EXR.encode(&capture(&sensor, &frame)).unwrap());

    assert_eq!(exr.size, (360, 16));
    let expected = [
        "Y",
        "cause",
        "id.instance",
        "id.semantic",
        "id.triangle",
        "intensity",
        "normal.X",
        "normal.Y",
        "normal.Z",
        "range",
        "time",
    ];
    assert_eq!(exr.names(), expected);
    let mut hits = 0;
    for (i, hit) in frame.first_returns().enumerate() {
        let floats = |names: &[&str]| -> Vec<f32> { names.iter().map(|name| exr.floats(name)[i]).collect() };
        let ids = ["id.instance", "id.semantic", "id.triangle"].map(|name| exr.ids(name)[i]);
        let Some(hit) = hit else {
            assert_eq!(floats(&["range", "Y"]), [f32::INFINITY; 2]);
            assert_eq!(floats(&["intensity", "normal.X", "normal.Y", "normal.Z", "time"]), [0.0; 5]);
            assert_eq!((ids, exr.ids("cause")[i]), ([0; 3], 2));
            continue;
        };
        hits += 1;
        assert_eq!(exr.ids("cause")[i], 1);
        assert_eq!(floats(&["range", "Y"]), [hit.range_m as f32; 2]);
        assert_eq!(floats(&["intensity"]), [hit.intensity]);
        assert_eq!(floats(&["normal.X", "normal.Y", "normal.Z"]), [0.0, 0.0, 1.0]);
        // There are 16 beams, 2.304 µs apart, and 360 columns in a tenth of a second.
        let time = (i % 360) as f64 / 3600.0 + (i / 360) as f64 * 2.304e-6;
        assert!((f64::from(exr.floats("time")[i]) - time).abs() < 1e-8);
        // Ids count from 1, so that 0 is nothing.
        assert_eq!(ids, [4, 17, i as u32 + 1]);
    }
    assert!(hits > 0 && hits < frame.pixels());
    assert_eq!(
        exr.text("beamcast:no_return"),
        "+inf in range, Z and Y; 0 in all other channels except cause"
    );
    assert_eq!(exr.text("beamcast:sensor"), "top");
    assert_eq!(exr.text("beamcast:pattern"), "rotating");
    assert_eq!(exr.text("beamcast:normal_frame"), "sensor");
    assert!(exr.text("beamcast:world_from_sensor").starts_with("{ position_m = [10.5, 19.75, 31.75], "));
}

#[test]
fn a_cameras_z_is_planar_depth() {
    // The camera looks along a wall's normal, so all depths are equal and the ranges differ.
    let sensor = camera(64, 48);
    let frame = ground(&sensor, DVec3::NEG_X);
    let exr = Exr::read(&Format::EXR.encode(&capture(&sensor, &frame)).unwrap());
    assert_eq!(exr.size, (64, 48));
    assert_eq!(frame.return_count(), frame.pixels());
    let wall = |depth: &f32| (depth - 2.0).abs() < 1e-6;
    assert!(exr.floats("Z").iter().all(wall));
    assert_eq!(exr.floats("Y"), exr.floats("Z"));
    // The image spans 80° in 64 pixels, so the corner's ray leans by (31.5, 23.5) pixels over a focal length of 32 / tan
    // 40°.
    let focal = 32.0 / libm::tan(40.0_f64.to_radians());
    let (x, y) = (31.5 / focal, 23.5 / focal);
    let corner = 2.0 * (1.0 + x * x + y * y).sqrt();
    assert!((f64::from(exr.floats("range")[0]) - corner).abs() < 1e-6);
    // The wall faces the camera, so its normal points against the optical axis.
    assert_eq!(exr.text("beamcast:normal_frame"), "optical");
    let normal = ["normal.X", "normal.Y", "normal.Z"].map(|name| exr.floats(name)[100]);
    assert_eq!(normal, [0.0, 0.0, -1.0]);
    let number = |name| match exr.attributes[&Text::from(name)] {
        AttributeValue::F64(value) => value,
        ref other => panic!("{name} is {other:?}"),
    };
    assert!((number("beamcast:fx_px") - focal).abs() < 1e-12);
    assert_eq!((number("beamcast:cx_px"), number("beamcast:cy_px")), (32.0, 24.0));
}

#[test]
fn a_cameras_miss_is_infinitely_deep() {
    let sensor = camera(32, 24);
    let frame = ground(&sensor, DVec3::Z);
    let exr = Exr::read(&Format::EXR.encode(&capture(&sensor, &frame)).unwrap());
    assert_eq!(frame.get(0, 0), None);
    for name in ["range", "Z", "Y"] {
        assert_eq!(exr.floats(name)[0], f32::INFINITY, "{name}");
    }
    // The ground's normal points up, which is −y in the optical frame.
    let last = frame.pixels() - 1;
    let normal = ["normal.X", "normal.Y", "normal.Z"].map(|name| exr.floats(name)[last]);
    assert_eq!(normal, [0.0, -1.0, 0.0]);
    // The depth of the ground is its height over the slope of the ray, which is 23.5 − 12 pixels down.
    let focal = 16.0 / libm::tan(40.0_f64.to_radians());
    let depth = 2.0 / (11.5 / focal);
    assert!((f64::from(exr.floats("Z")[last]) - depth).abs() < 1e-6);
}

struct Ply {
    header: String,
    fields: Vec<(String, String)>,
    points: Vec<Vec<f64>>,
}

impl Ply {
    fn read(bytes: &[u8]) -> Self {
        let end = b"end_header\n";
        let length = bytes.windows(end.len()).position(|w| w == end).unwrap() + end.len();
        let header = String::from_utf8(bytes[..length].to_vec()).unwrap();
        assert!(header.starts_with("ply\nformat binary_little_endian 1.0\n"));
        let fields: Vec<(String, String)> = header
            .lines()
            .filter_map(|line| line.strip_prefix("property "))
            .map(|line| line.split_once(' ').map(|(a, b)| (a.to_owned(), b.to_owned())).unwrap())
            .collect();
        let count: usize =
            header.lines().find_map(|line| line.strip_prefix("element vertex ")).unwrap().parse().unwrap();
        let body = &bytes[length..];
        assert_eq!(body.len(), count * 4 * fields.len());
        let value = |(kind, word): (&(String, String), &[u8])| {
            let word: [u8; 4] = word.try_into().unwrap();
            match kind.0.as_str() {
                "float" => f64::from(f32::from_le_bytes(word)),
                "int" => f64::from(i32::from_le_bytes(word)),
                other => panic!("readers drop {other}"),
            }
        };
        let point = |p: &[u8]| fields.iter().zip(p.chunks(4)).map(value).collect();
        let points = body.chunks(4 * fields.len()).map(point).collect();
        Self { header, fields, points }
    }

    fn get(&self, point: usize, field: &str) -> f64 {
        self.points[point][self.fields.iter().position(|(_, name)| name == field).unwrap()]
    }

    fn position(&self, point: usize) -> DVec3 {
        DVec3::from_array(["x", "y", "z"].map(|axis| self.get(point, axis)))
    }
}

#[test]
fn a_cloud_has_the_returns_and_only_them() {
    let sensor = lidar(16, 360);
    let frame = ground(&sensor, DVec3::Z);
    let ply = Ply::read(&Format::PLY.encode(&capture(&sensor, &frame)).unwrap());
    let names: Vec<_> = ply.fields.iter().map(|(_, name)| name.as_str()).collect();
    assert_eq!(names, ["x", "y", "z", "intensity", "ring", "column", "t", "instance", "label", "range"]);
    let hits = frame.iter();
    assert_eq!(ply.points.len(), frame.return_count());
    for (point, (i, hit)) in hits.enumerate() {
        let (row, column) = (i / 360, i % 360);
        let position = ply.position(point);
        assert!((position.z + 2.0).abs() < 1e-6, "the ground lies 2 m below: {position}");
        assert!((position.length() - hit.range_m).abs() < 4e-6);
        let get = |field| ply.get(point, field);
        assert_eq!(get("intensity"), f64::from(hit.intensity));
        assert_eq!(get("ring"), 15.0 - row as f64, "counted from the lowest");
        assert_eq!(get("column"), column as f64);
        assert_eq!(get("t"), (column as f64 / 3600.0 * 1e9 + row as f64 * 2304.0).round());
        assert_eq!((get("instance"), get("label")), (4.0, 17.0));
        assert_eq!(get("range"), f64::from(hit.range_m as f32));
    }
    assert!(ply.header.contains("comment frame: the sensor's frame"));
}

#[test]
fn a_cloud_is_in_the_frame_it_names() {
    let sensor = camera(32, 24);
    let frame = ground(&sensor, DVec3::NEG_X);
    let seen = capture(&sensor, &frame);
    let cloud = |cloud_frame| Ply::read(&Format::PLY.encode(&SensorFrame { cloud_frame, ..seen }).unwrap());

    let optical = cloud(CloudFrame::Sensor);
    assert!((0..32 * 24).all(|i| (optical.position(i).z - 2.0).abs() < 1e-6));
    assert!(optical.position(0).x < 0.0 && optical.position(0).y < 0.0, "top left");
    assert!(optical.header.contains("comment frame: the camera's optical frame"));

    let body_from_optical = seen.capture.body_from_sensor * BODY_FROM_OPTICAL;
    let (body, world) = (cloud(CloudFrame::Body), cloud(CloudFrame::World));
    for i in [0, 31, 400, 767] {
        let expected = body_from_optical.point(optical.position(i));
        assert!(body.position(i).abs_diff_eq(expected, 2e-6));
        assert!(world.position(i).abs_diff_eq(expected + DVec3::new(10.0, 20.0, 30.0), 4e-6));
        assert_eq!(
            seen.point(i / 32, i % 32, frame.get(i / 32, i % 32).unwrap().range_m)
                .unwrap()
                .as_vec3()
                .to_array(),
            {
                let p = optical.position(i);
                Vec3::new(p.x as f32, p.y as f32, p.z as f32).to_array()
            }
        );
    }
    assert!(body.header.contains("comment frame: the body's frame"));
    assert!(world.header.contains("comment frame: the world"));
}

#[test]
fn a_clouds_pose_in_its_header_leads_to_the_world() {
    let sensor = camera(8, 6);
    let frame = ground(&sensor, DVec3::NEG_X);
    let seen = capture(&sensor, &frame);
    let world =
        Ply::read(&Format::PLY.encode(&SensorFrame { cloud_frame: CloudFrame::World, ..seen }).unwrap());
    for cloud_frame in [CloudFrame::Sensor, CloudFrame::Body, CloudFrame::World] {
        let ply = Ply::read(&Format::PLY.encode(&SensorFrame { cloud_frame, ..seen }).unwrap());
        let pose = ply.header.lines().find_map(|l| l.strip_prefix("comment world_from_points = ")).unwrap();
        let table: toml::Table = format!("pose = {pose}").parse().unwrap();
        let numbers = |key: &str| -> Vec<f64> {
            table["pose"][key].as_array().unwrap().iter().map(|v| v.as_float().unwrap()).collect()
        };
        let quaternion = numbers("quaternion_xyzw").try_into().unwrap();
        let position = DVec3::from_slice(&numbers("position_m"));
        let world_from_points = Pose::from_quaternion(position, quaternion).unwrap();
        for i in 0..48 {
            let point = world_from_points.point(ply.position(i));
            assert!(point.abs_diff_eq(world.position(i), 1e-5), "{cloud_frame:?}");
        }
    }
}

#[test]
fn numbers_beyond_a_clouds_types_are_errors() {
    let sensor = camera(2, 2);
    let mut returns: Vec<_> = ground(&sensor, DVec3::NEG_X).first_returns().collect();
    returns[0].as_mut().unwrap().label = 1 << 31;
    let frame = frame_of(2, 2, &returns);
    let error = Format::PLY.encode(&capture(&sensor, &frame)).unwrap_err().to_string();
    assert_eq!(error, "a PLY's label is at most 2147483647, and can't hold 2147483648");
}

fn read_png(bytes: &[u8]) -> (u32, u32, Vec<u8>) {
    let mut reader = png::Decoder::new(Cursor::new(bytes)).read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert_eq!((info.color_type, info.bit_depth), (png::ColorType::Rgb, png::BitDepth::Eight));
    (info.width, info.height, pixels)
}

#[test]
fn a_preview_is_red_near_blue_far_and_dark_where_nothing_is() {
    let sensor = lidar(16, 360);
    let frame = ground(&sensor, DVec3::Z);
    let (width, height, pixels) = read_png(&Format::PNG.encode(&capture(&sensor, &frame)).unwrap());
    // Beams are 2° apart and columns 1°, so each row is repeated once.
    assert_eq!((width, height), (360, 32));
    let pixel = |row: usize, column: usize| &pixels[3 * (row * 360 + column)..][..3];
    assert_eq!(pixel(0, 7), [0x10, 0x10, 0x14]);
    let (near, far) = (pixel(31, 7), pixel(18, 7));
    assert_eq!(near, pixel(30, 7));
    assert!(near[0] > near[1] && near[0] > near[2], "{near:?}");
    assert!(far[2] > far[0], "{far:?}");
    let hits = pixels.chunks(3).filter(|p| *p != [0x10, 0x10, 0x14]).count();
    assert_eq!(hits, 2 * frame.return_count());
}

/// What is too near is dark red in a preview, so that a person sees why a sensor is blind.
#[test]
fn a_preview_shows_the_dead_zone() {
    let sensor = camera(3, 1);
    let one = Return { range_m: 2.0, ..Return::default() };
    let pixels: [(Cause, &[Return]); 3] =
        [(Cause::TooNear, &[one]), (Cause::Surface, &[one]), (Cause::OutOfRange, &[])];
    let frame = Frame::from_pixels(1, 3, pixels);
    let (_, _, pixels) = read_png(&Format::PNG.encode(&capture(&sensor, &frame)).unwrap());
    assert_eq!((&pixels[..3], &pixels[6..]), (&[0x4a, 0x0a, 0x14][..], &[0x10, 0x10, 0x14][..]));
}

#[test]
fn the_same_capture_gives_the_same_bytes_on_any_number_of_threads() {
    for sensor in [lidar(64, 512), camera(160, 120)] {
        let frame = ground(&sensor, DVec3::Z);
        let seen = capture(&sensor, &frame);
        for format in Format::all().filter(|format| format.check(&sensor).is_ok()) {
            let encode = |threads: usize| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
                pool.install(|| format.encode(&seen).unwrap())
            };
            let first = encode(1);
            // The repetitions are enough for the order of a hash map to differ.
            for threads in [1, 2, 3, 16, 1, 2] {
                assert!(encode(threads) == first, "{format:?} on {threads} threads");
            }
        }
    }
}

#[test]
fn a_frame_without_returns_is_written_too() {
    let sensor = lidar(4, 36);
    let frame = frame_of(4, 36, &[None; 4 * 36]);
    let seen = capture(&sensor, &frame);
    let exr = Exr::read(&Format::EXR.encode(&seen).unwrap());
    assert!(exr.floats("range").iter().all(|r| *r == f32::INFINITY));
    assert_eq!(Ply::read(&Format::PLY.encode(&seen).unwrap()).points.len(), 0);
    let (_, _, pixels) = read_png(&Format::PNG.encode(&seen).unwrap());
    assert!(pixels.chunks(3).all(|p| p == [0x10, 0x10, 0x14]));
}

/// The headers of an image and of a cloud name what the frame shows, and both are read back to the same names.
#[test]
fn headers_name_the_instances_and_labels_of_their_frame() {
    let object = |name: &str| Object { name: name.to_owned(), ..Object::default() };
    let objects = ["unseen", "a", "b", "Boden \"ß\"\n\u{202e}"].map(object);
    let labels = BTreeMap::from([("ground".to_owned(), 17), ("floor".to_owned(), 17), ("sky".to_owned(), 3)]);
    for sensor in [lidar(16, 36), camera(32, 24)] {
        let frame = ground(&sensor, DVec3::Z);
        let names = Names { objects: &objects, labels: Some(&labels) };
        let seen = SensorFrame { names, ..capture(&sensor, &frame) };
        let part = beamcast::output::recorded::read_exr(&Format::EXR.encode(&seen).unwrap(), u64::MAX)
            .unwrap()
            .remove(0);
        let cloud =
            beamcast::output::recorded::read_ply(&Format::PLY.encode(&seen).unwrap(), u64::MAX).unwrap();
        for listed in [part.instances(), cloud.instances()] {
            assert_eq!((listed.get(4), listed.count()), (Some(objects[3].name.as_str()), 1));
            assert_eq!((listed.get(0), listed.get(1), listed.get(5)), (None, None, None));
        }
        for words in [part.labels(), cloud.labels()] {
            assert_eq!(words, BTreeMap::from([(17, "floor, ground".to_owned())]));
        }
        assert_eq!(part.attributes["beamcast:labels"], "{\"17\": [\"floor\",\"ground\"]}");
        assert!(
            cloud.comments.contains(&"label 17 = [\"floor\",\"ground\"]".to_owned()),
            "{:?}",
            cloud.comments
        );
        assert!(!part.attributes.contains_key("beamcast:instances_left_out"));
    }
}

/// A frame that shows a hundred thousand objects has a header of a bounded size, which says how many names it leaves out.
#[test]
fn headers_of_very_many_objects_are_bounded() {
    let sensor = lidar(100, 1000);
    let objects: Vec<Object> =
        (0..100_000).map(|i| Object { name: format!("leaf {i}"), ..Object::default() }).collect();
    let returns: Vec<_> =
        (0..100_000).map(|i| Some(Return { range_m: 5.0, instance: i, ..Return::default() })).collect();
    let frame = frame_of(100, 1000, &returns);
    let names = Names { objects: &objects, labels: None };
    let seen = SensorFrame { names, ..capture(&sensor, &frame) };
    let part = beamcast::output::recorded::read_exr(&Format::EXR.encode(&seen).unwrap(), u64::MAX)
        .unwrap()
        .remove(0);
    let file = Format::PLY.encode(&seen).unwrap();
    let ply = Ply::read(&file);
    assert!(ply.header.len() < 64_000 && ply.header.lines().all(|line| line.len() < 1024));
    let cloud = beamcast::output::recorded::read_ply(&file, u64::MAX).unwrap();
    let left_out = 100_000 - part.instances().count();
    assert!((98_000..99_999).contains(&left_out), "{left_out}");
    assert_eq!(cloud.instances(), part.instances());
    assert_eq!(
        part.attributes["beamcast:instances_left_out"],
        format!("{left_out}, which the manifest names")
    );
    assert!(cloud.comments.contains(&format!("{left_out} more instances are named in the manifest")));
}

/// A frame of several returns a pixel gives one part of the EXR for each return number, and a cloud with all returns.
#[test]
fn several_returns_of_a_pixel_are_all_written() {
    let sensor = lidar(2, 3);
    let at = |range_m: f64| Return { range_m, triangle: range_m as u32, ..Return::default() };
    let returns: [&[Return]; 6] =
        [&[at(1.0), at(2.0)], &[], &[at(3.0)], &[at(4.0), at(5.0), at(6.0)], &[], &[]];
    let cause = |of_pixel: &[Return]| if of_pixel.is_empty() { Cause::Nothing } else { Cause::Surface };
    let frame = Frame::from_pixels(2, 3, returns.map(|of_pixel| (cause(of_pixel), of_pixel)));
    let seen = capture(&sensor, &frame);

    let file = Format::EXR.encode(&seen).unwrap();
    assert_eq!(file, Format::EXR.encode(&seen).unwrap(), "the order of attributes is fixed in every part");
    let parts = beamcast::output::recorded::read_exr(&file, u64::MAX).unwrap();
    let names: Vec<_> = parts.iter().map(|part| part.name.as_str()).collect();
    assert_eq!(names, ["return0", "return1", "return2"]);
    const NONE: f32 = f32::INFINITY;
    let ranges = [
        [1.0, NONE, 3.0, 4.0, NONE, NONE],
        [2.0, NONE, NONE, 5.0, NONE, NONE],
        [NONE, NONE, NONE, 6.0, NONE, NONE],
    ];
    for (part, ranges) in parts.iter().zip(ranges) {
        assert_eq!(part.image.f32("range").unwrap(), ranges, "{}", part.name);
        assert_eq!(part.image.f32("Y").unwrap(), ranges, "{}", part.name);
        let ids = ranges.map(|range| if range.is_finite() { range as u32 + 1 } else { 0 });
        assert_eq!(part.image.u32("id.triangle").unwrap(), ids, "{}", part.name);
        assert_eq!(part.attributes["beamcast:sensor"], "top");
    }
    let ply = Ply::read(&Format::PLY.encode(&seen).unwrap());
    let fields = |name| (0..6).map(|point| ply.get(point, name)).collect::<Vec<_>>();
    assert_eq!(ply.points.len(), 6);
    assert_eq!(fields("range"), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    assert_eq!(fields("column"), [0.0, 0.0, 2.0, 0.0, 0.0, 0.0]);
}

/// A channel is added by one declaration: its name, its unit, its value without a return, its sensors, and the rule by
/// which it follows from a return.
#[test]
fn a_channel_of_ones_own_is_one_declaration() {
    let made_up = ChannelSpec {
        name: "range.squared",
        unit: "m²",
        about: "The square of the range.",
        no_return: -1.0,
        sensors: Sensors::All,
        shown: None,
        values: Values::F32(|f, at| libm::pow(f.frame.returns().range_m[at.slot], 2.0)),
        is_chosen: false,
    };
    let sensor = lidar(2, 1);
    let frame = frame_of(2, 1, &[Some(Return { range_m: 3.0, ..Return::default() }), None]);
    let image = Image::with_channels(&capture(&sensor, &frame), 0, [&made_up]);
    assert_eq!(image.f32("range.squared").unwrap(), [9.0, -1.0]);
}

/// A format with one file for each run, which counts the returns of each frame.
static TALLY: FormatSpec = FormatSpec {
    name: "tally",
    about: "a line a frame",
    ending: "tally",
    kind: Kind::Stream(|_, _| Box::new(Tally(0))),
    ..FormatSpec::PLAIN
};

struct Tally(usize);

impl Stream for Tally {
    fn add(&mut self, frame: &SensorFrame, file: &mut dyn std::io::Write) -> Result<(), EncodeError> {
        self.0 += frame.frame.return_count();
        Ok(writeln!(file, "{} {}: {}", frame.name, frame.capture.frame, frame.frame.return_count())?)
    }

    fn finish(&mut self, file: &mut dyn std::io::Write) -> Result<(), EncodeError> {
        Ok(writeln!(file, "total: {}", self.0)?)
    }
}

/// A format is added by one declaration, whether it has one file for each frame or for each run.
#[test]
fn a_format_of_ones_own_is_one_declaration() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/room_vlp16.toml");
    let mut job = load_job(&path, &["sensor.vlp16.rotating.columns=36".to_owned()]).unwrap();
    let folder = tempfile::tempdir().unwrap();
    job.output.dir = folder.path().to_owned();
    job.output.formats = vec![Format::of(&TALLY), Format::PLY];
    let plan = Plan::of(&job, &Selection::ALL, Holding::Files).unwrap();
    let mut journal = Journal::check(&job, &plan, Start::New).unwrap();
    let scene = load_scene(&mut job, &[]).unwrap().scene;
    let session = Session::open(job, &scene);
    journal.begin(&session, &plan, &mut |_, _| unreachable!()).unwrap();
    let mut returns = 0;
    for item in plan.items(&session.job) {
        let frame = session.cast(&item, &Progress::default()).unwrap();
        let seen = session.sensor_frame(&item, &frame);
        let write = |output: &Output| {
            let (content, _) = session.encode(output, &seen).unwrap();
            journal.destination().write(&output.name, &content).unwrap()
        };
        let written = item.outputs.iter().map(write).collect();
        journal.streams.add(&seen).unwrap();
        journal.record(&Line::of(&item, &seen, written)).unwrap();
        returns += frame.return_count();
    }
    assert!(returns > 100);
    assert!(!folder.path().join("run.tally").exists(), "it is there when it is whole");
    journal.finish().unwrap();
    let tally = std::fs::read_to_string(folder.path().join("run.tally")).unwrap();
    assert_eq!(tally, format!("vlp16 0: {returns}\ntotal: {returns}\n"));
    let manifest = std::fs::read_to_string(folder.path().join("manifest.json")).unwrap();
    let read: serde_json::Value = serde_json::from_str(&manifest).unwrap();
    let outputs: Vec<_> = read["outputs"].as_array().unwrap().iter().map(|file| &file["path"]).collect();
    assert_eq!(outputs, ["vlp16/000000.ply", "run.tally"]);
    assert!(!folder.path().join("journal.jsonl").exists());
    assert!(manifest.contains(blake3::hash(tally.as_bytes()).to_hex().as_str()), "{manifest}");
}
