//! Tables of rays: CSV → pulses.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::DVec3;

use super::super::job::InputFile;
use super::super::keys::sensor::{RAYS, rays};
use crate::angle::Angle;
use crate::sensor::{Pulse, RayTable, direction};
use crate::source::suggest::nearest;
use crate::source::tree::{Entries, Value};
use crate::source::words::{list, quoted};
use crate::source::{Layer, Report, Span, Spanned, Unreadable, portable};

/// The largest file that is read, in bytes.
const MAX_BYTES: u64 = 256 << 20;

/// Most rays of a table.
const MAX_RAYS: usize = 4_000_000;

/// Most errors of a file that are reported: most of them are the same mistake.
const MAX_ERRORS: usize = 10;

/// The tables of rays that a configuration names. Sensors that name the same file share its rays.
#[derive(Debug, Default)]
pub(super) struct RayFiles {
    /// By path. `None`: the file can't be used, which was reported.
    tables: BTreeMap<PathBuf, Option<(RayTable, Option<Span>)>>,
    /// The files in the order in which they were read.
    pub inputs: Vec<InputFile>,
}

impl RayFiles {
    /// Reads the file that a sensor's `[rays]` names, unless it was read before. Its path is relative to the file that
    /// names it.
    pub fn read(&mut self, report: &mut Report, sensor: &Entries) {
        let Some(Value::Table(table)) = sensor.get(RAYS.name()).map(|entry| &entry.node.value) else {
            return;
        };
        let Some(file) = table.get(rays::FILE.name()).map(|entry| &entry.node) else { return };
        let Value::String(as_written) = &file.value else { return }; // reported when it is read
        let path = report.folder(file.span).join(as_written);
        if !as_written.is_empty() && !self.tables.contains_key(&path) {
            let table = self.open(report, as_written, &path, file.span);
            self.tables.insert(path, table);
        }
    }

    /// The rays of a file that was read, without a rate, and the header of a column `Time/s` that counts the rays. `None` if
    /// there is something wrong with the file.
    pub fn table(&self, report: &Report, file: Spanned<&str>) -> Option<(RayTable, Option<Span>)> {
        self.tables.get(&report.folder(file.span).join(file.value))?.clone()
    }

    fn open(
        &mut self,
        report: &mut Report,
        as_written: &str,
        path: &Path,
        span: Span,
    ) -> Option<(RayTable, Option<Span>)> {
        match report.open_up_to(path, Layer::Preset, MAX_BYTES) {
            Ok(source) => {
                self.inputs.push(InputFile::new(portable(as_written), report.text(source).as_bytes()));
                // Every ray was checked as it was parsed.
                let (pulses, counted) = parse(report, source)?;
                Some((RayTable::new(pulses, None).ok()?, counted))
            }
            Err(Unreadable::Reported) => None,
            Err(problem) => {
                let help = problem.help(as_written, path);
                let message = format!("the table of rays {} can't be used", quoted(as_written));
                report.error(span, message, problem.to_string(), help);
                None
            }
        }
    }
}

/// The columns that a table may have; the first two or the next three must be there, or the azimuth and the zenith.
const COLUMNS: [&str; 11] = [
    "azimuth_deg",
    "elevation_deg",
    "x",
    "y",
    "z",
    "time_s",
    "time_us",
    "origin_x_m",
    "origin_y_m",
    "origin_z_m",
    "zenith_deg",
];
/// The columns of Livox's pattern tables (livox_laser_simulation), in lower case, as an index into [`COLUMNS`].
const OF_LIVOX: [(&str, usize); 3] = [("time/s", TIME_S), ("azimuth/deg", AZIMUTH), ("zenith/deg", ZENITH)];
const AZIMUTH: usize = 0;
const ELEVATION: usize = 1;
const X: usize = 2;
const Y: usize = 3;
const Z: usize = 4;
const TIME_S: usize = 5;
const TIME_US: usize = 6;
const ORIGIN_X: usize = 7;
const ORIGIN_Y: usize = 8;
const ORIGIN_Z: usize = 9;
/// The angle from straight up.
const ZENITH: usize = 10;

