//! Scenes of meshes that a program has in memory, as arrays of vertices and triangles.

use std::sync::Arc;

use glam::DVec3;

use super::arrangement::{Arrangement, Placement, Scene};
use super::bounds::Bounds;
use super::build::centre_of;
use super::flatten::{is_degenerate, rounded};
use super::geometry::{Geometry, Mesh, Object, Part};
use super::material::Material;
use super::source::{SceneBuildError, SceneBuilder};

/// A mesh as a program has it in memory.
#[derive(Clone, Copy, Debug)]
pub struct MeshArrays<'a> {
    /// The vertices, in the world.
    pub vertices: Vertices<'a>,
    /// Indices into the vertices, counter-clockwise seen from the front.
    pub triangles: &'a [[u32; 3]],
}

/// The vertices of a [`MeshArrays`], metres.
#[derive(Clone, Copy, Debug)]
pub enum Vertices<'a> {
    /// Of 32 bits, which are traced as they are.
    F32(&'a [[f32; 3]]),
    /// Of 64 bits. If each of them is a number of 32 bits, they are traced as they are. Otherwise they are rounded to 32 bits about
    /// the middle of all meshes, which moves them by up to half an ulp of the distance from there.
    F64(&'a [[f64; 3]]),
}

impl Vertices<'_> {
    fn len(&self) -> usize {
        match self {
            Self::F32(all) => all.len(),
            Self::F64(all) => all.len(),
        }
    }

    #[inline]
    fn get(&self, index: u32) -> DVec3 {
        match self {
            Self::F32(all) => DVec3::from_array(all[index as usize].map(f64::from)),
            Self::F64(all) => DVec3::from_array(all[index as usize]),
        }
    }
}

/// Which triangle of which mesh each triangle of mesh 0 of a scene is, if the scene was made by [`Scene::of_arrays`].
#[derive(Clone, Debug, Default)]
pub struct SourceTriangles {
    /// The first triangle of each mesh among those that are stored.
    first: Vec<u32>,
    /// For each triangle that is stored its index in its mesh, if any was left out.
    index: Option<Vec<u32>>,
}

impl SourceTriangles {
    /// The mesh and the index in it of a triangle that is stored.
    #[inline]
    pub fn of(&self, stored: u32) -> (u32, u32) {
        let mesh = match self.first.len() {
            1 => 0,
            _ => self.first.partition_point(|&first| first <= stored) - 1,
        };
        let index = match &self.index {
            Some(index) => index[stored as usize],
            None => stored - self.first[mesh],
        };
        (mesh as u32, index)
    }
}

impl Scene {
    /// Checks a mesh as [`Scene::of_arrays`] does.
    ///
    /// # Errors
    /// The same, where the number of the mesh is 0.
    pub fn check_arrays(mesh: &MeshArrays) -> Result<(), SceneBuildError> {
        survey(std::slice::from_ref(mesh)).map(|_| ())
    }

    /// The scene of some meshes, each of which is an object, and where its triangles come from. Triangles of zero area are left out,
    /// because no ray passes through one. Without a triangle, every ray misses the scene.
    ///
    /// # Errors
    /// [`SceneBuildError::NoVertex`] if a triangle has a corner that is no vertex, [`SceneBuildError::TooFar`] (with the number of the
    /// mesh) if a triangle's vertex is not finite or too far away, and [`SceneBuildError::TooManyTriangles`].
    pub fn of_arrays(meshes: &[MeshArrays]) -> Result<(Self, SourceTriangles), SceneBuildError> {
        let count: u64 = meshes.iter().map(|mesh| mesh.triangles.len() as u64).sum();
        let vertices: u64 = meshes.iter().map(|mesh| mesh.vertices.len() as u64).sum();
        if count.max(vertices) > u64::from(u32::MAX) {
            return Err(SceneBuildError::TooManyTriangles { count: count.max(vertices) });
        }
        let (bounds, is_short) = survey(meshes)?;
        let centre = if is_short { DVec3::ZERO } else { centre_of(&bounds) };
        let (mesh, index, first) = store(meshes, centre, count as usize);
        let geometry = Geometry {
            centre,
            regions: 1,
            objects: vec![Object::default(); meshes.len()],
            materials: vec![Material::default()],
            triangle_ids: mesh.triangles.len() as u32,
            skipped_triangles: count - mesh.triangles.len() as u64,
            meshes: vec![mesh],
            ..Geometry::default()
        };
        let arrangement = Arrangement { placements: vec![Placement::FIXED], ..Arrangement::default() };
        let index = (geometry.skipped_triangles > 0).then_some(index);
        let scene =
            Self { geometry: Arc::new(geometry), arrangement: Arc::new(arrangement), ..Self::default() };
        Ok((scene, SourceTriangles { first, index }))
    }
}

