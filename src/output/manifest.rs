//! The record of a run: its inputs and its outputs.

use serde_json::{Value, json};

use super::files::WrittenFile;
use crate::scene::{Scene, SourceFile};

/// The content of `manifest.json`. It is written last, so that a folder with a manifest is complete.
#[derive(Clone, Copy, Debug)]
pub struct Manifest<'a> {
    /// The job with its sensors' files merged in.
    pub job: &'a Value,
    /// The seed of all random numbers.
    pub seed: u64,
    /// The files of the job and of its sensors.
    pub inputs: &'a [SourceFile],
    /// The scene that was scanned. Its files are inputs too.
    pub scene: &'a Scene,
    /// The files that were written.
    pub outputs: &'a [WrittenFile],
}

impl Manifest<'_> {
    /// The file's name in the output folder.
    pub const NAME: &'static str = "manifest.json";

    /// The content of the file as JSON, with the keys in a fixed order. Paths are as the user wrote them or relative to the
    /// manifest.
    pub fn encode(&self) -> Vec<u8> {
        let file = |f: &SourceFile| json!({ "name": f.name, "bytes": f.bytes, "blake3": f.blake3 });
        let inputs: Vec<_> = self.inputs.iter().chain(&self.scene.geometry.files).map(file).collect();
        let outputs: Vec<_> = self
            .outputs
            .iter()
            .map(|f| json!({ "path": f.path, "bytes": f.bytes, "blake3": f.blake3 }))
            .collect();
        let manifest = json!({
            "tool": { "name": env!("CARGO_PKG_NAME"), "version": env!("CARGO_PKG_VERSION") },
            "seed": self.seed,
            "job": self.job,
            "inputs": inputs,
            "scene": scene(self.scene),
            "outputs": outputs,
        });
        format!("{manifest:#}\n").into_bytes()
    }
}

/// The lists into which the ids of the outputs are indices. The label of a triangle is the first that exists of: the job's
/// label for the instance, the job's label for the material, the scene file's label for the instance, and 0.
fn scene(scene: &Scene) -> Value {
    let instances: Vec<_> = scene
        .geometry
        .objects
        .iter()
        .enumerate()
        .map(|(id, o)| json!({ "id": id, "name": o.name, "job_label": o.job_label, "file_label": o.file_label }))
        .collect();
    let materials: Vec<_> = scene
        .geometry
        .materials
        .iter()
        .enumerate()
        .map(|(id, m)| json!({ "id": id, "name": m.name, "job_label": m.job_label }))
        .collect();
    json!({
        "centre_m": scene.geometry.centre.to_array(),
        "triangles": scene.triangle_count(),
        "skipped_triangles": scene.geometry.skipped_triangles,
        "instances": instances,
        "materials": materials,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Arrangement, Geometry, Material, Mesh, Object, Placement};
    use glam::DVec3;
    use std::sync::Arc;

    #[test]
    fn it_says_what_went_in_and_what_came_out_in_a_fixed_order() {
        let mesh = Mesh { triangles: vec![[0, 1, 2], [0, 2, 3]], ..Mesh::default() };
        let input = |name: &str| SourceFile { name: name.into(), bytes: 5, blake3: "abc".into() };
        let geometry = Geometry {
            centre: DVec3::new(1.0, 2.0, 3.0),
            meshes: vec![mesh],
            objects: vec![Object { name: "a \"wall\"\u{202e}".into(), job_label: Some(4), file_label: None }],
            materials: vec![Material::default()],
            skipped_triangles: 7,
            files: vec![input("../scenes/wall.glb")],
            ..Geometry::default()
        };
        let arrangement = Arrangement { placements: vec![Placement::FIXED] };
        let scene = Scene { geometry: Arc::new(geometry), arrangement: Arc::new(arrangement) };
        let output = WrittenFile { path: "top/000000.exr".into(), bytes: 9, blake3: "def".into() };
        let manifest = Manifest {
            job: &json!({ "seed": 3, "scene": "../scenes/wall.glb" }),
            seed: 3,
            inputs: &[input("job.toml"), input("sensors/a.toml")],
            scene: &scene,
            outputs: &[output],
        };
        let text = String::from_utf8(manifest.encode()).unwrap();
        let read: Value = serde_json::from_str(&text).unwrap();
        let keys: Vec<_> = read.as_object().unwrap().keys().collect();
        assert_eq!(keys, ["tool", "seed", "job", "inputs", "scene", "outputs"]);
        assert_eq!(read["job"], *manifest.job);
        assert_eq!(read["tool"]["version"], env!("CARGO_PKG_VERSION"));
        let names: Vec<_> = read["inputs"].as_array().unwrap().iter().map(|f| &f["name"]).collect();
        assert_eq!(names, ["job.toml", "sensors/a.toml", "../scenes/wall.glb"]);
        assert_eq!(read["scene"]["triangles"], 2);
        assert_eq!(read["scene"]["skipped_triangles"], 7);
        assert_eq!(read["scene"]["centre_m"], json!([1.0, 2.0, 3.0]));
        assert_eq!(read["scene"]["instances"][0]["name"], scene.geometry.objects[0].name);
        assert_eq!(read["scene"]["instances"][0]["job_label"], 4);
        assert_eq!(read["outputs"], json!([{ "path": "top/000000.exr", "bytes": 9, "blake3": "def" }]));
        assert_eq!(text, String::from_utf8(manifest.encode()).unwrap());
    }
}
