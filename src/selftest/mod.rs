//! The self-test: a sensor's own pattern is cast at shapes whose ranges are known in closed form.
//!
//! Each shape is a convex solid of triangles. Every ray of the sensor is compared with two references:
//!
//! - **The facet** is the plane through the stored vertices of the triangle that was hit, in f64. The difference is the error of
//!   casting alone: at most 1e-9 m at 200 m, and in proportion beyond. Of a plane that is seen at more than 89.97° of incidence
//!   the reference itself is less certain than that: it has a dozen roundings of u = 2⁻⁵³, divided by the cosine.
//! - **The ideal shape** has vertices without rounding. Vertices are stored as f32 in the scene's own frame, so that each is at
//!   most δ from its ideal place: √3 halves of the last place of the largest coordinate (Euclid over three axes), and the
//!   roundings of the f64 coordinates of pose and place before that. The stored surface then lies between the solid grown by δ and
//!   the solid shrunk by δ, because each of its points is a mean of vertices that are off by at most δ. So a ray that misses the
//!   grown solid must miss, a ray that meets the shrunk solid must hit, and its range lies between the depths of the two, give or
//!   take the 1e-9 m of casting. A ray that meets only the grown solid passes an edge within δ: either answer is right, and such
//!   rays are counted apart. No tolerance is chosen. A tessellated ball lies between its sphere and the largest ball inside its
//!   facets, and is judged by those two.
//!
//! The sensor's limits belong to the closed form: a surface nearer than the least range is not seen, and blocks the beam. So
//! does a surface beyond the largest range, which is not seen either. The causes that the frame gives must say which it was.
//!
//! The rows and columns of the pattern are checked against its table: elevations, azimuths and pixels are computed from the
//! points as a cloud gives them, by other formulas than those that made the pulses.

pub mod datasheet;
pub mod quality;
mod shapes;
#[cfg(test)]
mod tests;

use std::cmp::Ordering;

use glam::{DAffine3, DMat3, DVec3};

use crate::angle::Angle;
use crate::frame::{BODY_FROM_OPTICAL, Pose};
use crate::motion::Trajectory;
use crate::output::{CloudFrame, Names, SensorFrame};
use crate::scan::{Cause, Frame, Progress, scan};
use crate::scene::{Material, Scene, SceneBuildError, SceneBuilder, SourceInstance, SourceMesh, SourcePart};
use crate::sensor::{Capture, Lens, Pattern, Pulse, RangeLimits, RowOrder, Sensor, Shutter};
use crate::trace::AnyTracer;
use crate::trace::methods::Method;
use shapes::{Model, Solid};

/// Half the last place of 1 in f64.
const U: f64 = f64::EPSILON / 2.0;

/// The number of shapes. Each is cast at three distances.
const SHAPES: usize = 9;

/// Rays that [`selftest`] casts for each ray of a frame.
pub const CASTS: u64 = 3 * SHAPES as u64;

/// The result of a sensor's self-test.
#[derive(Clone, Debug, PartialEq)]
pub struct SelftestReport {
    /// The results of the shapes, each near, at middle range and far.
    pub shapes: Vec<ShapeResult>,
    /// The checks of the pattern's rows, columns and times by the points.
    pub geometry: Vec<Check>,
}

impl SelftestReport {
    /// Whether every ray agrees with the closed forms, and at least one ray hit something.
    pub fn passed(&self) -> bool {
        self.shapes.iter().all(|s| s.wrong == 0)
            && self.geometry.iter().all(Check::passed)
            && self.shapes.iter().any(|s| s.hits > 0)
    }
}

/// The result of a frame that was cast at one shape.
#[derive(Clone, Debug, PartialEq)]
pub struct ShapeResult {
    /// The name of the shape.
    pub shape: &'static str,
    /// Whether the facets stand for a curved surface. Seen straight on, they lie inside the ideal shape by up to a few
    /// thousandths of its radius.
    pub tessellated: bool,
    /// The distance in metres from the sensor to the walls of a room, or to the middle of another shape.
    pub distance_m: f64,
    /// Rays that must hit, and do.
    pub hits: usize,
    /// Rays that must miss, and do.
    pub misses: usize,
    /// Rays that pass an edge, or a limit of the sensor's range, within rounding: a hit and a miss are both right.
    pub edges: usize,
    /// Rays that contradict the closed form.
    pub wrong: usize,
    /// The errors of range against the planes of the facets that were hit.
    pub facet_error: Errors,
    /// The errors of range against the ideal shape.
    pub ideal_error: Errors,
    /// The largest error of a ray as a part of the error that it may have against the ideal shape, 0 to 1.
    pub allowance_used: f64,
    /// The first ray that is wrong.
    pub first_wrong: Option<Wrong>,
}

