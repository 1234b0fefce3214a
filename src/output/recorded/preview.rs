//! Previews, read back.

use std::io::Cursor;

use super::error::ReadError;
use crate::output::Picture;

/// Decodes a PNG of 8-bit red, green and blue, as previews are. Its pixels may take `memory` bytes.
///
/// # Errors
/// [`ReadError`] if the bytes are no such PNG, or if it is too large.
pub fn read_preview(bytes: &[u8], memory: u64) -> Result<Picture, ReadError> {
    let wrong = |e: png::DecodingError| ReadError::new(format!("it is no PNG that can be read: {e}"));
    let limits = png::Limits { bytes: usize::try_from(memory).unwrap_or(usize::MAX) };
    let mut reader = png::Decoder::new_with_limits(Cursor::new(bytes), limits).read_info().map_err(wrong)?;
    if reader.output_color_type() != (png::ColorType::Rgb, png::BitDepth::Eight) {
        return Err(ReadError::new("it is no preview: those have 8 bits of red, green and blue a pixel"));
    }
    let size = reader.output_buffer_size().unwrap_or(usize::MAX);
    ReadError::check_memory(size as u64, memory)?;
    let mut pixels = vec![0; size];
    let info = reader.next_frame(&mut pixels).map_err(wrong)?;
    Ok(Picture { width: info.width as usize, height: info.height as usize, pixels })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_preview_is_read_as_it_was_written() {
        let picture = Picture { width: 5, height: 4, pixels: (0..60).collect() };
        let file = picture.to_png().unwrap();
        assert_eq!(read_preview(&file, 60).unwrap(), picture);
        let problem = read_preview(&file, 59).unwrap_err().to_string();
        assert!(problem.contains("59"), "its pixels take 60 bytes: {problem}");
        for length in 0..file.len() - 24 {
            assert!(read_preview(&file[..length], 1000).is_err(), "{length} of {} bytes", file.len());
        }
    }
}
