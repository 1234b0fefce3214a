//! The part of a scene that things stand on, and points that are uniform over its area.

use glam::DVec3;

use crate::scene::{self, Scene};

/// The least cosine of the angle between a normal and the world's z axis of a triangle that things stand on: 45 degrees.
const LEAST_COSINE: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Triangles that face up, within a rectangle of the world.
#[derive(Clone, Debug)]
pub struct Surface {
    /// The corners in the world, in metres, of triangles that are cut off at the rectangle.
    triangles: Vec<[DVec3; 3]>,
    /// For each triangle the area up to and with it, in square metres.
    areas: Vec<f64>,
    /// From and to along x and y of the world, in metres.
    zone: [[f64; 2]; 2],
}

/// Why nothing can stand on a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NoSurface {
    /// It has no triangle, or none at that time.
    Empty,
    /// None of its triangles faces up. The flag says whether some face down.
    NoneFacesUp(bool),
    /// None of those that face up lies within the rectangle.
    NoneInZone,
}

impl Surface {
    /// The triangles of a snapshot of a scene that are meant and face up: their normals are within 45 degrees of the world's z axis.
    /// `zone` is a rectangle of the world: from and to along x and y, in metres.
    ///
    /// # Errors
    /// If nothing is left of them.
    pub fn of(
        scene: &Scene,
        is_meant: impl Fn(scene::Surface) -> bool,
        zone: [[f64; 2]; 2],
    ) -> Result<Self, NoSurface> {
        let (mut triangles, mut areas) = (Vec::new(), Vec::new());
        let (mut all, mut down, mut up, mut area) = (0, 0, 0, 0.0);
        for (placement, run) in scene.triangles_of(is_meant) {
            // A map that mirrors has the front of a triangle on the other side of its corners.
            let side = placement.scene_from_mesh().matrix3.determinant().signum();
            for triangle in run {
                let [a, b, c] = scene.triangle_at(placement, triangle);
                let normal = (b - a).cross(c - a) * side;
                let least = LEAST_COSINE * normal.length();
                all += 1;
                down += usize::from(-normal.z >= least);
                // False of a triangle without an area.
                if !(normal.z >= least && normal.z > 0.0) {
                    continue;
                }
                up += 1;
                let inside = cut_off([a, b, c], zone);
                for pair in inside.get(1..).unwrap_or_default().windows(2) {
                    let triangle @ [a, b, c] = [inside[0], pair[0], pair[1]];
                    let own = (b - a).cross(c - a).length() / 2.0;
                    if own > 0.0 {
                        area += own;
                        triangles.push(triangle);
                        areas.push(area);
                    }
                }
            }
        }
        match () {
            () if all == 0 => Err(NoSurface::Empty),
            () if up == 0 => Err(NoSurface::NoneFacesUp(down > 0)),
            () if triangles.is_empty() => Err(NoSurface::NoneInZone),
            () => Ok(Self { triangles, areas, zone }),
        }
    }

    /// The area, in square metres.
    pub fn area_m2(&self) -> f64 {
        self.areas.last().copied().unwrap_or(0.0)
    }

    /// The lowest and the highest corner of the surface, in the world.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let ends = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        let corners = self.triangles.iter().flatten();
        corners.fold(ends, |(low, high), corner| (low.min(*corner), high.max(*corner)))
    }

    /// The point of the surface that three numbers from 0 up to 1 stand for. If they are uniform, the point is uniform over the area.
    pub fn point(&self, [which, u, v]: [f64; 3]) -> DVec3 {
        let at = which * self.area_m2();
        let index = self.areas.partition_point(|area| *area <= at).min(self.triangles.len() - 1);
        let [a, b, c] = self.triangles[index];
        // The half of the parallelogram that is not the triangle is turned onto it.
        let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
        let point = a + (b - a) * u + (c - a) * v;
        let [[x0, x1], [y0, y1]] = self.zone;
        DVec3::new(point.x.clamp(x0, x1), point.y.clamp(y0, y1), point.z)
    }
}

