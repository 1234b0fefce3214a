//! The clouds and depth images of a recording, one message at a time.

use std::ops::Range;

use super::error::ReadError;
use super::frame_key::FrameKey;
use super::mcap::{Mcap, Source, Topic};
use super::ros::{Kind, Message, read_message};
use crate::source::words::{list, quoted};

/// A recording of clouds and depth images, such as a ROS 2 bag.
#[derive(Debug)]
pub struct Bag {
    mcap: Mcap,
    memory: u64,
}

/// The frames that are wanted of a folder or a recording.
#[derive(Clone, Debug)]
pub struct Wanted {
    /// Their numbers.
    pub frames: Range<u64>,
    /// Of a recording, the topic. `None` stands for the only one.
    pub topic: Option<String>,
}

impl Wanted {
    /// All frames.
    pub fn all() -> Self {
        Self { frames: 0..u64::MAX, topic: None }
    }
}

/// The frames of a topic: what its first message tells of all.
#[derive(Clone, Debug, PartialEq)]
pub struct TopicFrames {
    /// The first message.
    pub first: Message,
    /// The stamp of the last one, in nanoseconds of the recording's clock.
    pub last_stamp_ns: i64,
}

impl Bag {
    /// Opens an MCAP, with or without chunks, and with or without an index. A chunk of it and the numbers of a message may take `memory`
    /// bytes each.
    ///
    /// # Errors
    /// A [`ReadError`] if the file can't be read, is no MCAP, or is broken.
    pub fn open(file: impl Source + 'static, memory: u64) -> Result<Self, ReadError> {
        let mcap = Mcap::open(Box::new(file), memory, |kind| Kind::of(kind).is_some())?;
        Ok(Self { mcap, memory })
    }

    /// The topics, by their names.
    pub fn topics(&self) -> &[Topic] {
        &self.mcap.topics
    }

    /// Whether the file ends as MCAP demands. A recording that was cut off has what comes before.
    pub fn is_whole(&self) -> bool {
        self.mcap.is_whole
    }

    /// The topic of a name or, without one, the only topic with clouds or depth images.
    ///
    /// # Errors
    /// A [`ReadError`] that says which topics there are.
    pub fn choose(&mut self, name: Option<&str>) -> Result<usize, ReadError> {
        if let Some(topic) = self.topics().iter().position(|topic| Some(topic.name.as_str()) == name)
            && self.is_shown(topic)
        {
            return Ok(topic);
        }
        let readable = self.first_readable();
        let readable: Vec<usize> = readable.into_iter().filter(|topic| self.is_shown(*topic)).collect();
        let names = list(readable.iter().map(|topic| self.topics()[*topic].name.as_str()), "and");
        if let Some(name) = name {
            let is = match self.topics().iter().find(|topic| topic.name == name) {
                Some(topic) if topic.messages == 0 => "has no messages".to_owned(),
                Some(topic) => format!("is of {}", quoted(&topic.kind)),
                None => "is not in it".to_owned(),
            };
            let others = if readable.is_empty() {
                NOTHING.to_owned()
            } else {
                format!("its clouds and depth images are of {names}")
            };
            return Err(ReadError::new(format!("the topic {} {is}; {others}", quoted(name))));
        }
        match readable.as_slice() {
            [one] => Ok(*one),
            [] => Err(ReadError::new(NOTHING)),
            _ => Err(ReadError::new(format!(
                "has clouds or depth images of {names}: --topic NAME chooses one"
            ))),
        }
    }

    /// The topic that is wanted, and the numbers of its messages that are.
    ///
    /// # Errors
    /// Those of [`Bag::choose`], and a [`ReadError`] if the topic has none of these messages.
    pub fn wanted(&mut self, wanted: &Wanted) -> Result<(usize, Range<u64>), ReadError> {
        let topic = self.choose(wanted.topic.as_deref())?;
        let all = self.messages(topic);
        let numbers = wanted.frames.start..wanted.frames.end.min(all);
        if numbers.is_empty() {
            let name = quoted(&self.topics()[topic].name);
            return Err(ReadError::new(format!(
                "the topic {name} has no message {}: it has 0 to {}",
                numbers.start,
                all - 1
            )));
        }
        Ok((topic, numbers))
    }

