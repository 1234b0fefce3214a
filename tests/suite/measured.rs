//! Scans of sensors that are not ideal, against closed forms. Each random check states its rate of error and has a fixed seed.

use beamcast::glam::DVec3;
use beamcast::physics::detection::{RangePair, normal_below};
use beamcast::physics::footprint::{Samples, beyond_edge};
use beamcast::scene::{Optics, Scene, Sun, SurfaceKind, Weather};
use beamcast::sensor::{Blooming, DimmerBeams, Measurement, Noise, Receiver, ReturnMode};
use beamcast::{Angle, Cause, Frame, Pattern, Pulse, RangeLimits, RayTable, Sensor};

use super::plates::{
    Plate, cast, factor, kind, lambert, one_return, optics, power, receiver, returns, round, scene, sensor,
    wall, with,
};

/// A mirror of 90 % at 3 m, at 45°, shows a wall that is 4 m beside it: the point is at (7, 0, 0), with .81·ρ/49 of the power.
#[test]
fn a_mirror_shows_a_wall_behind_itself() {
    let mirror = Plate(DVec3::new(3.0, 0.0, 0.0), DVec3::new(1.0, 1.0, 0.0), DVec3::Z, 1.0);
    let beside = Plate(DVec3::new(3.0, 4.0, 0.0), DVec3::X, DVec3::Z, 1.0);
    let scene =
        optics(scene(&[mirror, beside]), &[kind(SurfaceKind::Mirror { reflectance: 0.9 }), lambert(0.5)]);
    let (one, echo) = one_return(&scene, receiver());
    assert!((one.range_m - 7.0).abs() < 1e-9, "{one:?}");
    assert_eq!((echo.cause, one.instance), (Cause::Mirror, 1));
    assert!((power(&echo) / (0.81 * 0.5 / 49.0) - 1.0).abs() < 1e-6, "{}", power(&echo));
    // No mirror beyond the depth that is asked for.
    let frame = cast(&scene, &sensor(1, with(Receiver { bounces: 0, false_alarm: 0.0, ..receiver() })), 0);
    assert_eq!((frame.return_count(), frame.causes()[0]), (0, Cause::Nothing));
}

/// A pane of 6 mm and n = 1.5 at 2 m before a wall at 10 m: 3 mm more and .8521 of the power. Turned by 60°: .7413 of the power, 4.348 mm
/// more, and the ray is moved by 3.075 mm.
#[test]
fn a_pane_delays_weakens_and_moves_what_is_behind_it() {
    let glass = || kind(SurfaceKind::Glass { index: 1.5, thickness_m: 0.006 });
    let flat = scene(&[Plate(DVec3::X * 2.0, DVec3::Y, DVec3::Z, 1.0), wall(10.0, 1.0)]);
    let (one, echo) = one_return(&optics(flat, &[glass(), lambert(0.5)]), receiver());
    assert!((one.range_m - 10.003).abs() < 1e-9 && echo.cause == Cause::Glass, "{one:?}");
    let expected = 0.8521 * 0.5 / (10.003 * 10.003);
    assert!((power(&echo) / expected - 1.0).abs() < 1e-4, "{}", power(&echo) / expected);

    let (sin, cos) = libm::sincos(60_f64.to_radians());
    let turned = Plate(DVec3::X * 2.0, DVec3::new(-sin, cos, 0.0), DVec3::Z, 1.0);
    // The wall is not square to the beam: its range tells where the ray meets it. The ray leaves the pane to the side to which the
    // normal on its far side points.
    let slanted = Plate(DVec3::X * 10.0, DVec3::new(1.0, 1.0, 0.0) * 5.0, DVec3::Z * 5.0, 1.0);
    let (one, echo) = one_return(&optics(scene(&[turned, slanted]), &[glass(), lambert(0.5)]), receiver());
    // The pane's normal away from the light is (cos, sin), so the ray moves towards +y, where this wall is farther.
    assert!((one.range_m - (10.0 + 0.004_348 + 0.003_075)).abs() < 1e-6, "{one:?}");
    let expected = 0.7413 * 0.5 * std::f64::consts::FRAC_1_SQRT_2 / (one.range_m * one.range_m);
    assert!((power(&echo) / expected - 1.0).abs() < 1e-4, "{}", power(&echo) / expected);
}

