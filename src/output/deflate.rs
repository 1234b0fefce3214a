//! Deflate (RFC 1951), fast, and the same bytes on every machine.
//!
//! The compressor of level 1 is made for arrays of numbers. It looks at one earlier place for each four bytes, takes what it finds,
//! and goes on in growing steps where nothing repeats. The large parts of such arrays are runs, channels beside their copies, and
//! noise, and a longer search finds little more in them: of the street's range images it makes files that are 3 % larger in 0.6 of the
//! time of miniz at its level 1. The higher levels are those of miniz.

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
/// The greatest length of a match, and the least that a token can have.
const LONGEST: usize = 258;
const SHORTEST: usize = 3;
/// The bits of an index of the table of places.
const HASH_BITS: u32 = 15;
/// The bytes of the input that share their codes. More of them make files larger that change on the way, and fewer take longer.
const BLOCK: usize = 64 * 1024;
/// A step grows by 1 byte for each `1 << SLOWNESS` bytes since the last match.
const SLOWNESS: u32 = 6;
/// A match at more than [`NEAR`] bytes must be as long as this, because its code is about as long as those of so many literals.
const LEAST_FAR: usize = 8;
const NEAR: usize = 512;
/// The longest code of a distance.
const MOST_BITS: usize = 15;
/// The longest code of a literal or a length: four fit beside the 7 bits that can wait.
const MOST_BITS_OF_LITERALS: usize = 14;
const END: usize = 256;
const LITERALS: usize = 286;
const DISTANCES: usize = 30;

/// Some literals and the match behind them, of length 0 if there is none.
#[derive(Clone, Copy)]
struct Sequence {
    literals: u32,
    length: u16,
    /// The distance less 1.
    distance: u16,
}

/// Compresses bytes at a level from 1 to 9.
pub(super) fn deflate(bytes: &[u8], level: u8) -> Vec<u8> {
    if level == FASTEST {
        let mut bits = Bits { bytes: Vec::with_capacity(bytes.len() / 2), waiting: 0, count: 0 };
        compress(bytes, &mut bits);
        return bits.finish();
    }
    miniz_oxide::deflate::compress_to_vec(bytes, level)
}

/// Compresses bytes at a level from 1 to 9, with zlib's header and checksum (RFC 1950).
pub(super) fn zlib(bytes: &[u8], level: u8) -> Vec<u8> {
    if level == FASTEST {
        /// Deflate with a window of 32 KiB, at the fastest level.
        const HEADER: [u8; 2] = [0x78, 0x01];
        let mut file = Vec::with_capacity(bytes.len() / 2);
        file.extend(HEADER);
        let mut bits = Bits { bytes: file, waiting: 0, count: 0 };
        compress(bytes, &mut bits);
        let mut file = bits.finish();
        file.extend(simd_adler32::adler32(&bytes).to_be_bytes());
        return file;
    }
    miniz_oxide::deflate::compress_to_vec_zlib(bytes, level)
}

/// Finds the matches, and writes a block for each [`BLOCK`] bytes.
fn compress(bytes: &[u8], bits: &mut Bits) {
    let mut places = vec![u32::MAX; 1 << HASH_BITS];
    let mut sequences: Vec<Sequence> = Vec::with_capacity(BLOCK / 4);
    // The next byte, the first that no sequence has, and the block's first.
    let (mut at, mut from, mut start) = (0, 0, 0);
    while at + 8 <= bytes.len() {
        let word = word_at(bytes, at);
        let place = &mut places[(word.wrapping_mul(0x9e37_79b1) >> (32 - HASH_BITS)) as usize];
        // Of a place that is farther than 32 bits tell, the distance comes out too large.
        let before = std::mem::replace(place, at as u32) as usize;
        let distance = at.wrapping_sub(before);
        let found = distance <= WINDOW && word_at(bytes, before) == word;
        let length = if found { 4 + common(bytes, before + 4, at + 4) } else { 0 };
        if length > 0 && (distance <= NEAR || length >= LEAST_FAR) {
            push(&mut sequences, at - from, length, distance);
            at += length;
            from = at;
        } else {
            at += 1 + ((at - from) >> SLOWNESS);
        }
        if at - start >= BLOCK {
            at = at.min(bytes.len());
            push(&mut sequences, at - from, 0, 1);
            write_block(&bytes[start..at], &sequences, false, bits);
            sequences.clear();
            (from, start) = (at, at);
        }
    }
    push(&mut sequences, bytes.len() - from, 0, 1);
    write_block(&bytes[start..], &sequences, true, bits);
}

