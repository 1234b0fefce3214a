//! How near, how far and how precisely a depth camera measures, from its geometry and its light.

use serde::Serialize;

use super::RangeSigma;
use crate::physics::unwrap::Unwrapper;
use crate::sensor::{DepthSensing, Pattern, SecondViewpoint, Sensor, StereoMethod};

/// The reflectance of the plane whose depth is noisy.
const WHITE: f64 = 0.8;

/// The facts about how a depth camera finds depth.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DepthFacts {
    /// `stereo`, `stereo, matched`, `structured light` or `time of flight`.
    pub method: &'static str,
    /// Whether the figures are those of the data sheet, from `[nominal]`.
    pub is_nominal: bool,
    /// The least depth in metres: f·b over the largest disparity. Only of a camera of two viewpoints.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub least_depth_m: Option<f64>,
    /// The range in metres after which phases repeat. Only of a time-of-flight camera.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unambiguous_range_m: Option<f64>,
    /// The standard deviations of depths at 1, 2 and 4 m, of a plane of 80 % that faces the camera, in the dark. None of a camera that
    /// matches images: there the scene decides.
    pub depth_sigmas: Vec<RangeSigma>,
}

impl DepthFacts {
    /// The facts about a sensor. `None` if it is no depth camera, or an ideal one.
    pub fn of(sensor: &Sensor, is_nominal: bool) -> Option<Self> {
        let Pattern::Camera(camera) = &sensor.pattern else { return None };
        match sensor.measurement.depth.as_ref()? {
            DepthSensing::Stereo(stereo) => {
                let pair = stereo.pair(camera);
                let [_, end_px] = stereo.searched_px();
                let sigmas = |sigma_px: f64| at(|z| pair.depth_per_px(z) * sigma_px);
                Some(Self {
                    method: match (&stereo.method, stereo.second) {
                        (StereoMethod::Match(_), _) => "stereo, matched",
                        (_, SecondViewpoint::Projector) => "structured light",
                        (_, SecondViewpoint::Imager) => "stereo",
                    },
                    is_nominal,
                    least_depth_m: Some(pair.depth_m(end_px)),
                    unambiguous_range_m: None,
                    depth_sigmas: stereo.sigma_px().map(sigmas).unwrap_or_default(),
                })
            }
            DepthSensing::TimeOfFlight(sensing) => Some(Self {
                method: "time of flight",
                is_nominal,
                least_depth_m: None,
                unambiguous_range_m: Unwrapper::new(&sensing.frequencies_hz)
                    .map(|unwrapper| unwrapper.range_m()),
                depth_sigmas: at(|z| sensing.range_sigma_m(WHITE * sensing.electrons_at_1_m / (z * z), z)),
            }),
        }
    }
}

/// Standard deviations at the distances that depth cameras are compared at.
fn at(sigma_m: impl Fn(f64) -> f64) -> Vec<RangeSigma> {
    [1.0, 2.0, 4.0].into_iter().map(|range_m| RangeSigma { range_m, sigma_m: sigma_m(range_m) }).collect()
}
