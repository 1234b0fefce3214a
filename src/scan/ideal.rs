//! Scans of ideal sensors: exact ranges of the surfaces that pulses meet.

use std::cmp::Ordering;
use std::sync::atomic::Ordering::Relaxed;

use rayon::prelude::*;

use super::Progress;
use super::frame::{Cause, Frame, Return, ReturnsMut};
use super::ray_batch::{Ray, RayBatch};
use super::strips::{STRIP, SensorPose, TILE};
use super::surface::SeenTriangle;
use super::through::Through;
use crate::scene::Scene;
use crate::sensor::{Capture, Pulse, PulseRow};
use crate::trace::{Cast, Hit};

/// Casts every pulse of a capture as an ideal sensor does. `also` is asked of each strip, with its rays and hits, and its answers
/// come back strip by strip. `None` if `progress.cancelled` was set before the end.
pub(super) fn scan_ideal<T: Send>(
    frame: &mut Frame,
    scene: &Scene,
    tracer: &impl Cast,
    capture: &Capture,
    progress: &Progress,
    also: impl Fn(&Strip, &Batch) -> T + Sync,
) -> Option<Vec<T>> {
    frame.set_size(capture.rows(), capture.columns());
    let fixed = capture.fixed_world_from_sensor().map(SensorPose::new);
    let scanner = Scanner { scene, tracer, capture, fixed, is_see_through: scene.is_see_through() };
    let fill = |batch: &mut Batch, mut strip: Strip| {
        if progress.cancelled.load(Relaxed) {
            return None;
        }
        let rays = scanner.fill(&mut strip, batch);
        progress.rays_done.fetch_add(rays as u64, Relaxed);
        Some(also(&strip, batch))
    };
    strips(frame).into_par_iter().map_init(Batch::default, fill).collect()
}

/// A part of the image that is cast as one batch.
pub(super) struct Strip<'f> {
    pub first_row: usize,
    pub first_column: usize,
    /// The strip's part of each of its rows.
    pub rows: Vec<Piece<'f>>,
}

impl Strip<'_> {
    /// The number of a ray's pixel in an image of so many columns.
    pub fn pixel(&self, batch: &Batch, ray: usize, columns: usize) -> u32 {
        let (row, column) = batch.rays.known()[ray];
        ((self.first_row + usize::from(row)) * columns + self.first_column + usize::from(column)) as u32
    }
}

/// A run of pixels of one row.
pub(super) struct Piece<'f> {
    pub returns: ReturnsMut<'f>,
    pub causes: &'f mut [Cause],
}

/// Cuts a frame into strips. Each strip has its own part of the image to write to.
fn strips(frame: &mut Frame) -> Vec<Strip<'_>> {
    let columns = frame.columns();
    let mut strips = Vec::new();
    let (mut returns, causes) = frame.parts();
    for (band_index, band) in causes.chunks_mut(TILE.0 * columns).enumerate() {
        let first_strip = strips.len();
        for row in band.chunks_mut(columns) {
            for (index, causes) in row.chunks_mut(STRIP).enumerate() {
                if strips.len() == first_strip + index {
                    let (first_row, first_column) = (band_index * TILE.0, index * STRIP);
                    strips.push(Strip { first_row, first_column, rows: Vec::with_capacity(TILE.0) });
                }
                let returns = returns.take(causes.len());
                strips[first_strip + index].rows.push(Piece { returns, causes });
            }
        }
    }
    strips
}

/// The rays and hits of a strip. The memory is kept from strip to strip.
#[derive(Default)]
pub(super) struct Batch {
    /// The rays with the row and the column of their pixels in the strip. A pixel without a pulse has no ray.
    pub rays: RayBatch<(u8, u8)>,
    /// The pulses of a row of the tile whose rays are gathered.
    of_tile: Vec<Option<Pulse>>,
    /// The sensor's pose for each ray, if the sensor moves.
    pub poses: Vec<SensorPose>,
    /// The pulse of each ray, if the sensor needs more than the length of a ray to say what it reports of a hit.
    pub pulses: Vec<Pulse>,
    pub hits: Vec<Option<Hit>>,
    /// The surfaces that are seen through holes and panes.
    pub through: Through,
}

pub(super) struct Scanner<'a, C> {
    pub scene: &'a Scene,
    pub tracer: &'a C,
    pub capture: &'a Capture<'a>,
    /// The sensor's pose, if it stands still.
    pub fixed: Option<SensorPose>,
    /// Whether something in the scene lets light pass.
    pub is_see_through: bool,
}

