//! Animations of glTF files: nodes, skins and morph targets over time, clips, actors and places by name. Expected values are
//! closed forms, or come from a reading of the file's keyframes that is written here ([`keyframes`]).

mod actors;
mod conformance;
mod hostile;
mod keyframes;

use std::fmt::Write as _;
use std::path::PathBuf;

use beamcast::frame::UpAxis;
use beamcast::motion::Window;
use beamcast::scene::gltf::{Clips, Loaded, Options, load};
use beamcast::scene::{Scene, Surface};
use glam::DVec3;
use serde_json::{Value, json};
use tempfile::TempDir;

/// A glTF file that a test makes.
pub struct File {
    pub json: Value,
    pub data: Vec<u8>,
}

/// A node, its property, the interpolation, the times and the values.
type Moves<'a> = (usize, &'a str, &'a str, &'a [f32], &'a [f32]);

impl File {
    /// A file with one mesh, which has one triangle. It has no nodes yet.
    pub fn new() -> Self {
        let json = json!({
            "asset": { "version": "2.0" }, "bufferViews": [], "accessors": [], "meshes": [], "nodes": [], "animations": [],
        });
        let mut file = Self { json, data: Vec::new() };
        let positions = file.floats("VEC3", &CORNERS);
        file.push("meshes", json!({ "primitives": [{ "attributes": { "POSITION": positions } }] }));
        file
    }

    pub fn push(&mut self, list: &str, element: Value) -> usize {
        let list = self.json[list].as_array_mut().unwrap();
        list.push(element);
        list.len() - 1
    }

    pub fn accessor(&mut self, element: Value, bytes: &[u8]) -> usize {
        self.data.resize(self.data.len().next_multiple_of(4), 0);
        let (offset, length) = (self.data.len(), bytes.len());
        self.data.extend_from_slice(bytes);
        let view = json!({ "buffer": 0, "byteOffset": offset, "byteLength": length });
        let mut element = element;
        element["bufferView"] = json!(self.push("bufferViews", view));
        self.push("accessors", element)
    }

    /// An accessor of floats.
    pub fn floats(&mut self, kind: &str, values: &[f32]) -> usize {
        let width = match kind {
            "SCALAR" => 1,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.accessor(json!({ "componentType": 5126, "count": values.len() / width, "type": kind }), &bytes)
    }

    /// An animation of one channel for each of the moves: node, path, interpolation, times, values.
    pub fn animate(&mut self, name: &str, moves: &[Moves]) {
        let (mut channels, mut samplers) = (Vec::new(), Vec::new());
        for (number, (node, path, interpolation, times, values)) in moves.iter().enumerate() {
            let kind = match *path {
                "rotation" => "VEC4",
                "weights" => "SCALAR",
                _ => "VEC3",
            };
            let (input, output) = (self.floats("SCALAR", times), self.floats(kind, values));
            channels.push(json!({ "sampler": number, "target": { "node": node, "path": path } }));
            samplers.push(json!({ "input": input, "output": output, "interpolation": interpolation }));
        }
        self.push("animations", json!({ "name": name, "channels": channels, "samplers": samplers }));
    }

    pub fn text(&self) -> String {
        let mut uri = "data:application/octet-stream,".to_owned();
        self.data.iter().for_each(|byte| write!(uri, "%{byte:02x}").unwrap());
        let mut json = self.json.clone();
        json["buffers"] = json!([{ "byteLength": self.data.len(), "uri": uri }]);
        json.to_string()
    }

    /// Writes the file into a folder, and gives its path.
    pub fn write(&self, folder: &TempDir, name: &str) -> PathBuf {
        let path = folder.path().join(name);
        std::fs::write(&path, self.text()).unwrap();
        path
    }

    pub fn try_load(&self, options: &Options) -> Result<Loaded, String> {
        let folder = TempDir::new().unwrap();
        let path = self.write(&folder, "scene.gltf");
        load(&path, "scene.gltf", options).map_err(|error| error.to_string())
    }

    pub fn load(&self, options: &Options) -> Loaded {
        self.try_load(options).unwrap()
    }
}

pub const CORNERS: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];

