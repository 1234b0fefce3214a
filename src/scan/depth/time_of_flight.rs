//! Time-of-flight cameras: the light of all paths adds up as phasors in each pixel, and its phases tell the depth.
//!
//! A pixel is a square of sub-rays. Each adds the light that its surface sends straight back. Rays from these surfaces, whose density
//! goes with the cosine of their angle to the normal, find what else lights them: light that comes by way of other surfaces. The
//! source lies at the camera, and lights all directions alike.
//!
//! The sub-rays of a pixel are cast at times spread over its exposure, so the light of what moves adds up as phasors do, and never as
//! depths.

use std::cmp::Ordering;
use std::f64::consts::TAU;
use std::sync::atomic::Ordering::Relaxed;
use std::sync::{Mutex, PoisonError};

use glam::DVec3;
use rayon::prelude::*;

use super::pixel::Pixel;
use super::shade::{CLEARANCE_M, Lit, Shader, normal_towards_viewer};
use super::sight::Sights;
use crate::physics::phasor::{Demodulated, ModulatedLight, TofPixel};
use crate::physics::unwrap::{MOST_FREQUENCIES, Reliable, Unreliable, Unwrapped, Unwrapper};
use crate::rng::FrameStreams;
use crate::scan::Progress;
use crate::scan::effects::Effect;
use crate::scan::frame::{Cause, Echo, Frame, Images, Return, Terms};
use crate::scan::ideal::scan_ideal;
use crate::scan::ray_batch::{DirectionOrder, Ray, RayBatch, TOGETHER};
use crate::scan::strips::{SensorPose, TILE};
use crate::scan::sunlight::{Place, sunlight};
use crate::scan::through::Through;
use crate::scene::Scene;
use crate::sensor::{Capture, TimeOfFlight};
use crate::trace::{Cast, Hit};

/// The rows and columns of the parts in which an image is measured, and the bits of a direction by which the rays of indirect light of a
/// part are sorted. The more rays there are, the more alike are those that the tracer takes together: in a warehouse, parts of 8 × 64
/// pixels take a third longer. Parts that are larger than this only take more memory.
const PART: (usize, usize) = (64, 64);
const DIRECTION_BITS: u32 = 5;

/// The most taps of a pixel.
const MOST_TAPS: usize = 8;

/// Casts a capture of a time-of-flight camera; `exact` is the same without limits of range. `None` if `progress.cancelled` was set
/// before the end.
pub(super) fn scan(
    scene: &Scene,
    tracer: &impl Cast,
    (capture, exact): (&Capture, &Capture),
    sensing: &TimeOfFlight,
    progress: &Progress,
) -> Option<(Vec<Pixel>, Images)> {
    let mut ideal = Frame::default();
    scan_ideal(&mut ideal, scene, tracer, exact, progress, |_, _| ())?;
    let camera = Camera {
        scene,
        tracer,
        capture,
        sensing,
        ideal: &ideal,
        fixed: capture.fixed_world_from_sensor().map(SensorPose::new),
        streams: FrameStreams::new(capture.seed, capture.index, capture.frame),
        pixel: TofPixel {
            contrast: sensing.contrast,
            third_harmonic: sensing.third_harmonic,
            read_noise: sensing.read_noise,
            full_well: sensing.full_well,
        },
        unwrapper: Unwrapper::new(&sensing.frequencies_hz)?,
    };
    let (rows, columns) = (capture.rows(), capture.columns());
    let parts: Vec<(usize, usize)> = (0..rows.div_ceil(PART.0))
        .flat_map(|band| (0..columns.div_ceil(PART.1)).map(move |part| (band * PART.0, part * PART.1)))
        .collect();
    // A part takes some 60 ms. Each is a task of its own, lest a thread ends long before another. Their memory goes from task to task.
    let idle = Mutex::new(Vec::<Memory>::new());
    let idle = || idle.lock().unwrap_or_else(PoisonError::into_inner);
    let measured = parts
        .par_iter()
        .with_max_len(1)
        .map(|&(first_row, first_column)| {
            if progress.cancelled.load(Relaxed) {
                return None;
            }
            let mut memory = idle().pop().unwrap_or_default();
            let size = (PART.0.min(rows - first_row), PART.1.min(columns - first_column));
            let part = camera.part((first_row, first_column), size, &mut memory);
            progress.samples_done.fetch_add(memory.rays.len() as u64, Relaxed);
            idle().push(memory);
            Some(part)
        })
        .collect::<Option<Vec<Vec<Measured>>>>()?;
    let across = columns.div_ceil(PART.1);
    let measured_in = |number: usize| -> &Measured {
        let (row, column) = (number / columns, number % columns);
        let width = PART.1.min(columns - column / PART.1 * PART.1);
        let part = &measured[row / PART.0 * across + column / PART.1];
        &part[row % PART.0 * width + column % PART.1]
    };
    // The pixels of a large image take tens of megabytes, which all threads write.
    let all = || (0..rows * columns).into_par_iter().with_min_len(columns);
    let image = |of: fn(&Measured) -> f32| all().map(|number| of(measured_in(number))).collect();
    let phase = |k: usize| {
        let of_pixel = |number: usize| measured_in(number).phases[k];
        if k < sensing.frequencies_hz.len() { all().map(of_pixel).collect() } else { vec![] }
    };
    let images = Images {
        amplitude: image(|measured| measured.amplitude),
        ambient: image(|measured| measured.ambient),
        phase_1: phase(0),
        phase_2: phase(1),
        phase_3: phase(2),
        ..Images::default()
    };
    Some((all().map(|number| measured_in(number).pixel).collect(), images))
}

