//! Scenes as they lie in folders, and what the command line tells of them: links, folders that are allowed on purpose, names
//! with codes, notes, and the names that a file holds.

use std::fs;
use std::path::Path;

use serde_json::{Value, json};
use tempfile::TempDir;

use crate::cli::{beamcast, code, stderr, stdout};
use crate::hostile_scenes::{buffer, triangle};

const SENSOR: &str = "[[sensor]]\nname = \"c\"\npose = { position_m = [0.3, -0.5, 0.3], rpy_deg = [0.0, 0.0, 90.0] }\n[sensor.pinhole]\nwidth_px = 4\nheight_px = 3\nhfov_deg = 60.0\nrate_hz = 10.0\n\
                      [output]\ndir = \"out\"\nformats = [\"exr\"]\n";

/// A folder with a job that names the scene `scene`, whose buffer's uri is `uri`.
fn workplace(scene: &str, uri: &str) -> TempDir {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join(scene);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    fs::write(path, triangle(Some(uri)).to_string()).unwrap();
    fs::write(folder.path().join("job.toml"), format!("scene = \"{scene}\"\n{SENSOR}")).unwrap();
    folder
}

fn path_in(folder: &Path, name: &str) -> String {
    folder.join(name).to_str().unwrap().to_owned()
}

fn triangles(folder: &Path, scene: &str) -> Result<u64, String> {
    let output = beamcast(&["lint", "--json", &path_in(folder, scene)]);
    if code(&output) != 0 {
        return Err(stderr(&output));
    }
    let facts: Value = serde_json::from_str(&stdout(&output)).unwrap();
    Ok(facts["files"][0]["scene"]["triangles"].as_u64().unwrap())
}

/// The case symlinked_store: the files of a project are links into a store, where each has a folder and a name of its own.
#[cfg(unix)]
#[test]
fn links_into_a_store_are_read_as_they_were_laid() {
    use std::os::unix::fs::symlink;
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    for made in ["proj", "store/ab/1", "store/cd/2", "elsewhere"] {
        fs::create_dir_all(at(made)).unwrap();
    }
    fs::write(at("store/ab/1/4f0a"), triangle(Some("scene.bin")).to_string()).unwrap();
    fs::write(at("store/cd/2/77b1"), buffer()).unwrap();
    fs::write(at("elsewhere/secret.bin"), buffer()).unwrap();
    symlink("../store/ab/1/4f0a", at("proj/scene.gltf")).unwrap();
    symlink("../store/cd/2/77b1", at("proj/scene.bin")).unwrap();
    assert_eq!(triangles(folder.path(), "proj/scene.gltf"), Ok(1));
    // The link's own folder comes first, and the folder of the real file after it.
    fs::remove_file(at("proj/scene.bin")).unwrap();
    fs::write(at("store/ab/1/scene.bin"), buffer()).unwrap();
    assert_eq!(triangles(folder.path(), "proj/scene.gltf"), Ok(1));
    // A buffer's link that leads out of the project and the store is refused, and so are devices and pipes.
    for target in ["../elsewhere/secret.bin", "/dev/zero", "/proc/self/environ"] {
        symlink(target, at("proj/scene.bin")).unwrap();
        let error = triangles(folder.path(), "proj/scene.gltf").unwrap_err();
        assert!(error.contains("leaves the scene's folder through a link"), "{error}");
        fs::remove_file(at("proj/scene.bin")).unwrap();
    }
    // A scene that is no link has no store.
    fs::remove_file(at("proj/scene.gltf")).unwrap();
    fs::write(at("proj/scene.gltf"), triangle(Some("scene.bin")).to_string()).unwrap();
    symlink("../store/cd/2/77b1", at("proj/scene.bin")).unwrap();
    let error = triangles(folder.path(), "proj/scene.gltf").unwrap_err();
    assert!(error.contains("leaves the scene's folder through a link"), "{error}");
}

