//! Files and URIs: which files may be opened, how much of them is read, and the container format GLB.

use std::borrow::Cow;
use std::path::{Component, Path, PathBuf};

use super::fault::{Fault, quoted};
use super::notices::Notices;
use crate::scene::geometry::SourceFile;
use crate::source::{Unreadable, read_file};

/// The most bytes by which a buffer's file may be longer than the buffer. The file is read whole for its hash.
const LONGEST_EXCESS: u64 = 64 << 20;

/// The most bytes of an image's file.
const LONGEST_IMAGE: u64 = 512 << 20;

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

/// Splits a GLB into its chunks; `None` if `file` is no GLB. Lengths that do not keep it from being read are warned of.
pub(super) fn split_glb<'a>(file: &'a [u8], notices: &Notices) -> Result<Option<Chunks<'a>>, Fault> {
    const JSON: u32 = 0x4e4f_534a;
    const BIN: u32 = 0x004e_4942;
    if !file.starts_with(b"glTF") {
        return Ok(None);
    }
    let fault = |problem: String| Err(Fault::new("GLB", problem));
    let warn = |problem: String| notices.warn(|| "GLB".to_owned(), problem);
    let (Some(version), Some(length)) = (u32_at(file, 4), u32_at(file, 8)) else {
        return fault(format!("the file is cut short within its header, after {} bytes", file.len()));
    };
    if version != 2 {
        return Err(
            Fault::new("GLB", format!("the container's version is {version}")).help("glTF 2.0 has version 2")
        );
    }
    let length = length as usize;
    let mut chunks = Vec::new();
    let mut at = 12;
    // The JSON and the binary chunk come first; later chunks belong to extensions.
    while chunks.len() < 2 && at < file.len() {
        let number = chunks.len();
        let (Some(size), Some(kind)) = (u32_at(file, at), u32_at(file, at + 4)) else {
            break;
        };
        // What lies after the end is a chunk only if the end that the header tells of is wrong.
        if number == 1 && at >= length && kind != BIN {
            break;
        }
        let Some(content) = file.get(at + 8..).and_then(|rest| rest.get(..size as usize)) else {
            return fault(format!(
                "the file is cut short: chunk {number} has {} bytes of the {size} that its header tells of",
                file.len() - at - 8
            ));
        };
        chunks.push((kind, content));
        // A chunk's length includes its padding.
        at += 8 + size as usize;
        let is_bin = |at: usize| u32_at(file, at + 4) == Some(BIN);
        let aligned = at.next_multiple_of(4);
        if number == 0 && !is_bin(at) && is_bin(aligned) {
            warn("the length of chunk 0 leaves out its padding".to_owned());
            at = aligned;
        }
    }
    let found = match chunks[..] {
        [(JSON, json)] => (json, None),
        [(JSON, json), (kind, content)] => (json, (kind == BIN).then_some(content)),
        [] if file.len() < length.max(20) => {
            return fault(format!("the file is cut short, after {} bytes", file.len()));
        }
        _ => return fault("the first chunk is not JSON".to_owned()),
    };
    if length > file.len() && (chunks.len() < 2 || at < file.len() && at + 8 > file.len()) {
        return fault(format!(
            "the file is cut short: it has {} bytes of the {length} that its header tells of",
            file.len()
        ));
    }
    match length {
        _ if length > file.len() || length < at => {
            warn(format!("the header gives the file's length as {length} bytes, but it has {}", file.len()));
        }
        _ if length < file.len() => warn(format!("{} bytes after its end are ignored", file.len() - length)),
        _ => {}
    }
    Ok(Some(found))
}

