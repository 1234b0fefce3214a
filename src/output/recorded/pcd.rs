//! Reading of PCD point clouds, the format of the Point Cloud Library: text, binary, and binary compressed by LZF.

use super::cloud::{Cloud, Column, Field, MAX_FIELDS, check_size, cut_short, read_records, read_words};
use super::error::ReadError;
use super::number::Number;

/// Reads a PCD of version 0.6 or 0.7. A field of several values becomes several fields, `name[0]` and so on, and padding (`_`) none.
///
/// # Errors
/// A [`ReadError`] if the bytes are no PCD or are cut short, if the header contradicts itself, or if the points do not fit into
/// `memory` bytes.
pub fn read_pcd(bytes: &[u8], memory: u64) -> Result<Cloud, ReadError> {
    let header = Header::of(bytes)?;
    let points = header.points()?;
    let fields = header.fields()?;
    let is_there = |field: &&FieldSpec| !field.is_padding();
    let body = header.body;
    let read = match header.data {
        "ascii" => {
            let columns = columns(&fields, true)?;
            check_size(points.min(body.len()), &columns, memory)?;
            read_words(body, points, &columns)?
        }
        "binary" => {
            let columns = columns(&fields, false)?;
            check_size(points.min(body.len()), &columns, memory)?;
            read_records(body, points, stride(fields.iter())?, &columns)?
        }
        "binary_compressed" => {
            // Padding is left out before the fields are compressed.
            let fields: Vec<FieldSpec> = fields.iter().filter(is_there).cloned().collect();
            read_compressed(body, points, &fields, memory)?
        }
        other => return Err(ReadError::new(format!("a PCD has no DATA {other:?}"))),
    };
    Ok(Cloud { points, fields: read, comments: header.comments() })
}

/// The lines before the points, and the bytes after them.
struct Header<'a> {
    lines: Vec<&'a str>,
    /// The word after `DATA`.
    data: &'a str,
    body: &'a [u8],
}

impl<'a> Header<'a> {
    fn of(bytes: &'a [u8]) -> Result<Self, ReadError> {
        const LONGEST: usize = 1 << 20;
        let head = &bytes[..bytes.len().min(LONGEST)];
        let (mut lines, mut start) = (Vec::new(), 0);
        while let Some(length) = head[start..].iter().position(|&b| b == b'\n') {
            let line = std::str::from_utf8(&head[start..start + length]);
            let line = line.map_err(|_| ReadError::new("its header is not text"))?.trim();
            start += length + 1;
            match line.split_once(char::is_whitespace) {
                Some(("DATA", data)) => return Ok(Self { lines, data: data.trim(), body: &bytes[start..] }),
                _ => lines.push(line),
            }
        }
        Err(ReadError::new("its header has no line DATA"))
    }

    /// The words after a key, if the header has it.
    fn words(&self, key: &str) -> Option<Vec<&'a str>> {
        let after =
            |line: &&'a str| line.strip_prefix(key).filter(|rest| rest.starts_with(char::is_whitespace));
        self.lines.iter().find_map(after).map(|rest| rest.split_ascii_whitespace().collect())
    }

    /// The numbers after a key, if the header has it.
    fn numbers(&self, key: &str) -> Result<Option<Vec<usize>>, ReadError> {
        let number = |word: &&str| {
            word.parse().map_err(|_| ReadError::new(format!("its {key} has {word:?}, which is no number")))
        };
        self.words(key).map(|words| words.iter().map(number).collect()).transpose()
    }

    fn points(&self) -> Result<usize, ReadError> {
        let one = |key: &str| Ok::<_, ReadError>(self.numbers(key)?.and_then(|of| of.first().copied()));
        let (width, height, points) = (one("WIDTH")?, one("HEIGHT")?, one("POINTS")?);
        let of_sides = width.map(|width| width.checked_mul(height.unwrap_or(1)));
        match (of_sides, points) {
            (None, Some(points)) => Ok(points),
            (Some(Some(of_sides)), points) if points.is_none_or(|points| points == of_sides) => Ok(of_sides),
            (Some(_), _) => {
                let [width, height] = [width, height].map(|side| side.unwrap_or(1));
                let points =
                    points.map_or("overflows".to_owned(), |points| format!("is not POINTS {points}"));
                Err(ReadError::new(format!("its WIDTH {width} × HEIGHT {height} {points}")))
            }
            (None, None) => Err(ReadError::new("its header has neither POINTS nor WIDTH")),
        }
    }

    fn fields(&self) -> Result<Vec<FieldSpec>, ReadError> {
        let missing = |key: &str| ReadError::new(format!("its header has no line {key}"));
        let names =
            self.words("FIELDS").or_else(|| self.words("COLUMNS")).ok_or_else(|| missing("FIELDS"))?;
        let sizes = self.numbers("SIZE")?.ok_or_else(|| missing("SIZE"))?;
        let types = self.words("TYPE").ok_or_else(|| missing("TYPE"))?;
        let counts = self.numbers("COUNT")?.unwrap_or_else(|| vec![1; names.len()]);
        for (key, count) in [("SIZE", sizes.len()), ("TYPE", types.len()), ("COUNT", counts.len())] {
            if count != names.len() {
                return Err(ReadError::new(format!(
                    "it has {} FIELDS, and {count} words of {key}",
                    names.len()
                )));
            }
        }
        let field = |(((name, size), kind), count): (((&&str, usize), &&str), usize)| {
            let number = match *kind {
                "I" | "U" | "F" => Number::of_letter(kind.chars().next().unwrap_or_default(), size),
                _ => None,
            };
            if number.is_none() && *name != "_" {
                let problem =
                    format!("its field {name:?} has TYPE {kind} and SIZE {size}, which is no number");
                return Err(ReadError::new(problem));
            }
            Ok(FieldSpec { name: (*name).to_owned(), number, size, count })
        };
        names.iter().zip(sizes).zip(&types).zip(counts).map(field).collect()
    }

    /// The comments, and where the points are in the world.
    fn comments(&self) -> Vec<String> {
        let comment = |line: &&str| match line.strip_prefix('#').map(str::trim) {
            Some(comment) => (!comment.starts_with(".PCD")).then(|| comment.to_owned()),
            None => line.starts_with("VIEWPOINT").then(|| (*line).to_owned()),
        };
        self.lines.iter().filter_map(comment).collect()
    }
}

