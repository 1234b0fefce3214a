//! `beamcast view`: frames as one HTML page.

use std::path::{Path, PathBuf};

use super::interrupt::Interrupt;
use super::job::{SceneArgs, load_scene};
use super::terminal::Terminal;
use crate::config::{self, Config, MountedSensor};
use crate::error::Error;
use crate::output::{check_file, write_file};
use crate::run::{Bytes, Holding, Plan, Session, checking, memory};
use crate::source::is_config;
use crate::view::{Shown, View, of_recording, page};

/// The arguments of `beamcast view`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// An EXR, a PLY, the folder that a scan wrote, or a job, which is run
    #[arg(value_name = "PATH")]
    path: PathBuf,
    /// The page; `-` for stdout [default: the name of PATH with .html, in the current folder]
    #[arg(short, long, visible_alias = "out", value_name = "PAGE.html")]
    output: Option<PathBuf>,
    /// Replace a page that is there already
    #[arg(long)]
    overwrite: bool,
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
    let (shown, note) = match is_config(&args.path) {
        true => (of_job(&args.path, &args.scenes, &interrupt, terminal)?, String::new()),
        false => {
            let (views, note) = of_recording(&args.path, memory::for_recordings())?;
            (Shown { views, ..Shown::default() }, note)
        }
    };
    interrupt.check()?;
    if !note.is_empty() {
        terminal.warn(&note);
    }
    let title =
        args.path.file_name().map_or_else(|| args.path.to_string_lossy(), |name| name.to_string_lossy());
    let page = page::of_views(&title, &note, &shown);
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

fn of_job(
    path: &Path,
    scenes: &SceneArgs,
    interrupt: &Interrupt,
    terminal: &Terminal,
) -> Result<Shown, Error> {
    let job = match config::load(path, &[])? {
        Config::Job(job) => *job,
        Config::Sensor(_) => {
            return Err(Error::Usage(format!(
                "{} is a sensor file, and sees nothing without a job: one that names it as `preset`",
                path.display()
            )));
        }
    };
    terminal.warn_of(&job.warnings);
    let plan = Plan::of(&job, Holding::Views)?;
    let scene = load_scene(&job, scenes, terminal)?.scene;
    interrupt.check()?;
    plan.check_scene(&scene)?;
    let session = Session::open(job, &scene);
    let labels = session.label_names();
    let view = |item| {
        let frame = session.cast(item, interrupt.progress())?;
        let MountedSensor { name, sensor, .. } = session.sensor(item);
        Some(View::of_frame(name, sensor, &frame, &scene, &labels))
    };
    let cast = || plan.items.iter().filter_map(view).collect();
    let views = terminal.with_progress(plan.rays, interrupt.progress(), cast);
    interrupt.check()?;
    Ok(Shown { views, rig: checking::rig(&session) })
}
