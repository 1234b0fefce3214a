//! `[random]` → distributions, and their trial.

use super::super::draw::{Drawn, LEAST_SHARE, Law};
use super::super::keys::job::{
    CHECK, EXPECTATIONS, MODE, NAME, OUTPUT, PRESET, SEED, SENSORS, SEQUENCE, TRACE, TRUTH,
};
use super::super::keys::measurement::IS_NOMINAL;
use super::super::keys::random::{
    CHOICE, INTEGER, LAWS, LOG_UNIFORM, NORMAL, PER, RANDOM, UNIFORM, WEIGHTS, WITHIN,
};
use super::super::table::{AnyKey, Table};
use super::super::{overlay, parse};
use crate::source::tree::{Entries, Node, Value};
use crate::source::words::{list, quoted};
use crate::source::{Report, Span};

/// Most keys that are drawn.
const MAX_DRAWN: usize = 256;

/// Most values of a choice.
const MAX_CHOICES: usize = 10_000;

/// The distributions of a job in the order of their keys' places. What is wrong is reported.
pub(super) fn distributions(t: &Table<'_>, job: &Entries) -> Vec<Drawn> {
    if let Some(Value::Table(given)) = job.get(RANDOM.name()).map(|entry| &entry.node.value)
        && report_unquoted(t.report(), given)
    {
        return Vec::new();
    }
    let Some(given) = t.read(&RANDOM) else { return Vec::new() };
    if given.value.len() > MAX_DRAWN {
        let message = format!("`[random]` has {} keys", given.value.len());
        t.report().error(given.span, message, format!("expected at most {MAX_DRAWN}"), None);
        return Vec::new();
    }
    let key_span = |name: &str| match job.get(RANDOM.name()).map(|entry| &entry.node.value) {
        Some(Value::Table(given)) => given.get(name).map_or(t.span, |entry| entry.key),
        _ => t.span,
    };
    let mut draws: Vec<Drawn> = Vec::new();
    for (name, distribution) in &given.value {
        let Some((law, is_of_run)) = law(&distribution.value) else { continue };
        let Some(parts) = parts(t.report(), job, name, key_span(name)) else { continue };
        let (key, key_span, span) = ((*name).to_owned(), key_span(name), distribution.span);
        let draw = Drawn { key, key_span, parts, span, law, is_of_run };
        if may_be_drawn(t.report(), job, &draw) {
            draws.push(draw);
        }
    }
    draws.sort_by_key(|draw| draw.key_span);
    draws
}

/// Reports keys that are taken for tables, because they stand without quotes.
fn report_unquoted(report: &Report, given: &Entries) -> bool {
    let is_law = |name: &str| LAWS.iter().any(|law| law.name() == name);
    let mut found = false;
    for (name, entry) in given {
        let Value::Table(inner) = &entry.node.value else { continue };
        let Some((deeper, _)) =
            inner.iter().find(|(name, entry)| !is_law(name) && matches!(entry.node.value, Value::Table(_)))
        else {
            continue;
        };
        let message = format!("{} is taken for a table, because of the dot", quoted(name));
        let help = format!("put the whole key in quotes: \"{name}.{deeper}…\" = {{ uniform = [1.7, 1.9] }}");
        report.error(entry.key, message, "", Some(help));
        found = true;
    }
    found
}

