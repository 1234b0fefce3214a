//! The keys of a sensor file: patterns, range limits, ring order, modes.

use std::ops::Bound::{Excluded, Included, Unbounded};

use super::super::kinds::{
    ByName, Choice, Flag, Integer, List, Names, Nested, Number, OneOrEach, Tables, Text, Vector,
};
use super::super::table::{AnyKey, Key, TableKeys, key, table};
use super::angles::{Angles, MAX_SIDE};
use super::depth::{STEREO, STRUCTURED_LIGHT, TOF};
use super::measurement::{BLOOMING, FOOTPRINT, NOISE, NOMINAL, RECEIVER};
use crate::sensor::{Limited, Motion, Order, RingOrder, RowOrder, Tilted};

const SIDE: Integer<u64> = Integer::within(1, MAX_SIDE);

pub(crate) static SENSOR_FILE: TableKeys = table(
    "a sensor file",
    &[
        &ROTATING,
        &RASTER,
        &MIRROR,
        &RISLEY,
        &RAYS,
        &PINHOLE,
        &FISHEYE,
        &EQUIRECTANGULAR,
        &ORTHOGRAPHIC,
        &RANGE,
        &RING,
        &FOOTPRINT,
        &RECEIVER,
        &NOISE,
        &BLOOMING,
        &STEREO,
        &STRUCTURED_LIGHT,
        &TOF,
        &NOMINAL,
        &MODES,
    ],
)
.one_of(PATTERNS);
pub(crate) static MODE_KEYS: TableKeys = table(
    "a mode",
    &[
        &ROTATING,
        &RASTER,
        &MIRROR,
        &RISLEY,
        &RAYS,
        &PINHOLE,
        &FISHEYE,
        &EQUIRECTANGULAR,
        &ORTHOGRAPHIC,
        &RANGE,
        &FOOTPRINT,
        &RECEIVER,
        &NOISE,
        &BLOOMING,
        &STEREO,
        &STRUCTURED_LIGHT,
        &TOF,
        &NOMINAL,
    ],
);

/// The tables of a sensor of which one is its pattern.
pub(crate) const PATTERNS: &[&dyn AnyKey] =
    &[&ROTATING, &RASTER, &MIRROR, &RISLEY, &RAYS, &PINHOLE, &FISHEYE, &EQUIRECTANGULAR, &ORTHOGRAPHIC];
pub(crate) static ROTATING: Key<Nested> =
    key("rotating", Nested(&rotating::KEYS), "A LiDAR with a turning head.");
pub(crate) static RASTER: Key<Nested> =
    key("raster", Nested(&raster::KEYS), "A grid of azimuths and elevations: line scans, flashes.");
pub(crate) static MIRROR: Key<Nested> =
    key("mirror", Nested(&mirror::KEYS), "Beams on a mirror that moves about two axes.");
pub(crate) static RISLEY: Key<Nested> = key("risley", Nested(&risley::KEYS), "Beams through turning prisms.");
pub(crate) static RAYS: Key<Nested> = key("rays", Nested(&rays::KEYS), "Rays from a table.");
pub(crate) static PINHOLE: Key<Nested> = key("pinhole", Nested(&camera::PINHOLE_KEYS), "A depth camera.");
pub(crate) static FISHEYE: Key<Nested> =
    key("fisheye", Nested(&camera::FISHEYE_KEYS), "A camera with a fisheye lens.");
pub(crate) static EQUIRECTANGULAR: Key<Nested> =
    key("equirectangular", Nested(&camera::EQUIRECTANGULAR_KEYS), "A spherical image, or a part of one.");
pub(crate) static ORTHOGRAPHIC: Key<Nested> =
    key("orthographic", Nested(&camera::ORTHOGRAPHIC_KEYS), "A depth camera of parallel rays.");
pub(crate) static RANGE: Key<Nested> = key(
    "range",
    Nested(&range::KEYS),
    "What is nearer or farther gives no return; what is nearer hides what is behind it.",
);
pub(crate) static RING: Key<Choice<RingOrder>> = key(
    "ring",
    Choice(&[("row", RingOrder::Row), ("bottom_up", RingOrder::BottomUp), ("file", RingOrder::File)]),
    "What a cloud's ring counts: the image's rows from the top, from the bottom, or the order of the beam table.",
)
.or("\"row\"");
pub(crate) static MODES: Key<ByName<Nested>> = key(
    "modes",
    ByName {
        of: Nested(&MODE_KEYS),
        names: Names::Any("modes"),
        example: "`[modes.2048x10.rotating]`, then `columns = 2048`",
    },
    "What differs in the unit's modes, by their names; a job chooses one with `mode`.",
);

