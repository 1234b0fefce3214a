//! Sizes, numbers, places and echoes of single drops and flakes.
//!
//! Sources: J. S. Marshall and W. McK. Palmer, "The distribution of raindrops with size" (1948); K. L. S. Gunn and
//! J. S. Marshall, "The distribution with size of aggregate snowflakes" (1958); R. S. Sekhon and R. C. Srivastava, "Snow size
//! spectra and radar reflectivity" (1970); V. Kilic et al., "Lidar light scattering augmentation (LISA)" (2021), for rain as
//! single drops.

use std::f64::consts::PI;

/// The least diameter in metres of a drop that counts as one, 50 µm. Smaller ones are fog.
pub const LEAST_DIAMETER_M: f64 = 50e-6;

/// The extinction efficiency of a sphere that is much larger than the wavelength: it takes its area's light, and as much again by
/// diffraction.
pub const LARGE_SPHERE_EFFICIENCY: f64 = 2.0;

/// An exponential distribution of sizes: N(D) = N0·exp(−Λ·D), the number per volume and diameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SizeDistribution {
    /// N0 per cubic metre and metre of diameter. 1 per cubic metre and millimetre is 1000 of it.
    pub intercept_per_m4: f64,
    /// Λ per metre.
    pub slope_per_m: f64,
}

impl SizeDistribution {
    /// Rain by Marshall and Palmer: N0 = 8000 m⁻³mm⁻¹ and Λ = 4.1·Rr^−.21 mm⁻¹, with the rate Rr in mm/h.
    pub fn marshall_palmer(rate_mm_h: f64) -> Self {
        Self { intercept_per_m4: 8e6, slope_per_m: 4100.0 * libm::pow(rate_mm_h, -0.21) }
    }

    /// Snow by Gunn and Marshall: N0 = 3800·Rr^−.87 m⁻³mm⁻¹ and Λ = 2.55·Rr^−.48 mm⁻¹, with the rate Rr of its water in mm/h,
    /// more than 0.
    /// D is the diameter of the drop that a flake melts to; see [`Self::of_flakes`].
    ///
    /// LISA has twice that N0. Its snow would fall at .5 m/s, half as fast as snowflakes do, to bring the water of its rate.
    pub fn gunn_marshall(rate_mm_h: f64) -> Self {
        Self {
            intercept_per_m4: 3.8e6 * libm::pow(rate_mm_h, -0.87),
            slope_per_m: 2550.0 * libm::pow(rate_mm_h, -0.48),
        }
    }

    /// Snow by Sekhon and Srivastava: N0 = 2500·Rr^−.94 m⁻³mm⁻¹ and Λ = 2.29·Rr^−.45 mm⁻¹, with the rate Rr of its water in
    /// mm/h, more than 0. D is the diameter of the drop that a flake melts to; see [`Self::of_flakes`].
    pub fn sekhon_srivastava(rate_mm_h: f64) -> Self {
        Self {
            intercept_per_m4: 2.5e6 * libm::pow(rate_mm_h, -0.94),
            slope_per_m: 2290.0 * libm::pow(rate_mm_h, -0.45),
        }
    }

    /// The distribution of the flakes themselves, where this one is of the drops that they melt to: diameters grow by
    /// (1/density)^⅓, and the number of flakes stays.
    ///
    /// `density` is the flakes' density over that of water, .05 to .2 for aggregates. The extinction grows by density^−⅔.
    pub fn of_flakes(self, density: f64) -> Self {
        let growth = libm::cbrt(1.0 / density);
        Self { intercept_per_m4: self.intercept_per_m4 / growth, slope_per_m: self.slope_per_m / growth }
    }

    /// The extinction per metre: π/4·Q·∫D²·N(D) dD = π·N0/Λ³ for Q = 2 ([`LARGE_SPHERE_EFFICIENCY`]), over all diameters.
    pub fn extinction_per_m(&self) -> f64 {
        let slope = self.slope_per_m;
        0.5 * PI * LARGE_SPHERE_EFFICIENCY * self.intercept_per_m4 / (slope * slope * slope)
    }

    /// The number of particles per cubic metre with a diameter of at least `least_m`: N0/Λ·exp(−Λ·least).
    pub fn number_per_m3(&self, least_m: f64) -> f64 {
        self.intercept_per_m4 / self.slope_per_m * libm::exp(-self.slope_per_m * least_m)
    }

    /// The expected number of particles of at least `least_m` in a volume. The number itself is Poisson's.
    pub fn expected_number(&self, least_m: f64, volume_m3: f64) -> f64 {
        self.number_per_m3(least_m) * volume_m3
    }

