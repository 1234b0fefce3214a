//! A straight street for drives: small in bytes, and without traffic of its own. The moving objects are files of their own,
//! [`super::actors`] and [`super::walker`], which a job puts on trajectories.
//!
//! The road goes along x. The right-hand lane, in which cars go along +x, is centred on y = −1.75, and the left-hand one on
//! y = 1.75. A lane for bicycles is centred on y = −4.25. People cross at x = 20, where the pavements are lowered.

use std::fmt::Write as _;

use serde_json::json;

use super::buildings::{Bays, Fabric, House};
use super::glb::{Document, Place, QuarterTurned, SceneFile};
use super::label;
use super::mesh::{Mesh, turned, v};
use super::props;
use super::room::SUNK;
use super::trees::{self, Species};
use super::vehicles::{self, CarPaint, SALOON};

/// The ground reaches from −`END` to `END` along x, and as far to both sides.
const END: f64 = 90.0;
const SIDE: f64 = 28.0;
/// The y of the carriageway's edges, and of the houses' fronts.
const KERB: (f64, f64) = (-5.0, 6.0);
const FRONT: (f64, f64) = (-9.0, 10.0);
/// The height of the pavements, and the x between which they are lowered to the road.
const STEP: f64 = 0.125;
const CROSSING: (f64, f64) = (16.0, 24.0);

pub fn make() -> SceneFile {
    let mut doc = Document::new();
    ground(&mut doc);
    houses(&mut doc);
    trees(&mut doc);
    parked_cars(&mut doc);
    furniture(&mut doc);
    doc.finish("drive.glb", "A straight street of 180 m for drives, without traffic of its own.")
}

fn ground(doc: &mut Document) {
    let asphalt = doc.grey("asphalt", 0.12);
    let level = |x: (f64, f64), y: (f64, f64), z: f64| {
        [v(x.0, y.0, z), v(x.1, y.0, z), v(x.1, y.1, z), v(x.0, y.1, z)]
    };
    let mut mesh = Mesh::new();
    mesh.quad(level((-END, END), KERB, 0.0), asphalt);
    let mesh = doc.sheet("road", &mesh);
    let here = Place::at(0.0, 0.0, 0.0);
    let node = doc.node("road", mesh, here, json!({ "label": label::ROAD }));
    doc.add(node);

    // The pavements are slabs, and the ground in the gap between two is level with the road.
    let paving = doc.grey("paving", 0.28);
    let mut mesh = Mesh::new();
    for (inner, outer) in [(KERB.0, -SIDE), (KERB.1, SIDE)] {
        let y = (f64::min(inner, outer), f64::max(inner, outer));
        for x in [(-END, CROSSING.0), (CROSSING.1, END)] {
            mesh.cuboid(v(x.0, y.0, -SUNK), v(x.1, y.1, STEP), paving);
        }
        mesh.cuboid(v(CROSSING.0 - SUNK, y.0, -0.25), v(CROSSING.1 + SUNK, y.1, 0.0), paving);
    }
    let mesh = doc.solid("pavement", &mesh);
    let node = doc.node("pavement", mesh, here, json!({ "label": label::SIDEWALK }));
    doc.add(node);

    let white = doc.grey("road paint", 0.7);
    let mut mesh = Mesh::new();
    let mut paint = |x: (f64, f64), y: (f64, f64)| mesh.quad(level(x, y, 1.0 / 256.0), white);
    let mut x = -END + 1.5;
    while x + 3.0 < END {
        if x + 3.0 < CROSSING.0 || x > CROSSING.1 {
            paint((x, x + 3.0), (-0.0625, 0.0625)); // the middle of the road
        }
        x += 6.0;
    }
    for (from, to) in [(-END, CROSSING.0), (CROSSING.1, END)] {
        paint((from, to), (-3.5625, -3.4375));
        paint((from, to), (3.4375, 3.5625));
    }
    let mut y = KERB.0 + 0.25;
    while y + 0.5 < KERB.1 {
        paint((18.5, 21.5), (y, y + 0.5)); // zebra crossing
        y += 1.0;
    }
    paint((16.75, 17.125), (-3.375, -0.125)); // stop line
    let mesh = doc.sheet("markings", &mesh);
    let node = doc.node("markings", mesh, here, json!({ "label": label::MARKING }));
    doc.add(node);
}

