//! Expectations: declarations of what a rig should see, and their evaluation.

use std::collections::{BTreeMap, BTreeSet};

use glam::DVec3;

use super::outcome::{ExpectationOutcome, Sight};
use super::phrasing::{counted, digits, list, metres};
use crate::angle::Angle;
use crate::output::SensorFrame;
use crate::scan::{Cause, Return};
use crate::scene::Scene;
use crate::sensor::{Pattern, Pulse};
use crate::source::suggest::{self, nearest, quoted};

/// One `[[expect]]` of a job.
#[derive(Clone, Debug, PartialEq)]
pub struct Expectation {
    /// The name, unique in the job.
    pub name: String,
    /// The sensor that the expectation concerns. It concerns all sensors together if absent.
    pub sensor: Option<String>,
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
    /// The number of rays a second that beamcast casts, as a budget of computing time.
    Speed {
        /// The least number of rays a second.
        at_least: f64,
    },
}

/// A target that beams should hit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Target {
    /// The name of an instance of the scene. A `*` at the end matches any continuation.
    pub object: Option<String>,
    /// A semantic label.
    pub label: Option<u32>,
}

/// Bounds from the least to the greatest value, both included. An absent bound is no limit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bounds {
    /// The least value.
    pub at_least: Option<f64>,
    /// The greatest value.
    pub at_most: Option<f64>,
}

/// The surfaces that count as ground: those near a height of the body's frame and, if a target is given, on that target.
#[derive(Clone, Debug, PartialEq)]
pub struct Ground {
    /// The height in metres.
    pub z_m: f64,
    /// The greatest distance of a point from that height, in metres.
    pub tolerance_m: f64,
    /// The target that is ground. By default it is any surface.
    pub target: Target,
}

impl Default for Ground {
    fn default() -> Self {
        Self { z_m: 0.0, tolerance_m: 0.2, target: Target::default() }
    }
}

/// A rectangle on the ground, in the body's frame, cut into square cells.
#[derive(Clone, Debug, PartialEq)]
pub struct Zone {
    /// The surfaces that count as ground.
    pub ground: Ground,
    /// The interval along x, in metres.
    pub x_m: [f64; 2],
    /// The interval along y, in metres.
    pub y_m: [f64; 2],
    /// The side of a cell, in metres.
    pub cell_m: f64,
}

/// The results of a run, against which expectations are evaluated.
#[derive(Clone, Copy, Debug)]
pub struct Seen<'a> {
    /// The scene that was scanned.
    pub scene: &'a Scene,
    /// What the labels of the scene stand for, in words.
    pub labels: &'a BTreeMap<u32, String>,
    /// The frame of each sensor.
    pub frames: &'a [SensorFrame<'a>],
    /// The number of rays that were cast a second, if it was measured.
    pub rays_per_s: Option<f64>,
}

/// The most names of objects that a message lists.
const MAX_LISTED: usize = 12;

impl Target {
    fn names(&self, name: &str) -> bool {
        self.object.as_ref().is_none_or(|object| match object.strip_suffix('*') {
            Some(start) => name.starts_with(start),
            None => name == object,
        })
    }

    /// Whether a surface of an object's name with a label is meant.
    pub(super) fn is_of(&self, name: &str, label: u32) -> bool {
        self.label.is_none_or(|own| own == label) && self.names(name)
    }

    fn is_hit(&self, hit: &Return, scene: &Scene) -> bool {
        self.label.is_none_or(|label| label == hit.label)
            && (self.object.is_none() || self.names(&scene.geometry.objects[hit.instance as usize].name))
    }

