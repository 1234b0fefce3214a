//! The places that a job draws for its actors.
//!
//! ```text
//! survey  what there is to know before any place is drawn: surfaces by name, the boxes of actors
//! ```

mod survey;

use std::path::PathBuf;

use serde_json::json;

use super::loading::read_scene;
use crate::config::{Actor, Job, Placing};
use crate::error::Error;
use crate::motion::Trajectory;
use crate::placing::{self, Found, Obstacles, Standing};
use crate::rng::Rng;
use survey::Survey;

/// Draws the places of a job's actors, puts their trajectories there, and writes down what was drawn: for the frames whose job this
/// is, or as the first frame has it. A place depends on the scene, on the actors with trajectories, and on those whose places are
/// drawn before it, which are those before it in the job.
///
/// # Errors
/// [`Error::Config`] if a surface is not there or an actor finds no place on it; [`Error::Scene`] if a file can't be read.
pub(super) fn draw(job: &mut Job, allowed_folders: &[PathBuf]) -> Result<(), Error> {
    if job.actors.iter().all(|actor| actor.placing.is_none()) {
        return Ok(());
    }
    // The scene is read without what has no place yet, so that no place depends on what is drawn after it.
    let scene = read_scene(job, allowed_folders, |actor| actor.placing.is_none())?.scene;
    let mut drawn = Vec::new();
    let mut standing = Vec::new();
    // Those of the run are the first ones in the job.
    for is_of_run in [true, false] {
        let wanted: Vec<(usize, &Actor, &Placing)> = job
            .actors
            .iter()
            .enumerate()
            .filter_map(|(index, actor)| Some((index, actor, actor.placing.as_ref()?)))
            .filter(|(.., placing)| placing.is_of_run == is_of_run)
            .collect();
        if wanted.is_empty() {
            continue;
        }
        let mut survey = Survey::new(job, allowed_folders, &scene, &times_s(job, is_of_run));
        let sites = wanted.iter().map(|(_, actor, placing)| survey.site(actor, placing));
        let sites: Vec<_> = sites.collect::<Result<_, _>>()?;
        let (low, high) = sites
            .iter()
            .map(survey::Site::reach)
            .reduce(|all, one| (all.0.min(one.0), all.1.max(one.1)))
            .unwrap_or_default();
        let obstacles = Obstacles::of(&survey.snapshots, low, high);
        let boxes = survey.boxes();
        for ((index, actor, placing), site) in wanted.into_iter().zip(sites) {
            let others: Vec<Standing> = boxes
                .iter()
                .filter(|other| !site.is_on(other))
                .map(|other| other.standing)
                .chain(standing.iter().copied())
                .collect();
            // No frame has the number of the run's places.
            let frame = if is_of_run { u64::MAX } else { job.frame.unwrap_or(0) };
            let mut rng = Rng::named(job.seed, frame, &key_of(actor));
            let found = placing::find(
                &site.body,
                &site.ground.surface,
                placing.yaw_deg,
                &obstacles,
                &others,
                &mut rng,
            );
            let found = found.map_err(|refused| survey::no_place(job, actor, placing, refused))?;
            standing.push(site.body.standing(&found));
            drawn.push((index, found, is_of_run));
        }
    }
    for (index, found, is_of_run) in drawn {
        put(job, index, &found, is_of_run);
    }
    Ok(())
}

/// The key of an actor's place, by which it is drawn and written down.
fn key_of(actor: &Actor) -> String {
    format!("actor.{}.place", actor.name)
}

/// The times at which places have to be free: the start of the sequence for places of the run, else the start of the frame of each
/// sensor.
fn times_s(job: &Job, is_of_run: bool) -> Vec<f64> {
    let of_frame = |sensor| job.capture(sensor, job.frame.unwrap_or(0)).start_s;
    let mut times: Vec<f64> = match is_of_run {
        true => vec![job.sequence.start_s],
        false => (0..job.sensors.len()).map(of_frame).collect(),
    };
    times.sort_by(f64::total_cmp);
    times.dedup();
    times
}

/// Puts an actor where its place is, and writes that down.
fn put(job: &mut Job, index: usize, found: &Found, is_of_run: bool) {
    let actor = &mut job.actors[index];
    actor.trajectory = Trajectory::Fixed(found.world_from_body());
    let pose = json!({ "position_m": found.position_m.to_array(), "rpy_deg": [0.0, 0.0, found.yaw_deg] });
    let key = key_of(actor);
    // The job that is told has the values of the run in their places.
    if is_of_run
        && let Some(told) = job.resolved.pointer_mut(&format!("/actor/{index}"))
        && let Some(told) = told.as_object_mut()
    {
        told.shift_remove("place");
        told.insert("trajectory".to_owned(), json!({ "pose": pose.clone() }));
    }
    if is_of_run || job.frame.is_some() {
        job.drawn.insert(key, pose);
    }
}
