//! Reading of NumPy's NPY: arrays of numbers, and structured arrays as point clouds.

use super::cloud::{Cloud, Column, MAX_FIELDS, check_size, read_records};
use super::error::ReadError;
use super::number::Number;
use super::python::Value;

/// Reads a structured array, each of whose values is a point. A field of several values becomes several fields, `name[0]` and so on.
///
/// # Errors
/// A [`ReadError`] if the bytes are no such array, if they are cut short, or if the points do not fit into `memory` bytes.
pub fn read_npy(bytes: &[u8], memory: u64) -> Result<Cloud, ReadError> {
    let array = Array::of(bytes)?;
    let Kind::Record { columns, stride } = &array.kind else {
        return Err(ReadError::new(format!(
            "it is an array of {} without names: only a structured array with fields such as x, y and z is a cloud",
            array.in_words()
        )));
    };
    if array.is_fortran && array.shape.len() > 1 {
        return Err(ReadError::new(
            "its points are in Fortran's order, column by column: numpy.ascontiguousarray turns them",
        ));
    }
    let points = array.len()?;
    check_size(points.min(array.body.len()), columns, memory)?;
    let fields = read_records(array.body, points, *stride, columns)?;
    Ok(Cloud { points, fields, comments: Vec::new() })
}

/// An array, whose values are not decoded.
pub(super) struct Array<'a> {
    pub kind: Kind,
    /// The sides.
    pub shape: Vec<usize>,
    /// Whether the first index counts fastest.
    pub is_fortran: bool,
    /// The bytes after the header.
    pub body: &'a [u8],
    /// The type as it is written.
    descr: String,
}

/// The type of an array's values.
pub(super) enum Kind {
    /// Numbers, and whether the first byte is the most significant.
    Number(Number, bool),
    /// Texts of so many bytes.
    Text(usize),
    /// Records of numbers, with the bytes of each.
    Record {
        /// The numbers.
        columns: Vec<Column>,
        /// The bytes of a record.
        stride: usize,
    },
    /// Anything else.
    Other,
}

/// Most sides of an array: NumPy has no more.
const MAX_SIDES: usize = 64;

impl<'a> Array<'a> {
    /// Reads the header.
    ///
    /// # Errors
    /// A [`ReadError`] if the bytes do not begin with the header of an array, or if a record has a field that is no number.
    pub fn of(bytes: &'a [u8]) -> Result<Self, ReadError> {
        const MAGIC: &[u8] = b"\x93NUMPY";
        const LONGEST: usize = 1 << 20;
        let no_header = || ReadError::new("its header is cut short");
        let rest = bytes.strip_prefix(MAGIC).ok_or_else(|| ReadError::new("this is no NPY"))?;
        let (version, rest) = rest.split_at_checked(2).ok_or_else(no_header)?;
        let (length, rest) = match version {
            [1, _] => {
                let (length, rest) = rest.split_at_checked(2).ok_or_else(no_header)?;
                (usize::from(length[0]) | usize::from(length[1]) << 8, rest)
            }
            [2 | 3, _] => {
                let (length, rest) = rest.split_at_checked(4).ok_or_else(no_header)?;
                (length.iter().rev().fold(0, |sum, &byte| sum << 8 | usize::from(byte)), rest)
            }
            [major, minor] => {
                return Err(ReadError::new(format!(
                    "it is of version {major}.{minor}, and up to 3.0 are read"
                )));
            }
            _ => return Err(no_header()),
        };
        let (text, body) =
            rest.split_at_checked(length).filter(|_| length <= LONGEST).ok_or_else(no_header)?;
        let text = std::str::from_utf8(text).map_err(|_| ReadError::new("its header is not text"))?;
        let header =
            Value::parse(text).ok_or_else(|| ReadError::new("its header is no dictionary of Python"))?;
        let missing = |key: &str| ReadError::new(format!("its header has no {key:?} that can be read"));
        let shape = header.get("shape").and_then(Value::numbers).ok_or_else(|| missing("shape"))?;
        if shape.len() > MAX_SIDES {
            return Err(ReadError::new(format!("it has {} sides, more than {MAX_SIDES}", shape.len())));
        }
        let Some(&Value::Bool(is_fortran)) = header.get("fortran_order") else {
            return Err(missing("fortran_order"));
        };
        let descr = header.get("descr").ok_or_else(|| missing("descr"))?;
        let kind = match descr {
            Value::Text(word) => kind_of(word),
            Value::List(fields) => record(fields)?,
            _ => return Err(missing("descr")),
        };
        let descr = if let Value::Text(word) = descr { word.clone() } else { String::new() };
        Ok(Self { kind, shape, is_fortran, body, descr })
    }

