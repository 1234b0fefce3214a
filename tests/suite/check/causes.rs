//! `[[expect]]` about sensors that are not ideal: how often an object is detected, false alarms, and the causes of returns.

use serde_json::json;

use super::*;

/// A wall 90 m ahead, on the left of the x axis only, and nothing else.
fn write_scene(folder: &Path) {
    // Half a step of the beams beside the axis, so that none is at the edge.
    let edge = 90.0 * libm::tan(2.5e-5_f64.to_radians()) as f32;
    let [a, b, c, d] = [[90.0, edge, -5.0], [90.0, 30.0, -5.0], [90.0, 30.0, 5.0], [90.0, edge, 5.0_f32]];
    // glTF's y is up.
    let gltf: Vec<[f32; 3]> = [a, b, c, a, c, d].iter().map(|[x, y, z]| [*x, *z, -*y]).collect();
    let bytes: Vec<u8> = gltf.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
    fs::write(folder.join("wall.bin"), &bytes).unwrap();
    let scene = json!({
        "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0, "name": "wall", "extras": { "label": 3 } }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 6, "type": "VEC3",
                        "min": [90, -5, -30], "max": [90, 5, -edge] }],
        "bufferViews": [{ "buffer": 0, "byteLength": bytes.len() }],
        "buffers": [{ "uri": "wall.bin", "byteLength": bytes.len() }],
    });
    fs::write(folder.join("wall.gltf"), scene.to_string()).unwrap();
}

/// The exit code of a check of a job with a sensor of 10⁴ beams within a degree, the document, and what is printed.
fn check(sensor: &str, more: &str) -> (i32, Value, String) {
    let folder = tempfile::tempdir().unwrap();
    write_scene(folder.path());
    let job = format!(
        "scene = \"wall.gltf\"\nmaterials = {{ wall = {{ kind = \"lambert\", reflectance = 0.1 }} }}\n\
         [output]\ndir = \"out\"\n\
         [[sensor]]\nname = \"top\"\n\
         [sensor.rotating]\nelevations_deg = [0.0]\ncolumns = 10000\n\
         sector_deg = {{ from = 0.5, to = -0.5 }}\nrate_hz = 10.0\n\
         [sensor.range]\nmax_m = 120.0\n{sensor}\n{more}"
    );
    fs::write(folder.path().join("job.toml"), job).unwrap();
    let mut command = crate::cli::program();
    command.args(["check", "job.toml", "--json", "out.json", "--html", "out.html", "--junit", "out.xml"]);
    let output = command.current_dir(folder.path()).output().unwrap();
    let err = String::from_utf8(output.stderr).unwrap() + &String::from_utf8(output.stdout).unwrap();
    let read = |name: &str| fs::read_to_string(folder.path().join(name)).unwrap_or_default();
    let document = serde_json::from_str(&read("out.json")).unwrap_or(Value::Null);
    (output.status.code().unwrap(), document, err + &read("out.xml") + &read("out.html"))
}

/// A receiver that detects the wall half of the time, with a false alarm in a hundred pulses.
const RECEIVER: &str =
    "[sensor.receiver]\nrange_pairs = [[0.1, 90.0]]\nfalse_alarm = 0.01\nreturns = 2\npulse_fwhm_ns = 6.0\n";

fn expect(name: &str, what: &str) -> String {
    format!("[[expect]]\nname = \"{name}\"\n{what}\n")
}

