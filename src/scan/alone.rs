//! What a capture would see of each object if it were alone: every surface on a pulse's way, one behind another.

use std::cmp::Ordering;
use std::collections::BTreeMap;
use std::sync::atomic::Ordering::Relaxed;

use rayon::prelude::*;

use super::Progress;
use super::ray_batch::{Ray, RayBatch};
use super::through::Sight;
use crate::scene::Scene;
use crate::sensor::Capture;
use crate::trace::{Cast, Hit};

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
    // Each ray has its column, and the groups that it has met.
    let (mut now, mut next) = (RayBatch::<(usize, Vec<Met>)>::default(), RayBatch::default());
    let fixed = capture.fixed_world_from_sensor();
    for column in columns {
        let Some(pulse) = capture.pulse(row, column) else { continue };
        let pose = fixed.unwrap_or_else(|| capture.world_from_sensor(pulse.time_s));
        let ray = Ray {
            origin: pose.point(pulse.origin),
            direction: pose.direction(pulse.direction),
            time_s: capture.cast_at_s(pulse.time_s),
        };
        now.push((column, Vec::new()), ray, None);
    }
    let mut counts: BTreeMap<u32, u64> = BTreeMap::new();
    let mut hits = Vec::new();
    let limits = &capture.sensor.range;
    while !now.is_empty() {
        now.cast(scene, tracer, &mut hits);
        next.clear();
        for (ray, hit) in hits.iter().enumerate() {
            let (column, ref mut met) = now.known_mut()[ray];
            let mut met = std::mem::take(met);
            let place = |hit: &Hit| {
                let pulse = capture.pulse(row, column)?;
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
            next.push((column, met), now.ray(ray), Some(*hit));
        }
        std::mem::swap(&mut now, &mut next);
    }
    counts
}
