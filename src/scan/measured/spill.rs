//! The light that a pulse's receiver takes of other pulses' returns: their halos, and crosstalk between channels.
//!
//! Channels that fire at the same time each look for their own pulse. A little of the light of one reaches the detectors of the
//! others, by the optics and the electronics that they share. It comes at the same time as in its own channel, so that a bright
//! target has ghosts at its own range, in the directions of the others.

use std::collections::BTreeMap;

use super::halo::{Halo, Source, angle_between};
use super::light::{CROSSTALK, HALOS, Light};
use crate::physics::echo::pulse_sigma_m;
use crate::scan::Cause;
use crate::sensor::{Blooming, Capture, Pulse, Receiver};

/// The energy of light, relative to the noise, below which it is left out: a hundredth of the noise changes nothing.
const LEAST_ENERGY: f64 = 0.01;

/// Most returns of one firing whose light reaches the other channels: the brightest. It bounds the work of sensors whose pixels all
/// fire at the same time, and few have so many channels.
const MOST_IN_FIRING: usize = 256;

/// The light of some pixels that other pulses see.
#[derive(Clone, Debug, Default)]
pub(super) struct Sources {
    /// The light whose halo others see, part by part.
    bright: Vec<Source>,
    /// The light that other channels take which fire at the same time, return by return.
    leaks: Vec<Source>,
}

/// The rule for what becomes a source.
pub(super) struct Brightness {
    /// The energy from which on other pulses see the halo of light.
    least_of_halo: Option<f64>,
    /// The energy from which on other channels take light.
    least_of_leak: Option<f64>,
    /// Light of an object that lies within this distance, in metres, leaks as one.
    together_m: f64,
}

impl Brightness {
    /// The rule for a capture. `None` if no pulse takes light of others, however bright.
    pub fn of(capture: &Capture) -> Option<Self> {
        let measurement = &capture.sensor.measurement;
        let share_of_halo = |blooming: &Blooming| most_of_halo(blooming, capture).max(1e-300);
        let least_of_halo =
            measurement.blooming.as_ref().map(|blooming| LEAST_ENERGY / share_of_halo(blooming));
        let leaking = measurement.receiver.as_ref().filter(|receiver| receiver.crosstalk > 0.0);
        // Many channels may leak into one, each a little.
        let least = |receiver: &Receiver| LEAST_ENERGY / (receiver.crosstalk * capture.rows() as f64);
        let least_of_leak = leaking.map(least);
        let together_m = leaking.map_or(0.0, |receiver| 0.25 * pulse_sigma_m(receiver.pulse_fwhm_s));
        let is_any = least_of_halo.is_some() || least_of_leak.is_some();
        is_any.then_some(Self { least_of_halo, least_of_leak, together_m })
    }

    /// Adds the light of a pixel that other pulses may see.
    pub fn add(&self, pixel: u32, pulse: &Pulse, lights: &[Light], sources: &mut Sources) {
        let source = |light: &Light| Source {
            pixel,
            direction: pulse.direction,
            fired_ns: fired_ns(pulse),
            length_m: light.length_m,
            energy: light.energy,
            target: light.target,
        };
        if let Some(least) = self.least_of_halo {
            sources.bright.extend(lights.iter().filter(|light| light.energy >= least).map(source));
        }
        if let Some(least) = self.least_of_leak {
            let mut sorted: Vec<&Light> = lights.iter().collect();
            sorted.sort_by(|a, b| a.length_m.total_cmp(&b.length_m).then(a.path.cmp(&b.path)));
            let mut rest = &sorted[..];
            while let [nearest, ..] = rest {
                let is_apart = |light: &&Light| {
                    light.length_m - nearest.length_m > self.together_m
                        || light.target.object != nearest.target.object
                };
                let (together, after) = rest.split_at(rest.iter().position(is_apart).unwrap_or(rest.len()));
                rest = after;
                let energy: f64 = together.iter().map(|light| light.energy).sum();
                let beyond_m: f64 =
                    together.iter().map(|light| light.energy * (light.length_m - nearest.length_m)).sum();
                if energy >= least {
                    let length_m = nearest.length_m + beyond_m / energy;
                    sources.leaks.push(Source { length_m, energy, ..source(nearest) });
                }
            }
        }
    }
}

