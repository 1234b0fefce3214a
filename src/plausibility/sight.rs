//! Sensors that stand inside, below or far outside of things, or that look at nothing.

use glam::DVec3;

use super::stance::looks;
use crate::config::MountedSensor;
use crate::motion::Trajectory;
use crate::scene::{Extent, Scene};
use crate::sensor::{Capture, Sensor};
use crate::source::Doubt;
use crate::trace::{Cast, Hit, Origins, Rays};

/// Oddities of where a sensor stands and looks at the start of its first frame.
pub(super) fn doubts(
    mounted: &MountedSensor,
    trajectory: &Trajectory,
    scene: &Scene,
    extent: Extent,
    tracer: &impl Cast,
) -> Vec<Doubt> {
    let MountedSensor { sensor, body_from_sensor, .. } = mounted;
    let capture = Capture::new(sensor, *body_from_sensor, trajectory, 0, 0);
    let origin = capture.world_from_sensor(0.0).translation;
    if !origin.is_finite() || extent.iter().flatten().any(|side| !side.is_finite()) {
        return Vec::new();
    }
    if let Some(doubt) = far_outside(origin, sensor, extent) {
        return vec![doubt];
    }
    let place = below(origin, scene, extent, tracer).or_else(|| inside(origin, scene, extent, tracer));
    place.into_iter().chain(sees_nothing(&capture, scene, tracer)).collect()
}

/// How many times the scene's diagonal a sensor may be away from it: from there, the scene is 6 degrees wide.
const FARTHEST: f64 = 10.0;

/// The same where the position would be right in another unit.
const FARTHEST_OF_A_UNIT: f64 = 2.0;

fn far_outside(origin: DVec3, sensor: &Sensor, extent: Extent) -> Option<Doubt> {
    let [low, high] = [0, 1].map(|end| DVec3::from_array(extent.map(|axis| axis[end])));
    let apart = (low - origin).max(origin - high).max(DVec3::ZERO);
    let (distance, diagonal) = (apart.length(), (high - low).length().max(1.0));
    let fits = |divisor: f64| {
        let (p, margin) = (origin / divisor, DVec3::splat(0.5));
        p.cmpge(low - margin).all() && p.cmple(high + margin).all()
    };
    let unit =
        [("centimetres", 100.0), ("millimetres", 1000.0)].into_iter().find(|(_, divisor)| fits(*divisor));
    let limit = if unit.is_some() { FARTHEST_OF_A_UNIT } else { FARTHEST };
    let is_out_of_reach = distance > sensor.range.max_m;
    if !is_out_of_reach && distance <= limit * diagonal {
        return None;
    }
    let side = match () {
        () if apart.z > 0.7 * distance && origin.z > high.z => "above",
        () if apart.z > 0.7 * distance => "below",
        () => "outside",
    };
    let message =
        format!("the sensor stands {distance:.0} m {side} the scene, which is {diagonal:.0} m across");
    let doubt = Doubt::new("far-outside", "pose", message);
    Some(match unit {
        Some((unit, divisor)) if distance > diagonal => doubt
            .label(format!("is this in {unit}?"))
            .help(format!("if it is, divide the position by {divisor}")),
        _ if is_out_of_reach => {
            doubt.help(format!("it sees {} m far: its `range.max_m`", sensor.range.max_m))
        }
        _ => doubt,
    })
}

/// A sensor with nothing under it, and above it the back of a surface or the scene as a whole.
fn below(origin: DVec3, scene: &Scene, extent: Extent, tracer: &impl Cast) -> Option<Doubt> {
    let mut hits = [None; 2];
    let directions = [DVec3::NEG_Z, DVec3::Z];
    tracer.cast(&Rays::unlimited(Origins::Common(origin), &directions), &mut hits);
    let [None, Some(above)] = hits else { return None };
    let is_below_all = origin.z < extent[2][0];
    if !is_below_all && above.normal.z <= 0.0 {
        return None;
    }
    let name = name_of(&above, scene);
    let message = format!("the sensor stands {:.2} m below {name}, and there is nothing under it", above.t);
    let help = if is_below_all { "everything in the scene is above it: z points up" } else { "z points up" };
    Some(Doubt::new("below-floor", "pose", message).label("below the floor?").help(help))
}

