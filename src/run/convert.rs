//! Recorded files in other formats: single ones, and every frame of a folder that a scan wrote.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use serde_json::{Value, json};

use crate::error::Error;
use crate::output::recorded::{
    CLOUD_ENDINGS, Folder, FrameKey, IMAGE_ENDINGS, Output, Recorded, read_manifest,
};
use crate::output::{CloudFormat, Destination, EncodeError, FileNames, ImageFormat, Manifest};

/// A format that recorded files are written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    /// One of clouds.
    Cloud(CloudFormat),
    /// One of range images.
    Images(ImageFormat),
}

impl Target {
    /// The endings of all targets.
    pub fn endings() -> impl Iterator<Item = &'static str> {
        let clouds = CloudFormat::ALL.into_iter().map(|(_, ending)| ending);
        clouds.chain(ImageFormat::ALL.into_iter().map(|(_, ending)| ending))
    }

    /// The target of an ending, which is the name of the format, too.
    pub fn of_ending(ending: &str) -> Option<Self> {
        let ending = ending.to_ascii_lowercase();
        let cloud = CloudFormat::of_ending(&ending).map(Self::Cloud);
        cloud.or_else(|| ImageFormat::of_ending(&ending).map(Self::Images))
    }

    fn ending(self) -> &'static str {
        Self::endings().find(|ending| Self::of_ending(ending) == Some(self)).unwrap_or_default()
    }

    /// The file of a recording, and what is to be known about it, in sentences. The coordinates of a LAS are steps of `step_m` metres.
    ///
    /// # Errors
    /// An [`EncodeError`] if the recording is of another kind than the format, or has what the format can't hold.
    pub fn encode(self, recorded: Recorded, step_m: f64) -> Result<(Vec<u8>, Vec<String>), EncodeError> {
        match (self, recorded) {
            (Self::Cloud(format), Recorded::Cloud(cloud)) => format.encode(&cloud, step_m),
            (Self::Images(format), Recorded::Images(parts)) => Ok((format.encode(parts)?, Vec::new())),
            (Self::Cloud(_), _) => {
                let ending = self.ending();
                Err(EncodeError::new(format!(
                    "is no cloud, and does not tell where its beams went: `beamcast scan` writes clouds of its job with \
                     `--set 'output.formats=[\"{ending}\"]'`"
                )))
            }
            (Self::Images(_), _) => {
                let ending = self.ending();
                Err(EncodeError::new(format!(
                    "is no range image, and does not tell which beams had no return: `beamcast scan` writes images of its job \
                     with `--set 'output.formats=[\"{ending}\"]'`"
                )))
            }
        }
    }
}

/// The result of a conversion.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Converted {
    /// The files that were written, without the manifest.
    pub files: u64,
    /// Their bytes.
    pub bytes: u64,
    /// Notes about them, each sentence once.
    pub notes: Vec<String>,
}

