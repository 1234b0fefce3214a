use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DQuat, DVec3};
use proptest::prelude::*;

use super::*;
use crate::angle::Angle;
use crate::frame::Pose;

fn vector(most: f64) -> impl Strategy<Value = DVec3> + Clone {
    prop::array::uniform3(-most..most).prop_map(DVec3::from)
}

fn rotation() -> impl Strategy<Value = DQuat> + Clone {
    prop::array::uniform4(-1.0..1.0_f64).prop_filter_map("no rotation", |q| {
        let q = DQuat::from_array(q);
        (q.length() > 0.1).then(|| q.normalize())
    })
}

fn pose() -> impl Strategy<Value = Pose> {
    (vector(20.0), rotation())
        .prop_map(|(translation, q)| Pose { rotation: DMat3::from_quat(q), translation })
}

fn twist() -> impl Strategy<Value = Trajectory> {
    (pose(), vector(20.0), vector(3.0)).prop_map(|(start, linear_m_s, angular_rad_s)| Trajectory::Twist {
        start,
        linear_m_s,
        angular_rad_s,
    })
}

/// Times that rise, as many as there are values.
fn rising<T: std::fmt::Debug>(values: impl Strategy<Value = T>) -> impl Strategy<Value = (Vec<f64>, Vec<T>)> {
    prop::collection::vec((0.05..0.8_f64, values), 1..5).prop_map(|keys| {
        let mut time = -0.5;
        let times = keys.iter().map(|(span, _)| {
            time += span;
            time
        });
        (times.collect(), keys.into_iter().map(|(_, value)| value).collect())
    })
}

fn path() -> impl Strategy<Value = Trajectory> {
    (rising(pose()), any::<bool>()).prop_map(|((times, poses), is_linear)| {
        let interpolation = if is_linear { Interpolation::Linear } else { Interpolation::Screw };
        Trajectory::Path(Arc::new(Path::new(times, poses, interpolation).unwrap()))
    })
}

fn clock() -> impl Strategy<Value = Clock> {
    (-1.0..1.0_f64, 0.3..3.0_f64, 0.0..2.0_f64, any::<bool>())
        .prop_map(|(start_s, speed, length_s, is_looped)| Clock { start_s, speed, length_s, is_looped })
}

fn channel<T: std::fmt::Debug + Clone + 'static>(
    values: impl Strategy<Value = T> + Clone + 'static,
    tangents: impl Strategy<Value = T> + Clone + 'static,
) -> impl Strategy<Value = Channel<T>> {
    let track = prop_oneof![
        values.clone().prop_map(Track::rest),
        (rising(values.clone()), any::<bool>()).prop_map(|((times, values), is_linear)| {
            let blending = if is_linear { Blending::Linear } else { Blending::Step };
            Track::new(times, values, blending).unwrap()
        }),
        rising((tangents.clone(), values, tangents)).prop_map(|(times, values)| {
            let values = values.into_iter().flat_map(|(a, v, b)| [a, v, b]).collect();
            Track::new(times, values, Blending::Cubic).unwrap()
        }),
    ];
    (track, clock()).prop_map(|(track, clock)| Channel { track: Arc::new(track), clock })
}

fn animated() -> impl Strategy<Value = Link> {
    let tangent = prop::array::uniform4(-2.0..2.0_f64).prop_map(DQuat::from_array);
    (channel(vector(5.0), vector(10.0)), channel(rotation(), tangent), channel(vector(2.0), vector(2.0)))
        .prop_map(|(translation, rotation, scale)| Link::Animated { translation, rotation, scale })
}

