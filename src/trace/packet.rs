//! Packets: up to 64 rays from one point, walked through the hierarchy together.
//!
//! # The pyramid
//! All rays of a tile leave from o, so they are a pyramid. With w the axis along which they mostly go (turned over if they
//! go down it), a ray is g = (g_u, g_v, 1) = d / d_w: a point on a plane, and the tile a rectangle there. A box (relative to
//! o) is met by a ray of the rectangle only if, for some w in the box and in front of the origin, w·[u₀, u₁] meets the box's
//! u and w·[v₀, v₁] its v: two products and two comparisons a side.
//!
//! # The decision in f32
//! For a triangle's corners a, b, c relative to o (rounded), the edge function of the edge b–c is
//! E = g·((c−b) × (c+b)) = −2 det(g, b, c): Segura and Feito's signed volumes, in the form that is precomputed for a common
//! origin, one dot product an edge and ray. A ray passes when the three have one sign. With u = 2⁻²⁴, L the triangle's
//! largest box side (plus 4uM, for what rounding the corners moves), M the largest |coordinate| of its corners relative to o
//! and G = 1 + max|g_u| + max|g_v|, Ê differs from E by at most (in units of u·G·L·M)
//!
//! | from | error |
//! |---|---|
//! | the side c−b, rounded once (relative u), in two products of 2LM each | 4 |
//! | b = a + (b−a): a is off by 2uM (two subtractions, of the origin's high and low part), the sum by uM more, so b and c by 4uM and their sum by 8uM; times L, twice | 16 |
//! | the cross product: two products and a difference (one rounding less when fused) | 8 |
//! | the dot product: three products and two sums of terms up to 4LM·|g| | 12 |
//! | rounding g_u and g_v, times 4LM | 4 |
//!
//! 44 in all; [`EDGE`] is 56, which leaves room for the terms in u², for the corners' own rounding to f64 in the definition
//! (2⁻⁵³M against L ≥ 4uM) and for the rounding of the bound itself. So Ê < −B (with the triangle's orientation known) is a
//! miss, all Ê ≥ B a hit, and what lies between is decided by [`exact`].
//!
//! The orientation is that of T = a·N, N = (b−a) × (c−a): off by at most 54·u·L²·M (N's components by 8uL², times |a|₁ ≤ 3M:
//! 24; a by 2uM times |N|₁ ≤ 6L²: 12; the dot product's roundings: 18); [`VOLUME`] is 64. Within that both orientations are
//! possible. Depth along w is z = T/(g·N), whose denominator is off by at most 18·u·G·L² (N: 8, g: 2, the dot product: 8);
//! [`SLOPE`] is 24. Where the denominator is at least four times its bound, z lies between the quotients of the ends.
//!
//! Everything has an absolute term of 10⁻³⁶ besides, for what underflows. Where numbers overflow, bounds become infinite and
//! everything is decided by `exact`: slow, and right.
//!
//! # Depth
//! The best hit of a ray is kept as an interval of z that holds the true one. A sure hit whose interval lies before it
//! replaces it, one behind is dropped, and where intervals overlap the f64 depths (and, if these are equal, the ids) decide.
//! A box or triangle is passed over only if it begins behind the upper end.

use glam::DVec3;

use super::exact::Real;
use super::exact::{Candidate, Corners};
use super::lanes::{Doubles, Lanes, Triple};
use super::tracer::Best;
use super::wide::{Block, Node, Slot, WIDTH, Wide};

/// Rays of a tile at most.
pub(super) const RAYS: usize = 64;
const GROUPS: usize = RAYS / 8;

/// Unit roundoff of f32.
const U: f32 = f32::EPSILON / 2.0;
/// Error of an edge function in units of u·G·L·M.
const EDGE: f32 = 56.0;
/// Error of a triangle's volume T in units of u·L²·M.
const VOLUME: f32 = 64.0;
/// Error of the denominator of a depth in units of u·G·L².
const SLOPE: f32 = 24.0;
/// What underflow may cost.
const TINY: f32 = 1e-36;

/// The steepest ray of a tile: |g_u| and |g_v| stay below.
const STEEPEST: f64 = 8.0;

/// The nearest hits of a tile's rays so far, over all placements.
pub(super) struct Nearest {
    /// Depth; `t_max` where there is no hit.
    t: [f64; RAYS],
    slot: [u32; RAYS],
    placement: [u32; RAYS],
    /// Bit a ray: there is a hit.
    hit: u64,
}

