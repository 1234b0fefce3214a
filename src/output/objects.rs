//! What is true of the objects in a frame, as lines of JSON: their boxes, and which of them are seen.

use std::collections::BTreeMap;

use glam::{DMat3, DVec3};
use serde_json::{Value, json};

use super::id::id_of;
use super::sensor_frame::SensorFrame;
use crate::frame::Pose;
use crate::scan::Frame;
use crate::truth::{Bounds, BoxTruth};

/// The table of a run that has the boxes of objects: its name in the output folder.
pub const BOXES: &str = "boxes.jsonl";

/// The table of a run that lists what each frame sees: its name in the output folder.
pub const VISIBLE: &str = "visible.jsonl";

/// The line of a box in the table [`BOXES`]. `masks` adds the pixels of a camera's image.
pub fn box_row(frame: &SensorFrame, truth: &BoxTruth, masks: bool) -> String {
    let BoxTruth { target, oriented, velocity, .. } = truth;
    let [length_m, width_m, height_m] = numbers(oriented.size_m);
    let sensor_from_box = truth.world_from_sensor.inverse() * oriented.world_from_box;
    let mut row = json!({
        "frame": frame.capture.frame,
        "sensor": frame.name,
        "track": target.track,
        "name": target.name,
        "label": target.label,
        "t_s": truth.time_s + 0.0,
        "length_m": length_m,
        "width_m": width_m,
        "height_m": height_m,
        "in_world": place(&oriented.world_from_box),
        "in_sensor": place(&sensor_from_box),
        "velocity_m_s": numbers(velocity.linear_m_s),
        "angular_velocity_rad_s": numbers(velocity.angular_rad_s),
        "points": truth.points,
        "pixels": truth.pixels,
        "pixels_alone": truth.pixels_alone,
        "occlusion": truth.occlusion(),
        "truncation": truth.truncation,
    });
    if let (Some(shown), Some(keys)) = (&truth.shown, row.as_object_mut()) {
        keys.insert("bounds_px".into(), bounds(shown.bounds_px));
        keys.insert("projected_px".into(), bounds(truth.projected_px));
        if masks {
            let size = [frame.frame.rows(), frame.frame.columns()];
            keys.insert("mask".into(), json!({ "size": size, "counts": shown.runs }));
        }
    }
    row.to_string()
}

/// The line of a frame in the table [`VISIBLE`]: the objects that gave it returns, by their ids, each with its number of them.
pub fn visible_row(frame: &SensorFrame) -> String {
    let object = |(index, points): (u32, u64)| {
        let known = frame.names.objects.get(index as usize);
        json!({ "id": id_of(index), "name": known.map_or("", |object| object.name.as_str()), "points": points })
    };
    let objects: Vec<Value> = points_by_object(frame.frame).into_iter().map(object).collect();
    let row = json!({
        "frame": frame.capture.frame,
        "sensor": frame.name,
        "t_s": frame.capture.cast_at_s(0.0) + 0.0,
        "objects": objects,
    });
    row.to_string()
}

fn points_by_object(frame: &Frame) -> BTreeMap<u32, u64> {
    let mut points = BTreeMap::new();
    for slot in (0..frame.pixels()).flat_map(|pixel| frame.slots(pixel)) {
        *points.entry(frame.returns().instance[slot]).or_default() += 1;
    }
    points
}

/// The centre of a box and its turn. The yaw is that of the box's length about the frame's z axis, from x toward y.
fn place(pose: &Pose) -> Value {
    let quaternion = glam::DQuat::from_mat3(&pose.rotation).to_array().map(|v| v + 0.0);
    json!({
        "centre_m": numbers(pose.translation),
        "quaternion_xyzw": quaternion,
        "yaw_deg": yaw(&pose.rotation).to_degrees() + 0.0,
    })
}

fn yaw(rotation: &DMat3) -> f64 {
    libm::atan2(rotation.x_axis.y, rotation.x_axis.x)
}

/// Adding 0 makes a negative zero positive.
fn numbers(vector: DVec3) -> [f64; 3] {
    vector.to_array().map(|v| v + 0.0)
}

fn bounds(bounds: Option<Bounds>) -> Value {
    bounds.map_or(Value::Null, |bounds| json!(bounds))
}
