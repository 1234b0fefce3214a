//! Depth cameras that are not ideal, against closed forms. Each random check states its rate of error and has a fixed seed.

use std::f64::consts::TAU;

use beamcast::glam::DVec3;
use beamcast::physics::disparity::StereoPair;
use beamcast::physics::phasor::{Phasor, range_m};
use beamcast::scan::Echo;
use beamcast::scene::{Optics, SurfaceKind};
use beamcast::sensor::{
    AnalyticDisparity, DepthSensing, Measurement, SecondViewpoint, Stereo, StereoMethod, TimeOfFlight,
};
use beamcast::{Camera, Cause, Frame, Pattern, RangeLimits, Return, Scene, Sensor};

use super::plates::{Plate, cast, optics, scene, wall};

/// A camera of so many columns and rows whose focal length is `focal_px` pixels.
fn camera(size: (usize, usize), focal_px: f64, depth: DepthSensing) -> Sensor {
    let centre = (size.0 as f64 / 2.0, size.1 as f64 / 2.0);
    let camera = Camera::new(size, (focal_px, focal_px), centre, None).unwrap();
    let measurement = Measurement { depth: Some(depth), ..Measurement::default() };
    let range = RangeLimits { min_m: 0.05, ..RangeLimits::default() };
    Sensor { range, measurement, ..Sensor::new(Pattern::Camera(camera)) }
}

fn exact() -> AnalyticDisparity {
    AnalyticDisparity { sigma_px: 0.0, window_px: 1, inlier_px: 1.0, inlier_share: 0.3 }
}

fn stereo(baseline_m: f64, analytic: AnalyticDisparity) -> Stereo {
    Stereo {
        second: SecondViewpoint::Imager,
        baseline_m,
        first_disparity_px: 0,
        disparities: 4096,
        unit_px: 0.0,
        method: StereoMethod::Analytic(analytic),
    }
}

/// The return and the cause of each pixel, row by row.
fn pixels(frame: &Frame) -> Vec<(Cause, Option<(Return, Echo)>)> {
    (0..frame.pixels())
        .map(|pixel| {
            let slot = frame.slot(pixel, 0);
            let one = slot.map(|slot| (frame.returns().get(slot), *frame.echo(slot).unwrap()));
            (frame.causes()[pixel], one)
        })
        .collect()
}

/// The depth of each pixel of a camera with this focal length; `NAN` without a return.
fn depths_m(frame: &Frame, focal_px: f64) -> Vec<f64> {
    let (columns, rows) = (frame.columns(), frame.rows());
    let offset = |index: usize, count: usize| (index as f64 + 0.5 - count as f64 / 2.0) / focal_px;
    let ratio = |pixel: usize| {
        let (x, y) = (offset(pixel % columns, columns), offset(pixel / columns, rows));
        1.0 / (1.0 + x * x + y * y).sqrt()
    };
    let depth =
        |(pixel, one): (usize, Option<Return>)| one.map_or(f64::NAN, |one| one.range_m * ratio(pixel));
    frame.first_returns().enumerate().map(depth).collect()
}

/// A plane at Z has the noise σ_Z = Z²·σ/(f·b) and, to the first order, no bias.
#[test]
fn a_plane_has_the_noise_of_its_depth() {
    let (focal_px, sigma_px) = (430.14, 0.08);
    let sensing = stereo(0.05015, AnalyticDisparity { sigma_px, ..exact() });
    let rig = StereoPair { focal_px, baseline_m: 0.05015 };
    for z in [0.5, 1.0, 2.0, 4.0] {
        let frame = cast(
            &scene(&[wall(z, 0.5)]),
            &camera((500, 200), focal_px, DepthSensing::Stereo(sensing.clone())),
            3,
        );
        let found: Vec<f64> = depths_m(&frame, focal_px).into_iter().filter(|z| !z.is_nan()).collect();
        // A disparity of d pixels leaves the first d columns without a partner in the second image.
        let d = rig.disparity_px(z);
        let blind = (d - 0.5).ceil() as usize;
        assert_eq!(found.len(), (500 - blind) * 200);
        let n = found.len() as f64;
        // Z = f·b/d has the mean Z·(1 + s² + 3s⁴ + …) and the deviation Z·s·(1 + 4s² + …) with s = σ/d.
        let s = sigma_px / d;
        let mean = found.iter().sum::<f64>() / n;
        let sigma = (found.iter().map(|f| (f - mean) * (f - mean)).sum::<f64>() / n).sqrt();
        let expected = z * z * sigma_px / (focal_px * rig.baseline_m);
        // ±4σ: an error once in 16,000.
        assert!((mean - z * (1.0 + s * s)).abs() < 4.0 * expected / n.sqrt(), "{z}: {mean}");
        let off = (sigma / (expected * (1.0 + 4.0 * s * s)) - 1.0).abs();
        assert!(off < 4.0 / (2.0 * n).sqrt(), "{z}: {sigma} instead of {expected}");
    }
}

