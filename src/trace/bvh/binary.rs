//! Binary trees over boxes, in time n log n for any boxes: clusters from the bottom, then better places for the largest subtrees.
//!
//! Neighbouring clusters that are each other's best partner are joined, all such pairs at a time (Meister and Bittner, "Parallel
//! Locally-Ordered Clustering for Bounding Volume Hierarchy Construction", 2018). Then subtrees are moved to where they enlarge
//! the tree the least (Meister and Bittner, "Parallel Reinsertion for Bounding Volume Hierarchy Optimization", 2018). Both
//! degenerate where boxes lie in one place or in each other, as stacked copies and chains of nested boxes do: next to no clusters
//! are each other's best partner, and no subtree can be left out of the search for a place. So clusters are also paired by number
//! where too few find a partner, and a search ends after so many nodes: no order of such boxes is better than another.

use glam::Vec3A;
use obvhs::aabb::Aabb;
use obvhs::bvh2::leaf_collapser::collapse;
use obvhs::bvh2::node::Bvh2Node;
use obvhs::bvh2::reinsertion::reinsert_node;
use obvhs::bvh2::{Bvh2, DEFAULT_MAX_STACK_DEPTH};
use rayon::prelude::*;

/// How far a cluster looks for a partner among its neighbours along the Morton curve, and how far in the first rounds: these have
/// most of the clusters, and what they join is small wherever it is.
const REACH: usize = 6;
const FIRST_REACH: usize = 1;
const FIRST_ROUNDS: usize = 2;

/// Clusters are paired by number in a round in which fewer than one in so many would join. (Usually one in three does.)
const FEW: usize = 16;

/// The share of nodes that are moved in the first round of moves. In round k it is that over 2k + 1.
const SHARE: f32 = 0.02;
const ROUNDS: usize = 16;

/// The most nodes that the search for a subtree's place looks at.
const MOST_VISITS: usize = 1024;

/// The cost of visiting a node, in units of that of a triangle. The test of a leaf costs nearly the same for any number of triangles
/// up to eight, so leaves should be full. A high cost of nodes fills them.
const NODE_COST: f32 = 30.0;

/// The number of boxes above which threads share the work.
const PARALLEL: usize = 4096;

/// Builds a tree over boxes, of which there are some, with leaves of up to `leaf` boxes.
pub(super) fn build(boxes: &[Aabb], leaf: usize) -> Bvh2 {
    let mut bvh = cluster(boxes);
    improve(&mut bvh);
    collapse(&mut bvh, leaf as u32, NODE_COST);
    bvh
}

/// Joins boxes to clusters, round by round, until one is left.
fn cluster(boxes: &[Aabb]) -> Bvh2 {
    let mut bvh = Bvh2::zeroed(boxes.len());
    bvh.primitive_indices = (0..boxes.len() as u32).collect();
    bvh.nodes = vec![Bvh2Node::default(); 2 * boxes.len() - 1];
    let mut free = bvh.nodes.len();
    let mut current: Vec<Bvh2Node> =
        along_curve(boxes).into_iter().map(|i| Bvh2Node::new(boxes[i as usize], 1, i)).collect();
    let mut next = Vec::with_capacity(current.len());
    let mut rounds = 0;
    while current.len() > 1 {
        let indices = (0..current.len()).into_par_iter().with_min_len(PARALLEL);
        let reach = if rounds < FIRST_ROUNDS { FIRST_REACH } else { REACH };
        let partner: Vec<usize> = indices.map(|i| best_partner(&current, i, reach)).collect();
        let agree = |i: usize| partner[partner[i]] == i;
        let is_stuck = (0..current.len()).filter(|&i| agree(i)).count() / 2 < current.len() / FEW;
        let mut join = |a: Bvh2Node, b: Bvh2Node| {
            free -= 2;
            (bvh.nodes[free], bvh.nodes[free + 1]) = (a, b);
            Bvh2Node::new(a.aabb().union(b.aabb()), 0, free as u32)
        };
        let mut left = None;
        for (i, &node) in current.iter().enumerate() {
            if agree(i) {
                if partner[i] < i {
                    next.push(join(current[partner[i]], node));
                }
            } else if !is_stuck {
                next.push(node);
            } else if let Some(other) = left.take() {
                next.push(join(other, node));
            } else {
                left = Some(node);
            }
        }
        next.extend(left);
        std::mem::swap(&mut current, &mut next);
        next.clear();
        rounds += 1;
    }
    bvh.nodes[0] = current[0];
    bvh.max_depth = DEFAULT_MAX_STACK_DEPTH.max(rounds + 1);
    bvh.children_are_ordered_after_parents = true;
    bvh
}

