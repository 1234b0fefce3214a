//! `beamcast check` and `beamcast diff` as used in CI: each small change of a shipped job is detected and reported in the
//! right words, and equal results pass.

mod causes;
mod expectations;
mod returns;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use beamcast::check::{Baseline, Changes, Settings, Snapshot, StoredPixels, judge};
use beamcast::config;
use beamcast::output::SensorFrame;
use beamcast::rng::Rng;
use beamcast::scan::{Progress, scan};
use beamcast::scene::gltf;
use beamcast::sensor::Capture;
use beamcast::trace::{Instructions, Tracer};
use serde_json::Value;
use tempfile::TempDir;

/// A copy of shipped jobs with their baselines, sensor files and scenes.
struct Copy(TempDir);

const ROOM: &str = "configs/room_vlp16.toml";
const SENSOR: &str = "configs/sensors/velodyne_vlp16.toml";

fn shipped(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

impl Copy {
    fn of(job: &str, sensor: &str, scene: &str) -> Self {
        let copy = Self(tempfile::tempdir().unwrap());
        for folder in ["configs/sensors", "scenes", &format!("configs/{job}.baseline")] {
            fs::create_dir_all(copy.path(folder)).unwrap();
        }
        let baseline = format!("configs/{job}.baseline");
        for file in fs::read_dir(shipped(&baseline)).unwrap().map(Result::unwrap) {
            let name = file.file_name().into_string().unwrap();
            fs::copy(file.path(), copy.path(&format!("{baseline}/{name}"))).unwrap();
        }
        for file in [
            format!("configs/{job}.toml"),
            format!("configs/sensors/{sensor}.toml"),
            format!("scenes/{scene}"),
        ] {
            fs::copy(shipped(&file), copy.path(&file)).unwrap();
        }
        copy
    }

    fn room() -> Self {
        Self::of("room_vlp16", "velodyne_vlp16", "room.glb")
    }

    fn path(&self, file: &str) -> PathBuf {
        self.0.path().join(file)
    }

    fn replace(&self, file: &str, from: &str, to: &str) {
        let text = fs::read_to_string(self.path(file)).unwrap();
        assert!(text.contains(from), "{file} has no {from}");
        fs::write(self.path(file), text.replace(from, to)).unwrap();
    }

    fn append(&self, file: &str, text: &str) {
        let whole = fs::read_to_string(self.path(file)).unwrap() + text;
        fs::write(self.path(file), whole).unwrap();
    }

    /// Changes the JSON of a GLB.
    fn edit_scene(&self, file: &str, edit: impl FnOnce(&mut Value)) {
        let glb = fs::read(self.path(file)).unwrap();
        let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
        let mut json = serde_json::from_slice(&glb[20..20 + length]).unwrap();
        edit(&mut json);
        let mut text = json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let rest = &glb[20 + length..];
        let mut edited = glb[..8].to_vec();
        edited.extend(((20 + text.len() + rest.len()) as u32).to_le_bytes());
        edited.extend((text.len() as u32).to_le_bytes());
        edited.extend(b"JSON");
        edited.extend(text);
        edited.extend(rest);
        fs::write(self.path(file), edited).unwrap();
    }

    fn command(&self, args: &[&str]) -> Command {
        let mut command = super::cli::program();
        command.args(args).current_dir(self.0.path());
        command
    }

    /// Runs the program. Returns the exit code, stdout and stderr.
    fn run(&self, args: &[&str]) -> (i32, String, String) {
        told(&self.command(args).output().unwrap())
    }

    /// The report of a check of the only job, which must fail.
    fn caught(&self) -> String {
        let (code, out, err) = self.run(&["check", "configs"]);
        assert_eq!(code, 1, "{out}{err}");
        assert!(err.contains("1 job: 1 failed"), "{err}");
        out
    }

    fn accept(&self) {
        let (code, out, err) = self.run(&["check", "--accept", "configs"]);
        assert_eq!(code, 0, "{out}{err}");
        assert!(out.contains(": accepted"), "{out}");
    }
}

fn told(output: &Output) -> (i32, String, String) {
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
    (output.status.code().unwrap(), text(&output.stdout), text(&output.stderr))
}

#[track_caller]
fn has(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "no {part:?} in:\n{text}");
    }
}

