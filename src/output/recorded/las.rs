//! Reading of LAS and LAZ point clouds: versions 1.0 to 1.4, with points of the record formats 0 to 10.
//!
//! The layout is that of "LAS Specification 1.4 – R15" (ASPRS, 2019), whose older versions begin with the same fields.

use serde_json::Value;

use super::cloud::{Cloud, Field, MAX_FIELDS, cut_short};
use super::error::ReadError;
use super::laszip::{self, Compressed};
use super::number::Number;

/// Reads a LAS, or a LAZ as which its points are compressed. The fields have the names of laspy: `x`, `y` and `z` in the file's unit, with
/// its scale and its offset, and then what a record holds, but for packets of waveforms, which are left out. Extra dimensions
/// follow under their own names, and several values under one name become `name[0]` and so on.
///
/// # Errors
/// A [`ReadError`] if the bytes are no LAS, are cut short or contradict themselves, or if the points do not fit into `memory` bytes.
pub fn read_las(bytes: &[u8], memory: u64) -> Result<Cloud, ReadError> {
    let header = Header::of(bytes)?;
    let records = header.records()?;
    let columns = header.columns(&records)?;
    let points =
        usize::try_from(header.points).map_err(|_| ReadError::new("its number of points overflows"))?;
    ReadError::check_memory(header.points.saturating_mul((columns.len() * size_of::<f64>()) as u64), memory)?;
    let mut values = vec![Vec::new(); columns.len()];
    let mut take = |record: &[u8]| {
        for (column, values) in columns.iter().zip(&mut values) {
            values.push(column.value(record));
        }
    };
    if header.is_compressed {
        let description = records.iter().find(|record| record.is(laszip::RECORD));
        let description = description
            .ok_or_else(|| ReadError::new("its points are compressed, and it does not say how"))?;
        let compressed = Compressed {
            file: bytes,
            at: header.at,
            format: header.format,
            record_bytes: [header.own_bytes, header.record_bytes],
            points: header.points,
        };
        compressed.each_record(description.content, &mut take)?;
    } else {
        let needed = points.checked_mul(header.record_bytes);
        let body =
            needed.and_then(|needed| bytes[header.at..].get(..needed)).ok_or_else(|| cut_short(points))?;
        body.chunks_exact(header.record_bytes).for_each(take);
    }
    let field =
        |(column, values): (Column, Vec<f64>)| Field { kind: column.kind(), name: column.name, values };
    let fields = columns.into_iter().zip(values).map(field).collect();
    Ok(Cloud { points, fields, comments: comments(&records) })
}

/// The header's facts about the points.
struct Header<'a> {
    file: &'a [u8],
    minor: u8,
    header_bytes: usize,
    /// The place of the points.
    at: usize,
    format: u8,
    is_compressed: bool,
    /// The bytes of a point of the format, and of this file.
    own_bytes: usize,
    record_bytes: usize,
    points: u64,
}

/// The bytes of a record of each format.
const BYTES_OF_FORMATS: [usize; 11] = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67];

