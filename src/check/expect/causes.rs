//! How often a target is detected, and which of the returns are from no surface, or from several.

use super::bounds::Bounds;
use super::finding::Finding;
use super::seen::{Seen, sight_of};
use super::shares::furthest_outside;
use super::target::Target;
use crate::check::phrasing::percent;
use crate::output::SensorFrame;
use crate::scan::{Cause, Frame};
use crate::source::words::{counted, joined};

pub(super) fn detection(seen: &Seen, target: &Target, share: &Bounds) -> Finding {
    if let Some(problem) = target.missing(seen.scene) {
        return Finding::Nothing(problem);
    }
    let (mut sent, mut returned) = (0, 0);
    let mut places = Vec::new();
    for of in seen.frames {
        let frame = of.frame;
        let ideal = seen.ideal.iter().find(|(name, _)| *name == of.name).map(|(_, ideal)| *ideal);
        let [at, back] = pulses_at(frame, ideal.unwrap_or(frame), seen, target);
        if at > 0 {
            places.push(format!("sensor {}: {back} of {}", of.name, counted(at, "pulse")));
        }
        (sent, returned) = (sent + at, returned + back);
    }
    if sent == 0 {
        return Finding::Nothing("no pulse would meet it in an ideal scan".to_owned());
    }
    let found = returned as f64 / sent as f64;
    let sights = seen.frames.iter().map(|of| sight_of(of, Some("id.instance")));
    let words = format!("{} of {}", percent(found), counted(sent, "pulse"));
    Finding::new(share.hold(found), words, joined(&places, "and")).shown_by(sights)
}

/// The number of pulses that would meet a target in the ideal frame, and of those that return from it.
fn pulses_at(frame: &Frame, ideal: &Frame, seen: &Seen, target: &Target) -> [u64; 2] {
    // The light of a mirror image or of a halo came another way.
    let is_direct =
        |cause: Option<Cause>| matches!(cause, Some(Cause::Surface | Cause::Mixed | Cause::Glass));
    let returns = |pixel: usize| {
        frame.slots(pixel).enumerate().any(|(number, slot)| {
            is_direct(frame.cause(pixel, number)) && target.is_hit(&frame.returns().get(slot), seen.scene)
        })
    };
    let (mut at, mut back) = (0, 0);
    for (pixel, first) in ideal.first_returns().enumerate() {
        if first.is_some_and(|hit| target.is_hit(&hit, seen.scene)) {
            at += 1;
            back += u64::from(returns(pixel));
        }
    }
    [at, back]
}

/// The number of a frame's returns that have one of these causes.
fn returns_of(frame: &Frame, causes: &[Cause]) -> usize {
    let of_pixel =
        |pixel: usize| (0..frame.slots(pixel).len()).filter_map(move |number| frame.cause(pixel, number));
    (0..frame.pixels()).flat_map(of_pixel).filter(|cause| causes.contains(cause)).count()
}

pub(super) fn false_alarms(seen: &Seen, at_most: f64) -> Finding {
    let count = |of: &SensorFrame| {
        [Cause::FalseAlarm, Cause::Interference].map(|cause| returns_of(of.frame, &[cause]))
    };
    let worst =
        seen.frames.iter().map(|of| (count(of), of)).max_by_key(|([alarms, foreign], _)| alarms + foreign);
    let Some(([alarms, foreign], of)) = worst else {
        return Finding::Nothing("no sensor".to_owned());
    };
    let found = format!(
        "{} and {} of interference",
        counted(alarms as u64, "false alarm"),
        counted(foreign as u64, "return")
    );
    Finding::new((alarms + foreign) as f64 <= at_most, found, format!("sensor {}", of.name))
        .shown_by([sight_of(of, Some("cause"))])
}

pub(super) fn share(seen: &Seen, cause: Cause, share: &Bounds) -> Finding {
    // A frame without returns has no share, and none is furthest outside.
    let with_returns: Vec<SensorFrame> =
        seen.frames.iter().filter(|of| of.frame.return_count() > 0).copied().collect();
    let only = Seen { frames: &with_returns, ..*seen };
    let count = |of: &SensorFrame| {
        let returns = of.frame.return_count();
        (returns_of(of.frame, &[cause]), returns)
    };
    match furthest_outside(&only, share, &count) {
        None => Finding::Nothing("no sensor has a return".to_owned()),
        Some(worst) => {
            let returns = worst.of.frame.return_count() as u64;
            let words = format!("{} of {}", percent(worst.share), counted(returns, "return"));
            Finding::new(share.hold(worst.share), words, worst.place()).shown_by([worst.sight(Some("cause"))])
        }
    }
}
