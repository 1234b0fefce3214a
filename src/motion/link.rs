//! Affine motion over time, as a product of links from the target's end to the source's, and the rigid motion of bodies.

use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3};

use super::path::{Deviation, Path};
use super::screw::{Screw, cross_matrix};
use super::track::Channel;
use crate::frame::Pose;

/// The pose `world_from_body` as a function of time, in seconds from the job's own zero.
#[derive(Clone, Debug, PartialEq)]
pub enum Trajectory {
    /// The body stands still.
    Fixed(Pose),
    /// The body moves with constant velocities, both given in its own frame: a screw motion from `start`.
    Twist {
        /// `world_from_body` at time 0.
        start: Pose,
        /// Linear velocity of the body's origin, in metres a second along the body's own axes.
        linear_m_s: DVec3,
        /// Angular velocity, in radians a second about the body's own axes.
        angular_rad_s: DVec3,
    },
    /// The body passes through given poses.
    Path(Arc<Path>),
    /// The body is an animated node. Its origin is where the motion takes the source's, and its axes are turned by the product of
    /// the links' rotations: scales do not change their length, and hiding the node does not change its pose.
    Chain(Arc<Motion>),
}

/// The trajectory of a body that stays at the world's origin.
pub static AT_ORIGIN: Trajectory = Trajectory::Fixed(Pose::IDENTITY);

/// The velocities of a body, in the axes of the frame that its pose leads to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Velocity {
    /// Of the body's origin, in metres a second.
    pub linear_m_s: DVec3,
    /// In radians a second.
    pub angular_rad_s: DVec3,
}

impl Trajectory {
    /// `world_from_body` at `time_s`. Outside [`Self::times`] it is the nearest pose that is known.
    pub fn pose_at(&self, time_s: f64) -> Pose {
        match self {
            Self::Fixed(pose) => *pose,
            Self::Twist { start, linear_m_s, angular_rad_s } => {
                *start * Screw { linear: *linear_m_s, angular: *angular_rad_s }.times(time_s).exp()
            }
            Self::Path(path) => path.at(time_s),
            Self::Chain(motion) => motion.rigid_at(time_s),
        }
    }

    /// The one pose of a body that stands still; `None` of a body that moves.
    pub fn fixed_pose(&self) -> Option<Pose> {
        match self {
            Self::Fixed(pose) => Some(*pose),
            Self::Twist { .. } => None,
            Self::Path(path) => path.poses().first().copied().filter(|_| path.poses().len() == 1),
            Self::Chain(motion) => motion.links.iter().all(Link::is_fixed).then(|| motion.rigid_at(0.0)),
        }
    }

    /// The first and the last time at which the pose is known. `None` if it is known at all times.
    pub fn times(&self) -> Option<(f64, f64)> {
        match self {
            Self::Path(path) => Some(path.span_s()),
            Self::Fixed(_) | Self::Twist { .. } | Self::Chain(_) => None,
        }
    }

    /// The velocities at `time_s`, by the derivative of the pose, in the world's axes. Where they change at once, they are those
    /// after the change.
    pub fn velocity(&self, time_s: f64) -> Velocity {
        let (linear_m_s, angular_rad_s) = match self {
            Self::Fixed(_) => (DVec3::ZERO, DVec3::ZERO),
            Self::Twist { linear_m_s, angular_rad_s, .. } => {
                let pose = self.pose_at(time_s);
                (pose.direction(*linear_m_s), pose.direction(*angular_rad_s))
            }
            Self::Path(path) => {
                let (linear, angular) = path.velocity(time_s);
                (linear, path.at(time_s).direction(angular))
            }
            Self::Chain(motion) => {
                let mut velocity = Velocity::default();
                let mut origin = DVec3::ZERO;
                for link in motion.links.iter().rev() {
                    let Rate { map, derivative, rotation, angular } = link.rate(time_s);
                    velocity = Velocity {
                        linear_m_s: map.transform_vector3(velocity.linear_m_s)
                            + derivative.transform_point3(origin),
                        angular_rad_s: rotation * velocity.angular_rad_s + angular,
                    };
                    origin = map.transform_point3(origin);
                }
                return velocity;
            }
        };
        Velocity { linear_m_s, angular_rad_s }
    }

