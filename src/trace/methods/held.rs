//! M. Held, "ERIT: A Collection of Efficient and Reliable Intersection Tests", Journal of Graphics Tools 2(4), 1998.
//!
//! As in Badouel's method t = N·(A−o) / (N·d), P = o + t·d, and the axis along which |N| is largest is dropped. The test is
//! then that of a point against a triangle in a plane: times the sign of the dropped component of N, which is the orientation
//! of the projected triangle, the determinants det(B−A, P−A), det(C−B, P−B) and det(A−C, P−C) must all be ≥ 0.
//!
//! The weights, for which the paper has no use, are the determinants divided by their sum.

use glam::Vec3;

use super::kernel::{About, Axes, Crossing, Culling, Edges, Kernel, Ray, depth};

/// See the [module](self).
#[derive(Debug)]
pub struct Held;

/// The corners, their normal and the axes that are kept.
#[derive(Clone, Copy, Debug)]
pub struct Triangle {
    corners: [Vec3; 3],
    n: Vec3,
    axes: Axes,
}

impl Kernel for Held {
    const ABOUT: About = About {
        name: "held",
        paper: "Held, ERIT, JGT 2(4), 1998",
        edges: Edges::Inclusive,
        culling: Culling::None,
        common_origin: false,
    };
    type Triangle = Triangle;
    type Ray = Ray;

    fn triangle(corners: [Vec3; 3], _origin: Vec3) -> Triangle {
        let [a, b, c] = corners;
        let n = (b - a).cross(c - a);
        Triangle { corners, n, axes: Axes::around_largest(n) }
    }

    fn ray(ray: Ray) -> Ray {
        ray
    }

    #[inline]
    fn intersect(&Triangle { corners: [a, b, c], n, axes }: &Triangle, ray: &Ray) -> Option<Crossing> {
        let along = n.dot(ray.direction);
        let t = depth(n.dot(a - ray.origin), along)?;
        let p = axes.keep(ray.origin) + axes.keep(ray.direction) * t;
        let (a, b, c) = (axes.keep(a), axes.keep(b), axes.keep(c));
        let orientation = if axes.dropped(n) < 0.0 { -1.0 } else { 1.0 };
        let is_left = |product: f32| product >= 0.0; // false for NaN
        let of_c = (b - a).perp_dot(p - a) * orientation;
        if !is_left(of_c) {
            return None;
        }
        let of_a = (c - b).perp_dot(p - b) * orientation;
        if !is_left(of_a) {
            return None;
        }
        let of_b = (a - c).perp_dot(p - c) * orientation;
        if !is_left(of_b) {
            return None;
        }
        Crossing::over(of_a + of_b + of_c, t, of_b, of_c)
    }
}
