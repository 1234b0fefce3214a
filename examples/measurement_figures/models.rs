//! A figure a model: the closed form as a line, and points from scans.

use std::sync::Arc;

use beamcast::glam::{DAffine3, DVec3};
use beamcast::motion::Trajectory;
use beamcast::physics::detection::{RangePair, Sensitivity, normal_below, range_sigma_m};
use beamcast::physics::echo::{Part, Waveform, pulse_sigma_m};
use beamcast::physics::footprint::{Samples, beyond_edge};
use beamcast::physics::surface::ggx_lobe;
use beamcast::scan::Echo;
use beamcast::scene::{Optics, SurfaceKind, Weather};
use beamcast::sensor::{Footprint, Measurement, Noise, Receiver, ReturnMode};
use beamcast::trace::Tracer;
use beamcast::{
    Angle, Capture, Cause, Frame, Material, Pattern, Pose, Progress, Pulse, RangeLimits, RayTable, Return,
    Scene, SceneBuilder, Sensor, SourceInstance, SourceMesh, SourcePart, scan,
};

use super::plot::{Axis, Curve, Plot};

const CLOSED: &str = "#1f5fbf";
const CAST: &str = "#d03020";

/// Every figure, with its file's name.
pub fn all() -> Vec<(&'static str, Plot)> {
    vec![
        ("detection", detection()),
        ("noise", noise()),
        ("edge", edge()),
        ("merging", merging()),
        ("glossy", glossy()),
        ("fog", fog()),
    ]
}

/// A plate at a distance along x: where its middle lies across the beam, half its width, how it is tilted about z.
struct Plate {
    x: f64,
    y: f64,
    half: f64,
    tilt_deg: f64,
    optics: Optics,
}

impl Plate {
    fn wall(x: f64, reflectance: f64) -> Self {
        let optics =
            Optics { reflectance: Some(reflectance), kind: Some(SurfaceKind::Lambert), ..Optics::default() };
        Self { x, y: 0.0, half: 50.0, tilt_deg: 0.0, optics }
    }
}

fn scene(plates: Vec<Plate>) -> Scene {
    let corner = |plate: &Plate, s: f64, t: f64| {
        let (sin, cos) = Angle::deg(plate.tilt_deg).sin_cos();
        let along = DVec3::new(sin, cos, 0.0) * plate.half;
        (DVec3::new(plate.x, plate.y, 0.0) + along * s + DVec3::Z * plate.half * t).as_vec3().to_array()
    };
    let mesh = |(material, plate): (u32, &Plate)| SourceMesh {
        positions: [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]
            .map(|(s, t)| corner(plate, s, t))
            .to_vec(),
        parts: vec![SourcePart { triangles: vec![[0, 1, 2], [0, 2, 3]], material, ..SourcePart::default() }],
    };
    let instance =
        |mesh| SourceInstance { mesh, world_from_mesh: DAffine3::IDENTITY, ..SourceInstance::default() };
    let builder = SceneBuilder {
        meshes: (0..).zip(&plates).map(mesh).collect(),
        instances: (0..plates.len()).map(instance).collect(),
        materials: (0..)
            .zip(&plates)
            .map(|(index, _)| Material { optics: Some(index), ..Material::default() })
            .collect(),
        files: vec![],
        groups: vec![],
    };
    let mut scene = builder.build().expect("plates are a scene");
    Arc::make_mut(&mut scene.geometry).optics = plates.into_iter().map(|plate| plate.optics).collect();
    scene
}

/// A receiver that detects 10 % at 90 m half of the time.
fn receiver() -> Receiver {
    let range_pairs = vec![RangePair { reflectivity: 0.1, range_m: 90.0 }];
    let sensitivity = Sensitivity::fit(&range_pairs);
    Receiver { range_pairs, sensitivity, ..Receiver::default() }
}

fn measurement(receiver: Receiver) -> Measurement {
    Measurement { receiver: Some(receiver), ..Measurement::default() }
}

