//! The keys by which a sensor measures: the width of its beams, its receiver, its noise, its blooming, and its data sheet's figures.

use std::ops::Bound::{Excluded, Included};

use super::super::kinds::{
    Choice, Flag, Integer, List, Nested, Number, NumberChoice, Tables, Text, Vector, WordOrCount,
};
use super::super::table::{AnyKey, Key, TableKeys, key, table};
use super::angles::MAX_SIDE;
use super::depth::{STEREO, STRUCTURED_LIGHT, TOF};
use crate::physics::footprint::Samples;
use crate::physics::intensity::IntensityScale;
use crate::sensor::ReturnMode;

/// The tables by which a sensor measures.
pub(crate) const PARTS: [&dyn AnyKey; 7] =
    [&FOOTPRINT, &RECEIVER, &NOISE, &BLOOMING, &STEREO, &STRUCTURED_LIGHT, &TOF];

pub(crate) static FOOTPRINT: Key<Nested> =
    key("footprint", Nested(&footprint::KEYS), "The width of the beams; left out: rays without width.");
pub(crate) static RECEIVER: Key<Nested> = key(
    "receiver",
    Nested(&receiver::KEYS),
    "What of the light is detected, and as which returns; left out: the first surface on each ray.",
);
pub(crate) static NOISE: Key<Nested> =
    key("noise", Nested(&noise::KEYS), "The errors of ranges and directions; left out: none.");
pub(crate) static BLOOMING: Key<Nested> = key(
    "blooming",
    Nested(&blooming::KEYS),
    "The light that bright returns spread over neighbouring beams; left out: none.",
);
pub(crate) static NOMINAL: Key<Nested> = key(
    "nominal",
    Nested(&NOMINAL_KEYS),
    "The figures of the sensor's data sheet, which count only if a job says `nominal = true`.",
);
/// The key of a job's sensor that turns its preset's `[nominal]` on.
pub(crate) static IS_NOMINAL: Key<Flag> = key(
    "nominal",
    Flag,
    "Whether the preset measures as its data sheet says: its `[nominal]` tables lie under its own and those here.",
)
.or("false");

pub(crate) static NOMINAL_KEYS: TableKeys = table(
    "`[nominal]`",
    &[&SOURCE, &FOOTPRINT, &RECEIVER, &NOISE, &BLOOMING, &STEREO, &STRUCTURED_LIGHT, &TOF, &PUBLISHED],
)
.partial();
pub(crate) static SOURCE: Key<Text> = key("source", Text, "The publication that the figures are from.")
    .required("`source = \"…\"`, the publication that the figures are from");
pub(crate) static PUBLISHED: Key<Tables> = key(
    "published",
    Tables::with_headers(&published::KEYS, "bound", 1).at_most(published::MOST),
    "What the data sheet promises of a depth camera, which `selftest --datasheet` judges.",
);

/// `[[nominal.published]]`.
pub(crate) mod published {
    use super::*;

    /// Most tables: data sheets state a figure at two or three distances.
    pub const MOST: usize = 64;
    pub static KEYS: TableKeys = table(
        "`[[nominal.published]]`",
        &[&AT, &UP_TO, &Z_ACCURACY, &FILL_RATE, &PLANE_RMS, &SUBPIXEL_RMS, &SIGMA, &BIAS, &BIAS_PERCENT],
    );
    /// The figures, of which a table has at least one.
    pub const BOUNDS: [&dyn AnyKey; 7] =
        [&Z_ACCURACY, &FILL_RATE, &PLANE_RMS, &SUBPIXEL_RMS, &SIGMA, &BIAS, &BIAS_PERCENT];
    pub static AT: Key<Number> = key(
        "at_m",
        Number::POSITIVE,
        "The distance of the flat target that the figures are about; left out, as is `up_to_m`: any that the camera measures.",
    );
    pub static UP_TO: Key<Number> =
        key("up_to_m", Number::POSITIVE, "The distance up to which the figures hold, in place of `at_m`.");
    pub static Z_ACCURACY: Key<Number> =
        key("z_accuracy_percent", Number::POSITIVE, "The largest median error of depth, of the distance.");
    pub static FILL_RATE: Key<Number> = key(
        "fill_rate_percent",
        Number::within(Excluded(0.0), Included(100.0)),
        "The least share of pixels that have a depth.",
    );
    pub static PLANE_RMS: Key<Number> = key(
        "plane_rms_percent",
        Number::POSITIVE,
        "The largest root mean square distance from the plane that fits the target, of the distance.",
    );
    pub static SUBPIXEL_RMS: Key<Number> =
        key("subpixel_rms_px", Number::POSITIVE, "The largest noise in pixels of disparity.");
    pub static SIGMA: Key<Number> =
        key("sigma_m", Number::POSITIVE, "The largest standard deviation of a pixel's depth over time.");
    pub static BIAS: Key<Number> = key(
        "bias_m",
        Number::NOT_NEGATIVE,
        "The largest difference between the mean depth and the distance.",
    );
    pub static BIAS_PERCENT: Key<Number> = key(
        "bias_percent",
        Number::NOT_NEGATIVE,
        "The part of the distance that is added to `bias_m`, which counts as 0 if it is left out.",
    );
}

