//! Textures: images that are laid over surfaces, and how a point of a surface finds its place in one.
//!
//! An image is sampled at its full resolution, texel by texel or between four of them, and colours are decoded before they are
//! mixed. A beam has no width, so there is no footprint to average over. All of it is plain arithmetic in f64, and the curve of
//! sRGB comes from `libm`, so every platform sees the same.

use std::sync::{Arc, LazyLock};

/// The texels of an image, row by row from the top. They are kept as their file has them, with one to four channels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    width: u32,
    channels: usize,
    bytes: Vec<u8>,
    /// Columns and rows, also of an image that is kept as one texel.
    size: [u32; 2],
    format: Option<&'static str>,
}

impl Image {
    /// An image of `width` columns and as many rows as the bytes fill. A texel has `channels` bytes: grey, grey and alpha, red, green
    /// and blue, or these and alpha. `None` if there is no texel, or the last row is not full. An image of one colour is kept as one
    /// texel.
    pub fn new(width: u32, channels: usize, mut bytes: Vec<u8>) -> Option<Self> {
        if width == 0 || bytes.is_empty() || !(1..=4).contains(&channels) {
            return None;
        }
        if !bytes.len().is_multiple_of((width as usize).checked_mul(channels)?) {
            return None;
        }
        let size = [width, (bytes.len() / channels / width as usize) as u32];
        if bytes.chunks_exact(channels).all(|texel| *texel == bytes[..channels]) {
            bytes.truncate(channels);
            bytes.shrink_to_fit();
            return Some(Self { width: 1, channels, bytes, size, format: None });
        }
        Some(Self { width, channels, bytes, size, format: None })
    }

    /// The image with the name of the format of its file.
    #[must_use]
    pub fn of_format(self, format: &'static str) -> Self {
        Self { format: Some(format), ..self }
    }

    /// The columns and the rows of the image, as its file has them.
    pub fn size(&self) -> [u32; 2] {
        self.size
    }

    /// The format of the image's file, such as `PNG`. `None` if it is from no file.
    pub fn format(&self) -> Option<&'static str> {
        self.format
    }

    /// The bytes that the texels take.
    pub fn bytes(&self) -> usize {
        self.bytes.len()
    }

    fn height(&self) -> u32 {
        (self.bytes.len() / self.channels / self.width as usize) as u32
    }

    /// Red, green, blue and alpha of a texel.
    fn texel(&self, index: usize) -> [u8; 4] {
        match self.bytes[index * self.channels..(index + 1) * self.channels] {
            [grey] => [grey, grey, grey, u8::MAX],
            [grey, alpha] => [grey, grey, grey, alpha],
            [r, g, b] => [r, g, b, u8::MAX],
            [r, g, b, a] => [r, g, b, a],
            _ => [u8::MAX; 4],
        }
    }
}

/// How a texture goes on beyond the edges of its image, along one axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Wrap {
    /// The image begins anew.
    #[default]
    Repeat,
    /// The image is mirrored at each edge.
    MirroredRepeat,
    /// The texels at the edge go on for ever.
    ClampToEdge,
}

impl Wrap {
    /// The texel that stands for the texel `index`, a whole number of any size, of a row or column of `count`.
    fn texel(self, index: f64, count: u32) -> usize {
        let n = f64::from(count);
        let within = match self {
            Self::Repeat => index.rem_euclid(n),
            Self::MirroredRepeat => {
                let index = index.rem_euclid(2.0 * n);
                if index < n { index } else { 2.0 * n - 1.0 - index }
            }
            Self::ClampToEdge => index,
        };
        within.clamp(0.0, n - 1.0) as usize
    }
}

/// An image on a surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// The image.
    pub image: Arc<Image>,
    /// The number of the set of texture coordinates, among those of the corners of triangles.
    pub uv_set: usize,
    /// The map from texture coordinates to those of the image, row by row. From the origin, the image's upper left corner, to
    /// (1, 1), its lower right one, the image is seen once.
    pub image_from_uv: [[f64; 3]; 2],
    /// How the image goes on to the sides, and up and down.
    pub wrap: [Wrap; 2],
    /// Whether a point has the value of the texel that it lies in. Else it has one between those of the four nearest.
    pub is_nearest: bool,
}

