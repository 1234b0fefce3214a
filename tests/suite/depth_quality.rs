//! The quality report of depth cameras, against closed forms. Each random check states its rate of error and has a fixed seed.

use std::fs;

use beamcast::config;
use beamcast::physics::disparity::StereoPair;
use beamcast::physics::phasor::range_m;
use beamcast::selftest::quality::{Outcome, QualityReport, WallQuality, measure};
use beamcast::sensor::{
    AnalyticDisparity, DepthSensing, Limited, Measurement, Published, Quantity, SecondViewpoint, StatedAt,
    Stereo, StereoMethod, TimeOfFlight,
};
use beamcast::{Camera, Pattern, Progress, RangeLimits, Sensor};
use serde_json::Value;

use super::depth_cameras::time_of_flight;

/// A camera of so many columns and rows, with its limits in depth.
fn camera(size: (usize, usize), focal_px: f64, limits_m: [f64; 2], depth: DepthSensing) -> Sensor {
    let centre = (size.0 as f64 / 2.0, size.1 as f64 / 2.0);
    let camera = Camera::new(size, (focal_px, focal_px), centre, None).unwrap();
    let measurement = Measurement { depth: Some(depth), ..Measurement::default() };
    let range = RangeLimits { min_m: limits_m[0], max_m: limits_m[1], of: Limited::Depth };
    Sensor { range, measurement, ..Sensor::new(Pattern::Camera(camera)) }
}

fn measured(sensor: &Sensor, published: &[Published]) -> QualityReport {
    measure(sensor, published, &Progress::default()).unwrap().unwrap()
}

fn stereo(baseline_m: f64, sigma_px: f64, unit_px: f64) -> DepthSensing {
    let analytic = AnalyticDisparity { sigma_px, window_px: 1, inlier_px: 1.0, inlier_share: 0.3 };
    DepthSensing::Stereo(Stereo {
        second: SecondViewpoint::Imager,
        baseline_m,
        first_disparity_px: 0,
        disparities: 256,
        unit_px,
        method: StereoMethod::Analytic(analytic),
    })
}

fn tof(electrons_at_1_m: f64, taps: u32) -> DepthSensing {
    DepthSensing::TimeOfFlight(TimeOfFlight { electrons_at_1_m, taps, ..time_of_flight(&[20.0, 100.0]) })
}

/// The mean over the middle 40 % of an image of a function of the cosine to the optical axis.
fn over_region(size: (usize, usize), focal_px: f64, of: impl Fn(f64) -> f64) -> f64 {
    let middle = |count: usize| count * 3 / 10..count - count * 3 / 10;
    let offset = |index: usize, count: usize| (index as f64 + 0.5 - count as f64 / 2.0) / focal_px;
    let (mut sum, mut count) = (0.0, 0.0);
    for row in middle(size.1) {
        for column in middle(size.0) {
            let (x, y) = (offset(column, size.0), offset(row, size.1));
            sum += of(1.0 / (1.0 + x * x + y * y).sqrt());
            count += 1.0;
        }
    }
    sum / count
}

