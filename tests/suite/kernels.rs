//! The published intersection methods: every test runs over the whole registry.

use std::path::Path;
use std::process::Output;

use beamcast::angle::Angle;
use beamcast::config::load_job;
use beamcast::frame::Pose;
use beamcast::rng::Rng;
use beamcast::scan::Frame;
use beamcast::scene::{Scene, gltf};
use beamcast::sensor::{Beam, Capture, Pattern, RangeLimits, RingOrder, Rotating, Sensor};
use beamcast::trace::exact::LocalRay;
use beamcast::trace::methods::truth::{Passage, Truth};
use beamcast::trace::methods::{Crossing, Culling, Edges, METHODS, Method, Ray};
use beamcast::trace::{AnyTracer, Origins, Rays, Tracer};
use glam::{DAffine3, DVec3, Vec3};
use serde_json::Value;

use crate::shapes::{alone, cuboid, placed, seen_from, sphere};

/// A triangle in the plane x = 2, counter-clockwise seen from the far side.
const FACING: [Vec3; 3] = [Vec3::new(2.0, -1.0, -1.0), Vec3::new(2.0, 1.0, -1.0), Vec3::new(2.0, 0.0, 1.0)];

/// The corners in the order in which the method sees them from the ray's origin.
fn turned(method: &Method, ray: &Ray, corners: [Vec3; 3]) -> [Vec3; 3] {
    let [a, b, c] = corners;
    let from_front = Truth::of(ray, corners).is_some_and(|truth| truth.from_front());
    if method.about.culling.sees(from_front) { corners } else { [a, c, b] }
}

fn along(x: f32, y: f32, z: f32) -> Ray {
    Ray { origin: Vec3::ZERO, direction: Vec3::new(x, y, z) }
}

fn close(crossing: Crossing, t: f32, u: f32, v: f32) -> bool {
    (crossing.t - t).abs() < 1e-5 && (crossing.u - u).abs() < 1e-5 && (crossing.v - v).abs() < 1e-5
}

#[test]
fn the_registry_has_every_method_once_by_name() {
    let names: Vec<_> = METHODS.iter().map(|m| m.about.name).collect();
    for (index, method) in METHODS.iter().enumerate() {
        let name = method.about.name;
        assert_eq!(names.iter().position(|n| *n == name), Some(index), "{name} is there twice");
        assert_eq!(Method::named(name).unwrap().about, method.about);
        assert!(name.bytes().all(|b| b.is_ascii_lowercase() || b == b'-'), "{name} is no plain name");
        assert_ne!(name, "exact");
        assert!(!method.about.paper.is_empty());
        // The range goes from Baldwin and Weber's nine numbers to Plücker's three lines of six numbers.
        assert!((36..=96).contains(&method.bytes_per_triangle), "{name}: {}", method.bytes_per_triangle);
    }
    assert!(Method::named("exact").is_none() && Method::named("").is_none());
}

#[test]
fn depth_and_weights_from_both_sides() {
    let inside = FACING[0] * 0.5 + FACING[1] * 0.3 + FACING[2] * 0.2;
    for method in &METHODS {
        let name = method.about.name;
        // FACING is seen from the back (its front is away from the origin), and once more with its corners reversed, from
        // the front.
        for (corners, u, v, from_front) in
            [(FACING, 0.3, 0.2, false), ([FACING[0], FACING[2], FACING[1]], 0.2, 0.3, true)]
        {
            for (origin, scale) in [(Vec3::ZERO, 1.0), (Vec3::new(-3.0, 0.5, 2.0), 0.25)] {
                let ray = Ray { origin, direction: (inside - origin) * scale };
                let hit = method.intersect(&ray, corners);
                if method.about.culling.sees(from_front) {
                    assert!(close(hit.unwrap(), 1.0 / scale, u, v), "{name}: {hit:?}");
                } else {
                    assert_eq!(hit, None, "{name}");
                }
            }
        }
        // A line has no end, so t is negative behind the origin.
        let behind = Ray { origin: inside * 2.0, direction: inside };
        let hit = method.intersect(&behind, turned(method, &behind, FACING)).unwrap();
        assert!((hit.t + 1.0).abs() < 1e-5, "{name}: {hit:?}");
    }
}

