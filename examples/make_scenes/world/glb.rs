//! A writer of binary glTF: meshes, nodes and instances, placed in the world's z-up frame.

use std::collections::HashMap;

use glam::{DQuat, DVec3};
use serde_json::{Map, Value, json};

use super::mesh::{Mesh, sincos_deg};

mod moving;

pub use moving::{Keys, Skin, Weights};

/// A finished scene.
pub struct SceneFile {
    /// The file's path in `scenes/`.
    pub file: &'static str,
    pub glb: Vec<u8>,
    /// The number of triangles in the scene, where each placement of a mesh counts.
    pub placed_triangles: u64,
    /// The number of triangles in the file.
    pub stored_triangles: u64,
}

#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Material(u32);

#[derive(Clone, Copy)]
pub struct MeshId(usize);

#[derive(Clone, Copy)]
pub struct NodeId(usize);

/// The placement of an object, which is scaled, then rotated, then moved.
#[derive(Clone, Copy)]
pub struct Place {
    at: DVec3,
    rotation: DQuat,
    scale: DVec3,
}

impl Place {
    pub fn at(x: f64, y: f64, z: f64) -> Self {
        Self { at: DVec3::new(x, y, z), rotation: DQuat::IDENTITY, scale: DVec3::ONE }
    }

    /// Rotates the object about its own z axis, counter-clockwise seen from above.
    pub fn yaw(self, degrees: f64) -> Self {
        let (s, c) = sincos_deg(degrees / 2.0);
        Self { rotation: self.rotation * DQuat::from_xyzw(0.0, 0.0, s, c), ..self }
    }

    pub fn scaled(self, x: f64, y: f64, z: f64) -> Self {
        Self { scale: DVec3::new(x, y, z), ..self }
    }

    pub fn rotated(self, rotation: DQuat) -> Self {
        Self { rotation, ..self }
    }

    pub fn position(&self) -> DVec3 {
        self.at
    }

    /// Transforms a direction from the object's own frame to the world.
    pub fn direction(&self, d: DVec3) -> DVec3 {
        self.rotation * d
    }
}

/// A frame that is rotated by whole quarter turns, so that its matrix is exact and abutting pieces stay without gaps.
#[derive(Clone, Copy)]
pub struct QuarterTurned {
    pub at: DVec3,
    /// The number of quarter turns, counter-clockwise seen from above.
    pub quarters: u32,
}

/// A glTF file under construction.
pub struct Document {
    materials: Vec<Value>,
    meshes: Vec<Value>,
    mesh_triangles: Vec<u64>,
    nodes: Vec<Value>,
    roots: Vec<usize>,
    accessors: Vec<Value>,
    views: Vec<Value>,
    skins: Vec<Value>,
    animations: Vec<Value>,
    binary: Vec<u8>,
    placed_triangles: u64,
    stored_triangles: u64,
}

const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;
const U8: u32 = 5121;
const U16: u32 = 5123;
const U32: u32 = 5125;
const F32: u32 = 5126;

impl Document {
    pub fn new() -> Self {
        Self {
            materials: vec![],
            meshes: vec![],
            mesh_triangles: vec![],
            nodes: vec![],
            roots: vec![],
            accessors: vec![],
            views: vec![],
            skins: vec![],
            animations: vec![],
            binary: vec![],
            placed_triangles: 0,
            stored_triangles: 0,
        }
    }

    /// Adds a matt material with a linear base colour.
    pub fn material(&mut self, name: &str, [r, g, b]: [f64; 3]) -> Material {
        self.materials.push(json!({
            "name": name,
            "pbrMetallicRoughness": {
                "baseColorFactor": [r, g, b, 1.0],
                "metallicFactor": 0.0,
                "roughnessFactor": 1.0,
            },
        }));
        Material(self.materials.len() as u32 - 1)
    }

    pub fn grey(&mut self, name: &str, reflectivity: f64) -> Material {
        self.material(name, [reflectivity; 3])
    }

