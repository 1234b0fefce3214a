//! Encodes a LiDAR's frame and a camera's frame of the street in every format, beside the casting of the same frames.
//!
//! `cargo bench --bench formats` prints a table in Markdown with a row for each format that can hold one of the frames: the
//! milliseconds in which a frame is encoded, that time as a share of the time in which the frame is cast, and the megabytes of its files.
//! The frames are 128 × 2048 pixels of the LiDAR of `configs/street_128.toml`, and 1920 × 1080 pixels of an ideal camera in
//! its place. Casting and encoding take turns, and each figure is the least CPU time of several rounds on one thread. Nothing is
//! written to a disk. A format with one file for each run is encoded as a run of the frame alone. `--rounds N` chooses the
//! number of rounds.

mod arguments;
mod timing;

use std::path::Path;

use beamcast::angle::Angle;
use beamcast::config::{Job, MountedSensor, load_job};
use beamcast::output::{Format, SensorFrame};
use beamcast::run::{Item, Session, load_scene};
use beamcast::scan::{Frame, Progress};
use beamcast::sensor::{Camera, Pattern, Sensor};
use beamcast::truth::surface_colors;

use arguments::Arguments;
use timing::thread_time;

/// The least duration of a measurement, because the scheduler accounts for CPU time only every few milliseconds.
const LEAST_S: f64 = 0.03;

/// The formats with options that change how long a frame takes, as a job writes them. The rows of the others are as a job gets
/// them by name alone.
const WITH_OPTIONS: &[&str] = &[
    r#"{ format = "exr", compression = "none" }"#,
    r#"{ format = "exr", level = 4 }"#,
    r#"{ format = "exr", half = true }"#,
    r#"{ format = "ply", ascii = true }"#,
    r#"{ format = "npz", compressed = true }"#,
    r#"{ format = "mcap", compression = "zstd" }"#,
];

fn main() {
    let Some(arguments) = Arguments::read() else { return };
    let rounds = arguments.rounds(5);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let [lidar, camera] = pool.install(|| {
        let session = session();
        [0, 1].map(|sensor| Figures::of(&session, sensor, rounds))
    });
    print(&lidar, &camera);
}

/// A job as its file has it but for one line.
fn job(overrides: &[String]) -> Job {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/street_128.toml");
    load_job(&path, overrides).expect("a job that loads")
}

/// The street with the LiDAR of its job and a camera in the same place.
fn session() -> Session {
    let mut job = job(&[]);
    let lidar = &job.sensors[0];
    let pattern = Camera::from_hfov((1920, 1080), Angle::deg(80.0), None).expect("a camera");
    let sensor = Sensor { range: lidar.sensor.range, ..Sensor::new(Pattern::Camera(pattern)) };
    let camera = MountedSensor { name: "front".to_owned(), sensor, ..lidar.clone() };
    job.sensors.push(camera);
    let scene = load_scene(&mut job, &[]).expect("a scene that loads").scene;
    Session::open(job, &scene)
}

/// The rows of the table: each format with the text that the row begins with.
fn rows() -> Vec<(String, Format)> {
    let mut rows: Vec<_> = Format::all().map(|format| (format!("`{}`", format.name()), format)).collect();
    for text in WITH_OPTIONS {
        let format = job(&[format!("output.formats=[{text}]")]).output.formats[0];
        let of_same = rows.iter().rposition(|(_, other)| *other == format).expect("a format of the registry");
        rows.insert(of_same + 1, (format!("`{text}`"), format));
    }
    rows
}

/// What is measured of the frame of a sensor.
struct Figures {
    pixels: usize,
    returns: usize,
    cast_s: f64,
    /// The seconds and the bytes of each of [`rows`]. `None` if the format cannot hold the frame.
    encoded: Vec<Option<(f64, usize)>>,
}

impl Figures {
    fn of(session: &Session, sensor: usize, rounds: usize) -> Self {
        let item = Item { sensor, frame: 0, outputs: Vec::new() };
        let progress = Progress::default();
        let mut frame = Frame::default();
        assert!(session.cast_into(&mut frame, &item, &progress));
        let colors = surface_colors(session.scene(), &session.capture(&item), &frame);
        let formats: Vec<Format> = rows().into_iter().map(|(_, format)| format).collect();
        let (mut cast_s, mut encoded) = (f64::INFINITY, vec![None; formats.len()]);
        let mut again = Frame::default();
        for _ in 0..rounds {
            let seconds = time(|| assert!(session.cast_into(&mut again, &item, &progress)));
            cast_s = cast_s.min(seconds);
            let seen = SensorFrame { colors: &colors, ..session.sensor_frame(&item, &frame) };
            for (format, least) in formats.iter().zip(&mut encoded) {
                let Some(bytes) = encode(*format, &seen) else { continue };
                let seconds = time(|| {
                    encode(*format, &seen);
                });
                let (before, _) = least.unwrap_or((f64::INFINITY, 0));
                *least = Some((seconds.min(before), bytes));
            }
        }
        Self { pixels: frame.pixels(), returns: frame.return_count(), cast_s, encoded }
    }
}

/// Encodes all files of a frame, and counts their bytes. `None` if the format cannot hold the sensor's frames.
fn encode(format: Format, seen: &SensorFrame) -> Option<usize> {
    let sensor = seen.capture.sensor;
    format.check(sensor).ok()?;
    if format.is_of_run() {
        return Some(format.encode(seen).expect("a file").len());
    }
    let files = (0..format.frame_files()).filter(|file| format.makes_frame_file(*file, sensor, false));
    Some(files.map(|file| format.encode_file(file, seen).expect("a file").len()).sum())
}

/// The CPU seconds of a piece of work.
fn time(mut work: impl FnMut()) -> f64 {
    let (start, mut times) = (thread_time(), 0);
    loop {
        work();
        times += 1;
        let seconds = thread_time() - start;
        if seconds >= LEAST_S {
            return seconds / f64::from(times);
        }
    }
}

fn print(lidar: &Figures, camera: &Figures) {
    println!("| format | LiDAR: ms | of the cast | MB | camera: ms | of the cast | MB |");
    println!("|---|---|---|---|---|---|---|");
    let [of_lidar, of_camera] =
        [lidar, camera].map(|figures| format!("{:.1} | 100 % | ", figures.cast_s * 1e3));
    println!("| casting | {of_lidar} | {of_camera} |");
    for (index, (name, _)) in rows().iter().enumerate() {
        let cells = |figures: &Figures| match figures.encoded[index] {
            Some((seconds, bytes)) => format!(
                "{:.1} | {:.0} % | {:.2}",
                seconds * 1e3,
                100.0 * seconds / figures.cast_s,
                bytes as f64 * 1e-6
            ),
            None => " | | ".to_owned(),
        };
        if [lidar, camera].iter().any(|figures| figures.encoded[index].is_some()) {
            println!("| {name} | {} | {} |", cells(lidar), cells(camera));
        }
    }
    println!(
        "\nThe LiDAR's frame has {} pixels and {} returns, and the camera's {} and {}.",
        lidar.pixels, lidar.returns, camera.pixels, camera.returns
    );
}
