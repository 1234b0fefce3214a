//! Reading of ROS messages: clouds (PointCloud2, Livox's CustomMsg) of any layout, and depth images.
//!
//! Messages are in CDR (OMG formal/02-06-51 §15.3), of either order of bytes, as ROS 2 has them, or without any padding, as ROS 1 has.

use std::collections::BTreeMap;

use super::cloud::{Cloud, Column, MAX_FIELDS, check_size, cut_short, read_records};
use super::error::ReadError;
use super::exr::Part;
use super::number::Number;
use crate::output::{Channel, Image, NO_RETURN_M, Samples};

/// A type of messages that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// `sensor_msgs/PointCloud2`.
    PointCloud2,
    /// `CustomMsg` of a Livox driver.
    CustomMsg,
    /// `sensor_msgs/Image`.
    Image,
}

impl Kind {
    /// The type of a name as ROS 2 writes it, `sensor_msgs/msg/Image`, or as ROS 1 does, without `msg/`.
    pub fn of(name: &str) -> Option<Self> {
        let (package, kind) = name.split_once('/')?;
        match (package, kind.strip_prefix("msg/").unwrap_or(kind)) {
            ("sensor_msgs", "PointCloud2") => Some(Self::PointCloud2),
            ("sensor_msgs", "Image") => Some(Self::Image),
            ("livox_ros_driver2" | "livox_ros_driver" | "livox_interfaces", "CustomMsg") => {
                Some(Self::CustomMsg)
            }
            _ => None,
        }
    }
}

/// A message.
#[derive(Clone, Debug, PartialEq)]
pub struct Message {
    /// The stamp of its header, in nanoseconds of the recording's clock.
    pub stamp_ns: i64,
    /// The coordinate frame of its header.
    pub frame_id: String,
    /// The rows and columns of the image, or of the cloud, which has one row unless it is organised.
    pub size: [usize; 2],
    /// What it shows.
    pub content: Content,
}

/// What a message shows.
#[derive(Clone, Debug, PartialEq)]
pub enum Content {
    /// A cloud.
    Cloud(Cloud),
    /// A depth image, whose one channel is `Z`, in metres.
    Depth(Part),
}

/// Reads a message, whose numbers may take `memory` bytes.
///
/// # Errors
/// A [`ReadError`] if the message is cut short, contradicts itself, takes more memory, or is an image of something else than depth.
pub(super) fn read_message(
    kind: Kind,
    encoding: &str,
    bytes: &[u8],
    memory: u64,
) -> Result<Message, ReadError> {
    let mut fields = Fields::new(encoding, bytes)?;
    let header = Header::read(&mut fields).ok_or_else(ended)?;
    let (size, content) = match kind {
        Kind::PointCloud2 => point_cloud(&mut fields, &header, memory)?,
        Kind::CustomMsg => custom(&mut fields, &header, memory)?,
        Kind::Image => depth(&mut fields, &header, memory)?,
    };
    Ok(Message { stamp_ns: header.stamp_ns, frame_id: header.frame_id, size, content })
}

fn ended() -> ReadError {
    ReadError::new("a message ends before its last field")
}

struct Header {
    stamp_ns: i64,
    frame_id: String,
}

impl Header {
    fn read(fields: &mut Fields) -> Option<Self> {
        if fields.is_ros1 {
            fields.u32()?; // the number of the message
        }
        let (seconds, nanoseconds) = (fields.u32()?, fields.u32()?);
        // Those of ROS 1 have no sign.
        let seconds = if fields.is_ros1 { i64::from(seconds) } else { i64::from(seconds as i32) };
        let stamp_ns = seconds * 1_000_000_000 + i64::from(nanoseconds);
        Some(Self { stamp_ns, frame_id: fields.text()? })
    }

    /// The header in words, as comments have it.
    fn comments(&self) -> Vec<String> {
        vec![format!("frame: {}", self.frame_id), format!("stamp: {} s", seconds(self.stamp_ns))]
    }
}

