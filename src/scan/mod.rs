//! Pulses × scene → returns. The one room that knows both; threads (rayon) live here.

use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::frame::Pose;
use crate::scene::Scene;
use crate::sensor::Sensor;
use crate::trace::{Cast, Hit, Origins, Rays};

/// What a sensor saw in one turn or one image.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Rows of the range image.
    pub rows: usize,
    /// Columns of the range image.
    pub columns: usize,
    /// Row by row; `None` where nothing came back, or no pulse went out. `rows × columns` long.
    pub returns: Vec<Option<Return>>,
}

/// What came back from one pulse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Return {
    /// Metres along the ray from the pulse's origin.
    pub range: f64,
    /// Unit geometric normal of the surface in the sensor's body frame, towards the sensor.
    pub normal: Vec3,
    /// ρ·cos θ: reflectivity times the cosine of incidence, 0 to 1.
    pub intensity: f32,
    /// Index into [`Scene::instances`].
    pub instance: u32,
    /// Semantic label.
    pub label: u32,
    /// Triangle id.
    pub triangle: u32,
}

impl Frame {
    /// What came back at a pixel of the range image.
    pub fn get(&self, row: usize, column: usize) -> Option<&Return> {
        self.returns[row * self.columns + column].as_ref()
    }
}

/// How far a scan has come, to be read from another thread, and the way to stop it.
#[derive(Debug, Default)]
pub struct Progress {
    /// Rays cast since it was made.
    pub rays_done: AtomicU64,
    /// Set it, and scanning stops within a few milliseconds.
    pub cancelled: AtomicBool,
}

/// Rows and columns of a tile: as many rays as the tracer takes at once, and neighbours, so that they are a narrow pyramid.
const TILE: (usize, usize) = (8, 16);

/// Columns of a strip, which is cast as one batch, tile by tile.
const STRIP: usize = 16 * TILE.1;

/// Casts every pulse of a sensor at `world_from_sensor`. `None` if `progress.cancelled` was set before the end.
///
/// Runs on rayon's current thread pool; the frame is the same for any number of threads.
pub fn scan(
    scene: &Scene,
    tracer: &impl Cast,
    sensor: &Sensor,
    world_from_sensor: &Pose,
    progress: &Progress,
) -> Option<Frame> {
    let (rows, columns) = (sensor.pattern.rows(), sensor.pattern.columns());
    let mut returns = vec![None; rows * columns];
    let sensor_from_world = world_from_sensor.inverse();
    let scanner = Scanner { scene, tracer, sensor, world_from_sensor, sensor_from_world };
    strips(&mut returns, columns).into_par_iter().for_each_init(Batch::default, |batch, mut strip| {
        if !progress.cancelled.load(Ordering::Relaxed) {
            let rays = scanner.fill(&mut strip, batch);
            progress.rays_done.fetch_add(rays as u64, Ordering::Relaxed);
        }
    });
    let whole = !progress.cancelled.load(Ordering::Relaxed);
    whole.then_some(Frame { rows, columns, returns })
}

/// A part of the image that is cast as one batch.
struct Strip<'f> {
    first_row: usize,
    first_column: usize,
    /// The strip's piece of each of its rows.
    rows: Vec<&'f mut [Option<Return>]>,
}

/// Cuts an image into strips, each with its own part of the image to write to.
fn strips(returns: &mut [Option<Return>], columns: usize) -> Vec<Strip<'_>> {
    let mut strips = Vec::new();
    for (band_index, band) in returns.chunks_mut(TILE.0 * columns).enumerate() {
        let first_strip = strips.len();
        for row in band.chunks_mut(columns) {
            for (index, piece) in row.chunks_mut(STRIP).enumerate() {
                if strips.len() == first_strip + index {
                    let (first_row, first_column) = (band_index * TILE.0, index * STRIP);
                    strips.push(Strip { first_row, first_column, rows: Vec::with_capacity(TILE.0) });
                }
                strips[first_strip + index].rows.push(piece);
            }
        }
    }
    strips
}

/// Room for a strip's rays and hits, kept from strip to strip.
#[derive(Default)]
struct Batch {
    /// Where in the strip each ray's pixel is: a pixel without a pulse has no ray.
    pixels: Vec<(u8, u8)>,
    origins: Vec<DVec3>,
    directions: Vec<DVec3>,
    hits: Vec<Option<Hit>>,
}

struct Scanner<'a, C> {
    scene: &'a Scene,
    tracer: &'a C,
    sensor: &'a Sensor,
    world_from_sensor: &'a Pose,
    sensor_from_world: Pose,
}

