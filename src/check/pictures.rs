//! Pictures of the ground that a rig covers, and of the differences between images.

use super::compare::ChannelDifference;
use super::expect::{Seen, Zone};
use super::vehicle::Vehicle;
use crate::output::{
    self, Entry, Image, LINE_COLOUR, NO_RETURN_COLOUR, Picture, Rgb, Samples, TEXT_COLOUR, round_step,
    text_width, ticks, with_legend,
};
use crate::source::words::counted;

/// The ground that a rig sees, in the body's frame.
#[derive(Clone, Debug)]
pub struct GroundMap {
    /// The part of the ground that the map shows.
    pub zone: Zone,
    /// The returns from the ground in each cell of the zone: x varies fastest.
    pub counts: Vec<u32>,
    /// The name, x and y of each sensor.
    pub sensors: Vec<(String, [f64; 2])>,
    /// The outline of the vehicle seen from above, if it is known.
    pub outline: Vec<[f64; 2]>,
}

/// The colours of sensors and of the vehicle's outline on a map.
const SENSOR: Rgb = [0xff, 0x30, 0x60];
const VEHICLE: Rgb = [0xff, 0xff, 0xff];

impl GroundMap {
    /// The colour of a cell that no beam hits.
    pub const UNSEEN: Rgb = [0x2a, 0x2a, 0x32];

    /// The map of a zone of which nothing is seen yet.
    pub fn empty(zone: Zone, vehicle: Option<&Vehicle>) -> Self {
        let (nx, ny) = zone.cells();
        Self {
            counts: vec![0; nx * ny],
            zone,
            sensors: Vec::new(),
            outline: vehicle.map_or(Vec::new(), Vehicle::outline),
        }
    }

    /// Adds what frames see of the zone, which goes with the vehicle.
    pub fn add(&mut self, seen: &Seen) {
        for (sum, count) in self.counts.iter_mut().zip(self.zone.count(seen)) {
            *sum = sum.saturating_add(count);
        }
        for frame in seen.frames {
            let at = frame.capture.body_from_sensor.translation;
            if !self.sensors.iter().any(|(name, _)| name == frame.name) {
                self.sensors.push((frame.name.to_owned(), [at.x, at.y]));
            }
        }
    }

    /// The most returns that a cell has; at least 1.
    pub fn most(&self) -> u32 {
        self.counts.iter().copied().max().unwrap_or(0).max(1)
    }

    /// The part of the cells that are seen, 0 to 1.
    pub fn share(&self) -> f64 {
        self.counts.iter().filter(|count| **count > 0).count() as f64 / self.counts.len().max(1) as f64
    }

    /// The colour of a part of the scale, 0 for one return to 1 for the most.
    pub fn colour(part: f64) -> Rgb {
        let colour = colorous::VIRIDIS.eval_continuous(0.15 + 0.85 * part);
        [colour.r, colour.g, colour.b]
    }

