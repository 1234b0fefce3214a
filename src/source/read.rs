//! The one way to read a file.

use std::fmt;
use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;

use super::file_kind::{FileKind, HEAD_BYTES};
use super::memory;
use super::suggest::missing_file_help;

/// Why a file can't be read.
#[derive(Debug)]
pub(crate) enum Unreadable {
    /// Nothing has its name.
    Missing,
    /// Something that is no regular file has its name: `a folder`, or `a pipe or a device`.
    NotAFile(&'static str),
    /// The file has more bytes than are read of its kind.
    TooLarge {
        /// Its bytes, or what was read of it when it grew.
        bytes: u64,
        /// The most that are read.
        limit: u64,
    },
    /// The file's bytes do not fit into memory.
    OutOfMemory(u64),
    /// The operating system refuses it.
    Io(io::Error),
    /// The file was read, but it is no text. The report says where.
    Reported,
}

impl fmt::Display for Unreadable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Missing => f.write_str("there is no such file"),
            Self::NotAFile(kind) => write!(f, "this is {kind}, not a file"),
            Self::TooLarge { bytes, limit } => {
                write!(f, "the file has {bytes} bytes, more than the {limit} that are read of such a file")
            }
            Self::OutOfMemory(bytes) => write!(f, "the file's {bytes} bytes do not fit into memory"),
            Self::Io(error) if error.kind() == io::ErrorKind::PermissionDenied => {
                f.write_str("reading the file is not permitted")
            }
            Self::Io(error) => write!(f, "the file can't be read: {error}"),
            Self::Reported => f.write_str("the file has errors"),
        }
    }
}

impl Unreadable {
    /// The help for a file that is not there. `as_written` is the path that the user gave, `path` the same as it is opened.
    pub fn help(&self, as_written: &str, path: &Path) -> Option<String> {
        match self {
            Self::Missing => missing_file_help(as_written, path),
            _ => None,
        }
    }
}

impl std::error::Error for Unreadable {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Io(error) => Some(error),
            _ => None,
        }
    }
}

impl From<io::Error> for Unreadable {
    fn from(error: io::Error) -> Self {
        match error.kind() {
            io::ErrorKind::NotFound | io::ErrorKind::NotADirectory => Self::Missing,
            _ => Self::Io(error),
        }
    }
}

/// A file of so many bytes is read without asking for the machine's memory.
const ALWAYS_FITS: u64 = 64 << 20;

/// Reads a regular file of at most `limit` bytes.
///
/// A pipe, a device or a socket is never opened, since opening or reading one could wait for ever, and no more than `limit`
/// bytes are read of a file that grows meanwhile.
///
/// # Errors
/// All that [`Unreadable`] lists, except [`Unreadable::Reported`].
pub(crate) fn read_file(path: &Path, limit: u64) -> Result<Vec<u8>, Unreadable> {
    let (file, length) = open_regular(path)?;
    if length > limit {
        return Err(Unreadable::TooLarge { bytes: length, limit });
    }
    // Something is made of the content beside it.
    if length > ALWAYS_FITS && memory::of_machine().is_some_and(|memory| length > memory / 2) {
        return Err(Unreadable::OutOfMemory(length));
    }
    let mut bytes = Vec::new();
    // With one byte more than the length, the read that finds the end does not make the buffer grow.
    let capacity = usize::try_from(length).map_err(|_| Unreadable::OutOfMemory(length))?.saturating_add(1);
    bytes.try_reserve_exact(capacity).map_err(|_| Unreadable::OutOfMemory(length))?;
    file.take(limit.saturating_add(1)).read_to_end(&mut bytes)?;
    match bytes.len() as u64 {
        bytes if bytes > limit => Err(Unreadable::TooLarge { bytes, limit }),
        _ => Ok(bytes),
    }
}

/// Most of a file that is read to recognise it.
const MOST_TO_RECOGNISE: u64 = 16 << 20;

/// The kind of a file, by its beginning; of JSON, as much is read as its keys may need.
///
/// # Errors
/// As [`read_file`], except that no file is too large.
pub(crate) fn recognise(path: &Path) -> Result<FileKind, Unreadable> {
    let (mut file, length) = open_regular(path)?;
    let mut head = Vec::new();
    (&mut file).take(HEAD_BYTES as u64).read_to_end(&mut head)?;
    if FileKind::needs_more(&head, length) {
        file.take(MOST_TO_RECOGNISE).read_to_end(&mut head)?;
    }
    Ok(FileKind::of(&head, length))
}

