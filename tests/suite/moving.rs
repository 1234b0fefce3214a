//! What moves, hides or bends is hit where it is at each ray's own time.

use std::sync::Arc;

use beamcast::angle::Angle;
use beamcast::config::presets;
use beamcast::frame::Pose;
use beamcast::motion::{AT_ORIGIN, Blending, Channel, Clock, Link, Motion, Track, Trajectory, Window};
use beamcast::rng::Rng;
use beamcast::scan::{Frame, Progress, scan};
use beamcast::scene::{Deformer, Material, Object, Scene, SceneBuilder, SourceInstance, SourceMesh};
use beamcast::sensor::{Beam, Capture, Pattern, RangeLimits, RingOrder, Rotating, Sensor};
use beamcast::trace::methods::Method;
use beamcast::trace::{AnyTracer, BruteForce, Cast, Hit, Origins, Rays, Tracer};
use glam::{DAffine3, DQuat, DVec3};

use crate::shapes::{cuboid, mesh, quad, sphere};
use crate::trace::{Tracers, cast, rotated, same_hits, tracers};

/// A body that is at `start` at time 0 and keeps its velocities.
fn twist(start: DVec3, linear: DVec3, angular: DVec3) -> Link {
    Link::Rigid(Trajectory::Twist {
        start: Pose { translation: start, ..Pose::IDENTITY },
        linear_m_s: linear,
        angular_rad_s: angular,
    })
}

/// Values that are reached at these times, in a clip that begins again every `length_s`.
fn keys<T>(times_s: &[f64], values: Vec<T>, blending: Blending, length_s: f64) -> Channel<T> {
    let track = Track::new(times_s.to_vec(), values, blending).unwrap();
    let clock = Clock { is_looped: true, ..Clock::once(length_s) };
    Channel { track: Arc::new(track), clock }
}

fn moving(mesh: usize, links: Vec<Link>) -> SourceInstance {
    let motion = Motion { links };
    let world_from_mesh = motion.at(0.0).unwrap_or_default();
    SourceInstance { mesh, world_from_mesh, motion: Some(Arc::new(motion)), ..SourceInstance::default() }
}

fn standing(mesh: usize, world_from_mesh: DAffine3) -> SourceInstance {
    SourceInstance { mesh, world_from_mesh, ..SourceInstance::default() }
}

fn built(meshes: Vec<SourceMesh>, instances: Vec<SourceInstance>) -> Scene {
    SceneBuilder { meshes, instances, materials: vec![Material::default()], files: vec![], groups: vec![] }
        .build()
        .unwrap()
}

/// A shape that a wave runs through.
fn waving(rest: &SourceMesh) -> Arc<Deformer> {
    let rest = rest.positions.clone();
    Arc::new(Deformer::new(move |time_s| {
        let wave = |[x, y, z]: [f32; 3]| [x, y, z + 0.3 * libm::sinf(5.0 * x + 20.0 * time_s as f32)];
        Some(rest.iter().copied().map(wave).collect())
    }))
}

