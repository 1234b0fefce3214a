//! Random numbers by counter: a number depends on the purpose that it is drawn for, and not on how many were drawn before
//! it.
//!
//! The generator is Philox4x32-10 (J. K. Salmon, M. A. Moraes, R. O. Dror and D. E. Shaw, "Parallel random numbers: as easy
//! as 1, 2, 3", SC 2011): a bijection of 128-bit counters for each 64-bit key. Any number of any stream is computed on its
//! own, so results are the same on any number of threads and in any order of work.
//!
//! A simulation draws from [`FrameStreams`]: the seed, the sensor and the frame make the key; the pulse, the sample and the
//! effect make the counter.
//!
//! ```
//! use beamcast::rng::FrameStreams;
//!
//! const RANGE_NOISE: u32 = 1;
//! let (seed, sensor, frame) = (7, 0, 42);
//! let streams = FrameStreams::new(seed, sensor, frame);
//! let (pulse, sample) = (1800, 0);
//! let error_m = 0.02 * streams.stream(pulse, sample, RANGE_NOISE).normal();
//! assert_eq!(error_m, 0.02 * streams.stream(pulse, sample, RANGE_NOISE).normal());
//! ```

use std::f64::consts::TAU;

use glam::DVec3;

/// Philox4x32-10: the 128 random bits of a counter under a key.
pub fn philox(counter: [u32; 4], key: [u32; 2]) -> [u32; 4] {
    // The multipliers and the Weyl increments are those of the paper (tables 2 and 3).
    let multiply = |a: u32, b: u32| {
        let product = u64::from(a) * u64::from(b);
        ((product >> 32) as u32, product as u32)
    };
    let ([mut c0, mut c1, mut c2, mut c3], [mut k0, mut k1]) = (counter, key);
    for _ in 0..10 {
        let (high0, low0) = multiply(0xd251_1f53, c0);
        let (high1, low1) = multiply(0xcd9e_8d57, c2);
        (c0, c1, c2, c3) = (high1 ^ c1 ^ k0, low1, high0 ^ c3 ^ k1, low0);
        (k0, k1) = (k0.wrapping_add(0x9e37_79b9), k1.wrapping_add(0xbb67_ae85));
    }
    [c0, c1, c2, c3]
}

/// The streams of random numbers of one frame of one sensor.
#[derive(Clone, Copy, Debug)]
pub struct FrameStreams {
    key: [u32; 2],
}

impl FrameStreams {
    /// The streams of frame number `frame` of the rig's sensor number `sensor` in a job with this seed.
    ///
    /// The key is 64 of the 128 bits that Philox gives for the counter (sensor, frame, 0) under the seed. Two of n pairs of
    /// sensor and frame share a key with a probability of n²/2⁶⁵: 3·10⁻⁸ for a million frames.
    pub fn new(seed: u64, sensor: u32, frame: u64) -> Self {
        let [k0, k1, ..] = philox([sensor, frame as u32, (frame >> 32) as u32, 0], words(seed));
        Self { key: [k0, k1] }
    }

    /// The stream of an effect, for one sample of a pulse. Each effect has a number of its own, which never changes, so that a
    /// new effect leaves the numbers of the others as they are. Streams of a frame never overlap.
    pub fn stream(&self, pulse: u32, sample: u32, effect: u32) -> Rng {
        Rng { key: self.key, counter: [0, effect, sample, pulse], block: [0; 4], used: 4 }
    }
}

/// A stream of random numbers: 2³⁴ words of 32 bits, after which it begins again.
#[derive(Clone, Debug)]
pub struct Rng {
    key: [u32; 2],
    /// The counter of the next block. Its first word numbers the blocks of the stream, and the other words name the stream.
    counter: [u32; 4],
    block: [u32; 4],
    /// The number of words of the block that were drawn.
    used: usize,
}

impl Rng {
    /// A stream that depends on its seed alone, for draws that belong to no frame.
    pub fn new(seed: u64) -> Self {
        FrameStreams { key: words(seed) }.stream(0, 0, 0)
    }

