//! A recorded cloud as a LAS or a LAZ: fields that LAS names are those of its records, and all others are extra dimensions.

use std::borrow::Cow;

use glam::DVec3;

use super::chunks::Chunks;
use super::header::{Contents, Dimension, Number};
use crate::output::cloud_columns::{Column, lines_of, of_pcd};
use crate::output::format::EncodeError;
use crate::output::recorded::{self, Cloud, WKT};
use crate::source::words::counted;

/// The place of a value in a record.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Place {
    /// Bits of a byte: its place, the lowest bit, and how many.
    Bits(usize, u8, u8),
    /// A number at a place.
    At(usize, recorded::Number),
}

impl Place {
    /// Whether the place holds a value exactly.
    fn holds(self, value: f64) -> bool {
        let (least, most) = match self {
            Self::Bits(_, _, count) => (0.0, f64::from((1_u32 << count) - 1)),
            Self::At(_, recorded::Number::I16) => (f64::from(i16::MIN), f64::from(i16::MAX)),
            Self::At(_, recorded::Number::U16) => (0.0, f64::from(u16::MAX)),
            Self::At(_, recorded::Number::U8) => (0.0, f64::from(u8::MAX)),
            Self::At(..) => return true,
        };
        // A negative zero would lose its sign.
        value >= least && value <= most && value.fract() == 0.0 && !(value == 0.0 && value.is_sign_negative())
    }
}

/// The fields of a record of format 6 after the coordinates, by the names that they have when they are read.
const FIELDS: [(&str, Place); 15] = {
    use Place::{At, Bits};
    use recorded::Number::{F64, I16, U8, U16};
    [
        ("intensity", At(12, U16)),
        ("return_number", Bits(14, 0, 4)),
        ("number_of_returns", Bits(14, 4, 4)),
        ("synthetic", Bits(15, 0, 1)),
        ("key_point", Bits(15, 1, 1)),
        ("withheld", Bits(15, 2, 1)),
        ("overlap", Bits(15, 3, 1)),
        ("scanner_channel", Bits(15, 4, 2)),
        ("scan_direction_flag", Bits(15, 6, 1)),
        ("edge_of_flight_line", Bits(15, 7, 1)),
        ("classification", At(16, U8)),
        ("user_data", At(17, U8)),
        ("scan_angle", At(18, I16)),
        ("point_source_id", At(20, U16)),
        ("gps_time", At(22, F64)),
    ]
};
/// The fields that the formats 7 and 8 add.
const COLOURS: [(&str, Place); 4] = {
    use Place::At;
    use recorded::Number::U16;
    [("red", At(30, U16)), ("green", At(32, U16)), ("blue", At(34, U16)), ("nir", At(36, U16))]
};
const RETURNS: [usize; 2] = [1, 2];
/// The bytes of the formats 6, 7 and 8.
const BYTES_OF_FORMATS: [usize; 3] = [30, 36, 38];

/// The most bytes of a name, and of a record of variable length.
const MOST_NAME_BYTES: usize = 32;
const MOST_RECORD_BYTES: usize = 65535;

