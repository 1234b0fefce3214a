//! Keyframes: values over the time of a clip, interpolated as glTF 2.0 defines it (appendix C of its specification).

use std::sync::Arc;

use glam::{DQuat, DVec3};

use super::clock::Clock;

/// How the values between keys follow from those at the keys.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Blending {
    /// The value of the key before holds until the next key.
    Step,
    /// Values go straight from key to key; rotations turn at a constant rate, the shorter way (slerp).
    Linear,
    /// A cubic Hermite spline. Each key has three values: the tangent that arrives (a second), the value, and the tangent that
    /// leaves. Rotations are normalised.
    Cubic,
}

/// Values over the time of a clip. Before the first key its value holds, and after the last key that one's.
#[derive(Clone, Debug, PartialEq)]
pub struct Track<T> {
    times_s: Vec<f64>,
    values: Vec<T>,
    blending: Blending,
}

/// Why keys are no [`Track`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TrackProblem {
    /// There is no key.
    #[error("it has no keys")]
    Empty,
    /// The time of the key with this index is not greater than that of the key before, or not finite.
    #[error("the time of key {0} is not greater than that of the key before")]
    Times(usize),
    /// There are not as many values as the keys need.
    #[error("it has {has} values, and its keys need {needs}")]
    Values {
        /// The values that there are.
        has: usize,
        /// Those that the keys need: one for each, or three of a cubic spline.
        needs: usize,
    },
}

impl<T> Track<T> {
    /// A track of keys at these times, which rise. A cubic track has three values a key.
    ///
    /// # Errors
    /// [`TrackProblem`] if the times do not rise, or if the values are too many or too few.
    pub fn new(times_s: Vec<f64>, values: Vec<T>, blending: Blending) -> Result<Self, TrackProblem> {
        if times_s.is_empty() {
            return Err(TrackProblem::Empty);
        }
        let rises = |pair: &[f64]| pair[0] < pair[1];
        if let Some(index) = times_s.windows(2).position(|pair| !rises(pair)) {
            return Err(TrackProblem::Times(index + 1));
        }
        if let Some(index) = times_s.iter().position(|time| !time.is_finite()) {
            return Err(TrackProblem::Times(index));
        }
        let needs = times_s.len() * if blending == Blending::Cubic { 3 } else { 1 };
        if values.len() != needs {
            return Err(TrackProblem::Values { has: values.len(), needs });
        }
        Ok(Self { times_s, values, blending })
    }

    /// The same value at all times.
    pub fn rest(value: T) -> Self {
        Self { times_s: vec![0.0], values: vec![value], blending: Blending::Step }
    }

    /// The times of the keys.
    pub fn times_s(&self) -> &[f64] {
        &self.times_s
    }

    /// Whether the value is the same at all times, because there is one key.
    pub fn is_rest(&self) -> bool {
        self.times_s.len() == 1
    }

    /// The value of the last key at or before `time_s`; before the first, that of the first.
    pub fn held_at(&self, time_s: f64) -> &T {
        self.key(self.times_s.partition_point(|key| *key <= time_s).saturating_sub(1))
    }

    /// The value at a key.
    fn key(&self, index: usize) -> &T {
        &self.values[if self.blending == Blending::Cubic { 3 * index + 1 } else { index }]
    }

    /// The keys whose values hold at some time of a closed span.
    fn held_in(&self, from_s: f64, to_s: f64) -> impl Iterator<Item = &T> {
        let first = self.times_s.partition_point(|key| *key <= from_s).saturating_sub(1);
        let end = self.times_s.partition_point(|key| *key <= to_s).max(first + 1);
        (first..end).map(|index| self.key(index))
    }
}

impl Track<bool> {
    /// Whether the value is true at some time of a closed span.
    pub(super) fn is_true_in(&self, from_s: f64, to_s: f64) -> bool {
        self.held_in(from_s, to_s).any(|value| *value)
    }
}

/// Values that can be interpolated.
pub trait Blend: Clone {
    /// The sum of values, each times a number. There is at least one.
    fn sum<const N: usize>(terms: [(f64, &Self); N]) -> Self;

    /// The value the part `u` of the way from `a` to `b`, and its derivative by `u`.
    fn between(a: &Self, b: &Self, u: f64) -> (Self, Self) {
        (Self::sum([(1.0 - u, a), (u, b)]), Self::sum([(-1.0, a), (1.0, b)]))
    }

