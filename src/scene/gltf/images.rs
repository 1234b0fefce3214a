//! Decodes images: PNG, JPEG and WebP. Their sizes are checked before anything is allocated for them.

use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};

use image_webp::WebPDecoder;
use png::Transformations;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::fault::Fault;
use crate::scene::texture::Image;

/// The format of an image, which its first bytes tell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Format {
    Png,
    Jpeg,
    WebP,
}

impl Format {
    /// The format of an image. Files are known by their content, since names and types are often wrong.
    pub fn of(bytes: &[u8]) -> Result<Self, Fault> {
        const KTX2: &[u8] = b"\xabKTX 20\xbb";
        let other = |problem: &str| Err(Fault::new("", problem));
        match bytes {
            _ if bytes.starts_with(b"\x89PNG\r\n\x1a\n") => Ok(Self::Png),
            _ if bytes.starts_with(b"\xff\xd8\xff") => Ok(Self::Jpeg),
            _ if bytes.starts_with(b"RIFF") && bytes.get(8..12) == Some(b"WEBP") => Ok(Self::WebP),
            _ if bytes.starts_with(KTX2) => other("it is KTX2, which beamcast does not read"),
            _ => other("its content is no PNG, no JPEG and no WebP"),
        }
    }

    /// The name in messages.
    pub fn name(self) -> &'static str {
        match self {
            Self::Png => "PNG",
            Self::Jpeg => "JPEG",
            Self::WebP => "WebP",
        }
    }

    /// The type that glTF calls it by.
    pub fn mime_type(self) -> &'static str {
        match self {
            Self::Png => "image/png",
            Self::Jpeg => "image/jpeg",
            Self::WebP => "image/webp",
        }
    }
}

/// Decodes an image, if `allow` grants the number of its texels.
pub(super) fn decode(
    bytes: &[u8],
    format: Format,
    allow: &dyn Fn(u64) -> Result<(), Fault>,
) -> Result<Image, Fault> {
    let broken =
        |error: &dyn std::fmt::Display| Fault::new("", format!("the {} is broken: {error}", format.name()));
    // The decoders are not known to panic. But no image is worth a scene.
    catch_unwind(AssertUnwindSafe(|| match format {
        Format::Png => png_image(bytes, allow, &broken),
        Format::Jpeg => jpeg_image(bytes, allow, &broken),
        Format::WebP => webp_image(bytes, allow, &broken),
    }))
    .unwrap_or_else(|_| Err(broken(&"the decoder failed on it")))
}

type Broken<'b> = &'b dyn Fn(&dyn std::fmt::Display) -> Fault;

/// A buffer for an image of so many channels of eight bits, if it is allowed.
fn buffer(
    (width, height): (u32, u32),
    bytes: Option<usize>,
    allow: &dyn Fn(u64) -> Result<(), Fault>,
    broken: Broken,
) -> Result<Vec<u8>, Fault> {
    allow(u64::from(width) * u64::from(height))?;
    Ok(vec![0; bytes.ok_or_else(|| broken(&"it is too large"))?])
}

fn png_image(bytes: &[u8], allow: &dyn Fn(u64) -> Result<(), Fault>, broken: Broken) -> Result<Image, Fault> {
    let mut decoder = png::Decoder::new(Cursor::new(bytes));
    decoder.set_transformations(Transformations::normalize_to_color8());
    decoder.set_ignore_text_chunk(true);
    decoder.set_ignore_iccp_chunk(true);
    let info = decoder.read_header_info().map_err(|error| broken(&error))?;
    let size = (info.width, info.height);
    // The decoder holds rows of its own beside the image.
    allow(u64::from(size.0))?;
    let mut reader = decoder.read_info().map_err(|error| broken(&error))?;
    let mut pixels = buffer(size, reader.output_buffer_size(), allow, broken)?;
    let frame = reader.next_frame(&mut pixels).map_err(|error| broken(&error))?;
    pixels.truncate(frame.buffer_size());
    image(frame.width, pixels, frame.color_type.samples(), broken)
}

