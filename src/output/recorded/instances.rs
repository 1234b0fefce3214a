//! The names of instances that a manifest or a header lists.

use std::collections::{BTreeMap, BTreeSet};

/// The names of instances, in runs of ids that have the same name.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct InstanceNames(
    /// The first and the last id of each run, and its name, in the order of the first.
    Vec<(u32, u32, String)>,
);

impl InstanceNames {
    /// Names by runs of ids, in any order.
    pub(super) fn new(mut runs: Vec<(u32, u32, String)>) -> Self {
        runs.sort_by_key(|(first, ..)| *first);
        Self(runs)
    }

    /// The name of an instance, by its id.
    pub fn get(&self, id: u32) -> Option<&str> {
        let after = self.0.partition_point(|(first, ..)| *first <= id);
        let (_, last, name) = self.0[..after].last()?;
        (id <= *last).then_some(name.as_str())
    }

    /// The number of instances.
    pub fn count(&self) -> u64 {
        self.0.iter().map(|(first, last, _)| (u64::from(*last) + 1).saturating_sub(u64::from(*first))).sum()
    }

    /// The names of those ids.
    pub fn of(&self, ids: impl IntoIterator<Item = u32>) -> BTreeMap<u32, String> {
        let ids: BTreeSet<u32> = ids.into_iter().collect();
        ids.into_iter().filter_map(|id| Some((id, self.get(id)?.to_owned()))).collect()
    }
}

impl FromIterator<(u32, String)> for InstanceNames {
    fn from_iter<T: IntoIterator<Item = (u32, String)>>(names: T) -> Self {
        Self::new(names.into_iter().map(|(id, name)| (id, id, name)).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_found_in_runs_of_any_order() {
        let run = |first, last, name: &str| (first, last, name.to_owned());
        let names = InstanceNames::new(vec![run(5, u32::MAX, "leaf"), run(1, 1, "floor"), run(2, 3, "wall")]);
        let found = [0, 1, 2, 3, 4, 5, 4_000_000_000].map(|id| names.get(id));
        let expected = [None, Some("floor"), Some("wall"), Some("wall"), None, Some("leaf"), Some("leaf")];
        assert_eq!(found, expected);
        assert_eq!(names.of([9, 2, 4, 9]).len(), 2);
        assert_eq!(names.count(), 3 + u64::from(u32::MAX) - 4);
        // A run that ends before it begins is nobody's.
        let hostile = InstanceNames::new(vec![run(7, 2, "x")]);
        assert_eq!((hostile.get(7), hostile.get(2), hostile.count()), (None, None, 0));
    }
}
