//! Reading of MCAP (<https://mcap.dev/spec>), the container of ROS 2 bags: the topics of a recording, with the types, the numbers and the
//! times of their messages, and any message by its number.
//!
//! The records are counted, and neither the statistics nor the index at the end of the file, which a recording that was cut off lacks.
//! A chunk is in memory at a time.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fmt;
use std::io::{self, Read, Seek, SeekFrom};
use std::panic::catch_unwind;

use lz4_flex::frame::FrameDecoder;
use ruzstd::decoding::StreamingDecoder;

use super::error::ReadError;

/// A file that is read here and there.
pub trait Source: Read + Seek + Send {}

impl<F: Read + Seek + Send> Source for F {}

/// A recording.
pub(super) struct Mcap {
    file: Box<dyn Source>,
    memory: u64,
    /// The topics, by their names.
    pub topics: Vec<Topic>,
    /// The places of the messages of each topic, in the order of the file, so that those who read one after the other unpack each chunk
    /// once. Those that are not read have none.
    places: Vec<Vec<Place>>,
    /// Whether the file ends as MCAP demands. A recording that was cut off has what comes before.
    pub is_whole: bool,
    /// The chunk that was read last, with its place.
    chunk: Option<(u64, Vec<u8>)>,
}

impl fmt::Debug for Mcap {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Mcap").field("topics", &self.topics).finish_non_exhaustive()
    }
}

/// The messages of a channel.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Topic {
    /// The name, such as `/points`.
    pub name: String,
    /// The type of the messages, such as `sensor_msgs/msg/PointCloud2`. It is empty if the file has none.
    pub kind: String,
    /// The encoding of the messages, such as `cdr`.
    pub encoding: String,
    /// The number of messages.
    pub messages: u64,
    /// The bytes of all messages.
    pub bytes: u64,
    /// The times of the first and the last message, in nanoseconds of the recording's clock, as far as there are any.
    pub times_ns: Option<[u64; 2]>,
}

/// The place of a message.
#[derive(Clone, Copy, Debug)]
struct Place {
    /// The first byte of the content of the record, in the file: of the message, or of the chunk that it is in.
    at: u64,
    /// The bytes of that content.
    length: u64,
    /// The first byte of the message's own in the unpacked chunk. `None` if it is in none.
    inside: Option<u64>,
    /// The message's own bytes.
    bytes: u64,
}

const MAGIC: &[u8] = b"\x89MCAP0\r\n";
/// The bytes before the content of a record.
const OPCODE_AND_LENGTH: usize = 9;

/// The bytes of a message before its own: the channel, a number, and two times.
const MESSAGE_HEAD: u64 = 22;

const FOOTER: u8 = 0x02;
const SCHEMA: u8 = 0x03;
const CHANNEL: u8 = 0x04;
const MESSAGE: u8 = 0x05;
const CHUNK: u8 = 0x06;

impl Mcap {
    /// Finds the topics of a recording, and the messages of those whose type `is_read`. Chunks may be compressed by Zstandard or LZ4. A
    /// chunk, as any record but a message, may take `memory` bytes, packed and again unpacked, and so may the places of messages; more
    /// is not in memory at a time.
    ///
    /// # Errors
    /// A [`ReadError`] if the file can't be read or is no MCAP, if a record is broken or takes more memory, or if a chunk is compressed by something
    /// else.
    pub fn open(
        mut file: Box<dyn Source>,
        memory: u64,
        is_read: fn(&str) -> bool,
    ) -> Result<Self, ReadError> {
        let mut magic = [0; MAGIC.len()];
        let mut buffered = io::BufReader::new(&mut file);
        if !read_whole(&mut buffered, &mut magic)? || magic != *MAGIC {
            return Err(ReadError::new("this is no MCAP"));
        }
        let mut found =
            Found { schemas: BTreeMap::new(), channels: BTreeMap::new(), places: 0, memory, is_read };
        let is_whole = found.add_file(&mut buffered)?;
        drop(buffered);
        let mut channels: Vec<Channel> = found.channels.into_values().collect();
        for channel in &mut channels {
            channel.topic.kind = found.schemas.get(&channel.schema).cloned().unwrap_or_default();
        }
        channels.sort_by(|a, b| a.topic.name.cmp(&b.topic.name));
        let (topics, places) = channels.into_iter().map(|channel| (channel.topic, channel.places)).unzip();
        Ok(Self { file, memory, topics, places, is_whole, chunk: None })
    }

