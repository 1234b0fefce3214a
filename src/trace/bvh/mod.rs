//! The bounding volume hierarchy that rays traverse. Its nodes have up to eight children, and its leaves are blocks of triangles.
//!
//! A node holds the boxes of its children as f32, one array an axis, so that eight boxes are tested at a time. A leaf is a block of
//! up to eight triangles with the vertices that they share. Blocks lie in the order of the tree, and the data of a leaf takes two or
//! three cache lines.

mod binary;
mod build;
mod refit;
mod traverse;

use std::hint::select_unpredictable;

use super::simd::{F32x8, F32x16, U32x8};

pub(super) use build::{build, build_all, build_over};

/// The most children of a node, and the most triangles of a block.
pub(super) const WIDTH: usize = 8;

/// A hierarchy over the triangles of one mesh, in the mesh's space.
#[derive(Clone, Debug, Default)]
pub(super) struct Bvh8 {
    /// The nodes. The root is node 0, if there is any.
    pub nodes: Vec<Node>,
    /// The blocks, one after the other, as [`LeafBlock`] reads them. Each takes a multiple of [`BLOCK_OFFSET_WORDS`]. A hierarchy
    /// over placements has no blocks: the number of a leaf is that of the placement.
    pub blocks: Vec<u32>,
    /// The largest |coordinate| of a vertex.
    pub largest: f32,
}

/// A node of up to eight children. Their boxes are a structure of arrays with one cache line an axis.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
pub(super) struct Node {
    /// `planes[axis][child]` is the lower plane of a child's box, and `planes[axis][WIDTH + child]` the upper plane.
    pub planes: [[f32; 2 * WIDTH]; 3],
    pub child: [Child; WIDTH],
}

/// A reference to a child of a node: another node, or a leaf.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Child(u32);

impl Child {
    const LEAF: u32 = 1 << 31;
    /// No child. Its box is empty.
    pub const NONE: Self = Self(u32::MAX);

    /// The node of an index.
    pub fn node(index: u32) -> Self {
        debug_assert!(index < Self::LEAF);
        Self(index)
    }

    /// The leaf whose block has an offset.
    pub const fn leaf(block_offset: u32) -> Self {
        debug_assert!(block_offset < Self::LEAF - 1);
        Self(block_offset | Self::LEAF)
    }

    /// The child of a number that [`Child::bits`] returned.
    #[inline(always)]
    pub fn from_bits(bits: u32) -> Self {
        Self(bits)
    }

    /// The child as a number, whose highest bit is set for a leaf.
    #[inline(always)]
    pub fn bits(self) -> u32 {
        self.0
    }

    #[inline(always)]
    pub fn is_leaf(self) -> bool {
        self.0 & Self::LEAF != 0
    }

    /// The offset of the leaf's block, or the index of the node.
    #[inline(always)]
    pub fn number(self) -> u32 {
        self.0 & !Self::LEAF
    }

    /// `Ok` with the offset of the leaf's block, or `Err` with the index of the node.
    pub fn get(self) -> Result<u32, u32> {
        if self.is_leaf() { Ok(self.number()) } else { Err(self.0) }
    }
}

impl Node {
    /// The bits of all children.
    #[inline(always)]
    pub fn children<S: F32x8>(&self) -> S::U32x8 {
        let [a, b, c, d, e, f, g, h] = &self.child;
        S::U32x8::load(&[a.0, b.0, c.0, d.0, e.0, f.0, g.0, h.0])
    }

    /// A node without children. Its boxes are inside out, so no ray meets them, and finite, so no arithmetic on them makes a NaN.
    pub const EMPTY: Self = {
        let mut planes = [f32::MAX; 2 * WIDTH];
        let mut lane = WIDTH;
        while lane < 2 * WIDTH {
            planes[lane] = f32::MIN;
            lane += 1;
        }
        Self { planes: [planes; 3], child: [Child::NONE; WIDTH] }
    };
}

/// The unit of a block's offset, in words of 32 bits.
pub(super) const BLOCK_OFFSET_WORDS: usize = 4;

/// The bound of block offsets: a [`TriangleRef`] has 29 bits for them.
pub(super) const MAX_BLOCK_OFFSET: usize = 1 << 29;

/// A hierarchy of fewer nodes than this is in the cache anyway: with its leaves it takes about a megabyte.
const IN_CACHE: usize = 1024;

/// The words of padding after the last block, so that a whole vector can be loaded from any place in it.
const TAIL: usize = 3 * WIDTH;

