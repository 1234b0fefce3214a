//! The rooms of the crate and the doors between them: data flows one way, and what a room does not need it does not touch.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// Each room with the rooms that its code may import; tests aside. From the leaves up: nothing imports what comes later.
/// `config` comes after what it describes (sensors, the kernel to trace with, output and check settings), and only `cli` knows it.
const IMPORTS: &[(&str, &[&str])] = &[
    ("angle", &[]),
    ("source", &[]),
    ("error", &["source"]),
    ("rng", &[]),
    ("frame", &["angle"]),
    ("motion", &["frame"]),
    ("sensor", &["angle", "frame", "motion"]),
    ("scene", &["error", "frame", "source"]),
    ("trace", &["scene"]),
    ("scan", &["frame", "scene", "sensor", "trace"]),
    ("output", &["angle", "error", "frame", "scan", "scene", "sensor", "source"]),
    ("check", &["angle", "output", "scan", "scene", "sensor", "source"]),
    ("view", &["check", "error", "frame", "output", "scan", "scene", "sensor", "source"]),
    ("selftest", &["angle", "frame", "motion", "output", "scan", "scene", "sensor", "trace"]),
    ("kernels", &["angle", "error", "frame", "motion", "rng", "scan", "scene", "sensor", "trace"]),
    ("config", &["angle", "check", "error", "frame", "motion", "output", "sensor", "source", "trace"]),
    (
        "run",
        &[
            "check", "config", "error", "frame", "output", "scan", "scene", "sensor", "source", "trace",
            "view",
        ],
    ),
    ("import", &["config", "source"]),
    (
        "cli",
        &[
            "angle", "check", "config", "error", "frame", "import", "kernels", "output", "run", "scan",
            "scene", "selftest", "sensor", "source", "trace", "view",
        ],
    ),
    ("main", &["cli"]),
];

/// What only some files may touch, and why.
const CONFINED: &[(&str, &[&str], &str)] = &[
    (
        "std::fs",
        &["source/", "output/files.rs", "output/recorded/folder.rs", "run/", "cli/"],
        "files are opened at the edges only",
    ),
    (
        "std::path",
        &[
            "source/",
            "error.rs",
            "config/",
            "scene/gltf/",
            "output/files.rs",
            "output/recorded/folder.rs",
            "view/recorded.rs",
            "run/",
            "cli/",
        ],
        "only what opens files knows their names",
    ),
    ("std::env", &["cli/"], "results depend on nothing but the inputs"),
    ("Instant", &["cli/"], "results depend on no clock"),
    ("SystemTime", &[], "results depend on no clock"),
    ("std::thread", &["cli/"], "work is shared out by rayon"),
    ("std::process", &["cli/", "main.rs"], "only the command line starts and ends processes"),
    ("std::net", &[], "nothing is fetched"),
    (
        "rayon::",
        &["scan/", "sensor/camera.rs", "trace/bvh/build.rs", "output/exr.rs", "kernels/", "cli/"],
        "threads live where rays are shared out, lenses inverted, trees built and images compressed",
    ),
    ("clap::", &["cli/"], "only the command line has flags"),
    ("toml::", &["config/"], "only config knows TOML"),
    ("use gltf::", &["scene/gltf/"], "only the loader knows glTF"),
    ("unsafe", &["trace/simd/x86/"], "intrinsics are the one thing that needs it"),
];

#[test]
fn rooms_import_what_the_table_allows_and_no_more() {
    let mut used: BTreeMap<&str, BTreeSet<String>> = BTreeMap::new();
    let mut wrong = Vec::new();
    let sources = sources();
    for (file, code) in &sources {
        let room = file.split(['/', '.']).next().unwrap();
        if room == "lib" {
            continue;
        }
        let Some((room, allowed)) = IMPORTS.iter().find(|(name, _)| *name == room) else {
            wrong.push(format!("src/{file} is in no room of the table: give `{room}` a row"));
            continue;
        };
        let (_, deeper) = file.rsplit_once('/').unwrap_or_default();
        let depth = file.matches('/').count() + usize::from(deeper != "mod.rs");
        let roots = if *room == "main" { "beamcast::".into() } else { "super::".repeat(depth) };
        for import in [after(code, "crate::"), after(code, &roots)].concat() {
            if import == *room {
                continue;
            }
            if !allowed.contains(&import.as_str()) {
                wrong.push(format!(
                    "src/{file} imports {import}; {room} may import {allowed:?}. Data flows one way: what {room} needs is \
                     handed to it by what calls it"
                ));
            }
            used.entry(room).or_default().insert(import);
        }
    }
    for (room, allowed) in IMPORTS {
        for import in allowed.iter().filter(|&&i| !used.get(room).is_some_and(|used| used.contains(i))) {
            wrong.push(format!("the table lets {room} import {import}, which it does not: take that out"));
        }
    }
    assert!(wrong.is_empty(), "\n{}\nThe table is in tests/suite/layering.rs.\n", wrong.join("\n"));
}

