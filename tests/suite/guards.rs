//! Hostile input, other processes and the system, and how a run stands them: each test that begins with "case" holds one that was found in
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

/// Text that a terminal or a CI server would act on, if it came there as it is.
const HOSTILE: &str =
    "x\n::add-mask::y\r##[group]z ##vso[task.setvariable]\u{1b}]0;t\u{7}\u{9b}2J\u{202e}\u{2028}";

/// Checks that what a command printed has nothing that a terminal or a CI server acts on. `commands` are lines that it may
/// have given the server.
fn assert_harmless(output: &std::process::Output, commands: &[&str]) {
    for stream in [&output.stdout, &output.stderr] {
        let text = std::str::from_utf8(stream).unwrap();
        let is_harmful = |c: char| {
            c != '\n'
                && (c.is_control()
                    || matches!(c, '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}'))
        };
        assert!(!text.contains(is_harmful), "{text:?}");
        assert!(!text.contains("##[") && !text.to_lowercase().contains("##vso["), "{text}");
        for line in text.lines().map(str::trim_start).filter(|line| line.starts_with("::")) {
            assert!(commands.iter().any(|command| line.starts_with(command)), "{line}");
        }
    }
}

#[test]
fn case_github_command_injection() {
    let work = Workplace::new();
    let quoted = serde_json::to_string(HOSTILE).unwrap();
    let name =
        |i: usize| if i == 0 { quoted.clone() } else { "\"::error file=README.md,line=1::pwned\"".into() };
    let expectation = |i: usize| {
        format!(
            "[[expect]]\nname = {}\npoints = {{ at_least = 100000, on = [{quoted}, \"ground\"] }}\n\
             [[expect]]\nname = {}\nreturns = {{ at_least = 0.99 }}\n",
            name(i),
            name(i)
        )
    };
    let scene = fs::read_to_string(work.path("ground.gltf")).unwrap();
    fs::write(work.path("ground.gltf"), scene.replace("\"name\":\"ground\"", &format!("\"name\":{quoted}")))
        .unwrap();
    let job = fs::read_to_string(work.path("job.toml")).unwrap();
    fs::write(work.path("job.toml"), format!("{job}\n{}{}", expectation(0), expectation(1))).unwrap();
    let commands = ["::error file=", "::warning file=", "::notice file="];
    for args in [&["check"][..], &["check", "--json", "-"]] {
        let mut check = work.command(args[0], &args[1..]);
        let output = check.env("GITHUB_ACTIONS", "true").env_remove("GITHUB_STEP_SUMMARY").output().unwrap();
        assert_harmless(&output, &commands);
        assert!(String::from_utf8_lossy(&output.stdout).contains("pwned"), "{}", stderr(&output));
    }
    for args in
        [&["lint"][..], &["lint", "--json"], &["scan", "--dry-run"], &["scan", "-v", "--json"], &["selftest"]]
    {
        assert_harmless(&work.command(args[0], &args[1..]).output().unwrap(), &[]);
    }
    // A job that has the name itself, in a folder and with outputs that have it.
    #[cfg(unix)]
    {
        let folder = work.path(HOSTILE);
        fs::create_dir(&folder).unwrap();
        for file in ["job.toml", "ground.gltf", "ground.bin"] {
            fs::copy(work.path(file), folder.join(file)).unwrap();
        }
        let hostile = folder.join(format!("{HOSTILE}.toml"));
        fs::rename(folder.join("job.toml"), &hostile).unwrap();
        let out = work.path(&format!("{HOSTILE} out"));
        let (hostile, out) = (hostile.to_str().unwrap(), out.to_str().unwrap());
        let exr = format!("{out}/top/000000.exr");
        for args in [
            &["lint", hostile][..],
            &["lint", folder.to_str().unwrap()],
            &["scan", hostile, "--out", out, "-v"],
            &["scan", hostile, "--out", out, "--dry-run", "--overwrite"],
            &["scan", hostile, "--out", out],
            &["check", hostile, "-v"],
            &["selftest", hostile],
            &["info", hostile],
            &["info", out],
            &["info", out, "--json"],
            &["info", &exr],
            &["diff", out, hostile],
            &["diff", out, "/nowhere\n::error::x"],
            &["view", out, "-o", &format!("{out}/page.html")],
            &["lint", &exr],
            &["import", &exr],
        ] {
            let output = super::cli::command(args).env("GITHUB_ACTIONS", "true").output().unwrap();
            assert_harmless(&output, &commands);
        }
    }
}

