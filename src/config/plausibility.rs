//! Values that are valid and probably not what was meant: each rule is a function of the values alone, and says which unit or
//! order they are probably in.
//!
//! The room `plausibility` has the rules that depend on the scene, such as for a sensor that stands below the floor.

use std::f64::consts::PI;

use glam::DVec3;

use super::job::Sequence;

use crate::frame::Pose;
use crate::motion::{Interpolation, Path};
use crate::output::{CloudFrame, CloudTime, Format};
use crate::physics::detection::Sensitivity;
use crate::source::Doubt;
use crate::source::words::{list, number};

/// Degrees of a radian, as messages write them.
const DEGREES: &str = "57.2958";

/// Angles of turns that people write often in radians, each with how near a number comes to it in three or four digits: the
/// turns that are rounded to two digits are few.
const TURNS: &[(f64, f64)] = &[
    (PI, 2e-3),
    (PI / 2.0, 2e-3),
    (2.0 * PI, 4e-3),
    (PI / 4.0, 5e-4),
    (3.0 * PI / 4.0, 5e-4),
    (PI / 3.0, 5e-4),
    (2.0 * PI / 3.0, 5e-4),
    (PI / 6.0, 5e-4),
];

fn is_turn_in_radians(value: f64) -> bool {
    TURNS.iter().any(|(turn, tolerance)| (value.abs() - turn).abs() < *tolerance)
}

/// A key of a stereo camera that its method does not use.
pub(super) fn key_of_other_method(key: &str, is_matched: bool) -> Doubt {
    let (method, other) = if is_matched { ("match", "analytic") } else { ("analytic", "match") };
    let message = format!("`{key}` is of the method \"{other}\", and the camera's is \"{method}\"");
    Doubt::new("key-of-other-method", key, message).label("does nothing")
}

/// A setting of dots beside a pattern that has none.
pub(super) fn dots_beside_a_pattern(key: &str) -> Doubt {
    let message = format!("`{key}` is a setting of dots, and the projector's `pattern` is an image");
    Doubt::new("dots-beside-a-pattern", key, message).label("does nothing")
}

/// Roll, pitch and yaw that are a part of a turn in radians.
pub(super) fn rpy(key: &str, rpy: [f64; 3]) -> Option<Doubt> {
    let turn = rpy.into_iter().find(|angle| is_turn_in_radians(*angle))?;
    // Next to an angle that no one writes in radians, it is a calibration's.
    let all_small = rpy.iter().all(|angle| angle.abs() <= 2.0 * PI + 0.01);
    all_small.then(|| {
        Doubt::new("rpy-in-radians", key, format!("`{key}` has {turn} degrees, a part of a turn in radians"))
            .label("are these radians?")
            .help(format!(
                "if they are, multiply each by {DEGREES}: {turn} is {:.0} degrees",
                turn.to_degrees()
            ))
    })
}

/// A quaternion that only stands upright if its w comes first.
pub(super) fn quaternion(key: &str, xyzw: [f64; 4]) -> Option<Doubt> {
    let up = |q: [f64; 4]| Some(Pose::from_quaternion(DVec3::ZERO, q)?.direction(DVec3::Z).z);
    let [w, x, y, z] = xyzw;
    let (as_given, w_first) = (up(xyzw)?, up([x, y, z, w])?);
    (as_given < 0.1 && w_first > 0.5).then(|| {
        let side = if as_given < -0.5 { "upside down" } else { "on its side" };
        Doubt::new("quaternion-order", key, format!("`{key}` turns the sensor {side}"))
            .label("is w the first of these?")
            .help(format!("if it is, write it last: `{key} = [{x:?}, {y:?}, {z:?}, {w:?}]`"))
    })
}

/// A field of view that is one in radians.
pub(super) fn field_of_view(key: &str, degrees: f64) -> Option<Doubt> {
    (degrees > 0.2 && degrees <= PI + 1e-3).then(|| {
        Doubt::new("fov-in-radians", key, format!("a field of view of {degrees} degrees"))
            .label("is this in radians?")
            .help(format!("if it is, multiply it by {DEGREES}: `{key} = {:.1}`", degrees.to_degrees()))
    })
}

/// A sector that is a part of a turn in radians.
pub(super) fn sector(key: &str, (from, to): (f64, f64)) -> Option<Doubt> {
    let is_radians = is_turn_in_radians(from) || is_turn_in_radians(to);
    (is_radians && from.abs().max(to.abs()) <= 2.0 * PI + 0.01).then(|| {
        Doubt::new("sector-in-radians", key, format!("the sector goes from {from} to {to} degrees"))
            .label("are these radians?")
            .help(format!("if they are, multiply each by {DEGREES}"))
    })
}

