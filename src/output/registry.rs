//! The registry of formats.

use std::fmt;
use std::hash::{Hash, Hasher};

use super::channel::{ChannelSpec, TERM_NAMES};
use super::format::{
    Asked, Content, Encode, EncodeError, FormatSpec, FrameFile, FramePath, Kind, LossyContent, RunFile,
    Stream,
};
use super::options::{Channels, OptionSpec, OptionValue, Options};
use super::points::{MOTION, TERMS};
use super::sensor_frame::SensorFrame;
use super::{
    color, depth16, e57, exr, kitti, labels, las, npy, npz, nuscenes, pcd, ply, png, poses, registered, ros,
    waveform,
};
use crate::sensor::Sensor;

/// Every format that a job can name, in the order in which lists show them.
pub static FORMATS: &[&FormatSpec] = &[
    &exr::FORMAT,
    &exr::deep::FORMAT,
    &ply::FORMAT,
    &png::FORMAT,
    &color::FORMAT,
    &depth16::FORMAT,
    &registered::FORMAT,
    &labels::LABELS,
    &labels::INSTANCES,
    &npz::FORMAT,
    &npy::FORMAT,
    &pcd::FORMAT,
    &las::LAS,
    &las::LAZ,
    &e57::FORMAT,
    &poses::FORMAT,
    &waveform::FORMAT,
    &kitti::FORMAT,
    &nuscenes::FORMAT,
    &ros::FORMAT,
];

/// A format with its options: all that says how a frame is written. Formats are equal if their names are, whatever their
/// options, because a job can name each once.
#[derive(Clone, Copy)]
pub struct Format {
    /// The declaration.
    pub spec: &'static FormatSpec,
    options: Options,
}

impl Format {
    /// OpenEXR range images of all channels.
    pub const EXR: Self = Self::of(&exr::FORMAT);
    /// Binary PLY point clouds.
    pub const PLY: Self = Self::of(&ply::FORMAT);
    /// Colour previews of the range.
    pub const PNG: Self = Self::of(&png::FORMAT);

    /// A format without options.
    pub const fn of(spec: &'static FormatSpec) -> Self {
        Self { spec, options: Options::none(spec.options) }
    }

    /// The format with a value for an option that it declares.
    #[must_use]
    pub fn with(mut self, option: &OptionSpec, value: impl Into<OptionValue>) -> Self {
        self.options.set(option, value);
        self
    }

    /// The format with these channels, if it is one that holds channels.
    #[must_use]
    pub fn with_channels(mut self, channels: Channels) -> Self {
        self.options.channels = channels;
        self
    }

    /// The format with the error budget of ranges, if it can hold that: as channels, or as fields of points.
    #[must_use]
    pub fn with_terms(mut self) -> Self {
        self.options.channels = self.options.channels.and(Channels::named(TERM_NAMES));
        match self.spec.options.iter().find(|option| option.name == TERMS.name) {
            Some(option) => self.with(option, 1.0),
            None => self,
        }
    }

    /// Whether the files tell the error budget of ranges.
    pub fn tells_terms(self) -> bool {
        let has_fields = self.spec.options.iter().any(|option| option.name == TERMS.name);
        self.holds_channels() && self.options.channels.iter().any(|channel| channel.name == TERM_NAMES[0])
            || has_fields && self.options.is_set(&TERMS)
    }

    /// Whether the format holds channels, so that a job can choose them.
    pub fn holds_channels(self) -> bool {
        matches!(self.spec.content, Content::Channels)
    }

    /// Whether the files tell the tracks of objects.
    pub fn tells_tracks(self) -> bool {
        let is_chosen = |channel: &ChannelSpec| channel.name == "id.track";
        self.holds_channels() && self.options.channels.iter().any(is_chosen) || self.has_motion()
    }

    fn has_motion(self) -> bool {
        self.spec.options.iter().any(|option| option.name == MOTION.name) && self.options.is_set(&MOTION)
    }

    /// Whether the files tell how surfaces move.
    pub fn tells_motion(self) -> bool {
        self.holds_channels() && self.options.channels.iter().any(ChannelSpec::is_of_motion)
            || self.has_motion()
    }

    /// Whether the files tell the waveforms of pulses, which a frame has only if they are asked for before it is cast
    /// ([`Frame::keep_waveforms`](crate::scan::Frame::keep_waveforms)).
    pub fn tells_waveforms(self) -> bool {
        self == Self::of(&waveform::FORMAT)
    }

    /// Whether the files tell the colours of surfaces.
    pub fn tells_colors(self) -> bool {
        [color::FORMAT.name, nuscenes::FORMAT.name].contains(&self.name())
            || self.holds_channels() && self.options.channels.iter().any(ChannelSpec::is_of_color)
    }

    /// Checks that the options that are given go together.
    ///
    /// # Errors
    /// An error that says which do not.
    pub fn check_options(self) -> Result<(), EncodeError> {
        (self.spec.check_options)(&self.options)
    }

