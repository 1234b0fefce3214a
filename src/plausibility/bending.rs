//! Meshes that bend by too much while they are taken to have one shape.

use crate::config::{Job, MountedSensor};
use crate::scene::Scene;
use crate::sensor::Capture;
use crate::source::Doubt;

/// The distance that is told of.
const LEAST_M: f64 = 1e-3;

/// The most frames of a sensor that are looked at.
const MOST_FRAMES: u64 = 8;

/// A warning that meshes bend within the slices of a sensor's frames. It looks at some frames, the first among them.
pub(super) fn doubt(mounted: &MountedSensor, job: &Job, scene: &Scene) -> Option<Doubt> {
    if job.sequence.is_frozen || scene.geometry.movers.iter().all(|mover| mover.deformer.is_none()) {
        return None;
    }
    let MountedSensor { name, sensor, body_from_sensor, trigger_s, .. } = mounted;
    let frames = job.sequence.frames_of(sensor);
    let looked_at = frames.min(MOST_FRAMES);
    let slicing = (0..looked_at).filter_map(|number| {
        let frame = (u128::from(number) * u128::from(frames) / u128::from(looked_at)) as u64;
        let capture = Capture::new(sensor, *body_from_sensor, &job.trajectory, frame, job.seed)
            .in_sequence(job.sequence.start_s + trigger_s, false);
        Some((frame, scene.slicing(capture.window(), job.sequence.slice_s)?))
    });
    let worst = slicing.max_by(|(_, a), (_, b)| a.distance_m.total_cmp(&b.distance_m));
    let (frame, worst) = worst.filter(|(_, worst)| worst.distance_m > LEAST_M)?;
    let object = &scene.geometry.objects[worst.object as usize].name;
    let message = format!(
        "{object:?} bends by up to {:.1} mm away from the shape that it has for frame {frame} of sensor {name:?}",
        worst.distance_m * 1e3
    );
    let doubt = Doubt::new("bending", "sequence", message);
    Some(
        doubt
            .help("`slice_s` in [sequence], the time for which a shape is kept, makes it smaller".to_owned()),
    )
}