impl<'a> Header<'a> {
    fn of(file: &'a [u8]) -> Result<Self, ReadError> {
        /// The bytes of the header before version 1.3, and of version 1.4.
        const LEAST: [usize; 2] = [227, 375];
        if !file.starts_with(b"LASF") {
            return Err(ReadError::new("this is no LAS"));
        }
        let short = || ReadError::new("its header is cut short");
        if file.len() < LEAST[0] {
            return Err(short());
        }
        let (major, minor) = (file[24], file[25]);
        if major != 1 || minor > 4 {
            return Err(ReadError::new(format!("it is of version {major}.{minor}, and 1.0 to 1.4 are read")));
        }
        let has_64_bits = minor == 4;
        let header_bytes = usize::from(u16::from_le_bytes(at(file, 94)));
        if header_bytes < LEAST[usize::from(has_64_bits)] || header_bytes > file.len() {
            return Err(short());
        }
        let format = file[104] & 0x3f;
        let Some(&own_bytes) = BYTES_OF_FORMATS.get(usize::from(format)) else {
            return Err(ReadError::new(format!("its points are of format {format}, and 0 to 10 are read")));
        };
        let record_bytes = usize::from(u16::from_le_bytes(at(file, 105)));
        if record_bytes < own_bytes {
            return Err(ReadError::new(format!(
                "its points have {record_bytes} bytes, and those of format {format} have at least {own_bytes}"
            )));
        }
        let place = u32::from_le_bytes(at(file, 96)) as usize;
        if place < header_bytes || place > file.len() {
            return Err(ReadError::new(format!(
                "its points begin at byte {place}, and it has {}",
                file.len()
            )));
        }
        let older = u64::from(u32::from_le_bytes(at(file, 107)));
        let points = if has_64_bits { u64::from_le_bytes(at(file, 247)) } else { older };
        let is_compressed = file[104] & 0xc0 != 0;
        Ok(Self {
            file,
            minor,
            header_bytes,
            at: place,
            format,
            is_compressed,
            own_bytes,
            record_bytes,
            points,
        })
    }

    /// The records of variable length, and the extended ones after the points.
    fn records(&self) -> Result<Vec<Record<'a>>, ReadError> {
        const HEAD: [usize; 2] = [54, 60];
        let broken = || ReadError::new("its records of variable length are cut short");
        let count = u32::from_le_bytes(at(self.file, 100));
        let mut records = Vec::new();
        let mut rest = &self.file[self.header_bytes..self.at];
        let mut left = u64::from(count);
        let mut extended = 0;
        if self.minor == 4 {
            extended = u64::from(u32::from_le_bytes(at(self.file, 243)));
        }
        for (which, head) in HEAD.into_iter().enumerate() {
            if which == 1 {
                left = extended;
                if left > 0 {
                    let start = usize::try_from(u64::from_le_bytes(at(self.file, 235))).ok();
                    rest = start.and_then(|start| self.file.get(start..)).ok_or_else(broken)?;
                }
            }
            // Each takes the bytes of its head at least, so that a count can't be out of proportion.
            for _ in 0..left {
                let (about, after) = rest.split_at_checked(head).ok_or_else(broken)?;
                let length = match which {
                    0 => u64::from(u16::from_le_bytes(at(about, 20))),
                    _ => u64::from_le_bytes(at(about, 20)),
                };
                let length = usize::try_from(length).map_err(|_| broken())?;
                let (content, after) = after.split_at_checked(length).ok_or_else(broken)?;
                let number = u16::from_le_bytes(at(about, 18));
                records.push(Record { user: text(&about[2..18]), number, content });
                rest = after;
            }
        }
        Ok(records)
    }

    /// The fields of a point.
    fn columns(&self, records: &[Record]) -> Result<Vec<Column>, ReadError> {
        let mut columns = self.coordinates().to_vec();
        columns.extend(self.of_format());
        let described = records.iter().filter(|record| record.is(("LASF_Spec", 4)));
        let mut offset = self.own_bytes;
        for described in described.flat_map(|record| record.content.as_chunks::<192>().0) {
            offset = add_extra(described, offset, self.record_bytes, &mut columns)?;
            if columns.len() > MAX_FIELDS {
                return Err(ReadError::new(format!("it has more than {MAX_FIELDS} fields a point")));
            }
        }
        Ok(columns)
    }

    fn coordinates(&self) -> [Column; 3] {
        std::array::from_fn(|axis| {
            let number = |place: usize| f64::from_le_bytes(at(self.file, place + 8 * axis));
            let of = Of::Number(Number::I32, Some([number(131), number(155)]));
            Column { name: ["x", "y", "z"][axis].to_owned(), offset: 4 * axis, of }
        })
    }

    /// The fields that the format has, after the coordinates.
    fn of_format(&self) -> Vec<Column> {
        use Number::{F64, I8, I16, U8, U16};
        let mut columns = Vec::new();
        let mut add = |name: &str, offset: usize, of: Of| {
            columns.push(Column { name: name.to_owned(), offset, of });
        };
        let number = |number| Of::Number(number, None);
        add("intensity", 12, number(U16));
        let (time, colour) = if self.format < 6 {
            add("return_number", 14, Of::Bits(0, 3));
            add("number_of_returns", 14, Of::Bits(3, 3));
            add("scan_direction_flag", 14, Of::Bits(6, 1));
            add("edge_of_flight_line", 14, Of::Bits(7, 1));
            add("classification", 15, Of::Bits(0, 5));
            add("synthetic", 15, Of::Bits(5, 1));
            add("key_point", 15, Of::Bits(6, 1));
            add("withheld", 15, Of::Bits(7, 1));
            add("scan_angle_rank", 16, number(I8));
            add("user_data", 17, number(U8));
            add("point_source_id", 18, number(U16));
            let time = matches!(self.format, 1 | 3 | 4 | 5).then_some(20);
            let colour = match self.format {
                2 => Some(20),
                3 | 5 => Some(28),
                _ => None,
            };
            (time, colour)
        } else {
            add("return_number", 14, Of::Bits(0, 4));
            add("number_of_returns", 14, Of::Bits(4, 4));
            add("synthetic", 15, Of::Bits(0, 1));
            add("key_point", 15, Of::Bits(1, 1));
            add("withheld", 15, Of::Bits(2, 1));
            add("overlap", 15, Of::Bits(3, 1));
            add("scanner_channel", 15, Of::Bits(4, 2));
            add("scan_direction_flag", 15, Of::Bits(6, 1));
            add("edge_of_flight_line", 15, Of::Bits(7, 1));
            add("classification", 16, number(U8));
            add("user_data", 17, number(U8));
            add("scan_angle", 18, number(I16));
            add("point_source_id", 20, number(U16));
            (Some(22), matches!(self.format, 7 | 8 | 10).then_some(30))
        };
        if let Some(time) = time {
            add("gps_time", time, number(F64));
        }
        if let Some(colour) = colour {
            for (index, name) in ["red", "green", "blue"].into_iter().enumerate() {
                add(name, colour + 2 * index, number(U16));
            }
        }
        if matches!(self.format, 8 | 10) {
            add("nir", 36, number(U16));
        }
        columns
    }
}

