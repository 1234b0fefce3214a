//! Scans of sensors that are not ideal.
//!
//! ```text
//! beams    the sub-rays of each pulse, in the direction that it really takes
//! paths    the ways of their light through the scene
//! air      what fog, dust, rain and snow send back
//! spill    what pulses take of others' returns; halo: the halos of bright ones
//! light    what comes back, path by path
//! receive  the receiver: from light to returns, each with its cause and its error budget
//! counts   a receiver that counts photons
//! story    one pulse on all of this way, and what became of each peak
//! ```
//!
//! Each random number follows from the seed, the sensor, the frame, the pixel, the path of the light and the effect, so frames do
//! not depend on threads, and an effect that is turned on changes no draw of another.

mod air;
mod beams;
mod counts;
mod halo;
mod light;

mod paths;
mod receive;
mod spill;
mod story;

use std::sync::atomic::Ordering::Relaxed;

use rayon::prelude::*;

use self::air::{Air, AirRay};
use self::beams::Beams;
use self::light::{IDEAL_SAMPLE, Light, Target};
use self::paths::{Back, Paths, Wave, Waves, Way};
use self::receive::{Detector, Received, Reception, Scratch, Watch};
use self::spill::{Brightness, Sources, Spill};
pub(super) use self::story::explain;
use super::ray_batch::Ray;
use super::strips::{STRIP, SensorPose, TILE};
use super::sunlight::{Place, sunlight};
use super::{Cause, Echo, Frame, NO_OBJECT, Progress, Return};
use crate::physics::echo::Part;
use crate::scene::{Scene, Sun};
use crate::sensor::{Capture, Pulse, Receiver};
use crate::trace::Cast;

/// Casts a capture of a sensor that is not ideal, as [`scan_into`](super::scan_into) does.
pub(super) fn scan_into(
    frame: &mut Frame,
    scene: &Scene,
    tracer: &impl Cast,
    capture: &Capture,
    progress: &Progress,
) -> bool {
    let default_receiver = Receiver::default();
    let measurement = &capture.sensor.measurement;
    let receiver = measurement.receiver.as_ref().unwrap_or(&default_receiver);
    let keeps_waveforms = frame.keeps_waveforms();
    let scanner = Scanner { keeps_waveforms, ..Scanner::new(scene, tracer, capture, receiver) };
    let (rows, columns) = (capture.rows(), capture.columns());
    let (strips, width) = (scanner.strips(), strip_columns(scanner.beams.samples()));
    let is_cancelled = || progress.cancelled.load(Relaxed);
    let received: Vec<Strip> = match Brightness::of(capture) {
        None => strips
            .par_iter()
            .map_init(Memory::default, |memory, &first| {
                if is_cancelled() {
                    return Strip::default();
                }
                scanner.illuminate(first, memory, progress);
                let Memory { lit, desk, .. } = memory;
                scanner.receive_all(lit, None, desk)
            })
            .collect(),
        // The returns of the whole frame are known before any is received.
        Some(brightness) => {
            let lit: Vec<(Lit, Sources)> = strips
                .par_iter()
                .map_init(Memory::default, |memory, &first| {
                    if is_cancelled() {
                        return Default::default();
                    }
                    scanner.illuminate(first, memory, progress);
                    let lit = std::mem::take(&mut memory.lit);
                    let sources = scanner.sources(&lit, &brightness);
                    (lit, sources)
                })
                .collect();
            let (lit, sources): (Vec<Lit>, Vec<Sources>) = lit.into_iter().unzip();
            let spill = Spill::new(capture, Sources::concat(sources));
            let receive = |desk: &mut Desk, mut lit: Lit| match is_cancelled() {
                true => Strip::default(),
                false => scanner.receive_all(&mut lit, Some(&spill), desk),
            };
            lit.into_par_iter().map_init(Desk::default, receive).collect()
        }
    };
    if is_cancelled() {
        return false;
    }
    frame.begin_measured(rows, columns);
    frame.begin_waveforms(scanner.detector.sigma_m(), scanner.detector.threshold());
    for band in received.chunks(columns.div_ceil(width)) {
        let height = band[0].rows;
        for row in 0..height {
            for strip in band {
                let pixels = row * strip.columns..(row + 1) * strip.columns;
                for pixel in pixels {
                    let returns = &strip.returns[strip.first[pixel]..strip.first[pixel + 1]];
                    frame.add_measured(strip.causes[pixel], returns);
                    if keeps_waveforms {
                        frame
                            .add_waveform(&strip.parts[strip.first_part[pixel]..strip.first_part[pixel + 1]]);
                    }
                }
            }
        }
    }
    true
}

