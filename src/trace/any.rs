//! The tracer that a job casts with: the exact one or a published method.

use std::sync::Arc;

use super::methods::{Method, MethodTracer};
use super::rays::{Cast, Hit, Rays};
use super::stats::TraversalStats;
use super::tracer::Tracer;
use crate::scene::{Arrangement, Scene};

/// The tracer that a job casts with, chosen once for a scene. Its clones share everything.
#[derive(Clone, Debug)]
pub enum AnyTracer {
    /// Decides by the definition of a hit.
    Exact(Tracer),
    /// Decides by a published method.
    Method(Arc<dyn MethodTracer>),
}

impl AnyTracer {
    /// Builds the hierarchies over a scene, and prepares its triangles for a method if one is given.
    pub fn build(scene: &Scene, method: Option<&Method>) -> Self {
        let exact = Tracer::build(scene);
        match method {
            None => Self::Exact(exact),
            Some(method) => Self::Method(method.tracer(&exact)),
        }
    }

    /// As [`Tracer::rearranged`].
    ///
    /// # Panics
    /// As [`Tracer::rearranged`].
    pub fn rearranged(&self, arrangement: Arc<Arrangement>) -> Self {
        match self {
            Self::Exact(tracer) => Self::Exact(tracer.rearranged(arrangement)),
            Self::Method(tracer) => Self::Method(tracer.rearranged(arrangement)),
        }
    }

    /// The scene that rays are cast against.
    pub fn scene(&self) -> &Scene {
        match self {
            Self::Exact(tracer) => tracer.scene(),
            Self::Method(tracer) => tracer.scene(),
        }
    }

    /// The bytes held in addition to the scene.
    pub fn bytes(&self) -> usize {
        match self {
            Self::Exact(tracer) => tracer.bytes(),
            Self::Method(tracer) => tracer.bytes(),
        }
    }

    /// [`Cast::cast`], and the statistics of the traversal; `None` for a published method, which counts nothing.
    ///
    /// # Panics
    /// As [`Cast::cast`].
    pub fn cast_counted(&self, rays: &Rays, hits: &mut [Option<Hit>]) -> Option<TraversalStats> {
        match self {
            Self::Exact(tracer) => Some(tracer.cast_counted(rays, hits)),
            Self::Method(tracer) => {
                tracer.cast(rays, hits);
                None
            }
        }
    }
}

impl Cast for AnyTracer {
    fn cast(&self, rays: &Rays, hits: &mut [Option<Hit>]) {
        match self {
            Self::Exact(tracer) => tracer.cast(rays, hits),
            Self::Method(tracer) => tracer.cast(rays, hits),
        }
    }

    fn blocked(&self, rays: &Rays, blocked: &mut [bool]) {
        match self {
            Self::Exact(tracer) => tracer.blocked(rays, blocked),
            Self::Method(tracer) => tracer.blocked(rays, blocked),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A thread pool, a Python object or a worker of a cluster needs these traits. The test fails by not compiling.
    #[test]
    fn tracers_own_what_they_need_and_go_to_any_thread() {
        fn check<T: Clone + Send + Sync + 'static>() {}
        check::<Scene>();
        check::<Tracer>();
        check::<AnyTracer>();
    }
}
