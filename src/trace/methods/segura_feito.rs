//! R. J. Segura and F. R. Feito, "An Algorithm for Determining Intersection Segment-Polygon in 3D", Computers & Graphics
//! 22(5), 1998, and "Algorithms to Test Ray-Triangle Intersection. Comparative Study", WSCG 2001.
//!
//! The method compares signed volumes. With a, b, c the corners relative to a point of the ray and d towards another point of
//! it, E_A = d·(b×c), E_B = d·(c×a), E_C = d·(a×b). The line passes inside when all three have one sign, which also tells
//! front from back. Divided by their sum they are the weights of A, B and C, though a widely copied tutorial says that this
//! method has none. The same tutorial prints d·(a×c) among its three signs, which is −E_B, so that its test fails for rays
//! that pass inside; and it refuses zeros where the theorem allows them. Here zeros are inside.
//!
//! There are three forms:
//! - **segment** intersects the plane first, t = N·(A−o) / (N·d), P = o + t·d, and then takes the volumes from P − d towards
//!   P + d. Corners are then near, which keeps the volumes accurate however far the sensor is. But the segment is as long as
//!   the direction, and it misses triangles that are a million times larger or smaller than that.
//! - **ray** takes the volumes from the ray's origin, with two cross products and three dot products: E_C = b·(d×a),
//!   E_B = −c·(d×a), E_A = c·(d×b).
//! - **precomputed** keeps b×c, c×a and a×b, which depend on the origin only, for all rays that leave from one point; one dot
//!   product for each edge remains. A cross product with its factors exchanged is the same to the bit but for the sign, so both
//!   triangles at an edge agree on which side of it a ray passes. They agree edge by edge only: at a vertex the volume of
//!   each edge is rounded on its own, and all of them may say "outside".

use glam::Vec3;

use super::kernel::{About, Crossing, Culling, Edges, Kernel, Ray, depth, same_sign};

/// See the [module](self).
#[derive(Debug)]
pub struct SeguraFeitoSegment;

/// See the [module](self).
#[derive(Debug)]
pub struct SeguraFeito;

/// See the [module](self).
#[derive(Debug)]
pub struct SeguraFeitoPrecomputed;

/// The numbers that serve all rays from one origin.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    bc: Vec3,
    ca: Vec3,
    ab: Vec3,
    n: Vec3,
    /// The height n·a of the plane.
    height: f32,
}

const ABOUT: About = About {
    name: "segura-feito",
    paper: "Segura and Feito, WSCG 2001",
    edges: Edges::Inclusive,
    culling: Culling::None,
    common_origin: false,
};

impl Kernel for SeguraFeitoSegment {
    const ABOUT: About = About { name: "segura-feito-segment", ..ABOUT };
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
        let n = (b - a).cross(c - a);
        let along = n.dot(ray.direction);
        let t = depth(n.dot(a - ray.origin), along)?;
        let p = ray.at(t);
        let (start, end) = (p - ray.direction, p + ray.direction);
        let (a, b, c, d) = (a - start, b - start, c - start, end - start);
        let (da, db) = (d.cross(a), d.cross(b));
        let (u, v) = same_sign(c.dot(db), -c.dot(da), b.dot(da))?;
        Crossing::finite(t, u, v)
    }
}

impl Kernel for SeguraFeito {
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
    fn intersect(&[a, b, c]: &[Vec3; 3], ray: &Ray) -> Option<Crossing> {
        let d = ray.direction;
        let (from_a, from_b, from_c) = (a - ray.origin, b - ray.origin, c - ray.origin);
        let (da, db) = (d.cross(from_a), d.cross(from_b));
        let (u, v) = same_sign(from_c.dot(db), -from_c.dot(da), from_b.dot(da))?;
        let n = (b - a).cross(c - a);
        Crossing::finite(depth(n.dot(from_a), n.dot(d))?, u, v)
    }
}

impl Kernel for SeguraFeitoPrecomputed {
    const ABOUT: About =
        About { name: "segura-feito-precomputed", edges: Edges::Consistent, common_origin: true, ..ABOUT };
    type Triangle = Seen;
    type Ray = Ray;

    fn triangle([a, b, c]: [Vec3; 3], origin: Vec3) -> Seen {
        let n = (b - a).cross(c - a);
        let (a, b, c) = (a - origin, b - origin, c - origin);
        Seen { bc: b.cross(c), ca: c.cross(a), ab: a.cross(b), n, height: n.dot(a) }
    }

    fn ray(ray: Ray) -> Ray {
        ray
    }

    #[inline]
    fn intersect(seen: &Seen, ray: &Ray) -> Option<Crossing> {
        let d = ray.direction;
        let (u, v) = same_sign(d.dot(seen.bc), d.dot(seen.ca), d.dot(seen.ab))?;
        Crossing::finite(depth(seen.height, seen.n.dot(d))?, u, v)
    }
}
