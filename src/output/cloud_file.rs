//! Recorded clouds as files of another format: every field with its name, its type and its values as they were read.
//!
//! A format that would change a value gives an error, and one that would change only a name or lose a comment gives a note.

use std::fmt::Write as _;

use super::cloud_columns::{Column, lines_of, of_pcd};
use super::format::EncodeError;
use super::las;
use super::npy;
use super::recorded::{Cloud, Field, Number};
use crate::source::words::counted;

/// A format of clouds that recorded ones are written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CloudFormat {
    /// Binary PLY.
    Ply,
    /// Binary PCD.
    Pcd,
    /// A structured array of NumPy.
    Npy,
    /// LAS 1.4.
    Las,
    /// A LAS whose points are compressed.
    Laz,
}

impl CloudFormat {
    /// Every format with its ending.
    pub const ALL: [(Self, &'static str); 5] =
        [(Self::Ply, "ply"), (Self::Pcd, "pcd"), (Self::Npy, "npy"), (Self::Las, "las"), (Self::Laz, "laz")];

    /// The format of an ending.
    pub fn of_ending(ending: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|(_, known)| *known == ending).map(|(format, _)| format)
    }

    /// The file of a cloud, and what is to be known about it, in sentences. The coordinates of a LAS are steps of `step_m` metres, and
    /// all other values are exact.
    ///
    /// # Errors
    /// An [`EncodeError`] about what the format can't hold.
    pub fn encode(self, cloud: &Cloud, step_m: f64) -> Result<(Vec<u8>, Vec<String>), EncodeError> {
        let mut notes = Vec::new();
        let columns = columns(cloud)?;
        let file = match self {
            Self::Ply => ply(cloud, columns, &mut notes)?,
            Self::Pcd => pcd(cloud, columns, &mut notes)?,
            Self::Npy => npy(cloud, columns, &mut notes)?,
            Self::Las => las::of_cloud(cloud, &columns, step_m, false, &mut notes)?,
            Self::Laz => las::of_cloud(cloud, &columns, step_m, true, &mut notes)?,
        };
        Ok((file, notes))
    }
}

/// The fields as they are.
fn columns(cloud: &Cloud) -> Result<Vec<Column<'_>>, EncodeError> {
    cloud.fields.iter().map(column).collect()
}

fn column(field: &Field) -> Result<Column<'_>, EncodeError> {
    // A reader rounds larger ones, so that what was in the file is not known.
    const MOST: f64 = 9_007_199_254_740_992.0;
    let is_wide = matches!(field.kind, "long" | "ulong");
    if let Some(value) = field.values.iter().find(|value| is_wide && value.abs() >= MOST) {
        return Err(EncodeError::new(format!(
            "its field {:?} has the integer {value}, and only those below 2⁵³ can be converted exactly",
            field.name
        )));
    }
    let number = Number::of_name(field.kind).unwrap_or(Number::F64);
    Ok(Column { name: field.name.clone(), number, values: &field.values })
}

/// Gives each column a name of characters that the format takes, which differs from all others. Others become `_`.
fn rename(
    columns: &mut [Column],
    format: &str,
    is_taken: fn(char) -> bool,
    notes: &mut Vec<String>,
) -> Result<(), EncodeError> {
    for index in 0..columns.len() {
        let name: String = columns[index].name.chars().map(|c| if is_taken(c) { c } else { '_' }).collect();
        // PCD takes `_` for padding.
        let name = if name.is_empty() || name == "_" { format!("field{index}") } else { name };
        if name != columns[index].name {
            notes.push(format!(
                "the field {:?} is called {name:?}, as {format} names fields",
                columns[index].name
            ));
        }
        if let Some(other) = columns[..index].iter().find(|other| other.name == name) {
            return Err(EncodeError::new(format!("two of its fields would be called {:?}", other.name)));
        }
        columns[index].name = name;
    }
    Ok(())
}

/// Gives columns of a type that the format lacks another that holds all of its values.
fn widen(columns: &mut [Column], format: &str, other: fn(Number) -> Number, notes: &mut Vec<String>) {
    for column in columns {
        let number = other(column.number);
        if number != column.number {
            let (from, to) = (column.number.name(), number.name());
            notes.push(format!("the field {:?} is {to}, because {format} has no {from}", column.name));
            column.number = number;
        }
    }
}