impl Nearest {
    pub fn new(t_max: f64) -> Self {
        Self { t: [t_max; RAYS], slot: [0; RAYS], placement: [0; RAYS], hit: 0 }
    }

    #[inline(always)]
    pub fn get(&self, ray: usize) -> Option<Best> {
        let best = Best { t: self.t[ray], placement: self.placement[ray], slot: Slot(self.slot[ray]) };
        (self.hit >> ray & 1 != 0).then_some(best)
    }

    /// The slot of the four rays from number `first` on, if all hit the same triangle of `placement`.
    #[inline(always)]
    pub fn all_in(&self, first: usize, placement: u32) -> Option<Slot> {
        let slots: &[u32; 4] = self.slot[first..first + 4].try_into().unwrap();
        let placements: &[u32; 4] = self.placement[first..first + 4].try_into().unwrap();
        let alike =
            self.hit >> first & 0b1111 == 0b1111 && *slots == [slots[0]; 4] && *placements == [placement; 4];
        alike.then_some(Slot(slots[0]))
    }

    pub fn set(&mut self, ray: usize, best: Option<Best>) {
        if let Some(best) = best {
            (self.t[ray], self.placement[ray], self.slot[ray]) = (best.t, best.placement, best.slot.0);
            self.hit |= 1 << ray;
        }
    }
}

/// A tile in the space of one mesh.
pub(super) struct Tile<'a> {
    wide: &'a Wide,
    placement: u32,
    origin: DVec3,
    directions: &'a [DVec3],
    t_min: f64,
    t_max: f64,
    /// Which of x, y, z are u, v and w.
    axes: [usize; 3],
    /// Whether w is turned over.
    turned: bool,
    /// The origin along u, v, w (turned over as w is), in two parts.
    high: [f32; 3],
    low: [f32; 3],
    /// What the lower and the upper planes of boxes are measured from, along u, v and w (w not turned over).
    lower_from: [f32; 3],
    upper_from: [f32; 3],
    /// g_u and g_v of each ray.
    g: [[f32; RAYS]; 2],
    /// Bounds of the depth along w of the nearest hit of each ray; −1 for lanes without a ray.
    z_low: [f32; RAYS],
    z_high: [f32; RAYS],
    /// Where the nearest hit lies, for rays whose nearest hit is `here`.
    slot: [u32; RAYS],
    /// Its depth, where `known`.
    t: [f64; RAYS],
    known: u64,
    hit: u64,
    here: u64,
    foreign: [u32; RAYS],
    /// Of each group of eight rays: its rectangle on the plane w = 1, with some room, and its largest `z_high`.
    rectangle: Rectangle<[f32; GROUPS]>,
    far: [f32; GROUPS],
    /// Depths along w that may be too near for the sensor end here.
    near: f32,
    /// G.
    reach: f32,
}

/// u₀, u₁, v₀, v₁.
#[derive(Clone, Copy)]
struct Rectangle<T> {
    u: [T; 2],
    v: [T; 2],
}

/// A box relative to the origin, w turned over as the tile's is.
#[derive(Clone, Copy)]
struct Box<T> {
    u: [T; 2],
    v: [T; 2],
    w: [T; 2],
}

/// A leaf that rays may meet.
pub(super) struct Leaf {
    /// A block's granule, or a placement.
    pub number: u32,
    bounds: Box<f32>,
    groups: u32,
}

/// Something to visit: a child of a node, and where its box begins along w.
#[derive(Clone, Copy)]
pub(super) struct Visit {
    near: f32,
    /// The node whose child it is, and which: `node · 8 + lane`.
    place: u32,
}

