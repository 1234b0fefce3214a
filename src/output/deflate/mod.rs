//! Deflate (RFC 1951), fast, and the same bytes on every machine.
//!
//! The compressor of level 1 is made for arrays of numbers: runs, channels beside their copies, and noise. It looks up one earlier
//! place for each two bytes, takes what it finds, and goes on in growing steps where nothing repeats. A longer search finds little more
//! in them: of the street's range images it makes files that are 2 % larger in 0.4 of the time of miniz at its level 1. The higher levels
//! are those of miniz. `bits` writes bits, `codes` makes Huffman's codes, and `block` writes literals and matches in them.

mod bits;
mod block;
mod codes;

use bits::Bits;
use block::Block;

use super::matches::common;
use super::options::{OptionSpec, OptionValues, Options};

/// The option of formats that compress with deflate.
pub(super) const LEVEL: OptionSpec = OptionSpec {
    name: "level",
    about: "How hard deflate searches, from 1, which is the fastest, to 9, which takes many times as long for files that are some \
            hundredths smaller. A level changes no value.",
    values: OptionValues::OneOf { numbers: &[1, 2, 3, 4, 5, 6, 7, 8, 9], default: FASTEST as u32 },
};

/// The level whose compressor is this file's own.
pub(super) const FASTEST: u8 = 1;

/// The level that a job wants.
pub(super) fn level(options: &Options) -> u8 {
    options.number(&LEVEL) as u8
}

/// The greatest distance of a match.
const WINDOW: usize = 32 * 1024;
/// The bits of an index of the table of places. A table of 16 KiB stays in the nearest cache, and a larger one finds little more.
const HASH_BITS: u32 = 12;
/// The bytes of the input that share their codes. More of them make files larger that change on the way, and fewer take longer. Of a
/// stored block, four pieces are enough for them and for the last step.
const BLOCK: usize = 4 * u16::MAX as usize - 2 * STEPS;
/// Behind each so many bytes without a match, the step grows by the least one, and every [`STEPS`] times it begins anew. Steps of one
/// length could pass by all the places that were looked up in a copy.
const STRIDE: usize = 32;
const STEPS: usize = 16;
/// A match at more than [`NEAR`] bytes must have 8 bytes, because its code is about as long as those of so many literals. A nearer one
/// must have 4.
const NEAR: usize = 2048;
const WORD_OF_FAR: u64 = u64::MAX;
const WORD_OF_NEAR: u64 = 0xffff_ffff;

/// The distances at which bytes are repeated, if they are. Level 1 searches for these.
#[derive(Clone, Copy, Debug)]
pub(super) enum Distances {
    /// Even ones, as in arrays of numbers of 16 bits or more. The search takes less time, and finds more of these.
    Even,
    /// All, as in arrays of bytes.
    All,
}

/// Compresses an array of numbers of 16 bits or more at a level from 1 to 9.
pub(super) fn deflate(bytes: &[u8], level: u8) -> Vec<u8> {
    if level == FASTEST {
        let mut deflater = Deflater::default();
        deflater.compress(bytes, Distances::Even, &[]);
        return deflater.bits.finish().to_vec();
    }
    miniz_oxide::deflate::compress_to_vec(bytes, level)
}

/// The compressor, whose memory is used again for the next bytes. What it compressed before changes nothing.
#[derive(Default)]
pub(super) struct Deflater {
    block: Block,
    bits: Bits,
}

impl Deflater {
    /// Compresses bytes at a level from 1 to 9, with zlib's header and checksum (RFC 1950).
    pub fn zlib(&mut self, bytes: &[u8], distances: Distances, level: u8) -> Vec<u8> {
        if level == FASTEST {
            /// Deflate with a window of 32 KiB, at the fastest level.
            const HEADER: [u8; 2] = [0x78, 0x01];
            self.compress(bytes, distances, &HEADER);
            return [self.bits.finish(), &simd_adler32::adler32(&bytes).to_be_bytes()].concat();
        }
        miniz_oxide::deflate::compress_to_vec_zlib(bytes, level)
    }

    /// Writes a header, and a block for each [`BLOCK`] bytes.
    fn compress(&mut self, bytes: &[u8], distances: Distances, header: &[u8]) {
        let Self { block, bits } = self;
        bits.begin(header);
        let mut search = Search { bytes, at: 2, from: 0, places: [0; 1 << HASH_BITS] };
        let mut start = 0;
        loop {
            let stop = bytes.len().min(start + BLOCK);
            // The last step can go beyond.
            block.begin(bytes.len().min(BLOCK + 2 * STEPS));
            match distances {
                Distances::Even => search.fill::<2>(block, stop),
                Distances::All => search.fill::<1>(block, stop),
            }
            let is_last = stop == bytes.len();
            let end = if is_last { stop } else { search.at.min(bytes.len()).max(search.from) };
            block.write(&bytes[start..end], &bytes[search.from..end], is_last, bits);
            if is_last {
                return;
            }
            (start, search.from) = (end, end);
        }
    }
}

