//! Mode 0: elements of any kind, as the differences of their bytes.

use super::stream::{CUT_SHORT, StreamError, TOO_LONG, split_tail, take, take_byte};

/// The number of elements that share a header.
const GROUP: usize = 16;
/// The largest number of elements of a block.
const BLOCK: usize = 256;

/// The storage of the deltas of 16 elements: none, a few bits each, or whole bytes.
#[derive(Clone, Copy)]
enum Bits {
    None,
    Packed(u32),
    Byte,
}

/// The storage that each value of a 2-bit group header stands for.
type Lengths = [Bits; 4];
const VERSION_0: Lengths = [Bits::None, Bits::Packed(2), Bits::Packed(4), Bits::Byte];
const CONTROL_0: Lengths = [Bits::None, Bits::Packed(1), Bits::Packed(2), Bits::Packed(4)];
const CONTROL_1: Lengths = [Bits::Packed(1), Bits::Packed(2), Bits::Packed(4), Bits::Byte];

/// The rule by which the four bytes of a channel follow from their deltas.
#[derive(Clone, Copy)]
enum Channel {
    Bytes,
    Shorts,
    /// Exclusive or with the delta, rotated left by this number of bits.
    Xor(u32),
}

pub(super) fn decode(stream: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, StreamError> {
    let version = match stream.first() {
        Some(0xa0) => 0,
        Some(0xa1) => 1,
        Some(byte) => return Err(format!("the header is {byte:#04x}, attributes have 0xa0 or 0xa1").into()),
        None => return Err(CUT_SHORT.into()),
    };
    // Padding precedes the used part of the tail.
    let (used, least) = if version == 0 { (stride, 32) } else { (stride + stride / 4, 24) };
    let (mut rest, tail) = split_tail(stream, used.max(least))?;
    let (baseline, modes) = tail[tail.len() - used..].split_at(stride);
    let channels: Vec<Channel> = match version {
        0 => vec![Channel::Bytes; stride / 4],
        _ => modes.iter().map(|&mode| channel(mode)).collect::<Result<_, _>>()?,
    };

    let block = (8192 / stride / GROUP * GROUP).min(BLOCK);
    // A block takes at least two bits for each byte of an element, so the count is bounded by the stream.
    let blocks = count.div_ceil(block);
    if blocks.saturating_mul(stride / 4) > rest.len() {
        return Err(format!("{count} elements do not fit into {} bytes", stream.len()).into());
    }
    let mut elements = vec![0; count * stride];
    let mut previous = [0; 256];
    previous[..stride].copy_from_slice(baseline);
    let mut deltas = [[0; BLOCK]; 4];
    for elements in elements.chunks_mut(block * stride) {
        let count = elements.len() / stride;
        let control = if version == 0 { &[] } else { take(&mut rest, stride / 4)? };
        for (at, &channel) in channels.iter().enumerate() {
            for (byte, deltas) in deltas.iter_mut().enumerate() {
                let deltas = &mut deltas[..count.next_multiple_of(GROUP)];
                let lengths = match control.get(at).map(|modes| modes >> (2 * byte) & 3) {
                    None => &VERSION_0,
                    Some(0) => &CONTROL_0,
                    Some(1) => &CONTROL_1,
                    Some(2) => {
                        deltas.fill(0);
                        continue;
                    }
                    Some(_) => {
                        deltas[..count].copy_from_slice(take(&mut rest, count)?);
                        continue;
                    }
                };
                data_block(&mut rest, lengths, deltas)?;
            }
            let previous = &mut previous[4 * at..4 * at + 4];
            let mut last = [previous[0], previous[1], previous[2], previous[3]];
            for index in 0..count {
                last = channel.apply(last, [0, 1, 2, 3].map(|byte| deltas[byte][index]));
                elements[index * stride + 4 * at..][..4].copy_from_slice(&last);
            }
            previous.copy_from_slice(&last);
        }
    }
    if rest.is_empty() { Ok(elements) } else { Err(TOO_LONG.into()) }
}

/// Reads the deltas of one byte of all the block's elements, in whole groups.
fn data_block(rest: &mut &[u8], lengths: &Lengths, deltas: &mut [u8]) -> Result<(), &'static str> {
    let headers = take(rest, (deltas.len() / GROUP).div_ceil(4))?;
    for (group, deltas) in deltas.as_chunks_mut::<GROUP>().0.iter_mut().enumerate() {
        match lengths[usize::from(headers[group / 4] >> (2 * (group % 4)) & 3)] {
            Bits::None => deltas.fill(0),
            Bits::Byte => deltas.copy_from_slice(take(rest, GROUP)?),
            Bits::Packed(bits) => {
                let packed = take(rest, GROUP * bits as usize / 8)?;
                let sentinel = (1 << bits) - 1;
                let each = 8 / bits as usize;
                for (at, delta) in deltas.iter_mut().enumerate() {
                    // Deltas are packed from the top bits down, but single bits from the bottom up.
                    let within = if bits == 1 { at % each } else { each - 1 - at % each };
                    *delta = packed[at / each] >> (within as u32 * bits) & sentinel;
                    if *delta == sentinel {
                        *delta = take_byte(rest)?;
                    }
                }
            }
        }
    }
    Ok(())
}

fn channel(mode: u8) -> Result<Channel, StreamError> {
    match (mode & 15, mode >> 4) {
        (0, 0) => Ok(Channel::Bytes),
        (1, 0) => Ok(Channel::Shorts),
        // The encoder rotated the delta to the left, so the decoder rotates it back to the right.
        (2, rotation) => Ok(Channel::Xor((32 - u32::from(rotation)) & 31)),
        _ => Err(format!("{mode:#04x} is not a channel mode").into()),
    }
}

impl Channel {
    fn apply(self, last: [u8; 4], delta: [u8; 4]) -> [u8; 4] {
        match self {
            Self::Bytes => std::array::from_fn(|at| {
                last[at].wrapping_add(delta[at] >> 1 ^ (delta[at] & 1).wrapping_neg())
            }),
            Self::Shorts => {
                let one = |at: usize| {
                    let [last, delta] =
                        [last, delta].map(|bytes| u16::from_le_bytes([bytes[at], bytes[at + 1]]));
                    last.wrapping_add(delta >> 1 ^ (delta & 1).wrapping_neg()).to_le_bytes()
                };
                let ([a, b], [c, d]) = (one(0), one(2));
                [a, b, c, d]
            }
            Self::Xor(rotation) => {
                (u32::from_le_bytes(last) ^ u32::from_le_bytes(delta).rotate_left(rotation)).to_le_bytes()
            }
        }
    }
}