/// Converts the frames of a folder into files of the same names in another folder, which has the tables of the run and a manifest,
/// too. One frame is in memory at a time, whose numbers may take `memory` bytes. `goes_on` is asked before each frame, and
/// ends the work by an error.
///
/// # Errors
/// [`Error::Input`] if the folder has no frames for the target, or one can't be read or held by the format; [`Error::Output`]
/// if a file can't be written, or is there already and may not be replaced; the errors of `goes_on`.
pub fn convert_folder(
    folder: &Folder,
    (out, overwrite): (&Path, bool),
    (target, step_m): (Target, f64),
    memory: u64,
    goes_on: &mut dyn FnMut() -> Result<(), Error>,
) -> Result<Converted, Error> {
    let real = |path: &Path| fs::canonicalize(path).ok();
    if real(folder.path()).is_some_and(|source| real(out) == Some(source)) {
        return Err(Error::output(
            out,
            "is the folder that is converted: its files are kept, so name another one",
        ));
    }
    let frames = frames(folder, target)?;
    let tables: Vec<&str> = folder.outputs().filter(|output| is_table(output)).collect();
    let mut names: BTreeSet<String> = frames.values().map(|(_, name)| name.clone()).collect();
    names.extend(tables.iter().map(|name| (*name).to_owned()));
    names.insert(Manifest::NAME.to_owned());
    let mut destination = Destination::check(out, Names(names), overwrite)?;
    destination.prepare(Manifest::NAME)?;
    let mut converted = Converted::default();
    let mut written = Vec::new();
    for (source, name) in frames.values() {
        goes_on()?;
        let recorded = folder.read(source, memory)?;
        let (file, notes) =
            target.encode(recorded, step_m).map_err(|e| Error::input(folder.path().join(source), e))?;
        for note in notes {
            if !converted.notes.contains(&note) {
                converted.notes.push(note);
            }
        }
        written.push(destination.write(name, &file)?);
    }
    for name in tables {
        written.push(destination.write(name, &folder.read_bytes(name, memory)?)?);
    }
    destination.flush();
    converted.files = written.len() as u64;
    converted.bytes = written.iter().map(|file| file.bytes).sum();
    written.sort_by(|a, b| a.path.cmp(&b.path));
    let head = head(folder, target)?;
    let mut manifest = Vec::new();
    Manifest::write(&head, written.into_iter(), std::iter::empty(), &mut manifest)
        .map_err(|e| Error::output(out.join(Manifest::NAME), e))?;
    destination.write(Manifest::NAME, &manifest)?;
    destination.flush();
    Ok(converted)
}

/// The file of each frame that is converted, and its new name.
fn frames(folder: &Folder, target: Target) -> Result<BTreeMap<FrameKey, (String, String)>, Error> {
    // The last of them tells the most.
    let endings: &[&str] = match target {
        Target::Cloud(_) => &CLOUD_ENDINGS,
        Target::Images(_) => &IMAGE_ENDINGS,
    };
    let mut frames = BTreeMap::new();
    for ending in endings {
        for output in folder.outputs() {
            let Some((key, end)) = FrameKey::of_file(output) else { continue };
            if end == *ending {
                let stem = &output[..output.len() - end.len()];
                frames.insert(key, (output.to_owned(), format!("{stem}{}", target.ending())));
            }
        }
    }
    if frames.is_empty() {
        let problem = match target {
            Target::Cloud(_) => {
                "has no clouds (PLY, PCD, NPY, LAS, LAZ), of which alone clouds can be made: images do not tell where their beams \
                 went, but `beamcast scan` writes clouds of the job again"
            }
            Target::Images(_) => "has no range images (EXR, NPZ), of which alone others can be made",
        };
        return Err(Error::input(folder.path(), problem));
    }
    Ok(frames)
}

/// Whether an output is a table of the run, such as `poses.csv`.
fn is_table(output: &str) -> bool {
    !output.contains('/') && [".csv", ".jsonl"].iter().any(|ending| output.ends_with(ending))
}

/// The manifest without its outputs: that of the folder, whose job names the format that the frames have now.
fn head(folder: &Folder, target: Target) -> Result<Value, Error> {
    const MOST_BYTES: u64 = 64 << 20;
    let bytes = folder.read_bytes(Manifest::NAME, MOST_BYTES)?;
    let head = read_manifest(&bytes[..], |_: Output| ());
    let mut head = head.map_err(|e| Error::input(folder.path().join(Manifest::NAME), e))?;
    if let Some(output) =
        head.get_mut("job").and_then(|job| job.get_mut("output")).and_then(Value::as_object_mut)
    {
        output.insert("formats".to_owned(), json!([target.ending()]));
    }
    head["converted"] = json!({ "manifest": blake3::hash(&bytes).to_hex().to_string() });
    Ok(head)
}

/// The names of the files that are written.
#[derive(Debug)]
struct Names(BTreeSet<String>);

impl FileNames for Names {
    fn folders(&self) -> BTreeSet<String> {
        self.0.iter().filter_map(|name| Some(name.rsplit_once('/')?.0.to_owned())).collect()
    }

    fn contains(&self, name: &str) -> bool {
        self.0.contains(name)
    }
}
