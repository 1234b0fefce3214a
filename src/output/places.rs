//! Pixels of a row, each with one of its returns, for the values of channels.

use crate::scan::{Cause, Frame};

/// A pixel, and the slot of one of its returns in the columns of [`Returns`](crate::scan::Returns).
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// The row of the pixel. Rows and columns have 32 bits so that a place is handed over in registers.
    pub row: u32,
    /// The column of the pixel.
    pub column: u32,
    /// The slot of the return.
    pub slot: usize,
}

impl Place {
    /// The slot of a pixel without the return.
    const NO_SLOT: usize = usize::MAX;

    pub(super) fn row(self) -> usize {
        self.row as usize
    }

    pub(super) fn column(self) -> usize {
        self.column as usize
    }
}

/// Pixels of a row of a frame, each with one of its returns or without it.
pub(super) struct Places<'f> {
    row: usize,
    slots: SlotsOf<'f>,
}

enum SlotsOf<'f> {
    /// All pixels of the row, whose slots are their own numbers, from this one on. Those whose cause is [`Cause::Surface`]
    /// have the return.
    Pixels(usize, &'f [Cause]),
    /// Any pixels of the row. Those without the return have [`Place::NO_SLOT`].
    Listed(Vec<Place>),
}

impl<'f> Places<'f> {
    /// All pixels of a row, each with its return number `number`, from 0.
    pub fn of_return(frame: &'f Frame, row: usize, number: usize) -> Self {
        let first = row * frame.columns();
        if let (Some(causes), 0) = (frame.causes_of_own_slots(), number) {
            return Self { row, slots: SlotsOf::Pixels(first, &causes[first..first + frame.columns()]) };
        }
        let place = |column: u32| Place {
            row: row as u32,
            column,
            slot: frame.slot(first + column as usize, number).unwrap_or(Place::NO_SLOT),
        };
        Self { row, slots: SlotsOf::Listed((0..frame.columns() as u32).map(place).collect()) }
    }

    /// Returns of a row.
    pub fn listed(row: usize, places: Vec<Place>) -> Self {
        Self { row, slots: SlotsOf::Listed(places) }
    }

    /// The row.
    pub fn row(&self) -> usize {
        self.row
    }

    /// Adds the value of each place, or `none` where there is no return. `of_slots` is a column of the frame's returns.
    #[inline(always)]
    fn add<T: Copy>(&self, of_slots: &[T], none: u32, value: impl Fn(Place, T) -> u32, bits: &mut Vec<u32>) {
        let row = self.row as u32;
        match &self.slots {
            SlotsOf::Pixels(first, causes) => {
                let pixels = causes.iter().zip(&of_slots[*first..*first + causes.len()]);
                bits.extend((0..).zip(pixels).map(|(column, (cause, of_slot))| {
                    // The value is computed in any case, so that the compiler can compute several at once.
                    let value = value(Place { row, column, slot: first + column as usize }, *of_slot);
                    if *cause == Cause::Surface { value } else { none }
                }));
            }
            SlotsOf::Listed(places) => bits.extend(places.iter().map(|place| match place.slot {
                Place::NO_SLOT => none,
                slot => value(*place, of_slots[slot]),
            })),
        }
    }

    /// Adds the value of each return, or `none` where there is none.
    pub fn add_each(&self, none: u32, value: impl Fn(Place) -> u32, bits: &mut Vec<u32>) {
        let row = self.row as u32;
        match &self.slots {
            SlotsOf::Pixels(first, causes) => {
                bits.extend((0..).zip(*causes).map(|(column, cause)| match cause {
                    Cause::Surface => value(Place { row, column, slot: first + column as usize }),
                    _ => none,
                }));
            }
            SlotsOf::Listed(places) => bits.extend(places.iter().map(|place| match place.slot {
                Place::NO_SLOT => none,
                _ => value(*place),
            })),
        }
    }

