//! The shape over time of a mesh that a skin or morph targets bend.

use glam::{DAffine3, DVec3};

use super::chains::Bones;
use super::fault::Fault;
use super::skin::{SkinPose, no_joint};
use super::vertices::Vertices;
use crate::motion::Channel;

/// How the vertices of a mesh move: what its file says of that, without what is zero.
#[derive(Default)]
pub(super) struct Bends {
    /// For each morph target, the vertices that it moves, and how far at a weight of 1.
    targets: Vec<Vec<(u32, [f32; 3])>>,
    /// The joints of all vertices, each with its weight.
    influences: Vec<(u32, f32)>,
    /// For each vertex the end of its influences.
    ends: Vec<u32>,
}

/// The shape of a mesh over time.
pub(super) struct Shape {
    /// The vertices before anything moves them.
    pub rest: Vec<[f32; 3]>,
    pub bends: Bends,
    /// The weights of the targets, if they change over time.
    pub weights: Option<Channel<Vec<f64>>>,
    pub skin: Option<BendingSkin>,
}

/// A skin whose joints move.
pub(super) struct BendingSkin {
    /// The joints, and after them the node of the mesh if a primitive stands where that is.
    pub bones: Bones,
    /// For each of them, the map to it from the mesh.
    pub bone_from_mesh: Vec<DAffine3>,
    /// The point of the bones' space that positions are relative to.
    pub origin: DVec3,
}

impl Bends {
    /// The most memory that each target and each joint of a vertex takes.
    pub const BYTES_A_MOVE: usize = size_of::<(u32, [f32; 3])>();

    /// Adds the vertices `used` of a primitive (all of them, if it is empty), and their positions before they move. Returns
    /// whether these are finite. `skin` is the skin in some pose.
    pub fn add(
        &mut self,
        vertices: &Vertices,
        used: &[u32],
        skin: Option<&SkinPose>,
        positions: &mut Vec<[f32; 3]>,
    ) -> Result<bool, Fault> {
        let first = positions.len();
        let mut all_finite = true;
        for vertex in vertices.numbers(used) {
            let position = vertices.position(vertex).as_vec3();
            all_finite &= position.is_finite();
            positions.push(position.to_array());
        }
        for (number, weight, target) in &vertices.targets {
            if weight.is_some() {
                continue;
            }
            if self.targets.len() <= *number {
                self.targets.resize(*number + 1, Vec::new());
            }
            for (at, vertex) in vertices.numbers(used).enumerate() {
                let displacement = DVec3::from_array(target.get(vertex)).as_vec3();
                if !displacement.is_finite() {
                    let problem = format!("vertex {vertex} is moved by {displacement:?}");
                    return Err(Fault::new(format!("target {number}"), problem));
                }
                if displacement != glam::Vec3::ZERO {
                    self.targets[*number].push(((first + at) as u32, displacement.to_array()));
                }
            }
        }
        let Some(skin) = skin else { return Ok(all_finite) };
        let joints = skin.matrices.len();
        for vertex in vertices.numbers(used) {
            let begin = self.influences.len();
            if vertices.joints_and_weights.is_empty() {
                // It stands where its node is, which comes after the joints.
                self.influences.push((joints as u32, 1.0));
            }
            let mut total = 0.0;
            for (joint, weight) in vertices.influences(vertex) {
                if joint >= joints {
                    return Err(no_joint(vertex, joint, joints));
                }
                let weight = weight as f32;
                total += f64::from(weight);
                self.influences.push((joint as u32, weight));
            }
            if total == 0.0 && !vertices.joints_and_weights.is_empty() {
                // No joint holds the vertex: it is taken as held by the first.
                self.influences.truncate(begin);
                self.influences.push((0, 1.0));
            }
            let end = u32::try_from(self.influences.len());
            self.ends
                .push(end.map_err(|_| Fault::new("", "the mesh hangs on joints by more than 2³² weights"))?);
        }
        Ok(all_finite)
    }
}

impl Shape {
    /// The positions of all vertices at a time.
    pub fn at(&self, time_s: f64) -> Vec<[f32; 3]> {
        let mut positions: Vec<DVec3> =
            self.rest.iter().map(|&[x, y, z]| DVec3::new(x.into(), y.into(), z.into())).collect();
        if let Some(weights) = &self.weights {
            let weights = weights.at(time_s);
            for (moves, weight) in self.bends.targets.iter().zip(weights).filter(|(_, weight)| *weight != 0.0)
            {
                for &(vertex, [x, y, z]) in moves {
                    positions[vertex as usize] += weight * DVec3::new(x.into(), y.into(), z.into());
                }
            }
        }
        if let Some(skin) = &self.skin {
            let maps = skin.bones.maps_at(time_s);
            let matrices: Vec<DAffine3> =
                maps.into_iter().zip(&skin.bone_from_mesh).map(|(map, bind)| map * *bind).collect();
            let mut begin = 0;
            for (position, &end) in positions.iter_mut().zip(&self.bends.ends) {
                let (mut sum, mut total) = (DVec3::ZERO, 0.0);
                for &(joint, weight) in &self.bends.influences[begin..end as usize] {
                    sum += f64::from(weight) * matrices[joint as usize].transform_point3(*position);
                    total += f64::from(weight);
                }
                *position = sum / total - skin.origin;
                begin = end as usize;
            }
        }
        positions.into_iter().map(|position| position.as_vec3().to_array()).collect()
    }
}
