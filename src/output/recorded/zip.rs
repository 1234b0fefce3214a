//! Reading of ZIP files, as far as an NPZ is one: members that are stored or deflated. What the file says of sizes is checked before
//! it is believed.

use std::borrow::Cow;

use miniz_oxide::inflate::decompress_to_vec_with_limit;

use super::error::ReadError;

/// A member of a ZIP file.
pub(super) struct Member<'a> {
    pub name: String,
    method: u16,
    crc32: u32,
    /// The length that the file claims, before compression.
    pub length: u64,
    content: &'a [u8],
}

const STORED: u16 = 0;
const DEFLATED: u16 = 8;

/// The members in the order of the directory at the end of the file.
///
/// # Errors
/// A [`ReadError`] if the bytes are no ZIP, if they are cut short, or if the file has 4 GiB or more, or encrypted members.
pub(super) fn members(bytes: &[u8]) -> Result<Vec<Member<'_>>, ReadError> {
    const DIRECTORY_END: usize = 22;
    const LONGEST_COMMENT: usize = u16::MAX as usize;
    let cut_short = || ReadError::new("it is cut short: the directory at its end is missing or broken");
    let last = bytes.len().checked_sub(DIRECTORY_END).ok_or_else(cut_short)?;
    let first = last.saturating_sub(LONGEST_COMMENT);
    let is_end = |&at: &usize| {
        bytes[at..].starts_with(b"PK\x05\x06") && at + DIRECTORY_END + u16_at(bytes, at + 20) == bytes.len()
    };
    let end = (first..=last).rev().find(is_end).ok_or_else(cut_short)?;
    let (count, length, start) = (u16_at(bytes, end + 10), u32_at(bytes, end + 12), u32_at(bytes, end + 16));
    if count == usize::from(u16::MAX) || start == u32::MAX as usize {
        return Err(ReadError::new(
            "it is a ZIP64, which only a file of 4 GiB or more has to be, and those are not read",
        ));
    }
    let directory = start.checked_add(length).and_then(|stop| bytes[..end].get(start..stop));
    let mut directory = directory.ok_or_else(cut_short)?;
    let mut members = Vec::new();
    for _ in 0..count {
        let (member, rest) = member(bytes, directory)?.ok_or_else(cut_short)?;
        members.push(member);
        directory = rest;
    }
    Ok(members)
}

/// The member of the directory's first entry, and the entries after it. `None` if the entry is cut short.
fn member<'a>(bytes: &'a [u8], directory: &'a [u8]) -> Result<Option<(Member<'a>, &'a [u8])>, ReadError> {
    const ENTRY: usize = 46;
    const HEADER: usize = 30;
    const ENCRYPTED: usize = 1;
    if !directory.starts_with(b"PK\x01\x02") || directory.len() < ENTRY {
        return Ok(None);
    }
    let [name, extra, comment] = [28, 30, 32].map(|at| u16_at(directory, at));
    let Some((entry, rest)) = directory.split_at_checked(ENTRY + name + extra + comment) else {
        return Ok(None);
    };
    let name = String::from_utf8_lossy(&entry[ENTRY..ENTRY + name]).into_owned();
    if u16_at(entry, 8) & ENCRYPTED != 0 {
        return Err(ReadError::new(format!("its member {name:?} is encrypted")));
    }
    // The header before the content has lengths of its own for the name and the extra field.
    let content = || {
        let header = bytes
            .get(u32_at(entry, 42)..)
            .filter(|at| at.starts_with(b"PK\x03\x04") && at.len() >= HEADER)?;
        let start = HEADER + u16_at(header, 26) + u16_at(header, 28);
        header.get(start..)?.get(..u32_at(entry, 20))
    };
    let content = content()
        .ok_or_else(|| ReadError::new(format!("it is cut short: its member {name:?} is not whole")))?;
    let [crc32, length] = [16, 24].map(|at| u32_at(entry, at));
    let method = u16_at(entry, 10) as u16;
    Ok(Some((Member { name, method, crc32: crc32 as u32, length: length as u64, content }, rest)))
}

impl<'a> Member<'a> {
    /// The content, which takes no more than [`Member::length`] bytes; the caller has checked that there is memory for them.
    ///
    /// # Errors
    /// A [`ReadError`] if the content is broken or of another length.
    pub fn read(&self) -> Result<Cow<'a, [u8]>, ReadError> {
        let wrong = |why: &str| ReadError::new(format!("its member {:?} {why}", self.name));
        let content = match self.method {
            STORED => Cow::Borrowed(self.content),
            DEFLATED => {
                let limit = usize::try_from(self.length).unwrap_or(usize::MAX);
                let plain = decompress_to_vec_with_limit(self.content, limit);
                Cow::Owned(plain.map_err(|_| wrong("can't be decompressed to the length that it claims"))?)
            }
            other => return Err(wrong(&format!("has the compression {other}, and deflate is read"))),
        };
        if content.len() as u64 != self.length {
            return Err(wrong("has another length than it claims"));
        }
        if crc32fast::hash(&content) != self.crc32 {
            return Err(wrong("is damaged: its checksum is wrong"));
        }
        Ok(content)
    }
}

fn u16_at(bytes: &[u8], at: usize) -> usize {
    usize::from(bytes[at]) | usize::from(bytes[at + 1]) << 8
}

fn u32_at(bytes: &[u8], at: usize) -> usize {
    u16_at(bytes, at) | u16_at(bytes, at + 2) << 16
}