    /// The line of a channel that these places have.
    pub fn line<'l>(&'l self, none: u32, bits: &'l mut Vec<u32>) -> Line<'l> {
        Line { places: self, none, bits }
    }
}

/// The values of a channel in a row, which the channel's rule adds at once.
///
/// A pixel without a return has the channel's value for that, whatever the rule says.
pub struct Line<'l> {
    places: &'l Places<'l>,
    none: u32,
    bits: &'l mut Vec<u32>,
}

impl Line<'_> {
    /// The row of the image.
    pub fn row(&self) -> usize {
        self.places.row
    }

    /// Adds measurements: each follows from the column of the pixel and from what the return has in `of_slots`, which is one of
    /// the [`Returns`](crate::scan::Returns). Each is rounded once from 64 bits to 32.
    #[inline(always)]
    pub fn measure<T: Copy>(&mut self, of_slots: &[T], value: impl Fn(usize, T) -> f64) {
        let value = |at: Place, of_slot| (value(at.column(), of_slot) as f32).to_bits();
        self.places.add(of_slots, self.none, value, self.bits);
    }

    /// Adds ids: each follows from what the return has in `of_slots`, which is one of the [`Returns`](crate::scan::Returns).
    #[inline(always)]
    pub fn number<T: Copy>(&mut self, of_slots: &[T], id: impl Fn(T) -> u32) {
        self.places.add(of_slots, self.none, |_, of_slot| id(of_slot), self.bits);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frame::BODY_FROM_OPTICAL;
    use crate::output::{CHANNELS, ChannelSpec, Image, NO_RETURN_M, Samples, SensorFrame, id_of};
    use crate::scan::Return;
    use crate::sensor::{Capture, sensors_of_each_kind};
    use glam::DVec3;

    /// The pixels of a capture: most see a surface, and every cause of an ideal sensor occurs.
    fn pixels(capture: &Capture) -> Vec<(Cause, Return)> {
        let (rows, columns) = (capture.rows(), capture.columns());
        let pixel = |i: usize| {
            let number = i as f32;
            // Some components are zeros of either sign.
            let normal = [number / 256.0 - 0.5, if i.is_multiple_of(3) { 0.0 } else { 0.25 }, -0.0];
            let one = Return {
                range_m: 1.0 / 3.0 + 0.7 * i as f64,
                intensity: 0.01 * number,
                normal,
                instance: i as u32 % 5,
                label: i as u32 % 3,
                triangle: 1000 + i as u32,
            };
            let cause = match i % 9 {
                _ if capture.pulse(i / columns, i % columns).is_none() => Cause::NoPulse,
                2 => Cause::Nothing,
                5 => Cause::TooNear,
                7 => Cause::OutOfRange,
                _ => Cause::Surface,
            };
            (cause, one)
        };
        (0..rows * columns).map(pixel).collect()
    }

    /// The bits of every channel of the returns with a number.
    fn bits(frame: &SensorFrame, number: usize) -> Vec<(String, Vec<u32>)> {
        let specs = CHANNELS.iter().filter(|spec| spec.is_of(frame.capture.sensor));
        let image = Image::with_channels(frame, number, specs);
        let bits = |samples: Samples| match samples {
            Samples::F32(values) => values.into_iter().map(f32::to_bits).collect(),
            Samples::U32(values) => values,
        };
        image.channels.into_iter().map(|channel| (channel.name, bits(channel.samples))).collect()
    }

    /// The bits of a channel at one pixel, by the definition of the channel. `None` of a channel that is not written a line at a time.
    fn of_pixel(capture: &Capture, pixel: usize, (cause, one): (Cause, Return), name: &str) -> Option<u32> {
        let is_surface = cause == Cause::Surface;
        let bits = |value: f64, none: f64| (if is_surface { value as f32 } else { none as f32 }).to_bits();
        let pulse = capture.pulse(pixel / capture.columns(), pixel % capture.columns());
        let pulse = || pulse.expect("a surface is met by a pulse");
        let normal = || {
            let in_sensor = DVec3::from_array(one.normal.map(f64::from));
            match capture.sensor.pattern.is_camera() {
                true => BODY_FROM_OPTICAL.rotation.transpose() * in_sensor + DVec3::ZERO,
                false => in_sensor,
            }
        };
        let id = |id: u32| if is_surface { id } else { 0 };
        Some(match name {
            "Z" if is_surface => bits(one.range_m * pulse().direction.x, NO_RETURN_M),
            "Z" | "range" => bits(one.range_m, NO_RETURN_M),
            "time" if is_surface => bits(pulse().time_s, 0.0),
            "time" => 0,
            "cause" => cause.number(),
            "id.instance" => id(id_of(one.instance)),
            "id.semantic" => id(one.label),
            "id.triangle" => id(id_of(one.triangle)),
            "intensity" => bits(one.intensity.into(), 0.0),
            "normal.X" => bits(normal().x, 0.0),
            "normal.Y" => bits(normal().y, 0.0),
            "normal.Z" => bits(normal().z, 0.0),
            _ => return None,
        })
    }

    /// A line has the bits of its pixels, whether their returns are in slots of their own or in a list of slots.
    #[test]
    fn a_line_has_the_values_of_its_pixels() {
        for sensor in sensors_of_each_kind() {
            let capture = Capture::at_origin(&sensor);
            let (rows, columns) = (capture.rows(), capture.columns());
            let pixels = pixels(&capture);
            let own = Frame::of_own_slots(rows, columns, &pixels);
            assert!(own.causes_of_own_slots().is_some());
            let listed = Frame::from_pixels(
                rows,
                columns,
                pixels.iter().map(|(cause, one)| match cause {
                    Cause::Surface | Cause::TooNear => (*cause, std::slice::from_ref(one)),
                    _ => (*cause, &[][..]),
                }),
            );
            assert_eq!((own.hits(), own.most_returns()), (listed.hits(), listed.most_returns()));
            let [own, listed] = [&own, &listed].map(|frame| SensorFrame::new(capture, frame, "top"));
            let mut checked = 0;
            for number in [0, 1] {
                assert_eq!(bits(&own, number), bits(&listed, number), "{}", sensor.pattern.name());
            }
            for (name, values) in bits(&own, 0) {
                for (pixel, value) in values.into_iter().enumerate() {
                    if let Some(expected) = of_pixel(&capture, pixel, pixels[pixel], &name) {
                        assert_eq!(value, expected, "{} {name} {pixel}", sensor.pattern.name());
                        checked += 1;
                    }
                }
            }
            let whole_channels = if sensor.pattern.is_camera() { 11 } else { 10 };
            assert_eq!(checked, whole_channels * rows * columns);
        }
    }

    /// A rule that gives a line and a rule that gives a value agree.
    #[test]
    fn a_rule_of_a_line_is_that_of_its_values() {
        use crate::output::Values;
        let spec = |values| ChannelSpec { no_return: -1.0, values, ..CHANNELS[0] };
        let by_line = spec(Values::F32Line(|f, line| {
            line.measure(&f.frame.returns().range_m, |column, range_m| range_m + column as f64);
        }));
        let by_value = spec(Values::F32(|f, at| f.frame.returns().range_m[at.slot] + f64::from(at.column)));
        let sensors = sensors_of_each_kind();
        let sensor = sensors.iter().find(|sensor| sensor.pattern.is_camera()).unwrap();
        let capture = Capture::at_origin(sensor);
        let frame = Frame::of_own_slots(capture.rows(), capture.columns(), &pixels(&capture));
        let frame = SensorFrame::new(capture, &frame, "top");
        let [one, other] = [by_line, by_value].map(|spec| Image::with_channels(&frame, 0, [&spec]).channels);
        assert_eq!(one, other);
    }
}