/// The directions that decide whether a point is inside something: tilted, so that they miss edges between axes.
fn around() -> Vec<DVec3> {
    let mut directions = Vec::new();
    for (x, y, z) in [
        (1.0, 0.11, 0.07),
        (-1.0, 0.09, -0.06),
        (0.08, 1.0, 0.05),
        (-0.07, -1.0, 0.09),
        (0.06, -0.05, 1.0),
        (-0.09, 0.07, -1.0),
        (1.0, 0.93, 0.88),
        (1.0, 0.91, -0.95),
        (1.0, -0.97, 0.9),
        (1.0, -0.89, -0.92),
        (-1.0, 0.94, 0.96),
        (-1.0, 0.92, -0.87),
        (-1.0, -0.95, 0.91),
        (-1.0, -0.9, -0.93),
    ] {
        directions.push(DVec3::new(x, y, z).normalize());
    }
    directions
}

/// How many of the directions must meet the back of the same object. A mesh that was made by hand has holes.
const MOST_OF_AROUND: usize = 12;

/// A sensor that sees the back of one object all around. An object as large as the scene is a room, in which sensors stand.
fn inside(origin: DVec3, scene: &Scene, extent: Extent, tracer: &impl Cast) -> Option<Doubt> {
    let directions = around();
    let mut hits = vec![None; directions.len()];
    tracer.cast(&Rays::unlimited(Origins::Common(origin), &directions), &mut hits);
    let from_behind =
        |(hit, direction): (Option<Hit>, &DVec3)| hit.filter(|hit| hit.normal.dot(*direction) > 0.0);
    let behind: Vec<Hit> = hits.into_iter().zip(&directions).filter_map(from_behind).collect();
    if behind.len() < MOST_OF_AROUND {
        return None;
    }
    let object = |hit: &Hit| scene.surface(hit.placement, hit.triangle).object;
    let most =
        behind.iter().max_by_key(|hit| behind.iter().filter(|other| object(other) == object(hit)).count())?;
    if behind.iter().filter(|hit| object(hit) == object(most)).count() < MOST_OF_AROUND - 2 {
        return None;
    }
    // A room's walls may face outward, and it reaches about as far as the scene does.
    let reach = object_extent(scene, object(most));
    let is_room = reach.is_some_and(|reach| {
        let covers = |axis: usize| {
            let (own, all) = (reach[axis][1] - reach[axis][0], extent[axis][1] - extent[axis][0]);
            own >= 0.8 * all
        };
        covers(0) && covers(1)
    });
    if is_room {
        return None;
    }
    let message = format!("the sensor stands inside {}", name_of(most, scene));
    Some(
        Doubt::new("inside-object", "pose", message)
            .label("its beams end on the inside")
            .help("move the sensor out of it, or take the object out of the scene"),
    )
}

/// The least and the largest coordinates of an object's vertices in the world.
fn object_extent(scene: &Scene, object: u32) -> Option<Extent> {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for (placement, triangles) in scene.triangles_of(|surface| surface.object == object) {
        let mesh = scene.mesh(placement.mesh);
        for &vertex in mesh.triangles[triangles].iter().flatten() {
            let p = DVec3::from_array(mesh.positions[vertex as usize].map(f64::from));
            let p = placement.scene_from_mesh().transform_point3(p) + scene.geometry.centre;
            (low, high) = (low.min(p), high.max(p));
        }
    }
    low.is_finite().then(|| [0, 1, 2].map(|axis| [low[axis], high[axis]]))
}

