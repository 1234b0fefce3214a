//! The waveform of a pulse, drawn with characters.

use super::told::{Told, unit, window_m};
use super::words::{fixed, significant};
use crate::scan::Signal;

/// The columns and lines of the plot's area.
const SIZE: (usize, usize) = (72, 10);

/// The characters of an eighth to eight eighths of a line.
const BLOCKS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];

/// The plot of a signal, with the threshold and the returns, line by line.
pub fn text(told: &Told, signal: &Signal) -> String {
    let window_m = window_m(told, signal);
    let heights = heights(signal, window_m);
    let threshold = signal.threshold.unwrap_or(0.0);
    let top = heights.iter().fold(threshold, |top: f64, height| top.max(*height)).max(f64::MIN_POSITIVE);
    let at_top = significant(top);
    let at_threshold = signal.threshold.map(|_| significant(threshold));
    let margin = [Some(&at_top), at_threshold.as_ref()].into_iter().flatten().map(|t| t.chars().count());
    let margin = margin.max().unwrap_or(0).max(1);
    let line_of_threshold = ((threshold / top) * SIZE.1 as f64).ceil() as usize;
    let mut text = format!("{}\n", unit(signal));
    for line in (1..=SIZE.1).rev() {
        let is_threshold = at_threshold.is_some() && line == line_of_threshold.max(1);
        let label = match (line == SIZE.1, is_threshold) {
            (true, _) => at_top.as_str(),
            (false, true) => at_threshold.as_deref().unwrap_or_default(),
            _ => "",
        };
        text += &format!("{label:>margin$} │");
        let row: String = heights
            .iter()
            .map(|height| {
                let eighths = (height / top * 8.0 * SIZE.1 as f64).round() as usize;
                match eighths.saturating_sub(8 * (line - 1)) {
                    0 if is_threshold => '┄',
                    0 => ' ',
                    filled => BLOCKS[filled.min(8) - 1],
                }
            })
            .collect();
        text += row.trim_end();
        text.push('\n');
    }
    text += &format!("{:>margin$} └{}\n", "0", "─".repeat(SIZE.0));
    let column = |range_m: f64| {
        let share = (range_m - window_m[0]) / (window_m[1] - window_m[0]);
        (0.0..=1.0).contains(&share).then(|| ((share * SIZE.0 as f64) as usize).min(SIZE.0 - 1))
    };
    let mut marks = vec![' '; SIZE.0];
    for (one, _) in &told.story.returns {
        if let Some(column) = column(one.range_m) {
            marks[column] = '▲';
        }
    }
    let marks: String = marks.into_iter().collect();
    if !marks.trim().is_empty() {
        text += &format!("{:margin$}  {}\n", "", marks.trim_end());
    }
    let [left, right] = window_m.map(|range_m| fixed(range_m, 2));
    let right = format!("{right} m");
    let gap = SIZE.0.saturating_sub(left.chars().count());
    text += &format!("{:margin$}  {left}{right:>gap$}\n", "");
    let mut legend = Vec::new();
    if at_threshold.is_some() {
        legend.push("┄ threshold");
    }
    if !marks.trim().is_empty() {
        legend.push("▲ return");
    }
    if !legend.is_empty() {
        text += &format!("{:margin$}  {}\n", "", legend.join("   "));
    }
    text
}

/// The largest height in each column.
fn heights(signal: &Signal, [from_m, to_m]: [f64; 2]) -> Vec<f64> {
    const SAMPLES: usize = 8;
    let width_m = (to_m - from_m) / SIZE.0 as f64;
    (0..SIZE.0)
        .map(|column| {
            let start_m = from_m + width_m * column as f64;
            let samples = (0..=SAMPLES).map(|i| start_m + width_m * i as f64 / SAMPLES as f64);
            // A peak may be narrower than the distance of two samples.
            let is_inside = |range_m: &f64| (start_m..start_m + width_m).contains(range_m);
            let peaks = signal.peaks.iter().map(|peak| peak.range_m).filter(is_inside);
            samples.chain(peaks).map(|range_m| signal.height(range_m)).fold(0.0, f64::max)
        })
        .collect()
}