/// Keys of several patterns.
pub(crate) static BEAMS: Key<List<Vector<2>>> = key(
    "beams_deg",
    List { of: Vector("azimuth, elevation"), least: 1 },
    "Azimuth and elevation of each beam in degrees; left out: one straight ahead.",
);
pub(crate) static PULSE_RATE: Key<Number> =
    key("pulse_rate_hz", Number::POSITIVE, "Pulses of each beam a second.")
        .required("`pulse_rate_hz = 100000.0`, the pulses of each beam a second");
/// The frame rate of a pattern that can do without one.
pub(crate) static FRAME_RATE: Key<Number> = key("rate_hz", Number::POSITIVE, "Frames a second.");
/// The frame rate of a pattern that never repeats.
pub(crate) static NEEDED_FRAME_RATE: Key<Number> =
    key("rate_hz", Number::POSITIVE, "Frames a second.").required("`rate_hz = 10.0`, the frames a second");

/// `[rotating]`.
pub(crate) mod rotating {
    use super::*;

    pub static KEYS: TableKeys = table(
        "`[rotating]`",
        &[
            &ELEVATIONS,
            &AZIMUTH_OFFSETS,
            &BEAM_TIMES,
            &CYCLE,
            &BEAM_ORIGINS,
            &RANGE_OFFSET,
            &RANGE_FROM,
            &TURNS_WHILE_FIRING,
            &LAYOUT,
            &PIXEL_SHIFTS,
            &COLUMNS,
            &SECTOR,
            &RATE,
        ],
    )
    .partial();
    pub static ELEVATIONS: Key<Angles> = key(
        "elevations_deg",
        Angles::ELEVATIONS,
        "One a beam, degrees, up positive: a list in any order, or evenly spaced ones.",
    )
    .required("`elevations_deg = { from = 15.0, to = -15.0, count = 16 }`, or a list, one a beam");
    pub static AZIMUTH_OFFSETS: Key<List<Number>> = key(
        "azimuth_offsets_deg",
        List { of: Number::ANY, least: 0 },
        "One a beam, degrees, counterclockwise seen from above: added to the column's azimuth; left out: 0.",
    );
    pub static BEAM_TIMES: Key<List<Number>> = key(
        "beam_times_us",
        List { of: Number::ANY, least: 0 },
        "One a beam, microseconds after the column's own time, negative before it; left out: 0.",
    );
    /// Units have two or four; the bound keeps a small file from asking for much memory.
    pub const MOST_PHASES: usize = 16;
    pub static CYCLE: Key<Tables> = key(
        "cycle",
        Tables::in_braces(&PHASE, 1).at_most(MOST_PHASES),
        "What differs from column to column, if beams fire in turns: one table a column, over and over.",
    );
    pub static BEAM_ORIGINS: Key<OneOrEach<Vector<3>>> = key(
        "beam_origins_m",
        OneOrEach(Vector("x, y, z in the head's frame")),
        "Where beams leave the head: [x, y, z] for all, or one a beam; x forward at the head's azimuth, y left, z up, metres.",
    )
    .or("[0.0, 0.0, 0.0]");
    pub static RANGE_OFFSET: Key<Number> = key(
        "range_offset_m",
        Number::NOT_NEGATIVE,
        "How far before a beam's origin its range begins, as the unit reports it, in metres.",
    )
    .or("0.0");
    /// Whether ranges count from the sensor's origin.
    pub static RANGE_FROM: Key<Choice<bool>> = key(
        "range_from",
        Choice(&[("beam", false), ("origin", true)]),
        "What ranges count from, as the unit reports them: along the beam, or in a straight line from the sensor's origin.",
    )
    .or("\"beam\"");
    pub static TURNS_WHILE_FIRING: Key<Flag> = key(
        "turns_while_firing",
        Flag,
        "Whether the head turns on while the beams of a column fire one after the other.",
    )
    .or("false");
    /// Whether the image is destaggered.
    pub static LAYOUT: Key<Choice<bool>> = key(
        "layout",
        Choice(&[("staggered", false), ("destaggered", true)]),
        "The image as it is measured, or with its rows moved so that columns are azimuths.",
    )
    .or("\"staggered\"");
    pub static PIXEL_SHIFTS: Key<List<Number>> = key(
        "pixel_shift_by_row",
        List { of: Number::ANY, least: 0 },
        "One a beam: by how many columns a destaggered image moves its row; left out: as the azimuth offsets say.",
    );
    pub static COLUMNS: Key<Integer<u64>> = key("columns", SIDE, "Firings in the sector.")
        .required("`columns = 1800`, the firings in the sector");
    pub static SECTOR: Key<Nested> = key(
        "sector_deg",
        Nested(&SECTOR_KEYS),
        "Azimuths in degrees, counterclockwise from forward. A full turn has no repeated last column.",
    )
    .or("{ from = 180.0, to = -180.0 }");
    pub static RATE: Key<Number> =
        key("rate_hz", Number::POSITIVE, "Turns a second.").required("`rate_hz = 10.0`, the turns a second");

