//! The half of a scene that no time changes: its meshes, its materials, and the names and labels of its objects.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use glam::DVec3;

use super::corners::MeshCorners;
use super::material::Material;
use super::mover::Mover;
use super::optics::Optics;
use super::rounding::Rounding;
use super::steps::rounded_origin;
use crate::motion::Motion;

/// Everything in a scene that no time changes.
#[derive(Clone, Debug, Default)]
pub struct Geometry {
    /// The world position (metres) of the scene space's origin.
    pub centre: DVec3,
    /// The first meshes, of which there is at least one, hold every mesh that is placed once. Mesh 0 is in the scene's space;
    /// it may be empty. Where the scene is too large for that, the others are [regions](Geometry::regions) with spaces of
    /// their own. After them follow the meshes that are placed more than once or that move, each in its own space.
    pub meshes: Vec<Mesh>,
    /// The number of meshes that hold what is placed once. It is 1, or more for a scene so large that rounding would move
    /// its vertices by more than [`Rounding::LIMIT_M`]. Placement i of every arrangement is region i,
    /// which is moved, not turned or scaled.
    pub regions: u32,
    /// The step to multiples of which the origins of rays are rounded, in metres; 0 if there is one region, which needs no
    /// rounding. It is at most 2⁻⁵² of the scene's size.
    pub origin_step_m: f64,
    /// What rounding costs.
    pub rounding: Rounding,
    /// One object for each time that a mesh is placed, in document order. An object's id is its index.
    pub objects: Vec<Object>,
    /// A material's id is its index.
    pub materials: Vec<Material>,
    /// How surfaces send light back, as the job says it of materials, nodes and labels.
    pub optics: Vec<Optics>,
    /// The labels of which the job says how surfaces send light back: each with an index into [`Geometry::optics`].
    pub optics_of_labels: BTreeMap<u32, u32>,
    /// What moves, hides or bends, in ascending order of the ids of triangles.
    pub movers: Vec<Mover>,
    /// One more than the largest id of a triangle.
    pub triangle_ids: u32,
    /// What moves as one.
    pub groups: Vec<Group>,
    /// The number of triangles that were left out because their area is zero, in the file or when their vertices are stored.
    pub skipped_triangles: u64,
    /// Every file that was read to make the scene.
    pub files: Vec<SourceFile>,
}

/// Triangles that share a space.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Vertices, metres.
    pub positions: Vec<[f32; 3]>,
    /// Vertex indices, counter-clockwise seen from the front. No triangle has zero area.
    pub triangles: Vec<[u32; 3]>,
    /// Runs of triangles of one material (and, in a region, of one object), in order and without gaps.
    pub parts: Vec<Part>,
    /// The texture coordinates and colours of the triangles whose materials need them. The shapes of a mesh share them.
    pub corners: Arc<MeshCorners>,
}

/// A run of triangles, which ends before the next part's first triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// The run's first triangle in its mesh.
    pub first_triangle: u32,
    /// Index into [`Geometry::materials`].
    pub material: u32,
    /// The object's id, counted from the placement's [`Placement::first_object`](super::Placement::first_object): 0 in
    /// every mesh but regions.
    pub object: u32,
}

/// A mesh's presence at a node of the scene's file. Outputs call its id `id.instance`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Object {
    /// The node's name as the file gives it, or empty. It is never used as a file name.
    pub name: String,
    /// The semantic label that the job's `[labels]` gives the node or one of its ancestors by name.
    pub job_label: Option<u32>,
    /// Index into [`Geometry::optics`], if the job says of the node or one of its ancestors how surfaces send light back.
    pub optics: Option<u32>,
    /// The label of the file: `extras.label` of the node, else of its nearest ancestor that has one.
    pub file_label: Option<u32>,
}

/// Objects that move as one, which is what is tracked: an actor, or an animated node with all below it.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// The actor's name, or the node's.
    pub name: String,
    /// The semantic label of the actor or the node; if those have none, that of the first object.
    pub label: Option<u32>,
    /// Its objects: indices into [`Geometry::objects`], in ascending order.
    pub objects: Vec<u32>,
    /// The map to the world from its own frame, over time. The frame's axes are those of the file in the world, if the actor or
    /// the node was not turned.
    pub world_from_group: Arc<Motion>,
}

