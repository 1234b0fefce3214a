//! Compact storage of a channel's pixels: they are quantised, predicted from their neighbours, and deflated.
//!
//! Ranges of a scene are smooth except at edges, so the difference from a prediction is nearly always small. The predictor
//! is that of LOCO-I (Weinberger, Seroussi and Sapiro, 2000): the median of left, up, and left + up − upper left. Pixels
//! without a return are left out, and the mask tells which these are.

use miniz_oxide::deflate::compress_to_vec_zlib;
use miniz_oxide::inflate::decompress_to_vec_zlib_with_limit;

use crate::output::Samples;

/// The marker for a high part that does not fit into one byte. The full value follows at the end.
const ESCAPE: u8 = 255;

/// The strongest compression level of deflate, except for those that only take longer.
const LEVEL: u8 = 9;

/// Packs pixels into few bytes. Measurements are rounded to multiples of `step`, and ids are kept exactly. Pixels outside
/// of `mask` are not kept.
pub fn pack(samples: &Samples, mask: &[bool], columns: usize, step: f64) -> Vec<u8> {
    let values: Vec<i64> = (0..samples.len()).map(|i| quantise(samples, i, step)).collect();
    let is_id = matches!(samples, Samples::U32(_));
    // The low bytes, the next bytes and the values that need more are stored in separate lists, because deflate compresses
    // similar values better.
    let (mut low, mut high, mut rest) = (Vec::new(), Vec::new(), Vec::new());
    for index in (0..values.len()).filter(|&i| mask[i]) {
        let code = zigzag(values[index].wrapping_sub(predict(&values, mask, columns, index, is_id)));
        low.push(code as u8);
        match u8::try_from(code >> 8) {
            Ok(byte) if byte != ESCAPE => high.push(byte),
            _ => {
                high.push(ESCAPE);
                rest.extend((code >> 8).to_le_bytes());
            }
        }
    }
    compress_to_vec_zlib(&[low, high, rest].concat(), LEVEL)
}

/// The pixels that [`pack`] packed. Pixels outside of `mask` are 0. `None` if the bytes were not written by [`pack`].
pub fn unpack(packed: &[u8], mask: &[bool], columns: usize, step: f64, is_id: bool) -> Option<Samples> {
    let count = mask.iter().filter(|&&m| m).count();
    let stream = decompress_to_vec_zlib_with_limit(packed, count.checked_mul(10)?.max(1)).ok()?;
    let (low, rest) = stream.split_at_checked(count)?;
    let (high, mut rest) = rest.split_at_checked(count)?;
    let mut bytes = low.iter().zip(high);
    let mut values = vec![0_i64; mask.len()];
    for index in (0..mask.len()).filter(|&i| mask[i]) {
        let code = match bytes.next()? {
            (&low, &ESCAPE) => {
                let (high, after) = rest.split_first_chunk::<8>()?;
                rest = after;
                u64::from_le_bytes(*high) << 8 | u64::from(low)
            }
            (&low, &high) => u64::from(high) << 8 | u64::from(low),
        };
        let predicted = predict(&values, mask, columns, index, is_id);
        values[index] = predicted.wrapping_add(unzigzag(code));
    }
    if !rest.is_empty() {
        return None;
    }
    Some(if is_id {
        Samples::U32(values.into_iter().map(|v| v as u32).collect())
    } else {
        Samples::F32(values.into_iter().map(|v| (v as f64 * step) as f32).collect())
    })
}

/// Packs the mask of the pixels that have a return.
pub fn pack_mask(mask: &[bool]) -> Vec<u8> {
    let bytes = mask.chunks(8).map(|bits| bits.iter().rev().fold(0, |byte, &bit| byte << 1 | u8::from(bit)));
    compress_to_vec_zlib(&bytes.collect::<Vec<u8>>(), LEVEL)
}

/// The mask of `pixels` pixels that [`pack_mask`] packed.
pub fn unpack_mask(packed: &[u8], pixels: usize) -> Option<Vec<bool>> {
    let bytes = decompress_to_vec_zlib_with_limit(packed, pixels.div_ceil(8).max(1)).ok()?;
    let bit = |i: usize| bytes.get(i / 8).map(|byte| byte >> (i % 8) & 1 == 1);
    (0..pixels).map(bit).collect()
}

