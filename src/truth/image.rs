//! Where targets are in a camera's image: bounds, and masks.

use std::collections::BTreeMap;

use glam::DVec3;

use super::target::Targets;
use crate::frame::{BODY_FROM_OPTICAL, Pose};
use crate::scan::Frame;
use crate::sensor::Pattern;

/// Bounds in an image, in pixels from its top left corner: left, top, right and bottom.
pub type Bounds = [f64; 4];

/// What a frame's image shows of a target.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shown {
    /// The bounds of the pixels whose first return is the target's, from edge to edge.
    pub bounds_px: Option<Bounds>,
    /// These pixels, column by column from the top left, as the lengths of runs: the first of pixels that are not among them,
    /// the second of pixels that are, and so on (COCO's uncompressed run lengths).
    pub runs: Vec<u64>,
}

/// What a frame shows of each target, by its track. Targets that are not seen are left out.
pub fn shown(frame: &Frame, targets: &Targets) -> BTreeMap<u32, Shown> {
    /// A mask in the making.
    struct Growing {
        bounds: [usize; 4],
        runs: Vec<u64>,
        /// The pixels that the runs have so far.
        length: usize,
    }
    let (rows, columns) = (frame.rows(), frame.columns());
    let mut growing: BTreeMap<u32, Growing> = BTreeMap::new();
    for column in 0..columns {
        for row in 0..rows {
            let Some(slot) = frame.slot(row * columns + column, 0) else { continue };
            let Some(track) = targets.track_of(frame.returns().instance[slot]) else { continue };
            let place = column * rows + row;
            let none = || Growing { bounds: [column, row, column, row], runs: Vec::new(), length: 0 };
            let Growing { bounds, runs, length } = growing.entry(track).or_insert_with(none);
            let [left, top, right, bottom] = *bounds;
            *bounds = [left.min(column), top.min(row), right.max(column + 1), bottom.max(row + 1)];
            match runs.last_mut() {
                Some(run) if *length == place => *run += 1,
                _ => runs.extend([(place - *length) as u64, 1]),
            }
            *length = place + 1;
        }
    }
    let finish = |(track, Growing { bounds, mut runs, length }): (u32, Growing)| {
        if length < rows * columns {
            runs.push((rows * columns - length) as u64);
        }
        (track, Shown { bounds_px: Some(bounds.map(|edge| edge as f64)), runs })
    };
    growing.into_iter().map(finish).collect()
}

/// The bounds of the projections of points into a camera's image, cut off at the image's edges. Points that the camera has no
/// projection of (they are behind a pinhole camera) do not count. `None` if nothing is within the image.
pub fn projected(camera: &Pattern, world_from_sensor: &Pose, points: &[DVec3]) -> Option<Bounds> {
    let optical_from_world = (*world_from_sensor * BODY_FROM_OPTICAL).inverse();
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for point in points {
        let Some((u, v)) = camera.project(optical_from_world.point(*point)) else { continue };
        (low, high) = ([low[0].min(u), low[1].min(v)], [high[0].max(u), high[1].max(v)]);
    }
    let size = [camera.columns() as f64, camera.rows() as f64];
    let [left, top] = low.map(|edge| edge.max(0.0));
    let [right, bottom] = [0, 1].map(|axis| high[axis].min(size[axis]));
    (left <= right && top <= bottom).then_some([left, top, right, bottom])
}
