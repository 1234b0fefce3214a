//! Scans of depth cameras that are not ideal.
//!
//! ```text
//! second          the second viewpoint: which surfaces it sees
//! disparity       disparities from exact depths, with noise, holes and rounding; from disparities to returns
//! infrared        what the imagers see; matched: disparities by matching that
//! shade           how surfaces look in the light of the camera and of the sun
//! time_of_flight  the light of all paths as phasors; from phases to returns
//! ```
//!
//! Each random number follows from the seed, the sensor, the frame, the pixel and the effect, so frames do not depend on threads.

mod disparity;
mod infrared;
mod matched;
mod second;
mod shade;
mod time_of_flight;

use super::story::Story;
use super::{Cause, Echo, Frame, Progress, Return};
use crate::scene::Scene;
use crate::sensor::{Capture, DepthSensing, StereoMethod};
use crate::trace::Cast;

/// What a depth camera reports of a pixel.
#[derive(Clone, Copy, Debug)]
struct Pixel {
    cause: Cause,
    /// The return, or the surface that blocks the pixel if its cause is [`Cause::TooNear`].
    one: Option<(Return, Echo)>,
}

impl Pixel {
    /// A pixel without a return.
    fn without(cause: Cause) -> Self {
        Self { cause, one: None }
    }
}

/// Casts a capture of a depth camera, as [`scan_into`](super::scan_into) does.
pub(super) fn scan_into(
    frame: &mut Frame,
    scene: &Scene,
    tracer: &impl Cast,
    capture: &Capture,
    sensing: &DepthSensing,
    progress: &Progress,
) -> bool {
    let measured = match sensing {
        DepthSensing::Stereo(stereo) => match &stereo.method {
            StereoMethod::Analytic(analytic) => {
                disparity::scan(scene, tracer, capture, (stereo, analytic), progress)
            }
            StereoMethod::Match(matching) => {
                matched::scan(scene, tracer, capture, (stereo, matching), progress)
            }
        },
        DepthSensing::TimeOfFlight(tof) => time_of_flight::scan(scene, tracer, capture, tof, progress),
    };
    let Some((pixels, images)) = measured else { return false };
    frame.begin_measured(capture.rows(), capture.columns());
    for Pixel { cause, one } in pixels {
        frame.add_measured(cause, one.as_slice());
    }
    frame.set_images(images);
    true
}

/// Casts the frame of a depth camera, whose pixels depend on each other, and tells the story of one pixel: that of an ideal camera, of
/// which the returns are the frame's.
pub(super) fn explain(scene: &Scene, tracer: &impl Cast, capture: &Capture, ideal: Story) -> Story {
    let mut frame = Frame::default();
    super::scan_into(&mut frame, scene, tracer, capture, &Progress::default());
    let pixel = ideal.row * capture.columns() + ideal.column;
    let echo = |slot: usize| (frame.returns().get(slot), frame.echo(slot).copied());
    Story {
        cause: frame.causes()[pixel],
        returns: frame.slots(pixel).map(echo).collect(),
        blocker: frame.blocker(pixel).map(|one| (one, None)),
        ..ideal
    }
}
