//! Tests of the loader as a whole, on small files made here.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use glam::DVec3;
use serde_json::{Value, json};
use tempfile::TempDir;

use super::{Loaded, Options, load};
use crate::error::SceneError;
use crate::frame::UpAxis;
use crate::scene::{Optics, Surface};

#[cfg(test)]
mod mended;
#[cfg(test)]
mod packed;

const BYTE: u32 = 5120;
const UBYTE: u32 = 5121;
const SHORT: u32 = 5122;
const USHORT: u32 = 5123;
const UINT: u32 = 5125;
const FLOAT: u32 = 5126;

/// A glTF file that a test makes. Its only buffer is written as a data: URI.
struct Asset {
    json: Value,
    data: Vec<u8>,
}

impl Asset {
    fn new() -> Self {
        let json = json!({
            "asset": { "version": "2.0" },
            "buffers": [], "bufferViews": [], "accessors": [], "meshes": [], "nodes": [],
        });
        Self { json, data: Vec::new() }
    }

    fn push(&mut self, list: &str, element: Value) -> usize {
        let list = self.json[list].as_array_mut().unwrap();
        list.push(element);
        list.len() - 1
    }

    fn view(&mut self, bytes: &[u8]) -> usize {
        let offset = self.data.len();
        self.data.extend_from_slice(bytes);
        self.push("bufferViews", json!({ "buffer": 0, "byteOffset": offset, "byteLength": bytes.len() }))
    }

    fn accessor(&mut self, kind: &str, component: u32, count: usize, bytes: &[u8]) -> usize {
        let view = self.view(bytes);
        let accessor =
            json!({ "bufferView": view, "componentType": component, "count": count, "type": kind });
        self.push("accessors", accessor)
    }

    fn floats<const N: usize>(&mut self, kind: &str, values: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = values.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor(kind, FLOAT, values.len(), &bytes)
    }

    fn shorts(&mut self, indices: &[u16]) -> usize {
        let bytes: Vec<u8> = indices.iter().flat_map(|v| v.to_le_bytes()).collect();
        self.accessor("SCALAR", USHORT, indices.len(), &bytes)
    }

    /// Adds a mesh of one primitive.
    fn mesh(&mut self, primitive: Value) -> usize {
        self.push("meshes", json!({ "primitives": [primitive] }))
    }

    /// A file with one triangle, at one node.
    fn triangle() -> Self {
        let mut asset = Self::new();
        let positions = asset.floats("VEC3", &CORNERS);
        let indices = asset.shorts(&[0, 1, 2]);
        let mesh = asset.mesh(json!({ "attributes": { "POSITION": positions }, "indices": indices }));
        asset.push("nodes", json!({ "mesh": mesh }));
        asset
    }

    fn text(&self) -> String {
        let mut json = self.json.clone();
        if json["buffers"] == json!([]) && !self.data.is_empty() {
            let mut uri = "data:application/octet-stream,".to_owned();
            self.data.iter().for_each(|byte| write!(uri, "%{byte:02x}").unwrap());
            json["buffers"] = json!([{ "byteLength": self.data.len(), "uri": uri }]);
        }
        json.to_string()
    }

    fn load_with(&self, options: &Options) -> Result<Loaded, SceneError> {
        load_bytes(self.text().as_bytes(), options)
    }

    fn load(&self) -> Loaded {
        self.load_with(&plain()).unwrap()
    }

    fn error(&self) -> String {
        let error = self.load_with(&plain()).expect_err("an error").to_string();
        error.split_once(".gltf: ").unwrap().1.to_owned()
    }
}