impl<'a> Tile<'a> {
    /// Prepares up to [`RAYS`] rays of one origin for a mesh. `None` if they are no narrow pyramid: more than a right angle
    /// apart or nearly so, not finite, or from so far away that f32 can't tell.
    #[inline(always)]
    pub fn new<S: Lanes>(
        wide: &'a Wide,
        placement: u32,
        origin: DVec3,
        directions: &'a [DVec3],
        (t_min, t_max): (f64, f64),
        nearest: &Nearest,
    ) -> Option<Self> {
        debug_assert!(directions.len() <= RAYS);
        let size = f64::from(wide.largest).max(origin.abs().max_element());
        let sum: DVec3 = directions.iter().sum();
        let along = sum.abs();
        // Sizes whose cubes leave f32's range are not worth a packet.
        if !(size < 1e12 && along.is_finite()) {
            return None;
        }
        let w = if along.x >= along.y && along.x >= along.z {
            0
        } else if along.y >= along.z {
            1
        } else {
            2
        };
        let axes = [(w + 1) % 3, (w + 2) % 3, w];
        let turned = sum[w] < 0.0;
        let mut tile = Self {
            wide,
            placement,
            origin,
            directions,
            t_min,
            t_max,
            axes,
            turned,
            high: [0.0; 3],
            low: [0.0; 3],
            lower_from: [0.0; 3],
            upper_from: [0.0; 3],
            g: [[0.0; RAYS]; 2],
            z_low: [0.0; RAYS],
            z_high: [0.0; RAYS],
            slot: nearest.slot,
            t: nearest.t,
            known: u64::MAX,
            hit: nearest.hit,
            here: 0,
            foreign: nearest.placement,
            rectangle: Rectangle { u: [[0.0; GROUPS]; 2], v: [[0.0; GROUPS]; 2] },
            far: [-1.0; GROUPS],
            near: 0.0,
            reach: 0.0,
        };
        let zero = S::Doubles::splat(0.0);
        let (mut steepest, mut longest) = (zero, zero);
        let side = S::Doubles::splat(if turned { -1.0 } else { 1.0 });
        let has_hits = nearest.hit != 0 || t_max.is_finite();
        let last = directions.len() - 1;
        for first in (0..directions.len().next_multiple_of(8)).step_by(4) {
            // Past the last ray, copies of it, which with a far end of −1 see nothing.
            let d: [&DVec3; 4] = match directions.get(first..first + 4) {
                Some(four) => [&four[0], &four[1], &four[2], &four[3]],
                None => [0, 1, 2, 3].map(|k| &directions[(first + k).min(last)]),
            };
            let along = S::Doubles::load(&[d[0][w], d[1][w], d[2][w], d[3][w]]).mul(side);
            let (iu, iv) = (axes[0], axes[1]);
            let gu = S::Doubles::load(&[d[0][iu], d[1][iu], d[2][iu], d[3][iu]]).div(along);
            let gv = S::Doubles::load(&[d[0][iv], d[1][iv], d[2][iv], d[3][iv]]).div(along);
            let steep = gu.abs().max(gv.abs());
            // In this form NaN, infinity and a wrong sign don't pass.
            let passes = S::Doubles::splat(f64::MIN_POSITIVE).le(along)
                & gu.abs().le(S::Doubles::splat(STEEPEST))
                & gv.abs().le(S::Doubles::splat(STEEPEST));
            if passes != 0b1111 {
                return None;
            }
            steepest = steepest.max(steep);
            longest = longest.max(along);
            tile.g[0][first..first + 4].copy_from_slice(&gu.to_f32());
            tile.g[1][first..first + 4].copy_from_slice(&gv.to_f32());
            if has_hits {
                let mut lengths = [0.0; 4];
                along.store(&mut lengths);
                for (k, along) in lengths.into_iter().enumerate() {
                    let ray = first + k;
                    (tile.z_low[ray], tile.z_high[ray]) = bounds(nearest.t[ray] * along);
                }
            }
        }
        if !has_hits {
            tile.z_low[..directions.len()].fill(f32::INFINITY);
            tile.z_high[..directions.len()].fill(f32::INFINITY);
        }
        tile.z_low[directions.len()..].fill(-1.0);
        tile.z_high[directions.len()..].fill(-1.0);
        let (mut steep, mut long) = ([0.0; 4], [0.0; 4]);
        steepest.store(&mut steep);
        longest.store(&mut long);
        let most = |four: [f64; 4]| four.into_iter().fold(0.0, f64::max);
        tile.reach = (1.0 + 2.0 * most(steep)) as f32 * (1.0 + 2.0 * U);
        tile.near = bounds(t_min * most(long)).1;
        // The planes of boxes lose 2⁻²⁴ of the origin a few times: in its rounding, here, and in the subtraction. (What they
        // lose of their own size is in their padding.)
        let slack = (origin.abs().max_element() as f32) * (8.0 * U) + TINY;
        for (k, &axis) in axes.iter().enumerate() {
            let high = origin[axis] as f32;
            let low = (origin[axis] - f64::from(high)) as f32;
            (tile.lower_from[k], tile.upper_from[k]) = (high + slack, high - slack);
            let turn = if k == 2 && turned { -1.0 } else { 1.0 };
            (tile.high[k], tile.low[k]) = (high * turn, low * turn);
        }
        for group in 0..directions.len().div_ceil(8) {
            for (k, sides) in [&mut tile.rectangle.u, &mut tile.rectangle.v].into_iter().enumerate() {
                let lanes = S::load(eight(&tile.g[k], group));
                let (least, most) = (-lanes.xor(S::splat(-0.0)).largest(), lanes.largest());
                // Room for the rounding of g and of products with it.
                sides[0][group] = least - 4e-7 * (1.0 + least.abs());
                sides[1][group] = most + 4e-7 * (1.0 + most.abs());
            }
            tile.far[group] = S::load(eight(&tile.z_high, group)).largest();
        }
        Some(tile)
    }

