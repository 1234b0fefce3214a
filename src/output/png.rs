//! Colour previews for people.

use super::format::{Content, EncodeError, FormatSpec, Kind, field};
use super::legend::{Entry, ticks, with_legend};
use super::options::{OptionSpec, OptionValues, Options};
use super::picture::{NO_RETURN_COLOUR, Picture, Rgb, TOO_NEAR_COLOUR};
use super::plot::{Dot, scatter};
use super::sensor_frame::SensorFrame;
use crate::scan::Cause;
use crate::sensor::{Pattern, Rotating, Sensor, azimuth_elevation};

/// Ranges in the colours of Turbo, with red for near and blue for far. The first of several returns is shown. Beams that are
/// blocked nearer than the least range are dark red.
pub(super) static FORMAT: FormatSpec = FormatSpec {
    name: "png",
    ending: "png",
    about: "colour previews of the range",
    content: Content::Pixels(&[field("red, green, blue", "8-bit", "colour of the range")]),
    read_by: "PIL, OpenCV 4 and 5",
    options: &[NEAR, FAR, STEPS],
    check_options: |options| {
        let (near, far) = (options.number(&NEAR), options.number(&FAR));
        if near < far || (near, far) == (0.0, 0.0) {
            return Ok(());
        }
        Err(EncodeError::new(format!(
            "a scale goes from `near_m` to a larger `far_m`, and these are {near} and {far}"
        )))
    },
    check,
    encoding_bytes_a_ray: |sensor, _| {
        // This counts the ranges for the scale, the pixels, and the file under the assumption that compression saves
        // nothing. A scatter plot keeps a dot for each ray instead.
        if sensor.pattern.is_image() { 4 + 2 * 3 * stretch(&sensor.pattern) as u64 } else { 2 * 64 }
    },
    file_bytes_a_ray: |_, _| 3,
    kind: Kind::File(encode),
    ..FormatSpec::PLAIN
};

/// The bounds hold a millimetre and the largest range of any LiDAR.
const NEAR: OptionSpec = OptionSpec {
    name: "near_m",
    about: "The range in metres at the red end of the scale, which is then the same for all frames; with far_m. 0: as fits \
            each frame.",
    values: OptionValues::Number { least: 0.0, most: 100_000.0, default: 0.0 },
};

const FAR: OptionSpec = OptionSpec {
    name: "far_m",
    about: "The range in metres at the blue end of the scale; with near_m.",
    values: OptionValues::Number { least: 0.0, most: 100_000.0, default: 0.0 },
};

const STEPS: OptionSpec = OptionSpec {
    name: "steps",
    about: "The number of colours of the scale, which makes files smaller; 0: a smooth scale.",
    values: OptionValues::OneOf { numbers: &[0, 16, 32, 64, 128], default: 0 },
};

fn check(sensor: &Sensor, _: &Options) -> Result<(), EncodeError> {
    let (rows, columns) = (sensor.pattern.rows(), sensor.pattern.columns());
    let height = rows.checked_mul(stretch(&sensor.pattern));
    let fits = |n: usize| n <= i32::MAX as usize;
    if height.is_some_and(fits) && fits(columns) {
        return Ok(());
    }
    Err(EncodeError::new(format!("a PNG can't hold {rows} × {columns} pixels")))
}

fn encode(preview: &SensorFrame, options: &Options) -> Result<Vec<u8>, EncodeError> {
    let SensorFrame { capture, frame, .. } = preview;
    if !capture.sensor.pattern.is_image() {
        return scattered(preview, options);
    }
    let stretch = stretch(&capture.sensor.pattern);
    let scale = Scale::of_frame(preview, options);
    let mut pixels = Vec::with_capacity(3 * frame.pixels() * stretch);
    let mut colours = first_ranges(preview).zip(frame.causes()).map(|(range_m, cause)| {
        range_m.map_or(miss_colour(*cause, NO_RETURN_COLOUR), |range_m| scale.colour(range_m))
    });
    for _ in 0..frame.rows() {
        let start = pixels.len();
        pixels.extend(colours.by_ref().take(frame.columns()).flatten());
        let end = pixels.len();
        for _ in 1..stretch {
            pixels.extend_from_within(start..end);
        }
    }
    let picture = Picture { width: frame.columns(), height: frame.rows() * stretch, pixels };
    finished(preview, picture, &scale, NO_RETURN_COLOUR)
}