/// The types that PLY has.
fn of_ply(number: Number) -> Number {
    match number {
        Number::Bool => Number::U8,
        Number::F16 => Number::F32,
        // Integers below 2⁵³ are exact, and larger ones are refused.
        Number::I64 | Number::U64 => Number::F64,
        other => other,
    }
}

fn is_of_word(c: char) -> bool {
    c.is_ascii_graphic()
}

fn ply(cloud: &Cloud, mut columns: Vec<Column>, notes: &mut Vec<String>) -> Result<Vec<u8>, EncodeError> {
    rename(&mut columns, "PLY", is_of_word, notes)?;
    widen(&mut columns, "PLY", of_ply, notes);
    let mut header = "ply\nformat binary_little_endian 1.0\n".to_owned();
    for comment in lines_of(cloud) {
        let _ = writeln!(header, "comment {comment}");
    }
    let _ = writeln!(header, "element vertex {}", cloud.points);
    for column in &columns {
        let _ = writeln!(header, "property {} {}", column.number.name(), column.name);
    }
    header += "end_header\n";
    Ok(with_points(header.into_bytes(), &columns, cloud.points))
}

fn pcd(cloud: &Cloud, mut columns: Vec<Column>, notes: &mut Vec<String>) -> Result<Vec<u8>, EncodeError> {
    rename(&mut columns, "PCD", is_of_word, notes)?;
    widen(&mut columns, "PCD", of_pcd, notes);
    let mut header = "# .PCD v0.7 - Point Cloud Data file format\n".to_owned();
    let mut viewpoint = "VIEWPOINT 0 0 0 1 0 0 0".to_owned();
    for comment in lines_of(cloud) {
        match comment.starts_with("VIEWPOINT ") {
            true => viewpoint = comment,
            false => {
                let _ = writeln!(header, "# {comment}");
            }
        }
    }
    let all = |of: fn(&Column) -> String| columns.iter().map(of).collect::<Vec<_>>().join(" ");
    let _ = write!(
        header,
        "VERSION 0.7\nFIELDS {}\nSIZE {}\nTYPE {}\nCOUNT {}\nWIDTH {points}\nHEIGHT 1\n{viewpoint}\nPOINTS {points}\n\
         DATA binary\n",
        all(|column| column.name.clone()),
        all(|column| column.number.size().to_string()),
        all(|column| column.number.letter().to_ascii_uppercase().to_string()),
        all(|_| "1".to_owned()),
        points = cloud.points,
    );
    Ok(with_points(header.into_bytes(), &columns, cloud.points))
}

fn npy(cloud: &Cloud, mut columns: Vec<Column>, notes: &mut Vec<String>) -> Result<Vec<u8>, EncodeError> {
    // A quote would end the name, and a backslash begin something else.
    let is_taken = |c: char| c == ' ' || c.is_ascii_graphic() && !['\'', '"', '\\'].contains(&c);
    rename(&mut columns, "NPY", is_taken, notes)?;
    if !cloud.comments.is_empty() {
        let comments = counted(cloud.comments.len() as u64, "comment");
        notes.push(format!("an NPY has no comments: {comments} of the header stayed behind"));
    }
    let kind = |column: &Column| {
        let order = if column.number.size() == 1 { '|' } else { '<' };
        format!("('{}', '{order}{}{}')", column.name, column.number.letter(), column.number.size())
    };
    let kinds: Vec<_> = columns.iter().map(kind).collect();
    let header = npy::header(&format!("[{}]", kinds.join(", ")), &[cloud.points])?;
    Ok(with_points(header, &columns, cloud.points))
}

/// A file of a header and the records of all points.
fn with_points(mut file: Vec<u8>, columns: &[Column], points: usize) -> Vec<u8> {
    let stride: usize = columns.iter().map(|column| column.number.size()).sum();
    file.reserve_exact(stride * points);
    for point in 0..points {
        for column in columns {
            column.number.write(column.values[point], &mut file);
        }
    }
    file
}

#[cfg(test)]
mod tests {
    use super::super::recorded::{read_las, read_npy, read_pcd, read_ply};
    use super::*;
    use proptest::prelude::*;