#[test]
fn culling_is_by_winding() {
    let kinds = |culling| METHODS.iter().filter(move |m| m.about.culling == culling).count();
    assert_eq!((kinds(Culling::Front), kinds(Culling::Back)), (1, 1));
    let from_front = Ray { origin: Vec3::X * 4.0, direction: Vec3::NEG_X };
    for method in &METHODS {
        let back = method.intersect(&along(1.0, 0.0, 0.0), FACING).is_some();
        let front = method.intersect(&from_front, FACING).is_some();
        let expected = match method.about.culling {
            Culling::None => (true, true),
            Culling::Front => (false, true),
            Culling::Back => (true, false),
        };
        assert_eq!((front, back), expected, "{}", method.about.name);
    }
}

/// The coordinates are so short that no method rounds. The answer is that of the method's rule.
#[test]
fn edges_and_vertices_belong_to_what_the_rule_says() {
    let edges = [along(2.0, 0.0, -1.0), along(2.0, 0.5, 0.0), along(2.0, -0.5, 0.0), along(4.0, 1.0, -2.0)];
    let vertices = FACING.map(|p| along(p.x, p.y, p.z));
    let bit = 1.0 / 1024.0;
    let outside = [along(2.0, 0.0, -1.0 - bit), along(2.0, 0.5 + bit, 0.0), along(2.0, 0.0, 1.0 + bit)];
    for method in &METHODS {
        let name = method.about.name;
        for ray in edges.iter().chain(&vertices) {
            let corners = turned(method, ray, FACING);
            let passage = Truth::of(ray, corners).unwrap().passage();
            assert!(matches!(passage, Passage::Edge | Passage::Vertex));
            let hit = method.intersect(ray, corners);
            assert_eq!(hit.is_some(), method.about.edges != Edges::Exclusive, "{name}: {passage:?}, {ray:?}");
            if let Some(hit) = hit {
                let p = ray.direction * hit.t;
                let weighed = corners[0] * (1.0 - hit.u - hit.v) + corners[1] * hit.u + corners[2] * hit.v;
                assert!(p.abs_diff_eq(weighed, 1e-6), "{name}: {hit:?}");
            }
        }
        for ray in outside {
            assert_eq!(method.intersect(&ray, turned(method, &ray, FACING)), None, "{name}: {ray:?}");
        }
    }
}

/// A ray that goes exactly through the shared edge of two triangles misses both only by the exclusive rule.
#[test]
fn a_shared_edge_is_no_gap_but_by_the_exclusive_rule() {
    let other = [FACING[1], FACING[0], Vec3::new(2.0, 0.0, -3.0)];
    let ray = along(2.0, 0.25, -1.0);
    for method in &METHODS {
        let hits = [FACING, other].map(|t| method.intersect(&ray, turned(method, &ray, t)).is_some());
        let expected = method.about.edges != Edges::Exclusive;
        assert_eq!(hits, [expected; 2], "{}", method.about.name);
    }
}

#[test]
fn without_an_area_or_in_the_plane_it_is_a_miss() {
    let [a, b, c] = FACING;
    let flat = [[a, a, a], [a, a, b], [a, b, a], [a, b, b], [a, b, (a + b) * 0.5], [a, (a + b) * 0.5, b]];
    let in_plane = [
        Ray { origin: Vec3::new(2.0, -5.0, 0.0), direction: Vec3::Y },
        Ray { origin: Vec3::new(2.0, 0.0, 0.0), direction: Vec3::new(0.0, 0.5, 1.0) },
        Ray { origin: a, direction: b - a },
        Ray { origin: Vec3::new(1.0, 0.0, 0.0), direction: Vec3::Z }, // the ray is parallel to the plane and outside of it
        Ray { origin: Vec3::ZERO, direction: Vec3::ZERO },
    ];
    for method in &METHODS {
        let name = method.about.name;
        for corners in flat {
            for towards in [a, b, (a + b) * 0.5, Vec3::X, c] {
                let ray = Ray { origin: Vec3::ZERO, direction: towards };
                assert_eq!(method.intersect(&ray, corners), None, "{name}: {corners:?} along {towards}");
            }
        }
        for ray in in_plane {
            for corners in [[a, b, c], [a, c, b]] {
                assert_eq!(method.intersect(&ray, corners), None, "{name}: {ray:?}");
            }
        }
    }
}

