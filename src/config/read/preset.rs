//! The presets of a job's sensors: built-in sensors and sensor files, laid under what the job says.

use std::path::Path;

use super::super::job::{DataSheet, InputFile};
use super::super::keys::job::{MAX_SENSORS, MODE, NAME, PRESET, SENSORS};
use super::super::overlay;
use super::super::parse;
use super::super::presets;
use super::super::table::{Grammar, Reading};
use super::modes::{Modes, choose_mode, take_modes};
use super::nominal::settle_nominal;
use super::sensor::is_pattern;
use crate::source::suggest::missing_file_help;
use crate::source::tree::{Entries, Entry, Node, Value};
use crate::source::words::quoted;
use crate::source::{FileKind, Layer, Report, Span, Unreadable, Wanted, portable, recognise};

/// Most text that a job's sensors take from their files, each counted as often as it is used.
const MAX_PRESET_BYTES: usize = 8 << 20;

/// A preset that was read.
struct Preset {
    as_written: String,
    source: u32,
    /// The table without its modes.
    entries: Entries,
    modes: Modes,
}

/// The presets of a job, as far as reading the job goes on to need them.
#[derive(Debug, Default)]
pub(super) struct Laid {
    /// The files, in the job's order, each once.
    pub inputs: Vec<InputFile>,
    /// The spans of the sensors that lack what their preset should have given: the report says why.
    pub lost: Vec<Span>,
    /// The data sheets of the presets, with the spans of the sensors over these, in the job's order.
    pub data_sheets: Vec<(Span, DataSheet)>,
}

/// Writes down the name of a lone sensor without one, if an override addresses it by its default name.
pub(super) fn name_lone_sensor(grammar: &Grammar, job: &mut Entries, over: &Entries) {
    let Some(Node { value: Value::String(lone), .. }) = grammar.default_of(&NAME) else { return };
    let addressed = matches!(over.get(SENSORS.name()).map(|s| &s.node.value),
        Some(Value::Table(s)) if s.contains_key(lone));
    if let Some(entry) = job.get_mut(SENSORS.name()).filter(|_| addressed)
        && let Value::Array(sensors) = &mut entry.node.value
        && let [Node { span, value: Value::Table(sensor) }] = sensors.as_mut_slice()
        && !sensor.contains_key(NAME.name())
    {
        let name = Node { span: *span, value: Value::String(lone.clone()) };
        sensor.insert(NAME.name().to_owned(), Entry { key: *span, node: name });
    }
}

/// Lays every sensor of a job over its preset. Paths are relative to `folder`.
pub(super) fn lay_presets_under(
    report: &mut Report,
    grammar: &Grammar,
    job: &mut Entries,
    folder: &Path,
) -> Laid {
    let mut presets: Vec<Preset> = Vec::new();
    let mut laid = Laid::default();
    let mut bytes = 0;
    let Some(Value::Array(sensors)) = job.get_mut(SENSORS.name()).map(|entry| &mut entry.node.value) else {
        return laid;
    };
    for Node { span, value } in sensors.iter_mut().take(MAX_SENSORS) {
        let Value::Table(sensor) = value else { continue };
        let Some(Entry { node: named, .. }) = sensor.get(PRESET.name()) else { continue };
        let named_at = named.span;
        let preset = match &named.value {
            Value::String(as_written) => {
                open_preset(report, grammar, &mut presets, folder, as_written, named_at)
            }
            _ => None, // reported when it is read
        };
        let used = bytes;
        bytes += preset.map_or(0, |preset| report.text(preset.source).len());
        if bytes > MAX_PRESET_BYTES && used <= MAX_PRESET_BYTES {
            let message =
                format!("the job's sensors take more than {MAX_PRESET_BYTES} bytes from their files");
            report.error(named_at, message, "too much from here on", None);
        }
        let Some(preset) = preset.filter(|_| bytes <= MAX_PRESET_BYTES) else {
            // The errors about a part of a pattern would be about keys that the preset may well have.
            sensor.retain(|key, _| !is_pattern(key));
            laid.lost.push(*span);
            continue;
        };
        let reading = Reading { report, grammar };
        let mut merged = preset.entries.clone();
        if let Some(mode) = sensor.get(MODE.name()) {
            choose_mode(reading, &mut merged, &preset.modes, &mode.node);
        }
        laid.data_sheets.extend(settle_nominal(reading, &mut merged, sensor).map(|stated| (*span, stated)));
        overlay::lay_over(reading, &mut merged, std::mem::take(sensor));
        *sensor = merged;
    }
    let input =
        |preset: &Preset| InputFile::new(portable(&preset.as_written), report.text(preset.source).as_bytes());
    laid.inputs = presets.iter().map(input).collect();
    laid
}

/// The preset that a job calls `as_written` at `span`, read now or before.
fn open_preset<'a>(
    report: &mut Report,
    grammar: &Grammar,
    presets: &'a mut Vec<Preset>,
    folder: &Path,
    as_written: &str,
    span: Span,
) -> Option<&'a Preset> {
    if as_written.is_empty() {
        return None; // reported when it is read
    }
    if let Some(known) = presets.iter().position(|preset| preset.as_written == as_written) {
        return presets.get(known);
    }
    let path = folder.join(as_written);
    let opened = if presets::is_file(as_written) {
        report.open(&path, Layer::Preset)
    } else {
        match presets::text(as_written) {
            Some(text) => Ok(report.add(Path::new(as_written), text.to_owned(), Layer::Preset)),
            None => {
                report_unknown(report, as_written, span, &path);
                return None;
            }
        }
    };
    match opened {
        Ok(source) => {
            let text = report.text(source);
            let kind = FileKind::of(text.as_bytes(), text.len() as u64);
            if !kind.is_config() && !kind.is_unknown() {
                let (problem, help) = kind.instead_of(Wanted::Config);
                let message = format!("the sensor file {} can't be used", quoted(as_written));
                report.error(span, message, problem, help);
                return None;
            }
            let mut entries = parse::parse(report, source)?;
            let modes = take_modes(Reading { report, grammar }, &mut entries, Span::new(source, 0..0));
            presets.push(Preset { as_written: as_written.to_owned(), source, entries, modes });
            presets.last()
        }
        Err(Unreadable::Reported) => None,
        Err(problem) => {
            let help = problem.help(as_written, &path);
            let message = format!("the sensor file {} can't be used", quoted(as_written));
            report.error(span, message, problem.to_string(), help);
            None
        }
    }
}

/// Reports a preset that is neither a built-in sensor nor a file.
fn report_unknown(report: &Report, name: &str, span: Span, path: &Path) {
    match recognise(path) {
        Ok(kind) if !kind.is_config() && !kind.is_unknown() => {
            let (problem, help) = kind.instead_of(Wanted::Config);
            report.error(
                span,
                format!("the preset {}: {problem}", quoted(name)),
                "expected a sensor file",
                help,
            );
        }
        _ => {
            let looks_like_a_path = name.starts_with(['~', '.', '/']) || name.contains(['\\', ':']);
            let help = match () {
                () if path.exists() => Some("a sensor file's name ends in `.toml`".to_owned()),
                () if looks_like_a_path => missing_file_help(name, path),
                () => presets::near_name(name),
            };
            let message = format!("there is no built-in sensor {}", quoted(name));
            report.error(span, message, "expected its name, or a path that ends in `.toml`", help);
        }
    }
}
