//! How far a scene reaches.

use glam::DVec3;

use crate::plausibility::Extent;
use crate::scene::{Mesh, Scene};

/// The least and the largest x, y and z of a scene in the world. Of a mesh that is placed more than once, the corners of its
/// box count.
pub(super) fn extent(scene: &Scene) -> Extent {
    let (nothing, everything) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let own = |mesh: &Mesh| {
        let positions = mesh.positions.iter().map(|p| DVec3::from_array(p.map(f64::from)));
        positions.fold((nothing, everything), |(low, high), p| (low.min(p), high.max(p)))
    };
    let own: Vec<_> = scene.geometry.meshes.iter().map(own).collect();
    let (mut low, mut high) = (nothing, everything);
    for placement in &scene.arrangement.placements {
        let (a, b) = own[placement.mesh as usize];
        if a.x > b.x {
            continue; // mesh 0 may be empty
        }
        for corner in 0..8 {
            let p = DVec3::from_array([0, 1, 2].map(|i| if corner >> i & 1 == 0 { a[i] } else { b[i] }));
            let p = placement.scene_from_mesh().transform_point3(p) + scene.geometry.centre;
            (low, high) = (low.min(p), high.max(p));
        }
    }
    [0, 1, 2].map(|axis| [low[axis], high[axis]])
}
