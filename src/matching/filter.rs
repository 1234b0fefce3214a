//! The checks of a pixel among its neighbours.

use rayon::prelude::*;

use super::{Matched, Speckle, Verdict};

/// Takes their disparities from the pixels of small patches.
pub fn remove_speckles(matched: &mut Matched, speckle: Speckle) {
    let Matched { width, disparity, verdict, .. } = matched;
    let mut patch = Vec::new();
    let mut seen: Vec<bool> = verdict.iter().map(|verdict| *verdict != Verdict::Matched).collect();
    for start in 0..seen.len() {
        if seen[start] {
            continue;
        }
        patch.clear();
        patch.push(start);
        seen[start] = true;
        let mut next = 0;
        while let Some(&at) = patch.get(next) {
            next += 1;
            let column = at % *width;
            let left = (column > 0).then(|| at - 1);
            let right = (column + 1 < *width).then(|| at + 1);
            let below = (at + *width < seen.len()).then(|| at + *width);
            for beside in [left, right, at.checked_sub(*width), below].into_iter().flatten() {
                if !seen[beside] && (disparity[beside] - disparity[at]).abs() <= speckle.step {
                    seen[beside] = true;
                    patch.push(beside);
                }
            }
        }
        if patch.len() < speckle.pixels {
            patch.iter().for_each(|&at| verdict[at] = Verdict::Speckle);
        }
    }
}

/// Gives each matched pixel the median of the matched pixels in a square window around it, which ends at the image's border. Of an
/// even number, it is the lower of the two in the middle.
pub fn median(matched: &mut Matched, edge: usize) {
    if edge == 1 {
        return;
    }
    let Matched { width, height, disparity, verdict, .. } = matched;
    let (width, height, reach) = (*width, *height, edge / 2);
    let before = disparity.clone();
    disparity.par_chunks_mut(width).enumerate().for_each(|(row, disparity)| {
        let rows = row.saturating_sub(reach)..(row + reach + 1).min(height);
        let mut window = Vec::with_capacity(edge * edge);
        for (column, disparity) in disparity.iter_mut().enumerate() {
            if verdict[row * width + column] != Verdict::Matched {
                continue;
            }
            let columns = column.saturating_sub(reach)..(column + reach + 1).min(width);
            window.clear();
            for row in rows.clone() {
                let line = row * width + columns.start..row * width + columns.end;
                let pixels = before[line.clone()].iter().zip(&verdict[line]);
                window.extend(pixels.filter(|(_, v)| **v == Verdict::Matched).map(|(d, _)| *d));
            }
            let middle = (window.len() - 1) / 2;
            *disparity = *window.select_nth_unstable(middle).1;
        }
    });
}
