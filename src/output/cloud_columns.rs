//! The fields and the comments of recorded clouds, as files have them.

use super::recorded::{Cloud, Number};

/// A field with the name and the type that a file has of it.
#[derive(Clone, Debug)]
pub(super) struct Column<'c> {
    pub name: String,
    pub number: Number,
    pub values: &'c [f64],
}

/// The types that PCD has, and LAS.
pub(super) fn of_pcd(number: Number) -> Number {
    match number {
        Number::Bool => Number::U8,
        Number::F16 => Number::F32,
        other => other,
    }
}

/// The comments, each as one line.
pub(super) fn lines_of(cloud: &Cloud) -> impl Iterator<Item = String> {
    cloud.comments.iter().map(|comment| comment.split(['\n', '\r']).collect::<Vec<_>>().join(" "))
}
