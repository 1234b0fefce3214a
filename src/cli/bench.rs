//! `beamcast bench`: times a job, writing nothing.

use std::num::NonZeroU16;
use std::time::Instant;

use serde_json::json;

use super::pipeline::{self, Bytes, JobArgs, Plan};
use super::terminal::Terminal;
use crate::error::Error;
use crate::scan::Progress;
use crate::trace::kernel::Caster;

/// The arguments of `beamcast bench`.
#[derive(Debug, clap::Args)]
pub struct Args {
    #[command(flatten)]
    job: JobArgs,
    /// Build and cast this often; the times are medians
    #[arg(long, value_name = "N", default_value = "5")]
    repeat: NonZeroU16,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Times a job: loading once, building and casting all its sensors `--repeat` times.
///
/// # Errors
/// Of the job and the scene.
pub fn run(args: &Args, terminal: &Terminal) -> Result<(), Error> {
    let job = args.job.load(terminal)?;
    let plan = Plan::of(&job)?;
    let start = Instant::now();
    let scene = pipeline::load_scene(&job, terminal)?;
    let load_s = start.elapsed().as_secs_f64();

    let repeat = usize::from(args.repeat.get());
    let (mut builds, mut casts, mut tracer_bytes) = (Vec::new(), Vec::new(), 0);
    let progress = Progress::default();
    terminal.with_progress(plan.rays.saturating_mul(repeat as u64), &progress, || {
        for _ in 0..repeat {
            let start = Instant::now();
            let tracer = Caster::build(&scene, job.kernel);
            builds.push(start.elapsed().as_secs_f64());
            tracer_bytes = tracer.bytes();
            let start = Instant::now();
            for sensor in &job.sensors {
                pipeline::cast(&job, sensor, &scene, &tracer, &progress);
            }
            casts.push(start.elapsed().as_secs_f64());
        }
    });

    let (build_s, cast_s) = (median(&mut builds), median(&mut casts));
    let rays_per_s = plan.rays as f64 / cast_s;
    let threads = rayon::current_num_threads();
    let triangles = scene.triangle_count();
    let bytes_per_triangle = tracer_bytes as f64 / scene.stored_triangle_count() as f64;
    let peak_rss_bytes = pipeline::peak_memory();
    if args.json {
        let report = json!({
            "load_s": load_s,
            "build_s": build_s,
            "cast_s": cast_s,
            "rays": plan.rays,
            "rays_per_s": rays_per_s,
            "threads": threads,
            "triangles": triangles,
            "bytes_per_triangle": bytes_per_triangle,
            "peak_rss_bytes": peak_rss_bytes,
        });
        return terminal.data(&format!("{report:#}\n"));
    }
    let peak = peak_rss_bytes.map_or_else(|| "unknown".to_owned(), |bytes| Bytes(bytes).to_string());
    terminal.data(&format!(
        "load      {load_s:.4} s\n\
         build     {build_s:.4} s for {triangles} triangles, {bytes_per_triangle:.1} bytes for each that is stored\n\
         cast      {cast_s:.4} s for {} rays on {threads} threads: {:.2} million rays/s\n\
         memory    {peak} at most\n",
        plan.rays,
        rays_per_s / 1e6
    ))
}

/// The middle of the times, of an even number the mean of the two in the middle.
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
