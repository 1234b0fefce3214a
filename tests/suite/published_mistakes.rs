//! Mistakes that published simulators make, which `docs/mistakes.md` lists: a test for each that no other test holds already.

use beamcast::glam::{DAffine3, DMat3, DVec3};
use beamcast::physics::detection::normal_below;
use beamcast::physics::echo::pulse_sigma_m;
use beamcast::physics::footprint::Samples;
use beamcast::scan::Echo;
use beamcast::scene::{SurfaceKind, Weather};
use beamcast::sensor::{Beam, Footprint, Measurement, Noise, Receiver, ReturnMode, Rotating};
use beamcast::{Angle, Cause, Pattern, Pose, RangeLimits, Return, Scene, Sensor};

use super::plates::{
    Plate, cast, kind, lambert, one_return, optics, power, receiver, returns, round, scene, sensor, wall,
    with,
};
use super::shapes::{placed, quad};

/// A receiver that reports all that it detects, and nothing else.
fn all_returns() -> Receiver {
    Receiver { returns: ReturnMode::Several(8), false_alarm: 0.0, ..receiver() }
}

/// A plate of 10 m × 10 m whose middle is at a range on the x axis, tilted about an axis at a right angle to x.
fn tilted(range_m: f64, tilt_deg: f64, about: DVec3) -> Plate {
    let (sin, cos) = libm::sincos(tilt_deg.to_radians());
    Plate(DVec3::X * range_m, (DVec3::X * sin + about.cross(DVec3::X) * cos) * 5.0, about * 5.0, 1.0)
}

/// The only return of a beam along x, by a receiver without noise.
fn seen_by(scene: &Scene, footprint: Option<Footprint>) -> (Return, Echo) {
    let sensor = sensor(1, Measurement { footprint, ..with(all_returns()) });
    let found = returns(&cast(scene, &Sensor { range: RangeLimits::default(), ..sensor }, 0));
    assert_eq!(found.len(), 1, "{found:?}");
    found[0]
}

/// Two of 19 sub-rays meet a plate at 10 m, each four times as bright as those 17 that go on to a wall of the same material at 20 m.
/// The wall is the strongest return, by 17/400 to 2/100, and also the last, so the plate is the second strongest.
#[test]
fn the_strongest_return_is_that_of_the_most_light_and_not_of_the_brightest_sub_ray() {
    let w = 0.05;
    let footprint = round(2.0 * libm::atan(w / 10.0), Samples::Nineteen);
    let beside = 0.7 * w;
    assert_eq!(Samples::Nineteen.places().iter().filter(|[y, _]| y * w > beside).count(), 2);
    let plate = Plate(DVec3::new(10.0, 5.0 + beside, 0.0), DVec3::Y * 5.0, DVec3::Z * 5.0, 1.0);
    let scene = optics(scene(&[plate, wall(20.0, 1.0)]), &[lambert(0.5), lambert(0.5)]);
    let by = |mode: ReturnMode| {
        let receiver = Receiver { returns: mode, ..all_returns() };
        returns(&cast(&scene, &sensor(1, Measurement { footprint, ..with(receiver) }), 0))
    };
    let objects = |found: &[(Return, Echo)]| found.iter().map(|(one, _)| one.instance).collect::<Vec<_>>();
    assert_eq!(objects(&by(ReturnMode::Strongest)), [1]);
    let dual = by(ReturnMode::Dual);
    assert_eq!(objects(&dual), [1, 0]);
    let ratio = f64::from(dual[1].1.snr) / f64::from(dual[0].1.snr);
    // A sub-ray at the beam's rim is longer than the range by (w/R)²/2, and its cosine smaller by as much: three times that.
    let rim = 1.5 * w * w / 100.0;
    assert!((ratio / ((2.0 / 100.0) / (17.0 / 400.0)) - 1.0).abs() < rim + 1e-6, "{ratio}");
}

/// A wall whose sub-rays are all alike is one return with all of the light, and leaves no second one.
#[test]
fn sub_rays_that_are_alike_are_one_return() {
    let scene = optics(scene(&[wall(20.0, 1.0)]), &[lambert(0.5)]);
    for samples in [Samples::One, Samples::Seven, Samples::Nineteen, Samples::ThirtySeven] {
        let (_, echo) = seen_by(&scene, round(1e-3, samples));
        let received = f64::from(echo.snr) / receiver().snr(1.0, 1.0, f64::INFINITY);
        // The beam's rim is half a milliradian off its axis, so its power is lower by three halves of the square of that.
        assert!((received / (0.5 / 400.0) - 1.0).abs() < 1e-6, "{samples:?}: {received}");
    }
}

