//! Texts without a signature: told by the words that their lines begin with.

use super::json::CAMERA;
use super::kind::FileKind::{
    self, Calibration, Cloud, ForeignConfig, Job, Keys, Mesh, Other, Pcd, Text, Toml, Wrapped, Xml,
};
use super::kind::Unit;

/// The text of a file's beginning, without a byte order mark and the space before the first word. `None` if it is no UTF-8,
/// but for a character that is cut at the end.
pub(super) fn readable(head: &[u8]) -> Option<&str> {
    let text = match std::str::from_utf8(head) {
        Ok(text) => text,
        Err(error) if error.error_len().is_none() => {
            std::str::from_utf8(&head[..error.valid_up_to()]).ok()?
        }
        Err(_) => return None,
    };
    // No text has a NUL, apart from padding at its end.
    let text = text.trim_end_matches('\0');
    (!text.contains('\0')).then(|| text.trim_start_matches('\u{feff}').trim_ascii_start())
}

/// Most lines that are looked at.
const MOST_LINES: usize = 400;

/// The kind of a text that is not JSON.
pub(super) fn kind_of(text: &str) -> FileKind {
    if text.starts_with('<') {
        return kind_of_markup(text);
    }
    if is_path(text) {
        return Wrapped(
            "the text of a link",
            "a link was checked out or copied as a text that names a file: copy the file itself, or let git make links \
             (`git config core.symlinks true`, then check out again)",
        );
    }
    let lines = || text.lines().take(MOST_LINES).map(str::trim).filter(|line| !line.is_empty());
    let begins = |words: &[&str]| lines().any(|line| words.contains(&first_word(line)));
    let numbers = |line: &str| line.split([' ', '\t', ';']).filter(|cell| !cell.is_empty()).all(is_number);
    let is_cloud = |line: &str| numbers(line) && line.split_whitespace().count() >= 3;
    match () {
        () if text.starts_with("solid") && begins(&["facet"]) => Mesh("an STL mesh", STL),
        () if is_obj(lines()) => {
            Mesh("a Wavefront OBJ mesh", "`obj2gltf -i FILE -o scene.glb`, or Blender, makes glTF of it")
        }
        () if ["OFF", "COFF", "NOFF"].contains(&text.lines().next().unwrap_or_default().trim()) => {
            Mesh("an OFF mesh", STL)
        }
        () if text.starts_with("0\nSECTION") || text.starts_with("0\r\nSECTION") => {
            Mesh("a DXF drawing", BLENDER)
        }
        () if begins(&["FIELDS"]) && begins(&["POINTS"]) => Pcd,
        () if lines().filter(|line| !line.starts_with(['#', '/'])).take(20).all(is_cloud)
            && lines().any(is_cloud) =>
        {
            Cloud("a table of numbers, perhaps a cloud (xyz, pts)")
        }
        () => kind_of_keys(text),
    }
}

/// Whether all of a text is a relative path with a folder, as git writes links where the system has none.
fn is_path(text: &str) -> bool {
    const LONGEST: usize = 1024;
    let is_part = |part: &str| !part.is_empty() && !part.contains(char::is_whitespace);
    text.len() <= LONGEST
        && !text.contains([':', '=', ',', ';', '"', '#', '{', '['])
        && text.contains('/')
        && text.split('/').all(is_part)
        && text.rsplit('/').next().is_some_and(|name| name.contains('.') && !is_number(name))
}

const STL: &str = "Blender, or `assimp export FILE scene.glb`, makes glTF of it";
const BLENDER: &str = "Blender imports it and exports glTF (File > Export > glTF 2.0)";

fn first_word(line: &str) -> &str {
    line.split_ascii_whitespace().next().unwrap_or_default()
}

fn is_number(text: &str) -> bool {
    text.parse::<f64>().is_ok()
}

/// Whether every line begins with one of OBJ's words, and some with vertices.
fn is_obj<'a>(lines: impl Iterator<Item = &'a str>) -> bool {
    const WORDS: &[&str] = &[
        "mtllib",
        "usemtl",
        "o",
        "g",
        "s",
        "v",
        "vt",
        "vn",
        "vp",
        "f",
        "l",
        "p",
        "mg",
        "cstype",
        "deg",
        "surf",
        "curv",
        "parm",
        "end",
        "shadow_obj",
        "trace_obj",
        "lod",
        "d_interp",
        "c_interp",
        "bevel",
    ];
    let mut has_vertices = false;
    for line in lines.filter(|line| !line.starts_with('#')) {
        let word = first_word(line);
        let numbers = line[word.len()..].split_ascii_whitespace();
        // A line that is cut short, or goes on behind a backslash, is of numbers and indices.
        if !WORDS.contains(&word) && !word.starts_with(|c: char| c.is_ascii_digit() || c == '-') {
            return false;
        }
        has_vertices |=
            word == "v" && numbers.take_while(|cell| is_number(cell)).count() >= 2 || word == "mtllib";
    }
    has_vertices
}

