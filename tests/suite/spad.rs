//! Scans by a receiver that counts photons, against closed forms. Each random check states its rate of error and has a fixed seed.

use beamcast::glam::DVec3;
use beamcast::physics::detection::{RangePair, Sensitivity};
use beamcast::scan::{SignalUnit, explain};
use beamcast::scene::Sun;
use beamcast::sensor::{Receiver, Spad};
use beamcast::{Capture, Cause, Pose, Scene, trace::Tracer};

use super::plates::{cast, lambert, optics, receiver, returns, scene, sensor, wall, with};

/// The receiver of the other tests, with its window of 120 m, as one that counts 400 cycles in bins of 1 ns.
fn counting(pairs: &[(f64, f64)], detection: f64, background_hz: f64) -> Receiver {
    let range_pairs: Vec<RangePair> =
        pairs.iter().map(|&(reflectivity, range_m)| RangePair { reflectivity, range_m }).collect();
    let sensitivity = Sensitivity::fit(&range_pairs);
    let linear = Receiver { range_pairs, sensitivity, detection, false_alarm: 0.0, ..receiver() };
    linear.counting(Spad { cycles: 400, bin_s: 1e-9, dead_s: f64::INFINITY, background_hz }, 120.0).unwrap()
}

fn plane(range_m: f64, reflectance: f64) -> Scene {
    optics(scene(&[wall(range_m, 1.0)]), &[lambert(reflectance)])
}

/// Of 10⁴ pulses at a range pair the stated part is detected, within 4 standard deviations: one run in 3000 would fail by chance.
#[test]
fn planes_at_the_range_pairs_are_detected_as_often_as_stated() {
    let n = 10_000.0;
    let pairs = [(0.1, 60.0), (0.8, 110.0)];
    for (background_hz, detection) in [(0.0, 0.5), (4e5, 0.5), (4e5, 0.9), (2e6, 0.9)] {
        let measurement = with(counting(&pairs, detection, background_hz));
        for (reflectance, range_m) in pairs {
            let frame = cast(&plane(range_m, reflectance), &sensor(10_000, measurement.clone()), 0);
            let found = frame.return_count() as f64;
            let sigma = (detection * (1.0 - detection) * n).sqrt();
            assert!((found - detection * n).abs() < 4.0 * sigma, "{background_hz} {range_m}: {found}");
            let missed = frame.pixels_of(Cause::BelowThreshold) + frame.pixels_of(Cause::Dropped);
            assert_eq!(missed + frame.return_count(), 10_000, "each pulse has its fate");
        }
    }
}

/// Bright walls seem nearer by the shift of the mean histogram, and their ranges spread as its counts do: the mean and the deviation of
/// 4000 ranges are known to 1/63 and 1/89 of the deviation, and the first order of the deviation to a tenth.
#[test]
fn pile_up_shifts_bright_walls_nearer() {
    let measurement = with(counting(&[(0.1, 90.0)], 0.5, 4e5));
    let counter = measurement.receiver.as_ref().unwrap().counter(120.0, 1.0).unwrap();
    let mut last_m = 0.0;
    for range_m in [50.0, 20.0, 8.0, 2.0] {
        let told = counter.plane(0.8, range_m).unwrap();
        let frame = cast(&plane(range_m, 0.8), &sensor(4000, measurement.clone()), 0);
        let found = returns(&frame);
        assert_eq!(found.len(), 4000);
        let off: Vec<f64> = found.iter().map(|(one, _)| one.range_m - range_m).collect();
        let mean = off.iter().sum::<f64>() / 4000.0;
        let sigma = (off.iter().map(|off| (off - mean) * (off - mean)).sum::<f64>() / 3999.0).sqrt();
        // The maximum of a filtered histogram is biased by a part of its deviation's square over the pulse's width.
        let bias = told.sigma_m * told.sigma_m / 0.38;
        assert!((mean - told.shift_m).abs() < 4.0 * sigma / 63.0 + bias, "{range_m}: {mean} {told:?}");
        assert!((sigma / told.sigma_m - 1.0).abs() < 0.1 + 4.0 / 89.0, "{range_m}: {sigma} {told:?}");
        assert!(told.shift_m < last_m, "{range_m}: {told:?}");
        last_m = told.shift_m;
        for (one, echo) in &found {
            assert!((echo.terms.walk_m - told.shift_m).abs() < 1e-9, "{:?}", echo.terms);
            assert!((echo.terms.unrounded_m() - one.range_m).abs() < 1e-9);
        }
    }
}