/// A camera's disparities have their σ; its depths have Z²·σ/(f·b); and what has no partner in the second image has none. All in ±4
/// standard errors: each is exceeded once in 16,000 seeds.
#[test]
fn an_analytic_stereo_camera_has_the_noise_of_its_keys() {
    let (size, focal_px, sigma_px) = ((400, 100), 430.14, 0.08);
    let pair = StereoPair { focal_px, baseline_m: 0.05015 };
    let report = measured(&camera(size, focal_px, [0.1, 4.4], stereo(pair.baseline_m, sigma_px, 0.0)), &[]);
    assert!(report.passed() && !report.is_textured);
    let distances: Vec<f64> = report.walls.iter().map(|wall| wall.distance_m).collect();
    assert_eq!(distances, [0.11, 0.23, 0.46, 0.95, 1.0, 1.9, 2.0, 4.0]);
    // The tool leaves out half a percent at either end: 1 − 2aφ(a)/.99 of the variance of normal noise is left, with Φ(a) = .995.
    let trimmed = 1.0 - 2.0 * 2.575_829 * 0.014_459_7 / 0.99;
    let sixth = over_region(size, focal_px, |cosine| libm::pow(cosine, 6.0));
    let mut blind_walls = 0;
    for wall in &report.walls {
        let (z, target) = (wall.distance_m, wall.quality.target.unwrap());
        let d = pair.disparity_px(z);
        // A disparity of d pixels leaves the first d columns without a partner. The region has the columns from 120 to 280.
        let blind = ((d - 0.5).ceil() as usize).clamp(120, 280) - 120;
        blind_walls += usize::from(blind > 0);
        assert_eq!(wall.pixels, 2 * 160 * 40);
        assert!((wall.quality.fill_percent - 100.0 * (160 - blind) as f64 / 160.0).abs() < 1e-9, "{wall:?}");

        let n = (2 * (160 - blind) * 40) as f64;
        let allowed = 4.0 / (2.0 * n).sqrt();
        // To the second order depths are biased by Z·s², and spread by 4s² more, with s = σ/d.
        let s = sigma_px / d;
        let sigma_m = z * z * sigma_px / (focal_px * pair.baseline_m);
        let close = |found: f64, expected: f64, allowed: f64| {
            assert!((found / expected - 1.0).abs() < allowed + 8.0 * s * s, "{z} m: {found} for {expected}");
        };
        close(target.disparity_rms_px.unwrap(), sigma_px, allowed);
        // Neither trimming nor the unequal weights make the estimate worse by a fifth; where the strip is blind the rest is elsewhere.
        if blind == 0 {
            close(target.subpixel_rms_px.unwrap(), sigma_px * (sixth * trimmed).sqrt(), 1.2 * allowed);
        }
        close(target.plane_rms_m, sigma_m * f64::sqrt(trimmed), allowed);
        close(target.plane_rms_percent, 100.0 * sigma_m * f64::sqrt(trimmed) / z, allowed);
        // Differences of pairs are half as many.
        close(wall.sigma_m.unwrap(), sigma_m, 1.42 * allowed);
        close(wall.expected_sigma_m.unwrap(), sigma_m, 1e-12);
        assert_eq!(wall.expected_disparity_px, Some(sigma_px));
        let bias_m = wall.bias_m.unwrap();
        assert!((bias_m - z * s * s).abs() < 4.0 * sigma_m / n.sqrt() + 1e-6, "{z} m: {bias_m}");
        // A median errs by √(π/2) times what a mean does.
        let accuracy = target.z_accuracy_percent.unwrap();
        assert!(accuracy.abs() < 100.0 * (1.26 * 4.0 * sigma_m / n.sqrt() / z + s * s) + 1e-4, "{accuracy}");
    }
    assert_eq!(blind_walls, 1);
}

/// Rounding to eighths of a pixel makes another noise at each distance: none between two steps, and up to half a step at their edge.
#[test]
fn rounded_disparities_have_the_noise_that_is_expected_where_the_wall_stands() {
    let unit = 0.125;
    let report = measured(&camera((300, 60), 580.0, [0.5, 4.4], stereo(0.075, 0.0208, unit)), &[]);
    let mut noisy = 0;
    for wall in &report.walls {
        let (found, expected) = (wall.sigma_m.unwrap(), wall.expected_sigma_m.unwrap());
        let share = libm::pow(wall.expected_disparity_px.unwrap() / unit, 2.0);
        if share < 1e-3 {
            continue;
        }
        noisy += 1;
        // Half of the squared difference of two draws is u²/2 in the part 2v/u² of the pairs, and else 0: its mean is v and its
        // variance at most v·u²/2. Steps of depth differ by 3·(u/d).
        let pairs = 120.0 * 24.0;
        let curvature = 3.0 * unit / (580.0 * 0.075 / wall.distance_m);
        let allowed = 4.0 * (0.5 / share / pairs).sqrt() + curvature * curvature;
        assert!((libm::pow(found / expected, 2.0) - 1.0).abs() < allowed, "{wall:?}");
    }
    assert!(noisy >= 3, "{report:?}");
}