#[test]
fn from_the_triangle_itself_the_depth_is_zero() {
    for method in &METHODS {
        for direction in [Vec3::X, Vec3::new(-1.0, 0.25, 0.5)] {
            let ray = Ray { origin: Vec3::new(2.0, 0.0, -0.5), direction };
            let hit = method.intersect(&ray, turned(method, &ray, FACING));
            let hit = hit.unwrap_or_else(|| panic!("{} misses from its own plane", method.about.name));
            assert_eq!(hit.t, 0.0, "{}", method.about.name);
        }
    }
}

#[test]
fn non_finite_input_is_a_miss() {
    let ray = along(2.0, 0.1, -0.2);
    for method in &METHODS {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            for place in 0..15 {
                for other in 0..15 {
                    let mut numbers = [ray.origin, ray.direction, FACING[0], FACING[1], FACING[2]];
                    numbers[place / 3][place % 3] = bad;
                    numbers[other / 3][other % 3] = bad;
                    let [origin, direction, a, b, c] = numbers;
                    for corners in [[a, b, c], [a, c, b]] {
                        let hit = method.intersect(&Ray { origin, direction }, corners);
                        assert_eq!(hit, None, "{}: {bad} at {place} and {other}", method.about.name);
                    }
                }
            }
        }
    }
}

/// For triangles from nanometres to gigametres the answer is right or, where squares of areas leave f32, a miss. It is
/// never a NaN. The ray's direction is of unit length, or as long as the triangle is large.
#[test]
fn huge_and_tiny_triangles() {
    for method in &METHODS {
        for (exponent, is_unit) in (-44..=38).flat_map(|e| [(e, true), (e, false)]) {
            // The segment form starts one length of the direction away, and so misses much larger or smaller triangles.
            if is_unit && method.about.name == "segura-feito-segment" && !(-3..=3).contains(&exponent) {
                continue;
            }
            let scale = libm::powf(10.0, exponent as f32);
            let length = if is_unit { 1.0 } else { scale };
            let corners = FACING.map(|p| p * scale);
            let inside = Ray { origin: Vec3::ZERO, direction: Vec3::new(1.0, 0.05, -0.1) * length };
            let outside = Ray { origin: Vec3::ZERO, direction: Vec3::new(1.0, 0.8, 0.3) * length };
            let hit = method.intersect(&inside, turned(method, &inside, corners));
            if let Some(hit) = hit {
                let t = 2.0 * scale / length;
                assert!((hit.t - t).abs() <= 1e-4 * t, "{} at 1e{exponent}: {hit:?}", method.about.name);
                assert!((hit.u + hit.v).is_finite());
            }
            if (-8..=8).contains(&exponent) {
                assert!(hit.is_some(), "{} at 1e{exponent}", method.about.name);
            }
            let miss = method.intersect(&outside, turned(method, &outside, corners));
            assert_eq!(miss, None, "{} at 1e{exponent}", method.about.name);
        }
    }
}

/// The relative error bound of a computed weight, for |weights| up to 1. `None` if no bound is known.
///
/// With u = 2⁻²⁴, S the largest distance of the origin and the corners from the frame's origin, L the longest side, h the
/// least height (|N| = h·L) and κ the cosine of incidence:
/// - Methods that intersect the plane first: N has an error of 8uL²/|N| relative to its length, which moves t by
///   8u(L²/h)/κ, because N·(A−o) and N·d are affected together. The products and sums of lengths up to 2S move t by another
///   16uS/κ. So P has that error and another 6uS. Projected along the dominant axis the error is √3 times that, and a
///   weight falls off with 1/h. Computing the weights costs 12u(L/h)² (for Sunday's squares; less elsewhere). The sum is at
///   most 60u(S/h + (L/h)²)/κ.
/// - Methods that compare volumes: corners relative to the origin are up to 2S long and rounded once. With the cross and
///   dot products this is 36uS² of a sum that is |N|κ, and the same again for the sum. The total is at most 80u·S²/(hLκ).
///   Edges in place of corners (Möller and Trumbore, Plücker, the shear's differences) need no more.
fn weight_error(ray: &Ray, corners: [Vec3; 3]) -> Option<f64> {
    const U: f64 = 1.0 / (1 << 24) as f64;
    let [a, b, c] = corners.map(|p| p.as_dvec3());
    let n = (b - a).cross(c - a);
    let side = (b - a).length().max((c - b).length()).max((a - c).length());
    let height = n.length() / side;
    let s = [a, b, c, ray.origin.as_dvec3()].iter().map(|p| p.length()).fold(0.0, f64::max);
    let d = ray.direction.as_dvec3();
    let cosine = (n.dot(d) / n.length() / d.length()).abs();
    let bound =
        80.0 * U * (s * s / (height * side) + s / height + (side / height) * (side / height)) / cosine;
    (bound < 0.1).then_some(bound)
}