    /// Finds the nearest hits in the mesh.
    #[inline(always)]
    pub fn walk_mesh<S: Lanes>(&mut self, stack: &mut Vec<Visit>) {
        self.enter_root::<S>(stack);
        while let Some(leaf) = self.next_leaf::<S>(stack) {
            self.test_leaf::<S>(&leaf);
        }
    }

    /// Puts what the rays may meet at the top of the hierarchy on the stack.
    #[inline(always)]
    pub fn enter_root<S: Lanes>(&self, stack: &mut Vec<Visit>) {
        stack.clear();
        if let Some(root) = self.wide.nodes.first() {
            self.visit_children::<S>(0, root, !0, stack);
        }
    }

    /// The next leaf that rays may meet, nearest boxes first.
    #[inline(always)]
    pub fn next_leaf<S: Lanes>(&self, stack: &mut Vec<Visit>) -> Option<Leaf> {
        while let Some(visit) = stack.pop() {
            if visit.near > self.farthest() {
                continue;
            }
            let (index, lane) = (visit.place / WIDTH as u32, visit.place as usize % WIDTH);
            let parent = &self.wide.nodes[index as usize];
            let bounds = self.child_box(parent, lane);
            let groups = self.groups_in::<S>(&bounds);
            if groups == 0 {
                continue;
            }
            match parent.child[lane].get() {
                Err(child) => {
                    self.visit_children::<S>(child, &self.wide.nodes[child as usize], groups, stack)
                }
                Ok(number) => return Some(Leaf { number, bounds, groups }),
            }
        }
        None
    }

    /// Takes over hits that were found elsewhere since.
    pub fn update(&mut self, nearest: &Nearest) {
        let w = self.axes[2];
        for (ray, d) in self.directions.iter().enumerate() {
            (self.z_low[ray], self.z_high[ray]) = bounds(nearest.t[ray] * d[w].abs());
        }
        for (group, far) in self.far.iter_mut().enumerate() {
            *far = eight(&self.z_high, group).iter().copied().fold(-1.0, f32::max);
        }
    }

    /// Hands the hits found here to `nearest`, with their f64 depths if `with_depths`.
    #[inline(always)]
    pub fn leave(mut self, nearest: &mut Nearest, with_depths: bool) {
        if self.here == u64::MAX && !with_depths {
            nearest.slot = self.slot;
            nearest.placement = [self.placement; RAYS];
        } else {
            let mut rest = self.here;
            while rest != 0 {
                let ray = rest.trailing_zeros() as usize;
                rest &= rest - 1;
                if with_depths {
                    nearest.t[ray] = self.depth_of_best(ray);
                }
                nearest.slot[ray] = self.slot[ray];
                nearest.placement[ray] = self.placement;
            }
        }
        nearest.hit |= self.here;
    }

    fn farthest(&self) -> f32 {
        self.far.iter().copied().fold(-1.0, |a, b| if b > a { b } else { a })
    }

    /// The box of one child.
    #[inline(always)]
    fn child_box(&self, node: &Node, lane: usize) -> Box<f32> {
        let side = |k: usize| {
            let axis = self.axes[k];
            [node.low[axis][lane] - self.lower_from[k], node.high[axis][lane] - self.upper_from[k]]
        };
        let w = side(2);
        Box { u: side(0), v: side(1), w: if self.turned { [-w[1], -w[0]] } else { w } }
    }

    /// Which groups a box may concern, a bit each.
    #[inline(always)]
    fn groups_in<S: Lanes>(&self, b: &Box<f32>) -> u32 {
        let rectangle = Rectangle {
            u: [S::load(&self.rectangle.u[0]), S::load(&self.rectangle.u[1])],
            v: [S::load(&self.rectangle.v[0]), S::load(&self.rectangle.v[1])],
        };
        let b = Box::<S> { u: spread(b.u), v: spread(b.v), w: spread(b.w) };
        let begins = b.w[0].max(S::splat(0.0)); // not before the origin: lanes without a ray end at −1
        meets(&rectangle, &b).and(S::load(&self.far).ge(begins)).and(b.w[1].ge(S::splat(0.0))).bits()
    }

