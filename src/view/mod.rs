//! The viewer: frames, and the outcomes of checks, as one HTML page.
//!
//! [`View`] is a frame as the page shows it. It is made of a frame that was cast ([`View::of_frame`]) or of the files that a
//! scan wrote ([`of_recording`]). [`page`] writes the page of frames, [`playback`] that of a sequence, and [`of_outcomes`] that of a
//! check.

mod frames;
mod ground;
mod html;
mod outcomes;
mod pack;
pub mod page;
pub mod playback;
mod recorded;
mod rig;
mod thin;

pub use frames::{Shown, View};
pub use outcomes::of_outcomes;
pub use recorded::{Recording, of_recording};
pub use rig::{Mounted, Rig};
