//! Trees, bushes and grass: wood as closed tubes, leaves as folded rhombs of two triangles.

use glam::DVec3;

use super::glb::Material;
use super::mesh::{Mesh, sincos_deg, v};
use super::rng::Rng;

/// The growth of a tree. Lengths are in metres.
pub struct Species {
    /// The height at which the lowest branches leave the trunk.
    pub clear_height: f64,
    pub height: f64,
    /// The crown's radius at a height from 0 (the lowest branches) to 1 (the top), as a fraction of `crown_radius`.
    pub profile: fn(f64) -> f64,
    pub crown_radius: f64,
    pub trunk_radius: f64,
    pub branches: usize,
    pub leaves: usize,
    /// The length from tip to tip.
    pub leaf_length: f64,
    /// The height by which branches rise on each metre.
    pub rise: f64,
}

/// A round crown that is widest below its middle.
pub fn round_crown(t: f64) -> f64 {
    let x = 2.0 * t - 0.85;
    (1.0 - x * x / 1.4).max(0.0).sqrt()
}

/// A conical crown.
pub fn conical_crown(t: f64) -> f64 {
    1.02 - t
}

/// A crown that is a narrow column.
pub fn upright_crown(t: f64) -> f64 {
    let x = 2.0 * t - 1.0;
    (1.0 - x * x * x * x).max(0.0).sqrt()
}

/// A tree that stands at the origin. Returns its wood (a closed mesh) and its leaves (an open mesh).
pub fn tree(species: &Species, seed: u64, bark: Material, leaf: Material) -> (Mesh, Mesh) {
    let mut rng = Rng::new(seed);
    let (mut wood, mut leaves) = (Mesh::new(), Mesh::new());
    let s = species;
    let mut trunk = vec![];
    let mut at = v(0.0, 0.0, -0.125);
    let steps = 7;
    for i in 0..=steps {
        let t = f64::from(i) / f64::from(steps);
        let flare = if i == 0 { 1.5 } else { 1.0 };
        trunk.push((at, s.trunk_radius * flare * (1.0 - 0.88 * t)));
        at += v(rng.range(-0.08, 0.08), rng.range(-0.08, 0.08), s.height * 0.95 / f64::from(steps));
    }
    wood.tube(&trunk, 14, bark);
    let along_trunk = |z: f64| {
        let after = trunk.iter().position(|(p, _)| p.z > z).unwrap_or(trunk.len() - 1).max(1);
        let ((a, ra), (b, rb)) = (trunk[after - 1], trunk[after]);
        let t = (z - a.z) / (b.z - a.z);
        (a.lerp(b, t), ra + (rb - ra) * t)
    };

    let mut tips = vec![];
    for i in 0..s.branches {
        let t = (i as f64 + rng.range(0.2, 0.8)) / s.branches as f64;
        let z = s.clear_height + (s.height * 0.93 - s.clear_height) * t;
        let (foot, thick) = along_trunk(z);
        // The golden angle spreads branches evenly about the trunk.
        let azimuth = 137.507_764 * i as f64 + rng.range(-15.0, 15.0);
        let (sin, cos) = sincos_deg(azimuth);
        let reach = s.crown_radius * (s.profile)(t) * rng.range(0.75, 0.95);
        let tip = foot + v(cos * reach, sin * reach, reach * s.rise + rng.range(-0.1, 0.2));
        let bend = foot.lerp(tip, 0.5) + v(0.0, 0.0, 0.12 * reach);
        wood.tube(&[(foot, thick * 0.45), (bend, thick * 0.3), (tip, 0.012)], 7, bark);
        for part in [0.55, 0.8, 1.0] {
            let end = bend.lerp(tip, (part - 0.5) * 2.0) + rng.direction() * (0.22 * reach);
            if part < 1.0 {
                let start = bend.lerp(tip, (part - 0.5) * 1.6);
                wood.tube(&[(start, thick * 0.16), (end, 0.008)], 5, bark);
            }
            tips.push((end, 0.35 + 0.25 * reach));
        }
    }
    tips.push((along_trunk(s.height * 0.93).0, 0.5 + 0.1 * s.crown_radius));
    for _ in 0..s.leaves {
        let (centre, radius) = tips[rng.below(tips.len())];
        let at = centre + rng.in_ball() * radius * v(1.0, 1.0, 0.7);
        // No leaf reaches into the ground.
        if at.z > s.leaf_length {
            add_leaf(&mut leaves, &mut rng, at, s.leaf_length, leaf);
        }
    }
    (wood, leaves)
}

/// Adds a leaf: a rhomb that is folded along its middle and hangs nearly level.
fn add_leaf(mesh: &mut Mesh, rng: &mut Rng, at: DVec3, length: f64, leaf: Material) {
    let along = (rng.direction() * v(1.0, 1.0, 0.6)).normalize();
    let across = (rng.direction() * v(1.0, 1.0, 0.5)).cross(along).normalize();
    let length = length * rng.range(0.7, 1.2);
    let (half, width) = (along * (length / 2.0), across * (length * 0.32));
    let droop = v(0.0, 0.0, -0.08 * length);
    mesh.quad([at - half, at + width + droop, at + half, at - width + droop], leaf);
}

/// Leaves that fill a box with half extents `half` on the ground. They are densest at the surface of the box.
pub fn hedge(half: DVec3, count: usize, seed: u64, leaf: Material) -> Mesh {
    let mut rng = Rng::new(seed);
    let mut mesh = Mesh::new();
    for _ in 0..count {
        let mut p = v(rng.range(-1.0, 1.0), rng.range(-1.0, 1.0), rng.range(-1.0, 1.0));
        // Most leaves are moved to a face of the box.
        let axis = rng.below(4);
        if axis < 3 {
            p[axis] = (if p[axis] < 0.0 { -1.0 } else { 1.0 }) * rng.range(0.88, 1.0);
        }
        let at = p * half + v(0.0, 0.0, half.z + 0.03);
        add_leaf(&mut mesh, &mut rng, at, 0.09, leaf);
    }
    mesh
}

/// A round bush.
pub fn bush(radius: f64, count: usize, seed: u64, leaf: Material) -> Mesh {
    let mut rng = Rng::new(seed);
    let mut mesh = Mesh::new();
    for _ in 0..count {
        let p = rng.direction() * (radius * rng.range(0.6, 1.0));
        let at = v(p.x, p.y, p.z * 0.75 + radius * 0.72);
        add_leaf(&mut mesh, &mut rng, at, 0.1, leaf);
    }
    mesh
}

/// A patch of upright blades of grass, about a square metre in size.
pub fn grass(half: f64, count: usize, seed: u64, leaf: Material) -> Mesh {
    let mut rng = Rng::new(seed);
    let mut mesh = Mesh::new();
    for _ in 0..count {
        let root = v(rng.range(-half, half), rng.range(-half, half), -0.02);
        let side = (rng.direction() * v(1.0, 1.0, 0.0)).normalize() * 0.006;
        let lean = v(rng.range(-0.06, 0.06), rng.range(-0.06, 0.06), rng.range(0.08, 0.22));
        mesh.triangle([root - side, root + side, root + lean], leaf);
    }
    mesh
}
