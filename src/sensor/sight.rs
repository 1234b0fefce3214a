//! Where a sensor looks: the part of space that its frame covers at any distance.

use std::f64::consts::{PI, TAU};

use glam::DVec3;

use super::facts::MOST_RAYS_TO_ASK;
use super::{Capture, Pattern, azimuth_elevation};
use crate::frame::BODY_FROM_OPTICAL;

/// The directions that a frame of a sensor covers, as seen from the sensor's origin.
///
/// A camera covers what it projects into the image, from edge to edge; of one with parallel rays that is the space before its
/// image. Any other sensor covers a sector of azimuths and a
/// span of elevations: a rotating one the sector of its head and the span from its lowest beam to its highest, and others what
/// the pulses of the frame reach. The directions between two beams count as covered, and so do both ends.
#[derive(Clone, Debug)]
pub struct Sight<'s>(Kind<'s>);

#[derive(Clone, Debug)]
enum Kind<'s> {
    /// The pattern of a camera.
    Camera(&'s Pattern),
    Sector {
        /// The azimuth in the middle of the sector, and half of its width, both in radians.
        middle: f64,
        half: f64,
        /// The lowest and the highest elevation, in radians.
        elevations: (f64, f64),
    },
}

impl<'s> Sight<'s> {
    /// The sight of a capture. Of very many pulses, an evenly spaced part is asked.
    pub fn of(capture: &Capture<'s>) -> Self {
        match &capture.sensor.pattern {
            pattern if pattern.is_camera() => Self(Kind::Camera(pattern)),
            Pattern::Rotating(rotating) => {
                let (from, to) = rotating.sector();
                let (from, to) = (from.radians(), to.radians());
                let half = if rotating.is_full_turn() { PI } else { (to - from).abs() / 2.0 };
                let elevations = rotating.beams().iter().map(|beam| beam.elevation.radians());
                Self(Kind::Sector { middle: (from + to) / 2.0, half, elevations: span(elevations) })
            }
            _ => {
                let (pulses, columns) = (capture.rows() * capture.columns(), capture.columns());
                let directions = (0..pulses)
                    .step_by(pulses.div_ceil(MOST_RAYS_TO_ASK).max(1))
                    .filter_map(|index| capture.pulse(index / columns, index % columns))
                    .map(|pulse| azimuth_elevation(pulse.direction));
                let (azimuths, elevations): (Vec<f64>, Vec<f64>) =
                    directions.map(|(azimuth, elevation)| (azimuth.radians(), elevation.radians())).unzip();
                let (middle, half) = sector(azimuths);
                Self(Kind::Sector { middle, half, elevations: span(elevations.into_iter()) })
            }
        }
    }

    /// Whether a point, in the sensor's body frame, lies in a direction that the frame covers.
    pub fn covers(&self, point: DVec3) -> bool {
        match &self.0 {
            Kind::Camera(camera) => {
                let optical = BODY_FROM_OPTICAL.rotation.transpose() * point;
                let (width, height) = (camera.columns() as f64, camera.rows() as f64);
                camera
                    .project(optical)
                    .is_some_and(|(u, v)| (0.0..=width).contains(&u) && (0.0..=height).contains(&v))
            }
            Kind::Sector { middle, half, elevations: (low, high) } => {
                let (azimuth, elevation) = azimuth_elevation(point);
                let apart = turned(azimuth.radians() - middle).abs();
                apart <= *half && (*low..=*high).contains(&elevation.radians())
            }
        }
    }
}

/// An angle less whole turns, from −π to π.
fn turned(angle: f64) -> f64 {
    angle - TAU * (angle / TAU).round()
}

/// The least and the largest of some numbers.
fn span(numbers: impl Iterator<Item = f64>) -> (f64, f64) {
    numbers.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
}

