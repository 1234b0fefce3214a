//! Frames of Zstandard (RFC 8878), fast. ruzstd writes them; the matches are found here, because its own search takes several times as
//! long and finds less.

use ruzstd::encoding::{CompressionLevel, FrameCompressor, Matcher, Sequence};

use crate::output::matches::common;

/// The greatest size of a block.
const BLOCK: usize = 128 * 1024;
/// The greatest distance of a match.
const WINDOW: usize = 1 << 20;
/// The bits of an index of the table of places.
const HASH_BITS: u32 = 15;
/// The least length of a match. A shorter one takes as many bits as its bytes.
const LEAST: usize = 6;
/// The greatest length of a match. The format allows twice as much, of which ruzstd 0.8 writes wrong bits.
const LONGEST: usize = 65_538;
/// A step grows by 1 byte for each `1 << SLOWNESS` bytes since the last match.
const SLOWNESS: u32 = 7;

/// Compresses bytes.
pub(super) fn zstd(bytes: &[u8]) -> Vec<u8> {
    let mut frame = Vec::with_capacity(bytes.len());
    let mut compressor = FrameCompressor::new_with_matcher(Matches::default(), CompressionLevel::Fastest);
    compressor.set_source(bytes);
    compressor.set_drain(&mut frame);
    compressor.compress();
    frame
}

/// The search, which looks at one earlier place for each few bytes.
#[derive(Default)]
struct Matches {
    /// The bytes of the frame so far.
    bytes: Vec<u8>,
    /// The place of the last block.
    start: usize,
    /// The last place of each hash.
    places: Vec<u32>,
    /// The memory for the next block.
    space: Vec<u8>,
}

impl Matcher for Matches {
    fn reset(&mut self, _: CompressionLevel) {
        self.bytes.clear();
        self.start = 0;
        self.places.clear();
        self.places.resize(1 << HASH_BITS, u32::MAX);
    }

    fn window_size(&self) -> u64 {
        WINDOW as u64
    }

    fn get_next_space(&mut self) -> Vec<u8> {
        let mut space = std::mem::take(&mut self.space);
        space.resize(BLOCK, 0);
        space
    }

    fn commit_space(&mut self, space: Vec<u8>) {
        self.start = self.bytes.len();
        self.bytes.extend_from_slice(&space);
        self.space = space;
    }

    fn get_last_space(&mut self) -> &[u8] {
        &self.bytes[self.start..]
    }

    fn skip_matching(&mut self) {}

    fn start_matching(&mut self, mut add: impl for<'a> FnMut(Sequence<'a>)) {
        let Self { bytes, start, places, .. } = self;
        // ruzstd 0.8 can't write a block whose matches all follow each other, so its first byte is a literal.
        let (mut at, mut from) = (*start + 1, *start);
        while let Some(word) = word_at(bytes, at) {
            let place = &mut places[hash(word)];
            // Of a place that is farther than 32 bits tell, the distance comes out too large.
            let before = std::mem::replace(place, at as u32) as usize;
            let offset = at.wrapping_sub(before);
            let is_same = |other: u64| hash_bytes(other) == hash_bytes(word);
            if offset <= WINDOW && word_at(bytes, before).is_some_and(is_same) {
                let mut left = LEAST + common(bytes, before + LEAST, at + LEAST);
                while left > 0 {
                    // What is left is never too short for the format.
                    let match_len = if left > LONGEST { LONGEST.min(left - 3) } else { left };
                    add(Sequence::Triple { literals: &bytes[from..at], offset, match_len });
                    at += match_len;
                    (from, left) = (at, left - match_len);
                }
            } else {
                at += 1 + ((at - from) >> SLOWNESS);
            }
        }
        if from < bytes.len() {
            add(Sequence::Literals { literals: &bytes[from..] });
        }
    }
}

/// The 8 bytes from a place on.
#[inline(always)]
fn word_at(bytes: &[u8], at: usize) -> Option<u64> {
    bytes.get(at..)?.first_chunk().map(|word| u64::from_le_bytes(*word))
}

/// The first [`LEAST`] bytes of a word, in its upper bits.
#[inline(always)]
fn hash_bytes(word: u64) -> u64 {
    word << (64 - 8 * LEAST)
}

#[inline(always)]
fn hash(word: u64) -> usize {
    (hash_bytes(word).wrapping_mul(0x9e37_79b1_85eb_ca87) >> (64 - HASH_BITS)) as usize
}

#[cfg(test)]
mod tests {
    use std::io::Read as _;

    use super::*;

    #[test]
    fn what_was_compressed_is_read() {
        let noise = |length: u64| (0..length).map(|i| (i.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 37) as u8);
        let cloud: Vec<u8> = (0..60_000_u32)
            .flat_map(|i| [(i as f32 * 0.01).to_le_bytes(), i.to_le_bytes(), [0; 4]].concat())
            .collect();
        let far = [noise(1000).collect(), vec![0; WINDOW + 5], noise(1000).collect()].concat();
        let mut inputs = vec![
            Vec::new(),
            vec![1],
            vec![3; 3 * BLOCK + 7],
            noise(2 * BLOCK as u64 + 3).collect(),
            cloud,
            far,
        ];
        // Blocks of nothing but matches: what repeats after so many bytes.
        inputs.extend((6..40).map(|period| noise(period).cycle().take(3 * BLOCK + 5).collect()));
        // Runs within a block, about as long as the longest match.
        inputs.extend(
            [LONGEST - 1, LONGEST, LONGEST + 1, LONGEST + 5, 2 * LONGEST - 30]
                .map(|run| [vec![1, 2, 3], vec![0; run + 1], vec![4, 5, 6]].concat()),
        );
        inputs.extend((1..20).map(|length| noise(length).chain(noise(length)).collect()));
        for input in inputs {
            let (frame, mut again) = (zstd(&input), Vec::new());
            ruzstd::decoding::StreamingDecoder::new(&frame[..]).unwrap().read_to_end(&mut again).unwrap();
            assert!(again == input, "{} bytes", input.len());
            // A block of noise is kept as it is.
            assert!(frame.len() < input.len() + 64, "{} of {} bytes", frame.len(), input.len());
        }
    }

    #[test]
    fn what_repeats_gets_small() {
        let noise: Vec<u8> =
            (0..100_000_u64).map(|i| (i.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 37) as u8).collect();
        assert!(zstd(&[&noise[..], &noise].concat()).len() < 101_000);
        assert!(zstd(&vec![5; 1_000_000]).len() < 100);
    }
}
