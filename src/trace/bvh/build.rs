//! The construction of a hierarchy: the mesh is split into parts from the top, each part becomes a [binary tree](binary), and the
//! binary trees are collapsed into nodes of eight children.
//!
//! The working memory of a binary tree is several times that of the finished hierarchy. Because the mesh is built part by part, only the
//! working memory of one part a thread exists at a time. Threads share out the parts.

use glam::{DVec3, Vec3A};
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;
use rayon::prelude::*;

use super::binary;
use super::{BLOCK_OFFSET_WORDS, Bvh8, Child, HEADER, MAX_BLOCK_OFFSET, MAX_VERTICES, Node, TAIL, WIDTH};
use crate::scene::Mesh;
use crate::scene::bounds::Bounds;
use crate::trace::simd::prefer_huge_pages;

/// The most triangles of a part. Parts are so large that the seams between them hardly cost any speed, and so small that their
/// working memory is small.
const PART: usize = 1 << 15;

/// How much boxes grow on each side, in units of the largest |coordinate|. It is eight times the unit roundoff of f32, of which
/// rounding here and subtracting an origin that is no farther out take three. (Rays from farther out add a slack of their own.)
const PAD: f32 = 1.0 / (1 << 21) as f32;

/// Builds the hierarchies over meshes.
///
/// Threads share out the parts of large meshes, which are built one after the other, so that the working memory stays that of a part
/// a thread. Of the small meshes, of which there may be very many, each is built by one thread.
///
/// # Panics
/// As [`build`] does.
pub(in crate::trace) fn build_all(meshes: &[Mesh]) -> Vec<Bvh8> {
    /// Smaller meshes are built by one thread. So many triangles a thread need less memory than a part.
    const SMALL: usize = 1 << 12;
    let is_small = |mesh: &Mesh| mesh.triangles.len() <= SMALL;
    let small = meshes.par_iter().map(|mesh| if is_small(mesh) { build(mesh) } else { Bvh8::default() });
    let mut all: Vec<Bvh8> = small.collect();
    for (mesh, bvh) in meshes.iter().zip(&mut all).filter(|(mesh, _)| !is_small(mesh)) {
        *bvh = build(mesh);
    }
    all
}

/// Builds the hierarchy over a mesh.
///
/// # Panics
/// If the blocks take more than 8 GiB (some 200 million triangles).
pub(in crate::trace) fn build(mesh: &Mesh) -> Bvh8 {
    if mesh.triangles.is_empty() {
        return Bvh8::default();
    }
    let largest = largest_coordinate(mesh);
    let space = Space { mesh, scale: reciprocal_power_of_two(largest) };

    let mut items: Vec<u32> = (0..mesh.triangles.len() as u32).collect();
    let parts = split(&space, &mut items);
    let trees: Vec<Tree> = parts.into_par_iter().map(|part| Tree::of_triangles(&space, part)).collect();
    drop(items);
    space.join(trees, largest)
}

/// The largest |coordinate| of a corner.
pub(super) fn largest_coordinate(mesh: &Mesh) -> f32 {
    let corners = mesh.triangles.par_iter().flatten_iter().flat_map_iter(|&v| mesh.positions[v as usize]);
    corners.map(f32::abs).reduce(|| 0.0, f32::max)
}

/// How much boxes grow on each side, given the largest |coordinate|.
pub(super) fn padding(largest: f32) -> f32 {
    largest * PAD + f32::MIN_POSITIVE
}

/// Builds a hierarchy over boxes, each with the number that its leaf is to have.
pub(in crate::trace) fn build_over(boxes: &[(Bounds, u32)]) -> Bvh8 {
    if boxes.is_empty() {
        return Bvh8::default();
    }
    let largest = boxes.iter().map(|(bounds, _)| bounds.largest()).fold(0.0, f64::max) as f32;
    let scale = reciprocal_power_of_two(largest);
    let to_f32 = |p: DVec3| Vec3A::new(p.x as f32, p.y as f32, p.z as f32) * scale;
    let aabbs: Vec<Aabb> =
        boxes.iter().map(|(b, _)| Aabb { min: to_f32(b.low), max: to_f32(b.high) }).collect();
    let bvh = binary::build(&aabbs, 1);
    let mut tree = Tree::default();
    tree.widen(&bvh, |_, leaf| {
        let index = bvh.primitive_indices[bvh.nodes[leaf].first_index as usize];
        Child::leaf(boxes[index as usize].1)
    });
    for node in &mut tree.nodes {
        node.scale_back(scale, largest);
    }
    Bvh8 { nodes: tree.nodes, blocks: Vec::new(), largest }
}