fn link() -> impl Strategy<Value = Link> {
    let fixed = (vector(10.0), prop::array::uniform9(-1.5..1.5_f64)).prop_map(|(translation, matrix)| {
        Link::Fixed(DAffine3 { matrix3: DMat3::from_cols_array(&matrix), translation })
    });
    let visible = rising(any::<bool>()).prop_flat_map(|(times, values)| {
        let track = Arc::new(Track::new(times, values, Blending::Step).unwrap());
        clock().prop_map(move |clock| Link::Visible(Channel { track: track.clone(), clock }))
    });
    let chain = prop::collection::vec(animated(), 1..3)
        .prop_map(|links| Link::Rigid(Trajectory::Chain(Arc::new(Motion { links }))));
    prop_oneof![
        2 => fixed,
        2 => twist().prop_map(Link::Rigid),
        2 => path().prop_map(Link::Rigid),
        3 => animated(),
        1 => visible,
        1 => chain,
    ]
}

fn motion() -> impl Strategy<Value = Motion> {
    prop::collection::vec(link(), 0..4).prop_map(|links| Motion { links })
}

fn unit_point(low: DVec3, high: DVec3, part: [f64; 3]) -> DVec3 {
    low + (high - low) * DVec3::from(part)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    /// Whatever moves, no point of the box is outside the bounds at any time of the window.
    #[test]
    fn nothing_leaves_its_bounds(
        motion in motion(),
        (low, size) in (vector(5.0), vector(3.0)),
        (from_s, length_s) in (-2.0..2.0_f64, prop_oneof![Just(0.0), 0.0..0.01_f64, 0.0..2.0_f64]),
        moments in prop::collection::vec((0.0..=1.0_f64, prop::array::uniform3(0.0..=1.0_f64)), 24),
    ) {
        let high = low + size.abs();
        let to_s = from_s + length_s;
        let (least, most) = motion.bounds(from_s, to_s, low, high);
        prop_assert!(most.is_finite() || least.cmpgt(most).all());
        let corners = [[0.0; 3], [1.0; 3], [0.0, 1.0, 0.0], [1.0, 0.0, 1.0]];
        let ends = corners.into_iter().flat_map(|corner| [(0.0, corner), (1.0, corner)]);
        let all: Vec<_> = moments.into_iter().chain(ends).collect();
        for (part, place) in all {
            let time = (from_s + part * length_s).clamp(from_s, to_s);
            let Some(map) = motion.at(time) else { continue };
            let at = map.transform_point3(unit_point(low, high, place));
            prop_assert!(at.cmpge(least).all() && at.cmple(most).all(), "{at} at {time} outside {least} {most}");
        }
        prop_assert_eq!(motion.is_visible_in(from_s, from_s), motion.at(from_s).is_some());
    }

    /// Velocities are the derivatives of the map, wherever it has one.
    #[test]
    fn velocities_are_derivatives(motion in motion(), point in vector(5.0), time in -1.0..1.5_f64) {
        let step = 1e-5;
        let place = |time: f64| motion.map_at(time).transform_point3(point);
        let [before, early, now, late, after] =
            [-2.0, -1.0, 0.0, 1.0, 2.0].map(|steps| place(time + steps * step));
        // A bend or a jump within the five points shows in the second differences.
        let bends = [before - 2.0 * early + now, early - 2.0 * now + late, now - 2.0 * late + after];
        let velocity = motion.velocity(time, point);
        let size = now.length() + velocity.length() + 1.0;
        prop_assume!(bends.iter().all(|bend| bend.length() < 1e-6 * size));
        prop_assume!((bends[0] - bends[2]).length() < 1e-9 * size);
        let change = (late - early) / (2.0 * step);
        prop_assert!((change - velocity).length() < 1e-5 * size, "{change} {velocity}");
    }

    /// Accelerations of a point are the derivatives of its velocity, wherever it has one.
    #[test]
    fn accelerations_are_derivatives(motion in motion(), point in vector(5.0), time in -1.0..1.5_f64) {
        let step = 1e-5;
        let [before, early, now, late, after] =
            [-2.0, -1.0, 0.0, 1.0, 2.0].map(|steps| motion.velocity(time + steps * step, point));
        // A bend or a jump of the velocity within the five moments shows in the second differences.
        let bends = [before - 2.0 * early + now, early - 2.0 * now + late, now - 2.0 * late + after];
        let acceleration = motion.acceleration(time, point);
        let size = now.length() + acceleration.length() + 1.0;
        prop_assume!(bends.iter().all(|bend| bend.length() < 1e-6 * size));
        prop_assume!((bends[0] - bends[2]).length() < 1e-9 * size);
        let change = (late - early) / (2.0 * step);
        prop_assert!((change - acceleration).length() < 1e-5 * size, "{change} {acceleration}");
    }

    /// A body's acceleration is the derivative of its velocity, whatever carries it.
    #[test]
    fn bodies_accelerate_as_their_velocities_change(
        trajectory in prop_oneof![twist(), path(), motion().prop_map(|motion| Trajectory::Chain(Arc::new(motion)))],
        time in -1.0..1.5_f64,
    ) {
        let step = 1e-5;
        let [before, early, now, late, after] =
            [-2.0, -1.0, 0.0, 1.0, 2.0].map(|steps| trajectory.velocity(time + steps * step).linear_m_s);
        let bends = [before - 2.0 * early + now, early - 2.0 * now + late, now - 2.0 * late + after];
        let acceleration = trajectory.acceleration(time);
        let size = now.length() + acceleration.length() + 1.0;
        prop_assume!(bends.iter().all(|bend| bend.length() < 1e-6 * size));
        prop_assume!((bends[0] - bends[2]).length() < 1e-9 * size);
        let change = (late - early) / (2.0 * step);
        prop_assert!((change - acceleration).length() < 1e-5 * size, "{change} {acceleration}");
    }

    /// A body that is an animated node moves as a mesh of it does, if nothing scales it.
    #[test]
    fn a_chain_is_the_rigid_part_of_its_motion(links in prop::collection::vec(animated(), 1..4), time in -1.0..2.0_f64) {
        let links = links.into_iter().map(|link| match link {
            Link::Animated { translation, rotation, .. } => {
                Link::Animated { translation, rotation, scale: Channel::rest(DVec3::splat(1.0)) }
            }
            other => other,
        });
        let motion = Motion { links: links.collect() };
        let chain = Trajectory::Chain(Arc::new(motion.clone()));
        let (pose, map) = (chain.pose_at(time), motion.map_at(time));
        prop_assert!(pose.translation == map.translation);
        prop_assert!((pose.rotation - map.matrix3).to_cols_array().iter().all(|e| e.abs() < 1e-13));
        let velocity = chain.velocity(time);
        for point in [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z] {
            let of_point = velocity.linear_m_s + velocity.angular_rad_s.cross(pose.direction(point));
            let expected = motion.velocity(time, point);
            prop_assert!(of_point.abs_diff_eq(expected, 1e-11 * (1.0 + expected.length())), "{of_point} {expected}");
        }
    }

    /// A rotation between two keys is the one of constant angular speed, however near they are.
    #[test]
    fn rotations_turn_evenly(a in rotation(), axis in vector(1.0), exponent in -9.0..0.0_f64, u in 0.0..1.0_f64) {
        let Some(axis) = axis.try_normalize() else { return Ok(()) };
        let turned = |angle: f64| {
            let (sin, cos) = libm::sincos(0.5 * angle);
            a * DQuat::from_xyzw(axis.x * sin, axis.y * sin, axis.z * sin, cos)
        };
        let angle = PI * libm::pow(10.0, exponent);
        // The opposite quaternion is the same rotation.
        let track = Track::new(vec![0.0, 2.0], vec![a, -turned(angle)], Blending::Linear).unwrap();
        let (got, rate) = track.at_with_rate(2.0 * u);
        let expected = turned(u * angle);
        prop_assert!((got - expected).length().min((got + expected).length()) < 1e-15 * 4.0);
        prop_assert!((got.length() - 1.0).abs() < 1e-15);
        prop_assert!((rate.length() - 0.25 * angle).abs() < 1e-15 * 4.0);
    }
}