const CORNERS: [[f32; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

/// Options that keep glTF's own axes, so that positions can be compared as they are written.
fn plain() -> Options<'static> {
    Options { up: UpAxis::Y, ..Options::default() }
}

fn load_bytes(bytes: &[u8], options: &Options) -> Result<Loaded, SceneError> {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("scene.gltf");
    std::fs::write(&path, bytes).unwrap();
    load(&path, "scene.gltf", options)
}

/// The notices as people read them.
fn told(loaded: &Loaded) -> Vec<String> {
    loaded.notices.iter().map(ToString::to_string).collect()
}

/// The corners of all triangles in the world, in the order of their ids.
fn world(loaded: &Loaded) -> Vec<[DVec3; 3]> {
    let scene = &loaded.scene;
    let mut triangles = Vec::new();
    for placement in &scene.arrangement.placements {
        let mesh = scene.mesh(placement.mesh);
        triangles.extend(mesh.triangles.iter().map(|triangle| {
            triangle.map(|vertex| {
                let [x, y, z] = mesh.positions[vertex as usize].map(f64::from);
                placement.scene_from_mesh().transform_point3(DVec3::new(x, y, z)) + scene.geometry.centre
            })
        }));
    }
    triangles
}

fn close(a: &[[DVec3; 3]], b: &[[[f64; 3]; 3]], tolerance: f64) {
    assert_eq!(a.len(), b.len(), "{a:?}");
    for (a, b) in a.iter().flatten().zip(b.iter().flatten()) {
        assert!(a.abs_diff_eq(DVec3::from_array(*b), tolerance), "{a} {b:?}");
    }
}

const UNIT: [[f64; 3]; 3] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

fn unit_at(x: f64, y: f64, z: f64) -> [[f64; 3]; 3] {
    UNIT.map(|[a, b, c]| [a + x, b + y, c + z])
}

// ---- Primitives and accessors ----

#[test]
fn a_triangle_in_both_frames() {
    let loaded = Asset::triangle().load();
    close(&world(&loaded), &[UNIT], 0.0);
    assert!(loaded.notices.is_empty());
    let z_up = Asset::triangle().load_with(&Options { up: UpAxis::Z, ..plain() }).unwrap();
    close(&world(&z_up), &[[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]], 0.0);
}

#[test]
fn modes_and_their_winding() {
    // The corners of a strip in the plane z = 0. All of its triangles face +z.
    let zigzag: [[f32; 3]; 5] =
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [0.0, 2.0, 0.0]];
    let ring: [[f32; 3]; 5] =
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 1.0, 0.0]];
    for (mode, positions, count) in [(4, zigzag, 1), (5, zigzag, 3), (6, ring, 3)] {
        let mut asset = Asset::new();
        let positions = asset.floats("VEC3", &positions);
        let mesh = asset.mesh(json!({ "attributes": { "POSITION": positions }, "mode": mode }));
        asset.push("nodes", json!({ "mesh": mesh }));
        let loaded = asset.load();
        let triangles = world(&loaded);
        assert_eq!(triangles.len(), count, "mode {mode}");
        for [a, b, c] in triangles {
            assert!((b - a).cross(c - a).z > 0.0, "mode {mode}");
        }
        let warned = told(&loaded).iter().any(|w| w.contains("after its last triangle"));
        assert_eq!(warned, mode == 4, "two of five corners are left over");
    }
}

#[test]
fn points_and_lines_are_counted() {
    let mut asset = Asset::triangle();
    for mode in 0..4 {
        let mesh = asset.mesh(json!({ "attributes": { "POSITION": 0 }, "mode": mode }));
        asset.push("nodes", json!({ "mesh": mesh }));
    }
    let loaded = asset.load();
    assert_eq!(
        told(&loaded),
        [
            "mesh 1, primitive 0 and 3 others (mesh 2, primitive 0, mesh 3, primitive 0, mesh 4, primitive 0): beams do not \
             hit points and lines, which are left out"
        ]
    );
    assert_eq!(loaded.scene.geometry.objects.len(), 1);
    asset.json["nodes"].as_array_mut().unwrap().remove(0);
    assert!(asset.error().starts_with("the file has only points and lines (beams hit triangles"));
}

#[test]
fn index_types() {
    for (component, bytes) in [
        (UBYTE, vec![0, 1, 2]),
        (USHORT, vec![0, 0, 1, 0, 2, 0]),
        (UINT, vec![0, 0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0]),
    ] {
        let mut asset = Asset::triangle();
        let indices = asset.accessor("SCALAR", component, 3, &bytes);
        asset.json["meshes"][0]["primitives"][0]["indices"] = json!(indices);
        close(&world(&asset.load()), &[UNIT], 0.0);
        // The largest integer of each type is not an index, however many vertices the primitive has.
        let last = bytes.len() - bytes.len() / 3;
        let end = asset.data.len();
        asset.data[end - bytes.len() + last..].fill(255);
        assert!(asset.error().contains("number 2 is"), "{}", asset.error());
        assert!(asset.error().contains("restarts a primitive"), "{}", asset.error());
    }
    for (kind, component) in [("SCALAR", FLOAT), ("SCALAR", SHORT), ("VEC3", USHORT)] {
        let mut asset = Asset::triangle();
        let indices = asset.accessor(kind, component, 1, &[0; 12]);
        asset.json["meshes"][0]["primitives"][0]["indices"] = json!(indices);
        assert!(asset.error().contains("which indices can't be (it takes SCALAR of UNSIGNED_BYTE"));
    }
}

