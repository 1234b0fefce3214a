//! `beamcast film`: the previews of a scan as an animated picture or as a contact sheet.

use std::path::{Path, PathBuf};

use super::terminal::Terminal;
use crate::error::Error;
use crate::output::recorded::{Folder, read_preview};
use crate::output::{EncodeError, Palette, Picture, check_file, film, write_file};
use crate::run::{Bytes, memory};
use crate::source::words::counted;

/// The arguments of `beamcast film`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The folder that a scan wrote, with previews of its frames: `png` is among the formats of the job
    #[arg(value_name = "DIR")]
    path: PathBuf,
    /// The picture [default: the name of DIR with .png, in the current folder]
    #[arg(short, long, visible_alias = "out", value_name = "FILE.png")]
    output: Option<PathBuf>,
    /// Show this sensor; several are below each other [default: all]
    #[arg(long, value_name = "NAME")]
    sensor: Vec<String>,
    /// Show every so many frames, from the first
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    every: u32,
    /// The width of a preview in pixels
    #[arg(long, value_name = "PIXELS", default_value_t = 640, value_parser = clap::value_parser!(u32).range(1..=16384))]
    width: u32,
    /// Show so many frames of the scan a second [default: the sensor's rate, which is real time]
    #[arg(long, value_name = "HZ", value_parser = parse_rate)]
    rate: Option<f64>,
    /// Put the frames side by side in one picture that does not move, so many in a row; of a scan of one frame, its sensors
    #[arg(long, value_name = "COLUMNS", value_parser = clap::value_parser!(u32).range(1..=1000))]
    sheet: Option<u32>,
    /// Replace a picture that is there already
    #[arg(long)]
    overwrite: bool,
}

fn parse_rate(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(rate) if rate > 0.0 && rate.is_finite() => Ok(rate),
        _ => Err("expected a number greater than 0".to_owned()),
    }
}

/// Makes the picture.
///
/// # Errors
/// [`Error::Input`] if the folder has no previews or one can't be read; [`Error::Usage`] if it has no such sensor;
/// [`Error::Output`] if the picture can't be written.
pub fn run(args: &Args, terminal: &Terminal) -> Result<(), Error> {
    let target = args.output.clone().unwrap_or_else(|| default_name(&args.path));
    check_file(&target, args.overwrite)?;
    let folder = Folder::open(&args.path)?;
    let reels = reels(&folder, &args.sensor)?;
    let of_sensors = |number: u32| -> Result<Vec<Picture>, Error> {
        let width = args.width as usize;
        let part = |reel: &Reel| Ok(read(&folder, reel.at(&reels[0], number * args.every))?.scaled_to(width));
        reels.iter().map(part).collect()
    };
    let picture = |number: u32| -> Result<Picture, Error> { Ok(Picture::stacked(&of_sensors(number)?)) };
    let count = (reels[0].frames.len() as u32).div_ceil(args.every);
    let unwritable = |e: Whose| match e {
        Whose::Encoder(e) => Error::output(&target, e),
        Whose::Input(e) => e,
    };
    let file = match args.sheet {
        Some(columns) => {
            let pictures = match count {
                1 => of_sensors(0)?,
                _ => (0..count).map(&picture).collect::<Result<Vec<_>, Error>>()?,
            };
            let sheet = Picture::grid(&pictures, columns as usize);
            drop(pictures);
            let mut palette = Palette::default();
            palette.add(&sheet);
            film(1, 1.0, &palette, |_| Ok(sheet.clone())).map_err(unwritable)?
        }
        None => {
            let mut palette = Palette::default();
            for number in 0..count {
                palette.add(&picture(number)?);
            }
            let rate = args.rate.or(reels[0].rate_hz).unwrap_or(DEFAULT_RATE_HZ) / f64::from(args.every);
            film(count, rate, &palette, |number| picture(number).map_err(Whose::Input)).map_err(unwritable)?
        }
    };
    write_file(&target, &file)?;
    let frames = counted(u64::from(count), "frame");
    terminal.say(format_args!("wrote {} ({frames}, {})", target.display(), Bytes(file.len() as u64)));
    Ok(())
}

/// The frames a second of a scan whose manifest says none.
const DEFAULT_RATE_HZ: f64 = 10.0;

/// An error of what is read or of what is written.
enum Whose {
    Input(Error),
    Encoder(EncodeError),
}

impl From<EncodeError> for Whose {
    fn from(error: EncodeError) -> Self {
        Self::Encoder(error)
    }
}

/// The previews of a sensor in order.
struct Reel<'f> {
    sensor: &'f str,
    frames: Vec<&'f str>,
    rate_hz: Option<f64>,
}

impl<'f> Reel<'f> {
    /// The preview at the time of a frame of another sensor, or the last.
    fn at(&self, leader: &Self, number: u32) -> &'f str {
        let ratio = match (self.rate_hz, leader.rate_hz) {
            (Some(own), Some(other)) => own / other,
            _ => 1.0,
        };
        // A frame that begins at the very time counts, whatever the ratio is rounded to.
        let index = (f64::from(number) * ratio + 1e-6) as usize;
        self.frames[index.min(self.frames.len() - 1)]
    }
}

/// The previews of the sensors that are wanted, in the order in which they are; of all if none is named.
fn reels<'f>(folder: &'f Folder, wanted: &[String]) -> Result<Vec<Reel<'f>>, Error> {
    let mut reels: Vec<Reel> = Vec::new();
    for output in folder.outputs() {
        let preview = output.strip_suffix(".png").and_then(|stem| stem.rsplit_once('/'));
        let Some((sensor, number)) = preview else { continue };
        if !number.bytes().all(|b| b.is_ascii_digit()) {
            continue;
        }
        match reels.iter_mut().find(|reel| reel.sensor == sensor) {
            Some(reel) => reel.frames.push(output),
            None => {
                reels.push(Reel { sensor, frames: vec![output], rate_hz: folder.manifest.rate_hz(sensor) })
            }
        }
    }
    for reel in &mut reels {
        reel.frames.sort_by_key(|name| (name.len(), *name));
    }
    if reels.is_empty() {
        let problem = "has no previews: add \"png\" to `formats` in the job's [output]";
        return Err(Error::input(folder.path(), problem));
    }
    if wanted.is_empty() {
        return Ok(reels);
    }
    let names = reels.iter().map(|reel| reel.sensor).collect::<Vec<_>>().join(", ");
    let mut chosen = Vec::new();
    for name in wanted {
        match reels.iter().position(|reel| reel.sensor == name) {
            Some(index) => chosen.push(reels.swap_remove(index)),
            None => {
                let folder = folder.path().display();
                return Err(Error::Usage(format!(
                    "{folder} has no previews of a sensor {name:?}, only of {names}"
                )));
            }
        }
    }
    Ok(chosen)
}

fn read(folder: &Folder, name: &str) -> Result<Picture, Error> {
    let memory = memory::for_recordings();
    let bytes = folder.read_bytes(name, memory)?;
    read_preview(&bytes, memory).map_err(|e| Error::input(folder.path().join(name), e))
}

/// `street.png` for `out/street/`.
fn default_name(path: &Path) -> PathBuf {
    let absolute = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
    PathBuf::from(absolute.file_name().unwrap_or("film".as_ref())).with_added_extension("png")
}
