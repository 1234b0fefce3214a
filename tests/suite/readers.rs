//! Range images and clouds of every format, read back: by the library, and by the commands that show and compare them.

use std::fs;
use std::path::Path;

use beamcast::config::load_sensor;
use beamcast::output::recorded::{Cloud, Part, read_exr, read_npy, read_npz, read_pcd, read_ply};
use beamcast::output::{Channels, Image, Samples, SensorFrame};

use super::formats::{Room, camera, format, frame, lidar, seen, u32_at};

fn encode(seen: &SensorFrame, name: &str, options: &str) -> Vec<u8> {
    format(name, options).encode(seen).unwrap()
}

#[test]
fn compression_changes_the_bytes_and_no_value() {
    let (sensor, frame) = (lidar(), frame());
    let seen = seen(&sensor, &frame);
    let plain = encode(&seen, "exr", "");
    assert_eq!(plain, encode(&seen, "exr", ", compression = \"zip\", half = false"));
    let parts = read_exr(&plain, u64::MAX).unwrap();
    assert_eq!(plain, encode(&seen, "exr", ", level = 1"));
    let words = ["zips", "piz", "rle", "none"].map(|word| format!(", compression = {word:?}"));
    let levels = [2, 9].map(|level| format!(", level = {level}"));
    for options in words.iter().chain(&levels) {
        let file = encode(&seen, "exr", options);
        assert_ne!(file, plain, "{options}");
        assert_eq!(read_exr(&file, u64::MAX).unwrap(), parts, "{options}");
    }
}

#[test]
fn half_floats_round_intensities_and_normals_and_nothing_else() {
    let (sensor, frame) = (camera(), frame());
    let seen = seen(&sensor, &frame);
    let half = format("exr", ", half = true");
    let [whole, rounded] = [format("exr", ""), half].map(|format| {
        let file = format.encode(&seen).unwrap();
        read_exr(&file, u64::MAX).unwrap()
    });
    for (whole, rounded) in whole.iter().zip(&rounded) {
        assert_eq!(whole.attributes, rounded.attributes);
        for (a, b) in whole.image.channels.iter().zip(&rounded.image.channels) {
            let of = |i: usize| (a.samples.get(i) - b.samples.get(i)).abs() / a.samples.get(i).abs();
            let errors = (0..a.samples.len()).map(of).filter(|error| error.is_finite());
            let worst = errors.fold(0.0, f64::max);
            // Along the optical axes the normal is (-0.6, -0.8, 0), and 0.5 and 0 are half floats. A half float is within 2⁻¹¹.
            let is_rounded = ["normal.X", "normal.Y"].contains(&a.name.as_str());
            assert!(worst <= 1.0 / 2048.0 && (worst > 0.0) == is_rounded, "{}: {worst}", a.name);
        }
    }
    assert!(half.file_bytes_a_ray(&sensor) < format("exr", "").file_bytes_a_ray(&sensor));
    let told = half.loses(&sensor).unwrap();
    assert!(told.contains("intensity, normal.X, normal.Y and normal.Z by at most 0.05 %"), "{told}");
    assert_eq!(format("exr", "").loses(&sensor), None);
}

/// A channel of a deep image: its name, the number of its type, and the samples of all pixels.
type DeepChannel = (String, u32, Vec<[u8; 4]>);

/// A deep image that is not compressed, read by the definition of the format: the channels with the samples of all pixels, and the number
/// of samples of each pixel.
fn read_deep(file: &[u8], columns: usize) -> (Vec<DeepChannel>, Vec<u32>) {
    assert_eq!(file[..8], [0x76, 0x2f, 0x31, 1, 2, 8, 0, 0]);
    let mut at = 8;
    let word = |at: &mut usize| {
        let length = file[*at..].iter().position(|&b| b == 0).unwrap();
        let word = String::from_utf8(file[*at..*at + length].to_vec()).unwrap();
        *at += length + 1;
        word
    };
    let (mut channels, mut rows) = (Vec::new(), 0);
    loop {
        let name = word(&mut at);
        if name.is_empty() {
            break;
        }
        let kind = word(&mut at);
        let length = u32_at(file, at) as usize;
        at += 4;
        match (name.as_str(), kind.as_str()) {
            ("channels", "chlist") => {
                let mut place = at;
                while file[place] != 0 {
                    let name = word(&mut place);
                    channels.push((name, u32_at(file, place), Vec::new()));
                    place += 16;
                }
            }
            ("chunkCount", "int") => rows = u32_at(file, at) as usize,
            ("type", "string") => assert_eq!(&file[at..at + length], b"deepscanline"),
            _ => {}
        }
        at += length;
    }
    let u64_at = |at: usize| u64::from_le_bytes(file[at..at + 8].try_into().unwrap()) as usize;
    let mut counts = Vec::new();
    for row in 0..rows {
        let chunk = u64_at(at + 8 * row);
        assert_eq!(u32_at(file, chunk) as usize, row);
        let (table, packed, plain) = (u64_at(chunk + 4), u64_at(chunk + 12), u64_at(chunk + 20));
        assert_eq!((table, packed), (4 * columns, plain));
        let sums: Vec<u32> = (0..columns).map(|column| u32_at(file, chunk + 28 + 4 * column)).collect();
        counts.extend(sums.iter().zip([0].iter().chain(&sums)).map(|(sum, before)| sum - before));
        let mut place = chunk + 28 + table;
        for (_, _, values) in &mut channels {
            for _ in 0..sums[columns - 1] {
                values.push(file[place..place + 4].try_into().unwrap());
                place += 4;
            }
        }
        assert_eq!(place, chunk + 28 + table + plain);
    }
    (channels, counts)
}