/// The file of a picture, with a legend if it is wanted.
fn finished(
    preview: &SensorFrame,
    picture: Picture,
    scale: &Scale,
    no_return: Rgb,
) -> Result<Vec<u8>, EncodeError> {
    if !preview.legend {
        return picture.to_png();
    }
    let colour = |part: f64| scale.colour(scale.near * libm::exp(scale.log_far_over_near * part));
    let mut entries = vec![
        Entry::Ramp {
            name: "range, m".to_owned(),
            ticks: ticks(scale.near, scale.near * libm::exp(scale.log_far_over_near), true, 8),
            colour: &colour,
        },
        Entry::Swatch(no_return, "no return".to_owned()),
    ];
    if !preview.capture.sensor.pattern.is_image() {
        entries.push(Entry::Note("azimuth (left is positive) and elevation in degrees".to_owned()));
    }
    with_legend(picture, preview.name, &entries).to_png()
}

/// The range of each pixel's first return, row by row.
fn first_ranges<'a>(preview: &SensorFrame<'a>) -> impl Iterator<Item = Option<f64>> + use<'a> {
    let frame = preview.frame;
    (0..frame.pixels()).map(|pixel| frame.slot(pixel, 0).map(|slot| frame.returns().range_m[slot]))
}

/// The preview of a frame whose rows and columns are no picture. Each direction is drawn at its angles, and near returns
/// cover far ones.
fn scattered(preview: &SensorFrame, options: &Options) -> Result<Vec<u8>, EncodeError> {
    let SensorFrame { capture, frame, .. } = preview;
    let scale = Scale::of_frame(preview, options);
    let mut dots = Vec::with_capacity(frame.pixels());
    for (index, range_m) in first_ranges(preview).enumerate() {
        let pulse = capture.pulse(index / frame.columns(), index % frame.columns());
        let Some(pulse) = pulse else { continue };
        let (azimuth, elevation) = azimuth_elevation(pulse.direction);
        let miss = miss_colour(frame.causes()[index], MISS_COLOUR);
        let colour = range_m.map_or(miss, |range_m| scale.colour(range_m));
        dots.push((range_m.unwrap_or(f64::INFINITY), Dot { azimuth, elevation, colour }));
    }
    dots.sort_by(|a, b| b.0.total_cmp(&a.0));
    let picture = scatter(&dots.into_iter().map(|(_, dot)| dot).collect::<Vec<_>>())?;
    finished(preview, picture, &scale, MISS_COLOUR)
}

/// The colour of a pixel without a return, which is `usual` for most causes.
fn miss_colour(cause: Cause, usual: [u8; 3]) -> [u8; 3] {
    if cause == Cause::TooNear { TOO_NEAR_COLOUR } else { usual }
}

/// The colour of a direction without a return, in a plot whose background is [`NO_RETURN_COLOUR`].
const MISS_COLOUR: Rgb = [0x3a, 0x3a, 0x42];

/// The number of times that each row is repeated. A LiDAR has far fewer beams than firings. With its rows repeated, a
/// degree is about as tall as it is wide, so that a person recognises the scene.
fn stretch(pattern: &Pattern) -> usize {
    match pattern {
        Pattern::Rotating(p) => rows_a_beam(p),
        _ => 1,
    }
}

fn rows_a_beam(pattern: &Rotating) -> usize {
    let beams = pattern.beams();
    // The picture is at most half as tall as it is wide, whatever the angles are.
    let most = (pattern.columns() / (2 * beams.len())).max(1);
    let azimuth_step = pattern.azimuth_step().radians().abs();
    let [first, .., last] = beams else { return (pattern.columns() / 32).clamp(1, most) };
    let elevation_step = (first.elevation - last.elevation).radians() / (beams.len() - 1) as f64;
    // A float beyond usize saturates, and NaN (a single column and elevation) becomes 0.
    ((elevation_step / azimuth_step).round() as usize).clamp(1, most)
}

/// A logarithmic scale from ranges to colours. It is logarithmic because near surfaces fill most pixels and show most
/// detail.
struct Scale {
    near: f64,
    log_far_over_near: f64,
    /// The number of colours, or 0 for a smooth scale.
    steps: u32,
}

impl Scale {
    /// The scale that the options ask for.
    fn of_frame(preview: &SensorFrame, options: &Options) -> Self {
        // A scale that begins at 0 has no logarithm there: it begins at a millimetre, as a frame's own does.
        let (near, far) = (options.number(&NEAR).max(1e-3), options.number(&FAR));
        let scale = match far > 0.0 {
            true => Self { near, log_far_over_near: libm::log(far.max(near) / near), steps: 0 },
            false => Self::of(first_ranges(preview).flatten()),
        };
        Self { steps: options.number(&STEPS) as u32, ..scale }
    }

