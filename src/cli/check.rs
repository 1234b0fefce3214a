//! `beamcast check`: holds jobs to their baselines and expectations.

use std::collections::VecDeque;
use std::fs;
use std::io::Write as _;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use super::interrupt::Interrupt;
use super::job::{SceneArgs, load_scene, strictly};
use super::json;
use super::terminal::Terminal;
use super::threads;
use crate::check::{Failure, Outcome, Verdict, junit, report};
use crate::error::Error;
use crate::output::write_file;
use crate::run::checking::{self, CastFrame, Checked, Found, Purpose, Run, State};
use crate::run::{Session, paths};
use crate::trace::AnyTracer;
use crate::view::{Shown, of_outcomes};

/// The arguments of `beamcast check`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Jobs, and folders; of a folder, the jobs that have a baseline, `[check]` or `[[expect]]` are run
    #[arg(required = true, value_name = "PATH")]
    paths: Vec<PathBuf>,
    /// Make what the jobs give now their baselines; of the job NAME only, if given (its file without .toml). Refused where
    /// CI=true: baselines are accepted by people
    #[arg(long, value_name = "NAME", num_args = 0..=1, require_equals = true)]
    accept: Option<Option<String>>,
    /// Accept frames without a single return too
    #[arg(long, requires = "accept")]
    allow_empty: bool,
    /// Take warnings for errors: a job that has any is not run
    #[arg(long)]
    strict: bool,
    /// Write JUnit XML
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,
    /// Write a Markdown summary; GitHub's job summary gets it anyway
    #[arg(long, value_name = "FILE")]
    markdown: Option<PathBuf>,
    /// Write an HTML page with pictures of run, baseline and difference, and clouds to turn
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Write JSON; - is stdout
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write a map of the ground that each job's rig sees to DIR/NAME.png
    #[arg(long, value_name = "DIR")]
    coverage: Option<PathBuf>,
    /// Change a key of every job, such as sensor.top.range.max_m=50, to see what would follow; can be given again
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    #[command(flatten)]
    scenes: SceneArgs,
    #[command(flatten)]
    pub threads: threads::Args,
}

/// Runs every job that has something to be checked.
///
/// # Errors
/// [`Error::Difference`] if something is not as it should be. A job that can't be run is an error too, once all others are
/// checked.
pub fn run(args: &Args, terminal: &Terminal) -> Result<(), Error> {
    let interrupt = Interrupt::watch()?;
    if args.accept.is_some() {
        refuse_to_accept(args)?;
    }
    let Found { mut jobs, passed_over, empty_folders, warnings } =
        checking::find(&args.paths, &args.overrides, args.accept.is_some(), args.html.is_some());
    for name in passed_over {
        terminal.detail(format_args!("{name}: nothing to check"));
    }
    for folder in empty_folders {
        terminal.warn(format_args!(
            "{}: no job in this folder has a baseline, `[check]` or `[[expect]]`",
            folder.display()
        ));
    }
    if !args.strict {
        terminal.warn_of(&warnings);
    }
    if jobs.is_empty() {
        return Err(Error::Usage(
            "there is nothing to check: `beamcast check --accept JOB.toml` makes a job's first baseline"
                .to_owned(),
        ));
    }
    let rays = jobs.iter().map(|job| job.rays).fold(0, u64::saturating_add);
    let check_all = || check_all(args, &mut jobs, terminal, &interrupt);
    terminal.with_progress(rays, interrupt.progress(), check_all)?;

    let mut broken = None;
    let (mut outcomes, mut shown) = (Vec::new(), Vec::new());
    for job in jobs {
        outcomes.push(job.outcome);
        shown.push(job.shown);
        if let State::Broken(error) = job.state {
            // The last error ends the run, which shows it; the others are shown here.
            if let Some(earlier) = broken.replace(error) {
                terminal.error(&earlier);
            }
        }
    }
    write_reports(args, terminal, &outcomes)?;
    if let Some(path) = &args.html {
        write_file(path, of_outcomes(&outcomes, &shown).as_bytes())?;
    }
    match broken {
        Some(error) => Err(error),
        None if outcomes.iter().all(|outcome| outcome.verdict.is_fine()) => {
            terminal.say(report::summary(&outcomes));
            Ok(())
        }
        None => Err(Error::Difference(report::summary(&outcomes))),
    }
}

fn refuse_to_accept(args: &Args) -> Result<(), Error> {
    if std::env::var_os("CI").is_some_and(|ci| ci == "true" || ci == "1") {
        return Err(Error::Usage(
            "--accept is refused where CI is set: accept a baseline where you can look at what changed, and commit it"
                .to_owned(),
        ));
    }
    if !args.overrides.is_empty() {
        return Err(Error::Usage("--accept with --set would accept another job than the file's".to_owned()));
    }
    Ok(())
}

