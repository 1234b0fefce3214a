//! Values that a job draws at random: the same for the same seed, frame and key, and nothing else.

use std::path::{Path, PathBuf};

use beamcast::config::{self, Job};
use beamcast::error::Error;
use beamcast::motion::Trajectory;

/// The sensors and the output of the jobs here.
const RIG: &str = "\
[trajectory]
pose = { position_m = [0.0, 0.0, 0.0], rpy_deg = [0.0, 0.0, 0.0] }
[[sensor]]
name = \"top\"
pose = { position_m = [0.0, 0.0, 1.5] }
[sensor.rotating]
elevations_deg = [-5.0, 0.0, 5.0]
columns = 36
rate_hz = 10.0
[sensor.range]
min_m = 0.1
max_m = 50.0
[[sensor]]
name = \"front\"
pinhole = { width_px = 8, height_px = 6, hfov_deg = 60.0, rate_hz = 10.0 }
[output]
dir = \"out\"
";

/// A folder with a job that draws what is said.
fn folder(random: &str) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for scene in ["room.glb", "street.glb"] {
        std::fs::copy(root.join("scenes").join(scene), folder.path().join(scene)).unwrap();
    }
    let path = folder.path().join("job.toml");
    let text = format!("scene = \"room.glb\"\nseed = 11\nlabels = {{ wall = 3 }}\n{RIG}[random]\n{random}\n");
    std::fs::write(&path, text).unwrap();
    (folder, path)
}

fn load(random: &str, overrides: &[&str]) -> Result<Job, Error> {
    let (_folder, path) = folder(random);
    let overrides: Vec<String> = overrides.iter().map(|pair| (*pair).to_owned()).collect();
    config::load_job(&path, &overrides)
}

fn job(random: &str) -> Job {
    load(random, &[]).unwrap_or_else(|error| panic!("{error}"))
}

/// The problems of a job as `line: message | label | help`.
fn told(error: Error) -> Vec<String> {
    let Error::Config(found) = error else { panic!("{error}") };
    let one = |d: &beamcast::source::Diagnostic| {
        format!("{}: {} | {} | {}", d.line_column().0, d.message, d.label, d.help.as_deref().unwrap_or(""))
    };
    found.iter().map(one).collect()
}

/// A number that a frame drew.
fn number(job: &Job, key: &str) -> f64 {
    job.drawn[key].as_f64().unwrap_or_else(|| panic!("{key}: {:?}", job.drawn))
}

const HEIGHT: &str = "sensor.top.pose.position_m[2]";
const HEIGHT_DRAWN: &str = "\"sensor.top.pose.position_m[2]\" = { uniform = [1.7, 1.9] }\n";

#[test]
fn drawn_values_are_in_the_job_of_their_frame() {
    let random = format!(
        "{HEIGHT_DRAWN}\"trajectory.pose.rpy_deg[2]\" = {{ normal = [90.0, 5.0] }}\n\
         \"sensor.front.trigger_s\" = {{ log_uniform = [1e-4, 1e-2] }}\n\
         \"sensor.top.range.of\" = {{ choice = [\"range\"] }}\n\
         \"labels.wall\" = {{ integer = [3, 9], per = \"run\" }}\n"
    );
    let base = job(&random);
    assert!(base.is_drawn_by_frame());
    let label = base.drawn["labels.wall"].as_u64().unwrap();
    assert_eq!((base.labels["wall"], base.drawn.len()), (label as u32, 1));
    assert_eq!(base.resolved["labels"]["wall"], label);
    assert_eq!(base.sensors[0].body_from_sensor.translation.z, 1.5);
    let mut heights = Vec::new();
    for frame in 0..50 {
        let drawn = base.of_frame(frame).unwrap();
        let height = number(&drawn, HEIGHT);
        assert!((1.7..=1.9).contains(&height));
        assert_eq!(drawn.sensors[0].body_from_sensor.translation.z, height);
        assert_eq!(drawn.sensors[1].trigger_s, number(&drawn, "sensor.front.trigger_s"));
        assert!((1e-4..=1e-2).contains(&drawn.sensors[1].trigger_s));
        let Trajectory::Fixed(pose) = &drawn.trajectory else { panic!("{:?}", drawn.trajectory) };
        let yaw = libm::atan2(pose.rotation.x_axis.y, pose.rotation.x_axis.x).to_degrees();
        assert!((yaw - number(&drawn, "trajectory.pose.rpy_deg[2]")).abs() < 1e-9);
        assert_eq!((drawn.labels["wall"], drawn.drawn.len()), (label as u32, 5));
        assert_eq!(
            (drawn.sensors[0].sensor == base.sensors[0].sensor, drawn.warnings.len()),
            (true, base.warnings.len())
        );
        heights.push(height);
    }
    heights.sort_by(f64::total_cmp);
    heights.dedup();
    assert_eq!(heights.len(), 50);
}

