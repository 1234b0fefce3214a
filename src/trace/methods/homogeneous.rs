//! Homogeneous plane and perpendicular vectors: K. Perlin, graphics course notes, "Finding the intersection of a ray with
//! a triangle" (New York University).
//!
//! With N = (B−A) × (C−B), H = [N, −N·A] and the ray V + t·W: t = −H·[V, 1] / H·[W, 0], P = V + t·W. For each corner the
//! vector in the plane that is perpendicular to the edge opposite, pA = N×(C−B), pB = N×(A−C), pC = N×(B−A), gives its
//! weight: u = (P−B)·pA / (A−B)·pA, v = (P−C)·pB / (B−C)·pB, w = (P−A)·pC / (C−A)·pC. P is inside when none is negative.
//!
//! This code departs from the notes in pB, which they first print as N×(A−B): that vector is perpendicular to the wrong edge,
//! and the weight of B is then not 0 along CA. (Their own summary prints it right.) The three denominators are all N·N.

use glam::Vec3;

use super::kernel::{About, Crossing, Culling, Edges, Kernel, Ray, depth};

/// See the [module](self).
#[derive(Debug)]
pub struct Homogeneous;

impl Kernel for Homogeneous {
    const ABOUT: About = About {
        name: "homogeneous",
        paper: "Perlin, course notes: rays and triangles, New York University",
        edges: Edges::Inclusive,
        culling: Culling::None,
        common_origin: false,
    };
    type Triangle = [Vec3; 3];
    type Ray = Ray;

    fn triangle(corners: [Vec3; 3], _origin: Vec3) -> [Vec3; 3] {
        corners
    }

    fn ray(ray: Ray) -> Ray {
        ray
    }

    #[inline]
    fn intersect(&[a, b, c]: &[Vec3; 3], ray: &Ray) -> Option<Crossing> {
        let n = (b - a).cross(c - b);
        let h = n.extend(-n.dot(a));
        let along = h.dot(ray.direction.extend(0.0));
        let t = depth(-h.dot(ray.origin.extend(1.0)), along)?;
        let p = ray.at(t);
        let (pa, pb, pc) = (n.cross(c - b), n.cross(a - c), n.cross(b - a));
        let whole = (a - b).dot(pa);
        let u = (p - b).dot(pa) / whole;
        let v = (p - c).dot(pb) / (b - c).dot(pb);
        let w = (p - a).dot(pc) / (c - a).dot(pc);
        if !(whole.is_normal() && u >= 0.0 && v >= 0.0 && w >= 0.0) {
            return None;
        }
        Crossing::finite(t, v, w)
    }
}
