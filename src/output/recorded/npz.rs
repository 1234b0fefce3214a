//! Reading of NumPy's NPZ as range images.

use std::collections::BTreeMap;

use serde_json::{Map, Value};

use super::error::ReadError;
use super::exr::Part;
use super::npy::{Array, Kind};
use super::number::Number;
use super::zip::members;
use crate::output::{BYTES_A_VALUE, Channel, Image, Samples};

/// Most arrays of a file.
const MAX_ARRAYS: usize = 1024;

/// The attribute that lists the arrays which are no channels.
const LEFT_OUT: &str = "npz:left_out";

/// Reads the arrays of an NPZ as the parts of a range image: an array of rows and columns is a channel, and one of rows, columns and 3
/// is three, `name.X` and so on. Arrays `return1/range` are of the part `return1`. Whole numbers from 0 stay whole, and all others
/// become floats of 32 bits. Arrays of other shapes than the range (without one, the first) are left out, and the attribute
/// `npz:left_out` names them.
///
/// # Errors
/// A [`ReadError`] if the bytes are no NPZ, are cut short, have no array of rows and columns, or if the arrays do not fit into
/// `memory` bytes.
pub fn read_npz(bytes: &[u8], memory: u64) -> Result<Vec<Part>, ReadError> {
    let members = members(bytes)?;
    if members.len() > MAX_ARRAYS {
        return Err(ReadError::new(format!("it has {} arrays, more than {MAX_ARRAYS}", members.len())));
    }
    let mut parts: BTreeMap<(usize, &str), Found> = BTreeMap::new();
    let (mut about, mut kept) = (Vec::new(), 0);
    for member in &members {
        let Some(name) = member.name.strip_suffix(".npy") else { continue };
        ReadError::check_memory(member.length.saturating_add(kept), memory)?;
        let in_member = |e: ReadError| ReadError::new(format!("its array {name:?}: {e}"));
        let content = member.read()?;
        let array = Array::of(&content).map_err(in_member)?;
        if let (Kind::Text(length), "about") = (&array.kind, name) {
            about = array.body[..array.body.len().min(*length)].to_vec();
            continue;
        }
        let (prefix, name) = name.rsplit_once('/').unwrap_or(("", name));
        // Parts sort by the length of their names first: return2 comes before return10.
        let found = parts.entry((prefix.len(), prefix)).or_default();
        kept += BYTES_A_VALUE.saturating_mul(array.len().map_err(in_member)?.min(array.body.len()) as u64);
        ReadError::check_memory(member.length.saturating_add(kept), memory)?;
        found.add(name, &array).map_err(in_member)?;
    }
    let mut left_out = Vec::new();
    parts.retain(|_, found| {
        let has_channels = !found.channels.is_empty();
        if !has_channels {
            left_out.append(&mut found.left_out);
        }
        has_channels
    });
    if parts.is_empty() {
        let arrays = if left_out.is_empty() { "none at all".to_owned() } else { left_out.join(", ") };
        return Err(ReadError::new(format!("it has no array of rows and columns: {arrays}")));
    }
    ReadError::check_memory(
        (about.len() as u64).saturating_mul(parts.len() as u64).saturating_add(kept),
        memory,
    )?;
    let attributes = attributes(&about)?;
    let is_alone = parts.len() == 1;
    let part = |((_, prefix), found): ((usize, &str), Found)| {
        let (image, mut own_left_out) = found.image();
        // What belongs to no part is told with the first.
        own_left_out.append(&mut left_out);
        let name = match prefix {
            _ if is_alone => String::new(),
            "" => "return0".to_owned(),
            other => other.to_owned(),
        };
        let mut attributes = attributes.clone();
        if !own_left_out.is_empty() {
            attributes.insert(LEFT_OUT.to_owned(), own_left_out.join(", "));
        }
        Part { name, image, attributes }
    };
    Ok(parts.into_iter().map(part).collect())
}

/// The arrays of a part.
#[derive(Default)]
struct Found {
    /// Channels with their rows and columns.
    channels: Vec<([usize; 2], Channel)>,
    /// The arrays that are no channels, in words.
    left_out: Vec<String>,
}

impl Found {
    /// Adds the channels that an array is.
    fn add(&mut self, name: &str, array: &Array) -> Result<(), ReadError> {
        let (Kind::Number(number, is_big_endian), true) = (&array.kind, !array.shape.contains(&0)) else {
            self.left_out.push(format!("{name} {}", array.in_words()));
            return Ok(());
        };
        let (rows, columns, axes): (usize, usize, &[&str]) = match array.shape[..] {
            [rows, columns] => (rows, columns, &[""]),
            [rows, columns, 3] => (rows, columns, &[".X", ".Y", ".Z"]),
            _ => {
                self.left_out.push(format!("{name} {}", array.in_words()));
                return Ok(());
            }
        };
        let needed = array.len()?.checked_mul(number.size()).filter(|&needed| needed <= array.body.len());
        let body = &array.body[..needed.ok_or_else(|| {
            ReadError::new(format!("it is cut short: its header promises {}", array.in_words()))
        })?];
        for (axis, end) in axes.iter().enumerate() {
            let place = |pixel: usize| match array.is_fortran {
                true => pixel / columns + rows * (pixel % columns + columns * axis),
                false => pixel * axes.len() + axis,
            };
            let value = |pixel: usize| {
                let start = place(pixel) * number.size();
                number.read(&body[start..start + number.size()], *is_big_endian)
            };
            let samples = samples(*number, (0..rows * columns).map(value));
            self.channels.push(([rows, columns], Channel { name: format!("{name}{end}"), samples }));
        }
        Ok(())
    }

