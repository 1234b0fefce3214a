//! The keys of a job, apart from those of its sensors' tables and its expectations.

use super::super::kinds::{
    ByName, Choice, Choices, Flag, FolderName, Formats, Integer, List, Names, Nested, Number, NumberOrTable,
    Tables, Text,
};
use super::super::table::{Key, TableKeys, key, table};
use super::depth::{STEREO, STRUCTURED_LIGHT, TOF};
use super::expect::EXPECT;
use super::limits::MAX_FRAMES;
use super::measurement::{BLOOMING, FOOTPRINT, IS_NOMINAL, NOISE, RECEIVER};
use super::motion::{ACTORS, ANIMATION, TRAJECTORY_KEYS};
use super::pose::POSE_KEYS;
use super::random::RANDOM;
use super::sensor;
pub(crate) use super::surroundings::{ENVIRONMENT, MATERIALS, WEATHER};
use crate::frame::UpAxis;
use crate::output::{CHANNEL_NAMES, CloudFrame, CloudTime, UNASKED_CHANNEL_NAMES};
use crate::trace::methods::{METHODS, Method};
use crate::truth;

/// Most sensors of a rig. What they take together is limited besides: their beams, and the bytes of their files.
pub(crate) const MAX_SENSORS: usize = 10_000;

/// Most expectations of a job: each looks at all rays.
const MAX_EXPECTATIONS: usize = 1000;

pub(crate) static JOB: TableKeys = table(
    "a job",
    &[
        &SCENE,
        &SCENE_NAME,
        &UP,
        &SEED,
        &LABELS,
        &MATERIALS,
        &WEATHER,
        &ENVIRONMENT,
        &SENSORS,
        &TRAJECTORY,
        &ACTORS,
        &ANIMATION,
        &SEQUENCE,
        &RANDOM,
        &TRACE,
        &OUTPUT,
        &TRUTH,
        &CHECK,
        &EXPECTATIONS,
    ],
);
pub(crate) static SCENE: Key<Text> =
    key("scene", Text, "The glTF scene, .glb or .gltf, relative to this file.")
        .required("`scene = \"../scenes/room.glb\"`, a glTF file")
        .starts_as("\"scene.glb\"");
pub(crate) static SCENE_NAME: Key<Text> =
    key("scene_name", Text, "Which of the file's scenes, by name; left out: its default scene.");
pub(crate) static UP: Key<Choice<UpAxis>> = key(
    "up",
    Choice(&[("z", UpAxis::Z), ("y", UpAxis::Y)]),
    "The world's upward axis: \"z\" turns glTF's axes so that z is up, \"y\" keeps them.",
)
.or("\"z\"");
pub(crate) static SEED: Key<Integer<u64>> =
    key("seed", Integer::within(0, u64::MAX), "Everything random follows from this number.")
        .or("0")
        .starts_as("0");
pub(crate) static LABELS: Key<ByName<Integer<u32>>> = key(
    "labels",
    ByName {
        of: Integer::within(0, u32::MAX as u64),
        names: Names::Any("nodes or materials"),
        example: "`[labels]`, then `wall = 3`",
    },
    "Semantic labels by the names of nodes or materials, such as wall = 3.",
)
.suggested_as("{ wall = 3 }");
pub(crate) static SENSORS: Key<Tables> = key(
    "sensor",
    Tables::with_headers(&SENSOR, "sensor", 1).at_most(MAX_SENSORS),
    "The rig: one table a sensor.",
)
.required("a `[[sensor]]`");
pub(crate) static TRAJECTORY: Key<Nested> =
    key("trajectory", Nested(&TRAJECTORY_KEYS), "Where the body stands in the world, or how it moves.");
pub(crate) static SEQUENCE: Key<Nested> = key(
    "sequence",
    Nested(&SEQUENCE_KEYS),
    "How many frames there are, and when; left out: one frame at time 0.",
);
pub(crate) static TRACE: Key<Nested> = key("trace", Nested(&TRACE_KEYS), "How the beams are cast.");
pub(crate) static OUTPUT: Key<Nested> = key("output", Nested(&OUTPUT_KEYS), "What to write, and where.")
    .required("`[output]` with `dir = \"../out\"`");
pub(crate) static TRUTH: Key<Nested> =
    key("truth", Nested(&TRUTH_KEYS), "What is written about the frames of a sequence beside the returns.");
pub(crate) static CHECK: Key<Nested> = key(
    "check",
    Nested(&CHECK_KEYS),
    "What of the frames `beamcast check` holds to the baseline, and how closely.",
);
pub(crate) static EXPECTATIONS: Key<Tables> = key(
    "expect",
    Tables::with_headers(&EXPECT, "expectation", 0).at_most(MAX_EXPECTATIONS),
    "What the rig should see: one table an expectation.",
);

