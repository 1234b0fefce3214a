//! Output files that are either complete or absent.

use std::collections::BTreeSet;
use std::fmt;
use std::fs;
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use serde::{Deserialize, Serialize};

use super::whole::{
    Claim, check_folder, flush_folder, give_name, here_if_empty, kind_of, leave_cache, remove_leftovers,
    staged, temporary_in, unwritable,
};
use crate::error::Error;

/// The output folder of a run, and the files that the run will write there.
///
/// A file gets its final name only when it is complete: it is written under a temporary name in the same folder, flushed to
/// the disk and renamed. The temporary file is removed if anything fails.
#[derive(Debug)]
pub struct Destination {
    folder: PathBuf,
    names: Box<dyn FileNames>,
    overwrite: bool,
    /// The claims on the folders, from [`Destination::prepare`] on.
    claims: Vec<Claim>,
    /// The bytes of the files that were staged.
    staged_bytes: AtomicU64,
}

/// The bytes of a run's first files, which stay in the system's cache: more than a few frames have, and little beside any
/// machine's memory.
const CACHED_BYTES: u64 = 128 << 20;

/// The names of the files that a run writes: paths relative to its folder, with forward slashes. A run of a million frames has
/// no list of them.
pub trait FileNames: fmt::Debug + Send + Sync {
    /// The folders of the files, relative to the run's.
    fn folders(&self) -> BTreeSet<String>;

    /// Whether the run writes a file of this name.
    fn contains(&self, name: &str) -> bool;
}

impl FileNames for Vec<String> {
    fn folders(&self) -> BTreeSet<String> {
        self.iter().filter_map(|name| Some(name.rsplit_once('/')?.0.to_owned())).collect()
    }

    fn contains(&self, name: &str) -> bool {
        self.iter().any(|known| known == name)
    }
}

/// An output file, as the manifest lists it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct WrittenFile {
    /// The path in the folder, with forward slashes.
    pub path: String,
    /// The length in bytes.
    pub bytes: u64,
    /// The BLAKE3 hash of the content, in hexadecimal.
    pub blake3: String,
}

impl WrittenFile {
    /// A file of this content.
    pub fn of(path: &str, content: &[u8]) -> Self {
        let (bytes, blake3) = (content.len() as u64, blake3::hash(content).to_hex().to_string());
        Self { path: path.to_owned(), bytes, blake3 }
    }
}

/// An output file that is written and has a temporary name. It is removed if it is dropped.
#[derive(Debug)]
pub struct StagedFile {
    path: PathBuf,
    temporary: tempfile::NamedTempFile,
    /// Whether the system shall keep the content in memory once it is on the disk.
    stays_cached: bool,
}

impl StagedFile {
    /// Flushes the content to the disk.
    ///
    /// # Errors
    /// [`Error::Output`] about the file.
    pub fn sync(&self) -> Result<(), Error> {
        self.temporary.as_file().sync_all().map_err(|e| unwritable(&self.path, e))?;
        if !self.stays_cached {
            leave_cache(self.temporary.as_file());
        }
        Ok(())
    }

    /// Gives the file its final name, in place of an older file of that name.
    ///
    /// # Errors
    /// [`Error::Output`] about the file.
    pub fn commit(self) -> Result<(), Error> {
        self.temporary.persist(&self.path).map_err(|e| unwritable(&self.path, e.error))?;
        Ok(())
    }
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

    /// Replaces the first bytes of the file, which are at least as many. The file is read again for its hash.
    ///
    /// # Errors
    /// The error of the disk.
    pub fn replace_head(&mut self, head: &[u8]) -> io::Result<()> {
        self.file.flush()?;
        let file = self.file.get_mut().as_file_mut();
        file.seek(SeekFrom::Start(0))?;
        file.write_all(head)?;
        file.seek(SeekFrom::Start(0))?;
        self.hasher.reset();
        io::copy(file, &mut self.hasher)?;
        Ok(())
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
            give_name(file, &path)
        };
        persist().map_err(|e: io::Error| unwritable(&path, e))?;
        Ok(WrittenFile { path: name, bytes, blake3: hasher.finalize().to_hex().to_string() })
    }
}

impl Destination {
    /// A destination for files in `folder`. It checks that the folders can be made and written to, and that the files do not
    /// exist yet or may be replaced. The check leaves nothing behind.
    ///
    /// # Errors
    /// [`Error::Output`] about the first folder or file that is in the way.
    pub fn check(folder: &Path, names: impl FileNames + 'static, overwrite: bool) -> Result<Self, Error> {
        let (folder, names) = (folder.to_path_buf(), Box::new(names));
        let destination =
            Self { folder, names, overwrite, claims: Vec::new(), staged_bytes: AtomicU64::new(0) };
        for folder in destination.folders() {
            destination.check_inside(&folder)?;
            check_folder(&folder)?;
        }
        destination.check_files()?;
        Ok(destination)
    }

