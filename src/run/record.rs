//! The file in which a run notes each frame that is finished: a header, and a line a frame.
//!
//! The frames of a file are in the order of the plan, without a gap, because frames are cast beside each other but finished one
//! after the other. So what is done is known by the number of lines, and a run of any length keeps no list of it.

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, BufRead, BufReader, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::plan::{Item, Shard};
use super::statistics::Statistics;
use crate::error::Error;
use crate::output::{SensorFrame, SensorFrames, WrittenFile};

/// The version of the file's format.
const FORMAT: u32 = 2;

/// The longest line that is read. The header tells of a scene's instances: 12 MB for a hundred thousand.
const MAX_LINE_BYTES: u64 = 256 << 20;

/// The first line: the run that the frames are of.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Header {
    journal: u32,
    /// The frames of the whole run, in the job's order of sensors.
    pub sensors: Vec<SensorFrames>,
    /// The part of the run.
    pub shard: Shard,
    /// The names of the run's tables.
    pub tables: Vec<String>,
    /// The text of the manifest that the whole run will have, without its outputs. It is text, because a scene can have millions of
    /// instances, of which values take ten times the memory.
    pub manifest: String,
}

/// The other lines: a frame that is finished, which means that all its files are on the disk.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Line {
    /// The sensor's name.
    pub sensor: String,
    /// The frame's number.
    pub frame: u64,
    /// The time at which the frame starts.
    pub start_s: f64,
    /// The frame's files.
    pub outputs: Vec<WrittenFile>,
    /// The files whose format could not hold all values of the frame.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub lost: Vec<Loss>,
    /// The frame in short.
    pub statistics: Statistics,
    /// The frame's rows of the run's tables, by the names of these.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub rows: BTreeMap<String, Vec<String>>,
    /// What the job draws for the frames of this number.
    #[serde(default, skip_serializing_if = "Map::is_empty")]
    pub drawn: Map<String, Value>,
}

impl Line {
    /// The line of a frame with these files, which have all of its values, in a run without tables and draws.
    pub fn of(item: &Item, frame: &SensorFrame, outputs: Vec<WrittenFile>) -> Self {
        Self {
            sensor: frame.name.to_owned(),
            frame: item.frame,
            start_s: frame.capture.start_s,
            outputs,
            lost: Vec::new(),
            statistics: Statistics::of(frame.frame),
            rows: BTreeMap::new(),
            drawn: Map::new(),
        }
    }
}

/// A file whose format could not hold all values of its frame.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Loss {
    /// The file's path in the output folder.
    pub path: String,
    /// How many values it has 0 for.
    pub values: u64,
}

impl Header {
    /// The header of a part of a run. `manifest` is [`Manifest::head`](crate::output::Manifest::head).
    pub fn new(sensors: Vec<SensorFrames>, shard: Shard, tables: Vec<String>, manifest: String) -> Self {
        Self { journal: FORMAT, sensors, shard, tables, manifest }
    }

    /// A sentence about what another run is of, if it is not of the same job, scene, frames and program: `was written with the
    /// seed 7, and this run has 0`.
    pub fn difference(&self, other: &Self) -> Option<String> {
        if let Some(difference) = difference_of_manifests(&self.manifest, &other.manifest) {
            return Some(difference);
        }
        (self.sensors != other.sensors).then(|| "is of other frames".to_owned())
    }

    /// The index of a sensor.
    pub fn sensor(&self, name: &str) -> Option<usize> {
        self.sensors.iter().position(|sensor| sensor.sensor == name)
    }
}

/// The same for the texts of the manifests of two runs, without their outputs.
pub fn difference_of_manifests(own: &str, other: &str) -> Option<String> {
    if own == other {
        return None;
    }
    let [own, other] = [own, other].map(|text| serde_json::from_str::<Value>(text).unwrap_or_default());
    if own == other {
        return None;
    }
    let (tool, other_tool) = (&own["tool"]["version"], &other["tool"]["version"]);
    if tool != other_tool {
        return Some(format!("was written by version {other_tool} of the program, and this is {tool}"));
    }
    if own["seed"] != other["seed"] {
        return Some(format!(
            "was written with the seed {}, and this run has {}",
            other["seed"], own["seed"]
        ));
    }
    if let Some(key) = first_difference(&own["job"], &other["job"]) {
        return Some(format!("is of another job: `{key}` is not the same"));
    }
    let names = |manifest: &Value| -> Vec<(String, Value)> {
        let files = manifest["inputs"].as_array().into_iter().flatten();
        files
            .map(|file| (file["name"].as_str().unwrap_or_default().to_owned(), file["blake3"].clone()))
            .collect()
    };
    let (own_files, other_files) = (names(&own), names(&other));
    let is_other = |pair: &(&(String, Value), &(String, Value))| pair.0 != pair.1;
    if let Some(((name, _), _)) = own_files.iter().zip(&other_files).find(is_other) {
        return Some(format!("was written when {name:?} had another content"));
    }
    if own["frames"] != other["frames"] {
        return Some("is of other frames of the job".to_owned());
    }
    Some("is of another scene".to_owned())
}

