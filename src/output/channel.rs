//! The channels of frames, with one declaration each. A range image holds them, a baseline hashes them, and a page shows
//! them.

use std::ops::Range;

use super::id::id_of;
use super::places::{Line, Place, Places};
use super::sensor_frame::SensorFrame;
use crate::scan::{Cause, Echo, Returns};
use crate::sensor::{DepthSensing, Sensor};
use glam::DVec3;

/// The range and the depth of a pixel without a return, in metres. All other channels of such a pixel are 0, except for its
/// cause.
pub const NO_RETURN_M: f64 = f64::INFINITY;

/// The declaration of a channel, which holds one number for each pixel.
#[derive(Clone, Copy)]
pub struct ChannelSpec {
    /// The name in files and reports, such as `id.instance`.
    pub name: &'static str,
    /// The unit of the values, as messages write it. It is empty for numbers without a unit.
    pub unit: &'static str,
    /// A sentence about the content.
    pub about: &'static str,
    /// The value at a pixel without a return.
    pub no_return: f64,
    /// The sensors that have the channel.
    pub sensors: Sensors,
    /// The rule by which a value follows from a return.
    pub values: Values,
    /// The presentation on a page. `None` if pages leave the channel out.
    pub shown: Option<Shown>,
    /// Whether a file has the channel only if the job chooses it by name.
    pub is_chosen: bool,
}

/// The presentation of a channel on a page.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shown {
    /// The rank among the channels of a page. The least comes first.
    pub rank: u8,
    /// The name that people read.
    pub label: &'static str,
    /// The scale from values to colours.
    pub scale: Scale,
}

/// A scale from values to colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// A logarithmic scale, for distances.
    Log,
    /// A linear scale.
    Linear,
    /// The channel is the first of three axes of a direction, whose names end in X, Y and Z.
    Direction,
    /// A different colour for each number, for ids.
    Id,
}

/// The sensors that have a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sensors {
    /// All sensors.
    All,
    /// Sensors with planar depth.
    Cameras,
    /// Sensors that are not ideal.
    Measured,
    /// Sensors that measure the echoes of pulses.
    Pulsed,
    /// Depth cameras of two viewpoints.
    Stereo,
    /// Depth cameras of modulated light.
    TimeOfFlight,
}

/// The rule by which a channel's value follows from a return, with its type in files. Each value takes 4 bytes.
#[derive(Clone, Copy)]
pub enum Values {
    /// Measurements in the channel's unit. Each is rounded once from 64 bits to 32.
    F32(fn(&SensorFrame, Place) -> f64),
    /// Integer ids.
    U32(fn(&SensorFrame, Place) -> u32),
    /// Measurements that most files have. The rule gives those of a row at once, so that what its pixels share is looked up once.
    F32Line(fn(&SensorFrame, &mut Line)),
    /// Integer ids that most files have, those of a row at once.
    U32Line(fn(&SensorFrame, &mut Line)),
    /// Measurements that every pixel has, by the pixel's number, whether something came back or not.
    Image(fn(&SensorFrame, usize) -> f64),
    /// Numbers that stand for words, which every pixel has, whether something came back or not.
    OfPixel {
        /// Adds the numbers of the returns number k of pixels in a row, by their own numbers and k. There need not be such returns.
        numbers: fn(&SensorFrame, Range<usize>, usize, &mut Vec<u32>),
        /// The word that a number stands for.
        word: fn(u32) -> Option<&'static str>,
    },
}

/// Bytes of one value of a channel.
pub const BYTES_A_VALUE: u64 = 4;

/// What most channels have in common.
const PLAIN: ChannelSpec = ChannelSpec {
    name: "",
    unit: "",
    about: "",
    no_return: 0.0,
    sensors: Sensors::All,
    values: Values::U32(|_, _| 0),
    shown: None,
    is_chosen: false,
};

/// A channel of sensors that measure echoes.
const fn echo(
    name: &'static str,
    unit: &'static str,
    about: &'static str,
    value: fn(&SensorFrame, Place) -> f64,
) -> ChannelSpec {
    ChannelSpec { name, unit, about, sensors: Sensors::Pulsed, values: Values::F32(value), ..PLAIN }
}

