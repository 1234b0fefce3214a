//! The viewer: frames, and the outcomes of checks, as one HTML page.
//!
//! [`View`] is a frame as the page shows it. It is made of a frame that was cast ([`View::of_frame`]) or of the files that a
//! scan wrote ([`of_recording`]). [`page`] writes the page.

mod frames;
mod pack;
pub mod page;
mod recorded;

pub use frames::View;
pub use recorded::of_recording;
