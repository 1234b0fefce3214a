//! The formats that need nothing but a frame: what is in their files, their options, and the messages about them.

mod folders;
mod surveyors;

use std::collections::BTreeMap;
use std::fs;
use std::io::Cursor;
use std::path::Path;

use beamcast::angle::Angle;
use beamcast::config::{Job, load_job};
use beamcast::frame::Pose;
use beamcast::motion::Trajectory;
use beamcast::output::recorded::read_exr;
use beamcast::output::{Channels, CloudFrame, Format, Image, SensorFrame};
use beamcast::scan::{Cause, Frame, Return};
use beamcast::sensor::{Beam, Camera, Capture, Pattern, RangeLimits, RingOrder, Rotating, Sensor};
use glam::DVec3;

const LIMITS: RangeLimits = RangeLimits { max_m: 60.0, min_m: 0.0, of: beamcast::sensor::Limited::Range };

pub(super) fn lidar() -> Sensor {
    let beam = |elevation| Beam {
        elevation: Angle::deg(elevation),
        azimuth_offset: Angle::default(),
        time_s: 2e-6,
        file_index: 0,
    };
    let turn = (Angle::deg(180.0), Angle::deg(-180.0));
    let pattern = Rotating::new(vec![beam(10.0), beam(-10.0)], 3, turn, 10.0).unwrap();
    Sensor {
        pattern: Pattern::Rotating(pattern),
        range: LIMITS,
        ring: RingOrder::BottomUp,
        measurement: Default::default(),
    }
}

pub(super) fn camera() -> Sensor {
    let camera = Camera::from_hfov((3, 2), Angle::deg(80.0), None).unwrap();
    Sensor {
        pattern: Pattern::Camera(camera),
        range: LIMITS,
        ring: RingOrder::Row,
        measurement: Default::default(),
    }
}

fn hit(range_m: f64, instance: u32, label: u32) -> Return {
    Return { range_m, instance, label, intensity: 0.5, normal: [0.0, 0.6, 0.8], triangle: 9 }
}

/// A frame of 2 × 3 pixels: misses of each cause, one return, two returns, and one that is far away.
pub(super) fn frame() -> Frame {
    let (near, both, far) = ([hit(1.5, 0, 3)], [hit(2.0004, 299, 0), hit(2.75, 1, 70)], [hit(70.25, 2, 3)]);
    let pixels: [(Cause, &[Return]); 6] = [
        (Cause::Surface, &near),
        (Cause::Nothing, &[]),
        (Cause::Surface, &both),
        (Cause::NoPulse, &[]),
        (Cause::TooNear, &[]),
        (Cause::Surface, &far),
    ];
    Frame::from_pixels(2, 3, pixels)
}

static BODY: Trajectory =
    Trajectory::Fixed(Pose { translation: DVec3::new(10.0, 20.0, 30.0), ..Pose::IDENTITY });

pub(super) fn seen<'a>(sensor: &'a Sensor, frame: &'a Frame) -> SensorFrame<'a> {
    let mount =
        Pose::from_rpy(DVec3::new(0.5, -0.25, 1.75), Angle::deg(3.0), Angle::deg(-20.0), Angle::deg(110.0));
    let capture = Capture::new(sensor, mount, &BODY, 0, 0);
    SensorFrame::new(capture, frame, "top")
}

/// A format as a job asks for it, in TOML.
fn asked(formats: &str) -> Result<Job, String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/room_vlp16.toml");
    load_job(&path, &[format!("output.formats={formats}")]).map_err(|e| format!("{e:?}"))
}

pub(super) fn format(name: &str, options: &str) -> Format {
    asked(&format!("[{{ format = \"{name}\"{options} }}]")).unwrap().output.formats[0]
}