fn u32_at(bytes: &[u8], offset: usize) -> Option<u32> {
    let bytes = bytes.get(offset..offset + 4)?;
    Some(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
}

/// The folders of a scene's files.
pub(super) struct Folders {
    /// The folder of the path that the user gave, as it was given. URIs are relative to it.
    given: PathBuf,
    /// The folder that the scene's file lies in once all links are followed. URIs are relative to it where the folder that was
    /// given lacks their file.
    real: PathBuf,
    /// The canonical folders that files may lie in.
    open: Vec<PathBuf>,
    /// Whether the user has opened folders besides the scene's own.
    is_widened: bool,
}

impl Folders {
    /// The folders of the scene at `path`, and those that the user has allowed besides.
    ///
    /// A scene that is itself a link was laid there by its user, or by a tool that keeps the files of a project in a store
    /// (git-annex, DVC, Bazel, Nix). Its buffers are links into the same store then, so the store is open too: the first
    /// folder on the way to the scene's real file that is not on the way to the link.
    pub fn of(path: &Path, allowed: &[PathBuf]) -> Result<Self, Fault> {
        let file = path.canonicalize().map_err(Unreadable::from)?;
        let in_no_folder = || Fault::new("", "it is in no folder");
        let real = file.parent().ok_or_else(in_no_folder)?.to_path_buf();
        let given = match path.parent().ok_or_else(in_no_folder)? {
            here if here.as_os_str().is_empty() => PathBuf::from("."),
            folder => folder.to_path_buf(),
        };
        let named = given.canonicalize().map_err(Unreadable::from)?;
        let mut open = vec![named.clone(), real.clone()];
        open.extend(store(&named, &real));
        for folder in allowed {
            let folder = folder.canonicalize().map_err(|error| {
                let shown = quoted(&folder.to_string_lossy());
                Fault::new("--allow-folder", format!("{shown}: {}", Unreadable::from(error)))
            })?;
            open.push(folder);
        }
        Ok(Self { given, real, open, is_widened: !allowed.is_empty() })
    }

    fn is_open(&self, file: &Path) -> bool {
        self.open.iter().any(|folder| file.starts_with(folder))
    }
}

/// The folder below which a scene and its links' targets are kept, if the scene's real folder lies outside the named one.
fn store(named: &Path, real: &Path) -> Option<PathBuf> {
    if real.starts_with(named) || named.starts_with(real) {
        return None;
    }
    let shared = named.components().zip(real.components()).take_while(|(a, b)| a == b).count();
    Some(real.components().take(shared + 1).collect())
}

/// The bytes or the file that the `uri` of a buffer or an image leads to.
pub(super) enum Resolved {
    /// The bytes that a data: URI holds.
    Data(Vec<u8>),
    /// The canonical path of a file, which lies in an open folder.
    File(PathBuf),
}

/// Follows the `uri` of a buffer or an image. No file is opened.
pub(super) fn resolve(uri: &str, folders: &Folders) -> Result<Resolved, Fault> {
    let shown = quoted(uri);
    let fault = |problem: String| Fault::new("", problem);
    if let Some(data) = uri.get(..5).filter(|s| s.eq_ignore_ascii_case("data:")).and(uri.get(5..)) {
        return Ok(Resolved::Data(decode_data_uri(data)?));
    }
    const HELP: &str = "a uri names a file in the scene's own folder or below it, or is a data: URI";
    const WIDEN: &str = "a uri names a file in the scene's own folder or below it; --allow-folder DIR opens \
                         another folder to it";
    let refuse = |why: &str, help: &str| fault(format!("the uri {shown} {why}")).help(help);
    if has_scheme(uri) {
        return Err(refuse("is not a relative path", HELP));
    }
    let decoded = percent_decode(uri.as_bytes());
    let decoded =
        String::from_utf8(decoded).map_err(|_| refuse("is not UTF-8 once its % codes are decoded", HELP))?;
    // Some exporters write names as they are, without % codes, though the name holds what looks like one; some write paths
    // as Windows has them.
    let mut names = vec![decoded.replace('\\', "/"), uri.replace('\\', "/")];
    names.dedup();
    let mut first_error = None;
    for folder in [&folders.given, &folders.real] {
        for name in &names {
            let Relative { path, leaves } = check_relative(name).map_err(|why| refuse(why, HELP))?;
            if leaves && !folders.is_widened {
                return Err(refuse("leaves the scene's folder", WIDEN));
            }
            match folder.join(path).canonicalize() {
                Ok(path) if folders.is_open(&path) => return Ok(Resolved::File(path)),
                Ok(_) if leaves => return Err(refuse("leaves the folders that are allowed", WIDEN)),
                Ok(_) => return Err(refuse("leaves the scene's folder through a link", WIDEN)),
                Err(error) => first_error.get_or_insert(error),
            };
        }
    }
    let error = first_error.unwrap_or_else(|| std::io::ErrorKind::NotFound.into());
    Err(Fault::from(Unreadable::from(error))
        .of_file(&shown)
        .help("a scene's buffers and images are kept beside it: copy them along with the .gltf"))
}

/// The bytes of the file at `path`, of which a buffer needs `needed`, and the record of it. It may be shorter, but has
/// `byte_length` bytes at least.
pub(super) fn read_buffer(
    uri: &str,
    path: &Path,
    needed: u64,
    byte_length: u64,
) -> Result<(Vec<u8>, SourceFile), Fault> {
    let shown = quoted(uri);
    let bytes = read_file(path, needed.saturating_add(LONGEST_EXCESS)).map_err(|error| {
        let fault = match error {
            Unreadable::TooLarge { bytes, .. } => Fault::new(
                "",
                format!("its {bytes} bytes are far more than the buffer's byteLength, {byte_length}"),
            ),
            other => other.into(),
        };
        fault.of_file(&shown)
    })?;
    if (bytes.len() as u64) < byte_length {
        let problem = format!("it has {} bytes, but the buffer's byteLength is {byte_length}", bytes.len());
        return Err(Fault::new("", problem).of_file(&shown));
    }
    let source = source_file(uri, &bytes);
    Ok((bytes, source))
}

/// The bytes of the image at `path`, and the record of it.
pub(super) fn read_image(uri: &str, path: &Path) -> Result<(Vec<u8>, SourceFile), Fault> {
    let bytes = read_file(path, LONGEST_IMAGE).map_err(|error| Fault::from(error).of_file(&quoted(uri)))?;
    let source = source_file(uri, &bytes);
    Ok((bytes, source))
}

/// Whether a URI starts with a scheme (RFC 3986, section 3.1).
fn has_scheme(uri: &str) -> bool {
    uri.split_once(':').is_some_and(|(scheme, _)| {
        scheme.starts_with(|c: char| c.is_ascii_alphabetic())
            && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c))
    })
}

