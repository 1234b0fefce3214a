//! A pallet warehouse: racks along x, with an aisle about y = 0.

use glam::DVec3;
use serde_json::json;

use super::glb::{Document, Material, Place, SceneFile};
use super::label;
use super::mesh::{Mesh, sincos_deg, v};
use super::props::{self, Clothes, Posture};
use super::rng::Rng;
use super::room::SUNK;
use super::vehicles;

/// The width of a rack's bay from upright to upright, in metres.
const BAY: f64 = 2.75;
const BAYS: usize = 9;
const DEPTH: f64 = 1.1;
const LEVELS: [f64; 4] = [0.0, 1.75, 3.5, 5.25];

pub fn make() -> SceneFile {
    let mut doc = Document::new();
    let floor = doc.grey("polished concrete", 0.35);
    let wall = doc.grey("wall panel", 0.6);
    let roof = doc.grey("roof", 0.5);
    let blue = doc.material("rack blue", [0.03, 0.1, 0.4]);
    let orange = doc.material("rack orange", [0.6, 0.2, 0.02]);
    let wood = doc.material("pallet wood", [0.45, 0.32, 0.2]);
    let card = doc.material("cardboard", [0.42, 0.29, 0.16]);
    let tape = doc.material("tape", [0.55, 0.42, 0.25]);
    let white = doc.grey("white carton", 0.7);
    let film = doc.grey("black film", 0.06);
    let drum = doc.material("blue drum", [0.03, 0.12, 0.3]);
    let steel = doc.grey("steel", 0.4);
    let yellow = doc.material("safety yellow", [0.7, 0.5, 0.03]);
    let dark = doc.grey("rubber", 0.05);

    let (x, y, z) = (20.0, 12.0, 8.0);
    let mut mesh = Mesh::new();
    mesh.quad([v(-x, -y, 0.0), v(x, -y, 0.0), v(x, y, 0.0), v(-x, y, 0.0)], floor);
    let mesh = doc.sheet("floor", &mesh);
    let node = doc.node("floor", mesh, Place::at(0.0, 0.0, 0.0), json!({ "label": label::FLOOR }));
    doc.add(node);
    let mut mesh = Mesh::new();
    let ring = |z| [v(-x, -y, z), v(-x, y, z), v(x, y, z), v(x, -y, z)]; // clockwise, so that the walls face in
    mesh.skin(&ring(0.0), &ring(z), wall);
    mesh.quad(ring(z), roof);
    let mesh = doc.sheet("walls and roof", &mesh);
    let node = doc.node("walls and roof", mesh, Place::at(0.0, 0.0, 0.0), json!({ "label": label::WALL }));
    doc.add(node);

    let mut mesh = Mesh::new();
    mesh.cuboid(v(-0.2, -0.2, -SUNK), v(0.2, 0.2, z + SUNK), wall);
    mesh.cuboid(v(-0.24, -0.24, -2.0 * SUNK), v(0.24, 0.24, 1.0), yellow);
    let pillar = doc.solid("pillar", &mesh);
    let places: Vec<_> =
        [-18.5, -15.5, 15.5, 18.5].iter().flat_map(|&x| [-6.0, 6.0].map(|y| Place::at(x, y, 0.0))).collect();
    let node = doc.instances("pillars", pillar, &places, json!({ "label": label::POLE }));
    doc.add(node);

    let mut mesh = Mesh::new();
    for side in [-1.0, 1.0] {
        let edge = 1.375 * side;
        mesh.quad(
            [
                v(-14.0, edge - 0.05, 1.0 / 256.0),
                v(14.0, edge - 0.05, 1.0 / 256.0),
                v(14.0, edge + 0.05, 1.0 / 256.0),
                v(-14.0, edge + 0.05, 1.0 / 256.0),
            ],
            yellow,
        );
    }
    let mesh = doc.sheet("aisle lines", &mesh);
    let node = doc.node("aisle lines", mesh, Place::at(0.0, 0.0, 0.0), json!({ "label": label::MARKING }));
    doc.add(node);

    // The roof lights are long tubes under the roof.
    let mut mesh = Mesh::new();
    mesh.cuboid(v(-0.75, -0.1, 7.5), v(0.75, 0.1, 7.56), white);
    for x in [-0.5, 0.5] {
        mesh.limb(&[(v(x, 0.0, 7.55), 0.008), (v(x, 0.0, 8.005), 0.008)], 6, steel);
    }
    let light = doc.solid("light", &mesh);
    let places: Vec<_> = (0..7)
        .flat_map(|i| [-4.75, 0.0, 4.75].map(|y| Place::at(-15.0 + 5.0 * f64::from(i), y, 0.0)))
        .collect();
    let node = doc.instances("lights", light, &places, json!({ "label": label::OBJECT }));
    doc.add(node);

    // Single racks stand at the walls. The racks between them stand in pairs, back to back.
    let rows = [-11.0, -6.8125, -5.4375, -2.125, 2.125, 5.4375, 6.8125, 11.0];
    let length = BAY * BAYS as f64;
    let frame = doc.solid("upright frame", &upright_frame(blue, steel));
    let beams = doc.solid("beams", &beam_pair(orange));
    let mut frames = vec![];
    let mut levels = vec![];
    for &y in &rows {
        for i in 0..=BAYS {
            frames.push(Place::at(-length / 2.0 + BAY * i as f64, y, 0.0));
        }
        for i in 0..BAYS {
            for &z in &LEVELS[1..] {
                levels.push(Place::at(-length / 2.0 + BAY * (i as f64 + 0.5), y, z));
            }
        }
    }
    for (name, mesh, places) in [("upright frames", frame, &frames), ("beams", beams, &levels)] {
        let node = doc.instances(name, mesh, places, json!({ "label": label::RACK }));
        doc.add(node);
    }
    let mut mesh = Mesh::new();
    mesh.tube(&[(v(0.0, 0.0, -SUNK), 0.07), (v(0.0, 0.0, 0.4), 0.07)], 16, yellow);
    let guard = doc.solid("rack guard", &mesh);
    let ends = length / 2.0 + 0.22;
    let places: Vec<_> = rows
        .iter()
        .flat_map(|&y| [(-ends, y - 0.5), (-ends, y + 0.5), (ends, y - 0.5), (ends, y + 0.5)])
        .map(|(x, y)| Place::at(x, y, 0.0))
        .collect();
    let node = doc.instances("rack guards", guard, &places, json!({ "label": label::RACK }));
    doc.add(node);

    let pallet = doc.solid("pallet", &pallet_mesh(wood));
    let loads = [
        doc.solid("stacked cartons", &cartons([3, 2, 3], [0.38, 0.38, 0.3], 1, card, tape)),
        doc.solid("large cartons", &cartons([2, 2, 2], [0.56, 0.38, 0.45], 2, white, tape)),
        doc.solid("small cartons", &cartons([4, 3, 4], [0.28, 0.25, 0.22], 3, card, white)),
        doc.solid("film-wrapped load", &wrapped(film)),
        doc.solid("drums", &drums(drum, steel)),
        doc.solid("half-empty pallet", &cartons([2, 2, 1], [0.5, 0.38, 0.35], 4, white, card)),
    ];
    let mut rng = Rng::new(99);
    let mut pallets = vec![];
    let mut placed: [Vec<Place>; 6] = Default::default();
    for &y in &rows {
        for bay in 0..BAYS {
            for &z in &LEVELS {
                for side in [-0.66, 0.66] {
                    let x = -length / 2.0 + BAY * (bay as f64 + 0.5) + side + rng.range(-0.04, 0.04);
                    let kind = rng.below(8);
                    if kind >= 7 {
                        continue; // this place stays empty
                    }
                    // A pallet on the lowest level stands on the floor. Higher ones stand on the beams.
                    let base = if z == 0.0 { 0.0 } else { z + 0.0625 };
                    let place =
                        Place::at(x, y + rng.range(-0.05, 0.05), base).yaw(90.0 + rng.range(-1.5, 1.5));
                    pallets.push(place);
                    if kind < 6 {
                        let p = place.position();
                        placed[kind].push(Place::at(p.x, p.y, base + 0.144).yaw(90.0 + rng.range(-2.0, 2.0)));
                    }
                }
            }
        }
    }
    // Some pallets stand in the way at the ends of the aisle.
    for (x, y, yaw, kind) in [
        (9.5, 0.55, 12.0, 0),
        (-9.0, -0.5, -7.0, 2),
        (-16.5, 2.0, 40.0, 4),
        (16.8, -2.6, -15.0, 1),
        (16.9, 3.0, 5.0, 3),
    ] {
        pallets.push(Place::at(x, y, 0.0).yaw(yaw));
        placed[kind].push(Place::at(x, y, 0.144).yaw(yaw));
    }
    let node = doc.instances("pallets", pallet, &pallets, json!({ "label": label::PALLET }));
    doc.add(node);
    for (mesh, places) in loads.into_iter().zip(&placed) {
        let node = doc.instances("load", mesh, places, json!({ "label": label::GOODS }));
        doc.add(node);
    }

    let mesh = doc.solid("forklift", &vehicles::forklift(orange, dark, steel, 0.15));
    for (name, place) in [
        ("forklift", Place::at(6.0, -0.4, 0.0).yaw(168.0)),
        ("parked forklift", Place::at(-17.0, -8.5, 0.0).yaw(75.0)),
    ] {
        let node = doc.node(name, mesh, place, json!({ "label": label::FORKLIFT }));
        doc.add(node);
    }
    let skin = doc.material("skin", [0.5, 0.3, 0.2]);
    let vest = doc.material("high-visibility vest", [0.75, 0.6, 0.02]);
    let overall = doc.material("overall", [0.05, 0.07, 0.15]);
    let clothes = Clothes { skin, hair: yellow, top: vest, trousers: overall, shoes: dark };
    let walking = doc.solid("walking", &props::person(Posture::Walking, &clothes));
    let waving = doc.solid("waving", &props::person(Posture::Waving, &clothes));
    for (mesh, x, y, yaw) in [
        (walking, 3.5, 0.85, 190.0),
        (waving, 8.0, 0.95, 200.0),
        (walking, -6.0, 0.3, 20.0),
        (walking, 15.5, -0.5, 90.0),
    ] {
        let node = doc.node("person", mesh, Place::at(x, y, 0.0).yaw(yaw), json!({ "label": label::PERSON }));
        doc.add(node);
    }
    doc.finish(
        "warehouse.glb",
        "A pallet warehouse of 40 x 24 x 8 m; a camera at the origin looks down an aisle along +x.",
    )
}