#[test]
fn interleaved_and_offset() {
    let mut asset = Asset::triangle();
    let mut bytes = vec![9; 8];
    for corner in CORNERS {
        corner.iter().for_each(|c| bytes.extend(c.to_le_bytes()));
        bytes.extend([7; 8]);
    }
    bytes.truncate(8 + 2 * 20 + 12); // The last element needs no full stride.
    let view = asset.view(&bytes);
    asset.json["bufferViews"][view]["byteStride"] = json!(20);
    asset.json["accessors"][0]["bufferView"] = json!(view);
    asset.json["accessors"][0]["byteOffset"] = json!(8);
    close(&world(&asset.load()), &[UNIT], 0.0);
    asset.json["bufferViews"][view]["byteLength"] = json!(bytes.len() - 1);
    assert!(
        asset.error().contains("accessor 0: 3 elements of 12 bytes, 20 apart, from byte 8 on lie outside")
    );
    asset.json["bufferViews"][view]["byteStride"] = json!(8);
    assert!(asset.error().contains("byteStride of 8, less than the 12 bytes"));
}

#[test]
fn quantized_positions() {
    type Case = (u32, bool, fn(i32) -> Vec<u8>, i32, f64);
    let cases: [Case; 8] = [
        (BYTE, false, |v| vec![v as i8 as u8], -100, -100.0),
        (BYTE, true, |v| vec![v as i8 as u8], -128, -1.0),
        (UBYTE, false, |v| vec![v as u8], 200, 200.0),
        (UBYTE, true, |v| vec![v as u8], 51, 0.2),
        (SHORT, false, |v| (v as i16).to_le_bytes().to_vec(), -30000, -30000.0),
        (SHORT, true, |v| (v as i16).to_le_bytes().to_vec(), 16384, 16384.0 / 32767.0),
        (USHORT, false, |v| (v as u16).to_le_bytes().to_vec(), 60000, 60000.0),
        (USHORT, true, |v| (v as u16).to_le_bytes().to_vec(), 13107, 0.2),
    ];
    for (component, normalized, encode, value, expected) in cases {
        let mut asset = Asset::triangle();
        let corners = [[0, 0, 0], [value, 0, 0], [0, value, 0]];
        let bytes: Vec<u8> = corners.into_iter().flatten().flat_map(encode).collect();
        let positions = asset.accessor("VEC3", component, 3, &bytes);
        asset.json["accessors"][positions]["normalized"] = json!(normalized);
        asset.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = json!(positions);
        let error = asset.error();
        assert!(error.contains("which POSITION can't be"), "{error}");
        assert!(error.contains("KHR_mesh_quantization"), "{error}");
        asset.json["extensionsRequired"] = json!(["KHR_mesh_quantization"]);
        let corners = [[0.0; 3], [expected, 0.0, 0.0], [0.0, expected, 0.0]];
        close(&world(&asset.load()), &[corners], expected.abs() * 1e-7);
    }
}

