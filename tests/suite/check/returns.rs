//! Checks and comparisons of sensors that report several returns of a pulse.

use std::fs;
use std::path::Path;

use serde_json::Value;

use super::super::explain::write_job;
use super::{has, told};

/// A receiver whose pulses are so short (σ = 19 mm) that the plate at 12 m and the wall at 12.2 m give two returns.
const DUAL: &str = "[sensor.footprint]\ndivergence_mrad = [3.0, 3.0]\nkind = \"1/e2\"\n\
                    [sensor.receiver]\nrange_pairs = [[0.1, 90.0]]\npulse_fwhm_ns = 0.3\nreturns = \"dual\"\n";

fn run(folder: &Path, args: &[&str]) -> (i32, String, String) {
    told(&super::super::cli::program().args(args).current_dir(folder).output().unwrap())
}

fn check(folder: &Path, change: &str) -> (i32, String) {
    let (code, out, err) = run(folder, &["check", "job.toml", "--set", change]);
    (code, out + &err)
}

#[test]
fn further_returns_are_held_to_the_baseline() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write_job(folder, DUAL);
    let (code, out, err) = run(folder, &["check", "--accept", "job.toml"]);
    assert_eq!(code, 0, "{out}{err}");
    let baseline = fs::read_to_string(folder.join("job.baseline/baseline.json")).unwrap();
    let baseline: Value = serde_json::from_str(&baseline).unwrap();
    let records = baseline["sensors"].as_array().unwrap();
    let facts: Vec<_> =
        records.iter().map(|record| (&record["return"], record["returns"].as_u64())).collect();
    // One pixel of eight is at the edge. The first record counts all returns of the frame.
    let (first, second) = (facts[0], facts[1]);
    assert_eq!((facts.len(), first.0, second), (2, &Value::Null, (&Value::from(1), Some(1))));
    assert!(first.1.unwrap() >= 2 && baseline["format"] == 4, "{baseline}");
    assert!(folder.join("job.baseline/top.pixels").is_file());
    assert!(folder.join("job.baseline/top@return1.pixels").is_file());
    let same = check(folder, "seed=0");
    assert_eq!(same.0, 0, "{}", same.1);

    // The second return is too near to the first, and nothing else changes.
    let (code, report) = check(folder, "sensor.top.receiver.separation_m=1.0");
    assert_eq!(code, 1, "{report}");
    has(&report, &["sensor top, return 1: ", "range differs in 1 of 8 pixels, 1 return vanished"]);
    assert!(!report.contains("sensor top: range"), "{report}");
    let change = "sensor.top.receiver.separation_m=1.0";
    let (code, json, _) = run(folder, &["check", "job.toml", "--set", change, "--json", "-"]);
    let json: Value = serde_json::from_str(&json).unwrap();
    let sensors = json["jobs"][0]["sensors"].as_array().unwrap();
    let told: Vec<_> = sensors
        .iter()
        .map(|s| (s["name"].as_str(), s["return"].as_u64(), s["differences"].as_array().map(Vec::is_empty)))
        .collect();
    assert_eq!(code, 1);
    assert_eq!(told, [(Some("top"), Some(0), Some(true)), (Some("top"), Some(1), Some(false))]);

    // A sensor that reports one return has a baseline of one, and the other way round.
    let (code, report) = check(folder, "sensor.top.receiver.returns=\"strongest\"");
    assert_eq!(code, 1, "{report}");
    has(&report, &["the baseline has more returns of a pixel of sensor top than the sensor reports"]);
    write_job(folder, &DUAL.replace("dual", "strongest"));
    assert_eq!(run(folder, &["check", "--accept", "job.toml"]).0, 0);
    let one = fs::read_to_string(folder.join("job.baseline/baseline.json")).unwrap();
    assert!(one.contains("\"format\": 2") && !one.contains("\"return\""), "{one}");
    assert!(!folder.join("job.baseline/top@return1.pixels").exists());
    let (code, report) = check(folder, "sensor.top.receiver.returns=\"dual\"");
    assert_eq!(code, 1, "{report}");
    has(
        &report,
        &["the baseline has no returns of sensor top beyond the first of a pixel; `beamcast check --accept"],
    );
}

#[test]
fn diff_compares_further_returns_of_files_and_of_jobs() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    write_job(folder, DUAL);
    let of_one = "sensor.top.receiver.separation_m=1.0";
    for args in
        [&["scan", "job.toml", "--out", "two"][..], &["scan", "job.toml", "--out", "one", "--set", of_one]]
    {
        let (code, out, err) = run(folder, args);
        assert_eq!(code, 0, "{out}{err}");
    }
    // A job has all returns that its files have.
    let (code, out, err) = run(folder, &["diff", "job.toml", "two"]);
    assert_eq!(code, 0, "{out}{err}");
    has(&out, &["top/000000: the same", "top/000000:return1: the same, 2 × 4 pixels, 1 return\n"]);
    // A side without such returns has none, whichever it is, and is no mistake.
    for (a, b, change) in [
        ("two", "one", "0 returns in both, 0 returns appeared, 1 return vanished"),
        ("one", "two", "0 returns in both, 1 return appeared, 0 returns vanished"),
        ("one", "job.toml", "0 returns in both, 1 return appeared, 0 returns vanished"),
    ] {
        let (code, out, err) = run(folder, &["diff", a, b, "--png", "a.png"]);
        assert_eq!(code, 1, "{out}{err}");
        has(&out, &["top/000000: the same", &format!("top/000000:return1: different: {change}")]);
    }
    // The picture is one of the first returns.
    assert!(folder.join("a.top.png").is_file());
}
