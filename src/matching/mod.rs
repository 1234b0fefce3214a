//! Stereo matching of two rectified grey images, as depth cameras do it: the census transform, the sum of its Hamming distances
//! over a block, semi-global matching, and the checks that leave out what cannot be matched.
//!
//! | file | step | source |
//! |---|---|---|
//! | `census` | each pixel's comparison with its neighbours, and whether there is texture | R. Zabih and J. Woodfill, "Non-parametric local transforms for computing visual correspondence", ECCV 1994 |
//! | `cost` | the cost of each disparity of each pixel | H. Hirschmüller and D. Scharstein, "Evaluation of stereo matching costs on images with radiometric differences", PAMI 31(9), 2009 |
//! | `paths` | the costs of smooth surfaces, along 4 or 8 paths | H. Hirschmüller, "Stereo processing by semiglobal matching and mutual information", PAMI 30(2), 2008 |
//! | `choice` | the best disparity, its fraction of a pixel, and the checks of a pixel alone | the same, and M. Shimizu and M. Okutomi, "Precise sub-pixel estimation on area-based matching", ICCV 2001 |
//! | `filter` | the checks of a pixel among its neighbours | |
//!
//! The left image is the reference: what it shows at column u with a disparity of d pixels is at column u − d of the right one, in
//! the same row. For cameras of a focal length of f pixels that stand b metres apart, the depth is f·b/d.
//!
//! All of it is computed in integers, so the results are the same bits on any number of threads and any processor.

mod census;
mod choice;
mod cost;
mod filter;
mod paths;
#[cfg(test)]
mod tests;

pub use choice::SubPixel;

/// The unit of disparities: 1/256 of a pixel.
pub const UNITS_PER_PX: i32 = 256;

/// The largest number of disparities that are searched, and the farthest from 0 that the search may begin.
const MOST_DISPARITIES: usize = 4096;

/// A grey image, row by row from the top, each row from the left.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Gray {
    width: usize,
    height: usize,
    pixels: Vec<u8>,
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
    pub repetition_percent: Option<u8>,
    /// The largest difference, in pixels, between a disparity and the one which the right image's pixel finds. `None` leaves out
    /// the check.
    pub left_right_px: Option<u16>,
    /// What counts as texture.
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

    /// The memory that a matcher holds for images of this size, in bytes: 4 for each disparity of each pixel, and about a hundred
    /// for each pixel. Each thread holds 3 + `block` bytes for each disparity of a row's pixels beside it.
    pub fn memory_bytes(&self, width: usize, height: usize) -> u64 {
        let pixels = width as u64 * height as u64;
        pixels * (4 * self.disparities as u64 + 100)
    }

    /// The number of bits of a census.
    fn bits(&self) -> usize {
        self.census.0 * self.census.1 - 1
    }

    /// How many times costs and penalties are halved, so that the sum of all paths fits into 15 bits: no path's cost is more than
    /// the largest cost and `p2` together.
    fn halvings(&self) -> u32 {
        let largest = self.block * self.block * (self.bits() + usize::from(self.p2));
        (0..).find(|halvings| (largest >> halvings) * self.paths.count() <= i16::MAX as usize).unwrap_or(0)
    }

    /// A number of bits for each pixel of a block as a cost.
    fn in_costs(&self, bits: usize) -> i16 {
        ((self.block * self.block * bits) >> self.halvings()) as i16
    }
}

impl Paths {
    fn count(self) -> usize {
        match self {
            Self::Four => 4,
            Self::Eight => 8,
        }
    }
}

/// What became of a pixel. The first that applies counts, in this order after `Matched`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Verdict {
    /// The pixel has a disparity.
    Matched,
    /// The census window has less texture than [`Settings::texture`] asks for.
    NoTexture,
    /// The best disparity is the first or the last one, or has no neighbour on both sides in the right image. The true one may lie
    /// outside the search, and no fraction of a pixel can be found.
    OutsideSearch,
    /// Another disparity is nearly as good: see [`Settings::uniqueness_percent`] and [`Settings::repetition_percent`].
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
    /// 255·(second − best)/second, rounded down, of the costs that [`Settings::uniqueness_percent`] compares.
    pub confidence: Vec<u8>,
    /// What became of each pixel.
    pub verdict: Vec<Verdict>,
}

impl Matched {
    /// The disparity at a column and a row of the image, in pixels, if the pixel is matched.
    pub fn at(&self, column: usize, row: usize) -> Option<f64> {
        let pixel = row * self.width + column;
        let matched = column < self.width && self.verdict.get(pixel) == Some(&Verdict::Matched);
        matched.then(|| f64::from(self.disparity[pixel]) / f64::from(UNITS_PER_PX))
    }
}

/// A matcher, which keeps its memory from one pair of images to the next.
#[derive(Clone, Debug)]
pub struct Matcher {
    settings: Settings,
    /// The cost of each disparity of each pixel.
    costs: Vec<i16>,
    /// The sum of its paths' costs.
    sums: Vec<i16>,
}

impl Matcher {
    /// A matcher with these settings.
    ///
    /// # Errors
    /// A setting is out of its range.
    pub fn new(settings: Settings) -> Result<Self, Unfit> {
        match settings.unfit() {
            Some(unfit) => Err(unfit),
            None => Ok(Self { settings, costs: vec![], sums: vec![] }),
        }
    }

    /// The disparities of the left image's pixels. `None` if the images differ in size.
    pub fn matched(&mut self, left: &Gray, right: &Gray) -> Option<Matched> {
        if (left.width, left.height) != (right.width, right.height) {
            return None;
        }
        let settings = &self.settings;
        let cells = left.pixels.len().checked_mul(settings.disparities)?;
        self.costs.resize(cells, 0);
        self.sums.resize(cells, 0);
        let texture = census::textured(left, settings);
        let (left, right) =
            (census::Census::of(left, settings), census::Census::of(right, settings).mirrored());
        cost::costs_and_rows(&left, &right, settings, &mut self.costs, &mut self.sums);
        paths::columns(&self.costs, &mut self.sums, left.width, settings);
        let mut matched = choice::choices(&self.costs, &self.sums, &texture, left.width, settings);
        if let Some(speckle) = settings.speckle {
            filter::remove_speckles(&mut matched, speckle);
        }
        filter::median(&mut matched, settings.median);
        Some(matched)
    }
}
