//! Values of a job that are drawn at random: the distributions of `[random]`, and what is drawn from them.
//!
//! A value follows from the job's seed, the frame's number and the name of its key, and from nothing else: any frame can be
//! drawn alone, and a further distribution leaves the values of the others as they are.

use std::collections::BTreeSet;

use serde_json::{Map, Value as Json};

use super::overlay;
use super::parse;
use super::table::Reading;
use crate::rng::Rng;
use crate::source::Span;
use crate::source::tree::{Entries, Entry, Node, Value};

/// A key of a job and the distribution of its value.
#[derive(Clone, Debug)]
pub(super) struct Drawn {
    /// The key as the job writes it, such as `sensor.top.pose.position_m[2]`.
    pub key: String,
    pub key_span: Span,
    /// The names and indices that the key consists of, outermost first; those of a lone sensor begin with its own.
    pub parts: Vec<String>,
    /// The place of the distribution, which is that of every value that is drawn from it.
    pub span: Span,
    pub law: Law,
    /// Whether all frames have the same value. Otherwise frames of different sensors with the same number have the same one.
    pub is_of_run: bool,
}

/// A distribution.
#[derive(Clone, Debug)]
pub(super) enum Law {
    /// Between the least and the most, which is greater.
    Uniform([f64; 2]),
    /// The same of the logarithm; both are greater than 0.
    LogUniform([f64; 2]),
    /// Cut off at two ends, between which at least [`LEAST_SHARE`] of the distribution lies, if there are any.
    Normal { mean: f64, deviation: f64, within: Option<[f64; 2]> },
    /// From the least to the most, both included.
    Integer([i64; 2]),
    /// One of the values, at least one. The weights are sums: each value's own, and those of all before it.
    Choice { values: Vec<Node>, weights: Vec<f64> },
}

/// The least part of a normal distribution that must lie within its ends.
pub(super) const LEAST_SHARE: f64 = 0.01;

/// How often a number that lies beyond its ends is drawn again. All of so many draws miss a hundredth of the distribution with
/// a probability of 0.99^10000 = 2e-44.
const MOST_DRAWS: usize = 10_000;

/// No number of [`Rng::normal`] is farther from 0.
const FARTHEST_DEVIATE: f64 = 8.58;

impl Law {
    fn draw(&self, rng: &mut Rng) -> Value {
        match self {
            &Self::Uniform(ends) => Value::Float(between(ends, rng.unit())),
            &Self::LogUniform([least, most]) => {
                let logarithm = between([libm::log(least), libm::log(most)], rng.unit());
                Value::Float(libm::exp(logarithm).clamp(least, most))
            }
            &Self::Normal { mean, deviation, within } => {
                let [least, most] = within.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
                let mut draws = (0..MOST_DRAWS).map(|_| mean + deviation * rng.normal());
                let found = draws.find(|value| (least..=most).contains(value));
                Value::Float(found.unwrap_or(mean.clamp(least, most)))
            }
            &Self::Integer([least, most]) => {
                let count = (i128::from(most) - i128::from(least) + 1) as usize;
                Value::Integer(i128::from(least) + rng.below(count) as i128)
            }
            Self::Choice { values, weights } => {
                let all = weights.last().copied().unwrap_or(0.0);
                let at = rng.unit() * all;
                let chosen = weights.partition_point(|sum| *sum <= at).min(values.len() - 1);
                values[chosen].value.clone()
            }
        }
    }

    /// The values at the ends of the distribution: all others lie between them, or these are all.
    pub fn ends(&self) -> Vec<Value> {
        let both = |ends: [f64; 2]| ends.map(Value::Float).to_vec();
        match self {
            &Self::Uniform(ends) | &Self::LogUniform(ends) => both(ends),
            &Self::Normal { mean, deviation, within } => {
                let reach = FARTHEST_DEVIATE * deviation;
                both(within.unwrap_or([mean - reach, mean + reach]))
            }
            Self::Integer(ends) => ends.map(|end| Value::Integer(end.into())).to_vec(),
            Self::Choice { values, .. } => values.iter().map(|value| value.value.clone()).collect(),
        }
    }
}