/// The numbers of a PNG's pixels as they are stored, its bits, and its palette.
fn numbers(png: &[u8]) -> (Vec<u32>, u8, Option<Vec<u8>>) {
    let mut decoder = png::Decoder::new(Cursor::new(png));
    decoder.set_transformations(png::Transformations::IDENTITY);
    let mut reader = decoder.read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    reader.next_frame(&mut bytes).unwrap();
    let info = reader.info();
    assert_eq!((info.width, info.height), (3, 2));
    let palette = info.palette.as_ref().map(|palette| palette.to_vec());
    match info.bit_depth {
        png::BitDepth::Sixteen => {
            (bytes.chunks(2).map(|b| u16::from_be_bytes([b[0], b[1]]).into()).collect(), 16, palette)
        }
        _ => (bytes.into_iter().map(u32::from).collect(), 8, palette),
    }
}

#[test]
fn a_depth_image_has_whole_steps_and_tells_how_many_values_it_lost() {
    let (sensor, frame) = (lidar(), frame());
    let seen = seen(&sensor, &frame);
    let depths = |options: &str| {
        let format = format("depth16", options);
        let (file, lost) = format.encode_counted(0, &seen).unwrap();
        (numbers(&file).0, lost)
    };
    // The range of a LiDAR, of the first return.
    assert_eq!(depths(""), (vec![1500, 0, 2000, 0, 0, 0], 1));
    assert_eq!(depths(", scale = 5000"), (vec![7500, 0, 10002, 0, 0, 0], 1));
    assert_eq!(depths(", scale = 256"), (vec![384, 0, 512, 0, 0, 17984], 0));
    assert_eq!(depths(", scale = 0.1"), (vec![0, 0, 0, 0, 0, 7], 2));
}

#[test]
fn a_cameras_depth_image_has_the_depth_along_the_axis() {
    let (sensor, frame) = (camera(), frame());
    let seen = seen(&sensor, &frame);
    let (depths, bits, _) = numbers(&format("depth16", ", scale = 256").encode(&seen).unwrap());
    let image = Image::of(&seen);
    let expected = image.f32("Z").unwrap().iter().map(|z| match z.is_finite() {
        true => (f64::from(*z) * 256.0).round() as u32,
        false => 0,
    });
    assert_eq!((depths, bits), (expected.collect::<Vec<_>>(), 16));
    // A file on its own says what it holds.
    let file = format("depth16", ", scale = 256").encode(&seen).unwrap();
    let reader = png::Decoder::new(Cursor::new(&file)).read_info().unwrap();
    let texts = &reader.info().uncompressed_latin1_text;
    let texts: Vec<_> = texts.iter().map(|text| (text.keyword.as_str(), text.text.as_str())).collect();
    assert_eq!(texts, [("beamcast:channel", "Z"), ("beamcast:scale", "256")]);
    assert!(image.f32("Z").unwrap()[0] < 1.4);
}

#[test]
fn labels_and_objects_are_images_of_8_or_16_bits() {
    let (sensor, frame) = (lidar(), frame());
    let seen = seen(&sensor, &frame);
    let (labels, bits, palette) = numbers(&format("labels", "").encode(&seen).unwrap());
    assert_eq!((labels, bits, palette), (vec![3, 0, 0, 0, 0, 3], 16, None));
    let (labels, bits, palette) = numbers(&format("labels", ", palette = true").encode(&seen).unwrap());
    assert_eq!((labels, bits), (vec![3, 0, 0, 0, 0, 3], 8));
    let palette = palette.unwrap();
    assert_eq!((palette.len(), &palette[..3]), (768, &[0, 0, 0][..]));
    assert_eq!(numbers(&format("labels", ", bits = 8").encode(&seen).unwrap()).1, 8);
    // Ids count from 1.
    let (instances, ..) = numbers(&format("instances", "").encode(&seen).unwrap());
    assert_eq!(instances, [1, 0, 300, 0, 0, 3]);
    let problem = format("instances", ", bits = 8").encode(&seen).unwrap_err().to_string();
    assert_eq!(problem, "a pixel holds at most 255, and one has the number 300");
}

