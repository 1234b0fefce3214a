//! The blocks of deflate: their literals and matches, and how they are written (RFC 1951, section 3.2).

use super::bits::{Bits, Raised, Room};
use super::codes::{
    Code, LEAST_BITS_OF_LENGTHS, MOST_BITS, MOST_BYTES_OF_LENGTHS, codes, lengths_of_codes, write_lengths,
};

/// The greatest length of a match, and the least that a token can have.
const LONGEST: usize = 258;
const SHORTEST: usize = 3;
/// The longest code of a literal or a length: four fit beside the 7 bits that can wait.
const MOST_BITS_OF_LITERALS: usize = 14;
const END: usize = 256;
const LITERALS: usize = 286;
const DISTANCES: usize = 30;
/// Up to this many literals are copied at once, with what is behind them.
const PIECE: usize = 16;

/// Some literals and the match behind them.
#[derive(Clone, Copy)]
struct Sequence {
    literals: u32,
    length: u16,
    /// The distance less 1.
    distance: u16,
}

/// The literals and the matches of a block. The memory is used again for the next block.
#[derive(Default)]
pub(super) struct Block {
    /// The literals of all sequences and those behind the last match, and then bytes without a meaning, at least [`PIECE`].
    literals: Vec<u8>,
    literal_count: usize,
    sequences: Vec<Sequence>,
}

impl Block {
    /// Begins a block of so many literals at most.
    pub fn begin(&mut self, most_literals: usize) {
        self.literal_count = 0;
        self.sequences.clear();
        if self.literals.len() < most_literals + PIECE {
            self.literals.resize(most_literals + PIECE, 0);
        }
    }

    /// Adds so many of the bytes as literals, and the match behind them, which can be longer than a token tells. The distance is
    /// less 1.
    #[inline(always)]
    pub fn push(&mut self, bytes: &[u8], literals: usize, length: usize, distance: u16) {
        self.push_literals(bytes, literals);
        let literals = literals as u32;
        if length <= LONGEST {
            self.sequences.push(Sequence { literals, length: length as u16, distance });
        } else {
            self.push_long(Sequence { literals, length: 0, distance }, length);
        }
    }

    /// Adds a match that needs several tokens.
    #[inline(never)]
    fn push_long(&mut self, mut sequence: Sequence, mut left: usize) {
        while left > 0 {
            // The rest of a match is never too short for a token.
            let of_token = if left > LONGEST { LONGEST.min(left - SHORTEST) } else { left };
            self.sequences.push(Sequence { length: of_token as u16, ..sequence });
            sequence.literals = 0;
            left -= of_token;
        }
    }

    /// Adds so many of the bytes as literals.
    #[inline(always)]
    fn push_literals(&mut self, bytes: &[u8], count: usize) {
        let room = &mut self.literals[self.literal_count..];
        match (room.first_chunk_mut::<PIECE>(), bytes.first_chunk::<PIECE>()) {
            // A copy of a fixed length takes less time than a call.
            (Some(room), Some(piece)) if count <= PIECE => *room = *piece,
            _ => room[..count].copy_from_slice(&bytes[..count]),
        }
        self.literal_count += count;
    }

    /// Writes the block with codes of its own, or as the `input` is if that is shorter. `rest` are the literals behind the last
    /// match.
    pub fn write(&mut self, input: &[u8], rest: &[u8], is_last: bool, bits: &mut Bits) {
        self.push_literals(rest, rest.len());
        let counts = Counts::of(self);
        let literals = lengths_of_codes(&counts.literals, MOST_BITS_OF_LITERALS);
        let distances = lengths_of_codes(&counts.distances, MOST_BITS);
        let about = (counts.bits(&literals, &distances) + LEAST_BITS_OF_LENGTHS) / 8;
        if about <= input.len() as u64 || input.is_empty() {
            let mut room = bits.room(self.most_bytes() + MOST_BYTES_OF_LENGTHS);
            room.add(u64::from(is_last) | 2 << 1, 3);
            write_lengths(&literals, &distances, &mut room);
            let end = self.write_symbols(&codes(&literals), &codes(&distances), room).end();
            if end.bytes() <= input.len() || input.is_empty() {
                return bits.keep(end);
            }
        }
        let mut room = bits.room(input.len() + BYTES_OF_PIECE * (input.len() / MOST_OF_PIECE + 1));
        write_stored(input, is_last, &mut room);
        let end = room.end();
        bits.keep(end);
    }

    /// The most bytes that the literals and the matches take.
    fn most_bytes(&self) -> usize {
        /// A length has up to 5 bits behind its code, and a distance 13.
        const MOST_BITS_OF_MATCH: usize = MOST_BITS_OF_LITERALS + 5 + MOST_BITS + 13;
        (self.literal_count * MOST_BITS_OF_LITERALS + self.sequences.len() * MOST_BITS_OF_MATCH) / 8
    }

