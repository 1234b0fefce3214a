//! Meshes that are placed once: which of their triangles count, where these lie in the scene, and what storing them costs.

use std::sync::Arc;

use glam::{DAffine3, DVec3};

use super::bounds::Bounds;
use super::corners::MeshCorners;
use super::geometry::{Mesh, Part};
use super::rounding::Rounding;
use super::source::{SceneBuildError, SceneBuilder, SourceMesh};

/// A mesh at the only place where it is stored.
pub(super) struct Flattened {
    /// Index into [`SceneBuilder::instances`](super::SceneBuilder::instances).
    pub instance: usize,
    /// The bounds in the world of the triangles that have an area.
    pub bounds: Bounds,
}

impl Flattened {
    /// The bounds of a mesh's triangles that have an area, in the world.
    pub fn new(instance: usize, source: &SourceMesh, world_from_mesh: &DAffine3) -> Self {
        let solid = source.triangles().filter(|&triangle| source.has_area_under(world_from_mesh, triangle));
        let corners = solid.flatten().map(|v| world_from_mesh.transform_point3(source.position(v)));
        Self { instance, bounds: corners.fold(Bounds::EMPTY, Bounds::with) }
    }

    /// Whether a triangle takes part in the scene.
    ///
    /// A triangle without an area is nothing that a ray could hit, and must not count for where the scene lies. But exporters
    /// fill the gap between a long edge and two short ones with such a triangle, and after rounding, which moves the vertex in
    /// the middle off the long edge, it may have the area of the gap. So it stays if it adds nothing to the bounds.
    pub fn counts(&self, source: &SourceMesh, world_from_mesh: &DAffine3, triangle: [u32; 3]) -> bool {
        source.has_area_under(world_from_mesh, triangle)
            || triangle
                .iter()
                .all(|&v| self.bounds.contains(world_from_mesh.transform_point3(source.position(v))))
    }
}

/// Triangles in a common space, in document order, before their vertices are rounded to f32.
#[derive(Default)]
pub(super) struct Gathered {
    /// The vertices that triangles use.
    pub positions: Vec<DVec3>,
    pub triangles: Vec<[u32; 3]>,
    /// Runs of triangles of one material and object.
    pub runs: Vec<Part>,
    /// The texture coordinates and colours of the triangles.
    pub corners: MeshCorners,
}

impl Gathered {
    /// Forgets everything but its memory.
    pub fn clear(&mut self) {
        self.positions.clear();
        self.triangles.clear();
        self.runs.clear();
        self.corners.clear();
    }

    /// Adds a mesh, moved by −`centre` in the world. Returns the number of triangles that were left out.
    pub fn add(
        &mut self,
        flattened: &Flattened,
        source: &SourceMesh,
        world_from_mesh: &DAffine3,
        centre: DVec3,
    ) -> Result<u64, SceneBuildError> {
        let from_mesh = DAffine3::from_translation(-centre) * *world_from_mesh;
        let mirrored = from_mesh.matrix3.determinant() < 0.0;
        let first = self.triangles.len();
        let mut is_used = vec![false; source.positions.len()];
        let mut left_out = 0;
        for part in &source.parts {
            let first_triangle = self.triangles.len() as u32;
            for (index, &triangle) in part.triangles.iter().enumerate() {
                if !flattened.counts(source, world_from_mesh, triangle) {
                    left_out += 1;
                    continue;
                }
                if self.triangles.len() as u64 == u64::from(u32::MAX) {
                    return Err(SceneBuildError::TooManyTriangles { count: u64::from(u32::MAX) + 1 });
                }
                triangle.iter().for_each(|&v| is_used[v as usize] = true);
                let [a, b, c] = triangle;
                self.corners.push(self.triangles.len(), &part.corners, index, mirrored);
                self.triangles.push(if mirrored { [a, c, b] } else { [a, b, c] });
            }
            if self.triangles.len() as u32 > first_triangle {
                let object = flattened.instance as u32;
                self.runs.push(Part { first_triangle, material: part.material, object });
            }
        }
        let mut number = vec![0; is_used.len()];
        for (v, _) in is_used.into_iter().enumerate().filter(|(_, is_used)| *is_used) {
            if self.positions.len() >= u32::MAX as usize {
                // Vertex indices are 32-bit too, and a mesh has at most as many vertices as its triangles have corners.
                return Err(SceneBuildError::TooManyTriangles { count: self.positions.len() as u64 });
            }
            number[v] = self.positions.len() as u32;
            let position = from_mesh.transform_point3(source.position(v as u32));
            SceneBuilder::check_reach(position, flattened.instance)?;
            self.positions.push(position);
        }
        for triangle in &mut self.triangles[first..] {
            *triangle = triangle.map(|v| number[v as usize]);
        }
        Ok(left_out)
    }

