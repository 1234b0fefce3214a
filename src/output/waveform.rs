//! The waveform of every pulse of a frame as NumPy's NPZ: the exact Gaussians of each sum, and samples of it on request.

use rayon::prelude::*;
use serde_json::{Map, Value, json};

use super::channel::BYTES_A_VALUE;
use super::deflate::LEVEL;
use super::format::{Content, EncodeError, Field, FormatSpec, Kind, field};
use super::npz::{self, Array, COMPRESSED, archive, bytes};
use super::options::{OptionSpec, OptionValues, Options};
use super::sensor_frame::{SensorFrame, pose_as_json};
use crate::physics::SPEED_OF_LIGHT_M_S;
use crate::physics::echo::Part;
use crate::scan::Waveforms;
use crate::sensor::{Receiver, Sensor};

/// The arrays. Every Gaussian of a file has the sigma of the pulse, so `sigma` is one number.
static ARRAYS: [Field; 6] = [
    field("offsets", "uint32", "rows × columns + 1 places in `range` and `amplitude`"),
    field("range", "float64", "m, of the middle of each Gaussian"),
    field(
        "amplitude",
        "float64",
        "signal-to-noise ratio; without range pairs relative to a white plane at 1 m",
    ),
    field("sigma", "float64", "m, one number: the standard deviation of all Gaussians"),
    field(
        "samples",
        "float32",
        "the heights at `from_m` + k·`bin_m`, rows × columns × samples, in the unit of `amplitude`; only with `bin_m`",
    ),
    field("about", "bytes", "text: JSON with threshold, noise and unit, and the places of samples"),
];

/// The sums are those that the receiver of the scan looks for peaks in, whole: no part is left out, and none is rounded.
pub(super) static FORMAT: FormatSpec = FormatSpec {
    name: "waveform",
    ending: "waveform.npz",
    about: "the waveform of every pulse of a sensor that is not ideal",
    content: Content::Arrays(&ARRAYS),
    read_by: "NumPy",
    options: &[BIN, FROM, TO, COMPRESSED, LEVEL],
    check_options,
    check,
    // This counts the arrays, the members and the file.
    encoding_bytes_a_ray: |sensor, options| 3 * file_bytes_a_ray(sensor, options),
    file_bytes_a_ray,
    kind: Kind::File(encode),
    ..FormatSpec::PLAIN
};

/// The largest range of an option, in metres.
const MOST_M: f64 = 1e6;

const BIN: OptionSpec = OptionSpec {
    name: "bin_m",
    about: "The distance in range between two samples of the waveform, in metres; 0: there are no samples, only the exact sum.",
    values: OptionValues::Number { least: 0.0, most: MOST_M, default: 0.0 },
};
const FROM: OptionSpec = OptionSpec {
    name: "from_m",
    about: "The range of the first sample.",
    values: OptionValues::Number { least: 0.0, most: MOST_M, default: 0.0 },
};
const TO: OptionSpec = OptionSpec {
    name: "to_m",
    about: "The range that the last sample lies at or before; 0: the sensor's largest range.",
    values: OptionValues::Number { least: 0.0, most: MOST_M, default: 0.0 },
};

/// The places of samples.
struct Grid {
    from_m: f64,
    bin_m: f64,
    count: u64,
}

impl Grid {
    /// The grid that options ask of a sensor. `None` if they ask for none.
    fn of(sensor: &Sensor, options: &Options) -> Option<Self> {
        let [bin_m, from_m, to_m] = [&BIN, &FROM, &TO].map(|option| options.number(option));
        if bin_m == 0.0 {
            return None;
        }
        let to_m = if to_m > 0.0 { to_m } else { sensor.range.max_m };
        // A window of a whole number of bins has its last sample, whatever the rounding: of 10⁶ m in bins of 1 mm it is 10⁻⁷ bins.
        let bins = ((to_m - from_m) / bin_m + 1e-6).floor();
        let count = if bins >= 0.0 { (bins as u64).saturating_add(1) } else { 0 };
        Some(Self { from_m, bin_m, count })
    }

    fn range_m(&self, sample: u64) -> f64 {
        self.from_m + sample as f64 * self.bin_m
    }
}

fn check_options(options: &Options) -> Result<(), EncodeError> {
    npz::check_options(options)?;
    let [bin_m, from_m, to_m] = [&BIN, &FROM, &TO].map(|option| options.number(option));
    let window = [&FROM, &TO].into_iter().find(|option| options.given(option).is_some());
    match window {
        Some(option) if bin_m == 0.0 => Err(EncodeError::new(format!(
            "`{}` is about samples, and needs their distance: `bin_m = 0.1`",
            option.name
        ))),
        _ if to_m > 0.0 && from_m >= to_m => {
            Err(EncodeError::new(format!("`from_m` is {from_m}, and has to be less than `to_m`, {to_m}")))
        }
        _ => Ok(()),
    }
}