/// A mesh and the power of two that scales its coordinates to at most 1. Areas are measured in f32, whose range the areas of
/// nanometres or gigametres would leave.
struct Space<'m> {
    mesh: &'m Mesh,
    scale: f32,
}

impl Space<'_> {
    fn triangle(&self, index: u32) -> Aabb {
        let corners =
            self.mesh.triangles[index as usize].map(|v| Vec3A::from(self.mesh.positions[v as usize]));
        Aabb {
            min: corners[0].min(corners[1]).min(corners[2]),
            max: corners[0].max(corners[1]).max(corners[2]),
        }
    }

    fn scaled(&self, index: u32) -> Aabb {
        let Aabb { min, max } = self.triangle(index);
        Aabb { min: min * self.scale, max: max * self.scale }
    }

    /// Joins the trees of the parts under one root.
    fn join(&self, trees: Vec<Tree>, largest: f32) -> Bvh8 {
        let (nodes, words) = trees.iter().fold((0, 0), |(n, w), t| (n + t.nodes.len(), w + t.blocks.len()));
        assert!(words / BLOCK_OFFSET_WORDS < MAX_BLOCK_OFFSET, "a mesh of more than 8 GiB of leaves");
        let mut bvh = Bvh8 { nodes: Vec::new(), blocks: Vec::with_capacity(words + TAIL), largest };
        let roots: Vec<Aabb> = trees.iter().map(|t| t.bounds).collect();
        if let [_] = roots[..] {
            bvh.nodes.reserve_exact(nodes);
        } else {
            // The leaves of the nodes above the parts are the roots of the parts.
            let over_parts = binary::build(&roots, 1);
            let mut top = Tree::default();
            // Until their roots are known, parts are referred to by their index, as if they were blocks.
            top.widen(&over_parts, |_, leaf| {
                let first = over_parts.nodes[leaf].first_index as usize;
                Child::leaf(over_parts.primitive_indices[first])
            });
            top.nodes.reserve_exact(nodes);
            bvh.nodes = top.nodes;
        }
        prefer_huge_pages(&mut bvh.nodes);
        prefer_huge_pages(&mut bvh.blocks);
        let first = bvh.nodes.len() as u32;
        let mut starts = Vec::with_capacity(trees.len());
        for tree in trees {
            let (node, block_offset) =
                (bvh.nodes.len() as u32, (bvh.blocks.len() / BLOCK_OFFSET_WORDS) as u32);
            starts.push(node);
            bvh.nodes.extend(tree.nodes.into_iter().map(|mut n| {
                for child in &mut n.child {
                    if *child != Child::NONE {
                        *child = match child.get() {
                            Ok(block) => Child::leaf(block + block_offset),
                            Err(inner) => Child::node(inner + node),
                        };
                    }
                }
                n
            }));
            bvh.blocks.extend(tree.blocks);
        }
        for node in &mut bvh.nodes[..first as usize] {
            for child in &mut node.child {
                if *child != Child::NONE
                    && let Ok(part) = child.get()
                {
                    *child = Child::node(starts[part as usize]);
                }
            }
        }
        bvh.blocks.resize(bvh.blocks.len() + TAIL, 0);
        for node in &mut bvh.nodes {
            node.scale_back(self.scale, largest);
        }
        bvh
    }
}

impl Node {
    /// Scales the boxes back to the mesh's own size and pads them.
    fn scale_back(&mut self, scale: f32, largest: f32) {
        // The division by a power of two is exact, and its quotient is in f32's range where the reciprocal may not be.
        let pad = padding(largest);
        for lane in 0..WIDTH {
            if self.child[lane] != Child::NONE {
                for axis in 0..3 {
                    let planes = &mut self.planes[axis];
                    planes[lane] = planes[lane] / scale - pad;
                    planes[WIDTH + lane] = planes[WIDTH + lane] / scale + pad;
                }
            }
        }
    }
}

