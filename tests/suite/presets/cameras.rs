//! Depth cameras: the field of view or the intrinsics that their makers state, through a pinhole.

use glam::DVec3;

use super::{Errors, Shot, TruePulse, Truth};

const ALLOWED: Errors = Errors { angle_deg: 1e-9, time_ns: 1e-3, place_mm: 1e-6 };

pub fn truths() -> Vec<Truth> {
    let lens = "the lens: an ideal pinhole";
    vec![
        field("azure/kinect", [640, 576], [75.0, 65.0], "Azure Kinect DK hardware specifications", lens),
        field("kinect/v1", [640, 480], [57.0, 43.0], "data sheet", lens),
        kinect_v2(),
        field("realsense/d435", [848, 480], [87.0, 58.0], "D400 data sheet", lens),
    ]
}

/// Shots of some pixels, whose point in the image plane of focal length 1 is given: x to the right, y down.
fn shots([width, height]: [usize; 2], image: impl Fn(f64, f64) -> [f64; 2]) -> Vec<Shot> {
    let places = |side: usize| [0, 1, side / 3, side / 2, side - 1];
    let pixels = places(height).into_iter().flat_map(|row| places(width).map(|column| (row, column)));
    pixels
        .map(|(row, column)| {
            let [x, y] = image(column as f64 + 0.5, row as f64 + 0.5);
            let towards = DVec3::new(1.0, -x, -y).normalize();
            let point: super::Place = Box::new(move |range| towards * range);
            Shot { row, column, pulse: Some(TruePulse { time_s: Some(0.0), ring: None, point }) }
        })
        .collect()
}

/// A pinhole whose image spans the field of view from edge to edge.
fn field(
    preset: &'static str,
    size: [usize; 2],
    field_deg: [f64; 2],
    source: &'static str,
    nominal: &'static str,
) -> Truth {
    let [half_x, half_y] = field_deg.map(|field| libm::tan(field.to_radians() / 2.0));
    let shots = shots(size, |u, v| {
        [half_x * (2.0 * u / size[0] as f64 - 1.0), half_y * (2.0 * v / size[1] as f64 - 1.0)]
    });
    Truth { preset, mode: None, source, nominal, allowed: ALLOWED, shots }
}

/// One unit's intrinsics. A fixed point of x = (xd − …)/(1 + k1·r² + k2·r⁴ + k3·r⁶) undoes the distortion.
fn kinect_v2() -> Truth {
    let (f, cx, cy, [k1, k2, k3]) = (365.456, 254.878, 205.395, [0.0905, -0.2682, 0.0951]);
    let shots = shots([512, 424], |u, v| {
        let distorted = [(u - cx) / f, (v - cy) / f];
        let mut image = distorted;
        for _ in 0..200 {
            let r2 = image[0] * image[0] + image[1] * image[1];
            let factor = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
            image = distorted.map(|x| x / factor);
        }
        image
    });
    let nominal = "one unit's calibration";
    Truth {
        preset: "kinect/v2",
        mode: None,
        source: "a published calibration of a unit",
        nominal,
        allowed: ALLOWED,
        shots,
    }
}

/// Microsoft's table of modes: pixels, field of view in degrees, frames a second, and the operating range in metres.
#[test]
fn kinects_have_the_modes_of_their_tables() {
    let folder = tempfile::tempdir().unwrap();
    let sensor = |preset: &str, mode: &str| {
        let path = folder.path().join("job.toml");
        let job = format!(
            "scene = 'a.glb'\noutput.dir = 'o'\n[[sensor]]\nname = 's'\npreset = '{preset}'\nmode = '{mode}'\n"
        );
        std::fs::write(&path, job).unwrap();
        beamcast::config::load_job(&path, &[]).unwrap().sensors[0].sensor.clone()
    };
    for (mode, width, height, field_deg, rate_hz, min_m, max_m) in [
        ("nfov_unbinned", 640, 576, 75.0, 30.0, 0.5, 3.86),
        ("nfov_binned", 320, 288, 75.0, 30.0, 0.5, 5.46),
        ("wfov_binned", 512, 512, 120.0, 30.0, 0.25, 2.88),
        ("wfov_unbinned", 1024, 1024, 120.0, 15.0, 0.25, 2.21),
    ] {
        let sensor = sensor("azure/kinect", mode);
        let facts = beamcast::sensor::facts::SensorFacts::of(&sensor);
        assert_eq!((facts.columns, facts.rows, facts.rate_hz), (width, height, Some(rate_hz)), "{mode}");
        assert!((facts.horizontal_fov_deg - field_deg).abs() < 1e-9, "{mode}: {}", facts.horizontal_fov_deg);
        assert_eq!((facts.min_range_m, facts.max_range_m), (min_m, Some(max_m)), "{mode}");
    }
    let near = sensor("kinect/v1", "near").range;
    assert_eq!((near.min_m, near.max_m), (0.4, 3.0));
}