/// A room with things in it that stand, and things that go, turn, grow through nothing to their mirror image, hide and bend.
fn busy_room() -> Scene {
    let ball = sphere(1.0, DVec3::new(0.0, 0.0, 0.3), 2);
    let meshes =
        vec![cuboid([-9.0; 3], [9.0, 9.0, 6.0]), ball.clone(), cuboid([4.0, -1.0, -0.2], [6.0, 1.0, 0.2])];
    let fixed = |map| Link::Fixed(map);
    let scale = |s: DVec3| fixed(DAffine3::from_scale(s));
    let pulsing = Link::Animated {
        translation: Channel::rest(DVec3::new(-3.0, -3.0, 0.0)),
        rotation: keys(
            &[0.0, 0.07, 0.2],
            vec![DQuat::IDENTITY, DQuat::from_rotation_x(2.0), DQuat::IDENTITY],
            Blending::Linear,
            0.2,
        ),
        // Between the keys it is crushed along one axis, and is nothing in one moment.
        scale: keys(
            &[0.0, 0.05, 0.1, 0.2],
            vec![DVec3::ONE, DVec3::new(1.0, -1.0, 0.5), DVec3::splat(-1.0), DVec3::ONE],
            Blending::Linear,
            0.2,
        ),
    };
    let blinking =
        Link::Visible(keys(&[0.0, 0.013, 0.031, 0.04], vec![true, false, true, false], Blending::Step, 0.05));
    let mut bending =
        moving(1, vec![twist(DVec3::new(0.0, 4.0, 1.0), DVec3::new(0.0, -20.0, 0.0), DVec3::Z)]);
    bending.deformer = Some(waving(&ball));
    let mut bending_in_place = standing(1, DAffine3::from_translation(DVec3::new(5.0, 5.0, -2.0)));
    bending_in_place.deformer = bending.deformer.clone();
    let instances = vec![
        standing(0, DAffine3::IDENTITY),
        standing(1, DAffine3::from_translation(DVec3::new(2.0, 0.0, -3.0))),
        // It crosses the room within a frame.
        moving(1, vec![twist(DVec3::new(-6.0, 2.0, 0.0), DVec3::new(90.0, 5.0, 0.0), DVec3::ZERO)]),
        bending,
        // It turns about a point far from it, about a hundred times a second.
        moving(2, vec![twist(DVec3::ZERO, DVec3::ZERO, DVec3::new(3.0, 5.0, 600.0))]),
        moving(1, vec![pulsing]),
        standing(1, rotated(DVec3::ONE, 1.0, DVec3::new(0.5, 1.0, -2.0), DVec3::new(3.0, -4.0, 2.0))),
        moving(1, vec![blinking, fixed(DAffine3::from_translation(DVec3::new(3.0, 3.0, 3.0)))]),
        bending_in_place,
        // A skewed map, as flat as rays can be carried through.
        moving(
            1,
            vec![
                twist(DVec3::new(-5.0, 5.0, -2.0), DVec3::X, DVec3::new(9.0, 0.0, 0.0)),
                scale(DVec3::new(2.0, 1.0, 1e-3)),
                fixed(rotated(DVec3::ONE, 0.7, DVec3::ONE, DVec3::ZERO)),
            ],
        ),
        // One is too flat for that, and one is never there.
        moving(1, vec![twist(DVec3::ZERO, DVec3::X, DVec3::ZERO), scale(DVec3::new(1.0, 1.0, 1e-5))]),
        moving(1, vec![Link::Visible(Channel::rest(false))]),
        // Nothing moves it.
        moving(2, vec![fixed(DAffine3::from_translation(DVec3::new(-9.0, -6.0, -3.0)))]),
    ];
    built(meshes, instances)
}

/// A point on an edge, or a vertex, of something in the scene at a time, in the world.
fn target(scene: &Scene, random: &mut Rng, placement: usize, time_s: f64) -> DVec3 {
    let placements = &scene.arrangement.placements;
    let placement = &placements[placement % placements.len()];
    let mesh = scene.mesh(placement.mesh);
    let Some(map) = placement.scene_from_mesh_at(time_s).filter(|_| !mesh.triangles.is_empty()) else {
        return scene.geometry.centre + random.point();
    };
    let triangle = mesh.triangles[random.below(mesh.triangles.len())];
    let corner = random.below(3);
    let at = |k: usize| DVec3::from(mesh.positions[triangle[(corner + k) % 3] as usize].map(f64::from));
    let along = [0.0, 0.5, random.unit()][random.below(3)];
    map.transform_point3(at(0) + (at(1) - at(0)) * along) + scene.geometry.centre
}

/// The times of a batch's rays: one time, a time for each of sixteen columns, times of their own, or the ends of the window
/// and of its slices.
fn times(random: &mut Rng, window: Window, batch: usize, rays: usize) -> Vec<f64> {
    let mut any = || window.from_s + (window.to_s - window.from_s) * random.unit();
    let one = any();
    let columns: Vec<f64> = (0..16).map(|_| any()).collect();
    (0..rays)
        .map(|ray| match batch % 4 {
            0 => one,
            1 => columns[ray % 16],
            2 => any(),
            _ => window.end_of_slice(ray % 4, 3),
        })
        .collect()
}

