//! `beamcast explain`: the story of one pulse has the returns of the frame, and says where they come from.

use std::fs;
use std::path::Path;

use beamcast::glam::DVec3;
use beamcast::motion::Trajectory;
use beamcast::physics::detection::{RangePair, Sensitivity};
use beamcast::physics::footprint::Samples;
use beamcast::scan::{Echo, Fate, Return, Story, explain};
use beamcast::scene::{Sun, Weather};
use beamcast::sensor::{Blooming, Footprint, Measurement, Noise, Receiver, ReturnMode};
use beamcast::trace::Tracer;
use beamcast::{
    Angle, Camera, Capture, Cause, Frame, Pattern, Pose, Progress, RangeLimits, Scene, Sensor, scan,
};
use serde_json::Value;

use super::plates::{Plate, scene};

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// A post before a wall, something very near and something very far, and gaps between them.
fn street() -> Scene {
    let square = |middle, half, rho| Plate(middle, DVec3::Y * half, DVec3::Z * half, rho);
    scene(&[
        square(DVec3::new(20.0, 0.0, 0.0), 5.0, 0.5),
        square(DVec3::new(8.0, 0.6, 0.2), 0.8, 0.1),
        square(DVec3::new(0.3, -0.13, 0.05), 0.03, 0.4),
        square(DVec3::new(300.0, 60.0, 0.0), 40.0, 0.9),
    ])
}

/// A camera whose image is more than one band high, so that its pixels lie in different strips.
fn sensor(measurement: Measurement) -> Sensor {
    let camera = Camera::from_hfov((14, 11), Angle::deg(50.0), None).unwrap();
    let range = RangeLimits { min_m: 0.5, max_m: 250.0, ..RangeLimits::default() };
    Sensor { range, measurement, ..Sensor::new(Pattern::Camera(camera)) }
}

fn receiver() -> Receiver {
    let range_pairs = vec![RangePair { reflectivity: 0.1, range_m: 40.0 }];
    let sensitivity = Sensitivity::fit(&range_pairs);
    let (returns, separation_m) = (ReturnMode::Dual, 1.0);
    Receiver { range_pairs, sensitivity, false_alarm: 0.05, returns, separation_m, ..Receiver::default() }
}

fn footprint(mrad: f64) -> Option<Footprint> {
    let half_divergence = [Angle::rad(0.5e-3 * mrad); 2];
    Some(Footprint { half_divergence, exit_radius_m: 0.005, samples: Samples::Seven })
}

fn noise() -> Noise {
    Noise {
        range_floor_m: 0.01,
        range_a_m: 0.05,
        bias_m: 0.02,
        gain: 0.1,
        angle: Angle::deg(0.2),
        beam_angle: Angle::deg(0.1),
        range_unit_m: 0.004,
        ..Noise::default()
    }
}

/// The returns of a frame's pixel, or what blocks its beam.
fn of_frame(frame: &Frame, pixel: usize) -> (Vec<(Return, Option<Echo>)>, Option<Return>) {
    let slots = frame.slots(pixel);
    let returns = slots.map(|slot| (frame.returns().get(slot), frame.echo(slot).copied())).collect();
    (returns, frame.blocker(pixel))
}

