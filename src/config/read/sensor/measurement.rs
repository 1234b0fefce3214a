//! The tables by which a sensor measures → [`Measurement`].

use super::super::super::keys::measurement::{self as keys, blooming, footprint, noise, receiver};
use super::super::super::kinds::{List, Vector};
use super::super::super::plausibility;
use super::super::super::table::{AnyKey, Key, Table};
use super::super::sensor_files::SensorFiles;
use crate::angle::Angle;
use crate::physics::SPEED_OF_LIGHT_M_S;
use crate::physics::detection::{RangePair, Sensitivity};
use crate::physics::footprint::E2_IN_FWHM;
use crate::sensor::{Blooming, DimmerBeams, Footprint, Measurement, Noise, RangeLimits, Receiver, Spad};
use crate::source::Span;
use crate::source::words::{counted, number};

/// How the sensor of a table measures. A table that is wrong is reported, and counts as left out.
///
/// `files` has the files that the sensor names, and `max_at` is where the largest range is written.
pub(in super::super) fn measurement(
    t: &Table<'_>,
    files: &SensorFiles,
    range: RangeLimits,
    max_at: Span,
) -> Measurement {
    let receiver = t.read(&keys::RECEIVER).map(|t| receiver(&t.value, range, max_at));
    let noise = t.read(&keys::NOISE).map(|t| noise(&t.value, receiver.as_ref()));
    Measurement {
        footprint: t.read(&keys::FOOTPRINT).and_then(|t| footprint(&t.value)),
        receiver,
        noise,
        blooming: t.read(&keys::BLOOMING).and_then(|t| blooming(&t.value)),
        depth: super::depth::sensing(t, files),
    }
}

/// Angles of divergence are less than this, in mrad: the model's beams are narrow.
const MOST_DIVERGENCE_MRAD: f64 = 1000.0;

fn footprint(t: &Table<'_>) -> Option<Footprint> {
    let divergence = t.read(&footprint::DIVERGENCE);
    let kind = t.read(&footprint::KIND);
    let exit_radius_m = t.value(&footprint::EXIT_RADIUS);
    let samples = t.value(&footprint::SAMPLES);
    let (divergence, is_fwhm) = (divergence?, kind?.value);
    let is_right = |mrad: &f64| *mrad > 0.0 && *mrad < MOST_DIVERGENCE_MRAD;
    if let Some(wrong) = divergence.value.iter().find(|mrad| !is_right(mrad)) {
        let message = format!("a beam's divergence is {wrong} mrad");
        let help = "a degree is 17.45 mrad".to_owned();
        let label = format!("expected angles greater than 0 and less than {MOST_DIVERGENCE_MRAD}");
        return t.report().fail(divergence.span, message, label, Some(help));
    }
    let at_e2 = if is_fwhm { E2_IN_FWHM } else { 1.0 };
    let half_divergence = divergence.value.map(|full_mrad| Angle::rad(0.5 * at_e2 * full_mrad * 1e-3));
    Some(Footprint { half_divergence, exit_radius_m, samples })
}

fn receiver(t: &Table<'_>, range: RangeLimits, max_at: Span) -> Receiver {
    let range_pairs = range_pairs(t, &receiver::RANGE_PAIRS, range, max_at);
    let sensitivity = Sensitivity::fit(&range_pairs);
    let doubt = sensitivity.and_then(|fit| plausibility::pairs_misfit(receiver::RANGE_PAIRS.name(), &fit));
    if let Some(doubt) = doubt {
        t.report().doubt(t.span_of(&receiver::RANGE_PAIRS), doubt);
    }
    let [false_alarm, interference_hz] = [&receiver::FALSE_ALARM, &receiver::INTERFERENCE].map(|key| {
        let given = t.value(key);
        need_window(t, key, given, range);
        given
    });
    let receiver = Receiver {
        wavelength_m: t.value(&receiver::WAVELENGTH) * 1e-9,
        sensitivity,
        beams: dimmer_beams(t, sensitivity, range, max_at),
        range_pairs,
        detection: t.value(&receiver::DETECTION),
        false_alarm,
        pulse_fwhm_s: t.value(&receiver::PULSE_FWHM) * 1e-9,
        returns: t.value(&receiver::RETURNS),
        separation_m: t.value(&receiver::SEPARATION),
        intensity: t.value(&receiver::INTENSITY),
        spacing_m: t.value(&receiver::SPACING),
        bounces: t.value(&receiver::BOUNCES),
        walk_residual: t.value(&receiver::WALK_RESIDUAL),
        saturation_snr: t.read(&receiver::SATURATION).map_or(f64::INFINITY, |snr| snr.value),
        sun_share: t.value(&receiver::SUN_SHARE),
        sun_klx: t.value(&receiver::SUN_KLX),
        interference_hz,
        interference_snr: t.value(&receiver::INTERFERENCE_SNR),
        crosstalk: t.value(&receiver::CROSSTALK),
        overlap_m: t.value(&receiver::OVERLAP),
        ..Receiver::default()
    };
    let [from, to] = receiver.overlap_m;
    if from < 0.0 || from >= to {
        let message = format!("the fields of view come to overlap from {from} m to {to} m");
        let label = "expected 0 or more first, then more than that";
        t.report().error(t.span_of(&receiver::OVERLAP), message, label, None);
    }
    match spad(t, &receiver, range) {
        Some(spad) => counting(t, receiver, spad, range),
        None => receiver,
    }
}

