//! Casting rays of arrays, with the results in arrays.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use beamcast::glam::DVec3;
use beamcast::scene::{Scene, SourceTriangles};
use beamcast::trace::all_hits;
use beamcast::{Cast as _, Hit, Origins, Rays, Tracer};
use rayon::prelude::*;

use crate::arrays::{Number, RayArrays};

/// The id of nothing, which Open3D calls INVALID_ID.
pub const INVALID_ID: u32 = u32::MAX;

/// Rays that are cast in one call of the tracer: enough for its streams, and few enough that all about them stays in the cache.
const BATCH: usize = 512;

/// The same of tiles, which packets take and not streams.
const TILED_BATCH: usize = 256;

/// Rays that a thread takes at a time where they are in no image.
const RUN: usize = 16 * BATCH;

/// The rows and columns of a tile of an image, whose rays a packet of the tracer has.
const TILE: [usize; 2] = [4, 32];

/// Rays that are not worth waking threads for.
pub const FEW: usize = 1024;

/// A scene that is ready to be cast at.
pub struct Target {
    /// The tracer.
    pub tracer: Tracer,
    /// Where triangles come from, if the scene was made of arrays.
    pub sources: Option<SourceTriangles>,
}

impl Target {
    /// The ids of the geometry and of the primitive of a hit. Of a scene that was read from a file these are its object and its triangle,
    /// as frames number them from 0.
    #[inline]
    fn ids(&self, hit: &Hit, last: &mut Option<(u32, u32, u32)>) -> (u32, u32) {
        if let Some(sources) = &self.sources {
            return sources.of(hit.triangle);
        }
        let scene: &Scene = self.tracer.scene();
        let id = scene.arrangement.placements[hit.placement as usize].first_triangle + hit.triangle;
        let object = match *last {
            Some((placement, triangle, object)) if (placement, triangle) == (hit.placement, hit.triangle) => {
                object
            }
            _ => scene.surface(hit.placement, hit.triangle).object,
        };
        *last = Some((hit.placement, hit.triangle, object));
        (object, id)
    }
}

/// The arrays of the nearest hits, or a part of them.
pub struct HitArrays<'a> {
    /// Depths in lengths of the direction, rounded to 32 bits; infinite where nothing is hit.
    pub t_hit: &'a mut [f32],
    /// The same in 64 bits.
    pub t_hit_f64: &'a mut [f64],
    /// Ids of geometries.
    pub geometry_ids: &'a mut [u32],
    /// Ids of primitives.
    pub primitive_ids: &'a mut [u32],
    /// Two barycentric weights a ray.
    pub primitive_uvs: &'a mut [f32],
    /// Three components of a normal a ray.
    pub primitive_normals: &'a mut [f32],
}

impl HitArrays<'_> {
    /// Writes the hits of rays that follow each other in the arrays, from ray `first` on.
    #[inline(always)]
    fn write(&mut self, first: usize, hits: &[Option<Hit>], mut ids: impl FnMut(&Hit) -> (u32, u32)) {
        let run = first..first + hits.len();
        let depths = self.t_hit[run.clone()].iter_mut().zip(&mut self.t_hit_f64[run.clone()]);
        let numbers = self.geometry_ids[run.clone()].iter_mut().zip(&mut self.primitive_ids[run.clone()]);
        let (uvs, _) = self.primitive_uvs[2 * run.start..2 * run.end].as_chunks_mut::<2>();
        let (normals, _) = self.primitive_normals[3 * run.start..3 * run.end].as_chunks_mut::<3>();
        let places = depths.zip(numbers).zip(uvs.iter_mut().zip(normals));
        for (hit, (((narrow, wide), (geometry, primitive)), (uv, normal))) in hits.iter().zip(places) {
            match hit {
                Some(hit) => {
                    (*narrow, *wide) = (hit.t as f32, hit.t);
                    (*geometry, *primitive) = ids(hit);
                    *uv = [hit.u as f32, hit.v as f32];
                    *normal = hit.normal.as_vec3().to_array();
                }
                None => {
                    (*narrow, *wide) = (f32::INFINITY, f64::INFINITY);
                    (*geometry, *primitive) = (INVALID_ID, INVALID_ID);
                    (*uv, *normal) = ([0.0; 2], [0.0; 3]);
                }
            }
        }
    }
}