impl Texture {
    /// An image once between (0, 0) and (1, 1) of the first texture coordinates, and repeated beyond.
    pub fn new(image: Arc<Image>) -> Self {
        let image_from_uv = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        Self { image, uv_set: 0, image_from_uv, wrap: [Wrap::Repeat; 2], is_nearest: false }
    }

    /// The linear colour at texture coordinates, with alpha, of an image whose colours are sRGB.
    pub(super) fn color(&self, uv: [f64; 2]) -> [f32; 4] {
        self.sample(uv, |[r, g, b, a]| {
            let linear = |c: u8| LINEAR[usize::from(c)];
            [linear(r), linear(g), linear(b), f64::from(a) / 255.0]
        })
    }

    /// The values at texture coordinates of an image that holds fractions of 255.
    pub(super) fn values(&self, uv: [f64; 2]) -> [f32; 4] {
        self.sample(uv, |texel| texel.map(|c| f64::from(c) / 255.0))
    }

    /// A mixture of decoded texels. Where the coordinates are no numbers, the texture is white.
    fn sample(&self, [u, v]: [f64; 2], decode: impl Fn([u8; 4]) -> [f64; 4]) -> [f32; 4] {
        let [x, y] = self.image_from_uv.map(|[by_u, by_v, offset]| by_u * u + by_v * v + offset);
        let (width, height) = (self.image.width, self.image.height());
        let (x, y) = (x * f64::from(width), y * f64::from(height));
        if !(x.is_finite() && y.is_finite()) {
            return [1.0; 4];
        }
        let texel = |x: f64, y: f64| {
            let (x, y) = (self.wrap[0].texel(x, width), self.wrap[1].texel(y, height));
            decode(self.image.texel(y * width as usize + x))
        };
        if self.is_nearest || width == 1 && height == 1 {
            return texel(x.floor(), y.floor()).map(|value| value as f32);
        }
        // The value of a texel is that of its middle.
        let (x, y) = (x - 0.5, y - 0.5);
        let (left, top) = (x.floor(), y.floor());
        let (to_right, to_bottom) = (x - left, y - top);
        let mix = |a: [f64; 4], b: [f64; 4], t: f64| {
            let mut mixed = [0.0; 4];
            for channel in 0..4 {
                mixed[channel] = a[channel] * (1.0 - t) + b[channel] * t;
            }
            mixed
        };
        let row = |y: f64| mix(texel(left, y), texel(left + 1.0, y), to_right);
        mix(row(top), row(top + 1.0), to_bottom).map(|value| value as f32)
    }
}

/// The linear value of each number of an sRGB channel (IEC 61966-2-1).
static LINEAR: LazyLock<[f64; 256]> = LazyLock::new(|| {
    std::array::from_fn(|number| {
        let c = number as f64 / 255.0;
        if c <= 0.04045 { c / 12.92 } else { libm::pow((c + 0.055) / 1.055, 2.4) }
    })
});

#[cfg(test)]
mod tests {
    use super::*;

    /// Two columns and two rows, which are told apart by red and green.
    fn four() -> Texture {
        let texels = [[0, 0, 0, 255], [255, 0, 0, 255], [0, 255, 0, 255], [255, 255, 0, 0]];
        Texture::new(Arc::new(Image::new(2, 4, texels.concat()).unwrap()))
    }

    #[test]
    fn colours_are_linear_light() {
        let grey = |c: u8| Texture::new(Arc::new(Image::new(1, 4, vec![c, 0, 255, c]).unwrap()));
        for (number, linear) in [(0, 0.0), (10, 0.0030353), (55, 0.0382044), (128, 0.2158605), (255, 1.0)] {
            let [r, g, b, a] = grey(number).color([0.3, 0.7]);
            assert!((r - linear).abs() < 1e-6, "{number}: {r}");
            assert_eq!((g, b, a), (0.0, 1.0, f32::from(number) / 255.0));
            assert_eq!(grey(number).values([0.3, 0.7])[0], f32::from(number) / 255.0);
        }
    }

