//! The sentences of a story.

use super::told::{Told, unit};
use crate::angle::Angle;
use crate::scan::{Cause, Counts, Echo, Fate, Met, Return, Sent, Signal, SignalPeak, SignalUnit, Terms};
use crate::sensor::{DepthSensing, Limited, ReturnMode, StereoMethod};
use crate::source::words::{joined, quoted};

/// The pixel that a story is about.
pub fn title(told: &Told) -> String {
    let (row, column) = (told.story.row, told.story.column);
    format!("Row {row}, column {column} of sensor {}, frame {}", quoted(told.sensor_name), told.frame)
}

/// The story, a paragraph a line.
pub fn lines(told: &Told) -> Vec<String> {
    let story = told.story;
    let Some(sent) = &story.pulse else {
        return vec![
            "The pixel sends no pulse, because the sensor's model has no ray for it, so it has no return."
                .to_owned(),
        ];
    };
    let mut lines = vec![sending(told, sent)];
    let mut met: Vec<String> = story.met.iter().map(|one| meeting(told, one)).collect();
    // The last sentence says it of a pulse that meets nothing at all.
    if story.lost_rays > 0 && story.cause != Cause::Nothing {
        met.push(losing(story.lost_rays, story.sub_rays));
    }
    lines.append(&mut met);
    lines.extend(air(told));
    if let Some(signal) = &story.signal {
        lines.push(threshold(told, signal));
        let (faint, others): (Vec<_>, Vec<_>) = signal.peaks.iter().partition(|peak| is_faint(signal, peak));
        if let [_, _, ..] = faint.as_slice() {
            lines.extend(others.iter().map(|peak| echo(told, signal, peak)));
            lines.push(faint_echoes(&faint));
        } else {
            lines.extend(signal.peaks.iter().map(|peak| echo(told, signal, peak)));
        }
    }
    lines.extend(
        story.returns.iter().enumerate().map(|(number, (one, echo))| reporting(told, number, one, echo)),
    );
    if story.returns.is_empty() {
        lines.push(missing(told));
    }
    lines
}

fn sending(told: &Told, sent: &Sent) -> String {
    let [x, y, z] = sent.world_origin_m.to_array().map(|c| fixed(c, 2));
    let [azimuth, elevation] = angles_deg(sent).map(|angle| fixed(angle, 2));
    let mut text = format!(
        "The pulse leaves at {} s from ({x}, {y}, {z}) m in the world, towards azimuth {azimuth}° and elevation {elevation}° in \
         the sensor's own frame.",
        fixed(sent.time_s, 4),
    );
    let off = Angle::rad(sent.off_rad).degrees();
    if off > 0.0 {
        text += &format!(" Its axis is off by {off:.3}° from there, which the sensor does not know.");
    }
    let depth = &told.sensor.measurement.depth;
    if let Some(sensing) = depth {
        text += match sensing {
            DepthSensing::Stereo(stereo) => match stereo.method {
                StereoMethod::Match(_) => {
                    " The camera finds depth by matching two images, so that neighbours count, too."
                }
                StereoMethod::Analytic(_) => {
                    " The camera finds depth by the disparity to a second viewpoint."
                }
            },
            DepthSensing::TimeOfFlight(_) => {
                " The camera finds depth by the phases of all the light of the pixel."
            }
        };
        text += " This is the ray through the pixel's middle.";
    } else if told.story.signal.is_none() {
        text += " The sensor is ideal: its beam has no width, and it reports the exact range.";
    } else if told.story.sub_rays > 1 {
        let count = told.story.sub_rays;
        text += &format!(" {count} sub-rays of equal energy stand for its width.");
    }
    text
}

/// The azimuth and the elevation of a pulse in the sensor's frame, in degrees.
pub fn angles_deg(sent: &Sent) -> [f64; 2] {
    let [x, y, z] = sent.direction.to_array();
    [libm::atan2(y, x), libm::atan2(z, libm::hypot(x, y))].map(|rad| Angle::rad(rad).degrees())
}