    /// The folder itself.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Checks that the files do not exist yet or may be replaced. A link in place of an output is replaced, too.
    fn check_files(&self) -> Result<(), Error> {
        for prefix in self.names.folders().into_iter().chain([String::new()]) {
            let folder = if prefix.is_empty() { self.folder.clone() } else { self.folder.join(&prefix) };
            let entries = match fs::read_dir(here_if_empty(&folder)) {
                Ok(entries) => entries,
                Err(e) if e.kind() == io::ErrorKind::NotFound => continue,
                Err(e) => return Err(unwritable(&folder, e)),
            };
            // The order of a folder's entries is the system's, so the first by name is told.
            let mut in_the_way: Option<(String, &str)> = None;
            for entry in entries {
                let entry = entry.map_err(|e| unwritable(&folder, e))?;
                let Ok(name) = entry.file_name().into_string() else { continue };
                let is_output = match prefix.is_empty() {
                    true => self.names.contains(&name),
                    false => self.names.contains(&format!("{prefix}/{name}")),
                };
                let is_earlier = in_the_way.as_ref().is_none_or(|(other, _)| name < *other);
                if !is_output || !is_earlier {
                    continue;
                }
                match fs::symlink_metadata(entry.path()) {
                    Ok(found) if !found.is_file() && !found.is_symlink() => {
                        in_the_way = Some((name, kind_of(&found)));
                    }
                    Ok(_) if !self.overwrite => in_the_way = Some((name, "")),
                    Err(e) if e.kind() != io::ErrorKind::NotFound => {
                        return Err(unwritable(&entry.path(), e));
                    }
                    _ => {}
                }
            }
            if let Some((name, kind)) = in_the_way {
                let problem = match kind {
                    "" => "exists already; --overwrite replaces it, --out DIR writes elsewhere".to_owned(),
                    kind => format!("is {kind}, where a file is to be written"),
                };
                return Err(Error::output(folder.join(name), problem));
            }
        }
        Ok(())
    }

    /// Checks that a folder of outputs is no link that leads out of the output folder.
    fn check_inside(&self, folder: &Path) -> Result<(), Error> {
        match (fs::canonicalize(folder), fs::canonicalize(&self.folder)) {
            (Ok(real), Ok(root)) if !real.starts_with(&root) => {
                Err(Error::output(folder, "is a link that leads out of the output folder"))
            }
            _ => Ok(()), // what does not exist yet is made by `prepare`
        }
    }

    /// Makes the folders and claims them for as long as the destination lives, removes what killed runs left in them, and
    /// removes an old `manifest`, which would be wrong as soon as the first file is replaced.
    ///
    /// # Errors
    /// [`Error::Output`] about the folder or the manifest, or if another run writes to the folder, or has written to it since
    /// [`Destination::check`] and its files may not be replaced.
    pub fn prepare(&mut self, manifest: &str) -> Result<(), Error> {
        self.claim(Claim::on)?;
        self.folders().iter().for_each(|folder| remove_leftovers(folder));
        self.check_files()?;
        self.remove(manifest)
    }

    /// The same for one of several runs that write different files to the same folder at the same time. It leaves alone what is
    /// in the folder.
    ///
    /// # Errors
    /// As [`Destination::prepare`], if a run writes to the folder that wants it for itself.
    pub fn prepare_shared(&mut self) -> Result<(), Error> {
        self.claim(Claim::shared)?;
        self.check_files()
    }

    fn claim(&mut self, claim: fn(&Path) -> Result<Claim, Error>) -> Result<(), Error> {
        for folder in self.folders() {
            fs::create_dir_all(&folder).map_err(|e| unwritable(&folder, e))?;
            self.check_inside(&folder)?;
            self.claims.push(claim(&folder)?);
            check_folder(&folder)?;
        }
        Ok(())
    }

    /// Removes a file of the folder. It is fine if there is none.
    ///
    /// # Errors
    /// [`Error::Output`] about the file.
    pub fn remove(&self, name: &str) -> Result<(), Error> {
        let path = self.folder.join(name);
        match fs::remove_file(&path) {
            Err(e) if e.kind() != io::ErrorKind::NotFound => Err(unwritable(&path, e)),
            _ => Ok(()),
        }
    }

