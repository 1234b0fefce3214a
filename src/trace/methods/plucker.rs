//! Plücker coordinates: J. Plücker, 1865; for rays and triangles J. Amanatides and K. Choi, "Ray Tracing Triangular
//! Meshes", 1997.
//!
//! A line through p along q−p is the pair (q−p, (q−p)×p). For two lines (U, V) and (U′, V′), the sign of U·V′ + V·U′ tells on
//! which side of each other they pass. With the ray (d, d×o) and the edges BC, CA and AB, the three numbers have one sign
//! where the ray passes inside, and divided by their sum they are the weights of A, B and C. t = N·(A−o) / (N·d).
//!
//! Each edge is computed from its lesser corner to its greater (by x, then y, then z) and then directed around the triangle.
//! So the two triangles that share an edge get the same numbers for it, up to the sign, and agree on which side of it a ray
//! passes. They agree edge by edge only: at a vertex the number of each edge is rounded on its own, and all of them may say
//! "outside". The coordinates are measured from the frame's origin, not from the ray's, so that they can be kept; the error
//! grows with the product of the two distances.

use glam::Vec3;

use super::kernel::{About, Crossing, Culling, Edges, Kernel, Ray, depth, same_sign};

/// See the [module](self).
#[derive(Debug)]
pub struct Plucker;

/// A directed line.
#[derive(Clone, Copy, Debug)]
pub struct Line {
    u: Vec3,
    v: Vec3,
}

/// The lines BC, CA and AB, and the plane.
#[derive(Clone, Copy, Debug)]
pub struct Triangle {
    edges: [Line; 3],
    a: Vec3,
    n: Vec3,
}

/// A ray and its line.
#[derive(Clone, Copy, Debug)]
pub struct RayLine {
    ray: Ray,
    line: Line,
}

impl Line {
    fn through(p: Vec3, q: Vec3) -> Self {
        Self { u: q - p, v: (q - p).cross(p) }
    }

    /// The line from p to q, computed in an order that does not depend on which of the two comes first.
    fn edge(p: Vec3, q: Vec3) -> Self {
        let order = |x: &f32, y: &f32| x.total_cmp(y);
        let is_before = order(&p.x, &q.x).then(order(&p.y, &q.y)).then(order(&p.z, &q.z)).is_le();
        if is_before {
            Self::through(p, q)
        } else {
            let back = Self::through(q, p);
            Self { u: -back.u, v: -back.v }
        }
    }

    #[inline]
    fn side(&self, other: &Self) -> f32 {
        self.u.dot(other.v) + self.v.dot(other.u)
    }
}

impl Kernel for Plucker {
    const ABOUT: About = About {
        name: "plucker",
        paper: "Amanatides and Choi, Ray Tracing Triangular Meshes, 1997",
        edges: Edges::Consistent,
        culling: Culling::None,
        common_origin: false,
    };
    type Triangle = Triangle;
    type Ray = RayLine;

    fn triangle([a, b, c]: [Vec3; 3], _origin: Vec3) -> Triangle {
        let edges = [Line::edge(b, c), Line::edge(c, a), Line::edge(a, b)];
        Triangle { edges, a, n: (b - a).cross(c - a) }
    }

    fn ray(ray: Ray) -> RayLine {
        RayLine { ray, line: Line { u: ray.direction, v: ray.direction.cross(ray.origin) } }
    }

    #[inline]
    fn intersect(Triangle { edges, a, n }: &Triangle, RayLine { ray, line }: &RayLine) -> Option<Crossing> {
        let [of_a, of_b, of_c] = edges.map(|edge| line.side(&edge));
        let (u, v) = same_sign(of_a, of_b, of_c)?;
        Crossing::finite(depth(n.dot(*a - ray.origin), n.dot(ray.direction))?, u, v)
    }
}