    /// The problem that the scene has nothing of the target's name, if that is so.
    fn missing(&self, scene: &Scene) -> Option<String> {
        let object = self.object.as_ref()?;
        if scene.geometry.objects.iter().any(|instance| self.names(&instance.name)) {
            return None;
        }
        let names: BTreeSet<&str> = scene
            .geometry
            .objects
            .iter()
            .map(|i| i.name.as_str())
            .filter(|n| !n.is_empty())
            .take(10_000)
            .collect();
        let help = match nearest(object, names.iter().copied()) {
            Some(near) => format!("; did you mean {}?", quoted(near)),
            None if names.len() <= MAX_LISTED => format!("; it has {}", suggest::list(names, "and")),
            None => String::new(),
        };
        Some(format!("the scene has no object {}{help}", quoted(object)))
    }
}

impl Target {
    /// The target in words: `"crate_3"`, `label 4 "pedestrian"`.
    fn words(&self, labels: &BTreeMap<u32, String>) -> String {
        let label = |label: u32| match labels.get(&label) {
            Some(name) => format!("label {label} {name:?}"),
            None => format!("label {label}"),
        };
        match (&self.object, self.label) {
            (Some(object), Some(number)) => format!("{object:?} with {}", label(number)),
            (Some(object), None) => format!("{object:?}"),
            (None, Some(number)) => label(number),
            (None, None) => "anything".to_owned(),
        }
    }
}

impl Bounds {
    /// Whether a value lies within the bounds.
    pub fn hold(&self, value: f64) -> bool {
        self.at_least.is_none_or(|least| value >= least) && self.at_most.is_none_or(|most| value <= most)
    }

    fn words(&self, shown: &dyn Fn(f64) -> String) -> String {
        match (self.at_least, self.at_most) {
            (Some(least), Some(most)) => format!("{} to {}", shown(least), shown(most)),
            (Some(least), None) => format!("at least {}", shown(least)),
            (None, Some(most)) => format!("at most {}", shown(most)),
            (None, None) => "any".to_owned(),
        }
    }
}

/// A return with its frame and its pixel.
struct Point<'a> {
    seen: &'a SensorFrame<'a>,
    row: usize,
    column: usize,
    hit: Return,
}

impl Point<'_> {
    fn pulse(&self) -> Pulse {
        let pulse = self.seen.capture.pulse(self.row, self.column);
        pulse.expect("what came back was sent")
    }

    fn in_body(&self) -> DVec3 {
        self.seen.capture.body_from_sensor.point(self.pulse().point(self.hit.range_m))
    }

    fn place(&self) -> String {
        format!("sensor {}, row {}, column {}", self.seen.name, self.row, self.column)
    }

    fn sight(&self) -> Sight {
        Sight::Frame {
            sensor: self.seen.name.to_owned(),
            channel: None,
            pixel: Some([self.row, self.column]),
        }
    }
}

/// The frame of a sensor, to look at a channel of it.
fn sight_of(sensor: &str, channel: Option<&'static str>) -> Sight {
    Sight::Frame { sensor: sensor.to_owned(), channel, pixel: None }
}

impl Expectation {
    /// Evaluates the expectation against the results of a run.
    pub fn examine(&self, seen: &Seen) -> ExpectationOutcome {
        let mut frames: Vec<SensorFrame> = seen.frames.to_vec();
        if let Some(sensor) = &self.sensor {
            frames.retain(|frame| frame.name == sensor);
        }
        let seen = Seen { frames: &frames, ..*seen };
        let (expected, verdict) = self.what.examine(&seen);
        let (met, found, place, sights) = match verdict {
            Finding::Measured { met, found, place, sights } => (met, found, place, sights),
            Finding::Nothing(problem) => (false, problem, String::new(), Vec::new()),
        };
        ExpectationOutcome { name: self.name.clone(), met, expected, found, place, sights, written_at: None }
    }
}

/// The result of measuring an expected property.
enum Finding {
    Measured {
        met: bool,
        found: String,
        place: String,
        sights: Vec<Sight>,
    },
    /// There is nothing to measure. The text says why.
    Nothing(String),
}

impl Finding {
    fn new(met: bool, found: impl Into<String>, place: impl Into<String>) -> Self {
        Self::Measured { met, found: found.into(), place: place.into(), sights: Vec::new() }
    }