/// The columns of a strip whose pulses have so many samples: as many tiles as keep the rays of a strip in a processor's cache.
fn strip_columns(samples: usize) -> usize {
    (STRIP / samples).next_multiple_of(TILE.1)
}

/// The pixels of a strip, row by row.
#[derive(Default)]
struct Strip {
    rows: usize,
    columns: usize,
    causes: Vec<Cause>,
    /// The place in `returns` of the first return of each pixel, and at the end their number.
    first: Vec<usize>,
    returns: Vec<(Return, Echo)>,
    /// The waveforms, if they are kept. Pixel i has the parts from entry i to entry i + 1 of `first_part`.
    parts: Vec<Part>,
    first_part: Vec<usize>,
}

/// The memory of a thread, which is kept from strip to strip.
#[derive(Default)]
struct Memory {
    waves: Waves,
    /// The light of the strip, in the order in which it was found.
    lights: Vec<Light>,
    lit: Lit,
    desk: Desk,
}

/// A strip of which the light is known, and not yet received.
#[derive(Default)]
struct Lit {
    /// The row and the column of the strip's first pixel.
    first: (usize, usize),
    rows: usize,
    columns: usize,
    /// The pulses of the strip, tile by tile.
    pulses: Vec<Pulse>,
    /// The row and column in the strip of each pulse, its pose, and the time at which it is cast.
    pixels: Vec<(usize, usize)>,
    poses: Vec<SensorPose>,
    cast_at_s: Vec<f64>,
    /// The range of the ideal ray of each pulse; infinite if it meets nothing.
    ideal: Vec<f64>,
    /// The light by pulse. Pulse i has the lights from entry i to entry i + 1 of `first_light`.
    lights: Vec<Light>,
    first_light: Vec<usize>,
}

/// The memory in which pulses are received, one after the other.
#[derive(Default)]
struct Desk {
    lights: Vec<Light>,
    scratch: Scratch,
    received: Received,
}

impl Lit {
    /// The number in the frame of a pulse's pixel.
    fn pixel(&self, pulse: usize, frame_columns: usize) -> u32 {
        let (row, column) = self.pixels[pulse];
        ((self.first.0 + row) * frame_columns + self.first.1 + column) as u32
    }

    fn lights(&self, pulse: usize) -> &[Light] {
        &self.lights[self.first_light[pulse]..self.first_light[pulse + 1]]
    }

    /// The time at which the pulse of each return of the strip is cast.
    fn times_of_returns(&self, strip: &Strip) -> Vec<f64> {
        let mut times_s = vec![0.0; strip.returns.len()];
        for (&(row, column), &time_s) in self.pixels.iter().zip(&self.cast_at_s) {
            let pixel = row * self.columns + column;
            times_s[strip.first[pixel]..strip.first[pixel + 1]].fill(time_s);
        }
        times_s
    }
}

struct Scanner<'a, C> {
    capture: &'a Capture<'a>,
    beams: Beams<'a>,
    paths: Paths<'a, C>,
    air: Air,
    detector: Detector<'a>,
    /// The sensor's pose, if it stands still.
    fixed: Option<SensorPose>,
    /// Whether strips have waveforms.
    keeps_waveforms: bool,
}

impl<'a, C: Cast> Scanner<'a, C> {
    fn new(scene: &'a Scene, tracer: &'a C, capture: &'a Capture<'a>, receiver: &'a Receiver) -> Self {
        let measurement = &capture.sensor.measurement;
        let beams = Beams::new(capture);
        let sun = scene.environment.sun.map_or(1.0, |sun| sun.klx / receiver.sun_klx);
        let noise = measurement.noise.unwrap_or_default();
        let detector = Detector::new(receiver, noise, capture.sensor.range, beams.streams, sun);
        let divergence = measurement
            .footprint
            .map_or(0.0, |f| f.half_divergence[0].radians().max(f.half_divergence[1].radians()));
        let weather = scene.environment.weather.as_ref();
        let (white_at_1_m, threshold) = (detector.white_at_1_m, detector.threshold());
        let air = Air::new(weather, receiver, measurement.footprint, white_at_1_m, threshold);
        let paths = Paths {
            scene,
            tracer,
            receiver,
            white_at_1_m: white_at_1_m / beams.samples() as f64,
            extinction_per_m: air.extinction_per_m,
            mirror_roughness: crate::physics::surface::mirror_roughness(2.0 * divergence),
        };
        let fixed = capture.fixed_world_from_sensor().map(SensorPose::new);
        Self { capture, beams, paths, air, detector, fixed, keeps_waveforms: false }
    }

