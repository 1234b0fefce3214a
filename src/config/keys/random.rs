//! The keys of `[random]`.

use super::super::kinds::{ByName, Choice, List, Names, Nested, Number, Scalars, Vector};
use super::super::table::{AnyKey, Key, TableKeys, key, table};

pub(crate) static RANDOM: Key<ByName<Nested>> = key(
    "random",
    ByName {
        of: Nested(&DISTRIBUTION),
        names: Names::Any("keys of the job"),
        example: "`[random]`, then `\"sensor.top.pose.position_m[2]\" = { uniform = [1.7, 1.9] }`",
    },
    "Values that are drawn at random: the key of each, as `--set` has it and in quotes, with its distribution.",
);

pub(crate) static DISTRIBUTION: TableKeys =
    table("a distribution", &[&UNIFORM, &LOG_UNIFORM, &NORMAL, &WITHIN, &INTEGER, &CHOICE, &WEIGHTS, &PER])
        .one_of(LAWS);
/// The keys of which a distribution has one.
pub(crate) const LAWS: &[&dyn AnyKey] = &[&UNIFORM, &LOG_UNIFORM, &NORMAL, &INTEGER, &CHOICE];
pub(crate) static UNIFORM: Key<Vector<2>> =
    key("uniform", Vector("the least and the most"), "Every number between the two is as likely.");
pub(crate) static LOG_UNIFORM: Key<Vector<2>> = key(
    "log_uniform",
    Vector("the least and the most, both greater than 0"),
    "The number's logarithm is uniform between those of the two: every factor is as likely.",
);
pub(crate) static NORMAL: Key<Vector<2>> = key(
    "normal",
    Vector("the mean and the standard deviation"),
    "The normal distribution, which is cut off at 8.58 standard deviations from its mean.",
);
pub(crate) static WITHIN: Key<Vector<2>> =
    key("within", Vector("the least and the most"), "With `normal`: a number beyond these is drawn again.");
pub(crate) static INTEGER: Key<Vector<2>> = key(
    "integer",
    Vector("the least and the most, both whole"),
    "Every whole number from the least to the most is as likely.",
);
pub(crate) static CHOICE: Key<Scalars> = key(
    "choice",
    Scalars,
    "One of these numbers, texts or flags; each is as likely, unless there are `weights`.",
);
pub(crate) static WEIGHTS: Key<List<Number>> = key(
    "weights",
    List { of: Number::NOT_NEGATIVE, least: 1 },
    "With `choice`: how likely each is, as a part of their sum.",
);
/// Whether all frames have the same value.
pub(crate) static PER: Key<Choice<bool>> = key(
    "per",
    Choice(&[("frame", false), ("run", true)]),
    "Whether each frame has a value of its own, or all frames have the same one, which follows from the seed.",
)
.or("\"frame\"");
