//! All hits of rays, one after the other.

use super::rays::{Cast, Hit, Origins, Rays};

/// Every hit of each ray within its limits, in the order (ray, depth, placement, triangle), each with the number of its ray. A
/// ray through an edge or a vertex hits all the triangles that share it.
///
/// The rays are cast again and again, each after its latest hit, until none has another, so the work grows with the hits.
///
/// # Panics
/// As [`Cast::cast`] does.
pub fn all_hits(tracer: &impl Cast, rays: &Rays) -> Vec<(u32, Hit)> {
    let count = rays.directions.len();
    let mut found = Vec::new();
    // The rays that may have another hit, and what is cast of them.
    let mut open: Vec<u32> = (0..count as u32).collect();
    let mut after: Vec<Option<Hit>> = rays.after.map_or(vec![None; count], <[_]>::to_vec);
    let (mut origins, mut directions, mut times_s) = (Vec::new(), rays.directions.to_vec(), Vec::new());
    if let Origins::Each(all) = rays.origins {
        origins = all.to_vec();
    }
    if let Some(all) = rays.times_s {
        times_s = all.to_vec();
    }
    let mut hits = vec![None; count];
    while !open.is_empty() {
        let batch = Rays {
            origins: match rays.origins {
                Origins::Common(origin) => Origins::Common(origin),
                Origins::Each(_) => Origins::Each(&origins),
            },
            directions: &directions,
            after: after.iter().any(Option::is_some).then_some(&after[..]),
            times_s: rays.times_s.map(|_| &times_s[..]),
            ..*rays
        };
        hits.truncate(open.len());
        tracer.cast(&batch, &mut hits);
        let mut kept = 0;
        for ray in 0..open.len() {
            let Some(hit) = hits[ray] else { continue };
            found.push((open[ray], hit));
            open[kept] = open[ray];
            after[kept] = Some(hit);
            keep(&mut directions, ray, kept);
            keep(&mut origins, ray, kept);
            keep(&mut times_s, ray, kept);
            kept += 1;
        }
        open.truncate(kept);
        after.truncate(kept);
        directions.truncate(kept);
        origins.truncate(kept);
        times_s.truncate(kept);
    }
    // Each ray's hits came in their order, and a stable sort keeps it.
    found.sort_by_key(|(ray, _)| *ray);
    found
}

/// Moves an element to its new place in a list that may be empty.
fn keep<T: Copy>(list: &mut [T], from: usize, to: usize) {
    if !list.is_empty() {
        list[to] = list[from];
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::scene::{MeshArrays, Scene, Vertices};
    use crate::trace::{BruteForce, Tracer};

    /// Sheets at z = 0, 1, … of which the ray number k meets those beyond k, and a ray that meets none.
    #[test]
    fn each_ray_has_its_hits_in_order() {
        let sheet = |z: f32| [[-1.0, -1.0, z], [3.0, -1.0, z], [-1.0, 3.0, z]];
        let vertices: Vec<[f32; 3]> = (0..5).flat_map(|z| sheet(z as f32)).collect();
        let triangles: Vec<[u32; 3]> = (0..5).rev().map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect();
        let mesh = MeshArrays { vertices: Vertices::F32(&vertices), triangles: &triangles };
        let (scene, _) = Scene::of_arrays(&[mesh]).unwrap();
        let origins: Vec<DVec3> = (0..4).map(|k| DVec3::new(0.1, 0.1, f64::from(k) + 0.5)).collect();
        let directions = [DVec3::Z, DVec3::X, 2.0 * DVec3::Z, DVec3::Z];
        let rays = Rays::unlimited(Origins::Each(&origins), &directions);
        let found = all_hits(&Tracer::build(&scene), &rays);
        let told: Vec<(u32, f64, u32)> = found.iter().map(|(ray, hit)| (*ray, hit.t, hit.triangle)).collect();
        let expected =
            [(0, 0.5, 3), (0, 1.5, 2), (0, 2.5, 1), (0, 3.5, 0), (2, 0.25, 1), (2, 0.75, 0), (3, 0.5, 0)];
        assert_eq!(told, expected);
        assert_eq!(all_hits(&BruteForce(&scene), &rays), found);
        let limited = Rays { t_min: 1.0, t_max: 3.0, ..rays };
        let told: Vec<u32> =
            all_hits(&Tracer::build(&scene), &limited).iter().map(|(_, hit)| hit.triangle).collect();
        assert_eq!(told, [2, 1]);
        assert_eq!(all_hits(&Tracer::build(&scene), &Rays::unlimited(Origins::Common(DVec3::ZERO), &[])), []);
    }
}