    /// The map from above, with forward (+x) up. A cell is brighter the more returns it has (logarithmic). Numbers at the sides
    /// are metres, and there is a legend.
    pub fn picture(&self, title: &str) -> Picture {
        let (nx, ny) = self.zone.cells();
        // The map has at least 400 pixels on its longer side, so that a person recognises the cells.
        let scale = (400 / nx.max(ny)).max(1);
        let (width, height) = (ny * scale, nx * scale);
        let log_most = libm::log(f64::from(self.most()));
        let part = |count: u32| if log_most > 0.0 { libm::log(f64::from(count)) / log_most } else { 1.0 };
        let pixels_a_m = scale as f64 / self.zone.cell_m;
        let across = |y: f64| ((self.zone.y_m[1] - y) * pixels_a_m).round() as i64;
        let down = |x: f64| ((self.zone.x_m[1] - x) * pixels_a_m).round() as i64;
        // Nothing outside of the zone is drawn, not even a part of the vehicle.
        let mut map = Picture::new(width, height, Self::UNSEEN);
        for row in 0..nx {
            for column in 0..ny {
                // +x is up and +y is left.
                let count = self.counts[(ny - 1 - column) * nx + (nx - 1 - row)];
                if count > 0 {
                    let corner = ((column * scale) as i64, (row * scale) as i64);
                    map.fill(corner, (scale, scale), Self::colour(part(count)));
                }
            }
        }
        for (a, b) in self.outline.iter().zip(self.outline.iter().cycle().skip(1)) {
            map.line((across(a[1]), down(a[0])), (across(b[1]), down(b[0])), VEHICLE);
        }
        for (_, [x, y]) in &self.sensors {
            map.fill((across(*y) - 2, down(*x) - 2), (5, 5), SENSOR);
        }
        let (left, top) = (56, 24);
        let mut picture = Picture::new(width + left + 24, height + top + 36, NO_RETURN_COLOUR);
        picture.paste((left, top), &map);
        let (left, top, bottom) = (left as i64, top as i64, (top + height) as i64);
        for (x, text) in axis(self.zone.x_m, pixels_a_m, |_| 40.0) {
            let at = top + down(x);
            picture.line((left - 5, at), (left - 1, at), LINE_COLOUR);
            picture.text((left - 8 - text_width(&text, 1) as i64, at - 4), &text, 1, TEXT_COLOUR);
        }
        for (y, text) in axis(self.zone.y_m, pixels_a_m, |text| text_width(text, 1) as f64 + 8.0) {
            let at = left + across(y);
            picture.line((at, bottom), (at, bottom + 4), LINE_COLOUR);
            picture.text((at - text_width(&text, 1) as i64 / 2, bottom + 8), &text, 1, TEXT_COLOUR);
        }
        picture.text((left, bottom + 24), "y, m", 1, TEXT_COLOUR);
        picture.text((left - 8 - text_width("x, m", 1) as i64, 4), "x, m", 1, TEXT_COLOUR);
        let mut entries = vec![
            Entry::Ramp {
                name: "returns a cell".to_owned(),
                ticks: ticks(1.0, f64::from(self.most()), true, 6),
                colour: &Self::colour,
            },
            Entry::Swatch(Self::UNSEEN, "ground not seen".to_owned()),
            Entry::Swatch(SENSOR, counted(self.sensors.len(), "sensor")),
        ];
        if !self.outline.is_empty() {
            entries.push(Entry::Swatch(VEHICLE, "vehicle".to_owned()));
        }
        entries.push(Entry::Note(format!(
            "cells of {} m; {:.0} % of them seen; the body's frame, x up is forward, y left",
            self.zone.cell_m,
            100.0 * self.share()
        )));
        with_legend(picture, title, &entries)
    }
}

/// Round numbers for an axis with `scale` units of a drawing for a metre, as close as the texts fit that need `room` units each.
pub fn axis(range: [f64; 2], scale: f64, room: impl Fn(&str) -> f64) -> Vec<(f64, String)> {
    let mut step = round_step(room("") / scale);
    loop {
        let numbers: Vec<_> = multiples(range, step).into_iter().map(|at| (at, number(at))).collect();
        // The step grows faster than the texts become longer.
        if numbers.iter().all(|(_, text)| room(text) <= step * scale * (1.0 + 1e-9)) {
            return numbers;
        }
        step = round_step(1.5 * step);
    }
}

/// The multiples of a step in a range.
fn multiples([low, high]: [f64; 2], step: f64) -> Vec<f64> {
    const MOST: i64 = 200;
    let (first, last) = ((low / step - 1e-9).ceil() as i64, (high / step + 1e-9).floor() as i64);
    (first..=last.min(first.saturating_add(MOST))).map(|i| i as f64 * step).collect()
}

/// A number of metres without rounding noise.
fn number(value: f64) -> String {
    let rounded = (value * 1e6).round() / 1e6;
    (rounded + 0.0).to_string()
}

/// The colours of differences between a first and a second image.
pub mod colours {
    use crate::output::Rgb;

    /// A value that is the same.
    pub const SAME: Rgb = [0x4a, 0x4a, 0x52];
    /// A value that is far less in the second image.
    pub const LESS: Rgb = [0x4c, 0x9b, 0xff];
    /// A value that is far more in the second image, or an id that is another.
    pub const MORE: Rgb = [0xff, 0x8c, 0x2e];
    /// A return that only the first image has.
    pub const VANISHED: Rgb = [0x2f, 0xe0, 0xd8];
    /// A return that only the second image has.
    pub const APPEARED: Rgb = [0xff, 0x4f, 0xd0];
}