fn houses(doc: &mut Document) {
    let fabric = Fabric::new(doc);
    let brick = doc.material("brick", [0.36, 0.13, 0.08]);
    let render = doc.material("cream render", [0.66, 0.58, 0.42]);
    let grey = doc.material("grey render", [0.4, 0.41, 0.42]);
    let first = Bays::plain(doc, brick, &fabric);
    let colours = [first, first.repainted(doc, render), first.repainted(doc, grey)];
    // (the x of the western end, bays, floors, colour). At the crossing there is no house.
    let south = [
        (-84.0, 6, 2, 0),
        (-62.0, 5, 3, 1),
        (-44.0, 6, 2, 2),
        (-20.0, 6, 3, 0),
        (28.0, 6, 2, 1),
        (50.0, 8, 3, 2),
    ];
    let north = [
        (-80.0, 7, 3, 1),
        (-56.0, 5, 2, 2),
        (-36.0, 7, 3, 0),
        (-8.0, 6, 2, 1),
        (26.0, 7, 3, 2),
        (52.0, 6, 2, 0),
    ];
    for (list, name, y, quarters) in [(south, "south", FRONT.0, 2), (north, "north", FRONT.1, 0)] {
        for (index, (west, width, floors, colour)) in list.into_iter().enumerate() {
            let east = west + 3.0 * f64::from(width);
            // A house begins at the left end of its front, seen from the street.
            let at = v(if quarters == 2 { east } else { west }, y, STEP);
            let house = House {
                name: &format!("house {} {name}", index + 1),
                frame: QuarterTurned { at, quarters },
                width,
                depth: 4,
                floors,
                bayed: [true, false, false, false],
                pitched: index % 2 == 0,
                shops: false,
            };
            house.build(doc, &colours[colour], &fabric);
        }
    }
}

fn trees(doc: &mut Document) {
    let bark = doc.material("bark", [0.12, 0.09, 0.06]);
    let leaf = doc.material("lime leaf", [0.1, 0.26, 0.05]);
    let species = Species {
        clear_height: 2.4,
        height: 7.0,
        profile: trees::round_crown,
        crown_radius: 2.0,
        trunk_radius: 0.15,
        branches: 5,
        leaves: 900,
        leaf_length: 0.34,
        rise: 0.55,
    };
    let (wood, leaves) = trees::tree(&species, 20, bark, leaf);
    let (wood, leaves) = (doc.solid("lime tree, wood", &wood), doc.sheet("lime tree, leaves", &leaves));
    let mut places = vec![];
    for (i, x) in [-70.0, -48.0, -27.0, -4.0, 9.0, 33.0, 58.0].into_iter().enumerate() {
        places.push(Place::at(x, FRONT.0 + 2.8, STEP).yaw(77.0 * i as f64));
        places.push(Place::at(x - 9.0, FRONT.1 - 2.8, STEP).yaw(41.0 + 77.0 * i as f64));
    }
    for (part, mesh) in [("wood", wood), ("leaves", leaves)] {
        let extras = json!({ "label": label::VEGETATION });
        let node = doc.instances(&format!("lime trees, {part}"), mesh, &places, extras);
        doc.add(node);
    }
}

