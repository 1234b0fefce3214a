//! Many rays side by side.
//!
//! Most of what a ray by itself takes is waiting: for memory, and for branches that go either way as often. So a batch's rays
//! take turns, a step each, and ask for what they visit next a round ahead. Nodes and leaves have loops of their own, and which
//! child is next, or whether it is something from the stack, is computed without a branch. A ray that passes through a
//! triangle waits until there are eight such triangles, and their depths are worked out together.

use glam::DVec3;

use super::{BOTTOM, Prepared, Stacked, id, passing};
use crate::trace::Origins;
use crate::trace::effort::Effort;
use crate::trace::exact::{Corners, Facet, LocalRay, Xyz};
use crate::trace::finish::{eight, in_f64};
use crate::trace::lanes::{Doubles, Lanes, Words};
use crate::trace::packet::Nearest;
use crate::trace::tracer::{Batch, Best};
use crate::trace::wide::{Block, Child, Slot, WIDTH, Wide};

/// Rays that are walked side by side at most.
pub(in crate::trace) const TOGETHER: usize = 64;

/// The length of a ray's stack where there are many. (A ray that needs more is taken by itself: eight wide, a hierarchy over a
/// thousand million triangles is some ten deep, and a level leaves seven children.)
const DEPTH: usize = 120;

/// Room for triangles that rays pass through: eight of each ray's leaf, up to seven of an earlier round, and one vector.
const PASSED: usize = (TOGETHER + 2) * WIDTH;

/// Room for a batch's rays, walked side by side. (Nothing until there are any: it is some 70 KiB.)
#[derive(Default)]
pub(in crate::trace) struct Together {
    walks: Option<Box<Walks>>,
}

struct Walks {
    prepared: Prepared<TOGETHER>,
    /// What each visits next, and its stack with the top.
    next: [Child; TOGETHER],
    top: [u32; TOGETHER],
    nears: [[f32; DEPTH]; TOGETHER],
    children: [[u32; DEPTH]; TOGETHER],
    /// The depth of each one's nearest hit, or how far it goes, and where that is, if there is one (a bit each).
    t: [f64; TOGETHER],
    slot: [u32; TOGETHER],
    hit: u64,
    /// Triangles that rays pass through, whose depths are still to be worked out: where they are, and whose. Their number.
    passed: [u32; PASSED],
    passed_by: [u8; PASSED],
    waiting: usize,
    /// A bit each: whose next is a node, whose is a leaf, and who waits for such a depth.
    at_node: u64,
    at_leaf: u64,
    waits: u64,
    /// A bit each: who needs a longer stack.
    too_deep: u64,
    effort: Effort,
}

impl Default for Walks {
    fn default() -> Self {
        Self {
            prepared: Prepared::NONE,
            next: [Child::NONE; TOGETHER],
            top: [0; TOGETHER],
            nears: [[0.0; DEPTH]; TOGETHER],
            children: [[0; DEPTH]; TOGETHER],
            t: [0.0; TOGETHER],
            slot: [0; TOGETHER],
            hit: 0,
            passed: [0; PASSED],
            passed_by: [0; PASSED],
            waiting: 0,
            at_node: 0,
            at_leaf: 0,
            waits: 0,
            too_deep: 0,
            effort: Effort::default(),
        }
    }
}

impl Together {
    /// What walking took so far.
    pub fn effort(&self) -> Effort {
        self.walks.as_ref().map_or(Effort::default(), |walks| walks.effort)
    }

    /// Finds the nearest hits (with `any`, a hit) of up to 64 rays in mesh 0, in its space. Gives the rays that have to be
    /// taken one by one, a bit each.
    #[inline(always)]
    pub fn walk<S: Lanes>(&mut self, wide: &Wide, rays: &Batch, any: bool, nearest: &mut Nearest) -> u64 {
        if wide.nodes.is_empty() {
            return 0;
        }
        let walks = self.walks.get_or_insert_default();
        let all = u64::MAX >> (TOGETHER - rays.directions.len());
        let tame = walks.start::<S>(wide, rays) & all;
        (walks.at_node, walks.at_leaf, walks.too_deep) = (tame, 0, 0);
        (walks.waits, walks.waiting) = (0, 0);
        while walks.at_node | walks.at_leaf | walks.waits != 0 || walks.waiting > 0 {
            let at_leaf = std::mem::take(&mut walks.at_leaf);
            walks.visit_nodes::<S>(wide);
            walks.visit_leaves::<S>(wide, rays, any, at_leaf);
        }
        let rest = all & (!tame | walks.too_deep);
        let mut hits = walks.hit & !rest;
        while hits != 0 {
            let ray = hits.trailing_zeros() as usize;
            hits &= hits - 1;
            let (t, slot) = (walks.t[ray], Slot(walks.slot[ray]));
            nearest.set(ray, Some(Best { t, placement: 0, slot }));
        }
        rest
    }
}