/// How the receiver counts photons, if it does, and all that this needs is right.
fn spad(t: &Table<'_>, receiver: &Receiver, range: RangeLimits) -> Option<Spad> {
    let is_spad = t.value(&receiver::DETECTOR);
    let cycles = t.read(&receiver::SPAD_CYCLES);
    let [bin_ns, dead_ns, background_hz] =
        [&receiver::SPAD_BIN, &receiver::SPAD_DEAD, &receiver::SPAD_BACKGROUND].map(|key| t.read(key));
    let report = t.report();
    if !is_spad {
        let first: [(&dyn AnyKey, Option<Span>); 4] = [
            (&receiver::SPAD_CYCLES, cycles.map(|cycles| cycles.span)),
            (&receiver::SPAD_BIN, bin_ns.map(|bin| bin.span)),
            (&receiver::SPAD_DEAD, dead_ns.map(|dead| dead.span)),
            (&receiver::SPAD_BACKGROUND, background_hz.map(|background| background.span)),
        ];
        if let Some((key, Some(span))) = first.into_iter().find(|(_, span)| span.is_some()) {
            let message =
                format!("`{}` is of a detector that counts photons, and this one is linear", key.name());
            let help = "add `detector = \"spad\"`, or leave the keys out that begin with `spad_`";
            report.error(span, message, "needs `detector = \"spad\"`", Some(help.into()));
        }
        return None;
    }
    t.need(&receiver::SPAD_CYCLES, "`spad_cycles = 500`, the laser's cycles times the diodes of a histogram");
    t.need(&receiver::SPAD_BIN, "`spad_bin_ns = 1.0`, the width of a bin");
    let at = t.span_of(&receiver::DETECTOR);
    if receiver.range_pairs.is_empty() {
        let message = "a detector that counts photons has no range pairs".to_owned();
        let help = "give `[receiver]` some `range_pairs`: they say how much light comes back from a plane";
        report.error(at, message, "needs `range_pairs`", Some(help.into()));
        return None;
    }
    if !range.max_m.is_finite() {
        let message = "a detector that counts photons has a range without an end".to_owned();
        let help = "give `[range]` a `max_m`, the end of the histogram";
        report.error(at, message, "needs `max_m` in `[range]`", Some(help.into()));
        return None;
    }
    if receiver.walk_residual > 0.0 {
        let message = format!(
            "`walk_residual` is {}, and a detector that counts photons has no threshold that a pulse walks over",
            receiver.walk_residual
        );
        let help = "leave it out, or give 0: the ranges of bright targets follow from pile-up";
        let label = "is of `detector = \"linear\"`";
        report.error(t.span_of(&receiver::WALK_RESIDUAL), message, label, Some(help.into()));
    }
    let (cycles, bin_ns) = (cycles?.value, bin_ns?);
    let bins = range.max_m / (bin_ns.value * 1e-9 * 0.5 * SPEED_OF_LIGHT_M_S);
    if bins > Spad::MOST_BINS as f64 {
        let message = format!("a bin of {} ns is one of {bins:.0} up to {} m", bin_ns.value, range.max_m);
        let label = format!("expected at most {} bins", Spad::MOST_BINS);
        report.error(bin_ns.span, message, label, Some("1 ns is 15 cm".into()));
        return None;
    }
    let least_ns = 1e9 * Spad::least_dead_s(receiver.pulse_fwhm_s);
    if let Some(dead_ns) = &dead_ns
        && dead_ns.value < least_ns
    {
        let message = format!("a diode is blind for {} ns, less than an echo lasts", dead_ns.value);
        let label = format!("expected at least {least_ns:.1} ns, seven standard deviations of the pulse");
        let help = "leave it out for a diode that is blind until the next cycle";
        report.error(dead_ns.span, message, label, Some(help.into()));
        return None;
    }
    Some(Spad {
        cycles,
        bin_s: bin_ns.value * 1e-9,
        dead_s: dead_ns.map_or(f64::INFINITY, |dead| dead.value * 1e-9),
        background_hz: background_hz.map_or(0.0, |background| background.value),
    })
}

