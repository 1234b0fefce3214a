//! `beamcast check`: jobs against their baselines and expectations.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

use super::interrupt::Interrupt;
use super::pipeline::{self, Plan};
use super::terminal::Terminal;
use crate::check::expect::{Expected, Ground, Seen, Zone};
use crate::check::{
    Baseline, Changes, Kept, MAX_PIXEL_BYTES, Outcome, SensorRecord, Settings, Taken, Verdict, coverage_map,
    judge, junit, report,
};
use crate::config::{self, Config, Job, MountedSensor};
use crate::error::{Error, Problem};
use crate::output::{Destination, SensorFrame, encode_png, write_file};
use crate::scan::Frame;
use crate::scene::Scene;
use crate::source::{Unreadable, read_file};
use crate::trace::AnyTracer;
use crate::view::{View, page};

/// The arguments of `beamcast check`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Jobs, and folders with jobs in them: those that have a baseline, `[check]` or `[[expect]]`
    #[arg(required = true, value_name = "PATH")]
    paths: Vec<PathBuf>,
    /// Make what the jobs give now their baselines; of the job NAME only, if given (its file without .toml). Refused where
    /// CI=true: baselines are accepted by people
    #[arg(long, value_name = "NAME", num_args = 0..=1, require_equals = true)]
    accept: Option<Option<String>>,
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
    /// Threads to work on, 1 to 1024; the result is the same with any number [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

