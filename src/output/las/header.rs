//! The header of a LAS 1.4, its records of variable length, and what they tell of the points.
//!
//! The layout is that of the tables of "LAS Specification 1.4 – R15" (ASPRS, 2019); a comment names each field. Dates and the GUID
//! are 0, because the same frame gives the same bytes always.

use std::borrow::Cow;

use glam::DVec3;

use super::super::format::EncodeError;
use super::super::points::rounded;
use super::chunks::Chunks;

/// The length of the header.
const HEADER_BYTES: usize = 375;
/// The bit of the points' format that says that they are compressed.
const COMPRESSED: u8 = 0x80;
/// The bit of the global encoding by which a coordinate reference system is WKT, which format 6 demands. The bit of the kind of GPS
/// time is not set: the times are not those of GPS, and seconds of a week come nearest.
const WKT: u16 = 1 << 4;

/// An extra dimension of the points.
#[derive(Clone, Debug)]
pub(super) struct Dimension {
    /// The name, of at most 32 bytes.
    pub name: Cow<'static, str>,
    /// The type.
    pub kind: Number,
    /// The meaning, in at most 32 bytes.
    pub about: &'static str,
}

/// The types of extra dimensions, with their numbers in LAS.
#[derive(Clone, Copy, Debug)]
pub(super) enum Number {
    /// `unsigned char`.
    U8 = 1,
    /// `char`.
    I8 = 2,
    /// `unsigned short`.
    U16 = 3,
    /// `short`.
    I16 = 4,
    /// `unsigned long`.
    U32 = 5,
    /// `long`.
    I32 = 6,
    /// `unsigned long long`.
    U64 = 7,
    /// `long long`.
    I64 = 8,
    /// `float`.
    F32 = 9,
    /// `double`.
    F64 = 10,
}

impl Number {
    /// The bytes of a value.
    pub fn bytes(self) -> usize {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
        }
    }
}

/// The header's facts about the points. The length of the header does not depend on the numbers that are counted.
pub(super) struct Contents {
    /// The format of the points, from 6 to 8.
    pub format: u8,
    /// The extra dimensions, in the order of their bytes in a record.
    pub dimensions: Vec<Dimension>,
    /// The bytes of a point.
    pub record_bytes: usize,
    /// The metres of a step of a coordinate.
    pub scale_m: f64,
    /// The position of the steps (0, 0, 0) in metres.
    pub offset_m: DVec3,
    /// The coordinate reference system in WKT.
    pub crs: Option<Cow<'static, str>>,
    /// The pose of the points as JSON, which files of one frame have.
    pub pose: Option<String>,
    /// The comments of a cloud that was converted, a line each.
    pub comments: Option<String>,
    points: u64,
    by_return: [u64; 15],
    least: [i32; 3],
    most: [i32; 3],
}

impl Contents {
    /// No points of format 6 yet, of so many bytes each, in metres, at the origin.
    pub fn of(dimensions: Vec<Dimension>, record_bytes: usize) -> Self {
        Self {
            format: 6,
            dimensions,
            record_bytes,
            scale_m: 1.0,
            offset_m: DVec3::ZERO,
            crs: None,
            pose: None,
            comments: None,
            points: 0,
            by_return: [0; 15],
            least: [i32::MAX; 3],
            most: [i32::MIN; 3],
        }
    }

    /// The coordinates of a point as steps from the offset, each rounded once.
    ///
    /// # Errors
    /// An error that says which scale would fit if the point is too far from the offset.
    pub fn steps_of(&self, position_m: DVec3) -> Result<[i32; 3], EncodeError> {
        let steps = ((position_m - self.offset_m) / self.scale_m).to_array().map(rounded);
        if let [Some(x), Some(y), Some(z)] = steps {
            return Ok([x, y, z]);
        }
        let far_m = (position_m - self.offset_m).abs().max_element();
        let digits = libm::ceil(libm::log10(far_m / f64::from(i32::MAX)));
        Err(EncodeError::new(format!(
            "a point lies {far_m:.0} m from the file's offset, and steps of {} m reach {:.0} m: `scale = {}` reaches it",
            self.scale_m,
            f64::from(i32::MAX) * self.scale_m,
            libm::exp10(digits),
        )))
    }

