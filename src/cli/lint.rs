//! `beamcast lint`: reads jobs, sensor files and scenes without running them, and says what is wrong with them and what
//! follows from them.

use std::path::PathBuf;

use serde::Serialize;

use super::facts;
use super::terminal::Terminal;
use crate::error::Error;
use crate::run::facts::examine;
use crate::source::{Diagnostic, Severity};

/// The arguments of `beamcast lint`.
#[derive(clap::Args, Clone, Debug)]
pub struct Args {
    /// Jobs, sensor files, scenes (.gltf, .glb), or folders of jobs and sensor files
    #[arg(required = true, value_name = "PATH")]
    paths: Vec<PathBuf>,
    /// Print the facts and the problems as JSON on stdout
    #[arg(long)]
    json: bool,
}

/// Reads every path. Facts go to stdout and warnings to stderr; errors are returned, together with the warnings.
///
/// # Errors
/// [`Error::Config`] with everything that is wrong in any of the paths; [`Error::Output`] if stdout can't be written to.
pub fn run(args: &Args, terminal: &Terminal) -> Result<(), Error> {
    let (files, diagnostics) = examine(&args.paths);
    terminal.data(&if args.json {
        let problems: Vec<_> = diagnostics.iter().map(Problem::from).collect();
        let whole = serde_json::json!({ "files": files, "diagnostics": problems });
        format!("{whole:#}\n")
    } else {
        files.iter().map(facts::text).collect::<Vec<_>>().join("\n")
    })?;
    if diagnostics.iter().any(|d| d.severity == Severity::Error) {
        return Err(Error::Config(diagnostics));
    }
    terminal.warn_of(&diagnostics);
    Ok(())
}

/// A problem as JSON tells it.
#[derive(Serialize)]
struct Problem<'a> {
    severity: &'static str,
    path: String,
    line: usize,
    column: usize,
    message: &'a str,
    label: &'a str,
    help: Option<&'a str>,
}

impl<'a> From<&'a Diagnostic> for Problem<'a> {
    fn from(d: &'a Diagnostic) -> Self {
        let (line, column) = d.line_column();
        let severity = match d.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
        };
        let path = d.path.to_string_lossy().into_owned();
        Self { severity, path, line, column, message: &d.message, label: &d.label, help: d.help.as_deref() }
    }
}
