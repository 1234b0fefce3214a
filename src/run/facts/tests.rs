//! Tests of the facts about files.

use std::collections::BTreeMap;

use glam::{DAffine3, DVec3};

use super::*;
use crate::angle::Angle;
use crate::scan::Frame;
use crate::scene::{Material, Object, SceneBuilder, SourceInstance, SourceMesh, SourcePart};
use crate::sensor::{Camera, Pattern, RangeLimits, RingOrder};

#[test]
fn sizes_of_a_cameras_frames() {
    let camera = Camera::from_hfov((640, 480), Angle::deg(90.0), None).unwrap();
    let sensor = Sensor {
        pattern: Pattern::Camera(camera),
        range: RangeLimits::default(),
        ring: RingOrder::Row,
        measurement: Default::default(),
    };
    let sizes = SensorSizes::of(Some("front"), &sensor, &Format::all().collect::<Vec<_>>());
    assert_eq!(sizes.output_bytes["exr"], 640 * 480 * 48);
    assert_eq!(sizes.frame_bytes, 640 * 480 * Frame::BYTES_A_PIXEL as u64);
    assert_eq!(SensorSizes::of(None, &sensor, &[Format::PLY]).output_bytes.len(), 1);
    let json = serde_json::to_value(&sizes).unwrap();
    assert_eq!((&json["name"], &json["rows"]), (&"front".into(), &480.into()));
}

#[test]
fn facts_of_a_scene() {
    let part = SourcePart { triangles: vec![[0, 1, 2], [0, 2, 3]], material: 0, ..SourcePart::default() };
    let square = vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let placed = |label, x| SourceInstance {
        mesh: 0,
        world_from_mesh: DAffine3::from_translation(DVec3::new(x, 0.0, 0.0)),
        object: Object {
            name: format!("box_{x}"),
            job_label: Some(label),
            file_label: Some(3),
            ..Object::default()
        },
        ..SourceInstance::default()
    };
    let builder = SceneBuilder {
        meshes: vec![SourceMesh { positions: square, parts: vec![part] }],
        instances: vec![placed(7, 0.0), placed(3, 2.0), placed(7, 4.0)],
        materials: vec![Material::default()],
        files: vec![],
        groups: vec![],
    };
    let facts = SceneFacts::of("a.glb", &builder.build().unwrap(), &[("crate".to_owned(), 7)].into());
    assert_eq!((facts.triangles, facts.stored_triangles, facts.instances), (6, 2, 3));
    assert_eq!(facts.labels, [3, 7]);
    assert_eq!(facts.label_names, [(3, "box".to_owned()), (7, "crate".to_owned())].into());
    assert_eq!(facts.extent_m, [[0.0, 5.0], [0.0, 1.0], [0.0, 0.0]]);
    // A mesh of two triangles is stored once, and placed three times.
    assert!(facts.memory_bytes > 3 * 600);
    let json = serde_json::to_value(&facts).unwrap();
    assert_eq!((&json["path"], &json["triangles"]), (&"a.glb".into(), &6.into()));
}

#[test]
fn a_folder_is_walked_in_order_and_everything_wrong_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    };
    let camera = "[pinhole]\nwidth_px = 4\nheight_px = 3\nhfov_deg = 90\n";
    write("sensors/good.toml", camera);
    write("b.toml", &camera.replace("hfov_deg", "hfov_rad"));
    write(".hidden/c.toml", "nonsense");
    write(
        "a.toml",
        "scene = 'romo.glb'\noutput.dir = 'out'\n[[sensor]]\npreset = 'sensors/good.toml'\npose = {}\n",
    );
    write("room.glb", "");
    let Examined { facts, problems: diagnostics, .. } = examine(&[folder.path().to_path_buf()], &[]);
    assert_eq!(facts.len(), 1);
    assert_eq!((facts[0].kind, facts[0].sensors[0].facts.rays_per_frame), ("sensor", 12));
    let told: BTreeMap<_, _> = diagnostics
        .iter()
        .map(|d| (d.path.file_name().unwrap().to_str().unwrap(), d.help.as_deref().unwrap()))
        .collect();
    let expected =
        [("b.toml", "did you mean `hfov_deg`, in degrees?"), ("romo.glb", "did you mean `room.glb`?")];
    assert_eq!(told, BTreeMap::from(expected));

    let empty = tempfile::tempdir().unwrap();
    let diagnostics = examine(&[empty.path().to_path_buf()], &[]).problems;
    assert_eq!(diagnostics[0].message, "the folder has no *.toml files");
}
