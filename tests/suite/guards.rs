//! What hostile input, other processes and the system do to a run: each test that begins with "case" holds one that was found in
//! the field.

use std::fs;
#[cfg(unix)]
use std::process::{Child, Command, Stdio};

use super::cli::{Workplace, code, files, json, stderr};

/// A rig with many frames, so that a scan of it takes a while.
#[cfg(unix)]
fn rig(sensors: usize) -> Workplace {
    let sensor = |i: usize| {
        format!(
            "[[sensor]]\nname = \"s{i}\"\npose = {{ position_m = [0.0, 0.0, 1.0] }}\n[sensor.pinhole]\n\
             width_px = 300\nheight_px = 300\nhfov_deg = 90.0\n"
        )
    };
    Workplace::with_sensors(&(0..sensors).map(sensor).collect::<String>())
}

/// Starts a scan, and waits until it has written its first file.
#[cfg(unix)]
fn started(work: &Workplace, args: &[&str]) -> Child {
    let mut child = work.command("scan", args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let begun = std::time::Instant::now();
    while !work.path("out/s0/000000.exr").exists() {
        assert!(begun.elapsed().as_secs() < 120 && child.try_wait().unwrap().is_none());
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    child
}

/// Checks that each output that the manifest lists has the length and the hash that it says.
fn assert_manifest_is_true(work: &Workplace) {
    let mut files = files(&work.path("out"));
    let manifest = json(&files.remove("manifest.json").unwrap());
    for output in manifest["outputs"].as_array().unwrap() {
        let content = &files[output["path"].as_str().unwrap()];
        assert_eq!(output["bytes"], content.len());
        assert_eq!(output["blake3"], blake3::hash(content).to_hex().as_str());
    }
    assert!(!files.keys().any(|name| name.contains(".beamcast-")), "{:?}", files.keys());
}

#[cfg(unix)]
#[test]
fn case_two_scans_one_folder() {
    let work = rig(16);
    let first = started(&work, &[]);
    let second = work.scan(&["--overwrite", "--set", "seed=7"]);
    assert_eq!(code(&second), 4, "{}", stderr(&second));
    assert!(stderr(&second).contains("another run is writing to this folder"), "{}", stderr(&second));
    let first = first.wait_with_output().unwrap();
    assert_eq!(code(&first), 0, "{}", stderr(&first));
    assert_manifest_is_true(&work);
    assert_eq!(json(&files(&work.path("out"))["manifest.json"])["seed"], 0);
}

#[cfg(unix)]
#[test]
fn case_temporary_files_stay() {
    let work = rig(16);
    // Killed where nothing can be tidied up. A lock would be stale, and a half-written file would stay.
    let mut child = started(&work, &[]);
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(!work.path("out/manifest.json").exists());
    fs::write(work.path("out/s1/.beamcast-abc123.tmp"), "half").unwrap();
    let again = work.scan(&["--overwrite"]);
    assert_eq!(code(&again), 0, "{}", stderr(&again));
    assert_manifest_is_true(&work);
}

#[cfg(unix)]
#[test]
fn a_run_that_shall_outlive_its_terminal_does() {
    let work = rig(16);
    let job = work.path("job.toml");
    let child = Command::new("sh")
        .args(["-c", "trap '' HUP; exec \"$0\" scan \"$1\"", super::cli::BINARY, job.to_str().unwrap()])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    while !work.path("out/s0/000000.exr").exists() {
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    Command::new("kill").args(["-HUP", &child.id().to_string()]).status().unwrap();
    let output = child.wait_with_output().unwrap();
    if cfg!(target_os = "linux") {
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        assert_manifest_is_true(&work);
    }
}

#[cfg(unix)]
#[test]
fn case_report_replaces_device() {
    use std::os::unix::fs::FileTypeExt;
    let work = Workplace::new();
    let expect = "[[expect]]\nname = \"it sees\"\nreturns = { at_least = 0.1 }\n";
    let job = fs::read_to_string(work.path("job.toml")).unwrap();
    fs::write(work.path("job.toml"), job + expect).unwrap();
    std::os::unix::fs::symlink("/proc/self/fd/1", work.path("stdout")).unwrap();
    let stdout = work.path("stdout");
    let stdout = stdout.to_str().unwrap();
    let output = work
        .command(
            "check",
            &["--json", "/dev/null", "--junit", stdout, "--html", "/dev/null", "--markdown", "/dev/null"],
        )
        .output()
        .unwrap();
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert!(fs::metadata("/dev/null").unwrap().file_type().is_char_device());
    assert!(fs::symlink_metadata(stdout).unwrap().is_symlink());
    if cfg!(target_os = "linux") {
        assert!(String::from_utf8_lossy(&output.stdout).contains("<testsuites"));
    }
    let view = work.command("view", &["-o", "/dev/null"]).output().unwrap();
    assert_eq!(code(&view), 0, "{}", stderr(&view));
    assert!(fs::metadata("/dev/null").unwrap().file_type().is_char_device());
}

#[cfg(unix)]
#[test]
fn case_manifest_of_another_job() {
    let work = rig(16);
    let job = fs::read_to_string(work.path("job.toml")).unwrap();
    let child = started(&work, &[]);
    fs::write(work.path("job.toml"), job.clone() + "# changed\n").unwrap();
    assert_eq!(code(&child.wait_with_output().unwrap()), 0);
    let manifest = json(&fs::read(work.path("out/manifest.json")).unwrap());
    assert_eq!(manifest["inputs"][0]["bytes"], job.len());
    assert_eq!(manifest["inputs"][0]["blake3"], blake3::hash(job.as_bytes()).to_hex().as_str());
}