/// A view of one block. Its words are:
///
/// | words | content |
/// |---|---|
/// | 1 | the number of triangles (low byte) and of vertices (next byte) |
/// | 1 | the largest side of the bounding box of any triangle, f32 |
/// | 3 × vertices | x of all vertices, then all y, then all z, f32 |
/// | 3 × 2 | for the first, second and third corner: the index of its vertex, one byte a triangle |
/// | triangles | the ids of the triangles in the mesh |
#[derive(Clone, Copy)]
pub(super) struct LeafBlock<'a> {
    words: &'a [u32],
    pub triangles: usize,
    vertices: usize,
}

/// The most vertices of a block, which has eight triangles that share none.
pub(super) const MAX_VERTICES: usize = 3 * WIDTH;

const HEADER: usize = 2;

impl<'a> LeafBlock<'a> {
    /// The block at an offset.
    #[inline(always)]
    pub fn at(blocks: &'a [u32], block_offset: u32) -> Self {
        let words = &blocks[block_offset as usize * BLOCK_OFFSET_WORDS..];
        let head = words[0];
        Self { words, triangles: (head & 0xff) as usize, vertices: (head >> 8 & 0xff) as usize }
    }

    /// The largest side of the bounding box of any triangle.
    #[inline(always)]
    pub fn extent(&self) -> f32 {
        f32::from_bits(self.words[1])
    }

    /// One coordinate of the vertices: of the first sixteen, and of eight more if there are more. Lanes past the last vertex
    /// are unspecified.
    #[inline(always)]
    pub fn coordinates<S: F32x8>(&self, axis: usize) -> (S::F32x16, Option<S>) {
        let start = HEADER + axis * self.vertices;
        let words: &[u32; MAX_VERTICES] = self.words[start..start + MAX_VERTICES].try_into().unwrap();
        let more = (self.vertices > 16).then(|| S::U32x8::load(words[16..].try_into().unwrap()).bitcast());
        (S::F32x16::load_u32(words[..16].try_into().unwrap()), more)
    }

    /// The vertex indices of the first, second and third corners. Lanes past the last triangle are unspecified.
    #[inline(always)]
    pub fn corner_vertices<S: F32x8>(&self) -> [S::U32x8; 3] {
        let start = HEADER + 3 * self.vertices;
        let &[a, a2, b, b2, c, c2]: &[u32; 6] = self.words[start..start + 6].try_into().unwrap();
        let bytes = |low: u32, high: u32| u64::from(low) | u64::from(high) << 32;
        [
            S::U32x8::from_bytes(bytes(a, a2)),
            S::U32x8::from_bytes(bytes(b, b2)),
            S::U32x8::from_bytes(bytes(c, c2)),
        ]
    }

    /// Gathers eight triangles, given as [`TriangleRef`]s: x, y and z of each corner, and the ids in their mesh.
    #[inline(always)]
    pub fn corners<S: F32x8>(blocks: &[u32], triangles: S::U32x8) -> ([[S; 3]; 3], S::U32x8) {
        let constant = S::U32x8::splat;
        let lane = triangles.and(constant(WIDTH as u32 - 1));
        // A reference is an offset, which counts in four words, after three bits for the lane.
        let start = triangles.shift_right(constant(1)).and(constant(!(BLOCK_OFFSET_WORDS as u32 - 1)));
        let vertices = S::U32x8::gather(blocks, start).shift_right(constant(8)).and(constant(0xff));
        let x = start.add(constant(HEADER as u32));
        let (y, z) = (x.add(vertices), x.add(vertices).add(vertices));
        let indices = z.add(vertices);
        let ids = S::U32x8::gather(blocks, indices.add(constant(6)).add(lane));
        let word = indices.add(lane.shift_right(constant(2)));
        let shift = lane.and(constant(3)).shift_left(constant(3));
        let mut corners = [[S::splat(0.0); 3]; 3];
        for (k, corner) in corners.iter_mut().enumerate() {
            let vertex = S::U32x8::gather(blocks, word.add(constant(2 * k as u32))).shift_right(shift);
            let vertex = vertex.and(constant(0xff));
            *corner = [
                S::U32x8::gather(blocks, x.add(vertex)).bitcast(),
                S::U32x8::gather(blocks, y.add(vertex)).bitcast(),
                S::U32x8::gather(blocks, z.add(vertex)).bitcast(),
            ];
        }
        (corners, ids)
    }