/// σ of a depth: c/(4πf)·√(2/N)/m of each frequency, averaged with weights 1/σ². With N = ρ·E·cos³θ/Z² and depth = R·cos θ, the mean
/// variance over the image has the factor 1/cos θ.
#[test]
fn a_time_of_flight_camera_has_the_noise_of_its_electrons() {
    let (size, focal_px) = ((160, 80), 120.0);
    let report =
        |electrons: f64, taps: u32| measured(&camera(size, focal_px, [0.3, 5.0], tof(electrons, taps)), &[]);
    // Over 64 · 32 pairs: the error of σ is σ/√(2·pairs), and four of them are exceeded once in 16,000 seeds.
    let allowed = 4.0 / (2.0 * 64.0 * 32.0_f64).sqrt();
    let slant = over_region(size, focal_px, |cosine| 1.0 / cosine);
    for electrons in [5e4, 2e5] {
        let walls = report(electrons, 4).walls;
        assert!(walls.len() >= 8);
        for wall in &walls {
            let z = wall.distance_m;
            let phase = (2.0 / (0.8 * electrons / (z * z))).sqrt() / 0.8;
            let weight = |hz: f64| libm::pow(range_m(phase, hz), -2.0);
            let sigma_m = (slant / (weight(20e6) + weight(100e6))).sqrt();
            assert_eq!(wall.quality.fill_percent, 100.0);
            assert!((wall.expected_sigma_m.unwrap() / sigma_m - 1.0).abs() < 1e-9, "{wall:?} {sigma_m}");
            assert!((wall.sigma_m.unwrap() / sigma_m - 1.0).abs() < allowed, "{wall:?} {sigma_m}");
            assert!(wall.bias_m.unwrap().abs() < 4.0 * sigma_m / (2.0 * 64.0 * 32.0_f64).sqrt(), "{wall:?}");
            let target = wall.quality.target.unwrap();
            assert_eq!((wall.expected_disparity_px, target.subpixel_rms_px), (None, None));
        }
    }
    // Three taps have more noise at some phases and less at others, by up to 40 % of the variance: √1.4 and √.6 of the deviation.
    let mut most = 0.0_f64;
    let four = report(5e4, 4).walls;
    for (wall, four) in report(5e4, 3).walls.iter().zip(&four) {
        let expected = wall.expected_sigma_m.unwrap();
        assert!((wall.sigma_m.unwrap() / expected - 1.0).abs() < allowed, "{wall:?}");
        most = most.max((expected / four.expected_sigma_m.unwrap() - 1.0).abs());
    }
    assert!(most > 0.05 && most < 0.226, "{most}");
}

/// The bound of σ falls between the noise at two distances, so that it is kept up to one and broken at the other.
#[test]
fn a_promise_is_held_against_the_wall_that_is_worst_for_it() {
    let sensor = camera((100, 60), 430.0, [0.3, 4.4], stereo(0.05, 0.08, 0.0));
    // 4 · .08/21.5 = 14.9 mm at 2 m, and 59.5 mm at 4 m.
    let promise = |quantity, at, bound| Published { quantity, at, bound, share_of_distance: 0.0 };
    let published = [
        promise(Quantity::Sigma, StatedAt::UpTo(2.0), 0.02),
        promise(Quantity::Sigma, StatedAt::All, 0.02),
        promise(Quantity::ZAccuracy, StatedAt::At(3.3), 2.0),
        promise(Quantity::FillRate, StatedAt::At(2.0), 99.0),
        promise(Quantity::Sigma, StatedAt::At(6.0), 1.0),
        Published { share_of_distance: 0.01, ..promise(Quantity::Bias, StatedAt::All, 0.011) },
        promise(Quantity::SubpixelRms, StatedAt::All, 0.05),
    ];
    let report = measured(&sensor, &published);
    assert!(!report.passed());
    let outcomes: Vec<(Option<f64>, Option<bool>)> = report
        .published
        .iter()
        .map(|judged| match judged.outcome {
            Outcome::Judged { distance_m, is_kept, .. } => (Some(distance_m), Some(is_kept)),
            _ => (None, None),
        })
        .collect();
    assert_eq!(
        outcomes[..5],
        [
            (Some(2.0), Some(true)),
            (Some(4.0), Some(false)),
            (Some(3.3), Some(true)),
            (Some(2.0), Some(true)),
            (None, None),
        ]
    );
    assert_eq!((outcomes[5].1, outcomes[6].1), (Some(true), Some(false)));
    assert_eq!(report.published[4].outcome, Outcome::OutOfRange);
    let Outcome::Judged { limit, distance_m, .. } = report.published[5].outcome else { panic!("{report:?}") };
    assert!((limit - (0.011 + 0.01 * distance_m)).abs() < 1e-12);

    let kept = measured(&sensor, &published[..1]);
    assert!(kept.passed());
    // Promises that can't be judged are not kept.
    assert!(!measured(&sensor, &published[4..5]).passed());
    let light = camera((40, 30), 40.0, [0.3, 5.0], tof(5e4, 4));
    let report = measured(&light, &published[6..]);
    assert_eq!(report.published[0].outcome, Outcome::NoDisparities);
}

