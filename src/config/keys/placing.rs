//! The keys of places that are drawn for actors.

use std::ops::Bound::Included;

use super::super::kinds::{Integer, Nested, Number, Text, Vector};
use super::super::table::{Key, TableKeys, key, table};
use super::random::PER;

/// A distance that is no larger than things are.
const DISTANCE: Number = Number::within(Included(0.0), Included(1000.0));

pub(crate) static PLACE: Key<Nested> = key(
    "place",
    Nested(&PLACE_KEYS),
    "Instead of a trajectory: a place that is drawn on a surface of the scene, where a thing with a file of its own stands and meets nothing.",
)
.replaces(&["trajectory"]);
pub(crate) static PLACE_KEYS: TableKeys =
    table("`place` of an actor", &[&ON, &ON_LABEL, &PLACE_X, &PLACE_Y, &YAW, &CLEARANCE, &LIFT, &PER])
        .one_of(&[&ON, &ON_LABEL]);
pub(crate) static ON: Key<Text> = key(
    "on",
    Text,
    "The surface: objects or materials of this name (a * at its end stands for anything), or else what has the label that [labels] gives this name. What faces up and rises by at most 45 degrees counts.",
)
.replaces(&["on_label"]);
pub(crate) static ON_LABEL: Key<Integer<u32>> = key(
    "on_label",
    Integer::within(0, u32::MAX as u64),
    "The surface, instead of `on`: everything with this semantic label.",
)
.replaces(&["on"]);
pub(crate) static PLACE_X: Key<Vector<2>> = key(
    "x_m",
    Vector("from, to"),
    "The part of the surface from and to, in the world, in metres; left out: all.",
);
pub(crate) static PLACE_Y: Key<Vector<2>> = key(
    "y_m",
    Vector("from, to"),
    "The part of the surface from and to, in the world, in metres; left out: all.",
);
pub(crate) static YAW: Key<Vector<2>> = key(
    "yaw_deg",
    Vector("the least and the most"),
    "Which way it faces: every yaw between the two is as likely.",
)
.or("[0.0, 360.0]");
pub(crate) static CLEARANCE: Key<Number> = key(
    "clearance_m",
    DISTANCE,
    "The least distance from its box to the scene and to the boxes of other actors, in metres.",
)
.or("0.0");
pub(crate) static LIFT: Key<Number> = key(
    "lift_m",
    DISTANCE,
    "The height above its origin up to which nothing counts as met, because it stands on the surface; more where the surface slopes or is uneven.",
)
.or("0.05");
