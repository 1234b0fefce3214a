//! The traversal by one ray in f64, for rays that f32 cannot serve and as a reference for the SIMD code.

use glam::DVec3;

use super::{Bvh8, Child, Node, WIDTH};
use crate::trace::exact::LocalRay;

impl Bvh8 {
    /// Calls `visit` with the number of every leaf whose box the ray may meet at a depth in `t_min ..= t_max`, near boxes first.
    /// `visit` returns the new `t_max`. `stack` is scratch memory.
    ///
    /// The traversal is conservative: a leaf with a point on the ray within those depths, up to an error of 10⁻¹² of the distance
    /// from the origin, is always visited.
    pub fn traverse(
        &self,
        ray: &LocalRay,
        limits: (f64, f64),
        stack: &mut Vec<(Child, f64)>,
        visit: impl FnMut(u32) -> f64,
    ) {
        self.traverse_padded(ray, limits, 0.0, stack, visit);
    }

    /// [`Bvh8::traverse`] with boxes that are padded by `slack` times the largest |coordinate| of the ray's origin and of the mesh,
    /// for methods that round more.
    pub fn traverse_padded(
        &self,
        ray: &LocalRay,
        (t_min, mut t_max): (f64, f64),
        slack: f64,
        stack: &mut Vec<(Child, f64)>,
        mut visit: impl FnMut(u32) -> f64,
    ) {
        if self.nodes.is_empty() {
            return;
        }
        let slabs = Slabs::new(ray, f64::from(self.largest), t_min, slack);
        stack.clear();
        stack.push((Child::node(0), t_min));
        while let Some((child, near)) = stack.pop() {
            if near > beyond(t_max) {
                continue;
            }
            match child.get() {
                Ok(leaf) => t_max = visit(leaf),
                Err(node) => {
                    let node = &self.nodes[node as usize];
                    let first = stack.len();
                    for lane in 0..WIDTH {
                        if node.child[lane] != Child::NONE
                            && let Some(near) = slabs.enter(node, lane, t_max)
                        {
                            stack.push((node.child[lane], near));
                        }
                    }
                    stack[first..].sort_by(|a, b| b.1.total_cmp(&a.1));
                }
            }
        }
    }
}

/// A ray, prepared for testing boxes.
struct Slabs {
    /// The origin plus the slack, from which lower planes are measured, and minus the slack, for upper planes.
    from_low: DVec3,
    from_high: DVec3,
    inverse: DVec3,
    t_min: f64,
}

impl Slabs {
    fn new(ray: &LocalRay, largest: f64, t_min: f64, slack: f64) -> Self {
        // The slack covers 2⁻⁵³ of the operands in each of a few operations here. Seen from far away, it also covers the 10⁻¹²
        // of a bound by which a depth may lie outside of its triangle's box (Corners::depth): 2⁻³⁸ is 3.6 · 10⁻¹².
        let slack = (ray.origin.abs().max_element() + largest) * (slack + 1.0 / (1_u64 << 38) as f64);
        Self {
            from_low: ray.origin + slack,
            from_high: ray.origin - slack,
            inverse: ray.direction.recip(),
            t_min,
        }
    }

    /// The least depth of the ray in a child's box, or `None` if the ray surely does not meet the box up to `t_max`.
    #[inline]
    fn enter(&self, node: &Node, lane: usize, t_max: f64) -> Option<f64> {
        let (mut near, mut far) = (self.t_min, beyond(t_max));
        for axis in 0..3 {
            let t0 = (f64::from(node.planes[axis][lane]) - self.from_low[axis]) * self.inverse[axis];
            let t1 = (f64::from(node.planes[axis][WIDTH + lane]) - self.from_high[axis]) * self.inverse[axis];
            // If the direction is 0 along an axis, both depths are infinite, with different signs if the origin lies between
            // the planes. 0·∞ is NaN, which min and max ignore.
            near = near.max(t0.min(t1));
            far = far.min(t0.max(t1));
        }
        (near <= far).then_some(near)
    }
}

/// The depth `t` plus a few ulps, so that a box at the same depth as the best hit is still visited: its triangle may have the
/// lower id.
#[inline]
fn beyond(t: f64) -> f64 {
    t + t.abs() * (1.0 / (1_u64 << 48) as f64)
}
