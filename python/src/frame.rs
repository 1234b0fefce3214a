//! Frames: their channels, returns, points and boxes as arrays.

use beamcast::glam::DVec3;
use beamcast::output::{
    BOXES, CHANNELS, CloudFrame, CloudTime, Image, NO_RETURN_M, Point, Samples, channel, id_of,
};
use beamcast::run::Item;
use beamcast::truth::{range_jacobians, surface_colors, surface_motions};
use beamcast::{Cause, Frame, SensorFrame, Session};
use numpy::{PyArray1, PyArrayMethods as _};
use pyo3::exceptions::{PyKeyError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::work::on_threads;

/// A frame that was cast. The package's `Frame` documents it.
#[pyclass(frozen, module = "beamcast._native")]
pub struct NativeFrame {
    /// The session that cast it.
    pub session: Session,
    /// The sensor and the number of the frame.
    pub item: Item,
    /// The returns.
    pub frame: Frame,
}

#[pymethods]
impl NativeFrame {
    #[getter]
    fn rows(&self) -> usize {
        self.frame.rows()
    }

    #[getter]
    fn columns(&self) -> usize {
        self.frame.columns()
    }

    #[getter]
    fn sensor(&self) -> &str {
        &self.session.sensor(&self.item).name
    }

    #[getter]
    fn number(&self) -> u64 {
        self.item.frame
    }

    #[getter]
    fn start_s(&self) -> f64 {
        self.session.capture(&self.item).start_s
    }

    #[getter]
    fn return_count(&self) -> usize {
        self.frame.return_count()
    }

    #[getter]
    fn most_returns(&self) -> usize {
        self.frame.most_returns()
    }

    /// The pose of the sensor in the world when the frame started: four rows of a matrix.
    fn world_from_sensor(&self) -> [[f64; 4]; 4] {
        let pose = self.session.capture(&self.item).world_from_sensor(0.0);
        let [x, y, z] = [pose.rotation.x_axis, pose.rotation.y_axis, pose.rotation.z_axis];
        let t = pose.translation;
        [[x.x, y.x, z.x, t.x], [x.y, y.y, z.y, t.y], [x.z, y.z, z.z, t.z], [0.0, 0.0, 0.0, 1.0]]
    }

    /// The names of the channels that the frame has.
    fn channel_names(&self) -> Vec<&'static str> {
        let sensor = &self.session.sensor(&self.item).sensor;
        CHANNELS.iter().filter(|spec| spec.is_of(sensor)).map(|spec| spec.name).collect()
    }

    /// The exact ranges of each pixel's return of this number, row by row; infinite where there is none.
    fn range_m<'py>(&self, py: Python<'py>, number: usize) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let frame = &self.frame;
        let ranges = on_threads(py, 1, |_| -> Vec<f64> {
            let ranges = &frame.returns().range_m;
            let range = |pixel| frame.slot(pixel, number).map_or(NO_RETURN_M, |slot| ranges[slot]);
            (0..frame.pixels()).map(range).collect()
        })?;
        Ok(PyArray1::from_vec(py, ranges))
    }

    /// The derivatives of each pixel's return of this number by the sensor's pose, six a pixel, row by row; NaN where there is none.
    fn range_jacobian<'py>(&self, py: Python<'py>, number: usize) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let derivatives = on_threads(py, 1, |_| -> Vec<f64> {
            let tracer = self.session.frame_tracer(&self.item);
            let of_slots = range_jacobians(tracer.scene(), &self.seen().capture, &self.frame);
            let of = |pixel| self.frame.slot(pixel, number).map_or([f64::NAN; 6], |slot| of_slots[slot]);
            (0..self.frame.pixels()).flat_map(of).collect()
        })?;
        Ok(PyArray1::from_vec(py, derivatives))
    }

    /// A channel of each pixel's return of this number, row by row.
    fn channel<'py>(&self, py: Python<'py>, name: &str, number: usize) -> PyResult<Bound<'py, PyAny>> {
        let sensor = &self.session.sensor(&self.item).sensor;
        let Some(spec) = channel(name).filter(|spec| spec.is_of(sensor)) else {
            let message =
                format!("the frame has no channel {name:?}: it has {}", self.channel_names().join(", "));
            return Err(PyKeyError::new_err(message));
        };
        let samples = on_threads(py, 1, |_| {
            let seen = self.seen();
            let tracer = || self.session.frame_tracer(&self.item);
            let (mut motions, mut colors) = (Vec::new(), Vec::new());
            if spec.is_of_motion() {
                motions = surface_motions(tracer().scene(), &seen.capture, &self.frame);
            }
            if spec.is_of_color() {
                colors = surface_colors(tracer().scene(), &seen.capture, &self.frame);
            }
            let seen = SensorFrame { motions: &motions, colors: &colors, ..seen };
            Image::with_channels(&seen, number, [spec]).channels.pop().map(|channel| channel.samples)
        })?;
        Ok(match samples {
            Some(Samples::F32(values)) => PyArray1::from_vec(py, values).into_any(),
            Some(Samples::U32(values)) => PyArray1::from_vec(py, values).into_any(),
            None => return Err(PyKeyError::new_err(name.to_owned())),
        })
    }

    /// The returns as columns, row by row of the image.
    fn returns<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let columns = on_threads(py, 1, |_| Columns::of(&self.frame))?;
        let found = PyDict::new(py);
        found.set_item("row", PyArray1::from_vec(py, columns.row))?;
        found.set_item("column", PyArray1::from_vec(py, columns.column))?;
        found.set_item("return", PyArray1::from_vec(py, columns.number))?;
        found.set_item("range_m", PyArray1::from_vec(py, columns.range_m))?;
        found.set_item("intensity", PyArray1::from_vec(py, columns.intensity))?;
        let count = columns.normal.len() / 3;
        found.set_item("normal", PyArray1::from_vec(py, columns.normal).reshape([count, 3])?)?;
        found.set_item("instance", PyArray1::from_vec(py, columns.instance))?;
        found.set_item("label", PyArray1::from_vec(py, columns.label))?;
        found.set_item("triangle", PyArray1::from_vec(py, columns.triangle))?;
        found.set_item("cause", PyArray1::from_vec(py, columns.cause))?;
        Ok(found)
    }

    /// The points of the returns, three coordinates each, and their times from the frame's start, row by row of the image.
    fn points<'py>(
        &self,
        py: Python<'py>,
        frame: &str,
        time: &str,
    ) -> PyResult<[Bound<'py, PyArray1<f64>>; 2]> {
        let cloud_frame = match frame {
            "sensor" => CloudFrame::Sensor,
            "body" => CloudFrame::Body,
            "world" => CloudFrame::World,
            other => return Err(unknown("frame", other, &["sensor", "body", "world"])),
        };
        let known = CloudTime::NAMED.iter().find(|(name, _)| *name == time);
        let Some((_, cloud_time)) = known else {
            return Err(unknown("time", time, &CloudTime::NAMED.map(|(name, _)| name)));
        };
        let (points, times) = on_threads(py, 1, |_| {
            let seen = SensorFrame { cloud_frame, cloud_time: *cloud_time, ..self.seen() };
            let mut points: Vec<DVec3> = Vec::with_capacity(self.frame.return_count());
            let mut times = Vec::with_capacity(points.capacity());
            let add = |point: &Point| {
                points.push(point.exact_m);
                times.push(point.time_s);
                Ok(())
            };
            // Nothing is encoded, so nothing fails.
            let _ = seen.each_point(add);
            (points.iter().flat_map(|point| point.to_array()).collect::<Vec<f64>>(), times)
        })?;
        Ok([PyArray1::from_vec(py, points), PyArray1::from_vec(py, times)])
    }

    /// The lines of boxes.jsonl of the frame, without the line's ends.
    fn boxes(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        let truth = on_threads(py, 0, |progress| {
            let truth = self.session.truth(&self.item, &self.frame, progress)?;
            Some(truth.rows.get(BOXES).cloned().unwrap_or_default())
        })?;
        Ok(truth.unwrap_or_default())
    }

    /// The words that the numbers of causes stand for.
    #[staticmethod]
    fn cause_names() -> Vec<&'static str> {
        Cause::ALL.iter().map(|cause| cause.name()).collect()
    }
}

