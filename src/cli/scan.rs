//! `beamcast scan`: runs a job.

use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::interrupt::Interrupt;
use super::pipeline::{self, Bytes, JobArgs, Plan, output_name};
use super::terminal::Terminal;
use crate::config::Job;
use crate::error::Error;
use crate::output::{Destination, Manifest, WrittenFile};
use crate::scan::Frame;
use crate::scene::{Scene, SourceFile};
use crate::trace::AnyTracer;

/// The arguments of `beamcast scan`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Write here instead of the job's output.dir
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Replace outputs that are there already
    #[arg(long)]
    overwrite: bool,
    /// Use this seed instead of the job's
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Check everything and say what would be written, but cast and write nothing
    #[arg(long)]
    dry_run: bool,
    #[command(flatten)]
    job: JobArgs,
    /// Print the summary (or the plan of a dry run) as JSON on stdout
    #[arg(long)]
    json: bool,
}

/// Runs a job: job → scene → hierarchy → frames → files → manifest.
///
/// # Errors
/// Of the job, the scene, the output folder; nothing is cast before all three are known to be good.
pub fn run(args: &Args, terminal: &Terminal) -> Result<(), Error> {
    let interrupt = Interrupt::watch()?;
    let job = load_job(args, terminal)?;
    let plan = Plan::of(&job)?;
    let names = pipeline::output_names(&job);
    let destination = Destination::check(&job.output.dir, names, args.overwrite)?;

    let (scene, load) = timed(|| pipeline::load_scene(&job, terminal));
    let scene = scene?;
    interrupt.check()?;
    if args.dry_run {
        return print_plan(args, terminal, &job, &plan, &scene, &destination);
    }
    let (tracer, build) = timed(|| AnyTracer::build(&scene, job.kernel));
    interrupt.check()?;

    interrupt.uncut(|| destination.prepare(Manifest::NAME))?;
    let casting = || cast_and_write(&job, &scene, &tracer, &destination, &interrupt);
    let (seen, outputs, cast, write) = terminal.with_progress(plan.rays, interrupt.progress(), casting)?;

    let manifest = Manifest {
        job: &job.resolved,
        seed: job.seed,
        inputs: &inputs(args, &job)?,
        scene: &scene,
        outputs: &outputs,
    };
    interrupt.check()?;
    interrupt.uncut(|| destination.write(Manifest::NAME, &manifest.encode()))?;

    for output in &outputs {
        terminal.detail(format_args!(
            "wrote {} ({}, BLAKE3 {})",
            output.path,
            Bytes(output.bytes),
            output.blake3
        ));
    }
    let times = Times { load, build, cast, write };
    terminal.say(summary(&job, &seen, &outputs, &times).trim_end());
    if args.json {
        terminal.data(&format!("{:#}\n", summary_as_json(&job, &seen, &outputs, &times)))?;
    }
    Ok(())
}

fn load_job(args: &Args, terminal: &Terminal) -> Result<Job, Error> {
    let mut job = args.job.load(terminal)?;
    job.output.dir = pipeline::tidy(args.out.as_ref().unwrap_or(&job.output.dir));
    if let Some(seed) = args.seed {
        job.seed = seed;
        if let Some(resolved) = job.resolved.as_object_mut() {
            resolved.insert("seed".into(), seed.into());
        }
    }
    if let Some(warning) = pipeline::precision_warning(&job) {
        terminal.warn(warning);
    }
    Ok(job)
}

type Seen = (Vec<Statistics>, Vec<WrittenFile>, Duration, Duration);

/// One sensor after the other, so that only one frame is in memory. Gives the times of casting and of writing apart.
fn cast_and_write(
    job: &Job,
    scene: &Scene,
    tracer: &AnyTracer,
    destination: &Destination,
    interrupt: &Interrupt,
) -> Result<Seen, Error> {
    let (mut seen, mut outputs) = (Vec::new(), Vec::new());
    let (mut casting, mut writing) = (Duration::ZERO, Duration::ZERO);
    for mounted in &job.sensors {
        let (frame, time) = timed(|| pipeline::cast(job, mounted, scene, tracer, interrupt.progress()));
        casting += time;
        interrupt.check()?;
        let Some(frame) = frame else { continue };
        seen.push(Statistics::of(&frame));
        let sensor_frame = pipeline::sensor_frame(job, mounted, &frame);
        let start = Instant::now();
        for &format in &job.output.formats {
            let name = output_name(&mounted.name, format);
            let content = format.encode(&sensor_frame);
            let content = content.map_err(|e| Error::output(job.output.dir.join(&name), e))?;
            interrupt.check()?;
            outputs.push(interrupt.uncut(|| destination.write(&name, &content))?);
        }
        writing += start.elapsed();
    }
    Ok((seen, outputs, casting, writing))
}

