//! Jobs that are valid and useless: each gets a warning that says what was probably meant, and good jobs get none.

use std::fs;
use std::path::Path;

use beamcast::config;
use beamcast::source::Diagnostic;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// A good job, whose parts the tests replace.
const JOB: &str = r#"
scene = "room.glb"

[[sensor]]
name = "top"
pose = { position_m = [0.0, 0.0, 1.2], rpy_deg = [0.0, 0.0, 0.0] }

[sensor.rotating]
elevations_deg = { from = 15.0, to = -15.0, count = 4 }
columns = 36
rate_hz = 10.0

[sensor.range]
min_m = 0.1
max_m = 50.0

[output]
dir = "out"
"#;

/// A good camera in the place of the LiDAR.
const CAMERA: (&str, &str) = (
    "[sensor.rotating]\nelevations_deg = { from = 15.0, to = -15.0, count = 4 }\ncolumns = 36\nrate_hz = 10.0\n",
    "[sensor.pinhole]\nwidth_px = 64\nheight_px = 48\nfx_px = 60.0\nfy_px = 60.0\ncx_px = 32.0\ncy_px = 24.0\n",
);

/// A folder with a room and a job, in which each `old` is replaced by `new`.
fn folder_with(changes: &[(&str, &str)]) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::copy(Path::new(ROOT).join("scenes/room.glb"), folder.path().join("room.glb")).unwrap();
    let mut job = JOB.to_owned();
    for (old, new) in changes {
        assert_eq!(job.matches(old).count(), 1, "{old}");
        job = job.replace(old, new);
    }
    fs::write(folder.path().join("job.toml"), job).unwrap();
    folder
}

/// The warnings of reading the job.
fn warnings(changes: &[(&str, &str)]) -> Vec<Diagnostic> {
    let folder = folder_with(changes);
    config::load_job(&folder.path().join("job.toml"), &[])
        .unwrap_or_else(|e| panic!("{changes:?}: {e}"))
        .warnings
}

/// The errors of reading the job, as text.
fn errors(changes: &[(&str, &str)]) -> String {
    let folder = folder_with(changes);
    let error = config::load_job(&folder.path().join("job.toml"), &[]).expect_err("the job is wrong");
    assert_eq!(error.exit_code(), 2);
    error.to_string()
}

#[test]
fn values_of_a_probably_wrong_unit_or_order() {
    let camera = |old: &'static str, new: &'static str| vec![CAMERA, (old, new)];
    for (changes, code, key, help) in [
        (
            vec![("rpy_deg = [0.0, 0.0, 0.0]", "rpy_deg = [0.0, 0.0, 1.5708]")],
            "rpy-in-radians",
            "rpy_deg",
            "90 degrees",
        ),
        (
            vec![("rpy_deg = [0.0, 0.0, 0.0]", "quaternion_xyzw = [1.0, 0.0, 0.0, 0.0]")],
            "quaternion-order",
            "quaternion_xyzw",
            "[0.0, 0.0, 0.0, 1.0]",
        ),
        (
            vec![("pose = { position_m = [0.0, 0.0, 1.2], rpy_deg = [0.0, 0.0, 0.0] }\n", "")],
            "no-pose",
            "pose",
            "pose = {}",
        ),
        (
            vec![("columns = 36", "columns = 36\nsector_deg = { from = 3.14159, to = -3.14159 }")],
            "sector-in-radians",
            "sector_deg",
            "57.2958",
        ),
        (
            vec![("columns = 36", "columns = 36\nbeam_origins_m = [27.67, 0.0, 36.18]")],
            "beam-origin-unit",
            "beam_origins_m",
            "1000",
        ),
        (
            vec![("min_m = 0.1\nmax_m = 50.0", "min_m = 500.0\nmax_m = 50000.0")],
            "range-unit",
            "min_m",
            "min_m = 0.5",
        ),
        (
            camera("fx_px = 60.0\nfy_px = 60.0\ncx_px = 32.0\ncy_px = 24.0\n", "hfov_deg = 1.5\n"),
            "fov-in-radians",
            "hfov_deg",
            "85.9",
        ),
        (
            camera("fx_px = 60.0\nfy_px = 60.0", "fx_px = 0.9\nfy_px = 0.9"),
            "focal-length-unit",
            "fx_px",
            "57.6",
        ),
        (camera("fy_px = 60.0", "fy_px = 6.0"), "focal-lengths-differ", "fy_px", "square"),
        (camera("cx_px = 32.0", "cx_px = 0.5"), "principal-point", "cx_px", "32"),
        (vec![("dir = \"out\"", "dir = \"~/out\"")], "home-folder", "dir", "in full"),
    ] {
        let found = warnings(&changes);
        let warning =
            found.iter().find(|warning| warning.code == code).unwrap_or_else(|| panic!("{code}: {found:?}"));
        assert_eq!(warning.key, key);
        assert!(warning.line_column().0 > 3, "{warning}");
        assert!(warning.to_string().contains(help), "{warning}");
    }
    assert_eq!(warnings(&[]), []);
    assert_eq!(warnings(&[CAMERA]), []);
    // An empty pose says that the origin is meant.
    let empty = ("pose = { position_m = [0.0, 0.0, 1.2], rpy_deg = [0.0, 0.0, 0.0] }", "pose = {}");
    assert_eq!(warnings(&[empty]), []);
}

