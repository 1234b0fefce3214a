//! Casting: what a ray hits, as geometry defines it and not as a traversal happens to find it.
//!
//! A ray passes through a triangle when three determinants say so in exact arithmetic, edges and vertices included, so a
//! closed mesh cannot leak; the hit is the least depth in the ray's limits, ties going to the lowest triangle id. The
//! whole definition is the code of [`exact`]. [`BruteForce`] applies it to every triangle; [`Tracer`] finds the same hit,
//! bit for bit, with a bounding volume hierarchy.
//!
//! Rays come in batches that share an origin: a tile of an image, the beams of a firing.

mod bounds;
mod brute;
pub mod exact;
pub mod kernel;
mod lanes;
mod packet;
mod tracer;
mod wide;

use bounds::Bounds;
use glam::DVec3;

pub use brute::BruteForce;
pub use tracer::{Instructions, Tracer};

/// Rays that leave from one point.
#[derive(Clone, Copy, Debug)]
pub struct Rays<'a> {
    /// Where they start: world coordinates, metres.
    pub origin: DVec3,
    /// Unit directions in the world.
    pub directions: &'a [DVec3],
    /// Hits nearer than this are not seen, metres; 0 or more. Inclusive.
    pub t_min: f64,
    /// Hits farther than this are not seen, metres. Inclusive; may be infinite.
    pub t_max: f64,
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Metres along the ray.
    pub t: f64,
    /// Barycentric weight of the triangle's second corner.
    pub u: f64,
    /// Barycentric weight of the triangle's third corner.
    pub v: f64,
    /// Unit normal in the world, on the side from which the corners are counter-clockwise.
    pub normal: DVec3,
    /// Index into [`Scene::placements`](crate::scene::Scene::placements).
    pub placement: u32,
    /// Index into the placement's mesh's triangles.
    pub triangle: u32,
}

/// What finds the nearest hit of rays.
pub trait Cast: Sync {
    /// Writes the nearest hit of each ray to `hits`, which is as long as `rays.directions`.
    ///
    /// # Panics
    /// If the lengths differ.
    fn cast(&self, rays: &Rays, hits: &mut [Option<Hit>]);
}
