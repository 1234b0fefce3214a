//! Tables of poses → [`Pose`]s.

use glam::{DMat3, DVec3};

use super::super::keys::pose::{
    CAMERA, CONVENTION, Convention, LOOK_AT, MATRIX, POSITION, QUATERNION, RPY, UPWARD,
};
use super::super::kinds::Nested;
use super::super::plausibility;
use super::super::table::{AnyKey, Key, Table};
use crate::angle::Angle;
use crate::frame::{BODY_FROM_OPTICAL, Pose};
use crate::source::words::{joined, list, number};
use crate::source::{Doubt, Report, Spanned};

/// What a table says about a place.
#[derive(Clone, Debug)]
pub(super) enum Placed {
    /// The pose, or the identity if there is something wrong with it, which was reported.
    At(Pose),
    /// The pose of the scene's camera of this name.
    AsCamera(Spanned<String>),
}

/// The pose that a key of a table has; the identity if it is left out.
pub(super) fn placed(t: &Table<'_>, key: &Key<Nested>) -> Placed {
    let Some(t) = t.read(key).map(|pose| pose.value) else { return Placed::At(Pose::IDENTITY) };
    let others: [&dyn AnyKey; 7] = [&POSITION, &RPY, &QUATERNION, &LOOK_AT, &UPWARD, &MATRIX, &CONVENTION];
    let camera = t.read(&CAMERA);
    let pose = pose(&t);
    match (camera, others.into_iter().find(|key| t.has(*key))) {
        (Some(camera), None) => {
            Placed::AsCamera(Spanned { value: camera.value.to_owned(), span: camera.span })
        }
        (Some(camera), Some(other)) => {
            let message =
                format!("the scene's camera has a pose of its own, and this has `{}`, too", other.name());
            t.report().error(t.report().later(camera.span, t.span_of(other)), message, "one too many", None);
            Placed::At(Pose::IDENTITY)
        }
        (None, _) => Placed::At(pose),
    }
}

/// The pose of a table; the identity if there is something wrong with it.
pub(super) fn pose(t: &Table<'_>) -> Pose {
    let report = t.report();
    let convention = t.read(&CONVENTION);
    let convention_at = convention.as_ref().map_or(t.span, |c| c.span);
    let convention = convention.map_or(Convention::Body, |convention| convention.value);
    let translation = DVec3::from_array(t.value(&POSITION));
    let quaternion = t.read(&QUATERNION);
    let angles = t.value(&RPY);
    let look_at = t.read(&LOOK_AT);
    let up = DVec3::from_array(t.value(&UPWARD));
    let matrix = t.read(&MATRIX);

    let rotations: [&dyn AnyKey; 4] = [&RPY, &QUATERNION, &LOOK_AT, &MATRIX];
    let given: Vec<_> = rotations.into_iter().filter(|key| t.has(*key)).collect();
    if let [first, second, ..] = given[..] {
        let both = if given.len() == 2 { "both " } else { "" };
        let names = list(given.iter().map(|key| key.name()), "and");
        let message = format!("a pose has one rotation, and this has {both}{names}");
        let span = report.later(t.span_of(second), t.span_of(first));
        report.error(span, message, "one too many", None);
        return Pose::IDENTITY;
    }
    if t.has(&MATRIX) && t.has(&POSITION) {
        let message = "a matrix has a position, and this has `position_m`, too";
        report.error(report.later(t.span_of(&MATRIX), t.span_of(&POSITION)), message, "one too many", None);
        return Pose::IDENTITY;
    }
    if t.has(&UPWARD) && !t.has(&LOOK_AT) {
        let help = Some("with `look_at_m`, `up` says which way is above".to_owned());
        report.error(
            t.span_of(&UPWARD),
            "this pose has `up`, and nothing to look at",
            "needs `look_at_m`",
            help,
        );
    }
    if t.has(&LOOK_AT) && convention != Convention::Body {
        let message =
            "`look_at_m` points the body's own x axis at the target, and a convention has other axes";
        report.error(convention_at, message, "leave this out", None);
    }
    if t.has(&RPY)
        && let Some(doubt) = plausibility::rpy(RPY.name(), angles)
    {
        report.doubt(t.span_of(&RPY), doubt);
    }
    // Other axes than a body's do not stand upright.
    if let Some(q) = quaternion
        && convention == Convention::Body
        && let Some(doubt) = plausibility::quaternion(QUATERNION.name(), q.value)
    {
        report.doubt(q.span, doubt);
    }
    let [roll, pitch, yaw] = angles.map(Angle::deg);
    let as_given = match (quaternion, look_at, matrix) {
        (Some(q), ..) => quaternion_pose(report, translation, q),
        (_, Some(target), _) => looking_at(report, translation, target, up),
        (.., Some(matrix)) => rigid(matrix.value).map_err(|wrong| wrong.report(report, matrix.span)).ok(),
        _ => Some(Pose::from_rpy(translation, roll, pitch, yaw)),
    };
    as_given.map_or(Pose::IDENTITY, |pose| convention.into_body(pose))
}

