//! `beamcast info`: shows the content of a file at a glance.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde_json::{Value, json};

use super::facts;
use super::job::SceneArgs;
use super::json;
use super::outline;
use super::recording;
use super::terminal::Terminal;
use crate::error::Error;
use crate::output::Samples;
use crate::output::recorded::{Cloud, Folder, FrameKey, Part, Recorded, RecordedManifest};
use crate::run::facts::facts_of;
use crate::run::{Bytes, memory};
use crate::scene::gltf;
use crate::source::suggest::missing_file_help;
use crate::source::words::{on_one_line, quoted};
use crate::source::{FileKind, Wanted, is_config, recognise};

/// The arguments of `beamcast info`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A job, a sensor file, a scene (.gltf, .glb), a range image (EXR, NPZ), a cloud (PLY, PCD, NPY, LAS, LAZ, E57), a recording (MCAP), or a scan's folder or manifest
    #[arg(value_name = "FILE")]
    path: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    scenes: SceneArgs,
}

/// Prints the content of a file on stdout, in short.
///
/// # Errors
/// [`Error::Config`] if a job or sensor file is wrong, [`Error::Inputs`] or [`Error::Input`] if another file can't be read.
pub fn run(args: &Args, terminal: &Terminal) -> Result<(), Error> {
    let path = &args.path;
    let kind = if path.is_dir() { FileKind::Manifest } else { kind_of(path)? };
    if !kind.is_recorded() {
        let (file, warnings) = facts_of(path, &args.scenes.allowed_folders)?;
        terminal.warn_of(&warnings);
        let outline = if kind.is_scene() { Some(gltf::outline(path)?) } else { None };
        if !args.json {
            let outline = outline.as_ref().map_or(String::new(), outline::text);
            return terminal.print(&(facts::text(&file) + &outline));
        }
        let mut json = serde_json::to_value(&file).map_err(|e| Error::output("stdout", e))?;
        json["outline"] = json!(outline);
        json["diagnostics"] = json!(warnings);
        return terminal.json(&json::INFO.of(json));
    }
    let name = path.to_string_lossy();
    let short = match kind {
        FileKind::Exr => "EXR",
        FileKind::Npz => "NPZ",
        FileKind::Pcd => "PCD",
        FileKind::Npy => "NPY",
        FileKind::Las => "LAS",
        FileKind::E57 => "E57",
        _ => "PLY",
    };
    // A message of a recording is in memory beside the chunk that it is in.
    let memory = match kind {
        FileKind::Mcap => memory::for_recordings(),
        _ => memory::of_machine().unwrap_or(u64::MAX),
    };
    let (json, text) = match Recorded::open(path, memory)? {
        Recorded::Images(parts) => {
            let facts: Vec<PartFacts> = parts.iter().map(PartFacts::of).collect();
            let text: String = facts.iter().map(PartFacts::to_text).collect();
            (json!({ "path": name, "kind": short, "parts": facts }), text)
        }
        Recorded::Cloud(cloud) => {
            let facts = CloudFacts::of(&cloud);
            let text = facts.to_text();
            (json!({ "path": name, "kind": short, "cloud": facts }), text)
        }
        Recorded::Bag(mut bag) => {
            let (facts, text) = recording::facts(&mut bag);
            (json!({ "path": name, "kind": "MCAP", "bag": facts }), text)
        }
        Recorded::Folder(folder) => folder_facts(&name, &folder),
    };
    if args.json {
        return terminal.json(&json::INFO.of(json));
    }
    let kind = json.get("kind").and_then(Value::as_str).unwrap_or_default();
    terminal.print(&format!("{}: {kind}\n{text}", plain(&name)))
}

/// What a file is.
///
/// # Errors
/// [`Error::Input`] if it can't be read, or if it is nothing that can be shown.
fn kind_of(path: &Path) -> Result<FileKind, Error> {
    let kind = recognise(path).map_err(|problem| {
        let help = missing_file_help(&path.to_string_lossy(), path).filter(|_| !path.exists());
        Error::input(path, problem.to_string() + &help.map_or(String::new(), |help| format!(" ({help})")))
    })?;
    if kind.is_recorded() || kind.is_scene() || is_config(path) {
        return Ok(kind);
    }
    Err(Error::input(path, kind.text_instead_of(Wanted::Shown)))
}

