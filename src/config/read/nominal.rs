//! The figures of a sensor's data sheet, which lie under the sensor's own tables if a job turns them on.

use super::super::job::{DataSheet, Nominal};
use super::super::keys::measurement::{
    IS_NOMINAL, NOMINAL, NOMINAL_KEYS, PARTS, PUBLISHED, SOURCE, published as keys,
};
use super::super::keys::sensor::SENSOR_FILE;
use super::super::kinds::Number;
use super::super::overlay;
use super::super::table::{AnyKey, Key, Reading, Table};
use super::sensor::{max_at, measurement, range};
use super::sensor_files::SensorFiles;
use crate::sensor::{Published, Quantity, StatedAt};
use crate::source::Span;
use crate::source::tree::{Entries, Node, Value};

/// Takes `[nominal]` out of the table of a preset, and lays its tables under the preset's own if the job's sensor asks for that.
/// Returns the data sheet.
pub(super) fn settle_nominal(
    reading: Reading<'_>,
    preset: &mut Entries,
    sensor: &Entries,
) -> Option<DataSheet> {
    let given = preset.remove(NOMINAL.name()).map(|entry| entry.node);
    let stated = given.as_ref().and_then(|nominal| match &nominal.value {
        Value::Table(figures) => data_sheet(&Table::new(reading, &NOMINAL_KEYS, figures, nominal.span)),
        _ => None, // reported where the preset is read as a file of its own
    });
    lay_nominal_under(reading, preset, given, sensor);
    stated
}

/// Lays `[nominal]`, which a preset has or has not, under the preset's own tables if the job's sensor asks for that.
fn lay_nominal_under(reading: Reading<'_>, preset: &mut Entries, given: Option<Node>, sensor: &Entries) {
    let Some(asked) = sensor.get(IS_NOMINAL.name()).map(|entry| &entry.node) else { return };
    // Promises alone say nothing about how the sensor measures.
    let has_figures = |nominal: &Node| match &nominal.value {
        Value::Table(figures) => PARTS.into_iter().any(|part| figures.contains_key(part.name())),
        _ => true, // reported when it is read
    };
    match (&asked.value, given) {
        (Value::Boolean(true), Some(nominal)) if has_figures(&nominal) => {
            lay_under(reading, preset, &nominal);
        }
        (Value::Boolean(true), _) => report_absence(reading, asked.span),
        _ => {} // reported when it is read
    }
}

/// Reports a sensor that is to have its data sheet's figures, and has none.
pub(super) fn report_absence(reading: Reading<'_>, span: Span) {
    let help = "leave it out, and give the sensor tables of its own: `[sensor.receiver]`, `[sensor.noise]`";
    let message = "the sensor has no nominal figures";
    reading.report.error(span, message, "expected a preset with `[nominal]`", Some(help.into()));
}

/// Lays the tables of `[nominal]` under a sensor's own.
fn lay_under(reading: Reading<'_>, entries: &mut Entries, nominal: &Node) {
    let Value::Table(figures) = &nominal.value else { return }; // reported when it is read
    let mut laid = Entries::new();
    let mut own = Entries::new();
    for part in PARTS.map(AnyKey::name) {
        if let Some(entry) = figures.get(part) {
            laid.insert(part.to_owned(), entry.clone());
        }
        if let Some((name, entry)) = entries.remove_entry(part) {
            own.insert(name, entry);
        }
    }
    overlay::lay_over(reading, &mut laid, own);
    entries.extend(laid);
}

/// How the sensor of a file measures if its `[nominal]` is turned on. `None` if there is none, or if it is wrong, which is then
/// reported.
pub(super) fn nominal(
    reading: Reading<'_>,
    entries: &Entries,
    files: &SensorFiles,
    file: Span,
) -> Option<Nominal> {
    let t = Table::new(reading, &SENSOR_FILE, entries, file);
    let given = t.read(&NOMINAL)?;
    let data_sheet = data_sheet(&given.value);
    if !given.value.has(&PUBLISHED) && !PARTS.into_iter().any(|part| given.value.has(part)) {
        let help = "such as `[nominal.receiver]` with `range_pairs`".to_owned();
        reading.report.error(given.span, "`[nominal]` has no figures", "needs a table", Some(help));
    }
    // Own tables may hide what is wrong with the figures.
    measurement(&given.value, files, range(&t), max_at(&t));
    let mut laid = entries.clone();
    let figures = laid.remove(NOMINAL.name())?.node;
    lay_under(reading, &mut laid, &figures);
    let t = Table::new(reading, &SENSOR_FILE, &laid, file);
    let measurement = measurement(&t, files, range(&t), max_at(&t));
    Some(Nominal { data_sheet: data_sheet?, measurement })
}

/// The data sheet that `[nominal]` tells of. `None` if it has no source, which is reported.
fn data_sheet(nominal: &Table<'_>) -> Option<DataSheet> {
    let source = nominal.read(&SOURCE);
    let published = published(nominal);
    Some(DataSheet { source: source?.value.to_owned(), published })
}

/// The bounds that the data sheet of a depth camera states. Those that are wrong are reported and left out.
fn published(nominal: &Table<'_>) -> Vec<Published> {
    nominal.read(&PUBLISHED).iter().flat_map(|tables| &tables.value).flat_map(bounds).collect()
}

fn bounds(t: &Table<'_>) -> Vec<Published> {
    let given = |key: &Key<Number>| t.read(key).map(|number| number.value);
    let at = match (given(&keys::AT), given(&keys::UP_TO)) {
        (Some(_), Some(_)) => {
            let span = t.report().later(t.span_of(&keys::AT), t.span_of(&keys::UP_TO));
            let help = "figures hold at a distance, or up to one".to_owned();
            t.report().error(span, "both `at_m` and `up_to_m` are given", "one too many", Some(help));
            return Vec::new();
        }
        (Some(at_m), None) => StatedAt::At(at_m),
        (None, Some(end_m)) => StatedAt::UpTo(end_m),
        (None, None) => StatedAt::All,
    };
    let of = |quantity, bound, share_of_distance| Published { quantity, at, bound, share_of_distance };
    let plain: [(&Key<Number>, Quantity); 5] = [
        (&keys::Z_ACCURACY, Quantity::ZAccuracy),
        (&keys::FILL_RATE, Quantity::FillRate),
        (&keys::PLANE_RMS, Quantity::PlaneRms),
        (&keys::SUBPIXEL_RMS, Quantity::SubpixelRms),
        (&keys::SIGMA, Quantity::Sigma),
    ];
    let mut all: Vec<Published> =
        plain.into_iter().filter_map(|(key, quantity)| Some(of(quantity, given(key)?, 0.0))).collect();
    let (bias_m, bias_percent) = (given(&keys::BIAS), given(&keys::BIAS_PERCENT));
    if bias_m.is_some() || bias_percent.is_some() {
        all.push(of(Quantity::Bias, bias_m.unwrap_or(0.0), bias_percent.unwrap_or(0.0) / 100.0));
    }
    if keys::BOUNDS.into_iter().all(|key| !t.has(key)) {
        let help = "such as `z_accuracy_percent = 2.0`".to_owned();
        t.report().error(t.span, "`[[nominal.published]]` bounds nothing", "needs a figure", Some(help));
    }
    all
}
