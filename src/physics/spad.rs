//! Single-photon avalanche diodes (SPADs): the first count in each cycle, and pile-up, by which a count blinds the detector for those
//! that come soon after it. `histogram` is about histograms of counts over many cycles, and the echoes in them.
//!
//! Source: P. B. Coates, "The correction for photon 'pile-up' in the measurement of radiative lifetimes", J. Phys. E 1, 878
//! (1968). Counts are a Poisson process: a bin with the mean λ has none with the probability exp(−λ).

/// The probability that a cycle has no count before a target: exp(−λ), with the mean number λ of counts before it.
pub fn survival(mean_before: f64) -> f64 {
    libm::exp(-mean_before)
}

/// The probability that a cycle's first count is the target's: exp(−λ)·(1 − exp(−s)).
///
/// `mean_before` is λ, the mean number of background counts before the target, and `mean_target` is s, the mean number of counts
/// in the target's bin.
pub fn target_wins(mean_before: f64, mean_target: f64) -> f64 {
    -libm::expm1(-mean_target) * survival(mean_before)
}

/// The probability that a cycle's first count lies in each bin: P_k = (1 − exp(−λ_k))·exp(−Σ_{j<k} λ_j).
///
/// `means` are λ_k, the mean numbers of counts of the bins in the order of time. The rest to 1 is the probability of no count.
pub fn first_counts(means: &[f64]) -> Vec<f64> {
    let mut before = 0.0;
    means
        .iter()
        .map(|&mean| {
            let probability = target_wins(before, mean);
            before += mean;
            probability
        })
        .collect()
}

/// The mean numbers of counts of the bins from the shares of cycles whose first count lies in each: Coates's correction,
/// λ_k = −ln(1 − P_k/(1 − Σ_{j<k} P_j)). It undoes [`first_counts`].
///
/// A bin with all the cycles that were left has an infinite mean, and the bins behind it have none that could be known: 0.
pub fn means_of_first_counts(shares: &[f64]) -> Vec<f64> {
    let mut left = 1.0;
    shares
        .iter()
        .map(|&share| {
            if left <= 0.0 {
                return 0.0;
            }
            let mean = -libm::log1p(-(share / left).min(1.0));
            left -= share;
            mean
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::super::testing::{agrees, close};
    use super::*;

    #[test]
    fn a_background_of_one_count_leaves_a_third_of_the_cycles() {
        // Printed in percent, with three digits and with one.
        agrees(100.0 * survival(1.0), 36.8, 0.1);
        agrees(100.0 * survival(3.0), 5.0, 1.0);
        // A target that always counts wins whenever it is reached.
        close(target_wins(1.0, 100.0), survival(1.0), 1e-15);
        assert_eq!(target_wins(0.0, 0.0), 0.0);
    }

    #[test]
    fn first_counts_and_no_count_are_all_that_happens() {
        let means = [0.3, 0.0, 2.0, 0.01, 0.7];
        let counts = first_counts(&means);
        close(counts.iter().sum::<f64>() + survival(means.iter().sum()), 1.0, 1e-15);
        assert_eq!(counts[1], 0.0);
        assert!(first_counts(&[]).is_empty());
    }

    #[test]
    fn fine_bins_are_an_exponential_in_time() {
        // A constant rate of 2 a unit of time: the density of the first count is 2·exp(−2t).
        let counts = first_counts(&[2e-3; 3000]);
        // A bin of 1e-3 holds (1 − exp(−.002))/.002 of the density at its beginning, 1e-3 less.
        close(counts[1000] * 1000.0, 2.0 * libm::exp(-2.0), 1.1e-3);
    }

    #[test]
    fn many_counts_at_random_have_the_probabilities() {
        // Cycles of two bins, over all pairs of whether each has a count, weighted by their probabilities.
        let [a, b] = [0.4_f64, 1.3];
        let none = [survival(a), survival(b)];
        let first = 1.0 - none[0];
        let second = none[0] * (1.0 - none[1]);
        let counts = first_counts(&[a, b]);
        close(counts[0], first, 1e-15);
        close(counts[1], second, 1e-15);
    }

    #[test]
    fn coates_undoes_pile_up() {
        let means = [0.3, 0.0, 2.0, 0.01, 0.7];
        for (found, mean) in means_of_first_counts(&first_counts(&means)).into_iter().zip(means) {
            // The cycles that are left, 10 %, carry the roundings of their differences, 1e-15 of them.
            assert!((found - mean).abs() < 1e-14);
        }
        assert_eq!(means_of_first_counts(&[1.0, 0.0]), [f64::INFINITY, 0.0]);
    }
}