/// The pairs are random and include slivers and grazing rays. Outside of the band around edges that rounding may explain,
/// every method gives the answer of exact arithmetic. Half of the rays are aimed just beyond the band.
#[test]
fn away_from_edges_all_agree_with_exact_arithmetic() {
    let mut random = Rng::new(5);
    let (mut judged, mut close_by, mut hits, mut slivers) = (0, 0, 0, 0);
    while judged < 20_000 {
        let reach = [1.0, 10.0, 100.0][random.below(3)];
        let size = [0.1, 1.0, 10.0][random.below(3)];
        let flatness = [1.0, 1.0, 0.02][random.below(3)];
        let (middle, origin) = (random.point() * reach, (random.point() * reach).as_vec3());
        let (p, q) = (random.direction(), random.direction());
        let corners =
            [DVec3::ZERO, p, p * random.unit() + q * flatness].map(|x| (middle + x * size).as_vec3());
        let [a, b, c] = corners.map(|p| p.as_dvec3());
        let toward = |w: [f64; 3]| Ray {
            origin,
            direction: (a * w[0] + b * w[1] + c * w[2] - origin.as_dvec3()).normalize_or_zero().as_vec3(),
        };
        let Some(error) = weight_error(&toward([1.0 / 3.0; 3]), corners) else { continue };
        let close_to_an_edge = random.below(2) == 0;
        let first = match close_to_an_edge {
            true => error * (2.0 + 4.0 * random.unit()) * [1.0, -1.0][random.below(2)],
            false => 2.0 * random.unit() - 0.5,
        };
        let second = (1.0 - first) * random.unit();
        let mut weights = [first, second, 1.0 - first - second];
        weights.rotate_left(random.below(3));
        let ray = toward(weights);
        let (Some(error), Some(truth)) = (weight_error(&ray, corners), Truth::of(&ray, corners)) else {
            continue;
        };
        // The weights of the rounded ray are computed in f64, whose error is far less than the band.
        let [fa, fb, fc] = [a, b, c].map(|p| p - origin.as_dvec3());
        let d = ray.direction.as_dvec3();
        let volumes = [d.dot(fb.cross(fc)), d.dot(fc.cross(fa)), d.dot(fa.cross(fb))];
        let sum: f64 = volumes.iter().sum();
        let least = volumes.iter().map(|v| (v / sum).abs()).fold(f64::INFINITY, f64::min);
        let most = volumes.iter().map(|v| (v / sum).abs()).fold(1.0, f64::max);
        let band = error * most;
        if least <= band {
            continue;
        }
        judged += 1;
        close_by += usize::from(least < 8.0 * band);
        hits += usize::from(truth.passage() == Passage::Interior);
        slivers += usize::from(flatness < 1.0);
        for method in &METHODS {
            let found = method.intersect(&ray, corners);
            assert_eq!(
                found.is_some(),
                truth.is_hit(&method.about),
                "{}: {ray:?}, {corners:?}, weights {:?}, band {band:e}",
                method.about.name,
                volumes.map(|v| v / sum)
            );
            if let Some(found) = found {
                let off = (f64::from(found.u) - volumes[1] / sum)
                    .abs()
                    .max((f64::from(found.v) - volumes[2] / sum).abs());
                assert!(off <= 2.0 * band, "{}: weights off by {off:e}, band {band:e}", method.about.name);
            }
        }
    }
    assert!(close_by > 5_000 && hits > 5_000 && slivers > 1_000, "{close_by} {hits} {slivers}");
}

