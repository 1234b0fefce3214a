//! The compressions `zip` and `zips` of OpenEXR.
//!
//! The layout is that of "OpenEXR File Layout" of the OpenEXR project (openexr.com) and of its compressor: of the bytes of a block, those
//! at even places come before those at odd places, each becomes its difference from the one before it, plus 128, and deflate follows.

use crate::output::deflate::{Deflater, Distances};

/// Values that follow each other in a block: the pixels of a channel in a line.
#[derive(Clone, Copy)]
pub(super) struct Segment<'v> {
    /// The bits of the values.
    pub values: &'v [u32],
    /// Whether a value has 16 bits.
    pub is_half: bool,
}

impl Segment<'_> {
    /// The bytes of the values.
    pub fn bytes(&self) -> usize {
        self.values.len() * if self.is_half { 2 } else { 4 }
    }
}

/// Adds the bytes of values that are not compressed, little-endian.
pub(super) fn add_raw(segments: &[Segment], bytes: &mut Vec<u8>) {
    for segment in segments {
        match segment.is_half {
            true => bytes.extend(segment.values.iter().flat_map(|value| (*value as u16).to_le_bytes())),
            false => bytes.extend(segment.values.iter().flat_map(|value| value.to_le_bytes())),
        }
    }
}

/// The compressor, whose memory is used again for each block.
#[derive(Default)]
pub(super) struct Zip {
    /// The differences of the bytes of the block at even places, and then of those at odd places.
    differences: Vec<u8>,
    /// The bytes of the block that are there.
    filled: usize,
    /// The last byte that is there at an even place, and at an odd one.
    last: [u8; 2],
    /// Whether values of 16 bits are there, which have a byte in each plane.
    has_halves: bool,
    deflater: Deflater,
}

/// So many values are split at a time, and the halves of their bytes stay in the cache.
const VALUES: usize = 256;

/// The difference of two equal bytes as files have it, so that small differences of either sign are near each other.
const MIDDLE: u8 = 128;

impl Zip {
    /// Begins a block of so many bytes.
    pub fn begin(&mut self, bytes: usize) {
        self.differences.resize(bytes, 0);
        self.filled = 0;
        // The first byte stays as it is. What precedes the first at an odd place is known in the end.
        self.last = [MIDDLE, 0];
        self.has_halves = false;
    }

    /// Adds values that follow those that are there.
    pub fn add(&mut self, segments: &[Segment]) {
        let middle = self.differences.len() / 2;
        let (even, odd) = self.differences.split_at_mut(middle);
        // A value has 2 bytes or 4, so each begins at an even place.
        let (mut even, mut odd) = (&mut even[self.filled / 2..], &mut odd[self.filled / 2..]);
        let mut halves = [[0; 2 * VALUES]; 2];
        for segment in segments {
            for values in segment.values.chunks(VALUES) {
                let ((of_even, of_odd), count);
                if segment.is_half {
                    split_halves(values, &mut halves);
                    count = values.len();
                } else {
                    split_words(values, &mut halves);
                    count = 2 * values.len();
                }
                (of_even, even) = even.split_at_mut(count);
                (of_odd, odd) = odd.split_at_mut(count);
                differentiate(&halves[0][..count], &mut self.last[0], of_even);
                differentiate(&halves[1][..count], &mut self.last[1], of_odd);
            }
            self.filled += segment.bytes();
            self.has_halves |= segment.is_half;
        }
    }

    /// The bytes of a block that is whole, at a level of deflate. What would not get smaller stays as it is, which readers tell by its
    /// length.
    pub fn finish(&mut self, level: u8) -> Vec<u8> {
        let middle = self.differences.len() / 2;
        if let Some(first) = self.differences.get_mut(middle) {
            *first = first.wrapping_sub(self.last[0]);
        }
        let distances = if self.has_halves { Distances::All } else { Distances::Even };
        let packed = self.deflater.zlib(&self.differences, distances, level);
        if packed.len() < self.differences.len() { packed } else { self.raw() }
    }

    /// The bytes of a block of these values at a level of deflate: [`Self::begin`], [`Self::add`] and [`Self::finish`].
    pub fn pack(&mut self, segments: &[Segment], level: u8) -> Vec<u8> {
        self.begin(segments.iter().map(Segment::bytes).sum());
        self.add(segments);
        self.finish(level)
    }

