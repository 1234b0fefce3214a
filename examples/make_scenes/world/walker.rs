//! A walking person: a skin over a skeleton, with a cycle of two steps.

use glam::{DQuat, DVec3};
use serde_json::json;

use super::actors::{leg, pitch, times, yaw};
use super::glb::{Document, Keys, NodeId, Place, SceneFile, Skin, Weights};
use super::label;
use super::mesh::{ellipse, sincos_deg, v};
use super::props::Clothes;

/// The speed in m/s, and the time of two steps in seconds.
pub const SPEED: f64 = 1.25;
pub const CYCLE: f64 = 1.0;

const THIGH: f64 = 0.42;
const SHANK: f64 = 0.42;
/// The height of the ankle above the sole, and the point of the sole, forward of the ankle, about which a foot leaves the
/// ground.
const ANKLE: f64 = 0.09;
const BALL: f64 = 0.14;
/// The joints at rest, in metres above the ground and from the middle to the left.
const HIPS: f64 = THIGH + SHANK + ANKLE;
const HIP_OUT: f64 = 0.095;

/// The parts of a leg's cycle, which begins when the foot comes down: its end flat on the ground, and the end of its turning
/// about the ball. Then it swings.
const FLAT: f64 = 0.4;
const LIFTED: f64 = 0.6;
/// The ankle forward of the hip when the foot comes down, in metres.
const FORWARD: f64 = 0.25;
/// The foot's pitch when it leaves the ground, in degrees.
const TOE_OFF_DEG: f64 = 50.0;

/// The height of the hips, lowest when both feet are on the ground.
fn hips(phase: f64) -> f64 {
    let (_, c) = sincos_deg(720.0 * phase);
    0.886 - 0.013 * c
}

/// The ankle seen from below the hip (x forward, z up from the ground), and the foot's pitch in degrees (toe down), at a
/// phase of the leg's own cycle from 0 to 1.
///
/// On the ground the foot goes back as fast as the body goes forward: first flat, then turning about its ball. In the air the
/// ankle follows the cubic whose ends have the places and velocities of the foot on the ground.
fn step(phase: f64) -> (DVec3, f64) {
    let back = |phase: f64| FORWARD - SPEED * CYCLE * phase;
    let rolled = |phase: f64| {
        let part = (phase - FLAT) / (LIFTED - FLAT);
        let pitch_deg = TOE_OFF_DEG * part * part;
        let (s, c) = sincos_deg(pitch_deg);
        let ball = back(phase) + BALL;
        (v(ball - BALL * c + ANKLE * s, 0.0, BALL * s + ANKLE * c), pitch_deg)
    };
    if phase <= FLAT {
        return (v(back(phase), 0.0, ANKLE), 0.0);
    }
    if phase <= LIFTED {
        return rolled(phase);
    }
    let length = 1.0 - LIFTED;
    let t = (phase - LIFTED) / length;
    let (from, to) = (rolled(LIFTED).0, v(FORWARD, 0.0, ANKLE));
    // The velocities at both ends, for a unit of t. At the beginning the ankle turns about the ball, whose pitch changes by
    // twice the mean.
    let rate = 2.0 * TOE_OFF_DEG.to_radians() / (LIFTED - FLAT);
    let (s, c) = sincos_deg(TOE_OFF_DEG);
    let on_ground = v(-SPEED * CYCLE, 0.0, 0.0);
    let leaving = on_ground + v(BALL * s + ANKLE * c, 0.0, BALL * c - ANKLE * s) * rate;
    let (a, b) = (leaving * length * 0.5, on_ground * length);
    let (t2, t3) = (t * t, t * t * t);
    let ankle = from * (2.0 * t3 - 3.0 * t2 + 1.0)
        + a * (t3 - 2.0 * t2 + t)
        + to * (3.0 * t2 - 2.0 * t3)
        + b * (t3 - t2);
    let pitch_deg = TOE_OFF_DEG * (1.0 - t * t * (3.0 - 2.0 * t));
    (ankle, pitch_deg)
}

