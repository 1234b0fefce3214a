//! Whether the folder of a run is as the run has left it.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::Path;

use serde::Serialize;
use serde_json::Value;

use super::record::{self, Reader};
use crate::error::Error;
use crate::output::recorded::{Output, read_manifest};
use crate::output::{Format, Manifest, SensorFrames};

/// What was found in a folder.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Verified {
    /// The files that are as they should be, without the manifest.
    pub files: u64,
    /// Their bytes.
    pub bytes: u64,
    /// What differs, by the names of files.
    pub differences: Vec<Difference>,
}

/// A file that is not as it should be.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Difference {
    /// The file's path in the folder, or the name of the manifest for what it lacks.
    pub path: String,
    /// How it differs: `missing`, `changed`, `unknown` or `unfinished`.
    pub kind: &'static str,
    /// The difference, in words.
    pub problem: String,
}

/// Holds every file of a folder to the manifest: its length, its hash, and that it is there; and looks for files that no run
/// has written. Without a manifest, the journals tell what is missing. `goes_on` is asked before each file, and ends the work by
/// an error.
///
/// # Errors
/// [`Error::Input`] if the folder has neither a manifest nor a journal, or if these can't be read; the errors of `goes_on`.
pub fn verify(folder: &Path, goes_on: &mut dyn FnMut() -> Result<(), Error>) -> Result<Verified, Error> {
    let path = folder.join(Manifest::NAME);
    let mut listed: BTreeMap<String, Output> = BTreeMap::new();
    let mut verified = Verified::default();
    match File::open(&path) {
        Ok(file) => {
            let mut add = |output: Output| {
                listed.insert(output.path.clone(), output);
            };
            let head = read_manifest(file, &mut add).map_err(|e| Error::input(&path, e))?;
            verified.differences.extend(frames_missing(&head, &listed));
        }
        Err(_) => {
            let journals = record::all_in(folder);
            if journals.is_empty() {
                let problem = format!("has no {}, so no scan wrote it", Manifest::NAME);
                return Err(Error::input(folder, problem));
            }
            for (shard, path) in journals {
                let name = record::name_of(shard);
                let problem = "the run has not come to its end".to_owned();
                verified.differences.push(Difference { path: name, kind: "unfinished", problem });
                let written = Reader::open(&path)?.into_iter().flatten().flat_map(|line| line.outputs);
                let listing = |file: crate::output::WrittenFile| {
                    let output = Output {
                        path: file.path.clone(),
                        bytes: Some(file.bytes),
                        blake3: Some(file.blake3),
                    };
                    (file.path, output)
                };
                listed.extend(written.map(listing));
            }
        }
    }
    for output in listed.values() {
        goes_on()?;
        match difference_of(folder, output) {
            Some((kind, problem)) => {
                verified.differences.push(Difference { path: output.path.clone(), kind, problem });
            }
            None => {
                verified.files += 1;
                verified.bytes += output.bytes.unwrap_or(0);
            }
        }
    }
    unknown_files(folder, "", &listed, &mut verified.differences)?;
    verified.differences.sort_by(|a, b| a.path.cmp(&b.path).then(a.kind.cmp(b.kind)));
    Ok(verified)
}

/// How a file differs from what is listed of it.
fn difference_of(folder: &Path, output: &Output) -> Option<(&'static str, String)> {
    let path = folder.join(&output.path);
    let found = match fs::symlink_metadata(&path) {
        Ok(found) if found.is_file() => found,
        Ok(_) => return Some(("changed", "is no file any more".to_owned())),
        Err(_) => return Some(("missing", "is not there".to_owned())),
    };
    if let Some(bytes) = output.bytes.filter(|bytes| *bytes != found.len()) {
        return Some(("changed", format!("has {} bytes, and had {bytes}", found.len())));
    }
    let hash = || -> std::io::Result<String> {
        let mut hasher = blake3::Hasher::new();
        std::io::copy(&mut File::open(&path)?, &mut hasher)?;
        Ok(hasher.finalize().to_hex().to_string())
    };
    match hash() {
        Ok(hash) if output.blake3.as_ref().is_none_or(|listed| *listed == hash) => None,
        Ok(_) => Some(("changed", "has another BLAKE3 hash, and the same length".to_owned())),
        Err(e) => Some(("changed", format!("can't be read: {e}"))),
    }
}

/// The files below a folder that nothing lists, but for those of the run itself.
fn unknown_files(
    root: &Path,
    prefix: &str,
    listed: &BTreeMap<String, Output>,
    found: &mut Vec<Difference>,
) -> Result<(), Error> {
    let folder = root.join(prefix);
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { &folder };
    let entries = fs::read_dir(folder).map_err(|e| Error::input(folder, format!("can't be read: {e}")))?;
    for entry in entries.flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let path = if prefix.is_empty() { name.clone() } else { format!("{prefix}/{name}") };
        if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
            unknown_files(root, &path, listed, found)?;
            continue;
        }
        let is_finished = || root.join(Manifest::NAME).exists();
        let is_own = prefix.is_empty()
            && (name == Manifest::NAME || record::shard_of(&name).is_some() && !is_finished());
        if !is_own && !listed.contains_key(&path) {
            let problem = "is not of the run".to_owned();
            found.push(Difference { path, kind: "unknown", problem });
        }
    }
    Ok(())
}

/// Frames that a manifest should list and does not: each frame of a sensor has as many files as the others.
fn frames_missing(head: &Value, listed: &BTreeMap<String, Output>) -> Vec<Difference> {
    let frames: Vec<SensorFrames> = serde_json::from_value(head["frames"].clone()).unwrap_or_default();
    let mut missing = Vec::new();
    for SensorFrames { sensor, first, count, .. } in frames {
        let mut by_frame: BTreeMap<u64, u64> = BTreeMap::new();
        for name in listed.keys() {
            let of_frame = Format::all().find_map(|format| format.frame_of(name));
            let of_sensor = of_frame.filter(|(of, _)| *of == sensor);
            if let Some(frame) = of_sensor.and_then(|(_, digits)| digits.parse().ok()) {
                *by_frame.entry(frame).or_default() += 1;
            }
        }
        let most = by_frame.values().max().copied().unwrap_or(0);
        let lacks = |frame: &u64| by_frame.get(frame).is_none_or(|files| *files < most);
        // A run without formats that have a file a frame lists none.
        let end = if most == 0 { first } else { first.saturating_add(count) };
        let mut lacking = (first..end).filter(lacks);
        if let Some(frame) = lacking.next() {
            let more = match lacking.count() {
                0 => String::new(),
                more => format!(" and {more} more"),
            };
            let problem = format!("does not list all files of frame {frame} of sensor {sensor:?}{more}");
            missing.push(Difference { path: Manifest::NAME.to_owned(), kind: "missing", problem });
        }
    }
    missing
}
