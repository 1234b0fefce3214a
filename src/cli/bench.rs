//! `beamcast bench`: times a job and leaves no files.

use std::num::NonZeroU16;
use std::ops::Range;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Instant;

use serde_json::json;

use super::end_to_end;
use super::job::{JobArgs, load_scene};
use super::json;
use super::parts;
use super::terminal::Terminal;
use super::threads;
use crate::error::Error;
use crate::run::{Bytes, Holding, Item, Plan, Selection, Session, memory};
use crate::scan::{Frame, Progress};
use crate::trace::AnyTracer;
use crate::trace::{Cast, Hit, Rays, TraversalStats};

/// The arguments of `beamcast bench`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    job: JobArgs,
    /// Build and cast this many times; the times shown are medians
    #[arg(long, value_name = "N", default_value = "5")]
    repeat: NonZeroU16,
    /// Write the frames too, to a scratch folder that is removed, and tell what each stage costs by itself, how fast they are
    /// together and what bounds them; --repeat chooses the frames of which the stages are timed
    #[arg(long)]
    end_to_end: bool,
    /// Cast and write only these frames, counted from 0: A..B (without B), A.., ..B, or one number
    #[arg(long, value_name = "A..B", value_parser = parts::frames, requires = "end_to_end")]
    frames: Option<Range<u64>>,
    /// Make the scratch folder in this one [default: where the job writes, because disks differ]
    #[arg(long, value_name = "DIR", requires = "end_to_end")]
    scratch: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

impl Args {
    /// The threads to work on.
    pub fn threads(&self) -> threads::Args {
        self.job.threads
    }
}

/// Times a job: loads it once, and builds its tracer and casts all its frames `--repeat` times; or runs it from end to end.
///
/// # Errors
/// The errors of the job and the scene; [`Error::Usage`] if they do not fit into the machine's memory.
pub fn run(args: &Args, terminal: &Terminal) -> Result<(), Error> {
    let mut job = args.job.load(terminal)?;
    if args.end_to_end {
        let frames = args.frames.clone().unwrap_or(Selection::ALL.frames);
        let settings = end_to_end::Settings {
            selection: Selection { frames, ..Selection::ALL },
            scratch: args.scratch.as_deref(),
            samples: args.repeat.get().into(),
            scenes: &args.job.scenes,
            json: args.json,
        };
        return end_to_end::run(job, settings, terminal);
    }
    let plan = Plan::of(&job, &Selection::FIRST, Holding::Frame)?;
    let start = Instant::now();
    let scene = load_scene(&mut job, &args.job.scenes, terminal)?.scene;
    let job = Arc::new(job);
    let load_s = start.elapsed().as_secs_f64();
    plan.check_scene(&scene)?;

    let repeat = usize::from(args.repeat.get());
    let (mut builds, mut casts, mut tracer_bytes) = (Vec::new(), Vec::new(), 0);
    let (mut effort, mut of_samples) = (None, None);
    let progress = Progress::default();
    terminal.with_progress(plan.rays.saturating_mul(repeat as u64), &progress, || {
        // A run of many frames casts them into the same memory, and so does this.
        let mut frame = Frame::default();
        for _ in 0..repeat {
            let start = Instant::now();
            let tracer = AnyTracer::build(&scene, job.kernel);
            builds.push(start.elapsed().as_secs_f64());
            tracer_bytes = tracer.bytes();
            let session = Session::new(Arc::clone(&job), tracer.clone());
            let start = Instant::now();
            for item in plan.items(&job) {
                session.cast_into(&mut frame, &item, &progress);
            }
            casts.push(start.elapsed().as_secs_f64());
            if effort.is_none() {
                let sum = Mutex::default();
                for item in plan.items(&job) {
                    let tracer = session.frame_tracer(&item);
                    let counting = Counting { tracer: &tracer, effort: &sum };
                    session.cast_with(tracer.scene(), &counting, &item, &Progress::default());
                }
                effort = sum.into_inner().ok().flatten();
            }
            if of_samples.is_none() && job.sensors.iter().any(|s| !s.sensor.measurement.is_ideal()) {
                of_samples = Some(Samples::of(&session, plan.items(&job)));
            }
        }
    });

    let (build_s, cast_s) = (median(&mut builds), median(&mut casts));
    let rays_per_s = plan.rays as f64 / cast_s;
    let threads = rayon::current_num_threads();
    let triangles = scene.triangle_count();
    let bytes_per_triangle = tracer_bytes as f64 / scene.geometry.stored_triangle_count() as f64;
    let peak_rss_bytes = memory::peak();
    if args.json {
        let report = json!({
            "load_s": load_s,
            "build_s": build_s,
            "cast_s": cast_s,
            "rays": plan.rays,
            "rays_per_s": rays_per_s,
            "samples": of_samples.map(|samples| json!({
                "count": samples.count,
                "per_s": samples.per_s(),
                "tracer_share": samples.tracer_share(),
            })),
            "threads": threads,
            "triangles": triangles,
            "bytes_per_triangle": bytes_per_triangle,
            "peak_rss_bytes": peak_rss_bytes,
            "effort": effort.map(|e| json!({
                "nodes": e.nodes,
                "leaves": e.leaves,
                "tests": e.tests,
                "in_f64": e.in_f64,
                "exactly": e.exactly,
            })),
        });
        return terminal.json(&json::BENCH.of(report));
    }
    let peak = peak_rss_bytes.map_or_else(|| "unknown".to_owned(), |bytes| Bytes(bytes).to_string());
    terminal.data(&format!(
        "load      {load_s:.4} s\n\
         build     {build_s:.4} s for {triangles} triangles, {bytes_per_triangle:.1} bytes for each that is stored\n\
         cast      {cast_s:.4} s for {} rays on {threads} threads: {:.2} million rays/s\n\
         memory    {peak} at most\n",
        plan.rays,
        rays_per_s / 1e6
    ))?;
    if let Some(samples) = of_samples {
        terminal.data(&format!(
            "samples   {} of the beams that have a width, noise or a receiver: {:.2} million samples/s, the tracer's part of the time {:.0} %\n",
            samples.count,
            samples.per_s() / 1e6,
            100.0 * samples.tracer_share()
        ))?;
    }
    let Some(effort) = effort else { return Ok(()) };
    let per_ray = |count: u64| count as f64 / plan.rays.max(1) as f64;
    terminal.data(&format!(
        "effort    a ray: {:.3} nodes and {:.3} leaves (each for up to 128 rays), {:.2} triangles tested\n\
         decided   {} of {} tests in f64, {} of these exactly\n",
        per_ray(effort.nodes),
        per_ray(effort.leaves),
        per_ray(effort.tests),
        effort.in_f64,
        effort.tests,
        effort.exactly
    ))
}