/// Fog takes a share of the light, and rain takes a share of what is left: P(both)·P(clear) = P(fog)·P(rain).
#[test]
fn extinctions_multiply() {
    let at_50_m = |visibility_m: Option<f64>, rain_mm_h: f64| {
        let mut scene = optics(scene(&[wall(50.0, 1.0)]), &[lambert(0.5)]);
        scene.environment.weather = Some(Weather { visibility_m, rain_mm_h, ..Weather::default() });
        let found = returns(&cast(&scene, &sensor(1, with(all_returns())), 0));
        power(&found.iter().find(|(_, echo)| echo.cause == Cause::Surface).unwrap().1)
    };
    let [both, clear] = [at_50_m(Some(300.0), 50.0), at_50_m(None, 0.0)];
    let [in_fog, in_rain] = [at_50_m(Some(300.0), 0.0), at_50_m(None, 50.0)];
    assert!(in_fog < 0.5 * clear && in_rain < 0.7 * clear, "both are felt: {in_fog} {in_rain} {clear}");
    // Each of the four is an f32.
    assert!((both * clear / (in_fog * in_rain) - 1.0).abs() < 4.0 * f64::from(f32::EPSILON));
}

/// With a floor of 30 mm, a = .4 m and b = .5, the ranges of a plane that is seen at an SNR of 488 scatter by √(30² + 18.1²) mm, and not
/// by the square of that. Metres add nothing to the light.
#[test]
fn ranges_scatter_by_the_standard_deviation_that_is_asked_for() {
    let pulses = 10_000;
    let scene = optics(scene(&[wall(20.0, 1.0)]), &[lambert(0.5)]);
    let with_noise = |noise| {
        let measurement = Measurement { noise, ..with(all_returns()) };
        returns(&cast(&scene, &sensor(pulses, measurement), 0))
    };
    let noise = Noise { range_floor_m: 0.03, range_a_m: 0.4, range_b: 0.5, ..Noise::default() };
    let (noisy, clean) = (with_noise(Some(noise)), with_noise(None));
    assert_eq!((noisy.len(), clean.len()), (pulses, pulses));
    let n = pulses as f64;
    let off: Vec<f64> = noisy.iter().map(|(one, _)| one.range_m - 20.0).collect();
    let mean = off.iter().sum::<f64>() / n;
    let sigma = (off.iter().map(|o| (o - mean) * (o - mean)).sum::<f64>() / n).sqrt();
    let snr = receiver().snr(0.5, 20.0, 120.0);
    let expected = (0.03 * 0.03 + 0.4 * 0.4 / snr).sqrt();
    // Four standard errors, σ/√(2n). The noise of the SNR, a part in 488, moves the mean of 1/SNR by its square.
    assert!((sigma / expected - 1.0).abs() < 4.0 / (2.0 * n).sqrt() + 1e-5, "{sigma} {expected}");
    assert!(mean.abs() < 4.0 * expected / n.sqrt(), "{mean}");
    assert!(noisy.iter().zip(&clean).all(|(a, b)| (a.1.snr, a.0.intensity) == (b.1.snr, b.0.intensity)));
}

/// What stands still is as bright in one frame as in any other, and in all pulses of it, to the last bit.
#[test]
fn a_static_wall_is_as_bright_in_every_frame() {
    let scene = optics(scene(&[tilted(30.0, 40.0, DVec3::Z)]), &[lambert(0.3)]);
    let footprint = round(3e-3, Samples::ThirtySeven);
    let sensor = sensor(3, Measurement { footprint, ..with(Receiver::default()) });
    let of = |frame: u64| {
        let found = returns(&cast(&scene, &sensor, frame));
        found.iter().map(|(one, echo)| (one.intensity, echo.snr, one.range_m)).collect::<Vec<_>>()
    };
    let first = of(0);
    assert!(first.len() == 3 && first.iter().all(|one| *one == first[0] && one.0 > 0.0), "{first:?}");
    assert!((1..20).all(|frame| of(frame) == first));
}