impl Walks {
    /// Prepares rays and puts them at the root. A bit for each that f32 is of use for.
    #[inline(always)]
    fn start<S: Lanes>(&mut self, wide: &Wide, rays: &Batch) -> u64 {
        let (mut tame, mut room) = (0, [DVec3::ZERO; 8]);
        for group in 0..rays.directions.len().div_ceil(8) {
            let [x, y, z] = S::Doubles::load_xyz(eight(rays.directions, group, &mut room));
            let d = Xyz(x, y, z);
            let o = match rays.origins {
                Origins::Common(origin) => Xyz::constant(origin),
                Origins::Each(origins) => {
                    let [x, y, z] = S::Doubles::load_xyz(eight(origins, group, &mut room));
                    Xyz(x, y, z)
                }
            };
            let limits = (rays.t_min, rays.t_max);
            tame |= u64::from(self.prepared.prepare::<S>(group, o, d, wide.largest, limits)) << (8 * group);
        }
        for ray in 0..rays.directions.len() {
            self.stacked(ray).clear();
        }
        (self.next, self.top) = ([Child::node(0); TOGETHER], [BOTTOM as u32; TOGETHER]);
        (self.t, self.hit) = ([rays.t_max; TOGETHER], 0);
        tame
    }

    #[inline(always)]
    fn stacked(&mut self, ray: usize) -> Stacked<'_> {
        Stacked { nears: &mut self.nears[ray], children: &mut self.children[ray] }
    }

    /// Notes where a ray goes next, and asks for it; nowhere if its stack is empty.
    #[inline(always)]
    fn go<S: Lanes>(&mut self, wide: &Wide, ray: usize, child: Child, top: usize) -> [u64; 2] {
        (self.next[ray], self.top[ray]) = (child, top as u32);
        let goes_on = u64::from(top >= BOTTOM) << ray;
        let to_leaf = u64::from(child.bits() >> 31) << ray;
        wide.prefetch::<S>(child);
        [goes_on & !to_leaf, goes_on & to_leaf]
    }

    /// Takes all rays that are at a node a step further.
    #[inline(always)]
    fn visit_nodes<S: Lanes>(&mut self, wide: &Wide) {
        let mut rest = self.at_node;
        let [mut to_node, mut to_leaf] = [0, self.at_leaf];
        self.effort.nodes += u64::from(rest.count_ones());
        while rest != 0 {
            let ray = rest.trailing_zeros() as usize & (TOGETHER - 1);
            rest &= rest - 1;
            let top = self.top[ray] as usize;
            if top > DEPTH - WIDTH {
                self.too_deep |= 1 << ray;
                continue;
            }
            let node = &wide.nodes[self.next[ray].bits() as usize];
            let mut stacked = Stacked { nears: &mut self.nears[ray], children: &mut self.children[ray] };
            let (child, top) = self.prepared.step::<S>(ray, node, &mut stacked, top);
            let [node, leaf] = self.go::<S>(wide, ray, child, top);
            (to_node, to_leaf) = (to_node | node, to_leaf | leaf);
        }
        (self.at_node, self.at_leaf) = (to_node, to_leaf);
    }

    /// Takes all rays of a set, which are at a leaf, a step further; or lets them wait.
    #[inline(always)]
    fn visit_leaves<S: Lanes>(&mut self, wide: &Wide, rays: &Batch, any: bool, at_leaf: u64) {
        let (mut rest, mut count, mut goes_on) = (at_leaf, self.waiting, 0);
        let mut tests = 0;
        while rest != 0 {
            let ray = rest.trailing_zeros() as usize & (TOGETHER - 1);
            rest &= rest - 1;
            let granule = self.next[ray].bits() & !(1 << 31);
            let block = Block::at(&wide.blocks, granule);
            let (mut maybe, sure) = self.prepared.test_leaf::<S>(ray, &block);
            tests += block.triangles as u64;
            if maybe & !sure != 0 {
                maybe = maybe & sure | passing(block, maybe & !sure, rays.ray(ray), &mut self.effort);
            }
            goes_on |= u64::from(maybe == 0) << ray;
            // Whether it is none or one is hard to tell beforehand: no branch. More are rare.
            loop {
                let lane = (maybe | 1 << 7).trailing_zeros() as usize;
                self.passed[count % PASSED] = Slot::new(granule, lane).0;
                self.passed_by[count % PASSED] = ray as u8;
                count += usize::from(maybe != 0);
                maybe &= maybe.wrapping_sub(1);
                if maybe == 0 {
                    break;
                }
            }
        }
        self.effort.leaves += u64::from(at_leaf.count_ones());
        self.effort.tests += tests;
        self.waits |= at_leaf & !goes_on;
        // Fewer than eight only if nobody else has anything to do.
        let mut start = 0;
        while count - start >= WIDTH || (count > start && self.at_node | self.at_leaf | goes_on == 0) {
            let some = (count - start).min(WIDTH);
            goes_on |= self.better::<S>(wide, rays, any, start, some) & self.waits;
            self.waits &= !goes_on;
            start += some;
        }
        self.waiting = count - start;
        self.passed.copy_within(start..start + WIDTH, 0);
        self.passed_by.copy_within(start..start + WIDTH, 0);
        let mut rest = goes_on;
        let (mut to_node, mut to_leaf) = (self.at_node, self.at_leaf);
        while rest != 0 {
            let ray = rest.trailing_zeros() as usize & (TOGETHER - 1);
            rest &= rest - 1;
            let z_max = S::splat(self.prepared.z_max[ray]);
            let top = self.top[ray] as usize;
            let (child, top) = self.stacked(ray).pop::<S>(z_max, top);
            let [node, leaf] = self.go::<S>(wide, ray, child, top);
            (to_node, to_leaf) = (to_node | node, to_leaf | leaf);
        }
        (self.at_node, self.at_leaf) = (to_node, to_leaf);
    }

    /// Betters rays' hits by up to eight triangles that they pass through. Gives the rays, a bit each.
    #[inline(always)]
    fn better<S: Lanes>(&mut self, wide: &Wide, rays: &Batch, any: bool, start: usize, count: usize) -> u64 {
        let slots: &mut [u32; WIDTH] = (&mut self.passed[start..start + WIDTH]).try_into().unwrap();
        let passed_by: &[u8; WIDTH] = self.passed_by[start..start + WIDTH].try_into().unwrap();
        let (mut origins, mut directions) = ([DVec3::ZERO; WIDTH], [DVec3::ZERO; WIDTH]);
        let mut of = 0;
        for k in 0..count {
            of |= 1 << (passed_by[k] % TOGETHER as u8);
            let LocalRay { origin, direction } = rays.ray(usize::from(passed_by[k]));
            (origins[k], directions[k]) = (origin, direction);
        }
        // What is worked out for lanes past the last is not used.
        let first = slots[0];
        slots[count..].fill(first);
        let (corners, ids) = Block::corners::<S>(&wide.blocks, S::Words::load(slots));
        let [[x, y, z], [dx, dy, dz]] = [S::Doubles::load_xyz(&origins), S::Doubles::load_xyz(&directions)];
        let o = Xyz(x, y, z);
        let [a, b, c] = [in_f64(corners[0]), in_f64(corners[1]), in_f64(corners[2])];
        let facet = Facet::new([a.sub(o), b.sub(o), c.sub(o)]);
        let (depth, within) = facet.plane_depth(Xyz(dx, dy, dz));
        let (mut t, mut triangles) = ([0.0; WIDTH], [0; WIDTH]);
        depth.store(&mut t);
        ids.store(&mut triangles);
        for k in 0..count {
            let (ray, slot) = (usize::from(passed_by[k]) % TOGETHER, slots[k]);
            if within >> k & 1 == 0 {
                t[k] = depth_in_box(wide, Slot(slot), rays.ray(ray));
            }
            let (t, known) = (t[k], self.t[ray]);
            let is_first = self.hit >> ray & 1 == 0;
            let beats =
                t < known || (t == known && (is_first || triangles[k] < id(wide, Slot(self.slot[ray]))));
            if beats && t >= rays.t_min {
                (self.t[ray], self.slot[ray]) = (t, slot);
                self.hit |= 1 << ray;
                self.prepared.limit(ray, t);
                if any {
                    // Nothing more to visit.
                    self.top[ray] = BOTTOM as u32;
                }
            }
        }
        of
    }
}

/// The depth of a triangle that is seen so edge-on that it isn't that of its plane. Kept out of the loop, as it is rare.
#[cold]
#[inline(never)]
fn depth_in_box(wide: &Wide, slot: Slot, ray: LocalRay) -> f64 {
    let positions = Block::at(&wide.blocks, slot.granule()).positions(slot.lane());
    Corners::from_positions(positions, ray.origin).depth(ray.direction)
}
