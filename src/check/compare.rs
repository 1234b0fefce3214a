//! Comparison of two images of the same size, channel by channel: how many pixels differ, by how much, and where.

use std::collections::BTreeMap;

use crate::output::{Image, Samples, is_of_all_pixels};

/// The tolerance of a channel. The default tolerates no difference.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tolerance {
    /// The absolute part in the channel's unit: metres for ranges and depths, seconds for times.
    pub absolute: f64,
    /// The relative part, as a fraction of the first image's value. It is added to `absolute`.
    pub relative: f64,
    /// The fraction of all pixels that may differ by more than the tolerance, 0 to 1.
    pub pixels: f64,
}

impl Tolerance {
    /// The greatest difference from `value` that is tolerated.
    fn at(&self, value: f64) -> f64 {
        self.absolute + self.relative * value.abs()
    }
}

/// The agreement of two images on the pixels that have a return. The second image is the newer one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MaskAgreement {
    /// The number of pixels with a return in both images.
    pub both: usize,
    /// The number of pixels with a return in the second image only.
    pub appeared: usize,
    /// The number of pixels with a return in the first image only.
    pub vanished: usize,
}

impl MaskAgreement {
    /// The intersection over union of the pixels with a return. It is 1 if the images agree.
    pub fn iou(&self) -> f64 {
        let union = self.both + self.appeared + self.vanished;
        if union == 0 { 1.0 } else { self.both as f64 / union as f64 }
    }
}

/// The difference between two images of the same size.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImageDifference {
    /// The agreement on the pixels that have a return.
    pub mask: MaskAgreement,
    /// The differences of the channels that both images have, sorted by name.
    pub channels: Vec<ChannelDifference>,
    /// The channels that only the first image has.
    pub missing: Vec<String>,
    /// The channels that only the second image has.
    pub added: Vec<String>,
    /// The label pairs of pixels with a return in both images, where the labels differ.
    pub label_confusion: Vec<Confusion>,
    /// The number of returns by label, in the first image and in the second.
    pub points_per_label: BTreeMap<u32, [usize; 2]>,
}

/// The number of pixels that changed from one label to another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Confusion {
    /// The label in the first image.
    pub was: u32,
    /// The label in the second.
    pub is: u32,
    /// The number of pixels.
    pub pixels: usize,
}

/// The difference in one channel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ChannelDifference {
    /// The channel's name.
    pub channel: String,
    /// Whether the difference is within the tolerance.
    pub within_tolerance: bool,
    /// The pixel numbers that differ by more than the tolerance, in order. In the main depth channel they include the
    /// pixels with a return in one image only. Causes are compared in all pixels, other channels only in pixels with a return
    /// in both images.
    pub pixels: Vec<u32>,
    /// How much differs at all. Where the first image is not known exactly, it is at least the number of
    /// [`ChannelDifference::pixels`].
    pub differing: Differing,
    /// Statistics of the absolute difference over the pixels with a return in both images. `None` for ids, and if the
    /// differences are not known.
    pub statistics: Option<Statistics>,
    /// The resolution to which the first image is known, in the channel's unit. 0 means exactly.
    pub resolution: f64,
}

/// How much of a channel differs, as closely as it is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Differing {
    /// So many pixels.
    Pixels(usize),
    /// So many pixels, or more.
    AtLeastPixels(usize),
    /// Pixels in so many rows: which of the row's pixels is not known.
    Rows(usize),
}

impl Default for Differing {
    fn default() -> Self {
        Self::Pixels(0)
    }
}

impl Differing {
    /// The number of pixels or of rows.
    pub fn count(self) -> usize {
        let (Self::Pixels(count) | Self::AtLeastPixels(count) | Self::Rows(count)) = self;
        count
    }

    /// Whether the number is exact.
    pub fn is_exact(self) -> bool {
        !matches!(self, Self::AtLeastPixels(_))
    }

    /// The unit of the counts: `pixels` or `rows`.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Pixels(_) | Self::AtLeastPixels(_) => "pixels",
            Self::Rows(_) => "rows",
        }
    }

    /// The number with its unit, of an image of so many rows and columns: `at least 1800 of 28800 pixels`, `16 of 31 rows`.
    pub fn words(self, rows: usize, columns: usize) -> String {
        match self {
            Self::Pixels(count) => format!("{count} of {} pixels", rows * columns),
            Self::AtLeastPixels(count) => format!("at least {count} of {} pixels", rows * columns),
            Self::Rows(count) => format!("{count} of {rows} rows"),
        }
    }
}

/// Statistics of absolute differences, in the channel's unit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Statistics {
    /// The greatest difference.
    pub max: f64,
    /// The pixel with the greatest difference, the first one of equals.
    pub worst: u32,
    /// The mean.
    pub mean: f64,
    /// The root of the mean square.
    pub rms: f64,
    /// The 99th percentile.
    pub p99: f64,
}

