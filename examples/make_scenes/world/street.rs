//! A street block: a road along x with a crossing, houses, a park, cars, trees and people.
//!
//! The right-hand lane is centred on y = 0, so that a car can stand at the origin looking along +x.

use serde_json::json;

use super::buildings::{Bays, Fabric, House};
use super::glb::{Document, MeshId, Place, QuarterTurned, SceneFile};
use super::label;
use super::mesh::{Mesh, circle, sincos_deg, v};
use super::props::{self, Clothes, Posture};
use super::rng::Rng;
use super::trees::{self, Species};
use super::vehicles::{self, CarPaint, HATCHBACK, SALOON, VAN};

/// The half extents of the ground, in metres.
const HALF: (f64, f64) = (64.0, 32.0);
/// The y of the carriageway's edges.
const KERB: (f64, f64) = (-4.0, 7.5);
/// The x of the crossing road's edges.
const CROSS: (f64, f64) = (26.0, 34.0);
/// The width of the pavements in metres. `STEP` is their height.
const PAVEMENT: f64 = 4.0;
const STEP: f64 = 0.125;
/// The gap between neighbouring houses, so that their walls do not coincide.
const JOINT: f64 = 1.0 / 64.0;
/// The extents of the park in x and in y.
const PARK: ((f64, f64), (f64, f64)) = ((-28.0, 4.0), (11.5, 32.0));

pub fn make() -> SceneFile {
    let mut doc = Document::new();
    ground(&mut doc);
    markings(&mut doc);
    houses(&mut doc);
    park(&mut doc);
    street_trees(&mut doc);
    cars(&mut doc);
    people(&mut doc);
    furniture(&mut doc);
    doc.finish("street.glb", "A street block of 128 x 64 m, seen from a car's roof at the origin.")
}

fn ground(doc: &mut Document) {
    let asphalt = doc.grey("asphalt", 0.12);
    let (x, y) = HALF;
    let mut mesh = Mesh::new();
    mesh.quad([v(-x, -y, 0.0), v(x, -y, 0.0), v(x, y, 0.0), v(-x, y, 0.0)], asphalt);
    let mesh = doc.sheet("road", &mesh);
    let node = doc.node("road", mesh, Place::at(0.0, 0.0, 0.0), json!({ "label": label::ROAD }));
    doc.add(node);

    let kerb = doc.grey("granite kerb", 0.4);
    let paving = doc.grey("paving", 0.28);
    let yard = doc.material("yard grass", [0.1, 0.2, 0.05]);
    // The inner corner of a block lies at the crossing, and `outward` points from it to the corner of the world.
    for (name, corner, outward) in [
        ("south west", v(CROSS.0, KERB.0, 0.0), v(-1.0, -1.0, 0.0)),
        ("south east", v(CROSS.1, KERB.0, 0.0), v(1.0, -1.0, 0.0)),
        ("north west", v(CROSS.0, KERB.1, 0.0), v(-1.0, 1.0, 0.0)),
        ("north east", v(CROSS.1, KERB.1, 0.0), v(1.0, 1.0, 0.0)),
    ] {
        let far = v(outward.x * x, outward.y * y, 0.0);
        let outline = |inset: f64, z: f64| {
            // The outline goes from the far end of one road edge round the corner to the far end of the other.
            let radius = 5.0 - inset;
            let mut points = vec![v(far.x, corner.y + outward.y * inset, z)];
            points.extend((0..=8).map(|i| {
                let (s, c) = sincos_deg(90.0 * f64::from(i) / 8.0);
                v(corner.x + outward.x * (5.0 - radius * s), corner.y + outward.y * (5.0 - radius * c), z)
            }));
            points.push(v(corner.x + outward.x * inset, far.y, z));
            // The outline must be counter-clockwise seen from above, for each of the corners.
            if outward.x * outward.y > 0.0 {
                points.reverse();
            }
            points
        };
        let (front, bevel, stone, inner) = (
            outline(0.0, 0.0),
            outline(0.0, STEP - 0.015625),
            outline(0.015625, STEP),
            outline(0.1875, STEP),
        );
        let mut houses = outline(PAVEMENT, STEP);
        let mut mesh = Mesh::new();
        for (a, b, material) in [
            (&front, &bevel, kerb),
            (&bevel, &stone, kerb),
            (&stone, &inner, kerb),
            (&inner, &houses, paving),
        ] {
            mesh.strip(a, b, material);
        }
        let mesh = doc.sheet("pavement", &mesh);
        let node = doc.node(
            &format!("pavement {name}"),
            mesh,
            Place::at(0.0, 0.0, 0.0),
            json!({ "label": label::SIDEWALK }),
        );
        doc.add(node);
        houses.push(v(far.x, far.y, STEP));
        let mut mesh = Mesh::new();
        for i in 1..houses.len() - 1 {
            mesh.triangle([houses[0], houses[i], houses[i + 1]], yard);
        }
        let mesh = doc.sheet("yard", &mesh);
        let node = doc.node(
            &format!("yard {name}"),
            mesh,
            Place::at(0.0, 0.0, 0.0),
            json!({ "label": label::TERRAIN }),
        );
        doc.add(node);
    }
}