/// A spline whose tangents are those of a parabola is that parabola, as the specification's formula gives it.
#[test]
fn cubic_splines_are_those_of_gltf() {
    let at = |t: f64| DVec3::new(t * t, 1.0 - t, t * t * t);
    let rate = |t: f64| DVec3::new(2.0 * t, -1.0, 3.0 * t * t);
    let times = vec![0.5, 1.0, 3.0];
    let values = times.iter().flat_map(|t| [rate(*t), at(*t), rate(*t)]).collect();
    let track = Track::new(times, values, Blending::Cubic).unwrap();
    for i in 0..=25 {
        let t = 0.5 + f64::from(i) * 0.1;
        let (value, slope) = track.at_with_rate(t);
        assert!(value.abs_diff_eq(at(t), 1e-13), "{t}");
        // The last key holds.
        let expected = if i == 25 { DVec3::ZERO } else { rate(t) };
        assert!(slope.abs_diff_eq(expected, 1e-12), "{t} {slope}");
    }
    assert_eq!((track.at(0.0), track.at(9.0)), (at(0.5), at(3.0)));
    // The formula of appendix C, of one number that no symmetry helps: v 1 and 4, tangents 2 and −3, 2 s apart.
    let keys = [9.0, 1.0, 2.0, -3.0, 4.0, 9.0].map(|x| vec![x]).to_vec();
    let track = Track::new(vec![0.0, 2.0], keys, Blending::Cubic).unwrap();
    let (t, span): (f64, f64) = (0.25, 2.0);
    let expected = (2.0 * t * t * t - 3.0 * t * t + 1.0) * 1.0
        + span * (t * t * t - 2.0 * t * t + t) * 2.0
        + (-2.0 * t * t * t + 3.0 * t * t) * 4.0
        + span * (t * t * t - t * t) * -3.0;
    assert!((track.at(t * span)[0] - expected).abs() < 1e-15);
}