    /// The stream of a quantity of a frame, by the quantity's name, for draws that belong to no sensor.
    ///
    /// The key is 64 of the 128 bits that Philox gives for the counter of the frame and 64 bits of the name's BLAKE3, under the
    /// seed. Two of n pairs of name and frame share a key with a probability of n²/2⁶⁵, as those of [`FrameStreams::new`].
    pub fn named(seed: u64, frame: u64, name: &str) -> Self {
        let hash = blake3::hash(name.as_bytes());
        let [a, b] = [0, 4].map(|at| {
            hash.as_bytes()[at..at + 4].iter().rev().fold(0, |word, byte| word << 8 | u32::from(*byte))
        });
        let [k0, k1, ..] = philox([a, b, frame as u32, (frame >> 32) as u32], words(seed));
        FrameStreams { key: [k0, k1] }.stream(0, 0, 0)
    }

    /// A number that is uniform over all 32-bit numbers.
    pub fn u32(&mut self) -> u32 {
        if self.used == self.block.len() {
            self.block = philox(self.counter, self.key);
            self.counter[0] = self.counter[0].wrapping_add(1);
            self.used = 0;
        }
        self.used += 1;
        self.block[self.used - 1]
    }

    /// A number that is uniform over all 64-bit numbers. It takes two words, the lower one first.
    pub fn u64(&mut self) -> u64 {
        u64::from(self.u32()) | u64::from(self.u32()) << 32
    }