    pub static PHASE: TableKeys = table("a column of `cycle`", &[&PHASE_TIMES, &SILENT_BEAMS]);
    pub static PHASE_TIMES: Key<List<Number>> = key(
        "beam_times_us",
        List { of: Number::ANY, least: 0 },
        "One a beam, as above; left out: the times above.",
    );
    pub static SILENT_BEAMS: Key<List<Integer<usize>>> = key(
        "silent_beams",
        List { of: Integer::within(0, MAX_SIDE), least: 0 },
        "The beams that don't fire in this column, by their place in the list of elevations, from 0.",
    );

    pub static SECTOR_KEYS: TableKeys = table("`sector_deg`", &[&FROM, &TO]);
    pub static FROM: Key<Number> = key("from", Number::ANY, "The azimuth of the first column in degrees.")
        .required("`from = 180.0`, the azimuth of the first column in degrees");
    pub static TO: Key<Number> =
        key("to", Number::ANY, "The azimuth where the sector ends in degrees: at most 360 from its start.")
            .required("`to = -180.0`, the azimuth where the sector ends in degrees");
}

/// `[raster]`.
pub(crate) mod raster {
    use super::*;

    pub static KEYS: TableKeys =
        table("`[raster]`", &[&AZIMUTHS, &ELEVATIONS, &ORDER, &PULSE_RATE, &FRAME_RATE]).partial();
    pub static AZIMUTHS: Key<Angles> = key(
        "azimuths_deg",
        Angles::ANY,
        "One a column, degrees, counterclockwise: a list, or evenly spaced ones.",
    )
    .required("`azimuths_deg = { from = 60.0, to = -60.0, count = 600 }`, or a list");
    pub static ELEVATIONS: Key<Angles> = key(
        "elevations_deg",
        Angles::ELEVATIONS,
        "One a row, degrees, up positive: a list, or evenly spaced ones.",
    )
    .required("`elevations_deg = { from = 12.5, to = -12.5, count = 126 }`, or a list");
    pub static ORDER: Key<Choice<Order>> = key(
        "order",
        Choice(&[("lines", Order::Lines), ("back_and_forth", Order::BackAndForth), ("flash", Order::Flash)]),
        "Line by line, every other line backward, or all at once.",
    )
    .or("\"lines\"");
    pub static PULSE_RATE: Key<Number> =
        key("pulse_rate_hz", Number::POSITIVE, "Pulses a second; left out: as many as fill a frame.");
}

/// `[mirror]`.
pub(crate) mod mirror {
    use super::*;

    pub static KEYS: TableKeys =
        table("`[mirror]`", &[&AZIMUTH, &ELEVATION, &BEAMS, &PULSE_RATE, &NEEDED_FRAME_RATE]).partial();
    pub static AZIMUTH: Key<Nested> = key("azimuth", Nested(&AXIS), "How the azimuth moves.")
        .required("`azimuth = { motion = \"sine\", rate_hz = 1000.0, from_deg = 30.0, to_deg = -30.0 }`");
    pub static ELEVATION: Key<Nested> = key("elevation", Nested(&AXIS), "How the elevation moves.")
        .required("`elevation = { motion = \"triangle\", rate_hz = 10.0, from_deg = 12.0, to_deg = -12.0 }`");