/// A focal length that is hardly in pixels; `side_px` is the image's width, or its height for the vertical one.
pub(super) fn focal_length(key: &str, focal_px: f64, side_px: f64) -> Option<Doubt> {
    // A twentieth of the image's side is a field of view of 169 degrees behind a pinhole, and of three turns behind a fisheye.
    (focal_px < side_px / 20.0).then(|| {
        let doubt = Doubt::new(
            "focal-length-unit",
            key,
            format!("`{key}` is {} pixels in an image of {side_px}: nearly half the world", number(focal_px)),
        );
        let help = if focal_px < 3.0 {
            format!("if it is a part of the image's side, write `{key} = {}`", number(focal_px * side_px))
        } else {
            "a focal length in millimetres is to be divided by the size of a pixel".to_owned()
        };
        doubt.label("is this in pixels?").help(help)
    })
}

/// Focal lengths that differ much, though pixels are nearly square.
pub(super) fn focal_lengths(key: &str, fx_px: f64, fy_px: f64) -> Option<Doubt> {
    let ratio = fx_px.max(fy_px) / fx_px.min(fy_px);
    (ratio > 1.5).then(|| {
        Doubt::new("focal-lengths-differ", key, format!("`fx_px` is {fx_px} and `fy_px` is {fy_px}"))
            .label(format!("pixels {ratio:.1} times as long as wide?"))
            .help("leave `fy_px` out for square pixels")
    })
}

/// A principal point that is no place in the image in pixels.
pub(super) fn principal_point(key: &str, at_px: f64, side_px: f64) -> Option<Doubt> {
    let doubt = |message: String| Doubt::new("principal-point", key, message);
    if at_px > 0.0 && at_px <= 1.0 && side_px > 4.0 {
        let help = format!("if it is a part of the image's side, write `{key} = {}`", at_px * side_px);
        return Some(doubt(format!("`{key}` is {at_px}, in the first pixel")).label("in pixels?").help(help));
    }
    (at_px < 0.0 || at_px > side_px)
        .then(|| doubt(format!("`{key}` is {at_px}, outside the image, which ends at {side_px}")))
}

/// The largest distance of a beam's origin from the head's centre that a sensor of today has, with room to spare.
const LARGEST_HEAD_M: f64 = 1.0;

/// Beams that begin farther from the head's centre than any head is wide.
pub(super) fn beam_origins(key: &str, origins: impl IntoIterator<Item = DVec3>) -> Option<Doubt> {
    let farthest = origins.into_iter().map(DVec3::length).fold(0.0, f64::max);
    (farthest > LARGEST_HEAD_M && farthest.is_finite()).then(|| {
        Doubt::new("beam-origin-unit", key, format!("a beam begins {farthest:.3} m from the head's centre"))
            .label("are these millimetres?")
            .help("if they are, divide each by 1000")
    })
}

/// A length inside a sensor that is longer than any sensor.
pub(super) fn offset_in_head(key: &str, offset_m: f64) -> Option<Doubt> {
    (offset_m > LARGEST_HEAD_M).then(|| {
        Doubt::new("beam-origin-unit", key, format!("`{key}` is {offset_m} m, more than a head is wide"))
            .label("is this in millimetres?")
            .help(format!("if it is, write `{key} = {}`", offset_m / 1000.0))
    })
}

/// A range that only a unit other than metres explains.
pub(super) fn least_range(key: &str, min_m: f64) -> Option<Doubt> {
    (min_m > 200.0).then(|| {
        Doubt::new("range-unit", key, format!("nothing nearer than {min_m} m is seen"))
            .label("is this in millimetres?")
            .help(format!("if it is, write `{key} = {}`", min_m / 1000.0))
    })
}

/// The part of a range by which a fit of range pairs may miss one of them, before it is told.
const MOST_MISFIT: f64 = 0.1;

/// Range pairs that no power of the range fits.
pub(super) fn pairs_misfit(key: &str, fit: &Sensitivity) -> Option<Doubt> {
    (fit.misfit > MOST_MISFIT).then(|| {
        let message = format!(
            "the fit of the range pairs misses one of them by {:.0} % of its range: power falls with the range to the {:.2}",
            fit.misfit * 1e2,
            fit.exponent
        );
        Doubt::new("range-pairs-misfit", key, message)
            .label("these pairs do not fit together")
            .help("pairs of one mode and one probability of detection agree better; two pairs always fit")
    })
}