/// Left of a near plate's left edge, f·b·(1/Z1 − 1/Z2) pixels of the far wall are hidden from the right imager; with the imager on the
/// left, the strip is on the right.
#[test]
fn the_far_side_of_an_edge_is_half_occluded() {
    let (focal_px, near_m, far_m) = (400.0, 1.0, 3.0);
    let plate = Plate(DVec3::new(near_m, 0.0, 0.0), DVec3::Y * 0.1, DVec3::Z * 9.0, 0.5);
    let scene = scene(&[wall(far_m, 0.5), plate]);
    for baseline_m in [0.05, -0.05, 0.0731] {
        for second in [SecondViewpoint::Imager, SecondViewpoint::Projector] {
            let sensing = Stereo { second, ..stereo(baseline_m, exact()) };
            let frame = cast(&scene, &camera((400, 2), focal_px, DepthSensing::Stereo(sensing)), 0);
            let causes = &frame.causes()[..400];
            let width = StereoPair { focal_px, baseline_m: f64::abs(baseline_m) }.occlusion_px(near_m, far_m);
            let plate = 160..240;
            assert!(causes[plate.clone()].iter().all(|cause| *cause == Cause::Surface));
            // A pixel counts where its middle lies in the strip. It is whole pixels wide, so it is off by less than one.
            let beside = |right: bool| {
                let of = if right {
                    &causes[plate.end..plate.end + 60]
                } else {
                    &causes[plate.start - 60..plate.start]
                };
                of.iter().filter(|cause| **cause == Cause::Occluded).count() as f64
            };
            let (left, right) = (beside(false), beside(true));
            let (hidden, free) = if baseline_m > 0.0 { (left, right) } else { (right, left) };
            assert!((hidden - width).abs() < 1.0, "{baseline_m}: {hidden} of {width}");
            assert_eq!(free, 0.0);
        }
    }
}

/// Disparities are whole multiples of the unit, and the budget of each range adds up.
#[test]
fn disparities_are_rounded_to_their_unit() {
    let (focal_px, baseline_m, unit_px) = (580.0, 0.075, 0.125);
    let analytic = AnalyticDisparity { sigma_px: 0.0208, ..exact() };
    let sensing = Stereo { unit_px, second: SecondViewpoint::Projector, ..stereo(baseline_m, analytic) };
    let frame =
        cast(&scene(&[wall(2.5, 0.5)]), &camera((80, 60), focal_px, DepthSensing::Stereo(sensing)), 0);
    for ((cause, one), z) in pixels(&frame).into_iter().zip(depths_m(&frame, focal_px)) {
        let (one, echo) = one.unwrap();
        assert_eq!((cause, echo.cause), (Cause::Surface, Cause::Surface));
        let steps = focal_px * baseline_m / z / unit_px;
        // The quotient of numbers around 140 is exact to a few of their roundings.
        assert!((steps - steps.round()).abs() < 1e-11, "{steps}");
        let sum = echo.terms.unrounded_m() + echo.terms.rounding_m;
        assert!((sum - one.range_m).abs() < 1e-9);
    }
}

/// What is nearer than f·b over the largest disparity is too near, and what is beyond the least disparity is too far.
#[test]
fn the_search_limits_depth() {
    let focal_px = 400.0;
    let sensing = Stereo { first_disparity_px: 4, disparities: 60, ..stereo(0.05, exact()) };
    let found = |z: f64| {
        let frame = cast(
            &scene(&[wall(z, 0.5)]),
            &camera((200, 1), focal_px, DepthSensing::Stereo(sensing.clone())),
            0,
        );
        frame.causes()[150]
    };
    // f·b = 20 m·px: disparities of 4 to less than 64 px are depths from more than .3125 m to 5 m.
    assert_eq!(
        [0.3124, 0.3126, 4.99, 5.01].map(found),
        [Cause::TooNear, Cause::Surface, Cause::Surface, Cause::OutOfRange]
    );
}

