//! How a packet walks the hierarchy: from node to node, each with the bundles of rays that may meet it.

use super::{BUNDLES, PACKET_RAYS, RayPacket};
use crate::trace::bvh::{Child, Node, WIDTH};
use crate::trace::simd::{F32x8, F32x16, Mask8};

/// A box relative to the origin, w turned over as the packet's is.
#[derive(Clone, Copy)]
pub(super) struct RelativeBox {
    /// The lower side turned over, and the upper side.
    pub u: [f32; 2],
    pub v: [f32; 2],
    pub w: [f32; 2],
}

/// A leaf that rays may meet.
pub(in crate::trace) struct Leaf {
    /// A block's offset, or a placement.
    pub number: u32,
    pub(super) bounds: RelativeBox,
    pub(super) bundles: u32,
}

/// Something to visit: a child of a node.
#[derive(Clone, Copy, Default)]
struct Visit {
    /// Where its box begins along w.
    near: f32,
    /// The node whose child it is, and which: `node · 8 + lane`.
    place: u32,
    child: Child,
    /// The bundles that may meet its box, a bit each.
    bundles: u32,
}

/// What is to be visited. Nodes and leaves wait apart: which of them comes next could not be predicted.
pub(in crate::trace) struct Stack {
    /// The next on top.
    nodes: Vec<Visit>,
    node_count: usize,
    /// Those of the node visited last, in no order.
    leaves: [Visit; WIDTH],
    leaf_count: usize,
    /// Nodes visited so far.
    pub visited: u64,
}

impl Default for Stack {
    fn default() -> Self {
        let none = Visit::default();
        Self { nodes: vec![none; 256], node_count: 0, leaves: [none; WIDTH], leaf_count: 0, visited: 0 }
    }
}

impl Stack {
    #[cold]
    #[inline(never)]
    fn lengthen(&mut self) {
        self.nodes.resize(self.nodes.len() * 2, Visit::default());
    }
}