#[test]
fn a_deep_image_has_a_sample_a_return() {
    for sensor in [lidar(), camera()] {
        let frame = frame();
        let seen = seen(&sensor, &frame);
        let (channels, counts) = read_deep(&encode(&seen, "deep", ", compression = \"none\""), 3);
        assert_eq!(counts, [1, 0, 2, 0, 0, 1]);
        let images = [0, 1].map(|number| Image::of_return(&seen, number));
        let names: Vec<_> = channels.iter().map(|(name, ..)| name.as_str()).collect();
        let expected: Vec<_> = images[0].channels.iter().map(|channel| channel.name.as_str()).collect();
        // `Z` is there for every sensor, and `Y` for none.
        let expected = expected.into_iter().filter(|name| !["Y", "Z"].contains(name));
        assert_eq!(names, ["Z"].into_iter().chain(expected).collect::<Vec<_>>());
        for (name, kind, values) in &channels {
            let source = if name == "Z" && !sensor.pattern.is_camera() { "range" } else { name };
            let bits = |samples: &Samples, pixel: usize| match samples {
                Samples::F32(values) => values[pixel].to_le_bytes(),
                Samples::U32(values) => values[pixel].to_le_bytes(),
            };
            let samples = |number: usize| images[number].channel(source).unwrap();
            let expected: Vec<[u8; 4]> =
                [(0, 0), (2, 0), (2, 1), (5, 0)].map(|(pixel, number)| bits(samples(number), pixel)).into();
            assert_eq!(values, &expected, "{name}");
            assert_eq!(*kind == 0, matches!(samples(0), Samples::U32(_)), "{name}");
        }
        assert_eq!(format("deep", "").loses(&sensor), None);
    }
}

#[test]
fn images_of_all_pixels_are_told_to_be_lost_in_deep_ones() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/schema/stereo.toml");
    let sensor = load_sensor(&path).unwrap().sensor;
    let deep = format("deep", "").with_channels(Channels::named(["range", "cause", "disparity", "ir.left"]));
    let told = deep.loses(&sensor).unwrap();
    assert_eq!(
        told,
        "a pixel without a return has no sample, and so no disparity and no ir.left: exr has them"
    );
}

#[test]
fn a_deep_image_is_told_as_one_that_is_not_read() {
    let (sensor, frame) = (lidar(), frame());
    let problem = read_exr(&encode(&seen(&sensor, &frame), "deep", ""), u64::MAX).unwrap_err().to_string();
    assert!(problem.contains("it holds deep data, which is not supported"), "{problem}");
}

/// The values of the fields of two clouds, by the second's names.
fn same_points(one: &Cloud, other: &Cloud, names: &[(&str, &str)]) {
    assert_eq!(one.points, other.points);
    for (a, b) in names {
        assert_eq!(one.field(a).unwrap(), other.field(b).unwrap(), "{a}");
    }
}

#[test]
fn a_ply_says_the_same_as_text_and_under_the_names_of_cloudcompare() {
    let (sensor, frame) = (lidar(), frame());
    let seen = seen(&sensor, &frame);
    let read = |options: &str| {
        let file = encode(&seen, "ply", options);
        (read_ply(&file, u64::MAX).unwrap(), file)
    };
    let (binary, _) = read(", motion = true");
    let (text, file) = read(", motion = true, ascii = true");
    assert_eq!(text, binary);
    assert!(String::from_utf8(file).unwrap().contains("\nformat ascii 1.0\n"));
    for options in [", flavour = \"cloudcompare\"", ", flavour = \"cloudcompare\", ascii = true"] {
        let (prefixed, _) = read(options);
        let names: Vec<_> = prefixed.fields.iter().map(|field| field.name.as_str()).collect();
        assert_eq!(names[..5], ["x", "y", "z", "scalar_intensity", "scalar_ring"]);
        let pairs =
            [("x", "x"), ("scalar_intensity", "intensity"), ("scalar_t", "t"), ("scalar_range", "range")];
        same_points(&prefixed, &binary, &pairs);
    }
    let estimate = format("ply", ", ascii = true").file_bytes_a_ray(&sensor) * 4;
    assert!(encode(&seen, "ply", ", ascii = true").len() as u64 - 600 < estimate);
}

