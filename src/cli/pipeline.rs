//! The steps that subcommands share: from a job's file to frames.

use std::fs;
use std::path::{Component, Path, PathBuf};

use crate::config::{self, Job, MountedSensor};
use crate::error::{Error, SceneError};
use crate::frame::Pose;
use crate::output::{CloudFrame, Format, Manifest, SensorFrame};
use crate::scan::{self, Frame, Progress};
use crate::scene::{Scene, gltf};
use crate::sensor::Capture;
use crate::source::suggest::missing_file_help;
use crate::trace::Cast;

use super::terminal::Terminal;

/// Sets the number of threads that all work of the process is shared among.
///
/// # Errors
/// [`Error::Usage`] if there can't be so many.
pub fn set_threads(threads: Option<u16>) -> Result<(), Error> {
    let Some(threads) = threads else { return Ok(()) };
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads.into());
    pool.build_global().map_err(|e| Error::Usage(format!("{threads} threads can't be had: {e}")))
}

/// Which job, and what is changed of it. The flags that every subcommand that runs jobs has.
#[derive(Debug, clap::Args)]
pub struct JobArgs {
    /// The job's file
    #[arg(value_name = "JOB.toml")]
    job: PathBuf,
    /// Change a key of the job, such as sensor.top.range.max_m=50; can be given again
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<String>,
    /// Threads to work on, 1 to 1024; the outputs are the same with any number [default: all cores]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,
}

impl JobArgs {
    /// The job's file as the user named it.
    pub fn path(&self) -> &Path {
        &self.job
    }

    /// Sets the number of threads, and reads the job.
    ///
    /// # Errors
    /// [`Error::Config`] with all that is wrong with the job, [`Error::Usage`] if there can't be so many threads.
    pub fn load(&self, terminal: &Terminal) -> Result<Job, Error> {
        set_threads(self.threads)?;
        let job = config::load_job(&self.job, &self.overrides)?;
        terminal.warn_of(&job.warnings);
        Ok(job)
    }
}

/// Reads the job's scene.
///
/// # Errors
/// [`Error::Scene`] with the file's element that is wrong.
pub fn load_scene(job: &Job, terminal: &Terminal) -> Result<Scene, Error> {
    let options = gltf::Options { scene_name: job.scene_name.as_deref(), up: job.up, labels: &job.labels };
    let gltf::Loaded { scene, warnings } = open_scene(&job.scene_path, &job.scene_as_written, &options)?;
    for warning in warnings {
        terminal.warn(warning);
    }
    for file in &scene.geometry.files {
        terminal.detail(format_args!("read {} ({}, BLAKE3 {})", file.name, Bytes(file.bytes), file.blake3));
    }
    Ok(scene)
}

/// Reads a scene. Of one that isn't there, the error says what is.
///
/// # Errors
/// With the file's element that is wrong.
pub fn open_scene(
    path: &Path,
    as_written: &str,
    options: &gltf::Options,
) -> Result<gltf::Loaded, SceneError> {
    gltf::load(path, as_written, options).map_err(|error| {
        let shown = tidy(path);
        let help = if path.exists() { None } else { missing_file_help(as_written, &shown) };
        SceneError { path: shown, help: help.or(error.help), ..error }
    })
}

/// The TOML files in a folder and the folders in it, in alphabetical order. Hidden folders are left out, and links to
/// folders, which may lead round in a circle.
pub fn configs_in(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).into_iter().flatten().flatten() {
            let is_hidden = entry.file_name().to_string_lossy().starts_with('.');
            let path = entry.path();
            if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
                if !is_hidden {
                    folders.push(path);
                }
            } else if path.extension().is_some_and(|e| e == "toml") {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

/// Casts a frame of a sensor. `None` when `progress` was cancelled.
pub fn cast(
    job: &Job,
    sensor: &MountedSensor,
    scene: &Scene,
    tracer: &impl Cast,
    progress: &Progress,
) -> Option<Frame> {
    scan::scan(scene, tracer, &capture(job, sensor), progress)
}

/// A sensor's first frame, before it is cast.
pub fn capture<'a>(job: &'a Job, mounted: &'a MountedSensor) -> Capture<'a> {
    Capture::new(&mounted.sensor, mounted.body_from_sensor, &job.trajectory, 0, job.seed)
}

/// A sensor's frame with all that is known about where it came from.
pub fn sensor_frame<'a>(job: &'a Job, mounted: &'a MountedSensor, frame: &'a Frame) -> SensorFrame<'a> {
    let capture = capture(job, mounted);
    SensorFrame { capture, frame, name: &mounted.name, cloud_frame: job.output.cloud_frame }
}

