//! "Did you mean": the nearest of the words, or of the files of a folder.

use std::path::{Component, Path};

use super::words::{list, quoted};

/// The candidate that `word` is probably a misspelling of: the nearest within a third of its length in edits (swapped
/// neighbours count once), letter case aside. The first of equals.
pub(crate) fn nearest<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let length = word.chars().count();
    if length > LONGEST_WORD {
        return None; // no one mistypes a word of that length
    }
    let word = word.to_lowercase();
    candidates
        .into_iter()
        .filter(|c| c.chars().count() <= LONGEST_WORD)
        .map(|c| (strsim::osa_distance(&word, &c.to_lowercase()), c))
        .filter(|(edits, c)| *edits <= length.max(c.chars().count()).div_ceil(3))
        .min_by_key(|(edits, _)| *edits)
        .map(|(_, c)| c)
}

/// The comparison's cost grows with the square of the length.
const LONGEST_WORD: usize = 100;

/// The help for a file that is not there: the nearest name in its folder, or else the names of its kind that the folder has,
/// or else the folder that is missing too. `as_written` is the path that the user gave, `path` the same as it is opened.
pub(crate) fn missing_file_help(as_written: &str, path: &Path) -> Option<String> {
    if as_written.starts_with("~/") || as_written == "~" {
        return Some(
            "`~` stands for the home folder in a shell only: write the path in full, or relative to the file"
                .into(),
        );
    }
    let is_of_windows = as_written.as_bytes().get(1) == Some(&b':') || as_written.contains('\\');
    if is_of_windows && !cfg!(windows) {
        return Some(
            "this is a path of Windows: write it with /, relative to the file, for every system".into(),
        );
    }
    let folder = path.parent()?;
    let shown = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    if !shown.is_dir() {
        return Some(format!("there is no folder {}", quoted(&shown.to_string_lossy())));
    }
    let wanted = path.file_name()?.to_string_lossy();
    let mut names: Vec<String> = std::fs::read_dir(shown)
        .ok()?
        .take(MOST_NAMES)
        .flatten()
        .filter_map(|entry| entry.file_name().into_string().ok())
        .collect();
    names.sort_unstable();
    if let Some(name) = nearest(&wanted, names.iter().map(String::as_str)) {
        let there = as_written.rfind('/').map_or("", |slash| &as_written[..=slash]);
        return Some(format!("did you mean {}?", quoted(&format!("{there}{name}"))));
    }
    let extension = path.extension();
    names.retain(|name| Path::new(name).extension() == extension);
    let shown = quoted(&shown.to_string_lossy());
    // A job may be a stranger's, and name any folder: its report does not list what lies there.
    let written = Path::new(as_written);
    let ups = written.components().filter(|part| *part == Component::ParentDir).count();
    let is_near = !written.has_root() && ups <= 1;
    if names.is_empty() || names.len() > MOST_LISTED || extension.is_none() || !is_near {
        return Some(format!("looked in the folder {shown}"));
    }
    Some(format!("the folder {shown} has {}", list(names.iter().map(String::as_str), "and")))
}

/// Most names of a folder that are listed.
const MOST_LISTED: usize = 12;

/// Most names of a folder that are compared.
const MOST_NAMES: usize = 10_000;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_word_within_reason() {
        let keys = ["columns", "rate_hz", "sector_deg"];
        assert_eq!(nearest("colums", keys), Some("columns"));
        assert_eq!(nearest("Columns", keys), Some("columns"));
        assert_eq!(nearest("sectro_deg", keys), Some("sector_deg"));
        assert_eq!(nearest("wavelength", keys), None);
        assert_eq!(nearest(&"c".repeat(1_000_000), keys), None);
        assert_eq!(nearest("", keys), None);
    }

    #[test]
    fn a_missing_file_is_looked_for_nearby() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("velodyne_vlp16.toml"), "").unwrap();
        std::fs::write(folder.path().join("notes.txt"), "").unwrap();
        let help =
            |name: &str| missing_file_help(&format!("sensors/{name}"), &folder.path().join(name)).unwrap();
        assert_eq!(help("velodyn_vlp16.toml"), "did you mean `sensors/velodyne_vlp16.toml`?");
        assert!(help("os1.toml").ends_with("has `velodyne_vlp16.toml`"), "{}", help("os1.toml"));
        // A folder far away, or of keys without an extension, is not listed.
        for far in ["../../../root/os1.toml", "a/../../b/../os1.toml", "/root/os1.toml"] {
            let help = missing_file_help(far, &folder.path().join("os1.toml")).unwrap();
            assert!(help.starts_with("looked in the folder"), "{help}");
        }
        std::fs::write(folder.path().join("id_rsa"), "").unwrap();
        assert!(help("known").starts_with("looked in the folder"), "{}", help("known"));
        assert!(help("deeper/os1.toml").starts_with("there is no folder"), "{}", help("deeper/os1.toml"));
    }
}