/// The middle and half the width of the narrowest sector that has all azimuths: it leaves out the widest gap between two
/// neighbours. Where even that gap is no wider than 2°, the sector is a full turn.
fn sector(mut azimuths: Vec<f64>) -> (f64, f64) {
    const CLOSED: f64 = 2.0 * PI / 180.0;
    azimuths.sort_by(f64::total_cmp);
    let (Some(first), Some(last)) = (azimuths.first(), azimuths.last()) else { return (0.0, 0.0) };
    let mut widest = (first + TAU - last, *first, *last);
    for pair in azimuths.windows(2) {
        if pair[1] - pair[0] > widest.0 {
            widest = (pair[1] - pair[0], pair[1], pair[0] + TAU);
        }
    }
    let (gap, from, to) = widest;
    if gap <= CLOSED { (0.0, PI) } else { ((from + to) / 2.0, (to - from) / 2.0) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle::Angle;
    use crate::sensor::{Beam, Camera, Rotating, Sensor, direction};

    fn lidar(elevations: [f64; 2], sector: (f64, f64)) -> Sensor {
        let beam = |elevation: f64| Beam {
            elevation: Angle::deg(elevation),
            azimuth_offset: Angle::default(),
            time_s: 0.0,
            file_index: 0,
        };
        let sector = (Angle::deg(sector.0), Angle::deg(sector.1));
        let rotating = Rotating::new(elevations.map(beam).to_vec(), 100, sector, 10.0).unwrap();
        Sensor::new(Pattern::Rotating(rotating))
    }

    fn covers(sensor: &Sensor, azimuth: f64, elevation: f64) -> bool {
        let point = direction(Angle::deg(azimuth), Angle::deg(elevation)) * 7.0;
        Sight::of(&Capture::at_origin(sensor)).covers(point)
    }

    #[test]
    fn a_sector_has_two_sides_and_two_heights() {
        let turn = lidar([5.0, -15.0], (180.0, -180.0));
        assert!(covers(&turn, 179.9, 4.9) && covers(&turn, -179.9, -14.9) && covers(&turn, 0.0, 0.0));
        assert!(!covers(&turn, 0.0, 5.1) && !covers(&turn, 0.0, -15.1));
        // From 170° through 180° to −150°: 40 degrees about 190°.
        let behind = lidar([5.0, -15.0], (170.0, 210.0));
        assert!(covers(&behind, 171.0, 0.0) && covers(&behind, -151.0, 0.0) && covers(&behind, 180.0, 0.0));
        assert!(!covers(&behind, 169.0, 0.0) && !covers(&behind, -149.0, 0.0) && !covers(&behind, 0.0, 0.0));
    }

    #[test]
    fn a_camera_covers_its_image() {
        // 90° wide, and as high as 2·atan(3/4).
        let camera = Camera::from_hfov((640, 480), Angle::deg(90.0), None).unwrap();
        let camera = Sensor::new(Pattern::Camera(camera));
        assert!(covers(&camera, 44.9, 0.0) && covers(&camera, 0.0, 36.8) && covers(&camera, -44.9, 0.0));
        assert!(!covers(&camera, 45.1, 0.0) && !covers(&camera, 0.0, -36.9) && !covers(&camera, 180.0, 0.0));
    }

    #[test]
    fn the_widest_gap_is_not_covered() {
        let degrees = |from: i32, to: i32| (from..=to).map(|d| turned(f64::from(d).to_radians())).collect();
        let (middle, half) = sector(degrees(-30, 50));
        assert!((middle.to_degrees() - 10.0).abs() < 1e-12 && (half.to_degrees() - 40.0).abs() < 1e-12);
        let (middle, half) = sector(degrees(150, 230));
        assert!(
            (turned(middle).to_degrees() + 170.0).abs() < 1e-12 && (half.to_degrees() - 40.0).abs() < 1e-12
        );
        assert_eq!(sector(degrees(0, 359)), (0.0, PI));
        assert_eq!(sector(Vec::new()), (0.0, 0.0));
    }
}
