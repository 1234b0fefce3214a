//! From meshes and where they are placed to a [`Scene`]: one space, one numbering.

use std::sync::Arc;

use glam::{DAffine3, DVec3};

use super::arrangement::{Arrangement, Placement, Scene, crushes_to_a_line, is_invertible};
use super::geometry::{Geometry, Mesh, Object, Part, SourceFile};
use super::material::Material;

/// Meshes and where they are placed, in document order; [`SceneBuilder::build`] makes a scene of them.
#[derive(Clone, Debug, Default)]
pub struct SceneBuilder {
    /// The meshes, each in its own space.
    pub meshes: Vec<SourceMesh>,
    /// The places of the meshes, in document order.
    pub instances: Vec<SourceInstance>,
    /// The materials.
    pub materials: Vec<Material>,
    /// The files that all of it was read from.
    pub files: Vec<SourceFile>,
}

/// A mesh as its file gives it.
#[derive(Clone, Debug, Default)]
pub struct SourceMesh {
    /// Vertices, metres. The vertices that triangles use must be finite.
    pub positions: Vec<[f32; 3]>,
    /// The triangles, by material.
    pub parts: Vec<SourcePart>,
}

/// Triangles of one material.
#[derive(Clone, Debug, Default)]
pub struct SourcePart {
    /// Indices into [`SourceMesh::positions`], which must be in bounds; counter-clockwise seen from the front.
    pub triangles: Vec<[u32; 3]>,
    /// Index into [`SceneBuilder::materials`].
    pub material: u32,
}

/// A mesh at a place.
#[derive(Clone, Debug)]
pub struct SourceInstance {
    /// Index into [`SceneBuilder::meshes`].
    pub mesh: usize,
    /// Any affine map. A mirroring map keeps the fronts of triangles in front.
    pub world_from_mesh: DAffine3,
    /// The object that the mesh is at this place.
    pub object: Object,
}

/// The reason why meshes and their places make no scene.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SceneBuildError {
    /// There is nothing to hit.
    #[error("the scene has no triangles")]
    Empty {
        /// The number of triangles that were left out because their area is zero.
        skipped: u64,
    },
    /// There are more triangles than 32-bit ids.
    #[error(
        "the scene has {count} triangles (each counted as often as it is placed), more than {}",
        u32::MAX
    )]
    TooManyTriangles {
        /// The number of triangles.
        count: u64,
    },
    /// A vertex lies at infinity, or further out than [`SceneBuilder::MAX_COORDINATE_M`].
    #[error(
        "a vertex lies at ({:e}, {:e}, {:e}) m, further than {:e} m from the middle",
        position.x, position.y, position.z,
        SceneBuilder::MAX_COORDINATE_M
    )]
    TooFar {
        /// Index into [`SceneBuilder::instances`].
        instance: usize,
        /// The vertex's position.
        position: DVec3,
    },
}

impl SceneBuilder {
    /// The largest coordinate, in the scene's space and in each mesh's own. The product of three such coordinates does not
    /// overflow f64, and the product of two (an area, which the BVH's builder compares) does not overflow f32.
    pub const MAX_COORDINATE_M: f64 = 1e12;

