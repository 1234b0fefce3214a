//! The keys by which a depth camera finds depth: stereo, structured light, time of flight.

use std::ops::Bound::{Excluded, Included};

use super::super::kinds::{Integer, List, Nested, Number};
use super::super::table::{AnyKey, Key, TableKeys, key, table};

/// The tables of which a depth camera has at most one.
pub(crate) const METHODS: [&dyn AnyKey; 3] = [&STEREO, &STRUCTURED_LIGHT, &TOF];

pub(crate) static STEREO: Key<Nested> = key(
    "stereo",
    Nested(&stereo::KEYS),
    "How a camera of two imagers finds depth; left out: its depth is exact. It needs a `[pinhole]` without distortion: images are rectified.",
);
pub(crate) static STRUCTURED_LIGHT: Key<Nested> = key(
    "structured_light",
    Nested(&structured_light::KEYS),
    "How a camera finds depth by the pattern of a projector beside it; left out: its depth is exact. It needs a `[pinhole]` without \
     distortion.",
);
pub(crate) static TOF: Key<Nested> = key(
    "tof",
    Nested(&tof::KEYS),
    "How a camera finds depth by the phase of modulated light; left out: its depth is exact.",
);

const BASELINE: Number = Number::within(Included(-10.0), Included(10.0));
const SIDE: Integer<u32> = Integer::within(1, 31);

/// `[stereo]`.
pub(crate) mod stereo {
    use super::*;

    pub static KEYS: TableKeys = table(
        "`[stereo]`",
        &[&BASELINE, &FIRST_DISPARITY, &DISPARITIES, &UNIT, &SIGMA, &WINDOW, &INLIER, &INLIER_SHARE],
    )
    .partial();
    pub static BASELINE: Key<Number> = key(
        "baseline_m",
        super::BASELINE,
        "The distance to the second imager along the image's rows, to the right; negative: to the left.",
    )
    .required("`baseline_m = 0.05`, the distance between the two imagers");
    pub static FIRST_DISPARITY: Key<Integer<u32>> = key(
        "first_disparity_px",
        Integer::within(0, 4096),
        "The least disparity that is searched, which limits the largest depth f·b/d.",
    )
    .or("0");
    pub static DISPARITIES: Key<Integer<u32>> = key(
        "disparities",
        Integer::within(1, 4096),
        "The number of whole disparities that are searched, which limits the least depth.",
    )
    .or("128");
    pub static UNIT: Key<Number> = key(
        "unit_px",
        Number::within(Included(0.0), Included(1.0)),
        "The unit to multiples of which disparities are rounded; 0: they are not.",
    )
    .or("0.0");
    pub static SIGMA: Key<Number> = key(
        "sigma_px",
        Number::NOT_NEGATIVE,
        "The standard deviation of a disparity; that of depth is Z²·σ/(f·b).",
    )
    .or("0.08");
    pub static WINDOW: Key<Integer<u32>> = key(
        "window_px",
        SIDE,
        "The odd side of the window about a pixel of which a part has to be of the pixel's surface; 1: none has to.",
    )
    .or("1");
    pub static INLIER: Key<Number> = key(
        "inlier_px",
        Number::POSITIVE,
        "The difference of disparities within the window up to which a pixel counts as one of the same surface.",
    )
    .or("1.0");
    pub static INLIER_SHARE: Key<Number> = key(
        "inlier_share",
        Number::SHARE,
        "The share of the window's pixels that have to be of the same surface, else the pixel has no depth.",
    )
    .or("0.3");
}

/// `[structured_light]`. Its keys have the meanings of those of `[stereo]`.
pub(crate) mod structured_light {
    use super::*;

    pub static KEYS: TableKeys = table(
        "`[structured_light]`",
        &[
            &BASELINE,
            &stereo::FIRST_DISPARITY,
            &DISPARITIES,
            &UNIT,
            &SIGMA,
            &WINDOW,
            &stereo::INLIER,
            &stereo::INLIER_SHARE,
        ],
    )
    .partial();
    pub static BASELINE: Key<Number> = key(
        "baseline_m",
        super::BASELINE,
        "The distance to the projector along the image's rows, to the right; negative: to the left.",
    )
    .required("`baseline_m = 0.075`, the distance between camera and projector");
    pub static DISPARITIES: Key<Integer<u32>> = key(
        "disparities",
        Integer::within(1, 4096),
        "The number of whole disparities that are searched, which limits the least depth.",
    )
    .or("256");
    pub static UNIT: Key<Number> = key(
        "unit_px",
        Number::within(Included(0.0), Included(1.0)),
        "The unit to multiples of which disparities are rounded; 0: they are not. An eighth of a pixel is the Kinect's.",
    )
    .or("0.125");
    pub static SIGMA: Key<Number> =
        key("sigma_px", Number::NOT_NEGATIVE, "The standard deviation of a disparity before it is rounded.")
            .or("0.0208");
    pub static WINDOW: Key<Integer<u32>> = key(
        "window_px",
        SIDE,
        "The odd side of the window about a pixel of which a part has to be of the pixel's surface; 1: none has to.",
    )
    .or("9");
}