/// The memory of a batch.
#[derive(Default)]
struct Batch {
    /// The rays of the batch, by their numbers in their unit of work: runs of rays that follow each other.
    runs: Vec<Range<usize>>,
    origins: Vec<DVec3>,
    directions: Vec<DVec3>,
    hits: Vec<Option<Hit>>,
}

impl Batch {
    /// Takes up the rays of the runs, in a unit that begins at ray `start`.
    #[inline(always)]
    fn fill<T: Number>(&mut self, rays: &RayArrays<'_, T>, start: usize) {
        self.origins.clear();
        self.directions.clear();
        for run in &self.runs {
            rays.append(start + run.start..start + run.end, &mut self.origins, &mut self.directions);
        }
    }

    fn rays(&self) -> Rays<'_> {
        Rays::unlimited(Origins::Each(&self.origins), &self.directions)
    }
}

/// The order in which rays are cast: that of the array, or tile by tile if they are the pixels of images.
#[derive(Clone, Copy)]
pub struct Order {
    /// The rays of a unit of work.
    unit: usize,
    /// The columns of the images, if there are any.
    columns: Option<usize>,
}

impl Order {
    /// The order of so many rays in rows of so many pixels. One row, or narrow ones, are no image.
    pub fn of(count: usize, columns: usize) -> Self {
        let [height, width] = TILE;
        if columns < width || count < 2 * columns || columns > u32::MAX as usize {
            return Self { unit: RUN, columns: None };
        }
        Self { unit: height * columns, columns: Some(columns) }
    }

    /// Calls `visit` with the numbers of the rays of a unit that has `count` rays, batch by batch.
    fn batches(&self, count: usize, batch: &mut Batch, mut visit: impl FnMut(&mut Batch)) {
        let Some(columns) = self.columns else {
            for first in (0..count).step_by(BATCH) {
                batch.runs.clear();
                batch.runs.push(first..(first + BATCH).min(count));
                visit(batch);
            }
            return;
        };
        // The last unit may have fewer rows, of which all are whole: the number of rays is a multiple of the columns.
        let rows = count / columns;
        let tiles_a_batch = (TILED_BATCH / (rows.max(1) * TILE[1])).max(1);
        for first in (0..columns).step_by(TILE[1] * tiles_a_batch) {
            batch.runs.clear();
            for left in (first..(first + TILE[1] * tiles_a_batch).min(columns)).step_by(TILE[1]) {
                for row in 0..rows {
                    let from = row * columns;
                    batch.runs.push(from + left..from + (left + TILE[1]).min(columns));
                }
            }
            visit(batch);
        }
    }
}

/// Casts rays, and writes their nearest hits. It stops early when it is cancelled; the arrays are of no use then.
pub fn nearest<T: Number>(
    target: &Target,
    rays: &RayArrays<'_, T>,
    order: Order,
    out: HitArrays<'_>,
    cancelled: &AtomicBool,
) {
    let unit = order.unit;
    let cast = |batch: &mut Batch, start: usize, mut out: HitArrays<'_>| {
        let mut last = None;
        order.batches(out.t_hit.len(), batch, |batch| {
            if cancelled.load(Ordering::Relaxed) {
                return;
            }
            batch.fill(rays, start);
            let mut hits = std::mem::take(&mut batch.hits);
            // The tracer writes each of them.
            hits.resize(batch.directions.len(), None);
            target.tracer.cast(&batch.rays(), &mut hits);
            let mut rest = &hits[..];
            for run in &batch.runs {
                let (of_run, after) = rest.split_at(run.len());
                out.write(run.start, of_run, |hit| target.ids(hit, &mut last));
                rest = after;
            }
            batch.hits = hits;
        });
    };
    if rays.count() <= FEW {
        for (number, part) in parts(out, unit).enumerate() {
            cast(&mut Batch::default(), number * unit, part);
        }
        return;
    }
    let parts: Vec<_> = parts(out, unit).enumerate().collect();
    parts
        .into_par_iter()
        .for_each_init(Batch::default, |batch, (number, part)| cast(batch, number * unit, part));
}

