//! How a job wants a format to be written: the options of the format, and the channels that it chooses.

use std::collections::BTreeSet;
use std::sync::{Mutex, PoisonError};

use super::channel::{CHANNELS, ChannelSpec};
use crate::sensor::Sensor;

/// The declaration of an option of a format, which stands in the format's own file. A job gives it a value in the format's
/// table: `{ format = "depth16", scale = 5000 }`.
#[derive(Clone, Copy, Debug)]
pub struct OptionSpec {
    /// The name in a job.
    pub name: &'static str,
    /// The meaning of the value, in sentences.
    pub about: &'static str,
    /// The values that are right, and the one that stands for an option that is left out.
    pub values: OptionValues,
}

/// The values that an option may have.
#[derive(Clone, Copy, Debug)]
pub enum OptionValues {
    /// A number within bounds, both included.
    Number {
        /// The least.
        least: f64,
        /// The largest.
        most: f64,
        /// The value of an option that is left out.
        default: f64,
    },
    /// One of a few whole numbers.
    OneOf {
        /// The numbers.
        numbers: &'static [u32],
        /// The value of an option that is left out.
        default: u32,
    },
    /// `true` or `false`. As a number, a flag that is set is 1.
    Flag {
        /// The value of an option that is left out.
        default: bool,
    },
    /// One of a few words.
    Word {
        /// The words.
        words: &'static [&'static str],
        /// The value of an option that is left out.
        default: &'static str,
    },
    /// Any text of one line or more.
    Text {
        /// The value of an option that is left out.
        default: &'static str,
    },
}

/// The value of an option.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum OptionValue {
    /// A number, or a flag.
    Number(f64),
    /// A word, or a text.
    Text(&'static str),
}

impl OptionValue {
    /// A text that a job gives. Texts are kept for as long as the program runs, each of them once, so that settings stay small
    /// values that are copied.
    pub fn text(text: &str) -> Self {
        static KEPT: Mutex<BTreeSet<&'static str>> = Mutex::new(BTreeSet::new());
        let mut kept = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = kept.get(text) {
            return Self::Text(known);
        }
        let text: &'static str = Box::leak(text.into());
        kept.insert(text);
        Self::Text(text)
    }
}

impl From<f64> for OptionValue {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

impl OptionValues {
    /// The value of an option that is left out.
    pub fn default_value(&self) -> OptionValue {
        match *self {
            Self::Number { default, .. } => default.into(),
            Self::OneOf { default, .. } => f64::from(default).into(),
            Self::Flag { default } => f64::from(u8::from(default)).into(),
            Self::Word { default, .. } | Self::Text { default } => OptionValue::Text(default),
        }
    }
}

/// The most options that a format has.
pub(super) const MOST_OPTIONS: usize = 24;

/// A job's settings of one of its formats: the values of the format's options, and the channels.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// The options that the format declares.
    of: &'static [OptionSpec],
    /// The values that were given, in the order of the declarations.
    given: [Option<OptionValue>; MOST_OPTIONS],
    /// The channels that were chosen. They concern formats that hold channels.
    pub channels: Channels,
}

impl Options {
    /// All options left out, and the usual channels.
    pub(super) const fn none(of: &'static [OptionSpec]) -> Self {
        Self { of, given: [None; MOST_OPTIONS], channels: Channels::USUAL }
    }

    /// The value that was given for an option. `None` if it is left out.
    pub fn given(&self, option: &OptionSpec) -> Option<OptionValue> {
        self.given[self.index(option)]
    }

    fn value(&self, option: &OptionSpec) -> OptionValue {
        self.given(option).unwrap_or(option.values.default_value())
    }

    /// The value of an option of numbers, given or not.
    pub fn number(&self, option: &OptionSpec) -> f64 {
        match self.value(option) {
            OptionValue::Number(number) => number,
            OptionValue::Text(_) => panic!("the option {} has texts", option.name),
        }
    }

