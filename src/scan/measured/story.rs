//! The story of one pulse of a sensor that is not ideal.

use std::collections::BTreeSet;

use rayon::prelude::*;

use super::light::{Light, PATHS_A_SAMPLE};
use super::receive::{Candidate, Watch};
use super::spill::{Brightness, Sources, Spill};
use super::{Memory, Scanner};
use crate::physics::echo::{Part, Waveform};
use crate::scan::story::{Fate, Met, Sent, Signal, SignalPeak, SignalUnit, Story, material_of};
use crate::scan::{Cause, NO_OBJECT, Progress};
use crate::scene::Scene;
use crate::sensor::{Capture, Receiver};
use crate::trace::Cast;

/// Casts one pixel of a capture by the code that casts its frame, and tells what becomes of its pulse.
pub(in crate::scan) fn explain(
    scene: &Scene,
    tracer: &impl Cast,
    capture: &Capture,
    row: usize,
    column: usize,
) -> Story {
    let default_receiver = Receiver::default();
    let measurement = &capture.sensor.measurement;
    let receiver = measurement.receiver.as_ref().unwrap_or(&default_receiver);
    let scanner = Scanner::new(scene, tracer, capture, receiver);
    let spill =
        Brightness::of(capture).map(|brightness| Spill::new(capture, scanner.sources_of_frame(&brightness)));
    let mut memory = Memory::default();
    scanner.illuminate_part((row, column), (1, 1), &mut memory, &Progress::default());
    let Memory { lit, desk, .. } = &mut memory;
    let strip = scanner.receive_all(lit, spill.as_ref(), desk);

    let mut story = Story::of_pixel(row, column);
    story.cause = strip.causes[0];
    let mut returns = strip.returns.into_iter().map(|(one, echo)| (one, Some(echo)));
    if story.cause == Cause::TooNear {
        story.blocker = returns.next();
    }
    story.returns.extend(returns);
    let Some(pulse) = lit.pulses.first() else { return story };
    let axis = scanner.beams.rays(row, column, pulse).next();
    story.pulse = Some(Sent::of(capture, pulse, axis.map_or(pulse.direction, |ray| ray.direction)));
    story.extinction_per_m = scanner.air.extinction_per_m;

    let mut record = Record::default();
    scanner.receive(lit, 0, spill.as_ref(), desk, &mut record);
    let (unit, in_unit) = match (&scanner.detector.gauge, scanner.detector.threshold()) {
        (Some(gauge), _) => (SignalUnit::Counts, gauge.counts_of(1.0)),
        (None, Some(_)) => (SignalUnit::Snr, 1.0),
        (None, None) => (SignalUnit::Energy, 1.0),
    };
    let part = |part: &Part| Part { energy: part.energy * in_unit, ..*part };
    let parts: Vec<Part> = record.parts.iter().map(part).collect();
    let (met, group_of) = groups(scene, &record.lights, &parts, scanner.beams.samples());
    story.met = met;
    story.sub_rays = scanner.beams.samples();
    story.lost_rays = story.sub_rays - samples(record.lights.iter(), story.sub_rays).len();
    let mut signal = Signal {
        unit,
        sigma_m: scanner.detector.sigma_m(),
        threshold: scanner.detector.threshold().filter(|_| unit == SignalUnit::Snr),
        parts,
        peaks: Vec::new(),
    };
    signal.peaks = record.peaks(&signal, &group_of);
    story.signal = Some(signal);
    story
}

impl<C: Cast> Scanner<'_, C> {
    /// The light of a whole frame that other pulses may see, in the order in which a scan of the frame has it.
    fn sources_of_frame(&self, brightness: &Brightness) -> Sources {
        let sources: Vec<Sources> = self
            .strips()
            .par_iter()
            .map_init(Memory::default, |memory, &first| {
                self.illuminate(first, memory, &Progress::default());
                self.sources(&memory.lit, brightness)
            })
            .collect();
        Sources::concat(sources)
    }
}

/// Which of so many sub-rays light comes back on. The paths to particles, of halos and of crosstalk have larger numbers.
fn samples<'l>(lights: impl Iterator<Item = &'l Light>, count: usize) -> BTreeSet<u32> {
    lights.map(|light| light.path / PATHS_A_SAMPLE).filter(|sample| (*sample as usize) < count).collect()
}