/// A frame is drawn alone as it is among others, whatever else is drawn, and however its key is written in the job.
#[test]
fn a_value_follows_from_seed_frame_and_key_alone() {
    let alone = |frame: u64| job(HEIGHT_DRAWN).of_frame(frame).unwrap().into_owned().drawn;
    let base = job(HEIGHT_DRAWN);
    let in_order: Vec<_> = (0..20).map(|frame| base.of_frame(frame).unwrap().drawn.clone()).collect();
    assert_eq!(in_order[7], alone(7));
    assert_eq!(base.of_frame(731).unwrap().drawn, alone(731));
    let more = job(&format!("\"labels.wall\" = {{ integer = [1, 9] }}\n{HEIGHT_DRAWN}"));
    assert_eq!(more.of_frame(731).unwrap().drawn[HEIGHT], alone(731)[HEIGHT]);
    let other = load(HEIGHT_DRAWN, &["seed=12"]).unwrap();
    assert_ne!(other.of_frame(7).unwrap().drawn, alone(7));
    // Any other computer has to give this value, too: it is made of integers, a product and a sum.
    assert_eq!(in_order[0][HEIGHT].as_f64(), Some(FIRST_HEIGHT));
    // Without a key that is drawn for each frame, a job is its own frames' job.
    let of_run = job("\"scene\" = { choice = [\"room.glb\", \"street.glb\"], per = \"run\" }");
    assert!(!of_run.is_drawn_by_frame());
    assert!(matches!(of_run.of_frame(3).unwrap(), std::borrow::Cow::Borrowed(_)));
    assert_eq!(of_run.scene_as_written, of_run.drawn["scene"].as_str().unwrap());
    assert_eq!(of_run.resolved["scene"], of_run.drawn["scene"]);
}

/// The height in frame 0 of a job with the seed 11.
const FIRST_HEIGHT: f64 = 1.802250541546113;

