//! Depth cameras: the directions of their pixels.

use std::sync::{Arc, OnceLock};

use glam::{DVec2, DVec3};
use rayon::prelude::*;

use super::{Lens, Pulse, Shutter};
use crate::angle::Angle;
use crate::frame::{BODY_FROM_OPTICAL, Pose};

/// A camera with an ideal or a distorting lens. Pixel (0, 0) is at the top left, and its centre lies at (0.5, 0.5).
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    width: usize,
    height: usize,
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    lens: Lens,
    shutter: Shutter,
    rate_hz: Option<f64>,
    inverse: InverseLens,
    registered: Option<Box<Registered>>,
}

/// The colour camera of a depth camera, to whose image depth can be registered. It casts no rays.
#[derive(Clone, Debug, PartialEq)]
pub struct Registered {
    /// The image and the lens of the colour camera.
    pub camera: Camera,
    /// The pose of the colour camera's body frame (x forward, y left, z up) in the depth camera's.
    pub depth_from_colour: Pose,
}

/// The optical direction of each pixel, row by row, once it was computed. A pixel without a ray has NaN. Clones of a camera
/// share the directions. They follow from the camera's other fields, so comparisons ignore them.
#[derive(Clone, Debug, Default)]
struct InverseLens(Arc<OnceLock<Box<[DVec3]>>>);

impl PartialEq for InverseLens {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// The reason why a camera is impossible.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CameraError {
    /// The image has no pixels.
    #[error("a camera needs at least one pixel each way")]
    NoPixels,
    /// A focal length is not a positive number.
    #[error("focal lengths must be positive")]
    FocalLength,
    /// The principal point is not finite.
    #[error("the principal point must be finite")]
    PrincipalPoint,
    /// The field of view is not between 0 and 180 degrees.
    #[error("a pinhole's field of view must lie between 0 and 180 degrees")]
    FieldOfView,
    /// The rate is not a positive number.
    #[error("the rate must be positive")]
    Rate,
}

impl Camera {
    /// A camera from its intrinsics, all in pixels: size (columns, rows), focal lengths (`fx`, `fy`) and principal point
    /// (`cx`, `cy`).
    ///
    /// # Errors
    /// A [`CameraError`] that names the first wrong argument.
    pub fn new(
        (width, height): (usize, usize),
        (fx, fy): (f64, f64),
        (cx, cy): (f64, f64),
        rate_hz: Option<f64>,
    ) -> Result<Self, CameraError> {
        if width == 0 || height == 0 {
            return Err(CameraError::NoPixels);
        }
        if !(fx.is_finite() && fy.is_finite() && fx > 0.0 && fy > 0.0) {
            return Err(CameraError::FocalLength);
        }
        if !(cx.is_finite() && cy.is_finite()) {
            return Err(CameraError::PrincipalPoint);
        }
        if rate_hz.is_some_and(|r| !(r.is_finite() && r > 0.0)) {
            return Err(CameraError::Rate);
        }
        Ok(Self {
            width,
            height,
            fx,
            fy,
            cx,
            cy,
            lens: Lens::Ideal,
            shutter: Shutter::GLOBAL,
            rate_hz,
            inverse: InverseLens::default(),
            registered: None,
        })
    }

    /// The same camera with another lens.
    #[must_use]
    pub fn with_lens(self, lens: Lens) -> Self {
        Self { lens, inverse: InverseLens::default(), ..self }
    }

    /// The same camera with a colour camera.
    #[must_use]
    pub fn with_registered(self, registered: Registered) -> Self {
        Self { registered: Some(Box::new(registered)), ..self }
    }

    /// The colour camera to whose image depth can be registered, if there is one.
    pub fn registered(&self) -> Option<&Registered> {
        self.registered.as_deref()
    }

    /// The same camera with another shutter. A camera has a global one unless it is told otherwise.
    #[must_use]
    pub fn with_shutter(self, shutter: Shutter) -> Self {
        Self { shutter, ..self }
    }