/// What a job will take, found before any of it is done.
#[derive(Debug)]
pub struct Plan {
    /// Rays of all sensors' frames.
    pub rays: u64,
    /// Upper estimate of the memory for frames and their encoding, in bytes; the scene's comes on top.
    pub bytes: u64,
}

impl Plan {
    /// Adds up a job's sensors, whose frames are cast and written one after the other.
    ///
    /// # Errors
    /// [`Error::Usage`] if a frame doesn't fit one of its formats or the machine's memory.
    pub fn of(job: &Job) -> Result<Self, Error> {
        let mut plan = Self { rays: 0, bytes: 0 };
        for MountedSensor { name, sensor, .. } in &job.sensors {
            for format in &job.output.formats {
                let fits = format.check(sensor);
                fits.map_err(|e| Error::Usage(format!("sensor {name:?} has no {}: {e}", format.name())))?;
            }
            let encoding = job.output.formats.iter().map(|format| format.encoding_bytes_a_ray(sensor)).max();
            let a_ray = Frame::BYTES_A_PIXEL as u64 + encoding.unwrap_or(0);
            let (rows, columns) = (sensor.pattern.rows() as u64, sensor.pattern.columns() as u64);
            let sums = rows.checked_mul(columns).and_then(|rays| {
                let bytes = rays.checked_mul(a_ray)?.max(plan.bytes);
                Some(Self { rays: plan.rays.checked_add(rays)?, bytes })
            });
            let too_many = || Error::Usage(format!("sensor {name:?} has too many rays: {rows} × {columns}"));
            plan = sums.ok_or_else(too_many)?;
            check_memory(name, plan.bytes, memory_of_machine())?;
        }
        Ok(plan)
    }
}

fn check_memory(name: &str, needed: u64, memory: Option<u64>) -> Result<(), Error> {
    match memory {
        Some(memory) if needed > memory => Err(Error::Usage(format!(
            "a frame of sensor {name:?} takes about {} ({needed} bytes), and this machine has {} ({memory} bytes): \
             fewer rows or columns would fit",
            Bytes(needed),
            Bytes(memory)
        ))),
        _ => Ok(()),
    }
}

/// The names of a job's outputs, relative to its folder; the manifest is the last.
pub fn output_names(job: &Job) -> Vec<String> {
    let of_sensor = |sensor: &MountedSensor| {
        job.output.formats.iter().map(|&f| output_name(&sensor.name, f)).collect::<Vec<_>>()
    };
    job.sensors.iter().flat_map(of_sensor).chain([Manifest::NAME.to_owned()]).collect()
}

/// The name of the file of a sensor's frame, relative to the output folder.
pub fn output_name(sensor: &str, format: Format) -> String {
    format!("{sensor}/000000.{}", format.name())
}

/// The same path by a shorter name where there is one: a job's `../out` comes as `configs/../out`, and is shown and
/// written to as `out`. What exists is resolved as the system resolves it, links included; what lies outside the current
/// folder keeps its name.
pub fn tidy(path: &Path) -> PathBuf {
    let has_detour = |path: &Path| path.components().any(|part| part == Component::ParentDir);
    let resolve = || {
        let here = fs::canonicalize(".").ok()?;
        let whole = path.ancestors().find_map(|ancestor| {
            Some(fs::canonicalize(ancestor).ok()?.join(path.strip_prefix(ancestor).ok()?))
        })?;
        whole.strip_prefix(&here).map(Path::to_path_buf).ok()
    };
    match has_detour(path).then(resolve).flatten() {
        Some(shorter) if !has_detour(&shorter) && !shorter.as_os_str().is_empty() => shorter,
        _ => path.to_path_buf(),
    }
}

/// The way from a folder to a file, both as seen from here: what a file in that folder calls it. With forward slashes, which
/// every system takes. A file on another drive keeps its whole name.
pub fn seen_from(folder: &Path, file: &Path) -> String {
    let whole = |path: &Path| fs::canonicalize(path).or_else(|_| std::path::absolute(path)).ok();
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let way = match (whole(folder), whole(file)) {
        (Some(folder), Some(file)) => {
            let common = folder.components().zip(file.components()).take_while(|(a, b)| a == b).count();
            let up = folder.components().skip(common).map(|_| Component::ParentDir);
            let down = file.components().skip(common);
            if common == 0 { file.clone() } else { up.chain(down).collect() }
        }
        _ => file.to_path_buf(),
    };
    let text = way.to_string_lossy();
    if cfg!(windows) { text.replace('\\', "/") } else { text.into_owned() }
}

