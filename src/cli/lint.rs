//! `beamcast lint`: reads jobs, sensor files and scenes without running them, and says what is wrong with them and what
//! follows from them.

use std::path::PathBuf;

use super::facts;
use super::job::{SceneArgs, heed};
use super::json;
use super::terminal::Terminal;
use crate::error::Error;
use crate::run::facts::examine;

/// The arguments of `beamcast lint`.
#[derive(clap::Args, Clone, Debug)]
pub struct Args {
    /// Jobs, sensor files, scenes (.gltf, .glb), or folders of jobs and sensor files
    #[arg(required = true, value_name = "PATH")]
    paths: Vec<PathBuf>,
    /// Take warnings for errors
    #[arg(long)]
    strict: bool,
    /// Print the facts and the problems as JSON on stdout
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    scenes: SceneArgs,
}

/// Reads every path. Facts go to stdout and warnings to stderr; errors are returned, together with the warnings.
///
/// # Errors
/// [`Error::Config`] with everything that is wrong in any of the paths, or [`Error::Inputs`] if it is all about scenes;
/// [`Error::Output`] if stdout can't be written to.
pub fn run(args: &Args, terminal: &Terminal) -> Result<(), Error> {
    let examined = examine(&args.paths, &args.scenes.allowed_folders);
    if args.json {
        let content = serde_json::json!({ "files": examined.facts, "diagnostics": examined.problems });
        terminal.json(&json::LINT.of(content))?;
    } else {
        terminal.print(&examined.facts.iter().map(facts::text).collect::<Vec<_>>().join("\n"))?;
    }
    let (_, warnings) = examined.into_result()?;
    heed(&warnings, args.strict, terminal)
}
