//! What a capture would see of each object if it were alone: every surface on a pulse's way, one behind another.

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::sync::atomic::Ordering::Relaxed;

use glam::DVec3;
use rayon::prelude::*;

use super::Progress;
use super::through::Sight;
use crate::scene::Scene;
use crate::sensor::Capture;
use crate::trace::{Cast, Hit, Origins, Rays};

/// The pixels of a row that are cast as one batch.
const BATCH: usize = 256;

/// The number of pixels that would have a return of each group if nothing else were in the scene: for each pulse and group, the
/// group's triangles on the pulse's way decide, as they would in a scan of that group alone. The first of them is enough if no
/// light passes it. `group_of` gives the group of an object, by the object's id. Groups without such a pixel are left out. `None` if `progress.cancelled` was set.
///
/// One cast meets every triangle on a pulse's way, so the time does not depend on the number of groups; a scene of nothing but
/// the groups' triangles ([`Scene::only`]) makes it short.
pub fn alone(
    scene: &Scene,
    tracer: &impl Cast,
    capture: &Capture,
    group_of: &(impl Fn(u32) -> Option<u32> + Sync),
    progress: &Progress,
) -> Option<BTreeMap<u32, u64>> {
    capture.prepare();
    let (rows, columns) = (capture.rows(), capture.columns());
    let batches = columns.div_ceil(BATCH);
    let counts = (0..rows * batches)
        .into_par_iter()
        .map(|batch| {
            let first = batch % batches * BATCH;
            let pixels = first..columns.min(first + BATCH);
            if progress.cancelled.load(Relaxed) {
                return BTreeMap::new();
            }
            of_batch(scene, tracer, capture, group_of, batch / batches, pixels)
        })
        .reduce(BTreeMap::new, |mut all, some| {
            some.into_iter().for_each(|(group, count)| *all.entry(group).or_default() += count);
            all
        });
    (!progress.cancelled.load(Relaxed)).then_some(counts)
}

/// The rays of a batch that are not at their end yet.
#[derive(Default)]
struct Batch {
    columns: Vec<usize>,
    origins: Vec<DVec3>,
    directions: Vec<DVec3>,
    times_s: Vec<f64>,
    after: Vec<Option<Hit>>,
    /// The groups that each ray has met.
    met: Vec<Vec<Met>>,
}

/// A group that a ray has met, and the surface of it that a sensor would report.
struct Met {
    group: u32,
    sight: Sight,
    is_settled: bool,
}

fn of_batch(
    scene: &Scene,
    tracer: &impl Cast,
    capture: &Capture,
    group_of: &impl Fn(u32) -> Option<u32>,
    row: usize,
    columns: std::ops::Range<usize>,
) -> BTreeMap<u32, u64> {
    let mut rays = Batch::default();
    let fixed = capture.fixed_world_from_sensor();
    for column in columns {
        let Some(pulse) = capture.pulse(row, column) else { continue };
        let pose = fixed.unwrap_or_else(|| capture.world_from_sensor(pulse.time_s));
        rays.columns.push(column);
        rays.origins.push(pose.point(pulse.origin));
        rays.directions.push(pose.direction(pulse.direction));
        rays.times_s.push(capture.cast_at_s(pulse.time_s));
        rays.after.push(None);
        rays.met.push(Vec::new());
    }
    let mut counts: BTreeMap<u32, u64> = BTreeMap::new();
    let mut hits = Vec::new();
    while !rays.columns.is_empty() {
        hits.clear();
        hits.resize(rays.columns.len(), None);
        let cast = Rays {
            after: Some(&rays.after),
            times_s: scene.arrangement.window.map(|_| rays.times_s.as_slice()),
            ..Rays::unlimited(Origins::Each(&rays.origins), &rays.directions)
        };
        tracer.cast(&cast, &mut hits);
        let mut next = Batch::default();
        let limits = &capture.sensor.range;
        for (ray, hit) in hits.iter().enumerate() {
            let mut met = std::mem::take(&mut rays.met[ray]);
            let place = |hit: &Hit| {
                let pulse = capture.pulse(row, rays.columns[ray])?;
                Some(limits.place_of(&pulse, pulse.range_m(hit.t)))
            };
            let Some(hit) = hit else {
                for Met { group, sight, .. } in met {
                    if sight.seen().and_then(|seen| place(&seen.hit)).is_some_and(Ordering::is_eq) {
                        *counts.entry(group).or_default() += 1;
                    }
                }
                continue;
            };
            let surface = scene.surface(hit.placement, hit.triangle);
            if let Some(group) = group_of(surface.object) {
                let at = met.iter().position(|known| known.group == group).unwrap_or_else(|| {
                    met.push(Met { group, sight: Sight::default(), is_settled: false });
                    met.len() - 1
                });
                let known = &mut met[at];
                if !known.is_settled
                    && let Some(place) = place(hit)
                {
                    let opacity = scene.opacity(hit.placement, hit.triangle, hit.u, hit.v);
                    known.is_settled = known.sight.meet(hit, surface, opacity, place);
                }
            }
            next.columns.push(rays.columns[ray]);
            next.origins.push(rays.origins[ray]);
            next.directions.push(rays.directions[ray]);
            next.times_s.push(rays.times_s[ray]);
            next.after.push(Some(*hit));
            next.met.push(met);
        }
        rays = next;
    }
    counts
}
