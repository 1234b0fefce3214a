//! Holes, panes and textures: what a beam passes, and what it reports of the rest.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use beamcast::angle::Angle;
use beamcast::frame::Pose;
use beamcast::motion::{AT_ORIGIN, Link, Motion, Trajectory};
use beamcast::rng::Rng;
use beamcast::scan::{Cause, Frame, Progress, Return, alone, scan};
use beamcast::scene::{
    AlphaMode, Corners, Deformer, Image, Material, Scene, SceneBuilder, SourceInstance, SourceMesh,
    SourcePart, Texture, Wrap,
};
use beamcast::sensor::{Camera, Capture, Pattern, RangeLimits, RingOrder, Sensor};
use beamcast::source::Severity;
use beamcast::trace::methods::Method;
use beamcast::trace::{AnyTracer, BruteForce, Cast, Hit, Origins, Rays, Tracer};
use glam::{DAffine3, DVec3};
use serde_json::{Value, json};
use tempfile::TempDir;

use crate::hostile_scenes::{open, open_in_time};
use crate::shapes::{quad, seen_from, sphere};
use crate::trace::{cast, rotated, tracers};

const CELLS: usize = 8;

/// Whether a cell of the checkerboard is there.
fn is_there(column: usize, row: usize) -> bool {
    (column + row).is_multiple_of(2)
}

/// A material whose texture has a texel for each cell.
fn masked(there: impl Fn(usize, usize) -> bool) -> Material {
    let texel = |i: usize| [255, 0, 0, if there(i % CELLS, i / CELLS) { 255 } else { 0 }];
    let image = Image::new(CELLS as u32, (0..CELLS * CELLS).map(texel).collect()).unwrap();
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
    Sensor { pattern: Pattern::Camera(camera), range, ring: RingOrder::Row }
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

/// What comes back along x from panes at 1, 2, … metres, each of a material, and a wall at 9 m behind them.
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
    // What is out of the sensor's range is not reported, but it takes its share.
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

/// What is counted of each object as if it were alone is what a scan of that object alone sees.
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

// ---- Files ----

/// A PNG of a checkerboard, opaque and red where it is there.
fn png() -> Vec<u8> {
    let texel = |i: usize| [255, 0, 0, if is_there(i % CELLS, i / CELLS) { 255 } else { 0 }];
    let texels: Vec<u8> = (0..CELLS * CELLS).flat_map(texel).collect();
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, CELLS as u32, CELLS as u32);
    encoder.set_color(png::ColorType::Rgba);
    encoder.write_header().unwrap().write_image_data(&texels).unwrap();
    bytes
}

/// A file with a card one metre wide, in glTF's axes, whose texture's image is as given. Its texture coordinates are bytes.
fn file(image: Value) -> Value {
    let corners = [[0.0_f32, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
    let mut bytes: Vec<u8> = corners.iter().flatten().flat_map(|c| c.to_le_bytes()).collect();
    bytes.extend([0, 255, 0, 0, 255, 255, 0, 0, 255, 0, 0, 0, 0, 0, 0, 0]);
    bytes.extend([0, 1, 2, 0, 2, 3]);
    let image_at = bytes.len();
    bytes.extend(png());
    json!({
        "asset": { "version": "2.0" },
        "buffers": [{
            "byteLength": bytes.len(),
            "uri": format!("data:;base64,{}", STANDARD.encode(&bytes)),
        }],
        "bufferViews": [
            { "buffer": 0, "byteLength": 48 },
            { "buffer": 0, "byteOffset": 48, "byteLength": 16, "byteStride": 4 },
            { "buffer": 0, "byteOffset": 64, "byteLength": 6 },
            { "buffer": 0, "byteOffset": image_at, "byteLength": bytes.len() - image_at },
        ],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3" },
            { "bufferView": 1, "componentType": 5121, "normalized": true, "count": 4, "type": "VEC2" },
            { "bufferView": 2, "componentType": 5121, "count": 6, "type": "SCALAR" },
        ],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0, "TEXCOORD_0": 1 }, "indices": 2, "material": 0 }] }],
        "nodes": [{ "mesh": 0 }],
        "materials": [{
            "name": "leaf", "alphaMode": "MASK",
            "pbrMetallicRoughness": { "baseColorFactor": [0.5, 1, 1, 1], "baseColorTexture": { "index": 0 } },
        }],
        "textures": [{ "source": 0, "sampler": 0 }],
        "samplers": [{ "magFilter": 9728, "wrapS": 33071, "wrapT": 33648 }],
        "images": [image],
    })
}