/// The joints of the skeleton: name, parent, and place at rest.
const JOINTS: [(&str, Option<usize>, DVec3); 13] = {
    const fn at(x: f64, y: f64, z: f64) -> DVec3 {
        DVec3::new(x, y, z)
    }
    [
        ("hips", None, at(0.0, 0.0, HIPS)),
        ("chest", Some(0), at(0.0, 0.0, HIPS + 0.17)),
        ("head", Some(1), at(0.01, 0.0, 1.56)),
        ("left upper arm", Some(1), at(-0.01, 0.2, 1.42)),
        ("left forearm", Some(3), at(-0.03, 0.24, 1.14)),
        ("right upper arm", Some(1), at(-0.01, -0.2, 1.42)),
        ("right forearm", Some(5), at(-0.03, -0.24, 1.14)),
        ("left thigh", Some(0), at(0.0, HIP_OUT, HIPS)),
        ("left shank", Some(7), at(0.0, HIP_OUT, SHANK + ANKLE)),
        ("left foot", Some(8), at(0.0, HIP_OUT, ANKLE)),
        ("right thigh", Some(0), at(0.0, -HIP_OUT, HIPS)),
        ("right shank", Some(10), at(0.0, -HIP_OUT, SHANK + ANKLE)),
        ("right foot", Some(11), at(0.0, -HIP_OUT, ANKLE)),
    ]
};
const CHEST: u8 = 1;
const HEAD: u8 = 2;
const ARMS: [u8; 2] = [3, 5];
const LEGS: [u8; 2] = [7, 10];

pub fn make() -> SceneFile {
    const KEYS: usize = 30;
    let mut doc = Document::new();
    let clothes = Clothes {
        skin: doc.material("skin", [0.5, 0.3, 0.2]),
        hair: doc.material("hair", [0.06, 0.04, 0.03]),
        top: doc.material("red coat", [0.5, 0.06, 0.05]),
        trousers: doc.material("denim", [0.06, 0.09, 0.2]),
        shoes: doc.grey("shoes", 0.05),
    };
    let joints: Vec<NodeId> = JOINTS
        .iter()
        .map(|&(name, parent, rest)| {
            let at = rest - parent.map_or(DVec3::ZERO, |parent| JOINTS[parent].2);
            doc.branch(name, Place::at(at.x, at.y, at.z), &[], json!(null))
        })
        .collect();
    for (index, (_, parent, _)) in JOINTS.iter().enumerate() {
        if let Some(parent) = *parent {
            doc.adopt(joints[parent], &[joints[index]]);
        }
    }
    // A skin is where its joints are, wherever its own node is. It is therefore in no other node.
    let extras = json!({ "label": label::PERSON, "speed_m_s": SPEED });
    let skin = doc.skinned("walker", &figure(&clothes), &joints, &JOINTS.map(|(_, _, rest)| rest), extras);
    doc.add(skin);
    doc.add(joints[0]);

    let mut rotations: Vec<Vec<DQuat>> = vec![vec![]; JOINTS.len()];
    let mut bob = vec![];
    for i in 0..=KEYS {
        let phase = i as f64 / KEYS as f64;
        let height = hips(phase);
        bob.push(v(0.0, 0.0, height));
        for (side, first) in [(0, 0.0), (1, 0.5)] {
            let own = (phase + first) % 1.0;
            let (ankle, foot_deg) = step(own);
            let (forward, bend) = leg(ankle - v(0.0, 0.0, height), THIGH, SHANK);
            let thigh = usize::from(LEGS[side]);
            rotations[thigh].push(pitch(-forward));
            rotations[thigh + 1].push(pitch(bend));
            rotations[thigh + 2].push(pitch(forward - bend + foot_deg));
            // An arm swings against the leg of its side.
            let (_, c) = sincos_deg(360.0 * own);
            let arm = usize::from(ARMS[side]);
            rotations[arm].push(pitch(20.0 * c));
            rotations[arm + 1].push(pitch(-18.0 + 10.0 * c));
        }
        // The chest turns against the hips, and the head stays as it is.
        let (_, c) = sincos_deg(360.0 * phase);
        rotations[usize::from(CHEST)].push(yaw(6.0 * c));
        rotations[usize::from(HEAD)].push(yaw(-6.0 * c));
    }
    let mut tracks = vec![(joints[0], Keys::Translations(bob))];
    for (joint, keys) in joints.iter().zip(rotations).skip(1) {
        tracks.push((*joint, Keys::Rotations(keys)));
    }
    doc.animation("walk", &times(CYCLE, KEYS), &tracks);
    doc.finish("actors/walker.glb", "A person who walks: a skin over a skeleton.")
}

