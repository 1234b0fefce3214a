//! The targets of fuzzing: each reader of files, and the tracers against brute force. A target takes any bytes and must neither panic
//! nor take long; where two ways lead to one answer, it asserts that they agree.
//!
//! The tests of this folder and the coverage-guided driver in fuzz/ share these targets.

use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use beamcast::check::{Baseline, StoredPixels};
use beamcast::config::{self, Config};
use beamcast::glam::{DAffine3, DVec3};
use beamcast::import::{self, Source};
use beamcast::output::recorded::{
    Bag, Content, Recorded, read_e57, read_exr, read_las, read_npy, read_npz, read_pcd, read_ply,
    read_preview,
};
use beamcast::output::{Channels, Image, SensorFrame};
use beamcast::rng::Rng;
use beamcast::scene::gltf;
use beamcast::sensor::facts::SensorFacts;
use beamcast::trace::{BruteForce, Instructions};
use beamcast::{
    Capture, Cast, Format, Material, Origins, Progress, Rays, Scene, SceneBuilder, Sensor, SourceInstance,
    SourceMesh, SourcePart, Tracer, scan,
};

/// A thing to fuzz.
pub struct Target {
    pub name: &'static str,
    /// Takes any bytes.
    pub run: fn(&[u8]),
    /// Good inputs, from which others are made.
    pub seeds: fn() -> Vec<Vec<u8>>,
}

/// Every target.
pub const TARGETS: &[Target] = &[
    Target { name: "gltf", run: gltf, seeds: gltf_seeds },
    Target { name: "image", run: image, seeds: image_seeds },
    Target { name: "toml", run: toml, seeds: toml_seeds },
    Target { name: "rays", run: rays, seeds: || vec![repository("tests/import/rays.csv")] },
    Target { name: "import", run: import, seeds: import_seeds },
    Target { name: "exr", run: exr, seeds: || vec![frame_as(Format::EXR)] },
    Target { name: "ply", run: ply, seeds: ply_seeds },
    Target { name: "pcd", run: pcd, seeds: pcd_seeds },
    Target { name: "las", run: las, seeds: las_seeds },
    Target { name: "e57", run: e57, seeds: e57_seeds },
    Target { name: "mcap", run: mcap, seeds: mcap_seeds },
    Target { name: "npy", run: npy, seeds: npy_seeds },
    Target { name: "npz", run: npz, seeds: npz_seeds },
    Target { name: "preview", run: preview, seeds: || vec![frame_as(Format::PNG)] },
    Target { name: "manifest", run: manifest, seeds: manifest_seeds },
    Target { name: "baseline", run: baseline, seeds: baseline_seeds },
    Target { name: "tracers", run: tracers, seeds: tracers_seeds },
];

/// The most memory that a recorded file may take here.
const MEMORY: u64 = 256 << 20;

fn repository(file: &str) -> Vec<u8> {
    fs::read(root().join(file)).unwrap()
}

/// The root of the repository. The driver is built in a folder of it.
fn root() -> &'static Path {
    let built = Path::new(env!("CARGO_MANIFEST_DIR"));
    if built.ends_with("fuzz") { built.parent().unwrap() } else { built }
}

/// A folder of this process, for readers that take paths.
fn folder() -> &'static Path {
    static FOLDER: OnceLock<tempfile::TempDir> = OnceLock::new();
    FOLDER.get_or_init(|| tempfile::tempdir().unwrap()).path()
}

/// Writes a file into the folder. Threads have files of their own.
fn file(name: &str, bytes: &[u8]) -> PathBuf {
    let own = folder().join(format!("{:?}", std::thread::current().id()).replace(['(', ')'], ""));
    fs::create_dir_all(&own).unwrap();
    let path = own.join(name);
    fs::write(&path, bytes).unwrap();
    path
}