/// Checks the jobs that can be run. A scene is loaded once for all the jobs that look at it, and dropped after the last.
fn check_all(
    args: &Args,
    jobs: &mut [Checked],
    terminal: &Terminal,
    interrupt: &Interrupt,
) -> Result<(), Error> {
    let mut groups = VecDeque::from(checking::by_scene(jobs));
    while let Some(mut group) = groups.pop_front() {
        let Some(State::Ready(job, _)) = group.first().map(|first| &mut jobs[*first].state) else { continue };
        let scene = load_scene(job, &args.scenes, terminal);
        interrupt.check()?;
        let (scene, of_scene) = match scene {
            Ok(loaded) => {
                let diagnostics: Vec<_> = loaded.diagnostics(&job.scene_path).collect();
                (loaded.scene, diagnostics)
            }
            Err(error) => {
                // Each of the other jobs reads the scene again, and so has an error of its own.
                let place = job.places.scene.clone();
                jobs[group.remove(0)].fail_at(place, error);
                groups.extend(Some(group));
                continue;
            }
        };
        // One tracer for each kernel; nearly always there is one.
        let mut tracers: Vec<(Option<&str>, AnyTracer)> = Vec::new();
        for index in group {
            let checked = &mut jobs[index];
            let State::Ready(job, plan) = std::mem::replace(&mut checked.state, State::Done) else {
                continue;
            };
            if let Err(error) = plan.check_scene(&scene) {
                checked.fail(error);
                continue;
            }
            let kernel = job.kernel.map(|method| method.about.name);
            let known = tracers.iter().position(|(name, _)| *name == kernel);
            let place = known.unwrap_or_else(|| {
                tracers.push((kernel, AnyTracer::build(&scene, job.kernel)));
                tracers.len() - 1
            });
            let session = Session::new(job, tracers[place].1.clone());
            let doubts = session.doubts();
            let warnings = [&session.job.warnings, &of_scene, &doubts].map(|all| all.as_slice()).concat();
            if args.strict
                && let Err(error) = strictly(&warnings)
            {
                checked.fail(error);
                continue;
            }
            terminal.warn_of(&doubts);
            checked.outcome.warnings = warnings;
            match check_job(args, &session, &mut checked.outcome, terminal, interrupt) {
                Ok(shown) => checked.shown = shown,
                // What the job draws for a frame makes it one that can't be run.
                Err(error @ (Error::Config(_) | Error::Scene(_))) => checked.fail(error),
                Err(error) => return Err(error),
            }
        }
    }
    Ok(())
}

/// Casts a job's frames and judges or accepts them. Returns what the page shows of the job, if there is a page.
fn check_job(
    args: &Args,
    session: &Session,
    outcome: &mut Outcome,
    terminal: &Terminal,
    interrupt: &Interrupt,
) -> Result<Shown, Error> {
    let name = session.job.path.file_stem().unwrap_or_default().to_string_lossy();
    let accepts = args.accept.as_ref().is_some_and(|only| only.as_ref().is_none_or(|only| *only == name));
    let purpose = Purpose { accepts, page: args.html.is_some(), ground: args.coverage.is_some() };
    let mut run = Run::new(session, outcome, purpose);
    let mut casting = Duration::ZERO;
    while let Some(items) = run.next_items() {
        let start = Instant::now();
        let mut frames = Vec::new();
        for item in items {
            let session = session.of_frame(item.frame, &args.scenes.allowed_folders)?;
            let frame = session.cast(&item, interrupt.progress());
            let ideal = match run.needs_ideal(&item) {
                true => session.cast_ideal(&item, interrupt.progress()),
                false => None,
            };
            interrupt.check()?;
            frames.extend(frame.map(|frame| CastFrame { item, session, frame, ideal }));
        }
        casting += start.elapsed();
        run.take(&frames);
    }
    let taken = run.finish(casting.as_secs_f64());
    if let Some(acceptance) = taken.acceptance {
        let blank = if args.allow_empty { Vec::new() } else { taken.blank };
        if blank.is_empty() {
            acceptance.warnings().iter().for_each(|warning| terminal.warn(warning));
            if !acceptance.is_there() {
                interrupt.uncut(|| acceptance.write())?;
            }
        } else {
            outcome.verdict = Verdict::Failed;
            let problem = |frame: &String| {
                let sentence = format!(
                    "{frame} sees nothing, which is not accepted; --allow-empty accepts it all the same"
                );
                Failure::from(sentence)
            };
            outcome.problems.extend(blank.iter().map(problem));
        }
    }
    if let (Some(folder), Some(ground)) = (&args.coverage, taken.ground) {
        let map = ground.picture(&format!("{name}: the ground that the rig sees"));
        let path = folder.join(format!("{name}.png"));
        let file = map.to_png().map_err(|e| Error::output(&path, e))?;
        interrupt.uncut(|| write_file(&path, &file))?;
        terminal.detail(format_args!("wrote {}", path.display()));
    }
    Ok(taken.shown)
}

fn write_reports(args: &Args, terminal: &Terminal, outcomes: &[Outcome]) -> Result<(), Error> {
    let json = args.json.as_ref().map(|_| json::CHECK.of(report::json(outcomes)));
    let to_stdout = args.json.as_ref().is_some_and(|path| path.as_os_str() == "-");
    match (&args.json, json) {
        (Some(_), Some(json)) if to_stdout => {
            terminal.say_lines(&report::text(outcomes));
            terminal.json(&json)?;
        }
        (Some(path), Some(json)) => write_file(path, format!("{json:#}\n").as_bytes())?,
        _ => {}
    }
    if !to_stdout {
        terminal.print(&report::text(outcomes))?;
    }
    if let Some(path) = &args.junit {
        write_file(path, junit::xml(outcomes).as_bytes())?;
    }
    let markdown = report::markdown(outcomes);
    if let Some(path) = &args.markdown {
        write_file(path, markdown.as_bytes())?;
    }
    if std::env::var_os("GITHUB_ACTIONS").is_some_and(|value| value == "true") {
        // GitHub looks for these on either stream.
        let workspace = std::env::var_os("GITHUB_WORKSPACE").map(PathBuf::from);
        let name_of = |path: &str| paths::in_repository(path.as_ref(), workspace.as_deref());
        terminal.commands(&report::github(outcomes, &name_of), to_stdout)?;
        if let Some(path) = std::env::var_os("GITHUB_STEP_SUMMARY").map(PathBuf::from) {
            let appended = fs::OpenOptions::new()
                .append(true)
                .create(true)
                .open(&path)
                .and_then(|mut file| file.write_all(markdown.as_bytes()));
            appended.map_err(|e| Error::output(&path, format!("can't be written: {e}")))?;
        }
    }
    Ok(())
}