    pub static AXIS: TableKeys = table("an axis of `[mirror]`", &[&MOTION, &RATE, &FROM, &TO, &PHASE]);
    pub static MOTION: Key<Choice<Motion>> = key(
        "motion",
        Choice(&[("sine", Motion::Sine), ("triangle", Motion::Triangle), ("sawtooth", Motion::Sawtooth)]),
        "How the angle goes from one end to the other, and back.",
    )
    .required("`motion = \"sine\"`, or \"triangle\" or \"sawtooth\"");
    pub static RATE: Key<Number> = key("rate_hz", Number::POSITIVE, "Periods a second.")
        .required("`rate_hz = 100.0`, the periods a second");
    pub static FROM: Key<Number> = key("from_deg", Number::ANY, "Where a period begins, in degrees.")
        .required("`from_deg = 30.0`, where a period begins");
    pub static TO: Key<Number> = key("to_deg", Number::ANY, "The other end of the motion, in degrees.")
        .required("`to_deg = -30.0`, the other end of the motion");
    pub static PHASE: Key<Number> =
        key("phase_deg", Number::ANY, "Where in its period the motion starts, in degrees of 360.").or("0.0");
}

/// `[risley]`.
pub(crate) mod risley {
    use super::*;

    pub static KEYS: TableKeys =
        table("`[risley]`", &[&PRISMS, &MIRROR, &BEAMS, &PULSE_RATE, &NEEDED_FRAME_RATE]).partial();
    pub static PRISMS: Key<Tables> =
        key("prisms", Tables::in_braces(&PRISM, 1), "The turning wedges, in the beam's way.")
            .required("`prisms = [{ rate_hz = -121.6, wedge_deg = 18.7, index = 1.51 }]`, in the beam's way");

    pub static PRISM: TableKeys = table("a prism", &[&RATE, &WEDGE, &INDEX, &PHASE, &TILTED, &RIPPLE]);
    pub static RATE: Key<Number> =
        key("rate_hz", Number::ANY, "Turns a second, negative the other way round.")
            .required("`rate_hz = 121.6`, turns a second, negative the other way round");
    pub static WEDGE: Key<Number> = key("wedge_deg", Number::ANY, "The angle between the faces in degrees.")
        .required("`wedge_deg = 18.7`, the angle between the faces");
    pub static INDEX: Key<Number> = key("index", Number::POSITIVE, "The refractive index.")
        .required("`index = 1.51`, the refractive index");
    pub static PHASE: Key<Number> =
        key("phase_deg", Number::ANY, "The angle at time 0 in degrees.").or("0.0");
    pub static TILTED: Key<Choice<Tilted>> = key(
        "tilted",
        Choice(&[("entry", Tilted::Entry), ("exit", Tilted::Exit)]),
        "Which face is the oblique one.",
    );
    pub static RIPPLE: Key<Nested> = key(
        "ripple",
        Nested(&RIPPLE_KEYS),
        "How the turning speeds up and slows down: a sine that is added to its angle; left out: a constant speed.",
    );

    pub static RIPPLE_KEYS: TableKeys = table("`ripple`", &[&RIPPLE_RATE, &AMPLITUDE, &RIPPLE_PHASE]);
    pub static RIPPLE_RATE: Key<Number> = key("rate_hz", Number::POSITIVE, "Periods a second.")
        .required("`rate_hz = 20.0`, the periods a second");
    pub static AMPLITUDE: Key<Number> =
        key("amplitude_deg", Number::ANY, "The most that is added to the angle, in degrees.")
            .required("`amplitude_deg = 8.6`, the most that is added to the angle");
    pub static RIPPLE_PHASE: Key<Number> =
        key("phase_deg", Number::ANY, "The phase of the sine at time 0, in degrees.").or("0.0");

    pub static MIRROR: Key<Nested> = key(
        "mirror",
        Nested(&MIRROR_KEYS),
        "A mirror behind the prisms that turns about their axis and sends the beams to the side; the axis is then z, not x.",
    );

    pub static MIRROR_KEYS: TableKeys =
        table("`mirror`", &[&MIRROR_RATE, &TILT, &MIRROR_INDEX, &MIRROR_PHASE]);
    pub static MIRROR_RATE: Key<Number> =
        key("rate_hz", Number::ANY, "Turns a second, counterclockwise seen from above.")
            .required("`rate_hz = -182.4`, turns a second, counterclockwise seen from above");
    pub static TILT: Key<Number> = key(
        "tilt_deg",
        Number::within(Excluded(0.0), Excluded(90.0)),
        "The angle between the axis and the mirror's normal in degrees: 45 sends the axis to the horizon.",
    )
    .required("`tilt_deg = 50.0`, the angle between the axis and the mirror's normal");
    pub static MIRROR_INDEX: Key<Number> = key(
        "index",
        Number::within(Included(1.0), Unbounded),
        "The refractive index of the block whose oblique face is the mirror; beams enter across the axis and leave along it.",
    )
    .or("1.0");
    pub static MIRROR_PHASE: Key<Number> =
        key("phase_deg", Number::ANY, "The azimuth to which the mirror looks at time 0, in degrees.")
            .or("0.0");
}