/// Compares images of the same size. `tolerance` and `resolution` are functions of the channel's name. The resolution is
/// the step to which the first image is known, and 0 if it is exact.
///
/// # Panics
/// If the sizes differ.
pub fn compare(
    first: &Image,
    second: &Image,
    tolerance: &dyn Fn(&str) -> Tolerance,
    resolution: &dyn Fn(&str) -> f64,
) -> ImageDifference {
    assert_eq!((first.rows, first.columns), (second.rows, second.columns));
    let masks = [first.mask(), second.mask()];
    let mut difference = ImageDifference { mask: agreement(&masks), ..ImageDifference::default() };
    let main = second.main_depth().map(|(name, _)| name);
    let all = [vec![true; first.pixels()], vec![true; first.pixels()]];
    for channel in &first.channels {
        let Some(other) = second.channel(&channel.name) else {
            difference.missing.push(channel.name.clone());
            continue;
        };
        let name = channel.name.as_str();
        let (tolerance, resolution) = (tolerance(name), resolution(name));
        let is_main = Some(name) == main;
        let masks = if is_of_all_pixels(name) { &all } else { &masks };
        let mut found = compare_channel(&channel.samples, other, masks, is_main, tolerance, resolution);
        found.channel = channel.name.clone();
        difference.channels.push(found);
    }
    let is_new = |name: &String| first.channel(name).is_none();
    difference.added = second.channels.iter().map(|c| c.name.clone()).filter(is_new).collect();
    if let (Some(was), Some(is)) = (first.u32("id.semantic"), second.u32("id.semantic")) {
        labels(was, is, &masks, &mut difference);
    }
    difference
}

fn agreement([first, second]: &[Vec<bool>; 2]) -> MaskAgreement {
    let mut agreement = MaskAgreement::default();
    for pair in first.iter().zip(second) {
        match pair {
            (true, true) => agreement.both += 1,
            (false, true) => agreement.appeared += 1,
            (true, false) => agreement.vanished += 1,
            (false, false) => {}
        }
    }
    agreement
}

fn compare_channel(
    first: &Samples,
    second: &Samples,
    masks: &[Vec<bool>; 2],
    is_main: bool,
    tolerance: Tolerance,
    resolution: f64,
) -> ChannelDifference {
    let are_ids = matches!((first, second), (Samples::U32(_), Samples::U32(_)));
    let mut pixels = Vec::new();
    let mut differences = Vec::new();
    let mut worst = (0.0, 0);
    for (index, seen) in masks[0].iter().zip(&masks[1]).enumerate() {
        let differs = match seen {
            (true, true) => {
                let (a, b) = (first.get(index), second.get(index));
                // NaN equals NaN, and differs from every number.
                let difference = if a.is_nan() && b.is_nan() { 0.0 } else { (a - b).abs() };
                let difference = if difference.is_nan() { f64::INFINITY } else { difference };
                if difference > worst.0 {
                    worst = (difference, index as u32);
                }
                differences.push(difference);
                difference > tolerance.at(a) + rounding(a, resolution)
            }
            (false, false) => false,
            _ => is_main,
        };
        if differs {
            pixels.push(index as u32);
        }
    }
    ChannelDifference {
        channel: String::new(),
        within_tolerance: pixels.len() as f64 <= tolerance.pixels * first.len() as f64,
        differing: match resolution == 0.0 {
            true => Differing::Pixels(pixels.len()),
            false => Differing::AtLeastPixels(pixels.len()),
        },
        pixels,
        statistics: if are_ids { None } else { statistics(differences, worst) },
        resolution,
    }
}

/// The largest distance between an original value and the value rounded to multiples of `resolution` and then to 32 bits.
fn rounding(rounded: f64, resolution: f64) -> f64 {
    if resolution == 0.0 { 0.0 } else { resolution / 2.0 + rounded.abs() * f64::from(f32::EPSILON) }
}

/// Statistics of absolute differences. `worst` is the greatest difference and its pixel.
fn statistics(mut differences: Vec<f64>, worst: (f64, u32)) -> Option<Statistics> {
    let count = differences.len();
    if count == 0 {
        return None;
    }
    let mean = differences.iter().sum::<f64>() / count as f64;
    let rms = (differences.iter().map(|d| d * d).sum::<f64>() / count as f64).sqrt();
    let (_, p99, _) = differences.select_nth_unstable_by((count - 1) * 99 / 100, f64::total_cmp);
    Some(Statistics { max: worst.0, worst: worst.1, mean, rms, p99: *p99 })
}