/// Files that others made reach the terminal as `info`, `diff` and `import` tell of them.
#[test]
fn recorded_files_and_calibrations_print_nothing_raw() {
    let work = Workplace::new();
    let path = |name: &str| work.path(name).to_str().unwrap().to_owned();
    let name = HOSTILE.replace(['\n', '\r'], "\u{85}");
    let ply = |label: &str| {
        format!(
            "ply\nformat ascii 1.0\ncomment {name}\ncomment ::error::x\ncomment ##[error]x\nelement vertex 1\n\
             property float x\nproperty float {label}\nend_header\n1 2\n"
        )
    };
    let field = name.replace(char::is_whitespace, "_");
    fs::write(work.path("a.ply"), ply(&field)).unwrap();
    fs::write(work.path("b.ply"), ply(&field).replace("1 2", "1 3")).unwrap();
    fs::create_dir(work.path("scan")).unwrap();
    let manifest = serde_json::json!({
        "tool": { "name": HOSTILE, "version": HOSTILE },
        "seed": 1,
        "job": { "scene": HOSTILE, "sensor": [{ "name": HOSTILE }] },
        "inputs": [{ "name": HOSTILE, "bytes": 1, "blake3": HOSTILE }],
        "scene": { "triangles": 1, "instances": [{ "id": 0, "name": HOSTILE }], "materials": [] },
        "outputs": [{ "path": HOSTILE, "bytes": 1, "blake3": HOSTILE }],
    });
    fs::write(work.path("scan/manifest.json"), manifest.to_string()).unwrap();
    let yaml = format!("camera_name: {}\nimage_width: x\n", serde_json::to_string(HOSTILE).unwrap());
    fs::write(work.path("camera.yaml"), yaml).unwrap();
    let (a, b, scan, camera) = (path("a.ply"), path("b.ply"), path("scan"), path("camera.yaml"));
    for args in [
        &["info", &a][..],
        &["info", &a, "--json"],
        &["diff", &a, &b],
        &["diff", &a, &b, "--json"],
        &["diff", &scan, &a],
        &["info", &scan],
        &["info", &scan, "--json"],
        &["view", &scan],
        &["import", &camera],
    ] {
        let output = super::cli::command(args).output().unwrap();
        assert_harmless(&output, &[]);
        assert!(!output.stdout.is_empty() || !output.stderr.is_empty(), "{args:?}");
    }
}

/// The answer of `lint` about a job or a sensor file with this text, beside the scene of a workplace.
fn lint(text: &str) -> (i32, String) {
    let work = Workplace::new();
    let path = work.path("a.toml");
    fs::write(&path, text).unwrap();
    let output = super::cli::beamcast(&["lint", path.to_str().unwrap()]);
    (code(&output), stderr(&output))
}

