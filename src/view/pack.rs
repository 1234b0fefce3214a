//! Numbers in few bytes, which the page's script unpacks.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use miniz_oxide::deflate::compress_to_vec;
use serde_json::{Value, json};

/// The level of deflate. The next levels take twice the time to save a hundredth of the bytes.
const LEVEL: u8 = 6;

/// Packs whole numbers of `bytes` (1, 2 or 4) bytes each, from an image with rows of `columns`. `kind` is the type that
/// the script gives them: `f32`, `u32`, `u16` or `i8`.
///
/// Each number is replaced by its difference (modulo 2^(8·bytes)) from its left or its upper neighbour, whichever deflates
/// better. Then all lowest bytes come first, and after them the next ones. Neighbours are alike, so that most high bytes are
/// 0.
pub(super) fn numbers(kind: &str, values: &[u32], bytes: usize, columns: usize) -> Value {
    let left = compress_to_vec(&planes(values, bytes, 1), LEVEL);
    let up = compress_to_vec(&planes(values, bytes, columns), LEVEL);
    let (neighbour, packed) = if up.len() < left.len() { (columns, up) } else { (1, left) };
    json!({ "kind": kind, "count": values.len(), "neighbour": neighbour, "data": base64(&packed) })
}

/// The differences of numbers from the ones `neighbour` places before, the lowest bytes first.
fn planes(values: &[u32], bytes: usize, neighbour: usize) -> Vec<u8> {
    let mut planes = vec![0; values.len() * bytes];
    for (i, &value) in values.iter().enumerate() {
        let before = if i < neighbour { 0 } else { values[i - neighbour] };
        let difference = value.wrapping_sub(before).to_le_bytes();
        for (byte, &part) in difference[..bytes].iter().enumerate() {
            planes[byte * values.len() + i] = part;
        }
    }
    planes
}

/// Writes bytes as text.
pub(super) fn base64(bytes: &[u8]) -> String {
    STANDARD.encode(bytes)
}

/// Packs points on a grid of 2¹⁶ steps along each axis of their box. In a street, a step is a few millimetres.
pub(super) fn points(points: &[[f32; 3]]) -> Value {
    let mut low = [f32::INFINITY; 3];
    let mut high = [f32::NEG_INFINITY; 3];
    for point in points {
        for axis in 0..3 {
            low[axis] = low[axis].min(point[axis]);
            high[axis] = high[axis].max(point[axis]);
        }
    }
    let axis = |axis: usize| {
        let (low, high) = (f64::from(low[axis]), f64::from(high[axis]));
        let step = if high > low { (high - low) / 65535.0 } else { 1.0 };
        let grid: Vec<u32> =
            points.iter().map(|p| ((f64::from(p[axis]) - low) / step).round() as u32).collect();
        json!({ "low": if points.is_empty() { 0.0 } else { low }, "step": step, "packed": numbers("u16", &grid, 2, 1) })
    };
    json!([axis(0), axis(1), axis(2)])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Unpacks numbers as the page's script does.
    fn unpack(packed: &Value, bytes: usize) -> Vec<u32> {
        let data = STANDARD.decode(packed["data"].as_str().unwrap()).unwrap();
        let planes = miniz_oxide::inflate::decompress_to_vec(&data).unwrap();
        let count = packed["count"].as_u64().unwrap() as usize;
        let neighbour = packed["neighbour"].as_u64().unwrap() as usize;
        let mask = if bytes == 4 { u32::MAX } else { (1 << (8 * bytes)) - 1 };
        let mut values: Vec<u32> = Vec::new();
        for i in 0..count {
            let difference: u32 = (0..bytes).map(|b| u32::from(planes[b * count + i]) << (8 * b)).sum();
            let before = if i < neighbour { 0 } else { values[i - neighbour] };
            values.push(before.wrapping_add(difference) & mask);
        }
        values
    }

    #[test]
    fn numbers_come_back() {
        // Noise in rows that are nearly the same: the neighbour above is the nearest.
        let noise = |i: u32| i.wrapping_mul(0x9e37_79b1) ^ (i.wrapping_mul(0x85eb_ca6b) >> 13);
        let rows: Vec<u32> = (0..90_000).map(|i| noise(i % 30_000).wrapping_add(noise(i) % 4)).collect();
        let packed = numbers("u32", &rows, 4, 30_000);
        assert_eq!(packed["neighbour"], 30_000);
        assert!(unpack(&packed, 4) == rows);
        let ramp: Vec<u32> = (0..600).map(|i| 65_000 + i).map(|v| v & 0xffff).collect();
        let packed = numbers("u16", &ramp, 2, 7);
        assert_eq!((unpack(&packed, 2), &packed["neighbour"]), (ramp, &json!(1)));
        assert!(unpack(&numbers("f32", &[], 4, 5), 4).is_empty());
    }

    #[test]
    fn points_are_as_near_as_their_grid() {
        let cloud: Vec<[f32; 3]> = (0..500).map(|i| [i as f32 * 0.3 - 70.0, 5.0, (i % 7) as f32]).collect();
        let packed = points(&cloud);
        for axis in 0..3 {
            let (low, step) = (packed[axis]["low"].as_f64().unwrap(), packed[axis]["step"].as_f64().unwrap());
            for (value, point) in unpack(&packed[axis]["packed"], 2).iter().zip(&cloud) {
                assert!((low + f64::from(*value) * step - f64::from(point[axis])).abs() <= 0.51 * step);
            }
        }
        assert_eq!(points(&[])[0]["low"], 0.0);
    }
}