    fn field(name: &str, kind: &'static str, values: &[f64]) -> Field {
        Field { name: name.to_owned(), kind, values: values.to_vec() }
    }

    /// Three points with a field of every type. The coordinates are whole millimetres in binary fractions, and so exact in a LAS of steps
    /// of 1/1024 m.
    fn cloud() -> Cloud {
        let fields = vec![
            field("x", "float", &[0.5, -1.25, 100.75]),
            field("y", "double", &[500_000.5, 500_001.0, 499_999.25]),
            field("z", "float", &[0.0, 1.0 / 1024.0, -2.0]),
            field("intensity", "float", &[0.25, 1.0, f64::from(0.1_f32)]),
            field("classification", "uchar", &[0.0, 6.0, 255.0]),
            field("return_number", "uchar", &[1.0, 2.0, 15.0]),
            field("gps_time", "double", &[1.0 / 3.0, 0.0, 1e9]),
            field("a", "char", &[-128.0, 0.0, 127.0]),
            field("b", "short", &[-32768.0, 0.0, 32767.0]),
            field("c", "ushort", &[0.0, 1.0, 65535.0]),
            field("d", "int", &[-2_147_483_648.0, 0.0, 2_147_483_647.0]),
            field("e", "uint", &[0.0, 1.0, 4_294_967_295.0]),
            field("f", "long", &[-9_007_199_254_740_991.0, 0.0, 9_007_199_254_740_991.0]),
            field("g", "ulong", &[0.0, 1.0, 9_007_199_254_740_991.0]),
            field("h", "half", &[0.5, f64::INFINITY, -65504.0]),
            field("i", "bool", &[0.0, 1.0, 1.0]),
            field("j", "float", &[f64::from(f32::MIN_POSITIVE), f64::NEG_INFINITY, -0.0]),
            field("k", "double", &[f64::MIN_POSITIVE, f64::MAX, -0.0]),
        ];
        let comments = vec!["frame: the world, metres".to_owned(), "instance 4 = \"floor\"".to_owned()];
        Cloud { points: 3, fields, comments }
    }

    fn read(format: CloudFormat, bytes: &[u8]) -> Cloud {
        let memory = u64::MAX;
        match format {
            CloudFormat::Ply => read_ply(bytes, memory),
            CloudFormat::Pcd => read_pcd(bytes, memory),
            CloudFormat::Npy => read_npy(bytes, memory),
            CloudFormat::Las | CloudFormat::Laz => read_las(bytes, memory),
        }
        .unwrap()
    }

    fn bits(values: &[f64]) -> Vec<u64> {
        values.iter().map(|value| value.to_bits()).collect()
    }

    #[test]
    fn every_format_holds_every_value_of_every_type() {
        let cloud = cloud();
        for (format, _) in CloudFormat::ALL {
            let (file, notes) = format.encode(&cloud, 1.0 / 1024.0).unwrap();
            let again = read(format, &file);
            assert_eq!(again.points, cloud.points);
            for field in &cloud.fields {
                let is_las = matches!(format, CloudFormat::Las | CloudFormat::Laz);
                let name =
                    if is_las && field.name == "intensity" { "reflectivity" } else { field.name.as_str() };
                let values = again.field(name).unwrap_or_else(|| panic!("{format:?} has no {name}"));
                // A LAS has no negative zero in coordinates, and the cloud has none there.
                assert_eq!(bits(values), bits(&field.values), "{format:?}: {name}");
            }
            match format {
                CloudFormat::Npy => assert!(again.comments.is_empty()),
                CloudFormat::Pcd => {
                    assert_eq!(again.comments[..2], cloud.comments);
                    assert_eq!(again.comments[2], "VIEWPOINT 0 0 0 1 0 0 0");
                }
                _ => assert_eq!(again.comments, cloud.comments, "{format:?}"),
            }
            let told = notes.join("\n");
            let expected = match format {
                CloudFormat::Ply => "the field \"f\" is double, because PLY has no long",
                CloudFormat::Pcd => "the field \"h\" is float, because PCD has no half",
                CloudFormat::Npy => "an NPY has no comments: 2 comments of the header stayed behind",
                _ => "the field \"intensity\" is the extra dimension \"reflectivity\"",
            };
            assert!(told.contains(expected), "{format:?}: {told}");
        }
        let kinds = |cloud: &Cloud| cloud.fields.iter().map(|field| field.kind).collect::<Vec<_>>();
        let (file, _) = CloudFormat::Npy.encode(&cloud, 1.0).unwrap();
        assert_eq!(kinds(&read(CloudFormat::Npy, &file)), kinds(&cloud));
    }