    /// Stores a closed mesh.
    pub fn solid(&mut self, name: &str, mesh: &Mesh) -> MeshId {
        self.mesh(name, mesh, false)
    }

    /// Stores an open mesh, such as a sheet, leaves, or a shell that other meshes complete. Its `extras` say so, for the
    /// tests of closed meshes.
    pub fn sheet(&mut self, name: &str, mesh: &Mesh) -> MeshId {
        self.mesh(name, mesh, true)
    }

    fn mesh(&mut self, name: &str, mesh: &Mesh, open: bool) -> MeshId {
        let welded = Welded::of(mesh);
        let attributes = json!({ "POSITION": self.positions(&welded.positions) });
        self.welded(name, &welded, &attributes, open)
    }

    /// Stores a mesh whose vertices have these attributes.
    fn welded(&mut self, name: &str, welded: &Welded, attributes: &Value, open: bool) -> MeshId {
        let Welded { positions, faces, .. } = welded;
        let mut primitives = vec![];
        for run in faces.chunk_by(|a, b| a.0 == b.0) {
            let indices: Vec<u32> = run.iter().flat_map(|&(_, corners)| corners).collect();
            let indices = self.indices(&indices, positions.len());
            primitives.push(json!({
                "attributes": attributes,
                "indices": indices,
                "material": run[0].0.0,
            }));
        }
        let mut value = json!({ "name": name, "primitives": primitives });
        if open {
            value["extras"] = json!({ "open": true });
        }
        self.stored_triangles += faces.len() as u64;
        self.push_mesh(value, faces.len() as u64)
    }

    /// A mesh with the same geometry (stored once) and with one material replaced.
    pub fn repainted(&mut self, name: &str, mesh: MeshId, from: Material, to: Material) -> MeshId {
        let mut value = self.meshes[mesh.0].clone();
        value["name"] = json!(name);
        if let Some(primitives) = value["primitives"].as_array_mut() {
            for primitive in primitives.iter_mut().filter(|p| p["material"] == from.0) {
                primitive["material"] = json!(to.0);
            }
        }
        self.push_mesh(value, self.mesh_triangles[mesh.0])
    }

    fn push_mesh(&mut self, value: Value, triangles: u64) -> MeshId {
        self.meshes.push(value);
        self.mesh_triangles.push(triangles);
        MeshId(self.meshes.len() - 1)
    }

    /// A node of one mesh. It is not in the scene until [`Self::add`] or [`Self::group`] adds it.
    pub fn node(&mut self, name: &str, mesh: MeshId, place: Place, extras: Value) -> NodeId {
        self.placed_triangles += self.mesh_triangles[mesh.0];
        let mut node = Map::new();
        node.insert("name".into(), json!(name));
        node.insert("mesh".into(), json!(mesh.0));
        insert_place(&mut node, place);
        self.push_node(node, extras)
    }

    /// A node that places its mesh many times (EXT_mesh_gpu_instancing).
    pub fn instances(&mut self, name: &str, mesh: MeshId, places: &[Place], extras: Value) -> NodeId {
        self.placed_triangles += self.mesh_triangles[mesh.0] * places.len() as u64;
        let mut attributes = Map::new();
        let translations: Vec<f32> = places.iter().flat_map(|p| gltf_vector(p.at)).collect();
        attributes.insert("TRANSLATION".into(), json!(self.instance_attribute(&translations, "VEC3")));
        if places.iter().any(|p| p.rotation != DQuat::IDENTITY) {
            let rotations: Vec<f32> = places.iter().flat_map(|p| gltf_rotation(p.rotation)).collect();
            attributes.insert("ROTATION".into(), json!(self.instance_attribute(&rotations, "VEC4")));
        }
        if places.iter().any(|p| p.scale != DVec3::ONE) {
            let scales: Vec<f32> = places.iter().flat_map(|p| gltf_scale(p.scale)).collect();
            attributes.insert("SCALE".into(), json!(self.instance_attribute(&scales, "VEC3")));
        }
        let mut node = Map::new();
        node.insert("name".into(), json!(name));
        node.insert("mesh".into(), json!(mesh.0));
        node.insert("extensions".into(), json!({ "EXT_mesh_gpu_instancing": { "attributes": attributes } }));
        self.push_node(node, extras)
    }

