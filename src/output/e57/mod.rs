//! Encoding of point clouds as E57 (ASTM E2807), the format that programs for terrestrial laser scans exchange.
//!
//! ```text
//! mod     the declaration, and the description of a scan in XML
//! columns the values of points as streams of bits, in packets
//! pages   the pages of the file, with their checksums
//! ```
//!
//! The identifiers of the file and of its scan, which the standard wants to be unique, are made of a hash of all else that the file
//! holds. It has no times of creation, because the same frame gives the same bytes always.

mod columns;
mod pages;

use std::fmt::Write as _;

use glam::DQuat;

use self::columns::{Column, in_packets};
pub(in crate::output) use self::pages::crc32c;
use super::crs::{CRS, check_crs, crs_of};
use super::format::{Content, EncodeError, Field, FormatSpec, Kind, field};
use super::options::{OptionSpec, OptionValues, Options};
use super::sensor_frame::{CloudFrame, SensorFrame};
use crate::sensor::Sensor;

/// The fields in their order. A kind is the type of E57.
static FIELDS: [Field; 8] = [
    field(
        "cartesianX, cartesianY, cartesianZ",
        "Float",
        "m; single precision, and double in the world's frame",
    ),
    field(
        "cartesianInvalidState",
        "Integer",
        "0: without it, pye57's `read_scan` has to be told that it is missing",
    ),
    field(
        "intensity",
        "Float, single",
        "the EXR's; `intensityLimits` has 0 and the top of the scale, or the largest value",
    ),
    field("rowIndex", "Integer", "the row of the range image, from 0"),
    field("columnIndex", "Integer", "the column of the range image, from 0"),
    field("timeStamp", "Float, double", "with `returns`: s from the frame's start"),
    field("returnIndex", "Integer", "with `returns`: from 0"),
    field("returnCount", "Integer", "with `returns`"),
];

const RETURNS: OptionSpec = OptionSpec {
    name: "returns",
    about: "Whether each point has `timeStamp`, `returnIndex` and `returnCount`, too. pye57 reads such a file with \
            `read_scan_raw(0, ignore_unsupported_fields=True)` only.",
    values: OptionValues::Flag { default: false },
};

/// The points of a frame, row by row of the range image. The returns of a pixel follow each other, and misses are left out.
pub(super) static FORMAT: FormatSpec = FormatSpec {
    name: "e57",
    ending: "e57",
    about: "E57 point clouds with their pose in the world",
    content: Content::Points(&FIELDS),
    read_by: "pye57",
    options: &[RETURNS, CRS],
    check_options: check_crs,
    // The columns, the content and the pages are in memory at the same time.
    encoding_bytes_a_ray: |sensor, options| 3 * bytes_a_ray(sensor, options),
    file_bytes_a_ray: bytes_a_ray,
    has_even_steps: true,
    kind: Kind::File(encode),
    ..FormatSpec::PLAIN
};

/// At most: coordinates in double precision, and indices of 32 bits.
fn bytes_a_ray(sensor: &Sensor, options: &Options) -> u64 {
    let returns = if options.is_set(&RETURNS) { 8 + 2 * 4 } else { 0 };
    (3 * 8 + 1 + 4 + 2 * 4 + returns) * sensor.most_returns() as u64
}

/// The bytes of the file's header, and of that of its section of points.
const HEADER_BYTES: u64 = 48;
const SECTION_HEADER_BYTES: u64 = 32;

fn encode(frame: &SensorFrame, options: &Options) -> Result<Vec<u8>, EncodeError> {
    let scan = Scan::of(frame, options)?;
    let packets = in_packets(&scan.columns, scan.points);
    let section_bytes = SECTION_HEADER_BYTES + packets.len() as u64;
    let mut content = vec![0; HEADER_BYTES as usize];
    content.extend_from_slice(&[1, 0, 0, 0, 0, 0, 0, 0]); // a section of points
    content.extend_from_slice(&section_bytes.to_le_bytes());
    content.extend_from_slice(&pages::place_of(HEADER_BYTES + SECTION_HEADER_BYTES).to_le_bytes());
    content.extend_from_slice(&[0; 8]); // there is no index
    content.extend_from_slice(&packets);
    let (xml_start, crs) = (content.len() as u64, crs_of(options));
    let mut hasher = blake3::Hasher::new();
    hasher.update(&content).update(describe(frame, &scan, crs, ["", ""]).as_bytes());
    let hash = hasher.finalize();
    let [of_file, of_scan] = [0, 16].map(|at| guid(&hash.as_bytes()[at..at + 16]));
    let xml = describe(frame, &scan, crs, [&of_file, &of_scan]);
    content.extend_from_slice(xml.as_bytes());
    let header = [
        u64::from_le_bytes(*b"ASTM-E57"),
        1, // the version: 1.0
        pages::file_bytes(content.len() as u64),
        pages::place_of(xml_start),
        xml.len() as u64,
        pages::PAGE_SIZE,
    ];
    content[..HEADER_BYTES as usize].copy_from_slice(header.map(u64::to_le_bytes).as_flattened());
    Ok(pages::in_pages(&content))
}

