use beamcast::scene::*;
use beamcast::trace::*;
use glam::DVec3;
use std::time::Instant;
fn floats(p: &str) -> Vec<f32> {
    std::fs::read(p).unwrap().chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
}
fn cpu() -> f64 {
    std::fs::read_to_string("/proc/thread-self/schedstat")
        .unwrap()
        .split(' ')
        .next()
        .unwrap()
        .parse::<f64>()
        .unwrap()
        * 1e-9
}
fn main() {
    let args: Vec<String> = std::env::args().collect();
    let dir = &args[1];
    for name in args[2].split(',') {
        let raw = std::fs::read(format!("{dir}/{name}.mesh")).unwrap();
        let u = |i: usize| u32::from_le_bytes(raw[i * 4..i * 4 + 4].try_into().unwrap());
        let (nv, nt) = (u(0) as usize, u(1) as usize);
        let positions = (0..nv).map(|i| [0, 1, 2].map(|k| f32::from_bits(u(2 + 3 * i + k)))).collect();
        let triangles = (0..nt).map(|i| [0, 1, 2].map(|k| u(2 + 3 * nv + 3 * i + k))).collect();
        let mut scene = Scene::default();
        scene.meshes.push(Mesh {
            positions,
            triangles,
            parts: vec![Part { first_triangle: 0, material: 0, instance: 0 }],
        });
        scene.placements.push(Placement {
            mesh: 0,
            scene_from_mesh: glam::DAffine3::IDENTITY,
            mesh_from_scene: glam::DAffine3::IDENTITY,
            first_triangle: 0,
            first_instance: 0,
        });
        let (c0, w0) = (cpu(), Instant::now());
        let tracer = Tracer::build(&scene);
        println!(
            "{name}: build cpu {:.2} wall {:.2} bytes/tri {:.1}",
            cpu() - c0,
            w0.elapsed().as_secs_f64(),
            tracer.bytes() as f64 / nt as f64
        );
        for kind in args[3].split(',') {
            let r = floats(&format!("{dir}/{name}.{kind}"));
            let n = r.len() / 6;
            let (w, th, tw) = match kind {
                "camera" => (1920, 8, 8),
                "single" => (n, 1, 64),
                _ => (2048, 8, 8),
            };
            let h = n / w;
            let ray = |i: usize| {
                (
                    DVec3::new(r[6 * i] as f64, r[6 * i + 1] as f64, r[6 * i + 2] as f64),
                    DVec3::new(r[6 * i + 3] as f64, r[6 * i + 4] as f64, r[6 * i + 5] as f64),
                )
            };
            let mut hits = vec![None; n];
            let mut best = f64::INFINITY;
            let mut nh = 0;
            for rep in 0..std::env::var("REP").map_or(5, |r| r.parse().unwrap()) {
                let _ = rep;
                let (c0, w0) = (cpu(), Instant::now());
                let mut buf = vec![None; 64];
                let mut dirs = Vec::new();
                if kind == "single" || kind == "moving" {
                    for i in 0..n {
                        let i = if kind == "moving" { (i % h) * w + i / h } else { i };
                        let (o, d) = ray(i);
                        tracer.cast(
                            &Rays { origin: o, directions: &[d], t_min: 0.0, t_max: f64::INFINITY },
                            &mut hits[i..i + 1],
                        );
                    }
                } else {
                    for ty in (0..h).step_by(th) {
                        for tx in (0..w).step_by(tw) {
                            dirs.clear();
                            let mut idx = [0usize; 64];
                            let mut k = 0;
                            if kind == "camera" {
                                for by in 0..(th / 2) {
                                    for bx in 0..(tw / 4) {
                                        for y in 0..2 {
                                            for x in 0..4 {
                                                idx[k] = (ty + by * 2 + y).min(h - 1) * w + tx + bx * 4 + x;
                                                k += 1;
                                            }
                                        }
                                    }
                                }
                            } else {
                                for y in 0..th {
                                    for x in 0..tw {
                                        idx[k] = (ty + y) * w + tx + x;
                                        k += 1;
                                    }
                                }
                            }
                            for &i in &idx[..k] {
                                dirs.push(ray(i).1);
                            }
                            tracer.cast(
                                &Rays {
                                    origin: ray(idx[0]).0,
                                    directions: &dirs,
                                    t_min: 0.0,
                                    t_max: f64::INFINITY,
                                },
                                &mut buf[..k],
                            );
                            for (j, &i) in idx[..k].iter().enumerate() {
                                hits[i] = buf[j];
                            }
                        }
                    }
                }
                let _ = c0;
                best = best.min(w0.elapsed().as_secs_f64());
            }
            nh += hits.iter().flatten().count();
            println!("  {kind}: {:.2} Mrays/s ({nh} hits)", n as f64 / best / 1e6);
            if args.len() > 4 {
                let t: Vec<u8> =
                    hits.iter().flat_map(|h| h.map_or(f64::INFINITY, |h| h.t).to_le_bytes()).collect();
                std::fs::write(format!("{dir}/{name}.{kind}.t"), t).unwrap();
            }
        }
    }
}
