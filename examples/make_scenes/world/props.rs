//! Street furniture and people. Each object stands at the origin, and its front, if it has one, faces +x.

use glam::{DAffine3, DMat3, DVec3};

use super::glb::Material;
use super::mesh::{Mesh, circle, ellipse, sincos_deg, turned, v};
use super::room::SUNK;

/// The posture of a person.
#[derive(Clone, Copy)]
pub enum Posture {
    Standing,
    Walking,
    Waving,
}

#[derive(Clone, Copy)]
pub struct Clothes {
    pub skin: Material,
    pub hair: Material,
    pub top: Material,
    pub trousers: Material,
    pub shoes: Material,
}

/// A person 1.75 m tall.
pub fn person(posture: Posture, clothes: &Clothes) -> Mesh {
    let mut mesh = Mesh::new();
    let c = clothes;
    let stride: f64 = if matches!(posture, Posture::Walking) { 1.0 } else { 0.12 };
    for (side, step) in [(1.0, stride), (-1.0, -stride)] {
        let hip = v(0.0, side * 0.095, 0.9);
        let knee = v(0.12 * step.max(0.0) + 0.04, side * 0.1, 0.5 + 0.02 * step.abs());
        let ankle = v(0.24 * step - 0.05 * step * step, side * 0.1, 0.09 + (0.06 * -step).max(0.0));
        mesh.limb(
            &[
                (hip, 0.092),
                (hip.lerp(knee, 0.5), 0.08),
                (knee, 0.062),
                (knee.lerp(ankle, 0.35), 0.062),
                (ankle, 0.046),
            ],
            16,
            c.trousers,
        );
        mesh.ellipsoid(ankle + v(0.055, 0.0, -0.046), v(0.135, 0.05, 0.046), 14, 8, c.shoes);

        let shoulder = v(-0.01, side * 0.19, 1.42);
        let (elbow, hand) = match posture {
            Posture::Waving if side > 0.0 => (v(0.08, 0.4, 1.5), v(0.12, 0.42, 1.78)),
            _ => (v(-0.06 - 0.1 * step, side * 0.25, 1.14), v(0.06 - 0.22 * step, side * 0.24, 0.9)),
        };
        mesh.limb(&[(shoulder, 0.058), (elbow, 0.045), (elbow.lerp(hand, 0.85), 0.036)], 14, c.top);
        mesh.ellipsoid(hand, v(0.04, 0.028, 0.058), 10, 8, c.skin);
    }
    let torso = [
        (0.84, 0.1, 0.14),
        (0.88, 0.115, 0.165),
        (0.98, 0.115, 0.16),
        (1.1, 0.1, 0.145),
        (1.25, 0.12, 0.175),
        (1.36, 0.12, 0.195),
        (1.44, 0.1, 0.185),
        (1.48, 0.075, 0.13),
        (1.5, 0.06, 0.07),
    ];
    let rings: Vec<_> = torso.iter().map(|&(z, x, y)| ellipse(v(0.0, 0.0, z), x, y, 24)).collect();
    mesh.loft(&rings, |i, _| if i < 2 { c.trousers } else { c.top });
    mesh.tube(&[(v(0.0, 0.0, 1.46), 0.055), (v(0.015, 0.0, 1.58), 0.05)], 14, c.skin);
    mesh.ellipsoid(v(0.025, 0.0, 1.64), v(0.095, 0.075, 0.115), 20, 14, c.skin);
    mesh.ellipsoid(v(0.005, 0.0, 1.665), v(0.1, 0.083, 0.1), 20, 14, c.hair);
    mesh.ellipsoid(v(0.118, 0.0, 1.625), v(0.018, 0.013, 0.022), 8, 6, c.skin);
    mesh
}

