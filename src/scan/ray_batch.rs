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
}
