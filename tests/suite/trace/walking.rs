//! Rays that are cast again after each of their hits meet all triangles on their way.

use beamcast::rng::Rng;
use beamcast::scene::Scene;
use beamcast::trace::exact::{Candidate, Corners, Limits, LocalRay};
use beamcast::trace::methods::{Method, Ray};
use beamcast::trace::{BruteForce, Cast, Origins, Rays, Tracer};
use glam::{DAffine3, DVec3};

use super::{cast, rotated, target, tracers};
use crate::shapes::{alone, mesh, placed, soup, sphere};

/// Every triangle that a ray passes through within its limits, by the definition of a hit, in the order of hits.
fn hits_in_order(scene: &Scene, rays: &Rays, ray: usize) -> Vec<Candidate> {
    let limits = Limits::of(rays, ray);
    let ray =
        LocalRay { origin: scene.geometry.ray_origin(rays.origin(ray)), direction: rays.directions[ray] };
    let mut hits = Vec::new();
    for (index, placement) in scene.arrangement.placements.iter().enumerate() {
        let local = ray.carried(placement, None).unwrap();
        let mesh = scene.mesh(placement.mesh);
        for triangle in 0..mesh.triangles.len() as u32 {
            let corners = Corners::of(mesh, triangle, local.origin);
            if corners.passes(local.direction) {
                let t = corners.depth(local.direction);
                hits.push(Candidate { t, placement: index as u32, triangle });
            }
        }
    }
    hits.retain(|hit| limits.admits(hit));
    hits.sort_by(|a, b| a.t.total_cmp(&b.t).then((a.placement, a.triangle).cmp(&(b.placement, b.triangle))));
    hits
}

/// Casts rays again and again, each after its latest hit, and returns every hit of each ray.
fn walk(tracer: &dyn Cast, rays: &Rays) -> Vec<Vec<Candidate>> {
    let mut after = vec![None; rays.directions.len()];
    let mut walked = vec![Vec::new(); after.len()];
    loop {
        let hits = cast(tracer, &Rays { after: Some(&after), ..*rays });
        for ((after, walked), hit) in after.iter_mut().zip(&mut walked).zip(&hits) {
            if let Some(hit) = hit {
                walked.push(Candidate { t: hit.t, placement: hit.placement, triangle: hit.triangle });
                *after = Some(*hit);
            }
        }
        if hits.iter().all(Option::is_none) {
            return walked;
        }
    }
}

/// A ray that is cast again and again after its latest hit meets every triangle on its way exactly once, in the order of hits.
#[test]
fn rays_walk_through_all_their_hits_in_order() {
    let mut random = Rng::new(43);
    // Four copies of two triangles, and layers an ulp apart, make many depths equal.
    let mut layers = mesh(vec![], vec![]);
    for z in [1.0_f32, 1.0, 1.0_f32.next_up(), 1.0, 2.0, 1.0] {
        let base = layers.positions.len() as u32;
        layers.positions.extend([[-3.0, -3.0, z], [3.0, -3.0, z], [3.0, 3.0, z], [-3.0, 3.0, z]]);
        layers.parts[0].triangles.extend([[base, base + 1, base + 2], [base, base + 2, base + 3]]);
    }
    let turn = rotated(DVec3::new(1.0, 2.0, 3.0), 0.7, DVec3::new(1.0, 0.5, -2.0), DVec3::X);
    // Every place but the last is used twice, so that depths of different placements are equal.
    let places = [0.0, 0.0, 0.5, 0.5, -2.0].map(|x| (0, DAffine3::from_translation(DVec3::X * x) * turn));
    let scenes = [
        alone(soup(&mut Rng::new(5), 300, 1.0)),
        alone(layers.clone()),
        placed(vec![layers], vec![(0, DAffine3::IDENTITY); 3]),
        placed(vec![sphere(1.0, DVec3::ZERO, 2)], places.to_vec()),
    ];
    for (index, scene) in scenes.iter().enumerate() {
        let (mut hits, mut ties) = (0, 0);
        for batch in 0..6 {
            let origins: Vec<_> = (0..150).map(|_| scene.geometry.centre + random.point() * 3.0).collect();
            let is_common = batch % 2 == 0;
            let directions: Vec<_> = (0..150)
                .map(|ray| target(scene, &mut random) - origins[if is_common { 0 } else { ray }])
                .map(|d| if d == DVec3::ZERO { DVec3::X } else { d })
                .collect();
            let origins = if is_common { Origins::Common(origins[0]) } else { Origins::Each(&origins) };
            let (t_min, t_max) = if batch < 4 { (0.0, f64::INFINITY) } else { (0.4, 1.1) };
            let rays = Rays { origins, directions: &directions, t_min, t_max, after: None, times_s: None };
            let expected: Vec<_> = (0..150).map(|ray| hits_in_order(scene, &rays, ray)).collect();
            hits += expected.iter().map(Vec::len).sum::<usize>();
            let is_tie = |pair: &[Candidate]| pair[0].t == pair[1].t;
            ties += expected.iter().flat_map(|of| of.windows(2)).filter(|pair| is_tie(pair)).count();
            assert_eq!(
                walk(&BruteForce(scene), &rays),
                expected,
                "scene {index}, batch {batch}: brute force"
            );
            for (name, tracer) in tracers(scene) {
                assert_eq!(walk(&tracer, &rays), expected, "scene {index}, batch {batch}: {name}");
            }
        }
        // Only in the first scene do no two triangles coincide.
        assert!(hits > 1500 && (index == 0 || ties > 100), "scene {index}: {hits} hits, {ties} ties");
    }
}

/// The next hit of a published method comes after the previous one by the method's own depths.
#[test]
fn rays_walk_through_all_hits_of_a_method() {
    let mut random = Rng::new(47);
    let scene = alone(soup(&mut Rng::new(5), 300, 1.0));
    let mesh = &scene.geometry.meshes[0];
    let method = Method::named("moller-trumbore").unwrap();
    let tracer = method.tracer(&Tracer::build(&scene));
    let origins: Vec<_> = (0..150).map(|_| scene.geometry.centre + random.point() * 3.0).collect();
    let directions: Vec<_> =
        origins.iter().map(|o| (random.point() + scene.geometry.centre - *o).normalize()).collect();
    let rays = Rays::unlimited(Origins::Each(&origins), &directions);
    let mut hits = 0;
    for (ray, walked) in walk(&*tracer, &rays).into_iter().enumerate() {
        let test = Ray {
            origin: (origins[ray] - scene.geometry.centre).as_vec3(),
            direction: directions[ray].as_vec3(),
        };
        let mut expected: Vec<_> = (0..mesh.triangles.len())
            .filter_map(|triangle| {
                let corners = mesh.triangles[triangle].map(|v| mesh.positions[v as usize].into());
                let t = f64::from(method.intersect(&test, corners)?.t);
                (t >= 0.0).then_some(Candidate { t, placement: 0, triangle: triangle as u32 })
            })
            .collect();
        expected.sort_by(|a, b| a.t.total_cmp(&b.t).then(a.triangle.cmp(&b.triangle)));
        assert_eq!(walked, expected);
        hits += expected.len();
    }
    assert!(hits > 500, "{hits}");
}