#[test]
fn sparse_accessors() {
    let mut asset = Asset::triangle();
    let indices = asset.view(&[0, 2]);
    let values: Vec<u8> = [5.0_f32, 5.0, 5.0, 0.0, 3.0, 0.0].iter().flat_map(|v| v.to_le_bytes()).collect();
    let values = asset.view(&values);
    asset.json["accessors"][0]["sparse"] = json!({
        "count": 2,
        "indices": { "bufferView": indices, "componentType": UBYTE },
        "values": { "bufferView": values },
    });
    close(&world(&asset.load()), &[[[5.0; 3], [1.0, 0.0, 0.0], [0.0, 3.0, 0.0]]], 0.0);
    // Without a view, elements that are not overridden are zero.
    asset.json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    close(&world(&asset.load()), &[[[5.0; 3], [0.0; 3], [0.0, 3.0, 0.0]]], 0.0);

    let offset = asset.json["bufferViews"][indices]["byteOffset"].as_u64().unwrap() as usize;
    for (bad, problem) in
        [([2, 0], "do not strictly increase"), ([1, 1], "number 1 is 1"), ([0, 3], "index 3 is past")]
    {
        asset.data[offset..offset + 2].copy_from_slice(&bad);
        assert!(asset.error().contains(problem), "{}", asset.error());
    }
    asset.json["accessors"][0]["sparse"]["count"] = json!(4);
    assert!(asset.error().contains("4 of them for 3 elements"));
}

#[test]
fn accessors_without_views_are_zeros() {
    let mut asset = Asset::triangle();
    asset.json["accessors"][0].as_object_mut().unwrap().remove("bufferView");
    assert!(asset.error().contains("it has 1 triangle, of no area"), "{}", asset.error());
}

#[test]
fn primitives_share_and_compact_their_vertices() {
    let mut asset = Asset::new();
    let mut corners: Vec<[f32; 3]> = vec![[f32::NAN; 3]; 1000];
    corners[700..703].copy_from_slice(&CORNERS);
    let positions = asset.floats("VEC3", &corners);
    let one = asset.shorts(&[700, 701, 702]);
    let many = asset.shorts(&[700, 701, 702].repeat(200));
    let sparse = asset.mesh(json!({ "attributes": { "POSITION": positions }, "indices": one }));
    let shared = asset.mesh(json!({ "attributes": { "POSITION": positions }, "indices": many }));
    let few = asset.json["meshes"][sparse]["primitives"][0].clone();
    asset.json["meshes"][shared]["primitives"].as_array_mut().unwrap().push(few);
    asset.push("nodes", json!({ "mesh": sparse }));
    asset.push("nodes", json!({ "mesh": shared, "translation": [5, 0, 0] }));
    let loaded = asset.load();
    let triangles = world(&loaded);
    assert_eq!(triangles.len(), 1 + 200 + 1);
    close(&triangles[..1], &[UNIT], 0.0);
    close(&triangles[201..], &[unit_at(5.0, 0.0, 0.0)], 0.0);
    // Each mesh stores the three vertices that it uses.
    assert_eq!(loaded.scene.geometry.meshes[0].positions.len(), 6);

    // Unused vertices may be anything, but used ones must be finite, in both ways of storing them.
    for (at, mesh) in [(0, sparse), (1, shared)] {
        let mut broken = Asset { json: asset.json.clone(), data: asset.data.clone() };
        broken.json["nodes"].as_array_mut().unwrap().remove(1 - at);
        broken.data[701 * 12..][..4].copy_from_slice(&f32::INFINITY.to_le_bytes());
        let expected = format!(
            "node 0, mesh {mesh}, primitive 0, accessor 0: vertex 701 lies at [inf, 0.0, 0.0] \
             (a coordinate is a finite number of metres)"
        );
        assert_eq!(broken.error(), expected);
    }
}

// ---- Nodes ----

#[test]
fn transforms_are_composed_in_f64() {
    let mut asset = Asset::triangle();
    asset.json["nodes"] = json!([
        { "children": [1], "translation": [449_999.123_456, 5_399_999.654_321, 0.0] },
        { "children": [2], "matrix": [0, 1, 0, 0, -1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 10, 1] },
        { "mesh": 0, "scale": [2, 2, 2], "translation": [1, 0, 0], "rotation": [0, 0, 0, 1] },
    ]);
    let (x, y) = (449_999.123_456, 5_399_999.654_321);
    let expected = [[x, y + 1.0, 10.0], [x, y + 3.0, 10.0], [x - 2.0, y + 1.0, 10.0]];
    close(&world(&asset.load()), &[expected], 1e-7);
}

#[test]
fn negative_scales_keep_fronts_in_front() {
    let mut asset = Asset::triangle();
    asset.json["nodes"][0]["scale"] = json!([-1, 1, 1]);
    let [a, b, c] = world(&asset.load())[0];
    assert!((b - a).cross(c - a).z > 0.0);
}

