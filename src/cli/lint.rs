//! `beamcast lint`: reads jobs, sensor files and scenes without running them, tells all that is wrong with them, and what
//! follows from them.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use glam::DVec3;
use serde::Serialize;

use super::terminal::Terminal;
use super::{diagnostics, pipeline};
use crate::config::{self, Config, Job};
use crate::error::{Error, SceneError};
use crate::frame::UpAxis;
use crate::output::Format;
use crate::scan::Frame;
use crate::scene::{Mesh, Scene, gltf};
use crate::sensor::{Camera, Capture, Pattern, Rotating, Sensor, azimuth_elevation};
use crate::source::suggest::quoted;
use crate::source::{Diagnostic, Severity};

/// What to read.
#[derive(clap::Args, Clone, Debug)]
pub struct Args {
    /// Jobs, sensor files, scenes (.gltf, .glb), or folders of jobs and sensor files
    #[arg(required = true, value_name = "PATH")]
    pub paths: Vec<PathBuf>,
    /// Print the facts and the problems as JSON on stdout
    #[arg(long)]
    pub json: bool,
}

/// Reads everything that `args` name. Facts go to stdout, warnings to stderr; errors, with the warnings, are returned.
///
/// # Errors
/// [`Error::Config`] with all that is wrong in any of the paths; [`Error::Output`] if stdout can't be written to.
pub fn run(args: &Args, color: bool) -> Result<(), Error> {
    let (facts, diagnostics) = examine(&args.paths);
    let text = if args.json {
        let told: Vec<_> = diagnostics.iter().map(Problem::from).collect();
        let whole = serde_json::json!({ "files": facts, "diagnostics": told });
        format!("{whole:#}\n")
    } else {
        facts.iter().map(FileFacts::to_text).collect::<Vec<_>>().join("\n")
    };
    match std::io::stdout().lock().write_all(text.as_bytes()) {
        Err(error) if error.kind() != std::io::ErrorKind::BrokenPipe => {
            return Err(Error::output("stdout", error));
        }
        _ => {}
    }
    if diagnostics.iter().any(|d| d.severity == Severity::Error) {
        return Err(Error::Config(diagnostics));
    }
    // A closed stderr means that nobody wants to know.
    let _ = std::io::stderr().lock().write_all(diagnostics::render(&diagnostics, color).as_bytes());
    Ok(())
}

/// Reads every path; what there is to know about the good ones, and what is wrong.
fn examine(paths: &[PathBuf]) -> (Vec<FileFacts>, Vec<Diagnostic>) {
    let mut facts = Vec::new();
    let mut diagnostics = Vec::new();
    for path in paths {
        let files = if path.is_dir() { pipeline::configs_in(path) } else { vec![path.clone()] };
        if files.is_empty() {
            let help = "name a folder that has some, or a file";
            diagnostics.push(about_file(path, "the folder has no *.toml files".into(), Some(help.into())));
        }
        for file in &files {
            examine_file(file, &mut facts, &mut diagnostics);
        }
    }
    (facts, diagnostics)
}

/// What there is to know about a job, a sensor file or a scene; its warnings are told.
///
/// # Errors
/// [`Error::Scene`] if it is a scene that can't be read, else [`Error::Config`] with all that is wrong.
pub(super) fn facts_of(path: &Path, terminal: &Terminal) -> Result<FileFacts, Error> {
    let mut diagnostics = Vec::new();
    if is_scene(path) {
        let name = path.to_string_lossy();
        let scene = open_scene(path, &name, None, &mut diagnostics)?;
        terminal.warn_of(&diagnostics);
        return Ok(FileFacts::of_scene(&name, &scene));
    }
    let mut facts = Vec::new();
    examine_file(path, &mut facts, &mut diagnostics);
    match facts.pop() {
        Some(facts) if diagnostics.iter().all(|d| d.severity == Severity::Warning) => {
            terminal.warn_of(&diagnostics);
            Ok(facts)
        }
        _ => Err(Error::Config(diagnostics)),
    }
}

fn is_scene(path: &Path) -> bool {
    path.extension().map(|e| e.to_ascii_lowercase()).is_some_and(|e| e == "gltf" || e == "glb")
}