fn parked_cars(doc: &mut Document) {
    let body = doc.grey("silver paint", 0.5);
    let paint = CarPaint::with_body(doc, body);
    let mut mesh = vehicles::plain_car(&SALOON, &paint);
    let wheel = vehicles::plain_wheel(&SALOON, &paint);
    for (_, at, yaw_deg) in vehicles::wheel_places(&SALOON) {
        mesh.add(&wheel, turned(yaw_deg, at));
    }
    let silver = doc.solid("saloon, silver", &mesh);
    let red = doc.material("red paint", [0.45, 0.03, 0.03]);
    let black = doc.grey("black paint", 0.03);
    let red = doc.repainted("saloon, red", silver, paint.body, red);
    let black = doc.repainted("saloon, black", silver, paint.body, black);
    for (mesh, x, yaw) in [
        (silver, -66.0, 180.0),
        (black, -59.5, 181.0),
        (red, -42.0, 180.0),
        (silver, -30.0, 179.0),
        (black, -13.0, 180.0),
        (silver, -6.5, 180.0),
        (red, 5.0, 181.0),
        (black, 36.0, 180.0),
        (silver, 42.5, 180.0),
        (red, 61.0, 179.0),
    ] {
        let place = Place::at(x, 4.8, 0.0).yaw(yaw);
        let node = doc.node("parked car", mesh, place, json!({ "label": label::CAR }));
        doc.add(node);
    }
}

fn furniture(doc: &mut Document) {
    let steel = doc.material("painted steel", [0.1, 0.12, 0.11]);
    let zinc = doc.grey("zinc", 0.35);
    let lens = doc.grey("lamp glass", 0.6);
    let dark = doc.grey("dark plastic", 0.05);
    let blue = doc.material("sign blue", [0.02, 0.08, 0.45]);

    let lamp = doc.solid("lamp", &props::lamp(steel, lens));
    let places = [-75.0, -35.0, 14.0, 46.0].map(|x| Place::at(x, KERB.0 - 0.5, STEP).yaw(90.0));
    let node = doc.instances("street lamps", lamp, &places, json!({ "label": label::POLE }));
    doc.add(node);

    let sign = doc.solid("crossing sign", &props::sign(&props::rectangle(0.6, 0.6), 2.5, blue, zinc));
    let places = [Place::at(15.5, KERB.0 - 0.6, STEP).yaw(180.0), Place::at(24.5, KERB.1 + 0.6, STEP)];
    let node = doc.instances("crossing signs", sign, &places, json!({ "label": label::SIGN }));
    doc.add(node);

    let bin = doc.solid("bin", &props::bin(steel, dark));
    let places = [Place::at(-15.0, KERB.0 - 0.6, STEP), Place::at(30.0, KERB.1 + 0.6, STEP)];
    let node = doc.instances("bins", bin, &places, json!({ "label": label::OBJECT }));
    doc.add(node);
}

/// The poses of a car that drives along the right-hand lane, moves 0.3 m to the left to pass a bicycle, and brakes to a stand
/// before the crossing, 20 a second from 0 s to 11 s.
pub fn ego() -> String {
    const START: f64 = -35.0;
    const SPEED: f64 = 8.0;
    /// When it begins to brake, and how hard, in m/s².
    const BRAKE_S: f64 = 3.0;
    const BRAKE: f64 = 1.25;
    let mut csv = "t_s,x_m,y_m,z_m,qx,qy,qz,qw\n".to_owned();
    for i in 0..=220 {
        let t = f64::from(i) / 20.0;
        let braking = (t - BRAKE_S).clamp(0.0, SPEED / BRAKE);
        let x = START + SPEED * t.min(BRAKE_S) + SPEED * braking - 0.5 * BRAKE * braking * braking;
        // The way to the left is a smooth step over `length` metres, and the heading is its slope.
        let (from, length, height) = (-33.0, 20.0, 0.3);
        let u = ((x - from) / length).clamp(0.0, 1.0);
        let y = -1.75 + height * u * u * (3.0 - 2.0 * u);
        let slope = height / length * 6.0 * u * (1.0 - u);
        let half = 0.5 * libm::atan(slope);
        let (s, c) = (libm::sin(half), libm::cos(half));
        let _ = writeln!(csv, "{t:.2},{x:.6},{y:.6},0,0,0,{s:.9},{c:.9}");
    }
    csv
}
