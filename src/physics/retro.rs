//! Retroreflectors: sheeting, which is an extended target, and prisms, which are points.
//!
//! Sources: ASTM E808 for the terms: the entrance angle lies between the light's direction and the surface's normal, and the
//! observation angle between the directions to the light and to the receiver; ASTM D4956 for the least coefficients of white
//! sheeting.

use std::f64::consts::PI;

/// The share of the incident light that a sheet of glass beads returns: the ends of the range of measured sheets.
pub const BEADS_EFFICIENCY: [f64; 2] = [0.07, 0.14];

/// The share of the incident light that a sheet of truncated cubes returns.
pub const TRUNCATED_CUBES_EFFICIENCY: f64 = 0.32;

/// The share of the incident light that a sheet of full cubes returns.
pub const FULL_CUBES_EFFICIENCY: f64 = 0.58;

/// The gain of a sheet over white Lambert paper at normal incidence: π·R_A.
///
/// `coefficient` is the coefficient of retroreflection R_A in cd/(lx·m²). A white Lambert surface under the illuminance E has
/// the luminance E/π, and the sheet has R_A·E.
pub fn gain(coefficient: f64) -> f64 {
    PI * coefficient
}

/// The power factor of a sheet that takes the whole beam: π·R_A/cosβ.
///
/// `coefficient` is R_A in cd/(lx·m²) at the entrance angle β, and `cosine` is cosβ. R_A counts per area of the sheet and per
/// illuminance across the beam, and an oblique beam lights 1/cosβ more area.
pub fn power_factor(coefficient: f64, cosine: f64) -> f64 {
    if cosine > 0.0 { gain(coefficient) / cosine } else { 0.0 }
}

/// The observation angle of a receiver `spacing_m` beside the transmitter: atan(spacing/range).
pub fn observation_angle_rad(spacing_m: f64, range_m: f64) -> f64 {
    libm::atan2(spacing_m, range_m)
}

/// The coefficient of retroreflection over the observation angle δ: R_A(δ) = peak·exp(−(δ/width)²).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lobe {
    /// The coefficient at an observation angle of 0, in cd/(lx·m²).
    pub peak: f64,
    /// The observation angle at which the coefficient has fallen to 1/e of its peak.
    pub width_rad: f64,
}

impl Lobe {
    /// The lobe of white sheeting of type III, beaded and new: 301 cd/(lx·m²) and .466°. It meets the standard's 300, 250 and 95
    /// at .1°, .2° and .5° within 5 %.
    pub const TYPE_III: Self = Self { peak: 301.0, width_rad: 0.466 * PI / 180.0 };

    /// The lobe through two points, each an observation angle in radians and a coefficient. The second angle is the larger one,
    /// and its coefficient is the smaller one and positive.
    pub fn through(near: [f64; 2], far: [f64; 2]) -> Self {
        let squares = [near[0] * near[0], far[0] * far[0]];
        let width2 = (squares[1] - squares[0]) / libm::log(near[1] / far[1]);
        Self { peak: near[1] * libm::exp(squares[0] / width2), width_rad: width2.sqrt() }
    }

    /// The coefficient of retroreflection at an observation angle, in cd/(lx·m²).
    pub fn coefficient(&self, observation_rad: f64) -> f64 {
        let ratio = observation_rad / self.width_rad;
        self.peak * libm::exp(-ratio * ratio)
    }
}

/// White sheeting of ASTM D4956.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sheeting {
    /// Engineer grade, of enclosed beads.
    TypeI,
    /// Super engineer grade, of enclosed beads.
    TypeII,
    /// High intensity, of encapsulated beads or unmetallised prisms.
    TypeIII,
}

impl Sheeting {
    /// The least coefficients of the standard in cd/(lx·m²). A row is an entrance angle, −4° and 30°, and a column is an
    /// observation angle, .2° and .5°.
    pub fn table(self) -> [[f64; 2]; 2] {
        match self {
            Self::TypeI => [[70.0, 30.0], [30.0, 15.0]],
            Self::TypeII => [[140.0, 50.0], [60.0, 28.0]],
            Self::TypeIII => [[250.0, 95.0], [150.0, 65.0]],
        }
    }

