//! Reading of MCAP (<https://mcap.dev/spec>), the container of ROS 2 bags: the topics of a recording, with the types, the numbers and the
//! times of their messages.
//!
//! The records are counted, and not the statistics at the end of the file, which a recording that was cut off lacks. A chunk
//! is in memory at a time.

use std::collections::BTreeMap;
use std::io::{self, Read};
use std::panic::{AssertUnwindSafe, catch_unwind};

use ruzstd::decoding::StreamingDecoder;

use super::error::ReadError;

/// A recording.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Bag {
    /// The topics, by their names.
    pub topics: Vec<Topic>,
    /// Whether the file ends as MCAP demands. A recording that was cut off has what comes before.
    pub is_whole: bool,
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

/// Reads which topics a recording has. Chunks may be compressed by Zstandard. A chunk, as any record but a message, may take `memory` bytes,
/// packed and again unpacked, and more is not in memory at a time.
///
/// # Errors
/// A [`ReadError`] if the file can't be read or is no MCAP, if a record is broken or takes more memory, or if a chunk is compressed by something
/// else.
pub fn read_mcap(mut file: impl Read, memory: u64) -> Result<Bag, ReadError> {
    let mut magic = [0; MAGIC.len()];
    if !read_whole(&mut file, &mut magic)? || magic != *MAGIC {
        return Err(ReadError::new("this is no MCAP"));
    }
    let mut found = Found::default();
    let is_whole = found.add_file(&mut file, memory)?;
    let mut topics: Vec<Topic> = Vec::new();
    for (schema, mut topic) in found.channels.into_values() {
        topic.kind = found.schemas.get(&schema).cloned().unwrap_or_default();
        topics.push(topic);
    }
    topics.sort_by(|a, b| a.name.cmp(&b.name));
    Ok(Bag { topics, is_whole })
}

/// Fills the buffer, unless the file ends before.
fn read_whole(file: &mut impl Read, buffer: &mut [u8]) -> Result<bool, ReadError> {
    match file.read_exact(buffer) {
        Ok(()) => Ok(true),
        Err(e) if e.kind() == io::ErrorKind::UnexpectedEof => Ok(false),
        Err(e) => Err(ReadError::new(format!("can't be read: {e}"))),
    }
}

/// What was found so far, by the numbers of schemas and channels.
#[derive(Default)]
struct Found {
    schemas: BTreeMap<u16, String>,
    channels: BTreeMap<u16, (u16, Topic)>,
}

impl Found {
    /// Adds the records of a file. Gives whether it has its footer.
    fn add_file(&mut self, file: &mut impl Read, memory: u64) -> Result<bool, ReadError> {
        let mut head = [0; OPCODE_AND_LENGTH];
        while read_whole(file, &mut head)? {
            let (opcode, length) = opcode_and_length(head);
            // Of a message, and of what is not read, only the first bytes are kept, and a file has no more than its own.
            let kept = match opcode {
                SCHEMA | CHANNEL | CHUNK => length,
                _ => length.min(MESSAGE_HEAD),
            };
            let mut content = Vec::new();
            let unreadable = |e: io::Error| ReadError::new(format!("can't be read: {e}"));
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
                CHUNK => self.add_chunk(&mut Fields(&content), memory)?,
                _ => self.add_record(opcode, &content, length)?,
            }
        }
        Ok(false)
    }

    /// Adds the records of a chunk.
    fn add_records(&mut self, mut rest: &[u8]) -> Result<(), ReadError> {
        while let Some((head, after)) = rest.split_first_chunk::<OPCODE_AND_LENGTH>() {
            let (opcode, length) = opcode_and_length(*head);
            let split = usize::try_from(length).ok().and_then(|length| after.split_at_checked(length));
            let (content, after) =
                split.filter(|_| opcode != CHUNK).ok_or_else(|| broken("record of a chunk"))?;
            self.add_record(opcode, content, length)?;
            rest = after;
        }
        Ok(())
    }

    /// Adds a record of so many bytes, of which a message may lack the last ones.
    fn add_record(&mut self, opcode: u8, content: &[u8], length: u64) -> Result<(), ReadError> {
        let mut fields = Fields(content);
        match opcode {
            SCHEMA => self.add_schema(&mut fields).ok_or_else(|| broken("schema")),
            CHANNEL => self.add_channel(&mut fields).ok_or_else(|| broken("channel")),
            MESSAGE => self.add_message(&mut fields, length),
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
        self.channels.entry(number).or_insert((schema, Topic { name, encoding, ..Topic::default() }));
        Some(())
    }

    fn add_message(&mut self, fields: &mut Fields, length: u64) -> Result<(), ReadError> {
        let mut head = || Some((fields.u16()?, fields.u32()?, fields.u64()?, fields.u64()?));
        let (number, _, time_ns, _) = head().ok_or_else(|| broken("message"))?;
        let Some((_, topic)) = self.channels.get_mut(&number) else {
            return Err(ReadError::new(format!("a message is of channel {number}, which it does not have")));
        };
        topic.messages += 1;
        topic.bytes = topic.bytes.saturating_add(length - MESSAGE_HEAD);
        let [first, last] = topic.times_ns.unwrap_or([time_ns; 2]);
        topic.times_ns = Some([first.min(time_ns), last.max(time_ns)]);
        Ok(())
    }

    fn add_chunk(&mut self, fields: &mut Fields, memory: u64) -> Result<(), ReadError> {
        let mut head = || {
            let (_, _, length, _) = (fields.u64()?, fields.u64()?, fields.u64()?, fields.u32()?);
            let compression = fields.text()?;
            let packed = fields.u64()?;
            Some((length, compression, fields.0.get(..usize::try_from(packed).ok()?)?))
        };
        let (length, compression, packed) = head().ok_or_else(|| broken("chunk"))?;
        match compression.as_str() {
            "" => self.add_records(packed),
            "zstd" => {
                ReadError::check_memory(length, memory)?;
                let records = unpacked(packed, length).ok_or_else(|| broken("compressed chunk"))?;
                self.add_records(&records)
            }
            other => Err(ReadError::new(format!(
                "its chunks are compressed by {other:?}, and only zstd is read: `mcap compress --compression zstd` changes that"
            ))),
        }
    }
}