/// XML and HTML by the outermost element.
fn kind_of_markup(text: &str) -> FileKind {
    let mut rest = text;
    let root = loop {
        let Some(at) = rest.find('<') else { return Text };
        rest = &rest[at + 1..];
        // Comments, declarations and processing instructions come before the root.
        if let Some(comment) = rest.strip_prefix("!--") {
            rest = comment.split_once("-->").map_or("", |(_, after)| after);
        } else if rest.get(..8).is_some_and(|word| word.eq_ignore_ascii_case("!doctype")) {
            let name = first_word(&rest[8..]);
            if name.trim_end_matches('>').eq_ignore_ascii_case("html") {
                break "html";
            }
        } else if !rest.starts_with(['?', '!']) {
            break rest
                .split(|c: char| c.is_whitespace() || matches!(c, '>' | '/'))
                .next()
                .unwrap_or_default();
        }
    };
    let local = root.rsplit(':').next().unwrap_or_default();
    match local.to_ascii_lowercase().as_str() {
        "html" | "head" | "body" => Wrapped(
            "a web page (HTML)",
            "the download gave a page instead of the file: download the file itself, such as GitHub's raw address",
        ),
        "collada" => {
            Mesh("a COLLADA scene", "Blender, or `COLLADA2GLTF-bin FILE scene.glb`, makes glTF of it")
        }
        "x3d" => Mesh("an X3D scene", BLENDER),
        "kml" => Other("a KML file"),
        "svg" => Other("an SVG drawing"),
        "robot" => Other("a robot's description (URDF)"),
        "sdf" => Other("a world of Gazebo (SDF)"),
        "mujoco" => Other("a model of MuJoCo"),
        "citymodel" => Mesh("a CityGML model", "FME or 3dcitydb's exporter makes glTF of it"),
        _ => Xml(local.chars().take(40).collect()),
    }
}

/// TOML, YAML and tables, by the majority of their lines.
fn kind_of_keys(text: &str) -> FileKind {
    let lines = text.lines().take(MOST_LINES);
    let significant = lines.filter(|line| !line.trim().is_empty() && !line.trim_start().starts_with('#'));
    let (mut toml, mut yaml, mut keys) = (0, 0, Vec::new());
    for line in significant.clone() {
        match () {
            () if is_toml(line.trim()) => toml += 1,
            () if line.starts_with("%YAML") || line.trim() == "---" => yaml += 1,
            () => {
                let Some(key) = yaml_key(line) else { continue };
                yaml += 1;
                if !line.starts_with([' ', '\t', '-']) {
                    keys.push(key);
                }
            }
        }
    }
    let has = |words: &[&str]| keys.iter().any(|key| words.contains(key));
    if toml > yaml {
        let is_of_job = |line: &str| {
            let line = line.trim();
            let key = line.split('=').next().unwrap_or_default().trim();
            line.starts_with("[[sensor")
                || line.starts_with("[output")
                || matches!(key, "scene" | "output.dir")
        };
        return if significant.clone().any(is_of_job) { Job } else { Toml };
    }
    if yaml == 0 {
        return Text;
    }
    match () {
        () if has(&["lasers"]) => Calibration(Unit::Velodyne),
        () if has(CAMERA) || has(&["cam0", "camera_name", "image_width"]) => Calibration(Unit::Camera),
        () if has(&["outs"]) && text.contains("md5:") => {
            Wrapped("a DVC pointer", "`dvc pull` fetches the file that it stands for")
        }
        () if has(&["scene", "sensor", "sensors", "preset"]) || has(&["rotating", "pinhole", "fisheye"]) => {
            ForeignConfig("YAML")
        }
        () if keys.is_empty() => Text,
        () => Keys("YAML", keys.into_iter().map(str::to_owned).collect()),
    }
}

/// Whether a line is one of TOML: a header, or a key with a value.
fn is_toml(line: &str) -> bool {
    let is_key = |c: char| c.is_alphanumeric() || matches!(c, '_' | '-' | '.' | '"' | '\'' | ' ');
    if let Some(header) = line.strip_prefix('[') {
        let header = header.trim_start_matches('[');
        return header.find(']').is_some_and(|end| header[..end].starts_with(char::is_alphanumeric));
    }
    line.split_once('=').is_some_and(|(key, _)| !key.trim().is_empty() && key.chars().all(is_key))
}

/// The key of a line of YAML: `key:` alone, or `key: value`.
fn yaml_key(line: &str) -> Option<&str> {
    let line = line.trim().trim_start_matches("- ");
    let (key, value) = line.split_once(':')?;
    let is_key = |c: char| c.is_alphanumeric() || matches!(c, '_' | '-' | '.' | '/' | '"' | '\'');
    let is_value = value.is_empty() || value.starts_with([' ', '\t']);
    (is_value && !key.is_empty() && key.chars().all(is_key)).then(|| key.trim_matches(['"', '\'']))
}
