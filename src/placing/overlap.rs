//! Whether a box meets a triangle or another box, by their separating axes.
//!
//! Two convex polyhedra are apart if and only if there is a gap between their projections onto a normal of a face of one of them, or
//! onto a cross product of an edge of the one and an edge of the other (S. Gottschalk, M. C. Lin and D. Manocha, "OBBTree: a
//! hierarchical structure for rapid interference detection", SIGGRAPH 1996). Whatever vector is taken for such an axis, a gap along it
//! is a gap. So it does not matter how the axes are rounded, only how projections are: bodies count as apart if the gap is wider than
//! all that rounding could do, and those that touch meet.

use glam::{DMat3, DVec3};

use crate::truth::OrientedBox;

/// How much a projection may be off, as a part of the largest coordinate times the sum of the axis' |components|. With u = 2⁻⁵³ and
/// coordinates of at most m, the difference of a corner and the box's centre is off by 2m·u along each axis, and turning it into
/// the box's frame adds at most 16u of its components' sum, 6m: the rotation is orthonormal to a few u, and the sums of three
/// products are off by 3u each. The products and sums of the projection itself are off by 8u of at most 5m. That is 138u.
const ROUNDING: f64 = 256.0 * (f64::EPSILON / 2.0);

/// Whether a box meets a triangle, whose corners are in the world, in metres. A box or a triangle may be flat.
pub fn box_meets_triangle(oriented: &OrientedBox, triangle: [DVec3; 3]) -> bool {
    let OrientedBox { world_from_box: pose, size_m } = oriented;
    let half = *size_m / 2.0;
    let largest = triangle
        .iter()
        .fold(pose.translation.abs().max(half), |largest, corner| largest.max(corner.abs()))
        .max_element();
    let to_box = pose.rotation.transpose();
    let [a, b, c] = triangle.map(|corner| to_box * (corner - pose.translation));
    let is_apart = |axis: DVec3| {
        let reach = half.dot(axis.abs());
        let (low, high) = span([a.dot(axis), b.dot(axis), c.dot(axis)]);
        low.max(-high) - reach > ROUNDING * largest * sum(axis)
    };
    let edges = [b - a, c - b, a - c];
    let mut axes = AXES
        .into_iter()
        .chain([edges[0].cross(edges[1])])
        .chain(AXES.into_iter().flat_map(|axis| edges.map(|edge| axis.cross(edge))));
    !axes.any(is_apart)
}

/// Whether two boxes meet. A box may be flat.
pub fn boxes_meet(one: &OrientedBox, other: &OrientedBox) -> bool {
    let halves = [one.size_m / 2.0, other.size_m / 2.0];
    let centres = [one.world_from_box.translation, other.world_from_box.translation];
    let largest =
        centres.iter().chain(&halves).fold(DVec3::ZERO, |largest, v| largest.max(v.abs())).max_element();
    let to_one = one.world_from_box.rotation.transpose();
    let between = to_one * (centres[1] - centres[0]);
    let turned: DMat3 = to_one * other.world_from_box.rotation;
    let of_other = [turned.x_axis, turned.y_axis, turned.z_axis];
    let is_apart = |axis: DVec3| {
        let along_other = DVec3::from_array(of_other.map(|own| own.dot(axis).abs()));
        let reach = halves[0].dot(axis.abs()) + halves[1].dot(along_other);
        between.dot(axis).abs() - reach > ROUNDING * largest * sum(axis)
    };
    let mut axes = AXES
        .into_iter()
        .chain(of_other)
        .chain(AXES.into_iter().flat_map(|axis| of_other.map(|own| axis.cross(own))));
    !axes.any(is_apart)
}

const AXES: [DVec3; 3] = [DVec3::X, DVec3::Y, DVec3::Z];

fn span([a, b, c]: [f64; 3]) -> (f64, f64) {
    (a.min(b).min(c), a.max(b).max(c))
}