/// A ground and a wall before the sensor.
fn yard() -> &'static Scene {
    static YARD: OnceLock<Scene> = OnceLock::new();
    YARD.get_or_init(|| {
        let quad = |corners: [[f32; 3]; 4]| SourceMesh {
            positions: corners.to_vec(),
            parts: vec![SourcePart {
                triangles: vec![[0, 1, 2], [0, 2, 3]],
                material: 0,
                ..SourcePart::default()
            }],
        };
        let ground =
            quad([[-20.0, -20.0, -1.5], [20.0, -20.0, -1.5], [20.0, 20.0, -1.5], [-20.0, 20.0, -1.5]]);
        let wall = quad([[6.0, -3.0, -1.5], [6.0, 3.0, -1.5], [6.0, 3.0, 4.0], [6.0, -3.0, 4.0]]);
        built(vec![ground, wall]).unwrap()
    })
}

fn built(meshes: Vec<SourceMesh>) -> Option<Scene> {
    let placed =
        |mesh| SourceInstance { mesh, world_from_mesh: DAffine3::IDENTITY, ..SourceInstance::default() };
    let instances = (0..meshes.len()).map(placed).collect();
    SceneBuilder { meshes, instances, materials: vec![Material::default()], files: vec![], groups: vec![] }
        .build()
        .ok()
}

/// A small frame of the yard, in a format.
fn frame_as(format: Format) -> Vec<u8> {
    encoded(&small_sensor(), format).unwrap()
}

fn small_sensor() -> Sensor {
    config::load_preset("velodyne/vlp-16").map(|file| file.sensor).unwrap()
}

/// The first columns would do, but a sensor's frame is whole.
fn encoded(sensor: &Sensor, format: Format) -> Option<Vec<u8>> {
    let capture = Capture::at_origin(sensor);
    let frame = scan(yard(), &Tracer::build(yard()), &capture, &Progress::default())?;
    let seen = SensorFrame::new(capture, &frame, "top");
    let bytes = format.encode(&seen).ok()?;
    if format == Format::EXR {
        // The reader gets the values that were written.
        let image = &read_exr(&bytes, u64::MAX).unwrap()[0].image;
        assert_eq!((image.rows, image.columns), (sensor.pattern.rows(), sensor.pattern.columns()));
        let written = Image::of(&seen);
        assert_eq!(image.u32("id.semantic"), written.u32("id.semantic"));
    }
    Some(bytes)
}

fn gltf(bytes: &[u8]) {
    let path = file("scene.glb", bytes);
    if let Ok(loaded) = gltf::load(&path, "scene.glb", &gltf::Options::default()) {
        let scene = loaded.scene;
        let few = scene.geometry.movers.len() < 200;
        if scene.triangle_count() < 2000 && scene.arrangement.placements.len() < 200 && few {
            let centre = scene.geometry.centre;
            let directions: Vec<DVec3> = (0..16).map(|seed| Rng::new(seed).direction()).collect();
            let origin = centre + DVec3::new(0.3, 0.2, 0.1);
            agree(&scene, origin, &directions);
            if scene.has_movers() {
                agree(&scene.at(0.37), origin, &directions);
            }
        }
    }
}

