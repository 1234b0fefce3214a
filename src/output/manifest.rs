//! The record of a run: its inputs and its outputs.

use std::collections::BTreeMap;
use std::io::{self, Write};

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use super::files::WrittenFile;
use super::id::id_of;
use super::json::{json_indented, json_lines, write_row};
use crate::scene::{Scene, SourceFile};

/// The version of the format. Version 1 had no number, and counted ids from 0.
const FORMAT: u32 = 2;

/// The content of `manifest.json`. It is written last, so that a folder with a manifest is complete.
#[derive(Clone, Copy, Debug)]
pub struct Manifest<'a> {
    /// The job with its sensors' files merged in.
    pub job: &'a Value,
    /// The seed of all random numbers.
    pub seed: u64,
    /// The files of the job and of its sensors.
    pub inputs: &'a [SourceFile],
    /// The job's labels by name.
    pub labels: &'a BTreeMap<String, u32>,
    /// The scene that was scanned. Its files are inputs too.
    pub scene: &'a Scene,
    /// The frames of each sensor.
    pub frames: &'a [SensorFrames],
}

/// The frames of a sensor that a run has.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SensorFrames {
    /// The sensor's name.
    pub sensor: String,
    /// The number of the first frame.
    pub first: u64,
    /// How many frames there are, one after the other.
    pub count: u64,
    /// The frames that the job has of the sensor.
    pub of: u64,
}

impl Manifest<'_> {
    /// The file's name in the output folder.
    pub const NAME: &'static str = "manifest.json";

    /// The content of the file without the outputs, which [`Self::write`] adds. The frames of a job that has one of each sensor
    /// go without saying.
    pub fn head(&self) -> String {
        let file = |f: &SourceFile| json!({ "name": f.name, "bytes": f.bytes, "blake3": f.blake3 });
        let inputs: Vec<_> = self.inputs.iter().chain(&self.scene.geometry.files).map(file).collect();
        let mut text = json_lines(&json!({
            "format": FORMAT,
            "tool": { "name": env!("CARGO_PKG_NAME"), "version": env!("CARGO_PKG_VERSION") },
            "seed": self.seed,
            "job": self.job,
            "inputs": inputs,
        }));
        text.truncate(opened(&text).len());
        text += ",\n  \"scene\": ";
        add_scene(self.scene, self.labels, &mut text);
        if self.frames.iter().any(|sensor| sensor.of > 1) {
            let row = |sensor: &SensorFrames| json!({ "sensor": sensor.sensor, "first": sensor.first, "count": sensor.count, "of": sensor.of });
            text += ",\n  \"frames\": ";
            text += &json_indented(&self.frames.iter().map(row).collect(), 2);
        }
        text + CLOSE
    }

    /// Writes a manifest as JSON, with the keys in a fixed order and a line for each file. Paths are as the user wrote them or
    /// relative to the manifest. `head` is [`Self::head`]. The outputs come one by one, and so does what was `drawn` for frames, by
    /// their numbers: there may be any number of them.
    ///
    /// # Errors
    /// An error if the file can't be written.
    pub fn write(
        head: &str,
        outputs: impl Iterator<Item = WrittenFile>,
        drawn: impl Iterator<Item = (u64, Map<String, Value>)>,
        file: &mut impl Write,
    ) -> io::Result<()> {
        write!(file, "{},\n  \"outputs\": [", opened(head))?;
        let mut row = String::new();
        let mut is_first = true;
        for WrittenFile { path, bytes, blake3 } in outputs {
            row.clear();
            row.push_str(if is_first { "\n    " } else { ",\n    " });
            let keys = [("path", path.into()), ("bytes", bytes.into()), ("blake3", blake3.into())];
            write_row(
                &keys.map(|(key, value): (&str, Value)| (key.to_owned(), value)).into_iter().collect(),
                &mut row,
            );
            file.write_all(row.as_bytes())?;
            is_first = false;
        }
        file.write_all(if is_first { b"]" } else { b"\n  ]" })?;
        let mut is_first = true;
        for (frame, values) in drawn {
            let open = if is_first { ",\n  \"drawn\": {" } else { "," };
            write!(file, "{open}\n    \"{frame}\": {}", json_indented(&Value::Object(values), 4))?;
            is_first = false;
        }
        file.write_all(if is_first { b"\n}\n" } else { b"\n  }\n}\n" })
    }
}

/// The end of a manifest's text.
const CLOSE: &str = "\n}\n";

