//! D. Sunday, "Intersections of Rays and Triangles" (3D), with F. S. Hill's perp-dot product taken to a plane in space.
//!
//! With e1 = B−A, e2 = C−A, N = e1×e2: t = N·(A−o) / (N·d), w = o + t·d − A, and with p1 = e1·e2, p2 = e1·e1, p3 = e2·e2,
//! p4 = 1 / (p1² − p2·p3): u = (p1(w·e2) − p3(w·e1))·p4, v = (p1(w·e1) − p2(w·e2))·p4. The point is inside when u ≥ 0, v ≥ 0
//! and u+v ≤ 1.
//!
//! A widely copied tutorial prints u and v with w·e1 and w·e2, and p2 and p3, mixed up; prints p4 as 1/p1² − p2·p3, and an
//! intermediate denominator e2·(N×e2) that is always zero; and says that a triangle without area does no harm, although
//! p1² = p2·p3 there.
//!
//! There are two forms, which agree to the bit. The base form computes everything at every test. The precomputed form keeps 16
//! numbers for each triangle, and two dot products remain for u and v.

use glam::Vec3;

use super::kernel::{About, Crossing, Culling, Edges, Kernel, Ray, depth};

/// See the [module](self). This form keeps the corners.
#[derive(Debug)]
pub struct Sunday;

/// See the [module](self). This form keeps every number that does not depend on the ray.
#[derive(Debug)]
pub struct SundayPrecomputed;

/// The numbers that do not depend on the ray.
#[derive(Clone, Copy, Debug)]
pub struct Terms {
    a: Vec3,
    e1: Vec3,
    e2: Vec3,
    n: Vec3,
    p1: f32,
    p2: f32,
    p3: f32,
    p4: f32,
}

impl Terms {
    #[inline]
    fn new([a, b, c]: [Vec3; 3]) -> Self {
        let (e1, e2) = (b - a, c - a);
        let (p1, p2, p3) = (e1.dot(e2), e1.dot(e1), e2.dot(e2));
        let divisor = p1 * p1 - p2 * p3;
        // A triangle without an area, as far as f32 can tell, has no inside: NaN fails every test.
        let p4 = if divisor.is_normal() { 1.0 / divisor } else { f32::NAN };
        Self { a, e1, e2, n: e1.cross(e2), p1, p2, p3, p4 }
    }

    #[inline]
    fn intersect(&self, ray: &Ray) -> Option<Crossing> {
        let along = self.n.dot(ray.direction);
        let t = depth(self.n.dot(self.a - ray.origin), along)?;
        let w = ray.at(t) - self.a;
        let (we1, we2) = (w.dot(self.e1), w.dot(self.e2));
        let u = (self.p1 * we2 - self.p3 * we1) * self.p4;
        if u < 0.0 {
            return None;
        }
        let v = (self.p1 * we1 - self.p2 * we2) * self.p4;
        if !(v >= 0.0 && u + v <= 1.0) {
            return None;
        }
        Crossing::finite(t, u, v)
    }
}

const ABOUT: About = About {
    name: "sunday",
    paper: "Sunday, Intersections of Rays and Triangles, 2001",
    edges: Edges::Inclusive,
    culling: Culling::None,
    common_origin: false,
};

impl Kernel for Sunday {
    const ABOUT: About = ABOUT;
    type Triangle = [Vec3; 3];
    type Ray = Ray;

    fn triangle(corners: [Vec3; 3], _origin: Vec3) -> [Vec3; 3] {
        corners
    }

    fn ray(ray: Ray) -> Ray {
        ray
    }

    #[inline]
    fn intersect(corners: &[Vec3; 3], ray: &Ray) -> Option<Crossing> {
        Terms::new(*corners).intersect(ray)
    }
}

impl Kernel for SundayPrecomputed {
    const ABOUT: About = About { name: "sunday-precomputed", ..ABOUT };
    type Triangle = Terms;
    type Ray = Ray;

    fn triangle(corners: [Vec3; 3], _origin: Vec3) -> Terms {
        Terms::new(corners)
    }

    fn ray(ray: Ray) -> Ray {
        ray
    }

    #[inline]
    fn intersect(terms: &Terms, ray: &Ray) -> Option<Crossing> {
        terms.intersect(ray)
    }
}
