//! `beamcast scan`: runs a job.

use std::cmp::Reverse;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::interrupt::Interrupt;
use super::job::{JobArgs, heed, load_scene, strictly};
use super::json;
use super::parts;
use super::pipeline::{self, Pipeline, timed};
use super::terminal::{Terminal, Writing};
use super::threads;
use crate::config::Job;
use crate::error::Error;
use crate::output::{Manifest, WrittenFile};
use crate::run::journal::Done;
use crate::run::record::{Line, Loss};
use crate::run::{
    Bytes, Holding, Item, Journal, Plan, Selection, Session, Shard, Start, Statistics, memory, paths,
};
use crate::scene::Scene;
use crate::source::Diagnostic;
use crate::source::words::{counted, on_one_line};
use crate::trace::AnyTracer;

/// The arguments of `beamcast scan`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Write here instead of the job's output.dir; of several jobs, each to a folder of its name in here
    #[arg(short, long, visible_alias = "output", value_name = "DIR")]
    out: Option<PathBuf>,
    /// Replace outputs that are there already, and remove those of the last run that are not written again
    #[arg(long, conflicts_with = "resume")]
    overwrite: bool,
    /// Go on with a run that was stopped: frames that are finished are not cast again
    #[arg(long)]
    resume: bool,
    /// Cast only these frames, counted from 0: A..B (without B), A.., ..B, or one number
    #[arg(long, value_name = "A..B", value_parser = parts::frames)]
    frames: Option<Range<u64>>,
    /// Cast only part I of N of the frames, counted from 1; `auto` asks SLURM, `auto/N` SLURM or Kubernetes for I
    #[arg(long, value_name = "I/N", value_parser = parts::shard)]
    shard: Option<Shard>,
    /// Use this seed instead of the job's
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Take warnings for errors, and write nothing where there are any
    #[arg(long)]
    strict: bool,
    /// Check everything and list the files that would be written, but cast and write nothing
    #[arg(long)]
    dry_run: bool,
    #[command(flatten)]
    job: JobArgs,
    /// More jobs, which run one after the other
    #[arg(value_name = "JOB.toml")]
    more: Vec<PathBuf>,
    /// Print the summary (or the plan of a dry run) as JSON on stdout
    #[arg(long)]
    json: bool,
    /// Print a line of JSON on stdout for each frame when its files are written
    #[arg(long, conflicts_with_all = ["json", "dry_run"])]
    json_lines: bool,
}

impl Args {
    /// The threads to work on.
    pub fn threads(&self) -> threads::Args {
        self.job.threads
    }

    /// The frames to cast.
    fn selection(&self) -> Selection {
        Selection {
            frames: self.frames.clone().unwrap_or(Selection::ALL.frames),
            shard: self.shard.unwrap_or(Shard::WHOLE),
        }
    }

    /// What becomes of what is in the folder.
    fn start(&self) -> Start {
        match (self.overwrite, self.resume) {
            (true, _) => Start::Overwrite,
            (_, true) => Start::Resume,
            _ => Start::New,
        }
    }

    /// The JSON that is printed.
    fn document(&self) -> json::Document {
        if self.dry_run { json::SCAN_PLAN } else { json::SCAN }
    }
}

/// Runs jobs, one after the other. The first error ends the run.
///
/// # Errors
/// As [`run_job`].
pub fn run(args: &Args, terminal: &Terminal) -> Result<(), Error> {
    let interrupt = Interrupt::watch()?;
    let mut summaries = Vec::new();
    for path in std::iter::once(args.job.path()).chain(args.more.iter().map(PathBuf::as_path)) {
        if !args.more.is_empty() {
            terminal.say(format_args!("{}:", path.display()));
        }
        summaries.push(run_job(args, path, &interrupt, terminal)?);
    }
    match summaries.as_slice() {
        _ if !args.json => Ok(()),
        [alone] => terminal.json(&args.document().of(alone.clone())),
        several => terminal.json(&args.document().of(json!({ "jobs": several }))),
    }
}

