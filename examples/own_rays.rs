//! Rays of your own, without a sensor: how high is the ground, and what is in the way?
//!
//! `cargo run --release --example own_rays`

use std::error::Error;
use std::path::Path;

use beamcast::scene::gltf;
use beamcast::{Cast, Origins, Rays, Tracer};
use glam::DVec3;

/// Runs the example.
pub fn main() -> Result<(), Box<dyn Error>> {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/room.glb");
    let scene = gltf::load(&file, "room.glb", &gltf::Options::default())?.scene;
    let tracer = Tracer::build(&scene);

    // Straight down from under the ceiling, every half metre along the room. Each ray has an origin of its own.
    let origins: Vec<_> = (-8..=8).map(|step| DVec3::new(0.5 * f64::from(step), 0.3, 2.5)).collect();
    let directions = vec![-DVec3::Z; origins.len()];
    let down = Rays::unlimited(Origins::Each(&origins), &directions);
    let mut hits = vec![None; origins.len()];
    tracer.cast(&down, &mut hits);
    for (origin, hit) in origins.iter().zip(&hits) {
        let hit = hit.expect("the floor is below everything");
        let name = &scene.geometry.objects[scene.surface(hit.placement, hit.triangle).object as usize].name;
        println!("x = {:4.1} m: {:.3} m high, {name}", origin.x, origin.z - hit.t);
        assert!((0.0..2.5).contains(&(origin.z - hit.t + 1e-9)));
    }

    // Lines of sight from one point to others. Their directions reach from point to point, so t = 1 is the other point.
    let eye = DVec3::new(-4.5, 0.0, 1.5);
    let targets = [DVec3::new(4.5, 0.0, 1.5), DVec3::new(20.0, 0.0, 1.5)];
    let towards = targets.map(|target| target - eye);
    let sight = Rays { t_max: 1.0, ..Rays::unlimited(Origins::Common(eye), &towards) };
    let mut blocked = [false; 2];
    tracer.blocked(&sight, &mut blocked);
    for (target, blocked) in targets.iter().zip(blocked) {
        println!("{target} is {}", if blocked { "hidden" } else { "in sight" });
    }
    assert!(blocked[1], "the second target is outside, behind a wall");
    Ok(())
}
