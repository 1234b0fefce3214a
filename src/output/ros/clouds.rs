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
        let at_ns = || self.stamp.ns.saturating_add((since_s * 1e9).round() as i64) as f64;
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
            Value::Since(_) if number < 0.0 => Err(EncodeError::new(format!(
                "a point's time {since_s:?} s from the message's stamp does not fit a field of whole numbers: `cloud_time` \"raw\" \
                 has none before it"
            ))),
            Value::Since(parts) if number > kind.most() => Err(too_long(since_s, kind.most() / parts)),
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

/// Checks that the beams of a LiDAR fit the field of their numbers, and the length of its frames that of times.
///
/// # Errors
/// An error that says how many fit, or how long.
pub(super) fn check(sensor: &Sensor, settings: &Settings) -> Result<(), EncodeError> {
    let (most_ring, most_s) = settings
        .layout
        .as_ref()
        .map_or((Type::U8.most(), Type::U32.most() / 1e9), |layout| (layout.most_ring(), layout.most_s()));
    let largest = (0..sensor.pattern.rows()).map(|row| sensor.ring(row)).max().unwrap_or(0) as f64;
    if largest > most_ring {
        return Err(too_many_rings(largest, most_ring));
    }
    let lasts_s = sensor.pattern.last_pulse_s() - sensor.pattern.first_pulse_s().min(0.0);
    if lasts_s > most_s { Err(too_long(lasts_s, most_s)) } else { Ok(()) }
}

fn too_long(since_s: f64, most_s: f64) -> EncodeError {
    EncodeError::new(format!(
        "a point's time is at most {most_s} s in this layout, and can't hold {since_s:?} s: \"velodyne\" and \"hesai\" can"
    ))
}

fn too_many_rings(largest: f64, most: f64) -> EncodeError {
    EncodeError::new(format!("a point's ring is at most {most} in this layout, and can't hold {largest}"))
}

#[cfg(test)]
mod tests {
    use super::super::super::options::{OptionValue, Options};
    use super::super::settings::{LAYOUT, OPTIONS, ORGANISED, TIME_UNIT};
    use super::*;
    use crate::angle::Angle;
    use crate::scan::{Cause, Frame, Return};
    use crate::sensor::{Beam, Capture, Pattern, RangeLimits, RingOrder, Rotating};

    /// Two beams, of which the upper one fires 40 µs before its column's time; three columns in a tenth of a second.
    fn lidar() -> Sensor {
        let beam = |elevation, time_s| Beam {
            elevation: Angle::deg(elevation),
            azimuth_offset: Angle::default(),
            time_s,
            file_index: 0,
        };
        let turn = (Angle::deg(180.0), Angle::deg(-180.0));
        let beams = vec![beam(10.0, -40e-6), beam(-10.0, 2e-6)];
        Sensor {
            pattern: Pattern::Rotating(Rotating::new(beams, 3, turn, 10.0).unwrap()),
            range: RangeLimits::default(),
            ring: RingOrder::BottomUp,
            measurement: Default::default(),
        }
    }

    fn hit(range_m: f64, intensity: f32) -> Return {
        Return { range_m, intensity, instance: 0, label: 0, normal: [0.0, 0.6, 0.8], triangle: 0 }
    }

    fn frame() -> Frame {
        let (one, two, far) = ([hit(2.0, 0.5)], [hit(3.0, 0.25), hit(4.0004, 1.5)], [hit(5.0, 0.0)]);
        let pixels: [(Cause, &[Return]); 6] = [
            (Cause::Surface, &one),
            (Cause::Nothing, &[]),
            (Cause::Surface, &two),
            (Cause::Surface, &far),
            (Cause::Nothing, &[]),
            (Cause::Nothing, &[]),
        ];
        Frame::from_pixels(2, 3, pixels)
    }

    fn settings(layout: &'static str, organised: bool, unit: Option<&'static str>) -> Settings {
        let mut options = Options::none(OPTIONS);
        options.set(&LAYOUT, OptionValue::Text(layout));
        options.set(&ORGANISED, f64::from(u8::from(organised)));
        if let Some(unit) = unit {
            options.set(&TIME_UNIT, OptionValue::Text(unit));
        }
        Settings::of(&options)
    }