#[test]
fn distributions_that_cannot_be_are_told_at_their_place() {
    // `[random]` is in line 21, and its first key in line 22.
    for (random, expected) in [
        (
            "\"sensor.top.range.max_m\" = { uniform = [-1.0, 60.0] }",
            "22: `sensor.top.range.max_m` can be drawn as -1: `max_m` is -1 | expected a number of metres, greater than 0",
        ),
        ("\"sensor.top.range.max_m\" = { normal = [50.0, 10.0] }", "can be drawn as -35.8"),
        (
            "\"sensor.top.rotating.columns\" = { uniform = [20, 40], per = \"run\" }",
            "`sensor.top.rotating.columns` can be drawn as 20: `columns` is 20.0, a number with a fraction",
        ),
        ("\"sensor.top.rotating.columns\" = { integer = [20, 40] }", "draw it with `per = \"run\"`"),
        (
            "\"sensor.top.rotating.rate_hz\" = { choice = [10, 20] }",
            "all frames of a run have one size and one rate",
        ),
        (
            "\"sensor.top.pose.position_n[2]\" = { uniform = [0, 1] }",
            "the job has no `position_n`, of which an element could be drawn",
        ),
        ("\"sensor.front.pose.position_m[2]\" = { uniform = [0, 1] }", "write `position_m` where it belongs"),
        (
            "\"sensor.tpo.range.max_m\" = { uniform = [5, 9] }",
            "there is no sensor `tpo` | they are numbered 0 to 1 | did you mean `top`?",
        ),
        ("\"sensor.top.range.maxm\" = { uniform = [5, 9] }", "unknown key `maxm`"),
        ("\"range.max_m\" = { uniform = [5, 9] }", "of which sensor?"),
        ("\"sensor.top.pose\" = { uniform = [0, 1] }", "`pose` is 0 | expected a table"),
        ("sensor.top.range.max_m = { uniform = [5, 9] }", "put the whole key in quotes: \"sensor.top…\""),
        ("\"seed\" = { integer = [0, 9] }", "`seed` can't be drawn | all that is drawn follows from it"),
        ("\"sensor.top.name\" = { choice = [\"a\"] }", "a sensor is known before anything is drawn"),
        ("\"output.dir\" = { choice = [\"a\", \"b\"] }", "all frames have this in common"),
        ("\"labels.wall\" = { integer = [1, 2.5] }", "2.5 is no whole number"),
        ("\"labels.wall\" = {}", "the distribution says not what is drawn"),
        (
            "\"labels.wall\" = { integer = [1, 2], choice = [1] }",
            "a distribution has one law, and this has both `integer` and `choice`",
        ),
        ("\"labels.wall\" = { integer = [3, 2] }", "the least is 3 and the most 2"),
        ("\"labels.wall\" = { choice = [] }", "`choice` is an empty list | expected at least one"),
        (
            "\"labels.wall\" = { choice = [1, [2]] }",
            "`choice` has a list of 1 value | expected a number, a string or a flag",
        ),
        ("\"labels.wall\" = { choice = [1, 2], weights = [1] }", "1 weights for 2 values"),
        ("\"labels.wall\" = { choice = [1, 2], weights = [0, 0] }", "the sum of the weights is 0"),
        (
            "\"labels.wall\" = { integer = [1, 2], within = [0, 1] }",
            "`within` goes with `normal`, which is not here",
        ),
        ("\"sensor.top.range.max_m\" = { log_uniform = [0, 9] }", "the least is 0, which has no logarithm"),
        ("\"sensor.top.range.max_m\" = { normal = [9, -1] }", "the standard deviation is -1"),
        (
            "\"sensor.top.range.max_m\" = { normal = [9, 1], within = [14, 20] }",
            "% of the normal distribution lies between 14 and 20",
        ),
        (
            "\"sensor.top.range.max_m\" = { uniform = [5, 9] }\n\"sensor.0.range.max_m\" = { uniform = [5, 9] }",
            "is drawn in the place of",
        ),
        ("\"a..b\" = { uniform = [5, 9] }", "`a..b` is not a key"),
        ("\"labels.wall\" = { integer = [1, 2], per = \"scan\" }", "expected \"frame\" or \"run\""),
    ] {
        let found = told(load(random, &[]).expect_err(random));
        assert!(found.iter().any(|one| one.contains(expected)), "{random}: {found:#?}");
        assert!(
            found.iter().all(|one| one.starts_with("22:") || one.starts_with("23:")),
            "{random}: {found:#?}"
        );
    }
}

/// Each end of each distribution is right, and some frames draw a least range beyond the largest.
#[test]
fn a_frame_whose_values_contradict_each_other_says_which_and_where() {
    let base = job(
        "\"sensor.top.range.min_m\" = { uniform = [0.1, 9.0] }\n\"sensor.top.range.max_m\" = { uniform = [1.0, 10.0] }",
    );
    let mut wrong = 0;
    for frame in 0..100 {
        let error = match base.of_frame(frame) {
            Ok(job) => {
                assert!(job.sensors[0].sensor.range.min_m < job.sensors[0].sensor.range.max_m);
                continue;
            }
            Err(error) => error,
        };
        wrong += 1;
        assert_eq!(error.exit_code(), 2);
        let found = told(error);
        let [one] = found.as_slice() else { panic!("{found:?}") };
        let begins = format!("23: frame {frame} draws `sensor.top.range.max_m = ");
        assert!(one.starts_with(&begins) && one.contains("nothing lies between `min_m` = "), "{one}");
    }
    // With u and v uniform, 0.1 + 8.9 u > 1 + 9 v has the probability (8/8.9)·(8/9)/2 = 0.3995…; five standard errors of 100
    // frames are 24.5.
    assert!((15..=65).contains(&wrong), "{wrong}");
}