#[cfg(target_os = "linux")]
#[test]
fn case_job_reads_and_shows_any_file() {
    let work = Workplace::new();
    let job = |sensor: &str| {
        let output = "[output]\ndir = \"out\"\nformats = [\"exr\"]\n";
        format!("scene = \"ground.gltf\"\n[[sensor]]\n{sensor}\n[sensor.range]\nmax_m = 50.0\n{output}")
    };
    let inner = work.path("jobs");
    fs::create_dir(&inner).unwrap();
    for file in ["ground.gltf", "ground.bin"] {
        fs::copy(work.path(file), inner.join(file)).unwrap();
    }
    let lint = |sensor: &str| {
        fs::write(inner.join("job.toml"), job(sensor)).unwrap();
        let mut lint = super::cli::command(&["lint", "job.toml"]);
        let output = lint.env("SECRET", "hunter2").current_dir(&inner).output().unwrap();
        (code(&output), stderr(&output))
    };
    for file in ["/proc/self/environ", "environ.csv"] {
        let _ = std::os::unix::fs::symlink("/proc/self/environ", inner.join("environ.csv"));
        let (code, message) = lint(&format!("[sensor.rays]\nfile = \"{file}\""));
        assert_eq!(code, 2);
        assert!(message.contains("view of the system's state") && !message.contains("hunter2"), "{message}");
    }
    // A file that is somebody's, outside of the job's folder, directly or by a link.
    let secret = work.path("secret.toml");
    fs::write(&secret, "password = \"hunter2\"\n[modes.hunter3]\n[[\n").unwrap();
    fs::write(work.path("secret.csv"), "hunter2\n1,2\n").unwrap();
    fs::write(work.path("binary.csv"), b"hunter2\n\xff").unwrap();
    std::os::unix::fs::symlink(&secret, inner.join("link.toml")).unwrap();
    for sensor in [
        "[sensor.rays]\nfile = \"../secret.csv\"",
        "[sensor.rays]\nfile = \"../binary.csv\"",
        "preset = \"../secret.toml\"",
        "preset = \"link.toml\"",
    ] {
        let (code, message) = lint(sensor);
        assert_eq!(code, 2, "{message}");
        assert!(message.contains("is not shown") && message.contains("line "), "{message}");
        assert!(!message.contains("hunter"), "{message}");
    }
    fs::write(&secret, "[modes.hunter3]\n[pinhole]\nwidth_px=2\nheight_px=2\nhfov_deg=20.0\nhunter2=1\n")
        .unwrap();
    let (_, message) = lint("preset = \"../secret.toml\"\nmode = \"hunted\"");
    assert!(message.contains("has no mode `hunted`") && !message.contains("hunter"), "{message}");
    // Beside the job the same text is shown.
    fs::copy(&secret, inner.join("own.toml")).unwrap();
    assert!(lint("preset = \"own.toml\"").1.contains("hunter2"));
}

#[test]
fn case_toml_modes_memory() {
    let modes = |count: usize, beams: usize| {
        let modes: String =
            (0..count).map(|i| format!("[modes.m{i}.rotating]\ncolumns = {}\n", 10 + i)).collect();
        let elevations = format!("{{ from = 1.0, to = 0.0, count = {beams} }}");
        lint(&format!("[rotating]\nelevations_deg = {elevations}\ncolumns = 360\nrate_hz = 10.0\n{modes}"))
    };
    assert_eq!(modes(30, 100).0, 0);
    let (code, message) = modes(300, 100_000);
    assert_eq!(code, 2);
    assert!(message.contains("the modes of the sensor have more than 2000000 beams in all"), "{message}");
    // A long table under very many modes is copied for each.
    let table = "0.0, ".repeat(20_000);
    let modes: String = (0..1000).map(|i| format!("[modes.m{i}.range]\nmax_m = 5.0\n")).collect();
    let text = format!("[rotating]\nelevations_deg = [{table}]\ncolumns = 360\nrate_hz = 10.0\n{modes}");
    let (code, message) = lint(&text);
    assert_eq!(code, 2);
    assert!(message.contains("1000 modes of a file of this length are too many"), "{message}");
}