    /// Adds what shows the finding.
    fn shown_by(mut self, shown: impl IntoIterator<Item = Sight>) -> Self {
        if let Self::Measured { sights, .. } = &mut self {
            sights.extend(shown);
        }
        self
    }
}

fn percent(share: f64) -> String {
    format!("{} %", digits(100.0 * share))
}

impl Expected {
    /// The problem that the scene has nothing of the name that the expectation is about, if that is so.
    pub fn missing(&self, scene: &Scene) -> Option<String> {
        match self {
            Self::Points { target, .. } | Self::Plane { target, .. } | Self::Resolution { target, .. } => {
                target
            }
            Self::Coverage { zone, .. } => &zone.ground.target,
            Self::BlindZone { ground, .. } => &ground.target,
            Self::Unobstructed { body, .. } => body,
            Self::Returns(_) | Self::PointsPerSecond(_) | Self::Speed { .. } => return None,
        }
        .missing(scene)
    }

    /// The expectation in words, and the finding.
    fn examine(&self, seen: &Seen) -> (String, Finding) {
        match self {
            Self::Points { target, count, range_m } => {
                let at = if *range_m == Bounds::default() {
                    String::new()
                } else {
                    format!(" at a range of {}", range_m.words(&metres))
                };
                let words = count.words(&|n| format!("{n}"));
                let noun = if words.ends_with(" 1") { "point" } else { "points" };
                (
                    format!("{words} {noun} on {}{at}", target.words(seen.labels)),
                    points(seen, target, count, range_m),
                )
            }
            Self::Plane { target, normal, offset_m, max_error_m } => (
                format!(
                    "{} within {} of the plane {normal}·p = {offset_m} m",
                    target.words(seen.labels),
                    metres(*max_error_m)
                ),
                plane(seen, target, *normal, *offset_m, *max_error_m),
            ),
            Self::Resolution { target, horizontal, vertical } => {
                let limit = |angle: &Option<Angle>, noun: &str| {
                    angle.map(|a| format!("{}° {noun}", digits(a.degrees())))
                };
                let limits = [limit(horizontal, "from column to column"), limit(vertical, "from row to row")];
                let limits: Vec<String> = limits.into_iter().flatten().collect();
                let words = format!("beams on {} at most {} apart", target.words(seen.labels), list(&limits));
                (words, resolution(seen, target, *horizontal, *vertical))
            }
            Self::Coverage { zone, at_least } => {
                let words = format!(
                    "ground seen in at least {} of the cells of {} m from ({}, {}) to ({}, {}) m",
                    percent(*at_least),
                    zone.cell_m,
                    zone.x_m[0],
                    zone.y_m[0],
                    zone.x_m[1],
                    zone.y_m[1]
                );
                (words, coverage(seen, zone, *at_least))
            }
            Self::BlindZone { ground, at_most_m, sector_deg } => {
                let words = format!("ground seen from a distance of {} on", metres(*at_most_m));
                (words, blind_zone(seen, ground, *at_most_m, *sector_deg))
            }
            Self::Returns(bounds) => {
                (format!("{} of the rays return", bounds.words(&percent)), returns(seen, bounds))
            }
            Self::Unobstructed { body, at_most } => {
                let words =
                    format!("at most {} of the rays hit {}", percent(*at_most), body.words(seen.labels));
                (words, unobstructed(seen, body, *at_most))
            }
            Self::PointsPerSecond(bounds) => {
                let words = bounds.words(&|n| format!("{n}"));
                (format!("{words} points a second"), points_per_second(seen, bounds))
            }
            Self::Speed { at_least } => {
                let words = format!("at least {at_least} rays cast a second");
                let verdict = match seen.rays_per_s {
                    Some(speed) => Finding::new(speed >= *at_least, format!("{speed:.0} rays a second"), ""),
                    None => Finding::Nothing("no speed was measured".to_owned()),
                };
                (words, verdict)
            }
        }
    }
}