    /// A camera with square pixels, its principal point in the middle, and a horizontal field of view from the left edge of
    /// the image to the right edge: fx = width / (2 tan(hfov / 2)).
    ///
    /// # Errors
    /// A [`CameraError`] that names the first wrong argument.
    pub fn from_hfov(size: (usize, usize), hfov: Angle, rate_hz: Option<f64>) -> Result<Self, CameraError> {
        if !(hfov.radians() > 0.0 && hfov.radians() < std::f64::consts::PI) {
            return Err(CameraError::FieldOfView);
        }
        let (width, height) = (size.0 as f64, size.1 as f64);
        let f = width / (2.0 * libm::tan(hfov.radians() / 2.0));
        Self::new(size, (f, f), (width / 2.0, height / 2.0), rate_hz)
    }

    /// The number of columns of the image.
    pub fn width(&self) -> usize {
        self.width
    }

    /// The number of rows of the image.
    pub fn height(&self) -> usize {
        self.height
    }

    /// Focal lengths (fx, fy) in pixels.
    pub fn focal_px(&self) -> (f64, f64) {
        (self.fx, self.fy)
    }

    /// Principal point (cx, cy) in pixels; the centre of the top left pixel is (0.5, 0.5).
    pub fn principal_px(&self) -> (f64, f64) {
        (self.cx, self.cy)
    }

    /// Frames a second, if given.
    pub fn rate_hz(&self) -> Option<f64> {
        self.rate_hz
    }

    /// The lens.
    pub fn lens(&self) -> &Lens {
        &self.lens
    }

    /// The shutter.
    pub fn shutter(&self) -> &Shutter {
        &self.shutter
    }

