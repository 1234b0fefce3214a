//! The map of the ground that a rig sees, as a section of the page.

use std::fmt::Write as _;

use serde_json::json;

use super::html::{escape, script};
use super::pack;
use crate::check::phrasing::digits;
use crate::check::{GroundMap, axis};
use crate::source::words::counted;

/// Most cells that the page shows.
const MOST_CELLS: usize = 1_000_000;

/// The longer side of the map in the units of the drawing, and the space for numbers to its left and below it.
const SIDE: f64 = 1000.0;
const MARGIN: (f64, f64) = (110.0, 80.0);
const EDGE: f64 = 60.0;

/// The section of a map.
pub(super) fn section(id: &str, map: &GroundMap) -> String {
    let (nx, ny) = map.zone.cells();
    let start = format!("<section id=\"{id}\" class=\"ground\" aria-label=\"The ground that the rig sees\"");
    let title = "<h3>The ground that the rig sees</h3>";
    if nx * ny > MOST_CELLS {
        let said = "cells are too many for this page: check --coverage DIR draws them.";
        return format!("{start}>{title}<p class=\"hint\">{nx} × {ny} {said}</p></section>");
    }
    let (x, y) = (map.zone.x_m, map.zone.y_m);
    let (wide, high) = (y[1] - y[0], x[1] - x[0]);
    let scale = SIDE / wide.max(high);
    // A drawing is at least as wide as it is high, so that a narrow zone does not fill the page from top to bottom.
    let height = high * scale + MARGIN.1 + EDGE;
    let width = (wide * scale + MARGIN.0 + EDGE).max(height);
    let place = [
        100.0 * MARGIN.0 / width,
        100.0 * EDGE / height,
        100.0 * wide * scale / width,
        100.0 * high * scale / height,
    ];
    let words = format!(
        "{} % of {} of {} m have returns from the ground, at most {}",
        digits(100.0 * map.share()),
        counted(map.counts.len(), "cell"),
        map.zone.cell_m,
        counted(map.most() as usize, "return")
    );
    let data = json!({
        "rows": nx,
        "columns": ny,
        "most": map.most(),
        "place": place,
        "counts": pack::numbers("u32", &map.counts, 4, nx),
    });
    let outline = if map.outline.is_empty() { "" } else { "<span><i class=\"line\"></i>vehicle</span>" };
    format!(
        "{start} aria-busy=\"true\">{title}<figure><div class=\"plan waiting\"><canvas role=\"img\" aria-label=\"Map from above, \
         forward up: {words}.\"></canvas>{}</div><figcaption>From above, in the vehicle's frame: {words}.</figcaption></figure>\
         <div class=\"legend\"><span><i class=\"dot\"></i>sensor</span>{outline}</div>{}</section>",
        drawing(map, scale, (width, height)),
        script(&data)
    )
}

/// Axes, vehicle and sensors, to be drawn over the cells.
fn drawing(map: &GroundMap, scale: f64, (width, height): (f64, f64)) -> String {
    let (x, y) = (map.zone.x_m, map.zone.y_m);
    let across = |at: f64| MARGIN.0 + (y[1] - at) * scale;
    let down = |at: f64| EDGE + (x[1] - at) * scale;
    let (left, bottom) = (MARGIN.0, height - MARGIN.1);
    let mut svg = format!("<svg viewBox=\"0 0 {width:.0} {height:.0}\" aria-hidden=\"true\">");
    for (at, text) in axis(x, scale, |_| 100.0) {
        let to = down(at);
        let _ = write!(
            svg,
            "<path d=\"M{:.1} {to:.1}H{left:.1}\"/><text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{text}</text>",
            left - 10.0,
            left - 16.0,
            to + 9.0
        );
    }
    // A character of the narrow page's size is 20 units wide.
    for (at, text) in axis(y, scale, |text| 20.0 * text.len() as f64 + 24.0) {
        let to = across(at);
        let _ = write!(
            svg,
            "<path d=\"M{to:.1} {bottom:.1}v10\"/><text x=\"{to:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{text}</text>",
            bottom + 38.0
        );
    }
    let _ = write!(
        svg,
        "<text x=\"{left:.1}\" y=\"{:.1}\">y, m (left is positive)</text><text x=\"4\" y=\"28\">x, m (forward is up)</text>",
        bottom + 72.0
    );
    if !map.outline.is_empty() {
        let points = map.outline.iter().map(|[x, y]| format!("{:.1},{:.1}", across(*y), down(*x)));
        let points = points.collect::<Vec<_>>().join(" ");
        // A drawing in the drawing cuts off what is outside of the zone.
        let (wide, high) = ((y[1] - y[0]) * scale, (x[1] - x[0]) * scale);
        let _ = write!(
            svg,
            "<svg x=\"{left:.1}\" y=\"{EDGE:.1}\" width=\"{wide:.1}\" height=\"{high:.1}\" \
             viewBox=\"{left:.1} {EDGE:.1} {wide:.1} {high:.1}\"><polygon class=\"vehicle\" points=\"{points}\"/></svg>"
        );
    }
    let is_inside = |at: &[f64; 2]| (x[0]..=x[1]).contains(&at[0]) && (y[0]..=y[1]).contains(&at[1]);
    let mut sensors: Vec<_> = map.sensors.iter().filter(|(_, at)| is_inside(at)).collect();
    sensors.sort_by(|(_, a), (_, b)| b[0].total_cmp(&a[0]));
    // Names of sensors that are close together stand below each other.
    let mut free = f64::NEG_INFINITY;
    for (name, at) in sensors {
        let (cx, cy) = (across(at[1]), down(at[0]));
        let line = (cy + 9.0).max(free);
        free = line + 34.0;
        let _ = write!(
            svg,
            "<circle cx=\"{cx:.1}\" cy=\"{cy:.1}\" r=\"8\"/><text class=\"name\" x=\"{:.1}\" y=\"{line:.1}\">{}</text>",
            cx + 14.0,
            escape(name)
        );
    }
    svg + "</svg>"
}
