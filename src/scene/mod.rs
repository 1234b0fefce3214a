//! Scenes: triangles, materials and objects, and where they are at a time.
//!
//! A [`Scene`] has two halves. Its [`Geometry`] holds everything that no time changes: vertices, triangles, materials, the
//! names and labels of objects. Its [`Arrangement`] says where the meshes of the geometry are at one time. Both are shared,
//! so a scene is cheap to clone, and two scenes that differ only in time share every vertex. What moves, hides or bends is a
//! [`Mover`]: [`Scene::at`] is the arrangement of one time, and [`Scene::during`] that of a frame, in which each ray finds what moves
//! where it is at the ray's own time. The tracer takes an arrangement and builds only its top level again, and the hierarchies
//! of the shapes that are new.
//!
//! The scene's space is the world, translated (in f64) so that the scene's own centre is near its origin; only then are
//! vertices rounded to f32. A mesh that is placed once is stored in that space, in mesh 0. A mesh that is placed more than
//! once, or moves, is stored once, in its own space, with one [`Placement`] for each time that it is placed.
//!
//! In a scene so large that this rounding would be felt (some kilometres), the meshes that are placed once are shared out to
//! several [regions](Geometry::regions) with centres of their own; `regions` says how, and why rays find no seam between them.
//!
//! ```text
//! source       what a scene is made of before it is one: meshes, and where they are placed
//! build        from these to a scene: one space, one numbering
//! arrays       the same of meshes that a program has in memory
//! flatten      the meshes that are placed once; regions and steps: how large scenes are split, and why they agree
//! rounding     what it costs that vertices have 32 bits
//! geometry     the half that no time changes
//! material     the optical properties of surfaces; texture: images on them; corners: where triangles lie in these
//! optics       how a job says that surfaces send light back; environment: the air and the sun
//! arrangement  the half that says where meshes are, and the scene as both
//! appearance   the optical properties of a hit, and the light that passes there
//! mover        what changes over time; moving: the maps of such a placement; frames: the scene at a time and during a frame
//! only         a part of a scene, object by object
//! bending      what it costs that a mesh which bends keeps its shape for a slice of time
//! extent       how far a scene reaches; bounds: boxes
//! notice       what is to be known of a scene though it can be used
//! gltf/        reading glTF
//! ```

mod appearance;
mod arrangement;
mod arrays;
mod bending;
pub(crate) mod bounds;
mod build;
mod corners;
mod environment;
mod extent;
mod flatten;
mod frames;
mod geometry;
pub mod gltf;
mod material;
mod mover;
mod moving;
mod notice;
mod only;
mod optics;
mod regions;
mod rounding;
mod source;
mod steps;
mod texture;

pub use arrangement::{Arrangement, Placement, Scene, Surface};
pub use arrays::{MeshArrays, SourceTriangles, Vertices};
pub use bending::Slicing;
pub use corners::{Corners, MeshCorners};
pub use environment::{Environment, Haze, Sun, Weather};
pub use extent::Extent;
pub use geometry::{Geometry, Group, Mesh, Object, Part, SourceFile, label_names};
pub use material::{AlphaMode, Appearance, Material};
pub use mover::{Deformer, Mover};
pub use notice::Notice;
pub use optics::{Optics, Spectrum, SurfaceKind};
pub use rounding::Rounding;
pub use source::{SceneBuildError, SceneBuilder, SourceInstance, SourceMesh, SourcePart};
pub use texture::{Image, Texture, Wrap};
