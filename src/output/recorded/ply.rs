//! Reading of PLY point clouds: binary of either byte order, and text.

use std::collections::BTreeMap;

use serde::de::DeserializeOwned;

use super::error::ReadError;
use super::instances::InstanceNames;
use crate::output::names::words_of_labels;

/// A point cloud.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cloud {
    /// The number of points.
    pub points: usize,
    /// The fields, in the order of the file.
    pub fields: Vec<Field>,
    /// The header's comments, such as `frame: the world, metres`.
    pub comments: Vec<String>,
}

/// A field, which holds one number for each point.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// The name, such as `x` or `label`.
    pub name: String,
    /// The type in PLY's terms: `float`, `int`, ….
    pub kind: &'static str,
    /// The values, [`Cloud::points`] long. An f64 holds every number of PLY's types exactly.
    pub values: Vec<f64>,
}

impl Cloud {
    /// Bytes of memory that the values take.
    pub fn memory(&self) -> u64 {
        (self.points * self.fields.len() * size_of::<f64>()) as u64
    }

    /// The values of a field.
    pub fn field(&self, name: &str) -> Option<&[f64]> {
        self.fields.iter().find(|f| f.name == name).map(|f| f.values.as_slice())
    }
}

impl Cloud {
    /// The names of the instances that the header lists.
    pub fn instances(&self) -> InstanceNames {
        self.listed::<String>("instance ").collect()
    }

    /// The meaning of the labels, in words, if the header tells.
    pub fn labels(&self) -> BTreeMap<u32, String> {
        words_of_labels(&self.listed("label ").collect::<Vec<_>>())
    }

    /// The numbers of a kind that comments name, such as `instance 4 = "floor"`.
    fn listed<T: DeserializeOwned>(&self, kind: &str) -> impl Iterator<Item = (u32, T)> {
        self.comments.iter().filter_map(move |comment| {
            let (number, named) = comment.strip_prefix(kind)?.split_once(" = ")?;
            Some((number.parse().ok()?, serde_json::from_str(named).ok()?))
        })
    }
}

/// The scalar types: the name, its older or newer synonym, and the length in bytes.
const KINDS: [(&str, &str, usize); 8] = [
    ("char", "int8", 1),
    ("uchar", "uint8", 1),
    ("short", "int16", 2),
    ("ushort", "uint16", 2),
    ("int", "int32", 4),
    ("uint", "uint32", 4),
    ("float", "float32", 4),
    ("double", "float64", 8),
];

const MAX_FIELDS: usize = 256;

#[derive(Clone, Copy, PartialEq, Eq)]
enum Encoding {
    Text,
    LittleEndian,
    BigEndian,
}

