//! The keys of what moves: trajectories, actors, and the clips of the scene.

use super::super::kinds::{Choice, Flag, Integer, List, Nested, Number, Tables, Text, Vector};
use super::super::table::{Key, TableKeys, key, table};
use super::placing::PLACE;
use super::pose::{CONVENTION, LOOK_AT, MATRIX, POSE_KEYS, POSITION, QUATERNION, RPY, UPWARD};
use crate::motion::Interpolation;

/// Most poses of a list in a job or of a file.
pub(crate) const MAX_POSES: usize = 1_000_000;

/// Most actors of a job.
const MAX_ACTORS: usize = 10_000;

pub(crate) static TRAJECTORY_KEYS: TableKeys = table(
    "`[trajectory]`",
    &[&BODY_POSE, &FILE, &POSES, &TWIST, &NODE, &INTERPOLATION, &RATE, &TIMES, &AXES],
);
pub(crate) static BODY_POSE: Key<Nested> = key(
    "pose",
    Nested(&POSE_KEYS),
    "world_from_body; with `twist` that of time 0, with `file` or `poses` the place of the frame that they are given in.",
)
.starts_as("{ position_m = [0.0, 0.0, 0.0], rpy_deg = [0.0, 0.0, 0.0] }");
pub(crate) static FILE: Key<Text> = key(
    "file",
    Text,
    "The poses in a file, relative to this file: CSV with the columns t_s, x_m, y_m, z_m, qx, qy, qz, qw, TUM (.tum) or KITTI (.kitti).",
)
.replaces(&["poses", "twist", "node"]);
pub(crate) static POSES: Key<Tables> =
    key("poses", Tables::in_braces(&TIMED_POSE, 1).at_most(MAX_POSES), "The poses, each with its time.")
        .replaces(&["file", "twist", "node"]);
pub(crate) static TWIST: Key<Nested> =
    key("twist", Nested(&TWIST_KEYS), "Constant velocities in the body's own frame, from `pose` at time 0.")
        .replaces(&["file", "poses", "node"]);
pub(crate) static NODE: Key<Text> =
    key("node", Text, "The animated node of the scene that the body is, by name.")
        .replaces(&["file", "poses", "twist", "pose"]);
pub(crate) static INTERPOLATION: Key<Choice<Interpolation>> = key(
    "interpolation",
    Choice(&[("screw", Interpolation::Screw), ("linear", Interpolation::Linear)]),
    "Between poses: \"screw\" keeps the velocities in the body's own frame constant, \"linear\" goes straight and turns evenly.",
)
.or("\"screw\"");
pub(crate) static RATE: Key<Number> =
    key("rate_hz", Number::POSITIVE, "Poses a second of a KITTI file, the first at time 0.")
        .replaces(&["times"]);
pub(crate) static TIMES: Key<Text> =
    key("times", Text, "The file of a KITTI file's times, one in seconds a line, relative to this file.")
        .replaces(&["rate_hz"]);
pub(crate) static AXES: Key<Choice<bool>> = key(
    "axes",
    Choice(&[("body", false), ("optical", true)]),
    "The axes of a file's poses, of the body and of what they are given in: \"body\" (x forward, y left, z up), or \"optical\" (x right, y down, z forward) as of KITTI's cameras; left out: \"optical\" of a KITTI file, else \"body\".",
);

pub(crate) static TIMED_POSE: TableKeys = table(
    "a pose of `poses`",
    &[&TIME, &POSITION, &RPY, &QUATERNION, &LOOK_AT, &UPWARD, &MATRIX, &CONVENTION],
);
pub(crate) static TIME: Key<Number> =
    key("t_s", Number::ANY, "The time of the pose.").required("`t_s = 0.0`, the time of the pose");

pub(crate) static TWIST_KEYS: TableKeys = table("`twist`", &[&LINEAR, &ANGULAR]);
pub(crate) static LINEAR: Key<Vector<3>> =
    key("linear_m_s", Vector("x, y, z"), "Of the body's origin, along its own axes, in metres a second.")
        .or("[0.0, 0.0, 0.0]");
pub(crate) static ANGULAR: Key<Vector<3>> =
    key("angular_deg_s", Vector("x, y, z"), "About the body's own axes, in degrees a second.")
        .or("[0.0, 0.0, 0.0]");

pub(crate) static ACTORS: Key<Tables> = key(
    "actor",
    Tables::with_headers(&ACTOR, "actor", 0).at_most(MAX_ACTORS),
    "What moves in the scene along a trajectory, or stands at a place that is drawn: one table a thing.",
);
pub(crate) static ACTOR: TableKeys =
    table("`[[actor]]`", &[&ACTOR_NAME, &ACTOR_SCENE, &ACTOR_NODE, &ACTOR_TRAJECTORY, &PLACE, &ACTOR_LABEL])
        .one_of(&[&ACTOR_SCENE, &ACTOR_NODE])
        .and_one_of(&[&ACTOR_TRAJECTORY, &PLACE]);
pub(crate) static ACTOR_NAME: Key<Text> =
    key("name", Text, "The thing's name, as boxes and tables of poses have it.")
        .required("`name = \"car\"`: boxes and tables of poses name it");
pub(crate) static ACTOR_SCENE: Key<Text> =
    key("scene", Text, "The thing's own glTF file, relative to this file.").replaces(&["node"]);
pub(crate) static ACTOR_NODE: Key<Text> = key(
    "node",
    Text,
    "The node of the job's scene that moves, by name, with all below it; its own place does not count.",
)
.replaces(&["scene"]);
pub(crate) static ACTOR_TRAJECTORY: Key<Nested> =
    key("trajectory", Nested(&ACTOR_TRAJECTORY_KEYS), "world_from_actor over time.").replaces(&["place"]);
pub(crate) static ACTOR_LABEL: Key<Integer<u32>> = key(
    "label",
    Integer::within(0, u32::MAX as u64),
    "Its semantic label; left out: as [labels] and the file say.",
);
pub(crate) static ACTOR_TRAJECTORY_KEYS: TableKeys = table(
    "`trajectory` of an actor",
    &[&ACTOR_POSE, &FILE, &POSES, &TWIST, &INTERPOLATION, &RATE, &TIMES, &AXES],
);
pub(crate) static ACTOR_POSE: Key<Nested> =
    key("pose", Nested(&POSE_KEYS), "world_from_actor; with the other keys as in [trajectory].");

pub(crate) static ANIMATION: Key<Nested> =
    key("animation", Nested(&ANIMATION_KEYS), "How the scene's own clips play; left out: all once.");
pub(crate) static ANIMATION_KEYS: TableKeys = table("`[animation]`", &[&CLIPS, &LOOP, &CLIPS_START]);
pub(crate) static CLIPS: Key<List<Text>> =
    key("clips", List { of: Text, least: 0 }, "The clips that play, by name; left out: all.");
pub(crate) static LOOP: Key<Flag> =
    key("loop", Flag, "Whether a clip begins again at its end, and has done so before.").or("false");
pub(crate) static CLIPS_START: Key<Number> =
    key("start_s", Number::ANY, "The time at which the clips begin.").or("0.0");
