//! Single files that are written whole or not at all, and the folders that a run has to itself.

use std::fs::{self, File, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use crate::error::Error;

/// The names of temporary files begin and end with these.
const TEMPORARY: [&str; 2] = [".beamcast-", ".tmp"];

/// Writes a file that belongs to no run, such as a report, completely or not at all. It makes the file's folder if
/// necessary. What is there already is replaced if it is a regular file; a device, or what the process has open (as
/// `/dev/stdout`), is written to as it is.
///
/// # Errors
/// [`Error::Output`] about the file. An older file of the same name is kept then.
pub fn write_file(path: &Path, content: &[u8]) -> Result<(), Error> {
    let target = match Target::of(path)? {
        Target::Nothing => {
            let folder = path.parent().unwrap_or(Path::new(""));
            fs::create_dir_all(here_if_empty(folder)).map_err(|e| unwritable(folder, e))?;
            path.to_path_buf()
        }
        Target::File(file) => file,
        Target::Open => {
            let opened = fs::OpenOptions::new().append(true).open(path);
            return opened.and_then(|mut file| file.write_all(content)).map_err(|e| unwritable(path, e));
        }
    };
    remove_leftovers(target.parent().unwrap_or(Path::new("")));
    write_complete(&target, content).map_err(|e| unwritable(path, e))?;
    flush_folder(target.parent().unwrap_or(Path::new("")));
    Ok(())
}

/// Checks what [`write_file`] would write to, before there is anything to write.
///
/// # Errors
/// [`Error::Output`] if the path can't be written to, or if there is a file and it may not be replaced.
pub fn check_file(path: &Path, overwrite: bool) -> Result<(), Error> {
    match Target::of(path)? {
        Target::File(_) if !overwrite => {
            Err(Error::output(path, "is there already (--overwrite replaces it)"))
        }
        Target::File(file) => check_folder(file.parent().unwrap_or(Path::new(""))),
        Target::Nothing => check_folder(path.parent().unwrap_or(Path::new(""))),
        Target::Open => Ok(()),
    }
}

/// The target that a single file is written to.
enum Target {
    /// Nothing has the name.
    Nothing,
    /// A regular file, which is replaced: the path itself, or the file that a link leads to.
    File(PathBuf),
    /// A device, or what a process has open, which are written to as they are. A file in place of `/dev/null` would be the
    /// end of it.
    Open,
}

impl Target {
    fn of(path: &Path) -> Result<Self, Error> {
        let found = match fs::symlink_metadata(here_if_empty(path)) {
            Ok(found) => found,
            Err(e) if matches!(e.kind(), io::ErrorKind::NotFound | io::ErrorKind::NotADirectory) => {
                return Ok(Self::Nothing);
            }
            Err(e) => return Err(unwritable(path, e)),
        };
        if found.is_file() {
            return Ok(Self::File(path.to_path_buf()));
        }
        let real = match fs::metadata(here_if_empty(path)) {
            Ok(real) => real,
            Err(e) if e.kind() == io::ErrorKind::NotFound => {
                return Err(Error::output(path, "is a link to nothing"));
            }
            Err(e) => return Err(unwritable(path, e)),
        };
        let is_open = leads_through_open_files(path);
        match kind_of(&real) {
            "a file" if is_open => Ok(Self::Open),
            "a file" => fs::canonicalize(path).map(Self::File).map_err(|e| unwritable(path, e)),
            "a pipe" if is_open => Ok(Self::Open),
            // Opening a pipe that nobody reads would wait for ever.
            "a pipe" => {
                Err(Error::output(path, "is a pipe: only one that is open already can be written to"))
            }
            "a device" => Ok(Self::Open),
            other => Err(Error::output(path, format!("is {other}, where a file is to be written"))),
        }
    }
}

/// The kind of thing that a path leads to, in words.
pub(super) fn kind_of(found: &fs::Metadata) -> &'static str {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        let kind = found.file_type();
        match () {
            () if kind.is_fifo() => return "a pipe",
            () if kind.is_char_device() => return "a device",
            () if kind.is_block_device() => return "a disk",
            () if kind.is_socket() => return "a socket",
            () => {}
        }
    }
    match () {
        () if found.is_file() => "a file",
        () if found.is_dir() => "a folder",
        () => "no file",
    }
}

/// Whether a path is a link that leads through the list of files that a process has open, as `/dev/stdout` and `/dev/fd/63`
/// do.
fn leads_through_open_files(path: &Path) -> bool {
    const MOST_LINKS: usize = 40; // Linux follows as many
    let mut path = path.to_path_buf();
    for _ in 0..MOST_LINKS {
        let folder = here_if_empty(path.parent().unwrap_or(Path::new(""))).to_path_buf();
        let is_listed = |folder: &Path| ["/proc", "/dev"].iter().any(|root| folder.starts_with(root));
        if fs::canonicalize(&folder).is_ok_and(|folder| is_listed(&folder)) {
            return true;
        }
        match fs::read_link(&path) {
            Ok(next) => path = folder.join(next),
            Err(_) => return false,
        }
    }
    false
}

