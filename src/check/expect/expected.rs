//! The declarations of `[[expect]]`: in words, and examined.

use glam::DVec3;

use super::bounds::Bounds;
use super::finding::Finding;
use super::ground::{self, Ground, Zone};
use super::seen::Seen;
use super::tally::{Concluded, Demand, Tally};
use super::target::Target;
use super::{causes, points, shares};
use crate::angle::Angle;
use crate::check::outcome::ExpectationOutcome;
use crate::check::phrasing::{digits, metres, percent};
use crate::output::SensorFrame;
use crate::scan::Cause;
use crate::scene::Scene;
use crate::source::words::joined;

/// One `[[expect]]` of a job.
#[derive(Clone, Debug, PartialEq)]
pub struct Expectation {
    /// The name, unique in the job.
    pub name: String,
    /// The sensor that the expectation concerns. It concerns all sensors together if absent.
    pub sensor: Option<String>,
    /// The frames in which it must be met.
    pub demand: Demand,
    /// The expected property.
    pub what: Expected,
}

/// An expected property of the frames.
#[derive(Clone, Debug, PartialEq)]
pub enum Expected {
    /// A number of points on a target.
    Points {
        /// The target that the points should be on.
        target: Target,
        /// The bounds of the number of points.
        count: Bounds,
        /// The bounds of the range in metres. Only points at these ranges count.
        range_m: Bounds,
    },
    /// The error of ranges against a plane n·p = offset in the world. The error is the range minus the range of the plane
    /// along the ray.
    Plane {
        /// The points that should be on the plane.
        target: Target,
        /// The normal n, of length 1.
        normal: DVec3,
        /// The offset in metres.
        offset_m: f64,
        /// The greatest error, in metres.
        max_error_m: f64,
    },
    /// The greatest angle between neighbouring beams that both hit a target.
    Resolution {
        /// The target that the beams should hit.
        target: Target,
        /// The greatest angle from column to column.
        horizontal: Option<Angle>,
        /// The greatest angle from row to row.
        vertical: Option<Angle>,
    },
    /// The fraction of a zone's cells in which the ground is hit.
    Coverage {
        /// The zone.
        zone: Zone,
        /// The least fraction, 0 to 1.
        at_least: f64,
    },
    /// The distance from the body's origin, in the xy plane, within which at least one degree of azimuth sees no ground.
    BlindZone {
        /// The surfaces that count as ground.
        ground: Ground,
        /// The greatest distance in metres.
        at_most_m: f64,
        /// The sector of azimuths that are examined, from the first counter-clockwise to the second, in whole degrees.
        sector_deg: (i32, i32),
    },
    /// The fraction of each sensor's rays that return, 0 to 1.
    Returns(Bounds),
    /// The fraction of each sensor's rays that hit the vehicle itself, 0 to 1. A ray that the vehicle blocks nearer than the
    /// sensor's least range hits it too.
    Unobstructed {
        /// The vehicle.
        body: Target,
        /// The greatest fraction.
        at_most: f64,
    },
    /// The number of returns a second, of all sensors together.
    PointsPerSecond(Bounds),
    /// The fraction of the pulses at a target that it returns, 0 to 1, of all sensors together. The pulses at a target are those of
    /// the pixels that have a return from it in an ideal scan of the same capture: from the first surface on the sensor's own rays,
    /// within its limits. Such a pulse counts as returned if one of its returns is from the target, and by the direct way: its
    /// cause is [`Cause::Surface`], [`Cause::Mixed`] or [`Cause::Glass`].
    Detection {
        /// The target that the pulses meet.
        target: Target,
        /// The bounds of the fraction.
        share: Bounds,
    },
    /// The number of returns of a frame that no light of the sensor makes, of each sensor: those whose cause is
    /// [`Cause::FalseAlarm`] or [`Cause::Interference`].
    FalseAlarms {
        /// The greatest number.
        at_most: f64,
    },
    /// The fraction of each sensor's returns that have a cause, 0 to 1. The returns of ideal sensors are from surfaces.
    CauseShare {
        /// The cause.
        cause: Cause,
        /// The bounds of the fraction.
        share: Bounds,
    },
    /// The number of rays a second that beamcast casts, as a budget of computing time.
    Speed {
        /// The least number of rays a second.
        at_least: f64,
    },
}

impl Expectation {
    /// Examines frames of one moment: of its sensor, or of all sensors. `frame` is their number, and `start_s` the time at which
    /// they start. Returns whether this is the first frame in which the expectation is not met.
    pub fn examine(&self, seen: &Seen, frame: u64, start_s: f64, tally: &mut Tally) -> bool {
        let mut frames: Vec<SensorFrame> = seen.frames.to_vec();
        if let Some(sensor) = &self.sensor {
            frames.retain(|frame| frame.name == sensor);
        }
        tally.add(frame, start_s, self.what.examine(&Seen { frames: &frames, ..*seen }))
    }

    /// The outcome over all frames that were examined, of which each sensor has only one unless this is a sequence. `seen` is the
    /// run, without its frames.
    pub fn conclude(&self, mut tally: Tally, seen: &Seen, is_sequence: bool) -> ExpectationOutcome {
        // The speed is that of the run, and no frame's.
        let is_sequence = is_sequence && !self.is_of_run();
        if self.is_of_run() {
            tally.add(0, 0.0, self.what.examine(seen));
        }
        let Concluded { met, expected, found, place, sights, counts } =
            tally.conclude(self.what.words(seen), &self.demand, is_sequence);
        let name = self.name.clone();
        ExpectationOutcome { name, met, expected, found, place, sights, counts, written_at: None }
    }

