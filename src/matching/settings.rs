//! The settings of a matcher and their ranges.

use super::{SubPixel, UNITS_PER_PX};

/// The largest number of disparities that are searched, and the farthest from 0 that the search may begin.
const MOST_DISPARITIES: usize = 4096;

/// The settings of a depth camera's matcher.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Settings {
    /// The first disparity that is searched, in pixels, −4096 to 4096. It is negative for cameras that squint.
    pub first_disparity: i32,
    /// The number of whole disparities that are searched, 1 to 4096. A surface is found if its disparity is more than the first and
    /// less than the last one.
    pub disparities: usize,
    /// The columns and rows of the census window. Both are odd, and the window has at most 65 pixels: the centre is compared with
    /// each of the others, which gives at most 64 bits.
    pub census: (usize, usize),
    /// The edge of the square block over which the Hamming distances of a disparity are added, in pixels: odd, at most 31. 1 adds
    /// nothing.
    pub block: usize,
    /// The penalty for a disparity that differs by 1 px from the one before on a path, in bits for each pixel of the block.
    pub p1: u16,
    /// The penalty for a larger difference, in bits for each pixel of the block: at least `p1`, at most 1024.
    pub p2: u16,
    /// The paths along which surfaces are smooth.
    pub paths: Paths,
    /// How a disparity's fraction of a pixel is found.
    pub sub_pixel: SubPixel,
    /// By how many per cent the best sum of the paths has to be lower than that of every disparity but the two beside it, 0 to 99. At
    /// 0 only a tie is ambiguous.
    pub uniqueness_percent: u8,
    /// The same for the costs of the block, before they are summed along the paths. Where a pattern repeats, smoothness decides for one
    /// of its repetitions, so that the sums alone do not show the others. `None` leaves out the check.
    ///
    /// It makes holes where images are dark and noisy, too. On a wall at 1 m with the default settings, 20 000 dots of a radius of
    /// 0.005 over tangents of ± 1.3 by ± 0.75, f = 430 px and the noise of an infrared image, it leaves 99.2 % of the pixels at a
    /// reflectance of 1 and 91.7 % at 0.1; 5 % leave 99.5 and 95.4 %, `None` leaves all, with 16 and 45 of 394 000 pixels wrong by
    /// more than 1 px instead of 0 and 5.
    pub repetition_percent: Option<u8>,
    /// The largest difference, in pixels, between a disparity and the one which the right image's pixel finds. `None` leaves out
    /// the check.
    pub left_right_px: Option<u16>,
    /// The texture that a window has to have.
    pub texture: Texture,
    /// What counts as a speckle. `None` leaves out the filter.
    pub speckle: Option<Speckle>,
    /// The edge of the median filter's window in pixels: odd, at most 7. 1 leaves out the filter.
    pub median: usize,
}

/// The paths of semi-global matching.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Paths {
    /// From the left, the right, above and below.
    Four,
    /// From the four corners too.
    Eight,
}

/// The texture that a census window needs: at least `count` of its pixels differ by at least `difference` grey values from the
/// centre. A count of 0 asks for none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Texture {
    /// The least difference from the window's centre that counts, in grey values.
    pub difference: u8,
    /// The least number of pixels that differ so much.
    pub count: u8,
}

/// A speckle is a patch of fewer than `pixels` pixels, in which neighbours in a row or a column differ by at most `step`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Speckle {
    /// The number of pixels from which on a patch is a surface.
    pub pixels: usize,
    /// The largest difference between the disparities of neighbours in one patch, in units of 1/256 px.
    pub step: i32,
}

impl Default for Settings {
    /// The settings with which SAPIEN imitates a RealSense D435 (X. Zhang et al., "Close the optical sensing domain gap by
    /// physics-grounded active stereo sensor simulation", 2022, and its source), with four paths instead of eight.
    fn default() -> Self {
        Self {
            first_disparity: 0,
            disparities: 128,
            census: (7, 7),
            block: 7,
            p1: 8,
            p2: 32,
            paths: Paths::Four,
            sub_pixel: SubPixel::Equiangular,
            uniqueness_percent: 10,
            repetition_percent: Some(10),
            left_right_px: Some(1),
            texture: Texture { difference: 0, count: 0 },
            speckle: Some(Speckle { pixels: 100, step: UNITS_PER_PX }),
            median: 5,
        }
    }
}

/// A setting that a matcher can't have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Unfit {
    /// The field of [`Settings`].
    pub setting: &'static str,
    /// What it must be, such as "odd".
    pub rule: &'static str,
}

impl Settings {
    /// The first setting that is out of its range, if there is one.
    pub fn unfit(&self) -> Option<Unfit> {
        let most = MOST_DISPARITIES as i32;
        let (cols, rows) = self.census;
        let odd = |edge: usize, most: usize| edge % 2 == 1 && edge <= most;
        let rules = [
            ("first_disparity", (-most..=most).contains(&self.first_disparity), "from -4096 to 4096"),
            ("disparities", (1..=MOST_DISPARITIES).contains(&self.disparities), "from 1 to 4096"),
            (
                "census",
                odd(cols, 65) && odd(rows, 65) && (3..=65).contains(&(cols * rows)),
                "two odd numbers whose product is from 3 to 65",
            ),
            ("block", odd(self.block, 31), "odd and at most 31"),
            ("p1", self.p1 <= self.p2, "at most p2"),
            ("p2", self.p2 <= 1024, "at most 1024"),
            ("uniqueness_percent", self.uniqueness_percent < 100, "less than 100"),
            (
                "repetition_percent",
                self.repetition_percent.is_none_or(|percent| percent < 100),
                "less than 100",
            ),
            ("speckle", self.speckle.is_none_or(|speckle| speckle.step >= 0), "a step that is not negative"),
            ("median", odd(self.median, 7), "odd and at most 7"),
        ];
        rules.iter().find(|(_, holds, _)| !holds).map(|&(setting, _, rule)| Unfit { setting, rule })
    }

    /// The most memory that a matcher takes for images of this size, in bytes: 4 for each disparity of each pixel, 12 for each
    /// disparity of a row's pixels, and 64 for each pixel. Each thread takes 3 + `block` for each disparity of a row's pixels beside it.
    pub fn memory_bytes(&self, width: usize, height: usize) -> u64 {
        let (width, height, disparities) = (width as u64, height as u64, self.disparities as u64);
        4 * width * height * (disparities + 16) + 12 * (width + 2) * (disparities + 3)
    }

    /// The number of bits of a census.
    pub(super) fn bits(&self) -> usize {
        self.census.0 * self.census.1 - 1
    }

    /// How many times costs and penalties are halved, so that the sum of all paths fits into 15 bits: no path's cost is more than
    /// the largest cost and `p2` together.
    pub(super) fn halvings(&self) -> u32 {
        let largest = self.block * self.block * (self.bits() + usize::from(self.p2));
        (0..).find(|halvings| (largest >> halvings) * self.paths.count() <= i16::MAX as usize).unwrap_or(0)
    }

    /// A number of bits for each pixel of a block as a cost.
    pub(super) fn in_costs(&self, bits: usize) -> i16 {
        ((self.block * self.block * bits) >> self.halvings()) as i16
    }
}

impl Paths {
    pub(super) fn count(self) -> usize {
        match self {
            Self::Four => 4,
            Self::Eight => 8,
        }
    }
}
