//! The intrinsics of a stream of librealsense, `rs2_intrinsics`, as JSON or YAML: `width`, `height`, `fx`, `fy`, `ppx`, `ppy`,
//! `model` and `coeffs`.
//!
//! The formulas are those of `rs2_project_point_to_pixel` and `rs2_deproject_pixel_to_point` (rsutil.h). *Brown-Conrady* is
//! OpenCV's pinhole with k1, k2, p1, p2, k3, and *Kannala-Brandt* is OpenCV's fisheye. *Modified Brown-Conrady* applies the
//! tangential terms to points that are distorted already, and equals Brown-Conrady without them. *Inverse Brown-Conrady*
//! takes pixels to directions by the same polynomial, and equals the others only if all coefficients are 0, as those of
//! rectified depth streams are.

use super::super::fields::Fields;
use super::calibration::{Calibration, LensKeys, check_focal, from_corner, size};
use crate::source::Spanned;

pub(super) fn read(fields: &Fields<'_>) -> Option<Calibration> {
    let size = size(fields, ["width", "height"]);
    // Files that were written by hand have cx and cy.
    let number = |names: &[&'static str], meaning: &str| {
        let key = names.iter().find(|key| fields.get(key).is_some()).unwrap_or(&names[0]);
        fields.need(key, meaning)?;
        fields.number(key)
    };
    let fx = number(&["fx"], "the horizontal focal length in pixels");
    let fy = number(&["fy"], "the vertical focal length in pixels");
    let cx = number(&["ppx", "cx"], "the principal point's column");
    let cy = number(&["ppy", "cy"], "the principal point's row");
    let lens = lens(fields);
    let ([width, height], fx, fy, cx, cy, lens) = (size?, fx?, fy?, cx?, cy?, lens?);
    let focal = check_focal(fields, "fx", [fx, fy])?;
    Some(Calibration {
        width,
        height,
        focal,
        principal: from_corner([cx, cy]),
        lens,
        used: "size, focal lengths, principal point, distortion".to_owned(),
        notes: Vec::new(),
    })
}

/// The distortion models of librealsense.
#[derive(Clone, Copy, PartialEq)]
enum Model {
    None,
    Modified,
    Inverse,
    Ftheta,
    Brown,
    Kannala,
}

/// The model of a name or of a number of the enum `rs2_distortion`. Names are compared by their letters, since they are written
/// as `Brown Conrady`, `brown_conrady`, `distortion.brown_conrady` or `RS2_DISTORTION_BROWN_CONRADY`.
fn model_of(name: &str) -> Option<Model> {
    const NUMBERED: [Model; 6] =
        [Model::None, Model::Modified, Model::Inverse, Model::Ftheta, Model::Brown, Model::Kannala];
    if let Ok(number) = name.parse::<usize>() {
        return NUMBERED.get(number).copied();
    }
    let letters: String = name.to_lowercase().chars().filter(char::is_ascii_alphabetic).collect();
    let letters = letters.strip_prefix("rs").unwrap_or(&letters);
    match letters.strip_prefix("distortion").unwrap_or(letters) {
        "none" => Some(Model::None),
        "modifiedbrownconrady" => Some(Model::Modified),
        "inversebrownconrady" => Some(Model::Inverse),
        "ftheta" => Some(Model::Ftheta),
        "brownconrady" => Some(Model::Brown),
        "kannalabrandt" => Some(Model::Kannala),
        _ => None,
    }
}

fn lens(fields: &Fields<'_>) -> Option<LensKeys> {
    let file = fields.file();
    let model_key = ["model", "distortion_model"].into_iter().find(|key| fields.get(key).is_some());
    let coeffs_key =
        ["coeffs", "coefficients", "distortion_coeffs"].into_iter().find(|key| fields.get(key).is_some());
    let Spanned { value: coefficients, span } = match coeffs_key {
        Some(key) => fields.numbers(key)?,
        None => Spanned { value: Vec::new(), span: file.whole() },
    };
    let is_zero = coefficients.iter().all(|c| *c == 0.0);
    let name = model_key.and_then(|key| fields.text(key));
    let Some(name) = name else {
        if is_zero {
            return Some(LensKeys::pinhole(Vec::new()));
        }
        let help = "`model` is the distortion model, such as \"Brown Conrady\"".to_owned();
        return file.fail(span, "the file has coefficients, but no model of distortion", "", help);
    };
    let model_span = fields.span(model_key.unwrap_or("model"));
    let Some(model) = model_of(name) else {
        let label = "expected None, Brown Conrady, Modified or Inverse Brown Conrady, or Kannala Brandt4";
        return file.fail(model_span, format!("the distortion model `{name}` is unknown"), label, None);
    };
    if coefficients.len() > 5 {
        let message = format!("the file has {} distortion coefficients", coefficients.len());
        return file.fail(span, message, "expected at most 5", None);
    }
    let at = |index: usize| coefficients.get(index).copied().unwrap_or(0.0);
    let five = || vec![at(0), at(1), at(2), at(3), at(4)];
    let refuse = |reason: &str| {
        let help =
            "calibrate the stream with OpenCV's model, or leave the coefficients out on purpose".to_owned();
        file.fail(model_span, format!("the distortion model is `{name}`: {reason}"), "", help)
    };
    match model {
        Model::Kannala => Some(LensKeys::fisheye(five()[..4].to_vec())),
        Model::Ftheta => refuse("no lens of beamcast has this formula"),
        _ if is_zero => Some(LensKeys::pinhole(Vec::new())),
        Model::None => refuse("the coefficients are not 0"),
        Model::Brown => Some(LensKeys::pinhole(five())),
        Model::Modified if (at(2), at(3)) == (0.0, 0.0) => Some(LensKeys::pinhole(five())),
        Model::Modified => refuse(
            "its tangential coefficients act on points that are distorted already, and OpenCV's do not",
        ),
        Model::Inverse => refuse(
            "its coefficients take pixels to directions, and those of beamcast's lenses directions to pixels",
        ),
    }
}