    /// [`LeafBlock::corners`] for triangles in the blocks of different hierarchies.
    #[inline(always)]
    pub fn corners_in_meshes<S: F32x8>(
        blocks: [&[u32]; WIDTH],
        triangles: &[u32; WIDTH],
    ) -> ([[S; 3]; 3], [u32; WIDTH]) {
        let (mut of_lanes, mut ids) = ([[[0.0; WIDTH]; 3]; 3], [0; WIDTH]);
        for k in 0..WIDTH {
            let triangle = TriangleRef(triangles[k]);
            let block = LeafBlock::at(blocks[k], triangle.block_offset());
            ids[k] = block.id(triangle.lane());
            for (corner, position) in of_lanes.iter_mut().zip(block.positions(triangle.lane())) {
                for (coordinate, x) in corner.iter_mut().zip(position) {
                    coordinate[k] = x;
                }
            }
        }
        let mut corners = [[S::splat(0.0); 3]; 3];
        for (corner, from) in corners.iter_mut().zip(&of_lanes) {
            *corner = [S::load(&from[0]), S::load(&from[1]), S::load(&from[2])];
        }
        (corners, ids)
    }

    /// The id of a triangle in its mesh.
    #[inline(always)]
    pub fn id(&self, lane: usize) -> u32 {
        self.words[HEADER + 3 * self.vertices + 6 + lane]
    }

    /// The positions of a triangle's corners.
    #[inline(always)]
    pub fn positions(&self, lane: usize) -> [[f32; 3]; 3] {
        let (coordinates, rest) = self.words[HEADER..].split_at(3 * self.vertices);
        let (x, yz) = coordinates.split_at(self.vertices);
        let (y, z) = yz.split_at(self.vertices);
        // Not by `map`, which is not always inlined.
        let [a, b, c] = corners_in(rest, lane);
        let position =
            |vertex| [f32::from_bits(x[vertex]), f32::from_bits(y[vertex]), f32::from_bits(z[vertex])];
        [position(a), position(b), position(c)]
    }

    /// The indices in the block of a triangle's corners.
    pub fn corners_of(&self, lane: usize) -> [usize; 3] {
        corners_in(&self.words[HEADER + 3 * self.vertices..], lane)
    }
}

/// The indices in a block of a triangle's corners, given the block's words after the coordinates.
#[inline(always)]
fn corners_in(words: &[u32], lane: usize) -> [usize; 3] {
    let (word, shift) = ((lane / 4) & 1, 8 * (lane % 4));
    let corner = |of_four: u32| (of_four >> shift & 0xff) as usize;
    [corner(words[word]), corner(words[2 + word]), corner(words[4 + word])]
}

/// A reference to a triangle: the offset of its block and its lane in the block, in 32 bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct TriangleRef(pub u32);

impl TriangleRef {
    #[inline(always)]
    pub fn new(block_offset: u32, lane: usize) -> Self {
        Self(block_offset << 3 | lane as u32)
    }

    #[inline(always)]
    pub fn block_offset(self) -> u32 {
        self.0 >> 3
    }

    #[inline(always)]
    pub fn lane(self) -> usize {
        (self.0 & 7) as usize
    }
}

impl Bvh8 {
    /// Prefetches a child: a node, or the first cache lines of a block.
    #[inline(always)]
    pub fn prefetch<S: F32x8>(&self, child: Child) {
        if self.is_small() {
            return;
        }
        // Both addresses are computed and one is selected, because a branch would be unpredictable. A prefetch reads nothing, so
        // `Child::NONE` does no harm.
        let node = self.nodes.as_ptr().wrapping_add(child.number() as usize).cast::<u32>();
        let block = self.blocks.as_ptr().wrapping_add(child.number() as usize * BLOCK_OFFSET_WORDS);
        let start = select_unpredictable(child.is_leaf(), block, node);
        S::prefetch(start);
        S::prefetch(start.wrapping_add(16));
        S::prefetch(start.wrapping_add(32));
        S::prefetch(start.wrapping_add(48));
    }

    /// Whether the hierarchy stays in the cache.
    #[inline(always)]
    pub fn is_small(&self) -> bool {
        self.nodes.len() < IN_CACHE
    }