/// Nanoseconds as seconds, with all digits.
pub(super) fn seconds(ns: i64) -> String {
    let sign = if ns < 0 { "-" } else { "" };
    let (whole, part) = (ns.unsigned_abs() / 1_000_000_000, ns.unsigned_abs() % 1_000_000_000);
    format!("{sign}{whole}.{part:09}")
}

type Shown = ([usize; 2], Content);

fn point_cloud(fields: &mut Fields, header: &Header, memory: u64) -> Result<Shown, ReadError> {
    let (height, width) = fields.u32().zip(fields.u32()).ok_or_else(ended)?;
    let specs = point_fields(fields)?;
    let mut rest = || Some((fields.bool()?, fields.u32()?, fields.u32()?, fields.sequence()?));
    let (is_big_endian, step, row_step, data) = rest().ok_or_else(ended)?;
    let [height, width, step, row_step] = [height, width, step, row_step].map(|number| number as usize);
    let columns = columns(&specs, step, is_big_endian)?;
    let too_large = || ReadError::new("its size overflows");
    let points = height.checked_mul(width).ok_or_else(too_large)?;
    let row = width.checked_mul(step).ok_or_else(too_large)?;
    // Of one row, drivers set the step of rows to anything.
    if points > 0 && height > 1 && row_step < row {
        return Err(ReadError::new(format!(
            "its row_step of {row_step} bytes is less than {width} points of {step} bytes"
        )));
    }
    let needed = if points == 0 {
        Some(0)
    } else {
        (height - 1).checked_mul(row_step).and_then(|n| n.checked_add(row))
    };
    if needed.is_none_or(|needed| needed > data.len()) {
        return Err(cut_short(points));
    }
    check_size(points, &columns, memory)?;
    let read = if points == 0 || height == 1 || row_step == row {
        read_records(data, points, step, &columns)?
    } else {
        let rows: Vec<u8> =
            data.chunks(row_step).take(height).flat_map(|of_row| &of_row[..row]).copied().collect();
        read_records(&rows, points, step, &columns)?
    };
    let mut comments = header.comments();
    if height > 1 {
        comments.push(format!("size: {height} rows of {width} points"));
    }
    Ok(([height, width], Content::Cloud(Cloud { points, fields: read, comments })))
}

/// A field of the points of a PointCloud2.
struct PointField {
    name: String,
    offset: u32,
    datatype: u8,
    count: u32,
}

fn point_fields(fields: &mut Fields) -> Result<Vec<PointField>, ReadError> {
    let count = fields.u32().ok_or_else(ended)?;
    let mut specs = Vec::new();
    for _ in 0..count {
        if specs.len() >= MAX_FIELDS {
            return Err(ReadError::new(format!("it has more than {MAX_FIELDS} fields a point")));
        }
        let mut spec = || {
            let (name, offset) = (fields.text()?, fields.u32()?);
            Some(PointField { name, offset, datatype: fields.u8()?, count: fields.u32()? })
        };
        specs.push(spec().ok_or_else(ended)?);
    }
    Ok(specs)
}

/// The numbers of a point. A field of several is named as in a PCD: `normal[0]`.
fn columns(specs: &[PointField], step: usize, is_big_endian: bool) -> Result<Vec<Column>, ReadError> {
    let mut columns = Vec::new();
    for PointField { name, offset, datatype, count } in specs {
        let number = match datatype {
            1 => Number::I8,
            2 => Number::U8,
            3 => Number::I16,
            4 => Number::U16,
            5 => Number::I32,
            6 => Number::U32,
            7 => Number::F32,
            8 => Number::F64,
            other => {
                return Err(ReadError::new(format!("its field {name:?} is of the unknown datatype {other}")));
            }
        };
        // Some writers leave the count of single numbers out.
        let count = (*count).max(1) as usize;
        let end = count.checked_mul(number.size()).and_then(|bytes| bytes.checked_add(*offset as usize));
        if end.is_none_or(|end| end > step) {
            return Err(ReadError::new(format!(
                "its field {name:?} lies outside of its points of {step} bytes"
            )));
        }
        if columns.len() + count > MAX_FIELDS {
            return Err(ReadError::new(format!("it has more than {MAX_FIELDS} fields a point")));
        }
        columns.extend((0..count).map(|index| Column {
            name: Some(if count == 1 { name.clone() } else { format!("{name}[{index}]") }),
            number,
            offset: *offset as usize + index * number.size(),
            is_big_endian,
        }));
    }
    Ok(columns)
}

