//! The rooms of the crate and the imports between them: data flows one way, and a room does not use what it does not need.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// Each room with the rooms that its code may import, apart from tests. The list goes from the leaves up, and no room
/// imports a later one. `config` comes after the rooms that it describes (sensors, the method to trace with, output and
/// check settings).
const IMPORTS: &[(&str, &[&str])] = &[
    ("angle", &[]),
    ("source", &[]),
    ("error", &["source"]),
    ("physics", &[]),
    ("matching", &[]),
    ("rng", &[]),
    ("frame", &["angle"]),
    ("motion", &["frame"]),
    ("sensor", &["angle", "frame", "matching", "motion", "physics", "rng"]),
    ("scene", &["error", "frame", "motion", "physics", "source"]),
    ("trace", &["scene"]),
    ("scan", &["frame", "matching", "physics", "rng", "scene", "sensor", "trace"]),
    ("truth", &["frame", "motion", "scan", "scene", "sensor"]),
    ("placing", &["angle", "frame", "rng", "scene", "trace", "truth"]),
    (
        "output",
        &[
            "angle", "error", "frame", "motion", "physics", "rng", "scan", "scene", "sensor", "source",
            "truth",
        ],
    ),
    ("check", &["angle", "frame", "output", "scan", "scene", "sensor", "source"]),
    ("view", &["check", "error", "frame", "output", "scan", "scene", "sensor", "source"]),
    (
        "selftest",
        &["angle", "frame", "motion", "output", "physics", "rng", "scan", "scene", "sensor", "trace"],
    ),
    ("kernels", &["angle", "error", "frame", "motion", "rng", "scan", "scene", "sensor", "trace"]),
    (
        "config",
        &[
            "angle", "check", "error", "frame", "matching", "motion", "output", "physics", "rng", "scan",
            "scene", "sensor", "source", "trace", "truth",
        ],
    ),
    ("plausibility", &["config", "frame", "motion", "output", "scene", "sensor", "source", "trace"]),
    (
        "run",
        &[
            "check",
            "config",
            "error",
            "frame",
            "motion",
            "output",
            "physics",
            "placing",
            "plausibility",
            "rng",
            "scan",
            "scene",
            "sensor",
            "source",
            "trace",
            "truth",
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

/// The paths that only some files may use, each with those files and the reason.
const CONFINED: &[(&str, &[&str], &str)] = &[
    (
        "std::fs",
        &["source/", "output/files.rs", "output/whole.rs", "output/recorded/folder.rs", "run/", "cli/"],
        "files are opened at the edges only",
    ),
    ("rustix", &["output/whole.rs"], "the system is advised where files are written"),
    (
        "std::path",
        &[
            "source/",
            "error.rs",
            "config/",
            "scene/gltf/",
            "output/files.rs",
            "output/whole.rs",
            "output/recorded/folder.rs",
            "output/recorded/manifest.rs",
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
        &[
            "matching/",
            "scan/",
            "sensor/camera.rs",
            "scene/regions.rs",
            "scene/frames.rs",
            "sensor/capture.rs",
            "trace/bvh/",
            "trace/top.rs",
            "trace/tracer.rs",
            "output/exr/",
            "output/las/chunks.rs",
            "output/npz.rs",
            "output/waveform.rs",
            "kernels/",
            "cli/",
        ],
        "threads live where rays are shared out, images matched, images and clouds compressed, waveforms sampled, lenses inverted, scenes split, shapes posed and trees built",
    ),
    ("clap::", &["cli/"], "only the command line has flags"),
    ("toml::", &["config/"], "only config knows TOML"),
    ("image_webp::", &["scene/gltf/images.rs"], "only the loader of textures decodes WebP"),
    ("zune_jpeg::", &["scene/gltf/images.rs"], "only the loader of textures decodes JPEG"),
    (
        "laz::",
        &["output/las/chunks.rs", "output/recorded/laszip.rs"],
        "only the compression of LAZ knows LASzip",
    ),
    ("draco_core::", &["scene/gltf/draco.rs"], "only the loader of compressed primitives knows Draco"),
    (
        "ruzstd::",
        &["output/ros/zstd.rs", "output/recorded/mcap.rs"],
        "only the container of bags compresses with Zstandard",
    ),
    ("lz4_flex::", &["output/recorded/mcap.rs"], "only the container of bags unpacks LZ4"),
    ("unsafe", &["trace/simd/x86/"], "intrinsics, and asking for huge pages, are all that needs it"),
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

/// Within each room, and within each folder of a room, the modules import each other in one direction.
///
/// The modules of a folder are its files, its subfolders (each one module, whatever is in it), and the folder's own `mod.rs`. A
/// path that names a module imports that module. A path that names an item of the folder itself imports the module from which
/// `mod.rs` takes the item by a `use`, or `mod.rs` if the item is declared there. `mod.rs` imports the modules that its code
/// names, but not those whose items it only passes on by a `pub use`. A method that is called on a value imports nothing.
#[test]
fn the_modules_of_a_room_import_each_other_in_one_direction() {
    let sources: BTreeMap<Vec<String>, String> =
        sources().into_iter().map(|(file, code)| (module_path(&file), code)).collect();
    let folders: BTreeSet<&[String]> =
        sources.keys().filter(|path| path.len() > 1).map(|path| &path[..path.len() - 1]).collect();
    let mut wrong = Vec::new();
    for folder in folders {
        let name = folder.join("/");
        if let Some(circle) = circle(&imports_within(folder, &sources)) {
            wrong.push(format!("src/{name}: {} is a circle", circle.join(" → ")));
        }
    }
    assert!(wrong.is_empty(), "\n{}\n", wrong.join("\n"));
}

/// The path of the module that a source file is.
fn module_path(file: &str) -> Vec<String> {
    let mut path: Vec<_> = file.trim_end_matches(".rs").split('/').map(String::from).collect();
    if path.last().is_some_and(|last| last == "mod") {
        path.pop();
    }
    path
}

/// The name of a folder's own module in [`imports_within`].
const OWN: &str = "mod.rs";

/// For each module of a folder the modules of the folder that it imports.
fn imports_within(
    folder: &[String],
    sources: &BTreeMap<Vec<String>, String>,
) -> BTreeMap<String, BTreeSet<String>> {
    let children: BTreeSet<&String> =
        sources.keys().filter_map(|path| path.strip_prefix(folder)?.first()).collect();
    // The items that mod.rs takes from a child, and from which.
    let own = sources.get(folder).map(|code| paths(code)).unwrap_or_default();
    let child_of = |path: &[String]| path.first().filter(|first| children.contains(first)).cloned();
    let taken: BTreeMap<&String, String> =
        own.iter().filter_map(|path| Some((path.names.last()?, child_of(&path.names)?))).collect();
    let mut imports: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for (module, code) in sources {
        let Some(below) = module.strip_prefix(folder) else { continue };
        let from = below.first().map_or(OWN, String::as_str);
        for path in paths(code) {
            let Some(names) = path.absolute(module) else {
                if below.is_empty() && !path.is_passed_on {
                    imports.entry(from.into()).or_default().extend(child_of(&path.names));
                }
                continue;
            };
            let Some([first, ..]) = names.strip_prefix(folder) else { continue };
            let to = match () {
                () if below.is_empty() && path.is_passed_on => continue,
                () if children.contains(first) => first.as_str(),
                () => taken.get(first).map_or(OWN, String::as_str),
            };
            if to != from {
                imports.entry(from.into()).or_default().insert(to.into());
            }
        }
    }
    imports
}

/// A path in code, as it is written there.
struct CodePath {
    /// The number of `super::` that it begins with, or `None` if it begins otherwise.
    up: Option<usize>,
    is_from_crate: bool,
    names: Vec<String>,
    /// True if it stands in a `pub use`.
    is_passed_on: bool,
}

impl CodePath {
    /// The path from the crate's root, seen from a module; `None` if it begins with a plain name.
    fn absolute(&self, module: &[String]) -> Option<Vec<String>> {
        let root = match self.up {
            _ if self.is_from_crate => &[],
            Some(up) => &module[..module.len().checked_sub(up)?],
            None => return None,
        };
        Some([root, &self.names].concat())
    }
}

/// Every path of two or more names in code, those of `use` with their branches.
fn paths(code: &str) -> Vec<CodePath> {
    let mut found = Vec::new();
    let mut rest = code;
    let is_part = |c: char| c.is_alphanumeric() || c == '_';
    let mut is_passed_on = false;
    while let Some(start) = rest.find(is_part) {
        let before = rest[..start].trim_end();
        is_passed_on &= !before.contains(';');
        let is_continued = before.ends_with("::") || before.ends_with('$') || before.ends_with('.');
        rest = &rest[start..];
        let end = rest.find(|c| !is_part(c)).unwrap_or(rest.len());
        let word = &rest[..end];
        if word == "use" {
            // `pub use` and `pub(…) use` pass on what they name.
            let statement = code[..code.len() - rest.len()].trim_end();
            let line = statement.rsplit(['\n', ';', '}']).next().unwrap_or_default();
            is_passed_on = words(line, "pub").next().is_some();
        }
        if is_continued || !rest[end..].starts_with("::") {
            rest = &rest[end..];
            continue;
        }
        let length = rest.find(|c: char| !is_part(c) && c != ':').unwrap_or(rest.len());
        let (head, tail) = rest.split_at(length);
        let branches = match tail.strip_prefix('{').filter(|_| head.ends_with("::")) {
            Some(group) => branches(group),
            None => vec![String::new()],
        };
        for branch in branches {
            let full = format!("{head}{branch}");
            let mut names: Vec<String> =
                full.split("::").filter(|name| !name.is_empty()).map(|name| name.trim().into()).collect();
            let up = names.iter().take_while(|name| *name == "super").count();
            let is_from_crate = names.first().is_some_and(|name| name == "crate");
            let is_own = names.first().is_some_and(|name| name == "self");
            names.drain(..if is_from_crate || is_own { 1 } else { up });
            names.retain(|name| name != "self");
            found.push(CodePath { up: (up > 0).then_some(up), is_from_crate, names, is_passed_on });
        }
        let group_end = match tail.strip_prefix('{').filter(|_| head.ends_with("::")) {
            Some(group) => {
                let mut depth = 0;
                let end = group.find(|c| {
                    depth += i32::from(c == '{') - i32::from(c == '}');
                    depth < 0
                });
                end.map_or(tail.len(), |end| end + 1)
            }
            None => 0,
        };
        rest = &tail[group_end..];
    }
    found
}

/// The branches of the group of a `use`, given what follows its opening brace.
fn branches(group: &str) -> Vec<String> {
    let (mut depth, mut start, mut found) = (0, 0, Vec::new());
    for (index, c) in group.char_indices() {
        match c {
            '{' => depth += 1,
            '}' if depth > 0 => depth -= 1,
            ',' | '}' if depth == 0 => {
                let branch = group[start..index].split(" as ").next().unwrap_or_default().trim();
                match branch.split_once('{') {
                    Some((head, inner)) => {
                        found.extend(branches(inner).into_iter().map(|inner| format!("{head}{inner}")));
                    }
                    None if branch.is_empty() => {}
                    None => found.push(branch.into()),
                }
                start = index + 1;
                if c == '}' {
                    break;
                }
            }
            _ => {}
        }
    }
    found
}

/// A circle of imports, if there is one: its modules in order, the first once more at the end.
fn circle(imports: &BTreeMap<String, BTreeSet<String>>) -> Option<Vec<String>> {
    fn visit(
        module: &String,
        imports: &BTreeMap<String, BTreeSet<String>>,
        way: &mut Vec<String>,
        done: &mut BTreeSet<String>,
    ) -> Option<Vec<String>> {
        if let Some(start) = way.iter().position(|earlier| earlier == module) {
            return Some(way[start..].iter().chain([module]).cloned().collect());
        }
        if done.contains(module) {
            return None;
        }
        way.push(module.clone());
        let found =
            imports.get(module).into_iter().flatten().find_map(|next| visit(next, imports, way, done));
        way.pop();
        done.insert(module.clone());
        found
    }
    let mut done = BTreeSet::new();
    imports.keys().find_map(|module| visit(module, imports, &mut Vec::new(), &mut done))
}

#[test]
fn circles_are_found() {
    let files = [
        ("room/mod.rs", "mod a; mod b;\npub use a::A;\npub(crate) use b::{B, inner::C};\nfn x() { 1 }"),
        ("room/a.rs", "use super::{B, c::{D, E}};\nfn y(x: super::super::other::Z) {}"),
        ("room/b.rs", "fn z() -> super::C { crate::room::c::f() }"),
        ("room/c/mod.rs", "use super::Own;\nmod d;"),
        ("room/c/d.rs", "use std::fmt;\nuse super::super::a::A;"),
    ];
    let sources = files.map(|(file, code)| (module_path(file), code.to_string())).into();
    let imports = imports_within(&["room".to_string()], &sources);
    let of = |module: &str| imports[module].iter().map(String::as_str).collect::<Vec<_>>();
    assert_eq!(of("a"), ["b", "c"]);
    assert_eq!(of("b"), ["c"]);
    assert_eq!(of("c"), ["a", "mod.rs"]);
    assert!(!imports.contains_key("mod.rs"), "mod.rs only passes on");
    assert_eq!(circle(&imports).unwrap(), ["a", "b", "c", "a"]);
    assert_eq!(circle(&[("a".into(), ["b".into()].into()), ("b".into(), ["c".into()].into())].into()), None);
}

#[test]
fn confined_paths_stay_in_their_files() {
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

/// Every source file by its path in src/, in the form that [`code`] returns.
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
    // Modules that are declared only for tests are left out, whatever their names are.
    let of_tests: BTreeSet<String> = found.iter().flat_map(|(file, text)| test_modules(file, text)).collect();
    found.retain(|file, _| !of_tests.contains(file));
    found.values_mut().for_each(|text| *text = code(text));
    found
}

/// The files of the modules that `file` declares only for tests.
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

/// A file without its comments and without its tests, which stand at its end.
fn code(text: &str) -> String {
    let code = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
    code.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
}

/// The positions at which `word` begins as a word of its own.
fn words<'a>(code: &'a str, word: &'a str) -> impl Iterator<Item = usize> + 'a {
    let is_part = |c: char| c.is_alphanumeric() || c == '_' || c == '$';
    code.match_indices(word).map(|(at, _)| at).filter(move |&at| {
        !code[..at].ends_with(is_part)
            && (word.ends_with(':') || !code[at + word.len()..].starts_with(is_part))
    })
}

/// The names that follow `root::`, alone or at the head of a branch of `root::{…}`.
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
    // `super::super::x` contains `super::` twice, and a keyword is a step of a longer path.
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
