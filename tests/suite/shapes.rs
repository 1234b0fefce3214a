//! Small scenes that are made in code.

use beamcast::frame::Pose;
use beamcast::motion::Trajectory;
use beamcast::rng::Rng;
use beamcast::scan::{Frame, Progress, scan};
use beamcast::scene::{Material, Scene, SceneBuilder, SourceInstance, SourceMesh, SourcePart};
use beamcast::sensor::{Capture, Sensor};
use beamcast::trace::Cast;
use glam::{DAffine3, DVec3};

pub fn mesh(positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>) -> SourceMesh {
    SourceMesh { positions, parts: vec![SourcePart { triangles, material: 0, ..SourcePart::default() }] }
}

/// The first frame of a sensor that stands at a pose.
pub fn seen_from(scene: &Scene, tracer: &impl Cast, sensor: &Sensor, world_from_sensor: &Pose) -> Frame {
    let trajectory = Trajectory::Fixed(*world_from_sensor);
    let capture = Capture::new(sensor, Pose::IDENTITY, &trajectory, 0, 0);
    scan(scene, tracer, &capture, &Progress::default()).unwrap()
}

/// A scene of meshes. Each pair (mesh, world_from_mesh) places one of them.
pub fn placed(meshes: Vec<SourceMesh>, placements: Vec<(usize, DAffine3)>) -> Scene {
    let instances = placements.into_iter().map(|(mesh, world_from_mesh)| SourceInstance {
        mesh,
        world_from_mesh,
        ..SourceInstance::default()
    });
    let instances = instances.collect();
    SceneBuilder { meshes, instances, materials: vec![Material::default()], files: vec![], groups: vec![] }
        .build()
        .unwrap()
}

/// A scene of one mesh at its own coordinates.
pub fn alone(mesh: SourceMesh) -> Scene {
    placed(vec![mesh], vec![(0, DAffine3::IDENTITY)])
}

/// A quadrilateral of two triangles, from its corners in order around it.
pub fn quad(corners: [DVec3; 4]) -> SourceMesh {
    mesh(corners.map(|c| c.as_vec3().to_array()).to_vec(), vec![[0, 1, 2], [0, 2, 3]])
}

/// A closed box whose faces point outward.
pub fn cuboid(low: [f32; 3], high: [f32; 3]) -> SourceMesh {
    let corner = |i: usize| [0, 1, 2].map(|axis| if i >> axis & 1 == 0 { low[axis] } else { high[axis] });
    let triangles = vec![
        [0, 2, 1],
        [1, 2, 3],
        [4, 5, 6],
        [5, 7, 6],
        [0, 1, 4],
        [1, 5, 4],
        [2, 6, 3],
        [3, 6, 7],
        [0, 4, 2],
        [2, 4, 6],
        [1, 3, 5],
        [3, 7, 5],
    ];
    mesh((0..8).map(corner).collect(), triangles)
}

/// A closed sphere of 8·4^levels triangles: an octahedron whose faces are divided into four, `levels` times.
pub fn sphere(radius: f64, centre: DVec3, levels: u32) -> SourceMesh {
    let mut points = vec![DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
    let mut triangles: Vec<[u32; 3]> =
        vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    for _ in 0..levels {
        let mut middles = std::collections::HashMap::new();
        let mut next = Vec::new();
        for [a, b, c] in triangles {
            let mut middle = |p: u32, q: u32| {
                *middles.entry((p.min(q), p.max(q))).or_insert_with(|| {
                    points.push((points[p as usize] + points[q as usize]).normalize());
                    points.len() as u32 - 1
                })
            };
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            next.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = next;
    }
    mesh(points.into_iter().map(|p| (p * radius + centre).as_vec3().to_array()).collect(), triangles)
}

/// Random triangles in the cube from −1 to 1, of any shape up to `size`.
pub fn soup(random: &mut Rng, count: u32, size: f64) -> SourceMesh {
    let mut positions = Vec::new();
    for _ in 0..count {
        let middle = random.point();
        let stretch = DVec3::new(random.unit(), random.unit(), random.unit()) * size;
        for _ in 0..3 {
            positions.push((middle + random.point() * stretch).as_vec3().to_array());
        }
    }
    mesh(positions, (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
}
