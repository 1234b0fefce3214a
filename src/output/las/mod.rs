//! Encoding of point clouds as LAS 1.4 and LAZ, the formats of airborne and mobile mapping, with points of the record format 6.
//!
//! ```text
//! mod       the declarations, and the points of frames as records
//! header    the header with its records of variable length (ASPRS, "LAS Specification 1.4 – R15", 2019)
//! chunks    the compression of LAZ; extra_bytes: that of the extra dimensions
//! of_cloud  recorded clouds as such files
//! ```
//!
//! A file is the same whether its frames come one by one, as in a run, or alone: the points are written as they come, and the
//! header, which counts them, when the last one is there.

mod chunks;
mod extra_bytes;
mod header;
mod of_cloud;

use std::borrow::Cow;
use std::io::Write;

use glam::DVec3;
use serde_json::json;

use self::chunks::Chunks;
use self::header::{Contents, Dimension, Number};
pub(super) use self::of_cloud::of_cloud;
use super::crs::{CRS, check_crs, crs_of};
use super::format::{Content, EncodeError, Field, FormatSpec, Kind, Stream, field};
use super::id::id_of;
use super::options::{OptionSpec, OptionValues, Options};
use super::points::{MOTION, Point, TERMS, more_bytes, more_fields};
use super::sensor_frame::{SensorFrame, pose_as_json};
use crate::sensor::Sensor;

/// The fields in their order. A kind is the type of LAS.
static FIELDS: [Field; 16] = [
    field("X, Y, Z", "long", "m, by `scale` and the offset in the header"),
    field(
        "intensity",
        "unsigned short",
        "65535 is the top of the sensor's scale, or white where the scale has no top",
    ),
    field("return_number", "4 bits", "from 1; 15 for all above"),
    field("number_of_returns", "4 bits", "15 for more"),
    field("classification", "unsigned char", "the label; 0 for labels above 255"),
    field("scan_angle", "short", "0: not told"),
    field("point_source_id", "unsigned short", "the sensor's number in the job, from 1"),
    field("gps_time", "double", "s: the pulse's own time, with the same zero as the job's sequence"),
    field("ring", "unsigned short", "extra dimension: from 0"),
    field("column", "unsigned long", "extra dimension: from 0"),
    field("instance", "unsigned long", "extra dimension: from 1; 0 is nothing"),
    field("label", "unsigned long", "extra dimension: 0 is none"),
    field("range", "float", "extra dimension: m"),
    field("time", "float", "extra dimension: s from the frame's start"),
    field(
        "reflectivity",
        "float",
        "extra dimension of files of sensors whose intensity has no top: the intensity itself",
    ),
    field("frame", "unsigned long", "extra dimension of files of a run: the frame's number, from 0"),
];

/// The bytes of a record of format 6, before the extra dimensions.
const BYTES_OF_FORMAT_6: usize = 30;

/// The extra dimensions that all points have.
const DIMENSIONS: [Dimension; 6] = [
    Dimension { name: Cow::Borrowed("ring"), kind: Number::U16, about: "beam, from 0" },
    Dimension { name: Cow::Borrowed("column"), kind: Number::U32, about: "column, from 0" },
    Dimension { name: Cow::Borrowed("instance"), kind: Number::U32, about: "object, from 1" },
    Dimension { name: Cow::Borrowed("label"), kind: Number::U32, about: "semantic label" },
    Dimension { name: Cow::Borrowed("range"), kind: Number::F32, about: "range in metres" },
    Dimension { name: Cow::Borrowed("time"), kind: Number::F32, about: "s from the frame's start" },
];
const REFLECTIVITY: Dimension =
    Dimension { name: Cow::Borrowed("reflectivity"), kind: Number::F32, about: "intensity as it is" };
const FRAME: Dimension =
    Dimension { name: Cow::Borrowed("frame"), kind: Number::U32, about: "number of the frame" };

/// The option of a LAS that says the steps of its coordinates.
pub const SCALE: OptionSpec = OptionSpec {
    name: "scale",
    about: "The metres of a step of the coordinates, which are integers of 32 bits. A file of a frame or a run has one offset, whole \
            metres near the sensor, so that 0.0001 reaches 214 km from there.",
    values: OptionValues::Number { least: 1e-6, most: 1.0, default: 1e-4 },
};

