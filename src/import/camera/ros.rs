//! OpenCV's calibration files, and ROS's camera_info, as the package camera_calibration writes it or as a message is printed.
//!
//! Distortion is OpenCV's: `plumb_bob` (k1, k2, p1, p2, k3) and `rational_polynomial` (and k4, k5, k6), or `equidistant`, its
//! fisheye model (k1 … k4).
//!
//! A camera_info's size, matrix and distortion are those of the whole sensor at full resolution. Its image may be a part of it
//! (`roi`), in which pixels are combined (`binning_x`, `binning_y`).

use super::super::fields::Fields;
use super::calibration::{Calibration, LensKeys, MOST_PIXELS, check_focal, from_corner};
use crate::source::Spanned;
use crate::source::tree::Value;

/// A file with any of these keys is a camera's.
pub(in super::super) const KEYS: [&str; 6] =
    ["camera_matrix", "Camera_Matrix", "image_width", "image_Width", "distortion_model", "camera_name"];

/// The names of one key in files of camera_calibration, in OpenCV's old and new samples, and in a ROS message.
const WIDTH: &[&str] = &["image_width", "image_Width", "width"];
const HEIGHT: &[&str] = &["image_height", "image_Height", "height"];
pub(super) const MATRIX: &[&str] = &["camera_matrix", "Camera_Matrix", "K", "k"];
const DISTORTION: &[&str] =
    &["distortion_coefficients", "Distortion_Coefficients", "distortion", "dist_coeffs", "D", "d"];

pub(super) fn read(top: &Fields<'_>) -> Option<Calibration> {
    let width = named(top, WIDTH, "the number of the image's columns")
        .and_then(|key| top.integer(key, 1, MOST_PIXELS));
    let height =
        named(top, HEIGHT, "the number of the image's rows").and_then(|key| top.integer(key, 1, MOST_PIXELS));
    let matrix = named(top, MATRIX, "the camera's matrix: fx 0 cx, 0 fy cy, 0 0 1")
        .and_then(|key| intrinsics(top, key));
    let lens = lens(top);
    let (width, height, [fx, cx, fy, cy], lens) = (width?, height?, matrix?, lens?);
    let mut notes = Vec::new();
    if ["rectification_matrix", "projection_matrix", "P"].iter().any(|key| top.get(key).is_some()) {
        notes.push(
            "Left out: the rectification and the projection matrix, which apply to undistorted images."
                .to_owned(),
        );
    }
    let whole = Calibration {
        width,
        height,
        focal: [fx, fy],
        principal: from_corner([cx, cy]),
        lens,
        used: "size, camera matrix, distortion".to_owned(),
        notes,
    };
    let part = part(top, whole)?;
    binned(top, part)
}

/// The camera of the region of interest, whose fields are pixels of the whole image. Zeros are the whole image.
fn part(top: &Fields<'_>, camera: Calibration) -> Option<Calibration> {
    if top.get("roi").is_none_or(|node| matches!(node.value, Value::Null)) {
        return Some(camera);
    }
    let roi = top.table("roi")?;
    let side = |key: &str| match roi.get(key) {
        None => Some(0),
        Some(_) => roi.integer(key, 0, MOST_PIXELS),
    };
    let (x, y, width, height) = (side("x_offset"), side("y_offset"), side("width"), side("height"));
    let (x, y, width, height) = (x?, y?, width?, height?);
    if [x, y, width, height] == [0; 4] {
        return Some(camera);
    }
    // A width of 0 with an offset is what is left of the image.
    let or_rest = |given: u32, whole: u32, offset: u32| match given {
        0 => whole.saturating_sub(offset),
        given => given,
    };
    let (width, height) = (or_rest(width, camera.width, x), or_rest(height, camera.height, y));
    let fits = |offset: u32, side: u32, whole: u32| {
        side > 0 && u64::from(offset) + u64::from(side) <= u64::from(whole)
    };
    if !(fits(x, width, camera.width) && fits(y, height, camera.height)) {
        let message = format!(
            "the region of interest of {width} × {height} pixels at ({x}, {y}) is no part of the image"
        );
        let label = format!("the image has {} × {} pixels", camera.width, camera.height);
        return top.file().fail(top.span("roi"), message, label, None);
    }
    let mut camera = Calibration { width, height, ..camera };
    camera.principal[0] -= f64::from(x);
    camera.principal[1] -= f64::from(y);
    camera.notes.push(format!(
        "The image is the region of interest (roi): {width} × {height} pixels from column {x} and row {y}, by which the \
         principal point moves."
    ));
    Some(camera)
}

