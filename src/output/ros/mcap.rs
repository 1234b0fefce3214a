//! MCAP, the container of ROS 2 bags (<https://mcap.dev/spec>): messages in chunks with an index behind them, written from
//! beginning to end without going back.
//!
//! A record is an opcode, its length in 64 bits, and its content; numbers are little-endian, texts and maps have their length in
//! bytes in 32 bits.

use std::collections::BTreeMap;
use std::io::{self, Write};

use crc32fast::Hasher;

use super::zstd::zstd;

const MAGIC: [u8; 8] = [0x89, b'M', b'C', b'A', b'P', 0x30, b'\r', b'\n'];

/// A chunk is closed when it has as many bytes, before compression.
const CHUNK_BYTES: usize = 1 << 20;

/// The kinds of records.
#[derive(Clone, Copy)]
#[repr(u8)]
enum Op {
    Header = 0x01,
    Footer = 0x02,
    Schema = 0x03,
    Channel = 0x04,
    Message = 0x05,
    Chunk = 0x06,
    MessageIndex = 0x07,
    ChunkIndex = 0x08,
    Statistics = 0x0B,
    SummaryOffset = 0x0E,
    DataEnd = 0x0F,
}

/// The compression of chunks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Compression {
    /// None.
    None,
    /// Zstandard.
    Zstd,
}

impl Compression {
    /// The name in the file.
    fn name(self) -> &'static str {
        match self {
            Self::None => "",
            Self::Zstd => "zstd",
        }
    }
}

/// A channel: the messages of one topic.
#[derive(Clone, Debug)]
pub(super) struct Channel {
    /// The topic.
    pub topic: String,
    /// The type of its messages, such as `sensor_msgs/msg/Imu`.
    pub schema: &'static str,
    /// The quality of service that publishers offer, in rosbag2's words. It may be empty.
    pub qos: &'static str,
    /// The messages so far.
    pub messages: u64,
}

/// A file that grows.
#[derive(Debug)]
pub(super) struct Mcap {
    compression: Compression,
    /// The bytes that were written, and the checksum of them.
    bytes: u64,
    crc: Hasher,
    /// The schemas: each with its number, from 1.
    schemas: Vec<(&'static str, &'static str)>,
    /// The channels, by their numbers from 0.
    channels: Vec<Channel>,
    chunk: Chunk,
    /// The records that tell of the chunks.
    chunk_indexes: Vec<Vec<u8>>,
    /// The times of the first and the last message.
    times: Option<(u64, u64)>,
}

/// The chunk that is being filled.
#[derive(Debug, Default)]
struct Chunk {
    records: Vec<u8>,
    /// The time and the place of each message, by channel.
    index: BTreeMap<u16, Vec<(u64, u64)>>,
    times: Option<(u64, u64)>,
}

impl Mcap {
    /// A file that is empty.
    pub fn new(compression: Compression) -> Self {
        Self {
            compression,
            bytes: 0,
            crc: Hasher::new(),
            schemas: Vec::new(),
            channels: Vec::new(),
            chunk: Chunk::default(),
            chunk_indexes: Vec::new(),
            times: None,
        }
    }

    /// The channels.
    pub fn channels(&self) -> &[Channel] {
        &self.channels
    }

    /// The times of the first and the last message in nanoseconds, if there is one.
    pub fn times(&self) -> Option<(u64, u64)> {
        self.times
    }

    /// The channel of a topic, which is made if there is none. `definition` is the text of the schema.
    pub fn channel(
        &mut self,
        topic: &str,
        schema: &'static str,
        definition: &'static str,
        qos: &'static str,
    ) -> u16 {
        if let Some(known) = self.channels.iter().position(|known| known.topic == topic) {
            return known as u16;
        }
        if !self.schemas.iter().any(|(name, _)| *name == schema) {
            self.schemas.push((schema, definition));
            let record = self.schema(self.schemas.len() - 1);
            self.chunk.records.extend_from_slice(&record);
        }
        self.channels.push(Channel { topic: topic.to_owned(), schema, qos, messages: 0 });
        let channel = self.channels.len() - 1;
        let record = self.channel_record(channel);
        self.chunk.records.extend_from_slice(&record);
        channel as u16
    }

    fn schema(&self, index: usize) -> Vec<u8> {
        let (name, definition) = self.schemas[index];
        record(Op::Schema, |to| {
            to.extend((index as u16 + 1).to_le_bytes());
            text(to, name);
            text(to, "ros2msg");
            text(to, definition);
        })
    }