/// The most comments of a cloud's header that are shown. A header of ours has one for each instance.
const MOST_COMMENTS: usize = 24;

/// The first characters of a text of a header, which may list the names of many instances. `--json` has all of it.
fn shortened(text: &str) -> String {
    const LONGEST: usize = 400;
    match text.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

/// A name without the quotes that messages put around it.
fn plain(name: &str) -> String {
    quoted(name).trim_matches('`').to_owned()
}

/// A part of a range image.
#[derive(Serialize)]
struct PartFacts {
    name: String,
    rows: usize,
    columns: usize,
    /// Pixels with a finite `range`; of an image without that channel, with a finite `Z`, or else `Y`. `None` without all
    /// three.
    returns: Option<usize>,
    channels: Vec<ChannelFacts>,
    attributes: BTreeMap<String, String>,
}

#[derive(Serialize)]
struct ChannelFacts {
    name: String,
    kind: &'static str,
    /// The least value of the pixels that have a return, or of all pixels if the image doesn't say which have.
    min: Option<f64>,
    /// The largest value of the same pixels.
    max: Option<f64>,
    /// Pixels whose value is finite.
    finite: usize,
}

impl PartFacts {
    fn of(part: &Part) -> Self {
        let returned = part.image.mask();
        let pixels = part.image.rows * part.image.columns;
        let channels = part.image.channels.iter().map(|channel| {
            let value = |pixel: usize| match &channel.samples {
                Samples::F32(values) => f64::from(values[pixel]),
                Samples::U32(values) => f64::from(values[pixel]),
            };
            let kind = match channel.samples {
                Samples::F32(_) => "float",
                Samples::U32(_) => "uint",
            };
            let of_returns = (0..pixels).filter(|&pixel| returned[pixel]).map(value);
            let (min, max) = bounds(of_returns);
            let finite = (0..pixels).filter(|&pixel| value(pixel).is_finite()).count();
            ChannelFacts { name: channel.name.clone(), kind, min, max, finite }
        });
        Self {
            name: part.name.clone(),
            rows: part.image.rows,
            columns: part.image.columns,
            returns: part.image.main_depth().map(|_| returned.iter().filter(|returned| **returned).count()),
            channels: channels.collect(),
            attributes: part.attributes.clone(),
        }
    }

    fn to_text(&self) -> String {
        let mut text = String::new();
        let name =
            if self.name.is_empty() { String::new() } else { format!("part {}: ", on_one_line(&self.name)) };
        let pixels = self.rows * self.columns;
        let _ = write!(text, "  {name}{} rows × {} columns", self.rows, self.columns);
        if let Some(returns) = self.returns {
            let _ = write!(text, ", {returns} returns ({})", share(returns, pixels));
        }
        text.push('\n');
        for c in &self.channels {
            let _ = write!(text, "    {:<14}{:<6}", on_one_line(&c.name), c.kind);
            let _ = write!(text, "{}", span(c.min, c.max));
            // The range of a miss is infinite. Other values that are not finite are worth a word.
            if self.returns.is_none_or(|returns| c.finite < returns) && c.finite < pixels {
                let _ = write!(text, ", {} finite", share(c.finite, pixels));
            }
            text.push('\n');
        }
        for (name, value) in &self.attributes {
            let _ = writeln!(text, "    {} = {}", on_one_line(name), on_one_line(&shortened(value)));
        }
        text
    }
}

#[derive(Serialize)]
struct CloudFacts {
    points: usize,
    fields: Vec<FieldFacts>,
    /// The least and the largest x, y and z, if the cloud has them and any points.
    extent: Option<[[f64; 2]; 3]>,
    comments: Vec<String>,
}

#[derive(Serialize)]
struct FieldFacts {
    name: String,
    kind: &'static str,
    min: Option<f64>,
    max: Option<f64>,
}

impl CloudFacts {
    fn of(cloud: &Cloud) -> Self {
        let fields = cloud.fields.iter().map(|field| {
            let (min, max) = bounds(field.values.iter().copied());
            FieldFacts { name: field.name.clone(), kind: field.kind, min, max }
        });
        let axis = |name: &str| {
            let (min, max) = bounds(cloud.field(name)?.iter().copied());
            Some([min?, max?])
        };
        let extent = match (axis("x"), axis("y"), axis("z")) {
            (Some(x), Some(y), Some(z)) => Some([x, y, z]),
            _ => None,
        };
        Self { points: cloud.points, fields: fields.collect(), extent, comments: cloud.comments.clone() }
    }

    fn to_text(&self) -> String {
        let mut text = format!("  {} points\n", self.points);
        if let Some([x, y, z]) = self.extent {
            let [x, y, z] = [x, y, z].map(|[low, high]| span(Some(low), Some(high)));
            let _ = writeln!(text, "    extent        x {x}, y {y}, z {z}");
        }
        // A LAS of others has long names.
        let longest = self.fields.iter().map(|f| f.name.chars().count() + 1).max().unwrap_or(0);
        let width = longest.clamp(14, 33);
        for f in &self.fields {
            let _ = writeln!(text, "    {:<width$}{:<7}{}", on_one_line(&f.name), f.kind, span(f.min, f.max));
        }
        // Instances may be many, and would leave no room for the rest.
        let mut comments: Vec<&String> = self.comments.iter().collect();
        comments.sort_by_key(|comment| comment.starts_with("instance "));
        for comment in comments.into_iter().take(MOST_COMMENTS) {
            let _ = writeln!(text, "    {}", on_one_line(&shortened(comment)));
        }
        if self.comments.len() > MOST_COMMENTS {
            let _ = writeln!(text, "    and {} more comments", self.comments.len() - MOST_COMMENTS);
        }
        text
    }
}

/// The content of a scan's manifest.
fn folder_facts(name: &str, folder: &Folder) -> (Value, String) {
    let RecordedManifest { tool, seed, job, inputs, scene, outputs } = &folder.manifest;
    let sensors: Vec<&str> =
        job.sensor.iter().map(|sensor| sensor.name.as_deref().unwrap_or("sensor")).collect();
    let instances = scene.instances().count();
    let mut frames: BTreeMap<&str, BTreeSet<u64>> = BTreeMap::new();
    let keys: Vec<FrameKey> =
        outputs.iter().filter_map(|file| FrameKey::of_file(&file.path)).map(|(key, _)| key).collect();
    for key in &keys {
        if let Some(frame) = key.frame() {
            frames.entry(key.sensor()).or_default().insert(frame);
        }
    }
    let bytes = outputs.iter().filter_map(|file| file.bytes).fold(0, u64::saturating_add);
    let json = json!({
        "path": name,
        "kind": "scan",
        "tool": tool,
        "seed": seed,
        "scene": job.scene,
        "triangles": scene.triangles,
        "instances": instances,
        "materials": scene.materials(),
        "sensors": sensors,
        "frames": frames.iter().map(|(sensor, frames)| (*sensor, frames.len())).collect::<BTreeMap<_, _>>(),
        "bytes": bytes,
        "inputs": inputs,
        "outputs": outputs,
    });
    let say = |text: &Option<String>| text.as_deref().map_or_else(|| "?".to_owned(), on_one_line);
    let count = |number: &Option<u64>| number.map_or_else(|| "?".to_owned(), |number| number.to_string());
    let mut text = String::new();
    let _ =
        writeln!(text, "    made by       {} {}, seed {}", say(&tool.name), say(&tool.version), count(seed));
    let _ = writeln!(
        text,
        "    scene         {}, {} triangles, {instances} instances, {} materials",
        say(&job.scene),
        count(&scene.triangles),
        scene.materials()
    );
    let _ = writeln!(text, "    sensors       {}", on_one_line(&sensors.join(", ")));
    if frames.values().any(|frames| frames.len() > 1) {
        for (sensor, frames) in &frames {
            let (first, last) = (frames.first().copied().unwrap_or(0), frames.last().copied().unwrap_or(0));
            let missing = (last - first).saturating_add(1).saturating_sub(frames.len() as u64);
            let gaps = if missing > 0 { format!(", {missing} between them missing") } else { String::new() };
            let count = frames.len();
            let _ =
                writeln!(text, "    frames        {}: {count}, {first} to {last}{gaps}", on_one_line(sensor));
        }
    }
    let _ = writeln!(text, "    outputs       {} files, {}", outputs.len(), Bytes(bytes));
    let more = outputs.len().saturating_sub(MOST_OUTPUTS);
    let inputs = inputs.iter().map(|file| ("input", &file.name, file.bytes, &file.blake3));
    let outputs =
        outputs.iter().take(MOST_OUTPUTS).map(|file| ("output", &file.path, file.bytes, &file.blake3));
    for (label, name, bytes, hash) in inputs.chain(outputs) {
        let (name, bytes) = (on_one_line(name), Bytes(bytes.unwrap_or(0)));
        let hash: String = say(hash).chars().take(16).collect();
        let _ = writeln!(text, "    {label:<14}{name} ({bytes}, BLAKE3 {hash}…)");
    }
    if more > 0 {
        let _ = writeln!(text, "    and {more} more outputs, which --json lists");
    }
    (json, text)
}

/// The most outputs of a folder that are listed in words.
const MOST_OUTPUTS: usize = 40;

/// The least and the largest of the values that are finite.
fn bounds(values: impl Iterator<Item = f64>) -> (Option<f64>, Option<f64>) {
    let mut found: Option<(f64, f64)> = None;
    for value in values.filter(|value| value.is_finite()) {
        found = Some(found.map_or((value, value), |(low, high)| (low.min(value), high.max(value))));
    }
    (found.map(|(low, _)| low), found.map(|(_, high)| high))
}

fn span(min: Option<f64>, max: Option<f64>) -> String {
    // Measurements have 32 bits, so that the digits of an f32 say all. Ids and nanoseconds are whole.
    let digits = |x: f64| if x.fract() == 0.0 { x.to_string() } else { (x as f32).to_string() };
    match (min, max) {
        (Some(min), Some(max)) => format!("{} to {}", digits(min), digits(max)),
        _ => "no finite value".to_owned(),
    }
}

fn share(part: usize, whole: usize) -> String {
    if whole == 0 { "of none".to_owned() } else { format!("{:.1} %", 100.0 * part as f64 / whole as f64) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::{Channel, Image};

    fn part(channels: Vec<(&str, Samples)>) -> Part {
        let channels =
            channels.into_iter().map(|(name, samples)| Channel { name: name.into(), samples }).collect();
        Part { name: String::new(), image: Image { rows: 1, columns: 3, channels }, attributes: [].into() }
    }

    #[test]
    fn very_many_instances_do_not_hide_the_names_of_labels() {
        let instances = (1..100).map(|id| format!("instance {id} = \"leaf\""));
        let comments = instances.chain(["label 4 = [\"tree\"]".to_owned()]).collect();
        let text = CloudFacts::of(&Cloud { comments, ..Cloud::default() }).to_text();
        assert!(text.contains("    label 4 = [\"tree\"]\n    instance 1 = \"leaf\"\n"), "{text}");
        assert!(text.ends_with("    and 76 more comments\n"), "{text}");
    }

    #[test]
    fn misses_count_in_no_channel() {
        let image = part(vec![
            ("id.semantic", Samples::U32(vec![4, 0, 7])),
            ("range", Samples::F32(vec![2.5, f32::INFINITY, 10.0])),
        ]);
        let facts = PartFacts::of(&image);
        assert_eq!(facts.returns, Some(2));
        assert_eq!((facts.channels[0].min, facts.channels[0].max), (Some(4.0), Some(7.0)));
        let text = facts.to_text();
        assert!(text.contains("1 rows × 3 columns, 2 returns (66.7 %)\n"), "{text}");
        assert!(text.contains("range         float 2.5 to 10\n"), "{text}");
    }

    #[test]
    fn an_image_without_a_range_is_counted_whole() {
        let facts = PartFacts::of(&part(vec![("R", Samples::F32(vec![f32::NAN, 1.0, 0.5]))]));
        assert_eq!((facts.returns, facts.channels[0].finite), (None, 2));
        assert!(
            facts.to_text().contains("R             float 0.5 to 1, 66.7 % finite\n"),
            "{}",
            facts.to_text()
        );
    }

    #[test]
    fn an_empty_cloud_has_no_extent() {
        let facts = CloudFacts::of(&Cloud::default());
        assert_eq!((facts.points, facts.extent), (0, None));
        assert_eq!(facts.to_text(), "  0 points\n");
    }
}
