//! The ground that is seen: the cells of a zone, and the blind zone around the vehicle.

use glam::DVec3;

use super::finding::Finding;
use super::seen::{Seen, returns_on};
use super::target::Target;
use crate::angle::Angle;
use crate::check::outcome::Sight;
use crate::check::phrasing::{metres, percent};
use crate::scan::Return;
use crate::scene::Scene;

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

pub(super) fn coverage(seen: &Seen, zone: &Zone, at_least: f64) -> Finding {
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

pub(super) fn blind_zone(seen: &Seen, ground: &Ground, at_most_m: f64, (from, to): (i32, i32)) -> Finding {
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