/// The search for bytes that were there before.
struct Search<'b> {
    bytes: &'b [u8],
    /// The next byte to look up. It is never the first, which is where an empty place leads.
    at: usize,
    /// The first byte that is in no sequence.
    from: usize,
    /// The places of words, by their hashes: the lowest 16 bits of a place below 16 bits of the hash.
    places: [u32; 1 << HASH_BITS],
}

impl Search<'_> {
    /// Adds the matches that begin before a byte, and looks up multiples of the least step.
    fn fill<const STEP: usize>(&mut self, block: &mut Block, stop: usize) {
        let Self { bytes, places, .. } = self;
        let (mut at, mut from, before_stop) = (self.at, self.from, &bytes[..stop]);
        while let Some(word) = word_at(before_stop, at) {
            // Odd, and near the golden ratio.
            let hash = (word as u32).wrapping_mul(0x9e37_79b1);
            let here = hash << 16 | u32::from(at as u16);
            let there = std::mem::replace(&mut places[(hash >> (32 - HASH_BITS)) as usize], here);
            if (here ^ there) >> 16 == 0
                && let Some(Match { back, length, distance }) =
                    repeated(bytes, at, word, there as u16, at - from)
            {
                block.push(&bytes[from..], at - back - from, length, distance);
                from = at - back + length;
                at = from.next_multiple_of(STEP);
            } else {
                at += STEP * (1 + (at - from) / STRIDE % STEPS);
            }
        }
        (self.at, self.from) = (at, from);
    }
}

/// Bytes that are repeated.
struct Match {
    /// The bytes that are before the one that was looked up.
    back: usize,
    length: usize,
    /// The distance less 1.
    distance: u16,
}

/// The match of the word at a byte and a place before it, of which the lowest 16 bits are known. It can begin up to `most_back` bytes
/// earlier.
#[inline(always)]
fn repeated(bytes: &[u8], at: usize, word: u64, place: u16, most_back: usize) -> Option<Match> {
    // A place that is farther than 16 bits tell looks nearer. Its bytes decide.
    let distance = (at as u16).wrapping_sub(place).wrapping_sub(1);
    let before = at.wrapping_sub(usize::from(distance) + 1);
    let differs = word ^ word_at(bytes, before)?;
    let needed = if usize::from(distance) < NEAR { WORD_OF_NEAR } else { WORD_OF_FAR };
    if differs & needed != 0 || usize::from(distance) >= WINDOW {
        return None;
    }
    // The next words are compared without a branch, which would often be predicted wrongly.
    let xor = |a: usize, b: usize| Some(word_at(bytes, a)? ^ word_at(bytes, b)?);
    let earlier = before.checked_sub(8).and_then(|before| xor(before, at - 8));
    let mut back = earlier.map_or(0, |differs| differs.leading_zeros() as usize / 8).min(most_back);
    if back == 8 {
        let (earlier, here) = (&bytes[..before - 8], &bytes[at - most_back..at - 8]);
        back += earlier.iter().rev().zip(here.iter().rev()).take_while(|(a, b)| a == b).count();
    }
    let differs = u128::from(differs) | u128::from(xor(before + 8, at + 8).unwrap_or(0)) << 64;
    let mut length = differs.trailing_zeros() as usize / 8;
    if length == 16 {
        length = 8 + common(bytes, before + 8, at + 8);
    }
    Some(Match { back, length: back + length, distance })
}

#[inline(always)]
fn word_at(bytes: &[u8], at: usize) -> Option<u64> {
    Some(u64::from_le_bytes(*bytes.get(at..)?.first_chunk()?))
}

#[cfg(test)]
mod tests {
    use miniz_oxide::inflate::{decompress_to_vec, decompress_to_vec_zlib};

    use super::*;