    /// Puts the children that the rays of `groups` may meet on the stack, the nearest on top.
    #[inline(always)]
    fn visit_children<S: Lanes>(&self, index: u32, node: &Node, groups: u32, stack: &mut Vec<Visit>) {
        let rectangle = self.rectangle_of(groups);
        let rectangle = Rectangle::<S> { u: spread(rectangle.u), v: spread(rectangle.v) };
        let w = self.sides::<S>(node, 2);
        let turn = S::splat(-0.0);
        let w = if self.turned { [w[1].xor(turn), w[0].xor(turn)] } else { w };
        let boxes = Box { u: self.sides(node, 0), v: self.sides(node, 1), w };
        let far = S::splat(self.farthest());
        let mut met = meets(&rectangle, &boxes).and(far.ge(w[0])).and(w[1].ge(S::splat(0.0))).bits();
        if met == 0 {
            return;
        }
        let mut near = [0.0; 8];
        w[0].store(&mut near);
        let first = stack.len();
        while met != 0 {
            let lane = met.trailing_zeros() as usize;
            met &= met - 1;
            match node.child[lane].get() {
                Err(child) => S::prefetch(&self.wide.nodes[child as usize]),
                Ok(number) => prefetch_block::<S>(&self.wide.blocks, number),
            }
            let visit = Visit { near: near[lane], place: index * WIDTH as u32 + lane as u32 };
            // Insertion, farthest first: there are three or four of them.
            let mut at = stack.len();
            stack.push(visit);
            while at > first && stack[at - 1].near < visit.near {
                stack[at] = stack[at - 1];
                at -= 1;
            }
            stack[at] = visit;
        }
    }

    /// The planes of all children's boxes along u, v or w, w not turned over.
    #[inline(always)]
    fn sides<S: Lanes>(&self, node: &Node, k: usize) -> [S; 2] {
        let axis = self.axes[k];
        [
            S::load(&node.low[axis]).sub(S::splat(self.lower_from[k])),
            S::load(&node.high[axis]).sub(S::splat(self.upper_from[k])),
        ]
    }

    /// The rectangle around those of `groups`.
    #[inline(always)]
    fn rectangle_of(&self, groups: u32) -> Rectangle<f32> {
        let Rectangle { u, v } = &self.rectangle;
        let mut all =
            Rectangle { u: [f32::INFINITY, f32::NEG_INFINITY], v: [f32::INFINITY, f32::NEG_INFINITY] };
        for group in 0..self.directions.len().div_ceil(8) {
            if groups >> group & 1 != 0 {
                all.u = [all.u[0].min(u[0][group]), all.u[1].max(u[1][group])];
                all.v = [all.v[0].min(v[0][group]), all.v[1].max(v[1][group])];
            }
        }
        all
    }

    /// Tests the triangles of a block against the rays of `groups` that its box lets through.
    #[inline(always)]
    fn test_leaf<S: Lanes>(&mut self, leaf: &Leaf) {
        let Leaf { number: granule, bounds: ref b, groups } = *leaf;
        // M: the box is padded, so no corner is farther out.
        let largest = |side: [f32; 2]| side[0].abs().max(side[1].abs());
        let m = largest(b.u).max(largest(b.v)).max(largest(b.w));
        let mut alive = [0_u8; GROUPS];
        let mut rays = 0;
        let mut busy_groups = 0;
        // 2⁻²⁴ of |g|·w ≤ 8M is lost twice, in g and in the product.
        let room = 32.0 * U * m;
        let planes = Box::<S> {
            u: spread([b.u[0] - room, b.u[1] + room]),
            v: spread([b.v[0] - room, b.v[1] + room]),
            w: spread(b.w),
        };
        let begins = planes.w[0].max(S::splat(0.0));
        for group in bits(groups) {
            let (gu, gv) = (S::load(eight(&self.g[0], group)), S::load(eight(&self.g[1], group)));
            let far = S::load(eight(&self.z_high, group));
            let met = meets(&Rectangle { u: [gu, gu], v: [gv, gv] }, &planes).and(far.ge(begins)).bits();
            alive[group] = met as u8;
            rays += met.count_ones();
            busy_groups += u32::from(met != 0);
        }
        if rays == 0 {
            return;
        }
        let block = Block::at(&self.wide.blocks, granule);
        let prepared = Prepared::<S>::new(self, &block, m);
        if rays <= 2 + busy_groups * block.triangles as u32 {
            self.rays_against_triangles(granule, &prepared, &alive);
        } else {
            self.triangles_against_rays(granule, &prepared, &alive);
        }
        for group in bits(groups) {
            if alive[group] != 0 {
                self.far[group] = S::load(eight(&self.z_high, group)).largest();
            }
        }
    }

