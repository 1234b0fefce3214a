//! Depth cameras: the field of view or the intrinsics that their makers state, through a pinhole, and what `[nominal]` makes of them.

use beamcast::Sensor;
use beamcast::run::facts::DepthFacts;
use beamcast::sensor::{DepthSensing, StereoMethod};
use glam::DVec3;

use super::{Errors, Shot, TruePulse, Truth};

const ALLOWED: Errors = Errors { angle_deg: 1e-9, time_ns: 1e-3, place_mm: 1e-6 };

pub fn truths() -> Vec<Truth> {
    let lens = "the lens: an ideal pinhole";
    vec![
        field("azure/kinect", [640, 576], [75.0, 65.0], "Azure Kinect DK hardware specifications", lens),
        field("kinect/v1", [640, 480], [57.0, 43.0], "data sheet", lens),
        kinect_v2(),
        field("realsense/d415", [1280, 720], [65.0, 40.0], "D400 data sheet", lens),
        field("realsense/d435", [848, 480], [87.0, 58.0], "D400 data sheet", lens),
        field("realsense/d455", [1280, 720], [87.0, 58.0], "D400 data sheet", lens),
        square("luxonis/oak-d", [1280, 800], 882.5, "Luxonis' documentation", lens),
        zed_2(),
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

/// A pinhole with square pixels and its principal point in the middle of the image.
fn square(
    preset: &'static str,
    size: [usize; 2],
    focal_px: f64,
    source: &'static str,
    nominal: &'static str,
) -> Truth {
    let [middle_x, middle_y] = size.map(|pixels| pixels as f64 / 2.0);
    let shots = shots(size, |u, v| [(u - middle_x) / focal_px, (v - middle_y) / focal_px]);
    Truth { preset, mode: None, source, nominal, allowed: ALLOWED, shots }
}

/// The maker's vertical field, and a row each line time. The preset's focal length f has five digits, so it is off by up to 0.005 px. A
/// ray at the angle θ then turns by 0.005·sin 2θ/(2f), at most 2.8e-4 degrees, which is 0.01 mm at 2 m.
fn zed_2() -> Truth {
    let size = [1280, 720];
    let focal_px = 360.0 / libm::tan(70f64.to_radians() / 2.0);
    let mut truth = square(
        "stereolabs/zed-2",
        size,
        focal_px,
        "Stereolabs' documentation: field and line times",
        "the horizontal field: square pixels",
    );
    for shot in &mut truth.shots {
        if let Some(pulse) = &mut shot.pulse {
            pulse.time_s = Some(shot.row as f64 * 15.7e-6);
        }
    }
    truth.allowed = Errors { angle_deg: 2.8e-4, place_mm: 0.01, ..ALLOWED };
    truth
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

/// A preset in one of its modes with `nominal = true`.
fn nominal(preset: &str, mode: &str) -> Sensor {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("job.toml");
    let sensor = format!("name = 's'\npreset = '{preset}'\nmode = '{mode}'\nnominal = true\n");
    std::fs::write(&path, format!("scene = 'a.glb'\noutput.dir = 'o'\n[[sensor]]\n{sensor}")).unwrap();
    beamcast::config::load_job(&path, &[]).unwrap_or_else(|e| panic!("{preset}: {e}")).sensors[0]
        .sensor
        .clone()
}

/// The baselines, numbers of disparities and steps of the sources. In each mode the search reaches to the least depth of the range.
#[test]
fn nominal_stereo_cameras_search_to_their_least_depth() {
    for (preset, modes, baseline_m, disparities, unit_px, is_active) in [
        ("realsense/d415", &["1280x720", "848x480"][..], 0.055, 126, 1.0 / 32.0, true),
        ("realsense/d435", &["848x480", "1280x720"][..], 0.05015, 126, 1.0 / 32.0, true),
        ("realsense/d455", &["1280x720", "848x480"][..], 0.095, 126, 1.0 / 32.0, true),
        ("luxonis/oak-d", &["800p", "400p"][..], 0.075, 95, 1.0 / 8.0, false),
        ("stereolabs/zed-2", &["hd720", "hd2k", "hd1080", "vga"][..], 0.12, 206, 0.0, false),
    ] {
        for mode in modes {
            let sensor = nominal(preset, mode);
            let Some(DepthSensing::Stereo(stereo)) = &sensor.measurement.depth else {
                panic!("{preset} is no stereo camera");
            };
            let found = (stereo.baseline_m, stereo.disparities, stereo.unit_px);
            assert_eq!(found, (baseline_m, disparities, unit_px), "{preset}, {mode}");
            let StereoMethod::Match(matching) = &stereo.method else { panic!("{preset} matches no images") };
            assert_eq!(matching.projector.is_some(), is_active, "{preset}, {mode}");
            let least_m = DepthFacts::of(&sensor, true).unwrap().least_depth_m.unwrap();
            assert!(least_m <= sensor.range.min_m, "{preset}, {mode}: {least_m} m");
        }
    }
}

/// Khoshelham's and Elberink's noise of a Kinect: σ_Z = 1.425e-3·Z² in metres, of which steps of 1/8 px at f·b = 43.5 px·m have their
/// part, Z²/(8·43.5·√12). The preset's figures have three digits: f·b is off by up to 1/1476 and σ by up to 1/1008, of which the root of
/// the squares' sum takes two thirds.
#[test]
fn a_nominal_kinect_has_the_noise_that_was_measured() {
    for mode in ["default", "near"] {
        let sensor = nominal("kinect/v1", mode);
        for sigma in DepthFacts::of(&sensor, true).unwrap().depth_sigmas {
            let square = sigma.range_m * sigma.range_m;
            let step_m = square / (8.0 * 43.5 * 12f64.sqrt());
            let ratio = (sigma.sigma_m * sigma.sigma_m + step_m * step_m).sqrt() / (1.425e-3 * square);
            assert!((ratio - 1.0).abs() < 2.0 / 1476.0, "{ratio}");
        }
    }
}

/// Corti's 1.5 mm of a Kinect v2 at its best, with electrons of three digits: half of the last one is 1/1338 of them, and 1/2676 of σ.
#[test]
fn a_nominal_time_of_flight_kinect_has_its_best_noise_at_1_m() {
    let facts = DepthFacts::of(&sensor_with_nominal("kinect/v2"), true).unwrap();
    assert!((facts.depth_sigmas[0].sigma_m / 0.0015 - 1.0).abs() < 1.0 / 2676.0, "{:?}", facts.depth_sigmas);
    // c/(2·8 MHz), up to which Järemo Lawin unwraps its phases.
    assert!((facts.unambiguous_range_m.unwrap() - 18.75).abs() < 0.02);
}

/// A preset without modes as its data sheet says.
fn sensor_with_nominal(preset: &str) -> Sensor {
    let file = beamcast::config::load_preset(preset).unwrap();
    Sensor { measurement: file.nominal.unwrap().measurement, ..file.sensor }
}

/// Microsoft's limit of the random error, 17 mm, holds in each mode at the end of its range for its darkest surface, 15 %.
#[test]
fn a_nominal_azure_kinect_keeps_its_limit_in_all_modes() {
    for mode in ["nfov_unbinned", "nfov_binned", "wfov_binned", "wfov_unbinned"] {
        let sensor = nominal("azure/kinect", mode);
        let Some(DepthSensing::TimeOfFlight(sensing)) = &sensor.measurement.depth else {
            panic!("the Azure Kinect measures phases");
        };
        let end_m = sensor.range.max_m;
        let electrons = 0.15 * sensing.electrons_at_1_m / (end_m * end_m);
        // Their number has three digits.
        assert!((electrons / 1000.0 - 1.0).abs() < 0.5 / 326.0, "{mode}: {electrons}");
        // σ at 1 m on 80 % goes with the range and with one over the root of the reflectance.
        let at_1_m = DepthFacts::of(&sensor, true).unwrap().depth_sigmas[0].sigma_m;
        let sigma_m = at_1_m * end_m * (0.8 / 0.15_f64).sqrt();
        assert!(sigma_m < 0.017, "{mode}: {sigma_m}");
        // c·√(2/1000)/(0.87·4π·√3·200 MHz), to the digits of the electrons and the spread of the frequencies, (10/200)²·2/3.
        assert!((sigma_m / 0.00354 - 1.0).abs() < 0.003, "{mode}: {sigma_m}");
    }
}
