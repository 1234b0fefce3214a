//! Sequences in `check`, `diff` and `view`: which frames are looked at, what is told of them, and that no frame is told wrongly.

use std::borrow::Cow;
use std::fs;
use std::path::Path;

use beamcast::check::{Outcome, Verdict};
use beamcast::config;
use beamcast::frame::Pose;
use beamcast::motion::Trajectory;
use beamcast::run::checking::{self, CastFrame, Purpose, Run};
use beamcast::run::{Item, Session, load_scene};
use beamcast::scan::Progress;
use glam::DVec3;
use serde_json::{Value, json};
use tempfile::TempDir;

/// A wall 10 m ahead, 40 m wide, in a scene of its own.
fn write_wall(folder: &Path) {
    let corners = [[10.0, -20.0, -20.0], [10.0, 20.0, -20.0], [10.0, 0.0, 40.0_f32]];
    // glTF's y is up.
    let gltf: Vec<[f32; 3]> = corners.iter().map(|[x, y, z]| [*x, *z, -*y]).collect();
    let bytes: Vec<u8> = gltf.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
    fs::write(folder.join("wall.bin"), &bytes).unwrap();
    let scene = json!({
        "asset": { "version": "2.0" }, "scene": 0, "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0, "name": "wall", "extras": { "label": 3 } }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "accessors": [{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
                        "min": [10, -20, -20], "max": [10, 40, 20] }],
        "bufferViews": [{ "buffer": 0, "byteLength": bytes.len() }],
        "buffers": [{ "uri": "wall.bin", "byteLength": bytes.len() }],
    });
    fs::write(folder.join("wall.gltf"), scene.to_string()).unwrap();
}

/// A job of a prism scanner, whose pattern does not repeat, so that every frame is another one.
fn scanner(frames: u64, more: &str) -> String {
    format!(
        "scene = \"wall.gltf\"\n\
         [[sensor]]\nname = \"top\"\n\
         [sensor.risley]\n\
         prisms = [{{ rate_hz = -121.6, wedge_deg = 18.7, index = 1.51 }}, {{ rate_hz = 77.7, wedge_deg = 18.0, index = 1.51 }}]\n\
         beams_deg = [[0.0, 0.0]]\npulse_rate_hz = 2000.0\nrate_hz = 10.0\n\
         [sequence]\nframes = {frames}\n\
         [output]\ndir = \"out\"\nformats = [\"exr\", \"ply\"]\n{more}"
    )
}

struct Folder(TempDir);

impl Folder {
    fn of(job: &str) -> Self {
        let folder = Self(tempfile::tempdir().unwrap());
        write_wall(folder.0.path());
        folder.write("job.toml", job);
        folder
    }

    fn write(&self, name: &str, text: &str) {
        fs::write(self.0.path().join(name), text).unwrap();
    }

    fn bytes(&self, name: &str) -> Vec<u8> {
        fs::read(self.0.path().join(name)).unwrap()
    }

    fn read(&self, name: &str) -> String {
        fs::read_to_string(self.0.path().join(name)).unwrap()
    }

    /// Runs the program, which must exit with this code. Gives what it prints on stdout and on stderr.
    #[track_caller]
    fn run(&self, code: i32, args: &[&str]) -> (String, String) {
        let output = super::cli::program().args(args).current_dir(self.0.path()).output().unwrap();
        let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
        let (out, err) = (text(&output.stdout), text(&output.stderr));
        assert_eq!(output.status.code(), Some(code), "{args:?}: {out}{err}");
        (out, err)
    }
}

#[track_caller]
fn has(text: &str, parts: &[&str]) {
    for part in parts {
        assert!(text.contains(part), "no {part:?} in:\n{text}");
    }
}

