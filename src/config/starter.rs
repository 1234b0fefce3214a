//! The commented job that `beamcast init` writes.

use std::fmt::Write as _;

use super::table::{Starter, TableKeys};
use crate::source::words::{printable, without_commands};

/// The longest line of a comment, in characters.
const WIDTH: usize = 110;

/// The head of a job.
pub(super) const INTRODUCTION: &str = "\
#:schema job.schema.json
# The line above is for editors: after `beamcast schema job > job.schema.json`, they complete and check the keys below.
# Keys that stand as comments, without a blank after the #, are suggestions. `beamcast schema keys` describes all keys.
";

/// The text of a file: every key of a table that has a starter, each under its own description. `values` are TOML, and take
/// the place of the starters of the keys of these names.
pub(super) fn text(keys: &TableKeys, values: &[(&str, &str)]) -> String {
    let mut text = String::new();
    write_table(keys, "", values, &mut text);
    text
}

fn write_table(keys: &TableKeys, path: &str, values: &[(&str, &str)], text: &mut String) {
    // In TOML, a table's own keys come before the tables in it.
    for facts in keys.keys.iter().map(|key| key.facts()) {
        let Some(starter) = facts.starter else { continue };
        if path.is_empty() {
            text.push('\n');
        }
        text.push_str(&comment(facts.about));
        let _ = match starter {
            Starter::Written(value) => {
                let given = values.iter().find(|(name, _)| *name == facts.name);
                writeln!(text, "{} = {}", facts.name, given.map_or(value, |(_, value)| value))
            }
            Starter::Suggested(value) => writeln!(text, "#{} = {value}", facts.name),
        };
    }
    for key in keys.keys.iter().filter(|key| key.facts().starter.is_none()) {
        let facts = key.facts();
        let path = if path.is_empty() { facts.name.to_owned() } else { format!("{path}.{}", facts.name) };
        let (Some(header), Some(inner)) = (key.kind().header(&path), key.kind().tables().pop()) else {
            continue;
        };
        if !has_starter(inner) {
            continue;
        }
        text.push('\n');
        text.push_str(&comment(facts.about));
        // A header without a written key stands as a comment, too.
        let _ = writeln!(text, "{}{header}", if is_written(inner) { "" } else { "#" });
        write_table(inner, &path, values, text);
    }
}

fn has_starter(keys: &TableKeys) -> bool {
    let has_one = |inner: &&'static TableKeys| has_starter(inner);
    keys.keys.iter().any(|key| key.facts().starter.is_some() || key.kind().tables().iter().any(has_one))
}

fn is_written(keys: &TableKeys) -> bool {
    keys.keys.iter().any(|key| matches!(key.facts().starter, Some(Starter::Written(_))))
}

/// A comment of TOML, in lines of at most [`WIDTH`] characters. An empty line separates paragraphs.
pub(crate) fn comment(text: &str) -> String {
    let mut comment = String::new();
    for line in text.split('\n') {
        let mut width = 0;
        for word in line.split_whitespace() {
            let word = printable(word);
            let length = word.chars().count();
            if width > 0 && width + 1 + length > WIDTH {
                comment.push('\n');
                width = 0;
            }
            if width == 0 {
                comment.push('#');
                width = 1;
            }
            comment.push(' ');
            comment.push_str(&word);
            width += 1 + length;
        }
        comment.push_str(if width == 0 { "#\n" } else { "\n" });
    }
    without_commands(&comment)
}
