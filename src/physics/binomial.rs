//! The binomial distribution: counts of successes in trials that do not know of each other.

use libm::{exp, lgamma, log, log1p};

/// The probability of exactly `k` successes in so many trials, each with the probability `p`, in (0, 1).
fn exactly(trials: u32, p: f64, k: u32) -> f64 {
    let [n, k] = [trials, k].map(f64::from);
    let log_choose = lgamma(n + 1.0) - lgamma(k + 1.0) - lgamma(n - k + 1.0);
    exp(log_choose + k * log(p) + (n - k) * log1p(-p))
}

/// The probability of `k` successes or more in so many trials, each with the probability `p`.
///
/// The shorter tail is summed up, of which each term follows from the one before, until terms are below 2⁻⁵³ of the sum.
pub fn at_least(trials: u32, p: f64, k: u32) -> f64 {
    if k == 0 || p >= 1.0 {
        return f64::from(u8::from(k <= trials));
    }
    if k > trials || p <= 0.0 {
        return 0.0;
    }
    let odds = p / (1.0 - p);
    let is_upper = f64::from(k) > f64::from(trials) * p;
    let start = if is_upper { k } else { k - 1 };
    let (mut sum, mut term, mut at) = (0.0, exactly(trials, p, start), start);
    loop {
        sum += term;
        match is_upper {
            true if at < trials => {
                term *= odds * f64::from(trials - at) / f64::from(at + 1);
                at += 1;
            }
            false if at > 0 => {
                term *= f64::from(at) / (odds * f64::from(trials - at + 1));
                at -= 1;
            }
            _ => break,
        }
        if term <= f64::EPSILON * 0.5 * sum {
            break;
        }
    }
    if is_upper { sum } else { 1.0 - sum }
}

/// The least number of successes that is reached with at most the probability `most`; one more than the trials if there is none.
pub fn least_reached(trials: u32, p: f64, most: f64) -> u32 {
    let (mut low, mut high) = (0, trials + 1);
    while low < high {
        let middle = low + (high - low) / 2;
        match at_least(trials, p, middle) <= most {
            true => high = middle,
            false => low = middle + 1,
        }
    }
    low
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tails_are_sums_of_the_distribution() {
        for (n, p) in [(1, 0.3), (5, 0.5), (30, 0.07), (200, 0.9), (1000, 0.02)] {
            let mut tail = 0.0;
            for k in (0..=n).rev() {
                tail += exactly(n, p, k);
                // The logarithms of factorials of 1000 are some 6000, and carry 6000·2⁻⁵³ = 7·10⁻¹³.
                assert!((at_least(n, p, k) - tail).abs() < 3e-12, "{n} {p} {k}");
            }
            assert!((tail - 1.0).abs() < 3e-12);
        }
        // A coin five times: 26 of 32 ways have two heads or more.
        assert!((at_least(5, 0.5, 2) - 26.0 / 32.0).abs() < 1e-14);
        assert_eq!(
            [at_least(5, 0.0, 0), at_least(5, 0.0, 1), at_least(5, 1.0, 5), at_least(5, 1.0, 6)],
            [1.0, 0.0, 1.0, 0.0]
        );
    }

    #[test]
    fn the_least_count_is_rare_and_one_less_is_not() {
        for (n, p, most) in [(1000, 0.01, 1e-4), (50, 0.3, 1e-2), (100_000, 0.2, 1e-6)] {
            let k = least_reached(n, p, most);
            assert!(at_least(n, p, k) <= most && at_least(n, p, k - 1) > most, "{n} {p}: {k}");
        }
        assert_eq!(least_reached(4, 0.9, 0.1), 5);
        assert_eq!(least_reached(4, 0.0, 0.1), 1);
    }
}