/// The keys that only a job has for a sensor, then those that a sensor file may have too.
pub(crate) static SENSOR: TableKeys = table(
    "`[[sensor]]`",
    &[
        &NAME,
        &PRESET,
        &MODE,
        &IS_NOMINAL,
        &POSE,
        &TRIGGER,
        &sensor::ROTATING,
        &sensor::RASTER,
        &sensor::MIRROR,
        &sensor::RISLEY,
        &sensor::RAYS,
        &sensor::PINHOLE,
        &sensor::FISHEYE,
        &sensor::EQUIRECTANGULAR,
        &sensor::ORTHOGRAPHIC,
        &sensor::RANGE,
        &sensor::RING,
        &FOOTPRINT,
        &RECEIVER,
        &NOISE,
        &BLOOMING,
        &STEREO,
        &STRUCTURED_LIGHT,
        &TOF,
    ],
)
.one_of(sensor::PATTERNS)
.unless(&PRESET);
pub(crate) static NAME: Key<FolderName> =
    key("name", FolderName, "Names the sensor's output folder; a lone sensor needs none.")
        .or("\"sensor\"")
        .starts_as("\"sensor\"");
pub(crate) static PRESET: Key<Text> = key(
    "preset",
    Text,
    "A built-in sensor such as \"ouster/os1-128\" (`beamcast presets`), or a sensor file, relative to this file; the tables here add to it or override its keys.",
)
.starts_as("\"velodyne/vlp-16\"");
pub(crate) static MODE: Key<Text> =
    key("mode", Text, "One of the preset's modes, by name; left out: the preset as it stands.");
pub(crate) static POSE: Key<Nested> =
    key("pose", Nested(&POSE_KEYS), "body_from_sensor: where the sensor sits on the body.")
        .starts_as("{ position_m = [0.0, 0.0, 1.8], rpy_deg = [0.0, 0.0, 0.0] }");

pub(crate) static TRIGGER: Key<Number> = key(
    "trigger_s",
    Number::ANY,
    "How much later than the sequence's each frame of this sensor starts; negative: earlier.",
)
.or("0.0");

pub(crate) static SEQUENCE_KEYS: TableKeys =
    table("`[sequence]`", &[&FRAMES, &DURATION, &START, &MOTION, &CLOUD_TIME, &SLICE]);
/// Most slices of a frame: each has a shape of its own.
pub(crate) const MAX_SLICES: usize = 1000;

pub(crate) static FRAMES: Key<Integer<u64>> = key(
    "frames",
    Integer::within(1, MAX_FRAMES),
    "The frames of each sensor; with more than one, each sensor needs a rate.",
)
.or("1")
.replaces(&["duration_s"])
.starts_as("100");
pub(crate) static DURATION: Key<Number> = key(
    "duration_s",
    Number::POSITIVE,
    "Instead of `frames`: each sensor has the frames that start within this time, by its own rate.",
)
.replaces(&["frames"]);
pub(crate) static START: Key<Number> =
    key("start_s", Number::ANY, "The time at which the first frame starts.").or("0.0");
pub(crate) static MOTION: Key<Choice<bool>> = key(
    "motion",
    Choice(&[("rolling", false), ("frozen", true)]),
    "\"rolling\" casts each pulse at its own time, \"frozen\" all of a frame at the frame's start.",
)
.or("\"rolling\"");
pub(crate) static CLOUD_TIME: Key<Choice<CloudTime>> = key(
    "cloud_time",
    Choice(&CloudTime::NAMED),
    "The time whose frame the points of clouds are in: \"raw\" is each pulse's own, as drivers give points; \"start\", \"middle\" and \"end\" of the frame compensate the motion of the sensor, and of nothing else.",
)
.or("\"raw\"");
pub(crate) static SLICE: Key<Number> = key(
    "slice_s",
    Number::POSITIVE,
    "Meshes that bend have one shape for so long at most; left out: one shape a frame.",
);

pub(crate) static TRACE_KEYS: TableKeys = table("`[trace]`", &[&KERNEL]);
pub(crate) static KERNEL: Key<Choice<Option<&'static Method>>> = key(
    "kernel",
    Choice(&METHODS_BY_NAME),
    "The ray-triangle method that decides what a beam hits: the exact definition, or a published method to compare with.",
)
.or("\"exact\"");
/// The published methods; the exact definition goes by a name of its own.
static METHODS_BY_NAME: [(&str, Option<&Method>); METHODS.len() + 1] = {
    let mut all: [(&str, Option<&Method>); METHODS.len() + 1] = [("exact", None); METHODS.len() + 1];
    let mut index = 0;
    while index < METHODS.len() {
        all[index + 1] = (METHODS[index].about.name, Some(&METHODS[index]));
        index += 1;
    }
    all
};

pub(crate) static OUTPUT_KEYS: TableKeys =
    table("`[output]`", &[&DIR, &FORMATS, &CHANNELS, &CLOUD_FRAME, &LEGEND, &TERMS]);
pub(crate) static DIR: Key<Text> = key("dir", Text, "The folder to write to, relative to this file.")
    .required("`dir = \"../out\"`, the folder to write to")
    .starts_as("\"out\"");
