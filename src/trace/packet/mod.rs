//! Packets: up to 128 rays from one point, or nearly so, that traverse the hierarchy together.
//!
//! # The pyramid
//! All rays of a packet leave from a point o, so they lie in a pyramid. Let w be the axis along which they mostly go, reversed if
//! they go down it. A ray is g = (g_u, g_v, 1) = d / d_w, a point on the plane w = 1, and the packet is a rectangle on that
//! plane. A ray of the rectangle meets a box (relative to o) only if, for some w in the box and in front of the origin, the
//! interval w·[u₀, u₁] meets the box's interval of u, and w·[v₀, v₁] its interval of v. Lower bounds are kept negated, so that
//! both halves of an interval test are the same operation: b₀ ≤ max(r₁·w) and b₁ ≥ min(r₀·w) become one comparison of
//! (−b₀, b₁) with min((−r₁, r₀)·w).
//!
//! # Origins that differ a little
//! A turning sensor on a moving body fires each column from a place of its own. The rays of such a packet still start near one
//! point o, which is chosen such that no ray starts before it along w. The line of a ray crosses the plane w = 0 through o at
//! s = (s_u, s_v, 0), so it is s + w·g. All boxes grow by the bounds of s, which are computed once a packet. The module
//! [`triangles`] tells how the tests of triangles change.
//!
//! [`prepare`] makes a packet of rays, [`traverse`] takes it through the nodes of a hierarchy, and [`leaf`] tests it against
//! the [`triangles`] of leaves.

mod leaf;
mod prepare;
#[cfg(test)]
mod tests;
mod traverse;
mod triangles;

use super::policy::{PACKET_LEAF, PACKET_LEAF_MET, PACKET_NODE};
use super::simd::{F32x8, SimdTask};
pub(super) use prepare::{Elsewhere, RayData, RayPacket, may_be_packet};
pub(super) use traverse::PacketStack;

impl<const MULTI_ORIGIN: bool> RayPacket<'_, MULTI_ORIGIN> {
    /// Finds the nearest hits in a mesh, and returns the work that it took. Gives up, and returns `None`, when the work
    /// passes `budget`.
    #[inline(always)]
    pub fn traverse_mesh<S: F32x8>(&mut self, stack: &mut PacketStack, budget: u64) -> Option<u64> {
        if self.bvh.is_small() {
            S::run(SmallMesh { packet: self, stack, budget })
        } else {
            self.traverse::<S, false>(stack, budget)
        }
    }

    /// [`RayPacket::traverse_mesh`] with the code for small meshes, or with that for large ones.
    #[inline(always)]
    fn traverse<S: F32x8, const IN_SMALL_MESH: bool>(
        &mut self,
        stack: &mut PacketStack,
        budget: u64,
    ) -> Option<u64> {
        let (visited, before) = (stack.visited, self.rays.stats());
        let mut leaves = 0;
        self.push_root::<S>(stack);
        loop {
            self.visit_nodes::<S>(stack);
            let at_leaves = self.rays.stats() - before;
            let work = PACKET_NODE * (stack.visited - visited)
                + PACKET_LEAF * leaves
                + PACKET_LEAF_MET * at_leaves.leaves
                + at_leaves.tests;
            if work > budget {
                return None;
            }
            if stack.leaf_count == 0 {
                return Some(work);
            }
            leaves += stack.leaf_count as u64;
            for k in 0..stack.leaf_count {
                let entry = stack.leaves[k];
                if entry.near <= self.farthest {
                    self.test_leaf::<S, IN_SMALL_MESH>(&self.leaf(&entry));
                }
            }
            stack.leaf_count = 0;
        }
    }
}

/// [`RayPacket::traverse_mesh`] of a small mesh as a task. Most triangles of a small mesh are met by many rays, and are tested one by one
/// ([`leaf`]). As a part of the code for large meshes it would take registers that are needed there, and cost up to 7 % of the rays a second.
struct SmallMesh<'p, 'a, const MULTI_ORIGIN: bool> {
    packet: &'p mut RayPacket<'a, MULTI_ORIGIN>,
    stack: &'p mut PacketStack,
    budget: u64,
}

impl<const MULTI_ORIGIN: bool> SimdTask for SmallMesh<'_, '_, MULTI_ORIGIN> {
    type Output = Option<u64>;

    #[inline(always)]
    fn run<S: F32x8>(self) -> Option<u64> {
        self.packet.traverse::<S, true>(self.stack, self.budget)
    }
}