/// Casts batches of rays at things that move. They start from one point, from points along the path of a moving sensor, or from
/// anywhere; they are narrow fans or go anywhere, and some are aimed at edges and vertices where these are at the ray's time.
/// Returns the number of hits, and of those of something that moves.
fn agrees(scene: &Scene, tracers: &Tracers, batches: usize, spread: f64, seed: u64) -> [usize; 2] {
    let window = scene.arrangement.window.unwrap();
    let placements = &scene.arrangement.placements;
    let movers: Vec<usize> = (0..placements.len()).filter(|&p| placements[p].is_moving()).collect();
    let mut hits = [0; 2];
    for batch in 0..batches {
        let mut random = Rng::new(seed << 32 | batch as u64);
        let count = [128, 45, 150][batch / 3 % 3];
        let times_s = times(&mut random, window, batch, count);
        let origin = scene.geometry.centre + random.point() * spread;
        let step = random.point() * spread * [1e-6, 1e-3][batch / 16 % 2];
        let origins: Vec<DVec3> = (0..count)
            .map(|ray| match batch / 4 % 3 {
                0 => origin,
                1 => origin + step * (ray % 16) as f64,
                _ => scene.geometry.centre + random.point() * spread,
            })
            .collect();
        // Two of three batches look at something that moves.
        let placement = if batch % 3 == 0 { random.below(1000) } else { movers[random.below(movers.len())] };
        let main = (target(scene, &mut random, placement, times_s[0]) - origin).normalize();
        let directions: Vec<DVec3> = (0..count)
            .map(|ray| match (batch / 12 % 3, ray % 4) {
                (0, _) => (main + random.point() * 0.03).normalize(),
                (1, 0) => random.direction(),
                (2, 0) => (main + random.point() * 0.3).normalize(),
                // An unrounded direction makes determinants exactly zero where the map is exact.
                (_, 1) => target(scene, &mut random, placement, times_s[ray]) - origins[ray],
                _ => (target(scene, &mut random, placement, times_s[ray]) - origins[ray]).normalize(),
            })
            .map(|d| if d.is_finite() && d != DVec3::ZERO { d } else { DVec3::X })
            .collect();
        let origins = if batch / 4 % 3 == 0 { Origins::Common(origin) } else { Origins::Each(&origins) };
        let (t_min, t_max) = if batch % 5 == 0 { (0.1 * spread, spread) } else { (0.0, f64::INFINITY) };
        let rays =
            Rays { origins, directions: &directions, t_min, t_max, after: None, times_s: Some(&times_s) };
        same_hits(scene, tracers, batch, &rays);
        let found = cast(&BruteForce(scene), &rays);
        let is_moving = |hit: &&Hit| scene.arrangement.placements[hit.placement as usize].is_moving();
        hits[0] += found.iter().flatten().count();
        hits[1] += found.iter().flatten().filter(is_moving).count();
        for hit in found.iter().flatten() {
            assert!(
                hit.t.is_finite() && hit.normal.is_normalized() && hit.u >= 0.0 && hit.v >= 0.0,
                "{hit:?}"
            );
        }
    }
    hits
}

#[test]
fn moving_scenes_agree_with_brute_force() {
    let room = busy_room();
    let shared = tracers(&room);
    // A frame before time 0, one of no length, and one with slices of shapes.
    for (window, slice_s, seed) in [
        (Window { from_s: -0.04, to_s: 0.06 }, None, 1),
        (Window { from_s: 0.013, to_s: 0.013 }, Some(0.1), 2),
        (Window { from_s: 1e3, to_s: 1e3 + 0.1 }, Some(0.04), 3),
    ] {
        let scene = room.during(window, slice_s);
        let rearranged = |(name, tracer): &(_, Tracer)| (*name, tracer.rearranged(scene.arrangement.clone()));
        let tracers: Tracers = shared.iter().map(rearranged).collect();
        let [all, moving] = agrees(&scene, &tracers, 36, 8.0, seed);
        assert!(all > 2000 && moving > 200, "{all}, {moving}");
    }
}

/// At one time, a frame shows what a snapshot of that time shows: the two come by their maps in different ways.
#[test]
fn at_one_time_a_frame_is_a_snapshot() {
    let room = busy_room();
    let window = Window { from_s: -0.02, to_s: 0.08 };
    let mut random = Rng::new(5);
    let directions: Vec<_> = (0..600).map(|_| random.direction()).collect();
    let mut moved = 0;
    for round in 0..20 {
        // Shapes are those of the middle of the frame. In the last round that is the time.
        let time_s = if round == 19 { 0.03 } else { window.from_s + 0.1 * random.unit() };
        let (during, at) = (room.during(window, None), room.at(time_s));
        assert!(!at.arrangement.placements.iter().any(|p| p.is_moving()) && at.arrangement.window.is_none());
        let rays = Rays::unlimited(Origins::Common(random.point() * 5.0), &directions);
        let times_s = vec![time_s; 600];
        let in_frame = cast(&Tracer::build(&during), &Rays { times_s: Some(&times_s), ..rays });
        let in_snapshot = cast(&BruteForce(&at), &rays);
        for (mut frame, snapshot) in in_frame.into_iter().zip(in_snapshot) {
            let surface = |scene: &Scene, hit: &Option<Hit>| {
                hit.map(|hit| {
                    let placement = &scene.arrangement.placements[hit.placement as usize];
                    (scene.surface(hit.placement, hit.triangle), placement.first_triangle + hit.triangle)
                })
            };
            let surfaces = [surface(&during, &frame), surface(&at, &snapshot)];
            let bends = |object| [3, 8].contains(&object);
            if round < 19 && surfaces.iter().flatten().any(|(surface, _)| bends(surface.object)) {
                continue;
            }
            assert_eq!(surfaces[0], surfaces[1]);
            moved += usize::from(surfaces[0].is_some_and(|(surface, _)| surface.object > 1));
            // A placement's number depends on what is hidden.
            if let (Some(frame), Some(snapshot)) = (&mut frame, &snapshot) {
                frame.placement = snapshot.placement;
            }
            assert_eq!(frame, snapshot);
        }
    }
    assert!(moved > 400, "{moved}");
}