/// Road markings, which are 4 mm thick.
fn markings(doc: &mut Document) {
    let white = doc.grey("road paint", 0.7);
    let mut mesh = Mesh::new();
    let mut paint = |x: (f64, f64), y: (f64, f64)| {
        let z = 1.0 / 256.0;
        mesh.quad([v(x.0, y.0, z), v(x.1, y.0, z), v(x.1, y.1, z), v(x.0, y.1, z)], white);
    };
    let (lane, parking) = ((-1.75, 5.25), 0.0625);
    for i in 0..21 {
        let x = -62.5 + 6.0 * f64::from(i);
        if x + 3.0 < CROSS.0 - 6.0 || x > CROSS.1 + 1.0 {
            paint((x, x + 3.0), (1.75 - 0.0625, 1.75 + 0.0625)); // the middle of the road
        }
    }
    for (from, to) in [(-64.0, 15.0), (44.0, 64.0)] {
        paint((from, to), (lane.0 - parking, lane.0 + parking));
        paint((from, to), (lane.1 - parking, lane.1 + parking));
    }
    for i in 0..11 {
        let y = KERB.0 + 0.375 + 1.0 * f64::from(i);
        paint((20.25, 23.25), (y, y + 0.5)); // zebra crossing
    }
    paint((19.0, 19.4375), (lane.0 + 0.2, 1.6)); // stop line
    paint((40.0, 40.4375), (1.9, lane.1 - 0.2));
    for (from, to) in [(-32.0, KERB.0 - 1.0), (KERB.1 + 1.0, 32.0)] {
        let mut y = from;
        while y + 2.0 <= to {
            paint((29.9375, 30.0625), (y, y + 2.0));
            y += 4.0;
        }
    }
    let mesh = doc.sheet("markings", &mesh);
    let node = doc.node("markings", mesh, Place::at(0.0, 0.0, 0.0), json!({ "label": label::MARKING }));
    doc.add(node);

    let iron = doc.grey("cast iron", 0.08);
    let mut mesh = Mesh::new();
    let rim = |z: f64| circle(v(0.0, 0.0, z), 0.3, 32);
    mesh.prism(&rim(-1.0 / 64.0), &rim(1.0 / 128.0), iron);
    let mesh = doc.solid("manhole cover", &mesh);
    let places = [(9.0, 0.75), (-21.0, 3.0), (31.5, -11.0), (-47.0, 0.4), (55.0, 3.5)]
        .map(|(x, y)| Place::at(x, y, 0.0));
    let node = doc.instances("manhole covers", mesh, &places, json!({ "label": label::ROAD }));
    doc.add(node);
}

