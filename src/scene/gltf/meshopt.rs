//! The decoder of EXT_meshopt_compression and KHR_meshopt_compression, written from the text of the two specifications
//! (appendix A, bitstream, and appendix B, filters). Their bitstreams differ in version 1 of the attribute mode, which only the
//! latter has; the decoder reads both versions for both extensions.

use std::borrow::Cow;

use serde::Deserialize;

/// The kind of data that a stream holds.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub(super) enum Mode {
    Attributes,
    Triangles,
    Indices,
}

/// The filter that is applied to the elements after decompression.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub(super) enum Filter {
    #[default]
    None,
    Octahedral,
    Quaternion,
    Exponential,
    Color,
}

/// An error in a stream.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub(super) struct StreamError(Cow<'static, str>);

impl From<&'static str> for StreamError {
    fn from(problem: &'static str) -> Self {
        Self(problem.into())
    }
}

impl From<String> for StreamError {
    fn from(problem: String) -> Self {
        Self(problem.into())
    }
}

const CUT_SHORT: &str = "the stream is cut short";
const TOO_LONG: &str = "bytes are left over";

/// Decodes the `count` elements of `stride` bytes that `stream` holds.
///
/// Allocates at most about 1100 bytes for each byte of the stream.
pub(super) fn decode(
    stream: &[u8],
    count: usize,
    stride: usize,
    mode: Mode,
    filter: Filter,
) -> Result<Vec<u8>, StreamError> {
    let strides_match = match (mode, filter) {
        (Mode::Attributes, Filter::None | Filter::Exponential) => {
            stride.is_multiple_of(4) && (4..=256).contains(&stride)
        }
        (Mode::Attributes, Filter::Octahedral | Filter::Color) => stride == 4 || stride == 8,
        (Mode::Attributes, Filter::Quaternion) => stride == 8,
        (Mode::Triangles | Mode::Indices, Filter::None) => stride == 2 || stride == 4,
        (Mode::Triangles | Mode::Indices, _) => return Err(format!("{mode:?} can't have a filter").into()),
    };
    if !strides_match {
        return Err(
            format!("a byteStride of {stride} does not go with mode {mode:?} and filter {filter:?}").into()
        );
    }
    let mut bytes = match mode {
        Mode::Attributes => attributes(stream, count, stride)?,
        Mode::Triangles => triangles(stream, count, stride)?,
        Mode::Indices => indices(stream, count, stride)?,
    };
    match (filter, stride) {
        (Filter::None, _) => {}
        (Filter::Octahedral, 4) => bytes.as_chunks_mut().0.iter_mut().for_each(octahedral_8),
        (Filter::Octahedral, _) => bytes.as_chunks_mut().0.iter_mut().for_each(octahedral_16),
        (Filter::Quaternion, _) => bytes.as_chunks_mut().0.iter_mut().for_each(quaternion),
        (Filter::Exponential, _) => bytes.as_chunks_mut().0.iter_mut().for_each(exponential),
        (Filter::Color, 4) => bytes.as_chunks_mut().0.iter_mut().for_each(color_8),
        (Filter::Color, _) => bytes.as_chunks_mut().0.iter_mut().for_each(color_16),
    }
    Ok(bytes)
}

/// Splits `count` bytes off the front of `rest`.
fn take<'a>(rest: &mut &'a [u8], count: usize) -> Result<&'a [u8], &'static str> {
    let (taken, left) = rest.split_at_checked(count).ok_or(CUT_SHORT)?;
    *rest = left;
    Ok(taken)
}

fn take_byte(rest: &mut &[u8]) -> Result<u8, &'static str> {
    Ok(take(rest, 1)?[0])
}

/// Drops the header byte and splits a tail of `tail` bytes off the end.
fn split_tail(stream: &[u8], tail: usize) -> Result<(&[u8], &[u8]), &'static str> {
    let middle = stream.len().checked_sub(tail).filter(|&middle| middle >= 1).ok_or(CUT_SHORT)?;
    Ok((&stream[1..middle], &stream[middle..]))
}

