//! A frame as named channels: what a range image holds, whether it was just cast or is read back.

use super::channel::{CHANNELS, ChannelSpec, DEPTH_FOR_OPENCV, DEPTHS, Place, Values, repeated_for_opencv};
use super::sensor_frame::SensorFrame;

/// A range image: channels of the same size. [`CHANNELS`] says what each means.
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
    /// The channels of each pixel's first return. `Y` repeats the main depth (a camera's `Z`, a LiDAR's `range`), because
    /// that is the name that OpenCV reads.
    pub fn of(frame: &SensorFrame) -> Self {
        Self::of_return(frame, 0)
    }

    /// The channels of each pixel's return number `number`, from 0. A pixel with fewer returns is as one without any.
    pub fn of_return(frame: &SensorFrame, number: usize) -> Self {
        let mut image = Self::with_channels(frame, number, &CHANNELS);
        if let Some(depth) = image.channel(repeated_for_opencv(frame.capture.sensor)).cloned() {
            image.channels.push(Channel { name: DEPTH_FOR_OPENCV.to_owned(), samples: depth });
            image.channels.sort_by(|a, b| a.name.cmp(&b.name));
        }
        image
    }

    /// Those of `channels`, which are sorted by name, that the frame's sensor has.
    pub fn with_channels(frame: &SensorFrame, number: usize, channels: &[ChannelSpec]) -> Self {
        let pixels = 0..frame.frame.pixels();
        let place = |pixel| frame.frame.slot(pixel, number).map(|slot| Place { pixel, slot });
        let samples = |spec: &ChannelSpec| match spec.values {
            Values::F32(value) => Samples::F32(
                pixels
                    .clone()
                    .map(|i| place(i).map_or(spec.no_return, |at| value(frame, at)) as f32)
                    .collect(),
            ),
            Values::U32(id) => Samples::U32(
                pixels.clone().map(|i| place(i).map_or(spec.no_return as u32, |at| id(frame, at))).collect(),
            ),
        };
        let of_sensor = channels.iter().filter(|spec| spec.is_of(frame.capture.sensor));
        let channels = of_sensor.map(|spec| Channel { name: spec.name.to_owned(), samples: samples(spec) });
        Self { rows: frame.frame.rows(), columns: frame.frame.columns(), channels: channels.collect() }
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

    /// The same without a channel that repeats another.
    #[must_use]
    pub fn without_repeats(mut self) -> Self {
        let repeats = DEPTHS.iter().any(|name| *name != DEPTH_FOR_OPENCV && self.channel(name).is_some());
        self.channels.retain(|channel| !(repeats && channel.name == DEPTH_FOR_OPENCV));
        self
    }

    /// The channel that says which pixels have a return, by its name: the first of [`DEPTHS`] that there is.
    pub fn main_depth(&self) -> Option<(&'static str, &[f32])> {
        DEPTHS.into_iter().find_map(|name| Some((name, self.f32(name)?)))
    }

    /// Which pixels have a return; all of them in an image that has no depth.
    pub fn mask(&self) -> Vec<bool> {
        match self.main_depth() {
            Some((_, depth)) => depth.iter().map(|d| d.is_finite()).collect(),
            None => vec![true; self.pixels()],
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