fn gltf_seeds() -> Vec<Vec<u8>> {
    let json = r#"{"asset":{"version":"2.0"},"buffers":[{"byteLength":44,"uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAABAAIAAAA="}],
        "bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":6}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},{"bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1,"material":0,"mode":4,"targets":[{"POSITION":0}]}],"weights":[0.5]}],
        "materials":[{"name":"m","pbrMetallicRoughness":{"baseColorFactor":[1,0,0,1]}}],
        "nodes":[{"mesh":0,"children":[1],"translation":[1,2,3]},{"mesh":0,"rotation":[0,0,0,1],"scale":[1,-1,2],"extras":{"label":3}}],
        "scenes":[{"nodes":[0],"name":"s"}],"scene":0}"#;
    let animated = r#"{"asset":{"version":"2.0"},"buffers":[{"byteLength":198,"uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAABAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAIA/AAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAACAPwABAAAAAQAAAAEAAIB/AACAfwAAgH8AAAEA"}],
        "bufferViews":[{"buffer":0,"byteOffset":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":8},{"buffer":0,"byteOffset":44,"byteLength":24},{"buffer":0,"byteOffset":68,"byteLength":96},{"buffer":0,"byteOffset":164,"byteLength":8},{"buffer":0,"byteOffset":172,"byteLength":12},{"buffer":0,"byteOffset":184,"byteLength":12},{"buffer":0,"byteOffset":196,"byteLength":2}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},{"bufferView":1,"componentType":5126,"count":2,"type":"SCALAR"},{"bufferView":2,"componentType":5126,"count":2,"type":"VEC3"},{"bufferView":3,"componentType":5126,"count":6,"type":"VEC4"},{"bufferView":4,"componentType":5126,"count":2,"type":"SCALAR"},{"bufferView":5,"componentType":5121,"count":3,"type":"VEC4"},{"bufferView":6,"componentType":5121,"normalized":true,"count":3,"type":"VEC4"},{"bufferView":7,"componentType":5121,"count":2,"type":"SCALAR"}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0,"JOINTS_0":5,"WEIGHTS_0":6},"targets":[{"POSITION":0}]}]}],"skins":[{"joints":[1,2]}],
        "nodes":[{"mesh":0,"skin":0},{"children":[2,3]},{"translation":[0,1,0]},{"mesh":0}],
        "animations":[{"name":"a","channels":[{"sampler":0,"target":{"node":1,"path":"translation"}},{"sampler":1,"target":{"node":2,"path":"rotation"}},{"sampler":2,"target":{"node":3,"path":"weights"}},{"sampler":3,"target":{"path":"pointer","extensions":{"KHR_animation_pointer":{"pointer":"/nodes/3/extensions/KHR_node_visibility/visible"}}}}],
        "samplers":[{"input":1,"output":2},{"input":1,"output":3,"interpolation":"CUBICSPLINE"},{"input":1,"output":4},{"input":1,"output":7,"interpolation":"STEP"}]}]}"#;
    let [room, walker] = ["scenes/room.glb", "scenes/actors/walker.glb"].map(repository);
    vec![json.as_bytes().to_vec(), animated.as_bytes().to_vec(), room, walker]
}

/// A triangle with the image as its texture. An image that can't be read is white, and no more.
fn image(bytes: &[u8]) {
    file("image", bytes);
    let json = r#"{"asset":{"version":"2.0"},"buffers":[{"byteLength":60,"uri":"data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAIA/AAAAAAAAAAAAAIA/"}],
        "bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":24}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},{"bufferView":1,"componentType":5126,"count":3,"type":"VEC2"}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0,"TEXCOORD_0":1},"material":0}]}],"nodes":[{"mesh":0}],
        "materials":[{"alphaMode":"BLEND","pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}],
        "textures":[{"source":0}],"images":[{"uri":"image"}]}"#;
    let path = file("scene.gltf", json.as_bytes());
    let scene = gltf::load(&path, "scene.gltf", &gltf::Options::default()).unwrap().scene;
    for (u, v) in [(0.0, 0.0), (0.3, 0.3), (1.0, 0.0), (0.0, 1.0)] {
        let look = scene.appearance(0, 0, u, v);
        let values = [look.opacity, look.reflectivity(), look.metallic, look.roughness, look.transmission];
        assert!(values.iter().chain(&look.base_color).all(|value| (0.0..=1.0).contains(value)), "{look:?}");
    }
}