/// The targets that send light back, and their parts of it.
fn meeting(told: &Told, met: &Met) -> String {
    let (name, place) = (named(told, met), span(met.range_m));
    let Some(signal) = &told.story.signal else {
        let percent = share(met.energy);
        return match met.energy < 1.0 {
            true => format!("The ray meets {name} {place}, which has {percent} of the pulse's light."),
            false => format!("The ray meets {name} {place}."),
        };
    };
    let all = told.story.sub_rays;
    let rays = match (met.sub_rays, all) {
        (_, 1) => "The ray".to_owned(),
        (one, all) if one == all => format!("All {all} sub-rays"),
        (one, all) => format!("{one} of {all} sub-rays"),
    };
    let s = if all == 1 || met.sub_rays == 1 { "s" } else { "" };
    let particles = |one: &str, many: &str| match met.paths {
        1 => format!("One {one} sends light back {place}"),
        count => format!("{count} {many} send light back {place}"),
    };
    let way = match met.cause {
        Cause::Mirror => format!("{rays} see{s} {name} {place}, by a mirror"),
        Cause::Glass => format!("{rays} see{s} {name} {place}, by way of glass"),
        Cause::Rain => particles("drop of rain", "drops of rain"),
        Cause::Snow => particles("flake of snow", "flakes of snow"),
        Cause::Fog => format!("Fog sends light back, the most of it {place}"),
        Cause::Dust => format!("Dust sends light back, the most of it {place}"),
        Cause::Blooming => format!("The halo of {name}, which other beams meet {place}, adds light"),
        Cause::Crosstalk => {
            format!("Light of {name}, which channels that fire at the same time meet {place}, leaks in")
        }
        _ => format!("{rays} meet{s} {name} {place}"),
    };
    let energy = height(signal, met.energy);
    let whole = if told.story.met.len() == 1 {
        "which is all that comes back".to_owned()
    } else {
        format!("which is {} of what comes back", share(met.share))
    };
    format!("{way}; its light has {energy}, {whole}.")
}

fn losing(lost: usize, all: usize) -> String {
    match (lost, all) {
        (1, 1) => "The ray meets nothing that sends light back.".to_owned(),
        (lost, all) if lost == all => {
            format!("None of the {all} sub-rays meets anything that sends light back.")
        }
        (1, all) => format!("1 of {all} sub-rays meets nothing that sends light back."),
        (lost, all) => format!("{lost} of {all} sub-rays meet nothing that sends light back."),
    }
}

/// The light that the air takes.
fn air(told: &Told) -> Option<String> {
    let story = told.story;
    if story.extinction_per_m <= 0.0 {
        return None;
    }
    let dimmed = story.met.iter().filter(|met| met.transmission < 1.0 && met.object.is_some());
    let taken: Vec<String> = dimmed
        .map(|met| {
            format!("{} of the light to {} and back", share(1.0 - met.transmission), short_name(told, met))
        })
        .collect();
    let extinction =
        format!("The air has an extinction of {} per metre", significant(story.extinction_per_m));
    Some(match taken.is_empty() {
        true => format!("{extinction}."),
        false => format!("{extinction}. It takes {}.", joined(&taken, "and")),
    })
}

fn threshold(told: &Told, signal: &Signal) -> String {
    let receiver = told.sensor.measurement.receiver.as_ref();
    match (receiver.and_then(|receiver| receiver.spad), signal.threshold) {
        (Some(spad), _) => format!(
            "The receiver counts photons in {} cycles, in bins of {} m, and detects an echo whose counts background alone has \
             but rarely.",
            spad.cycles,
            significant(spad.bin_m())
        ),
        (None, Some(threshold)) => {
            format!("The receiver detects what is above a {} of {threshold:.2}.", unit(signal))
        }
        (None, None) => {
            "The receiver detects all light, because it has no range pairs that tell its sensitivity."
                .to_owned()
        }
    }
}

