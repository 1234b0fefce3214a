//! T. Möller and B. Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", Journal of Graphics Tools 2(1), 1997.
//!
//! o + t·d = A + u·e1 + v·e2 is solved by Cramer's rule: with p = d×e2, s = o−A, q = s×e1 and a = e1·p,
//! u = s·p/a, v = d·q/a, t = e2·q/a. Divisions come last, after the tests on the undivided u′ = s·p and v′ = d·q:
//! 0 ≤ u′, 0 ≤ v′ and u′+v′ ≤ a for a front (a > 0), and the mirrored tests for a back (a < 0).
//!
//! This code departs from the paper's in the test for a ray in the plane. There a must exceed a fixed epsilon, which rejects
//! small triangles however they are hit (a is about the triangle's area, 10⁻⁶ and less for a target of a millimetre); here
//! only a = 0 and numbers that leave f32 are misses.

use glam::Vec3;

use super::kernel::{About, Crossing, Culling, Edges, Kernel, Ray, depth};

/// See the [module](self). It sees both sides.
#[derive(Debug)]
pub struct MollerTrumbore;

/// See the [module](self). It culls fronts: it sees triangles only from behind.
#[derive(Debug)]
pub struct MollerTrumboreFrontCulled;

/// See the [module](self). It culls backs: it sees triangles only from the front.
#[derive(Debug)]
pub struct MollerTrumboreBackCulled;

/// A corner and the edges from it.
#[derive(Clone, Copy, Debug)]
pub struct Triangle {
    a: Vec3,
    e1: Vec3,
    e2: Vec3,
}

impl Triangle {
    fn new([a, b, c]: [Vec3; 3]) -> Self {
        Self { a, e1: b - a, e2: c - a }
    }

    #[inline]
    fn intersect(&self, ray: &Ray, sees_front: bool, sees_back: bool) -> Option<Crossing> {
        let p = ray.direction.cross(self.e2);
        let a = self.e1.dot(p);
        let s = ray.origin - self.a;
        let u = s.dot(p);
        let q;
        let v;
        if a > 0.0 && sees_front {
            if !(u >= 0.0 && u <= a) {
                return None;
            }
            q = s.cross(self.e1);
            v = ray.direction.dot(q);
            if !(v >= 0.0 && u + v <= a) {
                return None;
            }
        } else if a < 0.0 && sees_back {
            if !(u <= 0.0 && u >= a) {
                return None;
            }
            q = s.cross(self.e1);
            v = ray.direction.dot(q);
            if !(v <= 0.0 && u + v >= a) {
                return None;
            }
        } else {
            return None;
        }
        Crossing::over(a, depth(self.e2.dot(q), a)?, u, v)
    }
}

const ABOUT: About = About {
    name: "moller-trumbore",
    paper: "Möller and Trumbore, JGT 2(1), 1997",
    edges: Edges::Inclusive,
    culling: Culling::None,
    common_origin: false,
};

impl Kernel for MollerTrumbore {
    const ABOUT: About = ABOUT;
    type Triangle = Triangle;
    type Ray = Ray;

    fn triangle(corners: [Vec3; 3], _origin: Vec3) -> Triangle {
        Triangle::new(corners)
    }

    fn ray(ray: Ray) -> Ray {
        ray
    }

    #[inline]
    fn intersect(triangle: &Triangle, ray: &Ray) -> Option<Crossing> {
        triangle.intersect(ray, true, true)
    }
}

impl Kernel for MollerTrumboreFrontCulled {
    const ABOUT: About = About { name: "moller-trumbore-front-culled", culling: Culling::Front, ..ABOUT };
    type Triangle = Triangle;
    type Ray = Ray;

    fn triangle(corners: [Vec3; 3], _origin: Vec3) -> Triangle {
        Triangle::new(corners)
    }

    fn ray(ray: Ray) -> Ray {
        ray
    }

    #[inline]
    fn intersect(triangle: &Triangle, ray: &Ray) -> Option<Crossing> {
        triangle.intersect(ray, false, true)
    }
}

impl Kernel for MollerTrumboreBackCulled {
    const ABOUT: About = About { name: "moller-trumbore-back-culled", culling: Culling::Back, ..ABOUT };
    type Triangle = Triangle;
    type Ray = Ray;

    fn triangle(corners: [Vec3; 3], _origin: Vec3) -> Triangle {
        Triangle::new(corners)
    }

    fn ray(ray: Ray) -> Ray {
        ray
    }

    #[inline]
    fn intersect(triangle: &Triangle, ray: &Ray) -> Option<Crossing> {
        triangle.intersect(ray, true, false)
    }
}
