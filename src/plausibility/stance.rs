//! Where a sensor stands and looks, in words.

use glam::DVec3;
use serde::Serialize;

use crate::config::Job;
use crate::frame::Pose;

/// Where a sensor stands at the start of its first frame, and where it looks.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Stance {
    /// The sensor's position in the world, in metres.
    pub position_m: [f64; 3],
    /// The direction of its x axis in words: `along +x, level`.
    pub looks: String,
}

impl Stance {
    /// The stance of sensor number `index` of a job.
    pub fn of(job: &Job, index: usize) -> Self {
        let pose = job.trajectory.pose_at(0.0) * job.sensors[index].body_from_sensor;
        Self { position_m: pose.translation.to_array(), looks: looks(&pose) }
    }
}

/// Directions that differ by less are told as the same, in degrees.
const NEAR_DEG: f64 = 0.5;

/// Where a sensor with this pose looks, in words that follow `looks`.
pub(super) fn looks(world_from_sensor: &Pose) -> String {
    let forward = world_from_sensor.direction(DVec3::X);
    let (azimuth, elevation) =
        (degrees(forward.y, forward.x), degrees(forward.z, forward.truncate().length()));
    let tidy = |angle: f64| (angle * 10.0).round() / 10.0;
    let mut words = if elevation > 90.0 - NEAR_DEG {
        "straight up".to_owned()
    } else if elevation < NEAR_DEG - 90.0 {
        "straight down".to_owned()
    } else {
        let axes = [(0.0, "+x"), (90.0, "+y"), (180.0, "-x"), (-180.0, "-x"), (-90.0, "-y")];
        let axis = axes.iter().find(|(angle, _)| (azimuth - angle).abs() < NEAR_DEG);
        let heading = axis
            .map_or_else(|| format!("at azimuth {}°", tidy(azimuth)), |(_, axis)| format!("along {axis}"));
        let tilt = match elevation {
            level if level.abs() < NEAR_DEG => "level".to_owned(),
            up if up > 0.0 => format!("{}° up", tidy(up)),
            down => format!("{}° down", tidy(-down)),
        };
        format!("{heading}, {tilt}")
    };
    // The roll is how far the sensor's left is from level. Straight up and down there is none.
    if elevation.abs() < 90.0 - NEAR_DEG {
        let (left, up) = (world_from_sensor.direction(DVec3::Y), world_from_sensor.direction(DVec3::Z));
        let roll = degrees(left.z, up.z);
        if roll.abs() > 180.0 - NEAR_DEG {
            words += ", upside down";
        } else if roll.abs() > NEAR_DEG {
            words += &format!(", rolled by {}°", tidy(roll));
        }
    }
    words
}

fn degrees(y: f64, x: f64) -> f64 {
    libm::atan2(y, x).to_degrees()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::angle::Angle;

    #[test]
    fn directions_in_words() {
        let said = |rpy: [f64; 3]| {
            let [roll, pitch, yaw] = rpy.map(Angle::deg);
            looks(&Pose::from_rpy(DVec3::ZERO, roll, pitch, yaw))
        };
        assert_eq!(said([0.0, 0.0, 0.0]), "along +x, level");
        assert_eq!(said([0.0, 10.0, 90.0]), "along +y, 10° down");
        assert_eq!(said([0.0, -22.5, 180.0]), "along -x, 22.5° up");
        assert_eq!(said([0.0, 0.0, 30.0]), "at azimuth 30°, level");
        assert_eq!(said([0.0, 90.0, 0.0]), "straight down");
        assert_eq!(said([180.0, 0.0, 0.0]), "along +x, level, upside down");
        assert_eq!(said([90.0, 0.0, -90.0]), "along -y, level, rolled by 90°");
    }
}
