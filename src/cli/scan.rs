//! `beamcast scan`: runs a job.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::interrupt::Interrupt;
use super::job::{JobArgs, heed, load_scene, strictly};
use super::json;
use super::terminal::{Terminal, Writing};
use super::threads;
use crate::config::Job;
use crate::error::Error;
use crate::output::WrittenFile;
use crate::run::{Bytes, Holding, Journal, Plan, Session, Statistics, memory, paths};
use crate::scan::Frame;
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
    #[arg(long)]
    overwrite: bool,
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
}

impl Args {
    /// The threads to work on.
    pub fn threads(&self) -> threads::Args {
        self.job.threads
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
    let job = load_job(args, path, terminal)?;
    let plan = Plan::of(&job, Holding::Files)?;
    let mut journal = Journal::check(&job, &plan, args.overwrite)?;

    let (scene, load) = timed(|| load_scene(&job, &args.job.scenes, terminal));
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
    interrupt.uncut(|| journal.begin(&plan))?;
    let writing = Writing::of(plan.output_names().len() as u64);
    let casting = || {
        let done = cast_and_write(&session, &plan, &mut journal, interrupt, &writing)?;
        interrupt.check()?;
        writing.file(|| interrupt.uncut(|| journal.finish(&session)))?;
        Ok::<_, Error>(done)
    };
    let done = terminal.with_progress_and_files(plan.rays, interrupt.progress(), &writing, casting)?;

    let outputs = journal.written();
    for output in outputs {
        terminal.detail(format_args!(
            "wrote {} ({}, BLAKE3 {})",
            output.path,
            Bytes(output.bytes),
            output.blake3
        ));
    }
    for Loss { path, values } in &done.losses {
        terminal.warn(format_args!("{path} has 0 for {values} values that its pixels can't hold"));
    }
    let times = Times { load, build, cast: done.casting, write: done.writing };
    terminal.say_lines(&summary(&session.job, &done.seen, outputs, &times));
    Ok(summary_as_json(&session.job, &done, outputs, &times, &diagnostics))
}

fn load_job(args: &Args, path: &Path, terminal: &Terminal) -> Result<Job, Error> {
    let mut job = args.job.load_strictly(path, args.strict, terminal)?;
    let given = args.out.as_ref().map(|out| match args.more.is_empty() {
        true => out.clone(),
        false => out.join(path.file_stem().unwrap_or_default()),
    });
    job.output.dir = paths::tidy(given.as_ref().unwrap_or(&job.output.dir));
    if let Some(seed) = args.seed {
        job.seed = seed;
        if let Some(resolved) = job.resolved.as_object_mut() {
            resolved.insert("seed".into(), seed.into());
        }
    }
    Ok(job)
}

/// What is known of frames that were cast and written.
struct Done {
    /// The statistics of the frames.
    seen: Vec<Statistics>,
    /// The files that lost something.
    losses: Vec<Loss>,
    casting: Duration,
    writing: Duration,
}

/// A file whose format could not hold all values of its frame.
struct Loss {
    path: String,
    values: u64,
}

/// Casts and writes one frame after the other, so that only one is in memory.
fn cast_and_write(
    session: &Session,
    plan: &Plan,
    journal: &mut Journal,
    interrupt: &Interrupt,
    progress: &Writing,
) -> Result<Done, Error> {
    let (mut seen, mut frame) = (Vec::new(), Frame::default());
    let mut losses = Vec::new();
    let (mut casting, mut writing) = (Duration::ZERO, Duration::ZERO);
    for item in &plan.items {
        let (whole, time) = timed(|| session.cast_into(&mut frame, item, interrupt.progress()));
        casting += time;
        interrupt.check()?;
        if !whole {
            continue;
        }
        seen.push(Statistics::of(&frame));
        let sensor_frame = session.sensor_frame(item, &frame);
        let start = Instant::now();
        for output in &item.outputs {
            let lost = output.format.lost(&sensor_frame);
            if lost > 0 {
                losses.push(Loss { path: output.name.clone(), values: lost });
            }
            progress.file(|| {
                let content = session.encode(output, &sensor_frame)?;
                interrupt.check()?;
                interrupt.uncut(|| journal.write(output, &content))
            })?;
        }
        journal.add(&sensor_frame)?;
        writing += start.elapsed();
    }
    Ok(Done { seen, losses, casting, writing })
}

struct Times {
    load: Duration,
    build: Duration,
    cast: Duration,
    write: Duration,
}

fn rays_per_s(seen: &[Statistics], cast: Duration) -> f64 {
    seen.iter().map(|s| s.rays).sum::<usize>() as f64 / cast.as_secs_f64()
}

fn summary(job: &Job, seen: &[Statistics], outputs: &[WrittenFile], times: &Times) -> String {
    let mut text = String::new();
    for (mounted, s) in job.sensors.iter().zip(seen) {
        let part = 100.0 * s.hits as f64 / s.rays.max(1) as f64;
        let _ = write!(text, "{}: {} rays, {} hits ({part:.1} %)", mounted.name, s.rays, s.hits);
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
    let written: u64 = outputs.iter().map(|o| o.bytes).sum();
    let count = outputs.len() + 1;
    let folder = on_one_line(&job.output.dir.to_string_lossy());
    let _ = writeln!(text, "wrote {count} files, {}, to {folder}", Bytes(written));
    let [load, build, cast, write] =
        [times.load, times.build, times.cast, times.write].map(|t| t.as_secs_f64());
    let speed = rays_per_s(seen, times.cast) / 1e6;
    let _ = writeln!(
        text,
        "load {load:.3} s, build {build:.3} s, cast {cast:.3} s ({speed:.2} million rays/s), write {write:.3} s"
    );
    text
}

fn summary_as_json(
    job: &Job,
    Done { seen, losses, .. }: &Done,
    outputs: &[WrittenFile],
    times: &Times,
    diagnostics: &[Diagnostic],
) -> Value {
    let sensor = |(name, s): (&str, &Statistics)| {
        let range = |i: usize| s.range_m.map(|range| range[i]);
        json!({
            "name": name,
            "rays": s.rays,
            "hits": s.hits,
            "too_near": s.too_near,
            "out_of_range": s.out_of_range,
            "nothing": s.nothing,
            "pixels_without_ray": s.blind,
            "range_min_m": range(0),
            "range_mean_m": range(1),
            "range_max_m": range(2),
        })
    };
    let names = job.sensors.iter().map(|s| s.name.as_str());
    let output = |o: &WrittenFile| json!({ "path": o.path, "bytes": o.bytes, "blake3": o.blake3 });
    let loss = |loss: &Loss| json!({ "path": loss.path, "values": loss.values });
    json!({
        "dir": job.output.dir.to_string_lossy(),
        "sensors": names.zip(seen).map(sensor).collect::<Vec<_>>(),
        "outputs": outputs.iter().map(output).collect::<Vec<_>>(),
        "lost": losses.iter().map(loss).collect::<Vec<_>>(),
        "diagnostics": diagnostics,
        "load_s": times.load.as_secs_f64(),
        "build_s": times.build.as_secs_f64(),
        "cast_s": times.cast.as_secs_f64(),
        "write_s": times.write.as_secs_f64(),
        "rays_per_s": rays_per_s(seen, times.cast),
        "threads": rayon::current_num_threads(),
    })
}

fn print_plan(
    args: &Args,
    terminal: &Terminal,
    job: &Job,
    plan: &Plan,
    scene: &Scene,
    diagnostics: &[Diagnostic],
    journal: &Journal,
) -> Result<Value, Error> {
    let outputs = journal.paths().map(|path| path.to_string_lossy().into_owned());
    let removed = journal.paths_to_remove().map(|path| path.to_string_lossy().into_owned());
    if args.json {
        let sensor = |s: &crate::config::MountedSensor| {
            let pattern = &s.sensor.pattern;
            json!({ "name": s.name, "rows": pattern.rows(), "columns": pattern.columns(), "rays": pattern.rays() })
        };
        let plan = json!({
            "sensors": job.sensors.iter().map(sensor).collect::<Vec<_>>(),
            "rays": plan.rays,
            "memory_bytes": plan.bytes,
            "scene_memory_bytes": memory::of_scene(scene),
            "triangles": scene.triangle_count(),
            "diagnostics": diagnostics,
            "outputs": outputs.collect::<Vec<_>>(),
            "removed": removed.collect::<Vec<_>>(),
        });
        return Ok(plan);
    }
    let mut text = String::new();
    for s in &job.sensors {
        let pattern = &s.sensor.pattern;
        let (rows, columns) = (pattern.rows(), pattern.columns());
        let _ = writeln!(text, "{}: {rows} × {columns} = {} rays", s.name, pattern.rays());
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
    let _ = writeln!(text, "would write:");
    for output in outputs {
        let _ = writeln!(text, "  {}", on_one_line(&output));
    }
    for (index, path) in removed.enumerate() {
        text.push_str(if index == 0 { "would remove, of an earlier run:\n" } else { "" });
        let _ = writeln!(text, "  {}", on_one_line(&path));
    }
    terminal.print(&text)?;
    Ok(Value::Null)
}

fn timed<T>(work: impl FnOnce() -> T) -> (T, Duration) {
    let start = Instant::now();
    let result = work();
    (result, start.elapsed())
}