/// Errors of range, in metres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Errors {
    /// The largest.
    pub max_m: f64,
    /// The root of the mean square.
    pub rms_m: f64,
}

/// A ray that is wrong.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wrong {
    /// Its row of the image.
    pub row: usize,
    /// Its column.
    pub column: usize,
    /// The range that came back, in metres.
    pub found_m: Option<f64>,
    /// The least and the largest range that are right, in metres; `None` if nothing had to come back.
    pub expected_m: Option<(f64, f64)>,
}

/// A quantity that has to be small.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Check {
    /// The name of the quantity.
    pub name: &'static str,
    /// Its unit.
    pub unit: &'static str,
    /// The largest value found.
    pub worst: f64,
    /// The largest that is right.
    pub allowed: f64,
    /// Row and column of the worst.
    pub at: (usize, usize),
}

impl Check {
    fn new(name: &'static str, unit: &'static str, allowed: f64) -> Self {
        Self { name, unit, worst: 0.0, allowed, at: (0, 0) }
    }

    /// Whether the quantity is as small as it has to be. NaN is not.
    pub fn passed(&self) -> bool {
        self.worst <= self.allowed
    }

    fn add(&mut self, value: f64, at: (usize, usize)) {
        if value > self.worst || value.is_nan() {
            (self.worst, self.at) = (value, at);
        }
    }
}

/// Casts a sensor's own pattern at every shape: near, just inside the sensor's least range; far, at nine tenths of its largest
/// range (200 m, if it has none); and at the geometric mean of the two. The sensor stands at `world_from_sensor`, and hits are
/// decided by `method`, or by their exact definition. `None` if `progress` was cancelled.
///
/// # Errors
/// If a shape is so far from the origin or so small that it can't be stored.
pub fn selftest(
    sensor: &Sensor,
    world_from_sensor: &Pose,
    method: Option<&Method>,
    progress: &Progress,
) -> Result<Option<SelftestReport>, SceneBuildError> {
    let mut report = SelftestReport { shapes: Vec::new(), geometry: Vec::new() };
    let trajectory = Trajectory::Fixed(*world_from_sensor);
    let capture = Capture::new(sensor, Pose::IDENTITY, &trajectory, 0, 0);
    let distances = distances(&sensor.range);
    for (which, distance) in distances.into_iter().enumerate() {
        for (index, target) in targets(sensor, distance).into_iter().enumerate() {
            let stage = Stage::new(&target, world_from_sensor)?;
            let caster = AnyTracer::build(&stage.scene, method);
            let Some(frame) = scan(&stage.scene, &caster, &capture, progress) else {
                return Ok(None);
            };
            report.shapes.push(judge(&target, &stage, &capture, &frame));
            // The level room at middle range has walls all around, and all of them are in range.
            if (which, index) == (1, 0) {
                report.geometry = geometry(sensor, &frame);
            }
        }
    }
    Ok(Some(report))
}

/// The near, the middle and the far distance, in metres.
fn distances(range: &RangeLimits) -> [f64; 3] {
    let far = if range.max_m.is_finite() { 0.9 * range.max_m } else { 200.0 };
    // Near is inside the least range, so that a part of the shape is not seen.
    let near = if range.min_m > 0.0 { 0.95 * range.min_m } else { far / 1000.0 };
    [near, (near * far).sqrt(), far]
}

/// A shape, and the place where it stands.
struct Target {
    name: &'static str,
    distance_m: f64,
    model: Model,
    sensor_from_model: DAffine3,
}