/// A PNG, and a JPEG and a WebP of one colour.
fn image_seeds() -> Vec<Vec<u8>> {
    let code = |class: u8, symbol: u8| [&[0xff, 0xc4, 0, 20, class, 1][..], &[0; 15], &[symbol]].concat();
    let jpeg = [
        b"\xff\xd8\xff\xdb\0\x43\0",
        &[8; 64][..],
        b"\xff\xc0\0\x0b\x08\0\x08\0\x08\x01\x01\x11\0",
        &code(0x00, 7),
        &code(0x10, 0),
        b"\xff\xda\0\x08\x01\x01\0\0\x3f\0\x40\x7f\xff\xd9",
    ];
    let webp = b"RIFF\x14\0\0\0WEBPVP8L\x08\0\0\0\x2f\x01\0\0\x10\x88\x88\x08";
    vec![frame_as(Format::PNG), jpeg.concat(), webp.to_vec()]
}

fn preview(bytes: &[u8]) {
    if let Ok(picture) = read_preview(bytes, MEMORY) {
        assert_eq!(picture.pixels.len(), 3 * picture.width * picture.height);
    }
}

fn toml(bytes: &[u8]) {
    let path = file("job.toml", bytes);
    let scene = r#"{"asset":{"version":"2.0"}}"#;
    file("room.glb", scene.as_bytes());
    match config::load(&path, &[]) {
        Ok(Config::Sensor(sensor)) => sensor_works(&sensor.sensor),
        Ok(Config::Job(job)) => job.sensors.iter().for_each(|mounted| sensor_works(&mounted.sensor)),
        Err(_) => {}
    }
}

/// Checks that what follows from a sensor's numbers are numbers.
fn sensor_works(sensor: &Sensor) {
    let facts = SensorFacts::of(sensor);
    assert!(facts.frame_s.is_finite() && facts.horizontal_fov_deg.is_finite(), "{facts:?}");
    if facts.rays_per_frame > 3000 {
        return;
    }
    let capture = Capture::at_origin(sensor);
    for row in 0..facts.rows {
        for column in 0..facts.columns {
            let Some(pulse) = capture.pulse(row, column) else { continue };
            assert!((pulse.direction.length() - 1.0).abs() < 1e-6, "{pulse:?}");
            assert!(pulse.origin.is_finite() && pulse.time_s.is_finite(), "{pulse:?}");
        }
    }
    for format in Format::all().filter(|format| format.check(sensor).is_ok()) {
        encoded(sensor, format);
    }
}

fn toml_seeds() -> Vec<Vec<u8>> {
    let patterns =
        ["equirectangular", "fisheye", "mirror", "pinhole", "raster", "risley", "rotating", "spaced", "job"];
    patterns.iter().map(|name| repository(&format!("tests/schema/{name}.toml"))).collect()
}

fn rays(bytes: &[u8]) {
    file("rays.csv", bytes);
    let path = file("sensor.toml", b"[rays]\nfile = \"rays.csv\"\n");
    if let Ok(sensor) = config::load_sensor(&path) {
        sensor_works(&sensor.sensor);
    }
}

/// The first byte chooses the format.
fn import(bytes: &[u8]) {
    let Some((&first, rest)) = bytes.split_first() else { return };
    let Ok(text) = std::str::from_utf8(rest) else { return };
    let recognised = import::Format::of(text);
    let chosen = import::Format::ALL[first as usize % import::Format::ALL.len()];
    for format in recognised.into_iter().chain([chosen]) {
        let Ok(sensor) = import::import(format, Source { name: "a.file", text }, None) else { continue };
        if format != import::Format::Rays {
            // One end reads what the other writes.
            let read = config::load_sensor(&file("imported.toml", sensor.as_bytes()));
            assert!(read.is_ok(), "{format:?}: {:?}\n{sensor}", read.err());
        }
    }
}

