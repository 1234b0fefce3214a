//! The tracer that a job casts with: the exact one or a published method.

use std::sync::Arc;

use super::methods::{Method, MethodTracer};
use super::{Cast, Hit, Rays, Tracer};
use crate::scene::Scene;

/// What casts a job's rays, chosen once a scene.
pub enum AnyTracer<'s> {
    /// By the definition of a hit.
    Exact(Tracer<'s>),
    /// By a published method.
    Method(Box<dyn MethodTracer + 's>),
}

impl<'s> AnyTracer<'s> {
    /// Builds the hierarchies over a scene, and prepares it for a method if there is one.
    pub fn build(scene: &'s Scene, method: Option<&Method>) -> Self {
        let exact = Tracer::build(scene);
        match method {
            None => Self::Exact(exact),
            Some(method) => Self::Method(method.tracer(&Arc::new(exact))),
        }
    }

    /// Bytes held beside the scene.
    pub fn bytes(&self) -> usize {
        match self {
            Self::Exact(tracer) => tracer.bytes(),
            Self::Method(tracer) => tracer.bytes(),
        }
    }
}

impl Cast for AnyTracer<'_> {
    fn cast(&self, rays: &Rays, hits: &mut [Option<Hit>]) {
        match self {
            Self::Exact(tracer) => tracer.cast(rays, hits),
            Self::Method(tracer) => tracer.cast(rays, hits),
        }
    }
}