/// The returns of so many pulses along x.
fn returns(scene: &Scene, measurement: Measurement, pulses: usize) -> Vec<(Return, Echo)> {
    let pulse = |i: usize| Pulse::new(DVec3::ZERO, DVec3::X, i as f64 * 1e-6);
    let table = RayTable::new((0..pulses).map(pulse).collect(), None).expect("pulses are a table");
    let range = RangeLimits { max_m: 120.0, ..RangeLimits::default() };
    let sensor = Sensor { range, measurement, ..Sensor::new(Pattern::Rays(table)) };
    let trajectory = Trajectory::Fixed(Pose::IDENTITY);
    let capture = Capture::new(&sensor, Pose::IDENTITY, &trajectory, 0, 7);
    let frame: Frame =
        scan(scene, &Tracer::build(scene), &capture, &Progress::default()).expect("nobody cancels it");
    let slots = (0..frame.pixels()).flat_map(|pixel| frame.slots(pixel));
    slots.filter_map(|slot| Some((frame.returns().get(slot), *frame.echo(slot)?))).collect()
}

fn curve(label: &'static str, count: usize, from: f64, to: f64, of: impl Fn(f64) -> f64) -> Curve {
    let at = |i: usize| from + (to - from) * i as f64 / (count - 1) as f64;
    Curve { label, colour: CLOSED, is_line: true, points: (0..count).map(|i| (at(i), of(at(i)))).collect() }
}

fn points(label: &'static str, points: Vec<(f64, f64)>) -> Curve {
    Curve { label, colour: CAST, is_line: false, points }
}

fn steps(count: usize, from: f64, to: f64) -> impl Iterator<Item = f64> {
    (0..count).map(move |i| from + (to - from) * i as f64 / (count - 1) as f64)
}

fn detection() -> Plot {
    let threshold = receiver().threshold(120.0);
    let detected = |range_m: f64| normal_below(receiver().snr(0.1, range_m, 120.0) - threshold);
    let cast = steps(13, 60.0, 118.0).map(|range_m| {
        let found = returns(&scene(vec![Plate::wall(range_m, 0.1)]), measurement(receiver()), 2000);
        (range_m, found.len() as f64 / 2000.0)
    });
    Plot {
        title: "A plane of 10 %, which the data sheet has at 90 m",
        x: Axis { label: "range, m", from: 60.0, to: 120.0 },
        y: Axis { label: "share of pulses detected", from: 0.0, to: 1.0 },
        curves: vec![
            curve("Φ(SNR − T)", 121, 60.0, 120.0, detected),
            points("2000 pulses each", cast.collect()),
        ],
    }
}

fn noise() -> Plot {
    let sigma = |range_m: f64| 100.0 * range_sigma_m(0.01, 0.3, 0.6, receiver().snr(0.8, range_m, 120.0));
    let noise = Noise { range_floor_m: 0.01, range_a_m: 0.3, range_b: 0.6, ..Noise::default() };
    let cast = steps(12, 10.0, 118.0).map(|range_m| {
        let measurement = Measurement { noise: Some(noise), ..measurement(receiver()) };
        let found = returns(&scene(vec![Plate::wall(range_m, 0.8)]), measurement, 4000);
        let count = found.len() as f64;
        let mean = found.iter().map(|(one, _)| one.range_m).sum::<f64>() / count;
        let square = found.iter().map(|(one, _)| (one.range_m - mean) * (one.range_m - mean)).sum::<f64>();
        (range_m, 100.0 * (square / (count - 1.0)).sqrt())
    });
    Plot {
        title: "The noise of a range, on a plane of 80 %",
        x: Axis { label: "range, m", from: 0.0, to: 120.0 },
        y: Axis { label: "standard deviation, cm", from: 0.0, to: 5.0 },
        curves: vec![
            curve("√(floor² + (a·SNR^−b)²)", 120, 1.0, 120.0, sigma),
            points("4000 pulses each", cast.collect()),
        ],
    }
}

fn edge() -> Plot {
    let w = 0.05;
    let footprint = Footprint {
        half_divergence: [Angle::rad(libm::atan(w / 20.0)); 2],
        exit_radius_m: 0.0,
        samples: Samples::ThirtySeven,
    };
    let white = receiver().snr(0.5, 20.0, 120.0);
    let cast = steps(41, -1.0, 1.0).map(|offset| {
        let plate = Plate { y: offset * w - 5.0, half: 5.0, ..Plate::wall(20.0, 0.5) };
        let receiver = Receiver { returns: ReturnMode::First, ..receiver() };
        let measurement = Measurement { footprint: Some(footprint), ..measurement(receiver) };
        let found = returns(&scene(vec![plate]), measurement, 1);
        (offset, found.first().map_or(0.0, |(_, echo)| f64::from(echo.snr) / white))
    });
    Plot {
        title: "A plate that ends beside the beam's axis",
        x: Axis { label: "edge's distance from the axis, w", from: -1.0, to: 1.0 },
        y: Axis { label: "share of the beam on the plate", from: 0.0, to: 1.0 },
        curves: vec![
            curve("1 − ½·erfc(√2·d/w)", 101, -1.0, 1.0, |offset| 1.0 - beyond_edge(offset)),
            points("37 sub-rays", cast.collect()),
        ],
    }
}

