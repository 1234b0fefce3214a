//! Baselines: the result of a job when it was accepted, small enough for version control.
//!
//! A baseline is a folder with `baseline.json`, which people can read and compare, and a file of pixels for each sensor.
//! The JSON holds the resolved job, the beams, the hashes of the scene's files and a hash for each channel. Equal hashes
//! are all that an unchanged job needs. The pixel files serve to describe differences and to apply tolerances. They hold a
//! hash for each row of every channel and for each column of the range, and the pixels of some channels: ids exactly, the
//! range and the channels with a tolerance rounded.
//!
//! Of a sequence, a baseline has chosen frames only: a record and a file of pixels for each of them. A sensor that reports several
//! returns of a pulse has a record and a file for each number of return, as if it were a frame of its own.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::compare::Tolerance;
use super::outcome::title;
use super::pixels;
use crate::output::{
    Channel, Image, Samples, SensorFrame, index_of, is_of_all_pixels, json_lines, no_return,
};
use crate::scene::Scene;
use crate::sensor::{Pattern, Sensor};

/// The version of the format of a baseline that has the first frame of each sensor and no other.
const FORMAT: u32 = 2;

/// The version of the format of a baseline of several frames. A program that reads only the first format would take the first
/// record of a sensor for the only one.
const FORMAT_OF_FRAMES: u32 = 3;

/// The version of the format of a baseline that has further returns. A program that reads only the others would take the last record of
/// a frame for its first returns.
const FORMAT_OF_RETURNS: u32 = 4;

/// The record of an accepted job, without the pixels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Baseline {
    format: u32,
    /// The version of the tool.
    pub tool: String,
    /// The resolved job, without the keys that do not affect the frames.
    pub job: Value,
    /// The scene that was scanned.
    pub scene: SceneRecord,
    /// One record for each frame that is kept, by number and then in the job's order of sensors.
    pub sensors: Vec<SensorRecord>,
}

/// The identity of the scene that was scanned.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SceneRecord {
    /// The BLAKE3 hash of each of the scene's files, by file name.
    pub files: BTreeMap<String, String>,
    /// The number of triangles in the scene.
    pub triangles: u64,
}

/// A sensor's frame as hashes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SensorRecord {
    /// The sensor's name.
    pub name: String,
    /// The frame's number.
    #[serde(default, skip_serializing_if = "is_first")]
    pub frame: u64,
    /// The number of the return of each pixel, from 0.
    #[serde(default, rename = "return", skip_serializing_if = "is_first_return")]
    pub number: usize,
    /// Rows of the image.
    pub rows: usize,
    /// Columns of the image.
    pub columns: usize,
    /// The number of returns of the frame; of a further return, the number of pixels that have it.
    pub returns: usize,
    /// The BLAKE3 hash of each channel, computed over the BLAKE3 hashes of its rows.
    pub channels: BTreeMap<String, String>,
    /// The step to which the pixels of a channel are rounded, in its unit; 0 means exact. Channels without an entry are
    /// kept as hashes only.
    pub kept: BTreeMap<String, f64>,
    /// The names of the instances that are visible in the frame, by id.
    pub instances: BTreeMap<u32, String>,
    /// The elevation and the azimuth offset in degrees and the time in microseconds of each beam, row by row. It is empty
    /// for a camera, and for all but the first record of a sensor in a baseline.
    pub beams: Vec<[f64; 3]>,
}

/// Whether a frame is a sensor's first one, whose number is not written.
fn is_first(frame: &u64) -> bool {
    *frame == 0
}

/// Whether a return is the first one of its pixel, whose number is not written.
fn is_first_return(number: &usize) -> bool {
    *number == 0
}

/// A sensor's frame in the form in which it is compared or recorded.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// The hashes of the frame.
    pub record: SensorRecord,
    /// The channels of the frame.
    pub image: Image,
    /// The meaning of labels, in words.
    pub labels: BTreeMap<u32, String>,
    is_of_sequence: bool,
    hashes: Hashes,
}

/// Hashes that locate the differences between images without their pixels.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Hashes {
    /// The first 32 bits of the BLAKE3 of each row, by channel.
    pub rows: BTreeMap<String, Vec<u32>>,
    /// The first 32 bits of the BLAKE3 of each column of the main depth channel.
    pub columns: Vec<u32>,
}

/// The pixels of a sensor that a baseline keeps.
#[derive(Clone, Debug, PartialEq)]
pub struct StoredPixels {
    /// The hashes that locate differences.
    pub hashes: Hashes,
    /// The channels whose pixels are kept.
    pub image: Image,
}

