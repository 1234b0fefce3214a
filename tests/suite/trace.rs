//! Every tracer finds the hit that brute force finds, bit for bit, and closed meshes have no leaks.

mod walking;

use std::path::Path;
use std::sync::Arc;

use beamcast::rng::Rng;
use beamcast::scene::{Arrangement, Scene, SourceMesh};
use beamcast::trace::methods::Method;
use beamcast::trace::{AnyTracer, BruteForce, Cast, Hit, Instructions, Origins, Rays, Tracer};
use glam::{DAffine3, DMat3, DQuat, DVec3};
use rayon::prelude::*;

use crate::hostile_scenes::open;
use crate::shapes::{alone, cuboid, mesh, placed, quad, soup, sphere};

pub type Tracers = Vec<(&'static str, Tracer)>;

/// The tracers under test.
pub fn tracers(scene: &Scene) -> Tracers {
    let tracer = |kind| Tracer::build(scene).with_instructions(kind);
    vec![
        ("packets", tracer(Instructions::Best)),
        ("AVX2 packets", tracer(Instructions::Avx2)),
        ("portable packets", tracer(Instructions::Portable)),
        ("single rays", tracer(Instructions::Best).ray_by_ray()),
        ("AVX2 single rays", tracer(Instructions::Avx2).ray_by_ray()),
        ("portable single rays", tracer(Instructions::Portable).ray_by_ray()),
        ("scalar", tracer(Instructions::Scalar)),
    ]
}

pub fn cast(tracer: &dyn Cast, rays: &Rays) -> Vec<Option<Hit>> {
    let mut hits = vec![None; rays.directions.len()];
    tracer.cast(rays, &mut hits);
    hits
}

/// The factor by which the number of rays is increased. `BEAMCAST_THOROUGH=12` casts ten million rays of each kind.
fn thorough() -> usize {
    std::env::var("BEAMCAST_THOROUGH")
        .map_or(1, |times| times.parse().expect("BEAMCAST_THOROUGH is a number"))
}

/// A vertex of the scene in the world, or a point on one of its edges, as exactly as f64 can represent it.
pub fn target(scene: &Scene, random: &mut Rng) -> DVec3 {
    let near = random.u64();
    target_near(scene, random, near)
}

/// The same target on a triangle that `near` selects, or on one that follows it in its mesh.
fn target_near(scene: &Scene, random: &mut Rng, near: u64) -> DVec3 {
    let placement =
        &scene.arrangement.placements[(near % scene.arrangement.placements.len() as u64) as usize];
    let mesh = scene.mesh(placement.mesh);
    if mesh.triangles.is_empty() {
        return scene.geometry.centre;
    }
    let first = ((near >> 20) % mesh.triangles.len() as u64) as usize;
    let triangle = mesh.triangles[(first + random.below(8)) % mesh.triangles.len()];
    let corner = random.below(3);
    let at = |k: usize| {
        let p = mesh.positions[triangle[k % 3] as usize];
        DVec3::new(p[0].into(), p[1].into(), p[2].into())
    };
    let along = [0.0, 0.5, random.unit()][random.below(3)];
    let p = at(corner) + (at(corner + 1) - at(corner)) * along;
    placement.scene_from_mesh().transform_point3(p) + scene.geometry.centre
}

/// Casts batches of rays from points near the scene. The rays are random, aimed at vertices and edges, neighbours in a
/// narrow fan, or parallel to an axis, with and without limits. They start from one point, from points along a short path
/// (a moving sensor), or from anywhere. Every tracer must agree with brute force bit for bit. Returns the number of hits.
pub fn agrees(scene: &Scene, batches: usize, seed: u64, spread: f64) -> usize {
    let tracers = tracers(scene);
    let batches = (0..batches * thorough()).into_par_iter();
    batches
        .map(|batch| batch_agrees(scene, &tracers, batch, &mut Rng::new(seed << 32 | batch as u64), spread))
        .sum()
}

/// The number of rays of a batch: whole packets, parts of one packet, or more than one packet.
fn batch_size(batch: usize) -> usize {
    [128, 64, 128, 45, 150][batch / 7 % 5]
}

fn batch_agrees(scene: &Scene, tracers: &Tracers, batch: usize, random: &mut Rng, spread: f64) -> usize {
    let origin = match batch % 4 {
        0 => scene.geometry.centre + random.point() * spread,
        1 => scene.geometry.centre + random.point() * spread * 10.0,
        2 => target(scene, random) + random.point() * spread * 1e-3,
        _ => (scene.geometry.centre + random.point() * spread).as_vec3().as_dvec3(),
    };
    let rays = batch_size(batch);
    // The offset of each ray's origin from the common point.
    let step = random.point() * spread * [1e-7, 1e-5, 1e-3][batch / 60 % 3];
    let offsets: Vec<DVec3> = match batch / 20 % 3 {
        0 => vec![],
        1 => (0..rays).map(|ray| step * (ray % 8) as f64).collect(),
        _ => (0..rays).map(|_| random.point() * spread).collect(),
    };
    let origins: Vec<DVec3> = offsets.iter().map(|offset| origin + *offset).collect();
    let main = random.direction();
    let near = random.u64();
    let directions: Vec<DVec3> = (0..rays)
        .map(|ray| {
            let origin = origins.get(ray).copied().unwrap_or(origin);
            match (batch / 4 % 5, ray % 4) {
                (0, _) => (main + random.point() * 0.05).normalize(),
                (1, 0) => DVec3::AXES[ray / 4 % 3] * random.signed().signum(),
                (2, 0) => random.direction(),
                // Aimed rays have unit or unrounded directions. An unrounded one makes determinants exactly zero.
                (3, 1) => target(scene, random) - origin,
                // A bundle is aimed at vertices and edges of triangles that are neighbours, or nearly, so that the packet
                // stays whole.
                (4, 3) => target_near(scene, random, near) - origin,
                (4, _) => (target_near(scene, random, near) - origin).normalize(),
                _ => (target(scene, random) - origin).normalize(),
            }
        })
        .map(|d| if d.is_finite() && d != DVec3::ZERO { d } else { DVec3::X })
        .collect();
    let origins = if origins.is_empty() { Origins::Common(origin) } else { Origins::Each(&origins) };
    let (t_min, t_max) = match batch % 5 {
        0 => (0.3 * spread, 1.5 * spread),
        1 => (spread, f64::INFINITY),
        _ => (0.0, f64::INFINITY),
    };
    same_hits(
        scene,
        tracers,
        batch,
        &Rays { origins, directions: &directions, t_min, t_max, after: None, times_s: None },
    )
}

/// Compares every tracer with brute force, bit for bit, and in every fourth batch once more for the hits after the nearest
/// ones. Returns the number of hits.
pub fn same_hits(scene: &Scene, tracers: &Tracers, batch: usize, rays: &Rays) -> usize {
    let expected = cast(&BruteForce(scene), rays);
    all_find(&expected, tracers, batch, rays);
    if batch.is_multiple_of(4) {
        // Some rays of the batch have no earlier hit, so they look for their first one.
        let keep = |(ray, hit): (usize, &Option<Hit>)| hit.filter(|_| ray % 5 != 0);
        let after: Vec<_> = expected.iter().enumerate().map(keep).collect();
        let rays = Rays { after: Some(&after), ..*rays };
        all_find(&cast(&BruteForce(scene), &rays), tracers, batch, &rays);
    }
    expected.iter().flatten().count()
}

/// Compares the hits of every tracer with the expected ones, bit for bit.
fn all_find(expected: &[Option<Hit>], tracers: &Tracers, batch: usize, rays: &Rays) {
    for (name, tracer) in tracers {
        let found = cast(tracer, rays);
        let mut blocked = vec![false; found.len()];
        tracer.blocked(rays, &mut blocked);
        for (index, (e, f)) in expected.iter().zip(&found).enumerate() {
            let bits = |h: &Option<Hit>| {
                h.map(|h| {
                    let numbers = [h.t, h.u, h.v, h.normal.x, h.normal.y, h.normal.z];
                    (numbers.map(f64::to_bits), h.placement, h.triangle)
                })
            };
            assert!(
                bits(e) == bits(f) && blocked[index] == e.is_some(),
                "{name}: batch {batch}, ray {index} from {:?} along {:?} in {} to {} after {:?}: brute force {e:?}, found \
                 {f:?}, blocked: {}",
                rays.origin(index),
                rays.directions[index],
                rays.t_min,
                rays.t_max,
                rays.after.map(|after| after[index]),
                blocked[index]
            );
        }
    }
}

pub fn rotated(axis: DVec3, angle: f64, scale: DVec3, translation: DVec3) -> DAffine3 {
    let (sin, cos) = libm::sincos(angle / 2.0);
    let axis = axis.normalize() * sin;
    let rotation = DMat3::from_quat(DQuat::from_xyzw(axis.x, axis.y, axis.z, cos));
    DAffine3::from_mat3_translation(rotation * DMat3::from_diagonal(scale), translation)
}

#[test]
fn soup_agrees_with_brute_force() {
    for (seed, size) in [(1, 0.02), (2, 0.3), (3, 2.0)] {
        let scene = alone(soup(&mut Rng::new(seed), 400, size));
        assert!(agrees(&scene, 600, seed, 1.0) > 500);
    }
}

#[test]
fn spheres_agree_with_brute_force_at_every_scale_and_far_from_the_origin() {
    for radius in [1e-3, 1.0, 1e3, 1e6] {
        for offset in [DVec3::ZERO, DVec3::new(448_262.5, 5_411_932.25, 312.0)] {
            let shape = sphere(radius, DVec3::ZERO, 3);
            let scene = placed(vec![shape], vec![(0, DAffine3::from_translation(offset))]);
            assert!(agrees(&scene, 200, 7, radius * 0.5) > 5_000, "radius {radius}");
        }
    }
}

#[test]
fn placed_meshes_agree_with_brute_force() {
    let mut random = Rng::new(11);
    let mut placements = vec![(1, DAffine3::from_translation(DVec3::new(0.0, 0.0, -3.0)))];
    for index in 0..40 {
        // The meshes are rotated and scaled. Some are mirrored, and some are nearly flat.
        let mut scale = DVec3::new(0.3 + random.unit(), 0.3 + random.unit(), 0.3 + random.unit());
        if index % 3 == 0 {
            scale.x = -scale.x;
        }
        if index % 7 == 0 {
            scale.z = 2e-3;
        }
        placements.push((0, rotated(random.direction(), 6.0 * random.unit(), scale, random.point() * 5.0)));
    }
    let scene = placed(vec![sphere(1.0, DVec3::ZERO, 2), cuboid([-9.0; 3], [9.0, 9.0, 1.0])], placements);
    assert_eq!(scene.arrangement.placements.len(), 41);
    assert!(agrees(&scene, 400, 13, 4.0) > 10_000);

    // The same geometry is arranged otherwise: everything has moved, and some objects are removed.
    let mut arrangement = Arrangement::clone(&scene.arrangement);
    for placement in &mut arrangement.placements[1..] {
        let by = DAffine3::from_translation(random.point() * 3.0);
        *placement = placement.at(by * *placement.scene_from_mesh()).unwrap();
    }
    arrangement.placements.remove(20);
    arrangement.placements.remove(7);
    let moved = scene.rearranged(Arc::new(arrangement));
    assert!(Arc::ptr_eq(&moved.geometry, &scene.geometry));
    let rearranged = |(name, tracer): (_, Tracer)| (name, tracer.rearranged(moved.arrangement.clone()));
    let tracers: Tracers = tracers(&scene).into_iter().map(rearranged).collect();
    let hits: usize =
        (0..60).map(|batch| batch_agrees(&moved, &tracers, batch, &mut Rng::new(batch as u64), 4.0)).sum();
    assert!(hits > 1000, "{hits}");

    // A published method answers as if it were built for the new arrangement, in shadow rays as well as in hits.
    let directions: Vec<_> = (0..500).map(|_| random.direction()).collect();
    let origins = Origins::Common(scene.geometry.centre);
    let rays = Rays { origins, directions: &directions, t_min: 0.0, t_max: 5.0, after: None, times_s: None };
    for method in ["moller-trumbore", "segura-feito-precomputed"].map(Method::named) {
        let rearranged = AnyTracer::build(&scene, method).rearranged(moved.arrangement.clone());
        let built = AnyTracer::build(&moved, method);
        let (mut hits, mut expected, mut blocked) = (vec![None; 500], vec![None; 500], vec![false; 500]);
        rearranged.cast(&rays, &mut hits);
        built.cast(&rays, &mut expected);
        rearranged.blocked(&rays, &mut blocked);
        assert_eq!(hits, expected);
        assert_eq!(blocked, hits.iter().map(Option::is_some).collect::<Vec<_>>());
        let count = blocked.iter().filter(|&&b| b).count();
        assert!((100..=400).contains(&count), "{count}");
    }
}

/// Hundreds of small meshes, some of a single triangle, some in the very same place, some around all others with the rays inside,
/// turned and mirrored. The rays fill streams and packets, and meet most placements with a few rays of a packet.
#[test]
fn heaps_of_placements_agree_with_brute_force() {
    let mut random = Rng::new(23);
    let meshes = vec![
        soup(&mut random, 1, 0.5),
        soup(&mut random, 9, 0.5),
        cuboid([-0.5; 3], [0.5, 0.4, 0.3]),
        sphere(0.5, DVec3::new(3.0, 0.0, 0.0), 2),
        quad([DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y]),
    ];
    let mut placements = Vec::new();
    for index in 0..300 {
        let size = [0.2, 0.2, 0.2, 1.0, 12.0][random.below(5)];
        let mut scale = DVec3::new(random.unit() + 0.1, random.unit() + 0.1, random.unit() + 0.1) * size;
        if index % 3 == 0 {
            scale.y = -scale.y;
        }
        let at = random.point() * 4.0;
        let place = (index % 5, rotated(random.direction(), 6.0 * random.unit(), scale, at));
        placements.push(place);
        if index % 10 == 0 {
            placements.extend([place, place]);
        }
    }
    let scene = placed(meshes, placements);
    assert!(scene.arrangement.placements.len() > 350, "{}", scene.arrangement.placements.len());
    assert!(agrees(&scene, 120, 29, 3.0) > 8_000);

    // Long calls: streams begin and end with all kinds of rays in them.
    let tracers = tracers(&scene);
    let directions: Vec<_> = (0..3000).map(|_| random.direction()).collect();
    let origins: Vec<_> = (0..3000).map(|_| random.point() * 4.0 + scene.geometry.centre).collect();
    for (batch, origins) in [Origins::Each(&origins), Origins::Common(origins[0])].into_iter().enumerate() {
        for t_max in [4.0, f64::INFINITY] {
            let rays = Rays { t_max, t_min: 0.01, ..Rays::unlimited(origins, &directions) };
            let hits = same_hits(&scene, &tracers, 4 * batch, &rays);
            assert!(hits > 100, "{hits} hits up to {t_max}");
        }
    }
}

#[test]
#[should_panic(expected = "the ids of placement 2 do not rise")]
fn an_arrangement_of_another_order_is_refused() {
    let places = [DVec3::X, DVec3::Y].map(|at| (0, DAffine3::from_translation(at)));
    let scene = placed(vec![sphere(0.5, DVec3::ZERO, 1)], places.to_vec());
    let mut arrangement = Arrangement::clone(&scene.arrangement);
    arrangement.placements.swap(1, 2);
    Tracer::build(&scene).rearranged(Arc::new(arrangement));
}

/// Near-coincident layers are a few ulps apart, so that only the exact order of depths separates them.
#[test]
fn near_coincident_layers_agree_with_brute_force() {
    let mut layers = mesh(vec![], vec![]);
    let mut z = 1.0_f32;
    for gap in [0, 1, 2, 5, 12, 30] {
        for _ in 0..gap {
            z = z.next_up();
        }
        let base = layers.positions.len() as u32;
        layers.positions.extend([[-3.0, -3.0, z], [3.0, -3.0, z], [3.0, 3.0, z], [-3.0, 3.0, z]]);
        layers.parts[0].triangles.extend([[base, base + 1, base + 2], [base, base + 2, base + 3]]);
    }
    let scene = alone(layers);
    assert!(agrees(&scene, 600, 17, 1.0) > 5_000);
    // Of two coincident layers, the lower id is hit from either side.
    let twice = quad([
        DVec3::new(-1.0, -1.0, 0.0),
        DVec3::new(1.0, -1.0, 0.0),
        DVec3::new(1.0, 1.0, 0.0),
        DVec3::new(-1.0, 1.0, 0.0),
    ]);
    let both = SourceMesh {
        positions: twice.positions.clone(),
        parts: vec![twice.parts[0].clone(), twice.parts[0].clone()],
    };
    let scene = alone(both);
    for (_, tracer) in tracers(&scene) {
        let hits =
            cast(&tracer, &Rays::unlimited(Origins::Common(DVec3::new(0.2, 0.1, 3.0)), &[DVec3::NEG_Z]));
        assert_eq!(hits[0].unwrap().triangle, 0);
        assert_eq!(hits[0].unwrap().t, 3.0);
    }
}

/// Sheets of small triangles, a few ulps apart, are seen at grazing incidence from far away. Depths of single triangles are
/// so uncertain in f32 that only their bounds, or f64, can order them.
#[test]
fn grazed_layers_agree_with_brute_force() {
    let mut sheets = mesh(vec![], vec![]);
    let cells = 12_u32;
    // The sheets are rotated, because f32 loses almost no digits along the axes.
    let turn = rotated(DVec3::new(1.0, 2.0, -0.7), 1.1, DVec3::ONE, DVec3::new(0.3, -0.2, 0.1));
    for layer in 0..4_u32 {
        // Each sheet is divided differently, and tilted by about an ulp.
        let (size, base) = (1.0 / f64::from(cells + layer), sheets.positions.len() as u32);
        for y in 0..=cells {
            for x in 0..=cells {
                let z = f64::from(layer) * 4e-8 + f64::from((x * 7 + y * 3 + layer) % 5) * 3e-8;
                let p = DVec3::new(f64::from(x) * size, f64::from(y) * size, 1.0 + z);
                sheets.positions.push(turn.transform_point3(p).as_vec3().to_array());
            }
        }
        for y in 0..cells {
            for x in 0..cells {
                let at = |dx: u32, dy: u32| base + (y + dy) * (cells + 1) + x + dx;
                sheets.parts[0]
                    .triangles
                    .extend([[at(0, 0), at(1, 0), at(1, 1)], [at(0, 0), at(1, 1), at(0, 1)]]);
            }
        }
    }
    let scene = alone(sheets);
    let tracers = tracers(&scene);
    let mut random = Rng::new(37);
    let mut hits = 0;
    for batch in 0..600 {
        let distance = [1.5, 6.0, 30.0][batch % 3];
        let height = distance * [1e-5, 1e-3, 0.03][batch / 3 % 3] * random.signed();
        let around = random.unit() * std::f64::consts::TAU;
        let (sin, cos) = libm::sincos(around);
        let origin =
            turn.transform_point3(DVec3::new(0.5 + distance * cos, 0.5 + distance * sin, 1.0 + height));
        let near = random.u64();
        let directions: Vec<DVec3> = (0..128)
            .map(|ray| match ray % 3 {
                0 => (target_near(&scene, &mut random, near) - origin).normalize(),
                1 => (target_near(&scene, &mut random, near) + random.point() * 0.02 - origin).normalize(),
                _ => (DVec3::new(random.unit(), random.unit(), 1.0 + random.signed() * 1e-7) - origin)
                    .normalize(),
            })
            .collect();
        hits += same_hits(&scene, &tracers, batch, &Rays::unlimited(Origins::Common(origin), &directions));
        // For a moving sensor the depths are as uncertain, and the origins differ.
        let origins: Vec<DVec3> =
            (0..128).map(|ray| origin + DVec3::X * (1e-6 * f64::from(ray % 8))).collect();
        hits += same_hits(&scene, &tracers, batch, &Rays::unlimited(Origins::Each(&origins), &directions));
    }
    assert!(hits > 10_000, "{hits}");
}

/// Degenerate arrangements are bad for hierarchies: all triangles at one point, on one line, or in one place.
#[test]
fn degenerate_arrangements_agree_with_brute_force() {
    let one = mesh(vec![[1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 1.0]], vec![[0, 1, 2]]);
    assert!(agrees(&alone(one.clone()), 100, 19, 1.0) > 100);
    let same = mesh(one.positions, vec![[0, 1, 2]; 3000]);
    agrees(&alone(same), 16, 23, 1.0);
    let chain = (0..1300).map(|i| libm::powf(1.02, i as f32)).collect::<Vec<_>>();
    let mut line = mesh(vec![], vec![]);
    for x in chain {
        let base = line.positions.len() as u32;
        line.positions.extend([[x, 0.0, 0.0], [x, x * 0.01, 0.0], [x, 0.0, x * 0.01]]);
        line.parts[0].triangles.push([base, base + 1, base + 2]);
    }
    agrees(&alone(line), 16, 29, 1.0);
    // The triangles lie one behind the other, so that more nodes are pending than a ray's stack can hold.
    let mut nested = mesh(vec![], vec![]);
    for i in 0..1300 {
        let (base, size) = (nested.positions.len() as u32, libm::powf(1.02, i as f32));
        nested.positions.extend([[-size, -size, size], [3.0 * size, -size, size], [-size, 3.0 * size, size]]);
        nested.parts[0].triangles.push([base, base + 1, base + 2]);
    }
    assert!(agrees(&alone(nested), 16, 31, 1.0) > 100);
}

/// Directions and origins of any size agree, subnormal numbers among them (the case brute-force-subnormal).
#[test]
fn rays_of_any_size_agree_with_brute_force() {
    let mut random = Rng::new(51);
    // Triangles in planes through the origin and parallel to the axes have coordinates of exactly 0.
    let mut flat = soup(&mut Rng::new(6), 40, 2.0);
    for (index, position) in flat.positions.iter_mut().enumerate() {
        position[index / 3 % 3] = 0.0;
    }
    let turn = rotated(DVec3::new(1.0, 2.0, 3.0), 0.7, DVec3::splat(1e-3), DVec3::X);
    let scenes = [
        alone(flat.clone()),
        alone(cuboid([-1.0; 3], [1.0; 3])),
        placed(vec![flat], vec![(0, DAffine3::IDENTITY), (0, turn)]),
    ];
    let sizes = [
        0.0,
        5e-324,
        9.93e-322,
        1e-310,
        1e-300,
        1e-161,
        1e-101,
        1e-99,
        1e-40,
        1e-20,
        1.0,
        1.0,
        1.0,
        1e20,
        1e40,
        1e99,
        1e101,
        1e160,
        f64::MAX,
    ];
    let mut hits = 0;
    for scene in &scenes {
        let tracers = tracers(scene);
        for batch in 0..76 {
            let mut point = |scale: &dyn Fn(&mut Rng) -> f64| {
                DVec3::from_array([0; 3].map(|_| scale(&mut random) * (1.0 - 2.0 * (random.below(2) as f64))))
            };
            let small = |random: &mut Rng| [0.0, 1.0, 0.25, 5e-324, 1e-310, 1e-20][random.below(6)];
            let common = scene.geometry.centre + point(&small);
            let (a, b) = (sizes[batch % sizes.len()], sizes[batch / sizes.len()]);
            let mut directions: Vec<DVec3> = (0..64)
                .map(|ray| match ray % 4 {
                    0 => point(&|random| [a, b, 1.0][random.below(3)]),
                    1 => point(&|random| sizes[random.below(sizes.len())]),
                    // A narrow bundle, of which some rays are long or short.
                    _ => DVec3::new(1.0, 1e-3 * f64::from(ray), 9.93e-322) * [1.0, a, b][ray as usize % 3],
                })
                .collect();
            if batch % 3 == 0 {
                directions.sort_by(|a, b| b.x.total_cmp(&a.x));
            }
            let origins: Vec<DVec3> = (0..64).map(|_| scene.geometry.centre + point(&small)).collect();
            for origins in [Origins::Common(common), Origins::Each(&origins)] {
                hits += same_hits(scene, &tracers, batch, &Rays::unlimited(origins, &directions));
            }
        }
    }
    assert!(hits > 5000, "{hits}");
}

/// The case bvh-coincident-quadratic: copies in one place, of meshes and of triangles. Were their hierarchies built in the square of
/// their number, this would take minutes.
#[test]
fn stacked_copies_agree_with_brute_force() {
    let stack = placed(vec![sphere(1.0, DVec3::ZERO, 0)], vec![(0, DAffine3::IDENTITY); 100_000]);
    let tracer = Tracer::build(&stack);
    let rays = Rays::unlimited(Origins::Common(DVec3::new(0.1, 0.2, 3.0)), &[DVec3::NEG_Z]);
    let hit = cast(&tracer, &rays)[0].unwrap();
    assert_eq!((hit.placement, hit.triangle), (1, 0));
    let one = mesh(vec![[1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 1.0]], vec![[0, 1, 2]; 100_000]);
    let hits = cast(
        &Tracer::build(&alone(one)),
        &Rays::unlimited(Origins::Common(DVec3::new(0.0, 0.2, 0.3)), &[DVec3::X]),
    );
    assert_eq!(hits[0].unwrap().triangle, 0);
    // A few hundred of each, against brute force.
    let nested =
        (1..300).map(|i| (0, DAffine3::from_scale(DVec3::splat(1.0 + 0.01 * f64::from(i))))).collect();
    assert!(agrees(&placed(vec![sphere(1.0, DVec3::ZERO, 0)], nested), 20, 5, 2.0) > 100);
    let copies = vec![(0, DAffine3::IDENTITY); 200];
    assert!(agrees(&placed(vec![sphere(1.0, DVec3::ZERO, 0)], copies), 20, 5, 2.0) > 100);
}

/// Many rays are cast in one call. Runs of neighbouring rays alternate with runs in no order, which tests packets, single
/// rays and the transitions between them.
#[test]
fn long_calls_agree_with_brute_force() {
    let mut random = Rng::new(41);
    for scene in [
        alone(sphere(1.0, DVec3::ZERO, 3)),
        placed(
            vec![sphere(1.0, DVec3::ZERO, 2)],
            [0.5, -2.0].map(|x| (0, DAffine3::from_translation(DVec3::X * x))).to_vec(),
        ),
    ] {
        let tracers = tracers(&scene);
        for call in 0..12 {
            let (mut directions, mut origins) = (Vec::new(), Vec::new());
            while directions.len() < 3000 {
                let origin = random.point() * 2.0;
                let main = (random.point() * 0.4 + DVec3::X * 0.2 - origin).normalize();
                let is_packet = random.below(2) == 0;
                for _ in 0..1 + random.below(if call % 3 == 0 { 40 } else { 1200 }) {
                    let near = main + random.point() * 0.02;
                    directions.push(if is_packet { near.normalize() } else { random.direction() });
                    origins.push(if is_packet { origin } else { random.point() * 2.0 });
                }
            }
            // One of the origins is inside a sphere.
            let origins =
                if call % 2 == 0 { Origins::Each(&origins) } else { Origins::Common(origins[0] * 0.1) };
            let hits = same_hits(&scene, &tracers, call, &Rays::unlimited(origins, &directions));
            assert!(hits > 100, "{hits} of {}", directions.len());
        }
    }
}

/// A million rays are cast over the shipped scenes. Brute force tests every triangle, so most rays are cast in scenes with
/// few triangles. In each scene enough rays are aimed at vertices and edges to test every kind of near-tie.
#[test]
fn shipped_scenes_agree_with_brute_force() {
    let mut rays = 0;
    for (file, batches, spread) in [
        ("room.glb", 10_000, 4.0),
        ("hall.glb", 320, 10.0),
        ("warehouse.glb", 40, 10.0),
        ("street.glb", 40, 20.0),
    ] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(file);
        let scene = open(&path).unwrap().scene;
        let hits = agrees(&scene, batches, 37, spread);
        let cast: usize = (0..batches * thorough()).map(batch_size).sum();
        assert!(hits > cast / 2, "{file}: {hits} of {cast}");
        rays += cast;
    }
    assert!(rays >= 1_000_000 * thorough(), "{rays}");
}

