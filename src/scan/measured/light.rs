//! The light of a pulse that comes back, path by path.

use glam::DVec3;

use crate::scan::{Cause, NO_OBJECT};

/// Light that comes back to its pulse's receiver over one path.
#[derive(Clone, Copy, Debug)]
pub(super) struct Light {
    /// The number of the pulse in its strip.
    pub pulse: u32,
    /// A number that tells the path from all others of the pulse, and does not depend on other effects: random numbers follow from
    /// it.
    pub path: u32,
    /// The range that the sensor reports of light that took so long, in metres.
    pub range_m: f64,
    /// The length of the light's way out, in metres.
    pub length_m: f64,
    /// The energy: the height of the peak that it makes if it comes alone, as a signal-to-noise ratio if the receiver's
    /// sensitivity is known.
    pub energy: f64,
    /// The energy in clear air, over the energy.
    pub clear_air: f64,
    /// Where the light comes from.
    pub cause: Cause,
    /// What sent it back.
    pub target: Target,
}

/// The surface, or the particle, that sends light back.
#[derive(Clone, Copy, Debug)]
pub(super) struct Target {
    /// Where it is, in the world.
    pub point: DVec3,
    /// The unit normal in the world, towards the light.
    pub normal: DVec3,
    /// Its diffuse reflectance.
    pub reflectance: f32,
    pub object: u32,
    pub label: u32,
    pub triangle: u32,
}

impl Target {
    /// A target that is no object of the scene.
    pub const NOTHING: Self = Self {
        point: DVec3::ZERO,
        normal: DVec3::ZERO,
        reflectance: 0.0,
        object: NO_OBJECT,
        label: 0,
        triangle: NO_OBJECT,
    };
}

impl Light {
    /// Whether the light went along the beam's axis, and straight.
    pub fn is_of_axis(&self) -> bool {
        self.path < PATHS_A_SAMPLE
    }
}

/// The numbers of paths that each sub-ray has.
pub(super) const PATHS_A_SAMPLE: u32 = 256;

/// The first number of the paths to particles in the air.
pub(super) const PARTICLES: u32 = 1 << 20;

/// The first number of the paths of halos.
pub(super) const HALOS: u32 = 1 << 31;

/// The first number of the paths of crosstalk.
pub(super) const CROSSTALK: u32 = 3 << 30;

/// The number of the path of the ideal ray, which carries no light.
pub(super) const IDEAL_SAMPLE: u16 = u16::MAX;
