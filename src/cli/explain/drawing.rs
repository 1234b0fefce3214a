//! The waveform of a pulse as a picture and as a table.

use std::fmt::Write as _;

use quick_xml::escape::escape;

use super::told::{Told, unit, unit_in_files, window_m};
use super::words::{fixed, significant, title};
use crate::scan::{Fate, Signal, SignalPeak};
use crate::source::words::printable;

/// The size of the picture, and the edges of the area that the waveform is drawn in: left, top, right and bottom.
const SIZE: (f64, f64) = (900.0, 420.0);
const AREA: [f64; 4] = [80.0, 56.0, 876.0, 356.0];

/// The number of samples of the curve, beside its peaks.
const SAMPLES: usize = 1200;

/// The waveform as a table: the range in metres and the height there.
pub fn csv(told: &Told, signal: &Signal) -> String {
    /// A table of more rows than this is no longer a table that people look at.
    const MOST_ROWS: f64 = 50_000.0;
    let [from_m, to_m] = window_m(told, signal);
    // A Gaussian between samples σ/20 apart is known to 3·10⁻⁴ of its height by a straight line.
    let steps = libm::ceil((to_m - from_m) / (0.05 * signal.sigma_m)).clamp(1.0, MOST_ROWS) as usize;
    let name = unit_in_files(signal);
    let mut table = format!("range_m,{name}\n");
    for step in 0..=steps {
        let range_m = from_m + (to_m - from_m) * step as f64 / steps as f64;
        let _ = writeln!(table, "{range_m:.5},{:.6e}", signal.height(range_m));
    }
    table
}

/// The waveform as a picture that needs no other file, with the threshold, the peaks and the returns.
pub fn svg(told: &Told, signal: &Signal) -> String {
    let window_m = window_m(told, signal);
    let curve = curve(signal, window_m);
    let threshold = signal.threshold.unwrap_or(0.0);
    let heights = curve.iter().map(|(_, height)| *height);
    let amplitudes = signal.peaks.iter().map(|peak| peak.height);
    let top = heights.chain(amplitudes).fold(threshold, f64::max).clamp(f64::MIN_POSITIVE, 1e300) * 1.06;
    let [left, upper, right, lower] = AREA;
    let x = |range_m: f64| left + (right - left) * (range_m - window_m[0]) / (window_m[1] - window_m[0]);
    let y = |height: f64| lower - (lower - upper) * (height / top).min(1.0);
    let mut svg = String::new();
    let mut add = |line: String| {
        svg += &line;
        svg.push('\n');
    };
    let (width, height) = SIZE;
    add(format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" \
         font-family=\"sans-serif\" font-size=\"13\">"
    ));
    let heading = escape(printable(&title(told))).into_owned();
    add(format!("<title>{heading}</title>"));
    add(format!("<rect width=\"{width}\" height=\"{height}\" fill=\"#ffffff\"/>"));
    add(format!("<text x=\"{left}\" y=\"24\" font-size=\"15\" fill=\"#222222\">{heading}</text>"));

    add("<g stroke=\"#e3e3e3\" fill=\"#444444\">".to_owned());
    for range_m in ticks(window_m) {
        let (x, label) = (x(range_m), tidy(range_m));
        add(format!("<line x1=\"{x:.2}\" y1=\"{upper}\" x2=\"{x:.2}\" y2=\"{lower}\"/>"));
        let y = lower + 20.0;
        add(format!("<text x=\"{x:.2}\" y=\"{y}\" text-anchor=\"middle\" stroke=\"none\">{label}</text>"));
    }
    for height in ticks([0.0, top]) {
        let (y, label) = (y(height), tidy(height));
        add(format!("<line x1=\"{left}\" y1=\"{y:.2}\" x2=\"{right}\" y2=\"{y:.2}\"/>"));
        let (x, y) = (left - 8.0, y + 4.5);
        add(format!("<text x=\"{x}\" y=\"{y:.2}\" text-anchor=\"end\" stroke=\"none\">{label}</text>"));
    }
    add("</g>".to_owned());
    let (middle_x, middle_y) = (0.5 * (left + right), 0.5 * (upper + lower));
    let below = lower + 44.0;
    add(format!(
        "<text x=\"{middle_x}\" y=\"{below}\" text-anchor=\"middle\" fill=\"#222222\">range in metres</text>"
    ));
    add(format!(
        "<text x=\"20\" y=\"{middle_y}\" text-anchor=\"middle\" fill=\"#222222\" transform=\"rotate(-90 20 {middle_y})\">{}</text>",
        unit(signal)
    ));

    let points: Vec<String> =
        curve.iter().map(|&(range_m, height)| format!("{:.2},{:.2}", x(range_m), y(height))).collect();
    let points = points.join(" ");
    add(format!(
        "<polygon points=\"{left},{lower} {points} {right},{lower}\" fill=\"#1f77b4\" fill-opacity=\"0.15\"/>"
    ));
    add(format!("<polyline points=\"{points}\" fill=\"none\" stroke=\"#1f77b4\" stroke-width=\"1.5\"/>"));
    if signal.threshold.is_some() {
        let y = y(threshold);
        add(format!(
            "<line x1=\"{left}\" y1=\"{y:.2}\" x2=\"{right}\" y2=\"{y:.2}\" stroke=\"#d62728\" stroke-dasharray=\"6 4\"/>"
        ));
        let (x, y, threshold) = (right - 4.0, y - 5.0, significant(threshold));
        add(format!(
            "<text x=\"{x}\" y=\"{y:.2}\" text-anchor=\"end\" fill=\"#d62728\">threshold {threshold}</text>"
        ));
    }
    for (number, (one, _)) in told.story.returns.iter().enumerate() {
        let x = x(one.range_m).clamp(left, right);
        add(format!(
            "<line x1=\"{x:.2}\" y1=\"{upper}\" x2=\"{x:.2}\" y2=\"{lower}\" stroke=\"#2ca02c\" stroke-dasharray=\"2 3\"/>"
        ));
        let (anchor, label_x) = if x > middle_x { ("end", x - 5.0) } else { ("start", x + 5.0) };
        // Returns may be close together.
        let (y, range_m) = (upper + 12.0 + 16.0 * number as f64, fixed(one.range_m, 3));
        add(format!(
            "<text x=\"{label_x:.2}\" y=\"{y}\" text-anchor=\"{anchor}\" fill=\"#2ca02c\">return at {range_m} m</text>"
        ));
    }
    for peak in &signal.peaks {
        let (x, y) = (x(peak.range_m), y(peak.height));
        let fill = if matches!(peak.fate, Fate::Returned(_)) { "#2ca02c" } else { "#ffffff" };
        let about = about(peak);
        add(format!(
            "<circle cx=\"{x:.2}\" cy=\"{y:.2}\" r=\"4\" fill=\"{fill}\" stroke=\"#222222\"><title>{about}</title></circle>"
        ));
    }
    add(format!(
        "<polyline points=\"{left},{upper} {left},{lower} {right},{lower}\" fill=\"none\" stroke=\"#222222\"/>"
    ));
    add("</svg>".to_owned());
    svg
}