/// What a cloud loses in 32-bit coordinates, if that is more than a millimetre.
pub fn precision_warning(job: &Job) -> Option<String> {
    let pose = |sensor: &MountedSensor| match job.output.cloud_frame {
        CloudFrame::Sensor => Pose::IDENTITY,
        CloudFrame::Body => sensor.body_from_sensor,
        CloudFrame::World => capture(job, sensor).world_from_sensor(0.0),
    };
    let coordinates = job.sensors.iter().map(|s| pose(s).translation.abs().max_element());
    let farthest = coordinates.fold(0.0, f64::max) as f32;
    let step = farthest.next_up() - farthest;
    (job.output.formats.contains(&Format::PLY) && step > 1e-3).then(|| {
        format!(
            "points {farthest} m from the origin come in steps of {} mm, the spacing of 32-bit floats there; \
             output.frame = \"sensor\" keeps them exact",
            step * 1e3
        )
    })
}

/// Bytes of memory that this process may have, where the system says so.
fn memory_of_machine() -> Option<u64> {
    let machine = proc_kilobytes("/proc/meminfo", "MemTotal:");
    // A container's limit, which may be less.
    let limit =
        fs::read_to_string("/sys/fs/cgroup/memory.max").ok().and_then(|text| text.trim().parse().ok());
    [machine, limit].into_iter().flatten().min()
}

/// The most memory that this process held at any time, in bytes, where the system says so.
pub fn peak_memory() -> Option<u64> {
    proc_kilobytes("/proc/self/status", "VmHWM:")
}

/// A line such as `MemTotal:  1024 kB`, in bytes.
fn proc_kilobytes(file: &str, key: &str) -> Option<u64> {
    let text = fs::read_to_string(file).ok()?;
    let value = text.lines().find_map(|line| line.strip_prefix(key))?;
    value.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

/// Shows a number of bytes in a unit that suits it.
#[derive(Clone, Copy, Debug)]
pub struct Bytes(pub u64);

impl std::fmt::Display for Bytes {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        const UNITS: [&str; 6] = ["kB", "MB", "GB", "TB", "PB", "EB"];
        if self.0 < 1000 {
            return write!(f, "{} bytes", self.0);
        }
        let mut value = self.0 as f64 / 1e3;
        let mut unit = 0;
        while value >= 999.95 && unit + 1 < UNITS.len() {
            value /= 1e3;
            unit += 1;
        }
        write!(f, "{value:.1} {}", UNITS[unit])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_are_readable() {
        let shown = [0, 999, 1000, 999_949, 999_950, 13_000_000_000, u64::MAX].map(|n| Bytes(n).to_string());
        assert_eq!(shown, ["0 bytes", "999 bytes", "1.0 kB", "999.9 kB", "1.0 MB", "13.0 GB", "18.4 EB"]);
    }

    #[test]
    fn more_memory_than_there_is_is_refused_with_the_estimate() {
        assert!(check_memory("top", 1000, Some(1000)).is_ok());
        assert!(check_memory("top", u64::MAX, None).is_ok());
        let error = check_memory("top", 1_500_000, Some(1_000_000)).unwrap_err();
        assert_eq!(error.exit_code(), 2);
        let message = error.to_string();
        assert!(message.contains("\"top\" takes about 1.5 MB (1500000 bytes)"), "{message}");
    }

    #[test]
    fn a_path_is_shown_without_detours() {
        // Tests run in the package's folder, where there is `src/cli` and no `src/nowhere`.
        let tidied = |path: &str| tidy(Path::new(path)).to_string_lossy().replace('\\', "/");
        assert_eq!(tidied("src/cli/../../out/street"), "out/street");
        assert_eq!(tidied("out/street"), "out/street");
        assert_eq!(tidied("src/nowhere/../out"), "src/nowhere/../out");
        assert_eq!(tidied("src/.."), "src/..");
        for outside in [std::env::temp_dir().join("a"), Path::new("src/../../a").to_path_buf()] {
            assert_eq!(tidy(&outside), outside);
        }
    }

    #[test]
    fn a_file_is_named_as_seen_from_a_folder() {
        // Tests run in the package's folder.
        let seen = |folder: &str, file: &str| seen_from(Path::new(folder), Path::new(file));
        assert_eq!(seen("", "src/lib.rs"), "src/lib.rs");
        assert_eq!(seen("src", "src/lib.rs"), "lib.rs");
        assert_eq!(seen("src/cli", "Cargo.toml"), "../../Cargo.toml");
        assert_eq!(seen("src/cli", "no such.glb"), "../../no such.glb");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn linux_tells_of_its_memory() {
        assert!(memory_of_machine().unwrap() > 1 << 20);
        assert!(peak_memory().unwrap() > 1 << 16);
        assert_eq!(proc_kilobytes("/proc/self/status", "NoSuchKey:"), None);
        assert_eq!(proc_kilobytes("/nowhere", "MemTotal:"), None);
    }
}