/// The surfaces on a target that block beams of a frame nearer than the sensor's least range.
fn blockers_on<'a>(
    frame: &'a SensorFrame<'a>,
    scene: &'a Scene,
    target: &'a Target,
) -> impl Iterator<Item = Point<'a>> {
    let columns = frame.frame.columns();
    (0..frame.frame.pixels()).filter_map(move |pixel| {
        let hit = frame.frame.blocker(pixel).filter(|hit| target.is_hit(hit, scene))?;
        Some(Point { seen: frame, row: pixel / columns, column: pixel % columns, hit })
    })
}

/// The returns of all frames that lie on a target.
fn returns_on<'a>(seen: &'a Seen<'a>, target: &'a Target) -> impl Iterator<Item = Point<'a>> {
    seen.frames.iter().flat_map(move |frame| {
        let columns = frame.frame.columns();
        let on_target = frame.frame.iter().filter(|(_, hit)| target.is_hit(hit, seen.scene));
        on_target.map(move |(pixel, hit)| Point {
            seen: frame,
            row: pixel / columns,
            column: pixel % columns,
            hit,
        })
    })
}

fn points(seen: &Seen, target: &Target, count: &Bounds, range_m: &Bounds) -> Finding {
    if let Some(problem) = target.missing(seen.scene) {
        return Finding::Nothing(problem);
    }
    let mut by_sensor: BTreeMap<&str, (usize, f64, f64)> = BTreeMap::new();
    let (mut inside, mut outside) = (0, 0);
    for point in returns_on(seen, target) {
        if !range_m.hold(point.hit.range_m) {
            outside += 1;
            continue;
        }
        inside += 1;
        let (n, near, far) =
            by_sensor.entry(point.seen.name).or_insert((0, f64::INFINITY, f64::NEG_INFINITY));
        (*n, *near, *far) = (*n + 1, near.min(point.hit.range_m), far.max(point.hit.range_m));
    }
    let mut elsewhere =
        if outside > 0 { format!(", {} at other ranges", counted(outside, "point")) } else { String::new() };
    // Beams that the target blocks give no point. A person who looks for the points wants to know where they went.
    let blocked: usize = seen.frames.iter().map(|of| blockers_on(of, seen.scene, target).count()).sum();
    if blocked > 0 {
        elsewhere += &format!(", {} nearer than the sensor's least range", counted(blocked, "beam"));
    }
    let place = by_sensor.iter().map(|(name, (n, near, far))| {
        format!("sensor {name}: {} at {} to {}", counted(*n, "point"), metres(*near), metres(*far))
    });
    let place = list(&place.collect::<Vec<_>>());
    let looked = seen.frames.iter().map(|frame| frame.name);
    let sights = looked.filter(|name| inside == 0 || by_sensor.contains_key(name));
    let channel = if target.object.is_some() { "id.instance" } else { "id.semantic" };
    Finding::new(count.hold(inside as f64), format!("{}{elsewhere}", counted(inside, "point")), place)
        .shown_by(sights.map(|name| sight_of(name, Some(channel))))
}

fn plane(seen: &Seen, target: &Target, normal: DVec3, offset_m: f64, max_error_m: f64) -> Finding {
    if let Some(problem) = target.missing(seen.scene) {
        return Finding::Nothing(problem);
    }
    let mut worst: Option<(f64, Point)> = None;
    let (mut count, mut wrong) = (0, 0);
    for point in returns_on(seen, target) {
        let pulse = point.pulse();
        let world_from_sensor = point.seen.capture.world_from_sensor(pulse.time_s);
        let origin = world_from_sensor.point(pulse.origin);
        let direction = world_from_sensor.direction(pulse.direction);
        let ideal = (offset_m - normal.dot(origin)) / normal.dot(direction);
        // A ray parallel to the plane never meets it.
        let error = if ideal.is_finite() { pulse.along_m(point.hit.range_m) - ideal } else { f64::INFINITY };
        count += 1;
        wrong += usize::from(error.abs() > max_error_m);
        if worst.as_ref().is_none_or(|(e, _)| error.abs() > e.abs()) {
            worst = Some((error, point));
        }
    }
    match worst {
        None => Finding::Nothing(format!("no points on {}", target.words(seen.labels))),
        Some((error, point)) => {
            let found = format!(
                "{wrong} of {} are further off, the worst by {}",
                counted(count, "point"),
                metres(error)
            );
            Finding::new(wrong == 0, found, point.place()).shown_by([point.sight()])
        }
    }
}

