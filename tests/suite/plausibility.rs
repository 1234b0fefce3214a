//! Jobs that are valid and useless: each gets a warning that says what was probably meant, and good jobs get none.

use std::fs;
use std::path::Path;

use beamcast::config;
use beamcast::source::Diagnostic;

use crate::shapes::cuboid;

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
        ("max_m = 50.0", "max_m = 50.0\n[sensor.noise]\nstddev = 0.01", "stddev", "`range_floor_m`"),
        ("[output]", "[trajectory]\nwaypoints = []\n[output]", "waypoints", "`poses`"),
        ("dir = \"out\"", "dir = \"out\"\nframes = 10", "frames", "`[sequence]`"),
        ("[output]", "[imu]\nrate_hz = 100\n[output]", "imu", "not supported yet"),
        ("[output]", "[weather]\nrain = 10\n[output]", "rain", "`rain_mm_h`"),
        ("columns = 36", "columns = 36.0", "columns", "write 36"),
        // The case blender_dot_names.
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

/// Runs beamcast in a folder. Returns its exit code and its output.
fn beamcast(folder: &Path, args: &[&str]) -> (i32, String, String) {
    let mut command = super::cli::program();
    let output = command.args(args).current_dir(folder).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8_lossy(&bytes).into_owned();
    (output.status.code().unwrap(), text(output.stdout), text(output.stderr))
}

/// The codes of the warnings in the JSON of lint, scan or check.
fn codes(json: &str, pointer: &str) -> Vec<String> {
    let json: serde_json::Value = serde_json::from_str(json).unwrap_or_else(|e| panic!("{e}: {json}"));
    let all =
        json.pointer(pointer).and_then(|all| all.as_array()).unwrap_or_else(|| panic!("{pointer}: {json:#}"));
    all.iter().filter_map(|warning| warning["code"].as_str().map(str::to_owned)).collect()
}

/// A glTF file of quads and boxes: (name, least corner, largest corner) in glTF's axes. A box without height is a floor that
/// faces up.
pub(super) fn write_scene(path: &Path, objects: &[(&str, [f32; 3], [f32; 3])]) {
    let (mut bytes, mut meshes, mut nodes, mut views, mut accessors) =
        (Vec::new(), vec![], vec![], vec![], vec![]);
    for (index, (name, low, high)) in objects.iter().enumerate() {
        let mut solid = cuboid(*low, *high);
        let triangles =
            if low[1] == high[1] { vec![[0, 4, 1], [1, 4, 5]] } else { solid.parts.swap_remove(0).triangles };
        let start = bytes.len();
        let positions: Vec<u8> = solid.positions.into_iter().flatten().flat_map(f32::to_le_bytes).collect();
        let indices: Vec<u8> = triangles.concat().into_iter().map(|index| index as u8).collect();
        bytes.extend(&positions);
        bytes.extend(&indices);
        while bytes.len() % 4 != 0 {
            bytes.push(0);
        }
        views.push(serde_json::json!({ "buffer": 0, "byteOffset": start, "byteLength": positions.len() }));
        views.push(serde_json::json!({ "buffer": 0, "byteOffset": start + positions.len(), "byteLength": indices.len() }));
        accessors.push(serde_json::json!({ "bufferView": 2 * index, "componentType": 5126, "count": 8, "type": "VEC3", "min": low, "max": high }));
        accessors.push(serde_json::json!({ "bufferView": 2 * index + 1, "componentType": 5121, "count": indices.len(), "type": "SCALAR" }));
        meshes.push(serde_json::json!({ "primitives": [{ "attributes": { "POSITION": 2 * index }, "indices": 2 * index + 1 }] }));
        nodes.push(serde_json::json!({ "name": name, "mesh": index }));
    }
    let scene = serde_json::json!({
        "asset": { "version": "2.0" }, "meshes": meshes, "nodes": nodes, "accessors": accessors, "bufferViews": views,
        "scenes": [{ "nodes": (0..objects.len()).collect::<Vec<_>>() }],
        "buffers": [{ "uri": "scene.bin", "byteLength": bytes.len() }],
    });
    fs::write(path.with_file_name("scene.bin"), bytes).unwrap();
    fs::write(path, scene.to_string()).unwrap();
}