/// The parts of arrays that belong to the units of work.
fn parts(out: HitArrays<'_>, unit: usize) -> impl Iterator<Item = HitArrays<'_>> {
    let HitArrays { t_hit, t_hit_f64, geometry_ids, primitive_ids, primitive_uvs, primitive_normals } = out;
    let mut wide = t_hit_f64.chunks_mut(unit);
    let mut geometries = geometry_ids.chunks_mut(unit);
    let mut primitives = primitive_ids.chunks_mut(unit);
    let mut uvs = primitive_uvs.chunks_mut(2 * unit);
    let mut normals = primitive_normals.chunks_mut(3 * unit);
    t_hit.chunks_mut(unit).map_while(move |t_hit| {
        Some(HitArrays {
            t_hit,
            t_hit_f64: wide.next()?,
            geometry_ids: geometries.next()?,
            primitive_ids: primitives.next()?,
            primitive_uvs: uvs.next()?,
            primitive_normals: normals.next()?,
        })
    })
}

/// Writes whether each ray hits anything between two depths, both included. It stops early when it is cancelled.
pub fn occlusions<T: Number>(
    target: &Target,
    rays: &RayArrays<'_, T>,
    [t_min, t_max]: [f64; 2],
    out: &mut [bool],
    cancelled: &AtomicBool,
) {
    let cast = |batch: &mut Batch, start: usize, out: &mut [bool]| {
        for (number, out) in out.chunks_mut(BATCH).enumerate() {
            if cancelled.load(Ordering::Relaxed) {
                return;
            }
            batch.runs.clear();
            batch.runs.push(0..out.len());
            batch.fill(rays, start + number * BATCH);
            let mut hits = std::mem::take(&mut batch.hits);
            let rays = Rays { t_min, t_max, ..batch.rays() };
            if batch.origins.iter().all(|origin| *origin == batch.origins[0]) {
                // Rays of one origin go together in packets, which find nearest hits, in half the time of any hits one by one.
                hits.resize(out.len(), None);
                target.tracer.cast(&rays, &mut hits);
                out.iter_mut().zip(&hits).for_each(|(out, hit)| *out = hit.is_some());
            } else {
                target.tracer.blocked(&rays, out);
            }
            batch.hits = hits;
        }
    };
    if rays.count() <= FEW {
        return cast(&mut Batch::default(), 0, out);
    }
    let units = out.par_chunks_mut(RUN).enumerate();
    units.for_each_init(Batch::default, |batch, (number, part)| cast(batch, number * RUN, part));
}

/// One intersection of a ray with a geometry.
#[derive(Clone, Copy)]
pub struct Intersection {
    /// The number of the ray.
    pub ray: usize,
    /// The id of the geometry and of the primitive.
    pub ids: (u32, u32),
    /// The depth in lengths of the direction.
    pub t: f64,
    /// The barycentric weights of the second and the third corner.
    pub uv: [f64; 2],
}

/// All intersections of rays, in ascending order of the rays and then of the depths. It stops early when it is cancelled.
pub fn intersections<T: Number>(
    target: &Target,
    rays: &RayArrays<'_, T>,
    cancelled: &AtomicBool,
) -> Vec<Intersection> {
    let cast = |batch: &mut Batch, first: usize| {
        if cancelled.load(Ordering::Relaxed) {
            return Vec::new();
        }
        batch.runs.clear();
        batch.runs.push(0..BATCH.min(rays.count() - first));
        batch.fill(rays, first);
        let mut found: Vec<Intersection> = Vec::new();
        let mut last = None;
        for (ray, hit) in all_hits(&target.tracer, &batch.rays()) {
            let ids = target.ids(&hit, &mut last);
            let one = Intersection { ray: first + ray as usize, ids, t: hit.t, uv: [hit.u, hit.v] };
            if found.last().is_none_or(|before| !is_same_place(before, &one)) {
                found.push(one);
            }
        }
        found
    };
    let starts = (0..rays.count()).step_by(BATCH);
    if rays.count() <= FEW {
        return starts.flat_map(|first| cast(&mut Batch::default(), first)).collect();
    }
    let starts: Vec<usize> = starts.collect();
    let parts: Vec<Vec<Intersection>> =
        starts.into_par_iter().map_init(Batch::default, |batch, first| cast(batch, first)).collect();
    parts.concat()
}

/// Half an ulp of a number of 32 bits, relative to it at most: 2⁻²⁴.
const HALF_ULP: f64 = f32::EPSILON as f64 / 2.0;

/// Whether two intersections that follow each other are one place of one surface, where a ray goes through an edge or a vertex that
/// triangles share: as in Open3D, they are of one geometry, and their depths are one number of 32 bits. Depths of f64 of the same
/// point differ by much less than half an ulp of that, 2⁻²⁴ of the depth.
fn is_same_place(before: &Intersection, after: &Intersection) -> bool {
    before.ray == after.ray && before.ids.0 == after.ids.0 && after.t - before.t <= after.t * HALF_ULP
}