fn houses(doc: &mut Document) {
    let fabric = Fabric::new(doc);
    let brick = doc.material("brick", [0.36, 0.13, 0.08]);
    let render = doc.material("cream render", [0.66, 0.58, 0.42]);
    let grey = doc.material("grey render", [0.4, 0.41, 0.42]);
    let ochre = doc.material("ochre render", [0.55, 0.36, 0.13]);
    let first = Bays::new(doc, brick, &fabric);
    let colours =
        [first, first.repainted(doc, render), first.repainted(doc, grey), first.repainted(doc, ochre)];

    // The south side faces +y, so a house begins at its eastern end. (east end x, bays, floors, colour, pitched, shops)
    let south = KERB.0 - PAVEMENT;
    let front = [true, false, false, false];
    for (name, x, width, floors, colour, pitched, shops, bayed) in [
        ("house 1", 22.0, 6, 4, 0, false, true, [true, false, false, true]),
        ("house 2", 4.0 - JOINT, 5, 3, 1, true, false, front),
        ("house 3", -11.0 - 2.0 * JOINT, 6, 4, 2, false, true, front),
        ("house 4", -31.0, 6, 3, 3, true, false, front),
        ("house 5", -49.0 - JOINT, 4, 4, 1, false, false, front),
        ("house 6", 62.0, 8, 3, 1, false, false, [true, true, false, false]),
    ] {
        let frame = QuarterTurned { at: v(x, south, STEP), quarters: 2 };
        House { name, frame, width, depth: 4, floors, bayed, pitched, shops }.build(
            doc,
            &colours[colour],
            &fabric,
        );
    }
    let north = KERB.1 + PAVEMENT;
    for (name, x, width, floors, colour, pitched, shops, bayed) in [
        ("house 7", -61.0 - JOINT, 5, 3, 2, true, false, front),
        ("house 8", -46.0, 6, 4, 3, false, true, [true, true, false, false]),
        ("house 9", 4.0, 6, 3, 0, false, true, [true, true, false, true]),
        ("house 10", 38.0, 8, 3, 2, true, true, [true, false, false, true]),
    ] {
        let frame = QuarterTurned { at: v(x, north, STEP), quarters: 0 };
        House { name, frame, width, depth: 4, floors, bayed, pitched, shops }.build(
            doc,
            &colours[colour],
            &fabric,
        );
    }
}

/// The height of the park's lawn above the pavement. It is 0 at the rim.
fn lawn(x: f64, y: f64) -> f64 {
    let ((x0, x1), (y0, y1)) = PARK;
    let (s, t) = ((x - x0) / (x1 - x0), (y - y0) / (y1 - y0));
    let rim = 16.0 * s * (1.0 - s) * t * (1.0 - t);
    let (wave, _) = libm::sincos(x * 0.55);
    let (_, other) = libm::sincos(y * 0.7 + x * 0.2);
    rim * (0.55 + 0.14 * wave + 0.12 * other)
}

fn park(doc: &mut Document) {
    let grass = doc.material("lawn", [0.09, 0.22, 0.04]);
    let ((x0, x1), (y0, y1)) = PARK;
    let (columns, rows) = (64, 41);
    let mut mesh = Mesh::new();
    let point = |i: usize, j: usize| {
        let (x, y) = (x0 + (x1 - x0) * i as f64 / columns as f64, y0 + (y1 - y0) * j as f64 / rows as f64);
        v(x, y, STEP + lawn(x, y))
    };
    for j in 0..rows {
        for i in 0..columns {
            mesh.quad([point(i, j), point(i + 1, j), point(i + 1, j + 1), point(i, j + 1)], grass);
        }
    }
    let mesh = doc.sheet("lawn", &mesh);
    let node = doc.node("park", mesh, Place::at(0.0, 0.0, 0.0), json!({ "label": label::TERRAIN }));
    doc.add(node);

    let mut rng = Rng::new(11);
    let blade = doc.material("grass", [0.12, 0.3, 0.05]);
    let tuft = doc.sheet("tuft", &trees::grass(0.6, 1000, 5, blade));
    let places: Vec<_> = (0..44)
        .map(|_| {
            let (x, y) = (rng.range(x0 + 1.5, x1 - 1.5), rng.range(y0 + 1.2, y0 + 14.0));
            Place::at(x, y, STEP + lawn(x, y)).yaw(rng.range(0.0, 360.0))
        })
        .collect();
    let node = doc.instances("tufts", tuft, &places, json!({ "label": label::VEGETATION }));
    doc.add(node);

    let leaf = doc.material("hedge leaf", [0.04, 0.16, 0.03]);
    let hedge = doc.sheet("hedge", &trees::hedge(v(1.5, 0.4, 0.5), 2600, 6, leaf));
    let places: Vec<_> = (0..10)
        .map(|i| Place::at(x0 + 2.5 + 3.0 * f64::from(i), y0 + 0.6, STEP))
        .filter(|p| (p.position().x + 12.5).abs() > 1.6) // this leaves the way in free
        .collect();
    let node = doc.instances("hedges", hedge, &places, json!({ "label": label::VEGETATION }));
    doc.add(node);

    let bush = doc.sheet("bush", &trees::bush(0.9, 1600, 7, leaf));
    let mut places: Vec<_> = (0..9)
        .map(|_| {
            let (x, y) = (rng.range(x0 + 2.0, x1 - 2.0), rng.range(y0 + 6.0, y1 - 2.0));
            let size = rng.range(0.7, 1.3);
            Place::at(x, y, STEP + lawn(x, y)).yaw(rng.range(0.0, 360.0)).scaled(size, size, size)
        })
        .collect();
    for i in 0..6 {
        // The planters along the southern houses hold small bushes.
        let p = planter_place(i).position();
        places.push(Place::at(p.x, p.y, p.z + 0.4).yaw(60.0 * i as f64).scaled(0.5, 0.5, 0.6));
    }
    let node = doc.instances("bushes", bush, &places, json!({ "label": label::VEGETATION }));
    doc.add(node);
}

