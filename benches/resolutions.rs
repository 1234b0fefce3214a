//! Casts the patterns of coarse and of fine sensors at four scenes, as packets and ray by ray, to find patterns that are slow
//! for their number of rays.
//!
//! `cargo bench --bench resolutions` prints a row a pattern and scene: millions of rays a second as the tracer casts them, the
//! same ray by ray, and the ratio of the two. The two take turns, and each figure is the least CPU time of several rounds on one
//! thread. A ratio below 0.9 is marked: there, packets cost more than they save. `--scene NAME` and `--rounds N` choose, and
//! `--counts yes` prints the work behind each figure.

mod arguments;
mod timing;

use std::path::Path;

use beamcast::frame::UpAxis;
use beamcast::rng::Rng;
use beamcast::scene::{Material, Scene, SceneBuilder, SourceInstance, SourceMesh, SourcePart, gltf};
use beamcast::trace::{Cast, Hit, Origins, Rays, Tracer};
use glam::{DAffine3, DVec3};

use arguments::Arguments;
use timing::thread_time;

/// The pixels of a tile, and the tiles of a strip, which is one batch: those of a scan.
const TILE: (usize, usize) = (8, 16);
const TILES: usize = 16;

fn main() {
    let Some(arguments) = Arguments::read() else { return };
    let rounds = arguments.rounds(7);
    println!("{:<10} {:<18} {:>10} {:>10} {:>7}", "scene", "pattern", "Mrays/s", "singly", "ratio");
    let mut cliffs = 0;
    for (name, scene, eye) in [room(), street(), street_flattened(), forest(), terrain()] {
        if arguments.option("--scene").is_some_and(|wanted| wanted != name) {
            continue;
        }
        let scene = scene();
        let tracer = Tracer::build(&scene);
        let alone = tracer.clone().ray_by_ray();
        for pattern in patterns() {
            let strips = pattern.strips();
            let rays: usize = strips.iter().map(Vec::len).sum();
            let [both, singly] = least_times(rounds, [&tracer, &alone], eye, &strips);
            let rate = |seconds: f64| rays as f64 / seconds * 1e-6;
            let ratio = singly / both;
            cliffs += usize::from(ratio < 0.9);
            let mark = if ratio < 0.9 { " <" } else { "" };
            let label = pattern.label();
            println!("{name:<10} {label:<18} {:>10.3} {:>10.3} {ratio:>7.2}{mark}", rate(both), rate(singly));
            if arguments.option("--counts").is_some() {
                counts(&tracer, eye, &strips, rays, both);
                counts(&alone, eye, &strips, rays, singly);
            }
        }
    }
    println!("{cliffs} patterns are more than a tenth slower than their rays one by one.");
}

/// Prints the work a ray.
fn counts(tracer: &Tracer, eye: DVec3, strips: &[Vec<DVec3>], rays: usize, seconds: f64) {
    let mut hits = vec![None; TILE.0 * TILE.1 * TILES];
    let mut sum = beamcast::trace::TraversalStats::default();
    for directions in strips {
        let rays = Rays::unlimited(Origins::Common(eye), directions);
        sum += tracer.cast_counted(&rays, &mut hits[..directions.len()]);
    }
    let per = |n: u64| n as f64 / rays as f64;
    println!(
        "    ns {:.1} nodes {:.3} leaves {:.3} tests {:.3}",
        seconds / rays as f64 * 1e9,
        per(sum.nodes),
        per(sum.leaves),
        per(sum.tests)
    );
}

/// The least CPU time in seconds in which each of two tracers casts all strips.
fn least_times(rounds: usize, tracers: [&Tracer; 2], eye: DVec3, strips: &[Vec<DVec3>]) -> [f64; 2] {
    /// The least duration of a measurement, because the scheduler accounts for CPU time only every few milliseconds.
    const LEAST_S: f64 = 0.03;
    let mut hits: Vec<Option<Hit>> = vec![None; TILE.0 * TILE.1 * TILES];
    let mut best = [f64::INFINITY; 2];
    for _ in 0..rounds {
        for (tracer, best) in tracers.into_iter().zip(&mut best) {
            let (start, mut times) = (thread_time(), 0);
            loop {
                for directions in strips {
                    let rays = Rays::unlimited(Origins::Common(eye), directions);
                    tracer.cast(&rays, &mut hits[..directions.len()]);
                }
                times += 1;
                let seconds = thread_time() - start;
                if seconds >= LEAST_S {
                    *best = best.min(seconds / f64::from(times));
                    break;
                }
            }
        }
    }
    best
}

