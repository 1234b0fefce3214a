//! Reads primitives as triangles: the modes, the morph targets and the skins.

use std::collections::BTreeMap;

use glam::{DAffine3, DMat3, DVec3};
use gltf::json;
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::{Mode, Semantic};
use gltf::json::validation::Checked;

use super::data::{Data, Elements, Layout};
use super::document::{DRACO, Document};
use super::fault::{Fault, counted, missing};
use crate::scene::notice::Notice;
use crate::scene::source::{SourceMesh, SourcePart};

use ComponentType::{F32, I8, I16, U8, U16, U32};

const POSITION: Layout = Layout { purpose: "POSITION", kind: Type::Vec3, components: &[(F32, false)] };
/// KHR_mesh_quantization.
const QUANTIZED_POSITION: Layout = Layout {
    components: &[
        (F32, false),
        (I8, false),
        (I8, true),
        (U8, false),
        (U8, true),
        (I16, false),
        (I16, true),
        (U16, false),
        (U16, true),
    ],
    ..POSITION
};
const DISPLACEMENT: Layout = Layout { purpose: "a target's POSITION", ..POSITION };
/// KHR_mesh_quantization.
const QUANTIZED_DISPLACEMENT: Layout = Layout {
    purpose: DISPLACEMENT.purpose,
    components: &[(F32, false), (I8, false), (I8, true), (I16, false), (I16, true)],
    ..POSITION
};
const INDICES: Layout =
    Layout { purpose: "indices", kind: Type::Scalar, components: &[(U8, false), (U16, false), (U32, false)] };
const JOINTS: Layout =
    Layout { purpose: "JOINTS", kind: Type::Vec4, components: &[(U8, false), (U16, false)] };
const WEIGHTS: Layout =
    Layout { purpose: "WEIGHTS", kind: Type::Vec4, components: &[(F32, false), (U8, true), (U16, true)] };
const INVERSE_BIND_MATRICES: Layout =
    Layout { purpose: "inverseBindMatrices", kind: Type::Mat4, components: &[(F32, false)] };

/// Counts of the primitives that were left out, for warnings.
#[derive(Debug, Default)]
pub(super) struct LeftOut {
    /// Primitives of points and lines, in all meshes that were read.
    pub points_and_lines: u64,
    /// Primitives without positions.
    pub without_positions: u64,
    /// Triangle lists whose last triangle is incomplete.
    pub incomplete: u64,
}

/// The pose that the vertices of a mesh are brought into.
pub(super) struct Pose<'p> {
    /// The node's weights of the morph targets. Without them, the mesh's own count; a weight that is left out is 0.
    pub weights: Option<&'p [f64]>,
    /// The skin of a skinned mesh.
    pub skin: Option<&'p SkinPose>,
}

/// A skin in the pose that the nodes of its joints give it.
pub(super) struct SkinPose {
    /// For each joint, the map from the mesh to glTF's world.
    matrices: Vec<DAffine3>,
    /// A point in glTF's world near the skin's joints. Positions are stored relative to it.
    pub origin: DVec3,
}

impl SkinPose {
    /// Skin `index`, its joints posed by `world_from_node`.
    pub fn new(
        document: &Document,
        data: &Data,
        index: u32,
        world_from_node: &[DAffine3],
    ) -> Result<Self, Fault> {
        let skin =
            document.skins.get(index as usize).ok_or_else(|| missing("skin", index, document.skins.len()))?;
        Self::of(skin, data, world_from_node).map_err(|fault| fault.within(format!("skin {index}")))
    }