/// The bounds of the vertices that triangles use, all of which are checked, and whether each coordinate is a number of 32 bits.
fn survey(meshes: &[MeshArrays]) -> Result<(Bounds, bool), SceneBuildError> {
    let (mut bounds, mut is_short) = (Bounds::EMPTY, true);
    for (number, mesh) in meshes.iter().enumerate() {
        for (triangle, corners) in mesh.triangles.iter().enumerate() {
            for &vertex in corners {
                if vertex as usize >= mesh.vertices.len() {
                    let vertices = mesh.vertices.len();
                    return Err(SceneBuildError::NoVertex { mesh: number, triangle, vertex, vertices });
                }
                let position = mesh.vertices.get(vertex);
                SceneBuilder::check_reach(position, number)?;
                bounds = bounds.with(position);
                is_short = is_short && rounded(position).1 == 0.0;
            }
        }
    }
    Ok((bounds, is_short))
}

/// All triangles with an area in one mesh, the index of each in its own mesh, and the first of each mesh.
fn store(meshes: &[MeshArrays], centre: DVec3, most: usize) -> (Mesh, Vec<u32>, Vec<u32>) {
    let (mut stored, mut index, mut first) = (Mesh::default(), Vec::with_capacity(most), Vec::new());
    stored.triangles.reserve_exact(most);
    for (number, mesh) in meshes.iter().enumerate() {
        let first_vertex = stored.positions.len() as u32;
        let first_triangle = stored.triangles.len() as u32;
        first.push(first_triangle);
        let mut positions: Vec<[f32; 3]> = match mesh.vertices {
            Vertices::F32(all) if centre == DVec3::ZERO => all.to_vec(),
            ref other => (0..other.len() as u32).map(|v| rounded(other.get(v) - centre).0).collect(),
        };
        for (triangle, &corners) in mesh.triangles.iter().enumerate() {
            if !is_degenerate(corners.map(|v| positions[v as usize])) {
                stored.triangles.push(corners.map(|v| first_vertex + v));
                index.push(triangle as u32);
            }
        }
        // What no triangle uses may be anything, and nothing that looks at all vertices shall meet it.
        positions.iter_mut().filter(|p| p.iter().any(|c| !in_reach(*c))).for_each(|p| *p = [0.0; 3]);
        stored.positions.append(&mut positions);
        if stored.triangles.len() as u32 > first_triangle {
            stored.parts.push(Part { first_triangle, material: 0, object: number as u32 });
        }
    }
    (stored, index, first)
}

