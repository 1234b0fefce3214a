//! Rays that are gathered one by one and cast as one batch.

use glam::DVec3;

use crate::scene::Scene;
use crate::trace::{Cast, Hit, Origins, Rays};

/// A ray in the world.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ray {
    pub origin: DVec3,
    /// Its length is 1 unless depths are to count in other lengths than metres.
    pub direction: DVec3,
    /// The time at which the ray is cast, in seconds on the clock of the scene.
    pub time_s: f64,
}

/// Rays, each with what its scan knows of it. The memory is kept from batch to batch.
pub(super) struct RayBatch<T> {
    known: Vec<T>,
    /// The origin of all rays, unless they have `origins` of their own.
    origin: DVec3,
    origins: Vec<DVec3>,
    directions: Vec<DVec3>,
    times_s: Vec<f64>,
    /// The hit that each ray goes on behind. It is empty if no ray does.
    after: Vec<Option<Hit>>,
    /// The largest depth of a hit, in lengths of its ray's direction.
    pub most_depth: f64,
    sorting: Sorting<T>,
}

/// The memory in which a batch is sorted.
struct Sorting<T> {
    cells: Vec<u32>,
    order: Vec<u32>,
    known: Vec<T>,
    vectors: Vec<DVec3>,
    times_s: Vec<f64>,
}

impl<T> Default for RayBatch<T> {
    fn default() -> Self {
        Self::limited_to(f64::INFINITY)
    }
}

impl<T> RayBatch<T> {
    /// A batch without rays, whose hits have at most this depth in lengths of their rays' directions.
    pub fn limited_to(most_depth: f64) -> Self {
        Self {
            known: vec![],
            origin: DVec3::ZERO,
            origins: vec![],
            directions: vec![],
            times_s: vec![],
            after: vec![],
            most_depth,
            sorting: Sorting {
                cells: vec![],
                order: vec![],
                known: vec![],
                vectors: vec![],
                times_s: vec![],
            },
        }
    }

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
        if self.origins.is_empty() && (ray.origin == self.origin || self.known.is_empty()) {
            self.origin = ray.origin;
        } else {
            self.origins.resize(self.known.len(), self.origin);
            self.origins.push(ray.origin);
        }
        self.known.push(known);
        self.directions.push(ray.direction);
        self.times_s.push(ray.time_s);
        if after.is_some() || !self.after.is_empty() {
            self.after.resize(self.known.len() - 1, None);
            self.after.push(after);
        }
    }

    #[inline]
    pub fn ray(&self, index: usize) -> Ray {
        let origin = self.origins.get(index).copied().unwrap_or(self.origin);
        Ray { origin, direction: self.directions[index], time_s: self.times_s[index] }
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
        let origins = match &self.origins[..] {
            [] => Origins::Common(self.origin),
            each => Origins::Each(each),
        };
        let rays = Rays {
            after: (!self.after.is_empty()).then_some(&self.after[..]),
            times_s: scene.arrangement.window.is_some().then_some(&self.times_s[..]),
            t_max: self.most_depth,
            ..Rays::unlimited(origins, &self.directions)
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
        let Sorting { cells, order, known, vectors, times_s } = &mut self.sorting;
        cells.clear();
        cells.extend(self.directions.iter().map(|&direction| cell(direction, bits)));
        // The place of the next ray of each cell.
        let mut places = vec![0; (1 << (2 * bits)) + 1];
        cells.iter().for_each(|&cell| places[cell as usize + 1] += 1);
        for cell in 1..places.len() {
            places[cell] += places[cell - 1];
        }
        order.clear();
        order.resize(cells.len(), 0);
        for (ray, &cell) in (0..).zip(&*cells) {
            let place = &mut places[cell as usize];
            order[*place] = ray;
            *place += 1;
        }
        put_in_order(&mut self.known, order, known);
        if !self.origins.is_empty() {
            put_in_order(&mut self.origins, order, vectors);
        }
        put_in_order(&mut self.directions, order, vectors);
        put_in_order(&mut self.times_s, order, times_s);
    }
}

/// Puts first the value whose number is first in `order`, and so on. `spare` is memory.
fn put_in_order<V: Copy>(values: &mut Vec<V>, order: &[u32], spare: &mut Vec<V>) {
    spare.clear();
    spare.extend(order.iter().map(|&number| values[number as usize]));
    std::mem::swap(values, spare);
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
    fn each_ray_keeps_its_origin() {
        let places = [DVec3::X, DVec3::X, DVec3::Y, DVec3::X, DVec3::NAN];
        for count in 1..=places.len() {
            let mut batch = RayBatch::default();
            for turn in 0..2 {
                batch.clear();
                for origin in &places[..count] {
                    batch.push((), Ray { origin: *origin, direction: DVec3::Z, time_s: 0.0 }, None);
                }
                let origins = (0..count).map(|ray| batch.ray(ray).origin.to_array().map(f64::to_bits));
                assert!(
                    origins.eq(places[..count].iter().map(|place| place.to_array().map(f64::to_bits))),
                    "{turn}"
                );
                assert_eq!(batch.origins.len(), if count > 2 { count } else { 0 }, "{turn}");
            }
        }
    }

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
