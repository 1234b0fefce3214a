//! Casts rays at scenes of placed meshes: what a hierarchy of two levels costs.
//!
//! `cargo bench --bench placed` prints a row a scene and pattern: millions of rays a second, as the least CPU time of several
//! rounds on one thread, and a hash of all hits, which must stay the same whatever the tracer does. `--scene NAME` and `--pattern NAME`
//! choose by the beginning of a name, `--rounds N` sets the number of rounds, and `--counts yes` prints the work behind each figure. To compare two versions, run their executables in turns.
//!
//! | scene | what it is |
//! |---|---|
//! | `street`, `warehouse` | the shipped scenes, as they are placed |
//! | `street-flat`, `warehouse-flat` | the same triangles in one mesh: what placing costs |
//! | `field-N` | N boulders of 702 triangles on a plain, turned and scaled, three metres apart |
//! | `field-N-flat` | the same triangles in one mesh |
//! | `yard-N` | ten boulders in a yard with walls, and N − 10 behind them: the same rays hit the same triangles for each N |
//! | `meshes-N` | N small meshes, each placed twice: the time to build the hierarchies |
//!
//! `lidar` and `camera` are rays from one point. `bounce` are rays from where the camera's rays hit, in all directions, as of
//! light that goes on from there, and `shadow` asks whether a lamp sees what these hit.

mod arguments;
mod timing;

use std::path::Path;
use std::time::Instant;

use beamcast::frame::UpAxis;
use beamcast::rng::Rng;
use beamcast::scene::{Material, Scene, SceneBuilder, SourceInstance, SourceMesh, SourcePart, gltf};
use beamcast::trace::{Cast, Hit, Origins, Rays, Tracer};
use glam::{DAffine3, DQuat, DVec3};

use arguments::Arguments;
use timing::thread_time;

/// The pixels of a tile, and the tiles of a strip, which is one batch: those of a scan.
const TILE: (usize, usize) = (8, 16);
const TILES: usize = 16;

/// The directions in which light goes on from each hit of the camera.
const BOUNCES: usize = 16;

fn main() {
    let Some(arguments) = Arguments::read() else { return };
    let rounds = arguments.rounds(5);
    let is_chosen = |option: Option<&str>, name: &str| option.is_none_or(|wanted| name.starts_with(wanted));
    println!("{:<18} {:<8} {:>9} {:>8}  {:<16}", "scene", "pattern", "Mrays/s", "hit", "hash");
    for (name, make) in scenes() {
        if !is_chosen(arguments.option("--scene"), &name) {
            continue;
        }
        let (scene, eye) = make();
        let (cpu, wall) = (process_time(), Instant::now());
        let tracer = Tracer::build(&scene);
        println!(
            "{name:<18} build {:.3} s, {:.3} s of CPU, {:.1} MB, {} placements",
            wall.elapsed().as_secs_f64(),
            process_time() - cpu,
            tracer.bytes() as f64 * 1e-6,
            scene.arrangement.placements.len()
        );
        if name.starts_with("meshes") {
            continue;
        }
        for (pattern, batches) in patterns(&tracer, eye) {
            if is_chosen(arguments.option("--pattern"), pattern) {
                let count: usize = batches.iter().map(|batch| batch.directions.len()).sum();
                let seconds = least_time(rounds, &tracer, &batches);
                let (hits, hash) = hash(&tracer, &batches);
                println!(
                    "{name:<18} {pattern:<8} {:>9.3} {:>7.1}%  {hash:016x}",
                    count as f64 / seconds * 1e-6,
                    hits as f64 / count as f64 * 100.0
                );
                if arguments.option("--counts").is_some() {
                    counts(&tracer, &batches, count);
                }
            }
        }
    }
}

/// Rays that are cast in one call.
struct RayBatch {
    /// One for all rays, or one each.
    origins: Vec<DVec3>,
    directions: Vec<DVec3>,
    /// Asks whether anything lies between, not for hits.
    is_shadow: bool,
}

impl RayBatch {
    fn rays(&self) -> Rays<'_> {
        let origins = match self.origins[..] {
            [common] => Origins::Common(common),
            _ => Origins::Each(&self.origins),
        };
        let rays = Rays::unlimited(origins, &self.directions);
        if self.is_shadow { Rays { t_max: 1.0 - 1e-9, ..rays } } else { rays }
    }
}

