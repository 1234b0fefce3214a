//! The result of measuring an expected property.

use crate::check::outcome::Sight;

/// The result of measuring an expected property.
pub(super) enum Finding {
    Measured {
        met: bool,
        found: String,
        place: String,
        sights: Vec<Sight>,
    },
    /// There is nothing to measure. The text says why.
    Nothing(String),
}

impl Finding {
    pub(super) fn new(met: bool, found: impl Into<String>, place: impl Into<String>) -> Self {
        Self::Measured { met, found: found.into(), place: place.into(), sights: Vec::new() }
    }

    /// Adds what shows the finding.
    pub(super) fn shown_by(mut self, shown: impl IntoIterator<Item = Sight>) -> Self {
        if let Self::Measured { sights, .. } = &mut self {
            sights.extend(shown);
        }
        self
    }
}
