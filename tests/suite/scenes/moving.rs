//! What moves in the scenes of drives: wheels roll, feet stand, and clips can be played over and over.

use glam::{DAffine3, DQuat, DVec3};
use serde_json::Value;

use super::Glb;

const FILES: [&str; 3] = ["actors/car.glb", "actors/cyclist.glb", "actors/walker.glb"];

/// A channel of an animation with straight lines between its keys.
struct Track {
    node: usize,
    times: Vec<f64>,
    values: Vec<Vec<f64>>,
}

impl Track {
    fn is_rotation(&self) -> bool {
        self.values[0].len() == 4
    }

    fn rotations(&self) -> Vec<DQuat> {
        self.values.iter().map(|v| DQuat::from_slice(v).normalize()).collect()
    }
}

/// All channels of a file's only animation.
fn tracks(glb: &Glb) -> Vec<Track> {
    let animation = &glb.json["animations"][0];
    assert!(glb.json["animations"].as_array().unwrap().len() == 1);
    let track = |channel: &Value| {
        let sampler = &animation["samplers"][channel["sampler"].as_u64().unwrap() as usize];
        assert_eq!(sampler["interpolation"], "LINEAR");
        let times = floats(glb, &sampler["input"]);
        let values = floats(glb, &sampler["output"]);
        let width = values.len() / times.len();
        Track {
            node: channel["target"]["node"].as_u64().unwrap() as usize,
            times,
            values: values.chunks(width).map(<[f64]>::to_vec).collect(),
        }
    };
    animation["channels"].as_array().unwrap().iter().map(track).collect()
}

fn floats(glb: &Glb, accessor: &Value) -> Vec<f64> {
    let bytes = glb.bytes(accessor);
    bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap()).into()).collect()
}

fn node<'a>(glb: &'a Glb, name: &str) -> (usize, &'a Value) {
    let nodes = glb.json["nodes"].as_array().unwrap();
    nodes.iter().enumerate().find(|(_, node)| node["name"] == name).unwrap_or_else(|| panic!("no {name}"))
}

/// The speed that a file's object has on its wheels or feet.
fn speed(glb: &Glb) -> f64 {
    let nodes = glb.json["nodes"].as_array().unwrap();
    nodes.iter().find_map(|node| node["extras"]["speed_m_s"].as_f64()).unwrap()
}

/// The map from a node to the file's world at `time_s`.
fn world_from(glb: &Glb, tracks: &[Track], name: &str, time_s: f64) -> DAffine3 {
    let nodes = glb.json["nodes"].as_array().unwrap();
    let (mut index, mut map) = (node(glb, name).0, DAffine3::IDENTITY);
    loop {
        let own = |key: &str| -> Option<Vec<f64>> {
            let track = tracks.iter().find(|t| t.node == index && t.is_rotation() == (key == "rotation"));
            let Some(track) = track else {
                return Some(nodes[index][key].as_array()?.iter().map(|v| v.as_f64().unwrap()).collect());
            };
            let after = track.times.iter().position(|t| *t > time_s).unwrap_or(track.times.len() - 1);
            let part = (time_s - track.times[after - 1]) / (track.times[after] - track.times[after - 1]);
            if track.is_rotation() {
                let keys = track.rotations();
                return Some(keys[after - 1].slerp(keys[after], part).to_array().to_vec());
            }
            let [a, b] = [&track.values[after - 1], &track.values[after]];
            Some(a.iter().zip(b).map(|(a, b)| a + (b - a) * part).collect())
        };
        let translation = own("translation").map_or(DVec3::ZERO, |v| DVec3::from_slice(&v));
        let rotation = own("rotation").map_or(DQuat::IDENTITY, |v| DQuat::from_slice(&v));
        map = DAffine3::from_rotation_translation(rotation, translation) * map;
        let above = |node: &Value| {
            node["children"].as_array().is_some_and(|children| children.iter().any(|c| c == index as u64))
        };
        match nodes.iter().position(above) {
            Some(parent) => index = parent,
            None => return map,
        }
    }
}

/// A wheel turns forward by v/r. Forward about glTF's axes, of which x is forward and z to the right, is about −z.
#[test]
fn wheels_roll_without_slipping() {
    let mut wheels = 0;
    for file in FILES {
        let glb = Glb::open(file);
        for track in tracks(&glb) {
            let Some(radius) = glb.json["nodes"][track.node]["extras"]["radius_m"].as_f64() else { continue };
            wheels += 1;
            let rotations = track.rotations();
            for (times, keys) in track.times.windows(2).zip(rotations.windows(2)) {
                let (axis, angle) = (keys[1] * keys[0].inverse()).to_axis_angle();
                // A component of a key is rounded to f32, by at most 3e-8, which turns it by at most 1e-7 rad, of 0.5 rad or
                // more from key to key. A time up to 2 s is rounded by at most 6e-8 s, of 0.044 s or more: 3e-6 in all.
                assert!(axis.abs_diff_eq(DVec3::NEG_Z, 1e-6), "{file}: a wheel turns about {axis}");
                let on_the_rim = angle * radius / (times[1] - times[0]);
                assert!((on_the_rim / speed(&glb) - 1.0).abs() < 3e-6, "{file}: {on_the_rim} m/s");
            }
        }
    }
    assert_eq!(wheels, 6);
}