#[test]
fn broken_transforms() {
    let of = |key: &str, value: Value| {
        let mut asset = Asset::triangle();
        asset.json["nodes"][0][key] = value;
        asset.error()
    };
    assert!(of("matrix", json!(vec![0; 16])).contains("the last row of its matrix is [0.0, 0.0, 0.0, 0.0]"));
    assert!(of("scale", json!([1e13, 1, 1])).contains("node 0: a vertex lies at (1e13, 0e0, 0e0) m"));
    let mut asset = Asset::triangle();
    asset.json["nodes"] =
        json!([{ "children": [1], "scale": [1e300, 1, 1] }, { "mesh": 0, "scale": [1e300, 1, 1] }]);
    assert!(asset.error().starts_with("node 1: its place in the world is not finite"), "{}", asset.error());
    let mut asset = Asset::triangle();
    asset.json["nodes"][0]["rotation"] = json!([0, 0, 2, 0]);
    let loaded = asset.load();
    close(&world(&loaded), &[[[0.0; 3], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]], 0.0);
    assert_eq!(told(&loaded), ["node 0: the length of its quaternion is not 1; it was normalised"]);
}

#[test]
fn order_is_depth_first() {
    let mut asset = Asset::triangle();
    asset.json["nodes"] = json!([
        { "name": "d", "mesh": 0 },
        { "name": "a", "mesh": 0, "children": [3, 2] },
        { "name": "c", "mesh": 0 },
        { "children": [4] },
        { "name": "b", "mesh": 0 },
    ]);
    asset.json["scenes"] = json!([{ "nodes": [1, 0] }]);
    let names: Vec<_> = asset.load().scene.geometry.objects.iter().map(|o| o.name.clone()).collect();
    assert_eq!(names, ["a", "b", "c", "d"]);
}

#[test]
fn scenes() {
    let mut asset = Asset::triangle();
    asset.json["nodes"] = json!([{ "mesh": 0, "name": "a" }, { "mesh": 0, "name": "b" }, { "name": "c" }]);
    let names = |asset: &Asset, scene_name| {
        let loaded = asset.load_with(&Options { scene_name, ..plain() }).map_err(|e| e.to_string())?;
        Ok::<_, String>(
            loaded.scene.geometry.objects.iter().map(|o| o.name.as_str()).collect::<Vec<_>>().concat(),
        )
    };
    assert_eq!(names(&asset, None).unwrap(), "ab", "without scenes, all nodes");
    asset.json["scenes"] =
        json!([{ "nodes": [0], "name": "first" }, { "nodes": [1], "name": "second" }, { "nodes": [2] }]);
    assert_eq!(names(&asset, None).unwrap(), "a", "the first scene");
    asset.json["scene"] = json!(1);
    assert_eq!(names(&asset, None).unwrap(), "b", "the default scene");
    assert_eq!(names(&asset, Some("first")).unwrap(), "a");
    let error = names(&asset, Some("secand")).unwrap_err();
    assert!(error.ends_with(
        "scenes: there is no scene \"secand\" (did you mean \"second\"? the file has \"first\", \"second\")"
    ), "{error}");
    asset.json["scene"] = json!(2);
    let error = names(&asset, None).unwrap_err();
    assert!(error.ends_with(
        "scene 2: the scene has 1 node, but no mesh with triangles (beams hit triangles; the file also has scene 0 \
         \"first\", scene 1 \"second\")"
    ), "{error}");
    asset.json["scene"] = json!(0);
    asset.json["scenes"][0]["nodes"] = json!([7]);
    assert!(names(&asset, None).unwrap_err().contains("node 7 does not exist"));
}

#[test]
fn nodes_must_form_trees() {
    let of = |nodes: Value| {
        let mut asset = Asset::triangle();
        asset.json["nodes"] = nodes;
        asset.error()
    };
    assert!(of(json!([{ "children": [0], "mesh": 0 }])).contains("among its own descendants"));
    assert!(of(json!([{ "mesh": 0 }, { "children": [2] }, { "children": [1] }])).contains("among its own"));
    assert!(
        of(json!([{ "children": [2] }, { "children": [2] }, { "mesh": 0 }]))
            .contains("child of node 0 already")
    );
    assert!(of(json!([{ "children": [1] }])).contains("its child 1 does not exist"));
    assert!(of(json!([{ "mesh": 1 }])).contains("mesh 1: it does not exist: the last one is 0"));
}

