//! The halos of bright returns, in which other beams of the same frame see them.
//!
//! A pulse sends a little of its light, and its receiver takes a little, from directions beside its own. A retroreflector there
//! sends back so much that this little is detected. Each return is such a source for all pulses of the frame that pass it.

use std::collections::HashMap;

use glam::DVec3;

use super::light::Target;
use crate::sensor::{Blooming, Pulse};

/// Light that other pulses see.
#[derive(Clone, Copy, Debug)]
pub(super) struct Source {
    /// The number of the pixel that it was found with.
    pub pixel: u32,
    /// The direction of that pixel's pulse, in the sensor's body frame.
    pub direction: DVec3,
    /// The nanosecond at which it is fired.
    pub fired_ns: i64,
    pub length_m: f64,
    pub energy: f64,
    pub target: Target,
}

/// The sources of a frame, by their direction.
pub(super) struct Halo<'b> {
    blooming: &'b Blooming,
    /// The indices of the sources in each cell of space, in ascending order. Directions are unit vectors.
    cells: HashMap<[i32; 3], Vec<u32>>,
    reach_cosine: f64,
    cell: f64,
}

impl<'b> Halo<'b> {
    /// The halos of sources.
    pub fn new(blooming: &'b Blooming, sources: &[Source]) -> Self {
        let reach_rad = blooming.reach.radians();
        // Two directions within reach are at most so far apart along each axis.
        let cell = 2.0 * libm::sin(0.5 * reach_rad);
        let mut halo = Self { blooming, cells: HashMap::new(), reach_cosine: libm::cos(reach_rad), cell };
        for (index, source) in (0..).zip(sources) {
            halo.cells.entry(cell_of(source.direction, cell)).or_default().push(index);
        }
        halo
    }

    /// The sources within reach of a pulse, each with the share of its energy, in ascending order of their indices.
    pub fn shares(&self, pulse: &Pulse, sources: &[Source]) -> Vec<(u32, f64)> {
        let [x, y, z] = cell_of(pulse.direction, self.cell);
        let mut near: Vec<u32> = Vec::new();
        for dx in -1..=1 {
            for dy in -1..=1 {
                for dz in -1..=1 {
                    near.extend(self.cells.get(&[x + dx, y + dy, z + dz]).into_iter().flatten());
                }
            }
        }
        // The order of the sources decides how their energies are added.
        near.sort_unstable();
        let share = |index: u32| {
            let direction = sources[index as usize].direction;
            let is_within = direction.dot(pulse.direction) >= self.reach_cosine;
            is_within.then(|| (index, self.blooming.share(angle_between(direction, pulse.direction))))
        };
        near.into_iter().filter_map(share).collect()
    }
}

fn cell_of(direction: DVec3, cell: f64) -> [i32; 3] {
    (direction / cell).floor().to_array().map(|c| c as i32)
}

/// The angle between two unit vectors, in radians, without the loss of digits that a cosine has near 0.
pub(super) fn angle_between(a: DVec3, b: DVec3) -> f64 {
    libm::atan2(a.cross(b).length(), a.dot(b))
}