    /// The number of messages of a topic that can be read: all, or none.
    pub fn readable(&self, topic: usize) -> u64 {
        self.places.get(topic).map_or(0, |places| places.len() as u64)
    }

    /// The bytes of a message by its number in the order of the file, which is that of recording.
    ///
    /// # Errors
    /// A [`ReadError`] if there is none, if it takes more memory, or if the file has changed since it was opened.
    pub fn message(&mut self, topic: usize, number: u64) -> Result<Vec<u8>, ReadError> {
        let of_topic = self.places.get(topic).into_iter().flatten();
        let place = of_topic.copied().nth(usize::try_from(number).unwrap_or(usize::MAX));
        let place = place.ok_or_else(|| ReadError::new(format!("there is no message {number}")))?;
        let changed = || ReadError::new("it has changed while it was read");
        ReadError::check_memory(place.bytes, self.memory)?;
        let Some(inside) = place.inside else {
            return self.content(place.at.saturating_add(MESSAGE_HEAD), place.bytes);
        };
        if self.chunk.as_ref().is_none_or(|(at, _)| *at != place.at) {
            self.chunk = None;
            let packed = self.content(place.at, place.length)?;
            self.chunk = Some((place.at, unpacked_chunk(&mut Fields(&packed), self.memory)?.into_owned()));
        }
        let (_, chunk) = self.chunk.as_ref().ok_or_else(changed)?;
        let range =
            usize::try_from(inside).ok().zip(usize::try_from(inside.saturating_add(place.bytes)).ok());
        let bytes = range.and_then(|(start, end)| chunk.get(start..end)).ok_or_else(changed)?;
        Ok(bytes.to_vec())
    }

    /// Bytes of the file.
    fn content(&mut self, at: u64, length: u64) -> Result<Vec<u8>, ReadError> {
        let mut content = Vec::new();
        self.file.seek(SeekFrom::Start(at)).map_err(unreadable)?;
        self.file.by_ref().take(length).read_to_end(&mut content).map_err(unreadable)?;
        match content.len() as u64 == length {
            true => Ok(content),
            false => Err(ReadError::new("it has changed while it was read")),
        }
    }
}

fn unreadable(error: io::Error) -> ReadError {
    ReadError::new(format!("can't be read: {error}"))
}

/// Fills the buffer, unless the file ends before.
fn read_whole(file: &mut impl Read, buffer: &mut [u8]) -> Result<bool, ReadError> {
    match file.read_exact(buffer) {
        Ok(()) => Ok(true),
        Err(e) if e.kind() == io::ErrorKind::UnexpectedEof => Ok(false),
        Err(e) => Err(unreadable(e)),
    }
}

/// What was found so far, by the numbers of schemas and channels.
struct Found {
    schemas: BTreeMap<u16, String>,
    channels: BTreeMap<u16, Channel>,
    /// The places of all channels.
    places: u64,
    memory: u64,
    is_read: fn(&str) -> bool,
}

/// A channel with its messages.
struct Channel {
    schema: u16,
    topic: Topic,
    places: Vec<Place>,
}

/// A record of the file, or of a chunk.
struct Record<'a> {
    opcode: u8,
    /// The content, of which a message in the file has its first bytes alone.
    content: &'a [u8],
    /// The bytes of the whole content.
    length: u64,
    /// The place and the length of the record of the file that it is in, and its place in the unpacked chunk.
    outer: (u64, u64),
    inside: Option<u64>,
}

impl Found {
    /// Adds the records of a file behind its first bytes. Gives whether it has its footer.
    fn add_file(&mut self, file: &mut impl Read) -> Result<bool, ReadError> {
        let memory = self.memory;
        let mut head = [0; OPCODE_AND_LENGTH];
        let mut at = MAGIC.len() as u64;
        while read_whole(file, &mut head)? {
            let (opcode, length) = opcode_and_length(head);
            at += OPCODE_AND_LENGTH as u64;
            // Of a message, and of what is not read, only the first bytes are kept, and a file has no more than its own.
            let kept = match opcode {
                SCHEMA | CHANNEL | CHUNK => length,
                _ => length.min(MESSAGE_HEAD),
            };
            let mut content = Vec::new();
            // One byte more than there may be tells that there are more.
            file.by_ref()
                .take(kept.min(memory.saturating_add(1)))
                .read_to_end(&mut content)
                .map_err(unreadable)?;
            if content.len() as u64 > memory.max(MESSAGE_HEAD) {
                ReadError::check_memory(length, memory)?;
            }
            let passed =
                io::copy(&mut file.by_ref().take(length - kept), &mut io::sink()).map_err(unreadable)?;
            if content.len() as u64 + passed < length {
                return Ok(false);
            }
            // What follows repeats schemas and channels, and has no messages.
            if opcode == FOOTER {
                return Ok(true);
            }
            match opcode {
                CHUNK => {
                    let records = unpacked_chunk(&mut Fields(&content), memory)?;
                    self.add_records(&records, (at, length))?;
                }
                _ => self.add_record(&Record {
                    opcode,
                    content: &content,
                    length,
                    outer: (at, length),
                    inside: None,
                })?,
            }
            // The file has as many bytes.
            at += length;
        }
        Ok(false)
    }

