//! Datasets: the same bytes whether a run of many frames goes through in one piece, on any number of threads, in parts that are
//! merged, or is killed and goes on; and a folder that can be verified.

use std::collections::BTreeMap;
use std::fs;
#[cfg(unix)]
use std::process::Stdio;

use super::cli::{Workplace, beamcast, code, files, json, stderr, stdout};

/// A rig of two sensors with rates of their own: the LiDAR has `frames` frames, and the camera as many.
fn rig(frames: u64, columns: usize) -> Workplace {
    let work = Workplace::with_sensors(&format!(
        "[sequence]\nframes = {frames}\nstart_s = 2.5\n\
         [[sensor]]\nname = \"top\"\npose = {{ position_m = [0.0, 0.0, 1.0] }}\n[sensor.rotating]\n\
         elevations_deg = {{ from = 5.0, to = -30.0, count = 16 }}\ncolumns = {columns}\nrate_hz = 10.0\n\
         [[sensor]]\nname = \"front\"\npose = {{ position_m = [0.0, 0.0, 1.0], rpy_deg = [0.0, 20.0, 0.0] }}\n\
         [sensor.pinhole]\nwidth_px = 24\nheight_px = 16\nhfov_deg = 70.0\nrate_hz = 25.0\n"
    ));
    let job = fs::read_to_string(work.path("job.toml")).unwrap();
    fs::write(work.path("job.toml"), job.replace("\"exr\", \"ply\", \"png\"", "\"exr\", \"ply\"")).unwrap();
    work
}

/// Scans into a folder of the workplace.
fn scan(work: &Workplace, folder: &str, args: &[&str]) -> std::process::Output {
    let out = work.path(folder);
    work.scan(&[&["--out", out.to_str().unwrap(), "-q"], args].concat())
}

fn scanned(work: &Workplace, folder: &str, args: &[&str]) -> BTreeMap<String, Vec<u8>> {
    let output = scan(work, folder, args);
    assert_eq!(code(&output), 0, "{args:?}: {}", stderr(&output));
    files(&work.path(folder))
}

/// Runs a subcommand on a folder of the workplace.
fn on(work: &Workplace, command: &str, folder: &str, args: &[&str]) -> std::process::Output {
    beamcast(&[&[command, work.path(folder).to_str().unwrap()], args].concat())
}

/// Checks that two folders are the same, without printing bytes.
fn assert_same(one: &BTreeMap<String, Vec<u8>>, other: &BTreeMap<String, Vec<u8>>, what: &str) {
    let names: Vec<_> = one.keys().collect();
    assert_eq!(names, other.keys().collect::<Vec<_>>(), "{what}");
    for (name, content) in one {
        assert!(*content == other[name], "{what}: {name} differs");
    }
}

#[test]
fn one_run_any_threads_and_merged_parts_give_the_same_bytes() {
    let work = rig(40, 32);
    let whole = scanned(&work, "whole", &["--threads", "1"]);
    assert_eq!(whole.len(), 40 * 2 * 2 + 2, "files of frames, the poses, and the manifest");
    let manifest = json(&whole["manifest.json"]);
    let frames = serde_json::json!([
        { "sensor": "top", "first": 0, "count": 40, "of": 40 },
        { "sensor": "front", "first": 0, "count": 40, "of": 40 },
    ]);
    assert_eq!(manifest["frames"], frames);
    // Outputs are listed by the times at which their frames start: the camera's second frame comes before the LiDAR's.
    let outputs = manifest["outputs"].as_array().unwrap();
    let first: Vec<_> =
        outputs[..8].iter().step_by(2).map(|output| output["path"].as_str().unwrap()).collect();
    assert_eq!(first, ["top/000000.exr", "front/000000.exr", "front/000001.exr", "front/000002.exr"]);
    for threads in ["2", "3", "16"] {
        let other = scanned(&work, threads, &["--threads", threads]);
        assert_same(&whole, &other, &format!("{threads} threads"));
    }
    for count in [3, 16] {
        let folder = format!("parts{count}");
        // The parts come in any order.
        for part in (1..=count).rev() {
            scanned(&work, &folder, &["--shard", &format!("{part}/{count}")]);
        }
        assert!(!work.path(&folder).join("manifest.json").exists());
        let merged = on(&work, "merge", &folder, &["--json"]);
        assert_eq!(code(&merged), 0, "{}", stderr(&merged));
        let told = json(&merged.stdout);
        assert_eq!(
            (&told["parts"], &told["frames"], &told["files"]),
            (&count.into(), &80.into(), &161.into())
        );
        assert_same(&whole, &files(&work.path(&folder)), &format!("{count} parts"));
    }
    // A frame alone is that of the run.
    let alone = scanned(&work, "alone", &["--frames", "37"]);
    assert_eq!(alone.len(), 6);
    for (name, content) in alone.iter().filter(|(name, _)| name.contains('/')) {
        assert!(name.contains("/000037.") && *content == whole[name], "{name}");
    }
    // As do some frames in parts.
    let some = scanned(&work, "some", &["--frames", "5..25"]);
    for part in ["1/2", "2/2"] {
        scanned(&work, "some-parts", &["--frames", "5..25", "--shard", part]);
    }
    assert_eq!(code(&on(&work, "merge", "some-parts", &[])), 0);
    assert_same(&some, &files(&work.path("some-parts")), "frames 5..25 in parts");
}