/// Adds some literals and the match behind them, which can be longer than a token tells.
fn push(sequences: &mut Vec<Sequence>, literals: usize, length: usize, distance: usize) {
    let (mut literals, mut left) = (literals as u32, length);
    loop {
        // What is left is never too short for a token.
        let of_token = if left > LONGEST { LONGEST.min(left - SHORTEST) } else { left };
        sequences.push(Sequence { literals, length: of_token as u16, distance: (distance - 1) as u16 });
        (literals, left) = (0, left - of_token);
        if left == 0 {
            return;
        }
    }
}

#[inline(always)]
fn word_at(bytes: &[u8], at: usize) -> u32 {
    bytes[at..].first_chunk().map_or(0, |word| u32::from_le_bytes(*word))
}

/// Bits, the lowest first.
struct Bits {
    bytes: Vec<u8>,
    waiting: u64,
    count: u32,
}

impl Bits {
    /// Adds up to 32 bits.
    fn put(&mut self, bits: u64, count: u32) {
        self.waiting |= bits << self.count;
        self.count += count;
        while self.count >= 8 {
            self.bytes.push(self.waiting as u8);
            self.waiting >>= 8;
            self.count -= 8;
        }
    }

    fn fill_byte(&mut self) {
        self.put(0, (8 - self.count) % 8);
    }

    fn finish(mut self) -> Vec<u8> {
        self.fill_byte();
        self.bytes
    }

    /// Room for so many bits, in which those that wait are the first.
    fn room(&mut self, bits: u64) -> (usize, Room<'_>) {
        let start = self.bytes.len();
        self.bytes.resize(start + bits as usize / 8 + 2 * size_of::<u64>(), 0);
        (start, Room { bytes: &mut self.bytes[start..], at: 0, waiting: self.waiting, count: self.count })
    }
}

/// Bits in memory that is there already.
struct Room<'b> {
    bytes: &'b mut [u8],
    at: usize,
    waiting: u64,
    count: u32,
}

impl Room<'_> {
    /// Adds a code and so many bits behind it.
    #[inline(always)]
    fn add(&mut self, (code, length): Code, more: u64, extra: u32) {
        self.waiting |= (u64::from(code) | more << length) << self.count;
        self.count += u32::from(length) + extra;
    }

    /// Makes room for 56 bits.
    #[inline(always)]
    fn flush(&mut self) {
        self.bytes[self.at..self.at + size_of::<u64>()].copy_from_slice(&self.waiting.to_le_bytes());
        self.at += (self.count / 8) as usize;
        self.waiting >>= self.count & !7;
        self.count %= 8;
    }
}

/// The symbol of each length, the number of bits behind it, and these.
static OF_LENGTHS: [(u16, u8, u8); LONGEST + 1] = {
    let mut lengths = [(0, 0, 0); LONGEST + 1];
    let (mut symbol, mut length) = (257, SHORTEST);
    while symbol < 285 {
        let index = symbol - 257;
        let extra = if index < 8 { 0 } else { index / 4 - 1 };
        let mut more = 0;
        while more < 1 << extra && length < LONGEST {
            lengths[length] = (symbol as u16, extra as u8, more as u8);
            length += 1;
            more += 1;
        }
        symbol += 1;
    }
    lengths[LONGEST] = (285, 0, 0);
    lengths
};

/// The symbol of a distance less 1, the number of bits behind it and these.
#[inline(always)]
fn of_distance(distance: u16) -> (usize, u32, u64) {
    let distance = u32::from(distance);
    if distance < 4 {
        return (distance as usize, 0, 0);
    }
    let top = 31 - distance.leading_zeros();
    let extra = top - 1;
    let symbol = 2 * top + (distance >> extra & 1);
    (symbol as usize, extra, u64::from(distance & ((1 << extra) - 1)))
}

/// Writes a block with codes of its own, or as it is if that is shorter.
fn write_block(input: &[u8], sequences: &[Sequence], is_last: bool, bits: &mut Bits) {
    /// About the least that the lengths of codes take.
    const LEAST_BITS_OF_CODES: u64 = 160;
    let counts = Counts::of(input, sequences);
    let literals = lengths_of_codes(&counts.literals, MOST_BITS_OF_LITERALS);
    let distances = lengths_of_codes(&counts.distances, MOST_BITS);
    let size_bits = counts.bits(&literals, &distances);
    if size_bits + LEAST_BITS_OF_CODES > 8 * input.len() as u64 && !input.is_empty() {
        return write_stored(input, is_last, bits);
    }
    bits.put(u64::from(is_last) | 2 << 1, 3);
    write_lengths(&literals, &distances, bits);
    let (start, mut room) = bits.room(size_bits);
    write_sequences(input, sequences, &codes(&literals), &codes(&distances), &mut room);
    let Room { at, waiting, count, .. } = room;
    (bits.waiting, bits.count) = (waiting, count);
    bits.bytes.truncate(start + at);
}