fn jpeg_image(
    bytes: &[u8],
    allow: &dyn Fn(u64) -> Result<(), Fault>,
    broken: Broken,
) -> Result<Image, Fault> {
    let most = usize::from(u16::MAX);
    let options = DecoderOptions::new_safe().set_max_width(most).set_max_height(most);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(bytes), options);
    decoder.decode_headers().map_err(|error| broken(&error))?;
    let info = decoder.info().ok_or_else(|| broken(&"it has no header"))?;
    let size = (u32::from(info.width), u32::from(info.height));
    let mut pixels = buffer(size, decoder.output_buffer_size(), allow, broken)?;
    decoder.decode_into(&mut pixels).map_err(|error| broken(&error))?;
    let channels = pixels.len() / (size.0 as usize * size.1 as usize).max(1);
    image(size.0, pixels, channels, broken)
}

fn webp_image(
    bytes: &[u8],
    allow: &dyn Fn(u64) -> Result<(), Fault>,
    broken: Broken,
) -> Result<Image, Fault> {
    let mut decoder = WebPDecoder::new(Cursor::new(bytes)).map_err(|error| broken(&error))?;
    let size = decoder.dimensions();
    let mut pixels = buffer(size, decoder.output_buffer_size(), allow, broken)?;
    decoder.read_image(&mut pixels).map_err(|error| broken(&error))?;
    image(size.0, pixels, if decoder.has_alpha() { 4 } else { 3 }, broken)
}

