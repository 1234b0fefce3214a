//! The types of numbers in files.

use exr::prelude::f16;

/// The type of a number in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::output) enum Number {
    /// A truth value of one byte.
    Bool,
    /// An integer of 8 bits with a sign.
    I8,
    /// An integer of 8 bits.
    U8,
    /// An integer of 16 bits with a sign.
    I16,
    /// An integer of 16 bits.
    U16,
    /// An integer of 32 bits with a sign.
    I32,
    /// An integer of 32 bits.
    U32,
    /// An integer of 64 bits with a sign.
    I64,
    /// An integer of 64 bits.
    U64,
    /// A float of 16 bits.
    F16,
    /// A float of 32 bits.
    F32,
    /// A float of 64 bits.
    F64,
}

impl Number {
    /// The type of this size that PCD and NumPy write with a letter: `I` or `i`, `U` or `u`, `F` or `f`, and NumPy's `b`.
    pub fn of_letter(letter: char, size: usize) -> Option<Self> {
        Some(match (letter.to_ascii_lowercase(), size) {
            ('b', 1) => Self::Bool,
            ('i', 1) => Self::I8,
            ('u', 1) => Self::U8,
            ('i', 2) => Self::I16,
            ('u', 2) => Self::U16,
            ('i', 4) => Self::I32,
            ('u', 4) => Self::U32,
            ('i', 8) => Self::I64,
            ('u', 8) => Self::U64,
            ('f', 2) => Self::F16,
            ('f', 4) => Self::F32,
            ('f', 8) => Self::F64,
            _ => return None,
        })
    }

    /// The type that a PLY calls so, by its older or its newer name.
    pub fn of_ply(word: &str) -> Option<Self> {
        Some(match word {
            "char" | "int8" => Self::I8,
            "uchar" | "uint8" => Self::U8,
            "short" | "int16" => Self::I16,
            "ushort" | "uint16" => Self::U16,
            "int" | "int32" => Self::I32,
            "uint" | "uint32" => Self::U32,
            "float" | "float32" => Self::F32,
            "double" | "float64" => Self::F64,
            _ => return None,
        })
    }

