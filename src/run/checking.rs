//! The jobs that a check runs, and the outcome of each.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::baseline::{self, Acceptance};
use super::memory::{self, Holding};
use super::paths::configs_in;
use super::plan::Plan;
use super::session::Session;
use crate::check::expect::{Expected, Seen, Zone};
use crate::check::{ExpectationOutcome, Failure, GroundMap, Outcome, Snapshot, Vehicle, Verdict};
use crate::config::{self, Config, Job, MountedSensor};
use crate::error::Error;
use crate::frame::UpAxis;
use crate::output::SensorFrame;
use crate::scan::Frame;
use crate::source::{Diagnostic, Place};
use crate::view::{Mounted, Rig, Shown, View};

/// A job on its way from its file to its outcome.
pub struct Checked {
    /// The outcome so far.
    pub outcome: Outcome,
    /// What the HTML page shows of the job. Empty if there is no page.
    pub shown: Shown,
    /// How far the job has come.
    pub state: State,
}

/// How far a job has come.
pub enum State {
    /// The job can be run.
    Ready(Box<Job>, Plan),
    /// The outcome is complete.
    Done,
    /// The job can't be run.
    Broken(Error),
}

impl Checked {
    /// The outcome of a job that can't be run.
    pub fn broken(name: String, error: Error) -> Self {
        let failure =
            |problem: &Diagnostic| Failure { sentence: problem.sentence(), place: Some(problem.place()) };
        let problems = match &error {
            Error::Config(problems) | Error::Inputs(problems) => problems.iter().map(failure).collect(),
            other => vec![other.to_string().into()],
        };
        let outcome = Outcome { job: name, verdict: Verdict::Broken, problems, ..Outcome::default() };
        Self { outcome, shown: Shown::default(), state: State::Broken(error) }
    }

    /// Makes a job one that can't be run.
    pub fn fail(&mut self, error: Error) {
        *self = Self::broken(std::mem::take(&mut self.outcome.job), error);
    }

    /// Makes a job one that can't be run, because of what is written at a place in it.
    pub fn fail_at(&mut self, place: Place, error: Error) {
        self.fail(error);
        self.outcome.problems.iter_mut().for_each(|problem| {
            problem.place.get_or_insert_with(|| place.clone());
        });
    }

    /// The plan of a job that can be run.
    pub fn plan(&self) -> Option<&Plan> {
        match &self.state {
            State::Ready(_, plan) => Some(plan),
            _ => None,
        }
    }
}

/// The jobs that paths name.
#[derive(Default)]
pub struct Found {
    /// The jobs, each once.
    pub jobs: Vec<Checked>,
    /// The names of jobs in folders that have nothing to be checked.
    pub passed_over: Vec<String>,
    /// Folders without a job that has something to be checked.
    pub empty_folders: Vec<PathBuf>,
    /// Problems that do not stop the jobs.
    pub warnings: Vec<Diagnostic>,
}

/// Reads the jobs that the paths name. A file must be a job; of a folder, the jobs that have something to be checked are
/// taken: a baseline, `[check]` or `[[expect]]`. `overrides` are changes of keys, as [`config::load_job`] takes them.
/// `accepts` says that runs become baselines, and `page` that views are kept for a page.
pub fn find(paths: &[PathBuf], overrides: &[String], accepts: bool, page: bool) -> Found {
    let mut found = Found::default();
    let mut seen = Vec::new();
    // The views of all jobs are in memory until the page is written. Of other things, only those of one job at a time are.
    let (mut pages, mut largest) = (0_u64, 0);
    for path in paths {
        let is_folder = path.is_dir();
        let files = if is_folder { configs_in(path) } else { vec![path.clone()] };
        let before = found.jobs.len();
        for file in files {
            let identity = fs::canonicalize(&file).unwrap_or_else(|_| file.clone());
            if seen.contains(&identity) {
                continue;
            }
            seen.push(identity);
            let name = file.to_string_lossy().replace('\\', "/");
            let job = match load(&file, overrides, is_folder) {
                Ok(Some(job)) => job,
                Ok(None) => continue,
                Err(error) => {
                    found.jobs.push(Checked::broken(name, error));
                    continue;
                }
            };
            if is_folder && !has_something_to_check(&job) {
                found.passed_over.push(name);
                continue;
            }
            found.warnings.extend(job.warnings.iter().cloned());
            let compared = accepts || is_compared(&job);
            let plan = Plan::of(&job, Holding::Check { compared, page }).and_then(|plan| {
                if page {
                    pages = pages.saturating_add(memory::of_page(&job.sensors, compared));
                    largest = plan.bytes.max(largest);
                    memory::check("the rigs of all jobs, with their views,", pages.saturating_add(largest))?;
                }
                Ok(plan)
            });
            found.jobs.push(match plan {
                Ok(plan) => {
                    let outcome = Outcome { job: name, ..Outcome::default() };
                    Checked { outcome, shown: Shown::default(), state: State::Ready(Box::new(job), plan) }
                }
                Err(error) => Checked::broken(name, error),
            });
        }
        if is_folder && found.jobs.len() == before {
            found.empty_folders.push(path.clone());
        }
    }
    found
}

