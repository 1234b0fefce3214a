//! The keys of a job's `[[expect]]`.

use super::super::kinds::{Choice, Integer, Nested, Number, Text, Vector};
use super::super::table::{AnyKey, Key, TableKeys, key, table};
use super::limits::MAX_FRAMES;
use crate::scan::Cause;

pub(crate) static EXPECT: TableKeys = table(
    "`[[expect]]`",
    &[
        &NAME,
        &SENSOR,
        &FRAMES,
        &MIN_FRAMES,
        &SEEN_BY,
        &MAX_FLICKER,
        &POINTS,
        &PLANE,
        &RESOLUTION,
        &COVERAGE,
        &BLIND_ZONE,
        &RETURNS,
        &UNOBSTRUCTED,
        &POINTS_PER_S,
        &DETECTION,
        &FALSE_ALARMS,
        &CAUSE_SHARE,
        &SPEED,
    ],
)
.one_of(SUBJECTS);
pub(crate) static NAME: Key<Text> = key("name", Text, "What reports call the expectation.")
    .required("`name = \"the pedestrian is seen\"`, which reports call it by");
pub(crate) static SENSOR: Key<Text> =
    key("sensor", Text, "The sensor that it is about; left out: all together.");
pub(crate) static FRAMES: Key<Nested> = key(
    "frames",
    Nested(&frames::KEYS),
    "Of a sequence, the frames that it looks at; left out: all. Without `min_frames`, `seen_by_s` and `max_flicker` it must be met in each of them.",
);
pub(crate) static MIN_FRAMES: Key<Integer<u64>> = key(
    "min_frames",
    Integer::within(1, MAX_FRAMES),
    "It must be met in at least so many of the frames, instead of in each.",
);
pub(crate) static SEEN_BY: Key<Number> = key(
    "seen_by_s",
    Number::NOT_NEGATIVE,
    "It must first be met in a frame that starts so many seconds after the first of the frames, or earlier.",
);
pub(crate) static MAX_FLICKER: Key<Integer<u64>> = key(
    "max_flicker",
    Integer::within(0, MAX_FRAMES),
    "It may change so often, from met to not met and back, from one of the frames to the next.",
);

pub(crate) mod frames {
    use super::*;

    pub static KEYS: TableKeys = table("`frames` of `[[expect]]`", &[&FROM, &TO]);
    pub static FROM: Key<Integer<u64>> =
        key("from", Integer::within(0, MAX_FRAMES), "The first frame, counted from 0.").or("0");
    pub static TO: Key<Integer<u64>> =
        key("to", Integer::within(0, MAX_FRAMES), "The last frame; left out: that of the sequence.");
}

/// The tables of an expectation, of which it has one.
pub(crate) const SUBJECTS: &[&dyn AnyKey] = &[
    &POINTS,
    &PLANE,
    &RESOLUTION,
    &COVERAGE,
    &BLIND_ZONE,
    &RETURNS,
    &UNOBSTRUCTED,
    &POINTS_PER_S,
    &DETECTION,
    &FALSE_ALARMS,
    &CAUSE_SHARE,
    &SPEED,
];
pub(crate) static POINTS: Key<Nested> =
    key("points", Nested(&points::KEYS), "How many points an object gets.");
pub(crate) static PLANE: Key<Nested> =
    key("plane", Nested(&plane::KEYS), "How far points lie from a plane of the world.");
pub(crate) static RESOLUTION: Key<Nested> = key(
    "resolution",
    Nested(&resolution::KEYS),
    "How far apart the points on an object are, seen from the sensor.",
);
pub(crate) static COVERAGE: Key<Nested> =
    key("coverage", Nested(&coverage::KEYS), "How much of a zone of ground around the body gets points.");
pub(crate) static BLIND_ZONE: Key<Nested> =
    key("blind_zone", Nested(&blind_zone::KEYS), "How far from the body the ground is first seen.");
pub(crate) static RETURNS: Key<Nested> =
    key("returns", Nested(&returns::KEYS), "The part of the rays that return.");
pub(crate) static UNOBSTRUCTED: Key<Nested> = key(
    "unobstructed",
    Nested(&unobstructed::KEYS),
    "How much of the field of view the vehicle's own body hides.",
);
pub(crate) static POINTS_PER_S: Key<Nested> =
    key("points_per_s", Nested(&points_per_s::KEYS), "Points a second.");