/// The angle between unit vectors. It is accurate for small angles too.
fn angle_between(a: DVec3, b: DVec3) -> f64 {
    libm::atan2(a.cross(b).length(), a.dot(b))
}

fn resolution(seen: &Seen, target: &Target, horizontal: Option<Angle>, vertical: Option<Angle>) -> Finding {
    if let Some(problem) = target.missing(seen.scene) {
        return Finding::Nothing(problem);
    }
    let mut worst: [Option<(f64, String, Sight)>; 2] = [None, None];
    for point in returns_on(seen, target) {
        let SensorFrame { frame, capture, .. } = point.seen;
        let wraps = matches!(&capture.sensor.pattern, Pattern::Rotating(p) if p.is_full_turn());
        let next_column = match point.column + 1 {
            next if next < frame.columns() => Some(next),
            _ => wraps.then_some(0),
        };
        let neighbours = [
            next_column.map(|column| (point.row, column)),
            (point.row + 1 < frame.rows()).then_some((point.row + 1, point.column)),
        ];
        for (worst, neighbour) in worst.iter_mut().zip(neighbours) {
            let Some((row, column)) = neighbour else { continue };
            let is_hit = frame.get(row, column).is_some_and(|hit| target.is_hit(&hit, seen.scene));
            if let Some(pulse) = capture.pulse(row, column).filter(|_| is_hit) {
                let angle = angle_between(point.pulse().direction, pulse.direction);
                if worst.as_ref().is_none_or(|(a, ..)| angle > *a) {
                    *worst = Some((angle, point.place(), point.sight()));
                }
            }
        }
    }
    let (mut met, mut found, mut places, mut sights) = (true, Vec::new(), Vec::new(), Vec::new());
    let [columns, rows] = worst;
    for (limit, worst, noun) in [(horizontal, columns, "column"), (vertical, rows, "row")] {
        let Some(limit) = limit else { continue };
        match worst {
            None => {
                met = false;
                found.push(format!("no two neighbours from {noun} to {noun}"));
            }
            Some((angle, place, sight)) => {
                let fine = angle <= limit.radians() * (1.0 + 1e-9);
                met &= fine;
                found.push(format!("{}° from {noun} to {noun}", digits(Angle::rad(angle).degrees())));
                if !fine {
                    places.push(place);
                    sights.push(sight);
                }
            }
        }
    }
    Finding::new(met, list(&found), list(&places)).shown_by(sights)
}

impl Ground {
    /// Whether a point in the body's frame lies on the ground.
    fn has(&self, point: DVec3, hit: &Return, scene: &Scene) -> bool {
        (point.z - self.z_m).abs() <= self.tolerance_m && self.target.is_hit(hit, scene)
    }
}

impl Zone {
    /// The number of cells along x and along y.
    pub fn cells(&self) -> (usize, usize) {
        let along = |[from, to]: [f64; 2]| ((to - from) / self.cell_m - 1e-9).ceil().max(1.0) as usize;
        (along(self.x_m), along(self.y_m))
    }

    /// The centre of a cell.
    fn middle(&self, x: usize, y: usize) -> (f64, f64) {
        let at = |from: f64, i: usize| from + (i as f64 + 0.5) * self.cell_m;
        (at(self.x_m[0], x), at(self.y_m[0], y))
    }