const PER: OptionSpec = OptionSpec {
    name: "per",
    about: "Whether each frame has a file, or the run has one, run.las or run.laz, with the points of all frames of all sensors. \
            A cloud of a run makes sense in the world, `output.frame = \"world\"`.",
    values: OptionValues::Word { words: &["frame", "run"], default: "frame" },
};

/// The points of a frame, row by row of the range image. The returns of a pixel follow each other, and misses are left out.
pub(super) static LAS: FormatSpec = FormatSpec {
    name: "las",
    ending: "las",
    about: "LAS 1.4 point clouds",
    read_by: "laspy",
    kind: Kind::Chosen(|options| match is_of_run(options) {
        true => Kind::Stream(|sensors, options| Box::new(Cloud::new(sensors, options, false))),
        false => Kind::File(|frame, options| encode(frame, options, false)),
    }),
    ..COMMON
};

/// The same points, compressed without loss.
pub(super) static LAZ: FormatSpec = FormatSpec {
    name: "laz",
    ending: "laz",
    about: "compressed LAS 1.4 point clouds",
    read_by: "laspy with lazrs",
    kind: Kind::Chosen(|options| match is_of_run(options) {
        true => Kind::Stream(|sensors, options| Box::new(Cloud::new(sensors, options, true))),
        false => Kind::File(|frame, options| encode(frame, options, true)),
    }),
    ..COMMON
};

/// The properties that both formats have.
const COMMON: FormatSpec = FormatSpec {
    content: Content::Points(&FIELDS),
    options: &[SCALE, PER, CRS, MOTION, TERMS],
    check_options: check_crs,
    check: |sensor, _| check(sensor),
    // The records, and the file that they, or what they are compressed to, are added to.
    encoding_bytes_a_ray: |sensor, options| 2 * bytes_a_ray(sensor, options),
    file_bytes_a_ray: bytes_a_ray,
    has_even_steps: true,
    merges_clouds: true,
    ..FormatSpec::PLAIN
};

fn is_of_run(options: &Options) -> bool {
    options.text(&PER) == "run"
}

fn bytes_a_ray(sensor: &Sensor, options: &Options) -> u64 {
    let own: u64 = dimensions(&[sensor], options).iter().map(|dimension| dimension.kind.bytes() as u64).sum();
    (BYTES_OF_FORMAT_6 as u64 + own) * sensor.most_returns() as u64
}

fn check(sensor: &Sensor) -> Result<(), EncodeError> {
    let rings = (0..sensor.pattern.rows()).map(|row| sensor.ring(row)).max().unwrap_or(0);
    match u16::try_from(rings) {
        Ok(_) => Ok(()),
        Err(_) => {
            Err(EncodeError::new(format!("a LAS's ring is at most {}, and can't hold {rings}", u16::MAX)))
        }
    }
}

/// The value of a sensor's intensities that becomes the largest of LAS, and whether they end there. LAS wants the whole range of
/// the sensor to be that of the field.
fn top_of_intensity(sensor: &Sensor) -> (f64, bool) {
    match &sensor.measurement.receiver {
        Some(receiver) if receiver.intensity.top().is_finite() => (receiver.intensity.top(), true),
        Some(receiver) => (receiver.intensity.white(), false),
        None => (1.0, sensor.measurement.is_ideal()),
    }
}

/// The extra dimensions of a file with points of these sensors. A sensor that lacks one has 0 there.
fn dimensions(sensors: &[&Sensor], options: &Options) -> Vec<Dimension> {
    let mut all = DIMENSIONS.to_vec();
    if sensors.iter().any(|sensor| !top_of_intensity(sensor).1) {
        all.push(REFLECTIVITY);
    }
    if is_of_run(options) {
        all.push(FRAME);
    }
    // The fields of an ideal sensor are the last ones of a sensor that is not.
    let most = sensors.iter().map(|sensor| more_fields(sensor, options)).max_by_key(Vec::len);
    let kind = |is_integer| if is_integer { Number::U32 } else { Number::F32 };
    let more = most.unwrap_or_default().into_iter();
    all.extend(more.map(|(name, is_integer)| Dimension {
        name: Cow::Borrowed(name),
        kind: kind(is_integer),
        about: "",
    }));
    all
}

