//! The formulas of the measurements of LiDARs and depth cameras, as pure functions of numbers. This room reads no files, draws no
//! random numbers and knows no scene.
//!
//! | file | topic |
//! |---|---|
//! | `air` | extinction by haze, fog, rain and dust; the way there and back through them |
//! | `binomial` | the binomial distribution of counts |
//! | `depth_quality` | the measures of depth on a flat target that RealSense's tool has |
//! | `detection` | thresholds, false alarms, the sensitivity that range limits of data sheets imply, and the noise of a range |
//! | `disparity` | triangulation: depth and disparity, and its steps |
//! | `dots` | what the projector of an active stereo camera throws |
//! | `echo` | pulses that add up to a waveform, and its peaks |
//! | `film` | diffuse ground under a film of water |
//! | `footprint` | where the light of a beam goes: fixed sets of sub-rays of equal energy |
//! | `fresnel` | Snell's law, and the reflectance of a face for both polarisations |
//! | `histogram` | histograms of a single-photon detector: pile-up, detection and the range of an echo |
//! | `infrared` | the noise of an infrared camera's image |
//! | `intensity` | the scales of intensity of LiDAR makers |
//! | `pane` | a pane of two faces: transmission, reflectance, delay and shift |
//! | `particles` | sizes, numbers, places and echoes of drops and flakes |
//! | `phasor` | continuous-wave time of flight: phasors, taps, and their noise |
//! | `retro` | retroreflective sheeting and prisms |
//! | `soft_target` | the echo of fog and dust |
//! | `spad` | the first count of a single-photon detector, and pile-up |
//! | `sun` | sunlight, background power and the ambient channel |
//! | `sun_spectrum` | the sun's spectrum, as a table |
//! | `surface` | Lambert's law and the materials of glTF, seen from where they are lit |
//! | `unwrap` | ranges from phases at several frequencies, and whether they can be relied upon |
//!
//! Lengths are in metres, wavelengths too; angles are in radians, extinction is per metre, and the other units are named where
//! they occur. A *power factor* is the power that comes back from a surface which takes the whole beam, relative to the power
//! from a white Lambert plane at normal incidence at the same range. An *echo* is a power factor over the range squared: it is
//! 1 for the white plane at 1 m in clear air.
//!
//! Angles of incidence are given by their cosines, 1 at normal incidence and 0 at grazing incidence.

pub mod air;
pub mod binomial;
pub mod depth_quality;
pub mod detection;
pub mod disparity;
pub mod dots;
pub mod echo;
pub mod film;
pub mod footprint;
pub mod fresnel;
pub mod histogram;
pub mod infrared;
pub mod intensity;
pub mod pane;
pub mod particles;
pub mod phasor;
pub mod retro;
pub mod soft_target;
pub mod spad;
pub mod sun;
mod sun_spectrum;
pub mod surface;
pub mod unwrap;

pub use air::{Haze, two_way_transmission};
pub use film::WetDiffuse;
pub use fresnel::{Face, Polarised};
pub use intensity::IntensityScale;
pub use pane::Pane;
pub use particles::SizeDistribution;
pub use retro::{Lobe, Prism, Sheeting};
pub use soft_target::{PulseShape, SoftTarget};
pub use surface::MetallicRoughness;

/// The speed of light in vacuum in metres a second, exact by the definition of the metre.
pub const SPEED_OF_LIGHT_M_S: f64 = 299_792_458.0;

#[cfg(test)]
mod testing {
    /// Asserts that a number agrees with a printed figure, to half a unit of its last digit and the rounding of that half.
    #[track_caller]
    pub fn agrees(value: f64, printed: f64, last_digit: f64) {
        assert!(
            (value - printed).abs() <= 0.5 * last_digit * (1.0 + 1e-9),
            "{value} is not {printed} as printed"
        );
    }

    /// Asserts that two numbers differ by no more than a share of the second.
    #[track_caller]
    pub fn close(value: f64, expected: f64, share: f64) {
        assert!((value - expected).abs() <= share * expected.abs(), "{value} is not {expected}");
    }

    /// The integral of a smooth function by the midpoint rule, whose error falls with the square of the number of steps.
    pub fn midpoint(from: f64, to: f64, steps: u32, f: impl Fn(f64) -> f64) -> f64 {
        let step = (to - from) / f64::from(steps);
        (0..steps).map(|i| f(from + (f64::from(i) + 0.5) * step)).sum::<f64>() * step
    }
}
