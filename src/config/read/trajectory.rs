//! Trajectories, of the body and of actors.

use std::sync::Arc;

use glam::DVec3;

use super::super::job::{FromScene, InScene, Owner};
use super::super::keys::motion::{
    ACTOR_POSE, ANGULAR, AXES, BODY_POSE, FILE, INTERPOLATION, LINEAR, NODE, POSES, RATE, TIME, TIMES, TWIST,
};
use super::super::kinds::Nested;
use super::super::plausibility;
use super::super::table::{AnyKey, Key, Table};
use super::pose::{Placed, placed, pose};
use super::pose_files::{self, PoseFiles, Poses};
use crate::frame::{BODY_FROM_OPTICAL, Pose};
use crate::motion::{Path, Trajectory};
use crate::source::{Report, Span, Spanned};

/// A trajectory as it is read.
pub(super) struct Given {
    /// The trajectory; of one that the scene decides, a place that it does not stay at.
    pub trajectory: Trajectory,
    /// What the scene decides, and where the job asks for it.
    pub wanted: Option<Spanned<InScene>>,
    /// Where the poses are named.
    pub span: Span,
}

impl Given {
    /// What stands at the world's origin until its place is drawn.
    pub fn at_origin(span: Span) -> Self {
        Self { trajectory: Trajectory::Fixed(Pose::IDENTITY), wanted: None, span }
    }

    /// The question to the scene about the body's place, if there is one.
    pub fn asked_of_scene(&self, report: &Report) -> Option<FromScene> {
        let Spanned { value, span } = self.wanted.clone()?;
        Some(FromScene { owner: Owner::Body, wanted: value, place: report.place(span) })
    }
}

/// The body's trajectory. If there is something wrong, it is reported.
pub(super) fn of_body(t: &Table<'_>, files: &PoseFiles) -> Given {
    let Some(node) = t.read(&NODE) else { return trajectory(t, &BODY_POSE, files) };
    let others: [&dyn AnyKey; 4] = [&FILE, &POSES, &TWIST, &BODY_POSE];
    match others.into_iter().find(|key| t.has(*key)) {
        Some(other) => {
            let name = other.name();
            let message = format!("a node of the scene has a place of its own, and this has `{name}`, too");
            t.report().error(t.report().later(node.span, t.span_of(other)), message, "one too many", None);
        }
        // What belongs to poses says nothing of a node either.
        None => drop(trajectory(t, &BODY_POSE, files)),
    }
    let wanted = Spanned { value: InScene::Node(node.value.to_owned()), span: node.span };
    Given { wanted: Some(wanted), ..Given::at_origin(node.span) }
}

/// The trajectory of an actor, which the scene does not decide. If there is something wrong, it is reported.
pub(super) fn of_actor(t: &Table<'_>, files: &PoseFiles) -> Given {
    let given = trajectory(t, &ACTOR_POSE, files);
    if let Some(wanted) = &given.wanted {
        let help = "to have it follow a part of the scene, put it below that in the scene's file";
        t.report().error(
            wanted.span,
            "an actor does not stand where a camera does",
            "expected a pose in numbers",
            Some(help.into()),
        );
    }
    given
}