/// Options that keep glTF's own axes.
pub fn plain() -> Options<'static> {
    Options { up: UpAxis::Y, ..Options::default() }
}

/// The triangles of each object at a time, in the world.
pub fn world_at(scene: &Scene, time_s: f64) -> Vec<Vec<[DVec3; 3]>> {
    let scene = scene.at(time_s);
    let mut objects = vec![Vec::new(); scene.geometry.objects.len()];
    for (number, placement) in scene.arrangement.placements.iter().enumerate() {
        let mesh = scene.mesh(placement.mesh);
        for (index, triangle) in mesh.triangles.iter().enumerate() {
            let Surface { object, .. } = scene.surface(number as u32, index as u32);
            let corners = triangle.map(|vertex| {
                let position = DVec3::from_array(mesh.positions[vertex as usize].map(f64::from));
                placement.scene_from_mesh().transform_point3(position) + scene.geometry.centre
            });
            objects[object as usize].push(corners);
        }
    }
    objects
}

/// The first corner of the first triangle of object 0, or `None` if the object is hidden.
fn first_corner(scene: &Scene, time_s: f64) -> Option<DVec3> {
    world_at(scene, time_s)[0].first().map(|corners| corners[0])
}

#[track_caller]
pub fn assert_near(found: DVec3, expected: impl Into<DVec3>, tolerance: f64) {
    let expected = expected.into();
    assert!(found.abs_diff_eq(expected, tolerance), "{found} and not {expected}");
}

/// The coordinates here are a few metres, their f32 off by up to 2⁻²³ m; a few such roundings add up.
const NEAR: f64 = 1e-6;

#[test]
fn a_translation_goes_in_steps_straight_or_along_a_spline() {
    let times: &[f32] = &[1.0, 2.0, 4.0];
    let values: &[f32] = &[0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 2.0, -8.0, 0.0];
    #[rustfmt::skip]
    let spline: &[f32] = &[
        0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.0, 0.0, 0.0,
        0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 1.0, 0.0,
        0.0, 3.0, 0.0, 2.0, -8.0, 0.0, 0.0, 0.0, 0.0,
    ];
    // A Hermite spline at the middle of a span h is (a + b)/2 + h·(m − n)/8 of the values a, b and the tangents m, n.
    type Case = (&'static str, &'static [f32], [[f64; 3]; 5]);
    let cases: [Case; 3] = [
        ("STEP", values, [[0.0; 3], [0.0; 3], [2.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, -8.0, 0.0]]),
        ("LINEAR", values, [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, -4.0, 0.0], [2.0, -8.0, 0.0]]),
        (
            "CUBICSPLINE",
            spline,
            [[0.0; 3], [1.5, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, -4.5, 0.0], [2.0, -8.0, 0.0]],
        ),
    ];
    for (interpolation, values, expected) in cases {
        let mut file = File::new();
        file.push("nodes", json!({ "mesh": 0, "translation": [9.0, 9.0, 9.0] }));
        file.animate("go", &[(0, "translation", interpolation, times, values)]);
        let loaded = file.load(&plain());
        assert!(loaded.notices.is_empty(), "{:?}", loaded.notices);
        for (time, expected) in [0.0, 1.5, 2.0, 3.0, 99.0].into_iter().zip(expected) {
            assert_near(first_corner(&loaded.scene, time).unwrap(), expected, NEAR);
        }
    }
}