    /// Counts a point, whose return has a number from 1 to 15, or 0 if it has none.
    pub fn count(&mut self, steps: [i32; 3], return_number: u8) {
        self.points += 1;
        if let Some(count) = self.by_return.get_mut(usize::from(return_number.wrapping_sub(1))) {
            *count += 1;
        }
        for (axis, step) in steps.into_iter().enumerate() {
            self.least[axis] = self.least[axis].min(step);
            self.most[axis] = self.most[axis].max(step);
        }
    }

    /// The bytes before the points: the header and the records of variable length, and before compressed points the place of
    /// their table.
    pub fn head(&self, chunks: Option<&Chunks>) -> Vec<u8> {
        let records = self.records(chunks);
        let before_points = HEADER_BYTES + records.iter().map(Vec::len).sum::<usize>();
        let mut head = self.header(records.len() as u32, before_points as u32, chunks.is_some());
        debug_assert_eq!(head.len(), HEADER_BYTES);
        head.extend(records.concat());
        if let Some(chunks) = chunks {
            head.extend_from_slice(&chunks.table_after(before_points as u64).to_le_bytes());
        }
        head
    }

    fn header(&self, records: u32, before_points: u32, is_compressed: bool) -> Vec<u8> {
        let format = if is_compressed { self.format | COMPRESSED } else { self.format };
        let mut header = Vec::with_capacity(HEADER_BYTES);
        let mut add = |bytes: &[u8]| header.extend_from_slice(bytes);
        add(b"LASF");
        add(&[0; 2]); // the number of the file's source
        add(&WKT.to_le_bytes());
        add(&[0; 16]); // the project's GUID
        add(&[1, 4]); // the version
        add(&padded::<32>("OTHER")); // the system: none of those that the specification names
        add(&padded::<32>("beamcast"));
        add(&[0; 4]); // the day and the year of the file
        add(&(HEADER_BYTES as u16).to_le_bytes());
        add(&before_points.to_le_bytes());
        add(&records.to_le_bytes());
        add(&[format]);
        add(&(self.record_bytes as u16).to_le_bytes());
        add(&[0; 4 + 5 * 4]); // the counts of formats before 6
        add([self.scale_m; 3].map(f64::to_le_bytes).as_flattened());
        add(self.offset_m.to_array().map(f64::to_le_bytes).as_flattened());
        add(self.bounds_m().map(f64::to_le_bytes).as_flattened());
        add(&[0; 8 + 8 + 4]); // waveforms, and records after the points
        add(&self.points.to_le_bytes());
        add(self.by_return.map(u64::to_le_bytes).as_flattened());
        header
    }

    /// The largest and the least coordinate of each axis, as a reader computes them of the steps. All are 0 if there are no points.
    fn bounds_m(&self) -> [f64; 6] {
        let offset_m = self.offset_m.to_array();
        std::array::from_fn(|index| {
            let (axis, step) = match (self.points, index % 2) {
                (0, _) => return 0.0,
                (_, 0) => (index / 2, self.most[index / 2]),
                _ => (index / 2, self.least[index / 2]),
            };
            f64::from(step) * self.scale_m + offset_m[axis]
        })
    }

    /// The records of variable length.
    fn records(&self, chunks: Option<&Chunks>) -> Vec<Vec<u8>> {
        let mut records = Vec::new();
        if let Some(chunks) = chunks {
            let (user, number) = Chunks::RECORD;
            records.push(record(user, number, "", &chunks.description()));
        }
        if let Some(crs) = &self.crs {
            records.push(record("LASF_Projection", 2112, "WKT", &[crs.as_bytes(), &[0]].concat()));
        }
        let described: Vec<u8> = self.dimensions.iter().flat_map(describe).collect();
        records.push(record("LASF_Spec", 4, "extra dimensions", &described));
        if let Some(pose) = &self.pose {
            records.push(record("beamcast", 1, "pose of the points, JSON", pose.as_bytes()));
        }
        if let Some(comments) = &self.comments {
            records.push(record("beamcast", 2, "comments, UTF-8", comments.as_bytes()));
        }
        records
    }
}