/// Kills the process `kills` times at moments that are spread over the run, and lets the run go on each time. Returns how often it
/// was killed before its end.
#[cfg(unix)]
fn kill_and_resume(work: &Workplace, folder: &str, kills: u64, run_ms: u64) -> u64 {
    let mut killed = 0;
    // A Weyl sequence: moments that repeat nothing and cover all of the run.
    for kill in 1..=kills {
        let out = work.path(folder);
        let args = ["--out", out.to_str().unwrap(), "-q", "--resume"];
        let mut child =
            work.command("scan", &args).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        let part = (kill as f64 * 0.618_033_988_749_894_9).fract();
        std::thread::sleep(std::time::Duration::from_micros((part * run_ms as f64 * 1e3) as u64));
        let has_ended = child.try_wait().unwrap().is_some();
        child.kill().unwrap();
        let output = child.wait_with_output().unwrap();
        match output.status.code() {
            None => killed += 1,
            Some(code) => assert_eq!(code, 0, "{}", stderr(&output)),
        }
        if has_ended {
            // The run is complete; another begins.
            fs::remove_dir_all(&out).unwrap();
        }
    }
    killed
}

#[cfg(unix)]
#[test]
fn a_run_that_is_killed_and_goes_on_gives_the_same_bytes() {
    let work = rig(30, 64);
    let begun = std::time::Instant::now();
    let whole = scanned(&work, "whole", &[]);
    let run_ms = begun.elapsed().as_millis() as u64;
    // The campaign of 200 kills takes a quarter of an hour.
    let kills = if std::env::var_os("BEAMCAST_THOROUGH").is_some() { 200 } else { 6 };
    let killed = kill_and_resume(&work, "killed", kills, run_ms + 50);
    assert!(killed > 0, "every run had ended before it was killed");
    println!("{killed} of {kills} runs were killed before their end, which takes {run_ms} ms");
    let resumed = scanned(&work, "killed", &["--resume"]);
    assert_same(&whole, &resumed, "killed and resumed");
    // What is complete is left alone.
    assert_same(&whole, &scanned(&work, "killed", &["--resume"]), "resumed once more");
    let verified = on(&work, "verify", "killed", &[]);
    assert_eq!(code(&verified), 0, "{}", stdout(&verified));
}

/// Leaves a run that was stopped: that of a part whose journal is cut off behind some lines.
fn stopped(work: &Workplace, folder: &str, shard: &str, lines: usize) {
    scanned(work, folder, &["--shard", shard]);
    let (part, count) = shard.split_once('/').unwrap();
    let path = work.path(folder).join(format!("journal-{part}-of-{count}.jsonl"));
    let text = fs::read_to_string(&path).unwrap();
    let kept: String = text.split_inclusive('\n').take(lines + 1).collect();
    // The last line is torn.
    fs::write(&path, kept + "{\"sensor\":\"to").unwrap();
}