/// Reads the vertices of a PLY. Other elements are skipped.
///
/// # Errors
/// A [`ReadError`] if the bytes are no PLY, are cut short, have list properties in the vertices, or have more points than fit
/// into `memory` bytes.
pub fn read_ply(bytes: &[u8], memory: u64) -> Result<Cloud, ReadError> {
    let (header, body) = split_header(bytes)?;
    let mut lines = header.lines().map(str::trim_end);
    if lines.next() != Some("ply") {
        return Err(ReadError::new("this is no PLY"));
    }
    let mut encoding = None;
    let mut cloud = Cloud::default();
    // This tells whether the current element is the vertices. Only elements before the vertices would have to be skipped.
    let mut in_vertices = None;
    for line in lines {
        let mut words = line.split_ascii_whitespace();
        match words.next() {
            Some("format") => {
                encoding = match words.next() {
                    Some("ascii") => Some(Encoding::Text),
                    Some("binary_little_endian") => Some(Encoding::LittleEndian),
                    Some("binary_big_endian") => Some(Encoding::BigEndian),
                    other => {
                        return Err(ReadError::new(format!("a PLY has no format {:?}", other.unwrap_or(""))));
                    }
                };
            }
            Some("comment") => cloud.comments.push(line["comment".len()..].trim().to_owned()),
            Some("element") => {
                let name = words.next().unwrap_or("");
                let count = words.next().and_then(|n| n.parse::<usize>().ok());
                let count = count.ok_or_else(|| ReadError::new(format!("element {name:?} has no count")))?;
                if in_vertices.is_none() && name != "vertex" && count > 0 {
                    return Err(ReadError::new(format!("element {name:?} comes before the vertices")));
                }
                in_vertices = Some(name == "vertex");
                if name == "vertex" {
                    cloud.points = count;
                }
            }
            Some("property") if in_vertices == Some(true) => cloud.fields.push(property(words)?),
            _ => {}
        }
    }
    let encoding = encoding.ok_or_else(|| ReadError::new("its header has no format"))?;
    if cloud.fields.is_empty() {
        return Err(ReadError::new("it has no vertices"));
    }
    if cloud.fields.len() > MAX_FIELDS {
        return Err(ReadError::new(format!("it has more than {MAX_FIELDS} fields a point")));
    }
    // Each point takes a byte of the file at least, so that a claim can't be out of proportion.
    let points = cloud.points.min(body.len()) as u64;
    let needed = points.saturating_mul((cloud.fields.len() * size_of::<f64>()) as u64);
    ReadError::check_memory(needed, memory)?;
    match encoding {
        Encoding::Text => read_text(body, &mut cloud)?,
        _ => read_binary(body, &mut cloud, encoding == Encoding::BigEndian)?,
    }
    Ok(cloud)
}

/// The header as text, and the bytes that follow it.
fn split_header(bytes: &[u8]) -> Result<(&str, &[u8]), ReadError> {
    const END: &[u8] = b"end_header";
    const LONGEST: usize = 1 << 20;
    let head = &bytes[..bytes.len().min(LONGEST)];
    let mut start = 0;
    while let Some(length) = head[start..].iter().position(|&b| b == b'\n') {
        let end = start + length;
        if head[start..end].trim_ascii() == END {
            let header = std::str::from_utf8(&head[..start]);
            return match header {
                Ok(header) => Ok((header, &bytes[end + 1..])),
                Err(_) => Err(ReadError::new("its header is not text")),
            };
        }
        start = end + 1;
    }
    Err(ReadError::new("its header has no end"))
}

fn property<'a>(mut words: impl Iterator<Item = &'a str>) -> Result<Field, ReadError> {
    let (kind, name) = (words.next().unwrap_or(""), words.next().unwrap_or(""));
    let known = KINDS.iter().find(|(old, new, _)| *old == kind || *new == kind);
    match known {
        Some((kind, ..)) => Ok(Field { name: name.to_owned(), kind, values: Vec::new() }),
        None => Err(ReadError::new(format!("a vertex has a property of type {kind:?}, which is no number"))),
    }
}

fn read_binary(body: &[u8], cloud: &mut Cloud, big_endian: bool) -> Result<(), ReadError> {
    let length = |kind: &str| KINDS.iter().find(|k| k.0 == kind).map_or(0, |k| k.2);
    let stride: usize = cloud.fields.iter().map(|f| length(f.kind)).sum();
    let needed = cloud.points.checked_mul(stride).filter(|&needed| needed <= body.len());
    let needed = needed.ok_or_else(|| cut_short(cloud.points))?;
    let mut offset = 0;
    for field in &mut cloud.fields {
        let size = length(field.kind);
        let at = |point: &[u8]| number(&point[offset..offset + size], field.kind, big_endian);
        field.values = body[..needed].chunks_exact(stride).map(at).collect();
        offset += size;
    }
    Ok(())
}

/// The number that the bytes of a type represent.
fn number(bytes: &[u8], kind: &str, big_endian: bool) -> f64 {
    let mut le = [0; 8];
    le[..bytes.len()].copy_from_slice(bytes);
    if big_endian {
        le[..bytes.len()].reverse();
    }
    let [a, b, c, d, ..] = le;
    match kind {
        "char" => f64::from(a as i8),
        "uchar" => f64::from(a),
        "short" => f64::from(i16::from_le_bytes([a, b])),
        "ushort" => f64::from(u16::from_le_bytes([a, b])),
        "int" => f64::from(i32::from_le_bytes([a, b, c, d])),
        "uint" => f64::from(u32::from_le_bytes([a, b, c, d])),
        "float" => f64::from(f32::from_le_bytes([a, b, c, d])),
        _ => f64::from_le_bytes(le),
    }
}

