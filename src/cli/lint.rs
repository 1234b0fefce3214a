//! `beamcast lint`: reads jobs, sensor files and scenes without running them, and says what is wrong with them and what
//! follows from them.

use std::path::PathBuf;

use super::facts;
use super::terminal::Terminal;
use crate::error::Error;
use crate::run::facts::examine;
use crate::source::Severity;

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
    if args.json {
        terminal.json(&serde_json::json!({ "files": files, "diagnostics": diagnostics }))?;
    } else {
        terminal.print(&files.iter().map(facts::text).collect::<Vec<_>>().join("\n"))?;
    }
    if diagnostics.iter().any(|d| d.severity == Severity::Error) {
        return Err(Error::Config(diagnostics));
    }
    terminal.warn_of(&diagnostics);
    Ok(())
}