/// A plate of type III at 20 m with 2 cm between transmitter and receiver: 931 times white; at 2 m 209 times.
#[test]
fn a_retroreflector_outshines_white_by_its_lobe() {
    let plate = kind(SurfaceKind::Retroreflector { r_a: 301.0, lobe_rad: 0.466_f64.to_radians() });
    for (range_m, gain) in [(20.0, 931.0), (2.0, 209.0)] {
        let scene = optics(scene(&[wall(range_m, 1.0)]), std::slice::from_ref(&plate));
        let (_, echo) = one_return(&scene, Receiver { spacing_m: 0.02, ..receiver() });
        let told = power(&echo) * range_m * range_m;
        assert!((told / gain - 1.0).abs() < 5e-3, "{range_m}: {told}");
    }
}

/// GGX of roughness .3 and F0 = .04 over black: 1.235 times white head-on, .9355 at 2°, .0569 at 10°.
#[test]
fn a_glossy_plane_is_bright_head_on() {
    for (tilt_deg, expected) in [(0.0, 1.235), (2.0, 0.9355), (10.0, 0.0569)] {
        let (sin, cos) = libm::sincos(f64::to_radians(tilt_deg));
        let plate = Plate(DVec3::X * 5.0, DVec3::new(sin, cos, 0.0), DVec3::Z, 0.0);
        let glossy = Optics { reflectance: Some(0.0), ..kind(SurfaceKind::Ggx { roughness: 0.3, f0: 0.04 }) };
        let (_, echo) = one_return(&optics(scene(&[plate]), &[glossy]), receiver());
        // The table has four digits.
        assert!((power(&echo) * 25.0 / expected - 1.0).abs() < 1e-3, "{tilt_deg}: {}", power(&echo) * 25.0);
    }
}

/// Wet ground at 60° has .55 of the power of dry ground, and a mirror's image of the wall behind it: T1 = .941, R1 = .059.
#[test]
fn wet_ground_is_dark_and_shows_what_stands_behind_it() {
    let (sin, cos) = libm::sincos(60_f64.to_radians());
    // The ground's normal is 60° from the beam; the image of a wall appears behind the ground.
    let ground = Plate(DVec3::X * 5.0, DVec3::new(-sin, 0.0, cos), DVec3::Y, 1.0);
    let normal = DVec3::new(-cos, 0.0, -sin);
    let reflected = DVec3::X - 2.0 * normal.x * normal;
    let behind = Plate(DVec3::X * 5.0 + reflected * 3.0, DVec3::Y, reflected.cross(DVec3::Y), 1.0);
    let plates = [ground, behind];
    let of = |wetness: f64| {
        let wet = Optics { wetness, ..lambert(0.2) };
        let receiver = Receiver { returns: ReturnMode::Several(4), false_alarm: 0.0, ..receiver() };
        let scene = optics(scene(&plates), &[wet, lambert(0.8)]);
        returns(&cast(&scene, &sensor(1, with(receiver)), 0))
    };
    let (dry, wet) = (of(0.0), of(1.0));
    assert_eq!((dry.len(), wet.len()), (1, 2));
    assert!((power(&wet[0].1) / power(&dry[0].1) - 0.55).abs() < 0.01);
    assert!((wet[1].0.range_m - 8.0).abs() < 1e-6 && wet[1].1.cause == Cause::Mirror);
    let expected = 0.0592 * 0.0592 * 0.8 / 64.0;
    assert!((power(&wet[1].1) / expected - 1.0).abs() < 0.02, "{}", power(&wet[1].1) / expected);
}

fn in_weather(mut scene: Scene, weather: Weather) -> Scene {
    scene.environment.weather = Some(weather);
    scene
}