#[test]
fn steps_hold_and_tracks_are_checked() {
    let track = Track::new(vec![0.0, 1.0, 2.0], vec![true, false, true], Blending::Step).unwrap();
    assert_eq!(
        [-1.0, 0.0, 0.999, 1.0, 2.0, 9.0].map(|t| *track.held_at(t)),
        [true, true, true, false, true, true]
    );
    let visible =
        Motion { links: vec![Link::Visible(Channel { track: Arc::new(track), clock: Clock::once(2.0) })] };
    assert_eq!([0.5, 1.5].map(|t| visible.at(t).is_some()), [true, false]);
    assert!(
        !visible.is_visible_in(1.2, 1.9)
            && visible.is_visible_in(1.2, 2.0)
            && visible.is_visible_in(0.9, 1.9)
    );
    let (low, high) = visible.bounds(1.2, 1.9, DVec3::ZERO, DVec3::ONE);
    assert_eq!((low, high), (DVec3::INFINITY, DVec3::NEG_INFINITY));
    assert_eq!(Track::<bool>::new(vec![], vec![], Blending::Step), Err(TrackProblem::Empty));
    assert_eq!(Track::new(vec![0.0, 0.0], vec![1, 2], Blending::Step), Err(TrackProblem::Times(1)));
    assert_eq!(Track::new(vec![f64::NAN], vec![1], Blending::Step), Err(TrackProblem::Times(0)));
    let problem = TrackProblem::Values { has: 1, needs: 3 };
    assert_eq!(Track::new(vec![0.0], vec![1], Blending::Cubic), Err(problem));
}