    /// The image of the channels that are as large as the range or, without one, the first, and the names of the others.
    fn image(mut self) -> (Image, Vec<String>) {
        self.channels.sort_by(|(_, a), (_, b)| a.name.cmp(&b.name));
        self.channels.dedup_by(|(_, a), (_, b)| a.name == b.name);
        let main =
            self.channels.iter().find(|(_, channel)| channel.name == "range").or(self.channels.first());
        let [rows, columns] = main.map_or([0, 0], |(sides, _)| *sides);
        let (own, others): (Vec<_>, Vec<_>) =
            self.channels.drain(..).partition(|(sides, _)| *sides == [rows, columns]);
        let channels = own.into_iter().map(|(_, channel)| channel).collect();
        let other = |([rows, columns], channel): ([usize; 2], Channel)| {
            format!("{} {rows} × {columns}", channel.name)
        };
        self.left_out.extend(others.into_iter().map(other));
        (Image { rows, columns, channels }, self.left_out)
    }
}

/// The values of a channel, as ids if they are whole and not negative and the type is one of integers.
fn samples(number: Number, values: impl Iterator<Item = f64> + Clone) -> Samples {
    let is_id = |value: f64| (0.0..=f64::from(u32::MAX)).contains(&value);
    let is_signed = matches!(number, Number::I8 | Number::I16 | Number::I32 | Number::I64 | Number::U64);
    if number.fits_u32() || is_signed && values.clone().all(is_id) {
        Samples::U32(values.map(|value| value as u32).collect())
    } else {
        Samples::F32(values.map(|value| value as f32).collect())
    }
}

