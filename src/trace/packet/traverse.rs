//! The traversal of a hierarchy by a packet, node by node, each with the bundles of rays that may meet it.

use super::prepare::{BUNDLES, RayPacket};
use crate::trace::batch::PACKET_RAYS;
use crate::trace::bvh::{Child, Node, WIDTH};
use crate::trace::simd::{F32Lanes, F32x8, F32x16, Mask8};

/// A box relative to the packet's origin o, w reversed as the packet's is.
#[derive(Clone, Copy)]
pub(super) struct RelativeBox {
    /// The negated lower side and the upper side, along each axis.
    pub u: [f32; 2],
    pub v: [f32; 2],
    pub w: [f32; 2],
}

impl RelativeBox {
    /// The largest |coordinate| of the box. It is M of all that lies in the box, which is padded.
    #[inline(always)]
    pub fn largest_coordinate(&self) -> f32 {
        let side = |side: [f32; 2]| larger(side[0].abs(), side[1].abs());
        larger(larger(side(self.u), side(self.v)), side(self.w))
    }
}

/// The larger of two numbers, or the second if one is NaN. (f32::max returns the other one, which takes three instructions.)
#[inline(always)]
pub(super) fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// A leaf that rays may meet.
pub(in crate::trace) struct Leaf {
    /// The offset of a block, or a placement.
    pub number: u32,
    pub(super) bounds: RelativeBox,
    pub(super) bundles: u32,
}

/// An entry of the traversal stack: a child of a node.
#[derive(Clone, Copy, Default)]
pub(super) struct StackEntry {
    /// Where the child's box begins along w.
    pub near: f32,
    /// The node whose child it is, and the lane of the child in it: `node · 8 + lane`.
    place: u32,
    child: Child,
    /// The bundles that may meet the child's box, one bit each.
    bundles: u32,
}

/// The traversal stack of a packet. Nodes and leaves wait in separate places, because a branch on which of them comes next
/// would be unpredictable.
pub(in crate::trace) struct PacketStack {
    /// The nodes to visit, the next one on top.
    nodes: Vec<StackEntry>,
    node_count: usize,
    /// The leaves of the node that was visited last, in no order.
    pub(super) leaves: [StackEntry; WIDTH],
    pub(super) leaf_count: usize,
    /// The number of nodes that were visited so far.
    pub visited: u64,
}

impl Default for PacketStack {
    fn default() -> Self {
        let none = StackEntry::default();
        Self { nodes: vec![none; 256], node_count: 0, leaves: [none; WIDTH], leaf_count: 0, visited: 0 }
    }
}

impl PacketStack {
    #[cold]
    #[inline(never)]
    fn grow(&mut self) {
        self.nodes.resize(self.nodes.len() * 2, StackEntry::default());
    }
}