/// The path of the first key that two values do not share.
fn first_difference(a: &Value, b: &Value) -> Option<String> {
    let join = |key: &str, rest: String| match rest.is_empty() || rest.starts_with('[') {
        true => format!("{key}{rest}"),
        false => format!("{key}.{rest}"),
    };
    match (a, b) {
        (Value::Object(own), Value::Object(other)) => {
            let missing = || other.keys().find(|key| !own.contains_key(*key)).cloned();
            let differs = |(key, value): (&String, &Value)| match other.get(key) {
                Some(other) => Some(join(key, first_difference(value, other)?)),
                None => Some(key.clone()),
            };
            own.iter().find_map(differs).or_else(missing)
        }
        (Value::Array(own), Value::Array(other)) if own.len() == other.len() => {
            let differs = |(index, (a, b)): (usize, (&Value, &Value))| {
                Some(join(&format!("[{index}]"), first_difference(a, b)?))
            };
            own.iter().zip(other).enumerate().find_map(differs)
        }
        _ => (a != b).then(String::new),
    }
}

/// The name of the file of a run, or of a part of one.
pub fn name_of(shard: Shard) -> String {
    match shard {
        Shard::WHOLE => "journal.jsonl".to_owned(),
        Shard { index, count } => format!("journal-{}-of-{count}.jsonl", index + 1),
    }
}

/// The part that a file of this name is of.
pub fn shard_of(name: &str) -> Option<Shard> {
    if name == name_of(Shard::WHOLE) {
        return Some(Shard::WHOLE);
    }
    let (number, count) = name.strip_prefix("journal-")?.strip_suffix(".jsonl")?.split_once("-of-")?;
    let shard = Shard { index: number.parse::<u64>().ok()?.checked_sub(1)?, count: count.parse().ok()? };
    (shard.index < shard.count && shard.count > 1 && name_of(shard) == name).then_some(shard)
}

/// The files of runs in a folder, by their parts.
pub fn all_in(folder: &Path) -> Vec<(Shard, PathBuf)> {
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut found: Vec<(Shard, PathBuf)> = entries
        .filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_file()))
        .filter_map(|entry| Some((shard_of(entry.file_name().to_str()?)?, entry.path())))
        .collect();
    found.sort_by_key(|(shard, _)| (shard.count, shard.index));
    found
}

/// A file that is read line by line, as far as its lines are whole.
#[derive(Debug)]
pub struct Reader {
    /// The first line.
    pub header: Header,
    file: BufReader<File>,
    /// The bytes of the lines that were read.
    read: u64,
}

impl Reader {
    /// Opens a file. `None` if its first line is not whole, as after a crash at the very beginning.
    ///
    /// # Errors
    /// [`Error::Input`] if it can't be read.
    pub fn open(path: &Path) -> Result<Option<Self>, Error> {
        let file = File::open(path).map_err(|e| Error::input(path, format!("can't be read: {e}")))?;
        let mut file = BufReader::new(file);
        let Some(line) = whole_line(&mut file) else { return Ok(None) };
        let header = serde_json::from_slice::<Header>(&line).ok().filter(|header| header.journal == FORMAT);
        Ok(header.map(|header| Self { header, file, read: line.len() as u64 }))
    }

    /// The bytes of the lines that were read so far.
    pub fn bytes(&self) -> u64 {
        self.read
    }
}

impl Iterator for Reader {
    type Item = Line;

    fn next(&mut self) -> Option<Line> {
        let line = whole_line(&mut self.file)?;
        let parsed: Line = serde_json::from_slice(&line).ok()?;
        self.read += line.len() as u64;
        Some(parsed)
    }
}

/// The next line with its end. `None` if it has none, because the write of it was cut off.
fn whole_line(file: &mut BufReader<File>) -> Option<Vec<u8>> {
    let mut line = Vec::new();
    io::Read::take(&mut *file, MAX_LINE_BYTES).read_until(b'\n', &mut line).ok()?;
    line.ends_with(b"\n").then_some(line)
}