/// The pose of a camera's frame with OpenGL's axes (x right, y up, z backwards) in its body frame.
const BODY_FROM_OPENGL: Pose =
    Pose { rotation: DMat3::from_cols(DVec3::NEG_Y, DVec3::Z, DVec3::NEG_X), translation: DVec3::ZERO };

impl Convention {
    /// The pose `target_from_body` of a pose that is given in this convention.
    fn into_body(self, given: Pose) -> Pose {
        match self {
            Self::Body => given,
            Self::OpenCv => given.inverse() * BODY_FROM_OPTICAL.inverse(),
            Self::OpenGl => given * BODY_FROM_OPENGL.inverse(),
        }
    }
}

fn quaternion_pose(report: &Report, translation: DVec3, q: Spanned<[f64; 4]>) -> Option<Pose> {
    let made = Pose::from_quaternion(translation, q.value);
    let length = q.value.iter().map(|x| x * x).sum::<f64>().sqrt();
    if made.is_none() {
        let message = format!("a quaternion of length {length} is no rotation");
        let help = "`[0.0, 0.0, 0.0, 1.0]` turns by nothing";
        report.error(q.span, message, "expected x, y, z, w of length 1", Some(help.into()));
    } else if (length - 1.0).abs() > 1e-3 {
        let message = format!("a quaternion of length {length:.6}, which is normalised");
        let doubt = Doubt::new("quaternion-length", QUATERNION.name(), message);
        report.doubt(q.span, doubt.label("expected x, y, z, w of length 1"));
    }
    made
}

/// The pose at `position` whose x axis points at a target, and whose z axis is as near `up` as that allows.
fn looking_at(report: &Report, position: DVec3, target: Spanned<[f64; 3]>, up: DVec3) -> Option<Pose> {
    let Some(forward) = (DVec3::from_array(target.value) - position).try_normalize() else {
        let message = "the target is where the pose is";
        return report.fail(target.span, message, "expected another point than `position_m`", None);
    };
    // A direction that is up to a millionth has lost six digits.
    let left = up.try_normalize().map(|up| up.cross(forward)).filter(|left| left.length() > 1e-6);
    let Some(left) = left.and_then(DVec3::try_normalize) else {
        let help = "`up = [1.0, 0.0, 0.0]` has the image's upper side look along x";
        let message = "the target is straight above or below, along `up`";
        return report.fail(target.span, message, "expected another `up`", Some(help.to_owned()));
    };
    let rotation = DMat3::from_cols(forward, left, forward.cross(left));
    Some(Pose { rotation, translation: position })
}

/// Why a matrix is no pose.
pub(super) struct NotRigid {
    message: String,
    label: &'static str,
    help: Option<String>,
}

impl NotRigid {
    pub fn report(self, report: &Report, span: crate::source::Span) {
        report.error(span, self.message, self.label, self.help);
    }
}

/// How far the axes of a matrix may be from unit vectors at right angles: files have as few as four digits.
const RIGID_TO: f64 = 1e-3;

