//! The two sides of a comparison: recorded files, or the frames of a job. Their frames are read or cast one at a time.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::plan::{Item, Plan};
use super::session::Session;
use crate::error::Error;
use crate::output::Image;
use crate::output::recorded::{
    Bag, CLOUD_ENDINGS, Cloud, Folder, FrameKey, IMAGE_ENDINGS, Part, Recorded, Wanted,
};
use crate::scan::Progress;
use crate::source::words::joined;

/// One side of a comparison.
pub struct Side {
    source: Source,
    /// What labels stand for, in words, as far as the side tells.
    pub labels: BTreeMap<u32, String>,
}

/// Where the frames of a side come from.
enum Source {
    /// A file that was read, with its images or its cloud by name.
    File(Vec<(String, Content)>),
    /// A folder of recorded frames, with the file of each.
    Folder { folder: Box<Folder>, files: BTreeMap<FrameKey, String>, memory: u64 },
    /// A recording, with the messages of a topic by the names of frames.
    Bag { bag: Box<Bag>, path: PathBuf, topic: usize, messages: BTreeMap<FrameKey, u64> },
    /// A job, whose frames are cast when they are asked for.
    Job { session: Box<Session>, items: BTreeMap<FrameKey, Item>, allowed_folders: Vec<PathBuf> },
}

/// An image or a cloud.
pub enum Content {
    /// An image.
    Image(Image),
    /// A cloud.
    Cloud(Cloud),
}

/// The frames of two sides that are compared, and those that only one of them has.
#[derive(Debug, Default)]
pub struct Pairing {
    /// The names by which frames are told, each with those of the two sides.
    pub pairs: Vec<(String, [FrameKey; 2])>,
    /// The frames that only the first, and only the second side has.
    pub only: [Vec<FrameKey>; 2],
}

impl Side {
    /// Opens a range image, a cloud, a recording or the folder that a scan wrote. The numbers of one frame may take `memory` bytes. Of a
    /// folder or a recording, those frames count that are wanted.
    ///
    /// # Errors
    /// [`Error::Input`] if a file can't be read, if the folder has neither images nor clouds, or if the recording has several topics of them and
    /// none is chosen.
    pub fn of_recording(path: &Path, wanted: &Wanted, memory: u64) -> Result<Self, Error> {
        let single = match Recorded::open(path, memory)? {
            Recorded::Folder(folder) => {
                let labels = folder.manifest.label_names();
                let mut files: BTreeMap<FrameKey, String> = BTreeMap::new();
                // A cloud says nothing that the image of the same frame doesn't say.
                for ending in CLOUD_ENDINGS.into_iter().chain(IMAGE_ENDINGS) {
                    for output in folder.outputs() {
                        let Some((key, end)) = FrameKey::of_file(output) else { continue };
                        if end == ending && key.frame().is_none_or(|frame| wanted.frames.contains(&frame)) {
                            files.insert(key, output.to_owned());
                        }
                    }
                }
                if files.is_empty() {
                    return Err(Error::input(
                        path,
                        "has neither images (EXR, NPZ) nor clouds (PLY, PCD, NPY, LAS, LAZ, E57) of such frames",
                    ));
                }
                return Ok(Self { source: Source::Folder { folder, files, memory }, labels });
            }
            Recorded::Bag(mut bag) => {
                let (topic, numbers) = bag.wanted(wanted).map_err(|e| Error::input(path, e))?;
                let messages = numbers.map(|number| (bag.key(topic, number), number)).collect();
                let source = Source::Bag { bag, path: path.to_path_buf(), topic, messages };
                return Ok(Self { source, labels: BTreeMap::new() });
            }
            single => single,
        };
        let labels = match &single {
            Recorded::Images(parts) => parts.iter().flat_map(Part::labels).collect(),
            Recorded::Cloud(cloud) => cloud.labels(),
            Recorded::Bag(_) | Recorded::Folder(_) => BTreeMap::new(),
        };
        Ok(Self { source: Source::File(contents(single)), labels })
    }

    /// The frames of a plan of a session's job. The scenes that the job draws may read files from the allowed folders, too.
    pub fn of_session(session: Session, plan: &Plan, allowed_folders: Vec<PathBuf>) -> Self {
        let labels = session.label_names();
        let key = |item: &Item| FrameKey::new(&session.sensor(item).name, item.frame);
        let items = plan.items(&session.job).map(|item| (key(&item), item)).collect();
        Self { source: Source::Job { session: Box::new(session), items, allowed_folders }, labels }
    }

    /// The names of the frames, in order.
    fn keys(&self) -> BTreeSet<FrameKey> {
        match &self.source {
            Source::File(_) => BTreeSet::from([FrameKey::default()]),
            Source::Folder { files, .. } => files.keys().cloned().collect(),
            Source::Bag { messages, .. } => messages.keys().cloned().collect(),
            Source::Job { items, .. } => items.keys().cloned().collect(),
        }
    }