    /// Makes the scene: finds its centre, flattens the meshes that are placed once into mesh 0, rounds to f32, and leaves
    /// out triangles of zero area.
    pub fn build(mut self) -> Result<Scene, SceneBuildError> {
        let mut uses = vec![0_u32; self.meshes.len()];
        for instance in &self.instances {
            uses[instance.mesh] = uses[instance.mesh].saturating_add(1);
        }
        // A map without a precise inverse (a scale of zero along an axis) leaves no space of its own to trace in.
        let is_shared = |i: &SourceInstance| uses[i.mesh] > 1 && is_invertible(&i.world_from_mesh);

        let centre = self.centre(&is_shared)?;
        let mut skipped_triangles = 0;
        let mut flat = Mesh::default();
        let mut shared = Vec::new();
        for (index, instance) in self.instances.iter().enumerate() {
            if crushes_to_a_line(&instance.world_from_mesh) {
                // Scaling to nothing is a way to hide an object. It costs no memory, however many objects are hidden so.
                skipped_triangles += self.meshes[instance.mesh].triangle_count();
            } else if is_shared(instance) {
                shared.push(index);
            } else {
                let source = &mut self.meshes[instance.mesh];
                let from_mesh = DAffine3::from_translation(-centre) * instance.world_from_mesh;
                skipped_triangles += flatten(source, &from_mesh, index, &mut flat)?;
                if uses[instance.mesh] == 1 {
                    *source = SourceMesh::default(); // Frees its memory, which is not needed again.
                }
            }
        }
        let mut next_triangle = flat.triangles.len() as u64;
        let mut meshes = vec![flat];
        let mut placements = vec![Placement::FIXED];

        // The stored mesh of each source mesh that is shared, and the number of triangles that were left out of it.
        let mut stored = vec![None; self.meshes.len()];
        for index in shared {
            let instance = &self.instances[index];
            let (mesh, skipped) = match stored[instance.mesh] {
                Some(known) => known,
                None => {
                    let mut mesh = Mesh::default();
                    let source = std::mem::take(&mut self.meshes[instance.mesh]);
                    let skipped = keep(source, index, &mut mesh)?;
                    meshes.push(mesh);
                    *stored[instance.mesh].insert(((meshes.len() - 1) as u32, skipped))
                }
            };
            skipped_triangles += skipped;
            let count = meshes[mesh as usize].triangles.len() as u64;
            if count == 0 {
                continue;
            }
            if next_triangle + count > u64::from(u32::MAX) {
                return Err(SceneBuildError::TooManyTriangles { count: next_triangle + count });
            }
            let scene_from_mesh = DAffine3::from_translation(-centre) * instance.world_from_mesh;
            placements.push(Placement::new(mesh, next_triangle as u32, index as u32, scene_from_mesh));
            next_triangle += count;
        }
        if next_triangle > u64::from(u32::MAX) {
            return Err(SceneBuildError::TooManyTriangles { count: next_triangle });
        }
        if next_triangle == 0 {
            return Err(SceneBuildError::Empty { skipped: skipped_triangles });
        }
        let geometry = Geometry {
            centre,
            meshes,
            objects: self.instances.into_iter().map(|instance| instance.object).collect(),
            materials: self.materials,
            skipped_triangles,
            files: self.files,
        };
        Ok(Scene { geometry: Arc::new(geometry), arrangement: Arc::new(Arrangement { placements }) })
    }

    /// The middle of the bounds of all triangles (for a shared mesh: of the corners of its own bounds), rounded to a
    /// multiple of a power of two that is at most a sixteenth of the largest half extent. So vertices with short
    /// coordinates, as people and exporters write them, are stored exactly, and a scene that is centred on its own origin
    /// stays there.
    fn centre(&self, is_shared: &dyn Fn(&SourceInstance) -> bool) -> Result<DVec3, SceneBuildError> {
        let mut own_bounds = vec![None; self.meshes.len()];
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let (mut farthest, mut farthest_instance) = (DVec3::ZERO, 0);
        for (index, instance) in self.instances.iter().enumerate() {
            if crushes_to_a_line(&instance.world_from_mesh) {
                continue;
            }
            let mesh = &self.meshes[instance.mesh];
            let mut include = |p: DVec3| {
                let p = instance.world_from_mesh.transform_point3(p);
                (low, high) = (low.min(p), high.max(p));
                if p.abs().max_element() > farthest.abs().max_element() {
                    (farthest, farthest_instance) = (p, index);
                }
                if p.is_finite() {
                    Ok(())
                } else {
                    Err(SceneBuildError::TooFar { instance: index, position: p })
                }
            };
            if is_shared(instance) {
                let (a, b) = *own_bounds[instance.mesh].get_or_insert_with(|| mesh.bounds());
                if a.x <= b.x {
                    for corner in 0..8 {
                        let side = |axis: usize| if corner >> axis & 1 == 0 { a[axis] } else { b[axis] };
                        include(DVec3::new(side(0), side(1), side(2)))?;
                    }
                }
            } else {
                for p in mesh.corners() {
                    include(p)?;
                }
            }
        }
        if low.x > high.x {
            return Ok(DVec3::ZERO);
        }
        let half_extent = ((high - low) / 2.0).max_element();
        if half_extent > Self::MAX_COORDINATE_M {
            return Err(SceneBuildError::TooFar { instance: farthest_instance, position: farthest });
        }
        let grid = power_of_two_below(half_extent) / 16.0;
        let middle = low / 2.0 + high / 2.0;
        Ok(if grid > 0.0 && grid.is_finite() { (middle / grid).round() * grid } else { middle })
    }
}