/// The cluster near `i` with which its box would be smallest. Of equal ones it is that whose number differs from `i` in the lowest
/// digits, so that equal boxes agree on pairs.
fn best_partner(current: &[Bvh2Node], i: usize, reach: usize) -> usize {
    let own = current[i].aabb();
    // Areas are not negative, so their bits are in their order. Which area is least is unpredictable, so there is no branch on it.
    let key = |j: usize| {
        let area = own.union(current[j].aabb()).half_area();
        u64::from(area.to_bits()) << 32 | (i ^ j) as u64
    };
    let before = (i.saturating_sub(reach)..i).map(key).fold(u64::MAX, u64::min);
    let best = (i + 1..(i + reach + 1).min(current.len())).map(key).fold(before, u64::min);
    i ^ (best & u64::from(u32::MAX)) as usize
}

/// The boxes in the order of the Morton curve through their centres. Its cells are cubes: in a flat or long scene, neighbours
/// along the curve would else be far apart along the longest side.
fn along_curve(boxes: &[Aabb]) -> Vec<u32> {
    let centre = |b: &Aabb| b.min + b.max;
    let low = boxes.iter().fold(Vec3A::INFINITY, |low, b| low.min(centre(b)));
    let high = boxes.iter().fold(Vec3A::NEG_INFINITY, |high, b| high.max(centre(b)));
    let extent = f64::from((high - low).max_element());
    let scale = if extent > 0.0 { f64::from(1 << 20) / extent } else { 0.0 };
    let code = |b: &Aabb| {
        let p = (centre(b) - low).as_dvec3() * scale;
        spread(p.x as u64) | spread(p.y as u64) << 1 | spread(p.z as u64) << 2
    };
    let mut order: Vec<(u64, u32)> = boxes.iter().zip(0..).map(|(b, i)| (code(b), i)).collect();
    order.sort_unstable();
    order.into_iter().map(|(_, i)| i).collect()
}

/// The 21 lowest bits, each followed by two zeros.
fn spread(x: u64) -> u64 {
    let x = x & 0x1f_ffff;
    let x = (x | x << 32) & 0x1f_0000_0000_ffff;
    let x = (x | x << 16) & 0x1f_0000_ff00_00ff;
    let x = (x | x << 8) & 0x100f_00f0_0f00_f00f;
    let x = (x | x << 4) & 0x10c3_0c30_c30c_30c3;
    (x | x << 2) & 0x1249_2492_4924_9249
}

/// A subtree and the node beside which it is better placed.
struct Move {
    gain: f32,
    from: usize,
    to: usize,
}

