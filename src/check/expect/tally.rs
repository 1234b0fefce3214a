//! An expectation over the frames of a sequence: what is found in each frame is counted, and no frame is kept.

use super::finding::Finding;
use crate::check::outcome::{FrameCounts, Sight};
use crate::check::phrasing::digits;
use crate::source::words::{counted, joined};

/// The frames in which an expectation must be met. Without any of these limits it must be met in every frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Demand {
    /// The first frame that the expectation looks at.
    pub from: u64,
    /// The last frame that it looks at. `None` is the last of the sequence.
    pub to: Option<u64>,
    /// The least number of frames in which it is met.
    pub min_frames: Option<u64>,
    /// The longest time from the start of the first frame that it looks at to the start of the first frame in which it is met,
    /// in seconds.
    pub seen_by_s: Option<f64>,
    /// The most changes from a frame in which it is met to a frame in which it is not, and back.
    pub max_flicker: Option<u64>,
}

impl Demand {
    /// Whether the expectation looks at a frame of this number.
    pub fn looks_at(&self, frame: u64) -> bool {
        frame >= self.from && self.to.is_none_or(|to| frame <= to)
    }

    /// Whether the expectation must be met in every frame that it looks at.
    pub fn is_of_every_frame(&self) -> bool {
        self.min_frames.is_none() && self.seen_by_s.is_none() && self.max_flicker.is_none()
    }
}

/// Most runs of frames that a message lists.
const MOST_RUNS: usize = 6;

/// Numbers of frames as runs of successive ones, of which the first few are kept.
#[derive(Clone, Debug, Default)]
struct Runs {
    kept: Vec<[u64; 2]>,
    /// How many runs follow those.
    more: u64,
    last: Option<u64>,
}

impl Runs {
    fn add(&mut self, frame: u64) {
        let goes_on = self.last.is_some_and(|last| last + 1 == frame);
        self.last = Some(frame);
        let has_room = self.kept.len() < MOST_RUNS;
        match self.kept.last_mut() {
            Some(run) if goes_on && self.more == 0 => run[1] = frame,
            _ if goes_on => {}
            _ if has_room => self.kept.push([frame; 2]),
            _ => self.more += 1,
        }
    }

    /// `frame 7`, `frames 17 to 19, 40 and 57`.
    fn words(&self) -> String {
        let is_one = matches!(self.kept.as_slice(), [[from, to]] if from == to) && self.more == 0;
        let mut parts: Vec<String> = self
            .kept
            .iter()
            .map(|[from, to]| if from == to { from.to_string() } else { format!("{from} to {to}") })
            .collect();
        if self.more > 0 {
            parts.push(format!("{} more runs", self.more));
        }
        format!("{} {}", if is_one { "frame" } else { "frames" }, joined(&parts, "and"))
    }
}

/// The finding of a frame.
#[derive(Clone, Debug)]
struct Found {
    frame: u64,
    words: String,
    place: String,
    sights: Vec<Sight>,
}

/// The findings of an expectation in the frames of a sequence so far.
#[derive(Clone, Debug, Default)]
pub struct Tally {
    counts: FrameCounts,
    first_frame: u64,
    start_s: f64,
    last_was_met: Option<bool>,
    met: Runs,
    unmet: Runs,
    changed: Runs,
    first_met: Option<Found>,
    first_unmet: Option<Found>,
}

/// An expectation's outcome over a sequence: whether it is met, what was expected and found, where, and what shows it.
pub(super) struct Concluded {
    pub met: bool,
    pub expected: String,
    pub found: String,
    pub place: String,
    pub sights: Vec<Sight>,
    pub counts: FrameCounts,
}