/// A term of the error budget of ranges, which a job has to ask for.
const fn term(name: &'static str, about: &'static str, value: fn(&SensorFrame, Place) -> f64) -> ChannelSpec {
    ChannelSpec { is_chosen: true, sensors: Sensors::Measured, ..echo(name, "m", about, value) }
}

/// An image that depth cameras make beside their returns.
const fn image(
    name: &'static str,
    unit: &'static str,
    about: &'static str,
    sensors: Sensors,
    value: fn(&SensorFrame, usize) -> f64,
) -> ChannelSpec {
    ChannelSpec { name, unit, about, sensors, values: Values::Image(value), is_chosen: true, ..PLAIN }
}

/// A part of the colour of a surface.
const fn color(
    name: &'static str,
    about: &'static str,
    value: fn(&SensorFrame, Place) -> f64,
) -> ChannelSpec {
    ChannelSpec { name, about, values: Values::F32(value), is_chosen: true, ..PLAIN }
}

/// An axis of the displacement of a surface's point.
const fn flow(name: &'static str, about: &'static str, value: fn(&SensorFrame, Place) -> f64) -> ChannelSpec {
    ChannelSpec { name, unit: "m", about, values: Values::F32(value), is_chosen: true, ..PLAIN }
}

/// An axis of the velocity of a surface's point.
const fn velocity(
    name: &'static str,
    about: &'static str,
    value: fn(&SensorFrame, Place) -> f64,
) -> ChannelSpec {
    ChannelSpec { unit: "m/s", ..flow(name, about, value) }
}

