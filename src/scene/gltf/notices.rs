//! Gathers what is to be known of a file, kind by kind: a file with a million odd nodes gives one notice that counts them.

use std::cell::RefCell;

use crate::scene::notice::Notice;
use crate::source::Severity;
use crate::source::words::counted;

/// The most kinds of notices of one file, and the most places that a notice names.
const MOST_KINDS: usize = 60;
const MOST_PLACES: usize = 4;

/// The notices about a file, in the order in which their kinds were first met.
#[derive(Default)]
pub(super) struct Notices {
    kinds: RefCell<Vec<Kind>>,
}

struct Kind {
    severity: Severity,
    /// A sentence that is true of each of the places.
    message: String,
    help: Option<&'static str>,
    places: Vec<String>,
    count: u64,
}

impl Notices {
    /// Adds a warning that the file is perhaps not what was meant. The message is a sentence that is true of every place that
    /// it is given with, so it names no value of this one.
    pub fn warn(&self, place: impl FnOnce() -> String, message: impl AsRef<str>) {
        self.add(Severity::Warning, place, message.as_ref(), None);
    }

    /// Adds a note that a part of the file is of no use here, and a sentence about what to do if it matters.
    pub fn note(&self, place: impl FnOnce() -> String, message: impl AsRef<str>, help: Option<&'static str>) {
        self.add(Severity::Note, place, message.as_ref(), help);
    }

    fn add(
        &self,
        severity: Severity,
        place: impl FnOnce() -> String,
        message: &str,
        help: Option<&'static str>,
    ) {
        let mut kinds = self.kinds.borrow_mut();
        let known = kinds.iter().position(|kind| kind.severity == severity && kind.message == message);
        let at = match known {
            Some(at) => at,
            None if kinds.len() > MOST_KINDS => MOST_KINDS,
            None => {
                let is_last = kinds.len() == MOST_KINDS;
                let message = if is_last { "more was found than is listed here" } else { message };
                let message = message.to_owned();
                kinds.push(Kind { severity, message, help, places: Vec::new(), count: 0 });
                kinds.len() - 1
            }
        };
        let Some(kind) = kinds.get_mut(at) else { return };
        kind.count += 1;
        if kind.places.len() < MOST_PLACES {
            kind.places.push(place());
        }
    }

    /// The notices, each with its places.
    pub fn into_list(self) -> Vec<Notice> {
        self.kinds.into_inner().into_iter().map(Kind::into_notice).collect()
    }
}

impl Kind {
    fn into_notice(self) -> Notice {
        let Self { severity, message, help, places, count } = self;
        let place = match &places[..] {
            [first, others @ ..] if !others.is_empty() => {
                let more = if count > places.len() as u64 { ", …" } else { "" };
                format!("{first} and {} ({}{more})", counted(count - 1, "other"), others.join(", "))
            }
            _ => places.concat(),
        };
        Notice { severity, place, message, help: help.map(str::to_owned) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kind_is_told_once_with_its_number_and_its_first_places() {
        let notices = Notices::default();
        for node in 0..1_000_000 {
            notices.warn(|| format!("node {node}"), "it is odd");
        }
        notices.note(|| "node 1".into(), "it is odd", Some("look at it"));
        notices.warn(String::new, "all is odd");
        let told: Vec<String> = notices.into_list().iter().map(ToString::to_string).collect();
        assert_eq!(
            told,
            [
                "node 0 and 999999 others (node 1, node 2, node 3, …): it is odd",
                "node 1: it is odd (look at it)",
                "all is odd"
            ]
        );
    }

    #[test]
    fn the_number_of_kinds_is_limited() {
        let notices = Notices::default();
        for kind in 0..100_000 {
            notices.warn(|| "node 0".into(), format!("kind {kind}"));
        }
        let list = notices.into_list();
        assert_eq!(list.len(), MOST_KINDS + 1);
        assert!(list[MOST_KINDS].to_string().contains("more was found"), "{}", list[MOST_KINDS]);
    }
}
