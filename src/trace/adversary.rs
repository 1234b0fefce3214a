//! Pairs of rays and triangles that make rounding errors large, for tests of error bounds.

use glam::DVec3;

use crate::rng::Rng;
use crate::scene::Mesh;

/// 2^k for a k from `least` to `most`.
fn power(rng: &mut Rng, least: i32, most: i32) -> f64 {
    libm::ldexp(1.0, least + rng.below((most - least + 1) as usize) as i32)
}

/// A leaf of eight triangles, and rays that are aimed at its vertices and edges, or closely beside these.
pub struct Case {
    pub mesh: Mesh,
    pub origins: Vec<DVec3>,
    pub directions: Vec<DVec3>,
}

impl Case {
    /// Triangles of many sizes and shapes, among them slivers, far from the mesh's origin or near it, and eight rays that
    /// start `spread` times the mesh's size or less from each other.
    pub fn new(rng: &mut Rng, spread: f64) -> Self {
        let scale = power(rng, -12, 12);
        let centre = rng.point() * scale * [0.0, 1.0, 30.0, 1000.0][rng.below(4)];
        let size = scale * power(rng, -12, 0);
        let mut mesh = Mesh::default();
        for triangle in 0..8 {
            let (a, along, aside) = (rng.point(), rng.point(), rng.point());
            // Right-angled, blunt and needle-shaped triangles.
            let width = [1.0, 1.0, power(rng, -20, -1)][rng.below(3)];
            let along = along * [1.0, power(rng, -10, 0)][rng.below(2)];
            let c = a + along * rng.signed() + aside * width;
            let corners = [a, a + along, c].map(|p| (centre + p * size).as_vec3().to_array());
            mesh.positions.extend(corners);
            mesh.triangles.push([0, 1, 2].map(|corner| 3 * triangle + corner));
        }
        let distance = size * power(rng, -3, 12);
        let origin = centre + rng.point() * distance;
        let largest = mesh.positions.iter().flatten().fold(0.0_f32, |most, x| most.max(x.abs()));
        let (mut origins, mut directions) = (Vec::new(), Vec::new());
        for ray in 0..8 {
            let at = |corner: usize| DVec3::from(mesh.positions[3 * ray + corner % 3].map(f64::from));
            let corner = rng.below(3);
            let along = [0.0, 0.5, rng.signed().abs(), rng.signed().abs()][rng.below(4)];
            let beside = rng.point() * size * [0.0, 1e-7, 1e-3, 1.0][rng.below(4)];
            let target = at(corner) + (at(corner + 1) - at(corner)) * along + beside;
            let start = origin + rng.point() * (f64::from(largest) * spread);
            origins.push(start);
            directions.push((target - start).try_normalize().unwrap_or(DVec3::X));
        }
        Self { mesh, origins, directions }
    }
}
