//! The clouds of LiDARs as messages: `sensor_msgs/PointCloud2` in one of the layouts, and `livox_ros_driver2/CustomMsg`.

use std::ops::Range;

use super::super::format::EncodeError;
use super::super::points::Point;
use super::super::sensor_frame::SensorFrame;
use super::cdr::Message;
use super::layouts::{Layout, Type, Value};
use super::messages::header;
use super::settings::Settings;
use crate::physics::intensity::IntensityScale;
use crate::sensor::Sensor;

/// The stamp of a frame's messages.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stamp {
    /// The stamp in nanoseconds.
    pub ns: i64,
    /// The same moment in seconds from the frame's start. Times of points count from it.
    pub from_start_s: f64,
}

/// What is told of a pixel or of one of its returns.
struct Sample {
    position_m: [f32; 3],
    intensity: f32,
    ring: usize,
    /// The time of the pulse from the frame's start; `None` if there is no pulse.
    time_s: Option<f64>,
    range_m: f64,
    number: usize,
    return_type: u8,
}

/// A cloud that is being written.
struct Cloud<'c> {
    seen: &'c SensorFrame<'c>,
    stamp: Stamp,
    /// The factor that brings the sensor's intensity to 0 to 255.
    intensity: f32,
}

/// The content of a frame's `PointCloud2` with the name of the points' frame.
///
/// # Errors
/// An error if a time or the number of a beam does not fit its field.
pub(super) fn point_cloud(
    seen: &SensorFrame,
    settings: &Settings,
    layout: &Layout,
    stamp: Stamp,
    frame_id: &str,
) -> Result<Vec<u8>, EncodeError> {
    let (frame, cloud) = (seen.frame, Cloud::new(seen, stamp));
    let (width, height) =
        if settings.organised { (frame.columns(), frame.rows()) } else { (frame.return_count(), 1) };
    let size = width * height * layout.step;
    if u32::try_from(size).is_err() {
        return Err(EncodeError::new(format!("a cloud has at most 2³² bytes, and this one has {size}")));
    }
    let mut message = Message::with_capacity(size + 1024);
    header(&mut message, stamp.ns, frame_id);
    message.u32(height as u32);
    message.u32(width as u32);
    message.length(layout.fields.len());
    for field in &layout.fields {
        message.text(field.name);
        message.u32(field.offset as u32);
        message.u8(field.kind as u8);
        message.u32(1);
    }
    message.bool(false);
    message.u32(layout.step as u32);
    message.u32((width * layout.step) as u32);
    let mut result = Ok(());
    message.bytes_of(|bytes| {
        let mut add = |sample: &Sample| cloud.add(sample, layout, bytes);
        result = if settings.organised { cloud.each_pixel(&mut add) } else { cloud.each_in_time(&mut add) };
    });
    // A cloud is dense if no coordinate is NaN.
    message.bool(!settings.organised);
    result.map(|()| message.into_bytes())
}

/// The content of a frame's `CustomMsg`.
///
/// # Errors
/// An error if a time or the number of a beam does not fit its field.
pub(super) fn custom_message(
    seen: &SensorFrame,
    stamp: Stamp,
    frame_id: &str,
) -> Result<Vec<u8>, EncodeError> {
    let (cloud, count) = (Cloud::new(seen, stamp), seen.frame.return_count());
    let mut message = Message::with_capacity(20 * count + 256);
    header(&mut message, stamp.ns, frame_id);
    message.u64(stamp.ns.max(0) as u64);
    message.u32(count as u32);
    // The number of the LiDAR, and three bytes that are kept for later.
    (0..4).for_each(|_| message.u8(0));
    message.length(count);
    cloud.each_in_time(&mut |sample| {
        let whole = |value, kind| cloud.number(sample, value, kind).map(|number| number as u32);
        message.u32(whole(Value::Since(1e9), Type::U32)?);
        sample.position_m.into_iter().for_each(|coordinate| message.f32(coordinate));
        for value in [Value::Intensity, Value::Tag, Value::Ring] {
            message.u8(whole(value, Type::U8)? as u8);
        }
        Ok(())
    })?;
    Ok(message.into_bytes())
}

/// The factor that brings the intensities of a sensor to 0 to 255: those of makers' scales are so already.
fn intensity_factor(sensor: &Sensor) -> f32 {
    match sensor.measurement.receiver.as_ref().map_or(IntensityScale::Ideal, |receiver| receiver.intensity) {
        IntensityScale::Ideal => 255.0,
        _ => 1.0,
    }
}

impl<'c> Cloud<'c> {
    fn new(seen: &'c SensorFrame<'c>, stamp: Stamp) -> Self {
        Self { seen, stamp, intensity: intensity_factor(seen.capture.sensor) }
    }

    /// Appends a point.
    fn add(&self, sample: &Sample, layout: &Layout, bytes: &mut Vec<u8>) -> Result<(), EncodeError> {
        let start = bytes.len();
        bytes.resize(start + layout.step, 0);
        for field in &layout.fields {
            let number = self.number(sample, field.value, field.kind)?;
            field.kind.write(number, &mut bytes[start + field.offset..]);
        }
        Ok(())
    }

