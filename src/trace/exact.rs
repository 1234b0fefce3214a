//! The definition of a hit. Everything else in this room only avoids calling it.
//!
//! All of it is in f64, multiplications and additions only (never fused), in one fixed order, so that every machine gives
//! the same bits. The decision is exact: a filter with a proven error bound answers nearly always, and the adaptive
//! predicate of Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric Predicates" (1997), the
//! rest.

use glam::{DAffine3, DVec3};

use super::Hit;
use crate::scene::{Mesh, Placement};

/// A ray in the space of a mesh. The direction need not be of unit length: depths are counted in its lengths.
#[derive(Clone, Copy, Debug)]
pub struct LocalRay {
    /// Where it starts.
    pub origin: DVec3,
    /// Where it goes.
    pub direction: DVec3,
}

impl LocalRay {
    /// Carries a ray of the scene's space into a placement's. Depths keep their meaning.
    pub fn carried(self, placement: &Placement) -> Self {
        let map = &placement.mesh_from_scene;
        if *map == DAffine3::IDENTITY {
            return self;
        }
        let [x, y, z] = [map.matrix3.x_axis, map.matrix3.y_axis, map.matrix3.z_axis];
        let linear = |v: DVec3| (x * v.x + y * v.y) + z * v.z;
        Self { origin: linear(self.origin) + map.translation, direction: linear(self.direction) }
    }
}

/// A triangle's corners relative to a ray's origin, each rounded once. All triangles that share a vertex get the same
/// numbers for it, whatever else they are made of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Corners {
    /// First corner.
    pub a: DVec3,
    /// Second corner.
    pub b: DVec3,
    /// Third corner.
    pub c: DVec3,
}

impl Corners {
    /// The corners of triangle `triangle` of `mesh`, seen from `origin`.
    #[inline]
    pub fn of(mesh: &Mesh, triangle: u32, origin: DVec3) -> Self {
        Self::from_positions(mesh.triangles[triangle as usize].map(|v| mesh.positions[v as usize]), origin)
    }

    /// The same from the corners' positions.
    #[inline]
    pub fn from_positions(positions: [[f32; 3]; 3], origin: DVec3) -> Self {
        let [a, b, c] =
            positions.map(|[x, y, z]| DVec3::new(f64::from(x), f64::from(y), f64::from(z)) - origin);
        Self { a, b, c }
    }

    /// Whether the line along `d` through the origin passes through the triangle, its edges and vertices included: the
    /// signs of det(d, b, c), det(d, c, a), det(d, a, b) are all ≥ 0 or all ≤ 0 and not all zero (a line in the triangle's
    /// plane misses it). Exact. False if a number is not finite.
    #[inline]
    pub fn passes(&self, d: DVec3) -> bool {
        let Self { a, b, c } = *self;
        let largest = a.abs().max(b.abs()).max(c.abs()).max_element();
        // The error of a determinant d·(p × q) computed in f64, u = 2⁻⁵³, m the largest |coordinate|: a component of the
        // cross product is off by at most (2u + u²)(|p_i q_j| + |p_j q_i|) ≤ (4u + 2u²) m²; the dot product adds at most
        // 3u(1 + u)² of Σ|d_k|·2m²(1+u)². With Σ|d_k| ≤ 3 |d|∞ that is ≤ 3·(4 + 6)·u·m²|d|∞ = 30u·m²|d|∞ plus terms in
        // u²; 64u has room for these and for the rounding of the bound itself.
        const U: f64 = f64::EPSILON / 2.0;
        let bound = 64.0 * U * (largest * largest) * d.abs().max_element();
        let sign = |p: DVec3, q: DVec3| -> i8 {
            let determinant = dot(d, cross(p, q));
            if determinant > bound {
                1
            } else if determinant < -bound {
                -1
            } else if determinant.is_nan() {
                // Overflow or a broken ray: no side at all.
                2
            } else {
                exact_sign(d, p, q)
            }
        };
        let first = sign(b, c);
        let second = sign(c, a);
        if first * second < 0 {
            return false; // most triangles that are looked at are left by here
        }
        let third = sign(a, b);
        let signs = [first, second, third];
        !signs.contains(&2)
            && (signs.iter().all(|&s| s >= 0) || signs.iter().all(|&s| s <= 0))
            && signs.iter().any(|&s| s != 0)
    }

