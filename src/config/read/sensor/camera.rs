//! `[pinhole]`, `[fisheye]`, `[equirectangular]` and `[orthographic]`.

use super::super::super::keys::sensor::FRAME_RATE;
use super::super::super::keys::sensor::camera as keys;
use super::super::super::kinds::{List, Number};
use super::super::super::plausibility;
use super::super::super::table::{Key, Table};
use super::limit::check_rays;
use glam::DVec3;

use crate::angle::Angle;
use crate::frame::Pose;
use crate::sensor::{
    BrownConrady, Camera, CameraError, KannalaBrandt, Lens, Orthographic, Raster, Registered, Shutter,
};
use crate::source::{Doubt, Spanned};

/// A pinhole; `distortion` has OpenCV's 4, 5 or 8 numbers.
pub(super) fn pinhole(t: &Table<'_>) -> Option<Camera> {
    let camera = behind_pinhole(t, true);
    with_registered(t, camera?)
}

/// A camera behind a pinhole; `has_times` says whether its table has the keys of times.
fn behind_pinhole(t: &Table<'_>, has_times: bool) -> Option<Camera> {
    let names = "k1, k2, p1, p2, then k3, then k4, k5, k6";
    let lens = lens(t, &keys::DISTORTION, &[4, 5, 8], names, |c| {
        let mut all = [0.0; 8];
        all[..c.len()].copy_from_slice(c);
        BrownConrady::new(all).map(Lens::BrownConrady)
    });
    let fields = (t.read(&keys::HFOV), t.read(&keys::VFOV));
    camera(t, has_times, lens, Lens::Ideal, &keys::HFOV, fields, "hfov_deg = 87.0")
}

/// A camera with the colour camera of its table, if there is one.
fn with_registered(t: &Table<'_>, camera: Camera) -> Option<Camera> {
    if !t.has(&keys::REGISTERED) {
        return Some(camera);
    }
    let t = t.read(&keys::REGISTERED)?.value;
    let colour = behind_pinhole(&t, false);
    let [roll, pitch, yaw] = t.value(&keys::RPY);
    if let Some(doubt) = plausibility::rpy(keys::RPY.name(), [roll, pitch, yaw]) {
        t.report().doubt(t.span_of(&keys::RPY), doubt);
    }
    let [roll, pitch, yaw] = [roll, pitch, yaw].map(Angle::deg);
    let position = DVec3::from_array(t.value(&keys::POSITION));
    let depth_from_colour = Pose::from_rpy(position, roll, pitch, yaw);
    Some(camera.with_registered(Registered { camera: colour?, depth_from_colour }))
}

/// A fisheye; `distortion` has OpenCV's 4 numbers, and none is an equidistant lens.
pub(super) fn fisheye(t: &Table<'_>) -> Option<Camera> {
    let from = |c: &[f64]| KannalaBrandt::new(c.try_into().ok()?).map(Lens::KannalaBrandt);
    let lens = lens(t, &keys::FISHEYE_DISTORTION, &[4], "k1, k2, k3, k4", from);
    let fields = (t.read(&keys::FISHEYE_HFOV), None);
    let example = "hfov_deg = 180.0";
    let camera = camera(t, true, lens, from(&[0.0; 4])?, &keys::FISHEYE_HFOV, fields, example);
    with_registered(t, camera?)
}

/// The lens of a `distortion`: `Some(None)` if that is left out.
fn lens(
    t: &Table<'_>,
    key: &Key<List<Number>>,
    counts: &[usize],
    names: &str,
    from: impl Fn(&[f64]) -> Option<Lens>,
) -> Option<Option<Lens>> {
    if !t.has(key) {
        return Some(None);
    }
    let given = t.read(key)?;
    let values: Vec<f64> = given.value.iter().map(|number| number.value).collect();
    if !counts.contains(&values.len()) {
        let message = format!("`{}` has {} numbers", key.name(), values.len());
        let counts: Vec<String> = counts.iter().map(usize::to_string).collect();
        t.report().error(given.span, message, format!("expected {}: {names}", counts.join(" or ")), None);
        return None;
    }
    from(&values).map(Some)
}