/// Whether a peak is so far below the threshold that several of them are told in one sentence.
fn is_faint(signal: &Signal, peak: &SignalPeak) -> bool {
    peak.fate == Fate::Lost(Cause::BelowThreshold)
        && match (&peak.counts, signal.threshold) {
            (Some(counts), _) => {
                counts.mean - counts.background < 0.1 * (f64::from(counts.least) - counts.background)
            }
            (None, Some(threshold)) => peak.height < 0.1 * threshold,
            (None, None) => false,
        }
}

/// Two or more faint peaks, the nearest first.
fn faint_echoes(peaks: &[&SignalPeak]) -> String {
    let place = match peaks {
        [first, .., last] => span([first.range_m, last.range_m]),
        _ => String::new(),
    };
    let count = peaks.len();
    format!("{count} more echoes {place} have less than a tenth of the threshold, and are not detected.")
}

/// A peak, and what becomes of it.
fn echo(told: &Told, signal: &Signal, peak: &SignalPeak) -> String {
    let place = at(peak.range_m);
    let mut text = match (peak.cause, &peak.counts) {
        (_, Some(counts)) => counted(&place, counts),
        _ if peak.height > 0.0 => {
            let mut text = format!("An echo stands at {place} with {}", height(signal, peak.height));
            if let Some(threshold) = signal.threshold {
                text += &format!(", {} times the threshold", significant(peak.height / threshold));
            }
            let this_time = significant(peak.amplitude);
            if this_time != significant(peak.height) {
                text += &format!("; noise makes it {this_time} this time");
            }
            text + "."
        }
        (Cause::Interference, None) => {
            format!("The pulse of another device arrives as if from {place}{}.", strength(signal, peak))
        }
        _ => {
            format!("Noise alone makes a peak at {place}{}.", strength(signal, peak))
        }
    };
    if let [(main, _), .., (_, _)] = peak.sources.as_slice()
        && peak.sources.iter().skip(1).any(|(_, share)| *share >= 0.001)
    {
        let parts: Vec<String> = peak
            .sources
            .iter()
            .filter(|(index, share)| index == main || *share >= 0.001)
            .map(|(index, part)| {
                format!("{} makes {} of it", short_name(told, &told.story.met[*index]), share(*part))
            })
            .collect();
        text += &format!(" {}.", capital(&joined(&parts, "and")));
    }
    text + " " + &fate(told, peak)
}

/// The strength of what no light makes: `, with a signal-to-noise ratio of 7.2`. A receiver that counts tells none.
fn strength(signal: &Signal, peak: &SignalPeak) -> String {
    match signal.unit {
        SignalUnit::Counts => String::new(),
        _ => format!(", with {} of {}", a_unit(signal), significant(peak.amplitude)),
    }
}

/// The counts of an echo.
fn counted(place: &str, counts: &Counts) -> String {
    let Counts { drawn, mean, background, least } = counts;
    let (mean, background) = (significant(*mean), significant(*background));
    format!(
        "An echo stands at {place}. There are {mean} counts on average, {background} of background alone, and {least} are \
         detected; this time there are {drawn}."
    )
}

fn fate(told: &Told, peak: &SignalPeak) -> String {
    let returns = told.story.returns.len();
    match peak.fate {
        Fate::Returned(_) if returns == 1 => "It becomes the return.".to_owned(),
        Fate::Returned(number) => format!("It becomes return {}.", number + 1),
        Fate::NotChosen => {
            let receiver = told.sensor.measurement.receiver.as_ref();
            let mode = match receiver.map_or(ReturnMode::Strongest, |receiver| receiver.returns) {
                ReturnMode::Strongest => "reports the strongest echo only",
                ReturnMode::First => "reports the first echo only",
                ReturnMode::Last => "reports the last echo only",
                ReturnMode::Dual => {
                    "reports the strongest echo and the last, or the second strongest, that is apart from it"
                }
                ReturnMode::Several(_) => {
                    "reports only so many of the strongest echoes that are apart from each other"
                }
            };
            format!("It is detected and not reported, because the sensor {mode}.")
        }
        Fate::Lost(Cause::Dropped) => "Noise hides it this time.".to_owned(),
        Fate::Lost(Cause::Absorbed) => {
            "It is too faint to be detected, and would be detected in clear air.".to_owned()
        }
        Fate::Lost(Cause::TooNear) => {
            let limit = limit(told, told.sensor.range.min_m);
            format!("It is nearer than the sensor's least {limit}, so that it is no return.")
        }
        Fate::Lost(Cause::OutOfRange) => {
            format!("It is beyond the sensor's largest {}.", limit(told, told.sensor.range.max_m))
        }
        Fate::Lost(_) => "It is too faint to be detected.".to_owned(),
    }
}

