//! Point clouds as NumPy's NPY, and the header that arrays of an NPZ have too.

use super::format::{Content, EncodeError, Field, FormatSpec, Kind, field};
use super::ply;
use super::points::{MOTION, TERMS, more_fields};

/// The fields in their order: those of the PLY, in NumPy's words.
static FIELDS: [Field; 10] = [
    field("x", "<f4", "m"),
    field("y", "<f4", "m"),
    field("z", "<f4", "m"),
    field("intensity", "<f4", "0 to 1"),
    field("ring", "<i4", "from 0"),
    field("column", "<i4", "from 0"),
    field("t", "<i4", "ns from the frame's start"),
    field("instance", "<i4", "from 1"),
    field("label", "<i4", "0 is none"),
    field("range", "<f4", "m"),
];

/// A structured array of the frame's points, which are those of the PLY, in the same order.
pub(super) static FORMAT: FormatSpec = FormatSpec {
    name: "npy",
    ending: "npy",
    about: "NumPy arrays of points",
    content: Content::Points(&FIELDS),
    read_by: "NumPy",
    check: ply::FORMAT.check,
    most_label: ply::FORMAT.most_label,
    most_instance: ply::FORMAT.most_instance,
    encoding_bytes_a_ray: ply::bytes_a_ray,
    file_bytes_a_ray: ply::bytes_a_ray,
    options: &[MOTION, TERMS],
    kind: Kind::File(|cloud, options| {
        let more = more_fields(cloud.capture.sensor, options);
        let more = more.into_iter().map(|(name, is_integer)| (name, if is_integer { "<i4" } else { "<f4" }));
        let fields = FIELDS.iter().map(|field| (field.name, field.kind)).chain(more);
        let types: Vec<_> = fields.map(|(name, kind)| format!("('{name}', '{kind}')")).collect();
        let mut file = header(&format!("[{}]", types.join(", ")), &[cloud.frame.return_count()])?;
        ply::add_points(cloud, options, &mut file)?;
        Ok(file)
    }),
    ..FormatSpec::PLAIN
};

/// The header of an array in version 1.0, whose rows follow each other. `kind` is the array's dtype as Python writes it.
pub(super) fn header(kind: &str, shape: &[usize]) -> Result<Vec<u8>, EncodeError> {
    /// The array begins at a multiple of this.
    const ALIGNMENT: usize = 64;
    const MAGIC_VERSION_AND_LENGTH: usize = 10;
    // A tuple of one number has a comma, too.
    let sides: String = shape.iter().map(|side| format!("{side}, ")).collect();
    let sides = if shape.len() == 1 { sides.trim_end() } else { sides.trim_end_matches(", ") };
    let mut text = format!("{{'descr': {kind}, 'fortran_order': False, 'shape': ({sides}), }}");
    let length = (MAGIC_VERSION_AND_LENGTH + text.len() + 1).next_multiple_of(ALIGNMENT);
    text += &" ".repeat(length - MAGIC_VERSION_AND_LENGTH - text.len() - 1);
    text.push('\n');
    let bytes = u16::try_from(text.len())
        .map_err(|_| EncodeError::new(format!("an NPY's header can't have {} bytes", text.len())))?;
    Ok([b"\x93NUMPY\x01\x00".as_slice(), &bytes.to_le_bytes(), text.as_bytes()].concat())
}

#[cfg(test)]
mod tests {
    use super::super::format::Field;
    use super::*;

    #[test]
    fn a_header_says_what_follows_and_ends_at_a_multiple_of_64() {
        for (shape, written) in
            [(&[3][..], "(3,)"), (&[2, 3], "(2, 3)"), (&[2, 3, 3], "(2, 3, 3)"), (&[], "()")]
        {
            let header = header("'<f4'", shape).unwrap();
            assert_eq!((header.len() % 64, header.last()), (0, Some(&b'\n')));
            let text = std::str::from_utf8(&header[10..]).unwrap();
            let start = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': {written}, }} ");
            assert!(text.starts_with(&start), "{text}");
            assert_eq!(usize::from(u16::from_le_bytes([header[8], header[9]])), text.len());
        }
    }

    /// The bytes of a point are the PLY's, and so its fields must be.
    #[test]
    fn the_fields_are_those_of_the_ply() {
        let Content::Points(ply) = ply::FORMAT.content else { panic!("{:?}", ply::FORMAT.content) };
        let same = |(a, b): (&Field, &Field)| {
            a.name == b.name && a.unit == b.unit && (a.kind == "<f4") == (b.kind == "float")
        };
        assert!(FIELDS.len() == ply.len() && FIELDS.iter().zip(ply).all(same));
    }
}
