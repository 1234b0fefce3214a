//! Keys that people bring from other programs, or expect, and the answer to each: the right key, or that there is none yet.

/// The answer to a key that no table has.
pub(super) enum Foreign {
    /// One of the table's keys says it, in this way.
    Means(&'static str, &'static str),
    /// Nothing says it: the sentence tells why, or what does instead.
    Answer(&'static str),
}

use Foreign::{Answer, Means};

/// The answer to a key that the table with this title lacks. `has` says whether the table has a key.
pub(super) fn answer(title: &str, key: &str, has: impl Fn(&str) -> bool) -> Option<Foreign> {
    let key = key.to_ascii_lowercase();
    // Angles are `{ from, to, count }`, and so are sectors.
    let spaced = match key.as_str() {
        "start" | "begin" | "first" | "min" | "lower" => Some("from"),
        "end" | "stop" | "last" | "max" | "upper" => Some("to"),
        "n" | "num" | "number" | "steps" | "samples" => Some("count"),
        _ => None,
    };
    if let Some(name) = spaced.filter(|name| has(name)) {
        return Some(Means(name, ""));
    }
    let means = MEANINGS.iter().find(|(names, known, _)| names.contains(&key.as_str()) && has(known));
    if let Some((_, known, how)) = means {
        return Some(Means(known, how));
    }
    let is_of = |tables: &[&str]| tables.is_empty() || tables.contains(&title);
    let answer = ANSWERS.iter().find(|(names, tables, _)| names.contains(&key.as_str()) && is_of(tables));
    answer.map(|(.., sentence)| Answer(sentence))
}

/// Keys of other programs, the key that they mean where the table has it, and what is to be minded.
const MEANINGS: &[(&[&str], &str, &str)] = &[
    (
        &["rpm", "spin_rate", "rotation_rate", "rotation_rate_rpm"],
        "rate_hz",
        "turns a second, which are rpm / 60",
    ),
    (&["fps", "frame_rate", "framerate", "frequency", "update_rate", "hz"], "rate_hz", ""),
    (
        &[
            "rotation",
            "orientation",
            "euler",
            "euler_deg",
            "rpy",
            "angles",
            "attitude",
            "roll",
            "pitch",
            "yaw",
        ],
        "rpy_deg",
        "roll, pitch and yaw in degrees, or `quaternion_xyzw`",
    ),
    (&["quaternion", "quat", "quaternion_wxyz", "wxyz", "q"], "quaternion_xyzw", "x, y, z, and w last"),
    (&["translation", "xyz", "location", "t"], "position_m", ""),
    (&["look_at", "target", "lookat", "target_m"], "look_at_m", "a point in metres"),
    (&["up_vector", "up_axis"], "up", "a direction"),
    (
        &["extrinsic_matrix", "transform_matrix", "transform", "world_from_camera"],
        "matrix",
        "4 rows of 4 numbers",
    ),
    (&["waypoints", "keyframes"], "poses", "each with `t_s`"),
    (&["csv", "tum", "kitti", "path", "filename"], "file", ""),
    (&["velocity", "speed", "velocities"], "twist", "with `linear_m_s` and `angular_deg_s`"),
    (&["linear", "velocity_m_s", "linear_velocity"], "linear_m_s", "along the body's own axes"),
    (
        &["angular", "angular_rad_s", "angular_velocity", "yaw_rate"],
        "angular_deg_s",
        "about the body's own axes",
    ),
    (&["actors", "objects"], "actor", "each in an `[[actor]]` of its own"),
    (&["animations"], "animation", ""),
    (&["looped", "repeat"], "loop", ""),
    (&["near", "min_range", "minimum"], "min_m", ""),
    (&["far", "max_range", "maximum"], "max_m", ""),
    (
        &["line_time", "line_time_us", "line_delay", "row_delay", "rolling_shutter", "readout_time"],
        "row_time_us",
        "the time from a row to the next",
    ),
    (
        &["stddev", "std", "sigma", "noise_std", "range_noise", "range_std", "range_sigma"],
        "range_floor_m",
        "a standard deviation in metres",
    ),
    (&["bias", "range_bias"], "bias_m", "the standard deviation of the beams' biases in metres"),
    (
        &["divergence", "divergence_deg", "beam_divergence", "beam_width"],
        "divergence_mrad",
        "in milliradians: a degree is 17.45",
    ),
    (&["max_returns", "num_returns", "return_mode"], "returns", ""),
    (&["wavelength"], "wavelength_nm", "in nanometres"),
    (&["fog", "visibility", "visibility_km"], "visibility_m", "in metres"),
    (&["rain", "rain_rate", "rainfall"], "rain_mm_h", ""),
    (&["snow", "snow_rate", "snowfall"], "snow_mm_h", ""),
    (&["dust"], "dust_per_m", "an extinction coefficient"),
    (&["sun", "illuminance"], "sun_klx", "in kilolux"),
    (&["reflectivity", "albedo"], "reflectance", "1 for white"),
    (&["material"], "materials", "a table for each name"),
    (&["trigger", "trigger_offset", "phase", "phase_s", "time_offset", "time_offset_s"], "trigger_s", ""),
    (&["fov", "fov_deg", "horizontal_fov"], "hfov_deg", "the horizontal field of view"),
    (&["channels", "lasers", "beams", "vertical_angles"], "elevations_deg", "one a beam"),
    (&["samples", "horizontal_samples", "horizontal_resolution", "points_per_turn"], "columns", ""),
    (&["model", "type", "sensor_type", "file"], "preset", ""),
    (&["extrinsics", "transform", "mount", "extrinsic", "body_from_sensor"], "pose", ""),
    (&["mesh", "world", "map", "gltf", "glb", "environment_file", "scene_path", "scene_file"], "scene", ""),
    (&["sensors", "lidar", "camera", "rig"], "sensor", "each in a `[[sensor]]` of its own"),
    (&["out", "output_dir", "folder", "path", "directory"], "dir", ""),
    (&["format", "outputs", "types"], "formats", ""),
];

const NO_SEQUENCE: &str = "the frames are counted in `[sequence]`: `frames = 100`, or `duration_s = 10.0`";
const NOISE: &str = "a sensor's `[footprint]`, `[receiver]` and `[noise]` say how it measures";

/// Keys that nothing stands for, the titles of the tables that this is the answer in (all, if there is none), and the answer.
const ANSWERS: &[(&[&str], &[&str], &str)] = &[
    (&["frames", "frame_count", "num_frames", "duration", "duration_s", "motion", "steps"], &[], NO_SEQUENCE),
    (&["imu", "gps", "gnss", "odometry"], &[], "IMU, GNSS and odometry are not supported yet"),
    (&["rgb", "color", "colour", "image"], &[], "beamcast measures ranges: it makes no colour images"),
    (&["noise_std", "stddev", "noise_m", "dropout", "divergence", "beam_divergence"], &[], NOISE),
    (
        &["rain", "fog", "snow", "dust", "sun", "sunlight"],
        &[],
        "the job's `[weather]` has fog, rain, snow and dust, and its `[environment]` the sun",
    ),
    (
        &["material", "reflectivity", "albedo"],
        &[],
        "the job's `[materials]` says by name how surfaces send light back",
    ),
    (
        &["units", "unit", "scale", "scene_scale"],
        &["a job", "`[[sensor]]`", "`pose`", "`[output]`"],
        "lengths are metres: scale the scene where it is exported",
    ),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_depend_on_the_table() {
        let said =
            |title: &str, key: &str, keys: &[&str]| match answer(title, key, |name| keys.contains(&name)) {
                Some(Means(known, _)) => known,
                Some(Answer(sentence)) => sentence,
                None => "",
            };
        assert_eq!(said("a range of angles", "start", &["from", "to", "count"]), "from");
        assert_eq!(said("a job", "start", &["scene"]), "");
        assert_eq!(said("`[rotating]`", "RPM", &["rate_hz"]), "rate_hz");
        assert_eq!(said("`[trajectory]`", "waypoints", &["poses"]), "poses");
        assert_eq!(said("`[[sensor]]`", "file", &["preset"]), "preset");
        assert!(said("a job", "scale", &["scene"]).contains("lengths are metres"));
        assert_eq!(said("the format exr", "scale", &["format"]), "");
        assert_eq!(said("`[rotating]`", "channels", &["elevations_deg"]), "elevations_deg");
    }
}