#[test]
fn keys_of_other_programs_have_an_answer() {
    for (old, new, key, answer) in [
        ("rpy_deg = [0.0, 0.0, 0.0]", "rotation = [0.0, 0.0, 0.0]", "rotation", "`rpy_deg`"),
        ("rate_hz = 10.0", "rpm = 600", "rpm", "rpm / 60"),
        ("from = 15.0, to = -15.0", "start = 15.0, end = -15.0", "start", "`from`"),
        ("max_m = 50.0", "max_m = 50.0\n[sensor.noise]\nstddev = 0.01", "noise", "not supported yet"),
        ("[output]", "[trajectory]\nfile = \"a.csv\"\n[output]", "file", "not supported yet"),
        ("dir = \"out\"", "dir = \"out\"\nchannels = [\"range\"]", "channels", "always written"),
        ("dir = \"out\"", "dir = \"out\"\nframes = 10", "frames", "one frame"),
        ("[output]", "[imu]\nrate_hz = 100\n[output]", "imu", "not supported yet"),
        ("[output]", "[weather]\nrain_mm_h = 10\n[output]", "weather", "not supported yet"),
        ("columns = 36", "columns = 36.0", "columns", "write 36"),
        ("[output]", "[labels]\nCube.001 = 3\n[output]", "Cube", "\"Cube.001\" = 3"),
        ("[output]", "[labels]\na.b.c = 3\n[output]", "a", "\"a.b.c\" = 3"),
        ("scene = \"room.glb\"", "scene = \"C:\\Users\\me\\room.glb\"", "", "in single quotes"),
        ("columns = 36", "columns = 36\npreset = \"~/a.toml\"", "preset", ""),
    ] {
        let said = errors(&[(old, new)]);
        assert!(said.contains(key) && said.contains(answer), "{new}: {said}");
        assert!(!said.contains("has no `rate_hz`") && !said.contains("has no `from`"), "told twice: {said}");
    }
}

#[test]
fn presets_that_are_other_files() {
    let folder = folder_with(&[("name = \"top\"", "name = \"top\"\npreset = \"PRESET\"")]);
    let here = folder.path();
    let job = fs::read_to_string(here.join("job.toml")).unwrap();
    fs::copy(Path::new(ROOT).join("configs/sensors/velodyne_vlp16.toml"), here.join("unit.conf")).unwrap();
    fs::copy(Path::new(ROOT).join("tests/import/ouster_flat.json"), here.join("unit.json")).unwrap();
    fs::copy(here.join("unit.json"), here.join("renamed.toml")).unwrap();
    for (preset, answer) in [
        ("unit.conf", "ends in `.toml`"),
        ("unit.json", "beamcast import"),
        ("renamed.toml", "beamcast import"),
        ("room.glb", "a glTF scene"),
        ("~/unit.toml", "in a shell only"),
        ("C:/unit.toml", "Windows"),
        ("velodyne/vlp16", "velodyne/vlp-16"),
    ] {
        fs::write(here.join("job.toml"), job.replace("PRESET", preset)).unwrap();
        let error = config::load_job(&here.join("job.toml"), &[]).expect_err(preset);
        assert!(error.to_string().contains(answer), "{preset}: {error}");
    }
}

/// Reports write `pose.position_m[2]` of a lone sensor, and `--set` takes that.
#[test]
fn what_reports_print_can_be_set() {
    let folder = folder_with(&[]);
    let height = |pair: &str| {
        let job = config::load_job(&folder.path().join("job.toml"), &[pair.to_owned()]).unwrap();
        job.sensors[0].body_from_sensor.translation.z
    };
    for pair in [
        "pose.position_m[2]=2",
        "sensor.top.pose.position_m[2]=2",
        "sensor[0].pose.position_m[2] = 2",
        "sensor.0.pose.position_m.2=2",
        "pose.position_m=[0, 0, 2]",
    ] {
        assert_eq!(height(pair), 2.0, "{pair}");
    }
    let two = JOB
        .replace("[output]", "[[sensor]]\nname = \"b\"\npreset = \"velodyne/vlp-16\"\npose = {}\n[output]");
    fs::write(folder.path().join("job.toml"), two).unwrap();
    let error =
        config::load_job(&folder.path().join("job.toml"), &["pose.position_m[2]=2".to_owned()]).unwrap_err();
    assert!(error.to_string().contains("`sensor.top.pose`"), "{error}");
}

#[test]
fn nothing_shipped_is_doubted() {
    for entry in fs::read_dir(Path::new(ROOT).join("configs")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "toml") {
            assert_eq!(config::load_job(&path, &[]).unwrap().warnings, [], "{}", path.display());
        }
    }
    for (name, _) in config::presets::BUILT_IN {
        assert_eq!(config::load_preset(name).unwrap().warnings, [], "{name}");
    }
}