    /// Adds the records of a chunk.
    fn add_records(&mut self, records: &[u8], outer: (u64, u64)) -> Result<(), ReadError> {
        let mut rest = records;
        while let Some((head, after)) = rest.split_first_chunk::<OPCODE_AND_LENGTH>() {
            let (opcode, length) = opcode_and_length(*head);
            let split = usize::try_from(length).ok().and_then(|length| after.split_at_checked(length));
            let inside = (records.len() - after.len()) as u64;
            let (content, after) =
                split.filter(|_| opcode != CHUNK).ok_or_else(|| broken("record of a chunk"))?;
            self.add_record(&Record { opcode, content, length, outer, inside: Some(inside) })?;
            rest = after;
        }
        Ok(())
    }

    fn add_record(&mut self, record: &Record) -> Result<(), ReadError> {
        let mut fields = Fields(record.content);
        match record.opcode {
            SCHEMA => self.add_schema(&mut fields).ok_or_else(|| broken("schema")),
            CHANNEL => self.add_channel(&mut fields).ok_or_else(|| broken("channel")),
            MESSAGE => self.add_message(record),
            _ => Ok(()),
        }
    }

    fn add_schema(&mut self, fields: &mut Fields) -> Option<()> {
        let (number, name) = (fields.u16()?, fields.text()?);
        self.schemas.insert(number, name);
        Some(())
    }

    fn add_channel(&mut self, fields: &mut Fields) -> Option<()> {
        let (number, schema) = (fields.u16()?, fields.u16()?);
        let (name, encoding) = (fields.text()?, fields.text()?);
        // The channels of the summary are those of the data again.
        let topic = Topic { name, encoding, ..Topic::default() };
        self.channels.entry(number).or_insert(Channel { schema, topic, places: Vec::new() });
        Some(())
    }

    fn add_message(&mut self, record: &Record) -> Result<(), ReadError> {
        let mut fields = Fields(record.content);
        let mut head = || Some((fields.u16()?, fields.u32()?, fields.u64()?, fields.u64()?));
        let (number, _, time_ns, _) = head().ok_or_else(|| broken("message"))?;
        let Some(channel) = self.channels.get_mut(&number) else {
            return Err(ReadError::new(format!("a message is of channel {number}, which it does not have")));
        };
        let bytes = record.length - MESSAGE_HEAD;
        channel.topic.messages += 1;
        channel.topic.bytes = channel.topic.bytes.saturating_add(bytes);
        let [first, last] = channel.topic.times_ns.unwrap_or([time_ns; 2]);
        channel.topic.times_ns = Some([first.min(time_ns), last.max(time_ns)]);
        // A type comes before the messages that are of it.
        if self.schemas.get(&channel.schema).is_some_and(|kind| (self.is_read)(kind)) {
            self.places += 1;
            // A vector that grows holds up to twice as many, and the old ones while they are moved.
            ReadError::check_memory(self.places.saturating_mul(3 * size_of::<Place>() as u64), self.memory)?;
            let ((at, length), inside) = (record.outer, record.inside.map(|inside| inside + MESSAGE_HEAD));
            channel.places.push(Place { at, length, inside, bytes });
        }
        Ok(())
    }
}

/// The records of a chunk.
fn unpacked_chunk<'a>(fields: &mut Fields<'a>, memory: u64) -> Result<Cow<'a, [u8]>, ReadError> {
    let mut head = || {
        let (_, _, length, _) = (fields.u64()?, fields.u64()?, fields.u64()?, fields.u32()?);
        let compression = fields.text()?;
        let packed = fields.u64()?;
        Some((length, compression, fields.0.get(..usize::try_from(packed).ok()?)?))
    };
    let (length, compression, packed) = head().ok_or_else(|| broken("chunk"))?;
    let unpack = match compression.as_str() {
        "" => return Ok(Cow::Borrowed(packed)),
        "zstd" => unpacked_by_zstd,
        "lz4" => unpacked_by_lz4,
        other => {
            return Err(ReadError::new(format!(
                "its chunks are compressed by {other:?}, and only zstd and lz4 are read: `mcap compress --compression zstd` changes that"
            )));
        }
    };
    ReadError::check_memory(length, memory)?;
    // This is the last line of defence.
    let records = catch_unwind(|| unpack(packed, length)).unwrap_or_default();
    let records = records.filter(|records| records.len() as u64 == length);
    records.map(Cow::Owned).ok_or_else(|| broken("compressed chunk"))
}