    fn of(skin: &json::Skin, data: &Data, world_from_node: &[DAffine3]) -> Result<Self, Fault> {
        let bind = match skin.inverse_bind_matrices {
            Some(accessor) => {
                let bind = data.elements(accessor.value() as u32, &INVERSE_BIND_MATRICES, None)?;
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
        data.spend(skin.joints.len(), size_of::<DAffine3>())?;
        let mut matrices = Vec::with_capacity(skin.joints.len());
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for (at, joint) in skin.joints.iter().enumerate() {
            let world_from_joint = world_from_node
                .get(joint.value())
                .ok_or_else(|| Fault::new(format!("joint {at}"), format!("node {joint} does not exist")))?;
            low = low.min(world_from_joint.translation);
            high = high.max(world_from_joint.translation);
            let joint_from_mesh = bind.map_or(DAffine3::IDENTITY, |bind| affine(bind.get(at)));
            matrices.push(*world_from_joint * joint_from_mesh);
        }
        if matrices.is_empty() {
            return Err(Fault::new("", "the skin has no joints"));
        }
        Ok(Self { matrices, origin: low.midpoint(high) })
    }
}

/// The affine part of a 4 × 4 matrix, column by column. An inverse bind matrix has no other part.
fn affine(m: [f64; 16]) -> DAffine3 {
    let column = |at: usize| DVec3::new(m[at], m[at + 1], m[at + 2]);
    DAffine3 { matrix3: DMat3::from_cols(column(0), column(4), column(8)), translation: column(12) }
}

/// Reads meshes.
pub(super) struct MeshReader<'d, 'a> {
    document: &'d Document,
    data: &'d Data<'a>,
    /// The primitives that were left out so far.
    pub left_out: LeftOut,
    /// Whether a primitive without a material was met.
    pub uses_default_material: bool,
}

/// The positions of one accessor among the positions of a mesh.
#[derive(Clone, Copy)]
struct Run {
    base: u32,
    all_finite: bool,
}

/// The vertex data of a primitive.
struct Vertices<'b> {
    positions: Elements<'b>,
    targets: Vec<(f64, Elements<'b>)>,
    joints_and_weights: Vec<(Elements<'b>, Elements<'b>)>,
}

impl<'d, 'a> MeshReader<'d, 'a> {
    pub fn new(document: &'d Document, data: &'d Data<'a>) -> Self {
        Self { document, data, left_out: LeftOut::default(), uses_default_material: false }
    }

    /// The triangles of mesh `index` in its own space; of a skinned mesh, in glTF's world relative to the skin's origin.
    pub fn read(&mut self, index: u32, pose: &Pose) -> Result<SourceMesh, Fault> {
        let Some(mesh) = self.document.meshes.get(index as usize) else {
            return Err(missing("mesh", index, self.document.meshes.len()));
        };
        let default_weights: Vec<f64>;
        let weights = match pose.weights {
            Some(weights) => weights,
            None => {
                default_weights = mesh.weights.iter().flatten().map(|&weight| weight.into()).collect();
                &default_weights
            }
        };
        // Reading takes time in proportion to these counts, however few triangles result.
        self.data.spend(mesh.primitives.len() + weights.len(), size_of::<json::mesh::Primitive>())?;
        let mut source = SourceMesh::default();
        // The run of positions of each accessor, so that primitives that share an accessor share its positions.
        let mut shared = BTreeMap::new();
        for (number, primitive) in mesh.primitives.iter().enumerate() {
            self.read_primitive(primitive, weights, pose.skin, &mut source, &mut shared).map_err(
                |fault| fault.within(format!("{}, primitive {number}", self.document.mesh_label(index))),
            )?;
        }
        Ok(source)
    }

    fn read_primitive(
        &mut self,
        primitive: &json::mesh::Primitive,
        weights: &[f64],
        skin: Option<&SkinPose>,
        source: &mut SourceMesh,
        shared: &mut BTreeMap<u32, Run>,
    ) -> Result<(), Fault> {
        let Checked::Valid(mode) = primitive.mode else {
            return Err(Fault::new("", "its mode is none that glTF knows").help("0 to 6"));
        };
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            self.left_out.points_and_lines += 1;
            return Ok(());
        }
        if self.document.requires(DRACO)
            && primitive.extensions.as_ref().is_some_and(|extensions| extensions.others.contains_key(DRACO))
        {
            return Err(Fault::new("", "it is compressed with Draco, which beamcast does not read")
                .help("`npx @gltf-transform/cli copy in.glb out.glb` writes it uncompressed"));
        }
        let Some(position_accessor) = attribute(primitive, Semantic::Positions) else {
            self.left_out.without_positions += 1;
            return Ok(());
        };
        let vertices = self.vertices(primitive, position_accessor, weights, skin.is_some())?;
        let vertex_count = vertices.positions.len();
        let indices = match primitive.indices {
            Some(accessor) => Some(
                self.data
                    .elements(accessor.value() as u32, &INDICES, None)
                    .map_err(|fault| fault.within("indices"))?,
            ),
            None => None,
        };
        let mut triangles = self.triangles(mode, indices.as_ref(), vertex_count)?;
        if triangles.is_empty() {
            return Ok(());
        }
        let material = match primitive.material {
            None => {
                self.uses_default_material = true;
                self.document.materials.len() as u32
            }
            Some(index) if index.value() < self.document.materials.len() => index.value() as u32,
            Some(index) => {
                return Err(missing("material", index.value() as u32, self.document.materials.len()));
            }
        };

        let sharable = vertices.targets.is_empty() && vertices.joints_and_weights.is_empty();
        let mut used = Vec::new();
        let known = shared.get(&position_accessor).copied().filter(|_| sharable);
        let Run { base, all_finite } = match known {
            Some(known) => known,
            None => {
                // Some exporters put the vertices of many small meshes into one accessor.
                let is_sparsely_used = vertex_count / 2 > triangles.len().saturating_mul(3);
                if is_sparsely_used {
                    used = compact(&mut triangles);
                }
                let count = if is_sparsely_used { used.len() } else { vertex_count };
                self.data.spend(count, size_of::<[f32; 3]>())?;
                let base = source.positions.len();
                if base + count > u32::MAX as usize {
                    return Err(Fault::new("", "the mesh has more than 2³² vertices"));
                }
                let all_finite = vertices.read(&used, skin, &mut source.positions)?;
                let run = Run { base: base as u32, all_finite };
                if sharable && !is_sparsely_used {
                    shared.insert(position_accessor, run);
                }
                run
            }
        };
        if !all_finite {
            check_finite(&triangles, &source.positions[base as usize..]).map_err(|(vertex, p)| {
                let vertex = used.get(vertex as usize).copied().unwrap_or(vertex);
                Fault::new(format!("accessor {position_accessor}"), format!("vertex {vertex} lies at {p:?}"))
                    .help("a coordinate is a finite number of metres")
            })?;
        }
        if base > 0 {
            triangles.iter_mut().flatten().for_each(|vertex| *vertex += base);
        }
        source.parts.push(SourcePart { triangles, material });
        Ok(())
    }

    fn vertices(
        &self,
        primitive: &json::mesh::Primitive,
        positions: u32,
        weights: &[f64],
        is_skinned: bool,
    ) -> Result<Vertices<'d>, Fault> {
        let quantized = self.document.uses("KHR_mesh_quantization");
        let (position, displacement) =
            if quantized { (QUANTIZED_POSITION, QUANTIZED_DISPLACEMENT) } else { (POSITION, DISPLACEMENT) };
        let positions = self.data.elements(positions, &position, None)?;
        let count = Some(positions.len());
        let mut vertices = Vertices { positions, targets: Vec::new(), joints_and_weights: Vec::new() };
        for (number, (target, &weight)) in primitive.targets.iter().flatten().zip(weights).enumerate() {
            if let Some(accessor) = target.positions
                && weight != 0.0
            {
                let elements = self
                    .data
                    .elements(accessor.value() as u32, &displacement, count)
                    .map_err(|fault| fault.within(format!("target {number}")))?;
                vertices.targets.push((weight, elements));
            }
        }
        if !is_skinned {
            return Ok(vertices);
        }
        for set in 0.. {
            let joints = attribute(primitive, Semantic::Joints(set));
            let weights = attribute(primitive, Semantic::Weights(set));
            let Some((joints, weights)) = joints.zip(weights) else { break };
            vertices.joints_and_weights.push((
                self.data.elements(joints, &JOINTS, count)?,
                self.data.elements(weights, &WEIGHTS, count)?,
            ));
        }
        if vertices.joints_and_weights.is_empty() {
            return Err(Fault::new("", "its node has a skin, but it has no JOINTS_0 and WEIGHTS_0"));
        }
        Ok(vertices)
    }

