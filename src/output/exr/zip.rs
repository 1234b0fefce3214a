//! The compressions `zip` and `zips` of OpenEXR.
//!
//! The layout is that of "OpenEXR File Layout" of the OpenEXR project (openexr.com) and of its compressor: of the bytes of a block, those
//! at even places come before those at odd places, each becomes its difference from the one before it, plus 128, and deflate follows.

use crate::output::deflate::zlib;

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
    /// The bytes of the block at even places, and then those at odd places.
    planes: Vec<u8>,
    /// The bytes of the block that are there.
    filled: usize,
    differences: Vec<u8>,
}

impl Zip {
    /// Begins a block of so many bytes.
    pub fn begin(&mut self, bytes: usize) {
        self.planes.resize(bytes, 0);
        self.filled = 0;
    }

    /// Adds values that follow those that are there: their bytes at even places to one plane, and those at odd places to the other.
    pub fn add(&mut self, segments: &[Segment]) {
        let middle = self.planes.len() / 2;
        let (even, odd) = self.planes.split_at_mut(middle);
        // A value has 2 bytes or 4, so each begins at an even place.
        let (mut even, mut odd) = (&mut even[self.filled / 2..], &mut odd[self.filled / 2..]);
        for segment in segments {
            let (of_even, of_odd);
            (of_even, even) = even.split_at_mut(segment.bytes() / 2);
            (of_odd, odd) = odd.split_at_mut(segment.bytes() / 2);
            if segment.is_half {
                for ((even, odd), value) in of_even.iter_mut().zip(of_odd).zip(segment.values) {
                    (*even, *odd) = (*value as u8, (*value >> 8) as u8);
                }
            } else {
                let (of_even, of_odd) = (of_even.as_chunks_mut::<2>().0, of_odd.as_chunks_mut::<2>().0);
                for ((even, odd), value) in of_even.iter_mut().zip(of_odd).zip(segment.values) {
                    let [a, b, c, d] = value.to_le_bytes();
                    (*even, *odd) = ([a, c], [b, d]);
                }
            }
            self.filled += segment.bytes();
        }
    }

    /// The bytes of a block that is whole, at a level of deflate. What would not get smaller stays as it is, which readers tell by its
    /// length.
    pub fn finish(&mut self, level: u8) -> Vec<u8> {
        self.differentiate();
        let packed = zlib(&self.differences, level);
        if packed.len() < self.planes.len() { packed } else { self.raw() }
    }

    /// The bytes of a block of these values at a level of deflate: [`Self::begin`], [`Self::add`] and [`Self::finish`].
    pub fn pack(&mut self, segments: &[Segment], level: u8) -> Vec<u8> {
        self.begin(segments.iter().map(Segment::bytes).sum());
        self.add(segments);
        self.finish(level)
    }

    /// The bytes of the block.
    fn raw(&self) -> Vec<u8> {
        let (even, odd) = self.planes.split_at(self.planes.len() / 2);
        even.iter().zip(odd).flat_map(|(even, odd)| [*even, *odd]).collect()
    }

    fn differentiate(&mut self) {
        let Self { planes, differences, .. } = self;
        differences.resize(planes.len(), 0);
        let (Some(first), Some((first_plane, _))) = (differences.first_mut(), planes.split_first()) else {
            return;
        };
        *first = *first_plane;
        for ((difference, byte), before) in differences[1..].iter_mut().zip(&planes[1..]).zip(&planes[..]) {
            *difference = byte.wrapping_sub(*before).wrapping_add(128);
        }
    }
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
    fn raw_bytes_are_little_endian() {
        let segments = [(false, [0x0403_0201]), (true, [0x0605])];
        let segments = segments.each_ref().map(|(is_half, values)| Segment { values, is_half: *is_half });
        let mut bytes = Vec::new();
        add_raw(&segments, &mut bytes);
        assert_eq!(bytes, [1, 2, 3, 4, 5, 6]);
    }
}