/// A pattern of rays: rows × columns.
#[derive(Clone, Copy)]
enum Pattern {
    /// A pinhole camera, 90 degrees wide.
    Camera { width: usize, height: usize },
    /// Beams from 15 degrees above the horizon to 25 below, over a full turn.
    Lidar { beams: usize, columns: usize },
}

fn patterns() -> Vec<Pattern> {
    let camera = |(width, height)| Pattern::Camera { width, height };
    let lidar = |(beams, columns)| Pattern::Lidar { beams, columns };
    let cameras = [(8, 8), (32, 24), (64, 48), (160, 120), (640, 480), (1920, 1080), (3840, 2160)];
    let lidars = [
        (1, 360),
        (1, 1440),
        (16, 90),
        (16, 360),
        (16, 1800),
        (32, 180),
        (64, 512),
        (128, 32),
        (128, 128),
        (128, 512),
        (128, 2048),
        (128, 4096),
    ];
    cameras.map(camera).into_iter().chain(lidars.map(lidar)).collect()
}

impl Pattern {
    fn label(self) -> String {
        match self {
            Self::Camera { width, height } => format!("camera {width} x {height}"),
            Self::Lidar { beams, columns } => format!("LiDAR {beams} x {columns}"),
        }
    }

    fn size(self) -> (usize, usize) {
        match self {
            Self::Camera { width, height } => (height, width),
            Self::Lidar { beams, columns } => (beams, columns),
        }
    }

    fn direction(self, row: usize, column: usize) -> DVec3 {
        match self {
            Self::Camera { width, height } => {
                let (w, h) = (width as f64, height as f64);
                let y = (w / 2.0 - column as f64 - 0.5) / (w / 2.0);
                let z = (h / 2.0 - row as f64 - 0.5) / (w / 2.0);
                DVec3::new(1.0, y, z).normalize()
            }
            Self::Lidar { beams, columns } => {
                let azimuth = std::f64::consts::TAU * column as f64 / columns as f64;
                let share = if beams > 1 { row as f64 / (beams - 1) as f64 } else { 0.4 };
                let elevation = (15.0 - 40.0 * share).to_radians();
                let (sin, cos) = libm::sincos(elevation);
                let (y, x) = libm::sincos(azimuth);
                DVec3::new(x * cos, -y * cos, sin)
            }
        }
    }

    /// The directions of the strips of the image, tile by tile, as a scan casts them.
    fn strips(self) -> Vec<Vec<DVec3>> {
        let (rows, columns) = self.size();
        let width = TILES * TILE.1;
        let mut strips = Vec::new();
        for top in (0..rows).step_by(TILE.0) {
            for left in (0..columns).step_by(width) {
                let mut strip = Vec::new();
                for first in (left..columns.min(left + width)).step_by(TILE.1) {
                    for row in top..rows.min(top + TILE.0) {
                        for column in first..columns.min(left + width).min(first + TILE.1) {
                            strip.push(self.direction(row, column));
                        }
                    }
                }
                strips.push(strip);
            }
        }
        strips
    }
}