fn sum(axis: DVec3) -> f64 {
    axis.abs().element_sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle::Angle;
    use crate::frame::Pose;
    use crate::rng::Rng;

    fn any_box(rng: &mut Rng) -> OrientedBox {
        let turn = Angle::rad(4.0 * rng.signed());
        let tilt = [Angle::rad(rng.signed()), Angle::rad(rng.signed())];
        let world_from_box = Pose::from_rpy(0.8 * rng.point(), tilt[0], tilt[1], turn);
        OrientedBox { world_from_box, size_m: DVec3::new(rng.unit(), rng.unit(), rng.unit()) + 0.2 }
    }

    /// The distance from a point to a box.
    fn distance(oriented: &OrientedBox, point: DVec3) -> f64 {
        let own = oriented.world_from_box.inverse().point(point);
        (own.abs() - oriented.size_m / 2.0).max(DVec3::ZERO).length()
    }

    /// The least of a convex function between 0 and 1, by ternary search: (2/3)⁴⁰ is 1e-7.
    fn least(f: &dyn Fn(f64) -> f64) -> f64 {
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..40 {
            let (a, b) = (low + (high - low) / 3.0, high - (high - low) / 3.0);
            if f(a) <= f(b) { high = b } else { low = a }
        }
        f(low).min(f(high))
    }

    /// Holds verdicts to distances, which the search finds to a few 1e-7 m: those that meet have none, and those apart have one.
    /// Gives how many were apart and how many met.
    fn hold(cases: impl Iterator<Item = (bool, f64)>) -> [usize; 2] {
        let mut count = [0; 2];
        for (meets, distance) in cases {
            assert!(meets || distance > 0.0, "they meet and count as apart");
            assert!(!meets || distance < 1e-5, "they are {distance} m apart and count as met");
            count[usize::from(meets)] += 1;
        }
        count
    }

    /// The distance to a box is convex, so that its least over a triangle is found by nested searches.
    #[test]
    fn boxes_and_triangles_meet_where_their_distance_is_0() {
        let mut rng = Rng::new(5);
        let cases = (0..2000).map(|_| {
            let oriented = any_box(&mut rng);
            let triangle @ [a, b, c] = [(); 3].map(|()| 1.3 * rng.point());
            let at = |u: f64, v: f64| distance(&oriented, a + ((b - a) + (c - b) * v) * u);
            (box_meets_triangle(&oriented, triangle), least(&|u| least(&|v| at(u, v))))
        });
        let [apart, met] = hold(cases);
        assert!(apart > 500 && met > 500, "{apart} apart, {met} met");
    }

    /// Solid boxes meet where a face of the one meets the other, or the one holds the other's centre.
    #[test]
    fn boxes_meet_where_their_faces_do_or_one_is_in_the_other() {
        let mut rng = Rng::new(6);
        let (mut apart, mut met) = (0, 0);
        for _ in 0..5000 {
            let (one, other) = (any_box(&mut rng), any_box(&mut rng));
            let corners = other.corners();
            let faces = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
            let mut triangles = faces.iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]);
            let meets = distance(&other, one.world_from_box.translation) == 0.0
                || triangles
                    .any(|triangle| box_meets_triangle(&one, triangle.map(|corner| corners[*corner])));
            assert_eq!(boxes_meet(&one, &other), meets);
            assert_eq!(boxes_meet(&other, &one), meets);
            (apart, met) = (apart + usize::from(!meets), met + usize::from(meets));
        }
        assert!(apart > 1000 && met > 1000, "{apart} apart, {met} met");
    }

    /// Far from the world's origin, where coordinates have a step of 1e-9 m, boxes that touch meet, and a gap of a tenth of a
    /// millimetre is one.
    #[test]
    fn what_touches_meets_and_a_small_gap_is_one() {
        let far = DVec3::new(5e5, 5.5e6, 300.0);
        let at = |offset: DVec3| OrientedBox {
            world_from_box: Pose { translation: far + offset, ..Pose::IDENTITY },
            size_m: DVec3::ONE,
        };
        assert!(boxes_meet(&at(DVec3::ZERO), &at(DVec3::X)));
        assert!(!boxes_meet(&at(DVec3::ZERO), &at(DVec3::X * 1.0001)));
        let floor =
            |z: f64| [[-9.0, -9.0, z], [9.0, -9.0, z], [0.0, 9.0, z]].map(|p| far + DVec3::from_array(p));
        assert!(box_meets_triangle(&at(DVec3::ZERO), floor(-0.5)));
        assert!(!box_meets_triangle(&at(DVec3::ZERO), floor(-0.5001)));
        assert!(box_meets_triangle(&at(DVec3::ZERO), floor(0.0)), "it passes through the box");
        let flat = OrientedBox { size_m: DVec3::new(1.0, 1.0, 0.0), ..at(DVec3::ZERO) };
        assert!(box_meets_triangle(&flat, floor(0.0)) && !box_meets_triangle(&flat, floor(0.001)));
    }
}