/// A plane at 50 m keeps e^(−2αR) of its power in fog, and fog makes an echo of its own before it. Kim's extinction at 905 nm and a
/// visibility of 1 km is 3.050 /km.
#[test]
fn fog_takes_light_and_sends_some_back() {
    let fog = |visibility_m: f64, lidar_ratio: f64| Weather {
        visibility_m: Some(visibility_m),
        lidar_ratio,
        ..Weather::default()
    };
    let receiver = || Receiver { returns: ReturnMode::Several(4), false_alarm: 0.0, ..receiver() };
    let of = |weather: Weather| {
        let scene = in_weather(optics(scene(&[wall(50.0, 1.0)]), &[lambert(0.5)]), weather);
        returns(&cast(&scene, &sensor(1, with(receiver())), 0))
    };
    let found = of(fog(1000.0, 19.0));
    let plane = found.iter().find(|(_, echo)| echo.cause == Cause::Surface).unwrap();
    let expected = libm::exp(-2.0 * 3.050e-3 * 50.0) * 0.5 / 2500.0;
    assert!((power(&plane.1) / expected - 1.0).abs() < 1e-3, "{}", power(&plane.1) / expected);
    // Denser fog is seen itself, near the sensor, and 65/19 times brighter with the smaller lidar ratio.
    let near = |lidar_ratio: f64| {
        let found = of(fog(50.0, lidar_ratio));
        *found.iter().find(|(_, echo)| echo.cause == Cause::Fog).unwrap()
    };
    let (bright, dim) = (near(19.0), near(65.0));
    assert!(bright.0.range_m < 3.0 && bright.0.instance == beamcast::scan::NO_OBJECT);
    assert!((bright.1.snr / dim.1.snr - 65.0 / 19.0).abs() < 0.01);
    // In fog of 200 m, the plane of 50 % at 100 m is lost to the air.
    let scene = in_weather(optics(scene(&[wall(100.0, 1.0)]), &[lambert(0.5)]), fog(200.0, 65.0));
    let receiver = Receiver { returns: ReturnMode::Last, ..receiver() };
    let frame = cast(&scene, &sensor(100, with(receiver)), 0);
    assert!(frame.pixels_of(Cause::Absorbed) + frame.pixels_of(Cause::Fog) == 100, "{:?}", frame.causes());
}

/// Rain takes light, and drops near the sensor come back by themselves. Their number is the integral of the density of drops times the
/// probability that one is detected, over range, diameter and place in the beam.
#[test]
fn drops_of_rain_come_back_as_often_as_they_are_there() {
    let rain = Weather { rain_mm_h: 10.0, ..Weather::default() };
    let receiver = Receiver { returns: ReturnMode::Several(8), false_alarm: 0.0, ..receiver() };
    let (white, threshold) = (receiver.snr(1.0, 1.0, 120.0), receiver.threshold(120.0));
    let measurement = Measurement { footprint: round(3e-3, Samples::One), ..with(receiver) };
    let scene = in_weather(optics(scene(&[wall(50.0, 1.0)]), &[lambert(0.5)]), rain);
    let pulses = 20_000;
    let found = returns(&cast(&scene, &sensor(pulses, measurement), 0));
    let (mut drops, mut plane) = (0, 0.0);
    for (one, echo) in &found {
        match echo.cause {
            Cause::Rain => {
                assert!(one.range_m < 50.0 && one.instance == beamcast::scan::NO_OBJECT);
                drops += 1;
            }
            _ => plane = power(echo),
        }
    }
    let extinction_per_m = 1.5556e-3;
    let expected = libm::exp(-2.0 * extinction_per_m * 50.0) * 0.5 / 2500.0;
    assert!((plane / expected - 1.0).abs() < 1e-3, "{}", plane / expected);

    // Marshall and Palmer: N(D) = 8·10⁶·exp(−Λ·D) a m⁴, Λ = 4100·R^−.21 a metre. The receiver sees the beam from .9 to 1 m on.
    let slope = 4100.0 * libm::pow(10.0, -0.21);
    let reflectance = (0.328_f64 / 2.328) * (0.328 / 2.328);
    let mut sum = 0.0;
    let (ranges, sizes, places) = (200, 100, 20);
    for i in 0..ranges {
        let range_m = 0.9 * libm::pow(40.0, (f64::from(i) + 0.5) / f64::from(ranges));
        let along = range_m * libm::log(40.0) / f64::from(ranges);
        let w = 1.5e-3 * range_m;
        let overlap = ((range_m - 0.9) / 0.1).clamp(0.0, 1.0);
        let fall = libm::exp(-2.0 * extinction_per_m * range_m) * overlap / (range_m * range_m);
        for j in 0..sizes {
            let diameter = 5e-5 + 5e-3 * (f64::from(j) + 0.5) / f64::from(sizes);
            let density = 8e6 * libm::exp(-slope * diameter) * 5e-3 / f64::from(sizes);
            for k in 0..places {
                let place = 1.5 * (f64::from(k) + 0.5) / f64::from(places);
                let area = 2.0 * std::f64::consts::PI * place * w * w * 1.5 / f64::from(places);
                let share = 0.5 * diameter * diameter / (w * w) * libm::exp(-2.0 * place * place);
                let snr = white * reflectance * share.min(1.0) * fall;
                // Without light there is no peak.
                let detected = if snr > threshold - 4.0 { normal_below(snr - threshold) } else { 0.0 };
                sum += density * area * along * detected;
            }
        }
    }
    let expected = sum * pulses as f64;
    // Some of the drops are nearer to each other than a pulse tells apart.
    let sigma = expected.sqrt();
    let told = f64::from(drops);
    assert!(told < expected + 4.0 * sigma && told > 0.9 * expected - 4.0 * sigma, "{told} of {expected}");
}

