//! Reads primitives as triangles: the modes, the morph targets and the skins.

use std::collections::BTreeMap;

use super::data::{Data, Elements, Layout};
use super::document::{DRACO, Document, GEOMETRY, is_harmless};
use super::draco_primitive::DracoPrimitive;
use super::fault::{Fault, missing, quoted};
use super::notices::Notices;
use super::schema::Component::{F32, I8, I16, U8, U16, U32};
use super::schema::{Accessor, Kind, Mesh, Primitive};
use super::shape::Bends;
use super::skin::SkinPose;
use super::textures;
use super::vertices::Vertices;
use crate::scene::corners::Corners;
use crate::scene::source::{SourceMesh, SourcePart};

const POSITION: Layout = Layout { purpose: "POSITION", kind: Kind::Vec3, components: &[(F32, false)] };
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
    Layout { purpose: "indices", kind: Kind::Scalar, components: &[(U8, false), (U16, false), (U32, false)] };
const JOINTS: Layout =
    Layout { purpose: "JOINTS", kind: Kind::Vec4, components: &[(U8, false), (U16, false)] };
const WEIGHTS: Layout =
    Layout { purpose: "WEIGHTS", kind: Kind::Vec4, components: &[(F32, false), (U8, true), (U16, true)] };

const TEXCOORD: Layout =
    Layout { purpose: "TEXCOORD", kind: Kind::Vec2, components: &[(F32, false), (U8, true), (U16, true)] };
/// KHR_mesh_quantization.
const QUANTIZED_TEXCOORD: Layout = Layout { components: QUANTIZED_POSITION.components, ..TEXCOORD };
const COLOR: Layout =
    Layout { purpose: "COLOR_0", kind: Kind::Vec4, components: &[(F32, false), (U8, true), (U16, true)] };
const COLOR_WITHOUT_ALPHA: Layout = Layout { kind: Kind::Vec3, ..COLOR };

/// What became of primitives of which nothing is hit.
#[derive(Debug, Default)]
pub(super) struct LeftOut {
    /// Whether there were points or lines.
    pub points_and_lines: bool,
    /// Whether there were primitives without positions.
    pub without_positions: bool,
}

/// The ways in which the corners of a primitive make triangles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mode {
    List,
    Strip,
    Fan,
}

/// The pose that the vertices of a mesh are brought into.
pub(super) struct Pose<'p> {
    /// The node's weights of the morph targets. Without them, the mesh's own count; a weight that is left out is 0.
    pub weights: Option<&'p [f64]>,
    /// The skin of a skinned mesh.
    pub skin: Option<&'p SkinPose>,
}

/// Reads meshes.
pub(super) struct MeshReader<'d, 'a> {
    document: &'d Document,
    data: &'d Data<'a>,
    notices: &'d Notices,
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

/// A mesh while it is read.
#[derive(Default)]
struct Reading {
    mesh: SourceMesh,
    /// The run of positions of each accessor, so that primitives that share an accessor share its positions.
    shared: BTreeMap<u32, Run>,
    /// How the vertices move, of a mesh that bends. Then the mesh has them before they do.
    bends: Option<Bends>,
}

/// A primitive, and where it gets its data from.
struct Source<'p, 'd> {
    primitive: &'p Primitive,
    /// Names the primitive in messages.
    place: &'p dyn Fn() -> String,
    draco: Option<DracoPrimitive<'d>>,
}

impl<'d, 'a> MeshReader<'d, 'a> {
    pub fn new(document: &'d Document, data: &'d Data<'a>, notices: &'d Notices) -> Self {
        Self { document, data, notices, left_out: LeftOut::default(), uses_default_material: false }
    }

    fn mesh(&self, index: u32) -> Result<&'d Mesh, Fault> {
        let meshes = &self.document.meshes;
        meshes.get(index as usize).ok_or_else(|| missing("mesh", index, meshes.len()))
    }

    /// Whether a primitive of mesh `index` lacks joints, so that it stands where its node is, though the node has a skin.
    pub fn stands_in_part(&self, index: u32) -> Result<bool, Fault> {
        let has = |primitive: &Primitive, name: &str| primitive.attributes.contains_key(name);
        let is_held = |primitive: &Primitive| has(primitive, "JOINTS_0") && has(primitive, "WEIGHTS_0");
        Ok(!self.mesh(index)?.primitives.iter().all(is_held))
    }

