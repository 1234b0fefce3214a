//! Bits in memory, the lowest of a byte first.

/// Bits that were written. The memory is used again for the next ones.
#[derive(Default)]
pub(super) struct Bits {
    bytes: Vec<u8>,
    /// The bytes that are whole.
    at: usize,
    waiting: u64,
    count: u32,
}

impl Bits {
    /// Forgets the bits that were written, and begins with bytes.
    pub fn begin(&mut self, bytes: &[u8]) {
        (self.at, self.count) = (0, 0);
        self.room(bytes.len()).add_bytes(bytes);
        self.at = bytes.len();
    }

    /// Room for so many bytes. What was written there counts when [`Self::keep`] gets it.
    pub fn room(&mut self, bytes: usize) -> Room<'_> {
        let needed = self.at + bytes + 2 * size_of::<u64>();
        if self.bytes.len() < needed {
            self.bytes.resize(needed, 0);
        }
        Room { bytes: &mut self.bytes[self.at..], at: 0, waiting: self.waiting, count: self.count }
    }

    /// Keeps what was written to the room, at its `end`.
    pub fn keep(&mut self, end: End) {
        self.at += end.at;
        (self.waiting, self.count) = (end.waiting, end.count);
    }

    /// All bytes, of which the last is filled with zeros.
    pub fn finish(&self) -> &[u8] {
        &self.bytes[..self.at + usize::from(self.count > 0)]
    }
}

/// Room for bits.
pub(super) struct Room<'b> {
    bytes: &'b mut [u8],
    at: usize,
    /// The bits that are not yet in a whole byte are at the top, the last of them highest. What is below them has no meaning.
    waiting: u64,
    count: u32,
}

/// Where the bits of a room end.
pub(super) struct End {
    at: usize,
    waiting: u64,
    count: u32,
}

/// Up to 14 bits at the top, the last of them highest, above their number.
#[derive(Clone, Copy, Default)]
pub(super) struct Raised(u64);

impl Raised {
    pub fn new(bits: u64, count: u32) -> Self {
        Self(bits.wrapping_shl(count.wrapping_neg()) | u64::from(count))
    }

    /// The same bits if `keep` is all ones, and none if it is 0.
    #[inline(always)]
    pub fn masked(self, keep: u64) -> Self {
        Self(self.0 & keep)
    }
}

impl End {
    /// The bytes that were written, of which the last need not be full.
    pub fn bytes(&self) -> usize {
        self.at + usize::from(self.count > 0)
    }
}

impl Room<'_> {
    /// Adds up to 56 bits. The others are 0.
    #[inline(always)]
    pub fn add(&mut self, bits: u64, count: u32) {
        self.waiting = self.waiting.wrapping_shr(count) | bits.wrapping_shl(count.wrapping_neg());
        self.count += count;
        self.flush();
    }

    /// Adds four times some bits.
    ///
    /// Bits move down by the number of those behind them. Shifts take the lowest 6 bits of a number, so that the numbers need not be
    /// taken out of the words first. What numbers leave behind is in the lowest 8 bits, which 56 bits do not reach.
    #[inline(always)]
    pub fn add_four(&mut self, [a, b, c, d]: [Raised; 4]) {
        let pair = |first: Raised, second: Raised| {
            (first.0.wrapping_shr(second.0 as u32) | second.0, (first.0 as u32).wrapping_add(second.0 as u32))
        };
        let ((ab, of_ab), (cd, of_cd)) = (pair(a, b), pair(c, d));
        let count = of_ab.wrapping_add(of_cd) & 0xff;
        self.waiting = self.waiting.wrapping_shr(count) | (ab.wrapping_shr(of_cd) | cd) & !0xff;
        self.count += count;
        self.flush();
    }

    /// Moves whole bytes to memory. Fewer than 8 bits wait then.
    #[inline(always)]
    fn flush(&mut self) {
        // Without a bit, this is no shift, and the next bits overwrite what is written here.
        let word = self.waiting.wrapping_shr(self.count.wrapping_neg());
        self.bytes[self.at..self.at + size_of::<u64>()].copy_from_slice(&word.to_le_bytes());
        self.at += (self.count / 8) as usize;
        self.count %= 8;
    }

    /// Adds zeros up to a whole byte.
    pub fn fill_byte(&mut self) {
        self.add(0, (8 - self.count) % 8);
    }

    /// Adds bytes behind a whole one.
    pub fn add_bytes(&mut self, bytes: &[u8]) {
        self.bytes[self.at..self.at + bytes.len()].copy_from_slice(bytes);
        self.at += bytes.len();
    }

    pub fn end(self) -> End {
        End { at: self.at, waiting: self.waiting, count: self.count }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Codes of all lengths up to the longest, between other numbers of bits.
    #[test]
    fn bits_come_in_the_order_in_which_they_were_added() {
        let mut bits = Bits::default();
        bits.begin(&[0xa5]);
        let mut expected: Vec<bool> = (0..8).map(|bit| 0xa5 >> bit & 1 == 1).collect();
        let mut number = 1_u64;
        let mut next = |most: u32| {
            number = number.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let count = (number >> 60) as u32 % (most + 1);
            (number >> 13 & ((1 << count) - 1), count)
        };
        for round in 0..3000 {
            let mut room = bits.room(64);
            let least = if round % 2 == 0 { 0 } else { 14 };
            let four = [(); 4].map(|()| next(14)).map(|(bits, count)| (bits, count.max(least)));
            room.add_four(four.map(|(bits, count)| Raised::new(bits, count)));
            let (more, count) = next(15);
            room.add(more, count);
            for (bits, count) in four.into_iter().chain([(more, count)]) {
                expected.extend((0..count).map(|bit| bits >> bit & 1 == 1));
            }
            if round % 100 == 0 {
                room.fill_byte();
                room.add_bytes(&[0x5a]);
                expected.resize(expected.len().next_multiple_of(8), false);
                expected.extend((0..8).map(|bit| 0x5a >> bit & 1 == 1));
            }
            let end = room.end();
            bits.keep(end);
        }
        let of_bits = |byte: &[bool]| byte.iter().rev().fold(0, |all, bit| all << 1 | u8::from(*bit));
        assert!(bits.finish() == expected.chunks(8).map(of_bits).collect::<Vec<u8>>());
    }
}
