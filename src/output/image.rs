//! Range images: frames as named channels, whether they were just cast or read from a file.

use super::channel::{BYTES_A_VALUE, ChannelSpec, DEPTH_FOR_OPENCV, DEPTHS, repeated_for_opencv};
use super::options::Channels;
use super::places::Places;
use super::sensor_frame::SensorFrame;

/// A range image, which has channels of equal size. [`CHANNELS`](super::CHANNELS) declares the meaning of each channel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Image {
    /// The number of rows: the beams of a LiDAR, highest first, or the height of a camera's image.
    pub rows: usize,
    /// The number of columns: the firings of a LiDAR in their order, or the width of a camera's image.
    pub columns: usize,
    /// The channels, sorted by name. Each name occurs once.
    pub channels: Vec<Channel>,
}

/// A channel, which holds one number for each pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel {
    /// The name, such as `range` or `id.instance`.
    pub name: String,
    /// The samples row by row, `rows × columns` long.
    pub samples: Samples,
}

/// The numbers of a channel.
#[derive(Clone, Debug, PartialEq)]
pub enum Samples {
    /// Measurements in the channel's unit.
    F32(Vec<f32>),
    /// Integer ids.
    U32(Vec<u32>),
}

impl Image {
    /// The channels of each pixel's first return. `Y` repeats the main depth (`Z` for a camera, `range` for a LiDAR),
    /// because OpenCV reads that name.
    pub fn of(frame: &SensorFrame) -> Self {
        Self::of_return(frame, 0)
    }

    /// The channels of each pixel's return number `number`, from 0. A pixel with fewer returns is encoded as a pixel
    /// without a return.
    pub fn of_return(frame: &SensorFrame, number: usize) -> Self {
        Self::for_opencv(frame, number, Channels::USUAL)
    }

    /// Some channels of each pixel's return number `number`, with `Y` beside the main depth if that is among them.
    fn for_opencv(frame: &SensorFrame, number: usize, channels: Channels) -> Self {
        let mut image = Self::with_channels(frame, number, channels.iter());
        if let Some(depth) = image.channel(repeated_for_opencv(frame.capture.sensor)).cloned() {
            image.channels.push(Channel { name: DEPTH_FOR_OPENCV.to_owned(), samples: depth });
            image.channels.sort_by(|a, b| a.name.cmp(&b.name));
        }
        image
    }

    /// The image of those `channels` that the frame's sensor has. They must be sorted by name.
    pub fn with_channels<'c>(
        frame: &SensorFrame,
        number: usize,
        channels: impl IntoIterator<Item = &'c ChannelSpec>,
    ) -> Self {
        let rows: Vec<Places> =
            (0..frame.frame.rows()).map(|row| Places::of_return(frame.frame, row, number)).collect();
        let samples = |spec: &ChannelSpec| {
            let mut bits = Vec::with_capacity(frame.frame.pixels());
            rows.iter().for_each(|places| spec.add_row(frame, number, places, &mut bits));
            match spec.is_measurement() {
                true => Samples::F32(bits.into_iter().map(f32::from_bits).collect()),
                false => Samples::U32(bits),
            }
        };
        let of_sensor = channels.into_iter().filter(|spec| spec.is_of(frame.capture.sensor));
        let channels = of_sensor.map(|spec| Channel { name: spec.name.to_owned(), samples: samples(spec) });
        Self { rows: frame.frame.rows(), columns: frame.frame.columns(), channels: channels.collect() }
    }

    /// The samples of a channel.
    pub fn channel(&self, name: &str) -> Option<&Samples> {
        let index = self.channels.binary_search_by(|c| c.name.as_str().cmp(name)).ok()?;
        Some(&self.channels[index].samples)
    }

    /// The samples of a channel of measurements.
    pub fn f32(&self, name: &str) -> Option<&[f32]> {
        match self.channel(name)? {
            Samples::F32(values) => Some(values),
            Samples::U32(_) => None,
        }
    }

    /// The samples of a channel of ids.
    pub fn u32(&self, name: &str) -> Option<&[u32]> {
        match self.channel(name)? {
            Samples::U32(values) => Some(values),
            Samples::F32(_) => None,
        }
    }

    /// The image without a channel that repeats another one.
    #[must_use]
    pub fn without_repeats(mut self) -> Self {
        let repeats = DEPTHS.iter().any(|name| *name != DEPTH_FOR_OPENCV && self.channel(name).is_some());
        self.channels.retain(|channel| !(repeats && channel.name == DEPTH_FOR_OPENCV));
        self
    }

    /// The channel that tells which pixels have a return, with its name. It is the first of [`DEPTHS`] that the image has.
    pub fn main_depth(&self) -> Option<(&'static str, &[f32])> {
        DEPTHS.into_iter().find_map(|name| Some((name, self.f32(name)?)))
    }

    /// The mask of the pixels that have a return. In an image without depth it holds all pixels.
    pub fn mask(&self) -> Vec<bool> {
        match self.main_depth() {
            Some((_, depth)) => depth.iter().map(|d| d.is_finite()).collect(),
            None => vec![true; self.pixels()],
        }
    }

    /// Bytes of memory that the samples take.
    pub fn memory(&self) -> u64 {
        self.pixels() as u64 * self.channels.len() as u64 * BYTES_A_VALUE
    }

    /// The number of pixels, with or without a return.
    pub fn pixels(&self) -> usize {
        self.rows * self.columns
    }
}

impl Samples {
    /// The number of samples.
    pub fn len(&self) -> usize {
        match self {
            Self::F32(values) => values.len(),
            Self::U32(values) => values.len(),
        }
    }

    /// Whether there are no samples.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The sample with this index. The conversion is exact.
    pub fn get(&self, index: usize) -> f64 {
        match self {
            Self::F32(values) => f64::from(values[index]),
            Self::U32(values) => f64::from(values[index]),
        }
    }
}