/// The description of the arrays, which is JSON, as attributes with the names of an EXR's.
fn attributes(about: &[u8]) -> Result<BTreeMap<String, String>, ReadError> {
    const KNOWN: [&str; 6] = ["sensor", "pattern", "no_return", "world_from_sensor", "instances", "labels"];
    const LONGEST: usize = 64 << 20;
    if about.len() > LONGEST {
        return Err(ReadError::new(format!(
            "its array \"about\" has {} bytes, more than {LONGEST}",
            about.len()
        )));
    }
    // A file of others may call anything so.
    let about: Map<String, Value> = serde_json::from_slice(about).unwrap_or_default();
    let text = |value: &Value| match value {
        Value::String(text) => Some(text.clone()),
        Value::Object(names) if names.is_empty() => None,
        other => Some(other.to_string()),
    };
    let known = KNOWN.iter().filter_map(|key| Some((format!("beamcast:{key}"), text(about.get(*key)?)?)));
    let mut all: BTreeMap<String, String> = known.collect();
    // An image that was converted has attributes of its own.
    if let Some(Value::Object(own)) = about.get("attributes") {
        all.extend(own.iter().filter_map(|(key, value)| Some((key.clone(), value.as_str()?.to_owned()))));
    }
    Ok(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::{npy, zip};
    use proptest::prelude::*;

    fn array(kind: &str, shape: &[usize], body: &[u8]) -> Vec<u8> {
        [npy::header(&format!("'{kind}'"), shape).unwrap(), body.to_vec()].concat()
    }

    fn floats(values: impl IntoIterator<Item = f32>) -> Vec<u8> {
        values.into_iter().flat_map(f32::to_le_bytes).collect()
    }

    /// Two parts of 2 × 3 pixels, with a text and a list beside them.
    fn arrays() -> Vec<(&'static str, Vec<u8>)> {
        let about = br#"{"sensor":"top","instances":{"1":"floor"},"labels":{"4":["tree"]}}"#;
        vec![
            ("range.npy", array("<f4", &[2, 3], &floats([1.0, 2.0, f32::INFINITY, 4.0, 5.0, 6.0]))),
            ("normal.npy", array("<f4", &[2, 3, 3], &floats((0..18).map(|i| i as f32)))),
            ("id.instance.npy", array("|u1", &[2, 3], &[0, 1, 2, 3, 4, 255])),
            ("offset.npy", array("|i1", &[2, 3], &[0, 1, 2, 3, 4, 0xff])),
            ("return1/range.npy", array(">f8", &[2, 3], &[1.5_f64; 6].map(f64::to_be_bytes).concat())),
            ("list.npy", array("<f4", &[2], &floats([1.0, 2.0]))),
            ("about.npy", array(&format!("|S{}", about.len()), &[], about)),
        ]
    }

    fn file(is_compressed: bool, arrays: Vec<(&str, Vec<u8>)>) -> Vec<u8> {
        let member = |(name, content): (&str, Vec<u8>)| match is_compressed {
            true => zip::Member::deflated(name.to_owned(), &content, 1),
            false => zip::Member::stored(name.to_owned(), content),
        };
        zip::zip(&arrays.into_iter().map(member).collect::<Vec<_>>()).unwrap()
    }

    #[test]
    fn arrays_are_the_channels_of_parts() {
        for is_compressed in [false, true] {
            let parts = read_npz(&file(is_compressed, arrays()), u64::MAX).unwrap();
            let [first, second] = &parts[..] else { panic!("{parts:?}") };
            assert_eq!((first.name.as_str(), second.name.as_str()), ("return0", "return1"));
            let image = &first.image;
            assert_eq!((image.rows, image.columns), (2, 3));
            let names: Vec<_> = image.channels.iter().map(|channel| channel.name.as_str()).collect();
            assert_eq!(names, ["id.instance", "normal.X", "normal.Y", "normal.Z", "offset", "range"]);
            assert_eq!(image.u32("id.instance").unwrap(), [0, 1, 2, 3, 4, 255]);
            assert_eq!(image.f32("normal.Y").unwrap(), [1.0, 4.0, 7.0, 10.0, 13.0, 16.0]);
            assert_eq!(image.f32("offset").unwrap()[5], -1.0);
            assert_eq!(image.mask(), [true, true, false, true, true, true]);
            assert_eq!(second.image.f32("range").unwrap(), [1.5; 6]);
            assert_eq!(first.instances().of([1]).get(&1).unwrap(), "floor");
            assert_eq!(first.labels().get(&4).unwrap(), "tree");
            assert_eq!(first.attributes["npz:left_out"], "list 2 float");
            assert_eq!(first.attributes["beamcast:sensor"], "top");
        }
    }

    #[test]
    fn fortrans_order_is_turned() {
        let content = array("<f4", &[2, 3], &floats([0.0, 3.0, 1.0, 4.0, 2.0, 5.0]));
        let text = String::from_utf8_lossy(&content[10..64]).replace("False", "True ");
        let bytes = file(false, vec![("a.npy", [&content[..10], text.as_bytes(), &content[64..]].concat())]);
        let image = &read_npz(&bytes, u64::MAX).unwrap()[0].image;
        assert_eq!(image.f32("a").unwrap(), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    }

    #[test]
    fn errors_name_the_problem() {
        let of = |bytes: &[u8]| read_npz(bytes, u64::MAX).unwrap_err().to_string();
        let whole = file(false, arrays());
        assert!(of(&whole[..whole.len() - 1]).contains("cut short"));
        assert_eq!(of(&file(false, vec![])), "it has no array of rows and columns: none at all");
        let list = vec![("a.npy", array("<f4", &[2], &[0; 8]))];
        assert_eq!(of(&file(false, list)), "it has no array of rows and columns: a 2 float");
        let short = vec![("a.npy", array("<f4", &[2, 2], &[0; 8]))];
        assert_eq!(
            of(&file(true, short)),
            "its array \"a\": it is cut short: its header promises 2 × 2 float"
        );
        let mut damaged = whole.clone();
        let at = whole.windows(4).position(|bytes| bytes == 5.0_f32.to_le_bytes()).unwrap();
        damaged[at] ^= 1;
        assert!(of(&damaged).contains("\"range.npy\" is damaged"), "{}", of(&damaged));
        assert!(read_npz(&whole, 100).unwrap_err().to_string().contains("of memory, more than the 100"));
    }

    #[test]
    fn a_bomb_takes_no_memory() {
        // A member whose directory claims less than it inflates to, and one that claims more than there is.
        let large = array("<f4", &[1000, 1000], &[0; 4_000_000]);
        let mut bytes = file(true, vec![("a.npy", large)]);
        assert!(
            bytes.len() < 40_000 && read_npz(&bytes, 1 << 20).unwrap_err().to_string().contains("of memory")
        );
        let entry = bytes.windows(4).position(|at| at == b"PK\x01\x02").unwrap();
        bytes[entry + 24..entry + 28].copy_from_slice(&100_u32.to_le_bytes());
        let problem = read_npz(&bytes, 1 << 20).unwrap_err().to_string();
        assert!(problem.contains("to the length that it claims"), "{problem}");
    }

    proptest! {
        #[test]
        fn broken_bytes_are_an_error_or_parts(is_compressed: bool, at in 0.0..1.0, value: u8, keep in 0.0..2.0) {
            let mut bytes = file(is_compressed, arrays());
            let at = (at * bytes.len() as f64) as usize;
            bytes[at] = value;
            bytes.truncate((keep * bytes.len() as f64) as usize);
            for part in read_npz(&bytes, u64::MAX).unwrap_or_default() {
                prop_assert!(part.image.channels.iter().all(|c| c.samples.len() == part.image.pixels()));
            }
        }
    }
}