/// Runs every job that there is something to check about.
///
/// # Errors
/// [`Error::Difference`] if something is not as it should be; what stands in the way of a job, once all others are checked.
pub fn run(args: &Args, terminal: &Terminal) -> Result<(), Error> {
    let interrupt = Interrupt::watch()?;
    if args.accept.is_some() {
        refuse_to_accept(args)?;
    }
    pipeline::set_threads(args.threads)?;
    let mut entries = find(args, terminal)?;
    let rays = entries.iter().filter_map(Entry::plan).map(|plan| plan.rays).sum();
    terminal
        .with_progress(rays, interrupt.progress(), || check_all(args, &mut entries, terminal, &interrupt))?;

    let mut broken = None;
    let (mut outcomes, mut views) = (Vec::new(), Vec::new());
    for entry in entries {
        outcomes.push(entry.outcome);
        views.push(entry.views);
        if let State::Broken(error) = entry.state {
            // One of them ends the run, and is told by then.
            if let Some(earlier) = broken.replace(error) {
                terminal.error(&earlier);
            }
        }
    }
    write_reports(args, terminal, &outcomes)?;
    if let Some(path) = &args.html {
        write_file(path, page::of_outcomes(&outcomes, &views).as_bytes())?;
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

/// A job on its way from its file to its outcome.
struct Entry {
    outcome: Outcome,
    /// What its sensors saw, for the HTML page; nothing if there is none.
    views: Vec<View>,
    state: State,
}

enum State {
    Ready(Box<Job>, Plan),
    Done,
    Broken(Error),
}

impl Entry {
    fn plan(&self) -> Option<&Plan> {
        match &self.state {
            State::Ready(_, plan) => Some(plan),
            _ => None,
        }
    }

    fn broken(name: String, error: Error) -> Self {
        let problems = match &error {
            Error::Config(problems) => problems.iter().map(ToString::to_string).collect(),
            other => vec![other.to_string()],
        };
        let outcome = Outcome { job: name, verdict: Verdict::Broken, problems, ..Outcome::default() };
        Self { outcome, views: Vec::new(), state: State::Broken(error) }
    }
}

/// The jobs that the paths name, each once. A file must be a job; of a folder, those that have something to be checked.
fn find(args: &Args, terminal: &Terminal) -> Result<Vec<Entry>, Error> {
    let mut entries = Vec::new();
    let mut seen = Vec::new();
    for path in &args.paths {
        let is_folder = path.is_dir();
        let files = if is_folder { pipeline::configs_in(path) } else { vec![path.clone()] };
        let before = entries.len();
        for file in files {
            let identity = fs::canonicalize(&file).unwrap_or_else(|_| file.clone());
            if seen.contains(&identity) {
                continue;
            }
            seen.push(identity);
            let name = file.to_string_lossy().replace('\\', "/");
            let job = match config::load(&file) {
                Ok(Config::Sensor(_)) if is_folder => continue,
                // Again, with the changes; a sensor file is refused here.
                Ok(_) => config::load_job(&file, &args.overrides),
                Err(error) => Err(error),
            };
            let job = match job {
                Ok(job) => job,
                Err(error) => {
                    entries.push(Entry::broken(name, error));
                    continue;
                }
            };
            let has_reason =
                job.check.is_some() || !job.expectations.is_empty() || baseline_folder(&file).is_dir();
            if is_folder && !has_reason {
                terminal.detail(format_args!("{name}: nothing to check"));
                continue;
            }
            terminal.warn_of(&job.warnings);
            entries.push(match Plan::of(&job) {
                Ok(plan) => {
                    let outcome = Outcome { job: name, ..Outcome::default() };
                    Entry { outcome, views: Vec::new(), state: State::Ready(Box::new(job), plan) }
                }
                Err(error) => Entry::broken(name, error),
            });
        }
        if is_folder && entries.len() == before {
            terminal.warn(format_args!(
                "{}: no job in this folder has a baseline, `[check]` or `[[expect]]`",
                path.display()
            ));
        }
    }
    if entries.is_empty() {
        return Err(Error::Usage(
            "there is nothing to check: `beamcast check --accept JOB.toml` makes a job's first baseline"
                .to_owned(),
        ));
    }
    Ok(entries)
}

/// `street.toml` has its baseline in `street.baseline/`.
fn baseline_folder(job: &Path) -> PathBuf {
    job.with_extension("baseline")
}

/// Checks what is ready. A scene is loaded once for all the jobs that look at it, and forgotten after the last.
fn check_all(
    args: &Args,
    entries: &mut [Entry],
    terminal: &Terminal,
    interrupt: &Interrupt,
) -> Result<(), Error> {
    for first in 0..entries.len() {
        let State::Ready(job, _) = &entries[first].state else { continue };
        let shared = SceneKey::of(job);
        let scene = pipeline::load_scene(job, terminal);
        interrupt.check()?;
        let scene = match scene {
            Ok(scene) => scene,
            Err(error) => {
                let name = std::mem::take(&mut entries[first].outcome.job);
                entries[first] = Entry::broken(name, error);
                continue;
            }
        };
        // One hierarchy a kernel; nearly always one.
        let mut casters: Vec<(Option<&str>, AnyTracer)> = Vec::new();
        for entry in &mut entries[first..] {
            let State::Ready(job, _) = &entry.state else { continue };
            if SceneKey::of(job) != shared {
                continue;
            }
            let kernel = job.kernel.map(|method| method.about.name);
            let caster = match casters.iter().position(|(name, _)| *name == kernel) {
                Some(known) => &casters[known].1,
                None => {
                    casters.push((kernel, AnyTracer::build(&scene, job.kernel)));
                    &casters[casters.len() - 1].1
                }
            };
            entry.views = check_job(args, job, &scene, caster, &mut entry.outcome, terminal, interrupt)?;
            entry.state = State::Done;
        }
    }
    Ok(())
}

/// What makes two jobs' scenes the same.
#[derive(PartialEq)]
struct SceneKey {
    path: PathBuf,
    as_written: String,
    name: Option<String>,
    up: crate::frame::UpAxis,
    labels: std::collections::BTreeMap<String, u32>,
}

impl SceneKey {
    fn of(job: &Job) -> Self {
        Self {
            path: fs::canonicalize(&job.scene_path).unwrap_or_else(|_| job.scene_path.clone()),
            // The baseline knows the scene by it.
            as_written: job.scene_as_written.clone(),
            name: job.scene_name.clone(),
            up: job.up,
            labels: job.labels.clone(),
        }
    }
}

fn check_job(
    args: &Args,
    job: &Job,
    scene: &Scene,
    caster: &AnyTracer,
    outcome: &mut Outcome,
    terminal: &Terminal,
    interrupt: &Interrupt,
) -> Result<Vec<View>, Error> {
    let start = Instant::now();
    let mut frames: Vec<Frame> = Vec::new();
    for mounted in &job.sensors {
        frames.extend(pipeline::cast(job, mounted, scene, caster, interrupt.progress()));
        interrupt.check()?;
    }
    let seconds = start.elapsed().as_secs_f64();
    let rays: usize = frames.iter().map(Frame::pixels).sum();
    let seen_by: Vec<SensorFrame> = job
        .sensors
        .iter()
        .zip(&frames)
        .map(|(mounted, frame)| pipeline::sensor_frame(job, mounted, frame))
        .collect();
    let seen = Seen { scene, frames: &seen_by, rays_per_s: Some(rays as f64 / seconds) };
    outcome.expectations = job.expectations.iter().map(|expectation| expectation.examine(&seen)).collect();

    let name = job.path.file_stem().unwrap_or_default().to_string_lossy();
    let to_accept = args.accept.as_ref().is_some_and(|only| only.as_ref().is_none_or(|only| *only == name));
    let folder = baseline_folder(&job.path);
    let mut taken: Vec<Taken> = seen_by.iter().map(|frame| Taken::of(frame, scene)).collect();
    if to_accept {
        let changed = accept(job, scene, &mut taken, &folder, terminal, interrupt)?;
        outcome.verdict = if changed { Verdict::Accepted } else { Verdict::Passed };
    } else if job.check.is_some() || folder.is_dir() || job.expectations.is_empty() {
        compare_with_baseline(job, scene, &taken, &folder, outcome);
    }
    if !outcome.failures().is_empty() {
        outcome.verdict = Verdict::Failed;
    }
    if let Some(folder) = &args.coverage {
        let map = coverage_map(&seen, &zone_of(job));
        let path = folder.join(format!("{name}.png"));
        let file = encode_png(map.width, map.height, &map.pixels).map_err(|e| Error::output(&path, e))?;
        interrupt.uncut(|| write_file(&path, &file))?;
        terminal.detail(format_args!("wrote {}", path.display()));
    }
    let shown = job.sensors.iter().zip(&frames).filter(|_| args.html.is_some());
    let view = |(mounted, frame): (&MountedSensor, &Frame)| {
        View::of_frame(&mounted.name, &mounted.sensor, frame, scene)
    };
    Ok(shown.map(view).collect())
}

/// The zone of the job's own expectation of coverage, or 20 m each way.
fn zone_of(job: &Job) -> Zone {
    let own = job.expectations.iter().find_map(|expectation| match &expectation.what {
        Expected::Coverage { zone, .. } => Some(zone.clone()),
        _ => None,
    });
    own.unwrap_or_else(|| Zone {
        ground: Ground::default(),
        x_m: [-20.0, 20.0],
        y_m: [-20.0, 20.0],
        cell_m: 0.1,
    })
}

/// The command that accepts a job as it is.
fn accept_command(job: &Job) -> String {
    format!("`beamcast check --accept {}` accepts the job as it is now", job.path.display())
}

/// Whether a file has this content already.
fn is_unchanged(path: &Path, content: &[u8]) -> bool {
    read_file(path, content.len() as u64).is_ok_and(|old| old == content)
}

/// The largest file of a baseline that is read.
const MAX_BASELINE_BYTES: u64 = 8 << 30;

fn compare_with_baseline(job: &Job, scene: &Scene, taken: &[Taken], folder: &Path, outcome: &mut Outcome) {
    let command = accept_command(job);
    let path = folder.join(Baseline::NAME);
    let baseline = match read_file(&path, MAX_BASELINE_BYTES) {
        Ok(bytes) => Baseline::decode(&bytes).map_err(|problem| format!("{} {problem}", path.display())),
        Err(Unreadable::Missing) => Err(format!("there is no {}", path.display())),
        Err(problem) => Err(format!("{}: {problem}", path.display())),
    };
    let baseline = match baseline {
        Ok(baseline) => baseline,
        Err(problem) => return outcome.problems.push(format!("{problem}; {command}")),
    };
    let records: Vec<SensorRecord> = taken.iter().map(|taken| taken.record.clone()).collect();
    let changes = Changes::between(&baseline, &Baseline::of(&job.resolved, scene, records));
    outcome.changes = changes.all();
    let default = Settings::default();
    let settings = job.check.as_ref().unwrap_or(&default);
    for taken in taken {
        let name = &taken.record.name;
        let Some(accepted) = baseline.sensors.iter().find(|record| record.name == *name) else {
            outcome.problems.push(format!("the baseline has no sensor {name}; {command}"));
            continue;
        };
        let pixels = folder.join(Baseline::pixels_name(name));
        let kept = || -> Result<Kept, Problem> {
            let read = read_file(&pixels, MAX_BASELINE_BYTES)
                .map_err(|problem| format!("{}: {problem}", pixels.display()))?;
            let kept = Kept::unpack(&read, accepted);
            kept.ok_or_else(|| format!("{} is not what was accepted", pixels.display()).into())
        };
        outcome.sensors.push(judge(taken, accepted, kept, settings, &changes, &command));
    }
    for accepted in &baseline.sensors {
        if !taken.iter().any(|taken| taken.record.name == accepted.name) {
            let name = &accepted.name;
            outcome
                .problems
                .push(format!("the job has no sensor {name} any more, the baseline does; {command}"));
        }
    }
}

/// Makes what was taken the baseline. Gives whether that changed any file.
fn accept(
    job: &Job,
    scene: &Scene,
    taken: &mut [Taken],
    folder: &Path,
    terminal: &Terminal,
    interrupt: &Interrupt,
) -> Result<bool, Error> {
    let no_tolerances = Default::default();
    let tolerances = job.check.as_ref().map_or(&no_tolerances, |settings| &settings.tolerances);
    let mut files: Vec<(String, Vec<u8>)> = taken
        .iter_mut()
        .map(|taken| (Baseline::pixels_name(&taken.record.name), taken.pack(tolerances)))
        .collect();
    for (name, content) in &files {
        if content.len() > MAX_PIXEL_BYTES {
            terminal.warn(format_args!(
                "{} takes {} bytes: wider tolerances in `[check]` would take less",
                folder.join(name).display(),
                content.len()
            ));
        }
    }
    let records = taken.iter().map(|taken| taken.record.clone()).collect();
    // Last, so that a baseline is complete if it is there.
    files.push((Baseline::NAME.to_owned(), Baseline::of(&job.resolved, scene, records).encode()));
    if files.iter().all(|(name, content)| is_unchanged(&folder.join(name), content)) {
        return Ok(false);
    }
    let names = files.iter().map(|(name, _)| name.clone()).collect();
    let destination = Destination::check(folder, names, true)?;
    interrupt.uncut(|| {
        destination.prepare(Baseline::NAME)?;
        for (name, content) in &files {
            destination.write(name, content)?;
        }
        remove_others(folder, &files);
        Ok(true)
    })
}

/// Removes the pixels of sensors that the job no longer has.
fn remove_others(folder: &Path, files: &[(String, Vec<u8>)]) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        if name.ends_with(".pixels") && !files.iter().any(|(file, _)| *file == name) {
            // What can't be removed does no harm.
            let _ = fs::remove_file(entry.path());
        }
    }
}

fn write_reports(args: &Args, terminal: &Terminal, outcomes: &[Outcome]) -> Result<(), Error> {
    let json = args.json.as_ref().map(|_| format!("{:#}\n", report::json(outcomes)));
    let to_stdout = args.json.as_ref().is_some_and(|path| path.as_os_str() == "-");
    match (&args.json, json) {
        (Some(_), Some(json)) if to_stdout => {
            terminal.say(report::text(outcomes).trim_end());
            terminal.data(&json)?;
        }
        (Some(path), Some(json)) => write_file(path, json.as_bytes())?,
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
        match to_stdout {
            true => terminal.say(report::github(outcomes).trim_end()),
            false => terminal.print(&report::github(outcomes))?,
        }
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