fn import_seeds() -> Vec<Vec<u8>> {
    let files = [
        "ouster_flat.json",
        "ouster_nested.json",
        "velodyne.yaml",
        "hesai_angles.csv",
        "hesai_loops.csv",
        "robosense.csv",
        "camera_info.yaml",
        "opencv.yaml",
        "opencv_fisheye.yaml",
        "rays.csv",
    ];
    let chosen = [0, 0, 1, 2, 2, 3, 4, 4, 4, 5];
    let seed =
        |(file, first): (&&str, u8)| [vec![first], repository(&format!("tests/import/{file}"))].concat();
    files.iter().zip(chosen).map(seed).collect()
}

fn exr(bytes: &[u8]) {
    for part in read_exr(bytes, MEMORY).unwrap_or_default() {
        assert!(part.image.channels.iter().all(|c| c.samples.len() == part.image.pixels()));
    }
}

fn ply(bytes: &[u8]) {
    if let Ok(cloud) = read_ply(bytes, MEMORY) {
        assert!(cloud.fields.iter().all(|field| field.values.len() == cloud.points));
    }
}

fn ply_seeds() -> Vec<Vec<u8>> {
    let mut short = frame_as(Format::PLY);
    short.truncate(4000);
    let text = "ply\nformat ascii 1.0\ncomment c\nelement vertex 2\nproperty float x\nproperty uchar y\nend_header\n1 2\n3 4\n";
    vec![short, text.as_bytes().to_vec()]
}

fn pcd(bytes: &[u8]) {
    if let Ok(cloud) = read_pcd(bytes, MEMORY) {
        assert!(cloud.fields.iter().all(|field| field.values.len() == cloud.points));
    }
}

/// A cloud of ours, and small ones in each encoding.
fn pcd_seeds() -> Vec<Vec<u8>> {
    let header = "VERSION 0.7\nFIELDS x y _ label\nSIZE 4 4 1 2\nTYPE F F U I\nCOUNT 1 2 3 1\nWIDTH 2\nHEIGHT 1\n\
                  VIEWPOINT 0 0 0 1 0 0 0\nPOINTS 2\nDATA ";
    let text = format!("# .PCD v0.7\n# c\n{header}ascii\n1 2 3 0 0 0 4\nnan -1e9 3 0 0 0 4\n");
    let binary = [header.as_bytes(), b"binary\n", &[0x40; 34]].concat();
    let five = header.replace("WIDTH 2", "WIDTH 5").replace("POINTS 2", "POINTS 5").replace("_ label", "_ _");
    // The lengths of what is compressed and of what it becomes; one byte, and 59 that are like it.
    let packed = [5, 0, 0, 0, 60, 0, 0, 0, 0, 0x40, 7 << 5, 50, 0];
    let compressed = [five.as_bytes(), b"binary_compressed\n", &packed].concat();
    let mut ours = frame_as(format("pcd"));
    ours.truncate(4000);
    vec![ours, text.into_bytes(), binary, compressed]
}

fn las(bytes: &[u8]) {
    if let Ok(cloud) = read_las(bytes, MEMORY) {
        assert!(cloud.fields.iter().all(|field| field.values.len() == cloud.points));
    }
}

/// The few points of a small camera, as they are and compressed.
fn las_seeds() -> Vec<Vec<u8>> {
    let path = file("small.toml", b"[pinhole]\nwidth_px = 8\nheight_px = 4\nhfov_deg = 60.0\n");
    let sensor = config::load_sensor(&path).unwrap().sensor;
    ["las", "laz"].map(|name| encoded(&sensor, format(name)).unwrap()).into()
}

/// The pages of the file get the checksums of what they have, because no change of a byte would get past them.
fn e57(bytes: &[u8]) {
    let mut bytes = bytes.to_vec();
    for page in bytes.chunks_exact_mut(1024) {
        let sum = crc32c(&page[..1020]).to_be_bytes();
        page[1020..].copy_from_slice(&sum);
    }
    if let Ok(cloud) = read_e57(&bytes, MEMORY) {
        assert!(cloud.fields.iter().all(|field| field.values.len() == cloud.points));
    }
}