/// The shapes around and ahead of a sensor. Ahead is the direction of the beam in the middle of its image.
fn targets(sensor: &Sensor, distance: f64) -> Vec<Target> {
    let capture = Capture::at_origin(sensor);
    let middle = capture.pulse(capture.rows() / 2, capture.columns() / 2);
    let ahead = middle.map_or(DVec3::X, |pulse| pulse.direction);
    let turn = |roll, pitch, yaw| {
        Pose::from_rpy(DVec3::ZERO, Angle::deg(roll), Angle::deg(pitch), Angle::deg(yaw)).rotation
    };
    let side = ahead.any_orthonormal_vector();
    // A plate's thin side lies along its own x, which faces the sensor until it is tilted about its own y.
    let facing = DMat3::from_cols(ahead, side, ahead.cross(side));
    let skew = turn(20.0, 35.0, 50.0);
    let place = |name, model, rotation: DMat3, size: DVec3, middle: DVec3| Target {
        name,
        distance_m: distance,
        model,
        sensor_from_model: DAffine3::from_mat3_translation(
            rotation * DMat3::from_diagonal(size * distance),
            middle * distance,
        ),
    };
    let even = DVec3::splat(0.3);
    let plate = DVec3::new(0.005, 0.4, 0.3);
    let targets: [Target; SHAPES] = [
        place("room, level", Model::cube(), DMat3::IDENTITY, DVec3::ONE, DVec3::ZERO),
        place("room, tilted", Model::cube(), skew, DVec3::ONE, DVec3::ZERO),
        place("plate, facing", Model::cube(), facing, plate, ahead),
        place("plate, tilted 35°", Model::cube(), facing * turn(5.0, 35.0, 0.0), plate, ahead),
        place("plate, tilted 60°", Model::cube(), facing * turn(-20.0, 60.0, 0.0), plate, ahead),
        place("plate, tilted 80°", Model::cube(), facing * turn(10.0, 80.0, 0.0), plate, ahead),
        place("box", Model::cube(), skew, even, ahead),
        place("wedge", Model::wedge(), facing * turn(0.0, 10.0, 15.0), even, ahead),
        place("ball", Model::ball(5), skew, even, ahead),
    ];
    targets.into()
}

/// A target as a scene, and the error of storing it.
struct Stage {
    scene: Scene,
    solid: Solid,
    /// δ, the largest distance of a stored vertex from its ideal place, in metres.
    vertex_error: f64,
}

impl Stage {
    fn new(target: &Target, world_from_sensor: &Pose) -> Result<Self, SceneBuildError> {
        let Target { model, sensor_from_model, .. } = target;
        let world_from_sensor =
            DAffine3::from_mat3_translation(world_from_sensor.rotation, world_from_sensor.translation);
        let world_from_model = world_from_sensor * *sensor_from_model;
        let part = SourcePart { triangles: model.triangles.clone(), material: 0, ..SourcePart::default() };
        let mesh = SourceMesh { positions: model.positions(), parts: vec![part] };
        let placed =
            SourceInstance { mesh: 0, world_from_mesh: world_from_model, ..SourceInstance::default() };
        let builder = SceneBuilder {
            meshes: vec![mesh],
            instances: vec![placed],
            materials: vec![Material::default()],
            files: vec![],
            groups: vec![],
        };
        let scene = builder.build()?;
        let largest =
            scene.geometry.meshes[0].positions.iter().flatten().fold(0.0_f32, |most, x| most.max(x.abs()));
        let half_last_place = f64::from(largest.next_up() - largest) / 2.0;
        let size =
            sensor_from_model.matrix3.to_cols_array().iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        // Each product of poses and points in f64 rounds its terms and sums, which comes to some 16 u of the largest number.
        let largest_f64 = world_from_sensor.translation.abs().max_element() + 3.0 * target.distance_m;
        let vertex_error = 3_f64.sqrt() * half_last_place + size * model.rounding() + 16.0 * U * largest_f64;
        Ok(Self { scene, solid: model.solid(sensor_from_model), vertex_error })
    }

    /// The plane of a stored triangle in world axes about `origin`: its normal, and its distance along the normal.
    fn plane(&self, triangle: u32, origin: DVec3) -> (DVec3, f64) {
        let mesh = &self.scene.geometry.meshes[0];
        let corner = |v: u32| {
            let [x, y, z] = mesh.positions[v as usize].map(f64::from);
            DVec3::new(x, y, z)
        };
        let [a, b, c] = mesh.triangles[triangle as usize].map(corner);
        let n = (b - a).cross(c - a).normalize();
        (n, n.dot(a - (origin - self.scene.geometry.centre)))
    }
}

/// The answer of a closed form about a ray.
enum Expected {
    /// Nothing comes back, for this cause.
    Miss(Cause),
    /// The ray hits, at a range between the first two numbers, in metres. The third is the range of the ideal shape.
    Hit(f64, f64, f64),
    Either,
}