/// The pose of a rigid matrix, whose rotation is made exact.
pub(super) fn rigid(rows: [[f64; 4]; 4]) -> Result<Pose, NotRigid> {
    let [a, b, c, last] = rows;
    let axis = |i: usize| DVec3::new(a[i], b[i], c[i]);
    let (axes, translation) = ([axis(0), axis(1), axis(2)], axis(3));
    if last != [0.0, 0.0, 0.0, 1.0] {
        let is_transposed = translation == DVec3::ZERO && last[3] == 1.0;
        let help = is_transposed.then_some(
            "this looks like the transpose: write it row by row, with the position in the last column",
        );
        let message = format!("the last row is {last:?}");
        return Err(NotRigid {
            message,
            label: "expected [0.0, 0.0, 0.0, 1.0]",
            help: help.map(str::to_owned),
        });
    }
    let lengths = axes.map(DVec3::length);
    let units = [0, 1, 2].map(|i| axes[i] / lengths[i]);
    let [x, y, z] = units;
    let slants = [x.dot(y), y.dot(z), z.dot(x)];
    let wrong = |message: String, help: Option<String>| {
        Err(NotRigid { message, label: "expected a rotation and a position", help })
    };
    let [least, most] =
        [lengths.into_iter().fold(f64::INFINITY, f64::min), lengths.into_iter().fold(0.0, f64::max)];
    if !(least > 0.0 && most.is_finite()) {
        return wrong("an axis of this matrix has no length".to_owned(), None);
    }
    if slants.iter().any(|slant| slant.abs() > RIGID_TO) {
        return wrong("the axes of this matrix are not at right angles".to_owned(), None);
    }
    if x.dot(y.cross(z)) < 0.0 {
        let help = "one of its axes points the other way in a right-handed frame";
        return wrong("this matrix mirrors: its determinant is negative".to_owned(), Some(help.to_owned()));
    }
    if most - least > RIGID_TO * most {
        let lengths = joined(&lengths.map(number), "and");
        return wrong(format!("this matrix stretches its axes by {lengths}"), None);
    }
    if (most - 1.0).abs() > RIGID_TO {
        let help = format!("divide the first three columns by {}; the position is in metres", number(most));
        return wrong(format!("this matrix scales by {}", number(most)), Some(help));
    }
    let q = glam::DQuat::from_mat3(&DMat3::from_cols(x, y, z)).normalize();
    Ok(Pose { rotation: DMat3::from_quat(q), translation })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(pose: Pose, scale: [f64; 3]) -> [[f64; 4]; 4] {
        let [x, y, z] = [
            pose.rotation.x_axis * scale[0],
            pose.rotation.y_axis * scale[1],
            pose.rotation.z_axis * scale[2],
        ];
        let t = pose.translation;
        [[x.x, y.x, z.x, t.x], [x.y, y.y, z.y, t.y], [x.z, y.z, z.z, t.z], [0.0, 0.0, 0.0, 1.0]]
    }

    fn some_pose() -> Pose {
        Pose::from_rpy(DVec3::new(1.0, -2.0, 3.0), Angle::deg(10.0), Angle::deg(-20.0), Angle::deg(130.0))
    }

    fn is_near(a: Pose, b: Pose) -> bool {
        a.translation.abs_diff_eq(b.translation, 1e-14)
            && (a.rotation - b.rotation).to_cols_array().iter().all(|e| e.abs() < 1e-15)
    }

    #[test]
    fn matrices_are_poses_or_say_what_they_do() {
        let pose = some_pose();
        assert!(rigid(rows(pose, [1.0; 3])).is_ok_and(|made| is_near(made, pose)));
        // Four digits are enough.
        let rounded = rows(pose, [1.0; 3]).map(|row| row.map(|x| (x * 1e4).round() / 1e4));
        assert!(rigid(rounded).is_ok());
        let problem = |rows| rigid(rows).err().map_or(String::new(), |wrong| wrong.message);
        assert_eq!(problem(rows(pose, [100.0; 3])), "this matrix scales by 100");
        assert!(problem(rows(pose, [1.0, -1.0, 1.0])).starts_with("this matrix mirrors"));
        assert!(problem(rows(pose, [1.0, 2.0, 1.0])).starts_with("this matrix stretches"));
        assert!(problem(rows(pose, [1.0, 0.0, 1.0])).ends_with("no length"));
        let mut slanted = rows(pose, [1.0; 3]);
        slanted[0][0] += 0.1;
        assert!(problem(slanted).ends_with("right angles"));
        let transposed = [0, 1, 2, 3].map(|i| rows(pose, [1.0; 3]).map(|row| row[i]));
        assert!(
            rigid(transposed).is_err_and(|wrong| wrong.help.is_some_and(|help| help.contains("transpose")))
        );
    }

    /// A camera that looks along the world's x has its optical axes where both conventions say.
    #[test]
    fn conventions_have_their_axes() {
        let pose = some_pose();
        // What a renderer says of the same camera.
        let camera_from_world = (pose * BODY_FROM_OPTICAL).inverse();
        assert!(is_near(Convention::OpenCv.into_body(camera_from_world), pose));
        let world_from_camera = pose * BODY_FROM_OPENGL;
        assert!(is_near(Convention::OpenGl.into_body(world_from_camera), pose));
        // OpenGL's camera looks along −z with y up.
        assert_eq!(BODY_FROM_OPENGL.direction(DVec3::NEG_Z), DVec3::X);
        assert_eq!(BODY_FROM_OPENGL.direction(DVec3::Y), DVec3::Z);
        assert_eq!(BODY_FROM_OPENGL.rotation.determinant(), 1.0);
    }

    #[test]
    fn a_pose_looks_at_its_target() {
        let mut report = Report::default();
        let source = report.add("job.toml", "look".to_owned(), crate::source::Layer::Main);
        let span = crate::source::Span::new(source, 0..4);
        let look = |position: DVec3, target: [f64; 3], up: DVec3| {
            looking_at(&report, position, Spanned { value: target, span }, up)
        };
        let pose = look(DVec3::new(1.0, 2.0, 3.0), [1.0, 12.0, 3.0], DVec3::Z).unwrap();
        assert!(pose.direction(DVec3::X).abs_diff_eq(DVec3::Y, 1e-15));
        assert!(pose.direction(DVec3::Z).abs_diff_eq(DVec3::Z, 1e-15));
        let down = look(DVec3::ZERO, [3.0, 0.0, -4.0], DVec3::Z).unwrap();
        assert!(down.direction(DVec3::Z).abs_diff_eq(DVec3::new(0.8, 0.0, 0.6), 1e-15));
        assert!(look(DVec3::ZERO, [0.0, 0.0, -4.0], DVec3::Z).is_none());
        assert!(look(DVec3::ZERO, [0.0, 0.0, -4.0], DVec3::X).is_some());
        assert!(look(DVec3::ONE, [1.0; 3], DVec3::Z).is_none());
        assert_eq!(report.into_diagnostics().len(), 2);
    }
}