/// An upright frame: two posts of perforated section with a lattice between them, across the rack.
fn upright_frame(blue: Material, steel: Material) -> Mesh {
    let mut mesh = Mesh::new();
    let (top, half) = (6.75, DEPTH / 2.0);
    for side in [-1.0, 1.0] {
        let y = side * (half - 0.05);
        mesh.cuboid(v(-0.05, y - 0.045, -SUNK), v(0.05, y + 0.045, top), blue);
        mesh.cuboid(v(-0.09, y - 0.08, -SUNK / 2.0), v(0.09, y + 0.08, 0.01), steel);
    }
    let reach = half - 0.08;
    let mut z = 0.3;
    let mut side = 1.0;
    while z + 0.6 < top {
        mesh.tube(&[(v(0.0, -side * reach, z), 0.016), (v(0.0, side * reach, z + 0.55), 0.016)], 8, steel);
        z += 0.6;
        side = -side;
    }
    mesh
}

/// The front and back beams of a level. Their tops are at z = 0.0625.
fn beam_pair(orange: Material) -> Mesh {
    let mut mesh = Mesh::new();
    let reach = BAY / 2.0 - 0.045;
    for side in [-1.0, 1.0] {
        let y = side * (DEPTH / 2.0 - 0.03);
        mesh.cuboid(v(-reach, y - 0.025, -0.0625), v(reach, y + 0.025, 0.0625), orange);
        for x in [-reach, reach] {
            mesh.cuboid(v(x - 0.006, y - 0.035, -0.11), v(x + 0.006, y + 0.035, 0.09), orange);
        }
    }
    mesh
}

