//! The tables of a run: where sensors were at each frame, and the boxes of objects.

use std::collections::BTreeMap;

use glam::{DMat3, DQuat, DVec3};
use serde::Deserialize;

use super::error::ReadError;
use super::frame_key::FrameKey;
use crate::frame::Pose;

/// A row of `poses.csv`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseRow {
    /// The time at which the frame starts, in seconds.
    pub start_s: f64,
    /// The sensor's pose at that time.
    pub world_from_sensor: Pose,
    /// The body's pose at that time.
    pub world_from_body: Pose,
}

/// A line of `boxes.jsonl`, as far as it is used.
#[derive(Clone, Debug, PartialEq)]
pub struct BoxRow {
    /// The object's name.
    pub name: String,
    /// The object's label.
    pub label: u32,
    /// The pose of the box: its centre, and its length along x, its width along y and its height along z.
    pub world_from_box: Pose,
    /// Length, width and height in metres.
    pub size_m: DVec3,
}

/// The columns of `poses.csv` that are read, in this order.
const COLUMNS: [&str; 17] = [
    "frame", "sensor", "t_s", "x_m", "y_m", "z_m", "qx", "qy", "qz", "qw", "body_x_m", "body_y_m",
    "body_z_m", "body_qx", "body_qy", "body_qz", "body_qw",
];

/// Reads a run's `poses.csv`.
///
/// # Errors
/// A [`ReadError`] about the line that is no row of such a table.
pub fn read_poses(text: &str) -> Result<BTreeMap<FrameKey, PoseRow>, ReadError> {
    let mut lines = (1..).zip(text.lines());
    let header: Vec<&str> = lines.next().map_or("", |(_, line)| line).split(',').map(str::trim).collect();
    let places = COLUMNS.map(|name| header.iter().position(|column| *column == name));
    if let Some(missing) =
        COLUMNS.iter().zip(places).find_map(|(name, place)| place.is_none().then_some(name))
    {
        return Err(ReadError::new(format!("is no table of poses: its first line has no column {missing}")));
    }
    let mut poses = BTreeMap::new();
    for (number, line) in lines.filter(|(_, line)| !line.trim().is_empty()) {
        let fields: Vec<&str> = line.split(',').map(str::trim).collect();
        let at = |column: usize| places[column].and_then(|place| fields.get(place).copied());
        let value = |column: usize| at(column)?.parse::<f64>().ok();
        let row = || {
            let (frame, sensor) = (at(0)?.parse().ok()?, at(1)?);
            let world_from_sensor =
                pose([value(3)?, value(4)?, value(5)?], [value(6)?, value(7)?, value(8)?, value(9)?])?;
            let world_from_body =
                pose([value(10)?, value(11)?, value(12)?], [value(13)?, value(14)?, value(15)?, value(16)?])?;
            let start_s = value(2).filter(|time| time.is_finite())?;
            Some((FrameKey::new(sensor, frame), PoseRow { start_s, world_from_sensor, world_from_body }))
        };
        let (key, row) =
            row().ok_or_else(|| ReadError::new(format!("line {number} is no row of a table of poses")))?;
        poses.insert(key, row);
    }
    Ok(poses)
}

/// Reads the lines of a run's `boxes.jsonl` that are about wanted frames, by frame.
///
/// # Errors
/// A [`ReadError`] about the line that is no box.
pub fn read_boxes(
    text: &str,
    is_wanted: &dyn Fn(&FrameKey) -> bool,
) -> Result<BTreeMap<FrameKey, Vec<BoxRow>>, ReadError> {
    #[derive(Deserialize)]
    struct Head {
        frame: u64,
        sensor: String,
    }
    #[derive(Deserialize)]
    struct Line {
        #[serde(default)]
        name: String,
        #[serde(default)]
        label: u32,
        length_m: f64,
        width_m: f64,
        height_m: f64,
        in_world: Place,
    }
    #[derive(Deserialize)]
    struct Place {
        centre_m: [f64; 3],
        quaternion_xyzw: [f64; 4],
    }
    let mut boxes: BTreeMap<FrameKey, Vec<BoxRow>> = BTreeMap::new();
    for (number, line) in (1..).zip(text.lines()).filter(|(_, line)| !line.trim().is_empty()) {
        let wrong = |why: &dyn std::fmt::Display| ReadError::new(format!("line {number} is no box: {why}"));
        let Head { frame, sensor } = serde_json::from_str(line).map_err(|e| wrong(&e))?;
        let key = FrameKey::new(&sensor, frame);
        if !is_wanted(&key) {
            continue;
        }
        let Line { name, label, length_m, width_m, height_m, in_world } =
            serde_json::from_str(line).map_err(|e| wrong(&e))?;
        let world_from_box = pose(in_world.centre_m, in_world.quaternion_xyzw)
            .ok_or_else(|| wrong(&"its quaternion is no rotation"))?;
        let size_m = DVec3::new(length_m, width_m, height_m);
        boxes.entry(key).or_default().push(BoxRow { name, label, world_from_box, size_m });
    }
    Ok(boxes)
}

