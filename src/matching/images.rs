//! The images that are matched, and what comes of them.

use super::UNITS_PER_PX;

/// A grey image, row by row from the top, each row from the left.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Gray {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) pixels: Vec<u8>,
}

impl Gray {
    /// An image of these pixels. `None` if their number is not width·height, or is 0.
    pub fn new(width: usize, height: usize, pixels: Vec<u8>) -> Option<Self> {
        let fits = !pixels.is_empty() && width.checked_mul(height) == Some(pixels.len());
        fits.then_some(Self { width, height, pixels })
    }

    /// The number of columns, at least 1.
    pub fn width(&self) -> usize {
        self.width
    }

    /// The number of rows, at least 1.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The pixels, row by row.
    pub fn pixels(&self) -> &[u8] {
        &self.pixels
    }
}

/// The outcome of a pixel. The first that applies counts, in this order after `Matched`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Verdict {
    /// The pixel has a disparity.
    Matched,
    /// The census window has less texture than [`texture`](super::Settings::texture) asks for.
    NoTexture,
    /// The best disparity is the first or the last one, or has no neighbour on both sides in the right image. The true one may lie
    /// outside the search, and no fraction of a pixel can be found.
    OutsideSearch,
    /// Another disparity is nearly as good: see [`uniqueness_percent`](super::Settings::uniqueness_percent) and
    /// [`repetition_percent`](super::Settings::repetition_percent).
    Ambiguous,
    /// The right image's pixel finds another disparity, as it does where the left camera sees past an edge and the right one does not.
    Occluded,
    /// The pixel belongs to a patch that is too small.
    Speckle,
}

/// The disparities of the left image's pixels, row by row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Matched {
    /// The number of columns.
    pub width: usize,
    /// The number of rows.
    pub height: usize,
    /// The disparity in units of 1/256 px. A pixel that is not matched has that of the least cost, as a whole pixel where it is
    /// outside of the search, which is for looking at only.
    pub disparity: Vec<i32>,
    /// 255·(second − best)/second, rounded down, of the sums that [`uniqueness_percent`](super::Settings::uniqueness_percent)
    /// compares.
    pub confidence: Vec<u8>,
    /// The outcome of each pixel.
    pub verdict: Vec<Verdict>,
}

impl Matched {
    /// The disparity at a column and a row of the image, in pixels, if the pixel is matched.
    pub fn at(&self, column: usize, row: usize) -> Option<f64> {
        if column >= self.width || row >= self.height {
            return None;
        }
        let pixel = row * self.width + column;
        let matched = self.verdict[pixel] == Verdict::Matched;
        matched.then(|| f64::from(self.disparity[pixel]) / f64::from(UNITS_PER_PX))
    }
}