#[test]
fn numbers_that_pixels_cannot_hold_are_told_before_casting() {
    let eight = format("labels", ", bits = 8");
    assert!(eight.check_label(255).is_ok() && format("labels", "").check_label(65535).is_ok());
    let problem = eight.check_label(256).unwrap_err().to_string();
    assert!(problem.contains("at most 255") && problem.contains("the label 256"), "{problem}");
    assert!(format("labels", "").check_label(65536).is_err());
    assert!(eight.check_instances(1000).is_ok(), "it holds no ids of objects");
    let instances = format("instances", ", palette = true");
    assert!(instances.check_instances(255).is_ok() && instances.check_label(1000).is_ok());
    let problem = instances.check_instances(256).unwrap_err().to_string();
    assert!(problem.contains("at most 255") && problem.contains("256 objects"), "{problem}");
}

/// The header of a PCD by its keys, and the bytes after it.
fn pcd(file: &[u8]) -> (BTreeMap<String, String>, Vec<Vec<u8>>) {
    let end = b"DATA binary\n";
    let start = file.windows(end.len()).position(|w| w == end).unwrap() + end.len();
    let header = std::str::from_utf8(&file[..start]).unwrap();
    let entry = |line: &str| line.split_once(' ').map(|(key, value)| (key.to_owned(), value.to_owned()));
    (header.lines().filter_map(entry).collect(), file[start..].chunks(34).map(<[u8]>::to_vec).collect())
}

fn f32_at(point: &[u8], at: usize) -> f32 {
    f32::from_le_bytes(point[at..at + 4].try_into().unwrap())
}

pub(super) fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
}

#[test]
fn a_pcd_has_every_return_or_every_pixel() {
    let (sensor, frame) = (lidar(), frame());
    let seen = seen(&sensor, &frame);
    let (header, points) = pcd(&format("pcd", "").encode(&seen).unwrap());
    assert_eq!((header["WIDTH"].as_str(), header["HEIGHT"].as_str(), points.len()), ("4", "1", 4));
    assert_eq!(header["FIELDS"], "x y z intensity ring time instance label range");
    assert_eq!(header["SIZE"], "4 4 4 4 2 4 4 4 4");
    let ids = |point: &Vec<u8>| (u32_at(point, 22), u32_at(point, 26));
    assert_eq!(points.iter().map(ids).collect::<Vec<_>>(), [(1, 3), (300, 0), (2, 70), (3, 3)]);
    assert_eq!(points.iter().map(|p| f32_at(p, 30)).collect::<Vec<_>>(), [1.5, 2.0004, 2.75, 70.25]);
    let expected = seen.point(0, 2, 2.75).unwrap().as_vec3();
    assert_eq!([0, 4, 8].map(|at| f32_at(&points[2], at)), expected.to_array());
    assert_eq!(points.iter().map(|p| u16::from_le_bytes([p[16], p[17]])).collect::<Vec<_>>(), [1, 1, 1, 0]);
    assert_eq!(f32_at(&points[0], 18), seen.capture.time_s(0, 0).unwrap() as f32);
    // The viewpoint is the sensor's place in the world.
    let viewpoint: Vec<f64> = header["VIEWPOINT"].split(' ').map(|v| v.parse().unwrap()).collect();
    let pose = seen.world_from_sensor();
    assert_eq!(viewpoint[..3], pose.translation.to_array());
    let again =
        Pose::from_quaternion(pose.translation, [viewpoint[4], viewpoint[5], viewpoint[6], viewpoint[3]]);
    assert!((again.unwrap().rotation - pose.rotation).abs_diff_eq(glam::DMat3::ZERO, 1e-15));

    let (header, points) = pcd(&format("pcd", ", organised = true").encode(&seen).unwrap());
    assert_eq!((header["WIDTH"].as_str(), header["HEIGHT"].as_str(), points.len()), ("3", "2", 6));
    let is_there: Vec<_> = points.iter().map(|p| !f32_at(p, 0).is_nan() && !f32_at(p, 30).is_nan()).collect();
    assert_eq!(is_there, [true, false, true, false, false, true]);
    assert_eq!(ids(&points[2]), (300, 0), "the first return");
    assert_eq!(ids(&points[1]), (0, 0));
}

