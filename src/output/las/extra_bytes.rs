//! The layers of extra bytes in a chunk of a LAZ.
//!
//! LASzip codes each extra byte of the points as the difference from the point before, in a layer of its own, by an adaptive
//! arithmetic coder (Isenburg, "LASzip: lossless compression of LiDAR data", 2013; Said, "Introduction to Arithmetic Coding", 2004, with
//! the carries of its section 2.3). Most extra bytes are the upper ones of small numbers: a layer whose byte never changes is empty, and
//! is not coded at all here, which takes half of the time off a cloud of ours.

/// The bits of a probability.
const PROBABILITY_BITS: u32 = 15;
/// The interval is widened when it is shorter.
const LEAST_LENGTH: u32 = 1 << 24;

/// The layers of the bytes of each record from `first` on. The layer of a byte that never changes is empty.
pub(super) fn layers(records: &[u8], record_bytes: usize, first: usize) -> Vec<Vec<u8>> {
    // The columns are gathered in one pass, since a chunk is larger than the caches near a core.
    let count = records.len() / record_bytes;
    let mut columns = vec![0; (record_bytes - first) * count];
    for (number, record) in records.chunks_exact(record_bytes).enumerate() {
        for (place, byte) in columns[number..].iter_mut().step_by(count).zip(&record[first..]) {
            *place = *byte;
        }
    }
    columns.chunks_exact(count.max(1)).map(layer).collect()
}

fn layer(bytes: &[u8]) -> Vec<u8> {
    if bytes.windows(2).all(|pair| pair[0] == pair[1]) {
        return Vec::new();
    }
    let (mut model, mut coder) = (Model::new(), Coder::new());
    for pair in bytes.windows(2) {
        coder.add(&mut model, pair[1].wrapping_sub(pair[0]));
    }
    coder.finish()
}

/// The frequencies of 256 symbols, which follow what is coded.
struct Model {
    /// The sum of the probabilities of the symbols before each.
    before: [u32; 256],
    counts: [u32; 256],
    total: u32,
    /// The number of symbols from one update to the next, and to the next.
    cycle: u32,
    left: u32,
}

impl Model {
    fn new() -> Self {
        let mut model = Self { before: [0; 256], counts: [1; 256], total: 0, cycle: 256, left: 0 };
        model.update();
        model.cycle = (256 + 6) / 2;
        model.left = model.cycle;
        model
    }

    /// Takes the counts so far as probabilities.
    fn update(&mut self) {
        const MOST: u32 = 1 << PROBABILITY_BITS;
        const LONGEST_CYCLE: u32 = (256 + 6) * 8;
        self.total += self.cycle;
        if self.total > MOST {
            self.counts.iter_mut().for_each(|count| *count = count.div_ceil(2));
            self.total = self.counts.iter().sum();
        }
        let scale = (1 << 31) / self.total;
        let mut sum = 0;
        for (before, count) in self.before.iter_mut().zip(&self.counts) {
            *before = (scale * sum) >> (31 - PROBABILITY_BITS);
            sum += count;
        }
        self.cycle = (self.cycle * 5 / 4).min(LONGEST_CYCLE);
        self.left = self.cycle;
    }
}

/// The interval that the symbols so far leave, and its bytes that cannot change but by a carry.
struct Coder {
    bytes: Vec<u8>,
    base: u32,
    length: u32,
}

impl Coder {
    fn new() -> Self {
        Self { bytes: Vec::new(), base: 0, length: u32::MAX }
    }

    #[inline(always)]
    fn add(&mut self, model: &mut Model, symbol: u8) {
        let symbol = usize::from(symbol);
        let part = self.length >> PROBABILITY_BITS;
        let below = model.before[symbol] * part;
        // The last symbol has all that is left.
        self.length = match model.before.get(symbol + 1) {
            Some(end) => end * part - below,
            None => self.length - below,
        };
        self.move_base(below);
        if self.length < LEAST_LENGTH {
            self.widen();
        }
        model.counts[symbol] += 1;
        model.left -= 1;
        if model.left == 0 {
            model.update();
        }
    }

    fn move_base(&mut self, by: u32) {
        let carries;
        (self.base, carries) = self.base.overflowing_add(by);
        if carries {
            for byte in self.bytes.iter_mut().rev() {
                *byte = byte.wrapping_add(1);
                if *byte != 0 {
                    break;
                }
            }
        }
    }

    fn widen(&mut self) {
        while self.length < LEAST_LENGTH {
            self.bytes.push((self.base >> 24) as u8);
            self.base <<= 8;
            self.length <<= 8;
        }
    }

    /// The bytes, with the last ones that tell a place in the interval, and those that decoders read ahead.
    fn finish(mut self) -> Vec<u8> {
        let is_long = self.length > 2 * LEAST_LENGTH;
        let (by, length) =
            if is_long { (LEAST_LENGTH, LEAST_LENGTH >> 1) } else { (LEAST_LENGTH >> 1, LEAST_LENGTH >> 9) };
        self.move_base(by);
        self.length = length;
        self.widen();
        self.bytes.extend(if is_long { &[0; 3][..] } else { &[0; 2] });
        self.bytes
    }
}
