//! Scans of depth cameras that are not ideal.
//!
//! ```text
//! second          the second viewpoint: which surfaces it sees; sight: lines of sight
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
mod pixel;
mod second;
mod shade;
mod sight;
mod time_of_flight;

use self::pixel::Pixel;
use crate::scan::Progress;
use crate::scan::frame::Frame;
use crate::scan::story::Story;
use crate::scene::Scene;
use crate::sensor::{Capture, DepthSensing, RangeLimits, Sensor, StereoMethod};
use crate::trace::Cast;

/// Casts a capture of a depth camera, as [`scan_into`](crate::scan::scan_into) does.
pub(super) fn scan_into(
    frame: &mut Frame,
    scene: &Scene,
    tracer: &impl Cast,
    capture: &Capture,
    sensing: &DepthSensing,
    progress: &Progress,
) -> bool {
    // Depth is found of what the camera sees at any range. Its limits are those of the depths that it reports.
    let unlimited = Sensor { range: RangeLimits::default(), ..capture.sensor.clone() };
    let exact = Capture { sensor: &unlimited, ..*capture };
    let measured = match sensing {
        DepthSensing::Stereo(stereo) => match &stereo.method {
            StereoMethod::Analytic(analytic) => {
                disparity::scan(scene, tracer, (capture, &exact), (stereo, analytic), progress)
            }
            StereoMethod::Match(matching) => {
                matched::scan(scene, tracer, (capture, &exact), (stereo, matching), progress)
            }
        },
        DepthSensing::TimeOfFlight(tof) => {
            time_of_flight::scan(scene, tracer, (capture, &exact), tof, progress)
        }
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
pub(super) fn explain(
    scene: &Scene,
    tracer: &impl Cast,
    capture: &Capture,
    sensing: &DepthSensing,
    ideal: Story,
) -> Story {
    let mut frame = Frame::default();
    capture.prepare();
    scan_into(&mut frame, scene, tracer, capture, sensing, &Progress::default());
    let pixel = ideal.row * capture.columns() + ideal.column;
    let echo = |slot: usize| (frame.returns().get(slot), frame.echo(slot).copied());
    Story {
        cause: frame.causes()[pixel],
        returns: frame.slots(pixel).map(echo).collect(),
        blocker: frame.blocker(pixel).map(|one| (one, None)),
        ..ideal
    }
}