/// The job's and the sensors' files, as the manifest lists them.
fn inputs(args: &Args, job: &Job) -> Result<Vec<SourceFile>, Error> {
    let file = |name: &str, content: &[u8]| SourceFile {
        name: name.to_owned(),
        bytes: content.len() as u64,
        blake3: blake3::hash(content).to_hex().to_string(),
    };
    let path = args.job.path();
    let text =
        fs::read(path).map_err(|e| Error::Usage(format!("{}: can't be read again: {e}", path.display())))?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let sensors = job.sensor_files.iter().map(|(name, text)| file(name, text.as_bytes()));
    let rays = job.ray_files.iter().map(|f| SourceFile {
        name: f.name.clone(),
        bytes: f.bytes,
        blake3: f.blake3.clone(),
    });
    Ok([file(&name, &text)].into_iter().chain(sensors).chain(rays).collect())
}

/// What a sensor saw, in short.
struct Statistics {
    /// Pixels that have a ray.
    rays: usize,
    /// Pixels that have none: the lens's or the prisms' model ends before them.
    blind: usize,
    hits: usize,
    /// Least, mean and largest range in metres, of any returns.
    range_m: Option<[f64; 3]>,
}

impl Statistics {
    fn of(frame: &Frame) -> Self {
        let ranges = frame.iter().map(|(_, hit)| hit.range_m);
        let blind = frame.blind_pixels();
        let (mut hits, mut low, mut sum, mut high) = (0, f64::INFINITY, 0.0, 0.0_f64);
        for range in ranges {
            (hits, low, sum, high) = (hits + 1, low.min(range), sum + range, high.max(range));
        }
        let range_m = (hits > 0).then(|| [low, sum / hits as f64, high]);
        Self { rays: frame.pixels() - blind, blind, hits, range_m }
    }
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
        if s.blind > 0 {
            let _ = write!(text, ", {} pixels without a ray", s.blind);
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
    let _ = writeln!(text, "wrote {count} files, {}, to {}", Bytes(written), job.output.dir.display());
    let [load, build, cast, write] =
        [times.load, times.build, times.cast, times.write].map(|t| t.as_secs_f64());
    let speed = rays_per_s(seen, times.cast) / 1e6;
    let _ = writeln!(
        text,
        "load {load:.3} s, build {build:.3} s, cast {cast:.3} s ({speed:.2} million rays/s), write {write:.3} s"
    );
    text
}

fn summary_as_json(job: &Job, seen: &[Statistics], outputs: &[WrittenFile], times: &Times) -> Value {
    let sensor = |(name, s): (&str, &Statistics)| {
        let range = |i: usize| s.range_m.map(|range| range[i]);
        json!({
            "name": name,
            "rays": s.rays,
            "hits": s.hits,
            "pixels_without_ray": s.blind,
            "range_min_m": range(0),
            "range_mean_m": range(1),
            "range_max_m": range(2),
        })
    };
    let names = job.sensors.iter().map(|s| s.name.as_str());
    let output = |o: &WrittenFile| json!({ "path": o.path, "bytes": o.bytes, "blake3": o.blake3 });
    json!({
        "dir": job.output.dir.to_string_lossy(),
        "sensors": names.zip(seen).map(sensor).collect::<Vec<_>>(),
        "outputs": outputs.iter().map(output).collect::<Vec<_>>(),
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
    destination: &Destination,
) -> Result<(), Error> {
    let outputs = destination.paths().map(|path| path.to_string_lossy().into_owned());
    if args.json {
        let sensor = |s: &crate::config::MountedSensor| {
            let pattern = &s.sensor.pattern;
            json!({ "name": s.name, "rows": pattern.rows(), "columns": pattern.columns(), "rays": pattern.rays() })
        };
        let plan = json!({
            "sensors": job.sensors.iter().map(sensor).collect::<Vec<_>>(),
            "rays": plan.rays,
            "memory_bytes": plan.bytes,
            "triangles": scene.triangle_count(),
            "outputs": outputs.collect::<Vec<_>>(),
        });
        return terminal.data(&format!("{plan:#}\n"));
    }
    let mut text = String::new();
    for s in &job.sensors {
        let pattern = &s.sensor.pattern;
        let (rows, columns) = (pattern.rows(), pattern.columns());
        let _ = writeln!(text, "{}: {rows} × {columns} = {} rays", s.name, pattern.rays());
    }
    let triangles = scene.triangle_count();
    let _ = writeln!(text, "scene: {triangles} triangles, {} instances", scene.geometry.objects.len());
    let _ = writeln!(text, "memory for frames: at most {}", Bytes(plan.bytes));
    let _ = writeln!(text, "would write:");
    for output in outputs {
        let _ = writeln!(text, "  {output}");
    }
    terminal.data(&text)
}

fn timed<T>(work: impl FnOnce() -> T) -> (T, Duration) {
    let start = Instant::now();
    let result = work();
    (result, start.elapsed())
}