#[test]
fn a_cloud_in_the_world_has_no_viewpoint_and_a_cameras_is_optical() {
    let (sensor, frame) = (camera(), frame());
    let seen = seen(&sensor, &frame);
    let viewpoint = |cloud_frame| {
        let seen = SensorFrame { cloud_frame, ..seen };
        pcd(&format("pcd", "").encode(&seen).unwrap()).0["VIEWPOINT"].clone()
    };
    let numbers: Vec<f64> = viewpoint(CloudFrame::World).split(' ').map(|v| v.parse().unwrap()).collect();
    let identity = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0];
    assert!(numbers.iter().zip(identity).all(|(a, b)| (a - b).abs() < 1e-12), "{numbers:?}");
    assert!(viewpoint(CloudFrame::Body).starts_with("10.0 20.0 30.0 1.0 "));
    assert!(viewpoint(CloudFrame::Sensor).starts_with("10.5 19.75 31.75 "));
}

#[test]
fn an_npy_has_the_points_of_the_ply() {
    let (sensor, frame) = (lidar(), frame());
    let seen = seen(&sensor, &frame);
    let (npy, ply) = (format("npy", "").encode(&seen).unwrap(), Format::PLY.encode(&seen).unwrap());
    assert_eq!(npy[npy.len() - 160..], ply[ply.len() - 160..]);
    let header = String::from_utf8_lossy(&npy[..npy.len() - 160]).into_owned();
    assert!(header.contains("('x', '<f4'), ") && header.contains("('t', '<i4')"), "{header}");
    assert!(header.contains("'shape': (4,)") && npy.len() % 64 == 160 % 64, "{header}");
}

/// The arrays of an NPZ that is not compressed: the header's text and the bytes of each, by name.
pub(super) fn npz(file: &[u8]) -> BTreeMap<String, (String, Vec<u8>)> {
    let (mut arrays, mut at) = (BTreeMap::new(), 0);
    while file[at..].starts_with(b"PK\x03\x04") {
        let (length, name) = (u32_at(file, at + 18) as usize, usize::from(file[at + 26]));
        let content = &file[at + 30 + name..][..length];
        let header = 10 + usize::from(u16::from_le_bytes([content[8], content[9]]));
        let text = String::from_utf8_lossy(&content[10..header]).trim_end().to_owned();
        let key = String::from_utf8_lossy(&file[at + 30..at + 30 + name]).into_owned();
        arrays.insert(key, (text, content[header..].to_vec()));
        at += 30 + name + length;
    }
    arrays
}

fn floats(bytes: &[u8]) -> Vec<f32> {
    bytes.chunks(4).map(|b| f32_at(b, 0)).collect()
}

