//! The format `waveform`: the files have the waveforms that `explain` tells, and their peaks are the frame's ranges.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use beamcast::motion::Trajectory;
use beamcast::output::{Format, SensorFrame};
use beamcast::scan::scan_into;
use beamcast::sensor::{Measurement, Receiver, ReturnMode};
use beamcast::trace::Tracer;
use beamcast::{Capture, Frame, Pose, Progress, Sensor};
use serde_json::Value;

use super::explain::{MEASURED, footprint, program, receiver, sensor, street, write_job};
use super::formats::npz;

/// The arrays of a file, as numbers.
struct File {
    arrays: BTreeMap<String, (String, Vec<u8>)>,
    about: Value,
}

impl File {
    fn read(file: &[u8]) -> Self {
        let arrays = npz(file);
        let about = serde_json::from_slice(&arrays["about.npy"].1).unwrap();
        Self { arrays, about }
    }

    fn doubles(&self, name: &str) -> Vec<f64> {
        let (header, bytes) = &self.arrays[&format!("{name}.npy")];
        assert!(header.contains("'<f8'"), "{header}");
        bytes.chunks(8).map(|b| f64::from_le_bytes(b.try_into().unwrap())).collect()
    }

    fn offsets(&self) -> Vec<usize> {
        let (header, bytes) = &self.arrays["offsets.npy"];
        assert!(header.contains("'<u4'"), "{header}");
        bytes.chunks(4).map(|b| u32::from_le_bytes(b.try_into().unwrap()) as usize).collect()
    }

    fn samples(&self) -> Vec<f32> {
        let (_, bytes) = &self.arrays["samples.npy"];
        bytes.chunks(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
    }

    /// The Gaussians of a pixel: the ranges of their middles, and their amplitudes.
    fn of_pixel(&self, pixel: usize) -> Vec<(f64, f64)> {
        let offsets = self.offsets();
        let own = offsets[pixel]..offsets[pixel + 1];
        let (ranges, amplitudes) = (self.doubles("range"), self.doubles("amplitude"));
        own.map(|i| (ranges[i], amplitudes[i])).collect()
    }
}

fn cast(sensor: &Sensor) -> Frame {
    let (scene, trajectory) = (street(), Trajectory::Fixed(Pose::IDENTITY));
    let mut frame = Frame::default();
    frame.keep_waveforms(true);
    let capture = Capture::new(sensor, Pose::IDENTITY, &trajectory, 3, 11);
    assert!(scan_into(&mut frame, &scene, &Tracer::build(&scene), &capture, &Progress::default()));
    frame
}

fn encode(sensor: &Sensor, frame: &Frame) -> Vec<u8> {
    let trajectory = Trajectory::Fixed(Pose::IDENTITY);
    let capture = Capture::new(sensor, Pose::IDENTITY, &trajectory, 3, 11);
    Format::named("waveform").unwrap().encode(&SensorFrame::new(capture, frame, "top")).unwrap()
}

/// A receiver without range pairs detects every peak, and without noise reports it where it is. A range is put together again of
/// the exact one and the term of the footprint, which rounds twice: by two halves of the last digit of numbers below 512 m, 2⁻⁴⁴ m.
#[test]
fn peaks_of_waveforms_are_the_ranges_of_the_frame() {
    let rounding_m = libm::ldexp(1.0, -44);
    let receiver = Receiver { returns: ReturnMode::Several(16), ..Receiver::default() };
    let measurement =
        Measurement { footprint: footprint(20.0), receiver: Some(receiver), ..Measurement::default() };
    let sensor = sensor(measurement);
    let frame = cast(&sensor);
    let waveforms = frame.waveforms().unwrap();
    assert_eq!(waveforms.threshold(), None);
    let (mut peaks, mut compared, mut most) = (Vec::new(), 0, 0);
    for pixel in 0..frame.pixels() {
        waveforms.waveform(pixel).peaks(&mut peaks);
        peaks.retain(|peak| (sensor.range.min_m..=sensor.range.max_m).contains(&peak.range_m));
        let ranges: Vec<f64> = frame.slots(pixel).map(|slot| frame.returns().range_m[slot]).collect();
        assert_eq!(ranges.len(), peaks.len(), "{pixel}: {ranges:?} {peaks:?}");
        for (range_m, peak) in ranges.iter().zip(&peaks) {
            assert!((range_m - peak.range_m).abs() <= rounding_m, "{pixel}: {range_m} {peak:?}");
        }
        (compared, most) = (compared + ranges.len(), most.max(ranges.len()));
    }
    assert!(compared > 50 && most >= 2, "{compared} {most}");
}

/// The file has every bit of what the frame has.
#[test]
fn a_file_has_the_waveforms_of_its_frame_on_any_number_of_threads() {
    let measurement =
        Measurement { footprint: footprint(20.0), receiver: Some(receiver()), ..Measurement::default() };
    let sensor = sensor(measurement);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let frame = cast(&sensor);
            let file = encode(&sensor, &frame);
            (frame, file)
        })
    };
    let (frame, file) = on(1);
    assert!(on(3) == (frame.clone(), file.clone()));
    let file = File::read(&file);
    let waveforms = frame.waveforms().unwrap();
    assert_eq!(file.offsets().len(), frame.pixels() + 1);
    for pixel in 0..frame.pixels() {
        let own: Vec<_> = waveforms.of_pixel(pixel).iter().map(|part| (part.range_m, part.energy)).collect();
        assert_eq!(file.of_pixel(pixel), own);
    }
    assert_eq!(file.doubles("sigma"), [waveforms.sigma_m()]);
    let about = &file.about;
    assert_eq!(about["threshold"].as_f64(), waveforms.threshold());
    assert_eq!((about["noise"].as_f64(), about["unit"].as_str()), (Some(1.0), Some("signal-to-noise ratio")));
    assert_eq!((about["rows"].as_u64(), about["columns"].as_u64()), (Some(11), Some(14)));
    assert_eq!(about["arrays"]["range"]["unit"], "m");
    assert!(about["samples"].is_null() && !file.arrays.contains_key("samples.npy"));
}