    /// One ray at a time against all triangles: for few rays.
    #[inline(always)]
    fn rays_against_triangles<S: Lanes>(&mut self, granule: u32, p: &Prepared<S>, alive: &[u8; GROUPS]) {
        for (group, &alive) in alive.iter().enumerate() {
            for lane in bits(u32::from(alive)) {
                let ray = group * 8 + lane;
                let (gu, gv) = (S::splat(self.g[0][ray]), S::splat(self.g[1][ray]));
                let edges =
                    [p.edges[0].dot_ray(gu, gv), p.edges[1].dot_ray(gu, gv), p.edges[2].dot_ray(gu, gv)];
                let least = edges[0].min(edges[1]).min(edges[2]);
                let outer = S::splat(-p.edge_error);
                let mut maybe = least.ge(outer).bits() & p.oriented;
                if p.unoriented != 0 {
                    let most = edges[0].max(edges[1]).max(edges[2]);
                    maybe |= least.ge(outer).or(S::splat(p.edge_error).ge(most)).bits() & p.unoriented;
                }
                if maybe == 0 {
                    continue;
                }
                let slope = p.normal.dot_ray(gu, gv);
                let sure =
                    least.ge(S::splat(p.edge_error)).and(slope.ge(S::splat(4.0 * p.slope_error))).bits()
                        & p.oriented;
                let (z_low, z_high) = p.depths(slope, S::load(&p.volume));
                let (mut low, mut high) = ([0.0; 8], [0.0; 8]);
                z_low.store(&mut low);
                z_high.store(&mut high);
                for lane in bits(maybe) {
                    if sure >> lane & 1 == 0 || low[lane] < self.near {
                        self.decide(ray, granule, lane);
                    } else if high[lane] < self.z_low[ray] {
                        self.z_low[ray] = low[lane];
                        self.z_high[ray] = high[lane];
                        self.slot[ray] = Slot::new(granule, lane).0;
                        self.replaced(1 << ray);
                    } else if low[lane] <= self.z_high[ray] {
                        self.decide(ray, granule, lane);
                    }
                }
            }
        }
    }

    /// One triangle at a time against eight rays: for many rays.
    #[inline(always)]
    fn triangles_against_rays<S: Lanes>(&mut self, granule: u32, p: &Prepared<S>, alive: &[u8; GROUPS]) {
        let all = p.oriented | p.unoriented;
        let tables = [p.edges[0].store(), p.edges[1].store(), p.edges[2].store(), p.normal.store()];
        for lane in bits(all) {
            let a = Triple::<S>::spread_lane(&tables[0], lane);
            let b = Triple::<S>::spread_lane(&tables[1], lane);
            let c = Triple::<S>::spread_lane(&tables[2], lane);
            let is_oriented = p.oriented >> lane & 1 != 0;
            for (group, &alive) in alive.iter().enumerate() {
                if alive == 0 {
                    continue;
                }
                let (gu, gv) = (S::load(eight(&self.g[0], group)), S::load(eight(&self.g[1], group)));
                let (ea, eb, ec) = (a.dot_ray(gu, gv), b.dot_ray(gu, gv), c.dot_ray(gu, gv));
                let least = ea.min(eb).min(ec);
                let mut maybe = least.ge(S::splat(-p.edge_error));
                if !is_oriented {
                    maybe = maybe.or(S::splat(p.edge_error).ge(ea.max(eb).max(ec)));
                }
                let maybe_bits = maybe.bits() & u32::from(alive);
                if maybe_bits == 0 {
                    continue;
                }
                if !is_oriented {
                    for k in bits(maybe_bits) {
                        self.decide(group * 8 + k, granule, lane);
                    }
                    continue;
                }
                let slope = Triple::<S>::spread_lane(&tables[3], lane).dot_ray(gu, gv);
                let (z_low, z_high) = p.depths(slope, S::splat(p.volume[lane]));
                let best_low = S::load(eight(&self.z_low, group));
                let best_high = S::load(eight(&self.z_high, group));
                let sure = least.ge(S::splat(p.edge_error)).and(slope.ge(S::splat(4.0 * p.slope_error)));
                let in_front = sure.and(z_low.ge(S::splat(self.near)));
                // Strictly before, and strictly behind.
                let nearer_bits = in_front.bits() & !z_high.ge(best_low).bits() & maybe_bits;
                let behind_bits = sure.bits() & !best_high.ge(z_low).bits();
                if nearer_bits != 0 {
                    let nearer = lane_mask::<S>(nearer_bits);
                    S::select(nearer, z_low, best_low).store(eight_mut(&mut self.z_low, group));
                    S::select(nearer, z_high, best_high).store(eight_mut(&mut self.z_high, group));
                    let slots = eight_mut(&mut self.slot, group);
                    let slot = S::load_bits(&[Slot::new(granule, lane).0; 8]);
                    S::select(nearer, slot, S::load_bits(slots)).store_bits(slots);
                    self.replaced(u64::from(nearer_bits) << (group * 8));
                }
                for k in bits(maybe_bits & !nearer_bits & !behind_bits) {
                    self.decide(group * 8 + k, granule, lane);
                }
            }
        }
    }