/// The published methods find what the exact tracer finds, but for their own errors. These are felt where f32 is stretched a
/// thousandfold, in the flat mesh, which fewer than three in a hundred rays hit.
#[test]
fn published_methods_see_what_moves() {
    let scene = busy_room().during(Window { from_s: 0.0, to_s: 0.1 }, Some(0.05));
    let mut random = Rng::new(8);
    let directions: Vec<_> = (0..2000).map(|_| random.direction()).collect();
    let times_s = times(&mut random, scene.arrangement.window.unwrap(), 2, 2000);
    let rays = Rays { times_s: Some(&times_s), ..Rays::unlimited(Origins::Common(DVec3::ZERO), &directions) };
    let expected = cast(&Tracer::build(&scene), &rays);
    for method in ["moller-trumbore", "segura-feito-precomputed"].map(Method::named) {
        let tracer = AnyTracer::build(&busy_room(), method).rearranged(scene.arrangement.clone());
        let found = cast(&tracer, &rays);
        let mut blocked = vec![false; 2000];
        tracer.blocked(&rays, &mut blocked);
        let same = |(a, b): (&Option<Hit>, &Option<Hit>)| match (a, b) {
            (Some(a), Some(b)) => {
                (a.placement, a.triangle) == (b.placement, b.triangle) && (a.t - b.t).abs() < 1e-4
            }
            (a, b) => a.is_none() && b.is_none(),
        };
        let agree = expected.iter().zip(&found).filter(|(a, b)| same((a, b))).count();
        assert!(agree >= 1940, "{agree}");
        assert_eq!(blocked, found.iter().map(Option::is_some).collect::<Vec<_>>());
    }
}

/// Rays without times, or with times of another frame, are refused where something moves, and taken where nothing does.
#[test]
fn rays_need_times_where_something_moves() {
    let room = busy_room();
    let frame = Tracer::build(&room.during(Window { from_s: 0.0, to_s: 0.1 }, None));
    let rays = Rays::unlimited(Origins::Common(DVec3::ZERO), &[DVec3::X]);
    let refuses = |rays: Rays| {
        let cast = std::panic::AssertUnwindSafe(|| cast(&frame, &rays));
        std::panic::catch_unwind(cast).is_err()
    };
    assert!(refuses(rays));
    for (time_s, is_refused) in
        [(0.0, false), (0.1, false), (-1e-9, true), (0.1 + 1e-9, true), (f64::NAN, true)]
    {
        assert_eq!(refuses(Rays { times_s: Some(&[time_s]), ..rays }), is_refused, "{time_s}");
    }
    assert!(refuses(Rays { times_s: Some(&[0.0, 0.0]), ..rays }));
    // As it was built, the scene is at rest.
    let at_rest = Tracer::build(&room);
    assert_eq!(cast(&at_rest, &rays), cast(&at_rest, &Rays { times_s: Some(&[7.0]), ..rays }));
}

/// The spinning sensor of the tests: 32 beams, 360 columns in a tenth of a second, and a time of its own for each beam.
fn spinning(limits: RangeLimits) -> Sensor {
    let beam = |i: i32| Beam {
        elevation: Angle::deg(f64::from(i) - 15.0),
        azimuth_offset: Angle::deg(f64::from(i % 4) * 0.7),
        time_s: f64::from(i) * 1.7e-6 - 2e-5,
        file_index: 0,
    };
    let turn = (Angle::deg(180.0), Angle::deg(-180.0));
    let pattern = Rotating::new((0..32).map(beam).collect(), 360, turn, 10.0).unwrap();
    Sensor {
        pattern: Pattern::Rotating(pattern),
        range: limits,
        ring: RingOrder::Row,
        measurement: Default::default(),
    }
}

/// Scans a scene arranged for a capture.
fn scanned(scene: &Scene, capture: &Capture) -> Frame {
    let scene = scene.during(capture.window(), None);
    scan(&scene, &Tracer::build(&scene), capture, &Progress::default()).unwrap()
}

