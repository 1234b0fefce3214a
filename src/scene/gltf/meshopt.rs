//! The decoder of EXT_meshopt_compression and KHR_meshopt_compression, written from the text of the two specifications
//! (appendices A, bitstream, and B, filters). Their bitstreams differ in version 1 of the attribute mode, which only the
//! latter has; both are read for both.

use serde::Deserialize;

/// What kind of data a stream holds.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub(super) enum Mode {
    Attributes,
    Triangles,
    Indices,
}

/// What is done to the elements after decompression.
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

const CUT_SHORT: &str = "the stream is cut short";
const TOO_LONG: &str = "bytes are left over";

/// The `count` elements of `stride` bytes that `stream` holds.
///
/// Allocates at most about 1100 bytes for each byte of the stream. The error says what is wrong with the stream.
pub(super) fn decode(
    stream: &[u8],
    count: usize,
    stride: usize,
    mode: Mode,
    filter: Filter,
) -> Result<Vec<u8>, String> {
    let strides_match = match (mode, filter) {
        (Mode::Attributes, Filter::None | Filter::Exponential) => {
            stride % 4 == 0 && (4..=256).contains(&stride)
        }
        (Mode::Attributes, Filter::Octahedral | Filter::Color) => stride == 4 || stride == 8,
        (Mode::Attributes, Filter::Quaternion) => stride == 8,
        (Mode::Triangles | Mode::Indices, Filter::None) => stride == 2 || stride == 4,
        (Mode::Triangles | Mode::Indices, _) => return Err(format!("{mode:?} can't have a filter")),
    };
    if !strides_match {
        return Err(format!("a byteStride of {stride} does not go with mode {mode:?} and filter {filter:?}"));
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

/// Takes `count` bytes off the front.
fn take<'a>(rest: &mut &'a [u8], count: usize) -> Result<&'a [u8], &'static str> {
    let (taken, left) = rest.split_at_checked(count).ok_or(CUT_SHORT)?;
    *rest = left;
    Ok(taken)
}

fn take_byte(rest: &mut &[u8]) -> Result<u8, &'static str> {
    Ok(take(rest, 1)?[0])
}

/// Checks the header byte and splits a tail of `tail` bytes off the end.
fn split_tail(stream: &[u8], tail: usize) -> Result<(&[u8], &[u8]), &'static str> {
    let middle = stream.len().checked_sub(tail).filter(|&middle| middle >= 1).ok_or(CUT_SHORT)?;
    Ok((&stream[1..middle], &stream[middle..]))
}

// ---- Mode 0: attributes ----

/// Elements that share a header.
const GROUP: usize = 16;
/// The most elements of a block.
const BLOCK: usize = 256;

/// How the deltas of 16 elements are stored: not at all, in a few bits each, or in whole bytes.
#[derive(Clone, Copy)]
enum Bits {
    None,
    Packed(u32),
    Byte,
}

/// The bit lengths that the 2-bit group headers stand for.
type Lengths = [Bits; 4];
const VERSION_0: Lengths = [Bits::None, Bits::Packed(2), Bits::Packed(4), Bits::Byte];
const CONTROL_0: Lengths = [Bits::None, Bits::Packed(1), Bits::Packed(2), Bits::Packed(4)];
const CONTROL_1: Lengths = [Bits::Packed(1), Bits::Packed(2), Bits::Packed(4), Bits::Byte];

/// How the four bytes of a channel follow from their deltas.
#[derive(Clone, Copy)]
enum Channel {
    Bytes,
    Shorts,
    /// Exclusive or, the delta rotated left by so many bits.
    Xor(u32),
}