    /// The triangles of a primitive as indices into its vertices, all of which are in bounds.
    fn triangles(
        &mut self,
        mode: Mode,
        indices: Option<&Elements>,
        vertex_count: usize,
    ) -> Result<Vec<[u32; 3]>, Fault> {
        let corners = indices.map_or(vertex_count, Elements::len);
        let count = if mode == Mode::Triangles {
            if !corners.is_multiple_of(3) {
                self.left_out.incomplete += 1;
            }
            corners / 3
        } else {
            corners.saturating_sub(2)
        };
        self.data.spend(count, size_of::<[u32; 3]>())?;
        // The largest integer of an index type restarts the primitive in graphics APIs, so glTF forbids it.
        let largest = indices.map_or(u32::MAX, Elements::largest_integer);
        let bound = (vertex_count as u64).min(largest.into());
        let mut bad = None;
        let mut corner = |at: usize| {
            let index = indices.map_or(at as u32, |indices| indices.integer(at));
            if u64::from(index) >= bound {
                bad.get_or_insert((at, index));
            }
            index
        };
        let triangles = (0..count).map(|at| match mode {
            Mode::TriangleStrip => [corner(at), corner(at + 1 + at % 2), corner(at + 2 - at % 2)],
            Mode::TriangleFan => [corner(at + 1), corner(at + 2), corner(0)],
            _ => [corner(3 * at), corner(3 * at + 1), corner(3 * at + 2)],
        });
        let triangles = triangles.collect();
        match bad {
            None => Ok(triangles),
            Some((at, index)) if index == largest && indices.is_some() => {
                let problem = format!("number {at} is {index}, which restarts a primitive");
                Err(Fault::new("indices", problem).help("glTF has no such thing: make several primitives"))
            }
            Some((at, index)) => {
                let problem = format!("number {at} is {index}, but the number of vertices is {vertex_count}");
                Err(Fault::new("indices", problem).help("indices count from 0"))
            }
        }
    }
}