/// The bounds of twice the centres of boxes.
#[derive(Clone, Copy)]
struct Centres {
    low: Vec3A,
    high: Vec3A,
}

impl Centres {
    const NONE: Self = Self { low: Vec3A::INFINITY, high: Vec3A::NEG_INFINITY };

    fn with(self, centre: Vec3A) -> Self {
        Self { low: self.low.min(centre), high: self.high.max(centre) }
    }

    fn union(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high) }
    }
}

fn twice_centre(b: &Aabb) -> Vec3A {
    b.min + b.max
}

/// The triangles whose centres lie in one slice of a part.
#[derive(Clone, Copy)]
struct Bin {
    count: usize,
    bounds: Aabb,
    centres: Centres,
}

impl Bin {
    const EMPTY: Self = Self { count: 0, bounds: Aabb::INVALID, centres: Centres::NONE };

    fn union(self, other: &Self) -> Self {
        Self {
            count: self.count + other.count,
            bounds: self.bounds.union(&other.bounds),
            centres: self.centres.union(other.centres),
        }
    }

    fn cost(&self) -> f32 {
        self.count as f32 * self.bounds.half_area()
    }
}

/// The number of triangles that a thread takes at a time.
const CHUNK: usize = 1 << 14;

/// Splits `items` in place into parts of at most [`PART`] triangles, by the surface area heuristic over 32 bins of the widest
/// axis.
fn split<'i>(space: &Space, items: &'i mut [u32]) -> Vec<&'i mut [u32]> {
    let centres = items
        .par_iter()
        .fold(|| Centres::NONE, |all, &i| all.with(twice_centre(&space.scaled(i))))
        .reduce(|| Centres::NONE, Centres::union);
    split_within(space, items, centres)
}

/// [`split`], given the bounds of twice the centres.
fn split_within<'i>(space: &Space, items: &'i mut [u32], centres: Centres) -> Vec<&'i mut [u32]> {
    if items.len() <= PART {
        return vec![items];
    }
    const BINS: usize = 32;
    let extent = centres.high - centres.low;
    let axis = (0..3).max_by(|&a, &b| extent[a].total_cmp(&extent[b])).unwrap();
    let per_unit = BINS as f32 / extent[axis];
    let mut bin_of = vec![0_u8; items.len()];
    let bins = items
        .par_chunks(CHUNK)
        .zip(bin_of.par_chunks_mut(CHUNK))
        .map(|(items, bin_of)| {
            let mut bins = [Bin::EMPTY; BINS];
            for (&i, bin_of) in items.iter().zip(bin_of) {
                let bounds = space.scaled(i);
                let centre = twice_centre(&bounds);
                let bin = (((centre[axis] - centres.low[axis]) * per_unit) as usize).min(BINS - 1);
                *bin_of = bin as u8;
                bins[bin] = bins[bin].union(&Bin { count: 1, bounds, centres: Centres::NONE.with(centre) });
            }
            bins
        })
        .reduce(
            || [Bin::EMPTY; BINS],
            |mut a, b| {
                a.iter_mut().zip(&b).for_each(|(a, b)| *a = a.union(b));
                a
            },
        );
    let union = |bins: &[Bin]| bins.iter().fold(Bin::EMPTY, Bin::union);
    // Parts much smaller than PART would add seams without need.
    let cuts = (1..BINS).map(|cut| (cut, union(&bins[..cut]), union(&bins[cut..])));
    let cuts = cuts.filter(|(_, left, right)| left.count.min(right.count) >= PART / 4);
    let best = cuts.min_by(|a, b| (a.1.cost() + a.2.cost()).total_cmp(&(b.1.cost() + b.2.cost())));
    let (cut, left, right) = match best {
        Some((cut, left, right)) if per_unit.is_finite() => {
            (partition(items, &mut bin_of, cut as u8), left.centres, right.centres)
        }
        // All centres are in one place, or nearly so, and any half will do.
        _ => (items.len() / 2, centres, centres),
    };
    drop(bin_of);
    let (a, b) = items.split_at_mut(cut);
    let (mut parts, rest) = rayon::join(|| split_within(space, a, left), || split_within(space, b, right));
    parts.extend(rest);
    parts
}