    /// Stores some triangles, in ascending order, and the vertices that they use. `store` gives the f32 position of a vertex,
    /// and how far that is off along the worst axis. Returns the number of triangles that then have no area and are left out.
    /// `numbers` is memory to be used again.
    pub fn store(
        &self,
        triangles: impl Iterator<Item = u32>,
        store: impl Fn(u32) -> ([f32; 3], f64),
        mesh: &mut Mesh,
        rounding: &mut Rounding,
        numbers: &mut Numbers,
    ) -> u64 {
        numbers.forget(self.positions.len());
        let (mut run, mut begun) = (0, usize::MAX);
        let mut left_out = 0;
        for index in triangles {
            if self.runs.get(run + 1).is_some_and(|next| next.first_triangle <= index) {
                run = self.runs.partition_point(|run| run.first_triangle <= index) - 1;
            }
            let triangle = self.triangles[index as usize];
            let stored = triangle.map(&store);
            if is_degenerate(stored.map(|(position, _)| position)) {
                left_out += 1;
                rounding.crushed_triangles +=
                    u64::from(has_area(triangle.map(|v| self.positions[v as usize])));
                continue;
            }
            if begun != run {
                begun = run;
                mesh.parts.push(Part { first_triangle: mesh.triangles.len() as u32, ..self.runs[run] });
            }
            let corners = [0, 1, 2].map(|corner| {
                let (number, is_new) = numbers.of(triangle[corner], mesh.positions.len());
                if is_new {
                    let (position, error) = stored[corner];
                    mesh.positions.push(position);
                    if error > rounding.stored_m {
                        (rounding.stored_m, rounding.stored_object) = (error, self.runs[run].object);
                    }
                }
                number
            });
            if !self.corners.is_empty() {
                let number = mesh.triangles.len();
                Arc::make_mut(&mut mesh.corners).push_of(number, &self.corners, index as usize);
            }
            mesh.triangles.push(corners);
        }
        left_out
    }
}

/// The numbers that vertices have in a mesh that is being made.
#[derive(Default)]
pub(super) struct Numbers {
    /// `u32::MAX` for a vertex that the mesh does not have yet.
    number: Vec<u32>,
    known: Vec<u32>,
}

impl Numbers {
    /// Begins a mesh of some of `count` vertices. This takes as long as the last mesh was large.
    fn forget(&mut self, count: usize) {
        for v in self.known.drain(..) {
            self.number[v as usize] = u32::MAX;
        }
        self.number.resize(count.max(self.number.len()), u32::MAX);
    }

    /// The number of a vertex, which is `next` if it has none yet; and whether that is so.
    fn of(&mut self, vertex: u32, next: usize) -> (u32, bool) {
        let number = &mut self.number[vertex as usize];
        let is_new = *number == u32::MAX;
        if is_new {
            *number = next as u32;
            self.known.push(vertex);
        }
        (*number, is_new)
    }
}

impl SourceMesh {
    /// All triangles, in order.
    pub(super) fn triangles(&self) -> impl Iterator<Item = [u32; 3]> {
        self.parts.iter().flat_map(|part| part.triangles.iter().copied())
    }