/// The memory for the answers to a batch.
#[derive(Default)]
struct Answers {
    hits: Vec<Option<Hit>>,
    blocked: Vec<bool>,
}

impl Answers {
    fn ask(&mut self, tracer: &Tracer, batch: &RayBatch) {
        if batch.is_shadow {
            self.blocked.resize(batch.directions.len(), false);
            tracer.blocked(&batch.rays(), &mut self.blocked);
        } else {
            self.hits.resize(batch.directions.len(), None);
            tracer.cast(&batch.rays(), &mut self.hits);
        }
    }
}

/// The least CPU time in seconds in which a tracer casts all batches.
fn least_time(rounds: usize, tracer: &Tracer, batches: &[RayBatch]) -> f64 {
    /// The least duration of a measurement, because the scheduler accounts for CPU time only every few milliseconds.
    const LEAST_S: f64 = 0.03;
    let mut answers = Answers::default();
    let mut best = f64::INFINITY;
    for _ in 0..rounds {
        let (start, mut times) = (thread_time(), 0);
        let seconds = loop {
            for batch in batches {
                answers.ask(tracer, batch);
            }
            times += 1;
            let seconds = thread_time() - start;
            if seconds >= LEAST_S {
                break seconds / f64::from(times);
            }
        };
        best = best.min(seconds);
    }
    best
}

/// Prints the work a ray.
fn counts(tracer: &Tracer, batches: &[RayBatch], rays: usize) {
    let mut answers = Answers::default();
    let mut sum = beamcast::trace::TraversalStats::default();
    for batch in batches {
        answers.hits.resize(batch.directions.len(), None);
        sum += tracer.cast_counted(&batch.rays(), &mut answers.hits);
    }
    let per = |n: u64| n as f64 / rays as f64;
    println!("    nodes {:.3} leaves {:.3} tests {:.3}", per(sum.nodes), per(sum.leaves), per(sum.tests));
}

/// The number of hits, and a hash of the bits of all answers.
fn hash(tracer: &Tracer, batches: &[RayBatch]) -> (usize, u64) {
    let mut answers = Answers::default();
    let (mut hits, mut hash) = (0, 0_u64);
    for batch in batches {
        answers.ask(tracer, batch);
        let mut mix = |bits: u64| hash = (hash.rotate_left(5) ^ bits).wrapping_mul(0x517c_c1b7_2722_0a95);
        if batch.is_shadow {
            for &blocked in &answers.blocked {
                mix(u64::from(blocked));
                hits += usize::from(blocked);
            }
            continue;
        }
        for hit in &answers.hits {
            mix(u64::from(hit.is_some()));
            if let Some(Hit { t, u, v, normal, placement, triangle }) = hit {
                hits += 1;
                [*t, *u, *v, normal.x, normal.y, normal.z].into_iter().for_each(|x| mix(x.to_bits()));
                mix(u64::from(*placement) << 32 | u64::from(*triangle));
            }
        }
    }
    (hits, hash)
}

/// The CPU seconds of this process.
fn process_time() -> f64 {
    let text = std::fs::read_to_string("/proc/self/stat").expect("Linux");
    let fields: Vec<&str> = text.rsplit(')').next().unwrap().split_whitespace().collect();
    // User and system time, in the hundredths of a second that Linux counts them in.
    (fields[11].parse::<f64>().unwrap() + fields[12].parse::<f64>().unwrap()) / 100.0
}

/// The patterns of rays from an eye, by name.
fn patterns(tracer: &Tracer, eye: DVec3) -> Vec<(&'static str, Vec<RayBatch>)> {
    let camera = strips((480, 640), camera_direction);
    let (bounce, shadow) = bounced(tracer, eye, &strips((120, 160), camera_direction));
    let of_eye = |strips: Vec<Vec<DVec3>>| {
        let batch = |directions| RayBatch { origins: vec![eye], directions, is_shadow: false };
        strips.into_iter().map(batch).collect()
    };
    vec![
        ("lidar", of_eye(strips((128, 2048), lidar_direction))),
        ("camera", of_eye(camera)),
        ("bounce", bounce),
        ("shadow", shadow),
    ]
}

/// A pinhole camera, 90 degrees wide.
fn camera_direction((row, column): (usize, usize), (rows, columns): (usize, usize)) -> DVec3 {
    let (w, h) = (columns as f64, rows as f64);
    let y = (w / 2.0 - column as f64 - 0.5) / (w / 2.0);
    let z = (h / 2.0 - row as f64 - 0.5) / (w / 2.0);
    DVec3::new(1.0, y, z).normalize()
}