/// The measurement of one pixel. A part of an image has its pixels' measurements row by row.
struct Measured {
    pixel: Pixel,
    amplitude: f32,
    ambient: f32,
    phases: [f32; 3],
}

/// The rays of a part of the image. The memory is kept from part to part.
#[derive(Default)]
struct Memory {
    /// The number of the pixel in the part of each ray.
    of_pixel: Vec<u32>,
    rays: Bundle,
    /// What each ray meets.
    lit: Vec<Option<Lit>>,
    /// The light that comes straight back to each pixel, and the electrons of sunlight in it.
    direct: Vec<Direct>,
    ambient: Vec<f64>,
    indirect: Indirect,
    light: Light,
}

/// The light of a part's pixels.
#[derive(Default)]
struct Light {
    /// For each pixel the light at each frequency.
    of_pixels: Vec<ModulatedLight>,
}

impl Light {
    /// Begins with so many dark pixels at so many frequencies.
    fn begin(&mut self, pixels: usize, frequencies: usize) {
        self.of_pixels.clear();
        self.of_pixels.resize(pixels * frequencies, ModulatedLight::default());
    }

    /// Adds the electrons of a path of this full length, there and back, in metres.
    fn add(&mut self, pixel: u32, electrons: f64, length_m: f64, frequencies_hz: &[f64]) {
        let first = pixel as usize * frequencies_hz.len();
        for (light, &frequency_hz) in self.of_pixels[first..].iter_mut().zip(frequencies_hz) {
            light.add_path(electrons, length_m, frequency_hz);
        }
    }
}

/// Rays that are cast together, and their hits behind holes and panes.
#[derive(Default)]
struct Bundle {
    rays: RayBatch<()>,
    hits: Vec<Option<Hit>>,
    through: Through,
}

impl Bundle {
    fn clear(&mut self) {
        self.rays.clear();
    }

    fn len(&self) -> usize {
        self.rays.len()
    }

    fn push(&mut self, origin: DVec3, direction: DVec3, time_s: f64) {
        self.rays.push((), Ray { origin, direction, time_s }, None);
    }

    fn cast(&mut self, scene: &Scene, tracer: &impl Cast) {
        let Self { rays, hits, through } = self;
        cast_through(rays, scene, tracer, hits, through);
    }
}

/// Casts rays, and looks through holes and panes.
fn cast_through<T>(
    rays: &RayBatch<T>,
    scene: &Scene,
    tracer: &impl Cast,
    hits: &mut Vec<Option<Hit>>,
    through: &mut Through,
) {
    rays.cast(scene, tracer, hits);
    through.clear();
    if scene.is_see_through() {
        through.look(scene, tracer, rays, hits, |_, _| Ordering::Equal);
    }
}

