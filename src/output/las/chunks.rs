//! The compression of LAZ: chunks of points, each of its own, and their table.
//!
//! The chunks are compressed beside each other and written in their order, so that the bytes do not depend on the threads.

use std::io::{self, Write};

use laz::laszip::{ChunkTable, ChunkTableEntry};
use laz::record::{LayeredPointRecordCompressor, RecordCompressor};
use laz::{LasZipError, LazItem, LazItemRecordBuilder, LazItemType, LazVlr, LazVlrBuilder};
use rayon::prelude::*;

use super::super::format::EncodeError;
use super::extra_bytes::layers;

/// The points of a chunk: as many as LASzip itself takes.
const POINTS: u32 = 50_000;

/// The chunks that are written.
pub(super) struct Chunks {
    laszip: LazVlr,
    extra_bytes: usize,
    /// The number of layers of all but the extra bytes.
    own_layers: usize,
    table: ChunkTable,
    /// The bytes of all chunks.
    bytes: u64,
}

impl Chunks {
    /// The user and the number of the record that describes the compression.
    pub const RECORD: (&str, u16) = (LazVlr::USER_ID, LazVlr::RECORD_ID);

    /// No chunks, of points of a format from 6 to 8 with so many extra bytes.
    pub fn new(format: u8, extra_bytes: usize) -> Self {
        let mut items = LazItemRecordBuilder::new();
        items.add_item(LazItemType::Point14);
        match format {
            7 => items.add_item(LazItemType::RGB14),
            8 => items.add_item(LazItemType::RGBNIR14),
            _ => &mut items,
        };
        if extra_bytes > 0 {
            items.add_item(LazItemType::Byte14(extra_bytes as u16));
        }
        let laszip = LazVlrBuilder::new(items.build()).with_fixed_chunk_size(POINTS).build();
        // LASzip parts the point of format 6 into 9 layers. Colours are one, and near infrared is one.
        let own_layers = 9 + usize::from(format >= 7) + usize::from(format == 8);
        Self { laszip, extra_bytes, own_layers, table: ChunkTable::default(), bytes: 0 }
    }

    /// The record that describes the compression.
    pub fn description(&self) -> Vec<u8> {
        let mut record = Vec::new();
        // A vector takes all that is written.
        let _ = self.laszip.write_to(&mut record);
        record
    }

    /// The place of the table in a file whose points, which begin with this number itself, are at `points`.
    pub fn table_after(&self, points: u64) -> i64 {
        (points + 8 + self.bytes) as i64
    }

    /// Compresses the whole chunks of `records`, writes them and takes them out.
    pub fn write_whole(&mut self, records: &mut Vec<u8>, file: &mut dyn Write) -> Result<(), EncodeError> {
        let bytes = POINTS as usize * self.laszip.items_size() as usize;
        let whole = records.len() / bytes * bytes;
        self.write(&records[..whole], file)?;
        records.drain(..whole);
        Ok(())
    }

    /// Compresses what is left and writes it with the table.
    pub fn finish(&mut self, records: &mut Vec<u8>, file: &mut dyn Write) -> Result<(), EncodeError> {
        self.write_whole(records, file)?;
        self.write(records, file)?;
        records.clear();
        Ok(self.table.write_to(file, &self.laszip)?)
    }

    fn write(&mut self, records: &[u8], file: &mut dyn Write) -> Result<(), EncodeError> {
        let bytes = POINTS as usize * self.laszip.items_size() as usize;
        let chunks: Result<Vec<_>, _> = records.par_chunks(bytes).map(|chunk| self.compress(chunk)).collect();
        for chunk in chunks.map_err(io::Error::other)? {
            file.write_all(&chunk)?;
            let byte_count = chunk.len() as u64;
            self.table.push(ChunkTableEntry { point_count: u64::from(POINTS), byte_count });
            self.bytes += byte_count;
        }
        Ok(())
    }

    /// A chunk: the first record, the number of records, the lengths of the layers, and the layers. Those of the extra bytes come last.
    fn compress(&self, records: &[u8]) -> Result<Vec<u8>, LasZipError> {
        /// The place of the bits of the scanner's channel.
        const CHANNEL: usize = 15;
        let record_bytes = self.laszip.items_size() as usize;
        let own_bytes = record_bytes - self.extra_bytes;
        let channels = || records.iter().skip(CHANNEL).step_by(record_bytes).map(|flags| flags >> 4 & 3);
        // Each channel has contexts of its own, which the library knows.
        if self.extra_bytes == 0 || channels().any(|channel| Some(channel) != channels().next()) {
            return chunk_of(self.laszip.items(), records.chunks_exact(record_bytes));
        }
        let own: Vec<LazItem> = self
            .laszip
            .items()
            .iter()
            .filter(|item| !matches!(item.item_type(), LazItemType::Byte14(_)))
            .copied()
            .collect();
        let points = chunk_of(&own, records.chunks_exact(record_bytes).map(|record| &record[..own_bytes]))?;
        let (first, rest) = points.split_at(own_bytes);
        let (counts, of_points) = rest.split_at(size_of::<u32>() * (1 + self.own_layers));
        let layers = layers(records, record_bytes, own_bytes);
        let lengths: Vec<_> = layers.iter().map(|layer| (layer.len() as u32).to_le_bytes()).collect();
        let extra = &records[own_bytes..record_bytes];
        Ok([first, extra, counts, lengths.as_flattened(), of_points, &layers.concat()].concat())
    }
}