#[test]
fn case_extreme_numbers_pass() {
    let job = |sensor: &str| {
        lint(&format!(
            "scene = \"ground.gltf\"\n[[sensor]]\n{sensor}\n[sensor.range]\nmax_m = 50.0\n\
             [output]\ndir = \"out\"\nformats = [\"exr\"]\n"
        ))
    };
    let rotating =
        |rest: &str| format!("[sensor.rotating]\nelevations_deg = [1.0, 0.0]\ncolumns = 36\n{rest}");
    let pinhole = |rest: &str| format!("[sensor.pinhole]\nwidth_px = 64\nheight_px = 48\n{rest}");
    for (sensor, words) in [
        (rotating("rate_hz = 5e-324"), "the time of a pulse"),
        (rotating("rate_hz = 1e-300"), "the time of a pulse"),
        (rotating("rate_hz = 10.0\nbeam_times_us = [0.0, 1e300]"), "the time of a pulse"),
        (pinhole("fx_px = 1e-300"), "no direction"),
        (pinhole("fx_px = 500.0\nfy_px = 1e-308"), "no direction"),
        (pinhole("fx_px = 500.0\ncx_px = 1e300"), "no direction"),
        (pinhole("hfov_deg = 60.0\nrate_hz = 1e-320"), "the time of a pulse"),
    ] {
        let (code, message) = job(&sensor);
        assert_eq!(code, 2, "{sensor}: {message}");
        assert!(message.contains(words), "{sensor}: {message}");
    }
    // Large and small numbers that can be computed with are right.
    for sensor in [rotating("rate_hz = 1e-3"), pinhole("fx_px = 1e-3"), pinhole("fx_px = 1e9")] {
        let (code, message) = job(&sensor);
        assert_eq!(code, 0, "{sensor}: {message}");
    }
}

#[test]
fn a_text_of_nothing_but_errors_is_read_in_bounds() {
    let begun = std::time::Instant::now();
    let (code, message) = lint(&"=\n".repeat(2 << 20));
    assert_eq!(code, 2);
    assert!(message.contains("not valid TOML") && message.len() < 4000, "{message}");
    // A valid file of that size takes some seconds without optimisation. All errors took a gigabyte.
    assert!(begun.elapsed().as_secs() < 60);
}

#[test]
fn case_lint_of_a_lens_slow() {
    let begun = std::time::Instant::now();
    let distortion = "distortion = [0.1, -0.05, 0.001, 0.001, 0.01, 0.1, 0.01, 0.001]";
    for size in ["width_px = 4096\nheight_px = 4096", "width_px = 1000000\nheight_px = 1"] {
        let (code, message) = lint(&format!("[pinhole]\n{size}\nhfov_deg = 80.0\n{distortion}\n"));
        assert_eq!(code, 0, "{message}");
    }
    // Every pixel was asked before: 27 s optimised, several minutes otherwise.
    assert!(begun.elapsed().as_secs() < 60, "{:?}", begun.elapsed());
}

#[test]
fn lint_finds_what_a_format_can_not_hold() {
    let work = Workplace::new();
    let job = fs::read_to_string(work.path("job.toml")).unwrap();
    for (text, words) in [
        (job.replace("rate_hz = 10.0", "rate_hz = 0.1"), "sensor \"top\" has no ply: a PLY's t counts"),
        (
            job.clone() + "[labels]\nground = 3000000000\n",
            "the scene has no ply: its labels are at most 2147483647",
        ),
    ] {
        fs::write(work.path("job.toml"), text).unwrap();
        for command in ["lint", "scan"] {
            let output = work.command(command, &[]).output().unwrap();
            assert_eq!(code(&output), 2, "{}", stderr(&output));
            assert!(stderr(&output).contains(words), "{}", stderr(&output));
            assert!(!work.path("out").exists());
        }
        let exr = work.scan(&["--dry-run", "--set", "output.formats=[\"exr\"]"]);
        assert_eq!(code(&exr), 0, "{}", stderr(&exr));
    }
}

