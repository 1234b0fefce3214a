//! The pages of a file, and its description.

use super::super::error::ReadError;
use crate::output::e57::crc32c;

/// The bytes of a checksum, at the end of each page.
const CHECKSUM: usize = 4;

/// The pages' content, without the checksums.
pub(super) struct Pages {
    content: Vec<u8>,
    page: usize,
    /// The place and the length of the description.
    description: (u64, u64),
}

impl Pages {
    /// The content of a file. It takes as much memory as the file.
    pub fn of(file: &[u8]) -> Result<Self, ReadError> {
        let number = |at: usize| Some(u64::from_le_bytes(*file.get(at..)?.first_chunk()?));
        let header = || {
            let version = u32::from_le_bytes(*file.get(8..)?.first_chunk()?);
            Some((version, number(16)?, (number(24)?, number(32)?), number(40)?))
        };
        let header = header().filter(|_| file.starts_with(b"ASTM-E57"));
        let (version, length, description, page) = header.ok_or_else(|| ReadError::new("this is no E57"))?;
        if version != 1 {
            return Err(ReadError::new(format!("it is of version {version}, and 1 is read")));
        }
        // The standard has 1024 bytes; other powers of 2 are as easily read.
        let is_size = |page: &usize| page.is_power_of_two() && (64..=1 << 20).contains(page);
        let page = usize::try_from(page).ok().filter(is_size);
        let page = page.ok_or_else(|| ReadError::new("the size of its pages is none that is read"))?;
        let length = usize::try_from(length).ok().filter(|length| length.is_multiple_of(page));
        let whole = length.and_then(|length| file.get(..length)).ok_or_else(|| {
            ReadError::new(format!("it is cut short, or its header is wrong: it has {} bytes", file.len()))
        })?;
        let mut content = Vec::with_capacity(whole.len() / page * (page - CHECKSUM));
        for (index, bytes) in whole.chunks_exact(page).enumerate() {
            let (own, checksum) = bytes.split_at(page - CHECKSUM);
            if crc32c(own).to_be_bytes() != checksum {
                return Err(ReadError::new(format!("it is damaged: the checksum of page {index} is wrong")));
            }
            content.extend_from_slice(own);
        }
        Ok(Self { content, page, description })
    }

    /// The content from a place in the file on.
    pub fn from(&self, place: u64) -> Option<&[u8]> {
        let place = usize::try_from(place).ok()?;
        let within = Some(place % self.page).filter(|within| *within < self.page - CHECKSUM)?;
        self.content.get(place / self.page * (self.page - CHECKSUM) + within..)
    }

    /// The description of the scans, in XML.
    pub fn description(&self) -> Result<&str, ReadError> {
        let (place, length) = self.description;
        let xml = usize::try_from(length).ok().and_then(|length| self.from(place)?.get(..length));
        let xml = xml.ok_or_else(|| ReadError::new("its description lies outside of it"))?;
        std::str::from_utf8(xml).map_err(|_| ReadError::new("its description is no UTF-8"))
    }
}