/// A street lamp 7 m tall whose arm reaches 1.8 m along +x.
pub fn lamp(steel: Material, glass: Material) -> Mesh {
    let mut mesh = Mesh::new();
    mesh.tube(&[(v(0.0, 0.0, -SUNK), 0.1), (v(0.0, 0.0, 1.2), 0.1)], 20, steel);
    let mut path = vec![(v(0.0, 0.0, 1.15), 0.075), (v(0.0, 0.0, 6.0), 0.055)];
    path.extend((1..=8).map(|i| {
        let (s, c) = sincos_deg(11.25 * f64::from(i));
        (v(0.9 - 0.9 * c, 0.0, 6.0 + 0.9 * s), 0.05)
    }));
    path.push((v(1.8, 0.0, 6.95), 0.04));
    mesh.tube(&path, 16, steel);
    mesh.ellipsoid(v(1.75, 0.0, 6.94), v(0.36, 0.15, 0.09), 20, 10, steel);
    mesh.ellipsoid(v(1.78, 0.0, 6.9), v(0.28, 0.12, 0.085), 16, 8, glass);
    mesh
}

/// A plate about x = 0.06 on a post, facing +x. `outline` holds (y, z) relative to the plate's middle, counter-clockwise
/// seen from the front.
pub fn sign(outline: &[(f64, f64)], height: f64, face: Material, steel: Material) -> Mesh {
    let mut mesh = Mesh::new();
    let ring = |x: f64| outline.iter().map(|&(y, z)| v(x, y, height + z)).collect::<Vec<_>>();
    mesh.prism(&ring(0.045), &ring(0.06), face);
    let reach = outline.iter().map(|p| p.1).fold(0.0, f64::max);
    mesh.tube(&[(v(0.0, 0.0, -SUNK), 0.03), (v(0.0, 0.0, height + reach * 0.9), 0.03)], 12, steel);
    for z in [-0.12, 0.12] {
        mesh.cuboid(v(0.02, -0.05, height + z - 0.015), v(0.05, 0.05, height + z + 0.015), steel);
    }
    mesh
}

/// A regular polygon as an outline for [`sign`].
pub fn polygon(radius: f64, sides: usize, start_deg: f64) -> Vec<(f64, f64)> {
    (0..sides)
        .map(|i| {
            let (s, c) = sincos_deg(start_deg + 360.0 * i as f64 / sides as f64);
            (radius * c, radius * s)
        })
        .collect()
}

pub fn rectangle(width: f64, height: f64) -> Vec<(f64, f64)> {
    let (y, z) = (width / 2.0, height / 2.0);
    vec![(-y, -z), (y, -z), (y, z), (-y, z)]
}

/// Traffic lights on a post, facing +x.
pub fn traffic_light(steel: Material, housing: Material, lenses: [Material; 3]) -> Mesh {
    let mut mesh = Mesh::new();
    mesh.tube(&[(v(0.0, 0.0, -SUNK), 0.06), (v(0.0, 0.0, 3.4), 0.055)], 16, steel);
    mesh.cuboid(v(0.05, -0.14, 2.4), v(0.26, 0.14, 3.3), housing);
    let forward = |z: f64| DAffine3 {
        matrix3: DMat3::from_cols(DVec3::Y, DVec3::Z, DVec3::X),
        translation: v(0.25, 0.0, z),
    };
    for (i, lens) in lenses.into_iter().enumerate() {
        let z = 3.15 - 0.3 * i as f64;
        let mut lamp = Mesh::new();
        lamp.lathe(DVec3::ZERO, &[(0.1, 0.0), (0.09, 0.02), (0.06, 0.035), (0.0, 0.04)], 20, lens);
        // The hood over the lens is a half cylinder.
        let arc = |radius: f64| {
            (0..=12).map(move |k| {
                let (s, c) = sincos_deg(15.0 * f64::from(k));
                v(radius * c, radius * s, 0.0)
            })
        };
        let outline: Vec<DVec3> = arc(0.125).chain(arc(0.115).rev()).collect();
        let out = |z: f64| outline.iter().map(|&p| p + v(0.0, 0.0, z)).collect::<Vec<_>>();
        ring_of_quads(&mut lamp, &out(0.0), &out(0.16), housing);
        mesh.add(&lamp, forward(z));
    }
    mesh
}

/// A strip that follows a closed outline (the outer arc forward, the inner arc backward), extruded from `low` to `high`.
fn ring_of_quads(mesh: &mut Mesh, low: &[DVec3], high: &[DVec3], material: Material) {
    mesh.skin(low, high, material);
    let n = low.len();
    for i in 0..n / 2 - 1 {
        let (a, b, c, d) = (i, i + 1, n - 2 - i, n - 1 - i);
        mesh.quad([high[a], high[b], high[c], high[d]], material);
        mesh.quad([low[d], low[c], low[b], low[a]], material);
    }
}

