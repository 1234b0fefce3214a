//! Actors, and places by name.

use std::sync::Arc;

use beamcast::frame::{Pose, UpAxis};
use beamcast::motion::Trajectory;
use beamcast::scene::gltf::{Actor, Clips, Model, Options, Place, load};
use glam::{DQuat, DVec3};
use serde_json::json;
use tempfile::TempDir;

use super::{File, NEAR, assert_near, plain, world_at};

fn drive(x: f64, speed: f64) -> Trajectory {
    let start = Pose { translation: DVec3::new(x, 0.0, 0.0), ..Pose::IDENTITY };
    Trajectory::Twist { start, linear_m_s: DVec3::new(speed, 0.0, 0.0), angular_rad_s: DVec3::ZERO }
}

/// A car with a body and a wheel that turns about z, once a second.
fn car() -> File {
    let mut file = File::new();
    file.json["materials"] = json!([{ "name": "paint" }]);
    file.json["meshes"][0]["primitives"][0]["material"] = json!(0);
    file.push("nodes", json!({ "name": "body", "mesh": 0, "extras": { "label": 3 } }));
    file.push("nodes", json!({ "name": "wheel", "mesh": 0, "translation": [0.0, 1.0, 0.0] }));
    let turn = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0];
    file.animate("roll", &[(1, "rotation", "LINEAR", &[0.0, 0.5, 1.0], &turn)]);
    file
}

#[test]
fn actors_of_one_file_share_its_meshes_and_move_on_their_own() {
    let folder = TempDir::new().unwrap();
    let mut world = File::new();
    world.push("nodes", json!({ "name": "ground", "mesh": 0 }));
    let (world, car) = (world.write(&folder, "world.gltf"), car().write(&folder, "car.gltf"));
    let (rolling, standing) = (Clips::default(), Clips { names: Some(vec![]), ..Clips::default() });
    let (there, back) = (drive(10.0, 2.0), drive(-10.0, -3.0));
    let parked = Trajectory::Fixed(Pose { translation: DVec3::new(0.0, 7.0, 0.0), ..Pose::IDENTITY });
    let model = |clips| Model::File { path: &car, display_name: "car.gltf", clips };
    let actors = [
        Actor { name: "there", model: model(&rolling), trajectory: &there, label: Some(9) },
        Actor { name: "back", model: model(&rolling), trajectory: &back, label: None },
        Actor { name: "parked", model: model(&standing), trajectory: &parked, label: None },
    ];
    let options = Options { actors: &actors, up: UpAxis::Z, ..Options::default() };
    let loaded = load(&world, "world.gltf", &options).unwrap();
    let geometry = &loaded.scene.geometry;
    let names: Vec<&str> = geometry.objects.iter().map(|object| &object.name[..]).collect();
    assert_eq!(
        names,
        ["ground", "there/body", "there/wheel", "back/body", "back/wheel", "parked/body", "parked/wheel"]
    );
    let labels = |object: usize| (geometry.objects[object].job_label, geometry.objects[object].file_label);
    assert_eq!(
        [1, 2, 3, 4].map(labels),
        [(Some(9), Some(3)), (Some(9), None), (None, Some(3)), (None, None)]
    );
    let groups: Vec<_> = geometry.groups.iter().map(|g| (&g.name[..], g.label, &g.objects[..])).collect();
    assert_eq!(
        groups,
        [("there", Some(9), &[1, 2][..]), ("back", Some(3), &[3, 4]), ("parked", Some(3), &[5, 6]),]
    );
    // The triangle of the file of cars is stored once for all four that move, and once for both that do not.
    assert_eq!(geometry.movers.len(), 4);
    assert!(geometry.movers.iter().all(|mover| mover.mesh == geometry.movers[0].mesh));
    let files: Vec<&str> = geometry.files.iter().map(|file| &file.name[..]).collect();
    assert_eq!(files, ["world.gltf", "car.gltf"]);
    assert_eq!(geometry.materials.len(), 2);
    for time in [0.0, 0.125, 0.5] {
        let objects = world_at(&loaded.scene, time);
        let (sin, cos) = libm::sincos(2.0 * std::f64::consts::PI * time);
        for (body, x) in [(1, 10.0 + 2.0 * time), (3, -10.0 - 3.0 * time)] {
            assert_near(objects[body][0][0], [x, 0.0, 0.0], NEAR);
            // What is up in the file, y, is z in the world.
            assert_near(objects[body + 1][0][1], [x + cos, 0.0, 1.0 + sin], NEAR);
        }
        assert_near(objects[6][0][1], [1.0, 7.0, 1.0], NEAR);
    }
}

