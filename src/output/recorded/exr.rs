//! Reading of OpenEXR range images.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};

use exr::image::FlatSamples;
use exr::meta::MetaData;
use exr::meta::attribute::AttributeValue;
use exr::prelude::{ReadChannels, ReadLayers};

use super::error::ReadError;
use super::instances::InstanceNames;
use crate::output::names::{read_names, words_of_labels};
use crate::output::{Channel, Image, Samples};

/// A part of an EXR or an NPZ: an image with its attributes.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// The part's name. It is empty in a file of one part.
    pub name: String,
    /// The channels. Half floats are widened.
    pub image: Image,
    /// The header's attributes beyond those of the format itself, as texts (such as `beamcast:world_from_sensor`).
    pub attributes: BTreeMap<String, String>,
}

impl Part {
    /// The names of the instances that the header lists.
    pub fn instances(&self) -> InstanceNames {
        let listed = self.attributes.get("beamcast:instances").map_or("", String::as_str);
        read_names(listed).into_iter().collect()
    }

    /// The meaning of the labels, in words, if the header tells.
    pub fn labels(&self) -> BTreeMap<u32, String> {
        let listed = self.attributes.get("beamcast:labels").map_or("", String::as_str);
        let listed: BTreeMap<u32, Vec<String>> = serde_json::from_str(listed).unwrap_or_default();
        words_of_labels(&listed.into_iter().collect::<Vec<_>>())
    }
}

/// The greatest compression ratio that is believed. The limit of deflate is 1032.
const MAX_COMPRESSION: u64 = 1100;

/// Reads the parts of an EXR file, at least one.
///
/// # Errors
/// A [`ReadError`] if the file is no EXR, is cut short, tiled, deep or subsampled, or claims more pixels than its size can
/// hold, or than fit into `memory` bytes.
pub fn read_exr(bytes: &[u8], memory: u64) -> Result<Vec<Part>, ReadError> {
    // This is the last line of defence, because the library's own checks are incomplete.
    catch_unwind(AssertUnwindSafe(|| {
        check_header(bytes, memory)?;
        read(bytes)
    }))
    .unwrap_or_else(|_| Err(ReadError::new("its header contradicts itself")))
}

/// Most channels of all parts together. Channels are looked up by their names, one after the other.
const MAX_CHANNELS: usize = 1024;

/// Bytes that the numbers of a file take in memory, while they are read: half floats are widened.
fn bytes_in_memory(pixels: u64, channels: u64) -> u64 {
    pixels.saturating_mul(channels).saturating_mul(4)
}

/// Checks the claims of the header against the file's size, and against the memory that there is, before any memory is
/// allocated for them.
fn check_header(bytes: &[u8], memory: u64) -> Result<(), ReadError> {
    let meta = MetaData::read_from_buffered(Cursor::new(bytes), false).map_err(broken)?;
    if meta.headers.is_empty() {
        return Err(ReadError::new("it has no image"));
    }
    let (mut claimed, mut needed_memory, mut channels) = (0_u64, 0_u64, 0);
    for header in &meta.headers {
        if header.deep {
            return Err(ReadError::new("it holds deep data, which is not supported: flatten it first"));
        }
        if header.blocks.has_tiles() {
            return Err(ReadError::new("it is tiled, which is not supported: save it as scanlines"));
        }
        if header.channels.list.iter().any(|c| (c.sampling.x(), c.sampling.y()) != (1, 1)) {
            return Err(ReadError::new("it has subsampled channels, which are not supported"));
        }
        let pixels = (header.layer_size.width() as u64).checked_mul(header.layer_size.height() as u64);
        let overflow = || ReadError::new("its size overflows");
        let pixels = pixels.ok_or_else(overflow)?;
        let a_pixel: u64 = header.channels.list.iter().map(|c| c.sample_type.bytes_per_sample() as u64).sum();
        let needed = pixels.checked_mul(a_pixel).and_then(|n| n.checked_add(claimed));
        claimed = needed.ok_or_else(overflow)?;
        channels += header.channels.list.len();
        needed_memory =
            needed_memory.saturating_add(bytes_in_memory(pixels, header.channels.list.len() as u64));
    }
    if channels > MAX_CHANNELS {
        return Err(ReadError::new(format!("it has {channels} channels, more than {MAX_CHANNELS}")));
    }
    if claimed / MAX_COMPRESSION > bytes.len() as u64 {
        let size = bytes.len();
        return Err(ReadError::new(format!(
            "it claims {claimed} bytes of pixels, which {size} bytes can't hold"
        )));
    }
    ReadError::check_memory(needed_memory, memory)
}

fn read(bytes: &[u8]) -> Result<Vec<Part>, ReadError> {
    let file = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .all_layers()
        .all_attributes()
        .non_parallel()
        .from_buffered(Cursor::new(bytes))
        .map_err(broken)?;
    let parts = file.layer_data.into_iter().map(|layer| {
        let channels = layer.channel_data.list.into_iter().map(|channel| {
            let samples = match channel.sample_data {
                FlatSamples::F16(values) => Samples::F32(values.into_iter().map(|v| v.to_f32()).collect()),
                FlatSamples::F32(values) => Samples::F32(values),
                FlatSamples::U32(values) => Samples::U32(values),
            };
            Channel { name: channel.name.to_string(), samples }
        });
        let mut channels: Vec<_> = channels.collect();
        channels.sort_by(|a, b| a.name.cmp(&b.name));
        channels.dedup_by(|a, b| a.name == b.name);
        let attributes = layer.attributes.other.iter().filter_map(|(name, value)| {
            let value = match value {
                AttributeValue::Text(text) => text.to_string(),
                AttributeValue::F32(number) => number.to_string(),
                AttributeValue::F64(number) => number.to_string(),
                AttributeValue::I32(number) => number.to_string(),
                _ => return None,
            };
            Some((name.to_string(), value))
        });
        Part {
            name: layer.attributes.layer_name.map_or_else(String::new, |name| name.to_string()),
            attributes: attributes.collect(),
            image: Image { rows: layer.size.height(), columns: layer.size.width(), channels },
        }
    });
    Ok(parts.collect())
}