    const STAMP: Stamp = Stamp { ns: 1_000_000_000 - 40_000, from_start_s: -40e-6 };

    /// The bytes of the points of a cloud, and whether it is dense.
    fn points(settings: &Settings, stamp: Stamp) -> Result<(Vec<Vec<u8>>, bool), String> {
        let (sensor, frame) = (lidar(), frame());
        let seen = SensorFrame::new(Capture::at_origin(&sensor), &frame, "top");
        let layout = settings.layout.as_ref().unwrap();
        let message = point_cloud(&seen, settings, layout, stamp, "top").map_err(|e| e.to_string())?;
        let count = if settings.organised { 6 } else { 4 };
        let data = &message[message.len() - 1 - count * layout.step..message.len() - 1];
        let is_dense = message[message.len() - 1] == 1;
        Ok((data.chunks(layout.step).map(<[u8]>::to_vec).collect(), is_dense))
    }

    fn f32_at(point: &[u8], at: usize) -> f32 {
        f32::from_le_bytes(point[at..at + 4].try_into().unwrap())
    }

    fn u32_at(point: &[u8], at: usize) -> u32 {
        u32::from_le_bytes(point[at..at + 4].try_into().unwrap())
    }

    #[test]
    fn points_come_in_the_order_of_time_with_times_from_the_stamp() {
        let (points, is_dense) = points(&settings("velodyne", false, None), STAMP).unwrap();
        assert!(is_dense);
        // The upper beam's return of the first column, the lower one's, and both of the last column.
        let rings: Vec<u8> = points.iter().map(|point| point[16]).collect();
        assert_eq!(rings, [1, 0, 1, 1]);
        let times: Vec<f32> = points.iter().map(|point| f32_at(point, 18)).collect();
        let last = 2.0 * 0.1 / 3.0;
        let expected = [0.0, 42e-6, last, last];
        assert!(times.iter().zip(expected).all(|(a, b)| (a - b as f32).abs() < 1e-9), "{times:?}");
        // 255 times the ideal intensity, and no more than 255.
        let intensities: Vec<f32> = points.iter().map(|point| f32_at(point, 12)).collect();
        assert_eq!(intensities, [127.5, 0.0, 63.75, 255.0]);
    }

    #[test]
    fn an_organised_cloud_has_all_pixels() {
        let (points, is_dense) = points(&settings("ouster", true, None), STAMP).unwrap();
        assert!(!is_dense);
        let is_missing: Vec<bool> = points.iter().map(|point| f32_at(point, 0).is_nan()).collect();
        assert_eq!(is_missing, [false, true, false, false, true, true]);
        let times: Vec<u32> = points.iter().map(|point| u32_at(point, 20)).collect();
        // A third of a tenth of a second from column to column; the lower beam is 42 µs later.
        assert_eq!(times, [0, 33_333_333, 66_666_667, 42_000, 33_375_333, 66_708_667]);
        let millimetres: Vec<u32> = points.iter().map(|point| u32_at(point, 32)).collect();
        assert_eq!(millimetres, [2000, 0, 3000, 5000, 0, 0]);
    }

    #[test]
    fn each_layout_has_its_time() {
        let last = |name, unit, at: usize| {
            let points = points(&settings(name, false, unit), STAMP).unwrap().0;
            points[3][at..].to_vec()
        };
        // The last column's own time is 66,666,667 ns after the start at 1 s, and 40 µs more after the stamp; its upper beam fires
        // 40 µs before it.
        let seconds = f64::from_le_bytes(last("hesai", None, 18)[..8].try_into().unwrap());
        assert_eq!(seconds, 1.066_626_667);
        assert_eq!(last("robosense", None, 18), last("hesai", None, 18));
        let nanoseconds = f64::from_le_bytes(last("livox", None, 18)[..8].try_into().unwrap());
        assert_eq!(nanoseconds, 1_066_626_667.0);
        assert_eq!(last("livox", None, 16)[..2], [1 << 4, 1]);
        for (unit, factor) in [("s", 1.0), ("ms", 1e3), ("us", 1e6)] {
            let time = f32_at(&last("fast_lio", Some(unit), 18), 0);
            assert_eq!(time, (0.1 * 2.0 / 3.0 * factor) as f32, "{unit}");
        }
        assert_eq!(u32_at(&last("fast_lio", Some("ns"), 18), 0), 66_666_667);
        let of_autoware = last("autoware", None, 12);
        assert_eq!((of_autoware[0], of_autoware[2], u32_at(&of_autoware, 16)), (255, 1, 66_666_667));
    }

