//! Ground truth of a frame beside its ranges: the boxes of objects, how the points of surfaces move, and how ranges change with the
//! sensor's pose.
//!
//! ```text
//! target     the objects that boxes are made for
//! oriented   oriented boxes
//! boxes      the boxes of a frame: where each target is, how it moves, how much of it is seen
//! image      where targets are in a camera's image
//! color      the colours of the surfaces that returns come from
//! surface    how the points that returns come from move
//! jacobian   the derivatives of ranges by the sensor's pose
//! facet      the flat triangle that a return comes from
//! ```

mod boxes;
mod color;
mod facet;
mod image;
mod jacobian;
mod oriented;
mod surface;
mod target;

pub use boxes::{BoxTruth, boxes};
pub use color::surface_colors;
pub use image::{Bounds, Shown};
pub use jacobian::{LEAST_COSINE, range_jacobians};
pub use oriented::OrientedBox;
pub use surface::{SurfaceMotion, surface_motions};
pub use target::{Choice, Target, Targets};
