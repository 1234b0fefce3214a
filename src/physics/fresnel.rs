//! Snell's law, and the reflectance of a face between two media for both polarisations.
//!
//! Sources: M. Born and E. Wolf, "Principles of Optics" (1999), §1.5.2 for Fresnel's formulas; S. Q. Duntley, "The optical
//! properties of diffusing materials", J. Opt. Soc. Am. 32, 61 (1942) for their mean over diffuse light.

/// A share of energy for light polarised across the plane of incidence (s) and for light polarised in it (p).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Polarised {
    /// The share of s-polarised light.
    pub s: f64,
    /// The share of p-polarised light.
    pub p: f64,
}

impl Polarised {
    /// The same share for both polarisations.
    pub fn equal(share: f64) -> Self {
        Self { s: share, p: share }
    }

    /// The share of unpolarised light: the mean of both.
    pub fn unpolarised(self) -> f64 {
        0.5 * (self.s + self.p)
    }

    /// The share of unpolarised light that passes there and back, where the target between scrambles the polarisation, as a
    /// Lambert surface does: the square of the mean.
    pub fn two_way_scrambled(self) -> f64 {
        self.unpolarised() * self.unpolarised()
    }

    /// The share of unpolarised light that passes there and back, where the target between keeps the polarisation, as a mirror
    /// or a bare metal does: the mean of the squares. It is never less than [`Self::two_way_scrambled`].
    pub fn two_way_kept(self) -> f64 {
        0.5 * (self.s * self.s + self.p * self.p)
    }

    /// The result of a function of a share, for both polarisations.
    pub fn map(self, f: impl Fn(f64) -> f64) -> Self {
        Self { s: f(self.s), p: f(self.p) }
    }
}

/// The cosine of the angle of refraction by Snell's law: cosθt = √(1 − (1 − cos²θ)/n²).
///
/// `index` is n, the refractive index behind the face over the one before it. There is none at total internal reflection.
pub fn refracted_cosine(cosine: f64, index: f64) -> Option<f64> {
    let squared = 1.0 - (1.0 - cosine * cosine) / (index * index);
    (squared >= 0.0).then(|| squared.sqrt())
}

/// The reflectance of a dielectric face by Fresnel's formulas, with the exact angle of refraction:
/// Rs = ((cosθ − n·cosθt)/(cosθ + n·cosθt))² and Rp = ((n·cosθ − cosθt)/(n·cosθ + cosθt))².
///
/// `index` is n, the refractive index behind the face over the one before it. Total internal reflection gives 1, and so does
/// grazing incidence. An index of 1 is no face: it reflects nothing.
pub fn dielectric_reflectance(cosine: f64, index: f64) -> Polarised {
    if index == 1.0 {
        return Polarised::equal(0.0);
    }
    let Some(inside) = refracted_cosine(cosine, index) else { return Polarised::equal(1.0) };
    let s = (cosine - index * inside) / (cosine + index * inside);
    let p = (index * cosine - inside) / (index * cosine + inside);
    Polarised { s: s * s, p: p * p }
}

/// A face that reflects as a mirror does.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Face {
    /// A transparent medium.
    Dielectric {
        /// The refractive index behind the face over the one before it.
        index: f64,
    },
    /// A metal, whose reflectance is taken as the same at all angles and for both polarisations. A metal with the complex index
    /// 2 + 8i, near aluminium's at 905 nm, reflects .89 of unpolarised light at normal incidence and .85 at 70°.
    Conductor {
        /// The reflectance, 0 to 1.
        reflectance: f64,
    },
}

impl Face {
    /// The reflectance at an angle of incidence.
    pub fn reflectance(self, cosine: f64) -> Polarised {
        match self {
            Self::Dielectric { index } => dielectric_reflectance(cosine, index),
            Self::Conductor { reflectance } => Polarised::equal(reflectance),
        }
    }
}

/// The factor on the echo of a target that is seen by mirrors: the product of the squares of their reflectances, as light takes
/// the path in both directions. The reflectances are those of unpolarised light.
pub fn mirror_path_factor(reflectances: &[f64]) -> f64 {
    reflectances.iter().map(|reflectance| reflectance * reflectance).product()
}

/// The reflectance of a dielectric face for diffuse light that comes from the thinner medium: the mean of Fresnel's reflectance
/// over a hemisphere, weighted by the cosine (Duntley 1942, in closed form).
///
/// `index` is the refractive index of the denser medium over the thinner one, more than 1. Water, 1.33, has .0659.
pub fn diffuse_outer_reflectance(index: f64) -> f64 {
    let n = index;
    let n2 = n * n;
    let (plus, minus) = (n2 + 1.0, n2 - 1.0);
    let n4_minus_1 = plus * minus;
    0.5 + (n - 1.0) * (3.0 * n + 1.0) / (6.0 * (n + 1.0) * (n + 1.0))
        + n2 * minus * minus / (plus * plus * plus) * libm::log((n - 1.0) / (n + 1.0))
        - 2.0 * n * n2 * (n2 + 2.0 * n - 1.0) / (plus * n4_minus_1)
        + 8.0 * n2 * n2 * (n2 * n2 + 1.0) / (plus * n4_minus_1 * n4_minus_1) * libm::log(n)
}