#[test]
fn what_was_stopped_goes_on_and_nothing_else_is_mixed_with_it() {
    let work = rig(6, 16);
    let whole = scanned(&work, "whole", &[]);
    stopped(&work, "out", "1/2", 2);
    scanned(&work, "out", &["--shard", "2/2"]);

    let unfinished = on(&work, "merge", "out", &[]);
    assert_eq!(code(&unfinished), 3, "{}", stderr(&unfinished));
    let told = stderr(&unfinished);
    assert!(
        told.contains("frame 2 of sensor \"top\"") && told.contains("scan --shard 1/2 --resume"),
        "{told}"
    );
    let verified = on(&work, "verify", "out", &[]);
    assert_eq!(code(&verified), 1, "{}", stdout(&verified));
    assert!(stdout(&verified).contains("journal-1-of-2.jsonl: the run has not come to its end"));

    for (args, words) in [
        (&["--shard", "1/2"][..], "is of a run that was stopped; --resume goes on with it"),
        (&["--shard", "1/3", "--resume"], "is one of 2 parts, and this is one of 3"),
        (&["--resume"], "is one of 2 parts of a run: `beamcast merge`"),
        (&["--shard", "1/2", "--resume", "--seed", "7"], "was written with the seed 0, and this run has 7"),
        (&["--shard", "1/2", "--resume", "--frames", "0..4"], "is of other frames of the job"),
        (
            &["--shard", "1/2", "--resume", "--set", "sensor.top.range.max_m=5"],
            "is of another job: `sensor[0].range` is not the same",
        ),
    ] {
        let before = files(&work.path("out"));
        let refused = scan(&work, "out", args);
        assert_eq!(code(&refused), 4, "{args:?}: {}", stderr(&refused));
        assert!(stderr(&refused).contains(words), "{args:?}: {}", stderr(&refused));
        assert_same(&before, &files(&work.path("out")), words);
    }
    // The job is the same, and the scene's buffer is not.
    let buffer = fs::read(work.path("ground.bin")).unwrap();
    let mut moved = buffer.clone();
    moved[..4].copy_from_slice(&(-19.0_f32).to_le_bytes());
    fs::write(work.path("ground.bin"), &moved).unwrap();
    let refused = scan(&work, "out", &["--shard", "1/2", "--resume"]);
    assert_eq!(code(&refused), 4);
    assert!(
        stderr(&refused).contains("was written when \"ground.bin\" had another content"),
        "{}",
        stderr(&refused)
    );
    fs::write(work.path("ground.bin"), buffer).unwrap();

    // A file that is gone is made again, with those after it.
    fs::remove_file(work.path("out/top/000000.exr")).unwrap();
    scanned(&work, "out", &["--shard", "1/2", "--resume"]);
    assert_eq!(code(&on(&work, "merge", "out", &[])), 0);
    assert_same(&whole, &files(&work.path("out")), "stopped, resumed and merged");
    let again = on(&work, "merge", "out", &[]);
    assert!(stderr(&again).contains("has its manifest already"), "{}", stderr(&again));
    let refused = scan(&work, "out", &["--shard", "1/2", "--overwrite"]);
    assert!(stderr(&refused).contains("a part replaces no run"), "{}", stderr(&refused));
    let refused = scan(&work, "out", &["--resume", "--seed", "7"]);
    assert!(stderr(&refused).contains("the seed 0, and this run has 7"), "{}", stderr(&refused));
}

#[test]
fn a_missing_part_is_told_with_its_frames() {
    let work = rig(20, 16);
    for part in ["1/3", "3/3"] {
        scanned(&work, "out", &["--shard", part]);
    }
    let merged = on(&work, "merge", "out", &[]);
    assert_eq!(code(&merged), 3);
    let told = stderr(&merged);
    assert!(told.contains("lacks part 2 of 3: frames 1, 4, 7, 10, 13, … 19"), "{told}");
    assert!(!work.path("out/manifest.json").exists());
    let nothing = on(&work, "merge", "nowhere", &[]);
    assert!(stderr(&nothing).contains("has no parts of a run"), "{}", stderr(&nothing));
}

#[test]
fn verify_finds_what_is_not_as_it_was_written() {
    let work = rig(3, 16);
    scanned(&work, "out", &[]);
    let verify = || {
        let output = on(&work, "verify", "out", &["--json"]);
        (code(&output), json(&output.stdout))
    };
    let (exit, found) = verify();
    assert_eq!((exit, &found["whole"], &found["files"]), (0, &true.into(), &13.into()), "{found}");

    let flipped = work.path("out/top/000001.exr");
    let mut content = fs::read(&flipped).unwrap();
    let middle = content.len() / 2;
    content[middle] ^= 1;
    fs::write(&flipped, content).unwrap();
    fs::remove_file(work.path("out/front/000002.ply")).unwrap();
    fs::write(work.path("out/front/000000.exr"), "short").unwrap();
    fs::write(work.path("out/front/000009.exr"), "more").unwrap();
    let (exit, found) = verify();
    assert_eq!(exit, 1);
    let differences: Vec<_> = found["differences"]
        .as_array()
        .unwrap()
        .iter()
        .map(|found| (found["path"].as_str().unwrap(), found["kind"].as_str().unwrap()))
        .collect();
    assert_eq!(
        differences,
        [
            ("front/000000.exr", "changed"),
            ("front/000002.ply", "missing"),
            ("front/000009.exr", "unknown"),
            ("top/000001.exr", "changed"),
        ]
    );
    // A manifest from which a line was taken lacks a frame.
    let path = work.path("out/manifest.json");
    let mut manifest = json(&fs::read(&path).unwrap());
    manifest["outputs"].as_array_mut().unwrap().retain(|output| output["path"] != "top/000002.exr");
    fs::write(&path, manifest.to_string()).unwrap();
    let told = stdout(&on(&work, "verify", "out", &[]));
    assert!(told.contains("manifest.json: does not list all files of frame 2 of sensor \"top\""), "{told}");
    assert_eq!(code(&on(&work, "verify", "nowhere", &[])), 3);
}

