//! The declaration of a format, which stands in the format's own file.

use std::io::{self, Write};

use super::options::{OptionSpec, Options};
use super::sensor_frame::SensorFrame;
use crate::sensor::Sensor;

/// The declaration of a format. The rest of the program knows nothing else about the format.
///
/// A declaration names what is special about a format, and takes the rest from [`FormatSpec::PLAIN`].
pub struct FormatSpec {
    /// The name in a job.
    pub name: &'static str,
    /// The end of the names of the files, after the frame's number and a dot. It is unlike that of every other format, so that
    /// two formats of one kind, such as PNGs of depth and PNGs of labels, can lie beside each other. A [`Kind::Folder`] names
    /// its files itself, and has none.
    pub ending: &'static str,
    /// The content of the files, in a few words for lists.
    pub about: &'static str,
    /// The meaning of the numbers in the files.
    pub content: Content,
    /// The programs that the files were read back with, exactly; for the page of formats.
    pub read_by: &'static str,
    /// The options that a job can give.
    pub options: &'static [OptionSpec],
    /// Checks that the options that are given go together.
    pub check_options: fn(&Options) -> Result<(), EncodeError>,
    /// Checks that the frames of a sensor fit the format at all. The error names the number of the sensor that the format
    /// cannot represent.
    pub check: fn(&Sensor, &Options) -> Result<(), EncodeError>,
    /// A sentence about what frames of a sensor may have and the format would lose, with what would hold it.
    pub loses: fn(&Sensor, &Options) -> Option<String>,
    /// The largest label of a surface that the files can hold.
    pub most_label: fn(&Options) -> u32,
    /// The largest id of an object that the files can hold.
    pub most_instance: fn(&Options) -> u32,
    /// The greatest memory that encoding takes for each ray of a sensor, in bytes.
    pub encoding_bytes_a_ray: fn(&Sensor, &Options) -> u64,
    /// The size of the file for each ray that returns, before any compression, in bytes.
    pub file_bytes_a_ray: fn(&Sensor, &Options) -> u64,
    /// The files of a run, as paths in its output folder: that to which frames are added, and then those that are written beside it
    /// at the end. Of a stream that names none it is `run.ENDING`.
    pub stream_files: &'static [&'static str],
    /// Whether the steps of points' coordinates do not grow with the distance from the origin, as those of 32-bit floats do.
    pub has_even_steps: bool,
    /// Whether a file of a whole run has the points of all frames in one cloud.
    pub merges_clouds: bool,
    /// The way in which frames become files.
    pub kind: Kind,
}

impl FormatSpec {
    /// The fields that most formats have in common: no options, and nothing that does not fit. The fields
    /// that each format sets itself are empty here.
    pub const PLAIN: Self = Self {
        name: "",
        ending: "",
        about: "",
        content: Content::Pixels(&[]),
        read_by: "",
        options: &[],
        check_options: |_| Ok(()),
        check: |_, _| Ok(()),
        loses: |_, _| None,
        most_label: |_| u32::MAX,
        most_instance: |_| u32::MAX,
        encoding_bytes_a_ray: |_, _| 0,
        file_bytes_a_ray: |_, _| 0,
        stream_files: &[],
        has_even_steps: false,
        merges_clouds: false,
        kind: Kind::File(|_, _| Ok(Vec::new())),
    };
}