    /// The volume of water per volume of air, where D is that of drops: π/6·∫D³·N(D) dD = π·N0/Λ⁴.
    pub fn water_share(&self) -> f64 {
        let squared = self.slope_per_m * self.slope_per_m;
        PI * self.intercept_per_m4 / (squared * squared)
    }

    /// The diameter in metres of the particle at a share `uniform` of the distribution, 0 to less than 1, among those of at least
    /// `least_m`: least − ln(1 − u)/Λ.
    pub fn diameter_m(&self, least_m: f64, uniform: f64) -> f64 {
        least_m - libm::log1p(-uniform) / self.slope_per_m
    }

    /// The diameter in metres at a share `uniform` of the distribution between two diameters:
    /// least − ln(1 − u·(1 − exp(−Λ·(most − least))))/Λ. Snow is drawn up to 20 mm (Hahner et al. 2022).
    pub fn diameter_between_m(&self, least_m: f64, most_m: f64, uniform: f64) -> f64 {
        let share = -libm::expm1(-self.slope_per_m * (most_m - least_m));
        least_m - libm::log1p(-uniform * share) / self.slope_per_m
    }
}

/// The volume in cubic metres of a beam's cone between two ranges: π·tan(h/2)·tan(v/2)·(to³ − from³)/3.
///
/// `divergences_rad` are h and v, the full angles along the axes of the beam's ellipse; a round beam has the same twice.
pub fn cone_volume_m3(divergences_rad: [f64; 2], from_m: f64, to_m: f64) -> f64 {
    let [h, v] = divergences_rad.map(|full| libm::tan(0.5 * full));
    PI * h * v * (to_m * to_m * to_m - from_m * from_m * from_m) / 3.0
}

/// The range in metres of the particle at a share `uniform` of the cone between two ranges:
/// (from³ + u·(to³ − from³))^⅓, as the number of particles grows with the square of the range.
pub fn range_in_cone_m(from_m: f64, to_m: f64, uniform: f64) -> f64 {
    let near = from_m * from_m * from_m;
    libm::cbrt(near + uniform * (to_m * to_m * to_m - near))
}

/// The share of a uniform beam that a particle takes: min((D/D_beam)², 1), as LISA has it. A beam of two unlike diameters
/// counts as the round beam of the same area.
pub fn share_of_uniform_beam(diameter_m: f64, beam_diameters_m: [f64; 2]) -> f64 {
    (diameter_m * diameter_m / (beam_diameters_m[0] * beam_diameters_m[1])).min(1.0)
}

/// The share of a Gaussian beam that a particle takes: D²/(2·w²)·exp(−2r²/w²), no more than 1. It is right for particles that are
/// much smaller than the beam. A cone of 1.5 times the beam's divergence holds 99 % of its light.
///
/// `radii_m` are w along the axes of the beam's ellipse, where its irradiance has fallen to 1/e², and `offset_m` is r, the
/// particle's place along the same axes.
pub fn share_of_gaussian_beam(diameter_m: f64, radii_m: [f64; 2], offset_m: [f64; 2]) -> f64 {
    let [x, y] = [0, 1].map(|i| offset_m[i] / radii_m[i]);
    (0.5 * diameter_m * diameter_m / (radii_m[0] * radii_m[1]) * libm::exp(-2.0 * (x * x + y * y))).min(1.0)
}

/// The power factor of a drop that took the whole beam, from the reflection at its face at normal incidence: ((n − 1)/(n + 1))²,
/// as LISA has it. Water, 1.328, has .0198. A drop's inner reflections send back far more; see [`drop_reflectance`].
pub fn drop_face_reflectance(index: f64) -> f64 {
    let amplitude = (index - 1.0) / (index + 1.0);
    amplitude * amplitude
}

/// The power factor of a drop that took the whole beam, from the lidar ratio S of its kind: π·Q/S with Q = 2.
///
/// A drop has the extinction Q·A and the backscatter Q·A/S per steradian, and a white Lambert disc of its area A has A/π. Mie's
/// theory for spheres of water has S = 4 to 6 sr for millimetres at 905 nm, which is an upper bound on the echo, and 300 sr or
/// more at 1550 nm, where water absorbs. [`drop_face_reflectance`] is S = 317 sr.
pub fn drop_reflectance(lidar_ratio_sr: f64) -> f64 {
    PI * LARGE_SPHERE_EFFICIENCY / lidar_ratio_sr
}

