//! Errors of the library as exceptions of the package.

use beamcast::Error;
use beamcast::error::SceneError;
use beamcast::source::{Diagnostic, Severity};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

/// The exception of an error: one of those in `beamcast.errors`.
pub fn exception(py: Python<'_>, error: &Error) -> PyErr {
    made(py, error).unwrap_or_else(|problem| problem)
}

fn made(py: Python<'_>, error: &Error) -> PyResult<PyErr> {
    let about = PyDict::new(py);
    let class = match error {
        Error::Config(problems) => {
            describe(py, &about, problems)?;
            "ConfigError"
        }
        Error::Inputs(problems) => {
            describe(py, &about, problems)?;
            "InputError"
        }
        Error::Scene(SceneError { path, element, help, .. }) => {
            about.set_item("file", path)?;
            about.set_item("key", (!element.is_empty()).then_some(element))?;
            about.set_item("help", help)?;
            "SceneError"
        }
        Error::Input { path, .. } => {
            about.set_item("file", path)?;
            "InputError"
        }
        Error::Output { path, .. } => {
            about.set_item("file", path)?;
            "OutputError"
        }
        _ => "UsageError",
    };
    let class = py.import("beamcast.errors")?.getattr(class)?;
    Ok(PyErr::from_value(class.call((error.to_string(),), Some(&about))?))
}

/// The place of the first error, and all problems.
fn describe(py: Python<'_>, about: &Bound<'_, PyDict>, problems: &[Diagnostic]) -> PyResult<()> {
    let first = problems.iter().find(|problem| problem.severity == Severity::Error).or(problems.first());
    if let Some(first) = first {
        about.set_item("file", &first.path)?;
        about.set_item("key", key_of(first))?;
        about.set_item("help", &first.help)?;
        if let Some((line, column)) = first.place().line_column() {
            about.set_item("line", line)?;
            about.set_item("column", column)?;
        }
    }
    about.set_item("problems", dictionaries(py, problems)?)
}

/// Problems as dictionaries.
pub fn dictionaries<'py>(py: Python<'py>, problems: &[Diagnostic]) -> PyResult<Bound<'py, PyList>> {
    let list = PyList::empty(py);
    for problem in problems {
        let Diagnostic { severity, code, message, path, help, .. } = problem;
        let severity = match severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
            Severity::Note => "note",
        };
        let place = problem.place().line_column();
        let one = PyDict::new(py);
        one.set_item("severity", severity)?;
        one.set_item("code", (!code.is_empty()).then_some(code))?;
        one.set_item("file", path)?;
        one.set_item("line", place.map(|(line, _)| line))?;
        one.set_item("column", place.map(|(_, column)| column))?;
        one.set_item("key", key_of(problem))?;
        one.set_item("message", message)?;
        one.set_item("help", help)?;
        list.append(one)?;
    }
    Ok(list)
}

/// The key that a problem is about: its own, or else the first that its message names, between backticks.
fn key_of(problem: &Diagnostic) -> Option<&str> {
    if !problem.key.is_empty() {
        return Some(&problem.key);
    }
    let is_key =
        |text: &&str| !text.is_empty() && text.chars().all(|c| c.is_alphanumeric() || "_-.[]".contains(c));
    problem.message.split('`').skip(1).step_by(2).find(is_key)
}