fn examine_file(path: &Path, facts: &mut Vec<FileFacts>, diagnostics: &mut Vec<Diagnostic>) {
    let name = path.to_string_lossy();
    if is_scene(path) {
        match open_scene(path, &name, None, diagnostics) {
            Ok(scene) => facts.push(FileFacts::of_scene(&name, &scene)),
            Err(error) => diagnostics.push(about_scene(error)),
        }
        return;
    }
    match config::load(path) {
        Ok(Config::Sensor(file)) => {
            diagnostics.extend(file.warnings);
            let sensors = vec![SensorFacts::new(None, &file.sensor, &Format::all().collect::<Vec<_>>())];
            facts.push(FileFacts { path: name.into_owned(), kind: "sensor", sensors, scene: None });
        }
        Ok(Config::Job(job)) => {
            match open_scene(&job.scene_path, &job.scene_as_written, Some(&job), diagnostics) {
                Ok(scene) => {
                    let of = |m: &config::MountedSensor| {
                        SensorFacts::new(Some(&m.name), &m.sensor, &job.output.formats)
                    };
                    let sensors = job.sensors.iter().map(of).collect();
                    let scene = Some(SceneFacts::new(&job.scene_as_written, &scene));
                    facts.push(FileFacts { path: name.into_owned(), kind: "job", sensors, scene });
                }
                Err(error) => {
                    let mut problem = about_scene(error);
                    problem.message = format!("the scene of {name}: {}", problem.message);
                    diagnostics.push(problem);
                }
            }
            diagnostics.extend(job.warnings);
        }
        Err(Error::Config(found)) => diagnostics.extend(found),
        Err(other) => diagnostics.push(about_file(path, other.to_string(), None)),
    }
}

/// Opens a scene as `scan` would, for a job or, without one, as it stands.
fn open_scene(
    path: &Path,
    as_written: &str,
    job: Option<&Job>,
    diagnostics: &mut Vec<Diagnostic>,
) -> Result<Scene, SceneError> {
    let no_labels = BTreeMap::new();
    let options = gltf::Options {
        scene_name: job.and_then(|job| job.scene_name.as_deref()),
        up: job.map_or(UpAxis::default(), |job| job.up),
        labels: job.map_or(&no_labels, |job| &job.labels),
    };
    let loaded = pipeline::open_scene(path, as_written, &options)?;
    let warning = |text| Diagnostic { severity: Severity::Warning, ..about_file(path, text, None) };
    diagnostics.extend(loaded.warnings.into_iter().map(warning));
    Ok(loaded.scene)
}

fn about_file(path: &Path, message: String, help: Option<String>) -> Diagnostic {
    Diagnostic {
        severity: Severity::Error,
        message,
        path: path.to_path_buf(),
        source: "".into(),
        span: 0..0,
        label: String::new(),
        help,
    }
}

fn about_scene(error: SceneError) -> Diagnostic {
    let message = if error.element.is_empty() {
        error.problem
    } else {
        format!("{}: {}", error.element, error.problem)
    };
    about_file(&error.path, message, error.help)
}

/// A problem as JSON tells it.
#[derive(Serialize)]
struct Problem<'a> {
    severity: &'static str,
    path: String,
    line: usize,
    column: usize,
    message: &'a str,
    label: &'a str,
    help: Option<&'a str>,
}

impl<'a> From<&'a Diagnostic> for Problem<'a> {
    fn from(d: &'a Diagnostic) -> Self {
        let (line, column) = d.line_column();
        let severity = match d.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
        };
        let path = d.path.to_string_lossy().into_owned();
        Self { severity, path, line, column, message: &d.message, label: &d.label, help: d.help.as_deref() }
    }
}

/// What is known about a file.
#[derive(Serialize)]
pub(super) struct FileFacts {
    path: String,
    kind: &'static str,
    sensors: Vec<SensorFacts>,
    scene: Option<SceneFacts>,
}

/// What there is to know about a sensor.
#[derive(Serialize)]
pub(super) struct SensorFacts {
    pub name: Option<String>,
    pub kind: &'static str,
    pub rows: usize,
    pub columns: usize,
    pub rays_per_frame: usize,
    pub horizontal_fov_deg: f64,
    /// Lowest and highest; a camera's along the image's middle column.
    pub elevation_deg: [f64; 2],
    /// From one column to the next; a camera's is that of the pixel at its principal point. Only of images.
    pub azimuth_step_deg: Option<f64>,
    /// Smallest and largest from one row to the next; a camera's, both that of the pixel at its principal point.
    pub elevation_step_deg: Option<[f64; 2]>,
    pub rate_hz: Option<f64>,
    pub points_per_second: Option<f64>,
    pub min_range_m: f64,
    /// `None` if there's no limit.
    pub max_range_m: Option<f64>,
    /// From the first pulse of a frame to the last.
    pub frame_s: f64,
    /// Pixels that the lens's or the prisms' model has no ray for.
    pub blind_pixels: usize,
    /// What a frame takes in memory while it's made.
    pub frame_bytes: u64,
    /// What a frame takes on the disk at most, by format.
    pub output_bytes: serde_json::Map<String, serde_json::Value>,
}

