//! A published method at the leaves of the exact tracer's hierarchies.

use std::fmt::Debug;
use std::sync::{Arc, Mutex, PoisonError};

use glam::Vec3;

use super::kernel::{Kernel, Ray};
use crate::scene::{Arrangement, Scene};
use crate::trace::batch::NearestHit;
use crate::trace::bvh::{BLOCK_OFFSET_WORDS, Bvh8, Child, LeafBlock, TriangleRef};
use crate::trace::exact::{Candidate, Limits, LocalRay};
use crate::trace::rays::{Cast, Hit, Rays};
use crate::trace::tracer::Tracer;

/// A [`KernelTracer`] of any method.
pub trait MethodTracer: Cast + Debug + Send {
    /// As [`Tracer::rearranged`].
    ///
    /// # Panics
    /// As [`Tracer::rearranged`].
    fn rearranged(&self, arrangement: Arc<Arrangement>) -> Arc<dyn MethodTracer>;

    /// The scene that rays are cast against.
    fn scene(&self) -> &Scene;

    /// The bytes held in addition to the scene.
    fn bytes(&self) -> usize;
}

/// Casts rays one by one and decides by `K`. The hierarchy is traversed conservatively in f64, so every miss is the method's
/// own, and every triangle that the method hits is found. (A depth that is off by more than the boxes are padded may change
/// the order of hits.)
///
/// Rays are rounded to f32 in the space of each mesh. t, u and v are the method's; the normal is the triangle's.
#[derive(Debug)]
pub struct KernelTracer<K: Kernel> {
    exact: Tracer,
    /// The triangles of each mesh; empty if `K` needs to know the origin.
    prepared: Arc<[Prepared<K>]>,
    /// Mesh 0, if `K` needs to know the origin.
    seen: Mutex<Seen<K>>,
}

/// A mesh's triangles in the order of their blocks.
#[derive(Debug)]
struct Prepared<K: Kernel> {
    /// The index of each block's first triangle, by the block's offset.
    first: Vec<u32>,
    triangles: Vec<K::Triangle>,
}

/// Mesh 0 as seen from the origin of the latest rays; prepared once two batches in a row came from there.
#[derive(Debug)]
struct Seen<K: Kernel> {
    origin: Option<Vec3>,
    prepared: Option<Arc<Prepared<K>>>,
}

impl<K: Kernel> Prepared<K> {
    fn new(bvh: &Bvh8, origin: Vec3) -> Self {
        let block_offsets = bvh.blocks.len() / BLOCK_OFFSET_WORDS;
        let mut all = Self { first: vec![0; block_offsets], triangles: Vec::new() };
        let leaves = bvh.nodes.iter().flat_map(|n| n.child).filter(|c| *c != Child::NONE);
        for block_offset in leaves.filter_map(|c| c.get().ok()) {
            let block = LeafBlock::at(&bvh.blocks, block_offset);
            all.first[block_offset as usize] = all.triangles.len() as u32;
            all.triangles.extend((0..block.triangles).map(|lane| K::triangle(corners(&block, lane), origin)));
        }
        all
    }

    fn bytes(&self) -> usize {
        self.first.capacity() * size_of::<u32>() + self.triangles.capacity() * size_of::<K::Triangle>()
    }
}

fn corners(block: &LeafBlock, lane: usize) -> [Vec3; 3] {
    block.positions(lane).map(Vec3::from)
}

/// The best hit so far.
#[derive(Clone, Copy)]
struct MethodHit {
    candidate: Candidate,
    triangle: TriangleRef,
    u: f32,
    v: f32,
}

impl<K: Kernel> KernelTracer<K> {
    /// Prepares every triangle of the scene of `exact`.
    pub fn new(exact: &Tracer) -> Self {
        let meshes = if K::ABOUT.common_origin { &[] } else { &exact.meshes[..] };
        let prepared = meshes.iter().map(|bvh| Prepared::new(bvh, Vec3::ZERO)).collect();
        // What a method finds beside a triangle must not depend on how tight the boxes above it are.
        Self { exact: exact.with_loose_boxes(), prepared, seen: Mutex::default() }
    }

    /// Mesh 0 as seen from an origin, if enough rays come from there to make preparing it worthwhile.
    fn seen_from(&self, origin: Vec3) -> Option<Arc<Prepared<K>>> {
        let mut seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        if seen.origin == Some(origin) {
            let mesh = &self.exact.meshes[0];
            return Some(seen.prepared.get_or_insert_with(|| Arc::new(Prepared::new(mesh, origin))).clone());
        }
        *seen = Seen { origin: Some(origin), prepared: None };
        None
    }

