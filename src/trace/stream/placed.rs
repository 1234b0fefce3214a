//! The part of a stream above the meshes: rays in the hierarchy over placements, and on their way to these and back.

use glam::DVec3;

use super::{BACK, DEPTH, FIXED, STREAM_RAYS, StreamState, Targets};
use crate::trace::batch::Batch;
use crate::trace::bvh::{Child, WIDTH};
use crate::trace::exact::{LocalRay, Xyz};
use crate::trace::maps::Maps;
use crate::trace::simd::{F32x8, F64x8};
use crate::trace::single::{BOTTOM, PreparedRay, StackSlices};

impl StreamState {
    /// Takes all rays that are at a node of the hierarchy over placements one step further.
    #[inline(always)]
    pub(super) fn visit_nodes_above<S: F32x8>(&mut self, targets: &Targets) {
        let mut rest = std::mem::take(&mut self.above_node);
        self.stats.nodes += u64::from(rest.count_ones());
        while rest != 0 {
            let ray = rest.trailing_zeros() as usize & (STREAM_RAYS - 1);
            rest &= rest - 1;
            let top = self.top[ray] as usize;
            if top > DEPTH - WIDTH {
                self.rejected |= 1 << ray;
                continue;
            }
            let node = &targets.top.bvh.nodes[self.next[ray].bits() as usize];
            let mut stack = StackSlices { nears: &mut self.nears[ray], children: &mut self.children[ray] };
            let (child, top) = self.above[ray].visit_node::<S>(node, &mut stack, top);
            self.go_above::<S>(targets, ray, child, top);
        }
    }

    /// Sends a ray in the scene's space to its next child, or ends its traversal if its stack is empty.
    #[inline(always)]
    fn go_above<S: F32x8>(&mut self, targets: &Targets, ray: usize, child: Child, top: usize) {
        (self.next[ray], self.top[ray]) = (child, top as u32);
        let goes_on = u64::from(top >= BOTTOM) << ray;
        let to_leaf = u64::from(child.bits() >> 31) << ray;
        let to_fixed = u64::from(child == FIXED) << ray;
        let to_placement = to_leaf & !to_fixed;
        self.above_node |= goes_on & !to_leaf;
        self.at_fixed |= goes_on & to_fixed;
        self.at_placement |= goes_on & to_placement;
        targets.top.bvh.prefetch::<S>(child);
        if goes_on & to_placement != 0 {
            let map = targets.surfaces.placements[child.number() as usize].mesh_from_scene();
            let line = std::ptr::from_ref(map).cast::<u32>();
            S::prefetch(line);
            S::prefetch(line.wrapping_add(16));
        }
    }

    /// Takes rays that are done with a placement back into the scene's space.
    #[inline(always)]
    pub(super) fn leave_placements<S: F32x8>(&mut self, targets: &Targets, mut rest: u64) {
        while rest != 0 {
            let ray = rest.trailing_zeros() as usize & (STREAM_RAYS - 1);
            rest &= rest - 1;
            let z_max = S::splat(self.above[ray].z_max());
            let top = self.top[ray] as usize;
            let (child, top) = self.stack(ray).pop::<S>(z_max, top);
            self.go_above::<S>(targets, ray, child, top);
        }
    }

    /// Puts all rays that are at placement 0 at the root of mesh 0. They are prepared for it in the scene's space.
    #[inline(always)]
    pub(super) fn enter_fixed<S: F32x8>(&mut self, targets: &Targets, rays: &Batch) {
        let ready = std::mem::take(&mut self.at_fixed);
        let mut rest = ready;
        while rest != 0 {
            let ray = rest.trailing_zeros() as usize & (STREAM_RAYS - 1);
            rest &= rest - 1;
            self.local[ray] = self.above[ray];
            LocalRay { origin: self.origins[ray], direction: self.directions[ray] } = rays.ray(self.ray(ray));
            (self.placement[ray], self.mesh[ray]) = (0, 0);
        }
        self.begin_meshes::<S>(targets, ready);
    }

