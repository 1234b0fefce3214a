//! Files and URIs: which files may be opened, how much of them is read, and the container format GLB.

use std::path::{Component, Path, PathBuf};

use super::fault::{Fault, quoted};
use crate::scene::geometry::SourceFile;
use crate::scene::notice::Notice;
use crate::source::{Unreadable, read_file};

/// The most bytes by which a buffer's file may be longer than the buffer. The file is read whole for its hash.
const LONGEST_EXCESS: u64 = 64 << 20;

/// The record of a file that was read.
pub(super) fn source_file(name: &str, bytes: &[u8]) -> SourceFile {
    SourceFile {
        name: name.to_owned(),
        bytes: bytes.len() as u64,
        blake3: blake3::hash(bytes).to_hex().to_string(),
    }
}

/// The JSON of a GLB and its binary chunk.
type Chunks<'a> = (&'a [u8], Option<&'a [u8]>);

/// Splits a GLB into its chunks; `None` if `file` is no GLB. Oddities that do not keep it from being read go to `notices`.
pub(super) fn split_glb<'a>(file: &'a [u8], notices: &mut Vec<Notice>) -> Result<Option<Chunks<'a>>, Fault> {
    const JSON: u32 = 0x4e4f_534a;
    const BIN: u32 = 0x004e_4942;
    if !file.starts_with(b"glTF") {
        return Ok(None);
    }
    let fault = |problem: String| Err(Fault::new("GLB", problem));
    let (Some(version), Some(length)) = (u32_at(file, 4), u32_at(file, 8)) else {
        return fault(format!("the file ends within its header, after {} bytes", file.len()));
    };
    if version != 2 {
        return Err(
            Fault::new("GLB", format!("the container's version is {version}")).help("glTF 2.0 has version 2")
        );
    }
    let Some(mut rest) = file.get(12..length as usize) else {
        return if (length as usize) < 12 {
            fault(format!("the header gives the file's length as {length} bytes, less than its own 12"))
        } else {
            fault(format!(
                "the file is cut short: it has {} bytes of the {length} that its header tells of",
                file.len()
            ))
        };
    };
    if file.len() > length as usize {
        let problem = format!("{} bytes after its end are ignored", file.len() - length as usize);
        notices.push(Notice::warning("GLB", problem));
    }
    let mut chunks = Vec::new();
    // The JSON and the binary chunk come first; later chunks belong to extensions.
    while !rest.is_empty() && chunks.len() < 2 {
        let number = chunks.len();
        let (Some(length), Some(kind)) = (u32_at(rest, 0), u32_at(rest, 4)) else {
            return fault(format!("chunk {number}'s header is cut short"));
        };
        let Some(content) = rest.get(8..8 + length as usize) else {
            return fault(format!(
                "chunk {number} has {} bytes of the {length} that its header tells of",
                rest.len() - 8
            ));
        };
        chunks.push((kind, content));
        // A chunk's length includes its padding.
        rest = &rest[8 + length as usize..];
    }
    match chunks[..] {
        [(JSON, json)] => Ok(Some((json, None))),
        [(JSON, json), (kind, content)] => Ok(Some((json, (kind == BIN).then_some(content)))),
        _ => fault("the first chunk is not JSON".to_owned()),
    }
}