/// The largest error of a computed range of about `t` metres.
fn range_tolerance(t: f64) -> f64 {
    1e-9 * (t.abs() / 200.0).max(1.0)
}

/// The closed form's answer about a pixel's pulse, whose direction has unit length.
fn expected(stage: &Stage, limits: &RangeLimits, pulse: &Pulse) -> Expected {
    let crossing = |grown| stage.solid.crossing(pulse.origin, pulse.direction, grown);
    let Some(outer) = crossing(stage.vertex_error) else { return Expected::Miss(Cause::Nothing) };
    let (Some(ideal), Some(inner)) = (crossing(0.0), crossing(-stage.vertex_error)) else {
        let is_behind = outer.1 + range_tolerance(outer.1) < 0.0;
        return if is_behind { Expected::Miss(Cause::Nothing) } else { Expected::Either };
    };
    // Along the ray, a range grows by at most as much as the way, and a depth by at most as much as the range, so that neither
    // has a larger error.
    let place = |range_m| limits.place_of(pulse, range_m);
    // The surface as the ray goes in, and as it comes out.
    for (low, high, ideal) in [(outer.0, inner.0, ideal.0), (inner.1, outer.1, ideal.1)] {
        let (low, high) = (low - range_tolerance(low), high + range_tolerance(high));
        if high < 0.0 {
            continue;
        }
        let is_at_the_origin = low < 0.0;
        let [low, high, ideal] = [low, high, ideal].map(|along| pulse.range_m(along));
        return match (place(low), place(high)) {
            _ if is_at_the_origin => Expected::Either,
            (Ordering::Equal, Ordering::Equal) => Expected::Hit(low, high, ideal),
            (Ordering::Less, Ordering::Less) => Expected::Miss(Cause::TooNear),
            (Ordering::Greater, Ordering::Greater) => Expected::Miss(Cause::OutOfRange),
            _ => Expected::Either,
        };
    }
    Expected::Miss(Cause::Nothing)
}

/// Compares a frame of `target` with its closed form.
fn judge(target: &Target, stage: &Stage, capture: &Capture, frame: &Frame) -> ShapeResult {
    let pose = capture.world_from_sensor(0.0);
    let limits = &capture.sensor.range;
    let mut result = ShapeResult {
        shape: target.name,
        tessellated: matches!(stage.solid, Solid::Ball { .. }),
        distance_m: target.distance_m,
        hits: 0,
        misses: 0,
        edges: 0,
        wrong: 0,
        facet_error: Errors::default(),
        ideal_error: Errors::default(),
        allowance_used: 0.0,
        first_wrong: None,
    };
    let (mut facet, mut ideal) = (Sum::default(), Sum::default());
    for (row, column) in pixels(frame) {
        let found = frame.get(row, column);
        let Some(pulse) = capture.pulse(row, column) else {
            // A pixel without a pulse must see nothing.
            match found {
                None => result.misses += 1,
                Some(hit) => {
                    result.wrong += 1;
                    let wrong = Wrong { row, column, found_m: Some(hit.range_m), expected_m: None };
                    result.first_wrong.get_or_insert(wrong);
                }
            }
            continue;
        };
        let expected = expected(stage, limits, &pulse);
        let cause = frame.causes()[row * frame.columns() + column];
        let found_m = found.map(|hit| hit.range_m);
        let mut right = true;
        let mut expected_m = None;
        match (&expected, found_m) {
            (&Expected::Miss(why), None) => {
                result.misses += 1;
                right = why == cause;
            }
            (Expected::Either, _) => result.edges += 1,
            (&Expected::Hit(low, high, middle), Some(t)) => {
                result.hits += 1;
                let off = t - middle;
                ideal.add(off);
                let room = if off < 0.0 { middle - low } else { high - middle };
                result.allowance_used = result.allowance_used.max(off.abs() / room);
                right = (low..=high).contains(&t);
                expected_m = Some((low, high));
            }
            (Expected::Miss(_), Some(_)) => right = false,
            (&Expected::Hit(low, high, _), None) => (right, expected_m) = (false, Some((low, high))),
        }
        if let Some(hit) = found {
            right &= limits.place_of(&pulse, hit.range_m).is_eq();
            let d = pose.direction(pulse.direction);
            let (n, h) = stage.plane(hit.triangle, pose.point(pulse.origin));
            let cos = n.dot(d);
            let along = h / cos;
            let t = pulse.range_m(along);
            facet.add(hit.range_m - t);
            let reference = 12.0 * U * (along.abs() + h.abs()) / cos.abs();
            let allowed = range_tolerance(t).max(reference);
            let is_near = (hit.range_m - t).abs() <= allowed; // NaN is not
            if !is_near {
                right = false;
                expected_m = expected_m.or(Some((t - allowed, t + allowed)));
            }
        }
        if !right {
            result.wrong += 1;
            result.first_wrong.get_or_insert(Wrong { row, column, found_m, expected_m });
        }
    }
    (result.facet_error, result.ideal_error) = (facet.errors(), ideal.errors());
    result
}

