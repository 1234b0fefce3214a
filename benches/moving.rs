//! Casts a LiDAR at crowds of things that move, and arranges the crowds anew for a frame.
//!
//! `cargo bench --bench moving` prints a row for each size of a crowd of cars on a plain: the milliseconds in which the scene is
//! arranged for a frame, with the hierarchy over its placements, where the cars move and where they stand; and the millions of
//! rays a second where they move, where they move and each ray is cast alone, and where they stand. The three take turns, and each
//! figure is the least CPU time of several rounds on one thread; arranging uses all threads, and its figure is the least time.

mod timing;

use std::sync::Arc;
use std::time::Instant;

use beamcast::frame::Pose;
use beamcast::motion::{Link, Motion, Trajectory, Window};
use beamcast::rng::Rng;
use beamcast::scene::{Material, Scene, SceneBuilder, SourceInstance, SourceMesh, SourcePart};
use beamcast::trace::{Cast, Hit, Origins, Rays, Tracer};
use glam::{DAffine3, DVec3};

use timing::thread_time;

/// The rows and columns of the LiDAR, the duration of a frame, and the rows and columns of a tile, whose rays are cast together.
const SIZE: (usize, usize) = (64, 1024);
const FRAME_S: f64 = 0.1;
const TILE: (usize, usize) = (8, 16);
const ROUNDS: usize = 7;
/// The least duration of a measurement, because the scheduler accounts for CPU time only every few milliseconds.
const LEAST_S: f64 = 0.03;
/// The length of the plain's sides, in metres.
const SIDE_M: f64 = 200.0;