#[test]
fn a_baseline_has_the_first_the_middle_and_the_last_frame_and_reports_name_them() {
    let folder = Folder::of(&scanner(5, ""));
    has(&folder.run(0, &["check", "--accept", "job.toml"]).0, &["job.toml: accepted"]);
    let mut names: Vec<String> = fs::read_dir(folder.0.path().join("job.baseline"))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    assert_eq!(names, ["baseline.json", "top.pixels", "top@000002.pixels", "top@000004.pixels"]);
    let baseline: Value = serde_json::from_str(&folder.read("job.baseline/baseline.json")).unwrap();
    assert_eq!(baseline["format"], 3);
    let frames: Vec<u64> =
        baseline["sensors"].as_array().unwrap().iter().map(|s| s["frame"].as_u64().unwrap_or(0)).collect();
    assert_eq!(frames, [0, 2, 4]);
    has(&folder.run(0, &["check", "job.toml"]).0, &["job.toml: passed"]);
    assert_eq!(
        folder.run(0, &["check", "--accept", "job.toml"]).0,
        "job.toml: passed\n",
        "nothing to accept"
    );

    // A shorter range changes all frames, and each is told by its number.
    let args =
        ["check", "job.toml", "--set", "sensor.top.range.max_m=10.5", "--junit", "junit.xml", "--json", "-"];
    let (out, err) = folder.run(1, &args);
    let told = [0, 2, 4]
        .map(|frame| format!("sensor top, frame {frame}: range.max_m unset → 10.5: range differs in "));
    has(&err, &told.each_ref().map(String::as_str));
    let json: Value = serde_json::from_str(&out).unwrap();
    let frames: Vec<&Value> =
        json["jobs"][0]["sensors"].as_array().unwrap().iter().map(|s| &s["frame"]).collect();
    assert_eq!(frames, [0, 2, 4]);
    has(&folder.read("junit.xml"), &["tests=\"3\"", "name=\"sensor top, frame 4 is as in its baseline\""]);
}

#[test]
fn frames_that_a_job_chooses_are_compared_and_no_others_are_cast() {
    let folder = Folder::of(&scanner(5, "[check]\nframes = [3, 1, 3]\n"));
    let path = [folder.0.path().join("job.toml")];
    let found = checking::find(&path, &[], false, false);
    // Frames have 200 pulses.
    assert_eq!(found.jobs[0].rays, 2 * 200);
    folder.run(0, &["check", "--accept", "job.toml"]);
    folder.run(0, &["check", "job.toml"]);
    // Of other frames, the baseline says nothing, and both directions are told.
    folder.write("job.toml", &scanner(5, "[check]\nframes = [1, 2]\n"));
    let (out, _) = folder.run(1, &["check", "job.toml"]);
    has(
        &out,
        &[
            "the baseline has no frame 2 of sensor top; `beamcast check --accept job.toml` accepts",
            "frame 3 of sensor top is in the baseline, and the job does not compare it any more; ",
        ],
    );
    // A frame alone is the one that the whole sequence has.
    folder.run(0, &["check", "--accept", "job.toml"]);
    let short = folder.bytes("job.baseline/top@000002.pixels");
    folder.write("job.toml", &scanner(100, "[check]\nframes = [2]\n"));
    folder.run(0, &["check", "--accept", "job.toml"]);
    assert!(short == folder.bytes("job.baseline/top@000002.pixels"));
}

#[test]
fn one_frame_has_the_baseline_that_it_always_had() {
    let folder = Folder::of(&scanner(1, ""));
    folder.run(0, &["check", "--accept", "job.toml"]);
    let baseline = folder.read("job.baseline/baseline.json");
    has(&baseline, &["\"format\": 2"]);
    assert!(!baseline.contains("\"frame\""), "{baseline}");
}