/// Every channel, sorted by name. [`DEPTH_FOR_OPENCV`] is not among them, because it repeats one of them.
pub static CHANNELS: [ChannelSpec; 40] = [
    ChannelSpec {
        name: "Z",
        unit: "m",
        about: "The depth along the camera's optical axis.",
        no_return: NO_RETURN_M,
        sensors: Sensors::Cameras,
        values: Values::F32Line(|f, line| {
            let depths_over_ranges = f.capture.row(line.row()).depths_over_ranges(f.frame.columns());
            line.measure(&f.returns().range_m, |column, range_m| range_m * depths_over_ranges[column]);
        }),
        shown: Some(Shown { rank: 1, label: "depth", scale: Scale::Log }),
        ..PLAIN
    },
    image(
        "ambient",
        "e-",
        "The light that is not modulated, in electrons of all taps: the mean of the frequencies.",
        Sensors::TimeOfFlight,
        |f, pixel| of_pixel(&f.frame.images().ambient, pixel),
    ),
    image(
        "amplitude",
        "e-",
        "The amplitude of a tap by the modulated light, in electrons: the mean of the frequencies.",
        Sensors::TimeOfFlight,
        |f, pixel| of_pixel(&f.frame.images().amplitude, pixel),
    ),
    ChannelSpec {
        name: "cause",
        unit: "",
        about: "Why the pixel has no return, or what its return is of: 1 is a surface. The EXR's attribute beamcast:cause lists the \
                numbers. In the image of a further return, 0 is a pixel that lacks it.",
        no_return: 0.0, // every pixel has a cause
        sensors: Sensors::All,
        values: Values::OfPixel { numbers: causes, word: |number| Cause::numbered(number).map(Cause::name) },
        shown: Some(Shown { rank: 7, label: "cause", scale: Scale::Id }),
        ..PLAIN
    },
    color("color.B", "The linear blue of the surface, in the light of a lamp at the sensor.", |f, at| {
        f.color(at.slot)[2].into()
    }),
    color("color.G", "The linear green of the surface.", |f, at| f.color(at.slot)[1].into()),
    color(
        "color.R",
        "The linear red of the surface: its base colour with texture and vertex colour, times the cosine of the angle of incidence, 0 to 1.",
        |f, at| f.color(at.slot)[0].into(),
    ),
    image(
        "confidence",
        "",
        "How much better the best match is than the second best, 0 to 1.",
        Sensors::Stereo,
        |f, pixel| of_pixel(&f.frame.images().confidence, pixel),
    ),
    image(
        "disparity",
        "px",
        "The disparity that the camera finds; 0 is none.",
        Sensors::Stereo,
        |f, pixel| of_pixel(&f.frame.images().disparity, pixel),
    ),
    echo(
        "echo_width",
        "m",
        "The standard deviation of the echo in range: that of the pulse, widened by the spread of the ranges in the footprint.",
        |f, at| f.echo(at).width_m.into(),
    ),
    flow(
        "flow.X",
        "The x of the displacement of the surface's own point from when the pulse meets it to the frame's end (the start of the \
         next frame), over the ground: the sensor's motion is not in it. Along the axes of the normal.",
        |f, at| in_image(f, at, f.motion(at.slot).flow_m).x,
    ),
    flow("flow.Y", "The y of the displacement.", |f, at| in_image(f, at, f.motion(at.slot).flow_m).y),
    flow("flow.Z", "The z of the displacement.", |f, at| in_image(f, at, f.motion(at.slot).flow_m).z),
    ChannelSpec {
        name: "id.instance",
        unit: "",
        about: "The object that was hit, from 1: the manifest has its name. 0 is nothing.",
        no_return: 0.0,
        sensors: Sensors::All,
        values: Values::U32Line(|f, line| line.number(&f.returns().instance, id_of)),
        shown: Some(Shown { rank: 4, label: "instance", scale: Scale::Id }),
        ..PLAIN
    },
    ChannelSpec {
        name: "id.semantic",
        unit: "",
        about: "The semantic label of the object that was hit. 0 is no label, of a surface or of nothing.",
        no_return: 0.0,
        sensors: Sensors::All,
        values: Values::U32Line(|f, line| line.number(&f.returns().label, |label| label)),
        shown: Some(Shown { rank: 5, label: "label", scale: Scale::Id }),
        ..PLAIN
    },
    ChannelSpec {
        name: "id.track",
        about: "The track of the object that was hit, as boxes.jsonl numbers what moves and all else that has a box, from 1. 0 is \
                no such object, and nothing.",
        values: Values::U32(|f, at| f.track(at.slot)),
        is_chosen: true,
        ..PLAIN
    },
    ChannelSpec {
        name: "id.triangle",
        unit: "",
        about: "The triangle that was hit, from 1. 0 is nothing.",
        no_return: 0.0,
        sensors: Sensors::All,
        values: Values::U32Line(|f, line| line.number(&f.returns().triangle, id_of)),
        shown: None, // there are too many to tell apart
        ..PLAIN
    },
    term("ideal", "The exact range of the surface on the beam's axis, to which the terms add.", |f, at| {
        f.echo(at).terms.ideal_m
    }),
    ChannelSpec {
        name: "intensity",
        unit: "",
        about: "Reflectivity times the cosine of the angle of incidence, 0 to 1.",
        no_return: 0.0,
        sensors: Sensors::All,
        values: Values::F32Line(|f, line| {
            line.measure(&f.returns().intensity, |_, intensity| intensity.into())
        }),
        shown: Some(Shown { rank: 2, label: "intensity", scale: Scale::Linear }),
        ..PLAIN
    },
    image(
        "ir.left",
        "",
        "What the camera's own imager sees, in grey values from 0 to 255.",
        Sensors::Stereo,
        |f, pixel| of_pixel(&f.frame.images().ir_left, pixel),
    ),
    image(
        "ir.right",
        "",
        "What the second imager sees, in grey values from 0 to 255.",
        Sensors::Stereo,
        |f, pixel| of_pixel(&f.frame.images().ir_right, pixel),
    ),
    ChannelSpec {
        is_chosen: true,
        ..echo(
            "near_ir",
            "",
            "The sunlight that the surface scatters to the sensor, relative to a white plane that faces a sun of 100 klx.",
            |f, at| f.echo(at).ambient.into(),
        )
    },
    ChannelSpec {
        name: "normal.X",
        unit: "",
        about: "The x of the surface's unit normal towards the sensor, in the sensor's (a camera's optical) frame.",
        no_return: 0.0,
        sensors: Sensors::All,
        values: Values::F32Line(|f, line| normals(f, line, |normal| normal.x)),
        shown: Some(Shown { rank: 3, label: "normal", scale: Scale::Direction }),
        ..PLAIN
    },
    ChannelSpec {
        name: "normal.Y",
        unit: "",
        about: "The y of the surface's unit normal.",
        no_return: 0.0,
        sensors: Sensors::All,
        values: Values::F32Line(|f, line| normals(f, line, |normal| normal.y)),
        shown: None, // it is shown with the first axis
        ..PLAIN
    },
    ChannelSpec {
        name: "normal.Z",
        unit: "",
        about: "The z of the surface's unit normal.",
        no_return: 0.0,
        sensors: Sensors::All,
        values: Values::F32Line(|f, line| normals(f, line, |normal| normal.z)),
        shown: None, // it is shown with the first axis
        ..PLAIN
    },
    image(
        "phase.1",
        "rad",
        "The phase of the first frequency of modulation, 0 to 2π.",
        Sensors::TimeOfFlight,
        |f, pixel| of_pixel(&f.frame.images().phase_1, pixel),
    ),
    image(
        "phase.2",
        "rad",
        "The phase of the second frequency of modulation, 0 to 2π.",
        Sensors::TimeOfFlight,
        |f, pixel| of_pixel(&f.frame.images().phase_2, pixel),
    ),
    image(
        "phase.3",
        "rad",
        "The phase of the third frequency of modulation, 0 to 2π.",
        Sensors::TimeOfFlight,
        |f, pixel| of_pixel(&f.frame.images().phase_3, pixel),
    ),
    ChannelSpec {
        name: "range",
        unit: "m",
        about: "The range along the ray, from the point at which the sensor starts to count.",
        no_return: NO_RETURN_M,
        sensors: Sensors::All,
        values: Values::F32Line(|f, line| line.measure(&f.returns().range_m, |_, range_m| range_m)),
        shown: Some(Shown { rank: 0, label: "range", scale: Scale::Log }),
        ..PLAIN
    },
    echo(
        "snr",
        "",
        "The height of the echo's peak over the standard deviation of the noise. Without range pairs the noise is unknown, and the \
         peak is relative to a white plane at 1 m.",
        |f, at| f.echo(at).snr.into(),
    ),
    term(
        "term.angle",
        "The range's error because the pulse goes elsewhere than the sensor believes.",
        |f, at| f.echo(at).terms.angle_m,
    ),
    term("term.bias", "The bias of the beam.", |f, at| f.echo(at).terms.bias_m),
    term(
        "term.footprint",
        "The peak of all the light of the beam together, less the range on its axis. Of a depth camera, what other depths in the \
         pixel or its window and indirect light add, and all that matching two images does.",
        |f, at| f.echo(at).terms.footprint_m,
    ),
    term("term.noise", "The noise of this pulse.", |f, at| f.echo(at).terms.noise_m),
    term("term.rounding", "The rounding to the sensor's unit of ranges.", |f, at| {
        f.echo(at).terms.rounding_m
    }),
    term("term.walk", "What is left of the walk of a fixed threshold.", |f, at| f.echo(at).terms.walk_m),
    ChannelSpec {
        name: "time",
        unit: "s",
        about: "The time of the pulse from the frame's start.",
        no_return: 0.0,
        sensors: Sensors::All,
        values: Values::F32Line(|f, line| {
            let times_s = f.capture.row(line.row()).times_s(f.frame.columns());
            line.measure(&f.returns().range_m, |column, _| times_s[column]);
        }),
        shown: Some(Shown { rank: 6, label: "time", scale: Scale::Linear }),
        ..PLAIN
    },
    velocity(
        "velocity.X",
        "The x of the velocity of the surface's point when the pulse meets it, over the ground: the sensor's motion is not in it. \
         Along the axes of the normal.",
        |f, at| in_image(f, at, f.motion(at.slot).velocity_m_s).x,
    ),
    velocity("velocity.Y", "The y of the velocity.", |f, at| {
        in_image(f, at, f.motion(at.slot).velocity_m_s).y
    }),
    velocity("velocity.Z", "The z of the velocity.", |f, at| {
        in_image(f, at, f.motion(at.slot).velocity_m_s).z
    }),
];

