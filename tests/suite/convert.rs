//! `beamcast convert`: recorded clouds and images in other formats, and the folders of scans.

use std::fs;
use std::path::Path;

use beamcast::output::recorded::{Cloud, Part, Recorded};

use super::formats::Room;

fn open(path: &Path) -> Recorded {
    Recorded::open(path, u64::MAX).unwrap()
}

fn cloud(room: &Room, name: &str) -> Cloud {
    match open(&room.0.path().join(name)) {
        Recorded::Cloud(cloud) => cloud,
        other => panic!("{name}: {other:?}"),
    }
}

fn parts(room: &Room, name: &str) -> Vec<Part> {
    match open(&room.0.path().join(name)) {
        Recorded::Images(parts) => parts,
        other => panic!("{name}: {other:?}"),
    }
}

fn good(room: &Room, args: &[&str]) -> String {
    let (code, said) = room.run(args);
    assert_eq!(code, 0, "{args:?}: {said}");
    said
}

fn scanned(output: &str) -> Room {
    let room = Room::with(output);
    good(&room, &["scan", "-q", "job.toml"]);
    room
}

#[test]
fn a_cloud_goes_through_every_format_and_is_the_same() {
    let room = scanned("formats = [\"ply\"]");
    let steps = ["out/top/000000.ply", "a.pcd", "b.npy", "c.las", "d.laz", "e.npy", "f.ply"];
    for pair in steps.windows(2) {
        let said = good(&room, &["convert", pair[0], pair[1]]);
        assert!(said.contains(&format!("wrote {} (", pair[1])), "{said}");
        assert_eq!(pair[1] == "c.las", said.contains("rounded to steps of 0.0001 m") && pair[0] == "b.npy");
    }
    let (first, last) = (cloud(&room, steps[0]), cloud(&room, steps[6]));
    assert!(first.points > 300 && last.points == first.points);
    for field in &first.fields {
        let name = if field.name == "intensity" { "reflectivity" } else { field.name.as_str() };
        let values = last.field(name).unwrap_or_else(|| panic!("there is no {name}"));
        if ["x", "y", "z"].contains(&name) {
            // Half a step, and the last bits of a sum of numbers below 128.
            let worst = values.iter().zip(&field.values).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
            assert!(worst > 0.0 && worst <= 0.5e-4 + 1e-13, "{name}: {worst}");
        } else {
            assert_eq!(values, field.values, "{name}");
        }
    }
    // What was in binary steps stays so.
    let fine = ["--scale", "0.0009765625"];
    good(&room, &[&["convert", steps[0], "g.laz"], &fine[..]].concat());
    good(&room, &[&["convert", "g.laz", "h.las"], &fine[..]].concat());
    good(&room, &["diff", "g.laz", "h.las"]);
    assert_eq!(cloud(&room, "g.laz"), cloud(&room, "h.las"));
    assert_eq!(cloud(&room, "h.las").comments, first.comments);
}

#[test]
fn an_image_comes_back_from_an_npz_with_all_that_it_tells() {
    let room = scanned("formats = [\"exr\"]");
    good(&room, &["convert", "out/top/000000.exr", "image.npz"]);
    good(&room, &["convert", "image.npz", "image.exr"]);
    good(&room, &["diff", "out/top/000000.exr", "image.npz"]);
    assert_eq!(parts(&room, "image.exr"), parts(&room, "out/top/000000.exr"));
    // The same image gives the same bytes.
    good(&room, &["convert", "image.exr", "again.npz"]);
    let [one, other] = ["image.npz", "again.npz"].map(|name| fs::read(room.0.path().join(name)).unwrap());
    assert!(one == other);
}

#[test]
fn a_folder_is_converted_frame_by_frame_and_is_one_that_verifies() {
    let room = scanned("formats = [\"exr\", \"ply\"]");
    for (format, other) in [("npy", "out/top/000000.ply"), ("npz", "out/top/000000.exr")] {
        let said = good(&room, &["convert", "out", format, "--format", format]);
        assert!(said.contains(&format!("wrote 1 file to {format} (")), "{said}");
        good(&room, &["verify", format]);
        good(&room, &["info", format]);
        good(&room, &["diff", other, &format!("{format}/top/000000.{format}")]);
        good(&room, &["diff", format, format]);
    }
    good(&room, &["diff", "out", "npz"]);
    let (code, said) = room.run(&["convert", "out", "npy", "--format", "npy"]);
    assert!(code == 4 && said.contains("exists already; --overwrite replaces it"), "{said}");
    good(&room, &["convert", "out", "npy", "--format", "npy", "--overwrite"]);
    good(&room, &["convert", "npy", "laz", "--format", "laz"]);
    good(&room, &["verify", "laz"]);
    let (code, said) = room.run(&["convert", "npy", "exr", "--format", "exr"]);
    assert!(code == 3 && said.contains("has no range images (EXR, NPZ)"), "{said}");
    // The images of a converted folder are still those of the sensor that its manifest tells of.
    good(&room, &["convert", "npz", "las", "--format", "las"]);
    good(&room, &["verify", "las"]);
    good(&room, &["convert", "out", "png", "--format", "png"]);
    let (code, said) = room.run(&["convert", "npy", "png", "--format", "png"]);
    assert!(code == 3 && said.contains("has no range images (EXR, NPZ)"), "{said}");
    let (code, said) = room.run(&["convert", "out", "out", "--format", "npy", "--overwrite"]);
    assert!(code == 4 && said.contains("is the folder that is converted"), "{said}");
    assert!(room.0.path().join("out/manifest.json").is_file());
}

