//! What is too near or too far, through the command line: files, summaries, expectations and baselines. The closed forms are
//! those of boxes and planes.

use std::fs;
use std::path::PathBuf;
use std::process::Output;

use beamcast::output::Image;
use beamcast::output::recorded::read_exr;
use serde_json::{Value, json};
use tempfile::TempDir;

/// A box: its name, and its least and its largest corner in the world.
type Box = (&'static str, [f32; 3], [f32; 3]);

/// A folder with a scene of boxes and a job.
struct Place(TempDir);

impl Place {
    fn new(boxes: &[Box], job: &str) -> Self {
        let place = Self(tempfile::tempdir().unwrap());
        place.set_scene(boxes);
        place.set_job(job);
        place
    }

    fn set_job(&self, job: &str) {
        let text = format!(
            "scene = \"scene.gltf\"\nup = \"y\"\n{job}\n[output]\ndir = \"out\"\nformats = [\"exr\", \"ply\"]\n"
        );
        fs::write(self.path("job.toml"), text).unwrap();
    }

    /// The boxes share a cube, which their nodes stretch and move.
    fn set_scene(&self, boxes: &[Box]) {
        let corner = |i: usize| [0, 1, 2].map(|axis| if i >> axis & 1 == 0 { 0.0_f32 } else { 1.0 });
        let faces: [[u16; 4]; 6] =
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let mut buffer: Vec<u8> = (0..8).flat_map(corner).flat_map(f32::to_le_bytes).collect();
        let triangles = faces.iter().flat_map(|&[a, b, c, d]| [a, b, c, a, c, d]);
        buffer.extend(triangles.flat_map(u16::to_le_bytes));
        fs::write(self.path("scene.bin"), &buffer).unwrap();
        let nodes: Vec<Value> = boxes
            .iter()
            .map(|(name, low, high)| {
                let size = [0, 1, 2].map(|axis| high[axis] - low[axis]);
                json!({ "name": name, "mesh": 0, "translation": low, "scale": size })
            })
            .collect();
        let gltf = json!({
            "asset": { "version": "2.0" },
            "buffers": [{ "uri": "scene.bin", "byteLength": buffer.len() }],
            "bufferViews": [
                { "buffer": 0, "byteLength": 96 },
                { "buffer": 0, "byteOffset": 96, "byteLength": buffer.len() - 96 },
            ],
            "accessors": [
                { "bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 1] },
                { "bufferView": 1, "componentType": 5123, "count": 36, "type": "SCALAR" },
            ],
            "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
            "nodes": nodes,
            "scenes": [{ "nodes": (0..boxes.len()).collect::<Vec<_>>() }],
            "scene": 0,
        });
        fs::write(self.path("scene.gltf"), gltf.to_string()).unwrap();
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn run(&self, args: &[&str]) -> Output {
        let mut command = super::cli::program();
        command.args(args).current_dir(self.0.path());
        command.output().unwrap()
    }

    fn fine(&self, args: &[&str]) -> Output {
        let output = self.run(args);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        output
    }

    /// What a check says that fails.
    fn failed_check(&self) -> String {
        let output = self.run(&["check", "job.toml"]);
        let text = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
        assert_eq!(output.status.code(), Some(1), "{text}");
        text
    }

    /// The image of the job's sensor, and the summary of the scan.
    fn scan(&self) -> (Image, Value) {
        let output = self.fine(&["scan", "job.toml", "--overwrite", "--json"]);
        let bytes = fs::read(self.path("out/c/000000.exr")).unwrap();
        let mut parts = read_exr(&bytes, u64::MAX).unwrap();
        assert_eq!(
            parts[0].attributes["beamcast:cause"],
            "0 no_pulse, 1 surface, 2 nothing, 3 too_near, 4 out_of_range"
        );
        (parts.remove(0).image, serde_json::from_slice(&output.stdout).unwrap())
    }
}

fn count(image: &Image, cause: u32) -> usize {
    image.u32("cause").unwrap().iter().filter(|of_pixel| **of_pixel == cause).count()
}

const HALL: Box = ("hall", [-10.0; 3], [10.0; 3]);
/// A post ahead. Of one column a degree, those at azimuths from −19 to 19° meet it: atan(0.0525 / 0.15) = 19.3°.
const POST: Box = ("own_mast", [0.15, -0.0525, -1.0], [0.25, 0.0525, 1.0]);
const LEVEL: &str =
    "[[sensor]]\nname = \"c\"\n[sensor.rotating]\nelevations_deg = [0.0]\ncolumns = 360\nrate_hz = 10.0\n";
const CAMERA: &str = "[[sensor]]\nname = \"c\"\n[sensor.pinhole]\nwidth_px = 16\nheight_px = 12\n";

/// The case min_range_wholly_inside: a mast in the dead zone hides what is behind it, and obstructs.
#[test]
fn a_mast_nearer_than_the_least_range_hides_the_wall_and_obstructs() {
    let expect = "[[expect]]\nname = \"clear\"\nunobstructed = { object = \"own_mast\", at_most = 0.0 }\n";
    let job = format!("{LEVEL}[sensor.range]\nmin_m = 0.3\n{expect}");
    let place = Place::new(&[HALL, POST], &job);
    let (image, summary) = place.scan();
    let ranges = image.f32("range").unwrap();
    // Column 180 looks ahead, and columns are a degree apart.
    for (column, range) in ranges.iter().enumerate() {
        let blocked = column.abs_diff(180) <= 19;
        assert_eq!(image.u32("cause").unwrap()[column], if blocked { 3 } else { 1 }, "column {column}");
        assert!(if blocked { range.is_infinite() } else { (9.999..14.143).contains(range) }, "{range}");
    }
    let sensor = &summary["sensors"][0];
    let counts = ["rays", "hits", "too_near", "out_of_range", "nothing"].map(|key| sensor[key].as_u64());
    assert_eq!(counts, [360, 321, 39, 0, 0].map(Some));
    let said = place.fine(&["scan", "job.toml", "--overwrite"]).stderr;
    let said = String::from_utf8(said).unwrap();
    assert!(said.contains("321 hits (89.2 %), 39 blocked nearer than its least range"), "{said}");

    let text = place.failed_check();
    assert!(
        text.contains(
            "clear: expected at most 0 % of the rays hit \"own_mast\", found 10.8 % of the rays hit it, 10.8 % of the rays nearer \
             than the sensor's least range (sensor c: azimuth -19.0° to 19.0°, elevation 0.0° to 0.0°)"
        ),
        "{text}"
    );
    // Other expectations say where the missing points are.
    let others = "[[expect]]\nname = \"seen\"\npoints = { object = \"own_mast\", at_least = 1 }\n\
                  [[expect]]\nname = \"all\"\nreturns = { at_least = 1.0 }\n";
    place.set_job(&format!("{LEVEL}[sensor.range]\nmin_m = 0.3\n{others}"));
    let text = place.failed_check();
    assert!(text.contains("found 0 points, 39 beams nearer than the sensor's least range"), "{text}");
    assert!(
        text.contains(
            "found 89.2 % of the rays return, 10.8 % are blocked nearer than the sensor's least range"
        ),
        "{text}"
    );
    // The same mast beyond the least range obstructs in the same words as ever, and other things obstruct nothing.
    place.set_job(&job.replace("min_m = 0.3", "min_m = 0.1"));
    let text = place.failed_check();
    assert!(text.contains("found 10.8 % of the rays hit it (sensor c"), "{text}");
    place.set_job(&job.replace("\"own_mast\"", "\"hall\"").replace("at_most = 0.0", "at_most = 0.9"));
    place.fine(&["check", "job.toml"]);
}

/// The case cam_min_range: a plate before a camera leaves it blind. The plate is square to it, so that its depth is 0.2 m all
/// over the image, and its range is more in the corners.
#[test]
fn a_plate_before_a_camera_leaves_it_blind() {
    let plate = ("plate", [0.2, -1.0, -1.0], [0.21, 1.0, 1.0]);
    let place =
        Place::new(&[HALL, plate], &format!("{CAMERA}hfov_deg = 60.0\n[sensor.range]\nmin_m = 0.3\n"));
    let (image, summary) = place.scan();
    assert_eq!((count(&image, 3), count(&image, 1)), (192, 0));
    assert!(image.f32("Z").unwrap().iter().all(|z| z.is_infinite()));
    assert_eq!(summary["sensors"][0]["too_near"], 192);
}

/// The case cam_max_range_planar: limits of depth, 0.3 to 5.5 m, and a wall at 5 m.
#[test]
fn limits_of_depth_are_those_of_a_plane() {
    let wall = ("wall", [5.0, -50.0, -50.0], [5.1, 50.0, 50.0]);
    let job = |of: &str, min_m: f64, max_m: f64| {
        format!("{CAMERA}hfov_deg = 87.0\n[sensor.range]\n{of}min_m = {min_m}\nmax_m = {max_m}\n")
    };
    // A pinhole camera's limits are of depth, unless it says otherwise.
    let (depth, range) = ("of = \"depth\"\n", "of = \"range\"\n");
    let place = Place::new(&[wall], &job(depth, 0.3, 5.5));
    let seen = |job: &str| {
        place.set_job(job);
        let (image, _) = place.scan();
        [1, 2, 3, 4].map(|cause| count(&image, cause))
    };
    assert_eq!(seen(&job("", 0.3, 5.5)), [192, 0, 0, 0]);
    assert_eq!(seen(&job(depth, 0.3, 5.5)), [192, 0, 0, 0]);
    // Along the ray only the middle of the image is within 5.5 m: 52 pixels have 1/cos < 1.1.
    assert_eq!(seen(&job(range, 0.3, 5.5)), [52, 0, 0, 140]);
    // The limits are included. 5 is an f32, so that the wall is where it is meant to be, and Z is 5 within an ulp.
    assert_eq!(seen(&job("", 5.000001, 9.0)), [0, 0, 192, 0]);
    assert_eq!(seen(&job("", 0.3, 4.999999)), [0, 0, 0, 192]);
    assert_eq!(seen(&job("", 4.999999, 5.000001)), [192, 0, 0, 0]);
    assert_eq!(seen(&job(range, 5.5, 99.0)), [140, 0, 52, 0]);
}

/// A fisheye that looks sideways and behind has no depth there: what it meets there is not within limits of depth.
#[test]
fn a_ray_at_a_right_angle_to_the_axis_has_no_depth() {
    let job = "[[sensor]]\nname = \"c\"\n[sensor.fisheye]\nwidth_px = 40\nheight_px = 40\nhfov_deg = 200.0\n[sensor.range]\n";
    let place = Place::new(&[HALL], &format!("{job}of = \"depth\"\nmin_m = 0.1\nmax_m = 20.0\n"));
    let (image, _) = place.scan();
    place.set_job(&format!("{job}max_m = 20.0\n"));
    let (along, _) = place.scan();
    let (depth, cause) = (along.f32("Z").unwrap(), image.u32("cause").unwrap());
    let mut behind = 0;
    for (pixel, z) in depth.iter().enumerate().filter(|(_, z)| z.is_finite()) {
        assert_eq!(cause[pixel], if *z < 0.1 { 3 } else { 1 }, "pixel {pixel}: {z} m");
        behind += usize::from(*z < 0.0);
    }
    assert!(behind > 50, "{behind}");
}

/// The case camera_depth_limit: data sheets of depth cameras state limits of Z, and the built-in cameras say so.
#[test]
fn built_in_depth_cameras_have_limits_of_depth() {
    for (preset, max_m) in [
        ("realsense/d415", 10.0),
        ("realsense/d435", 10.0),
        ("realsense/d455", 10.0),
        ("luxonis/oak-d", 12.0),
        ("stereolabs/zed-2", 20.0),
        ("kinect/v1", 4.0),
        ("kinect/v2", 4.5),
        ("azure/kinect", 3.86),
    ] {
        let at = max_m * 0.98_f32;
        let job = format!("[[sensor]]\nname = \"c\"\npreset = \"{preset}\"\n");
        let place = Place::new(&[("wall", [at, -90.0, -90.0], [at + 0.1, 90.0, 90.0])], &job);
        let (image, _) = place.scan();
        let rays = image.pixels() - count(&image, 0);
        assert_eq!((count(&image, 1), rays > image.pixels() * 9 / 10), (rays, true), "{preset}");
        let lint = String::from_utf8(place.fine(&["lint", "job.toml"]).stdout).unwrap();
        assert!(lint.contains(&format!("m to {max_m} m of depth")), "{lint}");
    }
}

#[test]
fn only_a_camera_has_a_depth_to_limit() {
    let limits = "[sensor.range]\nof = \"depth\"\nmax_m = 9.0\n";
    let place = Place::new(&[HALL], &format!("{LEVEL}{limits}"));
    let told = |job: &str| {
        place.set_job(job);
        let output = place.run(&["lint", "job.toml"]);
        assert_eq!(output.status.code(), Some(2));
        String::from_utf8(output.stderr).unwrap()
    };
    let text = told(&format!("{LEVEL}{limits}"));
    assert!(
        text.contains("`[rotating]` has no depth that could be limited: a LiDAR measures along its beams")
            && text.contains("job.toml:10:6"),
        "{text}"
    );
    let spherical = "[[sensor]]\nname = \"c\"\n[sensor.equirectangular]\nwidth_px = 8\nheight_px = 4\n";
    let text = told(&format!("{spherical}{limits}"));
    assert!(text.contains("a spherical image has no depth that could be limited"), "{text}");
    let text = told(&format!("{LEVEL}{}", limits.replace("depth", "z")));
    assert!(text.contains("\"range\"") && text.contains("\"depth\""), "{text}");
}

/// Looking at nothing, at something too far, and at something too near are told apart, also where no return changes.
#[test]
fn a_check_sees_a_sensor_go_blind_in_the_dead_zone() {
    let job = format!("{LEVEL}[sensor.range]\nmin_m = 0.3\nmax_m = 5.0\n");
    let far = ("far wall", [8.0, -9.0, -1.0], [8.5, 9.0, 1.0]);
    let place = Place::new(&[far], &job);
    let (image, _) = place.scan();
    // The wall spans azimuths up to atan(9/8) = 48.4° ahead.
    assert_eq!((count(&image, 4), count(&image, 2), count(&image, 1)), (97, 263, 0));
    // It sees nothing within its range yet, which is accepted only on purpose.
    assert_eq!(place.run(&["check", "--accept", "job.toml"]).status.code(), Some(1));
    place.fine(&["check", "--accept", "--allow-empty", "job.toml"]);
    place.fine(&["check", "job.toml"]);
    place.set_scene(&[far, POST]);
    let text = place.failed_check();
    assert!(
        text.contains("the cause differs in 39 of 360 pixels, out_of_range → too_near: 39 pixels"),
        "{text}"
    );
    assert!(text.contains("all in columns 161 to 199"), "{text}");

    // Where returns vanish, the cause says why.
    let place = Place::new(&[HALL], &format!("{LEVEL}[sensor.range]\nmin_m = 0.3\n"));
    place.fine(&["check", "--accept", "job.toml"]);
    place.set_scene(&[HALL, POST]);
    let text = place.failed_check();
    assert!(text.contains("39 returns vanished"), "{text}");
    assert!(text.contains("the cause differs in 39 of 360 pixels, surface → too_near: 39 pixels"), "{text}");
    place.fine(&["scan", "job.toml", "--out", "before"]);
    place.set_scene(&[HALL]);
    place.fine(&["scan", "job.toml", "--out", "after"]);
    let diff = place.run(&["diff", "before", "after"]);
    let text = String::from_utf8(diff.stdout).unwrap();
    assert!(
        text.lines().any(|line| line.trim_start().starts_with("cause ") && line.contains(" 39 ")),
        "{text}"
    );
}

/// Id 0 is nothing, of an instance as of a triangle, and every return has others. The manifest and the headers name them.
#[test]
fn an_id_of_0_is_nothing() {
    let wall = ("wall", [5.0, -3.0, -1.0], [5.5, 3.0, 1.0]);
    let place = Place::new(&[wall], LEVEL);
    let (image, _) = place.scan();
    let seen = image.mask();
    assert!(seen.contains(&true) && seen.contains(&false));
    for channel in ["id.instance", "id.triangle"] {
        let ids = image.u32(channel).unwrap();
        assert!(ids.iter().zip(&seen).all(|(id, seen)| (*id != 0) == *seen), "{channel}");
    }
    assert!(image.u32("id.instance").unwrap().iter().all(|id| *id <= 1));
    let manifest: Value =
        serde_json::from_slice(&fs::read(place.path("out/manifest.json")).unwrap()).unwrap();
    assert_eq!(manifest["format"], 2);
    assert_eq!(manifest["scene"]["instances"], json!([{ "id": 1, "name": "wall" }]));
    let header = fs::read(place.path("out/c/000000.ply")).unwrap();
    assert!(String::from_utf8_lossy(&header).contains("comment instance 1 = \"wall\"\n"));
    // A file on its own says what it shows.
    fs::copy(place.path("out/c/000000.exr"), place.path("alone.exr")).unwrap();
    place.fine(&["view", "alone.exr"]);
    assert!(fs::read_to_string(place.path("alone.html")).unwrap().contains("\"instances\":{\"1\":\"wall\"}"));
}

/// After a sensor is renamed, `--overwrite` leaves what the new manifest lists, and what was never beamcast's.
#[test]
fn overwriting_removes_what_the_old_manifest_lists_and_the_new_one_does_not() {
    let place = Place::new(&[HALL], LEVEL);
    place.fine(&["scan", "job.toml"]);
    fs::write(place.path("out/notes.txt"), "mine").unwrap();
    place.set_job(&LEVEL.replace("\"c\"", "\"renamed\""));
    let plan = place.fine(&["scan", "job.toml", "--overwrite", "--dry-run"]).stdout;
    let plan = String::from_utf8(plan).unwrap();
    assert!(
        plan.contains("would remove, of an earlier run:\n  out/c/000000.exr\n  out/c/000000.ply\n"),
        "{plan}"
    );
    assert!(place.path("out/c/000000.exr").exists());
    place.fine(&["scan", "job.toml", "--overwrite"]);
    assert!(!place.path("out/c").exists());
    let manifest: Value =
        serde_json::from_slice(&fs::read(place.path("out/manifest.json")).unwrap()).unwrap();
    let listed = manifest["outputs"].as_array().unwrap().iter().map(|file| file["path"].as_str().unwrap());
    let mut expected: Vec<&str> = listed.chain(["manifest.json", "notes.txt"]).collect();
    expected.sort_unstable();
    let mut found: Vec<String> = Vec::new();
    for entry in fs::read_dir(place.path("out")).unwrap().map(Result::unwrap) {
        let name = entry.file_name().into_string().unwrap();
        if entry.path().is_dir() {
            let inside = fs::read_dir(entry.path()).unwrap().map(Result::unwrap);
            found.extend(inside.map(|file| format!("{name}/{}", file.file_name().to_string_lossy())));
        } else {
            found.push(name);
        }
    }
    found.sort_unstable();
    assert_eq!(found, expected);
    // A format less is a file less; a manifest that is broken or leads outside removes nothing.
    place.fine(&["scan", "job.toml", "--overwrite", "--set", "output.formats=[\"exr\"]"]);
    assert!(!place.path("out/renamed/000000.ply").exists());
    fs::write(place.path("precious"), "mine").unwrap();
    fs::write(
        place.path("out/manifest.json"),
        "{\"outputs\": [{\"path\": \"../precious\"}, {\"path\": \"notes.txt\"}]}",
    )
    .unwrap();
    place.fine(&["scan", "job.toml", "--overwrite"]);
    assert!(place.path("precious").exists() && place.path("out/notes.txt").exists());
}