/// Compares the story of every pixel of a frame with the frame. Returns the stories.
fn stories_of(scene: &Scene, sensor: &Sensor) -> Vec<Story> {
    let trajectory = Trajectory::Fixed(Pose::from_rpy(
        DVec3::new(0.0, 0.01, 0.02),
        Angle::deg(3.0),
        Angle::deg(0.3),
        Angle::deg(0.4),
    ));
    let tracer = Tracer::build(scene);
    let capture = Capture::new(sensor, Pose::IDENTITY, &trajectory, 3, 11);
    let frame = scan(scene, &tracer, &capture, &Progress::default()).unwrap();
    let mut stories = Vec::new();
    for pixel in 0..frame.pixels() {
        let (row, column) = (pixel / frame.columns(), pixel % frame.columns());
        let story = explain(scene, &tracer, &capture, row, column).unwrap();
        let told = (story.returns.clone(), story.blocker.map(|(one, _)| one));
        // `Debug` of an f64 tells apart all that differ by a bit, and −0 from 0.
        assert_eq!(format!("{told:?}"), format!("{:?}", of_frame(&frame, pixel)), "{row}, {column}");
        assert_eq!(story.cause, frame.causes()[pixel], "{row}, {column}");
        if let Some(signal) = &story.signal {
            let returned = signal.peaks.iter().filter(|peak| matches!(peak.fate, Fate::Returned(_)));
            assert_eq!(returned.count(), story.returns.len(), "each return has a peak: {row}, {column}");
        }
        stories.push(story);
    }
    let beyond = [(frame.rows(), 0), (0, frame.columns())];
    assert!(beyond.iter().all(|&(row, column)| explain(scene, &tracer, &capture, row, column).is_none()));
    stories
}

fn causes(stories: &[Story]) -> Vec<Cause> {
    let mut causes: Vec<Cause> = stories.iter().map(|story| story.cause).collect();
    causes.sort();
    causes.dedup();
    causes
}

#[test]
fn an_ideal_sensors_stories_have_the_returns_of_its_frame() {
    let stories = stories_of(&street(), &sensor(Measurement::default()));
    assert_eq!(causes(&stories), [Cause::Surface, Cause::Nothing, Cause::TooNear, Cause::OutOfRange]);
    for story in &stories {
        assert!(story.signal.is_none() && story.met.len() + story.lost_rays == 1);
        if let [(one, None)] = story.returns.as_slice() {
            assert_eq!((story.met[0].object, story.met[0].range_m), (Some(one.instance), [one.range_m; 2]));
            assert_eq!(story.met[0].material, story.met[0].object, "each square has a material of its own");
        }
    }
}

#[test]
fn a_measured_pulses_story_has_the_returns_of_its_frame() {
    let measurement =
        Measurement { footprint: footprint(20.0), receiver: Some(receiver()), ..Measurement::default() };
    let noisy = Measurement { noise: Some(noise()), ..measurement.clone() };
    for measurement in
        [Measurement { footprint: footprint(3.0), ..Measurement::default() }, measurement, noisy]
    {
        let stories = stories_of(&street(), &sensor(measurement));
        assert!(causes(&stories).len() > 3);
        for story in &stories {
            let whole: f64 = story.met.iter().map(|met| met.share).sum();
            assert!(story.met.is_empty() || (whole - 1.0).abs() < 1e-12);
            assert!(story.met.iter().all(|met| met.transmission == 1.0), "the air is clear");
        }
    }
}

/// Weather, sunlight and halos of other pixels' light are part of a story as they are of a frame.
#[test]
fn weather_sun_and_blooming_are_in_a_story_as_in_its_frame() {
    let mut scene = street();
    scene.environment.weather =
        Some(Weather { visibility_m: Some(300.0), rain_mm_h: 80.0, ..Weather::default() });
    scene.environment.sun = Some(Sun { klx: 80.0, direction: DVec3::new(-0.6, 0.0, 0.8) });
    let blooming = Blooming {
        core: Angle::deg(2.0),
        halo: 0.05,
        halo_angle: Angle::deg(2.0),
        exponent: 2.0,
        reach: Angle::deg(12.0),
    };
    let measurement = Measurement {
        footprint: footprint(20.0),
        receiver: Some(receiver()),
        noise: Some(noise()),
        blooming: Some(blooming),
        depth: None,
    };
    let stories = stories_of(&scene, &sensor(measurement));
    let met = |cause| stories.iter().flat_map(|story| &story.met).filter(|met| met.cause == cause).count();
    assert!(met(Cause::Rain) > 0 && met(Cause::Fog) > 0 && met(Cause::Blooming) > 0);
    assert!(stories.iter().flat_map(|story| &story.met).all(|met| met.transmission <= 1.0));
    assert!(stories.iter().flat_map(|s| &s.returns).any(|(_, echo)| echo.is_some_and(|e| e.ambient > 0.0)));
}

