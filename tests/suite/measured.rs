//! Scans of sensors that are not ideal, against closed forms. Each random check states its rate of error and has a fixed seed.

use beamcast::glam::{DAffine3, DVec3};
use beamcast::motion::Trajectory;
use beamcast::physics::detection::{RangePair, Sensitivity};
use beamcast::physics::footprint::{Samples, beyond_edge};
use beamcast::physics::surface::MetallicRoughness;
use beamcast::scan::Echo;
use beamcast::sensor::{Footprint, Measurement, Noise, Receiver, ReturnMode};
use beamcast::trace::Tracer;
use beamcast::{
    Angle, Capture, Cause, Frame, Material, Pattern, Pose, Progress, Pulse, RangeLimits, RayTable, Return,
    Scene, SceneBuilder, Sensor, SourceInstance, SourceMesh, SourcePart, scan,
};

/// A square plate: its middle, half of its edges as vectors, and its reflectivity.
struct Plate(DVec3, DVec3, DVec3, f32);

fn scene(plates: &[Plate]) -> Scene {
    let meshes: Vec<_> = (0..)
        .zip(plates)
        .map(|(material, &Plate(middle, a, b, _))| {
            let corner = |s: f64, t: f64| (middle + a * s + b * t).as_vec3().to_array();
            SourceMesh {
                positions: vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)],
                parts: vec![SourcePart {
                    triangles: vec![[0, 1, 2], [0, 2, 3]],
                    material,
                    ..SourcePart::default()
                }],
            }
        })
        .collect();
    let instances = (0..plates.len())
        .map(|mesh| SourceInstance { mesh, world_from_mesh: DAffine3::IDENTITY, ..SourceInstance::default() })
        .collect();
    let materials = plates
        .iter()
        .map(|&Plate(.., rho)| Material {
            base_color: [rho, rho, rho, 1.0],
            metallic: 0.0,
            ..Material::default()
        })
        .collect();
    SceneBuilder { meshes, instances, materials, files: vec![], groups: vec![] }.build().unwrap()
}

/// A wall across x.
fn wall(x: f64, rho: f32) -> Plate {
    Plate(DVec3::new(x, 0.0, 0.0), DVec3::Y * 50.0, DVec3::Z * 50.0, rho)
}

/// The power of a plate relative to a white one, as the file's material has it.
fn factor(rho: f32, cosine: f64) -> f64 {
    MetallicRoughness::rough(f64::from(rho)).power_factor(cosine)
}

/// A sensor of so many pulses along x, a microsecond apart.
fn sensor(pulses: usize, measurement: Measurement) -> Sensor {
    let pulse = |i: usize| Pulse::new(DVec3::ZERO, DVec3::X, i as f64 * 1e-6);
    let pattern = Pattern::Rays(RayTable::new((0..pulses).map(pulse).collect(), None).unwrap());
    let range = RangeLimits { max_m: 120.0, ..RangeLimits::default() };
    Sensor { range, measurement, ..Sensor::new(pattern) }
}

fn cast(scene: &Scene, sensor: &Sensor, frame: u64) -> Frame {
    let trajectory = Trajectory::Fixed(Pose::IDENTITY);
    let capture = Capture::new(sensor, Pose::IDENTITY, &trajectory, frame, 7);
    scan(scene, &Tracer::build(scene), &capture, &Progress::default()).unwrap()
}

/// A receiver that detects a plane of 10 % at 90 m half of the time.
fn receiver() -> Receiver {
    let range_pairs = vec![RangePair { reflectivity: 0.1, range_m: 90.0 }];
    let sensitivity = Sensitivity::fit(&range_pairs);
    Receiver { range_pairs, sensitivity, false_alarm: 1e-4, pulse_fwhm_s: 6e-9, ..Receiver::default() }
}

fn with(receiver: Receiver) -> Measurement {
    Measurement { receiver: Some(receiver), ..Measurement::default() }
}

fn round(divergence_rad: f64, samples: Samples) -> Option<Footprint> {
    Some(Footprint { half_divergence: [Angle::rad(0.5 * divergence_rad); 2], exit_radius_m: 0.0, samples })
}

fn returns(frame: &Frame) -> Vec<(Return, Echo)> {
    (0..frame.pixels())
        .flat_map(|pixel| frame.slots(pixel))
        .map(|slot| (frame.returns().get(slot), *frame.echo(slot).unwrap()))
        .collect()
}

/// Of 10⁴ pulses at .8, .9, 1 and 1.1 of the range that a plane is detected at half of the time, .9966, .8705, .5 and .2019 come
/// back, each within 4 standard deviations: one run in 4000 would fail by chance.
#[test]
fn planes_are_detected_as_often_as_the_data_sheet_says() {
    let pulses = 10_000;
    for (share, detected) in [(0.8, 0.996_60), (0.9, 0.870_46), (1.0, 0.5), (1.1, 0.201_85)] {
        let rho = 0.1_f32;
        // The file's material is not quite Lambertian.
        let range_m = 90.0 * share * (factor(rho, 1.0) / 0.1).sqrt();
        // False alarms would count as well.
        let measurement = with(receiver());
        let frame = cast(&scene(&[wall(range_m, rho)]), &sensor(pulses, measurement), 0);
        let of_wall = returns(&frame).iter().filter(|(_, echo)| echo.cause == Cause::Surface).count() as f64;
        let n = pulses as f64;
        let sigma = (detected * (1.0 - detected) * n).sqrt();
        assert!((of_wall - detected * n).abs() < 4.0 * sigma + 1.0, "{share}: {of_wall}");
        let missed = frame.pixels_of(Cause::BelowThreshold) + frame.pixels_of(Cause::Dropped);
        assert!(missed as f64 + of_wall >= n - 10.0, "{share}: each pulse has its fate");
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
            assert!(found.iter().all(|(_, echo)| echo.cause == Cause::Surface));
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