/// CRC-32C, bit by bit.
fn crc32c(bytes: &[u8]) -> u32 {
    let step = |sum: u32| (sum >> 1) ^ (0x82f6_3b78 & (sum & 1).wrapping_neg());
    !bytes.iter().fold(!0, |sum, byte| (0..8).fold(sum ^ u32::from(*byte), |sum, _| step(sum)))
}

/// The few points of a small camera.
fn e57_seeds() -> Vec<Vec<u8>> {
    let path = file("small.toml", b"[pinhole]\nwidth_px = 8\nheight_px = 4\nhfov_deg = 60.0\n");
    let sensor = config::load_sensor(&path).unwrap().sensor;
    let seed = encoded(&sensor, format("e57")).unwrap();
    assert!(read_e57(&seed, MEMORY).is_ok());
    vec![seed]
}

fn mcap(bytes: &[u8]) {
    let Ok(mut bag) = Bag::open(Cursor::new(bytes.to_vec()), MEMORY) else { return };
    assert!(bag.topics().iter().all(|topic| (topic.messages == 0) == topic.times_ns.is_none()));
    assert_eq!(bag.frames().len(), bag.topics().len());
    for topic in 0..bag.topics().len() {
        for number in 0..bag.messages(topic).min(4) {
            match bag.read(topic, number).map(|message| message.content) {
                Ok(Content::Cloud(cloud)) => {
                    assert!(cloud.fields.iter().all(|field| field.values.len() == cloud.points))
                }
                Ok(Content::Depth(part)) => {
                    assert!(part.image.channels.iter().all(|c| c.samples.len() == part.image.pixels()))
                }
                Err(_) => {}
            }
        }
    }
}

/// A topic of two depth images, one of which is in a chunk, and the same chunk compressed.
fn mcap_seeds() -> Vec<Vec<u8>> {
    let record =
        |opcode: u8, content: &[u8]| [&[opcode], &(content.len() as u64).to_le_bytes()[..], content].concat();
    // A pixel of 1 m, in the frame "f".
    let image = b"\0\x01\0\0\x07\0\0\0\x01\0\0\0\x02\0\0\0f\0\0\0\x01\0\0\0\x01\0\0\0\x06\0\0\0\x31\x36UC1\0\0\0\x02\0\0\0\x02\0\0\0\xe8\x03";
    let message = record(5, &[&[1, 0][..], &[0; 20], image].concat());
    let kind = b"sensor_msgs/msg/Image";
    let schema =
        record(3, &[&[1, 0, kind.len() as u8, 0, 0, 0][..], kind, b"\x07\0\0\0ros2msg\0\0\0\0"].concat());
    let channel = record(4, b"\x01\0\x01\0\x02\0\0\0/t\x03\0\0\0cdr\0\0\0\0");
    let inside = [schema, channel, message.clone()].concat();
    // A frame of Zstandard without a checksum, whose one block has the bytes as they are.
    let length = inside.len() as u32;
    let zstd = [
        b"\x28\xb5\x2f\xfd\xa0".as_slice(),
        &length.to_le_bytes(),
        &(length << 3 | 1).to_le_bytes()[..3],
        &inside,
    ]
    .concat();
    let chunk = |compression: &str, packed: &[u8]| {
        let name = compression.as_bytes();
        let content = [
            &[0; 16][..],
            &(inside.len() as u64).to_le_bytes(),
            &[0; 4],
            &(name.len() as u32).to_le_bytes(),
            name,
            &(packed.len() as u64).to_le_bytes(),
            packed,
        ];
        record(6, &content.concat())
    };
    let file = |chunk: Vec<u8>| {
        [b"\x89MCAP0\r\n".as_slice(), &chunk, &message, &record(2, &[0; 20]), b"\x89MCAP0\r\n"].concat()
    };
    let seeds = vec![file(chunk("", &inside)), file(chunk("zstd", &zstd))];
    for seed in &seeds {
        let mut bag = Bag::open(Cursor::new(seed.clone()), MEMORY).unwrap();
        assert_eq!((bag.topics()[0].name.as_str(), bag.topics()[0].messages), ("/t", 2));
        assert!([0, 1].iter().all(|number| bag.read(0, *number).is_ok()));
    }
    seeds
}

