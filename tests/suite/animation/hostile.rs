//! Animations that make no sense: they are left out with a warning that says where, and the geometry is read all the same.

use serde_json::{Value, json};

use super::{File, assert_near, plain, world_at};

/// A file whose triangle goes from 0 to 4 m in a second.
fn moving() -> File {
    let mut file = File::new();
    file.push("nodes", json!({ "mesh": 0 }));
    file.animate("go", &[(0, "translation", "LINEAR", &[0.0, 1.0], &[0.0, 0.0, 0.0, 4.0, 0.0, 0.0])]);
    file
}

/// The notices of a file, and where its triangle is at 0.5 s.
fn told(file: &File) -> (Vec<String>, f64) {
    let loaded = file.load(&plain());
    (loaded.notices.iter().map(ToString::to_string).collect(), world_at(&loaded.scene, 0.5)[0][0][0].x)
}

#[test]
fn channels_that_make_no_sense_are_left_out_and_named() {
    let nan = f32::NAN;
    type Change<'a> = &'a dyn Fn(&mut File);
    let set = |path: &'static str, value: Value| {
        move |file: &mut File| *file.json["animations"][0].pointer_mut(path).unwrap() = value.clone()
    };
    let floats = |slot: &'static str, kind: &'static str, values: Vec<f32>| {
        move |file: &mut File| {
            let accessor = file.floats(kind, &values);
            file.json["animations"][0]["samplers"][0][slot] = json!(accessor);
        }
    };
    let cases: [(Change, &str); 15] = [
        (&set("/channels/0/sampler", json!(3)), "channel 0, sampler 3: it does not exist: the last one is 0"),
        (
            &set("/channels/0/target/node", json!(7)),
            "channel 0, node 7: the node that it moves does not exist",
        ),
        (
            &set("/channels/0/target/path", json!("colour")),
            "channel 0: its path \"colour\" is none that glTF knows",
        ),
        (&set("/channels/0/target/path", json!("weights")), "channel 0, node 0: it has no morph targets"),
        (
            &set("/channels/0/target/path", json!("rotation")),
            "sampler 0, output, accessor 2: it is VEC3 of FLOAT",
        ),
        (&set("/channels/0", json!(5)), "channel 0: it is not what glTF asks for"),
        (&set("/channels", json!(5)), "animation 0 \"go\", channels: this is no list"),
        (&set("/samplers/0", json!({ "input": -1 })), "channel 0, sampler 0: it is not what glTF asks for"),
        (
            &set("/samplers/0/interpolation", json!("CUBIC")),
            "its interpolation \"CUBIC\" is none that glTF knows",
        ),
        (
            &set("/samplers/0/interpolation", json!("CUBICSPLINE")),
            "accessor 2: output has 2 elements where 6 are needed",
        ),
        (&set("/samplers/0/input", json!(99)), "sampler 0, input, accessor 99: it does not exist"),
        (&floats("input", "SCALAR", vec![1.0, 1.0]), "keyframe 1 at 1 s does not come after 1 s"),
        (&floats("input", "SCALAR", vec![0.0, nan]), "keyframe 1 has the time NaN"),
        (&floats("input", "SCALAR", vec![]), "it has no keyframes"),
        (
            &floats("output", "VEC3", vec![0.0, 0.0, 0.0, nan, 0.0, 0.0]),
            "keyframe 1 has a number that is not finite",
        ),
    ];
    for (change, expected) in cases {
        let mut file = moving();
        change(&mut file);
        let (notices, x) = told(&file);
        assert!(
            notices[0].contains(expected) && notices[0].contains("animation 0"),
            "{expected}: {notices:?}"
        );
        assert!(notices[0].contains("animation 0 \"go\"") && x == 0.0, "{notices:?} {x}");
    }
    assert_eq!(told(&moving()), (vec![], 2.0));
}

#[test]
fn of_two_channels_on_one_target_the_first_counts() {
    let mut file = moving();
    let second = file.json["animations"][0]["channels"][0].clone();
    file.json["animations"][0]["channels"].as_array_mut().unwrap().push(second);
    let (notices, x) = told(&file);
    let expected = "animation 0 \"go\", channel 1: an earlier channel of its animation moves the same; the earlier one counts";
    assert_eq!((notices, x), (vec![expected.to_owned()], 2.0));
}

