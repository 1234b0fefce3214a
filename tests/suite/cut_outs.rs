//! Beams pass holes and panes, and the surface with the largest share of the light is reported.

use std::collections::BTreeMap;
use std::sync::Arc;

use beamcast::angle::Angle;
use beamcast::frame::Pose;
use beamcast::motion::{AT_ORIGIN, Link, Motion, Trajectory};
use beamcast::rng::Rng;
use beamcast::scan::{Cause, Frame, Progress, Return, alone, scan};
use beamcast::scene::{
    AlphaMode, Corners, Deformer, Image, Material, Scene, SceneBuilder, SourceInstance, SourceMesh,
    SourcePart, Texture,
};
use beamcast::sensor::{Camera, Capture, Pattern, RangeLimits, Sensor};
use beamcast::trace::methods::Method;
use beamcast::trace::{AnyTracer, BruteForce, Cast, Hit, Origins, Rays, Tracer};
use glam::{DAffine3, DVec3};

use crate::shapes::{quad, seen_from, sphere};
use crate::trace::{cast, rotated, tracers};

pub const CELLS: usize = 8;

/// Whether a cell of the checkerboard is there.
pub fn is_there(column: usize, row: usize) -> bool {
    (column + row).is_multiple_of(2)
}

/// A material whose texture has a texel for each cell.
fn masked(there: impl Fn(usize, usize) -> bool) -> Material {
    let texel = |i: usize| [255, 0, 0, if there(i % CELLS, i / CELLS) { 255 } else { 0 }];
    let image = Image::new(CELLS as u32, 4, (0..CELLS * CELLS).flat_map(texel).collect()).unwrap();
    let texture = Texture { is_nearest: true, ..Texture::new(Arc::new(image)) };
    Material {
        base_color_texture: Some(texture),
        alpha: AlphaMode::Mask { cutoff: 0.5 },
        ..Material::default()
    }
}

/// A card two metres wide and high in the plane x = 0, which shows its texture `repeats` times to who looks along x.
fn card(repeats: f32, material: u32) -> SourceMesh {
    let corner = |y: f64, z: f64| DVec3::new(0.0, y, z);
    let mut mesh = quad([corner(1.0, 1.0), corner(1.0, -1.0), corner(-1.0, -1.0), corner(-1.0, 1.0)]);
    let part = &mut mesh.parts[0];
    part.material = material;
    part.corners = Corners::new(1, false);
    for vertex in part.triangles.clone().into_flattened() {
        let [_, y, z] = mesh.positions[vertex as usize];
        part.corners.push(&[[(1.0 - y) / 2.0 * repeats, (1.0 - z) / 2.0 * repeats]], [1.0; 4]);
    }
    mesh
}

/// The same card without a texture, whose holes are cut out as triangles.
fn cut(material: u32) -> SourceMesh {
    let mut mesh = SourceMesh::default();
    let mut triangles = Vec::new();
    for cell in (0..CELLS * CELLS).filter(|cell| is_there(cell % CELLS, cell / CELLS)) {
        let at = |i: usize| 1.0 - 2.0 * i as f32 / CELLS as f32;
        let [y, z] = [cell % CELLS, cell / CELLS].map(|i| [at(i), at(i + 1)]);
        let base = mesh.positions.len() as u32;
        mesh.positions.extend([[0.0, y[0], z[0]], [0.0, y[0], z[1]], [0.0, y[1], z[1]], [0.0, y[1], z[0]]]);
        triangles.extend([[base, base + 1, base + 2], [base, base + 2, base + 3]]);
    }
    mesh.parts.push(SourcePart { triangles, material, ..SourcePart::default() });
    mesh
}

/// A wall across the plane x = 0.
fn wall(size: f64, material: u32) -> SourceMesh {
    let corner = |y: f64, z: f64| DVec3::new(0.0, y * size, z * size);
    let mut mesh = quad([corner(1.0, 1.0), corner(1.0, -1.0), corner(-1.0, -1.0), corner(-1.0, 1.0)]);
    mesh.parts[0].material = material;
    mesh
}

fn grey(share: f32) -> Material {
    Material { base_color: [share, share, share, 1.0], ..Material::default() }
}

