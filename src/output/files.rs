//! Output files that are either complete or absent.

use std::collections::BTreeSet;
use std::fs;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use crate::error::Error;

/// The output folder of a run, and the files that the run will write there.
///
/// A file gets its final name only when it is complete: it is written under a temporary name in the same folder, flushed to
/// the disk and renamed. The temporary file is removed if anything fails.
#[derive(Clone, Debug)]
pub struct Destination {
    folder: PathBuf,
    names: Vec<String>,
}

/// An output file, as the manifest lists it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WrittenFile {
    /// The path in the folder, with forward slashes.
    pub path: String,
    /// The length in bytes.
    pub bytes: u64,
    /// The BLAKE3 hash of the content, in hexadecimal.
    pub blake3: String,
}

/// An output file that grows. It has no name until it is finished, and it is removed if it never is.
#[derive(Debug)]
pub struct GrowingFile {
    name: String,
    path: PathBuf,
    file: BufWriter<tempfile::NamedTempFile>,
    hasher: blake3::Hasher,
    bytes: u64,
}

impl Write for GrowingFile {
    fn write(&mut self, content: &[u8]) -> io::Result<usize> {
        let written = self.file.write(content)?;
        self.hasher.update(&content[..written]);
        self.bytes += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl GrowingFile {
    /// The path that the file will have.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Flushes the file to the disk and gives it its final name.
    ///
    /// # Errors
    /// [`Error::Output`] about the file, such as when the disk is full. The temporary file is removed then, and an older
    /// file of the same name is kept.
    pub fn finish(self) -> Result<WrittenFile, Error> {
        let Self { name, path, file, hasher, bytes } = self;
        let persist = || {
            let file = file.into_inner().map_err(io::IntoInnerError::into_error)?;
            file.as_file().sync_all()?;
            file.persist(&path).map_err(|e| e.error)?;
            Ok(())
        };
        persist().map_err(|e: io::Error| unwritable(&path, e))?;
        Ok(WrittenFile { path: name, bytes, blake3: hasher.finalize().to_hex().to_string() })
    }
}

impl Destination {
    /// A destination for `names`, which are paths relative to `folder` with forward slashes. It checks that the folders can
    /// be made and written to, and that the files do not exist yet or may be replaced. The check leaves nothing behind.
    ///
    /// # Errors
    /// [`Error::Output`] about the first folder or file that is in the way.
    pub fn check(folder: &Path, names: Vec<String>, overwrite: bool) -> Result<Self, Error> {
        let destination = Self { folder: folder.to_path_buf(), names };
        for folder in destination.folders() {
            check_folder(&folder)?;
        }
        for path in destination.paths() {
            match fs::symlink_metadata(&path) {
                Ok(found) if found.is_dir() => {
                    return Err(Error::output(&path, "is a folder, where a file is to be written"));
                }
                Ok(_) if !overwrite => {
                    return Err(Error::output(
                        &path,
                        "exists already; --overwrite replaces it, --out DIR writes elsewhere",
                    ));
                }
                Err(e) if e.kind() != io::ErrorKind::NotFound => return Err(unwritable(&path, e)),
                _ => {}
            }
        }
        Ok(destination)
    }

    /// The files that will be written, in the order of their names in [`Destination::check`].
    pub fn paths(&self) -> impl Iterator<Item = PathBuf> + '_ {
        self.names.iter().map(|name| self.folder.join(name))
    }

    /// Makes the folders, and removes an old `manifest`, which would be wrong as soon as the first file is replaced.
    ///
    /// # Errors
    /// [`Error::Output`] about the folder or the manifest.
    pub fn prepare(&self, manifest: &str) -> Result<(), Error> {
        for folder in self.folders() {
            fs::create_dir_all(&folder).map_err(|e| unwritable(&folder, e))?;
            check_folder(&folder)?;
        }
        let manifest = self.folder.join(manifest);
        match fs::remove_file(&manifest) {
            Err(e) if e.kind() != io::ErrorKind::NotFound => Err(unwritable(&manifest, e)),
            _ => Ok(()),
        }
    }

    /// Writes the file `name`, completely or not at all.
    ///
    /// # Errors
    /// [`Error::Output`] about the file, such as when the disk is full. The temporary file is removed then, and an older
    /// file of the same name is kept.
    pub fn write(&self, name: &str, content: &[u8]) -> Result<WrittenFile, Error> {
        let path = self.folder.join(name);
        write_complete(&path, content).map_err(|e| unwritable(&path, e))?;
        Ok(WrittenFile {
            path: name.to_owned(),
            bytes: content.len() as u64,
            blake3: blake3::hash(content).to_hex().to_string(),
        })
    }

    /// Opens the file `name`, to be written piece by piece. It gets its name when it is finished.
    ///
    /// # Errors
    /// [`Error::Output`] about the file.
    pub fn open(&self, name: &str) -> Result<GrowingFile, Error> {
        let path = self.folder.join(name);
        let temporary = temporary_in(path.parent().unwrap_or(Path::new("")));
        let temporary = temporary.map_err(|e| unwritable(&path, e))?;
        let (file, hasher) = (BufWriter::new(temporary), blake3::Hasher::new());
        Ok(GrowingFile { name: name.to_owned(), path, file, hasher, bytes: 0 })
    }

    /// The folder itself and the folders of its files.
    fn folders(&self) -> BTreeSet<PathBuf> {
        let of_files = self.paths().filter_map(|path| path.parent().map(Path::to_path_buf));
        of_files.chain([self.folder.clone()]).collect()
    }
}

/// Writes a file that belongs to no run, such as a report, completely or not at all. It makes the file's folder if
/// necessary.
///
/// # Errors
/// [`Error::Output`] about the file. An older file of the same name is kept then.
pub fn write_file(path: &Path, content: &[u8]) -> Result<(), Error> {
    let folder = path.parent().unwrap_or(Path::new(""));
    fs::create_dir_all(here_if_empty(folder)).map_err(|e| unwritable(folder, e))?;
    write_complete(path, content).map_err(|e| unwritable(path, e))
}

fn write_complete(path: &Path, content: &[u8]) -> io::Result<()> {
    let mut file = temporary_in(path.parent().unwrap_or(Path::new("")))?;
    file.write_all(content)?;
    file.as_file().sync_all()?;
    file.persist(path).map_err(|e| e.error)?;
    Ok(())
}

/// Checks that `folder`, or its nearest existing ancestor, is a folder that can be written to.
fn check_folder(folder: &Path) -> Result<(), Error> {
    for ancestor in folder.ancestors() {
        match fs::metadata(here_if_empty(ancestor)) {
            Ok(found) if !found.is_dir() => {
                return Err(Error::output(ancestor, "is a file, where a folder is needed"));
            }
            Ok(_) => return temporary_in(ancestor).map(drop).map_err(|e| unwritable(ancestor, e)),
            Err(e) if e.kind() == io::ErrorKind::NotFound => {}
            // The loop goes on to the ancestor that is no folder, and the error names that one.
            Err(e) if e.kind() == io::ErrorKind::NotADirectory => {}
            Err(e) => return Err(unwritable(ancestor, e)),
        }
    }
    Err(Error::output(folder, "does not exist, and neither does any folder above it"))
}

/// An empty file that removes itself unless it gets its final name.
fn temporary_in(folder: &Path) -> io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".beamcast-").suffix(".tmp");
    #[cfg(unix)]
    {
        // By default a temporary file is readable by its owner only. This one becomes an output, whose permissions follow
        // the umask.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(here_if_empty(folder))
}

