//! Jobs and sensor files: their meaning, and the messages about wrong ones.

mod measured;
mod mistakes;
mod surroundings;

use std::path::{Path, PathBuf};

use beamcast::config::{self, Config, InputFile, Job};
use beamcast::error::Error;
use beamcast::output::{CloudFrame, Format};
use beamcast::sensor::{Pattern, RingOrder};
use beamcast::source::{Diagnostic, Severity};
use mistakes::MISTAKES;
use proptest::prelude::*;

const SENSOR: &str = "\
ring = \"bottom_up\"
[rotating]
elevations_deg = [-15.0, 1, 15.0]
beam_times_us = [0.0, 2.0, 4.0]
columns = 1800
rate_hz = 10.0
[range]
min_m = 0.5
max_m = 100.0
";

const JOB: &str = "\
scene = \"../scenes/room.glb\"
seed = 7
[labels]
wall = 3
[[sensor]]
name = \"top\"
preset = \"sensor.toml\"
pose = { position_m = [1.0, 2, 3.0], rpy_deg = [0.0, 0.0, 90.0] }
[sensor.range]
max_m = 50
[output]
dir = \"out\"
formats = [\"exr\", \"ply\"]
frame = \"world\"
";

/// A folder with `job.toml` and `sensor.toml`.
fn folder(job: &str, sensor: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("sensor.toml"), sensor).unwrap();
    let path = folder.path().join("job.toml");
    std::fs::write(&path, job).unwrap();
    (folder, path)
}

fn load(job: &str, sensor: &str, overrides: &[&str]) -> Result<Job, Vec<Diagnostic>> {
    let (_folder, path) = folder(job, sensor);
    let overrides: Vec<String> = overrides.iter().map(|s| (*s).to_owned()).collect();
    config::load_job(&path, &overrides).map_err(diagnostics)
}

fn diagnostics(error: Error) -> Vec<Diagnostic> {
    match error {
        Error::Config(found) => {
            assert!(
                found.iter().any(|d| d.severity == Severity::Error),
                "an error without errors: {found:?}"
            );
            found
        }
        other => panic!("{other}"),
    }
}

/// `file:line:column: message | label | help`, the file without its folder.
fn told(d: &Diagnostic) -> String {
    let (line, column) = d.line_column();
    let file = d.path.file_name().unwrap().to_string_lossy();
    format!("{file}:{line}:{column}: {} | {} | {}", d.message, d.label, d.help.as_deref().unwrap_or(""))
}

