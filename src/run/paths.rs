//! Paths as people write them.

use std::fs;
use std::path::{Component, Path, PathBuf};

/// The TOML files in a folder and in the folders below it, in alphabetical order. Hidden folders are left out, and so are
/// links to folders, which may lead round in a circle.
pub fn configs_in(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).into_iter().flatten().flatten() {
            let is_hidden = entry.file_name().to_string_lossy().starts_with('.');
            let path = entry.path();
            if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
                if !is_hidden {
                    folders.push(path);
                }
            } else if path.extension().is_some_and(|e| e == "toml") {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// The same path by a shorter name where there is one: a job's `../out` comes as `configs/../out`, and is shown and
/// written to as `out`. The part that exists is resolved as the system resolves it, links included. A path outside the
/// current folder keeps its name.
pub fn tidy(path: &Path) -> PathBuf {
    let has_detour = |path: &Path| path.components().any(|part| part == Component::ParentDir);
    let resolve = || {
        let here = fs::canonicalize(".").ok()?;
        let whole = path.ancestors().find_map(|ancestor| {
            Some(fs::canonicalize(ancestor).ok()?.join(path.strip_prefix(ancestor).ok()?))
        })?;
        whole.strip_prefix(&here).map(Path::to_path_buf).ok()
    };
    match has_detour(path).then(resolve).flatten() {
        Some(shorter) if !has_detour(&shorter) && !shorter.as_os_str().is_empty() => shorter,
        _ => path.to_path_buf(),
    }
}

/// The path by which a file in `folder` names `file`; both are given as seen from the current folder. It has forward
/// slashes, which every system takes. A file on another drive keeps its whole name.
pub fn seen_from(folder: &Path, file: &Path) -> String {
    let whole = |path: &Path| fs::canonicalize(path).or_else(|_| std::path::absolute(path)).ok();
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let way = match (whole(folder), whole(file)) {
        (Some(folder), Some(file)) => {
            let common = folder.components().zip(file.components()).take_while(|(a, b)| a == b).count();
            let up = folder.components().skip(common).map(|_| Component::ParentDir);
            let down = file.components().skip(common);
            if common == 0 { file.clone() } else { up.chain(down).collect() }
        }
        _ => file.to_path_buf(),
    };
    let text = way.to_string_lossy();
    if cfg!(windows) { text.replace('\\', "/") } else { text.into_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_is_shown_without_detours() {
        // Tests run in the package's folder, where there is `src/run` and no `src/nowhere`.
        let tidied = |path: &str| tidy(Path::new(path)).to_string_lossy().replace('\\', "/");
        assert_eq!(tidied("src/run/../../out/street"), "out/street");
        assert_eq!(tidied("out/street"), "out/street");
        assert_eq!(tidied("src/nowhere/../out"), "src/nowhere/../out");
        assert_eq!(tidied("src/.."), "src/..");
        for outside in [std::env::temp_dir().join("a"), Path::new("src/../../a").to_path_buf()] {
            assert_eq!(tidy(&outside), outside);
        }
    }

    #[test]
    fn a_file_is_named_as_seen_from_a_folder() {
        // Tests run in the package's folder.
        let seen = |folder: &str, file: &str| seen_from(Path::new(folder), Path::new(file));
        assert_eq!(seen("", "src/lib.rs"), "src/lib.rs");
        assert_eq!(seen("src", "src/lib.rs"), "lib.rs");
        assert_eq!(seen("src/run", "Cargo.toml"), "../../Cargo.toml");
        assert_eq!(seen("src/run", "no such.glb"), "../../no such.glb");
    }
}