fn at(mesh: usize, world_from_mesh: DAffine3) -> SourceInstance {
    SourceInstance { mesh, world_from_mesh, ..SourceInstance::default() }
}

fn ahead(x: f64) -> DAffine3 {
    DAffine3::from_translation(DVec3::new(x, 0.0, 0.0))
}

fn built(meshes: Vec<SourceMesh>, instances: Vec<SourceInstance>, materials: Vec<Material>) -> Scene {
    SceneBuilder { meshes, instances, materials, ..SceneBuilder::default() }.build().unwrap()
}

/// A camera that looks along x.
fn camera(width: usize, height: usize, range: RangeLimits) -> Sensor {
    let camera = Camera::from_hfov((width, height), Angle::deg(60.0), None).unwrap();
    Sensor { range, ..Sensor::new(Pattern::Camera(camera)) }
}

fn seen(scene: &Scene, tracer: &impl Cast, sensor: &Sensor) -> Frame {
    seen_from(scene, tracer, sensor, &Pose::IDENTITY)
}

fn range(min_m: f64, max_m: f64) -> RangeLimits {
    RangeLimits { min_m, max_m, ..RangeLimits::default() }
}

#[test]
fn holes_show_what_is_behind_them_to_every_tracer() {
    let meshes = vec![card(1.0, 0), wall(9.0, 1)];
    let scene = built(meshes, vec![at(0, ahead(2.0)), at(1, ahead(5.0))], vec![masked(is_there), grey(0.5)]);
    let sensor = camera(160, 120, range(0.0, 100.0));
    let expected = seen(&scene, &BruteForce(&scene), &sensor);
    for (name, tracer) in tracers(&scene) {
        assert_eq!(seen(&scene, &tracer, &sensor), expected, "{name}");
    }
    let other = AnyTracer::build(&scene, Method::named("moller-trumbore"));
    let differ = |(a, b): (Option<Return>, Option<Return>)| a.map(|a| a.triangle) != b.map(|b| b.triangle);
    let frame = seen(&scene, &other, &sensor);
    assert_eq!(frame.first_returns().zip(expected.first_returns()).filter(|pair| differ(*pair)).count(), 0);

    let capture = Capture::new(&sensor, Pose::IDENTITY, &AT_ORIGIN, 0, 0);
    let mut counts = [0; 2];
    for row in 0..120 {
        for column in 0..160 {
            let d = capture.pulse(row, column).unwrap().direction;
            let cell = |c: f64| (1.0 - c * 2.0 / d.x) / 2.0 * CELLS as f64;
            let (u, v) = (cell(d.y), cell(d.z));
            let is_on_card = [u, v].iter().all(|c| (0.0..CELLS as f64).contains(c));
            let is_card = is_on_card && is_there(u as usize, v as usize);
            let found = expected.get(row, column).unwrap();
            let (distance, reflectivity) = if is_card { (2.0, 0.2126) } else { (5.0, 0.5) };
            assert!((found.range_m - distance / d.x).abs() < 1e-12, "{row} {column}: {found:?}");
            assert!((f64::from(found.intensity) - reflectivity * d.x).abs() < 1e-6, "{found:?}");
            counts[usize::from(is_card)] += usize::from(is_on_card);
        }
    }
    assert!(counts.iter().all(|&count| count > 3000), "{counts:?}");
}

