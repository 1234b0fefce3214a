//! Depth images as another camera would have them: the depth of a depth camera, registered to its colour camera.

use glam::DVec3;

use super::depth16;
use super::format::{Content, EncodeError, FormatSpec, Kind, LossyContent, field};
use super::options::Options;
use super::picture::{Pixels, encode_numbers};
use super::sensor_frame::SensorFrame;
use crate::frame::BODY_FROM_OPTICAL;
use crate::sensor::{Pattern, Registered, Sensor};

/// The depth of each pixel of the colour camera along that camera's axis, in whole parts of a metre. 0 is a pixel that no depth
/// falls on: nothing came back, or the depth camera doesn't see what the colour camera sees there. Of several returns the first
/// is written.
pub(super) static FORMAT: FormatSpec = FormatSpec {
    name: "registered",
    ending: "registered.png",
    about: "16-bit depth images in the grid of the colour camera",
    content: Content::Pixels(&[field(
        "Z of the camera's `registered` one",
        "16-bit grey",
        "m / scale, rounded; 0 is nothing",
    )]),
    read_by: "PIL, OpenCV 4 and 5, Open3D",
    options: depth16::OPTIONS,
    check: |sensor, _| registered(sensor).map(|_| ()),
    loses: |sensor, options| registered(sensor).ok().and_then(|_| depth16::loses(sensor, options)),
    encoding_bytes_a_ray: |sensor, _| pixels_a_ray(sensor).saturating_mul(8 + 4 + 2 * 2),
    file_bytes_a_ray: |sensor, _| pixels_a_ray(sensor).saturating_mul(2),
    kind: Kind::LossyFile(encode),
    ..FormatSpec::PLAIN
};

/// The colour camera of a sensor.
fn registered(sensor: &Sensor) -> Result<&Registered, EncodeError> {
    let of_camera = match &sensor.pattern {
        Pattern::Camera(camera) => camera.registered(),
        _ => None,
    };
    of_camera.ok_or_else(|| {
        EncodeError::new("it has no colour camera, which is `registered` of `[pinhole]` or `[fisheye]`")
    })
}

/// The pixels of the colour camera for each of the depth camera, rounded up.
fn pixels_a_ray(sensor: &Sensor) -> u64 {
    registered(sensor).map_or(0, |registered| {
        let pixels = (registered.camera.width() as u64).saturating_mul(registered.camera.height() as u64);
        pixels.div_ceil(sensor.pattern.rays().max(1) as u64)
    })
}

/// A corner this near to a pixel's edge, in pixels, does not reach over it: it is the edge, rounded.
const EDGE_PX: f64 = 1e-6;

/// The pixels of a row or a column of `count` that an interval touches.
fn touched(ends: [f64; 2], count: usize) -> std::ops::Range<usize> {
    // What is beyond either end is cut off, and `as` makes NaN 0.
    let first = (ends[0] + EDGE_PX).floor().max(0.0) as usize;
    let end = ((ends[1] - EDGE_PX).floor() + 1.0).clamp(0.0, count as f64) as usize;
    first..end
}

/// The depth of each pixel of the colour camera in metres, row by row, infinite where no depth falls on it.
///
/// Each pixel of the depth camera is a rectangle at its depth, at a right angle to the axis. It covers each pixel of the colour
/// camera that the bounds of its projected corners touch, as librealsense's `align` has it, so that a slanted surface has no hairline
/// gaps, and the nearest depth is kept. The depth is that along the colour camera's axis, of the middle of the rectangle. All depths
/// count as measured at once: neither camera's shutter nor their motion is undone.
fn register(frame: &SensorFrame) -> Result<Vec<f64>, EncodeError> {
    let Registered { camera, depth_from_colour } = registered(frame.capture.sensor)?;
    let optical_from_depth = (*depth_from_colour * BODY_FROM_OPTICAL).inverse();
    let (width, height) = (camera.width(), camera.height());
    let mut nearest = vec![f64::INFINITY; width * height];
    let columns = frame.frame.columns();
    for pixel in 0..frame.frame.pixels() {
        let (row, column) = (pixel / columns, pixel % columns);
        let range_m = frame.frame.slot(pixel, 0).map(|slot| frame.frame.returns().range_m[slot]);
        let depth_m =
            range_m.and_then(|range_m| Some(range_m * frame.capture.depth_over_range(row, column)?));
        let Some(depth_m) = depth_m.filter(|depth_m| *depth_m > 0.0) else { continue };
        // The point of a place of the pixel at its depth, in the colour camera's optical frame.
        let point = |place: [f64; 2]| -> Option<DVec3> {
            let direction = frame.capture.direction_in_pixel(row, column, place)?;
            let at_depth = direction * (depth_m / direction.x);
            (direction.x > 0.0).then(|| optical_from_depth.point(at_depth))
        };
        let corners = [[-0.5, -0.5], [0.5, -0.5], [-0.5, 0.5], [0.5, 0.5]]
            .map(|place| point(place).and_then(|corner| camera.project(corner)));
        let [Some(a), Some(b), Some(c), Some(d)] = corners else { continue };
        let Some(z) = point([0.0; 2]).map(|middle| middle.z).filter(|z| *z > 0.0) else { continue };
        let bounds = |of: fn((f64, f64)) -> f64| {
            let [a, b, c, d] = [a, b, c, d].map(of);
            [a.min(b).min(c).min(d), a.max(b).max(c).max(d)]
        };
        let across = touched(bounds(|(u, _)| u), width);
        for row in touched(bounds(|(_, v)| v), height) {
            for column in across.clone() {
                let kept = &mut nearest[row * width + column];
                *kept = kept.min(z);
            }
        }
    }
    Ok(nearest)
}

fn encode(frame: &SensorFrame, options: &Options) -> Result<LossyContent, EncodeError> {
    let (numbers, lost) =
        depth16::pixels(register(frame)?.into_iter().map(|depth_m| depth_m as f32), options);
    let camera = &registered(frame.capture.sensor)?.camera;
    let scale = options.number(&depth16::SCALE).to_string();
    let texts = [("beamcast:channel", "Z".to_owned()), ("beamcast:scale", scale)];
    let file = encode_numbers(camera.width(), camera.height(), &numbers, Pixels::Grey16, &texts)?;
    Ok((file, lost))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_touches_the_pixels_that_it_reaches_into() {
        assert_eq!(touched([1.2, 2.8], 9), 1..3);
        assert_eq!(touched([1.0, 2.0], 9), 1..2, "edges do not reach over");
        assert_eq!(touched([1.0 - 1e-9, 2.0 + 1e-9], 9), 1..2, "nor rounded ones");
        assert_eq!(touched([-3.0, 99.0], 9), 0..9);
        assert!(touched([-3.0, -1.0], 9).is_empty() && touched([9.5, 12.0], 9).is_empty());
        assert!(touched([f64::NAN; 2], 9).len() <= 9);
    }
}
