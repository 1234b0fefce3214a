//! The command line as users meet it: the binary, its exit codes, the files that it writes and the files that it leaves
//! alone.

use std::collections::BTreeMap;
use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use exr::prelude::{ReadChannels, ReadLayers};
use serde_json::Value;
use tempfile::TempDir;

pub(super) const BINARY: &str = env!("CARGO_BIN_EXE_beamcast");

pub(super) fn beamcast(args: &[&str]) -> Output {
    command(args).output().unwrap()
}

pub(super) fn command(args: &[&str]) -> Command {
    let mut command = program();
    command.args(args);
    command
}

/// The binary, in an environment that says nothing of where the tests run: a CI server's variables change what it does.
pub(super) fn program() -> Command {
    let mut command = Command::new(BINARY);
    command.stdin(Stdio::null());
    for variable in ["CI", "GITHUB_ACTIONS", "GITHUB_STEP_SUMMARY", "NO_COLOR"] {
        command.env_remove(variable);
    }
    command
}

pub(super) fn code(output: &Output) -> i32 {
    output.status.code().unwrap_or_else(|| panic!("ended by a signal: {output:?}"))
}

pub(super) fn stderr(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

pub(super) fn stdout(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

/// A folder with a scene (a square of ground, 40 m wide, at z = 0) and a job.
pub(super) struct Workplace(TempDir);

impl Workplace {
    /// One beam points 30° down from 1 m above the ground, so every range is 2 m.
    pub(super) fn new() -> Self {
        Self::with_sensors(
            "[[sensor]]\nname = \"top\"\npose = { position_m = [0.0, 0.0, 1.0] }\n\
             [sensor.rotating]\nelevations_deg = [30.0, -30.0]\ncolumns = 360\nrate_hz = 10.0\n",
        )
    }

    pub(super) fn with_sensors(sensors: &str) -> Self {
        let tmp = tempfile::tempdir().unwrap();
        let corners: [[f32; 3]; 4] =
            [[-20.0, 0.0, -20.0], [-20.0, 0.0, 20.0], [20.0, 0.0, 20.0], [20.0, 0.0, -20.0]];
        let mut buffer: Vec<u8> = corners.iter().flatten().flat_map(|c| c.to_le_bytes()).collect();
        buffer.extend([0_u16, 1, 2, 0, 2, 3].iter().flat_map(|i| i.to_le_bytes()));
        fs::write(tmp.path().join("ground.bin"), &buffer).unwrap();
        let gltf = serde_json::json!({
            "asset": { "version": "2.0" },
            "buffers": [{ "uri": "ground.bin", "byteLength": 60 }],
            "bufferViews": [
                { "buffer": 0, "byteLength": 48 },
                { "buffer": 0, "byteOffset": 48, "byteLength": 12 },
            ],
            "accessors": [
                { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
                  "min": [-20.0, 0.0, -20.0], "max": [20.0, 0.0, 20.0] },
                { "bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR" },
            ],
            "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
            "nodes": [{ "name": "ground", "mesh": 0 }],
            "scenes": [{ "nodes": [0] }],
            "scene": 0,
        });
        fs::write(tmp.path().join("ground.gltf"), gltf.to_string()).unwrap();
        let output = "[output]\ndir = \"out\"\nformats = [\"exr\", \"ply\", \"png\"]\n";
        fs::write(tmp.path().join("job.toml"), format!("scene = \"ground.gltf\"\n{sensors}\n{output}"))
            .unwrap();
        Self(tmp)
    }

    pub(super) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(super) fn command(&self, subcommand: &str, args: &[&str]) -> Command {
        let job = self.path("job.toml");
        let mut all = vec![subcommand, job.to_str().unwrap()];
        all.extend(args);
        command(&all)
    }

    pub(super) fn scan(&self, args: &[&str]) -> Output {
        self.command("scan", args).output().unwrap()
    }

    /// Scans into another folder and returns the content of every file in it.
    fn scan_into(&self, folder: &str, args: &[&str]) -> BTreeMap<String, Vec<u8>> {
        let out = self.path(folder);
        let output = self.scan(&[&["--out", out.to_str().unwrap()], args].concat());
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        files(&out)
    }
}

/// The content of every file under a folder, by its path from there. It is empty if the folder does not exist.
pub(super) fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    let Ok(entries) = fs::read_dir(folder) else { return found };
    for entry in entries {
        let entry = entry.unwrap();
        let name = entry.file_name().into_string().unwrap();
        if entry.file_type().unwrap().is_dir() {
            found.extend(files(&entry.path()).into_iter().map(|(f, bytes)| (format!("{name}/{f}"), bytes)));
        } else {
            found.insert(name, fs::read(entry.path()).unwrap());
        }
    }
    found
}

pub(super) fn json(bytes: &[u8]) -> Value {
    serde_json::from_slice(bytes).unwrap()
}

#[test]
fn help_and_version_are_data() {
    let help = beamcast(&["--help"]);
    assert_eq!(code(&help), 0);
    for word in ["scan", "lint", "bench", "--quiet", "--color", "Exit codes"] {
        assert!(stdout(&help).contains(word), "{word}");
    }
    assert!(!stdout(&help).contains('\x1b'));
    let version = beamcast(&["--version"]);
    assert_eq!(stdout(&version), format!("beamcast {}\n", env!("CARGO_PKG_VERSION")));
    let scan = stdout(&beamcast(&["scan", "--help"]));
    for flag in ["--out", "--overwrite", "--threads", "--seed", "--set", "--dry-run"] {
        assert!(scan.contains(flag), "{flag}");
    }
}

#[test]
fn wrong_usage_is_exit_code_2() {
    for args in [
        &["--no-such-flag"][..],
        &["no-such-command"],
        &["scan"],
        &["scan", "a.toml", "--threads", "0"],
        &["scan", "a.toml", "--threads", "1025"],
        &["scan", "a.toml", "--seed", "-1"],
        &["bench", "a.toml", "--repeat", "0"],
        &["-q", "-v", "scan", "a.toml"],
        &[],
    ] {
        let output = beamcast(args);
        assert_eq!(code(&output), 2, "{args:?}");
        assert!(output.stdout.is_empty() && !output.stderr.is_empty(), "{args:?}");
    }
}

#[test]
fn colour_is_as_asked_for() {
    let coloured = |args: &[&str], no_color: &str| {
        let args = [args, &["scan", "missing.toml"]].concat();
        let output = command(&args).env("NO_COLOR", no_color).output().unwrap();
        assert_eq!(code(&output), 2);
        assert!(stderr(&output).contains("missing.toml"));
        stderr(&output).contains('\x1b')
    };
    assert!(coloured(&["--color", "always"], ""));
    assert!(coloured(&["--color", "always"], "1"), "a flag is a clearer wish than the environment");
    assert!(!coloured(&["--color", "never"], ""));
    assert!(!coloured(&[], ""), "stderr is a pipe here");
    assert!(!coloured(&[], "1"));
}

#[test]
fn a_scan_writes_what_its_manifest_says() {
    let work = Workplace::new();
    let output = work.scan(&["--json"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));

    let summary = json(&output.stdout);
    let top = &summary["sensors"][0];
    assert_eq!((&top["name"], &top["rays"], &top["hits"]), (&"top".into(), &720.into(), &360.into()));
    for statistic in ["range_min_m", "range_mean_m", "range_max_m"] {
        // The range is 1 m over the sine of 30°.
        assert!((top[statistic].as_f64().unwrap() - 2.0).abs() < 1e-9, "{top}");
    }
    assert!(stderr(&output).contains("top: 720 rays, 360 hits (50.0 %), range 2.000 to 2.000 m"));

    let mut files = files(&work.path("out"));
    let manifest = json(&files.remove("manifest.json").unwrap());
    let names: Vec<_> = files.keys().map(String::as_str).collect();
    assert_eq!(names, ["top/000000.exr", "top/000000.ply", "top/000000.png"]);
    let listed = manifest["outputs"].as_array().unwrap();
    assert_eq!(listed.len(), 3);
    for file in listed {
        let content = &files[file["path"].as_str().unwrap()];
        assert_eq!(file["bytes"], content.len());
        assert_eq!(file["blake3"], blake3::hash(content).to_hex().as_str());
    }
    assert_eq!(summary["outputs"], manifest["outputs"]);
    for file in manifest["inputs"].as_array().unwrap() {
        let content = fs::read(work.path(file["name"].as_str().unwrap())).unwrap();
        assert_eq!(file["bytes"], content.len());
        assert_eq!(file["blake3"], blake3::hash(&content).to_hex().as_str());
    }
    let inputs: Vec<_> = manifest["inputs"].as_array().unwrap().iter().map(|f| &f["name"]).collect();
    assert_eq!(inputs, ["job.toml", "ground.gltf", "ground.bin"]);
    assert_eq!(manifest["scene"]["triangles"], 2);
    assert_eq!(manifest["scene"]["instances"][0]["name"], "ground");
    assert!(!manifest.to_string().contains(work.0.path().to_str().unwrap()), "no absolute path");
}

#[test]
fn the_same_job_gives_the_same_bytes_wherever_it_runs() {
    let work = Workplace::new();
    let first = work.scan_into("a", &["--threads", "1"]);
    assert_eq!(first.len(), 4);
    for threads in ["1", "2", "3", "16"] {
        assert!(
            work.scan_into(&format!("on {threads}"), &["--threads", threads]) == first,
            "{threads} threads"
        );
    }
    let out = work.path("elsewhere");
    let mut scan = work.command("scan", &["--out", out.to_str().unwrap()]);
    let output = scan.env("LC_ALL", "de_DE.UTF-8").env("TZ", "Pacific/Chatham").output().unwrap();
    assert_eq!(code(&output), 0);
    assert!(files(&out) == first);
}

#[test]
fn command_line_overrides_are_in_the_manifest() {
    let work = Workplace::new();
    let args = ["--seed", "18446744073709551615", "--set", "sensor.top.range.max_m=1.5"];
    let manifest = json(&work.scan_into("a", &args)["manifest.json"]);
    assert_eq!(manifest["seed"], u64::MAX);
    assert_eq!(manifest["job"]["seed"], u64::MAX);
    assert!(manifest["job"].to_string().contains("1.5"), "{}", manifest["job"]);
}

#[test]
fn a_sensor_that_sees_nothing_says_so() {
    let work = Workplace::new();
    let output = work.scan(&["--set", "sensor.top.range.max_m=1.5", "--json"]);
    assert_eq!(code(&output), 0);
    assert!(
        stderr(&output)
            .contains("0 hits (0.0 %), 360 beyond its largest range: it sees nothing within its range")
    );
    assert_eq!(json(&output.stdout)["sensors"][0]["range_min_m"], Value::Null);
}

#[test]
fn outputs_that_exist_are_kept_unless_told() {
    let work = Workplace::new();
    assert_eq!(code(&work.scan(&[])), 0);
    let before = files(&work.path("out"));

    let output = work.scan(&["--set", "sensor.top.range.max_m=1.5"]);
    assert_eq!(code(&output), 4);
    let message = stderr(&output);
    assert!(message.contains("000000.exr: exists already; --overwrite replaces it"), "{message}");
    assert_eq!(files(&work.path("out")), before);

    assert_eq!(code(&work.scan(&["--overwrite", "--set", "sensor.top.range.max_m=1.5"])), 0);
    let after = files(&work.path("out"));
    assert!(after.keys().eq(before.keys()) && after["top/000000.ply"] != before["top/000000.ply"]);
}

#[test]
fn a_dry_run_writes_nothing_and_checks_everything() {
    let work = Workplace::new();
    let output = work.scan(&["--dry-run"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let plan = stdout(&output);
    for part in ["top: 2 × 360 = 720 rays", "2 triangles", "memory for frames: at most", "manifest.json"] {
        assert!(plan.contains(part), "{part}: {plan}");
    }
    assert!(!work.path("out").exists());
    let plan = json(&work.scan(&["--dry-run", "--json"]).stdout);
    assert_eq!((&plan["rays"], plan["outputs"].as_array().unwrap().len()), (&720.into(), 4));

    fs::remove_file(work.path("ground.bin")).unwrap();
    assert_eq!(code(&work.scan(&["--dry-run"])), 3);
    fs::write(work.path("out"), "").unwrap();
    assert_eq!(code(&work.scan(&["--dry-run"])), 4);
}

#[test]
fn each_fault_has_its_exit_code_and_is_found_before_anything_is_written() {
    let work = Workplace::new();
    let check = |args: &[&str], expected: i32, part: &str| {
        let output = work.scan(args);
        assert_eq!(code(&output), expected, "{}", stderr(&output));
        assert!(output.stdout.is_empty());
        assert!(stderr(&output).contains(part), "{part}: {}", stderr(&output));
        assert!(!work.path("out").exists());
    };
    check(&["--set", "sensor.top.range.max_m=-1"], 2, "max_m");
    check(&["--set", "sensor.top.rotating.rate_hz=0.1"], 2, "sensor \"top\" has no ply: a PLY's t counts");
    check(&["--set", "scene=nowhere.gltf"], 3, "nowhere.gltf");
    // If there are two faults, the one that is cheap to find is reported.
    let file = work.path("job.toml/deeper");
    check(
        &["--out", file.to_str().unwrap(), "--set", "scene=nowhere.gltf"],
        4,
        "job.toml: is a file, where a folder is needed",
    );
}

#[test]
fn more_than_the_machine_holds_is_refused_with_an_estimate() {
    let work = Workplace::with_sensors(
        "[[sensor]]\nname = \"wide\"\n[sensor.pinhole]\nwidth_px = 65000\nheight_px = 65000\nhfov_deg = 90.0\n",
    );
    let output = work.scan(&["--dry-run"]);
    assert_eq!(code(&output), 2, "{}", stdout(&output));
    let message = stderr(&output);
    assert!(message.contains("sensor \"wide\" takes about 773.2 GB (773175000000 bytes)"), "{message}");
}

#[test]
fn the_self_test_asks_before_it_takes_more_memory_than_there_is() {
    let work = Workplace::with_sensors(
        "[[sensor]]\nname = \"wide\"\n[sensor.pinhole]\nwidth_px = 65000\nheight_px = 65000\nhfov_deg = 90.0\n",
    );
    let output = work.command("selftest", &[]).output().unwrap();
    assert_eq!(code(&output), 2, "{}", stdout(&output));
    let message = stderr(&output);
    assert!(message.contains("a frame of wide of ") && message.contains(" takes about "), "{message}");
}

#[test]
fn the_environment_asks_for_no_more_threads_than_the_flag_may() {
    let work = Workplace::new();
    let output = work.command("scan", &[]).env("RAYON_NUM_THREADS", "100000").output().unwrap();
    assert_eq!(code(&output), 2, "{}", stderr(&output));
    assert!(
        stderr(&output).contains("RAYON_NUM_THREADS is 100000: expected 1 to 1024"),
        "{}",
        stderr(&output)
    );
    let output =
        work.command("scan", &["--threads", "2"]).env("RAYON_NUM_THREADS", "100000").output().unwrap();
    assert_eq!(code(&output), 0, "{}", stderr(&output));
}

#[test]
fn quiet_is_quiet_and_verbose_names_the_files() {
    let work = Workplace::new();
    let quiet = work.scan(&["-q"]);
    assert!(quiet.stderr.is_empty() && quiet.stdout.is_empty() && code(&quiet) == 0);
    let verbose = stderr(&work.scan(&["-v", "--overwrite"]));
    assert!(
        verbose.contains("read ground.bin (60 bytes") && verbose.contains("wrote top/000000.png"),
        "{verbose}"
    );
    // There is no progress bar without a terminal.
    assert!(!verbose.contains('\r') && !verbose.contains("casting"));
}

#[test]
fn coordinates_that_a_cloud_cannot_resolve_are_warned_of() {
    let work = Workplace::new();
    let far = "trajectory.pose.position_m=[451000.0, 5410000.0, 0.0]";
    let output = work.scan(&["--set", far, "--set", "output.frame=world"]);
    assert_eq!(code(&output), 0);
    assert!(stderr(&output).contains("in steps of 500 mm"), "{}", stderr(&output));
    let strict = work.scan(&["--set", far, "--set", "output.frame=world", "--overwrite", "--strict"]);
    assert_eq!(code(&strict), 2, "{}", stderr(&strict));
    assert!(!stderr(&work.scan(&["--set", far, "--overwrite"])).contains("steps"));
}

/// A run from end to end writes what `scan` writes, to a folder that is gone afterwards.
#[test]
fn bench_from_end_to_end_tells_of_each_stage_and_leaves_nothing() {
    let work = Workplace::new();
    let sequence = ["--set", "sequence.frames=7", "--set", "output.formats=[\"exr\", \"ply\", \"npy\"]"];
    let flags = ["--end-to-end", "--json", "--repeat", "2", "--threads", "2", "--frames", "1..6"];
    let before = files(&work.path(""));
    let output = work.command("bench", &[&sequence[..], &flags].concat()).output().unwrap();
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    assert_eq!(files(&work.path("")), before);
    let report = json(&output.stdout);
    let stages: Vec<_> =
        report["stages"].as_array().unwrap().iter().map(|s| s["stage"].as_str().unwrap()).collect();
    let expected = ["cast", "truth", "encode exr", "encode ply", "encode npy", "hash", "write", "flush"];
    assert_eq!(stages, expected);
    assert_eq!(report["frames"], 5);
    let scan = work.scan(&[&sequence[..], &["--frames", "1..6", "--json"]].concat());
    assert_eq!(code(&scan), 0, "{}", stderr(&scan));
    let written: u64 = json(&scan.stdout)["outputs"]
        .as_array()
        .unwrap()
        .iter()
        .filter(|file| file["path"].as_str().unwrap().starts_with("top/"))
        .map(|file| file["bytes"].as_u64().unwrap())
        .sum();
    assert!(report["bytes"].as_u64().unwrap() >= written, "{report} {written}");
    let nowhere = work.command("bench", &["--end-to-end", "--scratch", "nowhere"]).output().unwrap();
    assert_eq!(code(&nowhere), 4);
    assert!(stderr(&nowhere).contains("--scratch DIR names another"), "{}", stderr(&nowhere));
}

#[test]
fn bench_tells_its_numbers() {
    let work = Workplace::new();
    let output = work.command("bench", &["--json", "--repeat", "2", "--threads", "2"]).output().unwrap();
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let report = json(&output.stdout);
    let keys: Vec<_> = report.as_object().unwrap().keys().map(String::as_str).collect();
    let expected = [
        "format",
        "load_s",
        "build_s",
        "cast_s",
        "rays",
        "rays_per_s",
        "samples",
        "threads",
        "triangles",
        "bytes_per_triangle",
        "peak_rss_bytes",
        "effort",
    ];
    assert_eq!(keys, expected);
    assert_eq!(
        (&report["rays"], &report["threads"], &report["triangles"]),
        (&720.into(), &2.into(), &2.into())
    );
    assert!(report["cast_s"].as_f64().unwrap() > 0.0 && report["bytes_per_triangle"].as_f64().unwrap() > 0.0);
    let effort = |key: &str| report["effort"][key].as_u64().unwrap();
    assert!(effort("nodes") > 0 && effort("leaves") > 0 && effort("tests") > 0);
    assert!(effort("in_f64") <= effort("tests") && effort("exactly") <= effort("in_f64"));
    assert!(!work.path("out").exists());
    let text = stdout(&work.command("bench", &["--repeat", "1"]).output().unwrap());
    assert!(text.contains("720 rays on") && text.contains("2 triangles"), "{text}");
    assert!(text.contains("triangles tested") && text.contains("of these exactly"), "{text}");
    let kernel = ["--json", "--repeat", "1", "--set", "trace.kernel=\"watertight\""];
    let report = json(&work.command("bench", &kernel).output().unwrap().stdout);
    assert!(report["effort"].is_null(), "published methods count nothing: {report}");
}

#[test]
fn a_reader_that_goes_away_is_no_error() {
    let work = Workplace::new();
    for args in [&["--dry-run"][..], &["--json"]] {
        let mut child =
            work.command("scan", args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        assert!(!stderr(&output).contains("panicked"));
    }
}

#[cfg(unix)]
#[test]
fn a_full_disk_leaves_no_partial_file() {
    let work = Workplace::new();
    // The limit lets files grow to 8 blocks (4 or 8 kB), and the cloud takes 14 kB. The write stops halfway, as on a full
    // disk.
    let script = "ulimit -f 8; exec \"$0\" scan \"$1\" --set 'output.formats=[\"ply\"]'";
    let job = work.path("job.toml");
    let output = Command::new("sh").args(["-c", script, BINARY, job.to_str().unwrap()]).output().unwrap();
    assert_eq!(code(&output), 4, "{}", stderr(&output));
    assert!(stderr(&output).contains("top/000000.ply: can't be written"), "{}", stderr(&output));
    assert!(files(&work.path("out")).is_empty());
}

/// Whether this process, and so what it starts, ignores a signal. Where the system does not tell, it does not.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    ignored.is_some_and(|set| u64::from_str_radix(set.trim(), 16).unwrap() >> (signal - 1) & 1 != 0)
}

#[cfg(unix)]
#[test]
fn a_signal_stops_a_scan_with_nothing_half_written() {
    use std::thread::sleep;
    use std::time::{Duration, Instant};

    // The job has far more rays than are cast before the signal comes.
    let sensor = |i: usize| {
        format!(
            "[[sensor]]\nname = \"s{i}\"\npose = {{ position_m = [0.0, 0.0, 1.0] }}\n[sensor.pinhole]\n\
             width_px = 600\nheight_px = 600\nhfov_deg = 90.0\n"
        )
    };
    let work = Workplace::with_sensors(&(0..64).map(sensor).collect::<String>());
    for (name, number) in [("INT", 2), ("TERM", 15), ("HUP", 1)] {
        if is_ignored(number) {
            continue; // A run goes on after a signal that whoever started it ignores, as `nohup` does with SIGHUP.
        }
        let out = work.path(name);
        let mut child = work
            .command("scan", &["--out", out.to_str().unwrap()])
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let started = Instant::now();
        while !out.join("s1/000000.exr").exists() {
            assert!(started.elapsed() < Duration::from_secs(120) && child.try_wait().unwrap().is_none());
            sleep(Duration::from_millis(5));
        }
        let kill = Command::new("kill").args([format!("-{name}"), child.id().to_string()]).status().unwrap();
        assert!(kill.success());
        let signalled = Instant::now();
        let output = child.wait_with_output().unwrap();
        // Users are promised 2 s of the program's own time. A file that is being flushed to a busy disk, as after a build, holds
        // the process up until the disk is done, so only a hang fails.
        assert!(signalled.elapsed() < Duration::from_secs(60));
        assert_eq!(code(&output), 128 + number);
        assert!(stderr(&output).contains(&format!("stopped by signal {number}")), "{}", stderr(&output));
        let files = files(&out);
        assert!(!files.contains_key("manifest.json"));
        for (path, content) in &files {
            assert!(
                path == "journal.jsonl"
                    || path.ends_with("/000000.exr")
                    || path.ends_with("/000000.ply")
                    || path.ends_with("/000000.png")
            );
            if path.ends_with(".exr") {
                let reader = exr::prelude::read().no_deep_data().largest_resolution_level().all_channels();
                let image = reader.all_layers().all_attributes().from_buffered(Cursor::new(content));
                assert!(image.is_ok(), "{path} is whole");
            }
        }
    }
}