/// A record of variable length.
struct Record<'a> {
    user: String,
    number: u16,
    content: &'a [u8],
}

impl Record<'_> {
    fn is(&self, (user, number): (&str, u16)) -> bool {
        self.user == user && self.number == number
    }
}

/// A field of a point.
#[derive(Clone, Debug)]
struct Column {
    name: String,
    /// The place in a record, in bytes.
    offset: usize,
    of: Of,
}

/// What a field is made of.
#[derive(Clone, Copy, Debug)]
enum Of {
    /// A number, and the scale and the offset of the value if it is a step.
    Number(Number, Option<[f64; 2]>),
    /// Some bits of a byte: the lowest one, and how many.
    Bits(u8, u8),
}

impl Column {
    fn value(&self, record: &[u8]) -> f64 {
        match self.of {
            Of::Number(number, steps) => {
                let value = number.read(&record[self.offset..self.offset + number.size()], false);
                steps.map_or(value, |[scale, offset]| value * scale + offset)
            }
            Of::Bits(lowest, count) => f64::from(record[self.offset] >> lowest & ((1 << count) - 1)),
        }
    }

    /// The type in the words of [`Field::kind`].
    fn kind(&self) -> &'static str {
        match self.of {
            Of::Number(_, Some(_)) => Number::F64.name(),
            Of::Number(number, None) => number.name(),
            Of::Bits(..) => Number::U8.name(),
        }
    }
}