pub(crate) static DETECTION: Key<Nested> = key(
    "detection",
    Nested(&detection::KEYS),
    "The part of the pulses at an object that it returns: of those that meet it first in an ideal scan of the same frame.",
);
pub(crate) static FALSE_ALARMS: Key<Nested> = key(
    "false_alarms",
    Nested(&false_alarms::KEYS),
    "How many returns of a frame no light of the sensor makes: false alarms and interference.",
);
pub(crate) static CAUSE_SHARE: Key<Nested> =
    key("cause_share", Nested(&cause_share::KEYS), "The part of a frame's returns that have a cause.");
pub(crate) static SPEED: Key<Nested> =
    key("speed", Nested(&speed::KEYS), "How fast the beams are cast on this machine.");

/// Keys of several subjects.
pub(crate) static OBJECT: Key<Text> = key("object", Text, "Objects of this name; * stands for anything.");
pub(crate) static LABEL: Key<Integer<u32>> =
    key("label", Integer::within(0, u32::MAX as u64), "Objects of this semantic label.");
pub(crate) static GROUND_Z: Key<Number> =
    key("ground_z_m", Number::ANY, "The ground's height in the body's frame, in metres.").or("0.0");
pub(crate) static GROUND_TOLERANCE: Key<Number> =
    key("ground_tolerance_m", Number::POSITIVE, "How far from that a point of the ground may be, in metres.")
        .or("0.2");

pub(crate) mod points {
    use super::*;

    pub static KEYS: TableKeys =
        table("`points`", &[&OBJECT, &LABEL, &AT_LEAST, &AT_MOST, &MIN_RANGE, &MAX_RANGE]);
    pub static AT_LEAST: Key<Number> = key("at_least", Number::NOT_NEGATIVE, "Points, at least.");
    pub static AT_MOST: Key<Number> = key("at_most", Number::NOT_NEGATIVE, "Points, at most.");
    pub static MIN_RANGE: Key<Number> =
        key("min_range_m", Number::ANY, "Counts those from this range on, in metres.");
    pub static MAX_RANGE: Key<Number> =
        key("max_range_m", Number::POSITIVE, "Counts those up to this range, in metres.");
}

pub(crate) mod plane {
    use super::*;

    pub static KEYS: TableKeys = table("`plane`", &[&OBJECT, &LABEL, &NORMAL, &OFFSET, &MAX_ERROR]);
    pub static NORMAL: Key<Vector<3>> =
        key("normal", Vector("x, y, z"), "The plane's normal in the world; its length doesn't matter.")
            .required("`normal = [0.0, 0.0, 1.0]`, in the world");
    pub static OFFSET: Key<Number> = key(
        "offset_m",
        Number::ANY,
        "The plane's distance from the world's origin along its normal, in metres.",
    )
    .required("`offset_m = 0.0`, the plane's distance from the world's origin along `normal`");
    pub static MAX_ERROR: Key<Number> =
        key("max_error_m", Number::POSITIVE, "The largest distance of a point from the plane, in metres.")
            .required("`max_error_m = 0.001`");
}

pub(crate) mod resolution {
    use super::*;

    pub static KEYS: TableKeys = table("`resolution`", &[&OBJECT, &LABEL, &MAX_HORIZONTAL, &MAX_VERTICAL]);
    pub static MAX_HORIZONTAL: Key<Number> =
        key("max_horizontal_deg", Number::POSITIVE, "The largest step between columns, in degrees.");
    pub static MAX_VERTICAL: Key<Number> =
        key("max_vertical_deg", Number::POSITIVE, "The largest step between rows, in degrees.");
}

pub(crate) mod coverage {
    use super::*;

    pub static KEYS: TableKeys =
        table("`coverage`", &[&OBJECT, &LABEL, &X, &Y, &CELL, &AT_LEAST, &GROUND_Z, &GROUND_TOLERANCE]);
    pub static X: Key<Vector<2>> =
        key("x_m", Vector("from, to"), "The zone from and to, in the body's frame, in metres.")
            .required("`x_m = [-10.0, 10.0]`, from and to, in the body's frame");
    pub static Y: Key<Vector<2>> =
        key("y_m", Vector("from, to"), "The zone from and to, in the body's frame, in metres.")
            .required("`y_m = [-10.0, 10.0]`, from and to, in the body's frame");
    pub static CELL: Key<Number> = key("cell_m", Number::POSITIVE, "The side of a cell in metres.")
        .required("`cell_m = 0.5`, the side of a cell");
    pub static AT_LEAST: Key<Number> =
        key("at_least", Number::SHARE, "The part of the cells that get a point, 0 to 1.")
            .required("`at_least = 0.9`, the part of the cells");
}

pub(crate) mod blind_zone {
    use super::*;