// ---- Mode 0: attributes ----

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

fn attributes(stream: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, StreamError> {
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

// ---- Mode 1: triangles ----

/// The 16 entries pushed last; index 0 is the latest.
struct Fifo<T> {
    entries: [T; 16],
    pushed: usize,
}

impl<T: Copy + Default> Fifo<T> {
    fn new() -> Self {
        Self { entries: [T::default(); 16], pushed: 0 }
    }

    fn push(&mut self, entry: T) {
        self.entries[self.pushed % 16] = entry;
        self.pushed += 1;
    }

    fn get(&self, index: u8) -> Result<T, &'static str> {
        let back = usize::from(index) + 1;
        let at = self.pushed.checked_sub(back).ok_or("it refers to a triangle before the first")?;
        Ok(self.entries[at % 16])
    }
}

/// Decodes a zigzag integer: 0, 1, 2, 3, … stand for 0, −1, 1, −2, ….
fn zigzag(value: u32) -> u32 {
    value >> 1 ^ (value & 1).wrapping_neg()
}

/// Reads an unsigned LEB128 integer of at most 5 bytes.
fn leb128(rest: &mut &[u8]) -> Result<u32, &'static str> {
    let mut value = 0;
    for shift in [0, 7, 14, 21, 28] {
        let byte = take_byte(rest)?;
        value |= u32::from(byte & 0x7f) << shift;
        if byte < 0x80 {
            return Ok(value);
        }
    }
    Err("an integer has more than 5 bytes")
}

/// Decoded indices of `stride` bytes.
struct Output {
    bytes: Vec<u8>,
    stride: usize,
}

impl Output {
    fn push(&mut self, index: u32) -> Result<(), StreamError> {
        if self.stride == 2 {
            let short =
                u16::try_from(index).map_err(|_| format!("index {index} does not fit into two bytes"))?;
            self.bytes.extend_from_slice(&short.to_le_bytes());
        } else {
            self.bytes.extend_from_slice(&index.to_le_bytes());
        }
        Ok(())
    }
}

/// The state from which the vertices of the next triangles are decoded.
struct Vertices<'a> {
    data: &'a [u8],
    next: u32,
    last: u32,
    recent: Fifo<u32>,
}

impl Vertices<'_> {
    /// The next vertex that no triangle has used.
    fn fresh(&mut self) -> u32 {
        let vertex = self.next;
        self.next = vertex.wrapping_add(1);
        vertex
    }

    /// A vertex that the data gives, as a difference from the last such vertex.
    fn explicit(&mut self) -> Result<u32, &'static str> {
        self.last = self.last.wrapping_add(zigzag(leb128(&mut self.data)?));
        Ok(self.last)
    }

    /// The vertex that a half byte stands for, and whether it is added to the recent vertices.
    fn coded(&mut self, code: u8) -> Result<(u32, bool), &'static str> {
        match code {
            0 => Ok((self.fresh(), true)),
            15 => Ok((self.explicit()?, true)),
            _ => Ok((self.recent.get(code - 1)?, false)),
        }
    }
}