/// The bytes that Zstandard has packed, which have to be `length`. It takes no more memory than they have, and the window of the frame, which
/// the decoder limits to 100 MiB.
fn unpacked(packed: &[u8], length: u64) -> Option<Vec<u8>> {
    // This is the last line of defence.
    catch_unwind(AssertUnwindSafe(|| {
        let mut records = Vec::new();
        let decoder = StreamingDecoder::new(packed).ok()?;
        decoder.take(length.checked_add(1)?).read_to_end(&mut records).ok()?;
        (records.len() as u64 == length).then_some(records)
    }))
    .unwrap_or_default()
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

impl Fields<'_> {
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

    fn chunk(compression: &str, records: &[u8]) -> Vec<u8> {
        let packed = match compression {
            "zstd" => compress_to_vec(records, CompressionLevel::Fastest),
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
        for compression in ["", "zstd"] {
            let bag = read_mcap(&file(compression)[..], u64::MAX).unwrap();
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
        }
    }

    #[test]
    fn a_recording_that_was_cut_off_has_what_comes_before() {
        let whole = file("zstd");
        let bag = read_mcap(&whole[..whole.len() - 60], u64::MAX).unwrap();
        assert!(!bag.is_whole && bag.topics.len() == 2, "{bag:?}");
    }

    #[test]
    fn errors_name_the_problem() {
        let of = |bytes: &[u8], memory: u64| read_mcap(bytes, memory).unwrap_err().to_string();
        assert_eq!(of(b"\x89MCAP", 9), "this is no MCAP");
        assert!(
            of(&file("lz4"), u64::MAX)
                .starts_with("its chunks are compressed by \"lz4\", and only zstd is read")
        );
        assert!(of(&file("zstd"), 60).ends_with("bytes of memory, more than the 60 that there are"));
        let alone = [MAGIC, &message(3, 0, 0)].concat();
        assert_eq!(of(&alone, 99), "a message is of channel 3, which it does not have");
        assert_eq!(of(&[MAGIC, &record(CHANNEL, &[&[0; 3]])].concat(), 99), "a channel is broken");
        assert_eq!(of(&[MAGIC, &chunk("", &chunk("", &[]))].concat(), 99), "a record of a chunk is broken");
    }

    proptest! {
        #[test]
        fn broken_bytes_are_an_error_or_a_bag(is_packed: bool, at in 0.0..1.0, value: u8, keep in 0.0..2.0) {
            let mut bytes = file(if is_packed { "zstd" } else { "" });
            let at = (at * bytes.len() as f64) as usize;
            bytes[at] = value;
            bytes.truncate((keep * bytes.len() as f64) as usize);
            if let Ok(bag) = read_mcap(&bytes[..], 1 << 20) {
                prop_assert!(bag.topics.iter().all(|topic| (topic.messages == 0) == topic.times_ns.is_none()));
            }
        }
    }
}
