//! Bags: the files of a run, what becomes of them, and the messages about their options.

use std::fs;

use serde_json::Value;

use super::cli::{Workplace, beamcast, code, files, json, stderr, stdout};

const FILES: [&str; 2] = ["bag/bag_0.mcap", "bag/metadata.yaml"];

/// A LiDAR on a body that drives round a circle.
fn workplace() -> Workplace {
    Workplace::with_sensors(
        "[[sensor]]\nname = \"top\"\npose = { position_m = [0.0, 0.0, 1.0] }\n\
         [sensor.rotating]\nelevations_deg = [30.0, -30.0]\ncolumns = 36\nrate_hz = 10.0\n\
         [trajectory]\ntwist = { linear_m_s = [1.0, 0.0, 0.0], angular_deg_s = [0.0, 0.0, 10.0] }\n\
         [sequence]\nframes = 4\n",
    )
}

const BAG: &str = "output.formats=[{ format = \"mcap\", imu_hz = 100, gyro_noise = 0.01 }]";

#[test]
fn a_run_is_one_bag_the_same_on_any_number_of_threads() {
    let work = workplace();
    let scanned = |folder: &str, threads: &str| {
        let out = work.path(folder);
        let args = ["--out", out.to_str().unwrap(), "--set", BAG, "--threads", threads];
        let output = work.scan(&args);
        assert_eq!(code(&output), 0, "{}", stderr(&output));
        files(&out)
    };
    let (one, four) = (scanned("one", "1"), scanned("four", "4"));
    assert_eq!(one, four);
    assert_eq!(
        one.keys().map(String::as_str).collect::<Vec<_>>(),
        [FILES[0], FILES[1], "manifest.json", "poses.csv"]
    );
    let manifest: Value = json(&one["manifest.json"]);
    let listed: Vec<&str> = manifest["outputs"]
        .as_array()
        .unwrap()
        .iter()
        .map(|output| output["path"].as_str().unwrap())
        .collect();
    assert_eq!(listed[..2], FILES);
    let metadata = String::from_utf8(one[FILES[1]].clone()).unwrap();
    // 4 clouds; 5 states, each in two topics; 41 measurements; the sensor's mount.
    assert!(
        metadata.contains("  message_count: 56\n") && metadata.contains("    nanoseconds: 400000000\n"),
        "{metadata}"
    );
    let out = work.path("one");
    assert_eq!(code(&beamcast(&["verify", out.to_str().unwrap()])), 0);

    // What a later run does not write is removed, and nothing else.
    fs::write(out.join("bag/notes.txt"), "mine").unwrap();
    let output =
        work.scan(&["--out", out.to_str().unwrap(), "--overwrite", "--set", "output.formats=[\"pcd\"]"]);
    assert_eq!(code(&output), 0, "{}", stderr(&output));
    let left = files(&out);
    assert!(left.contains_key("bag/notes.txt") && FILES.iter().all(|name| !left.contains_key(*name)));
}

#[test]
fn a_bag_is_not_replaced_unasked_and_its_run_neither_parted_nor_resumed() {
    let work = workplace();
    let out = work.path("out");
    let scan = |more: &[&str]| {
        work.scan(&[&["--out", out.to_str().unwrap(), "--set", "output.formats=[\"mcap\"]"], more].concat())
    };
    for more in [&["--shard", "1/2"][..], &["--resume"]] {
        let refused = scan(more);
        assert_eq!(code(&refused), 2);
        let told = stderr(&refused);
        assert!(told.contains("bag/bag_0.mcap") && told.contains("neither parted nor resumed"), "{told}");
    }
    let plan = stdout(&scan(&["--dry-run"]));
    assert!(FILES.iter().all(|name| plan.contains(name)) && plan.contains("would write 4 files"), "{plan}");
    fs::create_dir_all(out.join("bag")).unwrap();
    fs::write(out.join(FILES[1]), "mine").unwrap();
    let refused = scan(&[]);
    assert!(code(&refused) != 0 && stderr(&refused).contains("metadata.yaml"), "{}", stderr(&refused));
    assert_eq!(files(&out).len(), 1);
    assert_eq!(code(&scan(&["--overwrite"])), 0);
    assert!(files(&out).contains_key(FILES[0]));
}

#[test]
fn a_wrong_option_of_a_bag_is_told_with_what_would_be_right() {
    let work = workplace();
    for (options, told) in [
        ("layout = \"velodine\"", "did you mean \"velodyne\"?"),
        ("time_unit = \"ns\"", "time_unit is of the layout \"fast_lio\""),
        ("imu_hz = -1", "from 0 to 10000"),
        ("gyro_noise = 0.1", "give imu_hz, too"),
        ("odom_topic = \"odom\"", "is no topic"),
        ("layout = \"livox_custom\", organised = true", "leave out `organised`"),
    ] {
        let set = format!("output.formats=[{{ format = \"mcap\", {options} }}]");
        let output = work.scan(&["--set", &set]);
        assert!(code(&output) == 2 && stderr(&output).contains(told), "{options}: {}", stderr(&output));
    }
}

#[test]
fn two_sensors_have_no_frame_in_common() {
    let work = Workplace::with_sensors(
        "[[sensor]]\nname = \"a\"\n[sensor.rotating]\nelevations_deg = [-30.0]\ncolumns = 36\nrate_hz = 10.0\n\
         [[sensor]]\nname = \"b\"\npose = { position_m = [0.0, 0.0, 1.0] }\n\
         [sensor.rotating]\nelevations_deg = [-30.0]\ncolumns = 36\nrate_hz = 10.0\n",
    );
    let output = work.scan(&["--set", "output.formats=[{ format = \"mcap\", sensor_frame = \"laser\" }]"]);
    let told = stderr(&output);
    assert!(code(&output) != 0 && told.contains("the same frame, \"laser\""), "{told}");
}