    /// The value of an option of words or texts, given or not.
    pub fn text(&self, option: &OptionSpec) -> &'static str {
        match self.value(option) {
            OptionValue::Text(text) => text,
            OptionValue::Number(_) => panic!("the option {} has numbers", option.name),
        }
    }

    /// Whether a flag is set.
    pub fn is_set(&self, option: &OptionSpec) -> bool {
        self.number(option) != 0.0
    }

    /// Gives an option a value, which is one of the right ones.
    pub fn set(&mut self, option: &OptionSpec, value: impl Into<OptionValue>) {
        self.given[self.index(option)] = Some(value.into());
    }

    fn index(&self, option: &OptionSpec) -> usize {
        let place = self.of.iter().position(|known| known.name == option.name);
        place.unwrap_or_else(|| panic!("the format does not declare the option {}", option.name))
    }
}

/// Some of [`CHANNELS`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Channels(u64);

impl Channels {
    /// The channels of a job that chooses none: all but those that have to be chosen by name.
    pub const USUAL: Self = {
        let (mut usual, mut index) = (0, 0);
        while index < CHANNELS.len() {
            usual |= (!CHANNELS[index].is_chosen as u64) << index;
            index += 1;
        }
        Self(usual)
    };

    /// The channels of these names. A name that no channel has chooses nothing.
    pub fn named<'n>(names: impl IntoIterator<Item = &'n str>) -> Self {
        let bit = |name: &str| CHANNELS.iter().position(|channel| channel.name == name).map_or(0, |i| 1 << i);
        Self(names.into_iter().map(bit).fold(0, |all, bit| all | bit))
    }

    /// These channels and others.
    pub(super) fn and(self, others: Self) -> Self {
        Self(self.0 | others.0)
    }

    /// The chosen channels that a sensor has, sorted by name.
    pub fn of<'s>(self, sensor: &'s Sensor) -> impl Iterator<Item = &'static ChannelSpec> + use<'s> {
        self.iter().filter(|channel| channel.is_of(sensor))
    }

    /// The channels, sorted by name.
    pub fn iter(self) -> impl Iterator<Item = &'static ChannelSpec> {
        (0..).zip(&CHANNELS).filter(move |(i, _)| self.0 & (1 << i) != 0).map(|(_, channel)| channel)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn channels_are_chosen_by_name() {
        let names = |channels: Channels| channels.iter().map(|channel| channel.name).collect::<Vec<_>>();
        assert!(
            names(Channels::USUAL).iter().all(|name| !name.contains("velocity") && !name.contains("track"))
        );
        assert_eq!(names(Channels::USUAL).len(), 13);
        assert_eq!(names(Channels::named(["range", "Z"])), ["Z", "range"]);
        assert_eq!(names(Channels::named(["nothing"])), [""; 0]);
    }

    #[test]
    fn an_option_that_is_left_out_has_its_default() {
        static OPTIONS: [OptionSpec; 3] = [
            OptionSpec {
                name: "bits",
                about: "",
                values: OptionValues::OneOf { numbers: &[8, 16], default: 16 },
            },
            OptionSpec { name: "palette", about: "", values: OptionValues::Flag { default: false } },
            OptionSpec { name: "crs", about: "", values: OptionValues::Text { default: "local" } },
        ];
        let mut options = Options::none(&OPTIONS);
        assert_eq!((options.given(&OPTIONS[0]), options.number(&OPTIONS[0])), (None, 16.0));
        options.set(&OPTIONS[1], 1.0);
        assert!(options.is_set(&OPTIONS[1]) && options.given(&OPTIONS[0]).is_none());
        assert_eq!(options.text(&OPTIONS[2]), "local");
        options.set(&OPTIONS[2], OptionValue::text("EPSG:25832"));
        assert_eq!(options.text(&OPTIONS[2]), "EPSG:25832");
    }
}
