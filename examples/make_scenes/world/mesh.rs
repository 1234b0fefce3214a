//! Triangle meshes in code, in metres with z up. Faces are counter-clockwise seen from outside.

use glam::{DAffine3, DMat3, DVec3};

use super::glb::Material;

/// Triangles that each have a material. Vertices are welded when the mesh is written.
#[derive(Clone, Default)]
pub struct Mesh {
    pub positions: Vec<DVec3>,
    pub faces: Vec<([u32; 3], Material)>,
}

pub fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// Sine and cosine, with the same bits on every platform and exact at quarter turns.
pub fn sincos_deg(degrees: f64) -> (f64, f64) {
    let (s, c) = libm::sincos(degrees.to_radians());
    let snap = |x: f64| if x.abs() < 1e-15 { 0.0 } else { x };
    (snap(s), snap(c))
}

/// The transform that rotates about z and then moves.
pub fn turned(yaw_deg: f64, at: DVec3) -> DAffine3 {
    let (s, c) = sincos_deg(yaw_deg);
    DAffine3 { matrix3: DMat3::from_cols(v(c, s, 0.0), v(-s, c, 0.0), DVec3::Z), translation: at }
}

/// A circle about z, with its corners counter-clockwise seen from above.
pub fn circle(centre: DVec3, radius: f64, sides: usize) -> Vec<DVec3> {
    ellipse(centre, radius, radius, sides)
}

pub fn ellipse(centre: DVec3, along_x: f64, along_y: f64, sides: usize) -> Vec<DVec3> {
    (0..sides)
        .map(|i| {
            let (s, c) = sincos_deg(360.0 * i as f64 / sides as f64);
            centre + v(along_x * c, along_y * s, 0.0)
        })
        .collect()
}

impl Mesh {
    pub fn new() -> Self {
        Self::default()
    }

    pub fn triangle(&mut self, corners: [DVec3; 3], material: Material) {
        let first = self.positions.len() as u32;
        self.positions.extend(corners);
        self.faces.push(([first, first + 1, first + 2], material));
    }

    /// Adds a quadrilateral. Its corners are counter-clockwise seen from the front.
    pub fn quad(&mut self, [a, b, c, d]: [DVec3; 4], material: Material) {
        self.triangle([a, b, c], material);
        self.triangle([a, c, d], material);
    }

    /// Adds a transformed copy of `other`.
    pub fn add(&mut self, other: &Mesh, moved: DAffine3) {
        let base = self.positions.len() as u32;
        self.positions.extend(other.positions.iter().map(|&p| moved.transform_point3(p)));
        let mirrored = moved.matrix3.determinant() < 0.0;
        self.faces.extend(other.faces.iter().map(|&([a, b, c], material)| {
            let corners = if mirrored { [a, c, b] } else { [a, b, c] };
            (corners.map(|v| v + base), material)
        }));
    }

    /// Adds the box between two corners.
    pub fn cuboid(&mut self, low: DVec3, high: DVec3, material: Material) {
        let corner = |x: usize, y: usize, z: usize| {
            let pick = |side: usize, axis: usize| if side == 0 { low[axis] } else { high[axis] };
            v(pick(x, 0), pick(y, 1), pick(z, 2))
        };
        let ring = |z| [corner(0, 0, z), corner(1, 0, z), corner(1, 1, z), corner(0, 1, z)];
        self.prism(&ring(0), &ring(1), material);
    }

    /// Adds a convex bottom, a top with the same number of corners (both counter-clockwise seen from above), and the sides
    /// between them.
    pub fn prism(&mut self, bottom: &[DVec3], top: &[DVec3], material: Material) {
        for i in 1..bottom.len() - 1 {
            self.triangle([bottom[0], bottom[i + 1], bottom[i]], material);
            self.triangle([top[0], top[i], top[i + 1]], material);
        }
        self.skin(bottom, top, material);
    }

    /// Adds the surface between two closed rings. It faces out if they turn counter-clockwise about the direction from `a`
    /// to `b`.
    pub fn skin(&mut self, a: &[DVec3], b: &[DVec3], material: Material) {
        self.strip(a, b, material);
        let last = a.len() - 1;
        self.quad([a[last], a[0], b[0], b[last]], material);
    }

    /// Adds the surface between two open lines. It faces as in [`Self::skin`].
    pub fn strip(&mut self, a: &[DVec3], b: &[DVec3], material: Material) {
        for i in 1..a.len() {
            self.quad([a[i - 1], a[i], b[i], b[i - 1]], material);
        }
    }

