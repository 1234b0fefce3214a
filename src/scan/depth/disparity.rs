//! Disparities from exact depths, with noise, holes and rounding; and from disparities to returns.

use std::cmp::Ordering;

use rayon::prelude::*;

use super::pixel::Pixel;
use super::second::Second;
use crate::physics::disparity::{StereoPair, quantise};
use crate::rng::FrameStreams;
use crate::scan::Progress;
use crate::scan::effects::Effect;
use crate::scan::frame::{Cause, Echo, Frame, Images, NO_OBJECT, Return, Terms};
use crate::scan::ideal::scan_ideal;
use crate::scene::Scene;
use crate::sensor::{AnalyticDisparity, Capture, Pattern, SecondViewpoint, Stereo};
use crate::trace::Cast;

/// Casts a capture of a camera whose disparities follow from the exact depths; `exact` is the same without limits of range.
/// `None` if `progress.cancelled` was set before the end.
///
/// # Panics
/// If the sensor is no camera.
pub(super) fn scan(
    scene: &Scene,
    tracer: &impl Cast,
    (capture, exact): (&Capture, &Capture),
    (stereo, analytic): (&Stereo, &AnalyticDisparity),
    progress: &Progress,
) -> Option<(Vec<Pixel>, Images)> {
    let view = View::cast(scene, tracer, (capture, exact), stereo, progress)?;
    Some(view.measure(analytic))
}

/// The camera's own view.
pub(super) struct View<'a> {
    capture: &'a Capture<'a>,
    stereo: &'a Stereo,
    rig: StereoPair,
    ideal: Frame,
    /// The exact disparity of each pixel, if the camera's disparities follow from them; 0 of a pixel whose surface the second viewpoint
    /// does not see, or that has none.
    exact_px: Vec<f64>,
}

impl<'a> View<'a> {
    /// The view of a camera whose ideal frame was cast.
    ///
    /// # Panics
    /// If the sensor is no camera.
    pub fn new(capture: &'a Capture<'a>, stereo: &'a Stereo, ideal: Frame) -> Self {
        let Pattern::Camera(camera) = &capture.sensor.pattern else { panic!("a stereo camera is a camera") };
        let rig = stereo.pair(camera);
        Self { capture, stereo, rig, ideal, exact_px: Vec::new() }
    }

    fn cast(
        scene: &Scene,
        tracer: &impl Cast,
        (capture, exact): (&'a Capture<'a>, &Capture),
        stereo: &'a Stereo,
        progress: &Progress,
    ) -> Option<Self> {
        let second = Second::to_the_right(scene, tracer, capture, stereo.baseline_m);
        let columns = capture.columns();
        let mut ideal = Frame::default();
        let hidden = scan_ideal(&mut ideal, scene, tracer, exact, progress, |strip, batch| {
            second.hidden(strip, batch, columns)
        })?;
        let view = Self::new(capture, stereo, ideal);
        let (ideal, rig) = (&view.ideal, &view.rig);
        let mut exact_px: Vec<f64> = (0..ideal.pixels())
            .into_par_iter()
            .map(|pixel| {
                let depth_m = ideal.returns().range_m[pixel] * ratio(capture, pixel);
                match ideal.causes()[pixel] {
                    Cause::Surface if depth_m > 0.0 => rig.disparity_px(depth_m),
                    _ => 0.0,
                }
            })
            .collect();
        for pixel in hidden.into_iter().flatten() {
            exact_px[pixel as usize] = 0.0;
        }
        if stereo.second == SecondViewpoint::Imager {
            let to_the_left = stereo.baseline_m.signum();
            exact_px.par_iter_mut().enumerate().for_each(|(pixel, exact_px)| {
                let column = (pixel % columns) as f64 + 0.5 - to_the_left * *exact_px;
                if !(0.0..columns as f64).contains(&column) {
                    *exact_px = 0.0;
                }
            });
        }
        Some(Self { exact_px, ..view })
    }