    fn channel_record(&self, index: usize) -> Vec<u8> {
        let Channel { topic, schema, qos, .. } = &self.channels[index];
        let schema = self.schemas.iter().position(|(name, _)| name == schema).map_or(0, |at| at + 1);
        record(Op::Channel, |to| {
            to.extend((index as u16).to_le_bytes());
            to.extend((schema as u16).to_le_bytes());
            text(to, topic);
            text(to, "cdr");
            sized(to, |to| {
                if !qos.is_empty() {
                    text(to, "offered_qos_profiles");
                    text(to, qos);
                }
            });
        })
    }

    /// Adds a message of a channel at a time in nanoseconds.
    ///
    /// # Errors
    /// An error if the file cannot be written.
    pub fn add(
        &mut self,
        channel: u16,
        time_ns: u64,
        message: &[u8],
        file: &mut dyn Write,
    ) -> io::Result<()> {
        let known = &mut self.channels[usize::from(channel)];
        let sequence = known.messages as u32;
        known.messages += 1;
        let Chunk { records, index, times } = &mut self.chunk;
        index.entry(channel).or_default().push((time_ns, records.len() as u64));
        *times = Some(span(*times, time_ns));
        self.times = Some(span(self.times, time_ns));
        let length = 2 + 4 + 8 + 8 + message.len() as u64;
        records.push(Op::Message as u8);
        records.extend(length.to_le_bytes());
        records.extend(channel.to_le_bytes());
        records.extend(sequence.to_le_bytes());
        records.extend(time_ns.to_le_bytes());
        records.extend(time_ns.to_le_bytes());
        records.extend_from_slice(message);
        if records.len() >= CHUNK_BYTES { self.close_chunk(file) } else { Ok(()) }
    }

    /// Writes the chunk that is being filled, and the index of its messages behind it.
    fn close_chunk(&mut self, file: &mut dyn Write) -> io::Result<()> {
        self.begin(file)?;
        let Chunk { records, index, times } = std::mem::take(&mut self.chunk);
        let Some((first, last)) = times else { return Ok(()) };
        let (size, crc) = (records.len() as u64, crc32fast::hash(&records));
        let stored = match self.compression {
            Compression::None => records,
            Compression::Zstd => zstd(&records),
        };
        let name = self.compression.name();
        let mut head = vec![Op::Chunk as u8];
        head.extend([0; 8]);
        head.extend([first, last, size].map(u64::to_le_bytes).as_flattened());
        head.extend(crc.to_le_bytes());
        text(&mut head, name);
        head.extend((stored.len() as u64).to_le_bytes());
        let start = self.bytes;
        let length = (head.len() - 9 + stored.len()) as u64;
        head[1..9].copy_from_slice(&length.to_le_bytes());
        self.write(&head, file)?;
        self.write(&stored, file)?;
        let chunk_length = self.bytes - start;
        let mut offsets = Vec::new();
        for (channel, messages) in &index {
            offsets.extend(channel.to_le_bytes());
            offsets.extend(self.bytes.to_le_bytes());
            let of_channel = record(Op::MessageIndex, |to| {
                to.extend(channel.to_le_bytes());
                sized(to, |to| {
                    for (time_ns, offset) in messages {
                        to.extend([*time_ns, *offset].map(u64::to_le_bytes).as_flattened());
                    }
                });
            });
            self.write(&of_channel, file)?;
        }
        let indexes_length = self.bytes - start - chunk_length;
        self.chunk_indexes.push(record(Op::ChunkIndex, |to| {
            to.extend([first, last, start, chunk_length].map(u64::to_le_bytes).as_flattened());
            sized(to, |to| to.extend_from_slice(&offsets));
            to.extend(indexes_length.to_le_bytes());
            text(to, name);
            to.extend([stored.len() as u64, size].map(u64::to_le_bytes).as_flattened());
        }));
        Ok(())
    }

    /// Writes the beginning of the file, if nothing is written yet.
    fn begin(&mut self, file: &mut dyn Write) -> io::Result<()> {
        if self.bytes > 0 {
            return Ok(());
        }
        let header = record(Op::Header, |to| {
            text(to, "ros2");
            text(to, "beamcast");
        });
        self.write(&[&MAGIC[..], &header].concat(), file)
    }

