//! Casts rays from files against a scene on command. It is the part of `benches/open3d/bench.py` that is measured.
//!
//! `caster SCENE.glb [triangles]` builds the tracer and answers with a line of JSON. Then it reads commands from stdin, one
//! on each line, and answers each with a line of JSON:
//!
//! | command | does |
//! |---|---|
//! | `rays FILE` | reads rays: u64 n, u64 m, n directions, m origins (1 for all, or n), each three f64, little-endian |
//! | `cast 1` | casts them on this thread, again and again: CPU seconds of a cast, and wall seconds |
//! | `cast N` | casts them on N threads: wall seconds |
//! | `hits FILE` | casts them once more and writes the depths (f64, infinite for a miss) and triangle ids (u32) |
//!
//! Hits are written in full (f64 depth, u, v, normal, ids), one work item at a time, into memory that is reused, as in a
//! scan.

mod timing;

use std::cell::RefCell;
use std::io::BufRead;
use std::path::{Path, PathBuf};
use std::time::Instant;

use beamcast::frame::UpAxis;
use beamcast::scene::{Scene, gltf};
use beamcast::trace::{Cast, Hit, Origins, Rays, Tracer};
use glam::DVec3;
use rayon::prelude::*;

use timing::thread_time;

/// The number of rays of a work item: enough packets of 128 rays that distributing the items costs nothing.
const ITEM: usize = 128 * 16;

/// The least duration of a measurement, in seconds. Rays are cast again until then, because the scheduler accounts for CPU
/// time only every few milliseconds.
const LEAST_S: f64 = 0.2;

fn main() {
    let Some(path) = std::env::args().nth(1).filter(|a| !a.starts_with('-')) else {
        println!("benches/open3d/bench.py runs this: see there");
        return;
    };
    let start = Instant::now();
    let options = gltf::Options { up: UpAxis::Y, ..gltf::Options::default() };
    let scene = gltf::load(Path::new(&path), &path, &options).expect("a scene that loads").scene;
    let load_s = start.elapsed().as_secs_f64();
    let start = Instant::now();
    let tracer = Tracer::build(&scene);
    let build_s = start.elapsed().as_secs_f64();
    println!(
        r#"{{"load_s": {load_s}, "build_s": {build_s}, "triangles": {}, "bytes": {}, "peak": {}, "resident": {}}}"#,
        scene.triangle_count(),
        tracer.bytes(),
        status("VmHWM:"),
        status("VmRSS:"),
    );
    let mut caster = Caster { scene, tracer, origins: vec![], directions: vec![] };
    for line in std::io::stdin().lock().lines().map_while(Result::ok) {
        let (command, argument) = line.split_once(' ').unwrap_or((&line, ""));
        let answer = match command {
            "rays" => caster.read(&PathBuf::from(argument)),
            "cast" => caster.cast(argument.parse().expect("a number of threads")),
            "hits" => caster.write(&PathBuf::from(argument)),
            _ => panic!("unknown command {command}"),
        };
        println!("{answer}");
    }
}

thread_local! {
    /// The hits of a thread's current work item.
    static HITS: RefCell<Vec<Option<Hit>>> = const { RefCell::new(Vec::new()) };
}

struct Caster {
    scene: Scene,
    tracer: Tracer,
    origins: Vec<DVec3>,
    directions: Vec<DVec3>,
}

impl Caster {
    fn read(&mut self, path: &Path) -> String {
        let bytes = std::fs::read(path).expect("a file of rays");
        let (head, numbers) = bytes.split_at(16);
        let count = |k: usize| u64::from_le_bytes(head[8 * k..8 * k + 8].try_into().unwrap()) as usize;
        let vectors: Vec<DVec3> = numbers
            .chunks_exact(24)
            .map(|v| {
                DVec3::from_slice(&[0, 8, 16].map(|k| f64::from_le_bytes(v[k..k + 8].try_into().unwrap())))
            })
            .collect();
        let (n, m) = (count(0), count(1));
        assert_eq!(vectors.len(), n + m);
        self.directions = vectors[..n].to_vec();
        self.origins = vectors[n..].to_vec();
        format!(r#"{{"rays": {n}}}"#)
    }

    fn cast(&self, threads: usize) -> String {
        let (origins, directions) = (&self.origins, &self.directions);
        let rays = |item: usize| {
            let range = item * ITEM..((item + 1) * ITEM).min(directions.len());
            let origins = match origins[..] {
                [one] => Origins::Common(one),
                _ => Origins::Each(&origins[range.clone()]),
            };
            Rays::unlimited(origins, &directions[range])
        };
        let tracer = &self.tracer;
        let items = directions.len().div_ceil(ITEM);
        let cast = |item: usize| {
            let rays = rays(item);
            HITS.with_borrow_mut(|hits| {
                hits.resize(rays.directions.len(), None);
                tracer.cast(&rays, hits);
            });
        };
        let (start, cpu) = (Instant::now(), thread_time());
        let mut times = 0_u32;
        if threads == 1 {
            while start.elapsed().as_secs_f64() < LEAST_S {
                (0..items).for_each(cast);
                times += 1;
            }
        } else {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            while start.elapsed().as_secs_f64() < LEAST_S {
                pool.install(|| (0..items).into_par_iter().for_each(cast));
                times += 1;
            }
        }
        let a_cast = |seconds: f64| seconds / f64::from(times);
        let (cpu, wall) = (thread_time() - cpu, start.elapsed().as_secs_f64());
        format!(r#"{{"cpu_s": {}, "wall_s": {}}}"#, a_cast(cpu), a_cast(wall))
    }

    fn write(&self, path: &Path) -> String {
        let mut hits = vec![None; self.directions.len()];
        let origins = match self.origins[..] {
            [one] => Origins::Common(one),
            _ => Origins::Each(&self.origins),
        };
        let rays = Rays::unlimited(origins, &self.directions);
        self.tracer.cast(&rays, &mut hits);
        let mut bytes = Vec::with_capacity(hits.len() * 12);
        for hit in &hits {
            bytes.extend(hit.map_or(f64::INFINITY, |h| h.t).to_le_bytes());
        }
        for hit in &hits {
            let id = hit.map_or(u32::MAX, |h| {
                self.scene.arrangement.placements[h.placement as usize].first_triangle + h.triangle
            });
            bytes.extend(id.to_le_bytes());
        }
        std::fs::write(path, bytes).expect("a file for hits");
        format!(r#"{{"hits": {}}}"#, hits.iter().flatten().count())
    }
}

/// The value in bytes of a line of /proc/self/status.
fn status(key: &str) -> u64 {
    let text = std::fs::read_to_string("/proc/self/status").expect("Linux");
    let line = text.lines().find_map(|l| l.strip_prefix(key)).unwrap();
    line.trim().trim_end_matches(" kB").trim().parse::<u64>().unwrap() * 1024
}