    /// The triangles of mesh `index` in its own space; of a skinned mesh, in the space of the skin's pose.
    pub fn read(&mut self, index: u32, pose: &Pose) -> Result<SourceMesh, Fault> {
        Ok(self.read_with(index, pose, None)?.mesh)
    }

    /// The triangles of mesh `index` in its own space, and how its vertices move. The weights of its morph targets are left to
    /// time if the pose has none.
    pub fn read_bending(&mut self, index: u32, pose: &Pose) -> Result<(SourceMesh, Bends), Fault> {
        let Reading { mesh, bends, .. } = self.read_with(index, pose, Some(Bends::default()))?;
        Ok((mesh, bends.unwrap_or_default()))
    }

    fn read_with(&mut self, index: u32, pose: &Pose, bends: Option<Bends>) -> Result<Reading, Fault> {
        let mesh = self.mesh(index)?;
        let weights = pose.weights.unwrap_or(&mesh.weights);
        let weights = if bends.is_some() && pose.weights.is_none() { None } else { Some(weights) };
        // Reading takes time in proportion to these counts, however few triangles result.
        let count = weights.map_or(0, <[f64]>::len);
        self.data.spend(mesh.primitives.len() + count, size_of::<Primitive>())?;
        let mut reading = Reading { bends, ..Reading::default() };
        for (number, primitive) in mesh.primitives.iter().enumerate() {
            let document = self.document;
            let place = move || format!("{}, primitive {number}", document.mesh_label(index));
            self.read_primitive(primitive, &place, weights, pose, &mut reading)
                .map_err(|fault| fault.within(place()))?;
        }
        Ok(reading)
    }

