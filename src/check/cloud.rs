//! Comparison of point clouds: point by point if they have the same layout, otherwise by distance.

use std::cmp::Ordering;

use crate::output::recorded::Cloud;

/// The difference between two clouds.
#[derive(Clone, Debug, PartialEq)]
pub enum CloudDifference {
    /// The clouds have the same number of points and the same fields, and are compared field by field.
    SameLayout {
        /// The differences of the fields that both clouds have.
        fields: Vec<FieldDifference>,
    },
    /// The clouds have different layouts, and are compared by distance.
    Distances(CloudDistances),
}

/// The difference in one field.
#[derive(Clone, Debug, PartialEq)]
pub struct FieldDifference {
    /// The field's name.
    pub field: String,
    /// The number of points that differ by more than the tolerance.
    pub differing: usize,
    /// The greatest absolute difference.
    pub max: f64,
    /// The mean absolute difference.
    pub mean: f64,
}

/// The distances between two clouds, in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CloudDistances {
    /// The mean distance of the first cloud's points to their nearest neighbours in the second cloud.
    pub there_mean_m: f64,
    /// The greatest of these distances.
    pub there_max_m: f64,
    /// The mean distance of the second cloud's points to their nearest neighbours in the first cloud.
    pub back_mean_m: f64,
    /// The greatest of these distances.
    pub back_max_m: f64,
    /// The Chamfer distance, taken as the mean of the two mean distances.
    pub chamfer_m: f64,
    /// The density-aware Chamfer distance, from 0 (the clouds are the same) to 1 (Wu et al., "Density-aware Chamfer
    /// Distance as a Comprehensive Metric for Point Cloud Completion", NeurIPS 2021, eq. 7): ½ Σ over both directions of
    /// the mean of 1 − exp(−α d²)/n, where n is the number of points that share the nearest neighbour and α =
    /// [`DENSITY_ALPHA`].
    pub density_aware: f64,
}

/// α of the density-aware Chamfer distance, in m⁻²: points 10 cm apart count as two thirds of a miss.
pub const DENSITY_ALPHA: f64 = 100.0;

/// The reason why two clouds have no distance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum CloudError {
    /// One of the clouds has no points. The numbers are those of both clouds.
    #[error("the clouds have {0} and {1} points, and an empty cloud has no distance to another")]
    NoPoints(usize, usize),
    /// One of the clouds has no fields x, y and z.
    #[error("a cloud without x, y and z has no distance to another")]
    NoCoordinates,
    /// The nearest neighbours would take too long to find.
    #[error(
        "the nearest points of these clouds take too long to find: nearly all points of one are equally far from points of the \
         other"
    )]
    TooMuchWork,
}

/// Compares two clouds. `tolerance` returns the tolerance of a field by its name.
///
/// # Errors
/// A [`CloudError`] if one of the clouds has no points or no coordinates.
pub fn compare_clouds(
    first: &Cloud,
    second: &Cloud,
    tolerance: &dyn Fn(&str) -> f64,
) -> Result<CloudDifference, CloudError> {
    let names = |cloud: &Cloud| cloud.fields.iter().map(|f| f.name.clone()).collect::<Vec<_>>();
    if first.points == second.points && names(first) == names(second) {
        let fields = first.fields.iter().zip(&second.fields).map(|(a, b)| {
            let differences = a.values.iter().zip(&b.values).map(|(a, b)| {
                let same = a == b || (a.is_nan() && b.is_nan());
                let difference = (a - b).abs();
                if same {
                    0.0
                } else if difference.is_nan() {
                    f64::INFINITY
                } else {
                    difference
                }
            });
            let (mut differing, mut max, mut sum) = (0, 0.0_f64, 0.0);
            for difference in differences {
                differing += usize::from(difference > tolerance(&a.name));
                (max, sum) = (max.max(difference), sum + difference);
            }
            FieldDifference {
                field: a.name.clone(),
                differing,
                max,
                mean: sum / (first.points.max(1)) as f64,
            }
        });
        return Ok(CloudDifference::SameLayout { fields: fields.collect() });
    }
    let (a, b) = (points(first)?, points(second)?);
    if a.is_empty() || b.is_empty() {
        return Err(CloudError::NoPoints(a.len(), b.len()));
    }
    Ok(CloudDifference::Distances(distances(&a, &b)?))
}

