//! Recorded files in other formats: single ones, and every frame of a folder that a scan wrote.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::path::Path;

use serde_json::{Value, json};

use super::journal::is_of_a_run;
use super::remade::Remade;
use super::table::Table;
use crate::error::Error;
use crate::output::recorded::{
    Bag, CLOUD_ENDINGS, Folder, FrameKey, IMAGE_ENDINGS, Output, ReadError, Recorded, Wanted, read_manifest,
};
use crate::output::{
    CloudFormat, Destination, EncodeError, FileNames, Format, ImageFormat, LAS_SCALE, Manifest, WrittenFile,
    json_lines,
};
use crate::source::words::quoted;

/// A format that recorded files are written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[expect(clippy::large_enum_variant, reason = "a conversion has one target")]
pub enum Target {
    /// One of clouds.
    Cloud(CloudFormat),
    /// One of range images.
    Images(ImageFormat),
    /// One that frames are written in, and nothing else.
    Frame(Format),
}

/// The formats of frames that recorded images are written in, if the run's manifest tells the sensor, besides those of clouds.
const OF_FRAMES: [&str; 3] = ["e57", "png", "depth16"];

impl Target {
    /// The endings of all targets.
    pub fn endings() -> impl Iterator<Item = &'static str> {
        let clouds = CloudFormat::ALL.into_iter().map(|(_, ending)| ending);
        clouds.chain(ImageFormat::ALL.into_iter().map(|(_, ending)| ending)).chain(OF_FRAMES)
    }

    /// The target of an ending, which is the name of the format, too.
    pub fn of_ending(ending: &str) -> Option<Self> {
        let ending = ending.to_ascii_lowercase();
        let cloud = CloudFormat::of_ending(&ending).map(Self::Cloud);
        let images = || ImageFormat::of_ending(&ending).map(Self::Images);
        let frame = || {
            OF_FRAMES
                .iter()
                .find(|known| **known == ending)
                .and_then(|known| Format::named(known))
                .map(Self::Frame)
        };
        cloud.or_else(images).or_else(frame)
    }

    /// The name of the format.
    fn name(self) -> &'static str {
        Self::endings().find(|name| Self::of_ending(name) == Some(self)).unwrap_or_default()
    }

    /// The ending of files.
    fn ending(self) -> &'static str {
        match self {
            Self::Frame(format) => format.ending(),
            _ => self.name(),
        }
    }

    /// The format of frames that are made anew of images. A LAS has coordinates in steps of `step_m` metres.
    fn of_frame(self, step_m: f64) -> Option<Format> {
        match self {
            Self::Cloud(CloudFormat::Las | CloudFormat::Laz) => {
                Some(Format::named(self.name())?.with(&LAS_SCALE, step_m))
            }
            Self::Cloud(_) => Format::named(self.name()),
            Self::Frame(format) => Some(format),
            Self::Images(_) => None,
        }
    }

    /// The file of a recording, and what is to be known about it, in sentences. The coordinates of a LAS are steps of `step_m` metres.
    ///
    /// # Errors
    /// An [`EncodeError`] if the recording is of another kind than the format, or has what the format can't hold.
    pub fn encode(self, recorded: Recorded, step_m: f64) -> Result<(Vec<u8>, Vec<String>), EncodeError> {
        let name = self.name();
        match (self, recorded) {
            (Self::Cloud(format), Recorded::Cloud(cloud)) => format.encode(&cloud, step_m),
            (Self::Images(format), Recorded::Images(parts)) => Ok((format.encode(parts)?, Vec::new())),
            (Self::Images(_), _) => Err(EncodeError::new(format!(
                "is no range image, and does not tell which beams had no return: `beamcast scan` writes images of its job with \
                 `--set 'output.formats=[\"{name}\"]'`"
            ))),
            (_, Recorded::Images(_)) => Err(EncodeError::new(
                "is an image without a run's manifest, and does not tell where its beams went: in the folder that the scan wrote, it \
                 is converted by the sensor that the manifest there tells of",
            )),
            _ => Err(EncodeError::new(format!(
                "is no range image, and {name} is made of such alone: `beamcast scan` writes it of its job with \
                 `--set 'output.formats=[\"{name}\"]'`"
            ))),
        }
    }
}

