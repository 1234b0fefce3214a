//! Jobs with values that are drawn: their trial, and the jobs of single frames.

use std::path::PathBuf;
use std::sync::Arc;

use serde_json::{Map, Value as Json};

use super::super::draw::{Drawn, put_all, replaced};
use super::super::job::{ByFrame, Job};
use super::super::keys::GRAMMAR;
use super::super::keys::job::{SENSORS, TRAJECTORY};
use super::super::table::Reading;
use super::job::{Files, from_entries};
use crate::error::Error;
use crate::source::tree::Entries;
use crate::source::words::quoted;
use crate::source::{Diagnostic, Report, Severity, Span, Texts};

/// Most bytes of text that the jobs at the ends of distributions are made of. What is not tried is found when it is drawn.
const MAX_TRIED_BYTES: usize = 64 << 20;

/// Most drawn values that an error names.
const MOST_NAMED: usize = 8;

/// What a job is read from, anew with each value that is drawn.
pub(super) struct Source {
    pub entries: Entries,
    pub path: PathBuf,
    pub files: Files,
    pub texts: Texts,
}

/// The job of a source with what its distributions give: what is drawn for the run, and a way to the jobs of single frames.
/// `base` is the job without. `None` if some of it is wrong, which is reported.
pub(super) fn drawn(report: &Report, base: Job, mut source: Source, draws: Vec<Drawn>) -> Option<Job> {
    let mut all = source.entries.clone();
    put_all(Reading { report, grammar: &GRAMMAR }, &draws, &mut all, base.seed, 0);
    for draw in replaced(&draws, &all) {
        let message = format!("another key of `[random]` is drawn in the place of {}", quoted(&draw.key));
        report.error(draw.key_span, message, "", Some("leave one of the two out".to_owned()));
    }
    source.try_ends(report, &base, &draws);
    if report.has_errors() {
        return None;
    }
    let (of_run, of_frames): (Vec<Drawn>, Vec<Drawn>) = draws.into_iter().partition(|draw| draw.is_of_run);
    let mut job = base;
    if !of_run.is_empty() {
        let (seed, mut values) = (job.seed, Map::new());
        let put = |reading: Reading<'_>, entries: &mut Entries| {
            values = put_all(reading, &of_run, entries, seed, 0)
        };
        match source.read(None, put) {
            Ok(read) => job = Job { drawn: values, ..read },
            Err(errors) => {
                for error in errors {
                    let (span, error) = source.at_draw(error, "the run", &of_run, &values);
                    report.error(span, error.message, error.label, error.help);
                }
                return None;
            }
        }
        put_all(Reading { report, grammar: &GRAMMAR }, &of_run, &mut source.entries, seed, 0);
    }
    if !of_frames.is_empty() {
        let is_of_captures = |draw: &Drawn| {
            draw.parts
                .first()
                .is_some_and(|first| [SENSORS.name(), TRAJECTORY.name()].contains(&first.as_str()))
        };
        let changes_scene = !of_frames.iter().all(is_of_captures);
        let make = Arc::new(move |base: &Job, frame| source.job_of(base, &of_frames, frame));
        job.by_frame = Some(ByFrame { changes_scene, make });
    }
    Some(job)
}

