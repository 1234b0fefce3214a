//! Hesai: the formula of HesaiLidar_SDK_2.0 for a channel of a turning head.

use glam::DVec3;

use super::{Beams, Errors, Truth, sin_cos_deg};

/// The preset holds the numbers of the files exactly. The optical centre of JT16, turned, is rounded to a tenth of a micrometre.
const ALLOWED: Errors = Errors { angle_deg: 1e-9, time_ns: 1e-3, place_mm: 1e-3 };

/// Where a model's ranges begin, in the frame of its head: to the right, ahead and above, in metres.
#[derive(Clone, Copy)]
enum Ranges {
    /// From the head's centre, though the light leaves at this optical centre.
    FromCentre([f64; 3]),
    /// From the optical centre, which is given where the rotor's azimuth is so many degrees.
    FromOpticalCentre([f64; 3], f64),
}

use Ranges::{FromCentre, FromOpticalCentre};

/// The preset, its mode, what is nominal, and its ranges.
type Model = (&'static str, Option<&'static str>, &'static str, Ranges);

const UNIT: &str = "the unit's own angles, columns";

const MODELS: [Model; 13] = [
    ("hesai/jt128", None, "optical centre, range, columns", FromOpticalCentre([0.0, 0.0, 0.0], 0.0)),
    (
        "hesai/jt16",
        None,
        "firing times, range, columns",
        FromOpticalCentre([-0.00625, 0.010955, 0.003911], 190.0),
    ),
    ("hesai/ot128", None, UNIT, FromCentre([-0.01, 0.045, 0.0])),
    ("hesai/ot128", Some("high_resolution"), UNIT, FromCentre([-0.01, 0.045, 0.0])),
    ("hesai/pandar128", None, "times of near targets; columns", FromCentre([-0.012, 0.04356, 0.0])),
    (
        "hesai/pandar128",
        Some("high_resolution"),
        "times of near targets; columns",
        FromCentre([-0.012, 0.04356, 0.0]),
    ),
    ("hesai/pandar40p", None, UNIT, FromCentre([-0.012, 0.03873, 0.0])),
    ("hesai/pandar64", None, UNIT, FromCentre([-0.012, 0.03873, 0.0])),
    ("hesai/qt128", None, UNIT, FromCentre([0.0072, 0.0354, 0.0])),
    ("hesai/qt64", None, UNIT, FromCentre([-0.0072, 0.0298, 0.0])),
    ("hesai/xt-16", None, UNIT, FromCentre([-0.013, 0.0315, 0.0])),
    ("hesai/xt-32", None, UNIT, FromCentre([-0.013, 0.0315, 0.0])),
    ("hesai/xt32m2x", None, "one unit's angles, columns", FromCentre([-0.013, 0.0305, 0.0])),
];

/// In the head's frame, with x to the right and y ahead, a channel looks along u = (cos ε·sin c, cos ε·cos c, sin ε), where c is
/// its azimuth correction. The point lies at o + s·u for the optical centre o, where s is the range, or solves |o + s·u| = range:
/// s = √(B² / 4 − C) − B / 2 with B = 2·o·u and C = |o|² − range² (`GetDistanceCorrection`). Then the head is turned to its
/// azimuth when the channel fires, clockwise from the y axis, which is the sensor's x axis.
pub fn truths() -> Vec<Truth> {
    let truth = |(preset, mode, nominal, ranges): Model| {
        let beams = Beams { preset, mode, elevations: "elevation_deg", ring_of: &|_, channel| channel };
        beams.truth("HesaiLidar_SDK_2.0", nominal, ALLOWED, &|row, azimuth_deg| {
            let (sin_el, cos_el) = sin_cos_deg(row("elevation_deg"));
            let at = match ranges {
                FromCentre(_) => 0.0,
                FromOpticalCentre(_, at) => at,
            };
            let (sin, cos) = sin_cos_deg(row("azimuth_deg") - at);
            let u = DVec3::new(cos_el * sin, cos_el * cos, sin_el);
            let (sin_head, cos_head) = sin_cos_deg(azimuth_deg + at);
            Box::new(move |range| {
                let p = match ranges {
                    FromCentre(o) => {
                        let o = DVec3::from_array(o);
                        let (b, c) = (2.0 * o.dot(u), o.length_squared() - range * range);
                        o + u * ((b * b / 4.0 - c).sqrt() - b / 2.0)
                    }
                    FromOpticalCentre(o, _) => DVec3::from_array(o) + u * range,
                };
                let (right, ahead) = (p.x * cos_head + p.y * sin_head, p.y * cos_head - p.x * sin_head);
                DVec3::new(ahead, -right, p.z)
            })
        })
    };
    MODELS.map(truth).into()
}
