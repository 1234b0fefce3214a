//! The blocks of lines of flat OpenEXR images.

use std::io::Cursor;
use std::ops::Range;

use exr::block::chunk::{Chunk, CompressedBlock, CompressedScanLineBlock};
use exr::block::writer::ChunksWriter;
use exr::block::{BlockIndex, UncompressedBlock, enumerate_ordered_header_block_indices};
use exr::compression::Compression;
use exr::error::Result;
use exr::meta::BlockDescription;
use exr::meta::attribute::{ChannelDescription, LineOrder, SampleType, Text};
use exr::meta::header::{Header, LayerAttributes};
use rayon::prelude::*;

use super::zip::{Segment, Zip, raw};

/// A channel of a part.
#[derive(Clone)]
pub(super) struct PartChannel {
    pub name: Text,
    pub kind: SampleType,
    /// Which of the columns of the part's values the channel has. Two channels can have the same.
    pub column: usize,
}

/// What gives the values of columns in some rows.
pub(super) type Values<'p> = dyn Fn(Range<usize>, &mut [Vec<u32>]) + Sync + 'p;

/// An image of a file.
pub(super) struct Part<'p> {
    pub rows: usize,
    pub columns: usize,
    pub attributes: LayerAttributes,
    /// The channels, sorted by name.
    pub channels: Vec<PartChannel>,
    /// The values of each column in some rows, added to vectors that are empty: the bits of each value, and of half floats 16.
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
}

/// The memory of a thread, which is used again for each block.
#[derive(Default)]
struct Memory {
    values: Vec<Vec<u32>>,
    zip: Zip,
}

/// The file of parts. The blocks are compressed in rayon's current thread pool, and not in a pool of the library, so that `--threads`
/// holds. Deflate has a level; the library has other compressions.
pub(super) fn compress(parts: &[Part], compression: Compression, level: u8) -> Result<Vec<u8>> {
    let headers = parts.iter().map(|part| part.header(compression)).collect();
    let mut file = Vec::new();
    exr::block::write(Cursor::new(&mut file), headers, true, |meta, writer| {
        let blocks: Vec<_> = enumerate_ordered_header_block_indices(&meta.headers).collect();
        let chunk = |memory: &mut Memory, (_, index): &(usize, BlockIndex)| {
            let Memory { values, zip } = memory;
            let part = &parts[index.layer];
            values.resize_with(values.len().max(part.channels.len()), Vec::new);
            let segments = segments(part, *index, values);
            match compression {
                Compression::ZIP1 | Compression::ZIP16 => Ok(Chunk {
                    layer_index: index.layer,
                    compressed_block: CompressedBlock::ScanLine(CompressedScanLineBlock {
                        y_coordinate: index.pixel_position.y() as i32,
                        compressed_pixels_le: zip.pack(&segments, level),
                    }),
                }),
                _ => UncompressedBlock { index: *index, data: native(&segments) }
                    .compress_to_chunk(&meta.headers),
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

/// The values of a block: line by line, and in a line channel by channel.
fn segments<'v>(part: &Part, index: BlockIndex, values: &'v mut [Vec<u32>]) -> Vec<Segment<'v>> {
    let first = index.pixel_position.y();
    let lines = index.pixel_size.height();
    values.iter_mut().for_each(Vec::clear);
    (part.values)(first..first + lines, values);
    let line = |line: usize| line * part.columns..(line + 1) * part.columns;
    let of_line = |number| {
        let values = &*values;
        part.channels.iter().map(move |channel| Segment {
            values: &values[channel.column][line(number)],
            is_half: channel.kind == SampleType::F16,
        })
    };
    (0..lines).flat_map(of_line).collect()
}

/// The bytes of a block in the order of this machine, which the library's own compressors take.
fn native(segments: &[Segment]) -> Vec<u8> {
    if cfg!(target_endian = "little") {
        return raw(segments);
    }
    let swapped = |segment: &Segment| -> Vec<u8> {
        match segment.is_half {
            true => segment.values.iter().flat_map(|value| (*value as u16).to_ne_bytes()).collect(),
            false => segment.values.iter().flat_map(|value| value.to_ne_bytes()).collect(),
        }
    };
    segments.iter().flat_map(swapped).collect()
}
