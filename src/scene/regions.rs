//! Scenes too large for one space: they are split into regions, meshes in spaces of their own.
//!
//! An f32 has 24 binary digits, so about one centre a vertex is rounded by up to 2⁻²⁵ of the scene's size: half a metre at a distance
//! of 10 000 km. Where the vertices of a scene would move by more than [`Rounding::LIMIT_M`],
//! their triangles are shared out to regions, each with a centre of its own, which are placed by moving them, and nothing else.
//!
//! # Regions agree on what they share
//! A closed mesh must not leak where it passes from one region into the next. It does not, because all regions compute with
//! the same numbers:
//!
//! - Region i has a step qᵢ, a power of two, such that its vertices lie within 2²⁴·qᵢ of its centre cᵢ, along each axis.
//! - A vertex is moved to a multiple of the largest step of all regions that have a vertex there (powers of two, so it is a
//!   multiple of the step of each). Centres are multiples of their region's step too. So v − cᵢ is a multiple of qᵢ and at most 2²⁴
//!   of them, which an f32 holds exactly: all regions store the same point.
//! - The origin o of a ray is rounded once, to a multiple of a step r, [`Geometry::origin_step_m`](super::Geometry::origin_step_m).
//!   Let 2ᵏ be at least as large as any |coordinate| of any cᵢ, counted from the scene's centre, and of o; then r is 2ᵏ⁻⁵². The
//!   centres are multiples of r, so o − cᵢ is a multiple of r and at most 2⁵³ of them, which an f64 holds exactly.
//! - The definition of a hit rounds a = (v − cᵢ) − (o − cᵢ) once. Both terms are exact, so a is v − o rounded once: the same
//!   number in every region. Directions are not changed by moving. So a region decides about its triangles, and evaluates
//!   their depths, with the same bits as any other region would.
//!
//! Centres are multiples of 2ᵏ⁻³⁰ at least, so the last but one holds for every origin up to 2²² times as far away as the scene is
//! large. (From farther away, hits are as precise as an f64 of that size is, and rays may leak through the seams of regions.)
//!
//! # The error
//! A vertex moves by at most half the step of a region that has it, along each axis, which is 2⁻²⁵ of the region's size. Regions are
//! split until that is at most 2⁻¹⁵ m (31 µm), unless a triangle is longer than 1024 m: such a triangle is put into a region of
//! others of its size, and only vertices of such triangles are off by as much as their size demands. The number of regions is
//! limited by the number of triangles, because each costs some kilobytes; the largest are split first. The origin of a ray
//! moves by at most r/2 along each axis, half the last digit of a coordinate as large as the scene.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use glam::DVec3;
use rayon::prelude::*;

use super::bounds::Bounds;
use super::flatten::{Gathered, Numbers, f64_from};
use super::geometry::Mesh;
use super::rounding::Rounding;
use super::steps::{exponent_above, power_of_two};

/// The binary exponent of the size, in metres, that regions are split down to: half the largest side of their bounds.
const SIZE: i32 = 10;

/// The binary digits of an f32.
const F32_DIGITS: i32 = 24;

/// The finest grid of centres, as a binary fraction of the scene's size.
const CENTRE_DIGITS: i32 = 30;

/// The number of regions that any scene may have, and the triangles that a scene has for each further one.
const FEW_REGIONS: usize = 1024;
const TRIANGLES_A_REGION: usize = 64;

/// Triangles in a space of their own.
#[derive(Default)]
pub(super) struct Region {
    /// The origin of the space, in the space that the triangles were given in.
    pub centre: DVec3,
    pub mesh: Mesh,
}