/// The halo of a retroreflector that one pulse hits is seen by the pulses around it out to where h(Δ) = P_min/P.
#[test]
fn a_retroreflector_blooms_as_far_as_the_halo_says() {
    let plate = Plate(DVec3::new(10.0, 0.0, 0.0), DVec3::Y * 4e-4, DVec3::Z * 4e-4, 1.0);
    let retro = kind(SurfaceKind::Retroreflector { r_a: 300.0, lobe_rad: 1.0 });
    let scene = optics(scene(&[plate]), &[retro]);
    let receiver = Receiver { false_alarm: 0.0, ..receiver() };
    let snr = receiver.snr(300.0 * std::f64::consts::PI, 10.0, 120.0);
    let threshold = receiver.threshold(120.0);
    let blooming = Blooming {
        core: Angle::rad(0.0),
        halo: 26.0 * threshold / snr,
        halo_angle: Angle::rad(0.01),
        exponent: 1.0,
        reach: Angle::deg(10.0),
    };
    let measurement = Measurement { blooming: Some(blooming), ..with(receiver) };
    let frame = cast(&scene, &fan(measurement), 0);
    let seen: Vec<_> = (0..2000).filter(|&pixel| !frame.slots(pixel).is_empty()).collect();
    let [first, last] = [seen[0], seen[seen.len() - 1]];
    // h(Δ)·S = T: Δ = θ·√(A·S/T − 1), with A·S/T = 26.
    let radius = 0.05;
    let told = (last - first) as f64 * 1e-4 / 2.0;
    // At the radius half of the pulses pass the threshold T of 4.8. At 1.5 times it the halo is at T/2.2, 2.6 below the threshold,
    // which noise passes once in 200 pulses: the outermost of them lies at most some tenths farther out.
    assert!(told > radius && told < 1.8 * radius, "{told} {radius} {}", seen.len());
    let halo = seen.iter().filter(|&&pixel| frame.causes()[pixel] == Cause::Blooming).count();
    assert!(halo + 10 > seen.len() && halo > 100, "{halo} of {}", seen.len());
    assert!(seen.iter().all(|&pixel| (frame.get(0, pixel).unwrap().range_m - 10.0).abs() < 1e-2));
}

/// Pairs of channels fire at the same time, of which one sees a retroreflector and the other nothing. With the share T/S of its light, S
/// above the noise, the other has a ghost at the retroreflector's range half of the time: 5000 ± 200 of 10⁴, 4 standard deviations. A
/// channel that fires 10 ns later has none.
#[test]
fn a_retroreflector_has_ghosts_in_the_channels_that_fire_with_it() {
    let plate = Plate(DVec3::new(10.0, 0.0, 0.0), DVec3::Y * 0.1, DVec3::Z * 0.1, 1.0);
    let scene = optics(scene(&[plate]), &[kind(SurfaceKind::Retroreflector { r_a: 300.0, lobe_rad: 1.0 })]);
    let receiver = Receiver { false_alarm: 0.0, ..receiver() };
    let snr = receiver.snr(300.0 * std::f64::consts::PI, 10.0, 120.0);
    let crosstalk = receiver.threshold(120.0) / snr;
    let (pairs, beside) = (10_000, DVec3::new(0.8, 0.6, 0.0));
    let ghosts = |crosstalk: f64, later_s: f64| {
        let pulse = |i: usize| {
            let (direction, later_s) = if i.is_multiple_of(2) { (DVec3::X, 0.0) } else { (beside, later_s) };
            Pulse::new(DVec3::ZERO, direction, (i / 2) as f64 * 1e-6 + later_s)
        };
        let pattern = Pattern::Rays(RayTable::new((0..2 * pairs).map(pulse).collect(), None).unwrap());
        let measurement = with(Receiver { crosstalk, ..receiver.clone() });
        let frame = cast(
            &scene,
            &Sensor { measurement, ..Sensor { pattern, ..sensor(1, Measurement::default()) } },
            0,
        );
        let of = |first: usize| (0..pairs).map(move |pair| 2 * pair + first);
        assert!(of(0).all(|pixel| frame.causes()[pixel] == Cause::Surface));
        let seen: Vec<usize> = of(1).filter(|&pixel| !frame.slots(pixel).is_empty()).collect();
        for &pixel in &seen {
            let ghost = frame.get(0, pixel).unwrap();
            assert_eq!((frame.causes()[pixel], ghost.instance), (Cause::Crosstalk, 0));
            assert!((ghost.range_m - 10.0).abs() < 1e-9, "{ghost:?}");
        }
        seen.len()
    };
    let half = ghosts(crosstalk, 0.0);
    assert!((4800..=5200).contains(&half), "{half}");
    assert_eq!((ghosts(crosstalk, 1e-8), ghosts(0.0, 0.0)), (0, 0));
    assert_eq!(ghosts(4.0 * crosstalk, 0.0), pairs);
}

