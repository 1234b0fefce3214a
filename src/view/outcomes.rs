//! The page of a check: verdicts, what differs and is not as expected, with links to the pictures that show it.

use std::fmt::Write as _;

use super::frames::{Shown, View};
use super::html::{Cell, Link, escape, table};
use super::page::{document, rig, section};
use crate::check::phrasing::digits;
use crate::check::{Change, ExpectationOutcome, Outcome, SensorOutcome, Sight, Verdict};
use crate::output;

/// The page of a check: what failed first. `shown` has what is to be seen of each job, and nothing of a job that could not be run.
pub fn of_outcomes(outcomes: &[Outcome], shown: &[Shown]) -> String {
    let failed = outcomes.iter().filter(|o| !o.verdict.is_fine()).count();
    let mut body = String::new();
    let said = match (outcomes.len(), failed) {
        (1, 0) => "The job passed.".to_owned(),
        (1, _) => "The job failed.".to_owned(),
        (jobs, 0) => format!("All {jobs} jobs passed."),
        (jobs, failed) => format!("{failed} of {jobs} jobs failed."),
    };
    let _ = write!(body, "<p class=\"lead\">{said}</p>");
    let nothing = Shown::default();
    let frames = shown.iter().map(|shown| shown.views.len()).sum();
    let mut jobs: Vec<Job> = outcomes
        .iter()
        .enumerate()
        .map(|(index, outcome)| Job {
            id: format!("job{index}"),
            outcome,
            shown: shown.get(index).unwrap_or(&nothing),
            frames,
        })
        .collect();
    jobs.sort_by_key(|job| job.outcome.verdict.is_fine());
    if jobs.len() > 1 {
        let rows = jobs.iter().map(|Job { id, outcome, .. }| {
            let link = Link { to: id.clone(), ..Link::default() };
            vec![
                Cell::Links(vec![(outcome.job.clone(), Some(link))]),
                Cell::Verdict(outcome.verdict.is_fine(), verdict(outcome.verdict)),
                Cell::Text(met(&outcome.expectations)),
            ]
        });
        body += &table("Jobs", &["job", "verdict", "expectations met"], rows);
    }
    body.extend(jobs.iter().map(Job::section));
    document("beamcast check", &body)
}

/// A job on the page of a check.
struct Job<'a> {
    /// The id of the job's section, which begins those of the sections in it.
    id: String,
    outcome: &'a Outcome,
    shown: &'a Shown,
    /// How many frames the page has.
    frames: usize,
}

