//! Scanning: the pulses of a capture and a scene give returns. Only this room knows both. It splits its work over rayon's
//! threads.

mod alone;
mod depth;
mod effects;
mod explain;
mod frame;
mod measured;
mod optics;
mod progress;
mod ray_batch;
mod story;
mod strips;
mod surface;
mod through;
mod waveforms;

use std::cmp::Ordering;
use std::sync::atomic::Ordering::Relaxed;

use rayon::prelude::*;

use crate::scene::Scene;
use crate::sensor::{Capture, Pulse};
use crate::trace::{Cast, Hit};

pub use alone::alone;
pub use explain::explain;
use frame::ReturnsMut;
pub use frame::{Cause, Echo, Frame, Images, NO_OBJECT, Return, Returns, Terms};
pub use progress::Progress;
use ray_batch::{Ray, RayBatch};
pub use story::{Counts, Fate, Met, Sent, Signal, SignalPeak, SignalUnit, Story};
use strips::{STRIP, SensorPose, TILE};
use surface::SeenTriangle;
use through::Through;
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
        None => scan_ideal(frame, scene, tracer, capture, progress, |_, _| ()).is_some(),
    }
}

/// Casts every pulse of a capture as an ideal sensor does. `also` is asked of each strip, with its rays and hits, and its answers
/// come back strip by strip. `None` if `progress.cancelled` was set before the end.
fn scan_ideal<T: Send>(
    frame: &mut Frame,
    scene: &Scene,
    tracer: &impl Cast,
    capture: &Capture,
    progress: &Progress,
    also: impl Fn(&Strip, &Batch) -> T + Sync,
) -> Option<Vec<T>> {
    frame.set_size(capture.rows(), capture.columns());
    let fixed = capture.fixed_world_from_sensor().map(SensorPose::new);
    let scanner = Scanner { scene, tracer, capture, fixed, is_see_through: scene.is_see_through() };
    let fill = |batch: &mut Batch, mut strip: Strip| {
        if progress.cancelled.load(Relaxed) {
            return None;
        }
        let rays = scanner.fill(&mut strip, batch);
        progress.rays_done.fetch_add(rays as u64, Relaxed);
        Some(also(&strip, batch))
    };
    strips(frame).into_par_iter().map_init(Batch::default, fill).collect()
}

/// A part of the image that is cast as one batch.
struct Strip<'f> {
    first_row: usize,
    first_column: usize,
    /// The strip's part of each of its rows.
    rows: Vec<Piece<'f>>,
}

impl Strip<'_> {
    /// The number of a ray's pixel in an image of so many columns.
    fn pixel(&self, batch: &Batch, ray: usize, columns: usize) -> u32 {
        let (row, column) = batch.rays.known()[ray];
        ((self.first_row + usize::from(row)) * columns + self.first_column + usize::from(column)) as u32
    }
}

/// A run of pixels of one row.
struct Piece<'f> {
    returns: ReturnsMut<'f>,
    causes: &'f mut [Cause],
}

/// Cuts a frame into strips. Each strip has its own part of the image to write to.
fn strips(frame: &mut Frame) -> Vec<Strip<'_>> {
    let columns = frame.columns();
    let mut strips = Vec::new();
    let (mut returns, causes) = frame.parts();
    for (band_index, band) in causes.chunks_mut(TILE.0 * columns).enumerate() {
        let first_strip = strips.len();
        for row in band.chunks_mut(columns) {
            for (index, causes) in row.chunks_mut(STRIP).enumerate() {
                if strips.len() == first_strip + index {
                    let (first_row, first_column) = (band_index * TILE.0, index * STRIP);
                    strips.push(Strip { first_row, first_column, rows: Vec::with_capacity(TILE.0) });
                }
                let returns = returns.take(causes.len());
                strips[first_strip + index].rows.push(Piece { returns, causes });
            }
        }
    }
    strips
}

/// The rays and hits of a strip. The memory is kept from strip to strip.
#[derive(Default)]
struct Batch {
    /// The rays with the row and the column of their pixels in the strip. A pixel without a pulse has no ray.
    rays: RayBatch<(u8, u8)>,
    /// The sensor's pose for each ray, if the sensor moves.
    poses: Vec<SensorPose>,
    /// The pulse of each ray, if the sensor needs more than the length of a ray to say what it reports of a hit.
    pulses: Vec<Pulse>,
    hits: Vec<Option<Hit>>,
    /// The surfaces that are seen through holes and panes.
    through: Through,
}

struct Scanner<'a, C> {
    scene: &'a Scene,
    tracer: &'a C,
    capture: &'a Capture<'a>,
    /// The sensor's pose, if it stands still.
    fixed: Option<SensorPose>,
    /// Whether something in the scene lets light pass.
    is_see_through: bool,
}

