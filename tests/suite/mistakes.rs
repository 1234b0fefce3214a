//! Typical mistakes of new users, and the exact messages that they get.

use std::fs;
use std::path::Path;

use tempfile::TempDir;

/// A folder with a copy of the shipped job of the room, its sensor file and its scene.
struct Copy(TempDir);

impl Copy {
    fn new() -> Self {
        let copy = Self(tempfile::tempdir().unwrap());
        for folder in ["configs/sensors", "scenes"] {
            fs::create_dir_all(copy.0.path().join(folder)).unwrap();
        }
        for file in ["configs/room_vlp16.toml", "configs/sensors/velodyne_vlp16.toml", "scenes/room.glb"] {
            fs::copy(Path::new(env!("CARGO_MANIFEST_DIR")).join(file), copy.0.path().join(file)).unwrap();
        }
        copy
    }

    /// The copy with `old` replaced by `new` in one of its files.
    fn with(file: &str, old: &str, new: &str) -> Self {
        let copy = Self::new();
        let path = copy.0.path().join(file);
        let text = fs::read_to_string(&path).unwrap();
        assert_eq!(text.matches(old).count(), 1, "{file}: {old}");
        fs::write(path, text.replace(old, new)).unwrap();
        copy
    }

    /// Runs the program in the folder. Returns its exit code and its output.
    fn run(&self, args: &[&str]) -> (i32, String) {
        let mut command = super::cli::program();
        let output = command.args(args).current_dir(self.0.path()).output().unwrap();
        assert!(output.stdout.is_empty(), "{output:?}");
        (output.status.code().unwrap(), String::from_utf8(output.stderr).unwrap())
    }

    fn scan(&self) -> (i32, String) {
        self.run(&["scan", "configs/room_vlp16.toml"])
    }
}

fn says(code: i32, words: &str) -> (i32, String) {
    (code, words.to_owned())
}

#[test]
fn a_typo_in_a_key() {
    let copy = Copy::with("configs/sensors/velodyne_vlp16.toml", "columns = 1800", "colums = 1800");
    let expected = "\
error: unknown key `colums` in `[rotating]`
  --> configs/sensors/velodyne_vlp16.toml:24:1
   |
24 | colums = 1800 # firings a turn
   | ^^^^^^
   |
   = help: did you mean `columns`?

1 error
";
    assert_eq!(copy.scan(), says(2, expected));
}

#[test]
fn a_scene_that_is_not_there() {
    let copy = Copy::with("configs/room_vlp16.toml", "../scenes/room.glb", "../scenes/rom.glb");
    let expected = "error: scenes/rom.glb: there is no such file (did you mean `../scenes/room.glb`?)\n";
    assert_eq!(copy.scan(), says(3, expected));
    let copy = Copy::with("configs/room_vlp16.toml", "../scenes/room.glb", "../scene/room.glb");
    let expected = "error: scene/room.glb: there is no such file (there is no folder `scene`)\n";
    assert_eq!(copy.scan(), says(3, expected));
}

#[test]
fn a_job_that_is_not_there() {
    let expected = "\
error: there is no such file
--> configs/room.toml
 = help: the folder `configs` has `room_vlp16.toml`

1 error
";
    assert_eq!(Copy::new().run(&["scan", "configs/room.toml"]), says(2, expected));
}

#[test]
fn a_scene_without_triangles() {
    let copy = Copy::with("configs/room_vlp16.toml", "room.glb", "empty.gltf");
    let empty =
        r#"{ "asset": { "version": "2.0" }, "nodes": [{ "name": "camera" }], "scenes": [{ "nodes": [0] }] }"#;
    fs::write(copy.0.path().join("scenes/empty.gltf"), empty).unwrap();
    let expected = "error: scenes/empty.gltf: scene 0: the scene has 1 node, but no mesh with triangles \
                    (beams hit triangles: export meshes)\n";
    assert_eq!(copy.scan(), says(3, expected));
}

#[test]
fn a_sensor_with_counts_that_do_not_match() {
    let copy = Copy::with("configs/sensors/velodyne_vlp16.toml", "27.648, 29.952, 32.256, 34.560", "27.648");
    let expected = "\
error: `beam_times_us` has 13 values for 16 elevations
  --> configs/sensors/velodyne_vlp16.toml:20:17
   |
20 |   beam_times_us = [
   |  _________________^
21 | |     0.000, 2.304, 4.608, 6.912, 9.216, 11.520, 13.824, 16.128,
22 | |     18.432, 20.736, 23.040, 25.344, 27.648,
23 | | ]
   | |_^ expected 16: one a beam

1 error
";
    assert_eq!(copy.scan(), says(2, expected));
}

#[test]
fn an_output_folder_that_exists() {
    let copy = Copy::new();
    assert_eq!(copy.run(&["scan", "-q", "configs/room_vlp16.toml"]), says(0, ""));
    let expected = "error: out/room_vlp16/vlp16/000000.exr: exists already; --overwrite replaces it, \
                    --out DIR writes elsewhere\n";
    assert_eq!(copy.scan(), says(4, expected));
}

#[test]
fn files_given_where_others_belong() {
    let expected = "\
error: this is a sensor file, not a job
--> configs/sensors/velodyne_vlp16.toml
 = help: a job is a TOML file that names it as the `preset` of a `[[sensor]]`

1 error
";
    let copy = Copy::new();
    assert_eq!(copy.run(&["scan", "configs/sensors/velodyne_vlp16.toml"]), says(2, expected));
    let expected = "\
error: this is a glTF scene, not a job or a sensor file
--> scenes/room.glb
 = help: a job is a TOML file that names it as its `scene`, and the sensors that look at it

1 error
";
    assert_eq!(copy.run(&["scan", "scenes/room.glb"]), says(2, expected));
}

#[test]
fn more_threads_than_there_can_be() {
    let expected = "error: invalid value '65535' for '--threads <N>': 65535 is not in 1..=1024\n\n\
                    For more information, try '--help'.\n";
    assert_eq!(
        Copy::new().run(&["scan", "configs/room_vlp16.toml", "--threads", "65535"]),
        says(2, expected)
    );
}
