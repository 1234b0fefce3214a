//! Single rays of any origin: bounces, shadow tests, whatever is no packet. One ray against eight boxes or eight triangles.
//!
//! # Boxes
//! With w the axis along which a ray mostly goes, depth is counted along it: z = t·|d_w|. A ray enters a box at the largest
//! of three z and leaves it at the least, each a plane times d_w/d_k less a constant of the ray (Kay and Kajiya, "Ray Tracing
//! Complex Scenes", 1986). The planes' rounding is in the boxes' padding; that of the origin, here and in the constant, takes
//! a few 2⁻²⁴ of it, for which boxes grow by [`Single`]'s slack; what is left is relative, and the far end gives way for it
//! (Ize, "Robust BVH Ray Traversal", 2013). A ray that hardly moves along an axis is taken to move a little: by 2⁻⁶⁰ of its
//! way, which is far less than the padding.
//!
//! # Triangles
//! Seen along the ray, x′ = x − g_u·z and y′ = y − g_v·z (Woop, Benthin, Wald, "Watertight Ray/Triangle Intersection",
//! 2013), the edge b–c has E = x′_b·y′_c − y′_b·x′_c = det(g, b, c). With u = 2⁻²⁴, s = |o|∞ + the largest |coordinate| of the
//! mesh, and X the largest |x′|, |y′| of a triangle, a corner's x′ is off by (in units of u·s)
//!
//! | from | error |
//! |---|---|
//! | the origin's rounding and the subtraction, in x and, times \|g\| ≤ 1, in z | 4 |
//! | the rounding of g, times \|z\| | 1 |
//! | the product and the difference, of size 2s at most | 3 |
//!
//! δ = 8u·s in all. E is then off by at most 4δX + 2δ² + 4u·X² (two products and a difference), and X ≤ 2s + δ: by
//! 40u·s·X and terms in u²s², 128 of the first kind. [`EDGE`] and [`EDGE_SQUARED`] leave room. All three E beyond the bound on
//! one side are a hit, two on different sides are a miss, and what lies between is decided by [`exact`](super::exact).

use glam::DVec3;

use super::exact::{Candidate, Corners, LocalRay};
use super::lanes::{Lanes, Mask, Pair};
use super::packet::{Nearest, TINY, U};
use super::tracer::{Batch, Best};
use super::wide::{Block, Child, Node, Slot, WIDTH, Wide};

/// Error of an edge function in units of u·s·X, and in units of u²·s².
const EDGE: f32 = 48.0;
const EDGE_SQUARED: f32 = 256.0;

/// u, v and w for each w.
const AXES: [[usize; 3]; 3] = [[1, 2, 0], [2, 0, 1], [0, 1, 2]];

/// A ray in the space of a mesh (or of the scene), prepared.
pub(super) struct Single {
    ray: LocalRay,
    /// Which of x, y, z are u, v and w.
    axes: [usize; 3],
    /// d_u/d_w and d_v/d_w.
    g: [f32; 2],
    /// The origin, in the order u, v, w.
    origin: [f32; 3],
    /// Of each of x, y, z: |d_w|/d_k, and what is added to planes times that, to those where the ray enters and those where it
    /// leaves.
    inverse: [f32; 3],
    from: [[f32; 2]; 3],
    /// |d_w|: what depths are times, to be along w.
    stretch: f64,
    /// Depths along w that hits may have.
    z_min: f32,
    z_max: f32,
    /// u·s.
    unit: f32,
}

/// Something to visit: a child, and where its box begins along w.
#[derive(Clone, Copy)]
struct Visit {
    near: f32,
    child: Child,
}

/// What is to be visited, the next on top.
pub(super) struct Stack {
    visits: Vec<Visit>,
    len: usize,
}

impl Default for Stack {
    fn default() -> Self {
        Self { visits: vec![Visit { near: 0.0, child: Child::NONE }; 128], len: 0 }
    }
}

impl Stack {
    /// Puts the root on an empty stack.
    #[inline(always)]
    pub fn start(&mut self, wide: &Wide) {
        self.len = 0;
        if !wide.nodes.is_empty() {
            self.visits[0] = Visit { near: 0.0, child: Child::node(0) };
            self.len = 1;
        }
    }

    #[inline(always)]
    fn pop(&mut self) -> Option<Visit> {
        self.len = self.len.checked_sub(1)?;
        Some(self.visits[self.len])
    }