    /// Replaces `best` by the ray's hit in a placement, in whose space the ray is, if that one is nearer. With `any`, the
    /// first hit that is found ends the search.
    #[expect(clippy::too_many_arguments, reason = "the state of one ray's traversal")]
    fn nearest_in(
        &self,
        placement: u32,
        ray: LocalRay,
        limits: &Limits,
        any: bool,
        mesh_0: Option<&Prepared<K>>,
        best: &mut Option<MethodHit>,
        stack: &mut Vec<(Child, f64)>,
    ) {
        let mesh = self.exact.scene.arrangement.placements[placement as usize].mesh;
        let bvh = self.exact.surfaces().bvh_of_mesh(mesh);
        let prepared = self.prepared.get(mesh as usize).or(mesh_0.filter(|_| placement == 0));
        let ray = Ray { origin: ray.origin.as_vec3(), direction: ray.direction.as_vec3() };
        let walked = LocalRay { origin: ray.origin.as_dvec3(), direction: ray.direction.as_dvec3() };
        let test = K::ray(ray);
        let far = best.map_or(limits.t_max, |b| b.candidate.t);
        bvh.traverse_padded(&walked, (limits.t_min, far), SLACK, stack, |block_offset| {
            let block = LeafBlock::at(&bvh.blocks, block_offset);
            let first = prepared.map_or(0, |p| p.first[block_offset as usize]) as usize;
            for lane in 0..block.triangles {
                let crossing = match prepared {
                    Some(p) => K::intersect(&p.triangles[first + lane], &test),
                    None => K::intersect(&K::triangle(corners(&block, lane), ray.origin), &test),
                };
                let Some(crossing) = crossing else { continue };
                let t = f64::from(crossing.t);
                let candidate = Candidate { t, placement, triangle: block.id(lane) };
                if limits.admits(&candidate) && best.is_none_or(|b| candidate.beats(&b.candidate)) {
                    let triangle = TriangleRef::new(block_offset, lane);
                    *best = Some(MethodHit { candidate, triangle, u: crossing.u, v: crossing.v });
                }
            }
            far_limit(best, limits.t_max, any)
        });
    }

    /// Casts rays one by one. Calls `found` with the number of each ray, the ray in the scene's space, and its nearest hit, or
    /// with `any` a hit.
    fn cast_each(&self, rays: &Rays, any: bool, mut found: impl FnMut(usize, LocalRay, Option<MethodHit>)) {
        let scene = &self.exact.scene;
        let (mut top_stack, mut stack) = (Vec::new(), Vec::new());
        for (run, origin) in rays.runs() {
            let origin = scene.geometry.ray_origin(origin);
            let seen = if K::ABOUT.common_origin { self.seen_from(origin.as_vec3()) } else { None };
            let seen = seen.as_deref();
            for number in run {
                let ray = LocalRay { origin, direction: rays.directions[number] };
                // The depth of the hit to come after is the method's and may lie outside of the triangle's box, so no box is
                // skipped for lying before it.
                let limits = Limits { t_min: rays.t_min, ..Limits::of(rays, number) };
                let depths = (limits.t_min, limits.t_max);
                let mut best = None;
                if self.exact.top.bvh.nodes.is_empty() {
                    self.nearest_in(0, ray, &limits, any, seen, &mut best, &mut stack);
                } else {
                    self.exact.top.bvh.traverse_padded(&ray, depths, SLACK, &mut top_stack, |index| {
                        let placement = &scene.arrangement.placements[index as usize];
                        if let Some(local) = ray.carried(placement, rays.time_s(number)) {
                            let count = if limits.after.is_some() { usize::MAX } else { 1 };
                            for copy in self.exact.top.with_copies(index).take(count) {
                                self.nearest_in(copy, local, &limits, any, seen, &mut best, &mut stack);
                            }
                        }
                        far_limit(&best, limits.t_max, any)
                    });
                }
                found(number, ray, best);
            }
        }
    }

    /// The whole hit of a ray in the scene's space.
    fn whole_hit(&self, ray: LocalRay, time_s: Option<f64>, best: &MethodHit) -> Option<Hit> {
        let Candidate { t, placement, .. } = best.candidate;
        let hit = self.exact.whole_hit(ray, time_s, &NearestHit { t, placement, triangle: best.triangle })?;
        Some(Hit { u: best.u.into(), v: best.v.into(), ..hit })
    }
}

/// The depth beyond which the traversal need not look any more.
fn far_limit(best: &Option<MethodHit>, t_max: f64, any: bool) -> f64 {
    match best {
        None => t_max,
        Some(_) if any => -1.0, // less than the depth of every box, which is at least 0
        Some(best) => best.candidate.t,
    }
}

/// How far boxes may be off in addition to the error of f64, relative to the largest coordinate of the ray's origin and of the
/// mesh: rounding the ray to f32, and a corner's distance from its origin, costs a few 2⁻²⁴.
const SLACK: f64 = 1.0 / (1 << 20) as f64;

impl<K: Kernel> Default for Seen<K> {
    fn default() -> Self {
        Self { origin: None, prepared: None }
    }
}

impl<K: Kernel> Cast for KernelTracer<K> {
    fn cast(&self, rays: &Rays, hits: &mut [Option<Hit>]) {
        rays.check(hits.len(), &self.exact.scene.arrangement);
        self.cast_each(rays, false, |number, ray, best| {
            hits[number] = best.and_then(|best| self.whole_hit(ray, rays.time_s(number), &best));
        });
    }

    fn blocked(&self, rays: &Rays, blocked: &mut [bool]) {
        rays.check(blocked.len(), &self.exact.scene.arrangement);
        self.cast_each(rays, true, |number, _, best| blocked[number] = best.is_some());
    }
}

impl<K: Kernel> MethodTracer for KernelTracer<K> {
    fn rearranged(&self, arrangement: Arc<Arrangement>) -> Arc<dyn MethodTracer> {
        // Mesh 0 does not move, but forgetting what is prepared for one origin costs little.
        let exact = self.exact.rearranged(arrangement);
        Arc::new(Self { exact, prepared: self.prepared.clone(), seen: Mutex::default() })
    }

    fn scene(&self) -> &Scene {
        self.exact.scene()
    }

    fn bytes(&self) -> usize {
        let seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        let seen = seen.prepared.as_ref().map_or(0, |p| p.bytes());
        self.exact.bytes() + self.prepared.iter().map(Prepared::bytes).sum::<usize>() + seen
    }
}
