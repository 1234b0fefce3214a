//! Things that move through the street by themselves: a car and a cyclist. Each is a file of its own, stands at the origin, faces +x,
//! and has an animation that fits the speed in its `extras`: no wheel and no foot slides on the ground.

use std::f64::consts::TAU;

use glam::{DAffine3, DMat3, DQuat, DVec3};
use serde_json::json;

use super::glb::{Document, Keys, Material, NodeId, Place, SceneFile};
use super::label;
use super::mesh::{Mesh, circle, ellipse, sincos_deg, v};
use super::vehicles::{self, CarPaint, HATCHBACK};

/// The speed of the car in m/s.
pub const CAR_SPEED: f64 = 8.0;
/// The speed of the cyclist in m/s.
pub const CYCLIST_SPEED: f64 = 4.0;

/// The rotation about y, by which what faces +x rolls forward.
pub fn pitch(degrees: f64) -> DQuat {
    let (s, c) = sincos_deg(degrees / 2.0);
    DQuat::from_xyzw(0.0, s, 0.0, c)
}

pub fn yaw(degrees: f64) -> DQuat {
    let (s, c) = sincos_deg(degrees / 2.0);
    DQuat::from_xyzw(0.0, 0.0, s, c)
}

/// `count` + 1 evenly spaced times from 0 to `period`.
pub fn times(period: f64, count: usize) -> Vec<f64> {
    (0..=count).map(|i| period * i as f64 / count as f64).collect()
}

pub fn car() -> SceneFile {
    let mut doc = Document::new();
    let body = doc.material("green paint", [0.04, 0.3, 0.16]);
    let paint = CarPaint::with_body(&mut doc, body);
    let body = doc.solid("car body", &vehicles::plain_car(&HATCHBACK, &paint));
    let wheel = doc.solid("car wheel", &vehicles::plain_wheel(&HATCHBACK, &paint));
    let mut parts = vec![doc.node("car body", body, Place::at(0.0, 0.0, 0.0), json!(null))];
    // A wheel turns once on the way of its circumference. A quarter of a turn from key to key is less than half a turn, so
    // that the way from one to the next is clear.
    let times = times(TAU * HATCHBACK.wheel_radius / CAR_SPEED, 4);
    let mut tracks = vec![];
    for (name, at, outwards_deg) in vehicles::wheel_places(&HATCHBACK) {
        let place = Place::at(at.x, at.y, at.z).yaw(outwards_deg);
        let node = doc.node(name, wheel, place, json!({ "radius_m": HATCHBACK.wheel_radius }));
        let turns = (0..=4).map(|i| pitch(90.0 * f64::from(i)) * yaw(outwards_deg)).collect();
        tracks.push((node, Keys::Rotations(turns)));
        parts.push(node);
    }
    let extras = json!({ "label": label::CAR, "speed_m_s": CAR_SPEED });
    let root = doc.branch("car", Place::at(0.0, 0.0, 0.0), &parts, extras);
    doc.add(root);
    doc.animation("drive", &times, &tracks);
    doc.finish("actors/car.glb", "A car whose wheels turn.")
}

const BICYCLE_WHEEL: f64 = 0.34;
/// The axle of the cranks, seen from below the middle of the wheels' axles.
const CRANK: DVec3 = DVec3::new(-0.08, 0.0, 0.3);
const CRANK_LENGTH: f64 = 0.17;
/// The wheels' turns for a turn of the cranks.
const GEAR: f64 = 2.0;
/// The half distance of the pedals' middles, and of the hips.
const PEDAL_OUT: f64 = 0.11;
/// The rider's ankle, seen from the pedal's middle, and the hip.
const ANKLE_FROM_PEDAL: DVec3 = DVec3::new(-0.1, 0.0, 0.1);
const RIDERS_HIP: DVec3 = DVec3::new(-0.24, 0.0, 0.97);
const THIGH: f64 = 0.42;
const SHANK: f64 = 0.42;

/// The angles of a leg whose hip and ankle are `reach` apart: the angle of the thigh forward of straight down and by how
/// much the knee is bent, in degrees. The leg stays in a plane y = const, and the knee points forward.
pub fn leg(reach: DVec3, thigh: f64, shank: f64) -> (f64, f64) {
    let distance = libm::hypot(reach.x, reach.z);
    // The law of cosines, at the knee and at the hip.
    let cos_bend = (distance * distance - thigh * thigh - shank * shank) / (2.0 * thigh * shank);
    let bend = libm::acos(cos_bend.clamp(-1.0, 1.0));
    let at_hip = libm::atan2(shank * libm::sin(bend), thigh + shank * libm::cos(bend));
    (libm::atan2(reach.x, -reach.z).to_degrees() + at_hip.to_degrees(), bend.to_degrees())
}