/// From joint `above` to joint `below` over `reach` metres about the height `z`.
fn blend(above: u8, below: u8, z: f64, reach: f64) -> impl Fn(DVec3) -> Weights {
    move |p| {
        let share = ((p.z - z) / (2.0 * reach) + 0.5).clamp(0.0, 1.0);
        [(above, share), (below, 1.0 - share)]
    }
}

/// The body, 1.77 m tall, standing with the arms down.
fn figure(c: &Clothes) -> Skin {
    let mut skin = Skin::default();
    for (side, (leg, arm)) in [1.0, -1.0].into_iter().zip(LEGS.into_iter().zip(ARMS)) {
        let y = side * HIP_OUT;
        let knee = SHANK + ANKLE;
        let path = [
            (HIPS + 0.03, 0.075),
            (HIPS - 0.06, 0.092),
            (knee + 0.22, 0.08),
            (knee + 0.07, 0.065),
            (knee, 0.062),
            (knee - 0.07, 0.06),
            (knee - 0.15, 0.062),
            (ANKLE + 0.02, 0.046),
        ]
        .map(|(z, radius)| (v(0.0, y, z), radius));
        skin.add(|mesh| mesh.tube(&path, 8, c.trousers), blend(leg, leg + 1, knee, 0.08));
        let middle = v(0.05, y, 0.045);
        skin.add(
            |mesh| mesh.ellipsoid(middle, v(0.135, 0.05, 0.045), 10, 6, c.shoes),
            |_| [(leg + 2, 1.0), (0, 0.0)],
        );
        let (shoulder, elbow) = (JOINTS[usize::from(arm)].2, JOINTS[usize::from(arm) + 1].2);
        let hand = elbow + v(0.0, 0.0, -0.26);
        let path = [
            (shoulder + v(0.0, -0.02 * side, 0.05), 0.035),
            (shoulder, 0.056),
            (shoulder.lerp(elbow, 0.75), 0.047),
            (elbow, 0.045),
            (elbow.lerp(hand, 0.25), 0.043),
            (hand, 0.034),
        ];
        let weights = blend(arm, arm + 1, elbow.z, 0.07);
        skin.add(|mesh| mesh.tube(&path, 8, c.top), weights);
        skin.add(
            |mesh| mesh.ellipsoid(hand - v(0.0, 0.0, 0.04), v(0.04, 0.028, 0.06), 8, 5, c.skin),
            |_| [(arm + 1, 1.0), (0, 0.0)],
        );
    }
    let trunk = [
        (0.84, 0.1, 0.14),
        (0.9, 0.115, 0.165),
        (1.0, 0.115, 0.16),
        (1.1, 0.1, 0.145),
        (1.25, 0.12, 0.175),
        (1.37, 0.12, 0.195),
        (1.44, 0.1, 0.185),
        (1.5, 0.06, 0.08),
    ];
    let rings: Vec<_> = trunk.iter().map(|&(z, x, y)| ellipse(v(0.0, 0.0, z), x, y, 12)).collect();
    skin.add(
        |mesh| mesh.loft(&rings, |i, _| if i < 2 { c.trousers } else { c.top }),
        blend(CHEST, 0, HIPS + 0.17, 0.1),
    );
    let neck = JOINTS[usize::from(HEAD)].2.z;
    skin.add(
        |mesh| mesh.tube(&[(v(0.0, 0.0, 1.46), 0.055), (v(0.015, 0.0, 1.6), 0.05)], 8, c.skin),
        blend(HEAD, CHEST, neck, 0.05),
    );
    let head = |_: DVec3| [(HEAD, 1.0), (0, 0.0)];
    skin.add(|mesh| mesh.ellipsoid(v(0.025, 0.0, 1.655), v(0.095, 0.075, 0.115), 12, 8, c.skin), head);
    skin.add(|mesh| mesh.ellipsoid(v(0.005, 0.0, 1.68), v(0.1, 0.083, 0.1), 12, 8, c.hair), head);
    skin
}
