//! The vertex data of a primitive, as its file has them.

use glam::DVec3;

use super::data::Elements;

/// The vertex data of a primitive.
pub(super) struct Vertices<'b> {
    pub positions: Elements<'b>,
    /// The targets that move vertices, each with its number and its weight, if that is fixed.
    pub targets: Vec<(usize, Option<f64>, Elements<'b>)>,
    pub joints_and_weights: Vec<(Elements<'b>, Elements<'b>)>,
}
impl Vertices<'_> {
    /// The numbers of the vertices `used` (of all vertices, if it is empty).
    pub fn numbers(&self, used: &[u32]) -> impl Iterator<Item = usize> {
        let count = if used.is_empty() { self.positions.len() } else { used.len() };
        (0..count).map(|at| used.get(at).map_or(at, |&vertex| vertex as usize))
    }

    /// The position of a vertex, moved by the targets whose weights are fixed.
    pub fn position(&self, vertex: usize) -> DVec3 {
        let mut position = DVec3::from_array(self.positions.get(vertex));
        for (_, weight, target) in &self.targets {
            if let Some(weight) = weight {
                position += *weight * DVec3::from_array(target.get(vertex));
            }
        }
        position
    }

    /// The joints that hold a vertex, each with its weight. They are none if no joint holds it.
    pub fn influences(&self, vertex: usize) -> impl Iterator<Item = (usize, f64)> {
        self.joints_and_weights.iter().flat_map(move |(joints, weights)| {
            let (joints, weights) = (joints.get::<4>(vertex), weights.get::<4>(vertex));
            let pairs = joints.into_iter().zip(weights).filter(|&(_, weight)| weight != 0.0);
            pairs.map(|(joint, weight)| (joint as usize, weight))
        })
    }
}