/// `[footprint]`.
pub(crate) mod footprint {
    use super::*;

    pub static KEYS: TableKeys =
        table("`[footprint]`", &[&DIVERGENCE, &KIND, &EXIT_RADIUS, &SAMPLES]).partial();
    pub static DIVERGENCE: Key<Vector<2>> = key(
        "divergence_mrad",
        Vector("the full angles, horizontal and vertical"),
        "The full angles of divergence, horizontal and vertical; each is greater than 0 and less than 1000.",
    )
    .required("`divergence_mrad = [3.0, 1.5]`, the full angles, horizontal and vertical");
    /// Whether the divergence counts at half of the maximum, and not at 1/e².
    pub static KIND: Key<Choice<bool>> = key(
        "kind",
        Choice(&[("fwhm", true), ("1/e2", false)]),
        "Where on the profile of the beam the divergence counts: at half of the maximum, or at 1/e² of it, which is 1.70 times \
         as wide.",
    )
    .required(
        "`kind = \"1/e2\"`, or \"fwhm\" where the data sheet states the full width at half maximum, which is 1.70 times less",
    );
    pub static EXIT_RADIUS: Key<Number> = key(
        "exit_radius_m",
        Number::NOT_NEGATIVE,
        "The radius of the beam at 1/e² where it leaves the sensor, in both axes.",
    )
    .or("0.0");
    pub static SAMPLES: Key<NumberChoice<Samples>> = key(
        "samples",
        NumberChoice(&Samples::ALL),
        "The sub-rays of a beam: its axis and rings about it, all of the same energy.",
    )
    .or("7");
}

/// `[receiver]`.
pub(crate) mod receiver {
    use super::*;