/// The echo of a particle: ρ·share·exp(−2αr)/r².
///
/// `reflectance` is ρ, the power factor that the particle would have if it took the whole beam, and `share` is the share that it
/// takes. `extinction_per_m` is α of the air before it, and `range_m` is r.
pub fn particle_echo(reflectance: f64, share: f64, extinction_per_m: f64, range_m: f64) -> f64 {
    reflectance * share * super::two_way_transmission(extinction_per_m, range_m) / (range_m * range_m)
}

#[cfg(test)]
mod tests {
    use super::super::testing::{agrees, close, midpoint};
    use super::super::{SoftTarget, air};
    use super::*;

    #[test]
    fn rain_has_the_known_extinctions_and_numbers() {
        // The figures were computed apart from this code, with these digits.
        for (rate, extinction, digit, number) in
            [(1.0, 3.65e-4, 1e-6, 1590.0), (10.0, 1.556e-3, 1e-6, 2789.0), (50.0, 4.29e-3, 1e-5, 4054.0)]
        {
            let rain = SizeDistribution::marshall_palmer(rate);
            agrees(rain.extinction_per_m(), extinction, digit);
            agrees(rain.number_per_m3(LEAST_DIAMETER_M), number, 1.01); // 4054.504 is printed as 4054
            // The short form of the extinction has a factor of four digits.
            close(rain.extinction_per_m(), 3.647e-4 * libm::pow(rate, 0.63), 2e-4);
        }
    }

    #[test]
    fn a_distributions_sums_are_its_integrals() {
        let rain = SizeDistribution::marshall_palmer(10.0);
        let density = |d: f64| rain.intercept_per_m4 * libm::exp(-rain.slope_per_m * d);
        // 20 mm are 50 mean diameters; the midpoint rule errs by (step·Λ)²/24, 1e-7.
        let extinction = midpoint(0.0, 0.02, 40_000, |d| 2.0 * PI / 4.0 * d * d * density(d));
        close(rain.extinction_per_m(), extinction, 1e-6);
        close(rain.water_share(), midpoint(0.0, 0.02, 40_000, |d| PI / 6.0 * d * d * d * density(d)), 1e-6);
        close(rain.number_per_m3(1e-3), midpoint(1e-3, 0.02, 40_000, density), 1e-6);
    }

    #[test]
    fn snow_brings_its_water_at_the_speed_of_snowflakes() {
        // The rate of 1 mm/h is 1e-3/3600 m³ of water per m² and second; flakes fall at .8 to 1.2 m/s.
        for snow in [SizeDistribution::gunn_marshall(1.0), SizeDistribution::sekhon_srivastava(1.0)] {
            let speed = 1e-3 / 3600.0 / snow.water_share();
            assert!((0.8..1.2).contains(&speed), "{speed}");
        }
    }

    #[test]
    fn lisas_snow_is_twice_that_of_gunn_and_marshall() {
        // The figures are LISA's: extinction and number at 1 and 2.5 mm/h.
        for (rate, extinction, number) in [(1.0, 1.44e-3, 2624.0), (2.5, 2.43e-3, 1920.0)] {
            let snow = SizeDistribution::gunn_marshall(rate);
            agrees(2.0 * snow.extinction_per_m(), extinction, 1e-5);
            agrees(2.0 * snow.number_per_m3(LEAST_DIAMETER_M), number, 1.0);
        }
    }

    #[test]
    fn flakes_keep_their_number_and_their_mass() {
        let (melted, density) = (SizeDistribution::gunn_marshall(1.0), 0.1);
        let flakes = melted.of_flakes(density);
        close(flakes.number_per_m3(0.0), melted.number_per_m3(0.0), 1e-14);
        close(flakes.water_share() * density, melted.water_share(), 1e-14);
        close(flakes.extinction_per_m(), melted.extinction_per_m() * libm::pow(density, -2.0 / 3.0), 1e-14);
    }

    #[test]
    fn drawn_diameters_are_exponential() {
        let rain = SizeDistribution::marshall_palmer(10.0);
        let over = |f: &dyn Fn(f64) -> f64| midpoint(0.0, 1.0, 1_000_000, f);
        // The mean excess, 1/Λ, is .3956 mm. The logarithm's pole makes the midpoint rule err by 1/steps.
        agrees(1000.0 * (over(&|u| rain.diameter_m(LEAST_DIAMETER_M, u)) - LEAST_DIAMETER_M), 0.3956, 1e-4);
        assert_eq!(rain.diameter_m(LEAST_DIAMETER_M, 0.0), LEAST_DIAMETER_M);
        let median = rain.diameter_m(0.0, 0.5);
        close(rain.number_per_m3(median), 0.5 * rain.number_per_m3(0.0), 1e-14);
        close(rain.diameter_between_m(1e-3, 2e-3, 1.0), 2e-3, 1e-14);
        let middle = rain.diameter_between_m(1e-3, 2e-3, 0.5);
        let [below, above] = [[1e-3, middle], [middle, 2e-3]]
            .map(|[from, to]| rain.number_per_m3(from) - rain.number_per_m3(to));
        close(below, above, 1e-12);
    }

