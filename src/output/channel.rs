//! The channels of frames: one declaration each. A range image holds them, a baseline hashes them, and a page shows them.

use super::sensor_frame::SensorFrame;
use crate::frame::BODY_FROM_OPTICAL;
use crate::scan::Returns;
use crate::sensor::Sensor;
use glam::DVec3;

/// The range and depth (metres) of a pixel with no return. All its other channels are 0.
pub const NO_RETURN_M: f64 = f64::INFINITY;

/// The declaration of a channel, which has one number a pixel.
#[derive(Clone, Copy)]
pub struct ChannelSpec {
    /// Its name in files and reports, such as `id.instance`.
    pub name: &'static str,
    /// The unit of its values, as messages write it; empty for numbers without one.
    pub unit: &'static str,
    /// What it holds, as a sentence.
    pub about: &'static str,
    /// Its value at a pixel with no return.
    pub no_return: f64,
    /// The sensors that have it.
    pub sensors: Sensors,
    /// How its value follows from a return.
    pub values: Values,
    /// How a page shows it; `None` if a page leaves it out.
    pub shown: Option<Shown>,
}

/// How a page shows a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shown {
    /// The channel's place among the others, the least first.
    pub rank: u8,
    /// Its name for people.
    pub label: &'static str,
    /// From values to colours.
    pub scale: Scale,
}

/// From values to colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// By the logarithm: distances.
    Log,
    /// Evenly.
    Linear,
    /// The channel is the first of three axes of a direction, whose names end in X, Y and Z.
    Direction,
    /// A colour of its own for each number: ids.
    Id,
}

/// The sensors that have a channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sensors {
    /// All of them.
    All,
    /// Those with planar depth.
    Cameras,
}

/// How a channel's value follows from a return, and its type in files. Each takes 4 bytes.
#[derive(Clone, Copy)]
pub enum Values {
    /// Measurements, in the channel's unit, each rounded once from 64 bits to 32.
    F32(fn(&SensorFrame, Place) -> f64),
    /// Ids.
    U32(fn(&SensorFrame, Place) -> u32),
}

/// A pixel, and the slot of one of its returns in the columns of [`Returns`].
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// The pixel's number, row by row.
    pub pixel: usize,
    /// The slot of the return.
    pub slot: usize,
}

/// Bytes of a channel's value.
pub const BYTES_A_VALUE: u64 = 4;