    /// The coefficient of retroreflection in cd/(lx·m²) at any pair of angles, through the four figures of
    /// [`Self::table`].
    ///
    /// Over the observation angle, each row is the [`Lobe`] through its two figures. Over the entrance angle β, the logarithm is
    /// linear in β² through both rows: exp of a square, as over the observation angle. The standard gives no figure beyond
    /// 30°, where this is an extrapolation, nor below .2°.
    pub fn coefficient(self, observation_rad: f64, entrance_rad: f64) -> f64 {
        const DEGREE: f64 = PI / 180.0;
        let [straight, oblique] = self.table().map(|[near, far]| {
            Lobe::through([0.2 * DEGREE, near], [0.5 * DEGREE, far]).coefficient(observation_rad)
        });
        let share = (entrance_rad * entrance_rad / (DEGREE * DEGREE) - 16.0) / (900.0 - 16.0);
        straight * libm::exp(share * libm::log(oblique / straight))
    }
}

/// A prism or another retroreflector that is smaller than the beam: a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Prism {
    /// The coefficient of luminous intensity R_I in cd/lx, which is in m²/sr: the intensity that returns over the irradiance
    /// across the beam.
    pub intensity_m2_sr: f64,
}

impl Prism {
    /// A prism with a round aperture that returns a share of its light, uniformly within a cone: R_I = η·A/Ω, with
    /// A = π·d²/4 and Ω = π·ψ²/4.
    ///
    /// `efficiency` is η, `diameter_m` is d, and `divergence_rad` is ψ, the full angle of the light that returns.
    pub fn round(diameter_m: f64, efficiency: f64, divergence_rad: f64) -> Self {
        let ratio = diameter_m / divergence_rad;
        Self { intensity_m2_sr: efficiency * ratio * ratio }
    }