/// Moves the items whose bin is below `cut` to the front, with their bins, and returns their number.
fn partition(items: &mut [u32], bin_of: &mut [u8], cut: u8) -> usize {
    let (mut left, mut right) = (0, items.len());
    loop {
        while left < right && bin_of[left] < cut {
            left += 1;
        }
        while left < right && bin_of[right - 1] >= cut {
            right -= 1;
        }
        if left == right {
            return left;
        }
        items.swap(left, right - 1);
        bin_of.swap(left, right - 1);
    }
}

/// The nodes and blocks of a part, numbered from 0. The boxes are still scaled as in [`Space`], and not padded.
#[derive(Default)]
struct Tree {
    nodes: Vec<Node>,
    blocks: Vec<u32>,
    bounds: Aabb,
}

impl Tree {
    fn of_triangles(space: &Space, items: &mut [u32]) -> Self {
        if items.len() <= WIDTH {
            return Self::of_one_leaf(space, items);
        }
        let boxes: Vec<Aabb> = items.iter().map(|&i| space.scaled(i)).collect();
        let bvh = binary::build(&boxes, WIDTH);
        let mut tree = Self { blocks: Vec::with_capacity(items.len() * 9), ..Self::default() };
        tree.widen(&bvh, |tree, leaf| {
            let node = &bvh.nodes[leaf];
            let range = node.first_index as usize..(node.first_index + node.prim_count) as usize;
            let ids: Vec<u32> = bvh.primitive_indices[range].iter().map(|&i| items[i as usize]).collect();
            tree.block(space, &ids)
        });
        tree.nodes.shrink_to_fit();
        tree.blocks.shrink_to_fit();
        tree
    }

    /// The tree over triangles that fit in one leaf.
    fn of_one_leaf(space: &Space, items: &[u32]) -> Self {
        let mut tree = Self { nodes: vec![Node::EMPTY], ..Self::default() };
        tree.bounds = items.iter().map(|&i| space.scaled(i)).reduce(|a, b| a.union(&b)).unwrap_or_default();
        let Aabb { min, max } = tree.bounds;
        let leaf = tree.block(space, items);
        let node = &mut tree.nodes[0];
        node.child[0] = leaf;
        for axis in 0..3 {
            (node.planes[axis][0], node.planes[axis][WIDTH]) = (min[axis], max[axis]);
        }
        tree
    }

    /// Collapses a binary tree into nodes of eight children. Nodes are in depth-first order, so that nodes that are visited
    /// together lie close to each other. `leaf` makes the child for a leaf of the binary tree.
    fn widen(&mut self, bvh: &Bvh2, mut leaf: impl FnMut(&mut Self, usize) -> Child) {
        self.bounds = *bvh.nodes[0].aabb();
        let collapse = Collapse::new(bvh);
        // The stack of binary nodes, each with the wide node and lane that refers to it.
        let mut stack = vec![(0_usize, None::<(usize, usize)>)];
        while let Some((binary, parent)) = stack.pop() {
            let index = self.nodes.len();
            self.nodes.push(Node::EMPTY);
            if let Some((node, lane)) = parent {
                self.nodes[node].child[lane] = Child::node(index as u32);
            }
            let mut children = [0_usize; WIDTH];
            let count = collapse.roots_below(bvh, binary, &mut children);
            for (lane, &child) in children[..count].iter().enumerate() {
                let node = &bvh.nodes[child];
                let Aabb { min, max } = *node.aabb();
                for axis in 0..3 {
                    self.nodes[index].planes[axis][lane] = min[axis];
                    self.nodes[index].planes[axis][WIDTH + lane] = max[axis];
                }
                if node.is_leaf() {
                    self.nodes[index].child[lane] = leaf(self, child);
                }
            }
            for (lane, &child) in children[..count].iter().enumerate().rev() {
                if !bvh.nodes[child].is_leaf() {
                    stack.push((child, Some((index, lane))));
                }
            }
        }
    }

