//! Cameras of parallel rays: an orthographic view, whose pixels have the same size at every distance.

use glam::{DVec2, DVec3};

use super::{Pulse, Shutter};

/// A camera whose rays all go straight ahead, from a rectangle about the sensor's origin that is at a right angle to them. The
/// centre of the pixel in column u and row v of an image of W by H pixels that is w metres wide and h high is at
/// y = w/2 − (u + ½)·w/W and z = h/2 − (v + ½)·h/H of the body frame. Its depth along the optical axis is its range.
#[derive(Clone, Debug, PartialEq)]
pub struct Orthographic {
    width: usize,
    height: usize,
    /// Width and height of the image in metres.
    size_m: DVec2,
    shutter: Shutter,
    rate_hz: Option<f64>,
}

/// The reason why a camera of parallel rays is impossible.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum OrthographicError {
    /// The image has no pixels.
    #[error("a camera needs at least one pixel each way")]
    NoPixels,
    /// A side of the image is not a positive number of metres.
    #[error("the sides of the image must be positive")]
    Size,
    /// The rate is not a positive number.
    #[error("the rate must be positive")]
    Rate,
}

impl Orthographic {
    /// A camera with an image of (columns, rows) pixels that is `size_m` metres (wide, high).
    ///
    /// # Errors
    /// An [`OrthographicError`] that names the first wrong argument.
    pub fn new(
        (width, height): (usize, usize),
        size_m: (f64, f64),
        rate_hz: Option<f64>,
    ) -> Result<Self, OrthographicError> {
        let is_positive = |x: f64| x.is_finite() && x > 0.0;
        if width == 0 || height == 0 {
            return Err(OrthographicError::NoPixels);
        }
        if !(is_positive(size_m.0) && is_positive(size_m.1)) {
            return Err(OrthographicError::Size);
        }
        if rate_hz.is_some_and(|rate| !is_positive(rate)) {
            return Err(OrthographicError::Rate);
        }
        Ok(Self { width, height, size_m: size_m.into(), shutter: Shutter::GLOBAL, rate_hz })
    }

    /// The same camera with another shutter. A camera has a global one unless it is told otherwise.
    #[must_use]
    pub fn with_shutter(self, shutter: Shutter) -> Self {
        Self { shutter, ..self }
    }

    /// The number of columns of the image.
    pub fn width(&self) -> usize {
        self.width
    }

    /// The number of rows of the image.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Width and height of the image in metres.
    pub fn size_m(&self) -> (f64, f64) {
        self.size_m.into()
    }

    /// Width and height of a pixel in metres.
    pub fn pixel_m(&self) -> (f64, f64) {
        (self.size_m.x / self.width as f64, self.size_m.y / self.height as f64)
    }

    /// Frames a second, if given.
    pub fn rate_hz(&self) -> Option<f64> {
        self.rate_hz
    }

    /// The shutter.
    pub fn shutter(&self) -> &Shutter {
        &self.shutter
    }

    /// The pulse of a pixel.
    #[inline]
    pub(super) fn pulse(&self, row: usize, column: usize) -> Pulse {
        let (across, down) = self.pixel_m();
        let y = 0.5 * self.size_m.x - (column as f64 + 0.5) * across;
        let z = 0.5 * self.size_m.y - (row as f64 + 0.5) * down;
        Pulse::new(DVec3::new(0.0, y, z), DVec3::X, self.shutter.time_s(row, self.height))
    }

    /// The image point of a point in the optical frame (x right, y down, z forward), in pixels from the image's top left corner.
    /// It may lie outside of the image. `None` if the point is not in front of the camera.
    pub fn project(&self, optical: DVec3) -> Option<(f64, f64)> {
        let (across, down) = self.pixel_m();
        let place = || ((0.5 * self.size_m.x + optical.x) / across, (0.5 * self.size_m.y + optical.y) / down);
        (optical.z > 0.0).then(place)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::BODY_FROM_OPTICAL;

    #[test]
    fn pixels_lie_side_by_side_and_project_to_their_centres() {
        // 4 m by 1.5 m on 8 by 6 pixels: half a metre wide and a quarter of a metre high, all of them binary fractions.
        let camera = Orthographic::new((8, 6), (4.0, 1.5), None).unwrap();
        assert_eq!(camera.pixel_m(), (0.5, 0.25));
        let top_left = camera.pulse(0, 0);
        assert_eq!((top_left.origin, top_left.direction), (DVec3::new(0.0, 1.75, 0.625), DVec3::X));
        assert_eq!(camera.pulse(5, 7).origin, DVec3::new(0.0, -1.75, -0.625));
        let optical = BODY_FROM_OPTICAL.inverse().point(camera.pulse(4, 1).point(9.0));
        assert_eq!((optical.z, camera.project(optical)), (9.0, Some((1.5, 4.5))));
        assert_eq!(camera.project(-optical), None);
    }

    #[test]
    fn impossible_parameters_are_refused() {
        let new = Orthographic::new;
        assert_eq!(new((0, 2), (1.0, 1.0), None), Err(OrthographicError::NoPixels));
        assert_eq!(new((2, 2), (1.0, f64::NAN), None), Err(OrthographicError::Size));
        assert_eq!(new((2, 2), (0.0, 1.0), None), Err(OrthographicError::Size));
        assert_eq!(new((2, 2), (1.0, 1.0), Some(0.0)), Err(OrthographicError::Rate));
    }
}
