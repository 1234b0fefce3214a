//! Oriented boxes: the smallest with given axes around points, and the upright one of the least footprint.

use glam::{DMat3, DVec2, DVec3};

use crate::frame::Pose;

/// A box in space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrientedBox {
    /// The pose of the box's own frame, whose origin is the centre of the box: x along its length, y along its width, z along its
    /// height.
    pub world_from_box: Pose,
    /// Length, width and height: the sides along x, y and z, in metres.
    pub size_m: DVec3,
}

impl OrientedBox {
    /// The smallest box around points whose axes are those of a frame. `None` of no points.
    pub fn in_frame(world_from_frame: &Pose, points: impl Iterator<Item = DVec3>) -> Option<Self> {
        let frame_from_world = world_from_frame.inverse();
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for point in points {
            let point = frame_from_world.point(point);
            (low, high) = (low.min(point), high.max(point));
        }
        if !(low.is_finite() && high.is_finite()) {
            return None;
        }
        let translation = world_from_frame.point(low / 2.0 + high / 2.0);
        Some(Self {
            world_from_box: Pose { rotation: world_from_frame.rotation, translation },
            size_m: high - low,
        })
    }

    /// The upright box around points whose footprint has the least area, for a thing of which no direction is known. Its length
    /// is at least its width, and its yaw is above −90° and at most 90°, because nothing tells its front from its back. Of boxes
    /// whose footprints are equal to a part in 10⁹, it is the one with the least |yaw|. `None` of no points.
    pub fn upright(points: &[DVec3]) -> Option<Self> {
        /// Areas that differ by less than this part are equal: far more than f64 rounds, and far less than f32 vertices do.
        const EQUAL: f64 = 1e-9;
        let hull = convex_hull(points.iter().map(|point| point.truncate()).collect());
        let edges = hull.iter().zip(hull.iter().cycle().skip(1)).map(|(a, b)| *b - *a);
        let mut directions: Vec<DVec2> = edges.filter_map(|edge| edge.try_normalize()).collect();
        if directions.is_empty() {
            directions.push(DVec2::X);
        }
        let mut best: Option<(f64, DVec2)> = None;
        for direction in directions {
            let sides = sides_along(&hull, direction);
            let along = if sides.x >= sides.y { direction } else { direction.perp() };
            let x = forward(along);
            let area = sides.x * sides.y;
            let is_better = best.is_none_or(|(least, chosen)| {
                let is_equal = (area - least).abs() <= EQUAL * least.max(area);
                if is_equal { x.x > chosen.x } else { area < least }
            });
            if is_better {
                best = Some((best.map_or(area, |(least, _)| least.min(area)), x));
            }
        }
        let (_, x) = best?;
        let x = DVec3::new(x.x, x.y, 0.0);
        let rotation = DMat3::from_cols(x, DVec3::Z.cross(x), DVec3::Z);
        Self::in_frame(&Pose { rotation, translation: DVec3::ZERO }, points.iter().copied())
    }

    /// The corners, in the world.
    pub fn corners(&self) -> [DVec3; 8] {
        [0, 1, 2, 3, 4, 5, 6, 7].map(|corner| {
            let side = |axis: u32| if corner >> axis & 1 == 0 { -0.5 } else { 0.5 };
            self.world_from_box.point(DVec3::new(side(0), side(1), side(2)) * self.size_m)
        })
    }
}

/// The direction or its opposite, whichever has a yaw above −90° and at most 90°.
fn forward(direction: DVec2) -> DVec2 {
    if direction.x > 0.0 || (direction.x == 0.0 && direction.y > 0.0) { direction } else { -direction }
}

/// The lengths of the hull along a unit direction and across it.
fn sides_along(hull: &[DVec2], direction: DVec2) -> DVec2 {
    let (mut low, mut high) = (DVec2::INFINITY, DVec2::NEG_INFINITY);
    for point in hull {
        let place = DVec2::new(direction.dot(*point), direction.perp_dot(*point));
        (low, high) = (low.min(place), high.max(place));
    }
    high - low
}