    /// The name, which is PLY's where PLY has one.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bool => "bool",
            Self::I8 => "char",
            Self::U8 => "uchar",
            Self::I16 => "short",
            Self::U16 => "ushort",
            Self::I32 => "int",
            Self::U32 => "uint",
            Self::I64 => "long",
            Self::U64 => "ulong",
            Self::F16 => "half",
            Self::F32 => "float",
            Self::F64 => "double",
        }
    }

    /// The type of a name as [`Number::name`] gives it.
    pub fn of_name(name: &str) -> Option<Self> {
        match name {
            "bool" => Some(Self::Bool),
            "long" => Some(Self::I64),
            "ulong" => Some(Self::U64),
            "half" => Some(Self::F16),
            of_ply => Self::of_ply(of_ply),
        }
    }

    /// The letter that NumPy writes before the number of bytes, and PCD as a capital, which has no `b`.
    pub fn letter(self) -> char {
        match self {
            Self::Bool => 'b',
            Self::I8 | Self::I16 | Self::I32 | Self::I64 => 'i',
            Self::U8 | Self::U16 | Self::U32 | Self::U64 => 'u',
            Self::F16 | Self::F32 | Self::F64 => 'f',
        }
    }

    /// Appends a number of the type, which [`Number::read`] gives again, as bytes, the least significant first. One that the type lacks
    /// is rounded.
    pub fn write(self, value: f64, bytes: &mut Vec<u8>) {
        match self {
            Self::Bool => bytes.push(u8::from(value != 0.0)),
            Self::I8 => bytes.extend((value as i8).to_le_bytes()),
            Self::U8 => bytes.push(value as u8),
            Self::I16 => bytes.extend((value as i16).to_le_bytes()),
            Self::U16 => bytes.extend((value as u16).to_le_bytes()),
            Self::I32 => bytes.extend((value as i32).to_le_bytes()),
            Self::U32 => bytes.extend((value as u32).to_le_bytes()),
            Self::I64 => bytes.extend((value as i64).to_le_bytes()),
            Self::U64 => bytes.extend((value as u64).to_le_bytes()),
            Self::F16 => bytes.extend(f16::from_f64(value).to_le_bytes()),
            Self::F32 => bytes.extend((value as f32).to_le_bytes()),
            Self::F64 => bytes.extend(value.to_le_bytes()),
        }
    }

    /// The number of bytes.
    pub fn size(self) -> usize {
        match self {
            Self::Bool | Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 | Self::F16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }

    /// Whether every number of the type is an integer from 0 to 2³² − 1.
    pub fn fits_u32(self) -> bool {
        matches!(self, Self::Bool | Self::U8 | Self::U16 | Self::U32)
    }

    /// The number that [`Number::size`] bytes represent.
    pub fn read(self, bytes: &[u8], is_big_endian: bool) -> f64 {
        let mut le = [0; 8];
        le[..bytes.len()].copy_from_slice(bytes);
        if is_big_endian {
            le[..bytes.len()].reverse();
        }
        let [a, b, c, d, ..] = le;
        match self {
            Self::Bool => f64::from(u8::from(a != 0)),
            Self::I8 => f64::from(a as i8),
            Self::U8 => f64::from(a),
            Self::I16 => f64::from(i16::from_le_bytes([a, b])),
            Self::U16 => f64::from(u16::from_le_bytes([a, b])),
            Self::I32 => f64::from(i32::from_le_bytes([a, b, c, d])),
            Self::U32 => f64::from(u32::from_le_bytes([a, b, c, d])),
            Self::I64 => i64::from_le_bytes(le) as f64,
            Self::U64 => u64::from_le_bytes(le) as f64,
            Self::F16 => f16::from_le_bytes([a, b]).to_f64(),
            Self::F32 => f64::from(f32::from_le_bytes([a, b, c, d])),
            Self::F64 => f64::from_le_bytes(le),
        }
    }

    /// A number of a text as the type holds it: a text may have more digits.
    pub fn rounded(self, value: f64) -> f64 {
        if self == Self::F32 { f64::from(value as f32) } else { value }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_extremes_of_each_type_are_read() {
        for (number, bytes, value) in [
            (Number::Bool, &[7][..], 1.0),
            (Number::I8, &[0x80], -128.0),
            (Number::U8, &[0xff], 255.0),
            (Number::I16, &[0, 0x80], -32768.0),
            (Number::U16, &[0xfe, 0xff], 65534.0),
            (Number::I32, &[0, 0, 0, 0x80], -2_147_483_648.0),
            (Number::U32, &[0xff; 4], 4_294_967_295.0),
            (Number::I64, &[0xff; 8], -1.0),
            (Number::U64, &[0, 0, 0, 0, 0, 0, 0, 0x80], 9_223_372_036_854_775_808.0),
            (Number::F16, &[0x55, 0x35], 1365.0 / 4096.0),
            (Number::F32, &[0, 0, 0x80, 0x7f], f64::INFINITY),
            (Number::F64, &[0, 0, 0, 0, 0, 0, 0xf8, 0x3f], 1.5),
        ] {
            let reversed: Vec<u8> = bytes.iter().rev().copied().collect();
            assert_eq!((number.size(), number.read(bytes, false)), (bytes.len(), value), "{number:?}");
            assert_eq!(number.read(&reversed, true), value, "{number:?}");
            let mut written = Vec::new();
            number.write(value, &mut written);
            assert_eq!((written.len(), number.read(&written, false)), (number.size(), value), "{number:?}");
            assert_eq!(Number::of_name(number.name()), Some(number));
            assert_eq!(Number::of_letter(number.letter(), number.size()), Some(number));
        }
    }

    #[test]
    fn types_have_the_names_of_their_formats() {
        assert_eq!(Number::of_ply("float32"), Some(Number::F32));
        assert_eq!(Number::of_ply("list"), None);
        assert_eq!(Number::of_letter('U', 2), Some(Number::U16));
        assert_eq!(Number::of_letter('f', 1), None);
    }
}