fn encode(frame: &SensorFrame, options: &Options, is_compressed: bool) -> Result<Vec<u8>, EncodeError> {
    let mut cloud = Cloud::new(&[frame.capture.sensor], options, is_compressed);
    cloud.contents.pose = Some(pose_of(frame));
    let mut file = Vec::new();
    cloud.add(frame, &mut file)?;
    cloud.finish(&mut file)?;
    let head = cloud.head();
    file[..head.len()].copy_from_slice(&head);
    Ok(file)
}

/// What readers need to carry the points of a frame into the world, which LAS has no field for.
fn pose_of(frame: &SensorFrame) -> String {
    let mut about = json!({
        "sensor": frame.name,
        "frame": frame.capture.frame,
        "start_s": frame.capture.start_s,
        "points": frame.cloud_frame_in_words(),
        "world_from_points": pose_as_json(&frame.world_from_points()),
    });
    if let Some(compensation) = frame.compensation() {
        about["cloud_time"] = compensation.into();
    }
    about.to_string()
}

/// A file that grows frame by frame.
struct Cloud {
    options: Options,
    contents: Contents,
    /// The compression. `None` writes the records as they are.
    chunks: Option<Chunks>,
    /// The records of points that are not written yet.
    records: Vec<u8>,
    has_begun: bool,
}

impl Cloud {
    fn new(sensors: &[&Sensor], options: &Options, is_compressed: bool) -> Self {
        let dimensions = dimensions(sensors, options);
        let extra_bytes = dimensions.iter().map(|dimension| dimension.kind.bytes()).sum();
        let mut contents = Contents::of(dimensions, BYTES_OF_FORMAT_6 + extra_bytes);
        (contents.scale_m, contents.crs) = (options.number(&SCALE), crs_of(options).map(Cow::Borrowed));
        let chunks = is_compressed.then(|| Chunks::new(contents.format, extra_bytes));
        Self { options: *options, contents, chunks, records: Vec::new(), has_begun: false }
    }

    /// Leaves room for the head, whose length no frame changes.
    fn begin(&mut self, file: &mut dyn Write) -> Result<(), EncodeError> {
        self.has_begun = true;
        Ok(file.write_all(&self.head())?)
    }

    /// Writes the records of a frame's points, but for those of a chunk that is not whole.
    fn add_records(&mut self, frame: &SensorFrame, file: &mut dyn Write) -> Result<(), EncodeError> {
        /// So many records stay near a core until they are written; of a file that is compressed they are enough for a
        /// few chunks beside each other.
        const RECORDS: usize = 1 << 14;
        const RECORDS_OF_CHUNKS: usize = 1 << 19;
        let Self { options, contents, records, chunks, .. } = self;
        let of_frame = OfFrame::of(frame, contents)?;
        let (record_bytes, own) = (contents.record_bytes, more_bytes(frame.capture.sensor, options) as usize);
        let most = record_bytes * if chunks.is_some() { RECORDS_OF_CHUNKS } else { RECORDS };
        records.reserve(most.min(frame.frame.return_count() * record_bytes + records.len()));
        let mut write = |records: &mut Vec<u8>| match chunks {
            Some(chunks) => chunks.write_whole(records, file),
            None => {
                file.write_all(records)?;
                records.clear();
                Ok(())
            }
        };
        frame.each_point(|point| {
            if records.len() >= most {
                write(records)?;
            }
            let end = records.len() + record_bytes;
            let steps = contents.steps_of(point.exact_m)?;
            contents.count(steps, return_number(point.number + 1));
            of_frame.add(steps, point, records)?;
            // The dimensions of other sensors are 0, and come before those that the sensor has.
            records.resize(end - own, 0);
            if own > 0 {
                frame.add_more(point, options, records);
            }
            Ok(())
        })?;
        write(records)
    }
}

