//! The names behind the ids of a frame, for the headers of files: a reader then needs neither the job nor the manifest.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::{Map, Value};

use super::id::id_of;
use super::json::json_ascii;
use crate::scan::{Cause, Frame};
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
    /// Objects and labels are mostly fewer, so that a bit for each number tells whether it was seen.
    const FEW: usize = 1 << 16;
    /// Slots that are compared at once.
    const RUN: usize = 64;
    let mut is_seen = vec![0_u64; FEW / 64];
    let (mut others, mut last) = (BTreeSet::new(), None);
    let mut see = |number: u32| {
        // Neighbours mostly show the same.
        if last != Some(number) {
            last = Some(number);
            match is_seen.get_mut(number as usize / 64) {
                Some(bits) => *bits |= 1 << (number % 64),
                None => _ = others.insert(number),
            }
        }
    };
    match frame.causes_of_own_slots() {
        Some(causes) => {
            let mut before = None;
            for (causes, numbers) in causes.chunks(RUN).zip(column.chunks(RUN)) {
                // A run of slots that have the number of a return before them has no other, whichever of them are returns.
                let is_like = |seen: u32| numbers.iter().fold(0, |bits, number| bits | (number ^ seen)) == 0;
                if before.is_some_and(is_like) {
                    continue;
                }
                for (_, &number) in causes.iter().zip(numbers).filter(|(cause, _)| **cause == Cause::Surface)
                {
                    see(number);
                    before = Some(number);
                }
            }
        }
        None => frame.each_slot(|slot| see(column[slot])),
    }
    let of_bits = |(word, bits): (u32, u64)| {
        (0..64).filter(move |bit| bits >> bit & 1 == 1).map(move |bit| 64 * word + bit)
    };
    let few = (0..).zip(is_seen).filter(|(_, bits)| *bits != 0).flat_map(of_bits);
    few.chain(others).collect()
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
    use crate::scan::Return;

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

    /// Numbers that are few and numbers that are large are found alike, each once and in order.
    #[test]
    fn small_and_large_numbers_are_found() {
        let shown = [65_536, 63, 7, 7, u32::MAX, 64, 65_535, 0, 65_536, 70_000, 7];
        let frame = frame_of(&shown);
        assert_eq!(numbers(&frame, &frame.returns().instance), BTreeSet::from(shown));
    }

    /// Long runs of a number are passed over, and slots that are no returns show nothing.
    #[test]
    fn runs_of_slots_show_the_numbers_of_their_returns() {
        let number = |i: usize| [7, 0, 9, 9, 7, 1 << 20, 3][i / 150];
        let pixel = |i: usize| {
            let cause = if (150..300).contains(&i) || i == 1049 { Cause::TooNear } else { Cause::Surface };
            let instance = if i == 1049 { 5 } else { number(i) };
            (cause, Return { instance, ..Return::default() })
        };
        let frame = Frame::of_own_slots(3, 350, &(0..1050).map(pixel).collect::<Vec<_>>());
        assert_eq!(numbers(&frame, &frame.returns().instance), BTreeSet::from([3, 7, 9, 1 << 20]));
    }

    #[test]
    fn other_texts_name_nothing() {
        for text in ["", "[]", "{\"a\": \"b\", \"-1\": \"c\", \"2\": 3}", "\u{0}", "{\"99999999999\": \"x\"}"]
        {
            assert_eq!(read_names(text), BTreeMap::new(), "{text:?}");
        }
    }
}