fn limit(told: &Told, limit_m: f64) -> String {
    let of = match told.sensor.range.of {
        Limited::Range => "range",
        Limited::Depth => "depth",
    };
    format!("{of} of {} m", significant(limit_m))
}

/// A return with its error budget.
fn reporting(told: &Told, number: usize, one: &Return, echo: &Option<Echo>) -> String {
    let subject = match told.story.returns.len() {
        1 => "The sensor reports".to_owned(),
        _ => format!("As return {}, the sensor reports", number + 1),
    };
    let sum = match echo {
        None => ", which is the exact range".to_owned(),
        Some(echo) if echo.snr > 0.0 || told.sensor.measurement.depth.is_some() => budget(told, &echo.terms),
        Some(_) => String::new(),
    };
    let intensity = significant(f64::from(one.intensity));
    let mut text = format!("{subject} {}{sum}. The intensity is {intensity}.", exactly(one.range_m));
    if let Some(echo) = echo {
        text += &format!(" The cause is `{}`: {}.", echo.cause.name(), cause_of_return(echo.cause));
    }
    text
}

/// The sum of the exact range and its errors: `: 12.310 m exactly, −4.0 mm by the beam's width and +1.2 mm by noise`.
fn budget(told: &Told, terms: &Terms) -> String {
    let receiver = told.sensor.measurement.receiver.as_ref();
    let is_counting = receiver.is_some_and(|receiver| receiver.spad.is_some());
    let width = match &told.sensor.measurement.depth {
        None => "by the beam's width",
        Some(DepthSensing::Stereo(_)) => "by matching",
        Some(DepthSensing::TimeOfFlight(_)) => "by indirect light and by other depths in the pixel",
    };
    let by: [&str; 6] = [
        "by the pulse's direction",
        width,
        if is_counting { "by pile-up" } else { "by the walk of the threshold" },
        "by noise",
        "by the beam's bias",
        "by rounding",
    ];
    let errors: Vec<String> = terms
        .errors_m()
        .iter()
        .zip(by)
        .map(|(error_m, by)| (signed(error_m * 1e3, 1), by))
        .filter(|(error_mm, _)| error_mm != "0.0")
        .map(|(error_mm, by)| format!("{error_mm} mm {by}"))
        .collect();
    match errors.is_empty() {
        true => ", which is the exact range".to_owned(),
        false => format!(": {} exactly, {}", exactly(terms.ideal_m), joined(&errors, "and")),
    }
}

fn cause_of_return(cause: Cause) -> &'static str {
    match cause {
        Cause::Mixed => "the light of several surfaces makes one return, which may lie between them",
        Cause::Mirror => "the return is a surface's image in a mirror or in a film of water",
        Cause::Glass => "its light went through glass, or was reflected by it",
        Cause::FalseAlarm => "noise alone passes the threshold",
        Cause::Interference => "the receiver takes the pulse of another device for its own",
        Cause::Rain => "the return is from a drop of rain",
        Cause::Snow => "the return is from a flake of snow",
        Cause::Fog => "the return is from fog",
        Cause::Dust => "the return is from dust",
        Cause::Blooming => "the return is the halo of a bright return of another beam",
        Cause::Crosstalk => "the return is the light of another channel that fires at the same time",
        _ => "the pulse came back from a surface",
    }
}

