//! Decompression of LAZ: the chunks of points that LASzip makes of the records of a LAS.
//!
//! The layout is that of Isenburg, "LASzip: lossless compression of LiDAR data" (2013), and of "The LASzip 1.4 specification". The crate
//! that decodes the points trusts what lengths say, so that all of them are checked before it gets a chunk.

use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};

use laz::laszip::ChunkTable;
use laz::record::{LayeredPointRecordDecompressor, RecordDecompressor, SequentialPointRecordDecompressor};
use laz::{DecompressionSelection, LazItem, LazItemType, LazVlr};

use super::error::ReadError;

/// The user and the number of the record that describes the compression.
pub(super) const RECORD: (&str, u16) = (LazVlr::USER_ID, LazVlr::RECORD_ID);

/// The points of a LAZ, compressed.
pub(super) struct Compressed<'a> {
    /// The whole file.
    pub file: &'a [u8],
    /// The place of the points in the file.
    pub at: usize,
    /// The format of the points, from 0 to 10.
    pub format: u8,
    /// The bytes of a record of that format, without the extra bytes, and with them.
    pub record_bytes: [usize; 2],
    /// The number of points.
    pub points: u64,
}

impl Compressed<'_> {
    /// Gives the records of all points to `take`, in their order. `description` is the content of [`RECORD`].
    ///
    /// # Errors
    /// A [`ReadError`] if the description does not belong to the format, if a length is larger than the file, or if the points
    /// are broken or end too early.
    pub fn each_record(&self, description: &[u8], take: &mut dyn FnMut(&[u8])) -> Result<(), ReadError> {
        // The decoder computes with what a file says, and indexes by it. This is the last line of defence.
        catch_unwind(AssertUnwindSafe(|| self.decode(description, take)))
            .unwrap_or_else(|_| Err(broken("they")))
    }

    fn decode(&self, description: &[u8], take: &mut dyn FnMut(&[u8])) -> Result<(), ReadError> {
        let laszip = LazVlr::from_buffer(description)
            .map_err(|e| ReadError::new(format!("the description of its compression can't be read: {e}")))?;
        self.check_items(laszip.items())?;
        let mut left = self.points;
        for chunk in self.chunks(&laszip, description)? {
            if left == 0 {
                break;
            }
            let points = chunk.points.min(left);
            self.decode_chunk(laszip.items(), chunk.bytes, points, take)?;
            left -= points;
        }
        match left {
            0 => Ok(()),
            _ => Err(super::cloud::cut_short(usize::try_from(self.points).unwrap_or(usize::MAX))),
        }
    }

    /// Checks that the parts of a record are those of the format, with its sizes.
    fn check_items(&self, items: &[LazItem]) -> Result<(), ReadError> {
        let [own, all] = self.record_bytes;
        let extra = (all - own) as u16;
        let mut expected = match self.format {
            0 => vec![(LazItemType::Point10, 20)],
            1 => vec![(LazItemType::Point10, 20), (LazItemType::GpsTime, 8)],
            2 => vec![(LazItemType::Point10, 20), (LazItemType::RGB12, 6)],
            3 => vec![(LazItemType::Point10, 20), (LazItemType::GpsTime, 8), (LazItemType::RGB12, 6)],
            4 => vec![(LazItemType::Point10, 20), (LazItemType::GpsTime, 8), (LazItemType::WavePacket13, 29)],
            5 => vec![
                (LazItemType::Point10, 20),
                (LazItemType::GpsTime, 8),
                (LazItemType::RGB12, 6),
                (LazItemType::WavePacket13, 29),
            ],
            6 => vec![(LazItemType::Point14, 30)],
            7 => vec![(LazItemType::Point14, 30), (LazItemType::RGB14, 6)],
            8 => vec![(LazItemType::Point14, 30), (LazItemType::RGBNIR14, 8)],
            9 => vec![(LazItemType::Point14, 30), (LazItemType::WavePacket14, 29)],
            _ => {
                vec![(LazItemType::Point14, 30), (LazItemType::RGBNIR14, 8), (LazItemType::WavePacket14, 29)]
            }
        };
        if extra > 0 {
            let kind = if self.format < 6 { LazItemType::Byte(extra) } else { LazItemType::Byte14(extra) };
            expected.push((kind, extra));
        }
        let found: Vec<_> = items.iter().map(|item| (item.item_type(), item.size())).collect();
        if found == expected {
            return Ok(());
        }
        Err(ReadError::new(format!(
            "the description of its compression is not that of points of format {} with {all} bytes",
            self.format
        )))
    }

    /// The chunks in their order.
    fn chunks(&self, laszip: &LazVlr, description: &[u8]) -> Result<Vec<Chunk<'_>>, ReadError> {
        /// The compressor of all points as one chunk, without a table.
        const POINT_WISE: [u8; 2] = [1, 0];
        /// The version and the number of chunks, before their lengths.
        const HEAD: usize = 8;
        if description.starts_with(&POINT_WISE) {
            return Ok(vec![Chunk { points: u64::MAX, bytes: &self.file[self.at..] }]);
        }
        let first = self.at + 8;
        let place = |bytes: Option<&[u8]>| {
            let place = i64::from_le_bytes(bytes?.try_into().ok()?);
            usize::try_from(place).ok().filter(|place| *place >= first && *place <= self.file.len() - HEAD)
        };
        // A writer that can't go back puts the place of the table at the end.
        let table = place(self.file.get(self.at..first));
        let table = table.or_else(|| place(self.file.get(self.file.len().saturating_sub(8)..)));
        let table = table.ok_or_else(|| {
            ReadError::new(
                "it has no table of its chunks where it says: it is cut short, or was never finished",
            )
        })?;
        let count: [u8; 4] = std::array::from_fn(|index| self.file[table + 4 + index]);
        let (count, bytes) = (u32::from_le_bytes(count) as usize, table - first);
        // A chunk begins with its first point as it is.
        if count > bytes / self.record_bytes[1] {
            return Err(ReadError::new(format!(
                "it claims {count} chunks of points, which {bytes} bytes can't hold"
            )));
        }
        let is_variable = laszip.uses_variable_size_chunks();
        let entries = ChunkTable::read(&mut Cursor::new(&self.file[table..]), is_variable)
            .map_err(|_| broken("the table of its chunks"))?;
        let mut rest = &self.file[first..table];
        let mut chunks = Vec::with_capacity(count);
        for index in 0..count {
            let entry = entries[index];
            let length = usize::try_from(entry.byte_count).ok();
            let (bytes, after) = length
                .and_then(|length| rest.split_at_checked(length))
                .ok_or_else(|| ReadError::new(format!("its chunk {index} is longer than its points")))?;
            let points = if is_variable { entry.point_count } else { u64::from(laszip.chunk_size()) };
            chunks.push(Chunk { points, bytes });
            rest = after;
        }
        Ok(chunks)
    }

    fn decode_chunk(
        &self,
        items: &Vec<LazItem>,
        bytes: &[u8],
        points: u64,
        take: &mut dyn FnMut(&[u8]),
    ) -> Result<(), ReadError> {
        let mut record = vec![0; self.record_bytes[1]];
        let source = Cursor::new(bytes);
        let mut decoder: Box<dyn RecordDecompressor<Cursor<&[u8]>>> = if self.format < 6 {
            Box::new(SequentialPointRecordDecompressor::new(source))
        } else {
            self.check_layers(bytes, items)?;
            Box::new(LayeredPointRecordDecompressor::new(source))
        };
        decoder.set_fields_from(items).map_err(|e| {
            ReadError::new(format!("its points are compressed in a way that is not supported: {e}"))
        })?;
        decoder.set_selection(DecompressionSelection::all());
        for _ in 0..points {
            decoder.decompress_next(&mut record).map_err(|_| broken("they"))?;
            take(&record);
        }
        Ok(())
    }

    /// Checks the lengths of a chunk's layers against what is there: after the first point and the number of points, a length in 32 bits
    /// for each of the layers, which follow.
    fn check_layers(&self, chunk: &[u8], items: &[LazItem]) -> Result<(), ReadError> {
        let layers: usize = items
            .iter()
            .map(|item| match item.item_type() {
                LazItemType::Point14 => 9,
                LazItemType::RGBNIR14 => 2,
                LazItemType::Byte14(count) => usize::from(count),
                _ => 1,
            })
            .sum();
        let start = self.record_bytes[1] + 4;
        let lengths = chunk.get(start..start + 4 * layers).ok_or_else(|| broken("they"))?;
        let lengths = lengths.as_chunks::<4>().0.iter().map(|bytes| u64::from(u32::from_le_bytes(*bytes)));
        let (claimed, there) = (lengths.sum::<u64>(), chunk.len() - start - 4 * layers);
        match claimed <= there as u64 {
            true => Ok(()),
            false => {
                Err(ReadError::new(format!("a chunk claims {claimed} bytes of points, and has {there}")))
            }
        }
    }
}