    /// Finds disparities from the exact ones.
    fn measure(&self, analytic: &AnalyticDisparity) -> (Vec<Pixel>, Images) {
        let streams = FrameStreams::new(self.capture.seed, self.capture.index, self.capture.frame);
        let measured: Vec<(Pixel, f32)> = (0..self.ideal.pixels())
            .into_par_iter()
            .map(|pixel| {
                let cause = self.ideal.causes()[pixel];
                if cause != Cause::Surface {
                    return (Pixel::without(cause), 0.0);
                }
                let exact_px = self.exact_px[pixel];
                if exact_px == 0.0 {
                    return (Pixel::without(Cause::Occluded), 0.0);
                }
                if !self.is_held_by_window(pixel, analytic) {
                    return (Pixel::without(Cause::Ambiguous), 0.0);
                }
                let mut noise = streams.stream(pixel as u32, 0, Effect::Disparity as u32);
                let disparity_px = exact_px + analytic.sigma_px * noise.normal();
                let found = Found { disparity_px, is_matched: false };
                self.pixel(pixel, found)
            })
            .collect();
        let (pixels, disparity) = measured.into_iter().unzip();
        (pixels, Images { disparity, ..Images::default() })
    }

    /// Whether enough of the pixels in the window about a pixel have nearly its disparity. Pixels beyond the image's edges are none.
    fn is_held_by_window(&self, pixel: usize, analytic: &AnalyticDisparity) -> bool {
        let half = analytic.window_px as usize / 2;
        if half == 0 {
            return true;
        }
        let (rows, columns) = (self.capture.rows(), self.capture.columns());
        let (row, column) = (pixel / columns, pixel % columns);
        let across = column.saturating_sub(half)..(column + half + 1).min(columns);
        let down = row.saturating_sub(half)..(row + half + 1).min(rows);
        let all = down.len() * across.len();
        let own_px = self.exact_px[pixel];
        let is_near = |&&px: &&f64| px > 0.0 && (px - own_px).abs() <= analytic.inlier_px;
        let of_row = |row: usize| {
            self.exact_px[row * columns + across.start..row * columns + across.end]
                .iter()
                .filter(is_near)
                .count()
        };
        let inliers: usize = down.map(of_row).sum();
        inliers as f64 >= analytic.inlier_share * all as f64
    }

    /// What the camera reports of a pixel with a disparity, and the disparity as it reports it.
    pub fn pixel(&self, pixel: usize, found: Found) -> (Pixel, f32) {
        let unit_px = self.stereo.unit_px;
        let reported_px = match unit_px > 0.0 {
            true => quantise(found.disparity_px, unit_px),
            false => found.disparity_px,
        };
        let [first_px, end_px] = self.stereo.searched_px();
        if reported_px <= 0.0 || reported_px < first_px {
            return (Pixel::without(Cause::OutOfRange), reported_px.max(0.0) as f32);
        }
        let ratio = ratio(self.capture, pixel);
        let range_of = |disparity_px: f64| self.rig.depth_m(disparity_px) / ratio;
        let range_m = range_of(reported_px);
        let unrounded_m = range_of(found.disparity_px);
        let is_seen = self.ideal.causes()[pixel] == Cause::Surface;
        let surface = match is_seen {
            true => self.ideal.returns().get(pixel),
            // A match where there is no surface. Its budget has no exact range to begin with.
            false => {
                Return { range_m: unrounded_m, instance: NO_OBJECT, triangle: NO_OBJECT, ..Return::default() }
            }
        };
        let error_m = unrounded_m - surface.range_m;
        let [footprint_m, noise_m] = if found.is_matched { [error_m, 0.0] } else { [0.0, error_m] };
        let terms = Terms {
            ideal_m: surface.range_m,
            footprint_m,
            noise_m,
            rounding_m: range_m - unrounded_m,
            ..Terms::default()
        };
        let (row, column) = (pixel / self.capture.columns(), pixel % self.capture.columns());
        let is_beyond_search = reported_px >= end_px;
        let place = match self.capture.pulse(row, column) {
            _ if is_beyond_search => Ordering::Less,
            Some(pulse) => self.capture.sensor.range.place_of(&pulse, range_m),
            None => Ordering::Greater,
        };
        let cause = match place {
            Ordering::Less => Cause::TooNear,
            Ordering::Equal if is_seen => Cause::Surface,
            Ordering::Equal => Cause::FalseAlarm,
            Ordering::Greater => return (Pixel::without(Cause::OutOfRange), reported_px as f32),
        };
        let one = Return { range_m, ..surface };
        (Pixel { cause, one: Some((one, Echo { cause, terms, ..Echo::default() })) }, reported_px as f32)
    }
}

/// A disparity that was found, before it is rounded.
pub(super) struct Found {
    /// In pixels.
    pub disparity_px: f64,
    /// Whether images were matched, so that the error is not noise alone.
    pub is_matched: bool,
}

/// The depth of a pixel over its range.
fn ratio(capture: &Capture, pixel: usize) -> f64 {
    capture.depth_over_range(pixel / capture.columns(), pixel % capture.columns()).unwrap_or(0.0)
}