/// `[rays]`.
pub(crate) mod rays {
    use super::*;

    pub static KEYS: TableKeys = table("`[rays]`", &[&FILE, &LINES, &PULSE_RATE, &FRAME_RATE]).partial();
    pub static FILE: Key<Text> = key(
        "file",
        Text,
        "A CSV with a ray a line, relative to this file: azimuth_deg, elevation_deg (or zenith_deg) or x, y, z; time_s or time_us; origin_x_m, origin_y_m, origin_z_m. Livox's headers are read too.",
    )
    .required("`file = \"rays.csv\"`");
    pub static LINES: Key<Integer<u64>> = key(
        "lines",
        SIDE,
        "Beams that fire together: so many rays of the table that follow each other, each a row of the image.",
    )
    .or("1");
    pub static PULSE_RATE: Key<Number> = key(
        "pulse_rate_hz",
        Number::POSITIVE,
        "Pulses of each beam a second, whatever times the table has; with `rate_hz`, a frame has those of its time, and the next goes on in the table. Left out: every frame has the whole table.",
    );
}

/// `[pinhole]`, `[fisheye]`, `[equirectangular]` and `[orthographic]`.
pub(crate) mod camera {
    use super::*;

    pub static PINHOLE_KEYS: TableKeys = table(
        "`[pinhole]`",
        &[
            &WIDTH,
            &HEIGHT,
            &HFOV,
            &VFOV,
            &FX,
            &FY,
            &CX,
            &CY,
            &DISTORTION,
            &ROW_TIME,
            &ROW_ORDER,
            &FRAME_RATE,
            &REGISTERED,
        ],
    )
    .partial();
    pub static FISHEYE_KEYS: TableKeys = table(
        "`[fisheye]`",
        &[
            &WIDTH,
            &HEIGHT,
            &FISHEYE_HFOV,
            &FX,
            &FY,
            &CX,
            &CY,
            &FISHEYE_DISTORTION,
            &ROW_TIME,
            &ROW_ORDER,
            &FRAME_RATE,
            &REGISTERED,
        ],
    )
    .partial();
    pub static EQUIRECTANGULAR_KEYS: TableKeys = table(
        "`[equirectangular]`",
        &[&WIDTH, &HEIGHT, &PANORAMA_HFOV, &PANORAMA_VFOV, &ROW_TIME, &ROW_ORDER, &FRAME_RATE],
    )
    .partial();

    pub static REGISTERED: Key<Nested> = key(
        "registered",
        Nested(&REGISTERED_KEYS),
        "The colour camera beside a depth camera, in whose image the format `registered` writes depth.",
    );
    pub static REGISTERED_KEYS: TableKeys = table(
        "`[registered]`",
        &[&WIDTH, &HEIGHT, &HFOV, &VFOV, &FX, &FY, &CX, &CY, &DISTORTION, &POSITION, &RPY],
    )
    .partial();
    pub static POSITION: Key<Vector<3>> = key(
        "position_m",
        Vector("x, y, z"),
        "x (forward), y (left), z (up) in metres of the colour camera in the depth camera's body frame.",
    )
    .or("[0.0, 0.0, 0.0]");
    pub static RPY: Key<Vector<3>> = key(
        "rpy_deg",
        Vector("roll, pitch, yaw"),
        "Roll, pitch, yaw in degrees of the colour camera: R = Rz(yaw) Ry(pitch) Rx(roll); a positive pitch looks down.",
    )
    .or("[0.0, 0.0, 0.0]");
    pub static ORTHOGRAPHIC_KEYS: TableKeys = table(
        "`[orthographic]`",
        &[&WIDTH, &HEIGHT, &WIDTH_M, &HEIGHT_M, &ROW_TIME, &ROW_ORDER, &FRAME_RATE],
    )
    .partial();

