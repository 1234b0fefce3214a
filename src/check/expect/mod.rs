//! Expectations: declarations of what a rig should see, and their evaluation.
//!
//! ```text
//! expected    the declarations of `[[expect]]`, in words and examined
//! points      what lies on a target: points, distances from a plane, angles between beams
//! ground      what of the ground is seen: zones, blind sectors
//! shares      how many of the rays return, and how many hit the vehicle
//! causes      how often a target is detected, and what returns are from
//! finding     what a measurement gave
//! tally       what was found over the frames of a sequence
//! seen        the frames of a run, and the returns in them
//! target      which surfaces are meant
//! bounds      from the least to the greatest value
//! ```

mod bounds;
mod causes;
mod expected;
mod finding;
mod ground;
mod points;
mod seen;
mod shares;
mod tally;
mod target;

pub use bounds::Bounds;
pub use expected::{Expectation, Expected};
pub use ground::{Ground, Zone};
pub use seen::Seen;
pub use tally::{Demand, Tally};
pub use target::Target;