/// The light of one path that something may block.
#[derive(Clone, Copy)]
struct Path {
    /// The number of the pixel in the part.
    pixel: u32,
    /// The electrons of one frequency.
    electrons: f64,
    /// The full length there and back, in metres.
    length_m: f64,
}

/// A ray from a surface that a pixel sees, or from one that lights it.
#[derive(Clone, Copy)]
struct IndirectWay {
    /// The number of the pixel in the part.
    pixel: u32,
    /// The number of the pixel in the image.
    number: u32,
    /// The number of the ray in its pixel.
    k: u32,
    /// The number in the part of the sub-ray that meets the pixel's surface. It begins where the source is.
    sub_ray: u32,
    /// The electrons that light of the irradiance of a white plane at 1 m makes in the pixel by this way.
    electrons: f64,
    /// The length of the way from the camera so far, in metres.
    length_m: f64,
}

/// The indirect light of a part.
#[derive(Default)]
struct Indirect {
    wave: RayBatch<IndirectWay>,
    order: DirectionOrder,
    together: Together,
    onward: Onward,
}

/// The paths and rays that go on from the surfaces that rays of indirect light meet.
#[derive(Default)]
struct Onward {
    /// The rays from these surfaces.
    next: RayBatch<IndirectWay>,
    /// The paths by way of them, and the lines from the source to them.
    paths: Vec<Path>,
    shadows: Sights,
}

impl Onward {
    fn clear(&mut self) {
        self.next.clear();
        self.paths.clear();
        self.shadows.clear();
    }
}

/// Adds a ray from a surface.
fn push_indirect(
    wave: &mut RayBatch<IndirectWay>,
    way: IndirectWay,
    from: &Lit,
    direction: DVec3,
    time_s: f64,
) {
    wave.push(way, Ray { origin: from.point + from.normal * CLEARANCE_M, direction, time_s }, None);
}

/// Rays of a wave that are cast together, and their hits.
#[derive(Default)]
struct Together {
    rays: RayBatch<IndirectWay>,
    hits: Vec<Option<Hit>>,
    through: Through,
}

struct Camera<'a, C> {
    scene: &'a Scene,
    tracer: &'a C,
    capture: &'a Capture<'a>,
    sensing: &'a TimeOfFlight,
    ideal: &'a Frame,
    /// The sensor's pose, if it stands still.
    fixed: Option<SensorPose>,
    streams: FrameStreams,
    pixel: TofPixel,
    unwrapper: Unwrapper,
}

