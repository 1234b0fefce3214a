//! Projectors that throw an image of the user's own.

use std::fs;
use std::path::{Path, PathBuf};

use beamcast::Error;
use beamcast::config;

use super::plates::{cast, scene, wall};

/// A camera whose field of view is that of its projector, which stands at the same place: tangents of ± 0.4 and ± 0.3.
const SENSOR: &str = r#"
[pinhole]
width_px = 16
height_px = 12
fx_px = 20.0

[range]
min_m = 0.05

[stereo]
baseline_m = 0.05
method = "match"
disparities = 8

[stereo.projector]
offset_m = 0.0
field_deg = [43.602818972703, 33.398488467987]
pattern = "pattern.png"

[stereo.imager]
projected_at_1_m = 60.0
ambient = 0.0
noise = 0.0

[stereo.matcher]
census_px = [3, 3]
block_px = 3
"#;

fn png(folder: &Path, (width, height): (u32, u32), color: png::ColorType, pixels: &[u8]) {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width, height);
    encoder.set_color(color);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.write_header().unwrap().write_image_data(pixels).unwrap();
    fs::write(folder.join("pattern.png"), file).unwrap();
}

fn sensor_file(folder: &Path, text: &str) -> PathBuf {
    let path = folder.join("sensor.toml");
    fs::write(&path, text).unwrap();
    path
}

/// A wall that is seen head-on shows the projector's image pixel by pixel: each grey value is p/mean·ρ·cos θ/r² of the projected one,
/// rounded to a whole number.
#[test]
fn a_wall_shows_the_pattern_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let pixels: Vec<u8> = (0..16 * 12).map(|i| (i * 37 % 101 + 50) as u8).collect();
    png(folder.path(), (16, 12), png::ColorType::Grayscale, &pixels);
    let sensor = config::load_sensor(&sensor_file(folder.path(), SENSOR)).unwrap().sensor;
    let (z, rho) = (1.25, 0.5);
    let frame = cast(&scene(&[wall(z, rho)]), &sensor, 0);
    let mean = pixels.iter().map(|p| f64::from(*p)).sum::<f64>() / pixels.len() as f64;
    for (pixel, &seen) in frame.images().ir_left.iter().enumerate() {
        let tangent = |index: usize, count: usize| (index as f64 + 0.5 - count as f64 / 2.0) / 20.0;
        let (x, y) = (tangent(pixel % 16, 16), tangent(pixel / 16, 12));
        let square = 1.0 + x * x + y * y;
        let back = super::plates::factor(rho, square.sqrt().recip());
        let grey = 60.0 * f64::from(pixels[pixel]) / mean * back / (z * z * square);
        // The angles have 12 digits, so the pattern's pixels overlap their neighbours by 1e-11 of a pixel.
        assert!((f64::from(seen) - grey).abs() <= 0.5 + 1e-6, "{pixel}: {seen} is not {grey}");
    }
}

/// All that the job's inputs are told by is the same as for other files: the manifest lists the pattern.
#[test]
fn a_pattern_is_an_input_of_the_job() {
    let folder = tempfile::tempdir().unwrap();
    png(folder.path(), (2, 1), png::ColorType::Grayscale, &[255, 0]);
    sensor_file(folder.path(), SENSOR);
    let job = folder.path().join("job.toml");
    fs::write(&job, "scene = \"a.glb\"\n[[sensor]]\npreset = \"sensor.toml\"\n[output]\ndir = \"out\"\n")
        .unwrap();
    let job = config::load_job(&job, &[]).unwrap();
    let file = job.inputs.iter().find(|input| input.name == "pattern.png").unwrap();
    let bytes = fs::read(folder.path().join("pattern.png")).unwrap();
    assert_eq!((file.bytes, &file.blake3), (bytes.len() as u64, &blake3::hash(&bytes).to_hex().to_string()));
}

#[test]
fn patterns_that_are_no_grey_image_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let told = |text: &str| match config::load_sensor(&sensor_file(folder.path(), text)) {
        Err(Error::Config(found)) => {
            let one = found.iter().find(|d| d.severity == beamcast::source::Severity::Error).unwrap();
            let line = one.line_column().0;
            format!("{line}: {} | {}", one.message, one.label)
        }
        Err(other) => other.to_string(),
        Ok(sensor) => sensor.warnings.iter().map(|d| d.message.clone()).collect(),
    };
    assert_eq!(told(SENSOR), "18: the pattern `pattern.png` can't be used | there is no such file");
    fs::write(folder.path().join("pattern.png"), "P5 2 1 255\n..").unwrap();
    let message = told(SENSOR);
    assert!(message.contains("| it is no PNG that can be read: "), "{message}");
    png(folder.path(), (1, 1), png::ColorType::Rgb, &[255, 255, 255]);
    let message = told(SENSOR);
    assert!(
        message.ends_with("| it has colours or transparency, and a pattern is a PNG of grey values alone")
    );
    png(folder.path(), (2, 1), png::ColorType::Grayscale, &[0, 0]);
    assert!(told(SENSOR).ends_with("| it is black, and a pattern needs light"));
    // A header that promises what no file holds takes no memory.
    png(folder.path(), (2, 1), png::ColorType::Grayscale, &[9, 9]);
    let mut file = fs::read(folder.path().join("pattern.png")).unwrap();
    file[16..24].copy_from_slice(&[0, 1, 0, 0, 0, 1, 0, 0]);
    let check = crc32fast::hash(&file[12..29]).to_be_bytes();
    file[29..33].copy_from_slice(&check);
    fs::write(folder.path().join("pattern.png"), file).unwrap();
    let message = told(SENSOR);
    assert!(
        message.contains("it has 65536 × 65536 pixels, more than the 67108864 of a pattern"),
        "{message}"
    );
    png(folder.path(), (2, 1), png::ColorType::Grayscale, &[9, 9]);
    let message = told(&SENSOR.replace("pattern = ", "dots = 100\npattern = "));
    assert_eq!(message, "`dots` is a setting of dots, and the projector's `pattern` is an image");
}