#[test]
fn clouds_of_every_format_are_the_same() {
    for sensor in [lidar(), camera()] {
        let frame = frame();
        let seen = seen(&sensor, &frame);
        let ply = read_ply(&encode(&seen, "ply", ""), u64::MAX).unwrap();
        let npy = read_npy(&encode(&seen, "npy", ""), u64::MAX).unwrap();
        assert_eq!(npy.fields, ply.fields);
        let pcd = read_pcd(&encode(&seen, "pcd", ""), u64::MAX).unwrap();
        let shared =
            ["x", "y", "z", "intensity", "ring", "instance", "label", "range"].map(|name| (name, name));
        same_points(&pcd, &ply, &shared);
        assert_eq!(pcd.comments[0], ply.comments[0], "the frame");
        assert!(
            pcd.comments.iter().any(|comment| comment.starts_with("VIEWPOINT 10.5 ")),
            "{:?}",
            pcd.comments
        );
        let organised = read_pcd(&encode(&seen, "pcd", ", organised = true"), u64::MAX).unwrap();
        let is_there: Vec<_> = organised.field("x").unwrap().iter().map(|x| x.is_finite()).collect();
        assert_eq!(is_there, [true, false, true, false, false, true]);
    }
}

#[test]
fn an_npz_is_the_image_of_the_exr() {
    for sensor in [lidar(), camera()] {
        let frame = frame();
        let seen = seen(&sensor, &frame);
        let exr = read_exr(&encode(&seen, "exr", ""), u64::MAX).unwrap();
        for options in ["", ", compressed = true", ", compressed = true, level = 6"] {
            let npz = read_npz(&encode(&seen, "npz", options), u64::MAX).unwrap();
            assert_eq!(npz.len(), exr.len());
            for (npz, exr) in npz.iter().zip(&exr) {
                assert_eq!(npz.name, exr.name);
                assert_eq!(npz.image, exr.image.clone().without_repeats());
                assert_eq!((npz.labels(), names(npz)), (exr.labels(), names(exr)));
            }
        }
    }
}

fn names(part: &Part) -> Vec<String> {
    part.instances().of(1..10).into_values().collect()
}

/// The commands take a file of any of the formats, and folders that have nothing else.
#[test]
fn files_and_folders_of_every_format_are_shown_and_compared() {
    let formats = "formats = [\"exr\", \"deep\", \"npz\", \"ply\", \"pcd\", \"npy\", \"las\", \"laz\"]";
    let room = Room::with(formats);
    let run = |args: &[&str]| {
        let output = super::cli::program().args(args).current_dir(room.0.path()).output().unwrap();
        let said = [output.stdout, output.stderr].concat();
        (output.status.code().unwrap(), String::from_utf8_lossy(&said).into_owned())
    };
    let good = |args: &[&str]| {
        let (code, said) = run(args);
        assert_eq!(code, 0, "{args:?}: {said}");
        said
    };
    good(&["scan", "-q", "job.toml"]);
    let file = |ending: &str| format!("out/top/000000.{ending}");
    for (ending, kind, part) in [
        ("npz", "NPZ", "16 rows × 36 columns"),
        ("pcd", "PCD", " points\n"),
        ("npy", "NPY", " points\n"),
        ("las", "LAS", " points\n"),
        ("laz", "LAS", "frame: the sensor's frame"),
    ] {
        let said = good(&["info", &file(ending)]);
        assert!(said.contains(&format!("000000.{ending}: {kind}\n")) && said.contains(part), "{said}");
        good(&["view", &file(ending), "-o", "page.html"]);
        fs::remove_file(room.0.path().join("page.html")).unwrap();
    }
    good(&["diff", &file("exr"), &file("npz")]);
    good(&["diff", &file("ply"), &file("npy")]);
    good(&["diff", &file("las"), &file("laz")]);
    good(&["diff", "out", "out"]);
    for ending in ["npz", "ply", "pcd", "npy", "las", "laz"] {
        let formats = format!("output.formats=[\"{ending}\"]");
        good(&["scan", "-q", "job.toml", "--out", ending, "--set", &formats]);
        good(&["diff", ending, ending]);
        good(&["view", ending, "-o", "page.html"]);
        fs::remove_file(room.0.path().join("page.html")).unwrap();
    }
    good(&["diff", "out", "npz"]);
    good(&["diff", "ply", "npy"]);
    // The last byte is the exponent of the last point's range.
    for ending in ["pcd", "npy"] {
        let changed = format!("{ending}/top/000000.{ending}");
        let mut bytes = fs::read(room.0.path().join(&changed)).unwrap();
        *bytes.last_mut().unwrap() ^= 1;
        fs::write(room.0.path().join(&changed), bytes).unwrap();
        let (code, said) = run(&["diff", &file(ending), &changed]);
        assert!(code == 1 && said.contains("range"), "{ending}: {said}");
    }
    let mut bytes = fs::read(room.0.path().join(file("npz"))).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(room.0.path().join("damaged"), bytes).unwrap();
    let (code, said) = run(&["info", "damaged"]);
    assert!(code == 3 && said.contains("is damaged: its checksum is wrong"), "{said}");
}
