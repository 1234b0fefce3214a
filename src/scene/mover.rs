//! Meshes that move, hide or bend.

use std::fmt;
use std::sync::Arc;

use crate::motion::Motion;

/// A mesh at a place that changes over time.
#[derive(Clone, Debug)]
pub struct Mover {
    /// Index into [`Geometry::meshes`](super::Geometry::meshes). Of a mesh that bends, it is the shape at rest.
    pub mesh: u32,
    /// The id of the mesh's first triangle at this place, whatever the time.
    pub first_triangle: u32,
    /// Index into [`Geometry::objects`](super::Geometry::objects).
    pub object: u32,
    /// `world_from_mesh` over time.
    pub motion: Arc<Motion>,
    /// The shape of the mesh over time, if it bends.
    pub deformer: Option<Arc<Deformer>>,
    /// The vertices of the source mesh that the stored mesh has, of a mesh that bends.
    pub(super) vertices: Arc<[u32]>,
    /// The largest |coordinate| of the mesh at rest.
    pub(super) reach: f64,
}

/// A mesh's shape as a function of time (seconds on the clock of the scene): the positions of all vertices of its source mesh,
/// in metres in the mesh's own space; `None` at a time at which it has none.
pub struct Deformer(Box<ShapeAt>);

type ShapeAt = dyn Fn(f64) -> Option<Vec<[f32; 3]>> + Send + Sync;

impl Deformer {
    /// A shape given by a function, which must give the same positions for the same time.
    pub fn new(shape_at: impl Fn(f64) -> Option<Vec<[f32; 3]>> + Send + Sync + 'static) -> Self {
        Self(Box::new(shape_at))
    }

    /// The positions of all vertices of the source mesh at a time.
    pub fn shape_at(&self, time_s: f64) -> Option<Vec<[f32; 3]>> {
        (self.0)(time_s)
    }
}

impl fmt::Debug for Deformer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Deformer")
    }
}

/// The largest |coordinate|; NaN if there is one.
pub(super) fn reach(positions: &[[f32; 3]]) -> f64 {
    let larger = |most: f32, x: f32| if most.is_nan() || x.abs() <= most { most } else { x.abs() };
    f64::from(positions.iter().flatten().fold(0.0, |most, &x| larger(most, x)))
}