/// Pairs of some beams that don't fit to the exponent of all pairs.
pub(super) fn pairs_of_beams_misfit(key: &str, misfit: f64) -> Option<Doubt> {
    (misfit > MOST_MISFIT).then(|| {
        let message = format!(
            "power falls with the range as the receiver's own pairs say, and misses a pair of these beams by {:.0} % of its range",
            misfit * 1e2
        );
        Doubt::new("range-pairs-misfit", key, message)
            .label("these pairs do not fit to those of the other beams")
            .help("the beams of a sensor differ by a factor of power alone; one pair always fits")
    })
}

/// A range pair beyond the largest range.
pub(super) fn pair_beyond_limit(key: &str, range_m: f64, max_m: f64) -> Doubt {
    let message = format!("a plane is detected up to {range_m} m, and `max_m` is {max_m} m");
    Doubt::new("range-pair-beyond-limit", key, message)
        .label("farther than the sensor reports")
        .help(format!("returns end at `max_m`; write `max_m = {range_m}` if they should not"))
}

/// The time of a row of a rolling shutter with which the next frame begins before this one has ended.
pub(super) fn row_time(key: &str, row_time_us: f64, rows: u64, rate_hz: f64) -> Option<Doubt> {
    let (rows, period_us) = (rows as f64, 1e6 / rate_hz);
    // The last row has its time, too, before the first one's comes again.
    let all_us = row_time_us * rows;
    (all_us > period_us * (1.0 + 1e-9)).then(|| {
        let message = format!(
            "{rows} rows of {} µs take {} ms, and a frame's period is {} ms",
            number(row_time_us),
            number(all_us / 1e3),
            number(period_us / 1e3)
        );
        let doubt = Doubt::new("row-time", key, message);
        if row_time_us <= period_us {
            let help =
                format!("if it is the time of all rows, write `{key} = {}`", number(row_time_us / rows));
            doubt.label("is this the time of one row?").help(help)
        } else if row_time_us / 1e3 * rows <= period_us {
            let help = format!("if it is, write `{key} = {}`", number(row_time_us / 1e3));
            doubt.label("is this in nanoseconds?").help(help)
        } else {
            doubt.label("longer than a frame")
        }
    })
}

/// An exposure that lasts longer than the frame.
pub(super) fn exposure(key: &str, exposure_s: f64, rate_hz: f64) -> Option<Doubt> {
    let period_s = 1.0 / rate_hz;
    (exposure_s > period_s * (1.0 + 1e-9)).then(|| {
        let message = format!(
            "the exposure takes {} ms, and a frame's period is {} ms",
            number(exposure_s * 1e3),
            number(period_s * 1e3)
        );
        let doubt = Doubt::new("exposure", key, message);
        if exposure_s / 1e3 <= period_s {
            let help = format!("if it is, write `{key} = {}`", number(exposure_s / 1e3));
            doubt.label("is this in milliseconds?").help(help)
        } else {
            doubt.label("longer than a frame")
        }
    })
}

/// An exposure of which a pixel sees one moment only.
pub(super) fn exposure_of_one_ray(key: &str, exposure_s: f64, samples: u32) -> Option<Doubt> {
    (exposure_s > 0.0 && samples == 1).then(|| {
        Doubt::new("exposure", key, "a pixel of one sub-ray sees one moment of the exposure")
            .label("changes nothing")
            .help("`samples = 4` sees 16 moments of it")
    })
}

/// The order of the rows of a global shutter, which sees them all at once.
pub(super) fn order_of_no_rows(key: &str) -> Doubt {
    Doubt::new("row-order", key, "all rows are exposed at once, so that they have no order")
        .label("chooses nothing")
        .help("`row_time_us`, the time from one row to the next, makes the shutter a rolling one")
}

/// The distance from poses that are given to what moves smoothly through them, above which it is told: 1 mm.
const MOST_DEVIATION_M: f64 = 1e-3;

/// Poses that are so far apart that a body could be elsewhere between them.
pub(super) fn pose_spacing(path: &Path) -> Option<Doubt> {
    let deviation = path.deviation().filter(|deviation| deviation.most_m > MOST_DEVIATION_M)?;
    let times = path.times_s();
    let span_s = times[deviation.after + 1] - times[deviation.after];
    // The deviation grows with the square of the time between poses.
    let enough_s = span_s * (MOST_DEVIATION_M / deviation.most_m).sqrt();
    let (why, other) = match path.interpolation() {
        Interpolation::Linear => {
            ("it turns as it goes", "`interpolation = \"screw\"` follows the turn; else ")
        }
        Interpolation::Screw => ("its velocity changes from here to the next pose", ""),
    };
    let message =
        format!("after this pose, the body may be up to {:.1} mm elsewhere: {why}", deviation.most_m * 1e3);
    let doubt = Doubt::new("pose-spacing", "trajectory", message);
    Some(doubt.label(format!("the next pose is {} s later", number(span_s))).help(format!(
        "{other}a pose every {} s would keep it to 1 mm",
        number((enough_s * 1e3).floor().max(1.0) / 1e3)
    )))
}