/// A wall in a sun of 80 klx that stands 60° from its normal is as bright as ρ·cos 60°·.8, and 0 behind a plate that shades it.
#[test]
fn the_sun_lights_what_nothing_shades() {
    let mut scene = optics(scene(&[wall(10.0, 1.0)]), &[lambert(0.5)]);
    let (sin, cos) = libm::sincos(60_f64.to_radians());
    scene.environment.sun = Some(Sun { klx: 80.0, direction: DVec3::new(-cos, sin, 0.0) });
    let (_, echo) = one_return(&scene, receiver());
    assert!((echo.ambient - 0.5 * 0.5 * 0.8).abs() < 1e-6, "{}", echo.ambient);
    let shade =
        Plate(DVec3::new(9.0, libm::tan(60_f64.to_radians()), 0.0), DVec3::Y * 0.1, DVec3::Z * 0.1, 1.0);
    let mut shaded = self::scene(&[wall(10.0, 1.0), shade]);
    shaded.environment = scene.environment;
    assert_eq!(one_return(&shaded, receiver()).1.ambient, 0.0);
}

/// Of 10⁴ pulses at .8, .9, 1 and 1.1 of the range that a plane is detected at half of the time, .9966, .8705, .5 and .2019 come
/// back, each within 4 standard deviations: one run in 4000 would fail by chance.
#[test]
fn planes_are_detected_as_often_as_the_data_sheet_says() {
    let pulses = 10_000;
    for (share, detected) in [(0.8, 0.996_60), (0.9, 0.870_46), (1.0, 0.5), (1.1, 0.201_85)] {
        let plane = optics(scene(&[wall(90.0 * share, 1.0)]), &[lambert(0.1)]);
        let frame = cast(&plane, &sensor(pulses, with(receiver())), 0);
        let of_wall = returns(&frame).iter().filter(|(_, echo)| echo.cause == Cause::Surface).count() as f64;
        let n = pulses as f64;
        let sigma = (detected * (1.0 - detected) * n).sqrt();
        assert!((of_wall - detected * n).abs() < 4.0 * sigma + 1.0, "{share}: {of_wall}");
        let missed = frame.pixels_of(Cause::BelowThreshold) + frame.pixels_of(Cause::Dropped);
        assert!(missed as f64 + of_wall >= n - 10.0, "{share}: each pulse has its fate");
    }
}

/// A receiver whose second row sees 10 % up to 45 m, half as far as the first.
fn uneven() -> Receiver {
    let range_pairs = vec![RangePair { reflectivity: 0.1, range_m: 45.0 }];
    let (power, misfit) = receiver().sensitivity.unwrap().power_of(&range_pairs).unwrap();
    assert!((power - 0.25).abs() < 1e-12);
    Receiver { beams: vec![DimmerBeams { rows: vec![1], range_pairs, power, misfit }], ..receiver() }
}

/// The sensor of [`sensor`] with its pulses on two rows, one after the other.
fn of_two_rows(pulses: usize, measurement: Measurement) -> Sensor {
    let Pattern::Rays(table) = sensor(pulses, measurement.clone()).pattern else { panic!("it is a table") };
    let pattern = Pattern::Rays(table.with_lines(2).unwrap());
    Sensor { pattern, ..sensor(pulses, measurement) }
}

/// At 45 m a row that sees 10 % so far detects it half of the time, within 4 standard deviations of 10⁴ pulses, and the other, with four
/// times the signal (Φ(3T) = 1 − 10⁻⁴⁷), always.
#[test]
fn each_row_sees_as_far_as_its_own_pairs_say() {
    let plane = optics(scene(&[wall(45.0, 1.0)]), &[lambert(0.1)]);
    let frame = cast(&plane, &of_two_rows(20_000, with(uneven())), 0);
    assert_eq!((frame.rows(), frame.columns()), (2, 10_000));
    let of_row = |row: usize| {
        let pixels = row * 10_000..(row + 1) * 10_000;
        let causes = pixels.flat_map(|pixel| frame.slots(pixel)).map(|slot| frame.echo(slot).unwrap().cause);
        causes.filter(|cause| *cause == Cause::Surface).count()
    };
    // A false alarm may be stronger than the wall, in one pulse of 10⁴.
    assert!(of_row(0) >= 10_000 - 10, "{}", of_row(0));
    assert!((of_row(1) as f64 - 5000.0).abs() < 4.0 * 50.0 + 10.0, "{}", of_row(1));
}

