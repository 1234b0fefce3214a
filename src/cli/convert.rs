//! `beamcast convert`: recorded frames in another format.

use std::path::{Path, PathBuf};

use super::interrupt::Interrupt;
use super::terminal::Terminal;
use crate::error::Error;
use crate::output::recorded::Recorded;
use crate::output::{check_file, write_file};
use crate::run::convert::{Target, convert_folder};
use crate::run::{Bytes, memory};
use crate::source::is_config;
use crate::source::words::{counted, list, quoted};

/// The arguments of `beamcast convert`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A cloud (PLY, PCD, NPY, LAS, LAZ), a range image (EXR, NPZ), or the folder that a scan wrote
    #[arg(value_name = "IN")]
    path: PathBuf,
    /// The file, whose ending says what it is, or of a folder another folder, with a file for each frame
    #[arg(value_name = "OUT")]
    target: PathBuf,
    /// Write this format: ply, pcd, npy, las or laz of clouds, exr or npz of images [default: the ending of OUT]
    #[arg(long, value_name = "NAME")]
    format: Option<String>,
    /// Make the coordinates of a LAS or LAZ steps of so many metres
    #[arg(long, value_name = "METRES", default_value_t = 1e-4, value_parser = parse_scale)]
    scale: f64,
    /// Replace files that are there already
    #[arg(long)]
    overwrite: bool,
}

fn parse_scale(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(scale) if (1e-9..=1e3).contains(&scale) => Ok(scale),
        _ => Err("expected a number of metres from 1e-9 to 1000".to_owned()),
    }
}

/// Converts a file, or the frames of a folder.
///
/// # Errors
/// [`Error::Usage`] if there is no such format; [`Error::Input`] if the file can't be read, or has what the format can't hold;
/// [`Error::Output`] if a file can't be written, or is there already and may not be replaced.
pub fn run(args: &Args, terminal: &Terminal) -> Result<(), Error> {
    let interrupt = Interrupt::watch()?;
    let memory = memory::for_recordings();
    if is_config(&args.path) {
        let problem =
            "is a job or a sensor file: `beamcast scan` runs a job, and what it writes can be converted";
        return Err(Error::input(&args.path, problem));
    }
    let recorded = Recorded::open(&args.path, memory)?;
    if let Recorded::Folder(folder) = recorded {
        let name = args.format.as_deref().ok_or_else(|| {
            Error::Usage(format!("a folder needs --format NAME, one of {}", list(Target::endings(), "or")))
        })?;
        let target = (args.target.as_path(), args.overwrite);
        let mut goes_on = || interrupt.check();
        let converted =
            convert_folder(&folder, target, (target_of(name)?, args.scale), memory, &mut goes_on)?;
        warn(&converted.notes, terminal);
        let files = counted(converted.files, "file");
        terminal.say(format_args!("wrote {files} to {} ({})", args.target.display(), Bytes(converted.bytes)));
        return Ok(());
    }
    let target = match &args.format {
        Some(name) => target_of(name)?,
        None => target_of_ending(&args.target)?,
    };
    check_file(&args.target, args.overwrite)?;
    interrupt.check()?;
    let (file, notes) = target.encode(recorded, args.scale).map_err(|e| Error::input(&args.path, e))?;
    interrupt.check()?;
    interrupt.uncut(|| write_file(&args.target, &file))?;
    warn(&notes, terminal);
    terminal.say(format_args!("wrote {} ({})", args.target.display(), Bytes(file.len() as u64)));
    Ok(())
}

/// Shows what is to be known about the files.
fn warn(notes: &[String], terminal: &Terminal) {
    notes.iter().for_each(|note| terminal.warn(note));
}

fn target_of(name: &str) -> Result<Target, Error> {
    Target::of_ending(name).ok_or_else(|| {
        let known = list(Target::endings(), "or");
        Error::Usage(format!("nothing is converted to {}: the formats are {known}", quoted(name)))
    })
}

fn target_of_ending(path: &Path) -> Result<Target, Error> {
    match path.extension() {
        Some(ending) => target_of(&ending.to_string_lossy()),
        None => {
            let known = list(Target::endings(), "or");
            Err(Error::Usage(format!(
                "{} has no ending that says its format, {known}: --format says it",
                path.display()
            )))
        }
    }
}
