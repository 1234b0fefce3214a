//! Measurements of the intersection methods of [`crate::trace::methods`]: speed, errors against exact arithmetic, and leaks.
//!
//! The times vary. All other figures are the same on every machine.

pub mod test_scene;

use std::hint::black_box;

use glam::{DVec3, Vec3};
use rayon::prelude::*;

use crate::angle::Angle;
use crate::error::Error;
use crate::frame::Pose;
use crate::motion::Trajectory;
use crate::rng::Rng;
use crate::scan::{Frame, Progress, scan};
use crate::scene::Scene;
use crate::sensor::{Beam, Capture, Pattern, RangeLimits, RingOrder, Rotating, Sensor};
use crate::trace::exact::{Corners, LocalRay};
use crate::trace::methods::truth::{Passage, Truth};
use crate::trace::methods::{Culling, METHODS, Method, Ray, RayTriangle};
use crate::trace::{AnyTracer, Cast, Hit, Origins, Rays, Tracer};

/// The shares of hits among the tests that are timed.
pub const HIT_RATIOS: [f64; 3] = [0.1, 0.5, 0.9];

/// The distances in metres at which the error of t is measured.
pub const DISTANCES_M: [f64; 4] = [1.0, 10.0, 100.0, 200.0];

/// The part of a triangle that a ray is aimed at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Aim {
    /// A point inside, all of them equally likely.
    Interior,
    /// A point on one of the edges.
    Edge,
    /// One of the corners.
    Vertex,
}

/// The order of figures by aim.
pub const AIMS: [Aim; 3] = [Aim::Interior, Aim::Edge, Aim::Vertex];

/// The measurements of a method, or of the exact definition.
#[derive(Clone, Copy, Debug)]
pub struct Figures {
    /// The method; `None` for the exact definition.
    pub method: Option<&'static Method>,
    /// Nanoseconds for each test, by [`HIT_RATIOS`].
    pub ns_per_test: [f64; 3],
    /// Millions of rays a second through the whole scene, on one thread.
    pub mrays_per_s: f64,
    /// The number of decisions on single triangles, in a million, that differ from the exact decision by the method's own rule,
    /// by [`AIMS`].
    pub wrong_per_1e6: [f64; 3],
    /// The errors of t, by [`DISTANCES_M`].
    pub t_error: [DepthError; 4],
    /// The number of rays in 10⁸ that leave a closed mesh, by [`AIMS`].
    pub leaks_per_1e8: [f64; 3],
}

/// The error |t̂ − t| over the rays that hit.
#[derive(Clone, Copy, Debug, Default)]
pub struct DepthError {
    /// The mean, in units in the last place of the true t as f32.
    pub mean_ulp: f64,
    /// The largest, in the same units.
    pub largest_ulp: f64,
    /// The mean, in metres.
    pub mean_m: f64,
    /// The largest, in metres.
    pub largest_m: f64,
}

