//! The keys of jobs and sensor files as JSON Schema (draft-07), for editors that complete and check TOML by it.
//!
//! The tables and their keys are those that the reader knows, by construction. What a key's value may be the reader says in
//! code, and this page once more; `tests/schema/check.py` holds the two against each other. The schema never refuses what
//! the reader takes, and the reader finds more: lists whose lengths differ, files that aren't there.

use serde_json::{Map, Value, json};

use super::section::{self, Shape};
use crate::output::CHANNEL_NAMES;
use crate::trace::methods::METHODS;

/// What a schema describes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Document {
    /// A job.
    Job,
    /// A sensor file.
    Sensor,
}

/// The JSON Schema of a kind of file.
pub fn schema(document: Document) -> Value {
    let (root, title) = match document {
        Document::Job => (&section::JOB, "beamcast job"),
        Document::Sensor => (&section::SENSOR_FILE, "beamcast sensor file"),
    };
    let mut schema = Map::new();
    schema.insert("$schema".into(), "http://json-schema.org/draft-07/schema#".into());
    schema.insert("title".into(), title.into());
    schema.extend(table(root));
    if document == Document::Sensor {
        schema.extend(complete_sensor());
    }
    Value::Object(schema)
}

/// A key of a table.
struct Key {
    name: &'static str,
    kind: Kind,
    about: &'static str,
    /// As JSON has it.
    default: Option<&'static str>,
}

