//! `selftest --datasheet`: what data sheets state is what the scan gives, and a sensor that does otherwise is found out.

use std::fs;

use beamcast::config::presets::BUILT_IN;
use beamcast::config::{self};
use beamcast::physics::detection::{RangePair, Sensitivity};
use beamcast::selftest::datasheet::{Outcome, Replay, Stated, replay, states_figures};
use beamcast::sensor::{Measurement, Noise, Receiver};
use beamcast::{Progress, RangeLimits, Sensor};
use serde_json::Value;

fn replayed(sensor: &Sensor, stated: &Measurement) -> Replay {
    replay(sensor, stated, &Progress::default()).unwrap().unwrap()
}

/// A built-in sensor that measures as its data sheet says.
fn nominal(name: &str) -> Sensor {
    let file = config::load_preset(name).unwrap();
    Sensor { measurement: file.nominal.unwrap().measurement, ..file.sensor }
}

#[test]
fn every_built_in_sensor_measures_as_its_data_sheet_says() {
    let mut with_pairs = 0;
    for (name, _) in BUILT_IN {
        let file = config::load_preset(name).unwrap();
        let Some(nominal) = file.nominal.filter(|nominal| states_figures(&nominal.measurement)) else {
            continue;
        };
        let sensor = Sensor { measurement: nominal.measurement, ..file.sensor };
        let result = replayed(&sensor, &sensor.measurement);
        assert!(result.passed(), "{name}: {result:#?}");
        let receiver = sensor.measurement.receiver.unwrap();
        assert_eq!(result.pairs, receiver.range_pairs.len(), "{name}");
        with_pairs += usize::from(result.pairs > 0);
        let of =
            |is_meant: fn(&Stated) -> bool| result.figures.iter().filter(|f| is_meant(&f.stated)).count();
        assert_eq!(
            of(|stated| matches!(stated, Stated::Detection { beams: None, .. })),
            result.pairs,
            "{name}"
        );
        let of_beams: usize = receiver.beams.iter().map(|beams| beams.range_pairs.len()).sum();
        assert_eq!(
            of(|stated| matches!(stated, Stated::Detection { beams: Some(_), .. })),
            of_beams,
            "{name}"
        );
        let alarms = usize::from(receiver.false_alarm > 0.0);
        assert_eq!(of(|stated| matches!(stated, Stated::FalseAlarms)), alarms, "{name}");
    }
    // All built-in sensors with `[nominal]` but the VLP-16, whose data sheet states no pair.
    assert_eq!(with_pairs, 17);
}

/// A sensor with all kinds of figures: two pairs, noise, rounding, biases, gains and false alarms.
fn of_all_kinds() -> Sensor {
    let pairs =
        vec![RangePair { reflectivity: 0.1, range_m: 45.0 }, RangePair { reflectivity: 0.8, range_m: 100.0 }];
    let receiver = Receiver {
        sensitivity: Sensitivity::fit(&pairs),
        range_pairs: pairs,
        detection: 0.9,
        false_alarm: 1e-3,
        ..Receiver::default()
    };
    let noise = Noise {
        range_floor_m: 0.01,
        range_a_m: 0.3,
        bias_m: 0.01,
        gain: 0.1,
        range_unit_m: 0.004,
        ..Noise::default()
    };
    let measurement = Measurement { receiver: Some(receiver), noise: Some(noise), ..Measurement::default() };
    let range = RangeLimits { min_m: 6.0, max_m: 120.0, ..RangeLimits::default() };
    Sensor { range, measurement, ..config::load_preset("ouster/os1-32").unwrap().sensor }
}

/// Each figure of a right sensor agrees, and each that is tampered with disagrees while the others still agree.
#[test]
fn a_sensor_that_measures_otherwise_fails_at_the_figure_that_is_wrong() {
    let right = of_all_kinds();
    let stated = &right.measurement;
    let wrong_ones = |sensor: &Sensor| -> Vec<&'static str> {
        let result = replayed(sensor, stated);
        let disagrees = |outcome: &Outcome| outcome.measured().is_some_and(|measured| !measured.agrees());
        let mut names: Vec<_> =
            result.figures.iter().filter(|f| disagrees(&f.outcome)).map(|f| f.stated.name()).collect();
        assert_eq!(names.is_empty(), result.passed(), "{result:#?}");
        names.dedup();
        names
    };
    assert_eq!(wrong_ones(&right), [""; 0]);

    let with_receiver = |change: fn(&mut Receiver)| {
        let mut sensor = right.clone();
        change(sensor.measurement.receiver.as_mut().unwrap());
        sensor
    };
    let with_noise = |change: fn(&mut Noise)| {
        let mut sensor = right.clone();
        change(sensor.measurement.noise.as_mut().unwrap());
        sensor
    };
    // A tenth of the sensitivity is missing; ranges are noisier by a tenth because of that, too.
    let dull = with_receiver(|receiver| receiver.sensitivity.as_mut().unwrap().least_power *= 1.1);
    assert!(wrong_ones(&dull).contains(&"detection"));
    let noisy = with_noise(|noise| noise.range_floor_m = 0.012);
    assert_eq!(wrong_ones(&noisy), ["range_noise"]);
    let coarse = with_noise(|noise| noise.range_unit_m = 0.03);
    assert_eq!(wrong_ones(&coarse), ["range_noise"]);
    let biased = with_noise(|noise| noise.bias_m = 0.03);
    assert_eq!(wrong_ones(&biased), ["beam_bias"]);
    // Twice as many false alarms come of a threshold that is lower by so little that detection hardly tells.
    let jumpy = with_receiver(|receiver| receiver.false_alarm = 2e-3);
    assert!(wrong_ones(&jumpy).contains(&"false_alarms"));
}