fn in_reach(coordinate: f32) -> bool {
    f64::from(coordinate).abs() <= SceneBuilder::MAX_COORDINATE_M
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::{Cast, Hit, Origins, Rays, Tracer};

    const SQUARE: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];

    fn down(scene: &Scene, x: f64, y: f64, z: f64) -> Option<Hit> {
        let directions = [DVec3::NEG_Z];
        let rays = Rays::unlimited(Origins::Common(DVec3::new(x, y, z)), &directions);
        let mut hits = [None];
        Tracer::build(scene).cast(&rays, &mut hits);
        hits[0]
    }

    #[test]
    fn triangles_keep_their_numbers_where_others_have_no_area() {
        let low = MeshArrays {
            vertices: Vertices::F32(&SQUARE),
            triangles: &[[0, 0, 1], [0, 1, 2], [1, 1, 1], [0, 2, 3]],
        };
        let raised = SQUARE.map(|[x, y, _]| [x + 5.0, y, 2.0]);
        let high =
            MeshArrays { vertices: Vertices::F32(&raised), triangles: &[[1, 2, 1], [0, 1, 2], [0, 2, 3]] };
        let (scene, sources) = Scene::of_arrays(&[low, high]).unwrap();
        assert_eq!((scene.geometry.skipped_triangles, scene.geometry.centre), (3, DVec3::ZERO));
        for (x, y, expected) in
            [(0.7, 0.2, (0, 1)), (0.2, 0.7, (0, 3)), (5.7, 0.2, (1, 1)), (5.2, 0.7, (1, 2))]
        {
            let hit = down(&scene, x, y, 4.0).unwrap();
            assert_eq!(sources.of(hit.triangle), expected);
            assert_eq!(scene.surface(hit.placement, hit.triangle).object, expected.0);
        }
    }

    #[test]
    fn vertices_of_32_bits_are_traced_as_they_are() {
        // About its own middle, the plane at 0.1 of f32 would be another one.
        let z = 0.1_f32;
        let low = SQUARE.map(|[x, y, _]| [x, y, z]);
        let far = SQUARE.map(|[x, y, _]| [x, y, -5000.0]);
        let triangles = &[[0, 1, 2], [0, 2, 3]];
        let wide = low.map(|p| p.map(f64::from));
        for vertices in [Vertices::F32(&low), Vertices::F64(&wide)] {
            let meshes =
                [MeshArrays { vertices, triangles }, MeshArrays { vertices: Vertices::F32(&far), triangles }];
            let (scene, _) = Scene::of_arrays(&meshes).unwrap();
            assert_eq!(down(&scene, 0.7, 0.2, 1.0).unwrap().t, 1.0 - f64::from(z));
        }
    }

    #[test]
    fn vertices_of_64_bits_are_rounded_about_their_middle() {
        // Coordinates as surveyors have them, off by a tenth of a millimetre: f32 steps by half a metre there.
        let utm =
            SQUARE.map(|[x, y, _]| [f64::from(x) + 500_000.000_1, f64::from(y) + 5_400_000.0, 300.000_1]);
        let mesh = MeshArrays { vertices: Vertices::F64(&utm), triangles: &[[0, 1, 2], [0, 2, 3]] };
        let (scene, _) = Scene::of_arrays(&[mesh]).unwrap();
        let hit = down(&scene, 500_000.7, 5_400_000.2, 310.0).unwrap();
        // The half extent is 0.5 m, and the middle is off by less than a step of its own, so no coordinate exceeds 1 m: half an ulp
        // is 2⁻²⁵ m.
        assert!((hit.t - 9.999_9).abs() <= f64::from(f32::EPSILON) / 4.0 + 1e-12, "{}", hit.t);
    }

    #[test]
    fn wrong_arrays_are_refused_and_empty_ones_are_missed() {
        let mesh = |triangles| MeshArrays { vertices: Vertices::F32(&SQUARE), triangles };
        let error = Scene::of_arrays(&[mesh(&[[0, 1, 2]]), mesh(&[[0, 1, 2], [0, 1, 4]])]).unwrap_err();
        assert_eq!(error, SceneBuildError::NoVertex { mesh: 1, triangle: 1, vertex: 4, vertices: 4 });
        let infinite = SQUARE.map(|[x, y, _]| [x, y, f32::INFINITY]);
        let broken = MeshArrays { vertices: Vertices::F32(&infinite), triangles: &[[0, 1, 2]] };
        assert!(matches!(Scene::of_arrays(&[broken]), Err(SceneBuildError::TooFar { instance: 0, .. })));
        // A vertex that nothing uses may be anything.
        let mut spare = SQUARE;
        spare[3] = [f32::NAN; 3];
        let (scene, _) =
            Scene::of_arrays(&[MeshArrays { vertices: Vertices::F32(&spare), triangles: &[[0, 1, 2]] }])
                .unwrap();
        assert_eq!(down(&scene, 0.7, 0.2, 1.0).map(|hit| hit.t), Some(1.0));
        for meshes in [&[][..], &[mesh(&[])], &[mesh(&[[0, 1, 1]])]] {
            let (scene, _) = Scene::of_arrays(meshes).unwrap();
            assert_eq!(down(&scene, 0.7, 0.2, 1.0), None);
        }
    }
}
