//! `beamcast film`: animated pictures and contact sheets of the previews of a scan.

use std::fs;
use std::io::Cursor;
use std::path::Path;

use beamcast::output::Picture;
use serde_json::json;
use tempfile::TempDir;

/// A folder as a scan leaves it: a LiDAR of three previews of its own size, at 10 Hz, and a camera of six, at 20 Hz. The colour
/// of a preview tells its sensor and its frame.
fn scanned() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    let mut outputs = Vec::new();
    for (sensor, frames, (width, height), red) in [("top", 3, (40, 10), 10), ("front", 6, (20, 15), 90)] {
        fs::create_dir(folder.path().join(sensor)).unwrap();
        for frame in 0..frames {
            let path = format!("{sensor}/{frame:06}.png");
            let picture = Picture::new(width, height, [red, frame, 0]);
            fs::write(folder.path().join(&path), picture.to_png().unwrap()).unwrap();
            outputs.push(json!({ "path": path }));
            // What is no preview is passed over.
            outputs.push(json!({ "path": format!("{sensor}/{frame:06}.labels.png") }));
        }
    }
    let sensors = json!([
        { "name": "top", "rotating": { "rate_hz": 10.0, "columns": 40 } },
        { "name": "front", "pinhole": { "rate_hz": 20.0 }, "range": { "max_m": 5.0 } },
    ]);
    let manifest = json!({ "job": { "sensor": sensors }, "outputs": outputs });
    fs::write(folder.path().join("manifest.json"), manifest.to_string()).unwrap();
    folder
}

fn film(folder: &Path, args: &[&str]) -> (i32, String) {
    let output = super::cli::program().args(["film", "."]).args(args).current_dir(folder).output().unwrap();
    (output.status.code().unwrap(), String::from_utf8(output.stderr).unwrap())
}

/// The size, two colours of each frame, and the number of repetitions.
type Shown = ((u32, u32), Vec<[[u8; 3]; 2]>, Option<u16>);

/// The frames of a PNG: its size, a colour near the upper left corner and one near the lower left of each, and the
/// milliseconds that each is shown.
fn frames(file: &Path) -> Shown {
    let bytes = fs::read(file).unwrap();
    let mut decoder = png::Decoder::new(Cursor::new(bytes));
    decoder.set_transformations(png::Transformations::EXPAND);
    let mut reader = decoder.read_info().unwrap();
    let size = (reader.info().width, reader.info().height);
    let count = reader.info().animation_control().map_or(1, |control| control.num_frames);
    let mut found = Vec::new();
    for _ in 0..count {
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        let at = |row: usize| pixels[3 * row * size.0 as usize..][..3].try_into().unwrap();
        found.push([at(0), at(size.1 as usize - 1)]);
    }
    let delay = reader.info().frame_control().map(|control| {
        assert_eq!(control.delay_den, 1000);
        control.delay_num
    });
    (size, found, delay)
}

#[test]
fn sensors_are_below_each_other_at_the_same_times() {
    let folder = scanned();
    let here = folder.path();
    assert_eq!(film(here, &["-o", "film.png", "--width", "20"]).0, 0);
    let (size, seen, delay) = frames(&here.join("film.png"));
    // The LiDAR is halved, and there are 4 pixels between the two.
    assert_eq!((size, delay), ((20, 5 + 4 + 15), Some(100)));
    assert_eq!(seen, [[[10, 0, 0], [90, 0, 0]], [[10, 1, 0], [90, 2, 0]], [[10, 2, 0], [90, 4, 0]]]);

    let args = ["-o", "front.png", "--sensor", "front", "--every", "2", "--width", "20"];
    assert_eq!(film(here, &args).0, 0);
    let (size, seen, delay) = frames(&here.join("front.png"));
    assert_eq!((size, delay), ((20, 15), Some(100)), "every other frame of 20 Hz");
    assert_eq!(seen.iter().map(|colours| colours[0][1]).collect::<Vec<_>>(), [0, 2, 4]);
    assert_eq!(film(here, &["-o", "slow.png", "--rate", "2", "--sensor", "top"]).0, 0);
    assert_eq!(frames(&here.join("slow.png")).2, Some(500));
}

#[test]
fn a_sheet_has_the_frames_side_by_side() {
    let folder = scanned();
    let args = ["-o", "sheet.png", "--sheet", "2", "--sensor", "top", "--width", "40"];
    let (code, said) = film(folder.path(), &args);
    assert!(code == 0 && said.contains("wrote sheet.png (3 frames, "), "{said}");
    let (size, seen, delay) = frames(&folder.path().join("sheet.png"));
    assert_eq!((size, delay), ((84, 24), None));
    assert_eq!(seen, [[[10, 0, 0], [10, 2, 0]]]);
}

#[test]
fn what_is_wrong_is_told() {
    let folder = scanned();
    let here = folder.path();
    let (code, said) = film(here, &["-o", "film.png", "--sensor", "rear"]);
    assert!(
        code == 2 && said.contains("no previews of a sensor \"rear\", only of top, front"),
        "{code}: {said}"
    );
    fs::write(here.join("film.png"), b"mine").unwrap();
    let (code, said) = film(here, &["-o", "film.png"]);
    assert!(code == 4 && said.contains("is there already"), "{code}: {said}");
    assert_eq!(film(here, &["-o", "film.png", "--overwrite"]).0, 0);
    fs::write(here.join("top/000001.png"), b"no picture").unwrap();
    let (code, said) = film(here, &["-o", "other.png"]);
    assert!(code == 3 && said.contains("top/000001.png: it is no PNG that can be read"), "{code}: {said}");
    fs::write(here.join("manifest.json"), "{\"outputs\": [{\"path\": \"top/000000.exr\"}]}").unwrap();
    let (code, said) = film(here, &["-o", "other.png"]);
    assert!(code == 3 && said.contains("has no previews: add \"png\" to `formats`"), "{code}: {said}");
    assert!(film(here, &["--rate", "0"]).1.contains("expected a number greater than 0"));
}