impl<C: Cast> Camera<'_, C> {
    /// The sub-rays of a pixel.
    fn samples(&self) -> usize {
        (self.sensing.samples * self.sensing.samples) as usize
    }

    /// The centre of a sub-ray's part of a pixel, in pixels from the pixel's centre.
    fn place(&self, sample: usize) -> [f64; 2] {
        let side = self.sensing.samples as usize;
        [sample % side, sample / side].map(|i| (i as f64 + 0.5) / side as f64 - 0.5)
    }

    /// The poses of the sensor from which a row is cast: one of each sub-ray if the sensor moves during the exposure, else one.
    fn poses(&self, row: usize) -> Vec<SensorPose> {
        if let Some(fixed) = self.fixed {
            return vec![fixed];
        }
        let time_s = |column| self.capture.time_s(row, column);
        let own_s = (0..self.capture.columns()).find_map(time_s).unwrap_or(0.0);
        let samples = if self.sensing.exposure_s > 0.0 { self.samples() } else { 1 };
        let pose_of = |sample| {
            SensorPose::new(self.capture.world_from_sensor(own_s + self.sensing.time_of_sample_s(sample)))
        };
        (0..samples).map(pose_of).collect()
    }

    /// Measures the pixels of a part of the image, so many rows and columns from its first pixel on.
    fn part(
        &self,
        (first_row, first_column): (usize, usize),
        (rows, columns): (usize, usize),
        memory: &mut Memory,
    ) -> Vec<Measured> {
        let poses: Vec<Vec<SensorPose>> = (0..rows).map(|row| self.poses(first_row + row)).collect();
        let number_of = |pixel: usize| {
            (first_row + pixel / columns) * self.capture.columns() + first_column + pixel % columns
        };
        self.send(&poses, (first_row, first_column), columns, memory);
        let Memory { of_pixel, rays, lit, direct, ambient, indirect, light } = memory;
        let frequencies_hz = self.unwrapper.frequencies_hz();
        light.begin(rows * columns, frequencies_hz.len());
        rays.cast(self.scene, self.tracer);

        let mut shader = Shader::new(self.scene, self.sensing.wavelength_m);
        let white = self.sensing.electrons_at_1_m / self.samples() as f64;
        direct.clear();
        direct.resize(rows * columns, Direct::default());
        lit.clear();
        for (ray, hit) in rays.hits.iter().enumerate() {
            let Some(hit) = hit else {
                lit.push(None);
                continue;
            };
            let Ray { origin, direction, .. } = rays.rays.ray(ray);
            let one = shader.light(origin, direction, hit, None);
            let electrons = white * one.back * rays.through.share(ray) / (hit.t * hit.t);
            lit.push(Some(one));
            if electrons > 0.0 {
                let pixel = of_pixel[ray];
                light.add(pixel, electrons, 2.0 * hit.t, frequencies_hz);
                direct[pixel as usize].add(electrons, ray, one.surface.object);
            }
        }
        ambient.clear();
        ambient.resize(rows * columns, 0.0);
        if let Some(sun) = self.scene.environment.sun.filter(|_| self.sensing.sun_electrons > 0.0) {
            let rays_lit: Vec<usize> = (0..lit.len()).filter(|&ray| lit[ray].is_some()).collect();
            let place = |(lit, &ray): (&Lit, &usize)| lit.place(rays.rays.ray(ray).time_s);
            let places: Vec<Place> = lit.iter().flatten().zip(&rays_lit).map(place).collect();
            let of_sun = sunlight(self.scene, self.tracer, &sun, &places);
            for (ray, share) in rays_lit.into_iter().zip(of_sun) {
                ambient[of_pixel[ray] as usize] += share * self.sensing.sun_electrons / self.samples() as f64;
            }
        }
        if self.sensing.indirect_rays > 0 {
            self.add_indirect(&number_of, (of_pixel, rays, lit), indirect, light, &mut shader);
        }
        let of_pixels = light.of_pixels.chunks_exact_mut(frequencies_hz.len());
        of_pixels
            .enumerate()
            .map(|(pixel, of_pixel)| {
                of_pixel.iter_mut().for_each(|light| light.ambient = ambient[pixel]);
                let brightest = |ray: usize| {
                    let hit = rays.hits[ray].as_ref()?;
                    // All sub-rays of a pixel are cast if one is, and those of a part one pixel after the other.
                    let pose = pose_of_sample(&poses[pixel / columns], ray % self.samples());
                    Some(shader.receive(&pose.sensor_from_world, rays.rays.ray(ray).direction, hit))
                };
                self.measure(number_of(pixel), of_pixel, &direct[pixel], brightest)
            })
            .collect()
    }

    /// Fills the bundle of a part's sub-rays, tile by tile. The part has the rows of these poses.
    fn send(
        &self,
        poses: &[Vec<SensorPose>],
        (first_row, first_column): (usize, usize),
        columns: usize,
        memory: &mut Memory,
    ) {
        let Memory { of_pixel, rays, .. } = memory;
        rays.clear();
        of_pixel.clear();
        for first in (0..columns).step_by(TILE.1) {
            for (row, poses) in poses.iter().enumerate() {
                for column in first..columns.min(first + TILE.1) {
                    let (image_row, image_column) = (first_row + row, first_column + column);
                    let own_s = self.capture.time_s(image_row, image_column).unwrap_or(0.0);
                    for sample in 0..self.samples() {
                        let time_s = self.capture.cast_at_s(own_s + self.sensing.time_of_sample_s(sample));
                        let world_from_sensor = pose_of_sample(poses, sample).world_from_sensor;
                        let origin = world_from_sensor.point(DVec3::ZERO);
                        let direction =
                            self.capture.direction_in_pixel(image_row, image_column, self.place(sample));
                        if let Some(direction) = direction {
                            of_pixel.push((row * columns + column) as u32);
                            rays.push(origin, world_from_sensor.direction(direction), time_s);
                        }
                    }
                }
            }
        }
    }

    /// Adds the light that comes to the surfaces of the sub-rays by way of other surfaces.
    ///
    /// A patch of the reflectance ρ under the irradiance E lights a point by (ρ/π)·E·cos α·cos β/d²·dA, which is ρ·E·(cos β/π) for
    /// each solid angle that it takes. So with directions of the density cos β/π the irradiance of the point is the mean of the ρ·E
    /// that they meet, and a patch is lit by further ones in the same way.
    fn add_indirect(
        &self,
        number_of: &impl Fn(usize) -> usize,
        (of_pixel, rays, lit): (&[u32], &Bundle, &[Option<Lit>]),
        indirect: &mut Indirect,
        light: &mut Light,
        shader: &mut Shader,
    ) {
        let Indirect { wave, .. } = &mut *indirect;
        let count = self.sensing.indirect_rays as usize;
        let samples = self.samples();
        wave.clear();
        for first in (0..of_pixel.len()).step_by(samples) {
            let number = number_of(of_pixel[first] as usize);
            let mut stream = self.streams.stream(number as u32, 0, Effect::Indirect as u32);
            let turn = stream.unit();
            // Where the rays can't be spread evenly over the sub-rays, chance decides which have one more.
            let shift =
                if count.is_multiple_of(samples) { 0 } else { (stream.unit() * samples as f64) as usize };
            for k in 0..count {
                let ray = first + (k + shift) % samples;
                let share = (k as f64 + stream.unit()) / count as f64;
                let Some(lit) = lit[ray].as_ref().filter(|lit| lit.diffuse > 0.0) else { continue };
                let Ray { origin, time_s, .. } = rays.rays.ray(ray);
                let way = IndirectWay {
                    pixel: of_pixel[ray],
                    number: number as u32,
                    k: k as u32,
                    sub_ray: ray as u32,
                    electrons: self.sensing.electrons_at_1_m / count as f64 * lit.diffuse,
                    length_m: (lit.point - origin).length(),
                };
                let direction = cosine_weighted(lit.normal, share, turn + k as f64 * GOLDEN_TURN);
                push_indirect(wave, way, lit, direction, time_s);
            }
        }
        for bounce in 1..=self.sensing.bounces {
            let is_last = bounce == self.sensing.bounces;
            self.meet_others(&rays.rays, indirect, bounce, is_last, light, shader);
        }
    }

    /// Adds the light of the surfaces that the rays of a wave meet. Unless they are the last ones, the wave then has the rays from
    /// them.
    fn meet_others(
        &self,
        sub_rays: &RayBatch<()>,
        indirect: &mut Indirect,
        bounce: u32,
        is_last: bool,
        light: &mut Light,
        shader: &mut Shader,
    ) {
        let Indirect { wave, order, together, onward } = indirect;
        onward.clear();
        // They are cast in the order of their directions.
        for numbers in order.of(wave, DIRECTION_BITS).chunks(TOGETHER) {
            let Together { rays, hits, through } = &mut *together;
            rays.take(wave, numbers);
            cast_through(rays, self.scene, self.tracer, hits, through);
            self.go_on(sub_rays, together, onward, bounce, is_last, shader);
        }
        let Onward { next, paths, shadows } = onward;
        let blocked = shadows.are_blocked_in_any_order(self.scene, self.tracer);
        for (path, _) in paths.iter().zip(blocked).filter(|(_, blocked)| !**blocked) {
            light.add(path.pixel, path.electrons, path.length_m, self.unwrapper.frequencies_hz());
        }
        std::mem::swap(wave, next);
    }

    /// Adds the paths by way of the surfaces that some rays have met, and the rays from there unless these are the last.
    fn go_on(
        &self,
        sub_rays: &RayBatch<()>,
        together: &Together,
        onward: &mut Onward,
        bounce: u32,
        is_last: bool,
        shader: &mut Shader,
    ) {
        let Onward { next, paths, shadows } = onward;
        for (number, hit) in together.hits.iter().enumerate() {
            let Some(hit) = hit else { continue };
            let way = together.rays.known()[number];
            let Ray { origin, direction, time_s } = together.rays.ray(number);
            let source = sub_rays.ray(way.sub_ray as usize).origin;
            // Where the source does not reach, the last rays end.
            if is_last && !is_seen_from(source, origin, direction, hit) {
                continue;
            }
            let far = shader.light(origin, direction, hit, Some(source));
            if far.diffuse == 0.0 {
                continue;
            }
            let to_source = source - far.point;
            let range_m = to_source.length();
            let way =
                IndirectWay { electrons: way.electrons * far.diffuse, length_m: way.length_m + hit.t, ..way };
            let cosine = far.normal.dot(to_source) / range_m;
            if cosine > 0.0 {
                let electrons = way.electrons * cosine / (range_m * range_m);
                paths.push(Path { pixel: way.pixel, electrons, length_m: way.length_m + range_m });
                // From the source, so that all lines have one origin if the camera stands still.
                shadows.push(source, far.point, time_s);
            }
            if !is_last {
                // Each ray has streams of its own for each surface; those of the pixel itself are the streams of the first.
                let mut stream =
                    self.streams.stream(way.number, bounce << 16 | way.k, Effect::Indirect as u32);
                let direction = cosine_weighted(far.normal, stream.unit(), stream.unit());
                push_indirect(next, way, &far, direction, time_s);
            }
        }
    }

    /// The camera's measurement of the light of a pixel at each frequency. `brightest` gives the return of one of its sub-rays.
    fn measure(
        &self,
        number: usize,
        lights: &[ModulatedLight],
        direct: &Direct,
        brightest: impl FnMut(usize) -> Option<Return>,
    ) -> Measured {
        let measured = each_frequency(lights, |k, light| {
            let mut stream = self.streams.stream(number as u32, k as u32, Effect::Electrons as u32);
            self.demodulate(|tap, taps| self.pixel.tap(tap, taps, light, || stream.normal()))
        });
        let measured = &measured[..lights.len()];
        let count = lights.len() as f64;
        let phase = |k: usize| measured.get(k).map_or(0.0, |measured| measured.phasor.phase() as f32);
        Measured {
            pixel: self.judge(number, measured, lights, direct, brightest),
            amplitude: (measured.iter().map(|measured| measured.phasor.amplitude()).sum::<f64>() / count)
                as f32,
            ambient: (measured.iter().map(|measured| measured.ambient(self.sensing.contrast)).sum::<f64>()
                / count) as f32,
            phases: std::array::from_fn(phase),
        }
    }

    /// What the taps of one frequency tell, given what each of so many reads.
    fn demodulate(&self, mut read: impl FnMut(usize, usize) -> f64) -> Demodulated {
        let (count, mut taps) = (self.sensing.taps as usize, [0.0; MOST_TAPS]);
        for (tap, electrons) in taps[..count].iter_mut().enumerate() {
            *electrons = read(tap, count);
        }
        self.pixel.demodulate(&taps[..count])
    }

    /// What the camera reports of a pixel with this light, of which it has measured this.
    fn judge(
        &self,
        number: usize,
        measured: &[Demodulated],
        lights: &[ModulatedLight],
        direct: &Direct,
        mut brightest: impl FnMut(usize) -> Option<Return>,
    ) -> Pixel {
        let reliable = Reliable {
            least_amplitude: self.sensing.least_amplitude,
            most_spread_m: self.sensing.disagreement_m,
            least_margin: 0.0,
        };
        let ideal = self.ideal.causes()[number];
        let Some(brightest) = direct.brightest.and_then(&mut brightest) else {
            // Without any light the pixel says what the ideal camera says; a surface that scatters none is below the threshold.
            let is_seen = ideal == Cause::Surface;
            return Pixel::without(if is_seen { Cause::BelowThreshold } else { ideal });
        };
        let unwrapped = match reliable.judge(measured, || self.unwrap(measured)) {
            Ok(unwrapped) => unwrapped,
            Err(Unreliable::Saturated) => return Pixel::without(Cause::Saturated),
            Err(Unreliable::LowSignal) => return Pixel::without(Cause::BelowThreshold),
            Err(Unreliable::Disagreement | Unreliable::Ambiguous) => return Pixel::without(Cause::Ambiguous),
        };
        let range_m = unwrapped.range_m;
        let (row, column) = (number / self.capture.columns(), number % self.capture.columns());
        let Some(pulse) = self.capture.pulse(row, column) else { return Pixel::without(Cause::NoPulse) };
        let cause = match self.capture.sensor.range.place_of(&pulse, range_m) {
            Ordering::Less => Cause::TooNear,
            Ordering::Equal if direct.is_mixed => Cause::Mixed,
            Ordering::Equal => Cause::Surface,
            Ordering::Greater => return Pixel::without(Cause::OutOfRange),
        };
        let is_ideal = ideal == Cause::Surface;
        let surface = if is_ideal { self.ideal.returns().get(number) } else { brightest };
        let mean =
            |light: &ModulatedLight| self.demodulate(|tap, taps| self.pixel.mean_tap(tap, taps, light));
        let quiet = each_frequency(lights, |_, light| mean(light));
        let quiet_m = self.unwrap(&quiet[..lights.len()]).map_or(surface.range_m, |quiet| quiet.range_m);
        let footprint_m = quiet_m - surface.range_m;
        let terms = Terms {
            ideal_m: surface.range_m,
            footprint_m,
            noise_m: range_m - surface.range_m - footprint_m,
            ..Terms::default()
        };
        let snr = range_m / unwrapped.sigma_m;
        let echo = Echo { cause, snr: snr as f32, terms, ..Echo::default() };
        Pixel { cause, one: Some((Return { range_m, ..surface }, echo)) }
    }

    fn unwrap(&self, measured: &[Demodulated]) -> Option<Unwrapped> {
        let (mut phases, mut sigmas) = ([0.0; MOST_FREQUENCIES], [0.0; MOST_FREQUENCIES]);
        for (k, one) in measured.iter().enumerate() {
            (phases[k], sigmas[k]) = (one.phasor.phase(), one.phase_sigma(self.sensing.read_noise));
        }
        self.unwrapper.unwrap(&phases[..measured.len()], &sigmas[..measured.len()], 0.0)
    }
}

