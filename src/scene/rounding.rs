//! What it costs that vertices have 32 bits a coordinate.

use super::notice::Notice;

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
    /// The number of triangles among [`Geometry::skipped_triangles`](super::Geometry::skipped_triangles) that have an area which storing their vertices took away.
    pub crushed_triangles: u64,
}

impl Rounding {
    /// The most by which storing a vertex may move it along any axis, in metres. A scene that is too large for that about one
    /// centre is split into [regions](super::Geometry::regions).
    pub const LIMIT_M: f64 = 1e-4;

    /// What a user should know of it: nothing, unless it is more than [`Rounding::LIMIT_M`].
    /// `element` names an object in the scene's file.
    pub fn notices(&self, element: impl Fn(usize) -> String) -> Vec<Notice> {
        let mut notices = Vec::new();
        if self.file_m > Self::LIMIT_M {
            let message = format!(
                "the file's own vertices are off by up to {} along each axis: so far from the origin of their node, \
                 the steps of 32-bit numbers are twice that",
                length(self.file_m)
            );
            let help = "export vertices about an origin near them, and put the rest of their place into the node's translation";
            notices.push(Notice::warning(element(self.file_object as usize), message).help(help));
        }
        if self.stored_m > Self::LIMIT_M {
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
