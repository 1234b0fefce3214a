//! D. Badouel, "An Efficient Ray-Polygon Intersection", Graphics Gems, 1990.
//!
//! First t = N·(A−o) / (N·d) and P = o + t·d. Then the axis along which |N| is largest is dropped, and with (a0, b0) = P−A,
//! (a1, b1) = B−A and (a2, b2) = C−A on the two axes that are kept, a0 = u·a1 + v·a2 and b0 = u·b1 + v·b2 are solved for u
//! and v. P is inside when u ≥ 0, v ≥ 0 and u+v ≤ 1.
//!
//! This code departs from the book in that it solves by Cramer's rule, without the book's case distinction on a1 = 0: the
//! determinant is ± the largest component of N, which is not zero. A widely copied rendering of the book's code takes the
//! cross product of two corners for the normal, chooses the axis by signed components, and mixes the two kept axes in one
//! difference.

use glam::Vec3;

use super::kernel::{About, Axes, Crossing, Culling, Edges, Kernel, Ray, depth};

/// See the [module](self).
#[derive(Debug)]
pub struct Badouel;

/// The corners, their normal and the axes that are kept.
#[derive(Clone, Copy, Debug)]
pub struct Triangle {
    corners: [Vec3; 3],
    n: Vec3,
    axes: Axes,
}

impl Kernel for Badouel {
    const ABOUT: About = About {
        name: "badouel",
        paper: "Badouel, Graphics Gems, 1990",
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
        let (origin, direction) = (axes.keep(ray.origin), axes.keep(ray.direction));
        let a = axes.keep(a);
        let (p, e1, e2) = (origin + direction * t - a, axes.keep(b) - a, axes.keep(c) - a);
        let determinant = e1.perp_dot(e2);
        let u = p.perp_dot(e2) / determinant;
        if u < 0.0 {
            return None;
        }
        let v = e1.perp_dot(p) / determinant;
        if !(determinant.is_normal() && v >= 0.0 && u + v <= 1.0) {
            return None;
        }
        Crossing::finite(t, u, v)
    }
}
