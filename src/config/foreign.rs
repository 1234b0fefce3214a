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
    (&["near", "min_range", "minimum"], "min_m", ""),
    (&["far", "max_range", "maximum"], "max_m", ""),
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

const NO_MOTION: &str = "moving bodies are not supported yet: the body stands at `pose`";
const NO_SEQUENCE: &str = "several frames are not supported yet: a job casts one frame of each sensor";
const NO_MODEL: &str = "this is not supported yet: ranges and intensities are ideal";

/// Keys that nothing stands for, the titles of the tables that this is the answer in (all, if there is none), and the answer.
const ANSWERS: &[(&[&str], &[&str], &str)] = &[
    (
        &["file", "twist", "node", "interpolation", "waypoints", "velocity", "csv", "poses"],
        &["`[trajectory]`"],
        NO_MOTION,
    ),
    (&["actor", "actors", "animation", "animations"], &[], "moving objects are not supported yet"),
    (
        &["frames", "frame_count", "num_frames", "sequence", "duration", "duration_s", "motion", "steps"],
        &[],
        NO_SEQUENCE,
    ),
    (&["imu", "gps", "gnss", "odometry"], &[], "IMU, GNSS and odometry are not supported yet"),
    (&["rgb", "color", "colour", "image"], &[], "beamcast measures ranges: it makes no colour images"),
    (
        &[
            "noise",
            "noise_std",
            "stddev",
            "noise_m",
            "dropout",
            "footprint",
            "receiver",
            "blooming",
            "nominal",
            "divergence",
        ],
        &[],
        NO_MODEL,
    ),
    (
        &["weather", "environment", "rain", "fog", "snow", "sun"],
        &[],
        "weather and light are not supported yet",
    ),
    (
        &["materials", "material", "reflectivity"],
        &[],
        "materials come from the scene; setting them in the job is not supported yet",
    ),
    (
        &["matrix", "look_at", "target", "up_vector", "opencv", "opengl"],
        &["`pose`"],
        "a pose is `position_m` with `rpy_deg` or `quaternion_xyzw`; matrices and targets are not supported yet",
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
        assert_eq!(said("`[trajectory]`", "file", &["pose"]), NO_MOTION);
        assert_eq!(said("`[[sensor]]`", "file", &["preset"]), "preset");
        assert!(said("a job", "scale", &["scene"]).contains("lengths are metres"));
        assert_eq!(said("the format exr", "scale", &["format"]), "");
        assert_eq!(said("`[rotating]`", "channels", &["elevations_deg"]), "elevations_deg");
    }
}