/// The reason why a pixel has no return.
fn missing(told: &Told) -> String {
    let story = told.story;
    let why = match story.cause {
        Cause::Nothing => "the pulse meets nothing that sends light back".to_owned(),
        Cause::TooNear => {
            let limit = limit(told, told.sensor.range.min_m);
            match &story.blocker {
                Some((blocker, _)) => {
                    format!(
                        "a surface at {} is nearer than the sensor's least {limit} and blocks the beam",
                        at(blocker.range_m)
                    )
                }
                None => format!("a surface nearer than the sensor's least {limit} blocks the beam"),
            }
        }
        Cause::OutOfRange => {
            format!(
                "the surface is farther than the sensor's largest {}",
                limit(told, told.sensor.range.max_m)
            )
        }
        Cause::BelowThreshold => "too little light comes back to be detected".to_owned(),
        Cause::Absorbed => "the air takes so much of the light that the rest is not detected".to_owned(),
        Cause::Dropped => "noise hides this time an echo that is detected on average".to_owned(),
        _ => "the pixel sends no pulse".to_owned(),
    };
    format!("The pixel has no return, because {why}. The cause is `{}`.", story.cause.name())
}

/// `` `parked_car` (material `paint`, label 5)``.
fn named(told: &Told, met: &Met) -> String {
    let material = met.material.map(|index| &told.scene.geometry.materials[index as usize].name);
    let mut known: Vec<String> = Vec::new();
    known.extend(material.filter(|name| !name.is_empty()).map(|name| format!("material {}", quoted(name))));
    if met.label > 0 {
        known.push(match told.label_names.get(&met.label) {
            Some(name) => format!("label {} of {}", met.label, quoted(name)),
            None => format!("label {}", met.label),
        });
    }
    let name = name(told, met);
    if known.is_empty() { name } else { format!("{name} ({})", known.join(", ")) }
}

/// The target that sends light back, by its name: `` `parked_car` ``, or `rain`. The material tells parts of one object apart, and light that
/// does not come straight back says so.
fn short_name(told: &Told, met: &Met) -> String {
    let is_other_part = |other: &Met| {
        (other.object, other.cause) == (met.object, met.cause) && other.material != met.material
    };
    let material = met.material.map(|index| &told.scene.geometry.materials[index as usize].name);
    let material = match material.filter(|name| !name.is_empty()) {
        Some(name) if told.story.met.iter().any(is_other_part) => format!(" ({})", quoted(name)),
        _ => String::new(),
    };
    let way = match met.cause {
        Cause::Mirror => " by a mirror",
        Cause::Glass => " by way of glass",
        Cause::Blooming => " in a halo",
        Cause::Crosstalk => " by crosstalk",
        _ => "",
    };
    name(told, met) + &material + way
}

fn name(told: &Told, met: &Met) -> String {
    match met.object {
        None => met.cause.name().to_owned(),
        Some(index) => match &told.scene.geometry.objects[index as usize].name {
            // Files count objects from 1.
            name if name.is_empty() => format!("object {}", u64::from(index) + 1),
            name => quoted(name),
        },
    }
}

/// `at 12.300 m`, or `at 12.300 m to 12.340 m`.
fn span([least, most]: [f64; 2]) -> String {
    let (least, most) = (at(least), at(most));
    if least == most { format!("at {least}") } else { format!("at {least} to {most}") }
}

fn at(range_m: f64) -> String {
    format!("{} m", fixed(range_m, 3))
}

/// A range to the digit of the errors.
fn exactly(range_m: f64) -> String {
    format!("{} m", fixed(range_m, 4))
}

fn a_unit(signal: &Signal) -> String {
    format!("a {}", unit(signal))
}

fn height(signal: &Signal, energy: f64) -> String {
    match signal.unit {
        SignalUnit::Counts => format!("{} counts without pile-up", significant(energy)),
        _ => format!("{} of {}", a_unit(signal), significant(energy)),
    }
}

/// The sentences in lines of at most 100 characters, unless a word is longer. A number and its unit stay together.
pub fn wrapped(sentences: &str) -> String {
    const LONGEST: usize = 100;
    let is_unit = |word: &str| matches!(word.trim_end_matches(['.', ',', ';', ':']), "%" | "m" | "mm" | "s");
    let mut words: Vec<String> = Vec::new();
    for word in sentences.split(' ') {
        match words.last_mut() {
            Some(number) if is_unit(word) => {
                number.push(' ');
                number.push_str(word);
            }
            _ => words.push(word.to_owned()),
        }
    }
    let (mut text, mut length) = (String::new(), 0);
    for word in &words {
        let more = word.chars().count();
        if length > 0 && length + 1 + more > LONGEST {
            text.push('\n');
            length = 0;
        } else if length > 0 {
            text.push(' ');
            length += 1;
        }
        text += word;
        length += more;
    }
    text
}