    /// Every format of the registry.
    pub fn all() -> impl Iterator<Item = Self> {
        FORMATS.iter().map(|spec| Self::of(spec))
    }

    /// The format that a job calls `name`.
    pub fn named(name: &str) -> Option<Self> {
        Self::all().find(|format| format.name() == name)
    }

    /// The name in a job.
    pub fn name(self) -> &'static str {
        self.spec.name
    }

    /// The end of the names of the files, after a dot.
    pub fn ending(self) -> &'static str {
        self.spec.ending
    }

    /// The values of the options.
    pub fn options(&self) -> &Options {
        &self.options
    }

    /// The names of the files of a run: that to which frames are added, and then those beside it. A format that has a file for each
    /// frame has none.
    pub fn stream_files(self) -> Vec<String> {
        match self.spec.stream_files {
            _ if !self.is_of_run() => Vec::new(),
            [] => vec![format!("run.{}", self.ending())],
            names => names.iter().map(|name| (*name).to_owned()).collect(),
        }
    }

    /// Checks that the frames of `sensor` fit the format. It is meant to be asked before casting.
    ///
    /// # Errors
    /// An error that names the number of the sensor that the format cannot represent.
    pub fn check(self, sensor: &Sensor) -> Result<(), EncodeError> {
        if self.holds_channels() && self.options.channels.of(sensor).next().is_none() {
            let names: Vec<_> = self.options.channels.iter().map(|channel| channel.name).collect();
            return Err(EncodeError::new(format!("it has no channel {}", names.join(" or "))));
        }
        (self.spec.check)(sensor, &self.options)
    }

    /// Checks that a surface's label fits the format. It is meant to be asked before casting.
    ///
    /// # Errors
    /// An error that names the label and the largest that the format can hold.
    pub fn check_label(self, label: u32) -> Result<(), EncodeError> {
        let most = (self.spec.most_label)(&self.options);
        if label <= most {
            return Ok(());
        }
        Err(EncodeError::new(format!("its labels are at most {most}, and a surface has the label {label}")))
    }

    /// Checks that the ids of so many objects fit the format. It is meant to be asked before casting.
    ///
    /// # Errors
    /// An error that names the number and the largest that the format can hold.
    pub fn check_instances(self, count: usize) -> Result<(), EncodeError> {
        let most = (self.spec.most_instance)(&self.options);
        if count <= most as usize {
            return Ok(());
        }
        Err(EncodeError::new(format!(
            "its ids of objects are at most {most}, and the scene has {count} objects"
        )))
    }

    /// A sentence about what frames of a sensor may have and the files would lose. It is meant to be asked before casting.
    pub fn loses(self, sensor: &Sensor) -> Option<String> {
        (self.spec.loses)(sensor, &self.options)
    }

    /// An upper estimate of the memory that encoding takes, in bytes for each ray of `sensor`.
    pub fn encoding_bytes_a_ray(self, sensor: &Sensor) -> u64 {
        (self.spec.encoding_bytes_a_ray)(sensor, &self.options)
    }

    /// The size of the file for each ray that returns, before any compression, in bytes.
    pub fn file_bytes_a_ray(self, sensor: &Sensor) -> u64 {
        (self.spec.file_bytes_a_ray)(sensor, &self.options)
    }

    /// The number of files that a frame can have.
    pub fn frame_files(self) -> usize {
        match self.kind() {
            Kind::File(_) | Kind::LossyFile(_) => 1,
            Kind::Folder(folder) => folder.of_frame.len(),
            Kind::Stream(_) | Kind::Chosen(_) => 0,
        }
    }

    /// The declaration of one of the files that a frame can have.
    pub fn frame_file(self, file: usize) -> Option<FrameFile> {
        let encode = match self.kind() {
            Kind::File(encode) => Encode::Whole(encode),
            Kind::LossyFile(encode) => Encode::Lossy(encode),
            Kind::Folder(folder) => return folder.of_frame.get(file).copied(),
            _ => return None,
        };
        let path = FramePath { stem: "SENSOR/FRAME", ending: self.ending() };
        (file == 0).then_some(FrameFile { path, is_made: |_| true, encode })
    }

    /// The sensor and the digits of the frame that this path is a file of.
    pub fn frame_of(self, path: &str) -> Option<(&str, &str)> {
        let files = (0..self.frame_files()).filter_map(|file| self.frame_file(file));
        files.into_iter().find_map(|file| file.path.frame_of(path))
    }

    /// Whether the frames of a sensor have one of the files that a frame can have. `has_boxes` says whether the job asks for boxes.
    pub fn makes_frame_file(self, file: usize, sensor: &Sensor, has_boxes: bool) -> bool {
        let asked = Asked { sensor, options: &self.options, has_boxes };
        self.frame_file(file).is_some_and(|file| (file.is_made)(&asked))
    }

    /// Whether a run, or a sensor of it, has one of the files that are made at its end.
    pub fn makes_run_file(self, file: &RunFile, sensor: &Sensor, has_boxes: bool) -> bool {
        (file.is_made)(&Asked { sensor, options: &self.options, has_boxes })
    }

    /// The files that are made at a run's end.
    pub fn run_files(self) -> &'static [RunFile] {
        match self.kind() {
            Kind::Folder(folder) => folder.of_run,
            _ => &[],
        }
    }

    /// The facts of a frame that [`Self::run_files`] need. `None` if there are none.
    pub fn note(self, frame: &SensorFrame) -> Option<String> {
        match self.kind() {
            Kind::Folder(folder) => Some((folder.note)(frame, &self.options)),
            _ => None,
        }
    }

    /// The whole content of the file of one frame, or of the first of its files; of a format with one file for each run, that of a run
    /// of this frame alone.
    ///
    /// # Errors
    /// As [`Self::encode_file`].
    pub fn encode(self, frame: &SensorFrame) -> Result<Vec<u8>, EncodeError> {
        let Some(mut stream) = self.stream(&[frame.capture.sensor]) else {
            return self.encode_file(0, frame);
        };
        let mut file = Vec::new();
        stream.add(frame, &mut file)?;
        stream.finish(&mut file)?;
        let head = stream.head();
        file[..head.len()].copy_from_slice(&head);
        Ok(file)
    }

    /// The whole content of one of the files of a frame.
    ///
    /// # Errors
    /// An error if the frame has a number that the format cannot represent, such as a label above 2³¹ − 1 in a PLY, or if
    /// the format has one file for each run and so none for a single frame.
    pub fn encode_file(self, file: usize, frame: &SensorFrame) -> Result<Vec<u8>, EncodeError> {
        self.encode_counted(file, frame).map(|(content, _)| content)
    }

    /// [`Self::encode_file`], and the number of the frame's values that the file lost.
    ///
    /// # Errors
    /// As [`Self::encode_file`].
    pub fn encode_counted(self, file: usize, frame: &SensorFrame) -> Result<LossyContent, EncodeError> {
        match self.frame_file(file).map(|file| file.encode) {
            Some(Encode::Whole(encode)) => Ok((encode(frame, &self.options)?, 0)),
            Some(Encode::Lossy(encode)) => encode(frame, &self.options),
            None => Err(EncodeError::new(format!(
                "{} has one file for each run, and none for a single frame",
                self.name()
            ))),
        }
    }

    /// Whether all frames of a run go into one file.
    pub fn is_of_run(self) -> bool {
        matches!(self.kind(), Kind::Stream(_))
    }

    /// The file of a run of these sensors, before the first frame is added. `None` if each frame has a file of its own.
    pub fn stream(self, sensors: &[&Sensor]) -> Option<Box<dyn Stream>> {
        match self.kind() {
            Kind::Stream(stream) => Some(stream(sensors, &self.options)),
            _ => None,
        }
    }

    /// The way in which frames become files with the options that are given.
    fn kind(self) -> Kind {
        match self.spec.kind {
            Kind::Chosen(choose) => choose(&self.options),
            kind => kind,
        }
    }
}