fn rotating(job: &Job, sensor: usize) -> &beamcast::sensor::Rotating {
    match &job.sensors[sensor].sensor.pattern {
        Pattern::Rotating(pattern) => pattern,
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_job_is_read_with_its_sensor_file() {
    let job = load(JOB, SENSOR, &[]).unwrap();
    assert_eq!(job.warnings, []);
    assert_eq!(job.scene_as_written, "../scenes/room.glb");
    assert!(job.scene_path.ends_with("../scenes/room.glb") && job.scene_path.is_absolute());
    assert_eq!((job.seed, job.labels["wall"]), (7, 3));
    assert!(job.output.dir.ends_with("out"));
    assert_eq!(job.output.formats, [Format::EXR, Format::PLY]);
    assert_eq!(job.output.cloud_frame, CloudFrame::World);
    let [sensor] = job.sensors.as_slice() else { panic!("{:?}", job.sensors) };
    assert_eq!(sensor.name, "top");
    assert_eq!(sensor.body_from_sensor.translation.to_array(), [1.0, 2.0, 3.0]);
    assert!(sensor.body_from_sensor.direction(glam::DVec3::X).abs_diff_eq(glam::DVec3::Y, 1e-15));
    assert_eq!((sensor.sensor.range.min_m, sensor.sensor.range.max_m), (0.5, 50.0));
    assert_eq!(sensor.sensor.ring, RingOrder::BottomUp);
    let pattern = rotating(&job, 0);
    assert_eq!((pattern.columns(), pattern.rate_hz(), pattern.is_full_turn()), (1800, 10.0, true));
    let beams: Vec<_> =
        pattern.beams().iter().map(|b| (b.elevation.degrees().round(), b.file_index)).collect();
    assert_eq!(beams, [(15.0, 2), (1.0, 1), (-15.0, 0)]);
    assert!((pattern.beams()[0].time_s - 4e-6).abs() < 1e-18);
    let input = |name: &str, text: &str| InputFile {
        name: name.to_owned(),
        bytes: text.len() as u64,
        blake3: blake3::hash(text.as_bytes()).to_hex().to_string(),
    };
    assert_eq!(job.inputs, [input("job.toml", JOB), input("sensor.toml", SENSOR)]);
}

#[test]
fn left_out_keys_have_their_defaults() {
    let job = "scene = 'a.glb'\noutput.dir = 'o'\n[[sensor]]\n[sensor.rotating]\n\
               elevations_deg = { from = 3, to = -1, count = 5 }\ncolumns = 4\nrate_hz = 5\n";
    let job = load(job, SENSOR, &[]).unwrap();
    assert_eq!((job.seed, job.labels.len(), job.scene_name.as_deref()), (0, 0, None));
    assert_eq!(job.output.formats, [Format::EXR, Format::PLY, Format::PNG]);
    assert_eq!(job.output.cloud_frame, CloudFrame::Sensor);
    assert_eq!(job.trajectory.fixed_pose(), Some(beamcast::frame::Pose::IDENTITY));
    assert_eq!(job.sensors[0].name, "sensor");
    assert_eq!(job.sensors[0].body_from_sensor, beamcast::frame::Pose::IDENTITY);
    assert_eq!(job.sensors[0].sensor.range, beamcast::sensor::RangeLimits::default());
    assert_eq!(job.sensors[0].sensor.ring, RingOrder::Row);
    let elevations: Vec<f64> =
        rotating(&job, 0).beams().iter().map(|b| b.elevation.degrees().round()).collect();
    assert_eq!(elevations, [3.0, 2.0, 1.0, 0.0, -1.0]);
    let (from, to) = rotating(&job, 0).sector();
    assert_eq!((from.degrees(), to.degrees()), (180.0, -180.0));
}

#[test]
fn a_camera_has_a_field_of_view_or_intrinsics() {
    let camera = |keys: &str| {
        let sensor = format!("[pinhole]\nwidth_px = 640\nheight_px = 480\n{keys}\n");
        let (folder, _) = folder("", &sensor);
        let file = config::load_sensor(&folder.path().join("sensor.toml")).unwrap();
        match file.sensor.pattern {
            Pattern::Camera(p) => (p.focal_px(), p.principal_px(), p.rate_hz()),
            other => panic!("{other:?}"),
        }
    };
    let ((fx, fy), centre, rate) = camera("hfov_deg = 90");
    assert!((fx - 320.0).abs() < 1e-9 && fx == fy);
    assert_eq!((centre, rate), ((320.0, 240.0), None));
    assert_eq!(camera("fx_px = 300\nrate_hz = 30"), ((300.0, 300.0), (320.0, 240.0), Some(30.0)));
    assert_eq!(
        camera("fx_px = 300.5\nfy_px = 301\ncx_px = 1\ncy_px = -2"),
        ((300.5, 301.0), (1.0, -2.0), None)
    );
    // The job's own way to state a value replaces the one of the sensor file.
    let sensor = "[pinhole]\nwidth_px = 2\nheight_px = 2\nfx_px = 1\ncx_px = 9\n";
    let job = JOB.replace("[sensor.range]\nmax_m = 50", "[sensor.pinhole]\nhfov_deg = 90");
    match &load(&job, sensor, &[]).unwrap().sensors[0].sensor.pattern {
        Pattern::Camera(p) => assert_eq!(p.principal_px(), (1.0, 1.0)),
        other => panic!("{other:?}"),
    }
}

/// The job and the sensor file with a text of one of them replaced, where it comes first.
fn changed(from: &str, to: &str) -> (String, String) {
    assert!(JOB.contains(from) || SENSOR.contains(from), "{from}");
    match JOB.contains(from) {
        true => (JOB.replacen(from, to, 1), SENSOR.to_owned()),
        false => (JOB.to_owned(), SENSOR.replacen(from, to, 1)),
    }
}

/// Checks that each change of the job or the sensor file, from one text to another, is told with its message.
fn are_told(mistakes: &[(&str, &str, &str)]) {
    let mut wrong = String::new();
    for &(from, to, expected) in mistakes {
        let (job, sensor) = changed(from, to);
        let found = match load(&job, &sensor, &[]) {
            Ok(_) => "nothing is wrong".to_owned(),
            Err(found) => told(&found[0]),
        };
        if found != expected {
            wrong += &format!("{to}\n  expected {expected}\n  found    {found}\n");
        }
    }
    assert!(wrong.is_empty(), "{wrong}");
}

#[test]
fn each_mistake_is_told_at_its_place() {
    are_told(MISTAKES);
}

#[test]
fn all_that_is_wrong_is_told_file_by_file_from_top_to_bottom() {
    let job =
        JOB.replace("seed = 7", "seed = \"x\"").replace("max_m = 50", "max_m = 0").replace("frame", "farme");
    let sensor = SENSOR.replace("1800", "1.5").replace("min_m = 0.5", "min_m = -1");
    let found = load(&job, &sensor, &[]).unwrap_err();
    let places: Vec<_> = found.iter().map(|d| told(d).split(": ").next().unwrap().to_owned()).collect();
    assert_eq!(
        places,
        ["job.toml:2:8", "job.toml:10:9", "job.toml:14:1", "sensor.toml:5:11", "sensor.toml:8:9"]
    );
    assert_eq!(&*found[3].source, sensor, "each problem comes with the text of its own file");
}

#[test]
fn a_sensor_file_that_two_sensors_share_is_told_about_once() {
    let second = "[[sensor]]\nname = \"rear\"\npreset = \"sensor.toml\"\n[output]";
    let job = JOB.replace("[output]", second);
    let names: Vec<_> = load(&job, SENSOR, &[]).unwrap().inputs.into_iter().map(|file| file.name).collect();
    assert_eq!(names, ["job.toml", "sensor.toml"]);
    let found = load(&job, &SENSOR.replace("10.0", "-10.0"), &[]).unwrap_err();
    assert_eq!(found.len(), 1, "{found:?}");
}

#[test]
fn odd_values_are_warnings() {
    let cases = [
        (
            "[-15.0, 1, 15.0]",
            "[-15.0, 15, 15.0]",
            "sensor.toml:3:30: beams 1 and 2 (counted from 0) point the same way |  | ",
        ),
        (
            "columns = 1800",
            "columns = 1800\nazimuth_offsets_deg = [0, 0, 400]",
            "sensor.toml:6:30: an azimuth offset of 400 degrees is more than a turn | in degrees? | ",
        ),
        (
            "4.0]",
            "56.0]",
            "sensor.toml:4:28: a beam fires 56 µs after its column, the next column after 55.556 µs | later than the next column | beam times are microseconds from the column's own time, not from the frame's start",
        ),
        (
            "[-15.0, 1, 15.0]\nbeam_times_us = [0.0, 2.0, 4.0]",
            "{ from = 0.3, to = -0.3, count = 16 }",
            "sensor.toml:3:18: all 16 elevations lie between -0.3 and 0.3 degrees | are these radians? | if they are radians, multiply each by 57.2958",
        ),
        (
            "rpy_deg = [0.0, 0.0, 90.0]",
            "quaternion_xyzw = [0, 0, 1, 1]",
            "job.toml:8:56: a quaternion of length 1.414214, which is normalised | expected x, y, z, w of length 1 | ",
        ),
    ];
    for (from, to, expected) in cases {
        let job = load(&JOB.replacen(from, to, 1), &SENSOR.replacen(from, to, 1), &[]).unwrap();
        let found: Vec<String> = job.warnings.iter().map(told).collect();
        assert_eq!(found, [expected]);
        assert_eq!(job.warnings[0].severity, Severity::Warning);
    }
}

#[test]
fn overrides_win() {
    let with = |pairs: &[&str]| load(JOB, SENSOR, pairs).unwrap();
    assert_eq!(with(&["seed=9"]).seed, 9);
    assert_eq!(with(&["seed=9", "seed = 10"]).seed, 10);
    assert_eq!(with(&["sensor.top.range.max_m=70"]).sensors[0].sensor.range.max_m, 70.0);
    assert_eq!(with(&["sensor.0.range.max_m=inf"]).sensors[0].sensor.range.max_m, f64::INFINITY);
    let moved = with(&["sensor.0.pose.position_m=[0,0,2]", "sensor.0.pose.rpy_deg.2=0"]);
    assert_eq!(moved.sensors[0].body_from_sensor.translation.to_array(), [0.0, 0.0, 2.0]);
    assert_eq!(moved.sensors[0].body_from_sensor.rotation, glam::DMat3::IDENTITY);
    assert_eq!(with(&["output.formats=[\"ply\"]"]).output.formats, [Format::PLY]);
    assert_eq!(with(&["scene_name=Scene = 1"]).scene_name.as_deref(), Some("Scene = 1"));
    assert_eq!(with(&["labels.\"wall.001\"=5"]).labels["wall.001"], 5);
    assert_eq!(with(&["sensor.top.name=bottom"]).sensors[0].name, "bottom");
    let changed = with(&["sensor.0.rotating.elevations_deg={from=1,to=-1,count=3}"]);
    assert_eq!(rotating(&changed, 0).beams()[0].elevation.degrees().round(), 1.0);
    // A single sensor without a name is called by its default name.
    let job = JOB.replace("name = \"top\"", "");
    assert_eq!(
        load(&job, SENSOR, &["sensor.sensor.range.max_m=60"]).unwrap().sensors[0].sensor.range.max_m,
        60.0
    );
}

#[test]
fn overrides_that_cannot_be_are_told() {
    let cases = [
        (
            "seed",
            "--set:1:1: `seed` has no `=` | expected key=value | such as `seed=3` or `sensor.0.range.max_m=50`",
        ),
        ("seed=-3", "--set:1:6: `seed` is -3 | expected a whole number from 0 to 18446744073709551615 | "),
        ("sed=3", "--set:1:1: unknown key `sed` in a job |  | did you mean `seed`?"),
        (
            "seed.x=3",
            "--set:1:1: `seed` is a table | expected a whole number from 0 to 18446744073709551615 | ",
        ),
        (
            "sensor.tpo.range.max_m=1",
            "--set:1:8: there is no sensor `tpo` | the only one is number 0 | did you mean `top`?",
        ),
        (
            "sensor.1.range.max_m=1",
            "--set:1:8: there is no sensor `1` | the only one is number 0 | they are called `top`",
        ),
        (
            "sensor.top.range.max_m=far",
            "--set:1:24: `max_m` is the string \"far\" | expected a number of metres, greater than 0, or `inf` | ",
        ),
        (
            "sensor.top.range.min_m=60",
            "--set:1:24: nothing lies between `min_m` = 60 and `max_m` = 50 | `max_m` must be greater than `min_m` | ",
        ),
        (
            "output.formats=[ply]",
            "--set:1:17: this is not valid TOML: string values must be quoted | expected literal string | ",
        ),
        (
            "a b=1",
            "--set:1:1: `a b` is not a key | expected names with dots between | put quotes around a name with other characters than letters, digits, `-` and `_`",
        ),
        (
            "=c",
            "--set:1:1: `` is not a key | expected names with dots between | put quotes around a name with other characters than letters, digits, `-` and `_`",
        ),
        (
            "a b=c",
            "--set:1:1: `a b` is not a key | expected names with dots between | put quotes around a name with other characters than letters, digits, `-` and `_`",
        ),
    ];
    for (pair, expected) in cases {
        let found = load(JOB, SENSOR, &[pair]).unwrap_err();
        assert_eq!(found.iter().map(told).collect::<Vec<_>>(), [expected], "{pair}");
        assert_eq!(&*found[0].source, pair);
    }
}

#[test]
fn the_resolved_job_is_what_was_given_and_nothing_of_this_machine() {
    let job = load(JOB, SENSOR, &["output.dir=/tmp/elsewhere", "sensor.top.range.max_m=inf"]).unwrap();
    let expected = serde_json::json!({
        "labels": { "wall": 3 },
        "output": { "formats": ["exr", "ply"], "frame": "world" },
        "scene": "../scenes/room.glb",
        "seed": 7,
        "sensor": [{
            "name": "top",
            "pose": { "position_m": [1.0, 2, 3.0], "rpy_deg": [0.0, 0.0, 90.0] },
            "preset": "sensor.toml",
            "range": { "max_m": "inf", "min_m": 0.5 },
            "ring": "bottom_up",
            "rotating": {
                "beam_times_us": [0.0, 2.0, 4.0], "columns": 1800, "elevations_deg": [-15.0, 1, 15.0], "rate_hz": 10.0,
            },
        }],
    });
    assert_eq!(job.resolved, expected);

    let (folder, path) = folder(JOB, SENSOR);
    let preset = folder.path().join("sensor.toml");
    let overrides = [format!("sensor.top.preset={}", preset.display()), "scene=/data/a.glb".to_owned()];
    let job = config::load_job(&path, &overrides).unwrap();
    assert_eq!(
        (&job.resolved["scene"], &job.resolved["sensor"][0]["preset"]),
        (&"a.glb".into(), &"sensor.toml".into())
    );
    assert_eq!((job.scene_as_written.as_str(), job.inputs[1].name.as_str()), ("a.glb", "sensor.toml"));
    assert_eq!(job.scene_path, Path::new("/data/a.glb"));
}

#[test]
fn files_that_are_no_configuration_are_refused_without_waiting() {
    let folder = tempfile::tempdir().unwrap();
    let refused = |name: &str| {
        let found = diagnostics(config::load_job(&folder.path().join(name), &[]).unwrap_err());
        told(&found[0])
    };
    assert!(refused("job.toml").contains("there is no such file"), "{}", refused("job.toml"));
    assert!(refused("").contains("this is a folder, not a file"), "{}", refused(""));

    let large = std::fs::File::create(folder.path().join("large.toml")).unwrap();
    large.set_len(1 << 40).unwrap();
    assert!(
        refused("large.toml").contains("the file has 1099511627776 bytes, more than"),
        "{}",
        refused("large.toml")
    );

    std::fs::write(folder.path().join("latin.toml"), b"# a\nscene = \"caf\xe9\"\n").unwrap();
    let expected =
        "latin.toml:2:13: the file is not UTF-8 text: byte 0xe9 here | not UTF-8 | save the file as UTF-8";
    assert_eq!(refused("latin.toml"), expected);

    let made = std::process::Command::new("mkfifo").arg(folder.path().join("pipe.toml")).status();
    if made.is_ok_and(|status| status.success()) {
        assert!(refused("pipe.toml").contains("this is a pipe or a device, not a file"));
    }
    if Path::new("/dev/zero").exists() {
        assert!(refused("/dev/zero").contains("this is a pipe or a device, not a file"));
    }
}

#[test]
fn hostile_jobs_are_bounded() {
    // An endless list of problems is cut at a limit, and the last message says so.
    let keys: String = (0..20_000).map(|i| format!("[[sensor]]\nname = \"s{i}\"\nx{i} = 1\n")).collect();
    let found = load(&keys, SENSOR, &[]).unwrap_err();
    assert!(found.len() < 300, "{}", found.len());
    assert!(found.iter().any(|d| d.message == "`sensor` has 20000 tables"), "{:?}", found[0].message);

    let labels: String = (0..5000).map(|i| format!("l{i} = -1\n")).collect();
    let found = load(&JOB.replace("wall = 3", &labels), SENSOR, &[]).unwrap_err();
    assert_eq!(found.len(), 201);
    assert!(found.iter().any(|d| d.message == "more than 200 problems: the rest is not shown"));

    let deep = format!("scene = {}", "[".repeat(100_000));
    assert!(load(&deep, SENSOR, &[]).unwrap_err()[0].message.contains("not valid TOML"));
    assert!(load(JOB, SENSOR, &[&format!("{}=1", "a.".repeat(10_000) + "a")]).is_err());

    // These short files demand much memory or time.
    let pattern =
        "rotating = { columns = 1, rate_hz = 1, elevations_deg = { from = 9, to = -9, count = 700000 } }";
    let many: String = (0..5).map(|i| format!("[[sensor]]\nname = \"s{i}\"\n{pattern}\n")).collect();
    let found = load(&format!("scene = \"a\"\noutput.dir = \"o\"\n{many}"), SENSOR, &[]).unwrap_err();
    assert_eq!(
        told(&found[0]),
        "job.toml:9:1: the job's sensors have more than 2000000 beams | too many from here on | "
    );

    // Each of many sensors copies the tables of its file.
    let padded = format!("{SENSOR}# {}", "x".repeat(1 << 20));
    let many: String =
        (0..20).map(|i| format!("[[sensor]]\nname = \"s{i}\"\npreset = \"sensor.toml\"\n")).collect();
    let found = load(&format!("scene = \"a\"\noutput.dir = \"o\"\n{many}"), &padded, &[]).unwrap_err();
    assert!(found[0].message.starts_with("the job's sensors take more than"), "{found:?}");
}

#[test]
fn jobs_and_sensor_files_are_told_apart() {
    let (folder, path) = folder(JOB, SENSOR);
    assert!(matches!(config::load(&path, &[]), Ok(Config::Job(_))));
    match config::load(&folder.path().join("sensor.toml"), &[]) {
        Ok(Config::Sensor(file)) => assert_eq!(file.sensor.pattern.rows(), 3),
        other => panic!("{other:?}"),
    }
    // A job with a pattern at its top level is recognised as a job, and the message says where the pattern belongs.
    std::fs::write(&path, format!("{JOB}[rotating]\ncolumns = 3\n")).unwrap();
    let found = diagnostics(config::load(&path, &[]).unwrap_err());
    let expected = "job.toml:15:2: unknown key `rotating` in a job |  | `rotating` belongs in `[[sensor]]`";
    assert_eq!(found.iter().map(told).collect::<Vec<_>>(), [expected]);
}

#[test]
fn shipped_configs_load_without_a_warning() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
    let mut count = 0;
    for folder in [folder.clone(), folder.join("sensors")] {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_none_or(|e| e != "toml") {
                continue;
            }
            count += 1;
            match config::load(&path, &[]).unwrap_or_else(|e| panic!("{e}")) {
                Config::Job(job) => {
                    assert_eq!(job.warnings, []);
                    // Each job writes to a folder with the job's own name, so that no job overwrites the output of another.
                    assert_eq!(job.output.dir.file_name(), path.file_stem());
                }
                Config::Sensor(sensor) => assert_eq!(sensor.warnings, []),
            }
        }
    }
    assert!(count >= 8, "only {count} configs");
}