pub fn cyclist() -> SceneFile {
    const KEYS: usize = 24;
    let mut doc = Document::new();
    let frame = doc.material("orange frame", [0.6, 0.22, 0.03]);
    let tyre = doc.grey("tyre", 0.04);
    let skin = doc.material("skin", [0.5, 0.3, 0.2]);
    let helmet = doc.grey("white helmet", 0.7);
    let jacket = doc.material("blue jacket", [0.04, 0.12, 0.42]);
    let trousers = doc.grey("dark trousers", 0.07);

    let wheel = doc.solid("bicycle wheel", &bicycle_wheel(frame, tyre));
    let body = doc.solid("bicycle frame", &bicycle_frame(frame, tyre));
    let cranks = doc.solid("cranks", &cranks(frame));
    let here = Place::at(0.0, 0.0, 0.0);
    let period = GEAR * TAU * BICYCLE_WHEEL / CYCLIST_SPEED;
    let times = times(period, KEYS);
    let turns = |a_period: f64| {
        Keys::Rotations((0..=KEYS).map(|i| pitch(360.0 * a_period * i as f64 / KEYS as f64)).collect())
    };
    let mut tracks = vec![];
    let mut parts = vec![doc.node("frame", body, here, json!(null))];
    for (name, x) in [("rear wheel", -0.52), ("front wheel", 0.52)] {
        let extras = json!({ "radius_m": BICYCLE_WHEEL });
        let node = doc.node(name, wheel, Place::at(x, 0.0, BICYCLE_WHEEL), extras);
        tracks.push((node, turns(GEAR)));
        parts.push(node);
    }
    let node = doc.node("cranks", cranks, Place::at(CRANK.x, CRANK.y, CRANK.z), json!(null));
    tracks.push((node, turns(1.0)));
    parts.push(node);
    let bicycle = doc.branch("bicycle", here, &parts, json!({ "label": label::BICYCLE }));

    let torso = doc.solid("rider", &rider(skin, helmet, jacket, trousers));
    let mut parts = vec![doc.node("trunk and arms", torso, here, json!(null))];
    let limb = |doc: &mut Document, name: &str, length: f64, radii: (f64, f64)| {
        let mut mesh = Mesh::new();
        mesh.limb(&[(DVec3::ZERO, radii.0), (v(0.0, 0.0, -length), radii.1)], 8, trousers);
        doc.solid(name, &mesh)
    };
    let thigh = limb(&mut doc, "thigh", THIGH, (0.085, 0.06));
    let shank = limb(&mut doc, "shank", SHANK, (0.058, 0.042));
    let mut foot = Mesh::new();
    foot.ellipsoid(v(0.05, 0.0, -0.04), v(0.135, 0.048, 0.045), 10, 6, tyre);
    let pedal = -ANKLE_FROM_PEDAL;
    foot.cuboid(pedal - v(0.05, 0.045, 0.012), pedal + v(0.05, 0.045, 0.012), frame);
    let foot = doc.solid("foot and pedal", &foot);
    // The left crank points forward at the beginning, and the right one back.
    for (name, side, first_deg) in [("left", 1.0, 0.0), ("right", -1.0, 180.0)] {
        let hip = RIDERS_HIP + v(0.0, side * PEDAL_OUT, 0.0);
        let joints = (0..=KEYS).map(|i| {
            let (s, c) = sincos_deg(first_deg + 360.0 * i as f64 / KEYS as f64);
            let pedal = CRANK + v(CRANK_LENGTH * c, side * PEDAL_OUT, -CRANK_LENGTH * s);
            let (forward, bend) = leg(pedal + ANKLE_FROM_PEDAL - hip, THIGH, SHANK);
            [pitch(-forward), pitch(bend), pitch(forward - bend)]
        });
        let joints: Vec<[DQuat; 3]> = joints.collect();
        let mut below: Option<NodeId> = None;
        for (index, (part, mesh, at)) in [
            ("foot", foot, v(0.0, 0.0, -SHANK)),
            ("shank", shank, v(0.0, 0.0, -THIGH)),
            ("thigh", thigh, hip),
        ]
        .into_iter()
        .enumerate()
        {
            let keys: Vec<DQuat> = joints.iter().map(|joint| joint[2 - index]).collect();
            let place = Place::at(at.x, at.y, at.z).rotated(keys[0]);
            let node = doc.node(&format!("{name} {part}"), mesh, place, json!(null));
            if let Some(below) = below {
                doc.adopt(node, &[below]);
            }
            tracks.push((node, Keys::Rotations(keys)));
            below = Some(node);
        }
        parts.extend(below);
    }
    let rider = doc.branch("rider", here, &parts, json!({ "label": label::PERSON }));
    let extras = json!({ "speed_m_s": CYCLIST_SPEED });
    let root = doc.branch("cyclist", here, &[bicycle, rider], extras);
    doc.add(root);
    doc.animation("ride", &times, &tracks);
    doc.finish("actors/cyclist.glb", "A cyclist whose wheels turn and who pedals.")
}

