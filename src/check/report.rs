//! Reports of outcomes for people, CI servers and scripts.

use std::fmt::Write as _;

use serde_json::{Value, json};

use super::compare::ChannelDifference;
use super::judge::MOST_REASONS;
use super::outcome::{ExpectationOutcome, Failure, Outcome, SensorOutcome, Verdict};
use crate::source::Place;
use crate::source::words::{counted, on_one_line};

impl Verdict {
    /// The verdict in a word.
    pub fn word(self) -> &'static str {
        match self {
            Self::Passed => "passed",
            Self::Accepted => "accepted",
            Self::Failed => "failed",
            Self::Broken => "broken",
        }
    }

    /// Whether the verdict is a success.
    pub fn is_fine(self) -> bool {
        matches!(self, Self::Passed | Self::Accepted)
    }
}

impl ExpectationOutcome {
    /// The outcome as a sentence: `the pedestrian is seen: expected at least 50 points on "pedestrian_1", found 31 points
    /// (sensor roof: …)`.
    pub fn sentence(&self) -> String {
        let place = if self.place.is_empty() { String::new() } else { format!(" ({})", self.place) };
        format!("{}: expected {}, found {}{place}", self.name, self.expected, self.found)
    }
}

impl Failure {
    /// The sentence behind its place: `jobs/a.toml:3:9: …`.
    pub fn located(&self) -> String {
        let Self { sentence, place } = self;
        match place.as_ref().map(|place| (place.path.display(), place.line_column())) {
            Some((path, Some((line, column)))) => format!("{path}:{line}:{column}: {sentence}"),
            Some((path, None)) => format!("{path}: {sentence}"),
            None => sentence.clone(),
        }
    }
}

impl Outcome {
    /// Everything that is wrong.
    pub fn failures(&self) -> Vec<Failure> {
        let differences = self.sensors.iter().flat_map(|sensor| {
            let place = &sensor.written_at;
            sensor.differences.iter().map(|d| Failure { sentence: d.sentence.clone(), place: place.clone() })
        });
        let unmet = self.expectations.iter().filter(|e| !e.met);
        let unmet = unmet.map(|e| Failure { sentence: e.sentence(), place: e.written_at.clone() });
        self.problems.iter().cloned().chain(differences).chain(unmet).collect()
    }

    /// The sentences about everything that is wrong. Those about sensors and expectations name these, and the others begin with
    /// their place.
    pub fn sentences(&self) -> Vec<String> {
        let problems = self.problems.iter().map(Failure::located);
        let others = self.failures().into_iter().skip(self.problems.len()).map(|failure| failure.sentence);
        problems.chain(others).collect()
    }
}

/// The counts of the verdicts: `5 jobs: 3 passed, 2 failed`.
pub fn summary(outcomes: &[Outcome]) -> String {
    let verdicts = [Verdict::Passed, Verdict::Accepted, Verdict::Failed, Verdict::Broken];
    let counts = verdicts.iter().filter_map(|verdict| {
        let count = outcomes.iter().filter(|outcome| outcome.verdict == *verdict).count();
        (count > 0).then(|| format!("{count} {}", verdict.word()))
    });
    let counts = counts.collect::<Vec<_>>().join(", ");
    format!("{}: {counts}", counted(outcomes.len(), "job"))
}

/// The report for a terminal: a line for each job, followed by its failures and changes.
pub fn text(outcomes: &[Outcome]) -> String {
    let mut text = String::new();
    for outcome in outcomes {
        let _ = write!(text, "{}: {}", on_one_line(&outcome.job), outcome.verdict.word());
        let met = outcome.expectations.iter().filter(|e| e.met).count();
        if met > 0 {
            let _ = write!(text, ", {} met", counted(met, "expectation"));
        }
        text.push('\n');
        for sentence in outcome.sentences() {
            let _ = writeln!(text, "  {}", on_one_line(&sentence));
        }
        // A few changes were already named with the differences that they caused.
        if outcome.changes.len() > MOST_REASONS || outcome.sensors.iter().all(|s| s.differences.is_empty()) {
            text.push_str(if outcome.changes.is_empty() {
                ""
            } else {
                "  changed since the baseline was accepted:\n"
            });
            for change in &outcome.changes {
                let _ = writeln!(text, "    {}", on_one_line(&change.to_string()));
            }
        }
    }
    text
}