#[test]
fn a_frame_has_no_waveforms_unless_they_are_asked_for() {
    let measured = sensor(Measurement { receiver: Some(receiver()), ..Measurement::default() });
    let (scene, trajectory) = (street(), Trajectory::Fixed(Pose::IDENTITY));
    let tracer = Tracer::build(&scene);
    let ideal = sensor(Measurement::default());
    let mut frame = cast(&measured);
    assert!(frame.waveforms().is_some_and(|waveforms| !waveforms.parts().is_empty()));
    // The memory of a frame that had waveforms gives an ideal sensor's frame none.
    for (sensor, keeps, has) in [(&ideal, true, false), (&measured, false, false), (&measured, true, true)] {
        frame.keep_waveforms(keeps);
        let capture = Capture::new(sensor, Pose::IDENTITY, &trajectory, 3, 11);
        assert!(scan_into(&mut frame, &scene, &tracer, &capture, &Progress::default()));
        assert_eq!(frame.waveforms().is_some(), has);
        if !has {
            let seen = SensorFrame::new(capture, &frame, "top");
            let problem = Format::named("waveform").unwrap().encode(&seen).unwrap_err().to_string();
            assert!(problem.contains("cast without its waveforms"), "{problem}");
        }
    }
    assert!(frame == cast(&measured));
}

fn scan(folder: &Path, formats: &str) -> (i32, String) {
    let formats = format!("output.formats={formats}");
    let args = ["scan", "job.toml", "--overwrite", "--set", &formats];
    let output = super::cli::program().args(args).current_dir(folder).output().unwrap();
    (super::cli::code(&output), String::from_utf8(output.stderr).unwrap())
}

