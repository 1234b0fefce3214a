//! How far a scene reaches.

use glam::DVec3;

use super::bounds::Bounds;
use super::{Arrangement, Mesh, Scene};

/// The least and the largest x, y and z in the world, in metres.
pub type Extent = [[f64; 2]; 3];

impl Scene {
    /// The extent of all that is placed; from +∞ to −∞ if that is nothing. Of a mesh that is placed more than once, the corners of
    /// its box count, and of one that moves all places of the frame.
    pub fn extent(&self) -> Extent {
        let own = |mesh: &Mesh| {
            let positions = mesh.positions.iter().map(|p| DVec3::from_array(p.map(f64::from)));
            positions.fold(Bounds::EMPTY, Bounds::with)
        };
        let Arrangement { placements, shapes, .. } = &*self.arrangement;
        let own: Vec<_> = self.geometry.meshes.iter().chain(shapes).map(own).collect();
        let mut all = Bounds::EMPTY;
        for placement in placements {
            let own = own[placement.mesh as usize];
            if own.is_empty() {
                continue; // mesh 0 may be
            }
            let in_scene = placement.bounds_of(&own, self.arrangement.window);
            all = all.with(in_scene.low + self.geometry.centre).with(in_scene.high + self.geometry.centre);
        }
        [0, 1, 2].map(|axis| [all.low[axis], all.high[axis]])
    }
}