/// Adds the columns of an extra dimension, which 192 bytes describe, and gives the place after it.
fn add_extra(
    described: &[u8; 192],
    offset: usize,
    record_bytes: usize,
    columns: &mut Vec<Column>,
) -> Result<usize, ReadError> {
    const NUMBERS: [Number; 10] = [
        Number::U8,
        Number::I8,
        Number::U16,
        Number::I16,
        Number::U32,
        Number::I32,
        Number::U64,
        Number::I64,
        Number::F32,
        Number::F64,
    ];
    let name = text(&described[4..36]);
    let (kind, options) = (usize::from(described[2]), described[3]);
    let too_long =
        || ReadError::new(format!("its extra dimension {name:?} lies beyond the bytes of a point"));
    let Some(kind) = kind.checked_sub(1) else {
        // Bytes without a meaning, whose number the options are.
        return Some(offset + usize::from(options)).filter(|end| *end <= record_bytes).ok_or_else(too_long);
    };
    // The types from 11 are two and three values of the first ten.
    let (number, count) = (NUMBERS[kind % NUMBERS.len()], kind / NUMBERS.len() + 1);
    if count > 3 {
        return Err(ReadError::new(format!(
            "its extra dimension {name:?} has the type {}, which LAS lacks",
            kind + 1
        )));
    }
    let end = offset + number.size() * count;
    if end > record_bytes {
        return Err(too_long());
    }
    for index in 0..count {
        let own = |flag: u8, place: usize, other: f64| match options & flag {
            0 => other,
            _ => f64::from_le_bytes(at(described, place + 8 * index)),
        };
        let is_step = options & 0b11000 != 0;
        let steps = is_step.then(|| [own(0b1000, 112, 1.0), own(0b10000, 136, 0.0)]);
        columns.push(Column {
            name: if count == 1 { name.clone() } else { format!("{name}[{index}]") },
            offset: offset + number.size() * index,
            of: Of::Number(number, steps),
        });
    }
    Ok(end)
}

/// The comments: those that a conversion kept, the frame and the pose that a file of ours tells, and the coordinate reference system.
fn comments(records: &[Record]) -> Vec<String> {
    let mut comments = Vec::new();
    for record in records {
        let content = || String::from_utf8_lossy(record.content);
        match (record.user.as_str(), record.number) {
            ("beamcast", 1) => {
                let Ok(Value::Object(about)) = serde_json::from_slice(record.content) else { continue };
                if let Some(Value::String(points)) = about.get("points") {
                    comments.push(format!("frame: {points}, metres"));
                }
                comments.extend(
                    about
                        .iter()
                        .filter(|(key, _)| *key != "points")
                        .map(|(key, value)| format!("{key} = {value}")),
                );
            }
            ("beamcast", 2) => comments.extend(content().lines().map(str::to_owned)),
            ("LASF_Projection", 2112) => {
                let wkt = content();
                let words: Vec<&str> = wkt.trim_end_matches('\0').split_whitespace().collect();
                comments.push(format!("{WKT}{}", words.join(" ")));
            }
            _ => {}
        }
    }
    comments
}

/// The beginning of the comment that tells the coordinate reference system.
pub(in crate::output) const WKT: &str = "crs: ";

/// The bytes at a place that was checked to be there.
fn at<const N: usize>(bytes: &[u8], place: usize) -> [u8; N] {
    std::array::from_fn(|index| bytes[place + index])
}