/// A row of the table: a method, or the exact definition.
#[derive(Clone, Copy)]
struct Subject(Option<&'static Method>);

impl Subject {
    fn all() -> Vec<Self> {
        METHODS.iter().map(Some).chain([None]).map(Self).collect()
    }

    /// The depth t of the ray's crossing with a triangle. The exact definition computes it in f64.
    fn depth(self, ray: &Ray, corners: [Vec3; 3]) -> Option<f64> {
        match self.0 {
            Some(method) => method.intersect(ray, corners).map(|c| c.t.into()),
            None => exact_depth(ray, corners),
        }
    }

    fn is_right(self, truth: &Truth, is_hit: bool) -> bool {
        let expected = match self.0 {
            Some(method) => truth.is_hit(&method.about),
            None => !matches!(truth.passage(), Passage::Outside | Passage::InPlane),
        };
        is_hit == expected
    }

    fn culling(self) -> Culling {
        self.0.map_or(Culling::None, |m| m.about.culling)
    }
}

fn exact_depth(ray: &Ray, corners: [Vec3; 3]) -> Option<f64> {
    let corners = Corners::from_positions(corners.map(|p| p.to_array()), ray.origin.as_dvec3());
    let d = ray.direction.as_dvec3();
    corners.passes(d).then(|| corners.depth(d))
}

/// Runs the work that it is given and returns how long that took, in seconds. The caller brings the clock.
pub type Stopwatch = dyn Fn(&mut dyn FnMut()) -> f64 + Sync;

/// Measures every method. Each casts `rays` rays to look for leaks, and a tenth of them for every other kind of judgement.
/// Times are taken with `stopwatch`.
///
/// # Errors
/// [`Error::Usage`] if a sensor in the scene's middle, or 1.8 m above the world's origin, sees nothing of it.
pub fn measure(scene: &Scene, rays: u64, stopwatch: &Stopwatch) -> Result<Vec<Figures>, Error> {
    let sensor = sensor();
    let tracer = Tracer::build(scene);
    let (pose, targets) = [DVec3::Z * 1.8, scene.geometry.centre]
        .map(|at| (Pose { translation: at, ..Pose::IDENTITY }, targets(scene, &tracer, &sensor, at)))
        .into_iter()
        .find(|(_, targets)| !targets.is_empty())
        .ok_or_else(|| {
            Error::Usage(
                "a sensor 1.8 m above the world's origin sees nothing of the scene, nor one in its middle"
                    .into(),
            )
        })?;
    let subjects = Subject::all();
    let ns_per_test = times(&subjects, stopwatch);
    let scans = if rays < 100_000 { 1 } else { SCANS };
    let scan_timer = ScanTimer { scene, sensor: &sensor, pose: &pose, stopwatch };
    let rays_a_scan = sensor.pattern.rays() as f64;
    let scan_seconds = scan_times(&subjects, &tracer, &scan_timer, scans)?;
    let mrays_per_s: Vec<f64> = scan_seconds.iter().map(|seconds| rays_a_scan / seconds / 1e6).collect();
    let wrong = AIMS.map(|aim| wrong_decisions(&subjects, &targets, aim, rays.div_ceil(10)));
    let errors = DISTANCES_M.map(|distance| depth_errors(&subjects, distance, rays.div_ceil(10)));
    let leaks = AIMS.map(|aim| leaks(&subjects, aim, rays.div_ceil(3)));
    Ok(subjects
        .iter()
        .enumerate()
        .map(|(row, subject)| Figures {
            method: subject.0,
            ns_per_test: ns_per_test[row],
            mrays_per_s: mrays_per_s[row],
            wrong_per_1e6: wrong.each_ref().map(|w| w[row]),
            t_error: errors.each_ref().map(|e| e[row]),
            leaks_per_1e8: leaks.each_ref().map(|l| l[row]),
        })
        .collect())
}

/// A LiDAR of 64 beams and 512 columns.
fn sensor() -> Sensor {
    let beam = |i: u32| Beam {
        elevation: Angle::deg(15.0 - 40.0 * f64::from(i) / 63.0),
        azimuth_offset: Angle::default(),
        time_s: 0.0,
        file_index: i as usize,
    };
    let turn = (Angle::deg(180.0), Angle::deg(-180.0));
    let pattern = Rotating::new((0..64).map(beam).collect(), 512, turn, 10.0);
    let pattern = Pattern::Rotating(pattern.expect("64 beams and a full turn make a pattern"));
    Sensor { pattern, range: RangeLimits::default(), ring: RingOrder::Row, measurement: Default::default() }
}

/// A triangle that the sensor sees, and the sensor's place in the triangle's space.
#[derive(Clone, Copy)]
struct Target {
    origin: Vec3,
    corners: [Vec3; 3],
}

/// The triangles that a sensor sees, each as often as it is hit.
fn targets(scene: &Scene, tracer: &Tracer, sensor: &Sensor, at: DVec3) -> Vec<Target> {
    let capture = Capture::at_origin(sensor);
    let pixels = (0..capture.rows()).flat_map(|row| (0..capture.columns()).map(move |column| (row, column)));
    let directions: Vec<_> = pixels
        .map(|(row, column)| capture.pulse(row, column).expect("every beam has a pulse").direction)
        .collect();
    let mut hits = vec![None; directions.len()];
    tracer.cast(&Rays::unlimited(Origins::Common(at), &directions), &mut hits);
    let seen = hits.into_iter().flatten().map(|hit: Hit| {
        let placement = &scene.arrangement.placements[hit.placement as usize];
        let mesh = scene.mesh(placement.mesh);
        let ray = LocalRay { origin: scene.geometry.ray_origin(at), direction: DVec3::X }
            .carried_by(placement.mesh_from_scene());
        Target {
            origin: ray.origin.as_vec3(),
            corners: mesh.triangles[hit.triangle as usize].map(|v| mesh.positions[v as usize].into()),
        }
    });
    seen.collect()
}

/// A unit ray from an origin to a point of a triangle.
fn aimed(aim: Aim, origin: Vec3, corners: [Vec3; 3], random: &mut Rng) -> Ray {
    let weights = match aim {
        Aim::Interior => interior(random),
        Aim::Edge => {
            let along = random.unit();
            [1.0 - along, along, 0.0]
        }
        Aim::Vertex => [1.0, 0.0, 0.0],
    };
    let turn = random.below(3);
    let [a, b, c] = [0, 1, 2].map(|k| corners[(k + turn) % 3].as_dvec3());
    let towards = a * weights[0] + b * weights[1] + c * weights[2] - origin.as_dvec3();
    Ray { origin, direction: towards.normalize_or(DVec3::X).as_vec3() }
}

/// Barycentric weights of a point anywhere in a triangle, all places equally likely.
fn interior(random: &mut Rng) -> [f64; 3] {
    let (u, v) = (random.unit(), random.unit());
    let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
    [1.0 - u - v, u, v]
}

/// The number of rays that are made together, from a seed of their own.
const CHUNK: u64 = 1 << 12;

/// The number of chunks that are in memory together.
const BLOCK: u64 = 1 << 10;

/// Works on `rays` rays in chunks, on all threads, and merges the results in the order of the chunks.
fn chunks<T: Send>(seed: u64, rays: u64, work: impl Fn(&mut Rng, u64) -> T + Sync, mut merge: impl FnMut(T)) {
    let chunk = |index: u64| {
        let mut random = Rng::new(seed << 48 ^ index);
        work(&mut random, CHUNK.min(rays - index * CHUNK))
    };
    let all = rays.div_ceil(CHUNK);
    for first in (0..all).step_by(BLOCK as usize) {
        let block = first..all.min(first + BLOCK);
        block.into_par_iter().map(chunk).collect::<Vec<_>>().into_iter().for_each(&mut merge);
    }
}

/// The wrong decisions in a million, by row.
fn wrong_decisions(subjects: &[Subject], targets: &[Target], aim: Aim, rays: u64) -> Vec<f64> {
    let judge = |random: &mut Rng, count: u64| {
        let mut wrong = vec![0_u64; subjects.len()];
        for _ in 0..count {
            let Target { origin, corners } = targets[random.below(targets.len())];
            let ray = aimed(aim, origin, corners, random);
            // The triangle as it stands, and turned over for a method that would not see it.
            let turned = [corners[0], corners[2], corners[1]];
            let truths = [corners, turned].map(|corners| Truth::of(&ray, corners));
            let [Some(as_it_stands), Some(turned_over)] = truths else { continue };
            for (wrong, subject) in wrong.iter_mut().zip(subjects) {
                let (corners, truth) = match subject.culling().sees(as_it_stands.from_front()) {
                    true => (corners, &as_it_stands),
                    false => (turned, &turned_over),
                };
                let is_hit = subject.depth(&ray, corners).is_some();
                *wrong += u64::from(!subject.is_right(truth, is_hit));
            }
        }
        wrong
    };
    let mut all = vec![0_u64; subjects.len()];
    chunks(2 + aim as u64, rays, judge, |wrong| {
        all.iter_mut().zip(wrong).for_each(|(all, wrong)| *all += wrong)
    });
    all.into_iter().map(|wrong| wrong as f64 * 1e6 / rays as f64).collect()
}

/// The errors of t, by row, for triangles of 5 cm to 1 m that are at most 75° from facing the ray, `distance` metres from a
/// sensor that is up to 50 m along each axis from the middle of its scene.
fn depth_errors(subjects: &[Subject], distance: f64, rays: u64) -> Vec<DepthError> {
    #[derive(Clone, Copy, Default)]
    struct Sum {
        count: u64,
        error: DepthError,
    }
    let judge = |random: &mut Rng, count: u64| {
        let mut sums = vec![Sum::default(); subjects.len()];
        for _ in 0..count {
            let origin = (random.point() * 50.0).as_vec3();
            let (ray, corners) = facing(random, origin, distance);
            let Some(truth) = Truth::of(&ray, corners) else { continue };
            if truth.passage() != Passage::Interior {
                continue;
            }
            let t = truth.t();
            let ulp = f64::from((t as f32).next_up() - t as f32);
            for (sum, subject) in sums.iter_mut().zip(subjects) {
                let Some(depth) = subject.depth(&ray, corners) else { continue };
                let error = match subject.0 {
                    Some(_) => truth.error_of(depth as f32).abs(),
                    None => (depth - t).abs(),
                };
                sum.count += 1;
                sum.error.mean_m += error;
                sum.error.mean_ulp += error / ulp;
                sum.error.largest_m = sum.error.largest_m.max(error);
                sum.error.largest_ulp = sum.error.largest_ulp.max(error / ulp);
            }
        }
        sums
    };
    let mut all = vec![Sum::default(); subjects.len()];
    chunks(8 + distance as u64, rays, judge, |sums| {
        for (all, Sum { count, error }) in all.iter_mut().zip(sums) {
            all.count += count;
            all.error.mean_m += error.mean_m;
            all.error.mean_ulp += error.mean_ulp;
            all.error.largest_m = all.error.largest_m.max(error.largest_m);
            all.error.largest_ulp = all.error.largest_ulp.max(error.largest_ulp);
        }
    });
    let mean = |Sum { count, error }: Sum| {
        let count = count.max(1) as f64;
        DepthError { mean_m: error.mean_m / count, mean_ulp: error.mean_ulp / count, ..error }
    };
    all.into_iter().map(mean).collect()
}

/// A ray, and a triangle that it hits about `distance` away.
fn facing(random: &mut Rng, origin: Vec3, distance: f64) -> RayTriangle {
    let d = random.direction();
    let normal = loop {
        let n = random.direction();
        if n.dot(d).abs() > 0.26 {
            break n;
        }
    };
    let corners = around(random, origin.as_dvec3() + d * distance, normal);
    (aimed(Aim::Interior, origin, corners, random), corners)
}

/// A triangle of 5 cm to 1 m around a point. It is not too thin.
fn around(random: &mut Rng, middle: DVec3, normal: DVec3) -> [Vec3; 3] {
    let u = normal.any_orthonormal_vector();
    let v = normal.cross(u);
    let size = 0.05 + 0.95 * random.unit();
    let start = random.unit();
    [0.0, 1.0, 2.0].map(|k| {
        let (sin, cos) = Angle::deg(360.0 * start + 120.0 * k + 40.0 * random.signed()).sin_cos();
        (middle + (u * cos + v * sin) * (0.5 * size)).as_vec3()
    })
}

/// The number of rays in 10⁸ that leave a closed mesh, by row.
fn leaks(subjects: &[Subject], aim: Aim, rays: u64) -> Vec<f64> {
    // The rays start inside, so that a method that culls backs needs a mesh that is turned inside out.
    let scenes = [false, true].map(test_scene::closed);
    let tracers = scenes.each_ref().map(Tracer::build);
    let of_subject = |subject: &Subject| {
        let side = usize::from(subject.culling() == Culling::Back);
        let (scene, exact) = (&scenes[side], &tracers[side]);
        let method = subject.0.map(|m| m.tracer(exact));
        let mesh = &scene.geometry.meshes[0];
        let cast = |random: &mut Rng, count: u64| {
            let mut leaks = 0;
            let (mut directions, mut hits) = (Vec::new(), Vec::new());
            for first in (0..count).step_by(64) {
                let origin = random.point() * 10.0;
                directions.clear();
                directions.extend((first..count.min(first + 64)).map(|_| {
                    let triangle = mesh.triangles[random.below(mesh.triangles.len())];
                    let corners = triangle.map(|v| mesh.positions[v as usize].into());
                    // The scene's space is the world, moved to the scene's centre.
                    let ray = aimed(aim, (origin - scene.geometry.centre).as_vec3(), corners, random);
                    ray.direction.as_dvec3()
                }));
                hits.clear();
                hits.resize(directions.len(), None);
                let rays = Rays::unlimited(Origins::Common(origin), &directions);
                match &method {
                    Some(tracer) => tracer.cast(&rays, &mut hits),
                    None => exact.cast(&rays, &mut hits),
                }
                leaks += hits.iter().filter(|hit| hit.is_none()).count() as u64;
            }
            leaks
        };
        let mut all = 0;
        chunks(16 + aim as u64, rays, cast, |leaks| all += leaks);
        all as f64 * 1e8 / rays as f64
    };
    subjects.iter().map(of_subject).collect()
}

/// The number of pairs that are timed together. They stay in a second-level cache, and are too many for a branch predictor to
/// learn.
const PAIRS: usize = 4096;

/// The samples of each time, taken in turns, and the passes over the pairs in each sample.
const SAMPLES: usize = 41;
const PASSES: usize = 32;

/// The nanoseconds for each test, by row.
fn times(subjects: &[Subject], stopwatch: &Stopwatch) -> Vec<[f64; 3]> {
    let batches: Vec<[_; 3]> = subjects
        .iter()
        .map(|subject| HIT_RATIOS.map(|ratio| batch(*subject, &pairs(*subject, ratio))))
        .collect();
    let mut samples = vec![[const { Vec::new() }; 3]; subjects.len()];
    for _ in 0..SAMPLES {
        for (batches, samples) in batches.iter().zip(&mut samples) {
            for (batch, samples) in batches.iter().zip(samples) {
                let seconds = stopwatch(&mut || {
                    for _ in 0..PASSES {
                        black_box(batch());
                    }
                });
                samples.push(seconds * 1e9 / (PASSES * PAIRS) as f64);
            }
        }
    }
    samples.iter().map(|of_row| of_row.each_ref().map(|samples| least(samples))).collect()
}

fn batch(subject: Subject, pairs: &[RayTriangle]) -> Box<dyn Fn() -> usize> {
    match subject.0 {
        Some(method) => method.batch(pairs),
        None => {
            let pairs = pairs.to_vec();
            Box::new(move || {
                pairs.iter().filter(|(ray, corners)| exact_depth(ray, *corners).is_some()).count()
            })
        }
    }
}

/// Rays from one origin, each with a triangle 2 to 60 m away. A share `ratio` of the rays hit, and the others pass their
/// triangle by no more than its size, as in the leaves of a hierarchy. For a method that culls, triangles are turned so that
/// it sees them.
fn pairs(subject: Subject, ratio: f64) -> Vec<RayTriangle> {
    let mut random = Rng::new(32);
    let origin = Vec3::new(3.0, -2.0, 1.8);
    (0..PAIRS)
        .map(|_| {
            let distance = 2.0 + 58.0 * random.unit();
            let (mut ray, mut corners) = facing(&mut random, origin, distance);
            if random.unit() >= ratio {
                let turn = random.below(3);
                let [a, b, c] = [0, 1, 2].map(|k| corners[(k + turn) % 3].as_dvec3());
                let (out, along) = (0.05 + random.unit(), random.unit());
                let beyond = b * ((1.0 + out) * along) + c * ((1.0 + out) * (1.0 - along)) - a * out;
                ray.direction = (beyond - origin.as_dvec3()).normalize_or(DVec3::X).as_vec3();
            }
            let n = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            let from_front = n.dot(ray.direction) < 0.0;
            if !subject.culling().sees(from_front) {
                corners.swap(1, 2);
            }
            (ray, corners)
        })
        .collect()
}

/// The scans of each speed, taken in turns. One is enough if few rays are asked for.
const SCANS: usize = 15;

/// The scan whose time is compared from tracer to tracer.
struct ScanTimer<'a> {
    scene: &'a Scene,
    sensor: &'a Sensor,
    pose: &'a Pose,
    stopwatch: &'a Stopwatch,
}

