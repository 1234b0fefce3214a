//! The quality of depth cameras' depth, as `beamcast selftest --datasheet` prints it.

use std::fmt::Write as _;

use serde_json::{Value, json};

use crate::selftest::quality::{FRAMES, Judged, Outcome, QualityReport, REFLECTANCE, WallQuality};
use crate::sensor::{Published, Quantity, StatedAt};

/// The table of a report, the promises and the verdict.
pub(super) fn text(report: &QualityReport) -> String {
    let wall = match report.is_textured {
        true => "walls with a random pattern".to_owned(),
        false => format!("walls of {} %", 100.0 * REFLECTANCE),
    };
    let mut text = format!(
        "  {wall} without sunlight, the middle 40 % of the image's width and height, {FRAMES} frames\n"
    );
    let _ = writeln!(
        text,
        "  {:>7} {:>7} {:>10} {:>10} {:>9} {:>9} {:>9} {:>9} {:>9}   by the keys:",
        "at", "fill", "Z accuracy", "plane RMS", "", "sub-pixel", "disparity", "bias", "σ"
    );
    let _ = writeln!(
        text,
        "  {:>7} {:>7} {:>10} {:>10} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9}",
        "m", "%", "%", "mm", "%", "RMS, px", "RMS, px", "mm", "mm", "σ, mm", "px"
    );
    for wall in &report.walls {
        let target = wall.quality.target;
        let mm = |metres: Option<f64>| cell(metres.map(|m| 1e3 * m), 2);
        let _ = writeln!(
            text,
            "  {:>7} {:>7} {:>10} {:>10} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9}",
            wall.distance_m,
            cell(Some(wall.quality.fill_percent), 2),
            cell(target.and_then(|t| t.z_accuracy_percent), 3),
            mm(target.map(|t| t.plane_rms_m)),
            cell(target.map(|t| t.plane_rms_percent), 3),
            cell(target.and_then(|t| t.subpixel_rms_px), 4),
            cell(target.and_then(|t| t.disparity_rms_px), 4),
            mm(wall.bias_m),
            mm(wall.sigma_m),
            mm(wall.expected_sigma_m),
            cell(wall.expected_disparity_px, 4),
        );
    }
    for judged in &report.published {
        let _ = writeln!(text, "  published: {}: {}", promise(&judged.published), verdict(judged));
    }
    text += if report.passed() {
        if report.published.is_empty() {
            "  measured; no data sheet's bound is known\n"
        } else {
            "  passed\n"
        }
    } else if report.published.iter().any(|judged| judged.outcome.is_kept() == Some(false)) {
        "  FAILED\n"
    } else {
        "  FAILED: nothing was measured\n"
    };
    text
}

fn cell(value: Option<f64>, decimals: usize) -> String {
    // A mean of 0 has a sign by chance.
    value.map_or_else(
        || "-".to_owned(),
        |value| format!("{:.decimals$}", if value == 0.0 { 0.0 } else { value }),
    )
}

/// A promise in words.
fn promise(published: &Published) -> String {
    let at = match published.at {
        StatedAt::At(distance_m) => format!("at {distance_m} m"),
        StatedAt::UpTo(end_m) => format!("up to {end_m} m"),
        StatedAt::All => "at every distance".to_owned(),
    };
    let bound = with_unit(published.quantity, published.bound);
    let name = match published.quantity {
        Quantity::ZAccuracy => "Z accuracy",
        Quantity::FillRate => "fill rate",
        Quantity::PlaneRms => "plane-fit RMS",
        Quantity::SubpixelRms => "sub-pixel RMS",
        Quantity::Sigma => "σ of depth",
        Quantity::Bias => "bias",
    };
    let least = if published.quantity == Quantity::FillRate { "least" } else { "most" };
    let share = match published.share_of_distance {
        0.0 => String::new(),
        share => format!(" and {} % of the distance", tidy(100.0 * share)),
    };
    format!("{name} at {least} {bound}{share} {at}")
}