/// Draws follow from a pulse's number and its frame's, not from its time: heads at 5 and at 20 Hz see a still scene alike, with all
/// noise on.
#[test]
fn the_rate_of_frames_changes_no_range() {
    let scene = optics(scene(&[wall(30.0, 1.0)]), &[lambert(0.4)]);
    let noise = Noise {
        range_floor_m: 0.02,
        range_a_m: 0.3,
        bias_m: 0.02,
        gain: 0.1,
        angle: Angle::deg(0.05),
        beam_angle: Angle::deg(0.05),
        ..Noise::default()
    };
    let receiver = Receiver { false_alarm: 1e-2, ..receiver() };
    let footprint = round(3e-3, Samples::Seven);
    let measurement = Measurement { footprint, noise: Some(noise), ..with(receiver) };
    let at = |rate_hz: f64| {
        let beams = [2.0, 0.0, -2.0].map(|elevation| Beam {
            elevation: Angle::deg(elevation),
            azimuth_offset: Angle::default(),
            time_s: 0.0,
            file_index: 0,
        });
        let turn = (Angle::deg(180.0), Angle::deg(-180.0));
        let pattern = Pattern::Rotating(Rotating::new(beams.to_vec(), 180, turn, rate_hz).unwrap());
        let range = RangeLimits { max_m: 120.0, ..RangeLimits::default() };
        let measurement = measurement.clone();
        returns(&cast(&scene, &Sensor { range, measurement, ..Sensor::new(pattern) }, 2))
    };
    let slow = at(5.0);
    assert!(slow.len() > 100, "{}", slow.len());
    assert!(slow == at(20.0));
}

/// A beam of .3 mrad has the radius w = 7.5 mm at 50 m and twice that at 100 m, and a plane that fills it dims by four from each range to
/// twice that range. On a plane at 60°, ranges spread by (w/2)·tan 60°, of which the width of the echo tells.
#[test]
fn a_beam_widens_and_a_plane_dims_with_range_as_a_cone_does() {
    let tan = libm::tan(60_f64.to_radians());
    for range_m in [25.0, 50.0, 100.0] {
        let scene = optics(scene(&[tilted(range_m, 60.0, DVec3::Z)]), &[lambert(0.8)]);
        let (_, echo) = seen_by(&scene, round(3e-4, Samples::ThirtySeven));
        let received = f64::from(echo.snr) / receiver().snr(1.0, 1.0, f64::INFINITY);
        let spread = 0.5 * range_m * 1.5e-4 * tan;
        // The spread lowers the peak by v/2σ², and its share of the range changes the mean of 1/R² by three times its square, 5e-8.
        let sigma_m = pulse_sigma_m(receiver().pulse_fwhm_s);
        let lower = 0.5 * spread * spread / (sigma_m * sigma_m);
        let expected = 0.8 * 0.5 / (range_m * range_m) * (1.0 - lower);
        // What is left out of the peak is of second order, of its height and of its cosine.
        assert!((received / expected - 1.0).abs() < lower * lower + 1e-6, "{range_m}: {received} {expected}");
        assert!(is_spread(&echo, spread), "{range_m}: {} {spread}", echo.width_m);
    }
}

/// Whether the width of an echo tells of ranges that spread by a standard deviation. The width follows from the peak's curvature: with
/// a = v/σ² of a variance v, the fourth moment of the sub-rays changes its square by up to a·v. The square of an f32 is off by its
/// epsilon.
fn is_spread(echo: &Echo, spread_m: f64) -> bool {
    let sigma_m = pulse_sigma_m(receiver().pulse_fwhm_s);
    let (pulse, width) = (sigma_m * sigma_m, f64::from(echo.width_m) * f64::from(echo.width_m));
    let variance = spread_m * spread_m;
    (width - pulse - variance).abs() < variance * variance / pulse + f64::from(f32::EPSILON) * width
}

/// 6 mrad horizontally and 1 mrad vertically: a plane that is tilted about the vertical axis spreads ranges by the former.
#[test]
fn an_elliptical_beam_is_wide_along_its_own_axes() {
    let footprint = Footprint {
        half_divergence: [Angle::rad(3e-3), Angle::rad(0.5e-3)],
        exit_radius_m: 0.0,
        samples: Samples::ThirtySeven,
    };
    let tan = libm::tan(20_f64.to_radians());
    for (about, half_rad) in [(DVec3::Z, 3e-3), (DVec3::Y, 0.5e-3)] {
        let scene = optics(scene(&[tilted(50.0, 20.0, about)]), &[lambert(0.8)]);
        let (_, echo) = seen_by(&scene, Some(footprint));
        let spread = 0.5 * 50.0 * half_rad * tan;
        assert!(is_spread(&echo, spread), "{about}: {} {spread}", echo.width_m);
    }
}

