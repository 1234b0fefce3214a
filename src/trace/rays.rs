//! Rays, hits, and the trait of everything that finds the hits of rays.

use std::ops::Range;

use glam::DVec3;

use crate::scene::Arrangement;

/// A batch of rays that are cast in one call.
#[derive(Clone, Copy, Debug)]
pub struct Rays<'a> {
    /// The origins of the rays.
    pub origins: Origins<'a>,
    /// The directions in the world. They need not have unit length: depths and limits count in lengths of the direction, so
    /// they are metres if the length is 1. Where no component is 10⁻¹⁰⁰ or more, or one is more than 10¹⁰⁰ or no number, the ray
    /// hits nothing.
    pub directions: &'a [DVec3],
    /// The least depth of a hit, in metres, included. It is 0 or more.
    pub t_min: f64,
    /// The largest depth of a hit, in metres, included. It may be infinite.
    pub t_max: f64,
    /// For each ray a hit that its next hit must follow, or `None` for a ray without such a condition. `None` for the whole
    /// batch if no ray has one.
    ///
    /// Hits of a ray are ordered by (depth, placement, triangle), and the next hit comes strictly after the given one, so a
    /// ray that is cast again and again after its latest hit meets every triangle on its way exactly once. This is what
    /// alpha cut-outs, glass and further returns need. The limits on depth hold as well.
    pub after: Option<&'a [Option<Hit>]>,
    /// For each ray the time at which it is cast, in seconds on the clock of the scene. A mesh that moves is hit where it is at the
    /// ray's time. The rays of a scene in which something moves ([`Arrangement::window`](crate::scene::Arrangement::window)) need
    /// times, all of them in its window. Other scenes take no notice of times.
    pub times_s: Option<&'a [f64]>,
}

/// The origins of rays, in world coordinates and metres.
#[derive(Clone, Copy, Debug)]
pub enum Origins<'a> {
    /// All rays start at one point.
    Common(DVec3),
    /// Each ray starts at a point of its own. There are as many points as directions.
    Each(&'a [DVec3]),
}

impl Origins<'_> {
    /// The origin of one ray.
    #[inline(always)]
    pub(super) fn of(&self, ray: usize) -> DVec3 {
        match self {
            Origins::Common(origin) => *origin,
            Origins::Each(origins) => origins[ray],
        }
    }
}

impl<'a> Rays<'a> {
    /// Rays without limits on their depth.
    pub fn unlimited(origins: Origins<'a>, directions: &'a [DVec3]) -> Self {
        Self { origins, directions, t_min: 0.0, t_max: f64::INFINITY, after: None, times_s: None }
    }

    /// The origin of one ray.
    #[inline]
    pub fn origin(&self, ray: usize) -> DVec3 {
        self.origins.of(ray)
    }

    /// Checks that there is one direction, and if the rays differ in them one origin, one hit to come after and one time, for
    /// each of `results` results, and that each ray has a time for which an arrangement holds.
    ///
    /// # Panics
    /// If a length differs, or if something moves in the arrangement and a ray has no time in its window.
    pub(super) fn check(&self, results: usize, arrangement: &Arrangement) {
        assert_eq!(self.directions.len(), results);
        if let Origins::Each(origins) = self.origins {
            assert_eq!(origins.len(), results);
        }
        if let Some(after) = self.after {
            assert_eq!(after.len(), results);
        }
        if let Some(times_s) = self.times_s {
            assert_eq!(times_s.len(), results);
        }
        if let Some(window) = arrangement.window {
            let times_s = self.times_s.expect("something moves in the scene, so rays need times");
            let outside = times_s.iter().find(|&&time_s| !window.contains(time_s));
            assert_eq!(outside, None, "the scene is arranged for {} s to {} s", window.from_s, window.to_s);
        }
    }

    /// The time of one ray.
    pub(super) fn time_s(&self, ray: usize) -> Option<f64> {
        self.times_s.map(|times_s| times_s[ray])
    }

    /// The maximal runs of consecutive rays that share an origin: the range of rays and the origin of each run.
    pub(super) fn runs(&self) -> impl Iterator<Item = (Range<usize>, DVec3)> {
        let mut start = 0;
        std::iter::from_fn(move || {
            let end = match self.origins {
                _ if start == self.directions.len() => return None,
                Origins::Common(_) => self.directions.len(),
                Origins::Each(origins) => {
                    let same = origins[start..].iter().take_while(|&&o| o == origins[start]);
                    start + same.count().max(1) // NaN does not equal itself
                }
            };
            let run = start..end;
            start = end;
            Some((run.clone(), self.origin(run.start)))
        })
    }
}

/// A point where a ray meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// The depth along the ray, in lengths of its direction: metres if that length is 1.
    pub t: f64,
    /// The barycentric weight of the triangle's second corner.
    pub u: f64,
    /// The barycentric weight of the triangle's third corner.
    pub v: f64,
    /// The unit normal in the world, on the side from which the corners are counter-clockwise.
    pub normal: DVec3,
    /// Index into [`Arrangement::placements`](crate::scene::Arrangement::placements).
    pub placement: u32,
    /// Index into the triangles of the placement's mesh.
    pub triangle: u32,
}

/// An algorithm that finds the hits of rays.
pub trait Cast: Sync {
    /// Writes the nearest hit of each ray, within its limits and after the hit in [`Rays::after`], to `hits`, which is as
    /// long as `rays.directions`.
    ///
    /// # Panics
    /// If the lengths of the directions, the hits, the origins, [`Rays::after`] or [`Rays::times_s`] differ, or if a ray lacks the
    /// time that it needs.
    fn cast(&self, rays: &Rays, hits: &mut [Option<Hit>]);

    /// Writes whether each ray hits anything within its limits, for shadows and lines of sight. If a direction reaches from
    /// one point to another, `t_max` = 1 is the other point.
    ///
    /// # Panics
    /// As [`Cast::cast`] does.
    fn blocked(&self, rays: &Rays, blocked: &mut [bool]) {
        let mut hits = vec![None; blocked.len()];
        self.cast(rays, &mut hits);
        for (blocked, hit) in blocked.iter_mut().zip(hits) {
            *blocked = hit.is_some();
        }
    }
}