impl<const MULTI_ORIGIN: bool> RayPacket<'_, MULTI_ORIGIN> {
    /// Pushes the root of the hierarchy onto an empty stack.
    #[inline(always)]
    pub fn push_root<S: F32x8>(&self, stack: &mut PacketStack) {
        (stack.node_count, stack.leaf_count) = (0, 0);
        if !self.bvh.nodes.is_empty() {
            let bundles = (1 << self.directions.len().div_ceil(PACKET_RAYS / BUNDLES)) - 1;
            stack.nodes[0] = StackEntry { near: 0.0, place: 0, child: Child::node(0), bundles };
            stack.node_count = 1;
        }
    }

    /// The next leaf that rays may meet: the nearest of those that were found so far.
    #[inline(always)]
    pub fn next_leaf<S: F32x8>(&self, stack: &mut PacketStack) -> Option<Leaf> {
        loop {
            self.visit_nodes::<S>(stack);
            let waiting = &stack.leaves[..stack.leaf_count];
            let next = (0..waiting.len()).min_by(|&a, &b| waiting[a].near.total_cmp(&waiting[b].near))?;
            let entry = waiting[next];
            stack.leaf_count -= 1;
            stack.leaves[next] = stack.leaves[stack.leaf_count];
            if entry.near <= self.farthest {
                return Some(self.leaf(&entry));
            }
        }
    }

    #[inline(always)]
    pub(super) fn leaf(&self, entry: &StackEntry) -> Leaf {
        let (node, lane) = (entry.place as usize / WIDTH, entry.place as usize % WIDTH);
        let bounds = self.child_box(&self.bvh.nodes[node], lane);
        Leaf { number: entry.child.number(), bounds, bundles: entry.bundles }
    }

    /// Visits nodes until leaves wait or there are no more nodes.
    #[inline(always)]
    pub(super) fn visit_nodes<S: F32x8>(&self, stack: &mut PacketStack) {
        while stack.leaf_count == 0 && stack.node_count > 0 {
            stack.node_count -= 1;
            let StackEntry { near, child, bundles, .. } = stack.nodes[stack.node_count];
            if near <= self.farthest {
                self.visit_children::<S>(child.number(), bundles, stack);
            }
        }
    }

    /// The box of one child.
    #[inline(always)]
    fn child_box(&self, node: &Node, lane: usize) -> RelativeBox {
        let sides = |k: usize| {
            let planes = &node.planes[self.axes[k]];
            [self.from[k][0] - planes[lane], self.from[k][1] + planes[WIDTH + lane]]
        };
        let w = sides(2);
        RelativeBox { u: sides(0), v: sides(1), w: if self.reversed { [w[1], w[0]] } else { w } }
    }

    /// Tests the children of a node against the rays of `bundles`, and pushes the children that these may meet, the nearest
    /// node on top.
    #[inline(always)]
    fn visit_children<S: F32x8>(&self, index: u32, bundles: u32, stack: &mut PacketStack) {
        let node = &self.bvh.nodes[index as usize];
        stack.visited += 1;
        let [ru, rv] = self.rectangle_of::<S>(bundles);
        let (w_lower, w_upper) = self.sides::<S>(node, 2).halves();
        let (before, end) = if self.reversed { (w_upper, w_lower) } else { (w_lower, w_upper) };
        // Boxes count from the origin on.
        let near = before.neg().max(S::splat(0.0));
        let (begins, ends) = (S::F32x16::from_halves(near, near), S::F32x16::from_halves(end, end));
        let (u, v) = (self.sides::<S>(node, 0), self.sides::<S>(node, 1));
        let least = [ru.mul(begins).min(ru.mul(ends)), rv.mul(begins).min(rv.mul(ends))];
        let in_reach = S::splat(self.farthest).ge(near).and(end.ge(S::splat(0.0)));
        let mut met = S::F32x16::all_ge([u, v], least).and(in_reach).bits();
        if met == 0 {
            return;
        }
        let (mut us, mut vs, mut nears, mut ends) = ([0.0; 16], [0.0; 16], [0.0; 8], [0.0; 8]);
        u.store(&mut us);
        v.store(&mut vs);
        near.store(&mut nears);
        end.store(&mut ends);
        let rectangle = [S::F32x16::load(&self.rectangle[0]), S::F32x16::load(&self.rectangle[1])];
        let far = S::load(&self.far);
        if stack.node_count + WIDTH > stack.nodes.len() {
            stack.grow();
        }
        let nodes: &mut [StackEntry; WIDTH] =
            (&mut stack.nodes[stack.node_count..stack.node_count + WIDTH]).try_into().unwrap();
        let mut count = 0;
        while met != 0 {
            let lane = met.trailing_zeros() as usize & (WIDTH - 1);
            met &= met - 1;
            // Test the rectangles of all bundles against this child.
            let (near, end) = (S::F32x16::splat(nears[lane]), S::F32x16::splat(ends[lane]));
            let u = S::F32x16::from_halves(S::splat(us[lane]), S::splat(us[WIDTH + lane]));
            let v = S::F32x16::from_halves(S::splat(vs[lane]), S::splat(vs[WIDTH + lane]));
            let [ru, rv] = rectangle;
            let least = [ru.mul(near).min(ru.mul(end)), rv.mul(near).min(rv.mul(end))];
            let met = S::F32x16::all_ge([u, v], least).and(far.ge(S::splat(nears[lane])));
            let bundles = met.bits() & bundles;
            if bundles == 0 {
                continue;
            }
            let child = node.child[lane];
            self.bvh.prefetch::<S>(child);
            let entry =
                StackEntry { near: nears[lane], place: index * WIDTH as u32 + lane as u32, child, bundles };
            // Branch-free push: always write, and advance the count only for leaves.
            stack.leaves[stack.leaf_count & (WIDTH - 1)] = entry;
            stack.leaf_count += usize::from(child.is_leaf());
            // Insert nodes in order, the farthest first. There are one or two of them in most cases.
            let mut at = count & (WIDTH - 1);
            count += usize::from(!child.is_leaf());
            let place = at;
            while at > 0 && nodes[at - 1].near < entry.near && place < count {
                nodes[at] = nodes[at - 1];
                at -= 1;
            }
            nodes[at] = entry;
        }
        stack.node_count += count;
    }

    /// The planes of the boxes of all children along u, v or w (not reversed), relative to o: the negated lower planes, then the
    /// upper planes.
    #[inline(always)]
    fn sides<S: F32x8>(&self, node: &Node, k: usize) -> S::F32x16 {
        let [lower, upper] = self.from[k];
        let from = S::F32x16::from_halves(S::splat(lower), S::splat(upper));
        let signs = S::F32x16::from_halves(S::splat(-1.0), S::splat(1.0));
        S::F32x16::load(&node.planes[self.axes[k]]).mul_add(signs, from)
    }

    /// The rectangle around the rays of `bundles`, broadcast for eight boxes: along u and v the negated upper side, then the
    /// lower side.
    #[inline(always)]
    fn rectangle_of<S: F32x8>(&self, bundles: u32) -> [S::F32x16; 2] {
        let mask = S::Mask8::from_bits(bundles);
        let none = S::splat(f32::INFINITY);
        let [u, v] = &self.rectangle;
        let (u_upper, u_lower) = S::F32x16::load(u).halves();
        let (v_upper, v_lower) = S::F32x16::load(v).halves();
        let sides = S::reduce_min_4([
            S::select(mask, u_upper, none),
            S::select(mask, u_lower, none),
            S::select(mask, v_upper, none),
            S::select(mask, v_lower, none),
        ]);
        [
            S::F32x16::from_halves(S::splat(sides[0]), S::splat(sides[1])),
            S::F32x16::from_halves(S::splat(sides[2]), S::splat(sides[3])),
        ]
    }
}