fn planter_place(i: usize) -> Place {
    Place::at([-38.0, -26.0, -14.5, -3.5, 8.5, 17.0][i], KERB.0 - PAVEMENT + 0.8, STEP)
}

fn street_trees(doc: &mut Document) {
    let bark = doc.material("bark", [0.12, 0.09, 0.06]);
    let lime = doc.material("lime leaf", [0.1, 0.26, 0.05]);
    let plane = doc.material("plane leaf", [0.16, 0.28, 0.06]);
    let pine = doc.material("yew needle", [0.03, 0.12, 0.04]);
    let kinds = [
        (
            "lime tree",
            lime,
            Species {
                clear_height: 2.4,
                height: 7.5,
                profile: trees::round_crown,
                crown_radius: 2.3,
                trunk_radius: 0.16,
                branches: 22,
                leaves: 6600,
                leaf_length: 0.17,
                rise: 0.55,
            },
        ),
        (
            "plane tree",
            plane,
            Species {
                clear_height: 3.0,
                height: 11.0,
                profile: trees::round_crown,
                crown_radius: 3.6,
                trunk_radius: 0.26,
                branches: 28,
                leaves: 7400,
                leaf_length: 0.24,
                rise: 0.45,
            },
        ),
        (
            "yew tree",
            pine,
            Species {
                clear_height: 0.6,
                height: 8.0,
                profile: trees::conical_crown,
                crown_radius: 2.2,
                trunk_radius: 0.18,
                branches: 34,
                leaves: 6400,
                leaf_length: 0.16,
                rise: -0.12,
            },
        ),
        (
            "hornbeam",
            lime,
            Species {
                clear_height: 1.8,
                height: 8.5,
                profile: trees::upright_crown,
                crown_radius: 1.3,
                trunk_radius: 0.13,
                branches: 26,
                leaves: 6000,
                leaf_length: 0.15,
                rise: 1.1,
            },
        ),
    ];
    let mut rng = Rng::new(3);
    let mut places: [Vec<Place>; 4] = Default::default();
    let mut plant = |kind: usize, x: f64, y: f64, z: f64| {
        let size = rng.range(0.85, 1.12);
        places[kind].push(Place::at(x, y, z).yaw(rng.range(0.0, 360.0)).scaled(size, size, size));
    };
    for (i, x) in [-59.0, -50.0, -41.0, -22.0, -13.0, 12.0].into_iter().enumerate() {
        plant([0, 3][i % 2], x, KERB.0 - 0.9, STEP);
    }
    for (i, x) in [-55.0, -46.0, -37.0, -9.0, 8.5, 17.5, 44.0, 53.0].into_iter().enumerate() {
        plant([0, 0, 3][i % 3], x, KERB.1 + 0.9, STEP);
    }
    for x in [42.0, 51.0, 60.0] {
        plant(0, x, KERB.0 - 0.9, STEP);
    }
    for (x, y, kind) in [
        (-24.0, 17.0, 1),
        (-16.5, 22.0, 1),
        (-6.0, 18.5, 1),
        (0.0, 24.5, 1),
        (-20.5, 27.5, 2),
        (-11.0, 26.5, 1),
        (-3.5, 28.0, 2),
        (-26.0, 25.0, 2),
        (1.5, 15.5, 2),
    ] {
        plant(kind, x, y, STEP + lawn(x, y));
    }
    for (x, y, kind) in [
        (36.5, -26.0, 3),
        (23.5, -26.0, 3),
        (36.5, 27.5, 3),
        (23.5, 27.5, 3),
        (10.0, -25.5, 1),
        (-20.0, -25.5, 1),
        (50.0, -25.5, 1),
        (50.0, 27.0, 1),
        (-50.0, 27.0, 1),
        (14.0, 27.0, 1),
    ] {
        plant(kind, x, y, STEP);
    }
    for (((name, leaf, species), places), seed) in kinds.iter().zip(&places).zip(20..) {
        let (wood, leaves) = trees::tree(species, seed, bark, *leaf);
        let wood = doc.solid(&format!("{name}, wood"), &wood);
        let leaves = doc.sheet(&format!("{name}, leaves"), &leaves);
        for (part, mesh) in [("wood", wood), ("leaves", leaves)] {
            let node = doc.instances(
                &format!("{name}s, {part}"),
                mesh,
                places,
                json!({ "label": label::VEGETATION }),
            );
            doc.add(node);
        }
    }
}