impl Sources {
    /// The sources of several groups of pixels, one after the other.
    pub fn concat(groups: Vec<Self>) -> Self {
        let (bright, leaks): (Vec<_>, Vec<_>) = groups.into_iter().map(|one| (one.bright, one.leaks)).unzip();
        Self { bright: bright.concat(), leaks: leaks.concat() }
    }
}

/// The largest share of a halo that any other pulse of a capture sees.
fn most_of_halo(blooming: &Blooming, capture: &Capture) -> f64 {
    // The least angle between neighbours, in the middle of the image and at its edges.
    let direction = |row, column| capture.pulse(row, column).map(|pulse: Pulse| pulse.direction);
    let (rows, columns) = (capture.rows(), capture.columns());
    let mut least_rad = blooming.reach.radians();
    for row in [0, rows / 2, rows.saturating_sub(2)] {
        for column in [0, columns / 2, columns.saturating_sub(2)] {
            let here = direction(row, column);
            for (row, column) in [(row + 1, column), (row, column + 1)] {
                if row < rows
                    && column < columns
                    && let (Some(here), Some(there)) = (here, direction(row, column))
                {
                    least_rad = least_rad.min(angle_between(here, there));
                }
            }
        }
    }
    blooming.share(least_rad)
}

/// The nanosecond at which a pulse is fired, by which channels fire at the same time: light goes 15 cm there and back in it, and no
/// sensor fires its channels so soon one after the other.
fn fired_ns(pulse: &Pulse) -> i64 {
    (pulse.time_s * 1e9).round() as i64
}

/// The light of a frame that pulses take from others.
pub(super) struct Spill<'b> {
    sources: Sources,
    halo: Option<Halo<'b>>,
    /// The share of a return's energy that channels take which fire at the same time.
    crosstalk: f64,
    /// The indices of the leaks that are fired in each nanosecond, in ascending order.
    firings: BTreeMap<i64, Vec<u32>>,
}

impl<'b> Spill<'b> {
    /// The light of sources, which are in an order that does not depend on threads.
    pub fn new(capture: &'b Capture<'b>, sources: Sources) -> Self {
        let measurement = &capture.sensor.measurement;
        let crosstalk = measurement.receiver.as_ref().map_or(0.0, |receiver| receiver.crosstalk);
        let mut firings: BTreeMap<i64, Vec<u32>> = BTreeMap::new();
        for (index, leak) in (0..).zip(&sources.leaks) {
            firings.entry(leak.fired_ns).or_default().push(index);
        }
        let energy = |index: u32| sources.leaks[index as usize].energy;
        for firing in firings.values_mut() {
            firing.sort_unstable_by(|&a, &b| energy(b).total_cmp(&energy(a)).then(a.cmp(&b)));
            firing.truncate(MOST_IN_FIRING);
            firing.sort_unstable();
        }
        let halo = measurement.blooming.as_ref().map(|blooming| Halo::new(blooming, &sources.bright));
        Self { sources, halo, crosstalk, firings }
    }

    /// Adds the light that a pixel's pulse, number `number` of its strip, takes of other pixels' returns.
    pub fn add(&self, pixel: u32, number: u32, pulse: &Pulse, lights: &mut Vec<Light>) {
        let light = |source: &Source, share: f64, path: u32, cause: Cause| Light {
            pulse: number,
            path,
            range_m: pulse.range_m(source.length_m),
            length_m: source.length_m,
            energy: source.energy * share,
            clear_air: 1.0,
            cause,
            target: source.target,
        };
        let Sources { bright, leaks } = &self.sources;
        for (index, share) in self.halo.iter().flat_map(|halo| halo.shares(pulse, bright)) {
            let source = &bright[index as usize];
            if source.pixel != pixel && source.energy * share >= LEAST_ENERGY {
                lights.push(light(source, share, HALOS + index, Cause::Blooming));
            }
        }
        for &index in self.firings.get(&fired_ns(pulse)).into_iter().flatten() {
            let source = &leaks[index as usize];
            if source.pixel != pixel {
                lights.push(light(source, self.crosstalk, CROSSTALK + index, Cause::Crosstalk));
            }
        }
    }
}