pub fn bin(body: Material, dark: Material) -> Mesh {
    let mut mesh = Mesh::new();
    mesh.lathe(DVec3::ZERO, &[(0.19, -SUNK), (0.21, 0.05), (0.24, 0.85), (0.25, 0.86)], 28, body);
    mesh.lathe(DVec3::ZERO, &[(0.25, 0.855), (0.25, 0.9), (0.18, 1.0), (0.06, 1.03)], 28, dark);
    mesh
}

/// A two-wheeled refuse bin.
pub fn wheelie_bin(body: Material, dark: Material) -> Mesh {
    let mut mesh = Mesh::new();
    let rectangle = |z: f64, x: f64, y: f64| [v(-x, -y, z), v(x, -y, z), v(x, y, z), v(-x, y, z)];
    mesh.prism(&rectangle(0.06, 0.2, 0.2), &rectangle(0.95, 0.29, 0.27), body);
    mesh.prism(&rectangle(0.94, 0.31, 0.29), &rectangle(1.04, 0.22, 0.26), body);
    mesh.limb(&[(v(-0.33, -0.22, 0.98), 0.018), (v(-0.33, 0.22, 0.98), 0.018)], 8, dark);
    for y in [-0.23, 0.19] {
        let mut wheel = Mesh::new();
        wheel.lathe(DVec3::ZERO, &[(0.1, 0.0), (0.1, 0.04)], 20, dark);
        let lie = DAffine3 {
            matrix3: DMat3::from_cols(DVec3::X, DVec3::NEG_Z, DVec3::Y),
            translation: v(-0.22, y, 0.1),
        };
        mesh.add(&wheel, lie);
    }
    mesh
}

/// A bench 1.8 m wide.
pub fn bench(wood: Material, steel: Material) -> Mesh {
    let mut mesh = Mesh::new();
    for i in 0..4 {
        let x = -0.2 + 0.125 * f64::from(i);
        mesh.cuboid(v(x, -0.9, 0.43), v(x + 0.105, 0.9, 0.465), wood);
    }
    for i in 0..3 {
        let z = 0.56 + 0.125 * f64::from(i);
        let x = -0.24 - 0.025 * f64::from(i);
        mesh.cuboid(v(x, -0.9, z), v(x + 0.03, 0.9, z + 0.105), wood);
    }
    for y in [-0.7, 0.7] {
        mesh.limb(
            &[
                (v(-0.26, y, 0.01), 0.025),
                (v(-0.2, y, 0.41), 0.025),
                (v(0.26, y, 0.41), 0.025),
                (v(0.26, y, 0.01), 0.025),
            ],
            10,
            steel,
        );
        mesh.limb(&[(v(-0.2, y, 0.4), 0.02), (v(-0.31, y, 0.95), 0.02)], 10, steel);
    }
    mesh
}

pub fn bollard(steel: Material) -> Mesh {
    let mut mesh = Mesh::new();
    let profile = [
        (0.06, -SUNK),
        (0.06, 0.75),
        (0.07, 0.77),
        (0.07, 0.8),
        (0.06, 0.82),
        (0.05, 0.88),
        (0.03, 0.91),
        (0.0, 0.92),
    ];
    mesh.lathe(DVec3::ZERO, &profile, 20, steel);
    mesh
}

pub fn planter(stone: Material) -> Mesh {
    let mut mesh = Mesh::new();
    let square = |z: f64, r: f64| [v(-r, -r, z), v(r, -r, z), v(r, r, z), v(-r, r, z)];
    mesh.skin(&square(-SUNK, 0.42), &square(0.5, 0.5), stone);
    mesh.skin(&square(0.5, 0.5), &square(0.5, 0.44), stone);
    mesh.skin(&square(0.5, 0.44), &square(0.42, 0.43), stone);
    mesh.quad(square(0.42, 0.43), stone);
    let [a, b, c, d] = square(-SUNK, 0.42);
    mesh.quad([d, c, b, a], stone);
    mesh
}