/// The file of a cloud, whose coordinates are steps of `step_m` metres from a place near the first point, in whole metres. All other
/// values are exact: a field whose values don't fit into the one of LAS with its name is an extra dimension. Points without a
/// place are left out.
///
/// # Errors
/// An [`EncodeError`] if there are no coordinates, if a point is too far from the first one, or if a name is too long.
pub(in crate::output) fn of_cloud(
    cloud: &Cloud,
    columns: &[Column],
    step_m: f64,
    is_compressed: bool,
    notes: &mut Vec<String>,
) -> Result<Vec<u8>, EncodeError> {
    let axis = |name: &str| {
        let column = columns.iter().find(|column| column.name == name);
        column.map(|column| column.values).ok_or_else(|| {
            EncodeError::new(format!("it has no field {name:?}, and the points of a LAS have x, y and z"))
        })
    };
    let positions = [axis("x")?, axis("y")?, axis("z")?];
    let position = |point: usize| DVec3::from_array(positions.map(|values| values[point]));
    let layout = Layout::of(columns, notes)?;
    let mut contents = Contents::of(layout.dimensions(), layout.record_bytes);
    contents.format = layout.format;
    contents.scale_m = step_m;
    let first = (0..cloud.points).map(position).find(|position| position.is_finite());
    // Whole metres, so that the coordinates of all readers are the same to the last bit.
    contents.offset_m = first.unwrap_or_default().round() + DVec3::ZERO;
    add_comments(cloud, &mut contents, notes);
    let mut chunks = is_compressed.then(|| Chunks::new(layout.format, layout.extra_bytes()));
    let mut records = Vec::new();
    let mut left_out = 0_u64;
    for point in 0..cloud.points {
        let position = position(point);
        if !position.is_finite() {
            left_out += 1;
            continue;
        }
        let steps = contents.steps_of(position)?;
        contents.count(steps, layout.return_number(point));
        records.extend_from_slice(steps.map(i32::to_le_bytes).as_flattened());
        layout.add(point, &mut records);
    }
    if left_out > 0 {
        notes.push(format!(
            "points without a place stayed behind, which a LAS has not: {left_out} of {}",
            cloud.points
        ));
    }
    notes.push(format!("x, y and z are rounded to steps of {step_m} m"));
    let mut file = contents.head(chunks.as_ref());
    match &mut chunks {
        Some(chunks) => chunks.finish(&mut records, &mut file)?,
        None => file.extend_from_slice(&records),
    }
    let head = contents.head(chunks.as_ref());
    file[..head.len()].copy_from_slice(&head);
    Ok(file)
}

/// The comments as records of variable length: the coordinate reference system, and all others.
fn add_comments(cloud: &Cloud, contents: &mut Contents, notes: &mut Vec<String>) {
    let (mut kept, mut left_out) = (String::new(), 0);
    for line in lines_of(cloud) {
        match line.strip_prefix(WKT) {
            Some(wkt) if wkt.len() < MOST_RECORD_BYTES => contents.crs = Some(Cow::Owned(wkt.to_owned())),
            _ if kept.len() + line.len() < MOST_RECORD_BYTES => {
                kept += &line;
                kept.push('\n');
            }
            _ => left_out += 1,
        }
    }
    if left_out > 0 {
        let comments = counted(left_out, "comment");
        notes.push(format!("a record of a LAS has at most 65535 bytes: {comments} stayed behind"));
    }
    contents.comments = (!kept.is_empty()).then_some(kept);
}