    /// The number of a field, rounded if the field holds whole ones.
    fn number(&self, sample: &Sample, value: Value, kind: Type) -> Result<f64, EncodeError> {
        let [x, y, z] = sample.position_m.map(f64::from);
        let since_s = sample.time_s.map_or(0.0, |time_s| time_s - self.stamp.from_start_s);
        let at_ns = || (self.stamp.ns + (since_s * 1e9).round() as i64) as f64;
        let number = match value {
            Value::Coordinate(axis) => f64::from(sample.position_m[axis]),
            Value::Intensity => f64::from((sample.intensity * self.intensity).min(255.0)),
            Value::Ring => sample.ring as f64,
            Value::Since(parts) => since_s * parts,
            Value::Seconds => at_ns() / 1e9,
            Value::Nanoseconds => at_ns(),
            // What an EXR says decides how it is rounded.
            Value::Millimetres => f64::from(sample.range_m as f32) * 1000.0,
            Value::Nothing => 0.0,
            Value::Tag => f64::from((sample.number.min(3) as u8) << 4),
            Value::ReturnType => f64::from(sample.return_type),
            Value::Azimuth => libm::atan2(y, x),
            Value::Elevation => libm::atan2(z, (x * x + y * y).sqrt()),
            Value::Distance => (x * x + y * y + z * z).sqrt(),
        };
        if kind.most().is_infinite() {
            return Ok(number);
        }
        let number = number.round();
        match value {
            Value::Since(_) if !(0.0..=kind.most()).contains(&number) => Err(EncodeError::new(format!(
                "a time of {since_s:?} s from the message's stamp does not fit a field of whole numbers: `cloud_time` \"raw\" has \
                 times that do"
            ))),
            Value::Ring if number > kind.most() => Err(too_many_rings(number, kind.most())),
            // A range that is too far for the field has its largest number.
            _ => Ok(number.min(kind.most())),
        }
    }

    /// Calls `add` with each return in the order of time. Those of one time, and of one pixel, stay in the frame's order.
    ///
    /// # Errors
    /// The first error of `add`.
    fn each_in_time(
        &self,
        add: &mut impl FnMut(&Sample) -> Result<(), EncodeError>,
    ) -> Result<(), EncodeError> {
        let (frame, capture) = (self.seen.frame, &self.seen.capture);
        let (rows, columns) = (frame.rows(), frame.columns());
        let mut pixels = Vec::with_capacity(frame.pixels());
        // A LiDAR fires column by column, so that most of the order is there already.
        for column in 0..columns {
            for row in (0..rows).filter(|row| !frame.slots(row * columns + column).is_empty()) {
                pixels.push((capture.time_s(row, column).unwrap_or(0.0), row, column));
            }
        }
        pixels.sort_by(|a, b| a.0.total_cmp(&b.0));
        let fixed = self.seen.fixed_cloud_from_sensor();
        for (_, row, column) in pixels {
            let slots = frame.slots(row * columns + column);
            let mut each = |point: &Point| add(&self.sample(point, &slots));
            self.seen.points_of_pixel((row, column), slots.clone(), fixed, &mut each)?;
        }
        Ok(())
    }

    /// Calls `add` with each pixel, row by row.
    ///
    /// # Errors
    /// The first error of `add`.
    fn each_pixel(
        &self,
        add: &mut impl FnMut(&Sample) -> Result<(), EncodeError>,
    ) -> Result<(), EncodeError> {
        let (frame, capture) = (self.seen.frame, &self.seen.capture);
        let fixed = self.seen.fixed_cloud_from_sensor();
        for pixel in 0..frame.pixels() {
            let (row, column) = (pixel / frame.columns(), pixel % frame.columns());
            let slots = frame.slots(pixel);
            if slots.is_empty() {
                add(&Sample {
                    position_m: [f32::NAN; 3],
                    intensity: 0.0,
                    ring: capture.sensor.ring(row),
                    time_s: capture.time_s(row, column),
                    range_m: 0.0,
                    number: 0,
                    return_type: 0,
                })?;
                continue;
            }
            let first = slots.start..slots.start + 1;
            let mut each = |point: &Point| add(&self.sample(point, &slots));
            self.seen.points_of_pixel((row, column), first, fixed, &mut each)?;
        }
        Ok(())
    }

    /// A return of a pixel whose returns are in `slots`.
    fn sample(&self, point: &Point, slots: &Range<usize>) -> Sample {
        Sample {
            position_m: point.position_m,
            intensity: point.hit.intensity,
            ring: point.ring,
            time_s: Some(point.time_s),
            range_m: point.hit.range_m,
            number: point.number,
            return_type: self.return_type(point, slots),
        }
    }

    /// The number of the kind of return that Autoware's filters know.
    fn return_type(&self, point: &Point, slots: &Range<usize>) -> u8 {
        if self.seen.capture.sensor.most_returns() == 1 {
            return 1;
        }
        if slots.len() == 1 {
            return 7;
        }
        let returns = self.seen.frame.returns();
        let is_strongest = slots.clone().all(|slot| {
            let (own, other) = (returns.intensity[point.slot], returns.intensity[slot]);
            own > other || own == other && point.slot <= slot
        });
        match (is_strongest, point.number) {
            (true, 0) => 3,
            (true, _) => 4,
            (false, 0) => 5,
            (false, _) => 6,
        }
    }
}

/// Checks that the beams of a LiDAR fit the field of their numbers.
///
/// # Errors
/// An error that says how many fit.
pub(super) fn check_rings(sensor: &Sensor, settings: &Settings) -> Result<(), EncodeError> {
    let most = settings.layout.as_ref().map_or(Type::U8.most(), Layout::most_ring);
    let largest = (0..sensor.pattern.rows()).map(|row| sensor.ring(row)).max().unwrap_or(0) as f64;
    if largest > most { Err(too_many_rings(largest, most)) } else { Ok(()) }
}

fn too_many_rings(largest: f64, most: f64) -> EncodeError {
    EncodeError::new(format!("a point's ring is at most {most} in this layout, and can't hold {largest}"))
}