#[test]
fn rotations_take_the_shorter_way_and_integers_are_fractions() {
    // Half a turn about z in 16-bit integers: (0, 0, 0, 1) to (0, 0, sin 45°, cos 45°), and that to its own negative, which is
    // the same rotation.
    let half = (0.5_f64.sqrt() * 32767.0).round() as i16;
    let quaternions = [[0, 0, 0, 32767], [0, 0, half, half], [0, 0, -half, -half]];
    let bytes: Vec<u8> = quaternions.iter().flatten().flat_map(|c: &i16| c.to_le_bytes()).collect();
    let mut file = File::new();
    file.push("nodes", json!({ "mesh": 0, "scale": [2.0, 2.0, 2.0] }));
    file.animate("turn", &[(0, "rotation", "LINEAR", &[0.0, 1.0, 2.0], &[0.0; 12])]);
    let output = file
        .accessor(json!({ "componentType": 5122, "normalized": true, "count": 3, "type": "VEC4" }), &bytes);
    file.json["animations"][0]["samplers"][0]["output"] = json!(output);
    let loaded = file.load(&plain());
    for (time, degrees) in [(0.0, 0.0_f64), (0.5, 45.0), (1.0, 90.0), (1.3, 90.0), (5.0, 90.0)] {
        let (sin, cos) = libm::sincos(degrees.to_radians());
        let second = world_at(&loaded.scene, time)[0][0][1];
        assert_near(second, [2.0 * cos, 2.0 * sin, 0.0], NEAR);
    }
}

/// A wheel on an arm: the arm turns, the wheel's hub goes out along it, and a spoke stands still on the hub.
#[test]
fn what_hangs_below_moves_along_and_all_else_stays() {
    let mut file = File::new();
    file.push("nodes", json!({ "name": "arm", "children": [1], "translation": [1.0, 0.0, 0.0] }));
    file.push("nodes", json!({ "name": "hub", "children": [2] }));
    file.push("nodes", json!({ "name": "spoke", "mesh": 0, "translation": [0.0, 0.0, 3.0] }));
    file.push("nodes", json!({ "name": "ground", "mesh": 0, "translation": [0.0, -5.0, 0.0] }));
    let half = 0.5_f32.sqrt();
    file.animate(
        "swing",
        &[
            (0, "rotation", "LINEAR", &[0.0, 2.0], &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, half, half]),
            (1, "translation", "LINEAR", &[0.0, 2.0], &[0.0, 0.0, 0.0, 4.0, 0.0, 0.0]),
        ],
    );
    let loaded = file.load(&plain());
    let scene = &loaded.scene;
    // Only the spoke moves; the ground is stored with all that stands still.
    assert_eq!(scene.geometry.movers.len(), 1);
    for time in [0.0, 0.4, 1.0, 1.7, 2.0] {
        let (sin, cos) = libm::sincos(f64::from(time as f32) * 45.0_f64.to_radians());
        let out = 2.0 * time;
        let objects = world_at(scene, time);
        assert_near(objects[0][0][0], [1.0 + out * cos, out * sin, 3.0], NEAR);
        assert_near(objects[1][0][0], [0.0, -5.0, 0.0], NEAR);
    }
    let [group] = &scene.geometry.groups[..] else { panic!("{:?}", scene.geometry.groups) };
    assert_eq!((&group.name[..], &group.objects[..]), ("arm", &[0][..]));
    let at = group.world_from_group.at(2.0).unwrap();
    assert_near(at.transform_point3(DVec3::X), [1.0, 1.0, 0.0], NEAR);
}