#[test]
fn a_node_follows_a_trajectory_in_place_of_its_own_place() {
    let mut file = File::new();
    file.push("nodes", json!({ "name": "street", "children": [1], "translation": [100.0, 0.0, 0.0] }));
    let node = json!({
        "name": "car", "mesh": 0, "translation": [5.0, 0.0, 0.0], "rotation": [0.0, 1.0, 0.0, 0.0], "scale": [2.0, 2.0, 2.0],
        "children": [2],
    });
    file.push("nodes", node);
    file.push("nodes", json!({ "name": "eye", "translation": [0.0, 0.0, -3.0], "camera": 0 }));
    file.json["cameras"] = json!([{ "name": "Front", "type": "perspective" }]);
    let trajectory = drive(1.0, 4.0);
    let actor = Actor { name: "taxi", model: Model::Node("car"), trajectory: &trajectory, label: Some(4) };
    let places = [Place::Node("car"), Place::Camera("Front"), Place::Camera("eye")];
    let actors = [actor];
    let options = Options { actors: &actors, places: &places, ..Options::default() };
    let loaded = file.load(&options);
    let geometry = &loaded.scene.geometry;
    assert_near(world_at(&loaded.scene, 0.5)[0][0][2], [3.0, 0.0, 2.0], NEAR);
    assert_eq!((&geometry.objects[0].name[..], geometry.objects[0].job_label), ("car", Some(4)));
    assert_eq!((&geometry.groups[0].name[..], geometry.groups[0].label), ("taxi", Some(4)));
    let chain = |at: usize| Trajectory::Chain(Arc::new(loaded.places[at].clone()));
    // The trajectory of the node is the actor's, without the node's scale.
    assert_eq!(chain(0).pose_at(0.5), trajectory.pose_at(0.5));
    // The camera looks along its −z, which is the world's y.
    let pose = chain(1).pose_at(0.5);
    assert_near(pose.translation, [3.0, 6.0, 0.0], NEAR);
    assert_near(pose.direction(DVec3::X), DVec3::Y, NEAR);
    assert_near(pose.direction(DVec3::Z), DVec3::Z, NEAR);
    assert_eq!(chain(2).pose_at(0.5), pose);

    let error = |model, place: &[Place]| {
        let actors = [Actor { model, ..actor }, actor];
        file.try_load(&Options { actors: &actors[..1], places: place, ..plain() }).unwrap_err()
    };
    let told = error(Model::Node("cra"), &[]);
    assert!(
        told.contains("actor \"taxi\": the scene has no node called \"cra\" (did you mean \"car\"?"),
        "{told}"
    );
    let told = error(Model::Node("car"), &[Place::Camera("car")]);
    assert!(told.contains("the scene has no camera called \"car\""), "{told}");
    let twice = file.try_load(&Options { actors: &[actor, actor], ..plain() }).unwrap_err();
    assert!(twice.contains("another actor is the same node"), "{twice}");
    file.push("nodes", json!({ "name": "car" }));
    let told = file.try_load(&options).unwrap_err();
    assert!(told.contains("the scene has 2 nodes called \"car\": node 1 \"car\", node 3 \"car\""), "{told}");
}

#[test]
fn the_pose_of_an_animated_node_is_that_of_its_axes_in_the_world() {
    let mut file = File::new();
    file.push("nodes", json!({ "mesh": 0 }));
    file.push("nodes", json!({ "name": "vehicle" }));
    let quarter = DQuat::from_rotation_y(0.5 * std::f64::consts::PI).to_array().map(|c| c as f32);
    file.animate(
        "drive",
        &[
            (1, "translation", "LINEAR", &[0.0, 1.0], &[0.0, 0.0, 0.0, 8.0, 0.0, 0.0]),
            (1, "rotation", "LINEAR", &[0.0, 1.0], &[&[0.0, 0.0, 0.0, 1.0], &quarter[..]].concat()),
        ],
    );
    let options = Options { places: &[Place::Node("vehicle")], ..Options::default() };
    let loaded = file.load(&options);
    let trajectory = Trajectory::Chain(Arc::new(loaded.places[0].clone()));
    let (sin, cos) = libm::sincos(0.25 * std::f64::consts::PI);
    let pose = trajectory.pose_at(0.5);
    // A turn about the file's y is one about the world's z.
    assert_near(pose.translation, [4.0, 0.0, 0.0], NEAR);
    assert_near(pose.direction(DVec3::X), [cos, sin, 0.0], NEAR);
    assert_near(pose.direction(DVec3::Z), DVec3::Z, NEAR);
}

#[test]
fn what_is_wrong_with_an_actors_file_is_told_of_that_file() {
    let folder = TempDir::new().unwrap();
    let mut world = File::new();
    world.push("nodes", json!({ "mesh": 0 }));
    let world = world.write(&folder, "world.gltf");
    let mut odd = car();
    odd.json["nodes"][0]["rotation"] = json!([0, 0, 0, 0]);
    let odd = odd.write(&folder, "odd.gltf");
    let missing = folder.path().join("none.gltf");
    let (clips, trajectory) = (Clips::default(), drive(0.0, 1.0));
    let load_with = |path: &std::path::Path| {
        let model = Model::File { path, display_name: "it.gltf", clips: &clips };
        let actors = [Actor { name: "it", model, trajectory: &trajectory, label: None }];
        load(&world, "world.gltf", &Options { actors: &actors, ..Options::default() })
    };
    let loaded = load_with(&odd).unwrap();
    assert!(loaded.notices.is_empty());
    let diagnostics: Vec<_> = loaded.diagnostics(&world).map(|diagnostic| diagnostic.to_string()).collect();
    assert!(diagnostics.len() == 1 && diagnostics[0].contains("odd.gltf"), "{diagnostics:?}");
    assert_eq!(load_with(&missing).unwrap_err().path, missing);
}