/// The outer channels of Hesai's XT32 see 10 % up to 50 m, and are replayed apart from the inner ones. A sensor of which all see as far,
/// or of which other rows see less far, is found out by that figure alone.
#[test]
fn beams_with_pairs_of_their_own_are_replayed_apart() {
    let right = nominal("hesai/xt-32");
    let stated = &right.measurement;
    let wrong_ones = |sensor: &Sensor| -> Vec<(Option<usize>, Option<f64>)> {
        let result = replayed(sensor, stated);
        let figures = result.figures.iter();
        let wrong = figures.filter(|f| f.outcome.measured().is_some_and(|measured| !measured.agrees()));
        let facts = |stated: Stated| match stated {
            Stated::Detection { beams, range_m, .. } => (beams, Some(range_m)),
            _ => (None, None),
        };
        wrong.map(|figure| facts(figure.stated)).collect()
    };
    assert_eq!(wrong_ones(&right), []);
    let planes: Vec<_> =
        replayed(&right, stated).figures.iter().filter_map(|figure| figure.stated.plane()).collect();
    assert_eq!(planes, [(0.1, 80.0), (0.1, 50.0)]);
    let mut even = right.clone();
    even.measurement.receiver.as_mut().unwrap().beams.clear();
    assert_eq!(wrong_ones(&even), [(Some(0), Some(50.0))]);
    let mut others = right.clone();
    others.measurement.receiver.as_mut().unwrap().beams[0].rows = (8..24).collect();
    assert_eq!(wrong_ones(&others), [(None, Some(80.0)), (Some(0), Some(50.0))]);
}

/// A pair beyond the largest range is told and not replayed, and neither are too few beams.
#[test]
fn what_the_limits_hide_is_told() {
    let mut sensor = nominal("livox/mid-40");
    sensor.range.max_m = 200.0;
    sensor.measurement.noise.as_mut().unwrap().bias_m = 0.01;
    let result = replayed(&sensor, &sensor.measurement);
    assert!(result.passed(), "{result:#?}");
    let outcomes: Vec<Outcome> = result.figures.iter().map(|figure| figure.outcome).collect();
    assert_eq!(outcomes.iter().filter(|outcome| **outcome == Outcome::Capped(200.0)).count(), 1);
    assert_eq!(outcomes.iter().filter(|outcome| **outcome == Outcome::FewBeams(1)).count(), 1);
}

#[test]
fn the_command_replays_sensors_and_jobs_and_says_what_has_nothing_to_replay() {
    let folder = tempfile::tempdir().unwrap();
    let run = |args: &[&str]| {
        let mut command = super::cli::program();
        let output = command.args(["selftest", "--datasheet"]).args(args).current_dir(folder.path()).output();
        let output = output.unwrap();
        let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
        (output.status.code(), text(&output.stdout), text(&output.stderr))
    };
    let (code, shown, err) = run(&["ouster/os0-32"]);
    assert_eq!(code, Some(0), "{shown}{err}");
    assert!(shown.starts_with("ouster/os0-32, nominal (Ouster OS0-32"), "{shown}");
    assert!(shown.contains("  detection     10 % at 15 m") && shown.ends_with("  passed\n"), "{shown}");

    let (code, shown, err) = run(&["hesai/xt-32"]);
    assert_eq!(code, Some(0), "{shown}{err}");
    assert!(shown.contains(" (rows 0 to 7 and 24 to 31)\n"), "{shown}");

    let (code, shown, err) = run(&["ideal/camera"]);
    assert_eq!((code, shown.as_str()), (Some(2), ""), "{err}");
    for part in ["ideal/camera has nothing to replay", "`range_pairs`", "`bias_m`", "no `[nominal]`"] {
        assert!(err.contains(part), "{part}: {err}");
    }

    // Of a rig, a camera is passed over; a sensor that is ideal in the job is replayed with its nominal figures.
    let job = "scene = \"s.glb\"\n[output]\ndir = \"out\"\n\
               [[sensor]]\nname = \"top\"\npreset = \"ouster/os0-32\"\n\
               [[sensor]]\nname = \"eye\"\npreset = \"ideal/camera\"\n\
               [[sensor]]\nname = \"own\"\npreset = \"ouster/os0-32\"\n\
               receiver = { range_pairs = [[0.1, 20.0], [0.8, 70.0]] }\n";
    fs::write(folder.path().join("job.toml"), job).unwrap();
    let (code, shown, err) = run(&["job.toml", "--json"]);
    assert_eq!(code, Some(0), "{shown}{err}");
    assert!(err.contains("eye of job.toml has nothing to replay"), "{err}");
    let document: Value = serde_json::from_str(&shown).unwrap();
    let sensors = document["sensors"].as_array().unwrap();
    let told: Vec<_> = sensors.iter().map(|s| (s["name"].as_str().unwrap(), &s["is_nominal"])).collect();
    assert_eq!(told, [("top of job.toml", &Value::Bool(true)), ("own of job.toml", &Value::Bool(false))]);
    let own = sensors[1]["figures"].as_array().unwrap();
    assert_eq!((own[0]["agrees"].as_bool(), own[1]["left_out"].as_str()), (Some(true), Some("capped")));
}
