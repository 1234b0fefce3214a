//! Places for things that stand in a scene: drawn uniformly over a surface, upright, where they meet nothing and are in nothing.
//!
//! ```text
//! surface    the part of a scene that things stand on, and points that are uniform over it
//! overlap    whether boxes meet each other, and triangles
//! obstacles  the triangles of a scene, by where they are
//! enclosure  whether a point is inside of something
//! ```
//!
//! A place is found by rejection: points of the surface and yaws are drawn until the thing's box meets nothing there. So of all
//! places where it meets nothing, each is as likely. An attempt takes four numbers of its stream, whatever comes of it, so that the
//! numbers of an attempt depend on the stream and the attempt alone.

mod enclosure;
mod obstacles;
mod overlap;
mod surface;

use glam::DVec3;

use crate::angle::Angle;
use crate::frame::Pose;
use crate::rng::Rng;
use crate::scene::Scene;
use crate::truth::OrientedBox;

pub use obstacles::Obstacles;
pub use overlap::{box_meets_triangle, boxes_meet};
pub use surface::{NoSurface, Surface};

/// The attempts at one place. If a thousandth of the surface is free, all of them fail with a probability of 0.37; if a hundredth
/// is, of 4e-5.
pub const ATTEMPTS: usize = 1000;

/// What is to stand somewhere. Its own frame has its origin where it stands, and z up.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Body {
    /// The lowest corner of its box, in its own frame, in metres.
    pub low: DVec3,
    /// The highest corner of its box, in its own frame, in metres.
    pub high: DVec3,
    /// The least distance that it keeps to the scene and to other boxes, in metres.
    pub clearance_m: f64,
    /// The height above its origin up to which it meets nothing, in metres: it stands on the surface, which may be uneven there.
    pub lift_m: f64,
}

/// A box that is there already.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Standing {
    /// The box, in the world.
    pub oriented: OrientedBox,
    /// The least distance that it keeps to other boxes, in metres.
    pub clearance_m: f64,
}

/// A place that was found: a pose that stands upright.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// The point of the surface, in the world, in metres.
    pub position_m: DVec3,
    /// The turn about the world's z axis, in degrees, because it is written down so: the same number gives the same pose.
    pub yaw_deg: f64,
}

/// Why all attempts at a place failed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Refused {
    /// The attempts at which the scene was met.
    pub scene: usize,
    /// The attempts at which only another box was met.
    pub others: usize,
    /// The attempts that met nothing, and were inside of something.
    pub inside: usize,
}

/// The lowest and the highest corner in the world, in metres, of all that is in snapshots of a scene. `None` if that is nothing.
pub fn extent(scenes: impl Iterator<Item = Scene>) -> Option<(DVec3, DVec3)> {
    let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    for scene in scenes {
        for (placement, triangles) in scene.triangles_of(|_| true) {
            for corner in triangles.flat_map(|triangle| scene.triangle_at(placement, triangle)) {
                (low, high) = (low.min(corner), high.max(corner));
            }
        }
    }
    (low.is_finite() && high.is_finite()).then_some((low, high))
}

impl Body {
    /// Its box where it stands.
    pub fn standing(&self, place: &Found) -> Standing {
        let oriented = oriented(self.low, self.high, place);
        Standing { oriented, clearance_m: self.clearance_m }
    }

    /// The box that must be free where it stands: its own, larger by a distance on all sides, and cut off below its lift.
    fn room(&self, place: &Found, clearance_m: f64) -> OrientedBox {
        let (low, high) = (self.low - clearance_m, self.high + clearance_m);
        let bottom = low.z.max(self.lift_m);
        oriented(low.with_z(bottom), high.with_z(high.z.max(bottom)), place)
    }
}

impl Found {
    /// The pose in the world of the frame of what stands here. A job that has these numbers as a pose has the same one.
    pub fn world_from_body(&self) -> Pose {
        let level = Angle::deg(0.0);
        Pose::from_rpy(self.position_m, level, level, Angle::deg(self.yaw_deg))
    }
}

fn oriented(low: DVec3, high: DVec3, place: &Found) -> OrientedBox {
    let world_from_body = place.world_from_body();
    let translation = world_from_body.point(low / 2.0 + high / 2.0);
    OrientedBox { world_from_box: Pose { translation, ..world_from_body }, size_m: high - low }
}

/// Finds a body a place on a surface where it meets no obstacle and no other box and is inside of nothing, with a yaw between two,
/// in degrees.
///
/// # Errors
/// With what was met, if that was so at all of [`ATTEMPTS`].
pub fn find(
    body: &Body,
    surface: &Surface,
    [least_deg, most_deg]: [f64; 2],
    obstacles: &Obstacles,
    others: &[Standing],
    rng: &mut Rng,
) -> Result<Found, Refused> {
    let mut refused = Refused::default();
    for _ in 0..ATTEMPTS {
        let position_m = surface.point([rng.unit(), rng.unit(), rng.unit()]);
        let yaw_deg = (least_deg + (most_deg - least_deg) * rng.unit()).clamp(least_deg, most_deg);
        let place = Found { position_m, yaw_deg };
        let is_met = |other: &Standing| {
            let room = body.room(&place, body.clearance_m.max(other.clearance_m));
            boxes_meet(&room, &other.oriented)
        };
        if obstacles.meet(&body.room(&place, body.clearance_m)) {
            refused.scene += 1;
        } else if others.iter().any(is_met) {
            refused.others += 1;
        } else if obstacles.enclose(body.room(&place, 0.0).world_from_box.translation) {
            refused.inside += 1;
        } else {
            return Ok(place);
        }
    }
    Err(refused)
}
