//! A pane of two parallel faces in air: a window, a windscreen.

use super::fresnel::{Polarised, dielectric_reflectance, refracted_cosine};

/// A pane of two parallel faces in air. The light of its inner reflections adds up without interference, as panes are thicker
/// than the coherence length of a pulsed laser diode, which is a fraction of a millimetre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pane {
    /// The refractive index relative to air, 1 or more. Window glass has 1.51 at 905 nm.
    pub index: f64,
    /// The thickness in metres.
    pub thickness_m: f64,
    /// The absorption within the pane per metre.
    pub absorption_per_m: f64,
}

impl Pane {
    /// A pane that absorbs nothing.
    pub fn clear(index: f64, thickness_m: f64) -> Self {
        Self { index, thickness_m, absorption_per_m: 0.0 }
    }

    /// The share of light that passes, one way: T = (1 − R)²·τ/(1 − R²τ²), with Fresnel's R of one face and the share
    /// τ = exp(−a·d/cosθt) that passes the glass between them. A clear pane has T = (1 − R)/(1 + R).
    ///
    /// The factor on the echo of a target behind the pane is [`Polarised::two_way_scrambled`] of it if the target scrambles the
    /// polarisation, and [`Polarised::two_way_kept`] if it keeps it.
    pub fn transmission(&self, cosine: f64) -> Polarised {
        let inner = self.inner_transmission(cosine);
        dielectric_reflectance(cosine, self.index).map(|r| {
            // At grazing incidence R is 1 and the quotient of a clear pane is 0/0; its limit is 0.
            if r < 1.0 { (1.0 - r) * (1.0 - r) * inner / (1.0 - r * r * inner * inner) } else { 0.0 }
        })
    }

    /// The share of light that both faces reflect, one way: R·(1 + τ·T), with [`Self::transmission`]'s R, τ and T. A clear pane
    /// has 2R/(1 + R).
    pub fn reflectance(&self, cosine: f64) -> Polarised {
        let (inner, passed) = (self.inner_transmission(cosine), self.transmission(cosine));
        let face = dielectric_reflectance(cosine, self.index);
        Polarised { s: face.s * (1.0 + inner * passed.s), p: face.p * (1.0 + inner * passed.p) }
    }

    /// The length in metres by which the pane makes an optical path longer than the same path in air, one way, and thus the
    /// error of a range through it: n·d/cosθt − d·cos(θ − θt)/cosθt = d·(n·cosθt − cosθ). It is (n − 1)·d at normal
    /// incidence.
    pub fn delay_m(&self, cosine: f64) -> f64 {
        self.thickness_m * (self.index * self.inner_cosine(cosine) - cosine)
    }

    /// The distance in metres between the line of a ray before the pane and its parallel line behind it:
    /// d·sin(θ − θt)/cosθt = d·sinθ·(1 − cosθ/(n·cosθt)). The ray is shifted in the plane of incidence, toward the normal that
    /// points away from the side it came from.
    pub fn shift_m(&self, cosine: f64) -> f64 {
        if self.index == 1.0 {
            return 0.0; // at grazing incidence the quotient below would be 0/0
        }
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        self.thickness_m * sine * (1.0 - cosine / (self.index * self.inner_cosine(cosine)))
    }

    fn inner_cosine(&self, cosine: f64) -> f64 {
        // An index of 1 or more refracts light at every angle.
        refracted_cosine(cosine, self.index).unwrap_or(0.0)
    }