/// A hall of 20 m by 18 m by 5 m in glTF's axes, with a floor, two walls and a person.
const HALL: &[(&str, [f32; 3], [f32; 3])] = &[
    ("floor", [-10.0, 0.0, -9.0], [10.0, 0.0, 9.0]),
    ("north", [-10.0, 0.0, -9.2], [10.0, 5.0, -9.0]),
    ("east", [10.0, 0.0, -9.0], [10.2, 5.0, 9.0]),
    ("person", [2.0, 0.1, -0.3], [2.6, 1.8, 0.3]),
];

/// The hall with every length times `factor`, and with its axes turned.
fn hall(factor: f32, axes: [usize; 3]) -> Vec<(&'static str, [f32; 3], [f32; 3])> {
    let moved = |p: [f32; 3]| axes.map(|axis| p[axis] * factor);
    HALL.iter().map(|&(name, low, high)| (name, moved(low), moved(high))).collect()
}

/// Every rule about the scene: the warning is there in lint, scan and check, with its place, and --strict refuses the job.
#[test]
fn sensors_that_do_not_fit_their_scene() {
    let pose = "pose = { position_m = [0.0, 0.0, 1.2], rpy_deg = [0.0, 0.0, 0.0] }";
    let at = |position: &str| vec![(pose, format!("pose = {{ position_m = {position} }}"))];
    let upright = [0, 1, 2];
    let y_and_z = [0, 2, 1];
    let up = vec![
        (CAMERA.0, CAMERA.1.to_owned()),
        (pose, "pose = { position_m = [0.0, 0.0, 1.2], rpy_deg = [0.0, -60.0, 90.0] }".to_owned()),
    ];
    for (factor, axes, changes, code, words) in [
        (1.0, upright, at("[0.0, 0.0, 1200.0]"), "far-outside", "millimetres"),
        (1.0, upright, at("[100.0, 0.0, 120.0]"), "far-outside", "centimetres"),
        (1.0, upright, at("[3000.0, 9000.0, 1.0]"), "far-outside", "outside the scene"),
        (1.0, upright, at("[2.3, 0.0, 1.2]"), "inside-object", "inside `person`"),
        (1.0, upright, at("[0.0, 0.0, -0.6]"), "below-floor", "below `floor`"),
        (1000.0, upright, at("[0.0, 0.0, 1.2]"), "scene-unit", "millimetres"),
        (100.0, upright, at("[0.0, 0.0, 1.2]"), "scene-unit", "centimetres"),
        (0.01, upright, at("[0.0, 0.0, 0.012]"), "scene-unit", "0.2 m across"),
        (1.0, y_and_z, at("[0.0, 0.0, 1.2]"), "scene-up", "up = \"y\""),
        (1.0, upright, up, "sees-nothing", "along +y, 60° up"),
        (
            1.0,
            upright,
            vec![(
                "[output]",
                "[[expect]]\nname = \"e\"\npoints = { object = \"persn\", at_least = 1 }\n[output]"
                    .to_owned(),
            )],
            "unknown-object",
            "did you mean `person`?",
        ),
        (
            1.0,
            upright,
            vec![(
                "[output]",
                "[[expect]]\nname = \"e\"\npoints = { label = 77, at_least = 1 }\n[output]".to_owned(),
            )],
            "unknown-object",
            "no surface of the scene has label 77",
        ),
        (
            1.0,
            upright,
            vec![(
                "[output]",
                "[trajectory.pose]\nposition_m = [451000.0, 0.0, 0.0]\n[output]\nframe = \"world\""
                    .to_owned(),
            )],
            "coarse-cloud",
            "in steps of 31.25 mm",
        ),
    ] {
        let changes: Vec<(&str, &str)> = changes
            .iter()
            .map(|(old, new)| (*old, new.as_str()))
            .chain([("room.glb", "scene.gltf")])
            .collect();
        let folder = folder_with(&changes);
        let here = folder.path();
        write_scene(&here.join("scene.gltf"), &hall(factor, axes));
        let (exit, json, said) = beamcast(here, &["lint", "--json", "job.toml"]);
        assert!(exit == 0 && codes(&json, "/diagnostics").contains(&code.to_owned()), "{code}: {json}{said}");
        assert!(said.contains(words) && said.contains("job.toml:"), "{code}: {said}");
        let (exit, _, said) = beamcast(here, &["lint", "--strict", "job.toml"]);
        assert!(exit == 2 && said.contains("error: "), "{code}: {exit}: {said}");
        let (exit, _, said) = beamcast(here, &["scan", "--strict", "job.toml"]);
        assert!(exit == 2 && said.contains(words), "{code}: {exit}: {said}");
        assert!(!here.join("out").exists(), "{code}: written in spite of --strict");
        let (exit, json, said) = beamcast(here, &["scan", "--json", "job.toml"]);
        assert!(exit == 0 && said.contains(words), "{code}: {exit}: {said}");
        assert!(codes(&json, "/diagnostics").contains(&code.to_owned()), "{code}: {json}");
        let (exit, _, said) = beamcast(here, &["check", "--strict", "job.toml"]);
        assert!(exit == 2 && said.contains(words), "{code}: {exit}: {said}");
        let (_, json, said) = beamcast(here, &["check", "--json", "-", "job.toml"]);
        assert!(said.contains(words), "{code}: {said}");
        assert!(codes(&json, "/jobs/0/warnings").contains(&code.to_owned()), "{code}: {json}");
    }
    // The same job in the hall as it should be has no warning, and lint says where the sensor looks.
    for axes in [upright, y_and_z] {
        let up =
            if axes == upright { "scene = \"scene.gltf\"" } else { "scene = \"scene.gltf\"\nup = \"y\"" };
        let folder = folder_with(&[("scene = \"room.glb\"", up)]);
        write_scene(&folder.path().join("scene.gltf"), &hall(1.0, axes));
        let (exit, facts, said) = beamcast(folder.path(), &["lint", "--strict", "job.toml"]);
        assert_eq!((exit, said.as_str()), (0, ""), "{facts}");
        assert!(facts.contains("at (0, 0, 1.2) m, looks along +x, level"), "{facts}");
    }
}

#[test]
fn frames_without_a_return_are_not_accepted() {
    let pose = "pose = { position_m = [0.0, 0.0, 1.2], rpy_deg = [0.0, 0.0, 0.0] }";
    let folder = folder_with(&[(pose, "pose = { position_m = [0.0, 0.0, 900.0] }")]);
    let accept = |more: &[&str]| {
        let mut command = super::cli::program();
        command.args(["check", "--accept", "job.toml"]).args(more).current_dir(folder.path());
        let output = command.output().unwrap();
        (output.status.code().unwrap(), String::from_utf8_lossy(&output.stdout).into_owned())
    };
    let (exit, said) = accept(&[]);
    assert!(
        exit == 1 && said.contains("sensor top sees nothing") && said.contains("--allow-empty"),
        "{exit}: {said}"
    );
    assert!(!folder.path().join("job.baseline").exists());
    assert_eq!(accept(&["--allow-empty"]).0, 0);
    assert!(folder.path().join("job.baseline").exists());
}

#[test]
fn shipped_jobs_fit_their_scenes() {
    let (exit, _, said) = beamcast(Path::new(ROOT), &["lint", "--strict", "configs"]);
    assert_eq!((exit, said.as_str()), (0, ""));
}
