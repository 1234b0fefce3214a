//! A rig as the page shows it: where its sensors are on the vehicle, and where they look.

use crate::check::{GroundMap, Vehicle};
use crate::frame::Pose;
use crate::sensor::{Capture, Orthographic, Pattern, Sensor, azimuth_elevation};

/// A rig in its vehicle's frame.
#[derive(Clone, Debug, Default)]
pub struct Rig {
    /// The sensors, in the order of the views that belong to them.
    pub sensors: Vec<Mounted>,
    /// The vehicle, if the job tells which objects it is.
    pub vehicle: Option<Vehicle>,
    /// The ground that the rig sees. `None` if nobody asked for it.
    pub ground: Option<GroundMap>,
}

/// A sensor of a rig.
#[derive(Clone, Debug)]
pub struct Mounted {
    /// The sensor's name.
    pub name: String,
    /// Where the sensor is on the vehicle.
    pub body_from_sensor: Pose,
    /// The edges of the field of view in the sensor's frame, in metres: pairs of the ends of lines.
    pub edges: Vec<[[f32; 3]; 2]>,
}

impl Mounted {
    /// A sensor at its place.
    pub fn of(name: &str, sensor: &Sensor, body_from_sensor: Pose) -> Self {
        Self { name: name.to_owned(), body_from_sensor, edges: edges(sensor) }
    }
}

/// Most pulses that are looked at to find the edges of a field of view.
const MOST_PULSES: usize = 200_000;

/// Columns of directions, around the whole turn.
const BINS: usize = 240;

/// The length of the lines of a field of view in metres: as long as a person sees them beside a car, and never longer than the
/// sensor sees.
fn length_m(sensor: &Sensor) -> f64 {
    (sensor.range.max_m / 20.0).clamp(0.3, 3.0)
}

/// The edges of the space that a camera of parallel rays sees: its image, the same rectangle ahead, and lines between their corners.
fn edges_of_box(camera: &Orthographic, length_m: f64) -> Vec<[[f32; 3]; 2]> {
    let (y, z) = (camera.size_m().0 / 2.0, camera.size_m().1 / 2.0);
    let corner = |x: f64, i: usize| {
        let (left, up) = [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)][i % 4];
        [x, left * y, up * z].map(|x| x as f32)
    };
    let around = |x: f64| (0..4).map(move |i| [corner(x, i), corner(x, i + 1)]);
    let along = (0..4).map(|i| [corner(0.0, i), corner(length_m, i)]);
    around(0.0).chain(around(length_m)).chain(along).collect()
}

/// The edges of a sensor's field of view: the highest and the lowest pulse of each azimuth, and lines to them from the sensor.
fn edges(sensor: &Sensor) -> Vec<[[f32; 3]; 2]> {
    let length = length_m(sensor);
    if let Pattern::Orthographic(camera) = &sensor.pattern {
        return edges_of_box(camera, length);
    }
    let (rays, columns) = (sensor.pattern.rays(), sensor.pattern.columns());
    let capture = Capture::at_origin(sensor);
    // An odd step does not stay in the same columns.
    let step = (rays / MOST_PULSES).max(1) | 1;
    let mut spans: Vec<Option<[f64; 2]>> = vec![None; BINS];
    for index in (0..rays).step_by(step) {
        let Some(pulse) = capture.pulse(index / columns, index % columns) else { continue };
        let (azimuth, elevation) = azimuth_elevation(pulse.direction);
        let (azimuth, elevation) = (azimuth.radians(), elevation.radians());
        if !(azimuth.is_finite() && elevation.is_finite()) {
            continue;
        }
        let part = (azimuth / std::f64::consts::TAU).rem_euclid(1.0);
        let bin = ((part * BINS as f64) as usize).min(BINS - 1);
        let span = spans[bin].get_or_insert([elevation; 2]);
        *span = [span[0].min(elevation), span[1].max(elevation)];
    }
    fill_gaps(&mut spans);
    let point = |bin: usize, elevation: f64| {
        let azimuth = (bin as f64 + 0.5) / BINS as f64 * std::f64::consts::TAU;
        let flat = length * libm::cos(elevation);
        [flat * libm::cos(azimuth), flat * libm::sin(azimuth), length * libm::sin(elevation)]
            .map(|x| x as f32)
    };
    let is_whole = spans.iter().all(Option::is_some);
    let mut edges = Vec::new();
    for bin in 0..BINS {
        let Some(span) = spans[bin] else { continue };
        let (before, after) = ((bin + BINS - 1) % BINS, (bin + 1) % BINS);
        if let Some(next) = spans[after] {
            edges.extend([0, 1].map(|end| [point(bin, span[end]), point(after, next[end])]));
        }
        let is_end = spans[before].is_none() || spans[after].is_none();
        if is_end || (is_whole && bin.is_multiple_of(BINS / 4)) {
            edges.extend([0, 1].map(|end| [[0.0; 3], point(bin, span[end])]));
        }
        if is_end {
            edges.push([point(bin, span[0]), point(bin, span[1])]);
        }
    }
    edges
}

