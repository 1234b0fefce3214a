//! `beamcast selftest` as users run it: a right sensor passes, and a wrong one fails with the place of the error.

use std::fs;
use std::process::Output;

use serde_json::Value;

fn selftest(args: &[&str]) -> Output {
    let mut command = super::cli::program();
    command.arg("selftest").args(args).current_dir(env!("CARGO_MANIFEST_DIR")).output().unwrap()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

#[test]
fn the_shipped_sensors_pass() {
    let output = selftest(&["--json"]);
    assert_eq!(output.status.code(), Some(0), "{}{}", text(&output.stdout), text(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let sensors = report["sensors"].as_array().unwrap();
    assert!(sensors.len() >= 3);
    for sensor in sensors {
        assert_eq!(sensor["passed"], true, "{sensor:#}");
        let rays = sensor["rows"].as_u64().unwrap() * sensor["columns"].as_u64().unwrap();
        for shape in sensor["shapes"].as_array().unwrap() {
            let count = |key: &str| shape[key].as_u64().unwrap();
            assert_eq!(count("hits") + count("misses") + count("edges"), rays, "{shape:#}");
            assert!(shape["facet_error_max_m"].as_f64().unwrap() <= 1e-9, "{shape:#}");
        }
    }
}

#[test]
fn a_job_that_casts_with_a_published_method_fails_and_says_where() {
    let folder = tempfile::tempdir().unwrap();
    let job = folder.path().join("job.toml");
    let lines = "scene = \"s.glb\"\n[[sensor]]\nname = \"top\"\npose = { position_m = [0.0, 0.0, 2.0] }\n\
                 [sensor.rotating]\nelevations_deg = [1.0, -1.0]\ncolumns = 90\nrate_hz = 10.0\n\
                 [output]\ndir = \"out\"\n";
    fs::write(&job, lines).unwrap();
    let output = selftest(&[job.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(0), "{}{}", text(&output.stdout), text(&output.stderr));
    let shown = text(&output.stdout);
    assert!(shown.starts_with("top of ") && shown.contains(": 2 × 90 rays\n"), "{shown}");
    assert!(shown.ends_with("  passed\n") && shown.contains("plate, tilted 80°"), "{shown}");

    fs::write(&job, format!("{lines}[trace]\nkernel = \"moller-trumbore\"\n")).unwrap();
    let output = selftest(&[job.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(1));
    let shown = text(&output.stdout);
    assert!(shown.contains("by the method moller-trumbore") && shown.ends_with("  FAILED\n"), "{shown}");
    assert!(shown.contains("m, where the formula says a range from"), "{shown}");
    assert!(text(&output.stderr).contains("failed"), "{}", text(&output.stderr));
}

#[test]
fn unreadable_jobs_are_reported_as_by_lint() {
    let output = selftest(&["configs/sensors/lidar_12.toml"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(text(&output.stderr).contains("lidar_128.toml"), "{}", text(&output.stderr));
}