/// Runs a job: reads the job and its scene, builds the tracer, casts the frames, writes the files and then the manifest. Gives
/// the summary, or the plan of a dry run.
///
/// # Errors
/// The errors of the job, the scene and the output folder. Nothing is cast before all three are known to be good.
fn run_job(args: &Args, path: &Path, interrupt: &Interrupt, terminal: &Terminal) -> Result<Value, Error> {
    let mut job = load_job(args, path, terminal)?;
    let plan = Plan::of(&job, &args.selection(), Holding::Files)?;
    let mut journal = Journal::check(&job, &plan, args.start())?;

    let (scene, load) = timed(|| load_scene(&mut job, &args.job.scenes, terminal));
    let loaded = scene?;
    let mut diagnostics = job.warnings.clone();
    diagnostics.extend(loaded.diagnostics(&job.scene_path));
    let scene = loaded.scene;
    interrupt.check()?;
    if args.strict {
        strictly(&diagnostics)?;
    }
    plan.check_scene(&scene)?;
    let (tracer, build) = timed(|| AnyTracer::build(&scene, job.kernel));
    interrupt.check()?;

    let session = Session::new(job, tracer);
    let doubts = session.doubts();
    heed(&doubts, args.strict, terminal)?;
    diagnostics.extend(doubts);
    if args.dry_run {
        return print_plan(args, terminal, &session.job, &plan, session.scene(), &diagnostics, &journal);
    }
    let mut tally = Tally::new(&session);
    let done = interrupt.uncut(|| journal.begin(&session, &plan, &mut |item, line| tally.add(item, line)))?;
    let Done::Frames(skipped) = done else {
        let folder = session.job.output.dir.display();
        terminal.say(format_args!("{folder} is complete already: nothing was left to do"));
        return Ok(summary_as_json(
            &session.job,
            &tally,
            &Times { load, build, ..Times::default() },
            &diagnostics,
        ));
    };
    if skipped > 0 {
        let all = counted(plan.frames(), "frame");
        terminal.say(format_args!("{skipped} of {all} are there already, and the run goes on after them"));
    }
    let frames = plan.frames() - skipped;
    let rays_left = plan.rays.saturating_sub(tally.pixels());
    let writing = Writing::of(plan.files_of_frames().saturating_sub(tally.files) + 1, frames);
    let scene_folders = &args.job.scenes.allowed_folders;
    let pipeline = Pipeline { session: &session, plan: &plan, scene_folders, interrupt, writing: &writing };
    tally.rays_before = tally.rays();
    let run = || {
        let begun = Instant::now();
        let mut teller = Teller { args, terminal, writing: &writing, begun, told: begun };
        let tell = &mut |item: &Item, line| teller.tell(&mut tally, item, line);
        let times = pipeline.run(skipped, &mut journal, tell)?;
        tally.add_files(writing.file(|| interrupt.uncut(|| journal.finish()))?);
        Ok::<_, Error>(times)
    };
    let pipeline::Times { cast, encode, write, .. } =
        terminal.with_progress_and_files(rays_left, interrupt.progress(), &writing, run)?;
    let write = encode + write;

    for Loss { path, values } in &tally.losses {
        terminal.warn(format_args!("{path} has 0 for {values} values that its pixels can't hold"));
    }
    if tally.lossy_files > tally.losses.len() as u64 {
        let more = tally.lossy_files - tally.losses.len() as u64;
        terminal.warn(format_args!("{more} more files have 0 for values that their pixels can't hold"));
    }
    let times = Times { load, build, cast, write, cast_rays: tally.rays() - tally.rays_before };
    terminal.say_lines(&summary(&session.job, &plan, &tally, &times));
    Ok(summary_as_json(&session.job, &tally, &times, &diagnostics))
}

fn load_job(args: &Args, path: &Path, terminal: &Terminal) -> Result<Job, Error> {
    let mut job = args.job.load_strictly(path, args.seed, args.strict, terminal)?;
    let given = args.out.as_ref().map(|out| match args.more.is_empty() {
        true => out.clone(),
        false => out.join(path.file_stem().unwrap_or_default()),
    });
    job.output.dir = paths::tidy(given.as_ref().unwrap_or(&job.output.dir));
    Ok(job)
}

/// The most files that a summary names one by one. Of a longer run the manifest does.
const MOST_NAMED: usize = 1000;