impl SensorFacts {
    pub fn new(name: Option<&str>, sensor: &Sensor, formats: &[Format]) -> Self {
        let pattern = &sensor.pattern;
        let (rows, columns, rays) = (pattern.rows(), pattern.columns(), pattern.rays());
        let angles = match pattern {
            Pattern::Rotating(p) => Angles::of_rotating(p),
            Pattern::Camera(p) => Angles::of_camera(p),
            _ => Angles::of_pulses(&Capture::at_origin(sensor)),
        };
        let capture = Capture::at_origin(sensor);
        let blind = if rays <= MOST_RAYS_TO_ASK { capture.blind_pixels() } else { 0 };
        let limit = sensor.range.max_m;
        let output_bytes = formats
            .iter()
            .map(|format| {
                let bytes = (format.0.file_bytes_a_ray)(sensor) * rays as u64;
                (format.name().to_owned(), bytes.into())
            })
            .collect();
        Self {
            name: name.map(str::to_owned),
            kind: if pattern.is_camera() { "camera" } else { "LiDAR" },
            rows,
            columns,
            rays_per_frame: rays,
            horizontal_fov_deg: angles.horizontal_fov,
            elevation_deg: angles.elevation,
            azimuth_step_deg: angles.azimuth_step,
            elevation_step_deg: angles.elevation_step,
            rate_hz: pattern.rate_hz(),
            points_per_second: pattern.rate_hz().map(|rate| rate * (rays - blind) as f64),
            min_range_m: sensor.range.min_m,
            max_range_m: limit.is_finite().then_some(limit),
            frame_s: pattern.last_pulse_s(),
            blind_pixels: blind,
            frame_bytes: rays as u64 * Frame::BYTES_A_PIXEL as u64,
            output_bytes,
        }
    }
}

/// The angles of a pattern, in degrees.
struct Angles {
    horizontal_fov: f64,
    elevation: [f64; 2],
    azimuth_step: Option<f64>,
    elevation_step: Option<[f64; 2]>,
}

/// Of a larger frame it's not counted how many pixels have no ray: asking each would take too long.
const MOST_RAYS_TO_ASK: usize = 1 << 24;

impl Angles {
    fn of_rotating(p: &Rotating) -> Self {
        let (from, to) = p.sector();
        let elevation = |row: usize| p.beams()[row].elevation.degrees();
        let steps = (1..p.beams().len()).map(|row| elevation(row - 1) - elevation(row));
        let step = steps.fold(None, |range: Option<[f64; 2]>, step| {
            let [least, most] = range.unwrap_or([step; 2]);
            Some([least.min(step), most.max(step)])
        });
        Self {
            horizontal_fov: (to - from).degrees().abs(),
            elevation: [elevation(p.beams().len() - 1), elevation(0)],
            azimuth_step: Some(p.azimuth_step().degrees().abs()),
            elevation_step: step,
        }
    }

    /// Edge to edge of the image through the principal point, or as far as the lens sees: of a pinhole
    /// atan((width − cx)/fx) + atan(cx/fx), and so upwards. The steps are those of the pixel there.
    fn of_camera(p: &Camera) -> Self {
        let ((cx, cy), (width, height)) = (p.principal_px(), (p.width() as f64, p.height() as f64));
        // Degrees to the right and down of the axis.
        let right = |u: f64| p.optical_direction_at(u, cy).map(|d| libm::atan2(d.x, d.z).to_degrees());
        let down = |v: f64| p.optical_direction_at(cx, v).map(|d| libm::atan2(d.y, d.z).to_degrees());
        let seen = |along: &dyn Fn(f64) -> Option<f64>, edge: f64, inward: f64| {
            (0..=p.width().max(p.height())).find_map(|i| along(edge + inward * i as f64)).unwrap_or(0.0)
        };
        let step = |along: &dyn Fn(f64) -> Option<f64>, centre: f64| {
            Some(along(centre + 0.5)? - along(centre - 0.5)?)
        };
        Self {
            horizontal_fov: seen(&right, width, -1.0) - seen(&right, 0.0, 1.0),
            elevation: [-seen(&down, height, -1.0), -seen(&down, 0.0, 1.0)],
            azimuth_step: step(&right, cx),
            elevation_step: step(&down, cy).map(|step| [step; 2]),
        }
    }