/// Reads a job. `None` for a sensor file in a folder; a sensor file that the user named is an error.
fn load(file: &Path, overrides: &[String], is_in_folder: bool) -> Result<Option<Job>, Error> {
    if !is_in_folder {
        return config::load_job(file, overrides).map(Some);
    }
    match config::load(file, overrides)? {
        Config::Job(job) => Ok(Some(*job)),
        Config::Sensor(_) => Ok(None),
    }
}

/// Whether a job's frames are held to a baseline: to one that is there, or one that should be.
fn is_compared(job: &Job) -> bool {
    job.check.is_some() || job.expectations.is_empty() || baseline::folder_of(&job.path).is_dir()
}

fn has_something_to_check(job: &Job) -> bool {
    job.check.is_some() || !job.expectations.is_empty() || baseline::folder_of(&job.path).is_dir()
}

/// The indices of the jobs that can be run, in groups that look at the same scene.
pub fn by_scene(jobs: &[Checked]) -> Vec<Vec<usize>> {
    let mut groups: Vec<(SceneKey, Vec<usize>)> = Vec::new();
    for (index, checked) in jobs.iter().enumerate() {
        let State::Ready(job, _) = &checked.state else { continue };
        let key = SceneKey::of(job);
        match groups.iter_mut().find(|(known, _)| *known == key) {
            Some((_, group)) => group.push(index),
            None => groups.push((key, vec![index])),
        }
    }
    groups.into_iter().map(|(_, group)| group).collect()
}

/// The settings of a job that decide which scene is read, and as what.
#[derive(PartialEq)]
struct SceneKey {
    path: PathBuf,
    /// The name by which the baseline knows the scene.
    as_written: String,
    name: Option<String>,
    up: UpAxis,
    labels: BTreeMap<String, u32>,
}

impl SceneKey {
    fn of(job: &Job) -> Self {
        Self {
            path: fs::canonicalize(&job.scene_path).unwrap_or_else(|_| job.scene_path.clone()),
            as_written: job.scene_as_written.clone(),
            name: job.scene_name.clone(),
            up: job.up,
            labels: job.labels.clone(),
        }
    }
}

/// The frames of a job, and the time that they took.
pub struct Run<'r> {
    session: &'r Session,
    plan: &'r Plan,
    frames: &'r [Frame],
    seen_by: Vec<SensorFrame<'r>>,
    /// What the labels stand for, in words.
    labels: BTreeMap<u32, String>,
    rays_per_s: f64,
}

impl<'r> Run<'r> {
    /// The frames of a session, one for each item of the plan, which took so many seconds.
    pub fn new(session: &'r Session, plan: &'r Plan, frames: &'r [Frame], seconds: f64) -> Self {
        let rays: usize = frames.iter().map(Frame::pixels).sum();
        let seen_by = plan.items.iter().zip(frames).map(|(item, frame)| session.sensor_frame(item, frame));
        let labels = session.label_names();
        Self { session, plan, frames, seen_by: seen_by.collect(), labels, rays_per_s: rays as f64 / seconds }
    }