/// The points of a frame, by columns.
struct Scan {
    points: usize,
    columns: Vec<Column>,
    /// The least and the largest coordinate of each axis, in metres. `None` if there are no points.
    bounds_m: Option<[[f64; 2]; 3]>,
    most_intensity: f64,
    /// The least and the largest row, column and number of a return.
    indices: [[u32; 2]; 3],
}

impl Scan {
    fn of(frame: &SensorFrame, options: &Options) -> Result<Self, EncodeError> {
        let (points, image) = (frame.frame.return_count(), frame.frame);
        // The world may be far from its origin, and a sensor sees nothing that is far from itself.
        let is_double = frame.cloud_frame == CloudFrame::World;
        let index = |name, count: usize| Column::integers(name, count.saturating_sub(1) as u64, points);
        let mut axes = ["cartesianX", "cartesianY", "cartesianZ"].map(|name| {
            if is_double { Column::doubles(name, points) } else { Column::singles(name, points) }
        });
        let mut invalid = Column::integers("cartesianInvalidState", 2, points);
        let mut intensity = Column::singles("intensity", points);
        let [mut row, mut column] = [index("rowIndex", image.rows()), index("columnIndex", image.columns())];
        let most = frame.capture.sensor.most_returns().max(1);
        let mut time = Column::doubles("timeStamp", points);
        let [mut number, mut of] = [index("returnIndex", most), index("returnCount", most + 1)];
        let mut bounds_m = [[f64::INFINITY, f64::NEG_INFINITY]; 3];
        let mut indices = [[u32::MAX, 0]; 3];
        let mut most_intensity = 0.0_f64;
        let has_returns = options.is_set(&RETURNS);
        frame.each_point(|point| {
            let coordinates_m =
                if is_double { point.exact_m.to_array() } else { point.position_m.map(f64::from) };
            for ((axis, bounds), value_m) in axes.iter_mut().zip(&mut bounds_m).zip(coordinates_m) {
                axis.push(value_m);
                *bounds = [bounds[0].min(value_m), bounds[1].max(value_m)];
            }
            invalid.push_index(0);
            intensity.push(f64::from(point.hit.intensity));
            most_intensity = most_intensity.max(f64::from(point.hit.intensity));
            let own = [point.row, point.column, point.number].map(|index| index as u32);
            for (range, index) in indices.iter_mut().zip(own) {
                *range = [range[0].min(index), range[1].max(index)];
            }
            row.push_index(own[0]);
            column.push_index(own[1]);
            if has_returns {
                time.push(point.time_s);
                number.push_index(own[2]);
                of.push_index(point.of as u32);
            }
            Ok(())
        })?;
        let mut columns: Vec<_> = axes.into_iter().chain([invalid, intensity, row, column]).collect();
        if has_returns {
            columns.extend([time, number, of]);
        }
        let bounds_m = (points > 0).then_some(bounds_m);
        Ok(Self { points, columns, bounds_m, most_intensity, indices })
    }
}

/// The description of the file, in XML.
fn describe(frame: &SensorFrame, scan: &Scan, crs: Option<&str>, [of_file, of_scan]: [&str; 2]) -> String {
    let mut xml = String::from(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <e57Root type=\"Structure\" xmlns=\"http://www.astm.org/COMMIT/E57/2010-e57-v1.0\">\n",
    );
    text(&mut xml, "formatName", "ASTM E57 3D Imaging Data File");
    text(&mut xml, "guid", of_file);
    xml.push_str(
        "<versionMajor type=\"Integer\">1</versionMajor>\n<versionMinor type=\"Integer\">0</versionMinor>\n",
    );
    text(&mut xml, "e57LibraryVersion", "beamcast");
    if let Some(crs) = crs {
        text(&mut xml, "coordinateMetadata", crs);
    }
    xml.push_str(
        "<data3D type=\"Vector\" allowHeterogeneousChildren=\"1\">\n<vectorChild type=\"Structure\">\n",
    );
    text(&mut xml, "guid", of_scan);
    text(&mut xml, "name", &format!("{} {:06}", frame.name, frame.capture.frame));
    if let Some(compensation) = frame.compensation() {
        text(&mut xml, "description", &compensation);
    }
    limits(&mut xml, frame, scan);
    pose(&mut xml, frame);
    let place = pages::place_of(HEADER_BYTES);
    let _ = writeln!(
        xml,
        "<points type=\"CompressedVector\" fileOffset=\"{place}\" recordCount=\"{}\">\n<prototype type=\"Structure\">",
        scan.points
    );
    scan.columns.iter().for_each(|column| column.describe(&mut xml));
    xml.push_str(
        "</prototype>\n<codecs type=\"Vector\" allowHeterogeneousChildren=\"1\"/>\n</points>\n</vectorChild>\n</data3D>\n\
         <images2D type=\"Vector\" allowHeterogeneousChildren=\"1\"/>\n</e57Root>\n",
    );
    xml
}

