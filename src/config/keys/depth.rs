//! The keys by which a depth camera finds depth: stereo, structured light, time of flight.

use std::ops::Bound::{Excluded, Included};

use super::super::kinds::{Choice, Integer, List, Nested, Number, NumberChoice, Text, Vector};
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

const SIDEWAYS: Number = Number::within(Included(-10.0), Included(10.0));
const SIDE: Integer<u32> = Integer::within(1, 31);

/// `[stereo]`.
pub(crate) mod stereo {
    use super::*;

    pub static KEYS: TableKeys = table(
        "`[stereo]`",
        &[
            &BASELINE,
            &METHOD,
            &FIRST_DISPARITY,
            &DISPARITIES,
            &UNIT,
            &SIGMA,
            &WINDOW,
            &INLIER,
            &INLIER_SHARE,
            &PROJECTOR,
            &IMAGER,
            &MATCHER,
        ],
    )
    .partial();
    /// Whether disparities are found by matching images.
    pub static METHOD: Key<Choice<bool>> = key(
        "method",
        Choice(&[("analytic", false), ("match", true)]),
        "How disparities are found: from the exact depth with `sigma_px` and the window, or by matching what both imagers see.",
    )
    .or("\"analytic\"");
    pub static PROJECTOR: Key<Nested> = key(
        "projector",
        Nested(&projector::KEYS),
        "The projector of a pattern, of a camera that matches; left out: the camera is passive.",
    );
    pub static IMAGER: Key<Nested> =
        key("imager", Nested(&imager::KEYS), "The imagers of a camera that matches.");
    pub static MATCHER: Key<Nested> =
        key("matcher", Nested(&matcher::KEYS), "The settings of the matcher of a camera that matches.");
    pub static BASELINE: Key<Number> = key(
        "baseline_m",
        SIDEWAYS,
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

/// `[stereo.projector]`.
pub(crate) mod projector {
    use super::*;

    pub static KEYS: TableKeys =
        table("`[stereo.projector]`", &[&OFFSET, &FIELD, &PATTERN, &DOTS, &DOT_WIDTH, &SEED, &FLOOD])
            .partial();
    pub static OFFSET: Key<Number> = key(
        "offset_m",
        SIDEWAYS,
        "The distance from the camera to the projector along the image's rows, to the right; negative: to the left.",
    )
    .required("`offset_m = 0.029`, the distance from the camera to the projector");
    pub static FIELD: Key<Vector<2>> = key(
        "field_deg",
        Vector("the full angles, horizontal and vertical"),
        "The full angles of the pattern, horizontal and vertical; each is greater than 0 and less than 180.",
    )
    .required("`field_deg = [87.0, 58.0]`, the full angles, horizontal and vertical");
    pub static PATTERN: Key<Text> = key(
        "pattern",
        Text,
        "A PNG of grey values, linear in light, that fills the field and replaces the dots; its path is relative to the file that names \
         it. Left out: dots.",
    );
    pub static DOTS: Key<Integer<u32>> =
        key("dots", Integer::within(1, 1_000_000), "The number of dots of the pattern.").or("5000");
    pub static DOT_WIDTH: Key<Number> = key(
        "dot_mrad",
        Number::within(Excluded(0.0), Included(100.0)),
        "The full width of a dot at half of its maximum.",
    )
    .or("2.0");
    pub static SEED: Key<Integer<u64>> =
        key("seed", Integer::within(0, u64::MAX), "What the places of the dots follow from.").or("1");
    pub static FLOOD: Key<Number> = key(
        "flood",
        Number::SHARE,
        "The share of the projector's light that is spread evenly over the field.",
    )
    .or("0.0");
}

/// `[stereo.imager]`.
pub(crate) mod imager {
    use super::*;

    pub static KEYS: TableKeys =
        table("`[stereo.imager]`", &[&WAVELENGTH, &AUTO_LEVEL, &PROJECTED, &AMBIENT, &SUN, &NOISE]).partial();
    pub static WAVELENGTH: Key<Number> = key(
        "wavelength_nm",
        Number::within(Included(300.0), Included(2500.0)),
        "The wavelength of the light, at which materials' reflectances are taken.",
    )
    .or("850.0");
    pub static AUTO_LEVEL: Key<Number> = key(
        "auto_level",
        Number::within(Excluded(0.0), Included(255.0)),
        "The mean grey value to which the exposure brings the camera's own image; left out: the exposure is fixed.",
    );
    pub static PROJECTED: Key<Number> = key(
        "projected_at_1_m",
        Number::NOT_NEGATIVE,
        "The mean grey value that the projector's light gives a white plane at 1 m, before the exposure is set.",
    )
    .or("60.0");
    pub static AMBIENT: Key<Number> = key(
        "ambient",
        Number::NOT_NEGATIVE,
        "The grey value that ambient light gives a white plane, before the exposure is set.",
    )
    .or("40.0");
    pub static SUN: Key<Number> = key(
        "sun",
        Number::NOT_NEGATIVE,
        "The grey value that sunlight of 100 klx gives a white plane that faces it, before the exposure is set.",
    )
    .or("0.0");
    pub static NOISE: Key<Number> = key(
        "noise",
        Number::NOT_NEGATIVE,
        "The factor on the noise of the images; 1 is that which was measured of the Kinect's imager.",
    )
    .or("1.0");
}

/// `[stereo.matcher]`.
pub(crate) mod matcher {
    use super::*;

    pub static KEYS: TableKeys = table(
        "`[stereo.matcher]`",
        &[
            &CENSUS,
            &BLOCK,
            &PENALTIES,
            &PATHS,
            &UNIQUENESS,
            &REPETITION,
            &LEFT_RIGHT,
            &TEXTURE,
            &TEXTURE_DIFFERENCE,
            &SPECKLE,
            &SPECKLE_STEP,
            &MEDIAN,
        ],
    )
    .partial();
    pub static CENSUS: Key<Vector<2>> = key(
        "census_px",
        Vector("the odd numbers of columns and rows"),
        "The odd numbers of columns and rows of the census window; it has at most 65 pixels.",
    )
    .or("[7, 7]");
    pub static BLOCK: Key<Integer<u32>> =
        key("block_px", SIDE, "The odd side of the block over which costs are added; 1: they are not.")
            .or("7");
    pub static PENALTIES: Key<Vector<2>> = key(
        "penalties",
        Vector("for a step of one pixel and for a larger one"),
        "The costs of a step of the disparity by one pixel and by more, in bits for each pixel of the block: whole numbers, the second \
         at least the first and at most 1024.",
    )
    .or("[8, 32]");
    pub static PATHS: Key<NumberChoice<bool>> = key(
        "paths",
        NumberChoice(&[(4, false), (8, true)]),
        "The paths along which surfaces are taken for smooth.",
    )
    .or("4");
    pub static UNIQUENESS: Key<Integer<u32>> = key(
        "uniqueness_percent",
        Integer::within(0, 99),
        "By how many percent the best cost has to be lower than that of any other disparity but its neighbours.",
    )
    .or("10");
    pub static REPETITION: Key<Integer<u32>> = key(
        "repetition_percent",
        Integer::within(0, 99),
        "The same for the costs of the block alone, which shows patterns that repeat and makes holes where images are noisy; left out: it \
         is not checked.",
    );
    pub static LEFT_RIGHT: Key<Integer<u32>> = key(
        "left_right_px",
        Integer::within(0, 4096),
        "The largest difference between the disparities that both images find; left out: it is not checked.",
    );
    pub static TEXTURE: Key<Integer<u32>> = key(
        "texture",
        Integer::within(0, 64),
        "The number of pixels in the census window that have to differ from its middle; 0: none has to.",
    )
    .or("4");
    pub static TEXTURE_DIFFERENCE: Key<Integer<u32>> = key(
        "texture_difference",
        Integer::within(0, 255),
        "The difference from the window's middle that counts, in grey values.",
    )
    .or("4");
    pub static SPECKLE: Key<Integer<u32>> = key(
        "speckle_px",
        Integer::within(0, u32::MAX as u64),
        "The number of pixels from which on a patch of like disparities is a surface; 0: each is.",
    )
    .or("100");
    pub static SPECKLE_STEP: Key<Number> = key(
        "speckle_step_px",
        Number::within(Included(0.0), Included(4096.0)),
        "The difference of disparities between neighbours of a patch.",
    )
    .or("1.0");
    pub static MEDIAN: Key<NumberChoice<u32>> = key(
        "median_px",
        NumberChoice(&[(1, 1), (3, 3), (5, 5), (7, 7)]),
        "The side of the median filter over disparities; 1: there is none.",
    )
    .or("5");
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
        SIDEWAYS,
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
            &TAPS,
            &SAMPLES,
            &INDIRECT,
            &BOUNCES,
            &THIRD_HARMONIC,
            &LEAST_AMPLITUDE,
            &EXPOSURE,
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
    pub static TAPS: Key<Integer<u32>> = key(
        "taps",
        Integer::within(3, 8),
        "The taps of a pixel at each frequency, spread evenly over a period.",
    )
    .or("4");
    pub static SAMPLES: Key<Integer<u32>> = key(
        "samples",
        Integer::within(1, 8),
        "The side of the square of sub-rays of a pixel, whose light adds up: pixels on edges fly between the surfaces.",
    )
    .or("2");
    pub static INDIRECT: Key<Integer<u32>> = key(
        "indirect_rays",
        Integer::within(0, 1024),
        "The rays of each pixel for light that comes by way of other surfaces; 0: there is none.",
    )
    .or("0");
    pub static BOUNCES: Key<Integer<u32>> = key(
        "bounces",
        Integer::within(1, 16),
        "The most surfaces that indirect light comes by before the one that the pixel sees.",
    )
    .or("1");
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
    pub static EXPOSURE: Key<Number> = key(
        "exposure_s",
        Number::NOT_NEGATIVE,
        "The time over which a pixel gathers light, half of it before the pixel's own time: what moves then adds up as light does. 0: \
         nothing moves in it.",
    )
    .or("0.0");
    pub static DISAGREEMENT: Key<Number> = key(
        "disagreement_m",
        Number::POSITIVE.or_infinite(),
        "The largest difference between the depths of the frequencies; pixels on edges exceed it and have no depth.",
    )
    .or("inf");
}
