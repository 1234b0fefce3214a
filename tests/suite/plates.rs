//! Plates before a sensor that is not ideal.

use std::sync::Arc;

use beamcast::glam::{DAffine3, DVec3};
use beamcast::motion::Trajectory;
use beamcast::physics::detection::{RangePair, Sensitivity};
use beamcast::physics::footprint::Samples;
use beamcast::physics::surface::MetallicRoughness;
use beamcast::scan::Echo;
use beamcast::scene::{Optics, SurfaceKind};
use beamcast::sensor::{Footprint, Measurement, Receiver};
use beamcast::trace::Tracer;
use beamcast::{
    Angle, Capture, Frame, Material, Pattern, Pose, Progress, Pulse, RangeLimits, RayTable, Return, Scene,
    SceneBuilder, Sensor, SourceInstance, scan,
};

use super::shapes::quad;

/// A parallelogram: its middle, half of its edges as vectors, and its reflectivity.
pub struct Plate(pub DVec3, pub DVec3, pub DVec3, pub f32);

/// A scene of plates, each an object with a material of its own.
pub fn scene(plates: &[Plate]) -> Scene {
    let of = |(material, &Plate(middle, a, b, _)): (u32, &Plate)| {
        let mut mesh =
            quad([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[s, t]| middle + a * s + b * t));
        mesh.parts[0].material = material;
        mesh
    };
    let meshes = (0..).zip(plates).map(of).collect();
    let instances = (0..plates.len())
        .map(|mesh| SourceInstance { mesh, world_from_mesh: DAffine3::IDENTITY, ..SourceInstance::default() })
        .collect();
    let material = |&Plate(.., rho): &Plate| Material {
        base_color: [rho, rho, rho, 1.0],
        metallic: 0.0,
        ..Material::default()
    };
    let materials = plates.iter().map(material).collect();
    SceneBuilder { meshes, instances, materials, files: vec![], groups: vec![] }.build().unwrap()
}

/// A wall across x.
pub fn wall(x: f64, rho: f32) -> Plate {
    Plate(DVec3::new(x, 0.0, 0.0), DVec3::Y * 50.0, DVec3::Z * 50.0, rho)
}

/// The power of a plate relative to a white one, as the file's material has it.
pub fn factor(rho: f32, cosine: f64) -> f64 {
    MetallicRoughness::rough(f64::from(rho)).power_factor(cosine)
}

/// A sensor of so many pulses along x, a microsecond apart.
pub fn sensor(pulses: usize, measurement: Measurement) -> Sensor {
    let pulse = |i: usize| Pulse::new(DVec3::ZERO, DVec3::X, i as f64 * 1e-6);
    let pattern = Pattern::Rays(RayTable::new((0..pulses).map(pulse).collect(), None).unwrap());
    let range = RangeLimits { max_m: 120.0, ..RangeLimits::default() };
    Sensor { range, measurement, ..Sensor::new(pattern) }
}

/// A frame of a sensor at the origin.
pub fn cast(scene: &Scene, sensor: &Sensor, frame: u64) -> Frame {
    let trajectory = Trajectory::Fixed(Pose::IDENTITY);
    let capture = Capture::new(sensor, Pose::IDENTITY, &trajectory, frame, 7);
    scan(scene, &Tracer::build(scene), &capture, &Progress::default()).unwrap()
}

/// A receiver that detects a plane of 10 % at 90 m half of the time.
pub fn receiver() -> Receiver {
    let range_pairs = vec![RangePair { reflectivity: 0.1, range_m: 90.0 }];
    let sensitivity = Sensitivity::fit(&range_pairs);
    Receiver { range_pairs, sensitivity, false_alarm: 1e-4, pulse_fwhm_s: 6e-9, ..Receiver::default() }
}

/// A sensor with nothing but a receiver.
pub fn with(receiver: Receiver) -> Measurement {
    Measurement { receiver: Some(receiver), ..Measurement::default() }
}

/// A round beam.
pub fn round(divergence_rad: f64, samples: Samples) -> Option<Footprint> {
    Some(Footprint { half_divergence: [Angle::rad(0.5 * divergence_rad); 2], exit_radius_m: 0.0, samples })
}

/// All returns of a frame that is measured.
pub fn returns(frame: &Frame) -> Vec<(Return, Echo)> {
    (0..frame.pixels())
        .flat_map(|pixel| frame.slots(pixel))
        .map(|slot| (frame.returns().get(slot), *frame.echo(slot).unwrap()))
        .collect()
}

/// Says how the plates of a scene send light back, plate by plate.
pub fn optics(mut scene: Scene, of_plates: &[Optics]) -> Scene {
    let geometry = Arc::make_mut(&mut scene.geometry);
    geometry.optics = of_plates.to_vec();
    for (index, material) in (0..).zip(&mut geometry.materials) {
        material.optics = Some(index);
    }
    scene
}

/// A surface of a kind.
pub fn kind(kind: SurfaceKind) -> Optics {
    Optics { kind: Some(kind), ..Optics::default() }
}

/// A diffuse surface.
pub fn lambert(rho: f64) -> Optics {
    Optics { reflectance: Some(rho), ..kind(SurfaceKind::Lambert) }
}

/// The only return of a pulse along x, by a receiver without false alarms.
pub fn one_return(scene: &Scene, receiver: Receiver) -> (Return, Echo) {
    let found = returns(&cast(scene, &sensor(1, with(Receiver { false_alarm: 0.0, ..receiver })), 0));
    assert_eq!(found.len(), 1, "{found:?}");
    found[0]
}

/// The power of a return, relative to that of a white plane at 1 m.
pub fn power(echo: &Echo) -> f64 {
    f64::from(echo.snr) / receiver().snr(1.0, 1.0, 120.0)
}
