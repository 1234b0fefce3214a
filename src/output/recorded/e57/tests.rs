//! Tests of the reader: files of the writer of this program and of another, values that a description allows, and what is broken.

use proptest::prelude::*;

use super::super::number::Number;
use super::bits::Encoding;
use super::xml::Element;
use super::*;
use crate::output::e57::crc32c;

/// A file of sections and a description, in pages of 1024 bytes. `describe` is given the place of each section in the file.
fn file(sections: &[Vec<u8>], describe: impl Fn(&[u64]) -> String) -> Vec<u8> {
    let place_of = |content: usize| (content / 1020 * 1024 + content % 1020) as u64;
    let mut content = vec![0; 48];
    let mut places = Vec::new();
    for packets in sections {
        places.push(place_of(content.len()));
        let mut header = [0; 32];
        header[0] = 1;
        header[8..16].copy_from_slice(&(32 + packets.len() as u64).to_le_bytes());
        header[16..24].copy_from_slice(&place_of(content.len() + 32).to_le_bytes());
        content.extend_from_slice(&header);
        content.extend_from_slice(packets);
    }
    let (xml_place, xml) = (place_of(content.len()), describe(&places));
    content.extend_from_slice(xml.as_bytes());
    let length = content.len().div_ceil(1020) as u64 * 1024;
    let header = [u64::from_le_bytes(*b"ASTM-E57"), 1, length, xml_place, xml.len() as u64, 1024];
    content[..48].copy_from_slice(header.map(u64::to_le_bytes).as_flattened());
    let mut bytes = Vec::new();
    for page in content.chunks(1020) {
        let start = bytes.len();
        bytes.extend_from_slice(page);
        bytes.resize(start + 1020, 0);
        let sum = crc32c(&bytes[start..]);
        bytes.extend_from_slice(&sum.to_be_bytes());
    }
    bytes
}

/// A packet of these streams.
fn packet(streams: &[&[u8]]) -> Vec<u8> {
    let mut bytes = vec![1, 0, 0, 0];
    bytes.extend_from_slice(&(streams.len() as u16).to_le_bytes());
    streams.iter().for_each(|stream| bytes.extend_from_slice(&(stream.len() as u16).to_le_bytes()));
    streams.iter().for_each(|stream| bytes.extend_from_slice(stream));
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    let length = (bytes.len() - 1) as u16;
    bytes[2..4].copy_from_slice(&length.to_le_bytes());
    bytes
}

fn described(scans: &[(u64, u64, &str, &str)]) -> String {
    let scan = |(place, count, prototype, more): &(u64, u64, &str, &str)| {
        format!(
            "<vectorChild type=\"Structure\"><name type=\"String\"><![CDATA[a & b]]></name>{more}<points type=\"CompressedVector\" \
             fileOffset=\"{place}\" recordCount=\"{count}\"><prototype type=\"Structure\">{prototype}</prototype></points></vectorChild>"
        )
    };
    let scans: String = scans.iter().map(scan).collect();
    format!(
        "<?xml version=\"1.0\"?><e57Root type=\"Structure\"><data3D type=\"Vector\">{scans}</data3D></e57Root>"
    )
}

const SCALED: &str = "<cartesianX type=\"ScaledInteger\" minimum=\"-8\" maximum=\"7\" scale=\"0.5\" offset=\"100\"/>\
    <cartesianY type=\"Float\" precision=\"single\"/><cartesianZ type=\"Integer\" minimum=\"3\" maximum=\"3\"/>\
    <colorRed type=\"Integer\" minimum=\"0\" maximum=\"255\"/>";

/// Three points: x of four bits in two packets, y, z without a bit, and a colour. An index and a packet to be passed over lie between.
fn scaled() -> Vec<u8> {
    let y = [1.5_f32, -2.0, 0.25].map(f32::to_le_bytes);
    let first = packet(&[&[0xf0], &y.as_flattened()[..6], &[], &[9]]);
    let second = packet(&[&[0x03], &y.as_flattened()[6..], &[], &[8, 7]]);
    let index = [&[0, 0, 15, 0][..], &[0; 12]].concat();
    let ignored = vec![2, 0, 3, 0];
    [first, index, ignored, second].concat()
}

const TURNED: &str = "<pose type=\"Structure\"><rotation type=\"Structure\"><w type=\"Float\">0</w><x type=\"Float\"/><y type=\"Float\"/>\
    <z type=\"Float\">1</z></rotation><translation type=\"Structure\"><x type=\"Float\">10</x><y type=\"Float\">0</y>\
    <z type=\"Float\">0</z></translation></pose>";

