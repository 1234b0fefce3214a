//! The reference page of all keys, in Markdown.

use std::fmt::Write as _;

use super::table::{AnyKey, Grammar, TableKeys, unit};

/// The head of the page of jobs and sensor files.
pub(super) const INTRODUCTION: &str = "\
# Keys

Every key of jobs and sensor files. `beamcast schema keys` prints this page, and a test holds it to the program.
[patterns.md](patterns.md) explains the patterns, and [sequences.md](sequences.md) poses and motion.

A key's name ends in the unit of its numbers: `_m` metres, `_deg` degrees, `_s` seconds, `_us` microseconds, `_ns` nanoseconds,
`_hz` hertz, `_px` pixels, `_mrad` milliradians, `_nm` nanometres, `_klx` kilolux. Paths are relative to the file that names them.
A table in a job's `[[sensor]]` adds to the same table of the preset, key by key. An error tells an unknown key, a missing key and
a wrong value with its line and what would be right.
";

/// The page: a section a table, a row a key. `introduction` comes first.
pub(super) fn page(grammar: &Grammar, introduction: &str) -> String {
    let mut page = introduction.to_owned();
    for table in &grammar.tables {
        let _ = writeln!(page, "\n## {}\n", capitalised(table.title));
        if let Some(places) = places(grammar, table) {
            let _ = writeln!(page, "{places}\n");
        }
        page.push_str("| key | value | left out | |\n|---|---|---|---|\n");
        for key in table.keys {
            let facts = key.facts();
            let value = key.kind().documented(unit(facts.name));
            let left_out = match (facts.required, facts.default) {
                (Some(_), _) => "an error".to_owned(),
                (None, Some(default)) => format!("`{default}`"),
                (None, None) => String::new(),
            };
            let _ = writeln!(page, "| `{}` | {value} | {left_out} | {} |", facts.name, facts.about);
        }
        for group in table.groups() {
            let names: Vec<_> = group.iter().map(|key| format!("`{}`", key.name())).collect();
            let unless =
                table.unless.map_or(String::new(), |key| format!(", unless there is a `{}`", key.name()));
            let _ = writeln!(page, "\nExactly one of {} must be there{unless}.", names.join(", "));
        }
    }
    page
}

/// The keys whose values this table can be.
fn places(grammar: &Grammar, table: &'static TableKeys) -> Option<String> {
    let is_here = |key: &&&'static dyn AnyKey| key.kind().tables().iter().any(|t| std::ptr::eq(*t, table));
    let place = |outer: &&'static TableKeys| {
        let keys = outer.keys.iter().filter(is_here).map(|key| format!("`{}`", key.name()));
        let keys = keys.collect::<Vec<_>>().join(" and ");
        (!keys.is_empty()).then(|| format!("{keys} of {}", link(outer)))
    };
    let places: Vec<String> = grammar.tables.iter().filter_map(place).collect();
    (!places.is_empty()).then(|| format!("The value of {}.", places.join("; ")))
}

/// A link to the section of a table.
pub(super) fn link(table: &TableKeys) -> String {
    let is_kept = |c: &char| c.is_alphanumeric() || matches!(c, ' ' | '_' | '-');
    let anchor: String = table.title.to_lowercase().chars().filter(is_kept).collect();
    format!("[{}](#{})", table.title, anchor.replace(' ', "-"))
}

fn capitalised(text: &str) -> String {
    let mut characters = text.chars();
    characters.next().map_or(String::new(), |first| first.to_uppercase().chain(characters).collect())
}