fn main() {
    if std::env::args().any(|argument| argument == "--test") {
        return; // `cargo test --benches` asks for no measurement.
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    println!("{:>6} {:>21} {:>32} {:>7}", "", "arranged in ms", "Mrays/s", "");
    let columns = ["cars", "moving", "standing", "moving", "singly", "standing", "ratio"];
    let [a, b, c, d, e, f, g] = columns;
    println!("{a:>6} {b:>10} {c:>10} {d:>10} {e:>10} {f:>10} {g:>7}");
    let strips = strips();
    for cars in [1, 10, 100, 1000, 10_000] {
        let scene = crowd(cars);
        let tracer = Tracer::build(&scene);
        let window = Window { from_s: 0.0, to_s: FRAME_S };
        let during = || tracer.rearranged(scene.during(window, None).arrangement);
        let at = || tracer.rearranged(scene.at(0.5 * FRAME_S).arrangement);
        let ms = |arrange: &dyn Fn() -> Tracer| {
            let times = (0..ROUNDS).map(|_| {
                let start = Instant::now();
                let arranged = arrange();
                let seconds = start.elapsed().as_secs_f64();
                drop(arranged);
                seconds * 1e3
            });
            times.fold(f64::INFINITY, f64::min)
        };
        let [of_moving, of_standing] = [ms(&during), ms(&at)];
        let (moving, standing) = (during(), at());
        let alone = moving.clone().ray_by_ray();
        let times = pool.install(|| least_times([&moving, &alone, &standing], &strips));
        let [packets, singly, still] = times.map(|seconds| (SIZE.0 * SIZE.1) as f64 / seconds * 1e-6);
        println!(
            "{cars:>6} {of_moving:>10.3} {of_standing:>10.3} {packets:>10.3} {singly:>10.3} {still:>10.3} {:>7.2}",
            packets / still
        );
    }
}

/// The directions and times of a strip of the image.
struct Strip {
    directions: Vec<DVec3>,
    times_s: Vec<f64>,
}

/// The strips of the image, tile by tile, as a scan casts them.
fn strips() -> Vec<Strip> {
    const WIDTH: usize = 16 * TILE.1;
    let mut strips = Vec::new();
    for top in (0..SIZE.0).step_by(TILE.0) {
        for left in (0..SIZE.1).step_by(WIDTH) {
            let mut strip = Strip { directions: Vec::new(), times_s: Vec::new() };
            for first in (left..left + WIDTH).step_by(TILE.1) {
                for row in top..top + TILE.0 {
                    for column in first..first + TILE.1 {
                        let turn = column as f64 / SIZE.1 as f64;
                        let share = row as f64 / (SIZE.0 - 1) as f64;
                        let (sin, cos) = libm::sincos((5.0 - 30.0 * share).to_radians());
                        let (y, x) = libm::sincos(std::f64::consts::TAU * turn);
                        strip.directions.push(DVec3::new(x * cos, -y * cos, sin));
                        strip.times_s.push(turn * FRAME_S);
                    }
                }
            }
            strips.push(strip);
        }
    }
    strips
}

/// The least CPU time in seconds in which each of three tracers casts all strips.
fn least_times(tracers: [&Tracer; 3], strips: &[Strip]) -> [f64; 3] {
    let eye = DVec3::new(0.3, 0.2, 1.8);
    let mut hits: Vec<Option<Hit>> = Vec::new();
    let mut best = [f64::INFINITY; 3];
    for _ in 0..ROUNDS {
        for (tracer, best) in tracers.into_iter().zip(&mut best) {
            let moves = tracer.scene().arrangement.window.is_some();
            let (start, mut frames) = (thread_time(), 0);
            let seconds = loop {
                for Strip { directions, times_s } in strips {
                    hits.clear();
                    hits.resize(directions.len(), None);
                    let times_s = moves.then_some(&times_s[..]);
                    let rays = Rays { times_s, ..Rays::unlimited(Origins::Common(eye), directions) };
                    tracer.cast(&rays, &mut hits);
                }
                frames += 1;
                let seconds = thread_time() - start;
                if seconds >= LEAST_S {
                    break seconds;
                }
            };
            *best = best.min(seconds / f64::from(frames));
        }
    }
    best
}

/// A plain with cars on it, each of which drives its own way at up to 20 m/s. They go through each other.
fn crowd(cars: usize) -> Scene {
    let far = 0.6 * SIDE_M as f32;
    let plain = SourceMesh {
        positions: vec![[-far, -far, 0.0], [far, -far, 0.0], [far, far, 0.0], [-far, far, 0.0]],
        parts: vec![SourcePart {
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            material: 0,
            ..SourcePart::default()
        }],
    };
    let mut rng = Rng::new(5);
    let ground = SourceInstance { world_from_mesh: DAffine3::IDENTITY, ..SourceInstance::default() };
    let car = |rng: &mut Rng| {
        let (x, y) = (0.5 * SIDE_M * rng.signed(), 0.5 * SIDE_M * rng.signed());
        let (sin, cos) = libm::sincos(std::f64::consts::PI * rng.signed());
        let rotation =
            glam::DMat3::from_cols(DVec3::new(cos, sin, 0.0), DVec3::new(-sin, cos, 0.0), DVec3::Z);
        let start = Pose { rotation, translation: DVec3::new(x, y, 0.9) };
        let linear_m_s = DVec3::new(20.0 * rng.unit(), 0.0, 0.0);
        let angular_rad_s = DVec3::new(0.0, 0.0, 0.3 * rng.signed());
        let link = Link::Rigid(Trajectory::Twist { start, linear_m_s, angular_rad_s });
        SourceInstance {
            mesh: 1,
            world_from_mesh: DAffine3 { matrix3: rotation, translation: start.translation },
            motion: Some(Arc::new(Motion { links: vec![link] })),
            ..SourceInstance::default()
        }
    };
    let cars = (0..cars).map(|_| car(&mut rng)).collect::<Vec<_>>();
    SceneBuilder {
        meshes: vec![plain, body()],
        instances: [ground].into_iter().chain(cars).collect(),
        materials: vec![Material::default()],
        files: vec![],
        groups: vec![],
    }
    .build()
    .expect("a scene")
}

/// A car's body: a rounded box of some two thousand triangles.
fn body() -> SourceMesh {
    const AROUND: u32 = 48;
    const UP: u32 = 24;
    let mut positions = Vec::new();
    for i in 0..=UP {
        for j in 0..AROUND {
            let (sin, cos) = libm::sincos(std::f64::consts::PI * f64::from(i) / f64::from(UP));
            let (y, x) = libm::sincos(std::f64::consts::TAU * f64::from(j) / f64::from(AROUND));
            let rounded = |v: f64, half: f64| (half * v.signum() * v.abs().sqrt()) as f32;
            positions.push([rounded(x * sin, 2.2), rounded(y * sin, 0.9), rounded(cos, 0.75)]);
        }
    }
    let at = |i: u32, j: u32| i * AROUND + j % AROUND;
    let mut triangles = Vec::new();
    for i in 0..UP {
        for j in 0..AROUND {
            if i > 0 {
                triangles.push([at(i, j), at(i + 1, j), at(i, j + 1)]);
            }
            if i + 1 < UP {
                triangles.push([at(i, j + 1), at(i + 1, j), at(i + 1, j + 1)]);
            }
        }
    }
    SourceMesh { positions, parts: vec![SourcePart { triangles, material: 0, ..SourcePart::default() }] }
}