/// A name, a function that makes the scene, and the place of the sensor.
type Place = (&'static str, fn() -> Scene, DVec3);

fn room() -> Place {
    ("room", || shipped("scenes/room.glb"), DVec3::new(0.3, 0.2, 1.3))
}

fn street() -> Place {
    ("street", || shipped("scenes/street.glb"), DVec3::new(0.3, 0.2, 2.0))
}

fn street_flattened() -> Place {
    ("flattened", || flattened(&shipped("scenes/street.glb")), DVec3::new(0.3, 0.2, 2.0))
}

/// Trees whose crowns are loose triangles.
fn forest() -> Place {
    let scene = || {
        let mut rng = Rng::new(1);
        let mut mesh = Mesh::default();
        for _ in 0..2500 {
            let (x, y) = (100.0 * rng.signed(), 100.0 * rng.signed());
            if x.abs().max(y.abs()) < 2.0 {
                continue;
            }
            let (height, radius) = (4.0 + 4.0 * rng.unit(), 1.0 + rng.unit());
            for _ in 0..300 {
                let middle = DVec3::new(x, y, height) + radius * rng.point();
                mesh.triangle([(); 3].map(|()| middle + 0.15 * rng.point()));
            }
            let (low, high) = (DVec3::new(x, y, 0.0), DVec3::new(x, y, height));
            for (a, b) in [(DVec3::X, DVec3::Y), (DVec3::Y, -DVec3::X), (-DVec3::X, -DVec3::Y)] {
                mesh.triangle([low + 0.15 * a, low + 0.15 * b, high + 0.15 * a]);
                mesh.triangle([low + 0.15 * b, high + 0.15 * b, high + 0.15 * a]);
            }
        }
        let far = 120.0;
        let corner = |x: f64, y: f64| DVec3::new(far * x, far * y, 0.0);
        mesh.triangle([corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0)]);
        mesh.triangle([corner(-1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)]);
        mesh.into_scene()
    };
    ("forest", scene, DVec3::new(0.3, 0.2, 1.8))
}

/// Hills of a million triangles, 400 m across.
fn terrain() -> Place {
    let scene = || {
        const SIDE: usize = 708;
        let height = |x: f64, y: f64| {
            let mut sum = 0.0;
            let (mut amplitude, mut scale) = (6.0, 0.02);
            for octave in 0..8 {
                let turn = f64::from(octave) * 1.3;
                sum += amplitude * libm::sin(x * scale + turn) * libm::cos(y * scale * 1.1 - turn);
                (amplitude, scale) = (amplitude * 0.45, scale * 2.1);
            }
            sum
        };
        let mut mesh = Mesh::default();
        let at = |k: usize| 400.0 * (k as f64 / SIDE as f64 - 0.5);
        let ground = height(0.3, 0.2);
        for i in 0..SIDE {
            for j in 0..SIDE {
                let corner = |i, j| DVec3::new(at(i), at(j), height(at(i), at(j)) - ground);
                mesh.triangle([corner(i, j), corner(i + 1, j), corner(i + 1, j + 1)]);
                mesh.triangle([corner(i, j), corner(i + 1, j + 1), corner(i, j + 1)]);
            }
        }
        mesh.into_scene()
    };
    ("terrain", scene, DVec3::new(0.3, 0.2, 2.5))
}

fn shipped(path: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    let options = gltf::Options { up: UpAxis::Z, ..gltf::Options::default() };
    gltf::load(&path, path.to_str().expect("a path of UTF-8"), &options).expect("a scene that loads").scene
}

/// The same triangles, all in one mesh.
fn flattened(scene: &Scene) -> Scene {
    let mut mesh = Mesh::default();
    for placement in &scene.arrangement.placements {
        let stored = scene.mesh(placement.mesh);
        for triangle in &stored.triangles {
            mesh.triangle(triangle.map(|v| {
                let position = stored.positions[v as usize].map(f64::from);
                placement.scene_from_mesh().transform_point3(DVec3::from_array(position))
                    + scene.geometry.centre
            }));
        }
    }
    mesh.into_scene()
}

/// Triangles without shared vertices.
#[derive(Default)]
struct Mesh {
    positions: Vec<[f32; 3]>,
}

impl Mesh {
    fn triangle(&mut self, corners: [DVec3; 3]) {
        self.positions.extend(corners.map(|c| c.as_vec3().to_array()));
    }

    fn into_scene(self) -> Scene {
        let count = self.positions.len() as u32 / 3;
        let triangles = (0..count).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        let parts = vec![SourcePart { triangles, material: 0, ..SourcePart::default() }];
        let mesh = SourceMesh { positions: self.positions, parts };
        let world_from_mesh = DAffine3::IDENTITY;
        let instances = vec![SourceInstance { mesh: 0, world_from_mesh, ..SourceInstance::default() }];
        let materials = vec![Material::default()];
        SceneBuilder { meshes: vec![mesh], instances, materials, files: vec![], groups: vec![] }
            .build()
            .expect("a scene")
    }
}