/// The part of a triangle within a rectangle of the world, as a convex polygon (I. E. Sutherland and G. W. Hodgman, "Reentrant polygon
/// clipping", 1974).
fn cut_off(triangle: [DVec3; 3], zone: [[f64; 2]; 2]) -> Vec<DVec3> {
    let mut polygon = triangle.to_vec();
    for (axis, [from, to]) in zone.into_iter().enumerate() {
        for (end, sign) in [(from, 1.0), (to, -1.0)] {
            if end.is_infinite() {
                continue;
            }
            let inside = |p: &DVec3| (p[axis] - end) * sign;
            let before = std::mem::take(&mut polygon);
            for (index, p) in before.iter().enumerate() {
                let next = &before[(index + 1) % before.len()];
                let (here, there) = (inside(p), inside(next));
                if here >= 0.0 {
                    polygon.push(*p);
                }
                if (here > 0.0 && there < 0.0) || (here < 0.0 && there > 0.0) {
                    let mut crossing = *p + (*next - *p) * (here / (here - there));
                    crossing[axis] = end;
                    polygon.push(crossing);
                }
            }
        }
    }
    polygon
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;

    use super::*;
    use crate::frame::UpAxis;
    use crate::rng::Rng;
    use crate::scene::{Material, SceneBuilder, SourceInstance, SourceMesh, SourcePart};

    /// A square floor of 1 m, a slope of 3 m² that rises by 3 in 4, a wall, and a ceiling.
    fn scene(placed: &[DAffine3]) -> Scene {
        let positions = [
            [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]],
            [[2.0, 0.0, 0.0], [5.0, 0.0, 0.0], [5.0, 0.8, 0.6], [2.0, 0.8, 0.6]],
            [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 1.0], [0.0, 0.0, 1.0]],
            [[0.0, 1.0, 2.0], [1.0, 1.0, 2.0], [1.0, 0.0, 2.0], [0.0, 0.0, 2.0]],
        ];
        let triangles = (0..4).flat_map(|quad| [[0, 1, 2], [0, 2, 3]].map(|t| t.map(|i| 4 * quad + i)));
        let mesh = SourceMesh {
            positions: positions.concat(),
            parts: vec![SourcePart { triangles: triangles.collect(), material: 0, ..SourcePart::default() }],
        };
        let instances =
            placed.iter().map(|map| SourceInstance { world_from_mesh: *map, ..Default::default() });
        let builder = SceneBuilder {
            meshes: vec![mesh],
            instances: instances.collect(),
            materials: vec![Material::default()],
            ..Default::default()
        };
        builder.build().unwrap()
    }

    const ALL: [[f64; 2]; 2] = [[f64::NEG_INFINITY, f64::INFINITY]; 2];

    #[test]
    fn what_faces_up_counts_also_where_it_is_mirrored() {
        let mirror = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
        for placed in [vec![DAffine3::IDENTITY], vec![mirror], vec![DAffine3::IDENTITY, mirror]] {
            let surface = Surface::of(&scene(&placed), |_| true, ALL).unwrap();
            // The positions of the slope are stored in 32 bits, so that its sides are off by a few 2⁻²⁴.
            assert!((surface.area_m2() - 4.0 * placed.len() as f64).abs() < 1e-6, "{}", surface.area_m2());
        }
        let one = scene(&[DAffine3::IDENTITY]);
        assert_eq!(Surface::of(&one, |_| false, ALL).unwrap_err(), NoSurface::Empty);
        let far = [[10.0, 11.0], [0.0, 1.0]];
        assert_eq!(Surface::of(&one, |_| true, far).unwrap_err(), NoSurface::NoneInZone);
        // Turned from y to z, the wall faces down, the floor and the ceiling sideways, and the slope mostly.
        let on_its_side = scene(&[DAffine3::from_mat3(UpAxis::Z.world_from_gltf())]);
        assert_eq!(Surface::of(&on_its_side, |_| true, ALL).unwrap_err(), NoSurface::NoneFacesUp(true));
    }

    #[test]
    fn a_zone_cuts_triangles_off() {
        let one = scene(&[DAffine3::IDENTITY]);
        let area = |zone| Surface::of(&one, |_| true, zone).unwrap().area_m2();
        assert!((area([[0.25, 0.75], [0.5, 0.6]]) - 0.05).abs() < 1e-12);
        // A part of the slope is as wide as its footprint, and longer by 1/0.8.
        assert!((area([[0.5, 4.0], [0.4, 0.8]]) - (0.5 * 0.4 + 2.0 * 0.5)).abs() < 1e-6);
        let zone = [[0.5, 4.0], [0.4, 0.8]];
        let surface = Surface::of(&one, |_| true, zone).unwrap();
        let mut rng = Rng::new(3);
        for _ in 0..10_000 {
            let p = surface.point([rng.unit(), rng.unit(), rng.unit()]);
            assert!((0.5..=4.0).contains(&p.x) && (0.4..=0.8).contains(&p.y));
            let height = if p.x > 1.5 { p.y * 0.75 } else { 0.0 };
            assert!((p.z - height).abs() < 1e-6);
        }
    }

    /// The number of points in a part of the surface with the share p of its area is off by less than five of its standard errors,
    /// √(np(1 − p)), unless a seed of two million was met for one of the cells.
    #[test]
    fn points_are_uniform_over_the_area() {
        const COUNT: usize = 100_000;
        let surface = Surface::of(&scene(&[DAffine3::IDENTITY]), |_| true, ALL).unwrap();
        let mut rng = Rng::new(4);
        // The floor in 4 × 4 cells, and the slope in 12 × 4, all with the same area: 1/16 m², a 64th of 4 m².
        let mut cells = [[0_usize; 4]; 16];
        for _ in 0..COUNT {
            let p = surface.point([rng.unit(), rng.unit(), rng.unit()]);
            let (x, y) = if p.x < 1.5 { (p.x * 4.0, p.y * 4.0) } else { ((p.x - 1.0) * 4.0, p.y * 5.0) };
            cells[(x as usize).min(15)][(y as usize).min(3)] += 1;
        }
        let (n, p) = (COUNT as f64, 1.0 / 64.0);
        let most = 5.0 * (n * p * (1.0 - p)).sqrt();
        for count in cells.as_flattened() {
            assert!((*count as f64 - n * p).abs() < most, "{count} of {}", n * p);
        }
    }
}