/// The widest gap between two columns of pulses that is no edge, in bins: 12°.
const WIDEST_GAP: usize = 8;

/// Fills gaps that are only as wide as the steps of a coarse sensor.
fn fill_gaps(spans: &mut [Option<[f64; 2]>]) {
    let bins = spans.len();
    let known = spans.to_vec();
    for start in (0..bins).filter(|&bin| known[bin].is_some()) {
        let next = (1..=WIDEST_GAP + 1).find(|step| known[(start + step) % bins].is_some());
        let Some(next @ 2..) = next else { continue };
        if let (Some(from), Some(to)) = (known[start], known[(start + next) % bins]) {
            for step in 1..next {
                let part = step as f64 / next as f64;
                spans[(start + step) % bins] =
                    Some([0, 1].map(|end| from[end] + (to[end] - from[end]) * part));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle::Angle;
    use crate::sensor::{Beam, Camera, Rotating};

    #[test]
    fn a_camera_has_a_pyramid_and_a_lidar_a_ring() {
        let camera = Camera::new((64, 48), (32.0, 32.0), (32.0, 24.0), None).unwrap();
        let seen = edges(&Sensor::new(Pattern::Camera(camera)));
        let spokes = seen.iter().filter(|[from, _]| *from == [0.0; 3]).count();
        assert_eq!(spokes, 4, "one to each corner");
        // Half of the field of view is 45° to either side, and x is forward.
        assert!(seen.iter().flatten().all(|p| p[0] >= 0.0 && p[1].abs() <= p[0] * 1.05 + 1e-6));
        let widest = seen.iter().flatten().map(|p| p[1] / p[0].max(1e-6)).fold(0.0, f32::max);
        assert!(widest > 0.9, "{widest}");
        // Parallel rays fill a box: 0.6 m long with a range of 12 m.
        let parallel = Orthographic::new((8, 4), (2.0, 1.0), None).unwrap();
        let mut boxed = Sensor::new(Pattern::Orthographic(parallel));
        boxed.range.max_m = 12.0;
        let seen = edges(&boxed);
        assert_eq!(seen.len(), 12);
        assert!(seen.iter().flatten().all(|p| p[1].abs() == 1.0 && p[2].abs() == 0.5));
        assert!(seen.iter().flatten().all(|p| [0.0, 0.6].contains(&p[0])));
        // A head with 36 columns sees all around, and has four pairs of spokes.
        let beam = |degrees| Beam {
            elevation: Angle::deg(degrees),
            azimuth_offset: Angle::default(),
            time_s: 0.0,
            file_index: 0,
        };
        let turn = (Angle::deg(180.0), Angle::deg(-180.0));
        let head = Rotating::new(vec![beam(10.0), beam(-10.0)], 36, turn, 10.0).unwrap();
        let seen = edges(&Sensor::new(Pattern::Rotating(head)));
        assert_eq!(seen.iter().filter(|[from, _]| *from == [0.0; 3]).count(), 8);
    }
}