/// The case bin_in_parent.
#[test]
fn a_folder_is_opened_to_scenes_on_purpose() {
    let folder = workplace("models/scene.gltf", "../buffers/scene.bin");
    let at = |name: &str| path_in(folder.path(), name);
    for made in ["buffers", "other"] {
        fs::create_dir(at(made)).unwrap();
        fs::write(at(&format!("{made}/scene.bin")), buffer()).unwrap();
    }
    let (job, scene, out) = (at("job.toml"), at("models/scene.gltf"), at("out"));
    let page = at("page.html");
    let commands: [&[&str]; 8] = [
        &["lint", &scene],
        &["lint", &job],
        &["info", &scene],
        &["scan", &job, "--out", &out, "--overwrite"],
        &["bench", &job, "--repeat", "1"],
        &["view", &job, "--output", &page, "--overwrite"],
        &["diff", &job, &job],
        &["check", &job],
    ];
    fs::write(
        &job,
        fs::read_to_string(&job).unwrap() + "[[expect]]\nname = \"any\"\nreturns = { at_least = 0.0 }\n",
    )
    .unwrap();
    for command in commands {
        let refused = beamcast(command);
        assert_eq!(code(&refused), 3, "{command:?}: {}", stderr(&refused));
        assert!(stderr(&refused).contains("leaves the scene's folder"), "{command:?}: {}", stderr(&refused));
        assert!(stderr(&refused).contains("--allow-folder DIR"), "{command:?}: {}", stderr(&refused));
        let wrong = beamcast(&[command, &["--allow-folder", &at("other")]].concat());
        assert_eq!(code(&wrong), 3, "{command:?}: {}", stderr(&wrong));
        let allowed = beamcast(
            &[command, &["--allow-folder", &at("other"), "--allow-folder", &at("buffers")]].concat(),
        );
        assert_eq!(code(&allowed), 0, "{command:?}: {}", stderr(&allowed));
    }
    let missing = beamcast(&["lint", &scene, "--allow-folder", &at("none")]);
    assert_eq!(code(&missing), 3);
    assert!(stderr(&missing).contains("there is no such file"), "{}", stderr(&missing));
    // A device is no file, whatever folder is open.
    fs::write(&scene, triangle(Some("../../../../../../../../../../dev/zero")).to_string()).unwrap();
    let device = beamcast(&["lint", &scene, "--allow-folder", "/"]);
    assert_eq!(code(&device), 3);
    assert!(stderr(&device).contains("this is a pipe or a device, not a file"), "{}", stderr(&device));
}

/// The case uri_literal_pct20.
#[test]
fn a_name_with_codes_is_taken_as_it_is_where_the_decoded_one_is_missing() {
    let folder = workplace("scene.gltf", "big%20ball.bin");
    fs::write(folder.path().join("big%20ball.bin"), buffer()).unwrap();
    assert_eq!(triangles(folder.path(), "scene.gltf"), Ok(1));
    // The decoded name comes first.
    fs::write(folder.path().join("big ball.bin"), &buffer()[..10]).unwrap();
    assert!(triangles(folder.path(), "scene.gltf").unwrap_err().contains("it has 10 bytes"));
    fs::remove_file(folder.path().join("big ball.bin")).unwrap();
    fs::remove_file(folder.path().join("big%20ball.bin")).unwrap();
    assert!(triangles(folder.path(), "scene.gltf").unwrap_err().contains("there is no such file"));
}

