//! Ground truth of a frame beside its ranges: the boxes of objects and how the points of surfaces move.
//!
//! ```text
//! target     the objects that boxes are made for
//! oriented   oriented boxes
//! boxes      the boxes of a frame: where each target is, how it moves, how much of it is seen
//! image      where targets are in a camera's image
//! color      the colours of the surfaces that returns come from
//! surface    how the points that returns come from move
//! ```

mod boxes;
mod color;
mod image;
mod oriented;
mod surface;
mod target;

pub use boxes::{BoxTruth, boxes};
pub use color::surface_colors;
pub use image::{Bounds, Shown};
pub use oriented::OrientedBox;
pub use surface::{SurfaceMotion, surface_motions};
pub use target::{Choice, Target, Targets};
