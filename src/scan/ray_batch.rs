//! Rays that are gathered one by one and cast as one batch.

use glam::DVec3;

use crate::scene::Scene;
use crate::trace::{Cast, Hit, Origins, Rays};

/// A ray in the world.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ray {
    pub origin: DVec3,
    /// A direction of length 1, so that depths along the ray are metres.
    pub direction: DVec3,
    /// The time at which the ray is cast, in seconds on the clock of the scene.
    pub time_s: f64,
}

/// Rays without limits on their depth, each with what its scan knows of it. The memory is kept from batch to batch.
pub(super) struct RayBatch<T> {
    known: Vec<T>,
    origins: Vec<DVec3>,
    directions: Vec<DVec3>,
    times_s: Vec<f64>,
    /// The hit that each ray goes on behind. It is empty if no ray does.
    after: Vec<Option<Hit>>,
}

impl<T> Default for RayBatch<T> {
    fn default() -> Self {
        Self { known: vec![], origins: vec![], directions: vec![], times_s: vec![], after: vec![] }
    }
}

impl<T> RayBatch<T> {
    pub fn clear(&mut self) {
        self.known.clear();
        self.origins.clear();
        self.directions.clear();
        self.times_s.clear();
        self.after.clear();
    }

    pub fn is_empty(&self) -> bool {
        self.known.is_empty()
    }

    pub fn len(&self) -> usize {
        self.known.len()
    }

    /// Adds a ray. With `after`, its hit is the first behind that one.
    #[inline]
    pub fn push(&mut self, known: T, ray: Ray, after: Option<Hit>) {
        self.known.push(known);
        self.origins.push(ray.origin);
        self.directions.push(ray.direction);
        self.times_s.push(ray.time_s);
        if after.is_some() || !self.after.is_empty() {
            self.after.resize(self.known.len() - 1, None);
            self.after.push(after);
        }
    }

    #[inline]
    pub fn ray(&self, index: usize) -> Ray {
        Ray { origin: self.origins[index], direction: self.directions[index], time_s: self.times_s[index] }
    }

    /// What is known of each ray, in the order in which they were added.
    pub fn known(&self) -> &[T] {
        &self.known
    }

    /// What is known of each ray, to be taken from it.
    pub fn known_mut(&mut self) -> &mut [T] {
        &mut self.known
    }

    /// Finds the hit of each ray, in the order in which they were added.
    pub fn cast(&self, scene: &Scene, tracer: &impl Cast, hits: &mut Vec<Option<Hit>>) {
        hits.clear();
        hits.resize(self.len(), None);
        let origins = &self.origins;
        let common = origins.first().copied().filter(|first| origins.iter().all(|o| o == first));
        let rays = Rays {
            after: (!self.after.is_empty()).then_some(&self.after[..]),
            times_s: scene.arrangement.window.is_some().then_some(&self.times_s[..]),
            ..Rays::unlimited(common.map_or(Origins::Each(origins), Origins::Common), &self.directions)
        };
        tracer.cast(&rays, hits);
    }

    /// Sorts rays that go on behind no hit by their directions: along a curve through the cells of a map of the sphere, 2^`bits` a
    /// side. So rays that follow each other go nearly the same way, and the tracer can take them together. Those of a cell stay
    /// in their order.
    pub fn sort_by_direction(&mut self, bits: u32)
    where
        T: Copy,
    {
        let mut order: Vec<(u32, u32)> =
            (0..).zip(&self.directions).map(|(ray, direction)| (cell(*direction, bits), ray)).collect();
        order.sort_unstable();
        fn sorted<V: Copy>(values: &[V], order: &[(u32, u32)]) -> Vec<V> {
            order.iter().map(|&(_, ray)| values[ray as usize]).collect()
        }
        self.known = sorted(&self.known, &order);
        self.origins = sorted(&self.origins, &order);
        self.directions = sorted(&self.directions, &order);
        self.times_s = sorted(&self.times_s, &order);
    }
}

/// The number of a direction's cell on an octahedron that is unfolded to a square (Z. H. Cigolle et al., "A survey of efficient
/// representations for independent unit vectors", JCGT 3(2), 2014), along Morton's curve.
fn cell(direction: DVec3, bits: u32) -> u32 {
    let DVec3 { x, y, z } = direction / direction.abs().element_sum();
    let sign = |value: f64| if value < 0.0 { -1.0 } else { 1.0 };
    let [u, v] = if z >= 0.0 { [x, y] } else { [(1.0 - y.abs()) * sign(x), (1.0 - x.abs()) * sign(y)] };
    let side = f64::from(1_u32 << bits);
    let [u, v] = [u, v].map(|at| ((0.5 * at + 0.5) * side).clamp(0.0, side - 1.0) as u32);
    (0..bits).fold(0, |code, bit| code | (u >> bit & 1) << (2 * bit) | (v >> bit & 1) << (2 * bit + 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_cover_the_sphere_and_neighbours_share_them() {
        let directions: Vec<DVec3> = (0..1000)
            .map(|i| {
                let (z, (sin, cos)) =
                    (1.0 - 2.0 * (f64::from(i) + 0.5) / 1000.0, libm::sincos(f64::from(i) * 2.4));
                DVec3::new(cos, sin, 0.0) * (1.0 - z * z).sqrt() + DVec3::Z * z
            })
            .collect();
        let mut batch = RayBatch::default();
        for (number, &direction) in directions.iter().enumerate() {
            batch.push(number, Ray { origin: DVec3::ZERO, direction, time_s: 0.0 }, None);
        }
        batch.sort_by_direction(3);
        let mut cells: Vec<u32> = (0..1000).map(|i| cell(batch.ray(i).direction, 3)).collect();
        assert!(cells.is_sorted());
        cells.dedup();
        assert_eq!(cells.len(), 64);
        // Each ray keeps what is known of it.
        assert!((0..1000).all(|i| directions[batch.known()[i]] == batch.ray(i).direction));
        let mut known = batch.known().to_vec();
        known.sort_unstable();
        assert_eq!(known, (0..1000).collect::<Vec<_>>());
    }
}