/// A file that the scene was read from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceFile {
    /// The file's name as the user or the scene wrote it; it is never made absolute.
    pub name: String,
    /// The file's length in bytes.
    pub bytes: u64,
    /// BLAKE3 of the file's content, in hexadecimal.
    pub blake3: String,
}

impl Geometry {
    /// The origin of a ray, carried from the world to the scene's space. Where there are several regions it is rounded such
    /// that all of them compute with the same point (see the module `regions`).
    #[inline]
    pub fn ray_origin(&self, in_world: DVec3) -> DVec3 {
        let origin = in_world - self.centre;
        if self.origin_step_m > 0.0 { rounded_origin(origin, self.origin_step_m) } else { origin }
    }

    /// [`Geometry::ray_origin`] of several rays. This is inlined, so that the caller's instructions compute it.
    #[inline(always)]
    pub(crate) fn ray_origins(&self, in_world: &[DVec3], to: &mut Vec<DVec3>) {
        to.resize(in_world.len(), DVec3::ZERO);
        for (to, origin) in to.iter_mut().zip(in_world) {
            *to = *origin - self.centre;
        }
        if self.origin_step_m > 0.0 {
            for origin in to {
                *origin = rounded_origin(*origin, self.origin_step_m);
            }
        }
    }

    /// What the labels stand for, in words: the names that `given`, the job's `[labels]`, has for a number, else the names of
    /// the objects that the file gives that label.
    pub fn label_names(&self, given: &BTreeMap<String, u32>) -> BTreeMap<u32, String> {
        let of_file =
            self.objects.iter().filter_map(|object| Some((object.name.as_str(), object.file_label?)));
        label_names(given.iter().map(|(name, label)| (name.as_str(), *label)), of_file)
    }

    /// The number of triangles in memory, each counted once.
    pub fn stored_triangle_count(&self) -> u64 {
        self.meshes.iter().map(|mesh| mesh.triangles.len() as u64).sum()
    }
}

/// What labels stand for, in words, by their number. A label that a job gives has the job's names for it, and any other the
/// names of the file's objects that have it. Objects that only a number at the end tells apart count as one.
pub fn label_names<'a>(
    of_job: impl Iterator<Item = (&'a str, u32)>,
    of_file: impl Iterator<Item = (&'a str, u32)>,
) -> BTreeMap<u32, String> {
    let (of_job, of_file) = (names_by_label(of_job), names_by_label(of_file));
    let mut all = of_file;
    all.extend(of_job);
    all.into_iter().map(|(label, names)| (label, short_list(&names))).collect()
}

/// Most names that are listed for a label.
const MOST_NAMES: usize = 2;

fn names_by_label<'a>(pairs: impl Iterator<Item = (&'a str, u32)>) -> BTreeMap<u32, BTreeSet<&'a str>> {
    let mut found: BTreeMap<u32, BTreeSet<&str>> = BTreeMap::new();
    for (name, label) in pairs {
        let stem = name.trim_end_matches(|c: char| c.is_ascii_digit() || matches!(c, '.' | '_' | '-' | ' '));
        let names = found.entry(label).or_default();
        // One more than are listed tells that there are more.
        if names.len() <= MOST_NAMES && !name.is_empty() {
            names.insert(if stem.is_empty() { name } else { stem });
        }
    }
    found.retain(|_, names| !names.is_empty());
    found
}

fn short_list(names: &BTreeSet<&str>) -> String {
    let listed: Vec<&str> = names.iter().take(MOST_NAMES).copied().collect();
    let more = if names.len() > MOST_NAMES { ", …" } else { "" };
    format!("{}{more}", listed.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_have_the_names_of_the_job_or_else_of_what_has_them() {
        let of_file = [("car_1", 2), ("car.002", 2), ("van", 2), ("17", 5), ("", 6), ("wall", 3)];
        let many = (0..9).map(|i| (["ash", "elm", "fir", "oak", "yew"][i % 5], 8));
        let names = label_names([("fence", 3), ("hedge", 3)].into_iter(), of_file.into_iter().chain(many));
        let expected = [(2, "car, van"), (3, "fence, hedge"), (5, "17"), (8, "ash, elm, …")];
        assert_eq!(names, expected.map(|(label, name)| (label, name.to_owned())).into());
    }
}