fn points(cloud: &Cloud) -> Result<Vec<[f64; 3]>, CloudError> {
    let [x, y, z] = ["x", "y", "z"].map(|name| cloud.field(name));
    let (Some(x), Some(y), Some(z)) = (x, y, z) else {
        return Err(CloudError::NoCoordinates);
    };
    // A negative zero is equal to zero, and sorted like it.
    let points = (0..cloud.points).map(|i| [x[i] + 0.0, y[i] + 0.0, z[i] + 0.0]);
    Ok(points.filter(|p| p.iter().all(|c| c.is_finite())).collect())
}

fn distances(a: &[[f64; 3]], b: &[[f64; 3]]) -> Result<CloudDistances, CloudError> {
    let (there, back) = (directed_distances(a, b)?, directed_distances(b, a)?);
    Ok(CloudDistances {
        there_mean_m: there.mean,
        there_max_m: there.max,
        back_mean_m: back.mean,
        back_max_m: back.max,
        chamfer_m: (there.mean + back.mean) / 2.0,
        density_aware: (there.density_aware + back.density_aware) / 2.0,
    })
}

struct OneWay {
    mean: f64,
    max: f64,
    density_aware: f64,
}

fn directed_distances(from: &[[f64; 3]], to: &[[f64; 3]]) -> Result<OneWay, CloudError> {
    let tree = KdTree::new(to);
    let mut work = WORK_A_POINT.saturating_mul(from.len() + to.len()).saturating_add(LEAST_WORK);
    // Equal points have the same neighbour, which is looked for once.
    let mut order: Vec<u32> = (0..from.len() as u32).collect();
    order.sort_unstable_by(|&a, &b| compare_points(&from[a as usize], &from[b as usize]).then(a.cmp(&b)));
    let mut nearest = vec![(0, 0.0); from.len()];
    for equal in order.chunk_by(|&a, &b| from[a as usize] == from[b as usize]) {
        let found = tree.nearest(&from[equal[0] as usize], &mut work).ok_or(CloudError::TooMuchWork)?;
        equal.iter().for_each(|&i| nearest[i as usize] = found);
    }
    let mut sharing = vec![0_u32; to.len()];
    for (index, _) in &nearest {
        sharing[*index as usize] += 1;
    }
    let count = from.len() as f64;
    let density = nearest.iter().map(|(index, square): &(u32, f64)| {
        1.0 - libm::exp(-DENSITY_ALPHA * square) / f64::from(sharing[*index as usize])
    });
    Ok(OneWay {
        mean: nearest.iter().map(|(_, square)| square.sqrt()).sum::<f64>() / count,
        max: nearest.iter().map(|(_, square)| square.sqrt()).fold(0.0, f64::max),
        density_aware: density.sum::<f64>() / count,
    })
}

fn compare_points(a: &[f64; 3], b: &[f64; 3]) -> Ordering {
    let axis = |axis: usize| a[axis].total_cmp(&b[axis]);
    axis(0).then(axis(1)).then(axis(2))
}

/// Nodes of the tree that may be visited for each point of both clouds, and at least. Clouds as sensors see them take some
/// fifty a point. Only points that lie about the middle of a sphere of points, as near as rounding allows, take all of them.
const WORK_A_POINT: usize = 10_000;
const LEAST_WORK: usize = 100_000_000;