    /// Writes the block of a leaf, and returns the child that refers to it.
    fn block(&mut self, space: &Space, ids: &[u32]) -> Child {
        let mut indices = [0_u32; MAX_VERTICES];
        let mut count = 0;
        let mut corners = [[0_u8; WIDTH]; 3];
        let mut extent = 0.0_f32;
        for (lane, &id) in ids.iter().enumerate() {
            for (corner, v) in space.mesh.triangles[id as usize].into_iter().enumerate() {
                // There are at most 24 vertices, so a linear search is faster than a hash.
                let vertex = indices[..count].iter().position(|&known| known == v).unwrap_or_else(|| {
                    indices[count] = v;
                    count += 1;
                    count - 1
                });
                corners[corner][lane] = vertex as u8;
            }
            let Aabb { min, max } = space.triangle(id);
            extent = extent.max((max - min).max_element());
        }
        let start = self.blocks.len();
        let vertices = indices[..count].iter().map(|&v| space.mesh.positions[v as usize]);
        self.blocks.push(ids.len() as u32 | (count as u32) << 8);
        self.blocks.push(extent.to_bits());
        for axis in 0..3 {
            self.blocks.extend(vertices.clone().map(|p| p[axis].to_bits()));
        }
        for corner in corners {
            let [a, b, c, d, e, f, g, h] = corner;
            self.blocks.extend([u32::from_le_bytes([a, b, c, d]), u32::from_le_bytes([e, f, g, h])]);
        }
        debug_assert_eq!(self.blocks.len(), start + HEADER + 3 * count + 6);
        self.blocks.extend(ids);
        self.blocks.resize(self.blocks.len().next_multiple_of(BLOCK_OFFSET_WORDS), 0);
        Child::leaf((start / BLOCK_OFFSET_WORDS) as u32)
    }
}

/// The best way to collapse a binary tree into nodes of eight children: the sum of the areas of the wide nodes, to which the
/// number of visits is proportional, is the least (Ylitie, Karras, Laine, "Efficient Incoherent Ray Traversal on GPUs Through
/// Compressed Wide BVHs", 2017).
///
/// Let `cost[node][n]` be the least area of representing the subtree of a node by at most n roots. For n = 1 the node becomes a
/// wide node, which costs its own area and that of representing its subtree by eight roots below it. For n > 1 its two children
/// share out the n roots.
struct Collapse {
    /// For each node and each n from 1 to 7, how its two children share out the n roots (four bits each, or 0 if the node is one
    /// root); last, how they share out eight roots if the node becomes a wide node.
    shares: Vec<[u8; WIDTH]>,
}

impl Collapse {
    fn new(bvh: &Bvh2) -> Self {
        // The inner nodes, parents before children.
        let mut order = Vec::with_capacity(bvh.nodes.len());
        let mut stack = vec![0];
        while let Some(node) = stack.pop() {
            if !bvh.nodes[node].is_leaf() {
                order.push(node);
                let first = bvh.nodes[node].first_index as usize;
                stack.extend([first, first + 1]);
            }
        }
        // cost[node][n - 1]. A leaf has the same cost for every n.
        let mut cost = vec![[0.0_f32; WIDTH]; bvh.nodes.len()];
        let mut shares = vec![[0_u8; WIDTH]; bvh.nodes.len()];
        for &node in order.iter().rev() {
            let first = bvh.nodes[node].first_index as usize;
            let (left, right) = (cost[first], cost[first + 1]);
            let shared = |trees: usize| {
                let splits =
                    (1..trees).map(|to_left| (left[to_left - 1] + right[trees - to_left - 1], to_left));
                splits.fold((f32::INFINITY, 1), |best, split| if split.0 < best.0 { split } else { best })
            };
            let share = |trees: usize, to_left: usize| (to_left | (trees - to_left) << 4) as u8;
            let (area, to_left) = shared(WIDTH);
            shares[node][WIDTH - 1] = share(WIDTH, to_left);
            cost[node][0] = bvh.nodes[node].aabb().half_area() + area;
            for trees in 2..WIDTH {
                let (area, to_left) = shared(trees);
                let is_better = area < cost[node][trees - 2];
                (cost[node][trees - 1], shares[node][trees - 1]) = if is_better {
                    (area, share(trees, to_left))
                } else {
                    (cost[node][trees - 2], shares[node][trees - 2])
                };
            }
        }
        Self { shares }
    }