/// A wheel about y.
fn bicycle_wheel(frame: Material, tyre: Material) -> Mesh {
    let mut upright = Mesh::new();
    let r = BICYCLE_WHEEL;
    let profile: Vec<_> = circle(DVec3::ZERO, 0.02, 6).iter().map(|p| (r - 0.02 + p.x, p.y)).collect();
    upright.ring(DVec3::ZERO, &profile, 24, tyre);
    for i in 0..10 {
        let (s, c) = sincos_deg(36.0 * f64::from(i));
        let z = if i % 2 == 0 { 0.03 } else { -0.03 };
        let end = r - 0.035;
        upright.tube(&[(v(0.015 * c, 0.015 * s, z), 0.003), (v(c * end, s * end, 0.0), 0.003)], 3, frame);
    }
    upright.tube(&[(v(0.0, 0.0, -0.05), 0.022), (v(0.0, 0.0, 0.05), 0.022)], 8, frame);
    let mut lying = Mesh::new();
    lying.add(&upright, DAffine3::from_mat3(DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y)));
    lying
}

const SEAT: DVec3 = DVec3::new(-0.25, 0.0, 0.9);
const GRIP: DVec3 = DVec3::new(0.3, 0.24, 1.02);

fn bicycle_frame(frame: Material, dark: Material) -> Mesh {
    let mut mesh = Mesh::new();
    let (head, low_head, front) = (v(0.36, 0.0, 0.86), v(0.4, 0.0, 0.7), v(0.52, 0.0, BICYCLE_WHEEL));
    let (rear, cluster) = (v(-0.52, 0.0, BICYCLE_WHEEL), SEAT.lerp(CRANK, 0.15));
    for (a, b, radius) in [
        (CRANK, SEAT, 0.018),
        (cluster, head, 0.018),
        (CRANK, low_head, 0.02),
        (low_head, head + v(-0.04, 0.0, 0.16), 0.02),
    ] {
        mesh.tube(&[(a, radius), (b, radius)], 6, frame);
    }
    for y in [-0.06, 0.06] {
        let side = v(0.0, y, 0.0);
        mesh.tube(&[(rear + side, 0.01), (CRANK, 0.01)], 5, frame);
        mesh.tube(&[(rear + side, 0.009), (cluster, 0.009)], 5, frame);
        mesh.tube(&[(front + side, 0.013), (low_head + side * 0.6, 0.013)], 5, frame);
        let grip = v(GRIP.x, GRIP.y * y.signum(), GRIP.z);
        mesh.tube(&[(head + v(-0.03, 0.0, 0.14), 0.012), (grip, 0.012)], 5, frame);
    }
    mesh.ellipsoid(SEAT + v(0.0, 0.0, 0.02), v(0.14, 0.08, 0.03), 10, 4, dark);
    mesh
}

/// The cranks as they are when the left one points forward, about y.
fn cranks(frame: Material) -> Mesh {
    let mut mesh = Mesh::new();
    mesh.tube(&[(v(0.0, -0.07, 0.0), 0.02), (v(0.0, 0.07, 0.0), 0.02)], 6, frame);
    for side in [1.0, -1.0] {
        let y = side * 0.055;
        mesh.limb(&[(v(0.0, y, 0.0), 0.014), (v(side * CRANK_LENGTH, y, 0.0), 0.012)], 5, frame);
    }
    mesh
}

/// The rider without legs, leaning forward with the hands on the grips.
fn rider(skin: Material, helmet: Material, jacket: Material, trousers: Material) -> Mesh {
    let mut mesh = Mesh::new();
    // Sections of the trunk from the seat to the neck, each level: (middle, half depth, half width).
    let trunk = [
        (v(-0.25, 0.0, 0.9), 0.1, 0.14),
        (v(-0.23, 0.0, 1.0), 0.125, 0.165),
        (v(-0.17, 0.0, 1.14), 0.115, 0.15),
        (v(-0.06, 0.0, 1.32), 0.12, 0.18),
        (v(0.02, 0.0, 1.44), 0.105, 0.185),
        (v(0.05, 0.0, 1.5), 0.06, 0.08),
    ];
    let rings: Vec<_> = trunk.iter().map(|&(at, x, y)| ellipse(at, x, y, 12)).collect();
    mesh.loft(&rings, |i, _| if i < 2 { trousers } else { jacket });
    for side in [1.0, -1.0] {
        let shoulder = v(0.02, side * 0.18, 1.41);
        let (elbow, hand) = (v(0.12, side * 0.29, 1.17), v(GRIP.x, side * GRIP.y, GRIP.z + 0.02));
        mesh.limb(&[(shoulder, 0.055), (elbow, 0.045), (hand, 0.035)], 8, jacket);
        mesh.ellipsoid(hand, v(0.045, 0.05, 0.035), 8, 4, skin);
    }
    mesh.tube(&[(v(0.04, 0.0, 1.46), 0.055), (v(0.1, 0.0, 1.6), 0.05)], 8, skin);
    mesh.ellipsoid(v(0.12, 0.0, 1.65), v(0.095, 0.075, 0.115), 12, 8, skin);
    mesh.ellipsoid(v(0.1, 0.0, 1.7), v(0.13, 0.095, 0.09), 12, 6, helmet);
    mesh
}