/// The numbers of times that the symbols of a block occur.
struct Counts {
    literals: [u32; LITERALS],
    distances: [u32; DISTANCES],
}

impl Counts {
    fn of(input: &[u8], sequences: &[Sequence]) -> Self {
        // Neighbours count in arrays of their own: equal ones would wait for each other.
        let mut of_bytes = [[0_u32; 256]; 4];
        let (mut literals, mut distances) = ([0_u32; LITERALS], [0_u32; DISTANCES]);
        let mut at = 0;
        for sequence in sequences {
            let (fours, rest) = input[at..at + sequence.literals as usize].as_chunks::<4>();
            for four in fours {
                for (count, byte) in of_bytes.iter_mut().zip(four) {
                    count[usize::from(*byte)] += 1;
                }
            }
            for byte in rest {
                of_bytes[0][usize::from(*byte)] += 1;
            }
            at += sequence.literals as usize + usize::from(sequence.length);
            if sequence.length > 0 {
                literals[usize::from(OF_LENGTHS[usize::from(sequence.length)].0)] += 1;
                distances[of_distance(sequence.distance).0] += 1;
            }
        }
        for (byte, all) in literals[..END].iter_mut().enumerate() {
            *all = of_bytes.iter().map(|counts| counts[byte]).sum();
        }
        literals[END] = 1;
        Self { literals, distances }
    }

    /// The bits of all symbols in codes of these lengths, with the bits behind them.
    fn bits(&self, literals: &[u8; LITERALS], distances: &[u8; DISTANCES]) -> u64 {
        let all = |counts: &[u32], lengths: &[u8], extra: fn(u64) -> u64| -> u64 {
            let each = (0..).zip(counts).zip(lengths);
            each.map(|((symbol, count), length)| u64::from(*count) * (u64::from(*length) + extra(symbol)))
                .sum()
        };
        let of_lengths = |symbol: u64| if (265..285).contains(&symbol) { (symbol - 257) / 4 - 1 } else { 0 };
        all(&self.literals, literals, of_lengths)
            + all(&self.distances, distances, |symbol| (symbol / 2).saturating_sub(1))
    }
}

/// The code of a symbol with its lowest bit first, and its length.
type Code = (u16, u16);

fn write_sequences(
    input: &[u8],
    sequences: &[Sequence],
    literals: &[Code; LITERALS],
    distances: &[Code; DISTANCES],
    room: &mut Room,
) {
    // An array of 256 needs no check of a byte.
    let mut of_bytes = [(0, 0); END];
    of_bytes.copy_from_slice(&literals[..END]);
    let mut at = 0;
    for sequence in sequences {
        let (fours, rest) = input[at..at + sequence.literals as usize].as_chunks::<4>();
        for four in fours {
            four.iter().for_each(|byte| room.add(of_bytes[usize::from(*byte)], 0, 0));
            room.flush();
        }
        rest.iter().for_each(|byte| room.add(of_bytes[usize::from(*byte)], 0, 0));
        room.flush();
        at += sequence.literals as usize + usize::from(sequence.length);
        if sequence.length > 0 {
            let (symbol, extra, more) = OF_LENGTHS[usize::from(sequence.length)];
            room.add(literals[usize::from(symbol)], more.into(), extra.into());
            let (symbol, extra, more) = of_distance(sequence.distance);
            room.add(distances[symbol], more, extra);
            room.flush();
        }
    }
    room.add(literals[END], 0, 0);
    room.flush();
}

/// Writes a block as it is, in pieces whose length 16 bits tell.
fn write_stored(input: &[u8], is_last: bool, bits: &mut Bits) {
    let pieces = input.chunks(usize::from(u16::MAX));
    let last = pieces.len() - 1;
    for (index, piece) in pieces.enumerate() {
        bits.put(u64::from(is_last && index == last), 3);
        bits.fill_byte();
        let length = piece.len() as u16;
        bits.put(u64::from(length) | u64::from(!length) << 16, 32);
        bits.bytes.extend_from_slice(piece);
    }
}