    /// Writes the last chunk, the summary and the end of the file.
    ///
    /// # Errors
    /// An error if the file cannot be written.
    pub fn finish(&mut self, file: &mut dyn Write) -> io::Result<()> {
        self.close_chunk(file)?;
        let crc = self.crc.clone().finalize();
        self.write(&record(Op::DataEnd, |to| to.extend(crc.to_le_bytes())), file)?;
        let start = self.bytes;
        let groups = [
            (Op::Schema, (0..self.schemas.len()).map(|i| self.schema(i)).collect::<Vec<_>>().concat()),
            (
                Op::Channel,
                (0..self.channels.len()).map(|i| self.channel_record(i)).collect::<Vec<_>>().concat(),
            ),
            (Op::Statistics, self.statistics()),
            (Op::ChunkIndex, self.chunk_indexes.concat()),
        ];
        let (mut summary, mut offsets) = (Vec::new(), Vec::new());
        for (op, group) in groups.iter().filter(|(_, group)| !group.is_empty()) {
            offsets.extend(record(Op::SummaryOffset, |to| {
                to.push(*op as u8);
                let at = start + summary.len() as u64;
                to.extend([at, group.len() as u64].map(u64::to_le_bytes).as_flattened());
            }));
            summary.extend_from_slice(group);
        }
        let offsets_start = start + summary.len() as u64;
        summary.extend(offsets);
        // The checksum covers the footer up to itself.
        summary.push(Op::Footer as u8);
        summary.extend([20, start, offsets_start].map(u64::to_le_bytes).as_flattened());
        let crc = crc32fast::hash(&summary);
        summary.extend(crc.to_le_bytes());
        summary.extend(MAGIC);
        self.write(&summary, file)
    }

    fn statistics(&self) -> Vec<u8> {
        let (first, last) = self.times.unwrap_or_default();
        record(Op::Statistics, |to| {
            to.extend(self.channels.iter().map(|channel| channel.messages).sum::<u64>().to_le_bytes());
            to.extend((self.schemas.len() as u16).to_le_bytes());
            // Attachments and metadata there are none.
            for count in [self.channels.len(), 0, 0, self.chunk_indexes.len()] {
                to.extend((count as u32).to_le_bytes());
            }
            to.extend([first, last].map(u64::to_le_bytes).as_flattened());
            sized(to, |to| {
                for (index, channel) in self.channels.iter().enumerate() {
                    to.extend((index as u16).to_le_bytes());
                    to.extend(channel.messages.to_le_bytes());
                }
            });
        })
    }

    fn write(&mut self, bytes: &[u8], file: &mut dyn Write) -> io::Result<()> {
        file.write_all(bytes)?;
        self.crc.update(bytes);
        self.bytes += bytes.len() as u64;
        Ok(())
    }
}

/// A span of time that reaches to `time_ns`.
fn span(times: Option<(u64, u64)>, time_ns: u64) -> (u64, u64) {
    times.map_or((time_ns, time_ns), |(first, last)| (first.min(time_ns), last.max(time_ns)))
}

fn record(op: Op, content: impl FnOnce(&mut Vec<u8>)) -> Vec<u8> {
    let mut record = vec![op as u8];
    record.extend([0; 8]);
    content(&mut record);
    let length = (record.len() - 9) as u64;
    record[1..9].copy_from_slice(&length.to_le_bytes());
    record
}

/// Appends content behind its length in 32 bits.
fn sized(to: &mut Vec<u8>, content: impl FnOnce(&mut Vec<u8>)) {
    let start = to.len();
    to.extend([0; 4]);
    content(to);
    let length = (to.len() - start - 4) as u32;
    to[start..start + 4].copy_from_slice(&length.to_le_bytes());
}