    /// Writes the binary nodes that become the children of a wide node, and returns their number.
    fn roots_below(&self, bvh: &Bvh2, node: usize, children: &mut [usize; WIDTH]) -> usize {
        if bvh.nodes[node].is_leaf() {
            // A tree that is a single leaf still needs a node above it.
            children[0] = node;
            return 1;
        }
        let mut count = 0;
        let mut stack = [(0, 0); WIDTH];
        stack[0] = (node, WIDTH);
        let mut waiting = 1;
        while waiting > 0 {
            waiting -= 1;
            let (node, trees) = stack[waiting];
            let share = self.shares[node][trees - 1];
            if share == 0 {
                children[count] = node;
                count += 1;
            } else {
                let first = bvh.nodes[node].first_index as usize;
                stack[waiting] = (first + 1, usize::from(share >> 4));
                stack[waiting + 1] = (first, usize::from(share & 15));
                waiting += 2;
            }
        }
        count
    }
}

/// The power of two that scales `x` to between ½ and 1, as far as f32's range goes, and 1 for 0.
fn reciprocal_power_of_two(x: f32) -> f32 {
    let (_, exponent) = libm::frexpf(x);
    if x == 0.0 { 1.0 } else { libm::ldexpf(1.0, (-exponent).clamp(-126, 127)) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Rng;

    /// The least sum of the areas of the wide nodes below `node`, by trying every set of up to eight children.
    fn least_area(bvh: &Bvh2, node: usize) -> f32 {
        fn forests(bvh: &Bvh2, open: &[usize], closed: &[usize], least: &mut f32) {
            let Some((&next, open)) = open.split_first() else {
                let below = closed.iter().filter(|&&n| !bvh.nodes[n].is_leaf());
                *least = least.min(below.map(|&n| least_area(bvh, n)).sum());
                return;
            };
            let closed_too: Vec<_> = closed.iter().copied().chain([next]).collect();
            forests(bvh, open, &closed_too, least);
            if !bvh.nodes[next].is_leaf() && open.len() + closed.len() + 2 <= WIDTH {
                let first = bvh.nodes[next].first_index as usize;
                let more: Vec<_> = open.iter().copied().chain([first, first + 1]).collect();
                forests(bvh, &more, closed, least);
            }
        }
        let first = bvh.nodes[node].first_index as usize;
        let mut least = f32::INFINITY;
        forests(bvh, &[first, first + 1], &[], &mut least);
        bvh.nodes[node].aabb().half_area() + least
    }

    #[test]
    fn wide_nodes_have_the_least_area() {
        // Boxes in a heap, the same every time.
        let mut rng = Rng::new(7);
        let mut next = || rng.unit() as f32;
        for count in [2, 3, 8, 9, 13] {
            let boxes: Vec<Aabb> = (0..count)
                .map(|_| {
                    let min = Vec3A::new(next(), next(), next()) * 10.0;
                    Aabb { min, max: min + Vec3A::new(next(), next(), next()) * 4.0 }
                })
                .collect();
            let bvh = binary::build(&boxes, 1);
            let collapse = Collapse::new(&bvh);
            let mut stack = vec![0];
            let (mut area, mut leaves) = (0.0, 0);
            while let Some(node) = stack.pop() {
                area += bvh.nodes[node].aabb().half_area();
                let mut children = [0; WIDTH];
                let found = collapse.roots_below(&bvh, node, &mut children);
                for &child in &children[..found] {
                    if bvh.nodes[child].is_leaf() {
                        leaves += 1;
                    } else {
                        stack.push(child);
                    }
                }
            }
            let least = least_area(&bvh, 0);
            assert!((area - least).abs() <= 1e-5 * least, "{count} boxes: {area}, at best {least}");
            assert_eq!(leaves, count);
        }
    }
}