fn read_text(body: &[u8], cloud: &mut Cloud) -> Result<(), ReadError> {
    let text = std::str::from_utf8(body).map_err(|_| ReadError::new("its points are not text"))?;
    let mut words = text.split_ascii_whitespace();
    for point in 0..cloud.points {
        for field in &mut cloud.fields {
            let word = words.next().ok_or_else(|| cut_short(cloud.points))?;
            let value: f64 = word
                .parse()
                .map_err(|_| ReadError::new(format!("point {point} has {word:?} for {:?}", field.name)))?;
            // A number in a text may have more digits than its type.
            field.values.push(if field.kind == "float" { f64::from(value as f32) } else { value });
        }
    }
    Ok(())
}

fn cut_short(points: usize) -> ReadError {
    ReadError::new(format!("it is cut short: its header promises {points} points"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const HEADER: &str = "comment frame: the world\nelement vertex 2\nproperty float x\nproperty int label\n\
                          element face 0\nproperty list uchar int vertex_indices\nend_header\n";

    fn little_endian() -> Vec<u8> {
        let mut bytes = format!("ply\nformat binary_little_endian 1.0\n{HEADER}").into_bytes();
        for (x, label) in [(0.1_f32, -3_i32), (2.0, 7)] {
            bytes.extend(x.to_le_bytes());
            bytes.extend(label.to_le_bytes());
        }
        bytes
    }

    #[test]
    fn every_encoding_says_the_same() {
        let mut big = format!("ply\nformat binary_big_endian 1.0\n{HEADER}").into_bytes();
        for (x, label) in [(0.1_f32, -3_i32), (2.0, 7)] {
            big.extend(x.to_be_bytes());
            big.extend(label.to_be_bytes());
        }
        let text = format!("ply\nformat ascii 1.0\n{HEADER}0.1 -3\n2.0 7\n");
        for bytes in [little_endian(), big, text.replace('\n', "\r\n").into_bytes()] {
            let cloud = read_ply(&bytes, u64::MAX).unwrap();
            assert_eq!(cloud.points, 2);
            assert_eq!(cloud.field("x").unwrap(), [f64::from(0.1_f32), 2.0]);
            assert_eq!(cloud.field("label").unwrap(), [-3.0, 7.0]);
            assert_eq!(cloud.comments, ["frame: the world"]);
        }
    }

    #[test]
    fn errors_name_the_problem() {
        let of = |bytes: &[u8]| read_ply(bytes, u64::MAX).unwrap_err().to_string();
        let whole = little_endian();
        assert_eq!(of(&whole[..whole.len() - 1]), "it is cut short: its header promises 2 points");
        let replaced = |from: &str, to: &str| {
            let text = String::from_utf8_lossy(&whole[..whole.len() - 16]).replace(from, to);
            of(&[text.as_bytes(), &whole[whole.len() - 16..]].concat())
        };
        assert!(replaced("vertex 2", "vertex 18446744073709551615").contains("cut short"));
        assert!(replaced("property int", "property list").contains("\"list\""));
        assert!(replaced("end_header", "end").contains("no end"));
        assert!(replaced("binary_little", "binary_odd").contains("odd"));
    }

    proptest! {
        #[test]
        fn broken_bytes_are_an_error_or_a_cloud(at in 0.0..1.0, value: u8, keep in 0.0..2.0) {
            let mut bytes = little_endian();
            let at = (at * bytes.len() as f64) as usize;
            bytes[at] = value;
            bytes.truncate((keep * bytes.len() as f64) as usize);
            if let Ok(cloud) = read_ply(&bytes, u64::MAX) {
                prop_assert!(cloud.fields.iter().all(|f| f.values.len() == cloud.points));
            }
        }
    }
}