    pub(super) fn triangle_count(&self) -> u64 {
        self.parts.iter().map(|part| part.triangles.len() as u64).sum()
    }

    pub(super) fn corners(&self, triangle: [u32; 3]) -> [[f32; 3]; 3] {
        triangle.map(|v| self.positions[v as usize])
    }

    pub(super) fn position(&self, v: u32) -> DVec3 {
        f64_from(self.positions[v as usize])
    }

    /// Whether a triangle has an area when a map was applied. (Moving a triangle does not change its area, and its corners are
    /// the more precise without that.)
    fn has_area_under(&self, map: &DAffine3, triangle: [u32; 3]) -> bool {
        has_area(triangle.map(|v| map.matrix3 * self.position(v)))
    }

    /// The vertex with the largest |coordinate| when a map was applied, among those of triangles with an area.
    pub(super) fn farthest(&self, map: &DAffine3) -> DVec3 {
        let solid = self.triangles().filter(|&triangle| self.has_area_under(map, triangle));
        let corners = solid.flatten().map(|v| map.transform_point3(self.position(v)));
        let reach = |p: &DVec3| p.abs().max_element();
        corners.max_by(|a, b| reach(a).total_cmp(&reach(b))).unwrap_or_default()
    }

    /// Half the step between neighbouring numbers of f32 at the farthest coordinate of some triangles that looks as if it had
    /// been rounded: it is no multiple of eight steps, as numbers that people choose are. The positions may be off by that much.
    pub(super) fn rounding(&self, triangles: impl Iterator<Item = [u32; 3]>) -> f64 {
        let corners = triangles.flatten().flat_map(|v| self.positions[v as usize]);
        let looks_rounded = |x: &f32| x.is_finite() && x.to_bits() & 7 != 0;
        let farthest = corners.filter(looks_rounded).fold(0.0_f32, |most, x| most.max(x.abs()));
        half_step(farthest)
    }
}

/// The most by which rounding to an f32 of this size changes a number.
pub(super) fn half_step(x: f32) -> f64 {
    if x == 0.0 { 0.0 } else { f64::from(x.abs().next_up() - x.abs()) / 2.0 }
}

pub(super) fn f64_from(p: [f32; 3]) -> DVec3 {
    DVec3::new(f64::from(p[0]), f64::from(p[1]), f64::from(p[2]))
}

/// A position as f32, and how far that is off along the worst axis.
pub(super) fn rounded(p: DVec3) -> ([f32; 3], f64) {
    let stored = p.as_vec3().to_array();
    (stored, (f64_from(stored) - p).abs().max_element())
}

/// Whether the triangle has no area. The difference of two f32 is exact in f64 unless their exponents are 29 or more apart,
/// and the products of exact differences are exact too, so this finds the triangles whose area is exactly zero.
pub(super) fn is_degenerate(corners: [[f32; 3]; 3]) -> bool {
    let [a, b, c] = corners.map(f64_from);
    (b - a).cross(c - a) == DVec3::ZERO
}

/// Whether the triangle has an area, as far as f64 can tell.
///
/// With u = 2⁻⁵³, M the largest |coordinate| and L the largest |component| of b − a and c − a: the corners are off by up to 4u·M
/// after a linear map, so the sides by 8u·M + u·L ≤ 10u·M. A component of the cross product is the difference of two products of
/// sides: off by 2·(2·10u·M·L) and by 4u·L² ≤ 8u·M·L of its own roundings, 48u·M·L in all. The factor is 64. Corners that are not
/// finite count as an area, lest they go unnoticed.
fn has_area(corners: [DVec3; 3]) -> bool {
    let [a, b, c] = corners;
    let (ab, ac) = (b - a, c - a);
    let largest = a.abs().max(b.abs()).max(c.abs()).max_element();
    let side = ab.abs().max(ac.abs()).max_element();
    let noise = 32.0 * f64::EPSILON * largest * side;
    let area = ab.cross(ac).abs();
    !(noise.is_finite() && area.x <= noise && area.y <= noise && area.z <= noise)
}