/// Writes the lengths of codes, themselves in codes.
fn write_lengths(literals: &[u8], distances: &[u8], bits: &mut Bits) {
    /// The order in which the lengths of the codes of lengths come.
    const ORDER: [usize; 19] = [16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15];
    let used = |lengths: &[u8], least: usize| {
        lengths.iter().rposition(|length| *length > 0).map_or(least, |last| (last + 1).max(least))
    };
    let (literal_count, distance_count) = (used(literals, 257), used(distances, 1));
    let all: Vec<u8> = [&literals[..literal_count], &distances[..distance_count]].concat();
    // Each symbol with the number behind it and that number's bits.
    let mut symbols: Vec<(u8, u8, u8)> = Vec::with_capacity(all.len());
    for run in all.chunk_by(|a, b| a == b) {
        let (length, mut left) = (run[0], run.len());
        if length > 0 {
            symbols.push((length, 0, 0));
            left -= 1;
        }
        while left > 0 {
            let (symbol, least, most, extra) = match (length, left) {
                (0, 11..) => (18, 11, 138, 7),
                (0, _) => (17, 3, 10, 3),
                _ => (16, 3, 6, 2),
            };
            if left < least {
                symbols.extend(std::iter::repeat_n((length, 0, 0), left));
                break;
            }
            let taken = left.min(most);
            symbols.push((symbol, (taken - least) as u8, extra));
            left -= taken;
        }
    }
    let mut counts = [0; 19];
    for (symbol, ..) in &symbols {
        counts[usize::from(*symbol)] += 1;
    }
    let lengths = lengths_of_codes(&counts, 7);
    let codes = codes(&lengths);
    let ordered = ORDER.map(|symbol| lengths[symbol]);
    let count = used(&ordered, 4);
    bits.put(
        (literal_count - 257) as u64 | ((distance_count - 1) as u64) << 5 | ((count - 4) as u64) << 10,
        14,
    );
    for length in &ordered[..count] {
        bits.put(u64::from(*length), 3);
    }
    for (symbol, more, extra) in symbols {
        let (code, length) = codes[usize::from(symbol)];
        bits.put(u64::from(code) | u64::from(more) << length, u32::from(length) + u32::from(extra));
    }
}

/// The lengths of Huffman's codes for symbols that occur so often, of at most so many bits. At least two symbols have codes.
fn lengths_of_codes<const N: usize>(counts: &[u32; N], most: usize) -> [u8; N] {
    // Each with its count above its symbol.
    let mut leaves: Vec<u64> = Vec::with_capacity(N);
    let used = (0..).zip(counts).filter(|(_, count)| **count > 0);
    leaves.extend(used.map(|(symbol, count)| u64::from(*count) << 16 | symbol));
    for (symbol, count) in (0..2).zip(counts) {
        if leaves.len() < 2 && *count == 0 {
            leaves.push(1 << 16 | symbol);
        }
    }
    leaves.sort_unstable();
    let weights = leaves.iter().map(|leaf| (leaf >> 16) as u32).collect();
    let numbers = numbers_of_codes(weights, most);
    // The rarest symbols have the longest codes.
    let mut lengths = [0; N];
    let each = (1..=most).rev().flat_map(|length| (0..numbers[length]).map(move |_| length as u8));
    for (leaf, length) in leaves.iter().zip(each) {
        lengths[(leaf & 0xffff) as usize] = length;
    }
    lengths
}

/// How many of Huffman's codes have each length of at most so many bits, of weights in ascending order.
fn numbers_of_codes(mut weights: Vec<u32>, most: usize) -> [u32; MOST_BITS + 1] {
    let count = weights.len();
    let nodes = 2 * count - 1;
    let mut parents = vec![0_u16; nodes];
    // Nodes have ascending weights in the order in which they are made: two queues are enough.
    let (mut leaf, mut node) = (0, count);
    for made in count..nodes {
        let mut weight = 0;
        for _ in 0..2 {
            let is_leaf = leaf < count && (node >= made || weights[leaf] <= weights[node]);
            let least = if is_leaf { &mut leaf } else { &mut node };
            weight += weights[*least];
            parents[*least] = made as u16;
            *least += 1;
        }
        weights.push(weight);
    }
    let mut depths = vec![0_u8; nodes];
    let mut numbers = [0; MOST_BITS + 1];
    for index in (0..nodes - 1).rev() {
        depths[index] = depths[usize::from(parents[index])] + 1;
        if index < count {
            numbers[usize::from(depths[index]).min(most)] += 1;
        }
    }
    // Codes that were too long are cut, which makes them too many by these. A shorter one gets longer, and has one of them beside it.
    let space: u32 = (1..=most).map(|length| numbers[length] << (most - length)).sum();
    for _ in 1 << most..space {
        let shorter = (1..most).rev().find(|length| numbers[*length] > 0).unwrap_or(1);
        numbers[shorter] -= 1;
        numbers[shorter + 1] += 2;
        numbers[most] -= 1;
    }
    numbers
}