/// A plate 12 m along y covers half of the beam, and a wall at 12.2 m the rest.
const EDGE: &str = r#"{"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1]}],
    "nodes": [{"name": "plate", "mesh": 0, "translation": [1.0, 0.0, -12.0]},
              {"name": "wall\u001b[2J\n::error::x", "mesh": 1, "translation": [0.0, 0.0, -12.2], "scale": [9.0, 9.0, 1.0]}],
    "materials": [{"name": "paint"}, {"name": "plaster"}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]},
               {"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 1}]}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [-1, -1, 0], "max": [1, 1, 0]},
                  {"bufferView": 1, "componentType": 5121, "count": 6, "type": "SCALAR"}],
    "bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 6}],
    "buffers": [{"byteLength": 54, "uri": "data:application/octet-stream;base64,BUFFER"}]}"#;

/// Writes a job with its scene: beams at 0° and 45° of elevation, towards the edge of the plate and at nothing.
fn write_job(folder: &Path, more: &str) {
    // The corners of a square as f32, and its two triangles.
    let buffer = "AACAvwAAgL8AAAAAAACAPwAAgL8AAAAAAACAPwAAgD8AAAAAAACAvwAAgD8AAAAAAAECAAID";
    fs::write(folder.join("edge.gltf"), EDGE.replace("BUFFER", buffer)).unwrap();
    let job = format!(
        "scene = \"edge.gltf\"\n[labels]\nplate = 5\n\
         [[sensor]]\nname = \"top\"\npose = {{ rpy_deg = [0.0, 0.0, 90.0] }}\n\
         [sensor.rotating]\nelevations_deg = [45.0, 0.0]\ncolumns = 4\nrate_hz = 10.0\n\
         [sensor.range]\nmax_m = 100.0\n{more}\
         [output]\ndir = \"out\"\n"
    );
    fs::write(folder.join("job.toml"), job).unwrap();
}

const MEASURED: &str = "[sensor.footprint]\ndivergence_mrad = [3.0, 3.0]\nkind = \"1/e2\"\n\
                        [sensor.receiver]\nrange_pairs = [[0.1, 90.0]]\n";

/// The exit code, the output and the messages of the program in a folder.
fn program(folder: &Path, args: &[&str]) -> (i32, String, String) {
    let output = super::cli::program().arg("explain").args(args).current_dir(folder).output().unwrap();
    let [out, err] = [&output.stdout, &output.stderr].map(|text| String::from_utf8(text.clone()).unwrap());
    (super::cli::code(&output), out, err)
}

/// The sentences of a story.
fn sentences(folder: &Path, args: &[&str]) -> Vec<String> {
    let (code, out, err) = program(folder, &[args, &["--json"]].concat());
    assert_eq!(code, 0, "{err}");
    let story: Value = serde_json::from_str(&out).unwrap();
    story["story"].as_array().unwrap().iter().map(|line| line.as_str().unwrap().to_owned()).collect()
}

#[test]
fn a_mixed_pixels_story_names_both_surfaces() {
    let folder = tempfile::tempdir().unwrap();
    write_job(folder.path(), MEASURED);
    let lines = sentences(folder.path(), &["job.toml", "1", "2"]);
    let text = lines.join("\n");
    for part in [
        "towards azimuth 0.00° and elevation 0.00°",
        "sub-rays meet `plate` (material `paint`, label 5 of `plate`) at 12.000 m; its light has",
        "sub-rays meet `wall\\u{1b}[2J\\n::error::x` (material `plaster`) at 12.200 m; its light has",
        "The receiver detects what is above a signal-to-noise ratio of",
        "It becomes the return.",
        "The cause is `mixed`: the light of several surfaces makes one return, which may lie between them.",
    ] {
        assert!(text.contains(part), "{part:?} in:\n{text}");
    }
    assert_eq!(lines.iter().filter(|line| line.starts_with("The sensor reports ")).count(), 1);
    // The text has the same sentences and a plot, and nothing that a terminal or a CI server acts on.
    let (code, out, _) = program(folder.path(), &["job.toml", "1", "2"]);
    assert_eq!(code, 0);
    assert!(
        out.starts_with("Row 1, column 2 of sensor `top`, frame 0\n\nThe pulse leaves at 0.0500 s"),
        "{out}"
    );
    for part in ["┄ threshold   ▲ return\n", "signal-to-noise ratio\n", "█", " m\n"] {
        assert!(out.contains(part), "{part:?} in:\n{out}");
    }
    assert!(!out.contains('\u{1b}') && !out.lines().any(|line| line.trim_start().starts_with("::")));
}

