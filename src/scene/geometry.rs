//! The half of a scene that no time changes: its meshes, its materials, and the names and labels of its objects.

use glam::DVec3;

use super::build::SceneBuilder;
use super::material::Material;
use super::notice::Notice;
use super::regions::rounded_origin;

/// Everything in a scene that no time changes.
#[derive(Clone, Debug, Default)]
pub struct Geometry {
    /// The world position (metres) of the scene space's origin.
    pub centre: DVec3,
    /// The first meshes, of which there is at least one, hold every mesh that is placed once. Mesh 0 is in the scene's space;
    /// it may be empty. Where the scene is too large for that, the others are [regions](Geometry::regions) with spaces of
    /// their own. After them follow the meshes that are placed more than once, each in its own space.
    pub meshes: Vec<Mesh>,
    /// The number of meshes that hold what is placed once. It is 1, or more for a scene so large that rounding would move
    /// its vertices by more than [`SceneBuilder::LIMIT_M`](super::SceneBuilder::LIMIT_M). Placement i of every arrangement is region i,
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
    /// The number of triangles that were left out because their area is zero, in the file or when their vertices are stored.
    pub skipped_triangles: u64,
    /// Every file that was read to make the scene.
    pub files: Vec<SourceFile>,
}

/// How far positions are off because f32 has few digits: along each axis, in metres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Rounding {
    /// The most by which a vertex of a mesh that is placed once was moved when it was stored. (The others are stored as their
    /// file has them.)
    pub stored_m: f64,
    /// The object whose vertex that is.
    pub stored_object: u32,
    /// How far the file's own vertices may be off, if numbers that look rounded are: half the step of f32 at the farthest of
    /// them, times the scale of their node.
    pub file_m: f64,
    /// The object whose vertex that is.
    pub file_object: u32,
    /// The number of triangles among [`Geometry::skipped_triangles`] that have an area which storing their vertices took away.
    pub crushed_triangles: u64,
}

impl Rounding {
    /// What a user should know of it: nothing, unless it is more than [`SceneBuilder::LIMIT_M`](super::SceneBuilder::LIMIT_M).
    /// `element` names an object in the scene's file.
    pub fn notices(&self, element: impl Fn(usize) -> String) -> Vec<Notice> {
        let mut notices = Vec::new();
        if self.file_m > SceneBuilder::LIMIT_M {
            let message = format!(
                "the file's own vertices are off by up to {} along each axis: so far from the origin of their node, \
                 the steps of 32-bit numbers are twice that",
                length(self.file_m)
            );
            let help = "export vertices about an origin near them, and put the rest of their place into the node's translation";
            notices.push(Notice::warning(element(self.file_object as usize), message).help(help));
        }
        if self.stored_m > SceneBuilder::LIMIT_M {
            let crushed = match self.crushed_triangles {
                0 => String::new(),
                n => format!(", and triangles that are smaller are left out ({n} in the scene)"),
            };
            let message = format!(
                "vertices are rounded by up to {} along each axis when they are stored{crushed}: the triangles are too \
                 large, or lie too far apart, for more digits",
                length(self.stored_m)
            );
            let help =
                "triangles of less than a kilometre are rounded by less than 0.1 mm, wherever they lie";
            notices.push(Notice::warning(element(self.stored_object as usize), message).help(help));
        }
        notices
    }
}

/// A small length, for people.
fn length(metres: f64) -> String {
    match metres {
        m if m < 0.995e-3 => format!("{:.2} mm", m * 1e3),
        m if m < 0.995 => format!("{:.1} mm", m * 1e3),
        m => format!("{m:.2} m"),
    }
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
    /// The label of the file: `extras.label` of the node, else of its nearest ancestor that has one.
    pub file_label: Option<u32>,
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

    /// The number of triangles in memory, each counted once.
    pub fn stored_triangle_count(&self) -> u64 {
        self.meshes.iter().map(|mesh| mesh.triangles.len() as u64).sum()
    }
}