    /// Removes a file of an earlier run, a path as those of the destination, unless it will be written now; and the folders that
    /// this leaves empty and that no new file goes to. It removes nothing outside of the destination's folder: a file in a
    /// folder that is a link to another place stays. What is gone already is fine.
    ///
    /// # Errors
    /// [`Error::Output`] if the file can't be removed.
    pub fn remove_old(&self, name: &str) -> Result<(), Error> {
        let Ok(home) = fs::canonicalize(&self.folder) else { return Ok(()) };
        let Some(path) = self.old_path(name) else { return Ok(()) };
        let Some(folder) = path.parent() else { return Ok(()) };
        let is_inside = fs::canonicalize(folder).is_ok_and(|folder| folder.starts_with(&home));
        // A link is removed itself, and not what it leads to.
        let is_file = fs::symlink_metadata(&path).is_ok_and(|found| !found.is_dir());
        if !(is_inside && is_file) {
            return Ok(());
        }
        match fs::remove_file(&path) {
            Err(e) if e.kind() != io::ErrorKind::NotFound => {
                let problem = format!("is of an earlier run, and can't be removed: {e}");
                return Err(Error::output(&path, problem));
            }
            _ => {}
        }
        // A folder that still holds something is not removed, nor one that the new files go to.
        let needed = self.folders();
        for folder in path.ancestors().skip(1).take_while(|folder| !needed.contains(*folder)) {
            if fs::remove_dir(folder).is_err() {
                break;
            }
        }
        Ok(())
    }

    /// The path of a file of an earlier run, if it will not be written now.
    pub fn old_path(&self, name: &str) -> Option<PathBuf> {
        (!self.names.contains(name)).then(|| self.folder.join(name))
    }

    /// Flushes the names of the files that were written to the disk: after that, a power cut takes none of them.
    pub fn flush(&self) {
        self.folders().iter().for_each(|folder| flush_folder(folder));
    }

    /// Writes the file `name`, completely or not at all. Its content is on the disk then, and its name after
    /// [`Destination::flush`].
    ///
    /// # Errors
    /// [`Error::Output`] about the file, such as when the disk is full. The temporary file is removed then, and an older
    /// file of the same name is kept.
    pub fn write(&self, name: &str, content: &[u8]) -> Result<WrittenFile, Error> {
        let file = self.stage(name, content)?;
        file.sync()?;
        file.commit()?;
        Ok(WrittenFile::of(name, content))
    }