    /// What the pulses of the first frame reach; of very many, evenly spaced ones.
    fn of_pulses(capture: &Capture) -> Self {
        let (rays, columns) = (capture.rows() * capture.columns(), capture.columns());
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for index in (0..rays).step_by(rays.div_ceil(MOST_RAYS_TO_ASK)) {
            let Some(pulse) = capture.pulse(index / columns, index % columns) else { continue };
            let (azimuth, elevation) = azimuth_elevation(pulse.direction);
            for (axis, angle) in [azimuth, elevation].into_iter().enumerate() {
                low[axis] = low[axis].min(angle.degrees());
                high[axis] = high[axis].max(angle.degrees());
            }
        }
        Self {
            horizontal_fov: (high[0] - low[0]).max(0.0),
            elevation: [low[1].min(high[1]), high[1].max(low[1])],
            azimuth_step: None,
            elevation_step: None,
        }
    }
}

/// What there is to know about a scene.
#[derive(Serialize)]
struct SceneFacts {
    path: String,
    triangles: u64,
    stored_triangles: u64,
    skipped_triangles: u64,
    instances: usize,
    materials: usize,
    /// Every semantic label that a surface has, in ascending order.
    labels: Vec<u32>,
    /// The least and the largest x, y and z in the world; of meshes placed more than once, those of their boxes.
    extent_m: [[f64; 2]; 3],
    /// The middle of that.
    centre_m: [f64; 3],
    /// With what tracing it takes.
    memory_bytes: u64,
}

/// A stored triangle with its vertices and its part of the acceleration structure, roughly.
const BYTES_PER_TRIANGLE: u64 = 100;

impl SceneFacts {
    fn new(path: &str, scene: &Scene) -> Self {
        let mut labels: Vec<u32> = (0..scene.arrangement.placements.len())
            .flat_map(|placement| {
                let parts =
                    &scene.geometry.meshes[scene.arrangement.placements[placement].mesh as usize].parts;
                parts.iter().map(move |part| scene.surface(placement as u32, part.first_triangle))
            })
            .map(|surface| scene.label(surface))
            .collect();
        labels.sort_unstable();
        labels.dedup();
        let extent_m = extent(scene);
        Self {
            path: path.to_owned(),
            triangles: scene.triangle_count(),
            stored_triangles: scene.geometry.stored_triangle_count(),
            skipped_triangles: scene.geometry.skipped_triangles,
            instances: scene.geometry.objects.len(),
            materials: scene.geometry.materials.len(),
            labels,
            extent_m,
            centre_m: extent_m.map(|[low, high]| (low + high) / 2.0),
            memory_bytes: scene.geometry.stored_triangle_count() * BYTES_PER_TRIANGLE,
        }
    }
}

fn extent(scene: &Scene) -> [[f64; 2]; 3] {
    let (nothing, everything) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let own = |mesh: &Mesh| {
        let positions = mesh.positions.iter().map(|p| DVec3::from_array(p.map(f64::from)));
        positions.fold((nothing, everything), |(low, high), p| (low.min(p), high.max(p)))
    };
    let own: Vec<_> = scene.geometry.meshes.iter().map(own).collect();
    let (mut low, mut high) = (nothing, everything);
    for placement in &scene.arrangement.placements {
        let (a, b) = own[placement.mesh as usize];
        if a.x > b.x {
            continue; // mesh 0 may be empty
        }
        for corner in 0..8 {
            let p = DVec3::from_array([0, 1, 2].map(|i| if corner >> i & 1 == 0 { a[i] } else { b[i] }));
            let p = placement.scene_from_mesh().transform_point3(p) + scene.geometry.centre;
            (low, high) = (low.min(p), high.max(p));
        }
    }
    [0, 1, 2].map(|axis| [low[axis], high[axis]])
}

impl FileFacts {
    fn of_scene(path: &str, scene: &Scene) -> Self {
        let scene = Some(SceneFacts::new(path, scene));
        Self { path: path.to_owned(), kind: "scene", sensors: vec![], scene }
    }

    /// For people.
    pub(super) fn to_text(&self) -> String {
        let mut text = format!("{}: {}\n", quoted(&self.path).trim_matches('`'), self.kind);
        if let Some(scene) = &self.scene {
            scene.write(&mut text);
        }
        for sensor in &self.sensors {
            sensor.write(&mut text);
        }
        text
    }
}

/// A line of facts. Writing to a string can't fail.
macro_rules! fact {
    ($text:expr, $name:literal, $($what:tt)*) => {
        let _ = writeln!($text, "    {:<14}{}", $name, format_args!($($what)*));
    };
}

