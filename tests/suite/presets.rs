//! The shipped sensors against their makers' own tables.
//!
//! Each maker has a module with the numbers of its sources and with the maker's own formula for a point. The numbers are in
//! `tests/presets/`, a file a model, as the source prints them; no code here reads a preset to know what is right. The test
//! prints a row a preset: the source, the largest errors against it, and what no source gives.

mod cameras;
mod hesai;
mod livox;
mod ouster;
mod robosense;
mod scanners;
mod velodyne;

use std::collections::BTreeMap;
use std::path::Path;

use beamcast::config::{self, presets};
use beamcast::sensor::{Capture, Pattern, Sensor};
use glam::DVec3;

/// A preset as its source describes it.
struct Truth {
    preset: &'static str,
    /// One of its modes.
    mode: Option<&'static str>,
    /// Where the numbers are from.
    source: &'static str,
    /// The figures of the preset that nobody published for the model.
    nominal: &'static str,
    allowed: Errors,
    shots: Vec<Shot>,
}

/// The largest differences between a preset and its source.
#[derive(Clone, Copy, Debug, Default)]
struct Errors {
    angle_deg: f64,
    time_ns: f64,
    /// Of a point at a reported range of 2 m, in millimetres: what lies beside the angles, such as the origin of a beam.
    place_mm: f64,
}

/// One pulse, as the source has it.
struct Shot {
    row: usize,
    column: usize,
    /// `None` if the source has no pulse here.
    pulse: Option<TruePulse>,
}

struct TruePulse {
    /// Seconds from the frame's start; `None` if the source has no times.
    time_s: Option<f64>,
    /// The number that the maker's driver gives to the beam, if it numbers beams.
    ring: Option<usize>,
    /// The maker's formula.
    point: Place,
}

/// The point at a reported range in metres, in the sensor's body frame.
type Place = Box<dyn Fn(f64) -> DVec3>;

/// The presets whose makers publish no table, each with the reason.
const WITHOUT_A_TABLE: &[(&str, &str)] = &[("ideal/camera", "no maker")];

fn truths() -> Vec<Truth> {
    let makers = [
        cameras::truths(),
        hesai::truths(),
        livox::truths(),
        ouster::truths(),
        robosense::truths(),
        scanners::truths(),
        velodyne::truths(),
    ];
    makers.into_iter().flatten().collect()
}