/// The corner of a wall keeps a window's share: a pixel in the middle of a surface has all of it, one at its corner a quarter.
#[test]
fn a_window_needs_its_share() {
    let plate = Plate(DVec3::new(1.0, 0.0, 0.0), DVec3::Y * 0.1, DVec3::Z * 0.1, 0.5);
    let scene = scene(&[wall(3.0, 0.5), plate]);
    let analytic = AnalyticDisparity { window_px: 9, inlier_share: 0.35, ..exact() };
    let sensing = Stereo { second: SecondViewpoint::Projector, ..stereo(0.05, analytic) };
    let frame = cast(&scene, &camera((200, 200), 400.0, DepthSensing::Stereo(sensing)), 0);
    // The plate has the columns and rows from 60 to 140. The window at its corner has 5 × 5 pixels of the plate, 31 % of it, and
    // that in the middle of an edge 5 × 9.
    let at = |row: usize, column: usize| frame.causes()[row * 200 + column];
    assert_eq!([at(60, 60), at(60, 100), at(100, 100)], [Cause::Ambiguous, Cause::Surface, Cause::Surface]);
}

/// A time-of-flight camera of these frequencies with much light, one sub-ray, and nothing else.
pub(super) fn time_of_flight(frequencies_mhz: &[f64]) -> TimeOfFlight {
    TimeOfFlight {
        frequencies_hz: frequencies_mhz.iter().map(|mhz| mhz * 1e6).collect(),
        wavelength_m: 850e-9,
        electrons_at_1_m: 1e7,
        contrast: 0.8,
        sun_electrons: 0.0,
        read_noise: 0.0,
        full_well: f64::INFINITY,
        taps: 4,
        samples: 1,
        indirect_rays: 0,
        bounces: 1,
        third_harmonic: 0.0,
        least_amplitude: 0.0,
        exposure_s: 0.0,
        disagreement_m: f64::INFINITY,
    }
}

fn lambert(reflectance: f64) -> Optics {
    Optics { reflectance: Some(reflectance), kind: Some(SurfaceKind::Lambert), ..Optics::default() }
}

/// A plane's range has the noise σ_d = c·√(2/N)/(m·4πf), with N electrons in all taps and the contrast m.
#[test]
fn the_noise_of_a_phase_follows_from_its_electrons() {
    for (mhz, electrons_at_1_m, z) in [(20.0, 4e4, 2.0), (80.0, 1e6, 1.5), (100.0, 1e5, 1.0)] {
        let sensing = TimeOfFlight { electrons_at_1_m, ..time_of_flight(&[mhz]) };
        let scene = optics(scene(&[wall(z, 0.5)]), &[lambert(0.5)]);
        // The image is a narrow cone, so all pixels have the same light.
        let focal_px = 1e5;
        let frame = cast(&scene, &camera((200, 100), focal_px, DepthSensing::TimeOfFlight(sensing)), 1);
        let found = depths_m(&frame, focal_px);
        let n = found.len() as f64;
        let electrons = electrons_at_1_m * 0.5 / (z * z);
        let expected = range_m((2.0 / electrons).sqrt() / 0.8, mhz * 1e6);
        let mean = found.iter().sum::<f64>() / n;
        let sigma = (found.iter().map(|f| (f - mean) * (f - mean)).sum::<f64>() / n).sqrt();
        // ±4σ: an error once in 16,000. The angle of a noisy phasor is off the first order by σ_φ² at most.
        let second_order = 2.0 / electrons / 0.64;
        assert!((mean - z).abs() < 4.0 * expected / n.sqrt(), "{mhz} MHz: {mean}");
        assert!(
            (sigma / expected - 1.0).abs() < 4.0 / (2.0 * n).sqrt() + second_order,
            "{mhz} MHz: {sigma} and {expected}"
        );
    }
}

