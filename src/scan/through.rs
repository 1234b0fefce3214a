//! Where the beam of an ideal sensor ends that meets holes, panes and other surfaces which let light pass.
//!
//! A surface of opacity a returns the share a of the light that reaches it, and lets 1 − a through, on the way there and on the
//! way back. So behind surfaces of opacities a₁, a₂, … the next one, of opacity a, is seen with the share a·(1 − a₁)²·(1 − a₂)²·…
//! of the pulse. An ideal sensor reports one return a pulse: of the surfaces within its range the one with the largest share, and
//! of equal ones the nearest. If no surface is within its range, the one with the largest share says why.
//!
//! A hole is no surface: it blocks nothing, in the sensor's dead zone neither. Hits of one object and one material at the same depth
//! are one surface: a beam through an edge meets the triangles on both sides of it, and exporters double a card to show both its
//! faces.

use std::cmp::Ordering;

use super::ray_batch::RayBatch;
use crate::scene::{Scene, Surface};
use crate::trace::{Cast, Hit};

/// The most surfaces on a beam's way that count and are not solid. Holes are not among them. The thinnest panes of which eight bits
/// can tell take 1/255 of the light each way, so 64 of them leave 60 % of it.
const MOST_SURFACES: u32 = 64;

/// The depths, in metres and for each metre, that are the same. Depths of one point on two triangles are off by a few digits of
/// f64, 10⁻¹⁵ of their size where a beam does not graze, and nothing is made of layers so close.
const SAME_DEPTH: f64 = 1e-9;

/// Whether two depths along a ray are the same but for rounding. The first is not the larger one.
pub(super) fn is_same_depth(depth_m: f64, other_m: f64) -> bool {
    other_m - depth_m <= SAME_DEPTH * other_m.max(1.0)
}

/// A surface that a sensor sees.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    pub hit: Hit,
    /// The share of the pulse that it has, 0 to 1.
    pub share: f64,
    is_in_range: bool,
}

/// A beam on its way through surfaces that light passes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sight {
    /// The share of the light that would come back through the surfaces so far.
    left: f64,
    surfaces: u32,
    /// The depth and the surface of the last hit that took a share.
    last: Option<(f64, Surface)>,
    best: Option<Seen>,
}

impl Default for Sight {
    fn default() -> Self {
        Self { left: 1.0, surfaces: 0, last: None, best: None }
    }
}

impl Sight {
    /// Goes on to the next hit of the beam. `place` says where its range is among the limits of the sensor's. Returns whether the
    /// beam ends there, because no surface behind it can be the one that the sensor reports.
    pub fn meet(&mut self, hit: &Hit, surface: Surface, opacity: f32, place: Ordering) -> bool {
        let is_same = |(depth, last): (f64, Surface)| last == surface && is_same_depth(depth, hit.t);
        if opacity > 0.0 && !self.last.is_some_and(is_same) {
            self.last = Some((hit.t, surface));
            let opacity = f64::from(opacity).min(1.0);
            let seen = Seen { hit: *hit, share: opacity * self.left, is_in_range: place.is_eq() };
            let is_better = |best: Seen| (seen.is_in_range, seen.share) > (best.is_in_range, best.share);
            if self.best.is_none_or(is_better) {
                self.best = Some(seen);
            }
            self.left *= (1.0 - opacity) * (1.0 - opacity);
            self.surfaces += 1;
        }
        let is_settled = self.best.is_some_and(|best| best.share >= self.left && best.is_in_range);
        // Every hit behind one that is too far is too far as well.
        let no_more_in_range =
            place.is_gt() && self.best.is_some_and(|best| best.is_in_range || best.share >= self.left);
        is_settled || no_more_in_range || self.left == 0.0 || self.surfaces == MOST_SURFACES
    }

    /// The surface that the sensor reports, if there is one on the beam's way.
    pub fn seen(&self) -> Option<Seen> {
        self.best
    }
}

/// The rays of a batch that go on behind their hits.
#[derive(Default)]
pub(super) struct Through {
    /// The share of each ray's hit, if the batch was looked through.
    shares: Vec<f64>,
    /// The rays that are cast again, each with its number in the batch.
    now: RayBatch<(usize, Sight)>,
    next: RayBatch<(usize, Sight)>,
    hits: Vec<Option<Hit>>,
}

impl Through {
    /// The share of the pulse that the hit of a ray has.
    #[inline]
    pub fn share(&self, ray: usize) -> f64 {
        self.shares.get(ray).copied().unwrap_or(1.0)
    }

    /// Forgets the last batch.
    pub fn clear(&mut self) {
        self.shares.clear();
    }