    /// A scale that spans the ranges except for 1 % at either end, so that an outlier does not flatten the rest.
    fn of(ranges: impl Iterator<Item = f64>) -> Self {
        // Ranges below a millimetre are raised to it, because the logarithm needs a positive least range.
        let mut ranges: Vec<f32> = ranges.map(|r| (r as f32).max(1e-3)).collect();
        let mut percentile = |percent: usize| {
            let index = ranges.len().saturating_sub(1) * percent / 100;
            let nth = (!ranges.is_empty()).then(|| *ranges.select_nth_unstable_by(index, f32::total_cmp).1);
            f64::from(nth.unwrap_or(1.0))
        };
        let (near, far) = (percentile(1), percentile(99));
        Self { near, log_far_over_near: libm::log(far / near), steps: 0 }
    }

    fn colour(&self, range: f64) -> Rgb {
        let t = match self.log_far_over_near {
            0.0 => 0.5,
            log => (libm::log(range / self.near) / log).clamp(0.0, 1.0),
        };
        // A step has the colour of its middle.
        let t = match f64::from(self.steps) {
            0.0 => t,
            steps => ((t * steps).floor().min(steps - 1.0) + 0.5) / steps,
        };
        // The ends of Turbo are nearly black, and would look like a miss.
        let colour = colorous::TURBO.eval_continuous(0.95 - 0.87 * t);
        [colour.r, colour.g, colour.b]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle::Angle;
    use crate::sensor::Beam;

    fn lidar(elevations_deg: &[f64], columns: usize) -> Rotating {
        let beam = |&e: &f64| Beam {
            elevation: Angle::deg(e),
            azimuth_offset: Angle::default(),
            time_s: 0.0,
            file_index: 0,
        };
        let turn = (Angle::deg(180.0), Angle::deg(-180.0));
        Rotating::new(elevations_deg.iter().map(beam).collect(), columns, turn, 10.0).unwrap()
    }

    #[test]
    fn rows_are_repeated_until_a_degree_is_as_tall_as_wide() {
        // The beams are 2° apart, and the columns 0.2°.
        let vlp16: Vec<f64> = (0..16).map(|i| f64::from(i) * 2.0 - 15.0).collect();
        assert_eq!(rows_a_beam(&lidar(&vlp16, 1800)), 10);
        let dense: Vec<f64> = (0..128).map(|i| f64::from(i) * 0.1).collect();
        assert_eq!(rows_a_beam(&lidar(&dense, 1024)), 1);
        // A single beam has no step, and two beams far apart would make the picture too tall.
        assert_eq!(rows_a_beam(&lidar(&[0.0], 640)), 20);
        assert_eq!(rows_a_beam(&lidar(&[-80.0, 80.0], 360)), 90);
        assert_eq!(rows_a_beam(&lidar(&[0.0], 1)), 1);
        assert_eq!(rows_a_beam(&lidar(&[1.0, 1.0], 1)), 1);
    }

    #[test]
    fn one_outlier_does_not_flatten_the_scale() {
        let scale = Scale::of((0..1000).map(|i| if i == 0 { 1e6 } else { 1.0 + f64::from(i) / 1000.0 }));
        let [near, middle, far] = [1.0, 1.5, 2.0].map(|range| scale.colour(range));
        assert!(near[0] > near[2], "red is near: {near:?}");
        assert!(middle[1] > middle[0] && middle[1] > middle[2], "green is between: {middle:?}");
        assert!(far[2] > far[0], "blue is far: {far:?}");
    }

    #[test]
    fn a_scale_of_steps_has_so_many_colours() {
        let colours = |steps| {
            let scale = Scale { near: 1.0, log_far_over_near: libm::log(100.0), steps };
            let colours = (0..1000).map(|i| scale.colour(libm::exp(f64::from(i) / 200.0)));
            colours.collect::<std::collections::BTreeSet<_>>().len()
        };
        assert_eq!([16, 64].map(colours), [16, 64]);
        assert!(colours(0) > 128);
    }

    #[test]
    fn nothing_or_one_range_has_a_scale_too() {
        Scale::of([].into_iter()).colour(1.0);
        let same = Scale::of([3.0; 5].into_iter());
        assert_eq!(same.colour(3.0), same.colour(3.0 + 1e-9));
        assert_ne!(same.colour(0.0), NO_RETURN_COLOUR);
    }
}
