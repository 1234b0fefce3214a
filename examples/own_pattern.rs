//! A pattern of your own: a spiral of 500 pulses, cast at a wall that is made in code.
//!
//! `cargo run --release --example own_pattern`

use std::error::Error;
use std::f64::consts::PI;

use beamcast::{
    Angle, Capture, Material, Pattern, Progress, Pulse, RayTable, SceneBuilder, Sensor, SourceInstance,
    SourceMesh, SourcePart, Tracer, scan, sensor,
};
use glam::{DAffine3, DVec3};

/// Runs the example.
pub fn main() -> Result<(), Box<dyn Error>> {
    // A wall of 20 m by 20 m, ten metres ahead of the sensor: two triangles that share an edge.
    let wall = SourceMesh {
        positions: vec![[10.0, -10.0, -10.0], [10.0, 10.0, -10.0], [10.0, 10.0, 10.0], [10.0, -10.0, 10.0]],
        parts: vec![SourcePart {
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            material: 0,
            ..SourcePart::default()
        }],
    };
    let instance = SourceInstance { mesh: 0, world_from_mesh: DAffine3::IDENTITY, ..Default::default() };
    let scene = SceneBuilder {
        meshes: vec![wall],
        instances: vec![instance],
        materials: vec![Material::default()],
        files: vec![],
        groups: vec![],
    }
    .build()?;

    // Any list of pulses is a pattern: here ten turns outward to 30° from straight ahead, a pulse every 20 µs.
    let pulse = |index: u32| {
        let part = f64::from(index) / 499.0;
        let (sin, cos) = Angle::rad(20.0 * PI * part).sin_cos();
        let (azimuth, elevation) = (Angle::deg(30.0 * part * cos), Angle::deg(30.0 * part * sin));
        Pulse::new(DVec3::ZERO, sensor::direction(azimuth, elevation), f64::from(index) * 20e-6)
    };
    let table = RayTable::new((0..500).map(pulse).collect(), Some(100.0))?;
    let sensor = Sensor::new(Pattern::Rays(table));

    // The sensor stands at the world's origin. Its image has one row, with a column for each pulse.
    let capture = Capture::at_origin(&sensor);
    let frame =
        scan(&scene, &Tracer::build(&scene), &capture, &Progress::default()).expect("nobody cancels it");
    for column in (0..frame.columns()).step_by(100) {
        let pulse = capture.pulse(0, column).expect("each column of a table has its pulse");
        let found = frame.get(0, column).expect("the wall fills the view");
        println!("{:5.2} ms: {:.4} m", pulse.time_s * 1e3, found.range_m);
        // A wall across x has the range 10 m over the direction's part along x.
        assert!((found.range_m - 10.0 / pulse.direction.x).abs() < 1e-9);
    }
    assert_eq!(frame.return_count(), 500);
    Ok(())
}