/// A scan writes down what it drew. The same seed gives the same bytes, and so does a job that has the drawn value written in
/// the place of what it draws.
#[test]
fn a_scan_writes_down_what_it_drew() {
    let (folder, path) = self::folder(HEIGHT_DRAWN);
    let scan = |path: &Path, more: [&str; 2], out: &str| {
        let out = folder.path().join(out);
        let paths = [&path, &out.as_path()].map(|path| path.to_str().unwrap());
        let done =
            super::cli::command(&["scan", paths[0], "--out", paths[1], more[0], more[1]]).output().unwrap();
        assert!(done.status.success(), "{done:?}");
        let read = |name: &str| std::fs::read(out.join(name)).unwrap();
        let manifest: serde_json::Value = serde_json::from_slice(&read("manifest.json")).unwrap();
        (manifest["drawn"].clone(), read("top/000000.ply"), read("top/000000.exr"))
    };
    let first = scan(&path, ["--seed", "11"], "a");
    let drawn = job(HEIGHT_DRAWN).of_frame(0).unwrap().drawn.clone();
    let height = format!("{HEIGHT}={}", drawn[HEIGHT]);
    assert_eq!(first.0, serde_json::json!({ "0": drawn }));
    assert_eq!(scan(&path, ["--seed", "11"], "b"), first);
    let other = scan(&path, ["--seed", "12"], "c");
    assert!(other.0 != first.0 && other.1 != first.1);
    let several = scan(&path, ["--set", "sequence.frames=3"], "e");
    assert_eq!((&several.0["0"], &several.1), (&first.0["0"], &first.1));
    let third = job(HEIGHT_DRAWN).of_frame(2).unwrap().drawn.clone();
    assert_eq!(
        (several.0.as_object().unwrap().len(), &several.0["2"]),
        (3, &serde_json::Value::Object(third))
    );
    let (_written, path) = self::folder("");
    let written = scan(&path, ["--set", &height], "d");
    assert_eq!((written.0, written.1), (serde_json::Value::Null, first.1));
}

/// What looks at a job's frames casts each with the values that are drawn for it, as a scan does.
#[test]
fn check_diff_and_view_look_at_what_each_frame_drew() {
    let (folder, path) = self::folder(HEIGHT_DRAWN);
    // A beam that goes down tells of the sensor's height.
    let text = std::fs::read_to_string(&path).unwrap().replace("[-5.0, 0.0, 5.0]", "[-40.0, 0.0, 5.0]");
    std::fs::write(&path, format!("{text}[sequence]\nframes = 3\n[check]\nframes = [0, 1]\n")).unwrap();
    let run = |words: &[&str]| {
        let done = super::cli::command(words).current_dir(folder.path()).output().unwrap();
        assert!(done.status.success(), "{words:?}: {done:?}");
        String::from_utf8(done.stdout).unwrap()
    };
    run(&["scan", "job.toml", "--out", "scanned"]);
    let told: serde_json::Value =
        serde_json::from_str(&run(&["diff", "job.toml", "scanned", "--json"])).unwrap();
    assert_eq!((&told["same"], told["pairs"].as_array().unwrap().len()), (&true.into(), 6), "{told}");
    run(&["check", "--accept=job", "job.toml"]);
    run(&["check", "job.toml"]);
    let baseline = |frame: &str| std::fs::read(folder.path().join("job.baseline").join(frame)).unwrap();
    assert_ne!(baseline("top.pixels"), baseline("top@000001.pixels"), "the sensor has another height");
    run(&["view", "job.toml", "-o", "job.html"]);
    run(&["view", "scanned", "-o", "scanned.html"]);
}