    #[test]
    fn a_cone_of_3_mrad_to_50_m_holds_821_drops() {
        let volume = cone_volume_m3([3e-3, 3e-3], 0.0, 50.0);
        agrees(volume, 0.2945, 1e-4);
        let rain = SizeDistribution::marshall_palmer(10.0);
        agrees(rain.expected_number(LEAST_DIAMETER_M, volume), 821.4, 0.1);
        // A cone is made of discs.
        let discs = midpoint(10.0, 50.0, 10_000, |r| PI * libm::tan(1.5e-3) * libm::tan(1e-3) * r * r);
        close(cone_volume_m3([3e-3, 2e-3], 10.0, 50.0), discs, 1e-8);
    }

    #[test]
    fn drops_lie_uniformly_in_the_cone() {
        // The mean of a density that grows with the square is three quarters of the length.
        close(midpoint(0.0, 1.0, 100_000, |u| range_in_cone_m(0.0, 50.0, u)), 37.5, 1e-6);
        close(range_in_cone_m(10.0, 50.0, 0.0), 10.0, 1e-15);
        close(range_in_cone_m(10.0, 50.0, 1.0), 50.0, 1e-15);
        let half = range_in_cone_m(10.0, 50.0, 0.5);
        close(cone_volume_m3([3e-3; 2], 10.0, half), cone_volume_m3([3e-3; 2], half, 50.0), 1e-12);
    }

    #[test]
    fn a_gaussian_beam_is_shared_out_whole() {
        // Discs of 1 mm side by side cover the plane: the shares over the area of a disc add up to the whole beam.
        let (d, w) = (1e-3, 0.05);
        let whole = midpoint(0.0, 0.5, 100_000, |r| {
            2.0 * PI * r * share_of_gaussian_beam(d, [w, w], [r, 0.0]) / (PI * d * d / 4.0)
        });
        close(whole, 1.0, 1e-6);
        // A uniform beam too: the share over the disc's area is the inverse of the beam's.
        close(share_of_uniform_beam(d, [0.1, 0.1]) / (PI * d * d / 4.0), 1.0 / (PI * 0.05 * 0.05), 1e-14);
        assert_eq!(share_of_uniform_beam(1.0, [0.1, 0.2]), 1.0);
    }

    #[test]
    fn the_mean_echo_of_drops_is_that_of_a_soft_target() {
        // All drops between 20 m and 21 m, in a beam of 60 mm, against the rain as a soft target of the same lidar ratio.
        let (rain, lidar_ratio) = (SizeDistribution::marshall_palmer(10.0), 18.8);
        let alpha = rain.extinction_per_m();
        let echoes = midpoint(20.0, 21.0, 100, |r| {
            let beam = [3e-3 * r; 2];
            let area = PI * beam[0] * beam[1] / 4.0;
            midpoint(0.0, 0.01, 10_000, |d| {
                let number = rain.intercept_per_m4 * libm::exp(-rain.slope_per_m * d) * area;
                number
                    * particle_echo(drop_reflectance(lidar_ratio), share_of_uniform_beam(d, beam), alpha, r)
            })
        });
        let soft = SoftTarget {
            extinction_per_m: alpha,
            lidar_ratio_sr: lidar_ratio,
            overlap_from_m: 0.9,
            overlap_to_m: 1.0,
            until_m: 100.0,
        };
        // The midpoint rule errs by (step·Λ)²/24, 3e-7, and by (step/range)², 3e-7.
        close(echoes, soft.energy(20.0, 21.0), 2e-6);
    }

    #[test]
    fn a_drops_face_is_lisas_floor() {
        agrees(drop_face_reflectance(1.328), 0.0198, 1.1e-4); // .01985 is printed as .0198
        agrees(2.0 * PI / drop_face_reflectance(1.328), 317.0, 1.0);
        agrees(drop_reflectance(5.0), 1.26, 0.01);
        let echo = particle_echo(0.0198, 1e-4, 1.5e-3, 20.0);
        close(echo, 0.0198 * 1e-4 * air::two_way_transmission(1.5e-3, 20.0) / 400.0, 1e-15);
    }
}