    /// Writes the literals and the matches. The room comes and goes, so that its fields stay in registers.
    fn write_symbols<'b>(
        &self,
        literals: &[Code; LITERALS],
        distances: &[Code; DISTANCES],
        mut room: Room<'b>,
    ) -> Room<'b> {
        let tables = Tables::of(literals, distances);
        let mut at = 0;
        for sequence in &self.sequences {
            let count = sequence.literals as usize;
            let (fours, rest) = self.literals[at..at + count].as_chunks();
            for four in fours {
                room.add_four(four.map(|byte| tables.literals[usize::from(byte)]));
            }
            at += count;
            // Three codes are looked up for any number that is left: a branch for each would often be predicted wrongly.
            if let Some(three) = self.literals[at - rest.len()..].first_chunk::<3>() {
                let [a, b, c] = three.map(|byte| tables.literals[usize::from(byte)]);
                let [with_a, with_b, with_c] = WITH[rest.len() & 3];
                room.add_four([a.masked(with_a), b.masked(with_b), c.masked(with_c), Raised::default()]);
            }
            let length = tables.lengths[usize::from(sequence.length) % TABLE_OF_LENGTHS];
            let (symbol, extra, more) = of_distance(sequence.distance);
            let distance = tables.distances[symbol % TABLE_OF_DISTANCES].with(more, extra);
            let both = length.with(distance.bits, distance.count);
            room.add(both.bits, both.count);
        }
        let (fours, rest) = self.literals[at..self.literal_count].as_chunks();
        for four in fours {
            room.add_four(four.map(|byte| tables.literals[usize::from(byte)]));
        }
        for byte in rest {
            let code = literals[usize::from(*byte)];
            room.add(code.bits, code.count);
        }
        room.add(literals[END].bits, literals[END].count);
        room
    }
}

/// Masks of three literals that keep the first none, one, two or three of them.
static WITH: [[u64; 3]; 4] = {
    const ALL: u64 = u64::MAX;
    [[0, 0, 0], [ALL, 0, 0], [ALL, ALL, 0], [ALL, ALL, ALL]]
};

/// The codes of a block, in powers of two, so that an index needs no check.
struct Tables {
    literals: [Raised; 256],
    /// The codes of lengths, with the bits behind them.
    lengths: [Code; TABLE_OF_LENGTHS],
    distances: [Code; TABLE_OF_DISTANCES],
}

const TABLE_OF_LENGTHS: usize = 512;
const TABLE_OF_DISTANCES: usize = 32;

impl Tables {
    fn of(literals: &[Code; LITERALS], distances: &[Code; DISTANCES]) -> Self {
        let mut tables = Self {
            literals: [Raised::default(); 256],
            lengths: [Code::default(); TABLE_OF_LENGTHS],
            distances: [Code::default(); TABLE_OF_DISTANCES],
        };
        for (raised, code) in tables.literals.iter_mut().zip(literals) {
            *raised = Raised::new(code.bits, code.count);
        }
        for (code, (symbol, extra, more)) in tables.lengths.iter_mut().zip(OF_LENGTHS).skip(SHORTEST) {
            *code = literals[usize::from(symbol)].with(more.into(), extra.into());
        }
        tables.distances[..DISTANCES].copy_from_slice(distances);
        tables
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

/// Of so many literals or more a half is counted, which makes files larger by some ten-thousandths.
const SAMPLED: usize = 10_000;

/// The numbers of times that the symbols of a block occur, of literals about.
struct Counts {
    literals: [u32; LITERALS],
    distances: [u32; DISTANCES],
}

impl Counts {
    fn of(block: &Block) -> Self {
        let all = &block.literals[..block.literal_count];
        let is_sample = all.len() >= SAMPLED;
        // Neighbours count in arrays of their own: equal ones would wait for each other.
        let mut of_bytes = [[0_u32; 256]; 4];
        let (fours, rest) = all.as_chunks::<4>();
        let mut count = |four: &[u8; 4]| {
            for (count, byte) in of_bytes.iter_mut().zip(four) {
                count[usize::from(*byte)] += 1;
            }
        };
        if is_sample {
            fours.chunks_exact(4).flat_map(|fours| &fours[..2]).for_each(count);
        } else {
            fours.iter().for_each(&mut count);
            for byte in rest {
                of_bytes[0][usize::from(*byte)] += 1;
            }
        }
        let (mut literals, mut distances) = ([0_u32; LITERALS], [0_u32; DISTANCES]);
        for (byte, all) in literals[..END].iter_mut().enumerate() {
            let count: u32 = of_bytes.iter().map(|counts| counts[byte]).sum();
            // A byte that is not in the sample can occur, and needs a code.
            *all = if is_sample { 2 * count + 1 } else { count };
        }
        for sequence in &block.sequences {
            literals[usize::from(OF_LENGTHS[usize::from(sequence.length)].0)] += 1;
            distances[of_distance(sequence.distance).0] += 1;
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

/// The most bytes of a piece of a stored block, and the most that are before them.
const MOST_OF_PIECE: usize = u16::MAX as usize;
const BYTES_OF_PIECE: usize = 6;

/// Writes a block as it is, in pieces whose length 16 bits tell.
fn write_stored(input: &[u8], is_last: bool, room: &mut Room) {
    let pieces = input.chunks(MOST_OF_PIECE);
    let last = pieces.len() - 1;
    for (index, piece) in pieces.enumerate() {
        room.add(u64::from(is_last && index == last), 3);
        room.fill_byte();
        let length = piece.len() as u16;
        room.add(u64::from(length) | u64::from(!length) << 16, 32);
        room.add_bytes(piece);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