/// A folder with a scene and other files.
struct Folder(TempDir);

impl Folder {
    fn new() -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        std::fs::create_dir(folder.path("scene")).unwrap();
        folder
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Loads a scene, with what is told of it.
    fn load(&self, json: &Value) -> (Scene, Vec<String>) {
        let path = self.path("scene/scene.gltf");
        std::fs::write(&path, json.to_string()).unwrap();
        let loaded = open_in_time(&path).unwrap();
        let warnings = loaded.notices.iter().filter(|notice| notice.severity == Severity::Warning);
        (loaded.scene.clone(), warnings.map(ToString::to_string).collect())
    }
}

/// The share of the card that is there, in cells from its upper left corner.
fn opacities(scene: &Scene) -> Vec<f32> {
    let at = |i: usize| (i as f64 + 0.5) / CELLS as f64;
    let opacity = |cell: usize| {
        // The corners of the triangles are the lower left, the lower right and the upper right one, and the first, the third and
        // the upper left one.
        let (x, y) = (at(cell % CELLS), 1.0 - at(cell / CELLS));
        if y < x { scene.opacity(0, 0, x - y, y) } else { scene.opacity(0, 1, x, y - x) }
    };
    (0..CELLS * CELLS).map(opacity).collect()
}

#[test]
fn images_are_read_wherever_they_are_kept() {
    let folder = Folder::new();
    std::fs::write(folder.path("scene/a leaf.png"), png()).unwrap();
    let data = format!("data:image/png;base64,{}", STANDARD.encode(png()));
    let expected: Vec<f32> =
        (0..CELLS * CELLS).map(|cell| f32::from(u8::from(is_there(cell % CELLS, cell / CELLS)))).collect();
    for (image, files) in [
        (json!({ "uri": "a%20leaf.png" }), 2),
        (json!({ "uri": data }), 1),
        (json!({ "bufferView": 3, "mimeType": "image/png" }), 1),
    ] {
        let (scene, warnings) = folder.load(&file(image));
        assert_eq!(warnings, [""; 0]);
        assert_eq!(opacities(&scene), expected);
        let look = scene.appearance(0, 0, 0.49, 0.01);
        assert_eq!(look.base_color[..3], [0.5, 0.0, 0.0]);
        assert!((look.reflectivity() - 0.1063).abs() < 1e-6);
        assert_eq!(scene.geometry.files.len(), files);
        if let Some(file) = scene.geometry.files.get(1) {
            assert_eq!((&file.name[..], file.bytes), ("a%20leaf.png", png().len() as u64));
        }
        let texture = scene.geometry.materials[0].base_color_texture.as_ref().unwrap();
        assert_eq!((texture.wrap, texture.is_nearest), ([Wrap::ClampToEdge, Wrap::MirroredRepeat], true));
    }
    // An image that many textures and materials name is decoded once.
    let mut json = file(json!({ "uri": "a%20leaf.png" }));
    json["textures"] = json!([{ "source": 0 }, { "source": 1 }]);
    json["images"] = json!([{ "uri": "a%20leaf.png" }, { "uri": "a%20leaf.png" }]);
    json["materials"][0]["pbrMetallicRoughness"]["metallicRoughnessTexture"] = json!({ "index": 1 });
    let (scene, _) = folder.load(&json);
    let images: Vec<_> = scene.geometry.materials[0].textures().map(|texture| &texture.image).collect();
    assert!(images.len() == 2 && Arc::ptr_eq(images[0], images[1]));
    assert_eq!(scene.geometry.files.len(), 2);
}