/// A bus shelter 4 m wide that opens along +x.
pub fn shelter(steel: Material, glass: Material, wood: Material, poster: Material) -> Mesh {
    let mut mesh = Mesh::new();
    for y in [-1.9, 0.0, 1.9] {
        mesh.cuboid(v(-0.7, y - 0.04, -SUNK), v(-0.62, y + 0.04, 2.5), steel);
    }
    for y in [-1.9, 1.9] {
        mesh.cuboid(v(0.5, y - 0.04, -SUNK), v(0.58, y + 0.04, 2.5), steel);
        mesh.cuboid(v(-0.6, y - 0.01, 0.2), v(0.48, y + 0.01, 2.2), if y < 0.0 { glass } else { poster });
    }
    for y in [-1.84, 0.06] {
        mesh.cuboid(v(-0.67, y, 0.2), v(-0.65, y + 1.78, 2.2), glass);
    }
    let arch: Vec<DVec3> = (0..=10)
        .map(|i| {
            let x = -0.85 + 0.18 * f64::from(i);
            v(x, 0.0, 2.62 - 0.12 * (x / 0.95) * (x / 0.95))
        })
        .collect();
    let outline: Vec<DVec3> =
        arch.iter().map(|&p| p - v(0.0, 0.0, 0.06)).chain(arch.iter().rev().copied()).collect();
    let at = |y: f64| outline.iter().map(|&p| p + v(0.0, y, 0.0)).collect::<Vec<_>>();
    ring_of_quads(&mut mesh, &at(2.1), &at(-2.1), steel);
    mesh.cuboid(v(-0.55, -1.5, 0.44), v(-0.2, 1.5, 0.48), wood);
    for y in [-1.2, 1.2] {
        mesh.cuboid(v(-0.42, y - 0.03, -SUNK), v(-0.36, y + 0.03, 0.45), steel);
    }
    mesh
}

/// A row of `count` hoops for bicycles along y, 0.8 m apart.
pub fn bicycle_stand(count: usize, steel: Material) -> Mesh {
    let mut mesh = Mesh::new();
    for i in 0..count {
        let y = 0.8 * (i as f64 - (count - 1) as f64 / 2.0);
        let path: Vec<_> = [
            (-0.35, 0.0),
            (-0.35, 0.62),
            (-0.28, 0.74),
            (-0.17, 0.78),
            (0.17, 0.78),
            (0.28, 0.74),
            (0.35, 0.62),
            (0.35, 0.0),
        ]
        .iter()
        .map(|&(x, z)| (v(x, 0.0, if z == 0.0 { -SUNK } else { z }), 0.022))
        .collect();
        let mut hoop = Mesh::new();
        hoop.tube(&path, 10, steel);
        mesh.add(&hoop, turned(0.0, v(0.0, y, 0.0)));
    }
    mesh
}

/// A parasol over a round table with two stools.
pub fn cafe_table(wood: Material, steel: Material, cloth: Material) -> Mesh {
    let mut mesh = Mesh::new();
    mesh.prism(&circle(v(0.0, 0.0, 0.7), 0.4, 32), &circle(v(0.0, 0.0, 0.73), 0.4, 32), wood);
    mesh.tube(&[(v(0.0, 0.0, -SUNK), 0.03), (v(0.0, 0.0, 2.35), 0.025)], 12, steel);
    mesh.prism(&circle(v(0.0, 0.0, -SUNK), 0.28, 28), &circle(v(0.0, 0.0, 0.05), 0.28, 28), steel);
    mesh.lathe(DVec3::ZERO, &[(0.0, 2.38), (1.25, 1.99), (1.25, 2.01), (0.0, 2.42)], 16, cloth);
    for (x, y) in [(0.75, 0.1), (-0.72, -0.15)] {
        mesh.prism(&circle(v(x, y, 0.44), 0.19, 24), &circle(v(x, y, 0.48), 0.19, 24), wood);
        for i in 0..3 {
            let (s, c) = sincos_deg(120.0 * f64::from(i) + 20.0);
            mesh.limb(
                &[(v(x + 0.12 * c, y + 0.12 * s, 0.45), 0.014), (v(x + 0.2 * c, y + 0.2 * s, 0.012), 0.014)],
                8,
                steel,
            );
        }
    }
    mesh
}