#[test]
fn a_path_of_windows_is_read_with_a_warning() {
    let folder = workplace("scene.gltf", "data\\scene.bin");
    fs::create_dir(folder.path().join("data")).unwrap();
    fs::write(folder.path().join("data/scene.bin"), buffer()).unwrap();
    let output = beamcast(&["lint", &path_in(folder.path(), "scene.gltf")]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let expected = "buffer 0: its uri has backslashes, which are read as slashes";
    assert!(stderr(&output).contains(expected), "{}", stderr(&output));
}

/// A scene with a warning and a note.
fn odd_scene() -> TempDir {
    let folder = workplace("scene.vrm", "scene.bin");
    fs::write(folder.path().join("scene.bin"), buffer()).unwrap();
    let mut scene = triangle(Some("scene.bin"));
    scene["nodes"] = json!([{ "name": "Car", "mesh": 0, "rotation": [0, 0, 0, 0] }]);
    scene["animations"] = json!([{ "name": "walk" }]);
    fs::write(folder.path().join("scene.vrm"), scene.to_string()).unwrap();
    folder
}

const WARNING: &str = "node 0 \"Car\": its quaternion is zero, and read as no rotation";
const NOTE: &str = "animation 0 \"walk\": it moves nothing";

#[test]
fn every_command_tells_the_same_of_a_scene() {
    let folder = odd_scene();
    let at = |name: &str| path_in(folder.path(), name);
    let (job, scene) = (at("job.toml"), at("scene.vrm"));
    for command in [["lint", &scene], ["lint", &job], ["info", &scene], ["info", &job]] {
        let output = beamcast(&command);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        assert!(stderr(&output).contains(&format!("warning: {WARNING}")), "{}", stderr(&output));
        assert!(stderr(&output).contains(&format!("note: {NOTE}")), "{}", stderr(&output));
        assert!(stderr(&output).contains("1 warning, 1 note"), "{}", stderr(&output));
    }
    let scan =
        |flags: &[&str]| beamcast(&[&["scan", &job, "--overwrite", "--out", &at("out")], flags].concat());
    let plain = stderr(&scan(&[]));
    assert!(plain.contains(&format!("warning: {WARNING}")) && !plain.contains("animation"), "{plain}");
    let verbose = stderr(&scan(&["-v"]));
    assert!(verbose.contains(&format!("note: {NOTE}\nwarning: {WARNING}\n")), "{verbose}");
    assert_eq!(stderr(&scan(&["-q"])), "");
    for command in [&["lint", "--json", &scene][..], &["info", "--json", &scene]] {
        let json: Value = serde_json::from_str(&stdout(&beamcast(command))).unwrap();
        check_diagnostics(&json);
    }
    for flags in [&["--json"][..], &["--json", "--dry-run"]] {
        check_diagnostics(&serde_json::from_str(&stdout(&scan(flags))).unwrap());
    }
}

fn check_diagnostics(json: &Value) {
    let found: Vec<_> = json["diagnostics"]
        .as_array()
        .unwrap_or_else(|| panic!("{json}"))
        .iter()
        .map(|d| (d["severity"].as_str().unwrap(), d["message"].as_str().unwrap()))
        .collect();
    assert_eq!(found, [("note", NOTE), ("warning", WARNING)]);
}

/// An image of one colour is kept as one texel, and told as large as its file has it. A material's two textures may show one image.
#[test]
fn info_tells_what_alpha_does_and_which_images_there_are() {
    let folder = odd_scene();
    let mut scene = triangle(Some("scene.bin"));
    scene["meshes"][0]["primitives"][0]["material"] = json!(0);
    scene["materials"] = json!([
        {
            "name": "leaf\u{7}",
            "alphaMode": "MASK",
            "alphaCutoff": 0.25,
            "pbrMetallicRoughness": {
                "baseColorTexture": { "index": 0 },
                "metallicRoughnessTexture": { "index": 0 },
            },
            "extensions": { "KHR_materials_transmission": {
                "transmissionFactor": 0.5, "transmissionTexture": { "index": 1 } } },
        },
        { "name": "pane", "alphaMode": "BLEND" },
        { "name": "wall" },
    ]);
    scene["textures"] = json!([{ "source": 0 }, { "source": 1 }]);
    let png = |content: &str| format!("data:image/png;base64,{content}");
    scene["images"] = json!([
        { "uri": png("iVBORw0KGgoAAAANSUhEUgAAAAIAAAABCAAAAADRSSBWAAAAC0lEQVR4nGNQaAAAAMMAoUn2EtEAAAAASUVORK5CYII=") },
        { "uri": png("iVBORw0KGgoAAAANSUhEUgAAAAMAAAACCAAAAAC4HznGAAAADklEQVR4nGNwcHBgAGIABggBgULGvLsAAAAASUVORK5CYII=") },
    ]);
    fs::write(folder.path().join("leaf.gltf"), scene.to_string()).unwrap();
    let path = path_in(folder.path(), "leaf.gltf");
    let text = stdout(&beamcast(&["info", &path]));
    for line in [
        "    alpha         MASK below 0.25 of \"leaf\\u{7}\", BLEND of \"pane\"\n",
        "    textures      2 images: 2 × 1 PNG, 3 × 2 PNG\n",
    ] {
        assert!(text.contains(line), "{line:?} in:\n{text}");
    }
    let json: Value = serde_json::from_str(&stdout(&beamcast(&["info", "--json", &path]))).unwrap();
    let image = |width, height| json!({ "format": "PNG", "width": width, "height": height, "materials": 1 });
    assert_eq!(json["scene"]["images"], json!([image(2, 1), image(3, 2)]));
    let alpha = |material, mode, cutoff| json!({ "material": material, "mode": mode, "cutoff": cutoff });
    let expected = json!([alpha("leaf\u{7}", "MASK", Some(0.25)), alpha("pane", "BLEND", None)]);
    assert_eq!(json["scene"]["alpha"], expected);
}

#[test]
fn info_lists_what_a_scene_holds_by_name() {
    // The cases cameras and animations.
    let folder = odd_scene();
    let mut scene = triangle(Some("scene.bin"));
    scene["scenes"] = json!([{ "name": "day", "nodes": [0] }, { "name": "night", "nodes": [0] }]);
    scene["scene"] = json!(1);
    scene["nodes"] = json!([
        { "name": "Root", "children": [2, 1] },
        { "name": "Camera", "camera": 0 },
        { "mesh": 0, "children": [3] },
        { "name": "bell\u{7}" },
    ]);
    scene["meshes"][0]["name"] = json!("Wall");
    scene["materials"] = json!([{ "name": "paint" }, {}]);
    scene["cameras"] =
        json!([{ "name": "Cam", "type": "perspective", "perspective": { "yfov": 0.8, "znear": 0.1 } }]);
    scene["accessors"].as_array_mut().unwrap().push(json!({ "max": [1.5] }));
    let times = scene["accessors"].as_array().unwrap().len() - 1;
    scene["animations"] = json!([
        {
            "name": "walk",
            "channels": [
                { "sampler": 0, "target": { "node": 2, "path": "translation" } },
                { "sampler": 0, "target": { "path": "pointer", "extensions": {
                    "KHR_animation_pointer": { "pointer": "/nodes/0/extensions/KHR_node_visibility/visible" } } } },
            ],
            "samplers": [{ "input": times, "output": 0 }],
        },
        {},
    ]);
    scene["skins"] = json!([{ "name": "bones", "joints": [2, 3] }]);
    fs::write(folder.path().join("scene.vrm"), scene.to_string()).unwrap();
    let path = path_in(folder.path(), "scene.vrm");
    let text = stdout(&beamcast(&["info", &path]));
    let expected = "    scenes        0 \"day\", 1 \"night\" (the default)
    materials     0 \"paint\", 1
    cameras       0 \"Cam\", perspective
    animations    0 \"walk\" (1.5 s, 2 nodes), 1 (0 nodes)
    skins         0 \"bones\" (2 joints)
    nodes         4
      0 \"Root\"
        2: mesh 0 \"Wall\"
          3 \"bell\\u{7}\"
        1 \"Camera\": camera 0 \"Cam\"
";
    assert!(text.ends_with(expected), "{text}");
    let json: Value = serde_json::from_str(&stdout(&beamcast(&["info", "--json", &path]))).unwrap();
    let outline = &json["outline"];
    assert_eq!(outline["nodes"][1], json!({ "name": "Camera", "children": [], "mesh": null, "camera": 0 }));
    assert_eq!(outline["cameras"], json!([{ "name": "Cam", "kind": "perspective", "nodes": [1] }]));
    let walk = json!({ "name": "walk", "length_s": 1.5, "nodes": [0, 2] });
    assert_eq!(outline["animations"], json!([walk, { "name": null, "length_s": null, "nodes": [] }]));
    assert_eq!(outline["skins"], json!([{ "name": "bones", "joints": [2, 3] }]));
    assert_eq!(outline["default_scene"], json!(1));
    assert_eq!(outline["meshes"], json!([{ "name": "Wall", "materials": [null] }]));
}
