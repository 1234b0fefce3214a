//! The parts of a run made one.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use super::journal::{is_of_a_run, write_end};
use super::plan::Shard;
use super::record::{self, Header, Line, Merged, Reader};
use super::table::Table;
use crate::error::Error;
use crate::output::{Destination, FileNames, Manifest, SensorFrames};
use crate::source::words::counted;

/// A run of several parts that was made one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Whole {
    /// The parts.
    pub parts: u64,
    /// The frames of all sensors.
    pub frames: u64,
    /// The files, without the manifest.
    pub files: u64,
    /// Their bytes.
    pub bytes: u64,
}

/// Makes the parts of a run one: writes the manifest that the run would have had in one piece, and removes the parts'
/// journals.
///
/// # Errors
/// [`Error::Input`] if a part is missing, not finished, damaged, or of another run; [`Error::Output`] if the manifest can't be
/// written.
pub fn merge(folder: &Path) -> Result<Whole, Error> {
    let found = record::all_in(folder);
    let Some(&(first, _)) = found.first() else {
        let problem = match folder.join(Manifest::NAME).exists() {
            true => "has its manifest already, and no parts of a run",
            false => "has no parts of a run (journal-I-of-N.jsonl)",
        };
        return Err(Error::input(folder, problem));
    };
    if first == Shard::WHOLE {
        let problem = "is of a whole run that was stopped: `beamcast scan --resume` goes on with it";
        return Err(Error::input(folder.join(record::name_of(first)), problem));
    }
    if let Some((other, path)) = found.iter().find(|(other, _)| other.count != first.count) {
        return Err(Error::input(
            path,
            format!("is one of {} parts, and another is one of {}", other.count, first.count),
        ));
    }
    let mut readers = open_all(&found)?;
    let header = readers[0].header.clone();
    let present: BTreeSet<u64> = found.iter().map(|(shard, _)| shard.index).collect();
    if let Some(index) = (0..first.count).find(|index| !present.contains(index)) {
        let missing = first.count - present.len() as u64;
        let others = if missing > 1 { format!(", as are {} others", missing - 1) } else { String::new() };
        let shard = Shard { index, ..first };
        let problem =
            format!("lacks part {} of {}{others}: {}", index + 1, first.count, frames_of(&header, shard));
        return Err(Error::input(folder, problem));
    }
    let mut whole = Whole { parts: first.count, frames: 0, files: 0, bytes: 0 };
    for (reader, (_, path)) in readers.iter_mut().zip(&found) {
        count(reader, path, folder, &mut whole)?;
    }
    // They are opened again twice, and a process may have no more than a thousand files open.
    drop(readers);
    let has_frames = header.sensors.iter().filter(|sensor| sensor.count > 0);
    let of_frames = has_frames.map(|sensor| sensor.sensor.clone());
    let tables: Vec<Table> = header.tables.iter().filter_map(|name| Table::named(name)).collect();
    let of_tables = tables.iter().map(|table| table.folder().to_owned()).filter(|folder| !folder.is_empty());
    let names = Names(of_frames.chain(of_tables).collect());
    let mut destination = Destination::check(folder, names, true)?;
    destination.prepare(Manifest::NAME)?;
    let lines = || Ok(Merged::of(open_all(&found)?));
    for file in write_end(&destination, &header, &tables, &lines, Vec::new())? {
        whole.files += 1;
        whole.bytes += file.bytes;
    }
    for (shard, _) in found {
        destination.remove(&record::name_of(shard))?;
    }
    Ok(whole)
}

/// Opens the files of all parts, which are of the same run.
fn open_all(found: &[(Shard, PathBuf)]) -> Result<Vec<Reader>, Error> {
    let mut readers: Vec<Reader> = Vec::new();
    for (shard, path) in found {
        let reader = Reader::open(path)?.ok_or_else(|| Error::input(path, "has no whole first line"))?;
        let difference = match readers.first() {
            _ if reader.header.shard != *shard => Some("is of another part than its name says".to_owned()),
            Some(first) => first.header.difference(&reader.header),
            None => None,
        };
        if let Some(difference) = difference {
            return Err(Error::input(path, difference));
        }
        readers.push(reader);
    }
    Ok(readers)
}