/// A k-d tree (J. L. Bentley, "Multidimensional binary search trees used for associative searching", 1975) with the box of
/// the points of each node. The middle element of each range is its root; points with smaller coordinates along the longest
/// side of the box come before it and points with greater ones after it. Of points that are equal only the first is in the
/// tree. It takes fewer lines than a crate would bring dependencies.
struct KdTree<'a> {
    points: &'a [[f64; 3]],
    order: Vec<u32>,
    /// The least and the greatest coordinates of each range's points, at the range's middle.
    boxes: Vec<[[f64; 3]; 2]>,
}

impl<'a> KdTree<'a> {
    fn new(points: &'a [[f64; 3]]) -> Self {
        let at = |i: u32| &points[i as usize];
        let mut order: Vec<u32> = (0..points.len() as u32).collect();
        order.sort_unstable_by(|&a, &b| compare_points(at(a), at(b)).then(a.cmp(&b)));
        order.dedup_by(|later, first| at(*later) == at(*first));
        let mut boxes = vec![[[0.0; 3]; 2]; order.len()];
        let mut pending = vec![(0, order.len())];
        while let Some((start, end)) = pending.pop() {
            if start == end {
                continue;
            }
            let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
            for &i in &order[start..end] {
                for axis in 0..3 {
                    low[axis] = low[axis].min(at(i)[axis]);
                    high[axis] = high[axis].max(at(i)[axis]);
                }
            }
            let length = |axis: &usize| high[*axis] - low[*axis];
            let axis = (0..3).max_by(|a, b| length(a).total_cmp(&length(b))).unwrap_or(0);
            let middle = usize::midpoint(start, end);
            order[start..end].select_nth_unstable_by(middle - start, |&a, &b| {
                at(a)[axis].total_cmp(&at(b)[axis]).then(a.cmp(&b))
            });
            boxes[middle] = [low, high];
            pending.extend([(start, middle), (middle + 1, end)]);
        }
        Self { points, order, boxes }
    }

    /// The index of the nearest point (the first one of equal distances), and the square of its distance. The tree must not
    /// be empty. Every visited node is taken from `work`; `None` once there is nothing left.
    fn nearest(&self, p: &[f64; 3], work: &mut usize) -> Option<(u32, f64)> {
        let mut best = (u32::MAX, f64::INFINITY);
        // The last number is the squared distance of the range's box.
        let mut pending = vec![(0, self.order.len(), 0.0)];
        while let Some((start, end, least)) = pending.pop() {
            // A point at the same distance may come first.
            if least > best.1 {
                continue;
            }
            *work = work.checked_sub(1)?;
            let middle = usize::midpoint(start, end);
            let index = self.order[middle];
            let q = &self.points[index as usize];
            let square = (0..3).map(|i| (p[i] - q[i]) * (p[i] - q[i])).sum::<f64>();
            if (square, index) < (best.1, best.0) {
                best = (index, square);
            }
            let halves = [(start, middle), (middle + 1, end)];
            let mut halves = halves.map(|(start, end)| (start, end, self.distance_to_box(start, end, p)));
            halves.sort_by(|a, b| b.2.total_cmp(&a.2));
            pending.extend(halves.into_iter().filter(|(start, end, _)| start < end));
        }
        Some(best)
    }