#[test]
fn what_is_confined_stays_where_it_is() {
    let mut wrong = Vec::new();
    for (file, code) in sources() {
        for (thing, places, why) in CONFINED {
            let touches = match thing.strip_prefix("std::") {
                Some(module) => after(&code, "std::").iter().any(|name| name == module),
                None => words(&code, thing).next().is_some(),
            };
            if touches && !places.iter().any(|place| file.starts_with(place)) {
                wrong.push(format!("src/{file} has `{thing}`, which is for {places:?}: {why}"));
            }
        }
    }
    assert!(wrong.is_empty(), "\n{}\nThe table is in tests/suite/layering.rs.\n", wrong.join("\n"));
}

/// Every source file by its path in src/, as [`code`] has it.
fn sources() -> BTreeMap<String, String> {
    fn visit(folder: &Path, prefix: &str, found: &mut BTreeMap<String, String>) {
        for entry in fs::read_dir(folder).unwrap().map(Result::unwrap) {
            let name = entry.file_name().into_string().unwrap();
            if entry.file_type().unwrap().is_dir() {
                visit(&entry.path(), &format!("{prefix}{name}/"), found);
            } else {
                found.insert(format!("{prefix}{name}"), fs::read_to_string(entry.path()).unwrap());
            }
        }
    }
    let mut found = BTreeMap::new();
    visit(&Path::new(env!("CARGO_MANIFEST_DIR")).join("src"), "", &mut found);
    // Modules that are declared for tests alone are left out, whatever their names are.
    let of_tests: BTreeSet<String> = found.iter().flat_map(|(file, text)| test_modules(file, text)).collect();
    found.retain(|file, _| !of_tests.contains(file));
    found.values_mut().for_each(|text| *text = code(text));
    found
}

/// The files of the modules that `file` declares for tests alone.
fn test_modules(file: &str, text: &str) -> Vec<String> {
    let folder = match file.strip_suffix("mod.rs") {
        Some(folder) => folder.to_owned(),
        None => format!("{}/", file.trim_end_matches(".rs")),
    };
    let declared = text.split("#[cfg(test)]\nmod ").skip(1).filter_map(|rest| rest.split_once(';'));
    let names =
        declared.map(|(name, _)| name).filter(|name| name.chars().all(|c| c.is_alphanumeric() || c == '_'));
    names.map(|name| format!("{folder}{name}.rs")).collect()
}

/// A file without its comments and without its tests, which come last in it.
fn code(text: &str) -> String {
    let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    code.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
}

/// Where `word` begins, as a word of its own.
fn words<'a>(code: &'a str, word: &'a str) -> impl Iterator<Item = usize> + 'a {
    let is_part = |c: char| c.is_alphanumeric() || c == '_' || c == '$';
    code.match_indices(word).map(|(at, _)| at).filter(move |&at| {
        !code[..at].ends_with(is_part)
            && (word.ends_with(':') || !code[at + word.len()..].starts_with(is_part))
    })
}

/// The names that follow `root::`, alone or each at the head of a branch of `root::{…}`.
fn after(code: &str, root: &str) -> Vec<String> {
    let mut names = Vec::new();
    for at in words(code, root) {
        let rest = &code[at + root.len()..];
        let Some(group) = rest.strip_prefix('{') else {
            names.push(name(rest));
            continue;
        };
        let (mut depth, mut at_head) = (0, true);
        for (index, c) in group.char_indices() {
            match c {
                '}' if depth == 0 => break,
                '{' => depth += 1,
                '}' => depth -= 1,
                ',' if depth == 0 => at_head = true,
                c if at_head && !c.is_whitespace() => {
                    names.push(name(&group[index..]));
                    at_head = false;
                }
                _ => {}
            }
        }
    }
    // `super::super::x` holds `super::` twice; a name that is a keyword is a step of a longer path.
    names.retain(|name| name != "super" && name != "self");
    names
}

/// The identifier at the beginning of a text.
fn name(text: &str) -> String {
    text.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect()
}

#[test]
fn paths_are_found_however_they_are_written() {
    let text = "use crate::{a::{b, c}, d, e::f as g};\n// crate::comment\nuse std::{fs, io::{self, Read}};\n\
                fn x() { crate::h::i(); $crate::j!() }\n#[cfg(test)]\nmod tests { use crate::k; }";
    let code = code(text);
    assert_eq!(after(&code, "crate::"), ["a", "d", "e", "h"]);
    assert_eq!(after(&code, "std::"), ["fs", "io"]);
    assert_eq!(after("use super::super::l::m;", "super::super::"), ["l"]);
    let text = "mod a;\n#[cfg(test)]\nmod b;\n#[cfg(test)]\nmod tests { fn c() { d; } }";
    assert_eq!(test_modules("x/mod.rs", text), ["x/b.rs"]);
    assert_eq!(test_modules("x/y.rs", text), ["x/y/b.rs"]);
    assert_eq!(words("unsafe_code unsafe {} my_unsafe", "unsafe").count(), 1);
}
