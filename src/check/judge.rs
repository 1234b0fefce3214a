//! Judgement of a sensor's frame against its baseline.

use std::collections::BTreeMap;
use std::error::Error;

use super::baseline::{SensorRecord, Snapshot, StoredPixels};
use super::changes::Changes;
use super::compare::{ChannelDifference, Confusion, Differing, ImageDifference, Tolerance, compare};
use super::outcome::{Change, Difference, SensorOutcome};
use super::phrasing::{self, Region, digits, metres};
use crate::scan::Cause;
use crate::source::words::{counted, joined};

/// The settings in a job's `[check]`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Settings {
    /// The channels that are compared with the baseline. All channels are compared if absent.
    pub channels: Option<Vec<String>>,
    /// The tolerances by channel. A channel without an entry tolerates no difference.
    pub tolerances: BTreeMap<String, Tolerance>,
    /// The numbers of the frames that are compared with the baseline. Of a sequence, these are the first, the middle and the last
    /// frame of each sensor if absent.
    pub frames: Option<Vec<u64>>,
}

impl Settings {
    /// The frames that are compared with the baseline, of a sensor that has so many: in ascending order, each once.
    pub fn frames_of(&self, all: u64) -> Vec<u64> {
        let last = all.saturating_sub(1);
        let mut frames = self.frames.clone().unwrap_or_else(|| vec![0, last / 2, last]);
        frames.retain(|frame| *frame < all);
        frames.sort_unstable();
        frames.dedup();
        frames
    }

    fn holds(&self, channel: &str) -> bool {
        self.channels.as_ref().is_none_or(|channels| channels.iter().any(|c| c == channel))
    }

    /// The tolerance of a channel.
    pub fn tolerance(&self, channel: &str) -> Tolerance {
        self.tolerances.get(channel).copied().unwrap_or_default()
    }
}

/// Judges a snapshot by the accepted record. `read_pixels` reads the baseline's pixels, and is called only if there is a
/// difference. `accept` is the command that accepts the job as it is.
pub fn judge(
    current: &Snapshot,
    accepted: &SensorRecord,
    read_pixels: impl FnOnce() -> Result<StoredPixels, Box<dyn Error + Send + Sync>>,
    settings: &Settings,
    changes: &Changes,
    accept: &str,
) -> SensorOutcome {
    let now = &current.record;
    let (rows, columns) = (now.rows, now.columns);
    let (name, frame, number) = (now.name.clone(), current.frame_number(), now.number);
    let mut outcome = SensorOutcome { name, frame, number, rows, columns, ..SensorOutcome::default() };
    let title = current.title();
    let reason = reason(&title, &now.name, changes);
    if (now.rows, now.columns) != (accepted.rows, accepted.columns) {
        let size = |r: &SensorRecord| format!("{} × {}", r.rows, r.columns);
        outcome.differences.push(of_all(format!(
            "{reason}the image is {} pixels, the baseline {}",
            size(now),
            size(accepted)
        )));
        return outcome;
    }
    let checked: Vec<&String> = now.channels.keys().filter(|c| settings.holds(c)).collect();
    let differing: Vec<&String> =
        checked.iter().copied().filter(|&c| now.channels.get(c) != accepted.channels.get(c)).collect();
    let missing: Vec<String> = accepted
        .channels
        .keys()
        .filter(|c| settings.holds(c) && !now.channels.contains_key(*c))
        .cloned()
        .collect();
    if !missing.is_empty() {
        let sentence = format!("{reason}the run has no {}, the baseline does", joined(&missing, "and"));
        outcome.differences.push(of_all(sentence));
    }
    if differing.is_empty() {
        return outcome;
    }
    let stored = match read_pixels() {
        Ok(stored) => stored,
        Err(problem) => {
            let sentence = format!("{reason}{} differ from the baseline, {problem}", names(&differing));
            outcome.differences.push(of_all(sentence));
            return outcome;
        }
    };
    let resolution = |channel: &str| accepted.kept.get(channel).copied().unwrap_or(0.0);
    let difference = compare(&stored.image, &current.image, &|c| settings.tolerance(c), &resolution);
    let judgement = Judgement { current, accepted, stored: &stored, settings, difference: &difference };
    for name in differing {
        let mut found = judgement.channel(name, accept, &mut outcome.differences);
        found.channel = name.clone();
        outcome.channels.push(found);
    }
    let sentences = judgement.sentences(&outcome.channels);
    // Only the first sentence names the reason.
    let own = format!("{title}: ");
    let prefixes = std::iter::once(reason).chain(std::iter::repeat(own));
    outcome.differences.extend(prefixes.zip(sentences).map(|(prefix, difference)| Difference {
        sentence: format!("{prefix}{}", difference.sentence),
        ..difference
    }));
    outcome.baseline = Some(stored.image);
    outcome
}

