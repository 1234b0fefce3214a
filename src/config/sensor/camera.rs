//! `[pinhole]`, `[fisheye]` and `[equirectangular]`.

use super::super::section::Section;
use super::{MAX_SIDE, check_rays};
use crate::angle::Angle;
use crate::sensor::{BrownConrady, Camera, CameraError, KannalaBrandt, Lens, Raster};
use crate::source::{Report, Spanned};

/// A pinhole; `distortion` has OpenCV's 4, 5 or 8 numbers.
pub(super) fn pinhole(report: &Report, s: &Section<'_>) -> Option<Camera> {
    let lens = lens(report, s, &[4, 5, 8], "k1, k2, p1, p2, then k3, then k4, k5, k6", |c| {
        let mut all = [0.0; 8];
        all[..c.len()].copy_from_slice(c);
        BrownConrady::new(all).map(Lens::BrownConrady)
    });
    camera(report, s, lens, Lens::Ideal, "hfov_deg = 87.0")
}

/// A fisheye; `distortion` has OpenCV's 4 numbers, and none is an equidistant lens.
pub(super) fn fisheye(report: &Report, s: &Section<'_>) -> Option<Camera> {
    let from = |c: &[f64]| KannalaBrandt::new(c.try_into().ok()?).map(Lens::KannalaBrandt);
    let lens = lens(report, s, &[4], "k1, k2, k3, k4", from);
    camera(report, s, lens, from(&[0.0; 4])?, "hfov_deg = 180.0")
}

/// The lens of `distortion`: `Some(None)` if that is left out.
fn lens(
    report: &Report,
    s: &Section<'_>,
    counts: &[usize],
    names: &str,
    from: impl Fn(&[f64]) -> Option<Lens>,
) -> Option<Option<Lens>> {
    if s.get("distortion").is_none() {
        return Some(None);
    }
    let given = s.numbers("distortion")?;
    let values: Vec<f64> = given.value.iter().map(|at| at.value).collect();
    if !counts.contains(&values.len()) {
        let message = format!("`distortion` has {} numbers", values.len());
        let counts: Vec<String> = counts.iter().map(usize::to_string).collect();
        report.error(given.span, message, format!("expected {}: {names}", counts.join(" or ")), None);
        return None;
    }
    from(&values).map(Some)
}

/// A camera behind `lens` or, if none is given, `default`. `example` is a field of view.
fn camera(
    report: &Report,
    s: &Section<'_>,
    lens: Option<Option<Lens>>,
    default: Lens,
    example: &str,
) -> Option<Camera> {
    let is_pinhole = default == Lens::Ideal;
    s.need("width_px", "`width_px = 640`");
    s.need("height_px", "`height_px = 480`");
    let width = s.integer("width_px", 1, MAX_SIDE);
    let height = s.integer("height_px", 1, MAX_SIDE);
    let rate = s.positive("rate_hz", false);
    let hfov = s.number("hfov_deg");
    let vfov = if is_pinhole { s.number("vfov_deg") } else { None };
    let fx = s.positive("fx_px", false);
    let fy = s.positive("fy_px", false);
    let (cx, cy) = (s.number("cx_px"), s.number("cy_px"));

    let intrinsic = ["fx_px", "fy_px", "cx_px", "cy_px"].into_iter().find(|key| s.get(key).is_some());
    match (s.get("hfov_deg"), intrinsic) {
        (Some(hfov), Some(key)) => {
            let span = s.get(key).map_or(hfov.span, |node| report.later(hfov.span, node.span));
            let message = format!("{} has both `hfov_deg` and `{key}`", s.title());
            let help = "give the field of view or the intrinsics: each follows from the other";
            report.error(span, message, "one too many", Some(help.into()));
            return None;
        }
        (None, Some(_)) => s.need("fx_px", "`fx_px`, the horizontal focal length in pixels"),
        (None, None) => {
            let help =
                format!("`{example}`, the horizontal field of view, or the intrinsics from `fx_px` on");
            s.need("hfov_deg", &help);
        }
        (Some(_), None) => {}
    }
    let (width, height, lens) = (width?, height?, lens?.unwrap_or(default));
    check_rays(report, height.value, width.value, width.span)?;
    let size = (width.value as usize, height.value as usize);
    let (half_width, half_height) = (width.value as f64 / 2.0, height.value as f64 / 2.0);
    // A rate that is there and wrong has been reported; the camera is made without, for what else there is to say.
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
    made.map(|camera| camera.with_lens(lens))
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
            report.error(span.unwrap_or(s.span), error.to_string(), label, None);
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
pub(super) fn equirectangular(report: &Report, s: &Section<'_>) -> Option<Raster> {
    s.need("width_px", "`width_px = 2048`");
    s.need("height_px", "`height_px = 1024`");
    let width = s.integer("width_px", 1, MAX_SIDE);
    let height = s.integer("height_px", 1, MAX_SIDE);
    let rate = s.positive("rate_hz", false);
    let fov = |key: &str, most: f64| match (s.get(key), s.number(key)) {
        (None, _) => Some(most),
        (Some(_), Some(at)) if at.value > 0.0 && at.value <= most => Some(at.value),
        (Some(_), Some(at)) => {
            let message = format!("`{key}` is {}", at.value);
            report.error(at.span, message, format!("expected more than 0 and at most {most} degrees"), None);
            None
        }
        _ => None,
    };
    let (hfov, vfov) = (fov("hfov_deg", 360.0), fov("vfov_deg", 180.0));
    let (width, height) = (width?, height?);
    check_rays(report, height.value, width.value, width.span)?;
    let size = (width.value as usize, height.value as usize);
    Raster::equirectangular(size, (Angle::deg(hfov?), Angle::deg(vfov?)), rate.map(|r| r.value))
        .map_err(|error| report.error(s.span, error.to_string(), "", None))
        .ok()
}
