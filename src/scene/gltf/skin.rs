//! Skins: what the joints do to the vertices that hang on them.

use glam::{DAffine3, DMat3, DVec3};

use super::data::{Data, Layout};
use super::document::Document;
use super::fault::{Fault, missing};
use super::schema::Component::F32;
use super::schema::{Kind, Skin};
use crate::source::words::counted;

const INVERSE_BIND_MATRICES: Layout =
    Layout { purpose: "inverseBindMatrices", kind: Kind::Mat4, components: &[(F32, false)] };

/// A skin as its file has it.
pub(super) struct SkinSource<'d> {
    /// The nodes of its joints, all of which exist.
    pub joints: &'d [u32],
    /// For each joint, the map to it from the mesh.
    pub joint_from_mesh: Vec<DAffine3>,
}

/// A skin in the pose that the nodes of its joints give it.
pub(super) struct SkinPose {
    /// For each joint, the map from the mesh to the space of the pose.
    pub matrices: Vec<DAffine3>,
    /// Where the node of the mesh is in that space: there stand the primitives that lack joints.
    pub stand: DAffine3,
    /// A point of that space near the skin's joints. Positions are stored relative to it.
    pub origin: DVec3,
}

impl<'d> SkinSource<'d> {
    /// Skin `index`.
    pub fn new(document: &'d Document, data: &Data, index: u32) -> Result<Self, Fault> {
        let skin =
            document.skins.get(index as usize).ok_or_else(|| missing("skin", index, document.skins.len()))?;
        Self::of(skin, data, document.nodes.len()).map_err(|fault| fault.within(format!("skin {index}")))
    }

    fn of(skin: &'d Skin, data: &Data, nodes: usize) -> Result<Self, Fault> {
        let bind = match skin.inverse_bind_matrices {
            Some(accessor) => {
                let bind = data.elements(accessor, &INVERSE_BIND_MATRICES, None)?;
                if bind.len() < skin.joints.len() {
                    let problem = format!(
                        "there are {} inverse bind matrices for {} joints",
                        bind.len(),
                        skin.joints.len()
                    );
                    return Err(Fault::new("", problem));
                }
                Some(bind)
            }
            None => None,
        };
        if skin.joints.is_empty() {
            return Err(Fault::new("", "the skin has no joints"));
        }
        data.spend(skin.joints.len(), 2 * size_of::<DAffine3>())?;
        if let Some((at, joint)) = skin.joints.iter().enumerate().find(|(_, joint)| **joint as usize >= nodes)
        {
            return Err(Fault::new(format!("joint {at}"), format!("node {joint} does not exist")));
        }
        let joint_from_mesh =
            (0..skin.joints.len()).map(|at| bind.map_or(DAffine3::IDENTITY, |bind| affine(bind.get(at))));
        Ok(Self { joints: &skin.joints, joint_from_mesh: joint_from_mesh.collect() })
    }

    /// The skin in the pose that its joints have in a space, where `stand` is the place of the mesh's node.
    pub fn posed(&self, from_joints: impl Iterator<Item = DAffine3>, stand: DAffine3) -> SkinPose {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let pairs = from_joints.zip(&self.joint_from_mesh);
        let matrices = pairs
            .map(|(from_joint, joint_from_mesh)| {
                low = low.min(from_joint.translation);
                high = high.max(from_joint.translation);
                from_joint * *joint_from_mesh
            })
            .collect();
        SkinPose { matrices, stand, origin: low.midpoint(high) }
    }
}

impl SkinPose {
    /// Linear blend skinning (glTF 2.0, section 3.7.3.3): the weighted mean of the positions that the joints give the vertex.
    pub fn posed(
        &self,
        vertex: usize,
        position: DVec3,
        influences: impl Iterator<Item = (usize, f64)>,
    ) -> Result<DVec3, Fault> {
        let (mut sum, mut total) = (DVec3::ZERO, 0.0);
        for (joint, weight) in influences {
            let matrix =
                self.matrices.get(joint).ok_or_else(|| no_joint(vertex, joint, self.matrices.len()))?;
            sum += weight * matrix.transform_point3(position);
            total += weight;
        }
        if total == 0.0 {
            // No joint holds the vertex. Graphics cards and other readers take the first joint.
            return Ok(self.matrices[0].transform_point3(position) - self.origin);
        }
        Ok(sum / total - self.origin)
    }
}

/// The fault of a vertex that hangs on a joint which its skin does not have.
pub(super) fn no_joint(vertex: usize, joint: usize, joints: usize) -> Fault {
    let problem =
        format!("vertex {vertex} hangs on joint {joint}, but the skin has {}", counted(joints, "joint"));
    Fault::new("JOINTS", problem)
}

/// The affine part of a 4 × 4 matrix, column by column. An inverse bind matrix has no other part.
fn affine(m: [f64; 16]) -> DAffine3 {
    let column = |at: usize| DVec3::new(m[at], m[at + 1], m[at + 2]);
    DAffine3 { matrix3: DMat3::from_cols(column(0), column(4), column(8)), translation: column(12) }
}