/// An image of pixels with so many channels.
fn image(width: u32, pixels: Vec<u8>, channels: usize, broken: Broken) -> Result<Image, Fault> {
    Image::new(width, channels, pixels).ok_or_else(|| broken(&"it has no pixels"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use png::{BitDepth, ColorType};

    /// A PNG of two columns and `data.len()` divided by a row's length rows.
    fn png(
        color: ColorType,
        depth: BitDepth,
        rows: u32,
        data: &[u8],
        palette: Option<(&[u8], &[u8])>,
    ) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 2, rows);
        encoder.set_color(color);
        encoder.set_depth(depth);
        if let Some((colors, alphas)) = palette {
            encoder.set_palette(colors.to_vec());
            encoder.set_trns(alphas.to_vec());
        }
        encoder.write_header().unwrap().write_image_data(data).unwrap();
        bytes
    }

    fn read(bytes: &[u8]) -> Result<Image, String> {
        let allow = |texels: u64| if texels > 1 << 20 { Err(Fault::new("", "too large")) } else { Ok(()) };
        let decoded = Format::of(bytes).and_then(|format| decode(bytes, format, &allow));
        decoded.map_err(|fault| fault.problem)
    }

    #[test]
    fn png_of_every_kind() {
        use BitDepth::{Eight, One, Sixteen};
        let two = |texel: &[u8]| Image::new(2, texel.len() / 2, texel.to_vec()).unwrap();
        let of = |color, depth, data: &[u8]| read(&png(color, depth, 1, data, None)).unwrap();
        assert_eq!(of(ColorType::Grayscale, Eight, &[7, 9]), two(&[7, 9]));
        assert_eq!(of(ColorType::Grayscale, One, &[0b0100_0000]), two(&[0, 255]));
        assert_eq!(of(ColorType::Grayscale, Sixteen, &[7, 1, 9, 2]), two(&[7, 9]));
        assert_eq!(of(ColorType::GrayscaleAlpha, Eight, &[7, 1, 9, 2]), two(&[7, 1, 9, 2]));
        assert_eq!(of(ColorType::Rgb, Eight, &[1, 2, 3, 4, 5, 6]), two(&[1, 2, 3, 4, 5, 6]));
        assert_eq!(of(ColorType::Rgba, Eight, &[1, 2, 3, 4, 5, 6, 7, 8]), two(&[1, 2, 3, 4, 5, 6, 7, 8]));
        let palette = (&[1, 2, 3, 4, 5, 6][..], &[128][..]);
        let indexed = png(ColorType::Indexed, Eight, 1, &[1, 0], Some(palette));
        assert_eq!(read(&indexed).unwrap(), two(&[4, 5, 6, 255, 1, 2, 3, 128]));
    }

    #[test]
    fn broken_images_are_refused() {
        let whole = png(ColorType::Rgb, BitDepth::Eight, 2, &[1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12], None);
        assert!(read(&whole).is_ok());
        for length in 0..whole.len() - 12 {
            assert!(read(&whole[..length]).is_err(), "{length}");
        }
        let mut giant = whole.clone();
        giant[16..24].copy_from_slice(&[0, 1, 0x86, 0xa0, 0, 1, 0x86, 0xa0]);
        let crc = crc32fast::hash(&giant[12..29]).to_be_bytes();
        giant[29..33].copy_from_slice(&crc);
        assert_eq!(read(&giant), Err("too large".into()));
        assert!(read(b"\xabKTX 20\xbb\r\n\x1a\n").unwrap_err().contains("KTX2"));
        assert!(read(b"GIF89a").unwrap_err().contains("no PNG"));
        for start in [
            &b"\xff\xd8\xff\xe0"[..],
            b"RIFF\0\0\0\0WEBPVP8 ",
            b"RIFF\xff\xff\xff\xffWEBPVP8L\xff\xff\xff\xff",
        ] {
            let broken = read(&[start, &[0xa5; 64]].concat());
            assert!(broken.unwrap_err().contains("is broken"));
        }
    }

    /// A JPEG of one grey block, part by part as ITU-T T.81 has them.
    #[test]
    fn jpeg_without_colour() {
        let mut file = b"\xff\xd8\xff\xdb\0\x43\0".to_vec();
        file.extend([8; 64]); // The steps of all coefficients are 8.
        file.extend(b"\xff\xc0\0\x0b\x08\0\x08\0\x08\x01\x01\x11\0"); // Eight rows and columns, one component
        let code = |class: u8, symbol: u8| {
            let mut part = vec![0xff, 0xc4, 0, 20, class, 1];
            part.extend([0; 15]);
            part.push(symbol);
            part
        };
        file.extend(code(0x00, 7)); // The code 0 stands for a mean of seven bits,
        file.extend(code(0x10, 0)); // and then for the end of the block.
        file.extend(b"\xff\xda\0\x08\x01\x01\0\0\x3f\0");
        file.push(0b0100_0000); // The mean is 64 above the middle, 128.
        file.push(0b0111_1111);
        file.extend(b"\xff\xd9");
        let image = read(&file).unwrap();
        let texture = crate::scene::texture::Texture::new(std::sync::Arc::new(image));
        assert_eq!(texture.values([0.5; 2]), [192.0 / 255.0, 192.0 / 255.0, 192.0 / 255.0, 1.0]);
        assert!(read(&file[..60]).unwrap_err().contains("JPEG is broken"));
    }

    /// A lossless WebP, bit by bit as the format's specification spells it out.
    #[test]
    fn webp_without_loss() {
        // Simple codes of one symbol each for green, red, blue, alpha and distances: the image is one colour.
        let mut bits = Bits::default();
        bits.push(0x2f, 8);
        bits.push(1, 14); // Two columns
        bits.push(0, 14); // One row
        bits.push(1, 1); // Alpha is used.
        bits.push(0, 3); // The version
        bits.push(0, 1); // No transform
        bits.push(0, 1); // No colour cache
        bits.push(0, 1); // One group of codes
        for symbol in [20, 10, 30, 128] {
            bits.push(1, 1); // A simple code
            bits.push(0, 1); // of one symbol
            bits.push(1, 1); // of eight bits.
            bits.push(symbol, 8);
        }
        [1, 0, 0, 0].into_iter().for_each(|bit| bits.push(bit, 1));
        let data = bits.bytes();
        let mut file = b"RIFF".to_vec();
        file.extend((12 + data.len() as u32).to_le_bytes());
        file.extend(b"WEBPVP8L");
        file.extend((data.len() as u32).to_le_bytes());
        file.extend(&data);
        assert_eq!(read(&file), Ok(Image::new(2, 4, [10, 20, 30, 128].repeat(2)).unwrap()));
    }

    #[derive(Default)]
    struct Bits(Vec<bool>);

    impl Bits {
        fn push(&mut self, value: u32, count: u32) {
            self.0.extend((0..count).map(|bit| value >> bit & 1 == 1));
        }

        fn bytes(&self) -> Vec<u8> {
            let byte = |bits: &[bool]| {
                bits.iter().enumerate().fold(0, |byte, (at, &bit)| byte | u8::from(bit) << at)
            };
            let mut bytes: Vec<u8> = self.0.chunks(8).map(byte).collect();
            bytes.resize(bytes.len().next_multiple_of(2), 0);
            bytes
        }
    }
}