fn pixels(frame: &Frame) -> impl Iterator<Item = (usize, usize)> + use<> {
    let columns = frame.columns();
    (0..frame.rows()).flat_map(move |row| (0..columns).map(move |column| (row, column)))
}

/// A running maximum and sum of squares.
#[derive(Default)]
struct Sum {
    count: usize,
    max: f64,
    squares: f64,
}

impl Sum {
    fn add(&mut self, error: f64) {
        self.count += 1;
        // f64::max would drop a NaN.
        self.max = if error.is_nan() { f64::NAN } else { self.max.max(error.abs()) };
        self.squares += error * error;
    }

    fn errors(&self) -> Errors {
        let mean = self.squares / self.count.max(1) as f64;
        Errors { max_m: self.max, rms_m: mean.sqrt() }
    }
}

/// Compares the directions and times of the points of a frame with the pattern's own table.
///
/// A point is direction times range, and each is good to a few u. An angle computed from it by atan2 is as good, and the
/// table's own angles are radians up to a few π, rounded: the errors come to a few 1e-15 in all. The tolerance of 1e-12 rad, a
/// fifth of a nanometre at 200 m, stays clear of that and far below any step of a sensor's table.
fn geometry(sensor: &Sensor, frame: &Frame) -> Vec<Check> {
    let capture = Capture::at_origin(sensor);
    let names = Names::default();
    let seen = SensorFrame { cloud_frame: CloudFrame::Body, names, ..SensorFrame::new(capture, frame, "") };
    let mut checks = angles(&capture, frame, &|row, column, range| seen.point(row, column, range));
    let time = |row, column| capture.time_s(row, column);
    checks.extend(times((capture.rows(), capture.columns()), sensor.pattern.rate_hz(), &time));
    checks.extend(
        sensor
            .pattern
            .shutter()
            .map(|shutter| exposures((capture.rows(), capture.columns()), shutter, &time)),
    );
    checks
}

fn angles(
    capture: &Capture,
    frame: &Frame,
    point: &dyn Fn(usize, usize, f64) -> Option<DVec3>,
) -> Vec<Check> {
    const ANGLE: f64 = 1e-12;
    let mut direction = Check::new("direction of the points", "rad", ANGLE);
    let mut range = Check::new("range of the points", "m", 1e-9);
    let mut elevation = Check::new("elevation of the rows", "rad", ANGLE);
    let mut azimuth = Check::new("azimuth of the columns", "rad", ANGLE);
    let mut pixel = Check::new("pixels of the points", "px", 0.0);
    let pattern = &capture.sensor.pattern;
    for (row, column) in pixels(frame) {
        let Some(hit) = frame.get(row, column) else { continue };
        let at = (row, column);
        // The shapes have shown that a pixel without a pulse sees nothing.
        let (Some(pulse), Some(p)) = (capture.pulse(row, column), point(row, column, hit.range_m)) else {
            continue;
        };
        let d = pulse.direction;
        let whole = p;
        let p = p - pulse.origin;
        direction.add(p.cross(d).length() / p.length(), at);
        range.add((pulse.range_m(p.length()) - hit.range_m).abs(), at);
        match pattern {
            Pattern::Rotating(lidar) => {
                let beam = &lidar.beams()[row];
                let level = libm::hypot(p.x, p.y);
                elevation.add((libm::atan2(p.z, level) - beam.elevation.radians()).abs(), at);
                let head = lidar.azimuth(lidar.firing(row, column)) + lidar.turn_before(row, column);
                let expected = (head + beam.azimuth_offset).radians();
                let off = libm::remainder(libm::atan2(p.y, p.x) - expected, std::f64::consts::TAU);
                // Straight up there is no azimuth, so the distance sideways counts.
                azimuth.add(off.abs() * level / p.length(), at);
            }
            Pattern::Orthographic(camera) => {
                pixel.add(off_pixel(pattern, whole, at), at);
                // Each of the coordinate, its sum with half of the side and the quotient by a pixel's side is rounded a few times,
                // by at most u of the side.
                pixel.allowed = 8.0 * U * camera.width().max(camera.height()) as f64;
            }
            Pattern::Camera(camera) => {
                let (fx, fy) = camera.focal_px();
                let (cx, cy) = camera.principal_px();
                pixel.add(off_pixel(pattern, p, at), at);
                // A pixel is 1/f of a radian or less, and its coordinate is a sum with the principal point. Lenses are inverted
                // to 1e-12 of the focal length, and no lens that can be inverted magnifies that by much.
                let largest = (column as f64 + 0.5).max(row as f64 + 0.5) + cx.abs().max(cy.abs());
                let lens = if matches!(camera.lens(), Lens::Ideal) { 1.0 } else { 16.0 };
                pixel.allowed = pixel.allowed.max(lens * ANGLE * fx.max(fy) + 8.0 * U * largest);
            }
            _ => {}
        }
    }
    let mut checks = vec![direction, range];
    checks.extend(match pattern {
        Pattern::Rotating(_) => vec![elevation, azimuth],
        Pattern::Camera(_) | Pattern::Orthographic(_) => vec![pixel],
        _ => vec![],
    });
    checks
}