fn u32_at(bytes: &[u8], offset: usize) -> Option<u32> {
    let bytes = bytes.get(offset..offset + 4)?;
    Some(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
}

/// The content that a buffer's `uri` names, which is to have `byte_length` bytes, and the file that it was read from, if any.
///
/// Only regular files below `folder`, which is canonical, are opened.
pub(super) fn resolve(
    uri: &str,
    folder: &Path,
    byte_length: u64,
) -> Result<(Vec<u8>, Option<SourceFile>), Fault> {
    let shown = quoted(uri);
    let fault = |problem: String| Fault::new("", problem);
    if let Some(data) = uri.get(..5).filter(|s| s.eq_ignore_ascii_case("data:")).and(uri.get(5..)) {
        return Ok((decode_data_uri(data)?, None));
    }
    const HELP: &str = "a buffer's uri names a file in the scene's own folder or below it, or is a data: URI";
    let refuse = |why: &str| fault(format!("the uri {shown} {why}")).help(HELP);
    if has_scheme(uri) {
        return Err(refuse("is not a relative path"));
    }
    let decoded = percent_decode(uri.as_bytes());
    let relative =
        String::from_utf8(decoded).map_err(|_| refuse("is not UTF-8 once its % codes are decoded"))?;
    let relative = check_relative(&relative).map_err(refuse)?;

    let path = folder.join(relative).canonicalize().map_err(|error| {
        Fault::from(Unreadable::from(error))
            .of_file(&shown)
            .help("a scene's buffers are kept beside it: copy the .bin file along with the .gltf")
    })?;
    if !path.starts_with(folder) {
        return Err(refuse("leaves the scene's folder through a link"));
    }
    let bytes = read_file(&path, byte_length.saturating_add(LONGEST_EXCESS)).map_err(|error| {
        let fault = match error {
            Unreadable::TooLarge { bytes, .. } => {
                fault(format!("its {bytes} bytes are far more than the buffer's byteLength, {byte_length}"))
            }
            other => other.into(),
        };
        fault.of_file(&shown)
    })?;
    if (bytes.len() as u64) < byte_length {
        let problem = format!("it has {} bytes, but the buffer's byteLength is {byte_length}", bytes.len());
        return Err(fault(problem).of_file(&shown));
    }
    let source = source_file(uri, &bytes);
    Ok((bytes, Some(source)))
}

/// Whether a URI starts with a scheme (RFC 3986, section 3.1).
fn has_scheme(uri: &str) -> bool {
    uri.split_once(':').is_some_and(|(scheme, _)| {
        scheme.starts_with(|c: char| c.is_ascii_alphabetic())
            && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
    })
}

/// Checks that the path stays below the folder that it is relative to, on every operating system.
fn check_relative(path: &str) -> Result<PathBuf, &'static str> {
    if path.is_empty() {
        return Err("is empty");
    }
    if path.contains('\0') {
        return Err("holds a NUL");
    }
    if path.contains('\\') {
        return Err("holds a backslash, where a uri has /");
    }
    let (mut depth, path) = (0_usize, Path::new(path));
    for component in path.components() {
        match component {
            Component::Normal(_) => depth += 1,
            Component::CurDir => {}
            Component::ParentDir => depth = depth.checked_sub(1).ok_or("leaves the scene's folder")?,
            Component::RootDir | Component::Prefix(_) => return Err("is not a relative path"),
        }
    }
    Ok(path.to_path_buf())
}

/// Decodes `%41` to `A`; a `%` without two hexadecimal digits after it is kept.
fn percent_decode(text: &[u8]) -> Vec<u8> {
    let digit = |at: usize| text.get(at).and_then(|&b| char::from(b).to_digit(16));
    let mut decoded = Vec::with_capacity(text.len());
    let mut at = 0;
    while at < text.len() {
        match (text[at], digit(at + 1), digit(at + 2)) {
            (b'%', Some(high), Some(low)) => {
                decoded.push((high * 16 + low) as u8);
                at += 3;
            }
            (byte, ..) => {
                decoded.push(byte);
                at += 1;
            }
        }
    }
    decoded
}

/// The content of a data: URI (RFC 2397); `rest` follows `data:`.
fn decode_data_uri(rest: &str) -> Result<Vec<u8>, Fault> {
    let no_comma = || Fault::new("", "the data: URI has no comma");
    let (media_type, data) = rest.split_once(',').ok_or_else(no_comma)?;
    let base64 = media_type.rsplit(';').next().is_some_and(|s| s.eq_ignore_ascii_case("base64"));
    let mut data = std::borrow::Cow::Borrowed(data.as_bytes());
    if !base64 || data.contains(&b'%') {
        data = percent_decode(&data).into();
    }
    if base64 { decode_base64(&data) } else { Ok(data.into_owned()) }
}