/// Whether a path is that of a job or a sensor file: what it has is TOML or, where the content doesn't say, its name ends so.
pub(crate) fn is_config(path: &Path) -> bool {
    match recognise(path) {
        Ok(FileKind::Job | FileKind::Toml) => true,
        Ok(FileKind::Text | FileKind::Empty | FileKind::Unknown) | Err(_) => {
            path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"))
        }
        Ok(_) => false,
    }
}

/// Opens a regular file, and gives its length.
fn open_regular(path: &Path) -> Result<(File, u64), Unreadable> {
    // Opening a pipe would wait for its writer, so the kind of the file is looked up before it is opened, and again after:
    // the name may have come to mean another file.
    regular_length(&fs::metadata(path)?)?;
    if is_of_the_system(path) {
        return Err(Unreadable::NotAFile("a view of the system's state"));
    }
    let file = File::open(path)?;
    let length = regular_length(&file.metadata()?)?;
    Ok((file, length))
}

/// Whether a path leads to one of the files that the system makes up when they are read, such as a process's environment,
/// which is no one's to show in a message. `/dev/stdin` is whatever file it stands for.
fn is_of_the_system(path: &Path) -> bool {
    let Ok(real) = fs::canonicalize(path) else { return false };
    let is_under = |root: &str| real.starts_with(root);
    is_under("/proc") || is_under("/sys") || (is_under("/dev") && !is_under("/dev/shm"))
}

fn regular_length(metadata: &fs::Metadata) -> Result<u64, Unreadable> {
    if metadata.is_file() {
        Ok(metadata.len())
    } else if metadata.is_dir() {
        Err(Unreadable::NotAFile("a folder"))
    } else {
        Err(Unreadable::NotAFile("a pipe or a device"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_read_up_to_the_limit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("five");
        fs::write(&path, b"12345").unwrap();
        assert_eq!(read_file(&path, 5).unwrap(), b"12345");
        assert_eq!(read_file(&path, u64::MAX).unwrap(), b"12345");
        let error = read_file(&path, 4).unwrap_err();
        assert!(matches!(error, Unreadable::TooLarge { bytes: 5, limit: 4 }), "{error}");
    }

    #[test]
    fn only_regular_files_are_opened() {
        let folder = tempfile::tempdir().unwrap();
        let error = |name: &str| read_file(&folder.path().join(name), 9).unwrap_err().to_string();
        assert_eq!(error("none"), "there is no such file");
        assert_eq!(error("none/deeper"), "there is no such file");
        assert_eq!(error(""), "this is a folder, not a file");
        #[cfg(unix)]
        {
            // A listening socket's file is no regular one, as a pipe's is none.
            let _listener = std::os::unix::net::UnixListener::bind(folder.path().join("socket")).unwrap();
            assert_eq!(error("socket"), "this is a pipe or a device, not a file");
            let zero = read_file(Path::new("/dev/zero"), 9).unwrap_err();
            assert!(matches!(zero, Unreadable::NotAFile(_)), "{zero}");
        }
    }

    /// The root of the case job-reads-and-shows-any-file.
    #[cfg(target_os = "linux")]
    #[test]
    fn no_state_of_the_system_is_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("rays.csv");
        std::os::unix::fs::symlink("/proc/self/environ", &link).unwrap();
        for path in [Path::new("/proc/self/environ"), Path::new("/proc/./cpuinfo"), &link] {
            let error = read_file(path, 1 << 20).unwrap_err().to_string();
            assert_eq!(error, "this is a view of the system's state, not a file");
        }
    }

    #[test]
    fn the_operating_system_s_error_is_the_source() {
        let refused = Unreadable::from(io::Error::from(io::ErrorKind::PermissionDenied));
        assert!(std::error::Error::source(&refused).is_some());
        assert_eq!(refused.to_string(), "reading the file is not permitted");
    }

    #[test]
    fn a_file_larger_than_the_machine_is_not_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sparse.glb");
        // The file has no block of the disk.
        fs::File::create(&path).unwrap().set_len(1 << 42).unwrap();
        assert!(matches!(read_file(&path, u64::MAX), Err(Unreadable::OutOfMemory(_))));
    }
}