/// The trajectory of a table, a node apart; `place` is its key for a pose.
fn trajectory(t: &Table<'_>, place: &Key<Nested>, files: &PoseFiles) -> Given {
    let report = t.report();
    let ways: [&dyn AnyKey; 3] = [&FILE, &POSES, &TWIST];
    let given: Vec<&dyn AnyKey> = ways.into_iter().filter(|key| t.has(*key)).collect();
    let at = placed(t, place);
    let (file, list, twist) = (t.read(&FILE), t.read(&POSES), t.read(&TWIST));
    let (interpolation, rate, times, is_optical) =
        (t.value(&INTERPOLATION), t.read(&RATE), t.read(&TIMES), t.read(&AXES));
    let span = given.first().map_or(t.span_of(place), |key| t.span_of(*key));
    let fixed = |pose: Pose| Given { trajectory: Trajectory::Fixed(pose), wanted: None, span };
    if let [first, second, ..] = given[..] {
        let message =
            format!("a trajectory has `{}` or `{}`, and this has both", first.name(), second.name());
        report.error(report.later(t.span_of(first), t.span_of(second)), message, "one too many", None);
        return fixed(Pose::IDENTITY);
    }
    let needs = |key: &dyn AnyKey, others: &[&dyn AnyKey], what: &str| {
        if t.has(key) && !others.iter().any(|other| t.has(*other)) {
            let message = format!("`{}` says nothing without {what}", key.name());
            report.error(t.span_of(key), message, format!("expected {what}, too"), None);
        }
    };
    needs(&INTERPOLATION, &[&FILE, &POSES], "`file` or `poses`");
    for key in [&RATE as &dyn AnyKey, &TIMES, &AXES] {
        needs(key, &[&FILE], "`file`");
    }
    let start = match at {
        Placed::At(pose) => pose,
        Placed::AsCamera(camera) => {
            if let [way] = given[..] {
                let message = format!("a camera of the scene is no start of `{}`", way.name());
                report.error(camera.span, message, "expected a pose in numbers", None);
            }
            let wanted = Spanned { value: InScene::Camera(camera.value), span: camera.span };
            return Given { wanted: Some(wanted), ..fixed(Pose::IDENTITY) };
        }
    };
    if let Some(twist) = twist {
        let linear_m_s = DVec3::from_array(twist.value.value(&LINEAR));
        let angular_rad_s = DVec3::from_array(twist.value.value(&ANGULAR).map(f64::to_radians));
        let trajectory = Trajectory::Twist { start, linear_m_s, angular_rad_s };
        return Given { trajectory, wanted: None, span };
    }
    let read = match (file, list) {
        (Some(file), _) => files.text(report, file).and_then(|source| {
            of_file(report, file, source, files, (rate, times), is_optical.map(|axes| axes.value))
        }),
        (_, Some(list)) => of_list(report, &list.value),
        _ => return fixed(start),
    };
    let Some(read) = read else { return fixed(Pose::IDENTITY) };
    let poses = read.poses.iter().map(|pose| start * *pose).collect();
    match Path::new(read.times_s, poses, interpolation) {
        Ok(path) => {
            if let Some(doubt) = plausibility::pose_spacing(&path) {
                let after = path.deviation().map_or(0, |deviation| deviation.after);
                report.doubt(read.spans.get(after).copied().unwrap_or(span), doubt);
            }
            Given { trajectory: Trajectory::Path(Arc::new(path)), wanted: None, span }
        }
        Err(problem) => {
            report.error(span, format!("these poses are no trajectory: {problem}"), "", None);
            fixed(Pose::IDENTITY)
        }
    }
}

/// The poses of a file with their times.
fn of_file(
    report: &Report,
    file: Spanned<&str>,
    source: u32,
    files: &PoseFiles,
    (rate, times): (Option<Spanned<f64>>, Option<Spanned<&str>>),
    is_optical: Option<bool>,
) -> Option<Poses> {
    let mut read = pose_files::poses(report, file, source)?;
    match (read.is_kitti, rate, times) {
        (true, Some(rate), None) => {
            read.times_s = (0..read.poses.len()).map(|k| k as f64 / rate.value).collect();
        }
        (true, None, Some(times)) => {
            read.times_s = pose_files::times(report, files.text(report, times)?, &read)?;
        }
        (true, None, None) => {
            let help = "add `rate_hz = 10.0`, or `times = \"times.txt\"`, a file with one time a line";
            return report.fail(
                file.span,
                "KITTI's poses have no times",
                "needs `rate_hz` or `times`",
                Some(help.into()),
            );
        }
        (true, Some(rate), Some(times)) => {
            let span = report.later(rate.span, times.span);
            return report.fail(span, "the poses have both `rate_hz` and `times`", "one too many", None);
        }
        (false, None, None) => {}
        (false, rate, times) => {
            let span = rate.map(|rate| rate.span).or(times.map(|times| times.span)).unwrap_or(file.span);
            return report.fail(span, "the file has the times of its poses", "leave this out", None);
        }
    }
    if is_optical.unwrap_or(read.is_kitti) {
        let optical_from_body = BODY_FROM_OPTICAL.inverse();
        read.poses.iter_mut().for_each(|pose| *pose = BODY_FROM_OPTICAL * *pose * optical_from_body);
    }
    Some(read)
}

/// The poses of a list in the job.
fn of_list(report: &Report, tables: &[Table<'_>]) -> Option<Poses> {
    let mut found = Poses::default();
    for t in tables {
        let (time, pose) = (t.read(&TIME), pose(t));
        let time = time?;
        if let Some(before) = found.times_s.last().filter(|before| time.value <= **before) {
            let message = format!("`t_s` is {}, and the pose before has {before}", time.value);
            return report.fail(time.span, message, "expected a later time", None);
        }
        found.times_s.push(time.value);
        found.poses.push(pose);
        found.spans.push(t.span);
    }
    Some(found)
}