/// A LiDAR of three beams drives towards the wall at 15 m/s: in frame k it is 10 m − 1.5 m·k away, and behind it from frame 7 on.
fn drive(expectations: &str) -> Outcome {
    let text = format!(
        "scene = \"wall.gltf\"\n\
         [[sensor]]\nname = \"front\"\n\
         [sensor.rotating]\nelevations_deg = [0.0]\ncolumns = 3\nsector_deg = {{ from = 10.0, to = -10.0 }}\nrate_hz = 10.0\n\
         [sequence]\nframes = 10\nmotion = \"frozen\"\nstart_s = 0.0\n\
         [output]\ndir = \"out\"\n{expectations}"
    );
    let folder = Folder::of(&text);
    let mut job = config::load_job(&folder.0.path().join("job.toml"), &[]).unwrap();
    job.trajectory = Trajectory::Twist {
        start: Pose::IDENTITY,
        linear_m_s: DVec3::new(15.0, 0.0, 0.0),
        angular_rad_s: DVec3::ZERO,
    };
    let scene = load_scene(&mut job, &[]).unwrap().scene;
    let session = Session::open(job, &scene);
    let mut outcome = Outcome::default();
    let mut run = Run::new(&session, &mut outcome, Purpose { page: true, ..Purpose::default() });
    let mut most = 0;
    while let Some(items) = run.next_items() {
        let cast = |item: Item| {
            let frame = session.cast(&item, &Progress::default())?;
            Some(CastFrame { item, session: Cow::Borrowed(&session), frame, ideal: None })
        };
        let frames: Vec<_> = items.into_iter().filter_map(cast).collect();
        most = most.max(frames.len());
        run.take(&frames);
    }
    assert_eq!(most, 1, "one frame at a time");
    run.finish(1.0);
    outcome
}

#[test]
fn expectations_over_a_sequence_agree_with_the_closed_form() {
    // Nearer than 5 m is frame 4 (4 m) to frame 6 (1 m).
    let near = "points = { object = \"wall\", at_least = 3, max_range_m = 5.0 }";
    let expect = |name: &str, keys: &str| format!("[[expect]]\nname = \"{name}\"\n{near}\n{keys}\n");
    let outcome = drive(
        &[
            expect("every frame", ""),
            expect("in range", "frames = { from = 4, to = 6 }"),
            expect("three frames", "min_frames = 3"),
            expect("four frames", "min_frames = 4"),
            expect("soon", "seen_by_s = 0.41"),
            expect("too soon", "seen_by_s = 0.39"),
            expect("soon after frame 2", "frames = { from = 2 }\nseen_by_s = 0.21"),
            expect("steady", "max_flicker = 2"),
            expect("too steady", "max_flicker = 1"),
        ]
        .concat(),
    );
    assert_eq!(outcome.verdict, Verdict::Failed);
    let found = |name: &str| outcome.expectations.iter().find(|e| e.name == name).unwrap();
    for expectation in &outcome.expectations {
        let bad = ["every frame", "four frames", "too soon", "too steady"];
        assert_eq!(expectation.met, !bad.contains(&expectation.name.as_str()), "{expectation:?}");
    }
    let every = found("every frame");
    assert_eq!(
        every.expected,
        "at least 3 points on \"wall\" at a range of at most 5 m in each of 10 frames"
    );
    assert_eq!(
        every.found,
        "0 points, 3 points at other ranges in frame 0; met in 3 of 10 frames, not in frames 0 to 3 and 7 to 9"
    );
    assert_eq!((every.counts.looked_at, every.counts.met, every.counts.changes), (10, 3, 2));
    assert_eq!(found("in range").found, "met in all of 3 frames");
    let seconds = found("soon").counts.first_met_s.unwrap();
    // Starts are quotients of a frame's number and the rate: 4/10 − 0/10.
    assert!((seconds - 0.4).abs() < 1e-15, "{seconds}");
    has(&found("too soon").found, &["first in frame 4, 0.4 s after frame 0"]);
    has(&found("soon after frame 2").expected, &[" in the frames from 2 on, first after 0.21 s at most"]);
    has(&found("too steady").found, &["2 changes at frames 4 and 7"]);
}