/// What is known of the frames that are written, whether by this run or by an earlier one that was stopped.
struct Tally {
    /// The statistics of each sensor's frames, in the job's order.
    seen: Vec<Statistics>,
    files: u64,
    bytes: u64,
    /// The first files.
    outputs: Vec<WrittenFile>,
    /// The first files that lost something.
    losses: Vec<Loss>,
    lossy_files: u64,
    /// The rays of an earlier run.
    rays_before: usize,
}

impl Tally {
    fn new(session: &Session) -> Self {
        let seen = vec![Statistics::default(); session.job.sensors.len()];
        let (outputs, losses) = (Vec::new(), Vec::new());
        Self { seen, files: 0, bytes: 0, outputs, losses, lossy_files: 0, rays_before: 0 }
    }

    /// Adds a frame.
    fn add(&mut self, item: &Item, line: Line) {
        self.seen[item.sensor].add(&line.statistics);
        self.lossy_files += line.lost.len() as u64;
        self.add_files(line.outputs);
        let room = MOST_NAMED - self.losses.len();
        self.losses.extend(line.lost.into_iter().take(room));
    }

    /// Adds files.
    fn add_files(&mut self, files: Vec<WrittenFile>) {
        self.files += files.len() as u64;
        self.bytes += files.iter().map(|output| output.bytes).sum::<u64>();
        let room = MOST_NAMED - self.outputs.len();
        self.outputs.extend(files.into_iter().take(room));
    }

    fn rays(&self) -> usize {
        self.seen.iter().map(|seen| seen.rays).sum()
    }

    fn pixels(&self) -> u64 {
        self.seen.iter().map(|seen| (seen.rays + seen.blind) as u64).sum()
    }
}

/// The time between two lines about a long run where there is no progress bar.
const BETWEEN_LINES: Duration = Duration::from_secs(30);

/// Tells of the frames of a run that are written.
struct Teller<'r> {
    args: &'r Args,
    terminal: &'r Terminal,
    writing: &'r Writing,
    begun: Instant,
    /// When a line about the run was last told.
    told: Instant,
}

impl Teller<'_> {
    /// Tells of a frame that is written, and adds it to the tally.
    fn tell(&mut self, tally: &mut Tally, item: &Item, mut line: Line) -> Result<(), Error> {
        // The rows are in the tables, and what was drawn in the manifest.
        line.rows.clear();
        line.drawn.clear();
        for output in &line.outputs {
            let WrittenFile { path, bytes, blake3 } = output;
            self.terminal.detail(format_args!("wrote {path} ({}, BLAKE3 {blake3})", Bytes(*bytes)));
        }
        if self.args.json_lines {
            let content = serde_json::to_value(&line).unwrap_or_default();
            self.terminal.json_line(&json::SCAN_FRAME.of(content))?;
        }
        if self.told.elapsed() >= BETWEEN_LINES && !self.terminal.has_bar() {
            self.told = Instant::now();
            self.terminal.say(self.writing.line(self.begun.elapsed()));
        }
        tally.add(item, line);
        Ok(())
    }
}

#[derive(Default)]
struct Times {
    load: Duration,
    build: Duration,
    cast: Duration,
    write: Duration,
    /// The rays that were cast in this time.
    cast_rays: usize,
}

impl Times {
    fn rays_per_s(&self) -> f64 {
        self.cast_rays as f64 / self.cast.as_secs_f64().max(1e-9)
    }
}