impl<C: Cast> Scanner<'_, C> {
    /// Casts the pulses of a strip and writes the returns. Returns the number of rays.
    pub fn fill(&self, strip: &mut Strip, batch: &mut Batch) -> usize {
        let Batch { rays, of_tile, poses, pulses, hits, through } = batch;
        rays.clear();
        poses.clear();
        pulses.clear();
        let keeps_pulses = !self.capture.sensor.judges_by_length();
        let width = strip.rows[0].causes.len();
        let pulses_of_rows: Vec<PulseRow> =
            (0..strip.rows.len()).map(|row| self.capture.row(strip.first_row + row)).collect();
        for first in (0..width).step_by(TILE.1) {
            let columns = first..width.min(first + TILE.1);
            for (row, pulses_of_row) in pulses_of_rows.iter().enumerate() {
                of_tile.clear();
                let in_image = strip.first_column + columns.start..strip.first_column + columns.end;
                pulses_of_row.add_pulses(in_image, of_tile);
                for (column, pulse) in columns.clone().zip(&*of_tile) {
                    let Some(pulse) = pulse else {
                        strip.rows[row].set(column, None, Cause::NoPulse);
                        continue;
                    };
                    let pose = match &self.fixed {
                        Some(pose) => pose,
                        None => poses.push_mut(SensorPose::new(self.capture.world_from_sensor(pulse.time_s))),
                    };
                    let ray = Ray {
                        origin: pose.world_from_sensor.point(pulse.origin),
                        direction: pose.world_from_sensor.direction(pulse.direction),
                        time_s: self.capture.cast_at_s(pulse.time_s),
                    };
                    rays.push((row as u8, column as u8), ray, None);
                    if keeps_pulses {
                        pulses.push(*pulse);
                    }
                }
            }
        }
        // The limits of the sensor's range are none of the tracer's. What is nearer blocks the beam, so the tracer has to find
        // it, and what is farther is told apart from nothing at all.
        rays.cast(self.scene, self.tracer, hits);
        let limits = &self.capture.sensor.range;
        let measured = |ray: usize, hit: &Hit| match pulses.get(ray) {
            None => (hit.t, limits.place(hit.t)),
            Some(pulse) => {
                let range_m = pulse.range_m(hit.t);
                (range_m, limits.place_of(pulse, range_m))
            }
        };
        through.clear();
        if self.is_see_through {
            through.look(self.scene, self.tracer, rays, hits, |ray, hit| measured(ray, hit).1);
        }
        let mut last: Option<SeenTriangle> = None;
        for (ray, (&(row, column), hit)) in rays.known().iter().zip(hits.iter()).enumerate() {
            let piece = &mut strip.rows[usize::from(row)];
            let Some(hit) = hit else {
                piece.set(usize::from(column), None, Cause::Nothing);
                continue;
            };
            let (range_m, place) = measured(ray, hit);
            let cause = match place {
                Ordering::Less => Cause::TooNear,
                Ordering::Equal => Cause::Surface,
                Ordering::Greater => {
                    piece.set(usize::from(column), None, Cause::OutOfRange);
                    continue;
                }
            };
            let pose = self.fixed.as_ref().unwrap_or_else(|| &poses[ray]);
            // Neighbouring rays often hit the same triangle.
            let seen = match &mut last {
                Some(seen) if seen.is_of(hit) => seen,
                _ => last.insert(SeenTriangle::of(hit, self.scene)),
            };
            let direction = rays.ray(ray).direction;
            let mut one = seen.receive(&pose.sensor_from_world, direction, hit, range_m);
            if self.is_see_through || seen.varies() {
                one.intensity = seen.intensity(direction, hit, self.scene, through.share(ray));
            }
            piece.set(usize::from(column), Some(one), cause);
        }
        rays.len()
    }
}

impl Piece<'_> {
    #[inline(always)]
    fn set(&mut self, column: usize, one: Option<Return>, cause: Cause) {
        // The memory may hold an earlier frame, so a pixel without a return is written too.
        self.returns.set(column, one.unwrap_or_default());
        self.causes[column] = cause;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_cover_the_image_once() {
        for (rows, columns) in [(1, 1), (16, 1800), (7, 15), (9, 17), (480, 640)] {
            // Each pixel stores its own number and the number of times that it was visited.
            let mut frame = Frame::default();
            frame.set_size(rows, columns);
            let mut visits = 0;
            for mut strip in strips(&mut frame) {
                for (row, piece) in strip.rows.iter_mut().enumerate() {
                    for index in 0..piece.causes.len() {
                        let pixel = (strip.first_row + row) * columns + strip.first_column + index;
                        let one = Return { range_m: pixel as f64, ..Return::default() };
                        piece.returns.set(index, one);
                        piece.causes[index] = Cause::Surface;
                        visits += 1;
                    }
                }
            }
            assert_eq!((visits, frame.return_count()), (rows * columns, rows * columns));
            assert!(frame.iter().all(|(pixel, one)| one.range_m == pixel as f64), "{rows} × {columns}");
        }
    }
}
