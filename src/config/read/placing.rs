//! `place` of an actor → [`Placing`].

use super::super::job::{Placing, SurfaceName};
use super::super::keys::placing::{CLEARANCE, LIFT, ON, ON_LABEL, PLACE_X, PLACE_Y, YAW};
use super::super::keys::random::PER;
use super::super::kinds::Vector;
use super::super::table::{Key, Table};
use crate::source::Spanned;

/// How a place is drawn. `None` if there is something wrong with it, which is reported.
pub(super) fn placing(t: &Table<'_>) -> Option<Placing> {
    let (name, label) = (t.read(&ON), t.read(&ON_LABEL));
    let on = match [t.has(&ON), t.has(&ON_LABEL)] {
        [true, true] => {
            let span = t.report().later(t.span_of(&ON), t.span_of(&ON_LABEL));
            t.report().fail(
                span,
                "a place is on one surface, and this has both `on` and `on_label`",
                "one too many",
                None,
            )
        }
        [false, false] => {
            let help = "add `on = \"floor\"`, an object, a material or a label of the scene by its name, or `on_label = 2`";
            t.report().fail(
                t.span,
                "the place has no surface",
                "needs `on` or `on_label`",
                Some(help.to_owned()),
            )
        }
        _ => name
            .map(|name| Spanned { value: SurfaceName::Name(name.value.to_owned()), span: name.span })
            .or(label.map(|label| Spanned { value: SurfaceName::Label(label.value), span: label.span })),
    };
    let zone_m = [&PLACE_X, &PLACE_Y].map(|key| match t.has(key) {
        true => ordered(t, key),
        false => Some([f64::NEG_INFINITY, f64::INFINITY]),
    });
    let yaw_deg = match t.has(&YAW) {
        true => ordered(t, &YAW),
        false => Some(t.value(&YAW)),
    };
    let (clearance_m, lift_m, is_of_run) = (t.value(&CLEARANCE), t.value(&LIFT), t.value(&PER));
    let (on, [x_m, y_m]) = (on?, zone_m);
    Some(Placing {
        place: t.report().place(on.span),
        on: on.value,
        zone_m: [x_m?, y_m?],
        yaw_deg: yaw_deg?,
        clearance_m,
        lift_m,
        is_of_run,
    })
}

/// The two ends of a span, the least first. `None` if they are otherwise, which is reported.
fn ordered(t: &Table<'_>, key: &Key<Vector<2>>) -> Option<[f64; 2]> {
    let ends = t.read(key)?;
    let [from, to] = ends.value;
    if from <= to && (to - from).is_finite() {
        return Some(ends.value);
    }
    let message = format!("`{}` goes from {from} to {to}", key.name());
    t.report().fail(ends.span, message, "expected the least first", None)
}