/// A camera that matches images without a projector sees walls with a pattern. Whole pixels alone would have the noise 1/√12 = .289 px,
/// so less of it shows that fractions are found. No key says what it is.
#[test]
fn a_camera_that_matches_sees_walls_with_a_pattern() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("passive.toml");
    let text = "[stereo]\nbaseline_m = 0.05\nmethod = \"match\"\ndisparities = 32\nimager = { auto_level = 100.0 }\n\
                [pinhole]\nwidth_px = 120\nheight_px = 60\nfx_px = 160.0\n\
                [range]\nof = \"depth\"\nmin_m = 0.3\nmax_m = 2.5\n";
    fs::write(&path, text).unwrap();
    let report = measured(&config::load_sensor(&path).unwrap().sensor, &[]);
    assert!(report.is_textured && report.passed());
    let pair = StereoPair { focal_px: 160.0, baseline_m: 0.05 };
    for wall in &report.walls {
        assert!(wall.quality.fill_percent > 95.0, "{wall:?}");
        assert!(wall.quality.target.unwrap().disparity_rms_px.unwrap() < 0.289, "{wall:?}");
        let bias_px = wall.bias_m.unwrap() / pair.depth_per_px(wall.distance_m);
        assert!(bias_px.abs() < 0.25, "{wall:?}");
        assert_eq!((wall.expected_sigma_m, wall.expected_disparity_px), (None, None));
    }
}

/// A camera that is blinded at every distance has nothing to show, and fails with and without promises.
#[test]
fn a_camera_without_depth_fails() {
    let mut sensor = camera((40, 30), 40.0, [0.3, 5.0], tof(5e4, 4));
    let Some(DepthSensing::TimeOfFlight(tof)) = &mut sensor.measurement.depth else { panic!() };
    tof.full_well = 1.0;
    let promise = Published {
        quantity: Quantity::FillRate,
        at: StatedAt::At(1.0),
        bound: 99.0,
        share_of_distance: 0.0,
    };
    for published in [&[][..], &[promise]] {
        let report = measured(&sensor, published);
        assert!(report.walls.iter().all(|wall: &WallQuality| wall.quality.fill_percent == 0.0));
        assert!(report.walls.iter().all(|wall| wall.sigma_m.is_none() && wall.quality.target.is_none()));
        assert!(!report.passed());
    }
}

const STEREO: &str = "stereo = { baseline_m = 0.05 }\n\
    [pinhole]\nwidth_px = 100\nheight_px = 80\nfx_px = 100.0\n\
    [range]\nof = \"depth\"\nmin_m = 0.3\nmax_m = 5.0\n";
const PROMISES: &str = "[nominal]\nsource = \"a data sheet\"\n\
    [[nominal.published]]\nat_m = 2.0\nz_accuracy_percent = 2.0\nsigma_m = 0.01\n\
    [[nominal.published]]\nup_to_m = 2.0\nfill_rate_percent = 90.0\n";

