//! The boxes of a frame's targets: where each is, how it moves, and how much of it is seen.

use std::collections::BTreeMap;

use glam::DVec3;

use super::image::{self, Bounds, Shown};
use super::oriented::OrientedBox;
use super::target::{Target, Targets};
use crate::frame::Pose;
use crate::motion::Velocity;
use crate::scan::Frame;
use crate::scene::Scene;
use crate::sensor::{Capture, Sight};

/// What is true of a target in a frame.
#[derive(Clone, Debug)]
pub struct BoxTruth<'t> {
    /// The target.
    pub target: &'t Target,
    /// The time of the box, on the clock of the trajectory: the mean of the times of the pulses that came back from it, or the
    /// middle of the frame if none did.
    pub time_s: f64,
    /// The box, in the world.
    pub oriented: OrientedBox,
    /// The pose of the sensor at the time of the box. A camera's is that of its body frame (x forward).
    pub world_from_sensor: Pose,
    /// The velocities of what is at the box's centre, in the world's axes.
    pub velocity: Velocity,
    /// The returns that the target gave.
    pub points: u64,
    /// The pixels with a return from the target.
    pub pixels: u64,
    /// The pixels that would have a return from the target if nothing else were in the scene.
    pub pixels_alone: u64,
    /// The share of the box's volume that lies outside of what the frame covers, at the time of the box. It is counted on the
    /// centres of 16 × 16 × 16 equal cells of the box.
    pub truncation: f64,
    /// What a camera's image shows of it.
    pub shown: Option<Shown>,
    /// The bounds in a camera's image of the projections of the target's vertices at the time of the box, cut off at its edges.
    pub projected_px: Option<Bounds>,
}

/// The cells along each side of a box by which its truncation is counted.
const CELLS: u32 = 16;

/// What a frame saw of a target.
#[derive(Clone, Copy, Default)]
struct Seen {
    points: u64,
    pixels: u64,
    /// The sum of the times of all its returns, in seconds from the frame's start.
    times_s: f64,
}

/// The boxes of the targets that a frame would have a return from if each were alone, by their tracks. `pixels_alone` counts those
/// returns, by track.
pub fn boxes<'t>(
    scene: &Scene,
    targets: &'t Targets,
    capture: &Capture,
    frame: &Frame,
    pixels_alone: &BTreeMap<u32, u64>,
) -> Vec<BoxTruth<'t>> {
    let seen = seen(targets, capture, frame);
    let sight = Sight::of(capture);
    let camera = Some(&capture.sensor.pattern).filter(|pattern| pattern.is_camera());
    let mut shown = camera.map_or_else(BTreeMap::new, |_| image::shown(frame, targets));
    let mut found = Vec::new();
    for target in targets.iter() {
        let of_target = seen.get(&target.track).copied().unwrap_or_default();
        let alone = pixels_alone.get(&target.track).copied().unwrap_or(0).max(of_target.pixels);
        if alone == 0 {
            continue;
        }
        let from_start_s = match of_target.points {
            0 => 0.5 * capture.duration_s(),
            points => of_target.times_s / points as f64,
        };
        let time_s = capture.cast_at_s(from_start_s);
        let Some((oriented, velocity)) = target.at(scene, time_s) else { continue };
        let world_from_sensor = capture.world_from_sensor(from_start_s);
        let project = |camera| image::projected(camera, &world_from_sensor, &target.points_at(scene, time_s));
        found.push(BoxTruth {
            target,
            time_s,
            oriented,
            world_from_sensor,
            velocity,
            points: of_target.points,
            pixels: of_target.pixels,
            pixels_alone: alone,
            truncation: truncation(&oriented, &world_from_sensor, &sight),
            shown: camera.map(|_| shown.remove(&target.track).unwrap_or_default()),
            projected_px: camera.and_then(project),
        });
    }
    found
}

impl BoxTruth<'_> {
    /// The share of the pixels that would show the target, were it alone, in which something else hides it.
    pub fn occlusion(&self) -> f64 {
        1.0 - self.pixels as f64 / self.pixels_alone as f64
    }
}

fn seen(targets: &Targets, capture: &Capture, frame: &Frame) -> BTreeMap<u32, Seen> {
    let mut seen: BTreeMap<u32, Seen> = BTreeMap::new();
    for pixel in 0..frame.pixels() {
        let mut last = None;
        for slot in frame.slots(pixel) {
            let Some(track) = targets.track_of(frame.returns().instance[slot]) else { continue };
            let (row, column) = (pixel / frame.columns(), pixel % frame.columns());
            let of_target = seen.entry(track).or_default();
            of_target.points += 1;
            of_target.times_s += capture.time_s(row, column).unwrap_or(0.0);
            // The returns of a pixel are few, and those of one target follow each other.
            of_target.pixels += u64::from(last != Some(track));
            last = Some(track);
        }
    }
    seen
}

fn truncation(oriented: &OrientedBox, world_from_sensor: &Pose, sight: &Sight) -> f64 {
    let sensor_from_box = world_from_sensor.inverse() * oriented.world_from_box;
    let middle = |cell: u32| (f64::from(cell) + 0.5) / f64::from(CELLS) - 0.5;
    let mut outside = 0_u32;
    for cell in 0..CELLS.pow(3) {
        let cells = [cell % CELLS, cell / CELLS % CELLS, cell / (CELLS * CELLS)];
        let point = DVec3::from_array(cells.map(middle)) * oriented.size_m;
        outside += u32::from(!sight.covers(sensor_from_box.point(point)));
    }
    f64::from(outside) / f64::from(CELLS.pow(3))
}