/// Splits triangles into regions: first the one with most triangles, then the others in document order of their first triangle.
/// Returns the number of triangles without an area after rounding, which were left out, too.
pub(super) fn split(all: &Gathered, rounding: &mut Rounding) -> (Vec<Region>, u64) {
    let mut groups = Groups::new(all).split();
    if let Some(most) = (0..groups.len()).max_by_key(|&i| (groups[i].len(), Reverse(i))) {
        groups[..=most].rotate_right(1);
    }

    let reach = all.positions.iter().fold(0.0_f64, |most, p| most.max(p.abs().max_element()));
    let finest_grid = power_of_two(exponent_above(reach) - CENTRE_DIGITS);
    let mut spaces: Vec<_> = groups.iter().map(|group| Space::around(all, group, finest_grid)).collect();
    let steps = agree(all, &groups, &mut spaces);

    let (mut left_out, mut numbers) = (0, Numbers::default());
    let regions = groups.iter().zip(&spaces).map(|(group, space)| {
        let mut mesh = Mesh::default();
        let store = |v: u32| {
            let exact = all.positions[v as usize];
            let moved = steps.moved(exact, v);
            let stored = (moved - space.centre).as_vec3().to_array();
            debug_assert_eq!(f64_from(stored), moved - space.centre, "a region stores its vertices exactly");
            (stored, (moved - exact).abs().max_element())
        };
        left_out += all.store(group.iter().copied(), store, &mut mesh, rounding, &mut numbers);
        Region { centre: space.centre, mesh }
    });
    let regions = regions.filter(|region| !region.mesh.triangles.is_empty()).collect();
    (regions, left_out)
}

/// Groups of triangles, while they are split.
struct Groups<'g> {
    all: &'g Gathered,
    /// The triangles, group by group.
    items: Vec<u32>,
    /// The groups that may be split, by the bits of half their largest side.
    open: BinaryHeap<(u64, Reverse<usize>, usize)>,
    done: Vec<(usize, usize)>,
}

impl<'g> Groups<'g> {
    /// Groups by the power of two that triangles' sizes are below.
    fn new(all: &'g Gathered) -> Self {
        let mut items: Vec<u32> = (0..all.triangles.len() as u32).collect();
        let class = |&item: &u32| exponent_above(2.0 * bounds_of(all, item).half_extent()).max(SIZE);
        items.par_sort_by_cached_key(class);
        let mut groups = Self { all, items, open: BinaryHeap::new(), done: Vec::new() };
        let mut start = 0;
        while start < groups.items.len() {
            let class_here = class(&groups.items[start]);
            let count = groups.items[start..].iter().take_while(|item| class(item) == class_here).count();
            groups.push(start, start + count);
            start += count;
        }
        groups
    }

    fn push(&mut self, start: usize, end: usize) {
        let items = self.items[start..end].par_iter();
        let bounds = items.map(|&item| bounds_of(self.all, item)).reduce(|| Bounds::EMPTY, Bounds::union);
        // For numbers that are not negative, the order of the bits is that of the numbers.
        self.open.push((bounds.half_extent().to_bits(), Reverse(start), end));
    }

    /// Splits the largest groups until all are small enough, or there are as many as may be.
    fn split(mut self) -> Vec<Vec<u32>> {
        let most = FEW_REGIONS.max(self.all.triangles.len() / TRIANGLES_A_REGION);
        while let Some((_, Reverse(start), end)) = self.open.pop() {
            match self.cut(start, end) {
                Some(cut) if self.open.len() + self.done.len() + 2 <= most => {
                    self.push(start, cut);
                    self.push(cut, end);
                }
                _ => self.done.push((start, end)),
            }
        }
        let mut groups: Vec<_> =
            self.done.iter().map(|&(start, end)| self.items[start..end].to_vec()).collect();
        groups.par_iter_mut().for_each(|group| group.sort_unstable());
        groups.sort_unstable_by_key(|group| group[0]);
        groups
    }

    /// Sorts a group's triangles to two sides of its middle, and returns where the second side begins. `None` for a group that
    /// is small enough for its triangles, or whose triangles all have one middle.
    fn cut(&mut self, start: usize, end: usize) -> Option<usize> {
        let all = self.all;
        let twice_middle = |item: u32| {
            let Bounds { low, high } = bounds_of(all, item);
            low + high
        };
        let items = &mut self.items[start..end];
        let none = || (Bounds::EMPTY, Bounds::EMPTY, 0.0);
        let (bounds, middles, longest) = items
            .par_iter()
            .map(|&item| {
                let bounds = bounds_of(all, item);
                (bounds, Bounds::EMPTY.with(twice_middle(item)), bounds.half_extent())
            })
            .reduce(none, |a, b| (a.0.union(b.0), a.1.union(b.1), a.2.max(b.2)));
        let size = power_of_two(exponent_above(2.0 * longest).max(SIZE));
        // The centre is on a grid of at most a sixteenth of that, off by up to half of it.
        if bounds.half_extent() <= size * (31.0 / 32.0) {
            return None;
        }
        let extent = middles.high - middles.low;
        let axis = (0..3).max_by(|&a, &b| extent[a].total_cmp(&extent[b]))?;
        let middle = middles.low[axis] / 2.0 + middles.high[axis] / 2.0;
        let (mut near, far): (Vec<u32>, Vec<u32>) =
            items.iter().partition(|&&item| twice_middle(item)[axis] < middle);
        let count = near.len();
        near.extend(far);
        items.copy_from_slice(&near);
        (count > 0 && count < items.len()).then_some(start + count)
    }
}