    /// Writes the file `name` under a temporary name. Several files are staged, then all are synced, then all are committed: the
    /// disk is much faster at flushing them together than at flushing one after the other.
    ///
    /// The system keeps the first `CACHED_BYTES` of a run in memory for programs that read them next. The files after
    /// them leave its cache when they are on the disk: a long run would displace what other programs have there, and pay for fresh
    /// memory with each file, which costs more than the copy where a virtual machine gets its memory page by page.
    ///
    /// # Errors
    /// As [`Destination::write`].
    pub fn stage(&self, name: &str, content: &[u8]) -> Result<StagedFile, Error> {
        let path = self.folder.join(name);
        let before = self.staged_bytes.fetch_add(content.len() as u64, Relaxed);
        match staged(&path, content) {
            Ok(temporary) => Ok(StagedFile { path, temporary, stays_cached: before < CACHED_BYTES }),
            Err(e) => Err(unwritable(&path, e)),
        }
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
        let of_files = self.names.folders().into_iter().map(|folder| self.folder.join(folder));
        of_files.chain([self.folder.clone()]).collect()
    }
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
        check(&tmp.path().join("a/b"), false).unwrap();
        assert_eq!(fs::read_dir(tmp.path()).unwrap().count(), 0);
    }

    #[test]
    fn written_files_are_complete_and_hashed() {
        let tmp = tempfile::tempdir().unwrap();
        let mut destination = check(&tmp.path().join("out"), false).unwrap();
        destination.prepare(MANIFEST).unwrap();
        let written = destination.write("top/000000.exr", b"pixels").unwrap();
        assert_eq!(fs::read(tmp.path().join("out/top/000000.exr")).unwrap(), b"pixels");
        assert_eq!((written.path.as_str(), written.bytes), ("top/000000.exr", 6));
        assert_eq!(written.blake3, blake3::hash(b"pixels").to_hex().as_str());
        assert_eq!(files_under(tmp.path()), ["out/top/000000.exr"]);
    }

    #[test]
    fn only_the_first_files_of_a_run_stay_cached_and_all_are_whole() {
        let tmp = tempfile::tempdir().unwrap();
        let names = ["a", "b", "c"].map(str::to_owned).to_vec();
        let mut destination = Destination::check(tmp.path(), names, false).unwrap();
        destination.prepare(MANIFEST).unwrap();
        let content = vec![7; 10_000];
        destination.staged_bytes = AtomicU64::new(CACHED_BYTES - 10_000);
        let staged = ["a", "b", "c"].map(|name| destination.stage(name, &content).unwrap());
        assert_eq!(staged.each_ref().map(|file| file.stays_cached), [true, false, false]);
        for (file, name) in staged.into_iter().zip(["a", "b", "c"]) {
            file.sync().unwrap();
            file.commit().unwrap();
            assert_eq!(fs::read(tmp.path().join(name)).unwrap(), content);
        }
    }

    #[test]
    fn a_head_that_is_replaced_counts_in_the_hash() {
        let folder = tempfile::tempdir().unwrap();
        let destination = Destination::check(folder.path(), vec!["a".to_owned()], false).unwrap();
        let mut file = destination.open("a").unwrap();
        let points = vec![7; 100_000]; // more than what is buffered
        file.write_all(b"0000").unwrap();
        file.write_all(&points).unwrap();
        file.replace_head(b"head").unwrap();
        file.write_all(b"end").unwrap();
        let written = file.finish().unwrap();
        let content = [&b"head"[..], &points, b"end"].concat();
        assert!(fs::read(folder.path().join("a")).unwrap() == content);
        assert_eq!(
            (written.bytes, written.blake3),
            (content.len() as u64, blake3::hash(&content).to_hex().to_string())
        );
    }

    #[test]
    fn a_growing_file_has_its_name_when_it_is_finished() {
        let tmp = tempfile::tempdir().unwrap();
        let mut destination = check(tmp.path(), false).unwrap();
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
        let mut destination = check(tmp.path(), false).unwrap();
        destination.prepare(MANIFEST).unwrap();
        destination.write(MANIFEST, b"{}").unwrap();
        fs::write(tmp.path().join("plain"), b"").unwrap();
        let mode = |name: &str| fs::metadata(tmp.path().join(name)).unwrap().permissions().mode();
        assert_eq!(mode(MANIFEST), mode("plain"));
    }

    #[test]
    fn existing_files_are_refused_or_overwritten() {
        let tmp = tempfile::tempdir().unwrap();
        let mut destination = check(tmp.path(), false).unwrap();
        destination.prepare(MANIFEST).unwrap();
        destination.write("top/000000.exr", b"old").unwrap();
        destination.write(MANIFEST, b"old").unwrap();

        drop(destination);

        let error = check(tmp.path(), false).unwrap_err();
        assert_eq!(error.exit_code(), 4);
        let message = error.to_string();
        assert!(
            message
                .ends_with("000000.exr: exists already; --overwrite replaces it, --out DIR writes elsewhere"),
            "{message}"
        );

        let mut destination = check(tmp.path(), true).unwrap();
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
        let mut destination = check(tmp.path(), false).unwrap();
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

    /// Writes a file with its folder.
    fn put(path: &Path) {
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, b"old").unwrap();
    }

    /// Files of an earlier run go unless they are written anew, with the folders that this empties. Whatever else is there stays.
    #[test]
    fn files_of_an_earlier_run_are_removed_and_nothing_else() {
        let tmp = tempfile::tempdir().unwrap();
        let out = tmp.path().join("out");
        for file in [
            "front/000000.exr",
            "front/000000.ply",
            "deep/er/000000.exr",
            "kept/000000.exr",
            "kept/notes.txt",
        ] {
            put(&out.join(file));
        }
        put(&out.join("top/000000.exr"));
        let mut destination = check(&out, true).unwrap();
        destination.prepare(MANIFEST).unwrap();
        let old = [
            "front/000000.exr",
            "front/000000.ply",
            "deep/er/000000.exr",
            "kept/000000.exr",
            "top/000000.exr",
        ];
        let old: Vec<String> =
            old.into_iter().chain(["gone/000000.exr", "kept"]).map(str::to_owned).collect();
        old.iter().for_each(|name| destination.remove_old(name).unwrap());
        // A run of another format writes to the folder that it has emptied.
        let mut other =
            Destination::check(&tmp.path().join("other"), vec!["top/000000.npz".to_owned()], true).unwrap();
        other.prepare(MANIFEST).unwrap();
        put(&tmp.path().join("other/top/000000.exr"));
        other.remove_old("top/000000.exr").unwrap();
        other.write("top/000000.npz", b"new").unwrap();
        fs::remove_dir_all(tmp.path().join("other")).unwrap();
        assert_eq!(files_under(tmp.path()), ["out/kept/notes.txt", "out/top/000000.exr"]);
        assert!(!out.join("front").exists() && !out.join("deep").exists());
        old.iter().for_each(|name| destination.remove_old(name).unwrap());
    }

    #[cfg(unix)]
    #[test]
    fn nothing_behind_a_link_is_removed() {
        let tmp = tempfile::tempdir().unwrap();
        let (out, elsewhere) = (tmp.path().join("out"), tmp.path().join("elsewhere"));
        put(&elsewhere.join("000000.exr"));
        fs::create_dir(&out).unwrap();
        std::os::unix::fs::symlink(&elsewhere, out.join("front")).unwrap();
        std::os::unix::fs::symlink(elsewhere.join("000000.exr"), out.join("link.exr")).unwrap();
        let destination = Destination::check(&out, vec!["top/000000.exr".to_owned()], true).unwrap();
        ["front/000000.exr", "link.exr"].iter().for_each(|name| destination.remove_old(name).unwrap());
        assert_eq!(fs::read(elsewhere.join("000000.exr")).unwrap(), b"old");
        assert!(fs::symlink_metadata(out.join("link.exr")).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn a_dangling_link_exists() {
        let tmp = tempfile::tempdir().unwrap();
        std::os::unix::fs::symlink("nowhere", tmp.path().join(MANIFEST)).unwrap();
        assert!(check(tmp.path(), false).is_err());
    }

    /// The case two-scans-one-folder, in one process.
    #[cfg(unix)]
    #[test]
    fn a_run_that_began_later_does_not_write_between_the_files_of_another() {
        let tmp = tempfile::tempdir().unwrap();
        let mut first = check(tmp.path(), false).unwrap();
        let mut second = check(tmp.path(), false).unwrap();
        first.prepare(MANIFEST).unwrap();
        let message = second.prepare(MANIFEST).unwrap_err().to_string();
        assert!(message.contains("another run is writing to this folder"), "{message}");
        first.write(MANIFEST, b"{}").unwrap();
        drop(first);
        // It may not replace what the first has written since it looked.
        let message = second.prepare(MANIFEST).unwrap_err().to_string();
        assert!(message.contains("manifest.json: exists already"), "{message}");
        assert_eq!(files_under(tmp.path()), [MANIFEST]);
    }

    #[cfg(unix)]
    #[test]
    fn a_folder_of_outputs_that_leads_elsewhere_is_refused() {
        use std::os::unix::fs::symlink;
        let tmp = tempfile::tempdir().unwrap();
        fs::create_dir_all(tmp.path().join("out/inside")).unwrap();
        fs::create_dir(tmp.path().join("elsewhere")).unwrap();
        let link = tmp.path().join("out/top");
        symlink("../elsewhere", &link).unwrap();
        let message = check(&tmp.path().join("out"), true).unwrap_err().to_string();
        assert!(message.ends_with("top: is a link that leads out of the output folder"), "{message}");
        fs::remove_file(&link).unwrap();
        let mut destination = check(&tmp.path().join("out"), true).unwrap();
        symlink("../elsewhere", &link).unwrap();
        destination.prepare(MANIFEST).unwrap_err();
        drop(destination);
        // A link within the output folder, and a link to the output folder itself, lead where the user wants.
        fs::remove_file(&link).unwrap();
        symlink("inside", &link).unwrap();
        symlink("out", tmp.path().join("way")).unwrap();
        check(&tmp.path().join("way"), true).unwrap();
        assert_eq!(fs::read_dir(tmp.path().join("elsewhere")).unwrap().count(), 0);
    }

    #[cfg(unix)]
    #[test]
    fn an_output_that_is_no_file_is_not_replaced() {
        let tmp = tempfile::tempdir().unwrap();
        let _listener = std::os::unix::net::UnixListener::bind(tmp.path().join(MANIFEST)).unwrap();
        let message = check(tmp.path(), true).unwrap_err().to_string();
        assert!(message.ends_with("is a socket, where a file is to be written"), "{message}");
    }

    /// The case temporary-files-stay.
    #[test]
    fn what_a_killed_run_left_is_removed_by_the_next() {
        let tmp = tempfile::tempdir().unwrap();
        fs::create_dir(tmp.path().join("top")).unwrap();
        for name in [".beamcast-a1B2c3.tmp", "top/.beamcast-d4E5f6.tmp", "top/.beamcast-note", "top/mine.tmp"]
        {
            fs::write(tmp.path().join(name), b"half").unwrap();
        }
        check(tmp.path(), true).unwrap().prepare(MANIFEST).unwrap();
        assert_eq!(files_under(tmp.path()), ["top/.beamcast-note", "top/mine.tmp"]);
    }
}