#[test]
fn values_are_what_their_streams_and_their_description_say() {
    let bytes = file(&[scaled()], |places| described(&[(places[0], 3, SCALED, TURNED)]));
    let cloud = read_e57(&bytes, u64::MAX).unwrap();
    let kinds: Vec<_> = cloud.fields.iter().map(|field| (field.name.as_str(), field.kind)).collect();
    assert_eq!(kinds, [("x", "double"), ("y", "float"), ("z", "uchar"), ("red", "uchar")]);
    // −8 + 0, −8 + 15, −8 + 3, in steps of 0.5 from 100.
    assert_eq!(cloud.field("x").unwrap(), [96.0, 103.5, 97.5]);
    assert_eq!(cloud.field("y").unwrap(), [1.5, -2.0, 0.25]);
    assert_eq!(cloud.field("z").unwrap(), [3.0; 3]);
    assert_eq!(cloud.field("red").unwrap(), [9.0, 8.0, 7.0]);
    assert_eq!(cloud.comments, ["scan: a & b", "VIEWPOINT 10.0 0.0 0.0 0.0 0.0 0.0 1.0"]);
}

#[test]
fn several_scans_are_carried_into_the_files_frame() {
    let bytes = file(&[scaled(), scaled()], |places| {
        described(&[
            (places[0], 3, SCALED, TURNED),
            (places[1], 2, &SCALED.replace("colorRed", "intensity"), ""),
        ])
    });
    let cloud = read_e57(&bytes, u64::MAX).unwrap();
    assert_eq!(cloud.points, 5);
    // Half a turn about z, and 10 m along x.
    assert_eq!(cloud.field("x").unwrap(), [-86.0, -93.5, -87.5, 96.0, 103.5]);
    assert_eq!(cloud.field("y").unwrap(), [-1.5, 2.0, -0.25, 1.5, -2.0]);
    assert_eq!(cloud.field("scan").unwrap(), [0.0, 0.0, 0.0, 1.0, 1.0]);
    assert!(cloud.field("red").is_none());
    assert_eq!(
        cloud.comments,
        ["frame: the file's, metres; 2 scans", "left out, because not all scans have them: red, intensity"]
    );
}

#[test]
fn spherical_coordinates_become_cartesian_and_invalid_points_have_no_place() {
    let prototype = "<sphericalRange type=\"Float\"/><sphericalAzimuth type=\"Float\"/><sphericalElevation type=\"Float\"/>\
        <sphericalInvalidState type=\"Integer\" minimum=\"0\" maximum=\"2\"/>";
    let quarter = std::f64::consts::FRAC_PI_2;
    let stream = |values: [f64; 3]| values.map(f64::to_le_bytes).as_flattened().to_vec();
    let (range, azimuth, elevation) =
        (stream([2.0, 3.0, 4.0]), stream([0.0, quarter, 0.0]), stream([0.0, 0.0, quarter]));
    let packets = packet(&[&range, &azimuth, &elevation, &[0b0010_0000]]);
    let bytes = file(&[packets], |places| described(&[(places[0], 3, prototype, "")]));
    let cloud = read_e57(&bytes, u64::MAX).unwrap();
    let at = |point: usize| ["x", "y", "z"].map(|axis| cloud.field(axis).unwrap()[point]);
    assert_eq!(at(0), [2.0, 0.0, 0.0]);
    // The cosine of the quarter turn in 64 bits is 6.1e-17.
    assert!(at(1)[0].abs() < 2e-16 && at(1)[1] == 3.0 && at(1)[2] == 0.0, "{:?}", at(1));
    assert!(at(2).iter().all(|value| value.is_nan()));
}

#[test]
fn integers_of_any_width_are_read() {
    for (least, most) in [(0, 1), (-5, 5), (0, 1 << 40), (i64::MIN, i64::MAX), (i64::MAX - 1, i64::MAX)] {
        let encoding = Encoding::Integer { least, most, scale: None };
        let (values, bits) = ([least, most, least, most, most], encoding.bits() as usize);
        let mut stream = vec![0_u8; (bits * values.len()).div_ceil(8)];
        for (index, value) in values.iter().enumerate() {
            let raw = value.wrapping_sub(least) as u64;
            for bit in (0..bits).filter(|bit| raw >> bit & 1 == 1) {
                stream[(index * bits + bit) / 8] |= 1 << ((index * bits + bit) % 8);
            }
        }
        assert_eq!(
            encoding.values(&stream, 5).unwrap(),
            values.map(|value| value as f64),
            "{least} to {most}"
        );
        assert!(encoding.values(&stream, 5 + 8).is_none());
    }
    assert_eq!(Encoding::Integer { least: 7, most: 7, scale: None }.bits(), 0);
    assert_eq!(Encoding::Integer { least: 0, most: 65_535, scale: None }.number(), Number::U16);
}

