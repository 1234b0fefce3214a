//! Refitting: the hierarchy over another shape of a mesh, without the search for a good tree.

use super::build::{largest_coordinate, padding};
use super::{BLOCK_OFFSET_WORDS, Bvh8, Child, HEADER, LeafBlock, WIDTH};
use crate::scene::Mesh;

impl Bvh8 {
    /// The hierarchy over a mesh that has the same triangles as this hierarchy's, with vertices elsewhere. Its boxes are as tight as
    /// those of [`build`](super::build), and its tree is this one's, which is about as good for shapes that differ little.
    pub fn refitted(&self, mesh: &Mesh) -> Self {
        let mut fitted = self.clone();
        fitted.largest = largest_coordinate(mesh);
        let pad = padding(fitted.largest);
        // The bounds of each node, before they are padded. Children come after their parents.
        let mut bounds = vec![([f32::MAX; 3], [f32::MIN; 3]); self.nodes.len()];
        for index in (0..self.nodes.len()).rev() {
            for lane in 0..WIDTH {
                let child = self.nodes[index].child[lane];
                if child == Child::NONE {
                    continue;
                }
                let (low, high) = match child.get() {
                    Ok(block_offset) => fitted.refit_block(block_offset, mesh),
                    Err(node) => bounds[node as usize],
                };
                let (node_low, node_high) = &mut bounds[index];
                for axis in 0..3 {
                    let planes = &mut fitted.nodes[index].planes[axis];
                    planes[lane] = low[axis] - pad;
                    planes[WIDTH + lane] = high[axis] + pad;
                    node_low[axis] = node_low[axis].min(low[axis]);
                    node_high[axis] = node_high[axis].max(high[axis]);
                }
            }
        }
        fitted
    }

    /// Moves the vertices of a block to where a mesh has them. Returns the bounds of its triangles.
    fn refit_block(&mut self, block_offset: u32, mesh: &Mesh) -> ([f32; 3], [f32; 3]) {
        let start = block_offset as usize * BLOCK_OFFSET_WORDS;
        let LeafBlock { triangles, vertices, .. } = LeafBlock::at(&self.blocks, block_offset);
        let coordinates = start + HEADER;
        let (mut low, mut high) = ([f32::MAX; 3], [f32::MIN; 3]);
        let mut extent = 0.0_f32;
        for lane in 0..triangles {
            let block = LeafBlock::at(&self.blocks, block_offset);
            let (id, corners) = (block.id(lane), block.corners_of(lane));
            let positions = mesh.triangles[id as usize].map(|vertex| mesh.positions[vertex as usize]);
            for axis in 0..3 {
                let [a, b, c] = positions.map(|position| position[axis]);
                let (least, most) = (a.min(b).min(c), a.max(b).max(c));
                low[axis] = low[axis].min(least);
                high[axis] = high[axis].max(most);
                extent = extent.max(most - least);
                for (corner, x) in corners.into_iter().zip([a, b, c]) {
                    self.blocks[coordinates + axis * vertices + corner] = x.to_bits();
                }
            }
        }
        self.blocks[start + 1] = extent.to_bits();
        (low, high)
    }
}