#[test]
fn a_sensor_without_a_rate_is_no_sensor_of_a_sequence() {
    let work = rig(2, 16);
    let job = fs::read_to_string(work.path("job.toml"))
        .unwrap()
        .replace("hfov_deg = 70.0\nrate_hz = 25.0\n", "hfov_deg = 70.0\n");
    for (length, words) in [("frames = 2", "2 frames"), ("duration_s = 1.5", "1.5 s")] {
        fs::write(work.path("job.toml"), job.replace("frames = 2", length)).unwrap();
        let output = work.command("lint", &[]).output().unwrap();
        let told = stderr(&output);
        assert_eq!(code(&output), 2, "{told}");
        assert!(
            told.contains("sensor `front` has no rate") && told.contains(words) && told.contains("rate_hz"),
            "{told}"
        );
    }
    fs::write(work.path("job.toml"), job.replace("frames = 2", "frames = 1")).unwrap();
    assert_eq!(scanned(&work, "out", &[]).len(), 6);
}

#[test]
fn frames_are_told_one_by_one_and_together() {
    let work = rig(4, 16);
    let output = work.scan(&["--json-lines"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let text = stdout(&output);
    let lines: Vec<_> = text.lines().map(|line| json(line.as_bytes())).collect();
    assert_eq!(lines.len(), 8);
    assert_eq!(
        (&lines[1]["sensor"], &lines[1]["frame"], &lines[1]["start_s"]),
        (&"front".into(), &0.into(), &2.5.into())
    );
    assert!(stderr(&output).contains("top: 4 frames, 1024 rays, "), "{}", stderr(&output));
    let summary = json(&work.scan(&["--json", "--overwrite"]).stdout);
    assert_eq!((&summary["files"], &summary["sensors"][0]["frames"]), (&17.into(), &4.into()));
    let hits: u64 = lines
        .iter()
        .filter(|line| line["sensor"] == "top")
        .map(|line| line["statistics"]["hits"].as_u64().unwrap())
        .sum();
    assert_eq!(summary["sensors"][0]["hits"], hits);
    let plan = stdout(&work.scan(&["--dry-run", "--overwrite", "--frames", "1..3"]));
    assert!(plan.contains("rays a frame, 2 of 4 frames, which start from 2.5 s to 2.8 s"), "{plan}");
    assert!(plan.contains("would remove, of an earlier run:") && plan.contains("top/000003.exr"), "{plan}");
    // What a longer run has left is removed by a shorter one.
    let work_files = |args: &[&str]| {
        let output = work.scan(args);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        files(&work.path("out")).len()
    };
    assert_eq!(work_files(&["--overwrite", "--frames", "1..3", "-q"]), 10);
}

/// The memory of a run does not depend on its number of frames.
#[cfg(target_os = "linux")]
#[test]
fn a_thousand_frames_take_the_memory_of_ten() {
    let [few, many] = [10, 1000].map(|frames| {
        let work = Workplace::with_sensors(&format!(
            "[sequence]\nframes = {frames}\n[[sensor]]\nname = \"top\"\npose = {{ position_m = [0.0, 0.0, 1.0] }}\n\
             [sensor.rotating]\nelevations_deg = {{ from = 5.0, to = -30.0, count = 64 }}\ncolumns = 1024\nrate_hz = 10.0\n"
        ));
        let args = ["-q", "--threads", "2", "--set", "output.formats=[\"labels\"]"];
        super::guards::peak(work.command("scan", &args))
    });
    // A longer run finds the worst moment of casting a frame beside writing another, which is worth less than a frame. If each frame left
    // a hundredth of its memory behind, a thousand would take ten frames more.
    let frame = (64 * 1024 * beamcast::Frame::BYTES_A_PIXEL) as f64;
    assert!(many < few + frame, "10 frames take {few} bytes at most, 1000 take {many}");
}

#[test]
fn frames_that_no_sensor_has_are_refused() {
    let work = rig(3, 16);
    let refused = scan(&work, "out", &["--frames", "7..9"]);
    assert_eq!(code(&refused), 2);
    let told = stderr(&refused);
    assert!(
        told.contains("the job has no frames 7..9: its sensors have at most 3, counted from 0"),
        "{told}"
    );
    assert!(!work.path("out").exists());
}

/// Formats that are folders have several files a frame, and files that are made of all frames at the run's end.
#[test]
fn folders_of_data_sets_are_the_same_in_one_run_in_parts_and_resumed() {
    let work = rig(6, 16);
    let folders = "output.formats=[\"exr\", \"png\", \"kitti\", { format = \"nuscenes\", lidarseg = true }]";
    let set = ["--set", folders, "--set", "truth.boxes=\"all\""];
    let run = |folder: &str, args: &[&str]| scanned(&work, folder, &[&set[..], args].concat());
    let whole = run("whole", &["--threads", "1"]);
    for name in [
        "top/velodyne/000005.bin",
        "top/labels/000005.label",
        "top/poses.txt",
        "top/times.txt",
        "top/calib.txt",
        "front/velodyne/000000.bin",
        "front/label_2/000000.txt",
        "front/calib/000000.txt",
        "nuscenes/samples/top/000005.pcd.bin",
        "nuscenes/samples/front/000005.color.png",
        "nuscenes/lidarseg/v1.0-beamcast/top-000005_lidarseg.bin",
        "nuscenes/v1.0-beamcast/sample_annotation.json",
        "nuscenes/maps/none.png",
    ] {
        assert!(whole.contains_key(name), "{name} of {:?}", whole.keys());
    }
    assert!(!whole.contains_key("top/label_2/000000.txt"), "a LiDAR has no picture");
    assert!(!whole["front/label_2/000000.txt"].is_empty());
    let annotations = json(&whole["nuscenes/v1.0-beamcast/sample_annotation.json"]);
    assert!(!annotations.as_array().unwrap().is_empty());
    for (name, lines) in [("top/poses.txt", 6), ("top/times.txt", 6), ("top/calib.txt", 5)] {
        assert_eq!(String::from_utf8_lossy(&whole[name]).lines().count(), lines, "{name}");
    }

    // In parts, the first of which is stopped and goes on.
    run("parts", &["--shard", "1/2"]);
    let journal = work.path("parts/journal-1-of-2.jsonl");
    let text = fs::read_to_string(&journal).unwrap();
    fs::write(&journal, text.split_inclusive('\n').take(4).collect::<String>()).unwrap();
    run("parts", &["--shard", "2/2"]);
    assert!(!work.path("parts/top/poses.txt").exists(), "it is there when it is whole");
    run("parts", &["--shard", "1/2", "--resume"]);
    assert_eq!(code(&on(&work, "merge", "parts", &[])), 0);
    assert_same(&whole, &files(&work.path("parts")), "parts");

    for (command, args) in [("verify", &[][..]), ("diff", &[work.path("parts").to_str().unwrap()])] {
        let output = on(&work, command, "whole", args);
        assert_eq!(code(&output), 0, "{command}: {}", stderr(&output));
    }
    for (command, out) in [("view", "page.html"), ("film", "film.png")] {
        let output = on(&work, command, "whole", &["-o", work.path(out).to_str().unwrap()]);
        assert_eq!(code(&output), 0, "{command}: {}", stderr(&output));
    }
    fs::write(work.path("whole/top/velodyne/notes.bin"), "mine").unwrap();
    fs::remove_file(work.path("whole/nuscenes/samples/top/000003.pcd.bin")).unwrap();
    let told = stdout(&on(&work, "verify", "whole", &[]));
    assert!(told.contains("top/velodyne/notes.bin") && told.contains("top/000003.pcd.bin"), "{told}");

    // A file of a run is in the way of another, and is removed with the run that it is of.
    for kept in ["front/velodyne/000000.bin", "top/poses.txt", "nuscenes/v1.0-beamcast/scene.json"] {
        let folder = work.path("taken");
        fs::create_dir_all(folder.join(kept).parent().unwrap()).unwrap();
        fs::write(folder.join(kept), "").unwrap();
        let refused = scan(&work, "taken", &set);
        assert!(code(&refused) == 4 && stderr(&refused).contains(kept.rsplit_once('/').unwrap().1), "{kept}");
        fs::remove_dir_all(folder).unwrap();
    }
    let left = scanned(&work, "whole", &["--overwrite"]);
    let others: Vec<_> =
        left.keys().filter(|name| name.contains("velodyne") || name.contains("nuscenes")).collect();
    assert_eq!(others, ["top/velodyne/notes.bin"], "what no run wrote is kept");
}