#[test]
fn depth_is_no_matter() {
    let mut asset = Asset::triangle();
    let count = 100_000;
    let mut nodes: Vec<Value> =
        (1..count).map(|i| json!({ "children": [i], "translation": [0.001, 0, 0] })).collect();
    nodes.push(json!({ "mesh": 0 }));
    asset.json["nodes"] = json!(nodes);
    close(&world(&asset.load()), &[unit_at(99.999, 0.0, 0.0)], 1e-5);
}

#[test]
fn hidden_nodes() {
    let mut asset = Asset::triangle();
    asset.json["nodes"] = json!([
        { "children": [1], "extensions": { "KHR_node_visibility": { "visible": false } } },
        { "mesh": 0 },
        { "mesh": 0, "extensions": { "KHR_node_visibility": { "visible": true } } },
    ]);
    let loaded = asset.load();
    assert_eq!(loaded.scene.geometry.objects.len(), 1);
    assert_eq!(
        told(&loaded),
        ["node 0: KHR_node_visibility hides it: it and all nodes below it are left out"]
    );
}

#[test]
fn instancing() {
    let mut asset = Asset::triangle();
    let translations = asset.floats("VEC3", &[[1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0]]);
    let scales = asset.floats("VEC3", &[[1.0; 3], [2.0; 3], [1.0; 3]]);
    // The rotations are quarter turns about z in normalised integers; the last instance is not turned.
    let turn = (0.5_f64.sqrt() * 32767.0).round() as i16;
    let rotations: Vec<u8> =
        [0, 0, 0, 32767, 0, 0, turn, turn, 0, 0, 0, 32767_i16].iter().flat_map(|v| v.to_le_bytes()).collect();
    let rotations = asset.accessor("VEC4", SHORT, 3, &rotations);
    asset.json["accessors"][rotations]["normalized"] = json!(true);
    let attributes = json!({ "TRANSLATION": translations, "ROTATION": rotations, "SCALE": scales });
    asset.json["nodes"][0]["name"] = json!("tree");
    asset.json["nodes"][0]["translation"] = json!([0, 10, 0]);
    asset.json["nodes"][0]["extensions"] = json!({ "EXT_mesh_gpu_instancing": { "attributes": attributes } });
    let loaded = asset.load();
    let turned = [[2.0, 10.0, 0.0], [2.0, 12.0, 0.0], [0.0, 10.0, 0.0]];
    close(&world(&loaded), &[unit_at(1.0, 10.0, 0.0), turned, unit_at(3.0, 10.0, 0.0)], 1e-6);
    assert_eq!(loaded.scene.geometry.stored_triangle_count(), 1);
    assert!(loaded.scene.geometry.objects.iter().all(|object| object.name == "tree"));
    assert_eq!(loaded.scene.geometry.objects.len(), 3);

    asset.json["accessors"][scales]["count"] = json!(2);
    assert!(asset.error().contains("EXT_mesh_gpu_instancing, SCALE, accessor"), "{}", asset.error());
    asset.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = json!({});
    assert!(asset.error().contains("none of TRANSLATION, ROTATION and SCALE"));
}

// ---- Skins and morph targets ----