/// A difference of the whole image.
fn of_all(sentence: String) -> Difference {
    Difference { sentence, ..Difference::default() }
}

struct Judgement<'a> {
    current: &'a Snapshot,
    accepted: &'a SensorRecord,
    stored: &'a StoredPixels,
    settings: &'a Settings,
    difference: &'a ImageDifference,
}

impl Judgement<'_> {
    /// The difference of a channel whose hash differs, as far as it is known.
    fn channel(&self, name: &str, accept: &str, problems: &mut Vec<Difference>) -> ChannelDifference {
        let known = self.difference.channels.iter().find(|c| c.channel == name);
        let has_tolerance = self.settings.tolerances.contains_key(name);
        match known {
            Some(known) if has_tolerance => known.clone(),
            None if has_tolerance => {
                problems.push(of_all(format!(
                    "the baseline was accepted before {name} had a tolerance, and has no pixels of it: {accept}"
                )));
                ChannelDifference::default()
            }
            known => {
                // The hash shows that the channel differs, however little.
                let mut found = known.cloned().unwrap_or_default();
                found.within_tolerance = false;
                found.differing = self.count(name, found.pixels.len(), found.resolution);
                found
            }
        }
    }

    /// How much of a channel differs at all.
    fn count(&self, name: &str, seen: usize, resolution: f64) -> Differing {
        let region = self.region(name);
        if self.accepted.kept.contains_key(name) && resolution == 0.0 {
            return Differing::Pixels(seen);
        }
        let (rows, columns) = (region.rows.len(), region.columns.len());
        // In a single row the differing columns are the differing pixels, and in a single column the rows are.
        match () {
            () if columns > 0 && (rows == 1 || columns == 1) => Differing::Pixels(rows.max(columns)),
            () if seen < rows => Differing::Rows(rows),
            () => Differing::AtLeastPixels(seen.max(columns)),
        }
    }

    /// The rows whose hashes differ, and for the main depth the columns too.
    fn region(&self, name: &str) -> Region {
        let differ = |old: &[u32], new: &[u32]| -> Vec<usize> {
            (0..old.len().min(new.len())).filter(|&i| old[i] != new[i]).collect()
        };
        let (old, new) = (&self.stored.hashes, self.current.hashes());
        let rows = match (old.rows.get(name), new.rows.get(name)) {
            (Some(old), Some(new)) => differ(old, new),
            _ => Vec::new(),
        };
        let is_main = self.current.image.main_depth().is_some_and(|(main, _)| main == name);
        let columns = if is_main { differ(&old.columns, &new.columns) } else { Vec::new() };
        Region { rows, columns }
    }

    fn sentences(&self, channels: &[ChannelDifference]) -> Vec<Difference> {
        let wrong: Vec<&ChannelDifference> =
            channels.iter().filter(|c| !c.within_tolerance && !c.channel.is_empty()).collect();
        let mut sentences = Vec::new();
        let main = self.current.image.main_depth().map_or("", |(name, _)| name);
        // The range comes first, because the other channels usually differ as a consequence.
        let mut in_order = wrong.clone();
        in_order.sort_by_key(|c| c.channel != main);
        for found in in_order {
            let sentence = match found.channel.as_str() {
                name if name == main => Some(self.range_sentence(found)),
                "id.semantic" => self.label_sentence(found),
                "cause" => self.cause_sentence(found, &wrong),
                _ if found.statistics.is_some() => Some(self.value_sentence(found)),
                _ => None,
            };
            let worst = found.statistics.filter(|s| s.max > found.resolution / 2.0).map(|s| s.worst);
            let columns = self.current.record.columns;
            sentences.extend(sentence.map(|sentence| {
                Difference {
                    sentence,
                    channel: Some(found.channel.clone()),
                    pixel: worst
                        .or(found.pixels.first().copied())
                        .map(|p| [p as usize / columns, p as usize % columns]),
                }
            }));
        }
        // Consequences of a differing range are reported in short. Channels that differ on their own are reported in full.
        let quiet: Vec<&ChannelDifference> = wrong
            .iter()
            .copied()
            .filter(|c| c.statistics.is_none() && c.channel != main)
            .filter(|c| !matches!(c.channel.as_str(), "cause" | "id.semantic"))
            .collect();
        if !quiet.is_empty() {
            let names = names(&quiet.iter().map(|c| &c.channel).collect::<Vec<_>>());
            let mut rows: Vec<usize> = quiet.iter().flat_map(|c| self.region(&c.channel).rows).collect();
            rows.sort_unstable();
            rows.dedup();
            let place = Region { rows, columns: vec![] }.words(self.size());
            let too = if sentences.is_empty() { "" } else { " too" };
            let verb = if quiet.len() == 1 { "differs" } else { "differ" };
            let comma = if place.is_empty() { "" } else { ", " };
            let channel = quiet.first().map(|first| first.channel.clone());
            let sentence = format!("{names} {verb}{too}{comma}{place}");
            sentences.push(Difference { sentence, channel, pixel: None });
        }
        sentences
    }

    /// The sentence about the ranges, such as `range differs in 2048 of 262144 pixels, max 1.2 m, all in row 17`.
    fn range_sentence(&self, found: &ChannelDifference) -> String {
        let mask = self.difference.mask;
        let mut parts = vec![self.how_many(found, &found.channel)];
        if let Some(s) = found.statistics {
            if s.max > found.resolution / 2.0 {
                let at = self.pixel(s.worst);
                parts.push(format!("max {} ({at})", metres(s.max)));
            } else if mask.appeared + mask.vanished == 0 {
                parts.push(format!("none by more than {}", metres(found.resolution)));
            }
        }
        if mask.appeared > 0 {
            parts.push(format!("{} appeared", counted(mask.appeared, "return")));
        }
        if mask.vanished > 0 {
            parts.push(format!("{} vanished", counted(mask.vanished, "return")));
        }
        parts.extend(self.places(found));
        parts.join(", ")
    }

    fn value_sentence(&self, found: &ChannelDifference) -> String {
        let mut parts = vec![self.how_many(found, &found.channel)];
        if let Some(s) = found.statistics.filter(|s| s.max > found.resolution / 2.0) {
            parts.push(format!("max {} ({})", digits(s.max), self.pixel(s.worst)));
        }
        parts.extend(self.places(found));
        parts.join(", ")
    }

    /// The sentence about the labels, such as `the label differs in 534 of 28800 pixels, label 3 "crate" → 0: 534 pixels, all on
    /// "crate_3"`.
    fn label_sentence(&self, found: &ChannelDifference) -> Option<String> {
        if found.pixels.is_empty() {
            return None; // the labels of what appeared and vanished, which is told
        }
        let mut parts = vec![self.how_many(found, "the label")];
        let confusion = self.difference.label_confusion.iter().take(3);
        let pairs: Vec<String> = confusion.map(|c| confusion_words(c, &self.current.labels)).collect();
        parts.push(pairs.join("; "));
        parts.extend(self.places(found));
        Some(parts.join(", "))
    }

    /// The sentence about the causes, such as `the cause differs in 39 of 360 pixels, surface → too_near: 39 pixels, all in row 0`. Returns
    /// that appeared and vanished where nothing else is are told with the ranges.
    fn cause_sentence(&self, found: &ChannelDifference, wrong: &[&ChannelDifference]) -> Option<String> {
        let (was, is) = (self.stored.image.u32("cause")?, self.current.image.u32("cause")?);
        let mut changes: BTreeMap<[Option<Cause>; 2], usize> = BTreeMap::new();
        for &pixel in &found.pixels {
            let change = [was, is].map(|causes| Cause::numbered(causes[pixel as usize]));
            *changes.entry(change).or_default() += 1;
        }
        let is_told = |change: &[Option<Cause>; 2]| {
            change.iter().all(|cause| matches!(cause, Some(Cause::Surface | Cause::Nothing)))
        };
        let has_ranges =
            wrong.iter().any(|c| self.current.image.main_depth().is_some_and(|(m, _)| m == c.channel));
        if has_ranges && changes.keys().all(is_told) {
            return None;
        }
        let mut most: Vec<_> = changes.into_iter().collect();
        most.sort_by_key(|(_, pixels)| std::cmp::Reverse(*pixels));
        let word = |cause: Option<Cause>| cause.map_or("unknown", Cause::name);
        let shown = most.iter().take(3).map(|([was, is], pixels)| {
            format!("{} → {}: {}", word(*was), word(*is), counted(*pixels, "pixel"))
        });
        let mut parts = vec![self.how_many(found, "the cause"), shown.collect::<Vec<_>>().join("; ")];
        parts.extend(self.places(found));
        Some(parts.join(", "))
    }

    fn how_many(&self, found: &ChannelDifference, what: &str) -> String {
        let (rows, columns) = self.size();
        let many = found.differing.words(rows, columns);
        let tolerance = self.settings.tolerance(&found.channel);
        match (tolerance.absolute > 0.0 || tolerance.relative > 0.0, tolerance.pixels > 0.0) {
            (true, _) => format!("{what} differs by more than the tolerance in {many}"),
            (false, true) => format!("{what} differs in {many}, more than may"),
            (false, false) => format!("{what} differs in {many}"),
        }
    }

    /// The location of the differing pixels in the image, and the objects that they show.
    fn places(&self, found: &ChannelDifference) -> Vec<String> {
        let region = match self.settings.tolerances.contains_key(&found.channel) {
            true => Region::of(&found.pixels, self.current.record.columns),
            false => self.region(&found.channel),
        };
        let region = if region.columns.is_empty() && !found.pixels.is_empty() && found.resolution == 0.0 {
            Region::of(&found.pixels, self.current.record.columns)
        } else {
            region
        };
        let objects = phrasing::objects(
            &found.pixels,
            [
                (self.accepted, self.stored.image.u32("id.instance")),
                (&self.current.record, self.current.image.u32("id.instance")),
            ],
        );
        [region.words(self.size()), objects].into_iter().filter(|w| !w.is_empty()).collect()
    }

    fn size(&self) -> (usize, usize) {
        (self.current.record.rows, self.current.record.columns)
    }

    fn pixel(&self, pixel: u32) -> String {
        let columns = self.current.record.columns;
        format!("row {}, column {}", pixel as usize / columns, pixel as usize % columns)
    }
}