    /// The acceleration of the body's origin at `time_s`, by the second derivative of the pose, in the world's axes and m/s². Where
    /// the velocity changes at once, as at a pose of a path, it is that after the change: the jump itself has none.
    pub fn acceleration(&self, time_s: f64) -> DVec3 {
        match self {
            Self::Fixed(_) => DVec3::ZERO,
            // The velocity along the body's own axes is constant, so its direction alone changes.
            Self::Twist { linear_m_s, angular_rad_s, .. } => {
                self.pose_at(time_s).direction(angular_rad_s.cross(*linear_m_s))
            }
            Self::Path(path) => path.acceleration(time_s),
            Self::Chain(motion) => motion.acceleration(time_s, DVec3::ZERO),
        }
    }

    /// How far a body that moves smoothly may get from this trajectory between its poses, as [`Path::deviation`] says. `None` if
    /// the motion is known at all times.
    pub fn interpolation_error_bound(&self) -> Option<Deviation> {
        match self {
            Self::Path(path) => path.deviation(),
            Self::Fixed(_) | Self::Twist { .. } | Self::Chain(_) => None,
        }
    }
}

/// The map `target_from_source` as a function of time, such as `world_from_mesh` of a mesh that moves.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Motion {
    /// The factors of the map, the target's end first.
    pub links: Vec<Link>,
}

/// A factor of a [`Motion`].
#[derive(Clone, Debug, PartialEq)]
pub enum Link {
    /// A map that no time changes.
    Fixed(DAffine3),
    /// A rigid motion.
    Rigid(Trajectory),
    /// A node: scaled along its own axes, then turned, then moved.
    Animated {
        /// The position in the parent's frame, in the file's metres.
        translation: Channel<DVec3>,
        /// The rotation.
        rotation: Channel<glam::DQuat>,
        /// The scale along each axis.
        scale: Channel<DVec3>,
    },
    /// The identity while the value is true; while it is false, the source is hidden.
    Visible(Channel<bool>),
}

/// A link's map at a time, and how it changes.
pub(super) struct Rate {
    map: DAffine3,
    /// The derivative of the map by time, a second.
    derivative: DAffine3,
    /// The rotation in the map.
    rotation: DMat3,
    /// The angular velocity of that rotation, in the target's axes, in radians a second.
    angular: DVec3,
}

impl Motion {
    /// The map at `time_s`. `None` at a time at which the source is hidden.
    pub fn at(&self, time_s: f64) -> Option<DAffine3> {
        self.links.iter().all(|link| link.shows_at(time_s)).then(|| self.map_at(time_s))
    }

    /// The map at `time_s`, whether the source is hidden or not.
    pub fn map_at(&self, time_s: f64) -> DAffine3 {
        self.links.iter().fold(DAffine3::IDENTITY, |map, link| map * link.map_at(time_s))
    }

    /// The one map of a motion whose links do not depend on time. `None` of others, and of a source that is always hidden.
    pub fn fixed(&self) -> Option<DAffine3> {
        if self.links.iter().all(Link::is_fixed) { self.at(0.0) } else { None }
    }

    /// Whether the source may be shown at some time of the closed span: each link on its own shows it at one.
    pub fn is_visible_in(&self, from_s: f64, to_s: f64) -> bool {
        self.links.iter().all(|link| match link {
            Link::Visible(channel) => channel.is_true_in(from_s, to_s),
            _ => true,
        })
    }

    /// The velocity, in the target's axes and metres a second, of what is at `point` of the source at `time_s`, by the derivative
    /// of the map. Where it changes at once, it is the velocity after the change; that a thing jumps from place to place is no
    /// velocity.
    pub fn velocity(&self, time_s: f64, point: DVec3) -> DVec3 {
        let (mut at, mut velocity) = (point, DVec3::ZERO);
        for link in self.links.iter().rev() {
            let rate = link.rate(time_s);
            velocity = rate.map.transform_vector3(velocity) + rate.derivative.transform_point3(at);
            at = rate.map.transform_point3(at);
        }
        velocity
    }

