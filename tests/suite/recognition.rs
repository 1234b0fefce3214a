//! Files of other kinds, given where a job, a scene, a calibration or an output belongs: every command says what the file is,
//! what it wanted, and what mends it, whatever the file is called.

use std::fs;
use std::path::Path;

/// A file's content, the words that must name it, and the words of what mends it.
const FILES: &[(&[u8], &str, &str)] = &[
    (
        b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 99\n",
        "a Git LFS pointer",
        "git lfs pull",
    ),
    (b"\x1f\x8b\x08\0\0\0\0\0\0\x03", "compressed with gzip", "gunzip"),
    (b"\x28\xb5\x2f\xfd\0\0", "compressed with zstd", "unzstd"),
    (b"PK\x03\x04\x14\0", "a zip archive", "unzip"),
    (b"b3dm\x01\0\0\0\x1c\0\0\0", "b3dm", "3d-tiles-tools b3dmToGlb"),
    (b"i3dm\x01\0\0\0\x1c\0\0\0", "i3dm", "3d-tiles-tools i3dmToGlb"),
    (br#"{"asset":{"version":"1.1"},"geometricError":1,"root":{}}"#, "a tileset of 3D Tiles", "tile"),
    (b"solid a\nfacet normal 0 0 1\n", "an STL mesh", "assimp export"),
    (b"o a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "a Wavefront OBJ mesh", "obj2gltf"),
    (b"#usda 1.0\n(\n)\n", "a USD file", "usd2gltf"),
    (b"Kaydara FBX Binary  \0\x1a\0", "an FBX file", "FBX2glTF"),
    (b"<?xml version=\"1.0\"?>\n<COLLADA>\n", "a COLLADA scene", "Blender"),
    (b"\xd4\xc3\xb2\xa1\x02\0\x04\0", "a packet capture (pcap)", "beamcast import"),
    (b"<!DOCTYPE html>\n<html>\n", "a web page (HTML)", "download"),
    (b"\x89PNG\r\n\x1a\n\0\0\0\x0d", "a PNG image", ""),
    (b"{\"name\":\"a\",\"version\":\"1\",\"main\":\"a.js\"}", "an npm package", ""),
    (b"scene: a.glb\nsensor:\n  - preset: velodyne/vlp-16\n", "in YAML", "TOML"),
    (b"", "the file is empty", "whole"),
];

/// Runs beamcast in a folder. Returns its exit code and what it said.
fn beamcast(folder: &Path, args: &[&str]) -> (i32, String) {
    let output = super::cli::program().args(args).current_dir(folder).output().unwrap();
    let said = [output.stdout, output.stderr].concat();
    (output.status.code().unwrap(), String::from_utf8_lossy(&said).into_owned())
}

#[test]
fn every_command_says_what_a_file_is_instead() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::write(folder.join("good.exr"), b"\x76\x2f\x31\x01").unwrap();
    let job = "scene = \"s.glb\"\noutput.dir = \"out\"\n[[sensor]]\npreset = \"velodyne/vlp-16\"\n";
    fs::write(folder.join("job.toml"), job).unwrap();
    for (content, name, mend) in FILES {
        // The ending says nothing, be it one that beamcast knows or not.
        for file in ["s.glb", "s.toml", "s.json", "s"] {
            fs::write(folder.join(file), content).unwrap();
        }
        for (args, code) in [
            (&["scan", "job.toml"][..], 3),
            (&["lint", "job.toml"], 3),
            (&["lint", "s.glb"], 3),
            (&["lint", "s"], 3),
            (&["info", "s.glb"], 3),
            (&["info", "s"], 3),
            (&["view", "s.glb"], 3),
            (&["diff", "s", "s"], 3),
            (&["import", "s.json"], 3),
            (&["import", "s.toml"], 3),
            (&["scan", "s.toml"], 2),
            (&["scan", "s"], 2),
        ] {
            let (exit, said) = beamcast(folder, args);
            assert_eq!(exit, code, "{args:?}: {said}");
            assert!(said.contains(name) && said.contains(mend), "{args:?}, {name}: {said}");
        }
    }
}

/// Cases gltf1_json, lfs_pointer, gz_glb, b3dm and tileset, and their neighbours in a GLB.
#[test]
fn gltf_1_is_told_however_it_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let json = r#"{"asset":{"version":"1.0"},"scenes":{"a":{"nodes":["n"]}},"nodes":{"n":{}}}"#;
    let without_asset = r#"{"accessors":{"a":{}},"scenes":{"a":{"nodes":["n"]}},"nodes":{"n":{}}}"#;
    let binary =
        [&b"glTF\x01\0\0\0"[..], &[0x20, 0, 0, 0, 0x0c, 0, 0, 0, 0, 0, 0, 0], b"{}          "].concat();
    for content in [json.as_bytes(), without_asset.as_bytes(), &binary] {
        fs::write(folder.join("old.gltf"), content).unwrap();
        for command in ["lint", "info"] {
            let (exit, said) = beamcast(folder, &[command, "old.gltf"]);
            assert!(exit == 3 && said.contains("a glTF 1.0 scene"), "{command}: {exit}: {said}");
        }
    }
}

