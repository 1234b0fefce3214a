//! Modes 1 and 2: the indices of triangles, and other indices.

use super::stream::{StreamError, TOO_LONG, split_tail, take, take_byte};

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

pub(super) fn triangles(stream: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, StreamError> {
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

pub(super) fn indices(stream: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, StreamError> {
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