fn node<'a>(json: &'a mut Value, name: &str) -> &'a mut Value {
    let nodes = json["nodes"].as_array_mut().unwrap();
    nodes.iter_mut().find(|node| node["name"] == name).unwrap()
}

#[test]
fn shipped_jobs_match_their_baselines_with_any_number_of_threads() {
    for (job, sensor, scene) in [
        ("room_vlp16", "velodyne_vlp16", "room.glb"),
        ("hall_128", "lidar_128", "hall.glb"),
        ("warehouse_depth", "depth_camera", "warehouse.glb"),
    ] {
        let copy = Copy::of(job, sensor, scene);
        let threads: &[&str] = if job == "room_vlp16" { &["1", "2", "3"] } else { &["3"] };
        for threads in threads {
            let (code, out, err) = copy.run(&["check", "configs", "--threads", threads]);
            assert_eq!((code, err.as_str()), (0, "1 job: 1 passed\n"), "{out}");
        }
    }
}

/// The instruction sets of the processor make no difference.
#[test]
fn baselines_hold_for_portable_code_and_for_single_rays() {
    let job = config::load_job(&shipped(ROOM), &[]).unwrap();
    let options = gltf::Options { up: job.up, labels: &job.labels, ..gltf::Options::default() };
    let scene = gltf::load(&job.scene_path, &job.scene_as_written, &options).unwrap().scene;
    let folder = shipped("configs/room_vlp16.baseline");
    let accepted = Baseline::decode(&fs::read(folder.join(Baseline::NAME)).unwrap()).unwrap();
    let mounted = &job.sensors[0];
    for instructions in [Instructions::Portable, Instructions::Scalar] {
        let tracer = Tracer::build(&scene).with_instructions(instructions);
        let capture = Capture::new(&mounted.sensor, mounted.body_from_sensor, &job.trajectory, 0, job.seed);
        let frame = &scan(&scene, &tracer, &capture, &Progress::default()).unwrap();
        let cloud_frame = job.output.cloud_frame;
        let seen = SensorFrame { cloud_frame, ..SensorFrame::new(capture, frame, &mounted.name) };
        let taken = Snapshot::of(&seen, &scene, &Default::default());
        let now = Baseline::of(&job.resolved, &scene, vec![taken.record.clone()]);
        let changes = Changes::between(&accepted, &now);
        assert!(changes.all().is_empty(), "{changes:?}");
        let no_pixels = || panic!("the hashes are the same, and no pixels needed");
        let outcome = judge(&taken, &accepted.sensors[0], no_pixels, &Settings::default(), &changes, "");
        assert!(outcome.differences.is_empty(), "{instructions:?}: {:?}", outcome.differences);
    }
    // The stored pixels are also those of the frame: ranges, causes, instances and labels.
    let kept =
        StoredPixels::unpack(&fs::read(folder.join("vlp16.pixels")).unwrap(), &accepted.sensors[0]).unwrap();
    assert_eq!((kept.image.rows, kept.image.columns, kept.image.channels.len()), (16, 1800, 4));
}

#[test]
fn one_beam_turned_up_by_a_twentieth_of_a_degree() {
    let copy = Copy::room();
    copy.replace(SENSOR, "-3.0,", "-3.05,");
    has(
        &copy.caught(),
        &[
            "sensor vlp16: beam (row 9) elevation −3° → −3.05°: range differs in 1800 of 28800 pixels, max",
            "all in row 9",
        ],
    );
}

#[test]
fn a_mount_turned_by_a_tenth_of_a_degree() {
    let copy = Copy::room();
    copy.replace(ROOM, "1.2] }", "1.2], rpy_deg = [0.0, 0.0, 0.1] }");
    has(
        &copy.caught(),
        &[
            "sensor vlp16: pose.rpy_deg unset → [0.0, 0.0, 0.1]: range differs in at least",
            "of 28800 pixels, max",
            "the label differs in ",
        ],
    );
}