/// The names of all channels, sorted.
pub const CHANNEL_NAMES: [&str; CHANNELS.len()] = names::<{ CHANNELS.len() }>(true);

/// The channels of the error budget, which `[output] terms` asks for.
pub const TERM_NAMES: [&str; 7] =
    ["ideal", "term.angle", "term.bias", "term.footprint", "term.noise", "term.rounding", "term.walk"];

/// The names of the channels that a frame has unasked, sorted: those that a baseline holds.
pub const UNASKED_CHANNEL_NAMES: [&str; count(false)] = names::<{ count(false) }>(false);

/// The number of channels, with or without those that a job must choose by name.
const fn count(with_chosen: bool) -> usize {
    let (mut count, mut i) = (0, 0);
    while i < CHANNELS.len() {
        count += (with_chosen || !CHANNELS[i].is_chosen) as usize;
        i += 1;
    }
    count
}

/// The names of these channels.
const fn names<const COUNT: usize>(with_chosen: bool) -> [&'static str; COUNT] {
    let mut names = [""; COUNT];
    let (mut found, mut i) = (0, 0);
    while i < CHANNELS.len() {
        if with_chosen || !CHANNELS[i].is_chosen {
            names[found] = CHANNELS[i].name;
            found += 1;
        }
        i += 1;
    }
    names
}