    /// The second derivative by `u` of the value the part `u` of the way from `a` to `b`.
    fn bend_between(a: &Self, _b: &Self, _u: f64) -> Self {
        Self::sum([(0.0, a)])
    }

    /// The value that a spline's is used as, and its derivative, from the spline's own two.
    fn settle(value: Self, rate: Self) -> (Self, Self) {
        (value, rate)
    }

    /// The second derivative of the value that a spline's is used as, from the spline's own value and derivatives.
    fn settle_second(_value: Self, _rate: Self, second: Self) -> Self {
        second
    }

    /// The greatest distance of values between `a` and `b` (with `linear` blending), or within the convex hull of both, from
    /// `reference`.
    fn distance(&self, reference: &Self) -> f64;

    /// This value or another that means the same, whichever is nearer `reference`.
    fn facing(&self, reference: &Self) -> Self;
}

impl Blend for DVec3 {
    fn sum<const N: usize>(terms: [(f64, &Self); N]) -> Self {
        terms.into_iter().map(|(factor, value)| factor * *value).sum()
    }

    fn distance(&self, reference: &Self) -> f64 {
        (*self - *reference).length()
    }

    fn facing(&self, _: &Self) -> Self {
        *self
    }
}

impl Blend for DQuat {
    fn sum<const N: usize>(terms: [(f64, &Self); N]) -> Self {
        terms
            .into_iter()
            .fold(Self::from_xyzw(0.0, 0.0, 0.0, 0.0), |sum, (factor, value)| sum + *value * factor)
    }

    /// Spherical linear interpolation, the shorter way.
    fn between(a: &Self, b: &Self, u: f64) -> (Self, Self) {
        let b = &b.facing(a);
        // The angle between unit quaternions, to full precision however small it is.
        let angle = 2.0 * libm::atan2((*b - *a).length(), (*b + *a).length());
        let sine = libm::sin(angle);
        if sine == 0.0 {
            return (*a, Self::from_xyzw(0.0, 0.0, 0.0, 0.0));
        }
        let ((sin_rest, cos_rest), (sin_done, cos_done)) =
            (libm::sincos((1.0 - u) * angle), libm::sincos(u * angle));
        let value = Self::sum([(sin_rest / sine, a), (sin_done / sine, b)]);
        (value, Self::sum([(-angle * cos_rest / sine, a), (angle * cos_done / sine, b)]))
    }

    /// The unit quaternion, and its derivative. A spline that passes through 0 has no rotation there, and gets none.
    fn settle(value: Self, rate: Self) -> (Self, Self) {
        let length = value.length();
        if !(length > 0.0 && length.is_finite()) {
            return (Self::IDENTITY, Self::from_xyzw(0.0, 0.0, 0.0, 0.0));
        }
        let unit = value * (1.0 / length);
        (unit, Self::sum([(1.0 / length, &rate), (-unit.dot(rate) / length, &unit)]))
    }

    fn bend_between(a: &Self, b: &Self, u: f64) -> Self {
        let b = &b.facing(a);
        let angle = 2.0 * libm::atan2((*b - *a).length(), (*b + *a).length());
        Self::between(a, b, u).0 * -(angle * angle)
    }

    /// With u = r/|r| and s = u·ṙ: u̇ = (ṙ − s·u)/|r| and ü = (r̈ − (u̇·ṙ + u·r̈)·u − 2·s·u̇)/|r|.
    fn settle_second(value: Self, rate: Self, second: Self) -> Self {
        let length = value.length();
        if !(length > 0.0 && length.is_finite()) {
            return Self::from_xyzw(0.0, 0.0, 0.0, 0.0);
        }
        let (unit, turned) = Self::settle(value, rate);
        let along = turned.dot(rate) + unit.dot(second);
        let by = 1.0 / length;
        Self::sum([(by, &second), (-along * by, &unit), (-2.0 * unit.dot(rate) * by, &turned)])
    }

    fn distance(&self, reference: &Self) -> f64 {
        (*self - *reference).length()
    }

    fn facing(&self, reference: &Self) -> Self {
        if self.dot(*reference) < 0.0 { -*self } else { *self }
    }
}

/// The weights of morph targets. All values of a track have the same length.
impl Blend for Vec<f64> {
    fn sum<const N: usize>(terms: [(f64, &Self); N]) -> Self {
        (0..terms[0].1.len())
            .map(|i| terms.iter().map(|(factor, value)| factor * value.get(i).copied().unwrap_or(0.0)).sum())
            .collect()
    }

