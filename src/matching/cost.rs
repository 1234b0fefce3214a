//! The cost of a disparity at a pixel: how many bits differ between the left pixel's census and that of the right pixel, added over
//! a block of pixels around it.
//!
//! Where the right pixel lies outside the image, half of the bits differ: that is the mean of two windows that have nothing to do
//! with each other, and speaks neither for the disparity nor against it. Blocks that reach beyond the left image repeat its outermost
//! pixels' costs.

use std::ops::Range;

use rayon::prelude::*;

use super::census::Census;
use super::{Settings, paths};

/// The rows that one task takes. The block's rows above and below them are computed once more for each task.
const BAND: usize = 40;

/// The disparities, by their number, whose right pixel lies in the image, and the mirrored column of the right pixel for disparity
/// number 0, which grows with the disparity. `column` is that of the left pixel.
pub fn inside(column: usize, width: usize, settings: &Settings) -> (Range<usize>, isize) {
    let (column, width, first) = (column as isize, width as isize, settings.first_disparity as isize);
    let mirrored = width - 1 - column + first;
    let number = |at: isize| (at - mirrored).clamp(0, settings.disparities as isize) as usize;
    (number(0)..number(width), mirrored)
}

/// Fills in the costs, and the sums of the two paths along rows.
pub fn costs_and_rows(
    left: &Census,
    right: &Census,
    settings: &Settings,
    costs: &mut [i16],
    sums: &mut [i16],
) {
    let length = left.width * settings.disparities;
    let bands = costs.par_chunks_mut(BAND * length).zip(sums.par_chunks_mut(BAND * length));
    bands.enumerate().for_each(|(band, (costs, sums))| {
        let mut block = Block::new(left, right, settings);
        let rows = costs.chunks_exact_mut(length).zip(sums.chunks_exact_mut(length));
        for (row, (costs, sums)) in rows.enumerate() {
            block.costs(BAND * band + row, costs);
            paths::row(costs, sums, settings);
        }
    });
}

/// The sums over a block that moves down the image.
struct Block<'a> {
    left: &'a Census,
    right: &'a Census,
    settings: &'a Settings,
    /// The Hamming distances of the rows in the block and of the one above it. Row r lies at r modulo their number.
    distances: Vec<Vec<u8>>,
    /// The rows from which on no distances are known.
    known: usize,
    /// The sums of the block's rows for each column and disparity.
    columns: Vec<u16>,
    /// The sums of the block for each disparity.
    block: Vec<u16>,
    /// The row that `columns` is for.
    row: Option<usize>,
}

impl<'a> Block<'a> {
    fn new(left: &'a Census, right: &'a Census, settings: &'a Settings) -> Self {
        let length = left.width * settings.disparities;
        Self {
            left,
            right,
            settings,
            distances: vec![vec![0; length]; settings.block + 1],
            known: 0,
            columns: vec![0; length],
            block: vec![0; settings.disparities],
            row: None,
        }
    }

    /// The costs of a row: the first one that is asked for, or the one below the row before.
    fn costs(&mut self, row: usize, costs: &mut [i16]) {
        let reach = self.settings.block / 2;
        let last = self.left.height - 1;
        let within = |row: usize, down: usize| (row + down).saturating_sub(reach).min(last);
        match self.row {
            None => {
                self.known = within(row, 0);
                for down in 0..self.settings.block {
                    let slot = self.learn(within(row, down));
                    add(&mut self.columns, &self.distances[slot]);
                }
            }
            Some(before) => {
                let enters = self.learn(within(row, self.settings.block - 1));
                let leaves = within(before, 0) % self.distances.len();
                replace(&mut self.columns, &self.distances[enters], &self.distances[leaves]);
            }
        }
        self.row = Some(row);
        self.slide(costs);
    }

    /// The slot of a row's distances, which are computed if they are not known.
    fn learn(&mut self, row: usize) -> usize {
        let slot = row % self.distances.len();
        if row >= self.known {
            distances(self.left, self.right, row, self.settings, &mut self.distances[slot]);
            self.known = row + 1;
        }
        slot
    }