#[test]
fn an_azimuth_offset_lost() {
    let copy = Copy::room();
    let offsets = ["1.5"; 16].join(", ");
    copy.replace(SENSOR, "columns = 1800", &format!("azimuth_offsets_deg = [{offsets}]\ncolumns = 1800"));
    has(&copy.caught(), &["azimuth offset of 16 of 16 beams, all by 1.5°"]);
    copy.accept();
    copy.replace(SENSOR, "[1.5, 1.5, ", "[1.5, 0.0, ");
    has(
        &copy.caught(),
        &["sensor vlp16: beam (row 7) azimuth offset 1.5° → 0°: ", "range differs in ", "all in row 7"],
    );
}

#[test]
fn a_range_limit() {
    let copy = Copy::room();
    copy.replace(SENSOR, "max_m = 100.0", "max_m = 5.0");
    has(&copy.caught(), &["sensor vlp16: range.max_m 100.0 → 5.0: ", "returns vanished"]);
}

#[test]
fn half_a_pixel_of_a_camera() {
    let copy = Copy::of("warehouse_depth", "depth_camera", "warehouse.glb");
    // The focal length is equivalent to 87 degrees, and the principal point is half a pixel to the right of the middle.
    let focal = 320.0 / libm::tan(43.5_f64.to_radians());
    copy.replace(
        "configs/sensors/depth_camera.toml",
        "hfov_deg = 87.0",
        &format!("fx_px = {focal}\ncx_px = 320.5"),
    );
    has(
        &copy.caught(),
        &["sensor depth: pinhole.hfov_deg 87.0 → unset; pinhole.cx_px unset → 320.5; ", "range differs in "],
    );
}

#[test]
fn an_object_moved_by_two_centimetres() {
    let copy = Copy::room();
    copy.edit_scene("scenes/room.glb", |json| {
        let x = &mut node(json, "pillar")["translation"][0];
        *x = (x.as_f64().unwrap() + 0.02).into();
    });
    has(
        &copy.caught(),
        &["sensor vlp16: ../scenes/room.glb BLAKE3 ", " of 28800 pixels, max", "all on \"pillar\""],
    );
}

#[test]
fn an_objects_label_lost() {
    let copy = Copy::room();
    copy.edit_scene("scenes/room.glb", |json| {
        node(json, "pillar")["extras"].as_object_mut().unwrap().remove("label").unwrap();
    });
    let caught = copy.caught();
    has(&caught, &["../scenes/room.glb BLAKE3 ", " of 28800 pixels, label ", " → 0: ", "all on \"pillar\""]);
    assert!(!caught.contains("range"), "{caught}");
}

#[test]
fn a_triangle_removed() {
    let copy = Copy::room();
    copy.edit_scene("scenes/room.glb", |json| {
        let mesh = node(json, "walls and ceiling")["mesh"].as_u64().unwrap() as usize;
        let indices = json["meshes"][mesh]["primitives"][0]["indices"].as_u64().unwrap() as usize;
        let count = &mut json["accessors"][indices]["count"];
        *count = (count.as_u64().unwrap() - 3).into();
    });
    has(
        &copy.caught(),
        &[
            "triangles of the scene 8628 → 8627",
            "returns vanished",
            "all on \"walls and ceiling\"",
            "id.triangle",
        ],
    );
}

#[test]
fn a_seed_alone_is_no_difference() {
    let copy = Copy::room();
    copy.replace(ROOM, "scene = ", "seed = 5\nscene = ");
    let (code, out, _) = copy.run(&["check", "configs"]);
    assert_eq!(code, 0);
    has(
        &out,
        &[
            "configs/room_vlp16.toml: passed\n",
            "changed since the baseline was accepted:\n    seed unset → 5",
        ],
    );
}