/// Beams from 15 degrees above the horizon to 25 below, over a full turn.
fn lidar_direction((row, column): (usize, usize), (rows, columns): (usize, usize)) -> DVec3 {
    let azimuth = std::f64::consts::TAU * column as f64 / columns as f64;
    let elevation = (15.0 - 40.0 * row as f64 / (rows - 1) as f64).to_radians();
    let (sin, cos) = libm::sincos(elevation);
    let (y, x) = libm::sincos(azimuth);
    DVec3::new(x * cos, -y * cos, sin)
}

/// The directions of the strips of an image, tile by tile, as a scan casts them.
fn strips(
    size: (usize, usize),
    direction: impl Fn((usize, usize), (usize, usize)) -> DVec3,
) -> Vec<Vec<DVec3>> {
    let (rows, columns) = size;
    let width = TILES * TILE.1;
    let mut strips = Vec::new();
    for top in (0..rows).step_by(TILE.0) {
        for left in (0..columns).step_by(width) {
            let mut strip = Vec::new();
            for first in (left..columns.min(left + width)).step_by(TILE.1) {
                for row in top..rows.min(top + TILE.0) {
                    for column in first..columns.min(left + width).min(first + TILE.1) {
                        strip.push(direction((row, column), size));
                    }
                }
            }
            strips.push(strip);
        }
    }
    strips
}

/// Rays that go on from where the rays of strips hit, evenly over the cosine-weighted hemisphere, and those from a lamp beside the eye
/// to what they meet.
fn bounced(tracer: &Tracer, eye: DVec3, strips: &[Vec<DVec3>]) -> (Vec<RayBatch>, Vec<RayBatch>) {
    let mut rng = Rng::new(11);
    let lamp = eye + DVec3::new(0.0, 0.03, 0.01);
    let (mut bounces, mut shadows) = (Vec::new(), Vec::new());
    for directions in strips {
        let mut hits = vec![None; directions.len()];
        tracer.cast(&Rays::unlimited(Origins::Common(eye), directions), &mut hits);
        let mut bounce = RayBatch { origins: vec![], directions: vec![], is_shadow: false };
        for (hit, &direction) in hits.iter().zip(directions) {
            let Some(hit) = hit else { continue };
            let normal = if hit.normal.dot(direction) > 0.0 { -hit.normal } else { hit.normal };
            for _ in 0..BOUNCES {
                bounce.origins.push(eye + hit.t * direction + 1e-6 * normal);
                let on_sphere = loop {
                    let point = rng.point();
                    if (0.01..=1.0).contains(&point.length()) {
                        break point.normalize();
                    }
                };
                bounce.directions.push((normal + 0.999 * on_sphere).normalize());
            }
        }
        if bounce.directions.len() < 2 {
            continue;
        }
        let mut met = vec![None; bounce.directions.len()];
        tracer.cast(&bounce.rays(), &mut met);
        let mut shadow = RayBatch { origins: vec![lamp], directions: vec![], is_shadow: true };
        for (k, hit) in met.iter().enumerate() {
            if let Some(hit) = hit {
                shadow.directions.push(bounce.origins[k] + hit.t * bounce.directions[k] - lamp);
            }
        }
        bounces.push(bounce);
        if !shadow.directions.is_empty() {
            shadows.push(shadow);
        }
    }
    (bounces, shadows)
}

/// A name, and a function that makes the scene and tells the place of the eye.
type NamedScene = (String, Box<dyn Fn() -> (Scene, DVec3)>);

fn scenes() -> Vec<NamedScene> {
    let mut scenes: Vec<NamedScene> = Vec::new();
    for (name, eye) in [("street", DVec3::new(0.3, 0.2, 2.0)), ("warehouse", DVec3::new(0.0, -0.05, 1.5))] {
        let path = format!("scenes/{name}.glb");
        let flat = path.clone();
        scenes.push((format!("{name}-as-placed"), Box::new(move || (shipped(&path), eye))));
        scenes.push((format!("{name}-flat"), Box::new(move || (flattened(&shipped(&flat)), eye))));
    }
    for count in [10, 1000, 10_000, 100_000] {
        scenes.push((format!("field-{count}-placed"), Box::new(move || field(count))));
        if count <= 10_000 {
            let flat = move || {
                let (scene, eye) = field(count);
                (flattened(&scene), eye)
            };
            scenes.push((format!("field-{count}-flat"), Box::new(flat)));
        }
        scenes.push((format!("yard-{count}"), Box::new(move || yard(count))));
    }
    scenes.push(("meshes-100000".to_owned(), Box::new(|| (small_meshes(100_000), DVec3::ZERO))));
    scenes
}