    /// A number that is uniform in [0, 1), a multiple of 2⁻⁵³.
    pub fn unit(&mut self) -> f64 {
        (self.u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A number that is uniform in [−1, 1).
    pub fn signed(&mut self) -> f64 {
        2.0 * self.unit() - 1.0
    }

    /// A number that is uniform among 0 .. `count`, where `count` is not 0. The bias is less than `count`/2⁶⁴.
    pub fn below(&mut self, count: usize) -> usize {
        ((u128::from(self.u64()) * count as u128) >> 64) as usize
    }

    /// A number that is normally distributed with mean 0 and standard deviation 1. It is the cosine one of the two deviates
    /// of G. E. P. Box and M. E. Muller, "A note on the generation of random normal deviates" (1958): √(−2 ln u)·cos 2πv
    /// with u in (0, 1] and v in [0, 1). No value is farther from 0 than √(2 ln 2⁵³) = 8.57.
    pub fn normal(&mut self) -> f64 {
        let (u, v) = (1.0 - self.unit(), self.unit());
        (-2.0 * libm::log(u)).sqrt() * libm::cos(TAU * v)
    }

    /// The number of successes in so many trials, each of which succeeds with the probability `p`.
    ///
    /// If fewer than 10 are expected, the distribution is inverted, which takes one number. Else the draw is by algorithm BTRS of
    /// W. Hörmann, "The generation of binomial random variates", J. Stat. Comput. Simul. 46, 101 (1993): a transformed deviate is
    /// rejected by the distribution itself, so that both ways are exact but for the rounding of probabilities.
    pub fn binomial(&mut self, trials: u32, p: f64) -> u32 {
        if p > 0.5 {
            return trials - self.binomial(trials, 1.0 - p);
        }
        if trials == 0 || p.is_nan() || p <= 0.0 {
            return 0;
        }
        match f64::from(trials) * p < 10.0 {
            true => self.few_successes(trials, p),
            false => self.many_successes(f64::from(trials), p),
        }
    }

    fn few_successes(&mut self, trials: u32, p: f64) -> u32 {
        let odds = p / (1.0 - p);
        let mut left = self.unit();
        let mut probability = libm::exp(f64::from(trials) * libm::log1p(-p));
        for successes in 0..trials {
            if left < probability {
                return successes;
            }
            left -= probability;
            probability *= odds * f64::from(trials - successes) / f64::from(successes + 1);
            // Beyond 2⁻⁶⁰ the tail is less than a step of the uniform number.
            if successes > 20 && probability < 1e-18 {
                return successes + 1;
            }
        }
        trials
    }

    fn many_successes(&mut self, trials: f64, p: f64) -> u32 {
        let log_factorial = |k: f64| libm::lgamma(k + 1.0);
        let spread = (trials * p * (1.0 - p)).sqrt();
        // The constants of the paper's figure.
        let b = 1.15 + 2.53 * spread;
        let a = -0.0873 + 0.0248 * b + 0.01 * p;
        let centre = trials * p + 0.5;
        let alpha = (2.83 + 5.1 / b) * spread;
        let mode = ((trials + 1.0) * p).floor();
        loop {
            let (u, mut v) = (self.unit() - 0.5, self.unit());
            let from_edge = 0.5 - u.abs();
            let k = ((2.0 * a / from_edge + b) * u + centre).floor();
            if from_edge >= 0.07 && v <= 0.92 - 4.2 / b {
                return k as u32;
            }
            if !(0.0..=trials).contains(&k) {
                continue;
            }
            v *= alpha / (a / (from_edge * from_edge) + b);
            let over_mode = log_factorial(mode) + log_factorial(trials - mode)
                - log_factorial(k)
                - log_factorial(trials - k)
                + (k - mode) * (libm::log(p) - libm::log1p(-p));
            if libm::log(v) <= over_mode {
                return k as u32;
            }
        }
    }

    /// A point that is uniform in the cube from −1 to 1.
    pub fn point(&mut self) -> DVec3 {
        DVec3::new(self.signed(), self.signed(), self.signed())
    }

    /// A unit vector that is uniform over the sphere. Points of the cube are drawn until one lies in the unit ball and not
    /// so close to its centre that normalising it would lose digits.
    pub fn direction(&mut self) -> DVec3 {
        loop {
            let p = self.point();
            if (0.01..=1.0).contains(&p.length_squared()) {
                return p.normalize();
            }
        }
    }
}

/// The lower and the upper 32 bits of a 64-bit number.
fn words(bits: u64) -> [u32; 2] {
    [bits as u32, (bits >> 32) as u32]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(x: f64) -> f64 {
        x * x
    }

    /// The known answers for philox4x32-10 of the authors' library, Random123 (tests/kat_vectors).
    #[test]
    fn published_vectors() {
        assert_eq!(philox([0; 4], [0; 2]), [0x6627_e8d5, 0xe169_c58d, 0xbc57_ac4c, 0x9b00_dbd8]);
        assert_eq!(
            philox([u32::MAX; 4], [u32::MAX; 2]),
            [0x408f_276d, 0x41c8_3b0e, 0xa20b_c7c6, 0x6d54_51fd]
        );
        // The counter and the key are digits of π.
        let counter = [0x243f_6a88, 0x85a3_08d3, 0x1319_8a2e, 0x0370_7344];
        let answer = [0xd16c_fe09, 0x94fd_cceb, 0x5001_e420, 0x2412_6ea1];
        assert_eq!(philox(counter, [0xa409_3822, 0x299f_31d0]), answer);
    }

    #[test]
    fn a_stream_is_philox_of_successive_counters() {
        let mut rng = Rng::new(0x299f_31d0_a409_3822);
        for block in 0..3 {
            let words: [u32; 4] = std::array::from_fn(|_| rng.u32());
            assert_eq!(words, philox([block, 0, 0, 0], [0xa409_3822, 0x299f_31d0]));
        }
        let (mut halves, mut whole) = (Rng::new(5), Rng::new(5));
        let (low, high) = (halves.u32(), halves.u32());
        assert_eq!(whole.u64(), u64::from(high) << 32 | u64::from(low));
    }

    #[test]
    fn every_part_of_a_key_makes_another_stream() {
        let first = |(seed, sensor, frame): (u64, u32, u64), [pulse, sample, effect]: [u32; 3]| {
            FrameStreams::new(seed, sensor, frame).stream(pulse, sample, effect).u64()
        };
        let mut seen = vec![first((0, 0, 0), [0; 3])];
        for bit in 0..64 {
            seen.push(first((1 << bit, 0, 0), [0; 3]));
            seen.push(first((0, 0, 1 << bit), [0; 3]));
        }
        for bit in 0..32 {
            seen.push(first((0, 1 << bit, 0), [0; 3]));
            for part in 0..3 {
                let mut parts = [0; 3];
                parts[part] = 1 << bit;
                seen.push(first((0, 0, 0), parts));
            }
        }
        let count = seen.len();
        seen.sort_unstable();
        seen.dedup();
        assert_eq!(seen.len(), count);
    }

    #[test]
    fn every_part_of_a_name_makes_another_stream() {
        let first = |seed, frame, name: &str| Rng::named(seed, frame, name).u64();
        let mut seen = vec![first(0, 0, "")];
        seen.extend((0..64).flat_map(|bit| [first(1 << bit, 0, ""), first(0, 1 << bit, "")]));
        seen.extend(["a", "b", "aa", "pose.rpy_deg[0]", "pose.rpy_deg[1]"].map(|name| first(0, 0, name)));
        let count = seen.len();
        seen.sort_unstable();
        seen.dedup();
        assert_eq!(seen.len(), count);
        // BLAKE3 of no bytes begins with af1349b9 f5f9a1a6 (test_vectors.json of its authors): two little-endian words.
        let [k0, k1, ..] = philox([0xb949_13af, 0xa6a1_f9f5, 7, 0], [5, 0]);
        assert_eq!(first(5, 7, ""), FrameStreams { key: [k0, k1] }.stream(0, 0, 0).u64());
    }

    /// Checks the moments of a million draws. Each lies within six standard errors of the moment of the distribution.
    #[test]
    fn distributions_have_their_moments() {
        const COUNT: usize = 1_000_000;
        let mut rng = Rng::new(1);
        let mean = |draw: &mut dyn FnMut() -> f64| (0..COUNT).map(|_| draw()).sum::<f64>() / COUNT as f64;
        let close = |mean: f64, expected: f64, variance: f64| {
            let error = (variance / COUNT as f64).sqrt();
            assert!((mean - expected).abs() < 6.0 * error, "{mean} instead of {expected} ± {error}");
        };
        close(mean(&mut || rng.unit()), 0.5, 1.0 / 12.0);
        close(mean(&mut || square(rng.unit())), 1.0 / 3.0, 4.0 / 45.0);
        // The moments of the standard normal distribution are 0, 1, 0, 3, 0, 15, 0, 105.
        close(mean(&mut || rng.normal()), 0.0, 1.0);
        close(mean(&mut || square(rng.normal())), 1.0, 3.0 - 1.0);
        let cube = |x: f64| x * square(x);
        close(mean(&mut || cube(rng.normal())), 0.0, 15.0);
        close(mean(&mut || square(square(rng.normal()))), 3.0, 105.0 - 9.0);
        // A component of a direction is uniform between −1 and 1 (Archimedes).
        close(mean(&mut || rng.direction().z), 0.0, 1.0 / 3.0);
        close(mean(&mut || square(rng.direction().x)), 1.0 / 3.0, 4.0 / 45.0);
        close(mean(&mut || rng.below(7) as f64), 3.0, 4.0);
    }

    /// Counts of successes have the probabilities of the binomial distribution: χ² of 40,000 draws over k values is k − 1 ± √(2(k − 1)),
    /// and lies within five of its standard deviations. Both ways of drawing, and their border.
    #[test]
    fn successes_have_the_binomial_distribution() {
        const DRAWS: usize = 40_000;
        let mut rng = Rng::new(2);
        for (trials, p) in
            [(5, 0.3), (40, 0.02), (1000, 0.0099), (1000, 0.0101), (100, 0.4), (60, 0.8), (5000, 0.1)]
        {
            let mut counts = vec![0_u32; trials as usize + 1];
            (0..DRAWS).for_each(|_| counts[rng.binomial(trials, p) as usize] += 1);
            let (mut chi2, mut values, mut rest) = (0.0, 0.0, (DRAWS as f64, DRAWS as f64));
            for (k, &count) in (0..).zip(&counts) {
                let log_choose = libm::lgamma(f64::from(trials) + 1.0)
                    - libm::lgamma(f64::from(k) + 1.0)
                    - libm::lgamma(f64::from(trials - k) + 1.0);
                let log_p =
                    log_choose + f64::from(k) * libm::log(p) + f64::from(trials - k) * libm::log1p(-p);
                let expected = DRAWS as f64 * libm::exp(log_p);
                // Values of which fewer than 20 draws are expected count as one.
                if expected >= 20.0 {
                    chi2 += square(f64::from(count) - expected) / expected;
                    values += 1.0;
                    rest = (rest.0 - expected, rest.1 - f64::from(count));
                }
            }
            if rest.0 > 5.0 {
                chi2 += square(rest.1 - rest.0) / rest.0;
                values += 1.0;
            }
            let freedom: f64 = values - 1.0;
            assert!(
                (chi2 - freedom).abs() < 5.0 * (2.0 * freedom).sqrt(),
                "{trials} {p}: {chi2} of {freedom}"
            );
        }
        assert_eq!([(0, 0.5), (9, 0.0), (9, 1.0)].map(|(n, p)| rng.binomial(n, p)), [0, 0, 9]);
    }

    #[test]
    fn ranges_are_half_open() {
        let rng = |words: [u32; 2]| Rng { block: [0, 0, words[0], words[1]], used: 2, ..Rng::new(0) };
        let (mut least, mut most) = (rng([0; 2]), rng([u32::MAX; 2]));
        assert_eq!((least.clone().unit(), most.clone().unit()), (0.0, 1.0 - f64::EPSILON / 2.0));
        assert_eq!((least.below(3), most.below(3)), (0, 2));
    }
}