    /// The number of values.
    ///
    /// # Errors
    /// An error if no number is as large.
    pub fn len(&self) -> Result<usize, ReadError> {
        let product = self.shape.iter().try_fold(1_usize, |product, side| product.checked_mul(*side));
        product.ok_or_else(|| ReadError::new("its size overflows"))
    }

    /// The shape and the type in words: `16 × 1024 float`.
    pub fn in_words(&self) -> String {
        let sides: Vec<String> = self.shape.iter().map(usize::to_string).collect();
        let kind = match &self.kind {
            Kind::Number(number, _) => number.name(),
            Kind::Text(_) => "text",
            Kind::Record { .. } => "records",
            Kind::Other => self.descr.as_str(),
        };
        if sides.is_empty() { format!("one {kind}") } else { format!("{} {kind}", sides.join(" × ")) }
    }
}

/// The kind that a dtype such as `<f4` says: the order of bytes, a letter, and a number of bytes.
fn kind_of(word: &str) -> Kind {
    let (is_big_endian, rest) = match word.strip_prefix('>') {
        Some(rest) => (true, rest),
        None => (false, word.trim_start_matches(['<', '=', '|'])),
    };
    let mut rest = rest.chars();
    let letter = rest.next();
    match (letter, rest.as_str().parse::<usize>()) {
        (Some('S' | 'a'), Ok(size)) => Kind::Text(size),
        (Some(letter @ ('b' | 'i' | 'u' | 'f')), Ok(size)) => {
            Number::of_letter(letter, size).map_or(Kind::Other, |number| Kind::Number(number, is_big_endian))
        }
        _ => Kind::Other,
    }
}