    /// Whether the expectation is about the run as a whole, and looks at no frame.
    pub fn is_of_run(&self) -> bool {
        matches!(self.what, Expected::Speed { .. })
    }
}

impl Expected {
    /// The problem that the scene has nothing of the name or of the label that the expectation is about, if that is so.
    pub fn missing(&self, scene: &Scene) -> Option<String> {
        let target = match self {
            Self::Points { target, .. }
            | Self::Plane { target, .. }
            | Self::Resolution { target, .. }
            | Self::Detection { target, .. } => target,
            Self::Coverage { zone, .. } => &zone.ground.target,
            Self::BlindZone { ground, .. } => &ground.target,
            Self::Unobstructed { body, .. } => body,
            Self::Returns(_)
            | Self::PointsPerSecond(_)
            | Self::FalseAlarms { .. }
            | Self::CauseShare { .. }
            | Self::Speed { .. } => return None,
        };
        target.missing(scene).or_else(|| target.missing_label(scene))
    }

    /// The expectation in words.
    fn words(&self, seen: &Seen) -> String {
        match self {
            Self::Points { target, count, range_m } => {
                let at = if *range_m == Bounds::default() {
                    String::new()
                } else {
                    format!(" at a range of {}", range_m.words(&metres))
                };
                let words = count.words(&|n| format!("{n}"));
                let noun = if words.ends_with(" 1") { "point" } else { "points" };
                format!("{words} {noun} on {}{at}", target.words(seen.labels))
            }
            Self::Plane { target, normal, offset_m, max_error_m } => format!(
                "{} within {} of the plane {normal}·p = {offset_m} m",
                target.words(seen.labels),
                metres(*max_error_m)
            ),
            Self::Resolution { target, horizontal, vertical } => {
                let limit = |angle: &Option<Angle>, noun: &str| {
                    angle.map(|a| format!("{}° {noun}", digits(a.degrees())))
                };
                let limits = [limit(horizontal, "from column to column"), limit(vertical, "from row to row")];
                let limits: Vec<String> = limits.into_iter().flatten().collect();
                format!("beams on {} at most {} apart", target.words(seen.labels), joined(&limits, "and"))
            }
            Self::Coverage { zone, at_least } => format!(
                "ground seen in at least {} of the cells of {} m from ({}, {}) to ({}, {}) m",
                percent(*at_least),
                zone.cell_m,
                zone.x_m[0],
                zone.y_m[0],
                zone.x_m[1],
                zone.y_m[1]
            ),
            Self::BlindZone { at_most_m, .. } => {
                format!("ground seen from a distance of {} on", metres(*at_most_m))
            }
            Self::Returns(bounds) => format!("{} of the rays return", bounds.words(&percent)),
            Self::Unobstructed { body, at_most } => {
                format!("at most {} of the rays hit {}", percent(*at_most), body.words(seen.labels))
            }
            Self::PointsPerSecond(bounds) => {
                format!("{} points a second", bounds.words(&|n| format!("{n}")))
            }
            Self::Detection { target, share } => {
                let target = target.words(seen.labels);
                format!("{} of the pulses at {target} return from it", share.words(&percent))
            }
            Self::FalseAlarms { at_most } => {
                let noun = if *at_most == 1.0 { "return" } else { "returns" };
                format!("at most {at_most} {noun} of false alarms and interference in a frame")
            }
            Self::CauseShare { cause, share } => {
                format!("{} of the returns have the cause {}", share.words(&percent), cause.name())
            }
            Self::Speed { at_least } => format!("at least {at_least} rays cast a second"),
        }
    }

    /// The finding in frames of one moment.
    fn examine(&self, seen: &Seen) -> Finding {
        match self {
            Self::Points { target, count, range_m } => points::points(seen, target, count, range_m),
            Self::Plane { target, normal, offset_m, max_error_m } => {
                points::plane(seen, target, *normal, *offset_m, *max_error_m)
            }
            Self::Resolution { target, horizontal, vertical } => {
                points::resolution(seen, target, *horizontal, *vertical)
            }
            Self::Coverage { zone, at_least } => ground::coverage(seen, zone, *at_least),
            Self::BlindZone { ground, at_most_m, sector_deg } => {
                ground::blind_zone(seen, ground, *at_most_m, *sector_deg)
            }
            Self::Returns(bounds) => shares::returns(seen, bounds),
            Self::Unobstructed { body, at_most } => shares::unobstructed(seen, body, *at_most),
            Self::PointsPerSecond(bounds) => shares::points_per_second(seen, bounds),
            Self::Detection { target, share } => causes::detection(seen, target, share),
            Self::FalseAlarms { at_most } => causes::false_alarms(seen, *at_most),
            Self::CauseShare { cause, share } => causes::share(seen, *cause, share),
            Self::Speed { at_least } => match seen.rays_per_s {
                Some(speed) => Finding::new(speed >= *at_least, format!("{speed:.0} rays a second"), ""),
                None => Finding::Nothing("no speed was measured".to_owned()),
            },
        }
    }
}
