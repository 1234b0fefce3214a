//! The manifest of a scan, as far as it is used when it is read back.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::io::{BufReader, Read};
use std::path::{Component, Path};

use serde::de::{DeserializeSeed, Error as _, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::{Map, Value};

use super::error::ReadError;
use super::instances::InstanceNames;
use crate::scene::label_names;

/// The content of a manifest. Anybody may have written it. What is not used of it is not kept: a tree of values would take
/// some thirty times the file's length.
#[derive(Clone, Debug, Default, Deserialize)]
pub struct RecordedManifest {
    /// The program that wrote it.
    #[serde(default)]
    pub tool: Tool,
    /// The seed of all random numbers.
    #[serde(default)]
    pub seed: Option<u64>,
    /// The job.
    #[serde(default)]
    pub job: RecordedJob,
    /// The files that went in.
    #[serde(default)]
    pub inputs: Vec<Input>,
    /// The scene.
    #[serde(default)]
    pub scene: RecordedScene,
    /// The files that came out, each once. No path leads out of the folder.
    pub outputs: Vec<Output>,
}

/// The program that wrote a manifest.
#[derive(Clone, Debug, Default, Deserialize, Serialize)]
pub struct Tool {
    /// Its name.
    pub name: Option<String>,
    /// Its version.
    pub version: Option<String>,
}

/// The parts of a recorded job that readers use.
#[derive(Clone, Debug, Default, Deserialize)]
pub struct RecordedJob {
    /// The scene's path, as the job has it.
    pub scene: Option<String>,
    /// The labels by the names of nodes or materials.
    #[serde(default)]
    labels: BTreeMap<String, u32>,
    /// The sensors.
    #[serde(default)]
    pub sensor: Vec<RecordedSensor>,
}

/// The parts of a recorded sensor that readers use.
#[derive(Clone, Debug, Default, Deserialize)]
pub struct RecordedSensor {
    /// The sensor's name, which one that is alone may lack.
    pub name: Option<String>,
    /// The pattern, in one of these tables.
    #[serde(
        default,
        alias = "rotating",
        alias = "raster",
        alias = "mirror",
        alias = "risley",
        alias = "pinhole",
        alias = "fisheye",
        alias = "orthographic",
        alias = "equirectangular"
    )]
    pattern: RecordedPattern,
}

/// What is used of a recorded pattern.
#[derive(Clone, Debug, Default, Deserialize)]
struct RecordedPattern {
    rate_hz: Option<f64>,
}

/// A file that went in.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub struct Input {
    /// The name as the user wrote it.
    pub name: String,
    /// Its length.
    pub bytes: Option<u64>,
    /// Its hash.
    pub blake3: Option<String>,
}

/// A file that came out.
#[derive(Clone, Debug, Deserialize, Serialize)]
pub struct Output {
    /// The path in the folder, with forward slashes.
    pub path: String,
    /// Its length.
    pub bytes: Option<u64>,
    /// Its hash.
    pub blake3: Option<String>,
}

/// The parts of a recorded scene that readers use.
#[derive(Clone, Debug, Default, Deserialize)]
pub struct RecordedScene {
    /// The number of triangles, each counted as often as it is placed.
    pub triangles: Option<u64>,
    #[serde(default)]
    instances: Vec<Instances>,
    #[serde(default)]
    materials: Vec<IgnoredAny>,
}

/// Instances that follow each other and have the same name.
#[derive(Clone, Debug, Deserialize)]
struct Instances {
    id: Option<u32>,
    last: Option<u32>,
    name: String,
    file_label: Option<u32>,
}

impl RecordedManifest {
    /// The frames a second of a sensor, in hertz, if the job says them and they are some.
    pub fn rate_hz(&self, sensor: &str) -> Option<f64> {
        let of_name = |recorded: &&RecordedSensor| recorded.name.as_deref().is_none_or(|name| name == sensor);
        let recorded = self.job.sensor.iter().find(of_name)?;
        recorded.pattern.rate_hz.filter(|rate| rate.is_finite() && *rate > 0.0)
    }