fn file_bytes_a_ray(sensor: &Sensor, options: &Options) -> u64 {
    let exact = Waveforms::parts_a_pulse(sensor) * size_of::<Part>() + size_of::<u32>();
    let samples = Grid::of(sensor, options).map_or(0, |grid| grid.count);
    (exact as u64).saturating_add(samples.saturating_mul(BYTES_A_VALUE))
}

fn check(sensor: &Sensor, options: &Options) -> Result<(), EncodeError> {
    if sensor.measurement.is_ideal() {
        return Err(EncodeError::new(
            "the sensor is ideal, and an ideal sensor has no waveform: `receiver` or `footprint` gives it one, and so does \
             `nominal = true` with a preset that has the figures of its data sheet",
        ));
    }
    if let Some(Grid { from_m, count, .. }) = Grid::of(sensor, options) {
        if options.number(&TO) == 0.0 && !sensor.range.max_m.is_finite() {
            return Err(EncodeError::new(
                "the sensor's range has no end, so that samples need one: `to_m = 100`",
            ));
        }
        if count == 0 {
            let most_m = sensor.range.max_m;
            return Err(EncodeError::new(format!(
                "`from_m` is {from_m}, beyond the sensor's largest range, {most_m} m"
            )));
        }
    }
    let (rows, columns) = (sensor.pattern.rows() as u64, sensor.pattern.columns() as u64);
    let bytes = rows.saturating_mul(columns).saturating_mul(file_bytes_a_ray(sensor, options));
    if bytes < u64::from(u32::MAX) {
        return Ok(());
    }
    Err(EncodeError::new(format!(
        "an NPZ has less than 4 GiB, and the waveforms of {rows} × {columns} pixels take {bytes} bytes: fewer samples would fit"
    )))
}

fn encode(frame: &SensorFrame, options: &Options) -> Result<Vec<u8>, EncodeError> {
    let waveforms = frame.frame.waveforms().ok_or_else(|| {
        EncodeError::new("the frame was cast without its waveforms, which have to be asked for before")
    })?;
    let grid = Grid::of(frame.capture.sensor, options);
    let parts = waveforms.parts();
    let too_many = |_| EncodeError::new("an NPZ has less than 4 GiB, and the waveforms have too many parts");
    u32::try_from(parts.len()).map_err(too_many)?;
    let array = |name: &str, kind: &str, shape: &[usize], bytes| Array {
        name: name.to_owned(),
        kind: kind.to_owned(),
        shape: shape.to_vec(),
        bytes,
    };
    let offsets = waveforms.first().iter().map(|&first| (first as u32).to_le_bytes());
    let mut arrays = vec![
        array("offsets", "<u4", &[waveforms.first().len()], bytes(offsets)),
        array("range", "<f8", &[parts.len()], bytes(parts.iter().map(|part| part.range_m.to_le_bytes()))),
        array("amplitude", "<f8", &[parts.len()], bytes(parts.iter().map(|part| part.energy.to_le_bytes()))),
        array("sigma", "<f8", &[], waveforms.sigma_m().to_le_bytes().to_vec()),
    ];
    if let Some(grid) = &grid {
        let shape = [frame.frame.rows(), frame.frame.columns(), grid.count as usize];
        arrays.push(array("samples", "<f4", &shape, samples(waveforms, frame.frame.pixels(), grid)));
    }
    arrays.push(Array::text("about", &about(frame, waveforms, grid.as_ref(), &arrays)));
    archive(arrays, npz::compression(options))
}

/// The heights of all waveforms on a grid, pixel by pixel.
fn samples(waveforms: &Waveforms, pixels: usize, grid: &Grid) -> Vec<u8> {
    let row = grid.count as usize * BYTES_A_VALUE as usize;
    let mut bytes = vec![0; pixels * row];
    bytes.par_chunks_exact_mut(row).enumerate().for_each(|(pixel, bytes)| {
        let waveform = waveforms.waveform(pixel);
        if waveforms.of_pixel(pixel).is_empty() {
            return;
        }
        for (sample, place) in (0..).zip(bytes.chunks_exact_mut(BYTES_A_VALUE as usize)) {
            place.copy_from_slice(&(waveform.height(grid.range_m(sample)) as f32).to_le_bytes());
        }
    });
    bytes
}