    /// Room above the top for a node's children.
    #[inline(always)]
    fn room(&mut self) -> &mut [Visit; WIDTH] {
        if self.len + WIDTH > self.visits.len() {
            self.lengthen();
        }
        (&mut self.visits[self.len..self.len + WIDTH]).try_into().unwrap()
    }

    #[cold]
    #[inline(never)]
    fn lengthen(&mut self) {
        let length = self.visits.len() * 2;
        self.visits.resize(length, self.visits[0]);
    }

    /// Takes the first `count` of the room.
    #[inline(always)]
    fn grow(&mut self, count: usize) {
        self.len += count;
    }
}

impl Single {
    /// Prepares a ray for hits from `t_min` to `t_max`. `None` if f32 is no use for it: not finite, or of sizes whose cubes
    /// leave f32's range.
    #[inline(always)]
    pub fn new(ray: LocalRay, largest: f32, (t_min, t_max): (f64, f64)) -> Option<Self> {
        let (o, d) = (ray.origin.to_array(), ray.direction.to_array());
        let along = ray.direction.abs();
        let w = if along.x >= along.y && along.x >= along.z {
            0
        } else if along.y >= along.z {
            1
        } else {
            2
        };
        let farthest = ray.origin.abs().max_element();
        let size = farthest + f64::from(largest);
        let stretch = along.max_element();
        // (In this form NaN doesn't pass.)
        let is_tame = size < 1e12 && stretch > 1e-30 && stretch < 1e30 && along.x + along.y + along.z < 1e31;
        if !is_tame {
            return None;
        }
        let axes = AXES[w];
        let slack = (farthest as f32) * (8.0 * U) + TINY;
        let parts = (ray.direction * (1.0 / stretch)).to_array().map(|part| part as f32);
        let (mut inverse, mut from) = ([0.0; 3], [[0.0; 2]; 3]);
        for axis in 0..3 {
            let part = parts[axis];
            let least = 1.0 / (1_u64 << 60) as f32;
            let part = if part.abs() < least { least.copysign(part) } else { part };
            inverse[axis] = 1.0 / part;
            let at = o[axis] as f32;
            // Boxes grow on both sides: a lower plane is the nearer by the slack, an upper one the farther.
            let slack = slack.copysign(part);
            from[axis] = [(at + slack) * -inverse[axis], (at - slack) * -inverse[axis]];
        }
        let per_w = 1.0 / d[w];
        let mut single = Self {
            ray,
            axes,
            g: [(d[axes[0]] * per_w) as f32, (d[axes[1]] * per_w) as f32],
            origin: [o[axes[0]] as f32, o[axes[1]] as f32, o[axes[2]] as f32],
            inverse,
            from,
            stretch,
            z_min: (t_min * stretch) as f32 * (1.0 - 4.0 * U),
            z_max: 0.0,
            unit: (size as f32) * (U * (1.0 + 4.0 * U)),
        };
        single.limit(t_max);
        Some(single)
    }

    /// Hits beyond this depth are of no more use.
    #[inline(always)]
    pub fn limit(&mut self, t: f64) {
        self.z_max = (t * self.stretch) as f32 * (1.0 + 8.0 * U) + TINY;
    }

    /// Calls for every leaf whose box the ray may meet come from here: the next one, nearest boxes first.
    #[inline(always)]
    pub fn next_leaf<S: Lanes>(&self, wide: &Wide, stack: &mut Stack) -> Option<u32> {
        loop {
            let visit = stack.pop()?;
            if visit.near > self.z_max {
                continue;
            }
            let mut child = visit.child;
            // Down the nearest children, without a turn over the stack.
            loop {
                match child.get() {
                    Ok(leaf) => return Some(leaf),
                    Err(node) => {
                        match self.visit_children::<S, true>(wide, &wide.nodes[node as usize], stack) {
                            Some(nearest) => child = nearest,
                            None => break,
                        }
                    }
                }
            }
        }
    }

