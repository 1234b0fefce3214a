//! Pictures with 8 bits for each colour channel, as PNG files.

use super::format::EncodeError;

/// The colour of a pixel without a return.
pub(super) const NO_RETURN_COLOUR: [u8; 3] = [0x10, 0x10, 0x14];

/// The colour of a pixel whose beam is blocked nearer than the sensor's least range.
pub(super) const TOO_NEAR_COLOUR: [u8; 3] = [0x4a, 0x0a, 0x14];

/// A PNG of a picture with 8 bits for each colour channel: red, green and blue, row by row.
///
/// # Errors
/// An error if a side is 0 or larger than a PNG allows.
pub fn encode_png(width: usize, height: usize, pixels: &[u8]) -> Result<Vec<u8>, EncodeError> {
    write(width, height, pixels).map_err(|e| EncodeError::new(format!("the PNG can't be encoded: {e}")))
}

fn write(width: usize, height: usize, pixels: &[u8]) -> Result<Vec<u8>, png::EncodingError> {
    let mut file = Vec::new();
    let side = |n: usize| u32::try_from(n).unwrap_or(0); // the encoder refuses a side of 0
    let mut encoder = png::Encoder::new(&mut file, side(width), side(height));
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(pixels)?;
    writer.finish()?;
    Ok(file)
}