/// A pallet of 1.2 × 0.8 × 0.144 m with its long side along x.
fn pallet_mesh(wood: Material) -> Mesh {
    let mut mesh = Mesh::new();
    for y in [-0.3275, 0.0, 0.3275] {
        mesh.cuboid(v(-0.6, y - 0.05, 0.001), v(0.6, y + 0.05, 0.022), wood);
        mesh.cuboid(v(-0.6, y - 0.0725, 0.1), v(0.6, y + 0.0725, 0.1225), wood);
        for x in [-0.5275, 0.0, 0.5275] {
            mesh.cuboid(v(x - 0.07, y - 0.049, 0.02), v(x + 0.07, y + 0.049, 0.102), wood);
        }
    }
    for i in 0..7 {
        let x = -0.548 + 1.096 * f64::from(i) / 6.0;
        mesh.cuboid(v(x - 0.05, -0.399, 0.122), v(x + 0.05, 0.399, 0.1435), wood);
    }
    mesh
}

/// A stack of cartons on a pallet. Its bottom is just above z = 0, and each carton is a little out of line.
fn cartons(count: [usize; 3], size: [f64; 3], seed: u64, card: Material, tape: Material) -> Mesh {
    let mut rng = Rng::new(seed);
    let mut mesh = Mesh::new();
    let size = DVec3::from_array(size);
    let centre = |i: usize, n: usize| i as f64 - (n as f64 - 1.0) / 2.0;
    for k in 0..count[2] {
        for j in 0..count[1] {
            for i in 0..count[0] {
                if k + 1 == count[2] && rng.below(5) == 0 {
                    continue;
                }
                let middle =
                    v(centre(i, count[0]), centre(j, count[1]), k as f64) * (size + v(0.012, 0.012, 0.003));
                let middle = middle + v(rng.range(-0.004, 0.004), rng.range(-0.004, 0.004), 0.002);
                let half = v(size.x / 2.0, size.y / 2.0, 0.0);
                mesh.cuboid(middle - half, middle + half + v(0.0, 0.0, size.z), card);
                let strip = v(half.x + 0.001, 0.03, 0.0);
                mesh.cuboid(
                    middle - strip + v(0.0, 0.0, size.z * 0.75),
                    middle + strip + v(0.0, 0.0, size.z + 0.001),
                    tape,
                );
            }
        }
    }
    mesh
}

