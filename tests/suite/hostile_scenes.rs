//! Scene files that attack the loader: they try to read other files, to exhaust memory or time, or to cause a panic.

use std::path::Path;
use std::sync::mpsc;
use std::time::Duration;

use beamcast::error::SceneError;
use beamcast::scene::gltf::{Loaded, Options, load};
use proptest::prelude::*;
use serde_json::{Value, json};
use tempfile::TempDir;

/// The longest time that any file here may take. It is generous because other tests run at the same time.
const TIMEOUT: Duration = Duration::from_secs(10);

/// Loads the default scene.
pub fn open(path: &Path) -> Result<Loaded, SceneError> {
    load(path, "scene", &Options::default())
}

/// Loads in a separate thread, so that an endless file fails the test and does not hang it.
pub fn open_in_time(path: &Path) -> Result<Loaded, SceneError> {
    let (sender, receiver) = mpsc::channel();
    let owned = path.to_path_buf();
    std::thread::spawn(move || drop(sender.send(open(&owned))));
    receiver
        .recv_timeout(TIMEOUT)
        .unwrap_or_else(|_| panic!("{}: not done after {TIMEOUT:?}", path.display()))
}

/// A buffer of three positions followed by three indices.
pub fn buffer() -> Vec<u8> {
    let corners = [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let mut bytes: Vec<u8> = corners.iter().flatten().flat_map(|c| c.to_le_bytes()).collect();
    bytes.extend([0, 0, 1, 0, 2, 0, 0, 0]);
    bytes
}

/// A file with one triangle whose data are those of [`buffer`].
pub fn triangle(uri: Option<&str>) -> Value {
    let mut json = json!({
        "asset": { "version": "2.0" },
        "buffers": [{ "byteLength": 44 }],
        "bufferViews": [
            { "buffer": 0, "byteLength": 36 },
            { "buffer": 0, "byteOffset": 36, "byteLength": 6 },
        ],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3" },
            { "bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR" },
        ],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
        "nodes": [{ "mesh": 0 }],
    });
    if let Some(uri) = uri {
        json["buffers"][0]["uri"] = json!(uri);
    }
    json
}

fn glb(json: &Value, binary: &[u8]) -> Vec<u8> {
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut file = b"glTF\x02\0\0\0".to_vec();
    file.extend((28 + text.len() as u32 + binary.len() as u32).to_le_bytes());
    for (kind, content) in [(b"JSON", &text[..]), (b"BIN\0", binary)] {
        file.extend((content.len() as u32).to_le_bytes());
        file.extend(kind);
        file.extend(content);
    }
    file
}

/// A folder that holds a scene folder and, beside it, a file that no scene may open.
struct Canary {
    root: TempDir,
}

impl Canary {
    fn new() -> Self {
        let root = TempDir::new().unwrap();
        std::fs::create_dir_all(root.path().join("scene/sub")).unwrap();
        std::fs::write(root.path().join("canary.bin"), buffer()).unwrap();
        Self { root }
    }

    fn path(&self, name: &str) -> std::path::PathBuf {
        self.root.path().join(name)
    }

    fn open(&self, uri: &str) -> Result<Loaded, SceneError> {
        let path = self.path("scene/scene.gltf");
        std::fs::write(&path, triangle(Some(uri)).to_string()).unwrap();
        open_in_time(&path)
    }
}

#[test]
fn buffers_below_the_folder_are_read_and_told_of() {
    let canary = Canary::new();
    std::fs::write(canary.path("scene/sub/a b.bin"), buffer()).unwrap();
    let hash = |content: &[u8]| blake3::hash(content).to_hex().to_string();
    for uri in ["sub/a%20b.bin", "sub/a b.bin", "./sub/../sub/a%20b.bin"] {
        let scene = canary.open(uri).unwrap().scene;
        assert_eq!(scene.triangle_count(), 1);
        let own = std::fs::read(canary.path("scene/scene.gltf")).unwrap();
        let files: Vec<_> = scene
            .geometry
            .files
            .iter()
            .map(|file| (file.name.clone(), file.bytes, file.blake3.clone()))
            .collect();
        let expected =
            [("scene".to_owned(), own.len() as u64, hash(&own)), (uri.to_owned(), 44, hash(&buffer()))];
        assert_eq!(files, expected);
    }
    // Another content gives another hash, even if only unused bytes of the buffer differ.
    let before = canary.open("sub/a b.bin").unwrap().scene.geometry.files.clone();
    std::fs::write(canary.path("scene/sub/a b.bin"), [buffer(), vec![1]].concat()).unwrap();
    let after = canary.open("sub/a b.bin").unwrap().scene.geometry.files.clone();
    assert_eq!(before[0], after[0]);
    assert_ne!(before[1].blake3, after[1].blake3);
    std::fs::write(canary.path("scene/sub/a b.bin"), &buffer()[..43]).unwrap();
    let error = canary.open("sub/a b.bin").unwrap_err().to_string();
    assert!(
        error.ends_with(
            "buffer 0: the file \"sub/a b.bin\": it has 43 bytes, but the buffer's byteLength is 44"
        ),
        "{error}"
    );
}