/// The current folder for an empty path, which is the parent of a relative path with one component.
fn here_if_empty(path: &Path) -> &Path {
    if path.as_os_str().is_empty() { Path::new(".") } else { path }
}

/// The reason why a file cannot be written, in plain words, with the operating system's error as its source.
#[derive(Debug, thiserror::Error)]
#[error("{words}")]
struct Unwritable {
    words: String,
    source: io::Error,
}

fn unwritable(path: &Path, source: io::Error) -> Error {
    use io::ErrorKind as Kind;
    let words = match source.kind() {
        Kind::StorageFull => "can't be written: the disk is full".into(),
        Kind::QuotaExceeded => "can't be written: the disk quota is used up".into(),
        Kind::PermissionDenied => "can't be written: permission denied".into(),
        Kind::ReadOnlyFilesystem => "can't be written: the file system is read-only".into(),
        Kind::AlreadyExists | Kind::NotADirectory => "can't be made a folder: a file is in the way".into(),
        Kind::NotFound => "can't be written: the folder takes no files, or is gone".into(),
        _ => format!("can't be written: {source}"),
    };
    Error::output(here_if_empty(path), Unwritable { words, source })
}

#[cfg(test)]
mod tests {
    use super::*;

    const MANIFEST: &str = "manifest.json";