fn npy(bytes: &[u8]) {
    if let Ok(cloud) = read_npy(bytes, MEMORY) {
        assert!(cloud.fields.iter().all(|field| field.values.len() == cloud.points));
    }
}

fn npy_seeds() -> Vec<Vec<u8>> {
    let header = b"{'descr': [('x', '<f4'), ('', '|V2'), (('t', 'label'), '>i2'), ('n', '<f8', (2,))], 'fortran_order': False, 'shape': (2,), }\n";
    let small =
        [b"\x93NUMPY\x01\x00", &(header.len() as u16).to_le_bytes()[..], header, &[0x40; 48]].concat();
    let mut ours = frame_as(format("npy"));
    ours.truncate(4000);
    vec![ours, small]
}

fn npz(bytes: &[u8]) {
    for part in read_npz(bytes, MEMORY).unwrap_or_default() {
        assert!(part.image.channels.iter().all(|c| c.samples.len() == part.image.pixels()));
    }
}

/// A small frame, as it is and compressed.
fn npz_seeds() -> Vec<Vec<u8>> {
    let few = Channels::named(["range", "id.instance", "normal.X", "normal.Y", "normal.Z"]);
    let small =
        "[rotating]\nelevations_deg = [0.0, -5.0]\ncolumns = 3\nrate_hz = 10.0\n[range]\nmax_m = 50.0\n";
    let path = file("small.toml", small.as_bytes());
    let sensor = config::load_sensor(&path).map_or_else(|e| panic!("{e:?}"), |file| file.sensor);
    let npz = format("npz").with_channels(few);
    let compressed = npz.spec.options.iter().find(|option| option.name == "compressed").unwrap();
    vec![encoded(&sensor, npz).unwrap(), encoded(&sensor, npz.with(compressed, 1.0)).unwrap()]
}

/// The format of this name.
fn format(name: &str) -> Format {
    Format::named(name).unwrap()
}

fn manifest(bytes: &[u8]) {
    let path = file("manifest.json", bytes);
    if let Ok(Recorded::Folder(folder)) = Recorded::open(&path, MEMORY) {
        for output in folder.outputs().take(10) {
            // There is nothing to be read in this folder but what other targets write.
            let _ = folder.read(output, MEMORY);
        }
    }
}

fn manifest_seeds() -> Vec<Vec<u8>> {
    let text = r#"{"tool":{"name":"beamcast","version":"0.1.0"},"seed":0,"job":{"scene":"a.glb","sensor":[{"name":"top"}]},
        "inputs":[{"name":"job.toml","bytes":5,"blake3":"ab"}],
        "scene":{"triangles":2,"instances":[{"id":0,"name":"a"}],"materials":[]},
        "outputs":[{"path":"top/000000.exr","bytes":9,"blake3":"cd"},{"path":"top/000000.ply","bytes":9,"blake3":"cd"}]}"#;
    vec![text.as_bytes().to_vec()]
}

/// A record, a zero byte, and the pixels.
fn baseline(bytes: &[u8]) {
    let at = bytes.iter().position(|&b| b == 0).unwrap_or(bytes.len());
    let (record, pixels) = bytes.split_at(at);
    let Ok(baseline) = Baseline::decode(record) else { return };
    let again = Baseline::decode(&baseline.encode());
    assert_eq!(again.unwrap(), baseline);
    for sensor in
        baseline.sensors.iter().filter(|sensor| sensor.rows.saturating_mul(sensor.columns) < 100_000)
    {
        if let Some(stored) = StoredPixels::unpack(pixels.get(1..).unwrap_or_default(), sensor) {
            assert!(stored.image.channels.iter().all(|c| c.samples.len() == stored.image.pixels()));
        }
    }
}