/// A text in a field of `N` bytes, filled with 0. It is cut to what fits.
fn padded<const N: usize>(text: &str) -> [u8; N] {
    let mut field = [0; N];
    let length = text.len().min(N);
    field[..length].copy_from_slice(&text.as_bytes()[..length]);
    field
}

/// A record of variable length, of at most 65535 bytes.
fn record(user: &str, number: u16, about: &str, content: &[u8]) -> Vec<u8> {
    let mut record = vec![0; 2];
    record.extend_from_slice(&padded::<16>(user));
    record.extend_from_slice(&number.to_le_bytes());
    record.extend_from_slice(&(content.len() as u16).to_le_bytes());
    record.extend_from_slice(&padded::<32>(about));
    record.extend_from_slice(content);
    record
}

/// An extra dimension as 192 bytes: its type and its texts. Its limits, its scale and its value for nothing are not told.
fn describe(dimension: &Dimension) -> [u8; 192] {
    let mut described = [0; 192];
    described[2] = dimension.kind as u8;
    described[4..36].copy_from_slice(&padded::<32>(&dimension.name));
    described[160..].copy_from_slice(&padded::<32>(dimension.about));
    described
}

#[cfg(test)]
mod tests {
    use super::*;

    fn contents() -> Contents {
        let dimension = Dimension { name: "ring".into(), kind: Number::U16, about: "beam" };
        Contents { scale_m: 1e-4, offset_m: DVec3::new(5e5, 5.4e6, 0.0), ..Contents::of(vec![dimension], 32) }
    }

    #[test]
    fn a_point_that_is_too_far_is_told_with_a_scale_that_reaches_it() {
        let contents = contents();
        let reach_m = f64::from(i32::MAX) * 1e-4;
        let at = |x_m: f64| contents.steps_of(contents.offset_m + DVec3::new(x_m, 0.0, -1.23456));
        assert_eq!(at(reach_m - 1.0).unwrap(), [i32::MAX - 10_000, 0, -12_346]);
        for far_m in [reach_m + 1.0, -reach_m - 1.0, 2e6] {
            let problem = at(far_m).unwrap_err().to_string();
            assert!(problem.contains("reach 214748 m: `scale = 0.001` reaches it"), "{problem}");
        }
        assert!(at(2.2e6).unwrap_err().to_string().contains("`scale = 0.01`"));
    }

    /// Counts do not move the points, and bounds are those that a reader computes.
    #[test]
    fn the_head_has_the_same_length_before_and_after() {
        let mut contents = contents();
        let before = contents.head(None);
        for (steps, number) in [([10, -20, 30], 1), ([-5, 0, 7], 2), ([3, 3, 3], 15)] {
            contents.count(steps, number);
        }
        let head = contents.head(None);
        assert_eq!((before.len(), head.len()), (375 + 54 + 192, 375 + 54 + 192));
        let f64_at = |at: usize| f64::from_le_bytes(head[at..at + 8].try_into().unwrap());
        let u64_at = |at: usize| u64::from_le_bytes(head[at..at + 8].try_into().unwrap());
        // The largest and the least x, y and z.
        let expected = [
            5e5 + 10.0 * 1e-4,
            5e5 - 5.0 * 1e-4,
            5.4e6 + 3.0 * 1e-4,
            5.4e6 - 20.0 * 1e-4,
            30.0 * 1e-4,
            3.0 * 1e-4,
        ];
        assert_eq!(std::array::from_fn(|index| f64_at(179 + 8 * index)), expected);
        assert_eq!([247, 255, 263, 255 + 14 * 8].map(u64_at), [3, 1, 1, 1]);
        assert_eq!(before[179..227], [0; 48]);
    }
}
