//! A story as JSON.

use serde_json::{Map, Value, json};

use super::told::{Told, unit_in_files};
use super::words;
use crate::scan::{Echo, Fate, NO_OBJECT, Return, Terms};

/// All of a story.
pub fn of(told: &Told) -> Value {
    let story = told.story;
    let pulse = story.pulse.as_ref().map(|sent| {
        let [azimuth_deg, elevation_deg] = words::angles_deg(sent);
        json!({
            "time_s": sent.time_s,
            "origin_m": sent.origin_m.to_array(),
            "direction": sent.direction.to_array(),
            "azimuth_deg": azimuth_deg,
            "elevation_deg": elevation_deg,
            "world_origin_m": sent.world_origin_m.to_array(),
            "world_direction": sent.world_direction.to_array(),
            "off_deg": sent.off_rad.to_degrees(),
        })
    });
    let geometry = &told.scene.geometry;
    let met: Vec<Value> = story
        .met
        .iter()
        .map(|met| {
            json!({
                "cause": met.cause.name(),
                "object": met.object.map(|index| &geometry.objects[index as usize].name),
                "instance": met.object.map_or(0, id),
                "material": met.material.map(|index| &geometry.materials[index as usize].name),
                "label": met.label,
                "label_name": told.label_names.get(&met.label),
                "sub_rays": met.sub_rays,
                "paths": met.paths,
                "range_m": met.range_m,
                "energy": met.energy,
                "share": met.share,
                "transmission": met.transmission,
            })
        })
        .collect();
    let signal = story.signal.as_ref().map(|signal| {
        let peaks: Vec<Value> = signal
            .peaks
            .iter()
            .map(|peak| {
                let (fate, number) = match peak.fate {
                    Fate::Returned(number) => ("returned", Some(number)),
                    Fate::NotChosen => ("not_chosen", None),
                    Fate::Lost(cause) => (cause.name(), None),
                };
                let source = |&(met, share): &(usize, f64)| json!({ "met": met, "share": share });
                json!({
                    "range_m": peak.range_m,
                    "height": peak.height,
                    "amplitude": peak.amplitude,
                    "counts": peak.counts.map(|counts| json!({
                        "drawn": counts.drawn,
                        "mean": counts.mean,
                        "background": counts.background,
                        "least": counts.least,
                    })),
                    "width_m": peak.width_m,
                    "cause": peak.cause.name(),
                    "fate": fate,
                    "return": number,
                    "sources": peak.sources.iter().map(source).collect::<Vec<_>>(),
                })
            })
            .collect();
        json!({
            "unit": unit_in_files(signal),
            "sigma_m": signal.sigma_m,
            "threshold": signal.threshold,
            "parts": signal.parts.iter().map(|part| json!({ "range_m": part.range_m, "energy": part.energy })).collect::<Vec<_>>(),
            "peaks": peaks,
        })
    });
    let return_of = |(one, echo): &(Return, Option<Echo>)| return_of(one, echo);
    json!({
        "sensor": told.sensor_name,
        "frame": told.frame,
        "row": story.row,
        "column": story.column,
        "cause": story.cause.name(),
        "story": words::lines(told),
        "pulse": pulse,
        "sub_rays": story.sub_rays,
        "lost_rays": story.lost_rays,
        "extinction_per_m": story.extinction_per_m,
        "met": met,
        "signal": signal,
        "returns": story.returns.iter().map(return_of).collect::<Vec<_>>(),
        "blocker": story.blocker.as_ref().map(return_of),
    })
}

fn return_of(one: &Return, echo: &Option<Echo>) -> Value {
    let mut keys = Map::new();
    let mut add = |key: &str, value: Value| keys.insert(key.to_owned(), value);
    add("range_m", json!(one.range_m));
    add("intensity", json!(one.intensity));
    add("normal", json!(one.normal));
    add("instance", json!(id(one.instance)));
    add("label", json!(one.label));
    add("triangle", json!(id(one.triangle)));
    add("cause", json!(echo.map(|echo| echo.cause.name())));
    add("snr", json!(echo.map(|echo| echo.snr)));
    add("width_m", json!(echo.map(|echo| echo.width_m)));
    add("ambient", json!(echo.map(|echo| echo.ambient)));
    add("terms_m", json!(echo.map(|echo| terms(&echo.terms))));
    Value::Object(keys)
}

/// The error budget: the exact range, and the errors by their names.
fn terms(terms: &Terms) -> Map<String, Value> {
    let errors = Terms::NAMES.iter().zip(terms.errors_m());
    let all = std::iter::once(("ideal", terms.ideal_m)).chain(errors.map(|(name, error_m)| (*name, error_m)));
    all.map(|(name, value)| (name.to_owned(), json!(value))).collect()
}

/// An index as files have it: from 1, and 0 for nothing.
fn id(index: u32) -> u32 {
    if index == NO_OBJECT { 0 } else { index + 1 }
}
