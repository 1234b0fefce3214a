//! JSON by its outermost keys. Nothing is parsed: the text may be hostile, large, or cut short.

use super::kind::FileKind::{
    self, Baseline, Calibration, ForeignConfig, Gltf, Gltf1, Keys, Manifest, Other, Wrapped,
};
use super::kind::Unit;

/// The members of a JSON object, in order: each key with the text from its value on.
struct Members<'a> {
    rest: &'a str,
}

impl<'a> Members<'a> {
    /// The members of the object that a text begins with; none if it begins with something else.
    fn of(text: &'a str) -> Self {
        Self { rest: text.trim_ascii_start().strip_prefix('{').unwrap_or_default() }
    }
}

impl<'a> Iterator for Members<'a> {
    type Item = (&'a str, &'a str);

    fn next(&mut self) -> Option<(&'a str, &'a str)> {
        let text = self.rest.trim_ascii_start();
        let text = text.strip_prefix(',').unwrap_or(text).trim_ascii_start();
        let end = end_of_string(text)?;
        let (key, text) = (&text[1..end - 1], text[end..].trim_ascii_start());
        let value = text.strip_prefix(':')?.trim_ascii_start();
        self.rest = &value[end_of_value(value)..];
        Some((key, value))
    }
}

/// The end of the string that a text begins with. `None` if it begins with none, or with one that does not end.
fn end_of_string(text: &str) -> Option<usize> {
    let mut bytes = text.bytes().enumerate();
    if bytes.next()?.1 != b'"' {
        return None;
    }
    while let Some((at, byte)) = bytes.next() {
        match byte {
            b'\\' => drop(bytes.next()),
            b'"' => return Some(at + 1),
            _ => {}
        }
    }
    None
}

/// The end of the value that a text begins with, or of the text.
fn end_of_value(text: &str) -> usize {
    let (mut depth, mut at) = (0_usize, 0);
    let bytes = text.as_bytes();
    while at < bytes.len() {
        match bytes[at] {
            b'"' => {
                at += end_of_string(&text[at..]).unwrap_or(text.len() - at);
                if depth == 0 {
                    return at;
                }
                continue;
            }
            b'{' | b'[' => depth += 1,
            b'}' | b']' | b',' if depth == 0 => return at,
            b'}' | b']' => {
                depth -= 1;
                if depth == 0 {
                    return at + 1;
                }
            }
            _ => {}
        }
        at += 1;
    }
    bytes.len()
}

/// Most keys that are looked at: what is recognised has fewer.
const MOST_KEYS: usize = 1000;

/// The kind of a JSON text that begins with an object.
pub(super) fn kind_of(text: &str) -> FileKind {
    let members: Vec<(&str, &str)> = Members::of(text).take(MOST_KEYS).collect();
    let value = |key: &str| members.iter().find(|(known, _)| *known == key).map(|(_, value)| *value);
    let has = |key: &str| value(key).is_some();
    let is_object = |key: &str| value(key).is_some_and(|value| value.starts_with('{'));
    let says = |key: &str, word: &str| {
        value(key).is_some_and(|value| value.strip_prefix('"').is_some_and(|text| text.starts_with(word)))
    };
    let version = value("asset").and_then(|asset| Members::of(asset).find(|(key, _)| *key == "version"));
    let is_version_1 =
        version.is_some_and(|(_, version)| version.starts_with("\"1") || version.starts_with('1'));
    let keyed_by_name = ["meshes", "nodes", "scenes", "accessors", "buffers", "bufferViews", "materials"];
    let keys = || members.iter().map(|(key, _)| (*key).to_owned()).collect();
    match () {
        () if has("root") && (has("geometricError") || has("asset")) => Wrapped(
            "a tileset of 3D Tiles",
            "it only names its tiles: take the glTF of one; `3d-tiles-tools b3dmToGlb` takes it out of a .b3dm",
        ),
        // glTF 1.0 keys its lists by name, and may leave the asset out.
        () if keyed_by_name.iter().any(|key| is_object(key))
            && !has("scene_path")
            && (has("asset") || has("accessors") || has("bufferViews")) =>
        {
            Gltf1
        }
        () if is_object("asset") && is_version_1 => Gltf1,
        () if is_object("asset") || has("accessors") || (has("nodes") && has("scenes")) => Gltf,
        () if OUSTER.iter().any(|key| has(key)) => Calibration(Unit::Ouster),
        () if CAMERA.iter().any(|key| has(key)) || (has("fx") && has("fy")) => Calibration(Unit::Camera),
        () if has("tool") && has("outputs") => Manifest,
        () if has("tool") && has("format") && has("job") => Baseline,
        () if has("sensor") && (has("scene") || has("output")) => ForeignConfig("JSON"),
        () if says("type", "CityJSON") => Other("CityJSON"),
        () if says("type", "Feature") || says("type", "Geometry") => Other("GeoJSON"),
        () if has("$schema") && (has("properties") || has("definitions") || has("$defs")) => {
            Other("a JSON Schema")
        }
        () if has("name")
            && has("version")
            && ["dependencies", "devDependencies", "scripts", "main"].iter().any(|key| has(key)) =>
        {
            Other("the description of an npm package")
        }
        () => Keys("JSON", keys()),
    }
}

/// Keys that Ouster's metadata has, flat or nested, and nothing else.
const OUSTER: &[&str] = &[
    "beam_altitude_angles",
    "beam_azimuth_angles",
    "beam_intrinsics",
    "beam_to_lidar_transform",
    "lidar_data_format",
    "lidar_intrinsics",
    "lidar_origin_to_beam_origin_mm",
    "sensor_info",
];

/// Keys that cameras' intrinsics have, as ROS, OpenCV, Open3D, librealsense and Azure Kinect write them.
pub(super) const CAMERA: &[&str] = &[
    "camera_matrix",
    "CameraMatrix",
    "distortion_model",
    "distortion_coefficients",
    "dist_coeffs",
    "intrinsic_matrix",
    "intrinsics",
    "K",
    "CalibrationInformation",
];