/// A field of the header.
#[derive(Clone, Debug)]
struct FieldSpec {
    name: String,
    /// `None` of padding whose type is no number.
    number: Option<Number>,
    size: usize,
    /// The number of values.
    count: usize,
}

impl FieldSpec {
    fn is_padding(&self) -> bool {
        self.name == "_"
    }
}

/// The bytes of a point.
fn stride<'f>(fields: impl Iterator<Item = &'f FieldSpec>) -> Result<usize, ReadError> {
    let add = |sum: usize, field: &FieldSpec| field.size.checked_mul(field.count)?.checked_add(sum);
    let stride = fields.into_iter().try_fold(0, add);
    stride.ok_or_else(|| ReadError::new("the size of its points overflows"))
}

/// The numbers of a point. With padding, each of its values is one of them, and else it only moves what follows.
fn columns(fields: &[FieldSpec], with_padding: bool) -> Result<Vec<Column>, ReadError> {
    stride(fields.iter())?;
    let (mut columns, mut offset) = (Vec::new(), 0);
    for field in fields {
        if !field.is_padding() || with_padding {
            for index in 0..field.count {
                if columns.len() == MAX_FIELDS {
                    return Err(ReadError::new(format!("it has more than {MAX_FIELDS} fields a point")));
                }
                let name =
                    if field.count == 1 { field.name.clone() } else { format!("{}[{index}]", field.name) };
                columns.push(Column {
                    name: (!field.is_padding()).then_some(name),
                    number: field.number.unwrap_or(Number::U8),
                    offset: offset + index * field.size,
                    is_big_endian: false,
                });
            }
        }
        offset += field.size * field.count;
    }
    Ok(columns)
}

/// Compressed points: the lengths in 32 bits of what follows and of what it becomes, which is each field of all points after the
/// other.
fn read_compressed(
    body: &[u8],
    points: usize,
    fields: &[FieldSpec],
    memory: u64,
) -> Result<Vec<Field>, ReadError> {
    let (lengths, rest) = body.split_at_checked(8).ok_or_else(|| cut_short(points))?;
    let lengths = lengths.as_chunks::<4>().0;
    let [packed, length] = [lengths[0], lengths[1]].map(|bytes| u32::from_le_bytes(bytes) as usize);
    let packed = rest.get(..packed).ok_or_else(|| cut_short(points))?;
    let columns_of_all = columns(fields, false)?;
    if points.checked_mul(stride(fields.iter())?) != Some(length) {
        let problem =
            format!("its compressed points are {length} bytes, and the header promises {points} points");
        return Err(ReadError::new(problem));
    }
    if length / MAX_COMPRESSION > packed.len() {
        let problem = format!("it claims {length} bytes of points, which {} bytes can't hold", packed.len());
        return Err(ReadError::new(problem));
    }
    ReadError::check_memory(length as u64, memory)?;
    check_size(points, &columns_of_all, memory - length as u64)?;
    let bytes =
        decompress(packed, length).ok_or_else(|| ReadError::new("its compressed points are broken"))?;
    let (mut read, mut rest) = (Vec::new(), bytes.as_slice());
    for field in fields {
        // The product was checked with that of all fields.
        let (of_field, after) = rest.split_at(points * field.size * field.count);
        let alone = std::slice::from_ref(field);
        read.extend(read_records(of_field, points, field.size * field.count, &columns(alone, false)?)?);
        rest = after;
    }
    Ok(read)
}