/// The receiver as one that counts photons. Where it can't detect its range pairs, that is reported.
fn counting(t: &Table<'_>, receiver: Receiver, spad: Spad, range: RangeLimits) -> Receiver {
    let linear = receiver.clone();
    match receiver.counting(spad, range.max_m) {
        Ok(counting) => counting,
        Err(pair) => {
            let message = format!(
                "no light from {} m is detected in {} % of histograms of {} cycles with {} background counts a second",
                pair.range_m,
                number(linear.detection * 1e2),
                spad.cycles,
                number(spad.background_hz)
            );
            let label = "expected cycles that are left at the ranges of `range_pairs`";
            let help = "expect more cycles, less background, or a shorter dead time";
            t.report().error(t.span_of(&receiver::SPAD_CYCLES), message, label, Some(help.into()));
            linear
        }
    }
}

/// Reports what arrives at random times where there is no last time: a range window has an end.
fn need_window(t: &Table<'_>, key: &dyn AnyKey, given: f64, range: RangeLimits) {
    if given > 0.0 && !range.max_m.is_finite() {
        let message = format!(
            "`{}` is {given}: such returns are at any range, and the sensor's range has no end",
            key.name()
        );
        let help = "give `[range]` a `max_m`, the end of the range window";
        t.report().error(t.span_of(key), message, "needs `max_m` in `[range]`", Some(help.into()));
    }
}

/// The rows whose beams see less far than the receiver's range pairs say, whose fit is `sensitivity`. What is wrong is reported and
/// left out.
fn dimmer_beams(
    t: &Table<'_>,
    sensitivity: Option<Sensitivity>,
    range: RangeLimits,
    max_at: Span,
) -> Vec<DimmerBeams> {
    let Some(given) = t.read(&receiver::BEAMS) else { return Vec::new() };
    let report = t.report();
    if !given.value.is_empty() {
        t.need(&receiver::RANGE_PAIRS, "`range_pairs = [[0.1, 80.0]]`, how far all other beams see");
    }
    let mut known: Vec<usize> = Vec::new();
    let mut all = Vec::new();
    for group in &given.value {
        let rows = group.read(&receiver::ROWS);
        let pairs = range_pairs(group, &receiver::PAIRS_OF_ROWS, range, max_at);
        let Some(rows) = rows else { continue };
        for row in &rows.value {
            if known.contains(&row.value) {
                report.error(
                    row.span,
                    format!("row {} has range pairs already", row.value),
                    "listed twice",
                    None,
                );
            }
            known.push(row.value);
        }
        let Some((sensitivity, (power, misfit))) =
            sensitivity.and_then(|fit| Some((fit, fit.power_of(&pairs)?)))
        else {
            continue;
        };
        let at = group.span_of(&receiver::PAIRS_OF_ROWS);
        // Ranges that differ in their last digits alone are equal.
        if power > 1.0 + 1e-9 {
            let farther = sensitivity.range_m(power * pairs[0].reflectivity)
                / sensitivity.range_m(pairs[0].reflectivity);
            let message = format!(
                "these beams see {:.1} % farther than the receiver's `range_pairs` say",
                (farther - 1.0) * 1e2
            );
            let help = "give `[receiver]` the `range_pairs` of the beams that see farthest, and `beams` those of all others";
            report.error(at, message, "expected ranges that are not larger", Some(help.into()));
            continue;
        }
        if let Some(doubt) = plausibility::pairs_of_beams_misfit(receiver::PAIRS_OF_ROWS.name(), misfit) {
            report.doubt(at, doubt);
        }
        let rows = rows.value.into_iter().map(|row| row.value).collect();
        all.push(DimmerBeams { rows, range_pairs: pairs, power: power.min(1.0), misfit });
    }
    all
}

/// Reports rows of `beams` that a sensor's image lacks.
pub(super) fn check_rows(t: &Table<'_>, rows: usize) {
    let Some(receiver) = t.read(&keys::RECEIVER).filter(|receiver| receiver.value.has(&receiver::BEAMS))
    else {
        return;
    };
    let Some(groups) = receiver.value.read(&receiver::BEAMS) else { return };
    let listed =
        groups.value.iter().filter_map(|group| group.read(&receiver::ROWS)).flat_map(|rows| rows.value);
    for row in listed.filter(|row| row.value >= rows) {
        let message = format!("there is no row {}: {} count from 0", row.value, counted(rows, "row"));
        t.report().error(row.span, message, format!("expected at most {}", rows - 1), None);
    }
}