/// The number at a part of the way from the least to the most.
fn between([least, most]: [f64; 2], part: f64) -> f64 {
    (least + (most - least) * part).clamp(least, most)
}

impl Drawn {
    /// The value in a frame of a job with this seed.
    fn value(&self, seed: u64, frame: u64) -> Value {
        // No frame has the number of the run's values.
        let frame = if self.is_of_run { u64::MAX } else { frame };
        self.law.draw(&mut Rng::named(seed, frame, &self.key))
    }

    /// Puts a value into a job, at the place of this distribution. A key that addresses nothing is reported.
    pub fn put(&self, reading: Reading<'_>, job: &mut Entries, value: Value) {
        let mut node = Node { span: self.span, value };
        for part in self.parts.iter().skip(1).rev() {
            let table = Entries::from([(part.clone(), Entry { key: self.key_span, node })]);
            node = Node { span: self.span, value: Value::Table(table) };
        }
        if let Some(first) = self.parts.first() {
            let over = Entries::from([(first.clone(), Entry { key: self.key_span, node })]);
            overlay::lay_over(reading, job, over);
        }
    }
}

/// Puts the values of a frame into a job, and gives them by their keys.
pub(super) fn put_all(
    reading: Reading<'_>,
    draws: &[Drawn],
    job: &mut Entries,
    seed: u64,
    frame: u64,
) -> Map<String, Json> {
    let mut values = Map::new();
    for draw in draws {
        let value = draw.value(seed, frame);
        let node = Node { span: draw.span, value: value.clone() };
        values.insert(draw.key.clone(), parse::node_to_json(&node));
        draw.put(reading, job, value);
    }
    values
}

