//! The frames of a run, and the returns in them that lie on a target.

use std::collections::BTreeMap;

use glam::DVec3;

use super::target::Target;
use crate::check::outcome::Sight;
use crate::output::SensorFrame;
use crate::scan::{Frame, Return};
use crate::scene::Scene;
use crate::sensor::Pulse;

/// The results of a run, against which expectations are evaluated.
#[derive(Clone, Copy, Debug)]
pub struct Seen<'a> {
    /// The scene that was scanned.
    pub scene: &'a Scene,
    /// The meaning of the scene's labels, in words.
    pub labels: &'a BTreeMap<u32, String>,
    /// The frame of each sensor at one moment.
    pub frames: &'a [SensorFrame<'a>],
    /// The ideal scans of frames whose sensors are not ideal, each with its sensor's name: those that expectations of detection
    /// need.
    pub ideal: &'a [(&'a str, &'a Frame)],
    /// The number of rays that were cast a second, if it was measured.
    pub rays_per_s: Option<f64>,
}

/// A return with its frame and its pixel.
pub(super) struct Point<'a> {
    pub(super) seen: &'a SensorFrame<'a>,
    pub(super) row: usize,
    pub(super) column: usize,
    pub(super) hit: Return,
}

impl Point<'_> {
    pub(super) fn pulse(&self) -> Pulse {
        let pulse = self.seen.capture.pulse(self.row, self.column);
        pulse.expect("what came back was sent")
    }

    pub(super) fn in_body(&self) -> DVec3 {
        self.seen.capture.body_from_sensor.point(self.pulse().point(self.hit.range_m))
    }

    pub(super) fn place(&self) -> String {
        format!("sensor {}, row {}, column {}", self.seen.name, self.row, self.column)
    }

    pub(super) fn sight(&self) -> Sight {
        Sight::Frame {
            sensor: self.seen.name.to_owned(),
            frame: self.seen.capture.frame,
            channel: None,
            pixel: Some([self.row, self.column]),
        }
    }
}

/// The frame of a sensor, to look at a channel of it.
pub(super) fn sight_of(seen: &SensorFrame, channel: Option<&'static str>) -> Sight {
    Sight::Frame { sensor: seen.name.to_owned(), frame: seen.capture.frame, channel, pixel: None }
}

/// The returns of all frames that lie on a target.
pub(super) fn returns_on<'a>(seen: &'a Seen<'a>, target: &'a Target) -> impl Iterator<Item = Point<'a>> {
    seen.frames.iter().flat_map(move |frame| {
        let columns = frame.frame.columns();
        let on_target = frame.frame.iter().filter(|(_, hit)| target.is_hit(hit, seen.scene));
        on_target.map(move |(pixel, hit)| Point {
            seen: frame,
            row: pixel / columns,
            column: pixel % columns,
            hit,
        })
    })
}

/// The surfaces on a target that block beams of a frame nearer than the sensor's least range.
pub(super) fn blockers_on<'a>(
    frame: &'a SensorFrame<'a>,
    scene: &'a Scene,
    target: &'a Target,
) -> impl Iterator<Item = Point<'a>> {
    let columns = frame.frame.columns();
    (0..frame.frame.pixels()).filter_map(move |pixel| {
        let hit = frame.frame.blocker(pixel).filter(|hit| target.is_hit(hit, scene))?;
        Some(Point { seen: frame, row: pixel / columns, column: pixel % columns, hit })
    })
}