/// What a key's value may be.
enum Kind {
    Text,
    /// Of a sensor, which names its folder.
    Name,
    Flag,
    Choice(&'static [&'static str]),
    /// A list of different words, at least one.
    Choices(&'static [&'static str]),
    Kernel,
    Integer(u64, u64),
    Number,
    Positive,
    NotNegative,
    /// Strictly between.
    Between(f64, f64),
    /// A list of any length.
    Numbers,
    Vector(usize),
    /// A list of vectors of so many numbers.
    Vectors(usize),
    /// The same, or one vector for all.
    VectorOrVectors(usize),
    /// A list of angles, or evenly spaced ones.
    Angles,
    /// The same of elevations.
    Elevations,
    /// By name.
    Modes,
    /// By name, whole numbers of 32 bits.
    Labels,
    /// From 0 to 1.
    Share,
    /// A list of different channels, at least one.
    Channels,
    /// By channel: a number or a table.
    Tolerances,
    Table(&'static Shape),
    /// A list of at least so many.
    Tables(&'static Shape, usize),
}

const fn key(name: &'static str, kind: Kind, about: &'static str) -> Key {
    Key { name, kind, about, default: None }
}

impl Key {
    const fn or(self, default: &'static str) -> Self {
        Self { default: Some(default), ..self }
    }
}

/// Each table with the keys that it must have, and all that it may.
const TABLES: &[(&Shape, &[&str], &[Key])] = &[
    (
        &section::JOB,
        &["scene", "sensor", "output"],
        &[
            key("scene", Kind::Text, "The glTF scene, .glb or .gltf, relative to this file."),
            key("scene_name", Kind::Text, "Which of the file's scenes, by name; left out: its default scene."),
            key("up", Kind::Choice(&["z", "y"]), "The world's upward axis: \"z\" turns glTF's axes so that z is up, \"y\" keeps them.").or("\"z\""),
            key("seed", Kind::Integer(0, u64::MAX), "Everything random follows from this number.").or("0"),
            key("labels", Kind::Labels, "Semantic labels by the names of nodes or materials, such as wall = 3."),
            key("sensor", Kind::Tables(&section::SENSOR, 1), "The rig: one table a sensor."),
            key("trajectory", Kind::Table(&section::TRAJECTORY), "Where the body stands in the world."),
            key("trace", Kind::Table(&section::TRACE), "How the beams are cast."),
            key("output", Kind::Table(&section::OUTPUT), "What to write, and where."),
            key("check", Kind::Table(&section::CHECK), "What of the frames `beamcast check` holds to the baseline, and how closely."),
            key("expect", Kind::Tables(&section::EXPECT, 0), "What the rig should see: one table an expectation."),
        ],
    ),
    (
        &section::SENSOR,
        &[],
        &[
            key("name", Kind::Name, "Names the sensor's output folder; a lone sensor needs none.").or("\"sensor\""),
            key("preset", Kind::Text, "A built-in sensor such as \"ouster/os1-128\" (`beamcast presets`), or a sensor file, relative to this file; the tables here add to it or override its keys."),
            key("mode", Kind::Text, "One of the preset's modes, by name; left out: the preset as it stands."),
            key("pose", Kind::Table(&section::POSE), "body_from_sensor: where the sensor sits on the body."),
            ROTATING,
            RASTER,
            MIRROR,
            RISLEY,
            RAYS,
            PINHOLE,
            FISHEYE,
            EQUIRECTANGULAR,
            RANGE,
            RING,
        ],
    ),
    (
        &section::SENSOR_FILE,
        &[],
        &[
            ROTATING,
            RASTER,
            MIRROR,
            RISLEY,
            RAYS,
            PINHOLE,
            FISHEYE,
            EQUIRECTANGULAR,
            RANGE,
            RING,
            key("modes", Kind::Modes, "What differs in the unit's modes, by their names; a job chooses one with `mode`."),
        ],
    ),
    (
        &section::MODE,
        &[],
        &[ROTATING, RASTER, MIRROR, RISLEY, RAYS, PINHOLE, FISHEYE, EQUIRECTANGULAR, RANGE],
    ),
    (
        &section::ROTATING,
        &["elevations_deg", "columns", "rate_hz"],
        &[
            key("elevations_deg", Kind::Elevations, "One a beam, degrees, up positive: a list in any order, or evenly spaced ones."),
            key("azimuth_offsets_deg", Kind::Numbers, "One a beam, degrees, counterclockwise seen from above: added to the column's azimuth; left out: 0."),
            key("beam_times_us", Kind::Numbers, "One a beam, microseconds after the column's own time, 0 or more; left out: 0."),
            key("beam_origins_m", Kind::VectorOrVectors(3), "Where beams leave the head: [x, y, z] for all, or one a beam; x forward at the head's azimuth, y left, z up, metres.").or("[0.0, 0.0, 0.0]"),
            key("range_offset_m", Kind::NotNegative, "How far before a beam's origin its range begins, as the unit reports it, in metres.").or("0.0"),
            key("turns_while_firing", Kind::Flag, "Whether the head turns on while the beams of a column fire one after the other.").or("false"),
            key("layout", Kind::Choice(&["staggered", "destaggered"]), "The image as it is measured, or with its rows moved so that columns are azimuths.").or("\"staggered\""),
            key("pixel_shift_by_row", Kind::Numbers, "One a beam: by how many columns a destaggered image moves its row; left out: as the azimuth offsets say."),
            key("columns", Kind::Integer(1, 1_000_000), "Firings in the sector."),
            key("sector_deg", Kind::Table(&section::SECTOR), "Azimuths in degrees, counterclockwise from forward. A full turn has no repeated last column.").or("{\"from\": 180.0, \"to\": -180.0}"),
            key("rate_hz", Kind::Positive, "Turns a second."),
        ],
    ),
    (
        &section::RASTER,
        &["azimuths_deg", "elevations_deg"],
        &[
            key("azimuths_deg", Kind::Angles, "One a column, degrees, counterclockwise: a list, or evenly spaced ones."),
            key("elevations_deg", Kind::Elevations, "One a row, degrees, up positive: a list, or evenly spaced ones."),
            key("order", Kind::Choice(&["lines", "back_and_forth", "flash"]), "Line by line, every other line backward, or all at once.").or("\"lines\""),
            key("pulse_rate_hz", Kind::Positive, "Pulses a second; left out: as many as fill a frame."),
            key("rate_hz", Kind::Positive, "Frames a second."),
        ],
    ),
    (
        &section::MIRROR,
        &["azimuth", "elevation", "pulse_rate_hz", "rate_hz"],
        &[
            key("azimuth", Kind::Table(&section::AXIS), "How the azimuth moves."),
            key("elevation", Kind::Table(&section::AXIS), "How the elevation moves."),
            BEAMS,
            PULSE_RATE,
            FRAME_RATE,
        ],
    ),
    (
        &section::AXIS,
        &["motion", "rate_hz", "from_deg", "to_deg"],
        &[
            key("motion", Kind::Choice(&["sine", "triangle", "sawtooth"]), "How the angle goes from one end to the other, and back."),
            key("rate_hz", Kind::Positive, "Periods a second."),
            key("from_deg", Kind::Number, "Where a period begins, in degrees."),
            key("to_deg", Kind::Number, "The other end of the motion, in degrees."),
            key("phase_deg", Kind::Number, "Where in its period the motion starts, in degrees of 360.").or("0.0"),
        ],
    ),
    (
        &section::RISLEY,
        &["prisms", "pulse_rate_hz", "rate_hz"],
        &[
            key("prisms", Kind::Tables(&section::PRISM, 1), "The turning wedges, in the beam's way."),
            BEAMS,
            PULSE_RATE,
            FRAME_RATE,
        ],
    ),
    (
        &section::PRISM,
        &["rate_hz", "wedge_deg", "index"],
        &[
            key("rate_hz", Kind::Number, "Turns a second, negative the other way round."),
            key("wedge_deg", Kind::Number, "The angle between the faces in degrees."),
            key("index", Kind::Positive, "The refractive index."),
            key("phase_deg", Kind::Number, "The angle at time 0 in degrees.").or("0.0"),
            key("tilted", Kind::Choice(&["entry", "exit"]), "Which face is the oblique one."),
        ],
    ),
    (
        &section::RAYS,
        &["file"],
        &[
            key("file", Kind::Text, "A CSV with a ray a line, relative to this file: azimuth_deg, elevation_deg or x, y, z; time_s or time_us; origin_x_m, origin_y_m, origin_z_m."),
            FRAME_RATE,
        ],
    ),
    (
        &section::PINHOLE,
        &["width_px", "height_px"],
        &[
            WIDTH,
            HEIGHT,
            key("hfov_deg", Kind::Between(0.0, 180.0), "Field of view in degrees from the left edge of the image to the right; instead of fx_px to cy_px."),
            key("vfov_deg", Kind::Between(0.0, 180.0), "Field of view from the top edge to the bottom, if pixels aren't square; with hfov_deg."),
            FX,
            FY,
            CX,
            CY,
            key("distortion", Kind::Numbers, "k1, k2, p1, p2, then k3, then k4, k5, k6, as OpenCV has them; left out: none."),
            FRAME_RATE,
        ],
    ),
    (
        &section::FISHEYE,
        &["width_px", "height_px"],
        &[
            WIDTH,
            HEIGHT,
            key("hfov_deg", Kind::Positive, "Field of view in degrees from the left edge of the image to the right; instead of fx_px to cy_px."),
            FX,
            FY,
            CX,
            CY,
            key("distortion", Kind::Numbers, "k1, k2, k3, k4 of OpenCV's fisheye model; left out: an equidistant lens."),
            FRAME_RATE,
        ],
    ),
    (
        &section::EQUIRECTANGULAR,
        &["width_px", "height_px"],
        &[
            WIDTH,
            HEIGHT,
            key("hfov_deg", Kind::Positive, "Field of view in degrees, at most 360.").or("360.0"),
            key("vfov_deg", Kind::Positive, "Field of view in degrees, at most 180.").or("180.0"),
            FRAME_RATE,
        ],
    ),
    (
        &section::RANGE,
        &[],
        &[
            key("min_m", Kind::NotNegative, "The least range in metres along the ray, included.").or("0.0"),
            key("max_m", Kind::Positive, "The largest range in metres along the ray, included; left out: no limit."),
        ],
    ),
    (&section::TRAJECTORY, &[], &[key("pose", Kind::Table(&section::POSE), "world_from_body.")]),
    (
        &section::TRACE,
        &[],
        &[key("kernel", Kind::Kernel, "The ray-triangle method that decides what a beam hits: the exact definition, or a published method to compare with.").or("\"exact\"")],
    ),
    (
        &section::OUTPUT,
        &["dir"],
        &[
            key("dir", Kind::Text, "The folder to write to, relative to this file."),
            key("formats", Kind::Choices(&["exr", "ply", "png"]), "Range images with all channels (exr), clouds (ply), previews (png).").or("[\"exr\", \"ply\", \"png\"]"),
            key("frame", Kind::Choice(&["sensor", "body", "world"]), "The frame of the clouds; \"sensor\" is a camera's optical frame.").or("\"sensor\""),
        ],
    ),
    (
        &section::POSE,
        &[],
        &[
            key("position_m", Kind::Vector(3), "x (forward), y (left), z (up) in metres.").or("[0.0, 0.0, 0.0]"),
            key("rpy_deg", Kind::Vector(3), "Roll, pitch, yaw in degrees: R = Rz(yaw) Ry(pitch) Rx(roll); a positive pitch looks down.").or("[0.0, 0.0, 0.0]"),
            key("quaternion_xyzw", Kind::Vector(4), "The rotation as a unit quaternion, instead of rpy_deg."),
        ],
    ),
    (
        &section::SPACED,
        &["from", "to", "count"],
        &[
            key("from", Kind::Number, "The first angle in degrees."),
            key("to", Kind::Number, "The last angle in degrees."),
            key("count", Kind::Integer(1, 1_000_000), "The number of angles, both ends included."),
        ],
    ),
    (
        &section::SECTOR,
        &["from", "to"],
        &[
            key("from", Kind::Number, "The azimuth of the first column in degrees."),
            key("to", Kind::Number, "The azimuth where the sector ends in degrees: at most 360 from its start."),
        ],
    ),
    (
        &section::CHECK,
        &[],
        &[
            key("channels", Kind::Channels, "The channels that are compared; left out: all."),
            key("tolerance", Kind::Tolerances, "By channel, how far a pixel may be off: a number in the channel's unit, or a table."),
        ],
    ),
    (
        &section::TOLERANCE,
        &[],
        &[
            key("absolute", Kind::NotNegative, "In the channel's unit.").or("0.0"),
            key("relative", Kind::NotNegative, "As a part of the value.").or("0.0"),
            key("pixels", Kind::Share, "The part of the pixels that may be off by more.").or("0.0"),
        ],
    ),
    (
        &section::EXPECT,
        &["name"],
        &[
            key("name", Kind::Text, "What reports call the expectation."),
            key("sensor", Kind::Text, "The sensor that it is about; left out: all together."),
            key("points", Kind::Table(&section::EXPECT_POINTS), "How many points an object gets."),
            key("plane", Kind::Table(&section::EXPECT_PLANE), "How far points lie from a plane of the world."),
            key("resolution", Kind::Table(&section::EXPECT_RESOLUTION), "How far apart the points on an object are, seen from the sensor."),
            key("coverage", Kind::Table(&section::EXPECT_COVERAGE), "How much of a zone of ground around the body gets points."),
            key("blind_zone", Kind::Table(&section::EXPECT_BLIND_ZONE), "How far from the body the ground is first seen."),
            key("returns", Kind::Table(&section::EXPECT_RETURNS), "The part of the rays that return."),
            key("unobstructed", Kind::Table(&section::EXPECT_UNOBSTRUCTED), "How much of the field of view the vehicle's own body hides."),
            key("points_per_s", Kind::Table(&section::EXPECT_POINTS_PER_S), "Points a second."),
            key("speed", Kind::Table(&section::EXPECT_SPEED), "How fast the beams are cast on this machine."),
        ],
    ),
    (
        &section::EXPECT_POINTS,
        &[],
        &[
            OBJECT,
            LABEL,
            key("at_least", Kind::NotNegative, "Points, at least."),
            key("at_most", Kind::NotNegative, "Points, at most."),
            key("min_range_m", Kind::Number, "Counts those from this range on, in metres."),
            key("max_range_m", Kind::Positive, "Counts those up to this range, in metres."),
        ],
    ),
    (
        &section::EXPECT_PLANE,
        &["normal", "offset_m", "max_error_m"],
        &[
            OBJECT,
            LABEL,
            key("normal", Kind::Vector(3), "The plane's normal in the world; its length doesn't matter."),
            key("offset_m", Kind::Number, "The plane's distance from the world's origin along its normal, in metres."),
            key("max_error_m", Kind::Positive, "The largest distance of a point from the plane, in metres."),
        ],
    ),
    (
        &section::EXPECT_RESOLUTION,
        &[],
        &[
            OBJECT,
            LABEL,
            key("max_horizontal_deg", Kind::Positive, "The largest step between columns, in degrees."),
            key("max_vertical_deg", Kind::Positive, "The largest step between rows, in degrees."),
        ],
    ),
    (
        &section::EXPECT_COVERAGE,
        &["x_m", "y_m", "cell_m", "at_least"],
        &[
            OBJECT,
            LABEL,
            key("x_m", Kind::Vector(2), "The zone from and to, in the body's frame, in metres."),
            key("y_m", Kind::Vector(2), "The zone from and to, in the body's frame, in metres."),
            key("cell_m", Kind::Positive, "The side of a cell in metres."),
            key("at_least", Kind::Share, "The part of the cells that get a point, 0 to 1."),
            GROUND_Z,
            GROUND_TOLERANCE,
        ],
    ),
    (
        &section::EXPECT_BLIND_ZONE,
        &["at_most_m"],
        &[
            OBJECT,
            LABEL,
            key("at_most_m", Kind::Positive, "The largest distance from the body's origin in metres."),
            key("sector_deg", Kind::Table(&section::SECTOR), "The azimuths that count, counterclockwise; left out: all."),
            GROUND_Z,
            GROUND_TOLERANCE,
        ],
    ),
    (
        &section::EXPECT_RETURNS,
        &[],
        &[
            key("at_least", Kind::Share, "The part of the rays, at least, 0 to 1."),
            key("at_most", Kind::Share, "The part of the rays, at most, 0 to 1."),
        ],
    ),
    (
        &section::EXPECT_UNOBSTRUCTED,
        &[],
        &[OBJECT, LABEL, key("at_most", Kind::Share, "The part of the rays that may end on it, 0 to 1.").or("0.0")],
    ),
    (
        &section::EXPECT_POINTS_PER_S,
        &[],
        &[
            key("at_least", Kind::NotNegative, "Points a second, at least."),
            key("at_most", Kind::NotNegative, "Points a second, at most."),
        ],
    ),
    (
        &section::EXPECT_SPEED,
        &["at_least_rays_per_s"],
        &[key("at_least_rays_per_s", Kind::Positive, "Rays a second, at least.")],
    ),
];

const OBJECT: Key = key("object", Kind::Text, "Objects of this name; * stands for anything.");
const LABEL: Key = key("label", Kind::Integer(0, 0xffff_ffff), "Objects of this semantic label.");
const GROUND_Z: Key =
    key("ground_z_m", Kind::Number, "The ground's height in the body's frame, in metres.").or("0.0");
const GROUND_TOLERANCE: Key =
    key("ground_tolerance_m", Kind::Positive, "How far from that a point of the ground may be, in metres.");

const ROTATING: Key = key("rotating", Kind::Table(&section::ROTATING), "A LiDAR with a turning head.");
const RASTER: Key =
    key("raster", Kind::Table(&section::RASTER), "A grid of azimuths and elevations: line scans, flashes.");
const MIRROR: Key =
    key("mirror", Kind::Table(&section::MIRROR), "Beams on a mirror that moves about two axes.");
const RISLEY: Key = key("risley", Kind::Table(&section::RISLEY), "Beams through turning prisms.");
const RAYS: Key = key("rays", Kind::Table(&section::RAYS), "Rays from a table.");
const PINHOLE: Key = key("pinhole", Kind::Table(&section::PINHOLE), "A depth camera.");
const FISHEYE: Key = key("fisheye", Kind::Table(&section::FISHEYE), "A camera with a fisheye lens.");
const EQUIRECTANGULAR: Key =
    key("equirectangular", Kind::Table(&section::EQUIRECTANGULAR), "A spherical image, or a part of one.");
const BEAMS: Key = key(
    "beams_deg",
    Kind::Vectors(2),
    "Azimuth and elevation of each beam in degrees; left out: one straight ahead.",
);
const PULSE_RATE: Key = key("pulse_rate_hz", Kind::Positive, "Pulses of each beam a second.");
const FRAME_RATE: Key = key("rate_hz", Kind::Positive, "Frames a second.");
const WIDTH: Key = key("width_px", Kind::Integer(1, 1_000_000), "Columns of the image.");
const HEIGHT: Key = key("height_px", Kind::Integer(1, 1_000_000), "Rows of the image.");
const FX: Key = key("fx_px", Kind::Positive, "Horizontal focal length in pixels; instead of hfov_deg.");
const FY: Key = key("fy_px", Kind::Positive, "Vertical focal length in pixels; left out: fx_px.");
const CX: Key = key(
    "cx_px",
    Kind::Number,
    "Principal point; the centre of the top left pixel is at (0.5, 0.5). Left out: the image's middle.",
);
const CY: Key = key(
    "cy_px",
    Kind::Number,
    "Principal point; the centre of the top left pixel is at (0.5, 0.5). Left out: the image's middle.",
);
const RANGE: Key = key("range", Kind::Table(&section::RANGE), "What is nearer or farther gives no return.");
const RING: Key = key(
    "ring",
    Kind::Choice(&["row", "bottom_up", "file"]),
    "What a cloud's ring counts: the image's rows from the top, from the bottom, or the order of the beam table.",
)
.or("\"row\"");

/// The tables of a sensor of which one is its pattern.
const PATTERNS: &[&Shape] = &[
    &section::ROTATING,
    &section::RASTER,
    &section::MIRROR,
    &section::RISLEY,
    &section::RAYS,
    &section::PINHOLE,
    &section::FISHEYE,
    &section::EQUIRECTANGULAR,
];

/// Tables in those.
const PARTS: &[&Shape] = &[&section::AXIS, &section::SPACED, &section::SECTOR];

/// A table's properties. What it must have is left out for what a preset can give: the parts of a sensor.
fn table(shape: &Shape) -> Map<String, Value> {
    let (_, required, keys) = TABLES.iter().find(|(s, _, _)| *s == shape).expect("every shape has a table");
    let property = |name: &&'static str| {
        let key = keys.iter().find(|key| key.name == *name).expect("every key of a shape is in its table");
        let mut value = value_of(&key.kind);
        value.insert("description".into(), key.about.into());
        if let Some(default) = key.default {
            value.insert("default".into(), serde_json::from_str(default).expect("defaults are JSON"));
        }
        ((*name).to_owned(), Value::Object(value))
    };
    let properties: Map<String, Value> = shape.keys.iter().map(property).collect();
    let mut table = Map::new();
    table.insert("type".into(), "object".into());
    table.insert("properties".into(), properties.into());
    table.insert("additionalProperties".into(), false.into());
    if !required.is_empty() && !PATTERNS.contains(&shape) && !PARTS.contains(&shape) {
        table.insert("required".into(), json!(required));
    }
    if *shape == section::EXPECT {
        let kinds = shape.keys.iter().filter(|key| !["name", "sensor"].contains(key));
        table.insert("oneOf".into(), kinds.map(|kind| json!({ "required": [kind] })).collect());
    }
    if *shape == section::SENSOR {
        table.insert("if".into(), json!({ "not": { "required": ["preset"] } }));
        table.insert("then".into(), complete_sensor().into());
    }
    table
}