#[test]
fn batches_count_what_single_tests_find_and_both_forms_of_sunday_are_the_same() {
    let mut random = Rng::new(9);
    let mut single = |_| {
        let origin = random.point().as_vec3();
        let corners = [random.point(), random.point(), random.point()].map(|p| p.as_vec3());
        (Ray { origin, direction: random.direction().as_vec3() }, corners)
    };
    let pairs: Vec<_> = (0..4000).map(&mut single).collect();
    for method in &METHODS {
        let expected =
            pairs.iter().filter(|(ray, corners)| method.intersect(ray, *corners).is_some()).count();
        assert!(expected > 100);
        assert_eq!(method.batch(&pairs)(), expected, "{}", method.about.name);
    }
    let [base, precomputed] = ["sunday", "sunday-precomputed"].map(|name| Method::named(name).unwrap());
    for (ray, corners) in &pairs {
        assert_eq!(base.intersect(ray, *corners), precomputed.intersect(ray, *corners));
    }
}

/// Counts the rays that leak out of a closed mesh, aimed from within at its edges, at its vertices and anywhere.
fn leaks(method: &Method, rays: usize) -> [usize; 3] {
    let mut shape = sphere(3.0, DVec3::ZERO, 3);
    if method.about.culling == Culling::Back {
        shape.parts[0].triangles.iter_mut().for_each(|t| t.swap(0, 1));
    }
    // The mesh is rotated, so that no coordinate is special.
    let turn = Pose::from_rpy(DVec3::ZERO, Angle::deg(20.0), Angle::deg(31.0), Angle::deg(47.0));
    let scene = placed(vec![shape], vec![(0, DAffine3::from_mat3(turn.rotation))]);
    let tracer = method.tracer(&Tracer::build(&scene));
    let mesh = &scene.geometry.meshes[0];
    let mut random = Rng::new(3);
    let mut leaks = [0; 3];
    for _ in 0..rays / 32 {
        let origin = random.point() * 1.5;
        let kind = random.below(3);
        let directions: Vec<_> = (0..32)
            .map(|_| {
                let triangle = mesh.triangles[random.below(mesh.triangles.len())];
                let [a, b, c] = triangle.map(|v| Vec3::from(mesh.positions[v as usize]).as_dvec3());
                let w = random.unit();
                let p = [a + (b - a) * w, a, a * 0.3 + b * (0.1 + 0.5 * w) + c * (0.6 - 0.5 * w)][kind];
                (p + scene.geometry.centre - origin).normalize()
            })
            .collect();
        // The second call from the same origin uses the precomputed values, and gives the same answers.
        let rays = Rays::unlimited(Origins::Common(origin), &directions);
        let (mut hits, mut again) = (vec![None; 32], vec![None; 32]);
        tracer.cast(&rays, &mut hits);
        tracer.cast(&rays, &mut again);
        assert_eq!(hits, again, "{}", method.about.name);
        leaks[kind] += hits.iter().filter(|hit| hit.is_none()).count();
    }
    leaks
}

#[test]
fn leaks_match_the_declared_watertightness() {
    for method in &METHODS {
        let [edge, vertex, inside] = leaks(method, 60_000);
        let name = method.about.name;
        assert_eq!(inside, 0, "{name} leaks far from edges");
        match method.about.edges {
            Edges::Watertight => assert_eq!((edge, vertex), (0, 0), "{name}"),
            // Consistency of each edge is not enough where several edges meet.
            Edges::Consistent => assert!(edge == 0 && vertex > 0, "{name}: {edge}, {vertex}"),
            Edges::Inclusive | Edges::Exclusive => {
                assert!(edge > 100 && vertex > 100, "{name}: {edge}, {vertex}")
            }
        }
    }
}