/// The chunk of some records of these items.
fn chunk_of<'r>(items: &[LazItem], records: impl Iterator<Item = &'r [u8]>) -> Result<Vec<u8>, LasZipError> {
    let mut compressor = LayeredPointRecordCompressor::new(Vec::new());
    compressor.set_fields_from(&items.to_vec())?;
    for record in records {
        compressor.compress_next(record)?;
    }
    compressor.done()?;
    Ok(std::mem::take(compressor.get_mut()))
}

#[cfg(test)]
mod tests {
    use laz::LasZipDecompressor;

    use super::*;

    /// The bytes of a chunk's points after the place of the table, compressed piece by piece.
    fn compressed(records: &[u8], pieces: usize) -> (Chunks, Vec<u8>) {
        let mut chunks = Chunks::new(6, 2);
        let (mut waiting, mut file) = (Vec::new(), Vec::new());
        for piece in records.chunks(pieces) {
            waiting.extend_from_slice(piece);
            chunks.write_whole(&mut waiting, &mut file).unwrap();
            assert!(waiting.len() < POINTS as usize * 32);
        }
        chunks.finish(&mut waiting, &mut file).unwrap();
        (chunks, file)
    }

    #[test]
    fn chunks_are_those_of_the_library() {
        let mut random = (0_u64..).map(|i| i.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 33);
        for (format, own_bytes) in [(6, 30), (7, 36), (8, 38)] {
            for extra_bytes in [0, 1, 7] {
                for points in [1, 2, 20_000] {
                    for channels in [1, 4] {
                        let record = |number: usize| {
                            let mut record: Vec<u8> =
                                random.by_ref().take(own_bytes).map(|r| r as u8).collect();
                            // One return of one, and a channel.
                            (record[14], record[15]) = (0x11, ((number / 100 % channels) << 4) as u8);
                            // A constant, a counter, rare steps, noise, and small numbers.
                            let r = random.next().unwrap() as usize;
                            let bytes = [
                                5,
                                number,
                                usize::from(number > 9000) * 255,
                                r,
                                r % 3,
                                number / 256,
                                (r % 1000) / 999,
                            ];
                            record.extend(bytes[..extra_bytes].iter().map(|byte| *byte as u8));
                            record
                        };
                        let records: Vec<u8> = (0..points).flat_map(record).collect();
                        let chunks = Chunks::new(format, extra_bytes);
                        let whole = records.chunks_exact(own_bytes + extra_bytes);
                        let expected = chunk_of(chunks.laszip.items(), whole).unwrap();
                        assert!(
                            chunks.compress(&records).unwrap() == expected,
                            "{format} {extra_bytes} {points} {channels}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn points_are_read_as_they_were_whatever_the_pieces_and_the_threads() {
        let point = |number: u32| {
            let mut record = [0; 32];
            record[..4].copy_from_slice(&number.wrapping_mul(2_654_435_761).to_le_bytes());
            record[4..8].copy_from_slice(&number.to_le_bytes());
            record[14] = 0x11;
            record[22..30].copy_from_slice(&(f64::from(number) * 1e-5).to_le_bytes());
            record[30..].copy_from_slice(&((number % 16) as u16).to_le_bytes());
            record
        };
        for points in [0, 1, 50_000, 50_001, 120_000] {
            let records: Vec<u8> = (0..points).flat_map(point).collect();
            let (chunks, at_once) = compressed(&records, records.len().max(1));
            let one_thread = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
            assert!(one_thread.install(|| compressed(&records, 32 * 7000).1) == at_once, "{points}");
            // A file of nothing else: its points begin with the place of the table.
            let file = [&chunks.table_after(0).to_le_bytes()[..], &at_once].concat();
            let mut again = vec![0; records.len()];
            let mut reader = LasZipDecompressor::new(io::Cursor::new(file), chunks.laszip).unwrap();
            reader.decompress_many(&mut again).unwrap();
            assert!(again == records, "{points}");
        }
    }
}