#[test]
fn a_baseline_that_is_missing_or_of_another_job_is_a_failure_with_the_way_out() {
    let copy = Copy::room();
    let way_out = "`beamcast check --accept configs/room_vlp16.toml` accepts the job as it is now";
    copy.replace(SENSOR, "columns = 1800", "columns = 900");
    has(
        &copy.caught(),
        &["sensor vlp16: rotating.columns 1800 → 900: the image is 16 × 900 pixels, the baseline 16 × 1800"],
    );
    copy.replace(ROOM, "name = \"vlp16\"", "name = \"puck\"");
    has(
        &copy.caught(),
        &["the baseline has no sensor puck", "the job has no sensor vlp16 any more", way_out],
    );

    let copy = Copy::room();
    copy.replace("configs/room_vlp16.baseline/baseline.json", "\"format\": 2", "\"format\": 999");
    has(&copy.caught(), &["baseline.json has format 999, and this version reads", way_out]);
    fs::remove_dir_all(copy.path("configs/room_vlp16.baseline")).unwrap();
    let (code, _, err) = copy.run(&["check", "configs"]);
    assert_eq!(code, 2, "{err}");
    has(
        &err,
        &["no job in this folder has a baseline", "there is nothing to check: `beamcast check --accept"],
    );
    copy.append(ROOM, "\n[check]\n");
    has(&copy.caught(), &["there is no configs/room_vlp16.baseline/baseline.json", way_out]);

    // The frames differ although none of the recorded inputs changed.
    let copy = Copy::room();
    copy.replace("configs/room_vlp16.baseline/baseline.json", "\"range\": \"aba769", "\"range\": \"bba769");
    has(
        &copy.caught(),
        &[
            "sensor vlp16: neither the job nor the scene nor the version changed, and yet range differs in at least 0 of",
        ],
    );

    // Corrupted pixel files cause no crash, and they are read only if a frame differs.
    let copy = Copy::room();
    let pixels = copy.path("configs/room_vlp16.baseline/vlp16.pixels");
    fs::write(&pixels, b"not pixels").unwrap();
    assert_eq!(copy.run(&["check", "configs"]).0, 0);
    copy.replace(SENSOR, "max_m = 100.0", "max_m = 5.0");
    has(&copy.caught(), &["differ from the baseline", "vlp16.pixels is not what was accepted"]);
}

#[test]
fn people_accept_baselines_and_ci_does_not() {
    let copy = Copy::room();
    copy.replace(SENSOR, "max_m = 100.0", "max_m = 50.0");
    let output = copy.command(&["check", "--accept", "configs"]).env("CI", "true").output().unwrap();
    let (code, _, err) = told(&output);
    assert_eq!(code, 2);
    has(&err, &["--accept is refused where CI is set"]);
    assert_eq!(copy.run(&["check", "--accept", "configs", "--set", "seed=1"]).0, 2);

    // A job with another name than the accepted one is only checked.
    assert_eq!(
        copy.run(&["check", "--accept=street_128", "configs"]).1,
        "configs/room_vlp16.toml: passed\n  \
        changed since the baseline was accepted:\n    sensor vlp16: range.max_m 100.0 → 50.0\n"
    );
    copy.accept();
    let written = |copy: &Copy| {
        fs::metadata(copy.path("configs/room_vlp16.baseline/baseline.json")).unwrap().modified().unwrap()
    };
    let first = written(&copy);
    let (code, out, _) = copy.run(&["check", "--accept=room_vlp16", "configs"]);
    assert_eq!((code, out.as_str()), (0, "configs/room_vlp16.toml: passed\n"), "nothing to accept");
    assert_eq!(written(&copy), first);
    // The pixel file is renamed with its sensor.
    copy.replace(ROOM, "name = \"vlp16\"", "name = \"puck\"");
    copy.accept();
    assert!(!copy.path("configs/room_vlp16.baseline/vlp16.pixels").exists());
    assert!(copy.path("configs/room_vlp16.baseline/puck.pixels").exists());
}