    fn seen(&self) -> Seen<'_> {
        Seen {
            scene: self.session.scene(),
            labels: &self.labels,
            frames: &self.seen_by,
            rays_per_s: Some(self.rays_per_s),
        }
    }

    /// Holds the frames to the job's expectations and, if there is one or should be one, to the baseline.
    pub fn judge(&self, outcome: &mut Outcome) {
        self.expect(outcome);
        let (job, scene) = (&self.session.job, self.session.scene());
        if is_compared(job) {
            baseline::compare(job, scene, &self.taken(), outcome);
        }
        if !outcome.failures().is_empty() {
            outcome.verdict = Verdict::Failed;
        }
    }

    /// Holds the frames to the job's expectations, and packs them as the job's new baseline, which the caller writes.
    pub fn accept(&self, outcome: &mut Outcome) -> Acceptance {
        self.expect(outcome);
        let acceptance = Acceptance::of(&self.session.job, self.session.scene(), &mut self.taken());
        outcome.verdict = match () {
            () if !outcome.failures().is_empty() => Verdict::Failed,
            () if acceptance.is_there() => Verdict::Passed,
            () => Verdict::Accepted,
        };
        acceptance
    }

    fn expect(&self, outcome: &mut Outcome) {
        let seen = self.seen();
        let expectations = &self.session.job.expectations;
        let places = self.session.job.places.expectations.iter().map(|place| Some(place.clone()));
        let places = places.chain(std::iter::repeat(None));
        let examined = expectations
            .iter()
            .zip(places)
            .map(|(expectation, written_at)| ExpectationOutcome { written_at, ..expectation.examine(&seen) });
        outcome.expectations = examined.collect();
    }

    /// The names of the sensors whose frames have no return.
    pub fn without_returns(&self) -> Vec<&str> {
        let blank =
            self.plan.items.iter().zip(self.frames).filter(|(_, frame)| frame.iter().next().is_none());
        blank.map(|(item, _)| self.session.sensor(item).name.as_str()).collect()
    }

    fn taken(&self) -> Vec<Snapshot> {
        self.seen_by.iter().map(|frame| Snapshot::of(frame, self.session.scene(), &self.labels)).collect()
    }

    /// The ground that the rig sees: in the zone of the job's own expectation of coverage, or 20 m each way.
    pub fn ground(&self) -> GroundMap {
        let expected = self.session.job.expectations.iter().map(|expectation| &expectation.what);
        let own = expected.clone().find_map(|what| match what {
            Expected::Coverage { zone, .. } => Some(zone.clone()),
            _ => None,
        });
        let ground = expected.clone().find_map(|what| match what {
            Expected::BlindZone { ground, .. } => Some(ground.clone()),
            _ => None,
        });
        let zone = own.unwrap_or_else(|| Zone {
            ground: ground.unwrap_or_default(),
            x_m: [-20.0, 20.0],
            y_m: [-20.0, 20.0],
            cell_m: 0.1,
        });
        GroundMap::of(&self.seen(), zone, vehicle(self.session).as_ref())
    }

    /// What the page shows of the job.
    pub fn shown(&self) -> Shown {
        let mounted = self.plan.items.iter().map(|item| self.session.sensor(item));
        let view = |(mounted, frame): (&MountedSensor, &Frame)| {
            View::of_frame(&mounted.name, &mounted.sensor, frame, self.session.scene(), &self.labels)
        };
        let views = mounted.zip(self.frames).map(view).collect();
        let ground = Some(self.ground()).filter(|map| map.share() > 0.0);
        Shown { views, rig: Rig { ground, ..rig(self.session) } }
    }
}

/// The rig of a session with its vehicle, without the ground.
pub fn rig(session: &Session) -> Rig {
    let sensors = session.job.sensors.iter();
    let sensors = sensors.map(|s| Mounted::of(&s.name, &s.sensor, s.body_from_sensor)).collect();
    Rig { sensors, vehicle: vehicle(session), ground: None }
}

/// The vehicle: what no beam should hit, if the job says so.
fn vehicle(session: &Session) -> Option<Vehicle> {
    let body = session.job.expectations.iter().find_map(|expectation| match &expectation.what {
        Expected::Unobstructed { body, .. } => Some(body),
        _ => None,
    })?;
    Vehicle::find(session.scene(), body, &session.job.trajectory.pose_at(0.0))
}