/// The rays of a capture in the world, each with its time and what came back.
fn each_ray(
    capture: &Capture,
    frame: &Frame,
    mut check: impl FnMut(f64, DVec3, DVec3, Option<beamcast::scan::Return>),
) {
    for row in 0..frame.rows() {
        for column in 0..frame.columns() {
            let pulse = capture.pulse(row, column).unwrap();
            let pose = capture.world_from_sensor(pulse.time_s);
            let time_s = capture.cast_at_s(pulse.time_s);
            check(time_s, pose.point(pulse.origin), pose.direction(pulse.direction), frame.get(row, column));
        }
    }
}

/// A wall comes towards a sensor that goes to meet it. Each pulse hits the wall where it is at the pulse's own time: at
/// (x₀ − v·τ − o)/d along x.
///
/// Every coordinate along x is at most 64 m and has 53 digits (the others make no difference to the depth), so each of a dozen roundings costs at most 2⁻⁴⁸ m: of the wall's place and
/// the sensor's (two each), of the ray that is carried (four), and of the depth (five), divided by d ≥ ½. That is 1.4·10⁻¹³ m
/// in all.
#[test]
fn an_actor_with_opposite_velocity_is_where_it_is_at_each_pulse() {
    let wall = quad(
        [[0.0, -200.0, -200.0], [0.0, 200.0, -200.0], [0.0, 200.0, 200.0], [0.0, -200.0, 200.0]]
            .map(DVec3::from),
    );
    let start = DVec3::new(40.0, 0.0, 0.0);
    let scene =
        built(vec![wall], vec![moving(0, vec![twist(start, DVec3::new(-22.0, 0.0, 0.0), DVec3::ZERO)])]);
    let sensor = spinning(RangeLimits::default());
    let body = Trajectory::Twist {
        start: Pose::IDENTITY,
        linear_m_s: DVec3::new(14.0, 0.0, 0.0),
        angular_rad_s: DVec3::ZERO,
    };
    let mut hits = 0;
    for number in [0, 3] {
        let capture = Capture::new(&sensor, Pose::IDENTITY, &body, number, 0);
        let frame = scanned(&scene, &capture);
        each_ray(&capture, &frame, |time_s, origin, direction, found| {
            if direction.x < 0.5 {
                return;
            }
            let expected = (40.0 - 22.0 * time_s - origin.x) / direction.x;
            assert!((origin.x - 14.0 * time_s).abs() < 1e-14);
            let found = found.unwrap();
            assert!((found.range_m - expected).abs() < 1.4e-13, "{} for {expected}", found.range_m);
            assert!((f64::from(found.normal[0]) + 1.0).abs() < 1e-6);
            hits += 1;
        });
    }
    assert!(hits > 5000, "{hits}");
}

/// A plate turns about an axis beside it. Its plane at time τ is that through (R cos ωτ, R sin ωτ) with that direction as its normal.
///
/// The axis is R = 3 m away at most 20 m. Roundings cost as above 2⁻⁴⁹ m each; the angle ω·τ is off by 2⁻⁵³ of itself (4 rad) and
/// sine and cosine by an ulp of 1, at a lever arm of 8 m: 2·10⁻¹⁵ m each. Of these, less than twenty are divided by |d·n| ≥ 0.3.
#[test]
fn a_spinning_plate_is_turned_at_each_pulse() {
    let (radius, rate) = (3.0, 40.0);
    let plate =
        quad([[3.0, -8.0, -8.0], [3.0, 8.0, -8.0], [3.0, 8.0, 8.0], [3.0, -8.0, 8.0]].map(DVec3::from));
    let centre = DVec3::new(12.0, 2.0, 1.0);
    let spin = twist(centre, DVec3::ZERO, DVec3::new(0.0, 0.0, rate));
    let scene = built(vec![plate], vec![moving(0, vec![spin])]);
    let sensor = spinning(RangeLimits::default());
    let capture = Capture::at_origin(&sensor);
    let frame = scanned(&scene, &capture);
    let mut hits = 0;
    each_ray(&capture, &frame, |time_s, origin, direction, found| {
        let Some(found) = found else { return };
        let (sin, cos) = libm::sincos(rate * time_s);
        let normal = DVec3::new(cos, sin, 0.0);
        let along = direction.dot(normal);
        if along.abs() < 0.3 {
            return;
        }
        let expected = ((centre - origin).dot(normal) + radius) / along;
        assert!((found.range_m - expected).abs() < 4e-13, "{} for {expected}", found.range_m);
        // The normal looks back at the sensor; the sensor's axes are the world's.
        let seen = DVec3::from(found.normal.map(f64::from));
        assert!(seen.abs_diff_eq(-normal * along.signum(), 1e-6), "{seen} for {normal}");
        assert!(
            (f64::from(found.intensity) - scene.geometry.materials[0].reflectivity() as f64 * along.abs())
                .abs()
                < 1e-6
        );
        hits += 1;
    });
    assert!(hits > 500, "{hits}");
}