/// Every channel, sorted by name. [`DEPTH_FOR_OPENCV`] is not among them: it repeats one of them.
pub static CHANNELS: [ChannelSpec; 10] = [
    ChannelSpec {
        name: "Z",
        unit: "m",
        about: "The depth along the camera's optical axis.",
        no_return: NO_RETURN_M,
        sensors: Sensors::Cameras,
        values: Values::F32(|f, at| {
            let depth_over_range = f.capture.depth_over_range(at.row(f), at.column(f));
            depth_over_range.map_or(NO_RETURN_M, |ratio| f.returns().range_m[at.slot] * ratio)
        }),
        shown: Some(Shown { rank: 1, label: "depth", scale: Scale::Log }),
    },
    ChannelSpec {
        name: "id.instance",
        unit: "",
        about: "The object that was hit: an index into the manifest's list.",
        no_return: 0.0,
        sensors: Sensors::All,
        values: Values::U32(|f, at| f.returns().instance[at.slot]),
        shown: Some(Shown { rank: 4, label: "instance", scale: Scale::Id }),
    },
    ChannelSpec {
        name: "id.semantic",
        unit: "",
        about: "The semantic label of the object that was hit.",
        no_return: 0.0,
        sensors: Sensors::All,
        values: Values::U32(|f, at| f.returns().label[at.slot]),
        shown: Some(Shown { rank: 5, label: "label", scale: Scale::Id }),
    },
    ChannelSpec {
        name: "id.triangle",
        unit: "",
        about: "The triangle that was hit.",
        no_return: 0.0,
        sensors: Sensors::All,
        values: Values::U32(|f, at| f.returns().triangle[at.slot]),
        shown: None, // there are too many to tell apart
    },
    ChannelSpec {
        name: "intensity",
        unit: "",
        about: "Reflectivity times the cosine of the angle of incidence, 0 to 1.",
        no_return: 0.0,
        sensors: Sensors::All,
        values: Values::F32(|f, at| f64::from(f.returns().intensity[at.slot])),
        shown: Some(Shown { rank: 2, label: "intensity", scale: Scale::Linear }),
    },
    ChannelSpec {
        name: "normal.X",
        unit: "",
        about: "The surface's unit normal towards the sensor, in the sensor's frame (a camera's: optical), along x.",
        no_return: 0.0,
        sensors: Sensors::All,
        values: Values::F32(|f, at| normal(f, at).x),
        shown: Some(Shown { rank: 3, label: "normal", scale: Scale::Direction }),
    },
    ChannelSpec {
        name: "normal.Y",
        unit: "",
        about: "The same along y.",
        no_return: 0.0,
        sensors: Sensors::All,
        values: Values::F32(|f, at| normal(f, at).y),
        shown: None, // it is shown with the first axis
    },
    ChannelSpec {
        name: "normal.Z",
        unit: "",
        about: "The same along z.",
        no_return: 0.0,
        sensors: Sensors::All,
        values: Values::F32(|f, at| normal(f, at).z),
        shown: None, // it is shown with the first axis
    },
    ChannelSpec {
        name: "range",
        unit: "m",
        about: "The range along the ray, from where the sensor counts.",
        no_return: NO_RETURN_M,
        sensors: Sensors::All,
        values: Values::F32(|f, at| f.returns().range_m[at.slot]),
        shown: Some(Shown { rank: 0, label: "range", scale: Scale::Log }),
    },
    ChannelSpec {
        name: "time",
        unit: "s",
        about: "The time of the pulse from the frame's start.",
        no_return: 0.0,
        sensors: Sensors::All,
        values: Values::F32(|f, at| f.capture.time_s(at.row(f), at.column(f)).unwrap_or(0.0)),
        shown: Some(Shown { rank: 6, label: "time", scale: Scale::Linear }),
    },
];

/// The names of all channels, sorted.
pub const CHANNEL_NAMES: [&str; CHANNELS.len()] = {
    let mut names = [""; CHANNELS.len()];
    let mut i = 0;
    while i < names.len() {
        names[i] = CHANNELS[i].name;
        i += 1;
    }
    names
};

impl Place {
    fn row(self, f: &SensorFrame) -> usize {
        self.pixel / f.frame.columns()
    }

    fn column(self, f: &SensorFrame) -> usize {
        self.pixel % f.frame.columns()
    }
}

impl SensorFrame<'_> {
    fn returns(&self) -> &Returns {
        self.frame.returns()
    }
}

/// A return's normal in the frame that the image speaks of. Axes are only swapped and negated: nothing is rounded.
fn normal(f: &SensorFrame, at: Place) -> DVec3 {
    let [x, y, z] = f.returns().normal[at.slot].map(f64::from);
    let normal = DVec3::new(x, y, z);
    if f.capture.sensor.pattern.is_camera() {
        // Adding 0 makes a negative zero positive.
        BODY_FROM_OPTICAL.rotation.transpose() * normal + DVec3::ZERO
    } else {
        normal
    }
}

impl ChannelSpec {
    /// Whether a sensor has it.
    pub fn is_of(&self, sensor: &Sensor) -> bool {
        match self.sensors {
            Sensors::All => true,
            Sensors::Cameras => sensor.pattern.is_camera(),
        }
    }
}

/// The declaration of a channel. [`DEPTH_FOR_OPENCV`] has none.
pub fn channel(name: &str) -> Option<&'static ChannelSpec> {
    CHANNELS.iter().find(|channel| channel.name == name)
}

/// The value of a channel at a pixel with no return.
pub fn no_return(name: &str) -> f64 {
    match name {
        DEPTH_FOR_OPENCV => NO_RETURN_M,
        name => channel(name).map_or(0.0, |channel| channel.no_return),
    }
}

/// The channels whose value says whether a pixel has a return. An image is asked for the first of them that it has.
pub const DEPTHS: [&str; 3] = ["range", "Z", DEPTH_FOR_OPENCV];

/// A channel of EXRs that repeats a camera's `Z`, and everyone else's `range`: OpenCV reads the image under this name alone.
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
