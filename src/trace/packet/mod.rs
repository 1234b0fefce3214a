//! Packets: up to 64 rays from one point, walked through the hierarchy together.
//!
//! # The pyramid
//! All rays of a tile leave from o, so they are a pyramid. With w the axis along which they mostly go (turned over if they
//! go down it), a ray is g = (g_u, g_v, 1) = d / d_w: a point on a plane, and the tile a rectangle there. A box (relative to
//! o) is met by a ray of the rectangle only if, for some w in the box and in front of the origin, w·[u₀, u₁] meets the box's
//! u and w·[v₀, v₁] its v: two products and two comparisons a side.
//!
//! What happens at a leaf is in [`leaf`].

mod leaf;

use glam::DVec3;

use super::exact::Real;
use super::lanes::{Doubles, Lanes};
use super::tracer::Best;
use super::wide::{Node, Slot, WIDTH, Wide};

/// Rays of a tile at most.
pub(super) const RAYS: usize = 64;
const GROUPS: usize = RAYS / 8;

/// Unit roundoff of f32.
const U: f32 = f32::EPSILON / 2.0;
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
struct RelativeBox<T> {
    u: [T; 2],
    v: [T; 2],
    w: [T; 2],
}

/// A leaf that rays may meet.
pub(super) struct Leaf {
    /// A block's granule, or a placement.
    pub number: u32,
    bounds: RelativeBox<f32>,
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
    fn child_box(&self, node: &Node, lane: usize) -> RelativeBox<f32> {
        let side = |k: usize| {
            let axis = self.axes[k];
            [node.low[axis][lane] - self.lower_from[k], node.high[axis][lane] - self.upper_from[k]]
        };
        let w = side(2);
        RelativeBox { u: side(0), v: side(1), w: if self.turned { [-w[1], -w[0]] } else { w } }
    }

    /// Which groups a box may concern, a bit each.
    #[inline(always)]
    fn groups_in<S: Lanes>(&self, b: &RelativeBox<f32>) -> u32 {
        let rectangle = Rectangle {
            u: [S::load(&self.rectangle.u[0]), S::load(&self.rectangle.u[1])],
            v: [S::load(&self.rectangle.v[0]), S::load(&self.rectangle.v[1])],
        };
        let b = RelativeBox::<S> { u: spread(b.u), v: spread(b.v), w: spread(b.w) };
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
        let boxes = RelativeBox { u: self.sides(node, 0), v: self.sides(node, 1), w };
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
}

/// Whether a pyramid with this rectangle may meet a box that reaches to `w` ≥ 0, for eight pairs of them: for some w in the
/// box w·[u₀, u₁] meets its u, and likewise v.
#[inline(always)]
fn meets<S: Lanes>(r: &Rectangle<S>, b: &RelativeBox<S>) -> S {
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

#[inline(always)]
fn prefetch_block<S: Lanes>(blocks: &[u32], granule: u32) {
    let start = granule as usize * super::wide::GRANULE;
    if let Some(words) = blocks.get(start..start + 48) {
        let words: &[u32; 48] = words.try_into().unwrap();
        S::prefetch(words);
    }
}