/// A relative path, and whether it leaves the folder that it is relative to.
#[derive(Debug, PartialEq)]
struct Relative {
    path: PathBuf,
    leaves: bool,
}

/// Checks that the path is relative, on every operating system.
fn check_relative(path: &str) -> Result<Relative, &'static str> {
    if path.is_empty() {
        return Err("is empty");
    }
    if path.contains('\0') {
        return Err("holds a NUL");
    }
    let (mut depth, mut leaves, path) = (0_usize, false, Path::new(path));
    for component in path.components() {
        match component {
            Component::Normal(_) => depth += 1,
            Component::CurDir => {}
            Component::ParentDir => match depth.checked_sub(1) {
                Some(above) => depth = above,
                None => leaves = true,
            },
            Component::RootDir | Component::Prefix(_) => return Err("is not a relative path"),
        }
    }
    Ok(Relative { path: path.to_path_buf(), leaves })
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
    let mut data = Cow::Borrowed(data.as_bytes());
    if !base64 || data.contains(&b'%') {
        data = percent_decode(&data).into();
    }
    if base64 { decode_base64(&data) } else { Ok(data.into_owned()) }
}

/// Decodes base64 with the alphabet of RFC 4648, section 4; the padding may be left out.
fn decode_base64(text: &[u8]) -> Result<Vec<u8>, Fault> {
    let text = match text.iter().any(u8::is_ascii_whitespace) {
        // Some writers break the lines of long texts.
        true => Cow::Owned(text.iter().copied().filter(|b| !b.is_ascii_whitespace()).collect::<Vec<u8>>()),
        false => Cow::Borrowed(text),
    };
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
        assert_eq!(decode_base64(b" Zm9v\r\nYg =\n=\n").unwrap(), b"foob");
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
            assert_eq!(check_relative(good), Ok(Relative { path: PathBuf::from(good), leaves: false }));
        }
        for outside in ["..", "../a", "sub/../../a", "../a/b/c"] {
            assert!(check_relative(outside).unwrap().leaves, "{outside}");
        }
        for bad in ["", "/etc/passwd", "a\0b", "//host/a"] {
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

    fn told(file: &[u8]) -> Vec<String> {
        let notices = Notices::default();
        split_glb(file, &notices).unwrap().unwrap();
        notices.into_list().iter().map(ToString::to_string).collect()
    }

    #[test]
    fn glb_chunks() {
        let whole = glb(&[(b"JSON", b"{}  "), (b"BIN\0", b"1234"), (b"XTRA", b"5678")]);
        let notices = Notices::default();
        assert_eq!(split_glb(&whole, &notices).unwrap(), Some((&b"{}  "[..], Some(&b"1234"[..]))));
        let other = glb(&[(b"JSON", b"{}  "), (b"XTRA", b"5678")]);
        assert_eq!(split_glb(&other, &notices).unwrap(), Some((&b"{}  "[..], None)));
        assert_eq!(split_glb(b"{}", &notices).unwrap(), None);
        assert!(split_glb(&glb(&[(b"BIN\0", b"1234")]), &notices).is_err());
        assert!(split_glb(&glb(&[]), &notices).is_err());
        assert_eq!(notices.into_list(), []);
        // A file that ends before its binary chunk does is cut short. What comes after that chunk is of no use.
        for length in 4..24 + 12 {
            let error = split_glb(&whole[..length], &Notices::default()).unwrap_err();
            assert!(error.problem.contains("cut short"), "{length}: {error}");
        }
        let longer = [&whole[..], b"tail"].concat();
        assert_eq!(told(&longer), ["GLB: 4 bytes after its end are ignored"]);
    }

    #[test]
    fn a_wrong_length_is_warned_of() {
        let whole = glb(&[(b"JSON", b"{}  "), (b"BIN\0", b"1234")]);
        for length in [0, 11, 12, 24, 35, 37, u32::MAX] {
            let mut file = whole.clone();
            file[8..12].copy_from_slice(&length.to_le_bytes());
            let expected =
                format!("GLB: the header gives the file's length as {length} bytes, but it has 36");
            assert_eq!(told(&file), [expected]);
            let chunks = split_glb(&file, &Notices::default()).unwrap();
            assert_eq!(chunks, Some((&b"{}  "[..], Some(&b"1234"[..]))));
        }
        // Some writers pad a chunk without counting the padding.
        let mut file = glb(&[(b"JSON", b"{}"), (b"BIN\0", b"1234")]);
        file.splice(22..22, [b' ', b' ']);
        let length = file.len() as u32;
        file[8..12].copy_from_slice(&length.to_le_bytes());
        assert_eq!(told(&file), ["GLB: the length of chunk 0 leaves out its padding"]);
    }

    #[test]
    fn the_store_of_a_link_is_the_first_folder_that_is_not_on_the_way_to_it() {
        let of = |named: &str, real: &str| store(Path::new(named), Path::new(real));
        assert_eq!(of("/r/scenes", "/r/.git/annex/objects/a/b"), Some("/r/.git".into()));
        assert_eq!(of("/home/u/scenes", "/nix/store/hash-scene"), Some("/nix".into()));
        assert_eq!(of("/r/scenes", "/r/scenes/parts"), None);
        assert_eq!(of("/r/scenes", "/r"), None);
    }
}
