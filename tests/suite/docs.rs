//! Checks that everything that the pages for contributors name exists.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(page: &str) -> String {
    fs::read_to_string(root().join(page)).unwrap_or_else(|e| panic!("{page}: {e}"))
}

/// The texts between backticks, outside of code blocks.
fn code_spans(page: &str) -> Vec<String> {
    let mut is_block = false;
    let prose = page.lines().filter(|line| {
        let is_fence = line.starts_with("```");
        is_block ^= is_fence;
        !is_block && !is_fence
    });
    let prose = prose.collect::<Vec<_>>().join("\n");
    prose.split('`').skip(1).step_by(2).map(str::to_owned).collect()
}

/// Every Rust file below a folder.
fn rust_files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap().map(Result::unwrap) {
        match entry.file_type().unwrap().is_dir() {
            true => rust_files(&entry.path(), found),
            false => found.extend(entry.path().extension().is_some_and(|e| e == "rs").then(|| entry.path())),
        }
    }
}

/// Whether a file whose path has `module` in it has a function `function`.
fn has_test(files: &[PathBuf], module: &str, function: &str) -> bool {
    let declaration = format!("fn {function}(");
    let is_of_module = |path: &PathBuf| {
        path.file_stem().is_some_and(|stem| stem == module)
            || path.components().any(|part| part.as_os_str() == module)
    };
    files
        .iter()
        .filter(|path| is_of_module(path))
        .any(|path| fs::read_to_string(path).unwrap().contains(&declaration))
}

#[test]
fn pages_for_contributors_name_what_exists() {
    let mut files = Vec::new();
    rust_files(&root().join("src"), &mut files);
    rust_files(&root().join("tests"), &mut files);
    let mut wrong = Vec::new();
    let mut named = [0, 0];
    for page in [
        "docs/architecture.md",
        "docs/glossary.md",
        "docs/depth-cameras.md",
        "docs/measurement.md",
        "docs/mistakes.md",
        "CONTRIBUTING.md",
    ] {
        for span in code_spans(&read(page)) {
            // The files that the page of mistakes names belong to other programs.
            let is_path = page != "docs/mistakes.md"
                && !span.contains([' ', '*', '<', ':'])
                && ["src/", "tests/", "configs/", "docs/", "examples/", ".ci/", "python/"]
                    .iter()
                    .any(|f| span.starts_with(f));
            if is_path {
                named[0] += 1;
                if !root().join(&span).exists() {
                    wrong.push(format!("{page} names the file {span}"));
                }
            }
            // `module::function`, or `module::tests::function` of a unit test.
            let parts: Vec<&str> = span.split("::").collect();
            let is_name =
                |part: &&str| part.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_');
            if let [module, .., function] = parts[..]
                && parts.iter().all(is_name)
                && function.contains('_')
            {
                named[1] += 1;
                if !has_test(&files, module, function) {
                    wrong.push(format!("{page} names the test {span}"));
                }
            }
        }
    }
    assert!(wrong.is_empty(), "which is not there:\n{}", wrong.join("\n"));
    assert!(named[0] > 5 && named[1] > 20, "the pages name {named:?} files and tests");
}

#[test]
fn the_architecture_page_has_every_room() {
    let page = read("docs/architecture.md");
    let described: BTreeSet<_> = page
        .lines()
        .skip_while(|line| *line != "## The rooms")
        .take_while(|line| *line != "## What never happens")
        .filter_map(|line| line.strip_prefix("| `")?.split('`').next())
        .map(str::to_owned)
        .collect();
    let rooms: BTreeSet<_> = fs::read_dir(root().join("src"))
        .unwrap()
        .map(|entry| entry.unwrap().path().file_stem().unwrap().to_str().unwrap().to_owned())
        .filter(|room| !matches!(room.as_str(), "lib" | "main"))
        .collect();
    assert_eq!(described, rooms, "the table in docs/architecture.md, and the modules in src");
}

/// The page numbers its rows from 1 on without a gap, and each names a test in its last column.
#[test]
fn each_mistake_of_other_simulators_has_a_test() {
    let page = read("docs/mistakes.md");
    let rows = page.lines().filter(|line| line.starts_with("| ") && !line.starts_with("| |"));
    let mut number = 0;
    for row in rows {
        number += 1;
        let cells: Vec<&str> = row.split(" | ").collect();
        assert!(cells.len() == 4 && cells[0] == format!("| {number}"), "{row}");
        let tests = code_spans(cells[3]);
        assert!(!tests.is_empty() && tests.iter().all(|test| test.contains("::")), "{row}");
    }
    assert!(number >= 27, "{number}");
}