/// Tests the watertight method where f32 is coarse: far from the origin, and for meshes of any size.
#[test]
fn watertight_at_every_scale_and_from_afar() {
    let method = Method::named("watertight").unwrap();
    let mut random = Rng::new(8);
    for radius in [1e-3, 1.0, 1e3, 1e6] {
        let scene = alone(sphere(radius, DVec3::ZERO, 3));
        let tracer = method.tracer(&Tracer::build(&scene));
        let mesh = &scene.geometry.meshes[0];
        for distance in [0.5, 3.0, 100.0, 3e4] {
            for _ in 0..3000 {
                let origin = random.direction() * (radius * distance);
                let triangle = mesh.triangles[random.below(mesh.triangles.len())];
                let at = |k: usize| Vec3::from(mesh.positions[triangle[k] as usize]).as_dvec3() * 0.99;
                // Seen from outside, the rays aim a little within the silhouette, because f32 cannot resolve its last bits
                // from far away.
                let p = (at(0) + (at(1) - at(0)) * [0.0, random.unit()][random.below(2)]) * 0.9;
                let directions = [(p - origin).normalize()];
                let rays = Rays::unlimited(Origins::Common(origin + scene.geometry.centre), &directions);
                let mut hits = [None];
                tracer.cast(&rays, &mut hits);
                let [hit] = hits;
                let hit = hit.unwrap_or_else(|| panic!("radius {radius}, from {origin} to {p}"));
                let on_sphere = (origin + rays.directions[0] * hit.t).length() / radius;
                assert!(
                    (0.95..=1.0 + 1e-6 * (1.0 + distance)).contains(&on_sphere),
                    "{on_sphere} at {distance}"
                );
            }
        }
    }
}

fn lidar() -> Sensor {
    let beam = |i: u32| Beam {
        elevation: Angle::deg(30.0 - 2.0 * f64::from(i)),
        azimuth_offset: Angle::default(),
        time_s: 0.0,
        file_index: 0,
    };
    let turn = (Angle::deg(180.0), Angle::deg(-180.0));
    let pattern = Pattern::Rotating(Rotating::new((0..32).map(beam).collect(), 400, turn, 10.0).unwrap());
    Sensor { pattern, range: RangeLimits::default(), ring: RingOrder::Row, measurement: Default::default() }
}

fn see(scene: &Scene, method: Option<&Method>, pose: &Pose) -> Frame {
    seen_from(scene, &AnyTracer::build(scene, method), &lidar(), pose)
}

/// In whole scans of meshes placed once and several times, a method finds the hits of the definition, except for those that
/// it culls.
#[test]
fn scans_by_any_method_differ_from_the_exact_one_by_rounding_only() {
    let mut random = Rng::new(21);
    let mut placements = vec![(0, DAffine3::IDENTITY)];
    for _ in 0..30 {
        let at = random.direction() * (4.0 + 10.0 * random.unit());
        placements.push((
            1,
            DAffine3::from_scale_rotation_translation(
                DVec3::new(0.5, 1.0, 0.7),
                glam::DQuat::from_array([0.1, 0.7, 0.1, 0.7]).normalize(),
                at,
            ),
        ));
    }
    let shapes = vec![cuboid([-20.0, -20.0, -2.0], [20.0, 20.0, 8.0]), sphere(1.0, DVec3::ZERO, 2)];
    let scene = placed(shapes, placements);
    assert_eq!(scene.arrangement.placements.len(), 31);
    let pose = Pose::from_rpy(DVec3::new(0.3, -0.2, 0.1), Angle::deg(1.0), Angle::deg(2.0), Angle::deg(3.0));
    let exact = see(&scene, None, &pose);
    assert_eq!(exact.return_count(), exact.pixels());
    for method in &METHODS {
        let name = method.about.name;
        let seen = see(&scene, Some(method), &pose);
        let (mut same, mut missed) = (0, 0);
        for (exact, seen) in exact.first_returns().zip(seen.first_returns()) {
            let exact = exact.unwrap();
            match seen {
                None => missed += 1,
                Some(seen) if seen.triangle == exact.triangle => {
                    same += 1;
                    // t is rounded to f32, and the surface is that of the definition.
                    assert!(
                        (seen.range_m - exact.range_m).abs() < 2e-4,
                        "{name}: {} {}",
                        seen.range_m,
                        exact.range_m
                    );
                    let normals = [seen.normal, exact.normal].map(Vec3::from);
                    assert!(normals[0].abs_diff_eq(normals[1], 1e-6), "{name}");
                }
                Some(_) => {}
            }
        }
        let rays = exact.pixels();
        match method.about.culling {
            Culling::None => {
                assert!(
                    missed <= 2 && same >= rays - 10,
                    "{name}: {missed} missed, {same} of {rays} the same"
                );
            }
            // The room is seen from within, from behind its triangles, and the spheres from outside.
            Culling::Front => assert!(missed <= 2 && same > rays / 2 && same < rays - 100, "{name}: {same}"),
            Culling::Back => assert!(missed > rays / 2 && same > 100, "{name}: {same}"),
        }
    }
}