#[test]
fn mistakes_about_frames_are_told_at_their_place() {
    let expect = |name: &str, keys: &str| {
        format!("[[expect]]\nname = \"{name}\"\nreturns = {{ at_least = 0.1 }}\n{keys}\n")
    };
    let more = [
        "[check]\nframes = [0, 5]\n".to_owned(),
        expect("a", "frames = { from = 5 }"),
        expect("b", "frames = { from = 3, to = 2 }"),
        expect("c", "frames = { from = 1, to = 2 }\nmin_frames = 3"),
        "[[expect]]\nname = \"d\"\nspeed = { at_least_rays_per_s = 1 }\nmin_frames = 1\n".to_owned(),
    ];
    let folder = Folder::of(&scanner(5, &more.concat()));
    let (_, err) = folder.run(2, &["lint", "job.toml"]);
    has(
        &err,
        &[
            "there is no frame 5",
            "expected a frame from 0 to 4",
            "no frame lies between 3 and 2",
            "`min_frames` is 3, and the expectation looks at 2",
            "`speed` is that of the whole run, and looks at no frames",
        ],
    );
    assert_eq!(err.matches("there is no frame 5").count(), 2, "{err}");
}

#[test]
fn folders_of_many_frames_are_compared_frame_by_frame() {
    let folder = Folder::of(&scanner(20, ""));
    folder.run(0, &["scan", "job.toml", "--out", "a"]);
    folder.run(0, &["scan", "job.toml", "--out", "b", "--set", "sequence.frames=18"]);
    // Of many frames that are the same there is one line.
    let same = folder.run(0, &["diff", "a", "a"]).0;
    assert_eq!(same, "20 pairs: 20 the same, 0 different\n");
    let fewer = folder.run(1, &["diff", "a", "b"]).0;
    has(&fewer, &["18 pairs: 18 the same, 0 different\n", "only a has top/000018 to 000019: 2 frames\n"]);
    folder.run(0, &["diff", "a", "b", "--frames", "0..18"]);
    folder.run(0, &["diff", "a", "job.toml", "--frames", "3..5"]);
    let json: Value = serde_json::from_str(&folder.run(1, &["diff", "b", "a", "--json"]).0).unwrap();
    assert_eq!((&json["only_a"], &json["only_b"]), (&json!([]), &json!(["top/000018", "top/000019"])));
    assert_eq!((&json["totals"]["pairs"], &json["totals"]["same"]), (&json!(18), &json!(18)));

    // One frame of another folder is another one, and it is the one that is told.
    folder.run(0, &["scan", "job.toml", "--out", "c"]);
    fs::copy(folder.0.path().join("c/top/000003.exr"), folder.0.path().join("c/top/000007.exr")).unwrap();
    let differs = folder.run(1, &["diff", "a", "c", "--png", "map.png"]).0;
    has(&differs, &["top/000007: different: ", "20 pairs: 19 the same, 1 different\n", "(top/000007)"]);
    assert!(!differs.contains("top/000006"), "{differs}");
    let pictures: Vec<_> = fs::read_dir(folder.0.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    let pictures: Vec<_> = pictures.iter().filter_map(|name| name.to_str()?.strip_prefix("map.")).collect();
    assert_eq!(pictures, ["top.000007.png"]);
    // Nothing in common is no difference, but a mistake.
    let (_, err) = folder.run(3, &["diff", "a", "b", "--frames", "19.."]);
    has(&err, &["has neither images (EXR, NPZ) nor clouds (PLY, PCD, NPY, LAS, LAZ, E57) of such frames"]);
    folder.run(2, &["diff", "a", "b", "--frames", "5..2"]);
}

/// The data of a page's sections, in order.
fn data(page: &str) -> Vec<Value> {
    let parts = page.split("<script type=\"application/json\">").skip(1);
    parts.map(|part| serde_json::from_str(part.split("</script>").next().unwrap()).unwrap()).collect()
}

#[test]
fn a_page_of_a_sequence_has_its_frames_poses_and_boxes() {
    let folder = Folder::of(&scanner(6, ""));
    let of_job = data(&folder.run(0, &["view", "job.toml", "-o", "-"]).0);
    let moments = of_job[0]["moments"].as_array().unwrap();
    assert_eq!(moments.len(), 6);
    assert_eq!((&moments[4]["frame"], &moments[4]["start_s"]), (&json!(4), &json!(0.4)));
    let frames =
        |data: &[Value]| data.iter().filter(|d| d["channels"].is_array()).cloned().collect::<Vec<_>>();
    assert_eq!(frames(&of_job).len(), 6);
    assert_ne!(
        frames(&of_job)[0]["channels"],
        frames(&of_job)[1]["channels"],
        "each frame has its own values"
    );
    // Some frames, and a single one, which is shown with all its channels.
    let some = data(&folder.run(0, &["view", "job.toml", "--frames", "2..4", "-o", "-"]).0);
    assert_eq!(frames(&some)[0]["channels"], frames(&of_job)[2]["channels"]);
    assert_eq!(some[0]["moments"][1]["frame"], 3);
    let (alone, _) = folder.run(0, &["view", "job.toml", "--frames", "2", "-o", "-"]);
    has(&alone, &["top, frame 2", "\"key\":\"normal.X\""]);
    let (_, err) = folder.run(2, &["view", "job.toml", "--frames", "6", "-o", "-"]);
    has(&err, &["the job has no frame 6: its frames are 0 to 5"]);

    // The same frames, recorded: with a table of poses and one of boxes they are placed in the world.
    folder.run(0, &["scan", "job.toml", "--out", "out"]);
    let recorded = data(&folder.run(0, &["view", "out", "-o", "-"]).0);
    assert_eq!(frames(&recorded)[3]["channels"], frames(&of_job)[3]["channels"]);
    let row = |frame: u64| format!("{frame},top,{}.5,{frame},0,1.8,0,0,0,1,{frame},0,0,0,0,0,1\n", frame);
    let header = "frame,sensor,t_s,x_m,y_m,z_m,qx,qy,qz,qw,body_x_m,body_y_m,body_z_m,body_qx,body_qy,body_qz,body_qw\n";
    folder.write("out/poses.csv", &(header.to_owned() + &(0..6).map(row).collect::<String>()));
    let car = json!({ "frame": 2, "sensor": "top", "name": "car", "label": 4, "length_m": 4.0, "width_m": 2.0, "height_m": 1.5,
                      "in_world": { "centre_m": [9.0, 0.0, 0.7], "quaternion_xyzw": [0.0, 0.0, 0.0, 1.0] } });
    folder.write("out/boxes.jsonl", &format!("{car}\n"));
    let mut manifest: Value = serde_json::from_str(&folder.read("out/manifest.json")).unwrap();
    let outputs = manifest["outputs"].as_array_mut().unwrap();
    outputs.retain(|output| output["path"] != "poses.csv" && output["path"] != "boxes.jsonl");
    outputs.extend(["poses.csv", "boxes.jsonl"].map(|path| json!({ "path": path })));
    folder.write("out/manifest.json", &manifest.to_string());
    let placed = data(&folder.run(0, &["view", "out", "-o", "-"]).0);
    let moments = placed[0]["moments"].as_array().unwrap();
    assert_eq!((&moments[5]["start_s"], &moments[5]["pose"]["matrix"][12]), (&json!(5.5), &json!(5.0)));
    let boxes: Vec<usize> = moments.iter().map(|m| m["boxes"].as_array().unwrap().len()).collect();
    assert_eq!(boxes, [0, 0, 1, 0, 0, 0]);
    let rig = placed.iter().find(|d| d["sensors"].is_array()).unwrap();
    assert_eq!(rig["sensors"][0]["mount"][14], 1.8, "the sensor's place on the body follows from both poses");
    // A broken table is told with its line.
    folder.write("out/boxes.jsonl", "{\"frame\":0,\"sensor\":\"top\"}\n");
    let (_, err) = folder.run(3, &["view", "out", "-o", "-"]);
    has(&err, &["boxes.jsonl", "line 1 is no box"]);
}