/// The range pairs of a table, in ascending order of reflectance; none if one is wrong.
fn range_pairs(
    t: &Table<'_>,
    key: &Key<List<Vector<2>>>,
    range: RangeLimits,
    max_at: Span,
) -> Vec<RangePair> {
    /// Reflectances are relative to white, and glossy surfaces have more.
    const MOST_REFLECTANCE: f64 = 2.0;
    let Some(given) = t.read(key) else { return Vec::new() };
    let report = t.report();
    if given.value.len() > receiver::MOST_PAIRS {
        let message = format!("`range_pairs` has {} pairs", given.value.len());
        report.error(given.span, message, format!("expected at most {}", receiver::MOST_PAIRS), None);
        return Vec::new();
    }
    let mut pairs = Vec::with_capacity(given.value.len());
    for pair in &given.value {
        let [reflectivity, range_m] = pair.value;
        if !(reflectivity > 0.0 && reflectivity <= MOST_REFLECTANCE && range_m > 0.0) {
            let message =
                format!("a range pair has the reflectance {reflectivity} and the range {range_m} m");
            let label = "expected [reflectance, metres], such as [0.1, 90.0]";
            let help = match reflectivity > MOST_REFLECTANCE && reflectivity <= 100.0 {
                true => format!("{reflectivity} % is a reflectance of {}", number(reflectivity / 100.0)),
                false => format!(
                    "a reflectance is greater than 0 and at most {MOST_REFLECTANCE}, 1 for white, and a range is greater than 0"
                ),
            };
            report.error(pair.span, message, label, Some(help));
            return Vec::new();
        }
        // A job that shortens the range of its preset means that.
        if range_m > range.max_m && pair.span.source == max_at.source {
            report.doubt(pair.span, plausibility::pair_beyond_limit(key.name(), range_m, range.max_m));
        }
        pairs.push((RangePair { reflectivity, range_m }, pair.span));
    }
    pairs.sort_by(|(a, _), (b, _)| a.reflectivity.total_cmp(&b.reflectivity));
    for two in pairs.windows(2) {
        let [(darker, at), (brighter, later)] = [two[0], two[1]];
        if brighter.range_m < darker.range_m {
            let message = format!(
                "a plane of the reflectance {} is detected up to {} m, and one of {} only up to {} m",
                darker.reflectivity, darker.range_m, brighter.reflectivity, brighter.range_m
            );
            let help = "a pair is [reflectance, metres]; brighter planes are detected as far or farther";
            let span = report.later(at, later);
            report.error(span, message, "expected ranges that grow with the reflectance", Some(help.into()));
            return Vec::new();
        }
    }
    pairs.into_iter().map(|(pair, _)| pair).collect()
}

/// The noise of a sensor with this receiver.
fn noise(t: &Table<'_>, receiver: Option<&Receiver>) -> Noise {
    let degrees = |key| Angle::deg(t.value(key));
    let noise = Noise {
        range_floor_m: t.value(&noise::FLOOR),
        range_a_m: t.value(&noise::A),
        range_b: t.value(&noise::B),
        bias_m: t.value(&noise::BIAS),
        gain: t.value(&noise::GAIN),
        angle: degrees(&noise::ANGLE),
        beam_angle: degrees(&noise::BEAM_ANGLE),
        range_unit_m: t.value(&noise::UNIT),
    };
    if noise.range_a_m > 0.0 && receiver.is_some_and(|receiver| receiver.spad.is_some()) {
        let message = format!(
            "`range_a_m` is {}, and the noise of a detector that counts photons follows from its counts",
            noise.range_a_m
        );
        let help = "give `range_a_m = 0.0`; `range_floor_m` adds to the noise of the counts";
        t.report().error(t.span_of(&noise::A), message, "is of `detector = \"linear\"`", Some(help.into()));
    } else if noise.range_a_m > 0.0 && receiver.is_none_or(|receiver| receiver.sensitivity.is_none()) {
        let message = format!(
            "`range_a_m` is {}: it scales with the signal-to-noise ratio, and no range pairs say what that is",
            noise.range_a_m
        );
        let help = "give `[receiver]` some `range_pairs`, or use `range_floor_m`, which needs none";
        let label = "needs `range_pairs` in `[receiver]`";
        t.report().error(t.span_of(&noise::A), message, label, Some(help.into()));
    }
    noise
}

fn blooming(t: &Table<'_>) -> Option<Blooming> {
    let [core, halo, exponent] =
        [&blooming::CORE, &blooming::HALO, &blooming::EXPONENT].map(|key| t.value(key));
    let halo_angle = t.read(&blooming::HALO_ANGLE);
    let reach = t.read(&blooming::REACH);
    if halo > 0.0 {
        t.need(&blooming::HALO_ANGLE, "`halo_deg = 0.5`, the width of the halo");
    }
    let reach_deg = reach?.value;
    // Without a halo its width does not count, and the reach is one that divides.
    let halo_deg = halo_angle.map_or(reach_deg, |angle| angle.value);
    Some(Blooming {
        core: Angle::deg(core),
        halo,
        halo_angle: Angle::deg(halo_deg),
        exponent,
        reach: Angle::deg(reach_deg),
    })
}