/// A pixel with the share q of a surface at 1 m and the rest of one at 2 m lies between them where two phasors add up.
#[test]
fn a_pixel_on_an_edge_flies_between_the_surfaces() {
    // The ranges of two phasors, which were computed on their own: (q, 20 MHz, 60 MHz).
    let table = [(0.25, 1.4242, 1.3349), (0.5, 1.1884, 1.0723), (0.75, 1.0699, 1.0208)];
    // Four columns of sub-rays, of which the plate at 1 m covers 1, 2 or 3. The camera is so narrow that all rays are parallel.
    let focal_px = 1e6;
    for (columns, (q, low, high)) in (1..).zip(table) {
        let edge = (f64::from(columns) / 4.0 - 0.5) / focal_px;
        // The image's left is +y: the plate covers all that is left of the edge.
        let plate = Plate(DVec3::new(1.0, 1.0 - edge, 0.0), DVec3::Y, DVec3::Z * 9.0, 0.5);
        let scene = optics(scene(&[wall(2.0, 0.5), plate]), &[lambert(0.5), lambert(0.5)]);
        for (mhz, expected) in [(20.0, low), (60.0, high)] {
            let sensing = TimeOfFlight { samples: 4, electrons_at_1_m: 1e16, ..time_of_flight(&[mhz]) };
            let frame = cast(&scene, &camera((1, 1), focal_px, DepthSensing::TimeOfFlight(sensing)), 0);
            let (cause, one) = pixels(&frame)[0];
            let (one, echo) = one.unwrap();
            assert_eq!((cause, echo.cause), (Cause::Mixed, Cause::Mixed));
            // Half of the table's last digit, and the noise of 10¹⁵ electrons, 10⁻⁷ m.
            assert!((one.range_m - expected).abs() < 5.1e-5, "q = {q}, {mhz} MHz: {}", one.range_m);
            let phasor = |share: f64, z: f64| Phasor::of_path(share / (z * z), 2.0 * z, mhz * 1e6);
            let sum = phasor(q, 1.0) + phasor(1.0 - q, 2.0);
            assert!((one.range_m - range_m(sum.phase(), mhz * 1e6)).abs() < 1e-6);
        }
    }
    // Where the frequencies disagree the camera drops the pixel.
    let plate = Plate(DVec3::new(1.0, 1.0, 0.0), DVec3::Y, DVec3::Z * 9.0, 0.5);
    let scene = optics(scene(&[wall(2.0, 0.5), plate]), &[lambert(0.5), lambert(0.5)]);
    let sensing = TimeOfFlight { samples: 4, disagreement_m: 0.05, ..time_of_flight(&[20.0, 60.0]) };
    let frame = cast(&scene, &camera((1, 1), focal_px, DepthSensing::TimeOfFlight(sensing)), 0);
    assert_eq!(frame.causes()[0], Cause::Ambiguous);
}

/// Light by way of the other wall makes a corner look rounder. Errors by one other surface were computed on their own, by quadrature;
/// those by up to two are of a path tracer that shares no code (mitransient 1.3.1 on Mitsuba 3.9.1), ± 0.03 mm.
#[test]
fn a_corner_is_bent_by_indirect_light() {
    /// The distance of the camera from the corner's edge, on the diagonal, in metres.
    const AWAY_M: f64 = 1.5;
    const ONE: [f64; 5] = [20.0, 50.0, 100.0, 120.0, 200.0];
    const TWO: [f64; 2] = [20.0, 100.0];
    /// The bounces, the reflectance, the distance of the point from the edge, frequencies in MHz, and the errors there in millimetres.
    type Row = (u32, f64, f64, &'static [f64], &'static [f64]);
    let table: [Row; 7] = [
        (1, 0.8, 0.1, &ONE, &[34.09, 33.76, 32.59, 31.91, 28.18]),
        (1, 0.8, 0.3, &ONE, &[53.95, 52.35, 46.48, 42.91, 21.76]),
        (1, 0.8, 0.5, &ONE, &[48.64, 45.00, 31.98, 24.63, -4.78]),
        (1, 0.5, 0.3, &ONE, &[36.32, 34.98, 30.23, 27.47, 12.88]),
        (2, 0.8, 0.1, &TWO, &[51.85, 45.81]),
        (2, 0.8, 0.5, &TWO, &[59.94, 33.28]),
        (2, 0.5, 0.3, &TWO, &[43.67, 33.14]),
    ];
    let half = std::f64::consts::FRAC_1_SQRT_2;
    for (bounces, rho, s, frequencies_mhz, errors_mm) in table {
        // The camera looks along x from the origin; both walls are a metre wide and high, and meet at AWAY_M.
        let edge = DVec3::new(AWAY_M, 0.0, 0.0);
        let along = |side: f64| DVec3::new(-half, side * half, 0.0);
        let plate =
            |side: f64| Plate(edge + 0.5 * along(side), 0.5 * along(side), DVec3::Z * 0.5, rho as f32);
        let scene = optics(scene(&[plate(1.0), plate(-1.0)]), &[lambert(rho), lambert(rho)]);
        let point = edge + s * along(1.0);
        for (&mhz, &error_mm) in frequencies_mhz.iter().zip(errors_mm) {
            let sensing = TimeOfFlight {
                electrons_at_1_m: 1e16,
                indirect_rays: 1024,
                bounces,
                ..time_of_flight(&[mhz])
            };
            // A narrow image about the point. Each pixel has directions of its own, so the pixels are as many samples.
            let focal_px = 1e7;
            let mut sensor = camera((16, 16), focal_px, DepthSensing::TimeOfFlight(sensing));
            let centre = (8.0 + focal_px * point.y / point.x, 8.0);
            sensor.pattern =
                Pattern::Camera(Camera::new((16, 16), (focal_px, focal_px), centre, None).unwrap());
            let frame = cast(&scene, &sensor, 0);
            // One frequency tells ranges only up to multiples of c/(2f).
            let repeats_mm = range_m(TAU, mhz * 1e6) * 1e3;
            let errors: Vec<f64> = pixels(&frame)
                .into_iter()
                .map(|(_, one)| {
                    let (one, echo) = one.unwrap();
                    let error_mm = (one.range_m - echo.terms.ideal_m) * 1e3;
                    error_mm - repeats_mm * (error_mm / repeats_mm).round()
                })
                .collect();
            let n = errors.len() as f64;
            let mean = errors.iter().sum::<f64>() / n;
            let sigma = (errors.iter().map(|e| (e - mean) * (e - mean)).sum::<f64>() / n).sqrt();
            // Three standard errors of both, and half of the table's last digit.
            let of_table = if bounces == 1 { 0.0 } else { 0.03 };
            let most = 3.0 * (sigma * sigma / n + of_table * of_table).sqrt() + 0.005;
            assert!(most < if bounces == 1 { 0.15 } else { 0.4 }, "{most} mm is too wide a bound");
            assert!(
                (mean - error_mm).abs() < most,
                "{bounces} bounces, ρ = {rho}, s = {s}, {mhz} MHz: {mean} ± {most}, not {error_mm}"
            );
        }
    }
}