    /// The number of returns from the ground in each cell. Cells are listed row by row: x varies fastest.
    pub fn count(&self, seen: &Seen) -> Vec<u32> {
        let (nx, ny) = self.cells();
        let mut counts = vec![0_u32; nx * ny];
        let anything = Target::default();
        for point in returns_on(seen, &anything) {
            let p = point.in_body();
            if !self.ground.has(p, &point.hit, seen.scene) {
                continue;
            }
            let x = ((p.x - self.x_m[0]) / self.cell_m).floor();
            let y = ((p.y - self.y_m[0]) / self.cell_m).floor();
            if (0.0..nx as f64).contains(&x) && (0.0..ny as f64).contains(&y) {
                let count = &mut counts[y as usize * nx + x as usize];
                *count = count.saturating_add(1);
            }
        }
        counts
    }
}

fn coverage(seen: &Seen, zone: &Zone, at_least: f64) -> Finding {
    if let Some(problem) = zone.ground.target.missing(seen.scene) {
        return Finding::Nothing(problem);
    }
    let counts = zone.count(seen);
    let (nx, _) = zone.cells();
    let hit = counts.iter().filter(|&&n| n > 0).count();
    let share = hit as f64 / counts.len() as f64;
    let distance = |index: usize| {
        let (x, y) = zone.middle(index % nx, index / nx);
        (x * x + y * y).sqrt()
    };
    let blind = (0..counts.len()).filter(|&i| counts[i] == 0);
    let nearest = blind.min_by(|&a, &b| distance(a).total_cmp(&distance(b)));
    let place = nearest.map_or_else(String::new, |index| {
        let (x, y) = zone.middle(index % nx, index / nx);
        format!("the nearest cell unseen is at ({x:.2}, {y:.2}) m")
    });
    Finding::new(share >= at_least, format!("{} of {} cells", percent(share), counts.len()), place)
        .shown_by([Sight::Ground])
}

fn blind_zone(seen: &Seen, ground: &Ground, at_most_m: f64, (from, to): (i32, i32)) -> Finding {
    if let Some(problem) = ground.target.missing(seen.scene) {
        return Finding::Nothing(problem);
    }
    let mut nearest = [f64::INFINITY; 360];
    let anything = Target::default();
    for point in returns_on(seen, &anything) {
        let p = point.in_body();
        if ground.has(p, &point.hit, seen.scene) {
            let degree = Angle::rad(libm::atan2(p.y, p.x)).degrees().floor() as i32;
            let nearest = &mut nearest[degree.rem_euclid(360) as usize];
            *nearest = nearest.min((p.x * p.x + p.y * p.y).sqrt());
        }
    }
    let looked_at = (from..to).map(|degree| (degree, nearest[degree.rem_euclid(360) as usize]));
    let worst = looked_at.clone().max_by(|a, b| a.1.total_cmp(&b.1));
    let Some((degree, distance)) = worst else { return Finding::Nothing("no azimuth to look at".to_owned()) };
    let blind = looked_at.filter(|(_, distance)| *distance > at_most_m).count();
    let found = if distance.is_finite() {
        format!("the ground begins at {}", metres(distance))
    } else {
        "no ground at all".to_owned()
    };
    let others =
        if blind > 1 { format!(", and {} further degrees that are blind", blind - 1) } else { String::new() };
    Finding::new(distance <= at_most_m, found, format!("azimuth {degree}° to {}°{others}", degree + 1))
        .shown_by([Sight::Ground])
}

/// The fraction of a sensor's rays that satisfies a condition, 0 to 1.
struct Share<'a> {
    share: f64,
    of: &'a SensorFrame<'a>,
}

impl Share<'_> {
    fn place(&self) -> String {
        format!("sensor {}", self.of.name)
    }

    fn sight(&self, channel: Option<&'static str>) -> Sight {
        sight_of(self.of.name, channel)
    }
}