    /// The row and the column of the first pixel of each strip of the image.
    fn strips(&self) -> Vec<(usize, usize)> {
        let width = strip_columns(self.beams.samples());
        let (bands, strips) = (self.capture.rows().div_ceil(TILE.0), self.capture.columns().div_ceil(width));
        (0..bands).flat_map(|band| (0..strips).map(move |strip| (band * TILE.0, strip * width))).collect()
    }

    /// Casts the pulses of a strip, and finds the light that comes back.
    fn illuminate(&self, first: (usize, usize), memory: &mut Memory, progress: &Progress) {
        let (rows, columns) = (self.capture.rows() - first.0, self.capture.columns() - first.1);
        let width = strip_columns(self.beams.samples());
        self.illuminate_part(first, (TILE.0.min(rows), width.min(columns)), memory, progress);
    }

    /// Casts the pulses of so many rows and columns of the image, at most those of a strip, as a strip of their own.
    fn illuminate_part(
        &self,
        first: (usize, usize),
        (rows, columns): (usize, usize),
        memory: &mut Memory,
        progress: &Progress,
    ) {
        let Memory { waves, lights, lit, .. } = memory;
        (lit.first, lit.rows, lit.columns) = (first, rows, columns);
        self.send(lit, &mut waves.first);
        lights.clear();
        let mut back = Back { pulses: &lit.pulses, lights, ideal: &mut lit.ideal };
        let samples = self.paths.follow(waves, &mut back);
        sort_by_pulse(lights, lit.pulses.len(), &mut lit.lights, &mut lit.first_light);
        progress.rays_done.fetch_add(lit.pulses.len() as u64, Relaxed);
        progress.samples_done.fetch_add(samples as u64, Relaxed);
    }

    /// The light of a strip that pulses beside it may see.
    fn sources(&self, lit: &Lit, brightness: &Brightness) -> Sources {
        let mut sources = Sources::default();
        for (number, pulse) in lit.pulses.iter().enumerate() {
            brightness.add(
                lit.pixel(number, self.capture.columns()),
                pulse,
                lit.lights(number),
                &mut sources,
            );
        }
        sources
    }

    /// Receives the light of a strip.
    fn receive_all(&self, lit: &mut Lit, spill: Option<&Spill>, desk: &mut Desk) -> Strip {
        let (rows, columns) = (lit.rows, lit.columns);
        // A pixel without a pulse stays without light.
        let mut of_pixel = vec![None; rows * columns];
        for (pulse, &(row, column)) in lit.pixels.iter().enumerate() {
            of_pixel[row * columns + column] = Some(pulse);
        }
        let mut targets = Vec::new();
        let mut strip = Strip { rows, columns, first: vec![0], ..Strip::default() };
        if self.keeps_waveforms {
            strip.first_part.push(0);
        }
        for pulse in of_pixel {
            match pulse {
                None => strip.causes.push(Cause::NoPulse),
                Some(pulse) => {
                    match self.keeps_waveforms {
                        true => self.receive(lit, pulse, spill, desk, &mut strip.parts),
                        false => self.receive(lit, pulse, spill, desk, &mut ()),
                    }
                    strip.causes.push(desk.received.cause);
                    strip.returns.append(&mut desk.received.returns);
                    targets.append(&mut desk.received.targets);
                }
            }
            strip.first.push(strip.returns.len());
            if self.keeps_waveforms {
                strip.first_part.push(strip.parts.len());
            }
        }
        if let Some(sun) = self.paths.scene.environment.sun {
            let times_s = lit.times_of_returns(&strip);
            self.light(&sun, &targets, &times_s, &mut strip.returns);
        }
        strip
    }

    /// Writes the sunlight of each return.
    fn light(&self, sun: &Sun, targets: &[Target], times_s: &[f64], returns: &mut [(Return, Echo)]) {
        let lit: Vec<usize> = (0..targets.len()).filter(|&i| targets[i].object != NO_OBJECT).collect();
        let place = |&i: &usize| {
            let Target { point, normal, reflectance, .. } = targets[i];
            Place { point, normal, reflectance: reflectance.into(), time_s: times_s[i] }
        };
        let places: Vec<Place> = lit.iter().map(place).collect();
        let of_sun = sunlight(self.paths.scene, self.paths.tracer, sun, &places);
        for (i, light) in lit.into_iter().zip(of_sun) {
            returns[i].1.ambient = light as f32;
        }
    }

