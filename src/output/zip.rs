//! ZIP files, as far as an NPZ is one. The date of every member is the first that a ZIP can tell, so that the same content gives
//! the same bytes.

use super::deflate::deflate;
use super::format::EncodeError;

/// A member of a ZIP file.
pub(super) struct Member {
    name: String,
    method: u16,
    crc32: u32,
    /// The length before compression.
    length: usize,
    content: Vec<u8>,
}

const STORED: u16 = 0;
const DEFLATED: u16 = 8;
/// The version that a reader needs for folders and deflate: 2.0.
const VERSION: u16 = 20;
/// The names are in ASCII, and the lengths come before the content.
const FLAGS: u16 = 0;
/// Midnight, in MS-DOS's bits of hours, minutes and pairs of seconds.
const TIME: u16 = 0;
/// 1980-01-01: the years after 1980, the month and the day.
const DATE: u16 = 1 << 5 | 1;

impl Member {
    /// A member as it is.
    pub fn stored(name: String, content: Vec<u8>) -> Self {
        let crc32 = crc32fast::hash(&content);
        Self { name, method: STORED, crc32, length: content.len(), content }
    }

    /// A member that is compressed at a level.
    pub fn deflated(name: String, content: &[u8], level: u8) -> Self {
        let compressed = deflate(content, level);
        let crc32 = crc32fast::hash(content);
        Self { name, method: DEFLATED, crc32, length: content.len(), content: compressed }
    }

    /// The fields that the header of a member and its entry in the directory have in common.
    fn facts(&self) -> Result<Vec<u8>, EncodeError> {
        let name_length = u16::try_from(self.name.len()).map_err(|_| too_large())?;
        let mut facts = Vec::new();
        for number in [VERSION, FLAGS, self.method, TIME, DATE] {
            facts.extend(number.to_le_bytes());
        }
        for number in [self.crc32, below_4_gib(self.content.len())?, below_4_gib(self.length)?] {
            facts.extend(number.to_le_bytes());
        }
        facts.extend(name_length.to_le_bytes());
        facts.extend([0; 2]); // no extra field
        Ok(facts)
    }
}

/// A ZIP file of these members, in this order.
///
/// # Errors
/// An error if it has 4 GiB or more, which would need the format's extension for large files.
pub(super) fn zip(members: &[Member]) -> Result<Vec<u8>, EncodeError> {
    let count = u16::try_from(members.len()).map_err(|_| too_large())?;
    let length = members.iter().map(|member| member.content.len() + 2 * member.name.len() + 100).sum();
    let (mut file, mut directory) = (Vec::with_capacity(length), Vec::new());
    for member in members {
        let (start, facts) = (below_4_gib(file.len())?, member.facts()?);
        file.extend(b"PK\x03\x04");
        file.extend(&facts);
        file.extend(member.name.as_bytes());
        file.extend(&member.content);
        directory.extend(b"PK\x01\x02");
        directory.extend(VERSION.to_le_bytes());
        directory.extend(&facts);
        // No comment, the first disk, no attributes.
        directory.extend([0; 2 + 2 + 2 + 4]);
        directory.extend(start.to_le_bytes());
        directory.extend(member.name.as_bytes());
    }
    let (start, length) = (below_4_gib(file.len())?, below_4_gib(directory.len())?);
    file.extend(directory);
    file.extend(b"PK\x05\x06");
    file.extend([0; 4]); // the first disk has everything
    file.extend(count.to_le_bytes());
    file.extend(count.to_le_bytes());
    file.extend(length.to_le_bytes());
    file.extend(start.to_le_bytes());
    file.extend([0; 2]); // no comment
    Ok(file)
}

fn below_4_gib(length: usize) -> Result<u32, EncodeError> {
    u32::try_from(length).map_err(|_| too_large())
}

fn too_large() -> EncodeError {
    EncodeError::new("an NPZ has less than 4 GiB: fewer channels would fit")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_directory_points_at_the_members() {
        let members = [
            Member::stored("a.npy".into(), b"abc".to_vec()),
            Member::deflated("b/c.npy".into(), &[7; 1000], 1),
        ];
        let file = zip(&members).unwrap();
        let u16_at = |at: usize| usize::from(u16::from_le_bytes([file[at], file[at + 1]]));
        let u32_at = |at: usize| u32::from_le_bytes(file[at..at + 4].try_into().unwrap()) as usize;
        let end = file.len() - 22;
        assert_eq!((&file[end..end + 4], u16_at(end + 10)), (&b"PK\x05\x06"[..], 2));
        let mut entry = u32_at(end + 16);
        assert_eq!(entry + u32_at(end + 12), end);
        for member in &members {
            let (start, name) = (u32_at(entry + 42), u16_at(entry + 28));
            assert_eq!(&file[start..start + 4], b"PK\x03\x04");
            assert_eq!(&file[entry + 46..entry + 46 + name], member.name.as_bytes());
            assert_eq!(file[start + 4..start + 30], file[entry + 6..entry + 32], "the same facts");
            let content = &file[start + 30 + name..][..u32_at(start + 18)];
            assert_eq!(content, member.content);
            assert_eq!((u32_at(start + 14), u32_at(start + 22)), (member.crc32 as usize, member.length));
            entry += 46 + name;
        }
        assert_eq!(entry, end);
        // The check value that the definition of CRC-32 gives.
        assert_eq!(Member::stored(String::new(), b"123456789".to_vec()).crc32, 0xcbf4_3926);
        assert!(file.len() < 400, "the second is compressed");
    }
}