    #[test]
    fn colours_are_those_of_las_if_they_fit() {
        let mut cloud = cloud();
        for name in ["red", "green", "blue", "nir"] {
            cloud.fields.push(field(name, "uchar", &[1.0, 2.0, 3.0]));
            for format in [CloudFormat::Las, CloudFormat::Laz] {
                let (file, _) = format.encode(&cloud, 1.0 / 1024.0).unwrap();
                let formats = match name {
                    "nir" => 8,
                    "blue" => 7,
                    _ => 6,
                };
                assert_eq!(file[104] & 0x3f, formats);
                let again = read(format, &file);
                let found = again.field(name).or(again.field(&format!("{name}_value"))).unwrap();
                assert_eq!(found, [1.0, 2.0, 3.0]);
            }
        }
    }

    #[test]
    fn the_crs_of_a_las_stays_and_points_without_a_place_do_not() {
        let mut cloud = cloud();
        cloud.comments.push("crs: GEOGCS[\"a\"]".to_owned());
        cloud.fields[0].values[1] = f64::NAN;
        let (file, notes) = CloudFormat::Las.encode(&cloud, 0.001).unwrap();
        let again = read(CloudFormat::Las, &file);
        assert_eq!(again.points, 2);
        assert_eq!(again.field("a").unwrap(), [-128.0, 127.0]);
        assert!(again.comments.contains(&"crs: GEOGCS[\"a\"]".to_owned()), "{:?}", again.comments);
        assert!(
            notes.contains(&"points without a place stayed behind, which a LAS has not: 1 of 3".to_owned()),
            "{notes:?}"
        );
    }

    #[test]
    fn errors_name_the_field() {
        let of = |format: CloudFormat, change: &dyn Fn(&mut Cloud)| {
            let mut cloud = cloud();
            change(&mut cloud);
            format.encode(&cloud, 1e-4).unwrap_err().to_string()
        };
        let wide = |cloud: &mut Cloud| cloud.fields[12].values[1] = 9_007_199_254_740_992.0;
        assert_eq!(
            of(CloudFormat::Npy, &wide),
            "its field \"f\" has the integer 9007199254740992, and only those below 2⁵³ can be converted exactly"
        );
        let same =
            |cloud: &mut Cloud| (cloud.fields[7].name, cloud.fields[8].name) = ("a b".into(), "a_b".into());
        assert_eq!(of(CloudFormat::Pcd, &same), "two of its fields would be called \"a_b\"");
        let flat = |cloud: &mut Cloud| cloud.fields[2].name = "height".into();
        assert_eq!(
            of(CloudFormat::Laz, &flat),
            "it has no field \"z\", and the points of a LAS have x, y and z"
        );
        let far = |cloud: &mut Cloud| cloud.fields[1].values[2] = 5e6;
        assert!(of(CloudFormat::Las, &far).contains("a point lies 4499999 m from the file's offset"));
        let long = |cloud: &mut Cloud| cloud.fields[7].name = "n".repeat(33);
        assert!(of(CloudFormat::Las, &long).contains("a name has 1 to 32 bytes"));
    }

    proptest! {
        /// Whatever a file of others is called and says, what is written is read again.
        #[test]
        fn any_names_and_comments_are_read_again(
            names in proptest::collection::hash_set(".{1,12}", 1..6), comments: Vec<String>, value: f32
        ) {
            let fields = names.iter().map(|name| field(name, "float", &[value.into()])).collect();
            let cloud = Cloud { points: 1, fields, comments };
            for format in [CloudFormat::Ply, CloudFormat::Pcd, CloudFormat::Npy] {
                if let Ok((file, _)) = format.encode(&cloud, 1.0) {
                    let again = read(format, &file);
                    prop_assert_eq!(again.points, 1);
                    prop_assert_eq!(again.fields.len(), cloud.fields.len());
                }
            }
        }
    }
}