    fn distance(&self, reference: &Self) -> f64 {
        self.iter().zip(reference).map(|(a, b)| (a - b) * (a - b)).sum::<f64>().sqrt()
    }

    fn facing(&self, _: &Self) -> Self {
        self.clone()
    }
}

/// A place between two keys.
struct Between {
    key: usize,
    /// The part of the way to the next key.
    part: f64,
    /// Seconds from key to key.
    span_s: f64,
}

impl<T: Blend> Track<T> {
    /// The value at a time of the clip.
    pub fn at(&self, time_s: f64) -> T {
        self.at_with_rate(time_s).0
    }

    /// The value, and its derivative by the clip's time. At a key the derivative is that of what follows.
    pub(super) fn at_with_rate(&self, time_s: f64) -> (T, T) {
        let (value, rate) = self.raw(time_s);
        T::settle(value, rate)
    }

    /// The second derivative by the clip's time. At a key it is that of what follows.
    fn second(&self, time_s: f64) -> T {
        let (value, rate) = self.raw(time_s);
        let second = match self.between(time_s) {
            Some(Between { key, part, span_s }) if self.blending == Blending::Linear => {
                let bend = T::bend_between(self.key(key), self.key(key + 1), part);
                T::sum([(1.0 / (span_s * span_s), &bend)])
            }
            Some(place) if self.blending == Blending::Cubic => {
                let [a, b, c, d] = self.control_points(&place);
                let by_time = 6.0 / (place.span_s * place.span_s);
                let (u, v) = (by_time * place.part, by_time * (1.0 - place.part));
                T::sum([(v, &a), (u - 2.0 * v, &b), (v - 2.0 * u, &c), (u, &d)])
            }
            _ => T::sum([(0.0, &value)]),
        };
        T::settle_second(value, rate, second)
    }

    /// The same as a spline gives it, before rotations are normalised.
    fn raw(&self, time_s: f64) -> (T, T) {
        let held = |value: &T| (value.clone(), T::sum([(0.0, value)]));
        match self.between(time_s) {
            Some(place) if self.blending == Blending::Linear => {
                let (value, rate) = T::between(self.key(place.key), self.key(place.key + 1), place.part);
                (value, T::sum([(1.0 / place.span_s, &rate)]))
            }
            Some(place) if self.blending == Blending::Cubic => {
                let [a, b, c, d] = self.control_points(&place);
                let (u, v) = (place.part, 1.0 - place.part);
                let value =
                    T::sum([(v * v * v, &a), (3.0 * u * v * v, &b), (3.0 * u * u * v, &c), (u * u * u, &d)]);
                let by_time = 3.0 / place.span_s;
                let (first, middle, last) = (v * v * by_time, 2.0 * u * v * by_time, u * u * by_time);
                let rate = T::sum([(-first, &a), (first - middle, &b), (middle - last, &c), (last, &d)]);
                (value, rate)
            }
            _ => held(self.held_at(time_s)),
        }
    }

    /// The place of a time between two keys. `None` before the first key and from the last key on.
    fn between(&self, time_s: f64) -> Option<Between> {
        let next = self.times_s.partition_point(|key| *key <= time_s);
        if next == 0 || next == self.times_s.len() {
            return None;
        }
        let (before, after) = (self.times_s[next - 1], self.times_s[next]);
        Some(Between { key: next - 1, part: (time_s - before) / (after - before), span_s: after - before })
    }

    /// The control points of the Bézier curve that the Hermite spline is between two keys: the values at its ends, and a third
    /// of the tangents, times the span, from there.
    fn control_points(&self, place: &Between) -> [T; 4] {
        let (a, d) = (self.key(place.key), self.key(place.key + 1));
        let (leaves, arrives) = (&self.values[3 * place.key + 2], &self.values[3 * place.key + 3]);
        let third = place.span_s / 3.0;
        [a.clone(), T::sum([(1.0, a), (third, leaves)]), T::sum([(1.0, d), (-third, arrives)]), d.clone()]
    }