impl Job<'_> {
    fn section(&self) -> String {
        let Self { id, outcome, shown, frames } = self;
        let mut html = format!(
            "<section id=\"{id}\" class=\"job\"><h2><bdi>{}</bdi> <span class=\"verdict {}\">{}</span></h2>",
            escape(&outcome.job),
            if outcome.verdict.is_fine() { "good" } else { "bad" },
            verdict(outcome.verdict)
        );
        html += &sentences(
            outcome.problems.iter().map(|problem| format!("<bdi>{}</bdi>", escape(&problem.located()))),
        );
        let differences = outcome.sensors.iter().flat_map(|s| s.differences.iter().map(move |d| (s, d)));
        html += &sentences(differences.map(|(sensor, difference)| {
            match self.frame(
                &sensor.name,
                sensor.frame.unwrap_or(0),
                difference.channel.as_deref(),
                difference.pixel,
            ) {
                Some(link) => link.around(&difference.sentence),
                None => format!("<bdi>{}</bdi>", escape(&difference.sentence)),
            }
        }));
        html += &self.expectations();
        html += &changes(&outcome.changes);
        html += &statistics(&outcome.sensors);
        let (failing, others): (Vec<_>, Vec<_>) =
            shown.views.iter().enumerate().partition(|(_, view)| self.is_failing(view));
        let frame = |(index, view): &(usize, &View)| {
            let compared = outcome.sensors.iter().find(|s| s.name == view.name && s.frame == view.frame);
            section(&format!("{id}-frame{index}"), view, compared, *frames)
        };
        html.extend(failing.iter().map(frame));
        let names: Vec<&str> = shown.views.iter().map(|view| view.name.as_str()).collect();
        html += &rig(id, &shown.rig, &names);
        html.extend(others.iter().map(frame));
        html + "</section>"
    }

    /// Whether something about a sensor's frame is not as it should be.
    fn is_failing(&self, view: &View) -> bool {
        let of_view = |s: &&SensorOutcome| s.name == view.name && s.frame == view.frame;
        let differs = self.outcome.sensors.iter().filter(of_view).any(|s| !s.differences.is_empty());
        let unmet = self.outcome.expectations.iter().filter(|e| !e.met).flat_map(|e| &e.sights);
        let shows = |sight: &Sight| matches!(sight, Sight::Frame { sensor, frame, .. } if *sensor == view.name && *frame == view.frame.unwrap_or(0));
        differs || unmet.into_iter().any(shows)
    }

    /// The link to the frame of a sensor, if it is on the page.
    fn frame(
        &self,
        sensor: &str,
        frame: u64,
        channel: Option<&str>,
        pixel: Option<[usize; 2]>,
    ) -> Option<Link> {
        let is_shown = |view: &View| view.name == sensor && view.frame.unwrap_or(0) == frame;
        let index = self.shown.views.iter().position(is_shown)?;
        Some(Link { to: format!("{}-frame{index}", self.id), channel: channel.map(str::to_owned), pixel })
    }

    /// The expectations, the unmet ones first, each with what shows its finding.
    fn expectations(&self) -> String {
        if self.outcome.expectations.is_empty() {
            return String::new();
        }
        let mut all: Vec<&ExpectationOutcome> = self.outcome.expectations.iter().collect();
        all.sort_by_key(|e| e.met);
        let rows = all.iter().map(|e| {
            let text = |text: &str| Cell::Text(text.to_owned());
            let verdict = Cell::Verdict(e.met, if e.met { "met" } else { "not met" });
            vec![text(&e.name), verdict, text(&e.expected), text(&e.found), Cell::Links(self.sights(e))]
        });
        table("Expectations", &["name", "", "expected", "found", "where"], rows)
    }

    /// Where an expectation's finding is, with links to what shows it.
    fn sights(&self, expectation: &ExpectationOutcome) -> Vec<(String, Option<Link>)> {
        let link = |sight: &Sight| match sight {
            Sight::Frame { sensor, frame, channel, pixel } => {
                Some((sensor.clone(), self.frame(sensor, *frame, *channel, *pixel)?))
            }
            Sight::Ground => {
                self.shown.rig.ground.as_ref()?;
                Some(("the map".to_owned(), Link { to: format!("{}-ground", self.id), ..Link::default() }))
            }
        };
        let links: Vec<(String, Link)> = expectation.sights.iter().filter_map(link).collect();
        let place = expectation.place.clone();
        match links.as_slice() {
            [(_, only)] if !place.is_empty() => vec![(place, Some(only.clone()))],
            _ => {
                let own = Some((place, None)).filter(|(place, _)| !place.is_empty());
                own.into_iter().chain(links.into_iter().map(|(name, link)| (name, Some(link)))).collect()
            }
        }
    }
}

fn verdict(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Passed => "passed",
        Verdict::Accepted => "accepted",
        Verdict::Failed => "failed",
        Verdict::Broken => "could not be run",
    }
}

fn met(expectations: &[ExpectationOutcome]) -> String {
    match expectations.len() {
        0 => "none made".to_owned(),
        all => format!("{} of {all}", expectations.iter().filter(|e| e.met).count()),
    }
}

/// A list of sentences, which are HTML.
fn sentences(all: impl Iterator<Item = String>) -> String {
    let items: String = all.map(|sentence| format!("<li>{sentence}</li>")).collect();
    if items.is_empty() { items } else { format!("<ul class=\"sentences\">{items}</ul>") }
}

fn changes(all: &[Change]) -> String {
    if all.is_empty() {
        return String::new();
    }
    let value = |value: &Option<String>| match value {
        Some(value) => Cell::Code(value.clone()),
        None => Cell::Text("not there".to_owned()),
    };
    let rows = all.iter().map(|c| vec![Cell::Code(c.subject()), value(&c.old), value(&c.new)]);
    table("Changed since the baseline was accepted", &["what", "was", "is"], rows)
}