#[test]
fn shipped_sensors_equal_their_makers_tables() {
    let truths = truths();
    let mut wrong = Vec::new();
    println!("| preset | pulses | angle, ° | time, ns | point at 2 m, mm | source | nominal |");
    println!("|---|---|---|---|---|---|---|");
    for truth in &truths {
        let sensor = sensor_of(truth.preset, truth.mode);
        let found = compare(&sensor, truth);
        println!(
            "| {}{} | {} | {:.2e} | {:.3} | {:.2e} | {} | {} |",
            truth.preset,
            truth.mode.map_or(String::new(), |mode| format!(", {mode}")),
            truth.shots.len(),
            found.angle_deg,
            found.time_ns,
            found.place_mm,
            truth.source,
            truth.nominal
        );
        let Errors { angle_deg, time_ns, place_mm } = truth.allowed;
        // A NaN is no small error.
        let is_right = found.angle_deg <= angle_deg && found.time_ns <= time_ns && found.place_mm <= place_mm;
        if !is_right {
            wrong.push(format!("{}: {found:?}, allowed {:?}", truth.preset, truth.allowed));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    for (name, _) in presets::BUILT_IN {
        let has_a_row = truths.iter().any(|truth| truth.preset == *name);
        let has_a_reason = WITHOUT_A_TABLE.iter().any(|(without, _)| without == name);
        assert!(has_a_row || has_a_reason, "{name} has no table to be held to");
    }
}

/// A preset in one of its modes.
fn sensor_of(preset: &str, mode: Option<&str>) -> Sensor {
    let Some(mode) = mode else {
        return config::load_preset(preset).unwrap_or_else(|e| panic!("{preset}: {e}")).sensor;
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("job.toml");
    let sensor = format!("preset = '{preset}'\nmode = '{mode}'\n");
    std::fs::write(&path, format!("scene = 'a.glb'\noutput.dir = 'o'\n[[sensor]]\n{sensor}")).unwrap();
    let job = config::load_job(&path, &[]).unwrap_or_else(|e| panic!("{preset}: {e}"));
    job.sensors[0].sensor.clone()
}

/// Compares every shot of a source with the preset's own pulse.
fn compare(sensor: &Sensor, truth: &Truth) -> Errors {
    assert!(!truth.shots.is_empty(), "{} is compared with nothing", truth.preset);
    let capture = Capture::at_origin(sensor);
    let mut worst = Errors::default();
    for Shot { row, column, pulse } in &truth.shots {
        let place = format!("{}, row {row}, column {column}", truth.preset);
        let found = capture.pulse(*row, *column);
        let Some(expected) = pulse else {
            assert!(found.is_none(), "{place}: a pulse where the source has none");
            continue;
        };
        let found = found.unwrap_or_else(|| panic!("{place}: no pulse"));
        if let Some(ring) = expected.ring {
            assert_eq!(sensor.ring(*row), ring, "{place}: ring");
        }
        // The line from 20 m to 100 m says where the beam goes, whatever its origin.
        let line = |point: &dyn Fn(f64) -> DVec3| point(100.0) - point(20.0);
        let (right, here) = (line(&*expected.point), line(&|range| found.point(range)));
        let angle = libm::atan2(right.cross(here).length(), right.dot(here));
        let worse = |so_far: &mut f64, error: f64| {
            *so_far = if error.is_nan() { f64::NAN } else { so_far.max(error) }
        };
        worse(&mut worst.angle_deg, angle.to_degrees());
        worse(&mut worst.place_mm, ((expected.point)(2.0) - found.point(2.0)).length() * 1e3);
        if let Some(time_s) = expected.time_s {
            worse(&mut worst.time_ns, (time_s - found.time_s).abs() * 1e9);
        }
    }
    worst
}

/// A table of `tests/presets/`: its columns by name. Lines that begin with `#` are its sources, and `-` is a NaN.
fn table(name: &str) -> BTreeMap<String, Vec<f64>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/presets").join(name).with_extension("csv");
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let names: Vec<&str> = lines.next().unwrap_or_else(|| panic!("{name} is empty")).split(',').collect();
    let mut columns: BTreeMap<String, Vec<f64>> =
        names.iter().map(|column| ((*column).to_owned(), Vec::new())).collect();
    for line in lines {
        let number = |cell: &str| match cell {
            "-" => f64::NAN,
            number => number.parse().unwrap_or_else(|e| panic!("{name}: {line}: {e}")),
        };
        let cells: Vec<f64> = line.split(',').map(number).collect();
        assert_eq!(cells.len(), names.len(), "{name}: {line}");
        for (column, cell) in names.iter().zip(cells) {
            columns.get_mut(*column).unwrap().push(cell);
        }
    }
    columns
}

/// Some columns of a table of `tests/presets/`, a line at a time.
fn lines_of<const N: usize>(name: &str, columns: [&str; N]) -> impl Iterator<Item = [f64; N]> {
    let table = table(name);
    let columns = columns.map(|column| table[column].clone());
    (0..columns[0].len()).map(move |line| std::array::from_fn(|column| columns[column][line]))
}

/// The numbers of one beam, by the names of a table's columns.
type Row<'a> = &'a dyn Fn(&str) -> f64;

/// The table of a turning head, with a line a beam in the order of the preset's own list.
///
/// Its firing times are in the column `fires_us`, or in `fires_us_0`, `fires_us_1`, … if columns take turns; a beam without
/// a time does not fire.
struct Beams<'a> {
    preset: &'static str,
    /// One of the preset's modes, whose table has the mode's name in its own.
    mode: Option<&'static str>,
    /// The name of the column with the elevations in degrees.
    elevations: &'static str,
    /// The number that the driver gives to a beam, of the number of beams below it and of its place in the table.
    ring_of: &'a dyn Fn(usize, usize) -> usize,
}

impl Beams<'_> {
    /// Some columns of a turn as the table has them. `formula` gives the place of a beam's point from the beam's numbers and
    /// from the head's azimuth when the beam fires, in degrees, clockwise from forward.
    fn truth(
        &self,
        source: &'static str,
        nominal: &'static str,
        allowed: Errors,
        formula: &dyn Fn(Row, f64) -> Place,
    ) -> Truth {
        let (preset, mode) = (self.preset, self.mode);
        let sensor = sensor_of(preset, mode);
        let name = mode.map_or(preset.to_owned(), |mode| format!("{preset}-{}", mode.replace('_', "-")));
        let (head, rows, table) = (Head::of(&sensor), rows_of_channels(&sensor), table(&name));
        let elevations = &table[self.elevations];
        assert_eq!(rows.len(), elevations.len(), "{preset}");
        let phases: Vec<&Vec<f64>> =
            table.iter().filter(|(name, _)| name.starts_with("fires_us")).map(|(_, times)| times).collect();
        let mut shots = Vec::new();
        for beam in 0..rows.len() {
            let below = elevations.iter().filter(|e| **e < elevations[beam]).count();
            let ring = Some((self.ring_of)(below, beam));
            for column in head.some_columns() {
                let fires_us = phases[column % phases.len()][beam];
                let pulse = (!fires_us.is_nan()).then(|| {
                    let time_s = head.time_s(column) + fires_us * 1e-6;
                    let point = formula(&|name| table[name][beam], head.clockwise_deg(time_s));
                    TruePulse { time_s: Some(time_s), ring, point }
                });
                shots.push(Shot { row: rows[beam], column, pulse });
            }
        }
        Truth { preset, mode, source, nominal, allowed, shots }
    }
}

