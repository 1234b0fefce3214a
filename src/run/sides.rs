//! The two sides of a comparison: recorded files, or the frames of a job.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use super::plan::Item;
use super::session::Session;
use crate::error::Error;
use crate::output::Image;
use crate::output::recorded::{Cloud, Part, Recorded};
use crate::scan::Frame;
use crate::source::words::joined;

/// The images and clouds of one side.
#[derive(Default)]
pub struct Side {
    /// The images and clouds by name. A single file has the empty name.
    contents: BTreeMap<String, Content>,
    /// What labels stand for, in words, as far as the side tells.
    pub labels: BTreeMap<u32, String>,
}

/// An image or a cloud.
pub enum Content {
    /// An image.
    Image(Image),
    /// A cloud.
    Cloud(Cloud),
}

/// A name, with the images or clouds that go by it on the two sides.
pub type Pair<'a> = (String, &'a Content, &'a Content);

impl Side {
    /// Reads an EXR, a PLY or the folder that a scan wrote, whose numbers may take `memory` bytes in all.
    ///
    /// # Errors
    /// [`Error::Input`] if a file can't be read, or if the folder has neither images nor clouds.
    pub fn of_recording(path: &Path, mut memory: u64) -> Result<Self, Error> {
        let mut side = Self::default();
        match Recorded::open(path, memory)? {
            Recorded::Folder(folder) => {
                side.labels = folder.manifest.label_names();
                let is = |output: &str, extension: &str| {
                    Path::new(output).extension().is_some_and(|e| e == extension)
                };
                let all: BTreeSet<&Path> = folder.outputs().map(Path::new).collect();
                let has_image = |cloud: &str| all.contains(Path::new(cloud).with_extension("exr").as_path());
                // A cloud says nothing that the image of the same frame doesn't say.
                let wanted = |output: &&str| is(output, "exr") || (is(output, "ply") && !has_image(output));
                for output in folder.outputs().filter(wanted) {
                    let frame = output.rsplit_once('.').map_or(output, |(stem, _)| stem);
                    let recorded = folder.read(output, memory)?;
                    memory = memory.saturating_sub(recorded.memory());
                    side.add_recorded(frame, recorded);
                }
                if side.contents.is_empty() {
                    return Err(Error::input(path, "has neither EXR images nor PLY clouds"));
                }
            }
            single => {
                side.labels = match &single {
                    Recorded::Exr(parts) => parts.iter().flat_map(Part::labels).collect(),
                    Recorded::Cloud(cloud) => cloud.labels(),
                    Recorded::Folder(_) => BTreeMap::new(),
                };
                side.add_recorded("", single);
            }
        }
        Ok(side)
    }

    /// Adds the images or the cloud of a file.
    fn add_recorded(&mut self, frame: &str, recorded: Recorded) {
        match recorded {
            Recorded::Exr(parts) => {
                for (index, part) in parts.into_iter().enumerate() {
                    let name = match index {
                        0 => frame.to_owned(),
                        _ => format!("{frame}:{}", part.name),
                    };
                    self.contents.insert(name, Content::Image(part.image.without_repeats()));
                }
            }
            Recorded::Cloud(cloud) => {
                self.contents.insert(frame.to_owned(), Content::Cloud(cloud));
            }
            Recorded::Folder(_) => {}
        }
    }

    /// A side for the frames of a job.
    pub fn of_session(session: &Session) -> Self {
        Self { contents: BTreeMap::new(), labels: session.label_names() }
    }

    /// Adds a frame that was cast, by the name of the file that it would be written to.
    pub fn add_frame(&mut self, session: &Session, item: &Item, frame: &Frame) {
        let image = Image::of(&session.sensor_frame(item, frame));
        let name = format!("{}/{:06}", session.sensor(item).name, item.frame);
        self.contents.insert(name, Content::Image(image.without_repeats()));
    }

    /// Bytes of memory that the numbers take.
    pub fn memory(&self) -> u64 {
        let of_content = |content: &Content| match content {
            Content::Image(image) => image.memory(),
            Content::Cloud(cloud) => cloud.memory(),
        };
        self.contents.values().map(of_content).sum()
    }

    /// Whether an image has a channel of that name, or a cloud a field.
    pub fn has(&self, field: &str) -> bool {
        self.contents.values().any(|content| match content {
            Content::Image(image) => image.channel(field).is_some(),
            Content::Cloud(cloud) => cloud.field(field).is_some(),
        })
    }

    /// Pairs two sides by name, or the only content of one with the only content of the other. `paths` name the sides.
    ///
    /// # Errors
    /// [`Error::Input`] if a side lacks a name that the other has.
    pub fn pairs<'a>(&'a self, other: &'a Self, paths: [&Path; 2]) -> Result<Vec<Pair<'a>>, Error> {
        let single =
            |side: &'a Self| if side.contents.len() == 1 { side.contents.first_key_value() } else { None };
        if let (Some((name, content)), Some((other_name, other))) = (single(self), single(other)) {
            let name = if name.is_empty() { other_name } else { name };
            return Ok(vec![(name.clone(), content, other)]);
        }
        let only = |one: &Self, other: &Self| -> Vec<String> {
            one.contents.keys().filter(|name| !other.contents.contains_key(*name)).cloned().collect()
        };
        let [path, other_path] = paths;
        for (lacking, path, other_path) in
            [(only(self, other), other_path, path), (only(other, self), path, other_path)]
        {
            if !lacking.is_empty() {
                let problem =
                    format!("has no {}, and {} does", joined(&lacking, "and"), other_path.display());
                return Err(Error::input(path, problem));
            }
        }
        Ok(self
            .contents
            .iter()
            .map(|(name, content)| (name.clone(), content, &other.contents[name]))
            .collect())
    }
}