/// Writes a file completely or not at all. It is on the disk, and its name is there when [`flush_folder`] is done.
pub(super) fn write_complete(path: &Path, content: &[u8]) -> io::Result<()> {
    let file = staged(path, content)?;
    file.as_file().sync_all()?;
    file.persist(path).map_err(|e| e.error)?;
    Ok(())
}

/// Writes a temporary file that is to become the file at a path.
pub(super) fn staged(path: &Path, content: &[u8]) -> io::Result<tempfile::NamedTempFile> {
    let mut file = temporary_in(path.parent().unwrap_or(Path::new("")))?;
    file.write_all(content)?;
    Ok(file)
}

/// Flushes a temporary file to the disk and gives it its final name.
pub(super) fn give_name(temporary: tempfile::NamedTempFile, path: &Path) -> io::Result<()> {
    temporary.as_file().sync_all()?;
    temporary.persist(path).map_err(|e| e.error)?;
    flush_folder(path.parent().unwrap_or(Path::new("")));
    Ok(())
}

/// Tells the system that nobody is going to read a file that is on the disk. It is free to ignore that, so an error means nothing.
pub(super) fn leave_cache(file: &File) {
    #[cfg(target_os = "linux")]
    let _ = rustix::fs::fadvise(file, 0, None, rustix::fs::Advice::DontNeed);
    #[cfg(not(target_os = "linux"))]
    let _ = file;
}

/// Flushes the names of a folder's files to the disk. A file system that can't flush folders keeps the order by itself.
pub(super) fn flush_folder(folder: &Path) {
    #[cfg(unix)]
    let _ = File::open(here_if_empty(folder)).and_then(|folder| folder.sync_all());
    #[cfg(not(unix))]
    let _ = folder;
}

/// An empty file that removes itself unless it gets its final name. It is locked while the process lives, by which
/// [`remove_leftovers`] knows that it is none.
pub(super) fn temporary_in(folder: &Path) -> io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(TEMPORARY[0]).suffix(TEMPORARY[1]);
    #[cfg(unix)]
    {
        // By default a temporary file is readable by its owner only. This one becomes an output, whose permissions follow
        // the umask.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    let file = builder.tempfile_in(here_if_empty(folder))?;
    // Where the file system has no locks, the worst is that a run at the same time removes the file, which is an error.
    let _ = file.as_file().try_lock();
    Ok(file)
}

/// Removes the temporary files of runs that were killed.
pub(super) fn remove_leftovers(folder: &Path) {
    for entry in fs::read_dir(here_if_empty(folder)).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let is_temporary =
            name.to_str().is_some_and(|name| name.starts_with(TEMPORARY[0]) && name.ends_with(TEMPORARY[1]));
        if is_temporary && entry.file_type().is_ok_and(|kind| kind.is_file()) {
            // The system releases a lock when its process ends in any way. A file that can't be removed does no harm.
            let _ = File::open(entry.path())
                .is_ok_and(|file| file.try_lock().is_ok() && fs::remove_file(entry.path()).is_ok());
        }
    }
}

/// A folder that no other run may write to.
#[derive(Debug)]
pub(super) struct Claim {
    // The lock lasts as long as the file is open, and no longer than the process.
    _locked: Option<File>,
}

impl Claim {
    /// Claims a folder that exists. The folder itself is locked, so nothing is left in it, and nothing is stale after a
    /// crash. Where the system locks no folders, the claim means nothing.
    ///
    /// # Errors
    /// [`Error::Output`] if another run has claimed it.
    pub fn on(folder: &Path) -> Result<Self, Error> {
        Self::by(folder, File::try_lock)
    }

    /// Claims a folder beside others that share it.
    ///
    /// # Errors
    /// [`Error::Output`] if another run has claimed it for itself.
    pub fn shared(folder: &Path) -> Result<Self, Error> {
        Self::by(folder, File::try_lock_shared)
    }

    fn by(folder: &Path, lock: fn(&File) -> Result<(), TryLockError>) -> Result<Self, Error> {
        let Ok(file) = File::open(here_if_empty(folder)) else { return Ok(Self { _locked: None }) };
        match lock(&file) {
            Ok(()) => Ok(Self { _locked: Some(file) }),
            Err(TryLockError::WouldBlock) => {
                let problem = "another run is writing to this folder; --out DIR writes elsewhere";
                Err(Error::output(folder, problem))
            }
            Err(TryLockError::Error(_)) => Ok(Self { _locked: None }),
        }
    }
}

