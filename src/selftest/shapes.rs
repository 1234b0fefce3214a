//! Shapes whose ranges are known in closed form, and the triangles that stand for them.

use std::collections::BTreeMap;

use glam::{DAffine3, DVec3};

/// The surface of a convex solid in the sensor's frame, in metres.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Solid {
    /// The points p with n·p ≤ h for each face (n, h); n is a unit vector that points outwards.
    Faces(Vec<(DVec3, f64)>),
    /// A ball. Its facets have their vertices on the sphere, so that they reach inwards to `inscribed`.
    Ball { centre: DVec3, radius: f64, inscribed: f64 },
}

impl Solid {
    /// The depths at which a line enters and leaves the solid, if it meets it. The solid is grown by `grown` metres all around, or
    /// shrunk if that is negative. A grown ball is the sphere; a shrunk ball is the largest one inside the facets.
    ///
    /// Faces are found by clipping the line with each plane (Cyrus and Beck, 1978), and a ball by the distance of its centre
    /// from the line, which loses nothing to cancellation where the ball is far away.
    pub(super) fn crossing(&self, origin: DVec3, d: DVec3, grown: f64) -> Option<(f64, f64)> {
        match self {
            Self::Faces(faces) => {
                let (mut enter, mut leave) = (f64::NEG_INFINITY, f64::INFINITY);
                for &(n, h) in faces {
                    let (along, above) = (n.dot(d), h + grown - n.dot(origin));
                    if along < 0.0 {
                        enter = enter.max(above / along);
                    } else if along > 0.0 {
                        leave = leave.min(above / along);
                    } else if above < 0.0 {
                        return None;
                    }
                }
                (enter <= leave).then_some((enter, leave))
            }
            Self::Ball { centre, radius, inscribed } => {
                let radius = if grown < 0.0 { inscribed + grown } else { radius + grown };
                let to_centre = *centre - origin;
                let middle = to_centre.dot(d);
                let half_squared = radius * radius - (to_centre - d * middle).length_squared();
                (radius > 0.0 && half_squared >= 0.0).then(|| {
                    let half = half_squared.sqrt();
                    (middle - half, middle + half)
                })
            }
        }
    }
}

/// A shape around its own origin, about one unit in size.
#[derive(Clone, Debug)]
pub(super) struct Model {
    /// The vertices of the closed form, before they are rounded.
    vertices: Vec<DVec3>,
    /// The triangles, counter-clockwise as seen from outside.
    pub(super) triangles: Vec<[u32; 3]>,
    /// The radius of the largest ball inside the facets, for a ball of radius 1.
    inscribed: Option<f64>,
}

impl Model {
    /// The cube from −1 to 1.
    pub(super) fn cube() -> Self {
        let corner = |i: u32| {
            let side = |axis: u32| if i >> axis & 1 == 0 { -1.0 } else { 1.0 };
            DVec3::new(side(0), side(1), side(2))
        };
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        Self { vertices: (0..8).map(corner).collect(), triangles, inscribed: None }
    }

    /// A wedge, half of the cube: its slope rises along x from the bottom to the top.
    pub(super) fn wedge() -> Self {
        let at = DVec3::new;
        let vertices = vec![
            at(-1.0, -1.0, -1.0),
            at(1.0, -1.0, -1.0),
            at(1.0, -1.0, 1.0),
            at(-1.0, 1.0, -1.0),
            at(1.0, 1.0, -1.0),
            at(1.0, 1.0, 1.0),
        ];
        let triangles =
            vec![[0, 1, 2], [3, 5, 4], [0, 4, 1], [0, 3, 4], [1, 4, 5], [1, 5, 2], [0, 2, 5], [0, 5, 3]];
        Self { vertices, triangles, inscribed: None }
    }