#[test]
fn what_can_not_be_converted_is_told_and_nothing_is_written() {
    let room = scanned("formats = [\"exr\", \"ply\"]");
    let root = room.0.path();
    let (ply, exr) = ("out/top/000000.ply", "out/top/000000.exr");
    fs::write(root.join("broken.las"), [b"LASF".as_slice(), &[0xff; 400]].concat()).unwrap();
    fs::write(
        root.join("flat.ply"),
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float u\nend_header\n1\n",
    )
    .unwrap();
    fs::write(root.join("there.npy"), "mine").unwrap();
    fs::copy(root.join(exr), root.join("alone.exr")).unwrap();
    for (args, code, told) in [
        (&[ply, "there.npy"][..], 4, "there.npy: is there already (--overwrite replaces it)"),
        (
            &[ply, "new.xyz"],
            2,
            "nothing is converted to `xyz`: the formats are `ply`, `pcd`, `npy`, `las`, `laz`, `exr`, `npz`, `e57`, `png` or `depth16`",
        ),
        (&[ply, "new"], 2, "new has no ending that says its format"),
        (&[ply, "new.npy", "--format", "tiff"], 2, "nothing is converted to `tiff`"),
        (&[ply, "new.exr"], 3, "is no range image, and does not tell which beams had no return"),
        (
            &["alone.exr", "new.pcd"],
            3,
            "is an image without a run's manifest, and does not tell where its beams went",
        ),
        (&["alone.exr", "new.png"], 3, "is an image without a run's manifest"),
        (&[ply, "new.png"], 3, "is no range image, and png is made of such alone"),
        (&["out", "new"], 2, "a folder needs --format NAME"),
        (&["broken.las", "new.ply"], 3, "broken.las: it is of version 255.255, and 1.0 to 1.4 are read"),
        (&["flat.ply", "new.las"], 3, "it has no field \"x\", and the points of a LAS have x, y and z"),
        (&[ply, "new.las", "--scale", "1e-9"], 3, "a point lies "),
        (&[ply, "new.las", "--scale", "0"], 2, "expected a number of metres from 1e-9 to 1000"),
        (&["job.toml", "new.ply"], 3, "job.toml: is a job or a sensor file: `beamcast scan` runs a job"),
    ] {
        let (found, said) = room.run(&[&["convert"], args].concat());
        assert!(found == code && said.contains(told), "{args:?}: {found}: {said}");
    }
    assert_eq!(fs::read(root.join("there.npy")).unwrap(), b"mine");
    let new: Vec<_> = fs::read_dir(root)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.starts_with("new"))
        .collect();
    assert!(new.is_empty(), "{new:?}");
    good(&room, &["convert", ply, "there.npy", "--overwrite"]);
    good(&room, &["convert", ply, "new", "--format", "pcd"]);
    good(&room, &["diff", "there.npy", "new"]);
}

/// The fields of a cloud that is made of an image are those of the run's own, but for the coordinates: their range was rounded to 32 bits
/// before, and each coordinate after. So they differ by at most 2⁻²⁴ of the range, and by half of a last digit on either side.
fn is_made_anew(made: &Cloud, own: &Cloud) {
    let names =
        |cloud: &Cloud| cloud.fields.iter().map(|field| (field.name.clone(), field.kind)).collect::<Vec<_>>();
    assert_eq!((names(made), made.points), (names(own), own.points));
    let axes = ["x", "y", "z"].map(|axis| own.field(axis).unwrap());
    for (field, own) in made.fields.iter().zip(&own.fields) {
        for (point, (a, b)) in field.values.iter().zip(&own.values).enumerate() {
            let range = axes.iter().map(|axis| axis[point] * axis[point]).sum::<f64>().sqrt();
            let most =
                if ["x", "y", "z"].contains(&field.name.as_str()) { 3.0 * range / 16_777_216.0 } else { 0.0 };
            assert!((a - b).abs() <= most, "{} of point {point}: {a} and {b}", field.name);
        }
    }
}

