//! Motion over time: of the body that carries the sensors, and of everything in the scene that moves.
//!
//! ```text
//! screw    the rigid motion of constant velocities, and the way back from a rigid motion to it
//! path     rigid motion through given poses
//! clock    the time of a clip, which follows from the world's
//! track    keyframes over a clip's time
//! link     trajectories of bodies, and motion of any affine kind, as a product of links: what a mesh in the scene does
//! bounds   boxes of everything that a box reaches while it moves
//! window   the times of a frame
//! ```

mod bounds;
mod clock;
mod link;
mod path;
mod screw;
#[cfg(test)]
mod tests;
mod track;
mod window;

pub use clock::Clock;
pub use link::{AT_ORIGIN, Link, Motion, Trajectory, Velocity};
pub use path::{Deviation, Interpolation, Path, PathProblem};
pub use track::{Blend, Blending, Channel, Track, TrackProblem};
pub use window::Window;