/// The numbers of a point of a CustomMsg, each with its offset.
const OF_CUSTOM: [(&str, Number, usize); 7] = [
    ("offset_time", Number::U32, 0),
    ("x", Number::F32, 4),
    ("y", Number::F32, 8),
    ("z", Number::F32, 12),
    ("reflectivity", Number::U8, 16),
    ("tag", Number::U8, 17),
    ("line", Number::U8, 18),
];

/// Bytes of such a point.
const CUSTOM_BYTES: usize = 19;

fn custom(fields: &mut Fields, header: &Header, memory: u64) -> Result<Shown, ReadError> {
    let mut head = || {
        let (timebase, _, _) = (fields.u64()?, fields.u32()?, fields.take(4)?);
        Some((timebase, fields.u32()? as usize))
    };
    let (timebase, points) = head().ok_or_else(ended)?;
    let is_big_endian = fields.is_big_endian;
    let column = |(name, number, offset): (&str, Number, usize)| Column {
        name: Some(name.to_owned()),
        number,
        offset,
        is_big_endian,
    };
    let columns = OF_CUSTOM.map(column);
    // A point begins at a multiple of 4 bytes, but nothing is filled behind the last one.
    let step = if fields.is_ros1 { CUSTOM_BYTES } else { CUSTOM_BYTES.next_multiple_of(4) };
    let body = fields.rest();
    if points > 0
        && (points - 1)
            .checked_mul(step)
            .is_none_or(|before| body.len() < before.saturating_add(CUSTOM_BYTES))
    {
        return Err(cut_short(points));
    }
    check_size(points, &columns, memory)?;
    let mut body = body[..body.len().min(points * step)].to_vec();
    body.resize(points * step, 0);
    let read = read_records(&body, points, step, &columns)?;
    let mut comments = header.comments();
    comments.push(format!("timebase: {timebase} ns"));
    Ok(([1, points], Content::Cloud(Cloud { points, fields: read, comments })))
}

fn depth(fields: &mut Fields, header: &Header, memory: u64) -> Result<Shown, ReadError> {
    let mut head = || {
        let size = [fields.u32()? as usize, fields.u32()? as usize];
        Some((size, fields.text()?, fields.bool()?, fields.u32()? as usize, fields.sequence()?))
    };
    let ([rows, columns], encoding, is_big_endian, step, data) = head().ok_or_else(ended)?;
    // REP 118: metres, or millimetres with 0 for nothing.
    let (number, unit_m) = match encoding.as_str() {
        "32FC1" => (Number::F32, 1.0),
        "16UC1" => (Number::U16, 1e-3),
        _ => {
            return Err(ReadError::new(format!(
                "its images are {encoding:?}, and depth is \"32FC1\" or \"16UC1\""
            )));
        }
    };
    let row = columns.checked_mul(number.size()).filter(|row| *row <= step || rows == 0);
    let needed = row.and_then(|row| rows.saturating_sub(1).checked_mul(step)?.checked_add(row));
    let row = row.filter(|_| needed.is_some_and(|needed| needed <= data.len()) && rows > 0 && columns > 0);
    let row = row.ok_or_else(|| {
        ReadError::new(format!(
            "its {} bytes are no {rows} rows of {columns} pixels in steps of {step} bytes",
            data.len()
        ))
    })?;
    ReadError::check_memory((rows as u64).saturating_mul(columns as u64).saturating_mul(4), memory)?;
    let depth_m = |pixel: &[u8]| {
        let value = number.read(pixel, is_big_endian);
        let is_return = value.is_finite() && !(number == Number::U16 && value == 0.0);
        if is_return { (value * unit_m) as f32 } else { NO_RETURN_M as f32 }
    };
    let of_rows = data.chunks(step).take(rows).flat_map(|of_row| of_row[..row].chunks_exact(number.size()));
    let channel = Channel { name: "Z".to_owned(), samples: Samples::F32(of_rows.map(depth_m).collect()) };
    let attributes = BTreeMap::from([
        ("ros:frame_id".to_owned(), header.frame_id.clone()),
        ("ros:stamp_s".to_owned(), seconds(header.stamp_ns)),
        ("ros:encoding".to_owned(), encoding),
    ]);
    let image = Image { rows, columns, channels: vec![channel] };
    Ok(([rows, columns], Content::Depth(Part { name: String::new(), image, attributes })))
}

