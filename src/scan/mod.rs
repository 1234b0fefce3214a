//! Scanning: the pulses of a capture and a scene give returns. Only this room knows both. It splits its work over rayon's
//! threads.

mod alone;
mod depth;
mod effects;
mod explain;
mod frame;
mod ideal;
mod measured;
mod optics;
mod progress;
mod ray_batch;
mod story;
mod strips;
mod sunlight;
mod surface;
mod through;
mod waveforms;

use crate::scene::Scene;
use crate::sensor::Capture;
use crate::trace::Cast;

pub use alone::alone;
pub use explain::explain;
pub use frame::{Cause, Echo, Frame, Images, NO_OBJECT, Return, Returns, Terms};
pub use progress::Progress;
pub use story::{Counts, Fate, Met, Sent, Signal, SignalPeak, SignalUnit, Story};
pub use waveforms::Waveforms;

/// Casts every pulse of a capture, each from the sensor's pose at the pulse's own time. What moves in the scene is hit where it is at
/// that time, if the scene is arranged for the capture ([`Scene::during`](crate::scene::Scene::during) its
/// [window](Capture::window)). `None` if `progress.cancelled` was set before the end.
///
/// A pulse goes on through holes, and a share of it through panes. The module `through` defines the surface that is reported then.
///
/// The scan runs on rayon's current thread pool. The frame is the same for any number of threads.
pub fn scan(scene: &Scene, tracer: &impl Cast, capture: &Capture, progress: &Progress) -> Option<Frame> {
    let mut frame = Frame::default();
    scan_into(&mut frame, scene, tracer, capture, progress).then_some(frame)
}

/// Casts every pulse of a capture as [`scan`] does, into the memory of an earlier frame, which it replaces. A run of many
/// frames takes its memory once. Returns false if `progress.cancelled` was set before the end; the frame is then of no use.
pub fn scan_into(
    frame: &mut Frame,
    scene: &Scene,
    tracer: &impl Cast,
    capture: &Capture,
    progress: &Progress,
) -> bool {
    capture.prepare();
    let measurement = &capture.sensor.measurement;
    match &measurement.depth {
        Some(sensing) => depth::scan_into(frame, scene, tracer, capture, sensing, progress),
        None if !measurement.is_ideal() => measured::scan_into(frame, scene, tracer, capture, progress),
        None => ideal::scan_ideal(frame, scene, tracer, capture, progress, |_, _| ()).is_some(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle::Angle;
    use crate::frame::Pose;
    use crate::motion::Trajectory;
    use crate::scene::{Material, SceneBuilder, SourceInstance, SourceMesh, SourcePart};
    use crate::sensor::{Camera, Pattern, RangeLimits, RingOrder, Sensor};
    use crate::trace::Tracer;
    use glam::{DVec3, Vec3};
    use std::sync::atomic::Ordering::Relaxed;

    /// The scene is a wall of reflectivity ½, two metres ahead of a camera, seen from behind its triangles.
    #[test]
    fn a_return_tells_of_the_surface() {
        let wall = SourceMesh {
            positions: vec![[2.0, -9.0, -9.0], [2.0, 9.0, -9.0], [2.0, 0.0, 9.0]],
            parts: vec![SourcePart { triangles: vec![[0, 1, 2]], material: 0, ..SourcePart::default() }],
        };
        let material =
            Material { base_color: [0.5, 0.5, 0.5, 1.0], job_label: Some(7), ..Material::default() };
        let placed = SourceInstance {
            mesh: 0,
            world_from_mesh: glam::DAffine3::IDENTITY,
            ..SourceInstance::default()
        };
        let builder = SceneBuilder {
            meshes: vec![wall],
            instances: vec![placed],
            materials: vec![material],
            files: vec![],
            groups: vec![],
        };
        let scene = builder.build().unwrap();
        let camera = Camera::from_hfov((33, 33), Angle::deg(60.0), None).unwrap();
        let range = RangeLimits { min_m: 0.5, max_m: 2.2, ..RangeLimits::default() };
        let sensor = Sensor {
            pattern: Pattern::Camera(camera),
            range,
            ring: RingOrder::Row,
            measurement: Default::default(),
        };
        // The camera is turned upside down, and reports in its own frame.
        let pose = Pose::from_rpy(DVec3::ZERO, Angle::deg(180.0), Angle::default(), Angle::default());
        let progress = Progress::default();
        let trajectory = Trajectory::Fixed(pose);
        let capture = Capture::new(&sensor, Pose::IDENTITY, &trajectory, 0, 0);
        let frame = scan(&scene, &Tracer::build(&scene), &capture, &progress).unwrap();
        assert_eq!(progress.rays_done.load(Relaxed), 33 * 33);
        let middle = frame.get(16, 16).unwrap();
        assert!((middle.range_m - 2.0).abs() < 1e-15);
        assert!(Vec3::from_array(middle.normal).abs_diff_eq(Vec3::NEG_X, 1e-7));
        assert!((middle.intensity - 0.5).abs() < 1e-6);
        assert_eq!((middle.label, middle.instance, middle.triangle), (7, 0, 0));
        let cos = capture.pulse(16, 20).unwrap().direction.x;
        let aside = frame.get(16, 20).unwrap();
        assert!((aside.range_m - 2.0 / cos).abs() < 1e-14);
        assert!((f64::from(aside.intensity) - 0.5 * cos).abs() < 1e-6);
        // The corners lie beyond the sensor's range.
        assert!(frame.get(0, 0).is_none() && 2.0 / capture.pulse(0, 0).unwrap().direction.x > 2.2);
        assert_eq!(frame.causes()[0], Cause::OutOfRange);

        // The memory of a frame of another size, every pixel of which had a return, gives the same frame.
        let other =
            Sensor::new(Pattern::Camera(Camera::from_hfov((70, 50), Angle::deg(10.0), None).unwrap()));
        let mut again = scan(&scene, &Tracer::build(&scene), &Capture::at_origin(&other), &progress).unwrap();
        assert_eq!(again.return_count(), 70 * 50);
        assert!(scan_into(&mut again, &scene, &Tracer::build(&scene), &capture, &progress));
        assert_eq!(again, frame);

        progress.cancelled.store(true, Relaxed);
        assert!(scan(&scene, &Tracer::build(&scene), &capture, &progress).is_none());
    }
}
