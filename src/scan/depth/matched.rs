//! Disparities by matching what both imagers of a stereo camera see.

use rayon::prelude::*;

use super::disparity::{Found, View};
use super::infrared::Light;
use super::pixel::Pixel;
use crate::matching::{Gray, Matched, Matcher, Settings, UNITS_PER_PX, Verdict};
use crate::physics::infrared::{ImageNoise, quantised};
use crate::rng::FrameStreams;
use crate::scan::Progress;
use crate::scan::effects::Effect;
use crate::scan::frame::{Cause, Frame, Images};
use crate::scene::Scene;
use crate::sensor::{Capture, Imager, Matching, Stereo};
use crate::trace::Cast;

/// Casts a capture of a camera that matches two images; `exact` is the same without limits of range.
/// `None` if `progress.cancelled` was set before the end.
pub(super) fn scan(
    scene: &Scene,
    tracer: &impl Cast,
    (capture, exact): (&Capture, &Capture),
    (stereo, matching): (&Stereo, &Matching),
    progress: &Progress,
) -> Option<(Vec<Pixel>, Images)> {
    let light = Light { scene, tracer, imager: &matching.imager, projector: matching.projector.as_ref() };
    let mut ideal = Frame::default();
    let left = light.seen(exact, 0.0, &mut ideal, progress)?;
    let second = exact.to_the_right(stereo.baseline_m);
    let right = light.seen(&second, stereo.baseline_m, &mut Frame::default(), progress)?;
    let gain = exposure(&matching.imager, &left);
    let streams = FrameStreams::new(capture.seed, capture.index, capture.frame);
    let read = |grey: &[f32], effect: Effect| {
        image(grey, gain, matching.imager.noise, &streams, effect, capture.columns())
    };
    let (left, right) = (read(&left, Effect::LeftImage)?, read(&right, Effect::RightImage)?);
    let is_to_the_left = stereo.baseline_m < 0.0;
    let matched = match is_to_the_left {
        false => Matcher::new(matching.settings).ok()?.matched(&left, &right)?,
        true => mirrored_match(&left, &right, matching.settings)?,
    };
    let view = View::new(capture, stereo, ideal);
    let pixels: Vec<(Pixel, f32)> = (0..matched.verdict.len())
        .into_par_iter()
        .map(|pixel| {
            let disparity_px = f64::from(matched.disparity[pixel]) / f64::from(UNITS_PER_PX);
            let cause = match matched.verdict[pixel] {
                Verdict::Matched => return view.pixel(pixel, Found { disparity_px, is_matched: true }),
                Verdict::NoTexture => Cause::NoTexture,
                Verdict::Occluded => Cause::Occluded,
                Verdict::Ambiguous | Verdict::Speckle => Cause::Ambiguous,
                Verdict::OutsideSearch => Cause::OutOfRange,
            };
            (Pixel::without(cause), 0.0)
        })
        .collect();
    let (pixels, disparity) = pixels.into_iter().unzip();
    let grey = |image: &Gray| image.pixels().iter().map(|&value| f32::from(value)).collect();
    let confidence = matched.confidence.iter().map(|&value| f32::from(value) / 255.0).collect();
    let images =
        Images { ir_left: grey(&left), ir_right: grey(&right), disparity, confidence, ..Images::default() };
    Some((pixels, images))
}

/// The factor of the exposure: it brings the mean of the camera's own image to the level that is asked for. An image without light
/// stays as it is.
fn exposure(imager: &Imager, left: &[f32]) -> f64 {
    let mean = left.iter().map(|&grey| f64::from(grey)).sum::<f64>() / left.len() as f64;
    match imager.auto_level {
        Some(level) if mean > 0.0 => level / mean,
        _ => 1.0,
    }
}

/// The image that an imager reads, with its noise, in whole grey values.
fn image(
    grey: &[f32],
    gain: f64,
    noise: f64,
    streams: &FrameStreams,
    effect: Effect,
    columns: usize,
) -> Option<Gray> {
    let value = |(pixel, &grey): (usize, &f32)| {
        let mut stream = streams.stream(pixel as u32, 0, effect as u32);
        let quiet = f64::from(grey) * gain;
        let noisy = ImageNoise::KINECT.noisy(quiet, [stream.normal(), stream.normal()]);
        quantised(quiet + noise * (noisy - quiet))
    };
    let pixels = grey.par_iter().enumerate().map(value).collect();
    Gray::new(columns, grey.len() / columns, pixels)
}

/// The disparities of a camera whose second imager is on its left: those of the images in a mirror.
fn mirrored_match(left: &Gray, right: &Gray, settings: Settings) -> Option<Matched> {
    fn mirror<T: Copy>(values: &[T], width: usize) -> Vec<T> {
        values.chunks(width).flat_map(|row| row.iter().rev().copied()).collect()
    }
    let width = left.width();
    let mirrored = |image: &Gray| Gray::new(width, image.height(), mirror(image.pixels(), width));
    let matched = Matcher::new(settings).ok()?.matched(&mirrored(left)?, &mirrored(right)?)?;
    Some(Matched {
        disparity: mirror(&matched.disparity, width),
        confidence: mirror(&matched.confidence, width),
        verdict: mirror(&matched.verdict, width),
        ..matched
    })
}
