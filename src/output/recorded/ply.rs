//! Reading of PLY point clouds: binary of either byte order, and text.

use super::cloud::{Cloud, Column, check_size, read_records, read_words};
use super::error::ReadError;
use super::number::Number;

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
    let (mut cloud, mut columns, mut stride) = (Cloud::default(), Vec::new(), 0);
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
            Some("property") if in_vertices == Some(true) => {
                let column = property(words, stride)?;
                stride += column.number.size();
                columns.push(column);
            }
            _ => {}
        }
    }
    let encoding = encoding.ok_or_else(|| ReadError::new("its header has no format"))?;
    if columns.is_empty() {
        return Err(ReadError::new("it has no vertices"));
    }
    // Each point takes a byte of the file at least, so that a claim can't be out of proportion.
    check_size(cloud.points.min(body.len()), &columns, memory)?;
    columns.iter_mut().for_each(|column| column.is_big_endian = encoding == Encoding::BigEndian);
    cloud.fields = match encoding {
        Encoding::Text => read_words(body, cloud.points, &columns)?,
        _ => read_records(body, cloud.points, stride, &columns)?,
    };
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

fn property<'a>(mut words: impl Iterator<Item = &'a str>, offset: usize) -> Result<Column, ReadError> {
    let (kind, name) = (words.next().unwrap_or(""), words.next().unwrap_or(""));
    match Number::of_ply(kind) {
        Some(number) => Ok(Column { name: Some(name.to_owned()), number, offset, is_big_endian: false }),
        None => Err(ReadError::new(format!("a vertex has a property of type {kind:?}, which is no number"))),
    }
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