#[test]
fn what_surfaces_look_like_is_read() {
    let folder = Folder::new();
    let mut json = file(json!({ "bufferView": 3 }));
    json["materials"] = json!([{
        "alphaMode": "BLEND",
        "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.5, 0.5, 0.5], "metallicFactor": 0.25, "roughnessFactor": 0.75 },
        "extensions": {
            "KHR_materials_transmission": { "transmissionFactor": 0.5 },
            "KHR_materials_clearcoat": { "clearcoatFactor": 0.125 },
            "KHR_materials_ior": { "ior": 1.25 },
            "KHR_materials_specular": { "specularFactor": 0.5, "specularColorFactor": [0.5, 0.5, 0.5] },
        },
    }]);
    let (scene, warnings) = folder.load(&json);
    assert_eq!(warnings, [""; 0]);
    let look = scene.appearance(0, 0, 0.25, 0.5);
    assert_eq!(look.base_color, [0.5; 4]);
    assert_eq!((look.metallic, look.roughness, look.transmission), (0.25, 0.75, 0.5));
    assert_eq!((look.clearcoat, look.ior, look.opacity), (0.125, 1.25, 0.25));
    assert!((look.specular - 0.25).abs() < 1e-6);
    assert!(scene.geometry.meshes[0].corners.is_empty(), "nothing needs texture coordinates");
    assert!(!scene.varies(0, 0) && scene.is_see_through());

    // Vertex colours, which are linear, multiply the factor.
    let mut colors: Vec<u8> = [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [255; 4]].concat();
    let uri = json["buffers"][0]["uri"].as_str().unwrap().split_once(',').unwrap().1;
    let mut bytes = STANDARD.decode(uri).unwrap();
    let offset = bytes.len();
    bytes.append(&mut colors);
    json["buffers"][0] = json!({
        "byteLength": bytes.len(), "uri": format!("data:;base64,{}", STANDARD.encode(&bytes)) });
    json["bufferViews"]
        .as_array_mut()
        .unwrap()
        .push(json!({ "buffer": 0, "byteOffset": offset, "byteLength": 16 }));
    json["accessors"].as_array_mut().unwrap().push(
        json!({ "bufferView": 4, "componentType": 5121, "normalized": true, "count": 4, "type": "VEC4" }),
    );
    json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] = json!(3);
    let (scene, _) = folder.load(&json);
    let look = scene.appearance(0, 0, 0.25, 0.5);
    assert!(
        look.base_color.iter().zip([0.125, 0.125, 0.25, 0.5]).all(|(a, b)| (a - b).abs() < 1e-6),
        "{look:?}"
    );
    assert!(scene.varies(0, 0));
}

/// The transform of a texture moves the holes: half the image to the left is as many cells.
#[test]
fn transforms_move_holes() {
    let folder = Folder::new();
    let mut json = file(json!({ "bufferView": 3 }));
    let texture = &mut json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"];
    texture["extensions"] = json!({ "KHR_texture_transform": { "offset": [0.125, 0], "scale": [0.5, 0.5] } });
    json["extensionsUsed"] = json!(["KHR_texture_transform"]);
    let (scene, warnings) = folder.load(&json);
    assert_eq!(warnings, [""; 0]);
    let expected: Vec<f32> = (0..CELLS * CELLS)
        .map(|cell| f32::from(u8::from(is_there((cell % CELLS) / 2 + 1, cell / CELLS / 2))))
        .collect();
    assert_eq!(opacities(&scene), expected);
}