/// The greatest compression ratio of LZF: three bytes stand for up to 264.
const MAX_COMPRESSION: usize = 88;

/// Decompresses LZF, the format of Marc Lehmann's LibLZF, into `length` bytes. `None` if it is broken or of another length.
///
/// A byte below 32 is followed by as many bytes as they are, and one more. Any other begins a copy of what came before: its upper
/// three bits are the length less 2, to which the next byte adds if they are 7, and its lower five bits with the next byte are the
/// distance less 1.
fn decompress(packed: &[u8], length: usize) -> Option<Vec<u8>> {
    let mut bytes: Vec<u8> = Vec::with_capacity(length);
    let mut rest = packed;
    while let Some((&control, after)) = rest.split_first() {
        let control = usize::from(control);
        if control < 32 {
            let (literal, after) = after.split_at_checked(control + 1)?;
            bytes.extend_from_slice(literal);
            rest = after;
        } else {
            let (more, after) = if control >> 5 == 7 { after.split_first()? } else { (&0, after) };
            let (low, after) = after.split_first()?;
            let count = (control >> 5) + usize::from(*more) + 2;
            let distance = ((control & 31) << 8) + usize::from(*low) + 1;
            let start = bytes.len().checked_sub(distance)?;
            // What is copied may reach into the copy.
            for at in start..start + count {
                bytes.push(bytes[at]);
            }
            rest = after;
        }
        if bytes.len() > length {
            return None;
        }
    }
    (bytes.len() == length).then_some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Two points in a header that is whole but for its data.
    const HEADER: &str = "# .PCD v0.7 - Point Cloud Data file format\n# made by hand\nVERSION 0.7\nFIELDS x _ label normal\n\
                          SIZE 4 1 2 8\nTYPE F U I F\nCOUNT 1 3 1 2\nWIDTH 2\nHEIGHT 1\nVIEWPOINT 1 2 3 1 0 0 0\nPOINTS 2\n";
    const POINTS: [(f32, i16, [f64; 2]); 2] = [(0.1, -3, [0.25, -1e-300]), (f32::NAN, 7, [2.0, 3.0])];

    fn text() -> Vec<u8> {
        format!("{HEADER}DATA ascii\n0.1 0 0 0 -3 0.25 -1e-300\r\nnan 9 9 9 7 2 3\n").into_bytes()
    }

    fn binary() -> Vec<u8> {
        let mut bytes = format!("{HEADER}DATA binary\n").into_bytes();
        for (x, label, normal) in POINTS {
            bytes.extend(x.to_le_bytes());
            bytes.extend([9; 3]);
            bytes.extend(label.to_le_bytes());
            bytes.extend(normal.map(f64::to_le_bytes).as_flattened());
        }
        bytes
    }

    fn compressed() -> Vec<u8> {
        let mut plain = Vec::new();
        POINTS.iter().for_each(|(x, ..)| plain.extend(x.to_le_bytes()));
        POINTS.iter().for_each(|(_, label, _)| plain.extend(label.to_le_bytes()));
        POINTS.iter().for_each(|(.., normal)| plain.extend(normal.map(f64::to_le_bytes).as_flattened()));
        // Runs of 32 bytes at most, as they are.
        let packed: Vec<u8> =
            plain.chunks(32).flat_map(|run| [&[run.len() as u8 - 1], run].concat()).collect();
        let mut bytes = format!("{HEADER}DATA binary_compressed\n").into_bytes();
        bytes.extend([packed.len(), plain.len()].map(|length| (length as u32).to_le_bytes()).as_flattened());
        bytes.extend(packed);
        bytes
    }

    #[test]
    fn every_encoding_says_the_same() {
        for bytes in [text(), binary(), compressed()] {
            let cloud = read_pcd(&bytes, u64::MAX).unwrap();
            let names: Vec<_> = cloud.fields.iter().map(|field| (field.name.as_str(), field.kind)).collect();
            let expected =
                [("x", "float"), ("label", "short"), ("normal[0]", "double"), ("normal[1]", "double")];
            assert_eq!(names, expected);
            let x = cloud.field("x").unwrap();
            assert!(cloud.points == 2 && x[0] == f64::from(0.1_f32) && x[1].is_nan());
            assert_eq!(cloud.field("label").unwrap(), [-3.0, 7.0]);
            assert_eq!(cloud.field("normal[1]").unwrap(), [-1e-300, 3.0]);
            assert_eq!(cloud.comments, ["made by hand", "VIEWPOINT 1 2 3 1 0 0 0"]);
        }
    }

    #[test]
    fn lzf_copies_what_came_before() {
        // `ab`, then 10 bytes from 2 before, then 3 from 12 before.
        let packed = [1, b'a', b'b', 7 << 5, 1, 1, 1 << 5, 11];
        assert_eq!(decompress(&packed, 15).unwrap(), b"abababababababa");
        assert_eq!(decompress(&packed, 14), None, "another length");
        assert_eq!(decompress(&[1, b'a', b'b', 1 << 5, 2], 5), None, "from before the beginning");
        assert_eq!(decompress(&packed[..7], 15), None, "cut short");
    }

    #[test]
    fn errors_name_the_problem() {
        let of = |bytes: &[u8]| read_pcd(bytes, u64::MAX).unwrap_err().to_string();
        for whole in [text(), binary(), compressed()] {
            assert!(of(&whole[..whole.len() - 4]).contains("cut short"), "{}", of(&whole[..whole.len() - 4]));
        }
        let header =
            |from: &str, to: &str| of(String::from_utf8(text()).unwrap().replace(from, to).as_bytes());
        assert_eq!(header("HEIGHT 1", "HEIGHT 3"), "its WIDTH 2 × HEIGHT 3 is not POINTS 2");
        assert!(header("HEIGHT 1", "HEIGHT 18446744073709551615").contains("is not POINTS 2"));
        assert_eq!(header("TYPE F U I F", "TYPE F U I"), "it has 4 FIELDS, and 3 words of TYPE");
        assert_eq!(
            header("TYPE F U I F", "TYPE F U X F"),
            "its field \"label\" has TYPE X and SIZE 2, which is no number"
        );
        assert_eq!(header("DATA ascii", "DATA best"), "a PCD has no DATA \"best\"");
        assert_eq!(header("DATA", "Data"), "its header has no line DATA");
        assert_eq!(header("COUNT 1 3 1 2", "COUNT 1 3 1 999"), "it has more than 256 fields a point");
        assert_eq!(
            header("COUNT 1 3 1 2", "COUNT 1 18446744073709551615 1 2"),
            "the size of its points overflows"
        );
        assert_eq!(header("0.25", "a"), "point 0 has \"a\" for \"normal[0]\"");
        let problem = read_pcd(&text(), 63).unwrap_err().to_string();
        assert_eq!(problem, "it takes 64 bytes of memory, more than the 63 that there are");
    }

    #[test]
    fn a_claim_that_bytes_cannot_hold_takes_no_memory() {
        let lengths = |header: &str| {
            let mut bytes =
                format!("FIELDS x\nSIZE 4\nTYPE F\n{header}\nDATA binary_compressed\n").into_bytes();
            bytes.extend([4_u32, 4_000_000_000].map(u32::to_le_bytes).as_flattened());
            bytes.extend([0xff; 4]);
            read_pcd(&bytes, u64::MAX).unwrap_err().to_string()
        };
        assert_eq!(
            lengths("POINTS 1000000000"),
            "it claims 4000000000 bytes of points, which 4 bytes can't hold"
        );
        assert!(lengths("POINTS 5").contains("promises 5 points"));
        let many = "FIELDS x\nSIZE 4\nTYPE F\nPOINTS 18446744073709551615\nDATA binary\n1234";
        assert!(read_pcd(many.as_bytes(), u64::MAX).unwrap_err().to_string().contains("cut short"));
    }

    proptest! {
        #[test]
        fn broken_bytes_are_an_error_or_a_cloud(which in 0_usize..3, at in 0.0..1.0, value: u8, keep in 0.0..2.0) {
            let mut bytes = [text(), binary(), compressed()][which].clone();
            let at = (at * bytes.len() as f64) as usize;
            bytes[at] = value;
            bytes.truncate((keep * bytes.len() as f64) as usize);
            if let Ok(cloud) = read_pcd(&bytes, u64::MAX) {
                prop_assert!(cloud.fields.iter().all(|f| f.values.len() == cloud.points));
            }
        }

        #[test]
        fn any_bytes_are_lzf_or_not(bytes: Vec<u8>, length in 0_usize..1000) {
            if let Some(plain) = decompress(&bytes, length) {
                prop_assert_eq!(plain.len(), length);
            }
        }
    }
}