    /// Most range pairs: data sheets have two or three.
    pub const MOST_PAIRS: usize = 64;
    pub static KEYS: TableKeys = table(
        "`[receiver]`",
        &[
            &RANGE_PAIRS,
            &BEAMS,
            &WAVELENGTH,
            &DETECTION,
            &FALSE_ALARM,
            &PULSE_FWHM,
            &RETURNS,
            &SEPARATION,
            &INTENSITY,
            &SPACING,
            &BOUNCES,
            &WALK_RESIDUAL,
            &SATURATION,
            &SUN_SHARE,
            &SUN_KLX,
            &INTERFERENCE,
            &INTERFERENCE_SNR,
            &CROSSTALK,
            &OVERLAP,
            &DETECTOR,
            &SPAD_CYCLES,
            &SPAD_BIN,
            &SPAD_DEAD,
            &SPAD_BACKGROUND,
        ],
    )
    .partial();
    pub static RANGE_PAIRS: Key<List<Vector<2>>> = key(
        "range_pairs",
        List { of: Vector("reflectance, range in metres"), least: 1 },
        "How far planes are detected that face the sensor: a list of [reflectance, metres], such as [[0.1, 90.0], [0.8, 260.0]]; \
         left out: any light is detected.",
    );
    pub static BEAMS: Key<Tables> = key(
        "beams",
        Tables::in_braces(&BEAMS_KEYS, 0).at_most(MOST_PAIRS),
        "The rows whose beams see less far than that, each group with its own range pairs.",
    );
    /// A table of `beams`.
    pub static BEAMS_KEYS: TableKeys = table("an element of `beams`", &[&ROWS, &PAIRS_OF_ROWS]);
    pub static ROWS: Key<List<Integer<usize>>> = key(
        "rows",
        List { of: Integer::within(0, MAX_SIDE), least: 1 },
        "The rows of the image, from 0 at the top.",
    )
    .required("`rows = [0, 1]`, the rows of the image, from 0 at the top");
    pub static PAIRS_OF_ROWS: Key<List<Vector<2>>> = key(
        "range_pairs",
        List { of: Vector("reflectance, range in metres"), least: 1 },
        "How far these beams see planes that face them: a list of [reflectance, metres].",
    )
    .required("`range_pairs = [[0.1, 50.0]]`, how far these beams see");
    pub static WAVELENGTH: Key<Number> = key(
        "wavelength_nm",
        Number::within(Included(200.0), Included(2500.0)),
        "The wavelength of the light.",
    )
    .or("905.0");
    pub static DETECTION: Key<Number> = key(
        "detection",
        Number::within(Excluded(0.0), Excluded(1.0)),
        "The probability with which a plane is detected at its range in `range_pairs`.",
    )
    .or("0.5");
    pub static FALSE_ALARM: Key<Number> = key(
        "false_alarm",
        Number::within(Included(0.0), Included(0.1)),
        "The probability that a pulse without any light gives a return.",
    )
    .or("0.0");
    pub static PULSE_FWHM: Key<Number> =
        key("pulse_fwhm_ns", Number::POSITIVE, "The full width at half maximum of a pulse.").or("5.0");
    pub static RETURNS: Key<WordOrCount<ReturnMode>> = key(
        "returns",
        WordOrCount {
            words: Choice(&[
                ("strongest", ReturnMode::Strongest),
                ("first", ReturnMode::First),
                ("last", ReturnMode::Last),
                ("dual", ReturnMode::Dual),
            ]),
            counts: Integer::within(1, 16),
            of: ReturnMode::Several,
        },
        "The returns of a pulse that are reported; \"dual\" are the strongest and the last, and a number is so many of the \
         strongest, nearest first.",
    )
    .or("\"strongest\"");
    pub static SEPARATION: Key<Number> =
        key("separation_m", Number::NOT_NEGATIVE, "The least distance between two returns of a pulse.")
            .or("0.0");
    pub static INTENSITY: Key<Choice<IntensityScale>> = key(
        "intensity",
        Choice(&[
            ("ideal", IntensityScale::Ideal),
            ("percent", IntensityScale::Percent),
            ("velodyne", IntensityScale::Velodyne),
            ("vls128", IntensityScale::Vls128),
            ("livox", IntensityScale::Livox),
            ("hesai", IntensityScale::Hesai),
            ("ouster", IntensityScale::OusterReflectivity),
        ]),
        "The scale of intensities: \"ideal\" is the reflectivity itself, the others are those of vendors.",
    )
    .or("\"ideal\"");
    pub static SPACING: Key<Number> = key(
        "spacing_m",
        Number::NOT_NEGATIVE,
        "The distance between the optical axes of transmitter and receiver, on which the gain of retroreflectors depends.",
    )
    .or("0.0");
    pub static BOUNCES: Key<Integer<u32>> = key(
        "bounces",
        Integer::within(0, 16),
        "The number of reflections by mirrors, panes and water that light is followed through.",
    )
    .or("3");
    pub static WALK_RESIDUAL: Key<Number> = key(
        "walk_residual",
        Number::SHARE,
        "The share of the range walk of a fixed threshold that is left after the sensor's own correction.",
    )
    .or("0.0");
    pub static SATURATION: Key<Number> = key(
        "saturation_snr",
        Number::POSITIVE.or_infinite(),
        "The signal-to-noise ratio at which the receiver saturates; left out: it never does.",
    );
    pub static SUN_SHARE: Key<Number> = key(
        "sun_share",
        Number::within(Included(0.0), Excluded(1.0)),
        "The share of the noise's variance that sunlight makes where the range pairs hold.",
    )
    .or("0.0");
    pub static SUN_KLX: Key<Number> =
        key("sun_klx", Number::POSITIVE, "The illuminance at which the range pairs hold.").or("100.0");
    pub static INTERFERENCE: Key<Number> = key(
        "interference_hz",
        Number::NOT_NEGATIVE,
        "The pulses of other sensors that arrive, on average a second.",
    )
    .or("0.0");
    pub static INTERFERENCE_SNR: Key<Number> =
        key("interference_snr", Number::POSITIVE, "The mean signal-to-noise ratio of a foreign pulse.")
            .or("20.0");
    pub static CROSSTALK: Key<Number> = key(
        "crosstalk",
        Number::SHARE,
        "The share of each return's light that the other channels receive which fire at the same time, at the same range.",
    )
    .or("0.0");
    pub static OVERLAP: Key<Vector<2>> = key(
        "overlap_m",
        Vector("from, to"),
        "The ranges from which and to which the fields of view of transmitter and receiver come to overlap; nearer air is not seen.",
    )
    .or("[0.9, 1.0]");
    /// Whether the detector counts photons.
    pub static DETECTOR: Key<Choice<bool>> = key(
        "detector",
        Choice(&[("linear", false), ("spad", true)]),
        "What receives the light: \"linear\" measures its power, and \"spad\" (a single-photon avalanche diode) counts photons in a \
         histogram.",
    )
    .or("\"linear\"");
    pub static SPAD_CYCLES: Key<Integer<u32>> = key(
        "spad_cycles",
        Integer::within(1, 1_000_000),
        "The cycles of a histogram: those of the laser times the diodes that look at the same place.",
    );
    pub static SPAD_BIN: Key<Number> =
        key("spad_bin_ns", Number::POSITIVE, "The width of a bin of the histogram; 1 ns is 15 cm.");
    pub static SPAD_DEAD: Key<Number> = key(
        "spad_dead_ns",
        Number::POSITIVE.or_infinite(),
        "The time for which a diode is blind after a count; left out: until the next cycle.",
    );
    pub static SPAD_BACKGROUND: Key<Number> = key(
        "spad_background_hz",
        Number::NOT_NEGATIVE,
        "The counts a second that a diode has without the pulse where the range pairs hold, of sunlight and in the dark; left out: \
         none.",
    );
}