/// A manifest's text without its end, to which keys can be added.
fn opened(text: &str) -> &str {
    text.strip_suffix(CLOSE).unwrap_or(text)
}

/// Adds the names behind the ids of the outputs. Ids count from 1, and 0 means nothing. The label of a triangle is the first that
/// exists of: the job's label for the instance, the job's label for the material, the scene file's label for the instance, and
/// 0.
///
/// Instances that follow each other with the same name and labels, such as those of an instanced mesh, are one entry with the
/// first id and the `last`. There may be millions of entries, so each is made when it is written.
fn add_scene(scene: &Scene, labels: &BTreeMap<String, u32>, text: &mut String) {
    let before = json!({
        "centre_m": scene.geometry.centre.to_array(),
        "triangles": scene.triangle_count(),
        "skipped_triangles": scene.geometry.skipped_triangles,
    });
    let before = json_indented(&before, 2);
    *text += before.strip_suffix("\n  }").unwrap_or(&before);
    *text += ",\n    \"instances\": [";
    let mut first = 0;
    for run in scene.geometry.objects.chunk_by(PartialEq::eq) {
        let mut entry = Map::new();
        entry.insert("id".into(), id_of(first).into());
        if run.len() > 1 {
            entry.insert("last".into(), (first + run.len() as u32).into());
        }
        entry.insert("name".into(), run[0].name.as_str().into());
        for (key, label) in [("job_label", run[0].job_label), ("file_label", run[0].file_label)] {
            label.map(|label| entry.insert(key.into(), label.into()));
        }
        *text += if first == 0 { "\n      " } else { ",\n      " };
        write_row(&entry, text);
        first += run.len() as u32;
    }
    *text += if first == 0 { "]," } else { "\n    ]," };
    let materials: Vec<_> = scene
        .geometry
        .materials
        .iter()
        .enumerate()
        .map(|(index, m)| match m.job_label {
            Some(label) => json!({ "index": index, "name": m.name, "job_label": label }),
            None => json!({ "index": index, "name": m.name }),
        })
        .collect();
    let mut by_label: BTreeMap<u32, Vec<&str>> = BTreeMap::new();
    for (name, &label) in labels {
        by_label.entry(label).or_default().push(name);
    }
    let labels: Map<String, Value> =
        by_label.into_iter().map(|(label, names)| (label.to_string(), names.into())).collect();
    let after = json_indented(&json!({ "labels": labels, "materials": materials }), 2);
    *text += after.strip_prefix('{').unwrap_or(&after);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Arrangement, Geometry, Material, Mesh, Object, Placement};
    use glam::DVec3;
    use std::sync::Arc;

    fn text_of(manifest: &Manifest, outputs: Vec<WrittenFile>) -> String {
        let mut text = Vec::new();
        Manifest::write(&manifest.head(), outputs.into_iter(), std::iter::empty(), &mut text).unwrap();
        String::from_utf8(text).unwrap()
    }

    #[test]
    fn it_says_what_went_in_and_what_came_out_in_a_fixed_order() {
        let mesh = Mesh { triangles: vec![[0, 1, 2], [0, 2, 3]], ..Mesh::default() };
        let input = |name: &str| SourceFile { name: name.into(), bytes: 5, blake3: "abc".into() };
        let wall = Object { name: "a \"wall\"\u{202e}".into(), job_label: Some(4), ..Object::default() };
        let tree = Object { name: "tree".into(), file_label: Some(7), ..Object::default() };
        let geometry = Geometry {
            centre: DVec3::new(1.0, 2.0, 3.0),
            meshes: vec![mesh],
            objects: vec![wall.clone(), wall, Object::default(), tree.clone(), tree.clone(), tree],
            materials: vec![Material::default()],
            triangle_ids: 2,
            skipped_triangles: 7,
            files: vec![input("../scenes/wall.glb")],
            ..Geometry::default()
        };
        let arrangement = Arrangement { placements: vec![Placement::FIXED], ..Arrangement::default() };
        let scene =
            Scene { geometry: Arc::new(geometry), arrangement: Arc::new(arrangement), ..Scene::default() };
        let output = WrittenFile { path: "top/000000.exr".into(), bytes: 9, blake3: "def".into() };
        let frames = [SensorFrames { sensor: "top".into(), first: 0, count: 1, of: 1 }];
        let manifest = Manifest {
            job: &json!({ "seed": 3, "scene": "../scenes/wall.glb" }),
            seed: 3,
            inputs: &[input("job.toml"), input("sensors/a.toml")],
            labels: &BTreeMap::from([("wall".into(), 4), ("fence".into(), 4), ("road".into(), 10)]),
            scene: &scene,
            frames: &frames,
        };
        let text = text_of(&manifest, vec![output.clone()]);
        let read: Value = serde_json::from_str(&text).unwrap();
        let keys: Vec<_> = read.as_object().unwrap().keys().collect();
        assert_eq!(keys, ["format", "tool", "seed", "job", "inputs", "scene", "outputs"]);
        assert_eq!(read["format"], 2);
        assert_eq!(read["job"], *manifest.job);
        assert_eq!(read["tool"]["version"], env!("CARGO_PKG_VERSION"));
        let names: Vec<_> = read["inputs"].as_array().unwrap().iter().map(|f| &f["name"]).collect();
        assert_eq!(names, ["job.toml", "sensors/a.toml", "../scenes/wall.glb"]);
        assert_eq!(read["scene"]["triangles"], 2);
        assert_eq!(read["scene"]["skipped_triangles"], 7);
        assert_eq!(read["scene"]["centre_m"], json!([1.0, 2.0, 3.0]));
        let instances = [
            json!({ "id": 1, "last": 2, "name": scene.geometry.objects[0].name, "job_label": 4 }),
            json!({ "id": 3, "name": "" }),
            json!({ "id": 4, "last": 6, "name": "tree", "file_label": 7 }),
        ];
        assert_eq!(read["scene"]["instances"], json!(instances));
        assert_eq!(read["scene"]["labels"], json!({ "4": ["fence", "wall"], "10": ["road"] }));
        assert_eq!(read["outputs"], json!([{ "path": "top/000000.exr", "bytes": 9, "blake3": "def" }]));
        assert_eq!(text, json_lines(&read), "it is written line by line as if it were written at once");
        assert_eq!(text, text_of(&manifest, vec![output.clone()]));
        let values = Map::from_iter([("sensor.top.range.max_m".to_owned(), json!(0.1))]);
        let drawn = [(9, values.clone()), (10, values)];
        let mut with_drawn = Vec::new();
        Manifest::write(&manifest.head(), [output.clone()].into_iter(), drawn.into_iter(), &mut with_drawn)
            .unwrap();
        let with_drawn = String::from_utf8(with_drawn).unwrap();
        let read_again: Value = serde_json::from_str(&with_drawn).unwrap();
        assert_eq!(with_drawn, json_lines(&read_again));
        assert_eq!(read_again["drawn"].as_object().unwrap().keys().collect::<Vec<_>>(), ["9", "10"]);
        assert_eq!(read_again["drawn"]["10"], json!({ "sensor.top.range.max_m": 0.1 }));
        let of_sequence = [SensorFrames { count: 3, of: 9, ..frames[0].clone() }];
        let sequence = Manifest { frames: &of_sequence, ..manifest };
        for outputs in [vec![], vec![output.clone(), output]] {
            let text = text_of(&sequence, outputs);
            let read: Value = serde_json::from_str(&text).unwrap();
            assert_eq!(read["frames"], json!([{ "sensor": "top", "first": 0, "count": 3, "of": 9 }]));
            assert_eq!(text, json_lines(&read));
        }
    }

    /// A file more is a line more, and so is a name; instances of the same name cost nothing.
    #[test]
    fn it_grows_by_a_line_a_file() {
        let size = |files: usize, objects: usize| {
            let tree = Object { name: "tree".into(), ..Object::default() };
            let geometry = Geometry { objects: vec![tree; objects], ..Geometry::default() };
            let scene = Scene { geometry: Arc::new(geometry), ..Scene::default() };
            let output =
                |i: usize| WrittenFile { path: format!("top/{i:06}.exr"), bytes: 9, blake3: "0".repeat(64) };
            let outputs: Vec<WrittenFile> = (0..files).map(output).collect();
            let (inputs, labels) = ([], BTreeMap::new());
            let manifest = Manifest {
                job: &json!({}),
                seed: 0,
                inputs: &inputs,
                labels: &labels,
                scene: &scene,
                frames: &[],
            };
            let text = text_of(&manifest, outputs);
            (text.lines().count(), text.len())
        };
        let ((lines, bytes), (more_lines, more_bytes)) = (size(100, 50), size(200, 50));
        assert_eq!(more_lines - lines, 100);
        assert!(more_bytes - bytes < 100 * 140, "{bytes} {more_bytes}");
        assert!(size(100, 99) == (lines, bytes));
    }
}