/// What holds of a sensor that has no preset: it has one pattern, and that has all it needs.
fn complete_sensor() -> Map<String, Value> {
    let whole = |pattern: &&Shape| {
        let (_, required, _) = TABLES.iter().find(|(s, _, _)| s == pattern).expect("every shape has a table");
        let name = pattern.title.trim_matches(['`', '[', ']']);
        json!({ "required": [name], "properties": { name: { "required": required } } })
    };
    Map::from_iter([("oneOf".to_owned(), PATTERNS.iter().map(whole).collect())])
}

fn value_of(kind: &Kind) -> Map<String, Value> {
    let value = match kind {
        Kind::Text => json!({ "type": "string", "minLength": 1 }),
        Kind::Name => {
            json!({ "type": "string", "pattern": "^[A-Za-z0-9_-]([A-Za-z0-9._-]{0,62}[A-Za-z0-9_-])?$" })
        }
        Kind::Flag => json!({ "type": "boolean" }),
        Kind::Choice(words) => json!({ "type": "string", "enum": words }),
        Kind::Choices(words) => json!({
            "type": "array", "items": { "type": "string", "enum": words }, "minItems": 1, "uniqueItems": true,
        }),
        Kind::Kernel => {
            let words: Vec<_> = ["exact"].into_iter().chain(METHODS.iter().map(|m| m.about.name)).collect();
            json!({ "type": "string", "enum": words })
        }
        Kind::Integer(least, most) => json!({ "type": "integer", "minimum": least, "maximum": most }),
        Kind::Number => json!({ "type": "number" }),
        Kind::Positive => json!({ "type": "number", "exclusiveMinimum": 0 }),
        Kind::NotNegative => json!({ "type": "number", "minimum": 0 }),
        Kind::Between(low, high) => {
            json!({ "type": "number", "exclusiveMinimum": low, "exclusiveMaximum": high })
        }
        Kind::Numbers => json!({ "type": "array", "items": { "type": "number" } }),
        Kind::Vector(n) => {
            json!({ "type": "array", "items": { "type": "number" }, "minItems": n, "maxItems": n })
        }
        Kind::Vectors(n) => json!({ "type": "array", "items": value_of(&Kind::Vector(*n)), "minItems": 1 }),
        Kind::VectorOrVectors(n) => {
            json!({ "anyOf": [value_of(&Kind::Vector(*n)), value_of(&Kind::Vectors(*n))] })
        }
        Kind::Angles => angles(json!({ "type": "number" })),
        Kind::Elevations => angles(json!({ "type": "number", "minimum": -90, "maximum": 90 })),
        Kind::Modes => json!({ "type": "object", "additionalProperties": table(&section::MODE) }),
        Kind::Labels => json!({
            "type": "object",
            "additionalProperties": { "type": "integer", "minimum": 0, "maximum": u32::MAX },
        }),
        Kind::Share => json!({ "type": "number", "minimum": 0, "maximum": 1 }),
        Kind::Channels => json!({
            "type": "array", "items": { "type": "string", "enum": CHANNEL_NAMES }, "minItems": 1, "uniqueItems": true,
        }),
        Kind::Tolerances => {
            let one = json!({ "anyOf": [{ "type": "number", "minimum": 0 }, table(&section::TOLERANCE)] });
            let all: Map<_, _> = CHANNEL_NAMES.iter().map(|name| ((*name).to_owned(), one.clone())).collect();
            json!({ "type": "object", "properties": all, "additionalProperties": false })
        }
        Kind::Table(shape) => Value::Object(table(shape)),
        Kind::Tables(shape, least) => json!({ "type": "array", "items": table(shape), "minItems": least }),
    };
    match value {
        Value::Object(value) => value,
        _ => unreachable!("each of them is an object"),
    }
}