/// The corners of the convex hull, counter-clockwise from the leftmost (A. M. Andrew, "Another efficient algorithm for convex
/// hulls in two dimensions", 1979).
fn convex_hull(mut points: Vec<DVec2>) -> Vec<DVec2> {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    let half = |points: &mut dyn Iterator<Item = DVec2>| {
        let mut chain: Vec<DVec2> = Vec::new();
        for point in points {
            while let [.., a, b] = chain[..]
                && (b - a).perp_dot(point - b) <= 0.0
            {
                chain.pop();
            }
            chain.push(point);
        }
        chain.pop();
        chain
    };
    if points.len() < 2 {
        return points;
    }
    let lower = half(&mut points.iter().copied());
    let upper = half(&mut points.iter().rev().copied());
    [lower, upper].concat()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle::Angle;

    fn turned(yaw: f64) -> Pose {
        Pose::from_rpy(DVec3::new(40.0, -7.0, 3.0), Angle::default(), Angle::default(), Angle::deg(yaw))
    }

    /// The corners of a box of 4 × 2 × 1 m with points inside of it.
    fn points(pose: &Pose) -> Vec<DVec3> {
        let corner = |i: u32| {
            let side = |axis: u32| if i >> axis & 1 == 0 { -1.0 } else { 1.0 };
            DVec3::new(2.0 * side(0), side(1), 0.5 * side(2))
        };
        let inside = (0..100).map(|i| DVec3::splat(f64::from(i) / 100.0 - 0.5));
        (0..8).map(corner).chain(inside).map(|point| pose.point(point)).collect()
    }

    #[test]
    fn a_box_has_the_axes_of_its_frame() {
        let pose = Pose::from_rpy(DVec3::ONE, Angle::deg(10.0), Angle::deg(20.0), Angle::deg(30.0));
        // The frame's origin is not the centre.
        let frame = pose * Pose { translation: DVec3::new(0.5, -3.0, 0.25), ..Pose::IDENTITY };
        let found = OrientedBox::in_frame(&frame, points(&pose).into_iter()).unwrap();
        assert!(found.size_m.abs_diff_eq(DVec3::new(4.0, 2.0, 1.0), 1e-14), "{found:?}");
        assert!(found.world_from_box.translation.abs_diff_eq(DVec3::ONE, 1e-14), "{found:?}");
        assert_eq!(found.world_from_box.rotation, pose.rotation);
        assert_eq!(OrientedBox::in_frame(&frame, std::iter::empty()), None);
        for corner in found.corners() {
            assert!(points(&pose).iter().any(|point| point.abs_diff_eq(corner, 1e-13)), "{corner}");
        }
    }

    #[test]
    fn the_least_footprint_finds_the_yaw() {
        for yaw in [0.0, 1.0, 30.0, 89.0, 90.0, -45.0, -89.9, 120.0, 180.0] {
            let found = OrientedBox::upright(&points(&turned(yaw))).unwrap();
            assert!(found.size_m.abs_diff_eq(DVec3::new(4.0, 2.0, 1.0), 1e-12), "{yaw}: {found:?}");
            assert!(found.world_from_box.translation.abs_diff_eq(turned(0.0).translation, 1e-12));
            let x = found.world_from_box.rotation.x_axis;
            let expected = turned(yaw).rotation.x_axis;
            assert!(x.cross(expected).length() < 1e-12 && x.x > -1e-12, "{yaw}: {x}");
            assert!((found.world_from_box.rotation.determinant() - 1.0).abs() < 1e-14);
        }
        // A square's sides are equal, so the least |yaw| decides.
        let square = [(0.0, 0.0), (3.0, 0.0), (3.0, 3.0), (0.0, 3.0)];
        for yaw in [0.0, 20.0, -40.0, 85.0] {
            let square = square.map(|(x, y)| turned(yaw).point(DVec3::new(x, y, 1.0)));
            let x = OrientedBox::upright(&square).unwrap().world_from_box.rotation.x_axis;
            let degrees = libm::atan2(x.y, x.x).to_degrees();
            let nearest = yaw - 90.0 * (yaw / 90.0).round();
            assert!((degrees - nearest).abs() < 1e-9, "{yaw}: {degrees}");
        }
    }

    #[test]
    fn points_on_a_line_and_one_point_have_boxes_too() {
        let pole = [DVec3::new(2.0, 3.0, 0.0), DVec3::new(2.0, 3.0, 5.0)];
        let found = OrientedBox::upright(&pole).unwrap();
        assert_eq!(
            (found.size_m, found.world_from_box.translation),
            (DVec3::new(0.0, 0.0, 5.0), DVec3::new(2.0, 3.0, 2.5))
        );
        let wire = [DVec3::ZERO, DVec3::new(1.0, 1.0, 0.0), DVec3::new(3.0, 3.0, 0.0)];
        let found = OrientedBox::upright(&wire).unwrap();
        assert!(found.size_m.abs_diff_eq(DVec3::new(18_f64.sqrt(), 0.0, 0.0), 1e-14), "{found:?}");
        assert_eq!(OrientedBox::upright(&[]), None);
    }
}