fn about(frame: &SensorFrame, waveforms: &Waveforms, grid: Option<&Grid>, arrays: &[Array]) -> Value {
    let sensor = frame.capture.sensor;
    let threshold = waveforms.threshold();
    let unit = match threshold {
        Some(_) => "signal-to-noise ratio",
        None => "relative to a white plane at 1 m",
    };
    let facts: Map<String, Value> = arrays
        .iter()
        .map(|array| {
            let unit = match array.name.as_str() {
                "range" | "sigma" => "m",
                "amplitude" | "samples" => unit,
                _ => "",
            };
            (array.name.clone(), array.facts(unit))
        })
        .collect();
    let default_receiver = Receiver::default();
    let receiver = sensor.measurement.receiver.as_ref().unwrap_or(&default_receiver);
    let saturation = receiver.saturation_snr;
    json!({
        "sensor": frame.name,
        "pattern": sensor.pattern.name(),
        "rows": frame.frame.rows(),
        "columns": frame.frame.columns(),
        "world_from_sensor": pose_as_json(&frame.world_from_sensor()),
        "unit": unit,
        "threshold": threshold,
        // Heights are told in standard deviations of the noise, if it is known.
        "noise": threshold.map(|_| 1.0),
        "saturation": saturation.is_finite().then_some(saturation),
        "pulse_fwhm_s": receiver.pulse_fwhm_s,
        "sigma_m": waveforms.sigma_m(),
        "seconds_per_metre": 2.0 / SPEED_OF_LIGHT_M_S,
        "samples": grid.map(|grid| json!({ "from_m": grid.from_m, "bin_m": grid.bin_m, "count": grid.count })),
        "arrays": facts,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::{Camera, Measurement, Pattern};

    fn sensor(most_m: f64) -> Sensor {
        let camera = Camera::from_hfov((4, 3), crate::angle::Angle::deg(60.0), None).unwrap();
        let measurement = Measurement { receiver: Some(Receiver::default()), ..Measurement::default() };
        let mut sensor = Sensor { measurement, ..Sensor::new(Pattern::Camera(camera)) };
        sensor.range.max_m = most_m;
        sensor
    }

    fn options(given: &[(&OptionSpec, f64)]) -> Options {
        let mut options = Options::none(FORMAT.options);
        given.iter().for_each(|(option, value)| options.set(option, *value));
        options
    }

    #[test]
    fn a_window_of_whole_bins_has_both_of_its_ends() {
        for (bin_m, from_m, to_m, count) in
            [(0.1, 0.0, 0.3, 4), (0.1, 0.7, 1.0, 4), (0.15, 5.0, 80.0, 501), (0.4, 0.0, 1.0, 3)]
        {
            let grid =
                Grid::of(&sensor(9.0), &options(&[(&BIN, bin_m), (&FROM, from_m), (&TO, to_m)])).unwrap();
            assert_eq!(grid.count, count, "{bin_m} {from_m} {to_m}");
        }
        let to_the_end = Grid::of(&sensor(9.0), &options(&[(&BIN, 3.0)])).unwrap();
        assert_eq!((to_the_end.count, to_the_end.range_m(3)), (4, 9.0));
        assert!(Grid::of(&sensor(9.0), &options(&[])).is_none());
    }

    #[test]
    fn what_cannot_be_written_is_told_before() {
        let told = |sensor: &Sensor, given: &[(&OptionSpec, f64)]| {
            let options = options(given);
            check_options(&options).and_then(|()| check(sensor, &options)).map_err(|e| e.to_string())
        };
        assert_eq!(told(&sensor(9.0), &[(&BIN, 0.1)]), Ok(()));
        for (sensor, given, problem) in [
            (
                Sensor { measurement: Measurement::default(), ..sensor(9.0) },
                &[][..],
                "ideal sensor has no waveform",
            ),
            (sensor(9.0), &[(&TO, 3.0)], "`to_m` is about samples, and needs their distance"),
            (sensor(9.0), &[(&BIN, 0.1), (&FROM, 5.0), (&TO, 5.0)], "has to be less than `to_m`, 5"),
            (sensor(f64::INFINITY), &[(&BIN, 0.1)], "samples need one: `to_m = 100`"),
            (sensor(9.0), &[(&BIN, 0.1), (&FROM, 10.0)], "beyond the sensor's largest range, 9 m"),
            (sensor(9.0), &[(&BIN, 1e-8)], "less than 4 GiB"),
        ] {
            let found = told(&sensor, given).unwrap_err();
            assert!(found.contains(problem), "{found}");
        }
    }
}
