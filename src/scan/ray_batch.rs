//! Rays that are gathered one by one and cast as one batch.

use std::hint::select_unpredictable;

use glam::DVec3;

use crate::scene::Scene;
use crate::trace::{Cast, Hit, Origins, Rays};

/// The rays of a large batch that are best cast together, after [`RayBatch::take`]: they stay in the cache with their hits until these are
/// used.
pub(super) const TOGETHER: usize = 2048;

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
        // All of them are written, so what they were before does not matter.
        hits.resize(self.len(), None);
        tracer.cast(&self.rays(scene), hits);
    }

    /// Finds whether each ray hits anything, in the order in which they were added.
    pub fn find_blocked(&self, scene: &Scene, tracer: &impl Cast, blocked: &mut Vec<bool>) {
        blocked.resize(self.len(), false);
        tracer.blocked(&self.rays(scene), blocked);
    }

    fn rays(&self, scene: &Scene) -> Rays<'_> {
        let origins = match &self.origins[..] {
            [] => Origins::Common(self.origin),
            each => Origins::Each(each),
        };
        Rays {
            after: (!self.after.is_empty()).then_some(&self.after[..]),
            times_s: scene.arrangement.window.is_some().then_some(&self.times_s[..]),
            t_max: self.most_depth,
            ..Rays::unlimited(origins, &self.directions)
        }
    }

    /// Becomes a batch of these rays of another one, which go on behind no hit, in this order.
    pub fn take(&mut self, from: &Self, numbers: &[u32])
    where
        T: Copy,
    {
        fn some<'a, V: Copy>(values: &'a [V], numbers: &'a [u32]) -> impl Iterator<Item = V> + 'a {
            numbers.iter().map(|&number| values[number as usize])
        }
        self.clear();
        self.origin = from.origin;
        self.known.extend(some(&from.known, numbers));
        if !from.origins.is_empty() {
            self.origins.extend(some(&from.origins, numbers));
        }
        self.directions.extend(some(&from.directions, numbers));
        self.times_s.extend(some(&from.times_s, numbers));
    }
}

/// The order of rays by their directions: along a curve through the cells of a map of the sphere. So rays that follow each other go
/// nearly the same way, and the tracer can take them together. Those of a cell stay in their order.
#[derive(Default)]
pub(super) struct DirectionOrder {
    cells: Vec<u32>,
    numbers: Vec<u32>,
}

impl DirectionOrder {
    /// The numbers of a batch's rays in this order, with 2^`bits` cells a side.
    pub fn of<T>(&mut self, rays: &RayBatch<T>, bits: u32) -> &[u32] {
        let Self { cells, numbers } = self;
        cells.clear();
        cells.extend(rays.directions.iter().map(|&direction| cell(direction, bits)));
        // The place of the next ray of each cell.
        let mut places = vec![0; (1 << (2 * bits)) + 1];
        cells.iter().for_each(|&cell| places[cell as usize + 1] += 1);
        for cell in 1..places.len() {
            places[cell] += places[cell - 1];
        }
        numbers.clear();
        numbers.resize(cells.len(), 0);
        for (ray, &cell) in (0..).zip(&*cells) {
            let place = &mut places[cell as usize];
            numbers[*place] = ray;
            *place += 1;
        }
        numbers
    }
}

/// The number of a direction's cell on an octahedron that is unfolded to a square (Z. H. Cigolle et al., "A survey of efficient
/// representations for independent unit vectors", JCGT 3(2), 2014), along Morton's curve.
fn cell(direction: DVec3, bits: u32) -> u32 {
    let DVec3 { x, y, z } = direction / direction.abs().element_sum();
    let sign = |value: f64| if value < 0.0 { -1.0 } else { 1.0 };
    // Directions come in any order, so both sides are computed, and there is no branch.
    let folded = [(1.0 - y.abs()) * sign(x), (1.0 - x.abs()) * sign(y)];
    let [u, v] = [select_unpredictable(z >= 0.0, x, folded[0]), select_unpredictable(z >= 0.0, y, folded[1])];
    let side = f64::from(1_u32 << bits);
    let [u, v] = [u, v].map(|at| ((0.5 * at + 0.5) * side).clamp(0.0, side - 1.0) as u32);
    spread(u) | spread(v) << 1
}

/// The bits of a number below 2¹⁶, each moved to twice its place.
fn spread(number: u32) -> u32 {
    let eights = (number | number << 8) & 0x00ff_00ff;
    let fours = (eights | eights << 4) & 0x0f0f_0f0f;
    let twos = (fours | fours << 2) & 0x3333_3333;
    (twos | twos << 1) & 0x5555_5555
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
        let mut order = DirectionOrder::default();
        let order = order.of(&batch, 3);
        let cell_of = |&ray: &u32| cell(directions[ray as usize], 3);
        assert!(order.is_sorted_by_key(|ray| (cell_of(ray), *ray)));
        let mut cells: Vec<u32> = order.iter().map(cell_of).collect();
        cells.dedup();
        assert_eq!(cells.len(), 64);
        let mut rays = order.to_vec();
        rays.sort_unstable();
        assert_eq!(rays, (0..1000).collect::<Vec<_>>());
        // Rays that are taken keep what is known of them.
        let mut some = RayBatch::default();
        for part in order.chunks(300) {
            some.take(&batch, part);
            assert_eq!(some.len(), part.len());
            assert!((0..part.len()).all(|i| some.known()[i] == part[i] as usize));
            assert!((0..part.len()).all(|i| some.ray(i).direction == directions[part[i] as usize]));
        }
    }

    /// Morton's curve takes the bits of the two places in turn.
    #[test]
    fn bits_are_spread() {
        for (number, twice) in [(0, 0), (1, 1), (0b1011, 0b100_0101), (0xffff, 0x5555_5555)] {
            assert_eq!(spread(number), twice);
        }
    }
}
