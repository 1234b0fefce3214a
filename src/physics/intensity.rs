//! The scales by which vendors tell intensity.

/// A scale of intensities.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum IntensityScale {
    /// The reflectivity itself.
    #[default]
    Ideal,
    /// The reflectivity in percent.
    Percent,
    /// Velodyne's scale of calibrated reflectivity, in which 100 is white and retroreflectors are above.
    Velodyne,
    /// The scale of Velodyne's VLS-128, in which 110 is white and retroreflectors are above.
    Vls128,
    /// Livox's scale, in which 150 is white and retroreflectors are above.
    Livox,
    /// Hesai's scale, in which 255 is the most.
    Hesai,
    /// The reflectivity of Ouster's sensors, in 8 bits.
    OusterReflectivity,
}