/// The samples of sensors that are not ideal, and the time that they take.
#[derive(Clone, Copy)]
struct Samples {
    count: u64,
    /// The time that all threads have, in seconds.
    all_s: f64,
    /// The part of it that the tracer takes.
    tracer_s: f64,
    threads: usize,
}

impl Samples {
    fn of(session: &Session, items: impl Iterator<Item = Item>) -> Self {
        let (nanoseconds, progress) = (AtomicU64::new(0), Progress::default());
        let start = Instant::now();
        for item in items {
            let tracer = session.frame_tracer(&item);
            let timing = Timing { tracer: &tracer, nanoseconds: &nanoseconds };
            session.cast_with(tracer.scene(), &timing, &item, &progress);
        }
        let threads = rayon::current_num_threads();
        Self {
            count: progress.samples_done.into_inner(),
            all_s: start.elapsed().as_secs_f64() * threads as f64,
            tracer_s: nanoseconds.into_inner() as f64 * 1e-9,
            threads,
        }
    }

    fn per_s(&self) -> f64 {
        self.count as f64 * self.threads as f64 / self.all_s
    }

    fn tracer_share(&self) -> f64 {
        self.tracer_s / self.all_s
    }
}

/// Adds up the time of a tracer's casts.
struct Timing<'t> {
    tracer: &'t AnyTracer,
    nanoseconds: &'t AtomicU64,
}

impl Cast for Timing<'_> {
    fn cast(&self, rays: &Rays, hits: &mut [Option<Hit>]) {
        let start = Instant::now();
        self.tracer.cast(rays, hits);
        self.nanoseconds.fetch_add(start.elapsed().as_nanos() as u64, Ordering::Relaxed);
    }
}

/// Adds up the statistics of a tracer's casts, if it counts any.
struct Counting<'t> {
    tracer: &'t AnyTracer,
    effort: &'t Mutex<Option<TraversalStats>>,
}

impl Cast for Counting<'_> {
    fn cast(&self, rays: &Rays, hits: &mut [Option<Hit>]) {
        let effort = self.tracer.cast_counted(rays, hits);
        if let (Some(effort), Ok(mut sum)) = (effort, self.effort.lock()) {
            *sum.get_or_insert_default() += effort;
        }
    }
}

/// The median: the middle of the times, or the mean of the two in the middle if their number is even.
fn median(times: &mut [f64]) -> f64 {
    times.sort_by(f64::total_cmp);
    let (low, high) = (times[(times.len() - 1) / 2], times[times.len() / 2]);
    (low + high) / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_median_is_in_the_middle() {
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&mut [4.0, 1.0, 2.0, 3.0]), 2.5);
        assert_eq!(median(&mut [7.0]), 7.0);
    }
}