impl SensorFrame<'_> {
    fn returns(&self) -> &Returns {
        self.frame.returns()
    }

    fn echo(&self, at: Place) -> Echo {
        self.frame.echo(at.slot).copied().unwrap_or_default()
    }
}

/// The value of a pixel in an image of a depth camera. An image that the camera does not make is 0.
fn of_pixel(image: &[f32], pixel: usize) -> f64 {
    image.get(pixel).copied().unwrap_or(0.0).into()
}

/// Adds an axis of the normals of a line, in the frame to which the image refers.
#[inline(always)]
fn normals(f: &SensorFrame, line: &mut Line, axis: impl Fn(DVec3) -> f64) {
    let in_sensor = |normal: [f32; 3]| DVec3::from_array(normal.map(f64::from));
    let normals = &f.returns().normal;
    if f.capture.sensor.pattern.is_camera() {
        line.measure(normals, |_, normal| axis(optical(in_sensor(normal))));
    } else {
        line.measure(normals, |_, normal| axis(in_sensor(normal)));
    }
}

/// Adds the numbers of the causes of pixels of a row, or of their returns with a number.
fn causes(f: &SensorFrame, pixels: Range<usize>, number: usize, bits: &mut Vec<u32>) {
    match (f.frame.causes_of_own_slots(), number) {
        (Some(causes), 0) => bits.extend(causes[pixels].iter().map(|cause| cause.number())),
        _ => bits.extend(pixels.map(|pixel| f.frame.cause(pixel, number).map_or(0, Cause::number))),
    }
}

/// A vector of the world in the frame to which the image refers, as it is when the pixel's pulse is cast.
fn in_image(f: &SensorFrame, at: Place, in_world: DVec3) -> DVec3 {
    let Some(time_s) = f.capture.time_s(at.row(), at.column()) else { return DVec3::ZERO };
    from_sensor(f, f.capture.world_from_sensor(time_s).rotation.transpose() * in_world)
}

/// A vector of the sensor's frame in the frame to which the image refers.
fn from_sensor(f: &SensorFrame, vector: DVec3) -> DVec3 {
    if f.capture.sensor.pattern.is_camera() { optical(vector) } else { vector }
}

/// A vector of a camera's body frame (x forward, y left, z up) in its optical frame (x right, y down, z forward). Axes are only
/// swapped and negated, so nothing is rounded.
#[inline(always)]
fn optical(body: DVec3) -> DVec3 {
    // Adding 0 makes a negative zero positive.
    DVec3::new(-body.y, -body.z, body.x) + DVec3::ZERO
}

impl ChannelSpec {
    /// Whether the channel tells how surfaces move.
    pub fn is_of_motion(&self) -> bool {
        self.name.starts_with("flow.") || self.name.starts_with("velocity.")
    }

