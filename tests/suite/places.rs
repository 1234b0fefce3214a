//! Places that a job draws for its actors: on their surface, where nothing is met, and the same for the same seed, frame and name.

use std::path::{Path, PathBuf};

use beamcast::config::{self, Job};
use beamcast::error::Error;
use beamcast::run::load_scene;
use glam::{DVec2, DVec3};

use super::plausibility::write_scene;

/// A pavement of 20 m by 10 m with a pillar and a house on it, which is closed, and a step of 2 m beside it. The corners are in glTF's
/// axes, and all of it is symmetric about z, so that world's y is like it.
const YARD: &[(&str, [f32; 3], [f32; 3])] = &[
    ("pavement", [-10.0, 0.0, -5.0], [10.0, 0.0, 5.0]),
    ("pillar", [-5.0, 0.0, -1.0], [-4.0, 3.0, 1.0]),
    ("house", [2.0, -1.0, -4.0], [8.0, 4.0, 4.0]),
    ("step", [10.0, -1.0, -5.0], [12.0, 0.0, 5.0]),
];

/// A box 0.8 m long, 0.4 m wide and 1 m tall, whose origin is on the ground and not in its middle.
const BIN: &[(&str, [f32; 3], [f32; 3])] = &[("body", [-0.3, 0.0, -0.2], [0.5, 1.0, 0.2])];

