//! The attributes of an EXR's header, by which a file on its own can be understood.

use std::collections::BTreeMap;

use crate::frame::BODY_FROM_OPTICAL;
use crate::output::sensor_frame::{SensorFrame, pose_as_toml};
use crate::scan::Cause;
use crate::sensor::{Pattern, Ranging};

/// The value of an attribute.
pub(super) enum Value {
    /// A text in ASCII, as an attribute holds one byte for each character.
    Text(String),
    /// A number of 64 bits.
    Number(f64),
}

/// The attributes of a frame by their names. `no_return` says what stands for a pixel without a return.
pub(super) fn attributes(frame: &SensorFrame, no_return: &str) -> BTreeMap<String, Value> {
    let mut all = BTreeMap::new();
    let mut set = |name: &str, value| all.insert(format!("beamcast:{name}"), value);
    let text = |value: &str| Value::Text(value.to_owned());

    set("no_return", text(no_return));
    let possible = if frame.frame.is_measured() { Cause::ALL } else { Cause::IDEAL };
    let causes: Vec<_> =
        possible.iter().map(|cause| format!("{} {}", cause.number(), cause.name())).collect();
    set("cause", text(&causes.join(", ")));
    set("sensor", text(&frame.name.escape_default().to_string()));
    set("world_from_sensor", text(&pose_as_toml(&frame.world_from_sensor())));
    for (what, named) in
        [("instances", frame.names.instances(frame.frame)), ("labels", frame.names.labels(frame.frame))]
    {
        if let Some(names) = named.to_json() {
            set(what, text(&names));
        }
        if named.left_out > 0 {
            let said = format!("{}, which the manifest names", named.left_out);
            set(&format!("{what}_left_out"), text(&said));
        }
    }
    let pattern = &frame.capture.sensor.pattern;
    set("pattern", text(pattern.name()));
    set("normal_frame", text(if pattern.is_camera() { "optical" } else { "sensor" }));
    match pattern {
        Pattern::Rotating(p) => {
            set("layout", text(if p.is_destaggered() { "destaggered" } else { "staggered" }));
            let offset_m = match p.ranging() {
                Ranging::Along(before) => before,
                Ranging::FromOrigin => {
                    set("range_from", text("origin"));
                    0.0
                }
            };
            set("range_offset_m", Value::Number(offset_m));
        }
        Pattern::Camera(camera) => {
            let world_from_optical = frame.world_from_sensor() * BODY_FROM_OPTICAL;
            set("world_from_optical", text(&pose_as_toml(&world_from_optical)));
            set("fx_px", Value::Number(camera.focal_px().0));
            set("fy_px", Value::Number(camera.focal_px().1));
            set("cx_px", Value::Number(camera.principal_px().0));
            set("cy_px", Value::Number(camera.principal_px().1));
            let numbers = camera.lens().coefficients().iter().map(f64::to_string).collect::<Vec<_>>();
            if !numbers.is_empty() {
                set("distortion", text(&numbers.join(", ")));
            }
        }
        Pattern::Orthographic(camera) => {
            let world_from_optical = frame.world_from_sensor() * BODY_FROM_OPTICAL;
            set("world_from_optical", text(&pose_as_toml(&world_from_optical)));
            set("width_m", Value::Number(camera.size_m().0));
            set("height_m", Value::Number(camera.size_m().1));
        }
        _ => {}
    }
    all
}
