//! The blocks of lines of flat OpenEXR images.

use std::io::Cursor;

use exr::block::chunk::{Chunk, CompressedBlock, CompressedScanLineBlock};
use exr::block::writer::ChunksWriter;
use exr::block::{BlockIndex, UncompressedBlock, enumerate_ordered_header_block_indices};
use exr::compression::Compression;
use exr::error::Result;
use exr::meta::BlockDescription;
use exr::meta::attribute::{ChannelDescription, LineOrder, SampleType, Text};
use exr::meta::header::{Header, LayerAttributes};
use rayon::prelude::*;

use super::zip::{Segment, Zip, add_raw};

/// A channel of a part.
#[derive(Clone)]
pub(super) struct PartChannel {
    pub name: Text,
    pub kind: SampleType,
    /// Which of the columns of the part's values the channel has. Two channels can have the same.
    pub column: usize,
}

/// A function that gives the values of columns in a row.
pub(super) type Values<'p> = dyn Fn(usize, &mut [Vec<u32>]) + Sync + 'p;

/// An image of a file.
pub(super) struct Part<'p> {
    pub rows: usize,
    pub columns: usize,
    pub attributes: LayerAttributes,
    /// The channels, sorted by name.
    pub channels: Vec<PartChannel>,
    /// The values of each column in a row, added to vectors that are empty: the bits of each value, and of half floats 16.
    pub values: Box<Values<'p>>,
}

impl Part<'_> {
    fn header(&self, compression: Compression) -> Header {
        let channels = self.channels.iter();
        let channels = channels.map(|channel| ChannelDescription::named(channel.name.clone(), channel.kind));
        Header::new(Text::default(), (self.columns, self.rows), channels.collect())
            .with_encoding(compression, BlockDescription::ScanLines, LineOrder::Increasing)
            .with_attributes(self.attributes.clone())
    }

    fn bytes_a_line(&self) -> usize {
        let bytes = |channel: &PartChannel| if channel.kind == SampleType::F16 { 2 } else { 4 };
        self.columns * self.channels.iter().map(bytes).sum::<usize>()
    }
}

/// The memory of a thread, which is used again for each block.
#[derive(Default)]
struct Memory {
    values: Vec<Vec<u32>>,
    zip: Zip,
}

/// The file of parts. The blocks are compressed in rayon's current thread pool, and not in a pool of the library, so that `--threads`
/// holds. Deflate has a level; the library has other compressions. The file comes in memory that is empty.
pub(super) fn compress(
    parts: &[Part],
    compression: Compression,
    level: u8,
    mut file: Vec<u8>,
) -> Result<Vec<u8>> {
    let headers = parts.iter().map(|part| part.header(compression)).collect();
    exr::block::write(Cursor::new(&mut file), headers, true, |meta, writer| {
        let blocks: Vec<_> = enumerate_ordered_header_block_indices(&meta.headers).collect();
        let chunk = |memory: &mut Memory, (_, index): &(usize, BlockIndex)| {
            let Memory { values, zip } = memory;
            let part = &parts[index.layer];
            values.resize_with(values.len().max(part.channels.len()), Vec::new);
            match compression {
                Compression::ZIP1 | Compression::ZIP16 => {
                    zip.begin(part.bytes_a_line() * index.pixel_size.height());
                    each_line(part, *index, values, |segments| zip.add(segments));
                    Ok(Chunk {
                        layer_index: index.layer,
                        compressed_block: CompressedBlock::ScanLine(CompressedScanLineBlock {
                            y_coordinate: index.pixel_position.y() as i32,
                            compressed_pixels_le: zip.finish(level),
                        }),
                    })
                }
                _ => {
                    let mut data = Vec::with_capacity(part.bytes_a_line() * index.pixel_size.height());
                    each_line(part, *index, values, |segments| add_native(segments, &mut data));
                    UncompressedBlock { index: *index, data }.compress_to_chunk(&meta.headers)
                }
            }
        };
        let chunks: Vec<Result<Chunk>> = blocks.par_iter().map_init(Memory::default, chunk).collect();
        for ((place, _), chunk) in blocks.iter().zip(chunks) {
            writer.write_chunk(*place, chunk?)?;
        }
        Ok(())
    })?;
    Ok(file)
}

/// Calls `add` with each line of a block, channel by channel. Only one line's values are there at a time, which the cache holds.
fn each_line(part: &Part, index: BlockIndex, values: &mut [Vec<u32>], mut add: impl FnMut(&[Segment])) {
    let first = index.pixel_position.y();
    for line in first..first + index.pixel_size.height() {
        values.iter_mut().for_each(Vec::clear);
        (part.values)(line, values);
        let of_channel = |channel: &PartChannel| Segment {
            values: &values[channel.column],
            is_half: channel.kind == SampleType::F16,
        };
        add(&part.channels.iter().map(of_channel).collect::<Vec<_>>());
    }
}

/// Adds the bytes of a line in the order of this machine, which the library's own compressors take.
fn add_native(segments: &[Segment], bytes: &mut Vec<u8>) {
    if cfg!(target_endian = "little") {
        return add_raw(segments, bytes);
    }
    for segment in segments {
        match segment.is_half {
            true => bytes.extend(segment.values.iter().flat_map(|value| (*value as u16).to_ne_bytes())),
            false => bytes.extend(segment.values.iter().flat_map(|value| value.to_ne_bytes())),
        }
    }
}