#[test]
fn the_vlp16_is_as_its_manual_has_it() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/sensors/velodyne_vlp16.toml");
    let file = config::load_sensor(&path).unwrap();
    let Pattern::Rotating(pattern) = &file.sensor.pattern else { panic!("{file:?}") };
    for (row, beam) in pattern.beams().iter().enumerate() {
        // In the manual, odd lasers look up from 1 in steps of 2 degrees and even ones from −15. Each fires 2.304 µs after
        // the last.
        let laser = beam.file_index as f64;
        let elevation = if beam.file_index % 2 == 1 { laser } else { laser - 15.0 };
        assert!((beam.elevation.degrees() - elevation).abs() < 1e-12);
        assert!((beam.time_s - laser * 2.304e-6).abs() < 1e-15);
        assert_eq!(file.sensor.ring(row), 15 - row);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

    /// A job, its sensor file and an override with bytes removed, inserted and exchanged give a job or errors, never a
    /// panic. All messages can be shown.
    #[test]
    fn mutated_jobs_never_panic(edits in prop::collection::vec((any::<prop::sample::Index>(), 0..4_usize, prop::sample::select(
        vec!["", "[", "]", "{", "}", "\"", "=", ".", ",", "\n", "-", "é", "\u{1b}", "9e999", "nan", "[[sensor]]\n", "\u{0}", "1", "'", "#", "\r"])), 1..6))
    {
        let mut texts = [JOB.to_owned(), SENSOR.to_owned(), "sensor.top.range.max_m=50".to_owned()];
        for (index, (at, cut, insert)) in edits.iter().enumerate() {
            let text = &mut texts[index % 3];
            let start = text.floor_char_boundary(at.index(text.len() + 1));
            let end = text.ceil_char_boundary((start + cut).min(text.len()));
            text.replace_range(start..end, insert);
        }
        let found = match load(&texts[0], &texts[1], &[&texts[2]]) {
            Ok(job) => job.warnings,
            Err(found) => found,
        };
        let shown = beamcast::cli::diagnostics::render(&found, false);
        let is_raw = shown.contains(['\u{1b}', '\u{0}']);
        prop_assert!(!is_raw, "{shown:?}");
    }
}