/// The bytes that Zstandard has packed, and no more than one above `length`. It takes no more memory than they have, and the window of the
/// frame, which the decoder limits to 100 MiB.
fn unpacked_by_zstd(packed: &[u8], length: u64) -> Option<Vec<u8>> {
    let mut records = Vec::new();
    StreamingDecoder::new(packed).ok()?.take(length.checked_add(1)?).read_to_end(&mut records).ok()?;
    Some(records)
}

/// The same of LZ4, whose frames have blocks of at most 8 MiB.
fn unpacked_by_lz4(packed: &[u8], length: u64) -> Option<Vec<u8>> {
    let mut records = Vec::new();
    FrameDecoder::new(packed).take(length.checked_add(1)?).read_to_end(&mut records).ok()?;
    Some(records)
}

fn opcode_and_length(head: [u8; OPCODE_AND_LENGTH]) -> (u8, u64) {
    let [opcode, length @ ..] = head;
    (opcode, u64::from_le_bytes(length))
}

fn broken(what: &str) -> ReadError {
    ReadError::new(format!("a {what} is broken"))
}

/// The fields of a record that are not read yet.
struct Fields<'a>(&'a [u8]);

impl<'a> Fields<'a> {
    fn bytes<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (bytes, rest) = self.0.split_first_chunk::<N>()?;
        self.0 = rest;
        Some(*bytes)
    }

    fn u16(&mut self) -> Option<u16> {
        self.bytes().map(u16::from_le_bytes)
    }

    fn u32(&mut self) -> Option<u32> {
        self.bytes().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Option<u64> {
        self.bytes().map(u64::from_le_bytes)
    }

    /// A text behind its length in 32 bits.
    fn text(&mut self) -> Option<String> {
        let length = self.u32()? as usize;
        let (text, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        String::from_utf8(text.to_vec()).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Cursor;

    use proptest::prelude::*;
    use ruzstd::encoding::{CompressionLevel, compress_to_vec};

    fn record(opcode: u8, parts: &[&[u8]]) -> Vec<u8> {
        let content = parts.concat();
        [&[opcode], &(content.len() as u64).to_le_bytes()[..], &content].concat()
    }

    fn text(text: &str) -> Vec<u8> {
        [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat()
    }

    fn message(channel: u16, time_ns: u64, bytes: usize) -> Vec<u8> {
        let times = [time_ns, time_ns].map(u64::to_le_bytes);
        record(MESSAGE, &[&channel.to_le_bytes(), &[0; 4], times.as_flattened(), &vec![7; bytes]])
    }

    fn open(bytes: &[u8], memory: u64) -> Result<Mcap, ReadError> {
        Mcap::open(Box::new(Cursor::new(bytes.to_vec())), memory, |kind| kind.ends_with("Header"))
    }

    fn chunk(compression: &str, records: &[u8]) -> Vec<u8> {
        let packed = match compression {
            "zstd" => compress_to_vec(records, CompressionLevel::Fastest),
            // A frame of LZ4: its magic number, version 1 with independent blocks of up to 64 KiB and the checksum of these two bytes;
            // a block of bytes as they are, by its highest bit; the end.
            "lz4" => {
                let length = records.len() as u32 | 1 << 31;
                let head = [0x04, 0x22, 0x4d, 0x18, 0x60, 0x40, 0x82];
                [&head[..], &length.to_le_bytes(), records, &[0; 4]].concat()
            }
            _ => records.to_vec(),
        };
        let length = (records.len() as u64).to_le_bytes();
        let packed_length = (packed.len() as u64).to_le_bytes();
        record(CHUNK, &[&[0; 16], &length, &[0; 4], &text(compression), &packed_length, &packed])
    }

    /// Two topics: one of three messages, of which one is in a chunk, and one of two in chunks.
    fn file(compression: &str) -> Vec<u8> {
        let schema = record(SCHEMA, &[&[1, 0], &text("std_msgs/msg/Header"), &text("ros2msg"), &text("x")]);
        let channel = |number: u8, topic: &str| {
            record(CHANNEL, &[&[number, 0, 1, 0], &text(topic), &text("cdr"), &text("")])
        };
        let inside =
            [schema, channel(1, "/b"), message(1, 20, 100), channel(2, "/a"), message(2, 30, 5)].concat();
        let second = [message(2, 10, 6)].concat();
        [
            MAGIC,
            &record(1, &[&text("ros2"), &text("")]),
            &chunk(compression, &inside),
            &message(1, 5, 1),
            &message(1, 50, 2),
            &chunk("", &second),
            &record(0x0f, &[&[0; 4]]),
            &record(FOOTER, &[&[0; 20]]),
            MAGIC,
        ]
        .concat()
    }

    #[test]
    fn topics_are_counted_inside_and_outside_of_chunks() {
        for compression in ["", "zstd", "lz4"] {
            let mut bag = open(&file(compression), u64::MAX).unwrap();
            let topic = |name: &str, messages, bytes, times_ns| Topic {
                name: name.to_owned(),
                kind: "std_msgs/msg/Header".to_owned(),
                encoding: "cdr".to_owned(),
                messages,
                bytes,
                times_ns: Some(times_ns),
            };
            assert_eq!(bag.topics, [topic("/a", 2, 11, [10, 30]), topic("/b", 3, 103, [5, 50])]);
            assert!(bag.is_whole);
            // In the order of the file, though not in that of time.
            let lengths = |bag: &mut Mcap, topic: usize| -> Vec<usize> {
                (0..bag.readable(topic)).map(|number| bag.message(topic, number).unwrap().len()).collect()
            };
            assert_eq!([0, 1].map(|topic| lengths(&mut bag, topic)), [vec![5, 6], vec![100, 1, 2]]);
            assert!(bag.message(1, 0).unwrap().iter().all(|byte| *byte == 7));
            assert_eq!(bag.message(1, 3).unwrap_err().to_string(), "there is no message 3");
        }
    }

    #[test]
    fn messages_of_other_types_have_no_place() {
        let bytes = file("");
        let mut bag = Mcap::open(Box::new(Cursor::new(bytes)), u64::MAX, |_| false).unwrap();
        assert_eq!((bag.readable(0), bag.topics[0].messages), (0, 2));
        assert!(bag.message(0, 0).is_err());
    }

    #[test]
    fn a_recording_that_was_cut_off_has_what_comes_before() {
        let whole = file("zstd");
        let bag = open(&whole[..whole.len() - 60], u64::MAX).unwrap();
        assert!(!bag.is_whole && bag.topics.len() == 2, "{bag:?}");
    }

    #[test]
    fn errors_name_the_problem() {
        let of = |bytes: &[u8], memory: u64| open(bytes, memory).unwrap_err().to_string();
        assert_eq!(of(b"\x89MCAP", 9), "this is no MCAP");
        assert!(
            of(&file("lzma"), u64::MAX)
                .starts_with("its chunks are compressed by \"lzma\", and only zstd and lz4 are read")
        );
        // The places of three messages take more than their bytes.
        assert!(of(&file(""), 400).ends_with("bytes of memory, more than the 400 that there are"));
        assert!(of(&file("zstd"), 60).ends_with("bytes of memory, more than the 60 that there are"));
        let alone = [MAGIC, &message(3, 0, 0)].concat();
        assert_eq!(of(&alone, 99), "a message is of channel 3, which it does not have");
        assert_eq!(of(&[MAGIC, &record(CHANNEL, &[&[0; 3]])].concat(), 99), "a channel is broken");
        assert_eq!(of(&[MAGIC, &chunk("", &chunk("", &[]))].concat(), 99), "a record of a chunk is broken");
    }

    proptest! {
        #[test]
        fn broken_bytes_are_an_error_or_a_bag(packed in 0..3_usize, at in 0.0..1.0, value: u8, keep in 0.0..2.0) {
            let mut bytes = file(["", "zstd", "lz4"][packed]);
            let at = (at * bytes.len() as f64) as usize;
            bytes[at] = value;
            bytes.truncate((keep * bytes.len() as f64) as usize);
            if let Ok(mut bag) = open(&bytes, 1 << 20) {
                prop_assert!(bag.topics.iter().all(|topic| (topic.messages == 0) == topic.times_ns.is_none()));
                for topic in 0..bag.topics.len() {
                    for number in 0..bag.readable(topic) {
                        prop_assert!(bag.message(topic, number).is_ok());
                    }
                }
            }
        }
    }
}
