//! The tables of a run: files with rows from every frame.

use crate::config::{Job, TruthSettings};
use crate::output::{BOXES, POSES, VISIBLE};

/// A table of a run: a file with rows from every frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Table {
    /// The pose of each frame's start.
    Poses,
    /// The boxes of objects.
    Boxes,
    /// The objects that are seen.
    Visible,
}

impl Table {
    /// The tables that a job asks for.
    pub fn of(job: &Job) -> Vec<Self> {
        let TruthSettings { poses, boxes, visible, .. } = job.truth;
        let asked = [(Self::Poses, poses), (Self::Boxes, boxes.is_some()), (Self::Visible, visible)];
        asked.into_iter().filter(|(_, is_asked)| *is_asked).map(|(table, _)| table).collect()
    }

    /// Every table.
    pub const ALL: [Self; 3] = [Self::Poses, Self::Boxes, Self::Visible];

    /// The file's name in the output folder.
    pub fn name(self) -> &'static str {
        match self {
            Self::Poses => POSES.0,
            Self::Boxes => BOXES,
            Self::Visible => VISIBLE,
        }
    }

    /// The table of that name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|table| table.name() == name)
    }

    /// The line before the first row.
    pub fn header(self) -> Option<&'static str> {
        (self == Self::Poses).then_some(POSES.1)
    }
}