    /// The nearest child that the ray may meet; the others go on the stack, asked for ahead of time if the ray is `ALONE`.
    #[inline(always)]
    fn visit_children<S: Lanes, const ALONE: bool>(
        &self,
        wide: &Wide,
        node: &Node,
        stack: &mut Stack,
    ) -> Option<Child> {
        let (x, y, z) = (self.slab::<S>(node, 0), self.slab::<S>(node, 1), self.slab::<S>(node, 2));
        let near = x[0].max(y[0]).max(z[0].max(S::splat(self.z_min)));
        let far = x[1].min(y[1]).min(z[1]).mul(S::splat(1.0 + 8.0 * U)).min(S::splat(self.z_max));
        let mut met = far.ge(near).bits();
        if met == 0 {
            return None;
        }
        let first = met.trailing_zeros() as usize;
        met &= met - 1;
        let mut nearest = node.child[first];
        if met == 0 {
            return Some(nearest);
        }
        let mut nears = [0.0; 8];
        near.store(&mut nears);
        let mut least = nears[first];
        let room = stack.room();
        let mut count = 0;
        while met != 0 {
            let lane = met.trailing_zeros() as usize;
            met &= met - 1;
            let mut visit = Visit { near: nears[lane], child: node.child[lane] };
            if ALONE {
                wide.prefetch::<S>(visit.child);
            }
            if visit.near < least {
                (visit, nearest, least) = (Visit { near: least, child: nearest }, visit.child, visit.near);
            }
            // Insertion, farthest first: there are one or two of them.
            let mut at = count;
            while at > 0 && room[at - 1].near < visit.near {
                room[at] = room[at - 1];
                at -= 1;
            }
            room[at] = visit;
            count += 1;
        }
        stack.grow(count);
        Some(nearest)
    }

    /// Where the ray enters and leaves the boxes' slabs along one axis.
    #[inline(always)]
    fn slab<S: Lanes>(&self, node: &Node, axis: usize) -> [S; 2] {
        let inverse = S::splat(self.inverse[axis]);
        let (low, high) = S::Pair::load(&node.planes[axis]).halves();
        // Selected by the sign rather than branched on: directions come in any order.
        let is_up = inverse.ge(S::splat(0.0));
        let (near, far) = (S::select(is_up, low, high), S::select(is_up, high, low));
        let [from_near, from_far] = self.from[axis];
        [near.mul_add(inverse, S::splat(from_near)), far.mul_add(inverse, S::splat(from_far))]
    }

    /// Betters `best` by the triangles of a block; true if it did.
    #[inline(always)]
    pub fn test_leaf<S: Lanes>(
        &mut self,
        wide: &Wide,
        granule: u32,
        placement: u32,
        (t_min, t_max): (f64, f64),
        best: &mut Option<Best>,
    ) -> bool {
        let block = Block::at(&wide.blocks, granule);
        let corners = [block.corner(0), block.corner(1), block.corner(2)];
        let [u, v, w] = self.axes;
        let w = block.coordinates::<S>(w, corners);
        let u = block.coordinates::<S>(u, corners);
        let v = block.coordinates::<S>(v, corners);
        let from = [S::splat(self.origin[0]), S::splat(self.origin[1]), S::splat(self.origin[2])];
        let (gu, gv) = (S::splat(-self.g[0]), S::splat(-self.g[1]));
        let z = [w[0].sub(from[2]), w[1].sub(from[2]), w[2].sub(from[2])];
        let x = [
            gu.mul_add(z[0], u[0].sub(from[0])),
            gu.mul_add(z[1], u[1].sub(from[0])),
            gu.mul_add(z[2], u[2].sub(from[0])),
        ];
        let y = [
            gv.mul_add(z[0], v[0].sub(from[1])),
            gv.mul_add(z[1], v[1].sub(from[1])),
            gv.mul_add(z[2], v[2].sub(from[1])),
        ];
        let minus = S::splat(-0.0);
        let ea = x[1].mul_add(y[2], y[1].mul(x[2]).xor(minus));
        let eb = x[2].mul_add(y[0], y[2].mul(x[0]).xor(minus));
        let ec = x[0].mul_add(y[1], y[0].mul(x[1]).xor(minus));
        let (least, most) = (ea.min(eb).min(ec), ea.max(eb).max(ec));
        let reach_x = x[0].abs().max(x[1].abs()).max(x[2].abs());
        let reach_y = y[0].abs().max(y[1].abs()).max(y[2].abs());
        let constant = EDGE_SQUARED * self.unit * self.unit + TINY;
        let bound = reach_x.max(reach_y).mul_add(S::splat(EDGE * self.unit), S::splat(constant));
        let outer = bound.xor(minus);
        // In this form nothing that isn't a number passes for a miss.
        let miss = most.ge(bound).and(outer.ge(least)).bits();
        let mut maybe = !miss & ((1 << block.triangles) - 1);
        if maybe == 0 {
            return false;
        }
        let sure = least.ge(bound).or(outer.ge(most)).bits();
        let mut found_any = false;
        while maybe != 0 {
            let lane = maybe.trailing_zeros() as usize;
            maybe &= maybe - 1;
            let corners = Corners::from_positions(block.positions(lane), self.ray.origin);
            if sure >> lane & 1 == 0 && !passes(&corners, self.ray.direction) {
                continue;
            }
            let t = corners.depth(self.ray.direction);
            if !(t_min..=t_max).contains(&t) {
                continue;
            }
            if let Some(known) = best {
                let id = |b: &Best| (b.placement, known_id(wide, b, placement));
                let beats = t < known.t
                    || (t == known.t
                        && Candidate { t, placement, triangle: block.id(lane) }.beats(&Candidate {
                            t: known.t,
                            placement: id(known).0,
                            triangle: id(known).1,
                        }));
                if !beats {
                    continue;
                }
            }
            *best = Some(Best { t, placement, slot: Slot::new(granule, lane) });
            found_any = true;
        }
        if found_any && let Some(best) = best {
            self.limit(best.t);
        }
        found_any
    }
}