/// Runs a command and gives the most memory that it had, in bytes, as the system tells while it runs.
#[cfg(target_os = "linux")]
pub(super) fn peak(mut command: Command) -> f64 {
    let mut child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let status = format!("/proc/{}/status", child.id());
    let mut peak = 0.0_f64;
    while child.try_wait().unwrap().is_none() {
        let text = fs::read_to_string(&status).unwrap_or_default();
        let line = text.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        let kilobytes = line.and_then(|line| line.trim().strip_suffix("kB")?.trim().parse::<f64>().ok());
        peak = peak.max(kilobytes.unwrap_or(0.0) * 1024.0);
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    let output = child.wait_with_output().unwrap();
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    peak
}

/// Checks that a measured peak is that of the estimate, or between two estimates, but for what every process has. An estimate may be
/// too large by a third, and too small by a quarter: what the system has given to a process isn't all in use.
#[cfg(target_os = "linux")]
fn assert_fits(what: &str, [least, most]: [u64; 2], peak: f64, idle: f64) {
    let [least_ratio, most_ratio] = [least, most].map(|estimate| estimate as f64 / (peak - idle));
    assert!(
        least_ratio < 1.32 && most_ratio > 0.76,
        "{what}: estimated {least} to {most}, peak {peak}, idle {idle}: {least_ratio} to {most_ratio}"
    );
}

/// The case memory-estimates: what `check`, `view` and `diff` hold is counted for all frames of a rig, and tables are.
#[cfg(target_os = "linux")]
#[test]
fn case_memory_estimates() {
    use beamcast::output::Format;
    use beamcast::run::memory::{self, Holding};
    let sensor = |i: usize| {
        format!(
            "[[sensor]]\nname = \"s{i}\"\npose = {{ position_m = [0.0, {i}.0, 1.0] }}\n[sensor.rotating]\n\
             elevations_deg = {{ from = -5.0, to = -30.0, count = 128 }}\ncolumns = 1024\nrate_hz = 10.0\n"
        )
    };
    let small = Workplace::new();
    let rig = Workplace::with_sensors(&(0..8).map(sensor).collect::<String>());
    let expect = "[[expect]]\nname = \"it sees\"\nreturns = { at_least = 0.1 }\n";
    for work in [&small, &rig] {
        let job = fs::read_to_string(work.path("job.toml")).unwrap();
        // The estimate assumes that nothing gets smaller by compression.
        let stored = "formats = [{ format = \"exr\", compression = \"none\" }]";
        let job = job.replace("formats = [\"exr\", \"ply\", \"png\"]", stored);
        fs::write(work.path("job.toml"), job + expect).unwrap();
    }
    let job = beamcast::load_job(&rig.path("job.toml"), &[]).unwrap();
    let estimate = |holding| memory::of_frames(&job.sensors, &[1; 8], &job.output.formats, holding);
    // How many files wait depends on the disk.
    let waiting = memory::frames_waiting(&job.sensors, &job.output.formats) as u64;
    let a_frame =
        job.sensors[0].sensor.pattern.rays() as u64 * Format::EXR.file_bytes_a_ray(&job.sensors[0].sensor);
    let check = |compared, page| Holding::Check { compared, page, detection: false };
    let page = rig.path("page.html");
    let page = page.to_str().unwrap();
    let files = estimate(Holding::Files);
    for (args, estimates) in [
        (&["scan"][..], [files - waiting * a_frame, files]),
        (&["check"], [estimate(check(false, false)); 2]),
        (&["check", "--html", page], [estimate(check(false, true)); 2]),
        (&["view", "--overwrite", "-o", page], [estimate(Holding::Views); 2]),
        (&["check", "--accept"], [estimate(check(true, false)); 2]),
        (&["check"], [estimate(check(true, false)); 2]),
    ] {
        let [idle, peak] = [&small, &rig].map(|work| peak(work.command(args[0], &args[1..])));
        assert_fits(&args.join(" "), estimates, peak, idle);
    }
}

/// The third part of the case memory-estimates: what a scene takes, placed often or stored whole.
#[cfg(target_os = "linux")]
#[test]
fn a_scene_takes_what_is_estimated() {
    let idle = peak(Workplace::new().command("scan", &["-q"]));
    for (placements, triangles, texture) in [(60_000, 2, 0), (1, 200_000, 0), (1, 200_000, 3000)] {
        let work = Workplace::new();
        write_placed(&work, placements, triangles);
        if texture > 0 {
            crate::textures::add_texture(&work.path("ground.gltf"), texture);
        }
        let output = work.scan(&["--dry-run", "--json"]);
        let estimate = json(&output.stdout)["scene_memory_bytes"].as_u64().unwrap();
        let peak = peak(work.command("scan", &["-q"]));
        assert_fits(&format!("{placements} times {triangles}, {texture}"), [estimate; 2], peak, idle);
    }
}

/// Gives the job a scene of a strip of triangles, placed often.
#[cfg(target_os = "linux")]
fn write_placed(work: &Workplace, placements: usize, triangles: usize) {
    let strip = (0..triangles + 2).flat_map(|i| [i as f32 * 0.01, (i % 7) as f32 * 0.001, (i % 2) as f32]);
    let vertices = triangles + 2;
    let mut bytes: Vec<u8> = strip.flat_map(f32::to_le_bytes).collect();
    bytes.extend((0..triangles as u32).flat_map(|i| [i, i + 1, i + 2]).flat_map(u32::to_le_bytes));
    let indices = 12 * vertices;
    let places = bytes.len();
    let place = |i: usize| [(i % 250) as f32 * 5.0, (i / 250) as f32, (i % 3) as f32];
    bytes.extend((0..placements).flat_map(place).flat_map(f32::to_le_bytes));
    fs::write(work.path("ground.bin"), &bytes).unwrap();
    let view = |from: usize, to: usize| serde_json::json!({ "buffer": 0, "byteOffset": from, "byteLength": to - from });
    let instancing = serde_json::json!({ "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": 2 } } });
    let scene = serde_json::json!({
        "asset": { "version": "2.0" },
        "extensionsUsed": ["EXT_mesh_gpu_instancing"],
        "buffers": [{ "uri": "ground.bin", "byteLength": bytes.len() }],
        "bufferViews": [view(0, indices), view(indices, places), view(places, bytes.len())],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": vertices, "type": "VEC3" },
            { "bufferView": 1, "componentType": 5125, "count": 3 * triangles, "type": "SCALAR" },
            { "bufferView": 2, "componentType": 5126, "count": placements, "type": "VEC3" },
        ],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
        "nodes": [{ "mesh": 0, "extensions": if placements > 1 { instancing } else { serde_json::json!({}) } }],
        "scenes": [{ "nodes": [0] }],
        "scene": 0,
    });
    fs::write(work.path("ground.gltf"), scene.to_string()).unwrap();
}