#[test]
fn tolerances_let_small_differences_pass() {
    let copy = Copy::room();
    copy.append(
        ROOM,
        "\n[check]\nchannels = [\"range\", \"intensity\"]\n\
         tolerance = { range = { absolute = 0.002, pixels = 0.01 }, intensity = { absolute = 0.01, pixels = 0.01 } }\n",
    );
    copy.replace(ROOM, "1.2]", "1.201]");
    has(
        &copy.caught(),
        &["the baseline was accepted before intensity had a tolerance, and has no pixels of it"],
    );
    copy.replace(ROOM, "1.201]", "1.2]");
    copy.accept();
    // The sensor is 0.1 mm higher. Ranges grow by less than their tolerance, except at a few pixels' edges.
    copy.replace(ROOM, "1.2]", "1.2001]");
    let (code, out, _) = copy.run(&["check", "configs"]);
    assert_eq!(code, 0, "{out}");
    copy.replace(ROOM, "1.2001]", "1.25]");
    has(
        &copy.caught(),
        &["pose.position_m[2] 1.2 → 1.25: ", "range differs by more than the tolerance in ", " pixels, max"],
    );
}

#[test]
fn reports_are_written_where_ci_looks_for_them() {
    let copy = Copy::room();
    copy.replace(SENSOR, "-3.0,", "-3.05,");
    let args =
        ["check", "configs", "--junit", "r/junit.xml", "--markdown", "r/check.md", "--json", "r/check.json"];
    let mut command = copy.command(&args);
    command.env("GITHUB_ACTIONS", "true").env("GITHUB_STEP_SUMMARY", copy.path("summary.md"));
    let (code, out, _) = told(&command.output().unwrap());
    assert_eq!(code, 1);
    has(
        &out,
        &[
            "::error file=configs/room_vlp16.toml,line=10,col=1,title=beamcast check::sensor vlp16: beam (row 9) elevation",
        ],
    );
    let job = fs::read_to_string(copy.path(ROOM)).unwrap();
    assert_eq!(job.lines().position(|line| line == "[[sensor]]"), Some(9), "{job}");
    let read = |file: &str| fs::read_to_string(copy.path(file)).unwrap();
    has(&read("r/junit.xml"), &["failures=\"1\"", "<failure message=\"sensor vlp16: beam (row 9) elevation"]);
    has(&read("r/check.md"), &["### beamcast check: 1 job: 1 failed", "❌ failed"]);
    assert_eq!(read("summary.md"), read("r/check.md"));
    let json: Value = serde_json::from_str(&read("r/check.json")).unwrap();
    assert_eq!(json["passed"], false);
    assert_eq!(json["jobs"][0]["changes"][0]["new"], "−3.05°");
    let channels = json["jobs"][0]["sensors"][0]["channels"].as_array().unwrap();
    let range = channels.iter().find(|c| c["channel"] == "range").unwrap();
    assert_eq!((&range["differing"], &range["differing_is_exact"]), (&1800.into(), &true.into()));

    let (code, _, _) = copy.run(&["check", "configs", "--coverage", "maps"]);
    assert_eq!(code, 1);
    let map = fs::read(copy.path("maps/room_vlp16.png")).unwrap();
    assert!(map.starts_with(b"\x89PNG") && map.len() > 1000);
}

#[test]
fn annotations_are_at_the_line_that_is_meant_by_the_name_that_git_has() {
    let copy = Copy::room();
    fs::create_dir(copy.path(".git")).unwrap();
    let text = fs::read_to_string(copy.path(ROOM)).unwrap();
    let lines = text.lines().count();
    let more = "\n[[expect]]\nname = \"none\"\nreturns = { at_most = 0.1 }\n";
    fs::write(copy.path(ROOM), text + more).unwrap();
    fs::write(copy.path("configs/wrong.toml"), "scene = \"a.glb\"\n\n  seed = \"one\"\n").unwrap();
    fs::write(
        copy.path("configs/lost.toml"),
        "[output]\ndir = \"out\"\n[[sensor]]\npreset = \"velodyne/vlp-16\"\n",
    )
    .unwrap();
    let lost = fs::read_to_string(copy.path("configs/lost.toml")).unwrap();
    fs::write(
        copy.path("configs/lost.toml"),
        format!("# a scene that is not there\nscene = \"no.glb\"\n{lost}"),
    )
    .unwrap();
    // Run in a folder of the repository, on the folder itself and on files.
    for paths in [&["."][..], &["./room_vlp16.toml", "wrong.toml", "lost.toml"]] {
        let mut command = copy.command(&[&["check"], paths].concat());
        command.current_dir(copy.path("configs")).env("GITHUB_ACTIONS", "true");
        let (_, out, _) = told(&command.output().unwrap());
        has(
            &out,
            &[
                &format!(
                    "::error file=configs/room_vlp16.toml,line={},col=11,title=beamcast check::none: ",
                    lines + 4
                ),
                "::error file=configs/wrong.toml,line=3,col=10,title=beamcast check::`seed` is ",
            ],
        );
        assert!(!out.contains("file=./"), "{out}");
        if paths.len() > 1 {
            has(&out, &["::error file=configs/lost.toml,line=2,col=9,title=beamcast check::"]);
        }
    }
}