/// A folder with a job of the yard.
fn folder(seed: u64, actors: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    write_scene(&folder.path().join("yard.gltf"), YARD);
    for (name, objects) in [("bin", BIN), ("sunk", &[("body", [-0.2, -0.5, -0.2], [0.2, 0.5, 0.2])])] {
        std::fs::create_dir(folder.path().join(name)).unwrap();
        write_scene(&folder.path().join(name).join("it.gltf"), objects);
    }
    let path = folder.path().join("job.toml");
    let text = format!(
        "scene = \"yard.gltf\"\nseed = {seed}\nlabels = {{ step = 7 }}\n\
         [output]\ndir = \"out\"\n[[sensor]]\nname = \"eye\"\n\
         pose = {{ position_m = [-10.0, 0.0, 9.0], rpy_deg = [0.0, 45.0, 0.0] }}\n\
         pinhole = {{ width_px = 48, height_px = 32, hfov_deg = 100.0, rate_hz = 10.0 }}\n{actors}\n"
    );
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

/// An actor with a place.
fn bin(name: &str, place: &str) -> String {
    format!("[[actor]]\nname = \"{name}\"\nscene = \"bin/it.gltf\"\nplace = {{ {place} }}\n")
}

fn job(seed: u64, actors: &str) -> (tempfile::TempDir, Job) {
    let (folder, path) = folder(seed, actors);
    let job = config::load_job(&path, &[]).unwrap_or_else(|error| panic!("{error}"));
    (folder, job)
}

/// The job of a frame with its places.
fn placed(job: &Job, frame: u64) -> Job {
    let mut job = job.of_frame(frame).unwrap().into_owned();
    load_scene(&mut job, &[]).unwrap_or_else(|error| panic!("{error}"));
    job
}

/// The position and the yaw, in radians, of an actor.
fn place(job: &Job, name: &str) -> (DVec3, f64) {
    let drawn = &job.drawn[&format!("actor.{name}.place")];
    let numbers = |key: &str| [0, 1, 2].map(|i| drawn[key][i].as_f64().unwrap());
    let [roll, pitch, yaw] = numbers("rpy_deg");
    assert_eq!((roll, pitch), (0.0, 0.0));
    (DVec3::from_array(numbers("position_m")), yaw.to_radians())
}

/// Points all over a bin's footprint, at most 0.05 m apart, seen from above.
fn footprint((position, yaw): (DVec3, f64)) -> Vec<DVec2> {
    let (sine, cosine) = (libm::sin(yaw), libm::cos(yaw));
    let points = (0..=16).flat_map(|i| (0..=8).map(move |j| (f64::from(i), f64::from(j))));
    let own = points.map(|(i, j)| (-0.3 + 0.05 * i, -0.2 + 0.05 * j));
    own.map(|(x, y)| position.truncate() + DVec2::new(cosine * x - sine * y, sine * x + cosine * y)).collect()
}

/// The distance from a point to an upright rectangle that is given by its corners.
fn apart(point: DVec2, low: [f64; 2], high: [f64; 2]) -> f64 {
    (DVec2::from_array(low) - point).max(point - DVec2::from_array(high)).max(DVec2::ZERO).length()
}

/// The least distance of two footprints, known to 0.05·√2 m.
fn between(a: &[DVec2], b: &[DVec2]) -> f64 {
    a.iter().flat_map(|p| b.iter().map(move |q| p.distance(*q))).fold(f64::INFINITY, f64::min)
}

/// A bin that goes along the pavement at 2 m/s.
const VAN: &str = "[[actor]]\nname = \"van\"\nscene = \"bin/it.gltf\"\n\
    trajectory = { pose = { position_m = [-9.0, 0.0, 0.0] }, twist = { linear_m_s = [2.0, 0.0, 0.0] } }\n";

#[test]
fn places_lie_on_their_surface_and_meet_nothing() {
    let near = "on = \"pavement\", x_m = [-10.0, 0.0], clearance_m = 0.3";
    let actors = [VAN, &bin("a", near), &bin("b", near), &bin("c", "on_label = 7, yaw_deg = [80.0, 100.0]")];
    let (_folder, job) = job(3, &actors.concat());
    assert!(job.is_drawn_by_frame() && job.has_drawn_scenes());
    let (mut sides, mut yaws) = ([0; 2], Vec::new());
    for frame in 0..40 {
        let job = placed(&job, frame);
        let van = footprint((DVec3::new(-9.0 + 0.2 * frame as f64, 0.0, 0.0), 0.0));
        let [a, b, c] = ["a", "b", "c"].map(|name| place(&job, name));
        for (position, yaw) in [a, b] {
            assert_eq!(position.z, 0.0);
            assert!((-10.0..=0.0).contains(&position.x) && position.y.abs() <= 5.0, "{position}");
            let own = footprint((position, yaw));
            let pillar =
                own.iter().map(|p| apart(*p, [-5.0, -1.0], [-4.0, 1.0])).fold(f64::INFINITY, f64::min);
            assert!(pillar >= 0.3, "frame {frame}: {pillar} m from the pillar");
            assert!(between(&own, &van) >= 0.3, "frame {frame}: {} m from the van", between(&own, &van));
            sides[usize::from(position.y > 0.0)] += 1;
            yaws.push(yaw);
        }
        assert!(between(&footprint(a), &footprint(b)) >= 0.3, "frame {frame}");
        assert_eq!(c.0.z, 0.0);
        assert!((10.0..=12.0).contains(&c.0.x) && (80.0..=100.0).contains(&c.1.to_degrees()), "{c:?}");
    }
    // Each of 80 draws is on either side with the probability 1/2 and faces any way: five standard errors are 22.
    assert!(sides.iter().all(|count| (18..=62).contains(count)), "{sides:?}");
    let backwards = yaws.iter().filter(|yaw| libm::cos(**yaw) < 0.0).count();
    assert!((18..=62).contains(&backwards), "{backwards}");
}

/// A thing in a closed house meets nothing of it, and is not put there. A bin that is 0.2 m and more inside of the house's walls
/// would have met none of them.
#[test]
fn nothing_is_put_into_a_house() {
    let (_folder, job) = job(4, &bin("a", "on = \"pave*\", x_m = [1.0, 9.0]"));
    for frame in 0..60 {
        let (position, _) = place(&placed(&job, frame), "a");
        assert!(apart(position.truncate(), [2.0, -4.0], [8.0, 4.0]) > 0.0, "frame {frame}: {position}");
    }
}

#[test]
fn a_place_follows_from_seed_frame_and_name_and_not_from_what_comes_after() {
    let (a, b) = (bin("a", "on = \"pavement\""), bin("b", "on = \"pavement\", clearance_m = 0.1"));
    let (_one, alone) = job(11, &a);
    let all: Vec<_> = (0..20).map(|frame| place(&placed(&alone, frame), "a")).collect();
    let mut different = all.iter().map(|(position, _)| position.x).collect::<Vec<_>>();
    different.sort_by(f64::total_cmp);
    different.dedup();
    assert_eq!(different.len(), 20);
    let (_two, both) = job(11, &(a.clone() + &b));
    assert_eq!(place(&placed(&both, 7), "a"), all[7]);
    assert_eq!(place(&placed(&alone, 731), "a"), place(&placed(&both, 731), "a"));
    let (_other, other) = job(12, &a);
    assert_ne!(place(&placed(&other, 7), "a"), all[7]);
    // Any other computer has to give this value, too: it is made of integers, products and sums.
    assert_eq!(all[0].0.to_array(), FIRST);
    // What is drawn for the run is the same in all frames, and in the job that is told.
    let (_run, mut of_run) = job(11, &(bin("r", "on = \"pavement\", per = \"run\"") + &a));
    load_scene(&mut of_run, &[]).unwrap();
    let told = &of_run.resolved["actor"][0];
    assert_eq!((&told["trajectory"]["pose"], told.get("place")), (&of_run.drawn["actor.r.place"], None));
    assert!(!of_run.drawn.contains_key("actor.a.place"));
    for frame in [0, 3, 731] {
        let frame = placed(&of_run, frame);
        assert_eq!(frame.drawn["actor.r.place"], of_run.drawn["actor.r.place"]);
        assert_eq!(frame.actors[0].trajectory, of_run.actors[0].trajectory);
    }
    let (_only, only) = job(11, &bin("r", "on = \"pavement\", per = \"run\""));
    assert!(!only.is_drawn_by_frame());
}

/// Values and places are drawn for the same frame, and neither changes the other. What is drawn of a place's own keys holds for it.
#[test]
fn values_and_places_are_drawn_together() {
    let actors = bin("r", "on = \"step\", per = \"run\"") + &bin("a", "on = \"pavement\"");
    let height = "[random]\n\"sensor.eye.pose.position_m[2]\" = { uniform = [8.0, 9.0] }\n";
    let ((_one, mut both), (_two, alone)) = (job(11, &(actors.clone() + height)), job(11, &actors));
    load_scene(&mut both, &[]).unwrap();
    for frame in [0, 5] {
        let (drawn, without) = (placed(&both, frame).drawn, placed(&alone, frame).drawn);
        let keys: Vec<&String> = drawn.keys().collect();
        assert_eq!(keys, ["actor.r.place", "sensor.eye.pose.position_m[2]", "actor.a.place"]);
        assert_eq!(
            (&drawn["actor.a.place"], &drawn["actor.r.place"]),
            (&without["actor.a.place"], &without["actor.r.place"])
        );
    }
    let end = "[random]\n\"actor.a.place.x_m[1]\" = { uniform = [-9.0, -8.0] }\n";
    let (_third, narrow) =
        job(11, &(actors.replace("\"pavement\"", "\"pavement\", x_m = [-10.0, 10.0]") + end));
    for frame in 0..5 {
        let job = placed(&narrow, frame);
        assert!(place(&job, "a").0.x <= job.drawn["actor.a.place.x_m[1]"].as_f64().unwrap());
    }
}

/// Where the bin of the job with the seed 11 stands in frame 0.
const FIRST: [f64; 3] = [0.5435941736815941, 0.9757674984307805, 0.0];

/// A scan writes down where things stand, and a job that has these poses written in the place of what it draws gives the same bytes.
#[test]
fn a_scan_writes_down_its_places_and_they_can_be_written_into_the_job() {
    let actors = bin("a", "on = \"pavement\"")
        + &bin("r", "on = \"step\"").replace("[[actor]]", "[[actor]]\nlabel = 9");
    let (folder, path) = self::folder(5, &format!("{actors}[sequence]\nframes = 3\n"));
    let scan = |path: &Path, more: &[String], out: &str| {
        let out = folder.path().join(out);
        let mut words: Vec<&str> = vec!["scan", path.to_str().unwrap(), "--out", out.to_str().unwrap()];
        words.extend(more.iter().map(String::as_str));
        let done = super::cli::command(&words).output().unwrap();
        assert!(done.status.success(), "{done:?}");
        let read = |name: &str| std::fs::read(out.join(name)).unwrap_or_default();
        let manifest: serde_json::Value = serde_json::from_slice(&read("manifest.json")).unwrap();
        let frames = ["000000", "000002"]
            .map(|frame| ["exr", "ply"].map(|ending| read(&format!("eye/{frame}.{ending}"))));
        (manifest["drawn"].clone(), frames)
    };
    let first = scan(&path, &[], "a");
    assert!(first.1.as_flattened().iter().all(|bytes| !bytes.is_empty()));
    assert!(scan(&path, &["--threads".to_owned(), "1".to_owned()], "b") == first);
    assert!(first.1[0] != first.1[1], "the frames have other places");
    for (frame, of_frame) in [("0", &first.1[0]), ("2", &first.1[1])] {
        let written = ["a", "r"].map(|name| {
            let pose = &first.0[frame][format!("actor.{name}.place")];
            let (position, turn) = (&pose["position_m"], &pose["rpy_deg"]);
            format!("actor.{name}.trajectory={{ pose = {{ position_m = {position}, rpy_deg = {turn} }} }}")
        });
        let more = written.into_iter().flat_map(|pair| ["--set".to_owned(), pair]).collect::<Vec<_>>();
        let (drawn, frames) = scan(&path, &more, &format!("written{frame}"));
        assert_eq!(drawn, serde_json::Value::Null);
        assert!(&frames[usize::from(frame == "2")] == of_frame, "frame {frame} differs");
    }
    // What looks at a job's frames casts each with its places.
    let scanned = folder.path().join("a");
    let same = super::cli::command(&["diff", path.to_str().unwrap(), scanned.to_str().unwrap()]).output();
    assert!(same.unwrap().status.success());
}

/// Problems of a job and of its places, as `line: message | label | help`.
fn told(actors: &str) -> Vec<String> {
    let (_folder, path) = folder(1, actors);
    let error = match config::load_job(&path, &[]) {
        Ok(mut job) => load_scene(&mut job, &[]).expect_err(actors),
        Err(error) => error,
    };
    assert_eq!(error.exit_code(), 2, "{error}");
    let Error::Config(found) = error else { panic!("{error}") };
    let one = |d: &beamcast::source::Diagnostic| {
        format!("{}: {} | {} | {}", d.line_column().0, d.message, d.label, d.help.as_deref().unwrap_or(""))
    };
    found.iter().map(one).collect()
}

#[test]
fn places_that_cannot_be_are_told_where_the_job_names_them() {
    // The first actor begins in line 10, and its place is in line 13.
    let node = "[[actor]]\nname = \"a\"\nnode = \"pillar\"\nplace = { on = \"pavement\" }";
    let sunk = bin("a", "on = \"pavement\"").replace("bin/it", "sunk/it");
    let both = bin("a", "on = \"pavement\"") + "trajectory = {}";
    let late = bin("z", "on = \"step\"") + &bin("a", "on = \"pavement\", per = \"run\"");
    for (actors, expected) in [
        (
            bin("a", "on = \"pavment\""),
            "13: the scene has no surface `pavment` for actor `a` |  | did you mean `pavement`?",
        ),
        (bin("a", "on = \"lawn\""), "are called `house`, `pavement`, `pillar` and `step`"),
        (
            bin("a", "on_label = 3"),
            "has no surface with the label 3 for actor `a` |  | its labels are 0 and 7",
        ),
        (bin("a", "on = \"pavement\", x_m = [20, 30]"), "| it goes from -10.000 to 10.000 m in x"),
        (bin("a", "on = \"pavement\", x_m = [3, 4], y_m = [-1, 1]"), "do the walls of a room face outwards?"),
        (
            bin("a", "on = \"pavement\", x_m = [-4.05, -4.0], y_m = [0, 0.1]"),
            "13: actor `a` finds no place on the surface `pavement`: of 1000 attempts, 1000 met the scene, 0 another actor",
        ),
        (
            bin("b", "on = \"step\", x_m = [10, 10.1], y_m = [0, 0.1], clearance_m = 1.5")
                + &bin("a", "on = \"pavement\", x_m = [9.9, 10], y_m = [0, 0.1]"),
            "17: actor `a` finds no place on the surface `pavement`: of 1000 attempts, 0 met the scene, 1000 another actor",
        ),
        (sunk, "13: actor `a` reaches 0.500 m below its own origin"),
        (node.to_owned(), "13: a place is drawn for a file, and this is a node of the scene"),
        (both, "14: an actor has a trajectory or stands at a place that is drawn, and this has both"),
        (
            bin("a", "on = \"step\"").replace("place", "#"),
            "10: `[[actor]]` has no `trajectory` | needs `trajectory` or `place`",
        ),
        (bin("a", "clearance_m = 1.0"), "13: the place has no surface | needs `on` or `on_label`"),
        (bin("a", "on = \"step\", on_label = 7"), "this has both `on` and `on_label`"),
        (
            bin("a", "on = \"step\", yaw_deg = [10, -10]"),
            "`yaw_deg` goes from 10 to -10 | expected the least first",
        ),
        (bin("a", "on = \"step\", clearance_m = -1"), "`clearance_m` is -1"),
        (bin("a", "on = \"step\", clearence_m = 1"), "did you mean `clearance_m`"),
        (late, "17: the place of `a` is drawn once, and that of `z` before it for each frame"),
    ] {
        let found = told(&actors);
        assert!(found.iter().any(|one| one.contains(expected)), "{actors}\n{found:#?}");
    }
    let (_folder, path) = folder(1, &bin("a", "on = \"pavement\""));
    let error = config::load_job(&path, &["up=y".to_owned()]).unwrap_err().to_string();
    assert!(error.contains("with `up = \"y\"` the scene does not stand upright"), "{error}");
}

/// `lint` reads the scene, and so tells of a surface that is not there; a frame without a place tells which frame it is.
#[test]
fn lint_and_frames_tell_of_places() {
    let (_folder, path) = folder(1, &bin("a", "on = \"pavment\""));
    let done = super::cli::command(&["lint", path.to_str().unwrap()]).output().unwrap();
    let said = String::from_utf8_lossy(&done.stderr).into_owned();
    assert_eq!(done.status.code(), Some(2), "{said}");
    assert!(said.contains("did you mean `pavement`?") && said.contains("job.toml:13"), "{said}");
    let (_other, job) = job(1, &bin("a", "on = \"pavement\", x_m = [-4.05, -4.0], y_m = [0, 0.1]"));
    let mut of_frame = job.of_frame(31).unwrap().into_owned();
    let error = load_scene(&mut of_frame, &[]).unwrap_err().to_string();
    assert!(error.contains("in frame 31"), "{error}");
}