impl Stream for Cloud {
    fn add(&mut self, frame: &SensorFrame, file: &mut dyn Write) -> Result<(), EncodeError> {
        if !self.has_begun {
            // Whole metres, so that the coordinates of all readers are the same to the last bit.
            self.contents.offset_m = frame.cloud_from_sensor(0.0).translation.round() + DVec3::ZERO;
            self.begin(file)?;
        }
        self.add_records(frame, file)
    }

    fn finish(&mut self, file: &mut dyn Write) -> Result<(), EncodeError> {
        if !self.has_begun {
            self.begin(file)?;
        }
        match &mut self.chunks {
            Some(chunks) => chunks.finish(&mut self.records, file),
            None => Ok(()),
        }
    }

    fn head(&self) -> Vec<u8> {
        self.contents.head(self.chunks.as_ref())
    }
}

/// The number of a return in the 4 bits of a record.
fn return_number(number: usize) -> u8 {
    number.min(15) as u8
}

/// The facts of a frame that its records share.
struct OfFrame {
    start_s: f64,
    /// The number of the sensor, from 1.
    source: u16,
    /// The steps of a record's intensity in 1 of the sensor's.
    steps_of_intensity: f64,
    has_reflectivity: bool,
    /// The frame's number, where records tell it.
    frame: Option<u32>,
}

impl OfFrame {
    fn of(frame: &SensorFrame, contents: &Contents) -> Result<Self, EncodeError> {
        let capture = &frame.capture;
        let has = |wanted: Dimension| contents.dimensions.iter().any(|d| d.name == wanted.name);
        let number = u32::try_from(capture.frame)
            .map_err(|_| EncodeError::new(format!("a LAS's frame can't hold {}", capture.frame)))?;
        Ok(Self {
            start_s: capture.start_s,
            source: u16::try_from(capture.index.saturating_add(1)).unwrap_or(u16::MAX),
            steps_of_intensity: f64::from(u16::MAX) / top_of_intensity(capture.sensor).0,
            has_reflectivity: has(REFLECTIVITY),
            frame: has(FRAME).then_some(number),
        })
    }

    /// Appends the record of a point, but for the dimensions of [`more_fields`].
    fn add(&self, steps: [i32; 3], point: &Point, records: &mut Vec<u8>) -> Result<(), EncodeError> {
        let Point { ring, column, time_s, hit, number, of, .. } = *point;
        let ring =
            u16::try_from(ring).map_err(|_| EncodeError::new(format!("a LAS's ring can't hold {ring}")))?;
        // A cast is at most 65535, at least 0, and 0 for what is no number.
        let intensity = (f64::from(hit.intensity) * self.steps_of_intensity).round() as u16;
        let mut record = [0; BYTES_OF_FORMAT_6 + 2 + 5 * 4];
        record[0..12].copy_from_slice(steps.map(i32::to_le_bytes).as_flattened());
        record[12..14].copy_from_slice(&intensity.to_le_bytes());
        record[14] = return_number(number + 1) | return_number(of) << 4;
        record[16] = u8::try_from(hit.label).unwrap_or(0);
        record[20..22].copy_from_slice(&self.source.to_le_bytes());
        record[22..30].copy_from_slice(&(self.start_s + time_s).to_le_bytes());
        record[30..32].copy_from_slice(&ring.to_le_bytes());
        let column = u32::try_from(column)
            .map_err(|_| EncodeError::new(format!("a LAS's column can't hold {column}")))?;
        let words = [
            column.to_le_bytes(),
            id_of(hit.instance).to_le_bytes(),
            hit.label.to_le_bytes(),
            (hit.range_m as f32).to_le_bytes(),
            (time_s as f32).to_le_bytes(),
        ];
        record[32..].copy_from_slice(words.as_flattened());
        records.extend_from_slice(&record);
        if self.has_reflectivity {
            records.extend_from_slice(&hit.intensity.to_le_bytes());
        }
        if let Some(frame) = self.frame {
            records.extend_from_slice(&frame.to_le_bytes());
        }
        Ok(())
    }
}
