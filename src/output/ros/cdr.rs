//! CDR, the encoding of ROS 2 messages (Common Data Representation of the OMG, formal/02-06-51 §15.3), little-endian.
//!
//! Each number is aligned to its own size, counted from the end of the encapsulation header. Texts have their length with the
//! closing zero, then their bytes; sequences have their length; arrays of a fixed length have none.

/// The bytes of the encapsulation header: plain CDR, little-endian, no options.
const HEADER: [u8; 4] = [0, 1, 0, 0];

/// A message that grows.
#[derive(Clone, Debug)]
pub(super) struct Message {
    bytes: Vec<u8>,
}

impl Message {
    /// A message without a member. `bytes` is the room that is taken at once.
    pub fn with_capacity(bytes: usize) -> Self {
        let mut message = Self { bytes: Vec::with_capacity(bytes + HEADER.len()) };
        message.bytes.extend_from_slice(&HEADER);
        message
    }

    /// The bytes with the encapsulation header.
    pub fn into_bytes(self) -> Vec<u8> {
        self.bytes
    }

    fn align(&mut self, size: usize) {
        let body = self.bytes.len() - HEADER.len();
        self.bytes.resize(HEADER.len() + body.next_multiple_of(size), 0);
    }

    fn number<const N: usize>(&mut self, bytes: [u8; N]) {
        self.align(N);
        self.bytes.extend_from_slice(&bytes);
    }

    /// Adds an integer of 8 bits.
    pub fn u8(&mut self, value: u8) {
        self.number([value]);
    }

    /// Adds a truth value.
    pub fn bool(&mut self, value: bool) {
        self.u8(value.into());
    }

    /// Adds an integer of 32 bits.
    pub fn u32(&mut self, value: u32) {
        self.number(value.to_le_bytes());
    }

    /// Adds a signed integer of 32 bits.
    pub fn i32(&mut self, value: i32) {
        self.number(value.to_le_bytes());
    }

    /// Adds an integer of 64 bits.
    pub fn u64(&mut self, value: u64) {
        self.number(value.to_le_bytes());
    }

    /// Adds a number of 32 bits.
    pub fn f32(&mut self, value: f32) {
        self.number(value.to_le_bytes());
    }

    /// Adds numbers of 64 bits, without a length. A negative zero becomes a positive one.
    pub fn f64s(&mut self, values: impl IntoIterator<Item = f64>) {
        for value in values {
            self.number((value + 0.0).to_le_bytes());
        }
    }

    /// Adds the length of a sequence whose elements follow. Messages have no sequence of more than 2³² − 1 elements: the sides of
    /// images and the steps of clouds are checked before.
    pub fn length(&mut self, length: usize) {
        self.u32(length as u32);
    }

    /// Adds a text.
    pub fn text(&mut self, text: &str) {
        self.length(text.len() + 1);
        self.bytes.extend_from_slice(text.as_bytes());
        self.bytes.push(0);
    }

    /// Adds a sequence of bytes that `write` appends.
    pub fn bytes_of(&mut self, write: impl FnOnce(&mut Vec<u8>)) {
        self.length(0);
        let start = self.bytes.len();
        write(&mut self.bytes);
        let length = (self.bytes.len() - start) as u32;
        self.bytes[start - 4..start].copy_from_slice(&length.to_le_bytes());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_aligned_from_the_end_of_the_header() {
        let mut message = Message::with_capacity(0);
        message.u8(7);
        message.u32(0x0102_0304);
        message.text("ab");
        message.f64s([-0.0, 1.0]);
        message.bytes_of(|bytes| bytes.extend_from_slice(&[9, 8, 7]));
        message.u64(5);
        let mut expected = vec![0, 1, 0, 0, 7, 0, 0, 0, 4, 3, 2, 1, 3, 0, 0, 0, b'a', b'b', 0, 0, 0, 0, 0, 0];
        // The text ends 15 bytes after the header, so that the next number of 8 bytes begins at 16 bytes; the above goes to 20.
        expected.truncate(4 + 15);
        expected.push(0);
        expected.extend([0.0_f64, 1.0].map(f64::to_le_bytes).as_flattened());
        expected.extend([3, 0, 0, 0, 9, 8, 7, 0]);
        expected.extend(5_u64.to_le_bytes());
        assert_eq!(message.into_bytes(), expected);
    }
}