    fn read_primitive(
        &mut self,
        primitive: &Primitive,
        place: &dyn Fn() -> String,
        weights: Option<&[f64]>,
        pose: &Pose,
        reading: &mut Reading,
    ) -> Result<(), Fault> {
        let mode = match primitive.mode.unwrap_or(4) {
            4 => Mode::List,
            5 => Mode::Strip,
            6 => Mode::Fan,
            0..=3 => {
                self.left_out.points_and_lines = true;
                self.notices.warn(place, "beams do not hit points and lines, which are left out");
                return Ok(());
            }
            other => {
                let problem = format!("its mode {other} is none that glTF knows");
                return Err(Fault::new("", problem).help("0 to 6"));
            }
        };
        let Some(&position_accessor) = primitive.attributes.get("POSITION") else {
            self.left_out.without_positions = true;
            self.notices.warn(place, "it has no POSITION, and is left out");
            return Ok(());
        };
        let source = self.source(primitive, place, position_accessor)?;
        let vertices = self.vertices(&source, position_accessor, weights, pose.skin.is_some())?;
        let vertex_count = vertices.positions.len();
        let (mode, indices) = match (&source.draco, primitive.indices) {
            (Some(draco), _) => (Mode::List, Some(draco.indices())),
            (None, Some(accessor)) => {
                let indices = self.data.elements(accessor, &INDICES, None);
                (mode, Some(indices.map_err(|fault| fault.within("indices"))?))
            }
            (None, None) => (mode, None),
        };
        let mut triangles = self.triangles(mode, indices.as_ref(), vertex_count, place)?;
        if triangles.is_empty() {
            return Ok(());
        }
        let material = self.material(primitive, place);
        let corners = self.corners(&source, material, vertex_count, &triangles)?;

        let Reading { mesh, shared, bends } = reading;
        let sharable =
            vertices.targets.is_empty() && pose.skin.is_none() && source.draco.is_none() && bends.is_none();
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
                // Each vertex is moved by each target and by each set of joints.
                let moves = vertices.targets.len() + 4 * vertices.joints_and_weights.len();
                self.data.spend(count.saturating_mul(moves), size_of::<[f32; 3]>())?;
                let base = mesh.positions.len();
                if base + count > u32::MAX as usize {
                    return Err(Fault::new("", "the mesh has more than 2³² vertices"));
                }
                let all_finite = match bends {
                    None => vertices.read(&used, pose, &mut mesh.positions)?,
                    Some(bends) => {
                        self.data.spend(count.saturating_mul(moves), Bends::BYTES_A_MOVE)?;
                        bends.add(&vertices, &used, pose.skin, &mut mesh.positions)?
                    }
                };
                let run = Run { base: base as u32, all_finite };
                if sharable && !is_sparsely_used {
                    shared.insert(position_accessor, run);
                }
                run
            }
        };
        if !all_finite {
            check_finite(&triangles, &mesh.positions[base as usize..]).map_err(|(vertex, p)| {
                let vertex = used.get(vertex as usize).copied().unwrap_or(vertex);
                Fault::new(format!("accessor {position_accessor}"), format!("vertex {vertex} lies at {p:?}"))
                    .help("a coordinate is a finite number of metres")
            })?;
        }
        if base > 0 {
            triangles.iter_mut().flatten().for_each(|vertex| *vertex += base);
        }
        mesh.parts.push(SourcePart { triangles, material, corners });
        Ok(())
    }

    /// Where the primitive gets its data from: its accessors if they have any, else the extension that has. What has data
    /// that can't be read is refused, since it would be missing in silence.
    fn source<'p>(
        &self,
        primitive: &'p Primitive,
        place: &'p dyn Fn() -> String,
        positions: u32,
    ) -> Result<Source<'p, 'd>, Fault> {
        let mut accessors = [Some(positions), primitive.indices].into_iter().flatten();
        if accessors.all(|accessor| self.data.has_data(accessor)) {
            return Ok(Source { primitive, place, draco: None });
        }
        if let Some(extension) = primitive.extensions.get(DRACO) {
            let draco = DracoPrimitive::of(extension.get(), self.data).map_err(|fault| {
                let help = "`npx @gltf-transform/cli copy in.glb out.glb` writes it uncompressed";
                fault.within(DRACO).help(help)
            })?;
            return Ok(Source { primitive, place, draco: Some(draco) });
        }
        let mut others = primitive.extensions.keys().map(String::as_str);
        if let Some(other) = others.find(|name| !GEOMETRY.contains(name) && !is_harmless(name)) {
            let problem =
                format!("its data are in the extension {}, which beamcast does not read", quoted(other));
            return Err(Fault::new("", problem).help("export the file without it"));
        }
        self.notices.warn(place, "an accessor of it has no data: its vertices or indices are all zero");
        Ok(Source { primitive, place, draco: None })
    }

    /// The number of the primitive's material.
    fn material(&mut self, primitive: &Primitive, place: &dyn Fn() -> String) -> u32 {
        let materials = &self.document.materials;
        match primitive.material {
            Some(index) if (index as usize) < materials.len() => return index,
            Some(_) => self.notices.warn(place, "its material does not exist: it has the default material"),
            None => {}
        }
        self.uses_default_material = true;
        materials.len() as u32
    }

    /// The elements of an attribute. It is in the stream or, if the stream lacks it, in its accessor.
    fn elements(
        &self,
        source: &Source<'_, 'd>,
        name: &str,
        accessor: u32,
        layout: &Layout,
        count: Option<usize>,
    ) -> Result<Elements<'d>, Fault> {
        if let Some(draco) = &source.draco {
            let accessor = self.document.accessors.get(accessor as usize);
            let is_normalized = accessor.is_some_and(|accessor| accessor.normalized);
            let decoded = draco
                .attribute(name, layout.kind.components(), is_normalized)
                .map_err(|fault| fault.within(DRACO))?;
            if let Some(decoded) = decoded {
                return Ok(decoded);
            }
        }
        self.data.elements(accessor, layout, count)
    }

    /// The texture coordinates and colours of the corners of `triangles`, as far as the material needs them. Those that can't be
    /// read are missing, with a warning, and the geometry is read in spite of it.
    fn corners(
        &self,
        source: &Source<'_, 'd>,
        material: u32,
        vertex_count: usize,
        triangles: &[[u32; 3]],
    ) -> Result<Corners, Fault> {
        let Source { primitive, place, .. } = source;
        let uv_layout = if self.document.is_quantized { QUANTIZED_TEXCOORD } else { TEXCOORD };
        let read = |name: &str, accessor: u32, layout: &Layout, instead: &str| {
            let elements = self.elements(source, name, accessor, layout, Some(vertex_count));
            elements
                .map_err(|Fault { element, problem, .. }| {
                    let place = || format!("{}, {element}", place());
                    self.notices.warn(place, format!("{problem}, and {name} is not read: {instead}"));
                })
                .ok()
        };
        let material = self.document.materials.get(material as usize);
        let sets = material.map_or(Vec::new(), textures::uv_sets);
        let of_set = |set: &u32| {
            let name = format!("TEXCOORD_{set}");
            match primitive.attributes.get(&name) {
                Some(&accessor) => read(&name, accessor, &uv_layout, "a texture counts as white there"),
                None => {
                    let message =
                        format!("it has no {name}: a texture of its material counts as white there");
                    self.notices.warn(place, message);
                    None
                }
            }
        };
        let mut uvs: Vec<Option<Elements>> = sets.iter().map(of_set).collect();
        if uvs.iter().all(Option::is_none) {
            uvs.clear();
        }
        let colors = primitive.attributes.get("COLOR_0").and_then(|&accessor| {
            let has_alpha = |accessor: &Accessor| accessor.kind != COLOR_WITHOUT_ALPHA.kind.name();
            let has_alpha = self.document.accessors.get(accessor as usize).is_none_or(has_alpha);
            let layout = if has_alpha { &COLOR } else { &COLOR_WITHOUT_ALPHA };
            let colors = read("COLOR_0", accessor, layout, "the material's colour alone counts")?;
            let of_vertex = move |vertex: u32| -> [f64; 4] {
                if has_alpha {
                    return colors.get(vertex as usize);
                }
                let [r, g, b] = colors.get(vertex as usize);
                [r, g, b, 1.0]
            };
            // Many exporters write colours that are all white.
            triangles.as_flattened().iter().any(|&vertex| of_vertex(vertex) != [1.0; 4]).then_some(of_vertex)
        });
        let mut corners = Corners::new(uvs.len(), colors.is_some());
        if corners.triangle_bytes() == 0 {
            return Ok(corners);
        }
        self.data.spend(triangles.len(), corners.triangle_bytes())?;
        corners.reserve(triangles.len());
        let mut of_corner = vec![[f32::NAN; 2]; uvs.len()];
        for &vertex in triangles.as_flattened() {
            for (uv, elements) in of_corner.iter_mut().zip(&uvs) {
                if let Some(elements) = elements {
                    *uv = elements.get::<2>(vertex as usize).map(|c| c as f32);
                }
            }
            let color = colors.as_ref().map_or([1.0; 4], |of_vertex| of_vertex(vertex));
            corners.push(&of_corner, color.map(|c| c as f32));
        }
        Ok(corners)
    }

    fn vertices(
        &self,
        source: &Source<'_, 'd>,
        positions: u32,
        weights: Option<&[f64]>,
        is_skinned: bool,
    ) -> Result<Vertices<'d>, Fault> {
        let Source { primitive, place, draco } = source;
        let quantized = self.document.is_quantized;
        let (position, displacement) =
            if quantized { (QUANTIZED_POSITION, QUANTIZED_DISPLACEMENT) } else { (POSITION, DISPLACEMENT) };
        let elements = |name: &str, accessor: u32, layout: &Layout, count: Option<usize>| {
            self.elements(source, name, accessor, layout, count)
        };
        let positions =
            elements("POSITION", positions, &position, draco.as_ref().map(DracoPrimitive::points))?;
        let count = Some(positions.len());
        let mut vertices = Vertices { positions, targets: Vec::new(), joints_and_weights: Vec::new() };
        for (number, target) in primitive.targets.iter().enumerate() {
            let weight = weights.map(|weights| weights.get(number).copied().unwrap_or(0.0));
            if let Some(accessor) = target.position
                && weight != Some(0.0)
            {
                let elements = self
                    .data
                    .elements(accessor, &displacement, count)
                    .map_err(|fault| fault.within(format!("target {number}")))?;
                vertices.targets.push((number, weight, elements));
            }
        }
        if !is_skinned {
            return Ok(vertices);
        }
        for set in 0.. {
            let [joints_name, weights_name] = [format!("JOINTS_{set}"), format!("WEIGHTS_{set}")];
            let joints = primitive.attributes.get(&joints_name);
            let Some((&joints, &weights)) = joints.zip(primitive.attributes.get(&weights_name)) else {
                break;
            };
            vertices.joints_and_weights.push((
                elements(&joints_name, joints, &JOINTS, count)?,
                elements(&weights_name, weights, &WEIGHTS, count)?,
            ));
        }
        if vertices.joints_and_weights.is_empty() {
            let message =
                "its node has a skin, but it has no JOINTS_0 and WEIGHTS_0: it stands where its node is";
            self.notices.warn(place, message);
        }
        Ok(vertices)
    }

    /// The triangles of a primitive as indices into its vertices, all of which are in bounds.
    fn triangles(
        &self,
        mode: Mode,
        indices: Option<&Elements>,
        vertex_count: usize,
        place: &dyn Fn() -> String,
    ) -> Result<Vec<[u32; 3]>, Fault> {
        let corners = indices.map_or(vertex_count, Elements::len);
        let count = if mode == Mode::List { corners / 3 } else { corners.saturating_sub(2) };
        if mode == Mode::List && !corners.is_multiple_of(3) {
            self.notices.warn(place, "one or two indices after its last triangle are left out");
        }
        self.data.spend(count, size_of::<[u32; 3]>())?;
        let index = |at: usize| indices.map_or(at as u32, |indices| indices.integer(at));
        // In graphics APIs the largest integer of an index type restarts a primitive. glTF forbids it, but for an extension.
        let largest = indices.map(Elements::largest_integer);
        let restarts = mode != Mode::List && self.document.restarts;
        let mut triangles = Vec::with_capacity(count);
        let (mut first, mut bad, mut takes_largest) = (0, None, false);
        for at in 0..corners {
            let value = index(at);
            if restarts && Some(value) == largest {
                first = at + 1;
                continue;
            }
            if value as usize >= vertex_count {
                bad.get_or_insert((at, value));
            }
            takes_largest |= Some(value) == largest;
            let done = at - first;
            match mode {
                Mode::List if done % 3 == 2 => triangles.push([index(at - 2), index(at - 1), value]),
                // Every other triangle of a strip is turned, so that all face the same way.
                Mode::Strip if done >= 2 && done % 2 == 0 => {
                    triangles.push([index(at - 2), index(at - 1), value]);
                }
                Mode::Strip if done >= 2 => triangles.push([index(at - 2), value, index(at - 1)]),
                Mode::Fan if done >= 2 => triangles.push([index(at - 1), value, index(first)]),
                _ => {}
            }
        }
        match bad {
            None => {
                if takes_largest {
                    let message = "the largest integer of its indices' type is taken as an index, since there is such a \
                                   vertex; glTF leaves it out";
                    self.notices.warn(place, message);
                }
                Ok(triangles)
            }
            Some((at, value)) if Some(value) == largest => {
                let problem = format!("number {at} is {value}, which restarts a primitive");
                Err(Fault::new("indices", problem).help(
                    "glTF has that for strips and fans with EXT_mesh_primitive_restart among the extensionsUsed; else \
                     make several primitives",
                ))
            }
            Some((at, value)) => {
                let problem = format!("number {at} is {value}, but the number of vertices is {vertex_count}");
                Err(Fault::new("indices", problem).help("indices count from 0"))
            }
        }
    }
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
    fn read(&self, used: &[u32], pose: &Pose, positions: &mut Vec<[f32; 3]>) -> Result<bool, Fault> {
        let mut all_finite = true;
        positions.reserve(self.numbers(used).count());
        for vertex in self.numbers(used) {
            let mut position = self.position(vertex);
            if let Some(skin) = pose.skin {
                position = if self.joints_and_weights.is_empty() {
                    skin.stand.transform_point3(position) - skin.origin
                } else {
                    skin.posed(vertex, position, self.influences(vertex))?
                };
            }
            let position = position.as_vec3();
            all_finite &= position.is_finite();
            positions.push(position.to_array());
        }
        Ok(all_finite)
    }
}