/// Checks that `folder`, or its nearest existing ancestor, is a folder that can be written to.
pub(super) fn check_folder(folder: &Path) -> Result<(), Error> {
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

/// The current folder for an empty path, which is the parent of a relative path with one component.
pub(super) fn here_if_empty(path: &Path) -> &Path {
    if path.as_os_str().is_empty() { Path::new(".") } else { path }
}

/// The reason why a file cannot be written, in plain words, with the operating system's error as its source.
#[derive(Debug, thiserror::Error)]
#[error("{words}")]
struct Unwritable {
    words: String,
    source: io::Error,
}

pub(super) fn unwritable(path: &Path, source: io::Error) -> Error {
    use io::ErrorKind as Kind;
    let words = match source.kind() {
        Kind::StorageFull => "can't be written: the disk is full".into(),
        Kind::QuotaExceeded => "can't be written: the disk quota is used up".into(),
        Kind::FileTooLarge => {
            "can't be written: the file is larger than the system allows (`ulimit -f`)".into()
        }
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

    fn temporaries(folder: &Path) -> usize {
        fs::read_dir(folder).unwrap().filter(|e| e.as_ref().unwrap().file_name() != "page.html").count()
    }

    #[test]
    fn leftovers_of_dead_runs_are_removed_and_files_of_living_ones_are_not() {
        let tmp = tempfile::tempdir().unwrap();
        let living = temporary_in(tmp.path()).unwrap();
        fs::write(tmp.path().join(".beamcast-dead.tmp"), b"half").unwrap();
        fs::write(tmp.path().join("page.html"), b"old").unwrap();
        assert_eq!(temporaries(tmp.path()), 2);
        write_file(&tmp.path().join("page.html"), b"new").unwrap();
        assert_eq!(temporaries(tmp.path()), 1);
        give_name(living, &tmp.path().join("page.html")).unwrap();
        assert_eq!(temporaries(tmp.path()), 0);
    }

    #[cfg(unix)]
    #[test]
    fn a_folder_has_one_writer_at_a_time() {
        let tmp = tempfile::tempdir().unwrap();
        let claim = Claim::on(tmp.path()).unwrap();
        let error = Claim::on(tmp.path()).unwrap_err();
        assert_eq!(error.exit_code(), 4);
        assert!(error.to_string().contains("another run is writing to this folder"), "{error}");
        drop(claim);
        Claim::on(tmp.path()).unwrap();
        assert_eq!(fs::read_dir(tmp.path()).unwrap().count(), 0);
    }

    /// The case report-replaces-device, where its devices can be had without being root.
    #[cfg(unix)]
    #[test]
    fn devices_and_pipes_and_links_stay_what_they_are() {
        use std::os::unix::fs::{FileTypeExt, symlink};
        let tmp = tempfile::tempdir().unwrap();
        let at = |name: &str| tmp.path().join(name);
        let kind = |path: &Path| fs::symlink_metadata(path).unwrap().file_type();

        symlink("/dev/null", at("null")).unwrap();
        for null in [Path::new("/dev/null"), &at("null")] {
            check_file(null, false).unwrap();
            write_file(null, b"gone").unwrap();
        }
        assert!(kind(Path::new("/dev/null")).is_char_device() && kind(&at("null")).is_symlink());

        fs::write(at("file"), b"old").unwrap();
        symlink("file", at("link")).unwrap();
        assert!(check_file(&at("link"), false).unwrap_err().to_string().contains("--overwrite"));
        write_file(&at("link"), b"new").unwrap();
        assert!(kind(&at("link")).is_symlink());
        assert_eq!(fs::read(at("file")).unwrap(), b"new");

        // A file that a process has open is appended to, as through the shell's `>`.
        let open = File::options().append(true).open(at("file")).unwrap();
        use std::os::fd::AsRawFd;
        if cfg!(target_os = "linux") {
            write_file(Path::new(&format!("/proc/self/fd/{}", open.as_raw_fd())), b"er").unwrap();
            assert_eq!(fs::read(at("file")).unwrap(), b"newer");
        }

        symlink("nowhere", at("dangling")).unwrap();
        let _listener = std::os::unix::net::UnixListener::bind(at("socket")).unwrap();
        fs::create_dir(at("folder")).unwrap();
        assert!(std::process::Command::new("mkfifo").arg(at("pipe")).status().unwrap().success());
        for (name, words) in [
            ("dangling", "is a link to nothing"),
            ("socket", "is a socket"),
            ("folder", "is a folder"),
            ("pipe", "is a pipe"),
        ] {
            for result in [check_file(&at(name), true), write_file(&at(name), b"x")] {
                assert!(result.unwrap_err().to_string().contains(words), "{name}");
            }
        }
    }
}