fn angles(one: Value) -> Value {
    json!({ "anyOf": [{ "type": "array", "items": one, "minItems": 1 }, table(&section::SPACED)] })
}

#[cfg(test)]
mod tests {
    use super::super::section::SHAPES;
    use super::*;

    #[test]
    fn each_table_of_the_reader_is_told_with_all_its_keys_and_no_others() {
        for shape in SHAPES {
            let told: Vec<_> = TABLES.iter().filter(|(s, _, _)| *s == shape).collect();
            let [(_, required, keys)] = told[..] else {
                panic!("{} is told {} times", shape.title, told.len())
            };
            let names: Vec<_> = keys.iter().map(|key| key.name).collect();
            assert_eq!(names, shape.keys, "{}", shape.title);
            assert!(required.iter().all(|key| names.contains(key)), "{}", shape.title);
            assert!(keys.iter().all(|key| key.about.ends_with('.')), "{}", shape.title);
        }
        assert_eq!(TABLES.len(), SHAPES.len());
    }

    #[test]
    fn the_files_for_editors_are_these() {
        for (name, document) in [("job", Document::Job), ("sensor", Document::Sensor)] {
            let path = format!("{}/configs/schema/{name}.json", env!("CARGO_MANIFEST_DIR"));
            let made = format!("{:#}\n", schema(document));
            let kept = std::fs::read_to_string(&path).unwrap_or_default();
            assert!(
                kept == made,
                "configs/schema/{name}.json: beamcast schema {name} > configs/schema/{name}.json"
            );
        }
    }
}
