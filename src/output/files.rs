//! Output files that are either complete or absent.

use std::collections::BTreeSet;
use std::fs;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use super::whole::{
    Claim, check_folder, give_name, kind_of, remove_leftovers, temporary_in, unwritable, write_complete,
};
use crate::error::Error;

/// The output folder of a run, and the files that the run will write there.
///
/// A file gets its final name only when it is complete: it is written under a temporary name in the same folder, flushed to
/// the disk and renamed. The temporary file is removed if anything fails.
#[derive(Debug)]
pub struct Destination {
    folder: PathBuf,
    names: Vec<String>,
    overwrite: bool,
    /// The claims on the folders, from [`Destination::prepare`] on.
    claims: Vec<Claim>,
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
            give_name(file, &path)
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
        let destination = Self { folder: folder.to_path_buf(), names, overwrite, claims: Vec::new() };
        for folder in destination.folders() {
            destination.check_inside(&folder)?;
            check_folder(&folder)?;
        }
        destination.check_files()?;
        Ok(destination)
    }

    /// Checks that the files do not exist yet or may be replaced. A link in place of an output is replaced, too.
    fn check_files(&self) -> Result<(), Error> {
        for path in self.paths() {
            match fs::symlink_metadata(&path) {
                Ok(found) if !found.is_file() && !found.is_symlink() => {
                    let problem = format!("is {}, where a file is to be written", kind_of(&found));
                    return Err(Error::output(&path, problem));
                }
                Ok(_) if !self.overwrite => {
                    return Err(Error::output(
                        &path,
                        "exists already; --overwrite replaces it, --out DIR writes elsewhere",
                    ));
                }
                Err(e) if e.kind() != io::ErrorKind::NotFound => return Err(unwritable(&path, e)),
                _ => {}
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

    /// The files that will be written, in the order of their names in [`Destination::check`].
    pub fn paths(&self) -> impl Iterator<Item = PathBuf> + '_ {
        self.names.iter().map(|name| self.folder.join(name))
    }

    /// Makes the folders and claims them for as long as the destination lives, removes what killed runs left in them, and
    /// removes an old `manifest`, which would be wrong as soon as the first file is replaced.
    ///
    /// # Errors
    /// [`Error::Output`] about the folder or the manifest, or if another run writes to the folder, or has written to it since
    /// [`Destination::check`] and its files may not be replaced.
    pub fn prepare(&mut self, manifest: &str) -> Result<(), Error> {
        for folder in self.folders() {
            fs::create_dir_all(&folder).map_err(|e| unwritable(&folder, e))?;
            self.check_inside(&folder)?;
            self.claims.push(Claim::on(&folder)?);
            check_folder(&folder)?;
            remove_leftovers(&folder);
        }
        self.check_files()?;
        let manifest = self.folder.join(manifest);
        match fs::remove_file(&manifest) {
            Err(e) if e.kind() != io::ErrorKind::NotFound => Err(unwritable(&manifest, e)),
            _ => Ok(()),
        }
    }

    /// Removes the files `old` of an earlier run, which are paths as those of the destination, except for those that will be
    /// written now; and the folders that this leaves empty and that no new file goes to. It removes nothing outside of the destination's folder: a file in a
    /// folder that is a link to another place stays. What is gone already is fine.
    ///
    /// # Errors
    /// [`Error::Output`] about a file that can't be removed.
    pub fn remove_old(&self, old: &[String]) -> Result<(), Error> {
        let Ok(home) = fs::canonicalize(&self.folder) else { return Ok(()) };
        let needed = self.folders();
        for path in self.old_paths(old) {
            let Some(folder) = path.parent() else { continue };
            let is_inside = fs::canonicalize(folder).is_ok_and(|folder| folder.starts_with(&home));
            // A link is removed itself, and not what it leads to.
            let is_file = fs::symlink_metadata(&path).is_ok_and(|found| !found.is_dir());
            if !(is_inside && is_file) {
                continue;
            }
            match fs::remove_file(&path) {
                Err(e) if e.kind() != io::ErrorKind::NotFound => {
                    return Err(Error::output(
                        &path,
                        format!("is of an earlier run, and can't be removed: {e}"),
                    ));
                }
                _ => {}
            }
            // A folder that still holds something is not removed, nor one that the new files go to.
            for folder in path.ancestors().skip(1).take_while(|folder| !needed.contains(*folder)) {
                if fs::remove_dir(folder).is_err() {
                    break;
                }
            }
        }
        Ok(())
    }

    /// The paths of those files of an earlier run that will not be written now.
    pub fn old_paths<'o>(&'o self, old: &'o [String]) -> impl Iterator<Item = PathBuf> + 'o {
        let new: BTreeSet<&str> = self.names.iter().map(String::as_str).collect();
        old.iter().filter(move |name| !new.contains(name.as_str())).map(|name| self.folder.join(name))
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
        let mut destination = check(&tmp.path().join("out"), false).unwrap();
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
        destination.remove_old(&old).unwrap();
        // A run of another format writes to the folder that it has emptied.
        let mut other =
            Destination::check(&tmp.path().join("other"), vec!["top/000000.npz".into()], true).unwrap();
        other.prepare(MANIFEST).unwrap();
        put(&tmp.path().join("other/top/000000.exr"));
        other.remove_old(&["top/000000.exr".to_owned()]).unwrap();
        other.write("top/000000.npz", b"new").unwrap();
        fs::remove_dir_all(tmp.path().join("other")).unwrap();
        assert_eq!(files_under(tmp.path()), ["out/kept/notes.txt", "out/top/000000.exr"]);
        assert!(!out.join("front").exists() && !out.join("deep").exists());
        destination.remove_old(&old).unwrap();
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
        let destination = Destination::check(&out, vec!["top/000000.exr".into()], true).unwrap();
        destination.remove_old(&["front/000000.exr".to_owned(), "link.exr".to_owned()]).unwrap();
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