/// `[tof]`.
pub(crate) mod tof {
    use super::*;

    pub static KEYS: TableKeys = table(
        "`[tof]`",
        &[
            &FREQUENCIES,
            &WAVELENGTH,
            &ELECTRONS,
            &CONTRAST,
            &SUN,
            &READ_NOISE,
            &FULL_WELL,
            &SAMPLES,
            &INDIRECT,
            &THIRD_HARMONIC,
            &LEAST_AMPLITUDE,
            &DISAGREEMENT,
        ],
    )
    .partial();
    /// Most frequencies: cameras have one to three.
    pub const MOST_FREQUENCIES: usize = 3;
    pub static FREQUENCIES: Key<List<Number>> = key(
        "frequencies_mhz",
        List { of: Number::within(Excluded(0.0), Included(1000.0)), least: 1 },
        "One to three frequencies of modulation; several tell apart the ranges that one repeats every c/(2·f).",
    )
    .required("`frequencies_mhz = [20.0, 100.0]`, the frequencies of modulation");
    pub static WAVELENGTH: Key<Number> = key(
        "wavelength_nm",
        Number::within(Included(300.0), Included(2500.0)),
        "The wavelength of the light, at which materials' reflectances are taken.",
    )
    .or("850.0");
    pub static ELECTRONS: Key<Number> = key(
        "electrons_at_1_m",
        Number::POSITIVE,
        "The electrons that the camera's light from a white plane at 1 m frees in a pixel, in all taps of one frequency.",
    )
    .required("`electrons_at_1_m = 50000.0`, the electrons of a white plane at 1 m");
    pub static CONTRAST: Key<Number> = key(
        "contrast",
        Number::within(Excluded(0.0), Included(1.0)),
        "The contrast of demodulation: the amplitude of the taps over their mean, without ambient light.",
    )
    .or("0.8");
    pub static SUN: Key<Number> = key(
        "sun_electrons",
        Number::NOT_NEGATIVE,
        "The electrons that sunlight of 100 klx on a white plane frees in a pixel, in all taps of one frequency.",
    )
    .or("0.0");
    pub static READ_NOISE: Key<Number> = key(
        "read_noise",
        Number::NOT_NEGATIVE,
        "The standard deviation of the noise of reading a tap, in electrons.",
    )
    .or("0.0");
    pub static FULL_WELL: Key<Number> = key(
        "full_well",
        Number::POSITIVE.or_infinite(),
        "The electrons that a tap holds; more saturate the pixel, which then has no depth.",
    )
    .or("inf");
    pub static SAMPLES: Key<Integer<u32>> = key(
        "samples",
        Integer::within(1, 8),
        "The side of the square of sub-rays of a pixel, whose light adds up: pixels on edges fly between the surfaces.",
    )
    .or("2");
    pub static INDIRECT: Key<Integer<u32>> = key(
        "indirect_rays",
        Integer::within(0, 1024),
        "The rays of each pixel for light that comes by way of one other surface; 0: there is none.",
    )
    .or("0");
    pub static THIRD_HARMONIC: Key<Number> = key(
        "third_harmonic",
        Number::within(Included(0.0), Excluded(1.0)),
        "The third harmonic of the modulation over the first, which makes depths wiggle with the phase.",
    )
    .or("0.0");
    pub static LEAST_AMPLITUDE: Key<Number> = key(
        "least_amplitude",
        Number::NOT_NEGATIVE,
        "The least amplitude of a pixel with depth, in electrons.",
    )
    .or("0.0");
    pub static DISAGREEMENT: Key<Number> = key(
        "disagreement_m",
        Number::POSITIVE.or_infinite(),
        "The largest difference between the depths of the frequencies; pixels on edges exceed it and have no depth.",
    )
    .or("inf");
}