#[test]
fn an_npz_has_an_array_a_channel() {
    let (sensor, frame) = (camera(), frame());
    let seen = seen(&sensor, &frame);
    let arrays = npz(&format("npz", "").encode(&seen).unwrap());
    let names: Vec<_> = arrays.keys().map(String::as_str).filter(|name| !name.contains('/')).collect();
    let expected = [
        "Z.npy",
        "about.npy",
        "cause.npy",
        "id.instance.npy",
        "id.semantic.npy",
        "id.triangle.npy",
        "intensity.npy",
        "normal.npy",
        "range.npy",
        "time.npy",
    ];
    assert_eq!(names, expected);
    for number in 0..2 {
        let image = Image::with_channels(&seen, number, Channels::USUAL.iter());
        let key =
            |name: &str| if number == 0 { format!("{name}.npy") } else { format!("return1/{name}.npy") };
        for name in ["range", "Z", "intensity", "time"] {
            let (header, bytes) = &arrays[&key(name)];
            assert!(
                header.starts_with("{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3)"),
                "{header}"
            );
            assert_eq!(floats(bytes), image.f32(name).unwrap(), "{name}");
        }
        for name in ["cause", "id.instance", "id.semantic", "id.triangle"] {
            let (header, bytes) = &arrays[&key(name)];
            assert!(header.contains("'<u4'"), "{header}");
            let numbers: Vec<_> = bytes.chunks(4).map(|b| u32_at(b, 0)).collect();
            assert_eq!(numbers, image.u32(name).unwrap(), "{name}");
        }
        let (header, bytes) = &arrays[&key("normal")];
        assert!(header.contains("'shape': (2, 3, 3)"), "{header}");
        let y: Vec<f32> = floats(bytes).chunks(3).map(|n| n[1]).collect();
        assert_eq!(y, image.f32("normal.Y").unwrap());
    }
    let about: serde_json::Value = serde_json::from_slice(&arrays["about.npy"].1).unwrap();
    assert_eq!(about["arrays"]["return1/range"]["unit"], "m");
    assert_eq!(about["arrays"]["normal"]["shape"], serde_json::json!([2, 3, 3]));
    assert_eq!(about["world_from_sensor"]["position_m"], serde_json::json!([10.5, 19.75, 31.75]));
    let compressed = format("npz", ", compressed = true").encode(&seen).unwrap();
    assert_eq!(u32_at(&compressed, 8) & 0xffff, 8, "deflate");
}

#[test]
fn channels_are_chosen_for_all_formats_that_hold_them() {
    let (sensor, frame) = (camera(), frame());
    let seen = seen(&sensor, &frame);
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/room_vlp16.toml");
    let chosen = ["output.channels=[\"range\", \"normal.X\", \"id.semantic\"]".to_owned()];
    let with =
        |more: &str| load_job(&path, &[&chosen[..], &[more.to_owned()]].concat()).unwrap().output.formats;
    let formats = with("output.formats=[\"exr\", \"npz\"]");
    let exr = &read_exr(&formats[0].encode(&seen).unwrap(), u64::MAX).unwrap()[0].image;
    let names: Vec<_> = exr.channels.iter().map(|channel| channel.name.as_str()).collect();
    assert_eq!(names, ["id.semantic", "normal.X", "range"], "Y repeats Z, which is not chosen");
    let arrays = npz(&formats[1].encode(&seen).unwrap());
    let names: Vec<_> = arrays.keys().filter(|name| !name.contains('/')).map(String::as_str).collect();
    assert_eq!(names, ["about.npy", "id.semantic.npy", "normal.X.npy", "range.npy"]);
    // Fewer channels make smaller files, also in estimates.
    let of = |format: Format| format.file_bytes_a_ray(&sensor);
    assert_eq!((of(formats[0]), of(Format::EXR)), (3 * 4, 12 * 4));
    // All channels of a LiDAR's EXR are there as before.
    assert_eq!(
        Format::EXR.with_channels(Channels::USUAL).encode(&seen).unwrap(),
        Format::EXR.encode(&seen).unwrap()
    );
    let depth = Format::EXR.with_channels(Channels::named(["Z"]));
    let problem = depth.check(&lidar()).unwrap_err().to_string();
    assert_eq!(problem, "it has no channel Z");
}

/// A folder with a job of the room, whose `[output]` is the one given.
pub(super) struct Room(pub tempfile::TempDir);

impl Room {
    pub fn with(output: &str) -> Self {
        let room = Self(tempfile::tempdir().unwrap());
        let project = Path::new(env!("CARGO_MANIFEST_DIR"));
        fs::copy(project.join("scenes/room.glb"), room.0.path().join("room.glb")).unwrap();
        let job = format!(
            "scene = \"room.glb\"\n\n[[sensor]]\nname = \"top\"\npreset = \"velodyne/vlp-16\"\nrotating.columns = 36\n\
             pose.position_m = [0.0, 0.0, 1.2]\n\n[output]\ndir = \"out\"\n{output}\n"
        );
        fs::write(room.0.path().join("job.toml"), job).unwrap();
        room
    }