fn statistics(sensors: &[SensorOutcome]) -> String {
    let rows: Vec<Vec<Cell>> = sensors
        .iter()
        .flat_map(|sensor| sensor.channels.iter().map(move |channel| (sensor, channel)))
        .map(|(sensor, c)| {
            let what = match c.differing.count() {
                0 if !c.within_tolerance => "only where returns came or went".to_owned(),
                _ => c.differing.words(sensor.rows, sensor.columns),
            };
            let title = sensor.title();
            let name = title.trim_start_matches("sensor ").to_owned();
            let mut row = vec![Cell::Text(name), Cell::Code(c.channel.clone()), Cell::Number(what)];
            let unit = output::channel(&c.channel).map_or("", |spec| spec.unit);
            let number = |x: f64| Cell::Number(format!("{} {unit}", digits(x)).trim_end().to_owned());
            // Below half of the step in which the baseline has its pixels, nothing is known.
            row.extend(match c.statistics.filter(|s| s.max > c.resolution / 2.0) {
                Some(s) => [s.max, s.mean, s.rms, s.p99].map(number),
                None => [(); 4].map(|()| Cell::Number("–".to_owned())),
            });
            row.push(Cell::Verdict(c.within_tolerance, if c.within_tolerance { "yes" } else { "no" }));
            row
        })
        .collect();
    if rows.is_empty() {
        return String::new();
    }
    let head =
        ["sensor", "channel", "where it differs", "max", "mean", "RMS", "99 % are below", "within tolerance"];
    table("Differences from the baseline", &head, rows)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::page::tests::{data, view};
    use super::*;
    use crate::check::{Difference, GroundMap};
    use crate::frame::Pose;
    use crate::view::{Mounted, Rig};

    #[test]
    fn a_check_tells_verdict_changes_expectations_and_differences() {
        let mut run = view();
        run.name = "top".to_owned();
        let sensor = SensorOutcome {
            name: "top".to_owned(),
            differences: vec![Difference {
                sentence: "sensor top: range differs in 1 of 6 pixels".to_owned(),
                channel: Some("range".to_owned()),
                pixel: Some([1, 2]),
            }],
            channels: vec![crate::check::compare::ChannelDifference {
                channel: "range".to_owned(),
                resolution: 0.25,
                ..Default::default()
            }],
            baseline: Some(run.image.clone()),
            ..SensorOutcome::default()
        };
        let change =
            Change { sensor: None, what: "seed <i>".to_owned(), old: Some("1".to_owned()), new: None };
        let expectation = ExpectationOutcome {
            name: "enough".to_owned(),
            met: false,
            expected: "at least 7 points".to_owned(),
            found: "5 points".to_owned(),
            place: String::new(),
            sights: vec![Sight::Ground],
            ..ExpectationOutcome::default()
        };
        let outcome = Outcome {
            job: "a.toml".to_owned(),
            verdict: Verdict::Failed,
            changes: vec![change],
            sensors: vec![sensor],
            expectations: vec![expectation],
            ..Outcome::default()
        };
        let broken = Outcome {
            job: "b.toml".to_owned(),
            verdict: Verdict::Broken,
            problems: vec!["there is no scene".to_owned().into()],
            ..Outcome::default()
        };
        let fine = View { name: "left".to_owned(), ..view() };
        let mounted =
            |name: &str| Mounted { name: name.to_owned(), body_from_sensor: Pose::IDENTITY, edges: vec![] };
        let zone = crate::check::expect::Zone {
            ground: Default::default(),
            x_m: [-1.0, 1.0],
            y_m: [0.0, 1.0],
            cell_m: 1.0,
        };
        let sensors = vec![("top".to_owned(), [0.5, 0.5]), ("<far>".to_owned(), [9.0, 0.0])];
        let ground =
            Some(GroundMap { zone, counts: vec![0, 3], sensors, outline: vec![[0.0, 0.0], [1.0, 0.5]] });
        let rig = Rig { sensors: vec![mounted("left"), mounted("top")], vehicle: None, ground };
        let shown = Shown { views: vec![fine, run], rig };
        let page = of_outcomes(&[outcome, broken], &[shown, Shown::default()]);
        // What failed is first, and sentences lead to it.
        let at = |part: &str| page.find(part).unwrap_or_else(|| panic!("{part}"));
        let order = ["id=\"job0-frame1\"", "id=\"job0-rig\"", "id=\"job0-ground\"", "id=\"job0-frame0\""];
        assert!(order.map(at).is_sorted(), "{:?}", order.map(at));
        at(
            "<a href=\"#job0-frame1\" data-channel=\"range\" data-pixel=\"1,2\"><bdi>sensor top: range differs",
        );
        at("<a href=\"#job0-ground\" data-channel=\"\"><bdi>the map</bdi></a>");
        at("50 % of 2 cells of 1 m have returns from the ground, at most 3 returns");
        at("<polygon class=\"vehicle\"");
        assert!(!page.contains("far&gt;"), "a sensor outside of the map is not on it");
        for part in [
            "2 of 2 jobs failed.",
            "a.toml</bdi> <span class=\"verdict bad\">failed",
            "could not be run",
            "there is no scene",
            "range differs in 1 of 6 pixels",
            "seed &lt;i&gt;",
            "not there",
            "at least 7 points",
            "not met",
            "data-picture=\"baseline\"",
            "data-picture=\"difference\"",
        ] {
            assert!(page.contains(part), "{part}");
        }
        let data = data(&page);
        let range = data["baseline"].as_array().unwrap().iter().find(|c| c["key"] == "range").unwrap();
        assert_eq!((&range["resolution"], &range["is_depth"]), (&json!(0.25), &json!(true)));
    }
}