/// The fields of a message that are not read yet.
struct Fields<'a> {
    bytes: &'a [u8],
    at: usize,
    is_big_endian: bool,
    is_ros1: bool,
}

impl<'a> Fields<'a> {
    fn new(encoding: &str, bytes: &'a [u8]) -> Result<Self, ReadError> {
        match encoding {
            "ros1" => Ok(Self { bytes, at: 0, is_big_endian: false, is_ros1: true }),
            "cdr" => {
                let Some(([_, kind, _, _], body)) = bytes.split_first_chunk::<4>() else {
                    return Err(ended());
                };
                if *kind > 1 {
                    return Err(ReadError::new(format!(
                        "its messages are in the representation {kind} of CDR, and plain CDR is read"
                    )));
                }
                Ok(Self { bytes: body, at: 0, is_big_endian: *kind == 0, is_ros1: false })
            }
            other => Err(ReadError::new(format!(
                "its messages are in {other:?}, and \"cdr\" and \"ros1\" are read"
            ))),
        }
    }

    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let taken = self.bytes.get(self.at..self.at.checked_add(count)?)?;
        self.at += count;
        Some(taken)
    }

    fn number<const N: usize>(&mut self) -> Option<[u8; N]> {
        if !self.is_ros1 {
            self.at = self.at.checked_next_multiple_of(N)?;
        }
        let mut bytes: [u8; N] = self.take(N)?.try_into().ok()?;
        if self.is_big_endian {
            bytes.reverse();
        }
        Some(bytes)
    }

    fn u8(&mut self) -> Option<u8> {
        self.number().map(u8::from_le_bytes)
    }

    fn bool(&mut self) -> Option<bool> {
        self.u8().map(|byte| byte != 0)
    }

    fn u32(&mut self) -> Option<u32> {
        self.number().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Option<u64> {
        self.number().map(u64::from_le_bytes)
    }

    /// Bytes behind their number.
    fn sequence(&mut self) -> Option<&'a [u8]> {
        let length = self.u32()?;
        self.take(length as usize)
    }

    /// A text, which has a closing zero in CDR.
    fn text(&mut self) -> Option<String> {
        let text = self.sequence()?;
        let text = text.strip_suffix(b"\0").filter(|_| !self.is_ros1).unwrap_or(text);
        String::from_utf8(text.to_vec()).ok()
    }

    /// What follows.
    fn rest(&self) -> &'a [u8] {
        self.bytes.get(self.at..).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// How a message is encoded.
    #[derive(Clone, Copy, Debug)]
    enum Cdr {
        Little,
        Big,
        Ros1,
    }

    /// A message that is written.
    struct Writer {
        cdr: Cdr,
        bytes: Vec<u8>,
    }

    impl Writer {
        /// A message with a header: 7.5 s, in the frame `top`.
        fn new(cdr: Cdr) -> Self {
            let mut writer = Self { cdr, bytes: Vec::new() };
            if matches!(cdr, Cdr::Ros1) {
                writer.number(&3_u32.to_be_bytes());
            }
            [7, 500_000_000].into_iter().for_each(|part| writer.u32(part));
            writer.text("top");
            writer
        }

        /// Adds a number, whose first byte is the most significant.
        fn number(&mut self, big: &[u8]) {
            if !matches!(self.cdr, Cdr::Ros1) {
                self.bytes.resize(self.bytes.len().next_multiple_of(big.len()), 0xaa);
            }
            match self.cdr {
                Cdr::Big => self.bytes.extend(big),
                Cdr::Little | Cdr::Ros1 => self.bytes.extend(big.iter().rev()),
            }
        }

        fn u32(&mut self, value: u32) {
            self.number(&value.to_be_bytes());
        }

        fn sequence(&mut self, bytes: &[u8]) {
            self.u32(bytes.len() as u32);
            self.bytes.extend(bytes);
        }

        fn text(&mut self, text: &str) {
            match self.cdr {
                Cdr::Ros1 => self.sequence(text.as_bytes()),
                _ => self.sequence(&[text.as_bytes(), b"\0"].concat()),
            }
        }

        fn read(&self, kind: Kind) -> Result<Message, ReadError> {
            let (encoding, head): (_, &[u8]) = match self.cdr {
                Cdr::Little => ("cdr", &[0, 1, 0, 0]),
                Cdr::Big => ("cdr", &[0, 0, 0, 0]),
                Cdr::Ros1 => ("ros1", &[]),
            };
            read_message(kind, encoding, &[head, &self.bytes].concat(), 1 << 20)
        }
    }

    const EACH: [Cdr; 3] = [Cdr::Little, Cdr::Big, Cdr::Ros1];

    /// A cloud of two rows of two points of 16 bytes, with 3 bytes behind each row: a short, a byte that is not named, two floats as one field,
    /// and an integer of 8 bits. `big` is the order of the data's bytes, whatever the message's own is.
    fn cloud(cdr: Cdr, big: bool, change: impl Fn(&mut [u32; 5])) -> Writer {
        let mut data = Vec::new();
        for (index, _) in [0; 4].iter().enumerate() {
            let (short, floats) = (index as i16 - 2, [index as f32 + 0.5, f32::NAN]);
            let order = |mut bytes: Vec<u8>| {
                if !big {
                    bytes.reverse();
                }
                bytes
            };
            data.extend(order(short.to_be_bytes().to_vec()));
            data.extend([0xbb, 0xbb]);
            floats.iter().for_each(|float| data.extend(order(float.to_be_bytes().to_vec())));
            data.extend([200 + index as u8, 0xbb, 0xbb, 0xbb]);
            if index % 2 == 1 {
                data.extend([0xcc; 3]);
            }
        }
        // The size, the steps, and the count of the pair.
        let mut numbers = [2, 2, 16, 35, 2];
        change(&mut numbers);
        let [height, width, step, row_step, pair] = numbers;
        let mut writer = Writer::new(cdr);
        [height, width, 3].into_iter().for_each(|number| writer.u32(number));
        for (name, offset, datatype, count) in [("s", 0, 3, 1), ("pair", 4, 7, pair), ("b", 12, 2, 0)] {
            writer.text(name);
            writer.u32(offset);
            writer.number(&[datatype]);
            writer.u32(count);
        }
        writer.number(&[u8::from(big)]);
        [step, row_step].into_iter().for_each(|number| writer.u32(number));
        writer.sequence(&data);
        writer.number(&[0]);
        writer
    }

    #[test]
    fn clouds_of_any_layout_are_read() {
        for (cdr, big) in EACH.into_iter().flat_map(|cdr| [(cdr, false), (cdr, true)]) {
            let message = cloud(cdr, big, |_| {}).read(Kind::PointCloud2).unwrap();
            assert_eq!(
                (message.stamp_ns, message.frame_id.as_str(), message.size),
                (7_500_000_000, "top", [2, 2])
            );
            let Content::Cloud(cloud) = message.content else { panic!("{cdr:?}") };
            let kinds: Vec<_> = cloud.fields.iter().map(|field| (field.name.as_str(), field.kind)).collect();
            assert_eq!(kinds, [("s", "short"), ("pair[0]", "float"), ("pair[1]", "float"), ("b", "uchar")]);
            assert_eq!(cloud.field("s").unwrap(), [-2.0, -1.0, 0.0, 1.0]);
            assert_eq!(cloud.field("pair[0]").unwrap(), [0.5, 1.5, 2.5, 3.5]);
            assert!(cloud.field("pair[1]").unwrap().iter().all(|value| value.is_nan()));
            assert_eq!(cloud.field("b").unwrap(), [200.0, 201.0, 202.0, 203.0]);
            assert_eq!(cloud.comments, ["frame: top", "stamp: 7.500000000 s", "size: 2 rows of 2 points"]);
        }
    }

    #[test]
    fn one_row_may_have_any_step_and_no_point_any_size() {
        let points =
            |change: fn(&mut [u32; 5])| match cloud(Cdr::Little, false, change).read(Kind::PointCloud2) {
                Ok(Message { content: Content::Cloud(cloud), .. }) => cloud.points,
                other => panic!("{other:?}"),
            };
        assert_eq!(points(|numbers| (numbers[0], numbers[3]) = (1, 7)), 2);
        assert_eq!(points(|numbers| (numbers[0], numbers[1]) = (0, u32::MAX)), 0);
    }

    #[test]
    fn layouts_that_contradict_themselves_are_told() {
        let of = |change: fn(&mut [u32; 5])| {
            cloud(Cdr::Big, false, change).read(Kind::PointCloud2).unwrap_err().to_string()
        };
        assert_eq!(
            of(|numbers| numbers[3] = 31),
            "its row_step of 31 bytes is less than 2 points of 16 bytes"
        );
        assert_eq!(of(|numbers| numbers[0] = 3), "it is cut short: its header promises 6 points");
        assert_eq!(of(|numbers| numbers[4] = 4), "its field \"pair\" lies outside of its points of 16 bytes");
        assert_eq!(
            of(|numbers| numbers[4] = u32::MAX),
            "its field \"pair\" lies outside of its points of 16 bytes"
        );
        assert_eq!(of(|numbers| numbers[2] = 0), "its field \"s\" lies outside of its points of 0 bytes");
        assert!(of(|numbers| (numbers[0], numbers[3]) = (u32::MAX, u32::MAX)).starts_with("it is cut short"));
        let mut short = cloud(Cdr::Little, false, |_| {});
        short.bytes.truncate(40);
        assert_eq!(
            short.read(Kind::PointCloud2).unwrap_err().to_string(),
            "a message ends before its last field"
        );
        let other = |encoding: &str, head: [u8; 4]| {
            read_message(Kind::Image, encoding, &head, 9).unwrap_err().to_string()
        };
        assert_eq!(other("json", [0; 4]), "its messages are in \"json\", and \"cdr\" and \"ros1\" are read");
        assert_eq!(
            other("cdr", [0, 7, 0, 0]),
            "its messages are in the representation 7 of CDR, and plain CDR is read"
        );
    }

    /// A CustomMsg of two points.
    fn livox(cdr: Cdr) -> Writer {
        let mut writer = Writer::new(cdr);
        writer.number(&9_000_000_000_u64.to_be_bytes());
        writer.u32(2);
        [4, 0, 0, 0].into_iter().for_each(|byte| writer.number(&[byte]));
        writer.u32(2);
        for index in 0..2_u8 {
            writer.u32(100 + u32::from(index));
            [1.5_f32, -2.5, 0.25].into_iter().for_each(|axis| writer.number(&axis.to_be_bytes()));
            [250 + index, 16, index].into_iter().for_each(|byte| writer.number(&[byte]));
        }
        writer
    }

    #[test]
    fn the_points_of_livox_are_read_with_all_that_they_have() {
        for cdr in EACH {
            let message = livox(cdr).read(Kind::CustomMsg).unwrap();
            let Content::Cloud(cloud) = message.content else { panic!("{cdr:?}") };
            let expected: [(&str, [f64; 2]); 7] = [
                ("offset_time", [100.0, 101.0]),
                ("x", [1.5; 2]),
                ("y", [-2.5; 2]),
                ("z", [0.25; 2]),
                ("reflectivity", [250.0, 251.0]),
                ("tag", [16.0; 2]),
                ("line", [0.0, 1.0]),
            ];
            assert!(
                expected.iter().all(|(name, values)| cloud.field(name).unwrap() == values),
                "{cdr:?}: {cloud:?}"
            );
            assert_eq!(cloud.comments[2], "timebase: 9000000000 ns");
            let mut short = livox(cdr);
            short.bytes.pop();
            assert!(short.read(Kind::CustomMsg).unwrap_err().to_string().starts_with("it is cut short"));
        }
    }

    /// An image of two rows of two pixels, with two bytes behind each row.
    fn image(cdr: Cdr, encoding: &str, big: u8, pixels: [&[u8]; 4]) -> Writer {
        let mut writer = Writer::new(cdr);
        [2, 2].into_iter().for_each(|side| writer.u32(side));
        writer.text(encoding);
        writer.number(&[big]);
        writer.u32(2 * pixels[0].len() as u32 + 2);
        let [a, b, c, d] = pixels;
        writer.sequence(&[a, b, &[9; 2], c, d, &[9; 2]].concat());
        writer
    }

    #[test]
    fn depth_is_in_metres_and_nothing_is_infinite() {
        let of = |writer: Writer| match writer.read(Kind::Image).unwrap().content {
            Content::Depth(part) => part.image.f32("Z").unwrap().to_vec(),
            Content::Cloud(_) => panic!("a cloud"),
        };
        let millimetres = [0, 1, 1500, 65535].map(u16::to_be_bytes);
        let metres = [f32::NAN, 0.5, f32::NEG_INFINITY, 1e9].map(f32::to_le_bytes);
        for cdr in EACH {
            let found = of(image(cdr, "16UC1", 1, millimetres.each_ref().map(|bytes| &bytes[..])));
            assert_eq!(found, [f32::INFINITY, 0.001, 1.5, 65.535]);
            let found = of(image(cdr, "32FC1", 0, metres.each_ref().map(|bytes| &bytes[..])));
            assert_eq!(found, [f32::INFINITY, 0.5, f32::INFINITY, 1e9]);
        }
        let colour = image(Cdr::Little, "rgb8", 0, [&[1; 3]; 4]).read(Kind::Image).unwrap_err();
        assert_eq!(colour.to_string(), "its images are \"rgb8\", and depth is \"32FC1\" or \"16UC1\"");
        let narrow = image(Cdr::Little, "32FC1", 0, [&[1; 2]; 4]).read(Kind::Image).unwrap_err();
        assert_eq!(narrow.to_string(), "its 12 bytes are no 2 rows of 2 pixels in steps of 6 bytes");
    }

    #[test]
    fn types_are_known_as_both_kinds_of_ros_write_them() {
        assert_eq!(Kind::of("sensor_msgs/msg/PointCloud2"), Some(Kind::PointCloud2));
        assert_eq!(Kind::of("sensor_msgs/Image"), Some(Kind::Image));
        assert_eq!(Kind::of("livox_ros_driver2/msg/CustomMsg"), Some(Kind::CustomMsg));
        assert_eq!(["sensor_msgs/msg/PointCloud", "CustomMsg", "a/CustomMsg", ""].map(Kind::of), [None; 4]);
        assert_eq!(
            [0, -1, -1_500_000_000, i64::MIN].map(seconds),
            ["0.000000000", "-0.000000001", "-1.500000000", "-9223372036.854775808"]
        );
    }

    proptest! {
        #[test]
        fn broken_bytes_are_an_error_or_a_message(kind in 0..3_usize, cdr in 0..3_usize, at in 0.0..1.0, value: u8, keep in 0.0..2.0) {
            let mut writer = match kind {
                0 => cloud(EACH[cdr], false, |_| {}),
                1 => livox(EACH[cdr]),
                _ => image(EACH[cdr], "32FC1", 0, [&[1; 4]; 4]),
            };
            let at = (at * writer.bytes.len() as f64) as usize;
            writer.bytes[at] = value;
            writer.bytes.truncate((keep * writer.bytes.len() as f64) as usize);
            if let Ok(message) = writer.read([Kind::PointCloud2, Kind::CustomMsg, Kind::Image][kind]) {
                match message.content {
                    Content::Cloud(cloud) => prop_assert!(cloud.fields.iter().all(|field| field.values.len() == cloud.points)),
                    Content::Depth(part) => prop_assert_eq!(part.image.channels[0].samples.len(), part.image.pixels()),
                }
            }
        }
    }
}