fn baseline_seeds() -> Vec<Vec<u8>> {
    let folder = "configs/room_vlp16.baseline";
    let record = repository(&format!("{folder}/baseline.json"));
    let pixels = fs::read_dir(root().join(folder)).unwrap();
    let pixels =
        pixels.map(|entry| entry.unwrap().path()).find(|path| path.extension() == Some("pixels".as_ref()));
    vec![[record, vec![0], fs::read(pixels.unwrap()).unwrap()].concat()]
}

/// Triangles, then rays, as floats of any bits, and rays as doubles of any bits. What is no number becomes 1.
fn tracers(bytes: &[u8]) {
    let Some((&count, rest)) = bytes.split_first() else { return };
    let floats: Vec<f32> = rest.as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
    let usable = |x: f32| if x.is_finite() { x } else { 1.0 };
    let points: Vec<[f32; 3]> = floats.as_chunks().0.iter().map(|p: &[f32; 3]| p.map(usable)).collect();
    let triangles = usize::from(count % 64) + 1;
    if points.len() < 3 * triangles + 2 {
        return;
    }
    let (corners, rays) = points.split_at(3 * triangles);
    let part = SourcePart {
        triangles: (0..triangles as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        ..SourcePart::default()
    };
    let Some(scene) = built(vec![SourceMesh { positions: corners.to_vec(), parts: vec![part] }]) else {
        return;
    };
    let vector = |p: &[f32; 3]| DVec3::from_array(p.map(f64::from));
    let origin = vector(&rays[0]);
    let mut directions: Vec<DVec3> = rays[1..].iter().take(64).map(vector).collect();
    let doubles: Vec<f64> = rest.as_chunks().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
    directions.extend(doubles.as_chunks().0.iter().take(32).map(|d: &[f64; 3]| DVec3::from_array(*d)));
    directions.retain(|d| d.is_finite() && *d != DVec3::ZERO);
    // At corners and along edges the answer hangs by the last bit.
    directions.extend(corners.iter().take(32).map(|p| vector(p) - origin).filter(|d| *d != DVec3::ZERO));
    if !directions.is_empty() {
        agree(&scene, origin, &directions);
    }
}

fn tracers_seeds() -> Vec<Vec<u8>> {
    let floats = |count: u8, values: &mut dyn Iterator<Item = f32>| {
        [vec![count], values.flat_map(f32::to_le_bytes).collect()].concat()
    };
    let soup = |i: u32| (i.wrapping_mul(2_654_435_761) >> 8) as f32 / 1e6 - 8.0;
    vec![
        floats(5, &mut (0..18 * 3 + 24).map(soup)),
        floats(31, &mut (0..32 * 9 + 40).map(|i| soup(i).round())),
        floats(
            0,
            &mut [1.0, 1.0, 0.0, 1.0, -1.0, 0.0, 1.0, 0.0, 2.0, 0.0, 0.0, 0.5, 1.0, 0.0, 0.0].into_iter(),
        ),
    ]
}

/// Asserts that each tracer finds what brute force finds.
fn agree(scene: &Scene, origin: DVec3, directions: &[DVec3]) {
    let rays = Rays::unlimited(Origins::Common(origin), directions);
    let hits = |tracer: &dyn Cast| {
        let mut hits = vec![None; directions.len()];
        tracer.cast(&rays, &mut hits);
        hits
    };
    let expected = hits(&BruteForce(scene));
    let tracer = |kind| Tracer::build(scene).with_instructions(kind);
    for kind in [Instructions::Best, Instructions::Portable, Instructions::Scalar] {
        assert_eq!(hits(&tracer(kind)), expected, "{kind:?}, packets, from {origin}");
        assert_eq!(hits(&tracer(kind).ray_by_ray()), expected, "{kind:?}, ray by ray, from {origin}");
    }
}