    /// How far the values of a closed span of time get from `reference` at most, both before rotations are normalised.
    ///
    /// Distance is a convex function, so along a straight piece it is greatest at an end, and along a Bézier curve it is at most
    /// that of a control point; the curve is cut to the span by de Casteljau's algorithm first. A rotation between two others
    /// is a multiple of a point of the straight line between them, so it has a multiple that is as near.
    fn reach(&self, from_s: f64, to_s: f64, reference: &T) -> f64 {
        let mut farthest = 0.0_f64;
        if self.blending == Blending::Step || self.is_rest() {
            return self
                .held_in(from_s, to_s)
                .map(|v| v.facing(reference).distance(reference))
                .fold(0.0, f64::max);
        }
        let count = self.times_s.len();
        let first = self.times_s.partition_point(|key| *key <= from_s).saturating_sub(1).min(count - 2);
        let last = self.times_s.partition_point(|key| *key <= to_s).saturating_sub(1).clamp(first, count - 2);
        for key in first..=last {
            let (before, after) = (self.times_s[key], self.times_s[key + 1]);
            let span_s = after - before;
            let part = |time: f64| ((time - before) / span_s).clamp(0.0, 1.0);
            let (from, to) = (part(from_s), part(to_s));
            let place = Between { key, part: from, span_s };
            let hull = if self.blending == Blending::Cubic {
                cut(self.control_points(&place), from, to).to_vec()
            } else {
                let (a, b) = (self.key(key), self.key(key + 1));
                vec![T::between(a, b, from).0, T::between(a, b, to).0]
            };
            // All points of one piece mean the same or the opposite together.
            let is_opposite = hull[0].facing(reference).distance(&hull[0]) > 0.0;
            for point in &hull {
                let point = if is_opposite { T::sum([(-1.0, point)]) } else { point.clone() };
                farthest = farthest.max(point.distance(reference));
            }
        }
        farthest
    }
}

/// The control points of the part of a Bézier curve from `from` to `to`: its blossom at each choice of three of the two.
fn cut<T: Blend>(points: [T; 4], from: f64, to: f64) -> [T; 4] {
    let blossom = |parameters: [f64; 3]| {
        let mut points = points.to_vec();
        for u in parameters {
            points = points.windows(2).map(|pair| T::sum([(1.0 - u, &pair[0]), (u, &pair[1])])).collect();
        }
        points.swap_remove(0)
    };
    [[from, from, from], [from, from, to], [from, to, to], [to, to, to]].map(blossom)
}

/// A track with the clock that it is played by.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel<T> {
    /// The values over the clip's time.
    pub track: Arc<Track<T>>,
    /// The clip's time.
    pub clock: Clock,
}

impl<T> Channel<T> {
    /// A value that no time changes.
    pub fn rest(value: T) -> Self {
        Self { track: Arc::new(Track::rest(value)), clock: Clock::once(0.0) }
    }

    /// Whether the value is the same at all times.
    pub fn is_rest(&self) -> bool {
        self.track.is_rest()
    }

    /// The value of the key that holds at a time of the world.
    pub fn held_at(&self, time_s: f64) -> &T {
        self.track.held_at(self.clock.at(time_s))
    }
}

impl Channel<bool> {
    /// Whether the value is true at some time of a closed span.
    pub(super) fn is_true_in(&self, from_s: f64, to_s: f64) -> bool {
        self.clock.passed(from_s, to_s).any(|(from, to)| self.track.is_true_in(from, to))
    }
}

impl<T: Blend> Channel<T> {
    /// The value at a time of the world.
    pub fn at(&self, time_s: f64) -> T {
        self.track.at(self.clock.at(time_s))
    }

    /// The value and its derivative by the world's time.
    pub(super) fn at_with_rate(&self, time_s: f64) -> (T, T) {
        let (value, rate) = self.track.at_with_rate(self.clock.at(time_s));
        (value, T::sum([(self.clock.rate(time_s), &rate)]))
    }

    /// The second derivative by the world's time.
    pub(super) fn second(&self, time_s: f64) -> T {
        let rate = self.clock.rate(time_s);
        T::sum([(rate * rate, &self.track.second(self.clock.at(time_s)))])
    }

    /// The value at `middle_s` before it is normalised, and how far from it values of a closed span of time get at most.
    pub(super) fn reach(&self, from_s: f64, middle_s: f64, to_s: f64) -> (T, f64) {
        let reference = self.track.raw(self.clock.at(middle_s)).0;
        if self.is_rest() {
            return (reference, 0.0);
        }
        let farthest =
            self.clock.passed(from_s, to_s).map(|(from, to)| self.track.reach(from, to, &reference));
        let farthest = farthest.fold(0.0, f64::max);
        (reference, farthest)
    }
}
