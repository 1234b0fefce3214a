//! The camera that every dialect gives, and the checks that all of them share.

use super::super::fields::Fields;

/// Most rows and most columns of an image.
pub const MOST_PIXELS: u32 = 1_000_000;

/// A camera as a calibration describes it.
pub struct Calibration {
    pub width: u32,
    pub height: u32,
    /// Focal lengths in pixels.
    pub focal: [f64; 2],
    /// The principal point in pixels, counted as here: the centre of the top left pixel is at (0.5, 0.5).
    pub principal: [f64; 2],
    pub lens: LensKeys,
    /// The keys that were used, for the file's first comment.
    pub used: String,
    /// Further facts that a user must know, a sentence each.
    pub notes: Vec<String>,
}

pub struct LensKeys {
    pub is_fisheye: bool,
    /// The coefficients in OpenCV's order; none if the lens does not distort.
    pub coefficients: Vec<f64>,
}

impl LensKeys {
    /// A pinhole with OpenCV's coefficients. Zeros are no distortion.
    pub fn pinhole(coefficients: Vec<f64>) -> Self {
        let is_ideal = coefficients.iter().all(|x| *x == 0.0);
        Self { is_fisheye: false, coefficients: if is_ideal { Vec::new() } else { coefficients } }
    }

    /// OpenCV's fisheye with k1 to k4.
    pub fn fisheye(coefficients: Vec<f64>) -> Self {
        Self { is_fisheye: true, coefficients }
    }
}

/// A principal point of a dialect, which counts pixels from the centre of the top left one, counted from the image's corner.
pub fn from_corner([cx, cy]: [f64; 2]) -> [f64; 2] {
    [cx + 0.5, cy + 0.5]
}

/// The image's size: whole numbers of pixels under two keys.
pub fn size(fields: &Fields<'_>, [width, height]: [&str; 2]) -> Option<[u32; 2]> {
    let side = |key: &str, of: &str| {
        fields.need(key, &format!("the number of the image's {of}"))?;
        fields.integer(key, 1, MOST_PIXELS)
    };
    let (width, height) = (side(width, "columns"), side(height, "rows"));
    Some([width?, height?])
}

/// Refuses focal lengths that are not positive: `[fx, fy]`.
pub fn check_focal(fields: &Fields<'_>, key: &str, [fx, fy]: [f64; 2]) -> Option<[f64; 2]> {
    if fx > 0.0 && fy > 0.0 {
        return Some([fx, fy]);
    }
    let help = "a camera that is not calibrated has zeros here".to_owned();
    let message = format!("the focal lengths are {fx} and {fy} pixels");
    fields.file().fail(fields.span(key), message, "expected more than 0", help)
}
