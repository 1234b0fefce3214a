//! Files of poses: CSV, TUM and KITTI → times and poses.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::DVec3;

use super::super::job::InputFile;
use super::super::keys::motion::{FILE, MAX_POSES, TIMES};
use super::super::plausibility;
use super::pose::rigid;
use crate::frame::Pose;
use crate::source::csv::{Row, rows, words};
use crate::source::suggest::nearest;
use crate::source::tree::{Entries, Value};
use crate::source::words::{list, number, quoted};
use crate::source::{Layer, Report, Span, Spanned, Unreadable, portable};

/// The largest file that is read, in bytes.
const MAX_BYTES: u64 = 256 << 20;

/// Most errors of a file that are reported: most of them are the same mistake.
const MAX_ERRORS: usize = 10;

/// How far the length of a quaternion in a file may be from 1: three digits are as few as files have.
const UNIT_TO: f64 = 1e-2;

/// The files that the trajectories of a configuration name.
#[derive(Debug, Default)]
pub(super) struct PoseFiles {
    /// The numbers of the texts, by path. `None`: the file can't be used, which was reported.
    texts: BTreeMap<PathBuf, Option<u32>>,
    /// The files in the order in which they were read.
    pub inputs: Vec<InputFile>,
}

impl PoseFiles {
    /// Reads the files that a trajectory names, unless they were read before. Their paths are relative to the file that
    /// names them.
    pub fn read(&mut self, report: &mut Report, trajectory: &Entries) {
        for name in [FILE.name(), TIMES.name()] {
            let Some(file) = trajectory.get(name).map(|entry| &entry.node) else { continue };
            let Value::String(as_written) = &file.value else { continue }; // reported when it is read
            let path = report.folder(file.span).join(as_written);
            if !as_written.is_empty() && !self.texts.contains_key(&path) {
                let text = self.open(report, as_written, &path, file.span);
                self.texts.insert(path, text);
            }
        }
    }

    fn open(&mut self, report: &mut Report, as_written: &str, path: &Path, span: Span) -> Option<u32> {
        match report.open_up_to(path, Layer::Preset, MAX_BYTES) {
            Ok(source) => {
                self.inputs.push(InputFile::new(portable(as_written), report.text(source).as_bytes()));
                Some(source)
            }
            Err(Unreadable::Reported) => None,
            Err(problem) => {
                let help = problem.help(as_written, path);
                let message = format!("the file of poses {} can't be used", quoted(as_written));
                report.fail(span, message, problem.to_string(), help)
            }
        }
    }

    /// The number of the text of a file that was read. `None` if there is something wrong with it.
    pub fn text(&self, report: &Report, file: Spanned<&str>) -> Option<u32> {
        *self.texts.get(&report.folder(file.span).join(file.value))?
    }
}

/// The poses of a file.
#[derive(Debug, Default)]
pub(super) struct Poses {
    /// Their times, which rise. Empty of a KITTI file.
    pub times_s: Vec<f64>,
    pub poses: Vec<Pose>,
    /// Where each stands.
    pub spans: Vec<Span>,
    /// Whether the file is one of KITTI's.
    pub is_kitti: bool,
}

/// The columns of a CSV, in the order of TUM's.
const COLUMNS: [&str; 8] = ["t_s", "x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"];

/// How the lines of a file are laid out.
#[derive(Clone, Copy, PartialEq)]
enum Layout {
    Csv,
    Tum,
    Kitti,
}

impl Layout {
    /// The layout of a file: by the ending of its name or, of another ending, by its first line.
    fn of(report: &Report, file: Spanned<&str>, source: u32) -> Option<Self> {
        let ending = Path::new(file.value).extension().map(|ending| ending.to_string_lossy().to_lowercase());
        match ending.as_deref() {
            Some("csv") => return Some(Self::Csv),
            Some("tum") => return Some(Self::Tum),
            Some("kitti") => return Some(Self::Kitti),
            _ => {}
        }
        let text = report.text(source);
        match (fields_in_first(rows(text, source)), fields_in_first(words(text, source))) {
            (8, _) => Some(Self::Csv),
            (_, 8) => Some(Self::Tum),
            (_, 12) => Some(Self::Kitti),
            _ => {
                let message = format!("{} is no file of poses that is known", quoted(file.value));
                let help = "CSV has the columns t_s, x_m, y_m, z_m, qx, qy, qz, qw in a header, TUM 8 numbers a line, and KITTI 12";
                report.fail(file.span, message, "expected `.csv`, `.tum` or `.kitti`", Some(help.to_owned()))
            }
        }
    }
}