impl Source {
    /// The job with other values, or the errors about it. If `base` is given, it has to be like that, or its place is where
    /// that is told.
    fn read(
        &self,
        base: Option<(&Job, Span)>,
        put: impl FnOnce(Reading<'_>, &mut Entries),
    ) -> Result<Job, Vec<Diagnostic>> {
        let report = self.texts.report();
        let mut entries = self.entries.clone();
        put(Reading { report: &report, grammar: &GRAMMAR }, &mut entries);
        let job = from_entries(&report, &GRAMMAR, &self.path, &entries, &self.files);
        let job = job.and_then(|job| match base {
            Some((base, span)) => like(&report, base, job, span),
            None => Some(job),
        });
        let is_error = |told: &Diagnostic| told.severity == Severity::Error;
        job.ok_or_else(|| report.into_diagnostics().into_iter().filter(is_error).collect())
    }

    /// Reads the job with each end of each distribution. Reports the first end of each that makes the job invalid.
    fn try_ends(&self, report: &Report, base: &Job, draws: &[Drawn]) {
        let most = MAX_TRIED_BYTES / self.texts.bytes().max(1);
        let ends = draws.iter().flat_map(|draw| draw.law.ends().into_iter().map(move |end| (draw, end)));
        let mut wrong = None;
        for (draw, end) in ends.take(most) {
            if wrong == Some(draw.span) {
                continue;
            }
            let like = (!draw.is_of_run).then_some((base, draw.span));
            let put = |reading: Reading<'_>, entries: &mut Entries| draw.put(reading, entries, end.clone());
            let Err(mut errors) = self.read(like, put) else { continue };
            wrong = Some(draw.span);
            // Another value may be told to be wrong first, because of this one.
            let place = report.place(draw.span);
            errors.sort_by_key(|error| (&error.path, &error.span) != (&place.path, &place.span));
            let Some(error) = errors.into_iter().next() else { continue };
            let message =
                format!("{} can be drawn as {}: {}", quoted(&draw.key), end.describe(), error.message);
            report.error(draw.span, message, error.label, error.help);
        }
    }

    /// The job of a frame.
    fn job_of(&self, base: &Job, draws: &[Drawn], frame: u64) -> Result<Job, Error> {
        let mut values = Map::new();
        let put = |reading: Reading<'_>, entries: &mut Entries| {
            values = put_all(reading, draws, entries, base.seed, frame);
        };
        let like = draws.first().map(|draw| (base, draw.span));
        match self.read(like, put) {
            Ok(job) => {
                let drawn = base.drawn.clone().into_iter().chain(values).collect();
                // A run may have another folder than the job's file says.
                let (output, warnings) = (base.output.clone(), base.warnings.clone());
                Ok(Job { drawn, output, warnings, by_frame: base.by_frame.clone(), ..job })
            }
            Err(errors) => {
                let who = format!("frame {frame}");
                let at_draw = |error| self.at_draw(error, &who, draws, &values).1;
                Err(Error::Config(errors.into_iter().map(at_draw).collect()))
            }
        }
    }

    /// An error about a job with drawn values, at the distribution whose value it is about, or else at the first one.
    fn at_draw(
        &self,
        told: Diagnostic,
        who: &str,
        draws: &[Drawn],
        values: &Map<String, Json>,
    ) -> (Span, Diagnostic) {
        let report = self.texts.report();
        let is_at = |draw: &&Drawn| {
            let place = report.place(draw.span);
            (&place.path, &place.span) == (&told.path, &told.span)
        };
        let culprit = draws.iter().find(is_at);
        let named = |draw: &Drawn| {
            quoted(&format!("{} = {}", draw.key, values.get(&draw.key).unwrap_or(&Json::Null)))
        };
        let drawn = match culprit {
            Some(draw) => named(draw),
            None => {
                let few: Vec<String> = draws.iter().take(MOST_NAMED).map(named).collect();
                format!("{}{}", few.join(", "), if draws.len() > MOST_NAMED { ", …" } else { "" })
            }
        };
        let span = culprit.or(draws.first()).map_or(Span::new(0, 0..0), |draw| draw.span);
        let place = report.place(span);
        let message = format!("{who} draws {drawn}: {}", told.message);
        (span, Diagnostic { message, path: place.path, source: place.source, span: place.span, ..told })
    }
}

/// Checks that a frame's job has images of the same sizes and times as the job that the run was planned by, and lets it share
/// what is the same. What differs is reported at `span`.
fn like(report: &Report, base: &Job, mut job: Job, span: Span) -> Option<Job> {
    for (mounted, before) in job.sensors.iter_mut().zip(&base.sensors) {
        let (pattern, of_base) = (&mounted.sensor.pattern, &before.sensor.pattern);
        let sizes = [pattern, of_base].map(|pattern| (pattern.rows(), pattern.columns()));
        if sizes[0] != sizes[1] || pattern.rate_hz() != of_base.rate_hz() {
            let message = format!(
                "the image of sensor {} has {} × {} pixels at {}, and {} × {} at {} without what is drawn",
                quoted(&before.name),
                sizes[0].0,
                sizes[0].1,
                rate(pattern.rate_hz()),
                sizes[1].0,
                sizes[1].1,
                rate(of_base.rate_hz()),
            );
            let help =
                "draw it with `per = \"run\"`: all frames of a run have one size and one rate".to_owned();
            return report.fail(span, message, "", Some(help));
        }
        // A lens that was inverted once is inverted for all frames.
        if mounted.sensor == before.sensor {
            mounted.sensor = before.sensor.clone();
        }
    }
    Some(job)
}

fn rate(rate_hz: Option<f64>) -> String {
    rate_hz.map_or("no rate".to_owned(), |rate| format!("{rate} Hz"))
}