    /// The power factor of the prism in a Gaussian beam: π·R_I·E/P, with the irradiance over the beam's power
    /// E/P = 2/(π·w²)·exp(−2r²/w²).
    ///
    /// `radius_m` is w, the radius at which the beam's irradiance has fallen to 1/e² at the prism; `offset_m` is r, the distance
    /// of the prism from the beam's axis. w grows with the range, so the echo falls with the range to the power −4.
    pub fn power_factor(&self, radius_m: f64, offset_m: f64) -> f64 {
        let w2 = radius_m * radius_m;
        2.0 * self.intensity_m2_sr / w2 * libm::exp(-2.0 * offset_m * offset_m / w2)
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::{agrees, close, midpoint};
    use super::*;

    const DEGREE: f64 = PI / 180.0;

    #[test]
    fn sheeting_returns_hundreds_of_times_as_much_as_white() {
        // The figures are rounded to whole numbers.
        agrees(gain(70.0), 220.0, 1.0);
        agrees(gain(250.0), 785.0, 1.0);
        // The scene is a plate of type III with 2 cm between transmitter and receiver: .0573° at 20 m with 931, and 209 at 2 m.
        let at = |range_m| observation_angle_rad(0.02, range_m);
        agrees(at(20.0) / DEGREE, 0.0573, 1e-4);
        agrees(gain(Lobe::TYPE_III.coefficient(at(20.0))), 931.0, 1.0);
        agrees(gain(Lobe::TYPE_III.coefficient(at(2.0))), 209.0, 1.0);
        agrees(at(2.0) / DEGREE, 0.57, 0.01);
        agrees(at(50.0) / DEGREE, 0.023, 0.001);
        // The gain drops 4.5 times from its peak at 2 m.
        agrees(301.0 / Lobe::TYPE_III.coefficient(at(2.0)), 4.5, 0.1);
    }

    #[test]
    fn the_lobe_of_type_iii_meets_the_standard_within_five_percent() {
        for (degrees, least) in [(0.1, 300.0), (0.2, 250.0), (0.5, 95.0)] {
            close(Lobe::TYPE_III.coefficient(degrees * DEGREE), least, 0.05);
        }
        let through = Lobe::through([0.2 * DEGREE, 250.0], [0.5 * DEGREE, 95.0]);
        agrees(through.peak, 301.0, 1.0);
        agrees(through.width_rad / DEGREE, 0.466, 1e-3);
    }

    #[test]
    fn sheeting_meets_its_table_and_falls_off() {
        for sheeting in [Sheeting::TypeI, Sheeting::TypeII, Sheeting::TypeIII] {
            for (row, entrance) in [4.0, 30.0].into_iter().enumerate() {
                for (column, observation) in [0.2, 0.5].into_iter().enumerate() {
                    let value = sheeting.coefficient(observation * DEGREE, entrance * DEGREE);
                    // Logarithms and exponentials of numbers below 10 keep the share to some 1e-15.
                    close(value, sheeting.table()[row][column], 1e-13);
                }
            }
            let mut last = f64::INFINITY;
            for degrees in 0..=80 {
                let value = sheeting.coefficient(0.2 * DEGREE, f64::from(degrees) * DEGREE);
                assert!(value < last && value > 0.0);
                last = value;
            }
            assert_eq!(sheeting.coefficient(0.0, -0.07), sheeting.coefficient(0.0, 0.07));
        }
    }

    #[test]
    fn a_lambert_surface_is_its_own_retroreflector() {
        // A white Lambert surface has R_A = cos²β/π: its luminance is E·cosβ/π, and its projected area shrinks by cosβ.
        for cosine in [1.0, 0.6, 0.1] {
            close(power_factor(cosine * cosine / PI, cosine), cosine, 1e-15);
        }
        assert_eq!(power_factor(100.0, 0.0), 0.0);
    }

    #[test]
    fn type_iii_returns_no_more_light_than_it_gets() {
        // The share that returns is the integral of R_A over the solid angle: π·peak·width².
        let lobe = Lobe::TYPE_III;
        let share = midpoint(0.0, 0.1, 10_000, |angle| 2.0 * PI * angle * lobe.coefficient(angle));
        close(share, PI * lobe.peak * lobe.width_rad * lobe.width_rad, 1e-5);
        // A lobe without tails has less than the measured efficiency of beads.
        assert!(share < BEADS_EFFICIENCY[0]);
    }

    #[test]
    fn a_prism_falls_with_the_fourth_power_of_the_range() {
        let prism = Prism::round(0.05, 0.9, 1e-3);
        let echo = |range_m: f64| prism.power_factor(0.0015 * range_m, 0.0) / (range_m * range_m);
        close(echo(100.0) / echo(200.0), 16.0, 1e-14);
    }

    #[test]
    fn prisms_side_by_side_make_a_sheet() {
        // Prisms of R_I, n to the square metre, are a sheet of R_A = n·R_I that takes the whole beam.
        let (prism, per_m2, w) = (Prism { intensity_m2_sr: 2e-4 }, 1e6, 0.05);
        let summed = midpoint(0.0, 0.5, 10_000, |r| 2.0 * PI * r * per_m2 * prism.power_factor(w, r));
        // The midpoint rule errs by (0.5/10⁴/w)², 1e-6.
        close(summed, gain(per_m2 * 2e-4), 1e-5);
    }

    #[test]
    fn a_prism_returns_the_light_that_it_takes() {
        // The intensity over the cone's solid angle is the efficiency times the light on the aperture.
        let (d, eta, psi) = (0.03, 0.8, 2e-3);
        let returned = Prism::round(d, eta, psi).intensity_m2_sr * PI * psi * psi / 4.0;
        close(returned, eta * PI * d * d / 4.0, 1e-14);
    }
}