#[test]
fn nothing_outside_the_folder_is_opened() {
    let canary = Canary::new();
    let outside = canary.path("canary.bin");
    // The file is a valid buffer: as a neighbour of the scene it loads.
    std::fs::copy(&outside, canary.path("scene/inside.bin")).unwrap();
    assert_eq!(canary.open("inside.bin").unwrap().scene.triangle_count(), 1);

    let absolute = outside.display().to_string();
    let mut uris = vec![
        "../canary.bin".to_owned(),
        "%2e%2e/canary.bin".to_owned(),
        "%2E%2e%2Fcanary.bin".to_owned(),
        "sub/../../canary.bin".to_owned(),
        "./.././canary.bin".to_owned(),
        "..\\canary.bin".to_owned(),
        absolute.clone(),
        format!("/{absolute}"),
        format!("file://{absolute}"),
        format!("FILE:{absolute}"),
        format!("http://localhost{absolute}"),
        absolute.replace('/', "%2f"),
        "inside.bin%00".to_owned(),
        String::new(),
        ".".to_owned(),
        "sub".to_owned(),
        "/dev/zero".to_owned(),
        "/proc/self/environ".to_owned(),
    ];
    #[cfg(unix)]
    {
        use std::os::unix::fs::symlink;
        symlink(&outside, canary.path("scene/link.bin")).unwrap();
        symlink("../canary.bin", canary.path("scene/relative.bin")).unwrap();
        symlink("..", canary.path("scene/up")).unwrap();
        symlink("/dev/zero", canary.path("scene/zero.bin")).unwrap();
        symlink("loop.bin", canary.path("scene/loop.bin")).unwrap();
        uris.extend(
            ["link.bin", "relative.bin", "up/canary.bin", "sub/../up/canary.bin", "zero.bin", "loop.bin"]
                .map(str::to_owned),
        );
        // A link that stays inside the folder is allowed.
        symlink("inside.bin", canary.path("scene/fine.bin")).unwrap();
        assert_eq!(canary.open("fine.bin").unwrap().scene.triangle_count(), 1);
    }
    for uri in uris {
        let error = canary.open(&uri).expect_err(&uri);
        assert!(error.element.ends_with("buffer 0"), "{error}");
    }
}

#[cfg(unix)]
#[test]
fn pipes_do_not_block() {
    let canary = Canary::new();
    let made = std::process::Command::new("mkfifo").arg(canary.path("scene/fifo.bin")).status().unwrap();
    assert!(made.success());
    let error = canary.open("fifo.bin").unwrap_err();
    assert!(error.problem.contains("this is a pipe or a device, not a file"), "{error}");
    let error = open_in_time(&canary.path("scene/fifo.bin")).unwrap_err();
    assert!(error.problem.contains("this is a pipe or a device, not a file"), "{error}");
    let error = open_in_time(&canary.path("scene")).unwrap_err();
    assert!(error.to_string().ends_with("scene: this is a folder, not a file"), "{error}");
    let error = open_in_time(&canary.path("none.glb")).unwrap_err();
    assert!(error.to_string().ends_with("none.glb: there is no such file"), "{error}");
}

#[test]
fn a_binary_file_needs_no_other() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("scene.glb");
    std::fs::write(&path, glb(&triangle(None), &buffer())).unwrap();
    let scene = open(&path).unwrap().scene;
    assert_eq!((scene.triangle_count(), scene.geometry.files.len()), (1, 1));
    std::fs::write(&path, glb(&triangle(None), &buffer()[..40])).unwrap();
    let error = open(&path).unwrap_err();
    assert!(
        error.problem.contains("binary chunk has 40 bytes, but the buffer's byteLength is 44"),
        "{error}"
    );
}