    /// The images or the cloud of a frame, each with what its name has beyond the frame's: of a further return, `:return1`. `None` when
    /// `progress` was cancelled.
    ///
    /// # Errors
    /// [`Error::Input`] if the frame's file can't be read, and those of [`Session::of_frame`].
    pub fn read(
        &mut self,
        key: &FrameKey,
        progress: &Progress,
    ) -> Result<Option<Vec<(String, Content)>>, Error> {
        match &mut self.source {
            Source::File(contents) => Ok(Some(std::mem::take(contents))),
            Source::Folder { folder, files, memory } => match files.get(key) {
                Some(file) => Ok(Some(contents(folder.read(file, *memory)?))),
                None => Ok(Some(Vec::new())),
            },
            Source::Bag { bag, path, topic, messages } => {
                let Some(number) = messages.get(key) else { return Ok(Some(Vec::new())) };
                let message = bag.read(*topic, *number).map_err(|e| Error::input(&*path, e))?;
                Ok(Some(contents(message.content.into())))
            }
            Source::Job { session, items, allowed_folders } => {
                let Some(item) = items.get(key) else { return Ok(Some(Vec::new())) };
                let session = session.of_frame(item.frame, allowed_folders)?;
                let Some(frame) = session.cast(item, progress) else { return Ok(None) };
                let seen = session.sensor_frame(item, &frame);
                let image = |number| Content::Image(Image::of_return(&seen, number).without_repeats());
                let name = |number| if number == 0 { String::new() } else { format!(":return{number}") };
                let all = 0..frame.most_returns().max(1);
                Ok(Some(all.map(|number| (name(number), image(number))).collect()))
            }
        }
    }

    /// Pairs the frames of two sides by name, or the only frame of one with the only frame of the other. `paths` name the sides.
    ///
    /// # Errors
    /// [`Error::Input`] if the sides have no frame in common.
    pub fn pair(&self, other: &Self, paths: [&Path; 2]) -> Result<Pairing, Error> {
        let (keys, others) = (self.keys(), other.keys());
        let alone = |keys: &BTreeSet<FrameKey>| if keys.len() == 1 { keys.first().cloned() } else { None };
        if let (Some(key), Some(other)) = (alone(&keys), alone(&others)) {
            let name = if key.sensor().is_empty() { other.to_string() } else { key.to_string() };
            return Ok(Pairing { pairs: vec![(name, [key, other])], only: Default::default() });
        }
        let pairs: Vec<_> =
            keys.intersection(&others).map(|key| (key.to_string(), [key.clone(), key.clone()])).collect();
        let only: [Vec<FrameKey>; 2] =
            [keys.difference(&others).cloned().collect(), others.difference(&keys).cloned().collect()];
        if pairs.is_empty() {
            let [path, other_path] = paths;
            let problem = format!("has no {}, and {} does", frames_in_words(&only[0]), path.display());
            return Err(Error::input(other_path, problem));
        }
        Ok(Pairing { pairs, only })
    }
}

/// The images or the cloud of a file. The first image has an empty name.
fn contents(recorded: Recorded) -> Vec<(String, Content)> {
    match recorded {
        Recorded::Images(parts) => {
            let part = |(index, part): (usize, Part)| {
                let name = if index == 0 { String::new() } else { format!(":{}", part.name) };
                (name, Content::Image(part.image.without_repeats()))
            };
            parts.into_iter().enumerate().map(part).collect()
        }
        Recorded::Cloud(cloud) => vec![(String::new(), Content::Cloud(cloud))],
        Recorded::Bag(_) | Recorded::Folder(_) => Vec::new(),
    }
}

/// Names of frames in words, successive ones together: `roof/000003 to 000009 and left/000000`.
pub fn frames_in_words(keys: &[FrameKey]) -> String {
    const MOST: usize = 8;
    let mut runs: Vec<(&FrameKey, &FrameKey)> = Vec::new();
    for key in keys {
        match runs.last_mut() {
            Some((_, last))
                if last.sensor() == key.sensor()
                    && last.frame().and_then(|frame| frame.checked_add(1)) == key.frame()
                    && key.frame().is_some() =>
            {
                *last = key;
            }
            _ => runs.push((key, key)),
        }
    }
    let words = |(first, last): &(&FrameKey, &FrameKey)| match last.frame() {
        Some(end) if first != last => format!("{first} to {end:06}"),
        _ => first.to_string(),
    };
    let mut parts: Vec<String> = runs.iter().take(MOST).map(words).collect();
    if runs.len() > MOST {
        parts.push(format!("{} more runs of frames", runs.len() - MOST));
    }
    joined(&parts, "and")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn successive_frames_are_told_together() {
        let keys: Vec<FrameKey> = ["a/000003", "a/000004", "a/000005", "a/000009", "b/000010", "whole"]
            .map(FrameKey::of_stem)
            .into();
        assert_eq!(frames_in_words(&keys), "a/000003 to 000005, a/000009, b/000010 and whole");
        let many: Vec<FrameKey> = (0..30).map(|i| FrameKey::of_stem(&format!("a/{:06}", 2 * i))).collect();
        assert!(frames_in_words(&many).ends_with(", a/000014 and 22 more runs of frames"));
    }
}