#[test]
fn clips_are_chosen_begin_when_they_are_told_and_go_round() {
    let mut file = File::new();
    file.push("nodes", json!({ "mesh": 0 }));
    file.animate("walk", &[(0, "translation", "LINEAR", &[0.5, 2.0], &[1.0, 0.0, 0.0, 4.0, 0.0, 0.0])]);
    file.animate("fly", &[(0, "translation", "STEP", &[0.0, 1.0], &[0.0, 5.0, 0.0, 0.0, 7.0, 0.0])]);
    let x_at = |clips: &Clips, time: f64| {
        let loaded = file.load(&Options { clips, ..plain() });
        first_corner(&loaded.scene, time).unwrap()
    };
    let walk = Clips { names: Some(vec!["walk".into()]), start_s: 10.0, ..Clips::default() };
    for (time, x) in [(0.0, 1.0), (10.5, 1.0), (11.0, 2.0), (12.0, 4.0), (99.0, 4.0)] {
        assert_near(x_at(&walk, time), [x, 0.0, 0.0], NEAR);
    }
    // A clip goes from 0 to its last keyframe: here it is 2 s long.
    let looped = Clips { is_looped: true, ..walk.clone() };
    for (time, x) in [(11.0, 2.0), (13.0, 2.0), (15.5, 3.0), (9.0, 2.0)] {
        assert_near(x_at(&looped, time), [x, 0.0, 0.0], NEAR);
    }
    let fly = Clips { names: Some(vec!["fly".into()]), ..Clips::default() };
    assert_near(x_at(&fly, 0.9), [0.0, 5.0, 0.0], NEAR);
    // All of them move the same node: the first counts, and that is told.
    let all = file.load(&plain());
    assert_near(first_corner(&all.scene, 2.0).unwrap(), [4.0, 0.0, 0.0], NEAR);
    let told = all.notices[0].to_string();
    assert!(told.starts_with("animation 1 \"fly\", node 0: an animation that is played before it"), "{told}");
    let unknown = Clips { names: Some(vec!["wlak".into()]), ..Clips::default() };
    let error = file.try_load(&Options { clips: &unknown, ..plain() }).unwrap_err();
    assert!(error.contains("there is no animation \"wlak\""), "{error}");
}

/// Two joints, of which the upper one turns by 90° about z: vertices of the strip hang on the lower, on both, and on the upper.
fn strip() -> File {
    let mut file = File::new();
    let positions: &[f32] = &[-1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 2.0, 0.0];
    let positions = file.floats("VEC3", positions);
    let indices =
        file.accessor(json!({ "componentType": 5121, "count": 6, "type": "SCALAR" }), &[0, 1, 2, 2, 1, 3]);
    let joints = file.accessor(
        json!({ "componentType": 5121, "count": 4, "type": "VEC4" }),
        &[0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 0],
    );
    #[rustfmt::skip]
    let weights = file.floats("VEC4", &[
        1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.5, 0.5, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0,
    ]);
    let identity = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let down_by = |y: f32| [&identity[..], &[0.0, -y, 0.0, 1.0]].concat();
    let bind = file.floats("MAT4", &[down_by(0.0), down_by(1.0)].concat());
    file.push(
        "meshes",
        json!({ "primitives": [{
            "attributes": { "POSITION": positions, "JOINTS_0": joints, "WEIGHTS_0": weights }, "indices": indices,
        }] }),
    );
    file.json["skins"] = json!([{ "joints": [2, 3], "inverseBindMatrices": bind }]);
    file.push("nodes", json!({ "name": "walker", "children": [1, 2] }));
    file.push("nodes", json!({ "name": "skin", "mesh": 1, "skin": 0, "translation": [50.0, 0.0, 0.0] }));
    file.push("nodes", json!({ "name": "hip", "children": [3] }));
    file.push("nodes", json!({ "name": "knee", "translation": [0.0, 1.0, 0.0] }));
    let half = 0.5_f32.sqrt();
    file.animate(
        "bend",
        &[
            (3, "rotation", "LINEAR", &[0.0, 1.0], &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, half, half]),
            (0, "translation", "LINEAR", &[0.0, 1.0], &[0.0, 0.0, 0.0, 10.0, 0.0, 0.0]),
        ],
    );
    file
}