fn text(to: &mut Vec<u8>, text: &str) {
    sized(to, |to| to.extend_from_slice(text.as_bytes()));
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The records between two places of a file: the opcode and the content of each, with the place where it begins.
    fn records(file: &[u8], mut at: usize, end: usize) -> Vec<(u8, &[u8], usize)> {
        let mut found = Vec::new();
        while at < end {
            let length = u64_at(file, at + 1) as usize;
            found.push((file[at], &file[at + 9..at + 9 + length], at));
            at += 9 + length;
        }
        assert_eq!(at, end);
        found
    }

    fn u64_at(bytes: &[u8], at: usize) -> u64 {
        u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap())
    }

    fn u32_at(bytes: &[u8], at: usize) -> u32 {
        u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
    }

    /// A file of two channels, whose messages fill more than one chunk.
    fn file(compression: Compression) -> Vec<u8> {
        let (mut mcap, mut file) = (Mcap::new(compression), Vec::new());
        for number in 0..40_u64 {
            let topic = if number % 4 == 0 { "/a" } else { "/b" };
            let channel = mcap.channel(topic, "std_msgs/msg/Header", "string frame_id\n", "");
            assert_eq!(channel, u16::from(number % 4 != 0));
            let message: Vec<u8> = (0..60_000_u64).map(|i| (i * number / 7) as u8).collect();
            mcap.add(channel, 100 + number, &message, &mut file).unwrap();
        }
        mcap.finish(&mut file).unwrap();
        assert_eq!((mcap.channels()[0].messages, mcap.channels()[1].messages), (10, 30));
        assert_eq!(mcap.times(), Some((100, 139)));
        file
    }

    #[test]
    fn the_checksums_and_the_index_lead_to_every_message() {
        let file = file(Compression::None);
        assert!(file.starts_with(&MAGIC) && file.ends_with(&MAGIC));
        let footer = file.len() - MAGIC.len() - 29;
        assert_eq!(file[footer], Op::Footer as u8);
        let (summary, offsets) = (u64_at(&file, footer + 9) as usize, u64_at(&file, footer + 17) as usize);
        assert_eq!(u32_at(&file, footer + 25), crc32fast::hash(&file[summary..footer + 25]));
        let data = records(&file, MAGIC.len(), summary);
        let (end, content, at) = data[data.len() - 1];
        assert_eq!((end, u32_at(content, 0)), (Op::DataEnd as u8, crc32fast::hash(&file[..at])));

        let of_summary = records(&file, summary, offsets);
        let kinds: Vec<u8> = of_summary.iter().map(|(op, ..)| *op).collect();
        assert_eq!(
            kinds[..4],
            [Op::Schema as u8, Op::Channel as u8, Op::Channel as u8, Op::Statistics as u8]
        );
        let chunks = &of_summary[4..];
        // A chunk is full with 18 messages of 60,031 bytes.
        assert_eq!(chunks.len(), 3);
        let mut messages = 0;
        for (_, index, _) in chunks {
            let chunk = u64_at(index, 16) as usize;
            let content = &file[chunk + 9..];
            // Times, size, checksum, no compression, length.
            let records_at = chunk + 9 + 24 + 4 + 4 + 8;
            let inside = &file[records_at..records_at + u64_at(content, 16) as usize];
            assert_eq!(u32_at(content, 24), crc32fast::hash(inside));
            for (place, channel) in [(36, 0_u16), (46, 1)] {
                assert_eq!(index[place..place + 2], channel.to_le_bytes());
                let of_channel = u64_at(index, place + 2) as usize;
                let bytes = u32_at(&file, of_channel + 11) as usize;
                for entry in file[of_channel + 15..of_channel + 15 + bytes].chunks(16) {
                    let message = u64_at(entry, 8) as usize;
                    assert_eq!(inside[message], Op::Message as u8);
                    assert_eq!(inside[message + 9..message + 11], channel.to_le_bytes());
                    assert_eq!(u64_at(inside, message + 15), u64_at(entry, 0));
                    messages += 1;
                }
            }
        }
        assert_eq!(messages, 40);
        // The groups of the summary are where their records say.
        for (_, group, _) in records(&file, offsets, footer) {
            assert_eq!(file[u64_at(group, 1) as usize], group[0]);
        }
    }

    #[test]
    fn compressed_chunks_are_the_plain_ones() {
        let (plain, packed) = (file(Compression::None), file(Compression::Zstd));
        assert!(packed.len() < plain.len());
        let chunk = |file: &[u8]| {
            let data = records(file, MAGIC.len(), u64_at(file, file.len() - MAGIC.len() - 20) as usize);
            data.iter().find(|(op, ..)| *op == Op::Chunk as u8).unwrap().1.to_vec()
        };
        let (plain, packed) = (chunk(&plain), chunk(&packed));
        assert_eq!((&plain[..28], &plain[28..32]), (&packed[..28], &[0; 4][..]));
        assert_eq!(&packed[32..36], b"zstd");
        let mut decoder = ruzstd::decoding::StreamingDecoder::new(&packed[44..]).unwrap();
        let mut found = Vec::new();
        io::Read::read_to_end(&mut decoder, &mut found).unwrap();
        assert_eq!(found, plain[40..]);
    }

    #[test]
    fn a_file_without_messages_is_whole() {
        let (mut mcap, mut file) = (Mcap::new(Compression::None), Vec::new());
        mcap.finish(&mut file).unwrap();
        let summary = u64_at(&file, file.len() - MAGIC.len() - 20) as usize;
        let kinds: Vec<u8> = records(&file, MAGIC.len(), summary).iter().map(|(op, ..)| *op).collect();
        assert_eq!(kinds, [Op::Header as u8, Op::DataEnd as u8]);
    }
}