/// The largest difference that the colours tell apart, of absolute differences that are not 0: the 99th percentile, so that a few
/// outliers do not hide the rest, and at most three times the median. 0 if there are none.
pub fn difference_scale(mut differences: Vec<f64>) -> f64 {
    differences.retain(|d| *d > 0.0 && d.is_finite());
    if differences.is_empty() {
        return 0.0;
    }
    let last = differences.len() - 1;
    let mut quantile = |percent: usize| {
        *differences.select_nth_unstable_by((last * percent).div_ceil(100), f64::total_cmp).1
    };
    quantile(99).min(3.0 * quantile(50))
}

/// The colour of a difference on a scale whose ends are ± `scale`. The least difference is told apart from none.
pub fn difference_colour(difference: f64, scale: f64) -> Rgb {
    if difference == 0.0 {
        return colours::SAME;
    }
    let part = if scale > 0.0 { (difference.abs() / scale).min(1.0) } else { 1.0 };
    let to = if difference < 0.0 { colours::LESS } else { colours::MORE };
    let mix = |k: usize| {
        let (from, to) = (f64::from(colours::SAME[k]), f64::from(to[k]));
        (from + (to - from) * (0.25 + 0.75 * part)).round() as u8
    };
    [mix(0), mix(1), mix(2)]
}