fn cars(doc: &mut Document) {
    let body = doc.material("red paint", [0.45, 0.03, 0.03]);
    let mut paint = CarPaint::with_body(doc, body);
    let (red, silver, blue, white, black) = (
        paint.body,
        doc.grey("silver paint", 0.5),
        doc.material("blue paint", [0.03, 0.08, 0.35]),
        doc.grey("white paint", 0.75),
        doc.grey("black paint", 0.03),
    );
    let small = doc.solid("hatchback, red", &vehicles::car(&HATCHBACK, &paint));
    let small_white = doc.repainted("hatchback, white", small, red, white);
    let small_blue = doc.repainted("hatchback, blue", small, red, blue);
    paint.body = silver;
    let large = doc.solid("saloon, silver", &vehicles::car(&SALOON, &paint));
    let large_black = doc.repainted("saloon, black", large, silver, black);
    paint.body = white;
    let van = doc.solid("van, white", &vehicles::car(&VAN, &paint));
    let van_blue = doc.repainted("van, blue", van, white, blue);

    let (right, left) = (-2.875, 6.375);
    let parked: &[(MeshId, f64, f64, f64)] = &[
        (small, -57.0, right, 0.0),
        (large, -51.2, right, 1.0),
        (small_blue, -45.6, right, 0.0),
        (van, -34.0, right, -1.0),
        (small_white, -28.0, right, 0.5),
        (large_black, -17.8, right, 0.0),
        (small, -12.0, right, -0.5),
        (small_blue, -6.4, right, 0.0),
        (large, 6.2, right, 1.0),
        (small_white, 11.5, right, -1.0),
        (large_black, 48.5, right, 0.0),
        (small, 54.5, right, 0.0),
        (large_black, -60.0, left, 180.0),
        (small_white, -53.8, left, 181.0),
        (small, -40.0, left, 180.0),
        (large, -33.5, left, 179.0),
        (small_blue, -21.0, left, 180.0),
        (van_blue, -14.5, left, 180.0),
        (large, -2.8, left, 181.0),
        (small_white, 3.6, left, 180.0),
        (small, 9.4, left, 179.0),
        (large_black, 47.0, left, 180.0),
        (small_blue, 57.5, left, 180.0),
    ];
    let driving: &[(MeshId, f64, f64, f64)] = &[
        (large_black, 14.5, 0.0, 0.0),
        (small_blue, -14.0, 0.1, 0.0),
        (large, -24.5, 3.5, 180.0),
        (small, 43.5, 3.5, 180.0),
        (van, 54.0, 3.4, 180.0),
        (small_white, -40.0, -0.1, 0.0),
        (small_white, 28.0, 14.0, -90.0),
        (large, 32.0, -14.5, 90.0),
        (van_blue, 31.9, 25.0, 90.0),
        (large_black, 56.0, -0.05, 0.0),
    ];
    for (name, list) in [("parked car", parked), ("driving car", driving)] {
        for &(mesh, x, y, yaw) in list {
            let node = doc.node(name, mesh, Place::at(x, y, 0.0).yaw(yaw), json!({ "label": label::CAR }));
            doc.add(node);
        }
    }
}

