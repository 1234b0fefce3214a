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
    let (code, said) = room.run(&["convert", "npz", "las", "--format", "las"]);
    assert!(code == 3 && said.contains("has no clouds (PLY, PCD, NPY, LAS, LAZ, E57)"), "{said}");
    let (code, said) = room.run(&["convert", "out", "out", "--format", "npy", "--overwrite"]);
    assert!(code == 4 && said.contains("is the folder that is converted"), "{said}");
    assert!(room.0.path().join("out/manifest.json").is_file());
}

#[test]
fn what_can_not_be_converted_is_told_and_nothing_is_written() {
    let room = scanned("formats = [\"exr\", \"ply\"]");
    let root = room.0.path();
    fs::write(root.join("broken.las"), [b"LASF".as_slice(), &[0xff; 400]].concat()).unwrap();
    fs::write(
        root.join("flat.ply"),
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty float u\nend_header\n1\n",
    )
    .unwrap();
    fs::write(root.join("there.npy"), "mine").unwrap();
    let (ply, exr) = ("out/top/000000.ply", "out/top/000000.exr");
    for (args, code, told) in [
        (&[ply, "there.npy"][..], 4, "there.npy: is there already (--overwrite replaces it)"),
        (
            &[ply, "new.xyz"],
            2,
            "nothing is converted to `xyz`: the formats are `ply`, `pcd`, `npy`, `las`, `laz`, `exr` or `npz`",
        ),
        (&[ply, "new"], 2, "new has no ending that says its format"),
        (&[ply, "new.npy", "--format", "tiff"], 2, "nothing is converted to `tiff`"),
        (&[ply, "new.exr"], 3, "is no range image, and does not tell which beams had no return"),
        (&[exr, "new.pcd"], 3, "is no cloud, and does not tell where its beams went"),
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