/// A pose of a translation and a quaternion; `None` if the quaternion is no rotation.
fn pose(translation: [f64; 3], quaternion_xyzw: [f64; 4]) -> Option<Pose> {
    let quaternion = DQuat::from_array(quaternion_xyzw);
    // Seven digits of each number are as few as anybody writes.
    let is_rotation =
        (quaternion.length_squared() - 1.0).abs() < 1e-6 && translation.iter().all(|v| v.is_finite());
    is_rotation.then(|| Pose {
        rotation: DMat3::from_quat(quaternion.normalize()),
        translation: DVec3::from_array(translation),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str =
        "frame,sensor,t_s,x_m,y_m,z_m,qx,qy,qz,qw,body_x_m,body_y_m,body_z_m,body_qx,body_qy,body_qz,body_qw";

    #[test]
    fn poses_come_back_and_mistakes_have_their_line() {
        let row = "3,top,1.5,1,2,3,0,0,1,0,4,5,6,0,0,0,1";
        let poses = read_poses(&format!("{HEADER}\n{row}\n")).unwrap();
        let found = poses[&FrameKey::new("top", 3)];
        assert_eq!((found.start_s, found.world_from_body.translation), (1.5, DVec3::new(4.0, 5.0, 6.0)));
        // Half a turn about z.
        assert!(found.world_from_sensor.direction(DVec3::X).abs_diff_eq(-DVec3::X, 1e-15));
        let problem = |text: &str| read_poses(text).unwrap_err().to_string();
        assert!(problem("frame,sensor").contains("no column t_s"));
        for wrong in [
            "3,top",
            "x,top,1.5,1,2,3,0,0,1,0,4,5,6,0,0,0,1",
            "3,top,1.5,1,2,3,0,0,0,0,4,5,6,0,0,0,1",
            "3,top,nan,1,2,3,0,0,1,0,4,5,6,0,0,0,1",
        ] {
            assert!(problem(&format!("{HEADER}\n{row}\n{wrong}")).starts_with("line 3 "), "{wrong}");
        }
    }

    #[test]
    fn boxes_of_wanted_frames_are_read() {
        let line = |frame: u64| {
            format!(
                "{{\"frame\":{frame},\"sensor\":\"top\",\"name\":\"car\",\"label\":4,\"length_m\":4,\"width_m\":2,\"height_m\":1.5,\
                 \"in_world\":{{\"centre_m\":[1,2,3],\"quaternion_xyzw\":[0,0,0,1],\"yaw_deg\":0}},\"points\":9}}"
            )
        };
        let text = [line(0), line(1), line(1)].join("\n");
        let boxes = read_boxes(&text, &|key| key.frame() == Some(1)).unwrap();
        assert_eq!((boxes.len(), boxes[&FrameKey::new("top", 1)].len()), (1, 2));
        let found = &boxes[&FrameKey::new("top", 1)][0];
        assert_eq!((found.name.as_str(), found.label, found.size_m), ("car", 4, DVec3::new(4.0, 2.0, 1.5)));
        let problem = read_boxes("{\"frame\":0,\"sensor\":\"top\"}\n[", &|_| true).unwrap_err().to_string();
        assert!(problem.starts_with("line 1 is no box: missing field"), "{problem}");
    }
}