/// In the street scene, every pixel whose range differs between a method and the definition is culled, or lies within the
/// error of a weight of an edge, or on a sliver, or on a surface seen edge-on.
#[test]
fn in_the_street_rounding_at_edges_explains_every_difference() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/street_128.toml");
    let job = load_job(&path, &["sensor.roof.rotating.columns=256".to_owned()]).unwrap();
    let options = gltf::Options { up: job.up, labels: &job.labels, ..gltf::Options::default() };
    let scene = gltf::load(&job.scene_path, "street.glb", &options).unwrap().scene;
    let sensor = &job.sensors[0].sensor;
    let pose = job.trajectory.pose_at(0.0) * job.sensors[0].body_from_sensor;
    let see = |method| seen_from(&scene, &AnyTracer::build(&scene, method), sensor, &pose);
    let exact = see(None);

    #[derive(PartialEq, PartialOrd)]
    enum Because {
        Nothing,
        NoKnowing,
        CloseToAnEdge,
        Culled,
    }
    let why = |method: &Method, direction: DVec3, triangle: u32| {
        let from = scene.arrangement.placements.iter().rev().find(|p| {
            let count = scene.mesh(p.mesh).triangles.len() as u32;
            (p.first_triangle..p.first_triangle + count).contains(&triangle)
        });
        let placement = from.unwrap();
        let mesh = scene.mesh(placement.mesh);
        let local = LocalRay { origin: scene.geometry.ray_origin(pose.translation), direction }
            .carried_by(placement.mesh_from_scene());
        let ray = Ray { origin: local.origin.as_vec3(), direction: local.direction.as_vec3() };
        let corners = mesh.triangles[(triangle - placement.first_triangle) as usize];
        let corners = corners.map(|v| Vec3::from(mesh.positions[v as usize]));
        if !method.about.culling.sees(Truth::of(&ray, corners).unwrap().from_front()) {
            return Because::Culled;
        }
        let [a, b, c] = corners.map(|p| p.as_dvec3() - local.origin);
        let volumes = [b.cross(c), c.cross(a), a.cross(b)].map(|n| local.direction.dot(n));
        let sum: f64 = volumes.iter().sum();
        let least = volumes.iter().map(|v| (v / sum).abs()).fold(f64::INFINITY, f64::min);
        match weight_error(&ray, corners) {
            // The error counts twice, because the ray was rounded too.
            Some(error) if least <= 2.0 * error => Because::CloseToAnEdge,
            Some(_) => Because::Nothing,
            None => Because::NoKnowing,
        }
    };
    for method in &METHODS {
        let name = method.about.name;
        let seen = see(Some(method));
        let mut unknown = 0;
        for (index, (exact, seen)) in exact.first_returns().zip(seen.first_returns()).enumerate() {
            let both = [exact, seen].map(|r| r.map(|r| r.range_m));
            let is_same = match both {
                [Some(exact), Some(seen)] => (exact - seen).abs() < 1e-3,
                [exact, seen] => exact == seen,
            };
            if is_same {
                continue;
            }
            let pulse = Capture::at_origin(sensor).pulse(index / 256, index % 256).unwrap();
            let direction = pose.direction(pulse.direction);
            let triangles = [exact, seen].into_iter().flatten().map(|r| r.triangle);
            let because = triangles
                .map(|t| why(method, direction, t))
                .fold(Because::Nothing, |best, b| if b > best { b } else { best });
            assert!(because != Because::Nothing, "{name}: {exact:?} became {seen:?}");
            unknown += usize::from(because == Because::NoKnowing);
        }
        assert!(unknown <= exact.pixels() / 1000, "{name}: {unknown} of slivers");
    }
}