/// The device knows how its beams differ, so that its intensities do not: each differs from ½ by its noise of one in the signal-to-noise
/// ratio, at most five times of it (one of 3·10⁶ is off by more), and by the rounding to 32 bits.
#[test]
fn rows_that_see_less_far_have_the_same_intensities() {
    let plane = optics(scene(&[wall(5.0, 1.0)]), &[lambert(0.5)]);
    let receiver = Receiver { false_alarm: 0.0, ..uneven() };
    let frame = cast(&plane, &of_two_rows(100, with(receiver)), 0);
    let found = returns(&frame);
    assert_eq!(found.len(), 100);
    let snr = |pixel: usize| f64::from(found[pixel].1.snr);
    assert!((snr(0) / snr(50) - 4.0).abs() < 1e-6, "{} {}", snr(0), snr(50));
    for (one, echo) in &found {
        let off = (f64::from(one.intensity) / 0.5 - 1.0).abs();
        assert!(off < 5.0 / f64::from(echo.snr) + 1e-6, "{one:?} {echo:?}");
    }
}

/// In 10⁶ pulses at nothing there are 100 ± 40 false alarms (4 standard deviations), evenly over the window.
#[test]
fn false_alarms_are_as_many_as_asked_and_anywhere() {
    let scene = scene(&[Plate(DVec3::new(-50.0, 0.0, 0.0), DVec3::Y, DVec3::Z, 1.0)]);
    let sensor = sensor(10_000, with(receiver()));
    let mut ranges = Vec::new();
    for number in 0..100 {
        let frame = cast(&scene, &sensor, number);
        for (one, echo) in returns(&frame) {
            assert_eq!((echo.cause, one.instance), (Cause::FalseAlarm, beamcast::scan::NO_OBJECT));
            ranges.push(one.range_m);
        }
        assert_eq!(frame.pixels_of(Cause::Nothing) + frame.return_count(), 10_000);
    }
    assert!((60..=140).contains(&ranges.len()), "{}", ranges.len());
    ranges.sort_by(f64::total_cmp);
    // Kolmogorov and Smirnov: D·√n above 2.23 has a probability of 10⁻⁴.
    let n = ranges.len() as f64;
    let distance = (0..ranges.len())
        .map(|i| (ranges[i] / 120.0 - (i as f64 + 0.5) / n).abs() + 0.5 / n)
        .fold(0.0, f64::max);
    assert!(distance * n.sqrt() < 2.23, "{distance}");
}

/// A beam of w = 50 mm at 20 m, of which an edge at w/4 hides all but 30.85 %, and a wall 5 m behind it: two returns, whose energies are
/// as the shares over the squares of the ranges.
#[test]
fn a_beam_on_an_edge_has_two_returns() {
    let w = 0.05;
    let edge = Plate(DVec3::new(20.0, -5.0 + w / 4.0, 0.0), DVec3::Y * 5.0, DVec3::Z * 5.0, 0.5);
    let scene = scene(&[edge, wall(25.0, 0.5)]);
    let receiver = Receiver { returns: ReturnMode::Several(4), false_alarm: 0.0, ..receiver() };
    for samples in [Samples::Seven, Samples::Nineteen, Samples::ThirtySeven] {
        let footprint = round(2.0 * libm::atan(w / 20.0), samples);
        let measurement = Measurement { footprint, ..with(receiver.clone()) };
        let found = returns(&cast(&scene, &sensor(1, measurement), 0));
        assert_eq!(found.len(), 2, "{samples:?}");
        let (near, far) = (found[0], found[1]);
        assert!((near.0.range_m - 20.0).abs() < 1e-3 && (far.0.range_m - 25.0).abs() < 1e-3);
        let white = receiver.snr(factor(0.5, 1.0), 20.0, 120.0);
        let error = match samples {
            Samples::Seven => 0.214,
            Samples::Nineteen => 0.109,
            _ => 0.066,
        };
        let shares = [near.1.snr / white as f32, far.1.snr * 25.0 * 25.0 / 400.0 / white as f32];
        for (share, expected) in shares.iter().zip([1.0 - beyond_edge(0.25), beyond_edge(0.25)]) {
            assert!((f64::from(*share) - expected).abs() < error + 1e-3, "{samples:?}: {share}");
        }
        // What one surface lacks the other has.
        assert!((shares[0] + shares[1] - 1.0).abs() < 1e-3, "{shares:?}");
    }
}