    /// The depth at which the ray along `d` meets the triangle's plane, kept within the triangle's own box.
    ///
    /// t = (a·N)/(d·N) with N = (b−a) × (c−a). Of a triangle seen edge-on this is rounding noise, and could lie outside the
    /// triangle, where no tracer that prunes by boxes would look. So if a coordinate of t·d is outside the triangle's
    /// bounds by more than 10⁻¹² of the bound, t is clamped to the depths at which the ray is inside those bounds, which
    /// hold the true t. (Elsewhere t is good to a few ulps, and 10⁻¹² leaves it alone.)
    ///
    /// Only meaningful when [`Corners::passes`].
    #[inline]
    pub fn depth(&self, d: DVec3) -> f64 {
        let n = self.normal();
        let t = dot(self.a, n) / dot(d, n);
        let low = self.a.min(self.b).min(self.c);
        let high = self.a.max(self.b).max(self.c);
        let p = d * t;
        let slack = |bound: DVec3| bound.abs() * 1e-12;
        if p.cmpge(low - slack(low)).all() && p.cmple(high + slack(high)).all() {
            return t + 0.0; // no negative zero
        }
        let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
        for axis in 0..3 {
            if d[axis] != 0.0 {
                let (t0, t1) = (low[axis] / d[axis], high[axis] / d[axis]);
                enter = enter.max(t0.min(t1));
                leave = leave.min(t0.max(t1));
            }
        }
        // A NaN takes the near end, and so does an interval that rounding turned inside out.
        let t = if t > leave { leave } else { t };
        (if t >= enter { t } else { enter }) + 0.0
    }

    /// (b−a) × (c−a): twice the area long, towards the side from which a, b, c are counter-clockwise.
    #[inline]
    pub fn normal(&self) -> DVec3 {
        cross(self.b - self.a, self.c - self.a)
    }

    /// Barycentric weights (u, v) of the second and third corner where the line along `d` passes: the determinants that
    /// decide whether it does, over their sum (Segura and Feito).
    #[inline]
    pub fn weights(&self, d: DVec3) -> (f64, f64) {
        let Self { a, b, c } = *self;
        let (ea, eb, ec) = (dot(d, cross(b, c)), dot(d, cross(c, a)), dot(d, cross(a, b)));
        let sum = (ea + eb) + ec;
        let weight = |e: f64| {
            let w = e / sum;
            if w.is_nan() { 1.0 / 3.0 } else { w.clamp(0.0, 1.0) }
        };
        (weight(eb), weight(ec))
    }
}

/// A triangle that a ray meets, before the rest of the [`Hit`] is worked out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Depth.
    pub t: f64,
    /// Index of the placement.
    pub placement: u32,
    /// Index of the triangle in the placement's mesh.
    pub triangle: u32,
}

impl Candidate {
    /// Whether this hit is the one to keep of the two: the nearer, or at the same depth the one with the lower triangle id.
    /// (Ids count placement by placement, so the pair compares as the id does.)
    #[inline]
    pub fn beats(&self, other: &Self) -> bool {
        self.t < other.t
            || (self.t == other.t && (self.placement, self.triangle) < (other.placement, other.triangle))
    }

    /// The whole hit, given the triangle's corners and the ray's direction in the placement's space.
    #[inline]
    pub fn finish(&self, corners: &Corners, direction: DVec3, placement: &Placement) -> Hit {
        let (u, v) = corners.weights(direction);
        let map = &placement.mesh_from_scene;
        let mut normal = corners.normal();
        if *map != DAffine3::IDENTITY {
            // Normals go with the inverse's transpose, and a mirroring map turns the winding over.
            let m = &map.matrix3;
            normal = DVec3::new(dot(m.x_axis, normal), dot(m.y_axis, normal), dot(m.z_axis, normal));
            if dot(m.x_axis, cross(m.y_axis, m.z_axis)) < 0.0 {
                normal = -normal;
            }
        }
        // Scaled first, so that the square of its length neither overflows nor vanishes.
        let normal = normal / normal.abs().max_element();
        let normal = normal / dot(normal, normal).sqrt();
        Hit { t: self.t, u, v, normal, placement: self.placement, triangle: self.triangle }
    }
}

/// x·y, left to right.
#[inline]
fn dot(x: DVec3, y: DVec3) -> f64 {
    (x.x * y.x + x.y * y.y) + x.z * y.z
}

#[inline]
fn cross(p: DVec3, q: DVec3) -> DVec3 {
    DVec3::new(p.y * q.z - p.z * q.y, p.z * q.x - p.x * q.z, p.x * q.y - p.y * q.x)
}

