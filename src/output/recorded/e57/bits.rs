//! The values of points: streams of bits, one for each field, in packets.

use super::super::error::ReadError;
use super::super::number::Number;
use super::pages::Pages;

/// How the values of a field are stored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Encoding {
    /// Floats of 32 or 64 bits.
    Float(Number),
    /// Integers from `least` on, in as many bits as the largest needs.
    Integer {
        /// The least.
        least: i64,
        /// The largest.
        most: i64,
        /// The step and the value of 0, of a scaled integer.
        scale: Option<(f64, f64)>,
    },
}

impl Encoding {
    /// The bits of a value.
    pub fn bits(self) -> u32 {
        match self {
            Self::Float(number) => 8 * number.size() as u32,
            Self::Integer { least, most, .. } => u64::BITS - most.abs_diff(least).leading_zeros(),
        }
    }

    /// The smallest type of numbers that has all values.
    pub fn number(self) -> Number {
        match self {
            Self::Float(number) => number,
            Self::Integer { scale: Some(_), .. } => Number::F64,
            Self::Integer { least, most, .. } => {
                let fits = |low: i64, high: i64| least >= low && most <= high;
                match () {
                    () if fits(0, u8::MAX.into()) => Number::U8,
                    () if fits(i8::MIN.into(), i8::MAX.into()) => Number::I8,
                    () if fits(0, u16::MAX.into()) => Number::U16,
                    () if fits(i16::MIN.into(), i16::MAX.into()) => Number::I16,
                    () if fits(0, u32::MAX.into()) => Number::U32,
                    () if fits(i32::MIN.into(), i32::MAX.into()) => Number::I32,
                    () => Number::I64,
                }
            }
        }
    }

    /// The values of a stream, of so many points.
    pub fn values(self, stream: &[u8], points: usize) -> Option<Vec<f64>> {
        let needed = u64::from(self.bits()).checked_mul(points as u64)?;
        if (stream.len() as u64).checked_mul(8)? < needed {
            return None;
        }
        Some(match self {
            Self::Float(number) => stream
                .chunks_exact(number.size())
                .take(points)
                .map(|bytes| number.read(bytes, false))
                .collect(),
            Self::Integer { least, scale, .. } => {
                let value = |raw: u64| {
                    let integer = least.wrapping_add_unsigned(raw);
                    scale.map_or(integer as f64, |(step, zero)| integer as f64 * step + zero)
                };
                integers(stream, self.bits(), points).map(value).collect()
            }
        })
    }
}

/// The integers of a stream, each of so many bits, the first bit of a byte being its lowest.
fn integers(stream: &[u8], bits: u32, points: usize) -> impl Iterator<Item = u64> {
    let (mut waiting, mut count, mut bytes) = (0_u128, 0, stream.iter());
    let mask = (1_u128 << bits) - 1;
    (0..points).map(move |_| {
        while count < bits {
            waiting |= u128::from(*bytes.next().unwrap_or(&0)) << count;
            count += 8;
        }
        let value = (waiting & mask) as u64;
        waiting >>= bits;
        count -= bits;
        value
    })
}

/// The bytes of the header of a section of points.
const SECTION_HEADER: usize = 32;

/// The streams of a section of points, each with at least the bytes of its points. The bytes of its packets are taken from those that are
/// `left` of the file.
///
/// # Errors
/// A [`ReadError`] if the section is none of points, ends before, or has more bytes than are left.
pub(super) fn streams(
    pages: &Pages,
    (place, points): (u64, u64),
    encodings: &[Encoding],
    left: &mut usize,
) -> Result<Vec<Vec<u8>>, ReadError> {
    let broken = || ReadError::new("a section of points is broken");
    let header = pages.from(place).and_then(|section| section.first_chunk::<SECTION_HEADER>());
    let header = header.filter(|header| header[0] == 1).ok_or_else(broken)?;
    let number = |at: usize| header[at..].first_chunk().map_or(0, |bytes| u64::from_le_bytes(*bytes));
    let mut rest = pages.from(number(16)).ok_or_else(broken)?;
    let needed =
        |encoding: &Encoding| u64::from(encoding.bits()).checked_mul(points).map(|bits| bits.div_ceil(8));
    let needed: Option<Vec<u64>> = encodings.iter().map(needed).collect();
    let needed = needed.ok_or_else(broken)?;
    let mut streams = vec![Vec::new(); encodings.len()];
    let lacks = |streams: &[Vec<u8>]| {
        streams.iter().zip(&needed).any(|(stream, needed)| (stream.len() as u64) < *needed)
    };
    while lacks(&streams) {
        let short = || ReadError::new(format!("it is cut short: its description promises {points} points"));
        let head = rest.first_chunk::<4>().ok_or_else(short)?;
        let length = usize::from(u16::from_le_bytes([head[2], head[3]])) + 1;
        let (packet, after) = rest.split_at_checked(length).filter(|_| length >= 4).ok_or_else(short)?;
        // Sections of a file do not overlap: else a small one could have any number of packets.
        *left = left.checked_sub(length).ok_or_else(|| ReadError::new("its sections of points overlap"))?;
        match head[0] {
            1 => add_packet(packet, &mut streams)
                .ok_or_else(|| ReadError::new("a packet of points is broken"))?,
            // An index, and what is to be passed over.
            0 | 2 => {}
            // What is behind the last packet.
            _ => return Err(short()),
        }
        rest = after;
    }
    Ok(streams)
}

/// Adds the bytes that a packet has of each stream.
fn add_packet(packet: &[u8], streams: &mut [Vec<u8>]) -> Option<()> {
    let count = usize::from(u16::from_le_bytes(*packet.get(4..)?.first_chunk()?));
    if count != streams.len() {
        return None;
    }
    let (lengths, mut rest) = packet.get(6..)?.split_at_checked(2 * count)?;
    for (stream, length) in streams.iter_mut().zip(lengths.as_chunks::<2>().0) {
        let (own, after) = rest.split_at_checked(u16::from_le_bytes(*length).into())?;
        stream.extend_from_slice(own);
        rest = after;
    }
    Some(())
}
