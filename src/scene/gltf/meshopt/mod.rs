//! The decoder of EXT_meshopt_compression and KHR_meshopt_compression, written from the text of the two specifications
//! (appendix A, bitstream, and appendix B, filters). Their bitstreams differ in version 1 of the attribute mode, which only the
//! latter has; the decoder reads both versions for both extensions.
//!
//! ```text
//! attributes   mode 0: elements of any kind
//! indices      modes 1 and 2: triangles, and other indices
//! filters      what is done to the elements afterwards
//! stream       the bytes, and what can be wrong with them
//! ```

mod attributes;
mod filters;
mod indices;
mod stream;
#[cfg(test)]
mod tests;

use serde::Deserialize;

use stream::StreamError;

/// The kind of data that a stream holds.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub(super) enum Mode {
    Attributes,
    Triangles,
    Indices,
}

/// The filter that is applied to the elements after decompression.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
pub(super) enum Filter {
    #[default]
    None,
    Octahedral,
    Quaternion,
    Exponential,
    Color,
}

/// Decodes the `count` elements of `stride` bytes that `stream` holds.
///
/// Allocates at most about 1100 bytes for each byte of the stream.
pub(super) fn decode(
    stream: &[u8],
    count: usize,
    stride: usize,
    mode: Mode,
    filter: Filter,
) -> Result<Vec<u8>, StreamError> {
    let strides_match = match (mode, filter) {
        (Mode::Attributes, Filter::None | Filter::Exponential) => {
            stride.is_multiple_of(4) && (4..=256).contains(&stride)
        }
        (Mode::Attributes, Filter::Octahedral | Filter::Color) => stride == 4 || stride == 8,
        (Mode::Attributes, Filter::Quaternion) => stride == 8,
        (Mode::Triangles | Mode::Indices, Filter::None) => stride == 2 || stride == 4,
        (Mode::Triangles | Mode::Indices, _) => return Err(format!("{mode:?} can't have a filter").into()),
    };
    if !strides_match {
        return Err(
            format!("a byteStride of {stride} does not go with mode {mode:?} and filter {filter:?}").into()
        );
    }
    let mut bytes = match mode {
        Mode::Attributes => attributes::decode(stream, count, stride)?,
        Mode::Triangles => indices::triangles(stream, count, stride)?,
        Mode::Indices => indices::indices(stream, count, stride)?,
    };
    match (filter, stride) {
        (Filter::None, _) => {}
        (Filter::Octahedral, 4) => bytes.as_chunks_mut().0.iter_mut().for_each(filters::octahedral_8),
        (Filter::Octahedral, _) => bytes.as_chunks_mut().0.iter_mut().for_each(filters::octahedral_16),
        (Filter::Quaternion, _) => bytes.as_chunks_mut().0.iter_mut().for_each(filters::quaternion),
        (Filter::Exponential, _) => bytes.as_chunks_mut().0.iter_mut().for_each(filters::exponential),
        (Filter::Color, 4) => bytes.as_chunks_mut().0.iter_mut().for_each(filters::color_8),
        (Filter::Color, _) => bytes.as_chunks_mut().0.iter_mut().for_each(filters::color_16),
    }
    Ok(bytes)
}