/// The points of a chunk.
struct Chunk<'a> {
    points: u64,
    bytes: &'a [u8],
}

fn broken(what: &str) -> ReadError {
    match what {
        "they" => ReadError::new("its compressed points are broken"),
        what => ReadError::new(format!("{what} is broken")),
    }
}

/// Compresses records of a format with so many extra bytes in chunks of 4 points, as they follow the header and the records of variable
/// length, which end at `at`. Gives the content of [`RECORD`] with it.
#[cfg(test)]
pub(super) fn compressed(format: u8, extra: u16, at: usize, records: &[u8]) -> (Vec<u8>, Vec<u8>) {
    use std::io::{Seek, SeekFrom, Write};
    let laszip = laz::LazVlrBuilder::default()
        .with_point_format(format, extra)
        .unwrap()
        .with_fixed_chunk_size(4)
        .build();
    let mut description = Vec::new();
    laszip.write_to(&mut description).unwrap();
    let mut file = Cursor::new(Vec::new());
    file.write_all(&vec![0; at]).unwrap();
    file.seek(SeekFrom::Start(at as u64)).unwrap();
    let mut compressor = laz::LasZipCompressor::new(&mut file, laszip).unwrap();
    compressor.compress_many(records).unwrap();
    compressor.done().unwrap();
    drop(compressor);
    (description, file.into_inner().split_off(at))
}
