//! The commands around a job, as used by someone who has a scene and a sensor and begins in an empty folder: init, import,
//! info, schema, completions, man.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;
use tempfile::TempDir;

/// Runs beamcast in a folder.
fn beamcast(folder: &Path, args: &[&str]) -> Output {
    let mut command = super::cli::program();
    command.args(args).current_dir(folder).output().unwrap()
}

fn ok(folder: &Path, args: &[&str]) -> String {
    let output = beamcast(folder, args);
    assert!(output.status.success(), "{args:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// The exit code and the message of a command that fails.
fn fails(folder: &Path, args: &[&str]) -> (i32, String) {
    let output = beamcast(folder, args);
    assert!(output.stdout.is_empty(), "{args:?}: {}", String::from_utf8_lossy(&output.stdout));
    (output.status.code().unwrap(), String::from_utf8(output.stderr).unwrap())
}

fn project(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// A folder that is empty except for a scene.
fn folder() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    fs::copy(project("scenes/room.glb"), folder.path().join("my room.glb")).unwrap();
    folder
}

#[test]
fn a_calibration_becomes_a_sensor_a_job_and_a_frame() {
    let tmp = folder();
    let here = tmp.path();
    let calibration = project("tests/import/velodyne.yaml");
    let calibration = calibration.to_str().unwrap();
    ok(here, &["import", calibration, "-o", "sensors/unit.toml"]);
    let sensor = fs::read_to_string(here.join("sensors/unit.toml")).unwrap();
    assert!(sensor.starts_with("#:schema "), "{sensor}");
    assert_eq!(sensor, ok(here, &["import", calibration]), "stdout is the same file");

    let (code, said) = fails(here, &["import", calibration, "-o", "sensors/unit.toml"]);
    assert!(code == 4 && said.contains("is there already (--overwrite replaces it)"), "{code}: {said}");
    ok(here, &["import", calibration, "-o", "sensors/unit.toml", "--overwrite"]);

    // The job is in a folder of its own, and its paths are relative to that folder.
    ok(here, &["init", "--preset", "sensors/unit.toml", "--scene", "my room.glb", "-o", "jobs/first.toml"]);
    let job = fs::read_to_string(here.join("jobs/first.toml")).unwrap();
    assert!(job.contains("scene = \"../my room.glb\"\n"), "{job}");
    assert!(job.contains("preset = \"../sensors/unit.toml\"\n"), "{job}");
    let lint = beamcast(here, &["lint", "jobs/first.toml"]);
    assert!(lint.status.success() && lint.stderr.is_empty(), "{}", String::from_utf8_lossy(&lint.stderr));
    ok(here, &["scan", "jobs/first.toml", "-q"]);
    let (code, said) = fails(here, &["init", "-o", "jobs/first.toml"]);
    assert!(code == 4 && said.contains("is there already"), "{code}: {said}");

    // The outputs of the scan are as the job describes them.
    let scan: Value = serde_json::from_str(&ok(here, &["info", "--json", "jobs/out"])).unwrap();
    assert_eq!((&scan["kind"], &scan["sensors"][0]), (&"scan".into(), &"sensor".into()));
    let image: Value =
        serde_json::from_str(&ok(here, &["info", "--json", "jobs/out/sensor/000000.exr"])).unwrap();
    assert_eq!((&image["parts"][0]["rows"], &image["parts"][0]["columns"]), (&4.into(), &1800.into()));
    let cloud = ok(here, &["info", "jobs/out/sensor/000000.ply"]);
    assert!(
        cloud.contains("000000.ply: PLY\n") && cloud.contains("    ring          int    0 to 3\n"),
        "{cloud}"
    );
}

#[test]
fn lint_explains_a_job_that_has_its_scene_to_come() {
    let tmp = folder();
    let here = tmp.path();
    let calibration = project("tests/import/robosense.csv");
    ok(here, &["import", calibration.to_str().unwrap(), "-o", "sensor.toml"]);
    let said = String::from_utf8(beamcast(here, &["init", "--preset", "sensor.toml"]).stderr).unwrap();
    assert!(said.contains("wrote job.toml") && said.contains("there is no scene scene.glb yet"), "{said}");
    let (code, said) = fails(here, &["scan", "job.toml"]);
    assert!(code == 3 && said.contains("scene.glb: there is no such file"), "{code}: {said}");
}

#[test]
fn an_empty_folder_a_scene_and_a_built_in_sensor_are_enough() {
    let tmp = folder();
    let here = tmp.path();
    ok(here, &["init", "--scene", "my room.glb"]);
    let lint = beamcast(here, &["lint", "job.toml"]);
    assert!(lint.status.success() && lint.stderr.is_empty(), "{}", String::from_utf8_lossy(&lint.stderr));
    ok(here, &["scan", "job.toml", "-q"]);
    assert!(ok(here, &["info", "out"]).contains("sensors       sensor\n"));
}

#[test]
fn info_of_jobs_sensors_and_scenes() {
    let here = &project("");
    let facts = |path: &str| serde_json::from_str::<Value>(&ok(here, &["info", "--json", path])).unwrap();
    let scene = facts("scenes/room.glb");
    assert_eq!(
        (&scene["kind"], &scene["scene"]["centre_m"]),
        (&"scene".into(), &serde_json::json!([0.0, 0.0, 1.5]))
    );
    let job = facts("configs/street_rig.toml");
    let names: Vec<_> = job["sensors"].as_array().unwrap().iter().map(|s| &s["name"]).collect();
    assert_eq!(job["kind"], "job");
    assert_eq!(names, ["roof", "front_left", "windscreen"]);
    let sensor = ok(here, &["info", "configs/sensors/depth_camera.toml"]);
    assert!(sensor.contains("480 rows × 640 columns"), "{sensor}");
}

#[test]
fn files_that_are_no_such_files_are_inputs_that_are_wrong() {
    let tmp = folder();
    let here = tmp.path();
    let write = |name: &str, content: &[u8]| fs::write(here.join(name), content).unwrap();
    write("cut.exr", &[0x76, 0x2f, 0x31, 0x01, 2, 0, 0, 0, b'c']);
    write(
        "cut.ply",
        b"ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\nproperty double x\nend_header\n",
    );
    write("notes.txt", b"hello");
    write("manifest.json", b"{\"outputs\": [{\"path\": \"../../secret\"}]}");
    write("broken.glb", b"glTF");
    for name in ["cut.exr", "cut.ply", "notes.txt", "manifest.json", "broken.glb", "missing.exr", "."] {
        let (code, said) = fails(here, &["info", name]);
        assert!(code == 3 && said.starts_with("error: "), "{name}: {code}: {said}");
    }
    write("latin1.csv", b"Channel,Elevation,Azimuth\n1,2,\xb0\n");
    for (args, problem) in [
        (vec!["import", "notes.txt"], "this is no known calibration"),
        (vec!["import", "missing.json"], "there is no such file"),
        (vec!["import", "."], "this is a folder, not a file"),
        (vec!["import", "latin1.csv"], "byte 0xb0 in line 2"),
    ] {
        let (code, said) = fails(here, &args);
        assert!(code == 3 && said.contains(problem), "{args:?}: {code}: {said}");
    }
    let (code, said) = fails(here, &["import", "notes.txt", "--as", "hesai"]);
    assert!(code == 2 && said.contains("--> notes.txt:1:1"), "{code}: {said}");
}

#[test]
fn editors_shells_and_man_are_told() {
    let here = &project("");
    for of in ["job", "sensor"] {
        let schema: Value = serde_json::from_str(&ok(here, &["schema", of])).unwrap();
        assert_eq!(schema["$schema"], "http://json-schema.org/draft-07/schema#");
    }
    let page = ok(here, &["schema", "keys"]);
    assert!(page.starts_with("# Keys\n") && page.contains("| `max_m` | "), "{page}");
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = ok(here, &["completions", shell]);
        assert!(script.contains("overwrite") && script.contains("import"), "{shell}");
    }
    let page = ok(here, &["man"]);
    assert!(page.contains(".TH beamcast 1"), "{page}");
    assert!(page.contains(".SH \"BEAMCAST SCAN\"") && page.contains("overwrite"), "{page}");
}

#[test]
fn flags_mean_the_same_in_every_command() {
    let tmp = folder();
    let here = tmp.path();
    for (index, flag) in ["-o", "--out", "--output"].into_iter().enumerate() {
        let job = format!("job{index}.toml");
        ok(here, &["init", "--scene", "my room.glb", flag, &job]);
        ok(here, &["scan", "-q", &job, flag, &format!("frames{index}")]);
        ok(here, &["view", &format!("frames{index}"), flag, &format!("page{index}.html")]);
        let calibration = project("tests/import/velodyne.yaml");
        ok(here, &["import", calibration.to_str().unwrap(), flag, &format!("unit{index}.toml")]);
        for file in
            [format!("frames{index}/manifest.json"), format!("page{index}.html"), format!("unit{index}.toml")]
        {
            assert!(here.join(&file).is_file(), "{flag}: {file}");
        }
    }
    let both = ok(here, &["scan", "--json", "job0.toml", "job1.toml", "-o", "both"]);
    let both: Value = serde_json::from_str(&both).unwrap();
    assert_eq!(both["jobs"].as_array().map(Vec::len), Some(2));
    assert!(here.join("both/job0/manifest.json").is_file() && here.join("both/job1/manifest.json").is_file());
    assert_eq!(ok(here, &["presets", "velodyne/vlp-16"]), ok(here, &["presets", "show", "velodyne/vlp-16"]));
    assert!(ok(here, &["presets"]).contains("velodyne/vlp-16"));
}

#[test]
fn a_job_is_not_begun_with_a_sensor_that_does_not_exist() {
    let tmp = folder();
    let (code, said) = fails(tmp.path(), &["init", "--preset", "velodyne/vlp16"]);
    assert!(code == 2 && said.contains("did you mean `velodyne/vlp-16`?"), "{code}: {said}");
    assert!(!tmp.path().join("job.toml").exists());
    let said = String::from_utf8(beamcast(tmp.path(), &["init", "--preset", "later.toml"]).stderr).unwrap();
    assert!(said.contains("there is no sensor file later.toml yet"), "{said}");
}

/// Bash completes the names of built-in sensors and of channels.
#[test]
fn bash_knows_presets_and_channels() {
    let folder = folder();
    let script = ok(folder.path(), &["completions", "bash"]);
    fs::write(folder.path().join("beamcast.bash"), script).unwrap();
    let complete = |words: &str| {
        let run = format!(
            "source ./beamcast.bash; COMP_WORDS=(beamcast {words}); COMP_CWORD=$((${{#COMP_WORDS[@]}} - 1)); \
             _beamcast beamcast \"${{COMP_WORDS[COMP_CWORD]}}\" \"${{COMP_WORDS[COMP_CWORD - 1]}}\"; echo \"${{COMPREPLY[*]}}\""
        );
        let output = Command::new("bash").args(["--norc", "-c", &run]).current_dir(folder.path()).output();
        // A machine without bash needs no completions of it.
        output.ok().map(|output| String::from_utf8(output.stdout).unwrap().trim().to_owned())
    };
    for (words, found) in [
        ("presets show velodyne/vlp-16", "velodyne/vlp-16 velodyne/vlp-16-hi-res"),
        ("init --preset ideal/", "ideal/camera"),
        ("selftest kinect/", "kinect/v1 kinect/v2"),
        ("diff a b --channel id.s", "id.semantic"),
    ] {
        let Some(completed) = complete(words) else { return };
        assert_eq!(completed, found, "{words}");
    }
}

/// A drive is there with one command, and its job can be linted, cast and looked at.
#[test]
fn a_drive_is_ready_to_run() {
    let tmp = tempfile::tempdir().unwrap();
    let here = tmp.path();
    let init = beamcast(here, &["init", "--drive"]);
    let said = String::from_utf8_lossy(&init.stderr);
    assert!(init.status.success() && said.contains("wrote drive/drive.toml and 5 files beside it"), "{said}");
    let lint = beamcast(here, &["lint", "--strict", "drive/drive.toml"]);
    assert!(lint.status.success() && lint.stderr.is_empty(), "{}", String::from_utf8_lossy(&lint.stderr));
    ok(here, &["scan", "drive/drive.toml", "-q", "--frames", "50..52"]);
    ok(here, &["film", "drive/out", "-o", "drive.png", "--width", "160"]);
    let film = fs::read(here.join("drive.png")).unwrap();
    assert!(film.windows(4).any(|chunk| chunk == b"acTL"), "it is animated");
    // What moves has the labels of its files: 5 is a car, 6 a person, and 11 a bicycle.
    let manifest: Value =
        serde_json::from_slice(&fs::read(here.join("drive/out/manifest.json")).unwrap()).unwrap();
    let instances = manifest["scene"]["instances"].as_array().unwrap();
    for (actor, label) in
        [("oncoming car", 5), ("car ahead", 5), ("cyclist", 11), ("cyclist", 6), ("walker", 6)]
    {
        let is_one = |i: &&Value| {
            i["name"].as_str().is_some_and(|name| name.starts_with(actor)) && i["file_label"] == label
        };
        assert!(instances.iter().any(|i| is_one(&i)), "{actor}: {instances:?}");
    }

    let (code, said) = fails(here, &["init", "--drive"]);
    assert!(code == 4 && said.contains("is there already (--overwrite replaces it)"), "{code}: {said}");
    ok(here, &["init", "--drive", "--overwrite"]);
    ok(here, &["init", "--drive", "other/place"]);
    assert!(here.join("other/place/drive.toml").exists());
    assert_eq!(fails(here, &["init", "--drive", "--preset", "velodyne/vlp-16"]).0, 2);
}