impl<C: Cast> Scanner<'_, C> {
    /// Casts the pulses of a strip and writes the returns. Returns the number of rays.
    fn fill(&self, strip: &mut Strip, batch: &mut Batch) -> usize {
        let Batch { rays, poses, pulses, hits, through } = batch;
        rays.clear();
        poses.clear();
        pulses.clear();
        let keeps_pulses = !self.capture.sensor.judges_by_length();
        let width = strip.rows[0].causes.len();
        for first in (0..width).step_by(TILE.1) {
            for row in 0..strip.rows.len() {
                for column in first..width.min(first + TILE.1) {
                    let pulse = self.capture.pulse(strip.first_row + row, strip.first_column + column);
                    let Some(pulse) = pulse else {
                        strip.rows[row].set(column, None, Cause::NoPulse);
                        continue;
                    };
                    let pose = match &self.fixed {
                        Some(pose) => pose,
                        None => poses.push_mut(SensorPose::new(self.capture.world_from_sensor(pulse.time_s))),
                    };
                    let ray = Ray {
                        origin: pose.world_from_sensor.point(pulse.origin),
                        direction: pose.world_from_sensor.direction(pulse.direction),
                        time_s: self.capture.cast_at_s(pulse.time_s),
                    };
                    rays.push((row as u8, column as u8), ray, None);
                    if keeps_pulses {
                        pulses.push(pulse);
                    }
                }
            }
        }
        // The limits of the sensor's range are none of the tracer's. What is nearer blocks the beam, so the tracer has to find
        // it, and what is farther is told apart from nothing at all.
        rays.cast(self.scene, self.tracer, hits);
        let limits = &self.capture.sensor.range;
        let measured = |ray: usize, hit: &Hit| match pulses.get(ray) {
            None => (hit.t, limits.place(hit.t)),
            Some(pulse) => {
                let range_m = pulse.range_m(hit.t);
                (range_m, limits.place_of(pulse, range_m))
            }
        };
        through.clear();
        if self.is_see_through {
            through.look(self.scene, self.tracer, rays, hits, |ray, hit| measured(ray, hit).1);
        }
        let mut last: Option<SeenTriangle> = None;
        for (ray, (&(row, column), hit)) in rays.known().iter().zip(hits.iter()).enumerate() {
            let piece = &mut strip.rows[usize::from(row)];
            let Some(hit) = hit else {
                piece.set(usize::from(column), None, Cause::Nothing);
                continue;
            };
            let (range_m, place) = measured(ray, hit);
            let cause = match place {
                Ordering::Less => Cause::TooNear,
                Ordering::Equal => Cause::Surface,
                Ordering::Greater => {
                    piece.set(usize::from(column), None, Cause::OutOfRange);
                    continue;
                }
            };
            let pose = self.fixed.as_ref().unwrap_or_else(|| &poses[ray]);
            // Neighbouring rays often hit the same triangle.
            let seen = match &mut last {
                Some(seen) if seen.is_of(hit) => seen,
                _ => last.insert(SeenTriangle::of(hit, self.scene)),
            };
            let direction = rays.ray(ray).direction;
            let mut one = seen.receive(&pose.sensor_from_world, direction, hit, range_m);
            if self.is_see_through || seen.varies() {
                one.intensity = seen.intensity(direction, hit, self.scene, through.share(ray));
            }
            piece.set(usize::from(column), Some(one), cause);
        }
        rays.len()
    }
}

impl Piece<'_> {
    #[inline(always)]
    fn set(&mut self, column: usize, one: Option<Return>, cause: Cause) {
        // The memory may hold an earlier frame, so a pixel without a return is written too.
        self.returns.set(column, one.unwrap_or_default());
        self.causes[column] = cause;
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

    #[test]
    fn strips_cover_the_image_once() {
        for (rows, columns) in [(1, 1), (16, 1800), (7, 15), (9, 17), (480, 640)] {
            // Each pixel stores its own number and the number of times that it was visited.
            let mut frame = Frame::default();
            frame.set_size(rows, columns);
            let mut visits = 0;
            for mut strip in strips(&mut frame) {
                for (row, piece) in strip.rows.iter_mut().enumerate() {
                    for index in 0..piece.causes.len() {
                        let pixel = (strip.first_row + row) * columns + strip.first_column + index;
                        let one = Return { range_m: pixel as f64, ..Return::default() };
                        piece.returns.set(index, one);
                        piece.causes[index] = Cause::Surface;
                        visits += 1;
                    }
                }
            }
            assert_eq!((visits, frame.return_count()), (rows * columns, rows * columns));
            assert!(frame.iter().all(|(pixel, one)| one.range_m == pixel as f64), "{rows} × {columns}");
        }
    }

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