#[test]
fn skins_take_the_pose_of_their_joints() {
    let mut asset = Asset::triangle();
    let joints = asset.accessor("VEC4", UBYTE, 3, &[0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0]);
    let weights = asset.accessor("VEC4", UBYTE, 3, &[255, 0, 0, 0, 255, 0, 0, 0, 51, 204, 0, 0]);
    asset.json["accessors"][weights]["normalized"] = json!(true);
    let mut bind = [[0.0_f32; 16]; 2];
    for matrix in &mut bind {
        [0, 5, 10, 15].into_iter().for_each(|at| matrix[at] = 1.0);
    }
    bind[1][12] = -1.0; // joint 1 was at (1, 0, 0) when the skin was bound
    let bind = asset.floats("MAT4", &bind);
    asset.json["skins"] = json!([{ "joints": [1, 2], "inverseBindMatrices": bind }]);
    asset.json["meshes"][0]["primitives"][0]["attributes"]["JOINTS_0"] = json!(joints);
    asset.json["meshes"][0]["primitives"][0]["attributes"]["WEIGHTS_0"] = json!(weights);
    let far = 5_000_000.25;
    asset.json["nodes"] = json!([
        { "mesh": 0, "skin": 0, "translation": [77, 77, 77] }, // This translation has no effect.
        { "children": [2], "translation": [far, 0, 0] },
        { "translation": [1, 0, 5] },
    ]);
    // The first vertex moves with joint 0, the second with joint 1 (moved by 5 along z), the third by a fifth and four fifths.
    let expected = [[far, 0.0, 0.0], [far + 1.0, 0.0, 5.0], [far, 1.0, 4.0]];
    close(&world(&asset.load()), &[expected], 1e-6);

    asset.json["skins"][0]["joints"] = json!([1]);
    assert!(
        asset.error().contains("vertex 1 hangs on joint 1, but the skin has 1 joint"),
        "{}",
        asset.error()
    );
    asset.json["skins"][0]["joints"] = json!([1, 2, 0]);
    assert!(asset.error().contains("node 0, skin 0: there are 2 inverse bind matrices for 3 joints"));
    asset.json["skins"][0]["joints"] = json!([1, 9]);
    assert!(asset.error().contains("joint 1: node 9 does not exist"));
    asset.json["nodes"][0]["skin"] = json!(1);
    assert!(asset.error().contains("node 0, skin 1: it does not exist"));
}

#[test]
fn morph_targets_at_their_default_weights() {
    let mut asset = Asset::triangle();
    let up = asset.floats("VEC3", &[[0.0, 0.0, 1.0]; 3]);
    let right = asset.floats("VEC3", &[[1.0, 0.0, 0.0]; 3]);
    asset.json["meshes"][0]["primitives"][0]["targets"] = json!([{ "POSITION": up }, { "POSITION": right }]);
    close(&world(&asset.load()), &[UNIT], 0.0);
    asset.json["meshes"][0]["weights"] = json!([0.5, 0.0]);
    asset.json["nodes"] = json!([{ "mesh": 0 }, { "mesh": 0, "weights": [0.0, 3.0] }, { "mesh": 0 }]);
    let loaded = asset.load();
    let mut triangles = world(&loaded);
    triangles.sort_by(|a, b| a[0].x.total_cmp(&b[0].x));
    close(&triangles, &[unit_at(0.0, 0.0, 0.5), unit_at(0.0, 0.0, 0.5), unit_at(3.0, 0.0, 0.0)], 0.0);
    assert_eq!(
        loaded.scene.geometry.stored_triangle_count(),
        2,
        "the node without weights of its own shares its mesh"
    );
    let short = asset.floats("VEC3", &[[1.0; 3]; 2]);
    asset.json["meshes"][0]["primitives"][0]["targets"][0]["POSITION"] = json!(short);
    assert!(
        asset.error().contains("target 0, accessor 4: a target's POSITION has 2 elements where 3 are needed")
    );
}

// ---- Labels and materials ----

#[test]
fn labels_of_file_and_job() {
    let labels: BTreeMap<String, u32> =
        [("street", 1), ("car", 2), ("paint", 3), ("gone", 4)].map(|(name, id)| (name.to_owned(), id)).into();
    let mut asset = Asset::triangle();
    asset.json["materials"] = json!([{ "name": "paint" }]);
    asset.json["meshes"][0]["name"] = json!("body");
    asset.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    asset.json["nodes"] = json!([
        { "name": "street", "children": [1, 2], "extras": { "label": 40 } },
        { "mesh": 0, "children": [3], "extras": { "label": "car" } },
        { "name": "car", "mesh": 0, "extras": { "other": { "label": 7 } } },
        { "mesh": 0, "extras": { "label": -1 } },
        { "mesh": 0, "extras": { "label": "lorry" } },
        { "mesh": 0, "extras": 5 },
    ]);
    let loaded = asset.load_with(&Options { labels: &labels, ..plain() }).unwrap();
    let found: Vec<_> =
        loaded.scene.geometry.objects.iter().map(|o| (o.name.as_str(), o.job_label, o.file_label)).collect();
    assert_eq!(
        found,
        [
            ("body", Some(1), Some(2)),
            ("body", Some(1), Some(2)),
            ("car", Some(2), Some(40)),
            ("body", None, None),
            ("body", None, None),
        ]
    );
    assert_eq!(loaded.scene.geometry.materials[0].job_label, Some(3));
    assert_eq!(
        told(&loaded),
        [
            "node 3: extras.label \"-1\" is ignored: a label is an integer from 0 to 4294967295, or a name in the job's \
         labels",
            "node 4: extras.label \"lorry\" is not among the job's labels",
            "labels: no node or material is called \"gone\"",
        ]
    );
    let close = BTreeMap::from([("steet".to_owned(), 1)]);
    let loaded = asset.load_with(&Options { labels: &close, ..plain() }).unwrap();
    assert!(
        told(&loaded).contains(
            &"labels: no node or material is called \"steet\"; did you mean \"street\"?".to_owned()
        ),
        "{:?}",
        told(&loaded)
    );
}