    /// Replaces the first hit of each ray by the one that the sensor reports. `place` says where a hit of a ray is among the limits of
    /// the sensor's range. Only rays that met something which may let light pass are cast again.
    pub fn look<T>(
        &mut self,
        scene: &Scene,
        tracer: &impl Cast,
        batch: &RayBatch<T>,
        hits: &mut [Option<Hit>],
        place: impl Fn(usize, &Hit) -> Ordering,
    ) {
        let Self { shares, now, next, hits: behind } = self;
        shares.clear();
        shares.resize(hits.len(), 1.0);
        next.clear();
        (now.most_depth, next.most_depth) = (batch.most_depth, batch.most_depth);
        // Takes one more hit of a ray into account. Returns whether the ray goes on behind it.
        let goes_on = |ray: usize, sight: &mut Sight, hit: &Hit| {
            let opacity = scene.opacity(hit.placement, hit.triangle, hit.u, hit.v);
            let surface = scene.surface(hit.placement, hit.triangle);
            !sight.meet(hit, surface, opacity, place(ray, hit))
        };
        let mut end = |ray: usize, sight: &Sight, hits: &mut [Option<Hit>]| {
            let seen = sight.seen();
            hits[ray] = seen.map(|seen| seen.hit);
            shares[ray] = seen.map_or(1.0, |seen| seen.share);
        };
        for ray in 0..hits.len() {
            let Some(hit) = hits[ray] else { continue };
            let mut sight = Sight::default();
            match goes_on(ray, &mut sight, &hit) {
                true => next.push((ray, sight), batch.ray(ray), Some(hit)),
                false => end(ray, &sight, hits),
            }
        }
        while !next.is_empty() {
            std::mem::swap(now, next);
            next.clear();
            now.cast(scene, tracer, behind);
            for (&(ray, mut sight), hit) in now.known().iter().zip(behind.iter()) {
                match hit {
                    Some(hit) if goes_on(ray, &mut sight, hit) => {
                        next.push((ray, sight), batch.ray(ray), Some(*hit));
                    }
                    _ => end(ray, &sight, hits),
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Ordering::{Equal, Greater, Less};
    use glam::DVec3;

    fn at(t: f64) -> Hit {
        Hit { t, u: 0.0, v: 0.0, normal: DVec3::X, placement: 0, triangle: 0 }
    }

    /// The depth and the share that are reported of surfaces one behind the other, each with its opacity and place, and the number of
    /// surfaces that were looked at.
    fn reported(surfaces: &[(f32, Ordering)]) -> (Option<(f64, f64)>, usize) {
        let mut sight = Sight::default();
        let mut met = 0;
        for (number, &(opacity, place)) in surfaces.iter().enumerate() {
            met += 1;
            let surface = Surface { object: 0, material: 0 };
            if sight.meet(&at(number as f64), surface, opacity, place) {
                break;
            }
        }
        (sight.seen().map(|seen| (seen.hit.t, seen.share)), met)
    }

    #[test]
    fn the_surface_with_the_largest_share_is_reported() {
        assert_eq!(reported(&[(1.0, Equal), (1.0, Equal)]), (Some((0.0, 1.0)), 1));
        assert_eq!(reported(&[(0.25, Equal), (1.0, Equal)]), (Some((1.0, 0.5625)), 2));
        assert_eq!(reported(&[(0.5, Equal), (1.0, Equal)]), (Some((0.0, 0.5)), 1));
        assert_eq!(reported(&[(0.25, Equal), (0.5, Equal), (1.0, Equal)]), (Some((1.0, 0.28125)), 2));
        // The nearer of equal shares.
        assert_eq!(reported(&[(0.0, Equal), (1.0, Equal)]), (Some((1.0, 1.0)), 2));
        assert_eq!(reported(&[(0.0, Equal), (0.0, Equal)]), (None, 2));
        assert_eq!(reported(&[]), (None, 0));
    }

    #[test]
    fn a_sensor_reports_what_is_in_its_range() {
        assert_eq!(reported(&[(0.0, Less), (1.0, Equal)]), (Some((1.0, 1.0)), 2));
        assert_eq!(reported(&[(1.0, Less), (1.0, Equal)]), (Some((0.0, 1.0)), 1));
        assert_eq!(reported(&[(0.75, Less), (1.0, Equal)]), (Some((1.0, 0.0625)), 2));
        assert_eq!(reported(&[(0.25, Equal), (1.0, Greater)]), (Some((0.0, 0.25)), 2));
        // If nothing is, the largest share says why.
        assert_eq!(reported(&[(0.25, Less), (1.0, Greater)]), (Some((1.0, 0.5625)), 2));
        assert_eq!(reported(&[(0.75, Less), (1.0, Greater)]), (Some((0.0, 0.75)), 2));
    }

    /// A beam through an edge meets both triangles, and a card may have two faces.
    #[test]
    fn hits_at_one_depth_are_one_surface() {
        let met = |hits: &[(f64, u32)]| {
            let mut sight = Sight::default();
            for &(t, object) in hits {
                sight.meet(&at(t), Surface { object, material: 0 }, 0.25, Equal);
            }
            sight.left
        };
        let one = 0.75 * 0.75;
        assert_eq!(met(&[(3.0, 0), (3.0, 0), (3.0_f64.next_up(), 0)]), one);
        assert_eq!(met(&[(3.0, 0), (3.0, 1)]), one * one);
        assert_eq!(met(&[(3.0, 0), (3.000_001, 0)]), one * one);
    }

    #[test]
    fn holes_are_not_counted_and_surfaces_are() {
        let holes = vec![(0.0, Equal); 1000];
        assert_eq!(reported(&[&holes[..], &[(1.0, Equal)]].concat()), (Some((1000.0, 1.0)), 1001));
        let thin = vec![(1e-9, Equal); 1000];
        assert_eq!(reported(&thin).1, MOST_SURFACES as usize);
    }
}
