//! The figures of a sensor's data sheet, which lie under the sensor's own tables if a job turns them on.

use super::super::job::Nominal;
use super::super::keys::measurement::{IS_NOMINAL, NOMINAL, NOMINAL_KEYS, PARTS, SOURCE};
use super::super::keys::sensor::SENSOR_FILE;
use super::super::overlay;
use super::super::table::{AnyKey, Reading, Table};
use super::sensor::{max_at, measurement, range};
use crate::source::Span;
use crate::source::tree::{Entries, Node, Value};

/// Takes `[nominal]` out of the table of a preset, and lays its tables under the preset's own if the job's sensor asks for that.
pub(super) fn settle_nominal(reading: Reading<'_>, preset: &mut Entries, sensor: &Entries) {
    let given = preset.remove(NOMINAL.name()).map(|entry| entry.node);
    let Some(asked) = sensor.get(IS_NOMINAL.name()).map(|entry| &entry.node) else { return };
    match (&asked.value, given) {
        (Value::Boolean(true), Some(nominal)) => lay_under(reading, preset, &nominal),
        (Value::Boolean(true), None) => report_absence(reading, asked.span),
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
    // It reports keys that are unknown.
    Table::new(reading, &NOMINAL_KEYS, figures, nominal.span);
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
pub(super) fn nominal(reading: Reading<'_>, entries: &Entries, file: Span) -> Option<Nominal> {
    let t = Table::new(reading, &SENSOR_FILE, entries, file);
    let given = t.read(&NOMINAL)?;
    let source = given.value.read(&SOURCE);
    if !PARTS.into_iter().any(|part| given.value.has(part)) {
        let help = "such as `[nominal.receiver]` with `range_pairs`".to_owned();
        reading.report.error(given.span, "`[nominal]` has no figures", "needs a table", Some(help));
    }
    // Own tables may hide what is wrong with the figures.
    measurement(&given.value, range(&t), max_at(&t));
    let mut laid = entries.clone();
    let figures = laid.remove(NOMINAL.name())?.node;
    lay_under(reading, &mut laid, &figures);
    let t = Table::new(reading, &SENSOR_FILE, &laid, file);
    let measurement = measurement(&t, range(&t), max_at(&t));
    Some(Nominal { source: source?.value.to_owned(), measurement })
}
