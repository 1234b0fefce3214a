//! The values of points as streams, one for each field, and the packets that they are cut into.

use std::fmt::Write as _;

/// The values of a field, one for each point.
pub(super) struct Column {
    name: &'static str,
    values: Values,
}

enum Values {
    /// Floats of 32 bits.
    Singles(Vec<u8>),
    /// Floats of 64 bits.
    Doubles(Vec<u8>),
    /// Integers from 0 to `most`, each with as many bits as `most` needs.
    Integers { most: u64, values: Vec<u32> },
}

impl Column {
    /// Floats of 32 bits of so many points.
    pub fn singles(name: &'static str, points: usize) -> Self {
        Self { name, values: Values::Singles(Vec::with_capacity(4 * points)) }
    }

    /// Floats of 64 bits.
    pub fn doubles(name: &'static str, points: usize) -> Self {
        Self { name, values: Values::Doubles(Vec::with_capacity(8 * points)) }
    }

    /// Integers from 0 to `most`, or to the largest that is appended. There are two numbers at least, because some readers have no integers without bits.
    pub fn integers(name: &'static str, most: u64, points: usize) -> Self {
        Self { name, values: Values::Integers { most: most.max(1), values: Vec::with_capacity(points) } }
    }

    /// Appends a float, rounded to the field's own precision.
    pub fn push(&mut self, value: f64) {
        match &mut self.values {
            Values::Singles(bytes) => bytes.extend_from_slice(&(value as f32).to_le_bytes()),
            Values::Doubles(bytes) => bytes.extend_from_slice(&value.to_le_bytes()),
            Values::Integers { .. } => panic!("{} has integers", self.name),
        }
    }

    /// Appends an integer.
    pub fn push_index(&mut self, index: u32) {
        match &mut self.values {
            Values::Integers { most, values } => {
                *most = (*most).max(u64::from(index));
                values.push(index);
            }
            _ => panic!("{} has floats", self.name),
        }
    }

    /// The field in a prototype.
    pub fn describe(&self, xml: &mut String) {
        let kind = match &self.values {
            Values::Singles(_) => "type=\"Float\" precision=\"single\"".to_owned(),
            Values::Doubles(_) => "type=\"Float\"".to_owned(),
            Values::Integers { most, .. } => format!("type=\"Integer\" minimum=\"0\" maximum=\"{most}\""),
        };
        let _ = writeln!(xml, "<{} {kind}/>", self.name);
    }

    /// The bits of a value.
    fn bits(&self) -> usize {
        match &self.values {
            Values::Singles(_) => 32,
            Values::Doubles(_) => 64,
            Values::Integers { most, .. } => most.ilog2() as usize + 1,
        }
    }

    /// Appends the stream of some of the points, the first bit of a byte being its lowest. It ends with a whole byte.
    fn add(&self, points: std::ops::Range<usize>, packet: &mut Vec<u8>) {
        match &self.values {
            Values::Singles(bytes) => packet.extend_from_slice(&bytes[4 * points.start..4 * points.end]),
            Values::Doubles(bytes) => packet.extend_from_slice(&bytes[8 * points.start..8 * points.end]),
            Values::Integers { values, .. } => {
                let (bits, mut waiting, mut count) = (self.bits(), 0_u64, 0);
                for value in &values[points] {
                    waiting |= u64::from(*value) << count;
                    count += bits;
                    while count >= 8 {
                        packet.push(waiting as u8);
                        waiting >>= 8;
                        count -= 8;
                    }
                }
                if count > 0 {
                    packet.push(waiting as u8);
                }
            }
        }
    }
}

/// The largest packet, and the bytes before its streams and before each of them.
const MOST_BYTES: usize = 1 << 16;
const HEADER_BYTES: usize = 6;
const LENGTH_BYTES: usize = 2;

/// The points of a packet are a multiple of this, so that no stream has a byte, or a word of a reader, of two packets.
const MULTIPLE: usize = 64;

/// The streams of all columns in packets, each with the same points of every column. Without points there is one packet, because
/// libE57 reads the first one in any case.
pub(super) fn in_packets(columns: &[Column], points: usize) -> Vec<u8> {
    let bits: usize = columns.iter().map(Column::bits).sum();
    let before = HEADER_BYTES + LENGTH_BYTES * columns.len();
    // The end of a packet is filled to a multiple of 4.
    let most = (MOST_BYTES - 4 - before) * 8 / bits / MULTIPLE * MULTIPLE;
    let mut packets =
        Vec::with_capacity(points * bits / 8 + (points / most + 1) * (before + 4 + columns.len()));
    for first in (0..points.max(1)).step_by(most) {
        let start = packets.len();
        packets.resize(start + before, 0);
        for (index, column) in columns.iter().enumerate() {
            let from = packets.len();
            column.add(first..points.min(first + most), &mut packets);
            let length = (packets.len() - from) as u16;
            let at = start + HEADER_BYTES + LENGTH_BYTES * index;
            packets[at..at + LENGTH_BYTES].copy_from_slice(&length.to_le_bytes());
        }
        packets.resize(start + (packets.len() - start).next_multiple_of(4), 0);
        let length = (packets.len() - start - 1) as u16;
        packets[start] = 1; // a packet of data
        packets[start + 2..start + 4].copy_from_slice(&length.to_le_bytes());
        packets[start + 4..start + 6].copy_from_slice(&(columns.len() as u16).to_le_bytes());
    }
    packets
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_have_the_bits_that_they_need_from_the_lowest_on() {
        let mut column = Column::integers("rowIndex", 5, 3);
        [5, 1, 4].into_iter().for_each(|index| column.push_index(index));
        let mut stream = Vec::new();
        column.add(0..3, &mut stream);
        assert_eq!((column.bits(), &stream[..]), (3, &[0b0000_1101, 0b0000_0001][..]));
        assert_eq!([0, 1, 127, 128].map(|most| Column::integers("", most, 0).bits()), [1, 1, 7, 8]);
        let mut wide = Column::integers("columnIndex", u64::from(u32::MAX), 2);
        [u32::MAX, 0x0102_0304].into_iter().for_each(|index| wide.push_index(index));
        wide.add(0..2, &mut stream);
        assert_eq!(stream[2..], [255, 255, 255, 255, 4, 3, 2, 1]);
    }

    /// Every packet is a multiple of 4 bytes and at most 65536, and the streams have all values in their order.
    #[test]
    fn packets_have_all_points_once() {
        let points = 30_000;
        let mut columns = [Column::doubles("cartesianX", points), Column::integers("rowIndex", 300, points)];
        for point in 0..points {
            columns[0].push(point as f64);
            columns[1].push_index((point % 300) as u32);
        }
        let packets = in_packets(&columns, points);
        let (mut at, mut doubles) = (0, Vec::new());
        while at < packets.len() {
            let number = |from: usize| usize::from(u16::from_le_bytes([packets[from], packets[from + 1]]));
            assert_eq!((packets[at], packets[at + 1], number(at + 4)), (1, 0, 2));
            let (length, first) = (number(at + 2) + 1, number(at + 6));
            assert!(length % 4 == 0 && 10 + first + number(at + 8) <= length);
            doubles.extend_from_slice(&packets[at + 10..at + 10 + first]);
            at += length;
        }
        assert_eq!(at, packets.len());
        let expected: Vec<u8> = (0..points).flat_map(|point| (point as f64).to_le_bytes()).collect();
        assert!(doubles == expected);
    }
}
