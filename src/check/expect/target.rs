//! Targets: the surfaces that an expectation is about.

use std::collections::{BTreeMap, BTreeSet};

use crate::scan::{NO_OBJECT, Return};
use crate::scene::Scene;
use crate::source::suggest::nearest;
use crate::source::words::{list, quoted};

/// A target that beams should hit.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Target {
    /// The name of an instance of the scene. A `*` at the end matches any continuation.
    pub object: Option<String>,
    /// A semantic label.
    pub label: Option<u32>,
}

/// The most names of objects that a message lists.
const MAX_LISTED: usize = 12;

impl Target {
    fn names(&self, name: &str) -> bool {
        self.object.as_ref().is_none_or(|object| match object.strip_suffix('*') {
            Some(start) => name.starts_with(start),
            None => name == object,
        })
    }

    /// Whether a surface of an object's name with a label is meant.
    pub(in super::super) fn is_of(&self, name: &str, label: u32) -> bool {
        self.label.is_none_or(|own| own == label) && self.names(name)
    }

    /// Whether a return is from the target. A return that no surface makes is from no object and has no label.
    pub(super) fn is_hit(&self, hit: &Return, scene: &Scene) -> bool {
        if hit.instance == NO_OBJECT {
            return *self == Self::default();
        }
        self.label.is_none_or(|label| label == hit.label)
            && (self.object.is_none() || self.names(&scene.geometry.objects[hit.instance as usize].name))
    }

    /// The problem that no surface of the scene has the target's label, if that is so. An expectation of nothing of a label is
    /// met then, so that this is no more than odd.
    pub(super) fn missing_label(&self, scene: &Scene) -> Option<String> {
        let label = self.label?;
        let labels = scene.labels();
        if labels.contains(&label) {
            return None;
        }
        let labels: Vec<String> = labels.iter().filter(|label| **label > 0).map(u32::to_string).collect();
        let help = match labels.len() {
            0 => "; it has none, and `[labels]` of the job gives them".to_owned(),
            1..=MAX_LISTED => format!("; it has {}", labels.join(", ")),
            _ => String::new(),
        };
        Some(format!("no surface of the scene has label {label}{help}"))
    }

    /// The problem that the scene has nothing of the target's name, if that is so.
    pub(super) fn missing(&self, scene: &Scene) -> Option<String> {
        let object = self.object.as_ref()?;
        if scene.geometry.objects.iter().any(|instance| self.names(&instance.name)) {
            return None;
        }
        let names: BTreeSet<&str> = scene
            .geometry
            .objects
            .iter()
            .map(|i| i.name.as_str())
            .filter(|n| !n.is_empty())
            .take(10_000)
            .collect();
        let help = match nearest(object, names.iter().copied()) {
            Some(near) => format!("; did you mean {}?", quoted(near)),
            None if names.len() <= MAX_LISTED => format!("; it has {}", list(names, "and")),
            None => String::new(),
        };
        Some(format!("the scene has no object {}{help}", quoted(object)))
    }

    /// The target in words: `"crate_3"`, `label 4 "pedestrian"`.
    pub(super) fn words(&self, labels: &BTreeMap<u32, String>) -> String {
        let label = |label: u32| match labels.get(&label) {
            Some(name) => format!("label {label} {name:?}"),
            None => format!("label {label}"),
        };
        match (&self.object, self.label) {
            (Some(object), Some(number)) => format!("{object:?} with {}", label(number)),
            (Some(object), None) => format!("{object:?}"),
            (None, Some(number)) => label(number),
            (None, None) => "anything".to_owned(),
        }
    }
}
