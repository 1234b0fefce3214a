//! Facts about files: jobs, sensor files and scenes are read, and nothing is cast.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::paths::configs_in;
use super::plan::{format_problems, label_problem};
use super::{loading, memory, session};
use crate::config::{self, Config, Job, SensorFile};
use crate::error::{Error, SceneError};
use crate::output::Format;
use crate::plausibility::{self, Stance};
use crate::scene::{Scene, gltf};
use crate::sensor::Sensor;
use crate::sensor::facts::SensorFacts;
use crate::source::{Diagnostic, FileKind, Place, Severity, Wanted, is_config, recognise};
use crate::trace::Tracer;

/// The facts about a job, a sensor file or a scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FileFacts {
    /// The file as the user named it.
    pub path: String,
    /// `job`, `sensor` or `scene`.
    pub kind: &'static str,
    /// The job's sensors, or the sensor file's one.
    pub sensors: Vec<SensorSizes>,
    /// The sequence, if the file is a job that has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sequence: Option<SequenceFacts>,
    /// The scene, if the file is one or names one.
    pub scene: Option<SceneFacts>,
}

/// The facts about a sensor, and the sizes of its frames.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SensorSizes {
    /// The sensor's name in the job.
    pub name: Option<String>,
    /// The facts that follow from the pattern.
    #[serde(flatten)]
    pub facts: SensorFacts,
    /// How far and how precisely it measures, if it has a receiver with range pairs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub measurement: Option<MeasurementFacts>,
    /// How a depth camera finds depth, if it is not ideal.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub depth: Option<DepthFacts>,
    /// Where the sensor of a job stands and looks at first.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub stance: Option<Stance>,
    /// The memory that a frame takes while it is made.
    pub frame_bytes: u64,
    /// The size of a frame's file before compression, by format: an upper limit. Formats that the frames do not fit are left out.
    pub output_bytes: serde_json::Map<String, serde_json::Value>,
}

impl SensorSizes {
    /// Works the facts out, and the sizes of files in `formats`.
    pub fn of(name: Option<&str>, sensor: &Sensor, formats: &[Format]) -> Self {
        let facts = SensorFacts::of(sensor);
        let rays = facts.rays_per_frame as u64;
        let size = |format: &Format| {
            let bytes = format.file_bytes_a_ray(sensor).saturating_mul(rays);
            (format.name().to_owned(), bytes.into())
        };
        Self {
            name: name.map(str::to_owned),
            stance: None,
            measurement: MeasurementFacts::of(&sensor.measurement, sensor.range, rays, false),
            depth: DepthFacts::of(sensor, false),
            frame_bytes: memory::frame_bytes_a_pixel(sensor).saturating_mul(rays),
            output_bytes: formats.iter().filter(|format| format.check(sensor).is_ok()).map(size).collect(),
            facts,
        }
    }

    /// The facts about the sensor of a file, and the sizes of files in `formats`. Of a sensor that is ideal as its file stands, the
    /// figures of its data sheet are among them.
    pub fn of_file(file: &SensorFile, formats: &[Format]) -> Self {
        let sizes = Self::of(None, &file.sensor, formats);
        let rays = sizes.facts.rays_per_frame as u64;
        let nominal = file.nominal.as_ref();
        let of_nominal = || MeasurementFacts::of(&nominal?.measurement, file.sensor.range, rays, true);
        let depth_of_nominal = || {
            let measurement = nominal?.measurement.clone();
            DepthFacts::of(&Sensor { measurement, ..file.sensor.clone() }, true)
        };
        Self {
            measurement: sizes.measurement.clone().or_else(of_nominal),
            depth: sizes.depth.clone().or_else(depth_of_nominal),
            ..sizes
        }
    }

    /// The facts about a sensor of a job.
    fn of_job(job: &Job, index: usize) -> Self {
        let mounted = &job.sensors[index];
        let mut sizes = Self::of(Some(&mounted.name), &mounted.sensor, &job.output.formats);
        sizes.stance = Some(Stance::of(job, index));
        if let Some(measurement) = &mut sizes.measurement {
            measurement.is_nominal = mounted.is_nominal;
        }
        if let Some(depth) = &mut sizes.depth {
            depth.is_nominal = mounted.is_nominal;
        }
        sizes
    }
}

/// Everything that was found in files.
#[derive(Debug, Default)]
pub struct Examined {
    /// The facts about the good ones.
    pub facts: Vec<FileFacts>,
    /// The problems of all of them.
    pub problems: Vec<Diagnostic>,
    /// Whether a job or a sensor file is wrong. Otherwise all errors are about scenes, or about files that are neither.
    is_config_wrong: bool,
}