/// The pixels that a camera's image of a point in the body frame is from the centre of a pixel (row, column), the larger of across
/// and down.
fn off_pixel(camera: &Pattern, point: DVec3, (row, column): (usize, usize)) -> f64 {
    let place = camera.project(BODY_FROM_OPTICAL.inverse().direction(point));
    place.map_or(f64::INFINITY, |(u, v)| (u - column as f64 - 0.5).abs().max((v - row as f64 - 0.5).abs()))
}

/// Checks the times at which the rows of an image are exposed: each pixel's is that of the last row exposed before its own,
/// and the time of a row later. The first row is exposed at the frame's start.
///
/// Each of two times is a product and rounded once, and so is the sum: the difference is off by at most 3 u of the last time.
fn exposures(
    (rows, columns): (usize, usize),
    shutter: &Shutter,
    time_s: &dyn Fn(usize, usize) -> Option<f64>,
) -> Check {
    let mut exposure = Check::new("exposure of the rows", "s", 3.0 * U * shutter.last_s(rows));
    // Some pixels have no ray, so a row's time is that of any of its pixels.
    let time_of = |row: usize| (0..columns).find_map(|column| time_s(row, column));
    for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
        let Some(time) = time_s(row, column) else { continue };
        let before = match shutter.order() {
            RowOrder::TopDown => row.checked_sub(1),
            RowOrder::BottomUp => Some(row + 1).filter(|row| *row < rows),
        };
        let expected = match before {
            None => Some(0.0),
            Some(before) if column == 0 => time_of(before).map(|before| before + shutter.row_time_s()),
            Some(_) => time_of(row),
        };
        exposure.add(expected.map_or(0.0, |expected| (time - expected).abs()), (row, column));
    }
    exposure
}

/// Checks the times along each row. They go back once at most, and by less than a frame's period, in an image that starts
/// between firings; and all pulses of a row come within a period.
fn times(
    (rows, columns): (usize, usize),
    rate_hz: Option<f64>,
    time_s: &dyn Fn(usize, usize) -> Option<f64>,
) -> Vec<Check> {
    let mut back = Check::new("time going back along a row", "s", 0.0);
    let period_s = rate_hz.map_or(f64::INFINITY, |rate| 1.0 / rate);
    let mut span = Check::new("time from a row's first pulse to its last", "s", period_s);
    for row in 0..rows {
        let times = (0..columns).filter_map(|column| time_s(row, column).map(|time| (column, time)));
        let (mut first, mut last, mut turns) = (f64::INFINITY, f64::NEG_INFINITY, 0);
        let mut before: Option<f64> = None;
        for (column, time) in times {
            let step_back = before.map_or(0.0, |before| before - time);
            turns += usize::from(step_back > 0.0);
            let starts_over = step_back > 0.0 && turns == 1 && time < first;
            back.add(if starts_over { 0.0 } else { step_back }, (row, column));
            first = first.min(time);
            last = last.max(time);
            span.add(time - first, (row, column));
            span.add(last - first, (row, column));
            before = Some(time);
        }
    }
    vec![back, span]
}