/// Of the 5000 beams at the wall 2500 ± 141 return (4 standard deviations of the binomial distribution), and of all beams 100 ± 40
/// have a false alarm. So 100/2600 of the returns are false alarms, ± 4·√(.0385·.9615/2600) = 1.5 %.
#[test]
fn detection_false_alarms_and_causes_agree_with_the_closed_form() {
    let more = [
        expect("detected", "detection = { object = \"wall\", at_least = 0.472, at_most = 0.528 }"),
        expect("by label", "detection = { label = 3, at_least = 0.472 }\nsensor = \"top\""),
        expect("too rarely", "detection = { object = \"wall\", at_least = 0.54 }"),
        expect("nowhere", "detection = { label = 7, at_least = 0.5 }"),
        expect("few alarms", "false_alarms = { at_most = 140 }"),
        expect("too many alarms", "false_alarms = { at_most = 60 }"),
        expect("alarms", "cause_share = { cause = \"false_alarm\", at_least = 0.023, at_most = 0.054 }"),
        expect("too few mixed", "cause_share = { cause = \"mixed\", at_least = 0.01 }"),
        // Returns that no surface makes are on no object.
        expect("points", "points = { object = \"wall\", at_least = 2359, at_most = 2641 }"),
    ]
    .concat();
    let (code, document, said) = check(RECEIVER, &more);
    assert_eq!(code, 1, "{said}");
    let all = document["jobs"][0]["expectations"].as_array().unwrap();
    for expectation in all {
        let is_bad =
            expectation["name"].as_str().unwrap().starts_with("too") || expectation["name"] == "nowhere";
        assert_eq!(expectation["met"], !is_bad, "{expectation}");
    }
    let found = |name: &str| all.iter().find(|e| e["name"] == name).unwrap();
    let rarely = found("too rarely");
    assert_eq!(rarely["expected"], "at least 54 % of the pulses at \"wall\" return from it");
    assert!(rarely["found"].as_str().unwrap().ends_with(" % of 5000 pulses"), "{rarely}");
    assert!(rarely["place"].as_str().unwrap().ends_with(" of 5000 pulses"), "{rarely}");
    assert_eq!(found("nowhere")["found"], "no pulse would meet it in an ideal scan");
    let many = found("too many alarms");
    assert_eq!(many["expected"], "at most 60 returns of false alarms and interference in a frame");
    assert!(
        many["found"].as_str().unwrap().ends_with(" false alarms and 0 returns of interference"),
        "{many}"
    );
    assert!(found("too few mixed")["found"].as_str().unwrap().starts_with("0 % of "), "{all:#?}");
    has(&said, &["too rarely", "<failure", "of the returns have the cause mixed"]);
}

/// An ideal sensor detects what it meets, and has returns of surfaces alone.
#[test]
fn ideal_sensors_detect_everything_and_have_no_false_alarms() {
    let more = [
        expect("detected", "detection = { object = \"wall\", at_least = 1.0 }"),
        expect("alarms", "false_alarms = { at_most = 0 }"),
        expect("surfaces", "cause_share = { cause = \"surface\", at_least = 1.0 }"),
        expect("rain", "cause_share = { cause = \"rain\", at_most = 0.0 }"),
    ]
    .concat();
    let (code, document, said) = check("", &more);
    assert_eq!(code, 0, "{said}");
    let place = &document["jobs"][0]["expectations"][0]["place"];
    assert_eq!(place, "sensor top: 5000 of 5000 pulses");
}

/// Each frame of a sequence draws anew, and is judged on its own.
#[test]
fn detection_is_held_in_each_frame_of_a_sequence() {
    let more = "[sequence]\nframes = 3\n".to_owned()
        + &expect("each", "detection = { object = \"wall\", at_least = 0.472, at_most = 0.528 }")
        + &expect("two", "detection = { object = \"wall\", at_least = 0.54 }\nmin_frames = 1")
        + &expect("last", "false_alarms = { at_most = 140 }\nframes = { from = 2 }\nsensor = \"top\"");
    let (code, document, said) = check(RECEIVER, &more);
    assert_eq!(code, 1, "{said}");
    let all = &document["jobs"][0]["expectations"];
    let counts = [0, 1, 2].map(|i| (all[i]["frames"].as_u64(), all[i]["frames_met"].as_u64()));
    assert_eq!(counts, [(Some(3), Some(3)), (Some(3), Some(0)), (Some(1), Some(1))]);
}

#[test]
fn mistakes_in_expectations_of_causes_are_told_all_at_once() {
    let more = [
        expect("a", "detection = { object = \"wall\" }"),
        expect("b", "detection = { object = \"wall\", at_least = 0.9, at_most = 0.1 }"),
        expect("c", "false_alarms = { at_least = 1 }"),
        expect("d", "cause_share = { cause = \"mxied\", at_most = 2 }"),
        expect("e", "cause_share = { at_most = 0.1 }"),
    ]
    .concat();
    let (code, _, said) = check(RECEIVER, &more);
    assert_eq!(code, 2, "{said}");
    has(
        &said,
        &[
            "`detection` has no `at_least`",
            "nothing is at least 0.9 and at most 0.1",
            "unknown key `at_least` in `false_alarms`",
            "`false_alarms` has no `at_most`",
            "did you mean \"mixed\"?",
            "expected a part of the whole, from 0 to 1",
            "`cause_share` has no `cause`",
        ],
    );
}