impl<const MULTI_ORIGIN: bool> RayPacket<'_, MULTI_ORIGIN> {
    /// Finds the nearest hits in the mesh.
    #[inline(always)]
    pub fn walk_mesh<S: F32x8>(&mut self, stack: &mut Stack) {
        self.enter_root::<S>(stack);
        loop {
            self.visit_nodes::<S>(stack);
            if stack.leaf_count == 0 {
                return;
            }
            for k in 0..stack.leaf_count {
                let visit = stack.leaves[k];
                if visit.near <= self.farthest {
                    self.test_leaf::<S>(&self.leaf(&visit));
                }
            }
            stack.leaf_count = 0;
        }
    }

    /// Puts what the rays may meet at the top of the hierarchy on the stack.
    #[inline(always)]
    pub fn enter_root<S: F32x8>(&self, stack: &mut Stack) {
        (stack.node_count, stack.leaf_count) = (0, 0);
        if !self.bvh.nodes.is_empty() {
            let bundles = (1 << self.directions.len().div_ceil(PACKET_RAYS / BUNDLES)) - 1;
            stack.nodes[0] = Visit { near: 0.0, place: 0, child: Child::node(0), bundles };
            stack.node_count = 1;
        }
    }

    /// The next leaf that rays may meet, of those found so far the nearest.
    #[inline(always)]
    pub fn next_leaf<S: F32x8>(&self, stack: &mut Stack) -> Option<Leaf> {
        loop {
            self.visit_nodes::<S>(stack);
            let waiting = &stack.leaves[..stack.leaf_count];
            let next = (0..waiting.len()).min_by(|&a, &b| waiting[a].near.total_cmp(&waiting[b].near))?;
            let visit = waiting[next];
            stack.leaf_count -= 1;
            stack.leaves[next] = stack.leaves[stack.leaf_count];
            if visit.near <= self.farthest {
                return Some(self.leaf(&visit));
            }
        }
    }

    #[inline(always)]
    fn leaf(&self, visit: &Visit) -> Leaf {
        let (node, lane) = (visit.place as usize / WIDTH, visit.place as usize % WIDTH);
        let bounds = self.child_box(&self.bvh.nodes[node], lane);
        Leaf { number: visit.child.number(), bounds, bundles: visit.bundles }
    }

    /// Visits nodes until leaves wait or there are no more nodes.
    #[inline(always)]
    fn visit_nodes<S: F32x8>(&self, stack: &mut Stack) {
        while stack.leaf_count == 0 && stack.node_count > 0 {
            stack.node_count -= 1;
            let Visit { near, child, bundles, .. } = stack.nodes[stack.node_count];
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
        RelativeBox { u: sides(0), v: sides(1), w: if self.turned { [w[1], w[0]] } else { w } }
    }

    /// Puts the children that the rays of `bundles` may meet on the stack, the nearest on top.
    #[inline(always)]
    fn visit_children<S: F32x8>(&self, index: u32, bundles: u32, stack: &mut Stack) {
        let node = &self.bvh.nodes[index as usize];
        stack.visited += 1;
        let [ru, rv] = self.rectangle_of::<S>(bundles);
        let (w_lower, w_upper) = self.sides::<S>(node, 2).halves();
        let (before, end) = if self.turned { (w_upper, w_lower) } else { (w_lower, w_upper) };
        // Not before the origin.
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
            stack.lengthen();
        }
        let nodes: &mut [Visit; WIDTH] =
            (&mut stack.nodes[stack.node_count..stack.node_count + WIDTH]).try_into().unwrap();
        let mut count = 0;
        while met != 0 {
            let lane = met.trailing_zeros() as usize & (WIDTH - 1);
            met &= met - 1;
            // The bundles that may meet this child.
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
            let visit =
                Visit { near: nears[lane], place: index * WIDTH as u32 + lane as u32, child, bundles };
            // Written where a leaf goes, which counts if it is one.
            stack.leaves[stack.leaf_count & (WIDTH - 1)] = visit;
            stack.leaf_count += usize::from(child.is_leaf());
            // Insertion of nodes, farthest first: there are one or two of them.
            let mut at = count & (WIDTH - 1);
            count += usize::from(!child.is_leaf());
            let place = at;
            while at > 0 && nodes[at - 1].near < visit.near && place < count {
                nodes[at] = nodes[at - 1];
                at -= 1;
            }
            nodes[at] = visit;
        }
        stack.node_count += count;
    }

    /// The planes of all children's boxes along u, v or w (not turned over), relative to the origin: the lower ones turned
    /// over, then the upper ones.
    #[inline(always)]
    fn sides<S: F32x8>(&self, node: &Node, k: usize) -> S::F32x16 {
        let [lower, upper] = self.from[k];
        let from = S::F32x16::from_halves(S::splat(lower), S::splat(upper));
        let over = S::F32x16::from_halves(S::splat(-1.0), S::splat(1.0));
        S::F32x16::load(&node.planes[self.axes[k]]).mul_add(over, from)
    }

    /// The rectangle around those of `bundles`, for eight boxes at a time.
    #[inline(always)]
    fn rectangle_of<S: F32x8>(&self, bundles: u32) -> [S::F32x16; 2] {
        let mask = S::Mask8::from_bits(bundles);
        let none = S::splat(f32::INFINITY);
        let [u, v] = &self.rectangle;
        let (u_turned, u_upright) = S::F32x16::load(u).halves();
        let (v_turned, v_upright) = S::F32x16::load(v).halves();
        let sides = S::reduce_min_4([
            S::select(mask, u_turned, none),
            S::select(mask, u_upright, none),
            S::select(mask, v_turned, none),
            S::select(mask, v_upright, none),
        ]);
        [
            S::F32x16::from_halves(S::splat(sides[0]), S::splat(sides[1])),
            S::F32x16::from_halves(S::splat(sides[2]), S::splat(sides[3])),
        ]
    }
}