/// A pixel's measurement of the light at each frequency, as `tell` gives it.
fn each_frequency(
    lights: &[ModulatedLight],
    mut tell: impl FnMut(usize, &ModulatedLight) -> Demodulated,
) -> [Demodulated; MOST_FREQUENCIES] {
    let mut told = [Demodulated::default(); MOST_FREQUENCIES];
    for (k, light) in lights.iter().enumerate() {
        told[k] = tell(k, light);
    }
    told
}

/// The pose from which a sub-ray of a row is cast.
fn pose_of_sample(poses: &[SensorPose], sample: usize) -> &SensorPose {
    &poses[if poses.len() > 1 { sample } else { 0 }]
}

/// Whether the side of a surface that a ray hits faces a source.
fn is_seen_from(source: DVec3, origin: DVec3, direction: DVec3, hit: &Hit) -> bool {
    normal_towards_viewer(hit, direction).dot(source - (origin + direction * hit.t)) > 0.0
}

/// The light that comes straight back to a pixel.
#[derive(Clone, Copy, Default)]
struct Direct {
    /// The sub-ray with the most light, the first of equal ones.
    brightest: Option<usize>,
    most: f64,
    object: Option<u32>,
    /// Whether it comes from more than one object.
    is_mixed: bool,
}

impl Direct {
    fn add(&mut self, electrons: f64, ray: usize, object: u32) {
        self.is_mixed |= self.object.is_some_and(|known| known != object);
        self.object = Some(object);
        if electrons > self.most {
            (self.brightest, self.most) = (Some(ray), electrons);
        }
    }
}

/// The golden section of a turn. Multiples of it spread evenly over the circle, however many there are.
const GOLDEN_TURN: f64 = 0.618_033_988_749_894_8;

/// The direction of the density cos β/π about a normal that belongs to two numbers: `share` is uniform in [0, 1), and `turn` is
/// uniform in whole turns.
fn cosine_weighted(normal: DVec3, share: f64, turn: f64) -> DVec3 {
    // Its projection onto the plane is uniform over the unit disc (Malley's method).
    let (sin, cos) = libm::sincos(TAU * (turn - turn.floor()));
    let radius = share.sqrt();
    let (x, y) = normal.any_orthonormal_pair();
    (radius * cos * x + radius * sin * y + (1.0 - share).sqrt() * normal).normalize()
}