/// Reads a table: a header, then a ray a line. Empty lines and such that begin with `#` are left out.
///
/// In some of Livox's tables the column `Time/s` counts the rays: it goes up by one from line to line, which would be a pulse a
/// second. Its span is given then, and the rays have no times.
fn parse(report: &Report, source: u32) -> Option<(Vec<Pulse>, Option<Span>)> {
    let text = report.text(source);
    let mut lines = Lines { text: text.strip_prefix('\u{feff}').unwrap_or(text), whole: text };
    let header = lines.next();
    let Some((header_at, header)) = header else {
        report.error(Span::new(source, 0..0), "the table of rays is empty", "expected a header", None);
        return None;
    };
    let columns = columns(report, source, (header_at, header))?;
    // Growing, the list would take up to three times its size.
    let most = text.bytes().filter(|byte| *byte == b'\n').count().min(MAX_RAYS);
    let mut pulses = Vec::with_capacity(most);
    let mut errors = 0;
    for (at, line) in lines {
        if pulses.len() == MAX_RAYS {
            let message = format!("the table has more than {MAX_RAYS} rays");
            report.error(Span::new(source, at..at + line.len()), message, "too many from here on", None);
            return None;
        }
        match ray(&columns, (at, line)) {
            Ok(pulse) => pulses.push(pulse),
            Err((span, message, label)) => {
                report.error(Span::new(source, span), message, label, None);
                errors += 1;
                if errors == MAX_ERRORS {
                    break;
                }
            }
        }
    }
    if errors == 0 && pulses.is_empty() {
        let span = Span::new(source, header_at..header_at + header.len());
        report.error(span, "the table has no rays", "expected a ray a line after this", None);
    }
    if errors > 0 || pulses.is_empty() {
        return None;
    }
    let time = fields((header_at, header)).find(|(_, name)| name.eq_ignore_ascii_case(OF_LIVOX[0].0));
    let counts = pulses.len() > 1 && pulses.windows(2).all(|pair| pair[1].time_s - pair[0].time_s == 1.0);
    let counted = time.filter(|_| counts).map(|(span, _)| Span::new(source, span));
    if counted.is_some() {
        pulses.iter_mut().for_each(|pulse| pulse.time_s = 0.0);
    }
    Some((pulses, counted))
}

/// The lines that say something, each with the byte where it begins.
struct Lines<'a> {
    text: &'a str,
    whole: &'a str,
}

