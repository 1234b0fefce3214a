//! Sensors: their patterns as arrays.

use std::path::PathBuf;
use std::sync::Arc;

use beamcast::config::{self, presets};
use beamcast::sensor::{Limited, Pulse};
use beamcast::{Capture, Sensor};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::errors::exception;
use crate::threads_of;
use crate::work::on_threads;

/// A sensor. The package's `Sensor` documents it.
#[pyclass(frozen, module = "beamcast._native")]
pub struct NativeSensor {
    /// The name: of a preset, of a file, or in a job.
    #[pyo3(get)]
    name: String,
    sensor: Arc<Sensor>,
}

impl NativeSensor {
    /// A sensor of a job.
    pub fn of(name: &str, sensor: &Sensor) -> Self {
        Self { name: name.to_owned(), sensor: Arc::new(sensor.clone()) }
    }
}

#[pymethods]
impl NativeSensor {
    #[staticmethod]
    fn preset(py: Python<'_>, name: &str) -> PyResult<Self> {
        let file = config::load_preset(name).map_err(|error| exception(py, &error))?;
        Ok(Self { name: name.to_owned(), sensor: Arc::new(file.sensor) })
    }

    #[staticmethod]
    fn of_file(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let file = config::load_sensor(&path).map_err(|error| exception(py, &error))?;
        let name = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
        Ok(Self { name, sensor: Arc::new(file.sensor) })
    }

    #[getter]
    fn rows(&self) -> usize {
        self.sensor.pattern.rows()
    }

    #[getter]
    fn columns(&self) -> usize {
        self.sensor.pattern.columns()
    }

    #[getter]
    fn is_camera(&self) -> bool {
        self.sensor.pattern.is_camera()
    }

    #[getter]
    fn pattern(&self) -> &'static str {
        self.sensor.pattern.name()
    }

    #[getter]
    fn rate_hz(&self) -> Option<f64> {
        self.sensor.pattern.rate_hz()
    }

    /// The least and the largest range or depth in metres, and which of the two it is.
    #[getter]
    fn limits(&self) -> (f64, f64, &'static str) {
        let range = &self.sensor.range;
        (range.min_m, range.max_m, if range.of == Limited::Range { "range" } else { "depth" })
    }

    #[getter]
    fn most_returns(&self) -> usize {
        self.sensor.most_returns()
    }

    /// The pulses of a frame: directions and origins (three numbers each) and times, row by row. NaN where a pixel has none.
    fn pulses<'py>(&self, py: Python<'py>, frame: u64, threads: Option<i64>) -> PyResult<Bound<'py, PyDict>> {
        let sensor = &*self.sensor;
        let (directions, origins, times) = on_threads(py, threads_of(threads)?, |_| {
            let capture = Capture::at_origin(sensor).with_frame(frame);
            capture.prepare();
            let (rows, columns) = (capture.rows(), capture.columns());
            let (mut directions, mut origins) = (Vec::new(), Vec::new());
            let mut times = Vec::with_capacity(rows * columns);
            directions.reserve_exact(3 * rows * columns);
            origins.reserve_exact(3 * rows * columns);
            for row in 0..rows {
                for column in 0..columns {
                    let pulse = capture.pulse(row, column);
                    let of = |value: fn(&Pulse) -> [f64; 3]| pulse.as_ref().map_or([f64::NAN; 3], value);
                    directions.extend(of(|pulse| pulse.direction.to_array()));
                    origins.extend(of(|pulse| pulse.origin.to_array()));
                    times.push(pulse.as_ref().map_or(f64::NAN, |pulse| pulse.time_s));
                }
            }
            (directions, origins, times)
        })?;
        let found = PyDict::new(py);
        found.set_item("directions", PyArray1::from_vec(py, directions))?;
        found.set_item("origins", PyArray1::from_vec(py, origins))?;
        found.set_item("times_s", PyArray1::from_vec(py, times))?;
        Ok(found)
    }
}

/// The names of the built-in sensors.
#[pyfunction]
pub fn preset_names() -> Vec<&'static str> {
    presets::BUILT_IN.iter().map(|(name, _)| *name).collect()
}