fn summary(job: &Job, plan: &Plan, tally: &Tally, times: &Times) -> String {
    let mut text = String::new();
    for (mounted, s) in job.sensors.iter().zip(&tally.seen).filter(|(_, seen)| seen.frames > 0) {
        let part = 100.0 * s.hits as f64 / s.rays.max(1) as f64;
        let frames = if plan.frames() > job.sensors.len() as u64 {
            format!("{}, ", counted(s.frames, "frame"))
        } else {
            String::new()
        };
        if s.is_measured() {
            text += &measured_summary(&mounted.name, &frames, part, s);
            continue;
        }
        let _ = write!(text, "{}: {frames}{} rays, {} hits ({part:.1} %)", mounted.name, s.rays, s.hits);
        for (count, what) in [
            (s.too_near, "blocked nearer than its least range"),
            (s.out_of_range, "beyond its largest range"),
            (s.blind, "pixels without a ray"),
        ] {
            if count > 0 {
                let _ = write!(text, ", {count} {what}");
            }
        }
        let _ = match s.range_m {
            Some([low, mean, high]) => {
                writeln!(text, ", range {low:.3} to {high:.3} m, mean {mean:.3} m")
            }
            None => writeln!(text, ": it sees nothing within its range"),
        };
    }
    let Shard { index, count } = plan.shard();
    let is_whole = plan.shard() == Shard::WHOLE;
    let files = tally.files + u64::from(is_whole);
    let folder = on_one_line(&job.output.dir.to_string_lossy());
    let _ = writeln!(text, "wrote {files} files, {}, to {folder}", Bytes(tally.bytes));
    if !is_whole {
        let part = index + 1;
        let _ =
            writeln!(text, "part {part} of {count} is finished: `beamcast merge` makes a run of all parts");
    }
    let [load, build, cast, write] =
        [times.load, times.build, times.cast, times.write].map(|t| t.as_secs_f64());
    let speed = times.rays_per_s() / 1e6;
    let _ = writeln!(
        text,
        "load {load:.3} s, build {build:.3} s, cast {cast:.3} s ({speed:.2} million rays/s), write {write:.3} s"
    );
    text
}

/// The line of a sensor that is not ideal: the pulses that return, and the causes that there are, the most frequent first. `part` of
/// its pulses, in percent, return.
fn measured_summary(name: &str, frames: &str, part: f64, s: &Statistics) -> String {
    let returns = s.returns();
    let mut text =
        format!("{name}: {frames}{} pulses, {returns} returns of {} pulses ({part:.1} %)", s.rays, s.hits);
    let listed = |counts: &BTreeMap<String, u64>| {
        let mut counts: Vec<_> = counts.iter().collect();
        counts.sort_by_key(|(_, count)| Reverse(**count));
        let words: Vec<String> = counts.iter().map(|(cause, count)| format!("{cause} {count}")).collect();
        words.join(", ")
    };
    if returns > 0 {
        let _ = write!(text, ": {}", listed(&s.causes));
    }
    if !s.without_return.is_empty() {
        let _ = write!(text, "; without return: {}", listed(&s.without_return));
    }
    if s.blind > 0 {
        let _ = write!(text, "; {} pixels without a ray", s.blind);
    }
    if let Some([low, mean, high]) = s.range_m {
        let _ = write!(text, "; range {low:.3} to {high:.3} m, mean {mean:.3} m");
    }
    text + "\n"
}

fn summary_as_json(job: &Job, tally: &Tally, times: &Times, diagnostics: &[Diagnostic]) -> Value {
    let sensor = |(name, s): (&str, &Statistics)| {
        let range = |i: usize| s.range_m.map(|range| range[i]);
        json!({
            "name": name,
            "frames": s.frames,
            "rays": s.rays,
            "hits": s.hits,
            "returns": s.returns(),
            "too_near": s.too_near,
            "out_of_range": s.out_of_range,
            "nothing": s.nothing,
            "pixels_without_ray": s.blind,
            "range_min_m": range(0),
            "range_mean_m": range(1),
            "range_max_m": range(2),
            "causes": s.is_measured().then_some(&s.causes),
            "without_return": s.is_measured().then_some(&s.without_return),
        })
    };
    let names = job.sensors.iter().map(|s| s.name.as_str());
    let output = |o: &WrittenFile| json!({ "path": o.path, "bytes": o.bytes, "blake3": o.blake3 });
    let loss = |loss: &Loss| json!({ "path": loss.path, "values": loss.values });
    json!({
        "dir": job.output.dir.to_string_lossy(),
        "sensors": names.zip(&tally.seen).map(sensor).collect::<Vec<_>>(),
        "files": tally.files,
        "bytes": tally.bytes,
        "outputs": tally.outputs.iter().map(output).collect::<Vec<_>>(),
        "lost": tally.losses.iter().map(loss).collect::<Vec<_>>(),
        "diagnostics": diagnostics,
        "load_s": times.load.as_secs_f64(),
        "build_s": times.build.as_secs_f64(),
        "cast_s": times.cast.as_secs_f64(),
        "write_s": times.write.as_secs_f64(),
        "rays_per_s": times.rays_per_s(),
        "threads": rayon::current_num_threads(),
    })
}

/// The most files that the plan of a dry run shows to people.
const MOST_SHOWN: usize = 200;

