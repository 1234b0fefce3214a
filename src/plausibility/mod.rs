//! Jobs that can be run and are probably not what was meant, told by how they fit their scene.
//!
//! ```text
//! stance  where a sensor stands and looks, in words
//! size    scenes of another unit, or that lie on their side
//! bending meshes that bend by too much while they are taken to have one shape
//! sight   sensors that stand inside, below or far outside of things, or look at nothing
//! ```
//!
//! Each rule is a function of a job and its scene: nothing here opens a file, and nothing prints. Rules that need no scene are in
//! `config`, where the values are read. A rule costs a few dozen rays; only where all of them go astray are more cast.

mod bending;
mod sight;
mod size;
mod stance;

use crate::config::Job;
use crate::frame::Pose;
use crate::output::{CloudFrame, Content, Format};
use crate::scene::{Extent, Scene};
use crate::sensor::Capture;
use crate::source::words::joined;
use crate::source::{Diagnostic, Doubt, Place};
use crate::trace::Cast;

pub use stance::Stance;

/// The warnings about a scene alone.
pub fn of_scene(extent: Extent, place: &Place) -> Vec<Diagnostic> {
    size::doubts(extent).into_iter().map(|doubt| doubt.at(place)).collect()
}

/// The warnings about formats that can't hold all that sensors may see. What a format loses of several sensors is told once.
fn of_formats(job: &Job) -> Vec<Diagnostic> {
    let mut found = Vec::new();
    for (format, place) in job.output.formats.iter().zip(&job.places.formats) {
        let mut problems: Vec<(String, Vec<String>)> = Vec::new();
        for mounted in &job.sensors {
            let Some(problem) = format.loses(&mounted.sensor) else { continue };
            let name = format!("{:?}", mounted.name);
            match problems.iter_mut().find(|(known, _)| *known == problem) {
                Some((_, sensors)) => sensors.push(name),
                None => problems.push((problem, vec![name])),
            }
        }
        for (problem, sensors) in problems {
            let of = if sensors.len() == 1 { "sensor" } else { "sensors" };
            let message = format!("{} of {of} {}: {problem}", format.name(), joined(&sensors, "and"));
            found.push(Doubt::new("format-loses", "output.formats", message).at(place));
        }
    }
    found
}

/// Whether the files of a format have points in 32-bit coordinates.
fn has_points(format: &Format) -> bool {
    matches!(format.spec.content, Content::Points(_) | Content::Files(_))
}

/// The warning about points in 32-bit coordinates, if they come in steps of more than a millimetre.
fn of_clouds(job: &Job) -> Option<Diagnostic> {
    const COARSE_M: f32 = 1e-3;
    let mut formats = job.output.formats.iter().zip(&job.places.formats);
    let is_coarse = |format: &Format| has_points(format) && !format.spec.has_even_steps;
    let (format, place) = formats.find(|(format, _)| is_coarse(format))?;
    let poses = job.sensors.iter().map(|mounted| match job.output.cloud_frame {
        CloudFrame::Sensor => Pose::IDENTITY,
        CloudFrame::Body => mounted.body_from_sensor,
        CloudFrame::World => {
            Capture::new(&mounted.sensor, mounted.body_from_sensor, &job.trajectory, 0, job.seed)
                .world_from_sensor(0.0)
        }
    });
    let farthest = poses.map(|pose| pose.translation.abs().max_element()).fold(0.0, f64::max) as f32;
    let step = farthest.next_up() - farthest;
    (step > COARSE_M).then(|| {
        let message = format!(
            "points of {} lie {farthest} m from the origin, where 32-bit coordinates come in steps of {} mm",
            format.name(),
            step * 1e3
        );
        Doubt::new("coarse-cloud", "output.frame", message)
            .help("`frame = \"sensor\"` in `[output]` keeps them exact")
            .at(place)
    })
}

/// The warning about clouds of a whole run whose points are in frames that differ from each other: those of several sensors, or of
/// a sensor or a body that moves.
fn of_merged_clouds(job: &Job) -> Option<Diagnostic> {
    let mut formats = job.output.formats.iter().zip(&job.places.formats);
    let is_merged = |format: &Format| format.spec.merges_clouds && format.is_of_run();
    let (format, place) = formats.find(|(format, _)| is_merged(format))?;
    let moves = job.trajectory.fixed_pose().is_none();
    let frame = match job.output.cloud_frame {
        CloudFrame::Sensor if moves || job.sensors.len() > 1 => "its sensor's own frame",
        CloudFrame::Body if moves => "the frame of a body that moves",
        _ => return None,
    };
    let message = format!(
        "the file of all frames, run.{}, has the points of each in {frame}, so that they do not fit each other",
        format.ending()
    );
    let doubt = Doubt::new("merged-clouds", "output.frame", message);
    Some(doubt.help("`frame = \"world\"` in `[output]` makes one cloud of them").at(place))
}

/// The warnings about a job in its scene, which the tracer casts at: sensor by sensor, then the expectations.
pub fn of_job(job: &Job, scene: &Scene, tracer: &impl Cast) -> Vec<Diagnostic> {
    let extent = scene.extent();
    let mut found = of_scene(extent, &job.places.scene);
    for (mounted, place) in job.sensors.iter().zip(&job.places.sensors) {
        let doubts = sight::doubts(mounted, &job.trajectory, scene, extent, tracer);
        found.extend(doubts.into_iter().map(|doubt| doubt.at(place)));
        found.extend(bending::doubt(mounted, job, scene).map(|doubt| doubt.at(place)));
    }
    found.extend(of_formats(job));
    found.extend(of_clouds(job));
    found.extend(of_merged_clouds(job));
    for (expectation, place) in job.expectations.iter().zip(&job.places.expectations) {
        if let Some(problem) = expectation.what.missing(scene) {
            let message = format!("`{}` expects something of what is not there: {problem}", expectation.name);
            found.push(Doubt::new("unknown-object", "expect", message).at(place));
        }
    }
    found
}