/// The report for GitHub's job summary and for comments, in Markdown.
pub fn markdown(outcomes: &[Outcome]) -> String {
    let mut text = format!("### beamcast check: {}\n\n| job | |\n|---|---|\n", summary(outcomes));
    for outcome in outcomes {
        let sign = if outcome.verdict.is_fine() { "✅" } else { "❌" };
        let _ = writeln!(text, "| {} | {sign} {} |", escaped(&outcome.job), outcome.verdict.word());
    }
    for outcome in outcomes.iter().filter(|outcome| !outcome.verdict.is_fine()) {
        let _ = writeln!(text, "\n#### {}\n", escaped(&outcome.job));
        for sentence in outcome.sentences() {
            let _ = writeln!(text, "- {}", escaped(&sentence));
        }
        if !outcome.changes.is_empty() {
            text.push_str("\nChanged since the baseline was accepted:\n\n");
            for change in &outcome.changes {
                let _ = writeln!(text, "- {}", escaped(&change.to_string()));
            }
        }
    }
    text
}

/// The text with Markdown's special characters escaped. Names can hold any character, and must not become markup, nor what
/// GitHub makes of bare text: mentions, references to issues, and links. An empty comment takes these apart.
fn escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in on_one_line(text).chars() {
        match c {
            '\\' | '`' | '*' | '_' | '|' | '[' | ']' | '~' => escaped.extend(['\\', c]),
            '#' => escaped.push_str("\\#<!-- -->"),
            '@' => escaped.push_str("@<!-- -->"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '&' => escaped.push_str("&amp;"),
            c => escaped.push(c),
        }
    }
    escaped.replace("://", ":<!-- -->//").replace("www.", "www<!-- -->.")
}

/// The report as GitHub's workflow commands: an annotation for each failure, at the place that it is about. `name_of` gives the
/// name of a file in the repository.
pub fn github(outcomes: &[Outcome], name_of: &dyn Fn(&str) -> String) -> String {
    let data = |text: &str| on_one_line(text).replace('%', "%25");
    let property = |text: &str| data(text).replace(':', "%3A").replace(',', "%2C");
    let mut text = String::new();
    for outcome in outcomes {
        for Failure { sentence, place } in outcome.failures() {
            // A change by `--set` is in no file, and so its annotation is at the job's.
            let in_file = place.as_ref().filter(|place| !place.path.starts_with("--set"));
            let path = in_file.map_or(outcome.job.as_str().into(), |place| place.path.to_string_lossy());
            let file = property(&name_of(&path));
            let at = match in_file.and_then(Place::line_column) {
                Some((line, column)) => format!(",line={line},col={column}"),
                None => String::new(),
            };
            let _ = writeln!(text, "::error file={file}{at},title=beamcast check::{}", data(&sentence));
        }
    }
    text
}

/// The report as JSON, for scripts.
pub fn json(outcomes: &[Outcome]) -> Value {
    let jobs = outcomes.iter().map(|outcome| {
        let expectation = |e: &ExpectationOutcome| {
            let at = line_and_column(e.written_at.as_ref());
            json!({
                "name": e.name,
                "met": e.met,
                "expected": e.expected,
                "found": e.found,
                "place": e.place,
                "frames": e.counts.looked_at,
                "frames_met": e.counts.met,
                "first_met_s": e.counts.first_met_s,
                "changes": e.counts.changes,
                "line": at.0,
                "column": at.1,
            })
        };
        let sensor = |s: &SensorOutcome| {
            let at = line_and_column(s.written_at.as_ref());
            json!({
                "name": s.name,
                "frame": s.frame.unwrap_or(0),
                "return": s.number,
                "line": at.0,
                "column": at.1,
                "rows": s.rows,
                "columns": s.columns,
                "differences": s.differences.iter().map(|d| &d.sentence).collect::<Vec<_>>(),
                "channels": s.channels.iter().map(|c| channel(c, s.columns)).collect::<Vec<_>>(),
            })
        };
        let change = |c: &super::Change| json!({ "what": c.subject(), "old": c.old, "new": c.new });
        json!({
            "job": outcome.job,
            "verdict": outcome.verdict.word(),
            "problems": outcome.problems.iter().map(Failure::located).collect::<Vec<_>>(),
            "warnings": outcome.warnings,
            "changes": outcome.changes.iter().map(change).collect::<Vec<_>>(),
            "sensors": outcome.sensors.iter().map(sensor).collect::<Vec<_>>(),
            "expectations": outcome.expectations.iter().map(expectation).collect::<Vec<_>>(),
        })
    });
    let fine = outcomes.iter().all(|outcome| outcome.verdict.is_fine());
    json!({ "passed": fine, "jobs": jobs.collect::<Vec<_>>() })
}

