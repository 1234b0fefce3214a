//! Frames that are made anew of the range images of a run, by the sensors that its manifest tells of. So a format writes of an image what it
//! writes of the frame itself: the image has the ranges, and the sensor the beams.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::config::recorded_sensor;
use crate::error::Error;
use crate::frame::Pose;
use crate::output::recorded::{Folder, FrameKey, Output, Part, ReadError, read_manifest};
use crate::output::{EncodeError, Format, Image, Manifest, SensorFrame, index_of, pose_of_toml};
use crate::scan::{Cause, Echo, Frame, NO_OBJECT, Return};
use crate::sensor::{Capture, Sensor};

/// The sensors of a run, by its manifest.
#[derive(Debug)]
pub struct Remade {
    /// By name, each with its number in the rig. A sensor that is alone may have none.
    sensors: BTreeMap<Option<String>, (u32, Result<Sensor, String>)>,
    /// The time at which the frames 0 start.
    start_s: f64,
    seed: u64,
    is_moving: bool,
}

impl Remade {
    /// The sensors of a folder's run.
    ///
    /// # Errors
    /// [`Error::Input`] if the manifest can't be read.
    pub fn of(folder: &Folder) -> Result<Self, Error> {
        let bytes = folder.read_bytes(Manifest::NAME, MOST_MANIFEST_BYTES)?;
        let head = read_manifest(&bytes[..], |_: Output| ());
        let head = head.map_err(|e: ReadError| Error::input(folder.path().join(Manifest::NAME), e))?;
        let job = head.get("job").cloned().unwrap_or_default();
        let listed = job.get("sensor").and_then(Value::as_array).into_iter().flatten();
        let sensor = |(index, table): (usize, &Value)| {
            let name = table.get("name").and_then(Value::as_str).map(str::to_owned);
            (name, (index as u32, recorded_sensor(table).map(|file| file.sensor)))
        };
        let start_s = job.pointer("/sequence/start_s").and_then(Value::as_f64).unwrap_or(0.0);
        let seed = head.get("seed").and_then(Value::as_u64).unwrap_or(0);
        let is_moving = job.get("trajectory").is_some();
        Ok(Self { sensors: listed.enumerate().map(sensor).collect(), start_s, seed, is_moving })
    }

    /// The file of a frame in a format, and what is to be known about it.
    ///
    /// # Errors
    /// An [`EncodeError`] if the manifest does not tell the sensor, if the image is not of it, or if the format can't hold the frame.
    pub fn encode(
        &self,
        key: &FrameKey,
        parts: &[Part],
        format: Format,
    ) -> Result<(Vec<u8>, Vec<String>), EncodeError> {
        let of_name = self.sensors.get(&Some(key.sensor().to_owned())).or_else(|| self.sensors.get(&None));
        let (index, sensor) = of_name
            .ok_or_else(|| EncodeError::new(format!("the manifest tells of no sensor {:?}", key.sensor())))?;
        let sensor = sensor.as_ref().map_err(|problem| {
            EncodeError::new(format!(
                "the manifest does not tell where the beams of {:?} went: {problem}",
                key.sensor()
            ))
        })?;
        format.check(sensor)?;
        let frame = frame_of(parts, sensor)?;
        let capture = Capture::at_origin(sensor).with_frame(key.frame().unwrap_or(0));
        let capture = Capture { seed: self.seed, ..capture.in_sequence(self.start_s, false).of_rig(*index) };
        let capture = Capture { body_from_sensor: pose_of(parts), ..capture };
        let file = format.encode(&SensorFrame::new(capture, &frame, key.sensor()))?;
        let mut notes = Vec::new();
        if self.is_moving {
            notes.push(
                "the sensor moved: each point is as the sensor saw it at the time of its own pulse, and the pose is that of the \
                 frame's start"
                    .to_owned(),
            );
        }
        Ok((file, notes))
    }
}

/// The largest manifest that is read, as those of folders.
const MOST_MANIFEST_BYTES: u64 = 64 << 20;

/// Where the sensor was when the frame started, by the image's header; at the world's origin if that does not say it.
fn pose_of(parts: &[Part]) -> Pose {
    let text = parts.first().and_then(|part| part.attributes.get("beamcast:world_from_sensor"));
    text.and_then(|text| pose_of_toml(text)).unwrap_or(Pose::IDENTITY)
}

/// The values of an image's returns.
struct Columns<'p> {
    range: &'p [f32],
    intensity: &'p [f32],
    label: &'p [u32],
    instance: &'p [u32],
    /// The cause of the return or of there being none, its signal-to-noise ratio and the echo's width, of a sensor that is not ideal.
    echo: Option<[Values<'p>; 3]>,
}