    /// The pixels of a row.
    #[inline(always)]
    pub(super) fn row(&self, row: usize) -> CameraRow<'_> {
        let width = self.width;
        let lens = match self.lens {
            Lens::Ideal => LensRow::Ideal { y: self.image_y(row as f64 + 0.5), cx: self.cx, fx: self.fx },
            _ => match self.inverse.0.get() {
                Some(directions) => LensRow::Inverted(&directions[row * width..(row + 1) * width]),
                None => LensRow::ToInvert(self, row),
            },
        };
        CameraRow { lens, time_s: self.shutter.time_s(row, self.height) }
    }

    /// The unit direction through a pixel's centre in the optical frame (x right, y down, z forward). It is the direction
    /// that the lens projects to ((u + ½ − cx)/fx, (v + ½ − cy)/fy). Its z is the factor from range along the ray to planar
    /// depth. `None` if the lens has no ray for the pixel.
    #[inline(always)]
    pub(super) fn optical_direction(&self, row: usize, column: usize) -> Option<DVec3> {
        self.row(row).optical_direction(column)
    }

    fn invert_pixel(&self, row: usize, column: usize) -> Option<DVec3> {
        self.optical_direction_at(column as f64 + 0.5, row as f64 + 0.5)
    }

    /// Inverts the lens for all pixels at once, on all threads, and keeps the directions for this camera and its clones.
    /// The directions of an ideal lens are not kept, because computing one costs less than a look-up.
    pub(super) fn invert_lens(&self) {
        if matches!(self.lens, Lens::Ideal) || self.inverse.0.get().is_some() {
            return;
        }
        let pixel = |i: usize| self.invert_pixel(i / self.width, i % self.width).unwrap_or(DVec3::NAN);
        let directions = (0..self.width * self.height).into_par_iter().map(pixel).collect();
        // Two threads may have computed the same directions. Neither waits for the other, because inside the thread pool a
        // thread could then wait for itself.
        let _ = self.inverse.0.set(directions);
    }

    /// Bytes that the directions of all pixels take once a frame was cast. It is 0 for an ideal lens.
    pub fn table_bytes(&self) -> u64 {
        match self.lens {
            Lens::Ideal => 0,
            _ => (self.width as u64)
                .saturating_mul(self.height as u64)
                .saturating_mul(size_of::<DVec3>() as u64),
        }
    }

    /// The unit direction in the optical frame through any point (u, v) of the image, in pixels from its top left corner.
    pub fn optical_direction_at(&self, u: f64, v: f64) -> Option<DVec3> {
        self.lens.unproject(self.on_image_plane(u, v))
    }

    /// The unit direction in the optical frame through a place (u, v) of a pixel, in pixels from its centre. Behind a lens that
    /// distorts it is interpolated between the centres of the pixels beside it, which errs by the curvature over one pixel: some
    /// 10⁻³ of the pixel. `None` if the lens has no ray for one of them.
    pub(super) fn optical_direction_in_pixel(
        &self,
        row: usize,
        column: usize,
        [u, v]: [f64; 2],
    ) -> Option<DVec3> {
        if matches!(self.lens, Lens::Ideal) {
            let at = self.on_image_plane(column as f64 + 0.5 + u, row as f64 + 0.5 + v);
            return Some(Lens::ideal(at));
        }
        let centre = self.optical_direction(row, column)?;
        let beside = |row: Option<usize>, column: Option<usize>| {
            let (row, column) = (row.filter(|&row| row < self.height)?, column.filter(|&c| c < self.width)?);
            self.optical_direction(row, column)
        };
        let slope = |before: Option<DVec3>, after: Option<DVec3>| match (before, after) {
            (Some(before), Some(after)) => Some(0.5 * (after - before)),
            (Some(before), None) => Some(centre - before),
            (None, Some(after)) => Some(after - centre),
            (None, None) => None,
        };
        let across = slope(beside(Some(row), column.checked_sub(1)), beside(Some(row), Some(column + 1)));
        let down = slope(beside(row.checked_sub(1), Some(column)), beside(Some(row + 1), Some(column)));
        Some((centre + u * across? + v * down?).normalize())
    }

    /// The place (u, v) of the image, in pixels, in units of the focal length about the principal point.
    #[inline]
    fn on_image_plane(&self, u: f64, v: f64) -> DVec2 {
        DVec2::new((u - self.cx) / self.fx, self.image_y(v))
    }

    #[inline]
    fn image_y(&self, v: f64) -> f64 {
        (v - self.cy) / self.fy
    }

    /// The image point of a direction in the optical frame, in pixels from the image's top left corner. It may lie outside
    /// of the image. `None` if the direction is outside of the lens model's domain.
    pub fn project(&self, optical: DVec3) -> Option<(f64, f64)> {
        let drawn = self.lens.project(optical)?;
        Some((drawn.x * self.fx + self.cx, drawn.y * self.fy + self.cy))
    }
}

/// The pixels of a row of a camera's image, which are exposed at the same time.
#[derive(Clone, Copy, Debug)]
pub(super) struct CameraRow<'c> {
    lens: LensRow<'c>,
    /// The time at which the row is exposed, in seconds from the frame's start.
    time_s: f64,
}

