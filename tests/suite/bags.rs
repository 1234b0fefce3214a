//! Bags: the files of a run, what becomes of them, and the messages about their options.

use std::fs;

use beamcast::output::recorded::{Cloud, Part, Recorded};
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

fn good(args: &[&str]) -> String {
    let output = beamcast(args);
    assert_eq!(code(&output), 0, "{args:?}: {}", stderr(&output));
    stdout(&output)
}

fn cloud(path: &std::path::Path) -> Cloud {
    match Recorded::open(path, u64::MAX).unwrap() {
        Recorded::Cloud(cloud) => cloud,
        other => panic!("{other:?}"),
    }
}

fn parts(path: &std::path::Path) -> Vec<Part> {
    match Recorded::open(path, u64::MAX).unwrap() {
        Recorded::Images(parts) => parts,
        other => panic!("{other:?}"),
    }
}

/// The places of points, in an order of their own: drivers have another one than the range image.
fn places(cloud: &Cloud) -> Vec<[u64; 3]> {
    let axes = ["x", "y", "z"].map(|axis| cloud.field(axis).unwrap());
    let mut places: Vec<_> = (0..cloud.points).map(|point| axes.map(|axis| axis[point].to_bits())).collect();
    places.sort_unstable();
    places
}

#[test]
fn the_messages_of_a_bag_are_converted_compared_and_shown() {
    let work = workplace();
    let scanned =
        work.scan(&["--set", "output.formats=[\"ply\", { format = \"mcap\", layout = \"velodyne\" }]"]);
    assert_eq!(code(&scanned), 0, "{}", stderr(&scanned));
    let path = |name: &str| work.path(name).to_str().unwrap().to_owned();
    let (bag, folder) = (path("out/bag/bag_0.mcap"), path("out/bag"));
    good(&["convert", "-q", &bag, &path("one.ply"), "--frames", "2"]);
    let (one, own) = (cloud(&work.path("one.ply")), cloud(&work.path("out/top/000002.ply")));
    assert!(one.points > 0 && places(&one) == places(&own));
    let names: Vec<_> = one.fields.iter().map(|field| field.name.as_str()).collect();
    assert_eq!(names, ["x", "y", "z", "intensity", "ring", "time"]);

    good(&["convert", "-q", &folder, &path("clouds"), "--format", "pcd"]);
    let names = |folder: &str| files(&work.path(folder)).into_keys().collect::<Vec<_>>();
    let all = ["manifest.json", "top/000000.pcd", "top/000001.pcd", "top/000002.pcd", "top/000003.pcd"];
    assert_eq!(names("clouds"), all);
    good(&["verify", &path("clouds")]);
    good(&["diff", &bag, &path("clouds")]);
    good(&["diff", &folder, &bag, "--frames", "1..3"]);
    assert_eq!(code(&beamcast(&["diff", &bag, &path("clouds"), "--frames", "0..9"])), 0);
    good(&["convert", "-q", &bag, &path("clouds"), "--format", "pcd", "--frames", "1..3", "--overwrite"]);
    assert_eq!(names("clouds"), ["manifest.json", all[2], all[3]]);
    let report: Value =
        serde_json::from_str(&good(&["convert", &bag, &path("one.npy"), "--frames", "0", "--json"])).unwrap();
    assert_eq!(report["outputs"].as_array().unwrap().len(), 1);

    good(&["view", "-q", &bag, "-o", &path("all.html")]);
    good(&["view", "-q", &bag, "-o", &path("one.html"), "--frames", "3", "--topic", "/top/points"]);
    assert!(
        fs::metadata(work.path("all.html")).unwrap().len()
            > fs::metadata(work.path("one.html")).unwrap().len()
    );
    let told = good(&["info", &bag]);
    assert!(told.contains(" points in top, stamps 0.000 s to 0.300 s: x float, y float, z float, intensity float, ring ushort"), "{told}");

    for (args, told) in [
        (
            &["convert", &bag, &path("new.ply")][..],
            "has 4 messages of `/top/points`, and a file holds one: --frames N chooses it",
        ),
        (
            &["convert", &bag, &path("new.ply"), "--frames", "4"],
            "the topic `/top/points` has no message 4: it has 0 to 3",
        ),
        (
            &["diff", &bag, &bag, "--topic", "/odom"],
            "the topic `/odom` is of `nav_msgs/msg/Odometry`; its clouds and depth images are of `/top/points`",
        ),
        (
            &["view", &bag, "-o", &path("new.html"), "--topic", "/nothing"],
            "the topic `/nothing` is not in it",
        ),
        (&["convert", &bag, &path("new.exr"), "--frames", "0"], "is no range image"),
        (
            &["convert", &bag, &path("new"), "--format", "e57"],
            "is no range image, and e57 is made of such alone",
        ),
    ] {
        let refused = beamcast(args);
        assert!(code(&refused) == 3 && stderr(&refused).contains(told), "{args:?}: {}", stderr(&refused));
    }
    assert!(!work.path("new").exists());
}

#[test]
fn a_bag_of_several_topics_needs_one_and_depth_is_an_image() {
    let work = Workplace::with_sensors(
        "[[sensor]]\nname = \"a\"\n[sensor.rotating]\nelevations_deg = [-30.0]\ncolumns = 36\nrate_hz = 10.0\n\
         [[sensor]]\nname = \"b\"\npose = { position_m = [0.0, 0.0, 1.0] }\n\
         [sensor.pinhole]\nwidth_px = 8\nheight_px = 6\nhfov_deg = 60.0\nrate_hz = 10.0\n[sensor.range]\nmax_m = 9.0\n",
    );
    let scanned = work.scan(&["--set", "output.formats=[\"exr\", { format = \"mcap\", labels = true }]"]);
    assert_eq!(code(&scanned), 0, "{}", stderr(&scanned));
    let path = |name: &str| work.path(name).to_str().unwrap().to_owned();
    let bag = path("out/bag/bag_0.mcap");
    let refused = beamcast(&["convert", &bag, &path("new.ply"), "--frames", "0"]);
    let told = stderr(&refused);
    assert!(
        told.contains("has clouds or depth images of `/a/points` and `/b/depth`: --topic NAME chooses one"),
        "{told}"
    );
    good(&["convert", "-q", &bag, &path("depth.exr"), "--topic", "/b/depth", "--frames", "0"]);
    let (made, own) = (parts(&work.path("depth.exr")), parts(&work.path("out/b/000000.exr")));
    assert_eq!(made[0].image.f32("Z"), own[0].image.f32("Z"));
    let labels = beamcast(&["view", &bag, "--topic", "/b/labels", "-o", &path("new.html")]);
    assert!(
        stderr(&labels).contains("the topic `/b/labels` is of `sensor_msgs/msg/Image`"),
        "{}",
        stderr(&labels)
    );
}
