//! `beamcast schema`: the JSON Schema of jobs and of sensor files.

use super::terminal::Terminal;
use crate::config::{self, Document};
use crate::error::Error;

/// The arguments of `beamcast schema`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The kind of file
    #[arg(value_enum)]
    of: Of,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Of {
    /// Jobs
    Job,
    /// Sensor files
    Sensor,
}

/// Prints the schema on stdout.
///
/// # Errors
/// If stdout can't be written to.
pub fn run(args: &Args, terminal: &Terminal) -> Result<(), Error> {
    let document = match args.of {
        Of::Job => Document::Job,
        Of::Sensor => Document::Sensor,
    };
    terminal.data(&format!("{:#}\n", config::schema(document)))
}