#[test]
fn images_of_a_run_become_what_the_run_would_have_written() {
    let room = scanned("formats = [\"exr\", \"ply\", \"las\", \"e57\", \"npz\", \"png\", \"depth16\"]");
    let exr = "out/top/000000.exr";
    for (source, ending) in [(exr, "ply"), ("out/top/000000.npz", "pcd"), (exr, "npy"), (exr, "e57")] {
        good(&room, &["convert", source, &format!("made.{ending}")]);
    }
    let own = cloud(&room, "out/top/000000.ply");
    is_made_anew(&cloud(&room, "made.ply"), &own);
    let (made, own) = (cloud(&room, "made.e57"), cloud(&room, "out/top/000000.e57"));
    is_made_anew(&made, &own);
    // The sensor stands 1.2 m above the world's origin.
    let pose = "VIEWPOINT 0.0 0.0 1.2 1.0 0.0 0.0 0.0".to_owned();
    assert!(made.comments.contains(&pose) && own.comments.contains(&pose), "{:?}", made.comments);
    assert_eq!(cloud(&room, "made.pcd").points, made.points);
    // Steps of 0.1 mm are wider than what rounding does.
    good(&room, &["convert", exr, "made.las"]);
    good(
        &room,
        &[
            "diff",
            "made.las",
            "out/top/000000.las",
            "--tolerance",
            "x=1.1e-4",
            "--tolerance",
            "y=1.1e-4",
            "--tolerance",
            "z=1.1e-4",
        ],
    );
    let bytes = |name: &str| fs::read(room.0.path().join(name)).unwrap();
    good(&room, &["convert", exr, "made.png", "--format", "depth16"]);
    assert!(bytes("made.png") == bytes("out/top/000000.depth16.png"));
    good(&room, &["convert", exr, "preview.png"]);
    let pixels = |name: &str| beamcast::output::recorded::read_preview(&bytes(name), u64::MAX).unwrap();
    let (made, own) = (pixels("preview.png"), pixels("out/top/000000.png"));
    assert_eq!((made.width, made.height), (own.width, own.height));
    // A range that was rounded may have the next colour.
    assert!(made.pixels.iter().zip(&own.pixels).all(|(a, b)| a.abs_diff(*b) <= 2));
}

#[test]
fn a_measured_sensors_images_become_clouds_with_all_that_was_measured() {
    let room = Room::with("formats = [\"exr\", \"ply\"]");
    let noisy = [
        "--set",
        "sensor.top.nominal=true",
        "--set",
        "sensor.top.receiver.returns=2",
        "--set",
        "sensor.top.footprint={ divergence_mrad = [9.0, 9.0], kind = \"1/e2\" }",
    ];
    good(&room, &[&["scan", "-q", "job.toml"], &noisy[..]].concat());
    good(&room, &["convert", "out/top/000000.exr", "made.ply"]);
    let (made, own) = (cloud(&room, "made.ply"), cloud(&room, "out/top/000000.ply"));
    assert!(own.field("snr").unwrap().iter().any(|snr| *snr > 0.0));
    assert!(own.field("return").unwrap().contains(&1.0), "a pixel has two returns");
    is_made_anew(&made, &own);
}

#[test]
fn a_manifest_that_does_not_tell_the_sensor_opens_no_file() {
    let room = scanned("formats = [\"exr\"]");
    let manifest = room.0.path().join("out/manifest.json");
    let text = fs::read_to_string(&manifest).unwrap();
    let mut json: serde_json::Value = serde_json::from_str(&text).unwrap();
    for (sensor, told) in [
        (serde_json::json!([]), "the manifest tells of no sensor \"top\""),
        (
            serde_json::json!([{ "name": "top", "rays": { "file": "/etc/passwd" } }]),
            "it is of a table in a file, which the manifest does not have",
        ),
        (
            serde_json::json!([{ "name": "top" }]),
            "the manifest does not tell where the beams of \"top\" went",
        ),
        (serde_json::json!([3]), "this is not the manifest of a scan"),
        (
            serde_json::json!([{ "name": "top", "rotating": { "elevations_deg": [1.0], "columns": 36, "rate_hz": 10.0 } }]),
            "its image has 16 rows of 36 pixels, and the manifest's sensor 1 of 36",
        ),
    ] {
        json["job"]["sensor"] = sensor;
        fs::write(&manifest, json.to_string()).unwrap();
        let (code, said) = room.run(&["convert", "out/top/000000.exr", "new.ply"]);
        assert!(code == 3 && said.contains(told), "{said}");
    }
}

#[test]
fn a_shorter_conversion_into_the_same_folder_leaves_nothing_of_a_longer_one() {
    let work = super::cli::Workplace::new();
    let run = |args: &[&str]| {
        let output = super::cli::program().args(args).current_dir(work.path("")).output().unwrap();
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    };
    run(&["scan", "-q", "job.toml", "--out", "long", "--set", "sequence.frames=3"]);
    run(&["scan", "-q", "job.toml", "--out", "short", "--set", "sequence.frames=1"]);
    run(&["convert", "-q", "long", "made", "--format", "pcd"]);
    fs::write(work.path("made/top/mine.pcd"), "mine").unwrap();
    run(&["convert", "-q", "short", "made", "--format", "pcd", "--overwrite"]);
    let left: Vec<String> =
        super::cli::files(&work.path("made")).into_keys().filter(|name| !name.ends_with(".csv")).collect();
    assert_eq!(left, ["manifest.json", "top/000000.pcd", "top/mine.pcd"]);
}