    #[test]
    fn a_point_lies_between_four_texels() {
        let texture = four();
        // The middles of texels have their values, and the middle of the image has the mean.
        assert_eq!(texture.values([0.25, 0.25]), [0.0, 0.0, 0.0, 1.0]);
        assert_eq!(texture.values([0.75, 0.75]), [1.0, 1.0, 0.0, 0.0]);
        assert_eq!(texture.values([0.5, 0.5]), [0.5, 0.5, 0.0, 0.75]);
        assert_eq!(texture.values([0.375, 0.25])[0], 0.25);
        let nearest = Texture { is_nearest: true, ..four() };
        assert_eq!(nearest.values([0.4999, 0.5])[..2], [0.0, 1.0]);
        assert_eq!(nearest.values([0.5, 0.4999])[..2], [1.0, 0.0]);
        // Half the light lies between black and white, not half the number.
        assert_eq!(texture.color([0.5, 0.25])[0], 0.5);
    }

    #[test]
    fn textures_go_on_beyond_their_edges() {
        let red = |wrap: Wrap, u: f64| Texture { wrap: [wrap; 2], ..four() }.values([u, 0.25])[0];
        for (wrap, expected) in [
            (Wrap::Repeat, [1.0, 0.0, 1.0, 0.0]),
            (Wrap::MirroredRepeat, [0.0, 1.0, 0.0, 0.0]),
            (Wrap::ClampToEdge, [0.0, 1.0, 1.0, 1.0]),
        ] {
            assert_eq!([-0.25, 1.25, 1.75, 2.25].map(|u| red(wrap, u)), expected, "{wrap:?}");
        }
        // At the edge, a texture that is repeated mixes both its edges.
        assert_eq!(
            [Wrap::Repeat, Wrap::MirroredRepeat, Wrap::ClampToEdge].map(|w| red(w, 1.0)),
            [0.5, 1.0, 1.0]
        );
        // Coordinates of any size find a texel, and where they are no numbers, the texture is white.
        for u in [1e300, -1e300, 1e17, -3e9] {
            for wrap in [Wrap::Repeat, Wrap::MirroredRepeat, Wrap::ClampToEdge] {
                assert!((0.0..=1.0).contains(&red(wrap, u)), "{wrap:?} {u}");
            }
        }
        assert_eq!(four().values([f64::NAN, 0.0]), [1.0; 4]);
        assert_eq!(four().values([0.0, f64::INFINITY]), [1.0; 4]);
    }

    #[test]
    fn images_have_full_rows() {
        assert_eq!(Image::new(2, 4, vec![0; 12]), None);
        assert_eq!(Image::new(0, 4, vec![0; 12]), None);
        assert_eq!(Image::new(u32::MAX, 4, vec![0; 12]), None);
        assert_eq!(Image::new(2, 5, vec![0; 10]), None);
        assert_eq!(Image::new(2, 4, vec![]), None);
        let of_one_colour = Image::new(2, 4, vec![7; 16]).unwrap();
        assert_eq!((of_one_colour.height(), of_one_colour.bytes()), (1, 4));
        let texels = |channels| {
            let image = Image::new(1, channels, (1..=2 * channels as u8).collect()).unwrap();
            [image.texel(0), image.texel(1)]
        };
        assert_eq!(texels(1), [[1, 1, 1, 255], [2, 2, 2, 255]]);
        assert_eq!(texels(2), [[1, 1, 1, 2], [3, 3, 3, 4]]);
        assert_eq!(texels(3), [[1, 2, 3, 255], [4, 5, 6, 255]]);
        assert_eq!(texels(4), [[1, 2, 3, 4], [5, 6, 7, 8]]);
        assert_eq!((four().image.height(), four().image.bytes()), (2, 16));
    }
}