/// A file that is written line by line.
#[derive(Debug)]
pub struct Writer {
    path: PathBuf,
    file: File,
}

impl Writer {
    /// Begins a file with its header.
    ///
    /// # Errors
    /// [`Error::Output`] about the file, such as when another process writes to it.
    pub fn create(path: &Path, header: &Header) -> Result<Self, Error> {
        let mut writer = Self::resume(path, 0)?;
        writer.write(header)?;
        Ok(writer)
    }

    /// Goes on with a file after so many bytes of whole lines.
    ///
    /// # Errors
    /// As [`Self::create`].
    pub fn resume(path: &Path, bytes: u64) -> Result<Self, Error> {
        let open = || {
            let mut file = OpenOptions::new().write(true).create(true).truncate(false).open(path)?;
            // Where the system has no locks, there is none. A lock ends with the process, whatever ends that.
            if matches!(file.try_lock(), Err(TryLockError::WouldBlock)) {
                return Ok(None);
            }
            file.set_len(bytes)?;
            file.seek(SeekFrom::Start(bytes))?;
            Ok(Some(file))
        };
        match open().map_err(|e: io::Error| Error::output(path, told(e)))? {
            Some(file) => Ok(Self { path: path.to_path_buf(), file }),
            None => Err(Error::output(path, "another run is writing to this file")),
        }
    }

    /// Adds a line. It is not flushed to the disk: a line that is lost costs no more than the frame's time.
    ///
    /// # Errors
    /// [`Error::Output`] about the file.
    pub fn write(&mut self, line: &impl Serialize) -> Result<(), Error> {
        let mut text = serde_json::to_string(line).map_err(|e| Error::output(&self.path, e))?;
        text.push('\n');
        self.file.write_all(text.as_bytes()).map_err(|e| Error::output(&self.path, told(e)))
    }
}

fn told(error: io::Error) -> String {
    match error.kind() {
        io::ErrorKind::StorageFull => "can't be written: the disk is full".to_owned(),
        _ => format!("can't be written: {error}"),
    }
}

/// The lines of the parts of a run in one order: by the times at which the frames start, at the same time in the order of the
/// sensors. Each part is in this order already.
pub struct Merged {
    header: Header,
    parts: Vec<std::iter::Peekable<Reader>>,
}

impl Merged {
    /// Merges parts, of which there is at least one.
    pub fn of(parts: Vec<Reader>) -> Option<Self> {
        let header = parts.first()?.header.clone();
        Some(Self { header, parts: parts.into_iter().map(Iterator::peekable).collect() })
    }
}

impl Iterator for Merged {
    type Item = Line;

