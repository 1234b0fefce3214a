//! Facts that follow from a sensor's pattern: the field of view, the angular steps, and the points a second.

use serde::Serialize;

use super::{Camera, Capture, Limited, Pattern, Rotating, Sensor, azimuth_elevation};

/// The facts that people ask of a sensor. Angles are in degrees, ready to be shown.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SensorFacts {
    /// `camera` or `LiDAR`.
    pub kind: &'static str,
    /// Rows of the image.
    pub rows: usize,
    /// Columns of the image.
    pub columns: usize,
    /// Pixels of a frame, including the pixels without a ray.
    pub rays_per_frame: usize,
    /// The width of the field of view, 0 of a camera of parallel rays.
    pub horizontal_fov_deg: f64,
    /// The lowest and the highest elevation. For a camera they are taken along the image's column through the principal
    /// point.
    pub elevation_deg: [f64; 2],
    /// The step from one column to the next, in patterns that have one. For a camera it is the step at the principal point.
    pub azimuth_step_deg: Option<f64>,
    /// The smallest and the largest step from one row to the next, in patterns that have them. For a camera both are the
    /// step at the principal point.
    pub elevation_step_deg: Option<[f64; 2]>,
    /// The width and the height of the image in metres, of a camera of parallel rays.
    pub image_m: Option<[f64; 2]>,
    /// The width and the height of a pixel in metres, of a camera of parallel rays.
    pub pixel_m: Option<[f64; 2]>,
    /// Frames a second, if the sensor has a rate.
    pub rate_hz: Option<f64>,
    /// Rays a second, if the sensor has a rate.
    pub points_per_second: Option<f64>,
    /// The least range that is measured, in metres.
    pub min_range_m: f64,
    /// The largest range that is measured, in metres; `None` if there is no limit.
    pub max_range_m: Option<f64>,
    /// The length that these limits apply to: `range` or `depth`.
    pub limits_of: &'static str,
    /// The time from the first pulse of a frame to the last, in seconds.
    pub frame_s: f64,
    /// The number of pixels without a ray: the model of the lens or of the prisms has none, or the beam does not fire in every
    /// column. In frames of more than [`MOST_RAYS_TO_ASK`] rays it is an estimate.
    pub blind_pixels: usize,
}

/// The number of rays up to which every pixel of a frame is asked for its ray. Of more, an evenly spaced part is asked: the
/// inverse of a lens takes a microsecond or two.
pub const MOST_RAYS_TO_ASK: usize = 1 << 20;

impl SensorFacts {
    /// Derives the facts from a sensor.
    pub fn of(sensor: &Sensor) -> Self {
        let pattern = &sensor.pattern;
        let (rows, columns, rays) = (pattern.rows(), pattern.columns(), pattern.rays());
        let capture = Capture::at_origin(sensor);
        let angles = match pattern {
            Pattern::Rotating(p) => Angles::of_rotating(p),
            Pattern::Camera(p) => Angles::of_camera(p),
            _ => Angles::of_pulses(&capture),
        };
        let blind = capture.blind_pixels(MOST_RAYS_TO_ASK);
        let limit = sensor.range.max_m;
        let parallel = match pattern {
            Pattern::Orthographic(p) => Some(p),
            _ => None,
        };
        Self {
            kind: if pattern.is_camera() { "camera" } else { "LiDAR" },
            rows,
            columns,
            rays_per_frame: rays,
            horizontal_fov_deg: angles.horizontal_fov,
            elevation_deg: angles.elevation,
            azimuth_step_deg: angles.azimuth_step,
            elevation_step_deg: angles.elevation_step,
            image_m: parallel.map(|p| p.size_m().into()),
            pixel_m: parallel.map(|p| p.pixel_m().into()),
            rate_hz: pattern.rate_hz(),
            points_per_second: pattern.rate_hz().map(|rate| rate * (rays - blind) as f64),
            min_range_m: sensor.range.min_m,
            max_range_m: limit.is_finite().then_some(limit),
            limits_of: match sensor.range.of {
                Limited::Range => "range",
                Limited::Depth => "depth",
            },
            frame_s: pattern.last_pulse_s() - pattern.first_pulse_s(),
            blind_pixels: blind,
        }
    }
}

/// The number of places from an edge inward that are asked for the first one that a lens sees.
const MOST_PIXELS_FROM_AN_EDGE: usize = 1 << 12;

/// The angles of a pattern, in degrees.
struct Angles {
    horizontal_fov: f64,
    elevation: [f64; 2],
    azimuth_step: Option<f64>,
    elevation_step: Option<[f64; 2]>,
}

impl Angles {
    fn of_rotating(p: &Rotating) -> Self {
        let (from, to) = p.sector();
        let elevation = |row: usize| p.beams()[row].elevation.degrees();
        let steps = (1..p.beams().len()).map(|row| elevation(row - 1) - elevation(row));
        let step = steps.fold(None, |range: Option<[f64; 2]>, step| {
            let [least, most] = range.unwrap_or([step; 2]);
            Some([least.min(step), most.max(step)])
        });
        Self {
            horizontal_fov: (to - from).degrees().abs(),
            elevation: [elevation(p.beams().len() - 1), elevation(0)],
            azimuth_step: Some(p.azimuth_step().degrees().abs()),
            elevation_step: step,
        }
    }