/// A camera behind `lens` or, if none is given, `default`, with its horizontal and vertical fields of view as they were read.
/// `example` is a right `hfov_key`.
fn camera(
    t: &Table<'_>,
    has_times: bool,
    lens: Option<Option<Lens>>,
    default: Lens,
    hfov_key: &Key<Number>,
    (hfov, vfov): (Option<Spanned<f64>>, Option<Spanned<f64>>),
    example: &str,
) -> Option<Camera> {
    let width = t.read(&keys::WIDTH);
    let height = t.read(&keys::HEIGHT);
    let rate = if has_times { t.read(&FRAME_RATE) } else { None };
    let rows = height.map(|height| height.value);
    let shutter = if has_times { shutter(t, rows, rate.map(|rate| rate.value)) } else { Shutter::GLOBAL };
    let (fx, fy) = (t.read(&keys::FX), t.read(&keys::FY));
    let (cx, cy) = (t.read(&keys::CX), t.read(&keys::CY));

    let intrinsics: [&Key<Number>; 4] = [&keys::FX, &keys::FY, &keys::CX, &keys::CY];
    let intrinsic = intrinsics.into_iter().find(|key| t.has(*key));
    match (t.has(hfov_key), intrinsic) {
        (true, Some(key)) => {
            let span = t.report().later(t.span_of(hfov_key), t.span_of(key));
            let message = format!("{} has both `hfov_deg` and `{}`", t.title(), key.name());
            let help = "give the field of view or the intrinsics: each follows from the other";
            t.report().error(span, message, "one too many", Some(help.into()));
            return None;
        }
        (false, Some(_)) => t.need(&keys::FX, "`fx_px`, the horizontal focal length in pixels"),
        (false, None) => {
            let help =
                format!("`{example}`, the horizontal field of view, or the intrinsics from `fx_px` on");
            t.need(hfov_key, &help);
        }
        (true, None) if hfov.is_none() => return None, // reported when it was read
        (true, None) => {}
    }
    let (width, height, lens) = (width?, height?, lens?.unwrap_or(default));
    let doubt = |given: Option<Spanned<f64>>, rule: &dyn Fn(f64) -> Option<Doubt>| {
        if let Some((at, doubt)) = given.and_then(|at| Some((at, rule(at.value)?))) {
            t.report().doubt(at.span, doubt);
        }
    };
    let sides = (width.value as f64, height.value as f64);
    doubt(hfov, &|degrees| plausibility::field_of_view(hfov_key.name(), degrees));
    doubt(vfov, &|degrees| plausibility::field_of_view(keys::VFOV.name(), degrees));
    doubt(fx, &|focal| plausibility::focal_length(keys::FX.name(), focal, sides.0));
    doubt(fy, &|focal| plausibility::focal_length(keys::FY.name(), focal, sides.1));
    doubt(fy, &|fy| plausibility::focal_lengths(keys::FY.name(), fx?.value, fy));
    doubt(cx, &|at| plausibility::principal_point(keys::CX.name(), at, sides.0));
    doubt(cy, &|at| plausibility::principal_point(keys::CY.name(), at, sides.1));
    check_rays(t.report(), height.value, width.value, width.span)?;
    let size = (width.value as usize, height.value as usize);
    let (half_width, half_height) = (width.value as f64 / 2.0, height.value as f64 / 2.0);
    // A wrong rate has been reported. The camera is made without one, to find what else is wrong.
    let rate_hz = rate.map(|r| r.value);
    let made = match hfov {
        Some(hfov) => focal_length(half_width, hfov.value, &lens).and_then(|fx| {
            let fy = vfov.map_or(Ok(fx), |vfov| focal_length(half_height, vfov.value, &lens))?;
            Camera::new(size, (fx, fy), (half_width, half_height), rate_hz)
        }),
        None => {
            let fx = fx?;
            let or = |given: Option<Spanned<f64>>, default: f64| given.map_or(default, |at| at.value);
            let centre = (or(cx, half_width), or(cy, half_height));
            Camera::new(size, (fx.value, or(fy, fx.value)), centre, rate_hz)
        }
    };
    made.map(|camera| camera.with_lens(lens).with_shutter(shutter))
        .map_err(|error| {
            let of = |at: Option<Spanned<f64>>| at.map(|at| at.span);
            let span = match error {
                CameraError::NoPixels => Some(width.span),
                CameraError::FieldOfView => of(hfov),
                CameraError::FocalLength => of(fx).or(of(hfov)),
                CameraError::PrincipalPoint => of(cx).or(of(cy)),
                CameraError::Rate => of(rate),
            };
            let label = match (error, hfov, vfov) {
                (CameraError::FieldOfView, Some(h), Some(v)) => format!("{} by {} degrees", h.value, v.value),
                (CameraError::FieldOfView, Some(hfov), None) => format!("{} degrees", hfov.value),
                _ => String::new(),
            };
            t.report().error(span.unwrap_or(t.span), error.to_string(), label, None);
        })
        .ok()
}

