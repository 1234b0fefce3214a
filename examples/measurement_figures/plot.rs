//! A plot of curves and points as SVG.

use std::fmt::Write;

/// A plot.
pub struct Plot {
    pub title: &'static str,
    pub x: Axis,
    pub y: Axis,
    pub curves: Vec<Curve>,
}

/// An axis with its label, from one number to another.
pub struct Axis {
    pub label: &'static str,
    pub from: f64,
    pub to: f64,
}

/// Points of one kind.
pub struct Curve {
    pub label: &'static str,
    pub colour: &'static str,
    pub is_line: bool,
    pub points: Vec<(f64, f64)>,
}

const WIDTH: f64 = 560.0;
const HEIGHT: f64 = 340.0;
const LEFT: f64 = 62.0;
const RIGHT: f64 = 16.0;
const TOP: f64 = 34.0;
const BOTTOM: f64 = 48.0;

impl Plot {
    pub fn to_svg(&self) -> String {
        let x =
            |value: f64| LEFT + (value - self.x.from) / (self.x.to - self.x.from) * (WIDTH - LEFT - RIGHT);
        let y = |value: f64| {
            HEIGHT - BOTTOM - (value - self.y.from) / (self.y.to - self.y.from) * (HEIGHT - TOP - BOTTOM)
        };
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" width=\"{WIDTH}\" height=\"{HEIGHT}\" \
             font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n\
             <text x=\"{LEFT}\" y=\"20\" font-size=\"14\" font-weight=\"bold\">{}</text>\n",
            self.title
        );
        let mut add = |line: String| {
            svg += &line;
            svg.push('\n');
        };
        for step in 0..=5 {
            let share = f64::from(step) / 5.0;
            let (at_x, at_y) = (
                self.x.from + share * (self.x.to - self.x.from),
                self.y.from + share * (self.y.to - self.y.from),
            );
            add(format!(
                "<path d=\"M{:.1} {TOP}V{:.1}M{LEFT} {:.1}H{:.1}\" stroke=\"#ddd\" fill=\"none\"/>",
                x(at_x),
                HEIGHT - BOTTOM,
                y(at_y),
                WIDTH - RIGHT
            ));
            add(format!(
                "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
                x(at_x),
                HEIGHT - BOTTOM + 16.0,
                number(at_x)
            ));
            add(format!(
                "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                LEFT - 6.0,
                y(at_y) + 4.0,
                number(at_y)
            ));
        }
        add(format!(
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
            0.5 * (LEFT + WIDTH - RIGHT),
            HEIGHT - 10.0,
            self.x.label
        ));
        add(format!(
            "<text transform=\"translate(14 {:.1}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
            0.5 * (TOP + HEIGHT - BOTTOM),
            self.y.label
        ));
        for (index, curve) in self.curves.iter().enumerate() {
            let mut path = String::new();
            for &(at_x, at_y) in &curve.points {
                let (px, py) = (x(at_x), y(at_y.clamp(self.y.from, self.y.to)));
                if curve.is_line {
                    let _ = write!(path, "{}{px:.1} {py:.1}", if path.is_empty() { "M" } else { "L" });
                } else {
                    add(format!("<circle cx=\"{px:.1}\" cy=\"{py:.1}\" r=\"3\" fill=\"{}\"/>", curve.colour));
                }
            }
            if curve.is_line {
                add(format!(
                    "<path d=\"{path}\" stroke=\"{}\" stroke-width=\"1.5\" fill=\"none\"/>",
                    curve.colour
                ));
            }
            add(format!(
                "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\" fill=\"{}\">{}</text>",
                WIDTH - RIGHT - 6.0,
                TOP + 16.0 + 16.0 * index as f64,
                curve.colour,
                curve.label
            ));
        }
        svg + "</svg>\n"
    }
}

fn number(value: f64) -> String {
    let text = format!("{:.4}", value + 0.0);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