/// A beam's axis meets nothing, plates at 5 m and at 100 m stand on either side of it, and both come back.
#[test]
fn a_beam_whose_axis_meets_nothing_sees_what_is_beside_it() {
    let footprint = round(10e-3, Samples::ThirtySeven);
    let beside = |range_m: f64, side: f64| {
        let gap = 0.3 * 5e-3 * range_m;
        Plate(DVec3::new(range_m, side * (5.0 + gap), 0.0), DVec3::Y * 5.0, DVec3::Z * 5.0, 1.0)
    };
    let scene = optics(scene(&[beside(5.0, 1.0), beside(100.0, -1.0)]), &[lambert(1.0), lambert(1.0)]);
    let found = returns(&cast(&scene, &sensor(1, Measurement { footprint, ..with(all_returns()) }), 0));
    assert_eq!(found.iter().map(|(one, _)| one.instance).collect::<Vec<_>>(), [0, 1]);
    // All sub-rays are within w of the axis: their ways are longer by at most R·(5 mrad)²/2.
    for ((one, _), range_m) in found.iter().zip([5.0, 100.0]) {
        assert!((-1e-9..1.25e-5).contains(&(one.range_m / range_m - 1.0)), "{one:?}");
    }
}

/// A mirror of 90 % at 45° shows a plate that is tilted by 60° to the mirrored beam: half as bright as one at a right angle.
#[test]
fn what_a_mirror_shows_keeps_its_own_cosine() {
    let mirror = Plate(DVec3::new(3.0, 0.0, 0.0), DVec3::new(1.0, 1.0, 0.0), DVec3::Z, 1.0);
    let (sin, cos) = libm::sincos(60_f64.to_radians());
    let beside = Plate(DVec3::new(3.0, 4.0, 0.0), DVec3::new(cos, sin, 0.0), DVec3::Z, 1.0);
    let kinds = [kind(SurfaceKind::Mirror { reflectance: 0.9 }), lambert(0.5)];
    let (one, echo) = one_return(&optics(scene(&[mirror, beside]), &kinds), receiver());
    assert_eq!((echo.cause, one.instance), (Cause::Mirror, 1));
    assert!((power(&echo) / (0.81 * 0.5 * 0.5 / 49.0) - 1.0).abs() < 1e-6, "{}", power(&echo));
}

/// A square that an uneven scale shears: its normal is at a right angle to its edges in the world, so the power follows from their
/// cross product. A normal that is only turned gives another cosine.
#[test]
fn normals_are_those_of_the_scaled_and_sheared_surface() {
    let square =
        quad([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[y, z]| DVec3::new(0.0, y, z)));
    let turn = Pose::from_rpy(DVec3::ZERO, Angle::default(), Angle::rad(0.3), Angle::rad(0.7));
    let turned =
        DMat3::from_cols(turn.direction(DVec3::X), turn.direction(DVec3::Y), turn.direction(DVec3::Z));
    let world_from_mesh = DAffine3 {
        matrix3: DMat3::from_diagonal(DVec3::new(3.0, 1.0, 0.5)) * turned,
        translation: DVec3::X * 20.0,
    };
    let [a, b] = [DVec3::Y, DVec3::Z].map(|edge| world_from_mesh.transform_vector3(edge));
    let cosine = a.cross(b).normalize().x.abs();
    let only_turned = (turned * DVec3::X).x.abs();
    assert!((cosine - only_turned).abs() > 0.2, "{cosine} {only_turned}");
    let scene = optics(placed(vec![square], vec![(0, world_from_mesh)]), &[lambert(0.5)]);
    let (one, echo) = one_return(&scene, receiver());
    // Corners are f32, off by up to 2⁻²² of a metre, over edges of a metre and more.
    let expected = 0.5 * cosine / (one.range_m * one.range_m);
    assert!((power(&echo) / expected - 1.0).abs() < 2e-6, "{} {expected}", power(&echo));
}

/// A wall 1 cm before the largest range, with a noise of 10 cm: ranges lie beyond the limit as often as the noise says, and none is
/// moved to it.
#[test]
fn ranges_do_not_pile_up_at_the_limits() {
    let pulses = 5_000;
    let scene = optics(scene(&[wall(119.99, 1.0)]), &[lambert(0.5)]);
    let noise = Some(Noise { range_floor_m: 0.1, ..Noise::default() });
    let measurement = Measurement { noise, ..with(Receiver::default()) };
    let found = returns(&cast(&scene, &sensor(pulses, measurement), 0));
    assert_eq!(found.len(), pulses);
    let mut ranges: Vec<f64> = found.iter().map(|(one, _)| one.range_m).collect();
    ranges.sort_by(f64::total_cmp);
    assert!(ranges.windows(2).all(|pair| pair[0] < pair[1]), "no range comes twice");
    let n = pulses as f64;
    for limit_m in [119.9, 120.0, 120.1] {
        let share = ranges.partition_point(|range| *range < limit_m) as f64 / n;
        let expected = normal_below((limit_m - 119.99) / 0.1);
        // Four standard errors.
        let error = (expected * (1.0 - expected) / n).sqrt();
        assert!((share - expected).abs() < 4.0 * error, "{limit_m}: {share} {expected}");
    }
}