/// However a card is placed, a texture's holes are where holes that are cut out as triangles would be.
#[test]
fn holes_stay_on_cards_that_stand_move_and_bend() {
    let material = Material { base_color: [0.2, 0.2, 0.2, 1.0], ..Material::default() };
    let turned = |x: f64, y: f64, z: f64| {
        rotated(DVec3::new(0.3, 1.0, 0.7), 0.6, DVec3::new(1.0, 0.7, 0.8), DVec3::new(x, y, z))
    };
    let moving = |mesh: usize| {
        let links = vec![
            Link::Rigid(Trajectory::Twist {
                start: Pose { translation: DVec3::new(6.0, -3.0, 1.0), ..Pose::IDENTITY },
                linear_m_s: DVec3::new(1.0, 8.0, -3.0),
                angular_rad_s: DVec3::new(2.0, 1.0, 5.0),
            }),
            Link::Fixed(DAffine3::from_scale(DVec3::new(1.0, -1.0, 1.0))),
        ];
        let motion = Motion { links };
        let world_from_mesh = motion.at(0.0).unwrap();
        SourceInstance { mesh, world_from_mesh, motion: Some(Arc::new(motion)), ..SourceInstance::default() }
    };
    // The shapes of the two cards are the same only if straight lines stay straight.
    let bending = |mesh: usize, rest: &SourceMesh| {
        let rest = rest.positions.clone();
        let shape = move |time_s: f64| {
            let lean = |[_, y, z]: [f32; 3]| [0.5 * y + time_s as f32 * z, y, 0.5 * z];
            Some(rest.iter().copied().map(lean).collect())
        };
        let deformer = Some(Arc::new(Deformer::new(shape)));
        SourceInstance { deformer, ..at(mesh, ahead(3.5)) }
    };
    let far = sphere(1.0, DVec3::new(4e6, 0.0, 0.0), 1);
    for (kind, regions) in
        [("standing", false), ("placed", false), ("moving", false), ("bending", false), ("large", true)]
    {
        let scene = |card: SourceMesh| {
            let mut meshes = vec![card, wall(40.0, 1)];
            let mut instances = vec![at(1, ahead(9.0))];
            match kind {
                "standing" => instances.push(at(0, turned(3.0, 0.2, 0.1))),
                "placed" => {
                    instances.extend(
                        (0..6).map(|i| at(0, turned(3.0 + 0.4 * f64::from(i), f64::from(i) - 2.5, 0.3))),
                    );
                    instances.push(at(
                        0,
                        DAffine3::from_scale(DVec3::new(1.0, -1.0, 1.0)) * turned(3.0, 0.0, -1.0),
                    ));
                }
                "moving" => instances.extend([moving(0), at(0, turned(4.0, 0.0, 0.0))]),
                "bending" => instances.push(bending(0, &meshes[0])),
                _ => {
                    meshes.push(far.clone());
                    instances.extend([at(0, turned(3.0, 0.2, 0.1)), at(2, DAffine3::IDENTITY)]);
                }
            }
            built(
                meshes,
                instances,
                vec![Material { alpha: AlphaMode::Opaque, ..material.clone() }, grey(0.5)],
            )
        };
        let sensor = camera(160, 120, range(0.0, 1e9));
        let capture = Capture::new(&sensor, Pose::IDENTITY, &AT_ORIGIN, 0, 0);
        let shown = |scene: &Scene| {
            assert_eq!(scene.geometry.regions > 1, regions, "{kind}");
            let scene = scene.during(capture.window(), None);
            let frame = scan(&scene, &Tracer::build(&scene), &capture, &Progress::default()).unwrap();
            assert_eq!(
                scan(&scene, &BruteForce(&scene), &capture, &Progress::default()),
                Some(frame.clone()),
                "{kind}"
            );
            (scene, frame)
        };
        let (_, with_triangles) = shown(&scene(cut(0)));
        let mut textured = scene(card(1.0, 0));
        Arc::make_mut(&mut textured.geometry).materials[0] = masked(is_there);
        let (textured, with_holes) = shown(&textured);
        let mut on_card = 0;
        for (a, b) in with_triangles.first_returns().zip(with_holes.first_returns()) {
            let (a, b) = (a.unwrap(), b.unwrap());
            assert!((a.range_m - b.range_m).abs() < 1e-5 * a.range_m, "{kind}: {a:?} {b:?}");
            assert_eq!(a.instance, b.instance, "{kind}");
            on_card += usize::from(a.instance > 0);
        }
        assert!(on_card > 1000, "{kind}: {on_card}");
        // A part of the scene has the same holes.
        let part = textured.only(|object| object > 0);
        let frame = scan(&part, &Tracer::build(&part), &capture, &Progress::default());
        if kind != "moving" && kind != "bending" {
            let of_part = frame.unwrap();
            for (whole, part) in with_holes.first_returns().zip(of_part.first_returns()) {
                let whole = whole.filter(|one| one.instance > 0);
                assert_eq!(whole.map(|one| one.range_m), part.map(|one| one.range_m), "{kind}");
            }
        }
    }
}

