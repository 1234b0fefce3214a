//! `beamcast verify`: whether the folder of a run is as the run has left it.

use std::fmt::Write as _;
use std::path::PathBuf;

use serde_json::json;

use super::interrupt::Interrupt;
use super::json;
use super::terminal::Terminal;
use crate::error::Error;
use crate::run::{Bytes, verify::verify};
use crate::source::words::{counted, on_one_line};

/// The arguments of `beamcast verify`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The folder that a scan wrote
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Print what was found as JSON on stdout
    #[arg(long)]
    json: bool,
}

/// Verifies a folder.
///
/// # Errors
/// [`Error::Difference`] if a file is missing, changed or unknown, or if the run has not come to its end; the errors of
/// [`verify`].
pub fn run(args: &Args, terminal: &Terminal) -> Result<(), Error> {
    let interrupt = Interrupt::watch()?;
    let found = verify(&args.folder, &mut || interrupt.check())?;
    if args.json {
        let is_whole = found.differences.is_empty();
        let document = json!({
            "whole": is_whole, "files": found.files, "bytes": found.bytes, "differences": found.differences,
        });
        terminal.json(&json::VERIFY.of(document))?;
    } else {
        let mut text = String::new();
        for difference in &found.differences {
            let _ = writeln!(text, "{}: {}", on_one_line(&difference.path), on_one_line(&difference.problem));
        }
        let _ =
            writeln!(text, "{} as they were written, {}", counted(found.files, "file"), Bytes(found.bytes));
        terminal.print(&text)?;
    }
    match found.differences.len() as u64 {
        0 => Ok(()),
        count => {
            let folder = args.folder.display();
            Err(Error::Difference(format!(
                "{folder} is not as a run leaves it: {}",
                counted(count, "difference")
            )))
        }
    }
}