#[test]
fn small_files_do_not_ask_for_much() {
    let of = |json: &Value| {
        let folder = TempDir::new().unwrap();
        let path = folder.path().join("scene.glb");
        std::fs::write(&path, glb(json, &buffer())).unwrap();
        open_in_time(&path)
    };
    let instancing =
        |accessor: u32| json!({ "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": accessor } } });
    // The file claims zeros that are not stored: positions, indices, instances, and strips of one vertex.
    let zeros = json!({ "componentType": 5126, "count": 10_000_000_000_u64, "type": "VEC3" });
    let mut positions = triangle(None);
    positions["accessors"][0] = zeros.clone();
    positions["meshes"][0]["primitives"][0].as_object_mut().unwrap().remove("indices");
    let mut indices = triangle(None);
    indices["accessors"][1] = json!({ "componentType": 5125, "count": 10_000_000_000_u64, "type": "SCALAR" });
    let mut instances = triangle(None);
    instances["accessors"].as_array_mut().unwrap().push(zeros);
    instances["nodes"][0]["extensions"] = instancing(2);
    let mut strip = indices.clone();
    strip["meshes"][0]["primitives"][0]["mode"] = json!(5);
    strip["accessors"][1]["count"] = json!(u64::MAX);
    // The same mesh is flattened many times.
    let mut flat = instances.clone();
    flat["accessors"][2]["count"] = json!(900_000);
    flat["nodes"][0]["scale"] = json!([1, 1, 0]);
    for json in [positions, indices, instances, strip, flat] {
        let error = of(&json).unwrap_err();
        assert!(error.problem.contains("bytes of geometry, more than the"), "{error}");
    }
    // Long lists without any triangle are traversed for each of many nodes.
    let mut nothing = triangle(None);
    let points = json!({ "attributes": { "POSITION": 0 }, "mode": 0 });
    nothing["meshes"][0] = json!({ "primitives": vec![points; 3000], "weights": vec![0; 100_000] });
    nothing["skins"] = json!([{ "joints": vec![0; 3000] }]);
    nothing["nodes"] = json!(vec![json!({ "mesh": 0, "skin": 0 }); 30_000]);
    let error = of(&nothing).unwrap_err();
    assert!(error.problem.contains("bytes of geometry, more than the"), "{error}");
    let mut names = triangle(None);
    names["meshes"][0]["name"] = json!("x".repeat(1_000_000));
    names["nodes"] = json!(vec![json!({ "mesh": 0 }); 100_000]);
    let error = of(&names).unwrap_err();
    assert!(error.problem.contains("bytes of geometry, more than the"), "{error}");
    // Targets of which each moves all vertices, and whose values are not stored.
    let mut targets = triangle(None);
    targets["accessors"][0] = json!({ "componentType": 5126, "count": 6_000_000, "type": "VEC3" });
    targets["meshes"][0]["weights"] = json!(vec![1; 1000]);
    targets["meshes"][0]["primitives"] =
        json!([{ "attributes": { "POSITION": 0 }, "targets": vec![json!({ "POSITION": 0 }); 1000] }]);
    let error = of(&targets).unwrap_err();
    assert!(error.problem.contains("bytes of geometry, more than the"), "{error}");
    // The file has as many primitives with shared data as fit into a small file.
    let mut copies = triangle(None);
    let large = vec![0; 3_000_000];
    copies["buffers"][0]["byteLength"] = json!(large.len());
    copies["bufferViews"][0]["byteLength"] = json!(large.len());
    copies["accessors"][0]["count"] = json!(large.len() / 12);
    let primitive = json!({ "attributes": { "POSITION": 0 } });
    copies["meshes"][0]["primitives"] = json!(vec![primitive; 10_000]);
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("scene.glb");
    std::fs::write(&path, glb(&copies, &large)).unwrap();
    let error = open_in_time(&path).unwrap_err();
    assert!(error.problem.contains("bytes of geometry, more than the"), "{error}");
}