    fn names() -> Vec<String> {
        vec!["top/000000.exr".into(), MANIFEST.into()]
    }

    fn check(folder: &Path, overwrite: bool) -> Result<Destination, Error> {
        Destination::check(folder, names(), overwrite)
    }

    /// The paths of all files under `folder`, with forward slashes, sorted.
    fn files_under(folder: &Path) -> Vec<String> {
        let mut found = Vec::new();
        for entry in fs::read_dir(folder).unwrap() {
            let entry = entry.unwrap();
            let name = entry.file_name().to_string_lossy().into_owned();
            if entry.file_type().unwrap().is_dir() {
                found.extend(files_under(&entry.path()).into_iter().map(|f| format!("{name}/{f}")));
            } else {
                found.push(name);
            }
        }
        found.sort();
        found
    }

    #[test]
    fn checking_leaves_nothing_behind() {
        let tmp = tempfile::tempdir().unwrap();
        let destination = check(&tmp.path().join("a/b"), false).unwrap();
        assert_eq!(fs::read_dir(tmp.path()).unwrap().count(), 0);
        assert_eq!(destination.paths().count(), 2);
    }

    #[test]
    fn written_files_are_complete_and_hashed() {
        let tmp = tempfile::tempdir().unwrap();
        let destination = check(&tmp.path().join("out"), false).unwrap();
        destination.prepare(MANIFEST).unwrap();
        let written = destination.write("top/000000.exr", b"pixels").unwrap();
        assert_eq!(fs::read(tmp.path().join("out/top/000000.exr")).unwrap(), b"pixels");
        assert_eq!((written.path.as_str(), written.bytes), ("top/000000.exr", 6));
        assert_eq!(written.blake3, blake3::hash(b"pixels").to_hex().as_str());
        assert_eq!(files_under(tmp.path()), ["out/top/000000.exr"]);
    }

    #[test]
    fn a_growing_file_has_its_name_when_it_is_finished() {
        let tmp = tempfile::tempdir().unwrap();
        let destination = check(tmp.path(), false).unwrap();
        destination.prepare(MANIFEST).unwrap();
        let mut growing = destination.open("top/000000.exr").unwrap();
        growing.write_all(b"pix").unwrap();
        growing.write_all(b"els").unwrap();
        assert!(!tmp.path().join("top/000000.exr").exists());
        let written = growing.finish().unwrap();
        assert_eq!(written, destination.write("top/000000.exr", b"pixels").unwrap());
        // A file that is dropped before it is finished leaves nothing behind.
        destination.open(MANIFEST).unwrap().write_all(b"{").unwrap();
        assert_eq!(files_under(tmp.path()), ["top/000000.exr"]);
    }

