//! A sensor file on its own → [`SensorFile`].

use std::path::Path;

use super::super::job::SensorFile;
use super::super::keys::sensor::SENSOR_FILE;
use super::super::table::{Grammar, Reading, Table};
use super::modes::{lay_mode, take_modes};
use super::nominal::nominal;
use super::rig::MAX_BEAMS;
use super::sensor::sensor;
use super::sensor_files::SensorFiles;
use crate::source::tree::Entries;
use crate::source::{Report, Span};

/// Most bytes of a sensor file, counted once for each of its modes. The longest preset has 60 kB.
const MAX_BYTES_OF_MODES: usize = 32 << 20;

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
    // Each mode is read from a copy of the whole file, and gives a whole sensor.
    let bytes = report.text(0).len().saturating_mul(modes.len());
    if let Some((_, mode)) = modes.first().filter(|_| bytes > MAX_BYTES_OF_MODES) {
        let message = format!("{} modes of a file of this length are too many", modes.len());
        report.error(mode.span, message, "expected fewer, or a shorter file", None);
        return None;
    }
    let mut files = SensorFiles::default();
    let read = |report: &mut Report, files: &mut SensorFiles, entries: &Entries| {
        files.read(report, entries);
        sensor(&Table::new(Reading { report, grammar }, &SENSOR_FILE, entries, whole), files, false)
    };
    let as_it_stands = read(report, &mut files, &entries);
    let nominal_figures = nominal(Reading { report, grammar }, &entries, &files, whole);
    let mut in_modes = Vec::new();
    let mut beams = 0;
    for (name, mode) in modes {
        let mut entries = entries.clone();
        lay_mode(Reading { report, grammar }, &mut entries, &mode);
        nominal(Reading { report, grammar }, &entries, &files, whole); // what is wrong with it is reported
        let Some(sensor) = read(report, &mut files, &entries) else { continue };
        beams += if sensor.pattern.is_camera() { 0 } else { sensor.pattern.rows() };
        if beams > MAX_BEAMS {
            let message = format!("the modes of the sensor have more than {MAX_BEAMS} beams in all");
            report.error(mode.span, message, "too many from here on", None);
            break;
        }
        in_modes.push((name, sensor));
    }
    if report.has_errors() {
        return None;
    }
    let modes = in_modes;
    Some(SensorFile {
        path: path.to_path_buf(),
        sensor: as_it_stands?,
        nominal: nominal_figures,
        modes,
        warnings: Vec::new(),
    })
}