/// What is in a file or a message, or in a frame of a folder, in another format. Of images, frames are made anew, if there is a manifest
/// that tells the sensors.
fn encode(
    order: &Order,
    recorded: Recorded,
    of_run: Option<(&Remade, &FrameKey)>,
) -> Result<(Vec<u8>, Vec<String>), EncodeError> {
    match (order.target.of_frame(order.step_m), of_run, recorded) {
        (Some(format), Some((remade, key)), Recorded::Images(parts)) => remade.encode(key, &parts, format),
        (_, _, recorded) => order.target.encode(recorded, order.step_m),
    }
}

/// Converts a file that was read. An image in the folder of its run is converted by the run's manifest.
///
/// # Errors
/// [`Error::Input`] if it has what the format can't hold, or if the manifest can't be read or does not tell the image's sensor.
pub fn convert_file(path: &Path, recorded: Recorded, order: &Order) -> Result<(Vec<u8>, Vec<String>), Error> {
    let needs_sensor =
        matches!(recorded, Recorded::Images(_)) && order.target.of_frame(order.step_m).is_some();
    let of_run = if needs_sensor { run_of(path)? } else { None };
    let of_run = of_run.as_ref().map(|(remade, key)| (remade, key));
    encode(order, recorded, of_run).map_err(|e| Error::input(path, e))
}

/// The run that a file is an output of, and its frame: its manifest is in the folder of the file, or in the one above.
fn run_of(path: &Path) -> Result<Option<(Remade, FrameKey)>, Error> {
    let Ok(path) = fs::canonicalize(path) else { return Ok(None) };
    for folder in path.ancestors().skip(1).take(2).filter(|folder| folder.join(Manifest::NAME).is_file()) {
        let folder = Folder::open(folder)?;
        let is_this = |output: &&str| folder.path().join(output) == path;
        if let Some((key, _)) = folder.outputs().find(is_this).and_then(FrameKey::of_file) {
            return Ok(Some((Remade::of(&folder)?, key)));
        }
    }
    Ok(None)
}

/// What is made of recordings, and where it goes.
#[derive(Clone, Copy, Debug)]
pub struct Order<'a> {
    /// The format.
    pub target: Target,
    /// The steps of the coordinates of a LAS, in metres.
    pub step_m: f64,
    /// The file or the folder.
    pub out: &'a Path,
    /// Whether files that are there may be replaced. What an earlier conversion or run has left in the folder is removed then.
    pub overwrite: bool,
    /// The bytes that the numbers of a frame may take.
    pub memory: u64,
}

/// The result of a conversion.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Converted {
    /// The files that were written, without the manifest, sorted by path.
    pub files: Vec<WrittenFile>,
    /// Notes about them, each sentence once.
    pub notes: Vec<String>,
}

impl Converted {
    /// The bytes of all files.
    pub fn bytes(&self) -> u64 {
        self.files.iter().map(|file| file.bytes).sum()
    }
}

