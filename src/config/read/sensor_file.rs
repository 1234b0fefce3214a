//! A sensor file on its own → [`SensorFile`].

use std::path::Path;

use super::super::job::SensorFile;
use super::super::keys::sensor::SENSOR_FILE;
use super::super::table::{Grammar, Reading, Table};
use super::modes::{lay_mode, take_modes};
use super::rays::RayFiles;
use super::sensor::sensor;
use crate::source::tree::Entries;
use crate::source::{Report, Span};

/// Reads the sensor file in `entries`, which is the first text of the report. `None` if the report has errors.
pub(in super::super) fn sensor_file(
    report: &mut Report,
    grammar: &Grammar,
    path: &Path,
    mut entries: Entries,
) -> Option<SensorFile> {
    let whole = Span::new(0, 0..0);
    let reading = Reading { report, grammar };
    let modes = take_modes(reading, &mut entries, whole);
    let in_mode = |(name, mode)| {
        let mut entries = entries.clone();
        lay_mode(reading, &mut entries, &mode);
        (name, entries)
    };
    let modes: Vec<(String, Entries)> = modes.into_iter().map(in_mode).collect();
    let mut ray_files = RayFiles::default();
    for entries in std::iter::once(&entries).chain(modes.iter().map(|(_, entries)| entries)) {
        ray_files.read(report, entries);
    }
    let reading = Reading { report, grammar };
    let read = |entries| sensor(&Table::new(reading, &SENSOR_FILE, entries, whole), &ray_files, false);
    let as_it_stands = read(&entries);
    let modes: Vec<_> = modes.iter().map(|(name, entries)| (name, read(entries))).collect();
    if report.has_errors() {
        return None;
    }
    let modes = modes.into_iter().filter_map(|(name, sensor)| Some((name.clone(), sensor?))).collect();
    Some(SensorFile { path: path.to_path_buf(), sensor: as_it_stands?, modes, warnings: Vec::new() })
}