/// Instances that are nodes with names of their own take memory in the scene file, in the scene, in the hierarchy and in the manifest:
/// 0.9 kB each at the peak, where it was 3.1 kB while the manifest was a tree of values. The system gives memory in larger pieces.
#[cfg(target_os = "linux")]
#[test]
fn an_instance_with_a_name_takes_about_a_kilobyte() {
    const INSTANCES: usize = 50_000;
    let idle = peak(Workplace::new().command("scan", &["-q"]));
    let work = Workplace::new();
    let mut scene = json(&fs::read(work.path("ground.gltf")).unwrap());
    let node = |i: usize| serde_json::json!({ "name": format!("tile {i}"), "mesh": 0, "translation": [i % 250 * 50, 0, i / 250 * 50] });
    scene["nodes"] = (0..INSTANCES).map(node).collect();
    scene["scenes"] = serde_json::json!([{ "nodes": (0..INSTANCES).collect::<Vec<_>>() }]);
    fs::write(work.path("ground.gltf"), scene.to_string()).unwrap();
    let peak = peak(work.command("scan", &["-q"]));
    let each = (peak - idle) / INSTANCES as f64;
    assert!(each < 1500.0, "{each} bytes an instance");
    let manifest = json(&fs::read(work.path("out/manifest.json")).unwrap());
    assert_eq!(manifest["scene"]["instances"].as_array().unwrap().len(), INSTANCES);
}