/// The differences of a channel between images of the same size, with a legend: blue where the second image has less, orange where
/// it has more. `None` if an image lacks the channel.
pub fn difference_picture(
    title: &str,
    first: &Image,
    second: &Image,
    found: &ChannelDifference,
) -> Option<Picture> {
    let masks = [first.mask(), second.mask()];
    let (a, b) = (first.channel(&found.channel)?, second.channel(&found.channel)?);
    let are_ids = matches!((a, b), (Samples::U32(_), Samples::U32(_)));
    let difference = |index: usize| b.get(index) - a.get(index);
    let both = (0..second.pixels()).filter(|&i| masks[0][i] && masks[1][i]);
    let scale = if are_ids { 0.0 } else { difference_scale(both.map(|i| difference(i).abs()).collect()) };
    let colour = |index: usize| match (masks[0][index], masks[1][index]) {
        (false, true) => colours::APPEARED,
        (true, false) => colours::VANISHED,
        (false, false) => NO_RETURN_COLOUR,
        (true, true) if are_ids => difference_colour(difference(index).abs(), 0.0),
        (true, true) => difference_colour(difference(index), scale),
    };
    // The image of a LiDAR is a narrow stripe, so its rows are repeated until it is a quarter as tall as wide.
    let repeat = (second.columns / (4 * second.rows)).clamp(1, 16);
    let mut pixels = Vec::with_capacity(3 * second.pixels() * repeat);
    for row in 0..second.rows {
        let line: Vec<u8> =
            (0..second.columns).flat_map(|column| colour(row * second.columns + column)).collect();
        for _ in 0..repeat {
            pixels.extend(&line);
        }
    }
    let picture = Picture { width: second.columns, height: second.rows * repeat, pixels };
    let unit = output::channel(&found.channel).map_or("", |spec| spec.unit);
    let comma = if unit.is_empty() { "" } else { ", " };
    let ramp_colour = |part: f64| difference_colour((2.0 * part - 1.0) * scale, scale);
    let mut entries = Vec::new();
    if are_ids {
        entries.push(Entry::Swatch(colours::MORE, "another".to_owned()));
    } else if scale > 0.0 {
        entries.push(Entry::Ramp {
            name: format!("second minus first{comma}{unit}"),
            ticks: ticks(-scale, scale, false, 5),
            colour: &ramp_colour,
        });
    }
    entries.extend([
        Entry::Swatch(colours::SAME, "the same".to_owned()),
        Entry::Swatch(colours::APPEARED, "appeared".to_owned()),
        Entry::Swatch(colours::VANISHED, "vanished".to_owned()),
        Entry::Swatch(NO_RETURN_COLOUR, "no return in either".to_owned()),
    ]);
    let largest = found.statistics.map_or(0.0, |s| s.max);
    if scale > 0.0 && largest > scale {
        let words = super::phrasing::digits(largest);
        entries.push(Entry::Note(format!("beyond the scale up to {words} {unit}").trim_end().to_owned()));
    }
    Some(with_legend(picture, &format!("{title}{}", found.channel), &entries))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::Channel;

    #[test]
    fn outliers_do_not_flatten_a_change_of_all_pixels() {
        let alike = vec![0.05; 1000];
        assert_eq!(difference_scale(alike.clone()), 0.05);
        // One pixel in twenty sees past an edge.
        let with_edges = alike.into_iter().chain([30.0; 50]).collect();
        assert!((difference_scale(with_edges) - 0.15).abs() < 1e-9);
        assert_eq!(difference_scale(vec![0.0, f64::INFINITY, f64::NAN]), 0.0);
        // A change of 50 mm is clearly another colour than no change, less or more.
        let far = |a: Rgb, b: Rgb| (0..3).map(|k| a[k].abs_diff(b[k])).max().unwrap();
        for d in [0.05, -0.05] {
            assert!(far(difference_colour(d, 0.15), colours::SAME) > 70);
        }
        assert_eq!(difference_colour(-30.0, 0.15), colours::LESS);
    }

    #[test]
    fn a_picture_of_differences_has_the_colours_of_its_legend() {
        let image = |range: [f32; 4]| Image {
            rows: 2,
            columns: 2,
            channels: vec![Channel { name: "range".into(), samples: Samples::F32(range.to_vec()) }],
        };
        let inf = f32::INFINITY;
        let (a, b) = (image([1.0, 2.0, inf, 4.0]), image([1.0, 2.5, 3.0, inf]));
        let found = ChannelDifference { channel: "range".to_owned(), ..ChannelDifference::default() };
        let picture = difference_picture("top: ", &a, &b, &found).unwrap();
        let top = 24; // the title's height
        let at = |x: usize, y: usize| &picture.pixels[3 * ((top + y) * picture.width + x)..][..3];
        assert_eq!([at(0, 0), at(1, 0)], [colours::SAME, colours::MORE]);
        assert_eq!([at(0, 1), at(1, 1)], [colours::APPEARED, colours::VANISHED]);
        let none = ChannelDifference { channel: "Z".to_owned(), ..ChannelDifference::default() };
        assert_eq!(difference_picture("", &a, &b, &none), None);
    }

    #[test]
    fn a_map_has_forward_up_and_left_left() {
        let zone = Zone { ground: Default::default(), x_m: [0.0, 2.0], y_m: [0.0, 2.0], cell_m: 1.0 };
        // Only the cell at x = 1.5, y = 0.5 is seen: up and right.
        let map = GroundMap { zone, counts: vec![0, 3, 0, 0], sensors: vec![], outline: vec![] };
        let picture = map.picture("map");
        let at = |x: usize, y: usize| {
            let pixel = 3 * ((24 + 24 + y) * picture.width + 56 + x);
            picture.pixels[pixel..pixel + 3].to_vec()
        };
        assert_eq!(at(300, 100), GroundMap::colour(1.0));
        assert_eq!([at(100, 100), at(100, 300), at(300, 300)], [GroundMap::UNSEEN; 3]);
        assert_eq!(map.share(), 0.25);
        // A vehicle that is larger than the zone is not drawn over the numbers at its sides.
        let far = [[-0.1, -0.1], [-0.1, 2.1], [2.1, 2.1], [2.1, -0.1]];
        let with_vehicle = GroundMap { outline: far.to_vec(), ..map.clone() }.picture("map");
        let rows = |picture: &Picture| picture.pixels[..3 * picture.width * 440].to_vec();
        assert_eq!(with_vehicle.width, picture.width);
        assert_eq!(rows(&with_vehicle), rows(&picture));
        assert_eq!(multiples([-1.0, 1.0], 0.5), [-1.0, -0.5, 0.0, 0.5, 1.0]);
        assert_eq!(number(0.1 + 0.2), "0.3");
    }

    #[test]
    fn numbers_at_an_axis_are_as_close_as_they_fit() {
        let words = |range, scale: f64| -> Vec<String> {
            axis(range, scale, |text| 8.0 * text.len() as f64 + 8.0)
                .into_iter()
                .map(|(_, text)| text)
                .collect()
        };
        assert_eq!(words([-4.0, 4.0], 12.0), ["-4", "-2", "0", "2", "4"]);
        assert_eq!(words([-1.0, 1.0], 100.0), ["-1", "-0.5", "0", "0.5", "1"]);
        assert_eq!(words([-0.2, 0.2], 1.0), ["0"]);
        assert_eq!(words([1000.0, 1100.0], 0.5), ["1000", "1100"]);
        assert_eq!(words([0.1, 0.2], 1.0), Vec::<String>::new());
    }
}