    /// The costs of a row from the sums of its columns.
    fn slide(&mut self, costs: &mut [i16]) {
        let (count, halvings) = (self.settings.disparities, self.settings.halvings());
        let (reach, last) = (self.settings.block / 2, self.left.width - 1);
        let column = |at: usize, along: usize| {
            let at = (at + along).saturating_sub(reach).min(last);
            &self.columns[at * count..][..count]
        };
        self.block.fill(0);
        for along in 0..self.settings.block {
            for (sum, column) in self.block.iter_mut().zip(column(0, along)) {
                *sum += column;
            }
        }
        for (at, costs) in costs.chunks_exact_mut(count).enumerate() {
            if at > 0 {
                let (enters, leaves) = (column(at, self.settings.block - 1), column(at - 1, 0));
                for ((sum, enters), leaves) in self.block.iter_mut().zip(enters).zip(leaves) {
                    *sum = *sum + enters - leaves;
                }
            }
            for (cost, sum) in costs.iter_mut().zip(&self.block) {
                *cost = (sum >> halvings) as i16;
            }
        }
    }
}

fn add(sums: &mut [u16], row: &[u8]) {
    for (sum, distance) in sums.iter_mut().zip(row) {
        *sum += u16::from(*distance);
    }
}

fn replace(sums: &mut [u16], enters: &[u8], leaves: &[u8]) {
    for ((sum, enters), leaves) in sums.iter_mut().zip(enters).zip(leaves) {
        *sum = *sum + u16::from(*enters) - u16::from(*leaves);
    }
}

/// The Hamming distances of a row's pixels for each disparity.
fn distances(left: &Census, right: &Census, row: usize, settings: &Settings, distances: &mut [u8]) {
    let (left_row, right_row) = (left.row(row), right.row(row));
    let run = match left.planes {
        1 => distances_of::<1>,
        2 => distances_of::<2>,
        3 => distances_of::<3>,
        4 => distances_of::<4>,
        5 => distances_of::<5>,
        6 => distances_of::<6>,
        7 => distances_of::<7>,
        _ => distances_of::<8>,
    };
    run(left_row, right_row, settings, distances);
}

/// [`distances`] for censuses of so many planes.
fn distances_of<const PLANES: usize>(left: &[u8], right: &[u8], settings: &Settings, distances: &mut [u8]) {
    let width = left.len() / PLANES;
    let neutral = (settings.bits() / 2) as u8;
    for (column, distances) in distances.chunks_exact_mut(settings.disparities).enumerate() {
        let (inside, mirrored) = inside(column, width, settings);
        distances[..inside.start].fill(neutral);
        distances[inside.end..].fill(neutral);
        if inside.is_empty() {
            continue;
        }
        let from = (mirrored + inside.start as isize) as usize;
        let distances = &mut distances[inside];
        let centre: [u8; PLANES] = std::array::from_fn(|plane| left[plane * width + column]);
        let others: [&[u8]; PLANES] =
            std::array::from_fn(|plane| &right[plane * width + from..][..distances.len()]);
        for (at, distance) in distances.iter_mut().enumerate() {
            *distance = ones(std::array::from_fn::<u8, PLANES, _>(|plane| centre[plane] ^ others[plane][at]));
        }
    }
}

/// The number of ones in some bytes, counted in pairs of bits, in halves of bytes, of which three fit without a carry, and in bytes.
/// Processors without an instruction for it do this for 16 pixels at once.
#[inline(always)]
fn ones<const BYTES: usize>(bytes: [u8; BYTES]) -> u8 {
    let (mut total, mut halves, mut added) = (0, 0, 0);
    for byte in bytes {
        let pairs = byte - (byte >> 1 & 0x55);
        halves += (pairs & 0x33) + (pairs >> 2 & 0x33);
        added += 1;
        if added == 3 {
            total += (halves & 0x0f) + (halves >> 4);
            (halves, added) = (0, 0);
        }
    }
    total + (halves & 0x0f) + (halves >> 4)
}
