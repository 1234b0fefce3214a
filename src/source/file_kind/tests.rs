//! Tests of the recognition of files.

use super::FileKind::*;
use super::*;

fn kind(content: impl AsRef<[u8]>) -> FileKind {
    FileKind::of(content.as_ref(), content.as_ref().len() as u64)
}

fn named(content: impl AsRef<[u8]>) -> String {
    kind(content).name()
}

#[test]
fn signatures() {
    for (content, name) in [
        (&b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 3\n"[..], "a Git LFS pointer"),
        (b"/annex/objects/SHA256E-s3--00.glb\n", "a git-annex pointer"),
        (b"\x1f\x8b\x08\0", "compressed with gzip"),
        (b"\x28\xb5\x2f\xfd\0", "compressed with zstd"),
        (b"b3dm\x01\0\0\0", "a tile of 3D Tiles (b3dm)"),
        (b"i3dm\x01\0\0\0", "a tile of 3D Tiles (i3dm)"),
        (b"pnts\x01\0\0\0", "a tile of 3D Tiles (pnts)"),
        (b"cmpt\x01\0\0\0", "a tile of 3D Tiles (cmpt)"),
        (b"#usda 1.0\n", "a USD file (usda)"),
        (b"PXR-USDC\0", "a USD file (usdc)"),
        (
            b"PK\x03\x04\x14\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x0a\0\0\0scene.usdc",
            "a USD file (usdz)",
        ),
        (b"PK\x03\x04\x14\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x07\0\0\0arr.npy", "NumPy arrays (npz)"),
        (b"PK\x03\x04\x14\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\x05\0\0\0a.glb", "a zip archive"),
        (b"PK\x03\x04", "a zip archive"),
        (b"Kaydara FBX Binary  \0", "an FBX file"),
        (b"; FBX 7.4.0 project file\n", "an FBX file"),
        (b"BLENDER-v402", "a Blender file"),
        (b"../store/aa/KEY1.gltf", "the text of a link"),
        (b"assets/room.glb", "the text of a link"),
        (b"room.glb", "a text"),
        (b"1/2.5", "a text"),
        (b"see docs/a.md for more", "a text"),
        (b"glTF\x01\0\0\0\x14\0\0\0", "a glTF 1.0 scene"),
        (b"glTF\x02\0\0\0\x14\0\0\0", "a glTF scene"),
        (b"LASF\0\0", "a LAS or LAZ cloud"),
        (b"ASTM-E57\x01", "an E57 cloud"),
        (b"# .PCD v0.7\nVERSION 0.7\n", "a PCD cloud"),
        (b"\xd4\xc3\xb2\xa1\x02\0\x04\0", "a packet capture (pcap)"),
        (b"\x0a\x0d\x0d\x0a\x1c\0\0\0", "a packet capture (pcap)"),
        (b"\x89MCAP0\r\n", "an MCAP recording"),
        (b"\xee\xff\x01\x05\x80\x03", "a binary angle correction of a Hesai unit (.dat)"),
        (b"\x76\x2f\x31\x01\x02\0", "an EXR image"),
        (b"\x89PNG\r\n\x1a\n\0", "a PNG image"),
        (b"\x93NUMPY\x01\0", "a NumPy array (npy)"),
        (b"ply\nformat ascii 1.0\n", "a PLY file"),
        (b"ply\r\nformat ascii 1.0\r\n", "a PLY file"),
    ] {
        assert_eq!(named(content), name);
    }
    let mut stl = vec![0; 84 + 50 * 3];
    stl[80] = 3;
    assert_eq!(named(&stl), "an STL mesh");
    stl.push(0);
    assert_eq!(kind(&stl), Unknown);
}

#[test]
fn json_by_its_keys() {
    for (content, name) in [
        (r#"{"asset":{"version":"2.0"},"scenes":[]}"#, "a glTF scene"),
        (r#"{"scenes":[],"nodes":[],"asset":{"generator":"\"{","version":"2.0"}}"#, "a glTF scene"),
        (r#"{"asset":{"version":"1.0"},"scenes":{"a":{}}}"#, "a glTF 1.0 scene"),
        (r#"{"accessors":{"a":{}},"scenes":{"a":{}}}"#, "a glTF 1.0 scene"),
        (r#"{"asset":{"version":"1.1"},"geometricError":5,"root":{}}"#, "a tileset of 3D Tiles"),
        (r#"{"root":{"content":{}},"asset":{"version":"1.0"}}"#, "a tileset of 3D Tiles"),
        (r#"{"beam_altitude_angles":[1],"prod_line":"OS-1-4"}"#, "Ouster metadata"),
        (r#"{"sensor_info":{},"beam_intrinsics":{}}"#, "Ouster metadata"),
        (r#"{"width":640,"height":480,"intrinsic_matrix":[1]}"#, "a camera's intrinsics"),
        (r#"{"fx":600.0,"fy":600.0,"ppx":320,"ppy":240}"#, "a camera's intrinsics"),
        (r#"{"tool":{},"seed":0,"job":{},"inputs":[],"outputs":[]}"#, "the manifest of a scan"),
        (r#"{"format":1,"tool":"0.1.0","job":{}}"#, "a baseline of `beamcast check`"),
        (r#"{"scene":"a.glb","sensor":[],"output":{}}"#, "a job or a sensor file in JSON"),
        (r#"{"type":"FeatureCollection","features":[]}"#, "GeoJSON"),
        (r#"{"type":"CityJSON","version":"1.1"}"#, "CityJSON"),
        (r#"{"name":"a","version":"1","scripts":{}}"#, "the description of an npm package"),
        (r#"{"$schema":"x","properties":{}}"#, "a JSON Schema"),
        (r#"{"b":1,"a":[{"x":"}"}],"c":null}"#, "JSON with the keys `b`, `a` and `c`"),
        ("{\"a\": 1", "JSON with the key `a`"),
        ("{}", "JSON without keys"),
    ] {
        assert_eq!(named(content), name, "{content}");
    }
    // A text that is cut anywhere, or that nests deeply, is looked at in a time that its length bounds.
    let whole = r#"{"asset":{"version":"2.0","extras":{"a":["\\",{"b":"\""}]}},"nodes":[{"name":"a}]"}]}"#;
    for end in 1..whole.len() {
        kind(&whole[..end]);
    }
    assert_eq!(kind(format!("{{\"asset\":{{}},\"extras\":{}", "[{\"a\":".repeat(100_000))), Gltf);
}

#[test]
fn texts() {
    for (content, name) in [
        ("solid cube\n facet normal 0 0 1\n  outer loop\n", "an STL mesh"),
        (
            "# made by hand\nmtllib a.mtl\no Cube\nv 0 0 1\nv 1 0 0\nvn 0 0 1\nf 1//1 2//1 3//1\n",
            "a Wavefront OBJ mesh",
        ),
        ("v 0 0 1\r\nv 1 0 0\r\nf 1 2 3\r\n", "a Wavefront OBJ mesh"),
        ("OFF\n8 6 12\n", "an OFF mesh"),
        ("VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nPOINTS 3\nDATA ascii\n", "a PCD cloud"),
        ("1.0 2.0 3.0\n4.0 5.0 6.0\n", "a table of numbers, perhaps a cloud (xyz, pts)"),
        ("<!DOCTYPE html>\n<html lang=en>", "a web page (HTML)"),
        ("<HTML><head>", "a web page (HTML)"),
        ("<?xml version=\"1.0\"?>\n<!-- <a> -->\n<COLLADA xmlns=\"x\">", "a COLLADA scene"),
        ("<?xml version=\"1.0\"?><robot name=\"r\">", "a robot's description (URDF)"),
        ("<sdf version='1.6'>", "a world of Gazebo (SDF)"),
        ("<boost_serialization signature=\"x\">", "XML of `boost_serialization`"),
        ("scene = \"a.glb\"\n[[sensor]]\npreset = \"velodyne/vlp-16\"\n", "a job"),
        ("# a sensor\n[rotating]\ncolumns = 5\n", "TOML"),
        (
            "scene: a.glb\nsensor:\n  - preset: velodyne/vlp-16\noutput:\n  dir: out\n",
            "a job or a sensor file in YAML",
        ),
        ("lasers:\n- {dist_correction: 0, rot_correction: 0.1}\nnum_lasers: 1\n", "a Velodyne calibration"),
        ("%YAML:1.0\n---\ncamera_matrix: !!opencv-matrix\n   rows: 3\n", "a camera's intrinsics"),
        ("cam0:\n  camera_model: pinhole\n  intrinsics: [1, 2, 3, 4]\n", "a camera's intrinsics"),
        ("outs:\n- md5: 00\n  path: a.glb\n", "a DVC pointer"),
        ("a: 1\nb: 2\n", "YAML with the keys `a` and `b`"),
        ("Channel,Elevation,Azimuth\n1,2,3\n", "a text"),
        ("hello", "a text"),
        ("\u{feff}  \n\t", "an empty file"),
    ] {
        assert_eq!(named(content), name, "{content}");
    }
    assert_eq!(kind([0xff, 0xfe, 0, 1]), Unknown);
    assert_eq!(kind([]), Empty);
}

#[test]
fn a_beginning_is_enough() {
    // The last character is cut in the middle.
    let text = "scene = \"ä";
    assert_eq!(FileKind::of(&text.as_bytes()[..text.len() - 1], 1000), Job);
    assert!(FileKind::needs_more(b"{\"extras\": [", 1000));
    assert!(!FileKind::needs_more(b"{\"extras\": [", 12));
    assert!(!FileKind::needs_more(b"glTF\x02\0\0\0", 1000));
}

#[test]
fn the_shipped_files_are_what_they_are() {
    let at = |path: &str| {
        crate::source::recognise(&std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join(path)).unwrap()
    };
    for (path, kind) in [
        ("configs/street_rig.toml", Job),
        ("configs/room_vlp16.toml", Job),
        ("configs/sensors/velodyne_vlp16.toml", Toml),
        ("scenes/room.glb", Gltf),
        ("configs/room_vlp16.baseline/baseline.json", Baseline),
        ("tests/import/ouster_flat.json", Calibration(Unit::Ouster)),
        ("tests/import/ouster_nested.json", Calibration(Unit::Ouster)),
        ("tests/import/velodyne.yaml", Calibration(Unit::Velodyne)),
        ("tests/import/camera_info.yaml", Calibration(Unit::Camera)),
        ("tests/import/opencv.yaml", Calibration(Unit::Camera)),
        ("tests/import/hesai_angles.csv", Text),
        ("configs/schema/job.json", Other("a JSON Schema")),
        ("src/lib.rs", Text),
    ] {
        assert_eq!(at(path), kind, "{path}");
    }
    for (name, text) in crate::config::presets::BUILT_IN {
        assert_eq!(kind(text), Toml, "{name}");
    }
}

#[test]
fn each_command_says_what_it_wanted() {
    let pointer = kind("version https://git-lfs.github.com/spec/v1\n");
    let said = pointer.text_instead_of(Wanted::Scene);
    assert_eq!(
        said,
        "this is a Git LFS pointer, not a glTF scene (`git lfs pull` fetches the file that it stands for)"
    );
    assert_eq!(Unknown.text_instead_of(Wanted::Calibration), "this is not a calibration");
    assert_eq!(Empty.instead_of(Wanted::Linted).0, "the file is empty");
}