/// Halves of a beam at .60 m from each other are one return in the middle, which says that it is mixed, and at .70 m two.
#[test]
fn echoes_merge_nearer_than_twice_the_pulse() {
    for (apart, count) in [(0.6, 1), (0.7, 2)] {
        // The farther half is brighter, so that the same energy comes from both. The edge is beside the axis.
        let edge = Plate(DVec3::new(20.0, -5.0 - 1e-5, 0.0), DVec3::Y * 5.0, DVec3::Z * 5.0, 0.5);
        let on_edge = Samples::ThirtySeven.places().iter().filter(|[y, _]| *y < -1e-3).count() as f64;
        let ratio = on_edge / (37.0 - on_edge) * (1.0 + apart / 20.0) * (1.0 + apart / 20.0);
        let behind = wall(20.0 + apart, (0.5 * ratio + 0.0104 * (ratio - 1.0)) as f32);
        let footprint = round(5e-3, Samples::ThirtySeven);
        let receiver =
            Receiver { returns: ReturnMode::Several(4), pulse_fwhm_s: 5e-9, false_alarm: 0.0, ..receiver() };
        let frame = cast(&scene(&[edge, behind]), &sensor(1, Measurement { footprint, ..with(receiver) }), 0);
        let found = returns(&frame);
        assert_eq!(found.len(), count, "{apart}");
        if count == 1 {
            assert_eq!(found[0].1.cause, Cause::Mixed);
            // Near the merger the peak is flat, and a thousandth of the energy moves it by centimetres.
            assert!((found[0].0.range_m - 20.3).abs() < 0.02, "{:?}", found[0].0);
        } else {
            assert!(found[0].0.range_m > 20.0 && found[1].0.range_m < 20.7);
        }
    }
}

/// 3 mrad at 50 m on a plane at 60°: the echo is √(.3183² + .065²) = .3249 m wide, and its range that of the axis to 2 mm.
#[test]
fn a_slanted_plane_widens_the_echo() {
    let slanted = Plate(
        DVec3::new(50.0, 0.0, 0.0),
        DVec3::new(libm::tan(60_f64.to_radians()), 1.0, 0.0) * 5.0,
        DVec3::Z * 5.0,
        0.5,
    );
    let footprint = round(3e-3, Samples::ThirtySeven);
    let receiver = Receiver { pulse_fwhm_s: 5e-9, false_alarm: 0.0, ..receiver() };
    let found =
        returns(&cast(&scene(&[slanted]), &sensor(1, Measurement { footprint, ..with(receiver) }), 0));
    let (one, echo) = found[0];
    assert!((echo.width_m - 0.3249).abs() < 5e-4, "{}", echo.width_m);
    // The near side of the footprint is brighter: its R⁻² pulls the peak by −2v/R, .17 mm, and more light falls on it.
    assert!((one.range_m - 50.0).abs() < 2e-3 && echo.cause == Cause::Surface, "{one:?}");
    assert!(echo.terms.footprint_m < 0.0 && (echo.terms.ideal_m - 50.0).abs() < 1e-6);
}

/// Everything that can be on at once.
fn everything() -> Measurement {
    let receiver =
        Receiver { returns: ReturnMode::Dual, walk_residual: 0.1, interference_hz: 2e4, ..receiver() };
    let noise = Noise {
        range_floor_m: 0.01,
        range_a_m: 0.3,
        bias_m: 0.01,
        gain: 0.1,
        angle: Angle::deg(0.05),
        beam_angle: Angle::deg(0.05),
        range_unit_m: 0.004,
        ..Noise::default()
    };
    Measurement { footprint: round(5e-3, Samples::Seven), noise: Some(noise), ..with(receiver) }
}

fn stepped() -> Scene {
    let step = |i: i32| {
        let y = f64::from(i) * 0.05;
        let x = 10.0 + 0.3 * f64::from(i % 4);
        Plate(DVec3::new(x, y, 0.0), DVec3::Y * 0.025, DVec3::Z * 5.0, 0.1 + 0.02 * (i + 20) as f32)
    };
    let mut plates: Vec<_> = (-20..20).map(step).collect();
    plates.push(wall(40.0, 0.4));
    scene(&plates)
}