    fn noise(length: usize) -> impl Iterator<Item = u8> {
        (0..length as u64).map(|i| {
            let bits = (i + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            ((bits ^ bits >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 50) as u8
        })
    }

    /// Nothing, runs of all lengths near those of tokens, noise that is longer than a stored piece, and mixtures.
    fn inputs() -> Vec<Vec<u8>> {
        let mut all: Vec<Vec<u8>> =
            (0..20).chain(250..270).chain(510..530).map(|length| vec![7; length]).collect();
        all.push(vec![0; 3 * BLOCK + 1]);
        all.push(noise(3 * BLOCK + 5).collect());
        all.push(noise(100_000).map(|byte| byte % 3).collect());
        all.push((0..200_000_u32).flat_map(|i| (i / 50).to_le_bytes()).collect());
        // A copy at each distance about the greatest.
        for distance in [1, 2, 3, 500, 513, WINDOW - 1, WINDOW, WINDOW + 1] {
            let mut copied: Vec<u8> = noise(distance).collect();
            copied.extend_from_within(..);
            copied.extend_from_within(..);
            all.push(copied);
        }
        // Copies of noise at distances of any remainder by a step, behind noise.
        for distance in 5000..5040 {
            let mut copied: Vec<u8> = noise(distance).collect();
            copied.extend_from_within(..4000);
            all.push(copied);
        }
        // Numbers of literals before short matches, and lengths of matches about those of words.
        let parts = (0..2000).flat_map(|i| {
            noise(i % 23).map(move |byte| byte ^ i as u8).chain([7; 40].into_iter().take(i % 37))
        });
        all.push(parts.collect());
        // Bytes of which some are rare, one beside the other, so that the longest codes are, too.
        for length in [5000, 100_000] {
            let rare = |i: usize| (length / 2..length / 2 + 100).contains(&i);
            let often = noise(length).map(|byte| byte.trailing_zeros() as u8);
            all.push(often.enumerate().map(|(i, byte)| if rare(i) { i as u8 } else { byte }).collect());
        }
        // Noise that ends a block at any place.
        all.extend((BLOCK - 12..BLOCK + 12).map(|length| noise(length).chain([9; 300]).collect()));
        all
    }

    #[test]
    fn another_program_reads_what_was_compressed() {
        let mut deflater = Deflater::default();
        for input in inputs() {
            for level in [FASTEST, 2, 6] {
                let raw = deflate(&input, level);
                assert!(decompress_to_vec(&raw).unwrap() == input, "{} bytes at level {level}", input.len());
            }
            for distances in [Distances::Even, Distances::All] {
                // It checks the sum, too.
                let packed = deflater.zlib(&input, distances, FASTEST);
                let is_same = decompress_to_vec_zlib(&packed).unwrap() == input;
                assert!(is_same, "{} bytes with {distances:?}", input.len());
            }
        }
    }

    #[test]
    fn what_repeats_gets_small_and_noise_hardly_larger() {
        // 258 bytes a token of a bit or two, and a block's codes.
        assert!(deflate(&vec![1; 1_000_000], FASTEST).len() < 1_000_000 / 258 * 2 / 4);
        let noise: Vec<u8> = noise(1_000_000).collect();
        // 5 bytes for each piece of 64 KiB at most, of which a block can have four.
        assert!(deflate(&noise, FASTEST).len() <= noise.len() + 4 * 5 * (noise.len() / BLOCK + 1) + 5);
        let copied = [&noise[..20_000], &noise[..20_000]].concat();
        assert!(deflate(&copied, FASTEST).len() < 20_500);
    }

    #[test]
    fn memory_that_is_used_again_changes_nothing() {
        let mut deflater = Deflater::default();
        for input in inputs().iter().rev() {
            for distances in [Distances::Even, Distances::All] {
                let again = deflater.zlib(input, distances, FASTEST);
                let first = Deflater::default().zlib(input, distances, FASTEST);
                assert!(again == first, "{} bytes with {distances:?}", input.len());
            }
        }
    }

    #[test]
    fn what_the_sample_of_a_block_leaves_out_makes_it_hardly_larger() {
        // Every other 8 bytes are of one half of the alphabet, and the others of the other half.
        let halves = noise(300_000).enumerate().map(|(i, byte)| byte & 0x7f | ((i / 8 % 2) << 7) as u8);
        let input: Vec<u8> = halves.collect();
        let packed = deflate(&input, FASTEST);
        assert!(packed.len() <= input.len() + 100);
        assert_eq!(decompress_to_vec(&packed).unwrap(), input);
    }

    #[test]
    fn a_copy_of_noise_is_found_at_any_distance() {
        for distance in 6000..6070 {
            let noise: Vec<u8> = noise(distance).collect();
            let copied = [&noise[..], &noise[..4096]].concat();
            let distances = if distance % 2 == 0 { Distances::Even } else { Distances::All };
            let packed = Deflater::default().zlib(&copied, distances, FASTEST);
            assert!(packed.len() < distance + 1100, "{distance}");
        }
    }
}