/// The fraction of rays that is furthest outside of the bounds, over all sensors, since each must lie within them. `count`
/// counts the rays of a frame. `None` without a sensor.
fn furthest_outside<'a>(
    seen: &'a Seen,
    bounds: &Bounds,
    count: &dyn Fn(&'a SensorFrame<'a>) -> usize,
) -> Option<Share<'a>> {
    let off = |share: f64| {
        let under = bounds.at_least.map_or(f64::NEG_INFINITY, |least| least - share);
        under.max(bounds.at_most.map_or(f64::NEG_INFINITY, |most| share - most))
    };
    let shares =
        seen.frames.iter().map(|of| Share { share: count(of) as f64 / of.frame.pixels() as f64, of });
    shares.max_by(|a, b| off(a.share).total_cmp(&off(b.share)))
}

fn returns(seen: &Seen, bounds: &Bounds) -> Finding {
    match furthest_outside(seen, bounds, &|of| of.frame.first_returns().flatten().count()) {
        None => Finding::Nothing("no sensor".to_owned()),
        Some(worst) => {
            let frame = worst.of.frame;
            let blocked = frame.pixels_of(Cause::TooNear) as f64 / frame.pixels() as f64;
            let near = match blocked > 0.0 {
                true => format!(", {} are blocked nearer than the sensor's least range", percent(blocked)),
                false => String::new(),
            };
            let found = format!("{} of the rays return{near}", percent(worst.share));
            Finding::new(bounds.hold(worst.share), found, worst.place()).shown_by([worst.sight(None)])
        }
    }
}

fn unobstructed(seen: &Seen, body: &Target, at_most: f64) -> Finding {
    if let Some(problem) = body.missing(seen.scene) {
        return Finding::Nothing(problem);
    }
    let bounds = Bounds { at_least: None, at_most: Some(at_most) };
    let scene = seen.scene;
    let too_near = |of: &SensorFrame| blockers_on(of, scene, body).count();
    let returned =
        |of: &SensorFrame| of.frame.first_returns().flatten().filter(|hit| body.is_hit(hit, scene)).count();
    let Some(worst) = furthest_outside(seen, &bounds, &|of| returned(of) + too_near(of)) else {
        return Finding::Nothing("no sensor".to_owned());
    };
    // The intervals of azimuth and elevation in which the sensor that sees most of the body is obstructed.
    let mut spans = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
    let only = Seen { frames: std::slice::from_ref(worst.of), ..*seen };
    for point in returns_on(&only, body).chain(blockers_on(worst.of, scene, body)) {
        let d = point.pulse().direction;
        let angles = [libm::atan2(d.y, d.x), libm::asin(d.z.clamp(-1.0, 1.0))];
        for (span, angle) in spans.iter_mut().zip(angles) {
            let degrees = Angle::rad(angle).degrees();
            *span = [span[0].min(degrees), span[1].max(degrees)];
        }
    }
    let [azimuth, elevation] = spans;
    let directions = if azimuth[0] > azimuth[1] {
        String::new()
    } else {
        format!(
            ": azimuth {:.1}° to {:.1}°, elevation {:.1}° to {:.1}°",
            azimuth[0], azimuth[1], elevation[0], elevation[1]
        )
    };
    // What the sensor is too near to is not in its data, so it is said.
    let blocked = too_near(worst.of) as f64 / worst.of.frame.pixels() as f64;
    let near = if blocked > 0.0 {
        format!(", {} of the rays nearer than the sensor's least range", percent(blocked))
    } else {
        String::new()
    };
    let found = format!("{} of the rays hit it{near}", percent(worst.share));
    Finding::new(bounds.hold(worst.share), found, format!("{}{directions}", worst.place()))
        .shown_by([worst.sight(Some("id.instance"))])
}

fn points_per_second(seen: &Seen, bounds: &Bounds) -> Finding {
    let mut sum = 0.0;
    for frame in seen.frames {
        let Some(rate) = frame.capture.sensor.pattern.rate_hz() else {
            return Finding::Nothing(format!("sensor {} has no rate_hz", frame.name));
        };
        sum += frame.frame.return_count() as f64 * rate;
    }
    Finding::new(bounds.hold(sum), format!("{sum:.0} points a second"), "")
}
