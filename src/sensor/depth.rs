//! How a depth camera finds the depth of its pixels: by the disparity of a second viewpoint, or by the time of flight of modulated
//! light.

/// How a depth camera finds depth. Without it a camera is ideal: its depth is exact.
#[derive(Clone, Debug, PartialEq)]
pub enum DepthSensing {
    /// By the disparity between two viewpoints.
    Stereo(Stereo),
    /// By the phase of light whose intensity is modulated.
    TimeOfFlight(TimeOfFlight),
}

/// A camera that sees, or lights, the scene from two viewpoints a baseline apart, and finds depth by the disparity between them. Its
/// images are rectified: both viewpoints have the same intrinsics and axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Stereo {
    /// What is at the second viewpoint.
    pub second: SecondViewpoint,
    /// The distance from the camera to the second viewpoint along the image's rows, in metres: positive to the right, negative to the
    /// left, and not 0.
    pub baseline_m: f64,
    /// The least disparity that is searched, in pixels.
    pub first_disparity_px: u32,
    /// The number of whole disparities that are searched.
    pub disparities: u32,
    /// The unit of the disparities that are reported, in pixels; 0: they are not rounded.
    pub unit_px: f64,
    /// How disparities are found.
    pub method: StereoMethod,
}

/// What is at the second viewpoint of a stereo camera.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SecondViewpoint {
    /// An imager with the camera's own intrinsics.
    Imager,
    /// The projector of structured light, whose pattern covers the camera's image.
    Projector,
}

/// How a stereo camera finds disparities.
#[derive(Clone, Debug, PartialEq)]
pub enum StereoMethod {
    /// From the exact depth, with noise, holes and rounding.
    Analytic(AnalyticDisparity),
}

/// Disparities that are found from the exact depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AnalyticDisparity {
    /// The standard deviation of a disparity, in pixels.
    pub sigma_px: f64,
    /// The side of the window in which a pixel's neighbours have to have nearly its disparity, in pixels; 1: no window is looked at.
    pub window_px: u32,
    /// The difference of disparities within the window that counts as the same surface, in pixels.
    pub inlier_px: f64,
    /// The share of the window's pixels that have to be of the same surface, 0 to 1.
    pub inlier_share: f64,
}

impl Stereo {
    /// The disparities that are searched, in pixels: from the first, which is among them, to the second, which is not.
    pub fn searched_px(&self) -> [f64; 2] {
        let first = f64::from(self.first_disparity_px);
        [first, first + f64::from(self.disparities)]
    }

    /// The standard deviation of a disparity that the camera is told to have, in pixels; `None` if it matches images, so that the
    /// scene decides.
    pub fn sigma_px(&self) -> Option<f64> {
        match &self.method {
            StereoMethod::Analytic(analytic) => Some(analytic.sigma_px),
        }
    }
}

/// A camera that lights the scene with light of modulated intensity, and finds depth by the phase in which it comes back.
#[derive(Clone, Debug, PartialEq)]
pub struct TimeOfFlight {
    /// The frequencies of modulation in hertz, one to three.
    pub frequencies_hz: Vec<f64>,
    /// The wavelength in metres.
    pub wavelength_m: f64,
    /// The electrons that the camera's own light from a white plane at 1 m frees in a pixel, in all taps of one frequency.
    pub electrons_at_1_m: f64,
    /// The contrast of demodulation, 0 to 1.
    pub contrast: f64,
    /// The electrons that sunlight of 100 klx on a white plane frees in a pixel, in all taps of one frequency.
    pub sun_electrons: f64,
    /// The standard deviation of the noise of reading a tap, in electrons.
    pub read_noise: f64,
    /// The electrons that a tap holds; infinite if it never saturates.
    pub full_well: f64,
    /// The side of the square of sub-rays of a pixel.
    pub samples: u32,
    /// The rays for indirect light of each sub-ray's hit; 0: there is only direct light.
    pub indirect_rays: u32,
    /// The amplitude of the third harmonic of the modulation over that of the first, which makes ranges wiggle.
    pub third_harmonic: f64,
    /// The least amplitude of a pixel with depth, in electrons.
    pub least_amplitude: f64,
    /// The largest disagreement between the depths of the frequencies, in metres; infinite if they may disagree.
    pub disagreement_m: f64,
}