#[test]
fn what_is_broken_is_told() {
    let of = |count: u64, prototype: &str, more: &str, memory: u64| {
        let bytes = file(&[scaled()], |places| described(&[(places[0], count, prototype, more)]));
        read_e57(&bytes, memory).unwrap_err().to_string()
    };
    assert_eq!(of(4, SCALED, "", u64::MAX), "it is cut short: its description promises 4 points");
    assert_eq!(
        of(1 << 60, SCALED, "", 1 << 40).split(", more").next().unwrap(),
        "it takes 18446744073709551615 bytes of memory"
    );
    let constant = "<cartesianX type=\"Integer\" minimum=\"3\" maximum=\"3\"/>";
    assert_eq!(of(1 << 40, constant, "", u64::MAX), "its points have no fields, or none that differs");
    assert_eq!(
        of(1, "<a type=\"String\"/>", "", u64::MAX),
        "the type of its field \"a\" is none that is read"
    );
    let still = TURNED.replace(">1<", ">0<");
    assert_eq!(of(1, SCALED, &still, u64::MAX), "a scan's pose and rotation are not as they should be");
    // Packets of some kilobytes that all scans would walk through.
    let passed_over = [vec![2, 0, 0xff, 0xff], vec![0; 65_532], scaled()].concat();
    let overlapping = file(&[passed_over], |places| described(&[(places[0], 3, SCALED, ""); 3]));
    assert_eq!(read_e57(&overlapping, u64::MAX).unwrap_err().to_string(), "its sections of points overlap");
    let mut bytes = file(&[scaled()], |places| described(&[(places[0], 3, SCALED, "")]));
    bytes[60] ^= 1;
    assert_eq!(
        read_e57(&bytes, u64::MAX).unwrap_err().to_string(),
        "it is damaged: the checksum of page 0 is wrong"
    );
    bytes.truncate(900);
    assert!(read_e57(&bytes, u64::MAX).unwrap_err().to_string().starts_with("it is cut short"));
    assert_eq!(read_e57(b"ASTM-E57", 9).unwrap_err().to_string(), "this is no E57");
}

#[test]
fn a_description_is_neither_deep_nor_large_nor_does_it_declare_anything() {
    let deep = "<a>".repeat(40) + &"</a>".repeat(40);
    assert!(Element::parse(&deep).unwrap_err().to_string().ends_with("deeper than is read"));
    let large = format!("<a>{}</a>", "<b/>".repeat(600_000));
    assert!(Element::parse(&large).unwrap_err().to_string().ends_with("larger than is read"));
    assert!(Element::parse("<!DOCTYPE a [<!ENTITY b \"c\">]><a>&b;</a>").is_err());
    let element = Element::parse("<a k='&lt;1'>x&amp;<![CDATA[<y>]]><n/></a>").unwrap();
    assert_eq!(
        (element.text.as_str(), element.attribute("k"), element.number("n")),
        ("x&<y>", Some("<1"), Some(0.0))
    );
}

proptest! {
    /// The checksums of changed pages are made anew, so that what is behind them is reached.
    #[test]
    fn broken_bytes_are_an_error_or_a_cloud(at in 0.0..1.0, value: u8, keep in 0.0..2.0) {
        let mut bytes = file(&[scaled()], |places| described(&[(places[0], 3, SCALED, TURNED)]));
        let at = (at * bytes.len() as f64) as usize;
        bytes[at] = value;
        for page in bytes.chunks_exact_mut(1024) {
            let sum = crc32c(&page[..1020]).to_be_bytes();
            page[1020..].copy_from_slice(&sum);
        }
        bytes.truncate((keep * bytes.len() as f64) as usize);
        if let Ok(cloud) = read_e57(&bytes, 1 << 20) {
            prop_assert!(cloud.fields.iter().all(|field| field.values.len() == cloud.points));
        }
    }
}