/// The sign of det(d, p, q), exactly.
#[cold]
fn exact_sign(d: DVec3, p: DVec3, q: DVec3) -> i8 {
    let point = |v: DVec3| robust::Coord3D { x: v.x, y: v.y, z: v.z };
    let determinant = robust::orient3d(point(d), point(p), point(q), point(DVec3::ZERO));
    i8::from(determinant > 0.0) - i8::from(determinant < 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn corners(a: [f64; 3], b: [f64; 3], c: [f64; 3]) -> Corners {
        Corners { a: a.into(), b: b.into(), c: c.into() }
    }

    /// In the plane x = 2, facing the origin.
    fn facing() -> Corners {
        corners([2.0, -1.0, -1.0], [2.0, 0.0, 1.0], [2.0, 1.0, -1.0])
    }

    #[test]
    fn passes_inside_on_edges_and_on_vertices_from_both_sides() {
        let t = facing();
        let back = Corners { a: t.b, b: t.a, c: t.c };
        let inside = [DVec3::X, DVec3::new(2.0, 0.1, -0.3)];
        let edge = [DVec3::new(2.0, 0.0, -1.0), DVec3::new(2.0, 0.5, 0.0), DVec3::new(4.0, -1.0, 0.0)];
        let outside = [DVec3::Y, DVec3::new(2.0, 0.51, 0.0), DVec3::new(2.0, 0.0, -1.0 - 1e-15)];
        for triangle in [t, back] {
            for d in inside.iter().chain(&edge).chain(&[t.a, t.b, t.c]) {
                assert!(triangle.passes(*d), "{d}");
                assert!(triangle.passes(-*d), "a line has no direction: {d}");
                assert!((triangle.depth(*d) * d.x - 2.0).abs() < 1e-15);
            }
            for d in outside {
                assert!(!triangle.passes(d), "{d}");
            }
        }
    }

    #[test]
    fn the_sign_of_the_predicate_is_that_of_the_determinant() {
        assert_eq!(exact_sign(DVec3::X, DVec3::Y, DVec3::Z), 1);
        assert_eq!(exact_sign(DVec3::Y, DVec3::X, DVec3::Z), -1);
        // A determinant of exactly one unit in 2¹⁰⁶: far below what f64 sees.
        let tiny = f64::EPSILON;
        let (p, q) = (DVec3::new(0.0, 1.0 + tiny, 1.0), DVec3::new(0.0, 1.0, 1.0 - tiny));
        assert_eq!(p.y * q.z - p.z * q.y, 0.0, "f64 sees nothing");
        assert_eq!(exact_sign(DVec3::X, p, q), -1);
    }

    #[test]
    fn a_line_in_the_plane_misses() {
        let floor = corners([1.0, -1.0, 0.0], [3.0, 0.0, 0.0], [1.0, 1.0, 0.0]);
        assert!(!floor.passes(DVec3::X));
        assert!(!floor.passes(DVec3::new(1.0, 0.1, 0.0)));
    }

    #[test]
    fn not_a_number_is_a_miss() {
        assert!(!facing().passes(DVec3::splat(f64::NAN)));
        assert!(!facing().passes(DVec3::new(f64::INFINITY, 0.0, 0.0)));
        assert!(!corners([f64::NAN; 3], [2.0, 0.0, 1.0], [2.0, 1.0, 0.0]).passes(DVec3::X));
        assert!(!facing().passes(DVec3::ZERO));
    }

    #[test]
    fn an_edge_on_depth_stays_in_the_box() {
        // A sliver seen edge-on: the plane's depth is noise, anywhere from −∞ to ∞; the true one lies in the box.
        let h = 1e-14;
        let sliver = corners([1.0, -h, -1.0], [2.0, h, 1.0], [1.5, 0.3 * h, 1.0]);
        for weights in [[0.2, 0.3, 0.5], [0.5, 0.25, 0.25], [0.1, 0.1, 0.8]] {
            let [wa, wb, wc] = weights;
            let d = (sliver.a * wa + sliver.b * wb + sliver.c * wc).normalize();
            assert!(sliver.passes(d));
            let t = sliver.depth(d);
            assert!((1.0 - 1e-12..=2.0 + 1e-12).contains(&(t * d.x)), "{t}");
        }
        // The plane holds the ray up to rounding: N·d underflows to nothing, and the near end of the box is taken.
        let edge_on = corners([1.0, 1e-300, -1.0], [1.0, -1e-300, 1.0], [3.0, 0.0, 0.0]);
        let t = edge_on.depth(DVec3::X);
        assert!((1.0..=3.0).contains(&t), "{t}");
    }

    #[test]
    fn weights_are_barycentric() {
        let t = facing();
        let at = |wa: f64, wb: f64, wc: f64| t.a * wa + t.b * wb + t.c * wc;
        let (u, v) = t.weights(at(0.2, 0.3, 0.5));
        assert!((u - 0.3).abs() < 1e-15 && (v - 0.5).abs() < 1e-15);
        assert_eq!(t.weights(t.b), (1.0, 0.0));
    }
}