/// The camera whose pixels are combined. Pixel i of the image is pixels b·i to b·i + b − 1 of the sensor, so that everything in
/// pixels is divided by b, the principal point counted from the image's corner.
fn binned(top: &Fields<'_>, camera: Calibration) -> Option<Calibration> {
    let factor = |key: &str| match top.get(key) {
        None => Some(1),
        Some(_) => top.integer(key, 0, MOST_PIXELS).map(|factor| factor.max(1)),
    };
    let (bx, by) = (factor("binning_x"), factor("binning_y"));
    let (bx, by) = (bx?, by?);
    if (bx, by) == (1, 1) {
        return Some(camera);
    }
    let (width, height) = (camera.width / bx, camera.height / by);
    if width == 0 || height == 0 {
        let message = format!(
            "{bx} by {by} pixels are combined, and the image has {} × {}",
            camera.width, camera.height
        );
        let key = if width == 0 { "binning_x" } else { "binning_y" };
        return top.file().fail(top.span(key), message, "expected fewer than the image has", None);
    }
    let (b, [fx, fy], [cx, cy]) = ([f64::from(bx), f64::from(by)], camera.focal, camera.principal);
    let mut camera = Calibration {
        width,
        height,
        focal: [fx / b[0], fy / b[1]],
        principal: [cx / b[0], cy / b[1]],
        ..camera
    };
    camera.notes.push(format!(
        "Pixels are combined (binning): {bx} by {by}. Focal lengths and the principal point are divided by that, the principal \
         point counted from the corner of the image as here."
    ));
    Some(camera)
}

/// The name that the file has for a key that must be there; `meaning` completes the sentence "`key` is …".
fn named<'k>(top: &Fields<'_>, names: &[&'k str], meaning: &str) -> Option<&'k str> {
    names.iter().copied().find(|name| top.get(name).is_some()).or_else(|| {
        top.need(names[0], meaning);
        None
    })
}

/// A matrix: a list of numbers, or a table whose `data` is one.
fn numbers(top: &Fields<'_>, key: &str) -> Option<Spanned<Vec<f64>>> {
    if matches!(top.get(key)?.value, Value::Array(_)) {
        return top.numbers(key);
    }
    let table = top.table(key)?;
    table.need("data", "the matrix's numbers, row by row")?;
    table.numbers("data")
}

/// fx, cx, fy, cy of a camera's matrix, in pixels.
fn intrinsics(top: &Fields<'_>, key: &str) -> Option<[f64; 4]> {
    let Spanned { value: numbers, span } = numbers(top, key)?;
    let file = top.file();
    let &[fx, skew, cx, a, fy, cy, b, c, one] = &numbers[..] else {
        let message = format!("`{key}` has {} numbers", numbers.len());
        return file.fail(span, message, "expected 9: three rows of three", None);
    };
    check_focal(top, key, [fx, fy])?;
    if [skew, a, b, c] != [0.0; 4] || one != 1.0 {
        let label = "expected fx 0 cx, 0 fy cy, 0 0 1: pixels without skew";
        return file.fail(span, format!("`{key}` is no matrix of a pinhole camera"), label, None);
    }
    Some([fx, cx, fy, cy])
}

fn lens(top: &Fields<'_>) -> Option<LensKeys> {
    let file = top.file();
    let is_fisheye = match top.text("distortion_model") {
        Some("equidistant" | "fisheye") => true,
        None | Some("plumb_bob" | "rational_polynomial" | "none") => {
            matches!(top.text("fisheye_model"), Some("1" | "true"))
        }
        Some(_) => {
            let message = "the distortion model is unknown";
            let label = "expected plumb_bob, rational_polynomial or equidistant";
            return file.fail(top.span("distortion_model"), message, label, None);
        }
    };
    let key = DISTORTION.iter().copied().find(|key| top.get(key).is_some());
    let Spanned { value: values, span } = match key {
        Some(key) => numbers(top, key)?,
        None if is_fisheye => {
            named(top, DISTORTION, "the list of the fisheye's k1 to k4");
            return None;
        }
        None => Spanned { value: Vec::new(), span: file.whole() },
    };
    // A pinhole's list may end with OpenCV's coefficients of the thin prism and of the tilt, which are often all 0.
    let (most, fits) =
        if is_fisheye { (4, values.len() == 4) } else { (8, matches!(values.len(), 0 | 4 | 5 | 8)) };
    let more = values.get(most..).unwrap_or_default();
    if !fits && (more.is_empty() || more.iter().any(|x| *x != 0.0)) {
        let expected = if is_fisheye { "4: k1 k2 k3 k4" } else { "4, 5 or 8: k1 k2 p1 p2 k3 k4 k5 k6" };
        let message = format!("the file has {} distortion coefficients", values.len());
        return file.fail(span, message, format!("expected {expected}"), None);
    }
    let coefficients: Vec<f64> = values.into_iter().take(most).collect();
    Some(if is_fisheye { LensKeys::fisheye(coefficients) } else { LensKeys::pinhole(coefficients) })
}