/// A share as a percentage with two digits, of which none is 100 % or 0 % that is not.
fn share(share: f64) -> String {
    let percent = share * 1e2;
    if share < 1.0 && percent >= 99.5 {
        return "almost all".to_owned();
    }
    match percent {
        _ if percent >= 10.0 || percent == 0.0 => format!("{percent:.0} %"),
        _ if percent >= 0.1 => format!("{percent:.1} %"),
        _ => "less than 0.1 %".to_owned(),
    }
}

/// A number with so many decimals, and a proper minus sign; never −0.
pub fn fixed(value: f64, decimals: usize) -> String {
    let text = format!("{:.*}", decimals, value.abs());
    let is_zero = text.bytes().all(|b| matches!(b, b'0' | b'.'));
    if value < 0.0 && !is_zero { format!("−{text}") } else { text }
}

/// A number with so many decimals and its sign; 0 has none.
fn signed(value: f64, decimals: usize) -> String {
    let text = fixed(value, decimals);
    let is_zero = text.bytes().all(|b| matches!(b, b'0' | b'.'));
    if value > 0.0 && !is_zero { format!("+{text}") } else { text }
}

/// A number with three significant digits, and all digits before the point.
pub fn significant(value: f64) -> String {
    let size = value.abs();
    if size >= 1e9 || (size > 0.0 && size < 1e-4) {
        return format!("{value:.2e}").replace('-', "−");
    }
    let decimals = match size {
        _ if size == 0.0 || size >= 100.0 => 0,
        _ => (2 - libm::floor(libm::log10(size)) as i32).max(0) as usize,
    };
    fixed(value, decimals)
}

/// The sentence with a capital at its start. A name keeps its letters.
fn capital(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map_or(String::new(), |first| first.to_uppercase().chain(chars).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_as_many_digits_as_are_read() {
        let shown = [0.0, 34.23, 4.8149, 0.012345, 1234.5, -3.5, 1e-5, 2e12].map(significant);
        assert_eq!(shown, ["0", "34.2", "4.81", "0.0123", "1234", "−3.50", "1.00e−5", "2.00e12"]);
        assert_eq!([-3.5, -0.001, 0.004].map(|x| fixed(x, 2)), ["−3.50", "0.00", "0.00"]);
        assert_eq!([-4.04, 0.01, 2.0].map(|x| signed(x, 1)), ["−4.0", "0.0", "+2.0"]);
        assert_eq!(
            [1.0, 0.997, 0.784, 0.013, 1e-5].map(share),
            ["100 %", "almost all", "78 %", "1.3 %", "less than 0.1 %"]
        );
    }

    #[test]
    fn lines_end_between_words_and_no_unit_begins_one() {
        assert_eq!(wrapped("It is 3 m away."), "It is 3 m away.");
        let text = wrapped(&format!("{} stands at 12.3 m, and {}", "x".repeat(85), "y".repeat(120)));
        let lines: Vec<usize> = text.lines().map(|line| line.chars().count()).collect();
        assert_eq!(lines, ["x".repeat(85).len() + " stands at".len(), "12.3 m, and".len(), 120], "{text}");
    }

    #[test]
    fn sub_rays_that_meet_nothing_are_counted_in_words() {
        assert_eq!(losing(1, 1), "The ray meets nothing that sends light back.");
        assert_eq!(losing(7, 7), "None of the 7 sub-rays meets anything that sends light back.");
        assert_eq!(losing(1, 7), "1 of 7 sub-rays meets nothing that sends light back.");
        assert_eq!(losing(2, 7), "2 of 7 sub-rays meet nothing that sends light back.");
    }
}