    /// Adds a body of rings that are joined one to the next, with both ends capped. `material` gives the material of a cell
    /// (ring, segment).
    pub fn loft(&mut self, rings: &[Vec<DVec3>], material: impl Fn(usize, usize) -> Material) {
        let last = rings.len() - 1;
        for (i, pair) in rings.windows(2).enumerate() {
            for j in 0..pair[0].len() {
                let k = (j + 1) % pair[0].len();
                self.quad([pair[0][j], pair[0][k], pair[1][k], pair[1][j]], material(i, j));
            }
        }
        for (ring, outward) in [(&rings[0], false), (&rings[last], true)] {
            let middle = ring.iter().sum::<DVec3>() / ring.len() as f64;
            // A ring whose corners coincide needs no cap.
            if ring.iter().all(|&p| p.distance(middle) < 1e-9) {
                continue;
            }
            for j in 0..ring.len() {
                let k = (j + 1) % ring.len();
                let (a, b) = if outward { (j, k) } else { (k, j) };
                self.triangle([middle, ring[a], ring[b]], material(if outward { last - 1 } else { 0 }, j));
            }
        }
    }

    /// Adds a surface of revolution about z. `profile` holds (radius, z), with the outside to the right of its direction.
    /// Its ends must lie on the axis or be flat.
    pub fn lathe(&mut self, base: DVec3, profile: &[(f64, f64)], sides: usize, material: Material) {
        let rings: Vec<_> =
            profile.iter().map(|&(radius, z)| circle(base + v(0.0, 0.0, z), radius, sides)).collect();
        self.loft(&rings, |_, _| material);
    }

    /// Adds a ring of revolution about z. It is like [`Self::lathe`] with a closed profile.
    pub fn ring(&mut self, base: DVec3, profile: &[(f64, f64)], sides: usize, material: Material) {
        for i in 0..profile.len() {
            let ends = [profile[i], profile[(i + 1) % profile.len()]];
            let [a, b] = ends.map(|(radius, z)| circle(base + v(0.0, 0.0, z), radius, sides));
            self.skin(&a, &b, material);
        }
    }

    /// Adds an ellipsoid with its poles on z. Its vertices lie on the ideal surface.
    pub fn ellipsoid(&mut self, centre: DVec3, radii: DVec3, sides: usize, rows: usize, material: Material) {
        let rings: Vec<_> = (0..=rows)
            .map(|i| {
                let (s, c) = sincos_deg(180.0 * i as f64 / rows as f64 - 90.0);
                ellipse(centre + v(0.0, 0.0, radii.z * s), radii.x * c, radii.y * c, sides)
            })
            .collect();
        self.loft(&rings, |_, _| material);
    }

    /// Adds a round bar along a path with a radius at each point and with flat ends.
    pub fn tube(&mut self, path: &[(DVec3, f64)], sides: usize, material: Material) {
        let rings = tube_rings(path, sides);
        self.loft(&rings, |_, _| material);
    }

    /// Adds a round bar with a hemisphere at each end.
    pub fn limb(&mut self, path: &[(DVec3, f64)], sides: usize, material: Material) {
        const ROWS: usize = 4;
        let (first, last) = (path[0], path[path.len() - 1]);
        let start = (path[1].0 - first.0).normalize();
        let end = (last.0 - path[path.len() - 2].0).normalize();
        let round = |(centre, radius): (DVec3, f64), axis: DVec3, degrees: f64| {
            let (s, c) = sincos_deg(degrees);
            (centre + axis * (radius * s), radius * c)
        };
        let step = 90.0 / ROWS as f64;
        let mut whole: Vec<_> = (0..ROWS).map(|i| round(first, start, step * i as f64 - 90.0)).collect();
        whole.extend(path);
        whole.extend((1..=ROWS).map(|i| round(last, end, step * i as f64)));
        self.tube(&whole, sides, material);
    }
}

fn tube_rings(path: &[(DVec3, f64)], sides: usize) -> Vec<Vec<DVec3>> {
    let along: Vec<_> = (0..path.len())
        .map(|i| (path[(i + 1).min(path.len() - 1)].0 - path[i.saturating_sub(1)].0).normalize())
        .collect();
    // The reference axis is the one to which the path is never parallel, so that the rings do not twist.
    let worst = |axis: DVec3| along.iter().map(|a| a.dot(axis).abs()).fold(0.0, f64::max);
    let reference = if worst(DVec3::Z) < 0.9 {
        DVec3::Z
    } else if worst(DVec3::Y) <= worst(DVec3::X) {
        DVec3::Y
    } else {
        DVec3::X
    };
    (0..path.len())
        .map(|i| {
            let along = along[i];
            let u = reference.cross(along).normalize();
            let w = along.cross(u);
            (0..sides)
                .map(|j| {
                    let (s, c) = sincos_deg(360.0 * j as f64 / sides as f64);
                    path[i].0 + (u * c + w * s) * path[i].1
                })
                .collect()
        })
        .collect()
}
