//! A bounding volume hierarchy whose traversal never loses a hit.

use glam::{DVec3, Vec3A};
use obvhs::BvhBuildParams;
use obvhs::aabb::Aabb;

use super::exact::LocalRay;

/// A binary hierarchy over numbered boxes, built by obvhs (PLOC with a little reinsertion).
///
/// Its boxes are those given, scaled by a power of two so that the largest |coordinate| is between ½ and 1 (obvhs measures
/// areas in f32, which scenes of nanometres or gigametres would leave), rounded to f32, and padded by [`PAD`].
#[derive(Debug, Default)]
pub(super) struct Bvh {
    nodes: Vec<Node>,
    /// Leaves' items.
    items: Vec<u32>,
    /// What coordinates were multiplied by.
    scale: f64,
}

#[derive(Debug)]
struct Node {
    low: [f32; 3],
    high: [f32; 3],
    /// A leaf's first item, or an inner node's first child; the other child follows.
    first: u32,
    /// Items of a leaf; 0 for an inner node.
    count: u32,
}

/// Bounds in f64.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bounds {
    pub low: DVec3,
    pub high: DVec3,
}

impl Bounds {
    pub const EMPTY: Self = Self { low: DVec3::INFINITY, high: DVec3::NEG_INFINITY };

    pub fn with(self, p: DVec3) -> Self {
        Self { low: self.low.min(p), high: self.high.max(p) }
    }

    pub fn union(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }

    pub fn largest(&self) -> f64 {
        self.low.abs().max(self.high.abs()).max_element()
    }
}

/// How much boxes grow on each side, with the largest |coordinate| as 1. Rounding a bound to f32 costs 2⁻²⁵ at most, and
/// the rest is left for what the caller's own arithmetic loses.
const PAD: f64 = 1.0 / (1 << 21) as f64;

impl Bvh {
    /// Builds over `count` items with these bounds, which must not be empty or infinite.
    pub fn build(count: u32, bounds: impl Fn(u32) -> Bounds) -> Self {
        if count == 0 {
            return Self::default();
        }
        let largest = (0..count).map(|i| bounds(i).largest()).fold(0.0, f64::max);
        let scale = reciprocal_power_of_two(largest);
        let boxes: Vec<Aabb> = (0..count)
            .map(|i| {
                let Bounds { low, high } = bounds(i);
                let to_f32 = |p: DVec3| Vec3A::new(p.x as f32, p.y as f32, p.z as f32);
                Aabb { min: to_f32(low * scale - PAD), max: to_f32(high * scale + PAD) }
            })
            .collect();
        let params = BvhBuildParams { max_prims_per_leaf: 4, ..BvhBuildParams::fast_build() };
        let mut build_time = std::time::Duration::ZERO;
        let built = obvhs::bvh2::builder::build_bvh2(&boxes, params, &mut build_time);
        let nodes = built.nodes.iter().map(|node| {
            let aabb = node.aabb();
            Node {
                low: aabb.min.into(),
                high: aabb.max.into(),
                first: node.first_index,
                count: if node.is_leaf() { node.prim_count } else { 0 },
            }
        });
        Self { nodes: nodes.collect(), items: built.primitive_indices, scale }
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.nodes.len() * size_of::<Node>() + self.items.len() * size_of::<u32>()
    }

    /// Calls `visit` for every item whose box the ray may meet at a depth in `t_min ..= t_max`, near boxes first. `visit`
    /// takes the item and gives the new `t_max`.
    ///
    /// Conservative: an item with a point on the ray within those depths, up to an error of 10⁻¹² of the distance from the
    /// origin, is always visited. `stack` is room to work in.
    pub fn visit(
        &self,
        ray: &LocalRay,
        (t_min, mut t_max): (f64, f64),
        stack: &mut Vec<(u32, f64)>,
        mut visit: impl FnMut(u32) -> f64,
    ) {
        if self.nodes.is_empty() {
            return;
        }
        let slabs = Slabs::new(ray, self.scale, t_min);
        stack.clear();
        stack.extend(slabs.enter(&self.nodes[0], t_max).map(|t| (0, t)));
        while let Some((index, near)) = stack.pop() {
            if near > slabs.beyond(t_max) {
                continue;
            }
            let node = &self.nodes[index as usize];
            if node.count > 0 {
                for &item in &self.items[node.first as usize..(node.first + node.count) as usize] {
                    t_max = visit(item);
                }
                continue;
            }
            let children = [node.first, node.first + 1];
            let [left, right] = children.map(|c| slabs.enter(&self.nodes[c as usize], t_max).map(|t| (c, t)));
            match (left, right) {
                (Some(l), Some(r)) if l.1 <= r.1 => stack.extend([r, l]),
                (Some(l), Some(r)) => stack.extend([l, r]),
                (one, other) => stack.extend(one.or(other)),
            }
        }
    }
}

/// A ray, prepared for testing boxes.
struct Slabs {
    /// Origin plus and minus the slack, scaled: what a box's low and high planes are measured from.
    from_low: DVec3,
    from_high: DVec3,
    inverse: DVec3,
    t_min: f64,
}

impl Slabs {
    fn new(ray: &LocalRay, scale: f64, t_min: f64) -> Self {
        let origin = ray.origin * scale;
        // Covers 2⁻⁵³ of the operands lost in each of a few operations here and, seen from far away, the 10⁻¹² of a bound
        // that a depth may stand outside of its triangle's box (Corners::depth): 2⁻³⁸ is 3.6 · 10⁻¹².
        let slack = (origin.abs().max_element() + 1.0) / (1_u64 << 38) as f64;
        Self {
            from_low: origin + slack,
            from_high: origin - slack,
            inverse: (ray.direction * scale).recip(),
            t_min,
        }
    }

    /// The least depth of the ray in the box, if there may be one up to `t_max`.
    #[inline]
    fn enter(&self, node: &Node, t_max: f64) -> Option<f64> {
        let (mut near, mut far) = (self.t_min, self.beyond(t_max));
        for axis in 0..3 {
            let t0 = (f64::from(node.low[axis]) - self.from_low[axis]) * self.inverse[axis];
            let t1 = (f64::from(node.high[axis]) - self.from_high[axis]) * self.inverse[axis];
            // For a direction of 0 both are infinite, of different signs where the origin lies between the planes; 0·∞ is
            // NaN, which min and max pass over.
            near = near.max(t0.min(t1));
            far = far.min(t0.max(t1));
        }
        (near <= far).then_some(near)
    }

    /// `t` with a few ulps of room, so that a box at the same depth as the best hit is still opened: its triangle may have
    /// the lower id.
    #[inline]
    fn beyond(&self, t: f64) -> f64 {
        t + t.abs() * (1.0 / (1_u64 << 48) as f64)
    }
}

/// The power of two that brings `x` to between ½ and 1; 1 for 0.
fn reciprocal_power_of_two(x: f64) -> f64 {
    let (_, exponent) = libm::frexp(x);
    if x == 0.0 { 1.0 } else { libm::ldexp(1.0, -exponent) }
}