#[test]
fn a_pixel_without_a_return_says_why() {
    let folder = tempfile::tempdir().unwrap();
    let last = |more: &str, place: [&str; 2]| {
        write_job(folder.path(), more);
        sentences(folder.path(), &["job.toml", place[0], place[1]]).pop().unwrap()
    };
    let nothing = "The pixel has no return, because the pulse meets nothing that sends light back. The cause is `nothing`.";
    assert_eq!(last("", ["0", "2"]), nothing);
    assert_eq!(last(MEASURED, ["0", "2"]), nothing);
    let far = "The pixel has no return, because the surface is farther than the sensor's largest range of 11.0 m. The cause is \
               `out_of_range`.";
    let near = "The pixel has no return, because a surface at 12.000 m is nearer than the sensor's least range of 13.0 m and blocks \
                the beam. The cause is `too_near`.";
    for (limits, text) in [("max_m=11", far), ("min_m=13", near)] {
        write_job(folder.path(), "");
        let change = format!("sensor.top.range.{limits}");
        let turned = "sensor.top.pose={ rpy_deg = [0.0, 0.0, 88.0] }";
        let args = ["job.toml", "1", "2", "--set", &change, "--set", turned];
        assert_eq!(sentences(folder.path(), &args).pop().unwrap().replace("12.007", "12.000"), text);
    }
    let faint = last(&MEASURED.replace("90.0", "0.5"), ["1", "2"]);
    let below = "The pixel has no return, because too little light comes back to be detected. The cause is `below_threshold`.";
    assert_eq!(faint, below);
}

#[test]
fn files_have_the_waveform() {
    let folder = tempfile::tempdir().unwrap();
    write_job(folder.path(), MEASURED);
    let args = ["job.toml", "1", "2", "--svg", "a.svg", "--csv", "a.csv"];
    let (code, _, err) = program(folder.path(), &args);
    assert_eq!(code, 0, "{err}");
    assert!(err.contains("wrote a.svg (") && err.contains("wrote a.csv ("), "{err}");
    let svg = fs::read_to_string(folder.path().join("a.svg")).unwrap();
    let mut reader = quick_xml::Reader::from_str(&svg);
    reader.config_mut().check_end_names = true;
    let mut elements = Vec::new();
    loop {
        match reader.read_event().unwrap() {
            quick_xml::events::Event::Eof => break,
            quick_xml::events::Event::Start(e) | quick_xml::events::Event::Empty(e) => {
                assert!(e.attributes().all(|attribute| attribute.is_ok()));
                elements.push(e.name().as_ref().to_owned());
            }
            _ => {}
        }
    }
    assert_eq!(elements[0], "svg");
    assert!(elements.iter().all(|name| name != "script" && name != "image"));
    for part in ["range in metres", "signal-to-noise ratio", "threshold ", "return at 12."] {
        assert!(svg.contains(part), "{part}");
    }
    let csv = fs::read_to_string(folder.path().join("a.csv")).unwrap();
    let rows: Vec<Vec<f64>> = csv
        .lines()
        .skip(1)
        .map(|line| line.split(',').map(|value| value.parse().unwrap()).collect())
        .collect();
    assert!(csv.starts_with("range_m,snr\n") && rows.len() > 100);
    assert!(rows.is_sorted_by(|a, b| a[0] < b[0]));
    let highest = rows.iter().max_by(|a, b| a[1].total_cmp(&b[1])).unwrap();
    assert!((12.0..12.2).contains(&highest[0]), "{highest:?}");
    // What is there is kept, unless told otherwise.
    let (code, _, err) = program(folder.path(), &args);
    assert_eq!((code, err.as_str()), (4, "error: a.svg: is there already (--overwrite replaces it)\n"));
    assert_eq!(program(folder.path(), &[&args[..], &["--overwrite"]].concat()).0, 0);
    // Without light, the waveform is flat.
    let (code, _, err) = program(folder.path(), &["job.toml", "0", "2", "--svg", "b.svg", "--csv", "b.csv"]);
    assert_eq!(code, 0, "{err}");
    assert!(fs::read_to_string(folder.path().join("b.csv")).unwrap().ends_with("100.00000,0.000000e0\n"));
}