/// Sensors and a body that have no pose.
pub(super) fn no_pose() -> Doubt {
    Doubt::new("no-pose", "pose", "the sensor has no pose, and so stands at the world's origin")
        .help("such as `pose = { position_m = [0.0, 0.0, 1.8] }`; an empty `pose = {}` says that it is meant")
}

/// A path that a shell would have to read first.
pub(super) fn home_folder(key: &str, path: &str) -> Option<Doubt> {
    path.starts_with("~/").then(|| {
        Doubt::new("home-folder", key, format!("`{key}` begins with `~`, which is the name of a folder here"))
            .label("the shell's sign for the home folder")
            .help("write the path in full, or relative to this file")
    })
}

/// Channels that are chosen for formats of which none holds channels.
pub(super) fn channels_of_nothing() -> Doubt {
    let all = Format::all().filter(|format| format.holds_channels()).map(Format::name);
    Doubt::new("channels-of-nothing", "output.channels", "none of the formats holds channels")
        .label("chooses nothing")
        .help(format!("the formats that hold channels are {}", list(all, "and")))
}

/// A time to which clouds are to be compensated that compensates nothing.
pub(super) fn compensation_of_nothing(sequence: &Sequence, cloud_frame: CloudFrame) -> Option<Doubt> {
    if sequence.cloud_time == CloudTime::Raw {
        return None;
    }
    let (why, help) = if sequence.is_frozen {
        ("nothing moves during a frozen frame", "leave `motion` out to cast each pulse at its own time")
    } else if cloud_frame == CloudFrame::World {
        (
            "points in the world are at their own time",
            "`output.frame = \"sensor\"` has the sensor's motion in it",
        )
    } else {
        return None;
    };
    let doubt =
        Doubt::new("compensation-of-nothing", "cloud_time", format!("`cloud_time` changes nothing: {why}"));
    Some(doubt.label("compensates nothing").help(help))
}

/// Weather or sunlight that no sensor is made to see.
pub(super) fn weather_without_receiver(key: &str) -> Doubt {
    let message = format!("`[{key}]` changes nothing: no sensor has a receiver with range pairs");
    Doubt::new("weather-without-receiver", key, message).label("no sensor measures light").help(
        "give a sensor `[sensor.receiver]` with `range_pairs`, or `nominal = true` if its preset has them",
    )
}

/// Masks of boxes that are not asked for.
pub(super) fn masks_of_nothing() -> Doubt {
    Doubt::new("masks-of-nothing", "truth.masks", "there are masks in boxes only, and no boxes are asked for")
        .help("`boxes = \"tracked\"` has those of actors and animated nodes")
}

#[cfg(test)]
#[expect(clippy::approx_constant, reason = "the tests have angles as people type them")]
mod tests {
    use super::*;