/// Numbers of either type.
#[derive(Clone, Copy)]
enum Values<'p> {
    F32(&'p [f32]),
    U32(&'p [u32]),
}

impl<'p> Columns<'p> {
    fn of(image: &'p Image, sensor: &Sensor) -> Result<Self, EncodeError> {
        let lacks =
            |name: &str| EncodeError::new(format!("its image has no channel `{name}`, which a frame needs"));
        let f32s = |name: &str| image.f32(name).ok_or_else(|| lacks(name));
        let u32s = |name: &str| image.u32(name).ok_or_else(|| lacks(name));
        let echo = match sensor.measurement.is_ideal() {
            true => None,
            false if sensor.measurement.depth.is_some() => {
                Some([Values::U32(u32s("cause")?), Values::F32(&[]), Values::F32(&[])])
            }
            false => Some([
                Values::U32(u32s("cause")?),
                Values::F32(f32s("snr")?),
                Values::F32(f32s("echo_width")?),
            ]),
        };
        Ok(Self {
            range: f32s("range")?,
            intensity: f32s("intensity")?,
            label: u32s("id.semantic")?,
            instance: u32s("id.instance")?,
            echo,
        })
    }

    fn get(&self, pixel: usize) -> Option<(Return, Echo)> {
        let range = self.range[pixel];
        let number = |values: Values| match values {
            Values::F32(values) => values.get(pixel).copied().unwrap_or(0.0),
            Values::U32(values) => values.get(pixel).copied().unwrap_or(0) as f32,
        };
        let [cause, snr, width_m] = self.echo.map_or([0.0; 3], |echo| echo.map(number));
        let cause = Cause::numbered(cause as u32).unwrap_or(Cause::Surface);
        let one = Return {
            range_m: f64::from(range),
            intensity: self.intensity[pixel],
            label: self.label[pixel],
            instance: index_of(self.instance[pixel]).unwrap_or(NO_OBJECT),
            ..Return::default()
        };
        range.is_finite().then_some((one, Echo { cause, snr, width_m, ..Echo::default() }))
    }
}

/// The frame of an image and those of its further returns.
fn frame_of(parts: &[Part], sensor: &Sensor) -> Result<Frame, EncodeError> {
    let (rows, columns) = (sensor.pattern.rows(), sensor.pattern.columns());
    let is_of_returns = |part: &&Part| part.image.f32("range").is_some();
    let parts: Vec<&Part> = parts.iter().filter(is_of_returns).collect();
    let Some(first) = parts.first() else {
        return Err(EncodeError::new("its image has no channel `range`, which a frame needs"));
    };
    if let Some(part) = parts.iter().find(|part| (part.image.rows, part.image.columns) != (rows, columns)) {
        let Image { rows: own, columns: of, .. } = part.image;
        return Err(EncodeError::new(format!(
            "its image has {own} rows of {of} pixels, and the manifest's sensor {rows} of {columns}"
        )));
    }
    let images = parts.iter().map(|part| Columns::of(&part.image, sensor)).collect::<Result<Vec<_>, _>>()?;
    let causes = first.image.u32("cause");
    let (mut returns, mut echoes): (Vec<Vec<Return>>, Vec<Echo>) =
        (Vec::with_capacity(rows * columns), Vec::new());
    for pixel in 0..rows * columns {
        let of_pixel: Vec<(Return, Echo)> = images.iter().filter_map(|image| image.get(pixel)).collect();
        returns.push(of_pixel.iter().map(|(one, _)| *one).collect());
        echoes.extend(of_pixel.iter().map(|(_, echo)| *echo));
    }
    let cause = |pixel: usize| {
        let told = causes.and_then(|causes| Cause::numbered(causes[pixel]));
        // A pixel that something came back from has a cause that is one of returns.
        match returns[pixel].is_empty() {
            false => told
                .filter(|cause| ![Cause::TooNear, Cause::NoPulse].contains(cause))
                .unwrap_or(Cause::Surface),
            true => told.filter(|cause| *cause != Cause::Surface).unwrap_or(Cause::Nothing),
        }
    };
    let frame = Frame::from_pixels(
        rows,
        columns,
        (0..rows * columns).map(|pixel| (cause(pixel), &returns[pixel][..])),
    );
    Ok(if sensor.measurement.is_ideal() { frame } else { frame.with_echoes(echoes) })
}