/// The bounds of what drives, turns, walks and spins are hardly larger than what is reached.
#[test]
fn bounds_are_tight() {
    let car = Trajectory::Twist {
        start: Pose::from_rpy(
            DVec3::new(300.0, -40.0, 0.0),
            Angle::deg(0.0),
            Angle::deg(2.0),
            Angle::deg(30.0),
        ),
        linear_m_s: DVec3::new(15.0, 0.0, 0.0),
        angular_rad_s: DVec3::new(0.0, 0.0, 0.5),
    };
    let poses = [0.0, 0.1, 0.2, 0.3].map(|time| car.pose_at(time)).to_vec();
    let path = Path::new(vec![0.0, 0.1, 0.2, 0.3], poses, Interpolation::Linear).unwrap();
    let quarter = |turns: f64| {
        let (sin, cos) = libm::sincos(turns * PI);
        DQuat::from_xyzw(0.0, sin, 0.0, cos)
    };
    let spin = Track::new(
        (0..=4).map(f64::from).collect(),
        (0..=4).map(|k| quarter(0.25 * f64::from(k))).collect(),
        Blending::Linear,
    );
    let wheel = Link::Animated {
        translation: Channel::rest(DVec3::new(1.4, 0.8, 0.3)),
        rotation: Channel {
            track: Arc::new(spin.unwrap()),
            clock: Clock { speed: 30.0, is_looped: true, ..Clock::once(4.0) },
        },
        scale: Channel::rest(DVec3::ONE),
    };
    let body = [DVec3::new(-2.2, -0.9, 0.0), DVec3::new(2.2, 0.9, 1.5)];
    let tyre = [DVec3::new(-0.3, -0.1, -0.3), DVec3::new(0.3, 0.1, 0.3)];
    let driven = Link::Rigid(car);
    for (links, [low, high]) in [
        (vec![driven.clone()], body),
        (vec![Link::Rigid(Trajectory::Path(Arc::new(path)))], body),
        (vec![driven.clone(), wheel.clone()], tyre),
        (vec![wheel], tyre),
    ] {
        let motion = Motion { links };
        let (least, most) = motion.bounds(0.02, 0.12, low, high);
        let (mut inner_low, mut inner_high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for step in 0..=1000 {
            let map = motion.at(0.02 + 0.1 * f64::from(step) / 1000.0).unwrap();
            for corner in 0..8 {
                let side = |bit: i32| if (corner >> bit) & 1 == 0 { 0.0 } else { 1.0 };
                let at = map.transform_point3(unit_point(low, high, [side(0), side(1), side(2)]));
                (inner_low, inner_high) = (inner_low.min(at), inner_high.max(at));
            }
        }
        let size = (inner_high - inner_low).length();
        let slack = (inner_low - least).max(most - inner_high).max_element();
        // A fiftieth to each side is allowed before windows are halved.
        assert!(slack >= 0.0 && slack < 0.0201 * size, "{slack} of {size}");
    }
}

#[test]
fn motions_that_no_time_changes_are_one_map() {
    let map = DAffine3 { matrix3: DMat3::from_diagonal(DVec3::new(1.0, 2.0, 3.0)), translation: DVec3::X };
    let (low, high) = (DVec3::ZERO, DVec3::ONE);
    let still = Motion { links: vec![Link::Fixed(map), Link::Rigid(AT_ORIGIN.clone())] };
    assert_eq!(still.fixed(), Some(map));
    assert_eq!(Motion::default().fixed(), Some(DAffine3::IDENTITY));
    let (least, most) = still.bounds(0.0, 1e9, low, high);
    // For rounding, 32 ulps of 1 times at most 10 m are allowed at each of the two links.
    assert!(least.abs_diff_eq(DVec3::X, 2e-13) && most.abs_diff_eq(DVec3::new(2.0, 2.0, 3.0), 2e-13));
    let hidden = Motion { links: vec![Link::Fixed(map), Link::Visible(Channel::rest(false))] };
    assert_eq!((hidden.fixed(), hidden.at(0.0)), (None, None));
    let moving =
        Trajectory::Twist { start: Pose::IDENTITY, linear_m_s: DVec3::X, angular_rad_s: DVec3::ZERO };
    assert_eq!(Motion { links: vec![Link::Rigid(moving)] }.fixed(), None);
    // Numbers that overflow bound nothing.
    let huge = Motion { links: vec![Link::Fixed(DAffine3::from_scale(DVec3::splat(1e300))); 2] };
    assert_eq!(huge.bounds(0.0, 1.0, low, high), (DVec3::NEG_INFINITY, DVec3::INFINITY));
}

fn turning(linear: [f64; 3], angular: [f64; 3]) -> Trajectory {
    Trajectory::Twist { start: Pose::IDENTITY, linear_m_s: linear.into(), angular_rad_s: angular.into() }
}

/// Driving forward while turning left is a circle of radius v/ω.
#[test]
fn a_constant_turn_is_a_circle() {
    let (speed, rate) = (15.0, 0.5);
    let trajectory = turning([speed, 0.0, 0.0], [0.0, 0.0, rate]);
    for time in [-3.0, 0.0, 1e-6, 0.019, 0.021, 0.1, 2.0, 40.0] {
        let pose = trajectory.pose_at(time);
        let (sin, cos) = libm::sincos(rate * time);
        let expected = DVec3::new(speed / rate * sin, speed / rate * (1.0 - cos), 0.0);
        // 1 − cos loses digits here, by up to an ulp of 1, times the radius.
        assert!(pose.translation.abs_diff_eq(expected, 1e-13 * (1.0 + speed * time.abs())), "{time}");
        let yaw = Pose::from_rpy(DVec3::ZERO, Angle::default(), Angle::default(), Angle::rad(rate * time));
        assert!((pose.rotation - yaw.rotation).to_cols_array().iter().all(|e| e.abs() < 1e-15), "{time}");
        let velocity = trajectory.velocity(time);
        assert!(velocity.linear_m_s.abs_diff_eq(DVec3::new(cos, sin, 0.0) * speed, 1e-13));
        assert!(velocity.angular_rad_s.abs_diff_eq(DVec3::Z * rate, 1e-15));
        // It is v·ω towards the centre.
        let inwards = DVec3::new(-sin, cos, 0.0) * speed * rate;
        assert!(trajectory.acceleration(time).abs_diff_eq(inwards, 1e-13));
    }
}

/// Moving for a time and again for the same time is moving for twice the time, at small angles and large ones.
#[test]
fn motions_follow_each_other() {
    let trajectory = turning([3.0, -2.0, 0.5], [0.3, -0.2, 0.9]);
    for time in [1e-5, 5e-3, 0.0101, 0.3, 2.5] {
        let (once, twice) = (trajectory.pose_at(time), trajectory.pose_at(2.0 * time));
        let product = once * once;
        assert!(product.translation.abs_diff_eq(twice.translation, 1e-14 * (1.0 + time)), "{time}");
        let off = product.rotation - twice.rotation;
        assert!(off.to_cols_array().iter().all(|e| e.abs() < 1e-15 * (1.0 + time) * 4.0), "{time}");
    }
}

#[test]
fn a_body_without_rotation_goes_straight_and_a_fixed_one_stays() {
    let straight = turning([3.0, -2.0, 0.5], [0.0; 3]).pose_at(2.0);
    assert_eq!(straight, Pose { translation: DVec3::new(6.0, -4.0, 1.0), ..Pose::IDENTITY });
    let pose = Pose { translation: DVec3::new(1.0, 2.0, 3.0), ..Pose::IDENTITY };
    assert_eq!(Trajectory::Fixed(pose).pose_at(7.0), pose);
    assert_eq!(Trajectory::Fixed(pose).fixed_pose(), Some(pose));
    assert_eq!(turning([1.0, 0.0, 0.0], [0.0; 3]).fixed_pose(), None);
    assert_eq!(Trajectory::Fixed(pose).velocity(1.0), Velocity::default());
}
