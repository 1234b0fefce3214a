//! The choice of a disparity for each pixel, and the checks that a pixel passes on its own.

use rayon::prelude::*;

use super::cost::inside;
use super::{Matched, Settings, UNITS_PER_PX, Verdict};

/// The choices for all pixels of an image.
pub fn choices(costs: &[i16], sums: &[i16], textured: &[bool], width: usize, settings: &Settings) -> Matched {
    let pixels = textured.len();
    let mut disparity = vec![0; pixels];
    let mut confidence = vec![0; pixels];
    let mut verdict = vec![Verdict::Matched; pixels];
    let rows = disparity.par_chunks_mut(width).zip(confidence.par_chunks_mut(width));
    let rows = rows.zip(verdict.par_chunks_mut(width)).zip(textured.par_chunks(width));
    let length = width * settings.disparities;
    let rows = rows.zip(costs.par_chunks(length)).zip(sums.par_chunks(length));
    rows.for_each_init(
        || Seen::new(width),
        |seen, (((((disparity, confidence), verdict), textured), costs), sums)| {
            seen.look(sums, settings);
            for (column, sums) in sums.chunks_exact(settings.disparities).enumerate() {
                let costs = &costs[column * settings.disparities..][..settings.disparities];
                let best = Best::of(sums);
                let inside = best.is_inside(column, width, settings);
                disparity[column] = best.disparity(costs, inside, settings);
                confidence[column] = best.confidence();
                verdict[column] = if !textured[column] {
                    Verdict::NoTexture
                } else if !inside {
                    Verdict::OutsideSearch
                } else if best.is_ambiguous(costs, settings) {
                    Verdict::Ambiguous
                } else if !seen.agrees(column, best.number, settings) {
                    Verdict::Occluded
                } else {
                    Verdict::Matched
                };
            }
        },
    );
    Matched { width, height: pixels / width, disparity, confidence, verdict }
}

/// The disparity of the least cost at a pixel.
struct Best {
    /// Its number: the first of equals.
    number: usize,
    cost: i16,
    /// The least cost but for it and the two beside it, or the largest number if there is none.
    second: i16,
}

impl Best {
    fn of(sums: &[i16]) -> Self {
        let cost = least(sums);
        let number = sums.iter().position(|sum| *sum == cost).unwrap_or(0);
        Self { number, cost, second: least_apart(sums, number) }
    }

    /// Whether the disparities on both sides are searched and in the right image.
    fn is_inside(&self, column: usize, width: usize, settings: &Settings) -> bool {
        let (inside, _) = inside(column, width, settings);
        inside.start < self.number && self.number + 1 < inside.end
    }

    fn disparity(&self, costs: &[i16], inside: bool, settings: &Settings) -> i32 {
        let whole = (settings.first_disparity + self.number as i32) * UNITS_PER_PX;
        if !inside {
            return whole;
        }
        let around = [self.number - 1, self.number, self.number + 1].map(|number| i32::from(costs[number]));
        whole + settings.sub_pixel.offset(around)
    }

    fn confidence(&self) -> u8 {
        let (best, second) = (i32::from(self.cost), i32::from(self.second));
        (255 * (second - best).max(0)).checked_div(second).unwrap_or(0) as u8
    }

    /// Whether another disparity is nearly as good, in the sums of the paths or in the costs of the block.
    fn is_ambiguous(&self, costs: &[i16], settings: &Settings) -> bool {
        let close = |best: i16, second: i16, percent: u8| {
            (100 - i32::from(percent)) * i32::from(second) <= 100 * i32::from(best)
        };
        close(self.cost, self.second, settings.uniqueness_percent)
            || settings
                .repetition_percent
                .is_some_and(|percent| close(costs[self.number], least_apart(costs, self.number), percent))
    }
}

fn least(costs: &[i16]) -> i16 {
    costs.iter().fold(i16::MAX, |least, cost| least.min(*cost))
}

/// The least cost but for that of a number and the two beside it, or the largest number if there is none.
fn least_apart(costs: &[i16], number: usize) -> i16 {
    least(&costs[..number.saturating_sub(1)]).min(least(costs.get(number + 2..).unwrap_or(&[])))
}

/// The best disparities of the right image's pixels in a row, from the same sums: the disparity d of the right column u has the cost
/// which it has at the left column u + d. Columns are mirrored.
struct Seen {
    cost: Vec<i16>,
    /// The number of the disparity: the first of equals.
    number: Vec<i16>,
}

impl Seen {
    fn new(width: usize) -> Self {
        Self { cost: vec![0; width], number: vec![0; width] }
    }

    fn look(&mut self, sums: &[i16], settings: &Settings) {
        let width = self.cost.len();
        self.cost.fill(i16::MAX);
        self.number.fill(0);
        // A right pixel meets its disparities in ascending order, because columns ascend.
        for (column, sums) in sums.chunks_exact(settings.disparities).enumerate() {
            let (inside, mirrored) = inside(column, width, settings);
            if inside.is_empty() {
                continue;
            }
            let (from, first) = ((mirrored + inside.start as isize) as usize, inside.start as i16);
            let sums = &sums[inside];
            let (cost, number) =
                (&mut self.cost[from..][..sums.len()], &mut self.number[from..][..sums.len()]);
            for d in 0..sums.len() {
                let lower = sums[d] < cost[d];
                number[d] = if lower { first + d as i16 } else { number[d] };
                cost[d] = cost[d].min(sums[d]);
            }
        }
    }

    /// Whether the right pixel that a left one is matched with finds about the same disparity. It lies in the image.
    fn agrees(&self, column: usize, number: usize, settings: &Settings) -> bool {
        let Some(most) = settings.left_right_px else { return true };
        let (_, mirrored) = inside(column, self.cost.len(), settings);
        let found = self.number[(mirrored + number as isize) as usize];
        found.abs_diff(number as i16) <= most
    }
}