    /// Reads a manifest.
    pub(super) fn decode(bytes: &[u8]) -> Result<Self, ReadError> {
        let manifest: Self = serde_json::from_slice(bytes).map_err(|e| {
            let is = if e.is_data() { "the manifest of a scan" } else { "valid JSON" };
            ReadError::new(format!("this is not {is}: {e}"))
        })?;
        let mut known = BTreeSet::new();
        for Output { path, .. } in &manifest.outputs {
            let inside = Path::new(path).components().all(|part| matches!(part, Component::Normal(_)));
            if !inside || path.is_empty() || path.contains('\\') {
                return Err(ReadError::new(format!("lists {path:?}, which is not in its folder")));
            }
            if !known.insert(path) {
                return Err(ReadError::new(format!("lists {path:?} twice")));
            }
        }
        Ok(manifest)
    }

    /// The meaning of labels, in words: the names in the job's `[labels]`, else the names of the objects that have them.
    pub fn label_names(&self) -> BTreeMap<u32, String> {
        let of_job = self.job.labels.iter().map(|(name, label)| (name.as_str(), *label));
        let of_file = self.scene.instances.iter();
        let of_file = of_file.filter_map(|instances| Some((instances.name.as_str(), instances.file_label?)));
        label_names(of_job, of_file)
    }
}

/// Reads a manifest whose outputs are too many to be kept: each goes to `each`, and the rest of the manifest is returned.
///
/// # Errors
/// [`ReadError`] if it is no manifest.
pub fn read_manifest(file: impl Read, mut each: impl FnMut(Output)) -> Result<Value, ReadError> {
    struct Head<'e>(&'e mut dyn FnMut(Output));
    struct Outputs<'e>(&'e mut dyn FnMut(Output));
    impl<'de> Visitor<'de> for Head<'_> {
        type Value = Map<String, Value>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("the manifest of a scan")
        }

        fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
            let mut head = Map::new();
            let mut has_outputs = false;
            while let Some(key) = map.next_key::<String>()? {
                if key == "outputs" {
                    map.next_value_seed(Outputs(&mut *self.0))?;
                    has_outputs = true;
                } else {
                    head.insert(key, map.next_value()?);
                }
            }
            if has_outputs { Ok(head) } else { Err(A::Error::missing_field("outputs")) }
        }
    }
    impl<'de> DeserializeSeed<'de> for Outputs<'_> {
        type Value = ();

        fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
            deserializer.deserialize_seq(self)
        }
    }
    impl<'de> Visitor<'de> for Outputs<'_> {
        type Value = ();

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("a list of outputs")
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<(), A::Error> {
            while let Some(output) = seq.next_element()? {
                (self.0)(output);
            }
            Ok(())
        }
    }
    let mut deserializer = serde_json::Deserializer::from_reader(BufReader::new(file));
    let head =
        deserializer.deserialize_map(Head(&mut each)).and_then(|head| deserializer.end().map(|()| head));
    head.map(Value::Object).map_err(|e| ReadError::new(format!("this is not the manifest of a scan: {e}")))
}

impl RecordedScene {
    /// The names of the instances.
    pub fn instances(&self) -> InstanceNames {
        // A manifest without a format counts ids from 0, and may leave them out.
        let mut next = 0;
        let run = |instances: &Instances| {
            let first = instances.id.unwrap_or(next);
            let last = instances.last.unwrap_or(first);
            next = last.saturating_add(1);
            (first, last, instances.name.clone())
        };
        InstanceNames::new(self.instances.iter().map(run).collect())
    }

    /// The number of materials.
    pub fn materials(&self) -> usize {
        self.materials.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_manifest_is_told() {
        let problem = |text: &str| RecordedManifest::decode(text.as_bytes()).unwrap_err().to_string();
        assert!(problem("{").starts_with("this is not valid JSON"));
        assert!(problem("{}").starts_with("this is not the manifest of a scan: missing field `outputs`"));
        assert!(problem("{\"outputs\":[{}]}").contains("missing field `path`"));
        assert!(problem("{\"outputs\":[{\"path\":\"../a\"}]}").contains("is not in its folder"));
        assert!(problem("{\"outputs\":[{\"path\":\"a\"},{\"path\":\"a\"}]}").contains("lists \"a\" twice"));
        let least = RecordedManifest::decode(b"{\"outputs\":[],\"more\":[[[{}]]]}").unwrap();
        assert_eq!((least.outputs.len(), least.scene.instances().count()), (0, 0));
    }
}