/// The light by what sends it back, the nearest first, and for each light the number of its group. The light is sorted by range, and
/// each has its part of the waveform.
fn groups(scene: &Scene, lights: &[Light], parts: &[Part], sub_rays: usize) -> (Vec<Met>, Vec<usize>) {
    let mut met: Vec<Met> = Vec::new();
    let (mut group_of, mut in_clear_air) = (Vec::new(), Vec::new());
    for (light, part) in lights.iter().zip(parts) {
        let target = &light.target;
        let object = (target.object != NO_OBJECT).then_some(target.object);
        let material = material_of(scene, target.triangle);
        let is_same = |one: &Met| {
            (one.cause, one.object, one.material, one.label) == (light.cause, object, material, target.label)
        };
        let group = met.iter().position(is_same).unwrap_or_else(|| {
            met.push(Met {
                cause: light.cause,
                object,
                material,
                label: target.label,
                sub_rays: 0,
                paths: 0,
                range_m: [light.range_m; 2],
                energy: 0.0,
                share: 0.0,
                transmission: 1.0,
            });
            in_clear_air.push(0.0);
            met.len() - 1
        });
        met[group].paths += 1;
        met[group].range_m[1] = light.range_m;
        met[group].energy += part.energy;
        in_clear_air[group] += part.energy * light.clear_air;
        group_of.push(group);
    }
    let all: f64 = met.iter().map(|one| one.energy).sum();
    for (group, one) in met.iter_mut().enumerate() {
        let own = lights.iter().zip(&group_of).filter(|(_, of)| **of == group).map(|(light, _)| light);
        one.sub_rays = samples(own, sub_rays).len();
        one.share = if all > 0.0 { one.energy / all } else { 0.0 };
        if in_clear_air[group] > 0.0 {
            one.transmission = one.energy / in_clear_air[group];
        }
    }
    (met, group_of)
}

/// The light of one pulse, and the fates of its peaks.
#[derive(Default)]
struct Record {
    lights: Vec<Light>,
    parts: Vec<Part>,
    lost: Vec<(Candidate, Cause)>,
    detected: Vec<Candidate>,
    chosen: Vec<Candidate>,
}

impl Watch for Record {
    fn light(&mut self, lights: &[Light], parts: &[Part]) {
        (self.lights, self.parts) = (lights.to_vec(), parts.to_vec());
    }

    fn lose(&mut self, candidate: &Candidate, cause: Cause) {
        self.lost.push((*candidate, cause));
    }

    fn detect(&mut self, candidates: &[Candidate]) {
        self.detected = candidates.to_vec();
    }

    fn choose(&mut self, chosen: &[Candidate]) {
        self.chosen = chosen.to_vec();
    }
}

impl Record {
    /// The peaks of a signal with their fates, the nearest first. `group_of` has the group of each part of the signal.
    fn peaks(&self, signal: &Signal, group_of: &[usize]) -> Vec<SignalPeak> {
        let fate = |one: &Candidate| {
            let is_same = |chosen: &Candidate| {
                (chosen.path, chosen.cause, chosen.range_m) == (one.path, one.cause, one.range_m)
            };
            self.chosen.iter().position(is_same).map_or(Fate::NotChosen, Fate::Returned)
        };
        let peak = |one: &Candidate, fate: Fate| SignalPeak {
            range_m: one.range_m,
            height: one.counted.map_or(one.snr, |counted| counted.counts.mean),
            amplitude: one.counted.map_or(one.amplitude, |counted| f64::from(counted.counts.drawn)),
            counts: one.counted.map(|counted| counted.counts),
            width_m: one.sigma_m,
            cause: one.cause,
            fate,
            sources: if one.snr > 0.0 { sources(signal, group_of, one.range_m) } else { Vec::new() },
        };
        let lost = self.lost.iter().map(|(one, cause)| peak(one, Fate::Lost(*cause)));
        let detected = self.detected.iter().map(|one| peak(one, fate(one)));
        let mut peaks: Vec<SignalPeak> = lost.chain(detected).collect();
        peaks.sort_by(|a, b| a.range_m.total_cmp(&b.range_m));
        peaks
    }
}

/// The groups whose light makes the height of a signal at a range, each with its share, the largest first.
fn sources(signal: &Signal, group_of: &[usize], range_m: f64) -> Vec<(usize, f64)> {
    let waveform = Waveform::new(&signal.parts, signal.sigma_m);
    let mut shares: Vec<(usize, f64)> = Vec::new();
    for (part, &group) in signal.parts.iter().zip(group_of) {
        let share = waveform.share(part, range_m);
        match shares.iter_mut().find(|(of, _)| *of == group) {
            Some((_, sum)) => *sum += share,
            None => shares.push((group, share)),
        }
    }
    let all: f64 = shares.iter().map(|(_, share)| share).sum();
    shares.iter_mut().for_each(|(_, share)| *share /= all.max(f64::MIN_POSITIVE));
    shares.retain(|(_, share)| *share > 0.0);
    shares.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    shares
}