/// A sensor and what it sees move together, along a screw. Every pulse finds what it would find if both stood.
///
/// The poses' coordinates are at most 40 m. Carrying a ray out of the sensor and into the mesh costs a dozen roundings of 2⁻⁴⁸ m, and
/// the rotations are off by a few ulps of 1 at arms of 20 m; these are divided by the cosine at the surface, at least a tenth.
#[test]
fn what_moves_with_the_sensor_stands_still() {
    let ball = sphere(2.0, DVec3::new(9.0, 1.0, 0.0), 3);
    let start =
        Pose::from_rpy(DVec3::new(5.0, -3.0, 1.0), Angle::deg(10.0), Angle::deg(-20.0), Angle::deg(70.0));
    let body = Trajectory::Twist {
        start,
        linear_m_s: DVec3::new(20.0, 3.0, -1.0),
        angular_rad_s: DVec3::new(0.5, -1.0, 8.0),
    };
    let together = built(vec![ball.clone()], vec![moving(0, vec![Link::Rigid(body.clone())])]);
    // Stored in its own space, too, it has the same vertices.
    let apart = built(vec![ball], vec![moving(0, vec![Link::Fixed(DAffine3::IDENTITY)])]);
    let sensor = spinning(RangeLimits::default());
    let moved = scanned(&together, &Capture::new(&sensor, Pose::IDENTITY, &body, 1, 0));
    let stood = scanned(&apart, &Capture::new(&sensor, Pose::IDENTITY, &AT_ORIGIN, 1, 0));
    let mut hits = 0;
    for (pixel, expected) in stood.iter() {
        let (row, column) = (pixel / stood.columns(), pixel % stood.columns());
        let Some(found) = moved.get(row, column).filter(|_| expected.intensity > 0.08) else { continue };
        if found.triangle != expected.triangle {
            continue; // At an edge between two triangles either may be found.
        }
        assert!(
            (found.range_m - expected.range_m).abs() < 1e-11,
            "{} for {}",
            found.range_m,
            expected.range_m
        );
        let [a, b] = [found.normal, expected.normal].map(|n| DVec3::from(n.map(f64::from)));
        assert!(a.abs_diff_eq(b, 1e-6));
        hits += 1;
    }
    let counts = [moved.return_count(), stood.return_count()];
    assert!(hits > 300 && counts[0].abs_diff(counts[1]) < 5, "{hits} {counts:?}");
}

/// A frozen frame is the snapshot of its start, whether the scene was arranged for the frame or for that time.
#[test]
fn a_frozen_frame_is_a_snapshot() {
    let room = busy_room();
    let sensor = spinning(RangeLimits::default());
    let body = Trajectory::Twist { start: Pose::IDENTITY, linear_m_s: DVec3::X, angular_rad_s: DVec3::Z };
    let capture = Capture::new(&sensor, Pose::IDENTITY, &body, 1, 0);
    let frozen = capture.in_sequence(0.02, true);
    let start_s = 0.02 + 0.1;
    assert_eq!(frozen.window(), Window { from_s: start_s, to_s: start_s });
    let snapshot = room.at(start_s);
    let expected = scan(&snapshot, &Tracer::build(&snapshot), &frozen, &Progress::default()).unwrap();
    assert_eq!(scanned(&room, &frozen), expected);
    let rolling = scanned(&room, &capture.in_sequence(0.02, false));
    let differ =
        (0..32 * 360).filter(|&i| rolling.get(i / 360, i % 360) != expected.get(i / 360, i % 360)).count();
    assert!(differ > 32 * 360 / 3, "{differ}");
}

#[test]
fn frames_of_what_moves_do_not_depend_on_threads() {
    let room = busy_room();
    let sensor = spinning(RangeLimits::default());
    let capture = Capture::at_origin(&sensor);
    let frames = [1, 3].map(|threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| scanned(&room, &capture))
    });
    assert_eq!(frames[0], frames[1]);
}

