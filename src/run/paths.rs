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

/// The name of a file in its repository, as git has it: from the nearest folder above it that has a `.git`, or else from
/// `workspace`, with forward slashes. A file that is in neither keeps its name, without a leading `./`.
pub fn in_repository(file: &Path, workspace: Option<&Path>) -> String {
    let whole = fs::canonicalize(file).ok();
    let in_root = || {
        let whole = whole.as_deref()?;
        // `.git` is a file in a worktree or a submodule.
        let root =
            whole.ancestors().skip(1).find(|folder| folder.join(".git").exists()).map(Path::to_path_buf);
        let root = root.or_else(|| fs::canonicalize(workspace?).ok())?;
        whole.strip_prefix(root).ok()
    };
    let named = in_root().unwrap_or(file);
    let parts = named.components().filter(|part| *part != Component::CurDir);
    parts.collect::<PathBuf>().to_string_lossy().replace(std::path::MAIN_SEPARATOR, "/")
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
    fn a_file_is_named_as_git_has_it() {
        let tmp = tempfile::tempdir().unwrap();
        let repository = tmp.path().join("repository");
        let nested = repository.join("nested");
        fs::create_dir_all(nested.join("jobs")).unwrap();
        for file in [repository.join("rig.toml"), nested.join("jobs/rig.toml"), tmp.path().join("rig.toml")] {
            fs::write(file, "").unwrap();
        }
        let name = |file: PathBuf, workspace: Option<&Path>| in_repository(&file, workspace);
        // Without git, GitHub's workspace is what names are relative to.
        assert_eq!(name(nested.join("jobs/rig.toml"), Some(&repository)), "nested/jobs/rig.toml");
        fs::create_dir(repository.join(".git")).unwrap();
        assert_eq!(name(repository.join("./rig.toml"), None), "rig.toml");
        assert_eq!(name(nested.join("jobs/../jobs/rig.toml"), Some(tmp.path())), "nested/jobs/rig.toml");
        // A worktree or a submodule has a file named .git, and is a repository of its own.
        fs::write(nested.join(".git"), "gitdir: elsewhere").unwrap();
        assert_eq!(name(nested.join("jobs/rig.toml"), Some(&repository)), "jobs/rig.toml");
        assert_eq!(in_repository(Path::new("./no such/rig.toml"), None), "no such/rig.toml");
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
