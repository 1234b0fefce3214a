//! The specification has no test vectors. Streams here were made with the reference encoder (meshoptimizer 1.3) from
//! what the tests give by formula.

use proptest::prelude::*;

use super::filters::{color_8, exponential};
use super::stream::{CUT_SHORT, TOO_LONG};
use super::*;

fn bytes(hex: &str) -> Vec<u8> {
    (0..hex.len()).step_by(2).map(|at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap()).collect()
}

fn attributes(hex: &str, count: usize, stride: usize) -> Vec<u8> {
    decode(&bytes(hex), count, stride, Mode::Attributes, Filter::None).unwrap()
}

const VERSION_0: &str = "a00a06666666666666666666000000000000051555555555000000070002060a0e12161a1e22262a2e32363aff\
    0000003e42464a000000000000000000000000000000000000000000000000000000000000ff0007";
const VERSION_1: &str = "a1b50206666666666666660f00060606060515555555550000000002060a0e12161a1e22262a2e32363a3e4246\
    4a0000000000000000000000000000000000000000ff000700";

#[test]
fn byte_deltas_of_both_versions() {
    let expected: Vec<u8> = (0..20_u32).flat_map(|i| [i * 3, 255 - i, i * i, 7].map(|b| b as u8)).collect();
    assert_eq!(attributes(VERSION_0, 20, 4), expected);
    assert_eq!(attributes(VERSION_1, 20, 4), expected);
}

#[test]
fn two_byte_deltas_beside_byte_deltas() {
    let hex = "a1779ae500585858585858585858585858585858585858585858585858585858585858585858585858585858152aaaaa\
        aaaaaaaaaaaaaa0000000d2945617d99b5d1ed0925415d7995b1cde905213d597591adc9e5011d3955718da9c5e1fd19\
        35250000055556aaaaff0303030333333344000000002a04444444444444444444444444444444444444440000000015\
        2aaaaaaaaaaaaaaaaaaa00001526666666666666666666000000b1b1b1b1b1b1b1b1b1b1b1b1b1b1b1b1b1b1b1b1b1b1\
        b1b1b1b1b1b1b1b1b1b1b1b1b1b1b1b1b1000000000000000000e803ffff0000803f0000c800010000";
    let mut expected = Vec::new();
    for i in 0..40_u32 {
        expected.extend((1000 + i * 300).to_le_bytes()[..2].iter());
        expected.extend((65535 - i * i * 7).to_le_bytes()[..2].iter());
        expected.extend((1.0 + i as f32 / 64.0).to_le_bytes());
        expected.extend([i as u8, (i & 1) as u8, 200, (i * 167) as u8]);
    }
    assert_eq!(attributes(hex, 40, 12), expected);
}

#[test]
fn exclusive_or_deltas_are_rotated_back() {
    let rotated_by_2 = "a13a0000050514142d2d50507d7db4b4f5f540409595f4f45d5dd0d04d4dd4d465650c11111122223333440000\
        00000000000000000000000000000000000000803f22";
    let rotated_by_7 = "a1ea0000010104040909101019192424313140405151646479799090a9a9c4c4e1e10000000000000000000000\
        00000000000000000000803f72";
    for (hex, factor) in [(rotated_by_2, 5_u32), (rotated_by_7, 8)] {
        let value = |i: u32| 0x3f80_0000 ^ if i % 2 == 1 { 0 } else { (i * i * factor) << 12 };
        let expected: Vec<u8> = (0..32).flat_map(|i| value(i).to_le_bytes()).collect();
        assert_eq!(attributes(hex, 32, 4), expected);
    }
}

