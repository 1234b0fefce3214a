//! The modes of a sensor file.

use super::super::keys::sensor::{MODES, PATTERNS, SENSOR_FILE};
use super::super::overlay;
use super::super::table::{Reading, Table};
use crate::source::Span;
use crate::source::suggest::nearest;
use crate::source::tree::{Entries, Node, Value};
use crate::source::words::{list, quoted};

/// The modes of a sensor, by their names, each with the table that is laid over the sensor's.
pub(super) type Modes = Vec<(String, Node)>;

/// Takes the modes out of the table of a sensor file. Reports the keys of the file that are unknown, and takes them out,
/// too: the errors about them name the file's table rather than that of a job's sensor.
pub(super) fn take_modes(reading: Reading<'_>, entries: &mut Entries, file: Span) -> Modes {
    let table = Table::new(reading, &SENSOR_FILE, entries, file);
    let known =
        table.read(&MODES).map(|modes| modes.value.into_keys().map(str::to_owned).collect::<Vec<_>>());
    entries.retain(|name, _| SENSOR_FILE.names().any(|key| key == name));
    let Some(Value::Table(modes)) = entries.remove(MODES.name()).map(|entry| entry.node.value) else {
        return Vec::new();
    };
    let named = modes.into_iter().map(|(name, entry)| (name, entry.node));
    named.filter(|(name, _)| known.as_ref().is_some_and(|known| known.contains(name))).collect()
}

/// Lays the mode that a job asks for over its sensor's table.
pub(super) fn choose_mode(reading: Reading<'_>, entries: &mut Entries, modes: &Modes, wanted: &Node) {
    let Value::String(name) = &wanted.value else { return }; // reported when it is read
    if let Some((_, mode)) = modes.iter().find(|(known, _)| known == name) {
        return lay_mode(reading, entries, mode);
    }
    let is_shown = |mode: &&(String, Node)| reading.report.is_shown(mode.1.span.source);
    let names = || modes.iter().filter(is_shown).map(|(name, _)| name.as_str());
    let help = match (nearest(name, names()), modes.is_empty()) {
        (_, true) => "this sensor has no modes: leave it out".to_owned(),
        (Some(near), _) => format!("did you mean {}?", quoted(near)),
        (None, _) => format!("its modes are {}", list(names(), "and")),
    };
    let message = format!("the sensor has no mode {}", quoted(name));
    reading.report.error(wanted.span, message, "", Some(help));
}

/// Lays a mode over its sensor's table. A mode with another pattern than the sensor's takes its place: a camera may see through
/// a pinhole in one mode and as a fisheye in another.
pub(super) fn lay_mode(reading: Reading<'_>, entries: &mut Entries, mode: &Node) {
    if let Value::Table(over) = &mode.value {
        let is_pattern = |name: &str| PATTERNS.iter().any(|pattern| pattern.name() == name);
        if over.keys().any(|name| is_pattern(name)) {
            entries.retain(|name, _| over.contains_key(name) || !is_pattern(name));
        }
        overlay::lay_over(reading, entries, over.clone());
    }
}