/// The rows of a rotating sensor's image by the number of the channel in its file.
fn rows_of_channels(sensor: &Sensor) -> Vec<usize> {
    let Pattern::Rotating(rotating) = &sensor.pattern else { panic!("not a rotating sensor") };
    let mut rows = vec![0; rotating.beams().len()];
    for (row, beam) in rotating.beams().iter().enumerate() {
        rows[beam.file_index] = row;
    }
    rows
}

/// A turning head: its number of columns and its rate, as the preset has them, because no source fixes them: a unit fires
/// at its own pace, and no whole number of columns fits a turn.
#[derive(Clone, Copy)]
struct Head {
    columns: usize,
    rate_hz: f64,
}

impl Head {
    fn of(sensor: &Sensor) -> Self {
        let Pattern::Rotating(rotating) = &sensor.pattern else { panic!("not a rotating sensor") };
        Self { columns: rotating.columns(), rate_hz: rotating.rate_hz() }
    }

    /// Some columns of a turn: the first ones, which show every phase of a cycle, one in the middle, and the last.
    fn some_columns(&self) -> Vec<usize> {
        vec![0, 1, 2, 3, self.columns / 3, self.columns - 1]
    }

    /// The time of a column in seconds, without that of a beam.
    fn time_s(&self, column: usize) -> f64 {
        column as f64 / self.columns as f64 / self.rate_hz
    }

    /// The azimuth of the head in degrees, clockwise from forward seen from above, so long after the frame's start: it
    /// starts behind the sensor.
    fn clockwise_deg(&self, time_s: f64) -> f64 {
        180.0 + 360.0 * self.rate_hz * time_s
    }
}

/// The sine and cosine of degrees.
fn sin_cos_deg(degrees: f64) -> (f64, f64) {
    libm::sincos(degrees.to_radians())
}