    pub static WIDTH_M: Key<Number> = key(
        "width_m",
        Number::POSITIVE,
        "Width of the image in metres, from the left edge to the right, at every distance.",
    )
    .required("`width_m = 4.0`");
    pub static HEIGHT_M: Key<Number> = key(
        "height_m",
        Number::POSITIVE,
        "Height of the image in metres, if pixels aren't square; left out: they are.",
    );
    pub static WIDTH: Key<Integer<u64>> =
        key("width_px", SIDE, "Columns of the image.").required("`width_px = 640`");
    pub static HEIGHT: Key<Integer<u64>> =
        key("height_px", SIDE, "Rows of the image.").required("`height_px = 480`");
    pub static HFOV: Key<Number> = key(
        "hfov_deg",
        Number::within(Excluded(0.0), Excluded(180.0)),
        "Field of view in degrees from the left edge of the image to the right; instead of fx_px to cy_px.",
    )
    .replaces(INTRINSICS);
    pub static VFOV: Key<Number> = key(
        "vfov_deg",
        Number::within(Excluded(0.0), Excluded(180.0)),
        "Field of view from the top edge to the bottom, if pixels aren't square; with hfov_deg.",
    );
    pub static FISHEYE_HFOV: Key<Number> = key(
        "hfov_deg",
        Number::within(Excluded(0.0), Included(360.0)),
        "Field of view in degrees from the left edge of the image to the right; instead of fx_px to cy_px.",
    )
    .replaces(INTRINSICS);
    pub static PANORAMA_HFOV: Key<Number> = key(
        "hfov_deg",
        Number::within(Excluded(0.0), Included(360.0)),
        "Field of view in degrees, at most 360.",
    )
    .or("360.0");
    pub static PANORAMA_VFOV: Key<Number> = key(
        "vfov_deg",
        Number::within(Excluded(0.0), Included(180.0)),
        "Field of view in degrees, at most 180.",
    )
    .or("180.0");
    /// The keys of the intrinsics.
    const INTRINSICS: &[&str] = &["fx_px", "fy_px", "cx_px", "cy_px"];
    pub static FX: Key<Number> =
        key("fx_px", Number::POSITIVE, "Horizontal focal length in pixels; instead of hfov_deg.")
            .replaces(&["hfov_deg", "vfov_deg"]);
    pub static FY: Key<Number> =
        key("fy_px", Number::POSITIVE, "Vertical focal length in pixels; left out: fx_px.");
    pub static CX: Key<Number> = key(
        "cx_px",
        Number::ANY,
        "Principal point; the centre of the top left pixel is at (0.5, 0.5). Left out: the image's middle.",
    );
    pub static CY: Key<Number> = key(
        "cy_px",
        Number::ANY,
        "Principal point; the centre of the top left pixel is at (0.5, 0.5). Left out: the image's middle.",
    );
    pub static DISTORTION: Key<List<Number>> = key(
        "distortion",
        List { of: Number::ANY, least: 0 },
        "k1, k2, p1, p2, then k3, then k4, k5, k6, as OpenCV has them; left out: none.",
    );
    pub static FISHEYE_DISTORTION: Key<List<Number>> = key(
        "distortion",
        List { of: Number::ANY, least: 0 },
        "k1, k2, k3, k4 of OpenCV's fisheye model; left out: an equidistant lens.",
    );
    pub static ROW_TIME: Key<Number> = key(
        "row_time_us",
        Number::NOT_NEGATIVE,
        "Microseconds from a row's exposure to the next, of a rolling shutter; 0 is a global shutter: all rows at the frame's start.",
    )
    .or("0.0");
    pub static ROW_ORDER: Key<Choice<RowOrder>> = key(
        "row_order",
        Choice(&[("top_down", RowOrder::TopDown), ("bottom_up", RowOrder::BottomUp)]),
        "Which row a rolling shutter exposes first: the top or the bottom one.",
    )
    .or("\"top_down\"");
}

/// `[range]`.
pub(crate) mod range {
    use super::*;

    pub static KEYS: TableKeys = table("`[range]`", &[&MIN, &MAX, &OF]);
    pub static MIN: Key<Number> = key(
        "min_m",
        Number::NOT_NEGATIVE,
        "The least range in metres, included. What is nearer gives no return, and blocks the beam.",
    )
    .or("0.0");
    pub static MAX: Key<Number> = key(
        "max_m",
        Number::POSITIVE.or_infinite(),
        "The largest range in metres, included; left out: no limit.",
    )
    .suggested_as("50.0");
    pub static OF: Key<Choice<Limited>> = key(
        "of",
        Choice(&[("range", Limited::Range), ("depth", Limited::Depth)]),
        "What has these limits: the range along the ray, or a camera's depth along its optical axis; left out: the depth of a \
         `[pinhole]`, the range of all others.",
    );
}
