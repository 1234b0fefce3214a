//! Point clouds, and the records of numbers that their files are made of.

use std::collections::BTreeMap;

use serde::de::DeserializeOwned;

use super::error::ReadError;
use super::instances::InstanceNames;
use super::number::Number;
use crate::output::names::words_of_labels;

/// A point cloud.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cloud {
    /// The number of points.
    pub points: usize,
    /// The fields, in the order of the file.
    pub fields: Vec<Field>,
    /// The header's comments, such as `frame: the world, metres`. That of a PCD has its line `VIEWPOINT …` besides.
    pub comments: Vec<String>,
}

/// A field, which holds one number for each point.
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// The name, such as `x` or `label`.
    pub name: String,
    /// The type in PLY's terms: `float`, `int`, …, and `long` and `ulong` for integers of 64 bits, which PLY lacks.
    pub kind: &'static str,
    /// The values, [`Cloud::points`] long. An f64 holds every number of PLY's types exactly; integers of 64 bits are rounded if
    /// they are beyond 2⁵³.
    pub values: Vec<f64>,
}

impl Cloud {
    /// Bytes of memory that the values take.
    pub fn memory(&self) -> u64 {
        (self.points * self.fields.len() * size_of::<f64>()) as u64
    }

    /// The values of a field.
    pub fn field(&self, name: &str) -> Option<&[f64]> {
        self.fields.iter().find(|f| f.name == name).map(|f| f.values.as_slice())
    }
}

impl Cloud {
    /// The names of the instances that the header lists.
    pub fn instances(&self) -> InstanceNames {
        self.listed::<String>("instance ").collect()
    }

    /// The meaning of the labels, in words, if the header tells.
    pub fn labels(&self) -> BTreeMap<u32, String> {
        words_of_labels(&self.listed("label ").collect::<Vec<_>>())
    }

    /// The numbers of a kind that comments name, such as `instance 4 = "floor"`.
    fn listed<T: DeserializeOwned>(&self, kind: &str) -> impl Iterator<Item = (u32, T)> {
        self.comments.iter().filter_map(move |comment| {
            let (number, named) = comment.strip_prefix(kind)?.split_once(" = ")?;
            Some((number.parse().ok()?, serde_json::from_str(named).ok()?))
        })
    }
}

/// Most fields of a point.
pub(super) const MAX_FIELDS: usize = 256;

/// A number in each record of a file.
#[derive(Clone, Debug)]
pub(super) struct Column {
    /// The name of the field. `None` if the number is padding.
    pub name: Option<String>,
    /// The type.
    pub number: Number,
    /// The place in a record, in bytes.
    pub offset: usize,
    /// Whether the first byte is the most significant.
    pub is_big_endian: bool,
}

impl Column {
    fn field(&self, values: Vec<f64>) -> Option<Field> {
        Some(Field { name: self.name.clone()?, kind: self.number.name(), values })
    }
}

/// Refuses clouds without a field, with too many, or whose points would take more than `memory` bytes, and tells the bytes that they
/// take. `points` is no more than what the file can hold.
pub(super) fn check_size(points: usize, columns: &[Column], memory: u64) -> Result<(), ReadError> {
    let fields = columns.iter().filter(|column| column.name.is_some()).count();
    if fields == 0 {
        return Err(ReadError::new("its points have no fields"));
    }
    if columns.len() > MAX_FIELDS {
        return Err(ReadError::new(format!("it has more than {MAX_FIELDS} fields a point")));
    }
    ReadError::check_memory((points as u64).saturating_mul((fields * size_of::<f64>()) as u64), memory)
}

/// The fields of `points` records of `stride` bytes, which begin at the first byte of `body`.
///
/// # Errors
/// [`cut_short`] if there are not as many bytes.
pub(super) fn read_records(
    body: &[u8],
    points: usize,
    stride: usize,
    columns: &[Column],
) -> Result<Vec<Field>, ReadError> {
    let needed = points.checked_mul(stride).filter(|&needed| needed <= body.len());
    let records = &body[..needed.ok_or_else(|| cut_short(points))?];
    let field = |column: &Column| {
        let range = column.offset..column.offset + column.number.size();
        let value = |record: &[u8]| column.number.read(&record[range.clone()], column.is_big_endian);
        column.field(match column.name {
            Some(_) => records.chunks_exact(stride.max(1)).map(value).collect(),
            None => Vec::new(),
        })
    };
    Ok(columns.iter().filter_map(field).collect())
}

/// The fields of `points` records of words, with space between them.
///
/// # Errors
/// [`cut_short`] if there are not as many words, and an error that names the point and the field whose word is no number.
pub(super) fn read_words(body: &[u8], points: usize, columns: &[Column]) -> Result<Vec<Field>, ReadError> {
    let text = std::str::from_utf8(body).map_err(|_| ReadError::new("its points are not text"))?;
    let mut words = text.split_ascii_whitespace();
    let mut values = vec![Vec::new(); columns.len()];
    for point in 0..points {
        for (column, values) in columns.iter().zip(&mut values) {
            let word = words.next().ok_or_else(|| cut_short(points))?;
            let Some(name) = &column.name else { continue };
            let value = word.parse();
            let value: f64 =
                value.map_err(|_| ReadError::new(format!("point {point} has {word:?} for {name:?}")))?;
            values.push(column.number.rounded(value));
        }
    }
    Ok(columns.iter().zip(values).filter_map(|(column, values)| column.field(values)).collect())
}

/// The error of a file that ends before its last point.
pub(super) fn cut_short(points: usize) -> ReadError {
    ReadError::new(format!("it is cut short: its header promises {points} points"))
}