impl Examined {
    /// Adds what is wrong with a job or a sensor file.
    fn add_error(&mut self, path: &Path, error: Error) {
        self.is_config_wrong = true;
        match error {
            Error::Config(found) => self.problems.extend(found),
            other => self.problems.push(Diagnostic::about_file(path, other.to_string(), None)),
        }
    }

    /// The facts and the problems, if nothing is wrong.
    ///
    /// # Errors
    /// [`Error::Config`] if a job or a sensor file is wrong, else [`Error::Inputs`] if another file is; both with all problems.
    pub fn into_result(self) -> Result<(Vec<FileFacts>, Vec<Diagnostic>), Error> {
        let is_wrong = self.problems.iter().any(|problem| problem.severity == Severity::Error);
        match (is_wrong, self.is_config_wrong) {
            (false, _) => Ok((self.facts, self.problems)),
            (true, true) => Err(Error::Config(self.problems)),
            (true, false) => Err(Error::Inputs(self.problems)),
        }
    }
}

/// Reads every path: jobs, sensor files, scenes (whose files may lie in the allowed folders too), and folders of jobs and
/// sensor files. Returns the facts about the good
/// ones, and everything that is wrong with the others.
pub fn examine(paths: &[PathBuf], allowed_folders: &[PathBuf]) -> Examined {
    let mut examined = Examined::default();
    for path in paths {
        let files = if path.is_dir() { configs_in(path) } else { vec![path.clone()] };
        if files.is_empty() {
            let help = "name a folder that has some, or a file";
            let problem =
                Diagnostic::about_file(path, "the folder has no *.toml files".into(), Some(help.into()));
            examined.problems.push(problem);
            examined.is_config_wrong = true;
        }
        for file in &files {
            examine_file(file, allowed_folders, &mut examined);
        }
    }
    examined
}

/// Reads one job, sensor file or scene. Returns its facts and its warnings.
///
/// # Errors
/// [`Error::Config`] if a job or a sensor file is wrong, [`Error::Inputs`] if a scene or another file is.
pub fn facts_of(path: &Path, allowed_folders: &[PathBuf]) -> Result<(FileFacts, Vec<Diagnostic>), Error> {
    let mut examined = Examined::default();
    examine_file(path, allowed_folders, &mut examined);
    let (mut facts, problems) = examined.into_result()?;
    match facts.pop() {
        Some(facts) => Ok((facts, problems)),
        None => Err(Error::Config(problems)),
    }
}

fn examine_file(path: &Path, allowed_folders: &[PathBuf], examined: &mut Examined) {
    let open = |path: &Path, as_written: &str, job: Option<&Job>, problems: &mut Vec<Diagnostic>| {
        open_scene(path, as_written, job, allowed_folders, problems)
    };
    let name = path.to_string_lossy();
    if !is_config(path)
        && let Ok(kind) = recognise(path)
        && kind != FileKind::Text
    {
        if !kind.is_scene() {
            let (message, help) = kind.instead_of(Wanted::Linted);
            examined.problems.push(Diagnostic::about_file(path, message, help));
            return;
        }
        match open(path, &name, None, &mut examined.problems) {
            Ok(scene) => {
                let facts = FileFacts::of_scene(&name, &scene);
                let place = Place { path: path.to_path_buf(), ..Place::default() };
                examined.problems.extend(plausibility::of_scene(scene.extent(), &place));
                examined.facts.push(facts);
            }
            Err(Error::Scene(error)) => examined.problems.push(about_scene(error)),
            Err(other) => examined.add_error(path, other),
        }
        return;
    }
    match config::load(path, &[]) {
        Ok(Config::Sensor(file)) => {
            let sensors = vec![SensorSizes::of_file(&file, &Format::all().collect::<Vec<_>>())];
            examined.problems.extend(file.warnings);
            examined.facts.push(FileFacts {
                path: name.into_owned(),
                kind: "sensor",
                sensors,
                sequence: None,
                scene: None,
            });
        }
        Ok(Config::Job(job)) => {
            let mut problems = format_problems(&job);
            match open(&job.scene_path, &job.scene_as_written, Some(&job), &mut examined.problems) {
                Ok(scene) => {
                    let sizes = |index: usize| SensorSizes::of_job(&job, index);
                    let sensors: Vec<SensorSizes> = (0..job.sensors.len()).map(sizes).collect();
                    let sequence = SequenceFacts::of(&job, &sensors);
                    examined.problems.extend(doubts(&job, &scene));
                    problems.extend(label_problem(job.output.formats.iter().copied(), &scene));
                    let scene = Some(SceneFacts::of(&job.scene_as_written, &scene, &job.labels));
                    examined.facts.push(FileFacts {
                        path: name.into_owned(),
                        kind: "job",
                        sensors,
                        sequence,
                        scene,
                    });
                }
                Err(Error::Scene(error)) => {
                    let mut problem = about_scene(error);
                    problem.message = format!("the scene of {name}: {}", problem.message);
                    examined.problems.push(problem);
                }
                Err(other) => examined.add_error(path, other),
            }
            examined.is_config_wrong |= !problems.is_empty();
            examined
                .problems
                .extend(problems.into_iter().map(|text| Diagnostic::about_file(path, text, None)));
            examined.problems.extend(job.warnings);
        }
        Err(error) => examined.add_error(path, error),
    }
}