/// Moves the largest subtrees near the root to better places, round by round.
fn improve(bvh: &mut Bvh2) {
    if bvh.nodes[0].is_leaf() {
        return;
    }
    bvh.init_parents_if_uninit();
    bvh.children_are_ordered_after_parents = false;
    let count = bvh.nodes.len();
    let mut touched = vec![false; count];
    for round in 0..ROUNDS {
        let batch = (count as f32 * SHARE / (2 * round + 1) as f32).max(1.0) as usize;
        let mut candidates: Vec<(f32, usize)> =
            (1..count.min(2 * (batch + 1))).map(|i| (bvh.nodes[i].aabb().half_area(), i)).collect();
        candidates.sort_unstable_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        candidates.truncate(batch);
        let mut moves: Vec<Move> = candidates
            .par_iter()
            .map_init(Vec::new, |stack, &(_, node)| better_place(bvh, node, stack))
            .flatten()
            .collect();
        moves.sort_unstable_by(|a, b| b.gain.total_cmp(&a.gain).then(a.from.cmp(&b.from)));
        touched.fill(false);
        for Move { from, to, .. } in moves {
            let sibling = Bvh2Node::get_sibling_id(from);
            let all = [from, to, sibling, bvh.parents[from] as usize, bvh.parents[to] as usize];
            // A move changes these nodes, so another move that needs them waits for a later round.
            if all.iter().all(|&node| !touched[node]) {
                all.iter().for_each(|&node| touched[node] = true);
                reinsert_node(bvh, from, to);
            }
        }
    }
}