/// The meaning of the numbers in the files of a format.
#[derive(Clone, Copy, Debug)]
pub enum Content {
    /// The channels that the job chooses, each an array of rows and columns.
    Channels,
    /// Points, each with these fields.
    Points(&'static [Field]),
    /// Pixels of rows and columns, each with these values.
    Pixels(&'static [Field]),
    /// Lines of text, each with these values.
    Lines(&'static [Field]),
    /// Arrays of their own shapes, one for each of these.
    Arrays(&'static [Field]),
    /// Files of several kinds, clouds of points among them, each at one of these paths.
    Files(&'static [Field]),
    /// Messages of several types, which this text in Markdown tells of.
    Messages(fn() -> String),
}

/// A field of a point, or a value of a pixel.
#[derive(Clone, Copy, Debug)]
pub struct Field {
    /// The name.
    pub name: &'static str,
    /// The type, in the format's own words.
    pub kind: &'static str,
    /// The unit, or the meaning of a number without one.
    pub unit: &'static str,
}

/// Declares a field.
pub(super) const fn field(name: &'static str, kind: &'static str, unit: &'static str) -> Field {
    Field { name, kind, unit }
}

/// The content of a file, and the number of the frame's values that it lost.
pub type LossyContent = (Vec<u8>, u64);

/// The way in which frames become files. The same frames give the same bytes, on any number of threads and any platform.
#[derive(Clone, Copy)]
pub enum Kind {
    /// One file for each frame. The function returns the content of the whole file.
    ///
    /// The error names the number of the frame that the format cannot represent, such as a label above 2³¹ − 1 in a PLY.
    File(fn(&SensorFrame, &Options) -> Result<Vec<u8>, EncodeError>),
    /// One file for each frame, which may lose some of the frame's values. With the content the function returns their number.
    LossyFile(fn(&SensorFrame, &Options) -> Result<LossyContent, EncodeError>),
    /// One file for each run, to which all frames of all sensors are added in order, as in bags and in clouds of a whole
    /// drive. The function is told of all the sensors.
    Stream(fn(&[&Sensor], &Options) -> Box<dyn Stream>),
    /// Several files for each frame, and files that are made at the run's end: a folder as the tools of a data set expect it.
    Folder(Folder),
    /// One of the other kinds, as the options say.
    Chosen(fn(&Options) -> Kind),
}

/// The files of a [`Kind::Folder`].
///
/// The facts of a frame that the run's files need are noted when the frame is finished, and are kept in the run's journal. So the files
/// are the same whether the run was parted, was resumed, or went through at once.
#[derive(Clone, Copy)]
pub struct Folder {
    /// The files of each frame.
    pub of_frame: &'static [FrameFile],
    /// The files of the run.
    pub of_run: &'static [RunFile],
    /// The facts of a frame that [`Self::of_run`] needs, as a line of text.
    pub note: fn(&SensorFrame, &Options) -> String,
}

/// The wishes of a job by which a folder has a file or does not have it.
#[derive(Clone, Copy)]
pub struct Asked<'a> {
    /// The sensor. For a file of all sensors it is any of them.
    pub sensor: &'a Sensor,
    /// The options of the format.
    pub options: &'a Options,
    /// Whether the job asks for the boxes of objects.
    pub has_boxes: bool,
}

/// A file that a frame becomes.
#[derive(Clone, Copy)]
pub struct FrameFile {
    /// The path in the output folder, in which `SENSOR` stands for the sensor's name and then `FRAME` for the frame's number.
    pub path: FramePath,
    /// Whether the frames of a sensor have it.
    pub is_made: fn(&Asked) -> bool,
    /// The way in which the frame becomes the file.
    pub encode: Encode,
}

/// The way in which a frame becomes one of its files.
#[derive(Clone, Copy)]
pub enum Encode {
    /// As [`Kind::File`].
    Whole(fn(&SensorFrame, &Options) -> Result<Vec<u8>, EncodeError>),
    /// As [`Kind::LossyFile`].
    Lossy(fn(&SensorFrame, &Options) -> Result<LossyContent, EncodeError>),
}

/// The path that the files of all frames have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FramePath {
    /// The path without its ending, in which `SENSOR` stands for the sensor's name and then `FRAME` for the frame's number.
    pub stem: &'static str,
    /// The ending, after a dot.
    pub ending: &'static str,
}

/// Stands for a sensor's name in paths.
pub(super) const SENSOR: &str = "SENSOR";

/// Stands for a frame's number in paths.
pub(super) const FRAME: &str = "FRAME";

impl FramePath {
    /// The path of a frame's file. `digits` is the frame's number with leading zeros.
    pub fn of(self, sensor: &str, digits: &str) -> String {
        format!("{}.{}", self.stem.replacen(FRAME, digits, 1).replacen(SENSOR, sensor, 1), self.ending)
    }

    /// The sensor and the digits of the frame whose file has this path. `None` if no frame's has.
    pub fn frame_of(self, path: &str) -> Option<(&str, &str)> {
        let (before, rest) = self.stem.split_once(SENSOR)?;
        let (between, after) = rest.split_once(FRAME)?;
        let stem = path.strip_suffix(self.ending)?.strip_suffix('.')?;
        let (sensor, digits) = stem.strip_prefix(before)?.strip_suffix(after)?.rsplit_once(between)?;
        let is_number = digits.len() >= LEAST_DIGITS && digits.bytes().all(|b| b.is_ascii_digit());
        (is_number && is_sensor(sensor)).then_some((sensor, digits))
    }
}

/// The fewest digits of a frame's number in the name of a file. A sequence of more frames has more in all its names, so that
/// names are in the order of numbers.
pub const LEAST_DIGITS: usize = 6;

/// Whether a text can be the name of a sensor's folder.
fn is_sensor(name: &str) -> bool {
    !name.contains(['/', '\\']) && !["", ".", ".."].contains(&name)
}

/// A file that is made at a run's end of what was noted of its frames.
#[derive(Clone, Copy, Debug)]
pub struct RunFile {
    /// The path in the output folder. If it begins with `SENSOR`, which stands for a sensor's name, there is one for each sensor.
    pub path: &'static str,
    /// Whether a run has it, or a sensor of it.
    pub is_made: fn(&Asked) -> bool,
    /// Writes the file.
    pub write: fn(&Notes, &mut dyn Write) -> Result<(), EncodeError>,
}

impl RunFile {
    /// Whether there is a file for each sensor, which has the notes of that sensor's frames.
    pub fn is_of_sensor(&self) -> bool {
        self.path.starts_with(SENSOR)
    }

    /// The path of a sensor's file, or of that of all sensors.
    pub fn path_of(&self, sensor: &str) -> String {
        self.path.replacen(SENSOR, sensor, 1)
    }

    /// The sensor whose file has this path; an empty text if the file is that of all sensors. `None` if the path is another's.
    pub fn sensor_of<'p>(&self, path: &'p str) -> Option<&'p str> {
        match self.path.strip_prefix(SENSOR) {
            Some(rest) => path.strip_suffix(rest).filter(|sensor| is_sensor(sensor)),
            None => (path == self.path).then_some(""),
        }
    }
}

/// The note of a frame.
#[derive(Clone, Debug)]
pub struct Note {
    /// The format's line of text.
    pub text: String,
    /// The paths of all files of the frame.
    pub files: Vec<String>,
}

/// The notes of a run's frames, in the order in which the frames start and at the same time in the order of sensors. They are
/// read anew each time that they are asked for, so that none are kept.
pub type Notes<'n> = dyn Fn() -> Result<Box<dyn Iterator<Item = Note> + 'n>, EncodeError> + 'n;

/// A file that grows frame by frame. The written part is not used before [`Stream::finish`].
pub trait Stream: Send {
    /// Adds a frame.
    ///
    /// # Errors
    /// An error if the frame has a number that the format cannot represent, or if the file cannot be written.
    fn add(&mut self, frame: &SensorFrame, file: &mut dyn Write) -> Result<(), EncodeError>;

    /// Writes the part of the file that follows the last frame.
    ///
    /// # Errors
    /// An error if the file cannot be written.
    fn finish(&mut self, file: &mut dyn Write) -> Result<(), EncodeError>;

    /// The contents of the files beside, in the order of [`FormatSpec::stream_files`], once the stream is finished.
    fn beside(&self) -> Vec<Vec<u8>> {
        Vec::new()
    }

    /// The bytes that replace the first ones of the finished file, where the beginning of a file tells what follows. Most
    /// formats have none.
    fn head(&self) -> Vec<u8> {
        Vec::new()
    }
}

/// The reason why a frame cannot be encoded in a format.
#[derive(Debug, thiserror::Error)]
#[error("{problem}")]
pub struct EncodeError {
    problem: String,
    source: Option<Box<dyn std::error::Error + Send + Sync>>,
}

impl EncodeError {
    /// An error that says which number the format cannot represent, and which would fit.
    pub fn new(problem: impl Into<String>) -> Self {
        Self { problem: problem.into(), source: None }
    }
}

impl From<io::Error> for EncodeError {
    fn from(error: io::Error) -> Self {
        Self { problem: format!("it can't be written: {error}"), source: Some(Box::new(error)) }
    }
}