fn attribute(primitive: &json::mesh::Primitive, semantic: Semantic) -> Option<u32> {
    primitive.attributes.get(&Checked::Valid(semantic)).map(|accessor| accessor.value() as u32)
}

/// Renumbers the vertices of `triangles` without gaps. Returns the old number of each new one.
fn compact(triangles: &mut [[u32; 3]]) -> Vec<u32> {
    let mut used = triangles.as_flattened().to_vec();
    used.sort_unstable();
    used.dedup();
    for vertex in triangles.as_flattened_mut() {
        *vertex = used.partition_point(|known| known < vertex) as u32;
    }
    used
}

/// Checks that the triangles' vertices are finite; the error is the first that is not, and its position.
fn check_finite(triangles: &[[u32; 3]], positions: &[[f32; 3]]) -> Result<(), (u32, [f32; 3])> {
    for &vertex in triangles.as_flattened() {
        let position = positions[vertex as usize];
        if !position.iter().all(|c| c.is_finite()) {
            return Err((vertex, position));
        }
    }
    Ok(())
}

impl Vertices<'_> {
    /// Adds the vertices `used` (all vertices, if it is empty) to `positions`. Returns whether all of them are finite.
    fn read(
        &self,
        used: &[u32],
        skin: Option<&SkinPose>,
        positions: &mut Vec<[f32; 3]>,
    ) -> Result<bool, Fault> {
        let mut all_finite = true;
        let count = if used.is_empty() { self.positions.len() } else { used.len() };
        positions.reserve(count);
        for at in 0..count {
            let vertex = used.get(at).map_or(at, |&vertex| vertex as usize);
            let mut position = DVec3::from_array(self.positions.get(vertex));
            for (weight, target) in &self.targets {
                position += *weight * DVec3::from_array(target.get(vertex));
            }
            if let Some(skin) = skin {
                position = self.skinned(vertex, position, skin)?;
            }
            let position = position.as_vec3();
            all_finite &= position.is_finite();
            positions.push(position.to_array());
        }
        Ok(all_finite)
    }

    /// Linear blend skinning (glTF 2.0, section 3.7.3.3): the weighted mean of the positions that the joints give the vertex.
    fn skinned(&self, vertex: usize, position: DVec3, skin: &SkinPose) -> Result<DVec3, Fault> {
        let (mut sum, mut total) = (DVec3::ZERO, 0.0);
        for (joints, weights) in &self.joints_and_weights {
            let (joints, weights) = (joints.get::<4>(vertex), weights.get::<4>(vertex));
            for (joint, weight) in joints.into_iter().zip(weights).filter(|&(_, weight)| weight != 0.0) {
                let matrix = skin.matrices.get(joint as usize).ok_or_else(|| {
                    let problem = format!(
                        "vertex {vertex} hangs on joint {joint}, but the skin has {}",
                        counted(skin.matrices.len() as u64, "joint")
                    );
                    Fault::new("JOINTS", problem)
                })?;
                sum += weight * matrix.transform_point3(position);
                total += weight;
            }
        }
        if total == 0.0 {
            // No joint holds the vertex. Graphics cards and other readers take the first joint.
            return Ok(skin.matrices[0].transform_point3(position) - skin.origin);
        }
        Ok(sum / total - skin.origin)
    }
}

impl LeftOut {
    /// The warnings for the user.
    pub fn notices(&self) -> Vec<Notice> {
        let warnings = [
            (self.points_and_lines, "beams do not hit points and lines, which are left out"),
            (self.without_positions, "a primitive without POSITION is left out"),
            (self.incomplete, "one or two indices after the last triangle are left out"),
        ];
        let warnings = warnings.into_iter().filter(|(count, _)| *count > 0);
        warnings
            .map(|(count, what)| Notice::warning("", format!("{what} ({})", counted(count, "primitive"))))
            .collect()
    }
}