fn merging() -> Plot {
    let sigma_m = pulse_sigma_m(5e-9);
    let colours = ["#1f5fbf", "#2a9d4a", "#d03020"];
    let labels = ["0.5 m apart", "0.7 m apart", "1.0 m apart"];
    let curves = [0.5, 0.7, 1.0].into_iter().zip(colours).zip(labels).map(|((apart, colour), label)| {
        let parts = [20.0, 20.0 + apart].map(|range_m| Part { range_m, energy: 0.5 });
        let waveform = Waveform::new(&parts, sigma_m);
        let points = steps(161, 19.0, 22.0).map(|range_m| (range_m, waveform.height(range_m))).collect();
        Curve { label, colour, is_line: true, points }
    });
    Plot {
        title: "Waveforms of a beam on two walls, pulses of 5 ns: they merge below 2σ = 0.637 m",
        x: Axis { label: "range, m", from: 19.0, to: 22.0 },
        y: Axis { label: "height", from: 0.0, to: 1.0 },
        curves: curves.collect(),
    }
}

fn glossy() -> Plot {
    let cast = steps(16, 0.0, 15.0).map(|tilt_deg| {
        let optics = Optics {
            reflectance: Some(0.0),
            kind: Some(SurfaceKind::Ggx { roughness: 0.3, f0: 0.04 }),
            ..Optics::default()
        };
        let plate = Plate { half: 1.0, tilt_deg, optics, ..Plate::wall(5.0, 0.0) };
        let found = returns(&scene(vec![plate]), measurement(receiver()), 1);
        let white = receiver().snr(1.0, 5.0, 120.0);
        (tilt_deg, found.first().map_or(0.0, |(_, echo)| f64::from(echo.snr) / white))
    });
    let lobe = |tilt_deg: f64| ggx_lobe(0.04, 0.3, Angle::deg(tilt_deg).sin_cos().1);
    Plot {
        title: "A glossy plane, GGX of roughness 0.3",
        x: Axis { label: "angle of incidence, degrees", from: 0.0, to: 15.0 },
        y: Axis { label: "power relative to white", from: 0.0, to: 1.5 },
        curves: vec![curve("closed form", 121, 0.0, 15.0, lobe), points("scans", cast.collect())],
    }
}

fn fog() -> Plot {
    let extinction = |visibility_m: f64| {
        beamcast::scene::Haze::Kim.extinction_per_m(visibility_m, receiver().wavelength_m)
    };
    let clear = receiver().snr(0.5, 50.0, 120.0);
    let kept = |visibility_m: f64| libm::exp(-100.0 * extinction(visibility_m));
    let cast = steps(14, 100.0, 1400.0).map(|visibility_m| {
        let mut scene = scene(vec![Plate::wall(50.0, 0.5)]);
        let weather = Weather { visibility_m: Some(visibility_m), ..Weather::default() };
        scene.environment.weather = Some(weather);
        let receiver = Receiver { returns: ReturnMode::Several(4), ..receiver() };
        let found = returns(&scene, measurement(receiver), 1);
        let wall = found.iter().find(|(_, echo)| echo.cause == Cause::Surface);
        (visibility_m, wall.map_or(0.0, |(_, echo)| f64::from(echo.snr) / clear))
    });
    Plot {
        title: "A plane at 50 m in fog, 905 nm",
        x: Axis { label: "visibility, m", from: 0.0, to: 1500.0 },
        y: Axis { label: "power relative to clear air", from: 0.0, to: 1.0 },
        curves: vec![curve("e^(−2αR), α by Kim", 141, 100.0, 1500.0, kept), points("scans", cast.collect())],
    }
}