    /// The angles of the image from edge to edge through the principal point, or as far as the lens sees. The horizontal
    /// angle of a pinhole is atan((width − cx)/fx) + atan(cx/fx), and the vertical one follows in the same way. The steps
    /// are those of the pixel at the principal point.
    fn of_camera(p: &Camera) -> Self {
        let ((cx, cy), (width, height)) = (p.principal_px(), (p.width() as f64, p.height() as f64));
        // Both angles are in degrees: `right` to the right of the optical axis, `down` below it.
        let right = |u: f64| p.optical_direction_at(u, cy).map(|d| libm::atan2(d.x, d.z).to_degrees());
        let down = |v: f64| p.optical_direction_at(cx, v).map(|d| libm::atan2(d.y, d.z).to_degrees());
        let seen = |along: &dyn Fn(f64) -> Option<f64>, edge: f64, inward: f64| {
            // Of a very long image, every so many pixels.
            let step = p.width().max(p.height()).div_ceil(MOST_PIXELS_FROM_AN_EDGE);
            let steps = 0..=MOST_PIXELS_FROM_AN_EDGE;
            steps.map(|i| edge + inward * (i * step) as f64).find_map(along).unwrap_or(0.0)
        };
        let step = |along: &dyn Fn(f64) -> Option<f64>, centre: f64| {
            Some(along(centre + 0.5)? - along(centre - 0.5)?)
        };
        Self {
            horizontal_fov: seen(&right, width, -1.0) - seen(&right, 0.0, 1.0),
            elevation: [-seen(&down, height, -1.0), -seen(&down, 0.0, 1.0)],
            azimuth_step: step(&right, cx),
            elevation_step: step(&down, cy).map(|step| [step; 2]),
        }
    }

    /// The angles that the pulses of the first frame reach. If there are very many pulses, an evenly spaced subset is
    /// asked.
    fn of_pulses(capture: &Capture) -> Self {
        let (rays, columns) = (capture.rows() * capture.columns(), capture.columns());
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for index in (0..rays).step_by(rays.div_ceil(MOST_RAYS_TO_ASK)) {
            let Some(pulse) = capture.pulse(index / columns, index % columns) else { continue };
            let (azimuth, elevation) = azimuth_elevation(pulse.direction);
            for (axis, angle) in [azimuth, elevation].into_iter().enumerate() {
                low[axis] = low[axis].min(angle.degrees());
                high[axis] = high[axis].max(angle.degrees());
            }
        }
        Self {
            horizontal_fov: (high[0] - low[0]).max(0.0),
            elevation: [low[1].min(high[1]), high[1].max(low[1])],
            azimuth_step: None,
            elevation_step: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle::Angle;
    use crate::sensor::{Beam, RangeLimits, RingOrder};

    /// Rounds to the precision that is shown to people.
    fn rounded(x: f64) -> f64 {
        (x * 1e4).round() / 1e4
    }

    fn lidar(elevations: &[f64], columns: usize, sector: (f64, f64)) -> Sensor {
        let beam = |(index, e): (usize, &f64)| Beam {
            elevation: Angle::deg(*e),
            azimuth_offset: Angle::default(),
            time_s: index as f64 * 1e-6,
            file_index: index,
        };
        let beams = elevations.iter().enumerate().map(beam).collect();
        let sector = (Angle::deg(sector.0), Angle::deg(sector.1));
        let pattern = Pattern::Rotating(Rotating::new(beams, columns, sector, 10.0).unwrap());
        Sensor {
            pattern,
            range: RangeLimits { min_m: 0.5, max_m: 50.0, ..RangeLimits::default() },
            ring: RingOrder::Row,
            measurement: Default::default(),
        }
    }

    #[test]
    fn facts_of_a_lidar() {
        let facts = SensorFacts::of(&lidar(&[10.0, -20.0, 8.0], 360, (180.0, -180.0)));
        assert_eq!((facts.kind, facts.rows, facts.columns, facts.rays_per_frame), ("LiDAR", 3, 360, 1080));
        assert_eq!(
            (rounded(facts.horizontal_fov_deg), facts.elevation_deg.map(rounded)),
            (360.0, [-20.0, 10.0])
        );
        assert_eq!(facts.azimuth_step_deg.map(rounded), Some(1.0));
        assert_eq!(facts.elevation_step_deg.map(|s| s.map(rounded)), Some([2.0, 28.0]));
        assert_eq!(facts.points_per_second, Some(10_800.0));
        assert_eq!(facts.max_range_m, Some(50.0));
        // The last column fires after 359/360 of a tenth of a second, and the last beam fires 2 µs later.
        assert!((facts.frame_s - (0.1 * 359.0 / 360.0 + 2e-6)).abs() < 1e-12);
    }

    #[test]
    fn facts_of_a_sector_and_of_one_beam() {
        let facts = SensorFacts::of(&lidar(&[1.0], 91, (45.0, -45.0)));
        assert_eq!(rounded(facts.horizontal_fov_deg), 90.0);
        assert_eq!(facts.azimuth_step_deg.map(rounded), Some(1.0));
        assert_eq!(facts.elevation_step_deg, None);
    }

    #[test]
    fn facts_of_a_camera() {
        let pattern = Pattern::Camera(Camera::new((640, 480), (320.0, 240.0), (320.0, 240.0), None).unwrap());
        let sensor = Sensor {
            pattern,
            range: RangeLimits::default(),
            ring: RingOrder::Row,
            measurement: Default::default(),
        };
        let facts = SensorFacts::of(&sensor);
        assert_eq!(rounded(facts.horizontal_fov_deg), 90.0);
        assert_eq!(facts.elevation_deg.map(rounded), [-45.0, 45.0]);
        let step = 2.0 * libm::atan(0.5 / 320.0).to_degrees();
        assert!((facts.azimuth_step_deg.unwrap() - step).abs() < 1e-12);
        assert_eq!((facts.max_range_m, facts.points_per_second, facts.frame_s), (None, None, 0.0));
    }
}