fn fan(measurement: Measurement) -> Sensor {
    let pulse = |i: usize| {
        let azimuth = (i as f64 - 1000.0) * 1e-4;
        let (sin, cos) = libm::sincos(azimuth);
        Pulse::new(DVec3::ZERO, DVec3::new(cos, sin, 0.0), i as f64 * 1e-6)
    };
    let pattern = Pattern::Rays(RayTable::new((0..2000).map(pulse).collect(), None).unwrap());
    let range = RangeLimits { max_m: 120.0, ..RangeLimits::default() };
    Sensor { range, measurement, ..Sensor::new(pattern) }
}

/// The ideal range and the terms make the range before it is rounded, to 1e-9 m, and the range is a multiple of the unit.
#[test]
fn the_terms_of_a_range_add_up_to_it() {
    let frame = cast(&stepped(), &fan(everything()), 0);
    let found = returns(&frame);
    assert!(found.len() > 2000);
    let mut mixed = 0;
    for (one, echo) in &found {
        let terms = echo.terms;
        let sum = terms.ideal_m + terms.errors_m().iter().sum::<f64>();
        assert!((sum - one.range_m).abs() < 1e-9, "{one:?} {terms:?}");
        assert!((terms.unrounded_m() - one.range_m).abs() <= 0.002 + 1e-9);
        assert!(((one.range_m / 0.004).round() * 0.004 - one.range_m).abs() < 1e-9);
        mixed += usize::from(echo.cause == Cause::Mixed);
        if matches!(echo.cause, Cause::Surface | Cause::Mixed) {
            assert!(terms.bias_m != 0.0 && terms.noise_m != 0.0 && terms.walk_m <= 0.0);
        }
    }
    assert!(mixed > 20, "steps of 30 cm make mixed pixels: {mixed}");
}

/// An effect that is turned off leaves the draws of all others as they are.
#[test]
fn effects_do_not_disturb_each_other() {
    let scene = stepped();
    let all = everything();
    let noise = all.noise.unwrap();
    let receiver = all.receiver.clone().unwrap();
    let full = cast(&scene, &fan(all.clone()), 3);
    let without = [
        Measurement { noise: Some(Noise { bias_m: 0.0, ..noise }), ..all.clone() },
        Measurement { noise: Some(Noise { range_unit_m: 0.0, ..noise }), ..all.clone() },
        Measurement { receiver: Some(Receiver { interference_hz: 0.0, ..receiver.clone() }), ..all.clone() },
        Measurement { receiver: Some(Receiver { walk_residual: 0.0, ..receiver }), ..all.clone() },
    ];
    let noise_of = |frame: &Frame, pixel: usize| {
        let slot =
            frame.slots(pixel).find(|&slot| frame.returns().instance[slot] != beamcast::scan::NO_OBJECT)?;
        let echo = frame.echo(slot)?;
        Some((echo.terms.noise_m, echo.terms.footprint_m, echo.snr))
    };
    for one in without {
        let frame = cast(&scene, &fan(one), 3);
        let same = (0..2000).filter(|&pixel| noise_of(&frame, pixel) == noise_of(&full, pixel)).count();
        // A foreign pulse may take the place of a return.
        assert!(same > 1900, "{same}");
    }
    // Frames, sensors and seeds draw anew.
    let other = cast(&scene, &fan(all), 4);
    let same = (0..2000).filter(|&pixel| noise_of(&other, pixel) == noise_of(&full, pixel)).count();
    assert!(same < 20, "{same}");
}

#[test]
fn measured_frames_do_not_depend_on_threads() {
    let scene = stepped();
    let sensor = fan(everything());
    let of = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| cast(&scene, &sensor, 1))
    };
    let one = of(1);
    assert!(one == of(3));
    assert!(one.is_measured() && one.most_returns() == 2);
}

/// A receiver alone, without range pairs, reports what an ideal sensor reports.
#[test]
fn a_receiver_that_detects_anything_is_ideal() {
    let scene = stepped();
    let measured = cast(&scene, &fan(with(Receiver::default())), 0);
    let ideal = cast(&scene, &fan(Measurement::default()), 0);
    for pixel in 0..2000 {
        let one = |frame: &Frame| frame.slot(pixel, 0).map(|slot| frame.returns().get(slot));
        let (a, b) = (one(&measured).unwrap(), one(&ideal).unwrap());
        assert!((a.range_m - b.range_m).abs() < 1e-12, "{pixel}: {a:?} {b:?}");
        assert_eq!((a.instance, a.label, a.triangle, a.normal), (b.instance, b.label, b.triangle, b.normal));
    }
}