/// The bounds of a scan's values.
fn limits(xml: &mut String, frame: &SensorFrame, scan: &Scan) {
    let Some(bounds_m) = scan.bounds_m else { return };
    xml.push_str("<cartesianBounds type=\"Structure\">\n");
    for (axis, [least, most]) in ["x", "y", "z"].into_iter().zip(bounds_m) {
        float(xml, &format!("{axis}Minimum"), least);
        float(xml, &format!("{axis}Maximum"), most);
    }
    xml.push_str("</cartesianBounds>\n<indexBounds type=\"Structure\">\n");
    for (what, [least, most]) in ["row", "column", "return"].into_iter().zip(scan.indices) {
        let _ = writeln!(xml, "<{what}Minimum type=\"Integer\">{least}</{what}Minimum>");
        let _ = writeln!(xml, "<{what}Maximum type=\"Integer\">{most}</{what}Maximum>");
    }
    xml.push_str("</indexBounds>\n<intensityLimits type=\"Structure\">\n");
    let receiver = &frame.capture.sensor.measurement.receiver;
    let top = receiver.as_ref().map_or(1.0, |receiver| receiver.intensity.top());
    float(xml, "intensityMinimum", 0.0);
    float(
        xml,
        "intensityMaximum",
        if top.is_finite() { top.max(scan.most_intensity) } else { scan.most_intensity },
    );
    xml.push_str("</intensityLimits>\n");
}

/// The motion from the points into the world. The scalar part of the rotation is not negative, as the standard wants it.
fn pose(xml: &mut String, frame: &SensorFrame) {
    let world_from_points = frame.world_from_points();
    let rotation = DQuat::from_mat3(&world_from_points.rotation);
    let rotation = if rotation.w < 0.0 { -rotation } else { rotation };
    xml.push_str("<pose type=\"Structure\">\n<rotation type=\"Structure\">\n");
    for (name, value) in [("w", rotation.w), ("x", rotation.x), ("y", rotation.y), ("z", rotation.z)] {
        float(xml, name, value);
    }
    xml.push_str("</rotation>\n<translation type=\"Structure\">\n");
    for (name, value) in ["x", "y", "z"].into_iter().zip(world_from_points.translation.to_array()) {
        float(xml, name, value);
    }
    xml.push_str("</translation>\n</pose>\n");
}

/// A number with all its digits.
fn float(xml: &mut String, name: &str, value: f64) {
    // Adding 0 makes a negative zero positive.
    let _ = writeln!(xml, "<{name} type=\"Float\">{:?}</{name}>", value + 0.0);
}

/// A text, whatever is in it.
fn text(xml: &mut String, name: &str, content: &str) {
    let content = content.replace("]]>", "]]]]><![CDATA[>");
    let _ = writeln!(xml, "<{name} type=\"String\"><![CDATA[{content}]]></{name}>");
}

/// 16 bytes of a hash as an identifier (RFC 9562, version 8).
fn guid(hash: &[u8]) -> String {
    let mut text = String::from("{");
    for (index, byte) in hash.iter().enumerate() {
        let byte = match index {
            6 => 0x80 | byte & 0x0f,
            8 => 0x80 | byte & 0x3f,
            _ => *byte,
        };
        if [4, 6, 8, 10].contains(&index) {
            text.push('-');
        }
        let _ = write!(text, "{byte:02x}");
    }
    text + "}"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_identifier_is_that_of_its_version() {
        assert_eq!(guid(&[0xff; 16]), "{ffffffff-ffff-8fff-bfff-ffffffffffff}");
        assert_eq!(guid(&[0; 16]), "{00000000-0000-8000-8000-000000000000}");
    }

    #[test]
    fn no_text_ends_its_own_section() {
        let mut xml = String::new();
        text(&mut xml, "name", "a]]><b>");
        assert_eq!(xml, "<name type=\"String\"><![CDATA[a]]]]><![CDATA[><b>]]></name>\n");
    }
}