impl ScanTimer<'_> {
    /// Scans twice and returns the seconds of the second scan. The first works out what a method needs once for each origin.
    fn seconds(&self, tracer: &impl Cast) -> f64 {
        let trajectory = Trajectory::Fixed(*self.pose);
        let capture = Capture::new(self.sensor, Pose::IDENTITY, &trajectory, 0, 0);
        let scan = || scan(self.scene, tracer, &capture, &Progress::default());
        black_box::<Option<Frame>>(scan());
        (self.stopwatch)(&mut || drop(black_box(scan())))
    }
}

/// The least seconds of a scan on one thread, by row.
fn scan_times(
    subjects: &[Subject],
    exact: &Tracer,
    scan_timer: &ScanTimer,
    scans: usize,
) -> Result<Vec<f64>, Error> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    let pool = pool.map_err(|e| Error::Usage(format!("a thread can't be had: {e}")))?;
    let mut samples = vec![Vec::new(); subjects.len()];
    for _ in 0..scans {
        for (subject, samples) in subjects.iter().zip(&mut samples) {
            samples.push(match subject.0 {
                None => pool.install(|| scan_timer.seconds(exact)),
                Some(method) => {
                    let tracer = AnyTracer::Method(method.tracer(exact));
                    pool.install(|| scan_timer.seconds(&tracer))
                }
            });
        }
    }
    Ok(samples.iter().map(|samples| least(samples)).collect())
}

/// The least of the samples of a time. All other work of the machine only adds to a time.
fn least(samples: &[f64]) -> f64 {
    samples.iter().copied().fold(f64::INFINITY, f64::min)
}