#[test]
fn a_skin_bends_by_its_joints_and_goes_with_what_is_above_them() {
    let loaded = strip().load(&plain());
    let scene = &loaded.scene;
    assert_eq!(scene.geometry.movers.len(), 1);
    assert!(scene.geometry.movers[0].deformer.is_some());
    for time in [0.0, 0.25, 0.5, 1.0, 3.0] {
        let done = f64::min(time, 1.0);
        let (sin, cos) = libm::sincos(done * 90.0_f64.to_radians());
        let [first, second] = world_at(scene, time)[0][..] else { panic!("two triangles") };
        let x = 10.0 * done;
        assert_near(first[0], [x - 1.0, 0.0, 0.0], 1e-5);
        assert_near(first[1], [x + 1.0, 0.0, 0.0], 1e-5);
        // The knee turns about (0, 1): there it does not move.
        assert_near(first[2], [x, 1.0, 0.0], 1e-5);
        assert_near(second[2], [x + cos - sin, 1.0 + sin + cos, 0.0], 1e-5);
    }
    let [group] = &scene.geometry.groups[..] else { panic!("{:?}", scene.geometry.groups) };
    assert_eq!((&group.name[..], &group.objects[..]), ("walker", &[0][..]));
    // Within a frame only bending is cut into slices: what carries all joints moves every ray's own way.
    let mover = &scene.geometry.movers[0];
    let moved = mover.motion.at(0.75).unwrap().translation - mover.motion.at(0.25).unwrap().translation;
    assert_near(moved, [5.0, 0.0, 0.0], NEAR);
}

#[test]
fn a_skin_whose_joints_move_as_one_does_not_bend() {
    let mut file = strip();
    let channels = file.json["animations"][0]["channels"].as_array_mut().unwrap();
    channels.remove(0);
    let scene = file.load(&plain()).scene;
    assert!(scene.geometry.movers[0].deformer.is_none());
    assert_near(world_at(&scene, 0.5)[0][1][2], [6.0, 2.0, 0.0], NEAR);
}

