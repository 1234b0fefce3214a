//! A published method at the leaves of the exact tracer's hierarchies.

use std::sync::{Arc, Mutex, PoisonError};

use glam::Vec3;

use super::{Kernel, Ray};
use crate::trace::bvh::{Bvh8, Child, LeafBlock, TriangleRef};
use crate::trace::exact::{Candidate, Corners, LocalRay};
use crate::trace::{Cast, Hit, Rays, Tracer};

/// Casts rays one by one and decides by `K`. The hierarchy is walked conservatively in f64: what is missed is missed by the
/// method, and what it finds is found (a depth that is off by more than the boxes are padded may change the order).
///
/// Rays are rounded to f32 in the space of each mesh. t, u and v are the method's, the normal is the triangle's.
#[derive(Debug)]
pub struct KernelTracer<'s, K: Kernel> {
    exact: Arc<Tracer<'s>>,
    /// One a mesh; empty if `K` needs to know the origin.
    prepared: Vec<Prepared<K>>,
    /// Mesh 0, if `K` needs to know the origin.
    seen: Mutex<Seen<K>>,
}

/// A mesh's triangles in the order of their blocks.
#[derive(Debug)]
struct Prepared<K: Kernel> {
    /// By a block's offset: the place of its first triangle.
    first: Vec<u32>,
    triangles: Vec<K::Triangle>,
}

/// Mesh 0 as seen from the origin of the latest rays, once two batches in a row came from there.
#[derive(Debug)]
struct Seen<K: Kernel> {
    origin: Option<Vec3>,
    prepared: Option<Arc<Prepared<K>>>,
}

impl<K: Kernel> Prepared<K> {
    fn new(bvh: &Bvh8, origin: Vec3) -> Self {
        let block_offsets = bvh.blocks.len() / crate::trace::bvh::BLOCK_OFFSET_WORDS;
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
    slot: TriangleRef,
    u: f32,
    v: f32,
}

impl<'s, K: Kernel> KernelTracer<'s, K> {
    /// Prepares every triangle of the scene of `exact`.
    pub fn new(exact: Arc<Tracer<'s>>) -> Self {
        let meshes = if K::ABOUT.common_origin { &[] } else { exact.meshes.as_slice() };
        let prepared = meshes.iter().map(|bvh| Prepared::new(bvh, Vec3::ZERO)).collect();
        Self { exact, prepared, seen: Mutex::new(Seen { origin: None, prepared: None }) }
    }

    /// Mesh 0 as seen from an origin, if it's worth it.
    fn seen_from(&self, origin: Vec3) -> Option<Arc<Prepared<K>>> {
        let mut seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        if seen.origin == Some(origin) {
            let mesh = &self.exact.meshes[0];
            return Some(seen.prepared.get_or_insert_with(|| Arc::new(Prepared::new(mesh, origin))).clone());
        }
        *seen = Seen { origin: Some(origin), prepared: None };
        None
    }

    /// Betters `best` by what a ray, in the placement's space, hits there.
    fn nearest_in(
        &self,
        placement: u32,
        ray: LocalRay,
        limits: (f64, f64),
        mesh_0: Option<&Prepared<K>>,
        best: &mut Option<MethodHit>,
        stack: &mut Vec<(Child, f64)>,
    ) {
        let mesh = self.exact.scene.placements[placement as usize].mesh;
        let bvh = &self.exact.meshes[mesh as usize];
        let prepared = self.prepared.get(mesh as usize).or(mesh_0.filter(|_| placement == 0));
        let ray = Ray { origin: ray.origin.as_vec3(), direction: ray.direction.as_vec3() };
        let walked = LocalRay { origin: ray.origin.as_dvec3(), direction: ray.direction.as_dvec3() };
        let test = K::ray(ray);
        let far = best.map_or(limits.1, |b| b.candidate.t);
        bvh.traverse_padded(&walked, (limits.0, far), SLACK, stack, |block_offset| {
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
                if (limits.0..=limits.1).contains(&t) && best.is_none_or(|b| candidate.beats(&b.candidate)) {
                    let slot = TriangleRef::new(block_offset, lane);
                    *best = Some(MethodHit { candidate, slot, u: crossing.u, v: crossing.v });
                }
            }
            best.map_or(limits.1, |b| b.candidate.t)
        });
    }

    /// The whole hit of a ray in the scene's space.
    fn finish(&self, ray: LocalRay, best: &MethodHit) -> Hit {
        let placement = &self.exact.scene.placements[best.candidate.placement as usize];
        let local = ray.carried(placement);
        let blocks = &self.exact.meshes[placement.mesh as usize].blocks;
        let positions = LeafBlock::at(blocks, best.slot.block_offset()).positions(best.slot.lane());
        let corners = Corners::from_positions(positions, local.origin);
        let hit = best.candidate.finish(&corners, local.direction, placement);
        Hit { u: best.u.into(), v: best.v.into(), ..hit }
    }
}

/// How much farther than in f64 boxes may be off, for 1 as the largest coordinate of the ray's origin and of the mesh:
/// rounding the ray to f32 and a corner's distance from its origin costs a few 2⁻²⁴.
const SLACK: f64 = 1.0 / (1 << 20) as f64;

impl<K: Kernel> Cast for KernelTracer<'_, K> {
    fn cast(&self, rays: &Rays, hits: &mut [Option<Hit>]) {
        rays.check(hits.len());
        let scene = self.exact.scene;
        let limits = (rays.t_min, rays.t_max);
        let (mut top_stack, mut stack) = (Vec::new(), Vec::new());
        for (run, origin) in rays.runs() {
            let origin = origin - scene.centre;
            let seen = if K::ABOUT.common_origin { self.seen_from(origin.as_vec3()) } else { None };
            let seen = seen.as_deref();
            for (&direction, hit) in rays.directions[run.clone()].iter().zip(&mut hits[run]) {
                let ray = LocalRay { origin, direction };
                let mut best = None;
                if self.exact.top.nodes.is_empty() {
                    self.nearest_in(0, ray, limits, seen, &mut best, &mut stack);
                } else {
                    self.exact.top.traverse_padded(&ray, limits, SLACK, &mut top_stack, |index| {
                        let local = ray.carried(&scene.placements[index as usize]);
                        self.nearest_in(index, local, limits, seen, &mut best, &mut stack);
                        best.map_or(limits.1, |b| b.candidate.t)
                    });
                }
                *hit = best.map(|best| self.finish(ray, &best));
            }
        }
    }
}

impl<K: Kernel> MethodTracer for KernelTracer<'_, K> {
    fn bytes(&self) -> usize {
        let seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        let seen = seen.prepared.as_ref().map_or(0, |p| p.bytes());
        self.exact.bytes() + self.prepared.iter().map(Prepared::bytes).sum::<usize>() + seen
    }
}

/// A [`KernelTracer`] of whichever method.
pub trait MethodTracer: Cast {
    /// Bytes held beside the scene.
    fn bytes(&self) -> usize;
}