/// Converts the frames of a folder into files of the same names in another folder, which has the tables of the run and a manifest,
/// too. One frame is in memory at a time. `goes_on` is asked before each frame, and ends the work by an error.
///
/// # Errors
/// [`Error::Input`] if the folder has no frames for the target, or one can't be read or held by the format; [`Error::Output`]
/// if a file can't be written, or is there already and may not be replaced; the errors of `goes_on`.
pub fn convert_folder(
    folder: &Folder,
    order: &Order,
    goes_on: &mut dyn FnMut() -> Result<(), Error>,
) -> Result<Converted, Error> {
    let real = |path: &Path| fs::canonicalize(path).ok();
    if real(folder.path()).is_some_and(|source| real(order.out) == Some(source)) {
        return Err(Error::output(
            order.out,
            "is the folder that is converted: its files are kept, so name another one",
        ));
    }
    let frames = frames(folder, order.target)?;
    let tables: Vec<&str> = folder.outputs().filter(|output| is_table(output)).collect();
    let remade = order.target.of_frame(order.step_m).map(|_| Remade::of(folder)).transpose()?;
    if let Some((key, (source, _))) = frames.first_key_value() {
        // What can't be converted at all is told before an older folder is replaced.
        let first =
            encode(order, folder.read(source, order.memory)?, remade.as_ref().map(|remade| (remade, key)));
        first.map_err(|e| Error::input(folder.path().join(source), e))?;
    }
    let names = frames.values().map(|(_, name)| name.clone());
    let mut writing = Writing::begin(order, names.chain(tables.iter().map(|name| (*name).to_owned())))?;
    for (key, (source, name)) in &frames {
        goes_on()?;
        let recorded = folder.read(source, order.memory)?;
        let encoded = encode(order, recorded, remade.as_ref().map(|remade| (remade, key)));
        writing.add(name, encoded.map_err(|e| Error::input(folder.path().join(source), e))?)?;
    }
    for name in tables {
        writing.add(name, (folder.read_bytes(name, order.memory)?, Vec::new()))?;
    }
    writing.finish(&head(folder, order.target)?)
}

/// Converts messages of a recording, which was opened by its path, into files of a folder, one for each: `roof/000012.pcd` is the message
/// 12 of `/roof/points`. The folder has a manifest, too. One message is in memory at a time. `goes_on` is asked before each, and ends
/// the work by an error.
///
/// # Errors
/// [`Error::Input`] if the recording has no such messages, has them of several topics and none is chosen, or if one can't be read or held
/// by the format; [`Error::Output`] as [`convert_folder`]; the errors of `goes_on`.
pub fn convert_bag(
    (bag, path): (&mut Bag, &Path),
    wanted: &Wanted,
    order: &Order,
    goes_on: &mut dyn FnMut() -> Result<(), Error>,
) -> Result<Converted, Error> {
    let unreadable = |e: ReadError| Error::input(path, e);
    let unfit = |e: EncodeError| Error::input(path, e);
    let (topic, numbers) = bag.wanted(wanted).map_err(unreadable)?;
    // What can't be converted at all is told before an older folder is replaced.
    let first = bag.read(topic, numbers.start).map_err(unreadable)?;
    order.target.encode(first.content.into(), order.step_m).map_err(unfit)?;
    let name = |bag: &Bag, number| format!("{}.{}", bag.key(topic, number), order.target.ending());
    let mut writing = Writing::begin(order, numbers.clone().map(|number| name(bag, number)))?;
    for number in numbers.clone() {
        goes_on()?;
        let message = bag.read(topic, number).map_err(unreadable)?;
        let encoded = order.target.encode(message.content.into(), order.step_m);
        writing.add(&name(bag, number), encoded.map_err(unfit)?)?;
    }
    let source = path.file_name().unwrap_or_default().to_string_lossy();
    let of = json!({ "recording": source, "topic": bag.topics()[topic].name, "messages": [numbers.start, numbers.end] });
    writing.finish(&json_lines(&json!({ "converted": of })))
}

/// Reads the only message of a recording that is wanted.
///
/// # Errors
/// [`Error::Input`] if there are several, or none, or it can't be read.
pub fn one_of_bag((bag, path): (&mut Bag, &Path), wanted: &Wanted) -> Result<Recorded, Error> {
    let unreadable = |e: ReadError| Error::input(path, e);
    let (topic, numbers) = bag.wanted(wanted).map_err(unreadable)?;
    let count = numbers.end - numbers.start;
    if count > 1 {
        let name = &bag.topics()[topic].name;
        return Err(unreadable(ReadError::new(format!(
            "has {count} messages of {}, and a file holds one: --frames N chooses it, and a folder as OUT with --format NAME takes all",
            quoted(name)
        ))));
    }
    Ok(bag.read(topic, numbers.start).map_err(unreadable)?.content.into())
}