    #[test]
    fn a_time_before_the_stamp_fits_no_whole_number() {
        let late = Stamp { from_start_s: 0.05, ..STAMP };
        let problem = points(&settings("ouster", false, None), late).unwrap_err();
        assert!(problem.contains("does not fit") && problem.contains("\"raw\""), "{problem}");
        // Floats are negative then.
        let points = points(&settings("velodyne", false, None), late).unwrap().0;
        assert_eq!(f32_at(&points[0], 18), (-40e-6_f64 - 0.05) as f32);
    }

    #[test]
    fn livoxs_own_message_has_aligned_points() {
        let (sensor, frame) = (lidar(), frame());
        let seen = SensorFrame::new(Capture::at_origin(&sensor), &frame, "top");
        let message = custom_message(&seen, STAMP, "top").unwrap();
        // Encapsulation, stamp, "top" with its length and end, timebase, count, four bytes, length: 4 + 8 + 8 + 8 + 4 + 4 + 4.
        assert_eq!(u64::from_le_bytes(message[20..28].try_into().unwrap()), 999_960_000);
        assert_eq!((u32_at(&message, 28), u32_at(&message, 36)), (4, 4));
        let points: Vec<&[u8]> = message[40..].chunks(20).collect();
        assert_eq!(
            points.iter().map(|point| u32_at(point, 0)).collect::<Vec<_>>(),
            [0, 42_000, 66_666_667, 66_666_667]
        );
        // Reflectivity, rounded; the number of the return in the tag; the line.
        assert_eq!(
            points.iter().map(|point| &point[16..19]).collect::<Vec<_>>(),
            [&[128, 0, 1], &[0, 0, 0], &[64, 0, 1], &[255, 16, 1],]
        );
        // The last point has no padding behind it.
        assert_eq!(points[3].len(), 19);
    }

    #[test]
    fn layouts_hold_so_many_beams() {
        let beams: Vec<Beam> = (0..300)
            .map(|i| Beam {
                elevation: Angle::deg(f64::from(i) / 10.0),
                azimuth_offset: Angle::default(),
                time_s: 0.0,
                file_index: 0,
            })
            .collect();
        let turn = (Angle::deg(180.0), Angle::deg(-180.0));
        let sensor =
            Sensor { pattern: Pattern::Rotating(Rotating::new(beams, 3, turn, 10.0).unwrap()), ..lidar() };
        assert!(check(&sensor, &settings("velodyne", false, None)).is_ok());
        for layout in ["livox", "livox_custom"] {
            let problem = check(&sensor, &settings(layout, false, None)).unwrap_err().to_string();
            assert!(problem.contains("at most 255") && problem.contains("299"), "{problem}");
        }
    }
    #[test]
    fn whole_nanoseconds_hold_four_seconds() {
        let turn = (Angle::deg(180.0), Angle::deg(-180.0));
        let beam = Beam {
            elevation: Angle::default(),
            azimuth_offset: Angle::default(),
            time_s: 0.0,
            file_index: 0,
        };
        // A turn of 8 s, of whose two columns the second fires after 4 s.
        let slow = |rate_hz| Sensor {
            pattern: Pattern::Rotating(Rotating::new(vec![beam], 2, turn, rate_hz).unwrap()),
            ..lidar()
        };
        for layout in ["ouster", "autoware", "livox_custom"] {
            assert!(check(&slow(0.125), &settings(layout, false, None)).is_ok());
            let problem = check(&slow(0.1), &settings(layout, false, None)).unwrap_err().to_string();
            assert!(problem.contains("at most 4.294967295 s") && problem.contains("5.0 s"), "{problem}");
        }
        assert!(check(&slow(0.1), &settings("hesai", false, None)).is_ok());
    }
}