/// A load under film, which is a box with rounded, bulging sides.
fn wrapped(film: Material) -> Mesh {
    let mut mesh = Mesh::new();
    let rings: Vec<_> = (0..=12)
        .map(|i| {
            let t = f64::from(i) / 12.0;
            let end = (2.0 * t - 1.0).abs();
            let shrink = 0.97 - 0.06 * end * end * end * end;
            (0..48)
                .map(|j| {
                    let (s, c) = sincos_deg(7.5 * f64::from(j));
                    // The outline is a superellipse of the fourth degree.
                    let r = 1.0 / (c * c * c * c + s * s * s * s).sqrt().sqrt();
                    v(0.58 * shrink * r * c, 0.39 * shrink * r * s, 0.002 + 1.15 * t)
                })
                .collect()
        })
        .collect();
    mesh.loft(&rings, |_, _| film);
    mesh
}

fn drums(drum: Material, steel: Material) -> Mesh {
    let mut mesh = Mesh::new();
    for (x, y) in [(-0.295, -0.29), (0.295, -0.29), (-0.295, 0.29), (0.295, 0.29)] {
        let profile = [
            (0.275, 0.002),
            (0.28, 0.02),
            (0.27, 0.03),
            (0.27, 0.28),
            (0.28, 0.295),
            (0.27, 0.31),
            (0.27, 0.56),
            (0.28, 0.575),
            (0.27, 0.59),
            (0.27, 0.84),
            (0.28, 0.85),
            (0.28, 0.88),
            (0.265, 0.88),
            (0.265, 0.86),
        ];
        mesh.lathe(v(x, y, 0.0), &profile, 32, drum);
        mesh.lathe(v(x + 0.15, y, 0.85), &[(0.03, 0.0), (0.03, 0.025)], 12, steel);
    }
    mesh
}
