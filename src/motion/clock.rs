//! The time of a clip, which follows from the world's.

/// The time within a clip as a function of the world's time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clock {
    /// The world's time at which the clip begins, in seconds.
    pub start_s: f64,
    /// Seconds of the clip for each second of the world, greater than 0.
    pub speed: f64,
    /// The clip's length in seconds: it goes from 0 to here.
    pub length_s: f64,
    /// Whether the clip begins again when it ends, and has done so for ever before. Otherwise its first moment stands before its
    /// start, and its last after its end.
    pub is_looped: bool,
}

impl Clock {
    /// The clock of a clip that plays once, from time 0.
    pub fn once(length_s: f64) -> Self {
        Self { start_s: 0.0, speed: 1.0, length_s, is_looped: false }
    }

    /// The time in the clip at a time of the world, from 0 to the clip's length.
    pub fn at(&self, time_s: f64) -> f64 {
        let time = (time_s - self.start_s) * self.speed;
        if self.is_looped && self.length_s > 0.0 {
            time.rem_euclid(self.length_s)
        } else {
            time.clamp(0.0, self.length_s.max(0.0))
        }
    }

    /// Seconds of the clip for each second of the world, at a time: 0 where the clip stands.
    pub(super) fn rate(&self, time_s: f64) -> f64 {
        let time = (time_s - self.start_s) * self.speed;
        let stands = self.length_s <= 0.0 || !self.is_looped && !(0.0..=self.length_s).contains(&time);
        if stands { 0.0 } else { self.speed }
    }

    /// The times of the clip that are passed between two times of the world: one closed span, or two about the end of a clip that
    /// begins again.
    pub(super) fn passed(&self, from_s: f64, to_s: f64) -> impl Iterator<Item = (f64, f64)> {
        let (first, last) = (self.at(from_s), self.at(to_s));
        // By a part in a billion less than a whole round, rounding could hide the wrap.
        let is_round = self.is_looped && (to_s - from_s) * self.speed >= self.length_s * (1.0 - 1e-9);
        let spans = if is_round {
            [Some((0.0, self.length_s.max(0.0))), None]
        } else if first > last {
            [Some((first, self.length_s)), Some((0.0, last))]
        } else {
            [Some((first, last)), None]
        };
        spans.into_iter().flatten()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clips_stand_before_and_after_or_go_round() {
        let once = Clock { start_s: 2.0, speed: 0.5, length_s: 3.0, is_looped: false };
        let looped = Clock { is_looped: true, ..once };
        for (time, at, round) in
            [(0.0, 0.0, 2.0), (2.0, 0.0, 0.0), (4.0, 1.0, 1.0), (8.0, 3.0, 0.0), (9.0, 3.0, 0.5)]
        {
            assert_eq!((once.at(time), looped.at(time)), (at, round), "{time}");
        }
        assert_eq!([0.0, 4.0, 9.0].map(|time| once.rate(time)), [0.0, 0.5, 0.0]);
        assert_eq!(looped.rate(-100.0), 0.5);
        // A clip of one moment stands for ever.
        assert_eq!(Clock { length_s: 0.0, ..looped }.at(7.0), 0.0);
    }

    #[test]
    fn what_is_passed_goes_round_the_end() {
        let looped = Clock { is_looped: true, ..Clock::once(2.0) };
        let passed = |from, to| looped.passed(from, to).collect::<Vec<_>>();
        assert_eq!(passed(2.5, 3.5), [(0.5, 1.5)]);
        assert_eq!(passed(3.5, 4.5), [(1.5, 2.0), (0.0, 0.5)]);
        assert_eq!(passed(3.0, 4.0), [(1.0, 2.0), (0.0, 0.0)]);
        assert_eq!(passed(3.5, 5.5), [(0.0, 2.0)]);
        assert_eq!(Clock::once(2.0).passed(-1.0, 9.0).collect::<Vec<_>>(), [(0.0, 2.0)]);
    }
}