    /// The squared distance of a point to the box of a range, which is 0 inside it. Rounding can't make it greater than that
    /// of a point of the range: each difference is rounded as the point's is, and is no greater.
    fn distance_to_box(&self, start: usize, end: usize, p: &[f64; 3]) -> f64 {
        let Some([low, high]) = self.boxes.get(usize::midpoint(start, end)).filter(|_| start < end) else {
            return f64::INFINITY;
        };
        let outside = |i: usize| (low[i] - p[i]).max(p[i] - high[i]).max(0.0);
        (0..3).map(|i| outside(i) * outside(i)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::recorded::Field;
    use proptest::prelude::*;

    fn cloud(points: &[[f64; 3]]) -> Cloud {
        let field = |(axis, name): (usize, &str)| Field {
            name: name.into(),
            kind: "float",
            values: points.iter().map(|p| p[axis]).collect(),
        };
        let fields = ["x", "y", "z"].into_iter().enumerate().map(field).collect();
        Cloud { points: points.len(), fields, comments: vec![] }
    }

    #[test]
    fn the_same_layout_is_compared_field_by_field() {
        let a = cloud(&[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]);
        let b = cloud(&[[0.0, 0.0, 0.0], [1.0, 0.5, 0.0]]);
        let Ok(CloudDifference::SameLayout { fields }) = compare_clouds(&a, &b, &|_| 0.0) else { panic!() };
        let y = FieldDifference { field: "y".into(), differing: 1, max: 0.5, mean: 0.25 };
        assert_eq!((fields[0].differing, &fields[1]), (0, &y));
    }

    #[test]
    fn distances_are_those_of_the_definition() {
        // Two points of the first cloud share the nearest point of the second cloud, which is 1 m and 0 m away.
        let a = cloud(&[[0.0; 3], [1.0, 0.0, 0.0]]);
        let b = cloud(&[[0.0; 3]]);
        let Ok(CloudDifference::Distances(d)) = compare_clouds(&a, &b, &|_| 0.0) else { panic!() };
        assert_eq!((d.there_mean_m, d.there_max_m, d.back_mean_m, d.chamfer_m), (0.5, 1.0, 0.0, 0.25));
        // The first direction gives (1 − 1/2 + 1 − e^−100/2)/2 = 3/4, and the second gives 0.
        assert!((d.density_aware - 0.375).abs() < 1e-12, "{d:?}");
        assert_eq!(compare_clouds(&a, &cloud(&[]), &|_| 0.0).err(), Some(CloudError::NoPoints(a.points, 0)));
    }

    /// The case diff-clouds-quadratic: all points of each cloud in one place, and points in the middle of a ring.
    #[test]
    fn points_that_coincide_or_are_equally_far_take_no_longer() {
        let stacked = |count: usize, at: f64| vec![[at, 0.0, 0.0]; count];
        let d = distances(&stacked(50_000, 0.0), &stacked(49_999, 1.0)).unwrap();
        assert_eq!((d.there_mean_m, d.there_max_m, d.chamfer_m), (1.0, 1.0, 1.0));
        let ring = |i: usize| {
            let angle = i as f64 * 1e-4;
            [libm::cos(angle), libm::sin(angle), 0.0]
        };
        let ring: Vec<_> = (0..60_000).map(ring).collect();
        let d = distances(&stacked(20_000, 0.0), &ring).unwrap();
        assert!((d.there_mean_m - 1.0).abs() < 1e-12 && (d.back_max_m - 1.0).abs() < 1e-12, "{d:?}");
        // Points that are in the middle but for rounding would be compared with all of the ring.
        let middle: Vec<_> = (0..20_000).map(|i| [f64::from(i) * 1e-300, 0.0, 0.0]).collect();
        let tree = KdTree::new(&ring);
        assert_eq!(tree.nearest(&middle[0], &mut 10), None, "work is counted");
    }

    proptest! {
        #[test]
        fn the_tree_finds_what_trying_all_finds(
            points in prop::collection::vec(prop::array::uniform3(-3..3_i32), 1..80),
            p in prop::array::uniform3(-4.0..4.0),
        ) {
            // Integer coordinates make many points coincide and many distances equal.
            let points: Vec<[f64; 3]> = points.iter().map(|p| p.map(f64::from)).collect();
            let square = |q: &[f64; 3]| (0..3).map(|i| (p[i] - q[i]) * (p[i] - q[i])).sum::<f64>();
            let all = (0..points.len()).map(|i| (square(&points[i]), i as u32));
            let expected = all.min_by(|a, b| a.partial_cmp(b).unwrap()).unwrap();
            let found = KdTree::new(&points).nearest(&p, &mut usize::MAX.clone()).unwrap();
            prop_assert_eq!((found.1, found.0), expected);
        }
    }
}