/// The bounds of a triangle.
fn bounds_of(all: &Gathered, triangle: u32) -> Bounds {
    let corners = all.triangles[triangle as usize].into_iter().map(|v| all.positions[v as usize]);
    corners.fold(Bounds::EMPTY, Bounds::with)
}

/// The vertices of some triangles, one after the other.
fn vertices(all: &Gathered, triangles: &[u32]) -> impl Iterator<Item = u32> {
    triangles.iter().flat_map(|&triangle| all.triangles[triangle as usize])
}

/// The space of a region.
struct Space {
    centre: DVec3,
    /// The binary exponent of the size: no vertex is farther from the centre along any axis.
    size: i32,
}

impl Space {
    /// The space of a group of triangles, whose centre is on a grid that is at least as coarse as `finest_grid`.
    fn around(all: &Gathered, group: &[u32], finest_grid: f64) -> Self {
        let bounds = group.iter().map(|&item| bounds_of(all, item)).fold(Bounds::EMPTY, Bounds::union);
        let grid = power_of_two(exponent_above(bounds.half_extent()) - 5).max(finest_grid);
        let centre = bounds.middle(grid);
        let size = |p: DVec3| exponent_above((p - centre).abs().max_element());
        Self { centre, size: size(bounds.low).max(size(bounds.high)) }
    }
}

/// The steps that vertices are moved to.
struct Steps {
    /// The place of each vertex.
    place: Vec<u32>,
    /// The binary exponent of the size of the largest region that has a vertex at a place.
    size: Vec<i32>,
}

impl Steps {
    /// A vertex, moved to a multiple of its step.
    fn moved(&self, position: DVec3, vertex: u32) -> DVec3 {
        let step = power_of_two(self.size[self.place[vertex as usize] as usize] - F32_DIGITS);
        (position / step).round() * step
    }
}

/// Finds the step of each vertex, and enlarges spaces whose vertices move out of them. That is so where a small triangle shares a
/// vertex with a very large one; sizes only grow, by less than the largest step, so it ends.
fn agree(all: &Gathered, groups: &[Vec<u32>], spaces: &mut [Space]) -> Steps {
    let finest = spaces.iter().map(|space| space.size).min().unwrap_or(0);
    let place = places(all, power_of_two(finest - F32_DIGITS));
    let count = place.iter().max().map_or(0, |&last| last as usize + 1);
    let mut steps = Steps { place, size: vec![i32::MIN; count] };
    loop {
        for (group, space) in groups.iter().zip(&*spaces) {
            for v in vertices(all, group) {
                let size = &mut steps.size[steps.place[v as usize] as usize];
                *size = space.size.max(*size);
            }
        }
        let mut has_grown = false;
        for (group, space) in groups.iter().zip(&mut *spaces) {
            for v in vertices(all, group) {
                let moved = steps.moved(all.positions[v as usize], v);
                let needed = exponent_above((moved - space.centre).abs().max_element());
                has_grown |= needed > space.size;
                space.size = space.size.max(needed);
            }
        }
        if !has_grown {
            return steps;
        }
    }
}

/// Numbers the places of vertices: those that are the same when rounded to multiples of `step` have one number. (Exporters write
/// a vertex once for each of its normals, and neighbouring nodes compute it twice.)
fn places(all: &Gathered, step: f64) -> Vec<u32> {
    let key = |v: u32| {
        let p = (all.positions[v as usize] / step).round() + 0.0;
        [p.x, p.y, p.z].map(f64::to_bits)
    };
    let mut order: Vec<u32> = (0..all.positions.len() as u32).collect();
    order.par_sort_unstable_by_key(|&v| key(v));
    let mut place = vec![0; order.len()];
    for pair in order.windows(2) {
        let is_new = u32::from(key(pair[0]) != key(pair[1]));
        place[pair[1] as usize] = place[pair[0] as usize] + is_new;
    }
    place
}