#[test]
fn a_job_that_is_broken_does_not_keep_others_from_being_checked() {
    let copy = Copy::room();
    fs::write(copy.path("configs/bad.toml"), "scene = 3\n").unwrap();
    fs::write(
        copy.path("configs/lost.toml"),
        "scene = \"no.glb\"\n[check]\n[[sensor]]\npreset = \"sensors/velodyne_vlp16.toml\"\n[output]\ndir = \"o\"\n",
    )
    .unwrap();
    let (code, out, err) = copy.run(&["check", "configs"]);
    assert_eq!(code, 3, "{err}");
    has(&out, &["configs/bad.toml: broken", "configs/lost.toml: broken", "configs/room_vlp16.toml: passed"]);
    has(&err, &["`scene` is 3", "no.glb"]);
}

#[test]
fn outputs_are_compared_channel_by_channel() {
    let copy = Copy::room();
    for (out, changes) in [("a", None), ("b", Some("sensor.vlp16.range.max_m=5"))] {
        let mut args = vec!["scan", ROOM, "--out", out];
        args.extend(changes.iter().flat_map(|change| ["--set", *change]));
        assert_eq!(copy.run(&args).0, 0);
    }
    let same = |code: i32, args: &[&str]| {
        let (found, out, err) = copy.run(&[&["diff"], args].concat());
        assert_eq!(found, code, "{args:?}\n{out}{err}");
        out
    };
    has(&same(0, &["a", "a"]), &["vlp16/000000: the same, 16 × 1800 pixels, 28800 returns"]);
    // A job that is given in place of a folder is run, and gives the same frames.
    has(&same(0, &["a", ROOM]), &["the same"]);
    has(&same(0, &["a/vlp16/000000.ply", "a/vlp16/000000.ply"]), &["the same, 28800 points"]);
    let differs = same(1, &["a", "b/manifest.json", "--png", "map.png"]);
    has(&differs, &["vlp16/000000: different: ", " vanished (IoU 0.", "range ", "label "]);
    assert!(fs::read(copy.path("map.vlp16.png")).unwrap().starts_with(b"\x89PNG"));
    same(1, &["a/vlp16/000000.exr", "b/vlp16/000000.exr", "--png", "one.png"]);
    assert!(copy.path("one.png").exists());
    // Pixels that vanished exceed any tolerance of values, but not a tolerance of all pixels.
    same(1, &["a", "b", "--tolerance", "range=100"]);
    has(&same(0, &["a", "b", "--pixels", "1"]), &["within tolerance"]);
    has(
        &same(1, &["a/vlp16/000000.ply", "b/vlp16/000000.ply"]),
        &[
            "from each of A to the nearest of B:",
            "from each of B to the nearest of A: 0 m on average",
            "Chamfer distance",
        ],
    );
    let json: Value = serde_json::from_str(&same(1, &["a", "b", "--json"])).unwrap();
    assert_eq!(json["same"], false);
    assert!(json["pairs"][0]["vanished"].as_u64().unwrap() > 100);

    for (code, args) in [
        (2, ["diff", "a/vlp16/000000.exr", "a/vlp16/000000.ply"]),
        (3, ["diff", "a", "scenes/room.glb"]),
        (3, ["diff", "a", "configs/sensors"]),
        (3, ["diff", "a", "nowhere"]),
    ] {
        assert_eq!(copy.run(&args).0, code, "{args:?}");
    }
    assert_eq!(copy.run(&["diff", "a", "b", "--tolerance", "rnage=1"]).0, 2);
    // A manifest cannot open a file outside its folder.
    copy.replace("b/manifest.json", "vlp16/000000.exr", "../a/vlp16/000000.exr");
    let (code, _, err) = copy.run(&["diff", "a", "b"]);
    assert_eq!(code, 3);
    has(&err, &["which is not in its folder"]);
}

