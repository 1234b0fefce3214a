//! The built-in sensors.

use std::path::Path;

use crate::source::suggest::nearest;
use crate::source::words::quoted;

macro_rules! built_in {
    ($($name:literal),* $(,)?) => {
        /// The built-in sensors: their names, and their files' texts.
        pub const BUILT_IN: &[(&str, &str)] =
            &[$(($name, include_str!(concat!("../../configs/sensors/", $name, ".toml")))),*];
    };
}
built_in![
    "azure/kinect",
    "hesai/jt128",
    "hesai/jt16",
    "hesai/ot128",
    "hesai/pandar128",
    "hesai/pandar40p",
    "hesai/pandar64",
    "hesai/qt128",
    "hesai/qt64",
    "hesai/xt-16",
    "hesai/xt-32",
    "hesai/xt32m2x",
    "hokuyo/utm-30lx",
    "ideal/camera",
    "kinect/v1",
    "kinect/v2",
    "leica/als50",
    "livox/avia",
    "livox/horizon",
    "livox/mid-360",
    "livox/mid-40",
    "livox/mid-70",
    "livox/tele-15",
    "luxonis/oak-d",
    "ouster/os0-128",
    "ouster/os0-128-rev7",
    "ouster/os0-32",
    "ouster/os0-64",
    "ouster/os1-128",
    "ouster/os1-128-rev7",
    "ouster/os1-16-gen1",
    "ouster/os1-32",
    "ouster/os1-64",
    "ouster/os1-64-gen1",
    "ouster/os2-128",
    "ouster/os2-32",
    "ouster/os2-64",
    "realsense/d415",
    "realsense/d435",
    "realsense/d455",
    "riegl/vq-780i",
    "riegl/vux-1uav",
    "riegl/vz-400",
    "robosense/bpearl",
    "robosense/helios",
    "robosense/rs16",
    "robosense/rs32",
    "robosense/ruby-plus",
    "sick/lms5xx",
    "stereolabs/zed-2",
    "velodyne/hdl-32e",
    "velodyne/hdl-64e-s2",
    "velodyne/hdl-64e-s3",
    "velodyne/puck-128",
    "velodyne/vlp-16",
    "velodyne/vlp-16-hi-res",
    "velodyne/vlp-32a",
    "velodyne/vlp-32c",
];

/// The text of a built-in sensor.
pub fn text(name: &str) -> Option<&'static str> {
    BUILT_IN.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}

/// Whether a preset's name is that of a file: such a name ends in `.toml`.
pub(super) fn is_file(preset: &str) -> bool {
    Path::new(preset).extension().is_some_and(|e| e.eq_ignore_ascii_case("toml"))
}

/// The help of an error about a name that no built-in sensor has.
pub(super) fn near_name(name: &str) -> Option<String> {
    let names = || BUILT_IN.iter().map(|(name, _)| *name);
    // A model without its vendor is near enough.
    let model = |name: &'static str| name.rsplit('/').next().unwrap_or(name);
    let near = nearest(name, names())
        .or_else(|| nearest(name, names().map(model)).and_then(|m| names().find(|n| model(n) == m)));
    Some(match near {
        Some(near) => format!("did you mean {}?", quoted(near)),
        None => "`beamcast presets` lists them".to_owned(),
    })
}