impl SourceMesh {
    fn triangle_count(&self) -> u64 {
        self.parts.iter().map(|part| part.triangles.len() as u64).sum()
    }

    /// The positions of the triangles' corners, triangle by triangle.
    fn corners(&self) -> impl Iterator<Item = DVec3> + '_ {
        let triangles = self.parts.iter().flat_map(|part| part.triangles.iter());
        triangles.flatten().map(|&v| f64_from(self.positions[v as usize]))
    }

    fn bounds(&self) -> (DVec3, DVec3) {
        let empty = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        self.corners().fold(empty, |(low, high), p| (low.min(p), high.max(p)))
    }
}

/// The largest power of two that is at most `x`; 0 for 0.
fn power_of_two_below(x: f64) -> f64 {
    f64::from_bits(x.to_bits() & 0x7ff0_0000_0000_0000)
}

fn f64_from(p: [f32; 3]) -> DVec3 {
    DVec3::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]))
}

/// Whether the triangle has no area. The difference of two f32 is exact in f64 unless their exponents are 29 or more apart,
/// and the products of exact differences are exact too, so this finds the triangles whose area is exactly zero.
fn is_degenerate(positions: &[[f32; 3]], triangle: [u32; 3]) -> bool {
    let [a, b, c] = triangle.map(|v| f64_from(positions[v as usize]));
    (b - a).cross(c - a) == DVec3::ZERO
}

/// Adds `source`, transformed by `from_mesh`, to `flat`. Returns the number of triangles that were left out.
fn flatten(
    source: &SourceMesh,
    from_mesh: &DAffine3,
    instance: usize,
    flat: &mut Mesh,
) -> Result<u64, SceneBuildError> {
    let base = flat.positions.len();
    let vertices = base + source.positions.len();
    if vertices > u32::MAX as usize {
        // Vertex indices are 32-bit too, and a mesh has at most as many vertices as its triangles have corners.
        return Err(SceneBuildError::TooManyTriangles { count: vertices as u64 });
    }
    flat.positions.extend(
        source.positions.iter().map(|&p| from_mesh.transform_point3(f64_from(p)).as_vec3().to_array()),
    );
    let mirrored = from_mesh.matrix3.determinant() < 0.0;
    let mut skipped = 0;
    for part in &source.parts {
        let first_triangle = flat.triangles.len() as u32;
        for &triangle in &part.triangles {
            let [a, b, c] = triangle.map(|v| v + base as u32);
            let triangle = if mirrored { [a, c, b] } else { [a, b, c] };
            check(&flat.positions, triangle, instance)?;
            if is_degenerate(&flat.positions, triangle) {
                skipped += 1;
            } else if flat.triangles.len() as u64 == u64::from(u32::MAX) {
                return Err(SceneBuildError::TooManyTriangles { count: u64::from(u32::MAX) + 1 });
            } else {
                flat.triangles.push(triangle);
            }
        }
        if flat.triangles.len() as u32 > first_triangle {
            flat.parts.push(Part { first_triangle, material: part.material, object: instance as u32 });
        }
    }
    Ok(skipped)
}