fn beamcast(args: &[&str], threads: &str) -> Output {
    let mut command = super::cli::program();
    command.args(args).env("RAYON_NUM_THREADS", threads);
    command.output().unwrap()
}

fn room_job() -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/room_vlp16.toml").to_string_lossy().into_owned()
}

#[test]
fn a_job_chooses_its_method() {
    let tmp = tempfile::tempdir().unwrap();
    let scan = |folder: &str, set: &[&str]| {
        let out = tmp.path().join(folder);
        let job = room_job();
        let output = beamcast(&[&["scan", &job, "--out", out.to_str().unwrap()], set].concat(), "2");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let manifest: Value =
            serde_json::from_slice(&std::fs::read(out.join("manifest.json")).unwrap()).unwrap();
        (std::fs::read(out.join("vlp16/000000.exr")).unwrap(), manifest)
    };
    let (default, _) = scan("default", &[]);
    let (exact, manifest) = scan("exact", &["--set", "trace.kernel=exact"]);
    assert_eq!(manifest["job"]["trace"]["kernel"], "exact");
    assert!(default == exact);
    let (other, manifest) = scan("other", &["--set", "trace.kernel=moller-trumbore"]);
    assert_eq!(manifest["job"]["trace"]["kernel"], "moller-trumbore");
    assert!(default != other, "f32 depths are not f64 ones");
    let (again, _) = scan("again", &["--set", "trace.kernel=moller-trumbore"]);
    assert!(other == again);
}

#[test]
fn an_unknown_method_is_an_error_that_lists_them() {
    let job = room_job();
    let output = beamcast(&["scan", &job, "--dry-run", "--set", "trace.kernel=moller-trombone"], "1");
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2));
    assert!(message.contains("did you mean \"moller-trumbore\"?"), "{message}");
    for name in METHODS.iter().map(|m| m.about.name).chain(["exact"]) {
        assert!(message.contains(&format!("\"{name}\"")), "{name} is not in: {message}");
    }
    let output = beamcast(&["scan", &job, "--dry-run", "--set", "trace.kernal=exact"], "1");
    let message = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(2) && message.contains("did you mean `kernel`?"), "{message}");
}

/// Tests a short run of `beamcast kernels`: every method has all its figures, and only the times depend on the threads.
#[test]
fn the_comparison_has_every_method_and_figure() {
    let run = |threads: &str| {
        let output = beamcast(&["kernels", "--rays", "3000", "--json"], threads);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let report: Value = serde_json::from_slice(&output.stdout).unwrap();
        report["kernels"]
            .as_array()
            .unwrap()
            .iter()
            .map(|k| k.as_object().unwrap().clone())
            .collect::<Vec<_>>()
    };
    let (one, three) = (run("1"), run("3"));
    let names: Vec<_> = one.iter().map(|k| k["name"].as_str().unwrap()).collect();
    let expected: Vec<_> = METHODS.iter().map(|m| m.about.name).chain(["exact"]).collect();
    assert_eq!(names, expected);
    for (one, three) in one.iter().zip(&three) {
        assert_eq!(one.len(), 32);
        for (key, value) in one {
            let is_time = key.starts_with("ns_") || key.starts_with("mrays");
            assert!(is_time || *value == three[key], "{}: {key}", one["name"]);
            assert!(!is_time || value.as_f64().unwrap() > 0.0);
        }
    }
    let exact = one.last().unwrap();
    let zero = |key: &str| exact[key].as_f64() == Some(0.0);
    assert!(
        ["wrong_per_1e6_edge", "wrong_per_1e6_vertex", "leaks_per_1e8_vertex"].into_iter().all(zero),
        "{exact:?}"
    );
    assert!(exact["t_error_largest_ulp_at_200_m"].as_f64().unwrap() < 1e-5);
}

#[test]
fn the_comparison_takes_a_scene_and_prints_csv() {
    let scene = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/room.glb");
    let output = beamcast(&["kernels", "--scene", scene.to_str().unwrap(), "--rays", "1000", "--csv"], "2");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    assert_eq!(text.lines().count(), METHODS.len() + 2);
    assert!(text.starts_with("name,paper,edges,culls,"), "{text}");
    let output = beamcast(&["kernels", "--scene", "nowhere.glb"], "1");
    assert_eq!(output.status.code(), Some(3));
}