fn triangles(stream: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, StreamError> {
    if stream.first().is_some_and(|&byte| byte != 0xe1) {
        return Err(format!("the header is {:#04x}, triangles have 0xe1", stream[0]).into());
    }
    if !count.is_multiple_of(3) {
        return Err(format!("a count of {count} is no number of triangles").into());
    }
    let (mut data, table) = split_tail(stream, 16)?;
    let codes = take(&mut data, count / 3)?;
    let mut vertices = Vertices { data, next: 0, last: 0, recent: Fifo::new() };
    let mut edges = Fifo::<(u32, u32)>::new();
    let mut output = Output { bytes: Vec::with_capacity(count * stride), stride };
    for &code in codes {
        let (high, low) = (code >> 4, code & 15);
        let (a, b, c);
        if high < 15 {
            (a, b) = edges.get(high)?;
            let is_recent;
            (c, is_recent) = match low {
                13 | 14 => {
                    let step = if low == 13 { u32::MAX } else { 1 };
                    vertices.last = vertices.last.wrapping_add(step);
                    (vertices.last, true)
                }
                // The latest vertex belongs to the edge, so here, unlike elsewhere, it has no code.
                1..=12 => (vertices.recent.get(low)?, false),
                _ => vertices.coded(low)?,
            };
            if is_recent {
                vertices.recent.push(c);
            }
        } else {
            let pair = if low < 14 { table[usize::from(low)] } else { take_byte(&mut vertices.data)? };
            if low >= 14 && pair == 0 {
                vertices.next = 0;
            }
            if low < 14 && (pair >> 4 == 15 || pair & 15 == 15) {
                return Err("the table of common codes is wrong".into());
            }
            a = if low == 15 { vertices.explicit()? } else { vertices.fresh() };
            let (b_is_recent, c_is_recent);
            (b, b_is_recent) = vertices.coded(pair >> 4)?;
            (c, c_is_recent) = vertices.coded(pair & 15)?;
            edges.push((b, a));
            vertices.recent.push(a);
            if b_is_recent {
                vertices.recent.push(b);
            }
            if c_is_recent {
                vertices.recent.push(c);
            }
        }
        edges.push((c, b));
        edges.push((a, c));
        for vertex in [a, b, c] {
            output.push(vertex)?;
        }
    }
    if vertices.data.is_empty() { Ok(output.bytes) } else { Err(TOO_LONG.into()) }
}

// ---- Mode 2: indices ----

fn indices(stream: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, StreamError> {
    if stream.first().is_some_and(|&byte| byte != 0xd1) {
        return Err(format!("the header is {:#04x}, indices have 0xd1", stream[0]).into());
    }
    let (mut rest, _) = split_tail(stream, 4)?;
    if count > rest.len() {
        return Err(format!("{count} indices do not fit into {} bytes", rest.len()).into());
    }
    let mut last = [0_u32; 2];
    let mut output = Output { bytes: Vec::with_capacity(count * stride), stride };
    for _ in 0..count {
        let value = leb128(&mut rest)?;
        let last = &mut last[(value & 1) as usize];
        *last = last.wrapping_add(zigzag(value >> 1));
        output.push(*last)?;
    }
    if rest.is_empty() { Ok(output.bytes) } else { Err(TOO_LONG.into()) }
}

// ---- Filters ----

/// Decodes an octahedral unit vector, given as x, y and the number that stands for 1, to x, y and z, where `largest` stands
/// for 1.
fn octahedral([x, y, one]: [f32; 3], largest: f32) -> [f32; 3] {
    let (mut x, mut y) = (x / one, y / one);
    let z = 1.0 - x.abs() - y.abs();
    let fold = z.min(0.0);
    x -= fold.copysign(x);
    y -= fold.copysign(y);
    let length = (x * x + y * y + z * z).sqrt();
    [x, y, z].map(|c| (c / length * largest).round())
}

fn octahedral_8(element: &mut [u8; 4]) {
    let [x, y, one, _] = element.map(|byte| f32::from(byte as i8));
    let [x, y, z] = octahedral([x, y, one], 127.0).map(|c| c as i8 as u8);
    *element = [x, y, z, element[3]];
}

fn octahedral_16(element: &mut [u8; 8]) {
    let [x, y, one, w] = shorts(*element);
    let [x, y, z] = octahedral([x, y, one].map(f32::from), 32767.0).map(|c| c as i16);
    *element = from_shorts([x, y, z, w]);
}

/// Decodes a unit quaternion, given as three components and the index of the missing one.
fn quaternion(element: &mut [u8; 8]) {
    let input = shorts(*element);
    let one = f32::from(input[3] | 3);
    let [x, y, z] =
        [input[0], input[1], input[2]].map(|c| f32::from(c) / one * std::f32::consts::FRAC_1_SQRT_2);
    let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
    let largest = (input[3] & 3) as usize;
    let mut output = [0; 4];
    for (at, component) in [w, x, y, z].into_iter().enumerate() {
        output[(largest + at) % 4] = (component * 32767.0).round() as i16;
    }
    *element = from_shorts(output);
}

/// Decodes a float, given as an 8-bit exponent above a 24-bit mantissa, both signed.
fn exponential(element: &mut [u8; 4]) {
    let bits = i32::from_le_bytes(*element);
    let (exponent, mantissa) = (bits >> 24, bits << 8 >> 8);
    // This is 2^exponent exactly, because normal f64 numbers begin at 2^-1022.
    let scale = f64::from_bits(((1023 + exponent) as u64) << 52);
    *element = ((scale * f64::from(mantissa)) as f32).to_le_bytes();
}

/// Decodes red, green, blue and alpha up to `largest`, given as luma, two chroma components, and alpha below a marking bit.
fn color([y, co, cg, alpha]: [i32; 4], largest: f32) -> [f32; 4] {
    let all = match alpha.checked_ilog2() {
        Some(bit) => (1_i32 << (bit + 1)) - 1,
        None => 1,
    };
    let a = alpha & (all >> 1);
    let a = a << 1 | a & 1;
    [y + co - cg, y + cg, y - co - cg, a].map(|c| (c as f32 * (largest / all as f32)).round())
}

fn color_8(element: &mut [u8; 4]) {
    let [y, co, cg, a] = *element;
    *element = color([y.into(), (co as i8).into(), (cg as i8).into(), a.into()], 255.0).map(|c| c as u8);
}

fn color_16(element: &mut [u8; 8]) {
    let [y, co, cg, a] = shorts(*element);
    let input = [i32::from(y as u16), co.into(), cg.into(), i32::from(a as u16)];
    *element = from_shorts(color(input, 65535.0).map(|c| c as u16 as i16));
}

fn shorts(element: [u8; 8]) -> [i16; 4] {
    std::array::from_fn(|at| i16::from_le_bytes([element[2 * at], element[2 * at + 1]]))
}

fn from_shorts(element: [i16; 4]) -> [u8; 8] {
    std::array::from_fn(|at| element[at / 2].to_le_bytes()[at % 2])
}

#[cfg(test)]
mod tests {
    //! The specification has no test vectors. Streams here were made with the reference encoder (meshoptimizer 1.3) from
    //! what the tests give by formula.

    use proptest::prelude::*;

    use super::*;

    fn bytes(hex: &str) -> Vec<u8> {
        (0..hex.len()).step_by(2).map(|at| u8::from_str_radix(&hex[at..at + 2], 16).unwrap()).collect()
    }

    fn attributes(hex: &str, count: usize, stride: usize) -> Vec<u8> {
        decode(&bytes(hex), count, stride, Mode::Attributes, Filter::None).unwrap()
    }

    const VERSION_0: &str = "a00a06666666666666666666000000000000051555555555000000070002060a0e12161a1e22262a2e32363aff\
        0000003e42464a000000000000000000000000000000000000000000000000000000000000ff0007";
    const VERSION_1: &str = "a1b50206666666666666660f00060606060515555555550000000002060a0e12161a1e22262a2e32363a3e4246\
        4a0000000000000000000000000000000000000000ff000700";

    #[test]
    fn byte_deltas_of_both_versions() {
        let expected: Vec<u8> =
            (0..20_u32).flat_map(|i| [i * 3, 255 - i, i * i, 7].map(|b| b as u8)).collect();
        assert_eq!(attributes(VERSION_0, 20, 4), expected);
        assert_eq!(attributes(VERSION_1, 20, 4), expected);
    }

    #[test]
    fn two_byte_deltas_beside_byte_deltas() {
        let hex = "a1779ae500585858585858585858585858585858585858585858585858585858585858585858585858585858152aaaaa\
            aaaaaaaaaaaaaa0000000d2945617d99b5d1ed0925415d7995b1cde905213d597591adc9e5011d3955718da9c5e1fd19\
            35250000055556aaaaff0303030333333344000000002a04444444444444444444444444444444444444440000000015\
            2aaaaaaaaaaaaaaaaaaa00001526666666666666666666000000b1b1b1b1b1b1b1b1b1b1b1b1b1b1b1b1b1b1b1b1b1b1\
            b1b1b1b1b1b1b1b1b1b1b1b1b1b1b1b1b1000000000000000000e803ffff0000803f0000c800010000";
        let mut expected = Vec::new();
        for i in 0..40_u32 {
            expected.extend((1000 + i * 300).to_le_bytes()[..2].iter());
            expected.extend((65535 - i * i * 7).to_le_bytes()[..2].iter());
            expected.extend((1.0 + i as f32 / 64.0).to_le_bytes());
            expected.extend([i as u8, (i & 1) as u8, 200, (i * 167) as u8]);
        }
        assert_eq!(attributes(hex, 40, 12), expected);
    }

    #[test]
    fn exclusive_or_deltas_are_rotated_back() {
        let rotated_by_2 = "a13a0000050514142d2d50507d7db4b4f5f540409595f4f45d5dd0d04d4dd4d465650c11111122223333440000\
            00000000000000000000000000000000000000803f22";
        let rotated_by_7 = "a1ea0000010104040909101019192424313140405151646479799090a9a9c4c4e1e10000000000000000000000\
            00000000000000000000803f72";
        for (hex, factor) in [(rotated_by_2, 5_u32), (rotated_by_7, 8)] {
            let value = |i: u32| 0x3f80_0000 ^ if i % 2 == 1 { 0 } else { (i * i * factor) << 12 };
            let expected: Vec<u8> = (0..32).flat_map(|i| value(i).to_le_bytes()).collect();
            assert_eq!(attributes(hex, 32, 4), expected);
        }
    }

    #[test]
    fn triangles_of_a_grid() {
        let hex = "e1fe1e100e100e100ece1e160e150e140ece1e140e140e140ece1e140e140e140e0f0a007687566778a9866589689801690000";
        let quad = |v: u16| [v, v + 1, v + 5, v + 5, v + 1, v + 6];
        let expected: Vec<u16> = (0..4).flat_map(|y| (0..4).flat_map(move |x| quad(5 * y + x))).collect();
        let decoded = decode(&bytes(hex), 96, 2, Mode::Triangles, Filter::None).unwrap();
        let decoded: Vec<u16> = decoded.as_chunks().0.iter().map(|&b| u16::from_le_bytes(b)).collect();
        // Encoders may begin a triangle at any of its corners.
        let from_least = |indices: &[u16]| -> Vec<[u16; 3]> {
            let least_first =
                |&[a, b, c]: &[u16; 3]| [[a, b, c], [b, c, a], [c, a, b]].into_iter().min().unwrap();
            indices.as_chunks().0.iter().map(least_first).collect()
        };
        assert_eq!(from_least(&decoded), from_least(&expected));
    }

    /// Indices without any order, as the two streams below hold them.
    fn scattered() -> Vec<u8> {
        let triangle = |i: u32| [i * i * 7 % 61, i * i * 7 % 61 + 1 + i % 3, 70000 + i * i * i];
        (0..30).flat_map(triangle).flat_map(u32::to_le_bytes).collect()
    }

    const SCATTERED_TRIANGLES: &str = "e1fefffffeffffffffffffffffffffffffffffffffffffffffffffffffffff0fe0c508ffd1c50804\
        d0c508ffa9c50806b2c5080f26ffafc50804f6c508fff5c50806eac608efc9c70880c908ffc3c80804beca08ffe3ca0806b0cd08ffbbcd\
        0802ecd008ffd7d00804f2d408ffc3d40806d4d908ff85da08029ee008ffafe00804d6e7085fcde70894f008ffebef0802d8f908ff8ffa\
        0804ae8509ffcb850906a89209ffab920902d8a009ffbba00904beb009ff87b00906ecc109ff95c20902eed509fff7d50904caeb09ffb9\
        eb090692830affe1830a02d29d0a5f879d0a9ab90adfabb90aead70affdfd70a02d4f80affaff80a04e69b0bffa19c0b06a6c20b007687\
        566778a9866589689801690000";
    const SCATTERED_INDICES: &str = "d10004c18b111808054c0c1d72044dc001089501000cf501be0104ed027408fd034a0ca5051604e506\
        2808bd085c0cad0a6204b50c2208d50e100c8d114404dd136e08c5163a0cc5190604dd1c38088d206c0cd5235204b5271208ad2b200cbd\
        2f9e0104e533940108a5382a0cfd3c0804ed414808f546760c954c00000000";

    #[test]
    fn scattered_indices() {
        let triangles = decode(&bytes(SCATTERED_TRIANGLES), 90, 4, Mode::Triangles, Filter::None);
        assert_eq!(triangles.unwrap(), scattered());
        let indices = decode(&bytes(SCATTERED_INDICES), 90, 4, Mode::Indices, Filter::None);
        assert_eq!(indices.unwrap(), scattered());
        let short = decode(&bytes(SCATTERED_INDICES), 90, 2, Mode::Indices, Filter::None);
        assert_eq!(short.unwrap_err().to_string(), "index 70000 does not fit into two bytes");
    }

    #[test]
    fn filters() {
        let shorts = |bytes: Vec<u8>| -> Vec<f64> {
            bytes.as_chunks().0.iter().map(|&b| f64::from(i16::from_le_bytes(b)) / 32767.0).collect()
        };
        // 12 bits: half a step, and as much again where the fold and the normalisation magnify it.
        let octahedral = "a0011c00000073013c0000000e13013c000000dbe8013c000000080d0000013c0000000403012400000000000000\
            000000000000000000000000000000000000000000000000ff07ff7f";
        let vectors = decode(&bytes(octahedral), 3, 8, Mode::Attributes, Filter::Octahedral).unwrap();
        let expected = [0.0, 0.0, 1.0, 1.0, 0.6, 0.0, -0.8, -1.0, -0.48, -0.64, 0.6, 1.0];
        for (got, expected) in shorts(vectors).into_iter().zip(expected) {
            assert!((got - expected).abs() < 1.0 / 2047.0, "{got} {expected}");
        }

        let quaternion = "a0013c000000fcfb013c000000b5b6013c000000fb34013c000000b424013c000000fcfb013c000000b5b6013000\
            00000500000000000000000000000000000000000000000000000000000000000000ff7f";
        let rotations = decode(&bytes(quaternion), 3, 8, Mode::Attributes, Filter::Quaternion).unwrap();
        // The second one is stored as its opposite, which turns the same way.
        let expected = [0.0, 0.0, 0.0, 1.0, 0.5, -0.5, 0.5, -0.5, 0.8, 0.0, 0.6, 0.0];
        for (got, expected) in shorts(rotations).into_iter().zip(expected) {
            assert!((got - expected).abs() < 2.0 / 32767.0, "{got} {expected}");
        }

        let exponential = "a0000000012000000000000130000000df01300000001301300000008101300000007c0130000000050130000000\
            460000000000000000000000000000000000000000000040e90000c0f441d47dda";
        let floats = decode(&bytes(exponential), 2, 12, Mode::Attributes, Filter::Exponential).unwrap();
        let floats: Vec<f32> = floats.as_chunks().0.iter().map(|&b| f32::from_le_bytes(b)).collect();
        assert_eq!(floats, [0.5, -1024.0, 3e-5, 1.0, 1.25, 1e6]);

        // Luma 100, orange 20, green -10; alpha 64 of 127 below the mark: all of 8 bits.
        let mut element = [100, 20, 246, 128 + 64];
        color_8(&mut element);
        assert_eq!(element, [130, 90, 90, 128]);
    }

    #[test]
    fn the_extremes_of_exponents() {
        for (exponent, mantissa, value) in
            [(-100, 1, -100), (100, -3, 100), (127, 1, 127), (-128, 1 << 22, -128)]
        {
            let mut element = ((exponent << 24) | (mantissa & 0xff_ffff_i32)).to_le_bytes();
            exponential(&mut element);
            let expected = libm::ldexp(f64::from(mantissa), value) as f32;
            assert_eq!(f32::from_le_bytes(element), expected);
        }
    }

    #[test]
    fn broken_streams_are_told_of() {
        let of = |hex: &str, count, stride, mode| {
            decode(&bytes(hex), count, stride, mode, Filter::None).unwrap_err().to_string()
        };
        let whole = bytes(VERSION_1);
        for length in 0..whole.len() {
            assert!(decode(&whole[..length], 20, 4, Mode::Attributes, Filter::None).is_err(), "{length}");
        }
        assert_eq!(of(VERSION_0, 16, 4, Mode::Attributes), TOO_LONG);
        assert!(of(VERSION_0, 2_000_000_000, 4, Mode::Attributes).contains("do not fit"));
        assert!(of(VERSION_0, usize::MAX, 8, Mode::Attributes).contains("do not fit"));
        assert_eq!(of(VERSION_0, 1, 256, Mode::Attributes), CUT_SHORT);
        assert!(of(SCATTERED_INDICES, usize::MAX, 4, Mode::Indices).contains("do not fit"));
        assert_eq!(of(SCATTERED_TRIANGLES, 3_000_000_000, 4, Mode::Triangles), CUT_SHORT);
        assert!(of(SCATTERED_TRIANGLES, 91, 4, Mode::Triangles).contains("no number of triangles"));
        assert!(of(VERSION_0, 20, 6, Mode::Attributes).contains("byteStride of 6"));
        assert!(of(VERSION_0, 20, 4, Mode::Indices).contains("0xa0"));
        // The first triangle can't share an edge with one before it.
        let orphan = "e1000000000000000000000000000000000000";
        assert!(of(orphan, 3, 4, Mode::Triangles).contains("before the first"));
        assert!(of(&VERSION_1.replace("ff000700", "ff000703"), 20, 4, Mode::Attributes).contains("0x03"));
    }

    proptest! {
        #[test]
        fn no_stream_panics(
            kind in 0..3_usize,
            changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
            cut in 0..20_usize,
            count in prop_oneof![Just(20_usize), Just(90), 0..4000_usize],
            stride in prop_oneof![Just(2_usize), Just(4), Just(8), Just(12), Just(256)],
            filter in prop_oneof![
                Just(Filter::None), Just(Filter::Octahedral), Just(Filter::Quaternion),
                Just(Filter::Exponential), Just(Filter::Color),
            ],
        ) {
            let (hex, mode) = [
                (VERSION_1, Mode::Attributes),
                (SCATTERED_TRIANGLES, Mode::Triangles),
                (SCATTERED_INDICES, Mode::Indices),
            ][kind];
            let mut stream = bytes(hex);
            for (at, value) in changes {
                let at = at.index(stream.len());
                stream[at] = value;
            }
            stream.truncate(stream.len().saturating_sub(cut));
            if let Ok(decoded) = decode(&stream, count, stride, mode, filter) {
                prop_assert_eq!(decoded.len(), count * stride);
            }
        }
    }
}