    /// Adds a parent node above `children` to the scene.
    pub fn group(&mut self, name: &str, frame: QuarterTurned, children: &[NodeId], extras: Value) {
        let (s, c) = sincos_deg(90.0 * f64::from(frame.quarters % 4));
        let [x, y, z] = gltf_vector(frame.at).map(f64::from);
        let mut node = Map::new();
        node.insert("name".into(), json!(name));
        let columns = [[c, 0.0, -s, 0.0], [0.0, 1.0, 0.0, 0.0], [s, 0.0, c, 0.0], [x, y, z, 1.0]];
        node.insert("matrix".into(), json!(columns.concat().iter().map(|v| v + 0.0).collect::<Vec<_>>()));
        node.insert("children".into(), json!(children.iter().map(|c| c.0).collect::<Vec<_>>()));
        let node = self.push_node(node, extras);
        self.add(node);
    }

    /// Adds a node to the scene.
    pub fn add(&mut self, node: NodeId) {
        self.roots.push(node.0);
    }

    fn push_node(&mut self, mut node: Map<String, Value>, extras: Value) -> NodeId {
        if !extras.is_null() {
            node.insert("extras".into(), extras);
        }
        self.nodes.push(Value::Object(node));
        NodeId(self.nodes.len() - 1)
    }

    fn positions(&mut self, positions: &[[f32; 3]]) -> usize {
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for p in positions {
            for axis in 0..3 {
                low[axis] = low[axis].min(p[axis]);
                high[axis] = high[axis].max(p[axis]);
            }
        }
        let bytes: Vec<u8> = positions.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        let view = self.view(&bytes, Some(ARRAY_BUFFER));
        self.accessor(json!({
            "bufferView": view, "componentType": F32, "count": positions.len(), "type": "VEC3",
            "min": floats(&low), "max": floats(&high),
        }))
    }

    fn indices(&mut self, indices: &[u32], vertices: usize) -> usize {
        // The largest value of an index type is the mark for a primitive restart, which no index may have.
        let (kind, bytes): (u32, Vec<u8>) = if vertices <= usize::from(u16::MAX) {
            (U16, indices.iter().flat_map(|&i| (i as u16).to_le_bytes()).collect())
        } else {
            (U32, indices.iter().flat_map(|i| i.to_le_bytes()).collect())
        };
        let view = self.view(&bytes, Some(ELEMENT_ARRAY_BUFFER));
        self.accessor(json!({
            "bufferView": view, "componentType": kind, "count": indices.len(), "type": "SCALAR",
        }))
    }