    /// The acceleration, in the target's axes and m/s², of what is at `point` of the source at `time_s`, by the second derivative of
    /// the map: of a product of maps, ẍ = M·ẍ' + 2·Ṁ·ẋ' + M̈·x' from link to link.
    pub(super) fn acceleration(&self, time_s: f64, point: DVec3) -> DVec3 {
        let (mut at, mut velocity, mut acceleration) = (point, DVec3::ZERO, DVec3::ZERO);
        for link in self.links.iter().rev() {
            let (rate, second) = (link.rate(time_s), link.second(time_s));
            acceleration = rate.map.transform_vector3(acceleration)
                + 2.0 * rate.derivative.transform_vector3(velocity)
                + second.transform_point3(at);
            velocity = rate.map.transform_vector3(velocity) + rate.derivative.transform_point3(at);
            at = rate.map.transform_point3(at);
        }
        acceleration
    }

    /// The angular acceleration of the rotations' product, in the target's axes: α = R·α' + ω × R·ω' + α of each link.
    fn angular_acceleration(&self, time_s: f64) -> DVec3 {
        let (mut velocity, mut acceleration) = (DVec3::ZERO, DVec3::ZERO);
        for link in self.links.iter().rev() {
            let Rate { rotation, angular, .. } = link.rate(time_s);
            let turned = rotation * velocity;
            acceleration =
                rotation * acceleration + angular.cross(turned) + link.angular_acceleration(time_s);
            velocity = turned + angular;
        }
        acceleration
    }

    /// The rigid part of the map: see [`Trajectory::Chain`].
    fn rigid_at(&self, time_s: f64) -> Pose {
        let rotation = self.links.iter().fold(DMat3::IDENTITY, |all, link| all * link.rotation_at(time_s));
        Pose { rotation, translation: self.map_at(time_s).translation }
    }
}

impl Link {
    /// Whether no time changes the link.
    pub fn is_fixed(&self) -> bool {
        match self {
            Self::Fixed(_) => true,
            Self::Rigid(trajectory) => trajectory.fixed_pose().is_some(),
            Self::Animated { translation, rotation, scale } => {
                translation.is_rest() && rotation.is_rest() && scale.is_rest()
            }
            Self::Visible(channel) => channel.is_rest(),
        }
    }

    fn shows_at(&self, time_s: f64) -> bool {
        match self {
            Self::Visible(channel) => *channel.held_at(time_s),
            _ => true,
        }
    }

    pub(super) fn map_at(&self, time_s: f64) -> DAffine3 {
        match self {
            Self::Fixed(map) => *map,
            Self::Rigid(trajectory) => affine(trajectory.pose_at(time_s)),
            Self::Animated { translation, rotation, scale } => DAffine3 {
                matrix3: DMat3::from_quat(rotation.at(time_s)) * DMat3::from_diagonal(scale.at(time_s)),
                translation: translation.at(time_s),
            },
            Self::Visible(_) => DAffine3::IDENTITY,
        }
    }

    /// The rotation in the map.
    fn rotation_at(&self, time_s: f64) -> DMat3 {
        match self {
            Self::Fixed(map) => rotation_of(map.matrix3),
            Self::Rigid(trajectory) => trajectory.pose_at(time_s).rotation,
            Self::Animated { rotation, .. } => DMat3::from_quat(rotation.at(time_s)),
            Self::Visible(_) => DMat3::IDENTITY,
        }
    }