fn shipped(path: &str) -> Scene {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(path);
    let options = gltf::Options { up: UpAxis::Z, ..gltf::Options::default() };
    gltf::load(&path, path.to_str().expect("a path of UTF-8"), &options).expect("a scene that loads").scene
}

/// Boulders on a plain, in the cells of a square around the eye, which has no boulder in its own cell.
fn field(count: usize) -> (Scene, DVec3) {
    let mut places = Vec::new();
    let mut ring = 1_i32;
    while places.len() < count {
        let cells = (-ring..=ring).flat_map(|y| (-ring..=ring).map(move |x| (x, y)));
        places.extend(cells.filter(|(x, y)| x.abs().max(y.abs()) == ring));
        ring += 1;
    }
    places.truncate(count);
    let mut rng = Rng::new(5);
    let at = |(x, y): (i32, i32)| DVec3::new(3.0 * f64::from(x), 3.0 * f64::from(y), 0.5);
    let placed = places.into_iter().map(|place| turned(&mut rng, at(place))).collect();
    let half = 3.0 * f64::from(ring);
    (built(vec![boulder()], placed, plain(half)), DVec3::new(0.1, 0.2, 1.8))
}

/// Ten boulders in a yard, and the others behind its walls.
fn yard(count: usize) -> (Scene, DVec3) {
    let mut rng = Rng::new(5);
    let mut placed = Vec::new();
    for k in 0..10 {
        let (y, x) = libm::sincos(std::f64::consts::TAU * f64::from(k) / 10.0);
        placed.push(turned(&mut rng, DVec3::new(4.0 * x, 4.0 * y, 0.5)));
    }
    let columns = libm::ceil(libm::sqrt(count as f64)) as usize;
    for k in 10..count {
        let (column, row) = ((k % columns) as f64, (k / columns) as f64);
        placed
            .push(turned(&mut rng, DVec3::new(10.0 + 3.0 * column, 3.0 * (row - columns as f64 / 2.0), 0.5)));
    }
    let mut fixed = plain(7.0);
    for (a, b) in [((-7, -7), (7, -7)), ((7, -7), (7, 7)), ((7, 7), (-7, 7)), ((-7, 7), (-7, -7))] {
        let corner = |(x, y): (i32, i32), z: f32| [x as f32, y as f32, z];
        quad(&mut fixed, [corner(a, 0.0), corner(b, 0.0), corner(b, 6.0), corner(a, 6.0)]);
    }
    quad(&mut fixed, [[-7.0, -7.0, 6.0], [7.0, -7.0, 6.0], [7.0, 7.0, 6.0], [-7.0, 7.0, 6.0]]);
    (built(vec![boulder()], placed, fixed), DVec3::new(0.1, 0.2, 1.8))
}