#[test]
fn what_can_be_meant_in_one_way_only_is_mended() {
    // A matrix beside an animation is split.
    let mut file = moving();
    file.json["nodes"][0]["matrix"] = json!([2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0, 9, 9, 9, 1]);
    let loaded = file.load(&plain());
    assert!(loaded.notices[0].to_string().contains("though it has a matrix"), "{:?}", loaded.notices);
    assert_near(world_at(&loaded.scene, 0.5)[0][0][1], [4.0, 0.0, 0.0], 1e-6);
    // Quaternions of another length are normalised.
    let mut file = File::new();
    file.push("nodes", json!({ "mesh": 0 }));
    file.animate("turn", &[(0, "rotation", "STEP", &[0.0, 1.0], &[0.0, 0.0, 0.0, 5.0, 0.0, 0.0, 3.0, 3.0])]);
    let loaded = file.load(&plain());
    let told = loaded.notices[0].to_string();
    assert!(told.contains("channel 0: the length of a quaternion among its keyframes is not 1"), "{told}");
    assert_near(world_at(&loaded.scene, 1.0)[0][0][1], [0.0, 1.0, 0.0], 1e-6);
    // One of zeros is no rotation.
    let mut file = File::new();
    file.push("nodes", json!({ "mesh": 0 }));
    file.animate("turn", &[(0, "rotation", "STEP", &[0.0, 1.0], &[0.0; 8])]);
    let told = file.load(&plain()).notices[0].to_string();
    assert!(told.contains("the rotation of keyframe 0 is [0.0, 0.0, 0.0, 0.0], which is none"), "{told}");
}

/// Each channel of this file asks for as many weights as its mesh has targets, for a thousand keyframes without data.
#[test]
fn a_small_file_does_not_ask_for_much() {
    let mut file = moving();
    let targets: Vec<Value> = (0..10_000).map(|_| json!({})).collect();
    file.json["meshes"][0]["primitives"][0]["targets"] = json!(targets);
    let times: Vec<f32> = (0..1000).map(|key| key as f32).collect();
    let input = file.floats("SCALAR", &times);
    let output =
        file.push("accessors", json!({ "componentType": 5126, "count": 10_000_000, "type": "SCALAR" }));
    let channel = json!({ "sampler": 0, "target": { "node": 0, "path": "weights" } });
    let channels: Vec<Value> = (0..100).map(|_| channel.clone()).collect();
    file.json["animations"] =
        json!([{ "channels": channels, "samplers": [{ "input": input, "output": output }] }]);
    let error = file.try_load(&plain()).unwrap_err();
    assert!(error.contains("more than the"), "{error}");
}

/// Transforms that leave all that f64 can hold, at some time or at the start.
#[test]
fn places_beyond_all_numbers_are_no_panic() {
    for largest in [f32::MAX, 1e20] {
        let mut file = strip_of(largest);
        for start_s in [0.0, 0.5, 1.0] {
            file.json["asset"]["generator"] = json!(start_s);
            let options = beamcast::scene::gltf::Options { start_s, ..plain() };
            if let Ok(loaded) = file.try_load(&options) {
                for time in [0.0, 0.3, 0.7, 1.0] {
                    let _ = world_at(&loaded.scene, time);
                }
            }
        }
    }
}

fn strip_of(largest: f32) -> File {
    let mut file = super::strip();
    file.animate("away", &[(1, "scale", "LINEAR", &[0.0, 1.0], &[1.0, 1.0, 1.0, largest, largest, largest])]);
    file.animate("off", &[(2, "scale", "LINEAR", &[0.0, 1.0], &[1.0, 1.0, 1.0, largest, 0.0, largest])]);
    file.animate("out", &[(3, "scale", "LINEAR", &[0.0, 1.0], &[1.0, 1.0, 1.0, largest, largest, largest])]);
    file.animate(
        "far",
        &[(2, "translation", "LINEAR", &[0.0, 1.0], &[0.0, 0.0, 0.0, largest, largest, -largest])],
    );
    file
}
