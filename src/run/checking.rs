//! The jobs that a check runs, and the outcome of each.

use std::borrow::Cow;
use std::collections::{BTreeMap, VecDeque};
use std::fs;
use std::path::{Path, PathBuf};

use super::baseline::{self, Acceptance, Comparison};
use super::memory::{self, Holding};
use super::paths::configs_in;
use super::plan::{Item, Plan, Selection};
use super::session::Session;
use super::steps::{self, Steps};
use crate::check::expect::{Demand, Expectation, Expected, Seen, Tally, Zone};
use crate::check::{ExpectationOutcome, Failure, GroundMap, Outcome, Settings, Snapshot, Vehicle, Verdict};
use crate::config::{self, Config, Job};
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
    /// The rays that its check casts.
    pub rays: u64,
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
        Self { outcome, shown: Shown::default(), state: State::Broken(error), rays: 0 }
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
            let detection = job.expectations.iter().any(is_of_detection);
            let holding = Holding::Check { compared, page, detection };
            let plan = Plan::of(&job, &Selection::FIRST, holding).and_then(|plan| {
                if page {
                    pages = pages.saturating_add(
                        memory::of_page(&job.sensors, compared).saturating_mul(frames_shown(&job, compared)),
                    );
                    largest = plan.bytes.max(largest);
                    memory::check("the rigs of all jobs, with their views,", pages.saturating_add(largest))?;
                }
                Ok(plan)
            });
            found.jobs.push(match plan {
                Ok(plan) => {
                    let outcome = Outcome { job: name, ..Outcome::default() };
                    let rays = rays_of(&job, accepts);
                    Checked {
                        outcome,
                        shown: Shown::default(),
                        state: State::Ready(Box::new(job), plan),
                        rays,
                    }
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
        match groups.iter_mut().find(|(known, _)| !key.is_alone && *known == key) {
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
    /// The bits of the time at which the job's first frame starts.
    start_s: u64,
    /// Whether the job brings actors or clips of its own, or asks the scene where something is: it shares its scene with no other.
    is_alone: bool,
}

impl SceneKey {
    fn of(job: &Job) -> Self {
        Self {
            path: fs::canonicalize(&job.scene_path).unwrap_or_else(|_| job.scene_path.clone()),
            as_written: job.scene_as_written.clone(),
            name: job.scene_name.clone(),
            up: job.up,
            labels: job.labels.clone(),
            start_s: job.sequence.start_s.to_bits(),
            is_alone: !job.actors.is_empty()
                || !job.from_scene.is_empty()
                || job.animation != Default::default(),
        }
    }
}

/// What is to be made of a job's frames.
#[derive(Clone, Copy, Debug, Default)]
pub struct Purpose {
    /// The frames become the job's baseline. Otherwise they are compared with it, if there is one or should be one.
    pub accepts: bool,
    /// A page shows frames of the job.
    pub page: bool,
    /// There is a map of the ground that the rig sees.
    pub ground: bool,
}

/// A job that is being checked, frame by frame. The frames of one step are in memory at a time.
pub struct Run<'r> {
    session: &'r Session,
    outcome: &'r mut Outcome,
    purpose: Purpose,
    steps: Steps,
    needs: Needs,
    /// The next step, and the frames that are to be cast before it.
    next: u64,
    waiting: VecDeque<Item>,
    /// What the labels stand for, in words.
    labels: BTreeMap<u32, String>,
    tallies: Vec<Tally>,
    comparison: Option<Comparison>,
    acceptance: Option<Acceptance>,
    /// The frames without a return, among those that would become the baseline.
    blank: Vec<String>,
    ground: Option<GroundMap>,
    views: Vec<View>,
    /// How many of them show where an expectation is not met.
    deciding: usize,
    rays: u64,
}

/// A frame of a check that was cast, with the session that cast it: the check's own, or one with what the job draws for the frame.
pub struct CastFrame<'s> {
    /// Which frame it is.
    pub item: Item,
    /// The session that cast it.
    pub session: Cow<'s, Session>,
    /// What the sensor saw.
    pub frame: Frame,
    /// The frame that it would have seen if it were ideal, where [`Run::needs_ideal`] says so.
    pub ideal: Option<Frame>,
}

/// What is left of a job's frames once all of them were looked at.
pub struct Taken {
    /// The files that make the run the job's baseline, if it is to become that.
    pub acceptance: Option<Acceptance>,
    /// Frames without a return, in words, which would become a part of the baseline.
    pub blank: Vec<String>,
    /// The map of the ground, if it was asked for.
    pub ground: Option<GroundMap>,
    /// What the page shows of the job.
    pub shown: Shown,
}

/// Most frames of a sequence that are on the page because an expectation is not met in them.
const MOST_DECIDING: usize = 8;

/// The frames of a job that a check needs.
struct Needs {
    /// The frames of each sensor that are held to the baseline or become one.
    compared: Vec<Vec<u64>>,
    /// The frames of each sensor that expectations about it alone look at.
    of_sensor: Vec<Vec<Demand>>,
    /// The steps that expectations about all sensors look at.
    of_rig: Vec<Demand>,
}

impl Needs {
    fn of(job: &Job, steps: &Steps, compared: bool) -> Self {
        let default = Settings::default();
        let settings = job.check.as_ref().unwrap_or(&default);
        let of_frames = || job.expectations.iter().filter(|expectation| !expectation.is_of_run());
        let demands = |name: Option<&str>| -> Vec<Demand> {
            of_frames().filter(|e| e.sensor.as_deref() == name).map(|e| e.demand).collect()
        };
        let frames = |sensor: usize| match compared {
            true => settings.frames_of(steps.frames_of(sensor)),
            // A speed is measured, and a page shown, of some frame.
            false if of_frames().next().is_none() => vec![0],
            false => Vec::new(),
        };
        Self {
            compared: (0..job.sensors.len()).map(frames).collect(),
            of_sensor: job.sensors.iter().map(|sensor| demands(Some(&sensor.name))).collect(),
            of_rig: demands(None),
        }
    }

    fn is_of_rig(&self, step: u64) -> bool {
        self.of_rig.iter().any(|demand| demand.looks_at(step))
    }

    /// Whether a frame is needed that belongs to no step, or to one that is not.
    fn has(&self, sensor: usize, frame: u64) -> bool {
        self.compared[sensor].contains(&frame)
            || self.of_sensor[sensor].iter().any(|demand| demand.looks_at(frame))
    }

    /// The frames of a step that are needed, then those between it and the next, each a batch of its own.
    fn batches(&self, steps: &Steps, step: u64) -> (Vec<Item>, Vec<Item>) {
        let is_of_rig = self.is_of_rig(step);
        let together = steps.items(step).filter(|item| is_of_rig || self.has(item.sensor, item.frame));
        let between = (0..self.compared.len()).flat_map(|sensor| {
            let frames = steps.between(step, sensor).filter(move |frame| self.has(sensor, *frame));
            frames.map(move |frame| steps::item(sensor, frame))
        });
        (together.collect(), between.collect())
    }
}

/// The rays that a check of a job casts.
fn rays_of(job: &Job, accepts: bool) -> u64 {
    let steps = Steps::of(job);
    let needs = Needs::of(job, &steps, accepts || is_compared(job));
    let rays = |item: &Item| {
        let casts = if needs_ideal(job, item) { 2 } else { 1 };
        (job.sensors[item.sensor].sensor.pattern.rays() as u64).saturating_mul(casts)
    };
    let of_step = |step| {
        let (together, between) = needs.batches(&steps, step);
        together.iter().chain(&between).map(rays).fold(0, u64::saturating_add)
    };
    (0..steps.count()).map(of_step).fold(0, u64::saturating_add)
}

/// Whether an expectation says how often something is detected.
fn is_of_detection(expectation: &Expectation) -> bool {
    matches!(expectation.what, Expected::Detection { .. })
}

/// Whether an expectation of detection concerns a frame whose sensor is not ideal. An ideal sensor's own frame says it all.
fn needs_ideal(job: &Job, item: &Item) -> bool {
    let mounted = &job.sensors[item.sensor];
    let concerns = |expectation: &Expectation| match &expectation.sensor {
        Some(name) => *name == mounted.name && expectation.demand.looks_at(item.frame),
        None => true,
    };
    !mounted.sensor.measurement.is_ideal()
        && job.expectations.iter().filter(|expectation| is_of_detection(expectation)).any(concerns)
}

/// The frames of a job that a page of a check may show.
fn frames_shown(job: &Job, compared: bool) -> u64 {
    let steps = Steps::of(job);
    let needs = Needs::of(job, &steps, compared);
    let most = needs.compared.iter().map(|frames| frames.len() as u64).max().unwrap_or(0).max(1);
    if steps.is_sequence() { most + MOST_DECIDING as u64 } else { most }
}

impl<'r> Run<'r> {
    /// A check of a session's job, whose outcome it completes.
    pub fn new(session: &'r Session, outcome: &'r mut Outcome, purpose: Purpose) -> Self {
        let job = &session.job;
        let compared = is_compared(job);
        let steps = Steps::of(job);
        let needs = Needs::of(job, &steps, compared || purpose.accepts);
        let comparison =
            (compared && !purpose.accepts).then(|| Comparison::open(job, session.scene(), outcome)).flatten();
        let mut run = Self {
            session,
            outcome,
            purpose,
            steps,
            needs,
            next: 0,
            waiting: VecDeque::new(),
            labels: session.label_names(),
            tallies: vec![Tally::default(); job.expectations.len()],
            comparison,
            acceptance: purpose.accepts.then(|| Acceptance::of(job)),
            blank: Vec::new(),
            ground: None,
            views: Vec::new(),
            deciding: 0,
            rays: 0,
        };
        if purpose.ground || purpose.page {
            run.ground = Some(GroundMap::empty(run.zone(), vehicle(session).as_ref()));
        }
        run
    }

    /// The frames to cast next, which the caller then gives to [`Self::take`] together. `None` if all were taken.
    pub fn next_items(&mut self) -> Option<Vec<Item>> {
        if let Some(item) = self.waiting.pop_front() {
            return Some(vec![item]);
        }
        while self.next < self.steps.count() {
            let (together, between) = self.needs.batches(&self.steps, self.next);
            self.next += 1;
            self.waiting = between.into();
            if !together.is_empty() {
                return Some(together);
            }
            if let Some(item) = self.waiting.pop_front() {
                return Some(vec![item]);
            }
        }
        None
    }

    /// Whether the check also needs a frame as an ideal sensor would have it ([`Session::cast_ideal`]).
    pub fn needs_ideal(&self, item: &Item) -> bool {
        needs_ideal(&self.session.job, item)
    }

    /// Looks at frames that were cast: holds them to expectations, and to the baseline or makes them one.
    pub fn take(&mut self, frames: &[CastFrame]) {
        let job = &*self.session.job;
        let is_sequence = self.steps.is_sequence();
        let seen_by: Vec<SensorFrame> =
            frames.iter().map(|cast| cast.session.sensor_frame(&cast.item, &cast.frame)).collect();
        // Frames for which a job draws another scene are looked at in that one.
        let scene = frames.first().map_or(self.session, |cast| &*cast.session).scene();
        let all = frames.iter().flat_map(|cast| [Some(&cast.frame), cast.ideal.as_ref()]).flatten();
        self.rays += all.map(|frame| frame.pixels() as u64).sum::<u64>();
        let ideal: Vec<(&str, &Frame)> = seen_by
            .iter()
            .zip(frames)
            .filter_map(|(seen, cast)| Some((seen.name, cast.ideal.as_ref()?)))
            .collect();
        // The step, if these are the frames of one.
        let step = self.next.saturating_sub(1);
        let is_step = self.steps.items(step).any(|item| frames.first().is_some_and(|cast| cast.item == item));
        let whole = is_step && self.needs.is_of_rig(step);
        let mut deciding = Vec::new();
        for (expectation, tally) in job.expectations.iter().zip(&mut self.tallies) {
            if expectation.is_of_run() {
                continue;
            }
            let looked_at = match &expectation.sensor {
                None => whole.then_some(step),
                Some(name) => seen_by.iter().find(|seen| seen.name == name).map(|seen| seen.capture.frame),
            };
            let Some(frame) = looked_at.filter(|frame| expectation.demand.looks_at(*frame)) else { continue };
            let of_sensor =
                |seen: &&SensorFrame| expectation.sensor.as_ref().is_none_or(|own| own == seen.name);
            let start_s = seen_by.iter().find(of_sensor).map_or(0.0, |seen| seen.capture.start_s);
            let seen =
                Seen { scene, labels: &self.labels, frames: &seen_by, ideal: &ideal, rays_per_s: None };
            let is_first_failure = expectation.examine(&seen, frame, start_s, tally);
            if is_first_failure && expectation.demand.is_of_every_frame() {
                deciding.extend(seen_by.iter().filter(of_sensor).map(|seen| (seen.name, seen.capture.frame)));
            }
        }
        for (CastFrame { item, session, .. }, seen) in frames.iter().zip(&seen_by) {
            let is_compared = self.needs.compared[item.sensor].contains(&item.frame);
            if is_compared && (self.acceptance.is_some() || self.comparison.is_some()) {
                // Each number of return is an image of its own, and one of them is in memory at a time.
                for number in 0..seen.capture.sensor.most_returns() {
                    let taken = Snapshot::of_return(seen, number, session.scene(), &self.labels);
                    let taken = taken.in_sequence(is_sequence);
                    if let Some(comparison) = &mut self.comparison {
                        comparison.compare(job, &taken, self.purpose.page, self.outcome);
                    }
                    if let Some(acceptance) = &mut self.acceptance {
                        if number == 0 && seen.frame.iter().next().is_none() {
                            self.blank.push(taken.title());
                        }
                        acceptance.add(taken);
                    }
                }
            }
            if self.purpose.page {
                let decides = deciding.contains(&(seen.name, item.frame)) && self.deciding < MOST_DECIDING;
                if !is_sequence || is_compared || decides {
                    self.deciding += usize::from(is_sequence && !is_compared);
                    let view = View::of_frame(seen, session.scene(), &self.labels);
                    self.views.push(view.in_sequence(is_sequence.then_some(item.frame)));
                }
            }
        }
        if let Some(ground) = &mut self.ground
            && is_step
        {
            ground.add(&Seen { scene, labels: &self.labels, frames: &seen_by, ideal: &[], rays_per_s: None });
        }
    }

    /// Concludes what the frames said, once the casting of all of them has taken so many seconds.
    pub fn finish(mut self, seconds: f64) -> Taken {
        let session = self.session;
        let job = &*session.job;
        let seen = Seen {
            scene: session.scene(),
            labels: &self.labels,
            frames: &[],
            ideal: &[],
            rays_per_s: Some(self.rays as f64 / seconds),
        };
        let is_sequence = self.steps.is_sequence();
        let places = job.places.expectations.iter().map(|place| Some(place.clone()));
        let places = places.chain(std::iter::repeat(None));
        let concluded = job.expectations.iter().zip(self.tallies).zip(places);
        self.outcome.expectations = concluded
            .map(|((expectation, tally), written_at)| ExpectationOutcome {
                written_at,
                ..expectation.conclude(tally, &seen, is_sequence)
            })
            .collect();
        if let Some(comparison) = self.comparison {
            comparison.finish(job, self.outcome);
        }
        if let Some(acceptance) = &mut self.acceptance {
            acceptance.finish(job, session.scene());
        }
        let fails = !self.outcome.failures().is_empty();
        self.outcome.verdict = match &self.acceptance {
            _ if fails => Verdict::Failed,
            Some(acceptance) if !acceptance.is_there() => Verdict::Accepted,
            _ => Verdict::Passed,
        };
        let shown = Shown {
            views: self.views,
            rig: match self.purpose.page {
                true => Rig { ground: self.ground.clone().filter(|map| map.share() > 0.0), ..rig(session) },
                false => Rig::default(),
            },
        };
        Taken { acceptance: self.acceptance, blank: self.blank, ground: self.ground, shown }
    }

    /// The ground that the rig sees is looked at in the zone of the job's own expectation of coverage, or 20 m each way.
    fn zone(&self) -> Zone {
        let expected = self.session.job.expectations.iter().map(|expectation| &expectation.what);
        let own = expected.clone().find_map(|what| match what {
            Expected::Coverage { zone, .. } => Some(zone.clone()),
            _ => None,
        });
        let ground = expected.clone().find_map(|what| match what {
            Expected::BlindZone { ground, .. } => Some(ground.clone()),
            _ => None,
        });
        own.unwrap_or_else(|| Zone {
            ground: ground.unwrap_or_default(),
            x_m: [-20.0, 20.0],
            y_m: [-20.0, 20.0],
            cell_m: 0.1,
        })
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
    Vehicle::find(session.scene(), body, &session.job.trajectory.pose_at(session.job.sequence.start_s))
}