/// The rays that a sensor's frame is tried with, and those that decide if none of them returns.
const FEW_RAYS: usize = 256;
const MANY_RAYS: usize = 1 << 14;

/// A sensor of which no ray returns, as far as rays that are spread over its frame can tell.
fn sees_nothing(capture: &Capture, scene: &Scene, tracer: &impl Cast) -> Option<Doubt> {
    let range = capture.sensor.range;
    let mut nearest = [f64::INFINITY; 2];
    for count in [FEW_RAYS, MANY_RAYS] {
        let pulses = spread_over(capture, count);
        if pulses.is_empty() {
            return None;
        }
        let (origins, directions): (Vec<DVec3>, Vec<DVec3>) = pulses.into_iter().unzip();
        let mut hits = vec![None; directions.len()];
        let rays = Rays::unlimited(Origins::Each(&origins), &directions);
        tracer.cast(&rays, &mut hits);
        if hits.iter().flatten().any(|hit| hit.t >= range.min_m && hit.t <= range.max_m) {
            return None;
        }
        if scene.is_see_through() {
            // The first surface may be a hole or a pane, behind which there is something within the range.
            let mut blocked = vec![false; directions.len()];
            tracer.blocked(&Rays { t_min: range.min_m, t_max: range.max_m, ..rays }, &mut blocked);
            if blocked.contains(&true) {
                return None;
            }
        }
        let depths = |of: &dyn Fn(f64) -> bool| {
            hits.iter().flatten().map(|hit| hit.t).filter(|t| of(*t)).fold(f64::INFINITY, f64::min)
        };
        nearest = [depths(&|t| t < range.min_m), depths(&|t| t > range.max_m)];
    }
    let looks = looks(&capture.world_from_sensor(0.0));
    let [too_near, too_far] = nearest;
    let message = match () {
        () if too_far.is_finite() => {
            format!(
                "the sensor sees nothing within its range: the nearest surface in sight is {too_far:.1} m away"
            )
        }
        () if too_near.is_finite() => "the sensor sees only what is nearer than its range begins".to_owned(),
        () => "the sensor looks away from everything".to_owned(),
    };
    let help = match () {
        () if too_far.is_finite() => format!("it looks {looks}, and its range ends at {} m", range.max_m),
        () if too_near.is_finite() => format!("it looks {looks}, and its range begins at {} m", range.min_m),
        () => format!("it looks {looks}; yaw turns to the left, a positive pitch looks down"),
    };
    Some(Doubt::new("sees-nothing", "pose", message).help(help))
}

/// The origins and directions in the world of at most about `count` pulses, spread over the rows and columns of a frame.
fn spread_over(capture: &Capture, count: usize) -> Vec<(DVec3, DVec3)> {
    let (rows, columns) = (capture.rows(), capture.columns());
    // As many rows as columns, or all rows of a sensor that has few.
    let rows_asked = rows.min((count as f64).sqrt() as usize).max(1);
    let columns_asked = columns.min(count / rows_asked).max(1);
    let rows_asked = rows.min(count / columns_asked).max(1);
    let at = |index: usize, asked: usize, all: usize| (2 * index + 1) * all / (2 * asked);
    let mut pulses = Vec::with_capacity(rows_asked * columns_asked);
    for row in 0..rows_asked {
        for column in 0..columns_asked {
            let pulse = capture.pulse(at(row, rows_asked, rows), at(column, columns_asked, columns));
            pulses.extend(pulse.map(|pulse| {
                let pose = capture.world_from_sensor(pulse.time_s);
                (pose.point(pulse.origin), pose.direction(pulse.direction))
            }));
        }
    }
    pulses
}

/// The name of the object that was hit, in backticks.
fn name_of(hit: &Hit, scene: &Scene) -> String {
    let object = scene.surface(hit.placement, hit.triangle).object;
    match scene.geometry.objects[object as usize].name.as_str() {
        "" => format!("object {object}"),
        name => crate::source::words::quoted(name),
    }
}