    /// Carries rays of a set, which are at a placement, into the space of its mesh, eight at a time.
    #[inline(always)]
    pub(super) fn visit_placements<S: F32x8, const AFTER: bool>(
        &mut self,
        targets: &Targets,
        rays: &Batch,
        maps: &mut Maps,
        at_placement: u64,
    ) {
        let mut rest = at_placement;
        // Fewer than eight are taken only if no ray has anything else to do.
        while rest.count_ones() >= 8 || (rest != 0 && self.above_node | self.at_node | self.at_leaf == 0) {
            let (mut fresh, mut count) = ([0_usize; 8], 0);
            let mut absent = 0_u64;
            while rest != 0 && count < 8 {
                let ray = rest.trailing_zeros() as usize & (STREAM_RAYS - 1);
                rest &= rest - 1;
                self.at_placement &= !(1 << ray);
                let index = self.next[ray].number();
                let placement = &targets.surfaces.placements[index as usize];
                let number = self.ray(ray);
                let Some(map) = maps.of(index, placement, rays.time_s(number)) else {
                    absent |= 1 << ray;
                    continue;
                };
                let LocalRay { origin, direction } = rays.ray(number).carried_by(map);
                (self.origins[ray], self.directions[ray]) = (origin, direction);
                (self.placement[ray], self.mesh[ray]) = (index, placement.mesh);
                fresh[count] = ray;
                count += 1;
            }
            if count > 0 {
                let ready = self.prepare_local::<S, AFTER>(targets, rays, fresh, count);
                self.begin_meshes::<S>(targets, ready);
            }
            self.leave_placements::<S>(targets, absent);
        }
    }

    /// Prepares up to eight rays for the meshes that they are at, and returns those that f32 can serve. The others have to be traced
    /// alone.
    #[inline(always)]
    fn prepare_local<S: F32x8, const AFTER: bool>(
        &mut self,
        targets: &Targets,
        rays: &Batch,
        mut fresh: [usize; 8],
        count: usize,
    ) -> u64 {
        let first = fresh[0];
        fresh[count..].fill(first);
        let (mut o, mut d) = ([DVec3::ZERO; 8], [DVec3::ZERO; 8]);
        let (mut largest, mut t_min, mut t_max) = ([0.0; 8], [rays.t_min; 8], [0.0; 8]);
        for (k, &ray) in fresh.iter().enumerate() {
            (o[k], d[k]) = (self.origins[ray], self.directions[ray]);
            largest[k] = f64::from(targets.surfaces.bvh_of_mesh(self.mesh[ray]).largest);
            t_max[k] = self.t[ray];
            if AFTER {
                t_min[k] = rays.limits::<AFTER>(self.ray(ray)).t_min;
            }
        }
        let [ox, oy, oz] = S::F64x8::load_xyz(&o);
        let [dx, dy, dz] = S::F64x8::load_xyz(&d);
        let in_range = PreparedRay::prepare::<S>(
            &mut self.local,
            fresh,
            Xyz(ox, oy, oz),
            Xyz(dx, dy, dz),
            S::F64x8::load(&largest),
            (S::F64x8::load(&t_min), S::F64x8::load(&t_max)),
        );
        let mut ready = 0;
        for (k, &ray) in fresh[..count].iter().enumerate() {
            let is_ready = u64::from(in_range >> k & 1);
            ready |= is_ready << ray;
            self.rejected |= (1 - is_ready) << ray;
        }
        self.carried += count as u64;
        ready
    }

    /// Puts rays that are prepared for a mesh at the root of its hierarchy.
    #[inline(always)]
    fn begin_meshes<S: F32x8>(&mut self, targets: &Targets, mut ready: u64) {
        let mut absent = 0;
        while ready != 0 {
            let ray = ready.trailing_zeros() as usize & (STREAM_RAYS - 1);
            ready &= ready - 1;
            let top = self.top[ray] as usize;
            let bvh = self.bvh::<true>(targets, ray);
            if bvh.nodes.is_empty() {
                absent |= 1 << ray;
                continue;
            }
            if top > DEPTH - WIDTH {
                self.rejected |= 1 << ray;
                continue;
            }
            (self.nears[ray][top], self.children[ray][top]) = (f32::NEG_INFINITY, BACK.bits());
            let [node, ..] = self.go_to::<S, false>(bvh, ray, Child::node(0), top + 1);
            self.at_node |= node;
        }
        self.leave_placements::<S>(targets, absent);
    }
}