impl PartialEq for Format {
    fn eq(&self, other: &Self) -> bool {
        self.name() == other.name()
    }
}

impl Eq for Format {}

impl Hash for Format {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.name().hash(state);
    }
}

impl fmt::Debug for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Format({:?})", self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::super::options::MOST_OPTIONS;
    use super::*;
    use std::collections::BTreeSet;

    #[test]
    fn each_format_has_a_name_of_its_own_that_a_file_can_end_in() {
        let names: BTreeSet<_> = Format::all().map(Format::name).collect();
        assert_eq!(names.len(), FORMATS.len());
        assert!(names.iter().all(|name| name.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit())));
        assert!(Format::all().all(|format| Format::named(format.name()) == Some(format)));
        assert_eq!(Format::named("EXR"), None);
        let is_folder = |format: &Format| matches!(format.spec.kind, Kind::Folder(_));
        let named = || Format::all().filter(|format| !is_folder(format));
        let endings: BTreeSet<_> = named().map(Format::ending).collect();
        assert_eq!(endings.len(), named().count());
        // The end of a file's name tells its format.
        let follows =
            |one: &&str, other: &&str| one.strip_suffix(*other).is_some_and(|rest| rest.ends_with('.'));
        for one in &endings {
            let shorter: Vec<_> = endings.iter().filter(|other| follows(one, other)).collect();
            assert!(shorter.iter().all(|other| !other.contains('.')), "{one} {shorter:?}");
        }
    }

    #[test]
    fn formats_are_declared_whole() {
        for format in Format::all() {
            let spec = format.spec;
            assert!(
                !spec.about.is_empty()
                    && !spec.read_by.is_empty()
                    && spec.ending.is_empty() == matches!(spec.kind, Kind::Folder(_)),
                "{format:?}"
            );
            assert!(spec.options.len() <= MOST_OPTIONS, "{format:?}");
            format.check_options().unwrap();
            for option in spec.options {
                assert!(option.about.ends_with('.') && !option.about.contains('|'), "{}", option.about);
            }
        }
    }
}