/// The intensity is the reflectance as long as pile-up is small, and less where it is not: 4000 values, each with the deviation of its
/// counts. A gate whose middle is up to half a bin beside the pulse's has 3 % less of it.
#[test]
fn counts_tell_the_reflectance_until_they_pile_up() {
    let measurement = with(counting(&[(0.1, 90.0)], 0.99, 4e5));
    let mean = |range_m: f64, reflectance: f64| {
        let found = returns(&cast(&plane(range_m, reflectance), &sensor(4000, measurement.clone()), 0));
        found.iter().map(|(one, _)| f64::from(one.intensity)).sum::<f64>() / found.len() as f64
    };
    // Of those at 70 m all are detected, so that the mean is of all. A tenth of the light is blinded at most.
    let faint = mean(70.0, 0.1);
    assert!((faint / 0.1 - 1.0).abs() < 0.15, "{faint}");
    let bright = mean(3.0, 0.8);
    assert!(bright < 0.4, "{bright}");
}

/// Sunlight beyond that of the range pairs blinds cycles before far walls, as often as the closed form says.
#[test]
fn sunlight_hides_far_walls() {
    let receiver = Receiver { sun_share: 0.9, ..counting(&[(0.1, 60.0)], 0.9, 4e5) };
    let mut last = 1.1;
    for klx in [20.0, 100.0, 400.0] {
        let mut scene = plane(90.0, 0.25);
        scene.environment.sun = Some(Sun { klx, direction: DVec3::NEG_X });
        let frame = cast(&scene, &sensor(10_000, with(receiver.clone())), 0);
        let counter = receiver.counter(120.0, receiver.background(klx / 100.0)).unwrap();
        let detection = counter.plane(0.25, 90.0).unwrap().detection;
        let sigma = (detection * (1.0 - detection) / 1e4).sqrt();
        let found = frame.return_count() as f64 / 1e4;
        assert!((found - detection).abs() < 4.0 * sigma + 1e-4, "{klx}: {found} {detection}");
        assert!(found < last - 0.02, "{klx}: {found} {last}");
        last = found;
    }
}

/// A story has the returns of the frame, and the counts that make them.
#[test]
fn the_story_of_a_pulse_has_its_counts() {
    let scene = plane(20.0, 0.5);
    let sensor = sensor(3, with(counting(&[(0.1, 90.0)], 0.5, 4e5)));
    let frame = cast(&scene, &sensor, 5);
    let trajectory = beamcast::motion::Trajectory::Fixed(Pose::IDENTITY);
    let capture = Capture::new(&sensor, Pose::IDENTITY, &trajectory, 5, 7);
    for column in 0..3 {
        let story = explain(&scene, &Tracer::build(&scene), &capture, 0, column).unwrap();
        let (one, echo) = story.returns[0];
        let (same, same_echo) = returns(&frame)[column];
        assert_eq!((one, echo), (same, Some(same_echo)));
        let signal = story.signal.unwrap();
        assert_eq!((signal.unit, signal.threshold), (SignalUnit::Counts, None));
        let counts = signal.peaks[0].counts.unwrap();
        assert!(counts.drawn >= counts.least && counts.mean > counts.background);
        assert_eq!(
            (signal.peaks[0].height, signal.peaks[0].amplitude),
            (counts.mean, f64::from(counts.drawn))
        );
        // Pile-up takes counts away from those that the light would make.
        assert!(signal.height(20.0) > counts.mean);
    }
}

#[test]
fn counts_do_not_depend_on_threads() {
    let scene = plane(60.0, 0.2);
    let sensor = sensor(500, with(counting(&[(0.1, 90.0)], 0.5, 4e5)));
    let of = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| cast(&scene, &sensor, 1))
    };
    assert!(of(1) == of(3));
    let other = cast(&scene, &sensor, 2);
    assert!(of(1) != other, "frames draw anew");
}