fn labels(was: &[u32], is: &[u32], masks: &[Vec<bool>; 2], difference: &mut ImageDifference) {
    let mut confusion: BTreeMap<(u32, u32), usize> = BTreeMap::new();
    for index in 0..was.len() {
        let (first, second) = (masks[0][index], masks[1][index]);
        if first {
            difference.points_per_label.entry(was[index]).or_default()[0] += 1;
        }
        if second {
            difference.points_per_label.entry(is[index]).or_default()[1] += 1;
        }
        if first && second && was[index] != is[index] {
            *confusion.entry((was[index], is[index])).or_default() += 1;
        }
    }
    difference.label_confusion =
        confusion.into_iter().map(|((was, is), pixels)| Confusion { was, is, pixels }).collect();
    difference.label_confusion.sort_by_key(|c| std::cmp::Reverse(c.pixels));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::Channel;

    /// An image of 2 × 2 pixels.
    fn image(range: [f32; 4], labels: [u32; 4]) -> Image {
        let channels = vec![
            Channel { name: "id.semantic".into(), samples: Samples::U32(labels.to_vec()) },
            Channel { name: "range".into(), samples: Samples::F32(range.to_vec()) },
        ];
        Image { rows: 2, columns: 2, channels }
    }

    const INF: f32 = f32::INFINITY;

    fn at(absolute: f64, pixels: f64) -> impl Fn(&str) -> Tolerance {
        move |name| match name {
            "range" => Tolerance { absolute, relative: 0.0, pixels },
            _ => Tolerance::default(),
        }
    }

    #[test]
    fn masks_values_and_labels_are_compared() {
        let a = image([1.0, 2.0, INF, 4.0], [1, 1, 0, 2]);
        let b = image([1.0, 2.5, 3.0, INF], [1, 5, 2, 0]);
        let d = compare(&a, &b, &at(0.0, 0.0), &|_| 0.0);
        assert_eq!(d.mask, MaskAgreement { both: 2, appeared: 1, vanished: 1 });
        assert_eq!(d.mask.iou(), 0.5);
        let [labels, range] = d.channels.as_slice() else { panic!("{d:?}") };
        assert_eq!(range.pixels, [1, 2, 3], "what came and went differs in range");
        assert_eq!(labels.pixels, [1], "and only there");
        assert_eq!(labels.statistics, None, "ids have no distance");
        let s = range.statistics.unwrap();
        assert_eq!((s.max, s.worst, s.mean), (0.5, 1, 0.25));
        assert!((s.rms - 0.125_f64.sqrt()).abs() < 1e-15);
        assert_eq!(d.label_confusion, [Confusion { was: 1, is: 5, pixels: 1 }]);
        assert_eq!(d.points_per_label, BTreeMap::from([(1, [2, 1]), (2, [1, 1]), (5, [0, 1])]));
        assert!(!range.within_tolerance);
    }

    #[test]
    fn tolerances_are_absolute_relative_and_by_share_of_pixels() {
        let a = image([1.0, 2.0, 3.0, 100.0], [0; 4]);
        let b = image([1.0, 2.01, 3.0, 101.0], [0; 4]);
        let differing = |tolerance: Tolerance| {
            let d = compare(&a, &b, &|_| tolerance, &|_| 0.0);
            (d.channels[1].pixels.len(), d.channels[1].within_tolerance)
        };
        let tolerance = |absolute, relative, pixels| Tolerance { absolute, relative, pixels };
        assert_eq!(differing(tolerance(0.0, 0.0, 0.0)), (2, false));
        assert_eq!(differing(tolerance(0.011, 0.0, 0.0)), (1, false));
        assert_eq!(differing(tolerance(0.0, 0.011, 0.0)), (0, true));
        assert_eq!(differing(tolerance(0.011, 0.0, 0.25)), (1, true));
        // A first image that is known only to 4 cm cannot show that 1 cm differs.
        let d = compare(&a, &b, &at(0.0, 0.0), &|_| 0.04);
        assert_eq!(d.channels[1].differing, Differing::AtLeastPixels(1));
    }

    /// A value midway between two steps is half a step off, and a little more once it is rounded to 32 bits.
    #[test]
    fn rounding_alone_is_no_difference() {
        let step = 1e-3_f64;
        for i in 0..100_000 {
            let value = (0.5 + f64::from(i)) * step + 1e-9 * f64::from(i % 7 - 3);
            let known = ((f64::from(value as f32) / step).round() * step) as f32;
            let (a, b) = (image([known; 4], [0; 4]), image([value as f32; 4], [0; 4]));
            let d = compare(&a, &b, &|_| Tolerance::default(), &|_| step);
            assert_eq!(d.channels[1].differing.count(), 0, "{value}");
        }
    }

    #[test]
    fn channels_of_one_image_only_are_named() {
        let a = image([1.0; 4], [0; 4]);
        let mut b = a.clone();
        b.channels.remove(0);
        let d = compare(&a, &b, &at(0.0, 0.0), &|_| 0.0);
        assert_eq!((d.missing, d.added), (vec!["id.semantic".to_owned()], vec![]));
        let d = compare(&b, &a, &at(0.0, 0.0), &|_| 0.0);
        assert_eq!((d.missing, d.added), (vec![], vec!["id.semantic".to_owned()]));
    }
}
