//! The returns that lie on a target: the number of points, their distances from a plane, the angles between beams.

use std::collections::BTreeMap;

use glam::DVec3;

use super::bounds::Bounds;
use super::finding::Finding;
use super::seen::{Point, Seen, blockers_on, returns_on, sight_of};
use super::target::Target;
use crate::angle::Angle;
use crate::check::outcome::Sight;
use crate::check::phrasing::{digits, metres};
use crate::output::SensorFrame;
use crate::sensor::Pattern;
use crate::source::words::{counted, joined};

pub(super) fn points(seen: &Seen, target: &Target, count: &Bounds, range_m: &Bounds) -> Finding {
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
    let place = joined(&place.collect::<Vec<_>>(), "and");
    let sights = seen.frames.iter().filter(|frame| inside == 0 || by_sensor.contains_key(frame.name));
    let channel = if target.object.is_some() { "id.instance" } else { "id.semantic" };
    Finding::new(count.hold(inside as f64), format!("{}{elsewhere}", counted(inside, "point")), place)
        .shown_by(sights.map(|frame| sight_of(frame, Some(channel))))
}

pub(super) fn plane(seen: &Seen, target: &Target, normal: DVec3, offset_m: f64, max_error_m: f64) -> Finding {
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

pub(super) fn resolution(
    seen: &Seen,
    target: &Target,
    horizontal: Option<Angle>,
    vertical: Option<Angle>,
) -> Finding {
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
    Finding::new(met, joined(&found, "and"), joined(&places, "and")).shown_by(sights)
}