    /// Numbers that belong to no vertex.
    fn instance_attribute(&mut self, values: &[f32], kind: &str) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let view = self.view(&bytes, None);
        let width = match kind {
            "MAT4" => 16,
            "VEC4" => 4,
            _ => 3,
        };
        self.accessor(json!({
            "bufferView": view, "componentType": F32, "count": values.len() / width, "type": kind,
        }))
    }

    fn accessor(&mut self, value: Value) -> usize {
        self.accessors.push(value);
        self.accessors.len() - 1
    }

    fn view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        pad(&mut self.binary, 0);
        let mut view = json!({ "buffer": 0, "byteOffset": self.binary.len(), "byteLength": bytes.len() });
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.binary.extend_from_slice(bytes);
        self.views.push(view);
        self.views.len() - 1
    }

    /// Returns the finished file. `about` is written into `asset.extras`.
    pub fn finish(mut self, file: &'static str, about: &str) -> SceneFile {
        pad(&mut self.binary, 0);
        let name = file.trim_end_matches(".glb");
        let name = name.rsplit('/').next().unwrap_or(name);
        let mut root = json!({
            "asset": {
                "version": "2.0",
                "generator": "beamcast make_scenes",
                "copyright": "MIT OR Apache-2.0",
                "extras": { "about": about },
            },
            "scene": 0,
            "scenes": [{ "name": name, "nodes": self.roots }],
            "nodes": self.nodes,
            "meshes": self.meshes,
            "materials": self.materials,
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{ "byteLength": self.binary.len() }],
        });
        if self.nodes.iter().any(|n| n.get("extensions").is_some()) {
            root["extensionsUsed"] = json!(["EXT_mesh_gpu_instancing"]);
            root["extensionsRequired"] = json!(["EXT_mesh_gpu_instancing"]);
        }
        for (key, values) in [("skins", self.skins), ("animations", self.animations)] {
            if !values.is_empty() {
                root[key] = Value::Array(values);
            }
        }
        let mut text = root.to_string().into_bytes();
        pad(&mut text, b' ');
        let total = 12 + 8 + text.len() + 8 + self.binary.len();
        let mut glb = Vec::with_capacity(total);
        let mut word = |bytes: &[u8]| glb.extend_from_slice(bytes);
        word(b"glTF");
        word(&2_u32.to_le_bytes());
        word(&(total as u32).to_le_bytes());
        word(&(text.len() as u32).to_le_bytes());
        word(b"JSON");
        word(&text);
        word(&(self.binary.len() as u32).to_le_bytes());
        word(b"BIN\0");
        word(&self.binary);
        SceneFile {
            file,
            glb,
            placed_triangles: self.placed_triangles,
            stored_triangles: self.stored_triangles,
        }
    }
}

fn insert_place(node: &mut Map<String, Value>, place: Place) {
    if place.at != DVec3::ZERO {
        node.insert("translation".into(), floats(&gltf_vector(place.at)));
    }
    if place.rotation != DQuat::IDENTITY {
        node.insert("rotation".into(), floats(&gltf_rotation(place.rotation)));
    }
    if place.scale != DVec3::ONE {
        node.insert("scale".into(), floats(&gltf_scale(place.scale)));
    }
}

/// A mesh whose vertices are stored once for each place.
struct Welded {
    positions: Vec<[f32; 3]>,
    /// For each stored vertex the first of the mesh's that is there.
    sources: Vec<u32>,
    /// Faces in the order of their materials. Faces of one material keep their order.
    faces: Vec<(Material, [u32; 3])>,
}

impl Welded {
    fn of(mesh: &Mesh) -> Self {
        let mut known = HashMap::new();
        let mut positions: Vec<[f32; 3]> = vec![];
        let mut sources = vec![];
        let mut faces: Vec<(Material, [u32; 3])> = vec![];
        for &(corners, material) in &mesh.faces {
            let corners = corners.map(|v| {
                let p = gltf_vector(mesh.positions[v as usize]);
                *known.entry(p.map(f32::to_bits)).or_insert_with(|| {
                    positions.push(p);
                    sources.push(v);
                    positions.len() as u32 - 1
                })
            });
            let [a, b, c] = corners;
            if a != b && b != c && c != a {
                faces.push((material, corners));
            }
        }
        faces.sort_by_key(|&(material, _)| material);
        Self { positions, sources, faces }
    }
}

fn pad(bytes: &mut Vec<u8>, with: u8) {
    bytes.resize(bytes.len().next_multiple_of(4), with);
}

/// Converts a vector from z up to glTF's y up: (x, y, z) → (x, z, −y). Adding zero turns −0 into 0.
fn gltf_vector(v: DVec3) -> [f32; 3] {
    [v.x as f32, v.z as f32, (-v.y) as f32].map(|c| c + 0.0)
}

fn gltf_rotation(q: DQuat) -> [f32; 4] {
    [q.x as f32, q.z as f32, (-q.y) as f32, q.w as f32].map(|c| c + 0.0)
}

fn gltf_scale(s: DVec3) -> [f32; 3] {
    [s.x as f32, s.z as f32, s.y as f32]
}

/// Writes f32 numbers such that a reader in f32 and a reader in f64 get the same value.
fn floats(values: &[f32]) -> Value {
    Value::Array(values.iter().map(|&v| json!(f64::from(v))).collect())
}
