//! The halos of bright returns, in which other beams of the same frame see them.
//!
//! A pulse sends a little of its light, and its receiver takes a little, from directions beside its own. A retroreflector there
//! sends back so much that this little is detected. Each return is such a source for all pulses of the frame that pass it.

use std::collections::HashMap;

use glam::DVec3;

use super::light::{HALOS, Light, Target};
use crate::scan::Cause;
use crate::sensor::{Blooming, Capture, Pulse};

/// The energy of light, relative to the noise, below which it is left out: a hundredth of the noise changes nothing.
const LEAST_ENERGY: f64 = 0.01;

/// Light that other pulses see.
#[derive(Clone, Copy, Debug)]
pub(super) struct Source {
    /// The number of the pixel that it was found with.
    pixel: u32,
    /// The direction of that pixel's pulse, in the sensor's body frame.
    direction: DVec3,
    length_m: f64,
    energy: f64,
    target: Target,
}

/// The sources of a frame, by their direction.
pub(super) struct Halo<'b> {
    blooming: &'b Blooming,
    sources: Vec<Source>,
    /// The indices of the sources in each cell of space, in ascending order. Directions are unit vectors.
    cells: HashMap<[i32; 3], Vec<u32>>,
    reach_cosine: f64,
    cell: f64,
}

/// The rule for what becomes a source.
pub(super) struct Brightness {
    least: f64,
}

impl Brightness {
    /// The energy from which on light is seen by any other pulse of a capture.
    pub fn of(blooming: &Blooming, capture: &Capture) -> Self {
        // The least angle between neighbours, in the middle of the image and at its edges.
        let direction = |row, column| capture.pulse(row, column).map(|pulse: Pulse| pulse.direction);
        let (rows, columns) = (capture.rows(), capture.columns());
        let mut least_rad = blooming.reach.radians();
        for row in [0, rows / 2, rows.saturating_sub(2)] {
            for column in [0, columns / 2, columns.saturating_sub(2)] {
                let here = direction(row, column);
                for (row, column) in [(row + 1, column), (row, column + 1)] {
                    if row < rows
                        && column < columns
                        && let (Some(here), Some(there)) = (here, direction(row, column))
                    {
                        least_rad = least_rad.min(angle_between(here, there));
                    }
                }
            }
        }
        Self { least: LEAST_ENERGY / blooming.share(least_rad).max(1e-300) }
    }

    /// Adds the light of a pixel that other pulses may see.
    pub fn add(&self, pixel: u32, pulse: &Pulse, lights: &[Light], sources: &mut Vec<Source>) {
        let is_bright = |light: &&Light| light.energy >= self.least;
        sources.extend(lights.iter().filter(is_bright).map(|light| Source {
            pixel,
            direction: pulse.direction,
            length_m: light.length_m,
            energy: light.energy,
            target: light.target,
        }));
    }
}

impl<'b> Halo<'b> {
    /// The halos of sources, which are in an order that does not depend on threads.
    pub fn new(blooming: &'b Blooming, sources: Vec<Source>) -> Self {
        let reach_rad = blooming.reach.radians();
        // Two directions within reach are at most so far apart along each axis.
        let cell = 2.0 * libm::sin(0.5 * reach_rad);
        let mut halo =
            Self { blooming, sources, cells: HashMap::new(), reach_cosine: libm::cos(reach_rad), cell };
        for (index, source) in (0..).zip(&halo.sources) {
            halo.cells.entry(cell_of(source.direction, cell)).or_default().push(index);
        }
        halo
    }

    /// Adds the light that a pixel's pulse, number `number` of its strip, sees of other pixels' returns.
    pub fn add(&self, pixel: u32, number: u32, pulse: &Pulse, lights: &mut Vec<Light>) {
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
        for index in near {
            let source = &self.sources[index as usize];
            if source.pixel == pixel || source.direction.dot(pulse.direction) < self.reach_cosine {
                continue;
            }
            let energy =
                source.energy * self.blooming.share(angle_between(source.direction, pulse.direction));
            if energy >= LEAST_ENERGY {
                lights.push(Light {
                    pulse: number,
                    path: HALOS + index,
                    range_m: pulse.range_m(source.length_m),
                    length_m: source.length_m,
                    energy,
                    clear_air: 1.0,
                    cause: Cause::Blooming,
                    target: source.target,
                });
            }
        }
    }
}

fn cell_of(direction: DVec3, cell: f64) -> [i32; 3] {
    (direction / cell).floor().to_array().map(|c| c as i32)
}

/// The angle between two unit vectors, in radians, without the loss of digits that a cosine has near 0.
fn angle_between(a: DVec3, b: DVec3) -> f64 {
    libm::atan2(a.cross(b).length(), a.dot(b))
}