fn fields_in_first<'a>(mut rows: impl Iterator<Item = Row<'a>>) -> usize {
    rows.find(|row| !row.is_comment()).map_or(0, |row| row.cells.len())
}

/// Reads the poses of a file, whose text has this number. Lines that begin with `#` are left out. `None` if there is something
/// wrong, which is reported.
pub(super) fn poses(report: &Report, file: Spanned<&str>, source: u32) -> Option<Poses> {
    let text = report.text(source);
    let layout = Layout::of(report, file, source)?;
    let mut lines: Box<dyn Iterator<Item = Row<'_>> + '_> = match layout {
        Layout::Csv => Box::new(rows(text, source)),
        Layout::Tum | Layout::Kitti => Box::new(words(text, source)),
    };
    let is_content = |row: &Row<'_>| !row.is_comment() && !row.is_empty();
    let columns = if layout == Layout::Csv {
        let Some(header) = lines.by_ref().find(is_content) else {
            let label = format!("expected a header: {}", COLUMNS.join(","));
            return report.fail(Span::new(source, 0..0), "the file of poses is empty", label, None);
        };
        columns(report, &header)?
    } else {
        Vec::from_iter(0..COLUMNS.len())
    };
    let mut found = Poses { is_kitti: layout == Layout::Kitti, ..Poses::default() };
    let mut errors = 0;
    let (mut order_doubts, mut first_doubt) = (0, None);
    for row in lines.filter(is_content) {
        if found.poses.len() == MAX_POSES {
            let message = format!("the file has more than {MAX_POSES} poses");
            return report.fail(row.span, message, "too many from here on", None);
        }
        let read = match layout {
            Layout::Kitti => kitti_pose(report, &row).map(|pose| (None, pose)),
            Layout::Csv | Layout::Tum => timed_pose(report, &row, &columns, found.times_s.last().copied())
                .map(|(time, xyzw, pose)| {
                    if let Some(doubt) = plausibility::quaternion("qx, qy, qz, qw", xyzw) {
                        order_doubts += 1;
                        first_doubt.get_or_insert((row.span, doubt));
                    }
                    (Some(time), pose)
                }),
        };
        let Some((time, pose)) = read else {
            errors += 1;
            if errors == MAX_ERRORS {
                break;
            }
            continue;
        };
        found.times_s.extend(time);
        found.poses.push(pose);
        found.spans.push(row.span);
    }
    if errors == 0 && found.poses.is_empty() {
        return report.fail(Span::new(source, 0..0), "the file has no poses", "expected a pose a line", None);
    }
    if errors > 0 {
        return None;
    }
    // A body may turn over once in a while, but not most of the time.
    if let Some((span, doubt)) = first_doubt.filter(|_| 2 * order_doubts > found.poses.len()) {
        let help = match layout {
            Layout::Csv => "if it is, name the columns `qw,qx,qy,qz` in the header",
            _ => "if it is, write it last in each line: TUM's order is qx qy qz qw",
        };
        report.doubt(span, doubt.help(help));
    }
    Some(found)
}

/// The times of a KITTI file, one a line.
pub(super) fn times(report: &Report, source: u32, poses: &Poses) -> Option<Vec<f64>> {
    let mut times = Vec::with_capacity(poses.poses.len());
    for row in words(report.text(source), source).filter(|row| !row.is_comment()) {
        if times.len() == poses.poses.len() {
            let message = format!("there are more times than poses, of which there are {}", times.len());
            return report.fail(row.span, message, "one too many", None);
        }
        if let Some(extra) = row.cells.get(1) {
            return report.fail(
                extra.span,
                "the line has more than one value",
                "expected one time a line",
                None,
            );
        }
        let time = row.cells[0].number(report, "time")?;
        rises(report, &row, "time", time, times.last().copied())?;
        times.push(time);
    }
    if times.len() < poses.poses.len() {
        let message = format!("there are {} times for {} poses", times.len(), poses.poses.len());
        return report.fail(Span::new(source, 0..0), message, "expected one time a pose", None);
    }
    Some(times)
}