/// The line and the column of a place in the job's own file, if they are known.
fn line_and_column(place: Option<&Place>) -> (Option<usize>, Option<usize>) {
    place.and_then(Place::line_column).unzip()
}

/// A channel's difference as JSON, for an image of so many columns.
pub fn channel(found: &ChannelDifference, columns: usize) -> Value {
    let statistics = found.statistics.map(|s| {
        json!({
            "max": s.max,
            "worst_row": s.worst as usize / columns.max(1),
            "worst_column": s.worst as usize % columns.max(1),
            "mean": s.mean,
            "rms": s.rms,
            "p99": s.p99,
        })
    });
    json!({
        "channel": found.channel,
        "within_tolerance": found.within_tolerance,
        "differing": found.differing.count(),
        "differing_unit": found.differing.unit(),
        "differing_is_exact": found.differing.is_exact(),
        "resolution": found.resolution,
        "statistics": statistics,
    })
}

#[cfg(test)]
mod tests {
    use super::super::outcome::Difference;
    use super::*;

    fn outcomes() -> Vec<Outcome> {
        let sensor = SensorOutcome {
            name: "roof".into(),
            differences: vec![Difference {
                sentence: "sensor roof: range differs in 3 of 8 pixels, 50 % <&> more".into(),
                ..Difference::default()
            }],
            written_at: Some(Place {
                path: "a,b.toml".into(),
                source: "\n\n  [[sensor]]".into(),
                span: 4..14,
            }),
            ..SensorOutcome::default()
        };
        let expectation = ExpectationOutcome {
            name: "a, b: c".into(),
            met: false,
            expected: "at least 5 points on \"x|y\"".into(),
            found: "1 point".into(),
            written_at: Some(Place { path: "--set".into(), source: "a=1".into(), span: 0..3 }),
            ..ExpectationOutcome::default()
        };
        vec![
            Outcome {
                job: "a,b.toml".into(),
                verdict: Verdict::Failed,
                sensors: vec![sensor],
                expectations: vec![expectation],
                ..Outcome::default()
            },
            Outcome { job: "good.toml".into(), ..Outcome::default() },
        ]
    }

    #[test]
    fn annotations_are_escaped() {
        assert_eq!(
            github(&outcomes(), &|path| format!("jobs/{path}")),
            "::error file=jobs/a%2Cb.toml,line=3,col=3,title=beamcast check::sensor roof: range differs in 3 of 8 pixels, \
             50 %25 <&> more\n\
             ::error file=jobs/a%2Cb.toml,title=beamcast check::a, b: c: expected at least 5 points on \"x|y\", found 1 \
             point\n"
        );
    }

    #[test]
    fn markdown_has_a_row_a_job_and_no_markup_of_names() {
        let text = markdown(&outcomes());
        assert!(text.contains("2 jobs: 1 passed, 1 failed"), "{text}");
        assert!(text.contains("| good.toml | ✅ passed |"), "{text}");
        assert!(text.contains("x\\|y") && text.contains("&lt;&amp;&gt;"), "{text}");
    }

    #[test]
    fn markdown_mentions_nobody_and_links_nowhere() {
        let shown = escaped("@all #12 https://a.b WWW.c www.d \u{202e}\u{1b}[m\n# e");
        assert_eq!(
            shown,
            "@<!-- -->all \\#<!-- -->12 https:<!-- -->//a.b WWW.c www<!-- -->.d \\\\u{202e}\\\\u{1b}\\[m\\\\n\\#<!-- --> e"
        );
    }

    #[test]
    fn json_says_whether_all_is_well() {
        let value = json(&outcomes());
        assert_eq!(value["passed"], false);
        assert_eq!(value["jobs"][0]["expectations"][0]["found"], "1 point");
        assert_eq!(json(&outcomes()[1..])["passed"], true);
    }
}