fn people(doc: &mut Document) {
    let skin = doc.material("skin", [0.5, 0.3, 0.2]);
    let hair = doc.material("hair", [0.06, 0.04, 0.03]);
    let shoes = doc.grey("shoes", 0.05);
    let denim = doc.material("denim", [0.06, 0.09, 0.2]);
    let coat = doc.material("yellow coat", [0.6, 0.45, 0.05]);
    let jumper = doc.material("green jumper", [0.06, 0.25, 0.12]);
    let shirt = doc.grey("white shirt", 0.7);
    let clothes = |top, trousers| Clothes { skin, hair, top, trousers, shoes };
    let standing = doc.solid("standing", &props::person(Posture::Standing, &clothes(jumper, denim)));
    let walking = doc.solid("walking", &props::person(Posture::Walking, &clothes(coat, denim)));
    let waving = doc.solid("waving", &props::person(Posture::Waving, &clothes(shirt, shoes)));
    let walking_plain = doc.repainted("walking, white shirt", walking, coat, shirt);
    let standing_coat = doc.repainted("standing, yellow coat", standing, jumper, coat);
    for (mesh, x, y, z, yaw, size) in [
        (walking, 5.5, -5.6, STEP, 175.0, 1.0),
        (walking_plain, 7.2, -6.6, STEP, 0.0, 1.03),
        (standing, 3.0, -7.2, STEP, 60.0, 0.97),
        (standing_coat, 3.5, -6.3, STEP, -110.0, 1.0),
        (walking, 21.5, 1.2, 0.0, 90.0, 1.0),
        (walking_plain, 22.2, 4.6, 0.0, -90.0, 0.95),
        (walking, 21.8, 2.0, 0.0, 90.0, 0.65),
        (waving, -4.0, 9.2, STEP, -120.0, 1.0),
        (walking, 1.0, 10.4, STEP, 5.0, 1.02),
        (walking_plain, -18.0, 9.8, STEP, 180.0, 1.0),
        (standing, -10.5, 16.0, STEP + lawn(-10.5, 16.0), 30.0, 1.0),
        (walking, -14.5, 14.5, STEP + lawn(-14.5, 14.5), 20.0, 0.7),
        (standing, -30.5, -5.3, STEP, 90.0, 1.0),
        (walking_plain, -36.0, -6.4, STEP, 0.0, 1.0),
        (walking, -45.0, 9.6, STEP, 0.0, 0.98),
        (standing_coat, 24.5, 9.5, STEP, -60.0, 1.0),
        (waving, 36.0, -6.2, STEP, 160.0, 1.0),
        (walking, 41.0, -6.0, STEP, 180.0, 1.0),
        (walking_plain, 46.5, 9.9, STEP, 180.0, 1.0),
        (standing, 60.0, -5.8, STEP, 100.0, 1.0),
    ] {
        let place = Place::at(x, y, z).yaw(yaw).scaled(size, size, size);
        let node = doc.node("person", mesh, place, json!({ "label": label::PERSON }));
        doc.add(node);
    }
}