/// The text of a peak under the pointer.
fn about(peak: &SignalPeak) -> String {
    let fate = match peak.fate {
        Fate::Returned(number) => format!("return {}", number + 1),
        Fate::NotChosen => "not reported".to_owned(),
        Fate::Lost(cause) => cause.name().to_owned(),
    };
    format!("{} m, height {}: {fate}", fixed(peak.range_m, 3), significant(peak.height))
}

/// The points of the curve: range and height.
fn curve(signal: &Signal, [from_m, to_m]: [f64; 2]) -> Vec<(f64, f64)> {
    let at = |i: usize| from_m + (to_m - from_m) * i as f64 / SAMPLES as f64;
    let mut ranges: Vec<f64> =
        (0..=SAMPLES).map(at).chain(signal.peaks.iter().map(|peak| peak.range_m)).collect();
    ranges.sort_by(f64::total_cmp);
    ranges.into_iter().map(|range_m| (range_m, signal.height(range_m))).collect()
}

/// Round numbers between two others: 1, 2 or 5 times a power of ten apart, so that there are 4 to 10.
fn ticks([from, to]: [f64; 2]) -> Vec<f64> {
    let span = to - from;
    let power = libm::pow(10.0, libm::floor(libm::log10(span / 4.0)));
    let step = [5.0, 2.0, 1.0].map(|digit| digit * power).into_iter().find(|step| span / step >= 4.0);
    let step = step.unwrap_or(power);
    let first = libm::ceil(from / step);
    (0..=16).map(|i| (first + f64::from(i)) * step).take_while(|tick| *tick <= to).collect()
}

/// A round number without the digits that adding up left.
fn tidy(tick: f64) -> String {
    let rounded = (tick * 1e9).round() / 1e9;
    match rounded.abs() {
        size if size >= 1e6 => format!("{tick:.0e}"),
        size if size == 0.0 && tick != 0.0 => format!("{tick:.0e}"),
        _ => format!("{rounded}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_some() {
        assert_eq!(ticks([0.0, 10.0]), [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]);
        assert_eq!(
            ticks([11.3, 12.9]).iter().map(|t| tidy(*t)).collect::<Vec<_>>(),
            ["11.4", "11.6", "11.8", "12", "12.2", "12.4", "12.6", "12.8"]
        );
        for span in [1e-12, 0.37, 4.0, 3.999, 1e9, 1e299] {
            assert!((4..=11).contains(&ticks([0.0, span]).len()), "{span}");
        }
    }
}