    fn next(&mut self) -> Option<Line> {
        let header = &self.header;
        let key = |line: &Line| (line.start_s, header.sensor(&line.sensor).unwrap_or(usize::MAX));
        let earlier = |a: &(usize, (f64, usize)), b: &(usize, (f64, usize))| -> Ordering {
            a.1.0.total_cmp(&b.1.0).then(a.1.1.cmp(&b.1.1)).then(a.0.cmp(&b.0))
        };
        let heads =
            self.parts.iter_mut().enumerate().filter_map(|(index, part)| Some((index, key(part.peek()?))));
        let (index, _) = heads.min_by(earlier)?;
        self.parts[index].next()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn header(shard: Shard) -> Header {
        let sensors =
            ["top", "front"].map(|name| SensorFrames { sensor: name.into(), first: 0, count: 9, of: 9 });
        let manifest = json!({
            "tool": { "version": "1" }, "seed": 3, "job": { "sensor": [{ "rate_hz": 10.0 }] },
            "inputs": [{ "name": "a.glb", "blake3": "0" }], "scene": {},
        });
        Header::new(sensors.to_vec(), shard, vec![], manifest.to_string())
    }

    fn line(sensor: &str, frame: u64, start_s: f64) -> Line {
        let outputs =
            vec![WrittenFile { path: format!("{sensor}/{frame:06}.exr"), bytes: 1, blake3: "ab".into() }];
        let statistics =
            Statistics { hits: 2, range_m: Some([0.1, 1.0 / 3.0, 7.0]), ..Statistics::default() };
        Line {
            sensor: sensor.into(),
            frame,
            start_s,
            outputs,
            lost: vec![],
            statistics,
            rows: BTreeMap::new(),
            drawn: Map::new(),
        }
    }

    #[test]
    fn names_tell_the_part() {
        for shard in [Shard::WHOLE, Shard { index: 0, count: 2 }, Shard { index: 15, count: 16 }] {
            assert_eq!(shard_of(&name_of(shard)), Some(shard));
        }
        assert_eq!(name_of(Shard { index: 2, count: 3 }), "journal-3-of-3.jsonl");
        for name in [
            "journal-0-of-3.jsonl",
            "journal-4-of-3.jsonl",
            "journal-1-of-1.jsonl",
            "journal-01-of-3.jsonl",
            "a",
        ] {
            assert_eq!(shard_of(name), None, "{name}");
        }
    }

    /// A file is cut anywhere, and what is whole of it is read and written on.
    #[test]
    fn what_is_cut_off_is_passed_over_and_written_anew() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name_of(Shard::WHOLE));
        let lines = [line("top", 0, 0.0), line("front", 0, 0.0), line("top", 1, 0.1)];
        let mut writer = Writer::create(&path, &header(Shard::WHOLE)).unwrap();
        lines.iter().for_each(|line| writer.write(line).unwrap());
        drop(writer);
        let whole = std::fs::read(&path).unwrap();
        for length in 0..=whole.len() {
            std::fs::write(&path, &whole[..length]).unwrap();
            let ends = whole[..length].iter().filter(|byte| **byte == b'\n').count();
            let Some(mut reader) = Reader::open(&path).unwrap() else {
                assert_eq!(ends, 0);
                continue;
            };
            let read: Vec<Line> = reader.by_ref().collect();
            assert_eq!(read, lines[..ends - 1], "{length}");
            let mut writer = Writer::resume(&path, reader.bytes()).unwrap();
            lines[read.len()..].iter().for_each(|line| writer.write(line).unwrap());
            assert_eq!(std::fs::read(&path).unwrap(), whole, "{length}");
        }
    }

    #[test]
    fn parts_merge_by_time_and_then_by_sensor() {
        let folder = tempfile::tempdir().unwrap();
        let parts = [
            vec![line("top", 0, 0.0), line("front", 2, 0.08), line("front", 4, 0.16)],
            vec![line("front", 1, 0.04), line("top", 1, 0.08), line("front", 3, 0.12)],
        ];
        let open = |(index, lines): (usize, Vec<Line>)| {
            let shard = Shard { index: index as u64, count: 2 };
            let path = folder.path().join(name_of(shard));
            let mut writer = Writer::create(&path, &header(shard)).unwrap();
            lines.iter().for_each(|line| writer.write(line).unwrap());
            Reader::open(&path).unwrap().unwrap()
        };
        let merged = Merged::of(parts.into_iter().enumerate().map(open).collect()).unwrap();
        let order: Vec<_> = merged.map(|line| (line.sensor, line.frame)).collect();
        let expected = [("top", 0), ("front", 1), ("top", 1), ("front", 2), ("front", 3), ("front", 4)];
        assert_eq!(order, expected.map(|(sensor, frame)| (sensor.to_owned(), frame)));
    }

    #[test]
    fn another_run_is_told_by_what_is_other_about_it() {
        let own = header(Shard::WHOLE);
        let said = |change: &dyn Fn(&mut Header)| {
            let mut other = own.clone();
            change(&mut other);
            own.difference(&other)
        };
        assert_eq!(said(&|_| {}), None);
        let of = |change: &dyn Fn(&mut Header)| said(change).unwrap();
        let of_manifest = |change: &dyn Fn(&mut Value)| {
            of(&|header| {
                let mut manifest = serde_json::from_str(&header.manifest).unwrap();
                change(&mut manifest);
                header.manifest = manifest.to_string();
            })
        };
        assert!(of_manifest(&|m| m["seed"] = 7.into()).contains("the seed 7, and this run has 3"));
        assert!(of_manifest(&|m| m["tool"]["version"] = "2".into()).contains("version \"2\" of the program"));
        assert!(
            of_manifest(&|m| m["job"]["sensor"][0]["rate_hz"] = 5.into()).contains("`sensor[0].rate_hz`")
        );
        assert!(
            of_manifest(&|m| m["inputs"][0]["blake3"] = "1".into()).contains("\"a.glb\" had another content")
        );
        assert!(of_manifest(&|m| m["scene"] = json!({ "triangles": 1 })).contains("another scene"));
        assert!(of(&|h| h.sensors[0].count = 3).contains("other frames"));
    }
}