/// A table that 64 sensors name is in memory once.
#[cfg(target_os = "linux")]
#[test]
fn a_table_of_many_sensors_is_held_once() {
    let sensor = |i: usize| format!("[[sensor]]\nname = \"s{i}\"\n[sensor.rays]\nfile = \"rays.csv\"\n");
    let [few, many] = [1, 64].map(|count| {
        let work = Workplace::with_sensors(&(0..count).map(sensor).collect::<String>());
        fs::write(work.path("rays.csv"), "x,y,z\n".to_owned() + &"1,0,0\n".repeat(100_000)).unwrap();
        peak(work.command("lint", &[]))
    });
    assert!(many < few + 8e6, "{few} and {many} bytes");
}

/// The case selftest-allocates-unasked, whose refusal tests/suite/cli.rs has for a job, for a sensor file.
#[test]
fn case_selftest_allocates_unasked() {
    let work = Workplace::new();
    let path = work.path("huge.toml");
    fs::write(&path, "[pinhole]\nwidth_px = 65536\nheight_px = 65536\nhfov_deg = 90.0\n").unwrap();
    let output = super::cli::beamcast(&["selftest", path.to_str().unwrap()]);
    assert_eq!(code(&output), 2, "{}", stderr(&output));
    assert!(stderr(&output).contains(" takes about "), "{}", stderr(&output));
}

/// The case baseline-kept-bomb: a record that lists 20 000 channels, each to be unpacked.
#[test]
fn case_baseline_kept_bomb() {
    let work = Workplace::new();
    let job = fs::read_to_string(work.path("job.toml")).unwrap();
    fs::write(work.path("job.toml"), job + "[check]\n").unwrap();
    assert_eq!(code(&work.command("check", &["--accept"]).output().unwrap()), 0);
    let path = work.path("job.baseline/baseline.json");
    let mut baseline = json(&fs::read(&path).unwrap());
    let sensor = &mut baseline["sensors"][0];
    sensor["kept"] = (0..20_000)
        .map(|i| (format!("c{i}"), serde_json::json!(0.5)))
        .collect::<serde_json::Map<_, _>>()
        .into();
    sensor["channels"]["range"] = "another".into();
    fs::write(&path, baseline.to_string()).unwrap();
    let check = work.command("check", &[]).output().unwrap();
    assert_eq!(code(&check), 1, "{}", stderr(&check));
    let told = String::from_utf8_lossy(&check.stdout).into_owned();
    assert!(told.contains("top.pixels is not what was accepted"), "{told}");
    // A record of more than is read of one.
    fs::write(&path, format!("{baseline}{}", " ".repeat(9 << 20))).unwrap();
    let check = work.command("check", &[]).output().unwrap();
    assert!(String::from_utf8_lossy(&check.stdout).contains("more than the 8388608 that are read"));
}

/// The case diff-outputs-repeated.
#[test]
fn case_diff_outputs_repeated() {
    let work = Workplace::new();
    assert_eq!(code(&work.scan(&[])), 0);
    let path = work.path("out/manifest.json");
    let mut manifest = json(&fs::read(&path).unwrap());
    let cloud = manifest["outputs"][1].clone();
    manifest["outputs"] = vec![cloud; 10_000].into();
    fs::write(&path, manifest.to_string()).unwrap();
    let out = work.path("out");
    let out = out.to_str().unwrap();
    let output = super::cli::beamcast(&["diff", out, out]);
    assert_eq!(code(&output), 3, "{}", stderr(&output));
    assert!(stderr(&output).contains("lists \"top/000000.ply\" twice"), "{}", stderr(&output));
}

