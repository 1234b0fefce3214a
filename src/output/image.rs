//! A frame as named channels: what a range image holds, whether it was just cast or is read back.

use super::{Capture, NO_RETURN_M};
use crate::frame::BODY_FROM_OPTICAL;
use crate::scan::Return;
use crate::sensor::{Camera, Pattern};

/// The channels of frames, sorted; `Y` aside, which repeats another.
pub const CHANNELS: [&str; 10] = [
    "Z",
    "id.instance",
    "id.semantic",
    "id.triangle",
    "intensity",
    "normal.X",
    "normal.Y",
    "normal.Z",
    "range",
    "time",
];

/// A range image: channels of the same size. The README's table says what each means.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Image {
    /// Rows: a LiDAR's beams, the highest first; a camera's height.
    pub rows: usize,
    /// Columns: a LiDAR's firings in their order; a camera's width.
    pub columns: usize,
    /// Sorted by name, each name once.
    pub channels: Vec<Channel>,
}

/// One number a pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// Such as `range` or `id.instance`.
    pub name: String,
    /// Row by row, `rows × columns` long.
    pub samples: Samples,
}

/// The numbers of a channel.
#[derive(Clone, Debug, PartialEq)]
pub enum Samples {
    /// Measurements, in the channel's unit.
    F32(Vec<f32>),
    /// Ids.
    U32(Vec<u32>),
}

impl Image {
    /// The channels of a capture, each value rounded once to 32 bits. `Y` repeats the main depth (a camera's `Z`, a LiDAR's
    /// `range`), because that is the name that OpenCV reads.
    pub fn of(capture: &Capture) -> Self {
        let Capture { frame, sensor, .. } = capture;
        let per_pixel = |f: &dyn Fn(usize, usize, &Return) -> f64, no_return: f64| {
            let pixels = frame.returns.iter().enumerate();
            let values = pixels.map(|(i, hit)| match hit {
                Some(hit) => f(i / frame.columns, i % frame.columns, hit) as f32,
                None => no_return as f32,
            });
            Samples::F32(values.collect())
        };
        let id = |f: &dyn Fn(&Return) -> u32| {
            Samples::U32(frame.returns.iter().map(|hit| hit.as_ref().map_or(0, f)).collect())
        };
        let normal = |axis: usize| {
            per_pixel(
                &|_, _, hit| match sensor.pattern {
                    // Axes are only swapped and negated: nothing is rounded.
                    Pattern::Camera(_) => {
                        (BODY_FROM_OPTICAL.rotation.transpose() * hit.normal.as_dvec3())[axis] + 0.0
                    }
                    _ => f64::from(hit.normal[axis]),
                },
                0.0,
            )
        };
        let range = per_pixel(&|_, _, hit| hit.range, NO_RETURN_M);
        let time_s = |row, column, _: &Return| sensor.pattern.pulse(row, column).map_or(0.0, |p| p.time_s);
        let time = per_pixel(&time_s, 0.0);
        let mut channels = vec![
            ("id.instance", id(&|hit| hit.instance)),
            ("id.semantic", id(&|hit| hit.label)),
            ("id.triangle", id(&|hit| hit.triangle)),
            ("intensity", per_pixel(&|_, _, hit| f64::from(hit.intensity), 0.0)),
            ("normal.X", normal(0)),
            ("normal.Y", normal(1)),
            ("normal.Z", normal(2)),
            ("time", time),
        ];
        match &sensor.pattern {
            Pattern::Camera(camera) => {
                let depth =
                    per_pixel(&|row, column, hit| planar_depth(camera, row, column, hit), NO_RETURN_M);
                channels.push(("Y", depth.clone()));
                channels.push(("Z", depth));
            }
            _ => channels.push(("Y", range.clone())),
        }
        channels.push(("range", range));
        channels.sort_by_key(|(name, _)| *name);
        let channels = channels.into_iter().map(|(name, samples)| Channel { name: name.to_owned(), samples });
        Self { rows: frame.rows, columns: frame.columns, channels: channels.collect() }
    }

    /// The samples of a channel.
    pub fn channel(&self, name: &str) -> Option<&Samples> {
        let index = self.channels.binary_search_by(|c| c.name.as_str().cmp(name)).ok()?;
        Some(&self.channels[index].samples)
    }

    /// A channel of measurements.
    pub fn f32(&self, name: &str) -> Option<&[f32]> {
        match self.channel(name)? {
            Samples::F32(values) => Some(values),
            Samples::U32(_) => None,
        }
    }

    /// A channel of ids.
    pub fn u32(&self, name: &str) -> Option<&[u32]> {
        match self.channel(name)? {
            Samples::U32(values) => Some(values),
            Samples::F32(_) => None,
        }
    }

    /// Pixels, with a return or without.
    pub fn pixels(&self) -> usize {
        self.rows * self.columns
    }
}

impl Samples {
    /// How many there are.
    pub fn len(&self) -> usize {
        match self {
            Self::F32(values) => values.len(),
            Self::U32(values) => values.len(),
        }
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// One of them; exact.
    pub fn get(&self, index: usize) -> f64 {
        match self {
            Self::F32(values) => f64::from(values[index]),
            Self::U32(values) => f64::from(values[index]),
        }
    }
}

/// Depth along the optical axis, from the range along the ray.
fn planar_depth(camera: &Camera, row: usize, column: usize, hit: &Return) -> f64 {
    camera.optical_direction(row, column).map_or(NO_RETURN_M, |direction| hit.range * direction.z)
}