/// A foot that is flat on the ground goes back below the hips as fast as the walker goes forward. When it leaves the ground,
/// that holds of its ball.
#[test]
fn feet_stand_on_the_ground() {
    let glb = Glb::open("actors/walker.glb");
    let tracks = tracks(&glb);
    let speed = speed(&glb);
    assert_eq!((speed, tracks[0].times.last()), (1.25, Some(&1.0)), "two steps of 0.625 m in a second");
    // The ankle comes down 0.25 m forward of the hips, is 0.09 m above the sole, and 0.14 m behind the ball.
    let (first, height, ball) = (0.25, 0.09, 0.14);
    for i in 0..600 {
        let time = f64::from(i) / 600.0;
        for (foot, begin) in [("left foot", 0.0), ("right foot", 0.5)] {
            let phase = (time + begin) % 1.0;
            let world_from_foot = world_from(&glb, &tracks, foot, time);
            let ankle = world_from_foot.translation;
            let is_key = i % 20 == 0;
            // At a key, four rotations of parts of at most 0.9 m are rounded to f32, each by at most 6e-8 rad. Between keys
            // 1/30 s apart, an angle is off by at most h²/8 of its second derivative, and the ankle by its 0.84 m below the
            // hip: 1 mm for 9 rad/s², which is more than thigh and shank together have while the foot is flat. While the foot
            // turns about its ball by t², its own 2·50° in (0.2 s)² is 44 rad/s², of 0.17 m; with the leg's 3 mm in all.
            let flat = if is_key { 1e-6 } else { 1e-3 };
            let lifted = if is_key { 1e-6 } else { 3e-3 };
            if phase <= 0.4 {
                let expected = DVec3::new(first - speed * phase, height, ankle.z);
                assert!(ankle.abs_diff_eq(expected, flat), "{foot} at {time} s: {ankle}, not {expected}");
            } else if phase < 0.6 {
                let toe = world_from_foot.transform_point3(DVec3::new(ball, -height, 0.0));
                let expected = DVec3::new(first + ball - speed * phase, 0.0, toe.z);
                assert!(toe.abs_diff_eq(expected, lifted), "{foot} at {time} s: {toe}, not {expected}");
            } else {
                assert!(ankle.y > height - 1e-3, "{foot} at {time} s: {ankle}");
            }
        }
    }
}

/// The pedals are below the cyclist's feet, at each key and between two.
#[test]
fn feet_stay_on_their_pedals() {
    let glb = Glb::open("actors/cyclist.glb");
    let tracks = tracks(&glb);
    let period = *tracks[0].times.last().unwrap();
    for i in 0..96 {
        let time = period * f64::from(i) / 96.0;
        let cranks = world_from(&glb, &tracks, "cranks", time);
        for (foot, side) in [("left foot", 1.0), ("right foot", -1.0)] {
            // glTF's z is to the right.
            let pedal = cranks.transform_point3(DVec3::new(side * 0.17, 0.0, -side * 0.11));
            let sole = world_from(&glb, &tracks, foot, time).transform_point3(DVec3::new(0.1, -0.1, 0.0));
            // As for the walker's feet: 2.1 mm for angles of h = 45 ms and at most 10 rad/s² over 0.84 m.
            let most = if i % 4 == 0 { 1e-6 } else { 2.1e-3 };
            assert!(sole.abs_diff_eq(pedal, most), "{foot} at {time} s: {sole}, pedal {pedal}");
        }
    }
}

#[test]
fn clips_end_as_they_begin() {
    for file in FILES {
        let glb = Glb::open(file);
        for track in tracks(&glb) {
            assert!(track.times[0] == 0.0 && track.times.is_sorted_by(|a, b| a < b), "{file}");
            let [first, last] = [&track.values[0], &track.values[track.values.len() - 1]];
            // A quaternion and its negative are the same rotation.
            let dot: f64 = first.iter().zip(last).map(|(a, b)| a * b).sum();
            let sign = if track.is_rotation() { dot.signum() } else { 1.0 };
            let same = first.iter().zip(last).all(|(a, b)| (a - sign * b).abs() < 1e-7);
            assert!(same, "{file}, node {}: {first:?}, {last:?}", track.node);
        }
    }
}

#[test]
fn the_shares_of_a_vertex_are_whole() {
    let glb = Glb::open("actors/walker.glb");
    let attributes = &glb.json["meshes"][0]["primitives"][0]["attributes"];
    let joints = glb.json["skins"][0]["joints"].as_array().unwrap().len();
    let (shares, bones) = (glb.bytes(&attributes["WEIGHTS_0"]), glb.bytes(&attributes["JOINTS_0"]));
    let mut blended = 0;
    for (shares, bones) in shares.chunks(4).zip(bones.chunks(4)) {
        assert_eq!(shares.iter().map(|share| u32::from(*share)).sum::<u32>(), 255);
        assert!(
            bones
                .iter()
                .zip(shares)
                .all(|(bone, share)| usize::from(*bone) < joints && (*share > 0 || *bone == 0))
        );
        blended += usize::from(shares.iter().filter(|share| **share > 0).count() > 1);
    }
    assert!(blended > 50, "{blended} vertices follow two joints");
}