    /// Whether the channel tells the colours of surfaces.
    pub fn is_of_color(&self) -> bool {
        self.name.starts_with("color.")
    }

    /// Appends the channel's value at each pixel of a row, of its return number `number`: the number, or the bits of the
    /// measurement as 32 bits. `places` are [those of the returns](Places::of_return).
    pub(super) fn add_row(&self, frame: &SensorFrame, number: usize, places: &Places, bits: &mut Vec<u32>) {
        let columns = frame.frame.columns();
        let pixels = places.row() * columns..(places.row() + 1) * columns;
        match self.values {
            Values::Image(value) => bits.extend(pixels.map(|pixel| bits_of(value(frame, pixel)))),
            Values::OfPixel { numbers, .. } => numbers(frame, pixels, number, bits),
            _ => self.add_returns(frame, places, bits),
        }
    }

    /// Appends the channel's value of each return of some places. A channel that does not follow from returns has none.
    pub(super) fn add_returns(&self, frame: &SensorFrame, places: &Places, bits: &mut Vec<u32>) {
        let none = if self.is_measurement() { bits_of(self.no_return) } else { self.no_return as u32 };
        match self.values {
            Values::F32(value) => places.add_each(none, |at| bits_of(value(frame, at)), bits),
            Values::U32(id) => places.add_each(none, |at| id(frame, at), bits),
            Values::F32Line(add) | Values::U32Line(add) => add(frame, &mut places.line(none, bits)),
            Values::Image(_) | Values::OfPixel { .. } => {}
        }
    }

    /// Whether the values are measurements, and not numbers that count or name.
    pub(super) fn is_measurement(&self) -> bool {
        matches!(self.values, Values::F32(_) | Values::F32Line(_) | Values::Image(_))
    }

    /// Whether a sensor has the channel.
    pub fn is_of(&self, sensor: &Sensor) -> bool {
        let depth = &sensor.measurement.depth;
        match self.sensors {
            Sensors::All => true,
            Sensors::Cameras => sensor.pattern.is_camera(),
            Sensors::Measured => !sensor.measurement.is_ideal(),
            Sensors::Pulsed => !sensor.measurement.is_ideal() && depth.is_none(),
            Sensors::Stereo => matches!(depth, Some(DepthSensing::Stereo(_))),
            Sensors::TimeOfFlight => matches!(depth, Some(DepthSensing::TimeOfFlight(_))),
        }
    }
}

/// The bits of a measurement in files.
pub(super) fn bits_of(measurement: f64) -> u32 {
    (measurement as f32).to_bits()
}

/// The declaration of a channel. [`DEPTH_FOR_OPENCV`] has none.
pub fn channel(name: &str) -> Option<&'static ChannelSpec> {
    CHANNELS.iter().find(|channel| channel.name == name)
}

/// Whether a channel has a value of its own in every pixel, whether something came back or not.
pub fn is_of_all_pixels(name: &str) -> bool {
    channel(name).is_some_and(|channel| matches!(channel.values, Values::OfPixel { .. } | Values::Image(_)))
}

/// The value of a channel at a pixel without a return.
pub fn no_return(name: &str) -> f64 {
    match name {
        DEPTH_FOR_OPENCV => NO_RETURN_M,
        name => channel(name).map_or(0.0, |channel| channel.no_return),
    }
}

/// The channels whose values tell whether a pixel has a return. The first of them that an image has is its main depth.
pub const DEPTHS: [&str; 3] = ["range", "Z", DEPTH_FOR_OPENCV];

/// A channel of EXRs that repeats `Z` for a camera and `range` for every other sensor. OpenCV reads an image only under this
/// name.
pub const DEPTH_FOR_OPENCV: &str = "Y";

/// The channel that [`DEPTH_FOR_OPENCV`] repeats.
pub(super) fn repeated_for_opencv(sensor: &Sensor) -> &'static str {
    if sensor.pattern.is_camera() { "Z" } else { "range" }
}

impl std::fmt::Debug for ChannelSpec {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ChannelSpec").field("name", &self.name).finish_non_exhaustive()
    }
}
