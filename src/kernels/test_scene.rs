//! The scenes that methods are measured on when no scene is given. They are made in code, so that no file has to be found.

use glam::{DMat3, DVec3};

use crate::rng::Rng;
use crate::scene::{Material, Scene, SceneBuilder, SourceInstance, SourceMesh, SourcePart};

/// Uneven ground, 200 m square, with houses and round trees on it: about 90,000 triangles. The world's origin is left free for a
/// sensor 1.8 m above the ground.
pub fn yard() -> Scene {
    let mut random = Rng::new(1);
    let mut shape = ground(160, 200.0);
    let mut place = || loop {
        let p = DVec3::new(random.signed(), random.signed(), 0.0) * 90.0;
        if p.length() > 12.0 {
            return (p, DVec3::new(random.unit(), random.unit(), random.unit()));
        }
    };
    for _ in 0..40 {
        let (p, size) = place();
        append(&mut shape, &house(p, DVec3::new(3.0, 3.0, 3.0) + size * 6.0));
    }
    for _ in 0..70 {
        let (p, size) = place();
        let radius = 1.0 + size.x * 2.0;
        append(
            &mut shape,
            &sphere(3, DMat3::from_diagonal(DVec3::splat(radius)), p + DVec3::Z * (radius + size.y)),
        );
    }
    alone(shape)
}

/// A closed sphere of 20 m radius with 2,048 triangles, turned so that no coordinate is special. Its triangles face outwards,
/// or inwards if `inside_out` is set.
pub fn closed(inside_out: bool) -> Scene {
    // Any rotation will do; this is the one of the unit quaternion (2, 3, 5, 7)/√87.
    let turn = DMat3::from_quat(glam::DQuat::from_array([2.0, 3.0, 5.0, 7.0]).normalize());
    let mut shape = sphere(4, turn * 20.0, DVec3::ZERO);
    if inside_out {
        for triangle in &mut shape.parts[0].triangles {
            triangle.swap(1, 2);
        }
    }
    alone(shape)
}

fn alone(shape: SourceMesh) -> Scene {
    let placed =
        SourceInstance { mesh: 0, world_from_mesh: glam::DAffine3::IDENTITY, ..SourceInstance::default() };
    let builder = SceneBuilder {
        meshes: vec![shape],
        instances: vec![placed],
        materials: vec![Material::default()],
        files: Vec::new(),
        groups: Vec::new(),
    };
    builder.build().expect("the shapes made here have triangles, few of them, and none far away")
}

fn append(to: &mut SourceMesh, shape: &SourceMesh) {
    let first = to.positions.len() as u32;
    to.positions.extend(&shape.positions);
    to.parts[0].triangles.extend(shape.parts[0].triangles.iter().map(|t| t.map(|v| v + first)));
}

fn mesh(positions: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> SourceMesh {
    let positions = positions.into_iter().map(|p| p.as_vec3().to_array()).collect();
    SourceMesh { positions, parts: vec![SourcePart { triangles, material: 0, ..SourcePart::default() }] }
}

/// A square of `cells`² quadrilaterals, each of two triangles.
fn ground(cells: u32, side: f64) -> SourceMesh {
    let step = side / f64::from(cells);
    let height = |x: f64, y: f64| {
        0.15 * libm::sin(x * 0.7) * libm::cos(y * 0.45) + 0.3 * libm::sin(x * 0.05 + y * 0.08)
    };
    let positions = (0..=cells).flat_map(|j| {
        (0..=cells).map(move |i| {
            let (x, y) = (f64::from(i) * step - side / 2.0, f64::from(j) * step - side / 2.0);
            DVec3::new(x, y, height(x, y))
        })
    });
    let row = cells + 1;
    let triangles = (0..cells).flat_map(|j| {
        (0..cells).flat_map(move |i| {
            let at = j * row + i;
            [[at, at + 1, at + row + 1], [at, at + row + 1, at + row]]
        })
    });
    mesh(positions.collect(), triangles.collect())
}

/// A box on the ground.
fn house(middle: DVec3, size: DVec3) -> SourceMesh {
    let corner = |i: u32| {
        let side = |axis: u32| if i >> axis & 1 == 0 { -0.5 } else { 0.5 };
        middle + DVec3::new(side(0), side(1), side(2) + 0.4) * size
    };
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

/// A closed unit sphere, transformed by `map` and moved to `middle`: an octahedron whose faces are cut in four `levels` times.
fn sphere(levels: u32, map: DMat3, middle: DVec3) -> SourceMesh {
    let mut points = vec![DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
    let mut triangles: Vec<[u32; 3]> =
        vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
    for _ in 0..levels {
        let mut middles = std::collections::HashMap::new();
        let mut finer = Vec::with_capacity(4 * triangles.len());
        for [a, b, c] in triangles {
            let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(p, q): (u32, u32)| {
                *middles.entry((p.min(q), p.max(q))).or_insert_with(|| {
                    points.push((points[p as usize] + points[q as usize]).normalize());
                    points.len() as u32 - 1
                })
            });
            finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
        }
        triangles = finer;
    }
    mesh(points.into_iter().map(|p| map * p + middle).collect(), triangles)
}