/// `explain --csv` has ranges with five digits after the point, and heights with seven digits. A Gaussian's slope is at most
/// e^(−½)·A/σ, so that a height may differ by half of 10⁻⁵ m times that of all Gaussians, and by half of its own last digit.
#[test]
fn a_scans_file_has_what_explain_tells_and_samples_of_it() {
    let folder = tempfile::tempdir().unwrap();
    write_job(folder.path(), MEASURED);
    let (code, err) =
        scan(folder.path(), r#"[{ format = "waveform", bin_m = 0.05, from_m = 10.0, to_m = 14.0 }]"#);
    assert_eq!(code, 0, "{err}");
    let bytes = fs::read(folder.path().join("out/top/000000.waveform.npz")).unwrap();
    let file = File::read(&bytes);
    // Row 1, column 2 of four columns.
    let parts = file.of_pixel(6);
    let sigma = file.doubles("sigma")[0];
    assert!(parts.len() >= 7, "{parts:?}");
    let height = |range_m: f64| -> f64 {
        let z = |middle_m: f64| (range_m - middle_m) / sigma;
        parts.iter().map(|&(middle_m, a)| a * libm::exp(-0.5 * z(middle_m) * z(middle_m))).sum()
    };
    let (code, _, err) = program(folder.path(), &["job.toml", "1", "2", "--csv", "a.csv"]);
    assert_eq!(code, 0, "{err}");
    let all: f64 = parts.iter().map(|(_, a)| a).sum();
    let csv = fs::read_to_string(folder.path().join("a.csv")).unwrap();
    let mut rows = 0;
    for line in csv.lines().skip(1) {
        let (range_m, snr) = line.split_once(',').unwrap();
        let (range_m, snr): (f64, f64) = (range_m.parse().unwrap(), snr.parse().unwrap());
        let allowed = 0.5e-5 * libm::exp(-0.5) * all / sigma + 0.5e-6 * snr + 1e-12;
        assert!((height(range_m) - snr).abs() <= allowed, "{line}: {}", height(range_m));
        rows += 1;
    }
    assert!(rows > 100);

    let grid = &file.about["samples"];
    let count = grid["count"].as_u64().unwrap() as usize;
    assert_eq!((count, grid["from_m"].as_f64(), grid["bin_m"].as_f64()), (81, Some(10.0), Some(0.05)));
    assert_eq!(file.about["arrays"]["samples"]["shape"], serde_json::json!([2, 4, 81]));
    let samples = file.samples();
    assert_eq!(samples.len(), 8 * count);
    assert!(samples[..count].iter().all(|height| *height == 0.0), "beams at 45° meet nothing");
    for (k, &sample) in samples[6 * count..7 * count].iter().enumerate() {
        let exact = height(10.0 + 0.05 * k as f64);
        // A number of 32 bits is within 2⁻²⁴ of its value, and the scan leaves out what is less than 2⁻⁵³ of a peak.
        assert!((f64::from(sample) - exact).abs() <= 6e-8 * exact + 1e-15 * all, "{k}: {sample} {exact}");
    }
    let highest = samples[6 * count..7 * count].iter().copied().fold(0.0, f32::max);
    assert!(f64::from(highest) > file.about["threshold"].as_f64().unwrap());

    // Compressed it is the same.
    let (code, err) = scan(folder.path(), r#"[{ format = "waveform", compressed = true }]"#);
    assert_eq!(code, 0, "{err}");
    let compressed = fs::read(folder.path().join("out/top/000000.waveform.npz")).unwrap();
    assert!(compressed.len() < bytes.len());
}

#[test]
fn an_ideal_sensor_is_refused_before_anything_is_cast() {
    let folder = tempfile::tempdir().unwrap();
    write_job(folder.path(), "");
    let (code, err) = scan(folder.path(), r#"["exr", "waveform"]"#);
    assert_eq!(code, 2, "{err}");
    for part in ["sensor \"top\" has no waveform: the sensor is ideal", "`nominal = true`"] {
        assert!(err.contains(part), "{err}");
    }
    assert!(!folder.path().join("out").exists());
    write_job(folder.path(), MEASURED);
    let (code, err) = scan(folder.path(), r#"[{ format = "waveform", from_m = 3.0 }]"#);
    assert!(code != 0 && err.contains("`from_m` is about samples, and needs their distance"), "{err}");
}