/// Counts the frames of a part, which must be all of it, with their files.
fn count(reader: &mut Reader, path: &Path, folder: &Path, whole: &mut Whole) -> Result<(), Error> {
    let header = reader.header.clone();
    let mut next: Vec<Option<u64>> =
        header.sensors.iter().map(|sensor| first_of(sensor, header.shard, sensor.first)).collect();
    let damaged = |line: &Line| {
        Error::input(
            path,
            format!("is damaged: frame {} of sensor {:?} is out of its order", line.frame, line.sensor),
        )
    };
    for line in reader.by_ref() {
        let sensor = header.sensor(&line.sensor).ok_or_else(|| damaged(&line))?;
        if next[sensor] != Some(line.frame) {
            return Err(damaged(&line));
        }
        next[sensor] = first_of(&header.sensors[sensor], header.shard, line.frame + 1);
        for file in &line.outputs {
            let there = folder.join(&file.path);
            if !is_of_a_run(&file.path) {
                return Err(damaged(&line));
            }
            match fs::symlink_metadata(&there) {
                Ok(found) if found.is_file() && found.len() == file.bytes => {}
                Ok(found) => {
                    let problem = format!("has {} bytes, and its journal says {}", found.len(), file.bytes);
                    return Err(Error::input(there, problem));
                }
                Err(e) => {
                    return Err(Error::input(there, format!("is in its journal, and can't be read: {e}")));
                }
            }
            whole.files += 1;
            whole.bytes += file.bytes;
        }
        whole.frames += 1;
    }
    if let Some((sensor, frame)) =
        header.sensors.iter().zip(&next).find_map(|(sensor, frame)| Some((sensor, (*frame)?)))
    {
        let left = header.shard.count_in(&(frame..sensor.first + sensor.count));
        let more =
            if left > 1 { format!(" and {} after it", counted(left - 1, "frame")) } else { String::new() };
        let problem = format!(
            "is not finished: frame {frame} of sensor {:?}{more} are missing; `scan --shard {}/{} --resume` goes on with it",
            sensor.sensor,
            header.shard.index + 1,
            header.shard.count
        );
        return Err(Error::input(path, problem));
    }
    Ok(())
}

/// The first frame of a sensor in a part that is not less than `frame`.
fn first_of(sensor: &SensorFrames, shard: Shard, frame: u64) -> Option<u64> {
    shard.first_from(frame).filter(|frame| *frame < sensor.first.saturating_add(sensor.count))
}

/// The frames of a part, in words.
fn frames_of(header: &Header, shard: Shard) -> String {
    const MOST_NAMED: usize = 5;
    let longest = header.sensors.iter().max_by_key(|sensor| sensor.count);
    let Some(sensor) = longest else { return "which has no frames".to_owned() };
    let range = sensor.first..sensor.first.saturating_add(sensor.count);
    let all = shard.count_in(&range);
    let first = shard.first_from(range.start).unwrap_or(range.start);
    let named: Vec<String> =
        (0..all).take(MOST_NAMED).map(|step| (first + step * shard.count).to_string()).collect();
    match all {
        0 => "which has no frames".to_owned(),
        _ if all as usize <= MOST_NAMED => format!("frames {}", named.join(", ")),
        _ => format!("frames {}, … {}", named.join(", "), first + (all - 1) * shard.count),
    }
}

/// The manifest and tables, and the folders of sensors and of tables.
#[derive(Debug)]
struct Names(BTreeSet<String>);

impl FileNames for Names {
    fn folders(&self) -> BTreeSet<String> {
        self.0.clone()
    }

    fn contains(&self, name: &str) -> bool {
        name == Manifest::NAME || Table::named(name).is_some()
    }
}