/// Searches for the place of a subtree where the areas of all nodes add up to least, near its own place first.
///
/// Taking the subtree out removes its parent and shrinks the nodes above; putting it beside a node adds a node that holds both, and
/// grows the nodes above that. The search goes up from the subtree, and from each node above it down into the other child, as
/// long as the gain can still exceed the best: what is added is at least the subtree's own area.
fn better_place(bvh: &Bvh2, node: usize, stack: &mut Vec<(f32, usize)>) -> Option<Move> {
    let own = *bvh.nodes[node].aabb();
    let least = own.half_area();
    let (parent, sibling) = (bvh.parents[node] as usize, Bvh2Node::get_sibling_id(node));
    let mut best = Move { gain: 0.0, from: node, to: 0 };
    // The area saved so far, and the box of the nodes that are left below `above`.
    let mut shrunk = bvh.nodes[parent].aabb().half_area();
    let mut rest = *bvh.nodes[sibling].aabb();
    let (mut above, mut other) = (parent, sibling);
    let mut visits = 0;
    'search: loop {
        stack.clear();
        stack.push((shrunk, other));
        while let Some((gain, place)) = stack.pop() {
            if gain - least <= best.gain {
                continue;
            }
            visits += 1;
            if visits > MOST_VISITS {
                break 'search;
            }
            let there = &bvh.nodes[place];
            let gain = gain - own.union(there.aabb()).half_area();
            if gain > best.gain {
                (best.gain, best.to) = (gain, place);
            }
            if !there.is_leaf() {
                let below = gain + there.aabb().half_area();
                let first = there.first_index as usize;
                stack.extend([(below, first), (below, first + 1)]);
            }
        }
        if above != parent {
            rest = rest.union(bvh.nodes[other].aabb());
            shrunk += bvh.nodes[above].aabb().half_area() - rest.half_area();
        }
        visits += 1;
        if above == 0 || visits > MOST_VISITS {
            break;
        }
        (above, other) = (bvh.parents[above] as usize, Bvh2Node::get_sibling_id(above));
    }
    (best.gain > 0.0 && best.to != sibling && best.to != parent).then_some(best)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rng::Rng;

    fn cube(at: Vec3A, size: f32) -> Aabb {
        Aabb { min: at - size, max: at + size }
    }

    /// Checks that every box is in one leaf, below boxes that hold it. Returns the number of levels.
    fn levels(bvh: &Bvh2, boxes: &[Aabb]) -> usize {
        let mut seen = vec![0; boxes.len()];
        let mut stack = vec![(0_usize, 1)];
        let mut deepest = 0;
        while let Some((node, level)) = stack.pop() {
            deepest = deepest.max(level);
            let node = &bvh.nodes[node];
            let holds = |b: &Aabb| {
                let outer = node.aabb();
                outer.min.cmple(b.min).all() && b.max.cmple(outer.max).all()
            };
            let first = node.first_index as usize;
            if node.is_leaf() {
                for &i in &bvh.primitive_indices[first..first + node.prim_count as usize] {
                    assert!(holds(&boxes[i as usize]));
                    seen[i as usize] += 1;
                }
            } else {
                for child in [first, first + 1] {
                    assert!(holds(bvh.nodes[child].aabb()));
                    stack.push((child, level + 1));
                }
            }
        }
        assert!(seen.iter().all(|&times| times == 1));
        deepest
    }

    /// The case bvh-coincident-quadratic and its neighbours: a tree over n boxes has some log n levels whatever they are, and so
    /// takes as many rounds. (Without pairing by number the nested boxes take as many rounds as there are boxes.)
    #[test]
    fn no_boxes_make_a_deep_tree() {
        let count = 20_000;
        let number = |i: usize| i as f32 / count as f32;
        let mut rng = Rng::new(3);
        let mut jitter = || Vec3A::new(rng.unit() as f32, rng.unit() as f32, rng.unit() as f32);
        let all: Vec<(&str, Vec<Aabb>)> = vec![
            ("equal", vec![cube(Vec3A::ONE, 0.1); count]),
            ("points", vec![cube(Vec3A::ONE, 0.0); count]),
            ("nearly equal", (0..count).map(|_| cube(jitter() * 1e-6, 0.3)).collect()),
            ("nested", (0..count).map(|i| cube(Vec3A::ZERO, 0.1 + number(i))).collect()),
            ("nested from outside in", (0..count).map(|i| cube(Vec3A::ZERO, 1.1 - number(i))).collect()),
            ("nested in a corner", (0..count).map(|i| cube(Vec3A::splat(number(i)), number(i))).collect()),
            (
                "growing",
                (0..count).map(|i| cube(Vec3A::X * number(i) * number(i), number(i) * 0.01)).collect(),
            ),
            ("geometric", (0..count).map(|i| cube(Vec3A::X * libm::powf(0.995, i as f32), 0.0)).collect()),
            ("overlapping", (0..count).map(|i| cube(Vec3A::Y * number(i), 2.0)).collect()),
            ("two heaps", (0..count).map(|i| cube(Vec3A::Y * (i % 2) as f32, 0.1)).collect()),
            ("random", (0..count).map(|_| cube(jitter(), 0.01)).collect()),
            (
                "one large among small",
                (0..count).map(|i| cube(jitter(), if i == 7 { 5.0 } else { 0.001 })).collect(),
            ),
        ];
        for (name, boxes) in all {
            let clustered = levels(&cluster(&boxes), &boxes);
            assert!(clustered <= 64, "{name}: {clustered} levels");
            // Moves may make a chain of some of them, where that is what the boxes are.
            let built = levels(&build(&boxes, 8), &boxes);
            assert!(built <= count / 16, "{name}: {built} levels in the end");
        }
    }

    #[test]
    fn a_few_boxes_make_a_tree() {
        for count in 1..40 {
            let boxes: Vec<_> = (0..count).map(|i| cube(Vec3A::X * (i % 7) as f32, 0.1)).collect();
            levels(&build(&boxes, 1), &boxes);
            levels(&build(&boxes, 8), &boxes);
        }
    }

    /// Moving subtrees makes the nodes smaller, but where all boxes are equal.
    #[test]
    fn moves_make_the_tree_smaller() {
        let mut rng = Rng::new(5);
        let mut next = || rng.unit() as f32;
        let boxes: Vec<_> = (0..3000)
            .map(|_| {
                let min = Vec3A::new(next(), next(), next());
                Aabb { min, max: min + Vec3A::new(next(), next(), next()) * next() * 0.2 }
            })
            .collect();
        let area = |bvh: &Bvh2| bvh.nodes.iter().map(|node| f64::from(node.aabb().half_area())).sum::<f64>();
        let mut bvh = cluster(&boxes);
        let before = area(&bvh);
        improve(&mut bvh);
        levels(&bvh, &boxes);
        assert!(area(&bvh) < before, "{before} {}", area(&bvh));
    }
}