/// The case gltf-extensions-quadratic: every primitive asks whether an extension is among the file's.
#[test]
fn time_grows_with_the_file_and_not_with_its_square() {
    let mut json = triangle(None);
    let names: Vec<String> = (0..100_000).map(|number| format!("ACME_materials_{number}")).collect();
    json["extensionsUsed"] = json!(names);
    json["extensionsRequired"] = json!(names);
    let primitive = json["meshes"][0]["primitives"][0].clone();
    json["meshes"][0]["primitives"] = json!(vec![primitive; 20_000]);
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("scene.glb");
    std::fs::write(&path, glb(&json, &buffer())).unwrap();
    assert_eq!(open_in_time(&path).unwrap().scene.triangle_count(), 20_000);
    // A million odd elements are one warning.
    let mut odd = triangle(None);
    odd["nodes"] = json!(vec![json!({ "mesh": 0, "rotation": [0, 0, 0, 0] }); 30_000]);
    std::fs::write(&path, glb(&odd, &buffer())).unwrap();
    let notices = open_in_time(&path).unwrap().notices;
    assert_eq!(notices.len(), 1, "{notices:?}");
    assert!(notices[0].place.contains("and 29999 others"), "{}", notices[0]);
}

/// A file with many features: several kinds of accessors, a skin, a morph target, instances, labels.
fn everything() -> (Value, Vec<u8>) {
    let mut json = triangle(None);
    let mut binary = buffer();
    let mut add = |json: &mut Value, bytes: &[u8], accessor: Value| {
        let offset = binary.len();
        binary.extend(bytes);
        binary.resize(binary.len().next_multiple_of(4), 0);
        let views = json["bufferViews"].as_array_mut().unwrap();
        views.push(json!({ "buffer": 0, "byteOffset": offset, "byteLength": bytes.len() }));
        let view = views.len() - 1;
        if !accessor.is_null() {
            let mut accessor = accessor;
            accessor["bufferView"] = json!(view);
            json["accessors"].as_array_mut().unwrap().push(accessor);
        }
        view
    };
    let floats = |values: &[f32]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<_>>();
    let mut identity = [0.0; 16];
    [0, 5, 10, 15].into_iter().for_each(|at| identity[at] = 1.0);
    add(&mut json, &[0; 12], json!({ "componentType": 5121, "count": 3, "type": "VEC4" })); // accessor 2: joints
    add(
        &mut json,
        &[255, 0, 0, 0].repeat(3),
        json!({
            "componentType": 5121, "normalized": true, "count": 3, "type": "VEC4",
        }),
    ); // 3: weights
    add(&mut json, &floats(&identity), json!({ "componentType": 5126, "count": 1, "type": "MAT4" })); // 4
    add(&mut json, &floats(&[1.0; 6]), json!({ "componentType": 5126, "count": 2, "type": "VEC3" })); // 5
    add(
        &mut json,
        &[0, 127, 0, 0, 0, 0, 127, 0, 0, 127, 0, 0],
        json!({
            "componentType": 5120, "count": 3, "type": "VEC3",
        }),
    ); // 6: quantised positions
    let at = add(&mut json, &[1], Value::Null);
    let values = add(&mut json, &floats(&[0.0, 0.0, 1.0]), Value::Null);
    json["accessors"].as_array_mut().unwrap().push(json!({
        "componentType": 5126, "count": 3, "type": "VEC3",
        "sparse": {
            "count": 1,
            "indices": { "bufferView": at, "componentType": 5121 },
            "values": { "bufferView": values },
        },
    })); // 7: a morph target
    let stream = [0xd1, 0, 4, 4, 0, 0, 0, 0];
    let compressed = add(&mut json, &stream, Value::Null);
    json["bufferViews"][compressed] = json!({
        "buffer": 1, "byteLength": 6,
        "extensions": { "EXT_meshopt_compression": {
            "buffer": 0, "byteOffset": json["bufferViews"][compressed]["byteOffset"], "byteLength": 8,
            "byteStride": 2, "count": 3, "mode": "INDICES",
        } },
    });
    json["accessors"].as_array_mut().unwrap().push(json!({
        "bufferView": compressed, "componentType": 5123, "count": 3, "type": "SCALAR",
    })); // 8
    json["buffers"] = json!([{ "byteLength": binary.len() }, { "byteLength": 6 }]);
    json["extensionsRequired"] = json!(["KHR_mesh_quantization", "EXT_meshopt_compression"]);
    json["materials"] =
        json!([{ "name": "paint", "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.5, 0.5, 1] } }]);
    json["meshes"] = json!([
        { "name": "plain", "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1, "material": 0 }] },
        { "primitives": [{ "attributes": { "POSITION": 0, "JOINTS_0": 2, "WEIGHTS_0": 3 }, "indices": 8 }] },
        { "weights": [0.5], "primitives": [
            { "attributes": { "POSITION": 0 }, "targets": [{ "POSITION": 7 }], "mode": 5 },
        ] },
        { "primitives": [{ "attributes": { "POSITION": 6 }, "mode": 6 }] },
    ]);
    json["skins"] = json!([{ "joints": [2], "inverseBindMatrices": 4 }]);
    json["nodes"] = json!([
        { "mesh": 0, "children": [1, 2], "extras": { "label": 3 }, "name": "root" },
        { "mesh": 1, "skin": 0 },
        { "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 5, 1], "children": [3] },
        { "mesh": 2, "weights": [0.25], "rotation": [0, 0, 0, 1], "scale": [1, -1, 1] },
        { "mesh": 3, "extensions": { "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": 5 } } } },
    ]);
    json["scenes"] = json!([{ "name": "all", "nodes": [0, 4] }]);
    json["scene"] = json!(0);
    (json, binary)
}

/// The paths of all values in a JSON document.
fn places(value: &Value, at: &str, found: &mut Vec<String>) {
    found.push(at.to_owned());
    match value {
        Value::Array(list) => {
            list.iter().enumerate().for_each(|(i, v)| places(v, &format!("{at}/{i}"), found));
        }
        Value::Object(map) => map.iter().for_each(|(k, v)| places(v, &format!("{at}/{k}"), found)),
        _ => {}
    }
}

fn open_bytes(bytes: &[u8]) -> Result<Loaded, SceneError> {
    thread_local! { static FOLDER: TempDir = TempDir::new().unwrap(); }
    FOLDER.with(|folder| {
        let path = folder.path().join("scene.glb");
        std::fs::write(&path, bytes).unwrap();
        open(&path)
    })
}

/// Loads bytes. It must not panic (`load` would turn a panic into this error), and the parts of a loaded scene must be
/// consistent.
fn check(bytes: &[u8]) {
    match open_bytes(bytes) {
        Err(error) => assert!(!error.problem.contains("error in beamcast"), "{error}"),
        Ok(Loaded { scene, .. }) => {
            assert!(scene.triangle_count() > 0);
            for mesh in &scene.geometry.meshes {
                let vertices = mesh.positions.len() as u32;
                assert!(mesh.triangles.as_flattened().iter().all(|&vertex| vertex < vertices));
            }
        }
    }
}

#[test]
fn everything_is_right_before_it_is_broken() {
    let (json, binary) = everything();
    let scene = open_bytes(&glb(&json, &binary)).unwrap().scene;
    assert_eq!((scene.triangle_count(), scene.geometry.objects.len()), (5, 5));
}

#[test]
fn every_value_replaced_and_every_length() {
    let (json, binary) = everything();
    let mut all = Vec::new();
    places(&json, "", &mut all);
    let odd = [
        json!(null),
        json!(-1),
        json!(0),
        json!(1),
        json!(2),
        json!(255),
        json!(4_294_967_295_u64),
        json!(4_294_967_296_u64),
        json!(u64::MAX),
        json!(i64::MIN),
        json!(0.5),
        json!(1e300),
        json!(""),
        json!("POSITION"),
        json!([]),
        json!({}),
        json!([0]),
        json!(true),
    ];
    for place in &all {
        for value in &odd {
            let mut broken = json.clone();
            *broken.pointer_mut(place).unwrap() = value.clone();
            check(&glb(&broken, &binary));
        }
    }
    let whole = glb(&json, &binary);
    for length in (0..whole.len()).step_by(7) {
        check(&whole[..length]);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]

    #[test]
    fn changed_bytes_never_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..12),
    ) {
        let (json, binary) = everything();
        let mut file = glb(&json, &binary);
        for (at, byte) in changes {
            let at = at.index(file.len());
            file[at] = byte;
        }
        check(&file);
    }

    #[test]
    fn several_changed_values_never_panic(
        changes in prop::collection::vec(
            (any::<prop::sample::Index>(), prop_oneof![0..12_u64, any::<u64>()]), 1..5,
        ),
    ) {
        let (mut json, binary) = everything();
        for (at, value) in changes {
            let mut all = Vec::new();
            places(&json, "", &mut all);
            let place = &all[at.index(all.len())];
            *json.pointer_mut(place).unwrap() = json!(value);
        }
        check(&glb(&json, &binary));
    }
}