fn quantise(samples: &Samples, index: usize, step: f64) -> i64 {
    match samples {
        // A float beyond 64 bits saturates, and so differs from any value that it is compared with.
        Samples::F32(values) => (f64::from(values[index]) / step).round() as i64,
        Samples::U32(values) => i64::from(values[index]),
    }
}

/// The prediction of a pixel from the pixels before it.
fn predict(values: &[i64], mask: &[bool], columns: usize, index: usize, is_id: bool) -> i64 {
    let at = |is_inside: bool, back: usize| (is_inside && mask[index - back]).then(|| values[index - back]);
    let (not_first_row, not_first_column) = (index >= columns, !index.is_multiple_of(columns));
    let left = at(not_first_column, 1);
    let up = at(not_first_row, columns);
    let corner = at(not_first_row && not_first_column, columns + 1);
    match (left, up, corner) {
        // Neighbouring ids are either equal or unrelated.
        (Some(left), Some(up), Some(corner)) if is_id => {
            if corner == left {
                up
            } else {
                left
            }
        }
        (Some(left), Some(up), Some(corner)) => {
            let plane = left.wrapping_add(up).wrapping_sub(corner);
            plane.clamp(left.min(up), left.max(up))
        }
        (Some(left), ..) => left,
        (None, Some(up), _) => up,
        _ => 0,
    }
}

/// Maps small numbers of either sign to small non-negative numbers: 0, −1, 1, −2, … to 0, 1, 2, 3, ….
fn zigzag(n: i64) -> u64 {
    ((n << 1) ^ (n >> 63)) as u64
}

fn unzigzag(code: u64) -> i64 {
    (code >> 1) as i64 ^ -((code & 1) as i64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn measurements_come_back_to_half_a_step(
            values in prop::collection::vec((any::<bool>(), -1e6_f32..1e6), 1..60), columns in 1_usize..9,
        ) {
            let mask: Vec<bool> = values.iter().map(|v| v.0).collect();
            let numbers: Vec<f32> = values.iter().map(|v| v.1).collect();
            let step = 0.5;
            let packed = pack(&Samples::F32(numbers.clone()), &mask, columns, step);
            let Some(Samples::F32(back)) = unpack(&packed, &mask, columns, step, false) else { panic!() };
            for i in (0..mask.len()).filter(|&i| mask[i]) {
                prop_assert!((back[i] - numbers[i]).abs() <= 0.25 + numbers[i].abs() * 1e-7);
            }
        }

        #[test]
        fn ids_come_back_as_they_were(values in prop::collection::vec(any::<u32>(), 1..60), columns in 1_usize..9) {
            let mask = vec![true; values.len()];
            let packed = pack(&Samples::U32(values.clone()), &mask, columns, 1.0);
            prop_assert_eq!(unpack(&packed, &mask, columns, 1.0, true), Some(Samples::U32(values)));
        }

        #[test]
        fn any_mask_comes_back(mask in prop::collection::vec(any::<bool>(), 0..60)) {
            prop_assert_eq!(unpack_mask(&pack_mask(&mask), mask.len()), Some(mask));
        }

        #[test]
        fn broken_bytes_are_nothing_or_pixels(bytes in prop::collection::vec(any::<u8>(), 0..60)) {
            let mask = [true, false, true];
            for is_id in [false, true] {
                if let Some(samples) = unpack(&bytes, &mask, 2, 0.5, is_id) {
                    prop_assert_eq!(samples.len(), 3);
                }
            }
            unpack_mask(&bytes, 100);
        }

        #[test]
        fn zigzag_is_undone(n: i64) {
            prop_assert_eq!(unzigzag(zigzag(n)), n);
        }
    }

    #[test]
    fn a_smooth_image_takes_little() {
        let range: Vec<f32> =
            (0..64 * 1024).map(|i| 5.0 + (i % 1024) as f32 * 0.003 + (i / 1024) as f32 * 0.1).collect();
        let packed = pack(&Samples::F32(range), &[true; 64 * 1024], 1024, 1e-3);
        assert!(packed.len() < 3000, "{} bytes", packed.len());
    }
}