/// The fields of a record.
struct Layout<'c> {
    /// The format of the records: 6, or 7 with colours, or 8 with near infrared besides.
    format: u8,
    own: Vec<(Place, &'c [f64])>,
    extra: Vec<(String, Number, recorded::Number, &'c [f64])>,
    record_bytes: usize,
    /// The numbers of returns, if the cloud has them where LAS has them.
    return_numbers: Option<&'c [f64]>,
    /// Whether LAS's fields of returns are free, and so say that each point is the only return.
    has_no_returns: bool,
}

impl<'c> Layout<'c> {
    fn of(columns: &[Column<'c>], notes: &mut Vec<String>) -> Result<Self, EncodeError> {
        let fitting = |(name, place): (&str, Place)| {
            let column = columns.iter().find(|column| column.name == name)?;
            column.values.iter().all(|value| place.holds(*value)).then_some((place, column.values))
        };
        let has_all = |names: &[(&str, Place)]| names.iter().all(|field| fitting(*field).is_some());
        let colours = match () {
            () if has_all(&COLOURS) => COLOURS.len(),
            () if has_all(&COLOURS[..3]) => 3,
            () => 0,
        };
        let format = 6 + colours.saturating_sub(2) as u8;
        let known: Vec<(&str, Place)> = FIELDS.iter().chain(&COLOURS[..colours]).copied().collect();
        let is_own = |name: &str| known.iter().any(|field| field.0 == name && fitting(*field).is_some());
        let mut extra: Vec<(String, Number, recorded::Number, &'c [f64])> = Vec::new();
        for column in columns.iter().filter(|column| !["x", "y", "z"].contains(&column.name.as_str())) {
            if is_own(&column.name) {
                continue;
            }
            let mut name = column.name.clone();
            if FIELDS.iter().chain(&COLOURS).any(|(known, _)| *known == name) {
                let is_free = |name: &str| columns.iter().all(|column| column.name != name);
                name = match name.as_str() {
                    // As in LAS of this program.
                    "intensity" if is_free("reflectivity") => "reflectivity".to_owned(),
                    _ => format!("{name}_value"),
                };
                notes.push(format!(
                    "the field {:?} is the extra dimension {name:?}, because LAS's own can't hold its values",
                    column.name
                ));
            }
            if name.len() > MOST_NAME_BYTES || name.contains('\0') || name.is_empty() {
                return Err(EncodeError::new(format!(
                    "an extra dimension can't be called {name:?}: a name has 1 to {MOST_NAME_BYTES} bytes"
                )));
            }
            if extra.iter().any(|(other, ..)| *other == name) {
                return Err(EncodeError::new(format!("two of its fields would be called {name:?}")));
            }
            let number = of_pcd(column.number);
            extra.push((name, las_number(number), number, column.values));
        }
        let extra_bytes: usize = extra.iter().map(|(_, number, ..)| number.bytes()).sum();
        let return_numbers = fitting(FIELDS[RETURNS[0]]).map(|(_, values)| values);
        Ok(Self {
            format,
            own: known.iter().filter_map(|field| fitting(*field)).collect(),
            extra,
            record_bytes: BYTES_OF_FORMATS[usize::from(format - 6)] + extra_bytes,
            return_numbers,
            has_no_returns: RETURNS.iter().all(|index| fitting(FIELDS[*index]).is_none()),
        })
    }

    fn extra_bytes(&self) -> usize {
        self.record_bytes - BYTES_OF_FORMATS[usize::from(self.format - 6)]
    }

    fn dimensions(&self) -> Vec<Dimension> {
        let dimension = |(name, kind, ..): &(String, Number, recorded::Number, &[f64])| Dimension {
            name: Cow::Owned(name.clone()),
            kind: *kind,
            about: "",
        };
        self.extra.iter().map(dimension).collect()
    }

    /// The number of a point's return, or 0 if its file has a 0 there.
    fn return_number(&self, point: usize) -> u8 {
        match self.return_numbers {
            Some(numbers) => numbers[point] as u8,
            None => u8::from(self.has_no_returns),
        }
    }

    /// Appends what follows the coordinates in the record of a point.
    fn add(&self, point: usize, records: &mut Vec<u8>) {
        const COORDINATES: usize = 12;
        let start = records.len() - COORDINATES;
        records.resize(start + BYTES_OF_FORMATS[usize::from(self.format - 6)], 0);
        let record = &mut records[start..];
        if self.has_no_returns {
            record[14] = 0x11;
        }
        let mut bytes = Vec::with_capacity(8);
        for (place, values) in &self.own {
            match *place {
                Place::Bits(at, lowest, _) => record[at] |= (values[point] as u8) << lowest,
                Place::At(at, number) => {
                    bytes.clear();
                    number.write(values[point], &mut bytes);
                    record[at..at + bytes.len()].copy_from_slice(&bytes);
                }
            }
        }
        for (.., number, values) in &self.extra {
            number.write(values[point], records);
        }
    }
}

/// The type of an extra dimension that holds numbers of a type that PCD has, too.
fn las_number(number: recorded::Number) -> Number {
    match number {
        recorded::Number::I8 => Number::I8,
        recorded::Number::I16 => Number::I16,
        recorded::Number::U16 => Number::U16,
        recorded::Number::I32 => Number::I32,
        recorded::Number::U32 => Number::U32,
        recorded::Number::I64 => Number::I64,
        recorded::Number::U64 => Number::U64,
        recorded::Number::F16 | recorded::Number::F32 => Number::F32,
        recorded::Number::F64 => Number::F64,
        recorded::Number::Bool | recorded::Number::U8 => Number::U8,
    }
}