#[test]
fn triangles_of_a_grid() {
    let hex = "e1fe1e100e100e100ece1e160e150e140ece1e140e140e140ece1e140e140e140e0f0a007687566778a9866589689801690000";
    let quad = |v: u16| [v, v + 1, v + 5, v + 5, v + 1, v + 6];
    let expected: Vec<u16> = (0..4).flat_map(|y| (0..4).flat_map(move |x| quad(5 * y + x))).collect();
    let decoded = decode(&bytes(hex), 96, 2, Mode::Triangles, Filter::None).unwrap();
    let decoded: Vec<u16> = decoded.as_chunks().0.iter().map(|&b| u16::from_le_bytes(b)).collect();
    // Encoders may begin a triangle at any of its corners.
    let from_least = |indices: &[u16]| -> Vec<[u16; 3]> {
        let least_first =
            |&[a, b, c]: &[u16; 3]| [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().unwrap();
        indices.as_chunks().0.iter().map(least_first).collect()
    };
    assert_eq!(from_least(&decoded), from_least(&expected));
}

/// Indices without any order, as the two streams below hold them.
fn scattered() -> Vec<u8> {
    let triangle = |i: u32| [i * i * 7 % 61, i * i * 7 % 61 + 1 + i % 3, 70000 + i * i * i];
    (0..30).flat_map(triangle).flat_map(u32::to_le_bytes).collect()
}

const SCATTERED_TRIANGLES: &str = "e1fefffffeffffffffffffffffffffffffffffffffffffffffffffffffffff0fe0c508ffd1c50804\
    d0c508ffa9c50806b2c5080f26ffafc50804f6c508fff5c50806eac608efc9c70880c908ffc3c80804beca08ffe3ca0806b0cd08ffbbcd\
    0802ecd008ffd7d00804f2d408ffc3d40806d4d908ff85da08029ee008ffafe00804d6e7085fcde70894f008ffebef0802d8f908ff8ffa\
    0804ae8509ffcb850906a89209ffab920902d8a009ffbba00904beb009ff87b00906ecc109ff95c20902eed509fff7d50904caeb09ffb9\
    eb090692830affe1830a02d29d0a5f879d0a9ab90adfabb90aead70affdfd70a02d4f80affaff80a04e69b0bffa19c0b06a6c20b007687\
    566778a9866589689801690000";
const SCATTERED_INDICES: &str = "d10004c18b111808054c0c1d72044dc001089501000cf501be0104ed027408fd034a0ca5051604e506\
    2808bd085c0cad0a6204b50c2208d50e100c8d114404dd136e08c5163a0cc5190604dd1c38088d206c0cd5235204b5271208ad2b200cbd\
    2f9e0104e533940108a5382a0cfd3c0804ed414808f546760c954c00000000";

#[test]
fn scattered_indices() {
    let triangles = decode(&bytes(SCATTERED_TRIANGLES), 90, 4, Mode::Triangles, Filter::None);
    assert_eq!(triangles.unwrap(), scattered());
    let indices = decode(&bytes(SCATTERED_INDICES), 90, 4, Mode::Indices, Filter::None);
    assert_eq!(indices.unwrap(), scattered());
    let short = decode(&bytes(SCATTERED_INDICES), 90, 2, Mode::Indices, Filter::None);
    assert_eq!(short.unwrap_err().to_string(), "index 70000 does not fit into two bytes");
}

#[test]
fn filters() {
    let shorts = |bytes: Vec<u8>| -> Vec<f64> {
        bytes.as_chunks().0.iter().map(|&b| f64::from(i16::from_le_bytes(b)) / 32767.0).collect()
    };
    // 12 bits: half a step, and as much again where the fold and the normalisation magnify it.
    let octahedral = "a0011c00000073013c0000000e13013c000000dbe8013c000000080d0000013c0000000403012400000000000000\
        000000000000000000000000000000000000000000000000ff07ff7f";
    let vectors = decode(&bytes(octahedral), 3, 8, Mode::Attributes, Filter::Octahedral).unwrap();
    let expected = [0.0, 0.0, 1.0, 1.0, 0.6, 0.0, -0.8, -1.0, -0.48, -0.64, 0.6, 1.0];
    for (got, expected) in shorts(vectors).into_iter().zip(expected) {
        assert!((got - expected).abs() < 1.0 / 2047.0, "{got} {expected}");
    }

    let quaternion = "a0013c000000fcfb013c000000b5b6013c000000fb34013c000000b424013c000000fcfb013c000000b5b6013000\
        00000500000000000000000000000000000000000000000000000000000000000000ff7f";
    let rotations = decode(&bytes(quaternion), 3, 8, Mode::Attributes, Filter::Quaternion).unwrap();
    // The second one is stored as its opposite, which turns the same way.
    let expected = [0.0, 0.0, 0.0, 1.0, 0.5, -0.5, 0.5, -0.5, 0.8, 0.0, 0.6, 0.0];
    for (got, expected) in shorts(rotations).into_iter().zip(expected) {
        assert!((got - expected).abs() < 2.0 / 32767.0, "{got} {expected}");
    }

    let exponential = "a0000000012000000000000130000000df01300000001301300000008101300000007c0130000000050130000000\
        460000000000000000000000000000000000000000000040e90000c0f441d47dda";
    let floats = decode(&bytes(exponential), 2, 12, Mode::Attributes, Filter::Exponential).unwrap();
    let floats: Vec<f32> = floats.as_chunks().0.iter().map(|&b| f32::from_le_bytes(b)).collect();
    assert_eq!(floats, [0.5, -1024.0, 3e-5, 1.0, 1.25, 1e6]);

    // Luma 100, orange 20, green -10; alpha 64 of 127 below the mark: all of 8 bits.
    let mut element = [100, 20, 246, 128 + 64];
    color_8(&mut element);
    assert_eq!(element, [130, 90, 90, 128]);
}

#[test]
fn the_extremes_of_exponents() {
    for (exponent, mantissa, value) in [(-100, 1, -100), (100, -3, 100), (127, 1, 127), (-128, 1 << 22, -128)]
    {
        let mut element = ((exponent << 24) | (mantissa & 0xff_ffff_i32)).to_le_bytes();
        exponential(&mut element);
        let expected = libm::ldexp(f64::from(mantissa), value) as f32;
        assert_eq!(f32::from_le_bytes(element), expected);
    }
}

#[test]
fn broken_streams_are_told_of() {
    let of = |hex: &str, count, stride, mode| {
        decode(&bytes(hex), count, stride, mode, Filter::None).unwrap_err().to_string()
    };
    let whole = bytes(VERSION_1);
    for length in 0..whole.len() {
        assert!(decode(&whole[..length], 20, 4, Mode::Attributes, Filter::None).is_err(), "{length}");
    }
    assert_eq!(of(VERSION_0, 16, 4, Mode::Attributes), TOO_LONG);
    assert!(of(VERSION_0, 2_000_000_000, 4, Mode::Attributes).contains("do not fit"));
    assert!(of(VERSION_0, usize::MAX, 8, Mode::Attributes).contains("do not fit"));
    assert_eq!(of(VERSION_0, 1, 256, Mode::Attributes), CUT_SHORT);
    assert!(of(SCATTERED_INDICES, usize::MAX, 4, Mode::Indices).contains("do not fit"));
    assert_eq!(of(SCATTERED_TRIANGLES, 3_000_000_000, 4, Mode::Triangles), CUT_SHORT);
    assert!(of(SCATTERED_TRIANGLES, 91, 4, Mode::Triangles).contains("no number of triangles"));
    assert!(of(VERSION_0, 20, 6, Mode::Attributes).contains("byteStride of 6"));
    assert!(of(VERSION_0, 20, 4, Mode::Indices).contains("0xa0"));
    // The first triangle can't share an edge with one before it.
    let orphan = "e1000000000000000000000000000000000000";
    assert!(of(orphan, 3, 4, Mode::Triangles).contains("before the first"));
    assert!(of(&VERSION_1.replace("ff000700", "ff000703"), 20, 4, Mode::Attributes).contains("0x03"));
}

proptest! {
    #[test]
    fn no_stream_panics(
        kind in 0..3_usize,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        cut in 0..20_usize,
        count in prop_oneof![Just(20_usize), Just(90), 0..4000_usize],
        stride in prop_oneof![Just(2_usize), Just(4), Just(8), Just(12), Just(256)],
        filter in prop_oneof![
            Just(Filter::None), Just(Filter::Octahedral), Just(Filter::Quaternion),
            Just(Filter::Exponential), Just(Filter::Color),
        ],
    ) {
        let (hex, mode) = [
            (VERSION_1, Mode::Attributes),
            (SCATTERED_TRIANGLES, Mode::Triangles),
            (SCATTERED_INDICES, Mode::Indices),
        ][kind];
        let mut stream = bytes(hex);
        for (at, value) in changes {
            let at = at.index(stream.len());
            stream[at] = value;
        }
        stream.truncate(stream.len().saturating_sub(cut));
        if let Ok(decoded) = decode(&stream, count, stride, mode, filter) {
            prop_assert_eq!(decoded.len(), count * stride);
        }
    }
}