/// A change from one label to another: `label 3 "crate" → 0: 534 pixels`.
pub fn confusion_words(found: &Confusion, names: &BTreeMap<u32, String>) -> String {
    let name = |label: u32| names.get(&label).map_or(String::new(), |name| format!(" {name:?}"));
    let Confusion { was, is, pixels } = *found;
    format!("label {was}{} → {is}{}: {}", name(was), name(is), counted(pixels, "pixel"))
}

/// The most changes that are named as the reason.
pub const MOST_REASONS: usize = 3;

/// The probable reason of the difference, as the beginning of the sentence that reports it.
fn reason(title: &str, sensor: &str, changes: &Changes) -> String {
    let own = changes.of_sensor.get(sensor).map_or(&[][..], Vec::as_slice);
    let all: Vec<&Change> = own.iter().chain(&changes.of_job).collect();
    let prefix = format!("{title}: ");
    if all.is_empty() {
        return format!("{prefix}neither the job nor the scene nor the version changed, and yet ");
    }
    let mut told: Vec<String> = all.iter().take(MOST_REASONS).map(|change| change.words()).collect();
    if all.len() > MOST_REASONS {
        told.push(format!("{} more changes", all.len() - MOST_REASONS));
    }
    format!("{prefix}{}: ", told.join("; "))
}

fn names(channels: &[&String]) -> String {
    joined(&channels.iter().map(|c| (*c).clone()).collect::<Vec<_>>(), "and")
}
