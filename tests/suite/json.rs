//! The JSON documents that commands print: every key that one has is in docs/json.md, and every key there is in one.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use serde_json::Value;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// Runs the program, and returns what it prints.
fn stdout_of(folder: &Path, args: &[&str]) -> String {
    let mut command = super::cli::program();
    let output = command.args(args).current_dir(folder).output().unwrap();
    assert!(
        matches!(output.status.code(), Some(0..=2)),
        "{args:?}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8(output.stdout).unwrap()
}

/// A job in the room, whose sensor is at x. `kernel` names the method.
fn job(x: f64, columns: usize, kernel: &str) -> String {
    format!(
        "scene = '{ROOT}/scenes/room.glb'\n\
         [labels]\npillar = 77\n\
         [[sensor]]\nname = \"top\"\npose = {{ position_m = [{x:?}, 0.0, 1.2] }}\n\
         [sensor.rotating]\nelevations_deg = [2.0, -10.0]\ncolumns = {columns}\nrate_hz = 10.0\n\
         [sensor.range]\nmax_m = 20.0\n\
         [trace]\nkernel = {kernel:?}\n\
         [output]\ndir = \"out\"\n\
         [[expect]]\nname = \"all\"\nreturns = {{ at_least = 1.0 }}\n"
    )
}

/// A sensor file of a depth camera that finds depth in this way.
fn camera(method: &str) -> String {
    format!("{method}\n[pinhole]\nwidth_px = 8\nheight_px = 6\nhfov_deg = 60.0\n")
}

/// A scene of a triangle and a camera, with an animation and a skin. The triangle's material has holes, and a texture of 2 × 1 texels.
const TRIANGLE: &str = r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}],
    "nodes": [{"mesh": 0}, {"camera": 0}],
    "cameras": [{"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}}],
    "animations": [{"name": "walk", "channels": [{"sampler": 0, "target": {"node": 0, "path": "translation"}}],
        "samplers": [{"input": 0, "output": 0}]}],
    "skins": [{"joints": [1]}],
    "materials": [{"alphaMode": "MASK", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
    "textures": [{"source": 0}],
    "images": [{"uri": "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAIAAAABCAAAAADRSSBWAAAAC0lEQVR4nGNQaAAAAMMAoUn2EtEAAAAASUVORK5CYII="}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]}],
    "bufferViews": [{"buffer": 0, "byteLength": 36}],
    "buffers": [{"byteLength": 36, "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]}"#;

/// The documents of each command, under the headings of docs/json.md: as many as it takes to see every key.
fn documents(folder: &Path) -> BTreeMap<&'static str, Vec<Value>> {
    for (name, text) in [
        ("a.toml", job(0.0, 36, "exact")),
        ("b.toml", job(0.3, 36, "exact")),
        ("d.toml", job(0.0, 18, "exact")),
        ("sequence.toml", job(0.0, 36, "exact") + "[sequence]\nframes = 2\n"),
        ("leaky.toml", job(0.0, 36, "moller-trumbore")),
        ("stereo.toml", camera("stereo = { baseline_m = 0.05 }")),
        (
            "promising.toml",
            camera("stereo = { baseline_m = 0.05 }")
                + "[nominal]\nsource = \"a data sheet\"\n[[nominal.published]]\nat_m = 1.0\nfill_rate_percent = 90.0\n",
        ),
        ("tof.toml", camera("tof = { frequencies_mhz = [20.0, 100.0], electrons_at_1_m = 1e5 }")),
        (
            "measured.toml",
            job(0.0, 36, "exact")
                + "[sensor.receiver]\nrange_pairs = [[0.8, 50.0]]\nbeams = [{ rows = [1], range_pairs = [[0.8, 40.0]] }]\n",
        ),
        (
            "counting.toml",
            job(0.0, 36, "exact")
                + "[sensor.receiver]\nrange_pairs = [[0.8, 15.0]]\ndetector = \"spad\"\nspad_cycles = 400\nspad_bin_ns = 1.0\n",
        ),
        ("wrong.toml", "scene = 3\n".to_owned()),
        ("triangle.gltf", TRIANGLE.to_owned()),
    ] {
        fs::write(folder.join(name), text).unwrap();
    }
    let json = |args: &[&str]| -> Value {
        let text = stdout_of(folder, args);
        serde_json::from_str(&text).unwrap_or_else(|e| panic!("{args:?}: {e}: {text}"))
    };
    let plan = json(&["scan", "a.toml", "--out", "a", "--dry-run", "--json"]);
    let scan = json(&["scan", "a.toml", "--out", "a", "--json"]);
    let fine = ["--set", "output.formats=[{ format = \"depth16\", scale = 1e5 }]"];
    let lossy = json(&["scan", "a.toml", "--out", "lossy", fine[0], fine[1], "--json"]);
    let lines = stdout_of(folder, &["scan", "a.toml", "--out", "lines", fine[0], fine[1], "--json-lines"]);
    let measured = json(&["scan", "measured.toml", "--out", "measured", "--json"]);
    // Where the receiver sees less, some pulses do not return.
    let dim = "--set sensor.top.receiver.range_pairs=[[0.8,3.0]] --set sensor.top.receiver.beams=[]";
    let dim: Vec<&str> = dim.split(' ').collect();
    let measured_lines =
        stdout_of(folder, &[&["scan", "measured.toml", "--out", "dim", "--json-lines"], &dim[..]].concat());
    for part in ["1/2", "2/2"] {
        stdout_of(folder, &["scan", "a.toml", "--out", "parts", "--shard", part]);
    }
    let merged = json(&["merge", "parts", "--json"]);
    fs::write(folder.join("parts/notes.txt"), "mine").unwrap();
    let verified = json(&["verify", "parts", "--json"]);
    for name in ["b", "d"] {
        stdout_of(folder, &["scan", &format!("{name}.toml"), "--out", name]);
    }
    stdout_of(folder, &["check", "--accept", "a.toml"]);
    let moved = ["--set", "sensor.top.pose.position_m=[0.3, 0.0, 1.2]"];
    let check = json(&["check", "a.toml", moved[0], moved[1], "--json", "-"]);
    let broken = json(&["check", "wrong.toml", "--json", "-"]);
    let diff =
        |file: &str, other: &str| json(&["diff", &format!("a{file}"), &format!("{other}{file}"), "--json"]);
    let mcap = "--set output.formats=[\"mcap\"]";
    let mcap: Vec<&str> = mcap.split(' ').collect();
    stdout_of(folder, &["scan", "sequence.toml", "--out", "recording", mcap[0], mcap[1]]);
    let bag = fs::read_dir(folder.join("recording/bag")).unwrap().find_map(|entry| {
        let name = entry.unwrap().file_name().into_string().unwrap();
        name.ends_with(".mcap").then(|| format!("recording/bag/{name}"))
    });
    let bag = bag.unwrap();
    let info = |path: &str| json(&["info", path, "--json"]);
    let converted = json(&["convert", "a/top/000000.ply", "a.las", "--json"]);
    BTreeMap::from([
        ("scan", vec![scan, lossy, measured]),
        ("scan --dry-run", vec![plan]),
        (
            "scan --json-lines",
            lines
                .lines()
                .chain(measured_lines.lines())
                .map(|line| serde_json::from_str(line).unwrap())
                .collect(),
        ),
        ("merge", vec![merged]),
        ("verify", vec![verified]),
        ("convert", vec![converted]),
        ("check", vec![check, broken]),
        (
            "diff",
            vec![
                diff("", "b"),
                diff("/top/000000.exr", "d"),
                diff("/top/000000.ply", "b"),
                diff("/top/000000.ply", "d"),
            ],
        ),
        (
            "explain",
            ["measured.toml", "counting.toml"]
                .map(|job| json(&["explain", job, "1", "18", "--json"]))
                .to_vec(),
        ),
        (
            "lint",
            vec![json(&[
                "lint",
                "a.toml",
                "sequence.toml",
                "measured.toml",
                "stereo.toml",
                "tof.toml",
                "counting.toml",
                "wrong.toml",
                "--json",
            ])],
        ),
        (
            "info",
            vec![
                info("a.toml"),
                info("sequence.toml"),
                info("triangle.gltf"),
                info("a"),
                info("a/top/000000.exr"),
                info("a/top/000000.ply"),
                info(&bag),
            ],
        ),
        (
            "bench",
            ["a.toml", "measured.toml"].map(|job| json(&["bench", job, "--repeat", "1", "--json"])).to_vec(),
        ),
        (
            "bench --end-to-end",
            vec![json(&[
                "bench",
                "sequence.toml",
                "--end-to-end",
                "--repeat",
                "1",
                "--scratch",
                ".",
                "--json",
            ])],
        ),
        ("presets", vec![json(&["presets", "--json"])]),
        ("selftest", vec![json(&["selftest", "leaky.toml", "--json"])]),
        (
            "selftest --datasheet",
            vec![json(&["selftest", "--datasheet", "measured.toml", "promising.toml", "--json"])],
        ),
    ])
}

/// Adds the path of every key, with `[]` behind the keys of lists.
pub(super) fn add_keys(value: &Value, path: &str, found: &mut BTreeSet<String>) {
    match value {
        Value::Object(keys) => {
            for (key, value) in keys {
                let list = if value.is_array() { "[]" } else { "" };
                let deeper =
                    if path.is_empty() { format!("{key}{list}") } else { format!("{path}.{key}{list}") };
                add_keys(value, &deeper, found);
                found.insert(deeper);
            }
        }
        Value::Array(values) => values.iter().for_each(|value| add_keys(value, path, found)),
        _ => {}
    }
}

/// The rows of each section's table: the key, and the rest.
type Sections = BTreeMap<String, Vec<(String, String)>>;

fn sections(page: &str) -> Sections {
    let mut sections = Sections::new();
    let mut heading = String::new();
    for line in page.lines() {
        if let Some(title) = line.strip_prefix("### ").or(line.strip_prefix("## ")) {
            heading = title.to_owned();
        } else if let Some(row) = line.strip_prefix("| ").filter(|row| !row.starts_with("key ")) {
            let (key, about) = row.split_once('|').unwrap();
            let key = key.trim().trim_matches('`').to_owned();
            let about = about.trim().trim_end_matches('|').trim().to_owned();
            sections.entry(heading.clone()).or_default().push((key, about));
        }
    }
    sections
}

/// The paths of a section's keys under `prefix` and of those of the sections that its rows link to, each with the section and the
/// key that it comes from.
fn documented<'s>(
    sections: &'s Sections,
    heading: &'s str,
    prefix: &str,
    found: &mut BTreeMap<String, (&'s str, &'s str)>,
) {
    for (key, about) in &sections[heading] {
        let path = match (prefix.is_empty(), key.is_empty()) {
            (_, true) => prefix.to_owned(),
            (true, _) => key.clone(),
            _ => format!("{prefix}.{key}"),
        };
        if let Some((_, link)) = about.split_once("(#") {
            let anchor = link.split(')').next().unwrap();
            let is_linked = |title: &&String| title.to_lowercase().replace(' ', "-") == anchor;
            let linked = sections.keys().find(is_linked).unwrap_or_else(|| panic!("no section #{anchor}"));
            documented(sections, linked, &path, found);
        }
        if !key.is_empty() {
            found.insert(path, (heading, key));
        }
    }
}

/// Whether a key is the documented one, whose `*` stands for any name. Of a table without names, only its own key is seen.
fn is_meant(documented: &str, key: &str) -> bool {
    match documented.strip_suffix(".*") {
        Some(table) => key.strip_prefix(table).is_some_and(|rest| rest.is_empty() || rest.starts_with('.')),
        None => key == documented,
    }
}

#[test]
fn the_page_has_every_key_and_no_other() {
    let folder = tempfile::tempdir().unwrap();
    let page = fs::read_to_string(Path::new(ROOT).join("docs/json.md")).unwrap();
    let sections = sections(&page);
    let mut wrong = Vec::new();
    // A key of a section that several others link to must be in a document of one of them.
    let (mut all, mut found) = (BTreeSet::new(), BTreeSet::new());
    for (heading, documents) in documents(folder.path()) {
        let (mut told, mut seen) = (BTreeMap::new(), BTreeSet::new());
        documented(&sections, heading, "", &mut told);
        for document in &documents {
            add_keys(document, "", &mut seen);
            let format = &sections[heading].iter().find(|(key, _)| key == "format").unwrap().1;
            assert_eq!(document["format"].to_string(), *format, "{heading}");
            let first = document.as_object().unwrap().keys().next();
            assert_eq!(first.map(String::as_str), Some("format"), "{heading}");
        }
        // A list may be null, and a value of several kinds a list.
        let bare = |path: &str| path.strip_suffix("[]").unwrap_or(path).to_owned();
        let seen: BTreeSet<String> = seen.iter().map(|path| bare(path)).collect();
        for key in &seen {
            if !told.keys().any(|known| is_meant(&bare(known), key)) {
                wrong.push(format!("{heading}: {key} is not in docs/json.md"));
            }
        }
        for (path, origin) in &told {
            all.insert(*origin);
            if seen.iter().any(|key| is_meant(&bare(path), key)) {
                found.insert(*origin);
            }
        }
    }
    wrong.extend(all.difference(&found).map(|(section, key)| format!("{section}: {key} is in no document")));
    assert!(wrong.is_empty(), "\n{}\n", wrong.join("\n"));
}