    /// Notes that these rays have a new best hit, here, whose f64 depth is not worked out.
    #[inline(always)]
    fn replaced(&mut self, rays: u64) {
        self.hit |= rays;
        self.here |= rays;
        self.known &= !rays;
    }

    /// Decides in f64 and, where that is not enough, exactly.
    #[cold]
    #[inline(never)]
    fn decide(&mut self, ray: usize, granule: u32, lane: usize) {
        let block = Block::at(&self.wide.blocks, granule);
        let direction = self.directions[ray];
        let corners = Corners::from_positions(block.positions(lane), self.origin);
        if !corners.passes(direction) {
            return;
        }
        let t = corners.depth(direction);
        if !(self.t_min..=self.t_max).contains(&t) {
            return;
        }
        let found = Candidate { t, placement: self.placement, triangle: block.id(lane) };
        if self.hit >> ray & 1 != 0 {
            let best = Slot(self.slot[ray]);
            let is_here = self.here >> ray & 1 != 0;
            let known = Candidate {
                t: self.depth_of_best(ray),
                placement: if is_here { self.placement } else { self.foreign[ray] },
                triangle: if is_here {
                    Block::at(&self.wide.blocks, best.granule()).id(best.lane())
                } else {
                    0
                },
            };
            if !found.beats(&known) {
                return;
            }
        }
        let w = self.axes[2];
        (self.z_low[ray], self.z_high[ray]) = bounds(t * direction[w].abs());
        self.slot[ray] = Slot::new(granule, lane).0;
        self.replaced(1 << ray);
        self.t[ray] = t;
        self.known |= 1 << ray;
    }

    /// The f64 depth of a ray's best hit, worked out once.
    fn depth_of_best(&mut self, ray: usize) -> f64 {
        if self.known >> ray & 1 == 0 {
            let slot = Slot(self.slot[ray]);
            let positions = Block::at(&self.wide.blocks, slot.granule()).positions(slot.lane());
            self.t[ray] = Corners::from_positions(positions, self.origin).depth(self.directions[ray]);
            self.known |= 1 << ray;
        }
        self.t[ray]
    }
}

/// A block's triangles, prepared for the tile's origin: turned so that rays that pass from the front of the pyramid have
/// positive edge functions and a positive denominator.
struct Prepared<S> {
    /// E = g·edge of the three edges, those opposite a, b and c.
    edges: [Triple<S>; 3],
    normal: Triple<S>,
    /// |T|.
    volume: [f32; 8],
    /// Triangles whose orientation is known, and those whose is not, a bit each.
    oriented: u32,
    unoriented: u32,
    edge_error: f32,
    volume_error: f32,
    slope_error: f32,
}

