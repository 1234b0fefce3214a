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
            ("livox_ros_driver2" | "livox_ros_driver" | "livox_interfaces", "CustomMsg") => Some(Self::CustomMsg),
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
pub(super) fn read_message(kind: Kind, encoding: &str, bytes: &[u8], memory: u64) -> Result<Message, ReadError> {
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
    let needed = if points == 0 { Some(0) } else { (height - 1).checked_mul(row_step).and_then(|n| n.checked_add(row)) };
    if needed.is_none_or(|needed| needed > data.len()) {
        return Err(cut_short(points));
    }
    check_size(points, &columns, memory)?;
    let read = if points == 0 || height == 1 || row_step == row {
        read_records(data, points, step, &columns)?
    } else {
        let rows: Vec<u8> = data.chunks(row_step).take(height).flat_map(|of_row| &of_row[..row]).copied().collect();
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
            other => return Err(ReadError::new(format!("its field {name:?} is of the unknown datatype {other}"))),
        };
        // Some writers leave the count of single numbers out.
        let count = (*count).max(1) as usize;
        let end = count.checked_mul(number.size()).and_then(|bytes| bytes.checked_add(*offset as usize));
        if end.is_none_or(|end| end > step) {
            return Err(ReadError::new(format!("its field {name:?} lies outside of its points of {step} bytes")));
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
    let column =
        |(name, number, offset): (&str, Number, usize)| Column { name: Some(name.to_owned()), number, offset, is_big_endian };
    let columns = OF_CUSTOM.map(column);
    // A point begins at a multiple of 4 bytes, but nothing is filled behind the last one.
    let step = if fields.is_ros1 { CUSTOM_BYTES } else { CUSTOM_BYTES.next_multiple_of(4) };
    let body = fields.rest();
    if points > 0 && (points - 1).checked_mul(step).is_none_or(|before| body.len() < before.saturating_add(CUSTOM_BYTES)) {
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
            return Err(ReadError::new(format!("its images are {encoding:?}, and depth is \"32FC1\" or \"16UC1\"")));
        }
    };
    let row = columns.checked_mul(number.size()).filter(|row| *row <= step || rows == 0);
    let needed = row.and_then(|row| rows.saturating_sub(1).checked_mul(step)?.checked_add(row));
    let row = row.filter(|_| needed.is_some_and(|needed| needed <= data.len()) && rows > 0 && columns > 0);
    let row = row.ok_or_else(|| {
        ReadError::new(format!("its {} bytes are no {rows} rows of {columns} pixels, {step} bytes each", data.len()))
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
                let Some(([_, kind, _, _], body)) = bytes.split_first_chunk::<4>() else { return Err(ended()) };
                if *kind > 1 {
                    return Err(ReadError::new(format!("its messages are in the representation {kind} of CDR, and plain CDR is read")));
                }
                Ok(Self { bytes: body, at: 0, is_big_endian: *kind == 0, is_ros1: false })
            }
            other => Err(ReadError::new(format!("its messages are in {other:?}, and \"cdr\" and \"ros1\" are read"))),
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
