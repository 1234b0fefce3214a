//! `beamcast schema`: the JSON Schema of jobs and of sensor files, and the reference pages of their keys and of formats.

use super::terminal::Terminal;
use crate::config::{self, Document};
use crate::error::Error;
use crate::output::formats_page;

/// The arguments of `beamcast schema`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A kind of file, or a reference page
    #[arg(value_enum)]
    of: Of,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Of {
    /// The JSON Schema of jobs
    Job,
    /// The JSON Schema of sensor files
    Sensor,
    /// All keys of jobs and sensor files, as a page of Markdown
    Keys,
    /// What the files of each format are, as a page of Markdown
    Formats,
}

/// Prints the schema or the page on stdout.
///
/// # Errors
/// If stdout can't be written to.
pub fn run(args: &Args, terminal: &Terminal) -> Result<(), Error> {
    let text = match args.of {
        Of::Job => format!("{:#}\n", config::schema(Document::Job)),
        Of::Sensor => format!("{:#}\n", config::schema(Document::Sensor)),
        Of::Keys => config::reference(),
        Of::Formats => formats_page(),
    };
    terminal.data(&text)
}