/// A text in a field that is filled with 0.
fn text(field: &[u8]) -> String {
    let end = field.iter().position(|&byte| byte == 0).unwrap_or(field.len());
    String::from_utf8_lossy(&field[..end]).trim_end().to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const POINTS: usize = 9;

    fn vlr(user: &str, number: u16, content: &[u8]) -> Vec<u8> {
        let mut record = vec![0; 54];
        record[2..2 + user.len()].copy_from_slice(user.as_bytes());
        record[18..20].copy_from_slice(&number.to_le_bytes());
        record[20..22].copy_from_slice(&(content.len() as u16).to_le_bytes());
        [&record, content].concat()
    }

    /// The extra dimensions `ring` (16 bits), `step` (8 bits with a scale and an offset) and `n`, two floats.
    fn extra() -> Vec<u8> {
        let described = |name: &str, kind: u8| {
            let mut described = [0; 192];
            described[2] = kind;
            described[4..4 + name.len()].copy_from_slice(name.as_bytes());
            described
        };
        let mut step = described("step", 1);
        step[3] = 0b11000;
        step[112..120].copy_from_slice(&0.5_f64.to_le_bytes());
        step[136..144].copy_from_slice(&100.0_f64.to_le_bytes());
        [described("ring", 3), step, described("n", 19)].concat()
    }
    const EXTRA_BYTES: usize = 2 + 1 + 8;

    fn records(format: u8) -> Vec<u8> {
        let own = BYTES_OF_FORMATS[usize::from(format)];
        let mut records = Vec::new();
        for point in 0..POINTS {
            let mut record = vec![0; own + EXTRA_BYTES];
            for axis in 0..3 {
                let steps = (point * point * (axis + 1)) as i32 - 20;
                record[4 * axis..4 * axis + 4].copy_from_slice(&steps.to_le_bytes());
            }
            record[12..14].copy_from_slice(&(1000 * point as u16).to_le_bytes());
            // The second of three returns.
            record[14] = if format < 6 { 2 | 3 << 3 } else { 2 | 3 << 4 };
            record[if format < 6 { 15 } else { 16 }] = 6;
            if format == 7 {
                record[22..30].copy_from_slice(&(point as f64 / 3.0).to_le_bytes());
                record[32..34].copy_from_slice(&(200 + point as u16).to_le_bytes());
            }
            record[own..own + 2].copy_from_slice(&(point as u16 / 2).to_le_bytes());
            record[own + 2] = 7 * point as u8;
            record[own + 3..own + 7].copy_from_slice(&(point as f32 / 7.0).to_le_bytes());
            record[own + 7..].copy_from_slice(&(-1.0_f32).to_le_bytes());
            records.extend(record);
        }
        records
    }

    /// A file of version 1.2, or 1.4 with formats from 6.
    fn las(format: u8, is_compressed: bool) -> Vec<u8> {
        let (minor, header_bytes) = if format < 6 { (2, 227) } else { (4, 375) };
        let own = BYTES_OF_FORMATS[usize::from(format)];
        let about = r#"{"sensor": "top", "points": "the world"}"#;
        let mut vlrs = vec![
            vlr("LASF_Spec", 4, &extra()),
            vlr("beamcast", 1, about.as_bytes()),
            vlr("LASF_Projection", 2112, b"GEOGCS[\n  \"a\"]\0"),
        ];
        let records = records(format);
        let mut body = records.clone();
        if is_compressed {
            // The length of the description does not depend on the place of the points.
            let (description, _) = laszip::compressed(format, EXTRA_BYTES as u16, 0, &records);
            vlrs.push(vlr(laszip::RECORD.0, laszip::RECORD.1, &description));
            let place = header_bytes + vlrs.concat().len();
            body = laszip::compressed(format, EXTRA_BYTES as u16, place, &records).1;
        }
        let mut file = vec![0; header_bytes];
        file[..4].copy_from_slice(b"LASF");
        file[24..26].copy_from_slice(&[1, minor]);
        file[94..96].copy_from_slice(&(header_bytes as u16).to_le_bytes());
        file[96..100].copy_from_slice(&((header_bytes + vlrs.concat().len()) as u32).to_le_bytes());
        file[100..104].copy_from_slice(&(vlrs.len() as u32).to_le_bytes());
        file[104] = format | if is_compressed { 0x80 } else { 0 };
        file[105..107].copy_from_slice(&((own + EXTRA_BYTES) as u16).to_le_bytes());
        match minor {
            4 => file[247..255].copy_from_slice(&(POINTS as u64).to_le_bytes()),
            _ => file[107..111].copy_from_slice(&(POINTS as u32).to_le_bytes()),
        }
        for (axis, offset) in [0.0, 5e5, -1.0_f64].into_iter().enumerate() {
            file[131 + 8 * axis..139 + 8 * axis].copy_from_slice(&0.001_f64.to_le_bytes());
            file[155 + 8 * axis..163 + 8 * axis].copy_from_slice(&offset.to_le_bytes());
        }
        [file, vlrs.concat(), body].concat()
    }

    #[test]
    fn points_of_every_format_are_read_with_their_extra_dimensions() {
        for format in 0..=10 {
            let cloud = read_las(&las(format, false), u64::MAX).unwrap();
            assert_eq!(cloud.points, POINTS);
            let steps = |point: usize, axis: usize| f64::from((point * point * (axis + 1)) as i32 - 20);
            for (axis, (name, offset)) in [("x", 0.0), ("y", 5e5), ("z", -1.0)].into_iter().enumerate() {
                let expected: Vec<f64> =
                    (0..POINTS).map(|point| steps(point, axis) * 0.001 + offset).collect();
                assert_eq!(cloud.field(name).unwrap(), expected, "format {format}");
            }
            assert_eq!(cloud.field("intensity").unwrap()[8], 8000.0);
            assert_eq!(cloud.field("return_number").unwrap(), [2.0; POINTS]);
            assert_eq!(cloud.field("number_of_returns").unwrap(), [3.0; POINTS]);
            assert_eq!(cloud.field("classification").unwrap(), [6.0; POINTS]);
            assert_eq!(cloud.field("ring").unwrap()[7], 3.0);
            assert_eq!(cloud.field("step").unwrap()[2], 107.0);
            assert_eq!(cloud.field("n[0]").unwrap()[5], f64::from(5.0_f32 / 7.0));
            assert_eq!(cloud.field("n[1]").unwrap()[5], -1.0);
            assert_eq!(cloud.field("gps_time").is_some(), ![0, 2].contains(&format), "format {format}");
            assert_eq!(
                cloud.field("blue").is_some(),
                [2, 3, 5, 7, 8, 10].contains(&format),
                "format {format}"
            );
            assert_eq!(cloud.field("nir").is_some(), [8, 10].contains(&format), "format {format}");
            assert_eq!(
                cloud.comments,
                ["frame: the world, metres", "sensor = \"top\"", "crs: GEOGCS[ \"a\"]"]
            );
        }
        let coloured = read_las(&las(7, false), u64::MAX).unwrap();
        assert_eq!(coloured.field("green").unwrap()[8], 208.0);
        assert_eq!(coloured.field("gps_time").unwrap()[2], 2.0 / 3.0);
        let kinds: Vec<_> = ["x", "intensity", "return_number", "step", "n[0]"]
            .map(|name| coloured.fields.iter().find(|field| field.name == name).unwrap().kind)
            .into();
        assert_eq!(kinds, ["double", "ushort", "uchar", "double", "float"]);
    }

    #[test]
    fn compressed_points_are_the_same() {
        for format in 0..=10 {
            let [plain, packed] = [false, true].map(|is| read_las(&las(format, is), u64::MAX).unwrap());
            assert_eq!(plain, packed, "format {format}");
        }
    }

    #[test]
    fn errors_name_the_problem() {
        let of = |bytes: &[u8]| read_las(bytes, u64::MAX).unwrap_err().to_string();
        for format in [0, 7] {
            let whole = las(format, false);
            assert_eq!(of(&whole[..whole.len() - 1]), "it is cut short: its header promises 9 points");
            assert_eq!(of(&whole[..200]), "its header is cut short");
            let with = |at: usize, bytes: &[u8]| {
                let mut changed = las(format, true);
                changed[at..at + bytes.len()].copy_from_slice(bytes);
                of(&changed)
            };
            assert_eq!(with(25, &[5]), "it is of version 1.5, and 1.0 to 1.4 are read");
            assert_eq!(with(104, &[0x80 | 11]), "its points are of format 11, and 0 to 10 are read");
            assert!(with(105, &[19, 0]).starts_with("its points have 19 bytes, and those of format"));
            assert!(with(96, &[0xff; 4]).starts_with("its points begin at byte 4294967295"));
            assert_eq!(with(100, &[9]), "its records of variable length are cut short");
            assert_eq!(with(100, &[3]), "its points are compressed, and it does not say how");
            let other = with(104, &[0x80 | (format + 1)]);
            assert!(other.contains("bytes") || other.contains("not that of points"), "{other}");
        }
        let problem = read_las(&las(0, true), 100).unwrap_err().to_string();
        assert!(problem.starts_with("it takes ") && problem.ends_with("more than the 100 that there are"));
        // Many more points than there are.
        let mut claimed = las(7, true);
        claimed[247..251].copy_from_slice(&5_000_000_u32.to_le_bytes());
        assert_eq!(of(&claimed), "its compressed points are broken");
        let mut claimed = las(7, false);
        claimed[247..251].copy_from_slice(&5_000_000_u32.to_le_bytes());
        assert_eq!(of(&claimed), "it is cut short: its header promises 5000000 points");
    }

    #[test]
    fn claims_of_chunks_are_held_to_the_bytes() {
        let whole = las(7, true);
        let place = u32::from_le_bytes(at(&whole, 96)) as usize;
        let table = u64::from_le_bytes(at(&whole, place)) as usize;
        let with = |at: usize, bytes: &[u8]| {
            let mut changed = whole.clone();
            changed[at..at + bytes.len()].copy_from_slice(bytes);
            read_las(&changed, u64::MAX).unwrap_err().to_string()
        };
        assert!(with(table + 4, &[0xff; 4]).starts_with("it claims 4294967295 chunks of points, which "));
        assert!(with(place, &[0xff; 8]).starts_with("it has no table of its chunks where it says"));
        assert!(
            with(place, &(whole.len() as u64).to_le_bytes()).starts_with("it has no table of its chunks")
        );
        // The lengths of the first chunk's layers follow its first point and the number of its points.
        let layers = place + 8 + 36 + EXTRA_BYTES + 4;
        assert!(
            with(layers, &[0xff; 4]).starts_with("a chunk claims 4294967"),
            "{}",
            with(layers, &[0xff; 4])
        );
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(600))]

        #[test]
        fn broken_bytes_are_an_error_or_a_cloud(
            format in 0_u8..11, is_compressed: bool, at in 0.0..1.0, value: u8, keep in 0.0..2.0
        ) {
            let mut bytes = las(format, is_compressed);
            let at = (at * bytes.len() as f64) as usize;
            bytes[at] = value;
            bytes.truncate((keep * bytes.len() as f64) as usize);
            if let Ok(cloud) = read_las(&bytes, 1 << 26) {
                prop_assert!(cloud.fields.iter().all(|f| f.values.len() == cloud.points));
            }
        }

        #[test]
        fn any_bytes_after_a_header_are_an_error_or_a_cloud(format in 0_u8..11, body: Vec<u8>) {
            let mut bytes = las(format, true);
            let place = u32::from_le_bytes(super::at(&bytes, 96)) as usize;
            bytes.truncate(place + 8);
            bytes.extend(&body);
            if let Ok(cloud) = read_las(&bytes, 1 << 26) {
                prop_assert!(cloud.fields.iter().all(|f| f.values.len() == cloud.points));
            }
        }
    }
}