#[test]
fn the_command_judges_promises_and_exits_by_them() {
    let folder = tempfile::tempdir().unwrap();
    let run = |text: &str, json: bool| {
        fs::write(folder.path().join("camera.toml"), text).unwrap();
        let mut command = super::cli::program();
        let args = ["selftest", "camera.toml", "--datasheet"].into_iter().chain(json.then_some("--json"));
        let output = command.args(args).current_dir(folder.path()).output().unwrap();
        let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
        (output.status.code(), text(&output.stdout), text(&output.stderr))
    };
    let (code, shown, err) = run(STEREO, false);
    assert_eq!(code, Some(0), "{shown}{err}");
    assert!(shown.ends_with("  measured; no data sheet's bound is known\n"), "{shown}");

    // σ at 2 m is 4 · .08/5 = 64 mm.
    let (code, shown, err) = run(&(STEREO.to_owned() + PROMISES), false);
    assert_eq!(code, Some(1), "{shown}{err}");
    assert!(shown.starts_with("camera.toml (a data sheet)\n") && shown.ends_with("  FAILED\n"), "{shown}");
    assert!(err.contains("camera.toml failed"), "{err}");
    let promises: Vec<&str> = shown.lines().filter(|line| line.contains("published: ")).collect();
    assert!(promises[0].starts_with("  published: Z accuracy at most 2 % at 2 m: "), "{promises:?}");
    assert!(promises[1].starts_with("  published: σ of depth at most 10 mm at 2 m: 6"), "{promises:?}");
    assert!(promises[2].starts_with("  published: fill rate at least 90 % up to 2 m: at worst 100 %"));
    let wrong: Vec<bool> = promises.iter().map(|line| line.ends_with(": WRONG")).collect();
    assert_eq!(wrong, [false, true, false]);

    let right = PROMISES.replace("sigma_m = 0.01", "sigma_m = 0.08");
    let (code, shown, err) = run(&(STEREO.to_owned() + &right), true);
    assert_eq!(code, Some(0), "{shown}{err}");
    let document: Value = serde_json::from_str(&shown).unwrap();
    let sensor = &document["sensors"][0];
    assert_eq!((&sensor["passed"], &sensor["is_nominal"]), (&Value::Bool(true), &Value::Bool(false)));
    assert_eq!(sensor["source"], "a data sheet");
    let at_2_m = sensor["walls"].as_array().unwrap().iter().find(|wall| wall["distance_m"] == 2.0).unwrap();
    let sigma_m = &sensor["published"][1]["found"];
    assert_eq!((&at_2_m["sigma_m"], &sensor["published"][1]["bound"]), (sigma_m, &Value::from(0.08)));

    // What lies in `[nominal]` is the camera's, if it has nothing of its own. The second imager, half a metre aside, sees the middle of
    // the image from 1.7 m on.
    let nominal = STEREO.replace("stereo = { baseline_m = 0.05 }\n", "")
        + &PROMISES.replace("up_to_m = 2.0", "at_m = 4.0")
        + "[nominal.stereo]\nbaseline_m = 0.5\n";
    let (code, shown, err) = run(&nominal, false);
    assert_eq!(code, Some(0), "{shown}{err}");
    assert!(shown.starts_with("camera.toml, nominal (a data sheet)\n"), "{shown}");
    let ideal = STEREO.replace("stereo = { baseline_m = 0.05 }\n", "") + PROMISES;
    let (code, _, err) = run(&ideal, false);
    assert_eq!(code, Some(2), "{err}");
    assert!(err.contains("no `[stereo]`, `[structured_light]` or `[tof]`"), "{err}");
}