    /// The angular acceleration of the rotation in the map, in the target's axes.
    fn angular_acceleration(&self, time_s: f64) -> DVec3 {
        match self {
            // Along a screw, and with slerp, a body turns about an axis that stands.
            Self::Rigid(Trajectory::Fixed(_) | Trajectory::Twist { .. } | Trajectory::Path(_)) => DVec3::ZERO,
            Self::Rigid(Trajectory::Chain(motion)) => motion.angular_acceleration(time_s),
            // ω = 2·q̇·q*, and q̇·q̇* has no vector.
            Self::Animated { rotation, .. } => {
                2.0 * (rotation.second(time_s) * rotation.at(time_s).conjugate()).xyz()
            }
            Self::Fixed(_) | Self::Visible(_) => DVec3::ZERO,
        }
    }

    /// The second derivative of the map by time.
    fn second(&self, time_s: f64) -> DAffine3 {
        // R̈ = ([α] + [ω]²)·R
        let bent = |angular: DVec3| {
            let cross = cross_matrix(angular);
            cross_matrix(self.angular_acceleration(time_s)) + cross * cross
        };
        match self {
            Self::Rigid(trajectory) => DAffine3 {
                matrix3: bent(trajectory.velocity(time_s).angular_rad_s)
                    * trajectory.pose_at(time_s).rotation,
                translation: trajectory.acceleration(time_s),
            },
            Self::Animated { translation, scale, .. } => {
                let Rate { rotation: turned, angular, .. } = self.rate(time_s);
                let (size, grown) = scale.at_with_rate(time_s);
                let matrix3 = bent(angular) * turned * DMat3::from_diagonal(size)
                    + 2.0 * (cross_matrix(angular) * turned * DMat3::from_diagonal(grown))
                    + turned * DMat3::from_diagonal(scale.second(time_s));
                DAffine3 { matrix3, translation: translation.second(time_s) }
            }
            Self::Fixed(_) | Self::Visible(_) => DAffine3 { matrix3: DMat3::ZERO, translation: DVec3::ZERO },
        }
    }

    fn rate(&self, time_s: f64) -> Rate {
        let still = DAffine3 { matrix3: DMat3::ZERO, translation: DVec3::ZERO };
        match self {
            Self::Rigid(trajectory) => {
                let (pose, velocity) = (trajectory.pose_at(time_s), trajectory.velocity(time_s));
                let matrix3 = cross_matrix(velocity.angular_rad_s) * pose.rotation;
                Rate {
                    map: affine(pose),
                    derivative: DAffine3 { matrix3, translation: velocity.linear_m_s },
                    rotation: pose.rotation,
                    angular: velocity.angular_rad_s,
                }
            }
            Self::Animated { translation, rotation, scale } => {
                let (translation, moved) = translation.at_with_rate(time_s);
                let (rotation, turned) = rotation.at_with_rate(time_s);
                let (scale, grown) = scale.at_with_rate(time_s);
                // q̇ = ω·q/2 with ω in the parent's axes.
                let angular = 2.0 * (turned * rotation.conjugate()).xyz();
                let rotation = DMat3::from_quat(rotation);
                let scaled = rotation * DMat3::from_diagonal(scale);
                let matrix3 = cross_matrix(angular) * scaled + rotation * DMat3::from_diagonal(grown);
                Rate {
                    map: DAffine3 { matrix3: scaled, translation },
                    derivative: DAffine3 { matrix3, translation: moved },
                    rotation,
                    angular,
                }
            }
            Self::Fixed(_) | Self::Visible(_) => Rate {
                map: self.map_at(time_s),
                derivative: still,
                rotation: self.rotation_at(time_s),
                angular: DVec3::ZERO,
            },
        }
    }
}

fn affine(pose: Pose) -> DAffine3 {
    DAffine3 { matrix3: pose.rotation, translation: pose.translation }
}

/// The rotation of a matrix's axes: the x axis keeps its direction and the y axis its plane with it (Gram and Schmidt). A matrix
/// that mirrors loses the direction of its z axis. One without volume turns nothing.
fn rotation_of(matrix: DMat3) -> DMat3 {
    let Some(x) = matrix.x_axis.try_normalize() else { return DMat3::IDENTITY };
    let Some(y) = (matrix.y_axis - x * x.dot(matrix.y_axis)).try_normalize() else { return DMat3::IDENTITY };
    DMat3::from_cols(x, y, x.cross(y))
}
