//! The names behind the ids of a frame, for the headers of files: a reader then needs neither the job nor the manifest.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::{Map, Value};

use super::id::id_of;
use super::json::json_ascii;
use crate::scan::Frame;
use crate::scene::{Object, label_names};

/// The names that ids and labels of a frame may have. Without names, headers name nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Names<'a> {
    /// The scene's objects, by index.
    pub objects: &'a [Object],
    /// The job's labels by name. Several names may have the same label.
    pub labels: Option<&'a BTreeMap<String, u32>>,
}

/// The most bytes that the names of a header's instances take, and those of its labels. A frame of a large scene shows a few
/// hundred objects, which take some kilobytes.
const MOST_BYTES: usize = 16 << 10;

/// The longest name in a header, in characters. With every character escaped, a line of a PLY's header stays below the 1024
/// bytes that some readers have room for.
const MOST_CHARACTERS: usize = 80;

/// The names of the numbers that a frame shows.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Named {
    /// The names by number, in ascending order, each as JSON in ASCII: a text, or a list of texts.
    pub names: Vec<(u32, String)>,
    /// How many numbers have a name that there was no room for.
    pub left_out: usize,
}

impl Names<'_> {
    /// The names of the instances that a frame shows, by their ids.
    pub(super) fn instances(&self, frame: &Frame) -> Named {
        let name = |index: &u32| {
            let name = &self.objects.get(*index as usize)?.name;
            (!name.is_empty()).then(|| (id_of(*index), Value::from(shortened(name))))
        };
        Named::of(numbers(frame, &frame.returns().instance).iter().filter_map(name))
    }

    /// The names of the labels that a frame shows.
    pub(super) fn labels(&self, frame: &Frame) -> Named {
        let mut by_label: BTreeMap<u32, Vec<Value>> = BTreeMap::new();
        for (name, label) in self.labels.into_iter().flatten() {
            by_label.entry(*label).or_default().push(shortened(name).into());
        }
        let shown = numbers(frame, &frame.returns().label);
        by_label.retain(|label, _| shown.contains(label));
        Named::of(by_label.into_iter().map(|(label, names)| (label, Value::Array(names))))
    }
}

impl Named {
    fn of(names: impl Iterator<Item = (u32, Value)>) -> Self {
        let (mut named, mut bytes) = (Self::default(), 0);
        for (number, name) in names {
            let name = json_ascii(&name);
            bytes += name.len() + number.to_string().len();
            if bytes > MOST_BYTES {
                named.left_out += 1;
            } else {
                named.names.push((number, name));
            }
        }
        named
    }

    /// The names as one JSON object in ASCII. `None` if there are none.
    pub(super) fn to_json(&self) -> Option<String> {
        let pair = |(number, name): &(u32, String)| format!("\"{number}\": {name}");
        let pairs: Vec<String> = self.names.iter().map(pair).collect();
        (!pairs.is_empty()).then(|| format!("{{{}}}", pairs.join(", ")))
    }
}

/// The numbers that the returns of a frame have in a column.
fn numbers(frame: &Frame, column: &[u32]) -> BTreeSet<u32> {
    let (mut numbers, mut last) = (BTreeSet::new(), None);
    frame.each_slot(|slot| {
        // Neighbours mostly show the same.
        if last != Some(column[slot]) {
            last = Some(column[slot]);
            numbers.insert(column[slot]);
        }
    });
    numbers
}

fn shortened(name: &str) -> String {
    match name.char_indices().nth(MOST_CHARACTERS) {
        Some((end, _)) => format!("{}…", &name[..end]),
        None => name.to_owned(),
    }
}

/// The names of instances in a header's JSON object, which another program may have written.
pub(super) fn read_names(text: &str) -> BTreeMap<u32, String> {
    let names: Map<String, Value> = serde_json::from_str(text).unwrap_or_default();
    let name = |(number, name): (String, Value)| Some((number.parse().ok()?, name.as_str()?.to_owned()));
    names.into_iter().filter_map(name).collect()
}

/// The meaning of labels, in words, from the lists of names that a header has for them.
pub(super) fn words_of_labels(listed: &[(u32, Vec<String>)]) -> BTreeMap<u32, String> {
    let pairs = listed.iter().flat_map(|(label, names)| names.iter().map(|name| (name.as_str(), *label)));
    label_names(pairs, std::iter::empty())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scan::{Cause, Return};

    fn frame_of(instances: &[u32]) -> Frame {
        let returns: Vec<[Return; 1]> = instances
            .iter()
            .map(|&instance| [Return { instance, label: instance % 3, ..Return::default() }])
            .collect();
        let pixels = returns.iter().map(|one| (Cause::Surface, one.as_slice()));
        Frame::from_pixels(1, instances.len(), pixels)
    }

    fn objects(count: usize, name: impl Fn(usize) -> String) -> Vec<Object> {
        (0..count).map(|i| Object { name: name(i), ..Object::default() }).collect()
    }

    #[test]
    fn what_is_seen_is_named_by_its_id() {
        let objects = objects(5, |i| ["floor", "", "wäll", "unseen", "x"][i].to_owned());
        let labels =
            BTreeMap::from([("car", 1), ("van", 1), ("road", 2), ("sky", 9)].map(|(n, l)| (n.to_owned(), l)));
        let names = Names { objects: &objects, labels: Some(&labels) };
        let frame = frame_of(&[4, 2, 2, 0, 1, 4]);
        let instances = names.instances(&frame).to_json().unwrap();
        assert_eq!(instances, "{\"1\": \"floor\", \"3\": \"w\\u00e4ll\", \"5\": \"x\"}");
        assert_eq!(read_names(&instances)[&3], "wäll");
        assert_eq!(names.labels(&frame).to_json().unwrap(), "{\"1\": [\"car\",\"van\"], \"2\": [\"road\"]}");
        assert_eq!(Names::default().instances(&frame).to_json(), None);
    }

    /// A frame that shows 100,000 objects has no more names in its header than fit, and says how many are left out.
    #[test]
    fn very_many_names_are_bounded() {
        let objects = objects(100_000, |i| format!("object {i} {}", "ü".repeat(500)));
        let shown: Vec<u32> = (0..100_000).collect();
        let named = Names { objects: &objects, labels: None }.instances(&frame_of(&shown));
        assert_eq!(named.names.len() + named.left_out, 100_000);
        assert!(named.names.len() > 20 && named.to_json().unwrap().len() < 2 * MOST_BYTES);
        assert!(named.names.iter().all(|(_, name)| name.is_ascii() && name.len() < 600));
        assert!(read_names(&named.to_json().unwrap())[&1].ends_with("ü…"));
    }

    #[test]
    fn other_texts_name_nothing() {
        for text in ["", "[]", "{\"a\": \"b\", \"-1\": \"c\", \"2\": 3}", "\u{0}", "{\"99999999999\": \"x\"}"]
        {
            assert_eq!(read_names(text), BTreeMap::new(), "{text:?}");
        }
    }
}
