//! How far a scene reaches.

use glam::DVec3;

use super::bounds::Bounds;
use super::{Mesh, Scene};

/// The least and the largest x, y and z in the world, in metres.
pub type Extent = [[f64; 2]; 3];

impl Scene {
    /// The extent of all that is placed; from +∞ to −∞ if that is nothing. Of a mesh that is placed more than once, the corners of
    /// its box count.
    pub fn extent(&self) -> Extent {
        let own = |mesh: &Mesh| {
            let positions = mesh.positions.iter().map(|p| DVec3::from_array(p.map(f64::from)));
            positions.fold(Bounds::EMPTY, Bounds::with)
        };
        let own: Vec<_> = self.geometry.meshes.iter().map(own).collect();
        let mut all = Bounds::EMPTY;
        for placement in &self.arrangement.placements {
            let own = own[placement.mesh as usize];
            if own.is_empty() {
                continue; // mesh 0 may be
            }
            let (world_from_scene, scene_from_mesh) = (self.geometry.centre, placement.scene_from_mesh());
            all = own
                .corners()
                .map(|corner| scene_from_mesh.transform_point3(corner) + world_from_scene)
                .fold(all, Bounds::with);
        }
        [0, 1, 2].map(|axis| [all.low[axis], all.high[axis]])
    }
}
