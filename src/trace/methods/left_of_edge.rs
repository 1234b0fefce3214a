//! Plane and strict left-of-edge tests: a graphics course page, "Triangle intersection".
//!
//! With n = (b−a) × (c−b) and the ray e + t·d: t = (a−e)·n / (d·n), x = e + t·d. A walk around the corners must keep x on
//! its left: (b−a)×(x−a)·n > 0, (c−b)×(x−b)·n > 0, (a−c)×(x−c)·n > 0.
//!
//! The inequalities are strict: a ray through an edge that two triangles share hits neither. This method leaks by
//! definition, not only by rounding. The page stops at the decision; the weights are the three products over n·n.

use glam::Vec3;

use super::kernel::{About, Crossing, Culling, Edges, Kernel, Ray, depth};

/// See the [module](self).
#[derive(Debug)]
pub struct LeftOfEdge;

impl Kernel for LeftOfEdge {
    const ABOUT: About = About {
        name: "left-of-edge",
        paper: "course page: Triangle intersection",
        edges: Edges::Exclusive,
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
        let along = ray.direction.dot(n);
        let t = depth((a - ray.origin).dot(n), along)?;
        let x = ray.at(t);
        let is_left = |product: f32| product > 0.0; // false for NaN
        let of_c = (b - a).cross(x - a).dot(n);
        if !is_left(of_c) {
            return None;
        }
        let of_a = (c - b).cross(x - b).dot(n);
        if !is_left(of_a) {
            return None;
        }
        let of_b = (a - c).cross(x - c).dot(n);
        if !is_left(of_b) {
            return None;
        }
        Crossing::over(n.dot(n), t, of_b, of_c)
    }
}
