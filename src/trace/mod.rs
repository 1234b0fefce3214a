//! Casting: what a ray hits, as geometry defines it and not as a traversal happens to find it.
//!
//! A ray passes through a triangle when three determinants say so in exact arithmetic, edges and vertices included, so a
//! closed mesh cannot leak; the hit is the least depth in the ray's limits, ties going to the lowest triangle id. The
//! whole definition is the code of [`exact`]. [`BruteForce`] applies it to every triangle; [`Tracer`] finds the same hit,
//! bit for bit, with a bounding volume hierarchy.
//!
//! Rays come in batches of neighbours: a tile of an image, the beams of a firing. They are fast where they share an origin.

mod any;
mod bounds;
mod brute;
mod bvh;
pub mod exact;
mod hit_attributes;
pub mod methods;
mod packet;
mod simd;
mod single;
mod stats;
mod stream;
mod tracer;

use bounds::Bounds;
use glam::DVec3;

pub use any::AnyTracer;
pub use brute::BruteForce;
pub use stats::TraversalStats;
pub use tracer::{Instructions, Tracer};

/// Rays to cast together.
#[derive(Clone, Copy, Debug)]
pub struct Rays<'a> {
    /// Where they start.
    pub origins: Origins<'a>,
    /// Directions in the world, of any length: depths and limits count in that length, so in metres if it is 1.
    pub directions: &'a [DVec3],
    /// Hits nearer than this are not seen, metres; 0 or more. Inclusive.
    pub t_min: f64,
    /// Hits farther than this are not seen, metres. Inclusive; may be infinite.
    pub t_max: f64,
}

/// Where rays start: world coordinates, metres.
#[derive(Clone, Copy, Debug)]
pub enum Origins<'a> {
    /// All at one point.
    Common(DVec3),
    /// Each at a point of its own: as many as there are directions.
    Each(&'a [DVec3]),
}

impl Rays<'_> {
    /// Where ray number `ray` starts.
    #[inline]
    pub fn origin(&self, ray: usize) -> DVec3 {
        match self.origins {
            Origins::Common(origin) => origin,
            Origins::Each(origins) => origins[ray],
        }
    }

    /// # Panics
    /// If there are not as many directions, and origins, as results.
    fn check(&self, results: usize) {
        assert_eq!(self.directions.len(), results);
        if let Origins::Each(origins) = self.origins {
            assert_eq!(origins.len(), results);
        }
    }

    /// The rays in runs of neighbours that start at the same point: the run's place, and the point.
    fn runs(&self) -> impl Iterator<Item = (std::ops::Range<usize>, DVec3)> {
        let mut start = 0;
        std::iter::from_fn(move || {
            let end = match self.origins {
                _ if start == self.directions.len() => return None,
                Origins::Common(_) => self.directions.len(),
                Origins::Each(origins) => {
                    let same = origins[start..].iter().take_while(|&&o| o == origins[start]);
                    start + same.count().max(1) // NaN is not even itself
                }
            };
            let run = start..end;
            start = end;
            Some((run.clone(), self.origin(run.start)))
        })
    }
}

/// Where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Along the ray, in lengths of its direction: metres if that is 1.
    pub t: f64,
    /// Barycentric weight of the triangle's second corner.
    pub u: f64,
    /// Barycentric weight of the triangle's third corner.
    pub v: f64,
    /// Unit normal in the world, on the side from which the corners are counter-clockwise.
    pub normal: DVec3,
    /// Index into [`Arrangement::placements`](crate::scene::Arrangement::placements).
    pub placement: u32,
    /// Index into the placement's mesh's triangles.
    pub triangle: u32,
}

/// What finds the nearest hit of rays.
pub trait Cast: Sync {
    /// Writes the nearest hit of each ray to `hits`, which is as long as `rays.directions`.
    ///
    /// # Panics
    /// If the lengths differ, those of each ray's origin included.
    fn cast(&self, rays: &Rays, hits: &mut [Option<Hit>]);

    /// Writes whether each ray hits anything within the limits: for shadows and lines of sight. With directions that reach
    /// from one point to another, `t_max` of 1 is the other point.
    ///
    /// # Panics
    /// As [`Cast::cast`].
    fn blocked(&self, rays: &Rays, blocked: &mut [bool]) {
        let mut hits = vec![None; blocked.len()];
        self.cast(rays, &mut hits);
        for (blocked, hit) in blocked.iter_mut().zip(hits) {
            *blocked = hit.is_some();
        }
    }
}