    #[cfg(unix)]
    #[test]
    fn outputs_are_as_readable_as_any_new_file() {
        use std::os::unix::fs::PermissionsExt;
        let tmp = tempfile::tempdir().unwrap();
        let destination = check(tmp.path(), false).unwrap();
        destination.prepare(MANIFEST).unwrap();
        destination.write(MANIFEST, b"{}").unwrap();
        fs::write(tmp.path().join("plain"), b"").unwrap();
        let mode = |name: &str| fs::metadata(tmp.path().join(name)).unwrap().permissions().mode();
        assert_eq!(mode(MANIFEST), mode("plain"));
    }

    #[test]
    fn existing_files_are_refused_or_overwritten() {
        let tmp = tempfile::tempdir().unwrap();
        let destination = check(tmp.path(), false).unwrap();
        destination.prepare(MANIFEST).unwrap();
        destination.write("top/000000.exr", b"old").unwrap();
        destination.write(MANIFEST, b"old").unwrap();

        let error = check(tmp.path(), false).unwrap_err();
        assert_eq!(error.exit_code(), 4);
        let message = error.to_string();
        assert!(
            message
                .ends_with("000000.exr: exists already; --overwrite replaces it, --out DIR writes elsewhere"),
            "{message}"
        );

        let destination = check(tmp.path(), true).unwrap();
        destination.prepare(MANIFEST).unwrap();
        assert_eq!(
            files_under(tmp.path()),
            ["top/000000.exr"],
            "no manifest tells of what is being replaced"
        );
        destination.write("top/000000.exr", b"new").unwrap();
        assert_eq!(fs::read(tmp.path().join("top/000000.exr")).unwrap(), b"new");
    }

    #[test]
    fn a_file_in_the_way_is_named() {
        let tmp = tempfile::tempdir().unwrap();
        fs::write(tmp.path().join("out"), b"").unwrap();
        for folder in ["out", "out/deeper/still"] {
            let message = check(&tmp.path().join(folder), true).unwrap_err().to_string();
            assert!(message.ends_with("out: is a file, where a folder is needed"), "{message}");
        }
        // A folder stands in place of an output file, and a file in place of the sensor's folder.
        fs::create_dir(tmp.path().join("run")).unwrap();
        fs::write(tmp.path().join("run/top"), b"").unwrap();
        let message = check(&tmp.path().join("run"), true).unwrap_err().to_string();
        assert!(message.ends_with("top: is a file, where a folder is needed"), "{message}");
        fs::create_dir_all(tmp.path().join("image/top/000000.exr")).unwrap();
        let message = check(&tmp.path().join("image"), true).unwrap_err().to_string();
        assert!(message.ends_with("000000.exr: is a folder, where a file is to be written"), "{message}");
    }

    #[test]
    fn a_write_that_fails_leaves_nothing() {
        let tmp = tempfile::tempdir().unwrap();
        let destination = check(tmp.path(), false).unwrap();
        destination.prepare(MANIFEST).unwrap();
        // A folder takes the file's name after the check, so the last step, the renaming, fails.
        fs::create_dir(tmp.path().join("top/000000.exr")).unwrap();
        let error = destination.write("top/000000.exr", b"pixels").unwrap_err();
        assert_eq!(error.exit_code(), 4);
        assert!(error.to_string().contains("000000.exr: can't be"), "{error}");
        assert_eq!(files_under(tmp.path()), [""; 0]);
        // The folder is removed, so the first step fails.
        fs::remove_dir_all(tmp.path().join("top")).unwrap();
        destination.write("top/000000.exr", b"pixels").unwrap_err();
        assert_eq!(files_under(tmp.path()), [""; 0]);
    }

    #[cfg(unix)]
    #[test]
    fn a_dangling_link_exists() {
        let tmp = tempfile::tempdir().unwrap();
        std::os::unix::fs::symlink("nowhere", tmp.path().join(MANIFEST)).unwrap();
        assert!(check(tmp.path(), false).is_err());
    }
}
