//! A first scan: a LiDAR of 16 beams looks around in a room that is read from a file.
//!
//! `cargo run --release --example first_scan`

use std::error::Error;
use std::path::Path;

use beamcast::scene::gltf;
use beamcast::{Angle, Beam, Capture, Pattern, Pose, Progress, Rotating, Sensor, Tracer, Trajectory, scan};
use glam::DVec3;

/// Runs the example.
pub fn main() -> Result<(), Box<dyn Error>> {
    // The scene: read once, and made ready for rays once.
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/room.glb");
    let scene = gltf::load(&file, "room.glb", &gltf::Options::default())?.scene;
    let tracer = Tracer::build(&scene);

    // The sensor: beams from 15° above the horizon to 15° below it, 900 firings in a full turn, ten turns a second. The turn
    // begins behind and goes clockwise seen from above, so the middle column looks forward.
    let beam = |index: usize| Beam {
        elevation: Angle::deg(15.0 - 2.0 * index as f64),
        azimuth_offset: Angle::deg(0.0),
        time_s: 0.0,
        file_index: index,
    };
    let turn = (Angle::deg(180.0), Angle::deg(-180.0));
    let pattern = Rotating::new((0..16).map(beam).collect(), 900, turn, 10.0)?;
    let sensor = Sensor::new(Pattern::Rotating(pattern));

    // One frame of it, seen from 1.2 m above the middle of the floor.
    let place = Pose { translation: DVec3::new(0.0, 0.0, 1.2), ..Pose::IDENTITY };
    let standing = Trajectory::Fixed(place);
    let capture = Capture::new(&sensor, Pose::IDENTITY, &standing, 0, 0);
    let frame = scan(&scene, &tracer, &capture, &Progress::default()).expect("nobody cancels it");

    println!("{} of {} pulses came back", frame.return_count(), frame.pixels());
    for (pixel, found) in frame.iter().step_by(2000) {
        let (row, column) = (pixel / frame.columns(), pixel % frame.columns());
        println!(
            "beam {row:2}, firing {column:3}: {:6.3} m, intensity {:.2}",
            found.range_m, found.intensity
        );
    }

    // The room is closed, and the sensor has no limit of range: every pulse comes back, from at most its diagonal away.
    assert_eq!(frame.return_count(), frame.pixels());
    assert!(frame.iter().all(|(_, found)| found.range_m < 14.0));
    Ok(())
}