impl Tally {
    /// Counts what was found in a frame that starts at `start_s`. Returns whether this is the first frame in which the
    /// expectation is not met.
    pub(super) fn add(&mut self, frame: u64, start_s: f64, finding: Finding) -> bool {
        let (is_met, words, place, sights) = match finding {
            Finding::Measured { met, found, place, sights } => (met, found, place, sights),
            Finding::Nothing(problem) => (false, problem, String::new(), Vec::new()),
        };
        if self.counts.looked_at == 0 {
            (self.first_frame, self.start_s) = (frame, start_s);
        }
        self.counts.looked_at += 1;
        if self.last_was_met.is_some_and(|before| before != is_met) {
            self.counts.changes += 1;
            self.changed.add(frame);
        }
        self.last_was_met = Some(is_met);
        let found = || Some(Found { frame, words, place, sights });
        if is_met {
            self.counts.met += 1;
            self.met.add(frame);
            if self.first_met.is_none() {
                self.counts.first_met_s = Some(start_s - self.start_s);
                self.first_met = found();
            }
            return false;
        }
        self.unmet.add(frame);
        let is_first = self.first_unmet.is_none();
        if is_first {
            self.first_unmet = found();
        }
        is_first
    }

    /// The outcome of an expectation that is called `expected` in words. Of a job with one frame it is that of the frame.
    pub(super) fn conclude(self, expected: String, demand: &Demand, is_sequence: bool) -> Concluded {
        let counts = self.counts;
        let is_met = self.meets(demand);
        if counts.looked_at == 0 {
            let found = "no frame to look at".to_owned();
            return Concluded {
                met: false,
                expected,
                found,
                place: String::new(),
                sights: Vec::new(),
                counts,
            };
        }
        let expected = if is_sequence { self.expected(expected, demand) } else { expected };
        let words = is_sequence.then(|| self.words(demand));
        let shown =
            if is_met { self.first_met.or(self.first_unmet) } else { self.first_unmet.or(self.first_met) };
        let Some(shown) = shown else { unreachable!("a frame that was looked at is met or unmet") };
        let (found, place) = match words {
            None => (shown.words, shown.place),
            Some(words) if is_met => (words, String::new()),
            Some(words) if shown.words.is_empty() => (words, shown.place),
            Some(words) => (format!("{} in frame {}; {words}", shown.words, shown.frame), shown.place),
        };
        Concluded { met: is_met, expected, found, place, sights: shown.sights, counts }
    }

    fn meets(&self, demand: &Demand) -> bool {
        let FrameCounts { looked_at, met, first_met_s, changes } = self.counts;
        if demand.is_of_every_frame() {
            return looked_at > 0 && met == looked_at;
        }
        demand.min_frames.is_none_or(|least| met >= least)
            && demand.seen_by_s.is_none_or(|latest| first_met_s.is_some_and(|first| first <= latest))
            && demand.max_flicker.is_none_or(|most| changes <= most)
    }

    /// `at least 1 point on "car" in at least 30 of 100 frames, first after 2 s at most`.
    fn expected(&self, what: String, demand: &Demand) -> String {
        let which = match (demand.from, demand.to) {
            (0, None) => counted(self.counts.looked_at, "frame"),
            (from, Some(to)) => format!("frames {from} to {to}"),
            (from, None) => format!("the frames from {from} on"),
        };
        if demand.is_of_every_frame() {
            return format!("{what} in each of {which}");
        }
        let mut words = what;
        words += &match demand.min_frames {
            Some(least) => format!(" in at least {least} of {which}"),
            None => format!(" in {which}"),
        };
        if let Some(latest) = demand.seen_by_s {
            words += &format!(", first after {} s at most", digits(latest));
        }
        if let Some(most) = demand.max_flicker {
            words += &format!(", with at most {} from frame to frame", counted(most, "change"));
        }
        words
    }