/// The focal length in pixels with which `half` an image's width reaches half of a field of view.
fn focal_length(half: f64, fov_deg: f64, lens: &Lens) -> Result<f64, CameraError> {
    let angle = Angle::deg(fov_deg).radians() / 2.0;
    if !(angle > 0.0 && angle <= std::f64::consts::PI) {
        return Err(CameraError::FieldOfView);
    }
    let drawn = match lens {
        Lens::Ideal => (angle < std::f64::consts::FRAC_PI_2).then(|| libm::tan(angle)),
        _ => lens.project(glam::DVec3::new(libm::sin(angle), 0.0, libm::cos(angle))).map(|p| p.x),
    };
    drawn.filter(|&x| x > 0.0).map(|x| half / x).ok_or(CameraError::FieldOfView)
}

/// A spherical image, or a part of one.
pub(super) fn equirectangular(t: &Table<'_>) -> Option<Raster> {
    let (width, height) = (t.read(&keys::WIDTH), t.read(&keys::HEIGHT));
    let rate = t.read(&FRAME_RATE);
    let shutter = shutter(t, height.map(|height| height.value), rate.map(|rate| rate.value));
    let (hfov, vfov) = (t.read_or_default(&keys::PANORAMA_HFOV), t.read_or_default(&keys::PANORAMA_VFOV));
    let (width, height) = (width?, height?);
    check_rays(t.report(), height.value, width.value, width.span)?;
    let size = (width.value as usize, height.value as usize);
    let fields = (Angle::deg(hfov?.value), Angle::deg(vfov?.value));
    Raster::equirectangular(size, fields, rate.map(|rate| rate.value))
        .map(|raster| raster.with_shutter(shutter))
        .map_err(|error| t.report().error(t.span, error.to_string(), "", None))
        .ok()
}

/// A camera of parallel rays; its pixels are square unless the image has a height of its own.
pub(super) fn orthographic(t: &Table<'_>) -> Option<Orthographic> {
    let (width, height) = (t.read(&keys::WIDTH), t.read(&keys::HEIGHT));
    let rate = t.read(&FRAME_RATE);
    let shutter = shutter(t, height.map(|height| height.value), rate.map(|rate| rate.value));
    let (width_m, height_m) = (t.read(&keys::WIDTH_M), t.read(&keys::HEIGHT_M));
    let (width, height, width_m) = (width?, height?, width_m?.value);
    check_rays(t.report(), height.value, width.value, width.span)?;
    let square_m = width_m / width.value as f64 * height.value as f64;
    let size_m = (width_m, height_m.map_or(square_m, |height| height.value));
    Orthographic::new((width.value as usize, height.value as usize), size_m, rate.map(|rate| rate.value))
        .map(|camera| camera.with_shutter(shutter))
        .map_err(|error| t.report().error(t.span, error.to_string(), "", None))
        .ok()
}

/// The shutter of an image of so many rows.
fn shutter(t: &Table<'_>, rows: Option<u64>, rate_hz: Option<f64>) -> Shutter {
    let (row_time, order) = (t.read_or_default(&keys::ROW_TIME), t.value(&keys::ROW_ORDER));
    let Some(row_time) = row_time else { return Shutter::GLOBAL };
    if let (Some(rows), Some(rate_hz)) = (rows, rate_hz)
        && let Some(doubt) = plausibility::row_time(keys::ROW_TIME.name(), row_time.value, rows, rate_hz)
    {
        t.report().doubt(row_time.span, doubt);
    }
    if t.has(&keys::ROW_ORDER) && row_time.value == 0.0 {
        t.report().doubt(t.span_of(&keys::ROW_ORDER), plausibility::order_of_no_rows(keys::ROW_ORDER.name()));
    }
    Shutter::rolling(row_time.value / 1e6, order).unwrap_or(Shutter::GLOBAL)
}
