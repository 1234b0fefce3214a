//! Huffman's codes (RFC 1951, sections 3.2.2 and 3.2.7).

use super::bits::Room;

/// The longest code of a distance.
pub(super) const MOST_BITS: usize = 15;
/// About the least bits that the lengths of codes take, and the most bytes.
pub(super) const LEAST_BITS_OF_LENGTHS: u64 = 160;
pub(super) const MOST_BYTES_OF_LENGTHS: usize = 1024;

/// The code of a symbol with its first bit lowest, and what may stand behind it.
#[derive(Clone, Copy, Default)]
pub(super) struct Code {
    pub bits: u64,
    /// The number of the bits.
    pub count: u32,
}

impl Code {
    /// The code with so many bits behind it.
    #[inline(always)]
    pub fn with(self, more: u64, count: u32) -> Self {
        Self { bits: self.bits | more << self.count, count: self.count + count }
    }
}

/// Writes the lengths of codes, themselves in codes.
pub(super) fn write_lengths(literals: &[u8], distances: &[u8], room: &mut Room) {
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
    room.add(
        (literal_count - 257) as u64 | ((distance_count - 1) as u64) << 5 | ((count - 4) as u64) << 10,
        14,
    );
    for length in &ordered[..count] {
        room.add(u64::from(*length), 3);
    }
    for (symbol, more, extra) in symbols {
        let code = codes[usize::from(symbol)].with(more.into(), extra.into());
        room.add(code.bits, code.count);
    }
}

/// The lengths of Huffman's codes for symbols that occur so often, of at most so many bits. At least two symbols have codes.
pub(super) fn lengths_of_codes<const N: usize>(counts: &[u32; N], most: usize) -> [u8; N] {
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
pub(super) fn codes<const N: usize>(lengths: &[u8; N]) -> [Code; N] {
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
            return Code::default();
        }
        let code = next[usize::from(length)];
        next[usize::from(length)] += 1;
        Code { bits: (code.reverse_bits() >> (16 - u16::from(length))).into(), count: length.into() }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SYMBOLS: usize = 286;

    #[test]
    fn codes_are_complete_and_no_longer_than_allowed() {
        let fibonacci = {
            let (mut counts, mut pair) = ([0_u32; SYMBOLS], (1, 1));
            for count in &mut counts[..40] {
                *count = pair.0;
                pair = (pair.1, pair.0 + pair.1);
            }
            counts
        };
        let mut one = [0; SYMBOLS];
        one[77] = 5;
        for counts in [fibonacci, [1; SYMBOLS], one, [0; SYMBOLS]] {
            for most in [9, MOST_BITS] {
                let lengths = lengths_of_codes(&counts, most);
                let kraft: u32 =
                    lengths.iter().filter(|l| **l > 0).map(|l| 1 << (most - usize::from(*l))).sum();
                assert_eq!(kraft, 1 << most);
                assert!((0..SYMBOLS).all(|symbol| counts[symbol] == 0 || lengths[symbol] > 0));
                let by_count = |a: usize, b: usize| counts[a] <= counts[b] || lengths[a] <= lengths[b];
                assert!((0..40).all(|a| (0..40).all(|b| counts[a] == 0 || counts[b] == 0 || by_count(a, b))));
            }
        }
        // Two symbols have codes, even if one occurs or none.
        assert_eq!(lengths_of_codes(&one, MOST_BITS).iter().filter(|l| **l > 0).count(), 2);
    }
}
