//! Comparison of point clouds: point by point if they have the same layout, otherwise by distance.

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
    Ok(CloudDifference::Distances(distances(&a, &b)))
}

fn points(cloud: &Cloud) -> Result<Vec<[f64; 3]>, CloudError> {
    let [x, y, z] = ["x", "y", "z"].map(|name| cloud.field(name));
    let (Some(x), Some(y), Some(z)) = (x, y, z) else {
        return Err(CloudError::NoCoordinates);
    };
    let points = (0..cloud.points).map(|i| [x[i], y[i], z[i]]);
    Ok(points.filter(|p| p.iter().all(|c| c.is_finite())).collect())
}

fn distances(a: &[[f64; 3]], b: &[[f64; 3]]) -> CloudDistances {
    let (there, back) = (directed_distances(a, &KdTree::new(b)), directed_distances(b, &KdTree::new(a)));
    CloudDistances {
        there_mean_m: there.mean,
        there_max_m: there.max,
        back_mean_m: back.mean,
        back_max_m: back.max,
        chamfer_m: (there.mean + back.mean) / 2.0,
        density_aware: (there.density_aware + back.density_aware) / 2.0,
    }
}

struct OneWay {
    mean: f64,
    max: f64,
    density_aware: f64,
}

fn directed_distances(from: &[[f64; 3]], to: &KdTree) -> OneWay {
    let nearest: Vec<(u32, f64)> = from.iter().map(|p| to.nearest(p)).collect();
    let mut sharing = vec![0_u32; to.points.len()];
    for (index, _) in &nearest {
        sharing[*index as usize] += 1;
    }
    let count = from.len() as f64;
    let density = nearest.iter().map(|(index, square)| {
        1.0 - libm::exp(-DENSITY_ALPHA * square) / f64::from(sharing[*index as usize])
    });
    OneWay {
        mean: nearest.iter().map(|(_, square)| square.sqrt()).sum::<f64>() / count,
        max: nearest.iter().map(|(_, square)| square.sqrt()).fold(0.0, f64::max),
        density_aware: density.sum::<f64>() / count,
    }
}

/// A k-d tree (J. L. Bentley, "Multidimensional binary search trees used for associative searching", 1975). The middle
/// element of each range is its root; points with smaller coordinates come before it and points with greater ones after it.
/// It takes fifty lines here, where a crate would bring a dozen dependencies.
struct KdTree<'a> {
    points: &'a [[f64; 3]],
    order: Vec<u32>,
}

impl<'a> KdTree<'a> {
    fn new(points: &'a [[f64; 3]]) -> Self {
        let mut order: Vec<u32> = (0..points.len() as u32).collect();
        let mut pending = vec![(0, order.len(), 0)];
        while let Some((start, end, axis)) = pending.pop() {
            if end - start < 2 {
                continue;
            }
            let middle = (start + end) / 2;
            let key = |i: &u32| points[*i as usize][axis];
            order[start..end]
                .select_nth_unstable_by(middle - start, |a, b| key(a).total_cmp(&key(b)).then(a.cmp(b)));
            pending.extend([(start, middle, (axis + 1) % 3), (middle + 1, end, (axis + 1) % 3)]);
        }
        Self { points, order }
    }

    /// The index of the nearest point (the first one of equal distances), and the square of its distance. The tree must not
    /// be empty.
    fn nearest(&self, p: &[f64; 3]) -> (u32, f64) {
        let mut best = (u32::MAX, f64::INFINITY);
        // The last number is the least squared distance to any point of the range.
        let mut pending = vec![(0, self.order.len(), 0, 0.0)];
        while let Some((start, end, axis, least)) = pending.pop() {
            if start == end || least > best.1 {
                continue;
            }
            let middle = (start + end) / 2;
            let index = self.order[middle];
            let q = &self.points[index as usize];
            let square = (0..3).map(|i| (p[i] - q[i]) * (p[i] - q[i])).sum::<f64>();
            if (square, index) < (best.1, best.0) {
                best = (index, square);
            }
            let offset = p[axis] - q[axis];
            let next = (axis + 1) % 3;
            let (near, far) = match offset < 0.0 {
                true => ((start, middle), (middle + 1, end)),
                false => ((middle + 1, end), (start, middle)),
            };
            pending.push((far.0, far.1, next, least.max(offset * offset)));
            pending.push((near.0, near.1, next, least));
        }
        best
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
            let found = KdTree::new(&points).nearest(&p);
            prop_assert_eq!((found.1, found.0), expected);
        }
    }
}