/// The source of the directions of a row.
#[derive(Clone, Copy, Debug)]
enum LensRow<'c> {
    /// An ideal lens, with the row's place on the image plane at the focal length 1.
    Ideal { y: f64, cx: f64, fx: f64 },
    /// The directions of a lens that was inverted for all pixels.
    Inverted(&'c [DVec3]),
    /// A lens that has to be inverted for each pixel of a row.
    ToInvert(&'c Camera, usize),
}

impl CameraRow<'_> {
    /// [`Camera::optical_direction`] of a column.
    #[inline(always)]
    pub fn optical_direction(&self, column: usize) -> Option<DVec3> {
        match self.lens {
            LensRow::Ideal { y, cx, fx } => Some(Lens::ideal(DVec2::new((column as f64 + 0.5 - cx) / fx, y))),
            LensRow::Inverted(directions) => Some(directions[column]).filter(|d| !d.is_nan()),
            LensRow::ToInvert(camera, row) => camera.invert_pixel(row, column),
        }
    }

    /// The pulse of a column. Its direction is that of [`Self::optical_direction`] in the camera's body frame (x forward, y
    /// left, z up).
    #[inline(always)]
    pub fn pulse(&self, column: usize) -> Option<Pulse> {
        let direction = BODY_FROM_OPTICAL.direction(self.optical_direction(column)?);
        Some(Pulse::new(DVec3::ZERO, direction, self.time_s))
    }

    /// The time of the pulse of a column, in seconds from the frame's start. `None` if the lens has no ray for the pixel.
    #[inline(always)]
    pub fn time_s(&self, column: usize) -> Option<f64> {
        // Most lenses have a ray for each pixel, so an ideal lens is not asked.
        let has_ray = matches!(self.lens, LensRow::Ideal { .. }) || self.optical_direction(column).is_some();
        has_ray.then_some(self.time_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn field_of_view_reaches_the_image_edges() {
        let camera = Camera::from_hfov((640, 480), Angle::deg(90.0), None).unwrap();
        assert!((camera.focal_px().0 - 320.0).abs() < 1e-12);
        // The centre of the last column is half a pixel inside the edge, which lies at 45°.
        let d = camera.optical_direction(240, 639).unwrap();
        assert!((d.x / d.z - 319.5 / 320.0).abs() < 1e-12);
    }

    #[test]
    fn an_inverted_lens_gives_what_each_pixel_gives() {
        // The barrel distortion is so strong that the corners have no ray.
        let lens = super::super::BrownConrady::new([-0.4, 0.0, 1e-3, -2e-3, 0.0, 0.0, 0.0, 0.0]).unwrap();
        let camera = Camera::from_hfov((64, 48), Angle::deg(90.0), None).unwrap();
        let camera = camera.with_lens(Lens::BrownConrady(lens));
        let pixels = || (0..48).flat_map(|row| (0..64).map(move |column| (row, column)));
        let before: Vec<_> = pixels().map(|(row, column)| camera.optical_direction(row, column)).collect();
        assert!(before.iter().any(Option::is_none) && before.iter().any(Option::is_some));
        let clone = camera.clone();
        camera.invert_lens();
        assert!(clone.inverse.0.get().is_some(), "clones share it");
        let after: Vec<_> = pixels().map(|(row, column)| clone.optical_direction(row, column)).collect();
        assert_eq!(before, after);
        assert_eq!(camera.table_bytes(), 64 * 48 * 24);
        assert!(camera.with_lens(Lens::Ideal).inverse.0.get().is_none());
    }

    #[test]
    fn pixels_go_right_and_down() {
        let camera = Camera::new((5, 5), (3.0, 3.0), (2.5, 2.5), None).unwrap();
        let direction = |row, column| camera.row(row).pulse(column).unwrap().direction;
        assert_eq!(direction(2, 2), DVec3::X);
        assert!(direction(2, 0).y > 0.0, "the left column looks left");
        assert!(direction(0, 2).z > 0.0, "the top row looks up");
    }

    #[test]
    fn impossible_parameters_are_refused() {
        let centre = (1.0, 1.0);
        assert_eq!(Camera::new((0, 2), (1.0, 1.0), centre, None), Err(CameraError::NoPixels));
        assert_eq!(Camera::new((2, 2), (0.0, 1.0), centre, None), Err(CameraError::FocalLength));
        assert_eq!(Camera::new((2, 2), (1.0, 1.0), (f64::NAN, 1.0), None), Err(CameraError::PrincipalPoint));
        assert_eq!(Camera::new((2, 2), (1.0, 1.0), centre, Some(0.0)), Err(CameraError::Rate));
        assert_eq!(Camera::from_hfov((2, 2), Angle::deg(180.0), None), Err(CameraError::FieldOfView));
    }
}