fn print_plan(
    args: &Args,
    terminal: &Terminal,
    job: &Job,
    plan: &Plan,
    scene: &Scene,
    diagnostics: &[Diagnostic],
    journal: &Journal,
) -> Result<Value, Error> {
    let dir = &job.output.dir;
    let name = |path: PathBuf| path.to_string_lossy().into_owned();
    let of_frames = plan.items(job).flat_map(|item| item.outputs).map(|output| output.name);
    let of_run = plan.stream_files();
    let manifest = (plan.shard() == Shard::WHOLE).then(|| Manifest::NAME.to_owned());
    let tables =
        plan.tables.iter().filter(|_| plan.shard() == Shard::WHOLE).map(|table| table.name().to_owned());
    let names = of_frames.take(MOST_NAMED).chain(of_run).chain(tables).chain(manifest);
    let outputs: Vec<String> = names.map(|output| name(dir.join(output))).collect();
    let mut removed = Vec::new();
    journal.paths_to_remove(|path| {
        if removed.len() < MOST_NAMED {
            removed.push(name(path));
        }
    });
    let formats = &job.output.formats;
    let files = plan.files();
    let file_bytes = job.sensors.iter().enumerate().fold(0_u64, |sum, (index, mounted)| {
        let a_ray: u64 = formats.iter().map(|format| format.file_bytes_a_ray(&mounted.sensor)).sum();
        let rays = plan.frames_of(index).saturating_mul(mounted.sensor.pattern.rays() as u64);
        sum.saturating_add(rays.saturating_mul(a_ray))
    });
    if args.json {
        let sensor = |(index, s): (usize, &crate::config::MountedSensor)| {
            let pattern = &s.sensor.pattern;
            json!({
                "name": s.name,
                "rows": pattern.rows(),
                "columns": pattern.columns(),
                "rays": pattern.rays(),
                "frames": plan.frames_of(index),
            })
        };
        let plan = json!({
            "sensors": job.sensors.iter().enumerate().map(sensor).collect::<Vec<_>>(),
            "rays": plan.rays,
            "files": files,
            "file_bytes": file_bytes,
            "memory_bytes": plan.bytes,
            "scene_memory_bytes": memory::of_scene(scene),
            "triangles": scene.triangle_count(),
            "diagnostics": diagnostics,
            "outputs": outputs,
            "removed": removed,
        });
        return Ok(plan);
    }
    let mut text = String::new();
    for (index, s) in job.sensors.iter().enumerate() {
        let pattern = &s.sensor.pattern;
        let (rows, columns) = (pattern.rows(), pattern.columns());
        let _ = write!(text, "{}: {rows} × {columns} = {} rays", s.name, pattern.rays());
        let _ = match (plan.frames_of(index), job.sequence.frames_of(&s.sensor)) {
            (1, 1) => writeln!(text),
            (chosen, all) => {
                let last_s = job.capture(index, all.saturating_sub(1)).start_s;
                let first_s = job.capture(index, 0).start_s;
                writeln!(
                    text,
                    " a frame, {chosen} of {all} frames, which start from {first_s} s to {last_s} s"
                )
            }
        };
    }
    let triangles = scene.triangle_count();
    let _ = writeln!(
        text,
        "scene: {}, {}",
        counted(triangles, "triangle"),
        counted(scene.geometry.objects.len() as u64, "instance")
    );
    let _ = writeln!(text, "memory for frames: at most {}", Bytes(plan.bytes));
    let _ = writeln!(text, "memory for the scene: about {}", Bytes(memory::of_scene(scene)));
    let _ = writeln!(text, "would write {files} files, at most {} before compression:", Bytes(file_bytes));
    let left_out = outputs.len().saturating_sub(MOST_SHOWN);
    for output in outputs.iter().take(MOST_SHOWN) {
        let _ = writeln!(text, "  {}", on_one_line(output));
    }
    if left_out > 0 {
        let _ = writeln!(text, "  and {} more", files - MOST_SHOWN as u64);
    }
    for (index, path) in removed.iter().enumerate() {
        text.push_str(if index == 0 { "would remove, of an earlier run:\n" } else { "" });
        let _ = writeln!(text, "  {}", on_one_line(path));
    }
    terminal.print(&text)?;
    Ok(Value::Null)
}