    /// The bytes that the hierarchy holds.
    pub fn bytes(&self) -> usize {
        self.nodes.capacity() * size_of::<Node>() + self.blocks.capacity() * size_of::<u32>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Mesh;

    #[test]
    fn children_and_references_keep_what_they_are_given() {
        assert_eq!(Child::node(7).get(), Err(7));
        assert_eq!(Child::leaf(9).get(), Ok(9));
        let last = MAX_BLOCK_OFFSET as u32 - 1;
        assert_eq!((TriangleRef::new(last, 7).block_offset(), TriangleRef::new(last, 7).lane()), (last, 7));
    }

    /// Every triangle of a mesh is in exactly one block, below boxes that hold it.
    fn check_tree(mesh: &Mesh, bvh: &Bvh8) {
        let mut seen = vec![0_u32; mesh.triangles.len()];
        let mut stack = vec![(0, [f32::MIN; 3], [f32::MAX; 3])];
        while let Some((node, low, high)) = stack.pop() {
            let node = &bvh.nodes[node as usize];
            for lane in 0..WIDTH {
                if node.child[lane] == Child::NONE {
                    continue;
                }
                let (l, h) = (node.planes.map(|b| b[lane]), node.planes.map(|b| b[WIDTH + lane]));
                assert!(
                    (0..3).all(|a| l[a] >= low[a] && h[a] <= high[a]),
                    "a child sticks out of its parent"
                );
                match node.child[lane].get() {
                    Err(child) => stack.push((child, l, h)),
                    Ok(block_offset) => {
                        let block = LeafBlock::at(&bvh.blocks, block_offset);
                        for lane in 0..block.triangles {
                            let id = block.id(lane);
                            seen[id as usize] += 1;
                            let corners = block.positions(lane);
                            assert_eq!(
                                corners,
                                mesh.triangles[id as usize].map(|v| mesh.positions[v as usize])
                            );
                            let inside = |p: [f32; 3]| (0..3).all(|a| l[a] < p[a] && p[a] < h[a]);
                            assert!(corners.into_iter().all(inside), "a box must be padded");
                        }
                    }
                }
            }
        }
        assert!(seen.iter().all(|&n| n == 1));
    }

    const GRIDS: [(u32, u32); 4] = [(1, 1), (2, 3), (40, 57), (300, 300)];

    #[test]
    fn the_tree_holds_every_triangle_once() {
        for (width, height) in GRIDS {
            let mesh = grid(width, height);
            check_tree(&mesh, &build(&mesh));
        }
    }

    /// A hierarchy that is fitted to another shape differs in nothing but its tree from one that is built over it, and in nothing
    /// at all if the shape is the same.
    #[test]
    fn a_refitted_hierarchy_is_one_of_the_new_shape() {
        for (width, height) in GRIDS {
            let mesh = grid(width, height);
            let bvh = build(&mesh);
            let same = bvh.refitted(&mesh);
            assert_eq!((&same.blocks, same.largest), (&bvh.blocks, bvh.largest));
            let planes = |bvh: &Bvh8| bvh.nodes.iter().map(|node| node.planes).collect::<Vec<_>>();
            assert_eq!(planes(&same), planes(&bvh));

            let mut bent = mesh.clone();
            for [x, y, z] in &mut bent.positions {
                (*x, *y, *z) = (*x - 0.25 * *y, -3.0 * *y, *z + 0.1 * *x * *x);
            }
            let (fitted, built) = (bvh.refitted(&bent), build(&bent));
            check_tree(&bent, &fitted);
            assert_eq!((fitted.largest, fitted.blocks.len()), (built.largest, bvh.blocks.len()));
            let root = |bvh: &Bvh8| {
                let side = |lanes: std::ops::Range<usize>, outer: fn(f32, f32) -> f32| {
                    bvh.nodes[0].planes.map(|planes| planes[lanes.clone()].iter().copied().reduce(outer))
                };
                (side(0..WIDTH, f32::min), side(WIDTH..2 * WIDTH, f32::max))
            };
            assert_eq!(root(&fitted), root(&built));
        }
    }

    fn grid(width: u32, height: u32) -> Mesh {
        let mut mesh = Mesh::default();
        for y in 0..=height {
            for x in 0..=width {
                mesh.positions.push([x as f32, y as f32, ((x * 7 + y * 13) % 5) as f32 * 0.3]);
            }
        }
        for y in 0..height {
            for x in 0..width {
                let at = |dx: u32, dy: u32| (y + dy) * (width + 1) + x + dx;
                mesh.triangles.extend([[at(0, 0), at(1, 0), at(1, 1)], [at(0, 0), at(1, 1), at(0, 1)]]);
            }
        }
        mesh
    }
}
