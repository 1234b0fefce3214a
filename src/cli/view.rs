//! `beamcast view`: frames as one HTML page.

use std::path::{Path, PathBuf};

use super::frames::FrameArgs;
use super::interrupt::Interrupt;
use super::job::{SceneArgs, load_scene};
use super::terminal::Terminal;
use crate::config::{self, Config};
use crate::error::Error;
use crate::output::{check_file, write_file};
use crate::run::{Bytes, Holding, Item, Plan, Selection, Session, Steps, checking, memory};
use crate::source::is_config;
use crate::view::playback::{self, Moment, Playback};
use crate::view::{Recording, Shown, View, of_recording, page};

/// The arguments of `beamcast view`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// A range image (EXR, NPZ), a cloud (PLY, PCD, NPY, LAS, LAZ, E57), a recording (MCAP), the folder that a scan wrote, or a job, which is run
    #[arg(value_name = "PATH")]
    path: PathBuf,
    /// The page; `-` for stdout [default: the name of PATH with .html, in the current folder]
    #[arg(short, long, visible_alias = "out", value_name = "PAGE.html")]
    output: Option<PathBuf>,
    /// Replace a page that is there already
    #[arg(long)]
    overwrite: bool,
    #[command(flatten)]
    frames: FrameArgs,
    #[command(flatten)]
    scenes: SceneArgs,
}

/// Makes a page of what there is at a path.
///
/// # Errors
/// The errors of the job, the scene or the files; [`Error::Output`] if the page can't be written.
pub fn run(args: &Args, terminal: &Terminal) -> Result<(), Error> {
    let interrupt = Interrupt::watch()?;
    let to_stdout = args.output.as_deref() == Some(Path::new("-"));
    let target = args.output.clone().unwrap_or_else(|| default_name(&args.path));
    if !to_stdout {
        check_file(&target, args.overwrite)?;
    }
    let title =
        args.path.file_name().map_or_else(|| args.path.to_string_lossy(), |name| name.to_string_lossy());
    let (page, note) = match is_config(&args.path) {
        true => of_job(args, &title, &interrupt, terminal)?,
        false => {
            let (wanted, memory) = (args.frames.wanted(), memory::for_recordings());
            match of_recording(&args.path, &title, &wanted, memory, &|| interrupt.check())? {
                Recording::Sequence(page, note) => (page, note),
                Recording::Frames(views, note) => {
                    (page::of_views(&title, &note, &Shown { views, ..Shown::default() }), note)
                }
            }
        }
    };
    interrupt.check()?;
    if !note.is_empty() {
        terminal.warn(&note);
    }
    if to_stdout {
        return terminal.data(&page);
    }
    interrupt.uncut(|| write_file(&target, page.as_bytes()))?;
    terminal.say(format_args!("wrote {} ({})", target.display(), Bytes(page.len() as u64)));
    Ok(())
}

/// `street.html` for `out/street/` and `configs/street.toml`.
fn default_name(path: &Path) -> PathBuf {
    let absolute = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
    let stem = if absolute.is_dir() { absolute.file_name() } else { absolute.file_stem() };
    PathBuf::from(stem.unwrap_or("view".as_ref())).with_added_extension("html")
}

/// The page of a job, and the note that is on it: the frames of one moment, or a sequence.
fn of_job(
    args: &Args,
    title: &str,
    interrupt: &Interrupt,
    terminal: &Terminal,
) -> Result<(String, String), Error> {
    let path = &args.path;
    let mut job = match config::load(path, &[])? {
        Config::Job(job) => *job,
        Config::Sensor(_) => {
            return Err(Error::Usage(format!(
                "{} is a sensor file, and sees nothing without a job: one that names it as `preset`",
                path.display()
            )));
        }
    };
    terminal.warn_of(&job.warnings);
    let steps = Steps::of(&job);
    let (from, to) = (args.frames.range().start, args.frames.range().end.min(steps.count()));
    if from >= to {
        let problem = format!("the job has no frame {from}: its frames are 0 to {}", steps.count() - 1);
        return Err(Error::Usage(problem));
    }
    let plan = Plan::of(&job, &Selection::FIRST, Holding::Views)?;
    let scene = load_scene(&mut job, &args.scenes, terminal)?.scene;
    interrupt.check()?;
    plan.check_scene(&scene)?;
    let session = Session::open(job, &scene);
    let labels = session.label_names();
    let count = to - from;
    let shown: Vec<u64> = playback::chosen(count).map(|index| from + index).collect();
    let rays = |item: Item| session.sensor(&item).sensor.pattern.rays() as u64;
    let of_step = |step: u64| steps.items(step).map(rays).fold(0, u64::saturating_add);
    let all_rays = shown.iter().map(|&step| of_step(step)).fold(0, u64::saturating_add);
    let views = |step: u64| -> Result<Vec<View>, Error> {
        let mut views = Vec::new();
        for item in steps.items(step) {
            let session = session.of_frame(item.frame, &args.scenes.allowed_folders)?;
            let frame = session.cast(&item, interrupt.progress());
            interrupt.check()?;
            let Some(frame) = frame else { continue };
            let view = View::of_frame(&session.sensor_frame(&item, &frame), session.scene(), &labels);
            views.push(view.in_sequence(steps.is_sequence().then_some(item.frame)));
        }
        Ok(views)
    };
    let rig = checking::rig(&session);
    if count == 1 {
        let views = terminal.with_progress(all_rays, interrupt.progress(), || views(from))?;
        return Ok((page::of_views(title, "", &Shown { views, rig }), String::new()));
    }
    let mut playback = Playback::new(title, rig, shown.len() as u64, session.job.sensors.len());
    let cast = || -> Result<(), Error> {
        for &step in &shown {
            let views = views(step)?;
            let first = steps.items(step).next().map(|item| session.capture(&item).start_s);
            let world_from_body = first.map(|start_s| session.job.trajectory.pose_at(start_s));
            let moment = Moment { frame: step, start_s: first, world_from_body, boxes: Vec::new() };
            if !playback.add(moment, &views) {
                break;
            }
        }
        Ok(())
    };
    terminal.with_progress(all_rays, interrupt.progress(), cast)?;
    let faster = if steps.has_frames_between() { playback::FASTER } else { "" };
    let note = format!("{} {faster}", playback::note_of_chosen(count)).trim().to_owned();
    Ok((playback.finish(&note), note))
}