/// Three frequencies tell all depths up to c/(2·gcd) apart.
#[test]
fn frequencies_unwrap_each_other() {
    let sensing = time_of_flight(&[16.0, 80.0, 120.0]);
    for z in (1..=30).map(|i| 0.5 * f64::from(i)) {
        let frame = cast(
            &scene(&[wall(z, 0.5)]),
            &camera((8, 8), 1e4, DepthSensing::TimeOfFlight(sensing.clone())),
            0,
        );
        // 10⁷ electrons at 1 m are 2·10⁴ at 15 m: σ is 1.5 mm, so 10 mm is six of it.
        assert!(depths_m(&frame, 1e4).into_iter().all(|found| (found - z).abs() < 0.01), "{z}");
    }
}

/// Little light has no depth, and much light fills the pixel.
#[test]
fn too_little_and_too_much_light_have_no_depth() {
    let found = |z: f64| {
        let sensing = TimeOfFlight {
            electrons_at_1_m: 1e5,
            least_amplitude: 50.0,
            full_well: 1e5,
            ..time_of_flight(&[80.0])
        };
        let scene: Scene = optics(scene(&[wall(z, 0.5)]), &[lambert(0.5)]);
        let frame = cast(&scene, &camera((1, 1), 1e4, DepthSensing::TimeOfFlight(sensing)), 0);
        frame.causes()[0]
    };
    // A plane of ½ at z has 5·10⁴/z² electrons in all taps, and a quarter of that, times the contrast, as amplitude.
    assert_eq!([0.2, 1.0, 50.0].map(found), [Cause::Saturated, Cause::Surface, Cause::BelowThreshold]);
}

/// Any number of threads gives the same frame.
#[test]
fn depth_cameras_do_not_depend_on_threads() {
    let plate = Plate(DVec3::new(1.0, 0.0, 0.0), DVec3::Y * 0.1, DVec3::Z * 0.1, 0.5);
    let scene = scene(&[wall(3.0, 0.5), plate]);
    let analytic = AnalyticDisparity { sigma_px: 0.1, window_px: 5, ..exact() };
    let tof = TimeOfFlight { samples: 2, indirect_rays: 3, ..time_of_flight(&[20.0, 100.0]) };
    for sensing in [DepthSensing::Stereo(stereo(0.05, analytic)), DepthSensing::TimeOfFlight(tof)] {
        let sensor = camera((83, 41), 100.0, sensing);
        let of_threads = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| cast(&scene, &sensor, 5))
        };
        let one = of_threads(1);
        assert!(one.return_count() > 1000);
        assert!([2, 5].into_iter().all(|threads| of_threads(threads) == one));
    }
}