/// The codes of these lengths.
fn codes<const N: usize>(lengths: &[u8; N]) -> [Code; N] {
    let mut numbers = [0_u16; MOST_BITS + 2];
    for length in lengths.iter().filter(|length| **length > 0) {
        numbers[usize::from(*length) + 1] += 1;
    }
    let mut next = [0_u16; MOST_BITS + 1];
    let mut code = 0;
    for (next, number) in next.iter_mut().zip(numbers).skip(1) {
        code = (code + number) << 1;
        *next = code;
    }
    lengths.map(|length| {
        if length == 0 {
            return (0, 0);
        }
        let code = next[usize::from(length)];
        next[usize::from(length)] += 1;
        (code.reverse_bits() >> (16 - u16::from(length)), length.into())
    })
}

#[cfg(test)]
mod tests {
    use miniz_oxide::inflate::{decompress_to_vec, decompress_to_vec_zlib};

    use super::*;

    fn noise(length: usize) -> impl Iterator<Item = u8> {
        (0..length as u64).map(|i| (i.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 37) as u8)
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
        // Noise that ends a block at any place.
        all.extend((BLOCK - 12..BLOCK + 12).map(|length| noise(length).chain([9; 300]).collect()));
        all
    }

    #[test]
    fn another_program_reads_what_was_compressed() {
        for input in inputs() {
            for level in [FASTEST, 2, 6] {
                let raw = deflate(&input, level);
                assert!(decompress_to_vec(&raw).unwrap() == input, "{} bytes at level {level}", input.len());
            }
            // It checks the sum, too.
            assert!(
                decompress_to_vec_zlib(&zlib(&input, FASTEST)).unwrap() == input,
                "{} bytes",
                input.len()
            );
        }
    }

    #[test]
    fn what_repeats_gets_small_and_noise_hardly_larger() {
        // 258 bytes a token of a bit or two, and a block's codes.
        assert!(deflate(&vec![1; 1_000_000], FASTEST).len() < 1_000_000 / 258 * 2 / 4);
        let noise: Vec<u8> = noise(1_000_000).collect();
        // 5 bytes for each piece of 64 KiB at most, of which a block can have two.
        assert!(deflate(&noise, FASTEST).len() <= noise.len() + 2 * 5 * (noise.len() / BLOCK + 1) + 5);
        let copied = [&noise[..20_000], &noise[..20_000]].concat();
        assert!(deflate(&copied, FASTEST).len() < 20_500);
    }

    #[test]
    fn codes_are_complete_and_no_longer_than_allowed() {
        let fibonacci = {
            let (mut counts, mut pair) = ([0_u32; LITERALS], (1, 1));
            for count in &mut counts[..40] {
                *count = pair.0;
                pair = (pair.1, pair.0 + pair.1);
            }
            counts
        };
        let mut one = [0; LITERALS];
        one[77] = 5;
        for counts in [fibonacci, [1; LITERALS], one, [0; LITERALS]] {
            for most in [9, MOST_BITS] {
                let lengths = lengths_of_codes(&counts, most);
                let kraft: u32 =
                    lengths.iter().filter(|l| **l > 0).map(|l| 1 << (most - usize::from(*l))).sum();
                assert_eq!(kraft, 1 << most);
                assert!((0..LITERALS).all(|symbol| counts[symbol] == 0 || lengths[symbol] > 0));
                let by_count = |a: usize, b: usize| counts[a] <= counts[b] || lengths[a] <= lengths[b];
                assert!((0..40).all(|a| (0..40).all(|b| counts[a] == 0 || counts[b] == 0 || by_count(a, b))));
            }
        }
        // Two symbols have codes, even if one occurs or none.
        assert_eq!(lengths_of_codes(&one, MOST_BITS).iter().filter(|l| **l > 0).count(), 2);
    }

    /// The tables of RFC 1951, section 3.2.5.
    #[test]
    fn lengths_and_distances_have_their_symbols() {
        let length = |length: usize| OF_LENGTHS[length];
        assert_eq!([3, 10, 11, 12].map(length), [(257, 0, 0), (264, 0, 0), (265, 1, 0), (265, 1, 1)]);
        assert_eq!([226, 227, 257, 258].map(length), [(283, 5, 31), (284, 5, 0), (284, 5, 30), (285, 0, 0)]);
        let distance = |distance: u16| of_distance(distance - 1);
        assert_eq!([1, 4, 5, 6].map(distance), [(0, 0, 0), (3, 0, 0), (4, 1, 0), (4, 1, 1)]);
        assert_eq!([24_576, 24_577, 32_768].map(distance), [(28, 13, 8191), (29, 13, 0), (29, 13, 8191)]);
    }
}