pub(crate) static FORMATS: Key<Formats> =
    key("formats", Formats, "The files of each frame; docs/formats.md tells what is in them.")
        .or("[\"exr\", \"ply\", \"png\"]")
        .starts_as("[\"exr\", \"ply\", \"png\"]");
pub(crate) static CHANNELS: Key<Choices<&'static str>> = key(
    "channels",
    Choices(Choice(&CHANNEL_WORDS)),
    "The channels in the files that hold channels; left out: all but flow, velocity and id.track.",
);
pub(crate) static CLOUD_FRAME: Key<Choice<CloudFrame>> = key(
    "frame",
    Choice(&[("sensor", CloudFrame::Sensor), ("body", CloudFrame::Body), ("world", CloudFrame::World)]),
    "The frame of the clouds; \"sensor\" is a camera's optical frame.",
)
.or("\"sensor\"")
.starts_as("\"sensor\"");

pub(crate) static LEGEND: Key<Flag> =
    key("legend", Flag, "Whether PNG previews have a title, a scale of ranges and the colour of no return.")
        .or("false");

pub(crate) static TERMS: Key<Flag> = key(
    "terms",
    Flag,
    "Whether images and clouds have the ideal range of each return and every term of its error, which add up to its range.",
)
.or("false");

pub(crate) static TRUTH_KEYS: TableKeys = table("`[truth]`", &[&POSES, &BOXES, &MASKS, &VISIBLE]);
pub(crate) static POSES: Key<Flag> = key(
    "poses",
    Flag,
    "Whether `poses.csv` has a row for each frame: the poses of sensor and body at its start; left out: if there is a `[sequence]`.",
);
pub(crate) static BOXES: Key<Choice<Option<truth::Choice>>> = key(
    "boxes",
    Choice(&BOXES_BY_NAME),
    "Which objects `boxes.jsonl` has oriented boxes of: \"tracked\" are actors and animated nodes, \"labelled\" these and all objects with a label, \"all\" everything.",
)
.or("\"none\"");
static BOXES_BY_NAME: [(&str, Option<truth::Choice>); truth::Choice::NAMED.len() + 1] = {
    let mut all = [("none", None); truth::Choice::NAMED.len() + 1];
    let mut index = 0;
    while index < truth::Choice::NAMED.len() {
        all[index + 1] = (truth::Choice::NAMED[index].0, Some(truth::Choice::NAMED[index].1));
        index += 1;
    }
    all
};
pub(crate) static MASKS: Key<Flag> =
    key("masks", Flag, "Whether the boxes of cameras have the pixels that show the object.").or("false");
pub(crate) static VISIBLE: Key<Flag> =
    key("visible", Flag, "Whether `visible.jsonl` lists the objects that each frame sees.").or("false");

pub(crate) static CHECK_KEYS: TableKeys = table("`[check]`", &[&COMPARED, &COMPARED_FRAMES, &TOLERANCES]);
pub(crate) static COMPARED: Key<Choices<&'static str>> =
    key("channels", Choices(Choice(&COMPARED_WORDS)), "The channels that are compared; left out: all.");
pub(crate) static COMPARED_FRAMES: Key<List<Integer<u64>>> = key(
    "frames",
    List { of: Integer::within(0, MAX_FRAMES), least: 1 },
    "The frames of each sensor that are compared, counted from 0; left out: the first, the middle and the last.",
);
pub(crate) static TOLERANCES: Key<ByName<NumberOrTable>> = key(
    "tolerance",
    ByName {
        of: NumberOrTable(Number::NOT_NEGATIVE, &TOLERANCE),
        names: Names::Of("channel", &UNASKED_CHANNEL_NAMES),
        example: "`[check.tolerance]`, then `range = 0.001`",
    },
    "By channel, how far a pixel may be off: a number in the channel's unit, or a table.",
);
/// The channels' names, each standing for itself.
static CHANNEL_WORDS: [(&str, &str); CHANNEL_NAMES.len()] = words(CHANNEL_NAMES);
/// The names of the channels that a baseline holds.
static COMPARED_WORDS: [(&str, &str); UNASKED_CHANNEL_NAMES.len()] = words(UNASKED_CHANNEL_NAMES);

const fn words<const COUNT: usize>(names: [&'static str; COUNT]) -> [(&'static str, &'static str); COUNT] {
    let mut all = [("", ""); COUNT];
    let mut index = 0;
    while index < COUNT {
        all[index] = (names[index], names[index]);
        index += 1;
    }
    all
}

pub(crate) static TOLERANCE: TableKeys = table("a tolerance", &[&ABSOLUTE, &RELATIVE, &PIXELS]);
pub(crate) static ABSOLUTE: Key<Number> =
    key("absolute", Number::NOT_NEGATIVE, "In the channel's unit.").or("0.0");
pub(crate) static RELATIVE: Key<Number> =
    key("relative", Number::NOT_NEGATIVE, "As a part of the value.").or("0.0");
pub(crate) static PIXELS: Key<Number> =
    key("pixels", Number::SHARE, "The part of the pixels that may be off by more.").or("0.0");