/// The return along x from panes at 1, 2, … metres, each of a material, and a wall at 9 m behind them.
fn through_panes(panes: &[Material], limits: RangeLimits) -> (Option<Return>, Cause) {
    let mut materials = panes.to_vec();
    materials.push(grey(0.5));
    let meshes = (0..materials.len()).map(|material| wall(1.0, material as u32)).collect();
    let place = |mesh: usize| at(mesh, ahead(if mesh < panes.len() { 1.0 + mesh as f64 } else { 9.0 }));
    let scene = built(meshes, (0..materials.len()).map(place).collect(), materials);
    let frame = seen(&scene, &Tracer::build(&scene), &camera(1, 1, limits));
    assert_eq!(frame, seen(&scene, &BruteForce(&scene), &camera(1, 1, limits)));
    (frame.get(0, 0), frame.causes()[0])
}

fn pane(alpha: f32) -> Material {
    Material { base_color: [1.0, 1.0, 1.0, alpha], alpha: AlphaMode::Blend, ..Material::default() }
}

#[test]
fn panes_return_their_share_and_let_the_rest_through_twice() {
    let all = range(0.0, 100.0);
    let glass = |transmission: f32| Material { transmission, ..Material::default() };
    let both = Material { transmission: 0.5, ..pane(0.5) };
    let solid = Material { alpha: AlphaMode::Opaque, ..pane(0.0) };
    for (panes, range_m, intensity) in [
        (vec![pane(0.25)], 9.0, 0.5 * 0.5625),
        (vec![pane(0.5)], 1.0, 0.5),
        (vec![pane(0.125), pane(0.25)], 9.0, 0.5 * 0.765_625 * 0.5625),
        (vec![pane(0.25), pane(0.75)], 2.0, 0.75 * 0.5625),
        (vec![pane(0.0), pane(0.0)], 9.0, 0.5),
        (vec![pane(1.0)], 1.0, 1.0),
        (vec![glass(0.75)], 9.0, 0.5 * 0.5625),
        (vec![glass(0.5)], 1.0, 0.5),
        (vec![both], 9.0, 0.5 * 0.5625),
        (vec![solid], 1.0, 1.0),
    ] {
        let (found, cause) = through_panes(&panes, all);
        let found = found.unwrap();
        assert_eq!((found.range_m, cause), (range_m, Cause::Surface), "{panes:?}");
        assert!((f64::from(found.intensity) - intensity).abs() < 1e-6, "{panes:?}: {found:?}");
    }
}

#[test]
fn a_hole_in_the_dead_zone_blocks_nothing() {
    let hole = Material { alpha: AlphaMode::Mask { cutoff: 0.5 }, ..pane(0.25) };
    let near = range(1.5, 100.0);
    let (found, _) = through_panes(std::slice::from_ref(&hole), near);
    assert_eq!(found.map(|one| one.range_m), Some(9.0));
    assert_eq!(through_panes(&[pane(1.0)], near), (None, Cause::TooNear));
    // A pane out of the sensor's range is not reported, but it takes its share.
    let (found, _) = through_panes(&[pane(0.75)], near);
    assert!((found.unwrap().intensity - 0.5 * 0.0625).abs() < 1e-6);
    assert_eq!(through_panes(&[pane(0.75)], range(1.5, 5.0)), (None, Cause::TooNear));
    assert_eq!(through_panes(&[pane(0.25)], range(1.5, 5.0)), (None, Cause::OutOfRange));
    let (found, _) = through_panes(&[pane(0.25)], range(0.5, 5.0));
    assert!((found.unwrap().intensity - 0.25).abs() < 1e-6);
    assert_eq!(through_panes(std::slice::from_ref(&hole), range(0.5, 5.0)), (None, Cause::OutOfRange));
}