/// A job's camera is held to the data sheet of its preset as that preset is, with the job's own figures and with those of `[nominal]`.
#[test]
fn the_command_judges_the_cameras_of_a_job() {
    let folder = tempfile::tempdir().unwrap();
    let right = PROMISES.replace("sigma_m = 0.01", "sigma_m = 0.08");
    let ideal = STEREO.replace("stereo = { baseline_m = 0.05 }\n", "");
    fs::write(folder.path().join("own.toml"), STEREO.to_owned() + &right).unwrap();
    let nominal = ideal + &right + "[nominal.stereo]\nbaseline_m = 0.05\n";
    fs::write(folder.path().join("nominal.toml"), nominal).unwrap();
    let run = |sensors: &str| {
        let job = format!("scene = \"s.glb\"\n[output]\ndir = \"out\"\n{sensors}");
        fs::write(folder.path().join("job.toml"), job).unwrap();
        let mut command = super::cli::program();
        let args = ["selftest", "job.toml", "--datasheet", "--json"];
        let output = command.args(args).current_dir(folder.path()).output().unwrap();
        let document: Value = serde_json::from_slice(&output.stdout).unwrap();
        let sensors = document["sensors"].as_array().unwrap().iter();
        let found = sensors.map(|sensor| {
            let verdicts = sensor["published"].as_array().unwrap().iter().map(|one| one["agrees"].clone());
            (sensor["name"].clone(), sensor["source"].clone(), verdicts.collect::<Vec<_>>())
        });
        (output.status.code(), found.collect::<Vec<_>>())
    };
    let two = "[[sensor]]\nname = \"first\"\npreset = \"own.toml\"\n\
               [[sensor]]\nname = \"second\"\npreset = \"nominal.toml\"\nnominal = true\n";
    let (code, found) = run(two);
    let expected = |name: &str, kept: [bool; 3]| {
        (
            Value::from(format!("{name} of job.toml")),
            Value::from("a data sheet"),
            kept.map(Value::from).to_vec(),
        )
    };
    assert_eq!((code, found), (Some(0), vec![expected("first", [true; 3]), expected("second", [true; 3])]));

    // A job that narrows the base of one camera loses the promise of its σ, and of no other.
    let narrow = two.replacen("own.toml\"\n", "own.toml\"\nstereo = { baseline_m = 0.03 }\n", 1);
    let (code, found) = run(&narrow);
    let kept = [expected("first", [true, false, true]), expected("second", [true; 3])];
    assert_eq!((code, found), (Some(1), kept.to_vec()));
}

#[test]
fn promises_that_are_wrong_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let messages = |text: String| {
        let path = folder.path().join("camera.toml");
        fs::write(&path, text).unwrap();
        match config::load_sensor(&path) {
            Err(beamcast::Error::Config(found)) => {
                found.into_iter().map(|one| one.message).collect::<Vec<_>>()
            }
            other => panic!("{other:?}"),
        }
    };
    for (from, to, expected) in [
        ("at_m = 2.0", "at_m = 2.0\nup_to_m = 3.0", "both `at_m` and `up_to_m` are given"),
        ("fill_rate_percent = 90.0\n", "", "`[[nominal.published]]` bounds nothing"),
        ("fill_rate_percent = 90.0", "fill_rate_percent = 101.0", "`fill_rate_percent` is 101"),
        (
            "fill_rate_percent = 90.0",
            "fill_rate = 90.0",
            "unknown key `fill_rate` in `[[nominal.published]]`",
        ),
        ("source = \"a data sheet\"\n", "", "`[nominal]` has no `source`"),
    ] {
        let found = messages(STEREO.to_owned() + &PROMISES.replacen(from, to, 1));
        assert!(found.iter().any(|message| message.contains(expected)), "{expected}: {found:?}");
    }
    // Promises say nothing about how a sensor measures, so a job can't turn them on.
    fs::write(folder.path().join("camera.toml"), STEREO.to_owned() + PROMISES).unwrap();
    let job = "scene = \"s.glb\"\n[output]\ndir = \"out\"\n\
               [[sensor]]\nname = \"eye\"\npreset = \"camera.toml\"\nnominal = true\n";
    let path = folder.path().join("job.toml");
    fs::write(&path, job).unwrap();
    let Err(beamcast::Error::Config(found)) = config::load_job(&path, &[]) else { panic!() };
    assert!(found.iter().any(|one| one.message == "the sensor has no nominal figures"), "{found:?}");
}