/// The reason why a file is no baseline. The messages continue a sentence that begins with the file's name.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BaselineError {
    /// The file is not valid JSON.
    #[error("is not valid JSON: {0}")]
    Json(#[source] serde_json::Error),
    /// The file has the format of another version.
    #[error("has format {0}, and this version reads {FORMAT} to {FORMAT_OF_RETURNS}")]
    Format(u64),
    /// The file does not say which format it has.
    #[error("is no baseline: it has no `format`")]
    NoFormat,
    /// The file has the right format but lacks a part of its content.
    #[error("is no baseline: {0}")]
    Content(#[source] serde_json::Error),
}

impl Baseline {
    /// The name of the JSON in a baseline's folder.
    pub const NAME: &'static str = "baseline.json";

    /// Makes a baseline of a finished job. `job` is the resolved job.
    pub fn of(job: &Value, scene: &Scene, mut sensors: Vec<SensorRecord>) -> Self {
        let format = match () {
            () if sensors.iter().any(|record| record.number > 0) => FORMAT_OF_RETURNS,
            () if sensors.iter().any(|record| record.frame > 0) => FORMAT_OF_FRAMES,
            () => FORMAT,
        };
        let mut known = BTreeSet::new();
        for record in &mut sensors {
            if !known.insert(record.name.clone()) {
                record.beams.clear();
            }
        }
        let mut job = job.clone();
        if let Some(keys) = job.as_object_mut() {
            // The expectations and the output settings do not change a frame.
            keys.retain(|key, _| !matches!(key.as_str(), "check" | "expect" | "output"));
        }
        let files = scene.geometry.files.iter().map(|f| (f.name.clone(), f.blake3.clone())).collect();
        let scene = SceneRecord { files, triangles: scene.triangle_count() };
        Self { format, tool: env!("CARGO_PKG_VERSION").to_owned(), job, scene, sensors }
    }

    /// The name of the file of a frame's pixels, in the baseline's folder. No sensor's name has an `@`.
    pub fn pixels_name(record: &SensorRecord) -> String {
        let SensorRecord { name, frame, number, .. } = record;
        let frame = if *frame > 0 { format!("@{frame:06}") } else { String::new() };
        let number = if *number > 0 { format!("@return{number}") } else { String::new() };
        format!("{name}{frame}{number}.pixels")
    }

    /// The content of [`Baseline::NAME`].
    pub fn encode(&self) -> Vec<u8> {
        // The value has only numbers and texts, so serialisation cannot fail.
        json_lines(&serde_json::to_value(self).unwrap_or_default()).into_bytes()
    }

    /// Reads the content of [`Baseline::NAME`].
    ///
    /// # Errors
    /// A [`BaselineError`], whose message continues a sentence that begins with the file's name.
    pub fn decode(bytes: &[u8]) -> Result<Self, BaselineError> {
        // The content is read into what is used of it. A tree of values would take many times the length of the file.
        #[derive(Deserialize)]
        struct Head {
            format: Option<serde_json::Number>,
        }
        let head = match serde_json::from_slice::<Head>(bytes) {
            Ok(head) => head.format.and_then(|format| format.as_u64()),
            Err(error) if error.is_data() => None,
            Err(error) => return Err(BaselineError::Json(error)),
        };
        match head {
            Some(format) if (u64::from(FORMAT)..=u64::from(FORMAT_OF_RETURNS)).contains(&format) => {}
            Some(format) => return Err(BaselineError::Format(format)),
            None => return Err(BaselineError::NoFormat),
        }
        serde_json::from_slice(bytes).map_err(BaselineError::Content)
    }
}

impl SensorRecord {
    /// The part of a record that no frame changes.
    pub fn of_sensor(name: &str, sensor: &Sensor) -> Self {
        let (rows, columns) = (sensor.pattern.rows(), sensor.pattern.columns());
        Self { name: name.to_owned(), rows, columns, beams: beams(&sensor.pattern), ..Self::default() }
    }

    /// The number of pixels of the image.
    pub fn pixels(&self) -> usize {
        self.rows * self.columns
    }
}

impl Snapshot {
    /// Records the first returns of a frame of `scene`, whose labels stand for `labels`.
    pub fn of(frame: &SensorFrame, scene: &Scene, labels: &BTreeMap<u32, String>) -> Self {
        Self::of_return(frame, 0, scene, labels)
    }

    /// Records the return number `number`, from 0, of each pixel of a frame of `scene`, whose labels stand for `labels`. A pixel with
    /// fewer returns counts as one without a return.
    pub fn of_return(
        frame: &SensorFrame,
        number: usize,
        scene: &Scene,
        labels: &BTreeMap<u32, String>,
    ) -> Self {
        let image = Image::of_return(frame, number).without_repeats();
        let mut hashes = Hashes::default();
        let mut channels = BTreeMap::new();
        for Channel { name, samples } in &image.channels {
            let mut whole = blake3::Hasher::new();
            let mut rows = Vec::with_capacity(image.rows);
            for row in 0..image.rows {
                let hash = hash_of(samples, row * image.columns..(row + 1) * image.columns, 1);
                whole.update(hash.as_bytes());
                rows.push(short(&hash));
            }
            channels.insert(name.clone(), whole.finalize().to_hex().to_string());
            hashes.rows.insert(name.clone(), rows);
        }
        if let Some(depth) = image.main_depth().and_then(|(name, _)| image.channel(name)) {
            let of = |column| short(&hash_of(depth, column..image.pixels(), image.columns));
            hashes.columns = (0..image.columns).map(of).collect();
        }
        let instances = match image.u32("id.instance") {
            Some(ids) => {
                let seen = ids.iter().zip(image.mask()).filter(|(_, seen)| *seen).map(|(id, _)| *id);
                let mut seen: Vec<u32> = seen.collect();
                seen.sort_unstable();
                seen.dedup();
                let name = |id: u32| {
                    let object = scene.geometry.objects.get(index_of(id)? as usize)?;
                    Some((id, object.name.clone()))
                };
                seen.into_iter().filter_map(name).collect()
            }
            None => BTreeMap::new(),
        };
        let record = SensorRecord {
            frame: frame.capture.frame,
            number,
            returns: match number {
                0 => frame.frame.return_count(),
                _ => image.mask().into_iter().filter(|seen| *seen).count(),
            },
            channels,
            instances,
            ..SensorRecord::of_sensor(frame.name, frame.capture.sensor)
        };
        Self { record, image, labels: labels.clone(), is_of_sequence: false, hashes }
    }

    /// The same as a frame of a sequence, whose number is told.
    #[must_use]
    pub fn in_sequence(self, is_of_sequence: bool) -> Self {
        Self { is_of_sequence, ..self }
    }

    /// The frame in words: `sensor roof`, or `sensor roof, frame 50` in a sequence, with the number of a further return.
    pub fn title(&self) -> String {
        title(&self.record.name, self.frame_number(), self.record.number)
    }

    /// The frame's number, if it is one of several.
    pub fn frame_number(&self) -> Option<u64> {
        self.is_of_sequence.then_some(self.record.frame)
    }

    /// The hashes of rows and columns.
    pub fn hashes(&self) -> &Hashes {
        &self.hashes
    }

    /// Packs the pixels that a baseline keeps, and notes in the record which channels these are. Channels without a
    /// tolerance are kept as finely as [`MAX_PIXEL_BYTES`] allow.
    pub fn pack(&mut self, tolerances: &BTreeMap<String, Tolerance>) -> Vec<u8> {
        let mask = self.image.mask();
        let main = self.image.main_depth().map(|(name, _)| name);
        let all = vec![true; mask.len()];
        let mut head = Vec::new();
        for rows in self.hashes.rows.values() {
            head.extend(rows.iter().flat_map(|hash| hash.to_le_bytes()));
        }
        head.extend(self.hashes.columns.iter().flat_map(|hash| hash.to_le_bytes()));
        section(&mut head, &pixels::pack_mask(&mask));

        let step_of = |channel: &Channel| match &channel.samples {
            Samples::U32(_) => 0.0,
            Samples::F32(values) => tolerances.get(&channel.name).map_or(0.0, |t| step(t, values, &mask)),
        };
        let is_kept = |channel: &&Channel| {
            let name = channel.name.as_str();
            Some(name) == main
                || matches!(name, "cause" | "id.instance" | "id.semantic")
                || tolerances.contains_key(name)
        };
        let kept: Vec<(&Channel, f64)> =
            self.image.channels.iter().filter(is_kept).map(|c| (c, step_of(c))).collect();
        // Channels without a step get the finest one that fits into the limit.
        let mut coarsest = FINEST_STEP;
        loop {
            let mut file = head.clone();
            let mut steps = BTreeMap::new();
            let mut may_be_coarser = false;
            for (channel, step) in &kept {
                let is_id = matches!(channel.samples, Samples::U32(_));
                may_be_coarser |= !is_id && *step == 0.0;
                let step = if *step == 0.0 && !is_id { coarsest } else { *step };
                let known = if is_of_all_pixels(&channel.name) { &all } else { &mask };
                section(&mut file, &pixels::pack(&channel.samples, known, self.image.columns, step));
                steps.insert(channel.name.clone(), step);
            }
            if file.len() <= MAX_PIXEL_BYTES || !may_be_coarser || coarsest > COARSEST_STEP {
                self.record.kept = steps;
                return file;
            }
            coarsest *= 2.0;
        }
    }
}

/// The most bytes that a sensor's pixels take, if their step may be made coarser.
pub const MAX_PIXEL_BYTES: usize = 175_000;

/// The finest step in which a range without a tolerance is kept, in metres.
const FINEST_STEP: f64 = 1e-3;

/// The step from which on coarser steps save nothing more, in metres.
const COARSEST_STEP: f64 = 100.0;

/// The step that resolves a tolerance well. It is 0 if only the number of pixels is tolerated.
fn step(tolerance: &Tolerance, values: &[f32], mask: &[bool]) -> f64 {
    let seen = values.iter().zip(mask).filter(|(_, seen)| **seen).map(|(v, _)| f64::from(v.abs()));
    let least = seen.filter(|v| *v > 0.0).fold(f64::INFINITY, f64::min);
    let relative = if least.is_finite() { tolerance.relative * least } else { 0.0 };
    (tolerance.absolute + relative) / 4.0
}

impl StoredPixels {
    /// Reads the bytes that [`Snapshot::pack`] wrote for `record`. `None` if the bytes are something else.
    pub fn unpack(file: &[u8], record: &SensorRecord) -> Option<Self> {
        let SensorRecord { rows, columns, .. } = *record;
        let pixels = rows.checked_mul(columns)?;
        // One byte of a file holds a thousand pixels at most.
        if pixels == 0 || pixels / 8 / 1100 > file.len() {
            return None;
        }
        let mut rest = file;
        let mut numbers = |count: usize| -> Option<Vec<u32>> {
            let (bytes, after) = rest.split_at_checked(count.checked_mul(4)?)?;
            rest = after;
            Some(bytes.as_chunks().0.iter().map(|b| u32::from_le_bytes(*b)).collect())
        };
        let mut hashes = Hashes::default();
        for name in record.channels.keys() {
            hashes.rows.insert(name.clone(), numbers(rows)?);
        }
        hashes.columns = numbers(columns)?;
        let mask = pixels::unpack_mask(next_section(&mut rest)?, pixels)?;
        let all = vec![true; pixels];
        let mut channels = Vec::new();
        for (name, &step) in &record.kept {
            let packed = next_section(&mut rest)?;
            let known = if is_of_all_pixels(name) { &all } else { &mask };
            let mut samples = pixels::unpack(packed, known, columns, step, step == 0.0)?;
            if let Samples::F32(values) = &mut samples {
                let missed = values.iter_mut().zip(&mask).filter(|(_, seen)| !**seen);
                missed.for_each(|(value, _)| *value = no_return(name) as f32);
            }
            channels.push(Channel { name: name.clone(), samples });
        }
        Some(Self { hashes, image: Image { rows, columns, channels } })
    }
}

fn section(file: &mut Vec<u8>, bytes: &[u8]) {
    file.extend((bytes.len() as u32).to_le_bytes());
    file.extend(bytes);
}

fn next_section<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
    let (length, after) = rest.split_first_chunk::<4>()?;
    let (section, after) = after.split_at_checked(u32::from_le_bytes(*length) as usize)?;
    *rest = after;
    Some(section)
}

/// The hash of every `step`-th sample in a range of pixels.
fn hash_of(samples: &Samples, pixels: std::ops::Range<usize>, step: usize) -> blake3::Hash {
    let bytes: Vec<u8> = match samples {
        Samples::F32(values) => pixels.step_by(step).flat_map(|i| values[i].to_le_bytes()).collect(),
        Samples::U32(values) => pixels.step_by(step).flat_map(|i| values[i].to_le_bytes()).collect(),
    };
    blake3::hash(&bytes)
}

fn short(hash: &blake3::Hash) -> u32 {
    let [a, b, c, d, ..] = *hash.as_bytes();
    u32::from_le_bytes([a, b, c, d])
}

fn beams(pattern: &Pattern) -> Vec<[f64; 3]> {
    let Pattern::Rotating(rotating) = pattern else { return Vec::new() };
    // The conversion to radians and back changes a degree in its last digits, so values are rounded to a billionth.
    let rounded = |value: f64| (value * 1e9).round() / 1e9;
    let beam = |b: &crate::sensor::Beam| {
        [b.elevation.degrees(), b.azimuth_offset.degrees(), b.time_s * 1e6].map(rounded)
    };
    rotating.beams().iter().map(beam).collect()
}