#[test]
fn broken_images_are_warned_of_and_count_as_white() {
    let folder = Folder::new();
    std::fs::write(folder.path("secret.png"), png()).unwrap();
    std::fs::write(folder.path("scene/short.png"), &png()[..60]).unwrap();
    std::fs::write(folder.path("scene/text.png"), "no image").unwrap();
    std::fs::write(folder.path("scene/empty.png"), "").unwrap();
    let mut giant = png();
    giant[16..24].copy_from_slice(&[0, 1, 0x86, 0xa0, 0, 1, 0x86, 0xa0]);
    // The checksum of the header, whose bytes say 100 000 twice.
    let crc = crc(&giant[12..29]);
    giant[29..33].copy_from_slice(&crc.to_be_bytes());
    std::fs::write(folder.path("scene/giant.png"), giant).unwrap();
    for (image, told) in [
        (json!({ "uri": "short.png" }), "the PNG is broken"),
        (json!({ "uri": "text.png" }), "its content is no PNG, no JPEG and no WebP"),
        (json!({ "uri": "empty.png" }), "its content is no PNG, no JPEG and no WebP"),
        (json!({ "uri": "giant.png" }), "the file's images would take"),
        (json!({ "uri": "gone.png" }), "gone.png"),
        (json!({ "uri": "../secret.png" }), "leaves the scene's folder"),
        (json!({ "uri": "/etc/passwd" }), "is not a relative path"),
        (json!({ "uri": "http://a/b.png" }), "is not a relative path"),
        (json!({ "uri": "." }), "the image can't be read"),
        (json!({ "uri": "data:image/png;base64,!" }), "base64"),
        (json!({ "bufferView": 99 }), "it does not exist"),
        (json!({}), "neither a uri nor a bufferView"),
        (json!({ "bufferView": 3, "mimeType": "image/jpeg" }), "its mimeType is not that of its content"),
    ] {
        let (scene, warnings) = folder.load(&file(image.clone()));
        assert!(warnings.len() == 1 && warnings[0].contains(told), "{image}: {warnings:?}");
        assert!(warnings[0].starts_with("image 0"), "{warnings:?}");
        if image.get("mimeType").is_none() {
            assert_eq!(scene.appearance(0, 0, 0.25, 0.5).base_color, [0.5, 1.0, 1.0, 1.0], "{image}");
            assert_eq!(
                scene.geometry.files.len(),
                1 + usize::from(
                    told.contains("content") || told.contains("PNG") || told.contains("would take")
                )
            );
        }
    }
    // Textures, samplers, coordinates and colours that do not exist keep no geometry from being read either.
    for (key, value) in [
        ("/textures/0/source", json!(9)),
        ("/textures/0/sampler", json!(9)),
        ("/textures", json!("none")),
        ("/images", json!(7)),
        ("/samplers", json!([7])),
        ("/materials/0/pbrMetallicRoughness/baseColorTexture", json!({ "index": -1 })),
        ("/materials/0/pbrMetallicRoughness/baseColorTexture/texCoord", json!(3)),
        ("/meshes/0/primitives/0/attributes/TEXCOORD_0", json!(0)),
        ("/meshes/0/primitives/0/attributes/TEXCOORD_0", json!(77)),
        ("/accessors/1/count", json!(1e9 as u64)),
        ("/accessors/1/normalized", json!(false)),
    ] {
        let mut json = file(json!({ "bufferView": 3 }));
        match json.pointer_mut(key) {
            Some(place) => *place = value,
            None => json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["texCoord"] = value,
        }
        let (scene, warnings) = folder.load(&json);
        assert_eq!(scene.triangle_count(), 2, "{key}");
        assert!(!warnings.is_empty() || key.ends_with("sampler"), "{key}");
    }
}

/// The checksum of a PNG's chunk, bit by bit.
fn crc(bytes: &[u8]) -> u32 {
    let mut crc = u32::MAX;
    for byte in bytes {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 };
        }
    }
    !crc
}

/// The files of others that are about alpha and textures, if BEAMCAST_CORPUS names their folder.
#[test]
fn textures_of_others_are_read() {
    let Some(corpus) = std::env::var_os("BEAMCAST_CORPUS").map(PathBuf::from) else { return };
    for (name, textures) in [
        ("SampleAssets/Models/TextureTransformTest/glTF/TextureTransformTest.gltf", 9),
        ("SampleAssets/Models/MultiUVTest/glTF-Binary/MultiUVTest.glb", 1),
        ("trimesh/models/AlphaBlendModeTest.glb", 5),
    ] {
        let loaded = open(&corpus.join("valid").join(name)).unwrap();
        let warned: Vec<_> = loaded.notices.iter().filter(|n| n.severity == Severity::Warning).collect();
        assert!(warned.is_empty(), "{name}: {warned:?}");
        let materials = &loaded.scene.geometry.materials;
        let found = materials.iter().filter(|material| material.base_color_texture.is_some()).count();
        assert!(
            found >= textures.min(1)
                && !loaded.scene.geometry.meshes.iter().all(|mesh| mesh.corners.is_empty()),
            "{name}: {found}"
        );
    }
}