    fn inner_transmission(&self, cosine: f64) -> f64 {
        if self.absorption_per_m == 0.0 {
            return 1.0;
        }
        libm::exp(-self.absorption_per_m * self.thickness_m / self.inner_cosine(cosine))
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::super::testing::{agrees, close};
    use super::*;

    fn cosine_deg(degrees: f64) -> f64 {
        libm::cos(degrees * PI / 180.0)
    }

    #[test]
    fn an_oblique_pane_costs_more_there_and_back() {
        // The figures are for a target that keeps the polarisation. They were computed apart from this code, with three digits.
        for (index, degrees, printed) in [
            (1.5, 0.0, 0.852),
            (1.5, 45.0, 0.829),
            (1.5, 60.0, 0.741),
            (1.5, 70.0, 0.567),
            (1.5, 80.0, 0.235),
            (1.33, 0.0, 0.923),
            (1.33, 60.0, 0.808),
        ] {
            agrees(Pane::clear(index, 0.006).transmission(cosine_deg(degrees)).two_way_kept(), printed, 1e-3);
        }
    }

    #[test]
    fn a_target_that_scrambles_polarisation_is_dimmer_behind_an_oblique_pane() {
        let pane = Pane::clear(1.5, 0.006);
        let passed = pane.transmission(cosine_deg(60.0));
        // By hand: Rs = .17657 and Rp = .00180, so that Ts = .69985 and Tp = .99640; the square of their mean is .7193.
        agrees(passed.two_way_scrambled(), 0.719, 1e-3);
        assert!(passed.two_way_scrambled() < passed.two_way_kept());
        let straight = pane.transmission(1.0);
        close(straight.two_way_scrambled(), straight.two_way_kept(), 1e-15);
    }

    #[test]
    fn a_pane_mirrors_half_a_percent_there_and_back() {
        // The figures have two digits for a target that scrambles the polarisation, and three for one that keeps it.
        let pane = Pane::clear(1.5, 0.006);
        agrees(pane.reflectance(1.0).two_way_scrambled(), 0.0059, 1e-4);
        agrees(pane.reflectance(cosine_deg(60.0)).two_way_scrambled(), 0.023, 1e-3);
        agrees(pane.reflectance(cosine_deg(60.0)).two_way_kept(), 0.0451, 1e-4);
    }

    #[test]
    fn what_passes_is_the_sum_over_all_inner_reflections() {
        let pane = Pane { index: 1.5, thickness_m: 0.006, absorption_per_m: 20.0 };
        let cosine = cosine_deg(70.0);
        let face = dielectric_reflectance(cosine, 1.5).s;
        let inner = libm::exp(-20.0 * 0.006 / refracted_cosine(cosine, 1.5).unwrap());
        let (mut passed, mut reflected, mut within) = (0.0, face, 1.0 - face);
        for _ in 0..100 {
            within *= inner;
            passed += within * (1.0 - face);
            within *= face * inner;
            reflected += within * (1.0 - face);
            within *= face;
        }
        // The light that is left after 200 inner reflections of 30 % is below any rounding; the sums took a hundred roundings.
        close(pane.transmission(cosine).s, passed, 1e-13);
        close(pane.reflectance(cosine).s, reflected, 1e-13);
    }

    #[test]
    fn a_pane_keeps_or_loses_energy_and_never_gains_any() {
        let (clear, tinted) =
            (Pane::clear(1.5, 0.006), Pane { index: 1.5, thickness_m: 0.006, absorption_per_m: 30.0 });
        for i in 0..=1000 {
            let cosine = f64::from(i) / 1000.0;
            let sum = |pane: &Pane| {
                let (passed, reflected) = (pane.transmission(cosine), pane.reflectance(cosine));
                [passed.s + reflected.s, passed.p + reflected.p]
            };
            for total in sum(&clear) {
                // The sum takes fewer than ten roundings of 1.1e-16.
                assert!((total - 1.0).abs() < 1e-14, "{total} at {cosine}");
            }
            for total in sum(&tinted) {
                assert!((0.0..=1.0).contains(&total));
            }
        }
    }

    #[test]
    fn a_pane_of_6_mm_delays_by_3_mm_and_shifts_when_oblique() {
        let pane = Pane::clear(1.5, 0.006);
        // By hand: 3 mm across the ray; at 60°, the delay of 4.348 mm and the shift of 3.075 mm are given to 1 µm.
        close(pane.delay_m(1.0), 0.003, 1e-15);
        agrees(pane.delay_m(cosine_deg(60.0)), 4.348e-3, 1e-6);
        agrees(pane.shift_m(cosine_deg(60.0)), 3.075e-3, 1e-6);
        assert_eq!(pane.shift_m(1.0), 0.0);
        assert_eq!(pane.shift_m(0.0), 0.006);
        assert_eq!(Pane::clear(1.0, 0.006).shift_m(0.0), 0.0);
    }

    #[test]
    fn delay_and_shift_follow_from_a_traced_ray() {
        // The ray enters at the origin under 35° and leaves at depth d, shifted along the face by d·tanθt.
        let (angle, d, n) = (35.0 * PI / 180.0, 0.01, 1.6);
        let inside = libm::asin(libm::sin(angle) / n);
        let (along, depth) = (d * libm::tan(inside), d);
        let (x, z) = (libm::sin(angle), libm::cos(angle));
        let pane = Pane::clear(n, d);
        // Each takes some ten roundings of 1.1e-16.
        close(pane.delay_m(z), n * d / libm::cos(inside) - (along * x + depth * z), 1e-14);
        close(pane.shift_m(z), depth * x - along * z, 1e-14);
    }
}