    fn code(doubt: Option<Doubt>) -> &'static str {
        doubt.map_or("", |doubt| doubt.code)
    }

    #[test]
    fn turns_in_radians() {
        for wrong in
            [[0.0, 0.0, 1.5708], [0.0, 0.785, 0.0], [3.14159, 0.0, 0.0], [0.0, 0.0, -1.57], [0.1, 0.0, 3.14]]
        {
            assert_eq!(code(rpy("rpy_deg", wrong)), "rpy-in-radians", "{wrong:?}");
        }
        for right in [
            [0.0; 3],
            [0.0, 0.0, 90.0],
            [0.0, 1.5, 0.0],
            [0.5, -0.3, 0.1],
            [0.0, 1.5708, 90.0],
            [0.0, 1.0, 2.0],
        ] {
            assert_eq!(code(rpy("rpy_deg", right)), "", "{right:?}");
        }
        assert_eq!(code(sector("sector_deg", (PI, -PI))), "sector-in-radians");
        assert_eq!(code(sector("sector_deg", (1.5708, -1.5708))), "sector-in-radians");
        for right in [(180.0, -180.0), (5.0, -5.0), (0.0, 360.0)] {
            assert_eq!(code(sector("sector_deg", right)), "", "{right:?}");
        }
        assert_eq!(code(field_of_view("hfov_deg", 1.5)), "fov-in-radians");
        assert_eq!(code(field_of_view("hfov_deg", 5.0)), "");
    }

    #[test]
    fn quaternions_with_w_first() {
        let half = 0.5_f64.sqrt();
        for wrong in [
            [1.0, 0.0, 0.0, 0.0],
            [half, 0.0, 0.0, half],
            [0.9962, 0.0, 0.0872, 0.0],
            [0.96, 0.02, 0.01, 0.28],
        ] {
            assert_eq!(code(quaternion("quaternion_xyzw", wrong)), "quaternion-order", "{wrong:?}");
        }
        // A turn about z by half a turn, a pitch, a sensor that hangs (about y), and a camera on its side about x, by less.
        for right in [
            [0.0, 0.0, 0.0, 1.0],
            [0.0, 0.0, 1.0, 0.0],
            [0.0, half, 0.0, half],
            [0.0, 1.0, 0.0, 0.0],
            [0.5, 0.0, 0.0, 0.87],
        ] {
            assert_eq!(code(quaternion("quaternion_xyzw", right)), "", "{right:?}");
        }
    }

    #[test]
    fn intrinsics() {
        assert_eq!(code(focal_length("fx_px", 0.9, 640.0)), "focal-length-unit");
        assert_eq!(code(focal_length("fx_px", 4.1, 640.0)), "focal-length-unit");
        assert_eq!(code(focal_length("fx_px", 102.0, 640.0)), "");
        assert_eq!(code(focal_length("fx_px", 0.9, 4.0)), "");
        assert_eq!(code(focal_lengths("fy_px", 600.0, 60.0)), "focal-lengths-differ");
        assert_eq!(code(focal_lengths("fy_px", 600.0, 480.0)), "");
        assert_eq!(code(principal_point("cx_px", 0.5, 640.0)), "principal-point");
        assert_eq!(code(principal_point("cx_px", -3.0, 640.0)), "principal-point");
        assert_eq!(code(principal_point("cx_px", 700.0, 640.0)), "principal-point");
        assert_eq!(code(principal_point("cx_px", 319.5, 640.0)), "");
    }

    #[test]
    fn lengths() {
        let mm = [DVec3::new(27.67, 0.0, 0.0)];
        assert_eq!(code(beam_origins("beam_origins_m", mm)), "beam-origin-unit");
        assert_eq!(code(beam_origins("beam_origins_m", mm.map(|o| o / 1000.0))), "");
        assert_eq!(code(offset_in_head("range_offset_m", 27.67)), "beam-origin-unit");
        assert_eq!(code(offset_in_head("range_offset_m", 0.02767)), "");
        assert_eq!(code(least_range("min_m", 500.0)), "range-unit");
        assert_eq!(code(least_range("min_m", 0.5)), "");
        assert_eq!(code(row_time("row_time_us", 15.0, 1080, 30.0)), "");
        assert_eq!(code(row_time("row_time_us", 1e6 / 30.0 / 1080.0, 1080, 30.0)), "");
        for wrong in [31.0, 15_000.0, 33_333.0, 1e9] {
            assert_eq!(code(row_time("row_time_us", wrong, 1080, 30.0)), "row-time", "{wrong}");
        }
        let helped = |row_us| {
            row_time("row_time_us", row_us, 1000, 50.0).and_then(|doubt| doubt.help).unwrap_or_default()
        };
        assert!(
            helped(16_000.0).contains("row_time_us = 16`") && helped(1e9).is_empty(),
            "{}",
            helped(16_000.0)
        );
        assert_eq!(code(exposure("exposure_s", 1.0 / 30.0, 30.0)), "");
        assert_eq!(code(exposure("exposure_s", 0.034, 30.0)), "exposure");
        let told = exposure("exposure_s", 12.8, 30.0).and_then(|doubt| doubt.help).unwrap_or_default();
        assert!(told.contains("exposure_s = 0.0128`"), "{told}");
        assert_eq!(
            [(0.0, 1), (0.01, 2)].map(|(s, n)| code(exposure_of_one_ray("exposure_s", s, n))),
            [""; 2]
        );
        assert_eq!(code(exposure_of_one_ray("exposure_s", 0.01, 1)), "exposure");
        assert!(helped(20_000.5).is_empty() || helped(20_000.5).contains("row_time_us = 20.0005"));
        assert_eq!(code(home_folder("scene", "~/a.glb")), "home-folder");
        assert_eq!(code(home_folder("scene", "~a.glb")), "");
    }
}