/// Every pulse of every built-in sensor is cast within the window of its frame.
#[test]
fn pulses_are_within_the_window_of_their_frame() {
    let mut sensors: Vec<_> =
        presets::BUILT_IN.iter().map(|(name, _)| crate::patterns::preset(name).sensor).collect();
    sensors.push(spinning(RangeLimits::default()));
    for sensor in sensors {
        let capture = Capture::at_origin(&sensor).with_frame(3).in_sequence(12.3, false);
        let window = capture.window();
        let mut ends = Window { from_s: f64::INFINITY, to_s: f64::NEG_INFINITY };
        for row in 0..capture.rows() {
            for column in 0..capture.columns() {
                let Some(time_s) = capture.time_s(row, column) else { continue };
                let time_s = capture.cast_at_s(time_s);
                ends = Window { from_s: ends.from_s.min(time_s), to_s: ends.to_s.max(time_s) };
            }
        }
        assert_eq!(ends, window, "{:?}", sensor.pattern.rate_hz());
    }
}

/// Things that move in a scene of several regions: the regions' ids come first, and rays agree.
#[test]
fn what_moves_among_regions_agrees_with_brute_force() {
    let mut ground = mesh(vec![], vec![]);
    for x in -6..6 {
        for y in -6..6 {
            let [x, y] = [x, y].map(|k| k as f32 * 1000.3);
            let base = ground.positions.len() as u32;
            ground.positions.extend([[x, y, 0.1], [x + 999.7, y, 0.2], [x, y + 999.7, 0.3]]);
            ground.parts[0].triangles.push([base, base + 1, base + 2]);
        }
    }
    let far = DVec3::new(4000.0, -3000.0, 20.0);
    let instances = vec![
        standing(0, DAffine3::from_translation(DVec3::new(1e5, 0.0, 0.0))),
        moving(
            1,
            vec![twist(
                DVec3::new(1e5, 0.0, 0.0) + far,
                DVec3::new(300.0, 0.0, 0.0),
                DVec3::new(0.0, 9.0, 0.0),
            )],
        ),
        standing(0, DAffine3::from_translation(DVec3::new(1e5, 0.0, -50.0))),
    ];
    let mut instances = instances;
    instances[2].mesh = 2;
    let other = ground.clone();
    let scene = built(vec![ground, sphere(30.0, DVec3::ZERO, 2), other], instances);
    assert!(scene.geometry.regions > 1, "{}", scene.geometry.regions);
    let scene = scene.during(Window { from_s: -0.1, to_s: 0.3 }, None);
    assert_eq!(scene.arrangement.placements.len(), scene.geometry.regions as usize + 1);
    let tracers = tracers(&scene);
    let [all, moving] = agrees(&scene, &tracers, 48, 5000.0, 9);
    assert!(all > 500 && moving > 100, "{all}, {moving}");
}

#[test]
fn names_labels_and_ids_hold_at_all_times() {
    let mut hidden = moving(1, vec![Link::Visible(Channel::rest(false))]);
    hidden.object = Object { name: "ghost".into(), file_label: Some(9), ..Object::default() };
    let mut bending = standing(1, DAffine3::from_translation(DVec3::Y * 4.0));
    let ball = sphere(1.0, DVec3::ZERO, 1);
    bending.deformer = Some(waving(&ball));
    bending.object.file_label = Some(4);
    let mut crushed = moving(
        1,
        vec![Link::Animated {
            translation: Channel::rest(DVec3::ZERO),
            rotation: Channel::rest(DQuat::IDENTITY),
            scale: keys(&[0.0, 1.0], vec![DVec3::ZERO, DVec3::ONE], Blending::Linear, 1.0),
        }],
    );
    crushed.object.file_label = Some(2);
    let instances = vec![hidden, standing(0, DAffine3::IDENTITY), bending, crushed];
    let scene = built(vec![cuboid([-9.0; 3], [9.0; 3]), ball], instances);
    // The room's 12 triangles come first; 32 for each of the others.
    assert_eq!(scene.triangle_count(), 12 + 3 * 32);
    assert_eq!(
        scene.geometry.movers.iter().map(|m| (m.first_triangle, m.object)).collect::<Vec<_>>(),
        [(12, 0), (44, 2), (76, 3)]
    );
    let window = Window { from_s: 0.0, to_s: 0.5 };
    let ids = |scene: &Scene| {
        scene.arrangement.placements.iter().map(|p| (p.first_triangle, p.first_object)).collect::<Vec<_>>()
    };
    let cases = [
        // At rest, as it was built, the ghost stands where its first place is, and the crushed one is nowhere.
        (scene.clone(), vec![(0, 0), (12, 0), (44, 2)]),
        (scene.at(0.0), vec![(0, 0), (44, 2)]),
        (scene.at(0.5), vec![(0, 0), (44, 2), (76, 3)]),
        (scene.during(window, None), vec![(0, 0), (44, 2), (76, 3)]),
        (scene.during(window, Some(0.2)), vec![(0, 0), (44, 2), (44, 2), (44, 2), (76, 3)]),
        (scene.during(window, Some(0.2)).at(0.5).during(window, None), vec![(0, 0), (44, 2), (76, 3)]),
    ];
    for (scene, expected) in cases {
        assert_eq!(ids(&scene), expected);
        assert_eq!((scene.triangle_count(), scene.labels()), (108, vec![0, 2, 4, 9]));
        let bent = scene.arrangement.placements.iter().position(|p| p.first_object == 2).unwrap() as u32;
        assert_eq!(scene.label(scene.surface(bent, 31)), 4);
        Tracer::build(&scene).rearranged(scene.arrangement.clone());
    }
    // Each time of the frame has one slice.
    let sliced = scene.during(window, Some(0.2));
    for step in 0..=30 {
        let time_s = if step == 30 { 0.5 } else { window.end_of_slice(step, 30) };
        let there =
            sliced.arrangement.placements[1..4].iter().filter(|p| p.scene_from_mesh_at(time_s).is_some());
        assert_eq!(there.count(), 1, "{time_s}");
    }
    // Two slices that overlap would give an id to two triangles at once.
    let mut overlapping = (*sliced.arrangement).clone();
    overlapping.placements[2] = overlapping.placements[1].clone();
    let rearranged = std::panic::AssertUnwindSafe(|| scene.rearranged(Arc::new(overlapping)));
    assert!(std::panic::catch_unwind(rearranged).is_err());
}