    /// The findings of all frames together: `met in 20 of 100 frames, not in frames 0 to 79`.
    fn words(&self, demand: &Demand) -> String {
        let FrameCounts { looked_at, met, first_met_s, changes } = self.counts;
        let mut parts = vec![match met {
            0 => format!("met in none of {}", counted(looked_at, "frame")),
            _ if met == looked_at => format!("met in all of {}", counted(looked_at, "frame")),
            // The shorter list says it better.
            _ if demand.is_of_every_frame() || self.unmet.kept.len() < self.met.kept.len() => {
                format!("met in {met} of {looked_at} frames, not in {}", self.unmet.words())
            }
            _ => format!("met in {met} of {looked_at} frames, in {}", self.met.words()),
        }];
        if demand.seen_by_s.is_some()
            && let (Some(seconds), Some(first)) = (first_met_s, &self.first_met)
        {
            parts.push(format!(
                "first in frame {}, {} s after frame {}",
                first.frame,
                digits(seconds),
                self.first_frame
            ));
        }
        if demand.max_flicker.is_some() {
            let at = if changes == 0 { String::new() } else { format!(" at {}", self.changed.words()) };
            parts.push(format!("{}{at}", counted(changes, "change")));
        }
        parts.join("; ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The outcome of an expectation that is met in the frames of a pattern where it has an `x`. Frames are 0.1 s apart.
    fn conclude(pattern: &str, demand: Demand) -> Concluded {
        let mut tally = Tally::default();
        for (frame, mark) in (0..).zip(pattern.chars()) {
            if demand.looks_at(frame) {
                let found = if mark == 'x' { "5 points" } else { "0 points" };
                tally.add(frame, 3.0 + 0.1 * frame as f64, Finding::new(mark == 'x', found, "sensor top"));
            }
        }
        tally.conclude("at least 1 point".to_owned(), &demand, true)
    }

    #[test]
    fn every_frame_must_do_unless_a_limit_says_otherwise() {
        let all = conclude("xxxx", Demand::default());
        assert!(all.met);
        assert_eq!(all.expected, "at least 1 point in each of 4 frames");
        assert_eq!(all.found, "met in all of 4 frames");
        let some = conclude("xx..x.xx", Demand::default());
        assert!(!some.met);
        assert_eq!(some.found, "0 points in frame 2; met in 5 of 8 frames, not in frames 2 to 3 and 5");
        assert_eq!(some.place, "sensor top");
        let none = conclude("..", Demand::default());
        assert_eq!(none.found, "0 points in frame 0; met in none of 2 frames");
    }

    #[test]
    fn a_range_of_frames_is_all_that_is_looked_at() {
        let demand = Demand { from: 2, to: Some(3), ..Demand::default() };
        let within = conclude("..xx..", demand);
        assert!(within.met);
        assert_eq!(within.expected, "at least 1 point in each of frames 2 to 3");
        assert_eq!(within.counts.looked_at, 2);
        let nothing = conclude("xx", Demand { from: 5, ..Demand::default() });
        assert_eq!((nothing.met, nothing.found.as_str()), (false, "no frame to look at"));
    }

    #[test]
    fn frames_are_counted_timed_and_held_to_be_steady() {
        let counted = |least| conclude("...xxx..", Demand { min_frames: Some(least), ..Demand::default() });
        assert!(counted(3).met && !counted(4).met);
        assert_eq!(counted(4).expected, "at least 1 point in at least 4 of 8 frames");
        assert_eq!(counted(4).found, "0 points in frame 0; met in 3 of 8 frames, in frames 3 to 5");

        // Frame 3 starts 0.3 s after frame 0, up to the rounding of both times.
        let by = |seconds| conclude("...xxx..", Demand { seen_by_s: Some(seconds), ..Demand::default() });
        assert!(by(0.300001).met && !by(0.29).met);
        assert!(by(0.29).found.ends_with("; first in frame 3, 0.3 s after frame 0"), "{}", by(0.29).found);
        assert!(!conclude("....", Demand { seen_by_s: Some(9.0), ..Demand::default() }).met);

        let steady = |most| conclude("..xx.xx.", Demand { max_flicker: Some(most), ..Demand::default() });
        assert!(steady(4).met && !steady(3).met);
        assert!(steady(3).found.ends_with("; 4 changes at frames 2, 4 to 5 and 7"), "{}", steady(3).found);
        assert!(steady(3).expected.ends_with(", with at most 3 changes from frame to frame"));
        // All limits hold at once.
        let both = Demand { min_frames: Some(4), max_flicker: Some(3), ..Demand::default() };
        assert!(!conclude("..xx.xx.", both).met && conclude("..xxxx..", both).met);
    }

    #[test]
    fn very_many_runs_take_no_memory() {
        let mut runs = Runs::default();
        (0..100_000).filter(|frame| frame % 3 != 0).for_each(|frame| runs.add(frame));
        assert_eq!(runs.kept.len(), MOST_RUNS);
        assert_eq!(
            runs.words(),
            "frames 1 to 2, 4 to 5, 7 to 8, 10 to 11, 13 to 14, 16 to 17 and 33327 more runs"
        );
    }
}