/// The draws whose values another one has replaced: those of which no value is left in the job.
pub(super) fn replaced<'d>(draws: &'d [Drawn], job: &Entries) -> Vec<&'d Drawn> {
    fn gather(entries: &Entries, seen: &mut BTreeSet<Span>) {
        entries.values().for_each(|entry| gather_node(&entry.node, seen));
    }
    fn gather_node(node: &Node, seen: &mut BTreeSet<Span>) {
        match &node.value {
            Value::Table(entries) => gather(entries, seen),
            Value::Array(elements) => elements.iter().for_each(|element| gather_node(element, seen)),
            _ => {
                seen.insert(node.span);
            }
        }
    }
    let mut seen = BTreeSet::new();
    gather(job, &mut seen);
    draws.iter().filter(|draw| !seen.contains(&draw.span)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const COUNT: u64 = 20_000;

    /// The values of a law in the first frames.
    fn drawn(law: Law, seed: u64) -> Vec<Value> {
        let at = Span::new(0, 0..0);
        let draw =
            Drawn { key: "a.b".to_owned(), key_span: at, parts: vec![], span: at, law, is_of_run: false };
        (0..COUNT).map(|frame| draw.value(seed, frame)).collect()
    }

    fn numbers(law: Law, seed: u64) -> Vec<f64> {
        let number = |value: &Value| match value {
            Value::Float(number) => *number,
            Value::Integer(number) => *number as f64,
            other => panic!("{}", other.describe()),
        };
        drawn(law, seed).iter().map(number).collect()
    }

    fn normal_below(z: f64) -> f64 {
        libm::erfc(-z * std::f64::consts::FRAC_1_SQRT_2) / 2.0
    }

    /// Holds draws to their distribution by its mean, its variance and its cumulative function F. The mean of n draws is off by
    /// less than five of its standard errors √(variance/n), and the mean square of what is off by less than five of its own,
    /// √((kurtosis − 1)·variance²/n), unless one of two million seeds was met; all kurtoses here are at most 3. By the
    /// inequality of Dvoretzky, Kiefer and Wolfowitz (with Massart's constant), the part of n draws below x differs from F(x)
    /// by more than ε somewhere with a probability of at most 2·exp(−2nε²), which is 1e-6 at ε = √(ln(2e6)/2n).
    fn hold(name: &str, draws: &mut [f64], (mean, variance): (f64, f64), below: impl Fn(f64) -> f64) {
        let n = draws.len() as f64;
        let found = draws.iter().sum::<f64>() / n;
        assert!((found - mean).abs() < 5.0 * (variance / n).sqrt(), "{name}: mean {found}, not {mean}");
        let found = draws.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / n;
        let error = 5.0 * (2.0 / n).sqrt() * variance;
        assert!((found - variance).abs() < error, "{name}: variance {found}, not {variance} ± {error}");
        draws.sort_by(f64::total_cmp);
        let most = (libm::log(2e6) / (2.0 * n)).sqrt();
        for (index, x) in draws.iter().enumerate() {
            let (before, up_to) = (index as f64 / n, (index + 1) as f64 / n);
            let off = (below(*x) - before).abs().max((up_to - below(*x)).abs());
            assert!(off <= most, "{name}: {off} at {x}, more than {most}");
        }
    }

    #[test]
    fn draws_have_their_distributions() {
        hold("uniform", &mut numbers(Law::Uniform([-2.0, 4.0]), 1), (1.0, 3.0), |x| (x + 2.0) / 6.0);
        // The mean of 1/(x ln r) between a and b = r·a is (b − a)/ln r, and that of x² is (b² − a²)/(2 ln r).
        let (least, most, log_ratio) = (0.5, 8.0, libm::log(16.0));
        let mean = (most - least) / log_ratio;
        let variance = (most * most - least * least) / (2.0 * log_ratio) - mean * mean;
        let below = |x: f64| libm::log(x / least) / log_ratio;
        hold("log_uniform", &mut numbers(Law::LogUniform([least, most]), 2), (mean, variance), below);
        let normal = |within| Law::Normal { mean: 3.0, deviation: 0.5, within };
        hold("normal", &mut numbers(normal(None), 3), (3.0, 0.25), |x| normal_below((x - 3.0) / 0.5));
        // Cut off at one standard deviation either way, the variance is σ²(1 − 2φ(1)/(Φ(1) − Φ(−1))).
        let share = 1.0 - 2.0 * normal_below(-1.0);
        let density = libm::exp(-0.5) / (2.0 * std::f64::consts::PI).sqrt();
        let below = |x: f64| (normal_below((x - 3.0) / 0.5) - normal_below(-1.0)) / share;
        let mut cut = numbers(normal(Some([2.5, 3.5])), 4);
        assert!(cut.iter().all(|x| (2.5..=3.5).contains(x)));
        hold("normal, cut off", &mut cut, (3.0, 0.25 * (1.0 - 2.0 * density / share)), below);
    }

    #[test]
    fn integers_and_choices_have_their_shares() {
        // A count of n draws with probability p is off by less than five of its standard errors √(np(1 − p)).
        let hold = |found: usize, p: f64| {
            let n = COUNT as f64;
            assert!((found as f64 - n * p).abs() < 5.0 * (n * p * (1.0 - p)).sqrt(), "{found} of {p}");
        };
        let integers = numbers(Law::Integer([-1, 2]), 5);
        for value in [-1.0, 0.0, 1.0, 2.0] {
            hold(integers.iter().filter(|x| **x == value).count(), 0.25);
        }
        let node = |text: &str| Node { span: Span::new(0, 0..0), value: Value::String(text.to_owned()) };
        let values = ["never", "often", "rarely"].map(node).to_vec();
        let choices = drawn(Law::Choice { values, weights: vec![0.0, 3.0, 4.0] }, 6);
        for (text, p) in [("never", 0.0), ("often", 0.75), ("rarely", 0.25)] {
            let is_it = |value: &&Value| matches!(value, Value::String(found) if found == text);
            match choices.iter().filter(is_it).count() {
                0 => assert_eq!(p, 0.0),
                count => hold(count, p),
            }
        }
    }

    #[test]
    fn a_distribution_of_one_value_gives_it() {
        let all_are = |law: Law, value: f64| numbers(law, 7).iter().all(|x| *x == value);
        assert!(all_are(Law::Uniform([0.1, 0.1]), 0.1));
        assert!(all_are(Law::LogUniform([0.1, 0.1]), 0.1));
        assert!(all_are(Law::Normal { mean: 0.1, deviation: 0.0, within: Some([0.0, 1.0]) }, 0.1));
        assert!(all_are(Law::Integer([i64::MAX, i64::MAX]), i64::MAX as f64));
    }
}