/// The law of a distribution, and whether it is drawn from once for all frames.
fn law(t: &Table<'_>) -> Option<(Law, bool)> {
    let report = t.report();
    let is_of_run = t.value(&PER);
    let given: Vec<_> = LAWS.iter().filter(|law| t.has(**law)).collect();
    let all = || list(LAWS.iter().map(|law| law.name()), "or");
    match given.as_slice() {
        [] => {
            let help = format!("it has one of {}, such as `uniform = [1.7, 1.9]`", all());
            return report.fail(t.span, "the distribution says not what is drawn", "", Some(help));
        }
        [_] => {}
        [a, b, ..] => {
            let message =
                format!("a distribution has one law, and this has both `{}` and `{}`", a.name(), b.name());
            return report.fail(t.span_of(**b), message, "one too many", None);
        }
    }
    let (within, weights) = (t.read(&WITHIN), t.read(&WEIGHTS));
    let companions: [[&dyn AnyKey; 2]; 2] = [[&WITHIN, &NORMAL], [&WEIGHTS, &CHOICE]];
    for [key, of] in companions {
        if t.has(key) && !t.has(of) {
            let message = format!("`{}` goes with `{}`, which is not here", key.name(), of.name());
            return report.fail(t.span_of(key), message, "", None);
        }
    }
    // The least comes before the most; that they are equal is of use while a job is worked on.
    let ordered = |[least, most]: [f64; 2], span: Span| {
        if least <= most && (most - least).is_finite() {
            return Some([least, most]);
        }
        report.fail(
            span,
            format!("the least is {least} and the most {most}"),
            "expected the least first",
            None,
        )
    };
    let law = if t.has(&UNIFORM) {
        let ends = t.read(&UNIFORM)?;
        Law::Uniform(ordered(ends.value, ends.span)?)
    } else if t.has(&LOG_UNIFORM) {
        let ends = t.read(&LOG_UNIFORM)?;
        let [least, most] = ordered(ends.value, ends.span)?;
        if least <= 0.0 {
            let message = format!("the least is {least}, which has no logarithm");
            return report.fail(ends.span, message, "expected numbers greater than 0", None);
        }
        Law::LogUniform([least, most])
    } else if t.has(&INTEGER) {
        let ends = t.read(&INTEGER)?;
        let [least, most] = ordered(ends.value, ends.span)?;
        // Up to here, the numbers of TOML that are whole are exact.
        let is_whole = |end: &f64| end.fract() == 0.0 && end.abs() <= 9e15;
        if let Some(end) = [least, most].iter().find(|end| !is_whole(end)) {
            return report.fail(
                ends.span,
                format!("{end} is no whole number"),
                "expected whole numbers",
                None,
            );
        }
        Law::Integer([least as i64, most as i64])
    } else if t.has(&NORMAL) {
        let given = t.read(&NORMAL)?;
        let [mean, deviation] = given.value;
        if deviation < 0.0 {
            let message = format!("the standard deviation is {deviation}");
            return report.fail(given.span, message, "expected 0 or more, after the mean", None);
        }
        let within = match &within {
            None => None,
            Some(within) => {
                let ends = ordered(within.value, within.span)?;
                let share = share_within(mean, deviation, ends);
                if share < LEAST_SHARE {
                    let message = format!(
                        "{} % of the normal distribution lies between {} and {}",
                        share * 100.0,
                        ends[0],
                        ends[1]
                    );
                    let label = format!("expected at least {} %", LEAST_SHARE * 100.0);
                    return report.fail(within.span, message, label, None);
                }
                Some(ends)
            }
        };
        if t.has(&WITHIN) && within.is_none() {
            return None; // reported when it was read
        }
        Law::Normal { mean, deviation, within }
    } else {
        let values = t.read(&CHOICE)?;
        if values.value.len() > MAX_CHOICES {
            let message = format!("the choice has {} values", values.value.len());
            return report.fail(values.span, message, format!("expected at most {MAX_CHOICES}"), None);
        }
        let weights = match weights {
            None if t.has(&WEIGHTS) => return None, // reported when it was read
            None => vec![1.0; values.value.len()],
            Some(weights) => {
                let each: Vec<f64> = weights.value.iter().map(|weight| weight.value).collect();
                let sum: f64 = each.iter().sum();
                if each.len() != values.value.len() {
                    let message = format!("{} weights for {} values", each.len(), values.value.len());
                    return report.fail(weights.span, message, "expected one for each value", None);
                }
                if !(sum > 0.0 && sum.is_finite()) {
                    return report.fail(
                        weights.span,
                        format!("the sum of the weights is {sum}"),
                        "expected more than 0",
                        None,
                    );
                }
                each
            }
        };
        let sums = weights.iter().scan(0.0, |sum, weight| {
            *sum += weight;
            Some(*sum)
        });
        Law::Choice { values: values.value.to_vec(), weights: sums.collect() }
    };
    Some((law, is_of_run))
}

/// The part of a normal distribution between two ends.
fn share_within(mean: f64, deviation: f64, [least, most]: [f64; 2]) -> f64 {
    if deviation == 0.0 {
        return if (least..=most).contains(&mean) { 1.0 } else { 0.0 };
    }
    // Φ(b) − Φ(a) = (erfc(a/√2) − erfc(b/√2))/2, taken on the side of the mean where both are small.
    let of = |end: f64| (end - mean) / deviation * std::f64::consts::FRAC_1_SQRT_2;
    let (a, b) = (of(least), of(most));
    let (a, b) = if a + b < 0.0 { (-b, -a) } else { (a, b) };
    (libm::erfc(a) - libm::erfc(b)) / 2.0
}

