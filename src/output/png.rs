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
    let colours = Colours::of(&scale, frame.pixels());
    let row_bytes = 3 * frame.columns();
    let mut pixels = vec![0; row_bytes * frame.rows() * stretch];
    let mut ranges = first_ranges(preview).zip(frame.causes());
    for rows in pixels.chunks_exact_mut((row_bytes * stretch).max(1)) {
        let (row, copies) = rows.split_at_mut(row_bytes);
        for (pixel, (range_m, cause)) in row.as_chunks_mut::<3>().0.iter_mut().zip(ranges.by_ref()) {
            *pixel = match range_m {
                Some(range_m) => colours.colour(range_m),
                None => miss_colour(*cause, NO_RETURN_COLOUR),
            };
        }
        copies.chunks_exact_mut(row_bytes.max(1)).for_each(|copy| copy.copy_from_slice(row));
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
        let ranges: Vec<f32> = ranges.map(|r| (r as f32).max(1e-3)).collect();
        let last = ranges.len().saturating_sub(1);
        let [near, far] = smallest(&ranges, [last / 100, last * 99 / 100]).map(f64::from);
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

/// The numbers with these places in the order of size of positive ones. They are 1 if there are none.
fn smallest(numbers: &[f32], places: [usize; 2]) -> [f32; 2] {
    // Positive floats are in the order of their bits. Those that share the upper bits are counted, so that few have to be sorted.
    let upper = |number: &f32| (number.to_bits() >> 16) as usize;
    let mut counts = vec![0_usize; 1 << 16];
    numbers.iter().for_each(|number| counts[upper(number)] += 1);
    places.map(|place| {
        let mut before = 0;
        let at = counts.iter().position(|count| {
            before += count;
            before > place
        });
        let Some(at) = at else { return 1.0 };
        let mut near: Vec<f32> = numbers.iter().copied().filter(|number| upper(number) == at).collect();
        *near.select_nth_unstable_by(place - (before - counts[at]), f32::total_cmp).1
    })
}

/// The colours of a scale by the upper bits of ranges.
///
/// Within a cell of ranges with equal upper bits, the colour is that of both ends if these have the same. Else it is computed. A
/// colour of Turbo that goes another way and comes back needs 0.8 % of the scale for it, and a cell is shorter. Closer together are
/// only thresholds at which the last bits decide: there a colour can be one step of 255 off, as in 3 of the street's 262,144 pixels.
struct Colours<'s> {
    scale: &'s Scale,
    /// The bits of a range that are below those of its cell.
    shift: u32,
    /// The number of the first cell.
    first: u64,
    /// The colours at the least ranges of the cells, and at the end of the last. It is empty if cells would not pay.
    ends: Vec<Rgb>,
}

impl<'s> Colours<'s> {
    /// The colours for so many pixels.
    fn of(scale: &'s Scale, pixels: usize) -> Self {
        const MANTISSA_BITS: u32 = f64::MANTISSA_DIGITS - 1;
        const MOST_CELLS: u64 = 1 << 14;
        // A cell is at most this part of an octave long.
        const FEWEST_BITS: u32 = 7;
        let far = scale.near * libm::exp(scale.log_far_over_near);
        let cells = |bits: u32| {
            let number = |range: f64| range.to_bits() >> (MANTISSA_BITS - bits);
            (number(scale.near), number(far) + 1 - number(scale.near))
        };
        let bits = (FEWEST_BITS..=12).rev().find(|bits| cells(*bits).1 <= MOST_CELLS).unwrap_or(FEWEST_BITS);
        let ((first, count), shift) = (cells(bits), MANTISSA_BITS - bits);
        // The length of a cell as a part of the scale.
        let part = 1.0 / (f64::from(1 << bits) * scale.log_far_over_near);
        let pays = part < 0.008 && count as usize * 4 < pixels;
        let end = |cell: u64| scale.colour(f64::from_bits((first + cell) << shift));
        let ends = if pays { (0..=count).map(end).collect() } else { Vec::new() };
        Self { scale, shift, first, ends }
    }

    fn colour(&self, range: f64) -> Rgb {
        let cell = (range.to_bits() >> self.shift).wrapping_sub(self.first) as usize;
        match self.ends.get(cell..cell.saturating_add(2)) {
            Some([start, end]) if start == end => *start,
            _ => self.scale.colour(range),
        }
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
    fn numbers_are_found_by_their_place() {
        let numbers: Vec<f32> = (0..5000_u32).map(|i| 1e-3 + (i * 7919 % 5000) as f32 * 0.01).collect();
        let mut sorted = numbers.clone();
        sorted.sort_by(f32::total_cmp);
        for places in [[0, 4999], [49, 4949], [1234, 1235]] {
            assert_eq!(smallest(&numbers, places), places.map(|place| sorted[place]));
        }
        assert_eq!(smallest(&[], [0, 0]), [1.0; 2]);
    }

    #[test]
    fn colours_of_cells_are_those_of_the_scale() {
        for (near, far) in [(1.0, 1.04), (3.5, 63.0), (0.001, 100_000.0), (7.0, 7.0), (0.5, 4.0)] {
            for steps in [0, 16] {
                let scale = Scale { near, log_far_over_near: libm::log(far / near), steps };
                let colours = Colours::of(&scale, 1 << 21);
                assert_eq!(colours.ends.is_empty(), near == far, "{near} to {far}");
                // Below the scale and above it, and nothing at all, too.
                for i in -50..20_050 {
                    let range = near * libm::exp(libm::log(far / near) * f64::from(i) / 20_000.0);
                    assert_eq!(colours.colour(range), scale.colour(range), "{range} of {near} to {far}");
                }
                assert_eq!([0.0, -1.0].map(|r| colours.colour(r)), [0.0, -1.0].map(|r| scale.colour(r)));
                assert!(Colours::of(&scale, 100).ends.is_empty(), "so few pixels need no table");
            }
        }
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