impl<C: Cast> Scanner<'_, C> {
    /// Casts the pulses of a strip and writes what comes back. Gives the number of rays.
    fn fill(&self, strip: &mut Strip, batch: &mut Batch) -> usize {
        let Batch { pixels, origins, directions, hits } = batch;
        pixels.clear();
        origins.clear();
        directions.clear();
        let width = strip.rows[0].len();
        for first in (0..width).step_by(TILE.1) {
            for row in 0..strip.rows.len() {
                for column in first..width.min(first + TILE.1) {
                    let pulse = self.sensor.pattern.pulse(strip.first_row + row, strip.first_column + column);
                    let Some(pulse) = pulse else { continue };
                    pixels.push((row as u8, column as u8));
                    origins.push(self.world_from_sensor.point(pulse.origin));
                    directions.push(self.world_from_sensor.direction(pulse.direction));
                }
            }
        }
        let common = origins.first().copied().filter(|first| origins.iter().all(|o| o == first));
        hits.clear();
        hits.resize(directions.len(), None);
        let rays = Rays {
            origins: common.map_or(Origins::Each(origins), Origins::Common),
            directions,
            t_min: self.sensor.range.min_m,
            t_max: self.sensor.range.max_m,
        };
        self.tracer.cast(&rays, hits);
        for ((&(row, column), &direction), hit) in pixels.iter().zip(directions.iter()).zip(hits.iter()) {
            let cell = &mut strip.rows[usize::from(row)][usize::from(column)];
            *cell = hit.as_ref().map(|hit| self.receive(direction, hit));
        }
        pixels.len()
    }

    /// What the sensor makes of a hit. Intensity is that of an ideal receiver and a Lambertian surface, ρ·cos θ.
    fn receive(&self, direction: DVec3, hit: &Hit) -> Return {
        let surface = self.scene.surface(hit.placement, hit.triangle);
        let along = hit.normal.dot(direction);
        let towards_sensor = if along > 0.0 { -hit.normal } else { hit.normal };
        let normal = self.sensor_from_world.direction(towards_sensor);
        let reflectivity = f64::from(self.scene.materials[surface.material as usize].reflectivity());
        Return {
            range: hit.t,
            normal: normal.as_vec3(),
            intensity: (reflectivity * along.abs().min(1.0)) as f32,
            instance: surface.instance,
            label: self.scene.label(surface),
            triangle: self.scene.placements[hit.placement as usize].first_triangle + hit.triangle,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle::Angle;
    use crate::scene::{Instance, Material, Placed, SceneBuilder, SourceMesh, SourcePart};
    use crate::sensor::{Camera, Pattern, RangeLimits, RingOrder};
    use crate::trace::Tracer;

    #[test]
    fn strips_cover_the_image_once() {
        for (rows, columns) in [(1, 1), (16, 1800), (7, 15), (9, 17), (480, 640)] {
            let mut returns = vec![None; rows * columns];
            let start = returns.as_ptr() as usize;
            let mut seen = vec![0; rows * columns];
            for strip in strips(&mut returns, columns) {
                for (row, piece) in strip.rows.iter().enumerate() {
                    let at = (piece.as_ptr() as usize - start) / size_of::<Option<Return>>();
                    assert_eq!(at, (strip.first_row + row) * columns + strip.first_column);
                    seen[at..at + piece.len()].iter_mut().for_each(|n| *n += 1);
                }
            }
            assert!(seen.iter().all(|&n| n == 1), "{rows} × {columns}");
        }
    }

    /// A wall of reflectivity ½ two metres ahead of a camera, seen from behind its triangles.
    #[test]
    fn a_return_tells_of_the_surface() {
        let wall = SourceMesh {
            positions: vec![[2.0, -9.0, -9.0], [2.0, 9.0, -9.0], [2.0, 0.0, 9.0]],
            parts: vec![SourcePart { triangles: vec![[0, 1, 2]], material: 0 }],
        };
        let material =
            Material { base_color: [0.5, 0.5, 0.5, 1.0], job_label: Some(7), ..Material::default() };
        let placed =
            Placed { mesh: 0, world_from_mesh: glam::DAffine3::IDENTITY, instance: Instance::default() };
        let builder = SceneBuilder {
            meshes: vec![wall],
            placed: vec![placed],
            materials: vec![material],
            files: vec![],
        };
        let scene = builder.build().unwrap();
        let camera = Camera::from_hfov((33, 33), Angle::deg(60.0), None).unwrap();
        let range = RangeLimits { min_m: 0.5, max_m: 2.2 };
        let sensor = Sensor { pattern: Pattern::Camera(camera), range, ring: RingOrder::Row };
        // The camera is turned upside down: what it reports is in its own frame.
        let pose = Pose::from_rpy(DVec3::ZERO, Angle::deg(180.0), Angle::default(), Angle::default());
        let progress = Progress::default();
        let frame = scan(&scene, &Tracer::build(&scene), &sensor, &pose, &progress).unwrap();
        assert_eq!(progress.rays_done.load(Ordering::Relaxed), 33 * 33);
        let middle = frame.get(16, 16).unwrap();
        assert!((middle.range - 2.0).abs() < 1e-15);
        assert!(middle.normal.abs_diff_eq(Vec3::NEG_X, 1e-7));
        assert!((middle.intensity - 0.5).abs() < 1e-6);
        assert_eq!((middle.label, middle.instance, middle.triangle), (7, 0, 0));
        let cos = sensor.pattern.pulse(16, 20).unwrap().direction.x;
        let aside = frame.get(16, 20).unwrap();
        assert!((aside.range - 2.0 / cos).abs() < 1e-14);
        assert!((f64::from(aside.intensity) - 0.5 * cos).abs() < 1e-6);
        // The corners lie beyond the sensor's range.
        assert!(frame.get(0, 0).is_none() && 2.0 / sensor.pattern.pulse(0, 0).unwrap().direction.x > 2.2);

        progress.cancelled.store(true, Ordering::Relaxed);
        assert!(scan(&scene, &Tracer::build(&scene), &sensor, &pose, &progress).is_none());
    }
}