    pub fn run(&self, args: &[&str]) -> (i32, String) {
        let mut command = super::cli::program();
        let output = command.args(args).current_dir(self.0.path()).output().unwrap();
        (output.status.code().unwrap(), String::from_utf8(output.stderr).unwrap())
    }

    /// The answer of `lint` about the job, without the text of the job.
    pub fn lint(&self) -> (i32, String) {
        self.run(&["lint", "job.toml"])
    }
}

#[test]
fn a_format_is_a_name_or_a_table() {
    let names =
        |formats: &str| asked(formats).unwrap().output.formats.iter().map(|f| f.name()).collect::<Vec<_>>();
    assert_eq!(names("[\"npy\", { format = \"ply\" }, { format = \"pcd\" }]"), ["npy", "ply", "pcd"]);
    for format in Format::all() {
        let name = format.name();
        assert_eq!(names(&format!("[\"{name}\"]")), names(&format!("[{{ format = \"{name}\" }}]")));
    }
}

#[test]
fn a_wrong_option_is_told_with_its_place_and_what_would_be_right() {
    for (formats, told) in [
        ("[{ format = \"depth16\", scal = 1 }]", "did you mean `scale`?"),
        ("[{ format = \"depth16\", scale = 0 }]", "expected a number, from 0.1 to 100000"),
        ("[{ format = \"depth16\", scale = \"mm\" }]", "`scale` is the string \"mm\""),
        ("[{ format = \"exr\", scale = 1000 }]", "`scale` belongs in the format depth16"),
        ("[{ format = \"deph16\" }]", "did you mean \"depth16\"?"),
        ("[{ scale = 1000 }]", "a format has no `format`"),
        ("[{ format = 16 }]", "`format` is 16"),
        ("[\"depth16\", { format = \"depth16\", scale = 5000 }]", "`formats` lists \"depth16\" twice"),
        ("[{ format = \"labels\", bits = 12 }]", "expected 8 or 16"),
        ("[{ format = \"labels\", palette = 1 }]", "expected `true` or `false`"),
        ("[{ format = \"labels\", bits = 16, palette = true }]", "a palette has 8 bits: leave out `bits`"),
        ("[]", "expected at least one of"),
        ("\"exr\"", "expected a list of"),
    ] {
        let (code, text) = Room::with(&format!("formats = {formats}")).lint();
        assert!(code != 0 && text.contains(told) && text.contains("job.toml:"), "{formats}: {text}");
    }
}

#[test]
fn a_wrong_channel_is_told_with_the_right_one() {
    let (code, text) = Room::with("channels = [\"rnage\"]").lint();
    assert!(code != 0 && text.contains("did you mean \"range\"?"), "{text}");
    let (code, text) = Room::with("formats = [\"exr\"]\nchannels = [\"Z\"]").lint();
    assert!(code != 0 && text.contains("sensor \"top\" has no exr: it has no channel Z"), "{text}");
    let (code, text) = Room::with("formats = [\"ply\"]\nchannels = [\"range\"]").lint();
    assert!(code == 0 && text.contains("none of the formats holds channels"), "{text}");
    assert!(text.contains("the formats that hold channels are `exr`, `deep` and `npz`"), "{text}");
}