impl SceneFacts {
    fn write(&self, text: &mut String) {
        let _ = writeln!(text, "  scene {}", quoted(&self.path).trim_matches('`'));
        let scene = self;
        let skipped = match scene.skipped_triangles {
            0 => String::new(),
            n => format!(", {} of zero area left out", grouped(n)),
        };
        fact!(text, "triangles", "{}{skipped}", grouped(scene.triangles));
        let [x, y, z] = scene.extent_m.map(|[low, high]| format!("{} to {}", tidy(low), tidy(high)));
        fact!(text, "extent", "x {x}, y {y}, z {z} m");
        let [x, y, z] = scene.centre_m.map(tidy);
        fact!(text, "centre", "({x}, {y}, {z}) m");
        fact!(text, "instances", "{}", grouped(scene.instances as u64));
        fact!(text, "materials", "{}", grouped(scene.materials as u64));
        let labels: Vec<String> = scene.labels.iter().take(32).map(u32::to_string).collect();
        let more = if scene.labels.len() > 32 { ", …" } else { "" };
        fact!(text, "labels", "{}{more}", labels.join(", "));
        fact!(text, "memory", "about {}", bytes(scene.memory_bytes));
    }
}

impl SensorFacts {
    fn write(&self, text: &mut String) {
        let name = self.name.as_deref().map_or(String::new(), |name| format!(" {name}"));
        let _ = writeln!(text, "  {}{name}", self.kind);
        let (rows, columns) = (grouped(self.rows as u64), grouped(self.columns as u64));
        fact!(
            text,
            "image",
            "{rows} rows × {columns} columns, {} rays a frame",
            grouped(self.rays_per_frame as u64)
        );
        let [low, high] = self.elevation_deg.map(tidy);
        fact!(
            text,
            "field of view",
            "{}° × {}°, elevations from {low}° to {high}°",
            tidy(self.horizontal_fov_deg),
            tidy(self.elevation_deg[1] - self.elevation_deg[0])
        );
        if let Some(horizontal) = self.azimuth_step_deg {
            let vertical = match self.elevation_step_deg.map(|step| step.map(tidy)) {
                None => String::new(),
                Some([least, most]) if least == most => format!(" × {least}°"),
                Some([least, most]) => format!(" × {least}° to {most}°"),
            };
            let place = if self.kind == "camera" { " in the middle" } else { "" };
            fact!(text, "steps", "{}°{vertical}{place}", tidy(horizontal));
        }
        if self.blind_pixels > 0 {
            fact!(
                text,
                "no ray for",
                "{} pixels: the model ends before them",
                grouped(self.blind_pixels as u64)
            );
        }
        match self.max_range_m {
            Some(max) => {
                fact!(text, "range", "{} m to {} m", tidy(self.min_range_m), tidy(max));
            }
            None => {
                fact!(text, "range", "{} m, without an upper limit", tidy(self.min_range_m));
            }
        }
        if let (Some(rate), Some(points)) = (self.rate_hz, self.points_per_second) {
            fact!(
                text,
                "rate",
                "{} Hz, at most {} points a second",
                tidy(rate),
                grouped(points.round() as u64)
            );
        }
        if self.frame_s > 0.0 {
            fact!(text, "frame takes", "{} ms", tidy(self.frame_s * 1e3));
        }
        fact!(text, "memory", "{} a frame", bytes(self.frame_bytes));
        let files: Vec<String> = self
            .output_bytes
            .iter()
            .map(|(format, size)| format!("{format} {}", bytes(size.as_u64().unwrap_or(0))))
            .collect();
        fact!(text, "output", "{} a frame, uncompressed", files.join(", "));
    }
}

/// A number to four decimals, without the zeros at the end.
pub(super) fn tidy(x: f64) -> f64 {
    let rounded = (x * 1e4).round() / 1e4;
    if rounded == 0.0 { 0.0 } else { rounded }
}

/// `1234567` as `1,234,567`.
pub(super) fn grouped(n: u64) -> String {
    let digits = n.to_string();
    let mut text = String::new();
    for (index, digit) in digits.chars().enumerate() {
        if index > 0 && (digits.len() - index).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// A number of bytes in decimal units, to three digits.
fn bytes(n: u64) -> String {
    let mut size = n as f64;
    let mut units = ["B", "kB", "MB", "GB", "TB"].into_iter();
    let mut unit = units.next().unwrap_or("B");
    while size >= 999.5 {
        let Some(next) = units.next() else { break };
        (size, unit) = (size / 1e3, next);
    }
    let decimals = if unit == "B" || size >= 99.95 { 0 } else { 1 };
    format!("{size:.decimals$} {unit}")
}

#[cfg(test)]
mod tests;
