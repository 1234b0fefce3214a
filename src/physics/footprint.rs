//! Where the light of a beam goes: a Gaussian profile, sampled by sub-rays of equal energy.
//!
//! The irradiance of a beam at the distance r from its axis is proportional to exp(−2r²/w²), where w is the radius at which it has
//! fallen to 1/e² (A. E. Siegman, "Lasers", 1986, §17.1). Elliptical beams have a w for each of two axes; here positions are
//! counted in w of their axis, so that every beam is a circle.

use libm::{cos, sin};

/// The full width at half of the maximum of a Gaussian, in units of its standard deviation: 2·√(2 ln 2).
pub const FWHM_IN_SIGMA: f64 = 2.354_820_045_030_949_4;

/// The full width at 1/e² of the maximum, in units of the full width at half of the maximum: 2/√(2 ln 2).
pub const E2_IN_FWHM: f64 = 1.698_643_600_576_038;

/// The number of sub-rays that a beam is sampled by.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Samples {
    /// The axis alone.
    One,
    /// The axis and a ring of 6.
    #[default]
    Seven,
    /// The axis and rings of 6 and 12.
    Nineteen,
    /// The axis and rings of 6, 12 and 18.
    ThirtySeven,
}

/// A ring of sub-rays: their number, the ring's radius in w, and the angle of the first of them in degrees.
struct Ring(usize, f64, f64);

/// The rings of [`Samples::Seven`] and more. The radii and angles make the largest error small that a half-plane's share of the
/// energy can have, over all directions and offsets of its edge. They were found by minimisation for this program; then all radii
/// were multiplied by one factor so that the second moment along any axis is w²/4, as it is for the beam. The spread of ranges
/// over a slanted surface is right therefore, and the largest error of a half-plane's share is 0.214, 0.109 and 0.066, where it
/// would be 0.214, 0.099 and 0.063 without the factor.
const SEVEN: &[Ring] = &[Ring(6, 0.654, 23.0)];
#[expect(clippy::approx_constant, reason = "a minimised radius that is near π/4 by chance")]
const NINETEEN: &[Ring] = &[Ring(6, 0.3182, 0.0), Ring(12, 0.7854, 15.0)];
const THIRTY_SEVEN: &[Ring] = &[Ring(6, 0.2236, 14.7), Ring(12, 0.4527, 29.7), Ring(18, 0.8731, 5.0)];

impl Samples {
    /// Every choice with its number.
    pub const ALL: [(usize, Self); 4] =
        [(1, Self::One), (7, Self::Seven), (19, Self::Nineteen), (37, Self::ThirtySeven)];

    /// The number of sub-rays.
    pub fn count(self) -> usize {
        1 + self.rings().iter().map(|Ring(count, ..)| count).sum::<usize>()
    }

    fn rings(self) -> &'static [Ring] {
        match self {
            Self::One => &[],
            Self::Seven => SEVEN,
            Self::Nineteen => NINETEEN,
            Self::ThirtySeven => THIRTY_SEVEN,
        }
    }

    /// The places of the sub-rays in the beam's profile, in w of each axis, the axis of the beam first. All carry the same energy.
    pub fn places(self) -> Vec<[f64; 2]> {
        let count = self.count() as f64;
        // The second moment along an axis of n points on a ring of radius r is n·r²/2, whatever the angles.
        let moment: f64 =
            self.rings().iter().map(|Ring(n, r, _)| *n as f64 * r * r / 2.0).sum::<f64>() / count;
        let factor = if moment > 0.0 { (0.25 / moment).sqrt() } else { 0.0 };
        let mut places = vec![[0.0; 2]];
        for Ring(n, radius, first_deg) in self.rings() {
            for i in 0..*n {
                let angle = (first_deg + 360.0 * i as f64 / *n as f64).to_radians();
                places.push([factor * radius * cos(angle), factor * radius * sin(angle)]);
            }
        }
        places
    }
}

/// The share of a beam's energy on the far side of a straight edge at the distance `offset` from its axis, in w:
/// ½·erfc(√2·d/w), the integral of the profile.
pub fn beyond_edge(offset: f64) -> f64 {
    0.5 * libm::erfc(std::f64::consts::SQRT_2 * offset)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The figures of the module's constants. For each direction of the edge, the largest error is where the edge passes a sub-ray,
    /// on one of its sides. The directions are a quarter of a degree apart, which moves the errors by less than the last digit.
    #[test]
    fn shares_beyond_an_edge_are_as_exact_as_stated() {
        for (samples, largest) in [
            (Samples::One, 0.5),
            (Samples::Seven, 0.214),
            (Samples::Nineteen, 0.109),
            (Samples::ThirtySeven, 0.066),
        ] {
            let places = samples.places();
            let share = 1.0 / places.len() as f64;
            let mut worst = 0.0_f64;
            for step in 0..1440 {
                let angle = (f64::from(step) / 4.0).to_radians();
                let mut offsets: Vec<_> =
                    places.iter().map(|[x, y]| x * cos(angle) + y * sin(angle)).collect();
                offsets.sort_by(f64::total_cmp);
                for (below, offset) in offsets.iter().enumerate() {
                    let beyond = 1.0 - below as f64 * share;
                    let errors = [beyond, beyond - share].map(|share| (share - beyond_edge(*offset)).abs());
                    worst = worst.max(errors[0]).max(errors[1]);
                }
            }
            assert!((worst - largest).abs() < 5e-4, "{samples:?}: {worst}");
        }
    }

    #[test]
    fn the_second_moment_is_that_of_the_beam_along_every_axis() {
        for (number, samples) in Samples::ALL {
            let places = samples.places();
            assert_eq!((places.len(), samples.count()), (number, number));
            if number == 1 {
                continue;
            }
            for angle in [0.0, 0.3, 1.0, 2.2] {
                let along = |[x, y]: &[f64; 2]| x * cos(angle) + y * sin(angle);
                let mean = places.iter().map(along).sum::<f64>() / number as f64;
                let moment = places.iter().map(|p| along(p) * along(p)).sum::<f64>() / number as f64;
                assert!(mean.abs() < 1e-15 && (moment - 0.25).abs() < 1e-15, "{number}: {mean} {moment}");
            }
        }
    }

    /// An edge half a w from the axis hides all but 15.866 % of a beam.
    #[test]
    fn the_share_beyond_an_edge_is_an_error_function() {
        assert!((beyond_edge(0.5) - 0.158_655).abs() < 1e-6);
        assert_eq!(beyond_edge(0.0), 0.5);
        // A pole of width w in the middle: 68.269 %.
        assert!((beyond_edge(-0.5) - beyond_edge(0.5) - 0.682_689).abs() < 1e-6);
        assert!((FWHM_IN_SIGMA - (8.0 * libm::log(2.0)).sqrt()).abs() < 1e-15);
        assert!((E2_IN_FWHM - 2.0 / (2.0 * libm::log(2.0)).sqrt()).abs() < 1e-15);
    }
}