/// The files of a folder that are written one by one.
struct Writing {
    destination: Destination,
    converted: Converted,
}

impl Writing {
    /// Begins a folder with files of these names.
    fn begin(order: &Order, names: impl Iterator<Item = String>) -> Result<Self, Error> {
        let names = names.chain([Manifest::NAME.to_owned()]).collect();
        let mut destination = Destination::check(order.out, Names(names), order.overwrite)?;
        let mut old = Vec::new();
        if let (true, Ok(manifest)) = (order.overwrite, File::open(order.out.join(Manifest::NAME))) {
            // A manifest that can't be read lists nothing more that could be removed.
            let _ = read_manifest(manifest, |output| old.push(output.path));
        }
        destination.prepare(Manifest::NAME)?;
        // A manifest is a file that anybody may have written, and no other file goes because of it.
        old.iter().filter(|name| is_of_a_run(name)).try_for_each(|name| destination.remove_old(name))?;
        Ok(Self { destination, converted: Converted::default() })
    }

    /// Writes a file, and keeps what is to be known about it.
    fn add(&mut self, name: &str, (file, notes): (Vec<u8>, Vec<String>)) -> Result<(), Error> {
        self.converted.files.push(self.destination.write(name, &file)?);
        for note in notes {
            if !self.converted.notes.contains(&note) {
                self.converted.notes.push(note);
            }
        }
        Ok(())
    }

    /// Writes the manifest, which makes the folder complete.
    fn finish(self, head: &str) -> Result<Converted, Error> {
        let Self { destination, mut converted } = self;
        destination.flush();
        converted.files.sort_by(|a, b| a.path.cmp(&b.path));
        let mut manifest = Vec::new();
        Manifest::write(head, converted.files.iter().cloned(), std::iter::empty(), &mut manifest)
            .map_err(|e| Error::output(destination.folder().join(Manifest::NAME), e))?;
        destination.write(Manifest::NAME, &manifest)?;
        destination.flush();
        Ok(converted)
    }
}

/// The file of each frame that is converted, and its new name.
fn frames(folder: &Folder, target: Target) -> Result<BTreeMap<FrameKey, (String, String)>, Error> {
    // The last of them tells the most. A cloud that was written is as it was asked for; one that is made of an image follows the rest.
    let endings: Vec<&str> = match target {
        Target::Cloud(_) => IMAGE_ENDINGS.into_iter().chain(CLOUD_ENDINGS).collect(),
        Target::Images(_) | Target::Frame(_) => IMAGE_ENDINGS.to_vec(),
    };
    let mut frames = BTreeMap::new();
    for ending in &endings {
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
                "has neither clouds (PLY, PCD, NPY, LAS, LAZ, E57) nor range images (EXR, NPZ), of which clouds can be made"
            }
            _ => "has no range images (EXR, NPZ), of which alone others can be made",
        };
        return Err(Error::input(folder.path(), problem));
    }
    Ok(frames)
}

/// Whether an output is a table of the run that has rows of its frames, such as `poses.csv`. Those of formats belong to the files of these.
fn is_table(output: &str) -> bool {
    Table::named(output).is_some_and(|table| table.has_rows())
}

/// The manifest without its outputs: that of the folder, whose job names the format that the frames have now.
fn head(folder: &Folder, target: Target) -> Result<String, Error> {
    const MOST_BYTES: u64 = 64 << 20;
    let bytes = folder.read_bytes(Manifest::NAME, MOST_BYTES)?;
    let head = read_manifest(&bytes[..], |_: Output| ());
    let mut head = head.map_err(|e| Error::input(folder.path().join(Manifest::NAME), e))?;
    if let Some(output) =
        head.get_mut("job").and_then(|job| job.get_mut("output")).and_then(Value::as_object_mut)
    {
        output.insert("formats".to_owned(), json!([target.name()]));
    }
    head["converted"] = json!({ "manifest": blake3::hash(&bytes).to_hex().to_string() });
    Ok(json_lines(&head))
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