impl NativeFrame {
    fn seen(&self) -> SensorFrame<'_> {
        self.session.sensor_frame(&self.item, &self.frame)
    }
}

fn unknown(what: &str, value: &str, known: &[&str]) -> PyErr {
    PyValueError::new_err(format!("{what} is {value:?}: expected one of {}", known.join(", ")))
}

/// The returns of a frame, column by column.
#[derive(Default)]
struct Columns {
    row: Vec<u32>,
    column: Vec<u32>,
    number: Vec<u32>,
    range_m: Vec<f64>,
    intensity: Vec<f32>,
    normal: Vec<f32>,
    instance: Vec<u32>,
    label: Vec<u32>,
    triangle: Vec<u32>,
    cause: Vec<u32>,
}

impl Columns {
    fn of(frame: &Frame) -> Self {
        let mut all = Self::default();
        for pixel in 0..frame.pixels() {
            for (number, slot) in frame.slots(pixel).enumerate() {
                let one = frame.returns().get(slot);
                all.row.push((pixel / frame.columns()) as u32);
                all.column.push((pixel % frame.columns()) as u32);
                all.number.push(number as u32);
                all.range_m.push(one.range_m);
                all.intensity.push(one.intensity);
                all.normal.extend(one.normal);
                all.instance.push(id_of(one.instance));
                all.label.push(one.label);
                all.triangle.push(id_of(one.triangle));
                all.cause.push(frame.cause(pixel, number).map_or(0, Cause::number));
            }
        }
        all
    }
}