/// Tetrahedra, each of them a mesh that is placed twice.
fn small_meshes(count: usize) -> Scene {
    let mut rng = Rng::new(6);
    let mut meshes = Vec::new();
    let mut placed = Vec::new();
    for k in 0..count {
        let positions = (0..4).map(|_| rng.point().as_vec3().to_array()).collect();
        meshes.push(of_triangles(positions, vec![[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]));
        for side in [-1.0, 1.0] {
            let at = DVec3::new((k % 300) as f64 * 3.0, side * (k / 300) as f64 * 3.0, 0.0);
            placed.push((k, DAffine3::from_translation(at)));
        }
    }
    build(meshes, placed, plain(900.0))
}

/// A boulder at a place, turned and scaled by chance.
fn turned(rng: &mut Rng, at: DVec3) -> DAffine3 {
    let axis = (rng.point() + DVec3::new(0.0, 0.0, 1.5)).normalize();
    let (sin, cos) = libm::sincos(1.5 * rng.signed());
    let turn = DQuat::from_xyzw(axis.x * sin, axis.y * sin, axis.z * sin, cos);
    DAffine3::from_scale_rotation_translation(DVec3::splat(0.8 + 0.4 * rng.unit()), turn, at)
}

/// A bumpy ellipsoid of 702 triangles.
fn boulder() -> SourceMesh {
    const AROUND: u32 = 27;
    const RINGS: u32 = 13;
    let mut positions = vec![[0.0, 0.0, 0.5_f32], [0.0, 0.0, -0.5]];
    for ring in 0..RINGS {
        for k in 0..AROUND {
            let (up, turn) = (
                std::f64::consts::PI * f64::from(ring + 1) / f64::from(RINGS + 1),
                std::f64::consts::TAU * f64::from(k) / f64::from(AROUND),
            );
            let ((sin, cos), (y, x)) = (libm::sincos(up), libm::sincos(turn));
            let radius = 1.0 + 0.12 * libm::sin(5.0 * turn + 3.0 * up) * sin;
            let point = DVec3::new(1.1 * x * sin, 0.6 * y * sin, 0.5 * cos) * radius;
            positions.push(point.as_vec3().to_array());
        }
    }
    let at = |ring: u32, k: u32| 2 + ring * AROUND + k % AROUND;
    let mut triangles = Vec::new();
    for k in 0..AROUND {
        triangles.extend([[0, at(0, k), at(0, k + 1)], [1, at(RINGS - 1, k + 1), at(RINGS - 1, k)]]);
        for ring in 1..RINGS {
            let (a, b) = (ring - 1, ring);
            triangles.extend([[at(a, k), at(b, k), at(b, k + 1)], [at(a, k), at(b, k + 1), at(a, k + 1)]]);
        }
    }
    of_triangles(positions, triangles)
}

/// A square on the ground, of many triangles.
fn plain(half: f64) -> SourceMesh {
    let mut mesh = SourceMesh::default();
    const SIDE: i32 = 20;
    for (i, j) in (0..SIDE).flat_map(|i| (0..SIDE).map(move |j| (i, j))) {
        let at = |k: i32| (half * (f64::from(2 * k) / f64::from(SIDE) - 1.0)) as f32;
        let (x, y, x2, y2) = (at(i), at(j), at(i + 1), at(j + 1));
        quad(&mut mesh, [[x, y, 0.0], [x2, y, 0.0], [x2, y2, 0.0], [x, y2, 0.0]]);
    }
    mesh
}

fn quad(mesh: &mut SourceMesh, corners: [[f32; 3]; 4]) {
    let first = mesh.positions.len() as u32;
    mesh.positions.extend(corners);
    if mesh.parts.is_empty() {
        mesh.parts.push(SourcePart::default());
    }
    mesh.parts[0].triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
}

fn of_triangles(positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>) -> SourceMesh {
    SourceMesh { positions, parts: vec![SourcePart { triangles, ..SourcePart::default() }] }
}

/// A scene of one mesh at many places, and of what stands still.
fn built(meshes: Vec<SourceMesh>, places: Vec<DAffine3>, fixed: SourceMesh) -> Scene {
    build(meshes, places.into_iter().map(|place| (0, place)).collect(), fixed)
}

fn build(mut meshes: Vec<SourceMesh>, placed: Vec<(usize, DAffine3)>, fixed: SourceMesh) -> Scene {
    let instance =
        |(mesh, world_from_mesh)| SourceInstance { mesh, world_from_mesh, ..SourceInstance::default() };
    let mut instances: Vec<SourceInstance> = placed.into_iter().map(instance).collect();
    instances.push(instance((meshes.len(), DAffine3::IDENTITY)));
    meshes.push(fixed);
    let materials = vec![Material::default()];
    SceneBuilder { meshes, instances, materials, files: vec![], groups: vec![] }.build().expect("a scene")
}

/// The same triangles, all in one mesh.
fn flattened(scene: &Scene) -> Scene {
    let mut positions = Vec::new();
    for placement in &scene.arrangement.placements {
        let stored = scene.mesh(placement.mesh);
        for &v in stored.triangles.iter().flatten() {
            let position = DVec3::from_array(stored.positions[v as usize].map(f64::from));
            let position = placement.scene_from_mesh().transform_point3(position) + scene.geometry.centre;
            positions.push(position.as_vec3().to_array());
        }
    }
    let count = positions.len() as u32 / 3;
    let triangles = (0..count).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
    build(vec![], vec![], of_triangles(positions, triangles))
}