/// The reflectance of a dielectric face for diffuse light that comes from the denser medium: 1 − (1 − r)/n², with the outer
/// reflectance r, by reciprocity and with the light beyond the critical angle.
///
/// `index` is the refractive index of the denser medium over the thinner one, more than 1. Water, 1.33, has .4719.
pub fn diffuse_inner_reflectance(index: f64) -> f64 {
    1.0 - (1.0 - diffuse_outer_reflectance(index)) / (index * index)
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::super::testing::{agrees, close, midpoint};
    use super::*;

    fn cosine_deg(degrees: f64) -> f64 {
        libm::cos(degrees * PI / 180.0)
    }

    #[test]
    fn snells_law_holds_between_the_sines() {
        for degrees in [0.0, 20.0, 60.0, 89.0] {
            let inside = libm::acos(refracted_cosine(cosine_deg(degrees), 1.5).unwrap());
            // Sines are near 1 at most, and each took fewer than ten roundings of 1.1e-16; the arc cosine of a number near 1
            // magnifies one to its square root, 1e-8.
            assert!((libm::sin(degrees * PI / 180.0) - 1.5 * libm::sin(inside)).abs() < 1e-7);
        }
        assert_eq!(refracted_cosine(cosine_deg(60.0), 1.0 / 1.5), None);
    }

    #[test]
    fn water_reflects_a_third_of_the_light_at_80_degrees() {
        // The figures, computed apart from this code, have three digits after the point.
        for (degrees, printed) in [(0.0, 0.020), (60.0, 0.059), (80.0, 0.347)] {
            agrees(dielectric_reflectance(cosine_deg(degrees), 1.33).unpolarised(), printed, 1e-3);
        }
    }

    #[test]
    fn brewsters_angle_reflects_no_p_polarised_light() {
        let brewster = libm::cos(libm::atan(1.5));
        let reflectance = dielectric_reflectance(brewster, 1.5);
        // The amplitude vanishes but for a few roundings of 1.1e-16, and its square is their square.
        assert!(reflectance.p < 1e-30);
        // tanθ = n: the reflected s amplitude is (n² − 1)/(n² + 1).
        close(reflectance.s, (1.25 / 3.25) * (1.25 / 3.25), 1e-14);
    }

    #[test]
    fn both_sides_of_a_face_reflect_the_same_share() {
        for degrees in [0.0, 30.0, 75.0] {
            let outside = cosine_deg(degrees);
            let inside = refracted_cosine(outside, 1.5).unwrap();
            let (there, back) =
                (dielectric_reflectance(outside, 1.5), dielectric_reflectance(inside, 1.0 / 1.5));
            // The way back through Snell's law costs some ten roundings of 1.1e-16.
            assert!((there.s - back.s).abs() < 1e-14 && (there.p - back.p).abs() < 1e-14);
        }
    }

    #[test]
    fn no_face_reflects_more_than_it_gets() {
        for index in [1.0 / 1.5, 1.0, 1.33, 4.0] {
            for i in 0..=1000 {
                let reflectance = dielectric_reflectance(f64::from(i) / 1000.0, index);
                for share in [reflectance.s, reflectance.p] {
                    assert!((0.0..=1.0).contains(&share));
                }
            }
        }
    }

    #[test]
    fn energy_is_conserved_by_the_amplitudes_that_pass() {
        // Fresnel's transmitted amplitudes, 2cosθ/(cosθ + n·cosθt) and 2cosθ/(n·cosθ + cosθt), carry n·cosθt/cosθ of energy.
        let (c, n) = (cosine_deg(50.0), 1.5);
        let inside = refracted_cosine(c, n).unwrap();
        let reflectance = dielectric_reflectance(c, n);
        let (s, p) = (2.0 * c / (c + n * inside), 2.0 * c / (n * c + inside));
        let beam = n * inside / c;
        close(reflectance.s + s * s * beam, 1.0, 1e-15);
        close(reflectance.p + p * p * beam, 1.0, 1e-15);
    }

    #[test]
    fn diffuse_reflectances_are_the_means_over_a_hemisphere() {
        for index in [1.33, 1.5] {
            let outer =
                midpoint(0.0, 1.0, 100_000, |c| 2.0 * c * dielectric_reflectance(c, index).unpolarised());
            let inner = midpoint(0.0, 1.0, 100_000, |c| {
                2.0 * c * dielectric_reflectance(c, 1.0 / index).unpolarised()
            });
            // The integrand rises like a square root at the critical angle: the midpoint rule errs by about steps^-1.5, 3e-8.
            assert!((diffuse_outer_reflectance(index) - outer).abs() < 1e-7);
            assert!((diffuse_inner_reflectance(index) - inner).abs() < 1e-7);
        }
        // Lekner and Dorf's form for water is commonly given with .47.
        agrees(diffuse_inner_reflectance(1.33), 0.47, 0.01);
    }

    #[test]
    fn a_metal_reflects_nearly_the_same_share_at_all_angles() {
        // For |n|² = 68, the angle within the metal is nearly 0: Fresnel's formulas hold with a cosine of 1 there, up to 1/68.
        let (n, k) = (2.0, 8.0);
        let share = |a: f64, b: f64| ((a - b) * (a - b) + k * k) / ((a + b) * (a + b) + k * k);
        let mean = |c: f64| {
            let s = share(n, c);
            let p = ((n * c - 1.0) * (n * c - 1.0) + k * k * c * c)
                / ((n * c + 1.0) * (n * c + 1.0) + k * k * c * c);
            0.5 * (s + p)
        };
        agrees(mean(1.0), 0.89, 0.01);
        agrees(mean(cosine_deg(70.0)), 0.85, 0.01);
    }

    #[test]
    fn a_mirror_counts_twice() {
        // A mirror of 90 % costs a factor of .81.
        close(mirror_path_factor(&[0.9]), 0.81, 1e-15);
        close(mirror_path_factor(&[0.9, 0.8]), 0.81 * 0.64, 1e-15);
        assert_eq!(mirror_path_factor(&[]), 1.0);
        assert_eq!(Face::Conductor { reflectance: 0.9 }.reflectance(0.3).unpolarised(), 0.9);
        assert_eq!(Face::Dielectric { index: 1.5 }.reflectance(0.3), dielectric_reflectance(0.3, 1.5));
    }
}
