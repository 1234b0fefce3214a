//! The shipped scenes equal the output of their generator, and scenes/README.md describes them correctly.

use std::collections::HashMap;
use std::path::PathBuf;

use serde_json::Value;

#[path = "../../examples/make_scenes/world/mod.rs"]
mod world;

mod moving;

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("scenes")
}

#[test]
fn committed_files_are_a_fresh_generation() {
    let mut bytes = 0;
    for scene in world::all() {
        let committed = std::fs::read(folder().join(scene.file)).unwrap();
        assert!(
            committed == scene.glb,
            "{} differs from a fresh generation: cargo run --release --example make_scenes",
            scene.file
        );
        bytes += committed.len();
    }
    assert!(bytes < 6_000_000, "the scenes take {bytes} bytes");
    for (path, table) in world::tables() {
        let committed = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("configs").join(path);
        assert_eq!(std::fs::read_to_string(committed).unwrap(), table, "{path}");
    }
}

#[test]
fn the_readme_tells_their_sizes() {
    let readme = std::fs::read_to_string(folder().join("README.md")).unwrap();
    for scene in world::all() {
        let row = format!(
            "| `{}` | {} | {} | {} |",
            scene.file,
            grouped(scene.placed_triangles),
            grouped(scene.stored_triangles),
            grouped(scene.glb.len() as u64)
        );
        assert!(readme.contains(&row), "scenes/README.md lacks the row {row}");
    }
}

/// A number with thousands separators, such as 1,234,567.
fn grouped(n: u64) -> String {
    let digits = n.to_string();
    let groups: Vec<_> =
        digits.as_bytes().rchunks(3).rev().map(|group| String::from_utf8_lossy(group)).collect();
    groups.join(",")
}

#[test]
fn the_street_is_a_street_in_size() {
    let street = Glb::open("street.glb");
    let placed = street.placed_triangles();
    assert!((900_000..=1_300_000).contains(&placed), "{placed}");
    let made = world::all().into_iter().find(|s| s.file == "street.glb").unwrap();
    assert_eq!(placed, made.placed_triangles);
}

/// Every mesh that is not marked as open is closed, and each of its pieces faces outwards.
#[test]
fn solids_are_closed_and_face_outwards() {
    for file in world::all().into_iter().map(|scene| scene.file) {
        let glb = Glb::open(file);
        for index in 0..glb.json["meshes"].as_array().unwrap().len() {
            let mesh = &glb.json["meshes"][index];
            let name = format!("{file}, mesh {index} {}", mesh["name"]);
            let (positions, triangles) = glb.triangles(mesh);
            for &[a, b, c] in &triangles {
                let [a, b, c] = [a, b, c].map(|i| positions[i as usize]);
                assert!(cross(sub(b, a), sub(c, a)) != [0.0; 3], "{name}: a triangle without area");
            }
            if mesh["extras"]["open"] == true {
                continue;
            }
            let mut edges = HashMap::new();
            for t in &triangles {
                for (from, to) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                    *edges.entry((from, to)).or_insert(0) += 1;
                    *edges.entry((to, from)).or_insert(0) -= 1;
                }
            }
            assert!(edges.values().all(|&n| n == 0), "{name}: an edge has a triangle on one side only");
            for volume in piece_volumes(&positions, &triangles) {
                assert!(volume > 0.0, "{name}: a piece is inside out ({volume} m³)");
            }
        }
    }
}

/// The signed volumes of the connected parts of a mesh.
fn piece_volumes(positions: &[[f64; 3]], triangles: &[[u32; 3]]) -> Vec<f64> {
    let mut parent: Vec<usize> = (0..positions.len()).collect();
    fn root(parent: &mut [usize], mut i: usize) -> usize {
        while parent[i] != i {
            parent[i] = parent[parent[i]];
            i = parent[i];
        }
        i
    }
    for t in triangles {
        let first = root(&mut parent, t[0] as usize);
        for &v in &t[1..] {
            let other = root(&mut parent, v as usize);
            parent[other] = first;
        }
    }
    let mut volumes: HashMap<usize, f64> = HashMap::new();
    for t in triangles {
        let piece = root(&mut parent, t[0] as usize);
        let origin = positions[piece];
        let [a, b, c] = t.map(|i| sub(positions[i as usize], origin));
        let n = cross(b, c);
        *volumes.entry(piece).or_insert(0.0) += (a[0] * n[0] + a[1] * n[1] + a[2] * n[2]) / 6.0;
    }
    volumes.into_values().collect()
}

fn sub(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// A binary glTF file, read as the specification describes, without the crate's loader.
struct Glb {
    json: Value,
    binary: Vec<u8>,
}

impl Glb {
    fn open(file: &str) -> Self {
        let bytes = std::fs::read(folder().join(file)).unwrap();
        let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        assert_eq!((&bytes[..4], word(4), word(8)), (&b"glTF"[..], 2, bytes.len()));
        let json_end = 20 + word(12);
        assert_eq!((&bytes[16..20], &bytes[json_end + 4..json_end + 8]), (&b"JSON"[..], &b"BIN\0"[..]));
        assert_eq!(json_end + 8 + word(json_end), bytes.len());
        let json = serde_json::from_slice(&bytes[20..json_end]).unwrap();
        Self { json, binary: bytes[json_end + 8..].to_vec() }
    }

    fn count(&self, accessor: &Value) -> u64 {
        self.json["accessors"][accessor.as_u64().unwrap() as usize]["count"].as_u64().unwrap()
    }

    fn bytes(&self, accessor: &Value) -> &[u8] {
        let accessor = &self.json["accessors"][accessor.as_u64().unwrap() as usize];
        let view = &self.json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        let start = view["byteOffset"].as_u64().unwrap() as usize;
        &self.binary[start..start + view["byteLength"].as_u64().unwrap() as usize]
    }

    fn triangles(&self, mesh: &Value) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
        let primitives = mesh["primitives"].as_array().unwrap();
        let position = &primitives[0]["attributes"]["POSITION"];
        let floats: Vec<f64> = self
            .bytes(position)
            .chunks_exact(4)
            .map(|b| f64::from(f32::from_le_bytes(b.try_into().unwrap())))
            .collect();
        let positions: Vec<_> = floats.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect();
        let mut triangles = vec![];
        for primitive in primitives {
            // All primitives of a mesh share one set of vertices, so that the indices alone show whether it is closed.
            assert_eq!(&primitive["attributes"]["POSITION"], position);
            let indices = &primitive["indices"];
            let wide = self.json["accessors"][indices.as_u64().unwrap() as usize]["componentType"] == 5125;
            let indices: Vec<u32> = self
                .bytes(indices)
                .chunks_exact(if wide { 4 } else { 2 })
                .map(|b| b.iter().rev().fold(0, |value, &byte| value << 8 | u32::from(byte)))
                .collect();
            triangles.extend(indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]));
        }
        (positions, triangles)
    }

    fn placed_triangles(&self) -> u64 {
        let mesh_triangles = |mesh: &Value| -> u64 {
            let primitives = self.json["meshes"][mesh.as_u64().unwrap() as usize]["primitives"].as_array();
            primitives.unwrap().iter().map(|p| self.count(&p["indices"]) / 3).sum()
        };
        let nodes = self.json["nodes"].as_array().unwrap();
        let placed = nodes.iter().filter(|node| node.get("mesh").is_some()).map(|node| {
            let attributes = &node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"];
            let times = attributes.get("TRANSLATION").map_or(1, |accessor| self.count(accessor));
            times * mesh_triangles(&node["mesh"])
        });
        placed.sum()
    }
}