/// Warnings about a job in its scene. Where no tracer of the scene would fit into memory, there are none.
fn doubts(job: &Job, scene: &Scene) -> Vec<Diagnostic> {
    match memory::check("the scene", memory::of_scene(scene)) {
        Ok(()) => plausibility::of_job(job, scene, &Tracer::build(scene)),
        Err(_) => Vec::new(),
    }
}

/// Opens a scene as a run would: with the job's settings, or without a job as the file has it.
fn open_scene(
    path: &Path,
    as_written: &str,
    job: Option<&Job>,
    allowed_folders: &[PathBuf],
    diagnostics: &mut Vec<Diagnostic>,
) -> Result<Scene, Error> {
    let loaded = match job {
        Some(job) => session::load_scene(&mut job.clone(), allowed_folders)?,
        None => {
            let options = gltf::Options { allowed_folders, ..gltf::Options::default() };
            loading::open_scene(path, as_written, &options)?
        }
    };
    diagnostics.extend(loaded.diagnostics(path));
    Ok(loaded.scene)
}

fn about_scene(error: SceneError) -> Diagnostic {
    let message = if error.element.is_empty() {
        error.problem
    } else {
        format!("{}: {}", error.element, error.problem)
    };
    Diagnostic::about_file(&error.path, message, error.help)
}

impl FileFacts {
    fn of_scene(path: &str, scene: &Scene) -> Self {
        let scene = Some(SceneFacts::of(path, scene, &BTreeMap::new()));
        Self { path: path.to_owned(), kind: "scene", sensors: vec![], sequence: None, scene }
    }
}

/// The facts about a scene.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SceneFacts {
    /// The scene's file, as the user or the job named it.
    pub path: String,
    /// Triangles, each counted as often as it is placed.
    pub triangles: u64,
    /// Triangles that are stored.
    pub stored_triangles: u64,
    /// Triangles of the file that no beam can hit, because they have no area.
    pub skipped_triangles: u64,
    /// Objects that meshes are placed as.
    pub instances: usize,
    /// Materials.
    pub materials: usize,
    /// The materials whose alpha may let light pass.
    pub alpha: Vec<AlphaFacts>,
    /// The images that textures of surfaces show.
    pub images: Vec<ImageFacts>,
    /// Every semantic label that a surface has, in ascending order.
    pub labels: Vec<u32>,
    /// What labels stand for, in words: the job's names for them, else the names of the objects that have them.
    pub label_names: BTreeMap<u32, String>,
    /// The least and the largest x, y and z in the world. Of a mesh that is placed more than once, the corners of its box
    /// count.
    pub extent_m: [[f64; 2]; 3],
    /// The middle of the extent.
    pub centre_m: [f64; 3],
    /// The most by which a vertex is off along an axis because it is stored with 32 bits, in metres.
    pub rounding_m: f64,
    /// The regions with centres of their own that the scene is stored in: 1, unless it is too large for that.
    pub regions: u32,
    /// An estimate of the memory that the scene and its tracer take.
    pub memory_bytes: u64,
}

impl SceneFacts {
    /// The facts about a scene, whose labels a job has `given` names.
    fn of(path: &str, scene: &Scene, given: &BTreeMap<String, u32>) -> Self {
        let extent_m = scene.extent();
        Self {
            path: path.to_owned(),
            triangles: scene.triangle_count(),
            stored_triangles: scene.geometry.stored_triangle_count(),
            skipped_triangles: scene.geometry.skipped_triangles,
            instances: scene.geometry.objects.len(),
            materials: scene.geometry.materials.len(),
            alpha: AlphaFacts::all(&scene.geometry),
            images: ImageFacts::all(&scene.geometry),
            labels: scene.labels(),
            label_names: scene.geometry.label_names(given),
            extent_m,
            centre_m: extent_m.map(|[low, high]| (low + high) / 2.0),
            rounding_m: scene.geometry.rounding.stored_m,
            regions: scene.geometry.regions,
            memory_bytes: memory::of_scene(scene),
        }
    }
}

mod appearance;
mod depth;
mod measurement;
mod sequence;
#[cfg(test)]
mod tests;

pub use appearance::{AlphaFacts, ImageFacts};
pub use depth::DepthFacts;
pub use measurement::{BeamsFacts, MeasurementFacts, RangeShift, RangeSigma, SpadFacts};
pub use sequence::{SequenceFacts, WayFacts};