fn broken(error: exr::error::Error) -> ReadError {
    ReadError::new(format!("the EXR can't be read: {error}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use exr::image::{AnyChannel, AnyChannels, Encoding, Layer};
    use exr::meta::header::LayerAttributes;
    use proptest::prelude::*;

    /// An EXR of 3 × 2 pixels.
    fn small() -> Vec<u8> {
        let channels = vec![
            AnyChannel::new("range", FlatSamples::F32(vec![1.0, 2.0, f32::INFINITY, 4.0, 5.0, 6.0])),
            AnyChannel::new("id.instance", FlatSamples::U32(vec![0, 1, 2, 3, 4, u32::MAX])),
            AnyChannel::new("half", FlatSamples::F16([0.5, 1.5, 2.5, 3.5, 4.5, 5.5].map(half).to_vec())),
        ];
        let layer = Layer::new(
            (3, 2),
            LayerAttributes::named("return0"),
            Encoding::SMALL_LOSSLESS,
            AnyChannels::sort(channels.into_iter().collect()),
        );
        let mut bytes = Vec::new();
        use exr::prelude::WritableImage;
        exr::image::Image::from_layer(layer).write().to_buffered(Cursor::new(&mut bytes)).unwrap();
        bytes
    }

    fn half(value: f32) -> exr::prelude::f16 {
        exr::prelude::f16::from_f32(value)
    }

    #[test]
    fn channels_come_back_as_they_were() {
        let parts = read_exr(&small(), u64::MAX).unwrap();
        let [part] = parts.as_slice() else { panic!("{parts:?}") };
        assert_eq!(part.name, "return0");
        let image = &part.image;
        assert_eq!((image.rows, image.columns), (2, 3));
        assert_eq!(image.f32("range").unwrap(), [1.0, 2.0, f32::INFINITY, 4.0, 5.0, 6.0]);
        assert_eq!(image.u32("id.instance").unwrap(), [0, 1, 2, 3, 4, u32::MAX]);
        assert_eq!(image.f32("half").unwrap(), [0.5, 1.5, 2.5, 3.5, 4.5, 5.5]);
        assert_eq!(image.channel("depth"), None);
    }

    #[test]
    fn a_size_that_the_file_cannot_hold_is_refused() {
        let mut bytes = small();
        // dataWindow is a box2i: xMin, yMin, xMax, yMax follow its name, type and length.
        let at = bytes.windows(11).position(|w| w == b"dataWindow\0").unwrap() + 11 + 6 + 4 + 8;
        bytes[at..at + 4].copy_from_slice(&59_999_i32.to_le_bytes());
        bytes[at + 4..at + 8].copy_from_slice(&59_999_i32.to_le_bytes());
        let error = read_exr(&bytes, u64::MAX).unwrap_err().to_string();
        assert!(error.contains("claims 36000000000 bytes of pixels"), "{error}");
    }

    /// The case exr-half-refused: one byte of a file can hold a thousand, and a half float has two.
    #[test]
    fn half_floats_take_two_bytes() {
        let (rows, columns) = (1080, 1920);
        let layer = Layer::new(
            (columns, rows),
            LayerAttributes::named("depth"),
            Encoding::SMALL_LOSSLESS,
            AnyChannels::sort(
                [AnyChannel::new("Z", FlatSamples::F16(vec![half(0.0); rows * columns]))]
                    .into_iter()
                    .collect(),
            ),
        );
        let mut bytes = Vec::new();
        use exr::prelude::WritableImage;
        exr::image::Image::from_layer(layer).write().to_buffered(Cursor::new(&mut bytes)).unwrap();
        assert!(
            bytes.len() < rows * columns * 4 / 1032,
            "{}: four bytes a pixel would be refused",
            bytes.len()
        );
        assert_eq!(read_exr(&bytes, u64::MAX).unwrap()[0].image.f32("Z").unwrap().len(), rows * columns);
        let error = read_exr(&bytes, 1_000_000).unwrap_err().to_string();
        assert!(
            error.contains("takes 8294400 bytes of memory, more than the 1000000 that there are"),
            "{error}"
        );
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(400))]

        #[test]
        fn broken_bytes_are_an_error_or_an_image(at in 0.0..1.0, value: u8, keep in 0.0..2.0) {
            let mut bytes = small();
            let at = (at * bytes.len() as f64) as usize;
            bytes[at] = value;
            bytes.truncate((keep * bytes.len() as f64) as usize);
            for part in read_exr(&bytes, u64::MAX).unwrap_or_default() {
                prop_assert!(part.image.channels.iter().all(|c| c.samples.len() == part.image.pixels()));
            }
        }
    }
}
