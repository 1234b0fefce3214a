//! Plane, edge cross products, area ratios: B. Curless, "Ray-triangle intersection" (course handout, University of
//! Washington, 2006).
//!
//! With n = (B−A) × (C−A) and the ray P + t·d: t = (n·A − n·P) / (n·d) and Q = P + t·d. Q is inside when
//! [(B−A)×(Q−A)]·n, [(C−B)×(Q−B)]·n and [(A−C)×(Q−C)]·n are all ≥ 0. The same three numbers divided by n·n are the weights γ,
//! α and β.
//!
//! This code departs from the handout in that n is not normalised, which the handout allows. n·A − n·P is kept as printed. It
//! costs accuracy in proportion to the distance from the frame's origin, which n·(A−P) would not.

use glam::Vec3;

use super::kernel::{About, Crossing, Culling, Edges, Kernel, Ray, depth};

/// See the [module](self).
#[derive(Debug)]
pub struct Curless;

/// The corners and their plane n·x = d.
#[derive(Clone, Copy, Debug)]
pub struct Triangle {
    corners: [Vec3; 3],
    n: Vec3,
    d: f32,
}

impl Kernel for Curless {
    const ABOUT: About = About {
        name: "curless",
        paper: "Curless, Ray-triangle intersection, 2006",
        edges: Edges::Inclusive,
        culling: Culling::None,
        common_origin: false,
    };
    type Triangle = Triangle;
    type Ray = Ray;

    fn triangle(corners: [Vec3; 3], _origin: Vec3) -> Triangle {
        let [a, b, c] = corners;
        let n = (b - a).cross(c - a);
        Triangle { corners, n, d: n.dot(a) }
    }

    fn ray(ray: Ray) -> Ray {
        ray
    }

    #[inline]
    fn intersect(&Triangle { corners: [a, b, c], n, d }: &Triangle, ray: &Ray) -> Option<Crossing> {
        let along = n.dot(ray.direction);
        let t = depth(d - n.dot(ray.origin), along)?;
        let q = ray.at(t);
        let gamma = (b - a).cross(q - a).dot(n);
        let alpha = (c - b).cross(q - b).dot(n);
        let beta = (a - c).cross(q - c).dot(n);
        if !(gamma >= 0.0 && alpha >= 0.0 && beta >= 0.0) {
            return None;
        }
        Crossing::over(n.dot(n), t, beta, gamma)
    }
}