    /// The first topics with messages that may be clouds or depth images. Of each, a message and its chunk are read, and a file may have
    /// tens of thousands.
    fn first_readable(&self) -> Vec<usize> {
        (0..self.topics().len()).filter(|topic| self.messages(*topic) > 0).take(MOST_TOPICS).collect()
    }

    /// Whether the messages of a topic are clouds or depth images. Of an image, its encoding says what it shows.
    fn is_shown(&mut self, topic: usize) -> bool {
        if self.messages(topic) == 0 {
            return false;
        }
        let kind = self.topics().get(topic).and_then(|topic| Kind::of(&topic.kind));
        kind.is_some_and(|kind| kind != Kind::Image || self.read(topic, 0).is_ok())
    }

    /// The number of messages of a topic that are read: all or none.
    pub fn messages(&self, topic: usize) -> u64 {
        self.mcap.readable(topic)
    }

    /// Reads a message of a topic, by its number in the order of recording.
    ///
    /// # Errors
    /// A [`ReadError`] that names the message, if there is none or it can't be read.
    pub fn read(&mut self, topic: usize, number: u64) -> Result<Message, ReadError> {
        let name = self.topics().get(topic).map(|topic| topic.name.clone()).unwrap_or_default();
        let of = |e: ReadError| ReadError::new(format!("message {number} of {}: {e}", quoted(&name)));
        let bytes = self.mcap.message(topic, number).map_err(of)?;
        let Topic { kind, encoding, .. } = &self.topics()[topic];
        let kind = Kind::of(kind).ok_or_else(|| of(ReadError::new("it is neither a cloud nor an image")))?;
        read_message(kind, encoding, &bytes, self.memory).map_err(of)
    }

    /// What the messages of each topic show. `None` of those that are no clouds and no depth images, or can't be read, and of all behind
    /// the first of very many.
    pub fn frames(&mut self) -> Vec<Option<TopicFrames>> {
        let mut frames: Vec<Option<TopicFrames>> = vec![None; self.topics().len()];
        for topic in self.first_readable() {
            frames[topic] = self.frames_of(topic);
        }
        frames
    }

    fn frames_of(&mut self, topic: usize) -> Option<TopicFrames> {
        let last = self.messages(topic).checked_sub(1)?;
        let first = self.read(topic, 0).ok()?;
        let last_stamp_ns = if last == 0 { first.stamp_ns } else { self.read(topic, last).ok()?.stamp_ns };
        Some(TopicFrames { first, last_stamp_ns })
    }

    /// The name of a message as a frame: of `/roof/points`, which is a topic of ours, that of the frames of the sensor `roof`.
    pub fn key(&self, topic: usize, number: u64) -> FrameKey {
        FrameKey::new(&sensor_of(self.topics().get(topic).map_or("", |topic| &topic.name)), number)
    }
}

/// The name of the sensor that a topic may be of: one of a folder, whatever the topic's own is, because files are named by it.
fn sensor_of(topic: &str) -> String {
    let name = topic.trim_matches('/');
    let name = ["/points", "/depth"].iter().find_map(|end| name.strip_suffix(end)).unwrap_or(name);
    let is_kept = |c: char| c.is_ascii_alphanumeric() || ['_', '-', '.'].contains(&c);
    let name: String = name.chars().map(|c| if is_kept(c) { c } else { '_' }).collect();
    if name.is_empty() || name.starts_with('.') { format!("topic{name}") } else { name }
}

/// The most topics that are looked into.
const MOST_TOPICS: usize = 64;

const NOTHING: &str = "it has neither clouds (PointCloud2, CustomMsg) nor depth images (32FC1, 16UC1)";

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_topic_names_a_file_outside_of_its_folder() {
        let names = [
            "/roof/points",
            "/camera/depth",
            "/velodyne_points",
            "/livox/lidar",
            "/",
            "/../../etc/x",
            "..",
            "a\\b:\0",
        ];
        let expected = [
            "roof",
            "camera",
            "velodyne_points",
            "livox_lidar",
            "topic",
            "topic.._.._etc_x",
            "topic..",
            "a_b__",
        ];
        assert_eq!(names.map(sensor_of), expected);
    }
}