/// What moves does not move the scene's centre, unless there is nothing else, and what is stored in its own space keeps its digits.
#[test]
fn what_moves_keeps_its_digits_wherever_it_goes() {
    let ball = || sphere(1.0, DVec3::new(0.1, 0.2, 0.3), 2);
    let far = twist(DVec3::new(2e6, 0.0, 0.0), DVec3::X, DVec3::ZERO);
    let room = || cuboid([-9.0; 3], [9.0; 3]);
    let both =
        built(vec![ball(), room()], vec![moving(0, vec![far.clone()]), standing(1, DAffine3::IDENTITY)]);
    assert_eq!((both.geometry.centre, both.geometry.regions), (DVec3::ZERO, 1));
    assert_eq!((both.geometry.rounding.stored_m, both.geometry.meshes[1].positions.len()), (0.0, 66));
    assert_eq!(both.geometry.meshes[1].positions, ball().positions);
    let alone = built(vec![ball()], vec![moving(0, vec![far])]);
    assert!((alone.geometry.centre - DVec3::new(2e6, 0.0, 0.0)).abs().max_element() < 1.0);
    assert_eq!(alone.geometry.meshes[1].positions, ball().positions);
}

/// Motions that are no numbers, or lead out of the range of numbers, hide what they move and disturb nothing else.
#[test]
fn motions_out_of_range_are_never_hit() {
    for (linear, angular) in [
        (DVec3::new(1e300, 0.0, 0.0), DVec3::ZERO),
        (DVec3::new(f64::MAX, f64::MAX, 0.0), DVec3::ZERO),
        (DVec3::NAN, DVec3::ZERO),
        (DVec3::ZERO, DVec3::INFINITY),
        (DVec3::new(1e13, 0.0, 0.0), DVec3::new(1e9, 1e9, 1e300)),
    ] {
        let mut instance = moving(0, vec![twist(DVec3::ZERO, linear, angular)]);
        instance.world_from_mesh = DAffine3::IDENTITY;
        let scene = built(
            vec![sphere(1.0, DVec3::ZERO, 1), cuboid([-9.0; 3], [9.0; 3])],
            vec![instance, standing(1, DAffine3::IDENTITY)],
        );
        let scene = scene.during(Window { from_s: 1.0, to_s: 2.0 }, None);
        let mut random = Rng::new(4);
        let directions: Vec<_> = (0..256).map(|_| random.direction()).collect();
        let times_s: Vec<_> = (0..256).map(|_| 1.0 + random.unit()).collect();
        let origins = Origins::Common(DVec3::new(3.0, 0.0, 0.0));
        let rays = Rays { times_s: Some(&times_s), ..Rays::unlimited(origins, &directions) };
        same_hits(&scene, &tracers(&scene), 0, &rays);
        for hit in cast(&Tracer::build(&scene), &rays) {
            assert_eq!(hit.map(|hit| hit.placement), Some(0), "{linear} {angular}: the room is closed");
        }
    }
}