impl<S: Lanes> Prepared<S> {
    #[inline(always)]
    fn new(tile: &Tile, block: &Block, m: f32) -> Self {
        let turn = S::splat(if tile.turned { -0.0 } else { 0.0 });
        let corners = [block.corner(0), block.corner(1), block.corner(2)];
        let [u, v, w] = tile.axes;
        let (u, v, w) = (
            block.coordinates(u, corners),
            block.coordinates(v, corners),
            block.coordinates::<S>(w, corners),
        );
        let a = Triple(u[0], v[0], w[0].xor(turn));
        let b = Triple(u[1], v[1], w[1].xor(turn));
        let c = Triple(u[2], v[2], w[2].xor(turn));
        let (ab, ac, bc) = (b.sub(a), c.sub(a), c.sub(b));
        let a = a.sub(Triple::splat(tile.high)).sub(Triple::splat(tile.low));
        let (b, c) = (a.add(ab), a.add(ac));
        let normal = ab.cross(ac);
        let volume = a.0.mul_add(normal.0, a.1.mul_add(normal.1, a.2.mul(normal.2)));

        let side = block.extent() * (1.0 + 4.0 * U) + 4.0 * U * m;
        let edge_error = EDGE * U * tile.reach * side * m + TINY;
        let volume_error = VOLUME * U * side * side * m + TINY;
        let slope_error = SLOPE * U * tile.reach * side * side + TINY;

        // (c−b) × (c+b) is −2 b × c: positive inside for a triangle with T < 0.
        let against = volume.signs().xor(S::splat(-0.0));
        let edges = [
            bc.cross(b.add(c)).flip(against),
            ac.cross(c.add(a)).flip(volume.signs()),
            ab.cross(a.add(b)).flip(against),
        ];
        let size = volume.abs();
        let triangles = (1_u32 << block.triangles) - 1;
        let unoriented = S::splat(volume_error).ge(size).bits() & triangles;
        // NaN, from overflow, is on neither side of anything.
        let known = size.ge(S::splat(volume_error)).bits() & triangles & !unoriented;
        let mut volumes = [0.0; 8];
        size.store(&mut volumes);
        Self {
            edges,
            normal: normal.flip(volume.signs()),
            volume: volumes,
            oriented: known,
            unoriented: triangles & !known,
            edge_error,
            volume_error,
            slope_error,
        }
    }

    /// Bounds of z for denominators of at least four times their error.
    #[inline(always)]
    fn depths(&self, slope: S, volume: S) -> (S, S) {
        let (volume_error, slope_error) = (S::splat(self.volume_error), S::splat(self.slope_error));
        let low = volume.sub(volume_error).div(slope.add(slope_error));
        let high = volume.add(volume_error).div(slope.sub(slope_error));
        (low.mul(S::splat(1.0 - 16.0 * U)), high.mul(S::splat(1.0 + 16.0 * U)))
    }
}

/// Whether a pyramid with this rectangle may meet a box that reaches to `w` ≥ 0, for eight pairs of them: for some w in the
/// box w·[u₀, u₁] meets its u, and likewise v.
#[inline(always)]
fn meets<S: Lanes>(r: &Rectangle<S>, b: &Box<S>) -> S {
    let near = b.w[0].max(S::splat(0.0));
    let far = b.w[1];
    overlaps(r.u, b.u, near, far).and(overlaps(r.v, b.v, near, far))
}

/// Whether w·[r₀, r₁] meets [b₀, b₁] for some w from `near` to `far`.
#[inline(always)]
fn overlaps<S: Lanes>(r: [S; 2], b: [S; 2], near: S, far: S) -> S {
    let least = r[0].mul(near).min(r[0].mul(far));
    let most = r[1].mul(near).max(r[1].mul(far));
    b[1].ge(least).and(most.ge(b[0]))
}

#[inline(always)]
fn spread<S: Lanes>(side: [f32; 2]) -> [S; 2] {
    [S::splat(side[0]), S::splat(side[1])]
}

/// f32 bounds of an f64 depth, with a few ulps of room.
fn bounds(z: f64) -> (f32, f32) {
    let near = z as f32;
    let room = near * (4.0 * U) + TINY;
    if near.is_finite() { (near - room, near + room) } else { (near, near) }
}

/// The indices of the bits that are set, lowest first.
#[inline(always)]
fn bits(mut set: u32) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = (set != 0).then_some(set.trailing_zeros() as usize);
        set &= set.wrapping_sub(1);
        bit
    })
}

#[inline(always)]
fn eight(values: &[f32; RAYS], group: usize) -> &[f32; 8] {
    values[group * 8..group * 8 + 8].try_into().unwrap()
}

#[inline(always)]
fn eight_mut<T>(values: &mut [T; RAYS], group: usize) -> &mut [T; 8] {
    (&mut values[group * 8..group * 8 + 8]).try_into().unwrap()
}

/// A mask from one bit a lane.
#[inline(always)]
fn lane_mask<S: Lanes>(set: u32) -> S {
    S::load_bits(&std::array::from_fn(|k| 0_u32.wrapping_sub(set >> k & 1)))
}

#[inline(always)]
fn prefetch_block<S: Lanes>(blocks: &[u32], granule: u32) {
    let start = granule as usize * super::wide::GRANULE;
    if let Some(words) = blocks.get(start..start + 48) {
        let words: &[u32; 48] = words.try_into().unwrap();
        S::prefetch(words);
    }
}