/// Case scene_vrm_ext: a scene, a job and an image are known by their content.
#[test]
fn what_is_read_is_known_by_its_content() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let project = Path::new(env!("CARGO_MANIFEST_DIR"));
    fs::copy(project.join("scenes/room.glb"), folder.join("room.vrm")).unwrap();
    let job = "scene = \"room.vrm\"\noutput.dir = \"out\"\n[[sensor]]\n[sensor.pinhole]\nwidth_px = 8\nheight_px = 6\n\
               hfov_deg = 90.0\n[sensor.pose]\nposition_m = [0.0, 0.0, 1.0]\n";
    fs::write(folder.join("job.txt"), job).unwrap();
    for command in ["lint", "info"] {
        let (exit, said) = beamcast(folder, &[command, "room.vrm"]);
        assert!(exit == 0 && said.contains("room.vrm: scene"), "{command}: {said}");
        let (exit, said) = beamcast(folder, &[command, "job.txt"]);
        assert!(exit == 0 && said.contains("job.txt: job"), "{command}: {said}");
    }
    let (exit, said) = beamcast(folder, &["scan", "-q", "job.txt"]);
    assert_eq!((exit, said.as_str()), (0, ""));
    fs::rename(folder.join("out/sensor/000000.exr"), folder.join("image")).unwrap();
    let (exit, said) = beamcast(folder, &["info", "image"]);
    assert!(exit == 0 && said.contains("image: EXR"), "{said}");
    // A job is run whatever it is called: both sides are the same.
    let (exit, said) = beamcast(folder, &["diff", "job.txt", "image"]);
    assert_eq!(exit, 0, "{said}");
    assert_eq!(beamcast(folder, &["view", "job.txt", "-o", "page.html"]).0, 0);
}

#[test]
fn what_beamcast_reads_elsewhere_is_sent_there() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let project = Path::new(env!("CARGO_MANIFEST_DIR"));
    fs::copy(project.join("tests/import/ouster_flat.json"), folder.join("ouster.json")).unwrap();
    fs::copy(project.join("scenes/room.glb"), folder.join("room.glb")).unwrap();
    fs::copy(project.join("configs/room_vlp16.baseline/baseline.json"), folder.join("b.json")).unwrap();
    fs::write(folder.join("cloud.pcd"), "# .PCD v0.7 - Point Cloud Data file format\n").unwrap();
    let job = "scene = \"cloud.pcd\"\noutput.dir = \"out\"\n[[sensor]]\npreset = \"velodyne/vlp-16\"\n";
    fs::write(folder.join("of_cloud.toml"), job).unwrap();
    for (args, name, mend) in [
        (&["scan", "ouster.json"][..], "Ouster metadata", "beamcast import"),
        (&["lint", "ouster.json"], "Ouster metadata", "beamcast import"),
        (&["info", "b.json"], "a baseline of `beamcast check`", "name the job"),
        (&["import", "b.json"], "a baseline of `beamcast check`", "name the job"),
        (&["import", "room.glb"], "a glTF scene", "`scene`"),
        (&["view", "room.glb"], "a glTF scene", "`scene`"),
        (&["scan", "room.glb"], "a glTF scene", "`scene`"),
        (&["lint", "cloud.pcd"], "a PCD cloud", "`beamcast info`"),
        (&["scan", "of_cloud.toml"], "a PCD cloud", "make a mesh of the cloud"),
    ] {
        let (exit, said) = beamcast(folder, args);
        assert!(exit != 0 && said.contains(name) && said.contains(mend), "{args:?}: {said}");
    }
}