    /// A ball of radius 1 with 8·4^levels triangles: an octahedron whose faces are cut in four `levels` times, with the new
    /// vertices pushed out to the sphere.
    pub(super) fn ball(levels: u32) -> Self {
        let mut vertices = vec![DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z];
        let mut triangles: Vec<[u32; 3]> =
            vec![[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
        for _ in 0..levels {
            let mut middles = BTreeMap::new();
            let mut finer = Vec::with_capacity(4 * triangles.len());
            for [a, b, c] in triangles {
                let mut middle = |p: u32, q: u32| {
                    *middles.entry((p.min(q), p.max(q))).or_insert_with(|| {
                        vertices.push((vertices[p as usize] + vertices[q as usize]).normalize());
                        vertices.len() as u32 - 1
                    })
                };
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
            }
            triangles = finer;
        }
        let height = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| vertices[v as usize]);
            (b - a).cross(c - a).normalize().dot(a)
        };
        let inscribed = triangles.iter().map(height).fold(1.0, f64::min);
        Self { vertices, triangles, inscribed: Some(inscribed) }
    }

    /// The vertices as a mesh stores them.
    pub(super) fn positions(&self) -> Vec<[f32; 3]> {
        self.vertices.iter().map(|v| v.as_vec3().to_array()).collect()
    }

    /// The largest distance of a stored vertex from that of the closed form, in the model's own units. It is 0 if all
    /// coordinates are whole.
    pub(super) fn rounding(&self) -> f64 {
        self.vertices.iter().map(|v| v.distance(v.as_vec3().as_dvec3())).fold(0.0, f64::max)
    }

    /// The closed form of the model at the place where `sensor_from_model` puts it. A ball must be scaled evenly.
    pub(super) fn solid(&self, sensor_from_model: &DAffine3) -> Solid {
        if let Some(inscribed) = self.inscribed {
            let radius = sensor_from_model.matrix3.x_axis.length();
            let centre = sensor_from_model.translation;
            return Solid::Ball { centre, radius, inscribed: inscribed * radius };
        }
        let mut faces: Vec<(DVec3, f64)> = Vec::new();
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|v| sensor_from_model.transform_point3(self.vertices[v as usize]));
            let n = (b - a).cross(c - a).normalize();
            // The two triangles of a quadrilateral are one face.
            if !faces.iter().any(|(other, _)| other.dot(n) > 1.0 - 1e-9) {
                faces.push((n, n.dot(a)));
            }
        }
        Solid::Faces(faces)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn models_are_closed_and_face_outwards() {
        for (model, volume) in [(Model::cube(), 8.0), (Model::wedge(), 4.0), (Model::ball(4), 4.18)] {
            let mut edges = BTreeMap::new();
            for &[a, b, c] in &model.triangles {
                for edge in [(a, b), (b, c), (c, a)] {
                    *edges.entry(edge).or_insert(0) += 1;
                }
            }
            assert!(edges.iter().all(|(&(a, b), &n)| n == 1 && edges.get(&(b, a)) == Some(&1)));
            let sum: f64 = model
                .triangles
                .iter()
                .map(|t| {
                    let [a, b, c] = t.map(|v| model.vertices[v as usize]);
                    a.dot(b.cross(c)) / 6.0
                })
                .sum();
            assert!((sum - volume).abs() < 0.02, "{sum} m³, {volume} m³");
        }
    }

    #[test]
    fn a_line_crosses_a_cube_and_a_ball_where_school_says() {
        let cube = Model::cube().solid(&DAffine3::from_translation(DVec3::new(5.0, 0.0, 0.0)));
        assert_eq!(cube.crossing(DVec3::ZERO, DVec3::X, 0.0), Some((4.0, 6.0)));
        assert_eq!(cube.crossing(DVec3::ZERO, DVec3::X, 0.5), Some((3.5, 6.5)));
        assert_eq!(cube.crossing(DVec3::ZERO, DVec3::Y, 0.0), None);
        let ball = Model::ball(3).solid(&DAffine3::from_translation(DVec3::new(5.0, 0.0, 0.0)));
        assert_eq!(ball.crossing(DVec3::ZERO, DVec3::X, 0.0), Some((4.0, 6.0)));
        let (enter, leave) = ball.crossing(DVec3::ZERO, DVec3::X, -1e-9).unwrap();
        assert!(enter > 4.0 && enter < 4.02 && leave < 6.0, "facets reach inwards: {enter}");
        assert_eq!(ball.crossing(DVec3::ZERO, DVec3::NEG_Z, 0.0), None);
    }
}