fn furniture(doc: &mut Document) {
    let steel = doc.material("painted steel", [0.1, 0.12, 0.11]);
    let zinc = doc.grey("zinc", 0.35);
    let lens = doc.grey("lamp glass", 0.6);
    let dark = doc.grey("dark plastic", 0.05);
    let wood = doc.material("bench wood", [0.3, 0.18, 0.08]);
    let stone = doc.grey("cast stone", 0.45);
    let glass = doc.material("shelter glass", [0.08, 0.1, 0.1]);
    let poster = doc.material("poster", [0.5, 0.2, 0.3]);
    let red = doc.material("sign red", [0.6, 0.02, 0.03]);
    let blue = doc.material("sign blue", [0.02, 0.08, 0.45]);
    let yellow = doc.material("sign yellow", [0.75, 0.55, 0.02]);
    let green = doc.material("signal green", [0.02, 0.4, 0.1]);
    let amber = doc.material("signal amber", [0.6, 0.3, 0.02]);

    let lamp = doc.solid("lamp", &props::lamp(steel, lens));
    let mut places: Vec<_> =
        [-54.0, -27.0, 1.5, 46.5].map(|x| Place::at(x, KERB.0 - 0.5, STEP).yaw(90.0)).to_vec();
    places.extend([-41.5, -5.5, 20.0, 58.0].map(|x| Place::at(x, KERB.1 + 0.5, STEP).yaw(-90.0)));
    places.extend([
        Place::at(CROSS.1 + 0.5, -20.0, STEP).yaw(180.0),
        Place::at(CROSS.0 - 0.5, 20.0, STEP),
        Place::at(-8.0, 25.0, STEP + lawn(-8.0, 25.0)).scaled(0.6, 0.6, 0.6),
    ]);
    let node = doc.instances("street lamps", lamp, &places, json!({ "label": label::POLE }));
    doc.add(node);

    let signs = [
        (
            "stop sign",
            props::polygon(0.4, 8, 22.5),
            red,
            vec![
                Place::at(CROSS.1 + 0.6, 8.6, STEP).yaw(45.0),
                Place::at(CROSS.0 - 0.6, -5.2, STEP).yaw(-90.0),
            ],
        ),
        (
            "warning sign",
            props::polygon(0.5, 3, 90.0),
            yellow,
            vec![
                Place::at(9.2, KERB.0 - 0.45, STEP).yaw(180.0),
                Place::at(-33.0, KERB.0 - 0.45, STEP).yaw(180.0),
                Place::at(52.0, KERB.1 + 0.45, STEP),
            ],
        ),
        (
            "speed limit",
            props::polygon(0.32, 32, 0.0),
            red,
            vec![
                Place::at(-3.8, KERB.0 - 0.45, STEP).yaw(180.0),
                Place::at(39.0, KERB.0 - 0.45, STEP).yaw(180.0),
                Place::at(14.0, KERB.1 + 0.45, STEP),
            ],
        ),
        (
            "parking sign",
            props::rectangle(0.55, 0.55),
            blue,
            vec![
                Place::at(-24.0, KERB.1 + 0.45, STEP),
                Place::at(-47.0, KERB.0 - 0.45, STEP).yaw(180.0),
                Place::at(6.0, KERB.1 + 0.45, STEP),
            ],
        ),
        (
            "direction sign",
            props::rectangle(1.3, 0.4),
            blue,
            vec![Place::at(19.2, KERB.0 - 0.6, STEP).yaw(180.0), Place::at(40.5, KERB.1 + 0.6, STEP)],
        ),
    ];
    for (name, outline, face, places) in signs {
        let height = if outline.len() == 4 { 2.6 } else { 2.3 };
        let mesh = doc.solid(name, &props::sign(&outline, height, face, zinc));
        let node = doc.instances(&format!("{name}s"), mesh, &places, json!({ "label": label::SIGN }));
        doc.add(node);
    }

    let signal = doc.solid("traffic light", &props::traffic_light(steel, dark, [red, amber, green]));
    let places = [
        Place::at(18.7, KERB.0 - 0.6, STEP).yaw(180.0),
        Place::at(41.0, KERB.1 + 0.6, STEP),
        Place::at(CROSS.1 + 0.7, -11.0, STEP).yaw(-90.0),
        Place::at(CROSS.0 - 0.7, 14.0, STEP).yaw(90.0),
    ];
    let node = doc.instances("traffic lights", signal, &places, json!({ "label": label::SIGN }));
    doc.add(node);

    let bollard = doc.solid("bollard", &props::bollard(steel));
    let mut places: Vec<_> =
        (0..7).map(|i| Place::at(13.3 + 1.3 * f64::from(i), KERB.1 + 0.4, STEP)).collect();
    places.extend((0..5).map(|i| Place::at(38.2 + 1.4 * f64::from(i), KERB.0 - 0.4, STEP)));
    let node = doc.instances("bollards", bollard, &places, json!({ "label": label::POLE }));
    doc.add(node);

    let object = |name: &str, doc: &mut Document, mesh: Mesh, places: &[Place]| {
        let mesh = doc.solid(name, &mesh);
        let node = doc.instances(name, mesh, places, json!({ "label": label::OBJECT }));
        doc.add(node);
    };
    object(
        "bin",
        doc,
        props::bin(green, dark),
        &[
            Place::at(2.2, KERB.0 - 0.6, STEP),
            Place::at(-21.0, KERB.0 - 0.6, STEP),
            Place::at(-11.0, 10.9, STEP),
            Place::at(-42.5, KERB.1 + 0.6, STEP),
            Place::at(23.0, KERB.1 + 1.4, STEP),
        ],
    );
    object(
        "refuse bin",
        doc,
        props::wheelie_bin(dark, steel),
        &[
            Place::at(-8.9, -7.4, STEP).yaw(92.0),
            Place::at(-9.7, -7.45, STEP).yaw(85.0),
            Place::at(-43.0, -7.4, STEP).yaw(95.0),
            Place::at(40.0, 10.9, STEP).yaw(-88.0),
            Place::at(40.8, 10.95, STEP).yaw(-95.0),
        ],
    );
    object(
        "bench",
        doc,
        props::bench(wood, steel),
        &[
            Place::at(-20.0, 13.4, STEP + lawn(-20.0, 13.4)).yaw(-90.0),
            Place::at(-8.0, 13.4, STEP + lawn(-8.0, 13.4)).yaw(-90.0),
            Place::at(-17.5, KERB.0 - 3.3, STEP).yaw(90.0),
            Place::at(43.5, 10.9, STEP).yaw(-90.0),
        ],
    );
    let planters: Vec<_> = (0..6).map(planter_place).collect();
    object("planter", doc, props::planter(stone), &planters);
    object(
        "bus shelter",
        doc,
        props::shelter(steel, glass, wood, poster),
        &[Place::at(-30.0, 9.9, STEP).yaw(-90.0)],
    );
    object(
        "cafe table",
        doc,
        props::cafe_table(wood, steel, amber),
        &[
            Place::at(11.5, 10.2, STEP),
            Place::at(14.3, 10.4, STEP).yaw(40.0),
            Place::at(17.2, 10.1, STEP).yaw(100.0),
            Place::at(14.0, -6.8, STEP).yaw(200.0),
        ],
    );

    let hoops = doc.solid("bicycle stand", &props::bicycle_stand(5, zinc));
    let places = [Place::at(-1.0, KERB.0 - 1.0, STEP), Place::at(-49.0, KERB.1 + 1.1, STEP).yaw(180.0)];
    let node = doc.instances("bicycle stands", hoops, &places, json!({ "label": label::POLE }));
    doc.add(node);
    let frame = doc.material("bicycle frame", [0.1, 0.3, 0.4]);
    let bicycle = doc.solid("bicycle", &vehicles::bicycle(frame, dark));
    let bicycles = [
        (-2.55, -4.85, STEP, 91.0),
        (-1.75, -4.95, STEP, 88.0),
        (0.7, -4.9, STEP, 93.0),
        (-48.2, 8.7, STEP, -90.0),
        (-47.4, 8.6, STEP, -87.0),
        (2.4, 9.1, STEP, 10.0),
    ];
    let places: Vec<_> =
        bicycles.iter().map(|&(x, y, z, yaw): &(f64, f64, f64, f64)| Place::at(x, y, z).yaw(yaw)).collect();
    let node = doc.instances("bicycles", bicycle, &places, json!({ "label": label::BICYCLE }));
    doc.add(node);
}
