//! The kinds of values that keys have.

mod counts;
mod formats;
mod lists;
mod number;
mod object;
mod tables;
mod text;

pub(crate) use counts::{NumberChoice, WordOrCount};
pub(crate) use formats::Formats;
pub(crate) use lists::{List, Matrix, OneOrEach, OneOrMany, Scalars, Vector};
pub(crate) use number::{Flag, Integer, Number};
pub(crate) use tables::{ByName, Names, Nested, NumberOr, NumberOrTable, Tables};
pub(crate) use text::{Choice, Choices, FolderName, Text};
