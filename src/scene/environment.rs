//! The air between sensor and surfaces, and the sun.

use glam::DVec3;

pub use crate::physics::Haze;

/// The air and the sun of a scene. Without either, air is clear and there is no sunlight.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Environment {
    /// The weather; `None`: the air is clear.
    pub weather: Option<Weather>,
    /// The sun; `None`: it is night.
    pub sun: Option<Sun>,
}

/// The particles in the air.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weather {
    /// The meteorological optical range in metres, at which 5 % of the contrast is left; `None`: there is no fog.
    pub visibility_m: Option<f64>,
    /// The model of how the extinction of fog and haze depends on the wavelength.
    pub haze: Haze,
    /// The rate of rain in mm/h.
    pub rain_mm_h: f64,
    /// The rate of snow in mm of water an hour.
    pub snow_mm_h: f64,
    /// The extinction by dust, a metre.
    pub dust_per_m: f64,
    /// The ratio of the extinction of fog to its backscatter, in sr.
    pub lidar_ratio: f64,
    /// The ratio of the extinction of dust to its backscatter, in sr.
    pub dust_lidar_ratio: f64,
    /// The factor on the backscatter of rain drops, of which the reflection on a drop's front is the least.
    pub drop_gain: f64,
}

impl Default for Weather {
    fn default() -> Self {
        Self {
            visibility_m: None,
            haze: Haze::Kim,
            rain_mm_h: 0.0,
            snow_mm_h: 0.0,
            dust_per_m: 0.0,
            // E. J. O'Connor et al. 2004: 18.8 ± 0.8 sr for cloud droplets at 905 nm.
            lidar_ratio: 19.0,
            // An uncertain figure: published lidar ratios of mineral dust lie around 40 to 55 sr.
            dust_lidar_ratio: 40.0,
            drop_gain: 1.0,
        }
    }
}

/// The sun.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sun {
    /// The illuminance of a plane that faces the sun, in kilolux.
    pub klx: f64,
    /// The unit direction towards the sun, in the world.
    pub direction: DVec3,
}