/// Rays that are walked side by side: where there is more scene than cache, a ray waits for memory at most nodes, and others
/// can work meanwhile.
const TOGETHER: usize = 8;

/// Room for rays walked side by side.
#[derive(Default)]
pub(super) struct Together {
    walks: [Walk; TOGETHER],
}

#[derive(Default)]
struct Walk {
    single: Option<Single>,
    stack: Stack,
    best: Option<Best>,
    ray: usize,
}

impl Together {
    /// Finds the nearest hits (with `any`, a hit) of up to 64 rays in mesh 0, in its space. Gives the rays that f32 is of no use
    /// for, a bit each.
    #[inline(always)]
    pub fn walk<S: Lanes>(&mut self, wide: &Wide, rays: &Batch, any: bool, nearest: &mut Nearest) -> u64 {
        if wide.nodes.is_empty() {
            return 0;
        }
        let limits = (rays.t_min, rays.t_max);
        let (mut untamed, mut next, mut active) = (0, 0, 0_u32);
        let root = Child::node(0);
        let mut children = [root; TOGETHER];
        let mut idle = (1_u32 << TOGETHER) - 1;
        loop {
            while idle != 0 && next < rays.directions.len() {
                let slot = idle.trailing_zeros() as usize;
                let walk = &mut self.walks[slot];
                walk.single = Single::new(rays.ray(next), wide.largest, limits);
                if walk.single.is_some() {
                    (walk.ray, walk.best, walk.stack.len) = (next, None, 0);
                    children[slot] = root;
                    idle &= idle - 1;
                    active |= 1 << slot;
                } else {
                    untamed |= 1 << next;
                }
                next += 1;
            }
            if active == 0 {
                return untamed;
            }
            let mut rest = active;
            while rest != 0 {
                let slot = rest.trailing_zeros() as usize & (TOGETHER - 1);
                rest &= rest - 1;
                let walk = &mut self.walks[slot];
                match walk.step::<S>(wide, children[slot], limits, any) {
                    Some(child) => {
                        wide.prefetch::<S>(child);
                        children[slot] = child;
                    }
                    None => {
                        nearest.set(walk.ray, walk.best);
                        active &= !(1 << slot);
                        idle |= 1 << slot;
                    }
                }
            }
        }
    }
}

impl Walk {
    /// Visits a child; gives the next one.
    #[inline(always)]
    fn step<S: Lanes>(&mut self, wide: &Wide, child: Child, limits: (f64, f64), any: bool) -> Option<Child> {
        let single = self.single.as_mut()?;
        match child.get() {
            Err(node) => {
                let nearest =
                    single.visit_children::<S, false>(wide, &wide.nodes[node as usize], &mut self.stack);
                if nearest.is_some() {
                    return nearest;
                }
            }
            Ok(granule) => {
                if single.test_leaf::<S>(wide, granule, 0, limits, &mut self.best) && any {
                    return None;
                }
            }
        }
        loop {
            let visit = self.stack.pop()?;
            if visit.near <= single.z_max {
                return Some(visit.child);
            }
        }
    }
}

/// The triangle's id if it is of `placement`, whose mesh is `wide`; otherwise the placements' numbers decide.
#[inline(always)]
fn known_id(wide: &Wide, best: &Best, placement: u32) -> u32 {
    if best.placement == placement {
        Block::at(&wide.blocks, best.slot.granule()).id(best.slot.lane())
    } else {
        0
    }
}

/// Kept out of the loop: few triangles come so close.
#[cold]
#[inline(never)]
fn passes(corners: &Corners, direction: DVec3) -> bool {
    corners.passes(direction)
}