/// Leaves cover a share of their cards, and beams pass as many cards as chance has it.
#[test]
fn a_tree_of_leaf_cards_is_no_wall() {
    let mut random = Rng::new(4);
    let leaves: Vec<bool> = (0..CELLS * CELLS).map(|_| random.unit() < 0.4).collect();
    let cover = leaves.iter().filter(|&&leaf| leaf).count() as f64 / leaves.len() as f64;
    let place = |random: &mut Rng| {
        let axis = random.direction();
        rotated(
            axis,
            random.unit() * 3.0,
            DVec3::splat(0.7),
            DVec3::new(6.0, 0.0, 0.0) + random.point() * 1.5,
        )
    };
    let mut instances: Vec<_> = (0..60).map(|_| at(0, place(&mut random))).collect();
    instances.push(at(1, ahead(12.0)));
    let material = masked(|column, row| leaves[row * CELLS + column]);
    let scene = built(vec![card(7.0, 0), wall(20.0, 1)], instances, vec![material, grey(0.5)]);
    let tracer = Tracer::build(&scene);
    let sensor = camera(320, 240, range(0.0, 100.0));
    let frame = seen(&scene, &tracer, &sensor);
    let capture = Capture::new(&sensor, Pose::IDENTITY, &AT_ORIGIN, 0, 0);
    let directions: Vec<DVec3> =
        (0..240 * 320).map(|pixel| capture.pulse(pixel / 320, pixel % 320).unwrap().direction).collect();
    let rays = Rays::unlimited(Origins::Common(DVec3::ZERO), &directions);
    let is_card = |hit: &Option<Hit>| hit.is_some_and(|hit| hit.placement > 0);
    let mut cards = vec![0; directions.len()];
    let mut met = cast(&tracer, &rays);
    while met.iter().any(is_card) {
        cards.iter_mut().zip(&met).for_each(|(count, hit)| *count += i32::from(is_card(hit)));
        let next = cast(&tracer, &Rays { after: Some(&met), ..rays });
        // A beam that has met the wall stays there.
        met = met.iter().zip(next).map(|(last, next)| if is_card(last) { next } else { *last }).collect();
    }
    let (mut expected, mut passed, mut in_tree) = (0.0, 0, 0);
    for (pixel, &count) in cards.iter().enumerate().filter(|(_, count)| **count > 0) {
        expected += libm::pow(1.0 - cover, f64::from(count));
        passed += usize::from(frame.get(pixel / 320, pixel % 320).unwrap().instance == 60);
        in_tree += 1;
    }
    // Some thousand beams differ by chance, a few of which share a leaf: by less than three hundredths.
    let (expected, passed) = (expected / f64::from(in_tree), passed as f64 / f64::from(in_tree));
    assert!(in_tree > 2000 && expected > 0.1, "{in_tree} {expected}");
    assert!((passed - expected).abs() < 0.03, "{passed} of the beams pass, not {expected}");
}

/// The count of each object's pixels as if it were alone is that of a scan of the object alone.
#[test]
fn what_is_seen_alone_is_seen_through_holes() {
    let turned = |x: f64, y: f64| rotated(DVec3::Z, 0.5, DVec3::ONE, DVec3::new(x, y, 0.2));
    let meshes = vec![card(1.0, 0), wall(0.7, 2), wall(9.0, 1)];
    let instances =
        vec![at(0, turned(2.0, 0.3)), at(0, turned(3.0, -0.3)), at(1, ahead(4.0)), at(2, ahead(6.0))];
    let scene = built(meshes, instances, vec![masked(is_there), grey(0.5), pane(0.25)]);
    let sensor = camera(64, 48, range(2.1, 5.0));
    let capture = Capture::new(&sensor, Pose::IDENTITY, &AT_ORIGIN, 0, 0);
    // Two cards are one group, in which one is seen through the other.
    let group_of = |object: u32| Some(object.saturating_sub(1));
    let counted = alone(&scene, &Tracer::build(&scene), &capture, &group_of, &Progress::default()).unwrap();
    let seen_of = |group: u32| {
        let part = scene.only(|object| group_of(object) == Some(group));
        seen(&part, &Tracer::build(&part), &sensor).return_count() as u64
    };
    let expected: BTreeMap<u32, u64> =
        (0..3).map(|group| (group, seen_of(group))).filter(|(_, n)| *n > 0).collect();
    assert_eq!(counted, expected);
    assert!(counted[&0] > 100 && counted[&1] > 50 && !counted.contains_key(&2), "{counted:?}");
}
