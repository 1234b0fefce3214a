//! Semi-global matching: the cost of a disparity at a pixel and of the smoothest surface that leads there along a straight path.
//!
//! Along the path of step r, with C the cost at a pixel p for the disparity d (Hirschmüller 2008, equation 13):
//!
//! L(p, d) = C(p, d) + min(L(p − r, d), L(p − r, d − 1) + P1, L(p − r, d + 1) + P1, min over k of L(p − r, k) + P2) − min over k of L(p − r, k)
//!
//! and L = C where the path enters the image. No L is more than the largest C + P2.

use rayon::prelude::*;

use super::{Paths, Settings};

/// The cost beside the first and the last disparity: more than any cost of a path, and no overflow with a penalty added, because
/// the largest cost of a path is at most i16::MAX/4.
const BEYOND: i16 = i16::MAX / 2;

/// The pixels of a row that one task takes.
const CHUNK: usize = 64;

/// The penalties P1 and P2 in units of the costs.
#[derive(Clone, Copy)]
struct Penalties {
    p1: i16,
    p2: i16,
}

impl Penalties {
    fn of(settings: &Settings) -> Self {
        Self { p1: settings.in_costs(settings.p1.into()), p2: settings.in_costs(settings.p2.into()) }
    }
}

/// The costs of a path at a pixel: what stands before the first disparity, the costs, what stands behind the last one, and their
/// minimum. All zeros where the path comes from outside of the image.
fn outside(disparities: usize) -> Vec<i16> {
    let mut costs = vec![0; disparities + 3];
    (costs[0], costs[disparities + 1]) = (BEYOND, BEYOND);
    costs
}

/// One step of a path: from the costs of the pixel before to those of this one, which are added to the sums or, if `FIRST`, make them.
#[inline(always)]
fn step<const FIRST: bool>(
    costs: &[i16],
    before: &[i16],
    now: &mut [i16],
    sums: &mut [i16],
    penalties: Penalties,
) {
    let count = costs.len();
    let (lower, same, upper) = (&before[..count], &before[1..][..count], &before[2..][..count]);
    let least = before[count + 2];
    let Penalties { p1, p2 } = penalties;
    let (jump, sums) = (least + p2, &mut sums[..count]);
    let (path, minimum) = now[1..].split_at_mut(count);
    let mut lowest = i16::MAX;
    for d in 0..count {
        let way = (lower[d].min(upper[d]) + p1).min(same[d]).min(jump);
        let cost = costs[d] + (way - least);
        path[d] = cost;
        sums[d] = if FIRST { cost } else { sums[d] + cost };
        lowest = lowest.min(cost);
    }
    minimum[1] = lowest;
}

/// Makes the sums of a row's costs along the paths from the left and from the right.
pub fn row(costs: &[i16], sums: &mut [i16], settings: &Settings) {
    let (count, penalties) = (settings.disparities, Penalties::of(settings));
    let (mut before, mut now) = (outside(count), outside(count));
    for (costs, sums) in costs.chunks_exact(count).zip(sums.chunks_exact_mut(count)) {
        step::<true>(costs, &before, &mut now, sums, penalties);
        std::mem::swap(&mut before, &mut now);
    }
    before = outside(count);
    for (costs, sums) in costs.chunks_exact(count).zip(sums.chunks_exact_mut(count)).rev() {
        step::<false>(costs, &before, &mut now, sums, penalties);
        std::mem::swap(&mut before, &mut now);
    }
}

/// Adds the costs along the paths that change the row.
pub fn columns(costs: &[i16], sums: &mut [i16], width: usize, settings: &Settings) {
    let length = width * settings.disparities;
    let rows = || costs.chunks_exact(length);
    sweep(rows().zip(sums.chunks_exact_mut(length)), width, settings);
    sweep(rows().zip(sums.chunks_exact_mut(length)).rev(), width, settings);
}

/// Adds the costs along the paths that lead from each row to the next: straight on and, of eight paths, from both sides. The pixels
/// of a row are shared out among the threads, because they depend on the row before alone.
fn sweep<'a>(rows: impl Iterator<Item = (&'a [i16], &'a mut [i16])>, width: usize, settings: &Settings) {
    let (count, penalties) = (settings.disparities, Penalties::of(settings));
    let sides: &[usize] = match settings.paths {
        Paths::Four => &[1],
        Paths::Eight => &[0, 1, 2],
    };
    // A pixel has its paths one after the other, and a row has a pixel outside of the image at either end.
    let (path, pixel) = (count + 3, sides.len() * (count + 3));
    let mut before = outside(count).repeat(sides.len() * (width + 2));
    let mut now = before.clone();
    for (costs, sums) in rows {
        let chunks = now[pixel..][..width * pixel].par_chunks_mut(CHUNK * pixel);
        let chunks = chunks.zip(sums.par_chunks_mut(CHUNK * count)).zip(costs.par_chunks(CHUNK * count));
        chunks.enumerate().for_each(|(chunk, ((now, sums), costs))| {
            let pixels = now.chunks_exact_mut(pixel).zip(sums.chunks_exact_mut(count));
            for (at, ((now, sums), costs)) in pixels.zip(costs.chunks_exact(count)).enumerate() {
                for (number, side) in sides.iter().enumerate() {
                    let from = (CHUNK * chunk + at + side) * pixel + number * path;
                    let now = &mut now[number * path..][..path];
                    step::<false>(costs, &before[from..][..path], now, sums, penalties);
                }
            }
        });
        std::mem::swap(&mut before, &mut now);
    }
}