fn verdict(judged: &Judged) -> String {
    let quantity = judged.published.quantity;
    match judged.outcome {
        Outcome::OutOfRange => "not judged: the camera does not measure there".to_owned(),
        Outcome::NoDisparities => "not judged: the camera has no disparities".to_owned(),
        Outcome::Judged { distance_m, found: None, .. } => {
            format!("there is no depth at {distance_m} m: WRONG")
        }
        Outcome::Judged { distance_m, found: Some(found), limit, is_kept } => {
            let worst = if matches!(judged.published.at, StatedAt::At(_)) { "" } else { "at worst " };
            let (found, limit) = (with_unit(quantity, found), with_unit(quantity, limit));
            let wrong = if is_kept { String::new() } else { ": WRONG".to_owned() };
            format!("{worst}{found} at {distance_m} m, where the bound is {limit}{wrong}")
        }
    }
}

/// A value of a quantity in the unit that people use.
fn with_unit(quantity: Quantity, value: f64) -> String {
    match quantity {
        Quantity::ZAccuracy | Quantity::FillRate | Quantity::PlaneRms => {
            format!("{} %", (value * 1e3).round() / 1e3)
        }
        Quantity::SubpixelRms => format!("{} px", (value * 1e4).round() / 1e4),
        Quantity::Sigma | Quantity::Bias => format!("{} mm", (value * 1e5).round() / 1e2),
    }
}

/// A number without digits that floating point made.
fn tidy(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}

/// The name in reports.
fn name(quantity: Quantity) -> &'static str {
    match quantity {
        Quantity::ZAccuracy => "z_accuracy_percent",
        Quantity::FillRate => "fill_rate_percent",
        Quantity::PlaneRms => "plane_rms_percent",
        Quantity::SubpixelRms => "subpixel_rms_px",
        Quantity::Sigma => "sigma_m",
        Quantity::Bias => "bias_m",
    }
}

/// The walls of a report.
pub(super) fn walls_as_json(report: &QualityReport) -> Vec<Value> {
    report.walls.iter().map(|wall| wall_as_json(wall, report.is_textured)).collect()
}

fn wall_as_json(wall: &WallQuality, is_textured: bool) -> Value {
    let target = wall.quality.target;
    json!({
        "distance_m": wall.distance_m,
        "is_textured": is_textured,
        "frames": FRAMES,
        "pixels": wall.pixels,
        "fill_rate_percent": wall.quality.fill_percent,
        "z_accuracy_percent": target.and_then(|t| t.z_accuracy_percent),
        "plane_rms_m": target.map(|t| t.plane_rms_m),
        "plane_rms_percent": target.map(|t| t.plane_rms_percent),
        "subpixel_rms_px": target.and_then(|t| t.subpixel_rms_px),
        "disparity_rms_px": target.and_then(|t| t.disparity_rms_px),
        "bias_m": wall.bias_m,
        "sigma_m": wall.sigma_m,
        "expected_sigma_m": wall.expected_sigma_m,
        "expected_disparity_px": wall.expected_disparity_px,
    })
}

/// The promises of a report.
pub(super) fn published_as_json(report: &QualityReport) -> Vec<Value> {
    report.published.iter().map(judged_as_json).collect()
}

fn judged_as_json(Judged { published, outcome }: &Judged) -> Value {
    let (at_m, up_to_m) = match published.at {
        StatedAt::At(distance_m) => (Some(distance_m), None),
        StatedAt::UpTo(end_m) => (None, Some(end_m)),
        StatedAt::All => (None, None),
    };
    let (distance_m, found, limit) = match *outcome {
        Outcome::Judged { distance_m, found, limit, .. } => (Some(distance_m), found, Some(limit)),
        Outcome::OutOfRange | Outcome::NoDisparities => (None, None, None),
    };
    let left_out = match outcome {
        Outcome::Judged { .. } => None,
        Outcome::OutOfRange => Some("out_of_range"),
        Outcome::NoDisparities => Some("no_disparities"),
    };
    json!({
        "figure": name(published.quantity),
        "at_m": at_m,
        "up_to_m": up_to_m,
        "distance_m": distance_m,
        "found": found,
        "bound": limit,
        "agrees": outcome.is_kept(),
        "left_out": left_out,
    })
}