fn rises(report: &Report, row: &Row<'_>, name: &str, time: f64, before: Option<f64>) -> Option<()> {
    match before {
        Some(before) if time <= before => {
            let message = format!("`{name}` is {time}, and the pose before has {before}");
            report.fail(row.span, message, "expected a later time", None)
        }
        _ => Some(()),
    }
}

/// What each column of a CSV is, as an index into [`COLUMNS`].
fn columns(report: &Report, header: &Row<'_>) -> Option<Vec<usize>> {
    let mut columns = Vec::new();
    let mut is_fine = true;
    for cell in &header.cells {
        match COLUMNS.iter().position(|column| *column == cell.text) {
            None => {
                let help = match nearest(cell.text, COLUMNS) {
                    Some(near) => format!("did you mean {}?", quoted(near)),
                    None => format!("the columns of a file of poses are {}", list(COLUMNS, "and")),
                };
                report.error(cell.span, format!("unknown column {}", quoted(cell.text)), "", Some(help));
                is_fine = false;
            }
            Some(index) if columns.contains(&index) => {
                report.error(cell.span, format!("the column {} is there twice", quoted(cell.text)), "", None);
                is_fine = false;
            }
            Some(index) => columns.push(index),
        }
    }
    let missing: Vec<&str> =
        (0..COLUMNS.len()).filter(|index| !columns.contains(index)).map(|index| COLUMNS[index]).collect();
    if is_fine && !missing.is_empty() {
        let message = format!("the header lacks {}", list(missing, "and"));
        report.error(header.span, message, format!("expected {}", COLUMNS.join(",")), None);
        is_fine = false;
    }
    is_fine.then_some(columns)
}

/// Checks that a line has as many values as there are names.
fn is_whole(report: &Report, row: &Row<'_>, count: usize, missing: &str) -> Option<()> {
    if let Some(extra) = row.cells.get(count) {
        return report.fail(
            extra.span,
            format!("the line has more than {count} values"),
            "one too many",
            None,
        );
    }
    if row.cells.len() < count {
        return report.fail(
            row.span,
            format!("the line has {} values", row.cells.len()),
            missing.to_owned(),
            None,
        );
    }
    Some(())
}

/// The time, the quaternion and the pose of a line.
fn timed_pose(
    report: &Report,
    row: &Row<'_>,
    columns: &[usize],
    before: Option<f64>,
) -> Option<(f64, [f64; 4], Pose)> {
    let lacks = columns
        .get(row.cells.len())
        .map_or(String::new(), |column| format!("`{}` is missing", COLUMNS[*column]));
    is_whole(report, row, COLUMNS.len(), &lacks)?;
    let mut values = [0.0; COLUMNS.len()];
    for (cell, column) in row.cells.iter().zip(columns) {
        values[*column] = cell.number(report, COLUMNS[*column])?;
    }
    let [time, x, y, z, qx, qy, qz, qw] = values;
    rises(report, row, COLUMNS[0], time, before)?;
    let xyzw = [qx, qy, qz, qw];
    let length = xyzw.iter().map(|x| x * x).sum::<f64>().sqrt();
    let made = Pose::from_quaternion(DVec3::new(x, y, z), xyzw).filter(|_| (length - 1.0).abs() <= UNIT_TO);
    let Some(pose) = made else {
        let message = format!("a quaternion of length {}", number(length));
        let help = "the columns qx, qy, qz and qw are a unit quaternion, w last".to_owned();
        return report.fail(row.span, message, "expected length 1", Some(help));
    };
    Some((time, xyzw, pose))
}

/// The pose of a line of 12 numbers: the upper three rows of a matrix.
fn kitti_pose(report: &Report, row: &Row<'_>) -> Option<Pose> {
    is_whole(report, row, 12, "expected 12: three rows of a matrix")?;
    let mut values = [0.0; 12];
    for (value, cell) in values.iter_mut().zip(&row.cells) {
        *value = cell.number(report, "a number of the matrix")?;
    }
    let [a, b, c] = [0, 4, 8].map(|at| [values[at], values[at + 1], values[at + 2], values[at + 3]]);
    rigid([a, b, c, [0.0, 0.0, 0.0, 1.0]]).map_err(|wrong| wrong.report(report, row.span)).ok()
}