/// Decodes base64 with the alphabet of RFC 4648, section 4; the padding may be left out.
fn decode_base64(text: &[u8]) -> Result<Vec<u8>, Fault> {
    let end = text.len() - text.iter().rev().take(2).take_while(|&&b| b == b'=').count();
    let text = &text[..end];
    if text.len() % 4 == 1 {
        return Err(Fault::new("", "the data: URI is base64 of an impossible length"));
    }
    let mut decoded = Vec::with_capacity(text.len() / 4 * 3 + 3);
    for (index, group) in text.chunks(4).enumerate() {
        let mut bits = 0_u32;
        for (within, &byte) in group.iter().enumerate() {
            let value = match byte {
                b'A'..=b'Z' => byte - b'A',
                b'a'..=b'z' => byte - b'a' + 26,
                b'0'..=b'9' => byte - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                _ => {
                    let at = index * 4 + within;
                    return Err(Fault::new(
                        "",
                        format!(
                            "the data: URI is base64 with the byte {byte:#04x} at {at}, which has no meaning"
                        ),
                    ));
                }
            };
            bits |= u32::from(value) << (18 - 6 * within);
        }
        let bytes = bits.to_be_bytes();
        decoded.extend_from_slice(&bytes[1..group.len()]);
    }
    Ok(decoded)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_of_every_length() {
        assert_eq!(decode_base64(b"").unwrap(), b"");
        assert_eq!(decode_base64(b"Zg==").unwrap(), b"f");
        assert_eq!(decode_base64(b"Zm8=").unwrap(), b"fo");
        assert_eq!(decode_base64(b"Zm9vYmFy").unwrap(), b"foobar");
        assert_eq!(decode_base64(b"Zm9vYg").unwrap(), b"foob");
        assert_eq!(decode_base64(b"+/+/").unwrap(), [0xfb, 0xff, 0xbf]);
        assert!(decode_base64(b"Zm9vY").is_err());
        assert!(decode_base64(b"Zm9v!A==").unwrap_err().problem.contains("0x21 at 4"));
    }

    #[test]
    fn data_uris() {
        assert_eq!(decode_data_uri("application/octet-stream;base64,Zm8=").unwrap(), b"fo");
        assert_eq!(decode_data_uri(";BASE64,Zm8%3D").unwrap(), b"fo");
        assert_eq!(decode_data_uri(",a%00b%zz").unwrap(), b"a\0b%zz");
        assert!(decode_data_uri("base64").is_err());
    }

    #[test]
    fn paths_stay_below() {
        for good in ["a.bin", "sub/a.bin", "./a.bin", "sub/../a.bin", "a b.bin", "...", "C"] {
            assert_eq!(check_relative(good), Ok(PathBuf::from(good)));
        }
        for bad in ["", "/etc/passwd", "..", "../a", "sub/../../a", "a\0b", "..\\a", "\\\\host\\a"] {
            assert!(check_relative(bad).is_err(), "{bad}");
        }
        for scheme in ["file:///etc/passwd", "http://a/b", "C:/a", "a+b.c-d:e"] {
            assert!(has_scheme(scheme), "{scheme}");
        }
        for none in ["a.bin", "a/b:c", "1:2", ""] {
            assert!(!has_scheme(none), "{none}");
        }
    }

    #[test]
    fn percent_codes() {
        assert_eq!(percent_decode(b"Box%20With%20Spaces.bin"), b"Box With Spaces.bin");
        assert_eq!(percent_decode(b"%2e%2E/%"), b"../%");
        assert_eq!(percent_decode(b"100%.bin%4"), b"100%.bin%4");
    }

    fn glb(chunks: &[(&[u8], &[u8])]) -> Vec<u8> {
        let mut file = b"glTF\x02\0\0\0\0\0\0\0".to_vec();
        for (kind, content) in chunks {
            file.extend_from_slice(&(content.len() as u32).to_le_bytes());
            file.extend_from_slice(kind);
            file.extend_from_slice(content);
        }
        let length = file.len() as u32;
        file[8..12].copy_from_slice(&length.to_le_bytes());
        file
    }

    #[test]
    fn glb_chunks() {
        let whole = glb(&[(b"JSON", b"{}  "), (b"BIN\0", b"1234"), (b"XTRA", b"5678")]);
        let mut warnings = Vec::new();
        assert_eq!(split_glb(&whole, &mut warnings).unwrap(), Some((&b"{}  "[..], Some(&b"1234"[..]))));
        let other = glb(&[(b"JSON", b"{}  "), (b"XTRA", b"5678")]);
        assert_eq!(split_glb(&other, &mut warnings).unwrap(), Some((&b"{}  "[..], None)));
        assert_eq!(split_glb(b"{}", &mut warnings).unwrap(), None);
        assert!(split_glb(&glb(&[(b"BIN\0", b"1234")]), &mut warnings).is_err());
        assert!(split_glb(&glb(&[]), &mut warnings).is_err());
        assert!(warnings.is_empty());
        for length in 4..whole.len() {
            let error = split_glb(&whole[..length], &mut warnings).unwrap_err();
            assert!(length < 12 || error.problem.contains("cut short"), "{error}");
        }
        let longer = [&whole[..], b"tail"].concat();
        assert!(split_glb(&longer, &mut warnings).is_ok());
        assert_eq!(warnings, [Notice::warning("GLB", "4 bytes after its end are ignored")]);
    }
}
