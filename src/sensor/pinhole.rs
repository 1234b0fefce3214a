//! Ideal depth cameras.

use glam::DVec3;

use crate::angle::Angle;
use crate::frame::BODY_FROM_OPTICAL;

/// A camera without distortion. Pixel (0, 0) is top left and its centre lies at (0.5, 0.5).
#[derive(Clone, Debug, PartialEq)]
pub struct Pinhole {
    width: usize,
    height: usize,
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    rate_hz: Option<f64>,
}

/// Why a camera can't be.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PinholeError {
    /// No pixels.
    #[error("a camera needs at least one pixel each way")]
    NoPixels,
    /// A focal length that is not a positive number.
    #[error("focal lengths must be positive")]
    FocalLength,
    /// A principal point that is not finite.
    #[error("the principal point must be finite")]
    PrincipalPoint,
    /// A field of view of nothing, or of half a turn and more.
    #[error("a pinhole's field of view lies between 0 and 180 degrees")]
    FieldOfView,
    /// The rate is not a positive number.
    #[error("the rate must be positive")]
    Rate,
}

impl Pinhole {
    /// A camera from its intrinsics, in pixels: focal lengths (`fx`, `fy`) and principal point (`cx`, `cy`).
    pub fn new(
        (width, height): (usize, usize),
        (fx, fy): (f64, f64),
        (cx, cy): (f64, f64),
        rate_hz: Option<f64>,
    ) -> Result<Self, PinholeError> {
        if width == 0 || height == 0 {
            return Err(PinholeError::NoPixels);
        }
        if !(fx.is_finite() && fy.is_finite() && fx > 0.0 && fy > 0.0) {
            return Err(PinholeError::FocalLength);
        }
        if !(cx.is_finite() && cy.is_finite()) {
            return Err(PinholeError::PrincipalPoint);
        }
        if rate_hz.is_some_and(|r| !(r.is_finite() && r > 0.0)) {
            return Err(PinholeError::Rate);
        }
        Ok(Self { width, height, fx, fy, cx, cy, rate_hz })
    }

    /// A camera with square pixels, its principal point in the middle, and a horizontal field of view from the left edge
    /// of the image to the right: fx = width / (2 tan(hfov / 2)).
    pub fn from_hfov(size: (usize, usize), hfov: Angle, rate_hz: Option<f64>) -> Result<Self, PinholeError> {
        if !(hfov.radians() > 0.0 && hfov.radians() < std::f64::consts::PI) {
            return Err(PinholeError::FieldOfView);
        }
        let (width, height) = (size.0 as f64, size.1 as f64);
        let f = width / (2.0 * libm::tan(hfov.radians() / 2.0));
        Self::new(size, (f, f), (width / 2.0, height / 2.0), rate_hz)
    }

    /// Columns of the image.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows of the image.
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

    /// The unit direction through a pixel's centre in the optical frame (x right, y down, z forward):
    /// ((u + ½ − cx)/fx, (v + ½ − cy)/fy, 1), normalised. Its z turns a range along the ray into planar depth.
    pub fn optical_direction(&self, row: usize, column: usize) -> DVec3 {
        let x = (column as f64 + 0.5 - self.cx) / self.fx;
        let y = (row as f64 + 0.5 - self.cy) / self.fy;
        DVec3::new(x, y, 1.0).normalize()
    }

    /// The same in the camera's body frame (x forward, y left, z up).
    pub fn direction(&self, row: usize, column: usize) -> DVec3 {
        BODY_FROM_OPTICAL.direction(self.optical_direction(row, column))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn field_of_view_reaches_the_image_edges() {
        let camera = Pinhole::from_hfov((640, 480), Angle::deg(90.0), None).unwrap();
        assert!((camera.focal_px().0 - 320.0).abs() < 1e-12);
        // The centre of the last column is half a pixel inside the edge, which lies at 45°.
        let d = camera.optical_direction(240, 639);
        assert!((d.x / d.z - 319.5 / 320.0).abs() < 1e-12);
    }

    #[test]
    fn pixels_go_right_and_down() {
        let camera = Pinhole::new((5, 5), (3.0, 3.0), (2.5, 2.5), None).unwrap();
        assert_eq!(camera.direction(2, 2), DVec3::X);
        assert!(camera.direction(2, 0).y > 0.0, "the left column looks left");
        assert!(camera.direction(0, 2).z > 0.0, "the top row looks up");
    }

    #[test]
    fn what_cannot_be_is_refused() {
        let centre = (1.0, 1.0);
        assert_eq!(Pinhole::new((0, 2), (1.0, 1.0), centre, None), Err(PinholeError::NoPixels));
        assert_eq!(Pinhole::new((2, 2), (0.0, 1.0), centre, None), Err(PinholeError::FocalLength));
        assert_eq!(
            Pinhole::new((2, 2), (1.0, 1.0), (f64::NAN, 1.0), None),
            Err(PinholeError::PrincipalPoint)
        );
        assert_eq!(Pinhole::new((2, 2), (1.0, 1.0), centre, Some(0.0)), Err(PinholeError::Rate));
        assert_eq!(Pinhole::from_hfov((2, 2), Angle::deg(180.0), None), Err(PinholeError::FieldOfView));
    }
}
