//! The published ray–triangle methods, each as its paper has it, in f32.
//!
//! A job casts with the exact definition of a hit (see [`super::exact`]) unless its `[trace]` says `kernel = "…"`. Then one of
//! these methods decides, at the leaves of the same hierarchy, and every error of the method is in the output: the methods
//! exist to be compared. `beamcast kernels` measures all of them against exact arithmetic.
//!
//! ```text
//! kernel          what a method is: the trait, and the arithmetic that methods share
//! one file each   the methods
//! tracer          a method at the leaves of the exact tracer's hierarchies
//! truth           the exact answer, to judge methods by
//! ```
#![doc = include_str!("measured.md")]

mod badouel;
mod baldwin_weber;
mod curless;
#[cfg(test)]
mod errata;
mod held;
mod homogeneous;
mod kernel;
mod left_of_edge;
mod moller_trumbore;
mod plucker;
mod segura_feito;
mod sunday;
mod tracer;
pub mod truth;
mod watertight;

use std::sync::Arc;

use glam::Vec3;

use super::tracer::Tracer;
pub use kernel::{About, Crossing, Culling, Edges, Kernel, Ray};
pub use tracer::{KernelTracer, MethodTracer};

/// A ray and the corners of a triangle.
pub type RayTriangle = (Ray, [Vec3; 3]);

/// An entry of [`METHODS`]: a [`Kernel`] as a value.
#[derive(Clone, Copy, Debug)]
pub struct Method {
    /// The method's name, paper and properties.
    pub about: About,
    /// The bytes that the method keeps of a triangle.
    pub bytes_per_triangle: usize,
    intersect: fn(&Ray, [Vec3; 3]) -> Option<Crossing>,
    batch: fn(&[RayTriangle]) -> Box<dyn Fn() -> usize>,
    tracer: fn(&Tracer) -> Arc<dyn MethodTracer>,
}

impl Method {
    const fn of<K: Kernel>() -> Self {
        Self {
            about: K::ABOUT,
            bytes_per_triangle: size_of::<K::Triangle>(),
            intersect: |ray, corners| K::intersect(&K::triangle(corners, ray.origin), &K::ray(*ray)),
            batch: |pairs| {
                let prepare =
                    |(ray, corners): &RayTriangle| (K::triangle(*corners, ray.origin), K::ray(*ray));
                let prepared: Vec<_> = pairs.iter().map(prepare).collect();
                Box::new(move || prepared.iter().filter(|(t, r)| K::intersect(t, r).is_some()).count())
            },
            tracer: |exact| Arc::new(KernelTracer::<K>::new(exact)),
        }
    }

    /// The method called `name`.
    pub fn named(name: &str) -> Option<&'static Self> {
        METHODS.iter().find(|m| m.about.name == name)
    }

    /// Prepares a ray and a triangle and intersects them.
    pub fn intersect(&self, ray: &Ray, corners: [Vec3; 3]) -> Option<Crossing> {
        (self.intersect)(ray, corners)
    }

    /// Prepares pairs of rays and triangles. The returned function intersects each pair and counts the crossings; it is the
    /// function to time.
    pub fn batch(&self, pairs: &[RayTriangle]) -> Box<dyn Fn() -> usize> {
        (self.batch)(pairs)
    }

    /// A tracer that decides by this method, on the hierarchies of `exact`, which it shares.
    pub fn tracer(&self, exact: &Tracer) -> Arc<dyn MethodTracer> {
        (self.tracer)(exact)
    }
}

/// Every method.
pub static METHODS: [Method; 16] = [
    Method::of::<curless::Curless>(),
    Method::of::<homogeneous::Homogeneous>(),
    Method::of::<left_of_edge::LeftOfEdge>(),
    Method::of::<moller_trumbore::MollerTrumbore>(),
    Method::of::<moller_trumbore::MollerTrumboreFrontCulled>(),
    Method::of::<moller_trumbore::MollerTrumboreBackCulled>(),
    Method::of::<sunday::Sunday>(),
    Method::of::<sunday::SundayPrecomputed>(),
    Method::of::<badouel::Badouel>(),
    Method::of::<segura_feito::SeguraFeitoSegment>(),
    Method::of::<segura_feito::SeguraFeito>(),
    Method::of::<segura_feito::SeguraFeitoPrecomputed>(),
    Method::of::<held::Held>(),
    Method::of::<plucker::Plucker>(),
    Method::of::<watertight::Watertight>(),
    Method::of::<baldwin_weber::BaldwinWeber>(),
];