    /// The bytes of the block.
    fn raw(&self) -> Vec<u8> {
        let mut byte = MIDDLE;
        let sums = self.differences.iter().map(|difference| {
            byte = byte.wrapping_add(*difference).wrapping_sub(MIDDLE);
            byte
        });
        let planes: Vec<u8> = sums.collect();
        let (even, odd) = planes.split_at(planes.len() / 2);
        even.iter().zip(odd).flat_map(|(even, odd)| [*even, *odd]).collect()
    }
}

/// The bytes of values of 32 bits at even places, and at odd places.
fn split_words(values: &[u32], [even, odd]: &mut [[u8; 2 * VALUES]; 2]) {
    for ((even, odd), value) in even.as_chunks_mut().0.iter_mut().zip(odd.as_chunks_mut().0).zip(values) {
        *even = ((value & 0xff | value >> 8 & 0xff00) as u16).to_le_bytes();
        *odd = ((value >> 8 & 0xff | value >> 16 & 0xff00) as u16).to_le_bytes();
    }
}

/// The lower bytes of values of 16 bits, and the upper ones.
fn split_halves(values: &[u32], [even, odd]: &mut [[u8; 2 * VALUES]; 2]) {
    for ((even, odd), value) in even.iter_mut().zip(odd).zip(values) {
        (*even, *odd) = (*value as u8, (*value >> 8) as u8);
    }
}

/// The differences of bytes from those before them, of which the first is the last of an earlier call.
fn differentiate(bytes: &[u8], last: &mut u8, differences: &mut [u8]) {
    let (Some((first, others)), Some((first_byte, _))) = (differences.split_first_mut(), bytes.split_first())
    else {
        return;
    };
    *first = first_byte.wrapping_sub(*last).wrapping_add(MIDDLE);
    for ((difference, byte), before) in others.iter_mut().zip(&bytes[1..]).zip(bytes) {
        *difference = byte.wrapping_sub(*before).wrapping_add(MIDDLE);
    }
    *last = bytes[bytes.len() - 1];
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Undoes [`Zip::pack`] by the definition.
    fn unpack(packed: &[u8], length: usize) -> Vec<u8> {
        if packed.len() == length {
            return packed.to_vec();
        }
        let mut bytes = miniz_oxide::inflate::decompress_to_vec_zlib(packed).unwrap();
        for i in 1..bytes.len() {
            bytes[i] = bytes[i - 1].wrapping_add(bytes[i]).wrapping_sub(128);
        }
        let (even, odd) = bytes.split_at(length.div_ceil(2));
        (0..length).map(|i| if i % 2 == 0 { even[i / 2] } else { odd[i / 2] }).collect()
    }

    #[test]
    fn compression_changes_nothing_and_never_makes_larger() {
        let mut zip = Zip::default();
        for length in [0, 1, 2, 3, 100, 1001] {
            let smooth: Vec<u32> = (0..length).map(|i| (i as f32 / 7.0).to_bits()).collect();
            let noise: Vec<u32> =
                (0..length).map(|i: u32| i.wrapping_mul(2_654_435_761).rotate_left(i)).collect();
            let [words, halves] =
                [false, true].map(|is_half| [&smooth, &noise].map(|values| Segment { values, is_half }));
            for segments in [&words[..1], &words, &halves, &[words[0], halves[1], words[1]]] {
                let mut bytes = Vec::new();
                add_raw(segments, &mut bytes);
                for level in [1, 4] {
                    let packed = zip.pack(segments, level);
                    zip.begin(bytes.len());
                    segments.iter().for_each(|segment| zip.add(&[*segment]));
                    assert_eq!(zip.finish(level), packed, "segments may come one by one");
                    assert!(packed.len() <= bytes.len());
                    assert_eq!(unpack(&packed, bytes.len()), bytes);
                }
            }
        }
        assert!(zip.pack(&[Segment { values: &[7; 1000], is_half: false }], 1).len() < 60);
    }

    #[test]
    fn lines_of_halves_are_found_again_at_an_odd_distance() {
        let line: Vec<u32> = (0..1001_u32).map(|i| i.wrapping_mul(2_654_435_761) >> 16).collect();
        let segment = Segment { values: &line, is_half: true };
        let [once, twice] = [1, 2].map(|lines| Zip::default().pack(&vec![segment; lines], 1).len());
        assert!(twice < once + 200, "{once} and {twice} bytes");
    }

    #[test]
    fn raw_bytes_are_little_endian() {
        let segments = [(false, [0x0403_0201]), (true, [0x0605])];
        let segments = segments.each_ref().map(|(is_half, values)| Segment { values, is_half: *is_half });
        let mut bytes = Vec::new();
        add_raw(&segments, &mut bytes);
        assert_eq!(bytes, [1, 2, 3, 4, 5, 6]);
    }
}