#[test]
fn what_a_depth_image_cannot_hold_is_told_by_lint_and_counted_by_scan() {
    let room = Room::with("formats = [{ format = \"depth16\", scale = 30000 }]");
    let (code, text) = room.lint();
    assert!(code == 0 && text.contains("ranges above 2.1845 m are written as 0"), "{text}");
    assert!(text.contains("job.toml:11"), "{text}");
    let (code, text) = room.run(&["scan", "job.toml"]);
    assert!(code == 0 && text.contains("top/000000.depth16.png has 0 for "), "{text}");
    assert!(room.0.path().join("out/top/000000.depth16.png").exists());
    let (code, _) = room.run(&["scan", "job.toml", "--overwrite", "--strict"]);
    assert!(code != 0);
    let (_, text) = Room::with("formats = [{ format = \"depth16\", scale = 256 }]").lint();
    assert!(!text.contains("written as 0"), "{text}");
}

#[test]
fn a_label_that_pixels_cannot_hold_is_refused_before_casting() {
    let room = Room::with("formats = [{ format = \"labels\", bits = 8 }]\n\n[labels]\nfloor = 256");
    for args in [&["lint", "job.toml"][..], &["scan", "job.toml", "--dry-run"]] {
        let (code, text) = room.run(args);
        assert!(code != 0 && text.contains("its labels are at most 255"), "{text}");
    }
}

/// Far from the origin, coordinates of 32 bits are coarse in every format of points.
#[test]
fn coarse_coordinates_are_told_of_all_clouds() {
    for (formats, is_told) in
        [("npy", true), ("pcd", true), ("ply", true), ("npz", false), ("las", false), ("e57", false)]
    {
        let room = Room::with(&format!("formats = [\"{formats}\"]\nframe = \"world\""));
        let far = "trajectory.pose.position_m=[5e5, 5e6, 0.0]";
        let (_, text) = room.run(&["scan", "job.toml", "--dry-run", "--set", far]);
        assert_eq!(
            text.contains("where 32-bit coordinates come in steps of 500 mm"),
            is_told,
            "{formats}: {text}"
        );
    }
}

/// Files of several formats of one kind lie beside each other, and a later run with fewer formats removes its own only.
#[test]
fn files_of_one_kind_lie_beside_each_other() {
    let room =
        Room::with("formats = [\"png\", \"depth16\", \"labels\", \"instances\", \"npy\", \"npz\", \"pcd\"]");
    let (code, text) = room.run(&["scan", "job.toml"]);
    assert_eq!(code, 0, "{text}");
    let files = || {
        let mut names: Vec<_> = fs::read_dir(room.0.path().join("out/top"))
            .unwrap()
            .map(|file| file.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    };
    let endings = ["depth16.png", "instances.png", "labels.png", "npy", "npz", "pcd", "png"];
    assert_eq!(files(), endings.map(|ending| format!("000000.{ending}")));
    fs::write(room.0.path().join("out/top/000000.mine.png"), b"mine").unwrap();
    let (code, text) = room.run(&["scan", "job.toml", "--overwrite", "--set", "output.formats=[\"npz\"]"]);
    assert_eq!(code, 0, "{text}");
    assert_eq!(files(), ["000000.mine.png", "000000.npz"]);
    // Nothing of the earlier run stays, and its folder does.
    fs::remove_file(room.0.path().join("out/top/000000.mine.png")).unwrap();
    let (code, text) = room.run(&["scan", "job.toml", "--overwrite", "--set", "output.formats=[\"pcd\"]"]);
    assert_eq!(code, 0, "{text}");
    assert_eq!(files(), ["000000.pcd"]);
}

#[test]
fn what_a_format_loses_of_several_sensors_is_told_once() {
    let room = Room::with("formats = [\"kitti\"]");
    let job = room.0.path().join("job.toml");
    let second = "[[sensor]]\nname = \"front\"\npreset = \"velodyne/vlp-16\"\npose.position_m = [0.0, 0.0, 1.5]\n\n[output]";
    let text = fs::read_to_string(&job).unwrap().replace("[output]", second);
    fs::write(&job, text).unwrap();
    let (_, said) = room.lint();
    assert_eq!(said.matches("kitti of sensor").count(), 1, "{said}");
    assert!(said.contains("kitti of sensors \"top\" and \"front\": the points have no time"), "{said}");
}