#[test]
fn morph_targets_follow_their_weights() {
    let mut file = File::new();
    let target = file.floats("VEC3", &[0.0, 0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0]);
    let other = file.floats("VEC3", &[1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    file.json["meshes"][0]["primitives"][0]["targets"] =
        json!([{ "POSITION": target }, { "POSITION": other }]);
    file.json["meshes"][0]["weights"] = json!([0.5, 0.0]);
    file.push("nodes", json!({ "mesh": 0 }));
    file.push("nodes", json!({ "mesh": 0, "translation": [0.0, 0.0, 9.0] }));
    file.animate("smile", &[(0, "weights", "LINEAR", &[0.0, 1.0], &[0.0, 0.0, 1.0, -0.5])]);
    let scene = file.load(&plain()).scene;
    assert_eq!(scene.geometry.movers.len(), 1);
    for time in [0.0, 0.3, 1.0] {
        let [corners] = world_at(&scene, time)[0][..] else { panic!("one triangle") };
        assert_near(corners[0], [-0.5 * time, 0.0, 0.0], NEAR);
        assert_near(corners[1], [1.0, 0.0, 2.0 * time], NEAR);
    }
    // The other node has the mesh's own weights.
    assert_near(world_at(&scene, 0.3)[1][0][1], [1.0, 0.0, 10.0], NEAR);
}

#[test]
fn a_node_is_hidden_at_times() {
    let mut file = File::new();
    file.push(
        "nodes",
        json!({ "children": [1], "extensions": { "KHR_node_visibility": { "visible": false } } }),
    );
    file.push("nodes", json!({ "mesh": 0 }));
    file.push("nodes", json!({ "mesh": 0, "translation": [0.0, 9.0, 0.0] }));
    let input = file.floats("SCALAR", &[0.0, 1.0, 2.0]);
    let output = file.accessor(json!({ "componentType": 5121, "count": 3, "type": "SCALAR" }), &[1, 0, 1]);
    let pointer = json!({ "pointer": "/nodes/0/extensions/KHR_node_visibility/visible" });
    file.push(
        "animations",
        json!({
            "channels": [
                { "sampler": 0, "target": { "path": "pointer", "extensions": { "KHR_animation_pointer": pointer } } },
                { "sampler": 0, "target": { "path": "pointer", "extensions": {
                    "KHR_animation_pointer": { "pointer": "/materials/0/emissiveFactor" } } } },
            ],
            "samplers": [{ "input": input, "output": output, "interpolation": "STEP" }],
        }),
    );
    let loaded = file.load(&plain());
    let seen = |time: f64| world_at(&loaded.scene, time).iter().map(Vec::len).collect::<Vec<_>>();
    assert_eq!([0.0, 0.9, 1.0, 1.9, 2.0].map(seen), [[1, 1], [1, 1], [0, 1], [0, 1], [1, 1]]);
    let told = loaded.notices[0].to_string();
    assert_eq!(told, "animation 0, channel 1: it moves no node (KHR_animation_pointer), and is not read");
}

#[test]
fn instances_of_a_mesh_move_with_their_node() {
    let mut file = File::new();
    let places = file.floats("VEC3", &[0.0, 0.0, 0.0, 0.0, 0.0, 5.0]);
    let instancing = json!({ "EXT_mesh_gpu_instancing": { "attributes": { "TRANSLATION": places } } });
    file.push("nodes", json!({ "mesh": 0, "extensions": instancing }));
    file.animate("go", &[(0, "translation", "LINEAR", &[0.0, 1.0], &[0.0, 0.0, 0.0, 3.0, 0.0, 0.0])]);
    let scene = file.load(&plain()).scene;
    let objects = world_at(&scene, 0.5);
    assert_near(objects[0][0][0], [1.5, 0.0, 0.0], NEAR);
    assert_near(objects[1][0][0], [1.5, 0.0, 5.0], NEAR);
    assert_eq!(scene.geometry.groups[0].objects, [0, 1]);
}

/// Exporters write keyframes for bones that stand still. A scene with such animations is the scene without them, bit for bit.
#[test]
fn what_stands_still_costs_nothing() {
    let mut file = File::new();
    file.push(
        "nodes",
        json!({ "children": [1], "translation": [0.1, 0.2, 0.3], "rotation": [0.0, 0.6, 0.0, 0.8] }),
    );
    file.push("nodes", json!({ "mesh": 0, "scale": [1.0, 0.7, 1.0] }));
    let without = file.load(&Options::default()).scene;
    let tangents = [0.0; 3];
    let spline =
        [&tangents[..], &[1.0, 0.7, 1.0], &tangents, &tangents, &[1.0, 0.7, 1.0], &tangents].concat();
    file.json["nodes"][1]["scale"] = json!([1.0, f64::from(0.7_f32), 1.0]);
    file.animate(
        "stand",
        &[
            (0, "rotation", "LINEAR", &[0.0, 5.0], &[0.0, 0.6, 0.0, 0.8, 0.0, 0.6, 0.0, 0.8]),
            (1, "scale", "CUBICSPLINE", &[0.0, 5.0], &spline),
        ],
    );
    let with = file.load(&Options::default()).scene;
    assert!(with.geometry.movers.is_empty() && with.geometry.groups.is_empty());
    assert_eq!(with.arrangement.placements, without.arrangement.placements);
    let [a, b] = [&with, &without].map(|scene| &scene.geometry.meshes[0].positions);
    for (a, b) in a.as_flattened().iter().zip(b.as_flattened()) {
        // 0.6 and 0.7 are rounded to f32 in keyframes: half an ulp of each, of coordinates of about 1.
        assert!((a - b).abs() <= 2e-7, "{a} {b}");
    }
}

/// The knee of the strip turns by 9° in a tenth of a second, and its farthest vertex is √2 away from it. What carries the joints is
/// not sliced, and costs nothing.
#[test]
fn what_slices_cost_is_known() {
    let scene = strip().load(&plain()).scene;
    let window = Window { from_s: 0.0, to_s: 0.2 };
    for (slice_s, degrees) in [(None, 9.0_f64), (Some(0.1), 4.5), (Some(0.02), 0.9)] {
        let slicing = scene.slicing(window, slice_s).unwrap();
        let chord = 2.0 * libm::sin(degrees.to_radians() / 2.0) * 2.0_f64.sqrt();
        assert_eq!(slicing.object, 0);
        assert!((slicing.distance_m - chord).abs() < NEAR, "{slicing:?} {chord}");
    }
    let mut still = File::new();
    still.push("nodes", json!({ "mesh": 0 }));
    assert_eq!(still.load(&plain()).scene.slicing(window, None), None);
}