/// One end reads what the other writes: `import` refuses as many channels as `lint` would, and takes as many as it takes.
#[test]
fn import_writes_no_more_than_is_read() {
    let work = Workplace::new();
    let (path, sensor) = (work.path("angles.csv"), work.path("sensor.toml"));
    let import = |channels: usize| {
        fs::write(&path, "1.25,0.5\n".repeat(channels)).unwrap();
        let (path, sensor) = (path.to_str().unwrap(), sensor.to_str().unwrap());
        super::cli::beamcast(&["import", path, "--as", "robosense", "-o", sensor, "--overwrite"])
    };
    for channels in [4097, 400_000] {
        let output = import(channels);
        assert_eq!(code(&output), 2, "{}", stderr(&output));
        assert!(stderr(&output).contains("more than 4096 lines"), "{}", stderr(&output));
        assert!(!sensor.exists());
    }
    let output = import(4096);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let output = super::cli::beamcast(&["lint", sensor.to_str().unwrap()]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
}

/// The case junit-not-xml.
#[test]
fn case_junit_not_xml() {
    let work = Workplace::new();
    let job = fs::read_to_string(work.path("job.toml")).unwrap();
    let expect = "[[expect]]\nname = \"a\\uFFFFb\\uFFFE\\u001bc\"\nreturns = { at_least = 0.99 }\n";
    fs::write(work.path("job.toml"), job + expect).unwrap();
    let report = work.path("report.xml");
    let output = work.command("check", &["--junit", report.to_str().unwrap()]).output().unwrap();
    assert_eq!(code(&output), 1, "{}", stderr(&output));
    let report = fs::read_to_string(report).unwrap();
    assert!(report.contains("a\u{fffd}b\u{fffd}\u{fffd}c"), "{report}");
    assert!(!report.contains(['\u{ffff}', '\u{fffe}', '\u{1b}']));
}

#[cfg(target_os = "linux")]
#[test]
fn what_a_full_device_does_not_take_is_an_error() {
    let work = Workplace::new();
    let job = work.path("job.toml");
    let job = job.to_str().unwrap();
    for args in [
        &["--help"][..],
        &["scan", "--help"],
        &["--version"],
        &["lint", job],
        &["lint", job, "--json"],
        &["man"],
    ] {
        let full = fs::File::options().write(true).open("/dev/full").unwrap();
        let output = super::cli::command(args).stdout(full).output().unwrap();
        assert_eq!(code(&output), 4, "{args:?}: {}", stderr(&output));
        assert!(stderr(&output).contains("stdout"), "{}", stderr(&output));
    }
}

#[test]
fn what_expectations_ask_for_is_limited_together() {
    let job = |expectations: &str| {
        lint(&format!(
            "scene = \"ground.gltf\"\n[[sensor]]\nname = \"top\"\n[sensor.pinhole]\nwidth_px = 4\nheight_px = 4\n\
             hfov_deg = 60.0\n{expectations}[output]\ndir = \"out\"\nformats = [\"exr\"]\n"
        ))
    };
    let zone = |i: usize| {
        format!(
            "[[expect]]\nname = \"e{i}\"\ncoverage = {{ x_m = [0.0, 10.0], y_m = [0.0, 10.0], cell_m = 0.0035, at_least = 0.1 }}\n"
        )
    };
    let (code, message) = job(&(0..13).map(zone).collect::<String>());
    assert_eq!(code, 2);
    assert!(message.contains("have more than 1e8 cells in all"), "{message}");
    assert_eq!(job(&(0..12).map(zone).collect::<String>()).0, 0);
    let returns = |i: usize| format!("[[expect]]\nname = \"e{i}\"\nreturns = {{ at_least = 0.1 }}\n");
    let (code, message) = job(&(0..1001).map(returns).collect::<String>());
    assert_eq!(code, 2);
    assert!(message.contains("1000"), "{message}");
}