    /// Fills the first wave with the rays of all pulses of a strip, tile by tile.
    fn send(&self, lit: &mut Lit, wave: &mut Wave) {
        let Lit { first: (first_row, first_column), rows, columns, .. } = *lit;
        let Lit { pulses, pixels, poses, cast_at_s, ideal, .. } = lit;
        wave.clear();
        pulses.clear();
        pixels.clear();
        poses.clear();
        cast_at_s.clear();
        let is_off = self.beams.are_off();
        for first in (0..columns).step_by(TILE.1) {
            for row in 0..rows {
                for column in first..columns.min(first + TILE.1) {
                    let pulse = self.capture.pulse(first_row + row, first_column + column);
                    let Some(pulse) = pulse else { continue };
                    let pose = match self.fixed {
                        Some(pose) => pose,
                        None => SensorPose::new(self.capture.world_from_sensor(pulse.time_s)),
                    };
                    let world_from_sensor = pose.world_from_sensor;
                    let time_s = self.capture.cast_at_s(pulse.time_s);
                    let number = pulses.len() as u32;
                    let mut add = |sample: u16, origin, direction| {
                        let (origin, direction) =
                            (world_from_sensor.point(origin), world_from_sensor.direction(direction));
                        wave.push(Way::of(number, sample), Ray { origin, direction, time_s }, None);
                    };
                    let rays = self.beams.rays(first_row + row, first_column + column, &pulse);
                    for (sample, ray) in rays.enumerate() {
                        add(sample as u16, ray.origin, ray.direction);
                    }
                    if is_off {
                        add(IDEAL_SAMPLE, pulse.origin, pulse.direction);
                    }
                    pixels.push((row, column));
                    poses.push(pose);
                    cast_at_s.push(time_s);
                    pulses.push(pulse);
                }
            }
        }
        ideal.clear();
        ideal.resize(pulses.len(), f64::INFINITY);
    }

    /// Receives the light of pulse number `number` of a strip.
    fn receive(
        &self,
        lit: &mut Lit,
        number: usize,
        spill: Option<&Spill>,
        desk: &mut Desk,
        watch: &mut impl Watch,
    ) {
        let Desk { lights: more, scratch, received } = desk;
        let pixel = lit.pixel(number, self.capture.columns());
        let Lit { pulses, poses, lights, first_light, .. } = lit;
        let (pulse, pose) = (&pulses[number], &poses[number]);
        let mut lights = &mut lights[first_light[number]..first_light[number + 1]];
        if self.air.extinction_per_m > 0.0 || spill.is_some() {
            more.clear();
            more.extend_from_slice(lights);
            if self.air.extinction_per_m > 0.0 {
                let nearest_m = lights.iter().map(|light| light.length_m).fold(f64::INFINITY, f64::min);
                let origin = pose.world_from_sensor.point(pulse.origin);
                let direction = pose.world_from_sensor.direction(pulse.direction);
                let ray = AirRay { pixel, number: number as u32, pulse, origin, direction, nearest_m };
                self.air.add(&self.beams.streams, &ray, self.detector.white_at_1_m, more);
            }
            if let Some(spill) = spill {
                spill.add(pixel, number as u32, pulse, more);
            }
            lights = more;
        }
        let by_range = |a: &Light, b: &Light| a.range_m.total_cmp(&b.range_m).then(a.path.cmp(&b.path));
        // The lights of a plane come sorted often.
        if !lights.is_sorted_by(|a, b| by_range(a, b).is_le()) {
            lights.sort_unstable_by(by_range);
        }
        let at = Reception {
            pixel,
            pulse,
            beam: self.beams.beam(lit.first.0 + lit.pixels[number].0),
            ideal_m: self.beams.are_off().then_some(lit.ideal[number]),
            sensor_from_world: pose.sensor_from_world.rotation,
        };
        self.detector.receive(&at, lights, scratch, received, watch);
    }
}

/// Sorts light by its pulse, in the order in which it was found. Pulse i has the lights from entry i to entry i + 1 of `first`.
fn sort_by_pulse(lights: &mut Vec<Light>, pulses: usize, sorted: &mut Vec<Light>, first: &mut Vec<usize>) {
    first.clear();
    first.resize(pulses + 2, 0);
    let mut is_sorted = true;
    let mut last = 0;
    for light in lights.iter() {
        is_sorted &= light.pulse >= last;
        last = light.pulse;
        first[light.pulse as usize + 2] += 1;
    }
    for pulse in 2..first.len() {
        first[pulse] += first[pulse - 1];
    }
    // Without mirrors, panes and holes, light is found pulse by pulse.
    if is_sorted {
        std::mem::swap(lights, sorted);
        first.remove(0);
        return;
    }
    sorted.clear();
    let Some(any) = lights.first() else {
        first.truncate(pulses + 1);
        return;
    };
    sorted.resize(lights.len(), *any);
    for light in lights.iter() {
        let place = &mut first[light.pulse as usize + 1];
        sorted[*place] = *light;
        *place += 1;
    }
    first.truncate(pulses + 1);
}