impl<'a> Iterator for Lines<'a> {
    type Item = (usize, &'a str);
    fn next(&mut self) -> Option<Self::Item> {
        while !self.text.is_empty() {
            let at = self.whole.len() - self.text.len();
            let (line, rest) = self.text.split_once('\n').unwrap_or((self.text, ""));
            self.text = rest;
            let line = line.trim_end();
            if !line.is_empty() && !line.starts_with('#') {
                return Some((at, line));
            }
        }
        None
    }
}

/// The fields of a line, each without the blanks around it and with the bytes where it is.
fn fields((at, line): (usize, &str)) -> impl Iterator<Item = (std::ops::Range<usize>, &str)> {
    let mut start = at;
    line.split(',').map(move |field| {
        let begin = start + (field.len() - field.trim_start().len());
        start += field.len() + 1;
        let field = field.trim();
        (begin..begin + field.len(), field)
    })
}

/// What each of a table's columns is, as an index into [`COLUMNS`].
fn columns(report: &Report, source: u32, header: (usize, &str)) -> Option<Vec<usize>> {
    let whole = Span::new(source, header.0..header.0 + header.1.len());
    let mut columns: Vec<usize> = Vec::new();
    let mut is_fine = true;
    for (span, name) in fields(header) {
        let span = Span::new(source, span);
        let of_livox = OF_LIVOX.iter().find(|(livox, _)| name.eq_ignore_ascii_case(livox));
        let known = COLUMNS.iter().position(|c| *c == name).or(of_livox.map(|(_, index)| *index));
        match known {
            None => {
                let help = match nearest(name, COLUMNS) {
                    Some(near) => format!("did you mean {}?", quoted(near)),
                    None => format!("the columns of a table of rays are {}", list(COLUMNS, "and")),
                };
                report.error(span, format!("unknown column {}", quoted(name)), "", Some(help));
                is_fine = false;
            }
            Some(index) if columns.contains(&index) => {
                report.error(span, format!("the column {} is there twice", quoted(name)), "", None);
                is_fine = false;
            }
            Some(index) => columns.push(index),
        }
    }
    if !is_fine {
        return None;
    }
    let has = |list: &[usize]| list.iter().filter(|c| columns.contains(c)).count();
    let (azimuth, upward, axes) = (has(&[AZIMUTH]), has(&[ELEVATION, ZENITH]), has(&[X, Y, Z]));
    let complain = |message: &str, label: &str| {
        report.error(whole, message, label, None);
        None
    };
    if (azimuth, upward, axes) != (1, 1, 0) && (azimuth, upward, axes) != (0, 0, 3) {
        return complain(
            "a table of rays has one direction a line",
            "expected the columns `azimuth_deg` and `elevation_deg`, or `x`, `y` and `z`",
        );
    }
    if has(&[TIME_S, TIME_US]) == 2 {
        return complain("the table has both `time_s` and `time_us`", "expected one of them at most");
    }
    if ![0, 3].contains(&has(&[ORIGIN_X, ORIGIN_Y, ORIGIN_Z])) {
        return complain(
            "an origin has three coordinates",
            "expected `origin_x_m`, `origin_y_m` and `origin_z_m`",
        );
    }
    Some(columns)
}

type Wrong = (std::ops::Range<usize>, String, String);

/// The ray of a line, or what is wrong with it.
fn ray(columns: &[usize], line: (usize, &str)) -> Result<Pulse, Wrong> {
    let mut values = [0.0; COLUMNS.len()];
    let mut read = 0;
    for (span, field) in fields(line) {
        let Some(&column) = columns.get(read) else {
            let message = format!("the line has more than {} values", columns.len());
            return Err((span, message, "one too many".into()));
        };
        let name = COLUMNS[column];
        let number = field.parse::<f64>().ok().filter(|x| x.is_finite());
        let Some(number) = number else {
            return Err((span, format!("`{name}` is {}", quoted(field)), "expected a finite number".into()));
        };
        let expected = match column {
            ZENITH if !(0.0..=180.0).contains(&number) => "expected 0 (straight up) to 180 (straight down)",
            ELEVATION if number.abs() > 90.0 => "expected -90 (straight down) to 90 (straight up)",
            TIME_S | TIME_US if number < 0.0 => "expected a time from the frame's start, 0 or more",
            _ => "",
        };
        if !expected.is_empty() {
            return Err((span, format!("`{name}` is {number}"), expected.into()));
        }
        values[column] = number;
        read += 1;
    }
    let span = line.0..line.0 + line.1.len();
    if read < columns.len() {
        let missing = COLUMNS[columns[read]];
        return Err((span, format!("the line has {read} values"), format!("`{missing}` is missing")));
    }
    let direction = if columns.contains(&AZIMUTH) {
        let zenith = columns.contains(&ZENITH).then_some(values[ZENITH]);
        let elevation = zenith.map_or(values[ELEVATION], |zenith| 90.0 - zenith);
        direction(Angle::deg(values[AZIMUTH]), Angle::deg(elevation))
    } else {
        DVec3::new(values[X], values[Y], values[Z])
    };
    if direction.try_normalize().is_none() {
        return Err((span, "`x`, `y` and `z` are no direction".into(), "expected a length".into()));
    }
    let origin = DVec3::new(values[ORIGIN_X], values[ORIGIN_Y], values[ORIGIN_Z]);
    Ok(Pulse::new(origin, direction, values[TIME_S] + values[TIME_US] * 1e-6))
}