/// The names and indices that a key consists of. `None` if it is no key, which is reported.
fn parts(report: &Report, job: &Entries, key: &str, span: Span) -> Option<Vec<String>> {
    let Some(mut nested) = parse::nest(&overlay::dotted(key), span.source) else {
        let help = "names with dots between, as in `sensor.top.range.max_m`".to_owned();
        return report.fail(span, format!("{} is not a key", quoted(key)), "", Some(help));
    };
    // The key stands in the job, and the text that it was parsed from nowhere.
    let mut outer = nested.values_mut().next();
    while let Some(entry) = outer {
        (entry.key, entry.node.span) = (span, span);
        outer = match &mut entry.node.value {
            Value::Table(deeper) => deeper.values_mut().next(),
            _ => None,
        };
    }
    overlay::address_lone_sensor(report, job, &mut nested);
    let mut parts = Vec::new();
    let mut table = Some(&nested);
    while let Some((name, entry)) = table.and_then(|table| table.first_key_value()) {
        parts.push(name.clone());
        table = match &entry.node.value {
            Value::Table(deeper) => Some(deeper),
            _ => None,
        };
    }
    (!parts.is_empty()).then_some(parts)
}

/// Whether a value may be drawn of a key; reports why not.
fn may_be_drawn(report: &Report, job: &Entries, draw: &Drawn) -> bool {
    let refuse = |label: &str, help: Option<&str>| {
        let message = format!("{} can't be drawn", quoted(&draw.key));
        report.error(draw.key_span, message, label, help.map(str::to_owned));
        false
    };
    let parts: Vec<&str> = draw.parts.iter().map(String::as_str).collect();
    let first = parts.first().copied().unwrap_or_default();
    if [SEED.name(), RANDOM.name()].contains(&first) {
        return refuse("all that is drawn follows from it", None);
    }
    let is_of_sensor = |key: &str| matches!(parts.as_slice(), [sensor, _, name] if *sensor == SENSORS.name() && *name == key);
    if [NAME.name(), PRESET.name(), MODE.name(), IS_NOMINAL.name()].into_iter().any(is_of_sensor) {
        let help = "draw the keys in which the presets differ, or give the job's `--set` another one";
        return refuse("a sensor is known before anything is drawn", Some(help));
    }
    if parts.last() == Some(&"file") {
        return refuse("files are read before anything is drawn", None);
    }
    let of_run: [&dyn AnyKey; 6] = [&OUTPUT, &SEQUENCE, &TRUTH, &TRACE, &CHECK, &EXPECTATIONS];
    if !draw.is_of_run && of_run.iter().any(|key| key.name() == first) {
        return refuse(
            "all frames have this in common",
            Some("draw it once for all frames: `per = \"run\"`"),
        );
    }
    has_list(report, job, draw)
}

/// Whether the list is there of which a draw is to replace an element; reports that it is not. A whole key need not be there.
fn has_list(report: &Report, job: &Entries, draw: &Drawn) -> bool {
    let mut tables = Some(job);
    let mut elements: Option<&[Node]> = None;
    for (index, part) in draw.parts.iter().enumerate() {
        let node = match (tables, elements) {
            (Some(table), _) => table.get(part).map(|entry| &entry.node),
            (None, Some(elements)) => match overlay::element(elements, part) {
                Some(node) => Some(node),
                None => return true, // reported when the value is laid over the list
            },
            (None, None) => return true, // reported when the value is read
        };
        let Some(node) = node else {
            let is_index = |part: &String| part.parse::<usize>().is_ok();
            let Some(element) = draw.parts[index..].iter().position(is_index).filter(|at| *at > 0) else {
                return true;
            };
            let list = &draw.parts[index + element - 1];
            let message = format!("the job has no {}, of which an element could be drawn", quoted(list));
            let help = format!("write `{list}` where it belongs: its other elements keep their values");
            report.error(draw.key_span, message, "", Some(help));
            return false;
        };
        (tables, elements) = match &node.value {
            Value::Table(table) => (Some(table), None),
            Value::Array(elements) => (None, Some(elements.as_slice())),
            _ => (None, None),
        };
    }
    true
}
