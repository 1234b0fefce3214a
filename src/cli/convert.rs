//! `beamcast convert`: recorded frames in another format.

use std::path::{Path, PathBuf};

use serde_json::json;

use super::frames::FrameArgs;
use super::interrupt::Interrupt;
use super::json;
use super::terminal::Terminal;
use crate::error::Error;
use crate::output::recorded::Recorded;
use crate::output::{WrittenFile, check_file, write_file};
use crate::run::convert::{Converted, Order, Target, convert_bag, convert_file, convert_folder, one_of_bag};
use crate::run::{Bytes, memory};
use crate::source::is_config;
use crate::source::words::{counted, list, quoted};

/// The arguments of `beamcast convert`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A cloud (PLY, PCD, NPY, LAS, LAZ, E57), a range image (EXR, NPZ), a recording (MCAP), or the folder that a scan wrote
    #[arg(value_name = "IN")]
    path: PathBuf,
    /// The file, whose ending says what it is; of a folder another folder, with a file for each frame; of a recording either, with a file for
    /// each message
    #[arg(value_name = "OUT")]
    target: PathBuf,
    /// Write this format: ply, pcd, npy, las or laz of clouds, exr or npz of images, and of the images of a run also those of clouds, e57, png
    /// (a preview) or depth16 [default: the ending of OUT]
    #[arg(long, value_name = "NAME")]
    format: Option<String>,
    /// Make the coordinates of a LAS or LAZ steps of so many metres
    #[arg(long, value_name = "METRES", default_value_t = 1e-4, value_parser = parse_scale)]
    scale: f64,
    /// Replace files that are there already, and in a folder remove those of an earlier run or conversion
    #[arg(long)]
    overwrite: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    frames: FrameArgs,
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
    let wanted = args.frames.wanted();
    let order =
        |target| Order { target, step_m: args.scale, out: &args.target, overwrite: args.overwrite, memory };
    let mut goes_on = || interrupt.check();
    let recorded = match Recorded::open(&args.path, memory)? {
        Recorded::Folder(folder) => {
            let name = args.format.as_deref().ok_or_else(|| {
                Error::Usage(format!(
                    "a folder needs --format NAME, one of {}",
                    list(Target::endings(), "or")
                ))
            })?;
            let converted = convert_folder(&folder, &order(target_of(name)?), &mut goes_on)?;
            return tell(args, &converted, terminal);
        }
        Recorded::Bag(mut bag) => match args.format.as_deref() {
            // An ending says that OUT is a file.
            Some(name) if args.target.extension().is_none() => {
                let bag = (&mut *bag, args.path.as_path());
                let converted = convert_bag(bag, &wanted, &order(target_of(name)?), &mut goes_on)?;
                return tell(args, &converted, terminal);
            }
            _ => one_of_bag((&mut bag, &args.path), &wanted)?,
        },
        recorded => recorded,
    };
    let target = match &args.format {
        Some(name) => target_of(name)?,
        None => target_of_ending(&args.target)?,
    };
    check_file(&args.target, args.overwrite)?;
    interrupt.check()?;
    let (file, notes) = convert_file(&args.path, recorded, &order(target))?;
    interrupt.check()?;
    interrupt.uncut(|| write_file(&args.target, &file))?;
    let written = WrittenFile::of(&args.target.to_string_lossy(), &file);
    tell(args, &Converted { files: vec![written], notes }, terminal)
}

/// Tells what was written, and what is to be known about it.
fn tell(args: &Args, converted: &Converted, terminal: &Terminal) -> Result<(), Error> {
    let Converted { files, notes } = converted;
    if args.json {
        return terminal
            .json(&json::CONVERT.of(json!({ "out": args.target, "outputs": files, "notes": notes })));
    }
    notes.iter().for_each(|note| terminal.warn(note));
    let bytes = Bytes(converted.bytes());
    let out = args.target.display();
    match files.as_slice() {
        [file] if Path::new(&file.path) == args.target => terminal.say(format_args!("wrote {out} ({bytes})")),
        _ => terminal.say(format_args!("wrote {} to {out} ({bytes})", counted(files.len() as u64, "file"))),
    }
    Ok(())
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
