//! The map of a placement that moves, as a function of time.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3};

use super::bounds::Bounds;
use super::source::SceneBuilder;
use crate::motion::{Motion, Window};

/// How a placement moves during a frame.
#[derive(Debug, PartialEq)]
pub(super) struct Moving {
    pub motion: Arc<Motion>,
    /// The world position of the scene space's origin.
    pub centre: DVec3,
    /// The placement is there for rays from `from_s` on and before `until_s`.
    pub from_s: f64,
    pub until_s: f64,
    /// The largest |coordinate| of the mesh.
    pub reach: f64,
}

impl Moving {
    /// The maps to and from the scene's space at a time. `None` where rays cannot be carried to the mesh: it is hidden or has another
    /// shape at that time, or [`placed`] is `None`.
    #[inline]
    pub fn maps_at(&self, time_s: f64) -> Option<(DAffine3, DAffine3)> {
        let is_there = self.from_s <= time_s && time_s < self.until_s;
        if is_there { placed(&self.motion, time_s, self.centre, self.reach) } else { None }
    }

    /// The middle of the placement's own part of a window.
    pub fn middle_s(&self, window: Window) -> f64 {
        window.from_s.max(self.from_s) / 2.0 + window.to_s.min(self.until_s) / 2.0
    }

    /// Whether a later placement of the same mesh is there only when this one has gone.
    pub fn is_before(&self, next: &Self) -> bool {
        self.until_s <= next.from_s
    }

    /// A box in the scene's space of everything that a box in the mesh's space reaches during a window.
    pub fn bounds(&self, mesh: &Bounds, window: Window) -> Bounds {
        let (from_s, to_s) = (window.from_s.max(self.from_s), window.to_s.min(self.until_s));
        let (low, high) = self.motion.bounds(from_s, to_s, mesh.low, mesh.high);
        if low.cmpgt(high).any() {
            return Bounds::EMPTY; // It is hidden all the time.
        }
        // Farther out, nothing is there. (In this form NaN counts as far.)
        let most = SceneBuilder::MAX_COORDINATE_M;
        let clamped = |x: f64, far: f64| if x.abs() <= most { x } else { far };
        Bounds {
            low: (low - self.centre).map(|x| clamped(x, -most)),
            high: (high - self.centre).map(|x| clamped(x, most)),
        }
    }
}

/// The maps from a mesh's space to the scene's and back, at a time of a motion. `None` if the mesh is hidden, the map crushes it
/// (see [`Placement::at`]), or it reaches farther than [`SceneBuilder::MAX_COORDINATE_M`], given its largest |coordinate|.
pub(super) fn placed(
    motion: &Motion,
    time_s: f64,
    centre: DVec3,
    reach: f64,
) -> Option<(DAffine3, DAffine3)> {
    let scene_from_mesh = DAffine3::from_translation(-centre) * motion.at(time_s)?;
    let mesh_from_scene = inverted(&scene_from_mesh)?;
    let m = &scene_from_mesh.matrix3;
    let stretch = (m.x_axis.abs() + m.y_axis.abs() + m.z_axis.abs()).max_element();
    let farthest = stretch * reach + scene_from_mesh.translation.abs().max_element();
    // False for NaN.
    (farthest <= SceneBuilder::MAX_COORDINATE_M).then_some((scene_from_mesh, mesh_from_scene))
}

/// The inverse of a map by which rays can be carried into the mesh's space and keep their precision: the condition number of the
/// linear part (in the largest-row-sum norm) is at most 2¹², which holds for every map that does not crush the mesh almost flat.
pub(super) fn inverted(map: &DAffine3) -> Option<DAffine3> {
    let norm = |m: DMat3| (m.x_axis.abs() + m.y_axis.abs() + m.z_axis.abs()).max_element();
    let inverse = map.inverse();
    // False for NaN.
    let is_precise = norm(map.matrix3) * norm(inverse.matrix3) <= 4096.0;
    (is_precise && inverse.is_finite()).then_some(inverse)
}