#[test]
fn optics_of_nodes_materials_and_labels() {
    let optics =
        ["street", "paint", "kind", "gone"].map(|name| Optics { name: name.into(), ..Optics::default() });
    let labels = BTreeMap::from([("kind".to_owned(), 9)]);
    let mut asset = Asset::triangle();
    asset.json["materials"] = json!([{ "name": "paint" }]);
    let bare = asset.json["meshes"][0].clone();
    asset.push("meshes", bare);
    asset.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    asset.json["nodes"] = json!([
        { "name": "street", "children": [1] },
        { "mesh": 0 },
        { "mesh": 0, "extras": { "label": "kind" } },
        { "mesh": 1, "extras": { "label": "kind" } },
        { "mesh": 1 },
    ]);
    let loaded = asset.load_with(&Options { labels: &labels, optics: &optics, ..plain() }).unwrap();
    let of =
        |object, material| loaded.scene.optics(Surface { object, material }).map(|found| &found.name[..]);
    let found = [of(0, 0), of(1, 0), of(2, 1), of(3, 1)];
    assert_eq!(found, [Some("street"), Some("paint"), Some("kind"), None]);
    assert_eq!(told(&loaded), ["materials: no node, material or label is called \"gone\""]);
    let part = loaded.scene.only(|object| object == 2);
    assert_eq!(part.optics(Surface { object: 2, material: 1 }), Some(&optics[2]));
}

#[test]
fn materials() {
    let mut asset = Asset::triangle();
    asset.json["materials"] = json!([
        { "name": "grey", "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.5, 0.5, 1],
            "baseColorTexture": { "index": 3 } } },
        { "extensions": { "KHR_materials_pbrSpecularGlossiness": { "diffuseFactor": [0.1, 0.2, 0.3, 0.4] } } },
        { "pbrMetallicRoughness": { "baseColorFactor": [7, -1, 1e39, 1] } },
    ]);
    // A texture that does not exist does not keep the geometry from loading.
    asset.json["textures"] = json!("nonsense");
    asset.json["images"] = json!([{ "uri": "/etc/passwd" }]);
    let second = asset.json["meshes"][0]["primitives"][0].clone();
    asset.json["meshes"][0]["primitives"].as_array_mut().unwrap().push(second);
    asset.json["meshes"][0]["primitives"][1]["material"] = json!(1);
    let scene = asset.load().scene;
    let colors: Vec<_> = scene.geometry.materials.iter().map(|m| m.base_color).collect();
    assert_eq!(colors, [[0.5, 0.5, 0.5, 1.0], [0.1, 0.2, 0.3, 0.4], [1.0, 0.0, 1.0, 1.0], [1.0; 4]]);
    assert_eq!(scene.geometry.materials[0].name, "grey");
    assert_eq!(scene.surface(0, 0).material, 3, "the default material comes after the file's");
    assert_eq!(scene.surface(0, 1).material, 1);
    asset.json["meshes"][0]["primitives"][0]["material"] = json!(3);
    let loaded = asset.load();
    assert_eq!(loaded.scene.surface(0, 0).material, 3);
    let expected = "mesh 0, primitive 0: its material does not exist: it has the default material";
    assert!(told(&loaded).contains(&expected.to_owned()), "{:?}", told(&loaded));
}