/// The work of casting is counted: rays at vertices are too close for f64, and a ray that leaves the scene tests nothing.
#[test]
fn traversal_statistics_are_counted() {
    let scene = alone(sphere(1.0, DVec3::ZERO, 4));
    let mesh = &scene.geometry.meshes[0];
    let at = |v: usize| DVec3::from(mesh.positions[v].map(f64::from)) + scene.geometry.centre;
    let vertices: Vec<_> = (0..300).map(|k| at(k % mesh.positions.len()) - scene.geometry.centre).collect();
    for (name, tracer) in tracers(&scene).into_iter().filter(|(name, _)| *name != "scalar") {
        let mut hits = vec![None; 300];
        let inside = Rays::unlimited(Origins::Common(scene.geometry.centre), &vertices);
        let effort = tracer.cast_counted(&inside, &mut hits);
        assert_eq!(hits, cast(&tracer, &inside), "{name}");
        assert!(effort.nodes > 0 && effort.leaves > 0, "{name}: {effort:?}");
        assert!(effort.tests >= effort.in_f64 && effort.in_f64 >= effort.exactly, "{name}: {effort:?}");
        assert!(effort.exactly >= 300, "{name}: {effort:?}");
        let away = Rays::unlimited(Origins::Common(scene.geometry.centre + DVec3::X * 3.0), &[DVec3::X]);
        assert_eq!(tracer.cast_counted(&away, &mut hits[..1]).tests, 0, "{name}");
    }
}

