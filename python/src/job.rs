//! Jobs: their sensors, and their frames one by one.

use std::path::PathBuf;

use beamcast::cli::part::{self, Part};
use beamcast::run::{Holding, Item, Plan, Selection, Shard};
use beamcast::source::{Diagnostic, Severity};
use beamcast::{Error, Frame, Progress, Session, load_job, run};
use pyo3::exceptions::PyIndexError;
use pyo3::prelude::*;
use pyo3::types::PyList;

use crate::errors::{dictionaries, exception};
use crate::frame::NativeFrame;
use crate::sensor::NativeSensor;
use crate::threads_of;
use crate::work::on_threads;

/// A job with its scene. The package's `Job` documents it.
#[pyclass(frozen, module = "beamcast._native")]
pub struct NativeJob {
    session: Session,
    allowed_folders: Vec<PathBuf>,
    warnings: Vec<Diagnostic>,
}

#[pymethods]
impl NativeJob {
    #[new]
    fn new(
        py: Python<'_>,
        path: PathBuf,
        overrides: Vec<String>,
        allowed_folders: Vec<PathBuf>,
        threads: Option<i64>,
    ) -> PyResult<Self> {
        let open = |_: &Progress| -> Result<Self, Error> {
            let mut job = load_job(&path, &overrides)?;
            // Nothing is written, so what does not fit a format does not matter.
            let mut unwritten = job.clone();
            unwritten.output.formats.clear();
            let plan = Plan::of(&unwritten, &Selection::ALL, Holding::Frame)?;
            let loaded = run::load_scene(&mut job, &allowed_folders)?;
            plan.check_scene(&loaded.scene)?;
            let mut warnings = job.warnings.clone();
            warnings.extend(loaded.diagnostics(&job.scene_path));
            let session = Session::open(job, &loaded.scene);
            warnings.extend(session.doubts());
            warnings.retain(|warning| warning.severity != Severity::Note);
            Ok(Self { session, allowed_folders: allowed_folders.clone(), warnings })
        };
        on_threads(py, threads_of(threads)?, open)?.map_err(|error| exception(py, &error))
    }

    /// The sensors of the rig, in the job's order.
    fn sensors(&self) -> Vec<NativeSensor> {
        let sensors = &self.session.job.sensors;
        sensors.iter().map(|mounted| NativeSensor::of(&mounted.name, &mounted.sensor)).collect()
    }

    /// The number of frames of a sensor.
    fn frames_of(&self, sensor: usize) -> PyResult<u64> {
        let mounted = self.session.job.sensors.get(sensor);
        let mounted = mounted.ok_or_else(|| PyIndexError::new_err(format!("there is no sensor {sensor}")))?;
        Ok(self.session.job.sequence.frames_of(&mounted.sensor))
    }

    /// The time at which a frame of a sensor starts, in seconds.
    fn start_s(&self, sensor: usize, frame: u64) -> PyResult<f64> {
        self.item(sensor, frame).map(|item| self.session.capture(&item).start_s)
    }

    /// Casts a frame of a sensor.
    fn cast(&self, py: Python<'_>, sensor: usize, frame: u64, threads: Option<i64>) -> PyResult<NativeFrame> {
        let item = self.item(sensor, frame)?;
        let cast = |progress: &Progress| -> Result<Option<(Session, Frame)>, Error> {
            let session = self.session.of_frame(item.frame, &self.allowed_folders)?.into_owned();
            Ok(session.cast(&item, progress).map(|frame| (session, frame)))
        };
        let cast = on_threads(py, threads_of(threads)?, cast)?.map_err(|error| exception(py, &error))?;
        // Without a signal nothing cancels it.
        let (session, frame) = cast.ok_or_else(|| pyo3::exceptions::PyKeyboardInterrupt::new_err(()))?;
        Ok(NativeFrame { session, item, frame })
    }

    /// The folder that the job's outputs go to, relative to the process's own if the job's path was.
    fn output_dir(&self) -> PathBuf {
        self.session.job.output.dir.clone()
    }

    /// The name and the BLAKE3 hash of each file that was read: the job, what it names, and the scene.
    fn inputs(&self) -> Vec<(String, String)> {
        let of_job = self.session.job.inputs.iter().map(|file| (file.name.clone(), file.blake3.clone()));
        let of_scene = self.session.scene().geometry.files.iter();
        of_job.chain(of_scene.map(|file| (file.name.clone(), file.blake3.clone()))).collect()
    }

    /// Checks that part of a run can be written to the folder, and gives its number of frames.
    fn check_part(
        &self,
        py: Python<'_>,
        out: PathBuf,
        frames: (u64, u64),
        shard: (u64, u64),
    ) -> PyResult<u64> {
        let check = || Part::of(&self.session, &selection(frames, shard), &out, &self.allowed_folders);
        py.detach(|| check().map(|part| part.frames())).map_err(|error| exception(py, &error))
    }

    /// Writes part of a run, or goes on with it. Gives its frames, those of them that were finished earlier, and the files and bytes of
    /// the others. It works on the threads of [`start_threads`], and ends by no signal: the process can be killed.
    fn write_part(
        &self,
        py: Python<'_>,
        out: PathBuf,
        frames: (u64, u64),
        shard: (u64, u64),
    ) -> PyResult<(u64, u64, u64, u64)> {
        let write =
            || Part::of(&self.session, &selection(frames, shard), &out, &self.allowed_folders)?.write();
        let written = py.detach(write).map_err(|error| exception(py, &error))?;
        Ok((written.frames, written.earlier, written.files, written.bytes))
    }

    /// The warnings about the job and its scene.
    fn warnings<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyList>> {
        dictionaries(py, &self.warnings)
    }

    /// The job with its sensors' files merged in, as JSON.
    fn resolved(&self) -> String {
        self.session.job.resolved.to_string()
    }

    /// The names of labels.
    fn label_names(&self) -> std::collections::BTreeMap<u32, String> {
        self.session.label_names()
    }

    /// The names of the scene's objects, in the order of their ids, which count from 1.
    fn object_names(&self) -> Vec<String> {
        self.session.scene().geometry.objects.iter().map(|object| object.name.clone()).collect()
    }
}

/// Starts the threads on which the process writes parts of runs. It can do so once.
#[pyfunction]
pub fn start_threads(py: Python<'_>, threads: u16) -> PyResult<()> {
    part::start_threads(threads).map_err(|error| exception(py, &error))
}

/// The frames from the first up to and without the end, and the part of this index of so many.
fn selection((first, end): (u64, u64), (index, count): (u64, u64)) -> Selection {
    Selection { frames: first..end, shard: Shard { index, count } }
}

impl NativeJob {
    fn item(&self, sensor: usize, frame: u64) -> PyResult<Item> {
        let count = self.frames_of(sensor)?;
        if frame >= count {
            let message = format!("there is no frame {frame}: the sensor has {count}, counted from 0");
            return Err(PyIndexError::new_err(message));
        }
        Ok(Item { sensor, frame, outputs: Vec::new() })
    }
}