/// The record of a list of fields, each a tuple of its name, its dtype and, of several values, its shape.
fn record(fields: &[Value]) -> Result<Kind, ReadError> {
    let (mut columns, mut stride) = (Vec::new(), 0_usize);
    for field in fields {
        let wrong = || ReadError::new("its header has a field that is no name with a type");
        let Value::List(parts) = field else { return Err(wrong()) };
        let (name, kind, shape) = match &parts[..] {
            [name, kind] => (name, kind, Vec::new()),
            [name, kind, shape] => (name, kind, shape.numbers().ok_or_else(wrong)?),
            _ => return Err(wrong()),
        };
        let name = match name {
            Value::Text(name) => name,
            // A title comes before the name.
            Value::List(both) => both.last().and_then(Value::text).ok_or_else(wrong)?,
            _ => return Err(wrong()),
        };
        let Value::Text(word) = kind else {
            return Err(ReadError::new(format!(
                "its field {name:?} has fields of its own, which are not read"
            )));
        };
        let count = shape.iter().try_fold(1_usize, |product, side| product.checked_mul(*side));
        let overflow = || ReadError::new("the size of its points overflows");
        let count = count.ok_or_else(overflow)?;
        let size = match kind_of(word) {
            Kind::Number(number, is_big_endian) => {
                if count > MAX_FIELDS || columns.len() + count > MAX_FIELDS {
                    return Err(ReadError::new(format!("it has more than {MAX_FIELDS} fields a point")));
                }
                columns.extend((0..count).map(|index| Column {
                    name: Some(if shape.is_empty() { name.clone() } else { format!("{name}[{index}]") }),
                    number,
                    offset: stride + index * number.size(),
                    is_big_endian,
                }));
                number.size()
            }
            // Fields without a name are the padding of aligned records.
            Kind::Other if name.is_empty() && word.trim_start_matches('|').starts_with('V') => {
                word.trim_start_matches(['|', 'V']).parse().map_err(|_| wrong())?
            }
            _ => {
                return Err(ReadError::new(format!(
                    "its field {name:?} has the type {word:?}, which is no number"
                )));
            }
        };
        // Offsets of numbers are below the stride, and so no sum of theirs overflows.
        stride = size.checked_mul(count).and_then(|size| size.checked_add(stride)).ok_or_else(overflow)?;
        if stride > isize::MAX as usize / 2 {
            return Err(overflow());
        }
    }
    Ok(Kind::Record { columns, stride })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// An array of version 1.0 with this dictionary.
    fn npy(header: &str, body: &[u8]) -> Vec<u8> {
        let length = (header.len() as u16).to_le_bytes();
        [b"\x93NUMPY\x01\x00", &length[..], header.as_bytes(), body].concat()
    }

    /// Two points of an aligned record with a big-endian field and one of two values.
    fn points() -> Vec<u8> {
        let header = "{'descr': [('x', '<f4'), ('', '|V2'), ((\"the label\", 'label'), '>i2'), ('n', '<f8', (2,))], \
                      'fortran_order': False, 'shape': (2,), }\n";
        let mut body = Vec::new();
        for (x, label, n) in [(0.1_f32, -3_i16, [1.5, 2.5]), (7.0, 300, [-1.0, f64::INFINITY])] {
            body.extend(x.to_le_bytes());
            body.extend([9; 2]);
            body.extend(label.to_be_bytes());
            body.extend(n.map(f64::to_le_bytes).as_flattened());
        }
        npy(header, &body)
    }

    #[test]
    fn fields_come_back_by_name() {
        let cloud = read_npy(&points(), u64::MAX).unwrap();
        let names: Vec<_> = cloud.fields.iter().map(|field| (field.name.as_str(), field.kind)).collect();
        assert_eq!(names, [("x", "float"), ("label", "short"), ("n[0]", "double"), ("n[1]", "double")]);
        assert_eq!(cloud.field("x").unwrap(), [f64::from(0.1_f32), 7.0]);
        assert_eq!(cloud.field("label").unwrap(), [-3.0, 300.0]);
        assert_eq!(cloud.field("n[1]").unwrap(), [2.5, f64::INFINITY]);
    }

    #[test]
    fn errors_name_the_problem() {
        let of = |bytes: &[u8]| read_npy(bytes, u64::MAX).unwrap_err().to_string();
        let whole = points();
        assert_eq!(of(&whole[..whole.len() - 1]), "it is cut short: its header promises 2 points");
        assert_eq!(of(&whole[..40]), "its header is cut short");
        assert_eq!(of(b"\x93NUMPY\x09\x00"), "it is of version 9.0, and up to 3.0 are read");
        let header = |descr: &str, shape: &str| {
            of(&npy(&format!("{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}}}"), &[0; 64]))
        };
        let plain = header("'<f4'", "(4, 3)");
        assert!(plain.starts_with("it is an array of 4 × 3 float without names"), "{plain}");
        assert!(header("'|O'", "()").contains("one |O"));
        let text = header("[('a', '<U8')]", "(1,)");
        assert_eq!(text, "its field \"a\" has the type \"<U8\", which is no number");
        assert!(header("[('a', [('b', '<f4')])]", "(1,)").contains("fields of its own"));
        assert!(header("[('a', '<f4')]", "(99999999999, 99999999999)").contains("overflows"));
        assert!(header("[('a', '<f4')]", "(99999999999,)").contains("promises 99999999999 points"));
        assert!(header("[('a', '<f4', (18446744073709551615, 4))]", "(1,)").contains("overflows"));
        assert!(header("[('a', '<f4', (999,))]", "(1,)").contains("more than 256 fields"));
        assert_eq!(header("[('', '|V4')]", "(1,)"), "its points have no fields");
        assert!(header("7", "(1,)").contains("no \"descr\""));
        assert!(header("[('a', '<f4')]", "'x'").contains("no \"shape\""));
        assert!(of(&npy("os.system('a')", &[])).contains("no dictionary"));
        assert!(read_npy(&whole, 63).unwrap_err().to_string().contains("takes 64 bytes of memory"));
    }

    proptest! {
        #[test]
        fn broken_bytes_are_an_error_or_a_cloud(at in 0.0..1.0, value: u8, keep in 0.0..2.0) {
            let mut bytes = points();
            let at = (at * bytes.len() as f64) as usize;
            bytes[at] = value;
            bytes.truncate((keep * bytes.len() as f64) as usize);
            if let Ok(cloud) = read_npy(&bytes, u64::MAX) {
                prop_assert!(cloud.fields.iter().all(|f| f.values.len() == cloud.points));
            }
        }
    }
}
