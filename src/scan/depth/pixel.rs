//! What a depth camera reports of a pixel.

use crate::scan::frame::{Cause, Echo, Return};

/// What a depth camera reports of a pixel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pixel {
    pub cause: Cause,
    /// The return, or the surface that blocks the pixel if its cause is [`Cause::TooNear`].
    pub one: Option<(Return, Echo)>,
}

impl Pixel {
    /// A pixel without a return.
    pub fn without(cause: Cause) -> Self {
        Self { cause, one: None }
    }
}