fn attributes(stream: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, String> {
    let version = match stream.first() {
        Some(0xa0) => 0,
        Some(0xa1) => 1,
        Some(byte) => return Err(format!("the header is {byte:#04x}, attributes have 0xa0 or 0xa1")),
        None => return Err(CUT_SHORT.to_owned()),
    };
    // The padding comes before what the tail is for.
    let (used, least) = if version == 0 { (stride, 32) } else { (stride + stride / 4, 24) };
    let (mut rest, tail) = split_tail(stream, used.max(least))?;
    let (baseline, modes) = tail[tail.len() - used..].split_at(stride);
    let channels: Vec<Channel> = match version {
        0 => vec![Channel::Bytes; stride / 4],
        _ => modes.iter().map(|&mode| channel(mode)).collect::<Result<_, _>>()?,
    };

    let block = (8192 / stride / GROUP * GROUP).min(BLOCK);
    // A block takes at least two bits for each byte of an element.
    let blocks = count.div_ceil(block);
    if blocks.saturating_mul(stride / 4) > rest.len() {
        return Err(format!("{count} elements do not fit into {} bytes", stream.len()));
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
    if rest.is_empty() { Ok(elements) } else { Err(TOO_LONG.to_owned()) }
}

/// Deltas of one byte of all the block's elements; whole groups.
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
                    // From the top bits down, but single bits from the bottom up.
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

fn channel(mode: u8) -> Result<Channel, String> {
    match (mode & 15, mode >> 4) {
        (0, 0) => Ok(Channel::Bytes),
        (1, 0) => Ok(Channel::Shorts),
        // What the encoder rotated to the left goes back to the right.
        (2, rotation) => Ok(Channel::Xor((32 - u32::from(rotation)) & 31)),
        _ => Err(format!("{mode:#04x} is not a channel mode")),
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

/// The 16 things pushed last, the latest first.
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

/// Signed integers as unsigned ones: 0, −1, 1, −2, ….
fn zigzag(value: u32) -> u32 {
    value >> 1 ^ (value & 1).wrapping_neg()
}

/// Unsigned LEB128 of at most 5 bytes.
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

/// Indices of `stride` bytes.
struct Output {
    bytes: Vec<u8>,
    stride: usize,
}

impl Output {
    fn push(&mut self, index: u32) -> Result<(), String> {
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

/// What the indices of triangles that are still to come build on.
struct Vertices<'a> {
    data: &'a [u8],
    next: u32,
    last: u32,
    recent: Fifo<u32>,
}

impl Vertices<'_> {
    /// The next vertex that has not been seen.
    fn fresh(&mut self) -> u32 {
        let vertex = self.next;
        self.next = vertex.wrapping_add(1);
        vertex
    }

    /// A vertex told of in the data.
    fn explicit(&mut self) -> Result<u32, &'static str> {
        self.last = self.last.wrapping_add(zigzag(leb128(&mut self.data)?));
        Ok(self.last)
    }

    /// The vertex that a half byte stands for, and whether it counts as recent from now on.
    fn coded(&mut self, code: u8) -> Result<(u32, bool), &'static str> {
        match code {
            0 => Ok((self.fresh(), true)),
            15 => Ok((self.explicit()?, true)),
            _ => Ok((self.recent.get(code - 1)?, false)),
        }
    }
}

fn triangles(stream: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, String> {
    if stream.first().is_some_and(|&byte| byte != 0xe1) {
        return Err(format!("the header is {:#04x}, triangles have 0xe1", stream[0]));
    }
    if count % 3 != 0 {
        return Err(format!("a count of {count} is no number of triangles"));
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
                // Unlike elsewhere, the latest vertex has no code here: it is the edge's own.
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
                return Err("the table of common codes is wrong".to_owned());
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
    if vertices.data.is_empty() { Ok(output.bytes) } else { Err(TOO_LONG.to_owned()) }
}

// ---- Mode 2: indices ----

fn indices(stream: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, String> {
    if stream.first().is_some_and(|&byte| byte != 0xd1) {
        return Err(format!("the header is {:#04x}, indices have 0xd1", stream[0]));
    }
    let (mut rest, _) = split_tail(stream, 4)?;
    if count > rest.len() {
        return Err(format!("{count} indices do not fit into {} bytes", rest.len()));
    }
    let mut last = [0_u32; 2];
    let mut output = Output { bytes: Vec::with_capacity(count * stride), stride };
    for _ in 0..count {
        let value = leb128(&mut rest)?;
        let last = &mut last[(value & 1) as usize];
        *last = last.wrapping_add(zigzag(value >> 1));
        output.push(*last)?;
    }
    if rest.is_empty() { Ok(output.bytes) } else { Err(TOO_LONG.to_owned()) }
}

// ---- Filters ----

/// x, y and 1 of an octahedral unit vector, to x, y and z: in units of the input's 1 and of `largest`.
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

/// Three components of a unit quaternion and which is missing, to all four.
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

/// An 8-bit exponent above a 24-bit mantissa, both signed, to a float.
fn exponential(element: &mut [u8; 4]) {
    let bits = i32::from_le_bytes(*element);
    let (exponent, mantissa) = (bits >> 24, bits << 8 >> 8);
    // 2^exponent, exactly: f64 has normal numbers from 2^-1022 on.
    let scale = f64::from_bits(((1023 + exponent) as u64) << 52);
    *element = ((scale * f64::from(mantissa)) as f32).to_le_bytes();
}

/// Luma, two chroma components and alpha below a marking bit, to red, green, blue and alpha up to `largest`.
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
