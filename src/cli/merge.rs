//! `beamcast merge`: makes the parts of a run one.

use std::path::PathBuf;

use serde_json::json;

use super::json;
use super::terminal::Terminal;
use crate::error::Error;
use crate::run::{Bytes, merge::merge};
use crate::source::words::counted;

/// The arguments of `beamcast merge`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The folder that all parts were written to
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// Print what was merged as JSON on stdout
    #[arg(long)]
    json: bool,
}

/// Merges the parts of a run.
///
/// # Errors
/// As [`merge`].
pub fn run(args: &Args, terminal: &Terminal) -> Result<(), Error> {
    let whole = merge(&args.folder)?;
    if args.json {
        let document = json!({ "parts": whole.parts, "frames": whole.frames, "files": whole.files, "bytes": whole.bytes });
        return terminal.json(&json::MERGE.of(document));
    }
    terminal.say(format_args!(
        "merged {}: {}, {}, {}",
        counted(whole.parts, "part"),
        counted(whole.frames, "frame"),
        counted(whole.files, "file"),
        Bytes(whole.bytes)
    ));
    Ok(())
}