    pub static KEYS: TableKeys =
        table("`blind_zone`", &[&OBJECT, &LABEL, &AT_MOST, &SECTOR, &GROUND_Z, &GROUND_TOLERANCE]);
    pub static AT_MOST: Key<Number> =
        key("at_most_m", Number::POSITIVE, "The largest distance from the body's origin in metres.")
            .required("`at_most_m = 5.0`, the distance from the body's origin");
    pub static SECTOR: Key<Nested> =
        key("sector_deg", Nested(&SECTOR_KEYS), "The azimuths that count, counterclockwise; left out: all.");

    pub static SECTOR_KEYS: TableKeys = table("`sector_deg` of `blind_zone`", &[&FROM, &TO]);
    pub static FROM: Key<Number> =
        key("from", Number::ANY, "The azimuth where the sector begins in degrees.")
            .required("`from = -60.0`, an azimuth in degrees");
    pub static TO: Key<Number> = key(
        "to",
        Number::ANY,
        "The azimuth where the sector ends in degrees, counterclockwise from its beginning.",
    )
    .required("`to = 60.0`, an azimuth in degrees, counter-clockwise from `from`");
}

pub(crate) mod returns {
    use super::*;

    pub static KEYS: TableKeys = table("`returns`", &[&AT_LEAST, &AT_MOST]);
    pub static AT_LEAST: Key<Number> =
        key("at_least", Number::SHARE, "The part of the rays, at least, 0 to 1.");
    pub static AT_MOST: Key<Number> = key("at_most", Number::SHARE, "The part of the rays, at most, 0 to 1.");
}

pub(crate) mod unobstructed {
    use super::*;

    pub static KEYS: TableKeys = table("`unobstructed`", &[&OBJECT, &LABEL, &AT_MOST]);
    pub static AT_MOST: Key<Number> =
        key("at_most", Number::SHARE, "The part of the rays that may end on it, 0 to 1.").or("0.0");
}

pub(crate) mod points_per_s {
    use super::*;

    pub static KEYS: TableKeys = table("`points_per_s`", &[&AT_LEAST, &AT_MOST]);
    pub static AT_LEAST: Key<Number> = key("at_least", Number::NOT_NEGATIVE, "Points a second, at least.");
    pub static AT_MOST: Key<Number> = key("at_most", Number::NOT_NEGATIVE, "Points a second, at most.");
}

pub(crate) mod detection {
    use super::*;

    pub static KEYS: TableKeys = table("`detection`", &[&OBJECT, &LABEL, &AT_LEAST, &AT_MOST]);
    pub static AT_LEAST: Key<Number> =
        key("at_least", Number::SHARE, "The part of the pulses, at least, 0 to 1.");
    pub static AT_MOST: Key<Number> =
        key("at_most", Number::SHARE, "The part of the pulses, at most, 0 to 1.");
}

pub(crate) mod false_alarms {
    use super::*;

    pub static KEYS: TableKeys = table("`false_alarms`", &[&AT_MOST]);
    pub static AT_MOST: Key<Number> =
        key("at_most", Number::NOT_NEGATIVE, "Such returns in a frame of each sensor, at most.")
            .required("`at_most = 20`, such returns in a frame");
}

pub(crate) mod cause_share {
    use super::*;

    pub static KEYS: TableKeys = table("`cause_share`", &[&CAUSE, &AT_LEAST, &AT_MOST]);
    /// The causes that returns have.
    pub static CAUSE: Key<Choice<Cause>> = key(
        "cause",
        Choice(&[
            ("surface", Cause::Surface),
            ("mixed", Cause::Mixed),
            ("mirror", Cause::Mirror),
            ("glass", Cause::Glass),
            ("false_alarm", Cause::FalseAlarm),
            ("interference", Cause::Interference),
            ("rain", Cause::Rain),
            ("snow", Cause::Snow),
            ("fog", Cause::Fog),
            ("dust", Cause::Dust),
            ("blooming", Cause::Blooming),
            ("crosstalk", Cause::Crosstalk),
        ]),
        "The cause of the returns that count.",
    )
    .required("`cause = \"mixed\"`, the cause of the returns that count");
    pub static AT_LEAST: Key<Number> =
        key("at_least", Number::SHARE, "The part of the returns, at least, 0 to 1.");
    pub static AT_MOST: Key<Number> =
        key("at_most", Number::SHARE, "The part of the returns, at most, 0 to 1.");
}

pub(crate) mod speed {
    use super::*;

    pub static KEYS: TableKeys = table("`speed`", &[&AT_LEAST]);
    pub static AT_LEAST: Key<Number> =
        key("at_least_rays_per_s", Number::POSITIVE, "Rays a second, at least.")
            .required("`at_least_rays_per_s = 1e6`");
}