#[test]
fn what_there_is_not_is_told_with_what_there_is() {
    let folder = tempfile::tempdir().unwrap();
    write_job(folder.path(), "");
    let error = |args: &[&str]| {
        let (code, out, err) = program(folder.path(), &[&["job.toml"], args].concat());
        assert_eq!((code, out.as_str()), (2, ""), "{args:?}: {err}");
        err
    };
    for (args, problem) in [
        (vec!["2", "0"], "sensor `top` has no row 2: its rows are 0 to 1"),
        (vec!["0", "4"], "sensor `top` has no column 4: its columns are 0 to 3"),
        (vec!["0", "0", "--frame", "1"], "sensor `top` has no frame 1: its only frame is 0"),
        (
            vec!["0", "0", "--frame", "3", "--set", "sequence.frames=3"],
            "sensor `top` has no frame 3: its frames are 0 to 2",
        ),
        (vec!["0", "0", "--sensor", "roof"], "the job has no sensor `roof`: its sensor is `top`"),
        (
            vec!["0", "0", "--svg", "a.svg"],
            "sensor `top` is ideal and has no waveform to write: a table [sensor.receiver] or `nominal = true` gives it one",
        ),
    ] {
        assert_eq!(error(&args), format!("error: {problem}\n"));
    }
    let job = fs::read_to_string(folder.path().join("job.toml")).unwrap();
    let second = "[[sensor]]\nname = \"rear\"\npose = { rpy_deg = [0.0, 0.0, 90.0] }\n\
                  [sensor.rotating]\nelevations_deg = [0.0]\ncolumns = 4\nrate_hz = 10.0\n[output]";
    fs::write(folder.path().join("job.toml"), job.replace("[output]", second)).unwrap();
    let several = "error: the job has several sensors: --sensor chooses `top` or `rear`\n";
    assert_eq!(error(&["0", "0"]), several);
    let other = "error: the job has no sensor `side`: its sensors are `top` and `rear`\n";
    assert_eq!(error(&["0", "0", "--sensor", "side"]), other);
    let (code, out, err) = program(folder.path(), &["job.toml", "0", "2", "--sensor", "rear"]);
    assert_eq!(code, 0, "{err}");
    assert!(out.contains("The sensor is ideal: its beam has no width"), "{out}");
}

/// The frames of a drive are told as they are cast: what moves is where it is at the pulse's own time.
#[test]
fn what_moves_is_met_where_it_is_at_the_pulses_time() {
    let job = beamcast::load_job(
        &Path::new(ROOT).join("configs/street_drive.toml"),
        &["sensor.roof.rotating.columns=24".to_owned()],
    );
    let mut job = job.unwrap();
    let scene = beamcast::run::load_scene(&mut job, &[]).unwrap().scene;
    let session = beamcast::Session::open(job, &scene);
    let item = beamcast::run::Item { sensor: 0, frame: 40, outputs: vec![] };
    let frame = session.cast(&item, &Progress::default()).unwrap();
    for pixel in (0..frame.pixels()).step_by(37) {
        let story = session.explain(&item, pixel / frame.columns(), pixel % frame.columns()).unwrap();
        assert_eq!((story.returns, story.blocker.map(|(one, _)| one)), of_frame(&frame, pixel));
    }
}
