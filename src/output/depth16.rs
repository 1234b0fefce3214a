//! Depth images as PNGs with 16 bits for each pixel, as depth cameras and data sets have them.

use super::channel::{CHANNELS, ChannelSpec, channel};
use super::format::{Content, EncodeError, FormatSpec, Kind, LossyContent, field};
use super::image::{Image, Samples};
use super::options::{OptionSpec, OptionValues, Options};
use super::picture::{Pixels, check_sides, encode_numbers};
use super::sensor_frame::SensorFrame;
use crate::sensor::{Limited, Sensor};

/// The depth of each pixel along the optical axis of a camera, or the range of a LiDAR, in whole parts of a metre. 0 is a pixel
/// without a return. Of several returns the first is written.
pub(super) static FORMAT: FormatSpec = FormatSpec {
    name: "depth16",
    ending: "depth16.png",
    about: "16-bit depth images",
    content: Content::Pixels(&[field(
        "Z of a camera, range of a LiDAR",
        "16-bit grey",
        "m / scale, rounded; 0 is nothing",
    )]),
    read_by: "PIL, OpenCV 4 and 5, Open3D",
    options: OPTIONS,
    check: |sensor, _| check_sides(sensor),
    loses,
    encoding_bytes_a_ray: |_, _| 4 + 4 + 2 * 2,
    file_bytes_a_ray: |_, _| 2,
    kind: Kind::LossyFile(encode),
    ..FormatSpec::PLAIN
};

/// The options of images of depth with 16 bits.
pub(super) const OPTIONS: &[OptionSpec] = &[SCALE];

/// The bounds hold a step of 10 m and one of 10 µm.
pub(super) const SCALE: OptionSpec = OptionSpec {
    name: "scale",
    about: "What a metre counts in a pixel: 1000 is millimetres, 5000 as in TUM's data sets, 256 as in KITTI's. Depths that \
            65535 can't hold are written as 0.",
    values: OptionValues::Number { least: 0.1, most: 100_000.0, default: 1000.0 },
};

/// The channel that is written.
fn depth_channel(sensor: &Sensor) -> &'static ChannelSpec {
    let name = if sensor.pattern.is_camera() { "Z" } else { "range" };
    channel(name).unwrap_or(&CHANNELS[0])
}

/// The depth of each pixel in metres, as an EXR has it. It is infinite where nothing came back.
fn depths(frame: &SensorFrame) -> Vec<f32> {
    let channel = depth_channel(frame.capture.sensor);
    let samples = Image::with_channels(frame, 0, [channel]).channels.pop().map(|channel| channel.samples);
    match samples {
        Some(Samples::F32(depths)) => depths,
        _ => Vec::new(),
    }
}

/// The numbers in the pixels of these depths, 0 for one that has none, and how many depths have none. A depth is infinite where nothing
/// came back.
pub(super) fn pixels(depths_m: impl Iterator<Item = f32>, options: &Options) -> (Vec<u32>, u64) {
    let mut lost = 0;
    let numbers = depths_m.map(|depth_m| {
        let number = pixel(depth_m, options);
        lost += u64::from(number == Some(0));
        number.unwrap_or(0).into()
    });
    (numbers.collect(), lost)
}

/// The number in a pixel: 0 for a depth that has none. `None` where nothing came back.
fn pixel(depth_m: f32, options: &Options) -> Option<u16> {
    // The product is exact for whole scales, so that what an EXR says decides how it is rounded.
    let number = (f64::from(depth_m) * options.number(&SCALE)).round();
    let fits = number >= 1.0 && number <= f64::from(u16::MAX);
    depth_m.is_finite().then_some(if fits { number as u16 } else { 0 })
}

fn encode(frame: &SensorFrame, options: &Options) -> Result<LossyContent, EncodeError> {
    let (numbers, lost) = pixels(depths(frame).into_iter(), options);
    // A file on its own says what it holds.
    let name = depth_channel(frame.capture.sensor).name;
    let texts =
        [("beamcast:channel", name.to_owned()), ("beamcast:scale", options.number(&SCALE).to_string())];
    let file = encode_numbers(frame.frame.columns(), frame.frame.rows(), &numbers, Pixels::Grey16, &texts)?;
    Ok((file, lost))
}

/// Of a sensor that sees farther than a pixel can tell.
pub(super) fn loses(sensor: &Sensor, options: &Options) -> Option<String> {
    let scale = options.number(&SCALE);
    let most_m = f64::from(u16::MAX) / scale;
    // A depth is at most the range.
    let far_m = sensor.range.max_m;
    if far_m * scale <= f64::from(u16::MAX) {
        return None;
    }
    let what = match (sensor.pattern.is_camera(), sensor.range.of) {
        (true, Limited::Depth) => "depths",
        (true, Limited::Range) => "depths along the axis",
        (false, _) => "ranges",
    };
    let sees = if far_m.is_finite() { format!("up to {far_m} m") } else { "without a limit".to_owned() };
    let largest = (f64::from(u16::MAX) / far_m).floor();
    let holds = if far_m.is_finite() && largest >= 1.0 {
        format!("scale = {largest} holds all of them")
    } else {
        "a smaller scale holds more".to_owned()
    };
    Some(format!(
        "it sees {sees}, and {what} above {most_m} m are written as 0, as if nothing were there: {holds}"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle::Angle;
    use crate::sensor::{Camera, Pattern, RangeLimits, RingOrder};

    fn scaled(scale: f64) -> Options {
        let mut options = Options::none(FORMAT.options);
        options.set(&SCALE, scale);
        options
    }

    #[test]
    fn a_depth_is_rounded_to_the_nearest_step_and_one_that_has_none_is_0() {
        let options = Options::none(FORMAT.options);
        let pixel = |depth_m| pixel(depth_m, &options);
        assert_eq!([1.0, 2.00075, 65.535].map(pixel), [Some(1000), Some(2001), Some(65535)]);
        assert_eq!([65.536, 1e9, 0.0004, 0.0, -1.0].map(pixel), [Some(0); 5]);
        assert_eq!([f32::INFINITY, f32::NAN].map(pixel), [None; 2]);
        assert_eq!(super::pixel(1.5, &scaled(256.0)), Some(384));
    }

    #[test]
    fn a_sensor_that_sees_farther_than_pixels_tell_is_told_of() {
        let camera = Camera::from_hfov((4, 3), Angle::deg(90.0), None).unwrap();
        let of = |max_m| Sensor {
            pattern: Pattern::Camera(camera.clone()),
            range: RangeLimits { max_m, ..RangeLimits::default() },
            ring: RingOrder::Row,
            measurement: Default::default(),
        };
        assert_eq!(loses(&of(65.535), &scaled(1000.0)), None);
        assert_eq!(loses(&of(200.0), &scaled(256.0)), None);
        let told = loses(&of(200.0), &scaled(1000.0)).unwrap();
        assert!(told.contains("above 65.535 m") && told.contains("scale = 327 holds"), "{told}");
        assert!(loses(&of(f64::INFINITY), &scaled(1.0)).unwrap().contains("without a limit"));
    }
}
