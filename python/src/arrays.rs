//! Arrays of NumPy as rays.

use std::ops::Range;

use beamcast::glam::DVec3;
use numpy::{Element, PyArrayMethods as _, PyReadonlyArray2, PyUntypedArrayMethods as _};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

/// A number of an array of rays.
pub trait Number: Element + Copy + Send + Sync {
    /// The same number in 64 bits.
    fn wide(self) -> f64;
}

impl Number for f32 {
    #[inline(always)]
    fn wide(self) -> f64 {
        self.into()
    }
}

impl Number for f64 {
    #[inline(always)]
    fn wide(self) -> f64 {
        self
    }
}

/// An argument with rays: an array (n, 6), or origins (n, 3) or (1, 3) and directions (n, 3), of 32 or 64 bits.
pub enum RayArgument<'py> {
    /// Of 32 bits.
    F32(PyReadonlyArray2<'py, f32>, Option<PyReadonlyArray2<'py, f32>>),
    /// Of 64 bits.
    F64(PyReadonlyArray2<'py, f64>, Option<PyReadonlyArray2<'py, f64>>),
}

impl<'py> RayArgument<'py> {
    /// The arrays, which must be of the same type, contiguous and aligned.
    pub fn of(rays: &Bound<'py, PyAny>, directions: Option<&Bound<'py, PyAny>>) -> PyResult<Self> {
        if let Ok(first) = rays.extract::<PyReadonlyArray2<'py, f32>>() {
            return Ok(Self::F32(
                first,
                directions.map(|d| d.extract()).transpose().map_err(|_| wrong_type())?,
            ));
        }
        let first = rays.extract::<PyReadonlyArray2<'py, f64>>().map_err(|_| wrong_type())?;
        Ok(Self::F64(first, directions.map(|d| d.extract()).transpose().map_err(|_| wrong_type())?))
    }
}

fn wrong_type() -> PyErr {
    PyTypeError::new_err("expected arrays of rays of one type, float32 or float64, with two dimensions")
}

/// Rays in memory that Python owns.
#[derive(Clone, Copy)]
pub enum RayArrays<'a, T> {
    /// An origin and a direction each.
    Together(&'a [[T; 6]]),
    /// Directions, and as many origins, or one for all.
    Apart {
        /// The origins.
        origins: &'a [[T; 3]],
        /// The directions.
        directions: &'a [[T; 3]],
    },
}

impl<'a, T: Number> RayArrays<'a, T> {
    /// The rays of an array (n, 6), or of origins (n, 3) or (1, 3) and directions (n, 3).
    pub fn of(
        first: &'a PyReadonlyArray2<'_, T>,
        second: Option<&'a PyReadonlyArray2<'_, T>>,
    ) -> PyResult<Self> {
        let Some(second) = second else { return Ok(Self::Together(rows(first)?)) };
        let (origins, directions) = (rows(first)?, rows(second)?);
        if origins.len() != directions.len() && origins.len() != 1 {
            let message =
                format!("{} origins and {} directions are no rays", origins.len(), directions.len());
            return Err(PyValueError::new_err(message));
        }
        Ok(Self::Apart { origins, directions })
    }

    /// The number of rays.
    pub fn count(&self) -> usize {
        match self {
            Self::Together(rays) => rays.len(),
            Self::Apart { directions, .. } => directions.len(),
        }
    }

    /// Appends the origins and the directions of some rays.
    #[inline(always)]
    pub fn append(&self, rays: Range<usize>, origins: &mut Vec<DVec3>, directions: &mut Vec<DVec3>) {
        let three = |from: &[T; 3]| DVec3::from_array(from.map(T::wide));
        match self {
            Self::Together(all) => {
                let all = &all[rays];
                origins.extend(all.iter().map(|&[x, y, z, ..]| three(&[x, y, z])));
                directions.extend(all.iter().map(|&[.., x, y, z]| three(&[x, y, z])));
            }
            Self::Apart { origins: [one], directions: all } => {
                let all = &all[rays];
                origins.resize(origins.len() + all.len(), three(one));
                directions.extend(all.iter().map(three));
            }
            Self::Apart { origins: places, directions: all } => {
                origins.extend(places[rays.clone()].iter().map(three));
                directions.extend(all[rays].iter().map(three));
            }
        }
    }
}

/// The rows of an array (n, N).
pub fn rows<'a, T: Element, const N: usize>(array: &'a PyReadonlyArray2<'_, T>) -> PyResult<&'a [[T; N]]> {
    if array.shape()[1] != N {
        let message = format!("expected the shape (n, {N}), not {:?}", array.shape());
        return Err(PyValueError::new_err(message));
    }
    // NumPy allows an array to begin anywhere; a slice may not.
    if !(array.data() as usize).is_multiple_of(align_of::<T>()) {
        return Err(PyValueError::new_err("the array is not aligned"));
    }
    let elements = array.as_slice().map_err(|_| PyValueError::new_err("the array is not contiguous"))?;
    Ok(elements.as_chunks::<N>().0)
}