/// A ray from inside a closed mesh hits it, wherever it is aimed. A quarter of a million rays each are aimed at the
/// vertices, at the edges and anywhere.
#[test]
fn closed_meshes_have_no_leaks() {
    let mut random = Rng::new(31);
    let mut rays = 0_u64;
    for radius in [1e-3, 1.0, 1e3, 1e6] {
        for offset in [
            DVec3::ZERO,
            DVec3::new(148_376.0, 1_234.0, -223_423.0),
            DVec3::new(448_262.5, 5_411_932.25, 312.0),
        ] {
            let place = rotated(random.direction(), random.unit(), DVec3::ONE, offset);
            let scene = placed(vec![sphere(radius, DVec3::ZERO, 4)], vec![(0, place)]);
            for (name, tracer) in tracers(&scene) {
                for batch in 0..192 * thorough() {
                    let origin = offset + random.point() * radius * 0.5;
                    let directions: Vec<_> = (0..150)
                        .map(|ray| {
                            if ray % 3 == 0 {
                                random.direction()
                            } else {
                                (target(&scene, &mut random) - origin).normalize()
                            }
                        })
                        .collect();
                    let origins: Vec<_> = (0..150).map(|_| origin + random.point() * radius * 1e-4).collect();
                    let origins =
                        if batch % 2 == 0 { Origins::Common(origin) } else { Origins::Each(&origins) };
                    let hits = cast(&tracer, &Rays::unlimited(origins, &directions));
                    rays += hits.len() as u64;
                    if let Some(leak) = hits.iter().position(Option::is_none) {
                        panic!("{name}: radius {radius}, from {origin:?} along {:?}", directions[leak]);
                    }
                }
            }
        }
    }
    assert!(rays >= 1_000_000 * thorough() as u64, "{rays}");
}