/// `[noise]`.
pub(crate) mod noise {
    use super::*;

    pub static KEYS: TableKeys =
        table("`[noise]`", &[&FLOOR, &A, &B, &BIAS, &GAIN, &ANGLE, &BEAM_ANGLE, &UNIT]).partial();
    pub static FLOOR: Key<Number> = key(
        "range_floor_m",
        Number::NOT_NEGATIVE,
        "The standard deviation of a range at any signal-to-noise ratio.",
    )
    .or("0.0");
    pub static A: Key<Number> = key(
        "range_a_m",
        Number::NOT_NEGATIVE,
        "The standard deviation a of a range at a signal-to-noise ratio of 1; at others it is a·SNR^−b, and adds to the floor in \
         squares.",
    )
    .or("0.0");
    pub static B: Key<Number> = key(
        "range_b",
        Number::NOT_NEGATIVE,
        "The exponent b by which that falls with the signal-to-noise ratio.",
    )
    .or("0.6");
    pub static BIAS: Key<Number> = key(
        "bias_m",
        Number::NOT_NEGATIVE,
        "The standard deviation of the beams' range biases, which the seed fixes.",
    )
    .or("0.0");
    pub static GAIN: Key<Number> = key(
        "gain",
        Number::NOT_NEGATIVE,
        "The standard deviation of the logarithm of the beams' gains, which the seed fixes.",
    )
    .or("0.0");
    pub static ANGLE: Key<Number> = key(
        "angle_deg",
        Number::NOT_NEGATIVE,
        "The standard deviation of the direction of each pulse, along each of two axes.",
    )
    .or("0.0");
    pub static BEAM_ANGLE: Key<Number> = key(
        "beam_angle_deg",
        Number::NOT_NEGATIVE,
        "The standard deviation of the beams' directions, which the seed fixes, along each of two axes.",
    )
    .or("0.0");
    pub static UNIT: Key<Number> = key(
        "range_unit_m",
        Number::NOT_NEGATIVE,
        "The unit to multiples of which ranges are rounded; 0: they are not.",
    )
    .or("0.0");
}

/// `[blooming]`.
pub(crate) mod blooming {
    use super::*;

    pub static KEYS: TableKeys =
        table("`[blooming]`", &[&CORE, &HALO, &HALO_ANGLE, &EXPONENT, &REACH]).partial();
    pub static CORE: Key<Number> = key(
        "core_deg",
        Number::NOT_NEGATIVE,
        "The standard deviation σ of the core exp(−Δ²/2σ²) at the angle Δ beside a return; 0: there is no core.",
    )
    .or("0.0");
    pub static HALO: Key<Number> =
        key("halo", Number::SHARE, "The height A of the halo A/(1 + (Δ/θ)²)^p, relative to the return.")
            .or("0.0");
    pub static HALO_ANGLE: Key<Number> =
        key("halo_deg", Number::POSITIVE, "The width θ of the halo; a halo needs one.");
    pub static EXPONENT: Key<Number> =
        key("exponent", Number::POSITIVE, "The exponent p of the halo.").or("1.0");
    pub static REACH: Key<Number> = key(
        "reach_deg",
        Number::within(Excluded(0.0), Included(20.0)),
        "The angle beyond which no light is spread.",
    )
    .required("`reach_deg = 2.0`, the angle beyond which no light is spread");
}