/// A check never waits for a pipe that has the name of a baseline's file.
#[cfg(unix)]
#[test]
fn pipes_are_no_baselines() {
    let copy = Copy::room();
    copy.replace(SENSOR, "-3.0,", "-3.05,"); // The difference makes the check read the stored pixels.
    for file in ["vlp16.pixels", Baseline::NAME] {
        let path = copy.path("configs/room_vlp16.baseline").join(file);
        fs::remove_file(&path).unwrap();
        assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
        let (code, out, _) = copy.run(&["check", "configs"]);
        assert_eq!(code, 1, "{out}");
        has(&out, &[&format!("{file}: this is a pipe or a device, not a file")]);
    }
}

/// Reading a corrupted baseline neither panics nor takes more memory than the image.
#[test]
fn broken_baselines_are_told_from_whole_ones() {
    let folder = shipped("configs/room_vlp16.baseline");
    let json = fs::read(folder.join(Baseline::NAME)).unwrap();
    let pixels = fs::read(folder.join("vlp16.pixels")).unwrap();
    let whole = Baseline::decode(&json).unwrap();
    assert_eq!(Baseline::decode(&whole.encode()).unwrap(), whole);
    let mut random = Rng::new(1);
    let mut refused = 0;
    for _ in 0..300 {
        let mut broken = json.clone();
        let at = random.below(broken.len());
        broken[at] = random.u64() as u8;
        if let Ok(baseline) = Baseline::decode(&broken) {
            for record in &baseline.sensors {
                StoredPixels::unpack(&pixels, record);
            }
        }
        let mut broken = pixels.clone();
        let at = random.below(broken.len());
        broken[at] ^= 1 << random.below(8);
        broken.truncate(broken.len() - random.below(2) * random.below(broken.len()));
        refused += usize::from(StoredPixels::unpack(&broken, &whole.sensors[0]).is_none());
    }
    assert!(refused > 150, "{refused}");
    let mut huge = whole.sensors[0].clone();
    (huge.rows, huge.columns) = (1 << 32, 1 << 31);
    assert_eq!(StoredPixels::unpack(&pixels, &huge), None);
    (huge.rows, huge.columns) = (1 << 20, 1 << 20);
    assert_eq!(StoredPixels::unpack(&pixels, &huge), None);
}

/// The blocks of one kind on the page.
fn blocks(page: &str, kind: &str) -> Vec<String> {
    let fence = format!("```{kind}\n");
    page.split(&fence).skip(1).map(|block| block.split("```").next().unwrap().to_owned()).collect()
}

#[test]
fn the_page_says_what_the_program_does() {
    let page = fs::read_to_string(shipped("docs/regress-in-ci.md")).unwrap();
    let copy = Copy::room();
    copy.replace(SENSOR, "-3.0,", "-3.05,");
    let (_, out, err) = copy.run(&["check", "configs"]);
    assert_eq!(blocks(&page, "console"), [format!("$ beamcast check configs\n{out}{err}")]);

    // All keys and expectations on the page are valid, and the expectations are met.
    let copy = Copy::room();
    for block in blocks(&page, "toml") {
        copy.append(ROOM, &format!("\n{block}"));
    }
    copy.accept();
    let (code, out, err) = copy.run(&["check", "configs"]);
    assert_eq!((code, out.as_str()), (0, "configs/room_vlp16.toml: passed, 13 expectations met\n"), "{err}");

    let workflow = fs::read_to_string(shipped(".github/workflows/sensor-regression.yml")).unwrap();
    assert!(workflow.ends_with(&blocks(&page, "yaml")[0]), "the page and the workflow differ");
}