/// Makes `mesh` of `source` without transforming it. Returns the number of triangles that were left out.
fn keep(source: SourceMesh, instance: usize, mesh: &mut Mesh) -> Result<u64, SceneBuildError> {
    let mut skipped = 0;
    mesh.positions = source.positions;
    for part in &source.parts {
        let first_triangle = mesh.triangles.len() as u32;
        for &triangle in &part.triangles {
            check(&mesh.positions, triangle, instance)?;
            if is_degenerate(&mesh.positions, triangle) {
                skipped += 1;
            } else {
                mesh.triangles.push(triangle);
            }
        }
        if mesh.triangles.len() as u32 > first_triangle {
            mesh.parts.push(Part { first_triangle, material: part.material, object: 0 });
        }
    }
    Ok(skipped)
}

/// Checks that the triangle's corners are within [`SceneBuilder::MAX_COORDINATE_M`].
fn check(positions: &[[f32; 3]], triangle: [u32; 3], instance: usize) -> Result<(), SceneBuildError> {
    for v in triangle {
        let position = f64_from(positions[v as usize]);
        // The comparison is false for NaN.
        let in_reach = |c: f64| c.abs() <= SceneBuilder::MAX_COORDINATE_M;
        if !position.to_array().into_iter().all(in_reach) {
            return Err(SceneBuildError::TooFar { instance, position });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> SourceMesh {
        SourceMesh {
            positions: vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
            parts: vec![SourcePart { triangles: vec![[0, 1, 2], [0, 2, 3], [1, 1, 2]], material: 0 }],
        }
    }

    fn at(mesh: usize, world_from_mesh: DAffine3) -> SourceInstance {
        SourceInstance { mesh, world_from_mesh, object: Object::default() }
    }

    fn builder(meshes: Vec<SourceMesh>, instances: Vec<SourceInstance>) -> SceneBuilder {
        SceneBuilder { meshes, instances, materials: vec![Material::default()], files: vec![] }
    }

    fn moved(x: f64, y: f64, z: f64) -> DAffine3 {
        DAffine3::from_translation(DVec3::new(x, y, z))
    }

    #[test]
    fn a_mesh_placed_once_is_flattened_around_the_centre() {
        let far = DVec3::new(4.5e5, 5.4e6, 200.0);
        let scene = builder(vec![square()], vec![at(0, DAffine3::from_translation(far))]).build().unwrap();
        assert_eq!((scene.geometry.meshes.len(), scene.arrangement.placements.len()), (1, 1));
        assert_eq!(scene.geometry.skipped_triangles, 1);
        assert_eq!(scene.triangle_count(), 2);
        // The offset is not rounded to f32, so corners are exact.
        let corner = scene.geometry.meshes[0].positions[2];
        assert_eq!(scene.geometry.centre + f64_from(corner), far + DVec3::new(1.0, 1.0, 0.0));
        assert!(corner.iter().all(|c| c.abs() <= 0.6));
    }

    #[test]
    fn a_scene_about_its_origin_is_left_where_it_is() {
        let scene = builder(vec![square()], vec![at(0, moved(-0.5, -0.5, 0.0))]).build().unwrap();
        assert_eq!(scene.geometry.centre, DVec3::ZERO);
    }

    #[test]
    fn a_mesh_placed_twice_is_stored_once() {
        let instances =
            vec![at(0, moved(0.0, 0.0, 0.0)), at(1, moved(9.0, 0.0, 0.0)), at(0, moved(0.0, 5.0, 0.0))];
        let scene = builder(vec![square(), square()], instances).build().unwrap();
        assert_eq!(scene.geometry.meshes.len(), 2);
        assert_eq!(scene.geometry.stored_triangle_count(), 4);
        assert_eq!(scene.triangle_count(), 6);
        let firsts: Vec<_> =
            scene.arrangement.placements.iter().map(|p| (p.first_triangle, p.first_object)).collect();
        // Meshes that are placed once come first; objects keep the document's order.
        assert_eq!(firsts, [(0, 0), (2, 0), (4, 2)]);
        assert_eq!(scene.surface(0, 1).object, 1);
        assert_eq!(scene.surface(1, 1).object, 0);
        assert_eq!(scene.surface(2, 0).object, 2);
        // The mesh has one zero-area triangle, which counts each time that it is placed.
        assert_eq!(scene.geometry.skipped_triangles, 3);
    }

    #[test]
    fn mirroring_keeps_fronts_in_front() {
        let mirror = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
        let scene = builder(vec![square()], vec![at(0, mirror)]).build().unwrap();
        let mesh = &scene.geometry.meshes[0];
        let [a, b, c] = mesh.triangles[0].map(|v| f64_from(mesh.positions[v as usize]));
        assert!((b - a).cross(c - a).z > 0.0, "the square still faces up");
    }

    #[test]
    fn a_placement_that_cannot_be_undone_is_flattened() {
        let crushed = DAffine3::from_scale(DVec3::new(1.0, 1.0, 0.0));
        let scene =
            builder(vec![square()], vec![at(0, crushed), at(0, moved(0.0, 0.0, 3.0))]).build().unwrap();
        assert_eq!(scene.arrangement.placements.len(), 2);
        assert_eq!(scene.geometry.meshes[0].triangles.len(), 2);
        assert_eq!(scene.triangle_count(), 4);
        let nothing = DAffine3::from_scale(DVec3::ZERO);
        let error = builder(vec![square()], vec![at(0, nothing), at(0, nothing)]).build().unwrap_err();
        assert_eq!(error, SceneBuildError::Empty { skipped: 6 });
    }

    #[test]
    fn an_instance_scaled_to_nothing_takes_no_part() {
        // A thousand hidden instances far away change neither the centre nor the memory.
        let mut hidden = moved(1e6, 0.0, 0.0) * DAffine3::from_scale(DVec3::new(0.0, 1.0, 0.0));
        hidden.matrix3.z_axis = hidden.matrix3.y_axis;
        let mut instances = vec![at(0, hidden); 1000];
        instances.push(at(0, moved(-0.5, -0.5, 0.0)));
        let scene = builder(vec![square()], instances).build().unwrap();
        assert_eq!(scene.geometry.centre, DVec3::ZERO);
        assert_eq!((scene.triangle_count(), scene.geometry.skipped_triangles), (2, 3001));
        assert_eq!((scene.geometry.objects.len(), scene.arrangement.placements.len()), (1001, 2));
        assert!(scene.geometry.meshes[0].positions.is_empty());
        assert_eq!(scene.surface(1, 0).object, 1000);
    }

    #[test]
    fn a_vertex_too_far_away_is_refused() {
        let mut far = square();
        far.positions[2][0] = 1e13;
        let error = builder(vec![far], vec![at(0, DAffine3::IDENTITY)]).build().unwrap_err();
        assert!(matches!(error, SceneBuildError::TooFar { instance: 0, .. }), "{error}");
        let overflow = DAffine3::from_scale(DVec3::splat(f64::MAX)) * moved(9.0, 9.0, 9.0);
        let error = builder(vec![square()], vec![at(0, overflow)]).build().unwrap_err();
        assert!(matches!(error, SceneBuildError::TooFar { .. }), "{error}");
    }

    #[test]
    fn labels_are_the_jobs_then_the_files() {
        let mut scene = builder(vec![square()], vec![at(0, DAffine3::IDENTITY)]).build().unwrap();
        let surface = scene.surface(0, 0);
        assert_eq!(scene.label(surface), 0);
        Arc::make_mut(&mut scene.geometry).objects[0].file_label = Some(1);
        assert_eq!(scene.label(surface), 1);
        Arc::make_mut(&mut scene.geometry).materials[0].job_label = Some(2);
        assert_eq!(scene.label(surface), 2);
        Arc::make_mut(&mut scene.geometry).objects[0].job_label = Some(3);
        assert_eq!(scene.label(surface), 3);
    }
}
