//! Jobs: their sensors, and their frames one by one.

use std::path::PathBuf;

use beamcast::run::{Holding, Item, Plan, Selection};
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
