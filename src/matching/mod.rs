//! Stereo matching of two rectified grey images, as depth cameras do it: the census transform, the sum of its Hamming distances
//! over a block, semi-global matching, and the checks that leave out what cannot be matched.
//!
//! | file | step | source |
//! |---|---|---|
//! | `census` | each pixel's comparison with its neighbours, and whether there is texture | R. Zabih and J. Woodfill, "Non-parametric local transforms for computing visual correspondence", ECCV 1994 |
//! | `cost` | the cost of each disparity of each pixel | H. Hirschmüller and D. Scharstein, "Evaluation of stereo matching costs on images with radiometric differences", PAMI 31(9), 2009 |
//! | `paths` | the costs of smooth surfaces, along 4 or 8 paths | H. Hirschmüller, "Stereo processing by semiglobal matching and mutual information", PAMI 30(2), 2008 |
//! | `choice` | the best disparity, and the checks of a pixel alone | the same |
//! | `fraction` | a disparity's fraction of a pixel | M. Shimizu and M. Okutomi, "Precise sub-pixel estimation on area-based matching", ICCV 2001 |
//! | `filter` | the checks of a pixel among its neighbours | |
//! | `settings`, `images` | what goes in and comes out | |
//!
//! The left image is the reference: what it shows at column u with a disparity of d pixels is at column u − d of the right one, in
//! the same row. For cameras of a focal length of f pixels that stand b metres apart, the depth is f·b/d.
//!
//! All of it is computed in integers, so the results are the same bits on any number of threads and any processor.

mod census;
mod choice;
mod cost;
mod filter;
mod fraction;
mod images;
mod paths;
mod settings;
#[cfg(test)]
mod tests;

pub use fraction::{SubPixel, UNITS_PER_PX};
pub use images::{Gray, Matched, Verdict};
pub use settings::{Paths, Settings, Speckle, Texture, Unfit};

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
