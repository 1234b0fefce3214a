//! The scales by which vendors tell intensity.

/// A scale of intensities.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum IntensityScale {
    /// The reflectivity itself.
    #[default]
    Ideal,
}
