//! Kalibr's cameras: a table of a camchain file, or a camera file of its own.
//!
//! Of Kalibr's models, beamcast has the pinhole with the distortion `radtan` (k1, k2, p1, p2, as in OpenCV) or `equidistant`
//! (k1 to k4 of OpenCV's fisheye), or without one (wiki of Kalibr, "Supported models").

use super::super::fields::Fields;
use super::calibration::{Calibration, LensKeys, MOST_PIXELS, check_focal, from_corner};
use crate::source::Spanned;

pub(super) fn read(fields: &Fields<'_>) -> Option<Calibration> {
    let lens = lens(fields)?;
    let size = resolution(fields);
    let numbers = intrinsics(fields);
    let ([width, height], [fx, fy, cx, cy]) = (size?, numbers?);
    let focal = check_focal(fields, "intrinsics", [fx, fy])?;
    Some(Calibration {
        width,
        height,
        focal,
        principal: from_corner([cx, cy]),
        lens,
        used: "resolution, intrinsics, distortion".to_owned(),
        notes: vec![
            "Left out: the poses of the cameras to each other and to an IMU, and time offsets; poses go into the job."
                .to_owned(),
        ],
    })
}

/// The lens, if the projection is a pinhole's.
fn lens(fields: &Fields<'_>) -> Option<LensKeys> {
    let file = fields.file();
    // Command lines and some files join projection and distortion: pinhole-radtan.
    let named = fields.text("camera_model").unwrap_or("pinhole");
    let (projection, joined) = named.split_once('-').map_or((named, None), |(p, d)| (p, Some(d)));
    let reason = match projection {
        "pinhole" => return distortion(fields, joined),
        "omni" => "the omnidirectional model has a mirror's parameter xi, which no lens of beamcast has",
        "ds" => "no lens of beamcast is a double sphere (xi, alpha)",
        "eucm" => "no lens of beamcast is the extended unified model (alpha, beta)",
        _ => "the camera model is unknown",
    };
    let help = "calibrate it as pinhole-radtan, or as pinhole-equi if it is a fisheye".to_owned();
    let message = format!("the camera model is `{projection}`: {reason}");
    file.fail(fields.span("camera_model"), message, "expected pinhole", help)
}

fn distortion(fields: &Fields<'_>, joined: Option<&str>) -> Option<LensKeys> {
    let file = fields.file();
    let given = joined.or_else(|| fields.text("distortion_model")).unwrap_or("none");
    let (is_fisheye, names) = match given {
        "none" => return Some(LensKeys::pinhole(Vec::new())),
        "radtan" => (false, "k1, k2, p1, p2"),
        "equidistant" | "equi" => (true, "k1, k2, k3, k4"),
        _ => {
            let message = match given {
                "fov" => "the distortion model is `fov`, which no lens of beamcast has".to_owned(),
                other => format!("the distortion model `{other}` is unknown"),
            };
            let help = "calibrate it with radtan, or with equi if it is a fisheye".to_owned();
            let key = if joined.is_some() { "camera_model" } else { "distortion_model" };
            return file.fail(fields.span(key), message, "expected radtan, equidistant or none", help);
        }
    };
    let key = "distortion_coeffs";
    fields.need(key, &format!("the list of {names}"))?;
    let Spanned { value: coefficients, span } = fields.numbers(key)?;
    if coefficients.len() != 4 {
        let message = format!("`{}` has {} numbers", fields.path(key), coefficients.len());
        return file.fail(span, message, format!("expected 4: {names}"), None);
    }
    Some(if is_fisheye { LensKeys::fisheye(coefficients) } else { LensKeys::pinhole(coefficients) })
}

/// fx, fy, cx, cy.
fn intrinsics(fields: &Fields<'_>) -> Option<[f64; 4]> {
    let key = "intrinsics";
    fields.need(key, "the list of fx, fy, cx, cy in pixels")?;
    let Spanned { value, span } = fields.numbers(key)?;
    <[f64; 4]>::try_from(value).ok().or_else(|| {
        let message = format!("`{}` has not four numbers", fields.path(key));
        fields.file().fail(span, message, "expected fx, fy, cx, cy", None)
    })
}

fn resolution(fields: &Fields<'_>) -> Option<[u32; 2]> {
    let key = "resolution";
    fields.need(key, "the list of the image's columns and rows")?;
    let Spanned { value, span } = fields.numbers(key)?;
    let side = |x: f64| (x.fract() == 0.0 && x >= 1.0 && x <= f64::from(MOST_PIXELS)).then_some(x as u32);
    let sides: Option<Vec<u32>> = value.iter().map(|x| side(*x)).collect();
    match sides.as_deref() {
        Some([width, height]) => Some([*width, *height]),
        _ => {
            let message = format!("`{}` is no size of an image", fields.path(key));
            fields.file().fail(span, message, "expected the whole numbers of columns and rows", None)
        }
    }
}
